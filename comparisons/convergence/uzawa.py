r"""How the paper's iteration converges: steps on a grid, limits, meshes, other methods; and the report.

Steps are shares of two limits of `linearised`, both for all points with a bound above zero:

    ω_T* = 2 / λ_max(Θ^(−1/2) Ĉ_TT Θ^(−1/2)),    ω_N* = 2 / λ_max(Ĉ_NN)

A run *settles* if in its last quarter the resultant normal force stays within `NEAR` of the condensed method's and the
multipliers change by less than `STILL` of the largest one per iteration. Beyond their limit steps never do: the changes
go on for ever.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame, Series, to_numeric

from comparisons.convergence.bodies import PLACE, Reference, ending, in_words, plain_certificate, reference, timed
from comparisons.convergence.linearised import first_lasting, growth_order
from comparisons.lab.drawing import LOOKS, drawn, grid, legend_below, plain_ticks, powers_of_two
from comparisons.lab.numbers import NOTHING, count, fixed, listing, percent, scientific, seconds, significant, span
from comparisons.lab.reports import Form, Report, crossed, render
from comparisons.lab.studies import Row, Study, frame_of, largest_of
from comparisons.paper.reference import load
from comparisons.paper.study import SHRINKING
from qvi_contact.plots.style import new_figure
from solvers import QVISolution, solve_qvi

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

MOST: Final = 20_000
"""Iterations of Uzawa at most."""

METHODS: Final[Mapping[str, Mapping[str, Any]]] = {
    "Uzawa": {"method": "uzawa", "max_iterations": MOST},
    "Uzawa, shrinking step": {"method": "uzawa", "max_iterations": MOST, "step_decay": SHRINKING, "decay": "harmonic"},
    "fixed point, QP": {"method": "fixed-point", "inner": "qp:clarabel"},
    "fixed point, SOCP": {"method": "fixed-point", "inner": "socp:clarabel"},
    "condensed": {"method": "condensed"},
}
"""Name → options of `solve_qvi`, in the order of tables."""

HALF: Final = 0.5
"""Steps of runs that are not about steps, as a share of the limits."""


HALF_OPEN: Final = ("half open", 0, 0.3)
SLIDING: Final = ("sliding", 0, 0.0)
"""The problems without a mesh, see `bodies`: ω_N matters in the one, in the other ω_T* is known by hand."""

ACCURACY: Final = (("plate", 2, 0.1), ("plate", 2, 0.0), ("plate", 16, 0.1), ("plate", 16, 0.2), ("ssnv128", 8, 1.0))
"""(Problem, cells, μ) of the comparison at equal accuracy."""


def study(quick: bool) -> Study:
    """The study, or coarse meshes of it."""
    return Study("convergence-uzawa", 3, "comparisons.convergence.uzawa:run", [*_cases(quick)])


def _cases(quick: bool) -> Iterator[dict[str, Any]]:
    """All cases: the paper's run, maps of both steps, searches for their limits, meshes, and other methods.

    Steps are shares of the limits, powers of √2 rounded so that they mean the same on every machine, and None where a
    run finds or has its own. ω_N hardly matters on the plate.
    """

    def case(run: str, place: tuple[str, int, float], **settings: Any) -> dict[str, Any]:
        return {"run": run, "place": place, "tangential": None, "normal": None, "target": None, **settings}

    def plates(*cells: int) -> list[tuple[str, int, float]]:
        return [("plate", number, mu) for number in cells for mu in ((0.1,) if quick else (0.05, 0.1, 0.2))]

    maps, limits, meshes = (
        (plates(2), plates(2, 4), plates(2, 4, 8)) if quick
        else (plates(2, 8, 16), plates(2, 4, 8, 16, 32), plates(2, 4, 8, 16, 32))
    )  # fmt: skip
    steps = tuple(round(2.0 ** (power / 2.0), 6) for power in (range(-2, 3) if quick else range(-6, 5)))
    few = (HALF, 1.0) if quick else (HALF, 1.0, 2.0)
    yield from (case("paper", ("plate", load().cells, mu)) for mu in ((0.0, 0.1, 0.3) if quick else load().table))
    for place, normal_steps in [*((place, few) for place in maps), (HALF_OPEN, steps)]:
        for normal in normal_steps:
            yield from (case("map", place, tangential=step, normal=normal) for step in steps)
    yield from (case("tangential limit", place, normal=HALF) for place in (SLIDING, HALF_OPEN, *limits))
    yield from (case("normal limit", place, tangential=HALF) for place in (HALF_OPEN, limits[-1]))
    yield from (case("mesh", place, tangential=HALF, normal=HALF) for place in meshes)
    for place, method in product(ACCURACY[:1] if quick else ACCURACY, METHODS):
        targets = (1e-2, 1e-4) if quick else (1e-2, 1e-4, 1e-6, 1e-8)
        yield from (case(method, place, target=target) for target in targets)


ITERATIONS: Final = 2000
"""Of a run of the map and of the search for limits."""

LONG: Final = 20_000
"""Of a run on a mesh."""

TARGETS: Final = (1e-2, 1e-3, 1e-4, 1e-6)
"""Relative errors of the normal force of which it is noted when they are reached for good."""

NEAR: Final = 1e-3
STILL: Final = 1e-3

SEARCHED: Final = (0.25, 16.0)
"""Shares of the limit between which the observed one is searched."""

_BISECTIONS: Final = 7
_SHOWN: Final = 400  # iterations of the paper's run that are kept one by one

Record = dict[str, Any]


def run(case: Mapping[str, Any]) -> Record:
    """Task of the study: Uzawa with given steps, the largest steps it bears, the paper's run, or another method.

    Returns
    -------
    dict
        status, message, iterations : how the (last) run ended
        certificate : see `plain_certificate`
        omega_T, omega_N : steps [length], [length/stress]; units of the problem
        limit_T, limit_N : ω_T* and ω_N* in the same units; None where no point has a bound above zero
        slipping_T, open_N : the limits for slipping and for open points alone; None where there are none
        linearised : contraction at the solution for these steps
        and what the single runs of this module add

    """
    known = reference(*case["place"])
    kind = METHODS.get(case["run"])
    found = _RUNS[case["run"]](case, known) if kind is None else _accuracy(case, known)
    return {**found, **_limits(known)}


def _limits(known: Reference) -> Record:
    """Limits of the steps by theory, in the problem's units."""
    local, unit = known.local, known.body
    compliance = unit.displacement / unit.stress
    limit_T, limit_N = local.limits
    return {
        "limit_T": _times(limit_T, unit.displacement),
        "slipping_T": _times(local.tangential_limit(), unit.displacement),
        "limit_N": _times(limit_N, compliance), "open_N": _times(local.normal_limit(), compliance),
        "condition": local.condition(), "slipping": int(local.slipping.sum()), "open": int(local.open.sum()),
        "points": len(local.open), "force": unit.force * abs(known.resultant),
    }  # fmt: skip


