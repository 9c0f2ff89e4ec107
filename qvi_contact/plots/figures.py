"""Whole figures: a result, a problem, a history at a glance."""

import textwrap
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, real_array
from qvi_contact.basics.shown import shown
from qvi_contact.basics.units import Units
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import LimitLoad
from qvi_contact.plots.fields import principal_stress_map, stress_field
from qvi_contact.plots.mechanism import draw_collapse, draw_mechanism
from qvi_contact.plots.motion import deformed_contact
from qvi_contact.plots.problem import draw_problem
from qvi_contact.plots.style import BLUE, GREY, bounding_box, new_figure, plain_text, plain_units, settings
from qvi_contact.plots.tractions import contact_tractions
from qvi_contact.problem.conditions import CARTESIAN, Displacement, components
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.sampling import cell_factors, held_along_z, von_mises
from qvi_contact.solution.stress import principal_stresses

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

_PANELS: Final = 4  # at most so many contacts get a panel
_CROSSES: Final = 36  # crosses along the longer side, so that they can be told apart
_WIDTH: Final = 13.0  # of an overview [inch]
_APART: Final = 0.08  # above and below what stands in an overview [inch]: its title keeps off those of the panels
_ALL_BUT_FEW: Final = 0.99  # share of the points whose stresses set the scale
_NOTHING: Final = 1e-6  # tractions below this share of the stress in the body count as none


class LoadHistory(Protocol):
    """What is drawn of a load history."""

    @property
    def steps(self) -> Sequence[ContactResult]:
        """The state after each step."""

    def loop(self, contact: str, /) -> tuple[FloatArray, FloatArray]:
        """Displacement [length] and force [stress × length] of a contact or edge set, step by step."""


def result_figure(result: ContactResult, units: Units | None = None) -> "Figure":
    """Overview of a result: crosses, von Mises stress, deformed contact lines, tractions of up to four contacts.

    Without a stress state, as of an infeasible problem, the problem is drawn instead, under the same title, and how the
    mechanism moves its blocks, if there is one.

    """
    units = plain_units(units)
    title = result.message
    if not result.has_state:
        figure = problem_figure(result.problem, units)
        advice = "" if result.status.advice in title else f" {result.status.advice}"
        if result.mechanism is not None:
            draw_mechanism(figure.axes[0], result.problem.mesh, result.mechanism)
            advice += " Dashed blue lines: motion of the blocks, magnified."
        with settings():
            figure.suptitle(_wrapped(title + advice, figure))
        return figure
    names = list(result.contacts)
    if len(names) > _PANELS:
        title += f" Without a panel of tractions: {', '.join(names[_PANELS:])}."
    names = names[:_PANELS]
    low, high = bounding_box(result.problem.mesh)
    width = _WIDTH / (3 if names else 2)
    top = float(np.clip(0.72 * width * (high[1] - low[1]) / (high[0] - low[0]), 2.4, 7.0)) + 2.1  # titles and legends
    with settings():
        figure = new_figure(_WIDTH, top + (3.4 if names else 0.0))
        figure.set_layout_engine("constrained", h_pad=_APART)
        parts = figure.subfigures(2 if names else 1, 1, squeeze=False, height_ratios=[top, 3.4] if names else [1.0])
        _states(parts[0, 0], result, units, with_contacts=bool(names))
        if names:
            _tractions(parts[1, 0], result, names, units)
        parts[0, 0].suptitle(_wrapped(title, figure))
    return figure


def problem_figure(problem: ContactProblem, units: Units | None = None) -> "Figure":
    """One picture of a problem: mesh, materials, conditions, loads, contacts, joints."""
    with settings():
        low, high = bounding_box(problem.mesh)
        sides = high - low
        scale = 6.0 / max(1.25 * sides[0], 1.5 * sides[1])  # what is around the body takes room too
        figure = new_figure(scale * sides[0] + 6.5, max(3.2, scale * (sides[1] + 0.4 * max(sides)) + 0.7))
        draw_problem(figure.subplots(), problem, units)
    return figure


