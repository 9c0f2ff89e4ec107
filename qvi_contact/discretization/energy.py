"""The complementary energy ½ ∫ cσ:σ of a body: triangles with interior functions condensed, the matrix K, its root.

On one triangle with the shared degrees of freedom u and the interior ones v

    ½ ∫ c(σ + φI):(σ + φI) dx = ½ (u, v)ᵀK(u, v) + l·(u, v) + e.

Its minimum over v, at v = −K_vv⁻¹ (K_vu u + l_v), is ½ uᵀSu + s·u + e' with the Schur complement S. The energy of an
affine function is zero. With the differences w of u to the affine function with Φ and ∇Φ of the first corner,

    Φ_k − Φ₀ − (x_k − x₀)·∇Φ₀,   ∇Φ_k − ∇Φ₀   in the corners k = 1, 2,   and the coefficients on edges,

the minimum is ½ |U w + U⁻ᵀs|² + rest. UᵀU is S without its first three rows and columns. No large numbers cancel in
U w, however small the triangle is and however far away the gauge. U depends on the triangle and its material. Body
forces and initial strains enter s and e', prescribed tractions u₀.

Springs along contacts (beds and compliant joints) are a layer between the body and the obstacle, or between the two
sides of a joint. Behind springs of stiffness k_N and k_T the contact law holds for the displacements u_N + σ_N'/k_N and
u_T + σ_T/k_T, and the springs add the energy

    ½ ∫ σ_N'²/k_N + σ_T²/k_T ds = ½ |S u + s|²

with a row of this S for each Gauss point of the edges and component, over all u of Φ.

In `docs/theory.md`: (D35).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

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

_LONGEST: Final = 1e3  # largest ratio of longest side to height of a triangle: beyond it too many digits are lost
_BLOCK: Final = 2**24  # entries of the element matrices that are computed at a time
_TABLE: Final = 2**22  # entries of the tables of functions at points that are computed at a time
_ORDERED: Final = 2000  # number of unknowns from which on their order of elimination matters
_EPSILON: Final = float(np.finfo(np.float64).eps) / 2.0  # relative error of rounding one number, 2⁻⁵³
_CANCELLED: Final = 1e-10  # rest of the energy of a body load, over that energy, up to which it is rounding
_SOFTEST: Final = 1e-300  # least stiffness of a spring, positive and above underflow [stress/length]
_AFFINE: Final = 3  # Φ and ∇Φ in the first corner, which define its affine function


class BodyLoad(NamedTuple):
    """Terms of body forces and initial strains in the energies of n triangles."""

    constants: FloatArray  # (n, k): U⁻ᵀ s
    rests: FloatArray  # (n,): the rest of the energy, independent of all degrees of freedom
    shifts: FloatArray  # (n, interior): −K_vv⁻¹ l_v


class Springs(NamedTuple):
    """The rows of all springs, dimensionless."""

    rows: sparse.csr_array  # (r, N) sparse: S
    constant: FloatArray  # (r,): s, from body forces and fluids

    @classmethod
    def of(
        cls, problem: ContactProblem, space: StressSpace, scales: Scales, contacts: Sequence[ContactRows]
    ) -> Springs | None:
        """The springs of the contacts of a problem; None if there are none."""
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
                    constant = np.zeros(count)
                    if half == 0:  # σ_N' has φ and p_w
                        pressure = evaluate("Contact.pore_pressure", contact.pore_pressure, x, y, minimum=0.0)
                        constant = potential_at(problem, scales, points.coordinates) + pressure / scales.stress
                    tractions = table[half * count : (half + 1) * count]
                    parts.append((sparse.diags_array(roots) @ tractions, roots * constant))
        if not parts:
            return None
        rows_of, constants = zip(*parts, strict=True)
        return cls(sparse.csr_array(sparse.vstack(rows_of)), np.concatenate(constants))


@dataclass(frozen=True, eq=False)
class BodyStiffness(PicklesFields):
    """K of (D2): the energy of a body's triangles and springs in the unknowns z, dimensionless.

    `InputError` if a triangle is so thin that its energy would be lost in rounding.
    """

    supports: Supports  # u = B z + u₀
    materials: IntArray  # (cells,): index of each cell's compliance
    compliances: FloatArray  # (k, 3, 3): dimensionless compliances c of (xx, yy, xy)
    springs: Springs | None = None

    @classmethod
    def on(
        cls, supports: Supports, materials: IntArray, compliances: FloatArray, springs: Springs | None, kept: Kept
    ) -> BodyStiffness:
        """The stiffness for these supports, materials and springs, made once and kept."""
        of_springs = None if springs is None else (springs.rows.data.tobytes(), springs.rows.indices.tobytes())
        key = supports, materials.tobytes(), compliances.tobytes(), of_springs
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
        """U (cells, k, k) on the differences w, so that ½ |U w|² is the least energy of each triangle over v.

        As R of `_triangular` has v first, its last block is U in the reference triangle; w is transformed to that.
        """
        element = self.supports.space.element
        roots = np.empty((len(self.supports.space.triangles), element.shared - _AFFINE, element.shared - _AFFINE))
        for cells, R in self._triangular():
            U = R[:, element.interior :, element.interior :]
            roots[cells] = U @ self.supports.space.transformations(cells) if isinstance(cells, slice) else U
        return roots

    @cached_property
    def inner(self) -> FloatArray:
        """−K_vv⁻¹ K_vu (cells, interior, k): from the reference triangle's shared degrees of freedom to v.

        The first three are left out. In triangles with arcs the map is from w. Only stresses inside the body need it.
        """
        element = self.supports.space.element
        v, w = slice(0, element.interior), slice(element.interior, None)
        inner = np.empty((len(self.supports.space.triangles), element.interior, element.shared - _AFFINE))
        for cells, R in self._triangular():
            inner[cells] = -np.linalg.solve(R[:, v, v], R[:, v, w])
        return inner

    def _triangular(self) -> Iterator[tuple[slice | IntArray, FloatArray]]:
        """Blocks of cells with R, upper triangular, RᵀR the energies of (v, w); cells with arcs come a second time."""
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
        """The terms of a stress τ (cells, g, 3) in the energy ½ c(σ + τ):(σ + τ).

        τ = φI − σ⁰ of body forces and initial strains, see `problem.material`, is given at the points of
        `StressSpace.cell_quadrature`. With K = RᵀR the energy is ½ |R (v, w) + R⁻ᵀl|² + e − ½ |R⁻ᵀl|².
        """
        space = self.supports.space
        element, order = space.element, space.element.interior_first
        interior, count, (points, weights) = element.interior, len(space.triangles), space.cell_quadrature
        body = BodyLoad(np.empty((count, len(order) - interior)), np.empty(count), np.empty((count, interior)))
        # l: ∫ cτ:σ is the sum of `strain` at points times the functions' Hessians on the reference triangle; e: ½∫ cτ:τ
        weighted = stress @ self.compliances[self.materials] * space.cell_measures(points, weights)[..., None]
        strain, energies = weighted @ space.triangles.stress_maps, (weighted * stress).sum(axis=(1, 2)) / 2.0
        table = element.reference_functions(points, 2).reshape(-1, element.dimension)
        for cells, R in self._triangular():
            if isinstance(cells, slice):
                load = strain[cells].reshape(len(R), -1) @ table
            else:
                load = space.curved.load(np.searchsorted(space.curved.numbers, cells), strain[cells], points)
            constants: FloatArray = np.zeros((len(R), len(order)))  # R⁻ᵀ l
            loaded = load.any(axis=1)  # φI does no work in incompressible triangles, whose R is singular
            constants[loaded] = np.linalg.solve(R[loaded].swapaxes(1, 2), load[loaded][:, order, None])[:, :, 0]
            rests = energies[cells] - np.square(constants).sum(axis=1) / 2.0
            body.rests[cells] = np.where(rests > _CANCELLED * energies[cells], rests, 0.0)
            body.constants[cells] = constants[:, interior:]
            upper = R[:, :interior, :interior]
            body.shifts[cells] = -np.linalg.solve(upper, constants[:, :interior, None])[:, :, 0]
        return body

    def coefficients(self, u: FloatArray, body: BodyLoad | None) -> FloatArray:
        """Coefficients (cells, dimension) of Φ in each triangle from u (N,), the argument of `StressSpace.stress`.

        The first three are Φ, Φ_x, Φ_y in the first corner, for the affine part of Φ. The others are factors of the
        functions 3, 4, … of the reference triangle, for the rest of Φ.
        """
        space, curved = self.supports.space, self.supports.space.curved
        first, w = space.mesh.cells[:, 0], space.differences.apply(u)
        at_corner = (space.units * u)[3 * first[:, None] + np.arange(_AFFINE)] * ~space.frames.is_centre[first, None]
        affine = at_corner + (space.frames.at_first(space.units) @ u).reshape(-1, _AFFINE)
        shared = (space.transformations() @ w[:, :, None])[:, :, 0]
        with_arcs = curved.numbers
        shared[with_arcs] = w[with_arcs]
        interior = (self.inner @ shared[:, :, None])[:, :, 0]
        if body is not None:
            interior += body.shifts
        factors = np.hstack([affine, shared, interior])
        if len(with_arcs):
            factors[with_arcs, 3:] = (curved.functions[:, 3:, 3:] @ factors[with_arcs, 3:, None])[:, :, 0]
        return factors

    def matrix(self, kept: Kept) -> Stiffness:
        """K = Bᵀ 𝒦 B (n, n) with its factorisation, 𝒦 the matrix of ∫ cσ:τ over u; dense if small, else sparse.

        K is symmetric up to rounding. It is made once and kept; it holds no reference to this object, the key.
        """

        def made() -> Stiffness:
            space, roots, basis = self.supports.space, self.roots, self.supports.basis
            rows, dofs, across = space.differences.expanded(roots), space.dofs, None
            if space.differences.beyond is not None:
                across = space.frames.cells_across
                rows, dofs = np.delete(rows, across, axis=0), np.delete(dofs, across, axis=0)
            K = basis.quadratic(rows.swapaxes(1, 2) @ rows, dofs)
            if across is not None:  # triangles whose corners count from several frames
                R = space.differences.all_rows(roots, across) @ basis.matrix
                K = K + R.T @ R
            if self.springs is not None:
                R = self.springs.rows @ basis.matrix
                K = K + (R.T @ R if sparse.issparse(K) else (R.T @ R).toarray())
            stiffness = Stiffness(K, self._places())
            read_only(stiffness.K)  # also sorts the indices, before another thread can see K
            return stiffness

        return kept(Stiffness, self, made)

    def _places(self) -> FloatArray | None:
        """Mean place (n, 2) of the vertices and edges that each unknown acts on, for ordering; None if n is small."""
        space, basis = self.supports.space, self.supports.basis
        if len(basis.kept) < _ORDERED:
            return None
        middles = space.vertices[space.mesh.topology.ends].mean(axis=1)
        places = np.vstack([np.repeat(space.vertices, 3, axis=0), np.repeat(middles, space.element.on_edge, axis=0)])
        weights = abs(basis.matrix)[: len(places)]  # jumps across cuts, the last degrees of freedom, have no place
        total = np.asarray(weights.sum(axis=0)).ravel()
        centre = space.vertices.mean(axis=0)
        mean = (weights.T @ (places - centre)) / np.where(total > 0.0, total, 1.0)[:, None]
        return np.asarray(centre + mean)


@dataclass(frozen=True, eq=False)
class Root(PicklesFields):
    """The affine map r(z) = R z + r₀ whose ½|r|² is the energy, free of the cancellation in ½ zᵀK z.

    Its entries are U w + U⁻ᵀs of all triangles, then S u + s of the springs, then √(2 rest) of triangles with loads.
    """

    stiffness: BodyStiffness
    particular: FloatArray  # (N,): u₀
    body: BodyLoad | None  # None without body forces and initial strains
    springs: FloatArray | float = 0.0  # (r,): s of the springs, from body forces and fluids

    def apply(self, z: FloatArray) -> FloatArray:
        """r(z), shape (n k + springs + n,), without the last n entries if there is no `body`."""
        stiffness, body = self.stiffness, self.body
        u = stiffness.supports.basis.expanded(z) + self.particular
        r = (stiffness.roots @ stiffness.supports.space.differences.apply(u)[:, :, None])[:, :, 0]
        parts = [(r if body is None else r + body.constants).ravel()]
        if stiffness.springs is not None:
            parts.append(stiffness.springs.rows @ u + self.springs)
        if body is not None:
            parts.append(np.sqrt(2.0 * body.rests))
        return np.concatenate(parts)

    def adjoint(self, r: FloatArray) -> FloatArray:
        """Rᵀ r, shape (unknowns,)."""
        stiffness = self.stiffness
        count, k = stiffness.roots.shape[:2]
        w = (r[: count * k].reshape(count, 1, k) @ stiffness.roots)[:, 0]
        on_dofs = stiffness.supports.space.differences.adjoint(w)
        if stiffness.springs is not None:
            rows = stiffness.springs.rows
            on_dofs = on_dofs + rows.T @ r[count * k :][: rows.shape[0]]
        return stiffness.supports.basis.reduced(on_dofs)

    def rounding(self, z: FloatArray) -> float:
        """Bound of the error of R z from rounding z: ε ‖ |R| |z| ‖ with ε = 2⁻⁵³."""
        stiffness = self.stiffness
        w = stiffness.supports.space.differences.magnitudes(stiffness.supports.basis.magnitudes(z))
        return _EPSILON * float(np.linalg.norm(np.abs(stiffness.roots) @ w[:, :, None]))
