"""The manual: its chapters, a run of them as plain data, the tables of its rows, and the report of all that."""

import json
import math
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import import_module
from itertools import chain
from typing import Any, Final

from comparisons.lab.drawing import drawn
from comparisons.lab.numbers import NOTHING
from comparisons.lab.reports import Report, escaped, render
from comparisons.lab.studies import machine, versions
from comparisons.verification.chapters import benchmarks, exact
from comparisons.verification.pictures import EXHIBITS, conservation, overview
from comparisons.verification.rows import EQUAL, EXCESS, RELATIVE, SHORTFALL, Chapters, Problem, Row, crash
from qvi_contact.basics.terminal import Advance
from qvi_contact.files.export import json_ready
from solvers.basics.names import known_name

Document = dict[str, Any]

_MODULES: Final = {
    "paper": "chapters.plate", "exact": "chapters.exact", "friction": "chapters.exact",
    "ssnv128": "chapters.benchmarks", "benchmarks": "chapters.benchmarks", "curves": "chapters.curves",
    "limits": "chapters.limits", "not-unique": "chapters.limits", "invariance": "chapters.exact",
    "plate": "chapters.plate", "energies": "chapters.plate", "bounds": "chapters.bounds", "examples": "known",
}  # fmt: skip

CHAPTERS: Final[Chapters] = {
    name: getattr(import_module(f"comparisons.verification.{module}"), name.replace("-", "_").upper())
    for name, module in _MODULES.items()
}
"""The manual in its order: each chapter stands in a module, under its name in capital letters."""

HEADINGS: Final = (
    "quantity", "element", "reference", "kind", "source", "ours", "error", "tolerance", "certificate", "result",
)  # fmt: skip
_DIGITS: Final = 10
_SENSES: Final = {EXCESS: "≤ ", SHORTFALL: "≥ "}
_DIGITS_OF_BOUNDS: Final = 1e-7  # what holds with room to spare needs no more digits
_ROUNDING: Final = 1e-10  # errors below this are one and the same on all machines


def choose(names: Sequence[str]) -> Chapters:
    """The chapters, or problems, of these names in the manual's order; all without names; `InputError` if unknown."""
    for name in names:
        known_name("--only", name, {"chapters": CHAPTERS, "problems": chain(*CHAPTERS.values())})
    if not names:
        return CHAPTERS
    chosen = {
        chapter: {name: problem for name, problem in problems.items() if {chapter, name} & set(names)}
        for chapter, problems in CHAPTERS.items()
    }
    return {chapter: problems for chapter, problems in chosen.items() if problems}


def run(chapters: Chapters, quick: bool, advance: Advance, only: Sequence[str] = ()) -> Document:
    """Compute all rows; `advance` is called after each problem; `only` are the names asked for.

    Returns
    -------
    dict
        Plain data for JSON, without times: chapters → problems → rows, what passed, machine and versions. What is not
        a finite number is None.

    """
    done: list[Document] = []
    for chapter, problems in chapters.items():
        found = []
        for name, problem in problems.items():
            about = " ".join((problem.__doc__ or "").strip().split("\n\n")[0].split())
            found.append({"name": name, "about": about, "rows": [as_record(row) for row in _rows_of(problem, quick)]})
            advance(name)
        done.append({"name": chapter, "problems": found})
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


def _rows_of(problem: Problem, quick: bool) -> list[Row]:
    """The rows of a problem; one that breaks off, or has none, ends in a failed row with the reason."""
    rows: list[Row] = []
    try:
        for row in problem(quick):
            rows.append(row)  # noqa: PERF402  # the rows before an error stay
    except Exception as error:  # whatever it is, the other problems go on
        return [*rows, crash(f"{type(error).__name__}: {' '.join(str(error).split())}")]
    return rows or [crash("it has no rows")]


def as_record(row: Row) -> Document:
    """A row as plain data."""
    record = {
        "quantity": row.quantity, "element": row.element, "reference": row.reference,
        "kind": None if row.kind is None else row.kind.value, "source": row.source, "ours": row.ours,
        "error": row.error, "measure": row.measure, "tolerance": row.tolerance, "ratio": row.ratio,
        "proof": row.proof.text, "certified": row.proof.passed, "passed": row.passed,
    }  # fmt: skip
    return dict(json_ready(record))


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def drawings(names: Sequence[str], quick: bool) -> dict[str, str]:
    """Names of figures → pictures, as SVG, of those of these problems that have any; empty without matplotlib."""
    found = {}
    for name in names:
        if name in EXHIBITS:
            table, exhibit = name.replace("/", "-"), EXHIBITS[name]
            found[f"problem-{table}"] = drawn(f"verification-{table}", exhibit.body)
            found[f"result-{table}"] = drawn(f"result-{table}", partial(exhibit.result, quick))
    return found


