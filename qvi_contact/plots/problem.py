"""The picture of a problem before it is solved, and the symbols of loads, supports and obstacles in all pictures."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.basics.schema import defaults_of, keys_of
from qvi_contact.mesh.edges import Edges, chains, cross, frames_along, points_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.plots import style
from qvi_contact.problem.conditions import CARTESIAN, Condition, Contact, Displacement, Symmetry, Traction, components
from qvi_contact.problem.material import temperature_of
from qvi_contact.problem.problem import ContactProblem, direction_of
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FILLS: Final = ("#f4f4f4", "#fbe3b5", "#cfe8f7", "#d9efe0", "#f3dcea", "#e8e2f4")
_HATCHES: Final = ("", "..", "xx", "++", "oo")
_ARROW: Final = 0.11  # length of the longest arrow, as a share of the body's length
_SPACING: Final = 0.07  # distance between arrows or symbols, as a share of the body's length
_SMALL: Final = 0.7  # size of symbols in the picture of a result, over their size in that of a problem
_VISIBLE: Final = 0.45  # least length of the largest arrow of a load there, over that of the longest arrow
SPRING: Final = 0.04  # length of springs, as a share of the body's length
_AWAY: Final = 0.018  # distance of obstacles and symbols from the body, as a share of its length
_SAMPLES: Final = 64  # points per body's length at which the range of a field is computed
_MATERIALS: Final = 8  # largest number of materials in the legend

_OBLIQUE: Final = 0.05  # sine of the angle to a side below which an arrow is drawn along the side
CORNER: Final = 0.64  # cosine of the largest angle, 50 degrees, between adjoining edges of one run
_ZIGZAG: Final = np.array([[0.0, 0.15, 0.25, 0.42, 0.58, 0.75, 0.85, 1.0], [0.0, 0.0, 0.3, -0.3, 0.3, -0.3, 0.0, 0.0]])
_STRAIGHT: Final = 1e-12  # 1 − cosine of the angle between edges below which they lie on one straight line

_CENTRED: Final = np.zeros(2)  # direction of a text that is centred on its point

_INDEX: Final = {"x": "_x", "y": "_y", "normal": "_N", "tangential": "_T"}  # indices of t, σ and u in the legend
_WORTH_A_NAME: Final = 0.4  # sides of an edge set get a name if longer than this share of its longest side
_NAMED: Final = 4  # largest number of sides of an edge set that get a name
_LETTER, _LINE = 0.015, 0.05  # width of a letter of a name and height of its line, over the body's length
_ALONG: Final = (0.5, 0.35, 0.65, 0.2, 0.8)  # positions of a name along a side, tried in this order
_ON_LINE: Final = (0.15, 0.5, 0.85)  # positions of a name along a line inside the body
_SLIM: Final = (0.8, 1.2)  # width and height of supports' triangles: with equal sides their direction is not seen
_ACROSS: Final = 0.7  # cosine of the angle to the normal below which a held component counts as tangential

_FREE: Final[dict[str, Any]] = {"color": style.GREY, "linewidth": 1.0}
_LOADED: Final[dict[str, Any]] = {"color": style.VERMILLION, "linewidth": 1.2}
_HELD: Final[dict[str, Any]] = {"color": style.BLUE, "linewidth": 1.2, "linestyle": (0, (4, 1.5))}
_MIRROR: Final[dict[str, Any]] = {"color": style.GREEN, "linewidth": 1.4, "linestyle": "-."}
_TOUCHING: Final[dict[str, Any]] = {"color": "black", "linewidth": 1.8}
_HELD_TOGETHER: Final[dict[str, Any]] = {"color": style.GREY, "linewidth": 1.0, "linestyle": ":"}
_JOINT: Final[dict[str, Any]] = {"color": style.ORANGE, "linewidth": 2.0, "linestyle": (0, (3, 1.5))}


class Places(NamedTuple):
    """Points (n, 2) along a run [length], with outward unit normals and tangents, averaged where two edges meet."""

    points: FloatArray
    normals: FloatArray
    tangents: FloatArray


def between(new_places: FloatArray, s: FloatArray, values: FloatArray) -> FloatArray:
    """Values (n, 2) interpolated at new places (n,), from values (k, 2) at places s (k,) along a line."""
    return np.column_stack([np.interp(new_places, s, each) for each in values.T])


def spaced(s: FloatArray, distance: float, least: int = 1) -> FloatArray:
    """Places about `distance` apart along a line from s[0] to s[-1], half a distance away from its ends."""
    length = float(s[-1] - s[0])
    count = max(least, round(length / distance))
    return np.asarray(s[0] + (np.arange(count) + 0.5) / max(count, 1) * length)


class Run:
    """Adjoining edges without a corner between them: a straight side, or an arc as short pieces.

    The edges are in order, in the direction of their tangents. `line` (n + 1, 2) [length] has their ends, or those of
    their chords if some are arcs, and `_along` (n + 1,) the length of the run up to each.
    """

    def __init__(self, mesh: TriangleMesh, edges: Edges) -> None:
        points = style.edge_lines(mesh, edges)
        self.line = np.concatenate([points[:, :-1].reshape(-1, 2), points[-1, -1:]])
        self._mesh, self._edges, self._starts = mesh, edges, np.cumsum(edges.length) - edges.length
        self.length, count = float(edges.length.sum()), points.shape[1] - 1
        within = edges.length[:, None] * np.arange(count) / count
        self._along = np.append(self._starts[:, None] + within, self.length)

    def at(self, share: float) -> Places:
        """The place at a share of the length, from 0 to 1."""
        return self._places(np.array([share * self.length]))

    def points(self, distance: float, least: int = 2) -> Places:
        """At least `least` points, about `distance` apart, half a distance away from the ends."""
        return self._places(spaced(self._along, distance, least))

    def ends_and_points(self, distance: float) -> Places:
        """Points about `distance` apart, with both ends and all points where the run turns."""
        directions = np.diff(self.line, axis=0)
        directions /= np.hypot(*directions.T)[:, None]
        is_turn = (directions[1:] * directions[:-1]).sum(axis=1) < 1.0 - _STRAIGHT
        even_places = np.linspace(0.0, self.length, max(1, round(self.length / distance)) + 1)
        return self._places(np.sort(np.concatenate([even_places, self._along[1:-1][is_turn]])))

    def _places(self, s: FloatArray) -> Places:
        frames = np.zeros((2, len(s), 2))
        for side in ("left", "right"):
            index = np.maximum(np.searchsorted(self._starts, s, side) - 1, 0)
            edges, t = self._edges.take(index), ((s - self._starts[index]) / self._edges.length[index])[:, None]
            frames += np.stack(frames_along(edges, t))[:, :, 0]
        points = points_along(self._mesh.vertices, edges, t)[:, 0]
        return Places(points, *(vectors / np.hypot(*vectors.T)[:, None] for vectors in frames))


def runs(mesh: TriangleMesh, edges: Edges) -> list[Run]:
    """Runs of the edges. A run ends at a corner, at a branch, and where the tangent reverses."""
    ends = np.column_stack([edges.first, edges.second])
    return [run for chain in chains(ends) for run in _runs_of(mesh, edges.take(chain))]


def _runs_of(mesh: TriangleMesh, edges: Edges) -> Iterator[Run]:
    """Runs of one chain of edges: cut where the tangents or the normals of adjoining edges differ too much."""
    next_edges = edges.take(np.roll(np.arange(len(edges)), -1))
    leads_on, meets_end = edges.second == next_edges.first, edges.first == next_edges.second
    normal_cosine, tangent_cosine = (
        np.where(leads_on, (one[:, 1] * other[:, 0]).sum(axis=1), (one[:, 0] * other[:, 1]).sum(axis=1))
        for one, other in zip(*(frames_along(each, np.array([0.0, 1.0])) for each in (edges, next_edges)), strict=True)
    )
    is_joined = (leads_on | meets_end) & (tangent_cosine > CORNER) & (normal_cosine > CORNER)
    if len(edges) < 3 or is_joined.all():  # too few edges for a closed chain, or no corner in it: cut it anywhere
        is_joined[-1] = False
    shift = int(np.argmin(is_joined)) + 1  # a closed chain begins behind a corner
    order = np.roll(np.arange(len(edges)), -shift)
    for run in np.split(order, np.flatnonzero(~is_joined[order])[:-1] + 1):
        yield Run(mesh, edges.take(run if len(run) == 1 or leads_on[run[0]] else run[::-1]))


def ground(axes: "Axes", line: FloatArray, normal: FloatArray, size: float) -> None:
    """Draw an obstacle: a line of points (n, 2), and strokes of this size on the side of its normals (n, 2)."""
    axes.plot(*line.T, color="black", linewidth=1.0)
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    feet, outward = (between(spaced(s, size), s, values) for values in (line, normal))
    sideways = np.column_stack([outward[:, 1], -outward[:, 0]])
    strokes = np.stack([feet, feet + 0.7 * size * (outward + sideways)], axis=1)
    axes.add_collection(style.lines(strokes, "black", "solid", 0.6))


def springs(axes: "Axes", start: FloatArray, end: FloatArray) -> None:
    """Draw springs between points (n, 2) as zigzag lines, no wider than the distance between them."""
    along = end - start
    sideways = along[:, ::-1] * [-1.0, 1.0]
    if len(start) > 1:
        distance = np.median(np.hypot(*np.diff(start, axis=0).T))
        sideways /= np.maximum(np.hypot(*sideways.T)[:, None] / distance, 1.0)
    corners = [start + share * along + across * sideways for share, across in _ZIGZAG.T]
    axes.add_collection(style.lines(np.stack(corners, axis=1), style.GREEN, "solid", 1.0), autolim=False)


def arrows(axes: "Axes", places: Places, vectors: FloatArray, distance: float, look: dict[str, Any]) -> FloatArray:
    """Draw vectors (n, 2) at places of a side, without those near zero; returns the ends of the arrows (2 k, 2).

    An arrow into the body ends at its point, an arrow out of it begins there. An arrow along the side is centred on its
    point, at the distance `distance` from the side.
    """
    size = np.hypot(*vectors.T)
    is_shown = size > 0.02 * size.max(initial=0.0)
    points, normals, vectors, size = (array[is_shown] for array in (places.points, places.normals, vectors, size))
    outward = ((vectors * normals).sum(axis=1) / size)[:, None]
    tails = np.where(outward < -_OBLIQUE, points - vectors, points)
    tails = np.where(np.abs(outward) <= _OBLIQUE, points - vectors / 2.0 + distance * normals, tails)
    settings = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.005, "headwidth": 4.0, "zorder": 5}
    axes.quiver(*tails.T, *vectors.T, **{**settings, **look})
    return np.concatenate([tails, tails + vectors])


def merged(conditions: Sequence[Condition]) -> list[Condition]:
    """The conditions, with two tractions or displacements that give one component each on an edge set joined to one."""
    merged_conditions: dict[object, Condition] = {}
    for number, condition in enumerate(conditions):
        if isinstance(condition, Traction | Displacement):
            values: dict[str, Any] = components(condition)
            key = type(condition), condition.edges, set(values) <= set(CARTESIAN)
            merged_conditions[key] = replace(merged_conditions.get(key, condition), **values)
        else:
            merged_conditions[number] = condition
    return list(merged_conditions.values())


def draw_symbols(
    axes: "Axes",
    problem: ContactProblem,
    moved: Callable[[FloatArray], FloatArray] = np.asarray,
    *,
    obstacles: bool = False,
) -> list[FloatArray]:
    """Draw small symbols of loads and supports, and on demand of obstacles, without texts.

    `moved` maps points (n, 2) of the boundary to their places in the picture. Returns the ends of arrows (n, 2).
    """
    sketch = _Sketch(axes, problem, Units(), moved=moved, size=_SMALL)
    for condition in sketch.conditions:
        if not isinstance(condition, Contact):
            sketch.condition(condition)
        elif obstacles and condition not in problem.joints:
            sketch.obstacle(condition)
    return sketch.ends


def draw_problem(axes: "Axes", problem: ContactProblem, units: Units | None = None) -> None:
    """Draw mesh, materials, conditions, loads, contacts and joints, with a legend on the right.

    Tractions are full arrows, prescribed displacements hollow ones, each kind in a scale of its own; they point in the
    direction in which they act on the body. Supports are full triangles where both components are held, hollow ones
    where the normal component is, diamonds where the tangential one is. Lines of symmetry have rollers. Obstacles are
    hatched lines whose distance shows how the gap varies. Joints are dashed lines inside the body. `InputError` if a
    function of the problem returns bad values.
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
    sketch.labels.drawn += sketch.ends
    sketch.labels.fit(np.array([low, high]))


