"""All curves of a study, computed once for tables, figures and findings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

from comparisons.convergence.mesh.data import Data, Mesh
from comparisons.convergence.mesh.errors import ENERGY, FORCE, TRACTIONS, Curve, References, curve, references
from comparisons.convergence.mesh.problems import Problem
from comparisons.convergence.mesh.study import APART, BRACKET, GOAL, GRADED, UNIFORM
from comparisons.convergence.orders import reached

SHOWN: Final = (UNIFORM, GRADED, GOAL, APART)
"""Sequences with curves, in this order."""

TARGETS: Final = (1e-3, 1e-4, 1e-5)
"""Relative errors of the force whose cost is told."""

NAMES: Final = {UNIFORM: "equal cells", GRADED: "graded", GOAL: "adaptive (force)", APART: "adaptive (bounds)"}
"""Sequence → what it is called in tables."""


@dataclass(frozen=True, eq=False)
class Overview:
    """A study's meshes, the references of its problems, and the errors."""

    data: Data

    @cached_property
    def references(self) -> dict[str, References]:
        """Problem's name → what it is compared with; problems without a solved mesh are left out."""
        solved = [problem for problem in self.data.problems if self.data.of(problem, UNIFORM)]
        return {problem.name: references(self.data, problem) for problem in solved}

    @property
    def problems(self) -> list[Problem]:
        """The problems that have references."""
        return [problem for problem in self.data.problems if problem.name in self.references]

    @cached_property
    def curves(self) -> list[Curve]:
        """All of them: problem by problem, measure by measure, sequence by sequence."""
        return list(self._curves())

    def _curves(self) -> Iterator[Curve]:
        for problem in self.problems:
            known = self.references[problem.name]
            for measure in known.measures:
                for sequence in SHOWN:
                    found = curve(self.data, problem, known, sequence, measure)
                    if found is not None:
                        yield found

    def curves_of(self, problem: Problem, measure: str) -> list[Curve]:
        """Those of one problem and measure."""
        return [each for each in self.curves if each.problem is problem and each.measure == measure]

    def curve_of(self, problem: Problem, measure: str, sequence: str) -> Curve | None:
        """One of them."""
        return next((each for each in self.curves_of(problem, measure) if each.sequence == sequence), None)

    def is_exact(self, problem: Problem) -> bool:
        """Whether every mesh gives the force up to the accuracy of the solves."""
        curves, known = self.curves_of(problem, FORCE), problem.known.get(FORCE)
        exact = known is not None and known.uncertainty == 0.0
        return exact and bool(curves) and not any(any(each.meant) for each in curves)

    def brackets(self, problem: Problem, sequence: str, guaranteed: bool = True) -> list[Mesh]:
        """Meshes with both bounds."""
        found = self.data.of(problem, sequence, BRACKET)
        return [m for m in found if m.record["gap"] is not None and m.record["guaranteed"] == guaranteed]


def cost(found: Curve | None, target: float) -> float | None:
    """Unknowns from which on the error stays within the target; None without a curve, or if it is not reached.

    An error that means nothing counts as the reference's uncertainty.
    """
    if found is None:
        return None
    return reached([float(mesh.unknowns) for mesh in found.meshes], found.errors, target)


def slug(problem: Problem) -> str:
    """The problem's name as a word for links."""
    return problem.name.replace(" ", "-").replace(".", "_")


def ends_of(known: References) -> list[str]:
    """The kinds of ends of zones that a problem has."""
    return [measure for measure in known.measures if measure not in (FORCE, ENERGY, TRACTIONS)]


def finest(meshes: Sequence[Mesh]) -> Mesh | None:
    """The mesh with the most unknowns."""
    return max(meshes, key=lambda mesh: mesh.unknowns, default=None)
