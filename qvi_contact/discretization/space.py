"""The space of Airy functions: Hsieh-Clough-Tocher elements of one degree p on a mesh.

Coordinates are shifted to the mesh's origin and divided by its length L, stresses by S, displacements by C S L
(`Scales`), so that no unit enters here. The N degrees of freedom u of the dimensionless Φ are those of
`element.hsieh_clough_tocher`, scaled so that a unit of each has an energy of the same order,

    Φ/s, Φ_x, Φ_y   at the vertices; those of the vertex v are numbered 3 v, 3 v + 1, 3 v + 2
    h N_k, h Q_k    on edges, numbered behind the vertices
    a_k/d, b_k      of holes, numbered behind the edges

with s the length of the shortest edge at the vertex, h the length of the edge and d the size of the hole. Where a mesh
has small cells in places far from each other, Φ is measured from an affine function in each of them. Around holes Φ is
multivalued. `Frames` explains both. Three families of linear functionals make up (D2):

    σ_N = Φ_tt + φ and σ_T = −Φ_nt on edges                      `StressSpace.traces`
    prescribed tractions d·σn = T on edges  →  u = B z + u₀      `Supports`
    ½ ∫ cσ:σ with σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy)                 `BodyStiffness`

with n and t of `Edges`, d a unit direction for each edge. A stress or traction "without φ" lacks the potential of the
body force: the caller adds it to σ_N, or to σ_xx and σ_yy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Final, Literal, NamedTuple, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.curved import CurvedTriangles, from_corners
from qvi_contact.discretization.frames import Frames
from qvi_contact.element.edge import bernstein_basis, gauss_legendre, legendre_basis_at
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, hsieh_clough_tocher
from qvi_contact.element.triangle import EDGES, AffineTriangles, quadrature, triangle_lattice
from qvi_contact.mesh.edges import TURNED, Edges, stretches
from qvi_contact.mesh.triangles import TriangleMesh
from solvers.basics.types import PicklesFields

FAMILY: Final = "Hsieh-Clough-Tocher"
"""Name of the element in logs and reports."""

_INWARD: Final = 1e-9  # distance of drawn points from the border of their part of a triangle, over the part's size
POTENTIAL: Final = 5  # degree of a body potential whose energy is integrated exactly
_ARCS, _STRAIGHT = 6, -4  # degree of quadrature less 2 p, where a mesh has arcs and where not
_THREE: Final = np.arange(3)
_AFFINE: Final = 3  # Φ and ∇Φ in the first corner of a triangle, which define its affine function
_CORNERS: Final = 6  # differences of Φ and ∇Φ to it in the other two corners

LawOn: TypeAlias = Literal["edges", "points"]
"""Where the contact law holds: on whole edges (rows of (D2) are Bernstein coefficients), or at Gauss points."""


@dataclass(frozen=True, eq=False)
class EdgeRule:
    """The rows ρ (q,) of (D2) on an edge, and their tractions V ρ at q Gauss points, where results are given."""

    law_on: LawOn
    points: FloatArray  # (q,): Gauss points on [0, 1]
    # (q,): where friction, cohesion and cap of the rows are evaluated, and the weights W of the rows over the edge's
    # length, of sum 1: Gauss points and weights for Gauss rows; i/(q − 1) and 1/q for Bernstein coefficients
    places: FloatArray
    shares: FloatArray
    to_points: FloatArray  # (q, q): V; the identity for Gauss rows
    from_points: FloatArray  # (q, q): V⁻¹

    @property
    def count(self) -> int:
        """The number q of rows, and of Gauss points, on an edge."""
        return len(self.points)

    def at_points(self, rows: FloatArray) -> FloatArray:
        """Tractions at the Gauss points (m,) from rows (m,): V ρ, edge by edge."""
        return np.asarray(rows.reshape(-1, self.count) @ self.to_points.T).ravel()

    def at_rows(self, values: FloatArray) -> FloatArray:
        """Rows (m,) from tractions at the Gauss points (m,): V⁻¹ σ, edge by edge."""
        return np.asarray(values.reshape(-1, self.count) @ self.from_points.T).ravel()

    def multipliers_at_points(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers at the Gauss points (m,) that do the work of multipliers of rows (m,): V⁻ᵀ m."""
        return np.asarray(multipliers.reshape(-1, self.count) @ self.from_points).ravel()


