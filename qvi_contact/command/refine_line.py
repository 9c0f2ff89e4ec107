"""What the command line does and says about a refinement."""

import math
from collections.abc import Iterator, Mapping
from typing import Any, Final

from qvi_contact.basics.shown import Certainty, shown
from qvi_contact.basics.units import Units
from qvi_contact.command.report import table
from qvi_contact.command.solve_line import solving
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.refinement import Refinement, RefinementRound, refine
from qvi_contact.refinement.outcome import Outcome, unit_of

_KINDS: Final = {
    Certainty.ESTIMATE: "estimate",
    Certainty.GUARANTEED: "guaranteed",
}
"""What an error is, in tables."""


def refined(
    file: ProblemFile, asked: Mapping[str, Any], options: Mapping[str, Any], *, verbose: bool = False
) -> Refinement:
    """The problem refined, with a line on standard error that says what the last round has found, or all of them."""
    with solving(file.title or "refine", verbose=verbose) as advance:
        found: Refinement = refine(
            file.problem, **asked, **options, callback=lambda done: advance(_so_far(done)), verbose=verbose
        )
    return found


def document(found: Outcome, units: Units) -> dict[str, Any]:
    """Outcome and rounds for programs: numbers that are not finite are None, errors are relative."""
    unit = unit_of(found.quantity, units)
    return {
        "status": found.status.value,
        "quantity": found.quantity,
        "value": {"value": _finite(found.value), "unit": unit},
        "target": found.target,
        "estimate": _finite(found.estimate),
        "guaranteed": found.guaranteed,
        "certainty": str(found.certainty),
        "message": found.message,
        "advice": found.status.advice,
        "rounds": [
            {
                "cells": [each.cells],
                "unknowns": each.unknowns,
                "value": _finite(each.value),
                "estimate": _finite(each.estimate),
                "guaranteed": each.guaranteed,
                "certainty": str(each.certainty),
            }
            for each in found.rounds
        ],
    }


def lines(found: Refinement, units: Units) -> Iterator[str]:
    """The rounds as a table, then how it ended and how far the number can be trusted."""
    if found.rounds:
        yield from table(headings(found, units), rows(found))
        yield ""
    yield found.message
    if found.rounds:
        yield trust(found, units)
    if found.status != "reached" and (found.rounds or found.result.status.advice not in found.message):
        yield found.status.advice


def headings(found: Refinement, units: Units) -> list[str]:
    """Headings of `rows`."""
    return ["round", "cells", "unknowns", f"{found.quantity} [{unit_of(found.quantity, units)}]", "relative error", ""]


def rows(found: Refinement) -> list[list[str]]:
    """Cells, unknowns, value and relative error of each round, and what the error is."""
    return [
        [
            str(number),
            str(each.cells),
            str(each.unknowns),
            f"{each.value:.9g}",
            _error(each),
            _kind(each),
        ]
        for number, each in enumerate(found.rounds, 1)
    ]


def trust(found: Refinement, units: Units) -> str:
    """Whether the last error is a bound, in a sentence."""
    if not math.isfinite(found.estimate):
        return "Error: not known."
    size = f"{shown(found.error, digits=2)} {unit_of(found.quantity, units)}"
    if found.certainty is Certainty.ESTIMATE:
        return f"Error: about {size}. This is an estimate, not a guaranteed bound."
    return f"Error: at most {size}. This is a guaranteed bound, up to rounding."


def _so_far(done: RefinementRound) -> str:
    """A round in the line of the progress."""
    return f"{done.unknowns} unknowns, relative error {_error(done)} ({_kind(done) or 'not known'})"


def _error(each: RefinementRound) -> str:
    return f"{each.estimate:.1e}" if math.isfinite(each.estimate) else "-"


def _kind(each: RefinementRound) -> str:
    if not math.isfinite(each.estimate):
        return ""
    return _KINDS[each.certainty]


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
