"""The elastic body: strains (ε_xx, ε_yy, 2ε_xy), stiffness, loads, supports, and the body condensed on its contacts.

All is dimensionless. Derivatives act on differences of neighbouring coefficients, see `Triangle`. Component d·v of a
coefficient is one degree of freedom if d is an axis. Where a support prescribes one component along another direction
the two degrees of freedom of the coefficient are d·v and d⊥·v instead, with d⊥ = (−d_y, d_x):

    v = Q w,   Q orthogonal and the identity elsewhere.

Two directions at a coefficient prescribe both components. Along arcs, whose directions turn, coefficients inside are
those of the polynomials n·v and t·v instead (see `along_arcs`): w = R v for all of them, and Q = R⁻¹ edge by edge.

With the prescribed degrees of freedom taken out and the interior eliminated, K v = f + Bᵀ z leaves on Γ, what contact
rows touch,

    S w_Γ = r + B_Γᵀ z,      solvable if  Rᵀ(r + B_Γᵀ z) = 0,      w_Γ = G (r + B_Γᵀ z) + R a

with R an orthonormal basis of the rigid motions that the supports leave free, G = (S + ρ R Rᵀ)⁻¹, and a their size.
Stretches of springs come last in w_Γ: S has their stiffness as a block of its own, and rigid motions leave them as they
are.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy import sparse
from scipy.linalg import block_diag, cho_factor, cho_solve

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.companion.space import DisplacementSpace, reference_matrices, spread
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.element.quadrature import EdgeQuadrature
from qvi_contact.mechanism.mechanism import null_space
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Displacement, Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from solvers.factorisation import Factorisation, FactorisationError, factorise

MISFIT = 1e-10
"""Difference between data and their polynomial on an edge, relative to the data's unit, that counts as rounding."""

PARALLEL = 1e-8
"""Sine of the angle between two directions that is the rounding of coordinates."""


def load_points(degree: int) -> int:
    """Gauss points an edge and direction for work done by data: exact for data up to degree 19 − p."""
    return max(10, degree + 6)


def edge_data(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, degree: int, unit: float
) -> tuple[FloatArray, float]:
    """A field on edges over its unit as polynomials: Bernstein coefficients (e, degree + 1), and the most they miss.

    The polynomial meets the function at both ends of each edge; what it misses is seen at `bernstein.SAMPLES`.
    """
    t = bernstein.nodes(degree)
    values = evaluate(name, field, *mesh.points_along(edges, t)) / unit
    coefficients = values @ bernstein.from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    if not callable(field):
        return np.broadcast_to(values[:, :1], coefficients.shape).copy(), 0.0
    t = bernstein.SAMPLES
    wanted = evaluate(name, field, *mesh.points_along(edges, t)) / unit
    misfit = np.abs(coefficients @ bernstein.basis(degree, t).T - wanted)
    return coefficients, float(misfit.max(initial=0.0))


def along_arcs(arcs: Edges, vectors: FloatArray, degree: int) -> FloatArray:
    """Inner coefficients of the polynomial d(t)·v(t) at p + 1 nodes of arcs, from those of v (n, p − 1, p + 1, 2)."""
    nodes = bernstein.nodes(degree)
    project, values = bernstein.from_values(degree)[1:-1], bernstein.basis(degree, nodes)
    return np.asarray(np.einsum("ki,eia,ij->ekja", project, vectors_along(arcs, vectors, nodes), values))


def moments(given: EdgeQuadrature, degree: int) -> FloatArray:
    """∫₀¹ f B_i dt (e, degree + 1) of a function on e edges."""
    return given.integrals(bernstein.basis(degree, given.t.ravel()).reshape(*given.t.shape, -1))


@dataclass(frozen=True, eq=False)
class Supports:
    """Prescribed displacements."""

    index: IntArray  # index, values, (f,) each: degrees of freedom w that are prescribed, ascending, and their values
    values: FloatArray
    axes: sparse.csr_array  # axes, inverse, (size, size) each: Q and R = Q⁻¹
    inverse: sparse.csr_array
    slanted: bool  # whether Q is not the identity
    reasons: tuple[str, ...]  # why they do not meet the data exactly; nothing if they do

    @property
    def fixed(self) -> FloatArray:
        """The values as degrees of freedom w (size,), zero elsewhere."""
        w = np.zeros(self.axes.shape[0])
        w[self.index] = self.values
        return w


