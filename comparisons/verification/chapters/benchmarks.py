"""Chapters on published problems: SSNV128; rings, fits, rollers, pins in holes, and corners of blocks."""

from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from typing import Final

import numpy as np

from comparisons.verification.chapters.limits import oblique
from comparisons.verification.known import CYLINDER, HALF_DISCS, read_example
from comparisons.verification.known import SSNV128 as CODE_ASTER
from comparisons.verification.measures import ellipse, left_by_stresses, two_models, value_at, zone_ends
from comparisons.verification.rows import Chapter, Check, Kind, Row, both, by_hand, certified
from qvi_contact import ContactProblem, ContactResult, ContactState, gallery, solve, solve_history

SSNV128, BENCHMARKS = Chapter(), Chapter()

_SIDE: Final = 0.04
_SETTLED: Final = {"A": 2.8603e-5, "B": 2.7226e-5, "C": 2.2868e-5, "D": 1.9808e-5, "E": 1.5414e-5}


@SSNV128("ssnv128-published", 4)
def published_displacements(p: int, quick: bool) -> Iterator[Row]:
    """Tangential displacements of the base that the manual prints, within its own tolerance of 5 %."""
    result = _square(p, quick)
    base, rows = result.contacts["base"], Check(certified(result), tolerance=0.05, kind=Kind.PUBLISHED)
    for point, x, published in gallery.SSNV128_DISPLACEMENTS:
        source = f"{CODE_ASTER}, point {point}, x = {1e3 * x:g} mm; ± 5 %"
        yield rows.relative(f"u_x at point {point} [m]", value_at(base, base.slip, x), published, source)


@SSNV128("ssnv128-displacement-model", 4)
def displacement_model(p: int, quick: bool) -> Iterator[Row]:
    """Displacements, zones and pressure by an independent model; its forces are with the problem file."""
    result, source = _square(p, quick), "biquadratic displacement elements with nodal contact, up to 320 × 96 cells"
    base, rows = result.contacts["base"], Check(certified(result), tolerance=1e-3, kind=Kind.EXTERNAL)
    for point, x, _ in gallery.SSNV128_DISPLACEMENTS:
        ours, quantity = value_at(base, base.slip, x), f"u_x at point {point} [m]"
        yield rows.relative(quantity, ours, _SETTLED[point], f"{source}; ± 2e-9 m", tolerance=2e-3)
    cell = _SIDE / _cells(quick)[0]
    for name, end, exact in zip(("open", "slip"), zone_ends(base), (3.28e-3, 29.84e-3), strict=False):
        text = f"{source}; within one of our cells"
        yield rows.absolute(f"end of {name} [m]", end, exact, text, tolerance=cell)
    pressure = -value_at(base, base.normal_stress, _SIDE)
    yield rows.relative("pressure at x = a [Pa]", pressure, 8.3882e7, source)


@SSNV128("ssnv128-without-friction", 4)
def without_friction(p: int, quick: bool) -> Iterator[Row]:
    """μ = 0: uniform stress, and the corner moves by exactly ε_xx a."""
    result = solve(gallery.ssnv128(_cells(quick), friction=0.0), degree=p)
    exact = -float(result.problem.material.compliance[0] @ [-15e7, -5e7, 0.0]) * _SIDE
    base, rows = result.contacts["base"], Check(certified(result), tolerance=1e-9)
    source = "−(c11 σ_xx + c12 σ_yy) a = 4.061538e-5 m"
    yield rows.relative("u_x at x = 0 [m]", value_at(base, base.slip, 0.0), exact, source, tolerance=1e-8)
    for name, ours, known in zip(("σ_xx", "σ_yy"), result.stress(0.013, 0.021), (-15e7, -5e7), strict=False):
        yield rows.relative(f"{name} inside [Pa]", ours, known, "the pressure on that side")


@lru_cache(maxsize=2)
def _square(p: int, quick: bool) -> ContactResult:
    """The result of the first two problems."""
    return solve(gallery.ssnv128(_cells(quick)), degree=p)


def _cells(quick: bool) -> tuple[int, int]:
    return (16, 16) if quick else (32, 32)


BALANCE: Final = 1e-12
"""Resultants on a body up to this, over the forces on its edges, are rounding."""

