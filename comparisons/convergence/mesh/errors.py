"""The errors of all meshes of the study, which of them mean something, and their orders."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Final

from pandas import DataFrame, concat

from comparisons.convergence.mesh.data import Meshes
from comparisons.convergence.mesh.orders import orders_of
from comparisons.convergence.mesh.problems import ENERGY, FORCE, PROBLEMS, TRACTIONS, Expected, Problem
from comparisons.convergence.mesh.references import Reference, errors_of, references_of
from comparisons.convergence.mesh.study import APART, GOAL, GRADED, UNIFORM

NAMES: Final = {UNIFORM: "equal cells", GRADED: "graded", GOAL: "adaptive (force)", APART: "adaptive (bounds)"}
"""Sequence with errors → what it is called in tables."""

_CURVE: Final = ["problem", "measure", "sequence"]
_MESH: Final = ["problem", "sequence", "cells", "unknowns", "h", "size"]


class Overview(Meshes):
    """A study's meshes, what they are compared with, and the errors."""

    @cached_property
    def references(self) -> dict[str, dict[str, Reference]]:
        """Problem's name → measure → what it is compared with."""
        return {problem.name: references_of(self, problem) for problem in self.problems}

    @cached_property
    def errors(self) -> DataFrame:
        """One line a mesh and measure, by problem, measure and sequence.

        The columns are these, mesh (its line in the frame of meshes), cells, unknowns, h, size, error (relative) and
        meant (whether it is above the reference's uncertainty).
        """
        parts = [self.meshes[:0][_MESH].assign(measure="", error=0.0, least=0.0)]
        for problem in self.problems:
            for measure, known in self.references[problem.name].items():
                for sequence in NAMES:
                    if len(meshes := self.of(problem, sequence)):
                        error = errors_of(meshes, measure, known)
                        parts.append(meshes[_MESH].assign(measure=measure, error=error, least=known.least))
        found = concat(parts[1:] or parts).dropna(subset="error").rename_axis("mesh").reset_index()
        return found.assign(meant=found.error > found.least)

    @cached_property
    def _curves(self) -> dict[Any, DataFrame]:
        return dict(iter(self.errors.groupby(_CURVE, sort=False)))

    def curve(self, problem: Problem, measure: str, sequence: str) -> DataFrame:
        """The errors of a measure along a sequence; none is an empty frame."""
        return self._curves.get((problem.name, measure, sequence), self.errors[:0])

    @cached_property
    def orders(self) -> DataFrame:
        """One line a curve: problem, measure, sequence, and the entries of `orders_of`."""
        lines = [
            dict(zip(_CURVE, place, strict=True)) | orders_of(points, _expected(*place))
            for place, points in self._curves.items()
        ]
        return DataFrame(lines, columns=[*_CURVE, *orders_of(self.errors[:0])])

    @cached_property
    def exact(self) -> list[Problem]:
        """Problems whose force every mesh gives up to the accuracy of the solves."""
        meant = self.errors[self.errors.measure == FORCE].groupby("problem").meant.any()
        return [
            problem for problem in self.problems
            if FORCE in problem.known and problem.known[FORCE].uncertainty == 0.0 and not meant.get(problem.name, True)
        ]  # fmt: skip

    def least(self, problem: Problem) -> float:
        """Relative errors of the force from here down mean nothing; infinite where it has no reference."""
        known = self.references[problem.name].get(FORCE)
        return float("inf") if known is None else known.least


def _expected(problem: str, measure: str, sequence: str) -> Expected | None:
    return PROBLEMS[problem].expected.get(measure) if sequence == UNIFORM else None


def slug(problem: Problem) -> str:
    """The problem's name as a word for links."""
    return problem.name.replace(" ", "-").replace(".", "_")


def ends_among(measures: Mapping[str, Reference]) -> list[str]:
    """The kinds of ends of zones among the measures of a problem."""
    return [measure for measure in measures if measure not in (FORCE, ENERGY, TRACTIONS)]
