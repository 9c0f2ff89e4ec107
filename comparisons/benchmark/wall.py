"""Walls with many contact points: n × n blocks of 4 × 4 cells, dry joints between the courses, pushed from the side.

The whole solve beside one plain factorisation of the same K, in CPU seconds. Every wall has a process of its own.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, Final

from comparisons.benchmark.process import records
from comparisons.benchmark.ratios import growth, ratio
from comparisons.lab.checks import check_at_least_one, check_not_negative
from comparisons.lab.machine import machine, versions
from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Traction
from qvi_contact.basics.terminal import Advance
from qvi_contact.errors import InputError

ELEMENTS: Final = ("bfs", "hct")

STATES: Final = {0.02: "sticks", 0.3: "opens and slips", 0.45: "close to its limit"}
"""What a wall does under a load from the side, by that load over the wall's weight."""

_CELLS: Final = 4  # a side of a block
_WEIGHT: Final = 24.0  # kN/m³
_FRICTION: Final = 0.6

Document = dict[str, Any]


@dataclass(frozen=True)
class WallPlan:
    """Settings of a run.

    Attributes
    ----------
    blocks : numbers of blocks a side, increasing
    loads : from the side, over the weight of the wall
    element : "bfs" or "hct"
    threads : of factorisations
    limit : seconds after which a wall is given up

    """

    blocks: tuple[int, ...] = (8, 16, 32)
    loads: tuple[float, ...] = tuple(STATES)
    element: str = "bfs"
    threads: int = 1
    limit: float = 600.0

    def __post_init__(self) -> None:
        for count in self.blocks:
            check_at_least_one("blocks", count)
        check_at_least_one("threads", self.threads)
        for load in self.loads:
            check_not_negative("load", load)
        object.__setattr__(self, "blocks", tuple(sorted(set(self.blocks))))
        if self.element not in ELEMENTS:
            raise InputError("element", self.element, f"choose one of {', '.join(ELEMENTS)}")

    @property
    def steps(self) -> int:
        """Walls to be solved."""
        return len(self.blocks) * len(self.loads)

    @property
    def command(self) -> str:
        """The command that measures the same, without the place of its files."""
        words = ["python -m comparisons benchmark --problem wall", *(f"--blocks {count}" for count in self.blocks)]
        words += [f"--load {load:g}" for load in self.loads]
        return " ".join([*words, f"--element {self.element} --threads {self.threads} --limit {self.limit:g}"])


def wall(blocks: int, load: float) -> ContactProblem:
    """A wall of blocks × blocks metres on the ground, under its weight and a load from the left, over that weight.

    Units are m and kPa. Pushed by 0.02 of its weight nothing slides but under single edges, by 0.3 beds open and slip;
    with the friction 0.6 every bed slides as a whole at 0.6.
    """
    cells, size = _CELLS * blocks, float(blocks)
    mesh = RectilinearMesh.rectangle((cells, cells), size, size)
    beds = [f"bed {course}" for course in range(1, blocks)]
    for course, name in enumerate(beds, start=1):
        mesh = mesh.with_joint(name, "horizontal", at=float(course))
    free = [Traction(edges, x=0.0, y=0.0) for edges in ("right", "top")]
    contacts = [Contact(name, friction=_FRICTION) for name in ("bottom", *beds)]
    push = Traction("left", x=load * _WEIGHT * size, y=0.0)
    weight = {"body_potential": lambda x, y: _WEIGHT * y + 0.0 * x}
    return ContactProblem(mesh, Material(5e6, 0.2), [push, *free, *contacts], **weight)  # type: ignore[arg-type]


def run(plan: WallPlan, advance: Advance) -> Document:
    """Measure all walls; the document of the report as plain data."""
    rows = []
    for blocks in plan.blocks:
        for load in plan.loads:
            rows.append(_row(plan, blocks, load))
            advance(f"{blocks} × {blocks} blocks, {load:g} of the weight")
    return {
        "schema": "qvi-contact/benchmark-wall/1",
        "began": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": plan.command,
        "element": plan.element,
        "machine": machine(),
        "versions": versions(),
        "threads": plan.threads,
        "units": {"seconds": "s, CPU time of the process", "memory": "bytes"},
        "walls": rows,
        "growth": list(_growth(rows)),
    }


def _row(plan: WallPlan, blocks: int, load: float) -> Document:
    """One wall; one that was not finished has the reason as its message."""
    task = {"task": "wall", "blocks": blocks, "load": load, "element": plan.element, "threads": plan.threads}
    row: Document = {"blocks": blocks, "load": load, "state": STATES.get(load, ""), **dict.fromkeys(_MEASURED)}
    for record in records(task, plan.threads, plan.limit):
        if record["kind"] == "wall":
            row |= {name: record.get(name) for name in _MEASURED}
        elif record["reason"]:
            row |= {"status": "not finished", "message": record["reason"]}
    solved = row["solve"] if row["status"] == "solved" else None
    return {**row, "ratio": ratio(solved, row["factorisation"])}


_MEASURED: Final = (
    "status", "message", "unknowns", "contact_points", "form", "iterations", "accuracy", "assembly", "factorisation",
    "solve", "peak",
)  # fmt: skip


def _growth(rows: list[Document]) -> Iterator[Document]:
    """Exponents of CPU time ~ blocksᵖ of the whole wall, n² blocks, between neighbouring sizes."""
    for load in dict.fromkeys(row["load"] for row in rows):
        found = [row for row in rows if row["load"] == load]
        for first, second in pairwise(found):
            ends = [
                (row["blocks"] ** 2, row["solve"] if row["status"] == "solved" else None) for row in (first, second)
            ]
            yield {"load": load, "from": first["blocks"], "to": second["blocks"], "exponent": growth(*ends)}
