"""Problems of the chapter on bounds under Coulomb friction: true errors, bad stresses, other bodies."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from comparisons.verification.chapters.bodies import half_disc, half_discs, sheared_layer
from comparisons.verification.elements import TRIANGLES, Chapter, Element
from comparisons.verification.measures import energy_apart, halved
from comparisons.verification.proof import Proof, both, by_hand, certified
from comparisons.verification.row import Kind, Row, at_least, at_most, enclosed, word
from qvi_contact import Contact, ContactProblem, ContactResult, TriangleMesh
from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.coulomb import CoulombBounds
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.refinement.rounds import bulk

PROBLEMS: Final = Chapter()

_FINE: Final = 8
"""Degree of the triangles whose stress stands for the exact one, on the same mesh."""

_ERROR: Final = "bound over true error of the stress"
_TRUTH: Final = f"the stress of degree {_FINE} on the same mesh"
_BAD: Final = 100
_WEAKER: Final = (0.02, 0.1, 0.18)
_BELOW: Final = "T2: no stress is farther away than its bound"


@PROBLEMS.on("bounds-slip-errors", TRIANGLES)
def errors_under_slip(element: Element, quick: bool) -> Iterator[Row]:
    """The paper's plate: bounds of the stress error in the energy norm beside the true error.

    The bound must not be below the error, and not more than 4 times as large, on meshes that are bisected where it says
    so and on equal cells. It holds for Coulomb's law whatever the exact solution does. That costs: on coarse meshes the
    edge where stick changes into slip has a share of friction that is far from continuous, and counts.
    """
    for friction in (0.2,) if quick else (0.05, 0.1, 0.2):
        adaptive = [_against_truth(element, result) for result in _chain(element, friction, 2 if quick else 6)]
        plates = [compressed_plate(friction, (n, n)) for n in ((2,) if quick else (2, 4, 8))]
        equal = [_against_truth(element, element.solve(plate)) for plate in plates]
        for name, found in (("adaptive meshes", adaptive), ("equal cells", equal)):
            ratios, proof = [ratio for ratio, _ in found], both(*(proof for _, proof in found))
            where = f"{_ERROR}, μ = {friction:g}, {name}"
            yield at_least(f"least {where}", min(ratios), 1.0, 0.0, _TRUTH, proof, Kind.METHODS)
            yield at_most(f"largest {where}", max(ratios), 4.0, 0.0, _TRUTH, proof, Kind.METHODS)


def _chain(element: Element, friction: float, count: int) -> Iterator[ContactResult]:
    """The plate on meshes bisected where the bound says so."""
    result = element.solve(compressed_plate(friction, (1, 1)))
    for _ in range(count):
        mesh = result.problem.mesh
        assert isinstance(mesh, TriangleMesh)
        result = element.solve(replace(result.problem, mesh=mesh.refined(bulk(_coulomb(result).cells))))
        yield result


def _against_truth(element: Element, result: ContactResult) -> tuple[float, Proof]:
    """The bound over the true error, and what certifies it."""
    fine, bounds = replace(element, degree=_FINE).solve(result.problem), _coulomb(result)
    return bounds.error / energy_apart(result, fine), both(certified(result, fine), _guaranteed(bounds))


@PROBLEMS.on("bounds-slip-bad", TRIANGLES)
def bad_stresses_under_slip(element: Element, quick: bool) -> Iterator[Row]:
    """Admissible stresses between the solution and those of less friction, disturbed at random.

    None of their errors may be above its bound.
    """
    *_, result = _chain(element, 0.2, 2)
    fine = replace(element, degree=_FINE).solve(result.problem)
    weaker = [element.solve(_with_friction(result.problem, friction)).solution.z for friction in _WEAKER]
    random, ratios = np.random.default_rng(1), []
    for number in range(_BAD // 10 if quick else _BAD):
        stress = _disturbed(result, weaker[number % len(weaker)], random)
        ratios.append(_coulomb(stress).error / energy_apart(stress, fine))
    proof = both(certified(result, fine), _guaranteed(_coulomb(result)))
    quantity = f"least {_ERROR} of {len(ratios)} bad stresses"
    yield at_least(quantity, float(np.min(ratios)), 1.0, 0.0, f"{_BELOW}; {_TRUTH}", proof, Kind.METHODS)


def _disturbed(result: ContactResult, weaker: FloatArray, random: np.random.Generator) -> ContactResult:
    """The same result with an admissible stress that is not a solution."""
    qvi, own = result.discretization.qvi, result.solution.z

    def inside(z: FloatArray) -> bool:
        normal, shear = qvi.N @ z + qvi.n0, qvi.T @ z + qvi.t0
        return bool(normal.max() <= 0.0 and (np.abs(shear) + qvi.mu * normal).max() <= 0.0)

    step = random.standard_normal(len(weaker)) * np.abs(weaker).max() * 10.0 ** random.uniform(-4.0, 0.0)
    while not inside(weaker + step):
        step *= 0.5
    share = random.uniform(0.0, 1.0) ** 3
    return ContactResult(result.discretization, replace(result.solution, z=own + share * (weaker + step - own)))


def _with_friction(problem: ContactProblem, friction: float) -> ContactProblem:
    conditions = [
        replace(each, friction=friction) if isinstance(each, Contact) else each for each in problem.conditions
    ]
    return replace(problem, conditions=conditions)


@PROBLEMS.on("bounds-slip-bodies", TRIANGLES)
def bodies_under_slip(element: Element, quick: bool) -> Iterator[Row]:
    """Other bodies: forces known from elsewhere must be inside their bounds.

    Of SSNV128 balance gives the normal force, p a. The others are compared with displacement elements of degree 4 on a
    mesh twice as fine.
    """
    cells = (4, 4) if quick else (12, 12)
    for friction, kind in ((0.3, "guaranteed"), (1.0, "estimated")):
        result = element.solve(ssnv128(cells, friction=friction))
        name, proof, bounds = f"SSNV128, μ = {friction:g}", certified(result), _coulomb(result)
        yield word(f"{name}: the bounds are", bounds.kind, kind, _PROVED, proof)
        force, source = bounds.forces["base.normal_force"], "p a, balance in y"
        yield from enclosed(f"{name}: N [N/m], {{}}", force, 2.0e6, 1e-9 * 2.0e6, source, proof)
    for name, (body, kind) in list(_BODIES.items())[: 1 if quick else None]:
        problem = body()
        problem = problem if quick else replace(problem, mesh=halved(problem.mesh))
        result = element.solve(problem)
        moved = solve_companion(replace(problem, mesh=halved(problem.mesh)), degree=4)
        proof, bounds = certified(result), _coulomb(result)
        yield word(f"{name}: the bounds are", bounds.kind, kind, _PROVED, proof)
        ((contact, line),) = moved.contacts.items()
        for letter, force_name, known in (
            ("N", "normal_force", line.normal_force),
            ("T", "tangential_force", line.tangential_force),
        ):
            quantity, force = f"{name}: {letter} [stress × length], {{}}", bounds.forces[f"{contact}.{force_name}"]
            yield from enclosed(quantity, force, known, 1e-3 * abs(known), _FINER, proof, Kind.METHODS)


_FINER: Final = "displacement elements, finer mesh"
_PROVED: Final = "whether the norm of the friction operator is proved below 2"
_BODIES: Final[dict[str, tuple[Callable[[], ContactProblem], str]]] = {
    "two half discs, μ = 0.1": (partial(half_discs, 0.1, below=500.0), "guaranteed"),
    "two half discs, μ = 0.3": (partial(half_discs, 0.3, below=500.0), "estimated"),
    "half disc, μ = 0.1": (partial(half_disc, 0.1, (6e-3, -2e-3)), "guaranteed"),
    "half disc, μ = 0.3": (partial(half_disc, 0.3, (6e-3, -2e-3)), "estimated"),
    "sheared layer that slips": (partial(sheared_layer, 0.3), "estimated"),
    "sheared layer that sticks": (partial(sheared_layer, 0.5, 1e-3), "estimated"),
}
"""Bodies, and what their bounds are."""


def _coulomb(result: ContactResult) -> CoulombBounds:
    found = result.bracket.coulomb
    assert found is not None, result.bracket.coulomb_reason
    return found


def _guaranteed(bounds: CoulombBounds) -> Proof:
    return by_hand(bounds.guaranteed, " ".join(bounds.reasons) or "guaranteed bound")