FULL_SLIP: Final = 2.0 * np.pi * 0.2 * 59.927273 * 25.0**2
"""The torque 2π μ p R² [N mm/mm] at which the hollow shaft of `gallery.press_fit_torque` slips with μ = 0.2."""

_FIT: Final = 61.8  # pressure of `gallery.press_fit` by Lamé [MPa]
_RINGS: Final = (9.2592593e6, 1.3571791e5)  # pressure between them, mean and amplitude of cos 2θ [Pa]

_BY_NGSOLVE: Final = {0.0: 0.758518, 0.1: 0.738677}
"""μ → u_x [mm] on the axis at the hole of `loaded_pin`, by NGSolve: reports/peers/peers-pin.md of commit e714f877."""

_STICK: Final = 4e-4  # relative error of c on the mesh of `cattaneo` with degree 4: the shear has a kink at c
_DEPTH: Final = 20  # halvings of triangles at a corner
_NEAR: Final = (1e-5, 1e-3)  # distances from the corner between which the pressure is a power


@BENCHMARKS("rings", 4, 5)
def lame_rings(p: int, quick: bool) -> Iterator[Row]:
    """A ring in a ring under outer pressure, without friction (Code_Aster SSNP167): Lamé, and Michell for cos 2θ."""
    result = solve(gallery.rings(8, 1e5), degree=p)
    joint, rows = result.contacts["joint"], Check(certified(result))
    wave = np.cos(2.0 * np.arctan2(joint.y, joint.x))
    mean = joint.normal_force / joint.weights.sum()
    second = -(joint.weights @ (joint.normal_stress * wave)) / (joint.weights @ wave**2)
    yield rows.relative("mean pressure [Pa]", mean, _RINGS[0], "Lamé", tolerance=1e-6)
    yield rows.relative("amplitude of cos 2θ [Pa]", second, _RINGS[1], "Michell", tolerance=1e-4)
    error = float(np.abs(-joint.normal_stress / (_RINGS[0] + _RINGS[1] * wave) - 1.0).max())
    source = "Lamé and Michell, at all points"
    yield rows.absolute("largest relative error of the pressure", error, 0.0, source, tolerance=5e-4)
    yield from two_models(quick, result, "joint", 1e-5, 1e-6)


@BENCHMARKS("press-fit", 4, 5)
def fitted_shaft(p: int, quick: bool) -> Iterator[Row]:
    """A shaft in a hub with an interference: Lamé, with friction as well, which by symmetry does no work."""
    for friction in (0.0, 0.2):
        result = solve(gallery.press_fit(8, friction), degree=p)
        shaft, rows = result.contacts["shaft"], Check(certified(result))
        source, mean = f"Lamé, E δ (b² − a²)/(2 a b²); μ = {friction:g}", shaft.normal_force / shaft.weights.sum()
        yield rows.relative("mean pressure [MPa]", mean, _FIT, source, tolerance=1e-5)
        error, source = float(np.abs(shaft.normal_stress / _FIT + 1.0).max()), f"{source}; at all points"
        yield rows.absolute("largest relative error of the pressure", error, 0.0, source, tolerance=1e-3)
        yield from two_models(quick, result, "shaft", 1e-5, 1e-5)


@BENCHMARKS("cylinder-in-bore", 4, 5)
def bore(p: int, quick: bool) -> Iterator[Row]:
    """A cylinder in the bore of a large plate, without friction: Persson's closed form."""
    result = solve(gallery.cylinder_in_bore(6 if quick else 12), degree=p)
    line = result.contacts["bore"]
    theta = np.arctan2(line.y, line.x)
    rows = Check(certified(result), "Persson; load spread over 1/50 of the radius", 1e-3 if quick else 2e-4)
    for name, low, high in (("0° to 15°", 0.0, 15.0), ("15° to 45°", 15.0, 45.0)):
        weights = np.where((theta > np.deg2rad(low)) & (theta < np.deg2rad(high)), line.weights, 0.0)
        pressures = -line.normal_stress, gallery.persson_pressure(theta)
        ours, known = (float(weights @ each / weights.sum()) for each in pressures)
        yield rows.relative(f"mean pressure, {name} [MPa]", ours, known)
    if p == 4:
        yield from two_models(quick, result, "bore", 1e-3, 1e-3)


