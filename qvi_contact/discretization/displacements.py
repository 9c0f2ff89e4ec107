"""Displacements: Bernstein elements on the cells of the body, which joints divide, and prescribed displacements.

A function on a triangle is Σ c_α B_α(λ), λ = (1 − t₁ − t₂, t₁, t₂), with B_α ≥ 0 of sum 1. On a side it is the
Bernstein polynomial of the coefficients there, so that contact conditions and prescribed data are conditions on single
coefficients. Derivatives along the two reference axes are combinations of differences of neighbouring coefficients,

    ∂u/∂t_a = Σ_k (D_a c)_k B_k,

so that a translation, however large, causes no rounding. Cells share coefficients on edges that are not joints. A
vertex on a joint has one coefficient for each block there. Degree of freedom 2 k + c is component c of coefficient k.

A cell with arcs is a smooth image of the reference triangle. With its corners X and the arc γ from corner a to b,

    x(λ) = Σ λ_i X_i + Σ_sides λ_a λ_b q(λ_b − λ_a),   τ (1 − τ) q(2τ − 1) = γ(τ) − (1 − τ) X_a − τ X_b

This map is γ on the arc, a straight line on straight sides, and smooth, so that polynomials of λ have their full order.
(The map of the mesh is not smooth: it is made of three parts, which meet at the barycentre.) q is interpolated by a
polynomial that differs from it by rounding.

Supports prescribe components d·v of coefficients: rows C v = d, which `Elimination` solves as it does the rows of
prescribed tractions, v = B z + v₀. Two directions at a coefficient prescribe both components. Directions turn along
arcs: there the inner coefficients are those of the polynomials n·v and t·v, see `components_along`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Final

import numpy as np
from numpy.polynomial.legendre import legder, legvander
from scipy import sparse
from scipy.sparse.linalg import lsqr

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate, whole_number
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.space import Functionals
from qvi_contact.discretization.supports import Basis, Elimination
from qvi_contact.element.edge import (
    SAMPLES,
    bernstein_basis,
    bernstein_from_values,
    gauss_legendre,
    legendre_from_values,
    lobatto_points,
)
from qvi_contact.element.triangle import EDGES, exponents, gradient, quadrature
from qvi_contact.element.triangle import bernstein as basis
from qvi_contact.errors import place_of
from qvi_contact.mesh.edges import Edges, arc_offsets, cross, vectors_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Displacement, bears_shear
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.linked import linked

_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # ∂λ_i/∂t_a

HIGHEST: Final = 5
"""Highest degree of displacements that is offered."""

_TERMS: Final = 12  # terms of q, less coefficients of a bend: enough for all digits on an arc that turns by 90°
_STEPS: Final = 8  # Newton steps for the inverse of the map; each doubles the number of digits


def triangle(degree: int | None = None) -> "Triangle":
    """The triangle with displacements of a degree, by default 3; `InputError` if the degree is not offered."""
    return _triangle(3 if degree is None else whole_number("degree", degree, HIGHEST))


@dataclass(frozen=True)
class Triangle:
    """Polynomials of degree p on a triangle, with n coefficients in the order of `element.triangle.exponents`.

    The corners of a cell have ascending vertex numbers, so that neighbours agree on the direction of a side.
    """

    degree: int

    @cached_property
    def places(self) -> FloatArray:
        """The points α/p (n, 2) of the coefficients: the coefficients of a linear function are its values there."""
        return np.asarray(exponents(self.degree)[:, 1:] / self.degree)

    @cached_property
    def sides(self) -> IntArray:
        """The coefficients (3, 3, p + 1) from one corner to another along a side; −1 from a corner to itself."""
        alpha, sides = exponents(self.degree), np.full((3, 3, self.degree + 1), -1)
        for first, last in EDGES:
            on_side = np.flatnonzero(alpha[:, first] + alpha[:, last] == self.degree)
            side = on_side[np.argsort(alpha[on_side, last])]
            sides[first, last], sides[last, first] = side, side[::-1]
        return sides

    @cached_property
    def differences(self) -> tuple[FloatArray, FloatArray]:
        """D₁ and D₂ (m, n): p (c_{α+e₁} − c_{α+e₀}) and p (c_{α+e₂} − c_{α+e₀})."""
        along_x, along_y = gradient(self.degree, _SLOPES)
        return along_x, along_y

    def values(self, t: FloatArray) -> FloatArray:
        """B_α(λ) at points t (..., 2), shape (..., n)."""
        return basis(self.degree, barycentric(t))

    def derivative_values(self, t: FloatArray) -> FloatArray:
        """B_k of degree p − 1, for derivatives, at points t (..., 2), shape (..., m)."""
        return basis(self.degree - 1, barycentric(t))

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points (q, 2), `count` in each direction of the collapsed square, and weights (q,) of sum ½."""
        points, weights = quadrature(2 * count - 1)
        return points[:, 1:], weights / 2.0

    def along(self, mesh: TriangleMesh, edges: Edges, side: int) -> IntArray:
        """Cell coefficients (e, p + 1) on edges, along the tangent; of the first cell there or the second (side 1)."""
        corners = mesh.cells[edges.cells[:, side]]
        first, second = (np.argmax(corners == end[:, None], axis=1) for end in (edges.first, edges.second))
        return np.asarray(self.sides[first, second])


