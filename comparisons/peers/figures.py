"""Pictures of a run: errors against costs, and bounds against the mesh."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from comparisons.lab.report import svg_text
from comparisons.lab.report.numbers import listing, scientific
from comparisons.lab.report.old import Figure
from comparisons.peers.findings import slug
from comparisons.peers.models import BRACKET, CODES, EQUILIBRIUM, MODELS, Model
from comparisons.peers.points import KINDS, Point, Reference, contradictory
from comparisons.peers.reach import errors_at, lasting_error
from qvi_contact.plots import GREY, has_matplotlib
from qvi_contact.plots.style import new_figure, settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_WIDTH, _PANEL, _LINE = 5.2, 3.2, 0.18  # of a picture, of a panel, of a line of a legend [inch]
_COLUMNS: Final = 2
_BAR: Final = "#dce6f0"
_BESIDE: Final = 0.075  # of a mesh's place, between two marks of the picture of bounds
_MARGIN: Final = 2.0  # factor between the outermost marks and the frame
_UNRESOLVED: Final = 1.0 / 3.0  # of what is resolved: the height of all marks in the grey band
_NARROW: Final = 30.0  # largest over smallest cost, below which powers of ten are too few to label an axis

_GUARANTEED: Final = (
    "Crosses are no errors but what the bracket guarantees of them without any reference: half the distance of its "
    "bounds, for the time and unknowns of stress and displacement together."
)


Panels = list[tuple[str, list[Point]]]
"""Title of each panel of a picture, and the points in it."""


@dataclass(frozen=True)
class Cost:
    """What an error is drawn against."""

    name: str
    bound: str
    label: str
    of: Callable[[Point], float | None]


COSTS: Final = (
    Cost("unknowns", "number of unknowns", "unknowns [-]", lambda point: point.unknowns),
    Cost("time", "time", "processor time of set-up and solve [s]", lambda point: point.seconds),
)


def error_figure(found: Sequence[Point], known: Reference, cost: Cost) -> Figure:
    """Errors of P/2 at one μ against a cost: a panel for each kind of grading, a curve for each model."""
    here = [point for point in found if point.friction == known.friction]
    name = f"error-{cost.name}-{slug(known.friction)}"
    return Figure(
        name,
        f"Error of P/2 against {cost.name}, μ = {known.friction:g}",
        _drawn(name, by_grading(here), lambda axes, points: _error_curves(axes, points, known, cost)),
        "Both axes are logarithmic, the heights of the two panels differ; along a curve meshes get finer. Down and to "
        f"the left is better. Errors are relative to {known.value:.6f} MPa × length, {known.source}; in the grey band, "
        f"below {scientific(known.floor)}, nothing is resolved, and marks in it stand at one height."
        + (f" {_GUARANTEED}" if _guaranteed(here) else ""),
        "Runs without a solution have no mark; the table of all runs names them.",
    )


def best_figure(found: Sequence[Point], known: Reference, cost: Cost) -> Figure:
    """The best that each code has for its cost, over all its models and meshes."""
    name = f"best-{cost.name}-{slug(known.friction)}"
    panels = [("", [point for point in found if point.friction == known.friction])]
    return Figure(
        name,
        f"The best error of each code against {cost.name}, μ = {known.friction:g}",
        _drawn(name, panels, lambda axes, points: _fronts(axes, points, known, cost)),
        f"Of all models of a code the smallest error of P/2 within each {cost.bound}. An error counts for a mesh only "
        "if no finer mesh of the same model has a larger one. Both axes are logarithmic; down and left is better. "
        f"Errors are relative to {known.value:.7f} MPa × length, {known.source}; below "
        f"{scientific(known.floor)} nothing is resolved.",
    )  # fmt: skip


def bounds_figure(found: Sequence[Point], known: Reference | None, friction: float) -> Figure:
    """What brackets say on each mesh: intervals of P/2 and the codes' values, or an indicator."""
    here = [point for point in found if point.friction == friction]
    name = f"bounds-{slug(friction)}"
    failure = (
        "Beyond rounding and the tolerance of the solves, a mark of the equilibrium model, or of the companion of the "
        "bracket's degree, outside the bar of its mesh. Brackets without a solution or with the lower end above the "
        "upper one have no bar; the table of failures names them."
    )
    doubt = " These bounds contradict each other: something is wrong." if contradictory(here, friction) else ""
    if known is not None and _guaranteed(here):
        drawn = _drawn(name, by_family(here), lambda axes, points: _intervals(axes, points, known))
        reading = (
            "Bars: where P/2 is guaranteed to lie, by stress and displacement on one mesh, up to rounding and the "
            "tolerance of the solves. Marks: the forces of the models on the same mesh, beside the bar. Heights are "
            f"relative to {known.value:.6f} MPa × length, {known.source}, on a scale that is logarithmic on both sides "
            f"and linear within the grey band of ± {scientific(known.floor)}; the heights of the two panels differ. A "
            f"force alone comes without bounds.{doubt}"
        )
        return Figure(name, f"Guaranteed bounds of P/2, μ = {friction:g}", drawn, reading, failure)
    drawn = _drawn(name, by_family(here), lambda axes, points: _indicators(axes, points, known))
    reading = (
        f"{doubt.strip() or 'P has no guaranteed bounds.'} Crosses: half the gap of the energies over their mean, "
        f"for {_kinds(here)}; an indicator, not a bound. Circles: the error of P/2 by the equilibrium model, not below "
        "what is resolved. The heights of the two panels differ."
    )
    return Figure(name, f"Indicator of the bracket, μ = {friction:g}", drawn, reading)


