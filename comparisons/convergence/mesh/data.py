"""Stored rows as a frame of meshes, and the parts of it that are compared."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from pandas import DataFrame, to_numeric

from comparisons.convergence.mesh.problems import PROBLEMS, Problem
from comparisons.convergence.mesh.study import APART, BRACKET, EQUILIBRIUM, UNIFORM
from comparisons.convergence.mesh.tractions import Tractions
from comparisons.lab.study import DONE, Row

_CASE: Final = ("problem", "sequence", "model", "size")
_NUMBERS: Final = ("force", "energy", "unknowns", "h", "seconds", "lower", "upper", "gap", "strain")
_OTHERS: Final = ("status", "message", "solved", "cells", "tractions", "ends", "bracketed", "guaranteed", "reasons")


@dataclass(frozen=True, eq=False)
class Meshes:
    """A study's meshes, see `meshes_of`."""

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


def meshes_of(rows: Sequence[Row]) -> DataFrame:
    """One line a mesh that was solved or should have been, in the order of the rows.

    The columns are problem, sequence, model and size of the case, and entries of the record, see `task.equilibrium`;
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
