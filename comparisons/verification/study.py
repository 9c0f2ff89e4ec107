"""The run: every chosen problem is solved, and what comes back is plain data."""

import math
from collections.abc import Sequence
from typing import Any

from comparisons.lab.machine import machine, versions
from comparisons.verification.chapter import Chapter, Problem, sentence
from comparisons.verification.row import Row, crash
from qvi_contact.basics.terminal import Advance

Document = dict[str, Any]

_STABLE = ("processor", "cores", "memory_bytes", "system", "python")


def step_count(chapters: Sequence[Chapter]) -> int:
    """Progress steps of `run`."""
    return sum(len(chapter.problems) for chapter in chapters)


def run(chapters: Sequence[Chapter], quick: bool, advance: Advance, only: Sequence[str] = ()) -> Document:
    """Compute all rows; `advance` is called after each problem; `only` are the names asked for.

    Returns
    -------
    dict
        Plain data for JSON, without times: chapters → problems → rows, what passed, machine and versions. What is not
        a finite number is None.

    """
    done = [_chapter(chapter, quick, advance) for chapter in chapters]
    rows = [row for chapter in done for problem in chapter["problems"] for row in problem["rows"]]
    passed = sum(row["passed"] for row in rows)
    return {
        "schema": "qvi-contact/verify/1",
        "quick": quick,
        "only": list(only),
        "passed": passed == len(rows) and passed > 0,
        "counts": {"rows": len(rows), "passed": passed, "failed": len(rows) - passed},
        "chapters": done,
        "machine": {name: value for name, value in machine().items() if name in _STABLE},
        "versions": versions(),
    }


def _chapter(chapter: Chapter, quick: bool, advance: Advance) -> Document:
    problems = []
    for name, problem in chapter.problems.items():
        rows = rows_of(name, problem, quick)
        problems.append({"name": name, "about": sentence(problem), "rows": [as_record(row) for row in rows]})
        advance(name)
    texts = {key: getattr(chapter, key) for key in ("name", "title", "shows", "reading", "failure")}
    return texts | {"problems": problems}


def rows_of(name: str, problem: Problem, quick: bool) -> list[Row]:
    """The rows of a problem; one that breaks off, or has none, ends in a failed row with the reason."""
    rows: list[Row] = []
    try:
        for row in problem(quick):
            rows.append(row.of(name))  # noqa: PERF401  # the rows before an error stay
    except Exception as error:  # whatever it is, the other problems go on
        return [*rows, crash(name, f"{type(error).__name__}: {' '.join(str(error).split())}")]
    return rows or [crash(name, "it has no rows")]


def as_record(row: Row) -> Document:
    """A row as plain data."""
    return {
        "quantity": row.quantity,
        "element": row.element,
        "reference": _plain(row.reference),
        "kind": None if row.kind is None else row.kind.value,
        "source": row.source,
        "ours": _plain(row.ours),
        "error": _plain(row.error),
        "measure": row.measure,
        "tolerance": row.tolerance,
        "ratio": _plain(row.ratio),
        "proof": row.proof.text,
        "certified": row.proof.passed,
        "passed": row.passed,
    }


def _plain(value: float | str) -> float | str | None:
    if isinstance(value, str):
        return value
    return float(value) if math.isfinite(value) else None
