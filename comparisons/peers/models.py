"""The models that are compared: one line each, a curve each.

A further model is a further line in `MODELS`; a further code is a module in `codes` with `build` (see
`codes.process.Code`), and a line in `CODES`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from comparisons.peers.meshes import FAMILIES, Family

TRIANGLES: Final = "triangles"
BRACKET: Final = "bracket"


class Code(NamedTuple):
    """A code: its name, the Python module it comes as, the module of `codes` that uses it, its looks, how to get it.

    Its colour is a key of `figures.COLOURS`, since workers, which draw nothing, would take long to load pictures.
    """

    name: str
    library: str
    module: str
    colour: str
    marker: str
    remedy: str = ""


CODES: Final[Mapping[str, Code]] = {
    TRIANGLES: Code("this package", "qvi_contact", "equilibrium", "blue", "o"),
    BRACKET: Code("the bracket", "qvi_contact", "equilibrium", "black", "x"),
    "ngsolve": Code("NGSolve", "ngsolve", "ngsolve_nitsche", "vermillion", "v",
                    "python -m pip install ngsolve"),
    "getfem": Code("GetFEM", "getfem", "getfem_bricks", "green", ">",
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
    colour, marker, line : of its curve, see `Code`; no two models of a panel share both colour and marker
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
    return Model(f"GetFEM, Q{degree}, {mesh}", "getfem", mesh, "green", marker, "-.", {"degree": degree})


MODELS: Final = (
    Model("triangles, p = 4, cut squares", TRIANGLES, "cut squares", "blue", "o", "-", {"degree": 4}),
    *(_triangles(degree, "blue", marker) for degree, marker in ((3, "<"), (4, "o"), (5, "p"), (6, "h"))),
    _nitsche(2, "uniform", "vermillion", "v"),
    _nitsche(3, "graded", "vermillion", "^"),
    *(
        _nitsche(order, "bisected", "vermillion", marker)
        for order, marker in ((2, "1"), (3, "^"), (4, "v"), (5, "2"), (6, "3"))
    ),
    _nitsche(3, "strips", "orange", "^"),
    _nitsche(4, "strips", "orange", "+", "skew"),
    _nitsche(4, "narrow strips", "orange", "v"),
    _nitsche(6, "narrow strips", "orange", "3"),
    _bricks(2, "uniform", ">"),
    _bricks(2, "graded", "*"),
    *(_bricks(degree, "strips", marker) for degree, marker in ((2, ">"), (3, "4"), (4, "d"))),
    Model("bracket, p = 5, bisected", BRACKET, "bisected", "black", "x", "-", {"degree": 5, "bracket": 5}),
    Model("bracket, p = 5, adaptive", BRACKET, "adaptive", "black", "+", "-", {"degree": 5, "adaptive": True}),
)
"""All models, in the order of the tables."""

NAMED: Final[Mapping[str, Model]] = {model.name: model for model in MODELS}
"""Name → model."""
