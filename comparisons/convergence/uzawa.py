r"""Convergence of the paper's iteration: the paper's run, runs with other steps, and the report.

At slipping points (4.3) and (4.4) are gradient steps of length ω_T/θ for the dual operator, with the friction bound θ,
Θ = diag(θ); at open points (4.2) is a gradient step of length ω_N. With the compliance of the body at the contact,
Ĉ = √W B K⁻¹ Bᵀ √W, B = [N; T], steps are given as shares of two limits, ω_T* for all points with θ > 0,

    ω_T* = 2 / λ_max(Θ^(−1/2) Ĉ_TT Θ^(−1/2)),    ω_N* = 2 / λ_max(Ĉ_NN)

A run *settles* if in its last quarter the resultant normal force stays within `NEAR` of the condensed method's and the
multipliers change by less than `STILL` of the largest multiplier per iteration. Runs with steps beyond the limit never
settle.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, Final

import numpy as np
from pandas import DataFrame, to_numeric
from scipy.linalg import eigvalsh

from comparisons.convergence.bodies import PLACE, Reference, ending, in_words, reference
from comparisons.lab.numbers import count, fixed, percent, significant, span
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import Row, Study, frame_of, largest_of
from comparisons.paper.study import load
from solvers import QVISolution, solve_qvi
from solvers.inequality.problem import Compliance

HALF: Final = 0.5
"""The step ω_N of all runs, as a share of its limit; it has little influence here."""

ITERATIONS: Final = 2000
"""Iterations of the paper's run and of runs with a given step."""

TARGETS: Final = (1e-4, 1e-6)
"""Relative errors of the normal force for which the first lasting iteration is stored."""

NEAR: Final = 1e-3
STILL: Final = 1e-3

_NOTHING: Final = 1e-9  # eigenvalues below this share of the largest are zero
_LAST_DIGIT: Final = 0.00501  # half of the last printed digit of P/2, and rounding

Record = dict[str, Any]


def study(quick: bool) -> Study:
    """The study: the paper's run and runs with other steps, or only coarse meshes.

    "share" is ω_T over its limit, a power of √2, rounded so that it is the same on every machine; None in the paper's
    run.
    """
    frictions, cells = ((0.1,), (2,)) if quick else ((0.05, 0.1, 0.2), (2, 8, 16))
    shares = [round(2.0 ** (power / 2.0), 6) for power in (range(-2, 3) if quick else range(-6, 5))]
    cases = [{"run": "paper", "place": ("plate", load().cells, mu), "share": None}
             for mu in ((0.0, 0.1, 0.3) if quick else load().table)]  # fmt: skip
    cases += [{"run": "step", "place": ("plate", number, mu), "share": share}
              for number, mu, share in product(cells, frictions, shares)]  # fmt: skip
    return Study("convergence-uzawa", 5, "comparisons.convergence.uzawa:run", cases)


def run(case: Mapping[str, Any]) -> Record:
    """Task of the study: Uzawa with a given step, or the paper's run; entries of `bodies.ending`, and more.

    "omega" and "limit" are ω_T and ω_T* [length], None where no point has a bound above zero, "condition" is λ_max /
    λ_min of Θ^(−1/2) Ĉ_TT Θ^(−1/2) on the slipping points, None if there are none, "force" P of the solution.
    """
    known = reference(*case["place"])
    unit, (tangential, normal, condition) = known.body, limits_of(known)
    omega = load().omega_T / unit.displacement if case["run"] == "paper" else case["share"] * tangential
    solution = _march(known, omega, HALF * normal, ITERATIONS)
    return {
        **_course(known, solution, omega),
        **(_paper(case, known, omega, HALF * normal) if case["run"] == "paper" else {}),
        "limit": None if tangential is None else tangential * unit.displacement, "condition": condition,
        "force": unit.force * abs(known.resultant),
    }  # fmt: skip


