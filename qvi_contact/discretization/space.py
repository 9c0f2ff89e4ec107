"""The space of Airy functions: Hsieh-Clough-Tocher elements of one degree on a mesh, the only place where both meet.

Coordinates are shifted to the mesh's origin and divided by its length L, stresses by S, displacements by C S L
(`Scales`), so that no unit enters here. The N degrees of freedom u of the dimensionless Φ are those of
`element.hsieh_clough_tocher` in units that make the energies of all of them alike,

    Φ/s, Φ_x, Φ_y   at vertices, from three times the vertex's number on,
    h N_k, h Q_k    on edges, behind those of the vertices
    a_k/d, b_k      of holes, behind those of the edges

with s the length of the shortest edge at the vertex, h the edge's own and d the size of the hole. Where a mesh has
small cells in places far from each other, Φ counts from an affine function in each, and around holes it has several
values, see `Frames`. Three families of linear functionals make up (D2):

    σ_N = Φ_tt + φ and σ_T = −Φ_nt on edges                      `StressSpace.traces`
    prescribed tractions d·σn = T on edges  →  u = B z + u₀      `Supports`
    ½ ∫ cσ:σ with σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy)                 `BodyStiffness`

with n and t of `Edges`, d a unit direction for each edge. What is written "without φ" leaves the potential of the body
force to the caller, who adds it to σ_N, or to σ_xx and σ_yy.
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
"""Name of the element, for people."""

_INWARD: Final = 1e-9  # how far points of a part that is drawn lie inside it, as a share of its size
POTENTIAL: Final = 5  # degree of a body potential whose energy is integrated exactly
_ARCS, _STRAIGHT = 6, -4  # degree of quadrature beyond twice that of Φ where triangles have arcs, and where not
_THREE: Final = np.arange(3)
_AFFINE: Final = 3  # degrees of freedom of the first corner of a triangle, which an affine function is made of
_CORNERS: Final = 6  # differences in the other two corners

LawOn: TypeAlias = Literal["edges", "points"]
"""Where the contact law holds: on whole edges, rows of (D2) being Bernstein coefficients, or at Gauss points."""


@dataclass(frozen=True, eq=False)
class EdgeRule:
    """The rows ρ (q,) of (D2) on an edge, and the tractions V ρ at q Gauss points that results and works need."""

    law_on: LawOn  # what the rows are
    # (q,): Gauss points on [0, 1], and weights of sum 1
    points: FloatArray
    weights: FloatArray
    # (q,): where friction, cohesion and cap are evaluated for the rows, and the weights W of these over the edge's
    # length: points and weights for Gauss rows; i/(q − 1) and 1/q for Bernstein coefficients
    places: FloatArray
    shares: FloatArray
    # (q, q): V and V⁻¹; the identity for Gauss rows
    to_points: FloatArray
    from_points: FloatArray

    @property
    def count(self) -> int:
        """Rows an edge, and Gauss points an edge: q."""
        return len(self.points)

    def at_points(self, rows: FloatArray) -> FloatArray:
        """Tractions at the Gauss points (m,) from rows (m,): V ρ, edge by edge."""
        return np.asarray(rows.reshape(-1, self.count) @ self.to_points.T).ravel()

    def at_rows(self, values: FloatArray) -> FloatArray:
        """Rows (m,) from tractions at the Gauss points (m,): V⁻¹ σ, edge by edge."""
        return np.asarray(values.reshape(-1, self.count) @ self.from_points.T).ravel()

    def multipliers_at_points(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of tractions at the Gauss points (m,) from those of rows (m,): V⁻ᵀ m, of the same work."""
        return np.asarray(multipliers.reshape(-1, self.count) @ self.from_points).ravel()


@cache
def edge_rule(law_on: LawOn, degree: int) -> EdgeRule:
    """As many rows as σ_N and σ_T have coefficients on an edge where Φ is of that degree: rows are independent."""
    count = degree - 1
    points, weights = gauss_legendre(count)
    if law_on == "points":
        return EdgeRule(law_on, points, weights, points, weights, np.eye(count), np.eye(count))
    values = bernstein_basis(count - 1, points)
    places, shares = np.linspace(0.0, 1.0, count), np.full(count, 1.0 / count)
    return EdgeRule(law_on, points, weights, places, shares, values, np.asarray(np.linalg.inv(values)))


