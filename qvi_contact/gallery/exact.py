"""Elastic states with a closed form that Airy functions of degree 4 reproduce exactly, and problems made of them.

They verify every part of the discretisation at once: whatever conditions are put on the sides, the computed stress
must be the exact one up to round-off.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, finite_number, positive_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.grid import SIDES
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Traction
from qvi_contact.problem.material import Material, Plane
from qvi_contact.problem.problem import ContactProblem


@dataclass(frozen=True)
class ExactState:
    """Stress and displacement of an elastic body in equilibrium with b = −∇φ."""

    stress: Callable[[FloatArray, FloatArray], FloatArray]
    """(x, y) arrays of shape s to σ_xx, σ_yy, σ_xy of shape (3, *s) [stress]."""
    displacement: Callable[[FloatArray, FloatArray], FloatArray]
    """(x, y) arrays to u_x, u_y of shape (2, *s) [length]."""
    potential: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: np.zeros(np.broadcast(x, y).shape)
    """φ(x, y) [stress]."""

    def traction(self, side: str, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component 0 (x) or 1 (y) of σn on a side of a rectangle, as a function of (x, y)."""
        axis, sign = {"bottom": (1, -1.0), "right": (0, 1.0), "top": (1, 1.0), "left": (0, -1.0)}[side]
        entry = axis if axis == component else 2
        return lambda x, y: sign * self.stress(x, y)[entry]

    def displaced(self, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component of the displacement as a function of (x, y)."""
        return lambda x, y: self.displacement(x, y)[component]


def uniform(material: Material, xx: float = 0.0, yy: float = 0.0, xy: float = 0.0) -> ExactState:
    """Uniform stress; Φ = σ_xx y²/2 + σ_yy x²/2 − σ_xy xy."""
    strain = material.compliance @ np.array([xx, yy, xy])
    return ExactState(
        lambda x, y: np.stack(np.broadcast_arrays(xx + 0 * x, yy + 0 * y, xy + 0 * x)),
        lambda x, y: np.stack([strain[0] * x + strain[2] * y, strain[1] * y]),
    )


def pure_bending(material: Material, curvature: float) -> ExactState:
    """σ_xx = m y with m = `curvature` [stress / length]; Φ = m y³/6."""
    a, b = material.compliance[0, :2]
    return ExactState(
        lambda x, y: np.stack([curvature * y + 0 * x, 0 * x, 0 * x]),
        lambda x, y: curvature * np.stack([a * x * y, (b * y**2 - a * x**2) / 2]),
    )


def cantilever(material: Material, gradient: float, shear: float) -> ExactState:
    """Timoshenko's end-loaded cantilever: σ_xx = k x y, σ_xy = −τ − k y²/2; Φ = τ x y + k x y³/6.

    Sides y = ±√(−2τ/k) are free. With c11 = a, c12 = b, c33 = s,
    u_x = a k x² y/2 − s τ y − (s + b) k y³/6, u_y = b k x y²/2 − a k x³/6.
    """
    a, b = material.compliance[0, :2]
    s = material.compliance[2, 2]
    k = gradient
    return ExactState(
        lambda x, y: np.stack([k * x * y, 0 * x, -shear - k * y**2 / 2 + 0 * x]),
        lambda x, y: np.stack(
            [a * k * x**2 * y / 2 - s * shear * y - (s + b) * k * y**3 / 6, b * k * x * y**2 / 2 - a * k * x**3 / 6]
        ),
    )


def gravity_column(material: Material, weight: float, height: float) -> ExactState:
    """Column under its own weight with a free top at y = height: φ = γ y, σ_yy = γ (y − height); γ = ρ g."""
    a, b = material.compliance[0, :2]
    return ExactState(
        lambda x, y: np.stack([0 * x, weight * (y - height) + 0 * x, 0 * x]),
        lambda x, y: weight * np.stack([b * x * (y - height), a * (y**2 / 2 - height * y) - b * x**2 / 2]),
        lambda x, y: weight * y + 0 * x,
    )


def problem_from_state(
    state: ExactState,
    mesh: TriangleMesh,
    material: Material,
    sides: Mapping[str, str],
    contacts: tuple[Condition, ...] = (),
) -> ContactProblem:
    """A problem whose answer is the state, on a full rectangle with the names of sides of `TriangleMesh.grid`.

    The material is that of the state. `sides` has for each side two letters, for components x and y: "t" takes the
    traction, "u" the displacement from the state; "cc" leaves the side to the conditions in `contacts`.
    """
    conditions: list[Condition] = list(contacts)
    for side in SIDES:
        kinds = sides.get(side, "")
        if len(kinds) != 2 or (set(kinds) - {"t", "u"} and kinds != "cc"):
            raise InputError(f"sides[{side!r}]", kinds, "give two letters of 't' and 'u', or 'cc'")
        for component, kind in enumerate(kinds):
            if kind == "c":
                continue
            value: Field = state.traction(side, component) if kind == "t" else state.displaced(component)
            condition = Traction if kind == "t" else Displacement
            conditions.append(condition(side, x=value) if component == 0 else condition(side, y=value))
    return ContactProblem(mesh, material, conditions, state.potential)


_BLOCK_SIDES: Final = {"bottom": "cc", "right": "uu", "top": "tt", "left": "tt"}


def sliding_block(
    cells: tuple[int, int] = (3, 2), plane: Plane = "stress", grading: float = 1.0
) -> tuple[ContactProblem, ExactState]:
    """A block that slips on its whole base in a uniform stress state, with the exact answer.

    On [0, 2] × [0, 1] the stress is σ_xx = −20, σ_yy = −p = −100, σ_xy = μp, with μ = 0.3, E = 1000, ν = 0.3. The base
    y = 0 is the contact "base" with g = w = 0; top and left side carry the tractions of the state; the right side gets
    its displacement u_x = γ y + U₀ + ε_xx (x − 2), u_y = ε_yy y, with γ = c33 μp and U₀ = 0.5. The base slips by
    U₀ + ε_xx (x − 2).
    """
    width, friction, pressure, side_stress, translation = 2.0, 0.3, 100.0, -20.0, 0.5
    material = Material(1000.0, 0.3, plane)
    strain = material.compliance @ np.array([side_stress, -pressure, friction * pressure])

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.stack([strain[2] * y + translation + strain[0] * (x - width), strain[1] * y + 0 * x])

    stress = uniform(material, side_stress, -pressure, friction * pressure).stress
    state = ExactState(stress, displacement)
    mesh = TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", friction=friction, name="base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state


def stick_slip_block(
    cells: tuple[int, int] = (4, 3),
    transition: float = 1.0,
    plane: Plane = "stress",
    pressure_drop: float = 0.0,
    shear: float = 30.0,
    slip: float = 0.02,
    rotation: float = 0.0,
    lift: float = 0.0,
    grading: float = 1.0,
) -> tuple[ContactProblem, ExactState]:
    """A block whose curved base sticks for x < x_t and slips beyond, with the exact answer.

    On [0, 2] × [0, 1], with E = 1000, ν = 0.3 and p = 100, the stress function is Φ = −p x²/2 + a x³ y +
    k (x⁴ − 3x²y²)/12, with a = `shear`/12 and k = `pressure_drop`/4, as σ_T is `shear` at x = 2 and the pressure loses
    `pressure_drop` up to there:

        σ_xx = −k x²/2,    σ_yy = −p + 6a x y + k (x² − y²/2),    σ_xy = −3a x² + k x y.

    With the compliance c (see `Material`; c33 = 2 (c11 − c12)), `rotation` c₀ and `lift` d, which move body and
    obstacle together, the displacement is

        u_x = c12 (3a x² y − p x) − c11 a y³ + k ((2 c12 − c11) x³ − 3 c12 x y²)/6 + c₀ y
        u_y = c11 (3a x y² − p y) − (c33 + c12) a x³ + k ((2 c11 − c12) x² y/2 − c11 y³/6) − c₀ x + d.

    The base y = 0 with outward normal −y is the contact "base". There σ_N = −p + k x², σ_T = −σ_xy = 3a x² ≥ 0, and in
    plane stress with k = 0 u_T = ν p x/E, u_y = −(2+ν) a x³/E − c₀ x + d. The obstacle touches everywhere, g = u_N =
    −u_y, and friction and offset are

        μ = 3a max(x, x_t)²/(p − k x²),    w = u_T + A max(x − x_t, 0)²,

    so that left of the `transition` x_t the bound 3a x_t² exceeds σ_T and nothing slips, and right of it σ_T is at the
    bound and u_T − w = −A (x − x_t)², opposite in sign to σ_T, and −`slip` at x = 2. Bound and slip are continuous in
    x_t and leave it with different rates, so that every other point is clearly in one state. The side x = 0 is free,
    the top carries the tractions of the state, the right side its displacement.

    Elements of degree 4 contain Φ. As friction varies, the law holds at Gauss points; they integrate the data, so that
    the discrete solution is the exact stress on every mesh, even if x_t is inside an edge. Only the slip, which is
    projected on polynomials, depends on the mesh.
    """
    width, pressure = 2.0, 100.0
    for name, value in (("shear", shear), ("slip", slip)):
        positive_number(name, value)
    if not 0.0 < finite_number("transition", transition) < width:
        raise InputError("transition", transition, f"give a number between 0 and the width {width:g}")
    if finite_number("pressure_drop", pressure_drop) >= pressure:
        raise InputError("pressure_drop", pressure_drop, f"give less than the pressure {pressure:g}")
    material, p, k, a = Material(1000.0, 0.3, plane), pressure, pressure_drop / width**2, shear / (3 * width**2)
    (c11, c12, _), c33 = material.compliance[0], material.compliance[2, 2]

    def stress(x: FloatArray, y: FloatArray) -> FloatArray:
        xx = -k * x**2 / 2 + 0 * y
        yy = -p + 6 * a * x * y + k * (x**2 - y**2 / 2)
        return np.stack([xx, yy, -3 * a * x**2 + k * x * y])

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        along = c12 * (3 * a * x**2 * y - p * x) - c11 * a * y**3 + rotation * y
        across = c11 * (3 * a * x * y**2 - p * y) - (c33 + c12) * a * x**3 - rotation * x + lift
        along = along + k * ((2 * c12 - c11) * x**3 - 3 * c12 * x * y**2) / 6
        return np.stack([along, across + k * ((2 * c11 - c12) * x**2 * y / 2 - c11 * y**3 / 6)])

    def bound_over_pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        bound = shear * (np.maximum(x, transition) / width) ** 2
        return np.asarray(bound / (pressure - pressure_drop * (x / width) ** 2) + 0 * y)

    def offset(x: FloatArray, y: FloatArray) -> FloatArray:
        beyond = np.maximum(x - transition, 0.0) / (width - transition)
        return np.asarray(displacement(x, y)[0] + slip * beyond**2)

    state, mesh = ExactState(stress, displacement), TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", bound_over_pressure, lambda x, y: -displacement(x, y)[1], offset, "base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state
