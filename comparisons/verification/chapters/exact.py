"""Chapter on states whose Airy function both elements contain: nothing is left to approximate."""

from collections.abc import Callable, Iterator
from itertools import product
from typing import Final, Literal

import numpy as np

from comparisons.verification.elements import TRIANGLES, Chapter, Element
from comparisons.verification.measures import stress_error
from comparisons.verification.proof import certified
from comparisons.verification.row import Kind, Row, absolute, relative
from qvi_contact import (
    Contact,
    ContactProblem,
    ContactResult,
    Expression,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
)
from qvi_contact.basics.checks import FloatArray
from qvi_contact.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem.conditions import Condition

PROBLEMS: Final = Chapter()

Plane = Literal["stress", "strain"]

TOLERANCE: Final = 1e-9
_STRESS = "largest error of σ at 60 points over the largest |σ|"
_MESHES: Final = {
    "one cell": ((1, 1), 1.0),
    "3 × 2 cells": ((3, 2), 1.0),
    "5 × 4 cells graded by 0.4": ((5, 4), 0.4),
}
_WIDTH, _HEIGHT, _LOW = 2.0, 1.0, -0.5
_MATERIALS: Final = (Material(1000.0, 0.3), Material(1000.0, 0.3, "strain"))


@PROBLEMS.on("uniaxial-compression", TRIANGLES)
def uniaxial_compression(element: Element, quick: bool) -> Iterator[Row]:
    """Compressed without friction: σ_yy = −E' U / height, with E' = E in plane stress, E / (1 − ν²) in plane strain."""
    for (name, (cells, grading)), plane in _cases(quick):
        result = element.solve(compressed_plate(0.0, cells, 2.0, plane=plane, grading=grading))
        modulus = 2.09e5 if plane == "stress" else 2.09e5 / (1 - 0.3**2)
        force = result.contacts["plate"].normal_force
        source = f"2 E' U; {name}, plane {plane}"
        yield relative("force [stress length]", force, 2e-3 * modulus, TOLERANCE, source, certified(result))
        yield _stress(result, uniform(result.problem.material, yy=-1e-3 * modulus), f"uniform; {name}, plane {plane}")


@PROBLEMS.on("no-lateral-strain", TRIANGLES)
def no_lateral_strain(element: Element, quick: bool) -> Iterator[Row]:
    """Compressed with ν = 0: nothing wants to slip, whatever the friction."""
    for ((name, (cells, grading)), plane), friction in product(_cases(quick), (0.05, 0.5)):
        result = element.solve(compressed_plate(friction, cells, poisson=0.0, plane=plane, grading=grading))
        source = f"uniform σ_yy = −E U / height; {name}, plane {plane}, μ = {friction:g}"
        yield _stress(result, uniform(result.problem.material, yy=-209.0), source)
        yield _no_slip(result, 1e-3, source)


@PROBLEMS.on("side-traction", TRIANGLES)
def side_traction_stops_slip(element: Element, quick: bool) -> Iterator[Row]:
    """Compressed with the side traction that suppresses ε_xx (σ_xx = ν σ_yy in plane stress): no slip at any μ."""
    for ((name, (cells, grading)), plane), friction in product(_cases(quick), (0.0, 0.2)):
        material = Material(2.09e5, 0.3, plane)
        c = material.compliance
        side = 200.0 * float(c[0, 1] / c[0, 0])
        state = uniform(material, xx=side, yy=-200.0)
        gap = float(state.displacement(np.array(0.0), np.array(1.0))[1])
        sides: list[Condition] = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=side, y=0.0)]
        contact = Contact("top", friction, gap=gap, name="plate")
        mesh = TriangleMesh.rectangle(cells, grading=grading)
        result = element.solve(ContactProblem(mesh, material, [*sides, contact]))
        source = f"uniform σ_xx, σ_yy; {name}, plane {plane}, μ = {friction:g}"
        yield _stress(result, state, source)
        yield _no_slip(result, abs(gap), source)


