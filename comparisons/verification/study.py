"""The manual's chapters, and the run: every chosen problem is solved, and what comes back is plain data."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, Final

from comparisons.lab.machine import machine, versions
from comparisons.lab.study.rows import finite_json
from comparisons.verification.row import Chapters, Problem, Row, crash
from qvi_contact.basics.terminal import Advance
from qvi_contact.errors import InputError

Document = dict[str, Any]

_NAMES: Final = (
    "paper", "exact", "friction", "ssnv128", "benchmarks", "curves", "limits", "not-unique", "invariance", "plate",
    "energies", "bounds", "examples",
)  # fmt: skip

CHAPTERS: Final[Chapters] = {
    name: import_module(f"comparisons.verification.chapters.{name.replace('-', '_')}").PROBLEMS for name in _NAMES
}
"""The manual in its order: each chapter is a module of its name."""


def choose(names: Sequence[str], chapters: Chapters = CHAPTERS) -> Chapters:
    """The chapters with the problems of these names, in the manual's order; all if there are no names.

    Parameters
    ----------
    names : sequence of str
        Names of chapters or of problems.
    chapters : mapping
        What to choose from.

    Raises
    ------
    InputError
        If a name is unknown.

    """
    known = [*chapters, *(name for problems in chapters.values() for name in problems)]
    for name in names:
        if name not in known:
            raise InputError("--only", name, f"choose from {', '.join(known)}")
    if not names:
        return chapters
    chosen = {
        chapter: {name: problem for name, problem in problems.items() if {chapter, name} & set(names)}
        for chapter, problems in chapters.items()
    }
    return {chapter: problems for chapter, problems in chosen.items() if problems}


def step_count(chapters: Chapters) -> int:
    """Progress steps of `run`."""
    return sum(map(len, chapters.values()))


def run(chapters: Chapters, quick: bool, advance: Advance, only: Sequence[str] = ()) -> Document:
    """Compute all rows; `advance` is called after each problem; `only` are the names asked for.

    Returns
    -------
    dict
        Plain data for JSON, without times: chapters → problems → rows, what passed, machine and versions. What is not
        a finite number is None.

    """
    done: list[Document] = [
        {"name": name, "problems": _problems(each, quick, advance)} for name, each in chapters.items()
    ]
    rows = [row for chapter in done for problem in chapter["problems"] for row in problem["rows"]]
    passed = sum(row["passed"] for row in rows)
    return {
        "schema": "qvi-contact/verify/2",
        "quick": quick,
        "only": list(only),
        "passed": passed == len(rows) and passed > 0,
        "counts": {"rows": len(rows), "passed": passed, "failed": len(rows) - passed},
        "chapters": done,
        "machine": machine(),
        "versions": {name: version for name, version in versions().items() if version},
    }


def _problems(problems: Mapping[str, Problem], quick: bool, advance: Advance) -> list[Document]:
    done = []
    for name, problem in problems.items():
        rows = rows_of(name, problem, quick)
        done.append({"name": name, "about": _about(problem), "rows": [as_record(row) for row in rows]})
        advance(name)
    return done


def _about(problem: Problem) -> str:
    """What a problem is: the first paragraph of its docstring, on one line."""
    return " ".join((problem.__doc__ or "").strip().split("\n\n")[0].split())


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
    record = {
        "quantity": row.quantity, "element": row.element, "reference": row.reference,
        "kind": None if row.kind is None else row.kind.value, "source": row.source, "ours": row.ours,
        "error": row.error, "measure": row.measure, "tolerance": row.tolerance, "ratio": row.ratio,
        "proof": row.proof.text, "certified": row.proof.passed, "passed": row.passed,
    }  # fmt: skip
    return dict(finite_json(record, null=True))
