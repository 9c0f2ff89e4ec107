"""Chapters on loads that cannot be carried (limits, proofs of infeasibility, refusals), and on three solutions."""

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from comparisons.convergence.bodies import STATES, three_solutions
from comparisons.verification.measures import two_models
from comparisons.verification.rows import Chapter, Check, Row, bounded, by_hand, certified, infeasible
from qvi_contact import (
    Contact,
    ContactProblem,
    Expression,
    InputError,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
    solve,
)
from qvi_contact.basics.checks import FloatArray
from qvi_contact.limit.load_factor import LimitLoad, limit_load
from qvi_contact.problem.conditions import Condition
from solvers import Certificate, certify, solve_qvi

LIMITS, NOT_UNIQUE = Chapter(), Chapter()

_STEEL: Final = Material(1000.0, 0.3)
_MESHES: Final = {
    "6 × 4 cells": TriangleMesh.rectangle((6, 4), 2.0, 1.0),
    "one cell": TriangleMesh.rectangle((1, 1), 2.0, 1.0),
    "5 × 5 cells graded by 0.5": TriangleMesh.rectangle((5, 5), 2.0, 1.0, grading=0.5),
}
_BASE: Final = Contact("bottom", 0.3, name="base")


def _dragged(mesh: TriangleMesh, shear: float, contact: Contact = _BASE) -> ContactProblem:
    """Pressure p = 10 on top, and uniform shear with its complement on the sides."""
    loads = [
        Traction("top", y=-10.0, name="pressure"), Traction("top", x=shear, name="shear"), Traction("right", x=0.0),
        Traction("right", y=shear, name="shear"), Traction("left", x=0.0), Traction("left", y=-shear, name="shear"),
    ]  # fmt: skip
    return ContactProblem(mesh, _STEEL, [contact, *loads])


def _factor(p: int, problem: ContactProblem, load: str) -> tuple[LimitLoad, Check]:
    limit = limit_load(problem, [load], degree=p)
    return limit, Check(bounded(limit), tolerance=1e-6)


@LIMITS("dragged-block", 4)
def dragged_block(p: int, quick: bool) -> Iterator[Row]:
    """A block under pressure p dragged by uniform shear T: carried up to the factor μp/T, and not beyond."""
    for name, mesh in list(_MESHES.items())[: 1 if quick else 3]:
        limit, rows = _factor(p, _dragged(mesh, 2.0), "shear")
        yield rows.relative("limit load factor", limit.lower, 1.5, f"μp/T; {name}")
        below, above = (solve(_dragged(mesh, share * 3.0), degree=p) for share in (0.99, 1.01))
        rows, force = (
            Check(certified(below), f"−0.99 μ p w, balance; {name}", 1e-8),
            below.contacts["base"].tangential_force,
        )
        yield rows.relative("T at 0.99 of the limit [stress length]", force, -0.99 * 6.0)
        rows = Check(infeasible(above), f"T > μp; {name}")
        yield rows.word("status at 1.01 of the limit", above.status.value, "infeasible")


@LIMITS("other-laws", 4)
def other_laws(p: int, quick: bool) -> Iterator[Row]:
    """The same block with cohesion, a cap and Tresca's law: the factor is the bound of shear over T."""
    mesh = _MESHES["6 × 4 cells" if quick else "5 × 5 cells graded by 0.5"]
    laws = {
        "cohesion: (c + μp)/T": (Contact("bottom", 0.3, cohesion=1.5), 4.5),
        "cohesion and cap: t_max/T": (Contact("bottom", 0.3, cohesion=1.5, shear_limit=4.0), 4.0),
        "Tresca: bound/T": (Contact.tresca("bottom", 2.0), 2.0),
    }
    for source, (law, exact) in laws.items():
        limit, rows = _factor(p, _dragged(mesh, 1.0, law), "shear")
        yield rows.relative("limit load factor", limit.lower, exact, source)


@LIMITS("uplift", 4)
def uplift(p: int, _: bool) -> Iterator[Row]:
    """Gravity dam: a block of weight W, pushed by H, with water of uplift U in its base. It slides at μ (W − U) / H."""
    weight, push, lift = 12.0, 1.5, 4.5
    water = Contact("bottom", 0.4, pore_pressure=Expression("3 * (1 - x / 3)"), name="base")
    conditions: list[Condition] = [
        Traction("left", push, 0.0, name="lake"), Traction("right", 0.0, 0.0), Traction("top", 0.0, 0.0), water,
    ]  # fmt: skip
    mesh, gravity = TriangleMesh.rectangle((6, 2), 3.0, 1.0), Expression("4 * y")
    dam = ContactProblem(mesh, _STEEL, conditions, body_potential=gravity)
    limit, rows = _factor(p, dam, "lake")
    yield rows.relative("factor of sliding", limit.lower, 0.4 * (weight - lift) / push, "μ (W − U) / H")
    result = solve(dam, degree=p)
    force = result.contacts["base"].effective_normal_force
    rows = Check(certified(result), "W − U, balance", 1e-8)
    yield rows.relative("effective N [stress length]", force, weight - lift)


