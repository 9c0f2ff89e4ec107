"""The figures of the report; runs that fail are hatched, or stand in a shaded band."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from comparisons.convergence.uzawa.entries import Entries, Entry, Place, place_name
from comparisons.convergence.uzawa.methods import METHODS
from comparisons.lab.report.numbers import scientific
from comparisons.lab.report.old import Figure
from comparisons.paper.reference import load
from qvi_contact.basics.checks import FloatArray
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION, has_matplotlib
from qvi_contact.plots.inline import svg_text
from qvi_contact.plots.style import PURPLE, SKY, new_figure, settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_TARGET: Final = "1e-04"
_LOOKS: Final = (
    (BLUE, "o", "-"), (VERMILLION, "s", "--"), (GREEN, "^", "-."), (ORANGE, "D", ":"), (PURPLE, "v", "-"),
    (SKY, "P", "--"), (GREY, "X", "-."),
)  # fmt: skip
"""Colour, marker and line of the frictions, in order."""

_MAP_READING: Final = (
    "Colour: iterations until the normal force stays within 1e-4 for good, for pairs of steps as shares of their "
    "limits 2 / λ_max over all points. Dashed: the limits; solid: where the iteration linearised at the solution "
    "stops to contract; dotted: the paper's ω_T."
)
_MAP_FAILURE: Final = (
    "Hatched with lines: in 2000 iterations the run does not settle, its multipliers go on changing. With dots: it "
    "settles, but is not within 1e-4 in time."
)


def figures(entries: Entries) -> dict[str, Figure]:
    """Name → figure."""
    made = (
        _paper(entries),
        _plate_maps(entries),
        _open_map(entries),
        limits(entries),
        _meshes(entries),
        _work(entries),
    )
    return {figure.name: figure for figure in made}


def _figure(name: str, title: str, draw: Callable[[], "Canvas"], reading: str, failure: str) -> Figure:
    svg = ""
    if has_matplotlib():
        with settings():
            svg = svg_text(draw(), f"uzawa-{name}")
    return Figure(name, title, svg, reading, failure)


def _paper(entries: Entries) -> Figure:
    paper = load()

    def draw() -> "Canvas":
        canvas = new_figure(8.0, 4.2)
        axes = canvas.subplots()
        axes.set(
            xscale="log", yscale="log", ylim=(1e-10, 0.1), xlabel="iteration [-]", ylabel="relative error of P/2 [-]"
        )
        _plain_ticks(axes.xaxis, axes.yaxis)
        axes.axvline(
            paper.iterations, color="black", linestyle="--", linewidth=0.8, label=f"{paper.iterations} iterations"
        )
        for number, entry in enumerate(entries.runs("paper")):
            colour, marker, line = _LOOKS[number % len(_LOOKS)]
            errors = np.maximum(np.array(entry.result["errors"]), 1e-10)
            axes.plot(np.arange(1, len(errors) + 1), errors, color=colour, linestyle=line, marker=marker, markersize=4,
                      markevery=(number, 40), linewidth=1.2, label=f"μ = {entry.friction:g}")  # fmt: skip
        axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
        axes.legend(fontsize=8, frameon=False, ncols=2, loc="lower left")
        return canvas

    return _figure(
        "history", "The paper's run, and what would have come after it", draw,
        "Relative error of P/2 after each iteration with the paper's mesh, ω_T and the accumulating rule, beside its "
        "30 iterations. Errors are shown down to 1e-10.",
        "A curve that becomes horizontal above 1e-10 does not converge.",
    )  # fmt: skip


def _plate_maps(entries: Entries) -> Figure:
    places = [place for place in entries.maps if place[0] == "plate"]

    def draw() -> "Canvas":
        columns = min(3, max(1, len(places)))
        rows = max(1, (len(places) + columns - 1) // columns)
        canvas = new_figure(1.2 + 2.5 * columns, 1.3 + 1.75 * rows)
        panels = canvas.subplots(rows, columns, squeeze=False)
        _maps(canvas, panels.ravel().tolist(), [(place, entries.maps[place]) for place in places])
        return canvas

    return _figure("map-plate", "Steps on the plate", draw, _MAP_READING, _MAP_FAILURE)


def _open_map(entries: Entries) -> Figure:
    places = [place for place in entries.maps if place[0] != "plate"]

    def draw() -> "Canvas":
        canvas = new_figure(6.0, 4.6)
        _maps(canvas, [canvas.subplots()], [(place, entries.maps[place]) for place in places[:1]])
        return canvas

    return _figure("map-open", "Steps where every other point is open", draw, _MAP_READING, _MAP_FAILURE)


def _maps(canvas: "Canvas", panels: Sequence["Axes"], maps: Sequence[tuple[Place, list[Entry]]]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    counts = [count for _, found in maps for entry in found if (count := _reached(entry)) is not None]
    scale = ScalarMappable(LogNorm(max(1, min(counts, default=1)), max(2, *counts, 2)), "cividis")
    for axes in panels[len(maps) :]:
        axes.set_visible(False)
    for axes, (place, found) in zip(panels, maps, strict=False):
        _map(axes, scale, found)
        axes.set_title(place_name(place), fontsize=8)
    canvas.colorbar(scale, ax=list(panels), label="iterations to 1e-4 [-]")
    canvas.supxlabel("ω_T / (2 / λ_max) [-]", fontsize=9)
    canvas.supylabel("ω_N / (2 / λ_max) [-]", fontsize=9)


def _reached(entry: Entry) -> int | None:
    return entry.needed(_TARGET) if entry.settles else None


def _map(axes: "Axes", scale: Any, found: Sequence[Entry]) -> None:
    """One rectangle for each pair of steps; lines of theory."""
    from matplotlib.patches import Rectangle

    tangential = sorted({entry.tangential or 0.0 for entry in found})
    normal = sorted({entry.normal or 0.0 for entry in found})
    x, y = _borders(tangential), _borders(normal)
    axes.set(xscale="log", yscale="log", xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    for entry in found:
        i, j = tangential.index(entry.tangential or 0.0), normal.index(entry.normal or 0.0)
        count = _reached(entry)
        hatch = None if count is not None else "..." if entry.settles else "////"
        face = "white" if count is None else scale.to_rgba(count)
        box = ((x[i], y[j]), x[i + 1] - x[i], y[j + 1] - y[j])
        axes.add_patch(Rectangle(*box, facecolor=face, edgecolor=GREY if hatch else face, hatch=hatch, linewidth=0.0))
    for draw in (axes.axvline, axes.axhline):
        draw(1.0, color=VERMILLION, linestyle="--", linewidth=1.2)
    limit = next((value for entry in found if (value := entry.number("limit_T"))), None)
    if limit is not None and found[0].place[0] == "plate":
        axes.axvline(load().omega_T / limit, color=VERMILLION, linestyle=":", linewidth=1.4)
    grid = {(entry.tangential, entry.normal): entry.number("linearised") or 0.0 for entry in found}
    values = np.array([[grid.get((t, n), np.nan) for t in tangential] for n in normal])
    if min(values.shape) > 1 and np.nanmin(values) < 1.0 < np.nanmax(values):
        axes.contour(tangential, normal, values, levels=[1.0], colors=[VERMILLION], linewidths=1.4)
    for axis, ticks in ((axes.xaxis, (0.125, 0.25, 0.5, 1, 2, 4)), (axes.yaxis, (0.125, 0.25, 0.5, 1, 2, 4))):
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks], fontsize=7)
        axis.set_ticks([], minor=True)
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))


def _borders(values: Sequence[float]) -> FloatArray:
    """Borders of the rectangles about these values, in the middle between them in logarithms."""
    logs = np.log(np.array(values))
    if len(logs) == 1:
        return np.asarray(np.exp(logs[0] + np.array([-0.35, 0.35])))
    middle = (logs[1:] + logs[:-1]) / 2.0
    return np.asarray(np.exp(np.concatenate([[2.0 * logs[0] - middle[0]], middle, [2.0 * logs[-1] - middle[-1]]])))


def limits(entries: Entries) -> Figure:
    """The largest ω_T that settle, beside theory."""
    groups = _by_friction([entry for entry in entries.runs("tangential limit") if entry.place[0] == "plate"])

    def draw() -> "Canvas":
        canvas = new_figure(8.0, 4.4)
        axes = canvas.subplots()
        axes.set(yscale="log", xlabel="cells a side [-]", ylabel="ω_T [length]")
        _two_powers(axes)
        for number, (friction, found) in enumerate(groups.items()):
            colour, marker, _ = _LOOKS[number % len(_LOOKS)]
            for name, line in (("omega_T", ""), ("limit_T", "--"), ("slipping_T", ":")):
                shown = [
                    (entry.cells, value) for entry in found if (value := entry.number(name)) and _bounded(entry, name)
                ]
                label = f"μ = {friction:g}: {_LIMIT_LABELS[name]}"
                if shown:
                    axes.plot(*zip(*shown, strict=True), color=colour, linestyle=line or "none",
                              marker=None if line else marker, markersize=6, linewidth=1.2, label=label)  # fmt: skip
        axes.axhline(load().omega_T, color="black", linewidth=0.9, label="the paper's ω_T")
        axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
        canvas.legend(fontsize=7, frameon=False, ncols=3, loc="outside lower center")
        return canvas

    return _figure(
        "limits", "Largest ω_T on the plate", draw,
        "Marks: the largest ω_T with which runs settle. Dashed: 2 / λ_max over all points; dotted: over the points "
        "that slip at the solution. The horizontal line is the step printed in the paper: meshes whose mark is below "
        "it need a smaller one.",
        "A mark below its dashed line: 2 / λ_max would not be safe. A mesh without a mark has no limit in the range "
        "searched.",
    )  # fmt: skip


_LIMIT_LABELS: Final = {
    "omega_T": "observed", "limit_T": "2 / λ_max, all points", "slipping_T": "2 / λ_max, slipping points",
}  # fmt: skip


def _bounded(entry: Entry, name: str) -> bool:
    """Whether a limit was found from both sides, where it is the observed one."""
    return name != "omega_T" or None not in (entry.number("largest"), entry.number("smallest"))


def _plain_ticks(*axes: Any) -> None:
    """Decades as plain numbers: quicker to read, and to draw, than powers of ten."""
    from matplotlib.ticker import NullFormatter

    for axis in axes:
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())


def _two_powers(axes: "Axes") -> None:
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_formatter("{x:g}")


def _by_friction(found: Sequence[Entry]) -> dict[float, list[Entry]]:
    groups: dict[float, list[Entry]] = {}
    for entry in sorted(found, key=lambda entry: (entry.friction, entry.cells)):
        groups.setdefault(entry.friction, []).append(entry)
    return groups


def _meshes(entries: Entries) -> Figure:
    def draw() -> "Canvas":
        canvas = new_figure(8.0, 3.8)
        panels = canvas.subplots(1, 2)
        for axes, target in zip(panels, (_TARGET, "1e-06"), strict=True):
            axes.set(
                yscale="log",
                ylim=(0.8, 1e5),
                xlabel="cells a side [-]",
                ylabel=f"iterations to {float(target):.0e} [-]",
            )
            _plain_ticks(axes.yaxis)
            axes.axhspan(2e4, 1e5, color=GREY, alpha=0.18, linewidth=0)
            axes.text(0.01, 0.985, "fails", transform=axes.transAxes, fontsize=7, va="top", color=GREY)
            _two_powers(axes)
            axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
            for number, (friction, found) in enumerate(entries.meshes.items()):
                colour, marker, line = _LOOKS[number % len(_LOOKS)]
                shown = [(entry.cells, count) for entry in found if (count := entry.needed(target)) is not None]
                x, y = zip(*shown, strict=True) if shown else ((), ())
                axes.plot(x, y, color=colour, marker=marker, linestyle=line, label=f"μ = {friction:g}")
                failed = [entry.cells for entry in found if entry.needed(target) is None]
                axes.plot(failed, [3e4 * 1.3**number] * len(failed), "x", color=colour, markersize=7, markeredgewidth=2)
            cells = sorted({entry.cells for found in entries.meshes.values() for entry in found})
            if cells:
                axes.plot(cells, [8.0 * c for c in cells], color="black", linewidth=0.9, linestyle="--", label="∝ 1/h")
        canvas.legend(
            *panels[0].get_legend_handles_labels(), fontsize=8, frameon=False, ncols=4, loc="outside lower center"
        )
        return canvas

    return _figure(
        "mesh", "Iterations on finer meshes", draw,
        "Iterations until the normal force of the plate stays within 1e-4 (left) and 1e-6 (right) for good, both "
        "steps at half their limits. The dashed line grows like 1/h.",
        "A cross in the shaded band: not reached in 20 000 iterations.",
    )  # fmt: skip


def _work(entries: Entries) -> Figure:
    places = list(entries.accuracies)

    def draw() -> "Canvas":
        rows = max(1, (len(places) + 1) // 2)
        canvas = new_figure(8.0, 0.9 + 2.6 * rows)
        panels = canvas.subplots(rows, 2, squeeze=False).ravel().tolist()
        for axes in panels[len(places) :]:
            axes.set_visible(False)
        for axes, place in zip(panels, places, strict=False):
            _work_panel(axes, place, entries.accuracies[place])
        handles: dict[str, Any] = {}
        for axes in panels[: len(places)]:
            handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
        canvas.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
        return canvas

    return _figure(
        "work", "Time to the same certified accuracy", draw,
        "Median wall time, factorisation included, to the accuracy that was asked for and that the certificate "
        "confirms. Curves that rise steeply to the left pay much for every digit.",
        "A cross in the shaded band at the top, each method at its own height: it ends without confirming the "
        "accuracy.",
    )  # fmt: skip


def _work_panel(axes: "Axes", place: Place, found: Sequence[Entry]) -> None:
    targets = sorted({entry.target or 0.0 for entry in found})
    axes.set(xscale="log", yscale="log", xlabel="target [-]", ylabel="time [s]", ylim=(3e-3, 100.0))
    axes.set_title(place_name(place), fontsize=9)
    _plain_ticks(axes.yaxis)
    axes.set_xticks(targets, [scientific(target, 1) for target in targets])
    axes.set_xticks([], minor=True)
    axes.set_xlim(max(targets) * 5.0, min(targets) / 5.0)
    axes.axhspan(30.0, 100.0, color=GREY, alpha=0.18, linewidth=0)
    axes.text(0.01, 0.985, "fails", transform=axes.transAxes, fontsize=7, va="top", color=GREY)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
    for number, (name, look) in enumerate(METHODS.items()):
        runs = sorted((entry for entry in found if entry.run == name), key=lambda entry: -(entry.target or 0.0))
        shown = [(entry.target, entry.seconds) for entry in runs if entry.solved and entry.seconds]
        x, y = zip(*shown, strict=True) if shown else ((), ())
        axes.plot(
            x, y, color=look.colour, marker=look.marker, linestyle=look.line, markersize=5, linewidth=1.1, label=name
        )
        failed = [entry.target or 0.0 for entry in runs if not entry.solved]
        axes.plot(
            failed, [38.0 * 1.25**number] * len(failed), "x", color=look.colour, markersize=6, markeredgewidth=1.5
        )
