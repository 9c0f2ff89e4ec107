"""The models that are compared: one line each, a curve each.

A further model is a further line in `MODELS`; a further code is a module beside this one with MODULE and `build` (see
`repeated.Code`), and a line in `CODES`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal, NamedTuple

from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY

EQUILIBRIUM: Final = "equilibrium"
"""The code whose models all others are compared with."""


class Code(NamedTuple):
    """A code: its name, the Python module it comes as, the module beside this one that uses it, how to get it."""

    name: str
    library: str
    module: str
    remedy: str


CODES: Final[Mapping[str, Code]] = {
    EQUILIBRIUM: Code("qvi_contact", "qvi_contact", "equilibrium", ""),
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
    name : as tables and legends call it
    code : a key of `CODES`
    mesh : "uniform", or "graded" towards the free corner
    colour, marker, line : of its curve; no two models share both colour and marker
    options : what the code's `build` takes beside the case

    """

    name: str
    code: str
    mesh: Literal["uniform", "graded"]
    colour: str
    marker: str
    line: str
    options: Mapping[str, Any] = field(default_factory=dict)


def _nitsche(order: int, variant: str) -> dict[str, Any]:
    return {"order": order, "variant": variant}


MODELS: Final = (
    Model("equilibrium, uniform", EQUILIBRIUM, "uniform", BLUE, "o", "-"),
    Model("equilibrium, graded", EQUILIBRIUM, "graded", BLUE, "s", "--"),
    Model("NGSolve, p = 2, incomplete", "ngsolve", "uniform", ORANGE, "^", "-", _nitsche(2, "incomplete")),
    Model("NGSolve, p = 2, symmetric", "ngsolve", "uniform", VERMILLION, "v", "-", _nitsche(2, "symmetric")),
    Model("NGSolve, p = 2, skew", "ngsolve", "uniform", GREY, "<", "-", _nitsche(2, "skew")),
    Model("NGSolve, p = 3, symmetric", "ngsolve", "uniform", PURPLE, "D", "-", _nitsche(3, "symmetric")),
    Model("NGSolve, p = 2, symmetric, graded", "ngsolve", "graded", VERMILLION, "P", "--", _nitsche(2, "symmetric")),
    Model("NGSolve, p = 3, symmetric, graded", "ngsolve", "graded", PURPLE, "X", "--", _nitsche(3, "symmetric")),
    Model("GetFEM, Q2", "getfem", "uniform", GREEN, ">", "-"),
    Model("GetFEM, Q2, graded", "getfem", "graded", SKY, "*", "--"),
)
"""All models, in the order of the tables."""
