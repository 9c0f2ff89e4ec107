"""Polynomials on the three parts of triangles, split at their barycentres, in Bernstein coefficients.

In floating point a function is C1 only up to rounding, some 1e-16. For proofs a function Φ is therefore built again in
rational numbers. It is C1, and keeps tractions or velocities, if linear equations between its ordinates hold. These
equations are local, since values and slopes at vertices are unknowns of their own. With G = (Φ_y, −Φ_x) along an edge
e, d·G is the derivative of Φ along (−d_y, d_x). For an Airy function G' is σn with the normal n = (e_y, −e_x); for a
stream function G is the velocity.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.element.triangle import EDGES, bernstein, exponents, gradient
from qvi_contact.limit.check_proof import cross, less
from qvi_contact.mechanism.bodies import whole_edges
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.linked import linked

SAMPLES = 6
"""Degree of the lattice of points at which fields are evaluated."""

Vector: TypeAlias = tuple[Fraction, Fraction]

Terms: TypeAlias = dict[int, Fraction]
"""Coefficients of unknowns by their numbers."""

Row: TypeAlias = tuple[Terms, Fraction]
"""Terms, and the right-hand side."""

ZERO, ONE = Fraction(0), Fraction(1)


def part_corners(corners: FloatArray) -> FloatArray:
    """Corners (n, 3, 3, 2) of the three parts of triangles with corners (n, 3, 2): an edge, then the barycentre."""
    centre = corners.mean(axis=1)
    return np.stack([np.stack([corners[:, a], corners[:, b], centre], axis=1) for a, b in EDGES], axis=1)


def derivatives(corners: FloatArray, degree: int, numbers: IntArray) -> list[sparse.csr_array]:
    """∂/∂x and ∂/∂y of polynomials on triangles (n, 3, 2): ordinates, one by one, as rows on numbered ordinates (n, f).

    Numbers begin at 0, and those of several triangles may be equal.
    """
    barycentric = np.linalg.inv(np.concatenate([corners, np.ones((len(corners), 3, 1))], axis=-1))[:, :2]
    slopes = np.einsum("nxa,acf->xncf", barycentric, gradient(degree, np.eye(3)))
    _, n, count, width = slopes.shape
    columns, starts = np.repeat(numbers, count, axis=0).ravel(), width * np.arange(n * count + 1)
    shape = (n * count, int(numbers.max()) + 1)
    return [sparse.csr_array((part.ravel(), columns, starts), shape=shape) for part in slopes]


def lattice(degree: int) -> FloatArray:
    """Barycentric coordinates (count, 3) of the points of Bernstein coefficients of a degree above 0."""
    return np.asarray(exponents(degree) / degree)


def sampled(problem: ContactProblem, cells: IntArray, degree: int = SAMPLES) -> tuple[FloatArray, FloatArray]:
    """Coordinates x and y (n, 3, g) of a lattice on the parts of triangles."""
    x, y = np.moveaxis(lattice(degree) @ part_corners(problem.mesh.corners[cells]), -1, 0)
    return x, y


def coefficients_of(problem: ContactProblem, degree: int, potential: Field) -> tuple[FloatArray, float]:
    """Coefficients (cells, 3, count) of polynomials equal to a potential at their points, and the largest misfit.

    The misfit at other points is relative to the largest value of the potential.
    """
    cells = np.arange(problem.mesh.cell_count)
    points = (sampled(problem, cells, each) for each in (degree, SAMPLES))
    at_points, at_samples = (evaluate("ContactProblem.body_potential", potential, *each) for each in points)
    coefficients = at_points @ np.linalg.inv(bernstein(degree, lattice(degree))).T
    misfit = np.abs(coefficients @ bernstein(degree, lattice(SAMPLES)).T - at_samples).max(initial=0.0)
    return np.asarray(coefficients), float(misfit / max(np.abs(at_samples).max(initial=0.0), 1e-300))


def nodes_along(problem: ContactProblem, degree: int, edges: Edges, side: int = 0) -> IntArray:
    """Coefficients (e, degree + 1) of the parts beside edges, (cell · 3 + part) · count + number, along the tangent.

    Side 0 is the first cell of an edge, side 1 the cell beyond it.
    """
    cells, alpha = edges.cells[:, side], exponents(degree)
    ends = np.stack([edges.first, edges.second], axis=1)
    opposite = np.argmax((problem.mesh.cells[cells][:, :, None] != ends[:, None, :]).all(axis=2), axis=1)
    nodes = (3 * cells + opposite)[:, None] * len(alpha) + np.flatnonzero(alpha[:, 2] == 0)
    flipped = edges.first > edges.second
    nodes[flipped] = nodes[flipped, ::-1]
    return np.asarray(nodes)


def numbered(problem: ContactProblem, degree: int) -> IntArray:
    """Numbers (cells, 3, count) of coefficients; parts share them, also across edges that are no open joint."""
    edges, count, alpha = whole_edges(problem), problem.mesh.cell_count, exponents(degree)
    first, second = (nodes_along(problem, degree, edges, side).ravel() for side in (0, 1))
    own = np.arange(3 * count * len(alpha)).reshape(count, 3, -1)
    inner = [[own[:, part, alpha[:, 1 - edge.index(corner)] == 0] for part, edge in enumerate(EDGES) if corner in edge]
             for corner in range(3)]  # fmt: skip
    one, other = (np.concatenate([each[k].ravel() for each in inner]) for k in (0, 1))
    return linked(np.append(first, one), np.append(second, other), own.size).reshape(own.shape)


class OutOfBalanceError(ArithmeticError):
    """Equations contradict each other by an amount, affine in the load factor: they may hold for one factor."""

    def __init__(self, amount: Fraction) -> None:
        super().__init__(f"out of balance by {float(amount):.1e}")
        self.amount = amount


class Smooth:
    """C1 functions Φ of degree p on parts of triangles, whose last corners are barycentres.

    Unknowns are first (Φ, Φ_x, Φ_y) at all corners, unused at barycentres, then the ordinates.

    Attributes
    ----------
    first : int
        The number of the first unknown.
    columns : (n, count) int array
        Numbers of the ordinates of each part; ordinates inside parts have the largest numbers.
    sides : dict
        By edge (i, j), the parts beside it, with the numbers of the corners i and j there.

    """

    def __init__(self, points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int, first: int = 0) -> None:
        self.points, self.triangles, self.p, self.first = points, triangles, p, first
        keys = list(map(tuple, exponents(p).tolist()))
        self._place = {key: n for n, key in enumerate(keys)}
        names = [[tuple(sorted((v, w) for v, w in zip(corners, key, strict=True) if w)) for key in keys]
                 for corners in triangles]  # fmt: skip
        unique = sorted(dict.fromkeys(name for each in names for name in each), key=len)
        number = {name: n for n, name in enumerate(unique, first + 3 * len(points))}
        self.columns = np.array([[number[name] for name in each] for each in names])
        self.sides = dict[tuple[int, int], list[tuple[int, int, int]]]()
        for t, corners in enumerate(triangles):
            for a, b in (*EDGES, *(edge[::-1] for edge in EDGES)):
                self.sides.setdefault((corners[a], corners[b]), []).append((t, a, b))
        size = float(np.ptp(np.array(points, dtype=float), axis=0).max())
        self._unit = Fraction(size)  # unit of slopes at vertices, large so that rows are not solved for slopes

    def at_vertex(self, v: int, parts: Sequence[Fraction]) -> Terms:
        """Terms of a combination of Φ, Φ_x and Φ_y at a vertex."""
        value, *slopes = parts
        coefficients = [value, *(slope / self._unit for slope in slopes)]
        return {column: part for column, part in enumerate(coefficients, self.first + 3 * v) if part}

    def slope(self, side: tuple[int, int, int], d: Vector, n: int, inner: int = 0) -> Terms:
        """The ordinate n = 0 … p − 1 of d·∇Φ along a side from its first corner, or `inner` rows towards the third."""
        (t, a, b), k = side, self.p - 1 - n - inner
        start, end, third = (self.points[self.triangles[t][i]] for i in (a, b, 3 - a - b))
        along, inwards = less(end, start), less(third, start)
        area = cross(along, inwards)
        first, second = cross(d, inwards) / area, cross(along, d) / area
        parts = {(k + 1, n, inner): -first - second, (k, n + 1, inner): first, (k, n, inner + 1): second}
        order = (a, b, 3 - a - b)
        return {self._column(t, dict(zip(order, weights, strict=True))): self.p * part
                for weights, part in parts.items() if part}  # fmt: skip

    def second(self, t: int, alpha: Sequence[int], d: Vector, e: Vector) -> Terms:
        """The ordinate α of degree p − 2 of the second derivative of Φ along d and e, on one triangle."""
        a, b, c = (self.points[v] for v in self.triangles[t])
        area = cross(less(b, a), less(c, a))
        along_d, along_e = ([cross(way, less(q, r)) / area for q, r in ((b, c), (c, a), (a, b))] for way in (d, e))
        pairs = list(product(range(3), repeat=2))
        columns = [self._column(t, {n: alpha[n] + (n == i) + (n == j) for n in range(3)}) for i, j in pairs]
        parts = [self.p * (self.p - 1) * along_d[i] * along_e[j] for i, j in pairs]
        return combined(*((part, {column: ONE}) for part, column in zip(parts, columns, strict=True)))

    def _column(self, t: int, weights: Mapping[int, int]) -> int:
        """The number of the ordinate of a triangle with these weights of its corners."""
        return int(self.columns[t, self._place[weights.get(0, 0), weights.get(1, 0), weights.get(2, 0)]])

    def solved(self, rows: Iterable[Row], rough: Sequence[Fraction]) -> list[Fraction]:
        """Values of the unknowns, and of earlier ones, near the values `rough`, for which the rows hold and Φ is C1."""
        return solved([*self._at_vertices(), *rows, *self._conditions()], list(rough))

    def _at_vertices(self) -> Iterator[Row]:
        """Equations of ordinates at vertices and beside them, which follow from Φ and ∇Φ there."""
        rows = dict[int, Terms]()
        for t, corners in enumerate(self.triangles):
            for (a, v), (b, w) in product(enumerate(corners[:2]), enumerate(corners)):
                e = less(self.points[w], self.points[v])
                column = self._column(t, {b: 1} | {a: self.p - (a != b)})
                rows[column] = {column: ONE, **self.at_vertex(v, [-ONE, -e[0] / self.p, -e[1] / self.p])}
        yield from ((row, ZERO) for row in rows.values())

    def _conditions(self) -> Iterator[Row]:
        """Equations that make Φ C1 across edges."""
        for (i, j), sides in self.sides.items():
            _, a, b = sides[0]
            if len(sides) == 2 and a < 2 and (b == 2 or i < j):
                e = less(self.points[j], self.points[i])
                for n in range(1, self.p if b == 2 else self.p - 1):
                    first, second = (self.slope(side, (-e[1], e[0]), n) for side in sides)
                    yield combined((ONE, first), (-ONE, second)), ZERO

    def rounded(self, rough: FloatArray) -> list[Fraction]:
        """Values of all unknowns, from the first on, of rough ordinates (n, count)."""
        columns, corners = self.columns - self.first, np.array(self.triangles)
        values = np.zeros(int(columns.max()) + 1)
        values[columns] = rough
        tips, slope_tips = (exponents(degree).argmax(axis=0) for degree in (self.p, self.p - 1))
        slopes = (each @ values for each in derivatives(self._corners, self.p, columns))
        at_tips = [each.reshape(len(corners), -1)[:, slope_tips] * float(self._unit) for each in slopes]
        values[3 * corners[..., None] + np.arange(3)] = np.stack([rough[:, tips], *at_tips], axis=-1)
        return [Fraction(value) for value in values.tolist()]

    def integrated(self, v: FloatArray) -> FloatArray:
        """Rough ordinates (n, count) of ψ with (ψ_y, −ψ_x) = v, from ordinates (n, ·, 2) of v.

        ψ = 0 at one node of each connected part.
        """
        unknowns, position = np.unique(self.columns, return_inverse=True)
        position = position.reshape(self.columns.shape)
        along_x, along_y = derivatives(self._corners * float(1 / self._unit), self.p, position)
        A = sparse.vstack([along_y, along_x])
        is_fixed = np.zeros(len(unknowns))
        first = np.broadcast_to(position[:, :1], position.shape)
        is_fixed[np.unique(linked(first, position, len(unknowns)), return_index=True)[1]] = 1.0
        square = sparse.csc_array(A.T @ A + sparse.diags_array(is_fixed))
        right = float(self._unit) * np.asarray(A.T @ np.concatenate([v[..., 0].ravel(), -v[..., 1].ravel()]))
        return np.asarray(linalg.splu(square).solve(right))[position]

    @property
    def _corners(self) -> FloatArray:
        """Corners (n, 3, 2) of the parts."""
        return np.asarray(np.array(self.points, dtype=float)[np.array(self.triangles)])


def combined(*parts: tuple[Fraction, Terms]) -> Terms:
    """The sum of multiples of terms."""
    terms_found: Terms = {}
    for factor, terms in parts:
        for column, value in terms.items():
            terms_found[column] = terms_found.get(column, ZERO) + factor * value
    return {column: value for column, value in terms_found.items() if value}


def solved(rows: Sequence[Row], values: list[Fraction]) -> list[Fraction]:
    """The values changed so that the rows hold exactly: the last large term of each row follows from the others."""
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
    """The weighted mean of points."""
    x, y = (sum((w * each for w, each in zip(weights, part, strict=True)), ZERO) for part in zip(*points, strict=True))
    return x, y
