"""C1 functions on split triangles in rational numbers, and linear equations in them.

Rounding breaks smoothness by some 1e-16. So a function Φ is built again, exactly, from numbers that are free: Φ and ∇Φ
at vertices, along each edge the ordinates of Φ and of its cross derivative that these leave open, and in each triangle
what its C1 conditions leave open. What is prescribed of edges is a linear equation between values at their ends. With
G = (Φ_y, −Φ_x) along an edge e from i to j, n·G and e·G are the derivatives of Φ along e and m = (−e_y, e_x) for the
normal n = (e_y, −e_x). G' is σn for an Airy function, and G the velocity for a stream function.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.triangle import EDGES, exponents

Vector: TypeAlias = tuple[Fraction, Fraction]

Row: TypeAlias = tuple[dict[int, Fraction], Fraction]
"""Coefficients of unknowns by their numbers, and the right-hand side."""

Given: TypeAlias = Mapping[tuple[int, int], Sequence[list[Fraction] | None]]
"""What is known of an edge: ordinates of n·G' and of e·G' from its first end on, or None."""


class OutOfBalanceError(ArithmeticError):
    """Rows contradict each other by an amount. It is affine in the factor of loads: they may hold for one factor."""

    def __init__(self, amount: Fraction) -> None:
        super().__init__(f"out of balance by {float(amount):.1e}")
        self.amount = amount


def vertex_values(
    points: Sequence[Vector], p: int, given: Given, rows: Sequence[Row], rough: FloatArray
) -> list[Fraction]:
    """Φ, Φ_x, Φ_y of all vertices for which edges and further rows hold; `rough` (v, 3) are those in floating point."""
    found = list(rows)
    for (i, j), (along, across) in given.items():
        e = less(points[j], points[i])
        if along is not None:  # n·G = Φ_e
            total = sums(along, p - 1)
            found.append((_dot_gradient(i, j, e), total[-1]))
            own = {3 * j: Fraction(1), 3 * i: Fraction(-1), 3 * i + 1: -e[0], 3 * i + 2: -e[1]}
            found.append((own, sum(total, Fraction(0)) / p))
        if across is not None:  # e·G = Φ_m
            found.append((_dot_gradient(i, j, (-e[1], e[0])), sums(across, p - 1)[-1]))
    return solved(found, [Fraction(float(value)) for value in rough.ravel()])


def smooth(
    points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int, given: Given, values: Sequence[Fraction],
    rough: FloatArray,
) -> Iterator[list[list[Fraction]]]:  # fmt: skip
    """Ordinates (3, count) of Φ of degree p on the parts of each triangle; `rough` are those in floating point."""
    edges: dict[tuple[int, int], tuple[list[Fraction], list[Fraction]]] = {}
    for t, corners in enumerate(triangles):
        known: dict[tuple[int, ...], Fraction] = {}
        centre = middle([points[v] for v in corners])
        for s, (a, b) in enumerate(EDGES):
            i, j = corners[a], corners[b]
            e = less(points[j], points[i])
            m, inwards = (-e[1], e[0]), less(centre, points[i])
            alpha, beta = dot(inwards, e) / dot(e, e), dot(inwards, m) / dot(e, e)
            if (i, j) not in edges:
                rough_edge = _rough_edge(rough[t, s], p, float(alpha), float(beta))
                edges[i, j] = _edge(e, p, given.get((i, j)) or _flipped(given.get((j, i))),
                                    [values[3 * v : 3 * v + 3] for v in (i, j)], rough_edge)  # fmt: skip
            q, cross = edges[i, j]
            for n in range(p + 1):
                known[_key(a, p - n, b, n, 0)] = q[n]
            for n in range(p):
                slope = alpha * p * (q[n + 1] - q[n]) + beta * cross[n]
                known[_key(a, p - 1 - n, b, n, 1)] = q[n] + slope / p
        free, dependent = _inner(p)
        for key, (s, n) in free.items():
            known[key] = Fraction(float(rough[t, s, n]))
        for key, parts in dependent:
            known[key] = sum((c * known[other] for other, c in parts.items()), Fraction(0))
        yield [[known[key] for key in _keys(p, s)] for s in range(3)]


def _flipped(given: Sequence[list[Fraction] | None] | None) -> Sequence[list[Fraction] | None]:
    """The same from the other end: second derivatives do not mind from which end they are counted."""
    return [None, None] if given is None else [None if part is None else part[::-1] for part in given]


def _edge(
    e: Vector, p: int, given: Sequence[list[Fraction] | None], values: Sequence[Sequence[Fraction]],
    rough: tuple[FloatArray, FloatArray],
) -> tuple[list[Fraction], list[Fraction]]:  # fmt: skip
    """Ordinates of Φ (p + 1) and of Φ_m (p) along e, with Φ, Φ_x and Φ_y at its ends."""
    m, (along, across) = (-e[1], e[0]), given
    first, second = (dot(e, value[1:]) for value in values)
    q, cross = ([Fraction(float(value)) for value in part] for part in rough)
    if along is None:
        q[0], q[1], q[p - 1], q[p] = (
            values[0][0], values[0][0] + first / p, values[1][0] - second / p, values[1][0],
        )  # fmt: skip
    else:
        q[0] = values[0][0]
        for n, total in enumerate([Fraction(0), *sums(along, p - 1)]):
            q[n + 1] = q[n] + (first + total) / p
    cross[0], cross[-1] = (dot(m, value[1:]) for value in values)
    if across is not None:
        cross[1:] = [cross[0] + value for value in sums(across, p - 1)]
    return q, cross


def _rough_edge(part: FloatArray, p: int, alpha: float, beta: float) -> tuple[FloatArray, FloatArray]:
    """Ordinates of Φ and of Φ_m along the edge of a part, from those of Φ."""
    at = {tuple(row): i for i, row in enumerate(exponents(p).tolist())}
    q = np.array([part[at[p - n, n, 0]] for n in range(p + 1)])
    inner = np.array([part[at[p - 1 - n, n, 1]] for n in range(p)])
    return q, (p * (inner - q[:-1]) - alpha * p * np.diff(q)) / beta


def _key(a: int, i: int, b: int, j: int, inner: int) -> tuple[int, int, int, int]:
    """The ordinate with weights i of corner a, j of corner b, and of the barycentre."""
    key = [0, 0, 0, inner]
    key[a], key[b] = i, j
    return key[0], key[1], key[2], key[3]


def _keys(p: int, s: int) -> list[tuple[int, int, int, int]]:
    """The ordinates of a part in their order."""
    a, b = EDGES[s]
    return [_key(a, i, b, j, inner) for i, j, inner in exponents(p).tolist()]


@cache
def _inner(p: int) -> tuple[dict[Any, tuple[int, int]], list[tuple[Any, dict[Any, Fraction]]]]:
    """Ordinates of a split triangle that its C1 conditions leave open, by part and number; and the others by these.

    Two layers along the sides are known. Across the line from corner v to the barycentre, ordinates of both parts add
    to three times the one on the line that is nearer to the barycentre, less the one that is farther.
    """
    places = {key: (s, n) for s in range(3) for n, key in enumerate(_keys(p, s))}
    rows: list[dict[Any, Fraction]] = []
    for v in range(3):
        a, b = (i for i in range(3) if i != v)
        for inner in range(1, p):
            i = p - 1 - inner
            row: dict[Any, Fraction] = {}
            for key, c in (
                (_key(v, i, a, 1, inner), 1), (_key(v, i, b, 1, inner), 1), (_key(v, i + 1, a, 0, inner), 1),
                (_key(v, i, a, 0, inner + 1), -3),
            ):  # fmt: skip
                row[key] = row.get(key, Fraction(0)) + c
            rows.append(row)
    pivots: list[tuple[Any, dict[Any, Fraction]]] = []
    for row in rows:
        rest = dict(row)
        for key, parts in pivots:
            c = rest.pop(key, Fraction(0))
            for other, value in parts.items():
                rest[other] = rest.get(other, Fraction(0)) + c * value
        open_ = [key for key, c in rest.items() if c != 0 and key[3] > 1]
        if open_:
            pivot = max(open_, key=lambda key: (key[3], key))
            c = rest.pop(pivot)
            pivots.append((pivot, {key: -value / c for key, value in rest.items() if value != 0}))
    chosen = {key for key, _ in pivots}
    free = {key: place for key, place in places.items() if key[3] > 1 and key not in chosen}
    return free, pivots[::-1]


def sums(values: Sequence[Fraction], count: int) -> list[Fraction]:
    """Sums of the first 1, 2, … values over their count: ordinates of the integral."""
    found, total = [], Fraction(0)
    for value in values:
        total += value / count
        found.append(total)
    return found


def _dot_gradient(i: int, j: int, d: Vector) -> dict[int, Fraction]:
    """d·(∇Φ_j − ∇Φ_i) as a row."""
    parts = {3 * j + 1: d[0], 3 * j + 2: d[1], 3 * i + 1: -d[0], 3 * i + 2: -d[1]}
    return {column: value for column, value in parts.items() if value != 0}


def solved(rows: Sequence[Row], values: list[Fraction]) -> list[Fraction]:
    """Values nearest at hand for which the rows hold exactly: the last one of each row follows from the others."""
    pivots: dict[int, Row] = {}
    order: list[int] = []
    for row, right in rows:
        rest = dict(row)
        while True:
            hit = next((column for column in rest if column in pivots), None)
            if hit is None:
                break
            c = rest.pop(hit)
            parts, constant = pivots[hit]
            right -= c * constant
            for column, value in parts.items():
                rest[column] = rest.get(column, Fraction(0)) + c * value
                if rest[column] == 0:
                    del rest[column]
        if not rest:
            if right != 0:
                raise OutOfBalanceError(right)
            continue
        pivot = max(
            rest, key=lambda column: (abs(float(rest[column])) > 0.5 * max(map(abs, map(float, rest.values()))), column)
        )
        c = rest.pop(pivot)
        pivots[pivot] = ({column: -value / c for column, value in rest.items()}, right / c)
        order.append(pivot)
    for pivot in reversed(order):
        parts, constant = pivots[pivot]
        values[pivot] = constant + sum((c * values[column] for column, c in parts.items()), Fraction(0))
    return values


def less(u: Sequence[Fraction], v: Sequence[Fraction]) -> Vector:
    """U − v."""
    return u[0] - v[0], u[1] - v[1]


def dot(u: Sequence[Fraction], v: Sequence[Fraction]) -> Fraction:
    """U·v."""
    return u[0] * v[0] + u[1] * v[1]


def cross(u: Sequence[Fraction], v: Sequence[Fraction]) -> Fraction:
    """U × v."""
    return u[0] * v[1] - u[1] * v[0]


def middle(points: Sequence[Vector]) -> Vector:
    """The mean of three points."""
    x, y = (sum(part, Fraction(0)) / 3 for part in zip(*points, strict=True))
    return x, y
