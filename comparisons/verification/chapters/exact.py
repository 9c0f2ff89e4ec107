"""Chapters on exact results: states in the element, manufactured friction, and invariance under transformations."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from typing import Any, Final

import numpy as np

from comparisons.verification.measures import point_states, runs, scattered, stress_error
from comparisons.verification.rows import Chapter, Check, Kind, Row, certified
from qvi_contact import ContactResult, TriangleMesh, solve
from qvi_contact.gallery import compressed_plate, sliding_block, stick_slip_block
from qvi_contact.gallery.exact import ExactState, cantilever, gravity_column, problem_from_state, pure_bending, uniform
from qvi_contact.problem import Contact, ContactProblem, Displacement, Expression, Material, Symmetry, Traction
from qvi_contact.types import Condition, FloatArray, Plane

EXACT, FRICTION, INVARIANCE = Chapter(), Chapter(), Chapter()

TOLERANCE: Final = 1e-9
TOLERANCE_WITH_FRICTION: Final = 1e-8
TOUCHING: Final = 1e-7  # where slip begins from zero at a loaded point, tractions are as accurate as √complementarity
_STRESS: Final = "largest error of σ at 60 points over the largest |σ|"
_SLIP: Final = "largest error of the slip over the largest slip"

_MESHES: Final = {"one cell": ((1, 1), 1.0), "3 × 2 cells": ((3, 2), 1.0), "5 × 4 cells graded by 0.4": ((5, 4), 0.4)}
_WIDTH, _HEIGHT, _LOW = 2.0, 1.0, -0.5


@EXACT("uniaxial-compression", 4)
def uniaxial_compression(p: int, quick: bool) -> Iterator[Row]:
    """Compressed without friction: σ_yy = −E' U / height, with E' = E in plane stress, E / (1 − ν²) in plane strain."""
    for where, cells, grading, plane in _cases(quick):
        result = solve(compressed_plate(0.0, cells, 2.0, plane=plane, grading=grading), degree=p)
        modulus = 2.09e5 if plane == "stress" else 2.09e5 / (1 - 0.3**2)
        rows, state = _rows(result, where), uniform(result.problem.material, yy=-1e-3 * modulus)
        force = result.contacts["plate"].normal_force
        yield rows.relative("force [stress length]", force, 2e-3 * modulus, "2 E' U")
        yield rows.absolute(_STRESS, stress_error(result, state), 0.0, "uniform")


@EXACT("side-traction", 4)
def side_traction_stops_slip(p: int, quick: bool) -> Iterator[Row]:
    """Compressed with the side traction that suppresses ε_xx (σ_xx = ν σ_yy in plane stress): no slip at any μ."""
    for (where, cells, grading, plane), friction in product(_cases(quick), (0.0, 0.2)):
        material = Material(2.09e5, 0.3, plane)
        side = 200.0 * float(material.compliance[0, 1] / material.compliance[0, 0])
        state = uniform(material, xx=side, yy=-200.0)
        gap = float(state.displacement(np.array(0.0), np.array(1.0))[1])
        sides: list[Condition] = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=side, y=0.0)]
        mesh = TriangleMesh.rectangle(cells, grading=grading)
        problem = ContactProblem(mesh, material, [*sides, Contact("top", friction, gap=gap, name="plate")])
        result = solve(problem, degree=p)
        rows, slip = _rows(result, f"uniform σ_xx, σ_yy; {where}, μ = {friction:g}"), result.contacts["plate"].slip
        yield rows.absolute(_STRESS, stress_error(result, state), 0.0)
        yield rows.absolute("largest |slip| over the compression", float(np.abs(slip).max()) / -gap, 0.0)


@EXACT("pure-bending", 4)
def bending(p: int, quick: bool) -> Iterator[Row]:
    """Pure bending by end tractions, σ_xx = m y: end moment m h³/12 and strain energy c11 m² h³ w / 24."""
    moment = ("moment on the right end [stress length²]", "right", "moment", -7.0 * _HEIGHT**3 / 12.0, "−m h³/12")
    energy = (lambda c: c[0, 0] * 49.0 * _HEIGHT**3 * _WIDTH / 24.0, "c11 m² h³ w / 24")
    yield from _states(p, quick, lambda m: pure_bending(m, 7.0), "σ_xx = m y", "tt tt tt uu", moment, energy)


@EXACT("cantilever", 4)
def timoshenko_cantilever(p: int, quick: bool) -> Iterator[Row]:
    """Cantilever loaded at its end with its exact end displacements, free at y = ±h/2: Timoshenko's solution."""
    slope, shear, book = 3.0, -3.0 * _HEIGHT**2 / 8.0, "Timoshenko and Goodier, Theory of Elasticity, art. 21"
    end = ("end force [stress length]", "right", "y", -shear * _HEIGHT - slope * _HEIGHT**3 / 24.0, "k h³/12")

    def energy(c: FloatArray) -> float:
        bent = c[0, 0] * slope**2 * _HEIGHT**3 * _WIDTH**3 / 72.0
        return float(bent + c[2, 2] * slope**2 * _HEIGHT**5 * _WIDTH / 240.0)

    yield from _states(p, quick, lambda m: cantilever(m, slope, shear), book, "tt uu tt uu", end,
                       (energy, "c11 k² h³ w³/72 + c33 k² h⁵ w/240"))  # fmt: skip


