"""Where bodies touch: straight lines between two of them, and what the contact laws let them do there.

With [v] = v of the first body less that of the second (or of the obstacle), n from the first to the second and
w = −[v]_N the speed of opening, the tractions of a contact do at most the work

    π([v]) = sup { −σ_N [v]_N − σ_T [v]_T :  σ_N ≤ 0,  |σ_T| ≤ min(c − μσ_N, t_max) }
           = min { min(c, t_max) a + t_max (|[v]_T| − a) :  0 ≤ a ≤ |[v]_T|,  μ a ≤ w }          if w ≥ 0, else ∞

against it. Without a cap this is c |[v]_T| if w ≥ μ |[v]_T|, and infinite if not. Along a straight line [v]_T of two
rigid bodies is constant and w linear, so that conditions at the ends of the line are enough where μ is constant.

Where μ is a function it is replaced on short pieces of edges by the least affine function that is not below its samples
there and has the slope of the chord: π becomes larger, and what it proves stays proved. Integrals of c and t_max are
taken on parts where these jump or bend, as far as samples show it, and what is left as their error makes π larger.

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
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.element import bernstein
from qvi_contact.element.quadrature import adapted, constant
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import Edges, angles, points_along, vectors_along
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem

_PIECES: Final = 8  # of an edge, where friction is a function
_SAMPLES: Final = 8  # steps in each of them
_POINTS: Final = 8  # Gauss points where cohesion and cap are integrated
_ROUNDING: Final = 16.0 * np.finfo(float).eps
_SAME: Final = 1e-9  # share of a line within which two places are one
_CAPPED_PIECES: Final = 4  # of a line, where a cap lets part of the slip dilate
_NEARER: Final = 0.25 ** np.arange(1.0, 7.0)  # shares of the way to the next place, where more are tried
_TURN: Final = 0.02  # angle by which a piece of an arc turns at most [rad]
_DEGREE: Final = 4  # of motions along such a piece: what is left is rounding


@dataclass(frozen=True, eq=False)
class Line:
    """A line along which one contact holds between two bodies, with the position s: straight, or a piece of an arc.

    Along a piece of an arc that turns by little w and [v]_T of a rigid motion are polynomials but for rounding. They
    are nowhere below the least, or above the largest, of their Bernstein coefficients: what is proved with these stays
    proved.
    """

    contact: Contact
    bodies: tuple[int, int]  # the first body, and the second; −1 for an obstacle that stands still
    start: FloatArray  # start, tangent, normal, (2,) each: the point s = 0 [length], unit vectors of line or chord
    tangent: FloatArray
    normal: FloatArray
    edges: FloatArray  # (n, 2): where its edges begin and end [length]
    arc: Edges | None = None  # the edge of which it is a piece
    vertices: FloatArray | None = None  # (v, 2): coordinates of all vertices of the mesh then [length]
    begin: float = 0.0  # where on the edge the piece begins [length]
    # places, friction, (p,) each: where values of w are taken or the condition holds, ascending, and μ there
    places: FloatArray = field(default_factory=lambda: np.zeros(0))
    friction: FloatArray = field(default_factory=lambda: np.zeros(0))

    @property
    def fixed(self) -> bool:
        """Whether the bodies do not part, w = 0."""
        return self.contact.law != "unilateral"

    @property
    def rough(self) -> bool:
        """Whether there is friction."""
        return bool((self.friction > 0.0).any())

    @property
    def held(self) -> bool:
        """Whether the bodies do not slip either."""
        sticks = self.contact.law == "bilateral" and self.rough and self.contact.shear_limit is None
        return self.contact.law == "tied" or sticks

    @property
    def dilates(self) -> bool:
        """Whether slip takes opening: a unilateral contact with friction."""
        return not self.fixed and self.rough

    @property
    def capped(self) -> bool:
        """Whether only part of the slip has to dilate."""
        return self.dilates and self.contact.shear_limit is not None

    def points(self, s: FloatArray) -> FloatArray:
        """Coordinates (p, 2) of places."""
        if self.arc is None or self.vertices is None:
            return np.asarray(self.start + s[:, None] * self.tangent)
        return np.asarray(points_along(self.vertices, self.arc, (self.begin + s) / self.arc.length)[0])

    def _relative(self, bodies: Bodies, s: FloatArray, vector: FloatArray) -> FloatArray:
        """Rows (p, 3 k) of d·[v] at places, with d the normal or tangent there."""
        points, along = self.points(s), np.broadcast_to(vector, (len(s), 2))
        if self.arc is not None:
            along = vectors_along(self.arc, vector[None], (self.begin + s) / self.arc.length)[0]
        first, second = (np.full(len(points), body) for body in self.bodies)
        return bodies.rows(first, points, along) - bodies.rows(second, points, along)

    def opening(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of w at the places, of an arc of the coefficients of w."""
        rows = self._relative(bodies, self.places, -self.normal)
        return rows if self.arc is None else np.asarray(bernstein.from_values(_DEGREE) @ rows)

    def slips(self, bodies: Bodies) -> FloatArray:
        """Rows (r, 3 k) of which the largest is |[v]_T| anywhere, or more: one where it is constant."""
        if self.arc is None:
            return self._relative(bodies, np.zeros(1), self.tangent)
        return np.asarray(bernstein.from_values(_DEGREE) @ self._relative(bodies, self.places, self.tangent))

    def slip(self, bodies: Bodies, v: FloatArray) -> float:
        """The largest |[v]_T| of motions v, or more."""
        return float(np.abs(self.slips(bodies) @ v).max())

    def fixed_rows(self, bodies: Bodies) -> FloatArray:
        """Rows (e, 3 k) of the velocities that a line whose bodies do not part, or do not slip either, rules out."""
        places = self.places[[0, -1]] if self.arc is None else self.places
        vectors = [self.normal] * self.fixed + [self.tangent] * self.held
        rows = [self._relative(bodies, places, vector) for vector in vectors]
        return np.concatenate([np.zeros((0, 3 * len(bodies))), *rows])

    def divided(self, s: float) -> "Line":
        """The line with one more place, where μ is the larger of its neighbours'; pieces of arcs are small."""
        at = int(np.searchsorted(self.places, s))
        known = at in (0, len(self.places)) or np.abs(self.places - s).min() <= _SAME * np.ptp(self.places)
        if known or self.arc is not None:
            return self
        mu = self.friction[at - 1 : at + 1].max()
        return replace(self, places=np.insert(self.places, at, s), friction=np.insert(self.friction, at, mu))

    def crossings(self, bodies: Bodies, v: FloatArray) -> FloatArray:
        """Places where opening becomes too little for all of the slip to dilate."""
        spare = self.opening(bodies) @ v - self.friction * self.slip(bodies, v)
        before = np.flatnonzero((spare[:-1] * spare[1:] <= 0.0) & (spare[:-1] != spare[1:]))
        share = spare[before] / (spare[before] - spare[before + 1])
        return np.asarray(self.places[before] + share * np.diff(self.places)[before])

    def surrounded(self, bodies: Bodies, v: FloatArray) -> "Line":
        """The line with these places, and others closer and closer to them, where a cap sets in there."""
        line = self
        for s in self.crossings(bodies, v) if self.capped else ():
            at = int(np.argmin(np.abs(self.places - s)))
            beside = self.places[max(at - 1, 0) : at + 2, None]
            for place in [s, *(self.places[at] + (beside - self.places[at]) * _NEARER).ravel()]:
                line = line.divided(place)
        return line

    def resistance(self, bodies: Bodies, v: FloatArray) -> float:
        """∫ π ds for a motion that the line admits, exact up to the sampling of functions."""
        slip = self.slip(bodies, v)
        if self.held or slip == 0.0:
            return 0.0
        work = self.shear_work() * slip
        if not self.capped:
            return work
        line = self
        for s in self.crossings(bodies, v):
            line = line.divided(s)
        opening = np.maximum(line.opening(bodies) @ v, 0.0)
        dilatant = np.divide(opening, line.friction, out=np.full(len(opening), slip), where=line.friction > 0.0)
        return work - float(line.relief() @ np.minimum(dilatant, slip))

    def shear_work(self) -> float:
        """∫ π ds for a slip of 1 and no opening to spare: of t_max, of c, or of the smaller one."""
        parts, _, error = self._integrated(self.edges, saved=False)
        return float(parts.sum()) + error

    def relief(self) -> FloatArray:
        """∫ (t_max − c)⁺ N_i ds (p,) of the hat functions N_i of the places, or of B_i: what dilatant slip saves."""
        if self.arc is not None:
            parts, s, error = self._integrated(self.edges, saved=True)
            return np.maximum(parts.ravel() @ bernstein.basis(_DEGREE, s.ravel() / self.edges[0, 1]) - error, 0.0)
        count, middle = len(self.places), _POINTS // 2
        low = np.maximum(self.edges[:, 0], self.places[:-1, None])
        high = np.minimum(self.edges[:, 1], self.places[1:, None])
        parts, s, error = self._integrated(np.stack([low, high], axis=-1)[low < high], saved=True)
        at = np.searchsorted(self.places, s[:, middle]) - 1  # every part lies between two places
        share = (s - self.places[at, None]) / np.diff(self.places)[at, None]
        first, second = (parts * (1.0 - share)).sum(axis=1), (parts * share).sum(axis=1)
        found = np.bincount(at, first, count) + np.bincount(at + 1, second, count) - error
        return np.asarray(np.maximum(found, 0.0))

    def _integrated(self, pieces: FloatArray, *, saved: bool) -> tuple[FloatArray, FloatArray, float]:
        """Bound of shear without opening, or (t_max − c)⁺, in pieces (n, 2): parts of it, places, the error."""
        contact = self.contact

        def values(piece: IntArray, t: FloatArray) -> FloatArray:
            s = _along(pieces[piece], t)
            x, y = self.points(s.ravel()).T.reshape(2, *s.shape)
            cohesion = evaluate("Contact.cohesion", contact.cohesion, x, y, minimum=0.0)
            if contact.shear_limit is None:
                return cohesion
            cap = evaluate("Contact.shear_limit", contact.shear_limit, x, y, minimum=0.0)
            if saved:
                return np.maximum(cap - cohesion, 0.0)
            return cap if self.rough else np.minimum(cohesion, cap)

        if callable(contact.cohesion) or callable(contact.shear_limit):
            found = adapted(values, len(pieces), _POINTS)
        else:
            found = constant(values(np.zeros(1, dtype=np.int64), np.zeros((1, 1))).item(), len(pieces), _POINTS)
        lengths = np.diff(pieces, axis=1)
        parts = found.values * found.weights * lengths[found.edge]
        return parts, _along(pieces[found.edge], found.t), found.error * float(lengths.max())


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
                yield _with_places(_line(problem, contact, between, straight.take(group)))
            arcs = chosen.take(chosen.bent)
            for number in range(len(arcs)):
                yield from map(_with_places, _pieces(problem, contact, between, arcs.take(np.array([number]))))


