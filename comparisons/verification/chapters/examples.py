"""Chapter on the problem files of the folder examples."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from comparisons.settled import SETTLED
from comparisons.settled import SOURCE as DISPLACEMENT_CODES
from comparisons.verification.chapters.ssnv128 import SOURCE as CODE_ASTER
from comparisons.verification.chapters.ssnv128 import TANGENTIAL_FORCE
from comparisons.verification.elements import BOTH, QUINTIC, TRIANGLES, Chapter, Element
from comparisons.verification.exhibits import Curve, Graph, M, shown
from comparisons.verification.measures import edge_states, ellipse, runs, traction_difference, value_at
from comparisons.verification.proof import Proof, both, bounded, by_hand, certified, certified_companion, infeasible
from comparisons.verification.row import Kind, Row, absolute, at_least, at_most, enclosed, relative, word
from comparisons.verification.two_models import curves_of_both, two_models
from qvi_contact import (
    ContactProblem,
    ContactResult,
    History,
    InputError,
    ProblemFile,
    RectilinearMesh,
    TriangleMesh,
    load_problem,
    loop_area,
)
from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.companion import CompanionResult, solve_companion
from solvers import Status

PROBLEMS: Final = Chapter()

FOLDER: Final = Path(__file__).resolve().parents[3] / "examples"
_BALANCE: Final = 1e-9
_OTHER_METHOD: Final = "qp:clarabel"
_DRAG: Final = ("drag",)


@PROBLEMS.on("examples/block_with_hole", *BOTH)
def block_with_hole(element: Element, quick: bool) -> Iterator[Row]:
    """A block with a free hole under a plate: nothing acts on the hole, top and bottom carry the same."""
    result = _solved(element, "block_with_hole")
    plate, proof = result.contacts["plate"], certified(result)
    force = plate.normal_force
    for edges in ("hole floor", "hole roof"):
        ours = result.resultant(edges).y / force
        yield absolute(f"force on {edges} over N", ours, 0.0, _BALANCE, "the hole is free", proof)
    bottom = result.resultant("block bottom").y
    yield relative("N [N/mm]", force, bottom, _BALANCE, "balance of plate and bottom", proof)
    yield absolute("T over N", plate.tangential_force / force, 0.0, 1e-8, "symmetry in x", proof)
    stiffest = 3e4 / (1.0 - 0.25**2) * 1e-3
    source = "E U/(1 − ν²), the whole block held sideways; a hole makes it softer"
    yield at_most("N [N/mm]", force, stiffest, 0.0, source, proof)
    yield from _by_another_method(element, result, "plate", quick)
    yield from _by_displacements(quick, result, "plate", 0.02)


@PROBLEMS.on("examples/bolted_angle", TRIANGLES)
def bolted_angle(element: Element, _: bool) -> Iterator[Row]:
    """An angle bolted to a wall: forces, centre of pressure, and the load at which it slides."""
    result = _solved(element, "bolted_angle")
    wall, proof = result.contacts["wall"], certified(result)
    yield relative("N [N/mm]", wall.normal_force, 400.0, _BALANCE, "force of the bolt", proof)
    yield relative("T [N/mm]", wall.tangential_force, 100.0, _BALANCE, "load", proof)
    centre = -float(wall.weights @ (wall.y * wall.normal_stress)) / wall.normal_force
    yield relative("centre of pressure y [mm]", centre, 40.0, 1e-8, "60 - 80 F/B, moments", proof)
    yield from _from_both_sides(element, "bolted_angle", "load", 1.6, "μB/F")


@PROBLEMS.on("examples/bracket", *BOTH, few=1)
def bracket(element: Element, quick: bool) -> Iterator[Row]:
    """An L on rough ground: forces and their centre by statics alone."""
    result = _solved(element, "bracket")
    line, proof = result.contacts["ground"], certified(result)
    yield relative("N [MN/m]", line.normal_force, 10.0, _BALANCE, "load on the roof, balance", proof)
    yield relative("T [MN/m]", line.tangential_force, -3.0, _BALANCE, "wind, balance", proof)
    centre = -float(line.weights @ (line.x * line.normal_stress)) / line.normal_force
    source = "(10 · 0.5 + 3 · 1.5)/10, balance of moments"
    yield relative("centre of pressure x [m]", centre, 0.95, _BALANCE, source, proof)
    yield from _by_another_method(element, result, "ground", quick)


@PROBLEMS.on("examples/brake_pad", TRIANGLES)
def brake_pad(element: Element, _: bool) -> Iterator[Row]:
    """A brake pad in full slip: friction force and centre of pressure by statics."""
    result = _solved(element, "brake_pad")
    face, proof = result.contacts["face"], certified(result)
    yield relative("T [N/mm]", face.tangential_force, 64.0, 1e-6, "μ N in full slip", proof)
    centre = -float(face.weights @ (face.x * face.normal_stress)) / face.normal_force
    yield relative("centre of pressure x [mm]", centre, 34.2, 1e-6, "balance of moments", proof)


@PROBLEMS.on("examples/compressed_plate", *BOTH)
def compressed_plate(element: Element, quick: bool) -> Iterator[Row]:
    """The paper's plate on 16 × 16 graded cells, against displacement codes and another method."""
    result = _solved(element, "compressed_plate")
    force, proof = result.contacts["plate"].normal_force, certified(result)
    source = f"{DISPLACEMENT_CODES}; the mesh is coarse"
    yield relative("N [N/mm]", force, SETTLED[0.2], 1e-3, source, proof, Kind.EXTERNAL)
    yield from _by_another_method(element, result, "plate", quick)
    yield from _by_displacements(quick, result, "plate", 1e-3)


