"""Refine a mesh until a quantity is as accurate as asked for.

In `docs/theory.md`: (D14).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray, positive_number
from qvi_contact.errors import InputError, QVIError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.estimate import CellErrors, cell_errors
from qvi_contact.refinement.grids import coarser, finer
from qvi_contact.refinement.marking import marked_lines
from qvi_contact.refinement.outcome import Refinement, RefinementRound, RefinementStatus
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import solve
from solvers import Status
from solvers.basics.watch import expired, watched

Quantity: TypeAlias = str | Callable[[ContactResult], float]

_FORCES = ("normal_force", "tangential_force")
_REDUCTION = 0.3  # share of the error that a round aims to leave at least
_MARGIN = 0.7  # share of the target that the last round aims at
_GROWTH = 2.0  # of the unknowns in a round
_SLOWEST = 0.8  # largest reduction of the error between two rounds that is extrapolated
_APART = 8.0  # how far the two estimates may be apart
_STOPS = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # what a status on the way means for the refinement
_SMALL_FORCE = 1e-6  # of the problem's unit: forces below count as this for relative errors


def refine(
    problem: ContactProblem,
    result: ContactResult | None = None,
    target: float = 1e-3,
    quantity: Quantity = "energy",
    *,
    max_unknowns: int = 20_000,
    max_rounds: int = 20,
    thinnest: float = 1e-5,
    time_limit: float | None = None,
    callback: Callable[[RefinementRound], object] | None = None,
    **options: Any,  # checked by solve
) -> Refinement:
    """Solve a problem on meshes refined where it pays until the estimated error of a quantity is within a target.

    Each round solves the problem on a mesh, on the same with every interval bisected, which gives the answer, and with
    about every second line left out. From the differences of the three follow rates and errors, cell by cell (see
    `estimate`), and lines are inserted across the body where they remove most of the error for the unknowns they cost
    (see `marking`).

    Parameters
    ----------
    problem : ContactProblem
        The problem. Its mesh is where the refinement starts: lines it has are kept, so let it be coarse, but fine
        enough to show the loads.
    result : ContactResult, optional
        An earlier result of the problem, on its mesh or another: the refinement starts from about every second line of
        that mesh, so that its first answer is about as fine.
    target : float
        Relative error asked for.
    quantity : str or function of a ContactResult
        "energy": the complementary energy, its error relative to the strain energy (½∫cσ:σ; this is the squared
        relative error of the stresses in the energy norm, if there is no friction). "NAME.normal_force" or
        "NAME.tangential_force": the resultant of the contact called NAME, relative to itself. Or any function that
        gives one number, relative to itself.
    max_unknowns : int
        Largest number of unknowns of a problem solved, counted as four for each cell.
    max_rounds : int
        Largest number of rounds.
    thinnest : float
        Smallest interval that is made, as a share of the body's length; solves in double precision fail near 1e-5.
    time_limit : float, optional
        Seconds for all rounds together; the answer is that of the last round done in time.
    callback : callable, optional
        Called with the record of each round.
    **options
        As for `solve`: method, inner, tolerance and the method's own.

    Returns
    -------
    Refinement
        The last answer, the estimate with its status, and the error indicator of every cell. A failure does not raise.

    Raises
    ------
    InputError
        If an argument is wrong, or the problem on its first mesh.

    Notes
    -----
    With E_k the complementary energy still missing in round k (the sum over the cells), Δ_k what the finest mesh of
    the round gained of it, and q_k the quantity, two estimates are at hand:

        companion: κ_k E_k,   κ_k = |q_k − q(coarser mesh)| / Δ_k, the largest of this and the last round,
        rounds:    |q_k − q_{k−1}| ρ/(1 − ρ),   ρ = E_k/E_{k−1} ≤ 0.8.

    The estimate is their geometric mean, the second kept within a factor of 8 of the first, which stands alone in the
    first round. It is an estimate, not a bound: on the problems of its test it is within a factor of 3 of the error.

    """
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    if result is not None:
        problem = _start(problem, result)
    for name in ("initial", "throw"):
        if name in options:
            raise InputError(name, options[name], "is not for refine: meshes change, and failures are in the status")
    limits = _Limits(
        positive_number("target", target),
        positive_number("max_unknowns", max_unknowns),
        int(positive_number("max_rounds", max_rounds)),
        positive_number("thinnest", thinnest) * problem.grid.length,
    )
    least = 16 * int(problem.grid.active.sum())
    if least > limits.max_unknowns:
        remedy = f"the first mesh has about {least} unknowns with every interval bisected: allow more, or start coarser"
        raise InputError("max_unknowns", max_unknowns, remedy)
    loop = _Loop(_Measure.of(problem, quantity), limits, options, callback)
    with watched(time_limit):
        return loop.run(problem)


def _start(problem: ContactProblem, result: ContactResult) -> ContactProblem:
    """The problem on about every second line of the mesh of a result."""
    if not isinstance(result, ContactResult):
        raise InputError("result", result, "give an earlier ContactResult of the problem, or None")
    mesh = coarser(result.problem).grid
    return problem.on_lines(mesh.x, mesh.y)


@dataclass(frozen=True)
class _Limits:
    """Target, and what must not be exceeded on the way; `thinnest` [length]."""

    target: float
    max_unknowns: float
    max_rounds: int
    thinnest: float


@dataclass(frozen=True)
class _Measure:
    """A quantity: its name, its value and the unit of its relative error."""

    name: str
    value: Callable[[ContactResult], float]
    unit: Callable[[ContactResult], float]

    @classmethod
    def of(cls, problem: ContactProblem, quantity: Quantity) -> "_Measure":
        if not isinstance(quantity, str):
            if not callable(quantity):
                raise InputError("quantity", quantity, "give a name or a function of a ContactResult")
            function = quantity
            name = getattr(function, "__name__", "quantity")
            return cls(name, lambda result: float(function(result)), lambda result: abs(float(function(result))))
        if quantity == "energy":
            return cls(quantity, lambda result: result.energies.complementary, lambda result: result.energies.strain)
        contact, _, force = quantity.rpartition(".")
        if force not in _FORCES or contact not in [known.name for known in problem.contacts]:
            names = [f"{known.name}.{kind}" for known in problem.contacts for kind in _FORCES]
            raise InputError("quantity", quantity, f"give a function, or one of {', '.join(['energy', *names])}")

        def value(result: ContactResult) -> float:
            return float(getattr(result.contacts[contact], force))

        def unit(result: ContactResult) -> float:
            scales = result.discretization.scales
            return max(abs(value(result)), _SMALL_FORCE * scales.stress * scales.length)

        return cls(quantity, value, unit)


@dataclass(frozen=True, eq=False)
class _Round:
    """A solved round: middle problem, finest result, its errors if there are any, quantity and κ."""

    coarse: ContactProblem
    result: ContactResult
    errors: CellErrors | None
    value: float
    unit: float
    sensitivity: float
    estimate: float

    @property
    def record(self) -> RefinementRound:
        ny, nx = self.result.problem.grid.shape
        return RefinementRound((nx, ny), _unknowns(self.result), self.value, self.estimate)

    @property
    def indicator(self) -> FloatArray:
        """Cell by cell, adding up to the estimate."""
        if self.errors is None or not self.errors.total > 0.0 or not np.isfinite(self.estimate):
            return np.zeros(self.result.problem.grid.shape)
        return self.errors.cells * (self.estimate / self.errors.total)


class _StopError(Exception):
    """The end of the rounds: how, and why if something failed."""

    def __init__(self, status: RefinementStatus, reason: str = "") -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


@dataclass(frozen=True, eq=False)
class _Loop:
    """The rounds of one refinement."""

    measure: _Measure
    limits: _Limits
    options: dict[str, Any]
    callback: Callable[[RefinementRound], object] | None

    def run(self, problem: ContactProblem) -> Refinement:
        """Solve, estimate, insert lines, until the target or a limit is reached."""
        rounds: list[_Round] = []
        first = result = solve(finer(problem), **self.options)  # the first mesh may raise
        try:
            _check_solved(first)
            while True:
                rounds.append(self._round(problem, result, rounds))
                if self.callback is not None:
                    self.callback(rounds[-1].record)
                problem = self._next(rounds)
                result = self._solved(problem)
        except _StopError as stop:
            return self._outcome(rounds, first, stop)

    def _solved(self, problem: ContactProblem) -> ContactResult:
        """The result on the mesh with all intervals bisected."""
        try:
            result = solve(finer(problem), **self.options)
        except QVIError as error:  # the same data were taken on the mesh before
            raise _StopError(RefinementStatus.THIN_CELLS, str(error)) from error
        _check_solved(result)
        return result

    def _companion(self, problem: ContactProblem) -> ContactResult | None:
        """A result on a coarser mesh, if it has one."""
        try:
            result = solve(problem, **self.options)
        except QVIError:
            return None
        return result if result.status is Status.SOLVED else None

    def _round(self, problem: ContactProblem, result: ContactResult, earlier: list[_Round]) -> _Round:
        """What the results on three meshes say about the finest one."""
        value, unit = self.measure.value(result), self.measure.unit(result)
        middle = self._companion(problem)
        if middle is None and earlier and expired():  # nobody could say how accurate the result is
            raise _StopError(RefinementStatus.TIME_LIMIT)
        if middle is None:
            return _Round(problem, result, None, value, unit, 0.0, np.inf)
        errors = cell_errors(self._companion(coarser(problem)), middle, result)
        gained = float(errors.difference.sum())
        sensitivity = abs(value - self.measure.value(middle)) / gained if gained > 0.0 else 0.0
        error = _estimate(value, errors.total, sensitivity, earlier[-1] if earlier else None)
        return _Round(problem, result, errors, value, unit, sensitivity, error / unit if unit > 0.0 else 0.0)

    def _next(self, rounds: list[_Round]) -> ContactProblem:
        """The next mesh, of which all intervals will be bisected."""
        last, limits = rounds[-1], self.limits
        if last.estimate <= limits.target:
            raise _StopError(RefinementStatus.REACHED)
        if expired():
            raise _StopError(RefinementStatus.TIME_LIMIT)
        if len(rounds) >= limits.max_rounds:
            raise _StopError(RefinementStatus.ROUNDS)
        if last.errors is None:
            problem = finer(last.coarse)
        else:
            reduction = max(_REDUCTION, _MARGIN * limits.target / last.estimate)
            most = min(_GROWTH * _unknowns(last.result), limits.max_unknowns)
            lines = marked_lines(last.coarse, last.errors, reduction * last.errors.total, most, limits.thinnest)
            problem = last.coarse.on_lines(*lines)
        unknowns = 16 * int(problem.grid.active.sum())
        if problem.grid.shape == last.coarse.grid.shape:
            full = unknowns >= limits.max_unknowns
            raise _StopError(RefinementStatus.UNKNOWNS if full else RefinementStatus.THIN_CELLS)
        if unknowns > limits.max_unknowns:
            raise _StopError(RefinementStatus.UNKNOWNS)
        return problem

    def _outcome(self, rounds: list[_Round], first: ContactResult, stop: _StopError) -> Refinement:
        if not rounds:
            empty = np.zeros(first.problem.grid.shape)
            nothing = (float("nan"), float("inf"), float("nan"), empty, ())
            return Refinement(first, stop.status, self.measure.name, self.limits.target, *nothing, stop.reason)
        last = rounds[-1]
        return Refinement(
            last.result,
            stop.status,
            self.measure.name,
            self.limits.target,
            last.value,
            last.estimate,
            last.unit,
            last.indicator,
            tuple(each.record for each in rounds),
            stop.reason,
        )


def _check_solved(result: ContactResult) -> None:
    if result.status is not Status.SOLVED:
        status = _STOPS.get(result.status, RefinementStatus.UNSOLVED)
        raise _StopError(status, f"the mesh with {_unknowns(result)} unknowns: {result.message}")


def _estimate(value: float, missing: float, sensitivity: float, last: _Round | None) -> float:
    """Estimated error of the quantity, see the notes of `refine`."""
    if last is None or last.errors is None or not last.errors.total > 0.0:
        return sensitivity * missing
    companion = max(sensitivity, last.sensitivity) * missing
    reduction = min(missing / last.errors.total, _SLOWEST)
    rounds = abs(value - last.value) * reduction / (1.0 - reduction)
    return float(np.sqrt(companion * np.clip(rounds, companion / _APART, companion * _APART)))


def _unknowns(result: ContactResult) -> int:
    return int(result.discretization.qvi.K.shape[0])
