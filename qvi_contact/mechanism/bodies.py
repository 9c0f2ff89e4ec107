"""Rigid bodies, the work of loads on their motions, and the lines along which they touch.

Bodies are the blocks that joints separate, and plates driven by force. The motion of body k is
u(x) = (a − θ (y − y_k)/r_k,  b + θ (x − x_k)/r_k) with the centre (x_k, y_k). The length r_k is the distance of the
body's farthest point from the centre, so that a, b and θ have one unit. The body force −∇φ does the work −∮ φ n·u ds,
around each block. A fluid in a contact presses on both sides, and does the work −∫ p_w [v]_N ds; the contact law limits
σ_N' = σ_N + p_w. The integrals of data are the same as those of the stress model.

Let [v] be the velocity of the first body less that of the second (or of the obstacle), n the normal from the first to
the second, and w = −[v]_N the speed of opening. Tractions do at most the work ∫ π([v]) ds against [v]:

| law                            | condition                    | ∫ π ds                                     |
|--------------------------------|------------------------------|--------------------------------------------|
| unilateral, μ = 0              | w ≥ 0                        | ∫ min(c, t_max) ds · |[v]_T|               |
| unilateral, no cap             | w ≥ μ |[v]_T|                | ∫ c ds · |[v]_T|                           |
| unilateral, capped             | w ≥ μ a,  0 ≤ a ≤ |[v]_T|    | ∫ t_max ds · |[v]_T| − ∫ (t_max − c)⁺ a ds |
| bilateral, μ = 0               | w = 0                        | as unilateral                              |
| bilateral, capped              | w = 0                        | ∫ t_max ds · |[v]_T|                       |
| bilateral with friction, tied  | w = 0, [v]_T = 0             | 0                                          |

A function μ is replaced on short pieces of edges by an affine function that is not below its samples: the chord,
raised. This makes π larger, so that all proofs remain valid.

In `docs/theory.md`: (D23).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.element.edge import adapted, bernstein_basis, bernstein_from_values, constant, lobatto_points
from qvi_contact.mesh.edges import Edges, angles, cross, frames_along, points_along, vectors_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Contact, Traction
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.linked import linked

BODY = "body"
"""Name among the loads of the sum of all body forces."""
FLUID = "pore pressure"
"""Name among the loads of the fluids in contacts."""
_NO_WORK = 1e-13  # resultant over the size of its load, up to which it is rounding
_PIECES: Final = 8  # pieces of an edge on which a function μ is replaced
_SAMPLES: Final = 8  # steps between samples of μ in a piece
_POINTS: Final = 8  # Gauss points for integrals of cohesion and cap
_ROUNDING: Final = 16.0 * np.finfo(float).eps  # of coordinates, relative, when edges are grouped to a straight line
_SAME: Final = 1e-9  # distance over the length of a line, up to which two places are the same
_CAPPED_PIECES: Final = 4  # first number of pieces of a line on which only part of the slip dilates, below a cap
_NEARER: Final = 0.25 ** np.arange(1.0, 7.0)  # distances of new places, over the distance to the next old place
_TURN: Final = 0.02  # largest angle by which a piece of an arc turns [rad]
_DEGREE: Final = 4  # degree of rigid motions along such a piece: higher terms are below rounding

Frame: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Points [length], normals and tangents (p, 2) at positions s (p,) along a line."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """All bodies: first the blocks, then the plates driven by force."""

    of_cells: IntArray  # (cells,): the block of each cell
    blocks: int  # number of blocks
    plates: tuple[str, ...]  # names of the contacts with such plates
    centre: FloatArray  # (k, 2): (x_k, y_k) [length]
    size: FloatArray  # (k,): r_k [length]
    # (k, 3): whether a, b, θ of each body may differ from zero: all of a block, of a plate those with a given force
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
        """Rows (n, 3 k) on all motions of the velocities d·u of bodies (n,) at points (n, 2); zero for body −1."""
        rows = np.zeros((len(body), len(self), 3))
        moving = np.flatnonzero(body >= 0)
        at = body[moving]
        arm, d = points[moving] - self.centre[at], direction[moving]
        rows[moving, at] = np.column_stack([d, cross(arm, d) / self.size[at]])
        return rows.reshape(len(body), 3 * len(self))

    def number(self, contact: Contact) -> int:
        """Number of the plate that is the obstacle of a contact; −1 for an obstacle at rest."""
        return self.blocks + self.plates.index(contact.name) if contact.name in self.plates else -1

    def beside(self, edges: Edges, contact: Contact | None = None) -> tuple[IntArray, IntArray]:
        """The bodies (n,) on the first and second side of edges; on the boundary the contact's plate, or −1."""
        first, second = edges.cells.T
        obstacle = -1 if contact is None else self.number(contact)
        return self.of_cells[first], np.where(second < 0, obstacle, self.of_cells[second])


