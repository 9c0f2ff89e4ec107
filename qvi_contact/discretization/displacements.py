"""Displacements: Bernstein elements on the cells of the body, cut open along the joints, and what supports prescribe.

A function on a triangle is Σ c_α B_α(λ), λ = (1 − t₁ − t₂, t₁, t₂), with B_α ≥ 0 of sum 1. Its trace on a side is the
polynomial whose coefficients are those of the side, so that contact conditions and prescribed data are conditions on
single coefficients. Derivatives along the two reference axes act on differences of neighbouring coefficients,

    ∂u/∂t_a = Σ_k (D_a c)_k B_k,

so that a rigid motion, however large, leaves no rounding behind. Cells share coefficients on edges that are not joints:
a vertex on a joint has one for each block that meets there. Degree of freedom 2 k + c is component c of coefficient k.

A cell with sides that are arcs is a smooth image of the straight one. With its corners X and the arc γ of a side from
corner a to b,

    x(λ) = Σ λ_i X_i + Σ_sides λ_a λ_b q(λ_b − λ_a),   τ (1 − τ) q(2τ − 1) = γ(τ) − (1 − τ) X_a − τ X_b

which is γ on the side, the straight line on the others, and smooth, so that displacements that are polynomials of λ are
of full order. (The map of the mesh, seen from barycentres, is not: it bends between the thirds of a cell.) q is a
polynomial that differs from its definition by rounding.

Supports prescribe components d·v of coefficients, rows C v = d that are solved as those of tractions are, by
`Elimination`: v = B z + v₀. Two directions at a coefficient prescribe both components. Along arcs, whose directions
turn, coefficients inside are those of the polynomials n·v and t·v, see `components_along`.
"""

from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Final

import numpy as np
from numpy.polynomial.legendre import legder, legvander
from scipy import sparse
from scipy.sparse.linalg import lsqr

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate, whole_number
from qvi_contact.discretization.scaling import Scales, bounds
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

_SLOPES: Final = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])  # of λ

HIGHEST: Final = 5
"""Highest degree of displacements that is offered."""

_TERMS: Final = 12  # of q beside the coefficients of bends: its digits on an arc that turns by 90°
_STEPS: Final = 8  # of Newton's method for the inverse of the map; each doubles the digits


def triangle(degree: int | None = None) -> "Triangle":
    """The triangle with displacements of a degree, 3 where none is given; `InputError` if it is no degree."""
    return _triangle(3 if degree is None else whole_number("degree", degree, HIGHEST))