def _times(value: float | None, unit: float) -> float | None:
    return None if value is None else value * unit


def _steps(known: Reference, tangential: float, normal: float) -> tuple[float, float]:
    """(ω_T, ω_N), dimensionless, from shares of the limits."""
    limit_T, limit_N = known.local.limits
    if not limit_T or limit_N is None:
        raise ArithmeticError("no point has a bound above zero: there is no limit that a step could be a share of")
    return tangential * limit_T, normal * limit_N


def _march(known: Reference, omega_T: float, omega_N: float, iterations: int, **options: Any) -> QVISolution:
    """So many iterations."""
    settings = {"omega_T": omega_T, "omega_N": omega_N, "iterations": iterations, **options}
    return solve_qvi(known.body.qvi, method="uzawa", tolerance=1e-8, **settings)


def _course(known: Reference, solution: QVISolution) -> Record:
    """What a run of a given number of iterations did."""
    numbers = [entry.number for entry in solution.history]
    errors = np.array([abs(entry.normal_resultant / known.resultant - 1.0) for entry in solution.history])
    changes = np.array([entry.residual for entry in solution.history])
    last = np.array(numbers) > 0.75 * numbers[-1]
    error, change = float(errors[last].max()), float(np.median(changes[last]))
    return {
        **ending(solution), "last_error": error, "last_change": change,
        "settles": bool(error <= NEAR and change <= STILL),
        "needed": {f"{target:.0e}": first_lasting(errors.tolist(), numbers, target) for target in TARGETS},
    }  # fmt: skip