@dataclass(eq=False)
class _Sketch:
    """Draws a problem on axes, one condition after the other, and collects ends of arrows, legend entries and texts.

    `moved` maps points of the boundary to their places in the picture. `size` scales arrows and symbols; below 1 the
    lines of conditions along the boundary are left out.
    """

    axes: "Axes"
    problem: ContactProblem
    units: Units
    moved: Callable[[FloatArray], FloatArray] = np.asarray
    size: float = 1.0

    def __post_init__(self) -> None:
        self.length = self.problem.mesh.length
        self.conditions = merged(self.problem.conditions)
        self.ends: list[FloatArray] = []  # ends of arrows, to be inside the picture
        self.entries: list[Any] = []  # handles of the legend
        self.groups: dict[str, list[str]] = {"free": [], "symmetry": []}  # edge sets that share an entry
        self.labels = style.Labels(self.axes)

    def body(self) -> None:
        """Cells filled by material, grid, outline."""
        from matplotlib.collections import PolyCollection
        from matplotlib.patches import Patch

        mesh, outlines = self.problem.mesh, style.cell_outlines(self.problem.mesh)
        cell_materials = self.problem.cell_materials
        present = np.unique(cell_materials).tolist()
        for index, material_number in enumerate(present):
            look: dict[str, Any] = {
                "facecolor": _FILLS[index % len(_FILLS)],
                "hatch": _HATCHES[index // len(_FILLS) % len(_HATCHES)],
            }
            cells = outlines[cell_materials == material_number]
            self.axes.add_collection(
                PolyCollection(list(cells), **look, edgecolors="#cccccc", linewidths=0.0, antialiased=False, zorder=0)
            )
            material = self.problem.materials[material_number]
            name = self.problem.regions[material_number - 1].name if material_number else None
            young = f"{style.beside([material.young], 6)[0]} {self.units.stress}"
            text = f"E = {young}, ν = {material.poisson:.12g}, plane {material.plane}"
            if material.strength is not None:
                text += f", strength {material.strength.kind}"
            text = ", ".join([text, *_initial_strain(self.problem, material_number, self.units)])
            if len(present) > 1:
                text = f"{index + 1}{f' ({name})' if name else ''}: {text}"
                middles, sides = cells.mean(axis=1), np.diff(mesh.corners[cell_materials == material_number], axis=1)
                centre = np.average(middles, axis=0, weights=np.abs(cross(sides[:, 0], sides[:, 1])))
                place = middles[np.argmin(np.hypot(*(middles - centre).T))]  # in the cell nearest to the centre
                box = {"boxstyle": "circle,pad=0.15", "facecolor": "white", "edgecolor": style.GREY, "linewidth": 0.6}
                self.labels.write(str(index + 1), [(place, _CENTRED)], bbox=box)
            if index < _MATERIALS:
                self.entries.append(Patch(**look, edgecolor="#999999", label=style.wrapped(text)))
        style.draw_grid(self.axes, mesh)
        style.draw_outline(self.axes, mesh, "#999999", 0.6)
        values = evaluate("ContactProblem.body_potential", self.problem.body_potential, *mesh.vertices.T)
        if np.ptp(values) > 0.0:
            self._entry(style.value_range("body force, potential φ", values, self.units.stress), {"color": "none"})

    def condition(self, condition: Condition) -> None:
        """Draw the symbols of one condition, by the method of its class."""
        getattr(self, type(condition).__name__.lower())(condition, self._runs(condition))

    def traction(self, condition: Traction, pieces: Sequence[Run]) -> None:
        values, ranges = self._ranges(condition, pieces)
        if any(value.any() for value in values.values()):
            self._line(pieces, _LOADED)
            self._arrows(condition, pieces, {"color": style.VERMILLION})
            self._entry(f"traction {condition.name}: {ranges}", _LOADED, marker=">", filled=True)
        elif len(values) == 2:
            self._line(pieces, _FREE)
            self.groups["free"].append(condition.edges)

    def displacement(self, condition: Displacement, pieces: Sequence[Run]) -> None:
        values, ranges = self._ranges(condition, pieces)
        self._line(pieces, _HELD)
        fixed = [name for name, value in values.items() if not value.any()]
        if fixed:
            self._supports(pieces, fixed)
        is_moved = len(fixed) < len(values)
        if is_moved:
            self._arrows(condition, pieces, {"facecolor": "white", "edgecolor": style.BLUE, "linewidth": 0.7})
        self._entry(f"{condition.edges}: {ranges}", _HELD, marker=">" if is_moved else "^", filled=len(fixed) == 2)

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
        self.labels.write(contact.name, self._on_line(contact.name, pieces) if joint else self._beyond(contact, pieces))
        self._entry(f"{'joint' if joint else 'contact'} {contact.name}: {', '.join(self._law(contact, pieces))}", look)

    def names(self) -> None:
        """Write the names of edge sets without a contact, and of joints without a contact, at free places."""
        contacts = {contact.edges for contact in self.problem.contacts}
        named_conditions = dict.fromkeys(condition.edges for condition in self.problem.conditions)
        for name in (name for name in named_conditions if name not in contacts):
            pieces = runs(self.problem.mesh, self.problem.mesh.edges(name))
            longest = max(run.length for run in pieces)
            for run in [run for run in pieces if run.length > _WORTH_A_NAME * longest][:_NAMED]:
                outside = [(at.points[0], at.normals[0]) for at in map(run.at, _ALONG)]
                first, *inside = [(point, -normal) for point, normal in outside]
                other_spots = outside + inside if name in self.groups["free"] else inside + outside
                normal, needed = run.at(0.5).normals[0], self.length * np.array([_LETTER * len(name), _LINE])
                is_thin = np.ptp(self.problem.mesh.vertices @ normal) < np.abs(normal) @ needed
                spots = [*outside, first] if is_thin else [first, *other_spots]
                self.labels.write(name, spots, color=style.GREY)
        for name in self.problem.mesh.joint_names:
            if name not in contacts:
                pieces = runs(self.problem.mesh, self.problem.mesh.edges(name))
                self._line(pieces, _HELD_TOGETHER)
                self.labels.write(name, self._on_line(name, pieces), color=style.GREY)
                self._entry(f"{name}: inner line without a contact", _HELD_TOGETHER)

    def legend(self) -> None:
        """The legend on the right; edge sets that share an entry come last."""
        for name, look, marker in (("symmetry", _MIRROR, "o"), ("free", _FREE, "")):
            if self.groups[name]:
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
        """Places along runs, with their ends."""
        places = [run.ends_and_points(self.length / _SAMPLES) for run in pieces]
        return Places(*map(np.concatenate, zip(*places, strict=True)))

    def _ranges(self, condition: Traction | Displacement, pieces: Sequence[Run]) -> tuple[dict[str, FloatArray], str]:
        """Values of the given components along the runs, and a text with their ranges."""
        signs, unit = ("σt", self.units.stress) if isinstance(condition, Traction) else ("uu", self.units.length)
        values = _values(condition, self._along(pieces))
        named = {signs[name in CARTESIAN] + _INDEX[name]: each for name, each in values.items()}
        return values, ", ".join(style.value_range(name, each, unit) for name, each in named.items())

    def _arrows(self, condition: Traction | Displacement, pieces: Sequence[Run], look: dict[str, Any]) -> None:
        """Draw arrows, in a scale in which the largest arrow of all conditions of this class has full length."""

        def largest_of(condition: Traction | Displacement) -> float:
            return float(np.hypot(*_vectors(condition, self._along(self._runs(condition))).T).max())

        largest = max(largest_of(other) for other in self.conditions if isinstance(other, type(condition)))
        if self.size < 1.0:  # small loads stay visible
            largest = min(largest, largest_of(condition) / _VISIBLE)
        for run in pieces:
            places = run.points(_SPACING * (1.0 + self.size) / 2.0 * self.length)
            vectors = _vectors(condition, places) / largest * (self.size * _ARROW * self.length)
            thin = {} if self.size == 1.0 else {"width": 0.0035}
            places = places._replace(points=self.moved(places.points))
            self.ends.append(arrows(self.axes, places, vectors, _AWAY * self.length, look | thin))

    def _supports(self, pieces: Sequence[Run], held: Sequence[str]) -> None:
        """Draw triangles that point at the body, or diamonds where only a component along the side is held."""
        from matplotlib.markers import MarkerStyle
        from matplotlib.transforms import Affine2D

        both = len(held) == 2
        for run in pieces:
            places = self._beside(run)
            is_normal = np.abs((direction_of(held[0], *places[1:]) * places.normals).sum(axis=1)) > _ACROSS
            is_normal |= both
            self._mark(places.points[~is_normal], "d", style.BLUE, filled=both)
            angles = np.round(np.degrees(np.arctan2(*places.normals.T[::-1])) + 90.0)  # the marker "^" turned inwards
            for angle in np.unique(angles[is_normal]):
                marker = MarkerStyle("^", transform=Affine2D().scale(*_SLIM).rotate_deg(float(angle)))
                self._mark(places.points[is_normal & (angles == angle)], marker, style.BLUE, filled=both)

    def _beside(self, run: Run) -> Places:
        """Places of symbols beside a run, outside the body."""
        places = run.points(_SPACING * self.length, least=1)
        points = self.moved(places.points) + _AWAY * self.length * places.normals
        self.ends.append(points + 0.5 * _AWAY * self.length * places.normals)
        return places._replace(points=points)

    def _mark(self, points: FloatArray, marker: Any, colour: str, *, filled: bool = False) -> None:
        """Draw a marker at points (n, 2)."""
        look: dict[str, Any] = {"linestyle": "none", "markersize": 4.5 * self.size, "color": colour, "zorder": 4}
        self.axes.plot(*points.T, marker=marker, markerfacecolor=colour if filled else "white", **look)

    def obstacle(self, contact: Contact) -> None:
        """Draw hatched lines whose distance from the body shows how the gap varies, and the force on a plate."""
        pieces = self._runs(contact)
        lines = [run.ends_and_points(self.length / _SAMPLES) for run in pieces]
        gaps = [evaluate("Contact.gap", contact.gap, *places.points.T) for places in lines]
        low, high = min(gap.min() for gap in gaps), max(gap.max() for gap in gaps)
        scale = 0.06 * self.length / (high - low) if high - low > 1e-9 * max(abs(low), abs(high)) else 0.0
        for run, places, gap in zip(pieces, lines, gaps, strict=True):
            distance = (0.5 * _AWAY + SPRING * self.size * contact.has_springs) * self.length + scale * (gap - low)
            if contact.has_springs:
                feet = run.points(_SPACING * self.length, least=1)
                springs(self.axes, feet.points, feet.points + distance.mean() * feet.normals)
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

    def _on_line(self, name: str, pieces: Sequence[Run]) -> list[style.Spot]:
        """Spots for the name of a line inside the body: on it, or behind its ends if it is short."""
        run = max(pieces, key=lambda run: run.length)
        if run.length > 2.0 * _LETTER * len(name) * self.length:
            return [(run.at(share).points[0], _CENTRED) for share in _ON_LINE]
        ends = run.at(1.0), run.at(0.0)
        return [(end.points[0], way * end.tangents[0]) for end, way in zip(ends, (1.0, -1.0), strict=True)]

    def _beyond(self, contact: Contact, pieces: Sequence[Run]) -> list[style.Spot]:
        """Spots for the name of an obstacle: behind its middle, or on both sides of the force on its plate."""
        run = max(pieces, key=lambda run: run.length)
        (middle,), (outward,), (along,) = run.at(0.5)
        place = middle + (2.0 * _AWAY + 0.03 + SPRING * contact.has_springs) * self.length * outward
        aside = [np.zeros(2)] if contact.plate is None else [-along, along]
        shift = max(0.3 * run.length, 0.05 * self.length)
        return [(place + shift * way, outward + way) for way in aside]

    def _law(self, contact: Contact, pieces: Sequence[Run]) -> Iterator[str]:
        """The data of a contact and its plate as texts, without zeros that are defaults."""
        if contact.law != "unilateral":
            yield contact.law
        places = self._along(pieces)
        owner: Any
        for owner in filter(None, (contact, contact.plate)):
            for name, key in keys_of(type(owner)).items():
                value = getattr(owner, name)
                if key.symbol and value is not None and (key.tied or contact.law != "tied"):
                    values = evaluate(f"{type(owner).__name__}.{name}", value, *places.points.T)
                    if values.any() or defaults_of(type(owner)).get(name) is None:
                        about = " about\xa0({:.4g}, {:.4g})".format(*owner.pivot) if name == "moment" else ""
                        yield style.value_range(key.symbol, values, getattr(self.units, key.unit, key.unit)) + about


def _initial_strain(problem: ContactProblem, number: int, units: Units) -> Iterator[str]:
    """Texts of the shrinkage, thermal expansion and prestress of a material, with ranges at corners of its cells."""
    material = problem.materials[number]
    x, y = problem.mesh.corners[problem.cell_materials == number].reshape(-1, 2).T
    fields: dict[str, Field] = {"shrinkage": material.shrinkage}
    if material.expansion != 0.0:
        fields |= {"α": material.expansion, "ΔT": temperature_of(problem, number)}
    fields |= dict(zip(("σ⁰_xx", "σ⁰_yy", "σ⁰_xy"), material.prestress or (), strict=False))
    for name, field in fields.items():
        values = evaluate(name, field, x, y)
        if values.any():
            yield style.value_range(name, values, units.stress if name.startswith("σ") else "")


def _values(condition: Traction | Displacement, places: Places) -> dict[str, FloatArray]:
    """Values of the given components at places, by name."""
    kind, fields = type(condition).__name__, components(condition)
    return {name: evaluate(f"{kind}.{name}", value, *places.points.T) for name, value in fields.items()}


def _vectors(condition: Traction | Displacement, places: Places) -> FloatArray:
    """The prescribed vectors (n, 2) at places; zero in components that are not given."""
    values = _values(condition, places).items()
    return np.asarray(sum(value[:, None] * direction_of(name, *places[1:]) for name, value in values))
