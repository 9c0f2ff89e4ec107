"""The edges of triangles: their topology, the lines they form, curved edges, normals and tangents.

A curved edge is given by its chord and its bend. The bend is the angle θ from the chord to the tangent,
counterclockwise, as a polynomial of the fraction t of the edge's length: θ(t) = Σ c_k P_k(2t − 1) with Legendre's P_k.
With the chord as the unit of length and as the x-axis, the edge is

    x(t) = ℓ ∫₀ᵗ (cos θ, sin θ) dt,   ℓ ∫₀¹ cos θ dt = 1,   ∫₀¹ sin θ dt = 0

and ℓ is its length. A straight edge has c = 0; a circular arc that turns by α has c₁ = α/2 and no other coefficient.

A triangle with curved sides is mapped from the straight triangle in thirds. The third between side s, from corner a to
corner b, and the barycentre c reaches to the arc γ instead of the chord,

    x = c + r (γ(τ) − c),   0 ≤ r ≤ 1,   0 ≤ τ ≤ 1

in place of c + r (a + τ (b − a) − c). Thirds at straight sides are not changed. Polynomials of the straight triangle
are continued beyond its chord. So every point x has two triples of coordinates: the *reference* coordinates t of the
point of the straight triangle with the same r and τ, and its *barycentric* coordinates λ, of which one is negative
beyond the chord.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Final, Self

import numpy as np
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import EDGES


@dataclass(frozen=True, eq=False)
class Topology:
    """The edges of triangles and the triangles that share each edge."""

    ends: IntArray
    """Vertices of each edge, the lower number first, shape (e, 2); edges are sorted by these pairs."""
    of_cells: IntArray
    """Edges of each triangle, edge s opposite to its corner s, shape (m, 3)."""
    cells: IntArray
    """The triangles at each edge, in ascending order; −1 for the second on the boundary, shape (e, 2)."""
    count: IntArray
    """Number of triangles that share each edge, shape (e,): 1 on the boundary, 2 inside; more is a flaw."""
    keys: IntArray
    """ends[0] · base + ends[1], in ascending order, shape (e,)."""
    base: int
    """The number of vertices."""

    @classmethod
    def of(cls, cells: IntArray, vertices: int) -> "Topology":
        """Edges of the triangles `cells` (m, 3), with corners in ascending order; `vertices` is their number."""
        pairs = cells[:, EDGES].reshape(-1, 2)
        pair_keys = pairs[:, 0] * vertices + pairs[:, 1]
        keys, first, edge, count = np.unique(pair_keys, return_index=True, return_inverse=True, return_counts=True)
        last = np.empty_like(first)
        last[edge] = np.arange(len(pairs))
        neighbours = np.column_stack([first // 3, np.where(count > 1, last // 3, -1)])
        return cls(pairs[first], edge.reshape(-1, 3), neighbours, count, keys, vertices)

    @cached_property
    def boundary(self) -> BoolArray:
        """Mask of the edges of one triangle only, shape (e,)."""
        return np.asarray(self.count == 1)

    @cached_property
    def outer(self) -> IntArray:
        """Numbers of the edges of the boundary, in ascending order."""
        return self.boundary.nonzero()[0]

    @cached_property
    def inner(self) -> IntArray:
        """Numbers of the other edges, in ascending order."""
        return np.flatnonzero(~self.boundary)

    def number(self, pairs: IntArray) -> IntArray:
        """Numbers (k,) of the edges between pairs of vertices (k, 2), in any order; −1 for a pair without an edge."""
        sorted_pairs = np.sort(pairs, axis=1)
        keys = sorted_pairs[:, 0] * self.base + sorted_pairs[:, 1]
        position = np.minimum(self.keys.searchsorted(keys), len(self.keys) - 1)
        return np.where((self.ends.take(position, axis=0) == sorted_pairs).all(axis=1), position, -1)


def chains(ends: IntArray) -> list[IntArray]:
    """The lines that edges with vertices `ends` (k, 2) form, each as indices into `ends` in the order along the line.

    An open line starts at its end vertex of lower number, a closed line at its vertex of lowest number. Lines end at
    vertices where more than two edges meet.
    """
    edges_at: dict[int, list[int]] = {}
    for edge, pair in enumerate(ends.tolist()):
        for vertex in pair:
            edges_at.setdefault(vertex, []).append(edge)
    is_used = np.zeros(len(ends), dtype=bool)
    lines: list[IntArray] = []
    starts = sorted(vertex for vertex, edges in edges_at.items() if len(edges) != 2) + sorted(edges_at)
    for start in starts:
        for first in edges_at[start]:
            line: list[int] = []
            vertex, edge = start, first
            while not is_used[edge]:
                is_used[edge] = True
                line.append(edge)
                low, high = ends[edge].tolist()
                vertex = high if vertex == low else low
                if len(edges_at[vertex]) != 2:
                    break
                edge = next((e for e in edges_at[vertex] if e != edge), edge)
            if line:
                lines.append(np.array(line))
    return lines


# curved edges

_BISECTIONS: Final = 60  # of the interval [0, 1]: more than the 53 bits of a double
_EXTRA_POINTS: Final = 6  # Gauss points in addition to the number of coefficients; ∫ cos θ is exact to rounding then


def angles(bend: FloatArray, t: FloatArray) -> FloatArray:
    """Angles θ (n, q) [rad] of edges with bends (n, k) at fractions t, (q,) or (n, q), of their lengths."""
    return np.asarray(legval(2.0 * t - 1.0, bend.T[:, :, None], tensor=False))


def stretches(bend: FloatArray) -> FloatArray:
    """Ratios ℓ (n,) of the lengths of edges with bends (n, k) to their chords; 1 for straight edges."""
    return np.asarray(1.0 / _integrals(bend, np.ones((len(bend), 1))).real[:, 0])


def arc_offsets(chords: FloatArray, bend: FloatArray, t: FloatArray) -> FloatArray:
    """Vectors (n, q, 2) from first ends of edges with chords (n, 2), bends (n, k) to points at t, (q,) or (n, q)."""
    n_edges = len(chords)
    shares = np.concatenate([np.broadcast_to(t, (n_edges, np.shape(t)[-1])), np.ones((n_edges, 1))], axis=1)
    along = _integrals(bend, shares)
    offsets = along[:, :-1] * (chords @ [1.0, 1.0j])[:, None] / along[:, -1:].real  # the last real part is 1/ℓ
    return np.stack([offsets.real, offsets.imag], axis=-1)


def shares_along(chords: FloatArray, bend: FloatArray, offsets: FloatArray) -> FloatArray:
    """Fractions t (n,) at which edges project on their chords (n, 2) as points at `offsets` (n, 2) from first ends do.

    On arcs, which turn by less than 180°, the projection increases with t: bisection finds t in [0, 1].
    """
    projection = (offsets * chords).sum(axis=1)
    shares, arcs = projection / np.square(chords).sum(axis=1), np.flatnonzero(bend.any(axis=1))
    low, high = np.zeros(len(arcs)), np.ones(len(arcs))
    for _ in range(_BISECTIONS if len(arcs) else 0):
        middle = (low + high) / 2.0
        offset = arc_offsets(chords[arcs], bend[arcs], middle[:, None])[:, 0]
        is_beyond = (offset * chords[arcs]).sum(axis=1) > projection[arcs]
        low, high = np.where(is_beyond, low, middle), np.where(is_beyond, middle, high)
    shares[arcs] = (low + high) / 2.0
    return np.asarray(shares)


def levelled(bend: FloatArray) -> FloatArray:
    """The bends of the same curves with θ measured from the chord, so that ∫ sin θ = 0."""
    turned_bend = bend.copy()
    turned_bend[:, 0] -= np.angle(_integrals(bend, np.ones((len(bend), 1))))[:, 0]
    return turned_bend


def reversed_bends(bend: FloatArray) -> FloatArray:
    """The bends of the same edges, run through from their second ends to their first ends."""
    return np.asarray(bend * (-1.0) ** np.arange(bend.shape[1]))


def part_of(bend: FloatArray, start: FloatArray, stop: FloatArray) -> FloatArray:
    """The bends (n, k) of parts of edges from `start` to `stop` (n,), fractions of length; the degree stays."""
    n_coefficients = bend.shape[1]
    points = start[:, None] + (stop - start)[:, None] * gauss_legendre(n_coefficients)[0]
    part = angles(bend, points) @ legendre_from_values(n_coefficients - 1, n_coefficients).T
    return levelled(np.where(np.logical_or.accumulate(bend[:, ::-1] != 0.0, axis=1)[:, ::-1], part, 0.0))


def turned(vectors: FloatArray, angle: FloatArray) -> FloatArray:
    """Vectors (..., 2) turned counterclockwise by angles (...) [rad]."""
    turned_vectors = (vectors @ [1.0, 1.0j]) * np.exp(1j * angle)
    return np.stack([turned_vectors.real, turned_vectors.imag], axis=-1)


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """u_x v_y − u_y v_x of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _integrals(bend: FloatArray, t: FloatArray) -> NDArray[np.complex128]:
    """∫₀ᵗ exp(iθ) at t (n, q), (n, q); on straight edges exactly t."""
    integrals, bent = t.astype(np.complex128), np.flatnonzero(bend.any(axis=1))
    if len(bent):
        nodes, weights = gauss_legendre(bend.shape[1] + _EXTRA_POINTS)
        points = t[bent][:, :, None] * nodes
        angle = angles(bend[bent], points.reshape(len(bent), -1)).reshape(points.shape)
        integrals[bent] = t[bent] * (np.exp(1j * angle) @ weights)
    return integrals


