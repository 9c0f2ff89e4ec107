"""One case: a problem solved by a loop, its residuals, and what theory says of them."""

import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from comparisons.convergence.bodies import body, exact_contraction, reference
from comparisons.convergence.certificates import plain_certificate
from comparisons.convergence.outer.loops import LOOPS, TOLERANCE, Loop
from comparisons.convergence.rates import rate_of
from solvers import FrictionQVI, QVISolution, solve_qvi
from solvers.uniqueness import uniqueness_bound

_REPEATS: Final = 3
_BUDGET: Final = 0.5  # seconds after which no further repetition begins


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Solve a case of `study`.

    Returns
    -------
    dict
        status, message, iterations : how it ended
        seconds : wall times of repeated solves, factorisation included
        residuals : of every outer iteration (of the interior point method where there is no loop)
        course, factor, low, high : see `rates.Rate`
        linearised : contraction by `linearised` at the solution of the condensed method; None without one
        exact : that known in closed form, None where none is
        sharper, kappa : 1/γ and κ^(−1/2) of `solvers.uniqueness`, None where they were not computed
        normal, tangential : resultants of σ_N and σ_T, in the unit of the problem's data × length
        slipping, open, points : numbers of contact points, slipping and open ones of the reference
        certificate : see `plain_certificate`

    """
    loop, place = LOOPS[case["loop"]], (case["problem"], case["cells"], case["friction"])
    known = reference(*place)
    solution, seconds = _timed(case, loop)
    residuals = [entry.residual for entry in solution.history]
    rate = rate_of(residuals, TOLERANCE)
    qvi, unit = solution.problem, known.body.force
    return {
        "status": solution.status.value, "message": solution.message, "iterations": solution.iterations,
        "seconds": seconds, "residuals": residuals,
        "course": rate.course, "factor": rate.factor, "low": rate.low, "high": rate.high,
        **_theory(case, loop, known.body.qvi),
        "normal": unit * qvi.resultant(solution.z), "tangential": unit * float(qvi.W @ qvi.tangential(solution.z)),
        "certificate": plain_certificate(solution),
    }  # fmt: skip


def _timed(case: Mapping[str, Any], loop: Loop) -> tuple[QVISolution, list[float]]:
    """The solution, and the times of solves of problems built anew, so that none finds a factorisation made before."""
    options = loop.options()
    if case["start"] is not None:
        options["initial"] = np.full(1, case["start"])
    seconds: list[float] = []
    while True:
        qvi = body(case["problem"], case["cells"], case["friction"]).qvi
        began = time.perf_counter()
        solution = solve_qvi(qvi, **options)
        seconds.append(time.perf_counter() - began)
        if len(seconds) == _REPEATS or sum(seconds) > _BUDGET:
            return solution, seconds


def _theory(case: Mapping[str, Any], loop: Loop, qvi: FrictionQVI) -> dict[str, Any]:
    known = reference(case["problem"], case["cells"], case["friction"])
    step = loop.damping if loop.variant in ("plain", "damped") else None
    local, bound = known.linearised, uniqueness_bound(qvi)
    exact = case["problem"] == "contacts" and step is not None
    return {
        "linearised": None if local is None or step is None else local.outer_contraction(step),
        "exact": exact_contraction(case["friction"], step) if exact and step is not None else None,
        "sharper": bound.sharper, "kappa": bound.bound,
        "slipping": None if local is None else int(local.slipping.sum()),
        "open": None if local is None else int(local.open.sum()),
        "points": qvi.m,
    }  # fmt: skip
