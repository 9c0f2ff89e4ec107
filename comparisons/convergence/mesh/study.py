"""The study: problems × meshes × degrees, each solved and bracketed; the paper's element on the plate beside them."""

import time
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np

from comparisons.convergence.mesh.problems import PROBLEMS, Problem
from comparisons.lab.study import Study
from qvi_contact import ContactResult, paper, refine, solve
from qvi_contact.bracket import bracket
from qvi_contact.refinement import RefinementRound
from solvers import Status, solve_qvi

TOLERANCE: Final = 1e-8
"""That every certificate confirms."""

EQUAL, GRADED, ADAPTIVE, PAPER = "equal", "graded", "adaptive", "paper"

SEQUENCES: Final = {
    EQUAL: "equal cells, each cut into two triangles",
    GRADED: "twice the coarsest mesh, triangles halved at places known beforehand: corners, ends of zones",
    ADAPTIVE: "made by `refine` for the force, from the coarsest mesh",
    PAPER: "the paper's element (Bogner, Fox, Schmit) on n × n equal cells, the law at four points an edge",
}
"""Sequence of meshes → what it is."""

DEGREES: Final = (3, 4, 5, 6, 8)
REFINED_DEGREE: Final = 5
"""Of adaptive meshes, the default of `refine`."""

TIMES: Final = (1, 2, 4, 8, 16)
DEPTHS: Final = (0, 2, 4, 6, 8, 10)
PAPER_CELLS: Final = (2, 4, 8, 16, 32, 64, 128)

_MOST: Final = 30_000  # unknowns of a mesh
_BRACKETED: Final = 2_000  # unknowns up to which bounds are computed
_OUT_OF_REACH: Final = 1e-9  # relative error asked of refine, so that it goes on to its limit of unknowns
_MOST_REFINED: Final = 3_000

Record = dict[str, Any]


def study(quick: bool) -> Study:
    """The study, or a quick one of coarse meshes and few degrees under another name."""
    return Study.of("convergence-mesh-quick" if quick else "convergence-mesh", 4, run, _cases(quick))


def _cases(quick: bool) -> Iterator[Record]:
    for problem in PROBLEMS.values():
        plate = problem.contact == "plate"
        if quick and problem.name not in ("plate 0.2", "block"):
            continue
        sizes = {EQUAL: TIMES[:3] if quick else TIMES, GRADED: DEPTHS[:3] if quick else DEPTHS}
        for sequence, several in sizes.items():
            for degree in (4, 5) if quick else DEGREES:
                for size in several:
                    if sequence == GRADED or _unknowns(problem, size, degree) <= _MOST:
                        yield {"problem": problem.name, "sequence": sequence, "degree": degree, "size": size}
        refined = 200 if quick else _MOST_REFINED
        yield {"problem": problem.name, "sequence": ADAPTIVE, "degree": REFINED_DEGREE, "size": refined}
        for cells in (PAPER_CELLS[:4] if quick else PAPER_CELLS) if plate else ():
            yield {"problem": problem.name, "sequence": PAPER, "degree": 3, "size": cells}


def _unknowns(problem: Problem, times: int, degree: int) -> int:
    """About as many unknowns as equal cells have: 6 (degree − 2) for each cell that is cut in two."""
    across, up = problem.coarse
    return 6 * (degree - 2) * times**2 * across * up


def run(case: Mapping[str, Any]) -> Record:
    """Task of the study: one mesh, or all rounds of an adaptive one.

    Returns
    -------
    dict
        "meshes", a list of records: status, message, unknowns, cells (their number), h (the shortest edge over the
        body's width), force, energy (−J*), seconds of the solve; and where bounds were computed lower, upper, strain,
        guaranteed and force_bounds

    """
    problem = PROBLEMS[case["problem"]]
    if case["sequence"] == PAPER:
        return {"meshes": [_by_the_paper(float(problem.name.split()[1]), case["size"])]}
    if case["sequence"] == ADAPTIVE:
        return {"meshes": _adaptive(problem, case["degree"], case["size"])}
    stated = problem.equal(case["size"]) if case["sequence"] == EQUAL else problem.graded(case["size"])
    began = time.perf_counter()
    result = solve(stated, degree=case["degree"], tolerance=TOLERANCE)
    found = _answer(problem, result, time.perf_counter() - began)
    return {"meshes": [found | _bounds(problem, result)]}


def _answer(problem: Problem, result: ContactResult, seconds: float) -> Record:
    solved = result.status is Status.SOLVED
    mesh = result.problem.mesh
    corners = mesh.vertices[mesh.cells]
    shortest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).min())
    found: Record = {
        "status": result.status.value, "message": "" if solved else result.message, "seconds": seconds,
        "unknowns": int(result.discretization.qvi.n), "cells": len(mesh.cells), "h": shortest / problem.size[0],
        "accuracy": float(result.certificate.accuracy),
    }  # fmt: skip
    if solved:
        force = float(getattr(result.contacts[problem.contact], problem.force))
        found |= {"force": abs(force), "energy": -result.energies.complementary}
    return found


def _bounds(problem: Problem, result: ContactResult) -> Record:
    if result.status is not Status.SOLVED or result.discretization.qvi.n > _BRACKETED:
        return {}
    found = bracket(result)
    force = found.forces.get(f"{problem.contact}.{problem.force}")
    return {
        "lower": _finite(found.lower), "upper": _finite(found.upper), "strain": found.strain,
        "guaranteed": not found.reasons,
        "force_bounds": None if force is None else [_finite(force.lower), _finite(force.upper)],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _adaptive(problem: Problem, degree: int, most: int) -> list[Record]:
    """A record of each round; the time is all that was spent up to it."""
    records: list[Record] = []
    began = time.perf_counter()

    def keep(done: RefinementRound) -> None:
        records.append({
            "status": Status.SOLVED.value, "message": "", "seconds": time.perf_counter() - began, "h": None,
            "unknowns": done.unknowns, "cells": done.cells[0], "force": abs(done.value), "estimate": done.estimate,
        })  # fmt: skip

    quantity = f"{problem.contact}.{problem.force}"
    refine(problem.equal(1), None, _OUT_OF_REACH, quantity, degree=degree, max_unknowns=most, callback=keep,
           tolerance=TOLERANCE)  # fmt: skip
    return [each | {"estimate": _finite(each["estimate"])} for each in records]


def _by_the_paper(friction: float, cells: int) -> Record:
    """The plate on n × n of the paper's elements."""
    plate = paper.plate(friction, (cells, cells))
    began = time.perf_counter()
    solution = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
    solved = solution.status is Status.SOLVED
    found: Record = {
        "status": solution.status.value, "message": "" if solved else solution.message, "unknowns": plate.qvi.n,
        "seconds": time.perf_counter() - began, "cells": cells**2, "h": 1.0 / cells,
        "accuracy": float(solution.certificate.accuracy),
    }  # fmt: skip
    return found | ({"force": plate.force(solution.z)} if solved else {})
