"""Chapter on loads that cannot be carried: limits, proofs of infeasibility, refusals."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from comparisons.verification.measures import two_models
from comparisons.verification.rows import Chapter, Check, Row, bounded, by_hand, certified, infeasible
from qvi_contact import InputError, TriangleMesh, solve
from qvi_contact.limit.load_factor import LimitLoad, limit_load_factor
from qvi_contact.problem import Contact, ContactProblem, Expression, Material, Symmetry, Traction
from qvi_contact.types import Condition

LIMITS: Final = Chapter()

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
    limit = limit_load_factor(problem, [load], degree=p)
    return limit, Check(bounded(limit), tolerance=1e-6)


@LIMITS("dragged-block", 4)
def dragged_block(p: int, quick: bool) -> Iterator[Row]:
    """A block under pressure p dragged by uniform shear T: carried up to the factor μp/T, and not beyond."""
    for name, mesh in list(_MESHES.items())[: 1 if quick else 3]:
        limit, rows = _factor(p, _dragged(mesh, 2.0), "shear")
        yield rows.relative("limit load factor", limit.lower, 1.5, f"μp/T; {name}")
        below, above = (solve(_dragged(mesh, share * 3.0), degree=p) for share in (0.99, 1.01))
        rows, force = Check(certified(below), tolerance=1e-8), below.contacts["base"].tangential_force
        source = f"−0.99 μ p w, balance; {name}"
        yield rows.relative("T at 0.99 of the limit [stress length]", force, -0.99 * 6.0, source)
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


@LIMITS("tipping-wall", 4, 5)
def tipping_wall(p: int, quick: bool) -> Iterator[Row]:
    """A wall 1 × 4 of the weight W = 25 under wind tips at H = W w/h, on triangles bisected towards its toe."""
    free = [Traction(side, 0.0, 0.0) for side in ("top", "right")]
    loads: list[Condition] = [Contact("bottom", 1e3, name="base"), Traction("left", 0.25, 0.0, name="wind"), *free]
    for bisections in (26,) if quick else (1, 8, 16):  # tests take edges so short that rounding would tell
        mesh = TriangleMesh.rectangle((1, 2), 1.0, 4.0).graded([[1.0, 0.0]], bisections)
        limit, rows = _factor(p, ContactProblem(mesh, _STEEL, loads, body_potential=Expression("25 / 4 * y")), "wind")
        source = f"W w/h; {bisections} bisections at the toe"
        yield rows.relative("limit load of the body", limit.upper, 6.25, f"{source}, rigid block", tolerance=1e-9)
        yield rows.at_most("limit load of the mesh", limit.lower, 6.25, source, tolerance=1e-9)
        reached = 6.25 * (1.0 - 2.0 * float(mesh.edges("bottom").length.min()) / p)
        source = f"W (w − 2 e)/h, e: 1/{p} of the last edge; {bisections} bisections"
        yield rows.relative("limit load of the mesh", limit.lower, reached, source)


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


def oblique(share: float) -> ContactProblem:
    """Uniform pressure and this share of the shear that friction carries, all around the block."""
    cosine, sine = math.sqrt(0.75), 0.5
    mesh = TriangleMesh.rectangle((4, 2), 40.0, 20.0)
    mesh = replace(mesh, vertices=mesh.vertices @ np.array([[cosine, sine], [-sine, cosine]]))
    shear, pressure = share * 0.3 * 300.0, Traction("top", normal=-300.0)
    drag = [
        Traction(side, tangential=sign * shear, name="drag")
        for side, sign in (("top", 1.0), ("right", -1.0), ("left", 1.0))
    ]
    free = [Traction(side, normal=0.0) for side in ("right", "left")]
    return ContactProblem(mesh, _STEEL, [Contact("bottom", 0.3, name="plane"), pressure, *drag, *free])
