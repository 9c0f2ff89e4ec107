"""Charts of pressure, friction stress and friction bound along a contact, with its open, stick and slip parts.

Curves interpolate the values at the contact points, monotonically between them, and end at zero where a contact is
open. The polynomials of the element themselves would show jumps between edges, which depend on the mesh alone.
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

_MARKERS: Final = 40  # largest number of markers on a curve
_BETWEEN: Final = 5  # line segments of a curve between two points
_SLANTED: Final = 1e-9  # slope of an edge above which it is neither horizontal nor vertical


def contact_tractions(axes: "Axes", line: ContactLine, units: Units | None = None) -> None:
    """Draw pressure along a contact, with friction its bound and |σ_T|, and hatch its open, stick and slip parts.

    A negative pressure is tension, which bilateral and tied contacts can carry. With a fluid in the contact there are
    three pressures: the total one, that of the fluid, and the effective one, on which friction depends.
    """
    units = plain_units(units)
    (pieces, label), mark = pieces_along(line), "'" if line.has_fluid else ""
    effective, limit = line.effective_normal_stress, line.friction_bound
    is_coulomb = np.allclose(limit, line.friction * np.abs(effective), rtol=1e-9, atol=0.0)
    curves = [(f"{'effective ' if mark else ''}pressure $-\\sigma_N{mark}$", -effective, _PRESSURE)]
    if line.has_fluid:
        curves.append(("pressure $-\\sigma_N$", -line.normal_stress, _TOTAL))
        curves.append(("fluid $p_w$", line.pore_pressure, _FLUID))
    if not line.frictionless:
        curves.append((f"bound $\\mu|\\sigma_N{mark}|$" if is_coulomb else "friction bound", limit, _BOUND))
        curves.append(("friction $|\\sigma_T|$", np.abs(line.tangential_stress), _TANGENTIAL))
    _draw_states(axes, pieces, line)
    lowest, step = 0.0, -(-len(line.x) // _MARKERS)
    for name, values, look in (curve for curve in curves if np.isfinite(curve[1]).all()):  # tied: infinite bound
        x, y, marked = [np.empty(0)], [np.empty(0)], list[int]()
        for piece in pieces:
            s, curve = monotone(piece.with_ends, piece.closed(line, values))
            marked += (sum(map(len, x)) + _BETWEEN * np.arange(1, len(piece.points) + 1)).tolist()
            x += [s, np.array([np.nan])]  # NaN separates the lines of the contact
            y += [curve, np.array([np.nan])]
        drawn = np.concatenate(y)[:-1]
        axes.plot(np.concatenate(x)[:-1], drawn, markevery=marked[::step], markersize=3, label=name, **look)
        lowest = min(lowest, float(np.nanmin(drawn, initial=0.0)))
    axes.set_ylim(bottom=1.05 * lowest, auto=None)  # the upper limit stays automatic
    axes.set_xlabel(f"{label} [{units.length}]")
    axes.set_ylabel(f"traction [{units.stress}]")


@dataclass(frozen=True, eq=False)
class Piece:
    """A connected line of a contact: numbers of its points in order, places [length] of the points and its ends."""

    points: IntArray
    s: FloatArray
    ends: FloatArray

    @property
    def with_ends(self) -> FloatArray:
        """Places (k + 2,) of one end, the points in order, and the other end."""
        return np.concatenate([self.ends[:1], self.s, self.ends[1:]])

    def extended(self, values: FloatArray) -> FloatArray:
        """Values (k + 2, …) at the points of this line, from those of the contact (m, …), extrapolated to both ends."""
        inside = values[self.points]
        first, last = (
            inside[near] + (end - self.s[near]) / (self.s[near] - self.s[next_]) * (inside[near] - inside[next_])
            for end, near, next_ in ((self.ends[0], 0, 1), (self.ends[1], -1, -2))
        )
        return np.concatenate([[first], inside, [last]])

    def closed(self, line: ContactLine, values: FloatArray) -> FloatArray:
        """As `extended`, for a traction: zero at open ends without fluid, and where extrapolation changes the sign."""
        tractions, is_open = self.extended(values), line.state[self.points] == ContactState.OPEN
        for end, near in ((0, 1), (-1, -2)):
            if tractions[end] * tractions[near] < 0.0 or (is_open[end] and not line.has_fluid):
                tractions[end] = 0.0
        return tractions


def pieces_along(line: ContactLine, *, coordinates: bool = True) -> tuple[list[Piece], str]:
    """The lines of a contact from left to right, and the name of their places.

    With `coordinates`, places on a horizontal contact are x, on a vertical one y, unless the ranges of two lines
    overlap. Else places are lengths along the contact.
    """
    path, ends = line.path, line.ends
    numbers, s = path.points(line.points_per_edge), path.places(gauss_legendre(line.points_per_edge)[0])
    stops = path.starts + path.lengths
    pieces = [
        Piece(numbers[edges].ravel(), s[edges].ravel(), np.array([path.starts[edges[0]], stops[edges[-1]]]))
        for edges in path.lines
    ]
    extent = np.abs(ends[:, 1] - ends[:, 0])
    for axis, name in enumerate("xy" if coordinates else ""):
        places = ends[path.edges, :, axis]
        ranges = np.array([(places[edges].min(), places[edges].max()) for edges in path.lines]).reshape(-1, 2)
        order = np.argsort(ranges[:, 0], kind="stable")
        is_apart = ranges[order][1:, 0] - ranges[order][:-1, 1] >= -1e-6 * path.lengths.max()
        if (extent[:, 1 - axis] <= _SLANTED * extent[:, axis]).all() and is_apart.all():
            along = (line.x, line.y)[axis]
            return [Piece(pieces[k].points, along[pieces[k].points], ranges[k]) for k in order.tolist()], name
    return pieces, f"length along the contact{', line by line' if len(pieces) > 1 else ''}"


def monotone(s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places and values on a curve through the values at places s, monotone between them."""
    from scipy.interpolate import PchipInterpolator  # imported late: it is slow

    share = np.arange(_BETWEEN) / _BETWEEN
    dense = np.append((s[:-1, None] + np.diff(s)[:, None] * share).ravel(), s[-1])
    return dense, np.asarray(PchipInterpolator(s, values)(dense))


def _draw_states(axes: "Axes", pieces: Sequence[Piece], line: ContactLine) -> None:
    """Hatch the parts of the contact that are open, stick or slip.

    The part of a point is as long as its Gauss weight. The weights add up to the edge, so there are no gaps.
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
