"""The pictures of the report."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.convergence.mesh.errors import NAMES, Overview, ends_among, slug
from comparisons.convergence.mesh.problems import ENERGY, FORCE, TRACTIONS, Problem
from comparisons.convergence.mesh.references import Reference, end_of, errors_of
from comparisons.convergence.mesh.study import APART, COMPANION, GOAL, GRADED, UNIFORM
from comparisons.convergence.mesh.tractions import Field
from comparisons.lab.report.drawing import drawn, grid, legend_below
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots.style import BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILLION, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_LOOK: Final = {
    UNIFORM: (BLUE, "o", "-"), GRADED: (ORANGE, "s", "--"), GOAL: (GREEN, "^", "-."), APART: (PURPLE, "D", ":"),
}  # fmt: skip
"""Colour, marker, line of each sequence."""

_EVENLY: Final = 401  # points of a contact
_KINDS: Final = ((GREY, ":"), (ORANGE, "--"), (BLUE, "-"))  # of meshes in pictures of tractions
_SIDE: Final = 3.4  # inch, of a panel


def figures(overview: Overview) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    drawings: dict[str, Callable[[], Drawing]] = {"gaps": partial(_gaps, overview)}
    for problem in overview.problems:
        known = overview.references[problem.name]
        drawings[f"errors-{slug(problem)}"] = partial(_errors, overview, problem)
        if TRACTIONS in known:
            drawings[f"tractions-{slug(problem)}"] = partial(_tractions, overview, problem)
        if ends_among(known):
            drawings[f"ends-{slug(problem)}"] = partial(_ends, overview, problem)
    return {name: drawn(name, draw) for name, draw in drawings.items()}


def _errors(overview: Overview, problem: Problem) -> Drawing:
    """Errors against unknowns, a panel for each measure."""
    known = overview.references[problem.name]
    measures = [measure for measure in (FORCE, ENERGY, TRACTIONS) if measure in known]
    figure = new_figure(_SIDE * max(len(measures), 2), 3.5)
    for axes, measure in zip(figure.subplots(1, len(measures), squeeze=False)[0], measures, strict=True):
        _logarithmic(axes)
        curves = {sequence: overview.curve(problem, measure, sequence) for sequence in NAMES}
        for sequence, points in curves.items():
            _draw_curve(axes, sequence, points[points.error > 0.0])
        if measure != TRACTIONS:
            _draw_displacements(axes, overview.of(problem, UNIFORM, COMPANION), measure, known[measure])
        if measure in problem.expected:
            _draw_slope(axes, curves[UNIFORM], problem.expected[measure].order)
        least = known[measure].least
        positive = (points.error[points.error > 0.0].min() for points in curves.values())
        bottom = min(least, *(error for error in positive if error == error), np.inf) / 3.0
        axes.axhspan(bottom, least, color=GREY, alpha=0.2, linewidth=0)
        axes.set_ylim(bottom=bottom)
        axes.set(xlabel="unknowns [-]", ylabel=f"relative error of the {measure} [-]")
    legend_below(figure)
    return figure


def _draw_curve(axes: Axes, sequence: str, points: DataFrame) -> None:
    if points.empty:
        return
    colour, marker, line = _LOOK[sequence]
    look: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 5}
    axes.plot(points.unknowns, points.error, linestyle=line, linewidth=1.1, label=NAMES[sequence], **look)
    hollow = points[~points.meant]
    if len(hollow):
        axes.plot(hollow.unknowns, hollow.error, linestyle="", markerfacecolor="white", **look)


def _draw_displacements(axes: Axes, meshes: DataFrame, measure: str, known: Reference) -> None:
    """Errors of the displacement model on equal cells."""
    errors = errors_of(meshes, measure, known)
    shown = errors > 0.0
    if shown.any():
        axes.plot(meshes.unknowns[shown], errors[shown], color=VERMILLION, linestyle=(0, (1, 1)), linewidth=0.9,
                  marker="x", markersize=5, label="displacements, equal cells")  # fmt: skip


def _draw_slope(axes: Axes, points: DataFrame, order: float) -> None:
    """A line with the expected order through the last error that means something."""
    meant = points[points.meant]
    if len(meant) < 2:
        return
    x = meant.unknowns.iloc[[0, -1]].to_numpy()
    axes.plot(x, 0.6 * meant.error.iloc[-1] * (x / x[1]) ** (-order / 2.0), color=GREY, linewidth=1.0,
              label="expected order, equal cells")  # fmt: skip


def _three(meshes: DataFrame) -> DataFrame:
    """Coarsest, middle and finest of those that are not too fine to be seen."""
    few = meshes[meshes["size"] <= 32]
    few = few if len(few) else meshes
    return few.iloc[sorted({0, len(few) // 2, len(few) - 1})]


def _tractions(overview: Overview, problem: Problem) -> Drawing:
    """Tractions along the contact on three meshes and the reference."""
    figure = new_figure(2.3 * _SIDE, 3.3)
    panels = figure.subplots(1, 2)
    meshes, known = _three(overview.of(problem, UNIFORM)), overview.references[problem.name][TRACTIONS].value
    for cells, field, (colour, line) in zip(meshes.cells, meshes.tractions, _KINDS, strict=False):
        edges = _draw_tractions(panels, field, field.lines, f"{cells} cells", color=colour, linestyle=line)
        for axes, marks in zip(panels, field(edges), strict=True):
            axes.plot(edges.ravel(), marks.ravel(), color=colour, linestyle="", marker=".", markersize=2.5)
    first, last = meshes.tractions.iloc[0].lines[[0, -1]]
    lines = getattr(known, "lines", np.linspace(first, last, 200))
    _draw_tractions(panels, known, lines, "reference", color="black", linestyle="-")
    stress, length = problem.units
    evenly = known(np.linspace(first, last, _EVENLY)[1:-1])
    for axes, symbol, values in zip(panels, ("σ_N", "σ_T"), evenly, strict=True):
        axes.set(ylim=_view(values), xlabel=f"x [{length}]", ylabel=f"{symbol} [{stress}]")
    legend_below(figure)
    return figure


def _draw_tractions(panels: Any, field: Field, lines: FloatArray, label: str, **look: Any) -> FloatArray:
    """σ_N and σ_T in a panel each; returns the places of the ends of all edges, all but (e, 2)."""
    s = lines[:-1, None] + np.diff(lines)[:, None] * np.linspace(1e-9, 1.0 - 1e-9, 9)
    for axes, values in zip(panels, field(s), strict=True):
        axes.plot(s.ravel(), values.ravel(), linewidth=1.0, label=label, **look)
    return s[:, [0, -1]]


def _view(values: FloatArray) -> tuple[float, float]:
    """A range that shows all but the highest peaks: 1 % of the contact."""
    low, high = min(np.quantile(values, 0.01), 0.0), max(np.quantile(values, 0.99), 0.0)
    margin = 0.25 * (high - low) or 1.0
    return float(low - margin), float(high + margin)


def _ends(overview: Overview, problem: Problem) -> Drawing:
    """Ends of zones against the size of the mesh."""
    known = overview.references[problem.name]
    kinds = ends_among(known)
    figure = new_figure(_SIDE * max(len(kinds), 2) * 0.95, 3.3)
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        axes.set_xscale("log", base=2)
        axes.minorticks_off()
        _draw_place(axes, known[kind])
        for sequence in NAMES:
            _draw_ends(axes, overview.of(problem, sequence), kind, sequence)
        axes.set(xlabel="h [-]", ylabel=f"{kind} at x [{problem.units[1]}]")
    legend_below(figure)
    return figure


def _draw_place(axes: Axes, place: Reference) -> None:
    axes.axhspan(place.value - place.uncertainty, place.value + place.uncertainty, color=GREY, alpha=0.2, linewidth=0)
    axes.axhline(place.value, color=GREY, linewidth=0.8)


def _draw_ends(axes: Axes, meshes: DataFrame, kind: str, sequence: str) -> None:
    colour, marker, line = _LOOK[sequence]
    ends = [end_of(each, kind) for each in meshes.ends]
    found = [(h, end) for h, end in zip(meshes.h, ends, strict=True) if end is not None]
    if not found:
        return
    h, shown = zip(*found, strict=True)
    y, low, high = (np.array([end[name] for end in shown]) for name in ("position", "low", "high"))
    bars = [y - low, high - y]
    axes.errorbar(h, y, np.maximum(bars, 0.0), color=colour, marker=marker, markersize=4.5, linestyle=line,
                  linewidth=0.9, elinewidth=0.7, capsize=2, label=NAMES[sequence])  # fmt: skip
    span = np.ptp(y) + (high - low).max()
    others = [(size, end["extrapolated"]) for size, end in found if end["extrapolated"] is not None]
    near = [(size, other) for size, other in others if y.min() - span <= other <= y.max() + span]
    if near:
        axes.plot(*zip(*near, strict=True), color=colour, marker=marker, markersize=4.5, markerfacecolor="white",
                  linestyle="")  # fmt: skip


def _gaps(overview: Overview) -> Drawing:
    """Gap of the brackets against the size of the mesh."""
    colours, markers = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY, GREY), "os^vDPX*<>"
    figure = new_figure(3.0 * _SIDE, 3.9)
    for axes, sequence in zip(figure.subplots(1, 3, sharey=True), (UNIFORM, GRADED, APART), strict=True):
        _logarithmic(axes)
        axes.set_xscale("log", base=2)
        axes.minorticks_off()
        found = overview.bounded[overview.bounded.sequence == sequence]
        for number, name in enumerate(overview.meshes.problem.unique()):
            look = {"color": colours[number % len(colours)], "marker": markers[number % len(markers)], "label": name}
            for guaranteed in (True, False):
                meshes = found[(found.problem == name) & (found.guaranteed == guaranteed)]
                shown = meshes[meshes.gap / meshes.strain > 1e-12]
                if len(shown):
                    line, face = ("-", look["color"]) if guaranteed else (":", "white")
                    axes.plot(shown.h, shown.gap / shown.strain, markersize=5, linestyle=line, linewidth=1.0,
                              markerfacecolor=face, **look)  # fmt: skip
        axes.set_title(NAMES[sequence], fontsize=9)
        axes.set_xlabel("h [-]")
    figure.axes[0].set_ylabel("gap / strain energy [-]")
    legend_below(figure)
    return figure


def _logarithmic(axes: Axes) -> None:
    axes.set(xscale="log", yscale="log")
    axes.minorticks_off()
    grid(axes)
