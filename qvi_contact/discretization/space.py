"""The space of Airy functions: Hsieh-Clough-Tocher elements of one degree on a mesh, the only place where both meet.

Coordinates are shifted to the mesh's origin and divided by its length L, stresses by S, displacements by C S L
(`Scales`), so that no unit enters here. The N degrees of freedom u of the dimensionless Φ are those of
`element.hsieh_clough_tocher` in units that make the energies of all of them alike,

    Φ/s, Φ_x, Φ_y   at vertices, from three times the vertex's number on,
    h N_k, h Q_k    on edges, behind those of the vertices
    a_k/d, b_k      of holes, behind those of the edges

with s the length of the shortest edge at the vertex, h the edge's own and d the size of the hole. Where a mesh has
small cells in places far from each other, Φ counts from an affine function in each, see `Frames`; around holes it has
several values, see `Cuts`. Three families of linear functionals make up (D2):

    σ_N = Φ_tt + φ and σ_T = −Φ_nt on edges                      `StressSpace.normal`, `StressSpace.shear`
    prescribed tractions d·σn = T on edges  →  u = B z + u₀      `eliminate_tractions`
    ½ ∫ cσ:σ with σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy)                 `TriangleEnergy`

with n and t of `Edges`, d a unit direction for each edge. What is written "without φ" leaves the potential of the body
force to the caller, who adds it to σ_N, or to σ_xx and σ_yy.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.condensed import Differences, potential_points, split_points
from qvi_contact.discretization.curved import CurvedTriangles, from_corners
from qvi_contact.discretization.elimination import EdgeFunctionals, stacked
from qvi_contact.discretization.frames import Cuts, Frames, shortest_cuts
from qvi_contact.element import legendre
from qvi_contact.element.affine import AffineTriangles
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, hsieh_clough_tocher
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.element.triangle import triangle_lattice
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh

FAMILY: Final = "Hsieh-Clough-Tocher"
"""Name of the element, for people."""

_INWARD: Final = 1e-9  # how far points of a part that is drawn lie inside it, as a share of its size
_ARCS: Final = 6  # degree of quadrature beyond twice that of Φ where triangles have arcs
_FIRST: Final = slice(1, 3)  # slopes at the first end of an edge
_SECOND: Final = slice(4, 6)

RowKind: TypeAlias = Literal["gauss", "bernstein"]
"""What the rows N and T of (D2) are: tractions at Gauss points of edges, or Bernstein coefficients on edges."""


@dataclass(frozen=True, eq=False)
class ContactRule:
    """Where on an edge the contact law is asked for, and where contacts are reported.

    The rows of (D2) on an edge are q numbers ρ. From them follow the tractions at q Gauss points, V ρ, where results
    are given and works integrated.

    Attributes
    ----------
    kind : "gauss" or "bernstein"
        What the rows are.
    points, weights : (q,) arrays
        Gauss points on [0, 1], and weights of sum 1.
    places, shares : (q,) arrays
        Where friction, cohesion and cap are evaluated for the rows, and the weights W of the rows over the edge's
        length, of sum 1. The same as points and weights for Gauss rows; i/(q − 1) and 1/q for Bernstein coefficients.
    to_points : (q, q) array or None
        V: tractions at the Gauss points from rows; None where rows are those tractions.

    """

    kind: RowKind
    points: FloatArray
    weights: FloatArray
    places: FloatArray
    shares: FloatArray
    to_points: FloatArray | None = None

    @classmethod
    def gauss(cls, count: int) -> "ContactRule":
        """Tractions at so many Gauss points an edge."""
        points, weights = gauss_legendre(count)
        return cls("gauss", points, weights, points, weights)

    @property
    def count(self) -> int:
        """Rows an edge, and Gauss points an edge: q."""
        return len(self.points)

    def at_points(self, rows: FloatArray) -> FloatArray:
        """Tractions at the Gauss points (m,) from rows (m,): V ρ, edge by edge."""
        return rows if self.to_points is None else np.asarray(self._grouped(rows) @ self.to_points.T).ravel()

    def at_rows(self, values: FloatArray) -> FloatArray:
        """Rows (m,) from tractions at the Gauss points (m,): V⁻¹ σ, edge by edge."""
        if self.to_points is None:
            return values
        return np.asarray(np.linalg.solve(self.to_points, self._grouped(values).T).T).ravel()

    def multipliers_at_points(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of tractions at the Gauss points (m,) from those of rows (m,): V⁻ᵀ m, of the same work."""
        if self.to_points is None:
            return multipliers
        return np.asarray(np.linalg.solve(self.to_points.T, self._grouped(multipliers).T).T).ravel()

    def multipliers_of_rows(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of rows (m,) from those of tractions at the Gauss points (m,): Vᵀ m."""
        return (
            multipliers if self.to_points is None else np.asarray(self._grouped(multipliers) @ self.to_points).ravel()
        )

    def _grouped(self, values: FloatArray) -> FloatArray:
        return np.asarray(values).reshape(-1, self.count)


@dataclass(frozen=True, eq=False)
class StressSpace:
    """The C1 functions of one degree on a mesh of triangles, dimensionless.

    Attributes
    ----------
    mesh : TriangleMesh
        The mesh.
    degree : int
        Degree p of Φ.
    rows : "bernstein" or "gauss"
        What the rows of contacts are.

    """

    mesh: TriangleMesh
    degree: int
    rows: RowKind = "bernstein"

    @cached_property
    def element(self) -> HsiehCloughTocher:
        """The element."""
        return hsieh_clough_tocher(self.degree)

    @cached_property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.cuts.start + 3 * len(self.cuts)

    @cached_property
    def cuts(self) -> Cuts:
        """Where Φ jumps."""
        start = 3 * len(self.vertices) + self.element.on_edge * len(self.mesh.topology.ends)
        return Cuts(self.mesh, shortest_cuts(self.mesh), start)

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates, shape (v, 2)."""
        return np.asarray((self.mesh.vertices - self.mesh.origin) / self.mesh.length)

    @cached_property
    def triangles(self) -> AffineTriangles:
        """The triangles, dimensionless."""
        return AffineTriangles(self.vertices[self.mesh.cells])

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
        return np.hstack([at_vertices, on_edges])

    @cached_property
    def differences(self) -> Differences:
        """Degrees of freedom triangle by triangle."""
        corners, frames = self.triangles.corners, self.frames
        units = self.units[self.dofs]
        if frames.several:
            units[:, :9] *= np.repeat(~frames.is_centre[self.mesh.cells], 3, axis=1)
        across = np.flatnonzero(frames.across(self.mesh.cells) | self.cuts.cells_across)
        beyond = frames.beyond(self.mesh.cells[across], self.size)
        if len(self.cuts):
            beyond = beyond + self.cuts.beyond(across, self.vertices, self.units)
        return Differences(corners[:, 1:] - corners[:, :1], self.dofs, units, self.size, across, beyond)

    @cached_property
    def frames(self) -> Frames:
        """From where Φ counts; centres lie on the boundary rather than inside."""
        return Frames.of(self.vertices, self.sizes, np.isin(np.arange(len(self.vertices)), self.mesh.boundary.first))

    @cached_property
    def sizes(self) -> FloatArray:
        """Length of the shortest edge at each vertex, dimensionless."""
        return np.asarray(self.mesh.finest / self.mesh.length)

    @cached_property
    def units(self) -> FloatArray:
        """Φ, its slopes, N_k, Q_k, a_k or b_k over the degree of freedom that stands for it, shape (N,)."""
        first, second = self.vertices[self.mesh.topology.ends].swapaxes(0, 1)
        values = np.where(self.frames.is_centre & self.frames.several, 1.0, self.sizes)
        at_vertices = np.column_stack([values, np.ones((len(self.sizes), 2))]).ravel()
        on_edges = np.repeat(1.0 / np.hypot(*(second - first).T), self.element.on_edge)
        of_holes = np.column_stack([self.cuts.holes / self.mesh.length, np.ones((len(self.cuts), 2))]).ravel()
        return np.concatenate([at_vertices, on_edges, of_holes])

    def number(self, edges: Edges) -> IntArray:
        """Edges (n,) as `mesh.topology` counts them."""
        return self.mesh.topology.number(np.column_stack([edges.first, edges.second]))

    def lengths(self, edges: Edges) -> FloatArray:
        """Dimensionless lengths of edges (n,), of arcs those of their chords."""
        length = edges.length / edges.stretch if edges.curved else edges.length
        return length / self.mesh.length

    def normal(self, edges: Edges) -> EdgeFunctionals:
        """Coefficients of Legendre, p − 1 an edge, of σ_N without φ along edges."""
        found, sign, h = self._blank(edges, self.degree - 1)
        values, slope = found.values, edges.tangent / self.lengths(edges)[:, None]
        values[:, 0, _FIRST], values[:, 0, _SECOND] = -slope, slope
        values[:, 1, _FIRST] = values[:, 1, _SECOND] = 3.0 * slope
        values[:, 1, 0], values[:, 1, 3] = 6.0 / h**2, -6.0 / h**2
        for k in range(2, self.degree - 1):
            values[:, k, self._place("N", k)] = sign**k
        if edges.curved:
            values[edges.bent] = self._on_arcs(edges.take(edges.bent))[:, : self.degree - 1]
        return self._scaled(edges, found)

    def shear(self, edges: Edges) -> EdgeFunctionals:
        """Coefficients of Legendre, p − 1 an edge, of σ_T along edges."""
        found, sign, h = self._blank(edges, self.degree - 1)
        m, factor = frame(edges)
        slope = factor[:, None] * m / h[:, None]
        found.values[:, 0, _FIRST], found.values[:, 0, _SECOND] = -slope, slope
        for k in range(1, self.degree - 1):
            found.values[:, k, self._place("Q", k)] = factor * sign**k
        if edges.curved:
            bent = edges.bent
            on_arcs = self._on_arcs(edges.take(bent))[:, self.degree - 1 :]
            found.values[bent] = factor[bent, None, None] * on_arcs
        return self._scaled(edges, found)

    def resultants(self, edges: Edges) -> EdgeFunctionals:
        """What both tractions prescribe, 2p − 2 an edge: ∇Φ_b − ∇Φ_a, Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2, N_k, Q_k."""
        return self._scaled(edges, self._resultants(edges))

    def _on_arcs(self, edges: Edges) -> FloatArray:
        """N_0 … N_(p−2), Q_0 … Q_(p−2) of Φ_ττ and Φ_τμ along arcs (n, 2p − 2, …), see `arcs`."""
        known = self._resultants(edges).values
        h, m = self.lengths(edges)[:, None], frame(edges)[0]
        force = known[:, :2].copy()
        known[:, 0] = (edges.tangent[:, :, None] * force).sum(axis=1) / h
        known[:, 1] = (m[:, :, None] * force).sum(axis=1) / h
        known[:, 2] /= h**2
        return np.asarray(from_corners(edges.bend, self.degree - 2) @ known)

    def _resultants(self, edges: Edges) -> EdgeFunctionals:
        """`resultants` on values of Φ, its slopes and N_k, Q_k as such."""
        found, sign, h = self._blank(edges, 2 * self.degree - 2)
        values = found.values
        for axis in (0, 1):
            values[:, axis, 1 + axis], values[:, axis, 4 + axis] = -1.0, 1.0
        values[:, 2, 0], values[:, 2, 3] = -1.0, 1.0
        values[:, 2, _FIRST] = values[:, 2, _SECOND] = -h[:, None] * edges.tangent / 2.0
        for kind, first in (("N", 2), ("Q", 1)):
            for k in range(first, self.degree - 1):
                place = self._place(kind, k)
                values[:, place - 3, place] = sign**k
        return found

    def _place(self, kind: str, k: int) -> int:
        """Where N_k, k ≥ 2, or Q_k, k ≥ 1, stands among the degrees of freedom of an edge and its ends."""
        return 6 + (k - 2 if kind == "N" else self.degree - 3 + k - 1)

    def _blank(self, edges: Edges, count: int) -> tuple[EdgeFunctionals, FloatArray, FloatArray]:
        """Functionals that are zero, whether edges run along their tangents (±1), and their lengths."""
        own = 3 * len(self.vertices) + self.element.on_edge * self.number(edges)[:, None]
        at_ends = [3 * ends[:, None] + np.arange(3) for ends in (edges.first, edges.second)]
        columns = np.hstack([*at_ends, own + np.arange(self.element.on_edge)])
        sign = np.where(edges.first < edges.second, 1.0, -1.0)
        values = np.zeros((len(edges), count, columns.shape[1]))
        return EdgeFunctionals(columns, values, self.size), sign, self.lengths(edges)

    def _scaled(self, edges: Edges, on_values: EdgeFunctionals) -> EdgeFunctionals:
        """Functionals on values of Φ, its slopes and N_k, Q_k as such on degrees of freedom."""
        values = on_values.values * self.units[on_values.columns][:, None]
        found = EdgeFunctionals(on_values.columns, values, self.size)
        found = self._framed(on_values, found) if self.frames.several else found
        return self._cut(edges, on_values, found) if len(self.cuts) else found

    def _cut(self, edges: Edges, on_values: EdgeFunctionals, found: EdgeFunctionals) -> EdgeFunctionals:
        """The same with three more columns an edge for every cut between its ends."""
        columns, values = self.cuts.on_edges(edges, on_values.values[:, :, 3:6], self.vertices)
        values = values * self.units[columns][:, None]
        return EdgeFunctionals(
            np.hstack([found.columns, columns]), np.concatenate([found.values, values], axis=2), self.size
        )

    def _framed(self, on_values: EdgeFunctionals, found: EdgeFunctionals) -> EdgeFunctionals:
        """The same with six more columns an edge, of the centres of its ends, which count on edges across parts."""
        frames, values, ends = self.frames, found.values, on_values.columns[:, [0, 3]] // 3
        across = frames.across(ends)
        more: FloatArray = np.zeros((*values.shape[:2], 6))
        for end in (0, 1):
            own = slice(3 * end, 3 * end + 3)
            values[:, :, own] *= ~frames.is_centre[ends[:, end], None, None]
            more[across, :, own] = on_values.values[across, :, own] @ frames.affine(ends[across, end])
        columns = np.hstack([found.columns, frames.columns(ends[:, 0]), frames.columns(ends[:, 1])])
        return EdgeFunctionals(columns, np.concatenate([values, more], axis=2), self.size)

    @property
    def traction_degree(self) -> int:
        """Degree of σ_N and σ_T on an edge (without φ)."""
        return self.degree - 2

    @cached_property
    def smallest(self) -> float:
        """The shortest edge, dimensionless."""
        return float(self.sizes.min())

    @property
    def centres(self) -> IntArray:
        """Vertices with affine functions from which degrees of freedom count, if there are several of them."""
        return self.frames.centres if self.frames.several else self.frames.centres[:0]

    @cached_property
    def cell_sizes(self) -> FloatArray:
        """Areas of the triangles, dimensionless; without what arcs add to them, see `cell_measures`."""
        return self.triangles.areas

    @property
    def cell_points(self) -> FloatArray:
        """Barycentric coordinates of quadrature points, shape (g, 3)."""
        return self.cell_quadrature[0]

    @property
    def cell_weights(self) -> FloatArray:
        """Their weights, of sum 1."""
        return self.cell_quadrature[1]

    @cached_property
    def cell_quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Points and weights for energies; arcs, which are no polynomials, take more of them."""
        return split_points(2 * self.degree + _ARCS) if len(self.curved) else potential_points(self.degree)

    @cached_property
    def contact_rule(self) -> ContactRule:
        """As many rows as σ_N and σ_T have coefficients on an edge, so that rows are independent."""
        if self.rows == "gauss":
            return ContactRule.gauss(self.degree - 1)
        points, weights = gauss_legendre(self.degree - 1)
        count = len(points)
        values = legendre.basis(count - 1, points) @ np.linalg.inv(legendre.to_bernstein(count - 1))
        places, shares = np.linspace(0.0, 1.0, count), np.full(count, 1.0 / count)
        return ContactRule("bernstein", points, weights, places, shares, values)

    def normal_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_N without φ at the points t (q,) along each of n edges, edge by edge, shape (n q, N)."""
        return self.normal(edges).mapped(legendre.basis(self.traction_degree, t)).matrix()

    def shear_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_T, along the tangent of each edge, at the same points, shape (n q, N)."""
        return self.shear(edges).mapped(legendre.basis(self.traction_degree, t)).matrix()

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u (N,) at the same points, (n q,) each."""
        values = legendre.basis(self.traction_degree, t)
        normal, shear = (found.apply(u) @ values.T for found in (self.normal(edges), self.shear(edges)))
        return normal.ravel(), shear.ravel()

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T over the same points, a vector over all u (N,): `tractions` transposed."""
        load = np.zeros(self.size)
        for weights, functionals in ((normal, self.normal), (shear, self.shear)):
            if weights.any():
                load += functionals(edges).adjoint(weights.reshape(len(edges), -1) @ legendre.basis(self.degree - 2, t))
        return load

    def trace_parameters(self, edges: Sequence[Edges]) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows of contacts from independent parameters of their traces, see `solvers.Traces`: Y (r, N) and E (2m, r).

        Contacts come one after the other, m rows of N in all, then as many of T: [N; T] = E Y with the rows of
        `contact_rule`. Y are the tractions at the Gauss points, E is V⁻¹ on each edge.
        """
        rule = self.contact_rule
        values = legendre.basis(self.traction_degree, rule.points)
        parts = [kind(part).mapped(values).rows() for kind in (self.normal, self.shear) for part in edges]
        Y = stacked(parts, self.size)
        if rule.to_points is None:
            return Y, sparse.csr_array(sparse.eye_array(Y.shape[0]))
        return Y, _block_diagonal(np.asarray(np.linalg.inv(rule.to_points), dtype=np.float64), Y.shape[0] // rule.count)

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates (k, q, 2) of reference points t, (q, 3) or (k, q, 3), in the triangles (k,)."""
        return np.asarray(self.mesh.placed(cells, t) @ self.triangles.corners[cells])

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ at such points, (k, q, 3); `coefficients` are those of `TriangleEnergy`."""
        hessians = self._reference_sums(2, coefficients[cells], cells, t)
        return np.asarray(hessians @ self.triangles.stress_maps[cells].swapaxes(1, 2))

    def cell_rule(self, degree: int) -> tuple[FloatArray, FloatArray]:
        """Reference points (g, 3) and weights (g,) of sum 1, exact up to a degree on every part where Φ is smooth."""
        return split_points(degree)

    def jumps(self, u: FloatArray) -> FloatArray:
        """By how much Φ of u (N,) and its slopes jump where each of the `cuts` begins, shape (k, 3).

        The jumps of the slopes are the resultant force on the hole, turned.
        """
        start = self.cuts.start
        return np.asarray((self.units * u)[start:].reshape(-1, 3))

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q), dimensionless areas, at reference points t (q, 3) with weights (q,) of sum 1."""
        found = np.asarray(self.cell_sizes[:, None] * weights)
        curved = self.curved
        if len(curved):
            found[curved.numbers] = curved.areas(t) * weights
        return found

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at such points, shape (k, q); where it jumps, one of its values."""
        chosen, corners = coefficients[cells], self.triangles.corners[cells]
        placed = self.mesh.placed(cells, t)
        affine = chosen[:, :1] + ((placed @ corners - corners[:, :1]) @ chosen[:, 1:3, None])[:, :, 0]
        return np.asarray(affine + self._reference_sums(0, chosen, cells, t)[:, :, 0])

    def _reference_sums(self, order: int, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ but for its affine part, or its Hessian, on the reference triangle; (k, q, components).

        Points that all triangles share are the same points of all but those with arcs.
        """
        functions, mesh = self.element.reference_functions, self.mesh
        if t.ndim == 3:
            return _applied(functions(mesh.placed(cells, t), order)[..., 3:], coefficients[:, 3:])
        found = _applied(functions(t, order)[..., 3:], coefficients[:, 3:])
        bent = np.flatnonzero(mesh.curved[cells])
        if len(bent):
            table = functions(mesh.placed(cells[bent], t), order)[..., 3:]
            found[bent] = _applied(table, coefficients[bent, 3:])
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


def frame(edges: Edges) -> tuple[FloatArray, FloatArray]:
    """The normal m = (−t_y, t_x) left of the tangents of edges (n, 2), and −n·m (n,), the factor of Φ_tm in σ_T."""
    m = np.column_stack([-edges.tangent[:, 1], edges.tangent[:, 0]])
    return m, -np.sign((edges.normal * m).sum(axis=1))


def _block_diagonal(block: FloatArray, count: int) -> sparse.csr_array:
    """The same block (q, q) so many times."""
    q = len(block)
    columns = np.repeat(np.arange(count * q).reshape(count, q), q, axis=0)
    data = np.tile(block, (count, 1)).ravel()
    return sparse.csr_array((data, columns.ravel(), q * np.arange(count * q + 1)), shape=(count * q, count * q))


def _applied(table: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Functions (q, c, m), or (k, q, c, m), times coefficients (k, m); shape (k, q, c)."""
    if table.ndim == 3:
        q, c, m = table.shape
        return np.asarray(coefficients @ table.reshape(q * c, m).T).reshape(len(coefficients), q, c)
    return np.asarray((table @ coefficients[:, None, :, None])[..., 0])
