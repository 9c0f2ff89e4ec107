r"""The study: runs with steps on a grid, limits, meshes, the paper's own run, and other methods at equal accuracy.

Steps are shares of two limits of `linearised`, both for all points with a bound above zero:

    ω_T* = 2 / λ_max(Θ^(−1/2) Ĉ_TT Θ^(−1/2)),    ω_N* = 2 / λ_max(Ĉ_NN)

A run *settles* if in its last quarter the resultant normal force stays within `NEAR` of the condensed method's and the
multipliers change by less than `STILL` of the largest one per iteration. Beyond their limit steps never do: the changes
go on for ever.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import Any, Final

import numpy as np

from comparisons.convergence.bodies import Reference, ending, plain_certificate, reference, timed
from comparisons.convergence.linearised import first_lasting
from comparisons.lab.studies import Study
from comparisons.paper.reference import load
from comparisons.paper.study import SHRINKING
from solvers import QVISolution, solve_qvi

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
    return Study("convergence-uzawa", 3, "comparisons.convergence.uzawa.study:run", [*_cases(quick)])


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