@EXACT("simple-shear", 4)
def simple_shear(p: int, quick: bool) -> Iterator[Row]:
    """Uniform shear τ by displacements of all sides: shear force τ w and strain energy c33 τ² h w / 2."""
    force = ("shear force on the top [stress length]", "top", "x", 10.0, "τ w")
    energy = (lambda c: c[2, 2] * 25.0 * _HEIGHT * _WIDTH / 2.0, "c33 τ² h w / 2")
    yield from _states(p, quick, lambda m: uniform(m, xy=5.0), "σ_xy = τ", "uu uu uu uu", force, energy)


@EXACT("column", 4)
def column(p: int, quick: bool) -> Iterator[Row]:
    """Column under its own weight, φ = ρ g y, held at the base: σ_yy = ρ g (y − h)."""
    weight = ("weight on the base [stress length]", "bottom", "y", 4.0 * _WIDTH * _HEIGHT, "ρ g h w")
    energy = (lambda c: c[0, 0] * 16.0 * _HEIGHT**3 * _WIDTH / 6.0, "c11 (ρ g)² h³ w / 6")
    yield from _states(p, quick, lambda m: gravity_column(m, 4.0, _LOW + _HEIGHT), "σ_yy = ρ g (y − h)", "uu tt tt tt",
                       weight, energy)  # fmt: skip


@EXACT("incompressible", 4)
def incompressible(p: int, _: bool) -> Iterator[Row]:
    """ν = ½ in plane strain, which stresses do not lock at: E' = 4 E / 3, a body of water in a box, and ν → ½."""

    def pressed(friction: float, poisson: float) -> ContactResult:
        return solve(compressed_plate(friction, (4, 4), 2.0, poisson=poisson, plane="strain"), degree=p)

    plate, known = pressed(0.0, 0.5), 2e-3 * 2.09e5 / 0.75
    quantity, force = "force on the frictionless plate [stress length]", plate.contacts["plate"].normal_force
    yield _rows(plate).relative(quantity, force, known, "2 E' U, E' = E / (1 − ν²)")
    # heavy, with a rough floor and wall, pressed by p = 2: σ = −(p + ρ g (h − y)) I
    sides: list[Condition] = [Traction("top", 0.0, -2.0), Symmetry("left"), Contact("right", 0.3, name="wall")]
    mesh, water = TriangleMesh.rectangle((3, 3)), Material(1000.0, 0.5, "strain")
    sides.append(Contact("bottom", 0.3, name="floor"))
    box = solve(ContactProblem(mesh, water, sides, body_potential=Expression("3 * y")), degree=p)
    force = box.contacts["wall"].normal_force
    yield _rows(box).relative("force on the wall [stress length]", force, 3.5, "p h + ρ g h²/2")
    results = [pressed(0.2, 0.5 - step) for step in (0.0, 2e-4, 1e-4)]
    force, *forces = (result.contacts["plate"].normal_force for result in results)
    rows = Check(certified(*results), "2 P(½ − δ) − P(½ − 2δ), δ = 1e-4", 1e-6, Kind.METHODS)
    yield rows.relative("force at μ = 0.2 [stress length]", force, 2.0 * forces[1] - forces[0])


