"""The manual, from the document of a run and the pictures of its problems."""

import json
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final

from comparisons.lab.report import Document as Report
from comparisons.lab.report import drawn, render
from comparisons.lab.report.marks import escaped
from comparisons.verification import benchmarks, exact_states, manufactured, strict
from comparisons.verification.figures import overview
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


def report(document: Document, pictures: Mapping[str, str]) -> Report:
    """The manual, with pictures by the names of their problems; the same document and pictures give the same one."""
    chapters = {
        chapter["name"]: [_problem(problem, pictures) for problem in chapter["problems"]]
        for chapter in document["chapters"]
    }
    values = {
        "rows": document["counts"]["rows"], "failed": list(_failed(document)), "tolerances": TOLERANCES,
        "chapters": chapters, "machine": document["machine"], "versions": document["versions"],
        "command": command_of(document),
    }  # fmt: skip
    figures = {
        "overview": drawn("verification-overview", partial(overview, document)),
        **{_picture_name(name): picture for name, picture in pictures.items()},
    }
    return render("comparisons.verification", "verification", values, tables_of(document), figures)


def command_of(document: Document) -> str:
    """The command that computes the same."""
    only = ["--only", *document["only"]] if document["only"] else []
    return " ".join(["python -m comparisons verify", *only, *(["--quick"] if document["quick"] else [])])


def _problem(problem: Document, pictures: Mapping[str, str]) -> Document:
    name = problem["name"]
    picture = _picture_name(name) if name in pictures else ""
    return {"name": name, "about": escaped(problem["about"]), "table": table_name(name), "picture": picture}


def _picture_name(problem: str) -> str:
    return f"problem-{problem}"


def _failed(document: Document) -> Iterator[Document]:
    """The cells of every failed row, and the name and the table of its problem."""
    for problem in problems_of(document):
        for row in problem["rows"]:
            if not row["passed"]:
                texts = dict(zip(HEADINGS, map(escaped, cells(row)), strict=True))
                yield {**texts, "name": problem["name"], "table": table_name(problem["name"])}
