"""Pictures of results, drawn on axes the caller gives; needs the extra ``plot`` (matplotlib).

Colours are from the Okabe-Ito palette, and nothing depends on colour alone: line style, hatching and markers say the
same.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from qvi_contact.checks import FloatArray, IntArray
from qvi_contact.contact import ContactLine, ContactState
from qvi_contact.element import GAUSS_COUNT
from qvi_contact.errors import InputError
from qvi_contact.hermite import gauss_legendre
from qvi_contact.result import ContactResult
from qvi_contact.stress import principal_stresses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection

BLUE, ORANGE, GREEN, GREY, VERMILLION = "#0072B2", "#E69F00", "#009E73", "#666666", "#D55E00"

_STATE_STYLE: dict[ContactState, dict[str, Any]] = {
    ContactState.OPEN: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": ".."},
    ContactState.STICK: {"facecolor": "#eeeeee", "edgecolor": "none"},
    ContactState.SLIP: {"facecolor": "none", "edgecolor": "#bbbbbb", "hatch": "//"},
}


def has_matplotlib() -> bool:
    """Whether pictures can be drawn."""
    return find_spec("matplotlib") is not None


def require_matplotlib() -> None:
    """Raise `InputError` with the command to type if matplotlib is missing."""
    if not has_matplotlib():
        remedy = "pictures need matplotlib: python -m pip install 'qvi-contact[plot]'"
        raise InputError("plot", "matplotlib", remedy)


def principal_stress_map(axes: "Axes", result: ContactResult, largest: float | None = None) -> float:
    """Draw the principal stresses as crosses at the 4×4 Gauss points of each cell.

    A compressive stress is a solid line, a tensile one a dotted line with a round dot at each end; lengths are
    proportional to the stress.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw; axes are in units of length.
    result : ContactResult
        The state.
    largest : float, optional
        Stress [stress] drawn at full length; the largest one by default.

    Returns
    -------
    float
        The largest |principal stress| at these points [stress].

    """
    x, y, stress = result.gauss_stress()
    first, second, angle = principal_stresses(stress)
    maximum = float(max(np.abs(first).max(), np.abs(second).max()))
    mesh = result.problem.mesh
    spacing = np.sqrt(np.outer(np.diff(mesh.y), np.diff(mesh.x))[mesh.active]) / 4.0
    scale = 0.5 * spacing[:, None] / (largest or maximum or 1.0)
    _draw_grid(axes, result)
    for values, turn in ((first, 0.0), (second, np.pi / 2)):
        half = np.stack([np.cos(angle + turn), np.sin(angle + turn)], axis=-1) * (scale * np.abs(values))[..., None]
        ends = np.stack([x, y], axis=-1)[..., None, :] + half[..., None, :] * np.array([[-1.0], [1.0]])
        visible = np.abs(values) > 1e-3 * maximum
        axes.add_collection(_lines(ends[visible & (values < 0)], BLUE, "solid", 1.1))
        tension = ends[visible & (values > 0)]
        axes.add_collection(_lines(tension, VERMILLION, (0, (1, 1)), 1.1))
        axes.plot(tension[..., 0].ravel(), tension[..., 1].ravel(), "o", color=VERMILLION, markersize=2)
    axes.set_aspect("equal")
    margin = 0.03 * mesh.length
    axes.set_xlim(mesh.x[0] - margin, mesh.x[-1] + margin)
    axes.set_ylim(mesh.y[0] - margin, mesh.y[-1] + margin)
    return maximum


def contact_tractions(axes: "Axes", line: ContactLine, stress_unit: str = "stress") -> None:
    """Draw pressure, friction bound and |σ_T| along a contact, with its open, stick and slip parts shaded by hatching.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    line : ContactLine
        The contact.
    stress_unit : str
        Unit for the label.

    """
    along, order, label = _along(line)
    pressure, bound = -line.normal_stress[order], line.friction_bound[order]
    tangential = np.abs(line.tangential_stress[order])
    _shade_states(axes, along, line.weights[order], line.state[order])
    axes.plot(along, pressure, color=GREY, marker="s", markersize=3, label="pressure $-\\sigma_N$")
    axes.plot(along, bound, color=BLUE, linestyle="--", marker="^", markersize=3, label="bound $\\mu|\\sigma_N|$")
    axes.plot(along, tangential, color=VERMILLION, linestyle=":", marker="o", markersize=3, label="$|\\sigma_T|$")
    axes.set_ylim(bottom=min(0.0, float(pressure.min())), auto=None)  # the top still follows what is drawn
    axes.set_xlabel(label)
    axes.set_ylabel(f"traction [{stress_unit}]")


def friction_used(axes: "Axes", line: ContactLine) -> None:
    """Draw |σ_T| over its bound along a contact, 1 where it slips; points without a bound are left out.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    line : ContactLine
        The contact.

    """
    along, order, label = _along(line)
    bound, tangential = line.friction_bound[order], np.abs(line.tangential_stress[order])
    loaded = bound > 1e-9 * float(np.abs(line.normal_stress).max(initial=0.0))
    _shade_states(axes, along, line.weights[order], line.state[order])
    axes.axhline(1.0, color=BLUE, linestyle="--", linewidth=1.0)
    axes.plot(
        along[loaded], tangential[loaded] / bound[loaded], color=VERMILLION, linestyle=":", marker="o", markersize=3
    )
    axes.set_ylim(0.0, 1.1)
    axes.set_xlabel(label)
    axes.set_ylabel("$|\\sigma_T|$ / bound [-]")


def _along(line: ContactLine) -> tuple[FloatArray, IntArray, str]:
    """Sorted coordinate along a contact, the order, and its label."""
    horizontal = np.ptp(line.x) >= np.ptp(line.y)
    along = line.x if horizontal else line.y
    order = np.argsort(along, kind="stable")
    return along[order], order, f"{'x' if horizontal else 'y'} [length]"


def _shade_states(axes: "Axes", along: FloatArray, weights: FloatArray, state: IntArray) -> None:
    """Shade each point's share of its edge; Gauss weights add up to the edge, so the shares meet."""
    lengths = weights.reshape(-1, GAUSS_COUNT)
    starts = along[::GAUSS_COUNT] - gauss_legendre(GAUSS_COUNT)[0][0] * lengths.sum(axis=1)
    ends = (starts[:, None] + np.cumsum(lengths, axis=1)).ravel()
    for kind in sorted(set(state.tolist())):
        chosen = state == kind
        bars = {"align": "edge", "linewidth": 0, **_STATE_STYLE[ContactState(kind)]}
        across = axes.get_xaxis_transform()  # heights as shares of the axes
        axes.bar(
            (ends - weights)[chosen],
            1.0,
            weights[chosen],
            transform=across,
            label=ContactState(kind).name.lower(),
            **bars,
        )


def _draw_grid(axes: "Axes", result: ContactResult) -> None:
    mesh = result.problem.mesh
    row, column = np.nonzero(mesh.active)
    left, right, low, high = mesh.x[column], mesh.x[column + 1], mesh.y[row], mesh.y[row + 1]
    corners = [(left, low), (right, low), (right, high), (left, high), (left, low)]
    outline = np.stack([np.column_stack(corner) for corner in corners], axis=1)
    axes.add_collection(_lines(outline, "#cccccc", "solid", 0.6))


def _lines(points: FloatArray, colour: str, style: object, width: float) -> "LineCollection":
    from matplotlib.collections import LineCollection

    return LineCollection(list(points), colors=colour, linestyles=[style], linewidths=width)