@PROBLEMS.on("pure-bending", TRIANGLES)
def bending(element: Element, quick: bool) -> Iterator[Row]:
    """Pure bending by end tractions, σ_xx = m y: end moment m h³/12 and strain energy c11 m² h³ w / 24."""
    moment = 7.0
    for result, state, c, where in _states(element, quick, lambda m: pure_bending(m, moment), "tt", "tt", "tt", "uu"):
        yield _stress(result, state, f"σ_xx = m y; {where}")
        end = -moment * _HEIGHT**3 / 12.0
        ours, proof = result.resultant("right").moment, certified(result)
        yield relative("moment on the right end [stress length²]", ours, end, TOLERANCE, f"−m h³/12; {where}", proof)
        yield _energy(result, c[0, 0] * moment**2 * _HEIGHT**3 * _WIDTH / 24.0, f"c11 m² h³ w / 24; {where}")


@PROBLEMS.on("cantilever", TRIANGLES)
def timoshenko_cantilever(element: Element, quick: bool) -> Iterator[Row]:
    """Cantilever loaded at its end with its exact end displacements, free at y = ±h/2: Timoshenko's solution."""
    slope = 3.0
    shear = -slope * _HEIGHT**2 / 8.0
    states = _states(element, quick, lambda m: cantilever(m, slope, shear), "tt", "uu", "tt", "uu")
    for result, state, c, where in states:
        yield _stress(result, state, f"Timoshenko and Goodier, Theory of Elasticity, art. 21; {where}")
        force = -shear * _HEIGHT - slope * _HEIGHT**3 / 24.0
        ours, proof = result.resultant("right").y, certified(result)
        yield relative("end force [stress length]", ours, force, TOLERANCE, f"k h³/12; {where}", proof)
        bent = c[0, 0] * slope**2 * _HEIGHT**3 * _WIDTH**3 / 72.0
        sheared = c[2, 2] * slope**2 * _HEIGHT**5 * _WIDTH / 240.0
        yield _energy(result, bent + sheared, f"c11 k² h³ w³/72 + c33 k² h⁵ w/240; {where}")


@PROBLEMS.on("simple-shear", TRIANGLES)
def simple_shear(element: Element, quick: bool) -> Iterator[Row]:
    """Uniform shear τ by displacements of all sides: shear force τ w and strain energy c33 τ² h w / 2."""
    for result, state, c, where in _states(element, quick, lambda m: uniform(m, xy=5.0), "uu", "uu", "uu", "uu"):
        yield _stress(result, state, f"σ_xy = τ; {where}")
        ours, proof = result.resultant("top").x, certified(result)
        yield relative("shear force on the top [stress length]", ours, 10.0, TOLERANCE, f"τ w; {where}", proof)
        yield _energy(result, c[2, 2] * 25.0 * _HEIGHT * _WIDTH / 2.0, f"c33 τ² h w / 2; {where}")


@PROBLEMS.on("column", TRIANGLES)
def column(element: Element, quick: bool) -> Iterator[Row]:
    """Column under its own weight, φ = ρ g y, held at the base: σ_yy = ρ g (y − h)."""
    weight = 4.0
    states = _states(element, quick, lambda m: gravity_column(m, weight, _LOW + _HEIGHT), "uu", "tt", "tt", "tt")
    for result, state, c, where in states:
        yield _stress(result, state, f"σ_yy = ρ g (y − h); {where}")
        total = weight * _WIDTH * _HEIGHT
        ours, proof = result.resultant("bottom").y, certified(result)
        yield relative("weight on the base [stress length]", ours, total, TOLERANCE, f"ρ g h w; {where}", proof)
        yield _energy(result, c[0, 0] * weight**2 * _HEIGHT**3 * _WIDTH / 6.0, f"c11 (ρ g)² h³ w / 6; {where}")


