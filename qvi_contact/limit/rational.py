"""C1 functions on split triangles in rational numbers, and linear equations in them.

Rounding breaks smoothness by some 1e-16. So a function Φ is built again, exactly: it is C1 if linear equations between
its ordinates hold, and so are tractions and velocities. No ordinate depends on others far away, since values and slopes
at vertices are unknowns of their own. With G = (Φ_y, −Φ_x) along an edge e, d·G is the derivative of Φ along
(−d_y, d_x), G' is σn for an Airy function with the normal n = (e_y, −e_x), and G the velocity for a stream function.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product
from typing import TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.triangle import EDGES
from qvi_contact.limit.check_proof import cross, less
from qvi_contact.limit.split import Nodes

Vector: TypeAlias = tuple[Fraction, Fraction]

Terms: TypeAlias = dict[int, Fraction]
"""Coefficients of unknowns by their numbers."""

Row: TypeAlias = tuple[Terms, Fraction]
"""Terms, and the right-hand side."""

ZERO, ONE = Fraction(0), Fraction(1)


class OutOfBalanceError(ArithmeticError):
    """Rows contradict each other by an amount. It is affine in the factor of loads: they may hold for one factor."""

    def __init__(self, amount: Fraction) -> None:
        super().__init__(f"out of balance by {float(amount):.1e}")
        self.amount = amount


class Smooth:
    """C1 functions Φ of degree p on split triangles, by unknowns: (Φ, Φ_x, Φ_y) of all vertices, then ordinates.

    Attributes
    ----------
    columns : (n, m) int array
        Numbers of the ordinates of each triangle, first those on edges, and those nearest to barycentres last.
    sides : dict
        For edges (i, j) the triangles that have them, with their corners i and j there.

    """

    def __init__(self, points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int) -> None:
        self.points, self.triangles, self.p, self.nodes = points, triangles, p, Nodes.of(p)
        keys = [tuple(key) for key in self.nodes.keys.tolist()]
        self._place = {key: n for n, key in enumerate(keys)}
        names = [
            [(key[3], t, key) if key[3] else (0, tuple(sorted((v, w) for v, w in zip(corners, key, strict=False) if w)))
             for key in keys]
            for t, corners in enumerate(triangles)
        ]  # fmt: skip
        unique = sorted({name: None for each in names for name in each}, key=lambda name: name[0])
        number = {name: n for n, name in enumerate(unique, 3 * len(points))}
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
        found = {3 * v: value, **{3 * v + n: slope / self._unit for n, slope in enumerate(slopes, 1)}}
        return {column: part for column, part in found.items() if part}

    def slope(self, side: tuple[int, int, int], n: int, d: Vector) -> Terms:
        """The ordinate n = 0 … p − 1 of d·∇Φ along a side, from its first corner on."""
        t, a, b = side
        start, end = (self.points[self.triangles[t][i]] for i in (a, b))
        along, inwards = less(end, start), less(middle([self.points[v] for v in self.triangles[t]]), start)
        area = cross(along, inwards)
        first, second = cross(d, inwards) / area, cross(along, d) / area
        found = {self._column(t, (a, self.p - n), (b, n)): -self.p * (first + second),
                 self._column(t, (a, self.p - 1 - n), (b, n + 1)): self.p * first,
                 self._column(t, (a, self.p - 1 - n), (b, n), (3, 1)): self.p * second}  # fmt: skip
        return {column: part for column, part in found.items() if part}

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
        values = solved([*self._at_vertices(), *rows, *self._conditions()], self._rounded(rough))
        return [[[values[column] for column in part] for part in cell]
                for cell in self.columns[:, self.nodes.of_parts].tolist()]  # fmt: skip

    def _at_vertices(self) -> Iterator[Row]:
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

    def _conditions(self) -> Iterator[Row]:
        """Φ is C1 across edges, and across the lines from corners to barycentres.

        There, ordinates of both parts add to three times the one on the line that is nearer to the barycentre, less the
        one that is farther.
        """
        p = self.p
        for (i, j), sides in self.sides.items():
            if i < j and len(sides) == 2:
                e = less(self.points[j], self.points[i])
                for n in range(1, p - 1):
                    first, second = (self.slope(side, n, (-e[1], e[0])) for side in sides)
                    yield combined((ONE, first), (-ONE, second)), ZERO
        for t, v, inner in product(range(len(self.triangles)), range(3), range(1, p)):
            own = v, p - 1 - inner
            beside = [self._column(t, own, (each, 1), (3, inner)) for each in range(3)]
            nearer = self._column(t, own, (3, inner + 1))
            yield combined(*((ONE, {column: ONE}) for column in beside), (ONE, {nearer: Fraction(-3)})), ZERO

    def _rounded(self, rough: FloatArray) -> list[Fraction]:
        """Values of all unknowns near rough ordinates."""
        found, p = np.zeros(int(self.columns.max()) + 1), self.p
        found[self.columns[:, self.nodes.of_parts]] = rough
        corners = np.array(self.triangles)
        points = np.array(self.points, dtype=float)[corners]
        for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            keys = (tuple((p - 1) * (n == a) + (n == each) for n in range(4)) for each in (a, b, c))
            own, *beside = (found[self.columns[:, self._place[key]]] for key in keys)
            arms = np.stack([points[:, b] - points[:, a], points[:, c] - points[:, a]], axis=1)
            rises = p * np.stack([each - own for each in beside], axis=1)
            slopes = np.linalg.solve(arms, rises[..., None])[..., 0] * float(self._unit)
            found[3 * corners[:, a, None] + np.arange(3)] = np.column_stack([own, slopes])
        return [Fraction(value) for value in found.tolist()]


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