def blocks_of_cells(problem: ContactProblem) -> IntArray:
    """The block of each cell (cells,): all inner edges link cells, except edges of joints that are not tied."""
    first, second = whole_edges(problem).cells.T
    return linked(first, second, problem.mesh.cell_count)


def whole_edges(problem: ContactProblem) -> Edges:
    """All edges inside the body, except edges of joints that are not tied."""
    cut = np.zeros(len(problem.mesh.interior), dtype=bool)
    for joint in problem.joints:
        cut[problem.mesh.joint_set(joint.edges)] |= joint.law != "tied"
    return problem.mesh.interior.take(~cut)


@dataclass(frozen=True, eq=False)
class Work:
    """The work of one load on rigid motions, per unit of thickness."""

    row: FloatArray  # (3 k,): resultant forces on all bodies, and moments over r_k [stress × length]
    # the integral of the load's magnitude, a bound of its work on motions of size 1 [stress × length]
    size: float


def works(problem: ContactProblem, bodies: Bodies) -> dict[str, Work]:
    """Works of tractions, plates, body forces and fluids by the names of loads in a limit analysis."""
    rows, sizes = dict[str, FloatArray](), dict[str, float]()
    for name, row, size in _acting(problem, bodies):
        rows[name], sizes[name] = rows.get(name, 0.0) + row.ravel(), sizes.get(name, 0.0) + size
    return {name: Work(np.where(np.abs(row) > _NO_WORK * sizes[name], row, 0.0), sizes[name])
            for name, row in rows.items()}  # fmt: skip


def _acting(problem: ContactProblem, bodies: Bodies) -> Iterator[tuple[str, FloatArray, float]]:
    """Parts of the works of loads: name, row (k, 3) and size; several parts may have one name."""
    mesh = problem.mesh
    for given in problem.prescribed(Traction):
        if isinstance(given.condition, Traction):  # the zero shear on a line of symmetry is no load
            loaded = bodies.beside(given.edges)[:1]
            parts = _along(mesh, bodies, given.edges, loaded, given.direction, given.name, given.value, given.turns)
            yield given.condition.name, *parts
    for contact in problem.contacts:
        if (plate := contact.plate) is not None:
            body, row = bodies.number(contact), np.zeros((len(bodies), 3))
            moment = 0.0 if plate.moment is None else plate.moment_about(*bodies.centre[body]) / bodies.size[body]
            row[body] = plate.force_x or 0.0, plate.force_y or 0.0, moment
            yield contact.name, row, float(np.abs(row).sum())
    first, second = bodies.of_cells[mesh.interior.cells].T
    joints = mesh.interior.take(first != second)  # around each block: the boundary, and joints between two blocks
    for name, field in problem.body_forces.items():
        if callable(field):  # a constant potential has no force
            for edges, count in ((mesh.boundary, 1), (joints, 2)):
                beside, acting = bodies.beside(edges)[:count], "ContactProblem.body_potential"
                yield name, *_along(mesh, bodies, edges, beside, -edges.normal, acting, field)
    for contact in problem.contacts:
        if contact.has_fluid:  # −∫ p_w n·v ds on the first body, and the opposite on the second, or on the plate
            edges = mesh.edges(contact.edges)
            sides, pressure = bodies.beside(edges, contact), contact.pore_pressure
            yield FLUID, *_along(mesh, bodies, edges, sides, -edges.normal, "Contact.pore_pressure", pressure)


