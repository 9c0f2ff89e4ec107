"""The report of the plate: its runs as one frame, what an error costs each code, guaranteed intervals, a picture."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from pandas import DataFrame, concat, factorize

from comparisons.lab.drawing import drawn, grid, legend_below, panelled, plain_ticks
from comparisons.lab.numbers import count, fixed, memory, percent, scientific, seconds, significant, span, spread
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, frame_of
from comparisons.peers.study import BRACKET, CODES, MODELS, NGSOLVE, TRIANGLES
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE, UNCERTAINTY
from qvi_contact.plots import BLUE, GREY, VERMILLION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STICKING: Final = 0.25
"""From this μ on the whole contact sticks."""

RESOLUTION: Final = 1e-8
"""Relative: bounds hold up to the tolerance of the solves, so that nothing smaller is resolved by any of them."""

TARGETS: Final = (1e-4, 2e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""Relative errors of P/2 that codes are asked for."""

COARSE: Final = 3e-6
"""The error whose cost is told beside that of the smallest one that is compared."""

NUMBERS: Final = (
    "half_force", "unknowns", "iterations", "residual", "before", "peak", "lower", "upper", "width", "strain_error",
)  # fmt: skip
"""Entries of a result that are numbers; NaN where a run has none."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by μ, model and mesh.

    The columns are those of `frame_of`, where number is the mesh's level, half_force P/2 [N/mm], residual that of the
    code's own check, setup and solve times of the repetitions [s], before and peak the largest resident memory before
    the case and after its first solve [bytes]; and code, a key of `CODES`, run (model and level in words), seconds (the
    smallest sum of both times: what else the machine does can only add to it), spread (the largest less the smallest
    over the median), solved, taken (memory), low and high, guaranteed bounds of P/2 wider by `RESOLUTION`. Of runs that
    are solved, where P/2 is known: floor (what is resolved), error (relative), lasting, confirmed.

    An error that a finer mesh contradicts is small by chance, since forces of contact with friction may cross the right
    value. So lasting is the largest error of the model on this and all finer meshes that are solved; confirmed says
    whether there is a finer one.
    """
    runs = frame_of(rows, NUMBERS, ("setup", "solve", "message", "guaranteed"))
    runs["code"] = [MODELS[name].code for name in runs.model]
    runs["run"] = runs.model + ", level " + runs.number.astype(str)
    runs["message"] = runs.message.where(runs.has, runs.reason)
    times = [
        [sum(pair) for pair in zip(each.setup, each.solve, strict=True)] if each.has else []
        for each in runs.itertuples()
    ]
    runs["seconds"] = [min(each, default=math.nan) for each in times]
    runs["spread"], runs["taken"] = [spread(each) for each in times], runs.peak - runs.before
    runs["solved"] = runs.status == "solved"
    sure = runs.solved & (runs.guaranteed == True)  # noqa: E712 - or missing
    runs["low"], runs["high"] = (
        (runs.lower * (1.0 - RESOLUTION)).where(sure),
        (runs.upper * (1.0 + RESOLUTION)).where(sure),
    )
    runs["first"], runs["order"] = factorize(runs.friction)[0], runs.model.map(list(MODELS).index)
    runs = runs.sort_values(["first", "order", "number"], kind="stable", ignore_index=True)
    value, uncertainty = (runs.friction.map({mu: reference(mu)[place] for mu in runs.friction}) for place in (0, 1))
    runs["floor"], runs["error"] = uncertainty / value, (runs.half_force / value - 1.0).abs().where(runs.solved)
    curves = runs[::-1].groupby(["first", "order"])  # levels fall
    runs["lasting"] = curves.error.cummax()
    finest = runs.number.where(runs.error.notna()).groupby([runs["first"], runs.order]).transform("max")
    return runs.assign(confirmed=runs.number < finest)


def reference(friction: float) -> tuple[float, float, str]:
    """P/2, its uncertainty either way [N/mm], and the source; NaN where it is not known from elsewhere."""
    at = 1.0 if friction >= STICKING else friction
    if at in LIMITS:
        return (*LIMITS[at], LIMITS_SOURCE)
    return (SETTLED[at], UNCERTAINTY, SOURCE) if at in SETTLED else (math.nan, math.nan, "not known")


def intervals_of(runs: DataFrame) -> DataFrame:
    """The narrowest guaranteed interval of P/2 at each μ that has one.

    The columns are those of the runs, half, its half width relative to it, and outside, how many of NGSolve's solved
    forces are, as "5 of 88".
    """
    lines = []
    for friction, sure in runs[runs.low.notna()].groupby("friction", sort=False):
        best = sure.loc[(sure.high - sure.low).idxmin()]
        forces = runs[(runs.friction == friction) & runs.solved & (runs.code == NGSOLVE)].half_force
        outside = int((~forces.between(best.low, best.high)).sum())
        half = 0.5 * (best.high - best.low) / best.low
        lines.append({**best, "half": half, "outside": f"{outside} of {len(forces)}"})
    return DataFrame(lines, columns=[*runs, "half", "outside"])


