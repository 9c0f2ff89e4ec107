"""The runs as one frame, the values that errors are relative to, what an error costs each code, and told numbers."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from pandas import DataFrame, concat, factorize, to_numeric

from comparisons.lab.ratios import spread
from comparisons.lab.report.numbers import listing, scientific, seconds, significant, span
from comparisons.lab.study import DONE, Row
from comparisons.peers.models import BRACKET, CODES, NAMED, TRIANGLES
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE, UNCERTAINTY

SOLVED: Final = "solved"

INVERTED: Final = "inverted"
"""Status of a bracket whose lower end is above its upper one by more than twice `RESOLUTION`: it proves nothing."""

STICKING: Final = 0.25
"""From this μ on the whole contact sticks."""

RESOLUTION: Final = 1e-8
"""Relative: bounds hold up to the tolerance of the solves, so that nothing smaller is resolved by any of them."""

TARGETS: Final = (1e-4, 2e-5, 3e-6, 1e-6, 1e-7, 1e-8)
"""Relative errors of P/2 that codes are asked for."""

COARSE: Final = 3e-6
"""The error whose cost is told beside that of the smallest one that is compared."""

OTHERS: Final = ("ngsolve", "getfem")
"""Keys of the codes that are not this package's."""

NUMBERS: Final = ("half_force", "unknowns", "iterations", "residual", "before", "peak")
"""Entries of a result that are numbers; NaN where a run has none."""

BOUNDS: Final = ("lower", "upper", "width", "strain_error")
"""The same of a bracket, see `codes.equilibrium`."""


