"""Tractions along a contact against its friction bound, with its open, stick and slip parts.

Curves run through the values at the points, monotone between them, and are closed where a contact opens: what the
polynomials of the element do beyond their points, teeth and jumps where edges meet, is nothing but the mesh.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.plots.style import BLUE, STATE_LOOK, VERMILLION, plain_units
from qvi_contact.solution.contact_line import ContactLine, ContactState

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
    abscissa, prime = _along(line, units), "'" if line.has_fluid else ""
    effective, limit = line.effective_normal_stress, line.friction_bound
    coulomb = np.allclose(limit, line.friction * np.abs(effective), rtol=1e-9, atol=0.0, equal_nan=True)
    bound = np.where(np.isfinite(limit), limit, np.nan)  # a tied contact has none
    curves = [
        (f"{'effective ' if prime else ''}pressure $-\\sigma_N{prime}$", -effective, _PRESSURE),
        (f"bound $\\mu|\\sigma_N{prime}|$" if coulomb else "friction bound", bound, _BOUND),
    ]
    if line.has_fluid:
        curves.append(("pressure $-\\sigma_N$", -line.normal_stress, _TOTAL))
        curves.append(("fluid $p_w$", line.pore_pressure, _FLUID))
    curves.append(("friction $|\\sigma_T|$", np.abs(line.tangential_stress), _TANGENTIAL))
    _draw_states(axes, abscissa, line, np.abs(line.tangential_stress))
    lowest = 0.0
    for label, values, look in (curve for curve in curves if not np.isnan(curve[1]).all()):
        x, y, marked = abscissa.curve(values, line.state == ContactState.OPEN, line.has_fluid)
        axes.plot(x, y, markevery=marked[:: -(-len(marked) // _MARKERS)], markersize=3, label=label, **look)
        lowest = min(lowest, float(np.nanmin(y, initial=0.0)))
    axes.set_ylim(bottom=1.05 * lowest, auto=None)  # the top still follows what is drawn
    axes.set_xlabel(abscissa.label)
    axes.set_ylabel(f"traction [{units.stress}]")


def friction_used(axes: "Axes", line: ContactLine, units: Units | None = None) -> None:
    """Draw |σ_T| over its bound along a contact, 1 where it slips; points without a bound are left out."""
    abscissa = _along(line, plain_units(units))
    bound, tangential = line.friction_bound, np.abs(line.tangential_stress)
    loaded = np.isfinite(bound) & (bound > 1e-9 * float(np.abs(line.normal_stress).max(initial=0.0)))
    share = np.divide(tangential, bound, out=np.full_like(bound, np.nan), where=loaded)
    _draw_states(axes, abscissa, line, share)
    axes.axhline(1.0, color=BLUE, linestyle="--", linewidth=1.0)
    chosen = abscissa.points.ravel()[loaded[abscissa.points].ravel()]
    axes.plot(abscissa.at(chosen), share[chosen], color=VERMILLION, linestyle=":", marker="o", markersize=3)
    axes.set_ylim(0.0, 1.1)
    axes.set_xlabel(abscissa.label)
    axes.set_ylabel("$|\\sigma_T|$ / bound [-]")


def closed_ends(s: FloatArray, values: FloatArray, ends: FloatArray, opened: BoolArray | None = None) -> FloatArray:
    """Values at places s (k,) with those at both ends of the line before and after, (k + 2,).

    Those at the ends go on as the values do, to zero at most, and are zero where the nearest point is `opened`.
    """
    found = []
    for end, near, next_ in ((ends[0], 0, 1), (ends[1], -1, -2)):
        value = float(values[near])
        if len(s) > 1:
            value += float((end - s[near]) / (s[near] - s[next_]) * (values[near] - values[next_]))
        if opened is not None:
            value = 0.0 if opened[near] or value * values[near] < 0.0 else value
        found.append(value)
    return np.array([found[0], *values, found[1]])


def monotone(s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places and values of a curve through values at places s that has no extremes between them; NaN stays NaN."""
    from scipy.interpolate import PchipInterpolator  # slow to import, and few pictures need it

    share = np.arange(_BETWEEN) / _BETWEEN
    dense = np.append((s[:-1, None] + np.diff(s)[:, None] * share).ravel(), s[-1])
    if not np.isfinite(values).all() or (np.diff(s) <= 0.0).any():
        return dense, np.interp(dense, s, values)
    return dense, np.asarray(PchipInterpolator(s, values)(dense))


def places_along(line: ContactLine) -> tuple[IntArray, FloatArray]:
    """Numbers of the points from left to right, and their places on the horizontal axis of these pictures [length]."""
    abscissa = _along(line, Units())
    points = abscissa.points.ravel()
    return points, abscissa.at(points)


