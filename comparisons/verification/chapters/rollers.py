"""Hertz and Cattaneo-Mindlin on true arcs, the torque of a press fit, and Klang's cylinder: rows of the benchmarks."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.exhibits import MM, Curve, Graph, shown
from comparisons.verification.measures import angles, degrees, ellipse
from comparisons.verification.proof import both, by_hand, certified
from comparisons.verification.row import Kind, Row, absolute, at_least, at_most, relative, word
from comparisons.verification.two_models import two_models
from qvi_contact import ContactLine, ContactState, History
from qvi_contact.basics.checks import FloatArray
from qvi_contact.gallery import cylinder_in_bore, cylinder_on_block, half_discs, persson_pressure, press_fit_torque

PROBLEMS: Final = Chapter()

FULL_SLIP: Final = 2.0 * np.pi * 0.2 * 59.927273 * 25.0**2
"""The torque 2π μ p R² [N mm/mm] at which the hollow shaft of `press_fit_torque` slips with μ = 0.2."""

_STICK: Final = 4e-4  # of c on triangles of degree 4, on this mesh: the shear has a kink there
_STEPS: Final = 10  # of the load on Klang's cylinder


@PROBLEMS.on("cylinder-on-block", TRIANGLES, QUINTIC)
def hertz(element: Element, quick: bool) -> Iterator[Row]:
    """A cylinder on a block, without friction: NAFEMS R0094-1 with a hundredth of its force, against Hertz."""
    result = element.solve(cylinder_on_block(0.01, 4 if quick else 6, 3 if quick else 4))
    line, proof, source = result.contacts["contact"], certified(result), "Hertz; half planes, a/R = 0.012"
    peak, half_width = ellipse(line.x, -line.normal_stress)
    yield relative("peak pressure [MPa]", peak, 358.536, 1e-4, source, proof)
    yield relative("half-width [mm]", half_width, 0.62146, 1e-4, source, proof)
    yield from two_models(quick, result, "contact", 1e-9, 1e-4)
    if not quick:
        whole = element.solve(cylinder_on_block(1.0))
        peak, _ = ellipse(whole.contacts["contact"].x, -whole.contacts["contact"].normal_stress)
        quantity = "peak pressure under all of the load [MPa]"
        yield relative(quantity, peak, 3585.36, 1e-3, "Hertz; a/R = 0.12: how far half planes reach", certified(whole))


@shown("cylinder-on-block", lambda: cylinder_on_block(1.0, 2, 0), MM)
def _hertz_graph(quick: bool) -> Graph:
    """The pressure under the cylinder is Hertz's ellipse."""
    line = TRIANGLES.solve(cylinder_on_block(0.01, 4 if quick else 6, 2 if quick else 4)).contacts["contact"]
    x = np.linspace(0.0, 0.9, 200)
    known = Curve("Hertz", x, 358.536 * _ellipse(x / 0.62146))
    return Graph("x [mm]", "pressure [MPa]", (Curve("stresses", line.x, -line.normal_stress),), (known,))


@PROBLEMS.on("half-discs", TRIANGLES, QUINTIC)
def cattaneo(element: Element, quick: bool) -> Iterator[Row]:
    """Two half discs pressed together and sheared, of one material: Hertz, Cattaneo and Mindlin.

    Half planes and discs differ by terms of the order (a/R)² in the pressure, a/R in the part that sticks.
    """
    loads = ((1e-4, 2e-4),) if quick else ((1e-4, 1e-4), (1e-2, 1e-3), (1.0, 6e-3))
    for share, tolerance in loads:
        result = element.solve(half_discs(share, 3 if quick else 6, 3 if quick else 4))
        line, proof, root = result.contacts["contact"], certified(result), float(np.sqrt(share))
        reach = f"half planes, a/R = {0.0851 * root:.2g}"
        peak, half_width = ellipse(line.x, -line.normal_stress)
        missing = -0.2 * line.normal_stress - np.abs(line.tangential_stress)
        stick, source = ellipse(line.x, missing)[1], f"Hertz; {reach}"
        yield relative("peak pressure [MPa]", peak, 9.351351 * root, tolerance, source, proof)
        yield relative("half-width [mm]", half_width, 0.680778 * root, tolerance, source, proof)
        quantity = "half-width of what sticks [mm]"
        least = tolerance if element is QUINTIC else max(tolerance, _STICK)
        yield relative(quantity, stick, 0.496511 * root, least, f"Cattaneo, Mindlin; {reach}", proof)
        if share < 1e-3:
            yield from two_models(quick, result, "contact", 1e-9, 1e-3)