def limits_of(known: Reference) -> tuple[float | None, float, float | None]:
    """ω_T*, ω_N* and the condition, see `run`; dimensionless."""
    qvi, z, solution = known.body.qvi, known.solution.z, known.solution
    weights, m = np.sqrt(np.concatenate([qvi.W, qvi.W])), qvi.m
    compliance = weights[:, None] * Compliance(qvi).dense * weights
    pulled, slip = (each / qvi.W * qvi.contact_stiffness
                    for each in (solution.normal_multiplier, solution.tangential_multiplier))  # fmt: skip
    is_open = (pulled > -qvi.normal(z)) & ~qvi.bilateral
    threshold = qvi.threshold(np.where(is_open, 0.0, qvi.pressure(z)))  # at open points the pressure is rounding
    rough = threshold > 0.0
    slipping = rough & (np.abs(slip) > threshold - np.abs(qvi.tangential(z)))

    def eigenvalues(chosen: Any) -> Any:
        root = 1.0 / np.sqrt(threshold[chosen])
        return eigvalsh(root[:, None] * compliance[m:, m:][np.ix_(chosen, chosen)] * root)

    normal = 2.0 / float(eigvalsh(compliance[:m, :m])[-1])
    tangential = 2.0 / float(eigenvalues(rough)[-1]) if rough.any() else None
    if not slipping.any():
        return tangential, normal, None
    values = eigenvalues(slipping)
    return tangential, normal, float(values[-1] / values[values > _NOTHING * values[-1]][0])


def _march(known: Reference, omega_T: float, omega_N: float, iterations: int, **options: Any) -> QVISolution:
    """Uzawa's iteration with these steps, for so many iterations."""
    settings = {"omega_T": omega_T, "omega_N": omega_N, "iterations": iterations, **options}
    return solve_qvi(known.body.qvi, method="uzawa", tolerance=1e-8, **settings)


def _course(known: Reference, solution: QVISolution, omega: float) -> Record:
    """The course of a run: last errors and changes, whether it settles, and iterations needed for each target."""
    numbers = [entry.number for entry in solution.history]
    errors = np.abs(np.array([entry.normal_resultant for entry in solution.history]) / known.resultant - 1.0)
    changes = np.array([entry.residual for entry in solution.history])
    last = np.array(numbers) > 0.75 * numbers[-1]
    error, change = float(errors[last].max()), float(np.median(changes[last]))
    return {
        **ending(solution), "last_error": error, "last_change": change, "omega": omega * known.body.displacement,
        "settles": bool(error <= NEAR and change <= STILL),
        "needed": {f"{target:.0e}": first_lasting(errors.tolist(), numbers, target) for target in TARGETS},
    }  # fmt: skip


def _paper(case: Mapping[str, Any], known: Reference, omega_T: float, omega_N: float) -> Record:
    """The results of the paper's own number of iterations.

    P/2 as "printed" in the paper, after its iterations by the accumulating rule ("after") and by the printed rule
    ("after_printed_rule"); the error of the bonded state ("before"); the largest error of tractions over the mean
    pressure ("tractions").
    """
    paper, qvi, unit = load(), known.body.qvi, known.body.force
    after, as_printed = (_march(known, omega_T, omega_N, paper.iterations, rule=rule)
                         for rule in ("accumulating", "printed"))  # fmt: skip
    exact, found = (qvi.tractions(z) for z in (known.solution.z, after.z))
    return {
        "printed": paper.table[case["place"][2]], "after": -unit * qvi.resultant(after.z),
        "after_printed_rule": -unit * qvi.resultant(as_printed.z),
        "before": abs(qvi.resultant(qvi.bonded) / known.resultant - 1.0),
        "tractions": float(np.abs(found - exact).max()) / (abs(known.resultant) / float(qvi.W.sum())),
    }  # fmt: skip


