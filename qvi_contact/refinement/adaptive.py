"""Refine a mesh until a quantity is as accurate as asked for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic

from qvi_contact.basics.checks import positive_number
from qvi_contact.discretization.families import with_element
from qvi_contact.errors import InputError, QVIError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.lines import LineRefinement
from qvi_contact.refinement.outcome import Refinement, RefinementRound, RefinementStatus
from qvi_contact.refinement.quantity import Measure, Quantity
from qvi_contact.refinement.rounds import R, Settings, StopError, Strategy, TooLargeError, check_solved
from qvi_contact.refinement.triangles import TriangleRefinement
from qvi_contact.solution.result import ContactResult
from solvers.basics.watch import expired, watched


def refine(
    problem: ContactProblem,
    result: ContactResult | None = None,
    target: float = 1e-3,
    quantity: Quantity = "energy",
    *,
    max_unknowns: int = 20_000,
    max_rounds: int | None = None,
    thinnest: float | None = None,
    time_limit: float | None = None,
    callback: Callable[[RefinementRound], object] | None = None,
    **options: Any,  # checked by solve
) -> Refinement:
    """Solve a problem on meshes refined where it pays until the error of a quantity is within a target.

    On triangles, into which ``element="hct"`` cuts rectangles, each round solves the problem on a mesh, which gives the
    answer. Where the contact laws allow it (no friction, Tresca's, tied contacts, or contacts that stick everywhere) a
    displacement companion bounds the energy, and the force of one prescribed displacement: the error is guaranteed, see
    `Bracket`. Else the answer is compared with a closer look: one degree more, on a mesh bisected where contact states
    change and at the corners where stresses may be singular (see `closer`). Triangles that hold most of the difference
    are bisected.

    On rectangular grids each round solves on a mesh, on the same with every interval bisected, which gives the answer,
    and with about every second line left out. From the differences of the three follow rates and errors, cell by cell
    (see `estimate`), and lines are inserted across the body where they remove most of the error for the unknowns they
    cost (see `marking`).

    Parameters
    ----------
    problem : ContactProblem
        The problem. Its mesh is where the refinement starts: lines and vertices it has are kept, so let it be coarse,
        but fine enough to show the loads.
    result : ContactResult, optional
        An earlier result of the problem, on its mesh or another: the refinement starts from that mesh; on grids from
        about every second line of it, so that the first answer is about as fine.
    target : float
        Relative error asked for.
    quantity : str or function of a ContactResult
        "energy": the complementary energy, its error relative to the strain energy (½∫cσ:σ; this is the squared
        relative error of the stresses in the energy norm, if there is no friction). "NAME.normal_force" or
        "NAME.tangential_force": the resultant of the contact called NAME, relative to itself. Or any function that
        gives one number, relative to itself.
    max_unknowns : int
        Largest number of unknowns of an answer; on grids counted as four for each cell. The closer look on triangles
        has up to about three times as many.
    max_rounds : int, optional
        Largest number of rounds; by default 20 on grids, 60 on triangles, where a round adds fewer cells.
    thinnest : float, optional
        Smallest interval or edge that is made, as a share of the body's length; by default 1e-5 on grids, where solves
        in double precision fail near it, 1e-9 on triangles.
    time_limit : float, optional
        Seconds for all rounds together; the answer is that of the last round done in time.
    callback : callable, optional
        Called with the record of each round.
    **options
        As for `solve`: method, inner, tolerance and the method's own, ``element``. On triangles ``degree``, 5 by
        default, at most 11, and ``contact_rows``.

    Returns
    -------
    Refinement
        The last answer, the estimate with its status, and the error indicator of every cell; `Refinement.guaranteed`
        says whether the estimate is a bound. A failure does not raise.

    Raises
    ------
    InputError
        If an argument is wrong, or the problem on its first mesh.

    Notes
    -----
    On triangles the estimate is |q − q(closer look)| where `Refinement.guaranteed` is false: an estimate, not a bound,
    on the plate of the test within a factor of 0.7 to 1.5 of the error. Later rounds do not start from the answer of
    the round before: the condensed method, the default, has no use for a start.

    On grids, with E_k the complementary energy still missing in round k (the sum over the cells), Δ_k what the finest
    mesh of the round gained of it, and q_k the quantity, two estimates are at hand:

        companion: κ_k E_k,   κ_k = |q_k − q(coarser mesh)| / Δ_k, the largest of this and the last round,
        rounds:    |q_k − q_{k−1}| ρ/(1 − ρ),   ρ = E_k/E_{k−1} ≤ 0.8.

    The estimate is their geometric mean, the second kept within a factor of 8 of the first, which stands alone in the
    first round. It is an estimate, not a bound: on the problems of its test it is within a factor of 3 of the error.

    """
    problem = _posed_on(problem, result, options)
    on_triangles = isinstance(problem.mesh, TriangleMesh)
    kind: type[TriangleRefinement] | type[LineRefinement] = TriangleRefinement if on_triangles else LineRefinement
    settings = Settings(
        Measure.of(problem, quantity),
        positive_number("target", target),
        positive_number("max_unknowns", max_unknowns),
        int(positive_number("max_rounds", kind.rounds if max_rounds is None else max_rounds)),
        positive_number("thinnest", kind.thinnest if thinnest is None else thinnest) * problem.mesh.length,
        options,
    )
    with watched(time_limit):
        if on_triangles:
            return _Loop(TriangleRefinement(settings), settings, callback).run(problem, result)
        return _Loop(LineRefinement(settings), settings, callback).run(problem, result)


def _posed_on(problem: ContactProblem, result: ContactResult | None, options: dict[str, Any]) -> ContactProblem:
    """The problem on a mesh of the kind that is refined; takes the element out of the options, which it checks."""
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem")
    if result is not None and not isinstance(result, ContactResult):
        raise InputError("result", result, "give an earlier ContactResult of the problem, or None")
    for name in ("initial", "throw"):
        if name in options:
            raise InputError(name, options[name], "is not for refine: meshes change, and failures are in the status")
    problem = with_element(problem, options.pop("element", None))
    if result is not None and isinstance(result.problem.mesh, TriangleMesh):
        return with_element(problem, "hct")
    if result is not None and isinstance(problem.mesh, TriangleMesh):
        raise InputError(
            "result", "on rectangles", "the problem is on triangles: leave the result out, or solve it there"
        )
    return problem


@dataclass(frozen=True, eq=False)
class _Loop(Generic[R]):
    """The rounds of one refinement."""

    strategy: Strategy[R]
    settings: Settings
    callback: Callable[[RefinementRound], object] | None

    def run(self, problem: ContactProblem, earlier: ContactResult | None) -> Refinement:
        """Solve, estimate, refine, until the target or a limit is reached."""
        rounds: list[R] = []
        if earlier is not None:
            problem = self.strategy.start(problem, earlier)
        first = result = self._first(problem)
        try:
            check_solved(first)
            while True:
                rounds.append(self.strategy.assessed(problem, result, rounds))
                if self.callback is not None:
                    self.callback(rounds[-1].record)
                self._check_limits(rounds)
                problem = self.strategy.next(rounds)
                result = self._solved(problem)
        except StopError as stop:
            return self._outcome(rounds, first, stop)

    def _first(self, problem: ContactProblem) -> ContactResult:
        """The result on the first mesh, which may raise."""
        try:
            return self.strategy.answer(problem)
        except TooLargeError as error:
            remedy = (
                f"the first mesh has about {error.unknowns} unknowns{self.strategy.counting}: allow more, or start "
                "coarser"
            )
            raise InputError("max_unknowns", self.settings.max_unknowns, remedy) from error

    def _solved(self, problem: ContactProblem) -> ContactResult:
        """The result on a later mesh."""
        try:
            result = self.strategy.answer(problem)
        except TooLargeError as error:
            raise StopError(RefinementStatus.UNKNOWNS) from error
        except QVIError as error:  # the same data were taken on the mesh before
            raise StopError(RefinementStatus.THIN_CELLS, str(error)) from error
        check_solved(result)
        return result

    def _check_limits(self, rounds: Sequence[R]) -> None:
        """`StopError` where the target or a limit is reached."""
        if rounds[-1].estimate <= self.settings.target:
            raise StopError(RefinementStatus.REACHED)
        if expired():
            raise StopError(RefinementStatus.TIME_LIMIT)
        if len(rounds) >= self.settings.max_rounds:
            raise StopError(RefinementStatus.ROUNDS)

    def _outcome(self, rounds: Sequence[R], first: ContactResult, stop: StopError) -> Refinement:
        name, target = self.settings.measure.name, self.settings.target
        if not rounds:
            nothing = (float("nan"), float("inf"), float("nan"), self.strategy.blank(first), ())
            return Refinement(first, stop.status, name, target, *nothing, stop.reason)
        last = rounds[-1]
        return Refinement(
            last.result,
            stop.status,
            name,
            target,
            last.value,
            last.estimate,
            last.unit,
            last.indicator,
            tuple(each.record for each in rounds),
            stop.reason,
        )