@cache
def edge_rule(law_on: LawOn, degree: int) -> EdgeRule:
    """The rule for Φ of a degree p: q = p − 1 rows, as many as σ_N has coefficients, so that rows are independent."""
    count = degree - 1
    points, weights = gauss_legendre(count)
    if law_on == "points":
        return EdgeRule(law_on, points, points, weights, np.eye(count), np.eye(count))
    values = bernstein_basis(count - 1, points)
    places, shares = np.linspace(0.0, 1.0, count), np.full(count, 1.0 / count)
    return EdgeRule(law_on, points, places, shares, values, np.asarray(np.linalg.inv(values)))


class Functionals(NamedTuple):
    """Linear functionals of the degrees of freedom u (N,) of a body, r for each of n edges, triangles or groups."""

    # (n, l): the degrees of freedom of each group; of an edge: Φ, Φ_x, Φ_y at both ends, then N_k and Q_k
    columns: IntArray
    values: FloatArray  # (n, r, l): factors of these degrees of freedom
    size: int  # number N of all degrees of freedom

    def take(self, index: IntArray) -> Functionals:
        """The functionals of the groups with these indices."""
        return Functionals(self.columns.take(index, axis=0), self.values.take(index, axis=0), self.size)

    def apply(self, u: FloatArray) -> FloatArray:
        """Values (n, r) of the functionals at u (N,)."""
        return np.asarray((self.values @ u[self.columns][:, :, None])[:, :, 0])

    def adjoint(self, weights: FloatArray) -> FloatArray:
        """The sum of weights (n, r) times the functionals, a vector over all degrees of freedom (N,)."""
        sums = (weights[:, None, :] @ self.values)[:, 0]
        return np.asarray(np.bincount(self.columns.ravel(), sums.ravel(), self.size), dtype=np.float64)

    def matrix(self) -> sparse.csr_array:
        """The functionals as rows of a sparse matrix (n r, N)."""
        is_entry = self.values != 0.0
        starts = np.concatenate([[0], np.cumsum(is_entry.sum(axis=2))])
        columns = np.broadcast_to(self.columns[:, None], is_entry.shape)[is_entry]
        return sparse.csr_array((self.values[is_entry], columns, starts), shape=(len(starts) - 1, self.size))


@dataclass(frozen=True, eq=False)
class Differences:
    """The map u (N,) ↦ w (n, k): in each triangle, the differences of Φ to the affine function of its first corner.

    Rows of energies act on w, which is computed first: so large numbers cancel in the subtraction only.
    """

    dofs: IntArray  # (n, k + 3): the degrees of freedom of the corners, then those on edges, which are no differences
    units: FloatArray  # (n, k + 3): Φ, Φ_x, Φ_y, N_k or Q_k for one unit of these; 0 where `beyond` has all of it
    sides: FloatArray  # (n, 2, 2): x_k − x₀ of the second and third corner
    size: int  # number N of all degrees of freedom
    # (6 n, N) sparse: what other frames add in corners that count from other frames than the first; None for nothing
    beyond: sparse.csr_array | None

    def apply(self, u: FloatArray) -> FloatArray:
        """The differences w (n, k) of degrees of freedom u (N,)."""
        values = self.units * u[self.dofs]
        # Φ_k − Φ₀ and ∇Φ_k − ∇Φ₀ first: nearly equal numbers cancel without rounding; then − (x_k − x₀)·∇Φ₀
        values[:, 3:6] -= values[:, :3]
        values[:, 6:9] -= values[:, :3]
        values[:, 3:9:3] -= (self.sides @ values[:, 1:3, None])[:, :, 0]
        w = values[:, 3:]
        if self.beyond is not None:
            w[:, :_CORNERS] += (self.beyond @ u).reshape(-1, _CORNERS)
        return w

    def magnitudes(self, sizes: FloatArray) -> FloatArray:
        """`apply` with + for every −: bounds (n, k) of the numbers subtracted in w, from |u| (N,)."""
        units, beyond = self.units.copy(), None if self.beyond is None else abs(self.beyond)
        units[:, :3] *= -1.0
        return replace(self, units=units, sides=np.abs(self.sides), beyond=beyond).apply(sizes)

    def adjoint(self, w: FloatArray) -> FloatArray:
        """The transposed map from w (n, k) to degrees of freedom (N,)."""
        on_dofs = self.expanded(w[:, None])
        total = np.bincount(self.dofs.ravel(), on_dofs.ravel(), self.size).astype(np.float64, copy=False)
        return total if self.beyond is None else total + self.beyond.T @ w[:, :_CORNERS].ravel()

    def expanded(self, rows: FloatArray) -> FloatArray:
        """Rows on w (n, r, k) as rows on each triangle's degrees of freedom (n, r, k + 3), without `beyond`."""
        on_first = -(rows[:, :, :3] + rows[:, :, 3:6])
        on_first[:, :, 1:] -= rows[:, :, :6:3] @ self.sides
        return np.concatenate([on_first, rows], axis=2) * self.units[:, None]

    def all_rows(self, rows: FloatArray, triangles: IntArray | slice = slice(None)) -> sparse.csr_array:
        """Rows on w (n, r, k), of t of the triangles, as a matrix on u (t r, N)."""
        matrix = Functionals(self.dofs[triangles], self.expanded(rows)[triangles], self.size).matrix()
        if self.beyond is None:
            return matrix
        places = np.arange(_CORNERS * len(self.dofs)).reshape(-1, _CORNERS)
        on_corners = Functionals(places[triangles], rows[triangles, :, :_CORNERS], places.size).matrix()
        return sparse.csr_array(matrix + on_corners @ self.beyond)


