"""The elastic body: strains (ε_xx, ε_yy, 2ε_xy), stiffness, loads, and the body condensed on its contacts.

All is dimensionless. Derivatives act on differences of neighbouring coefficients, see `Triangle`.

With supports, v = B w + v₀, and the interior eliminated, K v = f + Bᵀ z leaves on Γ, what contact rows touch,

    S w_Γ = r + B_Γᵀ z,      solvable if  Rᵀ(r + B_Γᵀ z) = 0,      w_Γ = G (r + B_Γᵀ z) + R a

with R an orthonormal basis of the motions that cost no energy, G = (S + ρ R Rᵀ)⁻¹, and a their size. Beside the body,
and last in w_Γ, come the stretches of springs, whose stiffness is a block of S, and the motions of plates that forces
drive, which have none: R has the rigid motions that supports leave free, then those of plates.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag, cho_factor, cho_solve

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.discretization.displacements import (
    MISFIT,
    DisplacementSpace,
    PrescribedDisplacements,
    reference_matrices,
)
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import bernstein_basis, gauss_legendre
from qvi_contact.mechanism.mechanism import null_space
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from solvers.factorisation.base import Factorisation, FactorisationError
from solvers.factorisation.choice import factorise


def load_points(degree: int) -> int:
    """Gauss points an edge and direction for work done by data: exact for data up to degree 19 − p."""
    return max(10, degree + 6)


_QUADRATURE = 1e-11  # relative difference of two quadratures that counts as rounding
_ON_ARCS = 6  # Gauss points more where cells have arcs
_INITIAL = 6  # degree of the quadrature with initial strains, half of it: those up to this degree have exact energies
_ENTRIES = ([0, 2], [2, 1])  # of (ε_xx, ε_yy, 2ε_xy): where ∂_x and ∂_y of each component go to

_FREE = 1e-11  # singular value of rigid motions at supports, relative, that counts as zero
_AS_STRAINED, _FREE_ON_ARCS = 10.0, 1e-5  # beside arcs, of the forces that strain a rigid motion, and at most
_CORRECTIONS = 3


@dataclass(frozen=True, eq=False)
class Elasticity:
    """The elastic body, dimensionless."""

    space: DisplacementSpace
    moduli: FloatArray  # (cells, 3, 3): stiffness C with σ = C ε + σ⁰, times the unit of compliance
    # σ⁰ of an initial strain (k, q, 3) at points (k, q, 2) of cells (k,), dimensionless
    at_rest: Callable[[IntArray, FloatArray], FloatArray] | None = None
    # (k, k): M with the energy ½ dᵀM d of what is beside the body, stretches of springs and, without stiffness, motions
    # of plates, which follow the degrees of freedom of `space` in displacements v (size,)
    beside: sparse.csr_array = field(default_factory=lambda: sparse.csr_array((0, 0)))

    @property
    def size(self) -> int:
        """Number of degrees of freedom, with those beside the body."""
        return self.space.size + int(self.beside.shape[0])

    def stiffness(self) -> sparse.csr_array:
        """K with vᵀKv = ∫ ε:C:ε of the body, shape (size, size) of the space; cells with arcs by quadrature."""
        space, curved = self.space, self.space.curved
        local, slopes, n = reference_matrices(space.cell), space.slopes, space.table.shape[1]
        t, w = space.cell.quadrature(self._count)
        along = np.stack([space.cell.derivative_values(t) @ each for each in space.cell.differences])
        bent = curved.numbers
        gradients = np.einsum("kqab,aqn->kqbn", space.inverse_jacobians(bent, t), along)
        measures, blocks = space.measures(t, w)[bent], np.empty((len(space.table), n, 2, n, 2))
        for c, d in product((0, 1), repeat=2):
            moduli = self.moduli[:, _ENTRIES[c]][:, :, _ENTRIES[d]]
            weights = space.areas[:, None, None] * (slopes @ moduli @ slopes.swapaxes(1, 2))
            blocks[:, :, c, :, d] = (weights.reshape(-1, 4) @ local.reshape(4, n * n)).reshape(-1, n, n)
            parts = (measures, gradients, moduli[bent], gradients)
            blocks[bent, :, c, :, d] = np.einsum("kq,kqan,kab,kqbm->knm", *parts, optimize=True)
        K = space.assembled(blocks.reshape(-1, 2 * n, 2 * n))
        return sparse.csr_array((K + K.T) / 2.0)

    @property
    def _count(self) -> int:
        """Gauss points a direction: exact for ε:C:ε of polynomials; arcs, which are none, take more."""
        most = self.space.degree if self.at_rest is None else max(self.space.degree, _INITIAL)
        return most + 1 + (_ON_ARCS if len(self.space.curved.numbers) else 0)

    def strain(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Strains of v (size,) at reference points t, (k, 2) for all cells or (cells, k, 2); (cells, k, 3)."""
        cell, local = self.space.cell, v[: self.space.size].reshape(-1, 2)[self.space.table[cells]]
        values = cell.derivative_values(t)
        first, second = (values @ (each @ local) for each in cell.differences)  # ∂u/∂t_a, (cells, k, 2)
        slopes = self.space.inverse_jacobians(cells, t)
        x, y = (slopes[..., 0, b, None] * first + slopes[..., 1, b, None] * second for b in (0, 1))
        return np.stack([x[..., 0], y[..., 1], x[..., 1] + y[..., 0]], axis=-1)

    def initial_stress(self, cells: IntArray | slice, t: FloatArray) -> FloatArray | float:
        """σ⁰ at such points, (cells, k, 3); 0 without an initial strain."""
        if self.at_rest is None:
            return 0.0
        return self.at_rest(np.arange(len(self.space.table))[cells], self.space.points(cells, t))

    def stress(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Stresses C ε + σ⁰ of v at such points, (cells, k, 3)."""
        found = self.strain(v, cells, t) @ self.moduli[cells].swapaxes(1, 2)
        return np.asarray(found + self.initial_stress(cells, t))

    @cached_property
    def initial_load(self) -> FloatArray:
        """−∫ σ⁰ : ε(v) as a vector (size,): the load by which an initial strain deforms the body."""
        t, weights = self.points()
        if self.at_rest is None:
            return np.zeros(self.size)
        return -self.virtual_work(self.initial_stress(slice(None), t) * weights[..., None], t)

    def points(self) -> tuple[FloatArray, FloatArray]:
        """Reference points t (q, 2) and weights (cells, q) that integrate ε:C:ε exactly."""
        t, weights = self.space.cell.quadrature(self._count)
        return t, self.space.measures(t, weights)

    def energy(self, v: FloatArray) -> float:
        """½ ∫ (ε − ε⁰) : C : (ε − ε⁰) + ½ dᵀM d."""
        t, weights = self.points()
        d, stress = v[self.space.size :], self.stress(v, slice(None), t)
        work = np.einsum("cq,cqk,cqk->", weights, stress, stress @ np.linalg.inv(self.moduli))
        return 0.5 * (float(work) + float(d @ (self.beside @ d)))

    def force(self, v: FloatArray) -> FloatArray:
        """K v (size,), through stresses, and M d."""
        t, weights = self.points()
        stress = self.strain(v, slice(None), t) @ self.moduli.swapaxes(1, 2)
        found = self.virtual_work(stress * weights[..., None], t)
        found[self.space.size :] = self.beside @ v[self.space.size :]
        return found

    def virtual_work(self, stress: FloatArray, t: FloatArray) -> FloatArray:
        """Σ_q stress_q : ε_q(v) as a vector (size,), for weighted stresses (cells, q, 3) at points t (q, 2)."""
        space, cell = self.space, self.space.cell
        x, y, slopes = stress[..., [0, 2]], stress[..., [2, 1]], space.inverse_jacobians(slice(None), t)
        along = (slopes[..., a, 0, None] * x + slopes[..., a, 1, None] * y for a in (0, 1))
        values = cell.derivative_values(t).T
        local = sum(each.T @ (values @ part) for each, part in zip(cell.differences, along, strict=True))
        found = np.bincount(space.dofs.ravel(), np.ravel(local), minlength=self.size)
        return np.asarray(found, dtype=np.float64)


def load_vector(problem: ContactProblem, body: Elasticity, scales: Scales) -> tuple[FloatArray, tuple[str, ...]]:
    """∫ b·v + ∫_{Γσ} T·v as a vector (size,), and what quadrature leaves of it; a body potential is seen by two."""
    space, tractions, found = body.space, np.zeros(body.size), list[str]()
    for given in problem.prescribed(Traction):
        edges, count = given.edges, load_points(space.degree)
        part = along_edges(problem.mesh, edges, given.name, given.value, count)
        lengths = edges.length / scales.length
        along = vectors_along(edges.take(part.edge), given.direction[part.edge], part.t, turns=given.turns)
        for component in (0, 1):
            loaded = replace(part, values=part.values * along[..., component])
            work = lengths[:, None] * loaded.moments(space.degree) / scales.stress
            np.add.at(tractions, 2 * space.along(edges) + component, work)
        if part.error > MISFIT * float(np.abs(part.values).max(initial=0.0)):
            size = f"{part.error:.2g} [stress]"
            found.append(
                f"{given.name} jumps or grows steeply. Quadrature leaves an error of {size} times an edge's length."
            )
    remarks = tuple(dict.fromkeys(found))
    first, second = (
        tractions + _body_load(problem, body, scales, count)
        for count in (load_points(space.degree), 2 * load_points(space.degree) + 1)
    )
    error = float(np.abs(first - second).max(initial=0.0))
    if error <= _QUADRATURE * max(float(np.abs(second).max(initial=0.0)), _QUADRATURE):
        return first, remarks
    force = error * scales.stress * scales.length
    changed = f"Loads are not polynomials on each edge or cell. Quadrature changes them by {force:.1e} [force]."
    return second, (changed, *remarks)


def _body_load(problem: ContactProblem, body: Elasticity, scales: Scales, count: int) -> FloatArray:
    """∫ b·v dx with b = −∇φ, as ∫ φ div v dx − ∮ φ v·n ds over every block; φ counts from its value at one point."""
    space, mesh, field = body.space, problem.mesh, problem.body_potential
    if not callable(field):
        return np.zeros(body.size)
    name = "ContactProblem.body_potential"
    t, w = space.cell.quadrature(count)
    places = mesh.origin + scales.length * space.points(slice(None), t)
    base = float(evaluate(name, field, *(mesh.origin + scales.length * space.origins[:1]).T)[0])
    potential = (evaluate(name, field, places[..., 0], places[..., 1]) - base) / scales.stress
    weighted = potential * space.measures(t, w)
    load = body.virtual_work(np.stack([weighted, weighted, 0.0 * weighted], axis=-1), t)
    t, w = gauss_legendre(count)
    shape = bernstein_basis(space.degree, t) * w[:, None]
    outlines = [(mesh.boundary, space.along(mesh.boundary), mesh.boundary.normal)]  # with outward normals
    for joint in problem.joints:
        edges = mesh.edges(joint.edges)
        outlines.append((edges, space.along(edges), edges.normal))
        outlines.append((edges, space.along(edges, other=True), -edges.normal))
    for edges, numbers, outward in outlines:
        values = (evaluate(name, field, *mesh.points_along(edges, t)) - base) / scales.stress
        lengths = edges.length / scales.length
        along = vectors_along(edges, outward, t)
        for component in (0, 1):
            work = -lengths[:, None] * ((values * along[..., component]) @ shape)
            np.add.at(load, 2 * numbers + component, work)
    return load


@dataclass(eq=False)
class CondensedBody:
    """See the module; w (n,) are what supports leave free and what is beside the body, w_Γ those of `interface`."""

    body: Elasticity
    load: FloatArray  # (size,): f
    B: sparse.csr_array  # (size, n): v = B w + v₀
    start: FloatArray  # (size,): v₀
    interface: IntArray  # (k,): Γ, ascending
    factor: Factorisation
    S: FloatArray  # (k, k): the condensed stiffness
    r: FloatArray  # (k,): right-hand side on Γ
    R: FloatArray  # (k, j): motions that cost no energy
    cholesky: tuple[FloatArray, bool]
    closely: float  # share of their size to which rigid motions rest, and loads do no work on them, beside arcs

    @classmethod
    def of(
        cls, body: Elasticity, load: FloatArray, supports: PrescribedDisplacements, rows: sparse.csr_array
    ) -> "CondensedBody":
        """Condense on what rows (n, size) of v touch; `FactorisationError` if the stiffness cannot be factorised."""
        size, more, kept = body.space.size, body.size - body.space.size, supports.basis.kept
        B, start = supports.beside(more)
        motions, K = body.space.rigid(), body.stiffness()
        strained = float(np.linalg.norm(K @ motions)) / float(K.diagonal().max())  # on arcs alone more than rounding
        closely, known = min(_AS_STRAINED * strained, _FREE_ON_ARCS), supports.rows.matrix() @ motions
        interface = np.unique((rows[:, :size] @ supports.basis.matrix).indices)
        for block in range(int(body.space.block.max()) + 1):  # Γ must hold all motions: if need be by two vertices
            own = slice(3 * block, 3 * block + 3)
            if _unheld(np.vstack([known[:, own], motions[kept[interface], own]]), closely).shape[1]:
                mine = np.flatnonzero(body.space.owner == block)
                place = body.space.places[mine].sum(axis=1)
                pair = mine[[int(np.argmin(place)), int(np.argmax(place))]]
                interface = np.union1d(interface, np.flatnonzero(np.isin(kept // 2, pair)))
        K = sparse.csr_array(supports.basis.matrix.T @ K @ supports.basis.matrix)
        shift = float(K.diagonal().mean()) if len(kept) else 0.0
        held = np.zeros(len(kept))
        held[interface] = shift  # back ends want a positive definite matrix; S has it on its diagonal, and is rid of it
        factor = factorise(sparse.csc_array(K + sparse.diags_array(held)), interface)
        S = factor.schur - shift * np.eye(len(interface))
        right = B.T @ (load - body.force(start))
        r, _ = factor.reduce(right[: len(kept)])
        rigid = (motions @ _unheld(known, closely))[kept[interface]]
        rigid = np.asarray(np.linalg.qr(rigid)[0]) if rigid.size else np.zeros((len(rigid), 0))
        R = block_diag(rigid, np.eye(more)[:, body.beside.diagonal() == 0.0])
        S, r = block_diag(S, body.beside.toarray()), np.append(r, right[len(kept) :])
        interface, stiffened = np.append(interface, len(kept) + np.arange(more)), (S, True)
        if len(S):
            rho = float(np.trace(S)) / len(S)
            try:
                stiffened = cho_factor(S + rho * R @ R.T, lower=True)
            except np.linalg.LinAlgError as error:
                message = "the condensed stiffness is not positive definite"
                raise FactorisationError("singular", "lapack", message) from error
        return cls(body, load, B, start, interface, factor, S, r, R, stiffened, closely)

    def relieve(self, forces: FloatArray) -> FloatArray:
        """G times forces on Γ, (k,) or (k, j)."""
        return np.asarray(cho_solve(self.cholesky, forces)) if forces.size else forces

    def expand(self, values: FloatArray) -> FloatArray:
        """V (size,) from w_Γ, the rest in equilibrium: defect corrections remove rounding."""
        w, free = np.zeros(self.B.shape[1]), self.factor.size
        w[self.interface] = values
        for _ in range(_CORRECTIONS):
            _, state = self.factor.reduce((self.B.T @ (self.load - self.body.force(self.B @ w + self.start)))[:free])
            w[:free] += self.factor.expand(state, np.zeros(self.factor.interface.size))
        return np.asarray(self.B @ w + self.start)


def _unheld(motions: FloatArray, closely: float) -> FloatArray:
    """Combinations (k, j) of rigid motions of size one that rest where these (m, k) are, beside arcs as `closely`."""
    return null_space(motions, max(_FREE * max(1.0, float(np.linalg.norm(motions))), closely))