def _given(known: Reference, omega_T: float, omega_N: float) -> Record:
    """Steps in the problem's units, and the linearised contraction."""
    unit = known.body
    return {
        "omega_T": omega_T * unit.displacement, "omega_N": omega_N * unit.displacement / unit.stress,
        "linearised": known.local.uzawa_contraction(omega_T, omega_N),
    }  # fmt: skip


def _map(case: Mapping[str, Any], known: Reference) -> Record:
    """One pair of steps."""
    steps = _steps(known, case["tangential"], case["normal"])
    count = LONG if case["run"] == "mesh" else ITERATIONS
    return {**_course(known, _march(known, *steps, count)), **_given(known, *steps)}


def _limit(case: Mapping[str, Any], known: Reference) -> Record:
    """The largest share of the limit with which runs settle, by bisection in its logarithm.

    Adds "largest" and "smallest", the largest share found that settles and the smallest that does not, None where all
    shares of `SEARCHED` do the same, and "foreseen", the largest share for which the iteration linearised at the
    solution contracts. The rest is about the run with the first.
    """

    def steps_of(share: float) -> tuple[float, float]:
        tangential, normal = case["tangential"], case["normal"]
        return _steps(known, *((share, normal) if tangential is None else (tangential, share)))

    trials: dict[float | None, tuple[Record, tuple[float, float]]] = {}

    def settles(share: float) -> bool:
        trials[share] = _course(known, _march(known, *steps_of(share), ITERATIONS)), steps_of(share)
        return bool(trials[share][0]["settles"])

    low, high = SEARCHED
    largest, smallest = (high, None) if settles(high) else (None, low) if not settles(low) else _bisected(settles)
    found, steps = trials[smallest if largest is None else largest]

    def contracts(share: float) -> bool:
        return known.local.uzawa_contraction(*steps_of(share)) < 1.0

    foreseen = _bisected(contracts, 2 * _BISECTIONS)[0] if contracts(low) and not contracts(high) else None
    return {**found, **_given(known, *steps), "largest": largest, "smallest": smallest, "foreseen": foreseen}


def _bisected(holds: Callable[[float], bool], count: int = _BISECTIONS) -> tuple[float, float]:
    """The largest share of `SEARCHED` for which something is seen to hold, and the smallest for which it is not."""
    low, high = SEARCHED
    for _ in range(count):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def _paper(case: Mapping[str, Any], known: Reference) -> Record:
    """The run of the paper, and what it would have been with more iterations.

    Adds P/2 as "printed" in the paper, after its iterations by the accumulating rule ("after") and by the printed one
    ("after_printed_rule"), of the solution ("force"), tractions' largest error over the mean pressure ("tractions"),
    and the relative error of P/2 after each iteration ("errors").
    """
    paper = load()
    steps = (paper.omega_T / known.body.displacement, (known.local.limits[1] or 1.0) / 2.0)
    after, as_printed = (_march(known, *steps, paper.iterations, rule=rule) for rule in ("accumulating", "printed"))
    long = _march(known, *steps, ITERATIONS)
    qvi, unit = known.body.qvi, known.body.force
    exact = np.concatenate([qvi.normal(known.solution.z), qvi.tangential(known.solution.z)])
    found = np.concatenate([qvi.normal(after.z), qvi.tangential(after.z)])
    mean = abs(known.resultant) / float(qvi.W.sum())
    bonded = qvi.resultant(qvi.bonded)
    return {
        **_course(known, long), **_given(known, *steps),
        "printed": paper.table[case["place"][2]],
        "after": -unit * qvi.resultant(after.z), "after_printed_rule": -unit * qvi.resultant(as_printed.z),
        "before": abs(bonded / known.resultant - 1.0),
        "tractions": float(np.abs(found - exact).max()) / mean,
        "errors": [abs(entry.normal_resultant / known.resultant - 1.0) for entry in long.history[:_SHOWN]],
        "after_certificate": plain_certificate(after),
    }  # fmt: skip


def _accuracy(case: Mapping[str, Any], known: Reference) -> Record:
    """Solve until the certificate confirms the target.

    Adds "seconds", wall times of repeated solves, factorisation included, and "last_error" of the normal force. Uzawa
    takes half its limits as steps, and where ω_T* is zero, as without friction, the paper's.
    """
    options = dict(METHODS[case["run"]])
    given: Record = {"omega_T": None, "omega_N": None, "linearised": None}
    if options["method"] == "uzawa":
        limit_T, limit_N = known.local.limits
        paper = load().omega_T / known.body.displacement
        steps = limit_T / 2.0 if limit_T else paper, (limit_N or 2.0) / 2.0
        options |= {"omega_T": steps[0], "omega_N": steps[1]}
        given = _given(known, *steps)
    solution, seconds = timed(case["place"], tolerance=case["target"], **options)
    error = abs(solution.problem.resultant(solution.z) / known.resultant - 1.0)
    return {**ending(solution), **given, "seconds": seconds, "last_error": error}


