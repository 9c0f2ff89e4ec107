"""Elastic states with a closed form that Airy functions of degree 4 reproduce exactly, and problems made of them.

They verify every part of the discretisation at once: whatever conditions are put on the sides, the computed stress
must be the exact one up to round-off.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.grid import SIDES
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Displacement, Traction
from qvi_contact.problem.material import Material
from qvi_contact.problem.problem import ContactProblem


@dataclass(frozen=True)
class ExactState:
    """Stress and displacement of an elastic body in equilibrium with b = −∇φ.

    Attributes
    ----------
    stress : callable
        (x, y) arrays of shape s to σ_xx, σ_yy, σ_xy of shape (3, *s) [stress].
    displacement : callable
        (x, y) arrays to u_x, u_y of shape (2, *s) [length].
    potential : callable
        φ(x, y) [stress].

    """

    stress: Callable[[FloatArray, FloatArray], FloatArray]
    displacement: Callable[[FloatArray, FloatArray], FloatArray]
    potential: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: np.zeros(np.broadcast(x, y).shape)

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
            [
                a * k * x**2 * y / 2 - s * shear * y - (s + b) * k * y**3 / 6,
                b * k * x * y**2 / 2 - a * k * x**3 / 6,
            ]
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
