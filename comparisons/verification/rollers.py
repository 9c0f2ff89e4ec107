"""Hertz and Cattaneo-Mindlin on true arcs, the torque of a press fit, and Klang's cylinder: rows of the benchmarks."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.measures import ellipse
from comparisons.verification.proof import both, by_hand, certified
from comparisons.verification.row import Kind, Row, absolute, at_least, at_most, relative, word
from comparisons.verification.two_models import two_models
from qvi_contact import ContactLine, ContactState, History
from qvi_contact.gallery import cylinder_in_bore, cylinder_on_block, half_discs, press_fit_torque

PROBLEMS: Final = Chapter()

FULL_SLIP: Final = 2.0 * np.pi * 0.2 * 59.927273 * 25.0**2
"""The torque 2π μ p R² [N mm/mm] at which the hollow shaft of `press_fit_torque` slips with μ = 0.2."""

_STICK: Final = 4e-4  # of c on triangles of degree 4, on this mesh: the shear has a kink there
_STEPS: Final = 10  # of the load on Klang's cylinder


@PROBLEMS.on("cylinder-on-block", TRIANGLES, QUINTIC, few=1)
def hertz(element: Element, quick: bool) -> Iterator[Row]:
    """A cylinder on a block, without friction: NAFEMS R0094-1 with a hundredth of its force, against Hertz."""
    result = element.solve(cylinder_on_block(0.01, 4 if quick else 6, 3 if quick else 4))
    line, proof, source = result.contacts["contact"], certified(result), "Hertz; half planes, a/R = 0.012"
    peak, half_width = ellipse(line.x, -line.normal_stress)
    yield relative("peak pressure [MPa]", peak, 358.536, 1e-4, source, proof)
    yield relative("half-width [mm]", half_width, 0.62146, 1e-4, source, proof)
    if not quick:
        yield from two_models(result, "contact", 1e-9, 1e-4)
        whole = element.solve(cylinder_on_block(1.0))
        peak, _ = ellipse(whole.contacts["contact"].x, -whole.contacts["contact"].normal_stress)
        quantity = "peak pressure under all of the load [MPa]"
        yield relative(quantity, peak, 3585.36, 1e-3, "Hertz; a/R = 0.12: how far half planes reach", certified(whole))


@PROBLEMS.on("half-discs", TRIANGLES, QUINTIC, few=1)
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
        if not quick and share < 1e-3:
            yield from two_models(result, "contact", 1e-9, 1e-3)


@PROBLEMS.on("slip-torque", TRIANGLES, QUINTIC, few=1)
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
    slipping = sliding.contacts["shaft"].shares["slip"]
    yield absolute("part that slips [-]", slipping, 1.0, 0.0, "all of it", proof)
    if not quick:
        above = element.solve(press_fit_torque(0.2, 1.001 * limit))
        ours = "solved" if certified(above).passed else "not solved"
        proof = by_hand(not above.certificate.passed, "no certificate")
        yield word("a larger torque", ours, "not solved", "1.001 of the limit applied", proof)
        yield from two_models(element.solve(press_fit_torque(0.2, 0.5 * limit, sectors=6)), "shaft", 1e-4, 1e-4)


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
        near = np.where(np.abs(np.arctan2(line.y, line.x)) < np.deg2rad(15.0), line.weights, 0.0)
        ours = float(-(near @ line.normal_stress) / near.sum())
        source = f"Klang; digitised, load in {count} step{'s' if count > 1 else ''}: only 8 % are asked for"
        yield relative("mean pressure, 0° to 15° [MPa]", ours, 17.8, 0.08, source, proof, Kind.PUBLISHED)
        between = at_most if count == 1 else at_least
        source = "Klang; digitised: in one step of the load the bore slips nearer to the load, in many farther off"
        quantity = f"angle up to which the bore sticks, load in {count} step{'s' if count > 1 else ''} [°]"
        yield between(quantity, _sticks_until(line), 33.0, 0.0, source, proof, Kind.PUBLISHED)
        if count == 1 and not quick:
            yield from two_models(history.steps[-1], "bore", 1e-3, 1e-2)


def klang_history(element: Element, count: int, sectors: int = 8) -> History:
    """Klang's problem with its load in so many equal steps."""
    shares = np.linspace(0.0, 1.0, count + 1)[1:].tolist()
    return element.solve_history([cylinder_in_bore(sectors, 0.4, share=share) for share in shares])


def _sticks_until(line: ContactLine) -> float:
    """Largest angle [°] of a point that sticks; zero if none does."""
    sticks = line.state == ContactState.STICK
    return float(np.rad2deg(np.arctan2(line.y, line.x)[sticks].max(initial=0.0)))


def _torque(line: ContactLine) -> float:
    """Size of the moment of the shear about the origin, around which the line is closed [stress × length²]."""
    return float(abs(line.weights @ (line.tangential_stress * np.hypot(line.x, line.y))))
