"""The problems of the study: bodies, where their stresses are singular, and what is known of their answers.

All bodies are rectangles. On equal cells errors are ruled by the singularity where a contact ends in a corner. In a
wedge 0 ≤ θ ≤ π/2 whose face θ = π/2 is free, Φ = r^(λ+1) F(θ) with

    F = a cos(λ+1)θ + b sin(λ+1)θ + c cos(λ−1)θ + d sin(λ−1)θ

gives σ_θθ = λ(λ+1) r^(λ−1) F, σ_rθ = −λ r^(λ−1) F′, and with κ = (3 − ν)/(1 + ν) in plane stress and 3 − 4ν in plane
strain

    2G u_r = r^λ (−(λ+1) F + (κ+1)(c cos(λ−1)θ + d sin(λ−1)θ)),
    2G u_θ = r^λ (−F′ + (κ+1)(c sin(λ−1)θ − d cos(λ−1)θ)).

On the face θ = 0 a flat rigid body either holds the wedge (u_r = u_θ = 0) or lets it slip towards the corner, u_θ = 0
and σ_rθ = μ σ_θθ. λ is the smallest exponent in (½, 1] for which a, b, c, d are not all zero, see `CORNER`; stresses
behave like r^(λ−1). Source: M. L. Williams, J. Appl. Mech. 19 (1952); J. R. Barber, Elasticity, chapter 11, for the
displacements.
"""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np

from comparisons.lab.studies import Study
from comparisons.settled import LIMITS, LIMITS_SOURCE, TRANSITIONS
from qvi_contact import (
    Contact,
    ContactProblem,
    ContactResult,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
    paper,
    refine,
    solve,
)
from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket import bracket
from qvi_contact.gallery import compressed_plate, ssnv128, stick_slip_block
from qvi_contact.problem.conditions import Condition
from qvi_contact.refinement import RefinementRound
from solvers import Status, solve_qvi

_PUSH: Final = 1e-3  # of the punch [mm]
_RADIUS: Final = 800.0  # of the punch [mm]
_STICKING: Final = 0.25  # from here on the plate sticks everywhere

CORNER: Final = {None: 0.7583491578824921, 0.05: 0.9403788391502874, 0.1: 0.88702715978581, 0.2: 0.7927153653759373}
"""μ, or None where the wedge is held → λ in plane stress with ν = 0.3, by the determinant of the conditions above."""


@dataclass(frozen=True)
class Problem:
    """A problem of the study.

    Attributes
    ----------
    name, title : word for tables and options, words for headings
    contact : name of its contact
    force : "normal_force" or "tangential_force", the one that balance alone does not give
    size : of the rectangle [length]
    coarse : cells along x and y of the coarsest mesh
    singular : points where stresses are singular or a zone of the contact ends [length]
    stated : the problem on any mesh
    known : the force and its uncertainty, where it is known from elsewhere
    source : where from
    order : of the force on equal cells of the paper's element, by the strongest singularity; None where it is not known
    sticks : whether the contact sticks everywhere: triangles of any degree have this order too then

    """

    name: str
    title: str
    contact: str
    force: str
    size: tuple[float, float]
    coarse: tuple[int, int]
    singular: Sequence[tuple[float, float]]
    stated: Callable[[], ContactProblem]
    known: tuple[float, float] | None = None
    source: str = ""
    order: float | None = None
    sticks: bool = False

    def equal(self, times: int) -> ContactProblem:
        """The problem on equal cells, so many times as many each way as on the coarsest mesh."""
        across, up = self.coarse
        return replace(self.stated(), mesh=TriangleMesh.rectangle((times * across, times * up), *self.size))

    def graded(self, depth: int) -> ContactProblem:
        """The problem on twice the coarsest mesh, whose triangles at singular points are halved again and again."""
        problem = self.equal(2)
        assert isinstance(problem.mesh, TriangleMesh)
        return replace(problem, mesh=problem.mesh.graded(self.singular, depth))


