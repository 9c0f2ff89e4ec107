"""A problem before it is solved: body, materials, conditions, loads, contacts; and what such pictures are made of."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.basics.schema import defaults_of, keys_of
from qvi_contact.mesh.edges import Edges, chains, frames_along, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots import style
from qvi_contact.problem.conditions import (
    CARTESIAN,
    LOCAL,
    Condition,
    Contact,
    Displacement,
    Symmetry,
    Traction,
    components,
)
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FILLS: Final = ("#f4f4f4", "#fbe3b5", "#cfe8f7", "#d9efe0", "#f3dcea", "#e8e2f4")
_HATCHES: Final = ("", "..", "xx", "++", "oo")
_ARROW: Final = 0.11  # length of the longest arrow as a share of the body's length
_SPACING: Final = 0.07  # distance of arrows and symbols as a share of the body's length
_SMALL: Final = 0.7  # size of symbols in the drawing of a result
_VISIBLE: Final = 0.45  # share of the length of the largest arrow that every load has there
SPRING: Final = 0.04
"""Length of springs, as a share of the body's length."""
_AWAY: Final = 0.018  # distance from the body at which obstacles and symbols are drawn, as a share of its length
_SAMPLES: Final = 64  # points along the body's length where the range of a field is looked at
_MATERIALS: Final = 8  # so many materials are explained in the legend

_OBLIQUE: Final = 0.05  # sine of the angle to a side below which an arrow counts as lying along it
CORNER: Final = 0.64  # cosine of the angle, 50 degrees, by which edges of one run may turn
_ZIGZAG: Final = np.array([[0.0, 0.15, 0.25, 0.42, 0.58, 0.75, 0.85, 1.0], [0.0, 0.0, 0.3, -0.3, 0.3, -0.3, 0.0, 0.0]])
_STRAIGHT: Final = 1e-12  # 1 − cosine of the angle of edges that lie on one straight line

_CENTRED: Final[dict[str, Any]] = {"ha": "center", "va": "center"}

_INDEX: Final = {"x": "_x", "y": "_y", "normal": "_N", "tangential": "_T"}  # of t, σ and u in the legend
_WORTH_A_NAME: Final = 0.4  # share of the longest side of a name above which the others are named too
_NAMED: Final = 4  # sides of one name that are named at most
_ALONG: Final = (0.5, 0.35, 0.65, 0.2, 0.8)  # shares of a side where its name may stand, the first one if there is room
_ON_LINE: Final = (0.15, 0.5, 0.85)  # the same for lines inside the body
_SLIM: Final = (0.8, 1.2)  # triangles of supports: one of equal sides would point three ways
_ACROSS: Final = 0.7  # cosine of the angle to the normal below which a held component is a tangential one

_FREE: Final[dict[str, Any]] = {"color": style.GREY, "linewidth": 1.0}
_LOADED: Final[dict[str, Any]] = {"color": style.VERMILLION, "linewidth": 1.2}
_HELD: Final[dict[str, Any]] = {"color": style.BLUE, "linewidth": 1.2, "linestyle": (0, (4, 1.5))}
_MIRROR: Final[dict[str, Any]] = {"color": style.GREEN, "linewidth": 1.4, "linestyle": "-."}
_TOUCHING: Final[dict[str, Any]] = {"color": "black", "linewidth": 1.8}
_HELD_TOGETHER: Final[dict[str, Any]] = {"color": style.GREY, "linewidth": 1.0, "linestyle": ":"}
_JOINT: Final[dict[str, Any]] = {"color": style.ORANGE, "linewidth": 2.0, "linestyle": (0, (3, 1.5))}


class Places(NamedTuple):
    """Points (n, 2) along a run [length], and outward unit normals and tangents, where two edges meet halfway."""

    points: FloatArray
    normals: FloatArray
    tangents: FloatArray


