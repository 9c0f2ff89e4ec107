"""The problems of the golden numbers: functions from a factor of the solver's tolerance to the numbers."""

from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from qvi_contact import (
    ContactResult,
    Corner,
    InputError,
    TriangleMesh,
    limit_load_factor,
    load_problem,
    paper,
    solve,
    solve_history,
)
from qvi_contact.gallery import (
    block_corner,
    compressed_plate,
    cylinder_in_bore,
    cylinder_on_block,
    half_discs,
    jointed_slope,
    loaded_pin,
    masonry_wall,
    press_fit,
    press_fit_torque,
    rings,
    sliding_block,
    ssnv128,
    stick_slip_block,
)
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, Traction
from qvi_contact.refinement import LimitFactor, refine
from solvers import FrictionQVI, solve_qvi

Numbers = dict[str, dict[str, float | int | str]]
"""Kind of quantity ("status", "iterations", "force", "stress", …) → name → number; numbers of a kind share a scale."""

Problem = Callable[[float], Numbers]

ROOT: Final = Path(__file__).resolve().parents[2]
EXAMPLES: Final = ROOT / "examples"
FILES: Final = Path(__file__).parent / "files"
TOLERANCE: Final = 1e-8
POINTS: Final = 1  # points inside the body whose stresses are stored
SLOW: Final = ("arch", "jointed_slope", "masonry_wall", "preloaded_joint")  # without brackets: slow, or none
CONTACTS: Final = 3  # contacts of a problem whose forces are stored


def numbers_of(result: ContactResult, *, bracket: bool = True) -> Numbers:
    """Status, iterations, forces, stresses at points, energies and bounds of a result."""
    found: Numbers = {"status": {"": result.status.value}, "iterations": {"": result.iterations}}
    if not result.has_state:
        return found
    force: dict[str, Any] = {}
    length: dict[str, Any] = {}
    stress: dict[str, Any] = {}
    for name, line in islice(result.contacts.items(), CONTACTS):
        force |= {f"{name}: N": line.normal_force, f"{name}: T": line.tangential_force}
        mean = line.weights / line.weights.sum()
        length |= {f"{name}: mean gap": mean @ line.gap, f"{name}: mean slip": mean @ line.slip}
        stress[f"{name}: largest pressure"] = -line.normal_stress.min()
    for name, motion in result.plates.items():
        length |= {f"{name}: plate {axis}": getattr(motion, axis) for axis in ("x", "y")}
    for number, (x, y) in enumerate(_inside(result), 1):
        stress |= dict(zip((f"point {number}: {c}" for c in ("xx", "yy", "xy")), result.stress(x, y), strict=True))
    energies = result.energies
    energy = {part: getattr(energies, part) for part in ("strain", "load", "dissipation")}
    if bracket:
        bounds = result.bracket
        energy |= {"bracket: lower": bounds.lower, "bracket: upper": bounds.upper}
        force |= {
            f"bracket: {name} {end}": getattr(both, end)
            for name, both in bounds.forces.items()
            for end in ("lower", "upper")
        }
    return found | {"force": force, "length": length, "stress": stress, "energy": energy}


def _inside(result: ContactResult) -> Iterator[tuple[float, float]]:
    """Random points of the body, near its contacts if it has any; they depend on its shape, not on its cells."""
    line = [np.column_stack((part.x, part.y)) for part in result.contacts.values()]
    points = np.concatenate(line or [result.problem.mesh.vertices])
    low, size = points.min(axis=0), max(np.ptp(points, axis=0))
    shares = np.random.default_rng(1992).uniform(-0.4, 1.4, (200, 2))
    found = 0
    for x, y in low + shares * size:
        try:
            result.stress(x, y)
        except InputError:
            continue
        yield float(x), float(y)
        found += 1
        if found == POINTS:
            return


def _solved(make: Callable[[], ContactProblem], *, bracket: bool = True, **options: Any) -> Problem:
    def numbers(share: float) -> Numbers:
        return numbers_of(solve(make(), tolerance=share * TOLERANCE, **options), bracket=bracket)

    return numbers


def _limit(make: Callable[[], ContactProblem], *loads: str) -> Problem:
    def numbers(_: float) -> Numbers:
        limit = limit_load_factor(make(), loads)
        return {"factor": {"lower": limit.lower, "upper": limit.upper}}

    return numbers


def _example(name: str) -> ContactProblem:
    return load_problem(EXAMPLES / f"{name}.toml").problem


