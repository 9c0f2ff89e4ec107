"""The cases: which problems on which sequences of meshes, by which models; and what is done for each."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from comparisons.convergence.mesh.problems import PROBLEMS, Problem
from comparisons.convergence.mesh.tractions import Tractions
from comparisons.convergence.mesh.zones import zone_ends
from comparisons.lab.study import Study
from qvi_contact import ContactProblem, ContactResult, refine, solve
from qvi_contact.bracket import bracket, refined_where_apart
from qvi_contact.companion import CompanionResult, solve_companion
from qvi_contact.mesh import RectilinearMesh
from qvi_contact.refinement import Refinement, RefinementRound, RefinementStatus
from solvers import Certificate, Status

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

INNER: Final = "strict-direct:clarabel"
"""Inner solver of the law on whole edges."""

TOLERANCE: Final = 1e-8
_OUT_OF_REACH: Final = 1e-12  # targets of chains: they end at their number of unknowns
_CLOSING: Final = 1e-9  # gap over strain energy that is good enough
_INTENDED: Final = (RefinementStatus.REACHED, RefinementStatus.UNKNOWNS, RefinementStatus.ROUNDS)
"""Ends of a chain that are no failures."""

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
    return Study("mesh (quick)" if quick else "mesh", 2, run, factors, only=cases)


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


Record = dict[str, Any]


def run(case: Mapping[str, Any]) -> Record:
    """Task of the study: records of one or several meshes under "meshes", each with a status of its own.

    The case has "problem", "sequence", "size" and "model", see `study`.
    """
    problem = PROBLEMS[case["problem"]]
    found = list(_records(problem, case["sequence"], case["size"], case["model"]))
    accuracies = [record["accuracy"] for record in found]
    passed = all(record["status"] == Status.SOLVED.value for record in found)
    return {"meshes": found, "certificate": {"passed": passed, "accuracy": max(accuracies)}}


def _records(problem: Problem, sequence: str, size: int, model: str) -> Iterator[Record]:
    if sequence == GOAL:
        yield from _refined(problem, size, problem.force)[0]
    elif sequence == APART:
        yield from _where_apart(problem, size)
    elif sequence == REFERENCE:
        records, finest = _refined(problem, size, "energy")
        yield from _last_two(records) if model == EQUILIBRIUM else [_displacements(problem, finest)]
    else:
        stated = problem.uniform(size) if sequence == UNIFORM else problem.graded(size)
        yield _on_one_mesh(problem, stated, model)


def _on_one_mesh(problem: Problem, stated: ContactProblem, model: str) -> Record:
    if model == COMPANION:
        return _displacements(problem, stated)
    began = time.perf_counter()
    result = solve(stated, inner=INNER if model == STRICT else None, tolerance=TOLERANCE, element="bfs")
    record = equilibrium(problem, result, time.perf_counter() - began)
    return record | _bounds(problem, result) if model == BRACKET else record


def _refined(problem: Problem, most: int, goal: str) -> tuple[list[Record], ContactProblem]:
    """Records of the rounds of `refine` up to a number of unknowns, and the problem on the last mesh that was solved.

    The time of a round is all that was spent until its end: adaptive meshes cost the solves before them. A chain that
    ends because a solve or a mesh failed has a record of that too, the last one.
    """
    records: list[Record] = []
    latest: dict[tuple[int, ...], ContactResult] = {}
    began = time.perf_counter()

    def value(result: ContactResult) -> float:
        latest[result.problem.grid.shape] = result
        line = result.contacts[problem.contact]
        return result.energies.complementary if goal == "energy" else float(getattr(line, goal))

    def keep(record: RefinementRound) -> None:
        result = latest[record.cells[::-1]]
        seconds = time.perf_counter() - began
        records.append({**equilibrium(problem, result, seconds), "estimate": _finite(record.estimate)})

    start = problem.uniform(problem.start)
    refined = refine(
        start, None, _OUT_OF_REACH, value, max_unknowns=most, callback=keep, tolerance=TOLERANCE, element="bfs"
    )
    if not records:
        records.append(equilibrium(problem, refined.result, time.perf_counter() - began))
    elif refined.status not in _INTENDED and records[-1]["unknowns"] < most:
        records.append(_broken_off(refined, time.perf_counter() - began))
    return records, refined.problem


def _broken_off(refined: Refinement, seconds: float) -> Record:
    """Record of the mesh at which a chain broke off; of that mesh only the reason is known."""
    message = refined.reason or refined.status.advice
    return {
        "status": refined.status.value, "message": message, "accuracy": float("inf"), "cells": None, "unknowns": None,
        "smallest": None, "seconds": seconds,
    }  # fmt: skip


def _last_two(records: list[Record]) -> list[Record]:
    """The last two meshes that were solved, and what failed after them."""
    solved = [place for place, record in enumerate(records) if record["status"] == Status.SOLVED.value]
    return records[solved[-2] :] if len(solved) > 1 else records


def _where_apart(problem: Problem, most: int) -> Iterator[Record]:
    """Bisect where the bounds are apart until the next mesh would have too many unknowns."""
    stated = problem.uniform(problem.start)
    began = time.perf_counter()
    while True:
        result = solve(stated, tolerance=TOLERANCE, element="bfs")
        record = equilibrium(problem, result, 0.0)
        if result.status is not Status.SOLVED:
            yield record | {"seconds": time.perf_counter() - began}
            return
        found = bracket(result)
        yield record | _bound_values(problem, found) | {"seconds": time.perf_counter() - began}
        if not np.isfinite(found.upper) or abs(found.gap) < _CLOSING * found.strain:
            return
        stated = refined_where_apart(stated, found)
        if 4 * int(stated.grid.active.sum()) > most:
            return


def equilibrium(problem: Problem, result: ContactResult, seconds: float) -> Record:
    """Status, mesh, forces, energy, tractions and zones of a result; the energy is −J* [stress × length²]."""
    unknowns = int(result.discretization.qvi.n)
    record = _mesh(result.problem.grid, result.status, result.certificate, result.message, unknowns, seconds)
    if result.status is not Status.SOLVED:
        return record
    line = result.contacts[problem.contact]
    tractions = Tractions.at_gauss_points(line.x, line.normal_stress, line.tangential_stress)
    ends = zone_ends(line.x, line.normal_stress, line.tangential_stress, line.friction_bound)
    return record | {
        "normal_force": line.normal_force,
        "tangential_force": line.tangential_force,
        "energy": -result.energies.complementary,
        "ends": [asdict(end) for end in ends],
        **tractions.as_record(),
    }


def _displacements(problem: Problem, stated: ContactProblem) -> Record:
    """Status, forces and energy of the displacement model on the same mesh."""
    began = time.perf_counter()
    found: CompanionResult = solve_companion(stated, tolerance=TOLERANCE)
    seconds = time.perf_counter() - began
    record = _mesh(stated.grid, found.status, found.certificate, found.message, found.unknowns, seconds)
    if found.status is not Status.SOLVED:
        return record
    line = found.contacts[problem.contact]
    forces = {"normal_force": line.normal_force, "tangential_force": line.tangential_force}
    return record | forces | {"energy": found.energy}


def _mesh(
    mesh: RectilinearMesh, status: Status, certificate: Certificate, message: str, unknowns: int, seconds: float
) -> Record:
    ny, nx = mesh.shape
    smallest = float(min(np.diff(mesh.x).min(), np.diff(mesh.y).min()))
    solved = status is Status.SOLVED
    return {
        "status": status.value, "message": "" if solved else message, "accuracy": float(certificate.accuracy),
        "cells": [nx, ny], "unknowns": unknowns, "smallest": smallest, "seconds": seconds,
    }  # fmt: skip


def _bounds(problem: Problem, result: ContactResult) -> Record:
    """Bounds of the energy, and of the force where one displacement drives the problem."""
    if result.status is not Status.SOLVED:
        return {}
    began = time.perf_counter()
    values = _bound_values(problem, bracket(result))
    return values | {"bracket_seconds": time.perf_counter() - began}


def _bound_values(problem: Problem, found: Any) -> Record:
    force = found.forces.get(f"{problem.contact}.{problem.force}")
    return {
        "kind": found.kind.name, "guaranteed": not found.reasons, "reasons": list(found.reasons),
        "lower": _finite(found.lower), "upper": _finite(found.upper), "gap": _finite(found.gap), "strain": found.strain,
        "force_bounds": None if force is None else [_finite(force.lower), _finite(force.upper)],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
