"""What the published benchmarks look like: their bodies, loads, supports and contacts, on coarse meshes."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from comparisons.lab.report import drawn
from comparisons.verification.examples import file_problem
from comparisons.verification.limits import oblique, on_a_slope
from comparisons.verification.tables import table_name
from qvi_contact import ContactProblem, RectilinearMesh, TriangleMesh
from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.gallery import (
    block_corner,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    loaded_pin,
    press_fit,
    press_fit_torque,
    rings,
)
from qvi_contact.plots import problem_figure
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STEEL: Final = Units(length="mm", stress="MPa")
_SI: Final = Units(length="m", stress="Pa")
_DAM: Final = Units(length="m", stress="MPa")

PICTURES: Final[dict[str, tuple[Callable[[], ContactProblem], Units | None]]] = {
    "rings": (lambda: rings(4), _SI),
    "press-fit": (lambda: press_fit(2), _STEEL),
    "cylinder-in-bore": (lambda: cylinder_in_bore(2, extent=2.0), _STEEL),
    "loaded-pin": (lambda: loaded_pin(4), _STEEL),
    "corner-rates": (lambda: block_corner(None, 1), None),
    "sliding-corner": (lambda: block_corner(0.3, 1, 3), None),
    "cylinder-on-block": (lambda: cylinder_on_block(1.0, 2, 0), _STEEL),
    "half-discs": (lambda: half_discs(1.0, 2, 0), _STEEL),
    "slip-torque": (lambda: press_fit_torque(0.2, 47066.77, sectors=2), _STEEL),
    "cylinder-in-bore-friction": (lambda: cylinder_in_bore(2, 0.4, extent=2.0), _STEEL),
    "wedge": (lambda: on_a_slope(0.2), None),
    "oblique-block": (lambda: oblique(0.99), _STEEL),
    "examples/gravity_dam": (lambda: replace(file_problem("gravity_dam"), mesh=_dam()), _DAM),
}
"""Name of a problem of the manual → what is drawn, in its units; the bore's plate as far as two radii."""


def _dam() -> TriangleMesh:
    """The dam of the file and the rock below it, on few triangles."""
    x = np.array([-30.0, -15.0, 0.0, 8.0, 16.0, 24.0, 39.0, 54.0])
    y = np.array([-25.0, -12.0, 0.0, 9.5, 19.0, 28.0, 30.0])
    middle_x, middle_y = (x[1:] + x[:-1]) / 2.0, (y[1:] + y[:-1]) / 2.0
    body = (middle_y < 0.0)[:, None] | ((middle_x > 0.0) & (middle_x < 24.0))[None]
    whole = TriangleMesh.of_rectangles(RectilinearMesh(x, y, body))
    above = np.maximum(whole.vertices[:, 1], 0.0) / 30.0
    vertices = np.column_stack([whole.vertices[:, 0] * (1.0 - above * 19.0 / 24.0), whole.vertices[:, 1]])
    mesh = TriangleMesh(vertices, whole.cells).with_joint("base", lambda x, y: (y == 0.0) & (x > 0.0) & (x < 24.0))
    for name, edges in _DAM_EDGES.items():
        mesh = mesh.with_edges(name, edges)
    return mesh


_DAM_EDGES: Final[dict[str, Callable[[FloatArray, FloatArray], BoolArray]]] = {
    "upstream": lambda x, y: (x == 0.0) & (y > 0.0) & (y < 28.0),
    "freeboard": lambda x, y: (x == 0.0) & (y > 28.0),
    "crest": lambda _, y: y == 30.0,
    "downstream": lambda x, y: (x > 0.0) & (y > 0.0) & (y < 30.0),
    "reservoir floor": lambda x, y: (x < 0.0) & (y == 0.0),
    "rock downstream": lambda x, y: (x > 24.0) & (y == 0.0),
    "rock left": lambda x, _: x == -30.0,
    "rock right": lambda x, _: x == 54.0,
    "underground": lambda _, y: y == -25.0,
}


def pictures(names: Iterable[str]) -> dict[str, str]:
    """Name → picture, as SVG, of those of these problems that have one; empty where matplotlib is not installed."""
    return {name: drawn(f"verification-{table_name(name)}", partial(_draw, name)) for name in names if name in PICTURES}


def _draw(name: str) -> "Figure":
    problem, units = PICTURES[name]
    return problem_figure(problem(), **_options(units))


def _options(units: Units | None) -> dict[str, Any]:
    return {} if units is None else {"units": units}