@PROBLEMS.on("incompressible", TRIANGLES)
def incompressible(element: Element, _: bool) -> Iterator[Row]:
    """ν = ½ in plane strain, which stresses do not lock at: E' = 4 E / 3, a body of water in a box, and ν → ½."""
    plate = element.solve(_plate(0.0, 0.5))
    force = plate.contacts["plate"].normal_force
    quantity, proof = "force on the frictionless plate [stress length]", certified(plate)
    yield relative(quantity, force, 2e-3 * 2.09e5 / 0.75, TOLERANCE, "2 E' U, E' = E / (1 − ν²)", proof)
    box = element.solve(_box())
    wall, proof = box.contacts["wall"].normal_force, certified(box)
    yield relative("force on the wall [stress length]", wall, 3.5, TOLERANCE, "p h + ρ g h²/2", proof)
    rough, near, nearer = (element.solve(_plate(0.2, 0.5 - step)) for step in (0.0, 2e-4, 1e-4))
    force, *forces = (result.contacts["plate"].normal_force for result in (rough, near, nearer))
    source, proof = "2 P(½ − δ) − P(½ − 2δ), δ = 1e-4", certified(rough, near, nearer)
    known = 2.0 * forces[1] - forces[0]
    yield relative("force at μ = 0.2 [stress length]", force, known, 1e-6, source, proof, Kind.METHODS)


def _plate(friction: float, poisson: float) -> ContactProblem:
    return compressed_plate(friction, (4, 4), 2.0, poisson=poisson, plane="strain")


def _box() -> ContactProblem:
    """A heavy incompressible body in a box with a rough floor and wall, pressed by p = 2: σ = −(p + ρ g (h − y)) I."""
    sides: list[Condition] = [Traction("top", 0.0, -2.0), Symmetry("left"), Contact("right", 0.3, name="wall")]
    floor = Contact("bottom", 0.3, name="floor")
    mesh, water = TriangleMesh.rectangle((3, 3)), Material(1000.0, 0.5, "strain")
    return ContactProblem(mesh, water, [*sides, floor], body_potential=Expression("3 * y"))


def _cases(quick: bool) -> list[tuple[tuple[str, tuple[tuple[int, int], float]], Plane]]:
    """Meshes and planes of the plate."""
    meshes = list(_MESHES.items())[2:] if quick else list(_MESHES.items())
    planes: tuple[Plane, ...] = ("stress",) if quick else ("stress", "strain")
    return list(product(meshes, planes))


def _states(
    element: Element, quick: bool, state_of: Callable[[Material], ExactState], *kinds: str
) -> Iterator[tuple[ContactResult, ExactState, FloatArray, str]]:
    """Results on [0, 2] × [−½, ½], their exact states and compliances, and where that is.

    `kinds` say what of the state is given on bottom, right, top and left, see `problem_from_state`.
    """
    given = dict(zip(("bottom", "right", "top", "left"), kinds, strict=True))
    for (name, (cells, grading)), plane in _cases(quick):
        mesh = TriangleMesh.rectangle(cells, _WIDTH, _HEIGHT, origin=(0.0, _LOW), grading=grading)
        material = _MATERIALS[plane == "strain"]
        state = state_of(material)
        result = element.solve(problem_from_state(state, mesh, material, given))
        yield result, state, material.compliance, f"{name}, plane {plane}"


def _stress(result: ContactResult, state: ExactState, source: str) -> Row:
    return absolute(_STRESS, stress_error(result, state), 0.0, TOLERANCE, source, certified(result))


def _energy(result: ContactResult, exact: float, source: str) -> Row:
    ours = result.energies.strain
    return relative("strain energy [stress length²]", ours, exact, TOLERANCE, source, certified(result))


def _no_slip(result: ContactResult, unit: float, source: str) -> Row:
    slip = float(np.abs(result.contacts["plate"].slip).max()) / unit
    return absolute("largest |slip| over the compression", slip, 0.0, TOLERANCE, source, certified(result))