class Functionals(NamedTuple):
    """Linear functionals of the degrees of freedom u (N,) of a body: r of them on each of n edges, or another group."""

    # (n, l): the degrees of freedom of each group, of edges (Φ, Φ_x, Φ_y) at the first end, at the second, its own
    columns: IntArray
    values: FloatArray  # (n, r, l): the functionals; zeros are none
    size: int  # degrees of freedom N

    def take(self, index: IntArray) -> Functionals:
        """Those of some of the groups."""
        return Functionals(self.columns.take(index, axis=0), self.values.take(index, axis=0), self.size)

    def apply(self, u: FloatArray) -> FloatArray:
        """Their values (n, r) of degrees of freedom u (N,)."""
        return np.asarray((self.values @ u[self.columns][:, :, None])[:, :, 0])

    def adjoint(self, weights: FloatArray) -> FloatArray:
        """The sum of weights (n, r) times the functionals, a vector over all degrees of freedom (N,)."""
        sums = (weights[:, None, :] @ self.values)[:, 0]
        return np.asarray(np.bincount(self.columns.ravel(), sums.ravel(), self.size), dtype=np.float64)

    def rows(self) -> Functionals:
        """The same one by one: n r groups of one, group by group."""
        n, r, width = self.values.shape
        return Functionals(np.repeat(self.columns, r, axis=0), self.values.reshape(n * r, 1, width), self.size)

    def matrix(self) -> sparse.csr_array:
        """The same as rows of a matrix (n r, N), zeros left out."""
        there = self.values != 0.0
        starts = np.concatenate([[0], np.cumsum(there.sum(axis=2))])
        columns = np.broadcast_to(self.columns[:, None], there.shape)[there]
        return sparse.csr_array((self.values[there], columns, starts), shape=(len(starts) - 1, self.size))


