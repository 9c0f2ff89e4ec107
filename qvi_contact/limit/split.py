"""Polynomials on the three parts of triangles, split at their barycentres, in Bernstein coefficients.

Rounding breaks smoothness by some 1e-16. So for proofs a function Φ is built again in rational numbers: it is C1 if
linear equations between its ordinates hold, and so are tractions and velocities. No ordinate depends on others far
away, since values and slopes at vertices are unknowns of their own. With G = (Φ_y, −Φ_x) along an edge e, d·G is the
derivative of Φ along (−d_y, d_x), G' is σn for an Airy function with the normal n = (e_y, −e_x), and G the velocity for
a stream function.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.element.triangle import EDGES, bernstein, exponents
from qvi_contact.limit.check_proof import cross, less
from qvi_contact.mechanism.bodies import whole_edges
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.linked import linked

SAMPLES = 6
"""Degree of the lattice at which fields are looked at."""

Vector: TypeAlias = tuple[Fraction, Fraction]

Terms: TypeAlias = dict[int, Fraction]
"""Coefficients of unknowns by their numbers."""

Row: TypeAlias = tuple[Terms, Fraction]
"""Terms, and the right-hand side."""

ZERO, ONE = Fraction(0), Fraction(1)


@dataclass(frozen=True, eq=False)
class Nodes:
    """Coefficients of continuous functions of a degree on a split triangle."""

    keys: IntArray  # (m, 4) weights of the three corners and of the barycentre, times the degree
    of_parts: IntArray  # (3, count) the coefficients of each part: of an edge, then the barycentre
    of_sides: IntArray  # (3, degree + 1) those along each side, from its lower corner to the higher one

    @property
    def places(self) -> FloatArray:
        """Barycentric places (m, 3)."""
        return np.asarray((self.keys[:, :3] + self.keys[:, 3:] / 3.0) / self.keys[0].sum())

    @classmethod
    def of(cls, degree: int) -> Nodes:
        """Those of a degree."""
        parts = np.zeros((3, len(exponents(degree)), 4), dtype=np.int64)
        for part, edge in zip(parts, EDGES, strict=True):
            part[:, [*edge, 3]] = exponents(degree)
        rows = parts.reshape(-1, 4)
        first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
        keys = rows[first]
        number = {tuple(key): n for n, key in enumerate(keys.tolist())}
        of_parts = np.array([number[tuple(key)] for key in rows.tolist()]).reshape(3, -1)
        return cls(keys, of_parts, of_parts[:, exponents(degree)[:, 2] == 0])


def part_corners(corners: FloatArray) -> FloatArray:
    """Corners (n, 3, 3, 2) of the three parts of triangles with corners (n, 3, 2): an edge, then the barycentre."""
    centre = corners.mean(axis=1)
    return np.stack([np.stack([corners[:, a], corners[:, b], centre], axis=1) for a, b in EDGES], axis=1)


def lattice(degree: int) -> FloatArray:
    """Barycentric places (count, 3) of Bernstein coefficients."""
    return exponents(degree) / max(degree, 1) if degree else np.full((1, 3), 1.0 / 3.0)


def sampled(problem: ContactProblem, cells: IntArray, degree: int = SAMPLES) -> tuple[FloatArray, FloatArray]:
    """Places x and y (n, 3, g) of a lattice on the parts of triangles."""
    x, y = np.moveaxis(lattice(degree) @ part_corners(problem.mesh.corners[cells]), -1, 0)
    return x, y


def coefficients_of(problem: ContactProblem, degree: int, potential: Field) -> tuple[FloatArray, float]:
    """Coefficients (cells, 3, count) of polynomials that agree with a potential at their places; the largest misfit.

    The misfit is relative to the potential's size.
    """
    cells = np.arange(problem.mesh.cell_count)
    places = (sampled(problem, cells, each) for each in (degree, SAMPLES))
    at_places, seen = (evaluate("ContactProblem.body_potential", potential, *each) for each in places)
    found = at_places @ np.linalg.inv(bernstein(degree, lattice(degree))).T
    misfit = np.abs(found @ bernstein(degree, lattice(SAMPLES)).T - seen).max(initial=0.0)
    return np.asarray(found), float(misfit / max(np.abs(seen).max(initial=0.0), 1e-300))


def nodes_along(mesh: TriangleMesh, nodes: Nodes, edges: Edges, side: int = 0) -> IntArray:
    """Numbers cell · m + node of the coefficients (e, degree + 1) along edges from their first end to the second.

    They are those of the first cell (side 0), or of the one beyond (side 1).
    """
    cells = edges.cells[:, side]
    ends = np.stack([edges.first, edges.second], axis=1)
    opposite = np.argmax((mesh.cells[cells][:, :, None] != ends[:, None, :]).all(axis=2), axis=1)
    found = cells[:, None] * len(nodes.keys) + nodes.of_sides[opposite]
    flipped = edges.first > edges.second
    found[flipped] = found[flipped, ::-1]
    return np.asarray(found)


def numbered(problem: ContactProblem, nodes: Nodes) -> IntArray:
    """Numbers (cells, m) of coefficients, which triangles share on edges that are no open joint."""
    edges, shape = whole_edges(problem), (problem.mesh.cell_count, len(nodes.keys))
    first, second = (nodes_along(problem.mesh, nodes, edges, side) for side in (0, 1))
    return linked(first, second, shape[0] * shape[1]).reshape(shape)


class OutOfBalanceError(ArithmeticError):
    """Rows contradict each other by an amount. It is affine in the factor of loads: they may hold for one factor."""

    def __init__(self, amount: Fraction) -> None:
        super().__init__(f"out of balance by {float(amount):.1e}")
        self.amount = amount


class Smooth:
    """C1 functions Φ of degree p on split triangles, by unknowns: (Φ, Φ_x, Φ_y) of all vertices, then ordinates.

    Attributes
    ----------
    first : int
        The number of the first unknown.
    columns : (n, m) int array
        Numbers of the ordinates of each triangle, first those on edges, and those nearest to barycentres last.
    sides : dict
        For edges (i, j) the triangles that have them, with their corners i and j there.

    """

    def __init__(self, points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int, first: int = 0) -> None:
        self.points, self.triangles, self.p, self.nodes, self.first = points, triangles, p, Nodes.of(p), first
        keys = [tuple(key) for key in self.nodes.keys.tolist()]
        self._place = {key: n for n, key in enumerate(keys)}
        names = [
            [(key[3], t, key) if key[3] else (0, tuple(sorted((v, w) for v, w in zip(corners, key, strict=False) if w)))
             for key in keys]
            for t, corners in enumerate(triangles)
        ]  # fmt: skip
        unique = sorted({name: None for each in names for name in each}, key=lambda name: name[0])
        number = {name: n for n, name in enumerate(unique, first + 3 * len(points))}
        self.columns = np.array([[number[name] for name in each] for each in names])
        self.sides = dict[tuple[int, int], list[tuple[int, int, int]]]()
        for t, corners in enumerate(triangles):
            for a, b in (*EDGES, *(edge[::-1] for edge in EDGES)):
                self.sides.setdefault((corners[a], corners[b]), []).append((t, a, b))
        size = float(np.ptp(np.array(points, dtype=float), axis=0).max())
        self._unit = Fraction(size)  # slopes at vertices are times it, so that rows are not solved for them

    def at_vertex(self, v: int, parts: Sequence[Fraction]) -> Terms:
        """A combination of Φ, Φ_x and Φ_y at a vertex."""
        value, *slopes = parts
        found = [value, *(slope / self._unit for slope in slopes)]
        return {column: part for column, part in enumerate(found, self.first + 3 * v) if part}

    def slope(self, side: tuple[int, int, int], d: Vector, n: int, inner: int = 0) -> Terms:
        """The ordinate n = 0 … p − 1 of d·∇Φ along a side, from its first corner on, or nearer to the barycentre."""
        (t, a, b), k = side, self.p - 1 - n - inner
        start, end = (self.points[self.triangles[t][i]] for i in (a, b))
        along, inwards = less(end, start), less(middle([self.points[v] for v in self.triangles[t]]), start)
        area = cross(along, inwards)
        first, second = cross(d, inwards) / area, cross(along, d) / area
        weights = {(k + 1, n, inner): -first - second, (k, n + 1, inner): first, (k, n, inner + 1): second}
        return {self._column(t, (a, i), (b, j), (3, c)): self.p * part for (i, j, c), part in weights.items() if part}

    def _column(self, t: int, *weights: tuple[int, int]) -> int:
        """The ordinate of a triangle with weights of its corners, and of the barycentre, corner 3."""
        key = [0, 0, 0, 0]
        for corner, weight in weights:
            key[corner] += weight
        return int(self.columns[t, self._place[tuple(key)]])

    def solved(self, rows: Sequence[Row], rough: FloatArray) -> list[list[list[Fraction]]]:
        """Ordinates (3, count) on the parts of each triangle of the C1 function near `rough` ordinates (n, 3, count).

        The rows hold for it.
        """
        values = solved([*self.at_vertices(), *rows, *self.conditions()], self.rounded(rough))
        return [[[values[column] for column in part] for part in cell]
                for cell in self.columns[:, self.nodes.of_parts].tolist()]  # fmt: skip

    def at_vertices(self) -> Iterator[Row]:
        """Ordinates at vertices and beside them follow from Φ and ∇Φ there."""
        found = dict[int, Terms]()
        for t, corners in enumerate(self.triangles):
            centre = middle([self.points[v] for v in corners])
            for a, v in enumerate(corners):
                for b, end in enumerate([*(self.points[w] for w in corners), centre]):
                    e = less(end, self.points[v])
                    column = self._column(t, (a, self.p - 1), (b, 1))
                    found[column] = {column: ONE, **self.at_vertex(v, [-ONE, -e[0] / self.p, -e[1] / self.p])}
        yield from ((row, ZERO) for row in found.values())

    def conditions(self) -> Iterator[Row]:
        """Φ is C1 across edges, and across the lines from corners to barycentres.

        There, ordinates of both parts add to three times the one on the line that is nearer to the barycentre, less the
        one that is farther.
        """
        p = self.p
        for (i, j), sides in self.sides.items():
            if i < j and len(sides) == 2:
                e = less(self.points[j], self.points[i])
                for n in range(1, p - 1):
                    first, second = (self.slope(side, (-e[1], e[0]), n) for side in sides)
                    yield combined((ONE, first), (-ONE, second)), ZERO
        for t, v, inner in product(range(len(self.triangles)), range(3), range(1, p)):
            own = v, p - 1 - inner
            beside = [self._column(t, own, (each, 1), (3, inner)) for each in range(3)]
            nearer = self._column(t, own, (3, inner + 1))
            yield combined(*((ONE, {column: ONE}) for column in beside), (ONE, {nearer: Fraction(-3)})), ZERO

    def rounded(self, rough: FloatArray) -> list[Fraction]:
        """Values of all unknowns, from the first on, near rough ordinates (n, 3, count)."""
        columns, p = self.columns - self.first, self.p
        found = np.zeros(int(columns.max()) + 1)
        found[columns[:, self.nodes.of_parts]] = rough
        corners = np.array(self.triangles)
        points = np.array(self.points, dtype=float)[corners]
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            keys = (tuple((p - 1) * (n == a) + (n == each) for n in range(4)) for each in (a, b, c))
            own, *beside = (found[columns[:, self._place[key]]] for key in keys)
            arms = np.stack([points[:, b] - points[:, a], points[:, c] - points[:, a]], axis=1)
            rises = p * np.stack([each - own for each in beside], axis=1)
            slopes = np.linalg.solve(arms, rises[..., None])[..., 0] * float(self._unit)
            found[3 * corners[:, a, None] + np.arange(3)] = np.column_stack([own, slopes])
        return [Fraction(value) for value in found.tolist()]

    def integrated(self, v: FloatArray) -> FloatArray:
        """Rough ordinates (n, 3, count) of ψ with (ψ_y, −ψ_x) = v, from ordinates (n, 3, ·, 2) of v.

        They are what p (c_(α + e_i) − c_(α + e_0)) = (x_i − x_0) × v_α says, zero at one node of each part.
        """
        number = {tuple(alpha): n for n, alpha in enumerate(exponents(self.p).tolist())}
        near = np.array([[number[tuple(alpha[m] + (m == i) for m in range(3))] for i in range(3)]
                         for alpha in exponents(self.p - 1).tolist()])  # fmt: skip
        known, at = np.unique(self.columns[:, self.nodes.of_parts], return_inverse=True)
        at = at.reshape(len(self.triangles), 3, -1)
        corners = part_corners(np.array(self.points, dtype=float)[np.array(self.triangles)])
        arms = (corners[:, :, 1:] - corners[:, :, :1])[:, :, None]
        right = v[..., None, 0] * arms[..., 1] - v[..., None, 1] * arms[..., 0]
        start, end = np.broadcast_arrays(at[..., near[:, :1]], at[..., near[:, 1:]])
        one = sparse.eye_array(len(known), format="csr")
        A = self.p * (one[end.ravel()] - one[start.ravel()])
        fixed = np.zeros(len(known))
        fixed[np.unique(linked(start, end, len(known)), return_index=True)[1]] = 1.0
        square = sparse.csc_array(A.T @ A + sparse.diags_array(fixed))
        return np.asarray(linalg.splu(square).solve(np.asarray(A.T @ right.ravel())))[at]


def combined(*parts: tuple[Fraction, Terms]) -> Terms:
    """Sums of multiples of terms."""
    found: Terms = {}
    for factor, terms in parts:
        for column, value in terms.items():
            found[column] = found.get(column, ZERO) + factor * value
    return {column: value for column, value in found.items() if value}


def solved(rows: Sequence[Row], values: list[Fraction]) -> list[Fraction]:
    """Values nearest at hand for which the rows hold exactly: the last one of each row follows from the others."""
    pivots: dict[int, Row] = {}
    for row, right in rows:
        rest = dict(row)
        while hits := rest.keys() & pivots.keys():
            hit = min(hits)
            c, (parts, constant) = rest.pop(hit), pivots[hit]
            right -= c * constant
            for column, value in parts.items():
                rest[column] = rest.get(column, ZERO) + c * value
                if rest[column] == 0:
                    del rest[column]
        if rest:
            least = 0.5 * max(abs(float(value)) for value in rest.values())
            pivot = max(column for column, value in rest.items() if abs(float(value)) > least)
            c = rest.pop(pivot)
            pivots[pivot] = {column: -value / c for column, value in rest.items()}, right / c
        elif right != 0:
            raise OutOfBalanceError(right)
    for pivot, (parts, constant) in reversed(pivots.items()):
        values[pivot] = constant + sum((c * values[column] for column, c in parts.items()), ZERO)
    return values


def middle(points: Sequence[Vector], weights: Sequence[Fraction] = (ONE / 3,) * 3) -> Vector:
    """The mean of points with weights."""
    x, y = (sum((w * each for w, each in zip(weights, part, strict=True)), ZERO) for part in zip(*points, strict=True))
    return x, y