def between(at: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Values (k, 2) at places s (k,) along a line, at other places (n, 2)."""
    return np.column_stack([np.interp(at, s, each) for each in values.T])


def spaced(s: FloatArray, distance: float, least: int = 1) -> FloatArray:
    """Places about `distance` apart along a line from the first of s to the last, as far from them as half of that."""
    length = float(s[-1] - s[0])
    count = max(least, round(length / distance))
    return np.asarray(s[0] + (np.arange(count) + 0.5) / max(count, 1) * length)


class Run:
    """Adjoining edges without a corner between them: a straight side, or an arc as short pieces.

    The edges lead on in the direction of their tangents. The line has their ends (n + 1, 2) [length], those of their
    chords where some are arcs; it lies at the lengths (n + 1,) along the run.
    """

    def __init__(self, mesh: TriangleMesh, edges: Edges) -> None:
        points = style.edge_lines(mesh, edges)
        self.line = np.concatenate([points[:, :-1].reshape(-1, 2), points[-1, -1:]])
        self._mesh, self._edges, self._starts = mesh, edges, np.cumsum(edges.length) - edges.length
        self.length, count = float(edges.length.sum()), points.shape[1] - 1
        within = edges.length[:, None] * np.arange(count) / count
        self._along = np.append(self._starts[:, None] + within, self.length)

    def at(self, share: float) -> Places:
        """The place at a share of the length, 0 to 1."""
        return self._places(np.array([share * self.length]))

    def points(self, distance: float, least: int = 2) -> Places:
        """Points about `distance` apart, as far from the ends as half of that, at least `least`."""
        return self._places(spaced(self._along, distance, least))

    def ends_and_points(self, distance: float) -> Places:
        """Points about `distance` apart from end to end, at least both ends and those where the run turns."""
        steps = np.diff(self.line, axis=0)
        steps /= np.hypot(*steps.T)[:, None]
        turns = (steps[1:] * steps[:-1]).sum(axis=1) < 1.0 - _STRAIGHT
        even = np.linspace(0.0, self.length, max(1, round(self.length / distance)) + 1)
        return self._places(np.sort(np.concatenate([even, self._along[1:-1][turns]])))

    def _places(self, s: FloatArray) -> Places:
        frames = np.zeros((2, len(s), 2))
        for side in ("left", "right"):
            number = np.maximum(np.searchsorted(self._starts, s, side) - 1, 0)
            edges, t = self._edges.take(number), ((s - self._starts[number]) / self._edges.length[number])[:, None]
            frames += np.stack(frames_along(edges, t))[:, :, 0]
        points = points_along(self._mesh.vertices, edges, t)[:, 0]
        return Places(points, *(vectors / np.hypot(*vectors.T)[:, None] for vectors in frames))


def runs(mesh: TriangleMesh, edges: Edges) -> list[Run]:
    """Edges joined to runs, which end in corners, in branches, and where the tangent changes its sense."""
    ends = np.column_stack([edges.first, edges.second])
    return [run for chain in chains(ends) for run in _runs_of(mesh, edges.take(chain))]


def _runs_of(mesh: TriangleMesh, edges: Edges) -> Iterator[Run]:
    """Runs of one line of edges."""
    following = edges.take(np.roll(np.arange(len(edges)), -1))
    onward, back = edges.second == following.first, edges.first == following.second
    facing, turn = (
        np.where(onward, (one[:, 1] * other[:, 0]).sum(axis=1), (one[:, 0] * other[:, 1]).sum(axis=1))
        for one, other in zip(*(frames_along(each, np.array([0.0, 1.0])) for each in (edges, following)), strict=True)
    )
    joined = (onward | back) & (turn > CORNER) & (facing > CORNER)
    if len(edges) < 3 or joined.all():  # no closed line, or one without a corner
        joined[-1] = False
    shift = int(np.argmin(joined)) + 1  # a closed line begins behind a corner
    order = np.roll(np.arange(len(edges)), -shift)
    for part in np.split(order, np.flatnonzero(~joined[order])[:-1] + 1):
        yield Run(mesh, edges.take(part if len(part) == 1 or onward[part[0]] else part[::-1]))


def ground(axes: "Axes", line: FloatArray, normal: FloatArray, size: float) -> None:
    """Draw a rigid obstacle: a line of points (n, 2) and oblique strokes of a given size on its far side (n, 2)."""
    axes.plot(*line.T, color="black", linewidth=1.0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    begin, outward = (between(spaced(s, size), s, values) for values in (line, normal))
    sideways = np.column_stack([outward[:, 1], -outward[:, 0]])
    strokes = np.stack([begin, begin + 0.7 * size * (outward + sideways)], axis=1)
    axes.add_collection(style.lines(strokes, "black", "solid", 0.6))


def springs(axes: "Axes", start: FloatArray, end: FloatArray) -> None:
    """Draw springs between points (n, 2) as zigzag lines, none wider than the springs are apart."""
    along = end - start
    side = along[:, ::-1] * [-1.0, 1.0]
    if len(start) > 1:
        apart = np.median(np.hypot(*np.diff(start, axis=0).T))
        side /= np.maximum(np.hypot(*side.T)[:, None] / apart, 1.0)
    points = [start + share * along + across * side for share, across in _ZIGZAG.T]
    axes.add_collection(style.lines(np.stack(points, axis=1), style.GREEN, "solid", 1.0), autolim=False)


def arrows(axes: "Axes", places: Places, vectors: FloatArray, away: float, look: dict[str, Any]) -> FloatArray:
    """Draw vectors (n, 2) that act at places of a side, those of no length left out; both ends of all (2 k, 2).

    An arrow into the body ends at its point, one out of the body begins there; one along the side is centred, at the
    distance `away`.
    """
    size = np.hypot(*vectors.T)
    shown = size > 0.02 * size.max(initial=0.0)
    points, vectors, normals, size = places.points[shown], vectors[shown], places.normals[shown], size[shown]
    outward = ((vectors * normals).sum(axis=1) / size)[:, None]
    tails = np.where(outward < -_OBLIQUE, points - vectors, points)
    tails = np.where(np.abs(outward) <= _OBLIQUE, points - vectors / 2.0 + away * normals, tails)
    settings = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.005, "headwidth": 4.0, "zorder": 5}
    axes.quiver(*tails.T, *vectors.T, **{**settings, **look})
    return np.concatenate([tails, tails + vectors])


def merged(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions, the two components of one edge set's traction or displacement in one where they are apart."""
    found: dict[object, Condition] = {}
    for number, condition in enumerate(conditions):
        if isinstance(condition, Traction | Displacement):
            given: dict[str, Any] = components(condition)
            own = type(condition), condition.edges, set(given) <= set(CARTESIAN)
            found[own] = replace(found.get(own, condition), **given)
        else:
            found[number] = condition
    return list(found.values())


def draw_symbols(
    axes: "Axes",
    problem: ContactProblem,
    moved: Callable[[FloatArray], FloatArray] = np.asarray,
    *,
    obstacles: bool = False,
) -> list[FloatArray]:
    """Draw loads and supports, and obstacles if asked for, as in `draw_problem`, but small and without words.

    Points (n, 2) of the boundary are drawn where `moved` takes them. Returns the ends of arrows (n, 2).
    """
    sketch = _Sketch(axes, problem, Units(), moved=moved, size=_SMALL)
    for condition in sketch.conditions:
        if not isinstance(condition, Contact):
            sketch.condition(condition)
        elif obstacles and condition not in problem.joints:
            sketch.obstacle(condition)
    return sketch.ends


def draw_problem(axes: "Axes", problem: ContactProblem, units: Units | None = None) -> None:
    """Draw mesh, materials, conditions, loads, contacts and joints, with a legend on the right that names them.

    Tractions and prescribed displacements are arrows that point the way they act on the body, full for tractions and
    hollow for displacements, each kind in a scale of its own; supports are triangles (full: both components, hollow:
    the normal one, diamonds: the tangential one); lines of symmetry stand on rollers; obstacles are hatched lines,
    whose distance shows how the gap varies; joints are dashed lines inside the body. `InputError` if a function of the
    problem gives bad values.
    """
    sketch = _Sketch(axes, problem, style.plain_units(units))
    sketch.body()
    for condition in sketch.conditions:
        sketch.condition(condition)
    sketch.names()
    sketch.legend()
    low, high = problem.mesh.vertices.min(axis=0), problem.mesh.vertices.max(axis=0)
    margin = (_AWAY + _ARROW + 0.06) * problem.mesh.length
    style.show_all(axes, np.array([low - margin, high + margin]), sketch.units)
    axes.set_anchor("W")  # towards the left where equal scales leave room, which the legend takes
    style.spread(axes, sketch.written)


@dataclass(eq=False)
class _Sketch:
    """A picture of a problem in the making.

    Points of the boundary are drawn where `moved` takes them. The size is that of arrows and symbols, as a share of the
    usual one; with less the lines of conditions are left out.
    """

    axes: "Axes"
    problem: ContactProblem
    units: Units
    moved: Callable[[FloatArray], FloatArray] = np.asarray
    size: float = 1.0

    def __post_init__(self) -> None:
        self.length = self.problem.mesh.length
        self.conditions = merged(self.problem.conditions)
        self.ends: list[FloatArray] = []  # of arrows
        self.entries: list[Any] = []  # what the legend shows
        self.groups: dict[str, list[str]] = {"free": [], "symmetry": []}  # edge sets that share an entry
        self.written: list[style.Written] = []

    def body(self) -> None:
        """Cells filled by material, grid, outline."""
        from matplotlib.collections import PolyCollection
        from matplotlib.patches import Patch

        mesh, outlines = self.problem.mesh, style.cell_outlines(self.problem.mesh)
        number = self.problem.cell_materials
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
            name = self.problem.regions[chosen - 1].name if chosen else None
            young = f"{style.beside([material.young], 6)[0]} {self.units.stress}"
            text = f"E = {young}, ν = {material.poisson:.4g}, plane {material.plane}"
            if material.strength is not None:
                text += f", strength {material.strength.kind}"
            text = ", ".join([text, *_initial_strain(self.problem, chosen, self.units)])
            if len(present) > 1:
                text = f"{index + 1}{f' ({name})' if name else ''}: {text}"
                middles = cells.mean(axis=1)  # its number stands in the cell nearest to the middle of all of its cells
                place = middles[np.argmin(np.hypot(*(middles - middles.mean(axis=0)).T))]
                box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.GREY, "linewidth": 0.6}
                look_of = {"fontsize": "small", "bbox": box, "zorder": 6, **_CENTRED}
                self.axes.text(place[0], place[1], str(index + 1), **look_of)
            if index < _MATERIALS:
                self.entries.append(Patch(**look, edgecolor="#999999", label=style.wrapped(text)))
        style.draw_grid(self.axes, mesh)
        style.draw_outline(self.axes, mesh, "#999999", 0.6)
        values = evaluate("ContactProblem.body_potential", self.problem.body_potential, *mesh.vertices.T)
        if np.ptp(values) > 0.0:
            self._entry(style.value_range("body force, potential φ", values, self.units.stress), {"color": "none"})

    def condition(self, condition: Condition) -> None:
        """One condition in its symbols."""
        drawn = getattr(self, type(condition).__name__.lower())
        drawn(condition, self._runs(condition))

    def traction(self, condition: Traction, pieces: Sequence[Run]) -> None:
        values, given = self._given(condition, pieces)
        if any(value.any() for value in values.values()):
            self._line(pieces, _LOADED)
            self._arrows(condition, pieces, {"color": style.VERMILLION})
            self._entry(f"traction {condition.name}: {given}", _LOADED, marker=">", filled=True)
        elif len(values) == 2:
            self._line(pieces, _FREE)
            self.groups["free"].append(condition.edges)

    def displacement(self, condition: Displacement, pieces: Sequence[Run]) -> None:
        values, given = self._given(condition, pieces)
        self._line(pieces, _HELD)
        held = [name for name, value in values.items() if not value.any()]
        if held:
            self._supports(pieces, held)
        moved = len(held) < len(values)
        if moved:
            self._arrows(condition, pieces, {"facecolor": "white", "edgecolor": style.BLUE, "linewidth": 0.7})
        self._entry(f"{condition.edges}: {given}", _HELD, marker=">" if moved else "^", filled=len(held) == 2)

    def symmetry(self, condition: Symmetry, pieces: Sequence[Run]) -> None:
        self._line(pieces, _MIRROR)
        for run in pieces:
            self._mark(self._beside(run).points, "o", style.GREEN)
        self.groups["symmetry"].append(condition.edges)

    def contact(self, contact: Contact, pieces: Sequence[Run]) -> None:
        joint = contact in self.problem.joints
        look = _JOINT if joint else _TOUCHING
        self._line(pieces, look)
        if not joint:
            self.obstacle(contact)
        elif contact.has_springs:
            for run in pieces:
                places = run.points(_SPACING * self.length, least=1)
                half = 0.5 * SPRING * self.length * places.normals
                springs(self.axes, places.points - half, places.points + half)
        self._write(contact.name, _on_line(pieces) if joint else self._beyond(contact, pieces), "black")
        self._entry(f"{'joint' if joint else 'contact'} {contact.name}: {', '.join(self._law(contact, pieces))}", look)

    def names(self) -> None:
        """Names of edges without a contact inside the body beside them; joints without a contact."""
        contacts = {contact.edges for contact in self.problem.contacts}
        ruled = dict.fromkeys(condition.edges for condition in self.problem.conditions)
        for name in (name for name in ruled if name not in contacts):
            pieces = runs(self.problem.mesh, self.problem.mesh.edges(name))
            longest = max(run.length for run in pieces)
            for run in [run for run in pieces if run.length > _WORTH_A_NAME * longest][:_NAMED]:
                first, *inside = self._spots(run, -1.0)
                outside = self._spots(run, 1.0)
                rest = outside + inside if name in self.groups["free"] else inside + outside
                self._write(name, [first, *rest], style.GREY)
        for name in self.problem.mesh.joint_names:
            if name not in contacts:
                pieces = runs(self.problem.mesh, self.problem.mesh.edges(name))
                self._line(pieces, _HELD_TOGETHER)
                self._write(name, _on_line(pieces), style.GREY)
                self._entry(f"{name}: inner line without a contact", _HELD_TOGETHER)

    def legend(self) -> None:
        """The legend on the right, groups last."""
        for name, look in (("symmetry", _MIRROR), ("free", _FREE)):
            if self.groups[name]:
                marker = "o" if name == "symmetry" else ""
                self._entry(f"{name}: {', '.join(self.groups[name])}", look, marker=marker)
        self.axes.legend(handles=self.entries, loc="upper left", bbox_to_anchor=(1.02, 1.0), frameon=False)

    def _runs(self, condition: Condition) -> list[Run]:
        return runs(self.problem.mesh, self.problem.mesh.edges(condition.edges))

    def _line(self, pieces: Sequence[Run], look: dict[str, Any]) -> None:
        for run in pieces if self.size == 1.0 else ():
            self.axes.plot(*run.line.T, solid_capstyle="butt", zorder=3, **look)

    def _entry(self, text: str, look: dict[str, Any], marker: str = "", filled: bool = False) -> None:
        from matplotlib.lines import Line2D

        face = look["color"] if filled else "white"
        self.entries.append(
            Line2D([], [], marker=marker, markersize=5, markerfacecolor=face, label=style.wrapped(text), **look)
        )

    def _along(self, pieces: Sequence[Run]) -> Places:
        """Places along the pieces, ends included."""
        places = [run.ends_and_points(self.length / _SAMPLES) for run in pieces]
        return Places(*map(np.concatenate, zip(*places, strict=True)))

    def _given(self, condition: Traction | Displacement, pieces: Sequence[Run]) -> tuple[dict[str, FloatArray], str]:
        """Values of the given components along the pieces, and their ranges in words."""
        signs, unit = ("tσ", self.units.stress) if isinstance(condition, Traction) else ("uu", self.units.length)
        values = _values(condition, self._along(pieces))
        words = [style.value_range(signs[name in LOCAL] + _INDEX[name], each, unit) for name, each in values.items()]
        return values, ", ".join(words)

    def _arrows(self, condition: Traction | Displacement, pieces: Sequence[Run], look: dict[str, Any]) -> None:
        """Arrows, the longest one of all conditions of a kind in full length."""

        def most(condition: Traction | Displacement) -> float:
            return float(np.hypot(*_vectors(condition, self._along(self._runs(condition))).T).max())

        largest = max(most(other) for other in self.conditions if isinstance(other, type(condition)))
        if self.size < 1.0:  # small loads are to be seen too
            largest = min(largest, most(condition) / _VISIBLE)
        for run in pieces:
            places = run.points(_SPACING * (1.0 + self.size) / 2.0 * self.length)
            vectors = _vectors(condition, places) / largest * (self.size * _ARROW * self.length)
            slender = {} if self.size == 1.0 else {"width": 0.0035}
            places = places._replace(points=self.moved(places.points))
            self.ends.append(arrows(self.axes, places, vectors, _AWAY * self.length, look | slender))

    def _supports(self, pieces: Sequence[Run], held: Sequence[str]) -> None:
        """Triangles that point at the body, diamonds where only a component along the side is held."""
        from matplotlib.markers import MarkerStyle
        from matplotlib.transforms import Affine2D

        both = len(held) == 2
        for run in pieces:
            places = self._beside(run)
            across = np.abs((_directions(held[0], places) * places.normals).sum(axis=1)) > _ACROSS
            across |= both
            self._mark(places.points[~across], "d", style.BLUE, filled=both)
            angles = np.round(np.degrees(np.arctan2(*places.normals.T[::-1])) + 90.0)  # from "^" to the way inwards
            for angle in np.unique(angles[across]):
                marker = MarkerStyle("^", transform=Affine2D().scale(*_SLIM).rotate_deg(float(angle)))
                self._mark(places.points[across & (angles == angle)], marker, style.BLUE, filled=both)

    def _beside(self, run: Run) -> Places:
        """Places of symbols beside a run."""
        places = run.points(_SPACING * self.length, least=1)
        points = self.moved(places.points) + _AWAY * self.length * places.normals
        self.ends.append(points + 0.5 * _AWAY * self.length * places.normals)
        return places._replace(points=points)

    def _mark(self, points: FloatArray, marker: Any, colour: str, *, filled: bool = False) -> None:
        """One symbol at points (n, 2)."""
        look: dict[str, Any] = {"linestyle": "none", "markersize": 4.5 * self.size, "color": colour, "zorder": 4}
        self.axes.plot(*points.T, marker=marker, markerfacecolor=colour if filled else "white", **look)

    def obstacle(self, contact: Contact) -> None:
        """Hatched lines whose distance from the body shows how the gap varies, and the force on a plate."""
        pieces = self._runs(contact)
        lines = [run.ends_and_points(self.length / _SAMPLES) for run in pieces]
        gaps = [evaluate("Contact.gap", contact.gap, *places.points.T) for places in lines]
        least, most = min(gap.min() for gap in gaps), max(gap.max() for gap in gaps)
        rise = 0.06 * self.length / (most - least) if most - least > 1e-9 * max(abs(least), abs(most)) else 0.0
        for run, places, gap in zip(pieces, lines, gaps, strict=True):
            distance = (0.5 * _AWAY + SPRING * self.size * contact.has_springs) * self.length + rise * (gap - least)
            if contact.has_springs:
                few = run.points(_SPACING * self.length, least=1)
                springs(self.axes, few.points, few.points + distance.mean() * few.normals)
            line = places.points + distance[:, None] * places.normals
            ground(self.axes, line, places.normals, 0.025 * self.size * self.length)
            self.ends.append(line)
        plate = contact.plate
        force = np.zeros((1, 2)) if plate is None else np.array([[plate.force_x or 0.0, plate.force_y or 0.0]])
        if force.any():
            middle, away = Places(*np.mean([run.at(0.5) for run in pieces], axis=0)), 2.0 * _AWAY * self.length
            vector = 1.2 * _ARROW * self.length * force / np.hypot(*force[0])
            place = middle._replace(points=middle.points + away * middle.normals)
            self.ends.append(arrows(self.axes, place, vector, away, {"color": "black", "width": 0.012}))

    def _spots(self, run: Run, way: float) -> list[style.Spot]:
        """Where a name may stand beside a run, outside (1) or inside (−1)."""
        outwards = [(at.points[0], way * at.normals[0]) for at in map(run.at, _ALONG)]
        return [(point + 0.015 * self.length * normal, style.alignment(normal)) for point, normal in outwards]

    def _beyond(self, contact: Contact, pieces: Sequence[Run]) -> list[style.Spot]:
        """Where the name of an obstacle may stand: behind its middle, or on both sides of the force on a plate."""
        run = max(pieces, key=lambda run: run.length)
        (middle,), (outward,), (along,) = run.at(0.5)
        place = middle + (2.0 * _AWAY + 0.03 + SPRING * contact.has_springs) * self.length * outward
        aside = [np.zeros(2)] if contact.plate is None else [-along, along]
        shift = max(0.3 * run.length, 0.05 * self.length)
        return [(place + shift * way, style.alignment(outward + way)) for way in aside]

    def _write(self, text: str, spots: Sequence[style.Spot], colour: str) -> None:
        self.written.append(style.write(self.axes, text, spots, colour))

    def _law(self, contact: Contact, pieces: Sequence[Run]) -> Iterator[str]:
        """The contact's data, without those that do nothing."""
        if contact.law != "unilateral":
            yield contact.law
        places = self._along(pieces)
        stated: Any
        for stated in filter(None, (contact, contact.plate)):
            for name, each in keys_of(type(stated)).items():
                value = getattr(stated, name)
                if each.symbol and value is not None and (each.tied or contact.law != "tied"):
                    values = evaluate(f"{type(stated).__name__}.{name}", value, *places.points.T)
                    if values.any() or defaults_of(type(stated)).get(name) is None:
                        about = " about\xa0({:.4g}, {:.4g})".format(*stated.pivot) if name == "moment" else ""
                        yield style.value_range(each.symbol, values, getattr(self.units, each.unit, each.unit)) + about