def _rows(result: ContactResult, where: str = "", tolerance: float = TOLERANCE) -> Check:
    return Check(certified(result), where, tolerance)


def _cases(quick: bool) -> Iterator[tuple[str, tuple[int, int], float, Plane]]:
    """Meshes and planes of the plate: in words, cells, grading, plane."""
    planes: tuple[Plane, ...] = ("stress",) if quick else ("stress", "strain")
    for (name, (cells, grading)), plane in product(list(_MESHES.items())[2 if quick else 0 :], planes):
        yield f"{name}, plane {plane}", cells, grading, plane


def _states(
    p: int, quick: bool, state_of: Callable[[Material], ExactState], form: str, kinds: str,
    force: tuple[str, str, str, float, str], energy: tuple[Callable[[FloatArray], float], str],
) -> Iterator[Row]:  # fmt: skip
    """Stress, a resultant on a side, and energy on [0, 2] × [−½, ½], this by the compliances c.

    `kinds` say what of the state is given on bottom, right, top and left, see `problem_from_state`.
    """
    given = dict(zip(("bottom", "right", "top", "left"), kinds.split(), strict=True))
    for where, cells, grading, plane in _cases(quick):
        mesh = TriangleMesh.rectangle(cells, _WIDTH, _HEIGHT, origin=(0.0, _LOW), grading=grading)
        material = Material(1000.0, 0.3, plane)
        state = state_of(material)
        result = solve(problem_from_state(state, mesh, material, given), degree=p)
        rows, (quantity, side, component, value, source) = _rows(result, where), force
        yield rows.absolute(_STRESS, stress_error(result, state), 0.0, form)
        yield rows.relative(quantity, getattr(result.resultant(side), component), value, source)
        known = energy[0](material.compliance)
        yield rows.relative("strain energy [stress length²]", result.energies.strain, known, energy[1])


_FORMULA: Final = "docstring of gallery.stick_slip_block"
_SLIPS: Final = 0.02
_MOVED: Final[dict[str, Any]] = {"rotation": 0.03, "lift": -0.05, "slip": _SLIPS}
_CELLS: Final = {"4 × 3 cells": ((4, 3), 1.0), "7 × 3 cells": ((7, 3), 1.0), "8 × 4 cells graded by 0.8": ((8, 4), 0.8)}


@FRICTION("full-slip", 4)
def full_slip(p: int, quick: bool) -> Iterator[Row]:
    """A block that slips on its whole base in uniform stress: pressure p = 100, σ_xy = μp, σ_xx = −20, μ = 0.3."""
    planes: tuple[Plane, ...] = ("stress", "strain")
    for (name, (cells, grading)), plane in product(list(_CELLS.items())[: 1 if quick else 3], planes):
        problem, state = sliding_block(cells, plane=plane, grading=grading)
        result = solve(problem, degree=p, tolerance=1e-9)
        base, formula = result.contacts["base"], "docstring of gallery.sliding_block"
        rows = _rows(result, f"{name}, plane {plane}", TOLERANCE_WITH_FRICTION)
        yield rows.absolute(_STRESS, stress_error(result, state), 0.0, formula)
        yield rows.relative("N [stress length]", base.normal_force, 200.0, "p a")
        yield rows.relative("T [stress length]", base.tangential_force, -60.0, "−μ p a")
        exact = state.displacement(base.x, base.y)[0]
        error = float(np.abs(base.slip - exact).max() / np.abs(exact).max())
        yield rows.absolute(_SLIP, error, 0.0, "U₀ + ε_xx (x − a)")
        yield rows.word("states along the base", runs(point_states(base)), "slip", formula)


@FRICTION("stick-slip-on-a-node", 4)
def transition_on_a_node(p: int, quick: bool) -> Iterator[Row]:
    """A base that sticks for x < x_t and slips beyond, with curved obstacle, offset and μ(x); x_t on a grid line."""
    for name, cells in (("4 × 3 cells", (4, 3)), ("16 × 8 cells", (16, 8)))[: 1 if quick else 2]:
        result, state = _stick_slip(p, cells, 1.0, 1.0)
        yield from _sticking(result, state, f"x_t = 1, {name}", TOLERANCE_WITH_FRICTION)
        rows = _rows(result, f"u_T − w = −A (x − x_t)², {_FORMULA}; x_t = 1, {name}", TOLERANCE_WITH_FRICTION)
        yield rows.absolute(_SLIP, _missed_slip(result, 1.0), 0.0, tolerance=1e-6)
        yield rows.word("states along the base", runs(point_states(result.contacts["base"])), "stick, slip")