@LIMITS("near-the-limit", 4)
def monotonic_resistance(p: int, quick: bool) -> Iterator[Row]:
    """Just below the limit the base still carries what balance asks for, and the friction law holds."""
    for share in (0.999,) if quick else (0.9, 0.999, 0.99999):
        result = solve(_dragged(_MESHES["6 × 4 cells"], 3.0 * share), degree=p)
        base, rows = result.contacts["base"], Check(certified(result))
        excess = float((np.abs(base.tangential_stress) - base.friction_bound).max()) / 10.0
        source = f"|σ_T| ≤ μ|σ_N| at the Gauss points, {share:g} of the limit"
        yield rows.at_most("largest |σ_T| − bound over p", excess, 0.0, source, tolerance=1e-7)
        source = f"p w, balance, {share:g} of the limit"
        yield rows.absolute("N [stress length]", base.normal_force, 20.0, source, tolerance=1e-8)


@LIMITS("tension", 4)
def tension(p: int, _: bool) -> Iterator[Row]:
    """Tension on top: lifted when it equals the weight, and infeasible without weight."""

    def lifted(weight: float) -> ContactProblem:
        crane, floor = Traction("top", x=0.0, y=1.0, name="crane"), Contact("bottom", 0.0, name="floor")
        conditions: list[Condition] = [floor, crane, Symmetry("left"), Traction("right", 0.0, 0.0)]
        return ContactProblem(_MESHES["6 × 4 cells"], _STEEL, conditions, body_potential=lambda _, y: weight * y)

    heavy = lifted(7.0)
    limit, rows = _factor(p, heavy, "crane")
    yield rows.relative("limit load factor", limit.lower, 7.0, "ρ g h over the tension")
    light = solve(lifted(0.0), degree=p)
    rows = Check(infeasible(light), "∫σ_N ds > 0 contradicts σ_N ≤ 0")
    yield rows.word("status under tension", light.status.value, "infeasible")
    result = solve(heavy, degree=p)
    rows, force = Check(certified(result), "(ρ g h − t) w, balance", 1e-9), result.contacts["floor"].normal_force
    yield rows.relative("N below the limit [stress length]", force, (7.0 - 1.0) * 2.0)


@LIMITS("tipping", 4)
def tipping(p: int, quick: bool) -> Iterator[Row]:
    """A tall block pushed sideways on its top tips at the factor p w²/(2 h H), which a mesh reaches from below."""
    # pressure 4 on a width of 1, a parabola of shear with the resultant 1 at the height 3
    loads = [Traction("top", y=-4.0), Traction("top", x=lambda x, _: 6.0 * x * (1.0 - x), name="push")]
    sides, exact = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)], 4.0 / 2.0 / 3.0
    for cells in (8,) if quick else (8, 16):
        mesh = TriangleMesh.rectangle((cells, 4), 1.0, 3.0)
        tall = ContactProblem(mesh, _STEEL, [Contact("bottom", 1e3, name="base"), *loads, *sides])
        limit, rows = _factor(p, tall, "push")
        where = f"p w²/(2 h H), {cells} × 4 cells"
        yield rows.at_most("limit load factor", limit.lower, exact, where, tolerance=1e-9)
        # the pressure may grow as t^(p − 2) over the last edge: N acts 1/p of it inside
        source = f"p w (w/2 − w/({p} · {cells}))/(h H), {cells} × 4 cells: pressure on the last edge of degree {p - 2}"
        yield rows.relative("limit load factor", limit.lower, exact * (1.0 - 2.0 / (p * cells)), source)
        yield rows.relative(
            "limit of the body", limit.upper, exact, f"{where}; rigid block about its edge", tolerance=1e-9
        )


