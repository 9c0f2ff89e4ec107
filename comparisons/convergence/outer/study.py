"""The study: problems × meshes × μ × loops."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from comparisons.convergence.declared import among, factors_of
from comparisons.convergence.outer.loops import LOOPS
from comparisons.lab.study import Study

VERSION: Final = 1
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.convergence.outer.task:run"

Meshes = Mapping[tuple[str, int], tuple[float, ...]]

FULL: Final[Meshes] = {
    ("contacts", 0): (0.25, 0.5, 1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 3.0, 4.0),
    ("plate", 4): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 8): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 16): (0.05, 0.1, 0.15, 0.2, 0.25),
    ("plate", 32): (0.1, 0.2),
    ("block", 4): (0.12, 0.15, 0.2, 0.3),
    ("block", 8): (0.105, 0.11, 0.12, 0.15, 0.2, 0.3),
    ("block", 16): (0.12, 0.2),
    ("ssnv128", 4): (0.3, 0.5, 1.0),
    ("ssnv128", 8): (0.3, 0.5, 1.0, 2.0),
    ("ssnv128", 16): (0.1, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0),
    ("ssnv128", 24): (0.3, 0.5, 1.0),
    ("three", 0): (2.0,),
}
"""(Problem, cells a side) → μ."""

QUICK: Final[Meshes] = {
    ("contacts", 0): (0.5, 1.0, 2.0),
    ("plate", 4): (0.1,),
    ("plate", 8): (0.1,),
    ("ssnv128", 8): (0.3, 1.0, 4.0),
    ("three", 0): (2.0,),
}

STARTS: Final = (0.0, 1.7, 10.0)
"""Pressures that loops start from where there are several solutions."""


def study(quick: bool) -> Study:
    """The study, or a quick one of a few coarse meshes under another name."""
    name = "convergence-outer-quick" if quick else "convergence-outer"
    return study_of(name, QUICK if quick else FULL)


def study_of(name: str, meshes: Meshes, loops: Sequence[str] = tuple(LOOPS)) -> Study:
    """The study on these problems, meshes and frictions, by these loops."""
    cases = list(_cases(meshes, loops))
    return Study(name, VERSION, TASK, factors_of(cases), keep=among(cases))


def _cases(meshes: Meshes, loops: Sequence[str]) -> Iterator[dict[str, Any]]:
    """All loops from the bonded state; on "three" each from several starts, but for the method that takes none."""
    for (problem, cells), frictions in meshes.items():
        for friction in frictions:
            for loop in loops:
                several = problem == "three" and LOOPS[loop].variant is not None
                for start in STARTS if several else (None,):
                    yield {"problem": problem, "cells": cells, "friction": friction, "loop": loop, "start": start}
