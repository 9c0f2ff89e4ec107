"""Mechanisms: rigid motions of the blocks that prove how much of a load no stress whatever can carry.

Unknown are the motions v of all bodies, the slips s_l ≥ |[v]_T| of lines, and where a cap lets part of the slip do
without opening the dilatant slip a at places of the line:

    w − μ s ≥ 0   or   w − μ a ≥ 0,  0 ≤ a ≤ s,          R(v) = Σ_l (∫ bound ds · s_l − ∫ (t_max − c)⁺ a ds)

Supports, tied and bilateral lines are equations; their null space is taken first, so that rounding of the many
equations of one line does no harm. If the loads do the work L(v) > R(v), no admissible stress is in equilibrium with
them: for every one L(v) = Σ_l ∫ (−σ_N [v]_N − σ_T [v]_T) ds ≤ R(v).

Answers of the solver are used for v only. Works, resistance and missed conditions are computed from v again.

In `docs/theory.md`: (D23).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import SolveError
from qvi_contact.mechanism.bodies import Bodies, Work, works
from qvi_contact.mechanism.lines import Line, lines
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Displacement
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.names import Named
from solvers.basics.records import dataclass
from solvers.basics.types import PicklesFields
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, solved

_CERTAIN: Final = 1e-8
"""Gain of work, relative to the work that drives and resists, below which nothing is claimed."""

_REACH: Final = 1e4
"""A proof must exclude all contact forces up to so many times the loads, whatever rounding left of the conditions."""

_MOVES: Final = 1e-6
"""Share of the largest motion from which on a contact opens or slips."""


@dataclass(frozen=True)
class RigidMotion:
    """A small motion u(x) of a rigid body.

    Attributes
    ----------
    x, y : float
        Translation of the centre [length].
    rotation : float
        Rotation, counterclockwise [rad].
    centre : (float, float)
        The point that the translation belongs to [length].

    """

    x: float
    y: float
    rotation: float
    centre: tuple[float, float]

    def at(self, points: FloatArray) -> FloatArray:
        """Displacements of points (..., 2) [length]."""
        arm = np.asarray(points) - self.centre
        turned = self.rotation * np.stack([-arm[..., 1], arm[..., 0]], axis=-1)
        return np.asarray(np.array([self.x, self.y]) + turned)


@dataclass(frozen=True)
class ContactMotion:
    """What a mechanism does at a contact.

    Attributes
    ----------
    opening, slip : float
        Largest speed of opening, and of sliding [length].

    """

    opening: float
    slip: float

    @property
    def slides(self) -> bool:
        """Whether the contact slips, with or without opening."""
        return self.slip > _MOVES

    @property
    def opens(self) -> bool:
        """Whether the contact opens anywhere."""
        return self.opening > _MOVES


@dataclass(frozen=True, eq=False)
class Mechanism(PicklesFields):
    """Small rigid motions of the blocks that the contact laws admit, the largest displacement being 1 [length].

    Friction counts as if slip had to open the contact by μ times as much (the associated law): for such a motion
    admissible tractions cannot resist by more than `resistance`. If the loads do more work than that, no stress in
    equilibrium with them keeps the contact laws, on any mesh.

    Attributes
    ----------
    blocks : (cells,) int array
        The block that each cell of the mesh belongs to.
    motions : tuple of RigidMotion
        One for each block.
    plates : mapping of str to RigidMotion
        Motions of plates driven by force, by the names of their contacts.
    works : mapping of str to float
        Work of each load by its name [stress × length²].
    resistance : float
        The most that cohesion and caps of friction can take up [stress × length²].
    contacts : mapping of str to ContactMotion
        What opens and what slips.
    violation : float
        Largest speed against a support or contact law [length]: rounding.

    """

    blocks: IntArray
    motions: tuple[RigidMotion, ...]
    plates: Mapping[str, RigidMotion]
    works: Mapping[str, float]
    resistance: float
    contacts: Mapping[str, ContactMotion]
    violation: float

    @property
    def work(self) -> float:
        """Work of all loads together [stress × length²]."""
        return sum(self.works.values())

    @property
    def overload(self) -> float:
        """Work of the loads that drive the mechanism, over what the other loads and the contacts can take up.

        Above 1 the loads cannot be carried: all that drive would have to be smaller by this factor, while the others
        stay. Loads count by their names, as driving if their work on this motion is positive: parts of one load, such
        as the shear on two ends that make a couple, want one name, or what one gains and another loses counts on both
        sides and brings the factor nearer to 1. It is not the inverse of `limit_load_factor`, where the loads to
        multiply are chosen. Infinity if nothing resists.
        """
        driving = sum(work for work in self.works.values() if work > 0.0)
        resisting = self.resistance + driving - self.work
        return driving / resisting if resisting > _CERTAIN * driving else math.inf

    @property
    def reason(self) -> str:
        """What gives way, as a sentence without its stop."""
        slides = [repr(name) for name, moved in self.contacts.items() if moved.slides]
        pulls = [repr(name) for name, moved in self.contacts.items() if moved.opens and not moved.slides]
        if slides:
            return f"The load exceeds what friction on {' and '.join(slides)} can carry"
        if pulls:
            return f"The load pulls or tips the body off {' and '.join(pulls)}, where tension is not carried"
        return "The load moves the body where no contact resists"


def find_mechanism(problem: ContactProblem) -> Mechanism | None:
    """The mechanism that proves that no stress carries the loads; None if there is none.

    It is the one on which the loads that drive do the most work for each unit of work that resists. None says that
    contact tractions exist that carry the loads on rigid blocks, up to 1e-8 of them; friction may still give way
    before, since Coulomb's slip is not associated.

    Raises
    ------
    InputError
        If a function among the data gives bad values.
    SolveError
        If the linear program is not solved, or not in time.

    """
    rigid = Rigid(problem)
    motion = rigid.strongest(list(rigid.works))
    return _mechanism(problem, rigid, motion) if motion is not None and _proves(rigid, motion) else None


def upper_bound(problem: ContactProblem, loads: Sequence[str]) -> tuple[float, Mechanism | None]:
    """The largest multiple of the named loads that a body of rigid blocks carries, and the mechanism of the limit.

    No stress of the body carries more, and none on any mesh. It is infinite, without a mechanism, if the loads can grow
    without limit, and minus infinity if a mechanism on which they do no work lets no multiple be carried.
    """
    rigid = Rigid(problem)
    named = [name for name in dict.fromkeys(loads) if name in rigid.works]
    others = [name for name in rigid.works if name not in named]
    against = rigid.strongest(others, named)
    if against is not None and _proves(rigid, against):
        return -math.inf, _mechanism(problem, rigid, against)
    motion = rigid.dearest(named, others)
    if motion is None:
        return math.inf, None
    if motion.violation > _CERTAIN:
        raise SolveError(
            f"limit load: the mechanism violates a contact law by {motion.violation:.1e}: leave out "
            "tiny blocks or edges"
        )
    driving = sum(motion.works[name] for name in named)
    resisting = motion.resistance - sum(motion.works[name] for name in others)
    return resisting / driving, _mechanism(problem, rigid, motion)


def _proves(rigid: Rigid, motion: Motion) -> bool:
    """Whether the loads do more work than rounding, or contact forces far beyond the loads, could explain."""
    gain = motion.driving - motion.resisting
    rounding = _CERTAIN * (motion.driving + motion.resisting)
    return gain > rounding + _REACH * motion.violation * rigid.size


def _mechanism(problem: ContactProblem, rigid: Rigid, motion: Motion) -> Mechanism:
    """In the user's terms, scaled to the largest displacement 1."""
    bodies, v = rigid.bodies, motion.v.reshape(-1, 3)
    moved = [
        RigidMotion(float(x), float(y), float(turn / size), (float(centre[0]), float(centre[1])))
        for (x, y, turn), size, centre in zip(v, bodies.size, bodies.centre, strict=True)
    ]
    corners = problem.mesh.vertices[problem.mesh.cells]
    largest = max(
        float(np.hypot(*np.moveaxis(moved[block].at(corners[bodies.of_cells == block]), -1, 0)).max())
        for block in range(bodies.blocks)
    )
    scale = 1.0 / (largest or float(np.abs(v).max()))  # plates alone may move
    moved = [RigidMotion(scale * m.x, scale * m.y, scale * m.rotation, m.centre) for m in moved]
    contacts = {}
    for contact in problem.contacts:
        chosen = [line for line in rigid.lines if line.contact is contact]
        opening = [float((line.opening(bodies) @ motion.v).max()) for line in chosen]
        slip = [line.slip(bodies, motion.v) for line in chosen]
        contacts[contact.name] = ContactMotion(scale * max(opening, default=0.0), scale * max(slip, default=0.0))
    plates = dict(zip(bodies.plates, moved[bodies.blocks :], strict=True))
    return Mechanism(
        bodies.of_cells,
        tuple(moved[: bodies.blocks]),
        MappingProxyType(Named("plates", "contacts with a plate or pin", plates)),
        MappingProxyType(Named("works", "loads", {name: scale * work for name, work in motion.works.items()})),
        scale * motion.resistance,
        MappingProxyType(Named("contacts", "contacts", contacts)),
        scale * motion.violation,
    )


