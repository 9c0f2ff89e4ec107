"""What can move as a rigid body, the work loads do on it, and where bodies touch.

Bodies are the blocks that joints separate, and plates driven by force. The motion of body k is
u(x) = (a − θ (y − y_k)/r_k,  b + θ (x − x_k)/r_k): its three numbers have one unit, and r_k is the distance of its
farthest point from (x_k, y_k). The body force b = −∇φ does the work −∮ φ n·u ds on it, around each block. A fluid in a
contact presses on both sides, and does the work −∫ p_w [v]_N ds there; what the contact law limits is the rest,
σ_N' = σ_N + p_w. Integrals are those that stresses take of the same data.

With [v] = v of the first body less that of the second (or of the obstacle), n from the first to the second and
w = −[v]_N the speed of opening, tractions do at most the work ∫ π([v]) ds against [v]:

| law                            | condition                    | ∫ π ds                                     |
|--------------------------------|------------------------------|--------------------------------------------|
| unilateral, μ = 0              | w ≥ 0                        | ∫ min(c, t_max) ds · |[v]_T|               |
| unilateral, no cap             | w ≥ μ |[v]_T|                | ∫ c ds · |[v]_T|                           |
| unilateral, capped             | w ≥ μ a,  0 ≤ a ≤ |[v]_T|    | ∫ t_max ds · |[v]_T| − ∫ (t_max − c)⁺ a ds |
| bilateral, μ = 0               | w = 0                        | as unilateral                              |
| bilateral, capped              | w = 0                        | ∫ t_max ds · |[v]_T|                       |
| bilateral with friction, tied  | w = 0, [v]_T = 0             | 0                                          |

Where μ is a function it is replaced on short pieces of edges by the least affine function that is not below its samples
there and has the slope of the chord: π becomes larger, and what it proves stays proved.

In `docs/theory.md`: (D23).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.element.edge import adapted, bernstein_basis, bernstein_from_values, constant, lobatto_points
from qvi_contact.mesh.edges import Edges, angles, frames_along, points_along, vectors_along
from qvi_contact.problem.conditions import Contact, Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.linked import linked

BODY = "body"
"""What the body force is called among the loads; of several, all of them together."""
FLUID = "pore pressure"
"""What the fluids in contacts are called among the loads."""
_NO_WORK = 1e-13  # share of a load's size below which a resultant is rounding
_PIECES: Final = 8  # of an edge, where friction is a function
_SAMPLES: Final = 8  # steps in each of them
_POINTS: Final = 8  # Gauss points where cohesion and cap are integrated
_ROUNDING: Final = 16.0 * np.finfo(float).eps
_SAME: Final = 1e-9  # share of a line within which two places are one
_CAPPED_PIECES: Final = 4  # of a line, where a cap lets part of the slip dilate
_NEARER: Final = 0.25 ** np.arange(1.0, 7.0)  # shares of the way to the next place, where more are tried
_TURN: Final = 0.02  # angle by which a piece of an arc turns at most [rad]
_DEGREE: Final = 4  # of motions along such a piece: what is left is rounding

Frame: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Points [length], normals and tangents (p, 2) at positions s (p,) along a line."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """Blocks, and after them the plates."""

    of_cells: IntArray  # (cells,): the block that each cell belongs to
    blocks: int  # number of blocks
    plates: tuple[str, ...]  # names of the contacts whose plates are driven by force
    centre: FloatArray  # (x_k, y_k), and r_k (k,) [length]
    size: FloatArray
    # (k, 3): which numbers of a motion may differ from zero: all of blocks, those of a plate that have a given force
    free: BoolArray

    def __len__(self) -> int:
        return len(self.size)

    @classmethod
    def of(cls, problem: ContactProblem) -> "Bodies":
        """The bodies of a problem."""
        mesh, of_cells = problem.mesh, blocks_of_cells(problem)
        blocks = int(of_cells.max()) + 1
        centre, size, free = [], [], [np.ones(3, dtype=bool)] * blocks
        for block in range(blocks):
            corners = mesh.vertices[np.unique(mesh.cells[of_cells == block])]
            centre.append((corners.min(axis=0) + corners.max(axis=0)) / 2.0)
            size.append(np.hypot(*(corners - centre[-1]).T).max())
        driven = [(contact, contact.plate) for contact in problem.contacts if contact.plate is not None]
        for contact, plate in driven:
            edges = mesh.edges(contact.edges)
            ends = mesh.vertices[np.concatenate([edges.first, edges.second])]
            centre.append(np.array(plate.reference(*ends.mean(axis=0))))
            size.append(np.hypot(*(ends - centre[-1]).T).max())
            free.append(np.array([part is not None for part in (plate.force_x, plate.force_y, plate.moment)]))
        names = tuple(contact.name for contact, _ in driven)
        return cls(of_cells, blocks, names, np.array(centre), np.array(size), np.array(free))

    def rows(self, body: IntArray, points: FloatArray, direction: FloatArray) -> FloatArray:
        """Rows (n, 3 k) of the velocities d·u of bodies (n,) at points (n, 2) along d (n, 2); zero for body −1."""
        found = np.zeros((len(body), len(self), 3))
        known = np.flatnonzero(body >= 0)
        at = body[known]
        arm, along = points[known] - self.centre[at], direction[known]
        turn = (arm[:, 0] * along[:, 1] - arm[:, 1] * along[:, 0]) / self.size[at]
        found[known, at] = np.column_stack([along, turn])
        return found.reshape(len(body), 3 * len(self))

    def number(self, contact: Contact) -> int:
        """The body that drives the obstacle of a contact; −1 for one that stands still."""
        return self.blocks + self.plates.index(contact.name) if contact.name in self.plates else -1

    def beside(self, edges: Edges, contact: Contact | None = None) -> tuple[IntArray, IntArray]:
        """The bodies (n,) on the first side of edges, and beyond: the obstacle of a contact on the boundary, or −1."""
        first, second = edges.cells.T
        obstacle = -1 if contact is None else self.number(contact)
        return self.of_cells[first], np.where(second < 0, obstacle, self.of_cells[second])


def blocks_of_cells(problem: ContactProblem) -> IntArray:
    """The block (cells,) of each cell: cells hang together across all edges but those of joints that are not tied."""
    first, second = whole_edges(problem).cells.T
    return linked(first, second, problem.mesh.cell_count)


def whole_edges(problem: ContactProblem) -> Edges:
    """Edges inside the body but those of joints that are not tied."""
    cut = np.zeros(len(problem.mesh.interior), dtype=bool)
    for joint in problem.joints:
        cut[problem.mesh.joint_set(joint.edges)] |= joint.law != "tied"
    return problem.mesh.interior.take(~cut)


@dataclass(frozen=True, eq=False)
class Work:
    """What one load does on motions."""

    row: FloatArray  # (3 k,): work [stress × length] of the motions of all bodies: forces, and moments over r_k
    # the largest work that the load could do on motions of size 1 if nothing of it cancelled [stress × length]
    size: float


def works(problem: ContactProblem, bodies: Bodies) -> dict[str, Work]:
    """Works of tractions, plates, body force and fluids by the names a limit analysis gives them."""
    rows, sizes = dict[str, FloatArray](), dict[str, float]()
    for name, row, size in _acting(problem, bodies):
        rows[name], sizes[name] = rows.get(name, 0.0) + row, sizes.get(name, 0.0) + size
    return {name: Work(np.where(np.abs(row) > _NO_WORK * sizes[name], row, 0.0), sizes[name])
            for name, row in rows.items()}  # fmt: skip


def _acting(problem: ContactProblem, bodies: Bodies) -> Iterator[tuple[str, FloatArray, float]]:
    """Parts of what each load does: its name, row and size of the work."""
    mesh = problem.mesh
    for given in problem.prescribed(Traction):
        if isinstance(given.condition, Traction):  # nothing acts along lines of symmetry
            acting = given.direction, given.name, given.value
            own = bodies.beside(given.edges)[:1]
            yield given.condition.name, *_along(problem, bodies, given.edges, own, *acting, turns=given.turns)
    for contact in problem.contacts:
        if (plate := contact.plate) is not None:
            body, row = bodies.number(contact), np.zeros((len(bodies), 3))
            moment = 0.0 if plate.moment is None else plate.moment_about(*bodies.centre[body]) / bodies.size[body]
            row[body] = plate.force_x or 0.0, plate.force_y or 0.0, moment
            yield contact.name, row.ravel(), float(np.abs(row).sum())
    first, second = bodies.of_cells[mesh.interior.cells].T
    joints = mesh.interior.take(first != second)  # of edges inside the body only those between two blocks count
    for name, field in problem.body_forces.items():
        if callable(field):  # else no force
            for edges, sides in ((mesh.boundary, 1), (joints, 2)):
                acting = -edges.normal, "ContactProblem.body_potential", field
                yield name, *_along(problem, bodies, edges, bodies.beside(edges)[:sides], *acting)
    for contact in problem.contacts:
        if contact.has_fluid:  # −∫ p_w n·v ds on the first body, and the opposite on the second, or on the plate
            edges = mesh.edges(contact.edges)
            acting = -edges.normal, "Contact.pore_pressure", contact.pore_pressure
            yield FLUID, *_along(problem, bodies, edges, bodies.beside(edges, contact), *acting)


def _along(
    problem: ContactProblem,
    bodies: Bodies,
    edges: Edges,
    sides: Sequence[IntArray],
    direction: FloatArray,
    name: str,
    field: Field,
    *,
    turns: bool = True,
) -> tuple[FloatArray, float]:
    """∫ f d·u ds of a field f on edges along d (n, 2), for the bodies (n,) of one side, or less that of the other.

    D turns along arcs, or does not.
    """
    found = along_edges(problem.mesh, edges, name, field)
    parts, weights = edges.take(found.edge), found.values * found.weights * edges.length[found.edge, None]
    along = vectors_along(parts, direction[found.edge], found.t, turns=turns)
    points = np.stack(problem.mesh.points_along(parts, found.t), axis=-1)
    row = np.zeros((len(bodies), 3))
    for sign, side in zip((1.0, -1.0), sides, strict=False):
        body = side[found.edge]
        arms = points - bodies.centre[body, None]
        turning = (arms[..., 0] * along[..., 1] - arms[..., 1] * along[..., 0]) / bodies.size[body, None]
        work = (np.concatenate([along, turning[..., None]], axis=-1) * weights[..., None]).sum(axis=1)
        np.add.at(row, body[body >= 0], sign * work[body >= 0])
    return row.ravel(), len(sides) * float(np.abs(weights).sum())


@dataclass(frozen=True, eq=False)
class Line:
    """A line along which one contact holds between two bodies, with the position s: straight, or a piece of an arc.

    Along a piece of an arc that turns by little w and [v]_T of a rigid motion are polynomials but for rounding. They
    are nowhere below the least, or above the largest, of their Bernstein coefficients: what is proved with these stays
    proved.
    """

    contact: Contact
    bodies: tuple[int, int]  # the first body, and the second; −1 for an obstacle that stands still
    frame: Frame
    edges: FloatArray  # (n, 2): where its edges begin and end [length]
    arc: bool  # whether it is a piece of one
    # places, friction, (p,) each: where values of w are taken or the condition holds, ascending, and μ there
    places: FloatArray
    friction: FloatArray

    @classmethod
    def of(cls, contact: Contact, bodies: tuple[int, int], frame: Frame, edges: FloatArray, *, arc: bool) -> "Line":
        """With places where w ≥ μ |[v]_T| is asked for, and μ there, which is nowhere below the contact's own."""
        mu, capped = contact.friction, contact.shear_limit is not None
        if callable(mu):
            marks = _between(edges, np.linspace(0.0, 1.0, 2 if arc else _PIECES + 1))
            pieces = np.stack([marks[:, :-1].ravel(), marks[:, 1:].ravel()], axis=1)
            s = _between(pieces, np.linspace(0.0, 1.0, _SAMPLES + 1))
            values = evaluate("Contact.friction", mu, *frame(s.ravel())[0].T, minimum=0.0).reshape(s.shape)
            if not arc:
                places, index = np.unique(pieces.ravel(), return_inverse=True)
                friction = np.zeros(len(places))
                np.maximum.at(friction, index, _above(values, capped).ravel())
                return cls(contact, bodies, frame, edges, arc, places, friction)
            mu = float(values.max())
        count = _CAPPED_PIECES if capped and mu else 1
        places = edges.max() * lobatto_points(_DEGREE) if arc else np.linspace(edges.min(), edges.max(), count + 1)
        return cls(contact, bodies, frame, edges, arc, places, np.full(len(places), float(mu)))

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

    def _relative(self, bodies: Bodies, s: FloatArray, *, tangent: bool) -> FloatArray:
        """Rows (p, 3 k) of [v]_N or [v]_T at places s; of an arc of their coefficients, whatever s is."""
        points, *along = self.frame(self.places if self.arc else s)
        first, second = (bodies.rows(np.full(len(points), body), points, along[tangent]) for body in self.bodies)
        return np.asarray(bernstein_from_values(_DEGREE) @ (first - second)) if self.arc else first - second

    def opening(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of w at the places, of an arc of the coefficients of w."""
        return -self._relative(bodies, self.places, tangent=False)

    def slips(self, bodies: Bodies) -> FloatArray:
        """Rows (r, 3 k) of which the largest is |[v]_T| anywhere, or more: one where it is constant."""
        return self._relative(bodies, self.places[:1], tangent=True)

    def slip(self, bodies: Bodies, v: FloatArray) -> float:
        """The largest |[v]_T| of motions v, or more."""
        return float(np.abs(self.slips(bodies) @ v).max())

    def fixed_rows(self, bodies: Bodies) -> FloatArray:
        """Rows (e, 3 k) of the velocities that a line whose bodies do not part, or do not slip either, rules out."""
        ruled_out = [False] * self.fixed + [True] * self.held
        rows = [self._relative(bodies, self.places[[0, -1]], tangent=tangent) for tangent in ruled_out]
        return np.concatenate([np.zeros((0, 3 * len(bodies))), *rows])

    def divided(self, s: float) -> "Line":
        """The line with one more place, where μ is the larger of its neighbours'; pieces of arcs are small."""
        at = int(np.searchsorted(self.places, s))
        known = at in (0, len(self.places)) or np.abs(self.places - s).min() <= _SAME * np.ptp(self.places)
        if known or self.arc:
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
        for s in self.crossings(bodies, v) if self.capped and not self.arc else ():
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
        if self.arc:
            parts, s, error = self._integrated(self.edges, saved=True)
            return np.maximum(parts.ravel() @ bernstein_basis(_DEGREE, s.ravel() / self.edges[0, 1]) - error, 0.0)
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
            s = _between(pieces[piece], t)
            x, y = self.frame(s.ravel())[0].T.reshape(2, *s.shape)
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
        return parts, _between(pieces[found.edge], found.t), found.error * float(lengths.max())


def _between(ends: FloatArray, t: FloatArray) -> FloatArray:
    """Affine functions (n, q) at points t from their values at both ends (n, 2)."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * t)


def lines(problem: ContactProblem, bodies: Bodies) -> tuple[Line, ...]:
    """The lines of all contacts; a joint inside one block parts nothing, and has none."""
    vertices, found = problem.mesh.vertices, list[Line]()
    for contact in problem.contacts:
        edges = problem.mesh.edges(contact.edges)
        first, second = bodies.beside(edges, contact)
        for one, other in np.unique(np.column_stack([first, second]), axis=0).tolist():
            chosen = edges.take((first == one) & (second == other) & (one != other))
            straight, arcs = chosen.take(~chosen.bent), chosen.take(chosen.bent)
            for group in _straight(vertices, straight):
                found.append(Line.of(contact, (one, other), *_chord(vertices, straight.take(group)), arc=False))
            for number in range(len(arcs)):
                for piece in _pieces(vertices, arcs.take(np.array([number]))):
                    found.append(Line.of(contact, (one, other), *piece, arc=True))
    return tuple(found)


def _pieces(vertices: FloatArray, arc: Edges) -> Iterator[tuple[Frame, FloatArray]]:
    """An arc in pieces of which each turns by little."""
    turn = np.abs(np.diff(angles(arc.bend, np.linspace(0.0, 1.0, _SAMPLES + 1)))).max() * _SAMPLES  # where it is most
    count = max(1, math.ceil(turn / _TURN))
    length = float(arc.length[0]) / count
    for piece in range(count):

        def frame(s: FloatArray, piece: int = piece) -> tuple[FloatArray, FloatArray, FloatArray]:
            t = (piece * length + s) / arc.length
            normals, tangents = frames_along(arc, t)
            return points_along(vertices, arc, t)[0], normals[0], tangents[0]

        yield frame, np.array([[0.0, length]])


def _straight(vertices: FloatArray, edges: Edges) -> Iterator[IntArray]:
    """Edges that lie on one straight line and face one way, in groups: a line does not depend on how it is divided."""
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


def _chord(vertices: FloatArray, edges: Edges) -> tuple[Frame, FloatArray]:
    """The line of such edges, and where on it they are."""
    longest = int(np.argmax(edges.length))
    ends = vertices[np.concatenate([edges.first, edges.second])]
    along = ends @ edges.tangent[longest]
    start, stop = ends[np.argmin(along)], ends[np.argmax(along)]
    tangent = (stop - start) / np.hypot(*(stop - start))
    normal = np.array([-tangent[1], tangent[0]])
    normal = normal if normal @ edges.normal[longest] > 0.0 else -normal

    def frame(s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return start + s[:, None] * tangent, np.tile(normal, (len(s), 1)), np.tile(tangent, (len(s), 1))

    return frame, ((ends - start) @ tangent).reshape(2, -1).T


def _above(values: FloatArray, constant: BoolArray | bool) -> FloatArray:
    """End values (n, 2) of affine functions that are not below samples (n, q): the chord, lifted, or the largest."""
    ends, largest = values[:, [0, -1]], values.max(axis=1)[:, None]
    chord = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, values.shape[1])
    lift = np.maximum(values - chord, 0.0).max(axis=1)[:, None]
    flat = constant | (lift > 0.25 * np.abs(np.diff(ends, axis=1)))  # a jump, or a hump
    return np.asarray(np.where(flat, largest, ends + lift))
