"""Medians, ratios and exponents of a run, as the rows of its tables and of the JSON document."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

from comparisons.benchmark import reference
from comparisons.benchmark.plan import GRADED, GRADED_FRICTION, LOOPS, TOLERANCE, Path, Plan
from comparisons.benchmark.ratios import growth, median, ratio, spread
from comparisons.benchmark.study import Record, Study, seconds_by_backend

PARTS = ("whole", "assembly", "solve", "factorisation", "interior_point", "certificate", "rest")
"""Times of a solve: whole = assembly + solve; the other four are parts of solve."""

_ANSWER = ("status", "message", "unknowns", "contact_points", "iterations", "corrections", "accuracy", "half_force")


def document(study: Study) -> dict[str, Any]:
    """The whole report as plain data for JSON; what is missing is null."""
    solves = solve_rows(study)
    loops = loop_rows(study, solves)
    graded = graded_rows(study)
    return {
        "schema": "qvi-contact/benchmark/1",
        "began": study.began,
        "command": study.plan.command,
        "machine": study.machine,
        "versions": study.versions,
        "threads": study.plan.threads,
        "tolerance": TOLERANCE,
        "units": {"half_force": "N/mm", "seconds": "s, wall time", "memory": "bytes"},
        "solves": solves,
        "plain": plain_rows(study),
        "memory": memory_rows(study),
        "growth": growth_rows(study, solves),
        "loops": loops,
        "graded": graded,
        "graded_targets": [{"error": error, "seconds": seconds} for error, seconds in reference.ACCURACY_TARGETS],
        "peers": [
            {**peer._asdict(), "error": reference.settled_error(peer.half_force, 0.2), "source": "reported"}
            for peer in reference.PEERS
        ],
    }


def solve_rows(study: Study) -> list[Record]:
    """One row for each number of cells, path and friction."""
    plan = study.plan
    return [_solve_row(study, cells, path, mu) for cells in plan.cells for path in plan.paths for mu in plan.friction]


def _solve_row(study: Study, cells: int, path: Path, friction: float) -> Record:
    found = [r for r in study.solves if (r["cells"], r["path"], r["friction"]) == (cells, path.name, friction)]
    row: Record = {"cells": cells, "path": path.name, "friction": friction, **_answer(found, study, cells, path.name)}
    row["library"] = found[-1].get("factorisation", path.factorisation) if found else path.factorisation
    row["half_force_error"] = reference.relative_error(row["half_force"], cells, friction)
    row["repetitions"] = len(found)
    row["seconds"] = {part: _times(found, part) for part in PARTS}
    row |= {part: median(row["seconds"][part]) for part in PARTS}
    row["solve_spread"] = spread(row["seconds"]["solve"])
    return row | _ratios(study, row, path)


def _ratios(study: Study, row: Record, path: Path) -> Record:
    """The solve over one factorisation of K: by the same library, and by the fastest of those measured beside it."""
    plain = seconds_by_backend(study.plain, row["cells"], path.name)
    fastest = min(plain, key=lambda name: plain[name], default=None)
    own = median(row["seconds"]["factorisation"]) if path.name == "shared" else plain.get(path.factorisation)
    best = None if fastest is None else plain[fastest]
    solve = row["solve"] if row["status"] == "solved" else None
    return {
        "own_factorisation": own,
        "fastest": fastest,
        "fastest_factorisation": best,
        "ratio_own": ratio(solve, own),
        "ratio_fastest": ratio(solve, best),
    }


def _answer(found: Sequence[Record], study: Study, cells: int, path: str) -> Record:
    """Status and results: those of the first repetition that went wrong, or of the last."""
    end = study.ends.get((cells, path), "")
    if not found:
        return {**dict.fromkeys(_ANSWER), "status": "error", "message": end or "not measured"}
    shown = next((record for record in found if record["status"] != "solved"), found[-1])
    return {key: shown.get(key) for key in _ANSWER}


def _times(found: Iterable[Record], part: str) -> list[float]:
    return [record["seconds"][part] for record in found if part in record["seconds"]]


def plain_rows(study: Study) -> list[Record]:
    """One row for each back end beside each number of cells and path."""
    groups: dict[tuple[int, str, str], list[Record]] = {}
    for record in study.plain:
        groups.setdefault((record["cells"], record["path"], record["backend"]), []).append(record)
    return [_plain_row(*key, found) for key, found in groups.items()]


def _plain_row(cells: int, path: str, backend: str, found: list[Record]) -> Record:
    shown, times = found[-1], _times(found, "plain")
    return {
        "cells": cells,
        "path": path,
        "backend": backend,
        "version": shown.get("version"),
        "unknowns": shown.get("unknowns"),
        "status": shown["status"],
        "message": shown["message"],
        "repetitions": len(times),
        "seconds": times,
        "plain": median(times),
        "analysis": median(_times(found, "analysis")),
        "numeric": median(_times(found, "numeric")),
    }


def memory_rows(study: Study) -> list[Record]:
    """Peak memory of each process after its first whole solve, and before it, with all libraries loaded."""
    return [
        {
            "cells": r["cells"],
            "path": r["path"],
            "unknowns": 4 * r["cells"] ** 2,
            "peak": r["peak"],
            "imports": r["imports"],
        }
        for r in study.memory
    ]


def growth_rows(study: Study, solves: Sequence[Record]) -> list[Record]:
    """Exponents of time ~ unknownsᵖ between neighbouring sizes and over all, for each path and friction."""
    plan, rows = study.plan, []
    for path in plan.paths:
        for mu in plan.friction:
            found = {r["cells"]: r for r in solves if (r["path"], r["friction"]) == (path.name, mu)}
            rows += [_growth_row(path.name, mu, found[first], found[last]) for first, last in _spans(plan)]
    return rows


def _spans(plan: Plan) -> list[tuple[int, int]]:
    """Neighbouring sizes; then the target's span if both ends are there, else the first and the last."""
    pairs = list(pairwise(plan.cells))
    whole = reference.GROWTH_SPAN
    if not set(whole) <= set(plan.cells):
        whole = (plan.cells[0], plan.cells[-1])
    return pairs if whole in pairs or whole[0] == whole[1] else [*pairs, whole]


