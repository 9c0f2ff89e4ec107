"""Stored rows as a frame of meshes."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.mesh.problems import PROBLEMS
from comparisons.convergence.mesh.tractions import Tractions
from comparisons.lab.study import DONE, Row

if TYPE_CHECKING:
    from pandas import DataFrame

SOLVED: Final = "solved"

_CASE: Final = ("problem", "sequence", "model", "size")
_NUMBERS: Final = ("force", "energy", "unknowns", "h", "seconds", "lower", "upper", "gap", "strain")
_OTHERS: Final = ("status", "message", "solved", "cells", "tractions", "ends", "bracketed", "guaranteed", "reasons")


def meshes_of(rows: Sequence[Row]) -> "DataFrame":
    """One line a mesh that was solved or should have been, in the order of the rows.

    The columns are problem, sequence, model and size of the case, and entries of the record, see `task.equilibrium`;
    the force is the problem's. Besides solved, bracketed (whether bounds were asked for), h = (number of cells)^−½,
    which is proportional to the cells' side where they are equal, and as cells their numbers along x and y, or the
    case's size where nothing is known.
    """
    from pandas import DataFrame, to_numeric

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
        "solved": record["status"] == SOLVED, "force": record.get(PROBLEMS[case["problem"]].force),
        "cells": f"{nx} × {ny}" if nx else f"size {case['size']}", "h": (nx * ny) ** -0.5 if nx else None,
        "tractions": Tractions.of_record(record) if "lines" in record else None, "bracketed": "guaranteed" in record,
        "guaranteed": record.get("guaranteed", False),
    }  # fmt: skip
