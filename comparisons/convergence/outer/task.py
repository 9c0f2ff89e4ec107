"""One case: a problem solved by a loop, its residuals, and what theory says of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from comparisons.convergence.bodies import Reference, exact_contraction, reference
from comparisons.convergence.outer.study import LOOPS, TOLERANCE, Loop
from comparisons.convergence.rates import rate_of
from comparisons.convergence.solves import ending, timed
from solvers.uniqueness import uniqueness_bound


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
    start = {} if case["start"] is None else {"initial": np.full(1, case["start"])}
    known = reference(*place)
    solution, seconds = timed(place, **loop.options(), **start)
    residuals = [entry.residual for entry in solution.history]
    rate = rate_of(residuals, TOLERANCE)
    qvi, unit = solution.problem, known.body.force
    return {
        **ending(solution), "seconds": seconds, "residuals": residuals,
        "course": rate.course, "factor": rate.factor, "low": rate.low, "high": rate.high,
        **_theory(case, loop, known),
        "normal": unit * qvi.resultant(solution.z), "tangential": unit * float(qvi.W @ qvi.tangential(solution.z)),
    }  # fmt: skip


def _theory(case: Mapping[str, Any], loop: Loop, known: Reference) -> dict[str, Any]:
    step = loop.damping if loop.variant in ("plain", "damped") else None
    local, bound = known.linearised, uniqueness_bound(known.body.qvi)
    exact = case["problem"] == "contacts" and step is not None
    return {
        "linearised": None if local is None or step is None else local.outer_contraction(step),
        "exact": exact_contraction(case["friction"], step) if exact and step is not None else None,
        "sharper": bound.sharper, "kappa": bound.bound,
        "slipping": None if local is None else int(local.slipping.sum()),
        "open": None if local is None else int(local.open.sum()),
        "points": known.body.qvi.m,
    }  # fmt: skip
