"""The models that are compared: one line each, a curve each.

A further model is a further line in `MODELS`; a further code is a module in `codes` with MODULE and `build` (see
`codes.process.Code`), and a line in `CODES`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from comparisons.peers.meshes import FAMILIES, Family
from qvi_contact.plots import BLUE, GREEN, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY

EQUILIBRIUM: Final = "equilibrium"
TRIANGLES: Final = "triangles"
COMPANION: Final = "companion"
BRACKET: Final = "bracket"


class Code(NamedTuple):
    """A code: its name, the Python module it comes as, the module of `codes` that uses it, its looks, how to get it."""

    name: str
    library: str
    module: str
    colour: str
    marker: str
    remedy: str = ""


BLACK: Final = "#000000"

CODES: Final[Mapping[str, Code]] = {
    TRIANGLES: Code("this package on triangles", "qvi_contact", "equilibrium", BLUE, "o"),
    EQUILIBRIUM: Code("this package on rectangles", "qvi_contact", "equilibrium", SKY, "s"),
    COMPANION: Code("the companion", "qvi_contact", "companion", PURPLE, "P"),
    BRACKET: Code("the bracket", "qvi_contact", "equilibrium", BLACK, "x"),
    "ngsolve": Code("NGSolve", "ngsolve", "ngsolve_nitsche", VERMILLION, "v",
                    "python -m pip install 'qvi-contact[peers]'"),
    "getfem": Code("GetFEM", "getfem", "getfem_bricks", GREEN, ">",
                   "apt install python3-getfem on Debian or Ubuntu, then --getfem /usr/bin/python3"),
}  # fmt: skip
"""Key → code."""


@dataclass(frozen=True)
class Model:
    """A discretisation of the plate.

    Attributes
    ----------
    name : as tables call it
    code : a key of `CODES`
    mesh : a key of `meshes.FAMILIES`
    colour, marker, line : of its curve; no two models of a panel share both colour and marker
    options : what the code's `build` takes beside the case

    """

    name: str
    code: str
    mesh: str
    colour: str
    marker: str
    line: str
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def family(self) -> Family:
        """Its meshes."""
        return FAMILIES[self.mesh]


def _triangles(degree: int, colour: str, marker: str) -> Model:
    name = f"triangles, p = {degree}, bisected"
    return Model(name, TRIANGLES, "bisected", colour, marker, "-", {"degree": degree})


def _nitsche(order: int, mesh: str, colour: str, marker: str, variant: str = "symmetric") -> Model:
    """NGSolve, dashed on triangles and dotted on rectangles."""
    line = "--" if FAMILIES[mesh].triangles else ":"
    options = {"order": order, "variant": variant}
    return Model(f"NGSolve, p = {order}, {variant}, {mesh}", "ngsolve", mesh, colour, marker, line, options)


def _bricks(degree: int, mesh: str, marker: str) -> Model:
    return Model(f"GetFEM, Q{degree}, {mesh}", "getfem", mesh, GREEN, marker, "-.", {"degree": degree})


MODELS: Final = (
    Model("rectangles, uniform", EQUILIBRIUM, "uniform", SKY, "s", "-"),
    Model("rectangles, graded", EQUILIBRIUM, "graded", SKY, "D", "-"),
    Model("rectangles, strips", EQUILIBRIUM, "strips", SKY, "D", "-"),
    Model("triangles, p = 4, cut squares", TRIANGLES, "cut squares", BLUE, "o", "-", {"degree": 4}),
    *(_triangles(degree, BLUE, marker) for degree, marker in ((3, "<"), (4, "o"), (5, "p"), (6, "h"))),
    Model("companion, p = 2, uniform", COMPANION, "uniform", PURPLE, "P", "--", {"degree": 2}),
    Model("companion, p = 3, graded", COMPANION, "graded", PURPLE, "X", "--", {"degree": 3}),
    _nitsche(2, "uniform", VERMILLION, "v"),
    _nitsche(3, "graded", VERMILLION, "^"),
    *(
        _nitsche(order, "bisected", VERMILLION, marker)
        for order, marker in ((2, "1"), (3, "^"), (4, "v"), (5, "2"), (6, "3"))
    ),
    _nitsche(3, "strips", ORANGE, "^"),
    _nitsche(4, "strips", ORANGE, "+", "skew"),
    _nitsche(4, "narrow strips", ORANGE, "v"),
    _nitsche(6, "narrow strips", ORANGE, "3"),
    _bricks(2, "uniform", ">"),
    _bricks(2, "graded", "*"),
    *(_bricks(degree, "strips", marker) for degree, marker in ((2, ">"), (3, "4"), (4, "d"))),
    Model("bracket, p = 3, graded", BRACKET, "graded", BLACK, "x", "-", {"bracket": 3}),
    Model("bracket, p = 5, bisected", BRACKET, "bisected", BLACK, "x", "-", {"degree": 5, "bracket": 5}),
    Model("bracket, p = 5, adaptive", BRACKET, "adaptive", BLACK, "+", "-", {"degree": 5, "adaptive": True}),
)
"""All models, in the order of the tables."""

NAMED: Final[Mapping[str, Model]] = {model.name: model for model in MODELS}
"""Name → model."""