def _along(
    mesh: TriangleMesh, bodies: Bodies, edges: Edges, sides: Sequence[IntArray], direction: FloatArray, name: str,
    field: Field, turns: bool = True,
) -> tuple[FloatArray, float]:  # fmt: skip
    """Row and size of ∫ f d·u ds of a field f along edges, with directions d (n, 2) that turn on arcs if `turns`.

    u is the motion of the bodies (n,) on the first side, less that on the second side if `sides` has two.
    """
    f = along_edges(mesh, edges, name, field)
    parts, weights = edges.take(f.edge), f.values * f.weights * edges.length[f.edge, None]
    vectors = vectors_along(parts, direction[f.edge], f.t, turns=turns)
    points, row = np.stack(mesh.points_along(parts, f.t), axis=-1), np.zeros((len(bodies), 3))
    for sign, side in zip((1.0, -1.0), sides, strict=False):
        body = side[f.edge]
        turning = cross(points - bodies.centre[body, None], vectors) / bodies.size[body, None]
        work = (np.concatenate([vectors, turning[..., None]], axis=-1) * weights[..., None]).sum(axis=1)
        np.add.at(row, body[body >= 0], sign * work[body >= 0])
    return row, len(sides) * float(np.abs(weights).sum())


@dataclass(frozen=True, eq=False)
class Line:
    """A line of contact between two bodies with the position s along it: straight, or a short piece of an arc.

    Along a short piece of an arc w and [v]_T of a rigid motion are polynomials, up to rounding. Their Bernstein
    coefficients bound them from both sides, so that proofs with coefficients hold on the whole piece.
    """

    contact: Contact
    bodies: tuple[int, int]  # the first and the second body; −1 for an obstacle at rest
    frame: Frame
    edges: FloatArray  # (n, 2): positions s of both ends of its edges [length]
    arc: bool  # whether it is a piece of an arc
    places: FloatArray  # (p,): ascending positions s where the conditions on w are imposed [length]
    friction: FloatArray  # (p,): μ there

    @classmethod
    def of(cls, contact: Contact, bodies: tuple[int, int], frame: Frame, edges: FloatArray, *, arc: bool) -> "Line":
        """The line with its places, and a μ there whose interpolation is nowhere below the contact's own μ."""
        mu, capped = contact.friction, contact.shear_limit is not None
        if callable(mu):
            marks = _between(edges, np.linspace(0.0, 1.0, 2 if arc else _PIECES + 1))
            pieces = np.stack([marks[:, :-1].ravel(), marks[:, 1:].ravel()], axis=1)
            s = _between(pieces, np.linspace(0.0, 1.0, _SAMPLES + 1))
            values: FloatArray = evaluate("Contact.friction", mu, *frame(s.ravel())[0].T, minimum=0.0).reshape(s.shape)
            if not arc:
                places, index = np.unique(pieces.ravel(), return_inverse=True)
                friction = np.zeros(len(places))
                # of affine functions not below the samples of a piece, the raised chord, or a constant
                ends, largest = values[:, [0, -1]], values.max(axis=1)[:, None]
                chord = ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, values.shape[1])
                lift = np.maximum(values - chord, 0.0).max(axis=1)[:, None]
                flat = capped | (lift > 0.25 * np.abs(np.diff(ends, axis=1)))  # or samples have a jump or a hump
                np.maximum.at(friction, index, np.where(flat, largest, ends + lift).ravel())
                return cls(contact, bodies, frame, edges, arc, places, friction)
            mu = float(values.max())
        count = _CAPPED_PIECES if capped and mu else 1
        places = edges.max() * lobatto_points(_DEGREE) if arc else np.linspace(edges.min(), edges.max(), count + 1)
        return cls(contact, bodies, frame, edges, arc, places, np.full(len(places), float(mu)))

    @property
    def fixed(self) -> bool:
        """Whether the line cannot open: w = 0."""
        return self.contact.law != "unilateral"

    @property
    def rough(self) -> bool:
        """Whether there is friction."""
        return bool((self.friction > 0.0).any())

    @property
    def held(self) -> bool:
        """Whether the line cannot slip either: [v]_T = 0."""
        sticks = self.contact.law == "bilateral" and self.rough and self.contact.shear_limit is None
        return self.contact.law == "tied" or sticks

    @property
    def dilates(self) -> bool:
        """Whether slip needs opening, w ≥ μ |[v]_T|: a unilateral contact with friction."""
        return not self.fixed and self.rough

    @property
    def capped(self) -> bool:
        """Whether only a part a of the slip needs opening, w ≥ μ a: a cap besides friction."""
        return self.dilates and self.contact.shear_limit is not None

    def _relative(self, bodies: Bodies, s: FloatArray, *, tangent: bool) -> FloatArray:
        """Rows (p, 3 k) of [v]_N or [v]_T at positions s; on an arc of their Bernstein coefficients, whatever s is."""
        points, *axes = self.frame(self.places if self.arc else s)
        first, second = (bodies.rows(np.full(len(points), body), points, axes[tangent]) for body in self.bodies)
        return np.asarray(bernstein_from_values(_DEGREE) @ (first - second)) if self.arc else first - second

    def opening(self, bodies: Bodies) -> FloatArray:
        """Rows (p, 3 k) of w at the places; on an arc of the Bernstein coefficients of w."""
        return -self._relative(bodies, self.places, tangent=False)

    def slips(self, bodies: Bodies) -> FloatArray:
        """Rows (r, 3 k) whose largest magnitude bounds |[v]_T|: one row on a straight line, where it is constant."""
        return self._relative(bodies, self.places[:1], tangent=True)

    def slip(self, bodies: Bodies, v: FloatArray) -> float:
        """A bound of |[v]_T| for the motions v, exact on a straight line."""
        return float(np.abs(self.slips(bodies) @ v).max())

    def fixed_rows(self, bodies: Bodies) -> FloatArray:
        """Rows (e, 3 k) of velocities that must be zero: [v]_N on a line that cannot open, [v]_T if it cannot slip."""
        tangents = [False] * self.fixed + [True] * self.held
        rows = [self._relative(bodies, self.places[[0, -1]], tangent=tangent) for tangent in tangents]
        return np.concatenate([np.zeros((0, 3 * len(bodies))), *rows])

    def divided(self, s: float) -> "Line":
        """The line with one more place, and there the larger μ of both neighbours; arcs, already short, stay as is."""
        at = int(np.searchsorted(self.places, s))
        is_place = at in (0, len(self.places)) or np.abs(self.places - s).min() <= _SAME * np.ptp(self.places)
        if is_place or self.arc:
            return self
        mu = self.friction[at - 1 : at + 1].max()
        return replace(self, places=np.insert(self.places, at, s), friction=np.insert(self.friction, at, mu))

    def crossings(self, bodies: Bodies, v: FloatArray) -> FloatArray:
        """Positions s where w = μ × slip, between places: beyond them only part of the slip can dilate."""
        spare = self.opening(bodies) @ v - self.friction * self.slip(bodies, v)
        before = np.flatnonzero((spare[:-1] * spare[1:] <= 0.0) & (spare[:-1] != spare[1:]))
        share = spare[before] / (spare[before] - spare[before + 1])
        return np.asarray(self.places[before] + share * np.diff(self.places)[before])

    def surrounded(self, bodies: Bodies, v: FloatArray) -> "Line":
        """The line with more places, at and around its crossings, ever closer to them; only where a cap acts."""
        line = self
        for s in self.crossings(bodies, v) if self.capped and not self.arc else ():
            at = int(np.argmin(np.abs(self.places - s)))
            neighbours = self.places[max(at - 1, 0) : at + 2, None]
            for place in [s, *(self.places[at] + (neighbours - self.places[at]) * _NEARER).ravel()]:
                line = line.divided(place)
        return line

    def resistance(self, bodies: Bodies, v: FloatArray) -> float:
        """∫ π ds for a motion v that the line admits, exact up to the sampling of functions [stress × length²]."""
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
        """∫ π ds for a slip of 1 with no part dilating (a = 0): ∫ t_max, ∫ c, or ∫ min(c, t_max), as in the table."""
        parts, _, error = self._integrated(self.edges, saved=False)
        return float(parts.sum()) + error

    def relief(self) -> FloatArray:
        """∫ (t_max − c)⁺ N_i ds (p,): the factors of −a in ∫ π ds; N_i are hat functions of the places, on arcs B_i."""
        pieces = self.edges
        if not self.arc:  # divided at the places
            low = np.maximum(self.edges[:, 0], self.places[:-1, None])
            high = np.minimum(self.edges[:, 1], self.places[1:, None])
            pieces = np.stack([low, high], axis=-1)[low < high]
        parts, s, error = self._integrated(pieces, saved=True)
        at, hats = s.ravel(), np.eye(len(self.places))
        values = bernstein_basis(_DEGREE, at / self.edges[0, 1]).T if self.arc else np.stack(
            [np.interp(at, self.places, hat) for hat in hats])  # fmt: skip
        return np.maximum(values @ parts.ravel() - error, 0.0)

    def _integrated(self, pieces: FloatArray, *, saved: bool) -> tuple[FloatArray, FloatArray, float]:
        """Weighted values (k, q) of π/|[v]_T| at a = 0, or of (t_max − c)⁺, in pieces (n, 2); positions s; error."""
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
            rule = adapted(values, len(pieces), _POINTS)
        else:
            rule = constant(values(np.zeros(1, dtype=np.int64), np.zeros((1, 1))).item(), len(pieces), _POINTS)
        lengths = np.diff(pieces, axis=1)
        parts = rule.values * rule.weights * lengths[rule.edge]
        return parts, _between(pieces[rule.edge], rule.t), rule.error * float(lengths.max())