def _growth_row(path: str, friction: float, smaller: Record, larger: Record) -> Record:
    row: Record = {"path": path, "friction": friction, "from": smaller["cells"], "to": larger["cells"]}
    for name in ("solve", "whole", "own_factorisation", "fastest_factorisation"):
        ends = [(r["unknowns"] or 0, r[name] if r["status"] == "solved" else None) for r in (smaller, larger)]
        row[name] = growth(*ends)
    return row


def loop_rows(study: Study, solves: Sequence[Record]) -> list[Record]:
    """One row for each loop and number of cells, beside the condensed method of the first path."""
    own = study.plan.paths[0].name
    condensed = {(r["cells"], r["friction"]): r for r in solves if r["path"] == own}
    rows = []
    for found in study.loops:
        beside = condensed[found["cells"], found["friction"]]
        seconds, force = median(found["seconds"]), found.get("half_force")
        solved = found["status"] in ("solved", "inaccurate") and beside["status"] == "solved"
        difference = ratio(force, beside["half_force"]) if solved else None
        rows.append(
            {
                **{key: found[key] for key in ("cells", "name", "friction", "options", "seconds")},
                **{key: found.get(key) for key in _ANSWER},
                "solve": seconds,
                "ratio": ratio(seconds, beside["solve"]) if solved else None,
                "half_force_difference": None if difference is None else abs(difference - 1.0),
            }
        )
    return sorted(rows, key=lambda row: (row["cells"], [way.name for way in LOOPS].index(row["name"])))


def graded_rows(study: Study) -> list[Record]:
    """One row for each graded mesh and friction, with the targets that it meets."""
    rows = []
    for cells, grading in GRADED:
        for mu in GRADED_FRICTION:
            key = (cells, grading, mu)
            found = [r for r in study.graded if (r["cells"], r["grading"], r["friction"]) == key]
            rows.append({"cells": cells, "grading": grading, "friction": mu, **_graded_row(found, study)})
    return rows


def _graded_row(found: Sequence[Record], study: Study) -> Record:
    row = _answer(found, study, 0, "graded")
    seconds = list(found[-1]["seconds"]) if found else []
    error = reference.settled_error(row["half_force"], found[-1]["friction"]) if found else None
    whole = median(seconds)
    return {
        **row,
        "seconds": seconds,
        "whole": whole,
        "error": error,
        "meets": [
            {"error": most, "seconds": longest}
            for most, longest in reference.ACCURACY_TARGETS
            if error is not None and whole is not None and error <= most and whole <= longest
        ],
    }
