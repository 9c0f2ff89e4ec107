"""What a stress model and a displacement model say about the same problem on the same mesh."""

from collections.abc import Callable, Iterator, Mapping

from comparisons.verification.elements import TRIANGLES
from comparisons.verification.exhibits import Curve
from comparisons.verification.measures import mean_pressure
from comparisons.verification.proof import both, certified, certified_companion
from comparisons.verification.row import Kind, Row, at_least, at_most, relative
from qvi_contact import ContactLine, ContactProblem, ContactResult
from qvi_contact.basics.checks import FloatArray
from qvi_contact.companion import CompanionContact, solve_companion

_Value = Callable[[ContactLine | CompanionContact], FloatArray]


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
    if not found.reasons:
        yield at_least("the same, upper not below lower", width, 0.0, 1e-9, source, proof)


def curves_of_both(
    problem: ContactProblem, contact: str, along: _Value, values: Mapping[str, _Value]
) -> tuple[tuple[Curve, ...], tuple[Curve, ...]]:
    """Values along a contact, by their names: of stresses, and of displacements on the same triangles."""
    stresses, displacements = TRIANGLES.solve(problem), TRIANGLES.companion(problem)
    ours, theirs = (
        tuple(Curve(f"{name}, {model}", along(line), value(line)).ordered() for name, value in values.items())
        for model, line in (
            ("stresses", stresses.contacts[contact]),
            ("displacements", displacements.contacts[contact]),
        )
    )
    return ours, theirs