def costs_of(runs: DataFrame) -> DataFrame:
    """What an error costs triangles, and NGSolve beside them: a line for each μ and target that triangles reach.

    A target is reached by runs whose lasting error is within it, and the uncertainty of the reference counts against
    them. The columns are friction, target, time_ratio (of NGSolve over triangles), and of the quickest run of NGSolve,
    and, named …_own, of triangles, run, seconds, unknowns and confirmed: such runs come before all others.
    """
    key, told = ["friction", "target"], ["run", "seconds", "unknowns", "confirmed"]
    reach = runs.lasting + runs.floor
    found = concat([runs[reach <= target].assign(target=target) for target in TARGETS])
    quick = found.sort_values(["confirmed", "seconds"], ascending=[False, True]).drop_duplicates([*key, "code"])
    quick = quick.sort_values(["first", "target"], ascending=[True, False])
    own, other = (quick[quick.code == code][[*key, *told]] for code in (TRIANGLES, NGSOLVE))
    costs = own.merge(other, on=key, how="left", suffixes=("_own", ""))
    return costs.assign(time_ratio=costs.seconds / costs.seconds_own)


def values_of(runs: DataFrame, costs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences, with what errors cost, see `costs_of`."""
    compared = costs[costs.seconds.notna()]
    least = compared.target.min()
    chance = [*compared.run[compared.confirmed == False], *costs.run_own[~costs.confirmed_own]]  # noqa: E712 - an object
    return {
        "errors": [
            {"target": target, "own": span(each.seconds_own, seconds), "ratios": span(each.time_ratio, _factor)}
            for target in (least, COARSE)[: 2 if least < COARSE else 1]
            if len(each := compared[compared.target == target])
        ],
        "bounds": intervals_of(runs).to_dict("records"), "runs": len(runs), "solved": int(runs.solved.sum()),
        "missing": NGSOLVE not in set(runs.code), "chance": sorted({*chance}),
    }  # fmt: skip


_factor, _force, _first = partial(significant, digits=2), fixed(".7f"), partial(scientific, digits=1)
FORMS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": "{:g}".format, "target": _first, "seconds_own": seconds, "seconds": seconds,
    "setup": lambda times: seconds(min(times, default=None)), "time_ratio": _factor, "unknowns_own": count,
    "unknowns": count, "half_force": _force, "spread": percent, "peak": memory, "taken": memory, "residual": _first,
    "guaranteed": lambda sure: "yes" if sure else "no",
    **dict.fromkeys(("low", "high", "lower", "upper"), _force),
    **dict.fromkeys(("half", "width", "strain_error", "error"), scientific),
}  # fmt: skip
"""Column of a table → how its values read."""


def report(rows: Sequence[Row]) -> Report:
    """The report of these rows; the same rows give the same report."""
    runs = runs_of(rows)
    costs, bracket = costs_of(runs), runs.code == BRACKET
    tables = {
        "costs": costs, "intervals": intervals_of(runs), "failures": runs[~runs.solved], "brackets": runs[bracket],
        "rows": runs[~bracket],
    }  # fmt: skip
    references = [{"μ": f"{mu:g}", "P/2 [N/mm]": _force(value), "±": scientific(uncertainty), "from": source}
                  for mu in runs.friction.unique() for value, uncertainty, source in [reference(mu)]]  # fmt: skip
    values = {
        **values_of(runs, costs), "resolution": RESOLUTION, "floor": runs.floor.max(),
        "frictions": " ".join(f"{friction:g}" for friction in runs.friction.unique()),
        "levels": runs.number.max() + 1, "repeat": rows[0].case["repetitions"],
    }  # fmt: skip
    figures = {"best": drawn("best", partial(_fronts, runs)) if runs.error.notna().any() else ""}
    settings = {"Values that errors are relative to": DataFrame(references)}
    return render("comparisons.peers", "peers", values, tables, figures, rows, settings, forms=FORMS)


_COLOURS: Final = {TRIANGLES: BLUE, BRACKET: GREY, NGSOLVE: VERMILLION}


def _fronts(runs: DataFrame) -> "Figure":
    """A panel for each μ: the best error that each code has over all its models and meshes, against time."""
    groups = list(runs[runs.error.notna()].groupby("friction", sort=False))
    figure, panels = panelled(len(groups), 8.0, 2.9, 0.6)
    for axes, (friction, known) in zip(panels, groups, strict=True):
        for code, about in CODES.items():
            here = known[(known.code == code) & (known.seconds > 0.0)]
            here = here.assign(height=here.lasting.clip(lower=here.floor)).sort_values(["seconds", "height"])
            front = here[here.height < here.height.cummin().shift(fill_value=math.inf)]
            if len(front):
                axes.plot(front.seconds, front.height, color=_COLOURS[code], marker=about.marker, linewidth=1.2,
                          markersize=5, label=about.name)  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="processor time of set-up and solve [s]",
                 ylabel="relative error of P/2 [-]", title=f"μ = {friction:g}")  # fmt: skip
        plain_ticks(axes.xaxis)
        grid(axes)
        axes.set_axisbelow(True)
    legend_below(figure)
    return figure
