"""The study: sequences of problems that differ in one datum of their contact × elements, each solved in three ways.

A case is a sequence solved problem by problem, on a shared factorisation from cold starts, and from warm ones.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np

from comparisons.lab.study import Study
from qvi_contact import (
    Contact,
    ContactProblem,
    ContactResult,
    Displacement,
    Material,
    RectilinearMesh,
    Traction,
    solve,
    solve_history,
    solve_sweep,
)
from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.discretization.families import ElementName
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.sweep import Parameter, SweepTask

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


def study(quick: bool) -> Study:
    """The study, or a quick one of coarse meshes and few steps under another name."""
    name = "convergence-sequences-quick" if quick else "convergence-sequences"
    factors = {"sequence": tuple(CHAINS), "element": ("hct", "bfs"), "quick": (quick,)}
    return Study(name, 1, run, factors)


WAYS: Final = ("single", "cold", "warm")
"""Each problem by itself; one factorisation for all; the same, each started from the one before."""

EVERY: Final = 4
"""Every fourth problem is solved by itself."""


def run(case: Mapping[str, Any]) -> dict[str, Any]:
    """Task of the study: solve a sequence in all ways, one after the other in this process.

    The problems of a history are solved by themselves without the slip before them, for their time alone.

    Returns
    -------
    dict
        for each way: seconds of processor time, iterations, status, accuracy, and normal and tangential force on the
        contact, a list of one number for each problem, of single solves for every fourth

    """
    chain = CHAINS[case["sequence"]]
    return {way: _solved(way, chain, case["quick"], case["element"]) for way in WAYS}


def _solved(way: str, chain: Chain, quick: bool, element: ElementName) -> dict[str, Any]:
    clock, problems = _Clock(), chain.problems(quick)
    if way == "single":
        for problem in problems[::EVERY]:
            clock(0, solve(problem, element=element))
    elif chain.history:
        solve_history(problems, clock, element=element, warm_start=way == "warm")
    else:
        base, values = chain.base(quick), chain.chosen(quick)
        solve_sweep(base, chain.parameter, values, callback=clock, element=element, warm_start=way == "warm")
    return clock.found


class _Clock:
    """Hears of each result, and takes down its time and its numbers."""

    def __init__(self) -> None:
        self._last = time.process_time()
        names = ("seconds", "iterations", "status", "accuracy", "normal", "tangential")
        self.found: dict[str, list[Any]] = {name: [] for name in names}

    def __call__(self, number: int, result: ContactResult) -> None:  # noqa: ARG002  # as callbacks are called
        seconds = time.process_time() - self._last
        line = next(iter(result.contacts.values()))
        values = (
            seconds, result.iterations, str(result.status), result.certificate.accuracy,
            line.normal_force, line.tangential_force,
        )  # fmt: skip
        for name, value in zip(self.found, values, strict=True):
            self.found[name].append(value)
        self._last = time.process_time()
