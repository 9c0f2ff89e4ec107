"""Pictures of the published benchmarks: what is posed, and what comes out beside what is known of it.

Bodies are drawn with loads, supports and contacts on coarse meshes; results are graphs.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from comparisons.lab.report.drawing import drawn, grid, legend_below
from comparisons.verification.elements import TRIANGLES
from comparisons.verification.examples import file_problem
from comparisons.verification.limits import oblique, on_a_slope, slope_factor
from comparisons.verification.rollers import FULL_SLIP, klang_history
from comparisons.verification.tables import table_name
from qvi_contact import ContactLine, ContactProblem, RectilinearMesh, TriangleMesh
from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.companion import CompanionContact
from qvi_contact.gallery import (
    CORNER_EXPONENTS,
    block_corner,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    loaded_pin,
    persson_pressure,
    press_fit,
    press_fit_torque,
    rings,
)
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION, problem_figure
from qvi_contact.plots.style import new_figure
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT, _LINE = 4.2, 2.7, 0.17  # of a picture without its legend, of a line of that [inch]
_MARKS: Final = 45  # of a curve at most
_KNOWN: Final = ("solid", "dashed", "dashdot", "dotted")
_OURS: Final = ((BLUE, "o"), (VERMILLION, "s"), (GREEN, "^"), (ORANGE, "D"))
_MM, _SI, _M = Units(length="mm", stress="MPa"), Units(length="m", stress="Pa"), Units(length="m", stress="MPa")
_DEPTH: Final = 20  # how often triangles at a sliding corner are halved
_NEAR: Final = (1e-5, 1e-2)  # distances from it that are drawn


class Curve(NamedTuple):
    """Values y at places x, (n,) each, and what they are."""

    label: str
    x: FloatArray
    y: FloatArray


@dataclass(frozen=True)
class Graph:
    """A result beside what is known of it.

    Attributes
    ----------
    x, y : str
        Labels of the axes, with units.
    ours : tuple of Curve
        What was computed, drawn as marks.
    known : tuple of Curve
        What it should be, drawn as lines.
    logarithmic : bool
        Both axes.

    """

    x: str
    y: str
    ours: tuple[Curve, ...]
    known: tuple[Curve, ...]
    logarithmic: bool = False


_Make = Callable[[bool], Graph]


@dataclass(frozen=True)
class Exhibit:
    """What the manual shows of a problem.

    Attributes
    ----------
    posed : function
        The problem on few cells.
    units : Units or None
        Of its picture; None where it has none.
    graph : function
        Its result, given True from a coarse mesh. Its docstring is the caption.

    """

    posed: Callable[[], ContactProblem]
    units: Units | None
    graph: _Make

    @property
    def caption(self) -> str:
        """What to see in the picture of the result."""
        return self.graph.__doc__ or ""

    def body(self) -> "Figure":
        """The picture of the problem."""
        return problem_figure(self.posed(), self.units)


EXHIBITS: Final[dict[str, Exhibit]] = {}
"""Name of a problem of the manual → what is shown of it."""


def _shown(name: str, posed: Callable[[], ContactProblem], units: Units | None = None) -> Callable[[_Make], _Make]:
    """Make a graph that of the result of a problem of the manual."""

    def known(graph: _Make) -> _Make:
        EXHIBITS[name] = Exhibit(posed, units, graph)
        return graph

    return known


def pictures(names: Iterable[str]) -> dict[str, str]:
    """Name → picture, as SVG, of those of these problems that have one; empty where matplotlib is not installed."""
    return {name: drawn(f"verification-{table_name(name)}", EXHIBITS[name].body) for name in names if name in EXHIBITS}


def results(names: Iterable[str], quick: bool) -> dict[str, str]:
    """The same of their results."""
    return {
        name: drawn(f"result-{table_name(name)}", partial(_draw, name, quick)) for name in names if name in EXHIBITS
    }


def _draw(name: str, quick: bool) -> "Figure":
    return figure(EXHIBITS[name].graph(quick))


def figure(graph: Graph) -> "Figure":
    """The picture of a graph, narrow enough for a small screen."""
    found = new_figure(_WIDTH, _HEIGHT + _LINE * (len(graph.known) + len(graph.ours)))
    axes = found.subplots()
    if graph.logarithmic:
        axes.set_xscale("log")
        axes.set_yscale("log")
    for curve, style in zip(graph.known, _KNOWN, strict=False):
        axes.plot(curve.x, curve.y, color=GREY, linestyle=style, linewidth=1.2, label=curve.label)
    for curve, (colour, marker) in zip(graph.ours, _OURS, strict=False):
        _marks(axes, curve, colour, marker)
    axes.set_xlabel(graph.x)
    axes.set_ylabel(graph.y)
    grid(axes)
    axes.set_axisbelow(True)
    legend_below(found, 1, 9)
    return found


def _marks(axes: "Axes", curve: Curve, colour: str, marker: str) -> None:
    order = np.argsort(curve.x, kind="stable")[:: -(-len(curve.x) // _MARKS)]
    look = {"color": colour, "marker": marker, "markerfacecolor": "none", "markersize": 4, "linestyle": "none"}
    axes.plot(curve.x[order], curve.y[order], label=curve.label, **look)  # type: ignore[arg-type]


@_shown("rings", lambda: rings(4), _SI)
def _rings(quick: bool) -> Graph:
    """The pressure between the rings has a constant part and one in cos 2θ."""
    line = TRIANGLES.solve(rings(4 if quick else 8, 1e5)).contacts["joint"]
    theta = np.linspace(0.0, 90.0)
    known = Curve("Lamé and Michell", theta, 9.2592593 + 0.13571791 * np.cos(2.0 * np.deg2rad(theta)))
    ours = Curve("stresses", _degrees(line), -line.normal_stress / 1e6)
    return Graph("angle θ [°]", "pressure [MPa]", (ours,), (known,))


@_shown("press-fit", lambda: press_fit(2), _MM)
def _press_fit(quick: bool) -> Graph:
    """Stresses along a radius: constant in the shaft, of Lamé's form in the hub."""
    # radial and circumferential stress on the line θ = 45°
    result = TRIANGLES.solve(press_fit(4 if quick else 8, 0.2))
    radius = np.linspace(1.0, 49.0, 24)  # none is that of the fit
    xx, yy, xy = result.stress(radius / np.sqrt(2.0), radius / np.sqrt(2.0)).T
    fine = np.concatenate([np.linspace(0.0, 24.999), np.linspace(25.001, 50.0)])
    radial, around = (
        np.where(fine < 25.0, -61.8, 61.8 / 3.0 * (1.0 + sign * (50.0 / np.maximum(fine, 25.0)) ** 2))
        for sign in (-1.0, 1.0)
    )
    known = Curve("radial stress, Lamé", fine, radial), Curve("circumferential stress, Lamé", fine, around)
    ours = Curve("radial", radius, (xx + yy) / 2.0 + xy), Curve("circumferential", radius, (xx + yy) / 2.0 - xy)
    return Graph("radius [mm]", "stress [MPa]", ours, known)


