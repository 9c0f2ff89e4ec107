"""Chapter on loads that cannot be carried: limit loads, proofs of infeasibility, refusals."""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.exhibits import MM, Curve, Graph, shown
from comparisons.verification.proof import bounded, by_hand, certified, infeasible
from comparisons.verification.row import Row, absolute, at_most, relative, word
from comparisons.verification.two_models import curves_of_both, two_models
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
from qvi_contact.problem.conditions import Condition

PROBLEMS: Final = Chapter()

_STEEL: Final = Material(1000.0, 0.3)
_MESHES: Final = {
    "6 × 4 cells": TriangleMesh.rectangle((6, 4), 2.0, 1.0),
    "one cell": TriangleMesh.rectangle((1, 1), 2.0, 1.0),
    "5 × 5 cells graded by 0.5": TriangleMesh.rectangle((5, 5), 2.0, 1.0, grading=0.5),
}
_PRESSURE, _SHEAR, _FRICTION = 10.0, 2.0, 0.3


@PROBLEMS.on("dragged-block", TRIANGLES)
def dragged_block(element: Element, quick: bool) -> Iterator[Row]:
    """A block under pressure p dragged by uniform shear T: carried up to the factor μp/T, and not beyond."""
    for name, mesh in list(_MESHES.items())[: 1 if quick else 3]:
        base = Contact("bottom", _FRICTION, name="base")
        limit = element.limit_load(_dragged(mesh, _SHEAR, base), ["shear"])
        yield relative("limit load factor", limit.lower, 1.5, 1e-6, f"μp/T; {name}", bounded(limit))
        below, above = (element.solve(_dragged(mesh, share * 3.0, base)) for share in (0.99, 1.01))
        exact, source = -0.99 * 6.0, f"−0.99 μ p w, balance; {name}"
        force, proof = below.contacts["base"].tangential_force, certified(below)
        yield relative("T at 0.99 of the limit [stress length]", force, exact, 1e-8, source, proof)
        source = f"T > μp; {name}"
        yield word("status at 1.01 of the limit", above.status.value, "infeasible", source, infeasible(above))


@PROBLEMS.on("other-laws", TRIANGLES)
def other_laws(element: Element, quick: bool) -> Iterator[Row]:
    """The same block with cohesion, a cap and Tresca's law: the factor is the bound of shear over T."""
    mesh = _MESHES["6 × 4 cells" if quick else "5 × 5 cells graded by 0.5"]
    laws = {
        "cohesion: (c + μp)/T": (Contact("bottom", 0.3, cohesion=1.5), 4.5),
        "cohesion and cap: t_max/T": (Contact("bottom", 0.3, cohesion=1.5, shear_limit=4.0), 4.0),
        "Tresca: bound/T": (Contact.tresca("bottom", 2.0), 2.0),
    }
    for source, (law, exact) in laws.items():
        limit = element.limit_load(_dragged(mesh, 1.0, law), ["shear"])
        yield relative("limit load factor", limit.lower, exact, 1e-6, source, bounded(limit))


@PROBLEMS.on("uplift", TRIANGLES)
def uplift(element: Element, _: bool) -> Iterator[Row]:
    """Gravity dam: a block of weight W, pushed by H, with water of uplift U in its base. It slides at μ (W − U) / H."""
    weight, push, lift = 12.0, 1.5, 4.5
    mesh = TriangleMesh.rectangle((6, 2), 3.0, 1.0)
    water = Contact("bottom", 0.4, pore_pressure=Expression("3 * (1 - x / 3)"), name="base")
    sides: list[Condition] = [Traction("left", push, 0.0, name="lake"), Traction("right", 0.0, 0.0)]
    conditions = [*sides, Traction("top", 0.0, 0.0), water]
    dam = ContactProblem(mesh, _STEEL, conditions, body_potential=Expression("4 * y"))
    limit, exact = element.limit_load(dam, ["lake"]), 0.4 * (weight - lift) / push
    yield relative("factor of sliding", limit.lower, exact, 1e-6, "μ (W − U) / H", bounded(limit))
    result = element.solve(dam)
    force, proof = result.contacts["base"].effective_normal_force, certified(result)
    yield relative("effective N [stress length]", force, weight - lift, 1e-8, "W − U, balance", proof)


