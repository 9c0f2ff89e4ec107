"""Tractions along a contact against its friction bound, with its open, stick and slip parts."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Units
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.plots.style import BLUE, GREY, VERMILLION
from qvi_contact.solution.contact_line import ContactLine, ContactState

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STATE_STYLE: Final[dict[ContactState, dict[str, Any]]] = {
    ContactState.OPEN: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": ".."},
    ContactState.STICK: {"facecolor": "#eeeeee", "edgecolor": "none"},
    ContactState.SLIP: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": "//"},
}

_MARKERS: Final = 80  # at most so many markers a curve


def contact_tractions(axes: "Axes", line: ContactLine, units: Units | str | None = None, signed: bool = False) -> None:
    """Draw pressure, friction bound and |σ_T| along a contact, with its open, stick and slip parts shaded by hatching.

    A negative pressure is tension, which bilateral and tied contacts can carry.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    line : ContactLine
        The contact.
    units : Units or str, optional
        Labels; a text is the unit of stress.
    signed : bool
        Draw σ_T with its sign (along +x or +y on the body) between ± the bound.

    """
    units = _labels(units)
    abscissa = _along(line, units)
    pressure = -line.normal_stress
    bound = np.where(np.isfinite(line.friction_bound), line.friction_bound, np.nan)  # a tied contact has none
    tangential = line.tangential_stress if signed else np.abs(line.tangential_stress)
    coulomb = np.allclose(bound, line.friction * np.abs(line.normal_stress), rtol=1e-9, atol=0.0, equal_nan=True)
    look: dict[str, Any] = {"color": BLUE, "linestyle": "--", "marker": "^", "markersize": 3}
    _shade_states(axes, abscissa, line.weights, line.state)
    _curve(axes, abscissa, pressure, color=GREY, marker="s", markersize=3, label="pressure $-\\sigma_N$")
    _curve(axes, abscissa, bound, label="bound $\\mu|\\sigma_N|$" if coulomb else "friction bound", **look)
    if signed:
        _curve(axes, abscissa, -bound, **look)
    name = "$\\sigma_T$" if signed else "$|\\sigma_T|$"
    _curve(axes, abscissa, tangential, color=VERMILLION, linestyle=":", marker="o", markersize=3, label=name)
    lowest = np.nanmin([*pressure, *tangential, *(-bound if signed else ()), 0.0])
    axes.set_ylim(bottom=1.05 * float(lowest), auto=None)  # the top still follows what is drawn
    axes.set_xlabel(abscissa.label)
    axes.set_ylabel(f"traction [{units.stress}]")


def friction_used(axes: "Axes", line: ContactLine, units: Units | None = None) -> None:
    """Draw |σ_T| over its bound along a contact, 1 where it slips; points without a bound are left out.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    line : ContactLine
        The contact.
    units : Units, optional
        Labels.

    """
    abscissa = _along(line, _labels(units))
    bound, tangential = line.friction_bound, np.abs(line.tangential_stress)
    loaded = np.isfinite(bound) & (bound > 1e-9 * float(np.abs(line.normal_stress).max(initial=0.0)))
    _shade_states(axes, abscissa, line.weights, line.state)
    axes.axhline(1.0, color=BLUE, linestyle="--", linewidth=1.0)
    chosen = abscissa.order[loaded[abscissa.order]]
    share = tangential[chosen] / bound[chosen]
    axes.plot(abscissa.s[chosen], share, color=VERMILLION, linestyle=":", marker="o", markersize=3)
    axes.set_ylim(0.0, 1.1)
    axes.set_xlabel(abscissa.label)
    axes.set_ylabel("$|\\sigma_T|$ / bound [-]")


@dataclass(frozen=True, eq=False)
class _Abscissa:
    """Where the points of a contact lie on the horizontal axis of a graph.

    Attributes
    ----------
    s : (m,) array
        Place of each point [length].
    starts : (edges,) array
        Place where each edge begins [length].
    order : (m,) int array
        The points by growing place.
    label : str
        Label of the axis.

    """

    s: FloatArray
    starts: FloatArray
    order: IntArray
    label: str


def _along(line: ContactLine, units: Units) -> _Abscissa:
    """The coordinate along the contact; the length along it where lines above or beside each other would overlap."""
    horizontal = np.ptp(line.x) >= np.ptp(line.y)
    s = line.x if horizontal else line.y
    lengths = line.weights.reshape(-1, GAUSS_COUNT).sum(axis=1)
    first = gauss_legendre(GAUSS_COUNT)[0][0]
    starts, label = s[::GAUSS_COUNT] - first * lengths, f"{'x' if horizontal else 'y'} [{units.length}]"
    edges = np.argsort(starts)
    if (starts[edges][1:] < (starts + lengths)[edges][:-1] - 1e-6 * lengths.max(initial=0.0)).any():
        before = np.cumsum(lengths) - lengths
        s = (before[:, None] + lengths[:, None] * gauss_legendre(GAUSS_COUNT)[0]).ravel()
        starts, label = before, f"length along the contact, line by line [{units.length}]"
    return _Abscissa(s, starts, np.argsort(s, kind="stable"), label)


def _curve(axes: "Axes", abscissa: _Abscissa, values: FloatArray, **look: Any) -> None:
    """One curve through the points, broken where the contact is."""
    s, drawn = abscissa.s[abscissa.order], values[abscissa.order]
    edges = np.sort(abscissa.starts)
    reach = s[GAUSS_COUNT - 1 :: GAUSS_COUNT] + s[::GAUSS_COUNT] - edges  # ends of the edges, as points are symmetric
    broken = np.flatnonzero(edges[1:] - reach[:-1] > 1e-6 * np.ptp(s)) + 1
    s, drawn = (np.insert(values, GAUSS_COUNT * broken, np.nan) for values in (s, drawn))
    axes.plot(s, drawn, markevery=-(-len(s) // _MARKERS), **look)


def _shade_states(axes: "Axes", abscissa: _Abscissa, weights: FloatArray, state: IntArray) -> None:
    """Shade each point's share of its edge; Gauss weights add up to the edge, so the shares meet."""
    ends = (abscissa.starts[:, None] + np.cumsum(weights.reshape(-1, GAUSS_COUNT), axis=1)).ravel()
    across = axes.get_xaxis_transform()  # heights as shares of the axes
    for kind in sorted(set(state.tolist())):
        chosen = state == kind
        bars: dict[str, Any] = {
            "align": "edge",
            "linewidth": 0,
            "label": ContactState(kind).name.lower(),
            "transform": across,
        }
        axes.bar((ends - weights)[chosen], 1.0, weights[chosen], **bars, **_STATE_STYLE[ContactState(kind)])


def _labels(units: Units | str | None) -> Units:
    return Units(stress=units) if isinstance(units, str) else units or Units()
