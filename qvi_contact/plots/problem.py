"""A problem before it is solved: body, materials, conditions, loads, contacts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.basics.units import Units
from qvi_contact.plots.labels import alignment, merged, value_range, wrapped
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    VERMILLION,
    cell_outlines,
    draw_grid,
    draw_outline,
    frame,
    require_matplotlib,
)
from qvi_contact.plots.symbols import Run, arrows, ground, runs
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Symmetry, Traction
from qvi_contact.problem.problem import ContactProblem

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FILLS: Final = ("#f4f4f4", "#fbe3b5", "#cfe8f7", "#d9efe0", "#f3dcea", "#e8e2f4")
_HATCHES: Final = ("", "..", "xx", "++", "oo")
_ARROW: Final = 0.11  # length of the longest arrow as a share of the body's length
_SPACING: Final = 0.07  # distance of arrows and symbols as a share of the body's length
_AWAY: Final = 0.018  # distance from the body at which obstacles and symbols are drawn, as a share of its length
_SAMPLES: Final = 64  # points along the body's length where the range of a field is looked at
_MATERIALS: Final = 8  # so many materials are explained in the legend

_CENTRED: Final[dict[str, Any]] = {"ha": "center", "va": "center"}

_POINTING_INWARD: Final = {(0, -1): "^", (0, 1): "v", (-1, 0): ">", (1, 0): "<"}
"""Triangles that point at the body, by the outward normal."""

_FREE: Final[dict[str, Any]] = {"color": GREY, "linewidth": 1.0}
_LOADED: Final[dict[str, Any]] = {"color": VERMILLION, "linewidth": 1.2}
_HELD: Final[dict[str, Any]] = {"color": BLUE, "linewidth": 1.2, "linestyle": (0, (4, 1.5))}
_MIRROR: Final[dict[str, Any]] = {"color": GREEN, "linewidth": 1.4, "linestyle": "-."}
_TOUCHING: Final[dict[str, Any]] = {"color": "black", "linewidth": 1.8}
_JOINT: Final[dict[str, Any]] = {"color": ORANGE, "linewidth": 2.0, "linestyle": (0, (3, 1.5))}


def draw_problem(axes: "Axes", problem: ContactProblem, units: Units | None = None) -> None:
    """Draw mesh, materials, conditions, loads, contacts and joints, with a legend on the right that names them.

    Tractions and prescribed displacements are arrows that point the way they act on the body, full for tractions and
    hollow for displacements, each kind in a scale of its own; supports are triangles (full: both components, hollow:
    the normal one, diamonds: the tangential one); lines of symmetry stand on rollers; obstacles are hatched lines,
    whose distance shows how the gap varies; joints are dashed lines inside the body.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    problem : ContactProblem
        The problem.
    units : Units, optional
        Labels.

    Raises
    ------
    InputError
        If a function of the problem gives bad values.

    """
    require_matplotlib()
    sketch = _Sketch(axes, problem, units or Units())
    sketch.body()
    for condition in merged(problem.cartesian_conditions):
        sketch.condition(condition)
    sketch.legend()
    frame(axes, problem.grid, margin=_AWAY + _ARROW + 0.06)
    axes.set_anchor("W")  # towards the left where equal scales leave room, which the legend takes
    axes.set_xlabel(f"x [{sketch.units.length}]")
    axes.set_ylabel(f"y [{sketch.units.length}]")


@dataclass
class _Sketch:
    """A picture of a problem in the making.

    Attributes
    ----------
    axes, problem, units
        As in `draw_problem`.
    entries : list of artists
        What the legend shows, in the order of drawing.
    groups : mapping
        Edge sets of conditions that need no entry of their own, by what they have in common.

    """

    axes: "Axes"
    problem: ContactProblem
    units: Units
    entries: list[Any] = field(default_factory=list)
    groups: dict[str, list[str]] = field(default_factory=lambda: {"free": [], "symmetry": []})

    @property
    def length(self) -> float:
        return self.problem.grid.length

    def body(self) -> None:
        """Cells filled by material, grid, outline."""
        from matplotlib.collections import PolyCollection
        from matplotlib.patches import Patch

        mesh, outlines = self.problem.grid, cell_outlines(self.problem.grid)
        number = self.problem.material_numbers[mesh.active]
        present = np.unique(number).tolist()
        for index, chosen in enumerate(present):
            look: dict[str, Any] = {
                "facecolor": _FILLS[index % len(_FILLS)],
                "hatch": _HATCHES[index // len(_FILLS) % len(_HATCHES)],
            }
            cells = outlines[number == chosen]
            self.axes.add_collection(
                PolyCollection(list(cells), **look, edgecolors="#cccccc", linewidths=0.0, antialiased=False, zorder=0)
            )
            material = self.problem.materials[chosen]
            text = f"E = {material.young:.6g} {self.units.stress}, ν = {material.poisson:.4g}, plane {material.plane}"
            if len(present) > 1:
                text = f"{index + 1}: {text}"
                self._number(cells.mean(axis=1), str(index + 1))
            if index < _MATERIALS:
                self.entries.append(Patch(**look, edgecolor="#999999", label=wrapped(text)))
        draw_grid(self.axes, mesh)
        draw_outline(self.axes, mesh, "#999999", 0.6)
        self._potential()

    def condition(self, condition: Condition) -> None:
        """One condition in its symbols."""
        kind: dict[type, Any] = {
            Traction: self.traction,
            Displacement: self.displacement,
            Symmetry: self.symmetry,
            Contact: self.contact,
        }
        pieces = runs(self.problem.grid, self.problem.grid.edges(condition.edges))
        kind[type(condition)](condition, pieces)

    def traction(self, condition: Traction, pieces: Sequence[Run]) -> None:
        values = {name: self._samples(f"Traction.{name}", getattr(condition, name), pieces) for name in "xy"}
        if not any(value.any() for value in values.values()):
            if condition.x is not None and condition.y is not None:
                self._line(pieces, _FREE)
                self.groups["free"].append(condition.edges)
            return
        self._line(pieces, _LOADED)
        self._arrows(condition, pieces, self._largest(Traction), {"color": VERMILLION})
        given = [value_range(f"t_{name}", values[name], self.units.stress) for name in "xy" if values[name].size]
        self._entry(f"traction {condition.name}: {', '.join(given)}", _LOADED, marker=">", filled=True)

    def displacement(self, condition: Displacement, pieces: Sequence[Run]) -> None:
        values = {name: self._samples(f"Displacement.{name}", getattr(condition, name), pieces) for name in "xy"}
        self._line(pieces, _HELD)
        given = [value_range(f"u_{name}", values[name], self.units.length) for name in "xy" if values[name].size]
        held = [name for name in "xy" if values[name].size and not values[name].any()]
        for run in pieces if held else ():
            self._supports(run, held)
        moved = any(value.any() for value in values.values())
        if moved:
            look = {"facecolor": "white", "edgecolor": BLUE, "linewidth": 0.7}
            self._arrows(condition, pieces, self._largest(Displacement), look)
        self._entry(
            f"{condition.edges}: {', '.join(given)}", _HELD, marker=">" if moved else "^", filled=len(held) == 2
        )

    def symmetry(self, condition: Symmetry, pieces: Sequence[Run]) -> None:
        self._line(pieces, _MIRROR)
        for run in pieces:
            self._symbols(run, "o", filled=False, colour=GREEN)
        self.groups["symmetry"].append(condition.edges)

    def contact(self, contact: Contact, pieces: Sequence[Run]) -> None:
        joint = contact in self.problem.joints
        self._line(pieces, _JOINT if joint else _TOUCHING)
        if not joint:
            self._obstacle(contact, pieces)
        self._name(contact, pieces, joint)
        text = f"{'joint' if joint else 'contact'} {contact.name}: {', '.join(self._law(contact, pieces))}"
        self._entry(text, _JOINT if joint else _TOUCHING)

    def legend(self) -> None:
        """The legend on the right, groups last."""
        for name, look in (("symmetry", _MIRROR), ("free", _FREE)):
            if self.groups[name]:
                marker = "o" if name == "symmetry" else ""
                self._entry(f"{name}: {', '.join(self.groups[name])}", look, marker=marker)
        self.axes.legend(handles=self.entries, loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False)

    def _line(self, pieces: Sequence[Run], look: dict[str, Any]) -> None:
        for run in pieces:
            self.axes.plot(*np.stack([run.start, run.stop]).T, solid_capstyle="butt", zorder=3, **look)

    def _entry(self, text: str, look: dict[str, Any], marker: str = "", filled: bool = False) -> None:
        from matplotlib.lines import Line2D

        face = look["color"] if filled else "white"
        self.entries.append(
            Line2D([], [], marker=marker, markersize=5, markerfacecolor=face, label=wrapped(text), **look)
        )

    def _samples(self, name: str, value: Field | None, pieces: Sequence[Run]) -> FloatArray:
        """Values along the pieces, ends included; none for a component that is not given."""
        if value is None:
            return np.empty(0)
        points = np.concatenate([run.ends_and_points(self.length / _SAMPLES) for run in pieces])
        return evaluate(name, value, *points.T)

    def _largest(self, kind: type[Traction] | type[Displacement]) -> float:
        """Length of the longest vector among all conditions of a kind."""
        sizes = [0.0]
        for condition in merged(self.problem.cartesian_conditions):
            if isinstance(condition, kind):
                pieces = runs(self.problem.grid, self.problem.grid.edges(condition.edges))
                parts = [self._samples(f"{kind.__name__}.{n}", getattr(condition, n), pieces) for n in "xy"]
                x, y = (part if part.size else np.zeros(1) for part in parts)
                sizes.append(float(np.hypot(x, y).max()))
        return max(sizes)

    def _arrows(
        self, condition: Traction | Displacement, pieces: Sequence[Run], largest: float, look: dict[str, Any]
    ) -> None:
        for run in pieces:
            points = run.points(_SPACING * self.length)
            vectors = np.zeros_like(points)
            for component, name in enumerate("xy"):
                value = getattr(condition, name)
                if value is not None:
                    vectors[:, component] = evaluate(f"{type(condition).__name__}.{name}", value, *points.T)
            vectors *= _ARROW * self.length / largest
            arrows(self.axes, points, vectors, run.normal, _AWAY * self.length, look)

    def _supports(self, run: Run, held: Sequence[str]) -> None:
        inward = _POINTING_INWARD[int(run.normal[0]), int(run.normal[1])]
        normal = "x" if run.normal[0] else "y"
        self._symbols(run, inward if normal in held else "d", filled=len(held) == 2, colour=BLUE)

    def _symbols(self, run: Run, marker: str, filled: bool, colour: str) -> None:
        places = run.points(_SPACING * self.length, least=1) + _AWAY * self.length * run.normal
        face = colour if filled else "white"
        look: dict[str, Any] = {
            "linestyle": "none",
            "markersize": 4.5,
            "color": colour,
            "markerfacecolor": face,
            "zorder": 4,
        }
        self.axes.plot(*places.T, marker=marker, **look)

    def _obstacle(self, contact: Contact, pieces: Sequence[Run]) -> None:
        """Hatched lines whose distance from the body shows how the gap varies, and the force on a plate."""
        gaps = [self._samples("Contact.gap", contact.gap, [run]) for run in pieces]
        least, most = min(gap.min() for gap in gaps), max(gap.max() for gap in gaps)
        spread = 0.06 * self.length / (most - least) if most - least > 1e-9 * max(abs(least), abs(most)) else 0.0
        for run, gap in zip(pieces, gaps, strict=True):
            points = run.ends_and_points(self.length / _SAMPLES)
            distance = 0.5 * _AWAY * self.length + spread * (gap - least)
            normals = np.broadcast_to(run.normal, points.shape)
            ground(self.axes, points + distance[:, None] * normals, normals, 0.025 * self.length)
        plate = contact.plate
        if plate is not None:
            force = np.array([[plate.force_x or 0.0, plate.force_y or 0.0]])
            size = float(np.hypot(*force[0]))
            middle = np.mean([run.middle for run in pieces], axis=0, keepdims=True)
            away = 2.0 * _AWAY * self.length
            if size > 0.0:
                vector = 1.2 * _ARROW * self.length * force / size
                place = middle + away * pieces[0].normal
                arrows(self.axes, place, vector, pieces[0].normal, away, {"color": "black", "width": 0.012})

    def _name(self, contact: Contact, pieces: Sequence[Run], joint: bool) -> None:
        """The contact's name: outside beside the obstacle, or on the line of a joint."""
        run = max(pieces, key=lambda run: run.length)
        place, align = run.middle, _CENTRED
        if joint:
            place = run.start + 0.15 * (run.stop - run.start)
        else:
            if contact.plate is not None:  # the middle belongs to its force
                place = run.start + 0.2 * (run.stop - run.start)
            place = place + (2.0 * _AWAY + 0.03) * self.length * run.normal
            align = alignment(run.normal)
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}
        self.axes.text(place[0], place[1], contact.name, fontsize="small", zorder=6, bbox=box, **align)

    def _law(self, contact: Contact, pieces: Sequence[Run]) -> Iterator[str]:
        """The contact's data, without those that do nothing."""
        if contact.law != "unilateral":
            yield contact.law
        data = [
            ("μ", contact.friction, "", contact.law != "tied"),
            ("c", contact.cohesion, self.units.stress, False),
            ("t_max", contact.shear_limit, self.units.stress, contact.shear_limit is not None),
            ("gap", contact.gap, self.units.length, False),
            ("offset", contact.offset, self.units.length, False),
        ]
        for name, value, unit, always in data:
            values = self._samples(f"Contact.{name}", value, pieces)
            if always or values.any():
                yield value_range(name, values, unit)
        plate = contact.plate
        if plate is not None:
            for name, value in (("F_x", plate.force_x), ("F_y", plate.force_y)):
                if value is not None:
                    yield value_range(name, np.array([value]), self.units.force)
            if plate.moment is not None:
                around = "({:.4g}, {:.4g})".format(*plate.pivot)
                yield f"{value_range('M', np.array([plate.moment]), self.units.moment)} about\xa0{around}"

    def _potential(self) -> None:
        nodes = self.problem.grid.coordinates[self.problem.grid.active_nodes.ravel()]
        values = evaluate("ContactProblem.body_potential", self.problem.body_potential, *nodes.T)
        if np.ptp(values) > 0.0:
            self._entry(value_range("body force, potential φ", values, self.units.stress), {"color": "none"})

    def _number(self, middles: FloatArray, text: str) -> None:
        """A material's number in the cell nearest to the middle of all of its cells."""
        place = middles[np.argmin(np.hypot(*(middles - middles.mean(axis=0)).T))]
        box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": GREY, "linewidth": 0.6}
        self.axes.text(place[0], place[1], text, ha="center", va="center", fontsize="small", bbox=box, zorder=6)