# triangles with curved sides

_NEWTON_STEPS: Final = 8  # for τ; each step doubles the number of correct digits


def beyond_chords(corners: FloatArray, bends: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Barycentric coordinates λ (n, q, 3) of reference points t, (q, 3) or (n, q, 3), and ratios of area (n, q).

    The triangles have corners (n, 3, 2) and sides with bends (n, 3, k). The ratio is the Jacobian determinant of the
    map from the straight triangle to the triangle with arcs.
    """
    t = np.broadcast_to(t, (len(corners), *np.shape(t)[-2:]))
    barycentric, area_factors, third = np.array(t), np.ones(t.shape[:2]), np.argmin(t, axis=-1)
    for s, (a, b) in enumerate(EDGES):
        cell, point = np.nonzero((third == s) & bends[:, [s]].any(axis=2))
        local, bend, first = t[cell, point], bends[cell, s], corners[cell, a]
        chord, arm, r = corners[cell, b] - first, first - corners[cell].mean(axis=1), 1.0 - 3.0 * local[:, s]
        tau = _tau_of(local, s, r)[:, None]
        on_arc, slope = arc_offsets(chord, bend, tau)[:, 0], _slope(chord, bend, tau)
        u, v, beyond = corners[cell, 1] - corners[cell, 0], corners[cell, 2] - corners[cell, 0], on_arc - tau * chord
        shift_1, shift_2 = r * cross(beyond, v) / cross(u, v), r * cross(u, beyond) / cross(u, v)
        barycentric[cell, point] += np.column_stack([-shift_1 - shift_2, shift_1, shift_2])
        area_factors[cell, point] = cross(arm + on_arc, slope) / cross(arm, chord)
    return barycentric, area_factors


def reference_of(corners: FloatArray, bends: FloatArray, barycentric: FloatArray) -> FloatArray:
    """Reference coordinates (n, 3) of one point in each triangle, from its barycentric coordinates λ (n, 3)."""
    reference, third = np.array(barycentric), np.argmin(barycentric, axis=-1)
    for s, (a, b) in enumerate(EDGES):
        cell = np.flatnonzero((third == s) & bends[:, s].any(axis=1))
        triangle, bend, local = corners[cell], bends[cell, s], barycentric[cell]
        first, chord = triangle[:, a] - triangle.mean(axis=1), triangle[:, b] - triangle[:, a]
        from_centre = np.einsum("nk,nkx->nx", local - 1.0 / 3.0, triangle)
        start_r = local[:, a] + local[:, b] - 2.0 * local[:, s]
        tau = np.clip(_tau_of(local, s, start_r), 0.0, 1.0)  # of the straight triangle: start of Newton's method
        for _ in range(_NEWTON_STEPS):
            arm = first + arc_offsets(chord, bend, tau[:, None])[:, 0]
            # (γ(τ) − c) × (x − c) = 0, from c to the arc and to the point
            residual, slope = cross(arm, from_centre), cross(_slope(chord, bend, tau[:, None]), from_centre)
            tau = np.clip(tau - np.where(slope != 0.0, residual / np.where(slope != 0.0, slope, 1.0), 0.0), -0.5, 1.5)
        arm = first + arc_offsets(chord, bend, tau[:, None])[:, 0]
        r = (arm * from_centre).sum(axis=1) / np.square(arm).sum(axis=1)
        reference[cell, s] = (1.0 - r) / 3.0
        reference[cell, a] = r * (1.0 - tau) + (1.0 - r) / 3.0
        reference[cell, b] = r * tau + (1.0 - r) / 3.0
    return reference


def _tau_of(t: FloatArray, s: int, r: FloatArray) -> FloatArray:
    """τ (n,) of points t (n, 3) of the straight triangle in the third at side s with r (n,); 1/2 at the barycentre."""
    difference = t[:, EDGES[s][1]] - t[:, s]
    return np.where(r > 0.0, difference / np.where(r > 0.0, r, 1.0), 0.5)


def _slope(chord: FloatArray, bend: FloatArray, t: FloatArray) -> FloatArray:
    """Derivatives (n, 2) of the points of edges with respect to t, at t (n, 1)."""
    return turned(chord * stretches(bend)[:, None], angles(bend, t)[:, 0])


# edges with their normals, tangents and cells

TURNED: Final = np.array([-1.0, 1.0])  # (t_y, t_x) times these factors is t turned by +90°
_VERTICAL: Final = 1e-5  # |t_x| of a unit vector that counts as vertical, as coordinates in files are rounded


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of cells as arrays with one entry per edge; σ_N = n·σn and σ_T = t·σn use n and t of the edge.

    For an arc, n and t are those of the chord; along the arc they turn. The reference coordinate t of a point of an
    edge, 0 to 1, is its fraction of the length.
    """

    first: IntArray
    second: IntArray
    """Vertices at the two ends, in the direction of the tangent, shape (n,) each."""
    cells: IntArray
    """The two cells at each edge, shape (n, 2). The normal points out of the first, inside the body the lower or left
    cell, into the second; −1 beyond the boundary."""
    normal: FloatArray
    """Unit normal n, shape (n, 2): outward on the boundary, inside the body from the first cell to the second."""
    tangent: FloatArray
    """Unit tangent t, shape (n, 2): t_x > 0, or t_y > 0 where |t_x| ≤ 1e-5; on closed joints see `led_around`."""
    length: FloatArray
    """Lengths [length], of arcs the arc lengths, shape (n,)."""
    bend: FloatArray
    """Bends in the direction of the tangent, see `mesh.edges`, shape (n, k) [rad]; 0 on straight edges."""
    number: IntArray
    """Numbers of the edges in the mesh's `topology`, shape (n,)."""

    def __len__(self) -> int:
        return len(self.first)

    def take(self, index: IntArray | BoolArray) -> Self:
        """The edges selected by an index or mask array."""
        if index.dtype == bool:
            index = index.nonzero()[0]
        return type(self)(*[part.take(index, axis=0) for part in _parts(self)])

    @cached_property
    def curved(self) -> bool:
        """Whether any edge is an arc."""
        return bool(np.count_nonzero(self.bend))

    @property
    def bent(self) -> BoolArray:
        """Mask of the edges that are arcs, shape (n,)."""
        return np.asarray(self.bend.any(axis=1))


_parts: Final = attrgetter(*Edges.__match_args__)


def edges_of(vertices: FloatArray, cells: IntArray, topology: Topology, bends: FloatArray, numbers: IntArray) -> Edges:
    """The edges with these numbers (k,), with normals, tangents and cells; `bends` are those of all edges (e, n)."""
    first, second = topology.ends[numbers].T
    start = vertices.take(first, axis=0)
    chord = vertices.take(second, axis=0) - start
    length = np.hypot(*chord.T)
    tangent = chord / length[:, None]
    normal, neighbours = tangent[:, ::-1] * TURNED, topology.cells[numbers]
    centre = vertices.take(cells.take(neighbours[:, 0], axis=0), axis=0).sum(axis=1) / 3.0
    points_inward = ((centre - start) * normal).sum(axis=1) > 0.0
    normal = np.where(points_inward[:, None], -normal, normal)  # out of the triangle of lower number
    is_swapped = (neighbours[:, 1] >= 0) & points_back(normal[:, ::-1])
    normal = np.where(is_swapped[:, None], -normal, normal)
    neighbours = np.where(is_swapped[:, None], neighbours[:, ::-1], neighbours)
    bend = bends[numbers]
    if np.count_nonzero(bend):
        length = length * stretches(bend)
    return _reversed(Edges(first, second, neighbours, normal, tangent, length, bend, numbers), points_back(tangent))


def closes(edges: Edges) -> bool:
    """Whether the edges form closed lines only."""
    return bool((np.unique([edges.first, edges.second], return_counts=True)[1] == 2).all())


def led_around(edges: Edges) -> Edges:
    """Edges of a joint; on a closed joint t is n turned clockwise, so that one slip all around turns the block."""
    return _reversed(edges, closes(edges) & (cross(edges.normal, edges.tangent) > 0.0))


def _reversed(edges: Edges, is_reversed: BoolArray) -> Edges:
    """The edges with the direction of some of them reversed."""
    first, second = np.where(is_reversed, edges.second, edges.first), np.where(is_reversed, edges.first, edges.second)
    tangent = np.where(is_reversed[:, None], -edges.tangent, edges.tangent)
    bend = np.where(is_reversed[:, None], reversed_bends(edges.bend), edges.bend) if edges.curved else edges.bend
    return replace(edges, first=first, second=second, tangent=tangent, bend=bend)


def points_back(vectors: FloatArray) -> BoolArray:
    """Whether vectors (n, 2) point to the left, or down if they are vertical."""
    is_vertical = np.abs(vectors[:, 0]) <= _VERTICAL
    return np.asarray(np.where(is_vertical, vectors[:, 1], vectors[:, 0]) < 0.0)


def points_along(vertices: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Points (n, q, 2) of n edges at reference coordinates t, (q,) or (n, q), 0 to 1 along the tangent."""
    first, second = vertices.take(edges.first, axis=0), vertices.take(edges.second, axis=0)
    if not edges.curved:
        return np.asarray(first[:, None, :] + (second - first)[:, None, :] * np.asarray(t)[..., None])
    return np.asarray(first[:, None, :] + arc_offsets(second - first, edges.bend, t))


def centre_of(vertices: FloatArray, edges: Edges) -> tuple[float, float]:
    """Centroid of the line that edges form, from their midpoints weighted by length [length]."""
    midpoints = points_along(vertices, edges, np.array([0.5]))[:, 0]
    x, y = ((midpoints * edges.length[:, None]).sum(axis=0) / edges.length.sum()).tolist()
    return x, y


def frames_along(edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals and tangents (n, q, 2) of n edges at reference coordinates t, (q,) or (n, q)."""
    return vectors_along(edges, edges.normal, t), vectors_along(edges, edges.tangent, t)


def vectors_along(edges: Edges, vectors: FloatArray, t: FloatArray, *, turns: bool | BoolArray = True) -> FloatArray:
    """Vectors (n, q, 2) at t of edges, from vectors (n, 2) of their chords, which turn along arcs where `turns`."""
    repeated = vectors[:, None].repeat(np.shape(t)[-1], axis=1)
    if not edges.curved or not np.any(turns):
        return repeated
    return turned(repeated, np.reshape(turns, (-1, 1)) * angles(edges.bend, t))


def rounding_along(vertices: FloatArray, edges: Edges) -> FloatArray:
    """Rounding error (n,) of the reference coordinate t, ε max|x|/length: it is large far from the origin."""
    largest_coordinate = np.abs(vertices[np.stack([edges.first, edges.second])]).max(axis=(0, 2), initial=0.0)
    return np.asarray(np.finfo(float).eps * largest_coordinate / edges.length)
