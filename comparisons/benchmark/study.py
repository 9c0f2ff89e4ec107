"""The run: everything is measured in processes of its own, one at a time; what comes back is plain data."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any, Final

from comparisons.benchmark.plan import GRADED, GRADED_FRICTION, LOOPS, Loop, Path, Plan
from comparisons.benchmark.process import records
from comparisons.benchmark.ratios import median, predicted
from comparisons.lab.machine import machine, versions
from qvi_contact.basics.terminal import Advance
from solvers.factorisation import available_backends
from solvers.factorisation.choice import SHARED

Record = dict[str, Any]

TOO_LONG: Final = 60.0
"""Seconds beyond which a plain factorisation is not measured."""

_OFTEN: Final = 10.0  # seconds up to which other libraries' factorisations are repeated
_FREE: Final = 16384 * 4  # unknowns up to which nothing is predicted
_PROBE: Final = 128  # cells a side of the problem that a prediction starts from
_LOOP_REPETITIONS: Final = 3
_QUICK: Final = 20.0  # seconds up to which a loop is repeated


@dataclass
class Study:
    """What was measured, as records of `measure` with the number of cells and the path added.

    Attributes
    ----------
    plan : settings
    machine, versions : where
    began : date and time, UTC
    solves, plain, memory, loops, graded : the records
    ends : (cells, path name) → why a process ended early

    """

    plan: Plan
    machine: Record
    versions: dict[str, str]
    began: str
    solves: list[Record] = field(default_factory=list)
    plain: list[Record] = field(default_factory=list)
    memory: list[Record] = field(default_factory=list)
    loops: list[Record] = field(default_factory=list)
    graded: list[Record] = field(default_factory=list)
    ends: dict[tuple[int, str], str] = field(default_factory=dict)


def run(plan: Plan, advance: Advance) -> Study:
    """Measure everything in the plan; `advance` is called after each step."""
    study = Study(plan, machine(), versions(), datetime.now(UTC).isoformat(timespec="seconds"))
    _graded(study, advance)
    for cells in plan.cells:
        for path in plan.paths:
            _solves(study, cells, path, advance)
    if plan.naive:
        for way in LOOPS:
            study.loops += _loop(plan, way, advance)
    return study


def _solves(study: Study, cells: int, path: Path, advance: Advance) -> None:
    """Whole solves and plain factorisations for one number of cells."""
    plan = study.plan
    task = {
        "task": "solves", "cells": cells, "friction": plan.friction, "factorisation": path.factorisation,
        "threads": plan.threads, "repetitions": plan.repetitions(cells), "plain": _plain(study, cells, path),
    }  # fmt: skip
    homes = {"solve": study.solves, "plain": study.plain, "memory": study.memory}
    for record in records(task, plan.threads):
        kind = record.pop("kind")
        if kind == "end":
            study.ends[cells, path.name] = record["reason"]
        else:
            homes[kind].append({"cells": cells, "path": path.name, **record})
        if kind == "solve":
            advance(f"{cells}², {path.name}, μ = {record['friction']:g}")


def _plain(study: Study, cells: int, path: Path) -> dict[str, int]:
    """Repetitions by back end of the plain factorisations beside a path; says in the study what is left out."""
    own, count = path.factorisation, study.plan.repetitions(cells)
    known = seconds_by_backend(study.plain, cells)
    if own == SHARED and known:
        return {min(known, key=lambda name: known[name]): count}
    wanted = {}
    for backend in available_backends():
        seconds = _expected(study, backend, cells)
        if seconds > TOO_LONG and backend != own:
            message = f"not run: about {seconds:.0f} s expected"
            skipped = {"backend": backend, "status": "skipped", "message": message, "seconds": {}}
            study.plain.append({"cells": cells, "path": path.name, **skipped})
        else:
            wanted[backend] = count if backend == own or seconds <= _OFTEN else 1
    return wanted


def _expected(study: Study, backend: str, cells: int) -> float:
    """Seconds that a plain factorisation will take, from smaller ones; 0 where it is short anyway."""
    unknowns = 4 * cells**2
    if unknowns <= _FREE:
        return 0.0
    known = _smaller(study.plain, backend, unknowns)
    if known is None:
        task = {
            "task": "solves", "cells": _PROBE, "friction": (), "factorisation": "auto",
            "threads": study.plan.threads, "repetitions": 0, "plain": {backend: 1},
        }  # fmt: skip
        probes = [record for record in records(task, study.plan.threads) if record["kind"] == "plain"]
        known = _smaller(probes, backend, unknowns)
    return predicted(known, unknowns) if known is not None else 0.0


def _smaller(plain: list[Record], backend: str, unknowns: int) -> tuple[int, float] | None:
    """(unknowns, seconds) of the largest problem below this size that the back end was measured on."""
    found = [r for r in plain if r["backend"] == backend and r["seconds"] and r["unknowns"] < unknowns]
    largest = max((r["unknowns"] for r in found), default=None)
    seconds = median([r["seconds"]["plain"] for r in found if r["unknowns"] == largest])
    return None if largest is None or seconds is None else (largest, seconds)


def seconds_by_backend(plain: list[Record], cells: int, path: str | None = None) -> dict[str, float]:
    """Medians of the plain factorisations on this many cells, beside one path or beside any."""
    found: dict[str, list[float]] = {}
    for record in plain:
        if record["cells"] == cells and path in (None, record["path"]) and record["seconds"]:
            found.setdefault(record["backend"], []).append(record["seconds"]["plain"])
    return {backend: seconds for backend, times in found.items() if (seconds := median(times)) is not None}


def _loop(plan: Plan, way: Loop, advance: Advance) -> Iterator[Record]:
    """Rows of one loop for all numbers of cells; nothing larger is tried once the limit was exceeded."""
    over = ""
    for cells in plan.cells:
        row: Record = {"cells": cells, "friction": plan.loop_friction, "name": way.name, "options": way.options}
        if cells > way.largest or over:
            message = over or f"not run: more than {way.largest}² cells"
            yield {**row, "status": "not run", "message": message, "seconds": []}
        else:
            yield (row := {**row, **_repeated_loop(plan, way, cells)})
            over = f"not run: {row['message']} on {cells}² cells" if row["status"] == "over limit" else ""
        advance(f"{cells}², {way.name}")


def _repeated_loop(plan: Plan, way: Loop, cells: int) -> Record:
    """A few runs of a loop where it is quick, else one; each in a process of its own."""
    task = {
        "task": "loop", "cells": cells, "friction": plan.loop_friction, "threads": plan.threads, "options": way.options
    }  # fmt: skip
    record: Record = {}
    seconds: list[float] = []
    for _ in range(min(plan.repetitions(cells), _LOOP_REPETITIONS)):
        record = _one_loop(task, plan)
        seconds += [record["seconds"]["solve"]] if record["seconds"] else []
        if not record["seconds"] or record["seconds"]["solve"] > _QUICK:
            break
    return {**record, "seconds": seconds}


def _one_loop(task: Record, plan: Plan) -> Record:
    found = list(records(task, plan.threads, plan.limit))
    reason = found[-1]["reason"]
    if reason:
        status = "over limit" if reason.startswith("more than") else "error"
        return {"status": status, "message": reason, "seconds": {}}
    return {key: value for key, value in found[0].items() if key != "kind"}


def _graded(study: Study, advance: Advance) -> None:
    """Accuracy against time on graded meshes, one thread."""
    plan = study.plan
    task = {
        "task": "accuracy", "meshes": GRADED, "friction": GRADED_FRICTION, "factorisation": plan.sparse, "threads": 1,
        "repetitions": plan.graded_repetitions,
    }  # fmt: skip
    for record in records(task, 1):
        kind = record.pop("kind")
        if kind == "end":
            study.ends[0, "graded"] = record["reason"]
        else:
            study.graded.append(record)
            advance(f"{record['cells']}² graded, μ = {record['friction']:g}")
