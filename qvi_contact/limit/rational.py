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
from typing import TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.element.triangle import EDGES, exponents
from qvi_contact.limit.split import Nodes, part_corners

Vector: TypeAlias = tuple[Fraction, Fraction]

Row: TypeAlias = tuple[dict[int, Fraction], Fraction]
"""Coefficients of unknowns by their numbers, and the right-hand side."""

Given: TypeAlias = Mapping[tuple[int, int], Sequence[list[Fraction] | None]]
"""What is known of an edge: ordinates of n·G' and of e·G' from its first end on, or None."""

ZERO, ONE = Fraction(0), Fraction(1)


class OutOfBalanceError(ArithmeticError):
    """Rows contradict each other by an amount. It is affine in the factor of loads: they may hold for one factor."""

    def __init__(self, amount: Fraction) -> None:
        super().__init__(f"out of balance by {float(amount):.1e}")
        self.amount = amount


def smooth(
    points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int, given: Given, rows: Sequence[Row],
    rough: FloatArray,
) -> Iterator[list[list[Fraction]]]:  # fmt: skip
    """Ordinates (3, count) on the parts of each triangle of the Φ of degree p that is near `rough` ordinates (n, ·, ·).

    What is given of edges holds, and further rows on (Φ, Φ_x, Φ_y) of all vertices. Across the line from corner v to
    the barycentre of a triangle, ordinates of both parts add to three times the one on the line that is nearer to the
    barycentre, less the one that is farther.
    """
    values = solved(
        [*rows, *_of_edges(points, p, given)],
        [Fraction(x) for x in _at_vertices(points, triangles, p, rough).ravel().tolist()],
    )
    nodes = Nodes.of(p)
    keys = [[tuple(nodes.keys[n].tolist()) for n in part] for part in nodes.of_parts]
    place = {key: (s, n) for s, part in enumerate(keys) for n, key in enumerate(part)}
    opened = sorted((key for key in place if key[3] > 1), key=lambda key: (key[3], key))
    column = {key: n for n, key in enumerate(opened)}
    edges: dict[tuple[int, int], tuple[list[Fraction], list[Fraction]]] = {}
    for t, corners in enumerate(triangles):
        known: dict[tuple[int, ...], Fraction] = {}
        centre = middle([points[v] for v in corners])
        for s, (a, b) in enumerate(EDGES):
            i, j = corners[a], corners[b]
            e, inwards = less(points[j], points[i]), less(centre, points[i])
            alpha, beta = dot(inwards, e) / dot(e, e), cross(e, inwards) / dot(e, e)
            if (i, j) not in edges:
                ends = [values[3 * v : 3 * v + 3] for v in (i, j)]
                backwards = [None if part is None else part[::-1] for part in given.get((j, i), (None, None))]
                edges[i, j] = _edge(e, p, given.get((i, j), backwards), ends, rough[t, s], float(alpha), float(beta))
            q, slopes = edges[i, j]
            for n in range(p + 1):
                known[_key(a, p - n, b, n, 0)] = q[n]
            for n in range(p):
                known[_key(a, p - 1 - n, b, n, 1)] = q[n] + alpha * (q[n + 1] - q[n]) + beta * slopes[n] / p
        inside = []
        for v, inner in ((v, inner) for v in range(3) for inner in range(1, p)):
            a, b = (i for i in range(3) if i != v)
            i = p - 1 - inner
            row = {_key(v, i, a, 1, inner): 1, _key(v, i, b, 1, inner): 1, _key(v, i + 1, a, 0, inner): 1,
                   _key(v, i, a, 0, inner + 1): -3}  # fmt: skip
            right = -sum((c * known[key] for key, c in row.items() if key in known), ZERO)
            inside.append(({column[key]: Fraction(c) for key, c in row.items() if key in column}, right))
        rest = solved(inside, [Fraction(rough[t][place[key]].item()) for key in opened])
        known |= dict(zip(opened, rest, strict=True))
        yield [[known[key] for key in part] for part in keys]


