"""The manual, from the document of a run and the pictures of its problems."""

import json
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final

from comparisons.lab.marks import escaped
from comparisons.lab.report import Document as Report
from comparisons.lab.report import drawn, render
from comparisons.verification.chapters import benchmarks, exact, friction
from comparisons.verification.exhibits import EXHIBITS, conservation, overview
from comparisons.verification.tables import HEADINGS, cells, problems_of, table_name, tables_of

Document = dict[str, Any]

TOLERANCES: Final = {
    "exact": exact.TOLERANCE,
    "friction": friction.TOLERANCE,
    "touching": friction.TOUCHING,
    "balance": benchmarks.BALANCE,
}
"""Tolerances that the template names."""


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def report(document: Document, pictures: Mapping[str, str], results: Mapping[str, str] | None = None) -> Report:
    """The manual, with pictures of problems and of their results by the names of the problems.

    The same document and pictures give the same one.
    """
    balance = {problem["name"] for problem in problems_of(document)} & {"conservation"}  # drawn from its rows
    results = {name: drawn(f"result-{name}", partial(conservation, document)) for name in balance} | {**(results or {})}
    values = {
        **document, "rows": document["counts"]["rows"], "failed": list(_failed(document)), "tolerances": TOLERANCES,
        "chapters": {chapter["name"]: [*map(_told, chapter["problems"])] for chapter in document["chapters"]},
        "posed": pictures,
        "captions": {name: EXHIBITS[name].caption if name in EXHIBITS else conservation.__doc__ for name in results},
    }  # fmt: skip
    figures = {
        "overview": drawn("verification-overview", partial(overview, document)),
        **{f"problem-{table_name(name)}": picture for name, picture in pictures.items()},
        **{f"result-{table_name(name)}": picture for name, picture in results.items()},
    }
    return render("comparisons.verification", "verification", values, tables_of(document), figures)


def _told(problem: Document) -> Document:
    return {**problem, "about": escaped(problem["about"]), "table": table_name(problem["name"])}


def _failed(document: Document) -> Iterator[Document]:
    """The cells of every failed row, and the name and the table of its problem."""
    for problem in problems_of(document):
        for row in problem["rows"]:
            if not row["passed"]:
                texts = dict(zip(HEADINGS, map(escaped, cells(row)), strict=True))
                yield {**texts, "name": problem["name"], "table": table_name(problem["name"])}
