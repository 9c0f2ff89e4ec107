"""Other solutions of a problem: friction is changed step by step, each step starting from the state of the one before.

With friction the solution of (D2) need not be unique, and a method started anew ends at the one its own way leads to.
Where the friction rises from a share of its value, or falls from a multiple, the state changes little in each step, and
the way may end at another solution. None found proves nothing; `uniqueness` has a bound below which there is none.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from solvers.basics.types import Vector
from solvers.basics.watch import expired, watched
from solvers.errors import InputError
from solvers.solution.solution import QVISolution
from solvers.solve import solve_qvi

WAYS: Final = ((0.4, 5), (0.4, 20), (0.6, 20), (0.85, 3), (1.3, 10))
"""First friction over that of the problem, and the steps from there."""

_OTHER: Final = 1e-4  # difference of tractions, over the largest one, that is not the certificates' error


def followed_solutions(solution: QVISolution, *, time_limit: float | None = None) -> tuple[QVISolution, ...]:
    """The solution and others of the same problem, found by following the friction along each of `WAYS`.

    Each is certified to the tolerance of the first, on the data of the problem. Two of them are different if their
    tractions differ at any point by more than 1e-4 of the largest one.

    Parameters
    ----------
    solution : QVISolution
        Solved.
    time_limit : float, optional
        Seconds for all ways together. What was found until then is returned.

    Raises
    ------
    InputError
        If the solution is not solved, or the time limit is wrong.

    """
    if not solution.solved:
        raise InputError("solution", str(solution.status), "give one that is solved")
    found, qvi = [solution], solution.problem
    if not (qvi.mu > 0.0).any():
        return (solution,)
    with watched(time_limit):
        for end in _ends(solution):
            if end.solved and all(traction_difference(end, other) > _OTHER for other in found):
                found.append(end)
    return tuple(found)


def traction_difference(one: QVISolution, other: QVISolution) -> float:
    """The largest difference of tractions at a contact point, over the largest traction of the first."""
    difference = float(np.abs(_tractions(one) - _tractions(other)).max(initial=0.0))
    return difference / one.certificate.scales["stress"]


def _tractions(solution: QVISolution) -> Vector:
    qvi = solution.problem
    return np.concatenate([qvi.normal(solution.z), qvi.tangential(solution.z)])


def _ends(solution: QVISolution) -> Iterator[QVISolution]:
    """What the ways end at, until the time is over; those that begin at the same friction begin at the same state."""
    begun: dict[float, QVISolution] = {}
    for first, count in WAYS:
        if expired():
            return
        if first not in begun:
            begun[first] = _at_friction(first, solution, None)
        step = begun[first]
        state = step if step.solved else None
        for factor in np.linspace(first, 1.0, count + 1)[1:]:
            if expired():
                return
            step = _at_friction(factor, solution, state)
            state = step if step.solved else state
        yield step


def _at_friction(factor: float, solution: QVISolution, start: QVISolution | None) -> QVISolution:
    """The problem of a solution with so many times its friction, solved from a state."""
    qvi = solution.problem
    posed = qvi if factor == 1.0 else qvi.changed(mu=factor * qvi.mu)
    return solve_qvi(posed, "condensed", tolerance=solution.certificate.tolerance, initial=start)
