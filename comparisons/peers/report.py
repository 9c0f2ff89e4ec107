"""The report on the plate: its runs as one frame, the cost of an error by code, guaranteed intervals, a picture."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

from matplotlib.figure import Figure
from pandas import DataFrame, Series, concat, factorize, to_numeric

from comparisons.lab.drawing import drawn, grid, legend_below, panelled, plain_ticks
from comparisons.lab.numbers import (
    NOTHING,
    count,
    fixed,
    listing,
    memory,
    percent,
    scientific,
    seconds,
    significant,
    span,
    spread,
)  # fmt: skip
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, frame_of
from comparisons.peers.meshes import FAMILIES
from comparisons.peers.study import BRACKET, CODES, MODELS, TRIANGLES
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE, UNCERTAINTY
from qvi_contact.plots.style import BLUE, GREEN, GREY, VERMILLION

INVERTED: Final = "inverted"
"""Status of a bracket whose lower end is above its upper end by more than twice `RESOLUTION`: it proves nothing."""

STICKING: Final = 0.25
"""From this μ on the whole contact sticks."""

RESOLUTION: Final = 1e-8
"""Relative resolution of bounds, which hold up to the tolerance of the solves."""

TARGETS: Final = (1e-4, 2e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""Relative errors of P/2 for which costs are compared."""

COARSE: Final = 3e-6
"""The error in the second finding; the first has the smallest error that is compared."""

OTHERS: Final = ("ngsolve", "getfem")
"""Keys of the codes other than this package."""

NUMBERS: Final = ("half_force", "unknowns", "iterations", "residual", "before", "peak")
"""Entries of a result that are numbers; NaN where a run has none."""

BOUNDS: Final = ("lower", "upper", "width", "strain_error")
"""Entries of a bracket that are numbers, see `codes.own`."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by μ, model and mesh.

    The columns are friction (μ), model, code and mesh (keys of `CODES` and `FAMILIES`), number and label of the mesh,
    run (model and mesh in words), status, message, solved, half_force (P/2) [N/mm], unknowns, iterations, residual of
    the code's own check, setup (the smallest time) [s], seconds (the smallest time of set-up and solve, as other load
    of the machine only adds to it), spread (largest less smallest over median), before and peak (largest resident
    memory before the case and after its first solve) [bytes], version. Brackets have lower, upper, width, strain_error,
    guaranteed, and low and high: guaranteed bounds of P/2, wider by `RESOLUTION`. Solved runs with known P/2 have floor
    (the uncertainty of the reference), error (both relative), lasting and confirmed.

    An error may be small by chance, since the force may cross the right value under refinement. So "lasting" is the
    largest error of the model on this and all finer solved meshes, and "confirmed" says whether there is a finer mesh.
    """
    runs = frame_of(rows, (*NUMBERS, *BOUNDS), ("setup", "solve", "version", "guaranteed"))
    models = [MODELS[name] for name in runs.model]
    setup, solve = ([each if isinstance(each, list) else [] for each in runs[name]] for name in ("setup", "solve"))
    whole = [[*map(sum, zip(*pair, strict=True))] for pair in zip(setup, solve, strict=True)]
    runs = runs.assign(
        code=[each.code for each in models], mesh=[each.mesh for each in models],
        label=[each.family.label(number) for each, number in zip(models, runs.number, strict=True)],
        order=runs.model.map(list(MODELS).index), rank=[list(CODES).index(each.code) for each in models],
        setup=[min(each, default=math.nan) for each in setup], seconds=[min(each, default=math.nan) for each in whole],
        spread=to_numeric(Series(map(spread, whole))), guaranteed=runs.guaranteed == True,  # noqa: E712 - or missing
    )  # fmt: skip
    bracket = (runs.code == BRACKET) & (runs.status == "solved")
    runs[[*BOUNDS]] = runs[[*BOUNDS]].replace([math.inf, -math.inf], math.nan).where(bracket)
    sure = bracket & runs.guaranteed
    runs["low"] = (runs.lower - RESOLUTION * runs.lower.abs()).where(sure & runs.upper.notna())
    runs["high"] = (runs.upper + RESOLUTION * runs.upper.abs()).where(sure & runs.lower.notna())
    inverted = bracket & ((runs.width < -RESOLUTION) | (runs.low > runs.high))
    runs["status"] = runs.status.mask(inverted, INVERTED)
    runs["message"] = runs.message.mask(inverted, runs.width.map(
        "the lower end is above the upper one: half width {:.1e}".format))  # fmt: skip
    runs["run"] = runs.model + ", " + runs.label
    runs["solved"] = runs.status == "solved"
    runs["bounded"] = runs.solved & runs.low.notna()
    runs["first"] = factorize(runs.friction)[0]
    runs = runs.sort_values(["first", "order", "number"], kind="stable", ignore_index=True)
    known = {friction: reference(float(friction)) for friction in runs.friction.unique()}
    value, uncertainty = (
        runs.friction.map({mu: each[place] for mu, each in known.items() if each}) for place in (0, 1)
    )
    runs["floor"], runs["error"] = uncertainty / value, (runs.half_force / value - 1.0).abs().where(runs.solved)
    curves = runs[::-1].groupby(["first", "order"])  # numbers fall
    runs["lasting"] = curves.error.cummax()
    finest = runs.number.where(runs.error.notna()).groupby([runs["first"], runs.order]).transform("max")
    return runs.assign(confirmed=runs.number < finest)


