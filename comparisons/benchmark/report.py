"""The report of a run, from its document alone."""

import json
from functools import partial
from typing import Any

from comparisons.benchmark.figures import picture
from comparisons.benchmark.measures import values_of
from comparisons.benchmark.reference import CONVERGED_FRICTION, MEANINGLESS, SETTLED
from comparisons.benchmark.tables import tables_of
from comparisons.lab.report import Document as Report
from comparisons.lab.report import drawn, render
from comparisons.lab.report.numbers import NOTHING, memory, significant
from comparisons.lab.tables import Grid

Document = dict[str, Any]


def as_json(document: Document) -> str:
    """The document as text."""
    return json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False)


def report(document: Document) -> Report:
    """The report; the same document gives the same one."""
    friction = _friction(document)
    values = {**values_of(document), "friction": friction, "settled": SETTLED, "meaningless": MEANINGLESS}
    figures = {"times": drawn("benchmark", partial(picture, document, friction))}
    return render("comparisons.benchmark", "benchmark", values, tables_of(document), figures, [settings(document)])


def _friction(document: Document) -> float:
    """μ of the picture: that with known forces if it is among those measured, else the first."""
    measured = [row["friction"] for row in document["solves"]]
    return CONVERGED_FRICTION if CONVERGED_FRICTION in measured else min(measured)


def settings(document: Document) -> Grid:
    """Machine, versions, threads, command, date."""
    machine = document["machine"]
    lines = [
        ("processor", machine["processor"]), ("cores", str(machine["cores"])),
        ("memory", memory(machine["memory_bytes"])), ("system", machine["system"]), ("Python", machine["python"]),
        ("load before the run", significant(machine["load_average"])), ("threads", str(document["threads"])),
        ("begun", document["began"] or NOTHING), *document["versions"].items(),
    ]  # fmt: skip
    return Grid("Run, machine, versions", ("setting", "value"), lines)