def limit_figure(problem: ContactProblem, limit: LimitLoad, units: Units | None = None, title: str = "") -> "Figure":
    """One picture of a limit load: the problem, and how it gives way.

    A mechanism moves blocks; a body that yields flows, see `plots.mechanism.draw_collapse`.

    Parameters
    ----------
    problem : ContactProblem
        The problem on the mesh of the analysis, such as `LimitRefinement.problem`.
    limit : LimitLoad
        What `limit_load_factor` has found.
    units : Units, optional
        Labels.
    title : str
        What stands above, before the words about the mechanism.

    Raises
    ------
    InputError
        If the limit load has no mechanism, since there is no upper limit, or no multiple at all.

    """
    if limit.mechanism is None and limit.collapse is None:
        raise InputError("limit", repr(limit), "there is no mechanism to draw: no load is the largest one")
    figure = problem_figure(problem, units)
    if limit.mechanism is not None:
        draw_mechanism(figure.axes[0], problem.mesh, limit.mechanism)
        words = "Dashed blue lines: motion of the blocks beyond that, magnified."
    elif limit.collapse is not None:
        draw_collapse(figure.axes[0], problem.mesh, limit.collapse)
        words = (
            "Orange: where the body yields. Arrows: how it moves beyond that. Thick blue lines: contacts that slide."
        )
    with settings():
        figure.suptitle(_wrapped(f"{title}. {words}" if title else words, figure))
    return figure


def history_figure(
    history: LoadHistory | Mapping[str, tuple[ArrayLike, ArrayLike]],
    units: Units | None = None,
    times: Sequence[float] | None = None,
) -> "Figure":
    """Hysteresis loops of up to four contacts, and for a history their forces step by step.

    A loop needs something that moves, such as an obstacle or a prescribed displacement. Under loads alone there are
    forces only.

    Parameters
    ----------
    history : load history or mapping
        A history with `steps` and `loop(contact)`, or (displacements [length], forces [stress × length]) by name.
    units : Units, optional
        Labels.
    times : sequence of float, optional
        The value of t in each step: forces are drawn over t instead of the number of the step, a hollow square at the
        first step.

    Raises
    ------
    InputError
        If there is nothing to draw, or not a time for each step.

    """
    units = plain_units(units)
    abscissa = None if times is None else real_array("times", times)
    forces: dict[str, list[tuple[float, float]]] = {}
    if isinstance(history, Mapping):
        loops: Mapping[str, tuple[ArrayLike, ArrayLike]] = history
    else:
        first = _read(history, forces)
        loops = {} if first is None else _loops(history, first)
    contacts, shown = list(forces)[:_PANELS], list(loops)[:_PANELS]
    if not contacts and not shown:
        raise InputError("history", history, "there is no contact whose loop or forces could be drawn")
    count = max(map(len, forces.values()), default=0)
    if abscissa is not None and (abscissa.ndim != 1 or len(abscissa) < count):
        raise InputError("times", times, f"give the times of all {count} steps")
    with settings():
        rows = bool(contacts) + bool(shown)
        figure = new_figure(max(4.6, 3.6 * max(len(contacts), len(shown))), 3.6 if rows == 1 else 6.8)
        parts = figure.subfigures(rows, 1, squeeze=False)
        for number, name in enumerate(shown, 1):
            panel = parts[0, 0].add_subplot(1, len(shown), number)
            hysteresis_loop(panel, *loops[name], units)
            panel.set_title(plain_text(name))
        for number, name in enumerate(contacts, 1):
            panel = parts[rows - 1, 0].add_subplot(1, len(contacts), number)
            _forces(panel, forces[name], name, units, abscissa)
        if len(loops) > len(shown):
            figure.suptitle(_wrapped(f"loops not shown: {', '.join(list(loops)[_PANELS:])}", figure))
    return figure


def hysteresis_loop(axes: "Axes", displacement: ArrayLike, force: ArrayLike, units: Units | None = None) -> None:
    """Draw the tangential force of a contact against the displacement that drives it: a dot a step, the first hollow.

    Parameters
    ----------
    axes : matplotlib axes
        Where to draw.
    displacement : (steps,) array
        Displacement of the obstacle or plate [length].
    force : (steps,) array
        Tangential force a unit of thickness [stress × length].
    units : Units, optional
        Labels.

    Raises
    ------
    InputError
        If the two are not rows of numbers of one length.

    """
    units = plain_units(units)
    moved, carried = real_array("displacement", displacement), real_array("force", force)
    if moved.ndim != 1 or moved.shape != carried.shape or not len(moved):
        shapes = (moved.shape, carried.shape)
        raise InputError("hysteresis_loop", shapes, "give displacements and forces as rows of one length")
    axes.axhline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.axvline(0.0, color="#dddddd", linewidth=0.5, zorder=0)
    axes.plot(moved, carried, color=BLUE, marker="o", markersize=3, linewidth=1.0)
    axes.ticklabel_format(scilimits=(-3, 4), useMathText=True)
    axes.locator_params(axis="x", nbins=6)
    axes.plot(moved[:1], carried[:1], color=GREY, marker="s", markersize=7, fillstyle="none", linestyle="none")
    axes.set_xlabel(f"displacement [{units.displacement}]")
    axes.set_ylabel(f"force [{units.engineering_force}]")


