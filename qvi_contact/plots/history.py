"""Hysteresis loops of a load history, and forces step by step."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, real_array
from qvi_contact.basics.units import Units
from qvi_contact.errors import InputError
from qvi_contact.plots.body import draw_body
from qvi_contact.plots.style import BLUE, GREY, new_figure, plain_text, plain_units, settings
from qvi_contact.problem.conditions import CARTESIAN, Displacement, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.history import History

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROOM: Final = 0.12  # for numbers around the body, as a share of its drawing
_LOOPS: Final = 4  # at most so many loops, and forces of contacts


def history_figure(
    history: History,
    units: Units | None = None,
    times: Sequence[float] | None = None,
    title: str = "",
    step: int | None = None,
) -> "Figure":
    """The deformed body in one step, hysteresis loops of up to four contacts, and forces of contacts step by step.

    A loop needs something that moves, such as an obstacle or a prescribed displacement. Under loads alone there are
    forces only.

    Parameters
    ----------
    history : History
        The history; its steps are read one by one.
    units : Units, optional
        Labels.
    times : sequence of float, optional
        The value of t in each step: forces are drawn over t instead of the number of the step, a hollow square at the
        first step.
    title : str
        The problem's title; what the history says of itself stands below it.
    step : int, optional
        The step of the body, from 1; by default the last one that has a state.

    Raises
    ------
    InputError
        If there is nothing to draw, no such step, or not a time for each step.

    """
    units = plain_units(units)
    abscissa = None if times is None else real_array("times", times)
    forces: dict[str, list[tuple[float, float]]] = {}
    drawn = None
    for number, each in enumerate(history.steps, 1):
        if each.has_state:
            drawn = (number, each) if step is None or number == step else drawn
            for name, line in each.contacts.items():
                forces.setdefault(name, []).append((line.normal_force, line.tangential_force))
    if drawn is None and step is not None:
        raise InputError("step", step, "give the number of a step that has a state, the first is 1")
    loops = {} if drawn is None else _loops(history, drawn[1].problem)
    if drawn is None or not (forces or loops):
        raise InputError("history", history, "there is no contact whose loop or forces could be drawn")
    count = max(map(len, forces.values()), default=0)
    if abscissa is not None and (abscissa.ndim != 1 or len(abscissa) < count):
        raise InputError("times", times, f"give the times of all {count} steps")
    rows = [names for names in (list(loops)[:_LOOPS], list(forces)[:_LOOPS]) if names]
    with settings():
        figure = new_figure(3.8 + 3.0 * max(map(len, rows)), 0.4 + 3.0 * len(rows))
        left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=[3.8, 3.0 * max(map(len, rows))])[0]
        body, (number, shown) = left.subplots(), drawn
        picture = draw_body(body, shown, units=units)
        low, high = picture.box + np.array([[-1.0], [1.0]]) * _ROOM * float(np.ptp(picture.box, axis=0).max())
        body.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), anchor="N")
        at = f"step {number}" if abscissa is None else f"t = {abscissa[number - 1]:g}"
        body.set_title(f"{at}; displacements × {picture.factor:g}", fontsize="medium")
        parts = right.subfigures(len(rows), 1, squeeze=False)[:, 0]
        for part, names in zip(parts, rows, strict=True):
            for axes, name in zip(part.subplots(1, len(names), squeeze=False)[0], names, strict=True):
                if part is parts[0] and loops:
                    _draw_loop(axes, *loops[name])
                    axes.set_title(plain_text(name), fontsize="medium")
                    axes.set_xlabel(f"displacement [{units.displacement}]")
                else:
                    _draw_forces(axes, np.array(forces[name]), abscissa)
                    axes.set_title(plain_text(f"{name}: forces"), fontsize="medium")
                axes.set_ylabel(f"force [{units.engineering_force}]")
        left_out = [f"loops not shown: {', '.join(list(loops)[_LOOPS:])}"] if len(loops) > _LOOPS else []
        said = "\n".join(filter(None, [title, history.message, *left_out]))
        figure.suptitle(plain_text(said), x=0.02, ha="left", fontsize="medium")
    return figure


def _loops(history: History, problem: ContactProblem) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Loops of what is moved sideways: contacts, and edge sets whose tangential displacement is prescribed.

    Edge sets moved across if these move the body; none if nothing moves, as under loads that change.
    """
    moved = [condition for condition in problem.conditions if isinstance(condition, Displacement)]
    driven = []
    for condition in moved:
        tangent = problem.mesh.edges(condition.edges).tangent[0]
        if {CARTESIAN[int(np.argmax(np.abs(tangent)))], "tangential"} & set(components(condition)):
            driven.append(condition.edges)
    loops: dict[str, tuple[FloatArray, FloatArray]] = {}
    for name in (*(contact.name for contact in problem.contacts), *driven):
        with suppress(InputError):  # an obstacle at rest while displacements move the body
            loops.setdefault(name, history.loop(name))
    for condition in moved if not loops else ():
        loops.setdefault(condition.edges, history.loop(condition.edges))
    return {name: loop for name, loop in loops.items() if np.ptp(loop[0]) > 0.0}


def _draw_loop(axes: "Axes", moved: FloatArray, carried: FloatArray) -> None:
    """Force over the displacement that drives it: a dot a step, the first in a square."""
    axes.axhline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.axvline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.plot(moved, carried, color=BLUE, marker="o", markersize=3, linewidth=1.0)
    axes.ticklabel_format(scilimits=(-3, 4), useMathText=True)
    axes.locator_params(axis="x", nbins=6)
    axes.plot(moved[:1], carried[:1], color=GREY, marker="s", markersize=7, fillstyle="none", linestyle="none")


def _draw_forces(axes: "Axes", forces: FloatArray, times: FloatArray | None) -> None:
    """Normal and tangential force (steps, 2) of one contact step by step, over t where times are given."""
    place = np.arange(1, len(forces) + 1) if times is None else times[: len(forces)]
    looks: dict[str, dict[str, Any]] = {
        "N": {"color": GREY, "marker": "s"},
        "T": {"color": BLUE, "marker": "o", "linestyle": "--"},
    }
    for (label, look), values in zip(looks.items(), forces.T, strict=True):
        axes.plot(place, values, markersize=3, linewidth=1.0, label=label, **look)
        if times is not None:
            axes.plot(place[:1], values[:1], color=GREY, marker="s", markersize=7, fillstyle="none", linestyle="none")
    axes.set_xlabel("step [-]" if times is None else "t")
    axes.locator_params(axis="x", integer=times is None)
    axes.legend(frameon=False)