def intervals_of(runs: DataFrame) -> DataFrame:
    """The narrowest guaranteed interval of P/2 at each μ that has one.

    The columns are those of the runs, and for each code of `OTHERS` the number of its solved forces outside, such as
    "5 of 88".
    """
    lines = []
    for friction, sure in runs[runs.bounded].groupby("friction", sort=False):
        best, here = sure.loc[(sure.high - sure.low).idxmin()], runs[(runs.friction == friction) & runs.solved]
        forces = {key: here[here.code == key].half_force for key in OTHERS}
        outside = {key: int((~each.between(best.low, best.high)).sum()) for key, each in forces.items()}
        lines.append({**best, **{key: f"{outside[key]} of {len(each)}" for key, each in forces.items()}})
    return DataFrame(lines, columns=[*runs, *OTHERS])


def contradictory(runs: DataFrame) -> bool:
    """Whether at some μ no value of P/2 is inside all guaranteed bounds, so that at least one is wrong."""
    sure = runs[runs.bounded].groupby("friction")
    return bool((sure.low.max() > sure.high.min()).any())


def reference(friction: float) -> tuple[float, float, str] | None:
    """P/2, its uncertainty either way [N/mm], and the source, where it is known from elsewhere."""
    at = 1.0 if friction >= STICKING else friction
    if at in LIMITS:
        return (*LIMITS[at], LIMITS_SOURCE)
    return (SETTLED[at], UNCERTAINTY, SOURCE) if at in SETTLED else None


def costs_of(runs: DataFrame) -> DataFrame:
    """The cost of each error: a line for each μ, target and code that reaches it.

    A run reaches a target if its lasting error plus the uncertainty of the reference is within it. The columns are
    friction, target, code, run (the quickest; runs that a finer mesh confirms come first), seconds, unknowns, sure
    (whether a finer mesh confirms the run), and time_ratio, over triangles.
    """
    key = ["friction", "target", "code"]
    reach = runs.lasting + runs.floor
    found = concat([runs[reach <= target].assign(target=target) for target in TARGETS])
    quick = found.sort_values(["confirmed", "seconds"], ascending=[False, True]).drop_duplicates(key)
    quick = quick.sort_values(["first", "target", "rank"], ascending=[True, False, True])
    costs = quick.rename(columns={"confirmed": "sure"})[[*key, "run", "seconds", "unknowns", "sure"]]
    own = costs[costs.code == TRIANGLES][[*key[:2], "seconds", "unknowns"]]
    costs = costs.merge(own, on=key[:2], how="left", suffixes=("", "_own"))
    return costs.assign(time_ratio=costs.seconds / costs.seconds_own)


def compared_of(costs: DataFrame) -> DataFrame:
    """Triangles beside the quickest of the other codes: a line for each μ and target that both reach."""
    others = costs[costs.code.isin(OTHERS) & costs.seconds_own.notna()]
    return others.sort_values("seconds", kind="stable").drop_duplicates(["friction", "target"]).sort_index()


