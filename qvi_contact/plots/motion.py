"""Contact lines before and after: obstacles, gaps, slips."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.plots.style import (
    GREY,
    LEAST,
    LONGEST,
    STATE_LOOK,
    draw_outline,
    frame,
    legend_below,
    lines,
    magnified,
    plain_units,
)
from qvi_contact.plots.symbols import CORNER, ground
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.result import ContactResult
from solvers.basics.names import known_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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

    Returns
    -------
    float
        The factor.

    """
    from matplotlib.lines import Line2D

    mesh, units = result.problem.mesh, plain_units(units)
    known = list(result.contacts)
    names = known if contacts is None else [contacts] if isinstance(contacts, str) else contacts
    motions = [_motion(result, known_name("contacts", name, {"contacts": known})) for name in names]
    if factor is None:
        sizes = [np.abs(motion.faces).max(axis=(1, 2), initial=0.0) for motion in motions]
        for motion, size in zip(motions, sizes, strict=True):
            size[1] /= 1.0 if motion.joint else 3.0  # an obstacle far away does not hide how the body moves
        largest = np.max([LEAST * result.discretization.scales.displacement, *(size.max() for size in sizes)])
        factor = magnified(float(largest), mesh.length)
    draw_outline(axes, mesh, "#bbbbbb")
    for motion in motions:
        for piece in motion.pieces:
            _draw_piece(axes, motion, piece, factor, mesh.length)
    frame(axes, mesh, units, margin=1.5 * LONGEST)
    entries = [Line2D([], [], color=GREY, linewidth=0.8, linestyle=(0, (4, 3)), label="undeformed")]
    if any(not motion.joint for motion in motions):
        entries.append(Line2D([], [], color="black", linewidth=1.0, label="obstacle"))
    for kind, (colour, marker, filling) in STATE_LOOK.items():
        if any((motion.state == kind).any() for motion in motions):
            look: dict[str, Any] = {"marker": marker, "markersize": 4, "markerfacecolor": filling}
            entries.append(Line2D([], [], color=colour, label=ContactState(kind).name.lower(), **look))
    legend_below(axes, entries, f"displacements × {factor:g}")
    return factor


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
        faces = np.stack([body, gap[:, None] * normal + offset[:, None] * along])
        plate = next(contact.plate for contact in result.problem.contacts if contact.name == name)
        if plate is not None and name in result.plates:  # one that is driven by force
            motion, (x, y) = result.plates[name], place.T - np.array(plate.pivot)[:, None]
            faces += np.column_stack([motion.x - motion.rotation * y, motion.y + motion.rotation * x])
    order = line.path.points(points.count).ravel()
    normals = points.edges.normal[line.path.edges]
    corner = (normals[1:] * normals[:-1]).sum(axis=1) < CORNER
    breaks = np.flatnonzero((np.diff(line.path.line) != 0) | corner) + 1
    ends = [0, *(points.count * breaks).tolist(), len(order)]
    pieces = tuple(slice(a, b) for a, b in pairwise(ends))
    return _Motion(place[order], faces[:, order], normal[order], line.state[order], rows.joint, pieces)


def _draw_piece(axes: "Axes", motion: _Motion, piece: slice, factor: float, length: float) -> None:
    """One connected piece: undeformed line, obstacle, displaced faces coloured and marked by state."""
    place = motion.place[piece]
    first, second = place + factor * motion.faces[0, piece], place + factor * motion.faces[1, piece]
    axes.plot(*place.T, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)))
    if not motion.joint:
        ground(axes, second, motion.normal[piece], 0.025 * length)
    state, step = motion.state[piece], -(-len(place) // _MARKERS)
    for face in (first, second) if motion.joint else (first,):
        for kind, (colour, marker, filling) in STATE_LOOK.items():
            chosen = state == kind
            segments = np.stack([face[:-1], face[1:]], axis=1)[chosen[:-1]]
            axes.add_collection(lines(segments, colour, "solid", 1.4))
            marked = face[step // 2 :: step][chosen[step // 2 :: step]]
            axes.plot(*marked.T, linestyle="none", marker=marker, markersize=4, color=colour, markerfacecolor=filling)