@shown("half-discs", lambda: half_discs(1.0, 2, 0), MM)
def _cattaneo_graph(quick: bool) -> Graph:
    """Shear stays below the bound in the middle, which sticks, and reaches it outside."""
    line = TRIANGLES.solve(half_discs(1e-4, 4 if quick else 6, 2 if quick else 4)).contacts["contact"]
    x, height = np.linspace(-0.9, 0.9, 400), 0.2 * 93.51351
    bound = height * _ellipse(x / 0.680778)
    shear = bound - height * 0.496511 / 0.680778 * _ellipse(x / 0.496511)
    known = Curve("bound μp, Hertz", x, bound), Curve("shear, Cattaneo and Mindlin", x, shear)
    place = 100.0 * line.x
    ours = (
        Curve("bound μp, stresses", place, -200.0 * line.normal_stress),
        Curve("shear, stresses", place, 1e3 * np.abs(line.tangential_stress)),
    )
    return Graph("x [0.01 mm]", "traction [kPa]", ours, known)


@PROBLEMS.on("slip-torque", TRIANGLES, QUINTIC)
def slip_torque(element: Element, quick: bool) -> Iterator[Row]:
    """The torque at which a shaft slips in its hub, 2π μ p R²: from below, from above, and turned further.

    A limit analysis has no answer here: equilibrium alone lets the pressure of an interference be as large as it likes.
    """
    limit, sectors = FULL_SLIP, 4 if quick else 6
    below = element.solve(press_fit_torque(0.2, 0.9999 * limit, sectors=sectors))
    source = "2π μ p R², p = 59.927 MPa by Lamé for a hollow shaft; 0.9999 of it applied"
    torque, proof = _torque(below.contacts["shaft"]), certified(below)
    yield relative("torque carried [N mm/mm]", torque, 0.9999 * limit, 1e-9, source, proof)
    sliding = element.solve(press_fit_torque(0.2, turn=0.01, sectors=sectors))
    torque, proof = _torque(sliding.contacts["shaft"]), certified(sliding)
    source = "2π μ p R²; the bore is turned until all of the fit slips"
    yield relative("torque in full slip [N mm/mm]", torque, limit, 1e-4, source, proof)
    yield absolute("part that slips [-]", sliding.contacts["shaft"].shares["slip"], 1.0, 0.0, "all of it", proof)
    if not quick:
        above = element.solve(press_fit_torque(0.2, 1.001 * limit))
        ours = "solved" if certified(above).passed else "not solved"
        proof = by_hand(not above.certificate.passed, "no certificate")
        yield word("a larger torque", ours, "not solved", "1.001 of the limit applied", proof)
        yield from two_models(quick, element.solve(press_fit_torque(0.2, 0.5 * limit, sectors=6)), "shaft", 1e-4, 1e-4)


@shown("slip-torque", lambda: press_fit_torque(0.2, 47066.77, sectors=2), MM)
def _torque_graph(quick: bool) -> Graph:
    """The torque grows with the turn until all of the fit slips, and no further."""
    # the torque over the turn of the bore: two rings in series until all of the fit slips
    stiffness = 4.0 * np.pi * (206e3 / 2.6) / (1.0 / 5.0**2 - 1.0 / 50.0**2)
    first = FULL_SLIP / stiffness
    turns = first * (np.array([0.5, 1.5]) if quick else np.array([0.25, 0.5, 0.75, 0.9, 1.1, 1.25, 1.5, 2.0]))
    torques = [_torque_at(float(turn)) for turn in turns]
    known = Curve("2π μ p R² at most", 1e3 * first * np.array([0.0, 1.0, 2.0]), FULL_SLIP * np.array([0.0, 1.0, 1.0]))
    ours = Curve("stresses", 1e3 * turns, np.array(torques) / 1e3)
    return Graph("turn of the bore [mrad]", "torque [N m/mm]", (ours,), (known._replace(y=known.y / 1e3),))


