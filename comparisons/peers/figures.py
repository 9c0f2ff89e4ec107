"""Pictures of a run: errors against costs, and bounds against the mesh."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from pandas import DataFrame

from comparisons.lab.report.drawing import drawn, grid
from comparisons.peers.measures import OTHERS, Reference, by_friction, slug
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.models import BRACKET, CODES, NAMED, TRIANGLES, Code, Model
from qvi_contact.plots import BLUE, GREEN, GREY, ORANGE, VERMILLION
from qvi_contact.plots.style import PURPLE, SKY, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _PANEL, _LINE = 5.2, 3.2, 0.18  # of a picture, of a panel, of a line of a legend [inch]
_COLUMNS: Final = 2
_BAR: Final = "#dce6f0"
_BESIDE: Final = 0.075  # of a mesh's place, between two marks of the picture of bounds
_MARGIN: Final = 2.0  # factor between the outermost marks and the frame
_UNRESOLVED: Final = 1.0 / 3.0  # of what is resolved: the height of all marks in the grey band
_NARROW: Final = 30.0  # largest over smallest cost, below which powers of ten are too few to label an axis

COLOURS: Final[Mapping[str, str]] = {
    "black": "#000000", "blue": BLUE, "green": GREEN, "orange": ORANGE, "purple": PURPLE, "sky": SKY,
    "vermillion": VERMILLION,
}  # fmt: skip
"""What models and codes call their colours → the colours that all can tell apart."""

Panels = list[tuple[str, Any]]
"""Title of each panel of a picture, and the runs in it."""


class Cost(NamedTuple):
    """What an error is drawn against: a column of the runs, and the label of its axis."""

    name: str
    column: str
    label: str


COSTS: Final = (
    Cost("unknowns", "unknowns", "unknowns [-]"),
    Cost("time", "seconds", "processor time of set-up and solve [s]"),
)


def figures(runs: DataFrame, known: Mapping[float, Reference]) -> dict[str, str]:
    """Name → picture; empty where matplotlib is not installed."""
    return {name: drawn(name, draw) for name, draw in plots_of(runs, known).items()}


def plots_of(runs: DataFrame, known: Mapping[float, Reference]) -> "dict[str, Callable[[], Figure]]":
    """Name of a picture → what draws it.

    For each μ at which P/2 is known, and some error, those of errors against costs: the best that each code has over
    all its models and meshes, and all, a panel for each kind of grading and a curve for each model. For each with
    brackets, what these say on each mesh; for each with guaranteed bounds, intervals beside the forces of all codes.
    """
    found: dict[str, Callable[[], Figure]] = {}
    for friction, here in by_friction(runs):
        name, value = slug(friction), known.get(friction)
        for cost in COSTS if here.error.notna().any() else ():
            found[f"best-{cost.name}-{name}"] = partial(_panels, [("", here)], partial(_fronts, cost=cost))
            found[f"error-{cost.name}-{name}"] = partial(_panels, by_grading(here), partial(_error_curves, cost=cost))
        families = by_family(here)
        if any((each.solved & each.width.notna()).any() for _, each in families):
            found[f"bounds-{name}"] = partial(_panels, families, partial(_bounds, known=value), shared=False)
        if value is not None and here.bounded.any():
            found[f"intervals-{name}"] = partial(_panels, [("", here)], partial(_beside_others, known=value))
    return found


def by_grading(runs: DataFrame) -> Panels:
    """Runs on equal cells or graded to the corner, and on meshes graded to corner and transition."""
    titles = {False: "equal cells, or graded to the free corner", True: "graded to corner and transition"}
    return [(title, here) for kind, title in titles.items() if len(here := runs[runs.toward == kind])]


def by_family(runs: DataFrame) -> Panels:
    """Runs on each family of meshes that codes share and on which something is bracketed."""
    families = [mesh for mesh in runs[runs.code == BRACKET].mesh.unique() if not FAMILIES[mesh].own]
    return [(f"{family} meshes", runs[runs.mesh == family]) for family in families]


def _panels(panels: Panels, draw: "Callable[[Axes, DataFrame], None]", *, shared: bool = True) -> "Figure":
    """Panels one below the other, each with its legend, with one axis below or an axis each."""
    lines = 1 + max(here.model.nunique() for _, here in panels) // _COLUMNS
    figure = new_figure(_WIDTH, len(panels) * (_PANEL + _LINE * lines))
    axes = figure.subplots(len(panels), 1, squeeze=False, sharex=shared)[:, 0]
    for (title, here), each in zip(panels, axes, strict=True):
        draw(each, here)
        _finish(each, title)
    return figure


def _finish(axes: "Axes", title: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.xaxis.set_tick_params(labelbottom=True)
    grid(axes)
    axes.set_axisbelow(True)
    handles, labels = axes.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))  # bars come one by one
    axes.legend(named.values(), named, loc="upper center", bbox_to_anchor=(0.43, -0.17), ncols=_COLUMNS, fontsize=7,
                frameon=False, columnspacing=1.0)  # fmt: skip


def _fronts(axes: "Axes", runs: DataFrame, cost: Cost) -> None:
    """For each code its costs in ascending order, where the error falls."""
    known = runs[runs.error.notna()]
    for code, about in CODES.items():
        here = known[(known.code == code) & (known[cost.column] > 0.0)]
        here = here.assign(height=here.lasting.clip(lower=here.floor)).sort_values([cost.column, "height"])
        front = here[here.height < here.height.cummin().shift(fill_value=math.inf)]
        if len(front):
            axes.plot(front[cost.column], front.height, **_look(about), linewidth=1.2, markersize=5, label=about.name)
    _error_axes(axes, known, cost)


def _error_curves(axes: "Axes", runs: DataFrame, cost: Cost) -> None:
    """A curve for each model that has an error, and the band in which errors mean nothing."""
    from matplotlib.ticker import NullFormatter

    shown, floor = runs.assign(height=heights(runs)), runs.floor.iloc[0]
    shown = shown[shown.height.notna() & (shown[cost.column] > 0.0)]
    for name, here in shown.groupby("model", sort=False):
        model = NAMED[str(name)]
        label = _label(model.name) + (": guaranteed" if model.code == BRACKET else "")
        axes.plot(here[cost.column], here.height, **_look(model), linestyle=model.line, markersize=6, linewidth=1.2,
                  label=label)  # fmt: skip
    least, most = min(shown.height, default=floor), max(shown.height, default=floor)
    if least < 10.0 * floor:
        _band(axes, floor / 10.0, floor)
        least = _MARGIN * floor / 10.0
    axes.set_ylim(least / _MARGIN, _MARGIN * most)
    _error_axes(axes, shown, cost)
    axes.xaxis.set_minor_formatter(NullFormatter())


def _error_axes(axes: "Axes", runs: DataFrame, cost: Cost) -> None:
    """Errors against a cost, both logarithmic; labels at 1, 2 and 5 times powers of ten where others were few."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    axes.set(xscale="log", yscale="log", xlabel=cost.label, ylabel="relative error of P/2 [-]")
    costs = runs[cost.column]
    if len(costs) and max(costs) < _NARROW * min(costs):
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _band(axes: "Axes", low: float, high: float) -> None:
    axes.axhspan(low, high, color=GREY, alpha=0.2, linewidth=0, label="not resolved")