def _file(path: Path, **options: Any) -> Problem:
    def numbers(share: float) -> Numbers:
        file = load_problem(path)
        options_now = dict(file.solve_options) | options | {"tolerance": share * TOLERANCE}
        if not file.times:
            quick = not any(word in path.stem for word in SLOW)
            return numbers_of(solve(file.problem, **options_now), bracket=quick)
        history = solve_history(file.problems, **options_now)
        found = numbers_of(history.steps[-1], bracket=False)
        found["energy"]["friction work"] = float(history.friction_work.sum())
        found["status"]["history"] = history.status.value
        return found

    return numbers


def _paper(friction: float) -> Problem:
    """P/2 of the paper's plate on its own element, by each kind of method."""

    def numbers(share: float) -> Numbers:
        plate = paper.plate(friction)
        step = 1e-5 / plate.displacement
        runs = {
            "condensed": {"method": "condensed"},
            "fixed point, qp": {"method": "fixed-point", "inner": "qp:clarabel"},
            "fixed point, socp": {"method": "fixed-point", "inner": "socp:clarabel"},
            "uzawa, 30": {"method": "uzawa", "omega_T": step, "iterations": 30},
            "uzawa, printed rule, 30": {"method": "uzawa", "omega_T": step, "iterations": 30, "rule": "printed"},
        }
        results = {name: solve_qvi(plate.qvi, tolerance=share * TOLERANCE, **options) for name, options in runs.items()}
        return {
            "status": {name: result.status.value for name, result in results.items()},
            "iterations": {name: result.iterations for name, result in results.items()},
            "force": {name: plate.force(result.z) for name, result in results.items()},
        }

    return numbers


def _graded_paper(share: float) -> Numbers:
    plate = paper.plate(0.2, (8, 8), width=1.5, grading=0.8, plane="strain")
    solution = solve_qvi(plate.qvi, tolerance=share * TOLERANCE)
    principal = plate.principal_stress(solution.z)[:2]
    return {
        "status": {"": solution.status.value},
        "iterations": {"": solution.iterations},
        "force": {"plate: N": plate.force(solution.z)},
        "stress": {"largest": float(np.abs(principal).max()), "excess": plate.excess_between_points(solution.z)},
    }


def _three_solutions(share: float) -> Numbers:
    """One contact point with three solutions: every method has to return the same one as before."""
    W, q = np.array([[1.0, 0.8], [0.8, 1.0]]), np.array([1.0, 2.1])
    K = np.linalg.inv(W)
    qvi = FrictionQVI.from_arrays(
        K=K, f=-K @ q, N=np.array([[1.0, 0.0]]), n0=np.zeros(1), T=np.array([[0.0, 1.0]]), t0=np.zeros(1),
        mu=np.array([2.0]), W=np.ones(1),
    )  # fmt: skip
    found: Numbers = {"status": {}, "iterations": {}, "force": {"load": float(np.linalg.norm(qvi.f))}}
    for method in ("condensed", "fixed-point", "pivoting"):
        solution = solve_qvi(qvi, method=method, tolerance=share * TOLERANCE)
        found["status"][method], found["iterations"][method] = solution.status.value, solution.iterations
        if solution.status.value == "solved":
            found["force"] |= {f"{method}: z{i}": float(value) for i, value in enumerate(solution.z)}
    return found


def _named_loads() -> ContactProblem:
    """Loads of which friction carries 0.5 to 1.5 times, with resultants of different sizes."""
    mesh = TriangleMesh.rectangle((2, 2), 1.0, 1.0)
    loads = [Traction("top", x=1.0, y=-10.0), Traction("left", x=-2.0, y=0.0), Traction("right", x=1.0, y=0.0)]
    return ContactProblem(mesh, Material(100.0, 0.3), [Contact("bottom", 0.05), *loads])


def _stick() -> ContactProblem:
    """A block that sticks on a coarse mesh and slips at its corners on a finer one."""
    corners = [Corner((0, 0), "bottom"), Corner((2, 0), "right"), Corner((2, 1), "top"), Corner((0, 1), "left")]
    mesh = TriangleMesh.outline(corners, 0.6).graded(np.array([[2.0, 1.0], [0.0, 1.0]]), 10)
    held = Displacement("top", x=0.0, y=-0.1)
    return ContactProblem(mesh, Material(1.0, 0.3), [Contact("bottom", 0.23), held, *_free("left", "right")])


def _bilateral() -> ContactProblem:
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    base = Contact("bottom", 0.3, law="bilateral", offset=1e-3)
    held = Displacement("top", x=Expression("1e-3*y"), y=Expression("1e-3*(x-1.13)"))
    return ContactProblem(mesh, Material(1e4, 0.2), [base, held, *_free("left", "right")])