def _of_edges(points: Sequence[Vector], p: int, given: Given) -> Iterator[Row]:
    """What is given of edges, as rows on (Φ, Φ_x, Φ_y) of vertices."""
    for (i, j), (along, across) in given.items():
        e = less(points[j], points[i])
        for d, values in ((e, along), ((-e[1], e[0]), across)):  # n·G = Φ_e and e·G = Φ_m
            if values is not None:
                slopes = {3 * j + 1: d[0], 3 * j + 2: d[1], 3 * i + 1: -d[0], 3 * i + 2: -d[1]}
                yield ({n: value for n, value in slopes.items() if value}, sums(values, p - 1)[-1])
        if along is not None:
            own = {3 * j: ONE, 3 * i: -ONE, 3 * i + 1: -e[0], 3 * i + 2: -e[1]}
            yield ({n: value for n, value in own.items() if value}, sum(sums(along, p - 1), ZERO) / p)


def _at_vertices(points: Sequence[Vector], triangles: Sequence[Sequence[int]], p: int, rough: FloatArray) -> FloatArray:
    """(Φ, Φ_x, Φ_y) of all vertices (v, 3) from the ordinates of one triangle each."""
    corners = part_corners(np.array(points, dtype=float)[np.array(triangles)])
    slopes = np.linalg.inv(np.concatenate([corners, np.ones((*corners.shape[:3], 1))], axis=-1))[..., :2, :]
    number = {tuple(alpha): n for n, alpha in enumerate(exponents(p).tolist())}
    found, units = np.zeros((len(points), 3)), np.eye(3, dtype=int)
    for s, edge in enumerate(EDGES):
        for own, end in enumerate(edge):
            c = rough[:, s, [number[tuple(((p - 1) * units[own] + unit).tolist())] for unit in units]]
            gradient = p * np.einsum("nxi,ni->nx", slopes[:, s], c)
            found[np.array(triangles)[:, end]] = np.column_stack([c[:, own], gradient])
    return found


def _edge(
    e: Vector, p: int, given: Sequence[list[Fraction] | None], ends: Sequence[Sequence[Fraction]], rough: FloatArray,
    alpha: float, beta: float,
) -> tuple[list[Fraction], list[Fraction]]:  # fmt: skip
    """Ordinates of Φ (p + 1) and of Φ_m (p) along e, with Φ, Φ_x and Φ_y at its ends, near the ordinates of a part."""
    number = {tuple(alpha): n for n, alpha in enumerate(exponents(p).tolist())}
    own = rough[[number[p - n, n, 0] for n in range(p + 1)]]
    inner = rough[[number[p - 1 - n, n, 1] for n in range(p)]]
    m, (along, across) = (-e[1], e[0]), given
    first, second = (dot(e, value[1:]) / p for value in ends)
    q = [Fraction(value) for value in own.tolist()]
    slopes = [Fraction(value) for value in (p * (inner - own[:-1] - alpha * np.diff(own)) / beta).tolist()]
    q[0] = ends[0][0]
    if along is None:
        q[1], q[p - 1], q[p] = ends[0][0] + first, ends[1][0] - second, ends[1][0]
    else:
        for n, total in enumerate([ZERO, *sums(along, p - 1)]):
            q[n + 1] = q[n] + first + total / p
    slopes[0], slopes[-1] = (dot(m, value[1:]) for value in ends)
    if across is not None:
        slopes[1:] = [slopes[0] + value for value in sums(across, p - 1)]
    return q, slopes


def _key(a: int, i: int, b: int, j: int, inner: int) -> tuple[int, ...]:
    """The ordinate with weights i of corner a, j of corner b, and of the barycentre."""
    key = [0, 0, 0, inner]
    key[a], key[b] = i, j
    return tuple(key)


def sums(values: Sequence[Fraction], count: int) -> list[Fraction]:
    """Sums of the first 1, 2, … values over their count: ordinates of the integral."""
    found, total = [], ZERO
    for value in values:
        total += value / count
        found.append(total)
    return found


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


def less(u: Sequence[Fraction], v: Sequence[Fraction]) -> Vector:
    """U − v."""
    return u[0] - v[0], u[1] - v[1]


def dot(u: Sequence[Fraction], v: Sequence[Fraction]) -> Fraction:
    """U·v."""
    return u[0] * v[0] + u[1] * v[1]


def cross(u: Sequence[Fraction], v: Sequence[Fraction]) -> Fraction:
    """U × v."""
    return u[0] * v[1] - u[1] * v[0]


def middle(points: Sequence[Vector], weights: Sequence[Fraction] = (ONE / 3,) * 3) -> Vector:
    """The mean of points with weights."""
    x, y = (sum((w * each for w, each in zip(weights, part, strict=True)), ZERO) for part in zip(*points, strict=True))
    return x, y
