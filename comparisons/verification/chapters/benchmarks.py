"""Chapter on published problems of several bodies: rings, a press fit, pins in holes, the corner of a block."""

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from comparisons.verification import balance
from comparisons.verification.chapters import rollers
from comparisons.verification.chapters.limits import oblique
from comparisons.verification.chapters.rollers import persson
from comparisons.verification.elements import QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.exhibits import MM, SI, Curve, Graph, shown
from comparisons.verification.known import read_example
from comparisons.verification.measures import angles, degrees, mean_pressure
from comparisons.verification.proof import both, certified, certified_companion
from comparisons.verification.row import Kind, Row, absolute, at_least, relative
from comparisons.verification.two_models import curves_of_both, two_models
from qvi_contact import ContactLine, ContactProblem
from qvi_contact.gallery import (
    CORNER_EXPONENTS,
    block_corner,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    loaded_pin,
    persson_pressure,
    press_fit,
    press_fit_torque,
    rings,
)

PROBLEMS: Final = Chapter()

BALANCE: Final = 1e-12
"""Largest resultant on a body, over the forces on its edges, that is rounding."""

_BY_NGSOLVE: Final = {0.0: 0.758518, 0.1: 0.738677}
"""μ → u_x [mm] on the axis at the hole of `loaded_pin`, by NGSolve."""

_DEPTH: Final = 20  # how often triangles at a corner are halved
_NEAR: Final = (1e-5, 1e-3)  # distances from it within which the pressure is a power
_DRAWN: Final = (1e-5, 1e-2)  # those that are drawn


@PROBLEMS.on("rings", TRIANGLES, QUINTIC)
def lame_rings(element: Element, quick: bool) -> Iterator[Row]:
    """A ring in a ring under outer pressure, without friction (Code_Aster SSNP167): Lamé, and Michell for cos 2θ."""
    result = element.solve(rings(8, 1e5))
    joint, proof = result.contacts["joint"], certified(result)
    yield relative("mean pressure [Pa]", mean_pressure(joint), 9.2592593e6, 1e-6, "Lamé", proof)
    yield relative("amplitude of cos 2θ [Pa]", _second_harmonic(joint), 1.3571791e5, 1e-4, "Michell", proof)
    known = 9.2592593e6 + 1.3571791e5 * np.cos(2.0 * angles(joint))
    error = float(np.abs(-joint.normal_stress / known - 1.0).max())
    yield absolute("largest relative error of the pressure", error, 0.0, 5e-4, "Lamé and Michell, at all points", proof)
    yield from two_models(quick, result, "joint", 1e-5, 1e-6)


@shown("rings", lambda: rings(4), SI)
def _rings_graph(quick: bool) -> Graph:
    """The pressure between the rings has a constant part and one in cos 2θ."""
    line = TRIANGLES.solve(rings(4 if quick else 8, 1e5)).contacts["joint"]
    theta = np.linspace(0.0, 90.0)
    known = Curve("Lamé and Michell", theta, 9.2592593 + 0.13571791 * np.cos(2.0 * np.deg2rad(theta)))
    ours = Curve("stresses", degrees(line), -line.normal_stress / 1e6)
    return Graph("angle θ [°]", "pressure [MPa]", (ours,), (known,))


@PROBLEMS.on("press-fit", TRIANGLES, QUINTIC)
def fitted_shaft(element: Element, quick: bool) -> Iterator[Row]:
    """A shaft in a hub with an interference: Lamé, with friction as well, which symmetry leaves without work."""
    for friction in (0.0, 0.2):
        result = element.solve(press_fit(8, friction))
        shaft, proof = result.contacts["shaft"], certified(result)
        source = f"Lamé, E δ (b² − a²)/(2 a b²); μ = {friction:g}"
        yield relative("mean pressure [MPa]", mean_pressure(shaft), 61.8, 1e-5, source, proof)
        error = float(np.abs(shaft.normal_stress / 61.8 + 1.0).max())
        yield absolute("largest relative error of the pressure", error, 0.0, 1e-3, f"{source}; at all points", proof)
        yield from two_models(quick, result, "shaft", 1e-5, 1e-5)