@BENCHMARKS("loaded-pin", 4, 5)
def pin(p: int, quick: bool) -> Iterator[Row]:
    """A pin in the eye of a sheet, pulled (NAFEMS R0094-4): Code_Aster, and NGSolve on the same mesh."""
    quantity = "u_x on the axis at the hole [mm]"
    for friction, known in list(_BY_NGSOLVE.items())[1 if quick else 0 :]:
        result = solve(gallery.loaded_pin(4 if quick else 12, friction), degree=p)
        force, name = -result.resultant("wall").x, "force at the clamped end, half of the sheet [N/mm]"
        yield Check(certified(result), f"balance; μ = {friction:g}", 1e-9).relative(name, force, 1e4)
        source = f"NGSolve, displacements of degree 4 on 12 sectors, with multipliers; μ = {friction:g}"
        rows, moved = Check(certified(result), source, 5e-4 if quick else 1e-4), result.displacement(50.0, 0.0)[0]
        yield rows.relative(quantity, moved, known, kind=Kind.EXTERNAL)
    source = (
        "Code_Aster SSNP156 B, elements of 8 nodes, small strain; 0.73617 with finite strain. A, of 4 nodes, 0.72092"
    )
    rows = Check(certified(result), kind=Kind.PUBLISHED)
    yield rows.relative(quantity, moved, 0.73924, source, tolerance=2e-3)
    source = (
        "the same; extrapolated to the node. A, of 4 nodes, -136.78. Shear changes its sign at this point, so that "
        "each mesh has another value, and no more is asked for than these two differ by, 15 %"
    )
    stress = float(result.stress(50.0, 0.0)[0])
    yield rows.relative("σ_xx on the axis at the hole [MPa]", stress, -160.51, source, tolerance=0.15)
    yield from two_models(quick, result, "pin", 2e-3, 1e-3)


@BENCHMARKS("corner-rates", 4)
def sticking_corner(p: int, quick: bool) -> Iterator[Row]:
    """A block that sticks to a large one: σ ~ r^(λ−1) in its corners makes energies converge like h^(2λ)."""
    for friction, name in ((None, "stuck"), (0.0, "without friction"))[: 1 if quick else 2]:
        bodies = [gallery.block_corner(friction, cells) for cells in ((1, 2, 4) if quick else (2, 4, 8))]
        results = [solve(body, degree=p) for body in bodies]
        energies = [result.energies.complementary for result in results]
        ours = float(np.log2((energies[0] - energies[1]) / (energies[1] - energies[2]))) / 2.0
        source = "Williams' eigenvalue problem; the rate of three uniform meshes"
        rows = Check(certified(*results), source, 0.03 if quick else 0.01)
        yield rows.relative(f"λ from the rate, {name}", ours, gallery.CORNER_EXPONENTS[friction])
        yield from two_models(quick, results[-1], "base", 5e-3, 5e-3)


@BENCHMARKS("sliding-corner", 4)
def sliding_corner(p: int, quick: bool) -> Iterator[Row]:
    """The same block sliding: the pressure near the leading corner, on triangles halved towards it."""
    for friction in (0.0, 0.5) if quick else (0.0, 0.1, 0.3, 0.5):
        result = solve(gallery.block_corner(friction, 1, _DEPTH), degree=p)
        line = result.contacts["base"]
        near = (1.0 - line.x > _NEAR[0]) & (1.0 - line.x < _NEAR[1])
        r, pressure = 1.0 - line.x[near], -line.normal_stress[near]
        rows = Check(certified(result), "four digits of the eigenvalue problem; the slope of ln p over ln r", 1e-3)
        exponent = 1.0 + float(np.polyfit(np.log(r), np.log(pressure), 1)[0])
        yield rows.absolute(f"λ from the pressure, μ = {friction:g}", exponent, gallery.CORNER_EXPONENTS[friction])
        yield from two_models(quick, result, "base", 1e-2, 1e-2)


