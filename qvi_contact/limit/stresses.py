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
from typing import Any, Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element.triangle import exponents
from qvi_contact.errors import InputError
from qvi_contact.limit.conic import HELD, ROUNDING, UNBOUNDED, ConicProgram
from qvi_contact.limit.linear import EITHER, Carried, both_signs, whole_edge_rows, with_signs
from qvi_contact.limit.split import SAMPLES, coefficients_of, lattice, sampled
from qvi_contact.problem.material import Material, MohrCoulomb, YieldCone
from qvi_contact.problem.problem import ContactProblem

_Limits: TypeAlias = tuple[YieldCone, FloatArray, FloatArray | float]

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
            for place, (cone, a, pressure) in enumerate(_limits(problem, cells, degree, material, above)):
                parts = np.broadcast_arrays(at, place == 0, a, pressure, cone.mean)
                found.append(tuple(part.ravel() for part in parts))
        coefficient, first, limit, pressure, mean = (np.concatenate(part) for part in zip(*found, strict=True))
        strong = np.array([material.strength is None for material in problem.materials])[number]
        return cls(degree, coefficient.astype(np.int64), first, limit, pressure, mean, strong)

    @property
    def count(self) -> int:
        """Coefficients of a part."""
        return len(exponents(self.degree))

    @property
    def cell(self) -> IntArray:
        """The triangle (r,) of each row."""
        return self.coefficient // (3 * self.count)


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


def _cones(material: Material, at: Callable[[Callable[[FloatArray, FloatArray], FloatArray]], FloatArray]
           ) -> list[YieldCone]:  # fmt: skip
    """The cones of a material's strength, for the angles that `at` makes of a `MohrCoulomb.angles` that varies."""
    law = material.strength
    if isinstance(law, MohrCoulomb) and callable(law.phi):
        return list(law.cones(material.plane, at(law.angles)))
    return [] if law is None else list(law.cones(material.plane))


def _limits(
    problem: ContactProblem, cells: IntArray, degree: int, material: Material, above: bool
) -> Iterator[_Limits]:
    """Cones with a and β (n, 3, count): for stresses those of both extreme angles, else one around those of all."""
    x, y = sampled(problem, cells)
    least, largest = (
        _cones(material, lambda angles: extreme(angles(x, y), axis=-1, keepdims=True))  # noqa: B023
        for extreme in (np.min, np.max)
    )
    strengths = [_on_parts(problem, cells, degree, cone) for cone in least]
    reach = np.full((len(cells), 3, 1), np.inf)  # the largest S is the least a/β
    for cone, (*_, most) in zip(least, strengths, strict=True):
        beta = np.broadcast_to(np.asarray(cone.pressure), reach.shape)
        reach = np.minimum(reach, np.divide(cone.factor * most, beta, out=np.full_like(reach, np.inf), where=beta > 0))
    for one, other, (carried, dissipated, _) in zip(least, largest, strengths, strict=True):
        if not above:
            yield one, one.factor * carried, one.pressure
            if np.ndim(one.factor) or np.ndim(one.pressure):
                yield one, other.factor * carried, other.pressure
            continue
        steeper = np.broadcast_to(np.asarray(other.pressure) - np.asarray(one.pressure), reach.shape)
        if not np.isfinite(reach[steeper > 0.0]).all():
            remedy = "give it a tension cut-off (tension=…), or a region of its own to what has no friction"
            raise InputError("MohrCoulomb.phi", 0.0, f"is zero beside places where it is not: {remedy}")
        more = np.multiply(reach, steeper, out=np.zeros_like(reach), where=steeper > 0.0)
        yield one, np.maximum(one.factor, other.factor) * dissipated + more, other.pressure