@shown("press-fit", lambda: press_fit(2), MM)
def _fit_graph(quick: bool) -> Graph:
    """Stresses along a radius: constant in the shaft, of Lamé's form in the hub."""
    # radial and circumferential stress on the line θ = 45°
    result = TRIANGLES.solve(press_fit(4 if quick else 8, 0.2))
    radius = np.linspace(1.0, 49.0, 24)  # none is that of the fit
    xx, yy, xy = result.stress(radius / np.sqrt(2.0), radius / np.sqrt(2.0)).T
    fine = np.concatenate([np.linspace(0.0, 24.999), np.linspace(25.001, 50.0)])
    radial, around = (
        np.where(fine < 25.0, -61.8, 61.8 / 3.0 * (1.0 + sign * (50.0 / np.maximum(fine, 25.0)) ** 2))
        for sign in (-1.0, 1.0)
    )
    known = Curve("radial stress, Lamé", fine, radial), Curve("circumferential stress, Lamé", fine, around)
    ours = Curve("radial", radius, (xx + yy) / 2.0 + xy), Curve("circumferential", radius, (xx + yy) / 2.0 - xy)
    return Graph("radius [mm]", "stress [MPa]", ours, known)


@PROBLEMS.on("cylinder-in-bore", TRIANGLES, QUINTIC)
def bore(element: Element, quick: bool) -> Iterator[Row]:
    """A cylinder in the bore of a large plate, without friction: Persson's closed form."""
    result = element.solve(cylinder_in_bore(6 if quick else 12))
    line, proof = result.contacts["bore"], certified(result)
    source = "Persson; load spread over 1/50 of the radius"
    for name, low, high in (("0° to 15°", 0.0, 15.0), ("15° to 45°", 15.0, 45.0)):
        ours, known = _means(line, np.deg2rad(low), np.deg2rad(high))
        yield relative(f"mean pressure, {name} [MPa]", ours, known, 1e-3 if quick else 2e-4, source, proof)
    if element is TRIANGLES:
        yield from two_models(quick, result, "bore", 1e-3, 1e-3)


@shown("cylinder-in-bore", lambda: cylinder_in_bore(2, extent=2.0), MM)
def _bore_graph(quick: bool) -> Graph:
    """The pressure in the bore, and Persson's closed form."""
    line = TRIANGLES.solve(cylinder_in_bore(6 if quick else 12)).contacts["bore"]
    ours = Curve("stresses", degrees(line), -line.normal_stress).until(75.0)
    return Graph("angle θ from the load [°]", "pressure [MPa]", (ours,), (persson(),))


@PROBLEMS.on("loaded-pin", TRIANGLES, QUINTIC)
def pin(element: Element, quick: bool) -> Iterator[Row]:
    """A pin in the eye of a sheet, pulled (NAFEMS R0094-4): Code_Aster, and NGSolve on the same mesh."""
    for friction, known in list(_BY_NGSOLVE.items())[1 if quick else 0 :]:
        result = element.solve(loaded_pin(4 if quick else 12, friction))
        proof, ours = certified(result), -result.resultant("wall").x
        quantity = "force at the clamped end, half of the sheet [N/mm]"
        yield relative(quantity, ours, 1e4, 1e-9, f"balance; μ = {friction:g}", proof)
        source = f"NGSolve, displacements of degree 4 on 12 sectors, with multipliers; μ = {friction:g}"
        moved, tolerance = float(result.displacement(50.0, 0.0)[0]), 5e-4 if quick else 1e-4
        quantity = "u_x on the axis at the hole [mm]"
        yield relative(quantity, moved, known, tolerance, source, proof, Kind.EXTERNAL)
    source = (
        "Code_Aster SSNP156 B, elements of 8 nodes, small strain; 0.73617 with finite strain. A, of 4 nodes, 0.72092"
    )
    yield relative(quantity, moved, 0.73924, 2e-3, source, proof, Kind.PUBLISHED)
    source = (
        "the same; extrapolated to the node. A, of 4 nodes, -136.78. Shear changes its sign at this point, so that "
        "each mesh has another value, and only 5 % are asked for"
    )
    stress = float(result.stress(50.0, 0.0)[0])
    yield relative("σ_xx on the axis at the hole [MPa]", stress, -160.51, 0.05, source, proof, Kind.PUBLISHED)
    yield from two_models(quick, result, "pin", 2e-3, 1e-3)


