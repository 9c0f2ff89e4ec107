"""Tractions along a contact against its friction bound, with its open, stick and slip parts.

Curves run through the values at the points, monotone between them, and are closed where a contact opens: what the
polynomials of the element do beyond their points, teeth and jumps where edges meet, is nothing but the mesh.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element.edge import gauss_legendre
from qvi_contact.plots.style import BLUE, VERMILLION, plain_units
from qvi_contact.solution.contact_line import ContactLine, ContactState
from qvi_contact.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STATE_STYLE: Final[dict[ContactState, dict[str, Any]]] = {
    ContactState.OPEN: {"facecolor": "none", "edgecolor": "#dddddd", "hatch": ".."},
    ContactState.STICK: {"facecolor": "#eeeeee", "edgecolor": "none"},
    ContactState.SLIP: {"facecolor": "none", "edgecolor": "#cccccc", "hatch": "//"},
    ContactState.CLOSED: {"facecolor": "#dddddd", "edgecolor": "none"},
}

_PRESSURE: Final[dict[str, Any]] = {"color": VERMILLION, "marker": "s"}
_BOUND: Final[dict[str, Any]] = {"color": BLUE, "linestyle": "--", "marker": "^"}
_TOTAL: Final[dict[str, Any]] = {"color": VERMILLION, "linestyle": "-.", "linewidth": 0.8}
_FLUID: Final[dict[str, Any]] = {"color": BLUE, "linewidth": 0.8}
_TANGENTIAL: Final[dict[str, Any]] = {"color": "black", "linestyle": ":", "marker": "o"}

_MARKERS: Final = 40  # at most so many markers a curve
_BETWEEN: Final = 5  # parts of a curve between two points
_SLANTED: Final = 1e-9  # rise of an edge over its length from which on it is not horizontal


def contact_tractions(axes: "Axes", line: ContactLine, units: Units | None = None) -> None:
    """Draw pressure, friction bound and |σ_T| along a contact, with its open, stick and slip parts shaded by hatching.

    A negative pressure is tension, which bilateral and tied contacts can carry. Where a fluid presses in the contact it
    is drawn three times: in all, of the fluid, and the effective pressure, which friction depends on.
    """
    units = plain_units(units)
    (pieces, label), prime = pieces_along(line), "'" if line.has_fluid else ""
    effective, limit = line.effective_normal_stress, line.friction_bound
    coulomb = np.allclose(limit, line.friction * np.abs(effective), rtol=1e-9, atol=0.0)
    curves = [
        (f"{'effective ' if prime else ''}pressure $-\\sigma_N{prime}$", -effective, _PRESSURE),
        (f"bound $\\mu|\\sigma_N{prime}|$" if coulomb else "friction bound", limit, _BOUND),
    ]
    if line.has_fluid:
        curves.append(("pressure $-\\sigma_N$", -line.normal_stress, _TOTAL))
        curves.append(("fluid $p_w$", line.pore_pressure, _FLUID))
    curves.append(("friction $|\\sigma_T|$", np.abs(line.tangential_stress), _TANGENTIAL))
    _draw_states(axes, pieces, line)
    lowest, every = 0.0, -(-len(line.x) // _MARKERS)
    for name, values, look in (curve for curve in curves if np.isfinite(curve[1]).all()):  # a tied contact has no bound
        x, y, marked = [np.empty(0)], [np.empty(0)], list[int]()
        for piece in pieces:
            s, curve = monotone(piece.with_ends, piece.closed(line, values))
            marked += (sum(map(len, x)) + _BETWEEN * np.arange(1, len(piece.points) + 1)).tolist()
            x += [s, np.array([np.nan])]  # a line breaks where the contact does
            y += [curve, np.array([np.nan])]
        drawn = np.concatenate(y)[:-1]
        axes.plot(np.concatenate(x)[:-1], drawn, markevery=marked[::every], markersize=3, label=name, **look)
        lowest = min(lowest, float(np.nanmin(drawn, initial=0.0)))
    axes.set_ylim(bottom=1.05 * lowest, auto=None)  # the top still follows what is drawn
    axes.set_xlabel(f"{label} [{units.length}]")
    axes.set_ylabel(f"traction [{units.stress}]")


@dataclass(frozen=True, eq=False)
class Piece:
    """A line of a contact that hangs together: numbers of its points in order, places of these and of its ends."""

    points: IntArray
    s: FloatArray
    ends: FloatArray

    @property
    def with_ends(self) -> FloatArray:
        """Places of the points between those of both ends (k + 2,)."""
        return np.concatenate([self.ends[:1], self.s, self.ends[1:]])

    def extended(self, values: FloatArray) -> FloatArray:
        """Values (m, …) of the contact at the points of this line, and at both ends, where they go on, (k + 2, …)."""
        found = values[self.points]
        first, last = (
            found[near] + (end - self.s[near]) / (self.s[near] - self.s[next_]) * (found[near] - found[next_])
            for end, near, next_ in ((self.ends[0], 0, 1), (self.ends[1], -1, -2))
        )
        return np.concatenate([[first], found, [last]])

    def closed(self, line: ContactLine, values: FloatArray) -> FloatArray:
        """The same of a traction (m,), which is zero at an end that is open, and has no other sign there."""
        found, opened = self.extended(values), line.state[self.points] == ContactState.OPEN
        for end, near in ((0, 1), (-1, -2)):
            if found[end] * found[near] < 0.0 or (opened[end] and not line.has_fluid):
                found[end] = 0.0
        return found


def pieces_along(line: ContactLine, *, coordinates: bool = True) -> tuple[list[Piece], str]:
    """The lines of a contact, from left to right, and what their places are.

    That is the coordinate along a horizontal or vertical contact, if asked for, else the length along it. The latter
    too where coordinates of lines above or beside each other would overlap.
    """
    path, ends = line.path, line.ends
    numbers, s = path.points(line.points_per_edge), path.places(gauss_legendre(line.points_per_edge)[0])
    stops = path.starts + path.lengths
    found = [
        Piece(numbers[own].ravel(), s[own].ravel(), np.array([path.starts[own[0]], stops[own[-1]]]))
        for own in path.lines
    ]
    rise = np.abs(ends[:, 1] - ends[:, 0])
    for axis, name in enumerate("xy" if coordinates else ""):
        places = ends[path.edges, :, axis]
        reach = np.array([(places[own].min(), places[own].max()) for own in path.lines]).reshape(-1, 2)
        order = np.argsort(reach[:, 0], kind="stable")
        apart = reach[order][1:, 0] - reach[order][:-1, 1] >= -1e-6 * path.lengths.max()
        if (rise[:, 1 - axis] <= _SLANTED * rise[:, axis]).all() and apart.all():
            along = (line.x, line.y)[axis]
            return [Piece(found[k].points, along[found[k].points], reach[k]) for k in order.tolist()], name
    return found, f"length along the contact{', line by line' if len(found) > 1 else ''}"


def monotone(s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places and values of a curve through values at places s that has no extremes between them."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and few pictures need it

    share = np.arange(_BETWEEN) / _BETWEEN
    dense = np.append((s[:-1, None] + np.diff(s)[:, None] * share).ravel(), s[-1])
    return dense, np.asarray(PchipInterpolator(s, values)(dense))


def _draw_states(axes: "Axes", pieces: Sequence[Piece], line: ContactLine) -> None:
    """Shade the parts of the contact that are open, stick or slip.

    Each point has its share of its edge: Gauss weights add up to the edge, so the shares meet.
    """
    bands: dict[int, list[tuple[float, float]]] = {}
    for piece in pieces:
        states, stops = line.state[piece.points], piece.ends[0] + np.cumsum(line.weights[piece.points])
        changes = np.flatnonzero(np.diff(states))
        borders = [float(piece.ends[0]), *stops[changes].tolist(), float(stops[-1])]
        for kind, borders_of in zip(states[[*changes.tolist(), -1]].tolist(), pairwise(borders), strict=True):
            bands.setdefault(kind, []).append(borders_of)
    for kind in sorted(bands):
        ranges, name = np.array(bands[kind]), ContactState(kind).name.lower()
        bars: dict[str, Any] = {"align": "edge", "linewidth": 0, "label": name, "transform": axes.get_xaxis_transform()}
        axes.bar(ranges[:, 0], 1.0, np.diff(ranges, axis=1)[:, 0], **bars, **_STATE_STYLE[ContactState(kind)])