def first_lasting(errors: Sequence[float], numbers: Sequence[int], target: float) -> int | None:
    """The number of the first iteration from which on all errors are within the target.

    None if there is none, or if less than a fifth of the iterations follows, since it may then be a phase of a cycle.
    """
    outside = np.flatnonzero(~(np.asarray(errors) <= target))  # nan is outside
    first = int(outside[-1]) + 1 if len(outside) else 0
    return None if first >= len(errors) or numbers[first] > 0.8 * numbers[-1] else int(numbers[first])


SOON: Final = "to 1e-04"
"""Column: iterations until the normal force stays within 1e-4."""

_TARGETS: Final = tuple(f"to {target:.0e}" for target in TARGETS)
_NUMBERS: Final = (
    "share", "omega", "limit", "condition", "force", "iterations", "settles", "last_error", "last_change",
    "printed", "after", "after_printed_rule", "before", "tractions",
)  # fmt: skip
"""Columns that are numbers, NaN where a run has none; see `run`."""


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run, by problem, mesh and μ.

    The columns are those of `frame_of` and `in_words`, the place as problem, cells and friction, where (the three in
    words), and "to 1e-04" and so on, iterations to that error for good.
    """
    runs = frame_of(rows, _NUMBERS, ("seconds", "needed"))
    for place, name in enumerate(PLACE):
        runs[name] = runs.place.str[place]
    runs["friction"] = runs.friction.astype(float)
    runs = in_words(runs)
    runs["where"] = runs.body + runs.friction.map(", μ = {:g}".format)
    for name in _TARGETS:
        runs[name] = to_numeric(runs.needed.str.get(name.removeprefix("to ")))
    return runs.sort_values(PLACE, kind="stable", ignore_index=True)


def paper_runs(runs: DataFrame) -> DataFrame:
    """The paper's runs, with the fewest iterations of a run with another step that settles on the same problem."""
    steps = runs[(runs.run == "step") & runs.has]
    quickest = steps[steps.settles == 1].groupby(PLACE)[SOON].min().rename("quickest")
    found = runs[(runs.run == "paper") & runs.has].join(quickest, on=PLACE)
    return found.assign(error=(found.after / found.force - 1.0).abs(), part=found.omega / found.limit)


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    paper, found, steps = load(), paper_runs(runs), runs[(runs.run == "step") & runs.has]
    rough, smooth = found[found.friction > 0.0], found[found.friction == 0.0]
    sliding = rough[rough.condition.notna()]
    met = {name: int(((found[name] - found.printed).abs() < _LAST_DIGIT).sum())
           for name in ("after", "after_printed_rule")}  # fmt: skip
    return {
        # after the paper's iterations: errors, what the step costs, how many printed values are met
        "worst": largest_of(rough.error, rough), "tractions": rough.tractions.max(),
        "needed": span(rough[SOON][rough[SOON] > paper.iterations]), "shares": span(sliding.part, percent),
        "quickest": span(sliding["quickest"]), "printed": len(found), "accumulating": met["after"],
        "as_printed": met["after_printed_rule"], "smooth": largest_of(smooth.last_error, smooth),
        # whether steps up to the limit settle
        "safe": int((steps[steps.share <= 1.0].settles == 1).sum()), "short": int((steps.share <= 1.0).sum()),
        "iterations": paper.iterations, "omega": paper.omega_T, "half": HALF, "failed": int((~runs.has).sum()),
        "steps": ITERATIONS, "near": NEAR, "still": STILL,
    }  # fmt: skip


FORMS: Final[Mapping[str, Form]] = {
    "friction": fixed("g"), **dict.fromkeys(("printed", "after", "after_printed_rule", "force"), fixed(".2f")),
    **dict.fromkeys(("before", "error", "tractions"), partial(percent, digits=2)),
    **dict.fromkeys((*_TARGETS, "quickest"), count), "part": partial(significant, digits=2), "condition": significant,
}  # fmt: skip
"""Column of a table → how its numbers read."""


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    tables = {"paper": paper_runs(runs)}
    return render("comparisons.convergence", "convergence-uzawa", values_of(runs), tables, {}, rows, forms=FORMS,
                  template="uzawa.md")  # fmt: skip