@shown("loaded-pin", lambda: loaded_pin(4), MM)
def _pin_graph(quick: bool) -> Graph:
    """Pressure and shear around the pin by stresses and by displacements."""
    values = {"pressure": lambda line: -line.normal_stress, "shear": lambda line: line.tangential_stress}
    curves = curves_of_both(loaded_pin(4 if quick else 12), "pin", degrees, values)
    return Graph("angle θ from the load [°]", "traction [MPa]", *curves)


@PROBLEMS.on("corner-rates", TRIANGLES)
def sticking_corner(element: Element, quick: bool) -> Iterator[Row]:
    """A block that sticks to a large one: σ ~ r^(λ−1) in its corners makes energies converge like h^(2λ)."""
    for friction, name in ((None, "stuck"), (0.0, "without friction"))[: 1 if quick else 2]:
        results = [element.solve(block_corner(friction, cells)) for cells in ((1, 2, 4) if quick else (2, 4, 8))]
        energies = [result.energies.complementary for result in results]
        ours = float(np.log2((energies[0] - energies[1]) / (energies[1] - energies[2]))) / 2.0
        source = "Williams' eigenvalue problem; the rate of three uniform meshes"
        known, proof = CORNER_EXPONENTS[friction], certified(*results)
        yield relative(f"λ from the rate, {name}", ours, known, 0.03 if quick else 0.01, source, proof)
        yield from two_models(quick, results[-1], "base", 5e-3, 5e-3)


@shown("corner-rates", lambda: block_corner(None, 1))
def _rates_graph(quick: bool) -> Graph:
    """From mesh to mesh the energy changes by powers of h that the corners dictate."""
    # differences of the energies of uniform meshes, each half as coarse as the one before
    ours, known = [], []
    cells = np.array([1, 2, 4] if quick else [1, 2, 4, 8])
    for friction, name in ((None, "stuck"), (0.0, "without friction")):
        energies = [TRIANGLES.solve(block_corner(friction, int(count))).energies.complementary for count in cells]
        sizes, apart = 1.0 / cells[:-1], -np.diff(energies) / energies[-1]
        power = 2.0 * CORNER_EXPONENTS[friction]
        ours.append(Curve(f"{name}", sizes, np.abs(apart)))
        known.append(Curve(f"slope 2λ = {power:.4g}", sizes, np.abs(apart[-1]) * (sizes / sizes[-1]) ** power))
    return Graph("size of cells h [length]", "change of the energy [-]", tuple(ours), tuple(known), logarithmic=True)


@PROBLEMS.on("sliding-corner", TRIANGLES)
def sliding_corner(element: Element, quick: bool) -> Iterator[Row]:
    """The same block sliding: the pressure near the leading corner, on triangles halved towards it."""
    for friction in (0.0, 0.5) if quick else (0.0, 0.1, 0.3, 0.5):
        result = element.solve(block_corner(friction, 1, _DEPTH))
        ours, known = _exponent(result.contacts["base"]), CORNER_EXPONENTS[friction]
        source = "four digits of the eigenvalue problem; the slope of ln p over ln r"
        yield absolute(f"λ from the pressure, μ = {friction:g}", ours, known, 1e-3, source, certified(result))
        yield from two_models(quick, result, "base", 1e-2, 1e-2)


@shown("sliding-corner", lambda: block_corner(0.3, 1, 3))
def _corner_graph(quick: bool) -> Graph:
    """Near the corner the pressure is a power of the distance."""
    ours, known = [], []
    for friction in (0.0, 0.5) if quick else (0.0, 0.1, 0.3, 0.5):
        line = TRIANGLES.solve(block_corner(friction, 1, _DEPTH)).contacts["base"]
        away = 1.0 - line.x
        near = (away > _DRAWN[0]) & (away < _DRAWN[1])
        r, pressure, exponent = away[near], -line.normal_stress[near], CORNER_EXPONENTS[friction]
        ours.append(Curve(f"μ = {friction:g}", r, pressure))
        ends, middle = np.array(_DRAWN), int(np.argmin(np.abs(np.log(r / 1e-4))))
        known.append(
            Curve(f"slope λ − 1, λ = {exponent:.4f}", ends, pressure[middle] * (ends / r[middle]) ** (exponent - 1.0))
        )
    return Graph("distance from the corner r [length]", "pressure / E [-]", tuple(ours), tuple(known), logarithmic=True)