# the linear programs, and what is checked of their answers

_FARTHEST: Final = 1e5  # size of motions that do the work 1 with loads of the size 1: beyond, work is rounding
_LEAST: Final = 1e-7  # work of loads of the size 1 on motions of the size 1, below which it may be rounding
_ROUNDS: Final = 40  # at most, of placing the points where the cap sets in
_SETTLED: Final = 1e-13
_NEARER: Final = 0.25 ** np.arange(1.0, 7.0)  # shares of the way to the next place, where more are tried
_NOTHING: Final = 1e-9  # share of speeds within which opening is just enough
_BESIDE: Final = 1e-3  # share of an interval within which a place counts as its end

_Equations: TypeAlias = Sequence[tuple[Any, float]]  # (row, value): row · v = value


@dataclass(frozen=True, eq=False)
class Motion:
    """Motions of all bodies and what they mean."""

    v: FloatArray  # (3 k,): the motions, the largest of size 1
    works: Mapping[str, float]  # work of each load [stress × length]
    resistance: float  # R(v), what contacts can take up at most [stress × length]
    violation: float  # largest speed at which a contact law or support forbids the motion; rounding

    @property
    def driving(self) -> float:
        """Work of the loads that help the motion along [stress × length]."""
        return sum(work for work in self.works.values() if work > 0.0)

    @property
    def resisting(self) -> float:
        """Work against the other loads, and what contacts take up [stress × length]."""
        return self.resistance - sum(work for work in self.works.values() if work < 0.0)