_triangle = cache(Triangle)


def barycentric(t: FloatArray) -> FloatArray:
    """Barycentric coordinates (…, 3) of reference points (…, 2)."""
    t = np.asarray(t, dtype=float)
    return np.concatenate([1.0 - t.sum(axis=-1, keepdims=True), t], axis=-1)


@dataclass(frozen=True, eq=False)
class DisplacementSpace:
    """Displacements of degree p on the cells of a mesh; lengths divided by L, places relative to the mesh's origin."""

    mesh: TriangleMesh
    cell: Triangle  # the reference triangle, with n coefficients
    corners: FloatArray  # (cells, 3, 2)
    table: IntArray  # (cells, n): coefficients of a scalar field on each cell
    block: IntArray  # (cells,): number of each cell's block; joints separate blocks

    @classmethod
    def of(cls, problem: ContactProblem, cell: Triangle) -> "DisplacementSpace":
        """The space of a problem."""
        mesh, count, n = problem.mesh, len(problem.mesh.cells), len(cell.places)
        is_shared = np.ones(len(mesh.interior), dtype=bool)
        for joint in problem.joints:
            is_shared[mesh.joint_set(joint.edges)] = False
        edges = mesh.interior.take(is_shared)
        near, far = (n * edges.cells[:, [side]] + cell.along(mesh, edges, side) for side in (0, 1))
        table = linked(near, far, n * count).reshape(count, n)
        block = linked(edges.cells[:, 0], edges.cells[:, 1], count)
        return cls(mesh, cell, (mesh.corners - mesh.origin) / mesh.length, table, block)

    @property
    def degree(self) -> int:
        """The degree p."""
        return self.cell.degree

    @property
    def size(self) -> int:
        """Number of degrees of freedom, both components."""
        return 2 * (int(self.table.max()) + 1)

    @cached_property
    def slopes(self) -> FloatArray:
        """Gradients of the reference coordinates of straight cells, ∂t_a/∂x_b as [cell, a, b]."""
        return np.asarray(np.linalg.inv(self.corners.swapaxes(1, 2) @ _SLOPES), dtype=np.float64)

    @cached_property
    def areas(self) -> FloatArray:
        """Area of each straight cell over that of the reference cell (cells,)."""
        return np.asarray(1.0 / np.abs(np.linalg.det(self.slopes)))

    def points(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Coordinates of reference points (k, 2), or (cells, k, 2), in cells, shape (cells, k, 2)."""
        return self._mapped(cells, t)[0]

    def inverse_jacobians(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """∂t_a/∂x_b as [cell, point, a, b]; with one point for all points if no cell has arcs."""
        if not self.mesh.curved[cells].any():
            return np.asarray(self.slopes[cells][:, None])
        return np.asarray(np.linalg.inv(self._mapped(cells, t)[1]))

    def measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Quadrature weights (cells, q) from weights (q,) at points t (q, 2) of the reference cell."""
        if not self.mesh.curved.any():
            return np.asarray(self.areas[:, None] * weights)
        return np.asarray(np.abs(np.linalg.det(self._mapped(slice(None), t)[1])) * weights)

    def _mapped(self, cells: IntArray | slice, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points x (k, q, 2) and ∂x_b/∂t_a (k, q, b, a) at reference points t, (q, 2) or (k, q, 2), of k cells."""
        corners, bends = self.corners[cells], self.mesh.sides[cells]
        places = barycentric(np.broadcast_to(t, (len(corners), *np.shape(t)[-2:])))
        points, slopes = places @ corners, np.repeat((corners.swapaxes(1, 2) @ _SLOPES)[:, None], places.shape[1], 1)
        nodes = gauss_legendre(_TERMS + bends.shape[2])[0]
        # each arc adds λ_a λ_b q to x, and the derivative of this product to the slopes
        for s, (a, b) in enumerate(EDGES):
            bent = np.flatnonzero(bends[:, s].any(axis=1))  # most cells with arcs have one
            if not len(bent):
                continue
            chord = corners[bent, b] - corners[bent, a]
            bulge = arc_offsets(chord, bends[bent, s], nodes) - nodes[:, None] * chord[:, None]
            q = legendre_from_values(len(nodes) - 1, len(nodes)) @ (bulge / (nodes * (1.0 - nodes))[:, None])
            first, second = places[bent, :, a, None], places[bent, :, b, None]
            value, dq = (legvander((second - first)[..., 0], c.shape[1] - 1) @ c for c in (q, legder(q, axis=1)))
            points[bent] += first * second * value
            slopes[bent] += value[..., None] * (first * _SLOPES[b] + second * _SLOPES[a])[..., None, :]
            slopes[bent] += (first * second * dq)[..., None] * (_SLOPES[b] - _SLOPES[a])
        return points, slopes

    def own(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Reference points of this space from those of the mesh, (k, 2) or (cells, k, 2): cells with arcs differ.

        They are found by Newton's method.
        """
        chosen = np.arange(len(self.table))[cells]
        bent = np.flatnonzero(self.mesh.curved[chosen])
        if not len(bent):
            return t
        own, numbers = np.array(np.broadcast_to(t, (len(chosen), *np.shape(t)[-2:]))), chosen[bent]
        points = self.mesh.placed(numbers, barycentric(own[bent])) @ self.corners[numbers]
        found = (points - self.corners[numbers, :1]) @ self.slopes[numbers].swapaxes(1, 2)
        for _ in range(_STEPS):
            x, slopes = self._mapped(numbers, found)
            found = found + np.linalg.solve(slopes, (points - x)[..., None])[..., 0]
        own[bent] = found
        return own

    @property
    def dofs(self) -> IntArray:
        """Degrees of freedom of each cell's displacements (cells, 2 n)."""
        return np.asarray(2 * self.table[:, :, None] + np.arange(2)).reshape(len(self.table), -1)

    def assembled(self, blocks: FloatArray) -> sparse.csr_array:
        """The matrix (size, size) assembled from cell matrices (cells, 2 n, 2 n)."""
        return spread(self.dofs, self.dofs, blocks, self.size)

    @cached_property
    def places(self) -> FloatArray:
        """The point (size / 2, 2) of each coefficient: coefficients of a linear function are its values there."""
        places = np.empty((self.size // 2, 2))
        places[self.table] = self.points(slice(None), self.cell.places)
        return places

    @cached_property
    def owner(self) -> IntArray:
        """Block of each coefficient (size / 2,)."""
        owner = np.empty(self.size // 2, dtype=np.int64)
        owner[self.table] = self.block[:, None]
        return owner

    def along(self, edges: Edges, *, other: bool = False) -> IntArray:
        """Coefficients on edges (e, p + 1), along the tangent; with `other` of the second cell at an inner edge."""
        return self.table[edges.cells[:, [int(other)]], self.cell.along(self.mesh, edges, int(other))]

    @cached_property
    def positions(self) -> FloatArray:
        """The coefficients (size / 2, 2) of the function x: coefficients of affine functions are their values there."""
        positions, bent = self.places.copy(), self.table[self.mesh.curved]
        positions[bent] = np.linalg.inv(self.cell.values(self.cell.places)) @ positions[bent]  # x is not linear in λ
        return positions

    def rigid(self) -> FloatArray:
        """Rigid motions of every block, (size, 3 blocks): translations along x and y, rotation about its middle."""
        places, owner, coefficients = self.positions, self.owner, np.arange(self.size // 2)
        middles = np.stack([np.bincount(owner, along) for along in places.T]) / np.bincount(owner)
        x, y = places.T - middles[:, owner]
        motions = np.zeros((self.size // 2, 2, middles.shape[1], 3))
        motions[coefficients, 0, owner, 0] = motions[coefficients, 1, owner, 1] = 1.0
        motions[coefficients, 0, owner, 2], motions[coefficients, 1, owner, 2] = -y, x
        return motions.reshape(self.size, -1)


def spread(rows: IntArray, columns: IntArray, blocks: FloatArray, size: int) -> sparse.csr_array:
    """The matrix (size, size) of the sum of blocks (n, r, c) at rows (n, r) and columns (n, c)."""
    at = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    return sparse.csr_array((blocks.ravel(), (at[0].ravel(), at[1].ravel())), shape=(size, size))


MISFIT = 1e-10
"""Difference of data from their polynomial on an edge over the data's unit, up to which it is rounding."""

PARALLEL = 1e-8
"""Sine of the angle between two directions up to which they are parallel, but for rounding of coordinates."""

ALIKE = 2e-4  # the same for coordinates with few digits, as in mesh files
ROUNDED = f"Edges that meet at an angle below {ALIKE:.0e}, as those of rounded coordinates, count as parallel."


def edge_data(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, degree: int, unit: float
) -> tuple[FloatArray, float]:
    """Bernstein coefficients (e, degree + 1) of a field on edges over its unit, and the polynomials' largest error.

    They interpolate the field, also at both ends of each edge. The error is that at `SAMPLES`.
    """
    if not callable(field):
        return np.full((len(edges), degree + 1), field / unit), 0.0
    values, sampled = (
        evaluate(name, field, *mesh.points_along(edges, t)) / unit for t in (lobatto_points(degree), SAMPLES)
    )
    coefficients = values @ bernstein_from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    error = np.abs(coefficients @ bernstein_basis(degree, SAMPLES).T - sampled)
    return coefficients, float(error.max(initial=0.0))


def in_lines(vectors: FloatArray, places: IntArray, straight: BoolArray) -> FloatArray:
    """Unit vectors (n, 2), with equal vectors along each line of `straight` edges that rounded coordinates bend.

    Edges that meet in a vertex of `places` (n, k) belong to one line if their vectors are parallel up to `ALIKE`. They
    get the vector of the line's first edge, with their own sign. No vector turns by more than `ALIKE`.
    """
    at = np.arange(len(places)).repeat(places.shape[1]), places.ravel()
    incidence = sparse.csr_array((np.ones(places.size), at), shape=(len(places), int(places.max(initial=0)) + 1))
    one, other = np.asarray((incidence @ incidence.T).nonzero(), dtype=np.int64)
    alike = straight[one] & straight[other] & (np.abs(cross(vectors[one], vectors[other])) <= ALIKE)
    line, aligned, rest = linked(one[alike], other[alike], len(places)), vectors.copy(), straight.nonzero()[0]
    while len(rest):  # a line that bends by more in sum than `ALIKE` is taken in parts
        start, which = np.unique(line[rest], return_index=True, return_inverse=True)[1:]
        first = vectors[rest[start]][which]
        alike = np.abs(cross(vectors[rest], first)) <= ALIKE
        aligned[rest[alike]] = (np.sign((vectors[rest] * first).sum(axis=1))[:, None] * first)[alike]
        rest = rest[~alike]
    return aligned


def all_in_lines(parts: Sequence[tuple[FloatArray, Edges, bool]]) -> list[FloatArray]:
    """Unit vectors (n, 2) of several sets of edges, by `in_lines`; vectors that turn along an arc are not changed."""
    vectors = np.concatenate([np.empty((0, 2)), *(each for each, _, _ in parts)])
    ends = [np.stack([edges.first, edges.second], axis=1) for _, edges, _ in parts]
    bent = np.concatenate([np.empty(0, bool), *(edges.bent & turns for _, edges, turns in parts)])
    directions = in_lines(vectors, np.concatenate([np.empty((0, 2), np.int64), *ends]), ~bent)
    return np.split(directions, np.cumsum([len(each) for each in ends]))[: len(parts)]


def contact_edges(problem: ContactProblem) -> dict[str, Edges]:
    """The edges of each contact, with equal directions along each line that rounded coordinates bend.

    Contacts with friction that meet share them: what one holds of the other's slip in the corner is all or none.
    """
    straight, alone = dict[str, Edges](), [[each] for each in problem.contacts if not bears_shear(each)]
    for group in filter(None, ([each for each in problem.contacts if bears_shear(each)], *alone)):
        edges = [problem.mesh.edges(each.edges) for each in group]
        parts = iter(all_in_lines([(part, each, True) for each in edges for part in (each.tangent, each.normal)]))
        for contact, each in zip(group, edges, strict=True):
            straight[contact.name] = replace(each, tangent=next(parts), normal=next(parts))
    return straight


def components_along(edges: Edges, directions: FloatArray, degree: int, *, turns: bool = True) -> FloatArray:
    """Matrices (e, p + 1, p + 1, 2) from coefficients of v on edges to those of d·v, for directions d of chords (e, 2).

    Coefficients of d·v are d·(coefficients of v); inside arcs with turning d they interpolate d·v at Lobatto points.
    """
    vectors = vectors_along(edges, directions, np.linspace(0.0, 1.0, degree + 1), turns=turns)
    rows, bent = np.eye(degree + 1)[:, :, None] * vectors[:, :, None], edges.bent & turns
    if bent.any():
        nodes = lobatto_points(degree)
        project, values = bernstein_from_values(degree)[1:-1], bernstein_basis(degree, nodes)
        turned = vectors_along(edges.take(bent), directions[bent], nodes)
        rows[bent, 1:-1] = np.einsum("ki,eia,ij->ekja", project, turned, values)
    return np.asarray(rows)


@dataclass(frozen=True, eq=False)
class PrescribedDisplacements:
    """The solutions v = B z + v₀ of the prescribed displacements C v = d."""

    rows: Functionals  # C, groups of one row
    basis: Basis
    particular: FloatArray  # (size,): v₀
    reasons: tuple[str, ...]  # sentences why they differ from the data; empty if they do not
    jumps: tuple[str, ...]  # those of the reasons that name corners where the data disagree

    def beside(self, count: int) -> tuple[sparse.csr_array, FloatArray]:
        """B and v₀ with `count` free degrees of freedom appended to those of the body."""
        B = sparse.block_diag([self.basis.matrix, sparse.eye_array(count)], format="csr")
        return sparse.csr_array(B), np.append(self.particular, np.zeros(count))


def supports(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, least: float = MISFIT
) -> PrescribedDisplacements:
    """Prescribed displacements; where the data disagree in a corner, their mean by least squares.

    Data disagree if they differ by more than `least` times their size. Edges of one line, bent by rounded coordinates,
    count as parallel: two slightly different normals would hold the vertices of an oblique side in both directions.
    So do sides of contacts with friction beside a support, which then holds all of their slip in the corner, or none.
    """
    p, unit, reasons, jumps = space.degree, scales.displacement, list[str](), list[str]()
    width = 2 * (p + 1)  # entries of a row: the coefficients on an edge
    columns, entries = [np.empty((0, width), np.int64)], [np.empty((0, 1, width))]
    values, places = [np.empty(0)], [np.empty(0, np.int64)]  # d, and the coefficient of each row; −1 inside arcs
    conditions = problem.prescribed(Displacement)
    edges_of = contact_edges(problem)
    rough_edges = [edges_of[each.name] for each in problem.contacts if bears_shear(each)]
    along_contacts = [(part, each, True) for each in rough_edges for part in (each.tangent, each.normal)]
    directions = all_in_lines([*along_contacts, *((each.direction, each.edges, each.turns) for each in conditions)])
    directions = directions[len(along_contacts) :]
    if any(
        np.abs(d - each.direction).max(initial=0.0) > PARALLEL for d, each in zip(directions, conditions, strict=True)
    ):
        reasons.append(ROUNDED)
    # rows C v = d of each condition
    for given, direction in zip(conditions, directions, strict=True):
        edges, numbers, bent = given.edges, space.along(given.edges), given.edges.bent & given.turns
        data, error = edge_data(problem.mesh, edges, given.name, given.value, p, unit)
        if error > MISFIT * max(1.0, float(np.abs(data).max(initial=0.0))):
            reasons.append(
                f"{given.name} is not a polynomial of degree {p} on each edge. It is interpolated, with an "
                f"error of up to {error * unit:.2g} [length]."
            )
        rows = components_along(edges, direction, p, turns=given.turns)
        if bent.any():
            reasons.append(f"On arcs {given.name} holds approximately, as polynomials of degree {p} follow them.")
        dofs = np.broadcast_to(2 * numbers[:, None, :, None] + np.arange(2), rows.shape)
        columns.append(dofs.reshape(-1, width))
        entries.append(rows.reshape(-1, 1, width))
        values.append(data.ravel())
        places.append(np.where(np.outer(bent, np.arange(p + 1) % p > 0), -1, numbers).ravel())
    C = Functionals(np.concatenate(columns), np.concatenate(entries), space.size)
    value, at = np.concatenate(values), np.concatenate(places)
    # degrees of freedom inside arcs, which have no row of their own, are preferred as pivots
    inside = np.isin(np.arange(space.size) // 2, at, invert=True)
    solved = Elimination.of(C, inside.astype(np.int64), PARALLEL)
    particular, jump = solved.particular(value)
    if np.abs(jump).max(initial=0.0) > least * max(1.0, np.abs(value).max(initial=0.0)):
        worst = int(np.argmax(np.abs(jump)))
        number = np.setdiff1d(np.arange(len(value)), solved.rows)[worst]
        corner = place_of(problem.mesh.origin + scales.length * space.places[at[number]])
        jumps.append(
            f"Prescribed displacements disagree at {corner}, by about {abs(jump[worst]) * unit:.3g} [length]. There "
            "stresses and energy grow without limit on finer meshes. Prescribe the same displacement on both sides."
        )
        corners = C.take((at >= 0).nonzero()[0]).matrix()
        value[at >= 0] = corners @ lsqr(corners, value[at >= 0], atol=1e-14, btol=1e-14, iter_lim=100)[0]
        particular = solved.particular(value)[0]
    return PrescribedDisplacements(C, solved.basis, particular, (*reasons, *jumps), tuple(jumps))