PROBLEMS.update(rollers.PROBLEMS)


@PROBLEMS.on("conservation", TRIANGLES)
def conservation(element: Element, quick: bool) -> Iterator[Row]:
    """Every body of these problems: the resultant of its weight and the tractions around it, by both models."""
    for name in _QUICK if quick else _IN_BALANCE:
        problem = _IN_BALANCE[name]
        result = element.solve(problem())
        ours, proof = balance.of_stresses(result), certified(result)
        quantity = f"{name}, stresses: largest force or moment left on a body, over the forces around it"
        yield absolute(quantity, ours, 0.0, BALANCE, "equilibrium", proof)
        if name in _BY_STRESSES_ALONE:
            continue
        companion = element.companion(problem(), 2 if quick else None)
        theirs, proof = balance.of_displacements(companion), both(proof, certified_companion(companion))
        source = "what stresses leave; C ε(v) on the same mesh leaves more"
        yield at_least(f"{name}, displacements: the same", theirs, ours, 0.0, source, proof, Kind.METHODS)


_IN_BALANCE: Final[dict[str, Callable[[], ContactProblem]]] = {
    "rings": lambda: rings(8, 1e5),
    "press fit": lambda: press_fit(8, 0.2),
    "torque on a press fit": lambda: press_fit_torque(0.2, turn=0.01),
    "bore": lambda: cylinder_in_bore(8),
    "bore with friction": lambda: cylinder_in_bore(8, 0.4),
    "loaded pin": lambda: loaded_pin(8),
    "sticking block": lambda: block_corner(None, 2),
    "sliding block": lambda: block_corner(0.3, 2),
    "cylinder on block": lambda: cylinder_on_block(0.01, 4, 2),
    "half discs": lambda: half_discs(0.01, 4, 2),
    "wedge": lambda: read_example("wedge").problem,
    "oblique block": lambda: oblique(0.99),
    "gravity dam": lambda: read_example("gravity_dam").problem,
    "column under its weight": lambda: read_example("gravity_column").problem,
    "dry-stone wall": lambda: read_example("dry_stone_wall").problem,
    "SSNV128": lambda: read_example("ssnv128").problem,
    "compressed plate": lambda: read_example("compressed_plate").problem,
    "lug": lambda: read_example("lug").problem,
    "masonry wall": lambda: read_example("masonry_wall").problem,
    "jointed slope": lambda: read_example("jointed_slope").problem,
}
"""Name → a published benchmark, or a problem file with weight or a pin."""

_QUICK: Final = ("rings", "sliding block", "wedge", "column under its weight", "masonry wall")

_BY_STRESSES_ALONE: Final = ("masonry wall", "jointed slope")
"""Many blocks, whose displacements cost a hundred times what their stresses do."""


def _second_harmonic(line: ContactLine) -> float:
    """Amplitude of cos 2θ in the pressure [stress]."""
    wave = np.cos(2.0 * angles(line))
    return float(-(line.weights @ (line.normal_stress * wave)) / (line.weights @ wave**2))


def _means(line: ContactLine, low: float, high: float) -> tuple[float, float]:
    """Mean pressure at the points between two angles, ours and Persson's [stress]."""
    theta = angles(line)
    weights = np.where((theta > low) & (theta < high), line.weights, 0.0)
    ours, known = ((weights @ pressure) / weights.sum() for pressure in (-line.normal_stress, persson_pressure(theta)))
    return float(ours), float(known)


def _exponent(line: ContactLine) -> float:
    """λ of p ~ r^(λ−1) near x = 1."""
    away = 1.0 - line.x
    near = (away > _NEAR[0]) & (away < _NEAR[1])
    return float(1.0 + np.polyfit(np.log(away[near]), np.log(-line.normal_stress[near]), 1)[0])
