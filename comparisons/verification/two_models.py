"""What a stress model and a displacement model say about the same problem on the same mesh."""

from collections.abc import Iterator

from comparisons.verification.elements import TRIANGLES
from comparisons.verification.measures import mean_pressure
from comparisons.verification.proof import both, certified, certified_companion
from comparisons.verification.row import Kind, Row, at_least, at_most, relative
from qvi_contact import ContactLine, ContactProblem, ContactResult
from qvi_contact.companion import CompanionContact, solve_companion


def two_models(quick: bool, result: ContactResult, contact: str, tolerance: float, apart: float) -> Iterator[Row]:
    """The mean pressure against displacements on the same mesh, and energies from both sides; nothing in quick runs."""
    if quick:
        return
    companion = solve_companion(result.problem)
    proof, theirs = both(certified(result), certified_companion(companion)), companion.contacts[contact]
    ours, source = mean_pressure(result.contacts[contact]), "displacement model on the same mesh"
    yield relative("mean pressure, both models", ours, mean_pressure(theirs), tolerance, source, proof, Kind.METHODS)
    found = result.bracket
    width, source = (found.upper - found.lower) / found.strain, f"bracket for {found.kind.value}"
    yield at_most("gap of the energies over the strain energy", width, apart, 0.0, source, proof, Kind.METHODS)
    if found.guaranteed:
        yield at_least("the same, upper not below lower", width, 0.0, 1e-9, source, proof)


def by_both_models(problem: ContactProblem, contact: str) -> tuple[ContactLine, CompanionContact]:
    """A contact by stresses and by displacements on the same triangles."""
    return TRIANGLES.solve(problem).contacts[contact], TRIANGLES.companion(problem).contacts[contact]