def values_of(runs: DataFrame, costs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences; `costs` are those of `costs_of`."""
    compared, failed = compared_of(costs), runs[~runs.solved]
    return {
        "fine": _compared(compared, compared.target.min()),
        "coarse": _compared(compared, COARSE if compared.target.min() < COARSE else math.nan),
        "bounds": intervals_of(runs).to_dict("records"), "doubtful": contradictory(runs),
        "runs": len(runs), "solved": int(runs.solved.sum()),
        "failing": listing([f"{number} of {CODES[code].name}" for code, number in failed.code.value_counts().items()]),
        "missing": [key for key in CODES if key not in set(runs.code)],
        "chance": sorted({*costs[~costs.sure].run}),
    }  # fmt: skip


def _compared(compared: DataFrame, target: float) -> dict[str, Any] | None:
    """Costs of one error over all μ at which triangles and another code reach it."""
    found = compared[compared.target == target]
    return None if found.empty else {
        "target": target, "own": span(found.seconds_own, seconds), "ratios": span(found.time_ratio, _factor),
    }  # fmt: skip


def _factor(value: float) -> str:
    """A ratio of times, to two digits."""
    return significant(value, 2)


_force, _first = fixed(".7f"), partial(scientific, digits=1)
FORMS: Final[Mapping[str, Callable[[Any], str]]] = {
    "friction": "{:g}".format, "code": lambda key: CODES[key].name, "time_ratio": _factor, "spread": percent,
    **dict.fromkeys(("seconds_own", "seconds", "setup"), seconds), **dict.fromkeys(("unknowns_own", "unknowns"), count),
    **dict.fromkeys(("peak", "before"), memory), **dict.fromkeys(("target", "residual"), _first),
    **dict.fromkeys(("half_force", "value", "low", "high", "lower", "upper"), _force),
    **dict.fromkeys(("uncertainty", "half", "width", "strain_error", "error"), scientific),
    "sure": lambda sure: "yes" if sure else "no", "message": lambda text: text or NOTHING,
}  # fmt: skip
"""Column of a table → how its values read."""


def tables_of(runs: DataFrame, costs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name; `costs` is that of `costs_of`."""
    shown = runs.assign(
        half=0.5 * (runs.high - runs.low) / runs.low,
        sure=runs.guaranteed & runs.solved, lower=runs.lower.where(runs.guaranteed),
        upper=runs.upper.where(runs.guaranteed),
    )  # fmt: skip
    bracket = shown.code == BRACKET
    known = [(mu, *found) for mu in runs.friction.unique() if (found := reference(float(mu)))]
    models = runs.sort_values("order", kind="stable").groupby("model", sort=False).agg(
        code=("code", "first"), before=("before", "median"),
        version=("version", lambda said: ", ".join(sorted({*said.dropna()} - {""}))),
    ).reset_index()  # fmt: skip
    options = [MODELS[name].options.items() for name in models.model]
    models["options"] = [", ".join(f"{option} = {value}" for option, value in each) for each in options]
    return {
        "references": DataFrame(known, columns=["friction", "value", "uncertainty", "source"]),
        "models": models.replace("", None),
        "compared": compared_of(costs), "intervals": intervals_of(shown), "failures": shown[~shown.solved],
        "costs": costs, "brackets": shown[bracket], "rows": shown[~bracket],
    }  # fmt: skip


def report(rows: Sequence[Row]) -> Report:
    """The report, a function of the rows only."""
    runs = runs_of(rows)
    costs = costs_of(runs)
    # the command that repeats the study, without paths of files and interpreters
    counted = runs.mesh.isin([name for name, family in FAMILIES.items() if family.counted])
    words = ["python -m comparisons peers --friction", *(f"{friction:g}" for friction in runs.friction.unique())]
    words += ["--cells", *map(str, sorted(set(runs.number[counted])))] if counted.any() else []
    words += [f"--levels {max(runs.number[~counted]) + 1}"] if not counted.all() else []
    words += [f"--repeat {rows[0].case['repetitions']}"]
    values = {
        **values_of(runs, costs), "resolution": RESOLUTION, "codes": CODES, "command": " ".join(words),
        "floor": runs.floor.max(),
    }  # fmt: skip
    figures = {"best": drawn("best", partial(_fronts, runs)) if runs.error.notna().any() else ""}
    return render("comparisons.peers", "peers", values, tables_of(runs, costs), figures, rows,
                  forms=FORMS, failed=contradictory(runs))  # fmt: skip


_COLOURS: Final = {TRIANGLES: BLUE, BRACKET: GREY, "ngsolve": VERMILLION, "getfem": GREEN}


def _fronts(runs: DataFrame) -> Figure:
    """A panel for each μ: the smallest error of each code over all models and meshes, against time."""
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