@PROBLEMS.on("examples/cyclic_shear", *BOTH, few=1)
def cyclic_shear(element: Element, _: bool) -> Iterator[Row]:
    """A block sheared to and fro: the second cycle repeats the first, and what is lost is the area of the loop."""
    file = _file("cyclic_shear")
    # at Gauss points nothing opens; a Bernstein coefficient in the toe does, and then pressure does work between steps
    history = element.solve_history(file.problems, contact_rows="gauss", **file.solve_options)
    proof, times = _certified_history(history), np.array(file.times)
    motion, force = history.loop("ground")
    normal = np.array([step.contacts["ground"].normal_force for step in history.steps])
    excess = float((np.abs(force) - 0.3 * normal).max() / normal.max())
    yield at_most("largest |T| − μN over N", excess, 0.0, 1e-9, "|T| ≤ μN", proof)
    second, first = times > 1.0, (times > 0.0) & (times <= 1.0)
    error = float(np.abs(force[second] - force[first]).max() / normal.max())
    source = "a cyclic state repeats itself after the first loading"
    yield absolute("largest difference of T between the cycles, over N", error, 0.0, 1e-6, source, proof)
    around = np.flatnonzero(times >= 1.0)
    area, work = loop_area(motion[around], force[around]), float(history.friction_work[around[1:]].sum())
    quantity = "work of friction in the second cycle [N mm/mm]"
    yield relative(quantity, work, area, 1e-6, "area of the loop ∮T dw, balance of energy", proof)


@PROBLEMS.on("examples/cylinder_on_block", TRIANGLES)
def cylinder_on_block(element: Element, _: bool) -> Iterator[Row]:
    """A cylinder on a block: NAFEMS R0094-1 with a hundredth of its force, against Hertz."""
    result = _solved(element, "cylinder_on_block")
    line, source, proof = result.contacts["contact"], "Hertz; half planes, a/R = 0.012", certified(result)
    peak, half_width = ellipse(line.x, -line.normal_stress)
    yield relative("peak pressure [MPa]", peak, 358.536, 2e-4, source, proof)
    yield relative("half-width [mm]", half_width, 0.62146, 2e-4, source, proof)


@PROBLEMS.on("examples/dragged_block_holds", *BOTH, few=1)
def dragged_block_holds(element: Element, _: bool) -> Iterator[Row]:
    """A block at 0.99 of what friction can carry: balance, and the limit load factor."""
    file = _file("dragged_block_holds")
    result = element.solve(file.problem, **file.solve_options)
    line, proof = result.contacts["base"], certified(result)
    yield relative("N [MN/m]", line.normal_force, 20.0, _BALANCE, "p w, balance", proof)
    yield relative("T [MN/m]", line.tangential_force, -9.9, _BALANCE, "−T w, balance", proof)
    limit = element.limit_load(file.problem, _DRAG)
    yield relative("limit load factor", limit.lower, 1.0 / 0.99, 1e-6, "μp/T", bounded(limit))