@_shown("cylinder-in-bore", lambda: cylinder_in_bore(2, extent=2.0), _MM)
def _bore(quick: bool) -> Graph:
    """The pressure in the bore, and Persson's closed form."""
    line = TRIANGLES.solve(cylinder_in_bore(6 if quick else 12)).contacts["bore"]
    ours = _until(Curve("stresses", _degrees(line), -line.normal_stress), 75.0)
    return Graph("angle θ from the load [°]", "pressure [MPa]", (ours,), (_persson(),))


def _persson() -> Curve:
    theta = np.linspace(0.0, 75.0, 200)
    return Curve("Persson, without friction", theta, persson_pressure(np.deg2rad(theta)))


@_shown("loaded-pin", lambda: loaded_pin(4), _MM)
def _loaded_pin(quick: bool) -> Graph:
    """Pressure and shear around the pin by stresses and by displacements."""
    line, other = _tractions(loaded_pin(4 if quick else 12), "pin")
    return Graph(
        "angle θ from the load [°]",
        "traction [MPa]",
        (
            Curve("pressure, stresses", _degrees(line), -line.normal_stress),
            Curve("shear, stresses", _degrees(line), line.tangential_stress),
        ),
        (
            _sorted(Curve("pressure, displacements", _degrees(other), -other.normal_stress)),
            _sorted(Curve("shear, displacements", _degrees(other), other.tangential_stress)),
        ),
    )


@_shown("corner-rates", lambda: block_corner(None, 1))
def _rates(quick: bool) -> Graph:
    """From mesh to mesh the energy changes by powers of h that the corners dictate."""
    # differences of the energies of uniform meshes, each half as coarse as the one before
    ours, known = [], []
    cells = np.array([1, 2, 4] if quick else [1, 2, 4, 8])
    for friction, name in ((None, "stuck"), (0.0, "without friction")):
        energies = [TRIANGLES.solve(block_corner(friction, int(count))).energies.complementary for count in cells]
        sizes, apart = 1.0 / cells[:-1], -np.diff(energies) / energies[-1]
        power = 2.0 * CORNER_EXPONENTS[friction]
        ours.append(Curve(f"{name}", sizes, np.abs(apart)))
        known.append(Curve(f"slope 2λ = {power:.4g}", sizes, np.abs(apart[-1]) * (sizes / sizes[-1]) ** power))
    label = "change of the energy [-]"
    return Graph("size of cells h [length]", label, tuple(ours), tuple(known), logarithmic=True)