def supports(problem: ContactProblem, space: DisplacementSpace, scales: Scales, springs: int = 0) -> Supports:
    """Prescribed displacements, of so many stretches of springs none; where two disagree in a corner their mean."""
    p, unit, reasons = space.degree, scales.displacement, list[str]()
    on_arcs, fixed = list[tuple[Edges, IntArray]](), list[tuple[IntArray, FloatArray]]()
    conditions = [(np.empty(0, dtype=np.int64), np.empty((0, 2)), np.empty(0))]  # d·v = value at coefficients
    for given in problem.prescribed(Displacement):
        edges, numbers = given.edges, space.along(given.edges)
        data, misfit = edge_data(problem.mesh, edges, given.name, given.value, p, unit)
        if misfit > MISFIT * max(1.0, float(np.abs(data).max(initial=0.0))):
            reasons.append(
                f"{given.name} is not a polynomial of degree {p} on each edge. It is interpolated, with an "
                f"error of up to {misfit * unit:.2g} [length]."
            )
        turning = edges.bent & given.turns
        if turning.any():  # inside arcs n·v or t·v
            reasons.append(f"{given.name} holds on arcs as closely as polynomials of degree {p} follow its directions.")
            arcs, inside = edges.take(turning), numbers[turning, 1:-1]
            alike = np.rint([(part * given.direction[turning]).sum(axis=1) for part in (arcs.normal, arcs.tangent)])
            on_arcs.append((arcs, numbers[turning]))
            dofs, values = 2 * inside + np.argmax(np.abs(alike), axis=0)[:, None], alike.sum(axis=0)[:, None]
            fixed.append((dofs.ravel(), (data[turning, 1:-1] * values).ravel()))
        places = np.linspace(0.0, 1.0, p + 1)
        here = ~turning[:, None] | (places == 0.0) | (places == 1.0)
        conditions.append(
            (numbers[here], vectors_along(edges, given.direction, places, turns=given.turns)[here], data[here])
        )

    coefficient, direction, value = (np.concatenate(part) for part in zip(*conditions, strict=True))
    known, group, count = np.unique(coefficient, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    place = group[order], np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    D = np.zeros((len(known), max(2, *count.tolist(), 0), 2))
    wanted = np.zeros(D.shape[:2])
    D[place], wanted[place] = direction[order], value[order]  # those of one coefficient in a row, zeros after them
    U, size, V = np.linalg.svd(D, full_matrices=False)
    both, first = size[:, 1] > PARALLEL, D[:, 0]
    solved = np.einsum("kmi,km,ki,kij->kj", U, wanted, 1.0 / np.where(both[:, None], size, 1.0), V)
    mean = (np.sign(np.einsum("kmi,ki->km", D, first)) * wanted).sum(axis=1) / count
    found = np.where(both[:, None], solved, mean[:, None] * first)
    wrong = np.abs(np.einsum("kmi,ki->km", D, found) - wanted).max(axis=1) > MISFIT * max(
        1.0, np.abs(value).max(initial=0.0)
    )
    if wrong.any():
        x, y = problem.mesh.origin + scales.length * space.places[known[wrong].min()]
        reasons.append(f"Prescribed displacements disagree at ({x:.6g}, {y:.6g}). Their mean is used.")
    along, slanted = np.argmax(np.abs(first), axis=1), ~both & (np.abs(first).max(axis=1) < 1.0)
    one = np.where(slanted, mean, np.take_along_axis(found, along[:, None], axis=1)[:, 0])
    fixed.append(((2 * known + np.where(slanted, 0, along))[~both], one[~both]))
    fixed.append(((2 * known[both, None] + np.arange(2)).ravel(), solved[both].ravel()))

    frames = np.tile(np.eye(2), (space.size // 2, 1, 1))
    frames[known[slanted]] = np.stack([first, np.stack([-first[:, 1], first[:, 0]], axis=1)], axis=2)[slanted]
    dofs = np.arange(space.size).reshape(-1, 2)
    Q = spread(dofs, dofs, frames, space.size)
    Q.eliminate_zeros()
    index, values = (np.concatenate(part) for part in zip(*fixed, strict=True))
    order = np.argsort(index)
    turned = _along_arcs(Q, on_arcs, p) if on_arcs else (Q, Q.T)
    axes, inverse = (sparse.csr_array(sparse.block_diag([part, sparse.eye_array(springs)])) for part in turned)
    return Supports(index[order], values[order], axes, inverse, bool(slanted.any() or on_arcs), tuple(reasons))


def _along_arcs(
    Q: sparse.csr_array, on_arcs: list[tuple[Edges, IntArray]], degree: int
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Q and Q⁻¹ with the coefficients inside arcs along their frames, from Q of all others.

    An arc with two conditions is listed twice, with the same rows. With v and w inside (i) and at both ends (e),
    w_i = A v_i + B v_e, so that v_i = A⁻¹ w_i − A⁻¹ B Q_e w.
    """
    dofs = np.concatenate([2 * numbers[:, :, None] + np.arange(2) for _, numbers in on_arcs])
    each = (np.stack([along_arcs(arcs, d, degree) for d in (arcs.normal, arcs.tangent)], axis=2) for arcs, _ in on_arcs)
    _, once = np.unique(dofs[:, 1, 0], return_index=True)
    n, dofs, rows = len(once), dofs[once], np.concatenate(list(each))[once]
    rows = rows.reshape(n, 2 * (degree - 1), degree + 1, 2)
    inside, at_ends = dofs[:, 1:-1].reshape(n, -1), dofs[:, [0, -1]].reshape(n, -1)
    A, B = rows[:, :, 1:-1].reshape(n, *2 * inside.shape[1:]), rows[:, :, [0, -1]].reshape(*inside.shape, 4)
    size, keep, inverse = Q.shape[0], np.ones(Q.shape[0]), np.asarray(np.linalg.inv(A), dtype=np.float64)
    keep[inside] = 0.0
    whole = sparse.diags_array(keep) @ Q @ sparse.diags_array(keep)
    own, beside = spread(inside, inside, inverse, size), spread(inside, at_ends, inverse @ B, size)
    rows = spread(inside, inside, A, size) + spread(inside, at_ends, B, size)
    return sparse.csr_array(whole + own - beside @ whole), sparse.csr_array(whole.T + rows)


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
    # (k, k): M of springs along contacts, with the energy ½ dᵀM d of their stretches d, which follow the degrees of
    # freedom of `space`: displacements v have the shape (size,) with the stretches
    springs: sparse.csr_array = field(default_factory=lambda: sparse.csr_array((0, 0)))

    @property
    def size(self) -> int:
        """Number of degrees of freedom, with the stretches of springs."""
        return self.space.size + int(self.springs.shape[0])

    def stiffness(self) -> sparse.csr_array:
        """K with vᵀKv = ∫ ε:C:ε without springs, shape (size, size) of the space; cells with arcs by quadrature."""
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
        return most + 1 + (_ON_ARCS if len(self.space.curved) else 0)

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
        return 0.5 * (float(work) + float(d @ (self.springs @ d)))

    def force(self, v: FloatArray) -> FloatArray:
        """K v (size,), through stresses, and M d."""
        t, weights = self.points()
        stress = self.strain(v, slice(None), t) @ self.moduli.swapaxes(1, 2)
        found = self.virtual_work(stress * weights[..., None], t)
        found[self.space.size :] = self.springs @ v[self.space.size :]
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
            work = lengths[:, None] * moments(loaded, space.degree) / scales.stress
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
    """∫ b·v dx with b = −∇φ, as ∫ φ div v dx − ∮ φ v·n ds over every block: no derivative of φ is needed.

    φ counts from its value at one point: a constant does no work.
    """
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
    shape = bernstein.basis(space.degree, t) * w[:, None]
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
    """See the module; w (size,) counts all degrees of freedom in the axes of the supports, w_Γ those of `interface`."""

    body: Elasticity
    load: FloatArray  # (size,): f
    supports: Supports  # prescribed degrees of freedom
    free: IntArray  # the others, ascending
    interface: IntArray  # Γ, numbers among all degrees of freedom, ascending
    factor: Factorisation
    S: FloatArray  # (k, k): the condensed stiffness
    r: FloatArray  # (k,): right-hand side on Γ
    R: FloatArray  # (k, j): rigid motions
    cholesky: tuple[FloatArray, bool]

    @classmethod
    def of(cls, body: Elasticity, load: FloatArray, supports: Supports, rows: sparse.csr_array) -> "CondensedBody":
        """Condense on the degrees of freedom that rows (n, size) of v touch, prescribed ones among them left out.

        `FactorisationError` if the stiffness matrix cannot be factorised.
        """
        size, Q = body.space.size, supports.axes
        free = np.setdiff1d(np.arange(size), supports.index)
        motions, K, turned = body.space.rigid(), body.stiffness(), Q[:size, :size]
        strained = float(np.linalg.norm(K @ motions)) / float(K.diagonal().max())  # on arcs alone more than rounding
        rigid = (supports.inverse @ np.pad(motions, ((0, body.size - size), (0, 0))))[:size]
        interface = np.setdiff1d((rows @ Q)[:, :size].indices, supports.index)
        interface = np.union1d(interface, _pins(body, rigid, supports.index, interface, strained)).astype(np.int64)
        K = (sparse.csr_array(turned.T @ K @ turned) if supports.slanted else K)[free][:, free]
        place = np.searchsorted(free, interface)
        shift = float(K.diagonal().mean()) if len(free) else 0.0
        held = np.zeros(len(free))
        held[place] = shift  # back ends want a positive definite matrix; S has it on its diagonal and is freed of it
        factor = factorise(sparse.csc_array(K + sparse.diags_array(held)), place)
        S = factor.schur - shift * np.eye(len(place))
        r, _ = factor.reduce((Q.T @ (load - body.force(Q @ supports.fixed)))[free])
        motions = (rigid @ _unheld(rigid[supports.index], strained))[interface]
        R = np.asarray(np.linalg.qr(motions)[0]) if motions.size else np.zeros((len(motions), 0))
        more = body.size - size  # springs
        S, interface = block_diag(S, body.springs.toarray()), np.append(interface, np.arange(size, body.size))
        r, R = np.append(r, np.zeros(more)), np.pad(R, ((0, more), (0, 0)))
        stiffened = S, True
        if len(S):
            rho = float(np.trace(S)) / len(S)
            try:
                stiffened = cho_factor(S + rho * R @ R.T, lower=True)
            except np.linalg.LinAlgError as error:
                message = "the condensed stiffness is not positive definite"
                raise FactorisationError("singular", "lapack", message) from error
        return cls(body, load, supports, free, interface, factor, S, np.asarray(r), R, stiffened)

    def relieve(self, forces: FloatArray) -> FloatArray:
        """G times forces on Γ, (k,) or (k, j)."""
        return np.asarray(cho_solve(self.cholesky, forces)) if forces.size else forces

    def expand(self, values: FloatArray) -> FloatArray:
        """V (size,) from w_Γ, the rest in equilibrium: defect corrections remove rounding."""
        w, Q = self.supports.fixed, self.supports.axes
        w[self.interface] = values
        held = np.zeros(len(self.interface) - (self.body.size - self.body.space.size))
        for _ in range(_CORRECTIONS):
            _, state = self.factor.reduce((Q.T @ (self.load - self.body.force(Q @ w)))[self.free])
            w[self.free] += self.factor.expand(state, held)
        return np.asarray(Q @ w)


def _pins(body: Elasticity, rigid: FloatArray, fixed: IntArray, interface: IntArray, strained: float) -> IntArray:
    """Two vertices of every block that neither supports nor contacts would hold: Γ must hold all motions."""
    held = np.concatenate([fixed, interface])
    blocks = int(body.space.block.max()) + 1
    found: list[IntArray] = [np.empty(0, dtype=np.int64)]
    for block in range(blocks):
        motions = rigid[:, 3 * block : 3 * block + 3]
        if _unheld(motions[held], strained).shape[1]:
            mine = np.flatnonzero(body.space.owner == block)
            place = body.space.places[mine].sum(axis=1)
            pair = mine[[int(np.argmin(place)), int(np.argmax(place))]]
            found.append((2 * pair[:, None] + np.arange(2)).ravel())
    return np.setdiff1d(np.concatenate(found), fixed)


def _unheld(motions: FloatArray, strained: float) -> FloatArray:
    """Combinations (k, j) of rigid motions that rest where these (m, k) are, which are of the size of one.

    As closely as elements beside arcs, which `strained` tells, can turn.
    """
    as_closely = min(_AS_STRAINED * strained, _FREE_ON_ARCS)
    return null_space(motions, max(_FREE * max(1.0, float(np.linalg.norm(motions))), as_closely))