@PROBLEMS.on("examples/dragged_block_slides", *BOTH, few=1)
def dragged_block_slides(element: Element, _: bool) -> Iterator[Row]:
    """The same block at 1.01 of the limit: infeasible, with a proof."""
    file = _file("dragged_block_slides")
    result = element.solve(file.problem, **file.solve_options)
    status, proof = result.status.value, infeasible(result)
    yield word("status", status, "infeasible", "T > μp", proof)
    limit = element.limit_load(file.problem, _DRAG)
    yield relative("limit load factor", limit.lower, 1.0 / 1.01, 1e-6, "μp/T", bounded(limit))


@PROBLEMS.on("examples/dry_stone_wall", *BOTH, few=1)
def dry_stone_wall(element: Element, quick: bool) -> Iterator[Row]:
    """A wall of three courses: every bed carries load and weight above it."""
    result = _solved(element, "dry_stone_wall")
    proof = certified(result)
    for bed, weight in (("upper bed", 162.0), ("lower bed", 234.0), ("ground", 306.0)):
        force = result.contacts[bed].normal_force
        source = "3 (30 + 24 h), balance of what lies above"
        yield relative(f"N of {bed} [kN/m]", force, weight, _BALANCE, source, proof)
        shear = result.contacts[bed].tangential_force / weight
        yield absolute(f"T of {bed} over N", shear, 0.0, _BALANCE, "balance in x", proof)
    yield from _by_displacements(quick, result, "head 1", 5e-3)


@PROBLEMS.on("examples/gravity_column", *BOTH, few=1)
def gravity_column(element: Element, quick: bool) -> Iterator[Row]:
    """A column under its own weight: its weight, symmetry, and uniform pressure away from the ends (Saint-Venant)."""
    result = _solved(element, "gravity_column")
    line, proof = result.contacts["ground"], certified(result)
    yield relative("N [N/m]", line.normal_force, 98100.0, _BALANCE, "ρ g w h", proof)
    yield absolute("T over N", line.tangential_force / 98100.0, 0.0, _BALANCE, "symmetry in x", proof)
    middle = float(result.stress(0.5, 2.0)[1])
    source = "−ρ g (h − y), two widths above the ground"
    yield relative("σ_yy at mid-height [Pa]", middle, -49050.0, 1e-3, source, proof)
    yield from _by_another_method(element, result, "ground", quick)


@PROBLEMS.on("examples/gravity_dam", TRIANGLES)
def gravity_dam(element: Element, quick: bool) -> Iterator[Row]:
    """A dam on rock with uplift in its base joint: forces, and the factor of safety against sliding from both sides."""
    result = _solved(element, "gravity_dam")
    joint, proof = result.contacts["base"], certified(result)
    weight, uplift, thrust = 10.44, 0.00981 * 28.0 * 12.0, 0.00981 * 28.0**2 / 2.0
    yield relative("effective N [MN/m]", joint.effective_normal_force, weight - uplift, _BALANCE, "W - U", proof)
    yield relative("T [MN/m]", joint.tangential_force, thrust, _BALANCE, "H = γ h²/2", proof)
    factor = 0.75 * (weight - uplift) / thrust
    yield from _from_both_sides(element, "gravity_dam", "thrust", factor, "μ (W - U)/H, factor of sliding")
    yield from two_models(quick, result, "base", 1e-9, 1e-4)


@shown("examples/gravity_dam", lambda: replace(file_problem("gravity_dam"), mesh=_dam_mesh()), M)
def _dam_graph(_: bool) -> Graph:
    """Effective pressure, shear and uplift in the base of the dam."""
    values = {
        "effective pressure": lambda line: -line.normal_stress - _uplift(line.x),
        "shear": lambda line: np.abs(line.tangential_stress),
    }
    ours, known = curves_of_both(file_problem("gravity_dam"), "base", lambda line: line.x, values)
    return Graph("x [m]", "traction [MPa]", ours, (*known, Curve("uplift", ours[0].x, _uplift(ours[0].x))))


def _uplift(x: FloatArray) -> FloatArray:
    """The pressure of water in the joint [MPa], which falls from the full head to zero."""
    return 0.00981 * 28.0 * (1.0 - x / 24.0)