@PROBLEMS.on("near-the-limit", TRIANGLES)
def monotonic_resistance(element: Element, quick: bool) -> Iterator[Row]:
    """Just below the limit the base still carries what balance asks for, and the friction law holds."""
    for share in (0.999,) if quick else (0.9, 0.999, 0.99999):
        result = element.solve(_dragged(_MESHES["6 × 4 cells"], 3.0 * share, Contact("bottom", _FRICTION, name="base")))
        base, proof = result.contacts["base"], certified(result)
        excess = float((np.abs(base.tangential_stress) - base.friction_bound).max()) / _PRESSURE
        source = f"|σ_T| ≤ μ|σ_N| at the Gauss points, {share:g} of the limit"
        yield at_most("largest |σ_T| − bound over p", excess, 0.0, 1e-7, source, proof)
        source = f"p w, balance, {share:g} of the limit"
        yield absolute("N [stress length]", base.normal_force, 20.0, 1e-8, source, proof)


@PROBLEMS.on("tension", TRIANGLES)
def tension(element: Element, _: bool) -> Iterator[Row]:
    """Tension on top: lifted when it equals the weight, and infeasible without weight."""
    mesh = _MESHES["6 × 4 cells"]
    heavy = _lifted(mesh, 7.0)
    limit = element.limit_load(heavy, ["crane"])
    yield relative("limit load factor", limit.lower, 7.0, 1e-6, "ρ g h over the tension", bounded(limit))
    light = element.solve(_lifted(mesh, 0.0))
    source = "∫σ_N ds > 0 contradicts σ_N ≤ 0"
    yield word("status under tension", light.status.value, "infeasible", source, infeasible(light))
    result, weight = element.solve(heavy), (7.0 - 1.0) * 2.0
    source, force = "(ρ g h − t) w, balance", result.contacts["floor"].normal_force
    yield relative("N below the limit [stress length]", force, weight, 1e-9, source, certified(result))


@PROBLEMS.on("tipping", TRIANGLES)
def tipping(element: Element, quick: bool) -> Iterator[Row]:
    """A tall block pushed sideways on its top tips at the factor p w²/(2 h H), which a mesh reaches from below."""
    exact = 4.0 / 2.0 / 3.0
    for cells in (8,) if quick else (8, 16):
        mesh = TriangleMesh.rectangle((cells, 4), 1.0, 3.0)
        limit = element.limit_load(_tall(mesh), ["push"])
        yield at_most("limit load factor", limit.lower, exact, 1e-9, f"p w²/(2 h H), {cells} × 4 cells", bounded(limit))
        p = element.degree  # the pressure may grow as t^(p − 2) over the last edge: N acts 1/p of it inside
        reached = exact * (1.0 - 2.0 / (p * cells))
        source = f"p w (w/2 − w/({p} · {cells}))/(h H), {cells} × 4 cells: pressure on the last edge of degree {p - 2}"
        yield relative("limit load factor", limit.lower, reached, 1e-6, source, bounded(limit))
        source = f"p w²/(2 h H), {cells} × 4 cells; rigid block about its edge"
        yield relative("limit of the body", limit.upper, exact, 1e-9, source, bounded(limit))