def _between(ends: FloatArray, t: FloatArray) -> FloatArray:
    """Affine functions (n, q) at points t from their values (n, 2) at t = 0 and 1."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * t)


def lines(problem: ContactProblem, bodies: Bodies) -> tuple[Line, ...]:
    """The lines of all contacts; a joint inside one block separates no bodies, and has no line."""
    vertices, all_lines = problem.mesh.vertices, list[Line]()
    for contact in problem.contacts:
        edges = problem.mesh.edges(contact.edges)
        first, second = bodies.beside(edges, contact)
        for one, other in np.unique(np.column_stack([first, second]), axis=0).tolist():
            chosen = edges.take((first == one) & (second == other) & (one != other))
            straight, arcs = chosen.take(~chosen.bent), chosen.take(chosen.bent)
            for group in straight_groups(vertices, straight):
                all_lines.append(Line.of(contact, (one, other), *_chord(vertices, straight.take(group)), arc=False))
            for number in range(len(arcs)):
                for piece in _pieces(vertices, arcs.take(np.array([number]))):
                    all_lines.append(Line.of(contact, (one, other), *piece, arc=True))
    return tuple(all_lines)


def _pieces(vertices: FloatArray, arc: Edges) -> Iterator[tuple[Frame, FloatArray]]:
    """Frames and positions of the ends of pieces of an arc, each of which turns by `_TURN` at most."""
    turn = np.abs(np.diff(angles(arc.bend, np.linspace(0.0, 1.0, _SAMPLES + 1)))).max() * _SAMPLES
    count = max(1, math.ceil(turn / _TURN))
    length = float(arc.length[0]) / count
    for piece in range(count):

        def frame(s: FloatArray, piece: int = piece) -> tuple[FloatArray, FloatArray, FloatArray]:
            t = (piece * length + s) / arc.length
            normals, tangents = frames_along(arc, t)
            return points_along(vertices, arc, t)[0], normals[0], tangents[0]

        yield frame, np.array([[0.0, length]])


def straight_groups(vertices: FloatArray, edges: Edges) -> Iterator[IntArray]:
    """Groups of edges on one straight line with the same normal, so that results do not depend on its division."""
    ends = np.stack([vertices[edges.first], vertices[edges.second]], axis=1)
    size, is_left = float(np.abs(vertices).max()), np.ones(len(edges), dtype=bool)
    while is_left.any():
        longest = int(np.argmax(np.where(is_left, edges.length, 0.0)))
        normal, length = edges.normal[longest], edges.length[longest]
        arms = ends - ends[longest, 0]
        lever = 1.0 + np.hypot(*np.moveaxis(arms, -1, 0)).max(axis=1) / length  # multiplies rounding of the direction
        on_line = np.abs(arms @ normal).max(axis=1) <= _ROUNDING * size * lever
        group = is_left & on_line & (edges.normal @ normal > 0.0)
        group[longest] = True
        is_left &= ~group
        yield np.flatnonzero(group)


def _chord(vertices: FloatArray, edges: Edges) -> tuple[Frame, FloatArray]:
    """The frame of the straight line of a group of edges, and the positions s (n, 2) of their ends."""
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
