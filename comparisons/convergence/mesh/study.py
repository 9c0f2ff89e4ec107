"""The cases: which problems on which sequences of meshes, by which models."""

from collections.abc import Iterator
from typing import Final

from comparisons.convergence.mesh.problems import PROBLEMS
from comparisons.lab.study import Study

UNIFORM, GRADED, GOAL, APART, REFERENCE = "uniform", "graded", "goal", "apart", "reference"
SEQUENCES: Final = {
    UNIFORM: "equal cells",
    GRADED: "cells that shrink towards the places where stresses are singular",
    GOAL: "adaptive, for the force (`refine`)",
    APART: "adaptive, where the bounds are apart (`refined_where_apart`)",
    REFERENCE: "adaptive, for the energy, as far as it goes: the reference of what is not known otherwise",
}
"""Sequence → what it is. Those of the first two have a case for each mesh, the others one for the whole chain."""

EQUILIBRIUM, STRICT, COMPANION, BRACKET = "equilibrium", "strict", "companion", "bracket"
MODELS: Final = {
    EQUILIBRIUM: "stresses in equilibrium, the friction law at four points of every contact edge",
    STRICT: "the same with the friction law on whole edges",
    COMPANION: "biquadratic displacements on the same mesh",
    BRACKET: "bounds of the energy from both",
}
"""Model → what it is."""

VERSION: Final = 2
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.convergence.mesh.task:run"

_QUICK: Final = ("plate 0.2", "plate 1", "punch smooth", "block")
_CONVEX: Final = ("plate 0", "plate 1", "punch smooth")
_STRICT_CELLS: Final = 32
_BRACKET_CELLS: Final = 64
_GOAL_UNKNOWNS: Final = 12_000
_REFERENCE_UNKNOWNS: Final = 24_000
_APART_UNKNOWNS: Final = 3_000  # of problems with friction: strictly admissible stresses get dear in thin cells
_CONVEX_APART_UNKNOWNS: Final = 12_000
_HARD: Final = ("ssnv128", "punch rough")
"""Contact that opens, slips and sticks: where cells get thin, single solves take minutes."""

_HARD_REFERENCE_UNKNOWNS: Final = 10_000
_HARD_APART_UNKNOWNS: Final = 2_400


def study(quick: bool) -> Study:
    """The study of convergence in the mesh.

    The factor "size" is the number of cells along the contact, or, of chains of adaptive meshes, the largest number of
    unknowns.
    """
    cases = list(_cases(quick))
    factors = {
        "problem": tuple(_QUICK if quick else PROBLEMS), "sequence": tuple(SEQUENCES),
        "size": tuple(sorted({size for _, _, size, _ in cases})), "model": tuple(MODELS),
    }  # fmt: skip
    return Study("mesh (quick)" if quick else "mesh", VERSION, TASK, factors, only=cases)


Case = tuple[str, str, int, str]


def _cases(quick: bool) -> Iterator[Case]:
    for name in _QUICK if quick else PROBLEMS:
        yield from _meshes(name, quick)
        yield from _chains(name, quick)


def _meshes(name: str, quick: bool) -> Iterator[Case]:
    """Uniform and graded meshes, each with every model it is not too fine for."""
    problem = PROBLEMS[name]
    finest = 32 if quick else 128 if name.startswith(("punch", "block")) else 256
    sizes = [size for size in (4, 8, 16, 32, 64, 128, 256) if problem.start <= size <= finest]
    for sequence in (UNIFORM, GRADED) if problem.lines else (UNIFORM,):
        for size in sizes:
            if sequence == UNIFORM or size <= _BRACKET_CELLS:
                yield name, sequence, size, EQUILIBRIUM
                yield from ((name, sequence, size, model) for model in _models(name, sequence, size, quick))


def _models(name: str, sequence: str, size: int, quick: bool) -> Iterator[str]:
    limit = 16 if quick else _BRACKET_CELLS
    if size <= min(limit, _STRICT_CELLS) and sequence == UNIFORM and name not in ("plate 0", "punch smooth"):
        yield STRICT
    if size <= limit:
        yield COMPANION
    if size <= (limit // 2 if name in _HARD and sequence == GRADED else limit):
        yield BRACKET


def _chains(name: str, quick: bool) -> Iterator[Case]:
    if name == "plate 0":  # exact on every mesh: nothing to refine
        return
    most = 2_000 if quick else _GOAL_UNKNOWNS if PROBLEMS[name].tractions is None else _GOAL_UNKNOWNS // 3
    yield name, GOAL, most, EQUILIBRIUM
    if PROBLEMS[name].tractions is not None:  # exact; its μ(x) is no polynomial, so that there are no bounds either
        return
    convex = _CONVEX_APART_UNKNOWNS if name in _CONVEX else _APART_UNKNOWNS
    yield name, APART, 1_000 if quick else _HARD_APART_UNKNOWNS if name in _HARD else convex, BRACKET
    farthest = _HARD_REFERENCE_UNKNOWNS if name in _HARD else _REFERENCE_UNKNOWNS
    for model in (EQUILIBRIUM, COMPANION):
        yield name, REFERENCE, 6_000 if quick else farthest, model