@BENCHMARKS("cylinder-on-block", 4, 5)
def hertz(p: int, quick: bool) -> Iterator[Row]:
    """A cylinder on a block, without friction: NAFEMS R0094-1 with a hundredth of its force, against Hertz."""
    result = solve(gallery.cylinder_on_block(0.01, 4 if quick else 6, 3 if quick else 4), degree=p)
    line, rows = result.contacts["contact"], Check(certified(result), "Hertz; half planes, a/R = 0.012", 1e-4)
    peak, half_width = ellipse(line.x, -line.normal_stress)
    yield rows.relative("peak pressure [MPa]", peak, CYLINDER[0])
    yield rows.relative("half-width [mm]", half_width, CYLINDER[1])
    yield from two_models(quick, result, "contact", 1e-9, 1e-4)
    if not quick:
        whole = solve(gallery.cylinder_on_block(1.0), degree=p)
        peak, _ = ellipse(whole.contacts["contact"].x, -whole.contacts["contact"].normal_stress)
        rows = Check(certified(whole), "Hertz; a/R = 0.12: how far half planes reach", 1e-3)
        yield rows.relative("peak pressure under all of the load [MPa]", peak, 10.0 * CYLINDER[0])


@BENCHMARKS("half-discs", 4, 5)
def cattaneo(p: int, quick: bool) -> Iterator[Row]:
    """Two half discs pressed together and sheared, of one material: Hertz, Cattaneo and Mindlin.

    Half planes and discs differ by terms of the order (a/R)² in the pressure, a/R in the part that sticks.
    """
    loads = ((1e-4, 2e-4),) if quick else ((1e-4, 1e-4), (1e-2, 1e-3), (1.0, 6e-3))
    for share, tolerance in loads:
        result = solve(gallery.half_discs(share, 3 if quick else 6, 3 if quick else 4), degree=p)
        line, root = result.contacts["contact"], float(np.sqrt(share))
        rows = Check(certified(result), f"half planes, a/R = {0.0851 * root:.2g}", tolerance)
        peak, half_width = ellipse(line.x, -line.normal_stress)
        stick = ellipse(line.x, -0.2 * line.normal_stress - np.abs(line.tangential_stress))[1]
        yield rows.relative("peak pressure [MPa]", peak, HALF_DISCS[0] * root, "Hertz")
        yield rows.relative("half-width [mm]", half_width, HALF_DISCS[1] * root, "Hertz")
        least = tolerance if p == 5 else max(tolerance, _STICK)
        quantity = "half-width of what sticks [mm]"
        yield rows.relative(quantity, stick, HALF_DISCS[2] * root, "Cattaneo, Mindlin", tolerance=least)
        if share < 1e-3:
            yield from two_models(quick, result, "contact", 1e-9, 1e-3)


@BENCHMARKS("slip-torque", 4, 5)
def slip_torque(p: int, quick: bool) -> Iterator[Row]:
    """The torque at which a shaft slips in its hub, 2π μ p R²: from below, from above, and turned further.

    A limit analysis has no answer here: equilibrium alone lets the pressure of an interference be as large as it likes.
    """
    limit, sectors = FULL_SLIP, 4 if quick else 6
    below = solve(gallery.press_fit_torque(0.2, 0.9999 * limit, sectors=sectors), degree=p)
    rows = Check(certified(below), "2π μ p R², p = 59.927 MPa by Lamé for a hollow shaft; 0.9999 of it applied", 1e-9)
    yield rows.relative("torque carried [N mm/mm]", _torque(below), 0.9999 * limit)
    sliding = solve(gallery.press_fit_torque(0.2, turn=0.01, sectors=sectors), degree=p)
    rows = Check(certified(sliding))
    source = "2π μ p R²; the bore is turned until all of the fit slips"
    yield rows.relative("torque in full slip [N mm/mm]", _torque(sliding), limit, source, tolerance=1e-4)
    yield rows.absolute("part that slips [-]", sliding.contacts["shaft"].shares["slip"], 1.0, "all of it")
    if not quick:
        above = solve(gallery.press_fit_torque(0.2, 1.001 * limit), degree=p)
        rows = Check(by_hand(not above.certificate.passed, "no certificate"), "1.001 of the limit applied")
        yield rows.word("a larger torque", "solved" if certified(above).passed else "not solved", "not solved")
        half = solve(gallery.press_fit_torque(0.2, 0.5 * limit, sectors=6), degree=p)
        yield from two_models(quick, half, "shaft", 1e-4, 1e-4)