def _kinds(points: Sequence[Point]) -> str:
    """What is bracketed."""
    return listing(list(dict.fromkeys(KINDS[point.bounds.kind] for point in points if point.bounds)))


def _guaranteed(points: Sequence[Point]) -> bool:
    """Whether P has guaranteed bounds somewhere."""
    return any(point.solved and point.bounds and point.bounds.force for point in points)


def by_grading(points: Sequence[Point]) -> Panels:
    """Points on equal cells or graded to the corner, and on meshes graded to corner and transition."""
    titles = {False: "equal cells, or graded to the free corner", True: "graded to corner and transition"}
    panels = [(title, [p for p in points if p.model.family.to_transition == kind]) for kind, title in titles.items()]
    return [(title, here) for title, here in panels if here]


def by_family(points: Sequence[Point]) -> Panels:
    """Points on each family of meshes on which something is bracketed."""
    families = dict.fromkeys(point.model.mesh for point in points if point.model.code == BRACKET)
    return [(f"{family} meshes", [p for p in points if p.model.mesh == family]) for family in families]


def _drawn(name: str, panels: Panels, draw: Callable[["Axes", Sequence[Point]], None]) -> str:
    """A picture of panels, one below the other, each with its legend; nothing without matplotlib."""
    if not has_matplotlib() or not panels:
        return ""
    with settings():
        lines = 1 + max(len({point.model.name for point in here}) for _, here in panels) // _COLUMNS
        figure = new_figure(_WIDTH, len(panels) * (_PANEL + _LINE * lines))
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for (title, here), each in zip(panels, axes, strict=True):
            draw(each, here)
            _finish(each, title)
        return svg_text(figure, name)


def _finish(axes: "Axes", title: str) -> None:
    axes.set_title(title, fontsize=9)
    axes.xaxis.set_tick_params(labelbottom=True)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
    axes.set_axisbelow(True)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.43, -0.17), ncols=_COLUMNS, fontsize=7,
                frameon=False, columnspacing=1.0)  # fmt: skip


def _fronts(axes: "Axes", points: Sequence[Point], known: Reference, cost: Cost) -> None:
    """For each code its costs in ascending order, where the error falls."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    rows = errors_at(points, known)
    for code, about in CODES.items():
        here = [point for point, _ in rows if point.model.code == code]
        pairs = [(x, max(lasting_error(rows, point), known.floor)) for point in here if (x := cost.of(point))]
        front: list[tuple[float, float]] = []
        for place, error in sorted(pairs):
            if not front or error < front[-1][1]:
                front.append((place, error))
        if front:
            axes.plot(*zip(*front, strict=True), color=about.colour, marker=about.marker, linewidth=1.2, markersize=5,
                      label=about.name)  # fmt: skip
    _label_closely(axes, [x for point, _ in rows if (x := cost.of(point))])
    axes.set_xlabel(cost.label)
    axes.set_ylabel("relative error of P/2 [-]")


def _error_curves(axes: "Axes", points: Sequence[Point], known: Reference, cost: Cost) -> None:
    """A curve for each model that has an error, and the band in which errors mean nothing."""
    from matplotlib.ticker import NullFormatter

    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    heights = [height for point in points if (height := _height(point, known))]
    for model in MODELS:
        pairs = [(cost.of(p), _height(p, known)) for p in points if p.model == model]
        shown = [(x, y) for x, y in pairs if x and y]
        if shown:
            label = _label(model) + (": guaranteed" if model.code == BRACKET else "")
            axes.plot(*zip(*shown, strict=True), color=model.colour, marker=model.marker, linestyle=model.line,
                      markersize=6, linewidth=1.2, label=label)  # fmt: skip
    least, most = min(heights, default=known.floor), max(heights, default=known.floor)
    if least < 10.0 * known.floor:
        axes.axhspan(known.floor / 10.0, known.floor, color=GREY, alpha=0.2, linewidth=0, label="not resolved")
        least = _MARGIN * known.floor / 10.0
    axes.set_ylim(least / _MARGIN, _MARGIN * most)
    _label_closely(axes, [x for point in points if (x := cost.of(point)) and _height(point, known)])
    axes.set_xlabel(cost.label)
    axes.set_ylabel("relative error of P/2 [-]")


def _label_closely(axes: "Axes", costs: Sequence[float]) -> None:
    """Labels at 1, 2 and 5 times powers of ten where there would be few others."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    if costs and max(costs) < _NARROW * min(costs):
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _height(point: Point, known: Reference) -> float | None:
    """The error, or half the distance of guaranteed bounds; what is not resolved is inside the band."""
    value = known.error(point)
    if point.bounds is not None:
        value = point.bounds.width if point.solved and point.bounds.force else None
    return None if value is None else value if value > known.floor else _UNRESOLVED * known.floor


