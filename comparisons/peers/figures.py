"""Pictures of a run: errors against costs, and bounds against the mesh."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from comparisons.peers.findings import slug
from comparisons.peers.models import BRACKET, EQUILIBRIUM, MESHES, MODELS, Mesh
from comparisons.peers.points import KINDS, Point, Reference, contradictory
from comparisons.report import Figure, svg_text
from comparisons.report.numbers import listing, scientific
from qvi_contact.plots import GREY, has_matplotlib
from qvi_contact.plots.style import new_figure, settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MIB: Final = 2.0**20
_WIDTH, _PANEL, _LINE = 4.3, 3.0, 0.18  # of a picture, of a panel, of a line of a legend [inch]
_COLUMNS: Final = 2
_BAR: Final = "#dce6f0"
_BESIDE: Final = 0.075  # of a mesh's place, between two marks of the picture of bounds
_MARGIN: Final = 2.0  # factor between the outermost marks and the frame
_UNRESOLVED: Final = 1.0 / 3.0  # of what is resolved: the height of all marks in the grey band
_NARROW: Final = 30.0  # largest over smallest cost, below which powers of ten are too few to label an axis

_GUARANTEED: Final = (
    "Crosses are no errors but what the bracket guarantees of them without any reference: half the distance of its "
    "bounds, for the time, unknowns and memory of stress and displacement together."
)


@dataclass(frozen=True)
class Cost:
    """What an error is drawn against."""

    name: str
    label: str
    of: Callable[[Point], float | None]


COSTS: Final = (
    Cost("unknowns", "unknowns [-]", lambda point: point.unknowns),
    Cost("time", "wall time of set-up and solve, one thread [s]", lambda point: point.seconds),
    Cost("memory", "largest resident memory of the process [MiB]", lambda point: point.peak and point.peak / _MIB),
)


def error_figure(found: Sequence[Point], known: Reference, cost: Cost) -> Figure:
    """Errors of P/2 at one μ against a cost: a panel for each kind of mesh, a curve for each model."""
    here = [point for point in found if point.friction == known.friction]
    name = f"error-{cost.name}-{slug(known.friction)}"
    return Figure(
        name,
        f"Error of P/2 against {cost.name}, μ = {known.friction:g}",
        _drawn(name, here, lambda axes, points: _error_curves(axes, points, known, cost)),
        "Both axes are logarithmic, the heights of the two panels differ; along a curve meshes get finer. Down and to "
        f"the left is better. Errors are relative to {known.value:.6f} MPa × length, {known.source}; in the grey band, "
        f"below {scientific(known.floor)}, nothing is resolved, and marks in it stand at one height."
        + (f" {_GUARANTEED}" if _guaranteed(here) else ""),
        "Runs without a solution have no mark; the table of all runs names them.",
    )


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
        drawn = _drawn(name, here, lambda axes, points: _intervals(axes, points, known))
        reading = (
            "Bars: where P/2 is guaranteed to lie, by stress and displacement on one mesh, up to rounding and the "
            "tolerance of the solves. Marks: the forces of the models on the same mesh, beside the bar. Heights are "
            f"relative to {known.value:.6f} MPa × length, {known.source}, on a scale that is logarithmic on both sides "
            f"and linear within the grey band of ± {scientific(known.floor)}; the heights of the two panels differ. A "
            f"force alone comes without bounds.{doubt}"
        )
        return Figure(name, f"Guaranteed bounds of P/2, μ = {friction:g}", drawn, reading, failure)
    drawn = _drawn(name, here, lambda axes, points: _indicators(axes, points, known))
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


def _drawn(name: str, points: Sequence[Point], draw: Callable[["Axes", Sequence[Point]], None]) -> str:
    """A picture of two panels, one below the other, each with its legend; nothing without matplotlib."""
    if not has_matplotlib():
        return ""
    panels = [(mesh, [point for point in points if point.model.mesh == mesh]) for mesh in MESHES]
    panels = [(mesh, of_mesh) for mesh, of_mesh in panels if of_mesh]
    with settings():
        lines = 1 + max(len({point.model.name for point in of_mesh}) for _, of_mesh in panels) // _COLUMNS
        figure = new_figure(_WIDTH, len(panels) * (_PANEL + _LINE * lines))
        axes = figure.subplots(len(panels), 1, squeeze=False, sharex=True)[:, 0]
        for (mesh, of_mesh), each in zip(panels, axes, strict=True):
            draw(each, of_mesh)
            _finish(each, mesh)
        return svg_text(figure, name)


def _finish(axes: "Axes", mesh: Mesh) -> None:
    axes.set_title(f"{mesh} meshes", fontsize=9)
    axes.xaxis.set_tick_params(labelbottom=True)
    axes.grid(visible=True, which="major", color="#dddddd", linewidth=0.5)
    axes.set_axisbelow(True)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.43, -0.2), ncols=_COLUMNS, fontsize=8,
                frameon=False, columnspacing=1.0)  # fmt: skip


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
            label = _label(model.name) + (": guaranteed" if model.code == BRACKET else "")
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
    cells = sorted({point.cells for point in points})
    place = {each: float(number) for number, each in enumerate(cells)}
    axes.set_yscale("symlog", linthresh=known.floor)
    axes.axhspan(-known.floor, known.floor, color=GREY, alpha=0.2, linewidth=0, label="not resolved")
    for point in points:
        force = point.bounds.force if point.bounds and point.solved else None
        if force is not None:
            low, high = (end / known.value - 1.0 for end in force)
            axes.bar(place[point.cells] - 0.36, high - low, 0.14, low, color=_BAR, edgecolor=point.model.colour,
                     label=f"{_label(point.model.name)}: guaranteed")  # fmt: skip
    models = [model for model in MODELS if model.code != BRACKET and any(p.model == model for p in points)]
    for number, model in enumerate(models):
        forces = {p.cells: p.half_force for p in points if p.model == model and p.solved}
        shown = [(place[n] - 0.22 + _BESIDE * number, f / known.value - 1.0) for n, f in forces.items() if f]
        if shown:
            axes.plot(*zip(*shown, strict=True), color=model.colour, marker=model.marker, linestyle="none",
                      markersize=5, label=_label(model.name))  # fmt: skip
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
    cells = sorted({point.cells for point in points})
    place = {each: float(number) for number, each in enumerate(cells)}
    axes.set_yscale("log")
    for model in MODELS:
        here = [p for p in points if p.model == model and p.solved]
        shown = [(place[p.cells], p.bounds.width) for p in here if p.bounds]
        label = f"{_label(model.name)}: indicator"
        if known is not None and model.code == EQUILIBRIUM:
            shown = [(place[p.cells], max(error, known.floor)) for p in here if (error := known.error(p)) is not None]
            label = "equilibrium: error of P/2"
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


def _label(name: str) -> str:
    """A model's name inside the panel of its mesh."""
    return name.removesuffix(", uniform").removesuffix(", graded")
