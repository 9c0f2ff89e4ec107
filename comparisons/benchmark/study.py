"""The studies as declarations: whole solves, graded meshes, other loops, and walls of blocks.

Every case has a process of its own: its peak memory is that of one problem, and no time depends on what ran before.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from comparisons.benchmark.reference import CONVERGED_FRICTION
from comparisons.lab.study import Study
from qvi_contact.errors import InputError
from solvers.factorisation import resolve
from solvers.factorisation.choice import CHOICES

TASK: Final = "comparisons.benchmark.task:"
WHOLE, GRADED, LOOPS, WALL = "benchmark", "benchmark-graded", "benchmark-loops", "benchmark-wall"
GENERAL: Final = "general"
"""Path of a whole solve: by a sparse back end."""

MESHES: Final = ((12, 0.6), (16, 0.7), (24, 0.7), (32, 0.8), (40, 0.8))
"""(cells, grading) of the meshes on which accuracy is weighed against time."""

GRADED_FRICTION: Final = (0.2, 1.0)
GRADED_RUNS: Final = 20

STATES: Final = {0.02: "sticks", 0.3: "opens and slips", 0.45: "close to its limit"}
"""What a wall does under a load from the side, by that load over the wall's weight."""


class Loop(NamedTuple):
    """Another method on the same problem: options of `solve`, and the most cells a side it is tried on.

    Without options it is the loop of `naive`.
    """

    options: dict[str, str]
    largest: int


METHODS: Final = {
    "naive loop, qpsolvers": Loop({"method": "fixed-point", "inner": "qp:clarabel", "form": "full"}, 128),
    "naive loop, cvxpy": Loop({}, 128),
    "naive loop, cvxpy, cones": Loop({"method": "fixed-point", "inner": "socp:clarabel", "form": "full"}, 128),
    "loop of condensed QPs": Loop({"method": "fixed-point", "inner": "qp:clarabel", "form": "condensed"}, 64),
    "Uzawa": Loop({"method": "uzawa"}, 64),
}
"""The fixed point on the friction bound as one would write it first, on the condensed operator, and the paper's own."""


def whole(cells: Sequence[int], friction: Sequence[float], repeat: int | None, factorisation: str) -> Study:
    """Whole solves on equal cells; without `repeat` as many as the size allows, see `task.repetitions`."""
    if factorisation not in CHOICES:
        raise InputError("factorisation", factorisation, f"choose one of {', '.join(CHOICES)}")
    factors = {
        "cells": tuple(sorted(set(cells))), "path": (GENERAL,), "friction": (sorted(set(friction)),), "runs": (repeat,),
        "sparse": (sparse(factorisation),),
    }  # fmt: skip
    return Study(WHOLE, 1, f"{TASK}whole", factors, fresh=True)


def sparse(factorisation: str) -> str:
    """The sparse back end."""
    return resolve(factorisation)


def graded(repeat: int | None, factorisation: str) -> Study:
    """Whole solves on graded meshes."""
    factors = {
        "mesh": tuple(map(list, MESHES)), "friction": GRADED_FRICTION, "runs": (repeat or GRADED_RUNS,),
        "sparse": (sparse(factorisation),),
    }  # fmt: skip
    return Study(GRADED, 1, f"{TASK}graded", factors, fresh=True)


def loops(cells: Sequence[int], friction: Sequence[float]) -> Study | None:
    """Other methods, on meshes that are not too large for them; at the μ with known forces if it is among these."""
    mu = CONVERGED_FRICTION if CONVERGED_FRICTION in friction else min(friction)
    factors = {"cells": tuple(sorted(set(cells))), "loop": tuple(METHODS), "friction": (mu,)}
    if min(cells) > max(loop.largest for loop in METHODS.values()):
        return None
    keep = lambda case: case["cells"] <= METHODS[case["loop"]].largest  # noqa: E731
    return Study(LOOPS, 1, f"{TASK}loop", factors, keep=keep, fresh=True)


def walls(blocks: Sequence[int], loads: Sequence[float], elements: Sequence[str]) -> Study:
    """Walls of n × n blocks, pushed from the side by a share of their weight."""
    factors = {
        "load": tuple(sorted(set(loads or STATES))), "blocks": tuple(sorted(set(blocks))),
        "element": tuple(sorted(set(elements))),
    }  # fmt: skip
    return Study(WALL, 1, f"{TASK}wall", factors, fresh=True)