@dataclass(frozen=True)
class Triangle:
    """P_p with n coefficients, which come in the order of `element.triangle.exponents`.

    Corners have ascending numbers, so that neighbours agree on the direction of a side.
    """

    degree: int

    @cached_property
    def places(self) -> FloatArray:
        """The points α/p (n, 2) of the coefficients: those of a linear function are its values there."""
        return np.asarray(exponents(self.degree)[:, 1:] / self.degree)

    @cached_property
    def sides(self) -> IntArray:
        """The coefficients (3, 3, p + 1) from one corner to another along a side; −1 from a corner to itself."""
        alpha, found = exponents(self.degree), np.full((3, 3, self.degree + 1), -1)
        for first, last in EDGES:
            on_side = np.flatnonzero(alpha[:, first] + alpha[:, last] == self.degree)
            side = on_side[np.argsort(alpha[on_side, last])]
            found[first, last], found[last, first] = side, side[::-1]
        return found

    @cached_property
    def differences(self) -> tuple[FloatArray, FloatArray]:
        """D₁ and D₂ (m, n): p (c_{α+e₁} − c_{α+e₀}) and p (c_{α+e₂} − c_{α+e₀})."""
        along_x, along_y = gradient(self.degree, _SLOPES)
        return along_x, along_y

    def values(self, t: FloatArray) -> FloatArray:
        """B_α(λ) at points t (..., 2), shape (..., n)."""
        return basis(self.degree, barycentric(t))

    def derivative_values(self, t: FloatArray) -> FloatArray:
        """B_k of the derivatives, those of degree p − 1, at points t (..., 2), shape (..., m)."""
        return basis(self.degree - 1, barycentric(t))

    def quadrature(self, count: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points (q, 2), `count` in each direction of the collapsed square, and weights (q,) of sum ½."""
        points, weights = quadrature(2 * count - 1)
        return points[:, 1:], weights / 2.0

    def along(self, mesh: TriangleMesh, edges: Edges, side: int) -> IntArray:
        """The coefficients (e, p + 1) on edges, along the tangent, of the cell at each, or of that beyond (side 1)."""
        corners = mesh.cells[edges.cells[:, side]]
        first, second = (np.argmax(corners == end[:, None], axis=1) for end in (edges.first, edges.second))
        return np.asarray(self.sides[first, second])


_triangle = cache(Triangle)


def barycentric(t: FloatArray) -> FloatArray:
    """Barycentric coordinates (…, 3) of reference points (…, 2)."""
    t = np.asarray(t, dtype=float)
    return np.concatenate([1.0 - t.sum(axis=-1, keepdims=True), t], axis=-1)


@lru_cache(maxsize=16)
def reference_matrices(cell: Triangle) -> FloatArray:
    """∫ ∂_a B_i ∂_b B_j over the reference cell, shape (2, 2, n, n) as [a, b, i, j]."""
    t, weights = cell.quadrature(cell.degree + 1)
    values = cell.derivative_values(t)
    slopes = [values @ cell.differences[axis] for axis in (0, 1)]
    found = np.array([[first.T @ (weights[:, None] * second) for second in slopes] for first in slopes])
    found.setflags(write=False)
    return found


@dataclass(frozen=True, eq=False)
class CurvedCells:
    """What arcs add to the triangles of a mesh that have some; dimensionless."""

    numbers: IntArray  # (c,): the cells
    corners: FloatArray  # (c, 3, 2): their corners
    bends: FloatArray  # (c, 3, k): how their sides bend, see `TriangleMesh.sides`

    @classmethod
    def of(cls, mesh: TriangleMesh, length: float) -> "CurvedCells":
        """Those of a mesh, whose lengths are divided by `length`."""
        numbers = np.flatnonzero(mesh.curved)
        corners = (mesh.vertices[mesh.cells[numbers]] - mesh.origin) / length
        return cls(numbers, corners, mesh.sides[numbers])

    def among(self, cells: IntArray | slice, count: int) -> tuple[IntArray, IntArray]:
        """Places in `cells`, of so many cells, that have arcs, and which of these they are."""
        chosen = np.arange(count)[cells]
        place = np.full(count, -1)
        place[self.numbers] = np.arange(len(self.numbers))
        at = np.flatnonzero(place[chosen] >= 0)
        return at, place[chosen][at]

    @cached_property
    def _bulges(self) -> FloatArray:
        """Coefficients of Legendre of q of all sides, (3, c, terms, 2)."""
        t = gauss_legendre(_TERMS + self.bends.shape[2])[0]
        found = np.zeros((3, len(self.numbers), len(t), 2))
        for s, (a, b) in enumerate(EDGES):
            chord = self.corners[:, b] - self.corners[:, a]
            bulge = arc_offsets(chord, self.bends[:, s], t) - t[:, None] * chord[:, None]
            found[s] = legendre_from_values(len(t) - 1, len(t)) @ (bulge / (t * (1.0 - t))[:, None])
        return found

    def mapped(self, which: IntArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points x (k, q, 2) and ∂x_b/∂t_a (k, q, b, a) at reference points t, (q, 2) or (k, q, 2), of cells (k,)."""
        corners, places = self.corners[which], barycentric(np.broadcast_to(t, (len(which), *np.shape(t)[-2:])))
        points = places @ corners
        slopes = np.repeat((corners.swapaxes(1, 2) @ _SLOPES)[:, None], places.shape[1], axis=1)
        for s, (a, b) in enumerate(EDGES):
            bent = np.flatnonzero(self.bends[which, s].any(axis=1))  # mostly one side of three is an arc
            first, second, q = places[bent, :, a, None], places[bent, :, b, None], self._bulges[s, which[bent]]
            value, steep = (legvander((second - first)[..., 0], c.shape[1] - 1) @ c for c in (q, legder(q, axis=1)))
            points[bent] += first * second * value
            slopes[bent] += value[..., None] * (first * _SLOPES[b] + second * _SLOPES[a])[..., None, :]
            slopes[bent] += (first * second * steep)[..., None] * (_SLOPES[b] - _SLOPES[a])
        return points, slopes

    def reference(self, which: IntArray, points: FloatArray) -> FloatArray:
        """Reference points t (k, q, 2) of points (k, q, 2) in some of the cells (k,)."""
        corners = self.corners[which]
        straight = np.linalg.inv(corners.swapaxes(1, 2) @ _SLOPES)
        t = (points - corners[:, :1]) @ straight.swapaxes(1, 2)
        for _ in range(_STEPS):
            found, slopes = self.mapped(which, t)
            t = t + np.linalg.solve(slopes, (points - found)[..., None])[..., 0]
        return np.asarray(t)


@dataclass(frozen=True, eq=False)
class DisplacementSpace:
    """Displacements of degree p on the cells of a mesh; lengths divided by L, places relative to the mesh's origin."""

    mesh: TriangleMesh
    cell: Triangle  # the reference triangle, with n coefficients
    origins: FloatArray  # (cells, 2): where the first corner of each cell lies
    frames: FloatArray  # (cells, 2, 2): its axes as columns: a reference point t lies at origin + frame t
    table: IntArray  # (cells, n): coefficients of a scalar field on each cell
    block: IntArray  # (cells,): number of the block each cell belongs to; blocks are separated by joints
    curved: CurvedCells  # cells with sides that are arcs

    @classmethod
    def of(cls, problem: ContactProblem, cell: Triangle, length: float) -> "DisplacementSpace":
        """The space of a problem."""
        mesh, count, n = problem.mesh, len(problem.mesh.cells), len(cell.places)
        first, along, across = mesh.corners.swapaxes(0, 1)
        frames = np.stack([along - first, across - first], axis=-1) / length
        whole = np.ones(len(mesh.interior), dtype=bool)
        for joint in problem.joints:
            whole[mesh.joint_set(joint.edges)] = False
        edges = mesh.interior.take(whole)
        near, far = (n * edges.cells[:, [side]] + cell.along(mesh, edges, side) for side in (0, 1))
        table = linked(near, far, n * count).reshape(count, n)
        block = linked(edges.cells[:, 0], edges.cells[:, 1], count)
        return cls(mesh, cell, (first - mesh.origin) / length, frames, table, block, CurvedCells.of(mesh, length))

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
        """Gradients of the reference coordinates, ∂t_a/∂x_b as [cell, a, b]."""
        return np.asarray(np.linalg.inv(self.frames), dtype=np.float64)

    def inverse_jacobians(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """∂t_a/∂x_b as [cell, point, a, b]; one point stands for all where no cell has arcs."""
        found = self.slopes[cells][:, None]
        at, which = self.curved.among(cells, len(self.table))
        if len(at):
            found = np.repeat(found, np.shape(t)[-2], axis=1)
            found[at] = np.linalg.inv(self.curved.mapped(which, t if np.ndim(t) == 2 else t[at])[1])
        return np.asarray(found)

    @cached_property
    def areas(self) -> FloatArray:
        """Of a cell to that of the reference cell (cells,)."""
        return np.asarray(np.abs(np.linalg.det(self.frames)))

    @property
    def dofs(self) -> IntArray:
        """Degrees of freedom of displacements of the cells (cells, 2 n)."""
        return np.asarray(2 * self.table[:, :, None] + np.arange(2)).reshape(len(self.table), -1)

    def assembled(self, blocks: FloatArray) -> sparse.csr_array:
        """The sum (size, size) of matrices of the cells (cells, 2 n, 2 n)."""
        return spread(self.dofs, self.dofs, blocks, self.size)

    def points(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Coordinates of reference points (k, 2), or (cells, k, 2), in cells, shape (cells, k, 2)."""
        found = np.asarray(self.origins[cells][:, None] + t @ self.frames[cells].swapaxes(1, 2))
        if len(self.curved.numbers):
            at, which = self.curved.among(cells, len(self.table))
            found[at] = self.curved.mapped(which, t if np.ndim(t) == 2 else t[at])[0]
        return found

    def own(self, cells: IntArray | slice, t: FloatArray) -> FloatArray:
        """Reference points of this space from those of the mesh, (k, 2) or (cells, k, 2), which differ beside arcs."""
        at, which = self.curved.among(cells, len(self.table))
        if not len(at):
            return t
        found = np.array(np.broadcast_to(t, (len(np.arange(len(self.table))[cells]), *np.shape(t)[-2:])))
        placed = self.mesh.placed(self.curved.numbers[which], barycentric(found[at]))
        found[at] = self.curved.reference(which, placed @ self.curved.corners[which])
        return found

    def measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q) of areas from those on the reference cell (q,), at its points t (q, 2)."""
        found = self.areas[:, None] * weights
        if len(self.curved.numbers):
            every = np.arange(len(self.curved.numbers))
            found[self.curved.numbers] = np.abs(np.linalg.det(self.curved.mapped(every, t)[1])) * weights
        return np.asarray(found)

    @cached_property
    def places(self) -> FloatArray:
        """Where each coefficient sits, shape (size / 2, 2): coefficients of a linear function are its values there."""
        found = np.empty((self.size // 2, 2))
        found[self.table] = self.points(slice(None), self.cell.places)
        return found

    @cached_property
    def owner(self) -> IntArray:
        """Block of each coefficient (size / 2,)."""
        found = np.empty(self.size // 2, dtype=np.int64)
        found[self.table] = self.block[:, None]
        return found

    def along(self, edges: Edges, *, other: bool = False) -> IntArray:
        """Coefficients on edges (e, p + 1), along the tangent; with `other` those of the cell beyond an edge inside."""
        return self.table[edges.cells[:, [int(other)]], self.cell.along(self.mesh, edges, int(other))]

    @cached_property
    def positions(self) -> FloatArray:
        """Coefficients (size / 2, 2) of x as a displacement: those of affine functions are their values there."""
        found, bent = self.places.copy(), self.table[self.curved.numbers]
        found[bent] = np.linalg.inv(self.cell.values(self.cell.places)) @ found[bent]  # the map is no affine one
        return found

    def rigid(self) -> FloatArray:
        """Rigid motions of every block, shape (size, 3 blocks): along x, along y, turning about its middle."""
        places, owner, every = self.positions, self.owner, np.arange(self.size // 2)
        middles = np.stack([np.bincount(owner, along) for along in places.T]) / np.bincount(owner)
        x, y = places.T - middles[:, owner]
        found = np.zeros((self.size // 2, 2, middles.shape[1], 3))
        found[every, 0, owner, 0] = found[every, 1, owner, 1] = 1.0
        found[every, 0, owner, 2], found[every, 1, owner, 2] = -y, x
        return found.reshape(self.size, -1)


def spread(rows: IntArray, columns: IntArray, blocks: FloatArray, size: int) -> sparse.csr_array:
    """Blocks (n, r, c) at these rows (n, r) and columns (n, c), shape (size, size)."""
    at = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    return sparse.csr_array((blocks.ravel(), (at[0].ravel(), at[1].ravel())), shape=(size, size))


MISFIT = 1e-10
"""Difference between data and their polynomial on an edge, relative to the data's unit, that counts as rounding."""

PARALLEL = 1e-8
"""Sine of the angle between two directions that is the rounding of coordinates."""

ALIKE = 2e-4  # the same where coordinates were rounded to few digits, as in files of meshes
ROUNDED = f"Edges that meet at an angle below {ALIKE:.0e}, as those of rounded coordinates, count as parallel."


def edge_data(
    mesh: TriangleMesh, edges: Edges, name: str, field: Field, degree: int, unit: float
) -> tuple[FloatArray, float]:
    """A field on edges over its unit as polynomials: Bernstein coefficients (e, degree + 1), and the most they miss.

    The polynomial meets the function at both ends of each edge; what it misses is seen at `SAMPLES`.
    """
    t = lobatto_points(degree)
    values = evaluate(name, field, *mesh.points_along(edges, t)) / unit
    coefficients = values @ bernstein_from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    if not callable(field):
        return np.broadcast_to(values[:, :1], coefficients.shape).copy(), 0.0
    t = SAMPLES
    wanted = evaluate(name, field, *mesh.points_along(edges, t)) / unit
    misfit = np.abs(coefficients @ bernstein_basis(degree, t).T - wanted)
    return coefficients, float(misfit.max(initial=0.0))


def in_lines(vectors: FloatArray, places: IntArray, straight: BoolArray) -> FloatArray:
    """Unit vectors (n, 2); of `straight` ones that meet in places (n, k), parallel ones as the first of their line.

    Parallel but for rounded coordinates: none turns by more than `ALIKE`. What meets none of them stays as it is.
    """
    at = np.arange(len(places)).repeat(places.shape[1]), places.ravel()
    touching = sparse.csr_array((np.ones(places.size), at), shape=(len(places), int(places.max(initial=0)) + 1))
    one, other = np.asarray((touching @ touching.T).nonzero(), dtype=np.int64)
    alike = straight[one] & straight[other] & (np.abs(cross(vectors[one], vectors[other])) <= ALIKE)
    line, found, left = linked(one[alike], other[alike], len(places)), vectors.copy(), straight.nonzero()[0]
    while len(left):
        start, which = np.unique(line[left], return_index=True, return_inverse=True)[1:]
        first = vectors[left[start]][which]
        alike = np.abs(cross(vectors[left], first)) <= ALIKE
        found[left[alike]] = (np.sign((vectors[left] * first).sum(axis=1))[:, None] * first)[alike]
        left = left[~alike]
    return found


def components_along(edges: Edges, directions: FloatArray, degree: int, *, turns: bool = True) -> FloatArray:
    """Coefficients of d·v on edges from those of v, (e, p + 1, p + 1, 2), for directions d of chords (e, 2).

    They are d·v of each, but inside arcs along which d turns: there those of the polynomial d(t)·v(t) at nodes.
    """
    vectors = vectors_along(edges, directions, np.linspace(0.0, 1.0, degree + 1), turns=turns)
    found, bent = np.eye(degree + 1)[:, :, None] * vectors[:, :, None], edges.bent & turns
    if bent.any():
        nodes = lobatto_points(degree)
        project, values = bernstein_from_values(degree)[1:-1], bernstein_basis(degree, nodes)
        turned = vectors_along(edges.take(bent), directions[bent], nodes)
        found[bent, 1:-1] = np.einsum("ki,eia,ij->ekja", project, turned, values)
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class PrescribedDisplacements:
    """Prescribed displacements C v = d, solved: v = B z + v₀."""

    rows: Functionals  # C, one by one
    basis: Basis
    particular: FloatArray  # (size,): v₀
    reasons: tuple[str, ...]  # why they do not meet the data exactly; nothing if they do
    jumps: tuple[str, ...]  # those of them that say where they disagree

    def beside(self, count: int) -> tuple[sparse.csr_array, FloatArray]:
        """B and v₀ with so many more degrees of freedom behind those of the body, which nothing prescribes."""
        B = sparse.block_diag([self.basis.matrix, sparse.eye_array(count)], format="csr")
        return sparse.csr_array(B), np.append(self.particular, np.zeros(count))


def supports(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, least: float = MISFIT
) -> PrescribedDisplacements:
    """Prescribed displacements; where some disagree in a corner their mean, by least squares.

    They disagree if they differ by more than a share of their size. Directions along one line but for rounded
    coordinates count as one: each vertex of an oblique side would be held along it too, by neighbours that differ. So
    do those of contacts with friction that a support meets: what it holds of their slip in the corner is all or none.
    """
    p, unit, reasons, jumps = space.degree, scales.displacement, list[str](), list[str]()
    width = 2 * (p + 1)  # of rows: on the coefficients of an edge
    columns, entries = [np.empty((0, width), np.int64)], [np.empty((0, 1, width))]
    values, places = [np.empty(0)], [np.empty(0, np.int64)]  # of which coefficient alone they are; −1 inside arcs
    conditions = problem.prescribed(Displacement)
    stated, ends, bends = [np.empty((0, 2))], [np.empty((0, 2), np.int64)], [np.empty(0, bool)]
    sheared = [problem.mesh.edges(each.edges) for each in problem.contacts if bears_shear(each)]
    for vectors, edges, turns in (
        *((vectors, each, True) for each in sheared for vectors in (each.tangent, each.normal)),
        *((given.direction, given.edges, given.turns) for given in conditions),
    ):
        stated.append(vectors)
        ends.append(np.stack([edges.first, edges.second], axis=1))
        bends.append(edges.bent & turns)
    directions = in_lines(np.concatenate(stated), np.concatenate(ends), ~np.concatenate(bends))
    parts, first = np.split(directions, np.cumsum([len(part) for part in stated[1:]])), 2 * len(sheared)
    if np.abs(directions - np.concatenate(stated))[sum(map(len, parts[:first])) :].max(initial=0.0) > PARALLEL:
        reasons.append(ROUNDED)
    for given, direction, bent in zip(conditions, parts[first:], bends[first + 1 :], strict=False):  # the last is empty
        edges, numbers = given.edges, space.along(given.edges)
        data, misfit = edge_data(problem.mesh, edges, given.name, given.value, p, unit)
        if misfit > MISFIT * max(1.0, float(np.abs(data).max(initial=0.0))):
            reasons.append(
                f"{given.name} is not a polynomial of degree {p} on each edge. It is interpolated, with an "
                f"error of up to {misfit * unit:.2g} [length]."
            )
        rows = components_along(edges, direction, p, turns=given.turns)
        if bent.any():
            reasons.append(f"{given.name} holds on arcs as closely as polynomials of degree {p} follow its directions.")
        dofs = np.broadcast_to(2 * numbers[:, None, :, None] + np.arange(2), rows.shape)
        columns.append(dofs.reshape(-1, width))
        entries.append(rows.reshape(-1, 1, width))
        values.append(data.ravel())
        places.append(np.where(np.outer(bent, np.arange(p + 1) % p > 0), -1, numbers).ravel())

    C = Functionals(np.concatenate(columns), np.concatenate(entries), space.size)
    value, at = np.concatenate(values), np.concatenate(places)
    inside = np.isin(np.arange(space.size) // 2, at, invert=True)  # of arcs, what rows there are solved for
    solved = Elimination.of(C, inside.astype(np.int64), PARALLEL)
    particular, missed = solved.particular(value)
    if np.abs(missed).max(initial=0.0) > least * max(1.0, np.abs(value).max(initial=0.0)):
        worst = int(np.argmax(np.abs(missed)))
        number = np.setdiff1d(np.arange(len(value)), solved.rows)[worst]
        corner = place_of(problem.mesh.origin + scales.length * space.places[at[number]])
        jumps.append(
            f"Prescribed displacements disagree at {corner}, by about {abs(missed[worst]) * unit:.3g} [length]. There "
            "stresses grow on finer meshes, and the energy of the body, without end. Let them agree."
        )
        corners = C.take((at >= 0).nonzero()[0]).matrix()
        value[at >= 0] = corners @ lsqr(corners, value[at >= 0], atol=1e-14, btol=1e-14, iter_lim=100)[0]
        particular = solved.particular(value)[0]
    return PrescribedDisplacements(C, solved.basis, particular, (*reasons, *jumps), tuple(jumps))


def corners_that_jump(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, held: PrescribedDisplacements, least: float
) -> tuple[str, ...]:
    """A sentence for each contact at whose end supports demand what its obstacle does not let be, by such a share.

    Along tangents too where it is tied. On vertices of degree 1; joints, springs, and plates driven by force give way.
    """
    found, ends = list[str](), np.array([0.0, 1.0])
    for direction, values, both, edges, contact in bounds(problem):
        if contact is None:
            continue
        (x, y), dofs = problem.mesh.points_along(edges, ends), 2 * space.along(edges)[..., None] + np.arange(2)
        d, wall = vectors_along(edges, direction, ends), values[:, [0, -1]].ravel()
        rows = spread(np.arange(x.size)[:, None], dofs.reshape(-1, 2), d.reshape(-1, 1, 2), space.size)[: x.size]
        beyond = scales.displacement * (rows @ held.particular) - wall
        beyond = np.abs(beyond) if both else np.maximum(beyond, 0.0)
        beyond[abs(rows @ held.basis.matrix).sum(axis=1) > ALIKE] = 0.0  # what supports leave open
        worst = int(np.argmax(beyond))
        if beyond[worst] > least * max(scales.displacement, float(np.abs(wall).max())):
            found.append(
                f"At {place_of((x.flat[worst], y.flat[worst]))} a support and the obstacle of {contact.name!r} "
                f"demand displacements that differ by {beyond[worst]:.3g} [length]. There stresses grow on finer "
                "meshes, and the forces on both, without end. Let them agree, or let some of the side between them "
                "be free."
            )
    return tuple(found)