@LIMITS("tipping-wall", 4, 5)
def tipping_wall(p: int, quick: bool) -> Iterator[Row]:
    """A wall 1 × 4 of the weight W = 25 under wind tips at H = W w/h, on triangles bisected towards its toe."""
    free = [Traction(side, 0.0, 0.0) for side in ("top", "right")]
    loads: list[Condition] = [Contact("bottom", 1e3, name="base"), Traction("left", 0.25, 0.0, name="wind"), *free]
    for bisections in (8,) if quick else (1, 8, 16):
        mesh = TriangleMesh.rectangle((1, 2), 1.0, 4.0).graded([[1.0, 0.0]], bisections)
        limit, rows = _factor(p, ContactProblem(mesh, _STEEL, loads, body_potential=Expression("25 / 4 * y")), "wind")
        source = f"W w/h; {bisections} bisections at the toe"
        yield rows.relative("limit load of the body", limit.upper, 6.25, f"{source}, rigid block", tolerance=1e-9)
        yield rows.at_most("limit load of the mesh", limit.lower, 6.25, source, tolerance=1e-9)
        reached = 6.25 * (1.0 - 2.0 * float(mesh.edges("bottom").length.min()) / p)
        source = f"W (w − 2 e)/h, e: 1/{p} of the last edge; {bisections} bisections"
        yield rows.relative("limit load of the mesh", limit.lower, reached, source)


@LIMITS("wedge", 4, 5)
def wedge(p: int, quick: bool) -> Iterator[Row]:
    """A block of weight G on a plane that rises by tan α = 0.1, pushed uphill: F/G = (tan α + μ)/(1 − μ tan α)."""
    for friction in (0.2,) if quick else (0.0, 0.1, 0.2, 0.3):
        limit, rows = _factor(p, on_a_slope(friction), "F")
        exact, source = slope_factor(friction), f"NAFEMS CGS-4; μ = {friction:g}"
        yield rows.relative("F/G that the mesh carries", limit.lower, exact, source)
        yield rows.relative("F/G that the body carries", limit.upper, exact, source, tolerance=1e-9)
    push, slant = 0.99 * slope_factor(0.2), math.hypot(1.0, 0.1)
    result = solve(on_a_slope(0.2, push), degree=p)
    plane, rows = result.contacts["bottom"], Check(certified(result), "balance; 0.99 of F, μ = 0.2", 1e-9)
    yield rows.relative("N/G at 0.99 of F", plane.normal_force, (1.0 + 0.1 * push) / slant)
    yield rows.relative("|T|/G at 0.99 of F", abs(plane.tangential_force), (push - 0.1) / slant)
    yield from two_models(quick, result, "bottom", 1e-9, 1e-2)


@LIMITS("oblique-block", 4, 5)
def oblique_block(p: int, quick: bool) -> Iterator[Row]:
    """A block 40 × 20 on a plane tilted by 30°, pressed by 300: a shear of 99 % of μN holds, one of 101 % slides."""
    holds, slides = (solve(oblique(share), degree=p) for share in (0.99, 1.01))
    plane, rows = holds.contacts["plane"], Check(certified(holds), "SSNV503: balance", 1e-8)
    yield rows.relative("N [N/mm]", plane.normal_force, 12000.0)
    yield rows.relative("|T| at 99 % [N/mm]", abs(plane.tangential_force), 3564.0)
    yield Check(infeasible(slides), "SSNV503: T > μN").word("status at 101 %", slides.status.value, "infeasible")
    limit, rows = _factor(p, oblique(0.5), "drag")
    for quantity, ours in (("mesh", limit.lower), ("body", limit.upper)):
        yield rows.relative(f"factor that the {quantity} carries", ours, 2.0, "μN over half of it")
    yield from two_models(quick, holds, "plane", 1e-9, 1e-3)


@LIMITS("unbalanced")
def unbalanced(_: bool) -> Iterator[Row]:
    """Tractions all around that do not balance: refused before anything is solved."""
    lengths = {"bottom": 2.0, "left": 1.0, "right": 1.0, "top": 2.0}
    loads = {"bottom": 0.0, "left": 0.0, "right": 0.0, "top": -1.0}
    tractions = [Traction(side, 0.0, load) for side, load in loads.items()]
    resultant = sum(lengths[side] * load for side, load in loads.items())
    try:
        outcome = solve(ContactProblem(_MESHES["one cell"], _STEEL, tractions)).status.value
    except InputError as error:
        outcome = "refused: out of balance" if "out of balance" in str(error) else str(error)
    rows = Check(by_hand(resultant != 0.0, f"resultant (0, {resultant:g})"), "balance of forces")
    yield rows.word("outcome", outcome, "refused: out of balance")


def slope_factor(friction: float) -> float:
    """F/G at which the block on the slope slides: (tan α + μ)/(1 − μ tan α), tan α = 0.1."""
    return (0.1 + friction) / (1.0 - 0.1 * friction)


def on_a_slope(friction: float, push: float = 1.0) -> ContactProblem:
    """A block 6 × 1, sheared to the slope of its base: G = 1 spread over the top, F over the left side."""
    mesh = _moved(TriangleMesh.rectangle((3, 1), 6.0, 1.0), np.array([[1.0, 0.0], [0.1, 1.0]]))
    weight = Traction("top", 0.0, -1.0 / math.hypot(6.0, 0.6))
    sides = [Traction("left", push, 0.0, name="F"), Traction("right", 0.0, 0.0)]
    return ContactProblem(mesh, _STEEL, [Contact("bottom", friction), weight, *sides])


