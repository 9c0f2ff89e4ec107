"""Limit loads from below: stresses in equilibrium whose Bernstein coefficients lie in the yield cones.

On each of the three parts of a triangle, split at its barycentre, σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy) is a polynomial of
degree k = p − 2 with coefficients

    σ_i = S_i (z, y) + s_i⁰ + α s_i¹

in the unknowns z, the functions y inside a triangle, and the load factor α. Then

    max α   s.t.   σ_i ∈ G for every i,   the contact laws on whole edges (D24),   resultants of plates

is a second-order cone program. σ(x) = Σ B_i(x) σ_i is a convex combination, so σ(x) ∈ G everywhere, and Φ is C1: α is a
lower bound of the limit load, whatever the solver did. What varies over a part counts from below by its own
coefficients if it is affine there, from above by its means ∫ a B_i/∫ B_i, since ∫ a |ε| ≤ Σ |ε_i| ∫ a B_i; else by its
least and its largest value, as far as samples show them.

In `docs/theory.md`: (D36).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element.triangle import EDGES, bernstein, exponents
from qvi_contact.errors import InputError
from qvi_contact.limit.conic import HELD, ROUNDING, UNBOUNDED, Cones, ConicProgram
from qvi_contact.limit.linear import EITHER, PRESSURE, TENSION, WholeEdgeRows, both_signs, mean_normal
from qvi_contact.problem.material import Material, MohrCoulomb, YieldCone
from qvi_contact.problem.problem import ContactProblem

_Limits: TypeAlias = tuple[YieldCone, FloatArray, FloatArray | float]

_SAMPLES: Final = 6  # degree of the lattice at which fields are looked at
_AFFINE: Final = 1e-10  # share of a field's size that is rounding

_TIGHTER: Final = 1e-8  # share of strengths that is kept back, so that rounding of the solver breaks no cone


@dataclass(frozen=True, eq=False)
class YieldCones:
    """Rows |(γ S, σ_xx − σ_yy, 2σ_xy)| ≤ a − β S on coefficients, S = σ_xx + σ_yy, for one side of the limit load.

    Where the angle of friction of a `MohrCoulomb` body varies from φ₀ to φ₁ on a part, stresses keep the cones of both,
    and so those of all angles between: 2c cos φ − S sin φ ≥ 0 is concave in φ. What flow dissipates is that of one cone
    around all of them, β = sin φ₁ with a larger by (S sin φ₁ − S sin φ₀) at the largest S that can be carried.

    """

    degree: int  # k
    coefficient: IntArray  # (r,) which coefficient each row is about: ((triangle · 3) + part) · count + its number
    first: BoolArray  # (r,) whether it is the first cone of its coefficient
    limit: FloatArray  # (r,) a, for stresses not above the truth, and for dissipation not below it [stress]
    pressure: FloatArray  # (r,) β and γ
    mean: FloatArray
    strong: BoolArray  # (cells,) triangles without a strength: they carry any stress, and move as rigid bodies

    @classmethod
    def of(cls, problem: ContactProblem, degree: int, *, above: bool) -> YieldCones:
        """Those of a problem for stresses of a degree, or `above`, for what flow dissipates."""
        count, number = len(exponents(degree)), problem.cell_materials
        found = [(np.zeros(0), np.zeros(0, dtype=bool), *np.zeros((3, 0)))]
        for index, material in enumerate(problem.materials):
            cells = np.flatnonzero(number == index)
            if material.strength is None or not len(cells):
                continue
            at = 3 * count * cells[:, None, None] + np.arange(3 * count).reshape(3, count)
            cones = _above if above else _below
            for place, (cone, a, pressure) in enumerate(cones(problem, cells, degree, material)):
                parts = np.broadcast_arrays(at, place == 0, a, pressure, cone.mean)
                found.append(tuple(part.ravel() for part in parts))
        coefficient, first, limit, pressure, mean = (np.concatenate(part) for part in zip(*found, strict=True))
        strong = np.array([material.strength is None for material in problem.materials])[number]
        return cls(degree, coefficient.astype(np.int64), first, limit, pressure, mean, strong)

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
        for cone in _cones(material, lambda angles: angles(x[chosen], y[chosen])):  # noqa: B023
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


def _cones(material: Material, at: Callable[[Callable[[FloatArray, FloatArray], FloatArray]], FloatArray]
           ) -> list[YieldCone]:  # fmt: skip
    """The cones of a material's strength, for the angles that `at` makes of a `MohrCoulomb.angles` that varies."""
    law = material.strength
    if isinstance(law, MohrCoulomb) and callable(law.phi):
        return list(law.cones(material.plane, at(law.angles)))
    return [] if law is None else list(law.cones(material.plane))


