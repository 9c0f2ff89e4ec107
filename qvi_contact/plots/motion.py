"""Contact lines before and after: obstacles, gaps, slips."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.plots.style import GREY, STATE_LOOK, draw_outline, frame, legend_below, lines, plain_units
from qvi_contact.plots.symbols import CORNER, ground
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.contact_path import ContactPath
from qvi_contact.solution.result import ContactResult
from solvers.basics.names import known_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_LONGEST: Final = 0.08  # share of the body's length at which the largest displacement is drawn
_ROUNDING: Final = 1e-5  # displacements below this share of what strains the body are not magnified any further
_MARKERS: Final = 24  # at most about so many markers along one piece of a contact


@dataclass(frozen=True, eq=False)
class _Motion:
    """How the faces at a contact move: the body's own first, then the obstacle or the other face of a joint.

    Attributes
    ----------
    place : (m, 2) array
        The contact's points in order along it [length].
    faces : (2, m, 2) array
        Displacements of the two faces [length].
    normal : (m, 2) array
        Outward normal of the first face.
    state : (m,) int array
        `ContactState` of each point.
    joint : bool
        Whether the second face is elastic too.
    pieces : tuple of slices
        Points that hang together, without a corner between them.

    """

    place: FloatArray
    faces: FloatArray
    normal: FloatArray
    state: IntArray
    joint: bool
    pieces: tuple[slice, ...]


def deformed_contact(
    axes: "Axes",
    result: ContactResult,
    contacts: str | Sequence[str] | None = None,
    factor: float | None = None,
    units: Units | None = None,
    legend: bool = True,
) -> float:
    """Draw contact lines before and after: the obstacle, the body's surface, and which parts are open, stick or slip.

    What is known of displacements is u_N = g − gap and u_T = w + slip, on top of the motion of a plate driven by force.
    The surface is drawn displaced by u_N along the outward normal and u_T along the tangent, the obstacle by g and w,
    all exaggerated by one stated factor; in a load history slip counts from its beginning. A joint is drawn as two
    faces that are `gap` apart and shifted by w + slip: the lower or left one moves by half of it along the tangent, the
    other one back.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw, over an outline of the body; axes are in units of length.
    result : ContactResult
        The state.
    contacts : str or sequence of str, optional
        Names of the contacts; all of them by default.
    factor : float, optional
        By how much displacements are exaggerated; by default so much that the largest one spans about 8 % of the
        body's length.
    units : Units, optional
        Labels.
    legend : bool
        Whether to add a legend, with the factor as its title.

    Returns
    -------
    float
        The factor.

    """
    mesh, units = result.problem.mesh, plain_units(units)
    motions = [_motion(result, name) for name in _names(result, contacts)]
    if factor is None:
        factor = _automatic_factor(motions, mesh.length, _ROUNDING * result.discretization.scales.displacement)
    draw_outline(axes, mesh, "#bbbbbb")
    for motion in motions:
        for piece in motion.pieces:
            _draw_piece(axes, motion, piece, factor, mesh.length)
    frame(axes, mesh, margin=1.5 * _LONGEST)
    axes.set_xlabel(f"x [{units.length}]")
    axes.set_ylabel(f"y [{units.length}]")
    if legend:
        legend_below(axes, list(_legend_entries(motions)), f"displacements × {factor:g}")
    return factor


def _names(result: ContactResult, contacts: str | Sequence[str] | None) -> list[str]:
    known = list(result.contacts)
    names = known if contacts is None else [contacts] if isinstance(contacts, str) else list(contacts)
    return [known_name("contacts", name, {"contacts": known}) for name in names]


def _motion(result: ContactResult, name: str) -> _Motion:
    """Displacements of both faces of one contact, see `deformed_contact`."""
    discretization, line = result.discretization, result.contacts[name]
    index = next(i for i, rows in enumerate(discretization.contacts) if rows.name == name)
    rows, unit = discretization.contacts[index], discretization.scales.displacement
    points, place = rows.points, np.column_stack([line.x, line.y])
    along, normal = points.tangents, points.normals
    moved = (unit * rows.offset + line.slip)[:, None] * along  # what slipped in earlier load steps is in rows.offset
    if rows.joint:
        half = (moved - line.gap[:, None] * normal) / 2.0
        faces = np.stack([half, -half])
    else:
        gap, offset = unit * rows.gap, unit * discretization.offsets()[index]
        body = (gap - line.gap)[:, None] * normal + moved
        faces = np.stack([body, gap[:, None] * normal + offset[:, None] * along]) + _plate_motion(result, name, place)
    order = line.path.points(points.count).ravel()
    pieces = _pieces(line.path, points.edges.normal[line.path.edges], points.count)
    return _Motion(place[order], faces[:, order], normal[order], line.state[order], rows.joint, pieces)


def _plate_motion(result: ContactResult, name: str, place: FloatArray) -> FloatArray:
    """Displacement of a plate driven by force at points (m, 2), zero for other obstacles."""
    if name not in result.plates:
        return np.zeros_like(place)
    motion = result.plates[name]
    plate = next(contact.plate for contact in result.problem.contacts if contact.name == name)
    assert plate is not None  # as it has moved
    x, y = place.T - np.array(plate.pivot)[:, None]
    return np.column_stack([motion.x - motion.rotation * y, motion.y + motion.rotation * x])


def _pieces(path: ContactPath, normals: FloatArray, count: int) -> tuple[slice, ...]:
    """Points in order, so many an edge, of each row of adjoining edges with these normals (n, 2)."""
    corner = (normals[1:] * normals[:-1]).sum(axis=1) < CORNER
    breaks = (np.diff(path.line) != 0) | corner
    ends = [0, *(count * (np.flatnonzero(breaks) + 1)).tolist(), count * len(path.edges)]
    return tuple(slice(a, b) for a, b in pairwise(ends))


def _automatic_factor(motions: Sequence[_Motion], length: float, least: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that keeps displacements within `_LONGEST` of the body's length.

    Obstacles may reach three times as far, so that one far away does not hide how the body moves; displacements below
    `least` count as that large, so that rounding is not shown.
    """
    largest = least
    for motion in motions:
        sizes = np.abs(motion.faces).max(axis=(1, 2), initial=0.0)
        largest = max(largest, float(sizes[0]), float(sizes[1]) / (1.0 if motion.joint else 3.0))
    wanted = _LONGEST * length / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= wanted * (1 + 1e-12)))


