"""The models that are compared: one line each, a curve each.

A further model is a further line in `MODELS`; a further code is a module in `codes` with MODULE and `build` (see
`codes.process.Code`), and a line in `CODES`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY

EQUILIBRIUM: Final = "equilibrium"
COMPANION: Final = "companion"
BRACKET: Final = "bracket"

Mesh = Literal["uniform", "graded"]
MESHES: Final[tuple[Mesh, ...]] = ("uniform", "graded")


class Code(NamedTuple):
    """A code: its name, the Python module it comes as, the module of `codes` that uses it, how to get it."""

    name: str
    library: str
    module: str
    remedy: str = ""


CODES: Final[Mapping[str, Code]] = {
    EQUILIBRIUM: Code("the equilibrium model", "qvi_contact", "equilibrium"),
    COMPANION: Code("the companion", "qvi_contact", "companion"),
    BRACKET: Code("the bracket", "qvi_contact", "equilibrium"),
    "ngsolve": Code("NGSolve", "ngsolve", "ngsolve_nitsche", "python -m pip install 'qvi-contact[peers]'"),
    "getfem": Code(
        "GetFEM", "getfem", "getfem_bricks",
        "apt install python3-getfem on Debian or Ubuntu, then --getfem /usr/bin/python3",
    ),
}  # fmt: skip
"""Key → code."""


@dataclass(frozen=True)
class Model:
    """A discretisation of the plate.

    Attributes
    ----------
    name : as tables call it
    code : a key of `CODES`
    mesh : "uniform", or "graded" towards the free corner
    colour, marker, line : of its curve; no two models on the same kind of mesh share both colour and marker
    options : what the code's `build` takes beside the case

    """

    name: str
    code: str
    mesh: Mesh
    colour: str
    marker: str
    line: str
    options: Mapping[str, Any] = field(default_factory=dict)


def _nitsche(order: int, variant: str) -> dict[str, Any]:
    return {"order": order, "variant": variant}


BLACK: Final = "#000000"

MODELS: Final = (
    Model("equilibrium, uniform", EQUILIBRIUM, "uniform", BLUE, "o", "-"),
    Model("equilibrium, graded", EQUILIBRIUM, "graded", BLUE, "o", "-"),
    Model("companion, p = 2, uniform", COMPANION, "uniform", SKY, "s", "--", {"degree": 2}),
    Model("companion, p = 2, graded", COMPANION, "graded", SKY, "s", "--", {"degree": 2}),
    Model("companion, p = 3, uniform", COMPANION, "uniform", SKY, "D", ":", {"degree": 3}),
    Model("companion, p = 3, graded", COMPANION, "graded", SKY, "D", ":", {"degree": 3}),
    Model("NGSolve, p = 2, incomplete, uniform", "ngsolve", "uniform", ORANGE, "^", "-", _nitsche(2, "incomplete")),
    Model("NGSolve, p = 2, skew, uniform", "ngsolve", "uniform", GREY, "<", "-.", _nitsche(2, "skew")),
    Model("NGSolve, p = 2, symmetric, uniform", "ngsolve", "uniform", VERMILLION, "v", "--", _nitsche(2, "symmetric")),
    Model("NGSolve, p = 2, symmetric, graded", "ngsolve", "graded", VERMILLION, "v", "--", _nitsche(2, "symmetric")),
    Model("NGSolve, p = 3, symmetric, uniform", "ngsolve", "uniform", PURPLE, "P", ":", _nitsche(3, "symmetric")),
    Model("NGSolve, p = 3, symmetric, graded", "ngsolve", "graded", PURPLE, "P", ":", _nitsche(3, "symmetric")),
    Model("GetFEM, Q2, uniform", "getfem", "uniform", GREEN, ">", "-."),
    Model("GetFEM, Q2, graded", "getfem", "graded", GREEN, ">", "-."),
    Model("bracket, p = 2, uniform", BRACKET, "uniform", BLACK, "x", "-", {"bracket": 2}),
    Model("bracket, p = 3, graded", BRACKET, "graded", BLACK, "x", "-", {"bracket": 3}),
)
"""All models, in the order of the tables."""

NAMED: Final[Mapping[str, Model]] = {model.name: model for model in MODELS}
"""Name → model."""