def _look(of: Code | Model) -> dict[str, Any]:
    """Colour and marker of a curve."""
    return {"color": COLOURS[of.colour], "marker": of.marker}


def heights(runs: DataFrame) -> Any:
    """Errors, and half the distances of guaranteed bounds; what is not resolved is inside the band."""
    value = runs.error.fillna(runs.width.where(runs.bounded))
    return value.where(value.isna() | (value > runs.floor), _UNRESOLVED * runs.floor)


def _bounds(axes: "Axes", runs: DataFrame, known: Reference | None) -> None:
    """What brackets say on each mesh: intervals of P/2 and the codes' values, or an indicator."""
    if known is not None and runs.bounded.any():
        _intervals(axes, runs, known)
    else:
        _indicators(axes, runs)


def _intervals(axes: "Axes", runs: DataFrame, known: Reference) -> None:
    """A bar for each mesh, and beside it what the models say."""
    cells = sorted(set(runs.number))
    place = {each: float(number) for number, each in enumerate(cells)}
    axes.set_yscale("symlog", linthresh=known.floor)
    _band(axes, -known.floor, known.floor)
    for run in runs[runs.bounded].itertuples():
        low, high = (end / known.value - 1.0 for end in (run.lower, run.upper))
        axes.bar(place[run.number] - 0.36, high - low, 0.14, low, color=_BAR,
                 edgecolor=COLOURS[NAMED[run.model].colour], label=f"{_label(run.model)}: guaranteed")  # fmt: skip
    others = runs[(runs.code != BRACKET) & runs.solved & runs.half_force.notna()]
    for number, (name, here) in enumerate(others.groupby("model", sort=False)):
        model = NAMED[str(name)]
        axes.plot([place[each] - 0.22 + _BESIDE * number for each in here.number], here.half_force / known.value - 1.0,
                  **_look(model), linestyle="none", markersize=5, label=_label(model.name))  # fmt: skip
    _mesh_axis(axes, runs)
    _difference_axis(axes, runs, known)