def _initial_strain(problem: ContactProblem, number: int, units: Units) -> Iterator[str]:
    """What strains the material of a number without load, and by how much at the corners of its cells."""
    material = problem.materials[number]
    x, y = problem.mesh.corners[problem.cell_materials == number].reshape(-1, 2).T
    given: dict[str, Field] = {"shrinkage": material.shrinkage}
    if material.expansion != 0.0:
        own = problem.regions[number - 1].temperature if number else None
        given |= {"α": material.expansion, "ΔT": problem.temperature if own is None else own}
    given |= dict(zip(("σ⁰_xx", "σ⁰_yy", "σ⁰_xy"), material.prestress or (), strict=False))
    for name, field in given.items():
        values = evaluate(name, field, x, y)
        if values.any():
            yield style.value_range(name, values, units.stress if name.startswith("σ") else "")


def _directions(component: str, places: Places) -> FloatArray:
    """Unit vectors (n, 2) of a component at places."""
    if component in LOCAL:
        return places.normals if component == "normal" else places.tangents
    return np.tile(np.eye(2)[CARTESIAN.index(component)], (len(places.points), 1))


def _values(condition: Traction | Displacement, places: Places) -> dict[str, FloatArray]:
    """Values of the given components at places, by name."""
    kind, given = type(condition).__name__, components(condition)
    return {name: evaluate(f"{kind}.{name}", value, *places.points.T) for name, value in given.items()}


def _vectors(condition: Traction | Displacement, places: Places) -> FloatArray:
    """The prescribed vectors (n, 2) at places; zero in components that are not given."""
    parts = [value[:, None] * _directions(name, places) for name, value in _values(condition, places).items()]
    return np.asarray(np.sum(parts, axis=0))


def _on_line(pieces: Sequence[Run]) -> list[style.Spot]:
    """Where the name of a line inside the body may stand."""
    run = max(pieces, key=lambda run: run.length)
    return [(run.at(share).points[0], _CENTRED) for share in _ON_LINE]
