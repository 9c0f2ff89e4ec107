"""Chapters on the paper's plate: printed numbers, displacement codes, and energies from both sides."""

from collections.abc import Iterator
from functools import cache
from typing import Final

import numpy as np

from comparisons.paper.reference import load
from comparisons.paper.study import SHRINKING
from comparisons.settled import LIMITS, LIMITS_SOURCE, SETTLED, SOURCE
from comparisons.verification.measures import ENERGY, FORCE, plate_under
from comparisons.verification.rows import Chapter, Check, Kind, Proof, Row, both, certified, certified_companion
from qvi_contact import Contact, refine, solve
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
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
    """A state that is not converged is certified by the limit of the same iteration, whose step shrinks if μ is 0."""
    decay = SHRINKING if friction == 0.0 else None
    proof = certified(load().uzawa(load().plate(friction).qvi, step_decay=decay))
    proof = Proof(proof.passed, f"{proof.text} of the limit")
    return Check(proof, f"{_PAPER}, {place}; half a unit of the last digit", _HALF_DIGIT, Kind.PUBLISHED)


_GRADED: Final = (16, 0.8)
"""Cells a side and grading."""


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
    """P/2 to eight digits: the triangles that `refine` makes for a target of 1e-8."""
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
        yield rows.at_most(quantity.format("largest"), max(ratios), 3.0, LIMITS_SOURCE)


_DISPLACEMENT: Final = 1e-3
_SMOOTH: Final = Contact.frictionless("top", gap=-_DISPLACEMENT, name="plate")


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
        rows, exact = Check(proof, f"{n}² cells", 1e-10), 209.0 * _DISPLACEMENT / 2.0
        force = companion.contacts["plate"].normal_force
        yield rows.relative(f"P/2 by displacements [{FORCE}]", force, 209.0, "E U", tolerance=1e-9)
        yield rows.relative(f"upper energy [{ENERGY}]", companion.energy, exact, "E U²/2")
        yield rows.relative(f"lower energy [{ENERGY}]", -result.energies.complementary, exact, "E U²/2")
