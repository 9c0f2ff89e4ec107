"""Stored rows as meshes, one for each mesh that was solved or should have been."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from comparisons.convergence.mesh.problems import PROBLEMS, Problem
from comparisons.convergence.mesh.study import APART, BRACKET, EQUILIBRIUM
from comparisons.lab.study import DONE, Row

SOLVED: Final = "solved"


@dataclass(frozen=True, eq=False)
class Mesh:
    """What one model gave on one mesh.

    Attributes
    ----------
    problem : Problem
        The problem.
    sequence, model : str
        See `study.SEQUENCES` and `study.MODELS`.
    size, step : int
        The case's size, and the place in its chain.
    status, message : str
        Of the solver, or of the row if there is no record; the message is empty if solved.
    record : Mapping
        See `task.equilibrium`; empty where the case failed as a whole, and without cells where a chain broke off.

    """

    problem: Problem
    sequence: str
    model: str
    size: int
    step: int
    status: str
    message: str
    record: Mapping[str, Any] = field(default_factory=dict)

    @property
    def solved(self) -> bool:
        """Whether there are values."""
        return self.status == SOLVED

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return int(self.record["unknowns"])

    @property
    def h(self) -> float:
        """Size of the mesh, (number of cells)^−½: proportional to the cells' side where they are equal."""
        nx, ny = self.record["cells"]
        return float((nx * ny) ** -0.5)

    @property
    def cells(self) -> str:
        """Cells along x and y, or the case's size where nothing is known."""
        if not self.record.get("cells"):
            return f"size {self.size}"
        return "{} × {}".format(*self.record["cells"])

    @property
    def force(self) -> float:
        """The problem's force [stress × length]."""
        return float(self.record[self.problem.force])


@dataclass(frozen=True, eq=False)
class Data:
    """All meshes of a study, in the order of its rows."""

    meshes: Sequence[Mesh]

    @property
    def problems(self) -> list[Problem]:
        """The problems that occur, each once."""
        return list({mesh.problem.name: mesh.problem for mesh in self.meshes}.values())

    def of(self, problem: Problem, sequence: str, model: str | None = None) -> list[Mesh]:
        """The solved meshes of a sequence; the model is the one that has the stresses if none is asked for."""
        wanted = model or (BRACKET if sequence == APART else EQUILIBRIUM)
        return [
            mesh
            for mesh in self.meshes
            if (mesh.problem.name, mesh.sequence, mesh.model) == (problem.name, sequence, wanted) and mesh.solved
        ]

    @property
    def failures(self) -> list[Mesh]:
        """The meshes without a certified answer."""
        return [mesh for mesh in self.meshes if not mesh.solved]


def data_of(rows: Sequence[Row]) -> Data:
    """The meshes of rows of the study; a row that failed as a whole is one mesh without values."""
    return Data([mesh for row in rows for mesh in _meshes(row)])


def _meshes(row: Row) -> list[Mesh]:
    place = PROBLEMS[row.case["problem"]], row.case["sequence"], row.case["model"], row.case["size"]
    if row.status != DONE:
        return [Mesh(*place, 0, row.status, row.reason)]
    records = row.result["meshes"]
    return [Mesh(*place, step, record["status"], record["message"], record) for step, record in enumerate(records)]