def report(document: Document, drawn_before: Mapping[str, str]) -> Report:
    """The manual, with `drawings`; the same document and pictures give the same one."""
    from pandas import DataFrame

    problems = [problem for chapter in document["chapters"] for problem in chapter["problems"]]
    tables, chapters, failed = {}, [], []
    captions = {name: exhibit.graph.__doc__ for name, exhibit in EXHIBITS.items()}
    figures = {"overview": drawn("verification-overview", partial(overview, problems)), **drawn_before}
    for problem in problems:
        name = problem["name"].replace("/", "-")
        tables[name] = DataFrame([cells(row) for row in problem["rows"]], columns=HEADINGS)
        for row in problem["rows"]:
            texts = dict(zip(HEADINGS, map(escaped, cells(row)), strict=True))
            failed += [] if row["passed"] else [{**texts, "name": problem["name"], "table": name}]
        if name == "conservation":
            figures[f"result-{name}"] = drawn(f"result-{name}", partial(conservation, problem["rows"]))
            captions[name] = conservation.__doc__
    for chapter in document["chapters"]:
        rows = [row for problem in chapter["problems"] for row in problem["rows"]]
        ratios = [row["ratio"] for row in rows]
        largest = NOTHING if None in ratios else f"{max(ratios):.2g}"
        counts = (len(chapter["problems"]), len(rows), sum(not row["passed"] for row in rows))
        chapters.append((chapter["name"], *map(str, counts), largest))
    headings = ("chapter", "problems", "rows", "failed", "largest error / tolerance")
    tables["chapters"] = DataFrame(chapters, columns=headings)
    told = {
        chapter["name"]: [{**problem, "about": escaped(problem["about"]), "table": problem["name"].replace("/", "-")}
                          for problem in chapter["problems"]]
        for chapter in document["chapters"]
    }  # fmt: skip
    values = {
        **document, "rows": document["counts"]["rows"], "failed": failed, "chapters": told, "captions": captions,
        "figures": figures,
        "tolerances": {"exact": exact.TOLERANCE, "friction": exact.TOLERANCE_WITH_FRICTION, "touching": exact.TOUCHING,
                       "balance": benchmarks.BALANCE},
    }  # fmt: skip
    bad = bool(failed) or not problems
    return render("comparisons.verification", "verification", values, tables, figures, failed=bad)


def cells(row: Document) -> tuple[str, ...]:
    """A row's texts, in the order of `HEADINGS`; inequalities have their sense, small errors a bound."""
    measure, ours, tolerance = row["measure"], row["ours"], row["tolerance"]
    resolution = 0.0  # a hundredth of the tolerance, in the unit of the quantity
    if not isinstance(ours, str) and ours is not None:
        scale = abs(row["reference"]) if measure == RELATIVE else 1.0
        resolution = max(tolerance * scale / 100.0, _DIGITS_OF_BOUNDS * abs(ours) if measure in _SENSES else 0.0)
    error, least = row["error"], max(_ROUNDING, 1e-3 * tolerance)
    if measure == EQUAL:
        missed = "equal" if error == 0.0 else "not equal"
    elif error is None:
        missed = NOTHING
    else:
        text = "0" if error == 0.0 else f"< {least:.0e}" if error < least else f"{error:.1e}"
        missed = f"{text} ({measure})"
    kind, source, element = (row[name] or "-" for name in ("kind", "source", "element"))
    return (
        row["quantity"], element, _SENSES.get(measure, "") + number(row["reference"]), kind, source,
        number(ours, resolution), missed, "-" if measure == EQUAL else f"{tolerance:.0e}", row["proof"],
        "passed" if row["passed"] else "FAILED",
    )  # fmt: skip


def number(value: float | str | None, resolution: float = 0.0) -> str:
    """A number without the digits below a resolution; words as they are."""
    if value is None:
        return NOTHING
    if isinstance(value, str):
        return value
    if abs(value) <= resolution or value == 0.0:
        return "0"
    digits = _DIGITS
    if resolution > 0.0:
        digits = min(digits, max(2, 1 + math.floor(math.log10(abs(value))) - math.floor(math.log10(resolution))))
    return f"{value:.{digits}g}"
