"""The cones of a body's strengths on Bernstein coefficients of its stresses.

A triangle has three parts, split at its barycentre, on each of which stresses are polynomials of degree k. If every
coefficient lies in a convex set, so does the stress at every point, since Σ B_i = 1 and B_i ≥ 0. What varies over a
part counts from below by its own coefficients if it is affine there, from above by its means ∫ a B_i/∫ B_i, since
∫ a |ε| ≤ Σ |ε_i| ∫ a B_i; else by its least and its largest value, as far as samples show them.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.element.affine import EDGES
from qvi_contact.element.triangle import bernstein, exponents
from qvi_contact.problem.problem import ContactProblem

_SAMPLES: Final = 6  # degree of the lattice at which fields are looked at
_AFFINE: Final = 1e-10  # share of a field's size that is rounding


@dataclass(frozen=True, eq=False)
class YieldCones:
    """Rows |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S on coefficients, S = σ_xx + σ_yy.

    Attributes
    ----------
    degree : int
        k.
    coefficient : (r,) int array
        Which coefficient each row is about: ((triangle · 3) + part) · count + its number.
    first : (r,) bool array
        Whether it is the first cone of its coefficient.
    low, high : (r,) arrays
        a for stresses, not above the truth, and for dissipation, not below it [stress].
    pressure, mean : (r,) arrays
        β and γ.
    strong : (cells,) bool array
        Triangles without a strength: they carry any stress, and move as rigid bodies.

    """

    degree: int
    coefficient: IntArray
    first: BoolArray
    low: FloatArray
    high: FloatArray
    pressure: FloatArray
    mean: FloatArray
    strong: BoolArray

    @classmethod
    def of(cls, problem: ContactProblem, degree: int) -> "YieldCones":
        """Those of a problem on triangles for stresses of a degree."""
        count, number = len(exponents(degree)), problem.cell_materials
        per_cell = np.arange(3 * count)
        at, first = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=bool)]
        low, high, pressure, mean = ([np.zeros(0)] for _ in range(4))
        for index in np.unique(number):
            material = problem.materials[index]
            cells = np.flatnonzero(number == index)
            for place, cone in enumerate(() if material.strength is None else material.strength.cones(material.plane)):
                below, above = _on_parts(problem, cells, degree, cone.name, cone.field)
                at.append((3 * count * cells[:, None] + per_cell).ravel())
                first.append(np.full(below.size, place == 0))
                low.append(cone.factor * below.ravel())
                high.append(cone.factor * above.ravel())
                pressure.append(np.full(below.size, cone.pressure))
                mean.append(np.full(below.size, cone.mean))
        strong = np.array([material.strength is None for material in problem.materials])[number]
        a_low, a_high, beta, gamma = (np.concatenate(part) for part in (low, high, pressure, mean))
        return cls(degree, np.concatenate(at), np.concatenate(first), a_low, a_high, beta, gamma, strong)

    @property
    def count(self) -> int:
        """Coefficients of a part."""
        return len(exponents(self.degree))

    @cached_property
    def yielding(self) -> IntArray:
        """The coefficients that have a cone, ascending."""
        return np.unique(self.coefficient)


def excess(problem: ContactProblem, x: FloatArray, y: FloatArray, stress: FloatArray) -> FloatArray:
    """By how much stresses at points of all triangles exceed the strength there, in its unit (cells, g) [stress].

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    x, y : (cells, g) arrays
        The points [length].
    stress : (cells, g, 3) array
        (σ_xx, σ_yy, σ_xy) [stress].

    """
    found = np.zeros(x.shape)
    total, difference = stress[..., 0] + stress[..., 1], stress[..., 0] - stress[..., 1]
    for index, material in enumerate(problem.materials):
        chosen = problem.cell_materials == index
        for cone in () if material.strength is None else material.strength.cones(material.plane):
            S = total[chosen]
            radius = np.sqrt(difference[chosen] ** 2 + 4.0 * stress[chosen, :, 2] ** 2 + (cone.mean * S) ** 2)
            strength = evaluate(cone.name, cone.field, x[chosen], y[chosen], minimum=0.0)
            found[chosen] = np.maximum(found[chosen], (radius + cone.pressure * S) / cone.factor - strength)
    return found


def part_corners(corners: FloatArray) -> FloatArray:
    """Corners (n, 3, 3, 2) of the three parts of triangles with corners (n, 3, 2): an edge, then the barycentre."""
    centre = corners.mean(axis=1)
    return np.stack([np.stack([corners[:, a], corners[:, b], centre], axis=1) for a, b in EDGES], axis=1)


def lattice(degree: int) -> FloatArray:
    """Barycentric places (count, 3) of Bernstein coefficients."""
    return exponents(degree) / max(degree, 1) if degree else np.full((1, 3), 1.0 / 3.0)


def coefficients_of(
    problem: ContactProblem, cells: IntArray, degree: int, name: str, field: object
) -> tuple[FloatArray, float]:
    """Coefficients (n, 3, count) of the polynomials that agree with a field at their places, and the largest misfit.

    The misfit is relative to the field's size.
    """
    parts = part_corners(problem.mesh.vertices[problem.mesh.cells[cells]])

    def values(places: FloatArray) -> FloatArray:
        x, y = np.moveaxis(places @ parts, -1, 0)
        return evaluate(name, field, x, y)  # type: ignore[arg-type]

    places, samples = lattice(degree), lattice(_SAMPLES)
    found = values(places) @ np.linalg.inv(bernstein(degree, places)).T
    seen = values(samples)
    misfit = np.abs(found @ bernstein(degree, samples).T - seen).max(initial=0.0)
    return np.asarray(found), float(misfit / max(np.abs(seen).max(initial=0.0), 1e-300))


def _on_parts(
    problem: ContactProblem, cells: IntArray, degree: int, name: str, field: object
) -> tuple[FloatArray, FloatArray]:
    """A field of strength for each coefficient (n, 3, count): for stresses, and for what flow dissipates."""
    shape = (len(cells), 3, len(exponents(degree)))
    if not callable(field):
        value = np.full(shape, float(field))  # type: ignore[arg-type]
        return value, value
    parts = part_corners(problem.mesh.vertices[problem.mesh.cells[cells]])
    samples = lattice(_SAMPLES)
    x, y = np.moveaxis(samples @ parts, -1, 0)
    seen = evaluate(name, field, x, y, minimum=0.0)
    at_corners = [int(np.flatnonzero(samples[:, i] == 1.0)[0]) for i in range(3)]
    corners = seen[..., at_corners]
    affine = np.abs(seen - corners @ samples.T).max(axis=-1) <= _AFFINE * np.abs(seen).max()
    own = corners @ lattice(degree).T
    means = corners @ ((exponents(degree) + 1.0) / (degree + 3.0)).T
    low = np.where(affine[..., None], own, seen.min(axis=-1)[..., None])
    return low, np.where(affine[..., None], means, seen.max(axis=-1)[..., None])
