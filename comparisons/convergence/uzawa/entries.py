"""Rows of the study as objects, and how they belong together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import median
from typing import Any

from comparisons.convergence.uzawa.methods import METHODS
from comparisons.lab.study import DONE, Row

Place = tuple[str, int, float]
"""Problem, cells a side (0 without a mesh), μ."""

_NAMES = {"half open": "8 contacts, half open", "sliding": "8 contacts, sliding", "ssnv128": "SSNV128"}


@dataclass(frozen=True)
class Entry:
    """A run; what the task returned is in `result`, empty if it returned nothing."""

    run: str
    place: Place
    tangential: float | None
    normal: float | None
    target: float | None
    status: str
    certificate: Any
    result: Mapping[str, Any] = field(repr=False)

    @property
    def cells(self) -> int:
        """Cells a side."""
        return self.place[1]

    @property
    def friction(self) -> float:
        """μ."""
        return self.place[2]

    @property
    def settles(self) -> bool:
        """Whether a run of a given number of iterations settled."""
        return bool(self.result.get("settles", False))

    @property
    def solved(self) -> bool:
        """Whether the certificate passed at the target."""
        return self.status == "solved"

    @property
    def seconds(self) -> float | None:
        """Median wall time [s] of the solves."""
        times = self.result.get("seconds")
        return median(times) if times else None

    @property
    def accuracy(self) -> float | None:
        """Accuracy that the certificate confirms."""
        return None if self.certificate is None else float(self.certificate["accuracy"])

    def number(self, name: str) -> float | None:
        """A number the task returned, None if it has none."""
        value = self.result.get(name)
        return None if value is None else float(value)

    def ratio(self, name: str, other: str) -> float | None:
        """One number over another, None if one of them is missing or the other is zero."""
        first, second = self.number(name), self.number(other)
        return first / second if first is not None and second else None

    def needed(self, target: str) -> int | None:
        """Iterations until the normal force is within "1e-04" or another target for good."""
        value = self.result.get("needed", {}).get(target)
        return None if value is None else int(value)


def place_name(place: Place) -> str:
    """As texts call it: "plate, 8², μ = 0.1"."""
    problem, cells, friction = place
    mesh = f", {cells}²" if cells else ""
    return f"{_NAMES.get(problem, problem)}{mesh}, μ = {friction:g}"


@dataclass(frozen=True)
class Entries:
    """All runs of the study."""

    all: tuple[Entry, ...]

    @classmethod
    def of(cls, rows: Sequence[Row]) -> "Entries":
        """From the rows, by problem, mesh and μ; a case that could not be run has the row's status."""
        found = [_entry(row) for row in sorted(rows, key=lambda row: row.position)]
        return cls(tuple(sorted(found, key=lambda entry: entry.place)))

    def runs(self, *names: str) -> list[Entry]:
        """The runs of these names that have a result."""
        return [entry for entry in self.all if entry.run in names and entry.result]

    @cached_property
    def missing(self) -> list[Entry]:
        """The runs without a result."""
        return [entry for entry in self.all if not entry.result]

    @cached_property
    def maps(self) -> dict[Place, list[Entry]]:
        """Place → runs of its map."""
        return _by_place(self.runs("map"))

    @cached_property
    def meshes(self) -> dict[float, list[Entry]]:
        """μ → runs on meshes from coarse to fine."""
        found: dict[float, list[Entry]] = {}
        for entry in sorted(self.runs("mesh"), key=lambda entry: (entry.friction, entry.cells)):
            found.setdefault(entry.friction, []).append(entry)
        return found

    @cached_property
    def accuracies(self) -> dict[Place, list[Entry]]:
        """Place → runs of all methods to all targets."""
        return _by_place(self.runs(*METHODS))


def _by_place(entries: Sequence[Entry]) -> dict[Place, list[Entry]]:
    found: dict[Place, list[Entry]] = {}
    for entry in entries:
        found.setdefault(entry.place, []).append(entry)
    return found


def _entry(row: Row) -> Entry:
    case, result = row.case, dict(row.result)
    problem, cells, friction = case["place"]
    status = result["status"] if row.status == DONE else row.status
    steps = (case["tangential"], case["normal"], case["target"])
    return Entry(case["run"], (problem, int(cells), float(friction)), *steps, status, row.certificate, result)