def punch(friction: float) -> ContactProblem:
    """Right half of a block on a smooth foundation, pressed by a rigid punch of parabolic shape.

    [0, 4] × [0, 2] mm, steel in plane strain, symmetry on x = 0 and y = 0, x = 4 mm free. The punch goes down by 1e-3
    mm and has the radius 800 mm: u_y ≤ −1e-3 + x²/1600 on the top.
    """

    def gap(x: FloatArray, y: FloatArray) -> FloatArray:
        return -_PUSH + x**2 / (2.0 * _RADIUS) + 0.0 * y

    contact = (
        Contact("top", friction=friction, gap=gap, name="punch")
        if friction
        else Contact.frictionless("top", gap=gap, name="punch")
    )
    sides: list[Condition] = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)]
    return ContactProblem(TriangleMesh.rectangle((2, 1), 4.0, 2.0), Material(2.1e5, 0.3, "strain"), [*sides, contact])


def _block() -> ContactProblem:
    return stick_slip_block((4, 2), transition=1.0, slip=0.02, pressure_drop=40.0)[0]


def _plate(friction: float) -> Problem:
    """The plate, with the order of the paper's element on equal cells, from the exponent λ of its free corner.

    Where the contact sticks, the squared error of the stresses, and with it energy and force, fall like h^2λ. Where it
    slips, Φ_xy of the corner node is zero and |σ_T| = μ|σ_N| beside it: the last edge misses friction ~ h^(λ−1) h in
    the work on a slip that is not zero there, which makes h^λ.
    """
    sticks = friction >= _STICKING
    power = CORNER[None if sticks else friction]
    ends = [(1.0, 1.0), *([] if sticks else [(TRANSITIONS[friction], 1.0)])]
    title = f"The plate, μ = {friction:g}{' (sticks everywhere)' if sticks else ''}"
    return Problem(
        f"plate {friction:g}", title, "plate", "normal_force", (1.0, 1.0), (2, 2), ends,
        lambda: compressed_plate(friction), LIMITS[friction], LIMITS_SOURCE,
        2.0 * power if sticks else power, sticks,
    )  # fmt: skip


_ALL: Final = [
    *map(_plate, LIMITS),
    Problem("ssnv128", "SSNV128: opens, slips and sticks", "base", "tangential_force", (0.04, 0.04), (4, 4),
            [(0.0, 0.0), (3.28e-3, 0.0), (2.984e-2, 0.0)], lambda: ssnv128((2, 2))),
    Problem("punch smooth", "Parabolic punch, frictionless: closed and open", "punch", "normal_force", (4.0, 2.0),
            (4, 2), [(0.985, 2.0)], partial(punch, 0.0)),
    Problem("punch rough", "Parabolic punch, μ = 0.3: sticks, slips and opens", "punch", "normal_force", (4.0, 2.0),
            (4, 2), [(0.97, 2.0)], partial(punch, 0.3)),
    # the change from stick to slip, x = 1, is on no vertex of equal cells; ∫ 3a x² dx with a = 30/(3·2²) over [0, 2]
    Problem("block", "Block with an exact solution: sticks and slips", "base", "tangential_force", (2.0, 1.0), (3, 2),
            [(1.0, 0.0)], _block, (20.0, 0.0), "closed form, `gallery.stick_slip_block`"),
]  # fmt: skip

PROBLEMS: Final = {problem.name: problem for problem in _ALL}
"""Name → problem."""


# The study: problems × meshes × degrees, each solved and bracketed; the paper's element on the plate beside them.


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
    """The study, or coarse meshes and few degrees of it."""
    return Study("convergence-mesh", 4, "comparisons.convergence.mesh.study:run", [*_cases(quick)])


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
            "unknowns": done.unknowns, "cells": done.cells, "force": abs(done.value), "estimate": done.estimate,
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