def oblique(share: float) -> ContactProblem:
    """Uniform pressure and this share of the shear that friction carries, all around the block."""
    cosine, sine = math.sqrt(0.75), 0.5
    mesh = _moved(TriangleMesh.rectangle((4, 2), 40.0, 20.0), np.array([[cosine, -sine], [sine, cosine]]))
    shear, pressure = share * 0.3 * 300.0, Traction("top", normal=-300.0)
    drag = [
        Traction(side, tangential=sign * shear, name="drag")
        for side, sign in (("top", 1.0), ("right", -1.0), ("left", 1.0))
    ]
    free = [Traction(side, normal=0.0) for side in ("right", "left")]
    return ContactProblem(mesh, _STEEL, [Contact("bottom", 0.3, name="plane"), pressure, *drag, *free])


def _moved(mesh: TriangleMesh, matrix: FloatArray) -> TriangleMesh:
    """The mesh with its points x at A x."""
    return TriangleMesh(mesh.vertices @ matrix.T, mesh.cells, mesh.edge_sets)


_MU: Final = 2.0  # of the contact point that has three solutions

_METHODS: Final[dict[str, dict[str, Any]]] = {
    "condensed": {"method": "condensed"},
    "fixed point from 0": {"method": "fixed-point", "initial": np.zeros(1)},
    "fixed point from 1.7": {"method": "fixed-point", "initial": np.array([1.7])},
    "fixed point from 10": {"method": "fixed-point", "initial": np.array([10.0])},
    "Uzawa": {"method": "uzawa"},
}


@NOT_UNIQUE("three-states")
def all_three(_: bool) -> Iterator[Row]:
    """The certificate passes for each of the three states by hand."""
    for name, r in STATES.items():
        certificate = _certificate(np.array(r))
        source = f"{name}: u = W r + q, W = [[1, .8], [.8, 1]], q = (1, 2.1), μ = 2"
        rows = Check(by_hand(certificate.passed, "certificate"), source, 1e-12)
        yield rows.absolute(f"accuracy of the certificate, {name}", certificate.accuracy, 0.0)


@NOT_UNIQUE("nothing-else")
def nothing_else(quick: bool) -> Iterator[Row]:
    """Points between and beside them obey no contact law, and the certificate fails."""
    states = {name: np.array(r) for name, r in STATES.items()}
    wrong = {
        "half-way from stick to slip": (states["stick"] + states["slip"]) / 2,
        "half-way from open to slip": (states["open"] + states["slip"]) / 2,
        "slip moved by 1e-5": states["slip"] * (1 + 1e-5),
        "stick with the shear turned round": states["stick"] * [1, -1],
    }
    for name, r in list(wrong.items())[: 2 if quick else None]:
        violation = law_violation(r)
        rows = Check(by_hand(violation > 1e-6, f"law violated by {violation:.0e}"), "contact law by hand")
        yield rows.word(f"certificate, {name}", "passes" if _certificate(r).passed else "fails", "fails")


@NOT_UNIQUE("three-methods")
def methods(quick: bool) -> Iterator[Row]:
    """Every method returns one of the three and certifies it; none claims that it is the only one."""
    for name, options in list(_METHODS.items())[: 2 if quick else None]:
        solution = solve_qvi(three_solutions(_MU), tolerance=1e-9, **options)
        distances = {state: float(np.abs(solution.z - np.array(r)).max()) for state, r in STATES.items()}
        nearest = min(distances, key=distances.__getitem__)
        rows = Check(certified(solution), f"{name}: the nearest is {nearest}", 1e-7)
        yield rows.absolute("distance to the nearest of the three", distances[nearest], 0.0)


def _certificate(r: FloatArray) -> Certificate:
    """With the multipliers that make r stationary: m_N = u_N, m_T = −u_T of u = W r + q."""
    qvi = three_solutions(_MU)
    gap, slip = qvi.K @ r - qvi.f
    return certify(qvi, r, np.array([gap]), np.array([-slip]), tolerance=1e-9)


def law_violation(r: FloatArray) -> float:
    """Largest violation of the contact law at r: of p ≥ 0, gap ≥ 0, p gap = 0, |t| ≤ μp, and of t against the slip."""
    qvi, (p, t) = three_solutions(_MU), r
    gap, slip = qvi.K @ r - qvi.f
    free = max(_MU * p - abs(t), 0.0)
    return float(max(-p, -gap, abs(p * gap), abs(t) - _MU * p, min(free, abs(slip)), t * slip))
