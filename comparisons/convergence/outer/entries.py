"""Rows of the study as objects, and how they belong together."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import median
from typing import Any

from comparisons.convergence.outer.loops import CONDENSED, LOOPS
from comparisons.lab.study import DONE, Row

NAMES = {
    "contacts": "8 contacts",
    "plate": "plate",
    "block": "dragged block",
    "ssnv128": "SSNV128",
    "three": "1 contact",
}
"""Problem → what it is called in texts."""


@dataclass(frozen=True)
class Entry:
    """A run of a loop; what the task returned is in `result`, empty if it returned nothing."""

    problem: str
    cells: int
    friction: float
    loop: str
    start: float | None
    status: str
    certificate: Any
    result: dict[str, Any] = field(repr=False)

    @property
    def solved(self) -> bool:
        """Whether the run ended with a certificate that passed."""
        return self.status == "solved"

    @property
    def body(self) -> tuple[str, int]:
        """Problem and mesh."""
        return self.problem, self.cells

    @property
    def place(self) -> tuple[str, int, float]:
        """Problem, mesh and friction."""
        return self.problem, self.cells, self.friction

    @property
    def seconds(self) -> float | None:
        """Median wall time [s] of the solves."""
        return median(self.result["seconds"]) if self.result else None

    @property
    def iterations(self) -> int | None:
        """Iterations until the loop was solved; None if it was not."""
        return self.result["iterations"] if self.solved else None

    def number(self, name: str) -> float | None:
        """A number the task returned, None if it has none."""
        value = self.result.get(name)
        return None if value is None else float(value)

    @property
    def rate(self) -> float | None:
        """The observed contraction of a loop that converges, solved or not; None for all others."""
        return self.number("factor") if self.result.get("course") == "converges" else None


def body_name(body: tuple[str, int]) -> str:
    """Problem and mesh as texts call them: "plate, 16²"."""
    problem, cells = body
    return f"{NAMES.get(problem, problem)}, {cells}²" if cells else NAMES.get(problem, problem)


@dataclass(frozen=True)
class Entries:
    """All runs of the study."""

    all: tuple[Entry, ...]

    @classmethod
    def of(cls, rows: Sequence[Row]) -> "Entries":
        """From the rows; a case that could not be run has the row's status."""
        return cls(tuple(_entry(row) for row in sorted(rows, key=lambda row: row.position)))

    @cached_property
    def single(self) -> tuple[Entry, ...]:
        """Those of problems that all loops start from the bonded state."""
        return tuple(entry for entry in self.all if entry.problem != "three")

    @cached_property
    def several(self) -> tuple[Entry, ...]:
        """Those of the problem with three solutions."""
        return tuple(entry for entry in self.all if entry.problem == "three")

    @cached_property
    def loops(self) -> tuple[str, ...]:
        """The loops that were run, in their order."""
        found = {entry.loop for entry in self.all}
        return tuple(loop for loop in LOOPS if loop in found)

    @cached_property
    def places(self) -> tuple[tuple[str, int, float], ...]:
        """Problem, mesh and friction, each once, by problem, mesh and friction."""
        order = list(dict.fromkeys(entry.problem for entry in self.single))
        found = {entry.place for entry in self.single}
        return tuple(sorted(found, key=lambda place: (order.index(place[0]), place[1:])))

    @cached_property
    def main_bodies(self) -> tuple[tuple[str, int], ...]:
        """Of each problem the mesh with the most frictions, the finest of several."""
        problems = dict.fromkeys(place[0] for place in self.places)
        return tuple(
            max({place[:2] for place in self.places if place[0] == problem},
                key=lambda body: (sum(place[:2] == body for place in self.places), body[1]))
            for problem in problems
        )  # fmt: skip

    def frictions(self, body: tuple[str, int]) -> list[float]:
        """The frictions of a problem on a mesh."""
        return [place[2] for place in self.places if place[:2] == body]

    def get(self, place: tuple[str, int, float], loop: str) -> Entry | None:
        """The run of a loop at a place."""
        return self._by_place.get((place, loop))

    def along(self, body: tuple[str, int], loop: str) -> list[Entry]:
        """The runs of a loop on a problem and mesh, by friction."""
        found = (self.get((*body, friction), loop) for friction in self.frictions(body))
        return [entry for entry in found if entry is not None]

    def ratio(self, entry: Entry) -> float | None:
        """Time of a run over that of the condensed method on the same problem; None unless both solve it."""
        other = self.get(entry.place, CONDENSED)
        if other is None or not (other.solved and entry.solved and other.seconds and entry.seconds):
            return None
        return entry.seconds / other.seconds

    @cached_property
    def _by_place(self) -> dict[tuple[tuple[str, int, float], str], Entry]:
        return {(entry.place, entry.loop): entry for entry in self.single}


def _entry(row: Row) -> Entry:
    case, result = row.case, dict(row.result)
    status = result["status"] if row.status == DONE else row.status
    start = None if case["start"] is None else float(case["start"])
    place = (case["problem"], case["cells"], float(case["friction"]))
    return Entry(*place, case["loop"], start, status, row.certificate, result)