def _on_parts(
    problem: ContactProblem, cells: IntArray, degree: int, cone: YieldCone
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Its field for each coefficient (n, 3, count), for stresses and for what flow dissipates; the most (n, 3, 1)."""
    samples = lattice(SAMPLES)
    seen = evaluate(cone.name, cone.field, *sampled(problem, cells), minimum=0.0)
    least, most = seen.min(axis=-1, keepdims=True), seen.max(axis=-1, keepdims=True)
    corners = seen[..., [int(np.flatnonzero(samples[:, i] == 1.0)[0]) for i in range(3)]]
    affine = np.abs(seen - corners @ samples.T).max(axis=-1, keepdims=True) <= _AFFINE * np.abs(seen).max()
    own = corners @ lattice(degree).T
    means = corners @ ((exponents(degree) + 1.0) / (degree + 3.0)).T
    return np.where(affine, own, least), np.where(affine, means, most), most


@dataclass(frozen=True, eq=False)
class StressProgram:
    """The program of a problem discretised at the load factors 1 and 2."""

    low: Discretization  # the problem at both factors, in the same units and degrees of freedom
    high: Discretization

    @cached_property
    def cones(self) -> YieldCones:
        """What its body can carry."""
        return YieldCones.of(self.low.problem, self.low.space.traction_degree, above=False)

    def carried(self, share: float = 0.0) -> Carried:
        """The largest factor. The stresses go a share of the way towards a state inside all limits, as far as can be.

        They are those of the program in which 1e-8 of all limits is kept back, if it has an answer: where limits leave
        no room, rounding decides of that.
        """

        def solve(signs: IntArray) -> Carried:
            program, best = self.program(signs), Carried(-np.inf)
            for each in (program.tightened(_TIGHTER), program):
                found = each.solve()
                if isinstance(found, str):
                    if found == UNBOUNDED:
                        return Carried(np.inf)
                    continue
                x, violation = program.repaired(found.x, share)
                grown = max(1.0, program.size(x) / max(1.0, program.size(0.0 * x)))  # stresses beyond loads and limits
                if violation * grown <= HELD:  # else the solver has given up
                    (N, n), (S, s) = self._tractions, self._stress
                    stress = (S @ x + s).reshape(-1, 3, self.cones.count, 3)
                    carried = Carried(float(x[-1]), violation, N @ x + n, unknowns=x, stress=stress)
                    best = max(best, carried, key=lambda one: one.factor)
                    if violation <= ROUNDING:
                        break
            return best

        return with_signs(self.low, solve)

    def room(self) -> float:
        """How much all limits, over the stress of the loads, may be lowered for the mesh to carry some multiple.

        Negative where it carries none: by so much they would have to be raised.
        """
        return self.program().room()[1]

    def program(self, signs: IntArray | None = None) -> ConicProgram:
        """The cone program for signs (e,) of σ_N on contact edges, see `whole_edge_rows`; by default for none."""
        (N, n), (S, s) = self._tractions, self._stress
        H, limit = whole_edge_rows(self.low, np.full(len(both_signs(self.low)), EITHER) if signs is None else signs)
        qvi, b_slope = self.low.qvi, self.high.qvi.b - self.low.qvi.b
        inner = sparse.csr_array((qvi.p, S.shape[1] - 1 - qvi.n))
        A = sparse.hstack([qvi.A, inner, sparse.csr_array(-b_slope[:, None])])
        cones, at = self.cones, 3 * self.cones.coefficient
        xx, yy, xy = (S[at + i] for i in range(3))
        c_xx, c_yy, c_xy = (s[at + i] for i in range(3))
        total, constant, limits = xx + yy, c_xx + c_yy, cones.limit / self.low.scales.stress
        parts: list[tuple[Any, FloatArray]] = [
            (sparse.diags_array(cones.pressure) @ total, limits - cones.pressure * constant),
            (yy - xx, c_xx - c_yy),
            (-2.0 * xy, 2.0 * c_xy),
        ]
        if cones.mean.any():
            parts.append((sparse.diags_array(-cones.mean) @ total, cones.mean * constant))
        q = np.append(np.zeros(S.shape[1] - 1), -1.0)
        return ConicProgram.of(q, (A, qvi.b - b_slope), (H @ N, limit - H @ n), parts)

    @cached_property
    def _tractions(self) -> tuple[sparse.csr_array, FloatArray]:
        """[σ_N; σ_T] as rows on (z, y, α), and what they are at zero; dimensionless."""
        first, second = (np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (self.low, self.high))
        matrix = sparse.csr_array(self.low.qvi.contact_rows)
        inner = sparse.csr_array((len(first), self._stress[0].shape[1] - 1 - matrix.shape[1]))
        rows = sparse.hstack([matrix, inner, sparse.csr_array((second - first)[:, None])])
        return sparse.csr_array(rows), 2.0 * first - second

    @cached_property
    def _stress(self) -> tuple[sparse.csr_array, FloatArray]:
        """Stress coefficients, three numbers each, as rows on (z, y, α), and what they are at zero; dimensionless."""
        space = self.low.space
        element, triangles, k = space.element, space.triangles, space.element.shared - 3
        n, inner, name = len(triangles), element.interior, "ContactProblem.body_potential"
        reference = np.einsum("nab,sbcd->nscad", triangles.stress_maps, element.derivatives[2][..., 3:])
        reference = reference.reshape(n, -1, element.dimension - 3)
        w = reference[..., :k] @ element.transformations(triangles)[:, 3:, 3:]
        y = reference[..., k:].copy()
        if len(space.curved):
            at = space.curved.numbers
            own = reference[at] @ space.curved.functions[:, 3:, 3:]
            w[at], y[at] = own[..., :k], own[..., k:]
        rows, shared = w.shape[1], space.differences.all_rows(w, np.arange(n))
        columns = np.repeat(np.arange(n * inner).reshape(n, inner), rows, axis=0)
        starts = inner * np.arange(n * rows + 1)
        own = sparse.csr_array((y.ravel(), columns.ravel(), starts), shape=(n * rows, n * inner))

        potentials = [
            coefficients_of(part.problem, np.arange(n), self.cones.degree, name, part.problem.body_potential)[0].ravel()
            for part in (self.low, self.high)
        ]

        def combined(low: float, high: float) -> FloatArray:
            """What a multiple of the lower factor's and one of the higher factor's loads give."""
            particular = low * self.low.particular + high * self.high.particular
            phi = (low * potentials[0] + high * potentials[1]) / self.low.scales.stress
            return np.asarray(shared @ particular + np.column_stack([phi, phi, 0.0 * phi]).ravel())

        slope = sparse.csr_array(combined(-1.0, 1.0)[:, None])
        return sparse.csr_array(sparse.hstack([shared @ self.low.basis, own, slope])), combined(2.0, -1.0)