def _dam_mesh() -> TriangleMesh:
    """The dam of the file and the rock below it, on few triangles."""
    x = np.array([-30.0, -15.0, 0.0, 8.0, 16.0, 24.0, 39.0, 54.0])
    y = np.array([-25.0, -12.0, 0.0, 9.5, 19.0, 28.0, 30.0])
    middle_x, middle_y = (x[1:] + x[:-1]) / 2.0, (y[1:] + y[:-1]) / 2.0
    body = (middle_y < 0.0)[:, None] | ((middle_x > 0.0) & (middle_x < 24.0))[None]
    whole = TriangleMesh.of_rectangles(RectilinearMesh(x, y, body))
    above = np.maximum(whole.vertices[:, 1], 0.0) / 30.0
    vertices = np.column_stack([whole.vertices[:, 0] * (1.0 - above * 19.0 / 24.0), whole.vertices[:, 1]])
    mesh = TriangleMesh(vertices, whole.cells).with_joint("base", lambda x, y: (y == 0.0) & (x > 0.0) & (x < 24.0))
    named: dict[str, Callable[[FloatArray, FloatArray], BoolArray]] = {
        "upstream": lambda x, y: (x == 0.0) & (y > 0.0) & (y < 28.0),
        "freeboard": lambda x, y: (x == 0.0) & (y > 28.0),
        "crest": lambda _, y: y == 30.0,
        "downstream": lambda x, y: (x > 0.0) & (y > 0.0) & (y < 30.0),
        "reservoir floor": lambda x, y: (x < 0.0) & (y == 0.0),
        "rock downstream": lambda x, y: (x > 24.0) & (y == 0.0),
        "rock left": lambda x, _: x == -30.0,
        "rock right": lambda x, _: x == 54.0,
        "underground": lambda _, y: y == -25.0,
    }
    for name, edges in named.items():
        mesh = mesh.with_edges(name, edges)
    return mesh


@PROBLEMS.on("examples/half_discs", TRIANGLES)
def half_discs(element: Element, _: bool) -> Iterator[Row]:
    """Two half discs with partial slip, against Hertz and Cattaneo."""
    result = _solved(element, "half_discs")
    line, proof = result.contacts["contact"], certified(result)
    peak, half_width = ellipse(line.x, -line.normal_stress)
    source = "half planes, a/R = 0.085"
    yield relative("peak pressure [MPa]", peak, 9.351351, 0.01, f"Hertz; {source}", proof)
    yield relative("half-width [mm]", half_width, 0.680778, 0.01, f"Hertz; {source}", proof)
    middle = float(np.abs(line.tangential_stress)[np.argmin(np.abs(line.x))])
    known = 0.2 * 9.351351 * (1.0 - 0.496511 / 0.680778)
    yield relative("shear in the middle [MPa]", middle, known, 0.03, f"Cattaneo; {source}", proof)


@PROBLEMS.on("examples/jointed_slope", TRIANGLES)
def jointed_slope(element: Element, _: bool) -> Iterator[Row]:
    """A jointed slope pushed by water in its crack slides on its lowest bedding plane."""
    crack = _solved(element, "jointed_slope")
    yield relative("thrust [kN/m]", crack.resultant("crack").x, -80.0, _BALANCE, "γ_w z²/2", certified(crack))
    weight = 25.0 * 28.0 * np.sqrt(3.0)  # 28 √3 m² lie above the plane
    factor = weight * np.tan(np.arctan(0.7) - np.pi / 6.0) / 80.0
    yield from _from_both_sides(element, "jointed_slope", "water", factor, "W tan(φ - β)/V, plane failure")


@PROBLEMS.on("examples/lug", TRIANGLES)
def lug(element: Element, quick: bool) -> Iterator[Row]:
    """A lug pulled by a rigid pin: the force goes through the bore, and both models move the pin as far."""
    result = _solved(element, "lug")
    held, proof, source = result.resultant("held"), certified(result), "force of the pin, balance"
    yield relative("force where it is held [N/mm]", held.x, -4000.0, 1e-12, source, proof)
    yield absolute("force across, over the pin's", held.y / 4000.0, 0.0, 1e-12, source, proof)
    moved = result.plates["bore"].x
    displacements = _displacements(result.problem, quick)
    proof, source = both(proof, certified_companion(displacements)), "displacement elements on the same mesh"
    theirs = displacements.plates["bore"].x
    yield relative("displacement of the pin [mm]", moved, theirs, 1e-3, source, proof, Kind.METHODS)