def _read(history: LoadHistory, forces: dict[str, list[tuple[float, float]]]) -> ContactProblem | None:
    """Add the forces of all steps by contact, and return the problem of the first; no step is kept in memory."""
    first = None
    for step in history.steps:
        if step.has_state:
            first = first or step.problem
            for name, line in step.contacts.items():
                forces.setdefault(name, []).append((line.normal_force, line.tangential_force))
    return first


def _loops(history: LoadHistory, problem: ContactProblem) -> dict[str, tuple[ArrayLike, ArrayLike]]:
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


def _states(part: "SubFigure", result: ContactResult, units: Units, with_contacts: bool) -> None:
    """Upper row: crosses, von Mises stress, deformed contact lines."""
    panels = part.subplots(1, 3 if with_contacts else 2)
    x, y, stress = result.gauss_stress()
    sizes = np.abs(principal_stresses(stress)[:2]).max(axis=0)
    largest = principal_stress_map(panels[0], result, _usual(sizes), units, legend=True, crosses=_CROSSES)
    panels[0].set_title(f"principal stresses, up to {largest:.4g} {units.stress}\nat Gauss points")
    held = held_along_z(result.problem, np.arange(len(x)), x, y)
    mises = von_mises(stress, cell_factors(result.problem)[:, None], held)
    usual = _usual(mises)
    stress_field(panels[1], result, "von_mises", units, (None, usual))
    panels[1].set_title(f"von Mises stress, up to {mises.max():.4g} {units.stress}\nat Gauss points")
    if with_contacts:
        deformed_contact(panels[2], result, units=units)
        panels[2].set_title("contact lines, deformed")


def _usual(sizes: FloatArray) -> float:
    """The largest size, or one that all but few points stay below where those are much larger, as in a corner."""
    usual, largest = float(np.quantile(sizes, _ALL_BUT_FEW)), float(sizes.max())
    return usual if usual < 0.7 * largest else largest


def _tractions(part: "SubFigure", result: ContactResult, names: Sequence[str], units: Units) -> None:
    """Lower row: tractions and states, one panel a contact, with one legend for all."""
    panels = part.subplots(1, len(names), squeeze=False)[0]
    handles: dict[str, Artist] = {}
    largest = max(float(np.abs(principal_stresses(result.gauss_stress()[2])[:2]).max()), np.finfo(float).tiny)
    for panel, name in zip(panels, names, strict=True):
        line = result.contacts[name]
        contact_tractions(panel, line, units)
        if max(np.abs(line.normal_stress).max(), np.abs(line.tangential_stress).max()) < _NOTHING * largest:
            panel.set_ylim(0.0, largest)  # rather than rounding in full size
        named = {"N": line.normal_force, "T": line.tangential_force}
        if line.has_fluid:
            named = {"N": line.normal_force, "effective N'": line.effective_normal_force, "T": line.tangential_force}
        forces = ", ".join(f"{force} = {shown(value, line.rounding.force, 4)}" for force, value in named.items())
        text = f"{forces} {units.engineering_force}".replace("-", "−")
        narrow = len(names) > 2 or (line.has_fluid and len(names) > 1)
        apart, size = ("\n", "medium") if narrow else (": ", "large")
        panel.set_title(plain_text(f"{name}{apart}{text}"), fontsize=size)
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    part.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=len(handles), frameon=False)


def _forces(
    axes: "Axes", forces: Sequence[tuple[float, float]], name: str, units: Units, times: FloatArray | None
) -> None:
    """Normal and tangential force of one contact step by step, over t where times are given."""
    place = np.arange(1, len(forces) + 1) if times is None else times[: len(forces)]
    looks: list[tuple[str, dict[str, Any]]] = [
        ("N", {"color": GREY, "marker": "s"}),
        ("T", {"color": BLUE, "marker": "o", "linestyle": "--"}),
    ]
    for (label, look), values in zip(looks, zip(*forces, strict=True), strict=True):
        axes.plot(place, values, markersize=3, linewidth=1.0, label=label, **look)
        if times is not None:
            axes.plot(place[:1], values[:1], color=GREY, marker="s", markersize=7, fillstyle="none", linestyle="none")
    axes.set_title(plain_text(f"{name}: forces"))
    axes.set_xlabel("step [-]" if times is None else "t")
    axes.set_ylabel(f"force [{units.engineering_force}]")
    axes.locator_params(axis="x", integer=times is None)
    axes.legend(frameon=False)


def _wrapped(title: str, figure: "Figure") -> str:
    return plain_text(textwrap.fill(title, int(11 * figure.get_figwidth())))