@FRICTION("stick-slip-in-an-element", 4)
def transition_in_an_element(p: int, quick: bool) -> Iterator[Row]:
    """The same base with x_t inside an element: stresses stay exact on any mesh."""
    for name, (cells, grading) in list(_CELLS.items())[: 1 if quick else 3]:
        for transition in (0.77,) if quick else (0.3, 0.77, 1.31):
            result, state = _stick_slip(p, cells, transition, grading)
            yield from _sticking(result, state, f"x_t = {transition:g}, {name}", TOUCHING)


@FRICTION("stick-slip-quadratic", 4, 5)
def quadratic_pressure(p: int, quick: bool) -> Iterator[Row]:
    """The same base under a pressure that is quadratic along it: triangles contain this stress and its slip too."""
    for name, (cells, grading) in list(_CELLS.items())[: 1 if quick else 3]:
        result, state = _stick_slip(p, cells, 0.77, grading, pressure_drop=40.0)
        rows = _rows(result, f"{_FORMULA}; x_t = 0.77, {name}", TOLERANCE_WITH_FRICTION)
        yield rows.absolute(_STRESS, stress_error(result, state), 0.0, tolerance=TOUCHING)
        yield rows.absolute(_SLIP, _missed_slip(result, 0.77), 0.0, tolerance=1e-6)


def _stick_slip(
    p: int, cells: tuple[int, int], transition: float, grading: float, **other: Any
) -> tuple[ContactResult, ExactState]:
    problem, state = stick_slip_block(cells, transition, grading=grading, **_MOVED, **other)
    return solve(problem, degree=p, tolerance=1e-9), state


def _sticking(result: ContactResult, state: ExactState, where: str, tolerance: float) -> Iterator[Row]:
    base, rows = result.contacts["base"], _rows(result, where, TOLERANCE_WITH_FRICTION)
    yield rows.absolute(_STRESS, stress_error(result, state), 0.0, "Φ = −p x²/2 + a x³ y", tolerance=tolerance)
    yield rows.relative("N [stress length]", base.normal_force, 200.0, "∫ p dx")
    yield rows.relative("T [stress length]", base.tangential_force, 20.0, "∫ 3a x² dx", tolerance=tolerance)


def _missed_slip(result: ContactResult, transition: float) -> float:
    """The largest error of the slip −A ((x − x_t)/(2 − x_t))² beyond the transition, over A."""
    base = result.contacts["base"]
    exact = -_SLIPS * (np.maximum(base.x - transition, 0.0) / (2.0 - transition)) ** 2
    return float(np.abs(base.slip - exact).max()) / _SLIPS


_STEEL: Final = Material(2.09e5, 0.3)
_SIDES: Final = ("left", "bottom", "right", "top")

Map = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class _Change:
    """A transformation: the maps of points, of stress components back, and of sides, and the unit of force."""

    place: Map = lambda x, y: (x, y)
    back: Callable[[FloatArray], FloatArray] = lambda stress: stress
    force: float = 1.0
    order: int = 1
    sides: tuple[str, ...] = _SIDES

    def plate(self, material: Material = _STEEL, displacement: float = 1e-3) -> ContactProblem:
        """The compressed plate on the transformed triangles."""
        mesh = _original().mesh
        names = dict(zip(_SIDES, self.sides, strict=True))
        sets = {names[name]: pairs for name, pairs in mesh.edge_sets.items()}
        left, bottom, right, top = self.sides
        plate = Contact(top, friction=0.12, gap=-displacement, name="plate")
        conditions: list[Condition] = [Symmetry(left), Symmetry(bottom), Traction(right, x=0.0, y=0.0), plate]
        vertices = np.column_stack(self.place(*mesh.vertices.T))
        return ContactProblem(TriangleMesh(vertices, mesh.cells, sets), material, conditions)


