"""Chapter on the paper's plate: printed numbers, and all methods on its mesh."""

from collections.abc import Iterator
from functools import cache
from typing import Any, Final

import numpy as np

from comparisons.paper.reference import load
from comparisons.paper.study import SHRINKING
from comparisons.verification.elements import Chapter
from comparisons.verification.measures import FORCE
from comparisons.verification.proof import Proof, both, certified_algebra
from comparisons.verification.row import Kind, Row, absolute, relative
from qvi_contact import principal_stresses
from qvi_contact.basics.checks import FloatArray
from solvers import QVISolution, solve_qvi

PROBLEMS: Final = Chapter()

_PAPER = "Więckowski (1992), Mech. Teoret. Stos."
_HALF_DIGIT = 0.005  # half a unit of the last printed digit
_INNERS = ("direct:clarabel", "qp:clarabel", "socp:clarabel")


@PROBLEMS.named("table-1")
def printed_forces(quick: bool) -> Iterator[Row]:
    """Table 1: P/2 after the paper's 30 Uzawa iterations, to every printed digit."""
    reference = load()
    for friction, printed in list(reference.table.items())[:: 3 if quick else 1]:
        ours = reference.plate(friction).force(_uzawa(friction).z)
        source = f"{_PAPER}, Table 1; half a unit of the last digit"
        quantity = f"P/2 after {reference.iterations} iterations, μ = {friction:.2f} [{FORCE}]"
        yield absolute(quantity, ours, printed, _HALF_DIGIT, source, _limit(friction), Kind.PUBLISHED)


@PROBLEMS.named("figures-2-to-5")
def printed_stresses(quick: bool) -> Iterator[Row]:
    """Figures 2-5: largest principal stress after 30 iterations, to every printed digit."""
    reference = load()
    for friction, (number, printed) in list(reference.figures.items())[:: 3 if quick else 1]:
        ours = _largest(reference.plate(friction).stress(_uzawa(friction).z)[2])
        source = f"{_PAPER}, Fig. {number}; half a unit of the last digit"
        quantity = f"largest |principal stress| after {reference.iterations} iterations, μ = {friction:.1f} [MPa]"
        yield absolute(quantity, ours, printed, _HALF_DIGIT, source, _limit(friction), Kind.PUBLISHED)


@PROBLEMS.named("plate-methods")
def methods_on_the_paper_mesh(quick: bool) -> Iterator[Row]:
    """The solution on the paper's four cells by methods that share no iteration, against the condensed one."""
    for friction in (0.1,) if quick else (0.05, 0.1, 0.2, 0.3):
        plate = load().plate(friction)
        condensed = solve_qvi(plate.qvi, method="condensed")
        others = {"Uzawa (4.1)-(4.4), converged": load().uzawa(plate.qvi, **_decay(friction))}
        inners = _INNERS[:2] if quick else _INNERS
        others |= {f"fixed point, {inner}": solve_qvi(plate.qvi, method="fixed-point", inner=inner) for inner in inners}
        ours = np.array(plate.tractions(condensed.z)[1:])
        for name, other in others.items():
            proof = both(certified_algebra(condensed), certified_algebra(other))
            source = f"{name}; ours: condensed interior point"
            force, quantity = plate.force(other.z), f"P/2, μ = {friction:g} [{FORCE}]"
            yield relative(quantity, plate.force(condensed.z), force, 1e-7, source, proof, Kind.METHODS)
            apart = np.abs(ours - np.array(plate.tractions(other.z)[1:])).max() / force  # the contact has the length 1
            quantity = f"largest difference of tractions over the mean pressure, μ = {friction:g}"
            yield absolute(quantity, float(apart), 0.0, 1e-5, source, proof, Kind.METHODS)


@PROBLEMS.named("plate-without-friction")
def without_friction(_: bool) -> Iterator[Row]:
    """μ = 0: the stress is uniform and P/2 = E U."""
    plate, exact = load().plate(0.0), load().exact_without_friction
    solution = solve_qvi(plate.qvi, method="condensed")
    source, proof = f"P/2 = E U; {_PAPER}, section 5", certified_algebra(solution)
    yield relative(f"P/2 [{FORCE}]", plate.force(solution.z), exact, 1e-9, source, proof)
    largest = _largest(plate.stress(solution.z)[2])
    yield relative("largest |principal stress| [MPa]", largest, exact, 1e-9, "|σ_yy| = E U / height", proof)


@cache
def _uzawa(friction: float) -> QVISolution:
    """The state after the paper's number of iterations, in its own system."""
    return load().uzawa(load().plate(friction).qvi, rule="accumulating", iterations=load().iterations)


def _limit(friction: float) -> Proof:
    """What certifies a state that is not converged: the certificate of the limit of the same iteration."""
    proof = certified_algebra(load().uzawa(load().plate(friction).qvi, **_decay(friction)))
    return Proof(proof.passed, f"{proof.text} of the limit")


def _decay(friction: float) -> dict[str, Any]:
    """Without friction the step must shrink."""
    return {"step_decay": SHRINKING if friction == 0.0 else None}


def _largest(stress: FloatArray) -> float:
    """The largest |principal stress|."""
    first, second, _ = principal_stresses(stress)
    return float(max(np.abs(first).max(), np.abs(second).max()))