def _intervals(axes: "Axes", points: Sequence[Point], known: Reference) -> None:
    """A bar for each mesh, and beside it what the models say."""
    cells = sorted({point.number for point in points})
    place = {each: float(number) for number, each in enumerate(cells)}
    axes.set_yscale("symlog", linthresh=known.floor)
    axes.axhspan(-known.floor, known.floor, color=GREY, alpha=0.2, linewidth=0, label="not resolved")
    for point in points:
        force = point.bounds.force if point.bounds and point.solved else None
        if force is not None:
            low, high = (end / known.value - 1.0 for end in force)
            axes.bar(place[point.number] - 0.36, high - low, 0.14, low, color=_BAR, edgecolor=point.model.colour,
                     label=f"{_label(point.model)}: guaranteed")  # fmt: skip
    models = [model for model in MODELS if model.code != BRACKET and any(p.model == model for p in points)]
    for number, model in enumerate(models):
        forces = {p.number: p.half_force for p in points if p.model == model and p.solved}
        shown = [(place[n] - 0.22 + _BESIDE * number, f / known.value - 1.0) for n, f in forces.items() if f]
        if shown:
            axes.plot(*zip(*shown, strict=True), color=model.colour, marker=model.marker, linestyle="none",
                      markersize=5, label=_label(model))  # fmt: skip
    _mesh_axis(axes, cells)
    bottom, top = _limits(points, known)
    axes.set_ylim(bottom, top)
    axes.set_yticks(_ticks(bottom, top, known.floor))
    axes.set_yticks([], minor=True)
    axes.set_ylabel("P/2, relative difference [-]")
    _name_once(axes)


def _limits(points: Sequence[Point], known: Reference) -> tuple[float, float]:
    """Bottom and top of a picture of intervals: all bars and marks are between them, and so is the grey band."""
    ends = [end for p in points if p.solved and p.bounds and p.bounds.force for end in p.bounds.force]
    ends += [p.half_force for p in points if p.solved and p.half_force is not None]
    heights = [end / known.value - 1.0 for end in ends]
    return _MARGIN * min(-known.floor, *heights), _MARGIN * max(known.floor, *heights)


def _ticks(bottom: float, top: float, floor: float) -> list[float]:
    """Zero, and powers of ten on both sides that are well outside the grey band, so that labels do not meet."""
    powers = range(math.ceil(math.log10(3.0 * floor)), math.floor(math.log10(max(top, -bottom))) + 1)
    chosen = [10.0**power for power in powers]
    return [0.0, *(each for each in chosen if each <= top), *(-each for each in chosen if -each >= bottom)]


def _indicators(axes: "Axes", points: Sequence[Point], known: Reference | None) -> None:
    """The width of the energies on each mesh, and the error of P/2 where it is known."""
    cells = sorted({point.number for point in points})
    place = {each: float(number) for number, each in enumerate(cells)}
    axes.set_yscale("log")
    for model in MODELS:
        here = [p for p in points if p.model == model and p.solved]
        shown = [(place[p.number], p.bounds.width) for p in here if p.bounds]
        label = f"{_label(model)}: indicator"
        if known is not None and model.code == EQUILIBRIUM:
            shown = [(place[p.number], max(error, known.floor)) for p in here if (error := known.error(p)) is not None]
            label = f"{_label(model)}: error of P/2"
        if shown:
            axes.plot(*zip(*shown, strict=True), color=model.colour, marker=model.marker, linestyle=model.line,
                      markersize=6, linewidth=1.2, label=label)  # fmt: skip
    _mesh_axis(axes, cells)
    axes.set_ylabel("relative [-]")


def _mesh_axis(axes: "Axes", cells: Sequence[int]) -> None:
    axes.set_xticks(range(len(cells)), [f"{each}²" for each in cells])
    axes.set_xlim(-0.6, len(cells) - 0.4)
    axes.set_xlabel("cells [-]")


def _name_once(axes: "Axes") -> None:
    """Each label once in the legend: bars come one by one."""
    seen: set[str] = set()
    for container in axes.containers:
        if container.get_label() in seen:
            container.set_label("_")
        seen.add(str(container.get_label()))


def _label(model: Model) -> str:
    """A model's name in a legend, where the symmetric variant is that which is not named."""
    return model.name.replace(", symmetric", "")
