"""Where bodies touch: straight lines between two of them, and what the contact laws let them do there.

With [v] = v of the first body less that of the second (or of the obstacle), n from the first to the second and
w = −[v]_N the speed of opening, the tractions of a contact do at most the work

    π([v]) = sup { −σ_N [v]_N − σ_T [v]_T :  σ_N ≤ 0,  |σ_T| ≤ min(c − μσ_N, t_max) }
           = min { min(c, t_max) a + t_max (|[v]_T| − a) :  0 ≤ a ≤ |[v]_T|,  μ a ≤ w }          if w ≥ 0, else ∞

against it. Without a cap this is c |[v]_T| if w ≥ μ |[v]_T|, and infinite if not. Along a straight line [v]_T of two
rigid bodies is constant and w linear, so that conditions at the ends of the line are enough where μ is constant.

Where μ is a function it is replaced on short pieces of edges by the least affine function that is not below its samples
there and has the slope of the chord: π becomes larger, and what it proves stays proved. So are c and t_max where they
jump or have kinks inside edges, as far as samples show it.

| law                            | condition                    | ∫ π ds                                     |
|--------------------------------|------------------------------|--------------------------------------------|
| unilateral, μ = 0              | w ≥ 0                        | ∫ min(c, t_max) ds · |[v]_T|               |
| unilateral, no cap             | w ≥ μ |[v]_T|                | ∫ c ds · |[v]_T|                           |
| unilateral, capped             | w ≥ μ a                      | ∫ t_max ds · |[v]_T| − ∫ (t_max − c)⁺ a ds |
| bilateral, μ = 0               | w = 0                        | as unilateral                              |
| bilateral, capped              | w = 0                        | ∫ t_max ds · |[v]_T|                       |
| bilateral with friction, tied  | w = 0, [v]_T = 0             | 0                                          |

In `docs/theory.md`: (D23).
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import Edges, angles, points_along, vectors_along
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.records import dataclass

_PIECES: Final = 8  # of an edge, where friction is a function
_SAMPLES: Final = 8  # steps in each of them
_POINTS: Final = 8  # Gauss points where cohesion and cap are integrated
_SMOOTH: Final = 1e-10  # share of the values, difference of two quadratures that is rounding, or next to it
_ROUNDING: Final = 16.0 * np.finfo(float).eps
_SAME: Final = 1e-9  # share of a line within which two places are one
_CAPPED_PIECES: Final = 4  # of a line, where a cap lets part of the slip dilate
_TURN: Final = 0.02  # angle by which a piece of an arc turns at most [rad]
_DEGREE: Final = 4  # of motions along such a piece: what is left is rounding

_AnyLine = TypeVar("_AnyLine", bound="Line")


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line along which one contact holds between two bodies, with the position s along the tangent."""

    contact: Contact
    bodies: tuple[int, int]  # the first body, and the second; −1 for an obstacle that stands still
    start: FloatArray  # start, tangent, normal, (2,) each: the point s = 0 [length], and unit vectors
    tangent: FloatArray
    normal: FloatArray
    edges: FloatArray  # (n, 2): where its edges begin and end [length]
    places: FloatArray  # places, friction, (p,) each: where the condition holds, ascending, and μ there
    friction: FloatArray
    fixed: bool  # whether the bodies do not part, w = 0
    held: bool  # whether they do not slip either

    @property
    def dilates(self) -> bool:
        """Whether slip takes opening: a unilateral contact with friction."""
        return not self.fixed and bool((self.friction > 0.0).any())

    @property
    def capped(self) -> bool:
        """Whether only part of the slip has to dilate."""
        return self.dilates and self.contact.shear_limit is not None

    def points(self, s: FloatArray) -> FloatArray:
        """Coordinates (p, 2) of places."""
        return np.asarray(self.start + s[:, None] * self.tangent)

    def directions(self, vector: FloatArray, s: FloatArray) -> FloatArray:
        """Normal or tangent at places, (p, 2)."""
        return np.broadcast_to(vector, (len(s), 2))

    def _relative(self, bodies: Bodies, s: FloatArray, vector: FloatArray) -> FloatArray:
        """Rows (p, 3 k) of d·[v] at places, with d normal or tangent there."""
        points, along = self.points(s), self.directions(vector, s)
        first, second = (np.full(len(points), body) for body in self.bodies)
        return bodies.rows(first, points, along) - bodies.rows(second, points, along)

    def _samples(self, bodies: Bodies, vector: FloatArray) -> FloatArray:
        """Rows of d·[v] where it vanishes only if it does everywhere."""
        return self._relative(bodies, self.places[[0, -1]], vector)

    def opening(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of w at the places."""
        return -self._relative(bodies, self.places, self.normal)

    def slips(self, bodies: Bodies) -> FloatArray:
        """Rows (r, 3 k) of which the largest is |[v]_T| anywhere, or more: one, as [v]_T is constant."""
        return self._relative(bodies, np.zeros(1), self.tangent)

    def slip(self, bodies: Bodies, v: FloatArray) -> float:
        """The largest |[v]_T| of motions v, or more."""
        return float(np.abs(self.slips(bodies) @ v).max())

    def fixed_rows(self, bodies: Bodies) -> FloatArray:
        """Rows (e, 3 k) of the velocities that a line whose bodies do not part, or do not slip either, rules out."""
        vectors = [self.normal] * self.fixed + [self.tangent] * self.held
        rows = [self._samples(bodies, vector) for vector in vectors]
        return np.concatenate([np.zeros((0, 3 * len(bodies))), *rows])

    def divided(self, s: float) -> "Line":
        """The same line with one more place, where μ is the larger of its neighbours'."""
        at = int(np.searchsorted(self.places, s))
        if at in (0, len(self.places)) or np.abs(self.places - s).min() <= _SAME * np.ptp(self.places):
            return self
        mu = self.friction[at - 1 : at + 1].max()
        return replace(self, places=np.insert(self.places, at, s), friction=np.insert(self.friction, at, mu))

    def shear_work(self) -> float:
        """∫ π ds for a slip of 1 and no opening to spare: of t_max, of c, or of the smaller one."""
        return float(self._integrated(self.edges)[0].sum())

    def relief(self) -> FloatArray:
        """∫ (t_max − c)⁺ N_i ds of the hat functions N_i of the places (p,): what dilatant slip saves."""
        count, middle = len(self.places), _POINTS // 2
        low = np.maximum(self.edges[:, 0], self.places[:-1, None])
        high = np.minimum(self.edges[:, 1], self.places[1:, None])
        _, saved, s = self._integrated(np.stack([low, high], axis=-1)[low < high])
        at = np.searchsorted(self.places, s[:, middle]) - 1  # every piece lies between two places
        share = (s - self.places[at, None]) / np.diff(self.places)[at, None]
        first, second = (saved * (1.0 - share)).sum(axis=1), (saved * share).sum(axis=1)
        return np.asarray(np.bincount(at, first, count) + np.bincount(at + 1, second, count))

    def _integrated(self, pieces: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Bound of shear, (t_max − c)⁺, both times weights, and places (n, q) of Gauss points in pieces (n, 2).

        Where a rule on the piece and on its parts differ, the functions are replaced by affine ones on small parts: the
        bound of shear by one that is not below its samples, what is saved by one that is not above them.
        """
        t, weights = gauss_legendre(_POINTS)
        uneven = self._uneven(pieces)
        bound, saved = self._limits(pieces, t)
        if uneven.any():
            parts = _parts(pieces[uneven], _PIECES**2)
            samples = self._limits(parts, np.linspace(0.0, 1.0, _SAMPLES + 1))
            above, below = _along(_above(samples[0], False), t), -_along(_above(-samples[1], False), t)
            pieces = np.concatenate([pieces[~uneven], parts])
            bound = np.concatenate([bound[~uneven], above])
            saved = np.concatenate([saved[~uneven], np.maximum(below, 0.0)])
        scaled = weights * np.diff(pieces, axis=1)
        return bound * scaled, saved * scaled, _along(pieces, t)

    def _uneven(self, pieces: FloatArray) -> BoolArray:
        """Pieces (n, 2) along which cohesion or cap are functions with jumps or kinks."""
        if not (callable(self.contact.cohesion) or callable(self.contact.shear_limit)):
            return np.zeros(len(pieces), dtype=bool)
        t, weights = gauss_legendre(_POINTS)
        found = np.zeros(len(pieces), dtype=bool)
        whole, divided = self._limits(pieces, t), self._limits(_parts(pieces, _PIECES), t)
        for values, finer in zip(whole, divided, strict=True):
            mean = (finer @ weights).reshape(-1, _PIECES).mean(axis=1)
            found |= np.abs(values @ weights - mean) > _SMOOTH * np.abs(finer).max(initial=0.0)
        return found

    def _limits(self, pieces: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Bound of shear without opening, and (t_max − c)⁺, at the points t (q,) of pieces: (n, q) each."""
        s = _along(pieces, t)
        x, y = self.points(s.ravel()).T.reshape(2, *s.shape)
        cohesion = evaluate("Contact.cohesion", self.contact.cohesion, x, y, minimum=0.0)
        if self.contact.shear_limit is None:
            return cohesion, np.zeros(s.shape)
        cap = evaluate("Contact.shear_limit", self.contact.shear_limit, x, y, minimum=0.0)
        bound = cap if (self.friction > 0.0).any() else np.minimum(cohesion, cap)
        return bound, np.maximum(cap - cohesion, 0.0)


@dataclass(frozen=True, eq=False)
class ArcPiece(Line):
    """A piece of an arc, with the position s along it; `tangent` and `normal` are those of the edge's chord.

    Along a piece that turns by little w and [v]_T of a rigid motion are polynomials but for rounding. They are nowhere
    below the least, or above the largest, of their Bernstein coefficients: what is proved with these stays proved.
    """

    edge: Edges
    vertices: FloatArray  # (v, 2): coordinates of all vertices [length]
    begin: float  # begin, length: where on the edge the piece begins, and its length [length]
    length: float

    def points(self, s: FloatArray) -> FloatArray:
        """Coordinates (p, 2) of places."""
        return np.asarray(points_along(self.vertices, self.edge, self._shares(s))[0])

    def directions(self, vector: FloatArray, s: FloatArray) -> FloatArray:
        """Normal or tangent of the chord, turned to places, (p, 2)."""
        return np.asarray(vectors_along(self.edge, vector[None], self._shares(s))[0])

    def opening(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of the coefficients of w."""
        return np.asarray(-bernstein.from_values(_DEGREE) @ self._samples(bodies, self.normal))

    def slips(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of the coefficients of [v]_T."""
        return np.asarray(bernstein.from_values(_DEGREE) @ self._samples(bodies, self.tangent))

    def divided(self, s: float) -> "ArcPiece":
        """The piece as it is: it is small."""
        del s
        return self

    def relief(self) -> FloatArray:
        """∫ (t_max − c)⁺ B_i ds (p,): what slip saves that dilates with these coefficients."""
        _, saved, s = self._integrated(self.edges)
        return np.asarray(saved.ravel() @ bernstein.basis(_DEGREE, s.ravel() / self.length))

    def _shares(self, s: FloatArray) -> FloatArray:
        return np.asarray((self.begin + s) / self.edge.length[0])

    def _samples(self, bodies: Bodies, vector: FloatArray) -> FloatArray:
        return self._relative(bodies, bernstein.nodes(_DEGREE) * self.length, vector)


def _along(ends: FloatArray, t: FloatArray) -> FloatArray:
    """Affine functions (n, q) at points t from their values at both ends (n, 2)."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * t)


def _parts(pieces: FloatArray, count: int) -> FloatArray:
    """Pieces (n, 2) divided into equal parts, (n · count, 2)."""
    marks = _along(pieces, np.linspace(0.0, 1.0, count + 1))
    return np.stack([marks[:, :-1].ravel(), marks[:, 1:].ravel()], axis=1)


def lines(problem: ContactProblem, bodies: Bodies) -> tuple[Line, ...]:
    """The lines of all contacts; a joint inside one block parts nothing, and has none."""
    return tuple(line for contact in problem.contacts for line in _of_contact(problem, bodies, contact))


def _of_contact(problem: ContactProblem, bodies: Bodies, contact: Contact) -> Iterator[Line]:
    edges = problem.mesh.edges(contact.edges)
    first = bodies.of_cells[edges.cells[:, 0]]
    joint = contact in problem.joints
    second = bodies.of_cells[edges.cells[:, 1]] if joint else np.full(len(edges), bodies.number(contact))
    for pair in np.unique(np.column_stack([first, second]), axis=0):
        if pair[0] != pair[1]:
            chosen, between = edges.take((first == pair[0]) & (second == pair[1])), (int(pair[0]), int(pair[1]))
            straight = chosen.take(~chosen.bent)
            for group in _straight(problem, straight):
                yield _line(problem, contact, between, straight.take(group))
            yield from _arc_pieces(problem, contact, between, chosen.take(chosen.bent))


def _arc_pieces(problem: ContactProblem, contact: Contact, pair: tuple[int, int], edges: Edges) -> Iterator[ArcPiece]:
    """Arcs in pieces of which each turns by little."""
    vertices, ends = problem.mesh.vertices, np.linspace(0.0, 1.0, _SAMPLES + 1)
    for number in range(len(edges)):
        edge = edges.take(np.array([number]))
        turn = np.abs(np.diff(angles(edge.bend, ends))).max() * _SAMPLES  # at the place where it is bent most
        count = max(1, math.ceil(turn / _TURN))
        length = float(edge.length[0]) / count
        for piece in range(count):
            bare = ArcPiece(
                contact, pair, vertices[edge.first[0]], edge.tangent[0], edge.normal[0], np.array([[0.0, length]]),
                np.linspace(0.0, length, _DEGREE + 1), np.zeros(_DEGREE + 1), False, False,
                edge, vertices, piece * length, length,
            )  # fmt: skip
            if callable(contact.friction):
                x, y = bare.points(ends * length).T
                mu = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0).max()
            else:
                mu = contact.friction
            yield _with_law(bare, bare.places, np.full(_DEGREE + 1, float(mu)))


def _straight(problem: ContactProblem, edges: Edges) -> Iterator[IntArray]:
    """Edges that lie on one straight line and face one way, in groups: a line does not depend on how it is divided."""
    vertices = problem.mesh.vertices
    ends = np.stack([vertices[edges.first], vertices[edges.second]], axis=1)
    size, waiting = float(np.abs(vertices).max()), np.ones(len(edges), dtype=bool)
    while waiting.any():
        longest = int(np.argmax(np.where(waiting, edges.length, 0.0)))
        normal, length = edges.normal[longest], edges.length[longest]
        away = ends - ends[longest, 0]
        reach = 1.0 + np.hypot(*np.moveaxis(away, -1, 0)).max(axis=1) / length
        near = np.abs(away @ normal).max(axis=1) <= _ROUNDING * size * reach
        group = waiting & near & (edges.normal @ normal > 0.0)
        group[longest] = True
        waiting &= ~group
        yield np.flatnonzero(group)


def _line(problem: ContactProblem, contact: Contact, pair: tuple[int, int], edges: Edges) -> Line:
    vertices, longest = problem.mesh.vertices, int(np.argmax(edges.length))
    ends = vertices[np.concatenate([edges.first, edges.second])]
    along = ends @ edges.tangent[longest]
    start, stop = ends[np.argmin(along)], ends[np.argmax(along)]
    tangent = (stop - start) / np.hypot(*(stop - start))
    normal = np.array([-tangent[1], tangent[0]])
    normal = normal if normal @ edges.normal[longest] > 0.0 else -normal
    marks = (np.stack([vertices[edges.first], vertices[edges.second]], axis=1) - start) @ tangent
    bare = Line(contact, pair, start, tangent, normal, marks, np.empty(0), np.empty(0), False, False)
    return _with_law(bare, *_conditions(bare))


def _with_law(bare: _AnyLine, places: FloatArray, friction: FloatArray) -> _AnyLine:
    """The line with the places where conditions hold, μ there, and what its law fixes."""
    contact, rough = bare.contact, bool((friction > 0.0).any())
    held = contact.law == "tied" or (contact.law == "bilateral" and rough and contact.shear_limit is None)
    return replace(bare, places=places, friction=friction, fixed=contact.law != "unilateral", held=held)


def _conditions(line: Line) -> tuple[FloatArray, FloatArray]:
    """Places where w ≥ μ |[v]_T| is asked for, and μ there, which is nowhere below the contact's own."""
    contact, low, high = line.contact, float(line.edges.min()), float(line.edges.max())
    if not callable(contact.friction):
        count = _CAPPED_PIECES if contact.shear_limit is not None and contact.friction > 0.0 else 1
        places = np.linspace(low, high, count + 1)
        return places, np.full(len(places), float(contact.friction))
    pieces = _parts(line.edges, _PIECES)
    s = _along(pieces, np.linspace(0.0, 1.0, _SAMPLES + 1))
    points = line.points(s.ravel())
    values = evaluate("Contact.friction", contact.friction, *points.T, minimum=0.0).reshape(s.shape)
    above = _above(values, bool(contact.shear_limit is not None))
    places, index = np.unique(pieces.ravel(), return_inverse=True)
    friction = np.zeros(len(places))
    np.maximum.at(friction, index, above.ravel())
    return places, friction


def _above(values: FloatArray, constant: BoolArray | bool) -> FloatArray:
    """End values (n, 2) of affine functions that are not below samples (n, q): the chord, lifted, or the largest."""
    ends, largest = values[:, [0, -1]], values.max(axis=1)[:, None]
    chord = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, values.shape[1])
    lift = np.maximum(values - chord, 0.0).max(axis=1)[:, None]
    flat = constant | (lift > 0.25 * np.abs(np.diff(ends, axis=1)))  # a jump, or a hump
    return np.asarray(np.where(flat, largest, ends + lift))
