"""The edges of triangles: who shares them, the lines they make up, how they bend, and what lives on them.

Curved edges are known by their chords and their bends, the angle θ from the chord to the tangent, counterclockwise.
Along shares t of the length θ is a polynomial, θ(t) = Σ c_k P_k(2t − 1) with Legendre's P_k. With the chord as unit of
length, and along the x-axis,

    x(t) = ℓ ∫₀ᵗ (cos θ, sin θ) dt,   ℓ ∫₀¹ cos θ dt = 1,   ∫₀¹ sin θ dt = 0

and ℓ is the length. On a straight edge c = 0; of an arc of a circle that turns by α it is c₁ = α/2 alone.

Triangles with sides that are curved: seen from the barycentre c, the third of the triangle at side s reaches up to the
arc γ instead of the chord,

    x = c + r (γ(τ) − c),   0 ≤ r ≤ 1,   0 ≤ τ ≤ 1

in the place of c + r (a + τ (b − a) − c). The other thirds, and sides that are straight, stay what they are.
Polynomials are those of the straight triangle, continued. So every point has two triples of coordinates: *reference*
coordinates t, those of the straight triangle's point with the same r and τ, and the *barycentric* coordinates λ of x,
of which one is negative beyond the chord.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Final, Self

import numpy as np
from numpy.polynomial.legendre import legval

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.element.edge import gauss_legendre, legendre_from_values
from qvi_contact.element.triangle import EDGES


@dataclass(frozen=True, eq=False)
class Topology:
    """Edges of triangles: who shares them."""

    ends: IntArray
    """Vertices of each edge, the lower number first; edges in the order of these pairs, shape (e, 2)."""
    of_cells: IntArray
    """Edges of each triangle, edge s opposite to its corner s, shape (m, 3)."""
    cells: IntArray
    """The triangles at each edge, in ascending order; −1 for the second on the boundary, shape (e, 2)."""
    count: IntArray
    """How many triangles share the edge: 1 on the boundary, 2 inside, more in what is no mesh, shape (e,)."""
    keys: IntArray
    """ends[0] · base + ends[1], in ascending order, shape (e,)."""
    base: int
    """The number of vertices."""

    @classmethod
    def of(cls, cells: IntArray, vertices: int) -> "Topology":
        """Edges of triangles (m, 3), whose corners are in ascending order, among so many vertices."""
        pairs = cells[:, EDGES].reshape(-1, 2)
        of_pairs = pairs[:, 0] * vertices + pairs[:, 1]
        keys, first, index, count = np.unique(of_pairs, return_index=True, return_inverse=True, return_counts=True)
        last = np.empty_like(first)
        last[index] = np.arange(len(pairs))
        beside = np.column_stack([first // 3, np.where(count > 1, last // 3, -1)])
        return cls(pairs[first], index.reshape(-1, 3), beside, count, keys, vertices)

    @cached_property
    def boundary(self) -> BoolArray:
        """Which edges belong to one triangle only, shape (e,)."""
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
        """The edges between pairs of vertices (k, 2), in any order; −1 where there is none."""
        wanted = np.sort(pairs, axis=1)
        keys = wanted[:, 0] * self.base + wanted[:, 1]
        at = np.minimum(self.keys.searchsorted(keys), len(self.keys) - 1)
        return np.where((self.ends.take(at, axis=0) == wanted).all(axis=1), at, -1)


def chains(ends: IntArray) -> list[IntArray]:
    """Edges ordered along the lines they make up, each line as indices into `ends` (k, 2), their vertices.

    A line starts at a vertex of one edge only if it has such a vertex, that of lowest number, else at the lowest of
    all; where more than two edges meet lines end.
    """
    at: dict[int, list[int]] = {}
    for edge, pair in enumerate(ends.tolist()):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    used = np.zeros(len(ends), dtype=bool)
    found: list[IntArray] = []
    starts = sorted(vertex for vertex, edges in at.items() if len(edges) != 2) + sorted(at)
    for start in starts:
        for first in at[start]:
            line: list[int] = []
            vertex, edge = start, first
            while not used[edge]:
                used[edge] = True
                line.append(edge)
                low, high = ends[edge].tolist()
                vertex = high if vertex == low else low
                if len(at[vertex]) != 2:
                    break
                edge = next((e for e in at[vertex] if e != edge), edge)
            if line:
                found.append(np.array(line))
    return found


# how edges bend

_HALVINGS: Final = 60
_MORE: Final = 6  # Gauss points beside the coefficients: digits of ∫ cos θ where θ changes by 90°


def angles(bend: FloatArray, t: FloatArray) -> FloatArray:
    """θ of edges with bends (n, k) at shares t, (q,) or (n, q), of their lengths; shape (n, q)."""
    return polynomials(bend, 2.0 * np.broadcast_to(t, (len(bend), np.shape(t)[-1])) - 1.0)


def stretches(bend: FloatArray) -> FloatArray:
    """Lengths ℓ of edges with bends (n, k) over those of their chords; 1 of straight ones."""
    x, _ = _from_first(bend, np.ones((len(bend), 1)))
    return np.asarray(1.0 / x[:, 0])


def arc_offsets(chords: FloatArray, bend: FloatArray, t: FloatArray) -> FloatArray:
    """From the first ends of edges with chords (n, 2), bends (n, k) to points (n, q, 2) at shares t, (q,) or (n, q)."""
    count = len(chords)
    shares = np.concatenate([np.broadcast_to(t, (count, np.shape(t)[-1])), np.ones((count, 1))], axis=1)
    along, across = _from_first(bend, shares)
    across_chords = np.column_stack([-chords[:, 1], chords[:, 0]])
    found = along[:, :-1, None] * chords[:, None] + across[:, :-1, None] * across_chords[:, None]
    return np.asarray(found / along[:, -1:, None])  # at the end of an edge its chord over its length


def shares_along(chords: FloatArray, bend: FloatArray, offsets: FloatArray) -> FloatArray:
    """Shares (n,) of the lengths of edges as far along their chords (n, 2) as points at offsets (n, 2) from first ends.

    On arcs, which turn by less than 180° and so go on along their chords, from 0 to 1.
    """
    wanted = (offsets * chords).sum(axis=1)
    found, arc = wanted / np.square(chords).sum(axis=1), np.flatnonzero(bend.any(axis=1))
    low, high = np.zeros(len(arc)), np.ones(len(arc))
    for _ in range(_HALVINGS if len(arc) else 0):
        middle = (low + high) / 2.0
        there = arc_offsets(chords[arc], bend[arc], middle[:, None])[:, 0]
        ahead = (there * chords[arc]).sum(axis=1) > wanted[arc]
        low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
    found[arc] = (low + high) / 2.0
    return np.asarray(found)


def levelled(bend: FloatArray) -> FloatArray:
    """The bends of the same curves, turned so that ∫ sin θ = 0: θ counts from the chord."""
    x, y = _from_first(bend, np.ones((len(bend), 1)))
    found = bend.copy()
    found[:, 0] -= np.arctan2(y, x)[:, 0]
    return found


def reversed_bends(bend: FloatArray) -> FloatArray:
    """The bends of the same edges taken from their second ends to the first ones."""
    return np.asarray(bend * (-1.0) ** np.arange(bend.shape[1]))


def part_of(bend: FloatArray, start: FloatArray, stop: FloatArray) -> FloatArray:
    """The bends (n, k) of parts of edges, from shares (n,) to shares (n,) of their lengths; of no higher degree."""
    count = bend.shape[1]
    at = start[:, None] + (stop - start)[:, None] * gauss_legendre(count)[0]
    found = angles(bend, at) @ legendre_from_values(count - 1, count).T
    return levelled(np.where(np.logical_or.accumulate(bend[:, ::-1] != 0.0, axis=1)[:, ::-1], found, 0.0))


def polynomials(terms: FloatArray, x: FloatArray) -> FloatArray:
    """Polynomials by coefficients of Legendre (n, k) at x (n, q), −1 to 1."""
    return np.asarray(legval(x, terms.T[:, :, None], tensor=False))


def turned(vectors: FloatArray, angle: FloatArray) -> FloatArray:
    """Vectors (..., 2) turned counterclockwise by angles (...) [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def cross(u: FloatArray, v: FloatArray) -> FloatArray:
    """u_x v_y − u_y v_x of vectors (..., 2)."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def _from_first(bend: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """∫₀ᵗ cos θ and ∫₀ᵗ sin θ at t (n, q), (n, q) each; t and 0 of straight edges, to the last digit."""
    along, across = np.array(t), np.zeros(t.shape)
    bent = np.flatnonzero(bend.any(axis=1))
    if not len(bent):
        return along, across
    nodes, weights = gauss_legendre(bend.shape[1] + _MORE)
    at = t[bent]
    between = at[:, :, None] * nodes
    angle = angles(bend[bent], between.reshape(len(bent), at.shape[1] * len(nodes))).reshape(between.shape)
    along[bent] = at * (np.cos(angle) @ weights)
    across[bent] = at * (np.sin(angle) @ weights)
    return along, across


# triangles whose sides bend

_STEPS: Final = 8  # of Newton's method for τ; it doubles the digits each time


def beyond_chords(corners: FloatArray, bends: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where reference points t, (q, 3) or (n, q, 3), of triangles (n, 3, 2) lie, whose sides bend so (n, 3, k).

    Their barycentric coordinates λ (n, q, 3), and how many times as large areas are there as on the straight triangles,
    (n, q).
    """
    t = np.broadcast_to(t, (len(corners), *np.shape(t)[-2:]))
    found, factors, part = np.array(t), np.ones(t.shape[:2]), np.argmin(t, axis=-1)
    for s, (a, b) in enumerate(EDGES):
        cell, point = np.nonzero((part == s) & bends[:, [s]].any(axis=2))
        at, bend, first = t[cell, point], bends[cell, s], corners[cell, a]
        chord, arm, r = corners[cell, b] - first, first - corners[cell].mean(axis=1), 1.0 - 3.0 * at[:, s]
        tau = _tau(at, s, r)[:, None]
        offset, slope = arc_offsets(chord, bend, tau)[:, 0], _slope(chord, bend, tau)
        u, v, along = corners[cell, 1] - corners[cell, 0], corners[cell, 2] - corners[cell, 0], offset - tau * chord
        second, third = r * cross(along, v) / cross(u, v), r * cross(u, along) / cross(u, v)
        found[cell, point] += np.column_stack([-second - third, second, third])
        factors[cell, point] = cross(arm + offset, slope) / cross(arm, chord)
    return found, factors


def reference_of(corners: FloatArray, bends: FloatArray, barycentric: FloatArray) -> FloatArray:
    """Reference coordinates (n, 3) of points with barycentric coordinates λ (n, 3) in triangles (n, …), one in each."""
    found, part = np.array(barycentric), np.argmin(barycentric, axis=-1)
    for s, (a, b) in enumerate(EDGES):
        cell = np.flatnonzero((part == s) & bends[:, s].any(axis=1))
        own, bend, at = corners[cell], bends[cell, s], barycentric[cell]
        first, chord = own[:, a] - own.mean(axis=1), own[:, b] - own[:, a]
        away = np.einsum("nk,nkx->nx", at - 1.0 / 3.0, own)
        outer = at[:, a] + at[:, b] - 2.0 * at[:, s]  # r on the straight triangle
        tau = np.clip(_tau(at, s, outer), 0.0, 1.0)
        for _ in range(_STEPS):
            arm = first + arc_offsets(chord, bend, tau[:, None])[:, 0]
            across, rate = cross(arm, away), cross(_slope(chord, bend, tau[:, None]), away)
            tau = np.clip(tau - np.where(rate != 0.0, across / np.where(rate != 0.0, rate, 1.0), 0.0), -0.5, 1.5)
        arm = first + arc_offsets(chord, bend, tau[:, None])[:, 0]
        r = (arm * away).sum(axis=1) / np.square(arm).sum(axis=1)
        found[cell, s] = (1.0 - r) / 3.0
        found[cell, a] = r * (1.0 - tau) + (1.0 - r) / 3.0
        found[cell, b] = r * tau + (1.0 - r) / 3.0
    return found


def _tau(t: FloatArray, s: int, r: FloatArray) -> FloatArray:
    """The τ of points t (n, 3) of the straight triangle in the third at side s, from their r; any at the barycentre."""
    along = t[:, EDGES[s][1]] - t[:, s]
    return np.where(r > 0.0, along / np.where(r > 0.0, r, 1.0), 0.5)


def _slope(chord: FloatArray, bend: FloatArray, t: FloatArray) -> FloatArray:
    """Derivatives (n, 2) by t (n, 1) of points on arcs."""
    return turned(chord * stretches(bend)[:, None], angles(bend, t)[:, 0])


# edges with their normals and cells

TURNED: Final = np.array([-1.0, 1.0])  # factors of (t_y, t_x) that turn a vector by 90°
_UPRIGHT: Final = 1e-5  # x over the length of a vector that is vertical but for rounding of data


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of cells as arrays with one entry an edge; σ_N = n·σn and σ_T = t·σn are taken with n and t of the edge.

    Of an arc n and t are those of the chord, and turn along it. Reference coordinates, 0 to 1, are shares of length.
    """

    first: IntArray
    second: IntArray
    """Vertices at the two ends, in the direction of the tangent, shape (n,) each."""
    cells: IntArray
    """The cell that the normal points out of, inside the body the lower or left one, and the one beyond; −1 where there
    is none, shape (n, 2)."""
    normal: FloatArray
    """Unit normal n, outward on the boundary, inside the body from the first cell to the other, shape (n, 2)."""
    tangent: FloatArray
    """Unit tangent t, (n, 2): t_x > 0, or t_y > 0 where |t_x| ≤ 1e-5, whichever way it faces, but see `led_around`."""
    length: FloatArray
    """Lengths, of arcs along them [length], shape (n,)."""
    bend: FloatArray
    """How they bend along the tangent, see `mesh.edges`; 0 on straight edges. Shape (n, k) [rad]."""
    number: IntArray
    """Their numbers in the mesh's `topology`, shape (n,)."""

    def __len__(self) -> int:
        return len(self.first)

    def take(self, index: IntArray | BoolArray) -> Self:
        """The edges selected by an index or mask array."""
        if index.dtype == bool:
            index = index.nonzero()[0]
        return type(self)(*[part.take(index, axis=0) for part in _parts(self)])

    @cached_property
    def curved(self) -> bool:
        """Whether any of them is an arc."""
        return bool(np.count_nonzero(self.bend))

    @property
    def bent(self) -> BoolArray:
        """Which of them are arcs, shape (n,)."""
        return np.asarray(self.bend.any(axis=1))


_parts: Final = attrgetter(*Edges.__match_args__)


def edges_of(vertices: FloatArray, cells: IntArray, topology: Topology, bends: FloatArray, numbers: IntArray) -> Edges:
    """Edges of a topology by number (k,), which bend so (e, n), with the normals, tangents and cells of `Edges`."""
    first, second = topology.ends[numbers].T
    start = vertices.take(first, axis=0)
    along = vertices.take(second, axis=0) - start
    length = np.hypot(*along.T)
    tangent = along / length[:, None]
    normal, beside = tangent[:, ::-1] * TURNED, topology.cells[numbers]
    centre = vertices.take(cells.take(beside[:, 0], axis=0), axis=0).sum(axis=1) / 3.0
    inward = ((centre - start) * normal).sum(axis=1) > 0.0
    normal = np.where(inward[:, None], -normal, normal)  # out of the first triangle
    swapped = (beside[:, 1] >= 0) & points_back(normal[:, ::-1])
    normal = np.where(swapped[:, None], -normal, normal)
    beside = np.where(swapped[:, None], beside[:, ::-1], beside)
    bend = bends[numbers]
    if np.count_nonzero(bend):
        length = length * stretches(bend)
    return _led_back(Edges(first, second, beside, normal, tangent, length, bend, numbers), points_back(tangent))


def closes(edges: Edges) -> bool:
    """Whether they make up closed lines."""
    return bool((np.unique([edges.first, edges.second], return_counts=True)[1] == 2).all())


def led_around(edges: Edges) -> Edges:
    """Edges of a joint; if it closes with t clockwise from n, down where |t_x| ≤ 1e-5: one way around its block."""
    return _led_back(edges, closes(edges) & (cross(edges.normal, edges.tangent) > 0.0))


def _led_back(edges: Edges, back: BoolArray) -> Edges:
    """Edges, of which some lead the other way."""
    first, second = np.where(back, edges.second, edges.first), np.where(back, edges.first, edges.second)
    tangent = np.where(back[:, None], -edges.tangent, edges.tangent)
    bend = np.where(back[:, None], reversed_bends(edges.bend), edges.bend) if edges.curved else edges.bend
    return replace(edges, first=first, second=second, tangent=tangent, bend=bend)


def points_back(vectors: FloatArray) -> BoolArray:
    """Whether vectors (n, 2) point to the left, or straight down."""
    upright = np.abs(vectors[:, 0]) <= _UPRIGHT
    return np.asarray(np.where(upright, vectors[:, 1], vectors[:, 0]) < 0.0)


def points_along(vertices: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
    """Points at the reference coordinates t, 0 to 1 along the tangent, (q,) or (n, q), of n edges; shape (n, q, 2)."""
    first, second = vertices.take(edges.first, axis=0), vertices.take(edges.second, axis=0)
    if not edges.curved:
        return np.asarray(first[:, None, :] + (second - first)[:, None, :] * np.asarray(t)[..., None])
    return np.asarray(first[:, None, :] + arc_offsets(second - first, edges.bend, t))


def centre_of(vertices: FloatArray, edges: Edges) -> tuple[float, float]:
    """Centre of the line that edges make up, by their middles [length]."""
    middles = points_along(vertices, edges, np.array([0.5]))[:, 0]
    x, y = ((middles * edges.length[:, None]).sum(axis=0) / edges.length.sum()).tolist()
    return x, y


def frames_along(edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normals and tangents at the reference coordinates t, (q,) or (n, q), of n edges; shape (n, q, 2) each."""
    return vectors_along(edges, edges.normal, t), vectors_along(edges, edges.tangent, t)


def vectors_along(edges: Edges, vectors: FloatArray, t: FloatArray, *, turns: bool | BoolArray = True) -> FloatArray:
    """Vectors (n, 2), given for chords, at t as above, (n, q, 2); whether they turn along says one truth, or (n,)."""
    given = vectors[:, None].repeat(np.shape(t)[-1], axis=1)
    if not edges.curved or not np.any(turns):
        return given
    return turned(given, np.reshape(turns, (-1, 1)) * angles(edges.bend, t))


def rounding_along(vertices: FloatArray, edges: Edges) -> FloatArray:
    """What rounding of the coordinates does to a reference coordinate t, shape (n,): large far from the origin."""
    largest = np.abs(vertices[np.stack([edges.first, edges.second])]).max(axis=(0, 2), initial=0.0)
    return np.asarray(np.finfo(float).eps * largest / edges.length)


def edge_ends(edges: Edges) -> IntArray:
    """The vertices of edges, each once."""
    return np.unique(np.concatenate([edges.first, edges.second]))