def _torque(result: ContactResult) -> float:
    """Size of the moment of the shear about the origin, around which the line is closed [stress × length²]."""
    line = result.contacts["shaft"]
    return float(abs(line.weights @ (line.tangential_stress * np.hypot(line.x, line.y))))


@BENCHMARKS("cylinder-in-bore-friction", 4)
def klang(p: int, quick: bool) -> Iterator[Row]:
    """The cylinder in a bore with μ = 0.4: Klang's problem, Code_Aster's SSNV127, whose curve was digitised.

    The answer depends on the steps of the load, since the contact grows and what has moved before it touches counts as
    slip. With more and more steps it settles: in 10, 20, 40 the mean pressure near the load is 18.55, 18.72 and
    18.81 MPa, and from 2 on the bore slips from about 40°. In one step it slips from about 6°. Print, which does not
    say how its load grew, has 17.8 MPa and slip from 33°, both in between.
    """
    for count in (1,) if quick else (1, 10):
        shares, steps = np.linspace(0.0, 1.0, count + 1)[1:], f"load in {count} step{'s' if count > 1 else ''}"
        history = solve_history([gallery.cylinder_in_bore(8, 0.4, share=float(share)) for share in shares], degree=p)
        line = history.steps[-1].contacts["bore"]
        theta = np.rad2deg(np.arctan2(line.y, line.x))
        rows = Check(both(*map(certified, history.steps)), kind=Kind.PUBLISHED)
        near = np.where(np.abs(theta) < 15.0, line.weights, 0.0)
        ours, source = -(near @ line.normal_stress) / near.sum(), f"Klang; digitised, {steps}: only 8 % are asked for"
        yield rows.relative("mean pressure, 0° to 15° [MPa]", ours, 17.8, source, tolerance=0.08)
        sticks = float(theta[line.state == ContactState.STICK].max(initial=0.0))
        source = "Klang; digitised: in one step of the load the bore slips nearer to the load, in many farther off"
        between = rows.at_most if count == 1 else rows.at_least
        yield between(f"angle up to which the bore sticks, {steps} [°]", sticks, 33.0, source)
        if count == 1:
            yield from two_models(quick, history.steps[-1], "bore", 1e-3, 1e-2)


@BENCHMARKS("conservation", 4)
def conservation(p: int, quick: bool) -> Iterator[Row]:
    """Every body of these problems: the resultant of its weight and the tractions around it."""
    for name in _QUICK if quick else _IN_BALANCE:
        result = solve(_IN_BALANCE[name](), degree=p)
        rows, quantity = Check(certified(result), "equilibrium", BALANCE), "largest force or moment left on a body"
        yield rows.absolute(f"{name}: {quantity}, over the forces around it", left_by_stresses(result), 0.0)


def _example(name: str) -> Callable[[], ContactProblem]:
    return lambda: read_example(name).problem


_IN_BALANCE: Final[dict[str, Callable[[], ContactProblem]]] = {
    "rings": partial(gallery.rings, 8, 1e5), "press fit": partial(gallery.press_fit, 8, 0.2),
    "torque on a press fit": partial(gallery.press_fit_torque, 0.2, turn=0.01),
    "bore": partial(gallery.cylinder_in_bore, 8), "bore with friction": partial(gallery.cylinder_in_bore, 8, 0.4),
    "loaded pin": partial(gallery.loaded_pin, 8), "sticking block": partial(gallery.block_corner, None, 2),
    "sliding block": partial(gallery.block_corner, 0.3, 2),
    "cylinder on block": partial(gallery.cylinder_on_block, 0.01, 4, 2),
    "half discs": partial(gallery.half_discs, 0.01, 4, 2),
    "wedge": _example("wedge"), "oblique block": partial(oblique, 0.99), "gravity dam": _example("gravity_dam"),
    "column under its weight": _example("gravity_column"), "dry-stone wall": _example("dry_stone_wall"),
    "SSNV128": _example("ssnv128"), "compressed plate": _example("compressed_plate"), "lug": _example("lug"),
    "masonry wall": _example("masonry_wall"), "jointed slope": _example("jointed_slope"),
}  # fmt: skip
"""Name → a published benchmark, or a problem file with weight or a pin."""

_QUICK: Final = ("rings", "sliding block", "wedge", "column under its weight", "masonry wall")
