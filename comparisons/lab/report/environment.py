"""What the rows of a study were computed with: machines, versions, threads, limits, seeds, loads."""

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from comparisons.lab.report.numbers import NOTHING, listing, memory, seconds, span
from comparisons.lab.study.rows import Row
from comparisons.lab.tables import Grid

Machine = Mapping[str, Any]

_UNKNOWN = "unknown"


def environment_grids(rows: Sequence[Row]) -> list[Grid]:
    """Tables for the settings of a report: the runs, their machines, the versions of what they used.

    Where rows differ each value stands with the number of its rows, and the tables of machines and versions say so in
    their notes. The same rows in another order give the same tables.
    """
    return [_runs(rows), _machines(rows), _versions(rows)]


def _runs(rows: Sequence[Row]) -> Grid:
    """Number of rows, what became of them, threads, limits, seeds, load."""
    lines = [
        ("rows", str(len(rows))),
        ("status", _shares((row.status for row in rows), str)),
        ("threads of a run", _shares((row.environment.get("threads") for row in rows), str)),
        ("time limit of a run", _shares((row.environment.get("timeout_seconds") for row in rows), seconds)),
        ("memory limit of a run", _shares((row.environment.get("memory_mib") for row in rows), _memory_limit)),
        ("seeds", _shares((row.case.get("seed") for row in rows), str)),
        ("load average before a run", _loads(rows)),
    ]
    note = "Where rows differ, the number of rows with a value stands behind it in brackets."
    return Grid("Runs", ("setting", "value"), lines, note)


def _machines(rows: Sequence[Row]) -> Grid:
    counts = _counts(row.environment.get("machine") for row in rows)
    lines = [(*_machine(machine), str(number)) for machine, number in counts]
    known = sum(machine is not None for machine, _ in counts)
    headings = ("processor", "cores", "memory", "system", "Python", "rows")
    if known <= 1:
        return Grid("Machine", headings, lines)
    kinds = f"The rows come from {known} kinds of machine or system"
    return Grid("Machines", headings, lines, f"{kinds}: times can be compared only between rows of the same.")


def _machine(machine: Machine | None) -> tuple[str, ...]:
    """Cells of a machine; a run that was ended before it could say anything has none."""
    known = {name: value for name, value in (machine or {}).items() if value}
    known |= {"memory_bytes": memory(known["memory_bytes"])} if "memory_bytes" in known else {}
    names = ("processor", "cores", "memory_bytes", "system", "python")
    return tuple(str(known.get(name, _UNKNOWN)) for name in names)


def _versions(rows: Sequence[Row]) -> Grid:
    """A line for each package and each of its versions."""
    told = [row.environment.get("versions") or {} for row in rows]
    packages = sorted({name for versions in told for name in versions}, key=str.casefold)
    found = {name: _counts(versions.get(name, _UNKNOWN) for versions in told) for name in packages}
    lines = [
        (name, "not installed" if version is None else str(version), str(number))
        for name, counts in found.items()
        for version, number in counts
    ]
    several = [name for name, counts in found.items() if sum(version != _UNKNOWN for version, _ in counts) > 1]
    note = f"The rows were computed with different versions of {listing(several)}." if several else ""
    return Grid("Versions", ("package", "version", "rows"), lines, note)


def _counts(values: Iterable[Any]) -> list[tuple[Any, int]]:
    """Each value with the number of times it occurs, in the order of their canonical JSON."""
    texts = Counter(json.dumps(value, sort_keys=True) for value in values)
    return [(json.loads(text), texts[text]) for text in sorted(texts, key=_order)]


def _order(text: str) -> tuple[int, float, str]:
    """Numbers by their size, then everything else by its text, at last what is not known or not there."""
    value = json.loads(text)
    if value in (None, _UNKNOWN):
        return 2, 0.0, text
    return (0, float(value), text) if isinstance(value, int | float) else (1, 0.0, text)


def _shares(values: Iterable[Any], name: Callable[[Any], str]) -> str:
    """The value, or each with its number of rows in brackets."""
    counts = _counts(values)
    if len(counts) == 1:
        return name(counts[0][0])
    return ", ".join(f"{name(value)} ({number})" for value, number in counts) or NOTHING


def _memory_limit(value: int | None) -> str:
    return NOTHING if value is None else f"{value} MiB"


def _loads(rows: Sequence[Row]) -> str:
    """Smallest and largest load, and how many rows have none."""
    loads = [row.load_average for row in rows if row.load_average is not None]
    missing = len(rows) - len(loads)
    if not loads:
        return _UNKNOWN
    return span(loads) + (f" (unknown for {missing} row{'s' if missing > 1 else ''})" if missing else "")