@PROBLEMS.on("tipping-wall", TRIANGLES, QUINTIC)
def tipping_wall(element: Element, quick: bool) -> Iterator[Row]:
    """A wall 1 × 4 of the weight W = 25 under wind tips at H = W w/h, on triangles bisected towards its toe."""
    for bisections in (8,) if quick else (1, 8, 16):
        mesh = TriangleMesh.rectangle((1, 2), 1.0, 4.0).graded([[1.0, 0.0]], bisections)
        limit = element.limit_load(_wall(mesh), ["wind"])
        least = float(mesh.edges("bottom").length.min())
        source = f"W w/h; {bisections} bisections at the toe"
        yield relative("limit load of the body", limit.upper, 6.25, 1e-9, f"{source}, rigid block", bounded(limit))
        yield at_most("limit load of the mesh", limit.lower, 6.25, 1e-9, source, bounded(limit))
        reached = 6.25 * (1.0 - 2.0 * least / element.degree)
        source = f"W (w − 2 e)/h, e: 1/{element.degree} of the last edge; {bisections} bisections"
        yield relative("limit load of the mesh", limit.lower, reached, 1e-6, source, bounded(limit))


@PROBLEMS.on("wedge", TRIANGLES, QUINTIC)
def wedge(element: Element, quick: bool) -> Iterator[Row]:
    """A block of weight G on a plane that rises by tan α = 0.1, pushed uphill: F/G = (tan α + μ)/(1 − μ tan α)."""
    for friction in (0.2,) if quick else (0.0, 0.1, 0.2, 0.3):
        limit = element.limit_load(on_a_slope(friction), ["F"])
        exact, source = slope_factor(friction), f"NAFEMS CGS-4; μ = {friction:g}"
        for quantity, ours, tolerance in (
            ("F/G that the mesh carries", limit.lower, 1e-6),
            ("F/G that the body carries", limit.upper, 1e-9),
        ):
            yield relative(quantity, ours, exact, tolerance, source, bounded(limit))
    push = 0.99 * slope_factor(0.2)
    result = element.solve(on_a_slope(0.2, push))
    plane, proof, source = result.contacts["bottom"], certified(result), "balance; 0.99 of F, μ = 0.2"
    slant = math.hypot(1.0, 0.1)
    normal, shear = (1.0 + 0.1 * push) / slant, (push - 0.1) / slant
    yield relative("N/G at 0.99 of F", plane.normal_force, normal, 1e-9, source, proof)
    yield relative("|T|/G at 0.99 of F", abs(plane.tangential_force), shear, 1e-9, source, proof)
    yield from two_models(quick, result, "bottom", 1e-9, 1e-2)


@shown("wedge", lambda: on_a_slope(0.2))
def _wedge_graph(quick: bool) -> Graph:
    """The force that pushes the block uphill, over friction: both bounds lie on the formula."""
    frictions, fine = np.array([0.0, 0.2] if quick else [0.0, 0.1, 0.2, 0.3]), np.linspace(0.0, 0.3)
    limits = [TRIANGLES.limit_load(on_a_slope(float(friction)), ["F"]) for friction in frictions]
    ours = (
        Curve("F/G that the mesh carries", frictions, np.array([limit.lower for limit in limits])),
        Curve("F/G that a mechanism allows", frictions, np.array([limit.upper for limit in limits])),
    )
    known = Curve("(tan α + μ)/(1 − μ tan α)", fine, np.array([slope_factor(float(friction)) for friction in fine]))
    return Graph("coefficient of friction μ [-]", "F/G [-]", ours, (known,))


@PROBLEMS.on("oblique-block", TRIANGLES, QUINTIC)
def oblique_block(element: Element, quick: bool) -> Iterator[Row]:
    """A block 40 × 20 on a plane tilted by 30°, pressed by 300: a shear of 99 % of μN holds, one of 101 % slides."""
    holds, slides = (element.solve(oblique(share)) for share in (0.99, 1.01))
    plane, proof, source = holds.contacts["plane"], certified(holds), "SSNV503: balance"
    yield relative("N [N/mm]", plane.normal_force, 12000.0, 1e-8, source, proof)
    yield relative("|T| at 99 % [N/mm]", abs(plane.tangential_force), 3564.0, 1e-8, source, proof)
    status, proof = slides.status.value, infeasible(slides)
    yield word("status at 101 %", status, "infeasible", "SSNV503: T > μN", proof)
    limit = element.limit_load(oblique(0.5), ["drag"])
    for quantity, ours in (("mesh", limit.lower), ("body", limit.upper)):
        yield relative(f"factor that the {quantity} carries", ours, 2.0, 1e-6, "μN over half of it", bounded(limit))
    yield from two_models(quick, holds, "plane", 1e-9, 1e-3)


