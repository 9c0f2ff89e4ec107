"""The figures of the report; runs that fail stand in a shaded band at the top."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.outer.entries import NAMES, Entries, Entry, body_name
from comparisons.convergence.outer.loops import CONDENSED, LOOPS, PLAIN, TOLERANCE
from comparisons.convergence.outer.tables import NOMINAL, mesh_groups
from comparisons.lab.report.old import Figure
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION, has_matplotlib
from qvi_contact.plots.inline import svg_text
from qvi_contact.plots.style import PURPLE, SKY, new_figure, settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_FAILED: Final = "A run that fails is a cross in the shaded band at the top, each loop at its own height."
_WIDTH: Final = 8.0
_LOOKS: Final = ((BLUE, "o"), (VERMILLION, "s"), (GREEN, "^"), (ORANGE, "D"), (PURPLE, "v"), (SKY, "P"), (GREY, "X"))


def figures(entries: Entries) -> dict[str, Figure]:
    """Name → figure."""
    made = (_contraction(entries), _iterations(entries), _times(entries), _histories(entries), meshes(entries))
    return {figure.name: figure for figure in made}


def _figure(name: str, title: str, draw: Callable[[], "Canvas"], reading: str, failure: str) -> Figure:
    svg = ""
    if has_matplotlib():
        with settings():
            svg = svg_text(draw(), f"outer-{name}")
    return Figure(name, title, svg, reading, failure)


def _contraction(entries: Entries) -> Figure:
    def draw() -> "Canvas":
        canvas, panels = _panels(len(entries.main_bodies))
        for axes, body in zip(panels, entries.main_bodies, strict=True):
            _rate_panel(axes, entries, body)
        _finish(canvas, panels)
        return canvas

    return _figure(
        "rates", "Contraction of the loops against friction", draw,
        f"Factor by which the residual shrinks per iteration, for the loops of the legend. {NOMINAL} The "
        "thin solid line is the plain loop linearised at the solution (for the 8 contacts the value by hand lies on "
        "it), the dotted one the bound μγ. The horizontal line is 1: above it a loop cannot converge.",
        f"{_FAILED} A loop may have both a mark and a cross: it converges, but not within its limit of iterations.",
    )  # fmt: skip


_RATES: Final = (1e-2, 10.0, 60.0)
"""Lowest rate drawn, beginning of the band, top."""


def _rate_panel(axes: "Axes", entries: Entries, body: tuple[str, int]) -> None:
    _frame(axes, body_name(body), "contraction [-]", *_RATES)
    axes.axhline(1.0, color="black", linewidth=0.8)
    plain = entries.along(body, PLAIN)
    for name, style in (("linearised", "-"), ("sharper", ":")):
        points = [(entry.friction, _theory(entry, name)) for entry in plain]
        known = [(x, y) for x, y in points if y is not None and _RATES[0] < y < _RATES[1]]
        if known:
            label = "plain, linearised" if name == "linearised" else "bound μγ of plain"
            axes.plot(*zip(*known, strict=True), color="black", linestyle=style, linewidth=0.9, label=label)
    for loop in entries.loops:
        if loop != CONDENSED:
            found = entries.along(body, loop)
            rated = [entry for entry in found if entry.rate and entry.rate > _RATES[0]]
            _marks(axes, loop, [(entry.friction, entry.rate or 0.0) for entry in rated])
            _intervals(axes, loop, rated)
            _failures(axes, loop, [entry.friction for entry in found if not entry.solved], _RATES)


def _theory(entry: Entry, name: str) -> float | None:
    value = entry.number(name)
    if name == "sharper":
        return entry.friction / value if value else None
    return value


def _intervals(axes: "Axes", loop: str, rated: Sequence[Entry]) -> None:
    for entry in rated:
        low, high = entry.number("low"), entry.number("high")
        if low and high:
            axes.plot([entry.friction] * 2, [max(low, _RATES[0]), min(high, _RATES[1])], color=LOOPS[loop].colour,
                      linewidth=1.0)  # fmt: skip


_COUNTS: Final = (0.8, 300.0, 1000.0)


def _iterations(entries: Entries) -> Figure:
    def draw() -> "Canvas":
        canvas, panels = _panels(len(entries.main_bodies))
        for axes, body in zip(panels, entries.main_bodies, strict=True):
            _frame(axes, body_name(body), "iterations to 1e-8 [-]", *_COUNTS)
            for loop in entries.loops:
                found = entries.along(body, loop)
                _marks(axes, loop, [(entry.friction, float(entry.iterations)) for entry in found if entry.iterations])
                _failures(axes, loop, [entry.friction for entry in found if not entry.solved], _COUNTS)
        _finish(canvas, panels)
        return canvas

    return _figure(
        "iterations", "Iterations to 1e-8 against friction", draw,
        "Outer iterations until residual and certificate are at 1e-8, each of which solves a convex problem by an "
        "interior point method; for the condensed method all iterations of its only interior point run.",
        _FAILED,
    )  # fmt: skip


_RATIOS: Final = (0.3, 3e3, 1e4)


def _times(entries: Entries) -> Figure:
    def draw() -> "Canvas":
        canvas, panels = _panels(len(entries.main_bodies))
        for axes, body in zip(panels, entries.main_bodies, strict=True):
            _frame(axes, body_name(body), "time over condensed [-]", *_RATIOS)
            axes.axhline(1.0, color="black", linewidth=0.8)
            for loop in entries.loops:
                found = entries.along(body, loop) if loop != CONDENSED else []
                timed = [(entry.friction, ratio) for entry in found if (ratio := entries.ratio(entry)) is not None]
                _marks(axes, loop, timed)
                _failures(axes, loop, [entry.friction for entry in found if not entry.solved], _RATIOS)
        _finish(canvas, panels)
        return canvas

    return _figure(
        "times", "Time of the loops over that of the condensed method", draw,
        "Median wall time of a loop to 1e-8, factorisation included, over that of the condensed method on the same "
        "problem; at the horizontal line both take the same.",
        _FAILED,
    )  # fmt: skip


def _histories(entries: Entries) -> Figure:
    places = shown_places(entries)

    def draw() -> "Canvas":
        canvas, panels = _panels(len(places))
        for axes, place in zip(panels, places, strict=True):
            _history_panel(axes, entries, place)
        _finish(canvas, panels)
        return canvas

    return _figure(
        "histories", "Residuals of the loops", draw,
        "Relative change of the pressure in each outer iteration; of the condensed method the largest of its "
        "residuals and gap. With this axis linear convergence falls ever more steeply, and a cycle is horizontal. The "
        "dashed line is the tolerance.",
        "A curve that ends with a cross has failed: the loop cycles, stalls, or has come to its limit of iterations. "
        "Gaps are iterations whose inner problem has no solution, after which the loop starts anew.",
    )  # fmt: skip


def _history_panel(axes: "Axes", entries: Entries, place: tuple[str, int, float]) -> None:
    axes.set_yscale("log")
    axes.set_xscale("log")
    axes.set_ylim(1e-10, 3.0)
    for axis in (axes.xaxis, axes.yaxis):
        _plain_ticks(axis)
    axes.set_title(f"{body_name(place[:2])}, μ = {place[2]:g}", fontsize=9)
    axes.set_xlabel("iteration [-]")
    axes.set_ylabel("residual [-]")
    axes.axhline(TOLERANCE, color="black", linewidth=0.8, linestyle="--")
    for loop in entries.loops:
        entry = entries.get(place, loop)
        residuals = entry.result.get("residuals", ()) if entry is not None else ()
        if not residuals:
            continue
        look, shown = LOOPS[loop], [max(value, 1e-10) for value in residuals]
        axes.plot(range(1, len(shown) + 1), shown, color=look.colour, linestyle=look.line, linewidth=1.1, label=loop,
                  marker=look.marker, markersize=4, markevery=max(1, len(shown) // 6))  # fmt: skip
        if entry is not None and not entry.solved:
            axes.plot([len(shown)], [shown[-1]], color=look.colour, marker="x", markersize=8, markeredgewidth=2)


def shown_places(entries: Entries) -> list[tuple[str, int, float]]:
    """Of each main problem the middle μ of those the plain loop solves, and of those it does not."""
    shown = []
    for body in entries.main_bodies:
        for solved in (True, False):
            found = [entry.place for entry in entries.along(body, PLAIN) if entry.solved is solved]
            shown += found[len(found) // 2 : len(found) // 2 + 1]
    return shown


def meshes(entries: Entries) -> Figure:
    """Contraction of the plain loop against the mesh."""
    groups = mesh_groups(entries)

    def draw() -> "Canvas":
        problems = list(dict.fromkeys(problem for problem, _ in groups))
        canvas, panels = _panels(max(len(problems), 1))
        for axes, problem in zip(panels, problems, strict=False):
            _mesh_panel(axes, problem, {mu: found for (name, mu), found in groups.items() if name == problem})
        return canvas

    return _figure(
        "mesh", "Contraction of the plain loop against the mesh", draw,
        "Observed contraction (marks, solid) beside the loop linearised at the solution (dotted) on meshes of "
        "different size, a colour and mark for each μ. Horizontal lines are contractions that do not depend on the "
        "mesh.",
        "A mesh on which the loop fails is a cross in the shaded band at the top.",
    )  # fmt: skip


def _mesh_panel(axes: "Axes", problem: str, groups: dict[float, list[Entry]]) -> None:
    _frame(axes, NAMES.get(problem, problem), "contraction [-]", *_RATES)
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("cells a side [-]")
    axes.axhline(1.0, color="black", linewidth=0.8)
    for number, (friction, found) in enumerate(groups.items()):
        colour, marker = _LOOKS[number % len(_LOOKS)]
        rated = [(entry.cells, entry.rate) for entry in found if entry.rate]
        x, y = zip(*rated, strict=True) if rated else ((), ())
        axes.plot(x, y, color=colour, marker=marker, markersize=5, label=f"μ = {friction:g}")
        local = [(entry.cells, value) for entry in found if (value := entry.number("linearised"))]
        if local:
            axes.plot(*zip(*local, strict=True), color=colour, linestyle=":", linewidth=1.0)
        failed = [entry.cells for entry in found if not entry.solved]
        axes.plot(failed, [20.0 * 1.15**number] * len(failed), "x", color=colour, markersize=7, markeredgewidth=2)
    axes.legend(fontsize=7, frameon=False, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.2))  # not over curves


def _panels(number: int) -> tuple["Canvas", list["Axes"]]:
    columns = 2 if number > 1 else 1
    rows = (number + columns - 1) // columns
    canvas = new_figure(_WIDTH, 0.9 + 2.6 * rows)
    grid = canvas.subplots(rows, columns, squeeze=False).ravel().tolist()
    for spare in grid[number:]:
        spare.set_visible(False)
    return canvas, grid[:number]


def _plain_ticks(axis: Any) -> None:
    """Decades as plain numbers: quicker to read, and to draw, than powers of ten."""
    from matplotlib.ticker import NullFormatter

    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _frame(axes: "Axes", title: str, label: str, bottom: float, band: float, top: float) -> None:
    axes.set_yscale("log")
    _plain_ticks(axes.yaxis)
    axes.set_ylim(bottom, top)
    axes.axhspan(band, top, color=GREY, alpha=0.18, linewidth=0)
    axes.text(0.01, 0.985, "fails", transform=axes.transAxes, fontsize=7, va="top", color=GREY)
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("friction μ [-]")
    axes.set_ylabel(label)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)


def _marks(axes: "Axes", loop: str, points: Sequence[tuple[float, float]]) -> None:
    look: Any = LOOPS[loop]
    x, y = zip(*points, strict=True) if points else ((), ())
    axes.plot(x, y, color=look.colour, linestyle=look.line, marker=look.marker, markersize=5, linewidth=1.1,
              label=loop)  # fmt: skip


def _failures(axes: "Axes", loop: str, frictions: Sequence[float], limits: tuple[float, float, float]) -> None:
    """Crosses in the band, each loop at its own height."""
    _, band, top = limits
    share = (1 + list(LOOPS).index(loop)) / (len(LOOPS) + 1)
    axes.plot(frictions, [band * (top / band) ** share] * len(frictions), "x", color=LOOPS[loop].colour, markersize=6,
              markeredgewidth=1.5)  # fmt: skip


def _finish(canvas: "Canvas", panels: Sequence["Axes"]) -> None:
    """One legend for all panels."""
    handles: dict[str, Any] = {}
    for axes in panels:
        handles |= dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    canvas.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, fontsize=8, frameon=False)