def _beside_others(axes: "Axes", runs: DataFrame, known: Reference) -> None:
    """Guaranteed intervals, each narrower than those of fewer unknowns, and the forces of all models of all codes."""
    axes.set_xscale("log")
    axes.set_yscale("symlog", linthresh=known.floor)
    _band(axes, -known.floor, known.floor)
    for code in (*OTHERS, TRIANGLES):
        about, here = CODES[code], runs[(runs.code == code) & runs.solved]
        if len(here):
            axes.plot(here.unknowns, here.half_force / known.value - 1.0, **_look(about), linestyle="none",
                      markersize=4, markerfacecolor="none", label=about.name)  # fmt: skip
    sure = runs[runs.bounded].sort_values("unknowns")
    sure = sure[sure.width < sure.width.cummin().shift(fill_value=math.inf)]
    ends = [sure.low / known.value - 1.0, sure.high / known.value - 1.0]
    axes.vlines(sure.unknowns, *ends, color=COLOURS["black"], linewidth=3, alpha=0.6, label="guaranteed interval")
    axes.set_xlabel(COSTS[0].label)
    _difference_axis(axes, runs[runs.code.isin((*OTHERS, TRIANGLES, BRACKET))], known)


def _difference_axis(axes: "Axes", runs: DataFrame, known: Reference) -> None:
    bottom, top = limits(runs, known)
    axes.set_ylim(bottom, top)
    axes.set_yticks(ticks(bottom, top, known.floor))
    axes.set_yticks([], minor=True)
    axes.set_ylabel("P/2, relative difference [-]")


def limits(runs: DataFrame, known: Reference) -> tuple[float, float]:
    """Bottom and top of a picture of intervals: all bars and marks are between them, and so is the grey band."""
    sure = runs[runs.bounded]
    ends = [*sure.lower, *sure.upper, *runs.half_force[runs.solved].dropna()]
    heights = [end / known.value - 1.0 for end in ends]
    return _MARGIN * min(-known.floor, *heights), _MARGIN * max(known.floor, *heights)


def ticks(bottom: float, top: float, floor: float) -> list[float]:
    """Zero, and powers of ten on both sides that are well outside the grey band, so that labels do not meet."""
    powers = range(math.ceil(math.log10(3.0 * floor)), math.floor(math.log10(max(top, -bottom))) + 1)
    chosen = [10.0**power for power in powers]
    return [0.0, *(each for each in chosen if each <= top), *(-each for each in chosen if -each >= bottom)]


def _indicators(axes: "Axes", runs: DataFrame) -> None:
    """The width of the energies on each mesh, and the error of P/2 where it is known."""
    cells = sorted(set(runs.number))
    axes.set_yscale("log")
    for name, here in runs[runs.solved].groupby("model", sort=False):
        model = NAMED[str(name)]
        height = here.width if model.code == BRACKET else here.error.clip(lower=here.floor)
        if model.code == BRACKET and height.notna().any():
            label = f"{_label(model.name)}: {'indicator' if model.code == BRACKET else 'error of P/2'}"
            axes.plot([cells.index(each) for each in here.number], height, **_look(model),
                      linestyle=model.line, markersize=6, linewidth=1.2, label=label)  # fmt: skip
    _mesh_axis(axes, runs)
    axes.set_ylabel("relative [-]")


def _mesh_axis(axes: "Axes", runs: DataFrame) -> None:
    """The meshes of one family, the coarsest first."""
    numbers = sorted(set(runs.number))
    counted = FAMILIES[runs.mesh.iloc[0]].counted
    axes.set_xticks(range(len(numbers)), [f"{each}²" if counted else f"{each}" for each in numbers])
    axes.set(xlim=(-0.6, len(numbers) - 0.4), xlabel="cells [-]" if counted else "level [-]")


def _label(name: str) -> str:
    """A model's name in a legend, where the symmetric variant is that which is not named."""
    return name.replace(", symmetric", "")