def _torque_at(turn: float) -> float:
    return _torque(TRIANGLES.solve(press_fit_torque(0.2, turn=5.0 * turn)).contacts["shaft"])


@PROBLEMS.on("cylinder-in-bore-friction", TRIANGLES)
def klang(element: Element, quick: bool) -> Iterator[Row]:
    """The cylinder in a bore with μ = 0.4: Klang's problem, Code_Aster's SSNV127, whose curve was digitised.

    The answer depends on the steps of the load, since the contact grows and what has moved before it touches counts as
    slip. With more and more steps it settles: in 10, 20, 40 the mean pressure near the load is 18.55, 18.72 and
    18.81 MPa, and from 2 on the bore slips from about 40°. In one step it slips from about 6°. Print, which does not
    say how its load grew, has 17.8 MPa and slip from 33°, both in between.
    """
    for count in (1,) if quick else (1, _STEPS):
        history = klang_history(element, count)
        line, proof = history.steps[-1].contacts["bore"], both(*map(certified, history.steps))
        near = np.where(np.abs(angles(line)) < np.deg2rad(15.0), line.weights, 0.0)
        ours = float(-(near @ line.normal_stress) / near.sum())
        source = f"Klang; digitised, load in {count} step{'s' if count > 1 else ''}: only 8 % are asked for"
        yield relative("mean pressure, 0° to 15° [MPa]", ours, 17.8, 0.08, source, proof, Kind.PUBLISHED)
        between = at_most if count == 1 else at_least
        source = "Klang; digitised: in one step of the load the bore slips nearer to the load, in many farther off"
        quantity = f"angle up to which the bore sticks, load in {count} step{'s' if count > 1 else ''} [°]"
        yield between(quantity, _sticks_until(line), 33.0, 0.0, source, proof, Kind.PUBLISHED)
        if count == 1:
            yield from two_models(quick, history.steps[-1], "bore", 1e-3, 1e-2)


@shown("cylinder-in-bore-friction", lambda: cylinder_in_bore(2, 0.4, extent=2.0), MM)
def _klang_graph(quick: bool) -> Graph:
    """Pressure, and shear over μ, which meets it where the bore slips: both depend on the steps of the load."""
    # pressure after one and after many steps of the load, and how much of the friction bound shear has taken
    ours = []
    for count in (1, 3 if quick else 10):
        line = klang_history(TRIANGLES, count, 4 if quick else 8).steps[-1].contacts["bore"]
        steps = f"{count} step{'s' if count > 1 else ''}"
        ours += [
            Curve(f"pressure, {steps}", degrees(line), -line.normal_stress).until(75.0),
            Curve(f"shear over μ, {steps}", degrees(line), np.abs(line.tangential_stress) / 0.4).until(75.0),
        ]
    read = Curve("pressure that was read from Klang's curve", np.array([0.0, 15.0]), np.array([17.8, 17.8]))
    return Graph("angle θ from the load [°]", "pressure, shear / μ [MPa]", tuple(ours), (persson(), read))


def persson() -> Curve:
    """The closed form without friction."""
    theta = np.linspace(0.0, 75.0, 200)
    return Curve("Persson, without friction", theta, persson_pressure(np.deg2rad(theta)))


def klang_history(element: Element, count: int, sectors: int = 8) -> History:
    """Klang's problem with its load in so many equal steps."""
    shares = np.linspace(0.0, 1.0, count + 1)[1:].tolist()
    return element.solve_history([cylinder_in_bore(sectors, 0.4, share=share) for share in shares])


def _sticks_until(line: ContactLine) -> float:
    """Largest angle [°] of a point that sticks; zero if none does."""
    sticks = line.state == ContactState.STICK
    return float(degrees(line)[sticks].max(initial=0.0))


def _torque(line: ContactLine) -> float:
    """Size of the moment of the shear about the origin, around which the line is closed [stress × length²]."""
    return float(abs(line.weights @ (line.tangential_stress * np.hypot(line.x, line.y))))


def _ellipse(x: FloatArray) -> FloatArray:
    return np.sqrt(np.maximum(1.0 - x**2, 0.0))
