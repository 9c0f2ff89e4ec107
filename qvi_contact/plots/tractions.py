"""Tractions along a contact against its friction bound, with its open, stick and slip parts.

On an edge tractions are polynomials, drawn through all their points; they may jump where edges meet.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.plots.style import BLUE, GREY, STATE_LOOK, VERMILLION, plain_units
from qvi_contact.solution.contact_line import ContactLine, ContactState

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STATE_STYLE: Final[dict[ContactState, dict[str, Any]]] = {
    ContactState.OPEN: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": ".."},
    ContactState.STICK: {"facecolor": "#eeeeee", "edgecolor": "none"},
    ContactState.SLIP: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": "//"},
    ContactState.CLOSED: {"facecolor": "#dddddd", "edgecolor": "none"},
}

_PRESSURE: Final[dict[str, Any]] = {"color": GREY, "marker": "s"}
_BOUND: Final[dict[str, Any]] = {"color": BLUE, "linestyle": "--", "marker": "^"}
_TOTAL: Final[dict[str, Any]] = {"color": GREY, "linestyle": "-.", "linewidth": 0.8}
_FLUID: Final[dict[str, Any]] = {"color": BLUE, "linewidth": 0.8}
_TANGENTIAL: Final[dict[str, Any]] = {"color": VERMILLION, "linestyle": ":", "marker": "o"}

_MARKERS: Final = 80  # at most so many markers a curve
_SAMPLES: Final = 240  # about so many points a curve, beside those of the contact
_SAME: Final = 1e-9  # distance of places on an edge, over its length, that are one
_SLANTED: Final = 1e-9  # rise of an edge over its length from which on it is not horizontal


def contact_tractions(axes: "Axes", line: ContactLine, units: Units | None = None) -> None:
    """Draw pressure, friction bound and |σ_T| along a contact, with its open, stick and slip parts shaded by hatching.

    A negative pressure is tension, which bilateral and tied contacts can carry. Where a fluid presses in the contact it
    is drawn three times: in all, of the fluid, and the effective pressure, which friction depends on. Curves are the
    polynomials of the element on each edge: where the state changes within an edge they may show a tooth.

    """
    units = plain_units(units)
    abscissa, prime = _along(line, units), "'" if line.has_fluid else ""
    effective = line.effective_normal_stress
    pressure, limit = abscissa.curve(-effective), line.friction_bound
    if np.allclose(limit, line.friction * np.abs(effective), rtol=1e-9, atol=0.0, equal_nan=True):  # Coulomb's law
        bound = abscissa.curve(line.friction) * np.abs(pressure)
        curves = [_Curve(f"bound $\\mu|\\sigma_N{prime}|$", bound, _BOUND)]
    else:  # that of other laws from point to point; a tied contact has none
        curves = [_Curve("friction bound", abscissa.broken_line(np.where(np.isfinite(limit), limit, np.nan)), _BOUND)]
    curves.insert(0, _Curve(f"{'effective ' if prime else ''}pressure $-\\sigma_N{prime}$", pressure, _PRESSURE))
    if line.has_fluid:
        curves.append(_Curve("pressure $-\\sigma_N$", abscissa.curve(-line.normal_stress), _TOTAL))
        curves.append(_Curve("fluid $p_w$", abscissa.curve(line.pore_pressure), _FLUID))
    curves.append(_Curve("$|\\sigma_T|$", np.abs(abscissa.curve(line.tangential_stress)), _TANGENTIAL))
    _draw_states(axes, abscissa, line, np.abs(line.tangential_stress))
    breaks = abscissa.s.shape[1] * (np.flatnonzero(~abscissa.joined) + 1)
    marked = abscissa.marked + np.searchsorted(breaks, abscissa.marked, side="right")
    every = marked[:: -(-len(marked) // _MARKERS)].tolist()
    for curve in curves:  # with markers at the points, broken where the contact is
        x, y = (np.insert(part.ravel(), breaks, np.nan) for part in (abscissa.s, curve.values))
        axes.plot(x, y, markevery=every, markersize=3, label=curve.label, **curve.look)
    lowest = np.nanmin([0.0, *(np.nanmin(curve.values) for curve in curves if np.isfinite(curve.values).any())])
    axes.set_ylim(bottom=1.05 * float(lowest), auto=None)  # the top still follows what is drawn
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

    @cached_property
    def _t(self) -> FloatArray:
        """Where on an edge curves are drawn."""
        more = np.linspace(0.0, 1.0, 2 + _SAMPLES // len(self.starts))
        between = more[np.abs(more[:, None] - self._gauss).min(axis=1) > _SAME]
        return np.sort(np.concatenate([self._gauss, between]))

    @property
    def s(self) -> FloatArray:
        """Places (n, k) where curves are drawn; the two ends and all points of each edge are among them."""
        return np.asarray(self.starts[:, None] + self.lengths[:, None] * self._t)

    @property
    def marked(self) -> IntArray:
        """Which of these places, counted edge by edge, are points of the contact."""
        own = np.flatnonzero(np.isin(self._t, self._gauss))
        return np.asarray((len(self._t) * np.arange(len(self.starts))[:, None] + own).ravel())

    def at(self, points: IntArray) -> FloatArray:
        """Places of points given by number."""
        places = np.empty(self.points.size)
        places[self.points] = self.starts[:, None] + self.lengths[:, None] * self._gauss
        return np.asarray(places[points])

    def curve(self, values: FloatArray) -> FloatArray:
        """The polynomials (n, k) through values at the points, edge by edge."""
        from scipy.interpolate import BarycentricInterpolator  # slow to import, and few pictures need it

        return np.asarray(BarycentricInterpolator(self._gauss, values[self.points].T)(self._t).T)

    def broken_line(self, values: FloatArray) -> FloatArray:
        """Straight lines (n, k) between values at the points, edge by edge."""
        return np.array([np.interp(self._t, self._gauss, edge) for edge in values[self.points]])

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


class _Curve(NamedTuple):
    """Values (n, k) at the places of an abscissa, with their label and look."""

    label: str
    values: FloatArray
    look: dict[str, Any]


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
