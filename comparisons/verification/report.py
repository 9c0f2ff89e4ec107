"""The manual, from the document of a run alone."""

import json
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

from comparisons.lab.report import Document as Report
from comparisons.lab.report import drawn, render
from comparisons.lab.report.marks import escaped
from comparisons.verification import benchmarks, exact_states, manufactured, strict
from comparisons.verification.figures import overview
from comparisons.verification.pictures import picture_name, pictures
from comparisons.verification.tables import HEADINGS, cells, problems_of, table_name, tables_of

Document = dict[str, Any]

TOLERANCES: Final = {
    "exact": exact_states.TOLERANCE,
    "friction": manufactured.TOLERANCE,
    "touching": manufactured.TOUCHING,
    "excess": strict.EXCESS,
    "balance": benchmarks.BALANCE,
}
"""Tolerances that the template names."""


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def report(document: Document) -> Report:
    """The manual; the same document gives the same one."""
    values = {
        "rows": document["counts"]["rows"], "failed": list(_failed(document)), "tolerances": TOLERANCES,
        "chapters": {chapter["name"]: list(map(_problem, chapter["problems"])) for chapter in document["chapters"]},
        "machine": document["machine"], "versions": document["versions"], "command": command_of(document),
    }  # fmt: skip
    names = [problem["name"] for problem in problems_of(document)]
    figures = {"overview": drawn("verification-overview", partial(overview, document)), **pictures(names)}
    return render("comparisons.verification", "verification", values, tables_of(document), figures)


def command_of(document: Document) -> str:
    """The command that computes the same."""
    only = ["--only", *document["only"]] if document["only"] else []
    return " ".join(["python -m comparisons verify", *only, *(["--quick"] if document["quick"] else [])])


def _problem(problem: Document) -> Document:
    name = problem["name"]
    return {
        "name": name, "about": escaped(problem["about"]), "table": table_name(name), "picture": picture_name(name),
    }  # fmt: skip


def _failed(document: Document) -> Iterator[Document]:
    """The cells of every failed row, and the name of its problem."""
    for problem in problems_of(document):
        for row in problem["rows"]:
            if not row["passed"]:
                texts = dict(zip(HEADINGS, map(escaped, cells(row)), strict=True))
                yield {**texts, **_problem(problem)}