@_shown("sliding-corner", lambda: block_corner(0.3, 1, 3))
def _sliding_corner(quick: bool) -> Graph:
    """Near the corner the pressure is a power of the distance."""
    ours, known = [], []
    for friction in (0.0, 0.5) if quick else (0.0, 0.1, 0.3, 0.5):
        line = TRIANGLES.solve(block_corner(friction, 1, _DEPTH)).contacts["base"]
        away = 1.0 - line.x
        near = (away > _NEAR[0]) & (away < _NEAR[1])
        r, pressure, exponent = away[near], -line.normal_stress[near], CORNER_EXPONENTS[friction]
        ours.append(Curve(f"μ = {friction:g}", r, pressure))
        ends, middle = np.array(_NEAR), int(np.argmin(np.abs(np.log(r / 1e-4))))
        known.append(
            Curve(f"slope λ − 1, λ = {exponent:.4f}", ends, pressure[middle] * (ends / r[middle]) ** (exponent - 1.0))
        )
    return Graph("distance from the corner r [length]", "pressure / E [-]", tuple(ours), tuple(known), logarithmic=True)


@_shown("cylinder-on-block", lambda: cylinder_on_block(1.0, 2, 0), _MM)
def _hertz(quick: bool) -> Graph:
    """The pressure under the cylinder is Hertz's ellipse."""
    line = TRIANGLES.solve(cylinder_on_block(0.01, 4 if quick else 6, 2 if quick else 4)).contacts["contact"]
    x = np.linspace(0.0, 0.9, 200)
    known = Curve("Hertz", x, 358.536 * _ellipse(x / 0.62146))
    return Graph("x [mm]", "pressure [MPa]", (Curve("stresses", line.x, -line.normal_stress),), (known,))


@_shown("half-discs", lambda: half_discs(1.0, 2, 0), _MM)
def _cattaneo(quick: bool) -> Graph:
    """Shear stays below the bound in the middle, which sticks, and reaches it outside."""
    line = TRIANGLES.solve(half_discs(1e-4, 4 if quick else 6, 2 if quick else 4)).contacts["contact"]
    x, height = np.linspace(-0.9, 0.9, 400), 0.2 * 93.51351
    bound = height * _ellipse(x / 0.680778)
    shear = bound - height * 0.496511 / 0.680778 * _ellipse(x / 0.496511)
    known = Curve("bound μp, Hertz", x, bound), Curve("shear, Cattaneo and Mindlin", x, shear)
    place = 100.0 * line.x
    ours = (
        Curve("bound μp, stresses", place, -200.0 * line.normal_stress),
        Curve("shear, stresses", place, 1e3 * np.abs(line.tangential_stress)),
    )
    return Graph("x [0.01 mm]", "traction [kPa]", ours, known)


@_shown("slip-torque", lambda: press_fit_torque(0.2, 47066.77, sectors=2), _MM)
def _torque(quick: bool) -> Graph:
    """The torque grows with the turn until all of the fit slips, and no further."""
    # the torque over the turn of the bore: two rings in series until all of the fit slips
    stiffness = 4.0 * np.pi * (206e3 / 2.6) / (1.0 / 5.0**2 - 1.0 / 50.0**2)
    first = FULL_SLIP / stiffness
    turns = first * (np.array([0.5, 1.5]) if quick else np.array([0.25, 0.5, 0.75, 0.9, 1.1, 1.25, 1.5, 2.0]))
    torques = [_torque_at(float(turn)) for turn in turns]
    known = Curve("2π μ p R² at most", 1e3 * first * np.array([0.0, 1.0, 2.0]), FULL_SLIP * np.array([0.0, 1.0, 1.0]))
    ours = Curve("stresses", 1e3 * turns, np.array(torques) / 1e3)
    return Graph("turn of the bore [mrad]", "torque [N m/mm]", (ours,), (known._replace(y=known.y / 1e3),))


def _torque_at(turn: float) -> float:
    line = TRIANGLES.solve(press_fit_torque(0.2, turn=5.0 * turn)).contacts["shaft"]
    return float(abs(line.weights @ (line.tangential_stress * np.hypot(line.x, line.y))))