_RUNS: Final[Mapping[str, Callable[[Mapping[str, Any], Reference], Record]]] = {
    "map": _map, "mesh": _map, "tangential limit": _limit, "normal limit": _limit, "paper": _paper,
}  # fmt: skip


SOON: Final = "to 1e-04"
"""Iterations until the normal force is within 1e-4 for good."""

_NUMBERS: Final = (
    "tangential", "normal", "target", "omega_T", "omega_N", "limit_T", "limit_N", "slipping_T", "open_N", "linearised",
    "condition", "open", "points", "force", "iterations", "settles", "last_error", "last_change", "largest", "smallest",
    "foreseen", "printed", "after", "after_printed_rule", "before", "tractions",
)  # fmt: skip
"""Columns that are numbers, NaN where a run has none; see `run`."""

_TARGETS: Final = tuple(f"to {target:.0e}" for target in TARGETS)

_LAST_DIGIT: Final = 0.00501  # of P/2: half of the last digit printed, and rounding


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh and μ.

    The columns are those of `frame_of` and `in_words`, the place as problem, cells (0 without a mesh), friction, and
    where (the three in words), and "to 1e-02" and so on, iterations to that error for good.
    """
    runs = frame_of(rows, _NUMBERS, ("seconds", "needed", "errors"))
    for place, name in enumerate(PLACE):
        runs[name] = runs.place.str[place]
    runs["friction"] = runs.friction.astype(float)
    runs = in_words(runs)
    runs["where"] = runs.body + runs.friction.map(", μ = {:g}".format)
    for name in _TARGETS:
        runs[name] = to_numeric(runs.needed.str.get(name.removeprefix("to ")))
    return runs.sort_values(PLACE, kind="stable", ignore_index=True)


def of(runs: DataFrame, *names: str) -> DataFrame:
    """The runs of these names that have a result."""
    return runs[runs.run.isin(names) & runs.has]


def _quickest(maps: DataFrame) -> Series:
    """By problem, mesh and μ: iterations to 1e-4 of the quickest pair of steps that settles."""
    return maps[maps.settles == 1].groupby(PLACE)[SOON].min()


def paper_runs(runs: DataFrame) -> DataFrame:
    """The paper's runs, with the quickest one of the map of the same problem beside them."""
    maps, found = of(runs, "map"), of(runs, "paper")
    found = found.join(_quickest(maps).rename("quickest"), on=PLACE)
    return found.assign(
        error=(found.after / found.force - 1.0).abs(), share=found.omega_T / found.limit_T,
        factor=found[SOON] / found.quickest,
    )  # fmt: skip