@dataclass(frozen=True, eq=False)
class _Abscissa:
    """Where the edges and points of a contact lie on the horizontal axis of a graph, from left to right.

    Attributes
    ----------
    points : (n, q) int array
        Numbers of the points on each edge.
    starts, lengths : (n,) arrays
        Where each edge begins, and how long it is [length].
    joined : (n − 1,) bool array
        Whether the next edge goes on where this one ends.
    label : str
        Label of the axis.

    """

    points: IntArray
    starts: FloatArray
    lengths: FloatArray
    joined: BoolArray
    label: str

    @property
    def _gauss(self) -> FloatArray:
        return gauss_legendre(self.points.shape[1])[0]

    def at(self, points: IntArray) -> FloatArray:
        """Places of points given by number."""
        places = np.empty(self.points.size)
        places[self.points] = self.starts[:, None] + self.lengths[:, None] * self._gauss
        return np.asarray(places[points])

    def curve(self, values: FloatArray, opened: BoolArray, held_open: bool) -> tuple[FloatArray, FloatArray, list[int]]:
        """A curve through values at the points: x, y, and which of these are points; NaN between lines.

        At the ends of lines it is zero if the contact is `opened` there, unless something else holds it open.
        """
        x, y, marked = [np.empty(0)], [np.empty(0)], list[int]()
        for piece in self.pieces():
            points = self.points[piece].ravel()
            place, ends = self.at(points), np.array([self.starts[piece][0], (self.starts + self.lengths)[piece][-1]])
            given = closed_ends(place, values[points], ends, None if held_open else opened[points])
            count = sum(map(len, x))
            s, curve = monotone(np.concatenate([ends[:1], place, ends[1:]]), given)
            marked += (count + _BETWEEN * np.arange(1, len(points) + 1)).tolist()
            x += [s, np.array([np.nan])]
            y += [curve, np.array([np.nan])]
        return np.concatenate(x)[:-1], np.concatenate(y)[:-1], marked

    def pieces(self) -> list[slice]:
        """Edges that hang together."""
        ends = [0, *(np.flatnonzero(~self.joined) + 1).tolist(), len(self.starts)]
        return [slice(a, b) for a, b in pairwise(ends)]


def _along(line: ContactLine, units: Units) -> _Abscissa:
    """The coordinate along a horizontal or vertical contact, else the length along it.

    The latter too where coordinates of lines above or beside each other would overlap.
    """
    path, ends = line.path, line.ends
    rise = np.abs(ends[:, 1] - ends[:, 0])
    for axis, name in enumerate("xy"):
        starts, lengths = ends[:, 0, axis], ends[:, 1, axis] - ends[:, 0, axis]
        order = np.argsort(starts, kind="stable")
        apart = (starts[order][1:] - (starts + lengths)[order][:-1]) / path.lengths.max()
        if (rise[:, 1 - axis] <= _SLANTED * rise[:, axis]).all() and (apart >= -1e-6).all():
            points = np.arange(len(line.x)).reshape(-1, line.points_per_edge)[order]
            return _Abscissa(points, starts[order], lengths[order], apart <= 1e-6, f"{name} [{units.length}]")
    several = ", line by line" if path.line[-1] else ""
    label = f"length along the contact{several} [{units.length}]"
    points = path.points(line.points_per_edge)
    return _Abscissa(points, path.starts, path.lengths, np.diff(path.line) == 0, label)


def _draw_states(axes: "Axes", abscissa: _Abscissa, line: ContactLine, heights: FloatArray) -> None:
    """Shade the parts of the contact that are open, stick or slip; mark single points that differ from both sides.

    Each point has its share of its edge: Gauss weights add up to the edge, so the shares meet. A single point, at the
    height given for it, takes the shade of the points before it.
    """
    ends = abscissa.starts[:, None] + np.cumsum(line.weights[abscissa.points], axis=1)
    bands: dict[int, list[tuple[float, float]]] = {}
    single: dict[int, list[int]] = {}
    for piece in abscissa.pieces():
        points, stops = abscissa.points[piece].ravel(), ends[piece].ravel()
        differs = np.diff(line.state[points]) != 0
        single_ones = np.concatenate([[False], differs[:-1] & differs[1:], [False]])[: len(points)]
        before = np.maximum.accumulate(np.where(single_ones, 0, np.arange(len(points))))
        shown = line.state[points][before]
        for point in points[shown != line.state[points]].tolist():
            single.setdefault(int(line.state[point]), []).append(point)
        changes = np.flatnonzero(np.diff(shown))
        borders = [float(abscissa.starts[piece][0]), *stops[changes].tolist(), float(stops[-1])]
        for kind, borders_of in zip(shown[[*changes.tolist(), -1]].tolist(), pairwise(borders), strict=True):
            bands.setdefault(kind, []).append(borders_of)
    for kind in sorted(bands):
        ranges, name = np.array(bands[kind]), ContactState(kind).name.lower()
        bars: dict[str, Any] = {"align": "edge", "linewidth": 0, "label": name, "transform": axes.get_xaxis_transform()}
        axes.bar(ranges[:, 0], 1.0, np.diff(ranges, axis=1)[:, 0], **bars, **_STATE_STYLE[ContactState(kind)])
    for kind in sorted(single):
        colour, marker, filling = STATE_LOOK[ContactState(kind)]
        chosen = np.array(single[kind])
        look: dict[str, Any] = {
            "marker": marker,
            "color": colour,
            "markerfacecolor": filling,
            "markersize": 7,
            "linestyle": "none",
        }
        label = f"single point: {ContactState(kind).name.lower()}"
        axes.plot(abscissa.at(chosen), heights[chosen], label=label, zorder=4, **look)
