"""What the command line says of several solutions of one problem."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from qvi_contact.basics.shown import Rounding
from qvi_contact.basics.units import Units
from qvi_contact.command.report import contact_tables, result_lines
from qvi_contact.files.export import summary
from qvi_contact.solution.result import ContactResult
from solvers.solution import WHAT_TO_DO

if TYPE_CHECKING:
    from qvi_contact.bracket import Branches


def lines(result: ContactResult, found: Branches | None, units: Units) -> Iterator[str]:
    """The answer of the solve, what the search found, and a table with a row for each solution if there are several.

    Without a search, as after a solve that failed, the answer alone.
    """
    yield from result_lines(result, units)
    if found is None:
        return
    yield from ("", units.filled(found.message))
    if len(found.results) > 1:
        least = Rounding.largest(each.rounding for each in found.results)

        def first(number: int, _result: ContactResult) -> list[str]:
            distance = found.distances[number]
            return [str(number + 1), f"{100.0 * distance:.2g} %" if math.isfinite(distance) else ""]

        yield ""
        yield from contact_tables(found.results, ["solution", "from displacements"], first, least, units)
        yield WHAT_TO_DO


def document(result: ContactResult, found: Branches | None, units: Units) -> dict[str, Any]:
    """The same for programs: a summary of each solution, the preferred one first; a distance not known is None."""
    results, distances = ((result,), (math.nan,)) if found is None else (found.results, found.distances)
    solutions = [
        {"distance": distance if math.isfinite(distance) else None, **summary(each, units)}
        for each, distance in zip(results, distances, strict=True)
    ]
    return {"message": units.filled(result.message if found is None else found.message), "solutions": solutions}
