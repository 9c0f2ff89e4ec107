"""Refinement of rectangular grids: lines across the body, errors from three nested grids.

In `docs/theory.md`: (D14).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.errors import QVIError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.estimate import CellErrors, cell_errors
from qvi_contact.refinement.grids import coarser, finer
from qvi_contact.refinement.marking import marked_lines
from qvi_contact.refinement.outcome import RefinementStatus
from qvi_contact.refinement.quantity import Measure
from qvi_contact.refinement.rounds import (
    Accuracy,
    ResultRound,
    Settings,
    StopError,
    TooLargeError,
    check_solved,
    unknowns_of,
)
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import solve
from solvers import Status
from solvers.basics.watch import expired

_REDUCTION: Final = 0.3  # share of the error that a round aims to leave at least
_MARGIN: Final = 0.7  # share of the target that the last round aims at
_GROWTH: Final = 2.0  # of the unknowns in a round
_SLOWEST: Final = 0.8  # largest reduction of the error between two rounds that is extrapolated
_APART: Final = 8.0  # how far the two estimates may be apart


@dataclass(frozen=True, eq=False, kw_only=True)
class LineRound(ResultRound):
    """A round on grids; `problem` is that on the middle one.

    Attributes
    ----------
    errors : CellErrors or None
        Errors of the cells, if there are any.
    sensitivity : float
        κ of (D14).

    """

    errors: CellErrors | None
    sensitivity: float


@dataclass(frozen=True)
class LineRefinement:
    """Grid lines inserted where they pay; see `rounds.Strategy`."""

    settings: Settings
    measure: Measure

    counting: ClassVar[str] = " with every interval bisected"
    rounds: ClassVar[int] = 20
    thinnest: ClassVar[float] = 1e-5

    def start(self, problem: ContactProblem, result: ContactResult) -> ContactProblem:
        """The problem on about every second line of the mesh of a result, so that the first answer is about as fine."""
        mesh = coarser(result.problem).grid
        return problem.on_lines(mesh.x, mesh.y)

    def answer(self, problem: ContactProblem) -> ContactResult:
        """The result on the mesh with all intervals bisected."""
        unknowns = _finest_unknowns(problem)
        if unknowns > self.settings.max_unknowns:
            raise TooLargeError(unknowns)
        return solve(finer(problem), element="bfs", **self.settings.options)

    def assessed(self, problem: ContactProblem, result: ContactResult, earlier: Sequence[LineRound]) -> LineRound:
        """What the results on three meshes say about the finest one."""
        check_solved(result)
        measure, mesh = self.measure, result.problem.grid
        value, unit = measure.value(result), measure.unit(result)
        middle = self._companion(problem)
        if middle is None and earlier and expired():  # nobody could say how accurate the result is
            raise StopError(RefinementStatus.TIME_LIMIT)
        errors, sensitivity, estimate = None, 0.0, np.inf
        if middle is not None:
            errors = cell_errors(self._companion(coarser(problem)), middle, result)
            gained = float(errors.difference.sum())
            sensitivity = abs(value - measure.value(middle)) / gained if gained > 0.0 else 0.0
            error = _estimate(value, errors.total, sensitivity, earlier[-1] if earlier else None)
            estimate = error / unit if unit > 0.0 else 0.0
        indicator = _shared(errors, estimate) if errors is not None else np.zeros(mesh.shape)
        cells = mesh.shape[::-1]
        size = unknowns_of(result)
        return LineRound(
            problem=problem,
            unknowns=size,
            accuracy=Accuracy(value, unit, estimate),
            cells=cells,
            indicator=indicator,
            result=result,
            errors=errors,
            sensitivity=sensitivity,
        )

    def next(self, rounds: Sequence[LineRound]) -> ContactProblem:
        """The next mesh, of which all intervals will be bisected."""
        last, settings = rounds[-1], self.settings
        if last.errors is None:
            problem = finer(last.problem)
        else:
            reduction = max(_REDUCTION, _MARGIN * settings.target / last.estimate)
            most = min(_GROWTH * last.unknowns, settings.max_unknowns)
            lines = marked_lines(last.problem, last.errors, reduction * last.errors.total, most, settings.thinnest)
            problem = last.problem.on_lines(*lines)
        unknowns = _finest_unknowns(problem)
        if problem.grid.shape == last.problem.grid.shape:
            full = unknowns >= settings.max_unknowns
            raise StopError(RefinementStatus.UNKNOWNS if full else RefinementStatus.THIN_CELLS)
        return problem

    def _companion(self, problem: ContactProblem) -> ContactResult | None:
        """A result on a coarser mesh, if it has one."""
        try:
            result = solve(problem, element="bfs", **self.settings.options)
        except QVIError:
            return None
        return result if result.status is Status.SOLVED else None


def _finest_unknowns(problem: ContactProblem) -> int:
    """Unknowns on the mesh with every interval bisected, counted as four for each cell."""
    return 16 * int(problem.grid.active.sum())


def _shared(errors: CellErrors, estimate: float) -> FloatArray:
    """The estimate by cell."""
    if not errors.total > 0.0 or not np.isfinite(estimate):
        return np.zeros_like(errors.cells)
    return errors.cells * (estimate / errors.total)


def _estimate(value: float, missing: float, sensitivity: float, last: LineRound | None) -> float:
    """Estimated error of the quantity, see the notes of `refine`."""
    if last is None or last.errors is None or not last.errors.total > 0.0:
        return sensitivity * missing
    companion = max(sensitivity, last.sensitivity) * missing
    reduction = min(missing / last.errors.total, _SLOWEST)
    rounds = abs(value - last.accuracy.value) * reduction / (1.0 - reduction)
    return float(np.sqrt(companion * np.clip(rounds, companion / _APART, companion * _APART)))
