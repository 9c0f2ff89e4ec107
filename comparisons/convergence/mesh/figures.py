"""The pictures of the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from comparisons.convergence.mesh.data import Mesh
from comparisons.convergence.mesh.errors import ENERGY, FORCE, TRACTIONS, Curve, Reference, end_of, error_of
from comparisons.convergence.mesh.overview import NAMES, SHOWN, Overview, ends_of, slug
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, COMPANION, GOAL, GRADED, UNIFORM
from comparisons.convergence.mesh.tractions import Field, Tractions
from comparisons.lab.report import drawn
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_LOOK: Final = {
    UNIFORM: (BLUE, "o", "-"), GRADED: (ORANGE, "s", "--"), GOAL: (GREEN, "^", "-."), APART: (PURPLE, "D", ":"),
}  # fmt: skip
"""Colour, marker, line of each sequence."""

_EVENLY: Final = 401  # points of a contact
_KINDS: Final = ((GREY, ":"), (ORANGE, "--"), (BLUE, "-"), (VERMILLION, "-."), (GREEN, "--"), (SKY, "-"))
_SIDE: Final = 3.4  # inch, of a panel


def figures(overview: Overview) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    drawings: dict[str, Callable[[], Drawing]] = {"gaps": partial(_gaps, overview)}
    for problem in overview.problems:
        known = overview.references[problem.name]
        drawings[f"errors-{slug(problem)}"] = partial(_errors, overview, problem)
        if TRACTIONS in known.measures:
            drawings[f"tractions-{slug(problem)}"] = partial(_tractions, overview, problem)
        if ends_of(known):
            drawings[f"ends-{slug(problem)}"] = partial(_ends, overview, problem)
    return {name: drawn(name, draw) for name, draw in drawings.items()}


def _errors(overview: Overview, problem: Problem) -> Drawing:
    """Errors against unknowns, a panel for each measure."""
    known = overview.references[problem.name]
    measures = [measure for measure in (FORCE, ENERGY, TRACTIONS) if measure in known.measures]
    figure = new_figure(_SIDE * max(len(measures), 2), 3.5)
    for axes, measure in zip(figure.subplots(1, len(measures), squeeze=False)[0], measures, strict=True):
        _logarithmic(axes)
        lowest = known.least(measure)
        for curve in overview.curves_of(problem, measure):
            _draw_curve(axes, curve)
            lowest = min(lowest, *(error for error in curve.errors if error > 0.0), np.inf)
        _draw_displacements(axes, overview, problem, measure)
        _draw_slope(axes, overview.curve_of(problem, measure, UNIFORM))
        axes.axhspan(lowest / 3.0, known.least(measure), color=GREY, alpha=0.2, linewidth=0)
        axes.set_ylim(bottom=lowest / 3.0)
        axes.set_xlabel("unknowns [-]")
        axes.set_ylabel(f"relative error of the {measure} [-]")
    _legend_of(figure)
    return figure


def _draw_curve(axes: Axes, curve: Curve) -> None:
    colour, marker, line = _LOOK[curve.sequence]
    pairs = [(m.unknowns, e, means) for m, e, means in zip(curve.meshes, curve.errors, curve.meant, strict=True) if e]
    if not pairs:
        return
    x, y, _ = zip(*pairs, strict=True)
    axes.plot(
        x, y, color=colour, linestyle=line, linewidth=1.1, marker=marker, markersize=5, label=NAMES[curve.sequence]
    )
    hollow = [pair[:2] for pair in pairs if not pair[2]]
    if hollow:
        axes.plot(*zip(*hollow, strict=True), color=colour, linestyle="", marker=marker, markersize=5,
                  markerfacecolor="white")  # fmt: skip


def _draw_displacements(axes: Axes, overview: Overview, problem: Problem, measure: str) -> None:
    """Errors of the displacement model on equal cells."""
    if measure == TRACTIONS:
        return
    meshes = overview.data.of(problem, UNIFORM, COMPANION)
    errors = [error_of(mesh, measure, overview.references[problem.name]) for mesh in meshes]
    points = [(mesh.unknowns, error) for mesh, error in zip(meshes, errors, strict=True) if error]
    if points:
        axes.plot(*zip(*points, strict=True), color=VERMILLION, linestyle=(0, (1, 1)), linewidth=0.9, marker="x",
                  markersize=5, label="displacements, equal cells")  # fmt: skip


def _draw_slope(axes: Axes, curve: Curve | None) -> None:
    """A line with the expected order through the last error that means something."""
    if curve is None or curve.expected is None:
        return
    points = [(m.unknowns, e) for m, e, means in zip(curve.meshes, curve.errors, curve.meant, strict=True) if means]
    if len(points) < 2:
        return
    (first, _), (last, error) = points[0], points[-1]
    x = np.array([first, last], dtype=float)
    power = curve.expected.order / 2.0
    axes.plot(x, 0.6 * error * (x / last) ** -power, color=GREY, linewidth=1.0, label="expected order, equal cells")


def _three(meshes: Sequence[Mesh]) -> list[Mesh]:
    """Coarsest, middle and finest of those that are not too fine to be seen."""
    few = [mesh for mesh in meshes if mesh.size <= 32] or list(meshes)
    return [few[index] for index in sorted({0, len(few) // 2, len(few) - 1})]


def _tractions(overview: Overview, problem: Problem) -> Drawing:
    """Tractions along the contact on three meshes and the reference."""
    known = overview.references[problem.name]
    figure = new_figure(2.3 * _SIDE, 3.3)
    panels = figure.subplots(1, 2)
    fields = [
        (f"{mesh.cells} cells", Tractions.of_record(mesh.record)) for mesh in _three(overview.data.of(problem, UNIFORM))
    ]
    lines = fields[0][1].lines
    curves: list[tuple[str, Field, FloatArray]] = [(label, field, field.lines) for label, field in fields]
    if known.tractions is not None:
        places = getattr(known.tractions, "lines", np.linspace(lines[0], lines[-1], 200))
        curves.append(("reference", known.tractions, places))
    for (label, field, places), (colour, line) in zip(
        curves, (*_KINDS[: len(curves) - 1], ("black", "-")), strict=True
    ):
        s, edges = _samples(places)
        for axes, values, marks in zip(panels, field(s), field(edges), strict=True):
            axes.plot(s.T.ravel("F"), values.ravel(), color=colour, linestyle=line, linewidth=1.0, label=label)
            if label != "reference":
                axes.plot(edges.ravel(), marks.ravel(), color=colour, linestyle="", marker=".", markersize=2.5)
    stress, length = problem.units
    evenly = curves[-1][1](np.linspace(lines[0], lines[-1], _EVENLY)[1:-1])
    for axes, symbol, values in zip(panels, ("σ_N", "σ_T"), evenly, strict=True):
        axes.set_ylim(*_view(values))
        axes.set_xlabel(f"x [{length}]")
        axes.set_ylabel(f"{symbol} [{stress}]")
    _legend_of(figure)
    return figure


def _view(values: FloatArray) -> tuple[float, float]:
    """A range that shows all but the highest peaks: 1 % of the contact."""
    low, high = (float(np.quantile(values, share)) for share in (0.01, 0.99))
    low, high = min(low, 0.0), max(high, 0.0)
    margin = 0.25 * (high - low) or 1.0
    return low - margin, high + margin


def _samples(lines: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points inside every interval, ends all but included (e, 9), and the two ends alone (e, 2)."""
    t = np.linspace(1e-9, 1.0 - 1e-9, 9)
    points = lines[:-1, None] + np.diff(lines)[:, None] * t
    return points, points[:, [0, -1]]


