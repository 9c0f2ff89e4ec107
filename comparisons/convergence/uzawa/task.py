r"""One case: Uzawa with given steps, the largest steps it bears, the paper's own run, or another method.

Steps are shares of two limits of `linearised`, both for all points with a bound above zero:

    ω_T* = 2 / λ_max(Θ^(−1/2) Ĉ_TT Θ^(−1/2)),    ω_N* = 2 / λ_max(Ĉ_NN)

A run *settles* if in its last quarter the resultant normal force stays within `NEAR` of the condensed method's and the
multipliers change by less than `STILL` of the largest one per iteration. Beyond their limit steps never do: the changes
go on for ever.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from comparisons.convergence.bodies import Reference, reference
from comparisons.convergence.rates import first_lasting
from comparisons.convergence.solves import ending, plain_certificate, timed
from comparisons.convergence.uzawa.study import METHODS
from comparisons.paper.reference import load
from solvers import QVISolution, solve_qvi

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
    """Do a case of `study`.

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
    foreseen = _foreseen(lambda share: known.local.uzawa_contraction(*steps_of(share)))
    return {**found, **_given(known, *steps), "largest": largest, "smallest": smallest, "foreseen": foreseen}


def _bisected(holds: Callable[[float], bool], count: int = _BISECTIONS) -> tuple[float, float]:
    """The largest share of `SEARCHED` for which something is seen to hold, and the smallest for which it is not."""
    low, high = SEARCHED
    for _ in range(count):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def _foreseen(contraction: Callable[[float], float]) -> float | None:
    """The share of `SEARCHED` at which the contraction becomes 1, by bisection; None if it does not."""
    low, high = SEARCHED
    if contraction(low) >= 1.0 or contraction(high) < 1.0:
        return None
    return _bisected(lambda share: contraction(share) < 1.0, 2 * _BISECTIONS)[0]


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
    options = dict(METHODS[case["run"]].options)
    given: Record = {"omega_T": None, "omega_N": None, "linearised": None}
    if METHODS[case["run"]].is_uzawa:
        steps = _half_steps(known)
        options |= {"omega_T": steps[0], "omega_N": steps[1]}
        given = _given(known, *steps)
    solution, seconds = timed(case["place"], tolerance=case["target"], **options)
    error = abs(solution.problem.resultant(solution.z) / known.resultant - 1.0)
    return {**ending(solution), **given, "seconds": seconds, "last_error": error}


def _half_steps(known: Reference) -> tuple[float, float]:
    limit_T, limit_N = known.local.limits
    return limit_T / 2.0 if limit_T else load().omega_T / known.body.displacement, (limit_N or 2.0) / 2.0


_RUNS: Final[Mapping[str, Callable[[Mapping[str, Any], Reference], Record]]] = {
    "map": _map, "mesh": _map, "tangential limit": _limit, "normal limit": _limit, "paper": _paper,
}  # fmt: skip