def _pieces(problem: ContactProblem, contact: Contact, pair: tuple[int, int], arc: Edges) -> Iterator[Line]:
    """An arc in pieces of which each turns by little."""
    turn = np.abs(np.diff(angles(arc.bend, np.linspace(0.0, 1.0, _SAMPLES + 1)))).max() * _SAMPLES  # where it is most
    count, vertices = max(1, math.ceil(turn / _TURN)), problem.mesh.vertices
    length = float(arc.length[0]) / count
    frame = vertices[arc.first[0]], arc.tangent[0], arc.normal[0]
    for piece in range(count):
        yield Line(contact, pair, *frame, np.array([[0.0, length]]), arc, vertices, piece * length)


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
    return Line(contact, pair, start, tangent, normal, marks)


def _with_places(line: Line) -> Line:
    """The line with places where w ≥ μ |[v]_T| is asked for, and μ there, which is nowhere below the contact's own."""
    contact, mu, high = line.contact, line.contact.friction, float(line.edges.max())
    if callable(mu):
        pieces = _parts(line.edges, _PIECES) if line.arc is None else line.edges
        s = _along(pieces, np.linspace(0.0, 1.0, _SAMPLES + 1))
        values = evaluate("Contact.friction", mu, *line.points(s.ravel()).T, minimum=0.0).reshape(s.shape)
        if line.arc is None:
            above = _above(values, contact.shear_limit is not None)
            places, index = np.unique(pieces.ravel(), return_inverse=True)
            friction = np.zeros(len(places))
            np.maximum.at(friction, index, above.ravel())
            return replace(line, places=places, friction=friction)
        mu = float(values.max())
    count = _CAPPED_PIECES if contact.shear_limit is not None and mu > 0.0 else 1
    places = np.linspace(line.edges.min(), high, count + 1)
    if line.arc is not None:
        places = high * bernstein.nodes(_DEGREE)
    return replace(line, places=places, friction=np.full(len(places), float(mu)))


def _above(values: FloatArray, constant: BoolArray | bool) -> FloatArray:
    """End values (n, 2) of affine functions that are not below samples (n, q): the chord, lifted, or the largest."""
    ends, largest = values[:, [0, -1]], values.max(axis=1)[:, None]
    chord = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, values.shape[1])
    lift = np.maximum(values - chord, 0.0).max(axis=1)[:, None]
    flat = constant | (lift > 0.25 * np.abs(np.diff(ends, axis=1)))  # a jump, or a hump
    return np.asarray(np.where(flat, largest, ends + lift))
