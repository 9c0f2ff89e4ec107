"""The complementary energy ½ ∫ cσ:σ of a body: triangles condensed, its matrix K of (D2), and its root.

On one triangle with the shared degrees of freedom u and the interior ones v

    ½ ∫ c(σ + φI):(σ + φI) = ½ (u, v) K (u, v) + l·(u, v) + e,   v = −K_vv⁻¹ (K_vu u + l_v) at the least

which leaves ½ uᵀSu + s·u + e'. An affine function adds nothing to it: with the differences w of u to the affine
function that has the value and gradient of the first corner,

    Φ_k − Φ₀ − (x_k − x₀)·∇Φ₀,   ∇Φ_k − ∇Φ₀   in the corners k = 1, 2,   and the coefficients on edges,

it is ½ |U w + U⁻ᵀs|² + rest, where UᵀU are the rows and columns of S behind the third. Nothing large cancels in U w,
however small the triangle is and however far away the gauge.

U depends on materials, what S is made of. Body forces φ enter s and e', prescribed tractions u₀.

Springs along contacts, beds and compliant joints, are a layer between the body and the obstacle, or between the sides.
The law holds for what is left of u behind the springs of stiffness k_N and k_T, u_N + σ_N'/k_N and u_T + σ_T/k_T, and
the energy has

    ½ ∫ σ_N'²/k_N + σ_T²/k_T ds = ½ |S u + s|²

more, with rows of S for the Gauss points of the edges, over the degrees of freedom u of Φ.

In `docs/theory.md`: (D35).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.discretization.loads import ContactRows, EdgePoints, physical, potential_at
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import StressSpace
from qvi_contact.discretization.supports import Supports
from qvi_contact.errors import InputError, place_of
from qvi_contact.problem.conditions import SPRINGS
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.types import Kept, PicklesFields, read_only
from solvers.inequality.body import Stiffness

_LONGEST: Final = 1e3  # longest side over height of a triangle: beyond, too many digits are lost
_BLOCK: Final = 2**24  # entries of element matrices at a time
_TABLE: Final = 2**22  # entries of tables of functions at points at a time
_ORDERED: Final = 2000  # unknowns from which on their order of elimination counts
_EPSILON: Final = float(np.finfo(np.float64).eps) / 2.0
_SOFTEST: Final = 1e-300  # stiffness of a spring
_AFFINE: Final = 3  # degrees of freedom of the first corner, which an affine function is made of


class BodyLoad(NamedTuple):
    """What body forces and initial strains add to the energies of n triangles."""

    constants: FloatArray  # (n, k): U⁻ᵀ s
    rests: FloatArray  # (n,): the energy that no degree of freedom changes
    shifts: FloatArray  # (n, interior): −K_vv⁻¹ l_v


class Springs(NamedTuple):
    """The rows of all springs, dimensionless."""

    rows: sparse.csr_array  # (r, N) sparse: S
    constant: FloatArray  # (r,): s, of body forces and fluids

    @classmethod
    def of(
        cls, problem: ContactProblem, space: StressSpace, scales: Scales, contacts: Sequence[ContactRows]
    ) -> Springs | None:
        """Those of the contacts of a problem; None if all are rigid."""
        parts = []
        for rows, contact in zip(contacts, problem.contacts, strict=True):
            if not contact.has_springs:
                continue
            points = EdgePoints(space, rows.points.edges, space.degree + 1)
            x, y = physical(problem, scales, points.coordinates)
            table = space.trace_rows([points.edges], points.reference).matrix()
            count = len(points.weights)
            for half, name in enumerate(SPRINGS):
                field = getattr(contact, name)
                if field is not None:
                    stiffness = evaluate(f"Contact.{name}", field, x, y, minimum=_SOFTEST)
                    roots = np.sqrt(points.weights / (stiffness * scales.compliance * scales.length))
                    own = np.zeros(count)
                    if half == 0:
                        pressure = evaluate("Contact.pore_pressure", contact.pore_pressure, x, y, minimum=0.0)
                        own = potential_at(problem, scales, points.coordinates) + pressure / scales.stress
                    chosen = table[half * count : (half + 1) * count]
                    parts.append((sparse.diags_array(roots) @ chosen, roots * own))
        if not parts:
            return None
        rows_of, constants = zip(*parts, strict=True)
        return cls(sparse.csr_array(sparse.vstack(rows_of)), np.concatenate(constants))


@dataclass(frozen=True, eq=False)
class BodyStiffness(PicklesFields):
    """K of (D2), the energies of a body's triangles and springs on the unknowns that supports leave, dimensionless.

    `InputError` if a triangle is so thin that rounding takes its energy.
    """

    supports: Supports  # the degrees of freedom u = B z + u₀
    materials: IntArray  # (cells,): which of the compliances each cell has
    compliances: FloatArray  # (k, 3, 3): dimensionless compliances c of (xx, yy, xy)
    springs: Springs | None = None

    @classmethod
    def on(
        cls, supports: Supports, materials: IntArray, compliances: FloatArray, springs: Springs | None, kept: Kept
    ) -> BodyStiffness:
        """That of supports, materials and springs, made once."""
        own = None if springs is None else (springs.rows.data.tobytes(), springs.rows.indices.tobytes())
        key = supports, materials.tobytes(), compliances.tobytes(), own
        return kept(cls, key, lambda: cls(supports, materials, compliances, springs))

    def __post_init__(self) -> None:
        elongations = self.supports.space.triangles.elongations
        thinnest = int(np.argmax(elongations))
        if elongations[thinnest] > _LONGEST:
            around = place_of(self.supports.space.mesh.corners[thinnest].mean(axis=0))
            remedy = f"the triangle around {around} is this many times as long as high: give at most {_LONGEST:g}"
            raise InputError("ContactProblem.mesh", float(elongations[thinnest]), remedy)

    @cached_property
    def roots(self) -> FloatArray:
        """U, upper triangular, times the transformation to the reference triangle; (cells, k, k) on differences w.

        Of ½ |R (v, w)|² with RᵀR the energies, interior degrees of freedom v first: the least over v.
        """
        element = self.supports.space.element
        found = np.empty((len(self.supports.space.triangles), element.shared - _AFFINE, element.shared - _AFFINE))
        for cells, R in self._triangular():
            own = R[:, element.interior :, element.interior :]
            found[cells] = own @ self.supports.space.transformations(cells) if isinstance(cells, slice) else own
        return found

    @cached_property
    def inner(self) -> FloatArray:
        """−K_vv⁻¹ K_vu (cells, interior, k), from the degrees of freedom of the reference triangle behind the third.

        Where triangles have arcs, from differences w. Only stresses inside the body need it.
        """
        element = self.supports.space.element
        v, w = slice(0, element.interior), slice(element.interior, None)
        found = np.empty((len(self.supports.space.triangles), element.interior, element.shared - _AFFINE))
        for cells, R in self._triangular():
            found[cells] = -np.linalg.solve(R[:, v, v], R[:, v, w])
        return found

    def _triangular(self) -> Iterator[tuple[slice | IntArray, FloatArray]]:
        """R (n, …) of all triangles in blocks, as if they were straight, then once more of those that have arcs."""
        space, element = self.supports.space, self.supports.space.element
        step = max(1, _BLOCK // element.dimension**2)
        for start in range(0, len(space.triangles), step):
            block = slice(start, start + step)
            yield block, element.roots(space.triangles.take(block), self.compliances[self.materials[block]])
        if not space.mesh.curved.any():
            return
        step = max(1, _TABLE // (3 * len(space.cell_quadrature[1]) * element.dimension))
        for start in range(0, len(space.curved.numbers), step):
            block = slice(start, start + step)
            cells = space.curved.numbers[block]
            rows = space.curved.stress_rows(block, self.compliances[self.materials[cells]], space.cell_quadrature)
            yield cells, np.asarray(np.linalg.qr(rows[:, :, element.interior_first], mode="r"))

    def loaded(self, stress: FloatArray) -> BodyLoad:
        """What is added where the energy is ½ c(σ + τ):(σ + τ), with τ at the points of `StressSpace.cell_quadrature`.

        That is φI − σ⁰ of a body force and an initial strain, shape (cells, g, 3), see `problem.material`. With
        K = RᵀR the energy is ½ |R (v, w) + R⁻ᵀl|² + e − ½ |R⁻ᵀl|².
        """
        space, element, order = (
            self.supports.space,
            self.supports.space.element,
            self.supports.space.element.interior_first,
        )
        interior, count, (points, weights) = element.interior, len(space.triangles), space.cell_quadrature
        found = BodyLoad(np.empty((count, len(order) - interior)), np.empty(count), np.empty((count, interior)))
        # ∫ cτ:σ is the sum of `strain` at points times the functions' Hessians on the reference triangle
        weighted = stress @ self.compliances[self.materials] * space.cell_measures(points, weights)[..., None]
        strain, rest = weighted @ space.triangles.stress_maps, (weighted * stress).sum(axis=(1, 2)) / 2.0
        table = element.reference_functions(points, 2).reshape(-1, element.dimension)
        for cells, R in self._triangular():
            if isinstance(cells, slice):
                load = strain[cells].reshape(len(R), -1) @ table
            else:
                load = space.curved.load(np.searchsorted(space.curved.numbers, cells), strain[cells], points)
            residual: FloatArray = np.zeros((len(R), len(order)))
            loaded = load.any(axis=1)  # φI does no work in incompressible triangles, whose R is singular
            residual[loaded] = np.linalg.solve(R[loaded].swapaxes(1, 2), load[loaded][:, order, None])[:, :, 0]
            found.rests[cells] = np.maximum(rest[cells] - np.square(residual).sum(axis=1) / 2.0, 0.0)
            found.constants[cells] = residual[:, interior:]
            upper = R[:, :interior, :interior]
            found.shifts[cells] = -np.linalg.solve(upper, residual[:, :interior, None])[:, :, 0]
        return found

    def coefficients(self, u: FloatArray, body: BodyLoad | None) -> FloatArray:
        """Φ of each triangle from the degrees of freedom u (N,), shape (cells, dimension): what `stress` takes.

        First (Φ, Φ_x, Φ_y) in its first corner, which make an affine function, then factors of the functions 3, 4, … of
        the reference triangle, which make the rest.
        """
        space, curved = self.supports.space, self.supports.space.curved
        first, w = space.mesh.cells[:, 0], space.differences.apply(u)
        own = (space.units * u)[3 * first[:, None] + np.arange(_AFFINE)] * ~space.frames.is_centre[first, None]
        affine = own + (space.frames.at_first(space.units) @ u).reshape(-1, _AFFINE)
        shared = (space.transformations() @ w[:, :, None])[:, :, 0]
        at = curved.numbers
        shared[at] = w[at]
        interior = (self.inner @ shared[:, :, None])[:, :, 0]
        if body is not None:
            interior += body.shifts
        found = np.hstack([affine, shared, interior])
        if len(at):
            found[at, 3:] = (curved.functions[:, 3:, 3:] @ found[at, 3:, None])[:, :, 0]
        return found

    @cached_property
    def K(self) -> Any:  # noqa: N802  # letter of (D2)
        """Bᵀ 𝒦 B (n, n), with 𝒦 the matrix of ∫ cσ:τ over u; symmetric up to rounding, dense if small, else sparse."""
        space, roots, basis = self.supports.space, self.roots, self.supports.basis
        rows, dofs, across = space.differences.expanded(roots), space.dofs, None
        if space.differences.beyond is not None:
            across = space.frames.cells_across
            rows, dofs = np.delete(rows, across, axis=0), np.delete(dofs, across, axis=0)
        K = basis.quadratic(rows.swapaxes(1, 2) @ rows, dofs)
        if across is not None:
            R = space.differences.all_rows(roots, across) @ basis.matrix
            K = K + R.T @ R
        if self.springs is not None:
            R = self.springs.rows @ basis.matrix
            K = K + (R.T @ R if sparse.issparse(K) else (R.T @ R).toarray())
        read_only(K)  # sorts it before another thread can see it
        return K

    def matrix(self, kept: Kept) -> Stiffness:
        """K, and what is factorised of it, made once; it does not refer to this."""

        def made() -> Stiffness:
            found = Stiffness(self.K, self.places)
            read_only(found.K)  # by columns where K is dense
            return found

        return kept(Stiffness, self, made)

    @cached_property
    def places(self) -> FloatArray | None:
        """Centres (n, 2) of the vertices and edges whose degrees of freedom belong to each unknown; None for few."""
        space, basis = self.supports.space, self.supports.basis
        if len(basis.kept) < _ORDERED:
            return None
        middles = space.vertices[space.mesh.topology.ends].mean(axis=1)
        own = np.vstack([np.repeat(space.vertices, 3, axis=0), np.repeat(middles, space.element.on_edge, axis=0)])
        weights = abs(basis.matrix)[: len(own)]  # behind them come jumps across cuts, which have no place
        total = np.asarray(weights.sum(axis=0)).ravel()
        centre = space.vertices.mean(axis=0)
        mean = (weights.T @ (own - centre)) / np.where(total > 0.0, total, 1.0)[:, None]
        return np.asarray(centre + mean)


@dataclass(frozen=True, eq=False)
class Root(PicklesFields):
    """z ↦ r(z) = R z + r₀, ½|r|² the energy without K's cancellation: U w + U⁻ᵀs by triangles, √(2 rest), springs."""

    stiffness: BodyStiffness
    particular: FloatArray  # (N,): u₀
    body: BodyLoad | None  # what a body force adds
    springs: FloatArray | float = 0.0  # (r,): what body forces and fluids add to rows of `BodyStiffness.springs`

    def apply(self, z: FloatArray) -> FloatArray:
        """r(z), shape (n (k + 1),)."""
        stiffness, own = self.stiffness, []
        u = stiffness.supports.basis.expanded(z) + self.particular
        w = stiffness.supports.space.differences.apply(u)
        r = (stiffness.roots @ w[:, :, None])[:, :, 0]
        if stiffness.springs is not None:
            own = [stiffness.springs.rows @ u + self.springs]
        if self.body is None:
            return np.concatenate([r.ravel(), np.zeros(len(r)), *own])
        return np.concatenate([(r + self.body.constants).ravel(), np.sqrt(2.0 * self.body.rests), *own])

    def adjoint(self, r: FloatArray) -> FloatArray:
        """Rᵀ r, shape (unknowns,)."""
        stiffness = self.stiffness
        count, k = stiffness.roots.shape[:2]
        w = (r[: count * k].reshape(count, 1, k) @ stiffness.roots)[:, 0]
        full = stiffness.supports.space.differences.adjoint(w)
        if stiffness.springs is not None:
            full = full + stiffness.springs.rows.T @ r[count * (k + 1) :]
        return stiffness.supports.basis.reduced(full)

    def rounding(self, z: FloatArray) -> float:
        """Size of the error of R z that rounding of z may cause: ε ‖ |R| |z| ‖, ε = 2⁻⁵³."""
        stiffness = self.stiffness
        w = stiffness.supports.space.differences.magnitudes(stiffness.supports.basis.magnitudes(z))
        return _EPSILON * float(np.linalg.norm(np.abs(stiffness.roots) @ w[:, :, None]))
