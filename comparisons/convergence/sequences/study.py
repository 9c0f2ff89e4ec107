"""The study: sequences of problems that differ in one datum of their contact × elements, each solved in three ways."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from comparisons.lab.study import Study
from qvi_contact import Contact, ContactProblem, Displacement, Material, RectilinearMesh, Traction
from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.sweep_rows import Parameter
from qvi_contact.solution.sweep_run import SweepTask

_DEPTH: Final = 0.01


@dataclass(frozen=True)
class Chain:
    """A sequence.

    Attributes
    ----------
    title : what it is called in tables
    problem : the problem by numbers of cells
    cells, coarse : numbers of cells, and those of a quick run
    parameter : what changes
    values : its values; a quick run takes every fifth
    history : whether slip accumulates from one to the next

    """

    title: str
    problem: Callable[[tuple[int, int]], ContactProblem]
    cells: tuple[int, int]
    coarse: tuple[int, int]
    parameter: Parameter
    values: tuple[float, ...]
    history: bool = False

    def problems(self, quick: bool) -> list[ContactProblem]:
        """All problems, as they are stated: to put them on the mesh of an element is part of a solve."""
        base = self.base(quick)
        task = SweepTask(base, self.parameter, tuple(contact.name for contact in base.contacts))
        return [task.changed(value) for value in self.chosen(quick)]

    def base(self, quick: bool) -> ContactProblem:
        """The problem that is changed."""
        return self.problem(self.coarse if quick else self.cells)

    def chosen(self, quick: bool) -> tuple[float, ...]:
        """The values."""
        return self.values[:: 5 if quick else 1]


def layer(cells: tuple[int, int], gap: Field = -_DEPTH, offset: float = 0.0) -> ContactProblem:
    """A layer on a rigid base, 2 wide and 1 high, under a rough obstacle."""
    mesh = RectilinearMesh.rectangle(cells, 2.0, 1.0)
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    held = Displacement("bottom", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(1000.0, 0.3), [Contact("top", 0.3, gap, offset, "obstacle"), held, *sides])


def _punch(x: FloatArray, y: FloatArray) -> FloatArray:
    return 2.0 * _DEPTH * (x - 1.0) ** 2 + 0.0 * y


def _evenly(first: float, last: float, count: int) -> tuple[float, ...]:
    return tuple(np.linspace(first, last, count).tolist())


CHAINS: Final = {
    "cycle": Chain(
        "history: 21 offsets of a full cycle, layer 64 × 128", layer, (128, 64), (16, 8), "offset",
        tuple((_DEPTH * np.sin(np.linspace(0.0, 2.0 * np.pi, 21))).tolist()), history=True,
    ),
    "friction": Chain(
        "sweep: 20 values of μ, plate 64 × 64", partial(compressed_plate, 0.2), (64, 64), (8, 8), "friction",
        _evenly(0.05, 1.0, 20),
    ),
    "compression": Chain(
        "sweep: 11 compressions, sheared layer 32 × 64", partial(layer, gap=0.0, offset=0.5 * _DEPTH),
        (64, 32), (16, 8), "gap", _evenly(-0.5 * _DEPTH, -_DEPTH, 11),
    ),
    "depth": Chain(
        "sweep: 11 depths of a round punch, layer 32 × 64", partial(layer, gap=_punch), (64, 32), (16, 8), "gap",
        _evenly(-0.2 * _DEPTH, -2.0 * _DEPTH, 11),
    ),
}  # fmt: skip
"""Name → sequence; in the last one the contact grows with each step."""

VERSION: Final = 1
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.convergence.sequences.task:run"


def study(quick: bool) -> Study:
    """The study, or a quick one of coarse meshes and few steps under another name."""
    name = "convergence-sequences-quick" if quick else "convergence-sequences"
    factors = {"sequence": tuple(CHAINS), "element": ("hct", "bfs"), "quick": (quick,)}
    return Study(name, VERSION, TASK, factors)