@PROBLEMS.on("examples/masonry_wall", TRIANGLES)
def masonry_wall(element: Element, _: bool) -> Iterator[Row]:
    """A masonry wall with openings: forces on the ground, and a limit of the wind that both sides enclose."""
    result = _solved(element, "masonry_wall")
    ground, proof = result.contacts["ground"], certified(result)
    yield relative("N of ground [kN/m]", ground.normal_force, 98.75, _BALANCE, "weight, balance", proof)
    yield relative("T of ground [kN/m]", ground.tangential_force, -4.0, _BALANCE, "p h, balance", proof)
    limit = element.limit_load(result.problem, ["wind"])
    source = "motion of rigid blocks on the same joints"
    quantity = "limit load factor, from below"
    yield at_most(quantity, limit.lower, limit.upper, 0.0, source, bounded(limit), Kind.METHODS)
    source = f"0.92 of the {source}"
    yield at_least(quantity, limit.lower, 0.92 * limit.upper, 0.0, source, bounded(limit), Kind.METHODS)


@PROBLEMS.on("examples/punch", *BOTH, few=1)
def punch(element: Element, quick: bool) -> Iterator[Row]:
    """A rigid flat punch on a block: balance, symmetry, and the half-plane's pressure away from the edges."""
    result = _solved(element, "punch")
    line, proof = result.contacts["punch"], certified(result)
    yield relative("N [N/mm]", line.normal_force, 100.0, _BALANCE, "force on the punch", proof)
    uneven, source = (
        (1e-3, "symmetry in x; diagonals of the cells are not")
        if element.has_triangles
        else (_BALANCE, "symmetry in x")
    )
    yield absolute("T over N", line.tangential_force / 100.0, 0.0, uneven, source, proof)
    moment = float(line.weights @ (line.x * line.normal_stress)) / 100.0
    yield absolute("centre of pressure x [mm]", moment, 0.0, uneven, source, proof)
    middle = -value_at(line, line.normal_stress, 0.0)
    source = (
        "P/(π a), Johnson, Contact Mechanics, section 2.8; frictionless half-plane, 8 % for a block 20 times as wide"
    )
    yield relative("pressure in the middle [MPa]", middle, 100.0 / np.pi, 0.08, source, proof)
    source = "displacements on lines 0.01 apart; an element of 0.05 to 0.2 holds the end of stick"
    yield absolute("share that sticks", line.shares["stick"], 0.775, 0.05, source, proof, Kind.METHODS)
    yield from _by_another_method(element, result, "punch", quick, form="condensed")
    companion = _displacements(result.problem, quick)
    moved, known = result.plates["punch"].y, companion.plates["punch"].y
    proof, quantity = (
        both(proof, certified_companion(companion)),
        "motion of the punch [mm], stress against displacement",
    )
    yield relative(quantity, moved, known, 0.02, "displacement model on the same mesh", proof, Kind.METHODS)


@PROBLEMS.on("examples/ssnv128", *BOTH, few=1)
def ssnv128(element: Element, quick: bool) -> Iterator[Row]:
    """SSNV128 on 32 × 32 cells."""
    result = _solved(element, "ssnv128")
    base, proof = result.contacts["base"], certified(result)
    yield relative("N [Pa m]", base.normal_force, 2e6, _BALANCE, "p a, balance", proof)
    force, source = base.tangential_force, "biquadratic displacement elements; ± 5 N/m"
    yield relative("T [Pa m]", force, TANGENTIAL_FORCE, 2e-3, source, proof, Kind.EXTERNAL)
    point_a = value_at(base, base.slip, 0.0)
    yield relative("u_x at point A [m]", point_a, 2.86e-5, 0.05, f"{CODE_ASTER}; ± 5 %", proof, Kind.PUBLISHED)
    yield word("zones from the left", runs(edge_states(base)), "open, slip, stick", source, proof, Kind.EXTERNAL)
    yield from _by_displacements(quick, result, "base", 1e-3, shear=True)


@PROBLEMS.on("examples/stacked_blocks", *BOTH, few=1)
def stacked_blocks(element: Element, quick: bool) -> Iterator[Row]:
    """Three blocks: every joint hands on what acts on the top, and holds it."""
    result = _solved(element, "stacked_blocks")
    top, proof = result.resultant("top"), certified(result)
    for joint in ("lower", "upper"):
        line = result.contacts[joint]
        source = "force on the top, balance of the blocks above"
        yield relative(f"N of {joint} [MN/m]", line.normal_force, -top.y, _BALANCE, source, proof)
        yield relative(f"T of {joint} [MN/m]", line.tangential_force, top.x, _BALANCE, source, proof)
    yield from _by_another_method(element, result, "lower", quick)
    yield from _by_displacements(quick, result, "lower", 5e-3, shear=True)