@_shown("cylinder-in-bore-friction", lambda: cylinder_in_bore(2, 0.4, extent=2.0), _MM)
def _klang(quick: bool) -> Graph:
    """Pressure, and shear over μ, which meets it where the bore slips: both depend on the steps of the load."""
    # pressure after one and after many steps of the load, and how much of the friction bound shear has taken
    ours = []
    for count in (1, 3 if quick else 10):
        line = klang_history(TRIANGLES, count, 4 if quick else 8).steps[-1].contacts["bore"]
        steps = f"{count} step{'s' if count > 1 else ''}"
        ours += [
            _until(Curve(f"pressure, {steps}", _degrees(line), -line.normal_stress), 75.0),
            _until(Curve(f"shear over μ, {steps}", _degrees(line), np.abs(line.tangential_stress) / 0.4), 75.0),
        ]
    read = Curve("pressure that was read from Klang's curve", np.array([0.0, 15.0]), np.array([17.8, 17.8]))
    return Graph("angle θ from the load [°]", "pressure, shear / μ [MPa]", tuple(ours), (_persson(), read))


@_shown("wedge", lambda: on_a_slope(0.2))
def _wedge(quick: bool) -> Graph:
    """The force that pushes the block uphill, over friction: both bounds lie on the formula."""
    frictions, fine = np.array([0.0, 0.2] if quick else [0.0, 0.1, 0.2, 0.3]), np.linspace(0.0, 0.3)
    limits = [TRIANGLES.limit_load(on_a_slope(float(friction)), ["F"]) for friction in frictions]
    ours = (
        Curve("F/G that the mesh carries", frictions, np.array([limit.lower for limit in limits])),
        Curve("F/G that a mechanism allows", frictions, np.array([limit.upper for limit in limits])),
    )
    known = Curve("(tan α + μ)/(1 − μ tan α)", fine, np.array([slope_factor(float(friction)) for friction in fine]))
    return Graph("coefficient of friction μ [-]", "F/G [-]", ours, (known,))


@_shown("oblique-block", lambda: oblique(0.99), _MM)
def _oblique(_: bool) -> Graph:
    """At 99 % of the friction force the shear is just below its bound."""
    line, other = _tractions(oblique(0.99), "plane")
    ours = (
        Curve("bound μp, stresses", _along(line), line.friction_bound),
        Curve("shear, stresses", _along(line), np.abs(line.tangential_stress)),
    )
    known = (
        _sorted(Curve("bound μp, displacements", _along(other), other.friction_bound)),
        _sorted(Curve("shear, displacements", _along(other), np.abs(other.tangential_stress))),
    )
    return Graph("length along the plane [mm]", "traction [MPa]", ours, known)


@_shown("examples/gravity_dam", lambda: replace(file_problem("gravity_dam"), mesh=_dam_mesh()), _M)
def _dam(_: bool) -> Graph:
    """Effective pressure, shear and uplift in the base of the dam."""
    line, other = _tractions(file_problem("gravity_dam"), "base")
    ours = (
        Curve("effective pressure, stresses", line.x, -line.effective_normal_stress),
        Curve("shear, stresses", line.x, np.abs(line.tangential_stress)),
    )
    uplift = np.interp(other.x, *_increasing(line.x, line.pore_pressure))
    known = (
        _sorted(Curve("effective pressure, displacements", other.x, -other.normal_stress - uplift)),
        _sorted(Curve("shear, displacements", other.x, np.abs(other.tangential_stress))),
        _sorted(Curve("uplift", line.x, line.pore_pressure)),
    )
    return Graph("x [m]", "traction [MPa]", ours, known)


def _tractions(problem: ContactProblem, contact: str) -> tuple[ContactLine, CompanionContact]:
    """A contact of both models on the same mesh."""
    return TRIANGLES.solve(problem).contacts[contact], TRIANGLES.companion(problem).contacts[contact]


def _degrees(line: ContactLine | CompanionContact) -> FloatArray:
    return np.asarray(np.rad2deg(np.arctan2(line.y, line.x)))


def _along(line: ContactLine | CompanionContact) -> FloatArray:
    """Distance from the origin [length], where a straight contact begins."""
    return np.asarray(np.hypot(line.x, line.y))


def _ellipse(x: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(1.0 - x**2, 0.0))


def _increasing(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    order = np.argsort(x, kind="stable")
    return x[order], y[order]


def _sorted(curve: Curve) -> Curve:
    return Curve(curve.label, *_increasing(curve.x, curve.y))


def _until(curve: Curve, end: float) -> Curve:
    near = curve.x <= end
    return Curve(curve.label, curve.x[near], curve.y[near])


def _dam_mesh() -> TriangleMesh:
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
