"""Chapter on numbers that engineers ask for: derivatives with respect to data, peaks, and estimates of their errors."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from comparisons.verification.chapters.curves import kirsch, lame, ring, sheet, stretched
from comparisons.verification.known import CYLINDER, HALF_DISCS
from comparisons.verification.rows import Chapter, Check, Kind, Row, certified
from qvi_contact import ContactResult, Polynomial, Region, TriangleMesh, refine, solve
from qvi_contact.gallery import cylinder_on_block, half_discs
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.types import Condition, FloatArray

NUMBERS: Final = Chapter()

_YOUNG, _POISSON, _EXPANSION = 1000.0, 0.3, 1e-3
_STEP: Final = 1e-4
"""Step of central differences, over the size of the datum."""


@NUMBERS("derivatives", 5)
def known_derivatives(p: int, quick: bool) -> Iterator[Row]:
    """Derivatives in closed form: a sliding block, Cattaneo and Mindlin, a contact that just touches or just slips."""
    free = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    wall = Contact("bottom", 0.3, name="wall", offset=-0.5)
    top = Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-5.0, x=0.0, rotation=0.0))
    block = ContactProblem(TriangleMesh.rectangle((3, 2), 2.0), Material(_YOUNG, _POISSON), [*free, wall, top])
    slides = solve(block, degree=p)
    rows, sign = Check(certified(slides), tolerance=1e-9), np.sign(slides.contacts["wall"].tangential_force)
    found = sign * slides.derivative("wall.tangential_force", "wall.friction")
    yield rows.relative("∂T/∂μ of a sliding block [N/mm]", found, 5.0, "N")
    found = sign * slides.derivative("wall.tangential_force", "top.force_y")
    yield rows.relative("∂T/∂F of it, F the force upwards [-]", found, -0.3, "-μ")
    yield from _cattaneo(p, quick)
    square = TriangleMesh.rectangle((2, 2))
    touches = solve(ContactProblem(square, Material(_YOUNG, 0.0), [Symmetry("bottom"), *free, Contact("top", 0.0)]))
    rows = Check(certified(touches), "it is pressed from one side, and free from the other")
    below, above = (touches.derivative("top.normal_force", "top.gap", side) for side in ("below", "above"))
    yield rows.relative("∂N/∂g from below, of a contact that just touches [MPa]", below, -_YOUNG, tolerance=1e-9)
    yield rows.absolute("the same from above [MPa]", above, 0.0, tolerance=1e-6)
    bond, shear = 3.0, _YOUNG / 2.5
    held: list[Condition] = [Displacement("bottom", 0.0, 0.0)]
    held += [each for name in ("left", "right") for each in (Displacement(name, y=0.0), Traction(name, x=0.0))]
    bonded = Contact("top", 0.0, cohesion=bond, law="bilateral", offset=bond / shear)
    slips = solve(ContactProblem(square, Material(_YOUNG, 0.25), [*held, bonded]))
    rows = Check(certified(slips), "simple shear up to the bond c, all along the contact")
    below, above = (slips.derivative("top.tangential_force", "top.offset", side) for side in ("below", "above"))
    yield rows.relative("∂T/∂w from below, of a contact that just slips [MPa]", below, shear, tolerance=1e-8)
    yield rows.absolute("the same from above [MPa]", above, 0.0, tolerance=1e-6)


def _cattaneo(p: int, quick: bool) -> Iterator[Row]:
    """∂/∂Q and ∂/∂μ of q = μ (p₀/a) (√(a² − x²) − √(c² − x²)), |x| < c, with c² = a² (1 − Q/(μ P)), P = π a p₀/2."""
    share, mu = 1e-4, 0.2
    result = solve(half_discs(share, *((3, 3) if quick else (6, 4))), degree=p)
    peak, a, c = (0.01 * each for each in HALF_DISCS)
    force, pull = 10.0 * share, 0.93616 * share
    rows = Check(certified(result), "Cattaneo, Mindlin; half planes, a/R = 8.5e-4")
    for part in (0.3, 0.5) if quick else (0.1, 0.3, 0.5, 0.7):
        x = float(part * c)
        root = np.sqrt(c**2 - x**2)
        by_pull = 1.0 / (np.pi * root)
        by_friction = peak / a * (np.sqrt(a**2 - x**2) - root) - by_pull * pull / mu
        assert np.isclose(by_pull, peak * a / (2.0 * force * root), rtol=1e-4)
        found = result.derivative(f"xy({x!r}, 0)", "load.force_x")
        yield rows.relative(f"∂q/∂Q at x = {part:g} c [1/mm]", found, by_pull, tolerance=0.02 if quick else 1e-3)
        found = result.derivative(f"xy({x!r}, 0)", "contact.friction")
        yield rows.relative(f"∂q/∂μ at x = {part:g} c [MPa]", found, by_friction, tolerance=0.06 if quick else 3e-3)


@NUMBERS("derivatives-differences")
def differences(quick: bool) -> Iterator[Row]:
    """Derivatives of forces, a motion and a stress of two heated blocks with friction against differences of solves."""
    count, worst, results = 10 if quick else 205, 0.0, list[ContactResult]()
    for found in filter(None, map(by_differences, range(count))):
        result, derivatives, quotients, least = found
        results.append(result)
        worst = max(worst, float(np.abs(derivatives - quotients).max()) / least)
    rows = Check(certified(*results), f"central differences, step {_STEP:g} of a datum; {count} problems", 1e-6,
                 Kind.METHODS)  # fmt: skip
    yield rows.absolute("largest relative difference of 4 derivatives [-]", worst, 0.0)
    yield rows.at_least("problems that keep their state within the step", len(results), 0.9 * count)


DATA: Final = {
    "mu": ("bottom.friction", 1.0), "joint": ("joint.friction", 1.0), "gap": ("bottom.gap", 0.1),
    "offset": ("bottom.offset", 0.1), "young": ("material.young", _YOUNG), "own": ("upper.young", _YOUNG),
    "force": ("top.force_x", 50.0), "load": ("load.right", 10.0), "x": ("left.x", 0.1), "T": ("temperature", 100.0),
}  # fmt: skip
"""Data of `two_blocks` → the parameter, and its size; large if the answer is linear in the datum."""

_QUANTITIES: Final = {"bottom.tangential_force": 1.0, "joint.tangential_force": 1.0, "top.x": 1e3, "xx(0.8, 0.3)": 1.0}
"""Quantity → factor that gives all quantities about the same size."""


def two_blocks(number: int, **changed: float) -> ContactProblem:
    """A joint and a base with stick, slip and gaps, a plate driven by forces on top, heated unevenly."""
    rng = np.random.default_rng(number)
    data = {"mu": rng.uniform(0.1, 0.5), "joint": rng.uniform(0.1, 0.5), "gap": -0.004 * rng.random(), "young": _YOUNG}
    data |= {"offset": 0.004 * rng.normal(), "force": 2.0 * rng.normal(), "load": 1.0, "x": 0.005 * rng.normal()}
    data |= {"T": 0.0, "own": 2.0 * _YOUNG}
    data |= {name: data[name] + more for name, more in changed.items()}
    hot, press = 3.0 * rng.normal(size=(2, 2)), rng.normal(size=2)
    hot[0, 0] += data["T"]
    mesh = TriangleMesh.grid(np.linspace(0, 2, 5), [0.0, 0.5, 1.0], regions={"upper": ((0.0, 2.0), (0.5, 1.0))})
    mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - 0.5) < 1e-9)
    top = Contact("top", 0.0, law="tied", plate=RigidPlate(force_x=data["force"], force_y=-12.0, rotation=0.0))
    base = Contact("bottom", data["mu"], gap=data["gap"], offset=data["offset"])
    sides: list[Condition] = [Displacement("left", x=data["x"]), Traction("left", y=0.0)]
    sides += [Traction("right", *(press * data["load"]))]
    upper = Region(Material(data["own"], _POISSON, expansion=_EXPANSION / 2.0), name="upper")
    steel = Material(data["young"], _POISSON, expansion=_EXPANSION)
    conditions = [base, Contact("joint", data["joint"]), top, *sides]
    return ContactProblem(mesh, steel, conditions, regions=[upper], temperature=Polynomial(hot.tolist()))


def by_differences(number: int) -> tuple[ContactResult, FloatArray, FloatArray, float] | None:
    """The result, derivatives by one datum of `two_blocks`, difference quotients, and the unit of errors.

    The unit is the largest quotient, or, if no quantity depends on the datum, a force over the size of the datum, since
    solves have ten digits. None if a point changes its state within the step.
    """
    short = list(DATA)[number % len(DATA)]
    parameter, size = DATA[short]
    ways = (0.0, _STEP * size, -_STEP * size)
    results = [solve(two_blocks(number, **{short: way}), tolerance=1e-14 if way else 1e-13) for way in ways]
    for name, line in results[0].contacts.items():
        if any((each.contacts[name].state != line.state).any() for each in results[1:]):
            return None
    here, above, below = (
        np.array([each.contacts["bottom"].tangential_force, each.contacts["joint"].tangential_force,
                  each.plates["top"].x, each.stress(0.8, 0.3)[0]])
        for each in results
    )  # fmt: skip
    scale = np.array(list(_QUANTITIES.values()))
    quotients = scale * (above - below) / (2.0 * _STEP * size)
    found = scale * [results[0].derivative(quantity, parameter) for quantity in _QUANTITIES]
    return results[0], found, quotients, float(max(np.abs(quotients).max(), np.abs(here).max() / size))


@NUMBERS("peaks", 4)
def peaks(p: int, quick: bool) -> Iterator[Row]:
    """Peaks found by refine, and its estimated errors, with a factor of safety of 1.5, over the true errors."""
    hole, bore, roll = stretched(sheet(2, 4)), ring(2), cylinder_on_block(0.01, 4, 2)
    tip, inside = (float(kirsch(np.array([x]), np.array([0.0]))[0, 1]) for x in (1.25, 1.6))
    hoop = float(lame(np.array([1.0]), np.array([0.0]))[0, 1])
    for title, problem, quantity, known, source in (
        ("largest stress at an elliptic hole [-]", hole, "inner.largest_first", tip, "Kirsch, Inglis"),
        ("stress beside it, at x = 1.6 [-]", hole, "yy(1.6, 0)", inside, "Kirsch, Inglis"),
        ("largest stress in the bore of a ring [-]", bore, "inner.largest_first", hoop, "Lamé"),
        ("largest pressure of a cylinder [MPa]", roll, "contact.largest_pressure", CYLINDER[0],
         "Hertz; half planes, a/R = 0.012"),
    )[2 if quick else 0 :]:  # fmt: skip
        found = refine(problem, None, 1e-3, quantity, degree=p)
        rows, ratio = Check(certified(found.result), source), found.error / abs(found.value - known)
        yield rows.relative(title, found.value, known, tolerance=1e-3)
        yield rows.at_least("estimated over true error of it, not less than [-]", ratio, 1.0)
        yield rows.at_most("the same, not more than [-]", ratio, 3.0)
    sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    top = Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-6.0, x=0.0, rotation=0.0))
    wall = Contact("bottom", 0.2, name="wall")
    mesh, stiff = TriangleMesh.rectangle((2, 1), 2.0), Material(1e4, 0.3)
    steps = [ContactProblem(mesh, stiff, [*sides, replace(wall, offset=way), top]) for way in (0.0, 0.5, 0.0, -0.5)]
    found = refine(steps, None, 1e-3, "dissipation", degree=3)
    rows = Check(certified(found.result), "μ N times the way, less what the block gives way")
    yield rows.relative("work lost in rubbing a block [N mm/mm]", found.value, 0.2 * 6.0 * 1.5, tolerance=2e-3)