@PROBLEMS.on("examples/trapezoid", QUINTIC)
def trapezoid(element: Element, _: bool) -> Iterator[Row]:
    """A trapezoid on a plane that holds it: bounds of the force hold what a displacement code finds."""
    result = _solved(element, "trapezoid")
    bounds, proof = result.bracket.forces["base.normal_force"], certified(result)
    source = "NGSolve, degree 12, mesh graded to the corners"
    yield from enclosed("P, {} [MN/m]", bounds, 14.0483793, 0.0, source, proof, Kind.EXTERNAL)


@PROBLEMS.on("examples/wedge", TRIANGLES)
def wedge(element: Element, _: bool) -> Iterator[Row]:
    """A block pushed up a slope: NAFEMS CGS-4."""
    source = "F/G = (tan α + μ)/(1 - μ tan α), 0.99 of it applied"
    yield from _from_both_sides(element, "wedge", "push", 1.0 / 0.99, source)


@PROBLEMS.named("examples/all")
def every_file(_: bool) -> Iterator[Row]:
    """No problem file is left out of this chapter."""
    found = sorted(path.stem for path in FOLDER.glob("*.toml"))
    known = [name.removeprefix("examples/") for name in PROBLEMS if name != "examples/all"]
    proof = by_hand(bool(found), "folder read")
    yield word("files", ", ".join(found), ", ".join(known), "the folder examples", proof)


def _file(name: str) -> ProblemFile:
    if not FOLDER.is_dir():
        raise InputError("examples", "the folder examples", "run this in a checkout of the repository")
    return load_problem(FOLDER / f"{name}.toml")


def file_problem(name: str) -> ContactProblem:
    """The problem of the file of this name."""
    return _file(name).problem


def _solved(element: Element, name: str) -> ContactResult:
    """The file's problem with its own options, but for the element."""
    file = _file(name)
    options = {option: value for option, value in file.solve_options.items() if option not in element.options}
    return element.solve(file.problem, **options)


def _from_both_sides(element: Element, name: str, load: str, factor: float, source: str) -> Iterator[Row]:
    """The limit load factor of a file, by the mesh and by a mechanism."""
    limit = element.limit_load(_file(name).problem, [load])
    proof = bounded(limit)
    yield relative("limit load factor, from below", limit.lower, factor, 1e-6, source, proof)
    yield relative("limit load factor, from above", limit.upper, factor, _BALANCE, source, proof)


def _displacements(problem: ContactProblem, quick: bool) -> CompanionResult:
    """Displacements on the same mesh, of the degree that goes with the element; in quick runs of degree 2."""
    return solve_companion(problem, degree=2 if quick else None)


def _certified_history(history: History) -> Proof:
    every = both(*[certified(step) for step in history.steps])
    return every if history.status is Status.SOLVED else Proof(passed=False, text=f"failed, {history.status.value}")


def _by_another_method(
    element: Element, result: ContactResult, contact: str, quick: bool, form: str = "full"
) -> Iterator[Row]:
    """The fixed point with quadratic programs against the condensed interior point.

    They are in the full unknowns, unless the mesh is graded too strongly for the back end: `form`.
    """
    if quick:
        return
    other = element.solve(result.problem, inner=_OTHER_METHOD, form=form)
    unit = float(np.abs(other.contacts[contact].normal_stress).max())
    difference = traction_difference(result.contacts[contact], other.contacts[contact], unit)
    quantity = f"largest difference of tractions on {contact} over the largest pressure"
    unknowns = "the full unknowns" if form == "full" else "the tractions alone"
    source, proof = f"fixed point, {_OTHER_METHOD} in {unknowns}; ours: condensed", certified(result, other)
    yield absolute(quantity, difference, 0.0, 1e-5, source, proof, Kind.METHODS)


def _by_displacements(
    quick: bool, result: ContactResult, contact: str, tolerance: float, *, shear: bool = False
) -> Iterator[Row]:
    """Forces of displacements on the same mesh; the tolerance is what both models leave open."""
    companion = _displacements(result.problem, quick)
    proof = both(certified(result), certified_companion(companion))
    ours, theirs = result.contacts[contact], companion.contacts[contact]
    source = "displacement model on the same mesh"
    normal, quantity = theirs.normal_force, f"N of {contact}, stress against displacement model"
    yield relative(quantity, ours.normal_force, normal, tolerance, source, proof, Kind.METHODS)
    if shear:
        tangential, quantity = theirs.tangential_force, f"T of {contact}, stress against displacement model"
        yield relative(quantity, ours.tangential_force, tangential, tolerance, source, proof, Kind.METHODS)
