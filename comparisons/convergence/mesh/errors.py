"""Stored rows as a frame of meshes, their errors, which of these mean something, and their orders."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from pandas import DataFrame, concat, to_numeric

from comparisons.convergence.mesh.orders import orders_of
from comparisons.convergence.mesh.problems import ENERGY, FORCE, PROBLEMS, TRACTIONS, Expected, Problem
from comparisons.convergence.mesh.references import Reference, errors_of, references_of
from comparisons.convergence.mesh.study import APART, BRACKET, EQUILIBRIUM, GOAL, GRADED, UNIFORM
from comparisons.convergence.mesh.tractions import Tractions
from comparisons.lab.study import DONE, Row

NAMES: Final = {UNIFORM: "equal cells", GRADED: "graded", GOAL: "adaptive (force)", APART: "adaptive (bounds)"}
"""Sequence with errors → what it is called in tables."""

_CASE: Final = ("problem", "sequence", "model", "size")
_NUMBERS: Final = ("force", "energy", "unknowns", "h", "seconds", "lower", "upper", "gap", "strain")
_OTHERS: Final = ("status", "message", "solved", "cells", "tractions", "ends", "bracketed", "guaranteed", "reasons")
_CURVE: Final = ["problem", "measure", "sequence"]
_MESH: Final = ["problem", "sequence", "cells", "unknowns", "h", "size"]


@dataclass(frozen=True, eq=False)
class Overview:
    """A study's meshes, see `meshes_of`, what they are compared with, and the errors."""

    meshes: DataFrame

    @cached_property
    def problems(self) -> list[Problem]:
        """Those with a solved mesh of equal cells."""
        found = [PROBLEMS[name] for name in self.meshes.problem.unique()]
        return [problem for problem in found if len(self.of(problem, UNIFORM))]

    @cached_property
    def _parts(self) -> dict[Any, DataFrame]:
        return dict(iter(self.meshes[self.meshes.solved].groupby(["problem", "sequence", "model"])))

    def of(self, problem: Problem, sequence: str, model: str = "") -> DataFrame:
        """The solved meshes of a sequence; the model is the one that has the stresses if none is asked for."""
        wanted = model or (BRACKET if sequence == APART else EQUILIBRIUM)
        return self._parts.get((problem.name, sequence, wanted), self.meshes[:0])

    @cached_property
    def bounded(self) -> DataFrame:
        """Meshes with both bounds."""
        return self.meshes[self.meshes.solved & self.meshes.gap.notna()]

    def brackets(self, problem: Problem) -> DataFrame:
        """Meshes of a problem with guaranteed bounds."""
        return self.bounded[(self.bounded.problem == problem.name) & self.bounded.guaranteed]

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


def meshes_of(rows: Sequence[Row]) -> DataFrame:
    """One line a mesh that was solved or should have been, in the order of the rows.

    The columns are problem, sequence, model and size of the case, and entries of the record, see `study.equilibrium`;
    the force is the problem's. Besides solved, bracketed (whether bounds were asked for), h = (number of cells)^−½,
    which is proportional to the cells' side where they are equal, and as cells their numbers along x and y, or the
    case's size where nothing is known.
    """
    meshes = DataFrame([line for row in rows for line in _lines(row)], columns=[*_CASE, *_NUMBERS, *_OTHERS])
    meshes[list(_NUMBERS)] = meshes[list(_NUMBERS)].apply(to_numeric)
    return meshes.astype(dict.fromkeys(("solved", "bracketed", "guaranteed"), bool))


def _lines(row: Row) -> Iterator[dict[str, Any]]:
    """A row that failed as a whole is one mesh without values."""
    case = {name: row.case[name] for name in _CASE}
    for record in row.result["meshes"] if row.status == DONE else [{"status": row.status, "message": row.reason}]:
        yield {**case, **record, **_derived(case, record)}


def _derived(case: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    nx, ny = record.get("cells") or (0, 0)
    return {
        "solved": record["status"] == "solved", "force": record.get(PROBLEMS[case["problem"]].force),
        "cells": f"{nx} × {ny}" if nx else f"size {case['size']}", "h": (nx * ny) ** -0.5 if nx else None,
        "tractions": Tractions.of_record(record) if "lines" in record else None, "bracketed": "guaranteed" in record,
        "guaranteed": record.get("guaranteed", False),
    }  # fmt: skip


def _expected(problem: str, measure: str, sequence: str) -> Expected | None:
    return PROBLEMS[problem].expected.get(measure) if sequence == UNIFORM else None


def slug(problem: Problem) -> str:
    """The problem's name as a word for links."""
    return problem.name.replace(" ", "-").replace(".", "_")


def ends_among(measures: Mapping[str, Reference]) -> list[str]:
    """The kinds of ends of zones among the measures of a problem."""
    return [measure for measure in measures if measure not in (FORCE, ENERGY, TRACTIONS)]
