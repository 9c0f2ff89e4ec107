"""Chapters on the paper's plate: printed numbers, displacement codes; and on energies and bounds from both sides."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from typing import Final

import numpy as np

from comparisons.paper.study import SHRINKING, load
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE
from comparisons.verification.measures import ENERGY, FORCE, plate_under
from comparisons.verification.rows import (
    Chapter,
    Check,
    Kind,
    Proof,
    Row,
    both,
    by_hand,
    certified,
    certified_companion,
)
from qvi_contact import Contact, ContactProblem, Displacement, Material, Symmetry, Traction, TriangleMesh, refine, solve
from qvi_contact.bracket import Bounds, Bracket, bracket
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.gallery.exact import cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.problem.conditions import Condition
from qvi_contact.refinement import Refinement
from solvers import QVISolution

PAPER, PLATE, ENERGIES = Chapter(), Chapter(), Chapter()

_PAPER: Final = "Więckowski (1992), Mech. Teoret. Stos."
_HALF_DIGIT: Final = 0.005  # half a unit of the last printed digit


@PAPER("table-1")
def printed_forces(quick: bool) -> Iterator[Row]:
    """Table 1: P/2 after the paper's 30 Uzawa iterations, to every printed digit."""
    reference = load()
    for friction, printed in list(reference.table.items())[:: 3 if quick else 1]:
        rows, force = _printed(friction, "Table 1"), reference.plate(friction).force(_uzawa(friction).z)
        quantity = f"P/2 after {reference.iterations} iterations, μ = {friction:.2f} [{FORCE}]"
        yield rows.absolute(quantity, force, printed)


@PAPER("figures-2-to-5")
def printed_stresses(quick: bool) -> Iterator[Row]:
    """Figures 2-5: largest principal stress after 30 iterations, to every printed digit."""
    reference = load()
    for friction, (number, printed) in list(reference.figures.items())[:: 3 if quick else 1]:
        first, second, _ = reference.plate(friction).principal_stress(_uzawa(friction).z)
        largest = float(max(np.abs(first).max(), np.abs(second).max()))
        quantity = f"largest |principal stress| after {reference.iterations} iterations, μ = {friction:.1f} [MPa]"
        yield _printed(friction, f"Fig. {number}").absolute(quantity, largest, printed)


@cache
def _uzawa(friction: float) -> QVISolution:
    """The state after the paper's number of iterations, in its own system."""
    return load().uzawa(load().plate(friction).qvi, rule="accumulating", iterations=load().iterations)


def _printed(friction: float, place: str) -> Check:
    """Rows of a state that is not converged, certified by the limit of its iteration (μ = 0: with a shrinking step)."""
    decay = SHRINKING if friction == 0.0 else None
    proof = certified(load().uzawa(load().plate(friction).qvi, step_decay=decay))
    proof = Proof(proof.passed, f"{proof.text} of the limit")
    return Check(proof, f"{_PAPER}, {place}; half a unit of the last digit", _HALF_DIGIT, Kind.PUBLISHED)


_GRADED: Final = (16, 0.8)
"""Cells a side and grading of a mesh."""


@PLATE("plate-graded", 4, 5)
def graded_equilibrium_model(p: int, quick: bool) -> Iterator[Row]:
    """Stress elements on one graded mesh, cells shrinking towards the free corner."""
    cells, grading = _GRADED
    for friction, settled in list(SETTLED.items())[:: 2 if quick else 1]:
        result = solve(compressed_plate(friction, (cells, cells), grading=grading), degree=p)
        rows = Check(certified(result), SOURCE, 2e-5 if p == 4 else 1e-5, Kind.EXTERNAL)
        quantity = f"P/2, μ = {friction:g}, {cells}² cells graded by {grading:g} [{FORCE}]"
        yield rows.relative(quantity, result.contacts["plate"].normal_force, settled)


@PLATE("plate-limits", 5)
def limits_of_the_force(p: int, quick: bool) -> Iterator[Row]:
    """P/2 to eight digits: the triangles that refine makes for a target of 1e-8.

    Estimates fall by no more than twice what the energy of the difference falls by, as a faster fall may be chance. At
    first this force falls faster: so the limit above is 4, not twice the factor of safety.
    """
    target = 1e-5 if quick else 1e-8
    for friction in (1.0,) if quick else tuple(LIMITS):
        limit, uncertainty = LIMITS[friction]
        start = compressed_plate(friction, (2, 2))
        refined = refine(start, None, target=target, quantity="plate.normal_force", degree=p)
        rows = Check(certified(refined.result), kind=Kind.EXTERNAL)
        quantity, source = f"P/2, μ = {friction:g}, refined to {target:.0e} [{FORCE}]", f"± {uncertainty:.0e}"
        yield rows.relative(quantity, refined.value, limit, f"{LIMITS_SOURCE}; {source}", tolerance=3.0 * target)
        quantity = f"{{}} estimate over error in a round, μ = {friction:g}"
        ratios = [each.estimate / abs(each.value / limit - 1.0) for each in refined.rounds]
        yield rows.at_least(quantity.format("least"), min(ratios), 1.0 / 3.0, LIMITS_SOURCE)
        yield rows.at_most(quantity.format("largest"), max(ratios), 4.0, LIMITS_SOURCE)


_PUSH: Final = 1e-3
_SMOOTH: Final = Contact.frictionless("top", gap=-_PUSH, name="plate")