def searches_of(runs: DataFrame) -> DataFrame:
    """Searches for the largest step, with shares of 2 / λ_max over all points."""
    found = of(runs, "tangential limit", "normal limit").copy()
    tangential = found.run == "tangential limit"
    found["step"] = tangential.map({True: "ω_T", False: "ω_N"})
    found["limit"] = found.limit_T.where(tangential, found.limit_N)
    found["part"] = found.slipping_T.where(tangential, found.open_N) / found.limit
    found["observed"] = found.omega_T.where(tangential, found.omega_N)
    return found


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    paper, two = load(), partial(significant, digits=2)
    found, searches, equal, maps = paper_runs(runs), searches_of(runs), of(runs, *METHODS), of(runs, "map")
    rough, smooth = found[found.friction > 0.0], found[found.friction == 0.0]
    sliding = rough[rough.linearised > 0.0]
    met = {name: int(((found[name] - found.printed).abs() < _LAST_DIGIT).sum())
           for name in ("after", "after_printed_rule")}  # fmt: skip
    plate = searches[(searches.step == "ω_T") & (searches.problem == "plate")]
    both, exact = plate[plate.largest.notna() & plate.smallest.notna()], searches[searches.problem == "sliding"]
    local = both.largest / both.foreseen
    half = maps[(maps.tangential == HALF) & (maps.normal == HALF)].set_index(PLACE)[SOON]
    saved, counts = (half / _quickest(maps)).dropna(), {name: equal[equal.run == name] for name in METHODS}
    return {
        # after the paper's iterations: errors, what the step costs, how many printed values are met
        "worst": largest_of(rough.error, rough), "tractions": rough.tractions.max(), "frictions": len(rough),
        "needed": span(rough[SOON][rough[SOON] > paper.iterations]), "sliding": len(sliding),
        "shares": span(sliding.share, percent), "rates": span(sliding.linearised),
        "powers": span(sliding.linearised**paper.iterations, two), "quickest": span(sliding["quickest"]),
        "factors": span(sliding.factor, two), "printed": len(found), "accumulating": met["after"],
        "as_printed": met["after_printed_rule"], "smooth": largest_of(smooth.last_error, smooth),
        # observed limits of ω_T on the plate beside the two of theory, and the one known by hand
        "searches": len(plate), "safe": int((plate.largest >= 1.0).sum()), "largest": span(both.largest),
        "foreseen": int(local.notna().sum()), "early": int((both.smallest < both.foreseen).sum()),
        "local": span(local.dropna()), "beyond": int((local > 1.0).sum()),
        "sliding_limit": largest_of(exact.largest, exact),
        # how many targets each method meets, how much the best steps save, and finer meshes
        "targets": {name: (int((each.status == "solved").sum()), len(each)) for name, each in counts.items()},
        "saved": span(saved[saved.index.isin(equal.set_index(PLACE).index)]),
        "slow": int(of(runs, "mesh")["to 1e-06"].isna().sum()), "meshes": len(of(runs, "mesh")),
        "orders": span(growth(runs).order, lambda order: f"{-order:.2f}".replace("-", "−")),
        "iterations": paper.iterations, "omega": paper.omega_T, "half": HALF, "failed": int((~runs.has).sum()),
        "steps": ITERATIONS, "long": LONG, "longest": MOST, "searched": SEARCHED, "near": NEAR, "still": STILL,
        "methods": METHODS,
    }  # fmt: skip


def growth(runs: DataFrame) -> DataFrame:
    """For each μ: how iterations to 1e-4 and the condition grow with the cells a side, and where ω_T is too long."""
    searches, lines = searches_of(runs), []
    for friction, found in of(runs, "mesh").sort_values("cells").groupby("friction"):
        bounded = searches[(searches.step == "ω_T") & (searches.problem == "plate") & (searches.friction == friction)]
        short = bounded[bounded.smallest.notna() & (bounded.observed < load().omega_T)]
        lines.append({
            "friction": friction, "order": growth_order(found.cells, found[SOON]),
            "growth": growth_order(found.cells, found.condition), "most": found[SOON].max(),
            "beyond": listing([f"{cells}²" for cells in short.cells]),
        })  # fmt: skip
    return DataFrame(lines, columns=["friction", "order", "growth", "most", "beyond"])


def _power(order: float | None) -> str:
    """Of a quantity that grows like (cells a side)^order: "h^−1.50"."""
    return NOTHING if order is None or order != order else f"h^{'−' if order >= 0.0 else ''}{abs(order):.2f}"


FORMS: Final[Mapping[str, Form]] = {
    "friction": fixed("g"), "seconds": seconds, "accuracy": scientific,
    **dict.fromkeys(("printed", "after", "after_printed_rule", "force"), fixed(".2f")),
    **dict.fromkeys(("before", "error", "tractions"), partial(percent, digits=2)),
    **dict.fromkeys((*_TARGETS, "quickest", "open", "iterations", "most"), count),
    **dict.fromkeys(("factor", "share"), partial(significant, digits=2)),
    **dict.fromkeys(("condition", "linearised", "smallest", "foreseen", "part", "best"), significant),
    **dict.fromkeys(("limit", "observed", "omega_T"), partial(scientific, digits=3)),
    "target": partial(scientific, digits=1), **dict.fromkeys(("order", "growth"), _power),
}  # fmt: skip
"""Column of a table → how its numbers read."""