def _ends(overview: Overview, problem: Problem) -> Drawing:
    """Ends of zones against the size of the mesh."""
    known = overview.references[problem.name]
    kinds = ends_of(known)
    figure = new_figure(_SIDE * max(len(kinds), 2) * 0.95, 3.3)
    for axes, kind in zip(figure.subplots(1, len(kinds), squeeze=False)[0], kinds, strict=True):
        axes.set_xscale("log", base=2)
        axes.minorticks_off()
        _draw_place(axes, known.values[kind])
        for sequence in SHOWN:
            _draw_ends(axes, overview.data.of(problem, sequence), kind, sequence)
        axes.set_xlabel("h [-]")
        axes.set_ylabel(f"{kind} at x [{problem.units[1]}]")
    _legend_of(figure)
    return figure


def _draw_place(axes: Axes, place: Reference) -> None:
    axes.axhspan(place.value - place.uncertainty, place.value + place.uncertainty, color=GREY, alpha=0.2, linewidth=0)
    axes.axhline(place.value, color=GREY, linewidth=0.8)


def _draw_ends(axes: Axes, meshes: Sequence[Mesh], kind: str, sequence: str) -> None:
    colour, marker, line = _LOOK[sequence]
    found = [(mesh.h, end) for mesh in meshes if (end := end_of(mesh, kind)) is not None]
    if not found:
        return
    h = [each for each, _ in found]
    y = np.array([end["position"] for _, end in found])
    bars = [y - [end["low"] for _, end in found], [end["high"] for _, end in found] - y]
    axes.errorbar(h, y, np.maximum(bars, 0.0), color=colour, marker=marker, markersize=4.5, linestyle=line,
                  linewidth=0.9, elinewidth=0.7, capsize=2, label=NAMES[sequence])  # fmt: skip
    span = np.ptp(y) + max(end["high"] - end["low"] for _, end in found)
    others = [(size, end["extrapolated"]) for size, end in found if end["extrapolated"] is not None]
    near = [(size, other) for size, other in others if y.min() - span <= other <= y.max() + span]
    if near:
        axes.plot(*zip(*near, strict=True), color=colour, marker=marker, markersize=4.5, markerfacecolor="white",
                  linestyle="")  # fmt: skip


def _gaps(overview: Overview) -> Drawing:
    """Gap of the brackets against the size of the mesh."""
    colours = (BLUE, ORANGE, GREEN, VERMILLION, PURPLE, SKY, GREY)
    markers = "os^vDPX*<>"
    figure = new_figure(3.0 * _SIDE, 3.9)
    for axes, sequence in zip(figure.subplots(1, 3, sharey=True), (UNIFORM, GRADED, APART), strict=True):
        _logarithmic(axes)
        axes.set_xscale("log", base=2)
        axes.minorticks_off()
        for number, problem in enumerate(overview.data.problems):
            for guaranteed in (True, False):
                meshes = overview.brackets(problem, sequence, guaranteed)
                points = [(m.h, m.record["gap"] / m.record["strain"]) for m in meshes]
                points = [point for point in points if point[1] > 1e-12]
                if points:
                    colour = colours[number % len(colours)]
                    axes.plot(*zip(*points, strict=True), color=colour, marker=markers[number % len(markers)],
                              markersize=5, linestyle="-" if guaranteed else ":", linewidth=1.0,
                              markerfacecolor=colour if guaranteed else "white", label=problem.name)  # fmt: skip
        axes.set_title(NAMES[sequence], fontsize=9)
        axes.set_xlabel("h [-]")
    figure.axes[0].set_ylabel("gap / strain energy [-]")
    _legend_of(figure)
    return figure


def _logarithmic(axes: Axes) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.minorticks_off()
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)


def _legend_of(figure: Drawing) -> None:
    """One legend below, each label once."""
    handles: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        artists, labels = list(handles.values()), list(handles)
        figure.legend(artists, labels, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
