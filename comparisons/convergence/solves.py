"""Solves of the studies of loops: how long they take, what rows keep of how they ended, and frames of these rows."""

import time
from statistics import median
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.bodies import NAMES, body
from solvers import QVISolution, solve_qvi

if TYPE_CHECKING:
    from pandas import DataFrame

REPEATS: Final = 3
"""How often a solve is timed, if it is quick."""

_BUDGET: Final = 0.5  # seconds after which no further repetition begins


def timed(place: tuple[str, int, float], **options: Any) -> tuple[QVISolution, list[float]]:
    """The solution, and the times of solves of problems built anew, so that none finds a factorisation made before."""
    seconds: list[float] = []
    while True:
        qvi = body(*place).qvi
        began = time.perf_counter()
        solution = solve_qvi(qvi, **options)
        seconds.append(time.perf_counter() - began)
        if len(seconds) == REPEATS or sum(seconds) > _BUDGET:
            return solution, seconds


def ending(solution: QVISolution) -> dict[str, Any]:
    """Status, message, iterations and certificate, see `plain_certificate`."""
    return {
        "status": solution.status.value, "message": solution.message, "iterations": solution.iterations,
        "certificate": plain_certificate(solution),
    }  # fmt: skip


def plain_certificate(solution: QVISolution) -> dict[str, Any]:
    """Whether it passed at the tolerance asked for, the accuracy it confirms, and the measure that decides it."""
    found = solution.certificate
    return {"passed": found.passed, "tolerance": found.tolerance, "accuracy": found.accuracy, "worst": found.worst}


def in_words(runs: "DataFrame") -> "DataFrame":
    """The runs with the median of their times, and name and body: the problem, and with its mesh, in words."""
    names = runs.problem.replace(NAMES)
    bodies = names + [f", {cells}²" if cells else "" for cells in runs.cells]
    return runs.assign(seconds=runs.seconds.map(median, na_action="ignore"), name=names, body=bodies)