@dataclass(frozen=True, eq=False)
class Differences:
    """Degrees of freedom (N,) triangle by triangle as differences w (n, k) to the affine function of the first corner.

    Rows on w are not multiplied into this where they are applied: large numbers cancel in w, and nowhere else.
    """

    corners: Functionals  # (n, 6, 9): those in the second and third corner
    edges: IntArray  # (n, k − 6): the degrees of freedom that are the others
    units: FloatArray  # (n, k − 6): what one unit of these is
    # (6 n, N) sparse, or None if there is nothing: what is added in corners that count from other frames than the first
    beyond: sparse.csr_array | None

    def apply(self, u: FloatArray) -> FloatArray:
        """Of degrees of freedom (N,): w (n, k)."""
        values, (own, first, slopes) = u[self.corners.columns], self._factors
        # what is alike is subtracted first: so the large numbers cancel without rounding
        corners = own * values[:, 3:].reshape(-1, 2, 3) + first * values[:, None, :3]
        corners[:, :, :1] += slopes @ values[:, 1:3, None]
        corners = corners.reshape(-1, _CORNERS)
        if self.beyond is not None:
            corners += (self.beyond @ u).reshape(corners.shape)
        return np.concatenate([corners, self.units * u[self.edges]], axis=1)

    @cached_property
    def _factors(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of a corner's own degrees of freedom, of the same of the first (n, 2, 3), of its slopes in Φ (n, 2, 2)."""
        table, k = self.corners.values, np.arange(_CORNERS)
        own, first = (table[:, k, at].reshape(-1, 2, 3) for at in (3 + k, k % 3))
        return own, first, np.ascontiguousarray(table[:, ::3, 1:3])

    def magnitudes(self, sizes: FloatArray) -> FloatArray:
        """`apply` with + for every −: the size (n, k) of the numbers that enter, from sizes (N,)."""
        corners = self.corners._replace(values=np.abs(self.corners.values))
        beyond = None if self.beyond is None else abs(self.beyond)
        return replace(self, corners=corners, beyond=beyond).apply(sizes)

    def adjoint(self, w: FloatArray) -> FloatArray:
        """The transposed map from w (n, k) to degrees of freedom (N,)."""
        on_edges = (self.units * w[:, _CORNERS:]).ravel()
        found = self.corners.adjoint(w[:, :_CORNERS]) + np.bincount(self.edges.ravel(), on_edges, self.corners.size)
        return found if self.beyond is None else found + self.beyond.T @ w[:, :_CORNERS].ravel()

    def expanded(self, rows: FloatArray) -> FloatArray:
        """Rows on w (n, r, k) as rows on the degrees of freedom of each triangle (n, r, shared), but for `beyond`."""
        on_corners = rows[:, :, :_CORNERS] @ self.corners.values
        return np.concatenate([on_corners, rows[:, :, _CORNERS:] * self.units[:, None]], axis=2)

    def all_rows(self, rows: FloatArray, triangles: IntArray | slice = slice(None)) -> sparse.csr_array:
        """Of rows on w (n, r, k) those of t triangles as a matrix (t r, N)."""
        dofs, size = np.hstack([self.corners.columns, self.edges]), self.corners.size
        found = Functionals(dofs[triangles], self.expanded(rows)[triangles], size).matrix()
        if self.beyond is None:
            return found
        places = np.arange(_CORNERS * len(dofs)).reshape(-1, _CORNERS)
        on_corners = Functionals(places[triangles], rows[triangles, :, :_CORNERS], places.size).matrix()
        return sparse.csr_array(found + on_corners @ self.beyond)


@dataclass(frozen=True, eq=False)
class StressSpace(PicklesFields):
    """The C1 functions of one degree on a mesh of triangles, dimensionless.

    What depends on mesh and degree alone is computed once for all problems that are discretised there.
    """

    mesh: TriangleMesh
    degree: int  # degree p of Φ

    @cached_property
    def element(self) -> HsiehCloughTocher:
        """The element."""
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.frames.start + 3 * len(self.frames.cuts)

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates, shape (v, 2)."""
        return np.asarray((self.mesh.vertices - self.mesh.origin) / self.mesh.length)

    @cached_property
    def triangles(self) -> AffineTriangles:
        """The triangles, dimensionless."""
        return AffineTriangles(self.vertices.take(self.mesh.cells, axis=0))

    @cached_property
    def curved(self) -> CurvedTriangles:
        """Those that have arcs."""
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
        """Degrees of freedom triangle by triangle: Φ_k − Φ₀ − (x_k − x₀)·∇Φ₀ and ∇Φ_k − ∇Φ₀, and those of edges."""
        corners, frames, units, each = self.triangles.corners, self.frames, self.units[self.dofs], np.arange(_CORNERS)
        if len(frames.centres):
            units[:, :9] *= np.repeat(~frames.is_centre[self.mesh.cells], 3, axis=1)
        values: FloatArray = np.zeros((len(corners), _CORNERS, 9))
        values[:, each, 3 + each], values[:, each, each % 3] = 1.0, -1.0
        values[:, ::3, 1:3] = corners[:, :1] - corners[:, 1:]
        in_corners = Functionals(self.dofs[:, :9], values * units[:, None, :9], self.size)
        return Differences(in_corners, self.dofs[:, 9:], units[:, 9:], frames.beyond(self.units))

    @cached_property
    def frames(self) -> Frames:
        """From where Φ counts."""
        start = 3 * len(self.vertices) + self.element.on_edge * len(self.mesh.topology.ends)
        return Frames.of(self.mesh, self.vertices, self.sizes, start)

    @cached_property
    def sizes(self) -> FloatArray:
        """Length of the shortest edge at each vertex, dimensionless."""
        return np.asarray(self.mesh.finest / self.mesh.length)

    @cached_property
    def units(self) -> FloatArray:
        """Φ, its slopes, N_k, Q_k, a_k or b_k over the degree of freedom that stands for it, shape (N,)."""
        found, frames, vertices = np.ones(self.size), self.frames, 3 * len(self.sizes)
        found[:vertices:3] = np.where(frames.is_centre, 1.0, self.sizes)
        first, second = self.vertices.take(self.mesh.topology.ends, axis=0).swapaxes(0, 1)
        found[vertices : frames.start] = np.repeat(1.0 / np.hypot(*(second - first).T), self.element.on_edge)
        found[frames.start :: 3] = frames.holes / self.mesh.length
        return found

    def lengths(self, edges: Edges) -> FloatArray:
        """Dimensionless lengths of edges (n,), of arcs those of their chords."""
        length = edges.length / stretches(edges.bend) if edges.curved else edges.length
        return length / self.mesh.length

    def traces(self, edges: Edges) -> Functionals:
        """Coefficients of Legendre of σ_N without φ, then of σ_T, along edges: 2 (p − 1) functionals an edge.

        N_0, N_1, N_2 …, then Q_0, Q_1 … times −n·m: on straight edges each is one of the `resultants`.
        """
        boundary = self.mesh.boundary
        if edges not in self._traces:
            if edges is boundary or (edges.cells[:, 1] >= 0).any():
                self._traces[edges] = self._traces_of(edges)
            else:  # every condition takes some of those of the boundary
                self._traces[edges] = self.traces(boundary).take(self.mesh.topology.outer.searchsorted(edges.number))
        return self._traces[edges]

    @cached_property
    def _traces(self) -> WeakKeyDictionary[Edges, Functionals]:
        return WeakKeyDictionary()

    def _traces_of(self, edges: Edges) -> Functionals:
        columns, known = self._resultants(edges)
        (m, factor), h, count = frame(edges), self.lengths(edges)[:, None], self.degree - 1
        along, across = ((vectors[:, :, None] * known[:, :2]).sum(axis=1) / h for vectors in (edges.tangent, m))
        known[:, 0], known[:, 1], known[:, 2] = along, across, known[:, 2] / h**2
        order = np.array([0, 2, *range(3, count + 1), 1, *range(count + 1, 2 * count)])
        values = known[:, order]
        values[:, 1] *= -6.0
        if edges.curved:  # see `curved`
            values[edges.bent] = from_corners(edges.bend[edges.bent], self.degree - 2) @ known[edges.bent]
        values[:, count:] *= factor[:, None, None]
        return self._scaled(edges, columns, values)

    def resultants(self, edges: Edges) -> Functionals:
        """What both tractions prescribe, 2p − 2 an edge: ∇Φ_b − ∇Φ_a, Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2, N_k, Q_k."""
        return self._scaled(edges, *self._resultants(edges))

    def _resultants(self, edges: Edges) -> tuple[IntArray, FloatArray]:
        """`resultants` on values of Φ, its slopes and N_k, Q_k as such: columns (n, l) and values (n, 2p − 2, l)."""
        columns, sign = self._columns(edges)
        values: FloatArray = np.zeros((len(edges), 2 * self.degree - 2, columns.shape[1]))
        values[:, [0, 1], [1, 2]], values[:, [0, 1], [4, 5]] = -1.0, 1.0
        values[:, 2, 0], values[:, 2, 3] = -1.0, 1.0
        values[:, 2, 1:3] = values[:, 2, 4:6] = -self.lengths(edges)[:, None] * edges.tangent / 2.0
        place = np.arange(6, columns.shape[1])
        power = np.concatenate([np.arange(2, self.degree - 1), np.arange(1, self.degree - 1)])
        values[:, place - 3, place] = sign[:, None] ** power
        return columns, values

    def _columns(self, edges: Edges) -> tuple[IntArray, FloatArray]:
        """Degrees of freedom of edges (n, l), see `Functionals`, and whether they run along their tangents (±1).

        Behind the six of its ends an edge has N_2 … N_(p−2), then Q_1 … Q_(p−2).
        """
        own = 3 * len(self.vertices) + self.element.on_edge * edges.number[:, None]
        ends = [3 * ends[:, None] + _THREE for ends in (edges.first, edges.second)]
        sign = np.where(edges.first < edges.second, 1.0, -1.0)
        return np.concatenate([*ends, own + np.arange(self.element.on_edge)], axis=1), sign

    def _scaled(self, edges: Edges, columns: IntArray, values: FloatArray) -> Functionals:
        """Functionals on values of Φ, its slopes and N_k, Q_k as such on degrees of freedom."""
        frames, on_dofs = self.frames, values * self.units[columns][:, None]
        if not len(frames.origins):
            return Functionals(columns, on_dofs, self.size)
        for first, ends in ((0, edges.first), (3, edges.second)):
            on_dofs[:, :, first : first + 3] *= ~frames.is_centre[ends, None, None]
        places, more = frames.on_edges(edges, values[:, :, 3:6])
        more = more * self.units[places][:, None]
        return Functionals(np.hstack([columns, places]), np.concatenate([on_dofs, more], axis=2), self.size)

    def transformations(self, cells: slice = slice(None)) -> FloatArray:
        """From differences w to the degrees of freedom of the reference triangle behind the third, (cells, k, k)."""
        return self.element.transformations(self.triangles.take(cells))[:, _AFFINE:, _AFFINE:]

    @cached_property
    def cell_quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Barycentric points (g, 3), and weights (g,) of sum 1, for energies; of arcs, no polynomials, more of them."""
        return split_points(2 * self.degree + (_ARCS if self.mesh.curved.any() else _STRAIGHT))

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u (N,) at the points t (q,) along each of n edges, edge by edge, (n q,) each."""
        values = legendre_basis_at(self.element.traction_degree, tuple(t))
        found = self.traces(edges).apply(u).reshape(len(edges), 2, self.element.traction_degree + 1) @ values.T
        return found[:, 0].ravel(), found[:, 1].ravel()

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T over the same points, a vector over all u (N,): `tractions` transposed."""
        values = legendre_basis_at(self.element.traction_degree, tuple(t))
        weights = np.array([normal, shear]).reshape(2, len(edges), -1) @ values
        return self.traces(edges).adjoint(weights.swapaxes(0, 1).reshape(len(edges), -1))

    def trace_rows(self, edges: Sequence[Edges], t: FloatArray) -> Functionals:
        """(2 n, q): σ_N without φ at the points t (q,) along each of these edges, set after set, then σ_T."""
        if not edges:
            return Functionals(np.zeros((0, 1), dtype=np.int64), np.zeros((0, len(t), 1)), self.size)
        values, parts = (
            legendre_basis_at(self.element.traction_degree, tuple(t)),
            [self.traces(part) for part in edges],
        )
        halves = slice(self.degree - 1), slice(self.degree - 1, None)
        found = np.concatenate([values @ part.values[:, half] for half in halves for part in parts])
        return Functionals(np.concatenate([part.columns for part in parts] * 2), found, self.size)

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates (k, q, 2) of reference points t, (q, 3) or (k, q, 3), in the triangles (k,)."""
        return np.asarray(self.mesh.placed(cells, t) @ self.triangles.corners[cells])

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ at such points, (k, q, 3); `coefficients` are those of `BodyStiffness`."""
        hessians = self._reference_sums(2, coefficients[cells], cells, t)
        return np.asarray(hessians @ self.triangles.stress_maps[cells].swapaxes(1, 2))

    def jumps(self, u: FloatArray) -> FloatArray:
        """By how much Φ of u (N,) and its slopes, the hole's force turned, jump where each cut begins, shape (k, 3)."""
        return np.asarray((self.units * u)[self.frames.start :].reshape(-1, 3))

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q), dimensionless areas, at reference points t (q, 3) with weights (q,) of sum 1."""
        found = np.asarray(self.triangles.areas[:, None] * weights)
        curved = self.curved
        if len(curved.numbers):
            found[curved.numbers] = curved.areas(t) * weights
        return found

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at such points, shape (k, q); where it jumps, one of its values."""
        chosen, corners = coefficients[cells], self.triangles.corners[cells]
        placed = self.mesh.placed(cells, t)
        affine = chosen[:, :1] + ((placed @ corners - corners[:, :1]) @ chosen[:, 1:3, None])[:, :, 0]
        return np.asarray(affine + self._reference_sums(0, chosen, cells, t)[:, :, 0])

    def _reference_sums(self, order: int, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ but for its affine part, or its Hessian, on the reference triangle; (k, q, components)."""
        functions, mesh, factors = self.element.reference_functions, self.mesh, coefficients[:, 3:]
        if t.ndim == 2:  # the same points of all triangles but those with arcs
            table, each = functions(t, order)[..., 3:], np.flatnonzero(mesh.curved[cells])
            found = (factors @ table.reshape(-1, table.shape[2]).T).reshape(len(cells), *table.shape[:2])
        else:
            each, found = np.arange(len(cells)), np.empty((*t.shape[:2], (1, 2, 3)[order]))
        if len(each):
            table = functions(mesh.placed(cells[each], t), order)[..., 3:]
            found[each] = (table @ factors[each, None, :, None])[..., 0]
        return found

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Barycentric points (k, 3) that divide the three parts of a triangle, and the corners (c, 3) of the pieces.

        Stresses may jump between the parts, so each has points of its own, which lie a trifle inside it.
        """
        flat, pieces = triangle_lattice(divisions)
        flat = (1.0 - _INWARD) * flat + _INWARD / 3.0
        parts = [np.array([*np.delete(np.eye(3), corner, axis=0), np.full(3, 1.0 / 3.0)]) for corner in range(3)]
        points = np.concatenate([flat @ part for part in parts])
        return points, np.concatenate([pieces + part * len(flat) for part in range(3)])


@cache
def split_points(degree: int) -> tuple[FloatArray, FloatArray]:
    """Reference points (g, 3) and weights (g,) of sum 1, exact up to a degree on each of a triangle's three parts."""
    points, weights = quadrature(degree)
    centre = np.full(3, 1.0 / 3.0)
    parts = [points @ np.vstack([np.eye(3)[a], np.eye(3)[b], centre]) for a, b in EDGES]
    return np.concatenate(parts), np.tile(weights / 3.0, 3)


def frame(edges: Edges) -> tuple[FloatArray, FloatArray]:
    """The normal m = (−t_y, t_x) left of the tangents of edges (n, 2), and −n·m (n,), the factor of Φ_tm in σ_T."""
    m = edges.tangent[:, ::-1] * TURNED
    return m, -np.sign((edges.normal * m).sum(axis=1))
