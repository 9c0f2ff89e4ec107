"""The manual, from the document of a run and the pictures of its problems."""

import json
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any, Final

from comparisons.lab.marks import escaped
from comparisons.lab.report import Document as Report
from comparisons.lab.report import drawn, render
from comparisons.verification import benchmarks, exact_states, manufactured, strict
from comparisons.verification.exhibits import EXHIBITS
from comparisons.verification.figures import conservation, overview
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

_CONSERVATION: Final = "conservation"
_CAPTIONS: Final = {
    **{name: shown.caption for name, shown in EXHIBITS.items()},
    _CONSERVATION: "What each model leaves of the forces and moments on a body: rounding, or its error.",
}


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def report(document: Document, pictures: Mapping[str, str], results: Mapping[str, str] | None = None) -> Report:
    """The manual, with pictures of problems and of their results by the names of the problems.

    The same document and pictures give the same one.
    """
    results = {**_from_rows(document), **(results or {})}
    chapters = {
        chapter["name"]: [_problem(problem, pictures, results) for problem in chapter["problems"]]
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
        **{_result_name(name): picture for name, picture in results.items()},
    }
    return render("comparisons.verification", "verification", values, tables_of(document), figures)


def command_of(document: Document) -> str:
    """The command that computes the same."""
    only = ["--only", *document["only"]] if document["only"] else []
    return " ".join(["python -m comparisons verify", *only, *(["--quick"] if document["quick"] else [])])


def _problem(problem: Document, pictures: Mapping[str, str], results: Mapping[str, str]) -> Document:
    name = problem["name"]
    exhibits = []
    if name in pictures:
        exhibits.append((_picture_name(name), f"{name}: bodies, loads, supports and contacts, on a coarser mesh"))
    if name in results:
        exhibits.append((_result_name(name), _CAPTIONS[name]))
    return {"name": name, "about": escaped(problem["about"]), "table": table_name(name), "exhibits": exhibits}


def _from_rows(document: Document) -> dict[str, str]:
    """Pictures of results that the rows themselves hold, by the names of their problems."""
    draw = partial(conservation, document)
    names = [problem["name"] for problem in problems_of(document)]
    return {name: drawn(f"result-{name}", draw) for name in names if name == _CONSERVATION}


def _picture_name(problem: str) -> str:
    return f"problem-{table_name(problem)}"


def _result_name(problem: str) -> str:
    return f"result-{table_name(problem)}"


def _failed(document: Document) -> Iterator[Document]:
    """The cells of every failed row, and the name and the table of its problem."""
    for problem in problems_of(document):
        for row in problem["rows"]:
            if not row["passed"]:
                texts = dict(zip(HEADINGS, map(escaped, cells(row)), strict=True))
                yield {**texts, "name": problem["name"], "table": table_name(problem["name"])}