@shown("oblique-block", lambda: oblique(0.99), MM)
def _oblique_graph(_: bool) -> Graph:
    """At 99 % of the friction force the shear is just below its bound."""
    values = {"bound μp": lambda line: line.friction_bound, "shear": lambda line: np.abs(line.tangential_stress)}
    curves = curves_of_both(oblique(0.99), "plane", lambda line: np.hypot(line.x, line.y), values)
    return Graph("length along the plane [mm]", "traction [MPa]", *curves)


@PROBLEMS.named("unbalanced")
def unbalanced(_: bool) -> Iterator[Row]:
    """Tractions all around that do not balance: refused before anything is solved."""
    mesh = _MESHES["one cell"]
    lengths = {"bottom": 2.0, "left": 1.0, "right": 1.0, "top": 2.0}
    loads = {"bottom": 0.0, "left": 0.0, "right": 0.0, "top": -1.0}
    problem = ContactProblem(mesh, _STEEL, [Traction(side, 0.0, load) for side, load in loads.items()])
    resultant = sum(lengths[side] * load for side, load in loads.items())
    try:
        outcome = solve(problem).status.value
    except InputError as error:
        outcome = "refused: out of balance" if "out of balance" in str(error) else str(error)
    proof = by_hand(resultant != 0.0, f"resultant (0, {resultant:g})")
    yield word("outcome", outcome, "refused: out of balance", "balance of forces", proof)


def _dragged(mesh: TriangleMesh, shear: float, contact: Contact) -> ContactProblem:
    """Pressure on top, and uniform shear with its complement on the sides."""
    top = [Traction("top", y=-_PRESSURE, name="pressure"), Traction("top", x=shear, name="shear")]
    right = [Traction("right", x=0.0), Traction("right", y=shear, name="shear")]
    left = [Traction("left", x=0.0), Traction("left", y=-shear, name="shear")]
    return ContactProblem(mesh, _STEEL, [contact, *top, *right, *left])


def _lifted(mesh: TriangleMesh, weight: float) -> ContactProblem:
    crane, floor = Traction("top", x=0.0, y=1.0, name="crane"), Contact("bottom", 0.0, name="floor")
    sides: list[Condition] = [Symmetry("left"), Traction("right", 0.0, 0.0)]
    return ContactProblem(mesh, _STEEL, [floor, crane, *sides], body_potential=lambda _, y: weight * y)


def _tall(mesh: TriangleMesh) -> ContactProblem:
    """Pressure 4 on a width of 1, a parabola of shear with the resultant 1 at the height 3."""
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    loads = [Traction("top", y=-4.0), Traction("top", x=_parabola, name="push")]
    return ContactProblem(mesh, _STEEL, [Contact("bottom", 1e3, name="base"), *loads, *sides])


def _wall(mesh: TriangleMesh) -> ContactProblem:
    """Of the width 1, the height 4 and the weight 25, blown from the left by a unit force."""
    loads = [Traction("left", 0.25, 0.0, name="wind"), *(Traction(side, 0.0, 0.0) for side in ("top", "right"))]
    base, weight = Contact("bottom", 1e3, name="base"), Expression("25 / 4 * y")
    return ContactProblem(mesh, _STEEL, [base, *loads], body_potential=weight)


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


def _parabola(x: FloatArray, y: FloatArray) -> FloatArray:
    return 6.0 * x * (1.0 - x) + 0.0 * y