class Rigid:
    """A problem whose blocks are rigid: bodies, lines, works of loads, and the programs over them."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self.bodies = Bodies.of(problem)
        self.lines = lines(problem, self.bodies)
        bodies, vertices = self.bodies, problem.mesh.vertices
        rows = [np.eye(3 * len(bodies))[~bodies.free.ravel()]]  # of velocities that supports, plates, contacts rule out
        for given in problem.prescribed(Displacement):
            edges, block = given.edges, bodies.of_cells[given.edges.cells[:, 0]]
            along = vectors_along(edges, given.direction, np.array([0.0, 1.0]), turns=given.turns)
            ends = (edges.first, edges.second)
            rows += [bodies.rows(block, vertices[end], along[:, k]) for k, end in enumerate(ends)]
        self.held = np.concatenate([*rows, *(line.fixed_rows(bodies) for line in self.lines)])
        self.free = _null_space(self.held, float(np.abs(vertices).max() / bodies.size.min()))

    @cached_property
    def works(self) -> dict[str, Work]:
        """What each load does on motions, by name."""
        return works(self.problem, self.bodies)

    @property
    def size(self) -> float:
        """Largest work of all loads on motions of size 1, nothing cancelled [stress × length]."""
        return sum(work.size for work in self.works.values())

    def strongest(self, names: Sequence[str], idle: Sequence[str] = ()) -> Motion | None:
        """The motion on which driving over resisting work of the named loads is largest; None if nothing moves.

        Loads called idle, which one factor multiplies, do no work on it together, and are left out.
        """
        unit = sum(self.works[name].size for name in names)
        if not self.free.shape[1] or unit == 0.0:
            return None
        rows = np.array([self.works[name].row for name in names]) / unit
        together = sum(self.works[name].size for name in idle)
        none = [(sum(self.works[name].row for name in idle) / together, 0.0)] if together else []
        motion = self._settled(lambda program: program.strongest(rows, unit, none))
        return None if motion is None else self.motion(motion, names)

    def dearest(self, names: Sequence[str], others: Sequence[str]) -> Motion | None:
        """The motion that gives the least R − L(others) for one work of the named loads; None if they can do none.

        Near a threshold at which they can do none the work is that of the motion on which they do most: motions of the
        work 1 would be too large to be told from rounding.
        """
        unit, size = sum(self.works[name].size for name in names), self.size
        if not self.free.shape[1] or unit == 0.0:
            return None
        row = sum(self.works[name].row for name in names) / unit
        most = _Program(self, self.lines).most(np.asarray(row))
        if most <= _LEAST:
            return None
        row = row / most
        other = sum((self.works[name].row for name in others), np.zeros(len(self.free))) / size
        motion = self._settled(lambda program: program.dearest(np.asarray(row), other, size))
        return None if motion is None else self.motion(motion, [*names, *others])

    def _settled(self, solve: Callable[[_Program], tuple[FloatArray, float] | None]) -> FloatArray | None:
        """Solve, and again with more places around that where the cap sets in, until they change nothing."""
        chosen, before, idle = self.lines, np.inf, 0
        for _ in range(_ROUNDS):
            found = solve(_Program(self, chosen))
            if found is None or not any(line.capped for line in chosen):
                break
            motion, value = found
            idle = 0 if before - value > _SETTLED * abs(value) else idle + 1
            if idle == 2:
                break
            chosen, before = tuple(surrounded(line, self.bodies, motion) for line in chosen), value
        return None if found is None else found[0]

    def resistance(self, v: FloatArray) -> float:
        """R(v) [stress × length], exact up to the sampling of functions."""
        return sum(resistance(line, self.bodies, v) for line in self.lines)

    def motion(self, v: FloatArray, names: Sequence[str]) -> Motion | None:
        """What a motion means, scaled to the size 1; None for rest."""
        largest = float(np.abs(v).max())
        if largest == 0.0:
            return None
        v = v / largest
        missed = [0.0, *np.abs(self.held @ v)]
        for line in self.lines:
            if not line.fixed:
                slip = line.slip(self.bodies, v) if line.dilates and not line.capped else 0.0
                missed += list(line.friction * slip - line.opening(self.bodies) @ v)
        found = {name: float(self.works[name].row @ v) for name in names}
        return Motion(v, found, self.resistance(v), float(max(missed)))


def divided(line: Line, bodies: Bodies, v: FloatArray) -> Line:
    """The line with places where opening becomes too little for all of the slip to dilate."""
    spare = line.opening(bodies) @ v - line.friction * line.slip(bodies, v)
    for i in np.flatnonzero(spare[:-1] * spare[1:] < 0.0):
        share = spare[i] / (spare[i] - spare[i + 1])
        line = line.divided(float(line.places[i] + share * (line.places[i + 1] - line.places[i])))
    return line


def surrounded(line: Line, bodies: Bodies, v: FloatArray) -> Line:
    """The line with places where opening becomes too little, or where there is one, around it."""
    if not line.capped:
        return line
    places, slip = line.places, line.friction * line.slip(bodies, v)
    opening = line.opening(bodies) @ v
    spare = opening - slip
    clear = np.flatnonzero(np.abs(spare) > _NOTHING * float((np.abs(opening) + slip).max()))
    for i, j in pairwise(clear.tolist()):
        if spare[i] * spare[j] > 0.0:
            continue
        share = spare[i] / (spare[i] - spare[j])
        s = float(places[i] + share * (places[j] - places[i]))
        new = [s] if j == i + 1 and _BESIDE < share < 1.0 - _BESIDE else _around(places, s)
        for place in new:
            line = line.divided(place)
    return line


def _around(places: FloatArray, s: float) -> list[float]:
    """Places between the nearest one to s and its neighbours, closer and closer to it."""
    at = int(np.argmin(np.abs(places - s)))
    beside = [place for place in places[max(at - 1, 0) : at + 2] if place != places[at]]
    near: list[float] = np.concatenate([places[at] + (place - places[at]) * _NEARER for place in beside]).tolist()
    return near


def resistance(line: Line, bodies: Bodies, v: FloatArray) -> float:
    """∫ π ds of a line for a motion that it admits."""
    slip = line.slip(bodies, v)
    if line.held or slip == 0.0:
        return 0.0
    work = line.shear_work() * slip
    if not line.capped:
        return work
    line = divided(line, bodies, v)
    opening = np.maximum(line.opening(bodies) @ v, 0.0)
    rough = line.friction > 0.0
    dilatant = np.divide(opening, line.friction, out=np.full(len(opening), slip), where=rough)
    return work - float(line.relief() @ np.minimum(dilatant, slip))


class _Program:
    """The conditions of lines as rows ≤ 0 in x = (y, slips of each line) with v = Z y, and the costs of slips."""

    def __init__(self, rigid: Rigid, chosen: Sequence[Line]) -> None:
        self._basis, self._motions = rigid.free, rigid.free.shape[1]
        self._cost, shared, own = np.zeros(self._motions), [sparse.csr_array((0, self._motions))], []
        for line in chosen:
            if not line.held:
                on_y, on_slips, cost = self._conditions(line, rigid.bodies)
                shared.append(sparse.csr_array(on_y))
                own.append(on_slips)
                self._cost = np.append(self._cost, cost)
        self._rows = sparse.hstack([sparse.vstack(shared), sparse.block_diag([np.zeros((0, 0)), *own])])

    def _conditions(self, line: Line, bodies: Bodies) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows of a line on y, and on its own slips, and the costs of these."""
        opening = self._on_motions(line.opening(bodies)[: 0 if line.fixed else None])
        work = line.shear_work()
        if not (line.dilates or work > 0.0):
            return -opening, np.zeros((len(opening), 0)), np.zeros(0)
        slips = self._on_motions(line.slips(bodies))
        mu, limit = line.friction[: len(opening), None], -np.ones((2 * len(slips), 1))
        if not line.capped:
            return np.concatenate([slips, -slips, -opening]), np.concatenate([limit, mu]), np.array([work])
        each, none = np.eye(len(opening)), np.zeros((len(opening), 1))
        dilatant = np.block([[limit, np.zeros((len(limit), len(each)))], [none, mu * each], [none - 1.0, each]])
        on_y = np.concatenate([slips, -slips, -opening, 0.0 * opening])
        return on_y, dilatant, np.append(work, -line.relief())

    def _on_motions(self, rows: FloatArray) -> FloatArray:
        """Rows on motions v of bodies as rows on y, of which few have entries where there are many bodies."""
        touched = np.flatnonzero(rows.any(axis=0))
        return np.asarray(rows[:, touched] @ self._basis[touched])

    def _objective(self, row: FloatArray) -> FloatArray:
        """−row · v."""
        return np.append(-self._on_motions(row[None])[0], np.zeros(len(self._cost) - self._motions))

    def strongest(self, loads: FloatArray, unit: float, equations: _Equations) -> tuple[FloatArray, float] | None:
        """Max L − R  s.t.  Σ_j |L_j| + R ≤ 1: then (L⁺ − resisting)/(L⁺ + resisting) is largest."""
        cost, sizes = self._cost / unit, np.zeros(len(loads))
        works = np.array([-self._objective(load) for load in loads])
        rows: Any = [[self._rows, None], [works, -np.eye(len(loads))], [-works, -np.eye(len(loads))]]
        whole: Any = np.append(cost, sizes + 1.0)[None]
        rows = sparse.vstack([sparse.block_array(rows), whole])
        limits = np.append(np.zeros(rows.shape[0] - 1), 1.0)
        return self._solve(np.append(cost - works.sum(axis=0), sizes), rows, equations, limits)

    def most(self, row: FloatArray) -> float:
        """Max row · v over motions of the size 1 at most."""
        found = self._solve(self._objective(row), self._rows, (), farthest=1.0)
        return 0.0 if found is None else -found[1]

    def dearest(self, row: FloatArray, other: FloatArray, unit: float) -> tuple[FloatArray, float] | None:
        """Min R − L(others)  s.t.  row · v = 1."""
        return self._solve(self._cost / unit + self._objective(other), self._rows, [(row, 1.0)])

    def _solve(
        self,
        objective: FloatArray,
        rows: Any,
        equations: _Equations,
        limits: FloatArray | float = 0.0,
        farthest: float = _FARTHEST,
    ) -> tuple[FloatArray, float] | None:
        """The motion v and the least value, with rows not above limits; None if there is no motion."""
        box = sparse.eye_array(self._motions, len(objective))  # as rows: variables with two bounds would stand at one
        limits = np.append(np.broadcast_to(limits, rows.shape[0]), np.full(2 * self._motions, farthest))
        known: Any = {}
        if equations:
            A = np.zeros((len(equations), len(objective)))
            A[:, : self._motions] = self._on_motions(np.array([row for row, _ in equations]))
            known = {"A_eq": sparse.csr_array(A), "b_eq": np.array([value for _, value in equations])}
        bounds: Any = [(-np.inf if n < self._motions else 0.0, np.inf) for n in range(len(objective))]
        matrix = sparse.csr_array(sparse.vstack([rows, box, -box]))
        answer = solved(objective, A_ub=matrix, b_ub=limits, bounds=bounds, **known)
        if answer.status == INFEASIBLE:
            return None
        if answer.status == TIME_LIMIT:
            raise SolveError("mechanism: the time limit was reached: allow more (time_limit=…)")
        if not answer.solved:
            raise SolveError(f"mechanism: the linear program was not solved ({answer.message})")
        return np.asarray(self._basis @ answer.x[: self._motions]), float(objective @ answer.x)


def _null_space(rows: FloatArray, shift: float) -> FloatArray:
    """Orthonormal columns of the motions that no row forbids; what may be rounding of coordinates is a row."""
    touched = np.flatnonzero(rows.any(axis=0))
    others = np.delete(np.eye(rows.shape[1]), touched, axis=1)
    if not len(touched):
        return others
    part = null_space(rows[:, touched], 64.0 * np.finfo(float).eps * (1.0 + shift) * np.sqrt(len(rows)))
    return np.column_stack([others, np.eye(rows.shape[1])[:, touched] @ part])


def null_space(rows: FloatArray, least: float) -> FloatArray:
    """Orthonormal columns (n, d) on which rows (m, n) are at most `least`."""
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))  # of many rows, few are of use
    return np.asarray(right[int((values > least).sum()) :].T)