def _mirrored(stress: FloatArray) -> FloatArray:
    return np.asarray(stress * np.array([1.0, 1.0, -1.0]))


@INVARIANCE("descriptions", 4)
def other_descriptions(p: int, _: bool) -> Iterator[Row]:
    """Mirrored, turned by 90°, shifted by 1e3 of its size, in other units, under a million times more or less load."""
    left = _Change(lambda x, y: (-x, y), _mirrored, order=-1, sides=("right", "bottom", "left", "top"))
    down = _Change(lambda x, y: (x, -y), _mirrored, sides=("left", "top", "right", "bottom"))
    sides = ("bottom", "right", "top", "left")
    turned = _Change(lambda x, y: (-y, x), lambda stress: _mirrored(stress[..., [1, 0, 2]]), sides=sides)
    units = _Change(lambda x, y: (1e3 * x, 1e3 * y), lambda stress: stress / 1e6, force=1e9)
    changes: dict[str, tuple[_Change, dict[str, Any]]] = {
        "(x, y) → (−x, y)": (left, {}), "(x, y) → (x, −y)": (down, {}), "(x, y) → (−y, x)": (turned, {}),
        "(x, y) → (x + 1e3, y − 1e3)": (_Change(lambda x, y: (x + 1e3, y - 1e3)), {}),
        "lengths times 1e3, stresses times 1e6": (units, {"material": Material(2.09e11, 0.3), "displacement": 1.0}),
    }  # fmt: skip
    for size in (1e6, 1e-6):
        scaled = _Change(back=partial(np.multiply, 1.0 / size), force=size)
        changes[f"load times {size:g}"] = scaled, {"displacement": size * 1e-3}
    for source, (change, given) in changes.items():
        yield from _same(p, change.plate(**given), change, source)
    plate = _Change().plate()
    backwards = ContactProblem(plate.mesh, plate.material, list(plate.conditions)[::-1])
    yield from _same(p, backwards, _Change(), "conditions listed backwards")


@INVARIANCE("rigid-motion", 4)
def rigid_motion(p: int, _: bool) -> Iterator[Row]:
    """Supports and obstacle moved together by five hundred times the compression."""

    def supported(shift: float) -> ContactResult:
        conditions: list[Condition] = [
            Displacement("left", x=shift), Traction("left", y=0.0), Displacement("bottom", y=shift),
            Traction("bottom", x=0.0), Traction("right", x=0.0, y=0.0),
            Contact("top", friction=0.2, gap=shift - 1e-3, offset=shift),
        ]  # fmt: skip
        return solve(ContactProblem(TriangleMesh.rectangle((3, 3)), _STEEL, conditions), degree=p)

    still, moved = supported(0.0), supported(0.5)
    rows = Check(certified(still, moved), "rigid motions leave no stress", 1e-7)
    force, known = moved.contacts["top"].normal_force, still.contacts["top"].normal_force
    yield rows.relative("force [stress length]", force, known)
    x, y = scattered(still)
    error = float(np.abs(moved.stress(x, y) - still.stress(x, y)).max()) / 209.0
    yield rows.absolute("largest difference of σ over E U", error, 0.0)


def _original() -> ContactProblem:
    return compressed_plate(0.12, (4, 3), 1.5, 1.0, grading=0.8)


@cache
def _solved(p: int) -> ContactResult:
    """The plate that is not transformed."""
    return solve(_original(), degree=p)


def _same(p: int, problem: ContactProblem, change: _Change, source: str) -> Iterator[Row]:
    """Rows that compare force, stresses and states of a transformed plate, mapped back, with the original."""
    first, result = _solved(p), solve(problem, degree=p)
    rows = Check(certified(first, result), source)
    known, ours = first.contacts["plate"], result.contacts["plate"]
    force = ours.normal_force / change.force
    yield rows.relative("force [stress length]", force, known.normal_force, tolerance=1e-9)
    x, y = scattered(first)
    difference = change.back(result.stress(*change.place(x, y))) - first.stress(x, y)
    error = float(np.abs(difference).max()) / 209.0
    yield rows.absolute("largest difference of σ over E U", error, 0.0, tolerance=1e-7)
    states = runs(point_states(ours)[:: change.order])
    yield rows.word("states along the plate", states, runs(point_states(known)))