def _draw_piece(axes: "Axes", motion: _Motion, piece: slice, factor: float, length: float) -> None:
    """One connected piece: undeformed line, obstacle, displaced faces coloured and marked by state."""
    place = motion.place[piece]
    first, second = place + factor * motion.faces[0, piece], place + factor * motion.faces[1, piece]
    axes.plot(*place.T, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    if not motion.joint:
        ground(axes, second, motion.normal[piece], 0.025 * length)
    for face in (first, second) if motion.joint else (first,):
        _draw_face(axes, face, motion.state[piece])


def _draw_face(axes: "Axes", face: FloatArray, state: IntArray) -> None:
    step = -(-len(face) // _MARKERS)
    for kind, (colour, marker, filling) in STATE_LOOK.items():
        chosen = state == kind
        segments = np.stack([face[:-1], face[1:]], axis=1)[chosen[:-1]]
        axes.add_collection(lines(segments, colour, "solid", 1.4))
        marked = face[step // 2 :: step][chosen[step // 2 :: step]]
        axes.plot(*marked.T, linestyle="none", marker=marker, markersize=4, color=colour, markerfacecolor=filling)


def _legend_entries(motions: Sequence[_Motion]) -> "Iterator[Line2D]":
    from matplotlib.lines import Line2D

    yield Line2D([], [], color=GREY, linewidth=0.8, linestyle=(0, (4, 3)), label="undeformed")
    if any(not motion.joint for motion in motions):
        yield Line2D([], [], color="black", linewidth=1.0, label="obstacle")
    present = set(np.concatenate([np.empty(0, dtype=np.int64), *(motion.state for motion in motions)]).tolist())
    for kind, (colour, marker, filling) in STATE_LOOK.items():
        if kind in present:
            name = ContactState(kind).name.lower()
            yield Line2D([], [], color=colour, marker=marker, markersize=4, markerfacecolor=filling, label=name)
