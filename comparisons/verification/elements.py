"""The elements that the manual runs on: each problem lists those it is solved with, and each row names its own."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, Final

from comparisons.verification.row import Problem, Row
from qvi_contact import ContactProblem, ContactResult, History, solve, solve_history
from qvi_contact.companion import CompanionResult, solve_companion
from qvi_contact.limit.load_factor import LimitLoad, limit_load


@dataclass(frozen=True)
class Element:
    """An element of Φ, and what is solved with it.

    Attributes
    ----------
    name : str
        What rows say.
    degree : int
        Degree p of Φ: tractions on an edge have p − 1 parameters or fewer.

    """

    name: str
    degree: int

    def solve(self, problem: ContactProblem, **options: Any) -> ContactResult:
        """As `solve` does it."""
        return solve(problem, degree=self.degree, **options)

    def solve_history(self, problems: Iterable[ContactProblem], **options: Any) -> History:
        """As `solve_history` does it."""
        return solve_history(problems, degree=self.degree, **options)

    def limit_load(self, problem: ContactProblem, loads: Sequence[str]) -> LimitLoad:
        """As `limit_load` does it."""
        return limit_load(problem, loads, degree=self.degree)

    def companion(self, problem: ContactProblem, degree: int | None = None) -> CompanionResult:
        """Displacements on the same mesh, see `solve_companion`."""
        return solve_companion(problem, degree=degree)


TRIANGLES: Final = Element("triangles of degree 4", 4)
QUINTIC: Final = Element("triangles of degree 5", 5)

OnElement = Callable[[Element, bool], Iterator[Row]]
"""A problem that yields its rows for one element."""


class Chapter(dict[str, Problem]):
    """Name of a problem → the problem, in the order in which a chapter of the manual defines them."""

    def named(self, name: str) -> Callable[[Problem], Problem]:
        """Make a problem one of this chapter."""

        def known(problem: Problem) -> Problem:
            self[name] = problem
            return problem

        return known

    def on(self, name: str, *elements: Element) -> Callable[[OnElement], Problem]:
        """Make a problem one of this chapter that runs on each of these elements in turn; its rows name them.

        Quick runs take the second, if there are several.
        """

        def problem(rows: OnElement) -> Problem:
            @wraps(rows)
            def on_each(quick: bool) -> Iterator[Row]:
                for element in elements[:2][-1:] if quick else elements:
                    for row in rows(element, quick):
                        yield replace(row, element=element.name)

            return self.named(name)(on_each)

        return problem