@ENERGIES("companion-force", 4)
def companion_force(_: int, quick: bool) -> Iterator[Row]:
    """Force of the plate by displacements of degree 4 on one graded mesh."""
    for friction in (0.1,) if quick else SETTLED:
        companion = solve_companion(compressed_plate(friction, (16, 16), grading=0.75), degree=4)
        rows = Check(certified_companion(companion), SOURCE, 1e-5, Kind.EXTERNAL)
        quantity = f"P/2, μ = {friction:g}, 16² cells graded by 0.75 [{FORCE}]"
        yield rows.relative(quantity, companion.contacts["plate"].normal_force, SETTLED[friction])


@ENERGIES("companion-without-friction", 4)
def companion_without_friction(p: int, quick: bool) -> Iterator[Row]:
    """Smooth plate: linear displacements are in the space, so that force and both energies are exact."""
    for n in (4,) if quick else (2, 8, 32):
        problem = plate_under(_SMOOTH, n)
        companion, result = solve_companion(problem), solve(problem, degree=p)
        proof = both(certified(result), certified_companion(companion, guaranteed=True))
        rows, exact = Check(proof, f"{n}² cells", 1e-10), 209.0 * _PUSH / 2.0
        force = companion.contacts["plate"].normal_force
        yield rows.relative(f"P/2 by displacements [{FORCE}]", force, 209.0, "E U", tolerance=1e-9)
        yield rows.relative(f"upper energy [{ENERGY}]", companion.energy, exact, "E U²/2")
        yield rows.relative(f"lower energy [{ENERGY}]", -result.energies.complementary, exact, "E U²/2")


BOUNDS: Final = Chapter()

_MESHES: Final = (*((cells, 1.0) for cells in (2, 4, 8, 16)), (8, 0.6), (16, 0.75))
_SYNGE: Final = "(D20): −J*(τ) ≤ J(u) ≤ J(v)"
_ROUNDING: Final = 1e-12


def _free(*names: str) -> list[Condition]:
    return [Traction(name, x=0.0, y=0.0) for name in names]


def _curved(cells: int, grading: float) -> ContactProblem:
    mesh, push = TriangleMesh.rectangle((cells, cells), grading=grading), Displacement("top", x=0.0, y=-_PUSH)
    ground = Contact.frictionless("bottom", gap=lambda x, y: 2e-3 * x**2 + 0.0 * y, name="ground")
    return ContactProblem(mesh, Material(2.09e5, 0.3), [ground, Symmetry("left"), push, *_free("right")])


_PROBLEMS: Final[dict[str, Callable[[int, float], ContactProblem]]] = {
    "Tresca": partial(plate_under, Contact.tresca("top", 40.0, gap=-_PUSH, name="plate")),
    "full stick": partial(plate_under, Contact.tied("top", gap=-_PUSH, name="plate")),
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
        quantity = f"{name}: largest lower − smallest upper of all meshes, over the strain energy"
        yield rows.at_most(quantity, crossed, 0.0)


def _trapezoid() -> ContactProblem:
    """A trapezoid whose base is tied to a plane that is pushed up."""
    block = TriangleMesh.rectangle((4, 2), 2.0, 1.0, origin=(-1.0, 0.0))
    x, y = block.vertices.T
    mesh = replace(block, vertices=np.column_stack([x * (1.0 - y / 2.0), y]))
    base, top = Contact.tied("bottom", gap=-_PUSH), Displacement("top", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(1e4, 0.2, "strain"), [base, top, *_free("left", "right")])


def _l_shape() -> ContactProblem:
    """An L of side 3 with a re-entrant corner at (1, 1), clamped below, its top displaced."""
    lines = np.arange(4.0)
    tops = {"roof": lambda _, y: y == 3.0, "step": lambda x, y: (y == 1.0) & (x > 1.0)}
    mesh = TriangleMesh.grid(lines, lines, np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool), edges=tops)
    held, pushed = Displacement("bottom", x=0.0, y=0.0), Displacement("roof", x=_PUSH, y=-_PUSH)
    return ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), [held, pushed, *_free("left", "right", "step")])


_CORNERED: Final = {
    "trapezoid": (_trapezoid, "bottom.normal_force", {3: 1.8, 4: 3.0, 5: 4.3}),
    "L": (_l_shape, "energy", {3: 1.8, 4: 3.0, 5: 3.4}),
}
"""Name → a body with corners, the quantity that is refined, and the least order by degree."""


@BOUNDS("bounds-refined", 3, 4, 5)
def orders_of_refined_bounds(p: int, quick: bool) -> Iterator[Row]:
    """Orders in the number of unknowns at which guaranteed bounds close under refine, on bodies with corners.

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
    """States that both models hold exactly: stresses of degree 2 at most, displacements of degree 2 or 3."""
    for name, problem, degree in _exact():
        found = bracket(solve(problem, degree=p), degree=degree)
        rows = Check(_guaranteed(found), "closed form in both spaces", 1e-10)
        yield rows.absolute(f"{name}: (upper − lower) / strain energy", found.gap / found.strain, 0.0)


@BOUNDS("bounds-force", 4)
def force_between_bounds(p: int, quick: bool) -> Iterator[Row]:
    """Guaranteed bounds of P/2 at full stick enclose the settled value of displacement codes, and close on it."""
    limit, uncertainty = LIMITS[1.0]
    for cells, grading in ((4, 0.6), (8, 0.6), (16, 0.75))[: 1 if quick else None]:
        found = solve(_PROBLEMS["full stick"](cells, grading), degree=p).bracket
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
