"""The rounds of one refinement, whatever is refined: answer, assess, refine, until the target or a limit is reached."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic

from qvi_contact.basics.certainty import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import RefinementRound, RefinementStatus
from qvi_contact.refinement.rounds import A, R, StopError, Strategy, TooLargeError
from qvi_contact.solution.result import ContactResult
from solvers.basics.progress import expired


@dataclass(frozen=True, eq=False)
class Ended(Generic[A, R]):
    """What a loop leaves.

    Attributes
    ----------
    first : A
        The first answer.
    rounds : list of R
        Those that were assessed.
    stop : StopError
        The end, and why.

    """

    first: A
    rounds: list[R]
    stop: StopError


@dataclass(frozen=True, eq=False)
class Loop(Generic[A, R]):
    """A strategy, and who is told of its rounds."""

    strategy: Strategy[A, R]
    callback: Callable[[RefinementRound], object] | None

    def run(self, problem: ContactProblem, earlier: ContactResult | None) -> Ended[A, R]:
        """Answer, assess, refine, until the target or a limit is reached."""
        rounds: list[R] = []
        if earlier is not None:
            problem = self.strategy.start(problem, earlier)
        first = answer = self._first(problem)
        try:
            while True:
                rounds.append(self.strategy.assessed(problem, answer, rounds))
                if self.callback is not None:
                    self.callback(rounds[-1].record)
                self._check_limits(rounds)
                problem = self.strategy.next(rounds)
                answer = self._answered(problem)
        except StopError as stop:
            return Ended(first, rounds, stop)

    def _first(self, problem: ContactProblem) -> A:
        """The answer on the first mesh, which may raise."""
        try:
            return self.strategy.answer(problem)
        except TooLargeError as error:
            remedy = f"the first mesh has {error.unknowns} unknowns: allow more, or start coarser"
            raise InputError("max_unknowns", self.strategy.settings.max_unknowns, remedy) from error

    def _answered(self, problem: ContactProblem) -> A:
        """The answer on a later mesh."""
        try:
            return self.strategy.answer(problem)
        except TooLargeError as error:
            raise StopError(RefinementStatus.UNKNOWNS) from error
        except QVIError as error:  # the same data were taken on the mesh before
            late = RefinementStatus.TIME_LIMIT if expired() else RefinementStatus.THIN_CELLS
            raise StopError(late, str(error)) from error

    def _check_limits(self, rounds: Sequence[R]) -> None:
        """`StopError` where the target or a limit is reached."""
        settings = self.strategy.settings
        if rounds[-1].estimate <= settings.target:
            sure = rounds[-1].accuracy.certainty is Certainty.GUARANTEED
            raise StopError(
                RefinementStatus.REACHED if sure or not settings.guaranteed else RefinementStatus.NO_GUARANTEE
            )
        if expired():
            raise StopError(RefinementStatus.TIME_LIMIT)
        if len(rounds) >= settings.max_rounds:
            raise StopError(RefinementStatus.ROUNDS)
