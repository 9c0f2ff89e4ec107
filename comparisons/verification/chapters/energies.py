"""Chapter on the displacement model beside the equilibrium model: forces, and energies from both sides."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from comparisons.settled import SETTLED, SOURCE
from comparisons.verification.chapters.bodies import plate_under
from comparisons.verification.elements import TRIANGLES, Chapter, Element
from comparisons.verification.measures import ENERGY, FORCE
from comparisons.verification.proof import Proof, both, certified, certified_companion
from comparisons.verification.row import Kind, Row, at_least, at_most, relative
from qvi_contact import Contact, ContactProblem, Material, Traction, TriangleMesh
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Condition

PROBLEMS: Final = Chapter()

_CELLS, _GRADING = (16, 16), 0.75
_DISPLACEMENT: Final = 1e-3
_UNCERTAINTY: Final = 3e-5
_GAP: Final = Contact.frictionless("top", gap=-_DISPLACEMENT, name="plate")


@PROBLEMS.on("companion-force", TRIANGLES)
def companion_force(element: Element, quick: bool) -> Iterator[Row]:
    """Force of the plate by displacements of degree 4 on one graded mesh."""
    for friction in (0.1,) if quick else SETTLED:
        companion = element.companion(compressed_plate(friction, _CELLS, grading=_GRADING), 4)
        force, proof = companion.contacts["plate"].normal_force, certified_companion(companion)
        quantity = f"P/2, μ = {friction:g}, {_CELLS[0]}² cells graded by {_GRADING:g} [{FORCE}]"
        yield relative(quantity, force, SETTLED[friction], 1e-5, SOURCE, proof, Kind.EXTERNAL)


@PROBLEMS.on("companion-without-friction", TRIANGLES)
def companion_without_friction(element: Element, quick: bool) -> Iterator[Row]:
    """Smooth plate: linear displacements are in the space, so that force and both energies are exact."""
    for n in (4,) if quick else (2, 8, 32):
        problem = plate_under(_GAP, n)
        companion, result = element.companion(problem), element.solve(problem)
        proof = both(certified(result), certified_companion(companion, guaranteed=True))
        force = companion.contacts["plate"].normal_force
        yield relative(f"P/2 by displacements [{FORCE}]", force, 209.0, 1e-9, f"E U; {n}² cells", proof)
        exact, source = 209.0 * _DISPLACEMENT / 2.0, f"E U²/2; {n}² cells"
        yield relative(f"upper energy [{ENERGY}]", companion.energy, exact, 1e-10, source, proof)
        yield relative(f"lower energy [{ENERGY}]", -result.energies.complementary, exact, 1e-10, source, proof)


@PROBLEMS.on("energies-tied", TRIANGLES)
def energies_of_a_tied_plate(element: Element, quick: bool) -> Iterator[Row]:
    """Plate that sticks: the exact energy, and with it P/2 = 2 E/U, lies between those of the two models."""
    for n in (4, 8) if quick else (2, 4, 8, 16, 32, 64):
        lower, upper, proof = _energies(element, plate_under(Contact.tied("top", gap=-_DISPLACEMENT, name="plate"), n))
        yield _ordered(lower, upper, f"{n}² cells", proof)
        low, high, settled = 2e3 * lower, 2e3 * upper, SETTLED[1.0]
        source = f"{SOURCE}; {n}² cells"
        yield at_most(f"P/2 from below [{FORCE}]", low, settled, _UNCERTAINTY, source, proof, Kind.EXTERNAL)
        yield at_least(f"P/2 from above [{FORCE}]", high, settled, _UNCERTAINTY, source, proof, Kind.EXTERNAL)


@PROBLEMS.on("energies-without-friction", TRIANGLES)
def energies_without_friction(element: Element, quick: bool) -> Iterator[Row]:
    """A block on smooth ground that lifts off on one side: lower ≤ upper energy on every mesh."""
    for n in (4,) if quick else (4, 8, 16, 32):
        lower, upper, proof = _energies(element, _tilted((n, n)))
        yield _ordered(lower, upper, f"{n}² cells", proof)


@PROBLEMS.on("energies-tresca", TRIANGLES)
def energies_under_a_given_bound(element: Element, quick: bool) -> Iterator[Row]:
    """Tresca's law: the bound is given, and lower ≤ upper energy on every mesh."""
    contact = Contact.tresca("top", 10.0, gap=-_DISPLACEMENT, name="plate")
    for n in (4,) if quick else (4, 8, 16, 32):
        lower, upper, proof = _energies(element, plate_under(contact, n))
        yield _ordered(lower, upper, f"bound 10 MPa, {n}² cells", proof)


def _energies(element: Element, problem: ContactProblem) -> tuple[float, float, Proof]:
    """Lower and upper energy for a problem without a moving bound, and what certifies them.

    The stress is admissible on whole edges, without which its energy would be no bound.
    """
    result, companion = element.solve(problem), element.companion(problem)
    proof = both(certified(result), certified_companion(companion, guaranteed=True))
    return -result.energies.complementary, companion.energy, proof


def _ordered(lower: float, upper: float, source: str, proof: Proof) -> Row:
    quantity, source = "lower energy −J*(τ) [stress length²]", f"−J*(τ) ≤ J(v) of the displacement model; {source}"
    return at_most(quantity, lower, upper, 1e-12 * abs(upper), source, proof)


def _tilted(cells: tuple[int, int]) -> ContactProblem:
    """A block [0, 2] × [0, 1] on smooth ground, pressed on the left half of its top only: the right part lifts off."""
    conditions: list[Condition] = [
        Contact.frictionless("bottom", name="ground"),
        Traction("top", x=0.0, y=lambda x, _: -20.0 * np.maximum(1.0 - x, 0.0)),
        Traction("left", x=0.0, y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    return ContactProblem(TriangleMesh.rectangle(cells, 2.0, 1.0), Material(1e4, 0.3), conditions)