def _extremes(problem: ContactProblem, cells: IntArray, material: Material) -> tuple[list[YieldCone], list[YieldCone]]:
    """The cones for the least and for the largest angle of friction on each part (n, 3, 1)."""
    x, y = _sampled(problem, cells)
    least, largest = (
        _cones(material, lambda angles: extreme(angles(x, y), axis=-1, keepdims=True))  # noqa: B023
        for extreme in (np.min, np.max)
    )
    return least, largest


def _below(problem: ContactProblem, cells: IntArray, degree: int, material: Material) -> Iterator[_Limits]:
    """Cones with a and β (n, 3, count) that stresses keep: those of both extreme angles, which hold for all between."""
    least, largest = _extremes(problem, cells, material)
    for one, other in zip(least, largest, strict=True):
        strength = _on_parts(problem, cells, degree, one)[0]
        yield one, one.factor * strength, one.pressure
        if np.ndim(one.factor) or np.ndim(one.pressure):
            yield one, other.factor * strength, other.pressure


def _above(problem: ContactProblem, cells: IntArray, degree: int, material: Material) -> Iterator[_Limits]:
    """Cones with a and β (n, 3, count) around those of all angles; the least a/β is the largest S."""
    least, largest = _extremes(problem, cells, material)
    strengths = [_on_parts(problem, cells, degree, cone)[1:] for cone in least]
    reach = np.full((len(cells), 3, 1), np.inf)
    for cone, (_, most) in zip(least, strengths, strict=True):
        beta = np.broadcast_to(np.asarray(cone.pressure), reach.shape)
        reach = np.minimum(reach, np.divide(cone.factor * most, beta, out=np.full_like(reach, np.inf), where=beta > 0))
    for one, other, (strength, _) in zip(least, largest, strengths, strict=True):
        steeper = np.broadcast_to(np.asarray(other.pressure) - np.asarray(one.pressure), reach.shape)
        if not np.isfinite(reach[steeper > 0.0]).all():
            remedy = "give it a tension cut-off (tension=…), or a region of its own to what has no friction"
            raise InputError("MohrCoulomb.phi", 0.0, f"is zero beside places where it is not: {remedy}")
        more = np.multiply(reach, steeper, out=np.zeros_like(reach), where=steeper > 0.0)
        yield one, np.maximum(one.factor, other.factor) * strength + more, other.pressure


def _sampled(problem: ContactProblem, cells: IntArray) -> tuple[FloatArray, FloatArray]:
    """Places (n, 3, g) on the parts of triangles at which fields are looked at."""
    x, y = np.moveaxis(lattice(_SAMPLES) @ part_corners(problem.mesh.vertices[problem.mesh.cells[cells]]), -1, 0)
    return x, y


