"""Chapter on bounds of the energy and of the force, under slip too."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from comparisons.settled import LIMITS, LIMITS_SOURCE
from comparisons.verification.measures import FORCE, plate_under
from comparisons.verification.rows import Chapter, Check, Kind, Proof, Row, both, by_hand, certified
from qvi_contact import Contact, ContactProblem, Displacement, Material, Symmetry, Traction, TriangleMesh, refine, solve
from qvi_contact.bracket import Bounds, Bracket, bracket
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.gallery.exact import cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.problem.conditions import Condition
from qvi_contact.refinement.outcome import Refinement

BOUNDS: Final = Chapter()

_PUSH: Final = 1e-3
_MESHES: Final = (*((cells, 1.0) for cells in (2, 4, 8, 16)), (8, 0.6), (16, 0.75))
_SYNGE: Final = "(D20): −J*(τ) ≤ J(u) ≤ J(v)"
_ROUNDING: Final = 1e-12


def _free(*names: str) -> list[Condition]:
    return [Traction(name, x=0.0, y=0.0) for name in names]


def _sticking(cells: int, grading: float) -> ContactProblem:
    return plate_under(Contact.tied("top", gap=-_PUSH, name="plate"), cells, grading)


def _curved(cells: int, grading: float) -> ContactProblem:
    conditions: list[Condition] = [
        Contact.frictionless("bottom", gap=lambda x, y: 2e-3 * x**2 + 0.0 * y, name="ground"),
        Symmetry("left"),
        Displacement("top", x=0.0, y=-_PUSH),
    ]
    mesh = TriangleMesh.rectangle((cells, cells), grading=grading)
    return ContactProblem(mesh, Material(2.09e5, 0.3), [*conditions, *_free("right")])


_PROBLEMS: Final[dict[str, Callable[[int, float], ContactProblem]]] = {
    "Tresca": partial(plate_under, Contact.tresca("top", 40.0, gap=-_PUSH, name="plate")),
    "full stick": _sticking,
    "frictionless, curved ground": _curved,
}
"""Name → problem by cells a side and grading."""


@BOUNDS("bounds-energy", 4)
def energy_brackets(p: int, quick: bool) -> Iterator[Row]:
    """Energies of an admissible stress and an admissible displacement, on uniform and graded meshes of 2² to 16² cells.

    On every mesh the lower bound must not be above the upper one, and the bounds of all meshes must have a number in
    common: the energy of the solution.
    """
    meshes = ((2, 1.0), (4, 0.6)) if quick else _MESHES
    for name, problem in _PROBLEMS.items():
        found = [solve(problem(cells, grading), degree=p).bracket for cells, grading in meshes]
        rows = Check(_guaranteed(*found), _SYNGE, _ROUNDING)
        apart = max((b.lower - b.upper) / b.strain for b in found)
        yield rows.at_most(f"{name}: lower − upper on each mesh, over the strain energy", apart, 0.0)
        crossed = (max(b.lower for b in found) - min(b.upper for b in found)) / found[-1].strain
        yield rows.at_most(
            f"{name}: largest lower − smallest upper of all meshes, over the strain energy", crossed, 0.0
        )


def _trapezoid() -> ContactProblem:
    """A trapezoid whose base is tied to a plane that is pushed up."""
    block = TriangleMesh.rectangle((4, 2), 2.0, 1.0, origin=(-1.0, 0.0))
    x, y = block.vertices.T
    mesh = replace(block, vertices=np.column_stack([x * (1.0 - y / 2.0), y]))
    conditions: list[Condition] = [Contact.tied("bottom", gap=-_PUSH), Displacement("top", x=0.0, y=0.0)]
    return ContactProblem(mesh, Material(1e4, 0.2, "strain"), [*conditions, *_free("left", "right")])


def _l_shape() -> ContactProblem:
    """An L of side 3 with a re-entrant corner at (1, 1), clamped below, its top displaced."""
    lines = np.arange(4.0)
    tops = {"roof": lambda _, y: y == 3.0, "step": lambda x, y: (y == 1.0) & (x > 1.0)}
    mesh = TriangleMesh.grid(lines, lines, np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool), edges=tops)
    conditions: list[Condition] = [Displacement("bottom", x=0.0, y=0.0), Displacement("roof", x=_PUSH, y=-_PUSH)]
    return ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), [*conditions, *_free("left", "right", "step")])


_CORNERED: Final = {
    "trapezoid": (_trapezoid, "bottom.normal_force", {3: 1.8, 4: 3.0, 5: 4.3}),
    "L": (_l_shape, "energy", {3: 1.8, 4: 3.0, 5: 3.4}),
}
"""Bodies with corners, what is refined, and the least order by degree."""


@BOUNDS("bounds-refined", 3, 4, 5)
def orders_of_refined_bounds(p: int, quick: bool) -> Iterator[Row]:
    """How fast guaranteed bounds close by `refine` in the number of unknowns, whatever corners the body has.

    Meshes of the best grading have order p − 1 in the end. While a mesh still grows into corners it may be more.
    """
    start, end = (1e-3, 1e-4) if quick else (1e-3, 3e-5) if p == 3 else (1e-4, 1e-6)
    for name, (problem, quantity, least) in list(_CORNERED.items())[: 1 if quick else None]:
        outcome = refine(problem(), None, end, quantity, degree=p)
        rounds = [each for each in outcome.rounds if each.estimate <= start]
        order = np.log(rounds[0].estimate / outcome.estimate) / np.log(rounds[-1].unknowns / rounds[0].unknowns)
        quantity = f"{name}: order of the bound in unknowns, {start:.0e} to {end:.0e}"
        yield Check(_refined(outcome), f"p = {p}").at_least(quantity, float(order), least[p])


def _exact() -> Iterator[tuple[str, ContactProblem, int]]:
    plane, strained = Material(1000.0, 0.3), Material(1000.0, 0.2, "strain")
    block = TriangleMesh.rectangle((3, 2), 2.0, 1.0, grading=0.7)
    beam = TriangleMesh.grid([0.0, 1.0, 2.5, 4.0], [-0.5, 0.1, 0.5])
    free = {"bottom": "tt", "right": "tt", "top": "tt", "left": "tt"}
    sides = {"bottom": "uu", "right": "tt", "top": "tu", "left": "ut"}
    yield "uniform stress", problem_from_state(uniform(plane, 3.0, -7.0, 2.0), block, plane, sides), 2
    bending = problem_from_state(pure_bending(strained, 5.0), beam, strained, free | {"left": "uu"})
    yield "pure bending", bending, 2
    bent = problem_from_state(cantilever(plane, 8.0, -1.0), beam, plane, free | {"right": "uu"})
    yield "Timoshenko's cantilever", bent, 3
    column = problem_from_state(gravity_column(strained, 2.0, 1.0), block, strained, free | {"bottom": "uu"})
    yield "column under its weight", column, 2
    yield "plate without friction", compressed_plate(0.0, (3, 2), grading=0.8), 2
    yield "SSNV128 without friction", ssnv128((4, 3), friction=0.0), 2


@BOUNDS("bounds-exact", 4, 5)
def exact_states_close_the_gap(p: int, _: bool) -> Iterator[Row]:
    """States that both models hold exactly: stresses from a bicubic Φ, displacements of degree 2 or 3."""
    for name, problem, degree in _exact():
        found = bracket(solve(problem, degree=p), degree=degree)
        rows = Check(_guaranteed(found), "closed form in both spaces", 1e-10)
        yield rows.absolute(f"{name}: (upper − lower) / strain energy", found.gap / found.strain, 0.0)


@BOUNDS("bounds-force", 4)
def force_between_bounds(p: int, quick: bool) -> Iterator[Row]:
    """Guaranteed bounds of P/2 at full stick enclose the settled value of displacement codes, and close on it."""
    limit, uncertainty = LIMITS[1.0]
    for cells, grading in ((4, 0.6), (8, 0.6), (16, 0.75))[: 1 if quick else None]:
        found = solve(_sticking(cells, grading), degree=p).bracket
        force, mesh = found.forces["plate.normal_force"], f"{cells}² cells graded by {grading:g}"
        rows = Check(_guaranteed(found), LIMITS_SOURCE, uncertainty, Kind.EXTERNAL)
        yield from rows.enclosed(f"{{}} of P/2, {mesh} [{FORCE}]", force, limit)
        rows = Check(_guaranteed(found), "(D21)", 1e-3)
        yield rows.at_most(f"distance of the bounds, {mesh}, over P/2", (force.upper - force.lower) / limit, 0.0)


@BOUNDS("bounds-slip", 5)
def forces_under_slip(p: int, quick: bool) -> Iterator[Row]:
    """The paper's plate with slip, refined until guaranteed bounds of its force are within 1e-6 of it.

    The bounds of every mesh on the way must hold the settled force.
    """
    target = 1e-3 if quick else 1e-6
    for friction in (0.2,) if quick else (0.05, 0.1, 0.2):
        limit, uncertainty = LIMITS[friction]
        problem, where = compressed_plate(friction, (1, 1)), f"μ = {friction:g}"
        outcome = refine(problem, None, target, "plate.normal_force", guaranteed=True, degree=p)
        bounds = outcome.result.bracket.coulomb
        force = Bounds(-np.inf, np.inf) if bounds is None else bounds.forces["plate.normal_force"]
        rows = Check(_refined(outcome), LIMITS_SOURCE, uncertainty, Kind.EXTERNAL)
        yield from rows.enclosed(f"{where}: {{}} of P/2 [{FORCE}]", force, limit)
        beyond = max(abs(each.value / limit - 1.0) - each.estimate for each in outcome.rounds if each.guaranteed)
        quantity = f"{where}: largest error − bound of all meshes, over P/2"
        yield rows.at_most(quantity, beyond, 0.0, tolerance=uncertainty / limit)
        quantity, unknowns = f"{where}: unknowns for a guaranteed error of {target:g}", outcome.rounds[-1].unknowns
        yield Check(rows.proof, "what it may take").at_most(quantity, unknowns, 5000.0)


def _refined(outcome: Refinement) -> Proof:
    return both(certified(outcome.result), by_hand(outcome.certainty != "estimate", "a guaranteed bound"))


def _guaranteed(*brackets: Bracket) -> Proof:
    """Both solves certified, and the bracket guaranteed."""
    reasons = "; ".join(reason for found in brackets for reason in found.reasons)
    return both(certified(*(found.result for found in brackets)), by_hand(not reasons, reasons or "guaranteed bracket"))