class Reference(NamedTuple):
    """P/2 at one μ lies within value ± uncertainty [N/mm], by this source."""

    value: float
    uncertainty: float
    source: str

    @property
    def floor(self) -> float:
        """The same uncertainty, relative: errors below it are not resolved."""
        return self.uncertainty / abs(self.value)


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by μ, model and mesh.

    The columns are friction (μ), model, code and mesh (keys of `CODES` and `FAMILIES`), number and label of the mesh,
    run (model and mesh in words), toward (whether meshes are graded to the transition), status, message, solved,
    half_force (P/2) [N/mm], unknowns, iterations, residual of the code's own check, setup and solve (times of the
    repetitions) [s], seconds (the smallest sum of both: what else the machine does can only add to it), spread (the
    largest less the smallest over the median), before and peak (largest resident memory before the case and after its
    first solve) [bytes], version; of brackets lower, upper, width, strain_error, guaranteed, kind, and low and high:
    guaranteed bounds of P/2, wider by `RESOLUTION`. Of runs that are solved, where P/2 is known: floor (what is
    resolved), error (relative), lasting, confirmed.

    An error that a finer mesh contradicts is small by chance, since forces of contact with friction may cross the right
    value. So lasting is the largest error of the model on this and all finer meshes that are solved; confirmed says
    whether there is a finer one.
    """
    runs = DataFrame([_run(row) for row in sorted(rows, key=lambda row: row.position)])
    for name in (*NUMBERS, *BOUNDS, "seconds", "spread", "low", "high"):
        runs[name] = to_numeric(runs[name]).replace([math.inf, -math.inf], math.nan)
    runs["solved"] = runs.status == SOLVED
    runs["bounded"] = runs.solved & runs.low.notna()
    runs["first"] = factorize(runs.friction)[0]
    runs = runs.sort_values(["first", "order", "number"], kind="stable", ignore_index=True)
    return _with_errors(runs, known_of(runs))


def _run(row: Row) -> dict[str, Any]:
    model, number = NAMED[row.case["model"]], row.case["number"]
    result = row.result if row.status == DONE else {"status": row.status, "message": row.reason}
    times = {name: tuple(result.get(name, ())) for name in ("setup", "solve")}
    whole = [sum(pair) for pair in zip(times["setup"], times["solve"], strict=True)]
    run = {
        "friction": row.case["friction"], "model": model.name, "code": model.code, "mesh": model.mesh, "number": number,
        "label": model.family.label(number), "run": f"{model.name}, {model.family.label(number)}",
        "toward": model.family.to_transition, "order": list(NAMED).index(model.name),
        "rank": list(CODES).index(model.code), "status": result["status"], "message": result["message"],
        **{name: result.get(name) for name in NUMBERS}, **times,
        "seconds": min(whole, default=None), "spread": spread(whole), "version": result.get("version"),
        **dict.fromkeys((*BOUNDS, "kind", "low", "high")), "guaranteed": False,
    }  # fmt: skip
    return run | _bounds(result) if model.code == BRACKET and result["status"] == SOLVED else run


def _bounds(result: Any) -> dict[str, Any]:
    """What a bracket says, and its status if its ends are in the wrong order."""
    found = {name: result[name] for name in (*BOUNDS, "kind", "guaranteed")}
    ends = [end for end in (found["lower"], found["upper"]) if end is not None and math.isfinite(end)]
    known, inverted = "", found["width"] < -RESOLUTION
    if found["guaranteed"] and len(ends) == 2:
        lower, upper = ends
        found |= {"low": lower - RESOLUTION * abs(lower), "high": upper + RESOLUTION * abs(upper)}
        known, inverted = f", P/2 from {lower:.7f} to {upper:.7f} N/mm", inverted or found["low"] > found["high"]
    if inverted:
        text = f"the lower end is above the upper one: half width {scientific(found['width'])}{known}"
        found |= {"status": INVERTED, "message": text}
    return found


def guaranteed(runs: DataFrame) -> DataFrame:
    """The brackets that bound P/2, the narrowest first."""
    sure = runs[runs.bounded]
    return sure.assign(gap=sure.high - sure.low).sort_values("gap", kind="stable")


def intervals_of(runs: DataFrame) -> DataFrame:
    """The narrowest guaranteed interval of P/2 at each μ that has one.

    The columns are those of the runs, and for each code of `OTHERS` how many of its solved forces are outside, as
    "5 of 88".
    """
    lines = []
    for _, here in by_friction(runs):
        sure = guaranteed(here)
        if sure.empty or contradictory(here):
            continue
        best = sure.iloc[0]
        forces = {key: here[(here.code == key) & here.solved].half_force for key in OTHERS}
        outside = {key: int((~each.between(best.low, best.high)).sum()) for key, each in forces.items()}
        lines.append({**best, **{key: f"{outside[key]} of {len(each)}" for key, each in forces.items()}})
    return DataFrame(lines, columns=[*runs, *OTHERS])


def beside_of(here: DataFrame) -> DataFrame:
    """The guaranteed intervals at one μ beside other codes, in the order of the study.

    The columns are those of the runs, and for each code of `OTHERS` the best of its forces with no more unknowns than
    the interval, that with the smallest error, NaN if there is none.
    """
    beside = here[here.bounded]
    for key in OTHERS:
        forces = here[(here.code == key) & here.solved].sort_values("unknowns", kind="stable")
        best = forces[forces.error < forces.error.cummin().shift(fill_value=math.inf)]
        places = best.unknowns.searchsorted(beside.unknowns, side="right")  # 0 where all have more
        beside = beside.assign(**{key: np.append(math.nan, best.half_force)[places]})
    return beside


def contradictory(runs: DataFrame) -> bool:
    """Whether no value of P/2 is inside all guaranteed bounds of these runs at one μ, so that some are wrong."""
    sure = runs[runs.bounded]
    return bool(sure.low.max() > sure.high.min())


def known_of(runs: DataFrame) -> dict[float, Reference]:
    """μ → the value that errors are relative to, where one is known."""
    found = {float(friction): reference(here, float(friction)) for friction, here in by_friction(runs)}
    return {friction: each for friction, each in found.items() if each is not None}


def by_friction(runs: DataFrame) -> list[tuple[Any, DataFrame]]:
    """μ → its runs, in the order of the study."""
    return list(runs.groupby("friction", sort=False))


def reference(here: DataFrame, friction: float) -> Reference | None:
    """The limit or value that is known from elsewhere, or the narrowest guaranteed bounds of these runs if narrower.

    Bounds that contradict each other are not taken.
    """
    known, at = [], 1.0 if friction >= STICKING else friction
    if at in LIMITS:
        known.append(Reference(*LIMITS[at], LIMITS_SOURCE))
    elif at in SETTLED:
        known.append(Reference(SETTLED[at], UNCERTAINTY, SOURCE))
    for run in [] if contradictory(here) else guaranteed(here).itertuples():
        source = f"the guaranteed bounds of {run.run}"
        known.append(Reference((run.low + run.high) / 2.0, (run.high - run.low) / 2.0, source))
    return min(known, key=lambda each: each.uncertainty, default=None)


def _with_errors(runs: DataFrame, known: dict[float, Reference]) -> DataFrame:
    runs["floor"] = runs.friction.map({friction: each.floor for friction, each in known.items()})
    value = runs.friction.map({friction: each.value for friction, each in known.items()})
    runs["error"] = (runs.half_force / value - 1.0).abs().where(runs.solved)
    curves = runs[::-1].groupby(["first", "order"])  # numbers fall
    runs["lasting"] = curves.error.cummax()
    finest = runs.number.where(runs.error.notna()).groupby([runs["first"], runs.order]).transform("max")
    runs["confirmed"] = runs.number < finest
    return runs


def costs_of(runs: DataFrame) -> DataFrame:
    """What each code needs for an error: a line for each μ, target and code that reaches it.

    A target is reached by runs whose lasting error is within it, and the uncertainty of the reference counts against
    them. The columns are friction, target, code, quickest (run), seconds, smallest (run with the fewest unknowns),
    unknowns, sure (the quickest is confirmed) and sure_smallest; time_ratio and unknowns_ratio are over triangles. Runs
    that a finer mesh confirms come before all others.
    """
    key = ["friction", "target", "code"]
    reach = runs.lasting + runs.floor
    found = concat([runs[reach <= target].assign(target=target) for target in TARGETS])
    quick = found.sort_values(["confirmed", "seconds"], ascending=[False, True]).drop_duplicates(key)
    small = found.sort_values(["confirmed", "unknowns", "seconds"], ascending=[False, True, True]).drop_duplicates(key)
    quick = quick.sort_values(["first", "target", "rank"], ascending=[True, False, True])
    quick = quick.rename(columns={"run": "quickest", "confirmed": "sure"})[[*key, "quickest", "seconds", "sure"]]
    small = small.rename(columns={"run": "smallest", "confirmed": "sure_smallest"})
    costs = quick.merge(small[[*key, "smallest", "unknowns", "sure_smallest"]], on=key)
    own = costs[costs.code == TRIANGLES][["friction", "target", "seconds", "unknowns"]]
    costs = costs.merge(own, on=["friction", "target"], how="left", suffixes=("", "_own"))
    return costs.assign(
        time_ratio=costs.seconds / costs.seconds_own, unknowns_ratio=costs.unknowns / costs.unknowns_own
    )


def compared_of(costs: DataFrame) -> DataFrame:
    """Triangles beside the best of the other codes: a line for each μ and target that both reach.

    The quickest other code (code, seconds) and the one with the fewest unknowns (smallest_code, unknowns) may be two.
    """
    key = ["friction", "target"]
    others = costs[costs.code.isin(OTHERS) & costs.seconds_own.notna()]
    small = others.sort_values("unknowns", kind="stable").drop_duplicates(key).rename(columns={"code": "smallest_code"})
    quick = others.sort_values("seconds", kind="stable").drop_duplicates(key).sort_index()
    return quick[[*key, "seconds_own", "seconds", "code", "time_ratio"]].merge(
        small[[*key, "unknowns_own", "unknowns", "smallest_code", "unknowns_ratio"]], on=key
    )


def least_of(runs: DataFrame) -> DataFrame:
    """The run of each code at each μ with the smallest lasting error that a finer mesh confirms."""
    sure = runs[runs.confirmed & runs.lasting.notna()].sort_values("lasting", kind="stable")
    return sure.drop_duplicates(["first", "code"]).sort_values(["first", "rank"])


def at_most(error: float, floor: float) -> float:
    """What an error is at most, as far as is known: one that is not resolved has the uncertainty of the reference."""
    return error if error > floor else error + floor


def slug(friction: float) -> str:
    """μ inside the name of a table or figure."""
    return f"mu-{friction:g}".replace(".", "_")


def missing(runs: DataFrame) -> list[str]:
    """Keys of the codes that are not in the run, since they were not installed."""
    return [key for key in CODES if key not in set(runs.code)]


def values_of(runs: DataFrame, costs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences, with what errors cost, see `costs_of`."""
    compared, least = compared_of(costs), least_of(runs)
    triangles = least[least.code == TRIANGLES]
    reached = [at_most(run.lasting, run.floor) for run in triangles.itertuples()]
    failed = runs[~runs.solved]
    sure = {friction: guaranteed(here) for friction, here in by_friction(runs)}
    doubtful = [friction for friction, here in by_friction(runs) if contradictory(here)]
    return {
        "fine": _compared(compared, compared.target.min()),
        "coarse": _compared(compared, COARSE if compared.target.min() < COARSE else math.nan),
        "triangles": max(reached, default=None),
        "bounds": [{"friction": friction, "name": slug(friction), **found.iloc[0]} for friction, found in sure.items()
                   if len(found) and friction not in doubtful],
        "doubtful": [{"friction": friction, "count": len(sure[friction])} for friction in doubtful],
        "runs": len(runs), "solved": int(runs.solved.sum()),
        "failing": listing([f"{number} of {CODES[code].name}" for code, number in failed.code.value_counts().items()]),
        "missing": missing(runs),
        "chance": sorted({*costs[~costs.sure].quickest, *costs[~costs.sure_smallest].smallest}),
    }  # fmt: skip


def _compared(compared: DataFrame, target: float) -> dict[str, Any] | None:
    """Costs of one error over all μ at which triangles and another code reach it."""
    found = compared[compared.target == target]
    if found.empty:
        return None
    return {
        "target": target, "own": span(found.seconds_own, seconds), "ratios": span(found.time_ratio, factor),
        "unknowns": span(found.unknowns_ratio, factor),
    }  # fmt: skip


def factor(value: float) -> str:
    """How many times as much."""
    return significant(value, 2)