def _on_parts(
    problem: ContactProblem, cells: IntArray, degree: int, cone: YieldCone
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Its field for each coefficient (n, 3, count), for stresses and for what flow dissipates; the most (n, 3, 1)."""
    shape = (len(cells), 3, len(exponents(degree)))
    if not callable(cone.field):
        value = np.full(shape, float(cone.field))
        return value, value, value[..., :1]
    samples = lattice(_SAMPLES)
    seen = evaluate(cone.name, cone.field, *_sampled(problem, cells), minimum=0.0)
    least, most = seen.min(axis=-1, keepdims=True), seen.max(axis=-1, keepdims=True)
    corners = seen[..., [int(np.flatnonzero(samples[:, i] == 1.0)[0]) for i in range(3)]]
    affine = np.abs(seen - corners @ samples.T).max(axis=-1, keepdims=True) <= _AFFINE * np.abs(seen).max()
    own = corners @ lattice(degree).T
    means = corners @ ((exponents(degree) + 1.0) / (degree + 3.0)).T
    return np.where(affine, own, least), np.where(affine, means, most), most


@dataclass(frozen=True, eq=False)
class CarriedStress:
    """Stresses of a mesh at a load factor, dimensionless."""

    factor: float  # α; infinity if there is no limit, minus infinity if no multiple is carried
    violation: float  # what rows are missed by, relative to what stands in them: rounding
    unknowns: FloatArray | None = None  # (n,) (z, y, α); None if α is not finite
    stress: FloatArray | None = None  # (cells, 3, count, 3) coefficients of (σ_xx, σ_yy, σ_xy), φ included
    tractions: FloatArray | None = None  # (2 m,) rows [σ_N; σ_T] of the contacts


@dataclass(frozen=True, eq=False)
class StressProgram:
    """The program of a problem discretised at the load factors 1 and 2."""

    low: Discretization  # the problem at both factors, in the same units and degrees of freedom
    high: Discretization

    @cached_property
    def cones(self) -> YieldCones:
        """What its body can carry."""
        return YieldCones.of(self.low.problem, self.low.space.traction_degree, above=False)

    def carried(self, share: float = 0.0) -> CarriedStress:
        """The largest factor, with signs of bilateral pressure that a first program without friction there suggests.

        The stresses go a share of the way towards a state inside all limits, as far as these leave room.
        """
        undecided = both_signs(self.low)
        found = [self._solved(np.full(len(undecided), EITHER), share)]
        if undecided.any():
            trials = [np.where(undecided, PRESSURE, EITHER)]
            if found[0].tractions is not None:
                pulled = mean_normal(self.low, found[0].tractions) > 0.0
                trials.append(np.where(undecided & pulled, TENSION, np.where(undecided, PRESSURE, EITHER)))
            found += [self._solved(trial, share) for trial in trials]
        return max(found, key=lambda each: each.factor)

    def room(self) -> float:
        """How much all limits, over the stress of the loads, may be lowered for the mesh to carry some multiple.

        Negative where it carries none: by so much they would have to be raised.
        """
        return self.program(np.full(len(both_signs(self.low)), EITHER)).room()[1]

    def _solved(self, signs: IntArray, share: float) -> CarriedStress:
        program, best = self.program(signs), CarriedStress(-np.inf, 0.0)
        for each in (program.tightened(_TIGHTER), program):  # where limits leave no room, rounding decides of the first
            found = each.solve()
            if isinstance(found, str) and found == UNBOUNDED:
                return CarriedStress(np.inf, 0.0)
            if isinstance(found, str):
                continue
            x, violation = program.repaired(found, share)
            grown = max(1.0, program.size(x) / max(1.0, program.size(0.0 * x)))  # stresses beyond loads and limits
            if violation * grown <= HELD:  # else the solver has given up
                tractions = self._tractions[0] @ x[: self.low.qvi.n] + self._tractions[1] + x[-1] * self._tractions[2]
                stress = (self._matrix @ x + self._constant).reshape(-1, 3, self.cones.count, 3)
                carried = CarriedStress(float(x[-1]), violation, x, stress, tractions)
                best = max(best, carried, key=lambda one: one.factor)
                if violation <= ROUNDING:
                    break
        return best

    def program(self, signs: IntArray) -> ConicProgram:
        """The cone program for signs (e,) of σ_N on contact edges, which count where `both_signs`."""
        size = self._matrix.shape[1]
        q = np.zeros(size)
        q[-1] = -1.0
        rows = WholeEdgeRows.of(self.low, signs)
        matrix, constant, slope = self._tractions
        inner = sparse.csr_array((rows.H.shape[0], size - 1 - matrix.shape[1]))
        L = sparse.hstack([rows.H @ matrix, inner, sparse.csr_array((rows.H @ slope)[:, None])])
        qvi, b_slope = self.low.qvi, self.high.qvi.b - self.low.qvi.b
        inner = sparse.csr_array((qvi.p, size - 1 - matrix.shape[1]))
        E = sparse.hstack([qvi.A, inner, sparse.csr_array(-b_slope[:, None])])
        limits = rows.limit - rows.H @ constant
        return ConicProgram(q, sparse.csr_array(E), qvi.b - b_slope, sparse.csr_array(L), limits, self._yield_cones())

    def _yield_cones(self) -> Cones:
        cones, at = self.cones, 3 * self.cones.coefficient
        xx, yy, xy = (self._matrix[at + i] for i in range(3))
        c_xx, c_yy, c_xy = (self._constant[at + i] for i in range(3))
        total, constant = xx + yy, c_xx + c_yy
        parts = [
            (
                sparse.diags_array(cones.pressure) @ total,
                cones.limit / self.low.scales.stress - cones.pressure * constant,
            ),
            (yy - xx, c_xx - c_yy),
            (-2.0 * xy, 2.0 * c_xy),
        ]
        if cones.mean.any():
            parts.append((sparse.diags_array(-cones.mean) @ total, cones.mean * constant))
        return Cones.of(parts)

    @cached_property
    def _tractions(self) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
        """[σ_N; σ_T] as rows on z, their constants at α = 0, and what α adds."""
        first, second = (np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (self.low, self.high))
        return sparse.csr_array(self.low.qvi.contact_rows), 2.0 * first - second, second - first

    @cached_property
    def _of_freedoms(self) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Stress coefficients, three numbers each, as rows on the degrees of freedom of the body and on y."""
        space = self.low.space
        element, triangles, k = space.element, space.triangles, space.element.shared - 3
        n = len(triangles)
        reference = np.einsum("nab,sbcd->nscad", triangles.stress_maps, element.derivatives[2][..., 3:])
        reference = reference.reshape(n, -1, element.dimension - 3)
        w = reference[..., :k] @ element.transformations(triangles)[:, 3:, 3:]
        y = reference[..., k:].copy()
        if len(space.curved):
            at = space.curved.numbers
            own = reference[at] @ space.curved.functions[:, 3:, 3:]
            w[at], y[at] = own[..., :k], own[..., k:]
        rows, full = w.shape[1], space.differences.all_rows(w, np.arange(n))
        inner = element.interior
        columns = np.repeat(np.arange(n * inner).reshape(n, inner), rows, axis=0)
        starts = inner * np.arange(n * rows + 1)
        return full, sparse.csr_array((y.ravel(), columns.ravel(), starts), shape=(n * rows, n * inner))

    @cached_property
    def _matrix(self) -> sparse.csr_array:
        """Stress coefficients as rows on (z, y, α), dimensionless."""
        shared, inner = self._of_freedoms
        change = self.high.particular - self.low.particular
        slope = shared @ change + _pressures(self._potentials[1] - self._potentials[0])
        return sparse.csr_array(sparse.hstack([shared @ self.low.basis, inner, sparse.csr_array(slope[:, None])]))

    @cached_property
    def _constant(self) -> FloatArray:
        """What they are at z = y = α = 0."""
        particular = 2.0 * self.low.particular - self.high.particular
        return np.asarray(
            self._of_freedoms[0] @ particular + _pressures(2.0 * self._potentials[0] - self._potentials[1])
        )

    @cached_property
    def _potentials(self) -> tuple[FloatArray, FloatArray]:
        """Coefficients of φ at both factors, dimensionless."""
        cells = np.arange(self.low.problem.mesh.cell_count)
        low, high = (
            coefficients_of(
                part.problem, cells, self.cones.degree, "ContactProblem.body_potential", part.problem.body_potential
            )[0].ravel()
            / self.low.scales.stress
            for part in (self.low, self.high)
        )
        return low, high


def _pressures(values: FloatArray) -> FloatArray:
    """Stresses (v, v, 0) of scalars, three numbers each."""
    return np.column_stack([values, values, np.zeros_like(values)]).ravel()