def tables_of(runs: DataFrame) -> dict[str, DataFrame]:
    """The tables by name; "settles" is the largest step that does, ">" where no share searched fails."""
    equal, searches = of(runs, *METHODS), searches_of(runs)
    settles = [NOTHING if good != good else f"{'> ' if bad != bad else ''}{significant(good)}"
               for good, bad in zip(searches.largest, searches.smallest, strict=True)]  # fmt: skip
    return {
        "paper": paper_runs(runs), "limit-table": searches.assign(settles=settles), "growth": growth(runs),
        "maps": _maps(of(runs, "map")), "accuracy": equal,
        "reach": crossed(  # the tightest target that is met
            equal.assign(problem=equal["where"]), "problem", "run",
            lambda found: scientific(found.target[found.status == "solved"].min(), 1), tuple(METHODS),
        ),
    }  # fmt: skip


def _maps(found: DataFrame) -> DataFrame:
    """The quickest pair of steps of each map, and whether ω_N changes anything."""
    lines = []
    for where, runs in found.groupby("where", sort=False):
        settled = runs[runs.settles == 1].sort_values(SOON, kind="stable").dropna(subset=SOON)
        one = runs.groupby("tangential", dropna=False)[["settles", SOON]].nunique(dropna=False)
        lines.append({
            "where": where, "pairs": len(runs), "failing": int((runs.settles != 1).sum()),
            SOON: settled[SOON].min(), "best": next(iter(settled.tangential), None),
            "matters": "yes" if (one > 1).any(axis=None) else "no",
        })  # fmt: skip
    return DataFrame(lines)


def _history_picture(found: DataFrame) -> "Canvas":
    """Errors of P/2 after each iteration of the paper's run."""
    paper = load()
    canvas = new_figure(8.0, 4.2)
    axes = canvas.subplots()
    axes.set(xscale="log", yscale="log", ylim=(1e-10, 0.1), xlabel="iteration [-]", ylabel="relative error of P/2 [-]")
    plain_ticks(axes.xaxis, axes.yaxis)
    axes.axvline(paper.iterations, color="black", linestyle="--", linewidth=0.8, label=f"{paper.iterations} iterations")
    for number, run in enumerate(found.itertuples()):
        colour, marker, line = LOOKS[number % len(LOOKS)]
        errors = np.maximum(np.array(run.errors), 1e-10)
        axes.plot(np.arange(1, len(errors) + 1), errors, color=colour, linestyle=line, marker=marker, markersize=4,
                  markevery=(number, 40), linewidth=1.2, label=f"μ = {run.friction:g}")  # fmt: skip
    grid(axes)
    axes.legend(fontsize=8, frameon=False, ncols=2, loc="lower left")
    return canvas


def _limit_picture(searches: DataFrame) -> "Canvas":
    """The largest ω_T that settle on the plate, beside theory."""
    plate = searches[(searches.step == "ω_T") & (searches.problem == "plate")].sort_values("cells")
    canvas = new_figure(8.0, 4.4)
    axes = canvas.subplots()
    axes.set(yscale="log", xlabel="cells a side [-]", ylabel="ω_T [length]")
    powers_of_two(axes)
    for number, (friction, found) in enumerate(plate.groupby("friction")):
        colour, marker, _ = LOOKS[number % len(LOOKS)]
        bounded = found[found.largest.notna() & found.smallest.notna()]
        for name, line in (("omega_T", ""), ("limit_T", "--"), ("slipping_T", ":")):
            shown = (found if line else bounded).dropna(subset=[name])
            if len(shown):
                axes.plot(shown.cells, shown[name], color=colour, linestyle=line or "none",
                          marker=None if line else marker, markersize=6, linewidth=1.2,
                          label=f"μ = {friction:g}: {_LIMIT_LABELS[name]}")  # fmt: skip
    axes.axhline(load().omega_T, color="black", linewidth=0.9, label="the paper's ω_T")
    grid(axes)
    legend_below(canvas, 3, 7)
    return canvas


_LIMIT_LABELS: Final = {
    "omega_T": "observed", "limit_T": "2 / λ_max, all points", "slipping_T": "2 / λ_max, slipping points",
}  # fmt: skip


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    figures = {
        "history": drawn("uzawa-history", partial(_history_picture, of(runs, "paper"))),
        "limits": drawn("uzawa-limits", partial(_limit_picture, searches_of(runs))),
    }
    return render("comparisons.convergence", "convergence-uzawa", values_of(runs), tables_of(runs), figures, rows,
                  forms=FORMS, template="uzawa.md")  # fmt: skip