def _arcs() -> ContactProblem:
    """A side that is an arc, on a stored mesh, since meshes differ between versions of Gmsh."""
    mesh = TriangleMesh.load(FILES / "arcs.msh").with_arc("t", (1.0, 0.2), float(np.hypot(1.0, 0.8)))
    load = Traction("t", normal=Expression("-1 - sin(3*x)"), tangential=0.0)
    held = Displacement("r", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(1e4, 0.3), [Contact("b", 0.3), held, *_free("l"), load])


def _free(*sides: str) -> list[Traction]:
    return [Traction(side, x=0.0, y=0.0) for side in sides]


def _refined(problem: Callable[[], ContactProblem], **options: Any) -> Problem:
    def numbers(_: float) -> Numbers:
        finer = refine(problem(), **options)
        found: Numbers = {"status": {"": finer.status.value}, "iterations": {"rounds": len(finer.rounds)}}
        return found | {"value": {"value": finer.value, "error": finer.error}}

    return numbers


def _plate(friction: float, cells: int = 4, **options: Any) -> Problem:
    return _solved(lambda: compressed_plate(friction, (cells, cells)), **options)


PROBLEMS: Final[Mapping[str, Problem]] = MappingProxyType(
    {f"paper: μ = {mu:.2f}": _paper(mu) for mu in (0.0, 0.05, 0.1, 0.2, 0.3)}
    | {"paper: graded": _graded_paper}
    | {f"plate: μ = {mu}": _plate(mu) for mu in (0.05, 0.2, 1.0)}
    | {
        "plate: degree 3": _plate(0.2, degree=3),
        "plate: degree 6": _plate(0.2, degree=6),
        "plate: Gauss points": _plate(0.2, law_on="points"),
        "plate: fixed point": _plate(0.2, method="fixed-point", bracket=False),
        "sliding block": _solved(lambda: sliding_block()[0]),
        "stick and slip": _solved(lambda: stick_slip_block(shear=20.0)[0]),
        "ssnv128": _solved(lambda: ssnv128((8, 8))),
        "rings": _solved(lambda: rings(4)),
        "press fit": _solved(lambda: press_fit(4)),
        "press fit: torque": _solved(lambda: press_fit_torque(0.2, turn=1e-4, sectors=2), bracket=False),
        "cylinder in bore": _solved(lambda: cylinder_in_bore(8), bracket=False),
        "loaded pin": _solved(lambda: loaded_pin(8), bracket=False),
        "block corner": _solved(lambda: block_corner(0.3, cells=3), bracket=False),
        "cylinder on block": _solved(cylinder_on_block, bracket=False),
        "half discs": _solved(lambda: half_discs(depth=3), bracket=False),
        "jointed slope": _solved(lambda: jointed_slope(4), bracket=False),
        "masonry wall": _solved(lambda: masonry_wall(4, 3, ()), bracket=False),
        "limit: masonry wall": _limit(lambda: masonry_wall(4, 3, ()), "wind"),
        "limit: jointed slope": _limit(lambda: jointed_slope(4), "water"),
        "limit: named loads": _limit(_named_loads, "left", "right"),
        "limit: bolted angle": _limit(lambda: _example("bolted_angle"), "load"),
        "limit: gravity dam": _limit(lambda: _example("gravity_dam"), "thrust"),
        "limit: dragged block": _limit(lambda: _example("dragged_block_holds"), "drag"),
        "sticks on a coarse mesh": _solved(_stick, degree=6),
        "bilateral": _solved(_bilateral),
        "bilateral: Gauss points": _solved(_bilateral, law_on="points"),
        "arcs: degree 3": _solved(_arcs, degree=3),
        "arcs: degree 4": _solved(_arcs, degree=4),
        "shrink fit": _file(FILES / "p1_shrink.toml"),
        "dovetail": _file(FILES / "p2_dovetail.toml"),
        "arch": _file(FILES / "p5_arch.toml"),
        "three solutions": _three_solutions,
        "refine: trapezoid": _refined(
            lambda: _example("trapezoid"), target=1e-3, quantity="base.normal_force", degree=5
        ),
        "refine: plate, guaranteed": _refined(
            lambda: compressed_plate(0.1, (2, 2)),
            target=1e-3, quantity="plate.normal_force", guaranteed=True,
        ),
        "refine: limit of named loads": _refined(
            _named_loads, target=1e-2, quantity=LimitFactor(["left", "right"]), max_rounds=2
        ),
    }
    | {f"example: {path.stem}": _file(path) for path in sorted(EXAMPLES.glob("*.toml"))}
)  # fmt: skip
