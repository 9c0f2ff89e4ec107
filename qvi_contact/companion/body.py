"""The elastic body: strains (ε_xx, ε_yy, 2ε_xy), stiffness, loads, and the body condensed on its contacts.

All quantities are dimensionless. Derivatives act on differences of neighbouring coefficients, see `Triangle`.

With supports, v = B w + v₀. Elimination of the interior from K v = f + Bᵀ z leaves, on the unknowns Γ in contact rows,

    S w_Γ = r + B_Γᵀ z,      solvable if  Rᵀ(r + B_Γᵀ z) = 0,      w_Γ = G (r + B_Γᵀ z) + R a

with an orthonormal basis R of the motions without energy, G = (S + ρ R Rᵀ)⁻¹, and the sizes a of these motions. The
last unknowns in w_Γ are the stretches of springs, whose stiffness is a block of S, and the motions of plates driven by
force, which have no stiffness. R has the rigid motions that supports leave free, then those of plates.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag, cho_factor, cho_solve

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.discretization.displacements import MISFIT, DisplacementSpace, PrescribedDisplacements
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import bernstein_basis, gauss_legendre
from qvi_contact.mechanism.mechanism import null_space
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from solvers.factorisation.base import Factorisation
from solvers.factorisation.choice import factorise

LOAD_POINTS: Final = 11
"""Gauss points per edge and direction for the work of data on displacements: exact for data up to degree 16."""

_QUADRATURE = 1e-11  # relative difference of two quadratures up to which it is rounding
_ON_ARCS = 6  # additional Gauss points where cells have arcs
_INITIAL = 6  # degree of initial strains up to which their energy is exact
_ENTRIES = ([0, 2], [2, 1])  # positions in (ε_xx, ε_yy, 2ε_xy) of ∂_x and ∂_y of each component

_FREE = 1e-11  # relative singular value of rigid motions at supports that counts as zero
_AS_STRAINED, _FREE_ON_ARCS = 10.0, 1e-5  # zero on arcs: 10 times the relative forces of rigid motions, at most 1e-5
_CORRECTIONS = 3  # steps of defect correction


@dataclass(frozen=True, eq=False)
class Elasticity:
    """The elastic body, dimensionless."""

    space: DisplacementSpace
    moduli: FloatArray  # (cells, 3, 3): stiffness C with σ = C ε + σ⁰, times the unit of compliance
    # σ⁰ of an initial strain (k, q, 3) at points (k, q, 2) of cells (k,), dimensionless
    at_rest: Callable[[IntArray, FloatArray], FloatArray] | None = None
    # (k, k): M with the energy ½ dᵀM d, d the last unknowns: stretches of springs, and motions of plates with M = 0
    beside: sparse.csr_array = field(default_factory=lambda: sparse.csr_array((0, 0)))

    @property
    def size(self) -> int:
        """Number of unknowns, with those of springs and plates."""
        return self.space.size + int(self.beside.shape[0])

    def stiffness(self) -> sparse.csr_array:
        """K with vᵀKv = ∫ ε:C:ε of the body, shape (size, size) of the space."""
        space, n = self.space, self.space.table.shape[1]
        t, measures = self.points()
        gradients, blocks = self.gradients(t), np.empty((len(space.table), n, 2, n, 2))
        for c, d in product((0, 1), repeat=2):
            parts = (measures, gradients, self.moduli[:, _ENTRIES[c]][:, :, _ENTRIES[d]], gradients)
            blocks[:, :, c, :, d] = np.einsum("kq,kqan,kab,kqbm->knm", *parts, optimize=True)
        K = space.assembled(blocks.reshape(-1, 2 * n, 2 * n))
        return sparse.csr_array((K + K.T) / 2.0)

    def gradients(self, t: FloatArray) -> FloatArray:
        """∂B_n/∂x_b of the shape functions at reference points t (q, 2) of all cells, (cells, q, b, n)."""
        along = np.stack([self.space.cell.derivative_values(t) @ each for each in self.space.cell.differences])
        slopes = self.space.inverse_jacobians(slice(None), t)
        return np.asarray(np.einsum("kqab,aqn->kqbn", slopes, along, optimize=True))

    def strain(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Strains of v (size,) at reference points t, (k, 2) for all cells or (cells, k, 2); (cells, k, 3)."""
        cell, local = self.space.cell, v[: self.space.size].reshape(-1, 2)[self.space.table[cells]]
        values = cell.derivative_values(t)
        first, second = (values @ (each @ local) for each in cell.differences)  # ∂u/∂t_a, (cells, k, 2)
        slopes = self.space.inverse_jacobians(cells, t)
        x, y = (slopes[..., 0, b, None] * first + slopes[..., 1, b, None] * second for b in (0, 1))
        return np.stack([x[..., 0], y[..., 1], x[..., 1] + y[..., 0]], axis=-1)

    def initial_stress(self, cells: IntArray | slice, t: FloatArray) -> FloatArray | float:
        """σ⁰ at reference points of cells, (cells, k, 3); 0 without an initial strain."""
        if self.at_rest is None:
            return 0.0
        return self.at_rest(np.arange(len(self.space.table))[cells], self.space.points(cells, t))

    def stress(self, v: FloatArray, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Stresses C ε + σ⁰ of v at reference points of cells, (cells, k, 3)."""
        elastic = self.strain(v, cells, t) @ self.moduli[cells].swapaxes(1, 2)
        return np.asarray(elastic + self.initial_stress(cells, t))

    @cached_property
    def initial_load(self) -> FloatArray:
        """−∫ σ⁰ : ε(v) as a vector (size,), the load of an initial strain."""
        t, weights = self.points()
        if self.at_rest is None:
            return np.zeros(self.size)
        return -self.virtual_work(self.initial_stress(slice(None), t) * weights[..., None], t)

    def points(self) -> tuple[FloatArray, FloatArray]:
        """Reference points t (q, 2) and weights (cells, q) that integrate ε:C:ε exactly where it is a polynomial."""
        most = self.space.degree if self.at_rest is None else max(self.space.degree, _INITIAL)
        t, weights = self.space.cell.quadrature(most + 1 + (_ON_ARCS if self.space.mesh.curved.any() else 0))
        return t, self.space.measures(t, weights)

    def energy(self, v: FloatArray) -> float:
        """½ ∫ (ε − ε⁰) : C : (ε − ε⁰) + ½ dᵀM d."""
        t, weights = self.points()
        d, stress = v[self.space.size :], self.stress(v, slice(None), t)
        work = np.einsum("cq,cqk,cqk->", weights, stress, stress @ np.linalg.inv(self.moduli))
        return 0.5 * (float(work) + float(d @ (self.beside @ d)))

    def force(self, v: FloatArray) -> FloatArray:
        """K v (size,), computed from stresses, and M d."""
        t, weights = self.points()
        stress = self.strain(v, slice(None), t) @ self.moduli.swapaxes(1, 2)
        forces = self.virtual_work(stress * weights[..., None], t)
        forces[self.space.size :] = self.beside @ v[self.space.size :]
        return forces

    def virtual_work(self, stress: FloatArray, t: FloatArray) -> FloatArray:
        """Σ_q stress_q : ε_q(v) as a vector (size,), for stresses (cells, q, 3) times weights at points t (q, 2)."""
        space, cell = self.space, self.space.cell
        x, y, slopes = stress[..., [0, 2]], stress[..., [2, 1]], space.inverse_jacobians(slice(None), t)
        along = (slopes[..., a, 0, None] * x + slopes[..., a, 1, None] * y for a in (0, 1))
        values = cell.derivative_values(t).T
        local = sum(each.T @ (values @ part) for each, part in zip(cell.differences, along, strict=True))
        found = np.bincount(space.dofs.ravel(), np.ravel(local), minlength=self.size)
        return np.asarray(found, dtype=np.float64)


def load_vector(problem: ContactProblem, body: Elasticity, scales: Scales) -> tuple[FloatArray, tuple[str, ...]]:
    """∫ b·v + ∫_{Γσ} T·v as a vector (size,), and remarks on errors of quadrature."""
    space, tractions, found = body.space, np.zeros(body.size), list[str]()
    for traction in problem.prescribed(Traction):
        edges = traction.edges
        field = along_edges(problem.mesh, edges, traction.name, traction.value, LOAD_POINTS)
        lengths = edges.length / scales.length
        along = vectors_along(edges.take(field.edge), traction.direction[field.edge], field.t, turns=traction.turns)
        for component in (0, 1):
            loaded = replace(field, values=field.values * along[..., component])
            work = lengths[:, None] * loaded.moments(space.degree) / scales.stress
            np.add.at(tractions, 2 * space.along(edges) + component, work)
        if field.error > MISFIT * float(np.abs(field.values).max(initial=0.0)):
            size = f"{field.error:.2g} [stress]"
            found.append(
                f"{traction.name} jumps or grows steeply. Quadrature leaves an error of {size} times an edge's length."
            )
    remarks = tuple(dict.fromkeys(found))
    first, second = (
        tractions + _body_load(problem, body, scales, count) for count in (LOAD_POINTS, 2 * LOAD_POINTS + 1)
    )
    error = float(np.abs(first - second).max(initial=0.0))
    if error <= _QUADRATURE * max(float(np.abs(second).max(initial=0.0)), _QUADRATURE):
        return first, remarks
    force = error * scales.stress * scales.length
    changed = f"Loads are not polynomials on each edge or cell. Quadrature changes them by {force:.1e} [force]."
    return second, (changed, *remarks)


def _body_load(problem: ContactProblem, body: Elasticity, scales: Scales, count: int) -> FloatArray:
    """∫ b·v dx with b = −∇φ, as ∫ φ div v dx − ∮ φ v·n ds over every block; φ is taken relative to one point."""
    space, mesh, field = body.space, problem.mesh, problem.body_potential
    if not callable(field):
        return np.zeros(body.size)
    name = "ContactProblem.body_potential"
    t, w = space.cell.quadrature(count)
    points = mesh.origin + scales.length * space.points(slice(None), t)
    base = float(evaluate(name, field, *(mesh.origin + scales.length * space.corners[:1, 0]).T)[0])
    potential = (evaluate(name, field, points[..., 0], points[..., 1]) - base) / scales.stress
    weighted = potential * space.measures(t, w)
    load = body.virtual_work(np.stack([weighted, weighted, 0.0 * weighted], axis=-1), t)
    t, w = gauss_legendre(count)
    shape = bernstein_basis(space.degree, t) * w[:, None]
    joints = [mesh.edges(joint.edges) for joint in problem.joints]
    for edges, is_other in ((mesh.boundary, False), *product(joints, (False, True))):  # outlines of the blocks
        numbers, outward = space.along(edges, other=is_other), -edges.normal if is_other else edges.normal
        values = (evaluate(name, field, *mesh.points_along(edges, t)) - base) / scales.stress
        lengths = edges.length / scales.length
        along = vectors_along(edges, outward, t)
        for component in (0, 1):
            work = -lengths[:, None] * ((values * along[..., component]) @ shape)
            np.add.at(load, 2 * numbers + component, work)
    return load


@dataclass(eq=False)
class CondensedBody:
    """The body condensed on Γ, see the module; w (n,) are the free unknowns, then those of springs and plates."""

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
    closely: float  # relative accuracy of zero on arcs: of rigid motions at supports, and of the work of loads on them

    @classmethod
    def of(
        cls, body: Elasticity, load: FloatArray, supports: PrescribedDisplacements, rows: sparse.csr_array
    ) -> "CondensedBody":
        """Condense on the unknowns in `rows` (n, size); `FactorisationError` or `LinAlgError` if K has no factors."""
        size, extra, kept = body.space.size, body.size - body.space.size, supports.basis.kept
        B, start = supports.beside(extra)
        motions, K = body.space.rigid(), body.stiffness()
        strained = float(np.linalg.norm(K @ motions)) / float(K.diagonal().max())  # rounding, but for arcs
        closely, at_supports = min(_AS_STRAINED * strained, _FREE_ON_ARCS), supports.rows.matrix() @ motions
        interface = np.unique((rows[:, :size] @ supports.basis.matrix).indices)
        for block in range(int(body.space.block.max()) + 1):  # two vertices of each block: Γ determines rigid motions
            of_block = np.flatnonzero(body.space.owner == block)
            position = body.space.places[of_block].sum(axis=1)
            pair = of_block[[int(np.argmin(position)), int(np.argmax(position))]]
            interface = np.union1d(interface, np.flatnonzero(np.isin(kept // 2, pair)))
        K = sparse.csr_array(supports.basis.matrix.T @ K @ supports.basis.matrix)
        shift = float(K.diagonal().mean()) if len(kept) else 0.0
        diagonal_shift = np.zeros(len(kept))
        diagonal_shift[interface] = shift  # makes the matrix positive definite; is subtracted from S again
        factor = factorise(sparse.csc_array(K + sparse.diags_array(diagonal_shift)), interface)
        S = factor.schur - shift * np.eye(len(interface))
        right = B.T @ (load - body.force(start))
        r, _ = factor.reduce(right[: len(kept)])
        # combinations that supports leave free, up to `closely` on arcs
        least = max(_FREE * max(1.0, float(np.linalg.norm(at_supports))), closely)
        rigid = (motions @ null_space(at_supports, least))[kept[interface]]
        rigid = np.asarray(np.linalg.qr(rigid)[0]) if rigid.size else np.zeros((len(rigid), 0))
        R = block_diag(rigid, np.eye(extra)[:, body.beside.diagonal() == 0.0])
        S, r = block_diag(S, body.beside.toarray()), np.append(r, right[len(kept) :])
        interface, cholesky = np.append(interface, len(kept) + np.arange(extra)), (S, True)
        if len(S):
            cholesky = cho_factor(S + float(np.trace(S)) / len(S) * R @ R.T, lower=True)
        return cls(body, load, B, start, interface, factor, S, r, R, cholesky, closely)

    def relieve(self, forces: FloatArray) -> FloatArray:
        """G times forces on Γ, (k,) or (k, j)."""
        return np.asarray(cho_solve(self.cholesky, forces)) if forces.size else forces

    def expand(self, values: FloatArray) -> FloatArray:
        """The v (size,) in equilibrium for w_Γ on Γ; defect corrections remove rounding."""
        w, free = np.zeros(self.B.shape[1]), self.factor.size
        w[self.interface] = values
        for _ in range(_CORRECTIONS):
            _, state = self.factor.reduce((self.B.T @ (self.load - self.body.force(self.B @ w + self.start)))[:free])
            w[:free] += self.factor.expand(state, np.zeros(self.factor.interface.size))
        return np.asarray(self.B @ w + self.start)