@dataclass(frozen=True, eq=False)
class StressSpace(PicklesFields):
    """The C1 functions of one degree on a mesh of triangles, dimensionless.

    Arrays that depend on mesh and degree only are computed once, for all problems on the mesh.
    """

    mesh: TriangleMesh
    degree: int  # degree p of Φ

    @cached_property
    def element(self) -> HsiehCloughTocher:
        """The element."""
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def size(self) -> int:
        """Number N of degrees of freedom."""
        return self.frames.start + 3 * len(self.frames.cuts)

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates of the vertices, shape (v, 2)."""
        return np.asarray((self.mesh.vertices - self.mesh.origin) / self.mesh.length)

    @cached_property
    def triangles(self) -> AffineTriangles:
        """The triangles with straight sides, dimensionless."""
        return AffineTriangles(self.vertices.take(self.mesh.cells, axis=0))

    @cached_property
    def curved(self) -> CurvedTriangles:
        """The triangles with arcs as sides."""
        numbers = np.flatnonzero(self.mesh.curved)
        return CurvedTriangles(self.element, numbers, self.triangles.take(self.mesh.curved), self.mesh.sides[numbers])

    @cached_property
    def dofs(self) -> IntArray:
        """Degrees of freedom of each triangle in the order of the element, shape (cells, shared)."""
        cells, edges, on_edge = self.mesh.cells, self.mesh.topology.of_cells, self.element.on_edge
        at_vertices = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 9)
        on_edges = (3 * len(self.vertices) + on_edge * edges[:, :, None] + np.arange(on_edge)).reshape(len(cells), -1)
        return np.concatenate([at_vertices, on_edges], axis=1)

    @cached_property
    def differences(self) -> Differences:
        """The map to w: Φ_k − Φ₀ − (x_k − x₀)·∇Φ₀ and ∇Φ_k − ∇Φ₀ in corners k = 1, 2, and N_k, Q_k on edges."""
        corners, units = self.triangles.corners, self.units[self.dofs]
        if len(self.frames.centres):
            units[:, :9] *= np.repeat(~self.frames.is_centre[self.mesh.cells], 3, axis=1)
        sides = corners[:, 1:] - corners[:, :1]
        return Differences(self.dofs, units, sides, self.size, self.frames.beyond(self.units))

    @cached_property
    def frames(self) -> Frames:
        """The affine functions that Φ is measured from."""
        start = 3 * len(self.vertices) + self.element.on_edge * len(self.mesh.topology.ends)
        return Frames.of(self.mesh, self.vertices, self.sizes, start)

    @cached_property
    def sizes(self) -> FloatArray:
        """Length of the shortest edge at each vertex, dimensionless."""
        return np.asarray(self.mesh.finest / self.mesh.length)

    @cached_property
    def units(self) -> FloatArray:
        """Φ, Φ_x, Φ_y, N_k, Q_k, a_k or b_k for one unit of the degree of freedom, shape (N,)."""
        units, frames, at_vertices = np.ones(self.size), self.frames, 3 * len(self.sizes)
        units[:at_vertices:3] = np.where(frames.is_centre, 1.0, self.sizes)
        first, second = self.vertices.take(self.mesh.topology.ends, axis=0).swapaxes(0, 1)
        units[at_vertices : frames.start] = np.repeat(1.0 / np.hypot(*(second - first).T), self.element.on_edge)
        units[frames.start :: 3] = frames.holes / self.mesh.length
        return units

    def lengths(self, edges: Edges) -> FloatArray:
        """Dimensionless lengths (n,) of edges; the length of the chord for an arc."""
        length = edges.length / stretches(edges.bend) if edges.curved else edges.length
        return length / self.mesh.length

    def traces(self, edges: Edges) -> Functionals:
        """Legendre coefficients of σ_N without φ, then of σ_T, along edges: 2 (p − 1) functionals per edge.

        They are N_0, N_1, N_2 …, then Q_0, Q_1 … times −n·m. On straight edges each is one of the `resultants`.
        """
        if edges in self._traces:
            return self._traces[edges]
        columns, resultants, size = self.resultants(edges)
        (m, factor), h, count = frame(edges), self.lengths(edges)[:, None], self.degree - 1
        # N₀ and Q₀ from ∇Φ_b − ∇Φ_a = h (N₀ t + Q₀ m), −N₁/6 from the moment, see `supports`
        N0, Q0 = ((vectors[:, :, None] * resultants[:, :2]).sum(axis=1) / h for vectors in (edges.tangent, m))
        resultants[:, 0], resultants[:, 1], resultants[:, 2] = N0, Q0, resultants[:, 2] / h**2
        order = np.array([0, 2, *range(3, count + 1), 1, *range(count + 1, 2 * count)])  # all N_k, then all Q_k
        values = resultants[:, order]
        values[:, 1] *= -6.0
        if edges.curved:  # see `curved`
            values[edges.bent] = from_corners(edges.bend[edges.bent], self.degree - 2) @ resultants[edges.bent]
        values[:, count:] *= factor[:, None, None]
        self._traces[edges] = Functionals(columns, values, size)
        return self._traces[edges]

    @cached_property
    def _traces(self) -> WeakKeyDictionary[Edges, Functionals]:
        return WeakKeyDictionary()

    def resultants(self, edges: Edges) -> Functionals:
        """∇Φ_b − ∇Φ_a, Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2, N_2 …, Q_1 …: 2p − 2 rows per edge, all that tractions fix.

        Columns are six at the ends, N_2 … N_(p−2), Q_1 … Q_(p−2), and those of the frames where there are any. Odd
        coefficients change their sign where the tangent runs from the larger vertex number to the smaller.
        """
        ends = [3 * ends[:, None] + _THREE for ends in (edges.first, edges.second)]
        on_edge = edges.number[:, None] * self.element.on_edge + np.arange(self.element.on_edge)
        columns = np.concatenate([*ends, 3 * len(self.vertices) + on_edge], axis=1)
        values: FloatArray = np.zeros((len(edges), 2 * self.degree - 2, columns.shape[1]))
        values[:, [0, 1], [1, 2]], values[:, [0, 1], [4, 5]] = -1.0, 1.0  # ∇Φ_b − ∇Φ_a
        values[:, 2, 0], values[:, 2, 3] = -1.0, 1.0  # Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2
        values[:, 2, 1:3] = values[:, 2, 4:6] = -self.lengths(edges)[:, None] * edges.tangent / 2.0
        place, sign = np.arange(6, columns.shape[1]), np.where(edges.first < edges.second, 1.0, -1.0)
        power = np.concatenate([np.arange(2, self.degree - 1), np.arange(1, self.degree - 1)])
        values[:, place - 3, place] = sign[:, None] ** power
        frames, on_dofs = self.frames, values * self.units[columns][:, None]
        if not len(frames.origins):
            return Functionals(columns, on_dofs, self.size)
        for first, at in ((0, edges.first), (3, edges.second)):
            on_dofs[:, :, first : first + 3] *= ~frames.is_centre[at, None, None]
        frame_dofs, on_frames = frames.on_edges(edges, values[:, :, 3:6])
        on_frames = on_frames * self.units[frame_dofs][:, None]
        return Functionals(np.hstack([columns, frame_dofs]), np.concatenate([on_dofs, on_frames], axis=2), self.size)

    def transformations(self, cells: slice = slice(None)) -> FloatArray:
        """Maps (cells, k, k) from w to the reference triangle's degrees of freedom, the first three left out."""
        return self.element.transformations(self.triangles.take(cells))[:, _AFFINE:, _AFFINE:]

    @cached_property
    def cell_quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Barycentric points (g, 3), and weights (g,) of sum 1, for energies; more if a mesh has arcs."""
        return split_points(2 * self.degree + (_ARCS if self.mesh.curved.any() else _STRAIGHT))

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u (N,) at the points t (q,) along each of n edges, edge by edge, (n q,) each."""
        basis = legendre_basis_at(self.element.traction_degree, tuple(t))
        at_points = self.traces(edges).apply(u).reshape(len(edges), 2, self.element.traction_degree + 1) @ basis.T
        return at_points[:, 0].ravel(), at_points[:, 1].ravel()

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ (normal σ_N + shear σ_T) over these points as a vector over all u (N,): the transpose of `tractions`."""
        basis = legendre_basis_at(self.element.traction_degree, tuple(t))
        weights = np.array([normal, shear]).reshape(2, len(edges), -1) @ basis
        return self.traces(edges).adjoint(weights.swapaxes(0, 1).reshape(len(edges), -1))

    def trace_rows(self, edges: Sequence[Edges], t: FloatArray) -> Functionals:
        """Functionals (2 n, q): σ_N without φ at the points t (q,) of n edges in several sets, then σ_T there."""
        if not edges:
            return Functionals(np.zeros((0, 1), dtype=np.int64), np.zeros((0, len(t), 1)), self.size)
        basis = legendre_basis_at(self.element.traction_degree, tuple(t))
        traces, halves = [self.traces(part) for part in edges], (slice(self.degree - 1), slice(self.degree - 1, None))
        values = np.concatenate([basis @ part.values[:, half] for half in halves for part in traces])
        return Functionals(np.concatenate([part.columns for part in traces] * 2), values, self.size)

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates (k, q, 2) of reference points t, (q, 3) or (k, q, 3), in the triangles (k,)."""
        return np.asarray(self.mesh.placed(cells, t) @ self.triangles.corners[cells])

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ at points of `points` (k, q, 3), from `BodyStiffness.coefficients`."""
        hessians = self._reference_sums(2, coefficients[cells], cells, t)
        return np.asarray(hessians @ self.triangles.stress_maps[cells].swapaxes(1, 2))

    def jumps(self, u: FloatArray) -> FloatArray:
        """Jumps (k, 3) of Φ and ∇Φ of u (N,) where each cut begins; the jump of ∇Φ is the hole's force, turned."""
        return np.asarray((self.units * u)[self.frames.start :].reshape(-1, 3))

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q), as dimensionless areas, from weights (q,) of sum 1 at reference points t (q, 3)."""
        measures = np.asarray(self.triangles.areas[:, None] * weights)
        curved = self.curved
        if len(curved.numbers):
            measures[curved.numbers] = curved.areas(t) * weights
        return measures

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at points of `points`, shape (k, q); on a cut, one of its two values."""
        of_cells, corners = coefficients[cells], self.triangles.corners[cells]
        placed = self.mesh.placed(cells, t)
        affine = of_cells[:, :1] + ((placed @ corners - corners[:, :1]) @ of_cells[:, 1:3, None])[:, :, 0]
        return np.asarray(affine + self._reference_sums(0, of_cells, cells, t)[:, :, 0])

    def _reference_sums(self, order: int, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Derivatives of an order of Φ less its affine part, in the reference triangle, (k, q, 1, 2 or 3)."""
        functions, mesh, factors = self.element.reference_functions, self.mesh, coefficients[:, 3:]
        if t.ndim == 2:  # one table of functions for all triangles, except those with arcs
            table, single = functions(t, order)[..., 3:], np.flatnonzero(mesh.curved[cells])
            sums = (factors @ table.reshape(-1, table.shape[2]).T).reshape(len(cells), *table.shape[:2])
        else:
            single, sums = np.arange(len(cells)), np.empty((*t.shape[:2], (1, 2, 3)[order]))
        if len(single):
            table = functions(mesh.placed(cells[single], t), order)[..., 3:]
            sums[single] = (table @ factors[single, None, :, None])[..., 0]
        return sums

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Barycentric points (k, 3) that divide the element's three parts, and corners (c, 3) of small triangles.

        Stresses may jump between the parts. So each part has its own points, just inside its border.
        """
        lattice, pieces = triangle_lattice(divisions)
        lattice = (1.0 - _INWARD) * lattice + _INWARD / 3.0
        parts = [np.array([*np.delete(np.eye(3), corner, axis=0), np.full(3, 1.0 / 3.0)]) for corner in range(3)]
        points = np.concatenate([lattice @ part for part in parts])
        return points, np.concatenate([pieces + part * len(lattice) for part in range(3)])


@cache
def split_points(degree: int) -> tuple[FloatArray, FloatArray]:
    """Reference points (g, 3) and weights (g,) of sum 1, exact up to a degree on each of the element's three parts."""
    points, weights = quadrature(degree)
    centre = np.full(3, 1.0 / 3.0)
    parts = [points @ np.vstack([np.eye(3)[a], np.eye(3)[b], centre]) for a, b in EDGES]
    return np.concatenate(parts), np.tile(weights / 3.0, 3)


def frame(edges: Edges) -> tuple[FloatArray, FloatArray]:
    """The normal m = (−t_y, t_x) left of the tangents of edges (n, 2), and −n·m (n,), the factor of Φ_tm in σ_T."""
    m = edges.tangent[:, ::-1] * TURNED
    return m, -np.sign((edges.normal * m).sum(axis=1))
