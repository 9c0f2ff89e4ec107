"""Mechanisms: rigid motions of the blocks that prove which loads no stress at all can carry.

The unknowns are the motions v of all bodies, the slips s_l ≥ |[v]_T| of lines, and on lines with a cap the part a of
the slip that needs opening, at the places of the line:

    w − μ s ≥ 0   or   w − μ a ≥ 0,  0 ≤ a ≤ s,          R(v) = Σ_l (∫ bound ds · s_l − ∫ (t_max − c)⁺ a ds)

Supports, tied and bilateral lines are equations. Their null space is computed first, so that many nearly dependent
equations of one line do no harm. The solver's answer gives v only: works, resistance and violations follow from v.

In `docs/theory.md`: (D23).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.errors import SolveError
from qvi_contact.mechanism.bodies import Bodies, Line, Work, lines, works
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Displacement, RigidMotion
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.types import PicklesFields
from solvers.errors import Named
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, solved

_STILL: Final = 1e-9  # displacement of blocks over the size of the motion, up to which only plates move
_CERTAIN: Final = 1e-8
"""Net work over (driving + resisting work) that a proof must exceed."""

_REACH: Final = 1e4
"""Contact forces over the loads up to which a proof must hold, although rounding violates the conditions a little."""

_MOVES: Final = 1e-6
"""Speed of opening or slip over the largest displacement, above which a contact opens or slips."""

_FARTHEST: Final = 1e5  # largest motion that does the work 1 with loads of size 1: for larger ones work is rounding
_LEAST: Final = 1e-7  # work of loads of size 1 on motions of size 1, up to which it may be rounding
_PRICE: Final = 1e-9  # price of slip over the size of loads: more than tolerances of the solver, less than `_CERTAIN`
_ROUNDS: Final = 40  # largest number of linear programs with ever more places on lines with a cap
_SETTLED: Final = 1e-13  # relative decrease of the optimum by more places, up to which it has settled


@dataclass(frozen=True)
class ContactMotion(WithFields):
    """Motion of a mechanism at a contact, for a largest displacement of 1 [length]."""

    opening: float
    """Largest speed of opening [length]."""
    slip: float
    """Largest speed of sliding [length]."""

    @property
    def slides(self) -> bool:
        """Whether the contact slips, with or without opening."""
        return self.slip > _MOVES

    @property
    def opens(self) -> bool:
        """Whether the contact opens anywhere."""
        return self.opening > _MOVES


@dataclass(frozen=True, eq=False)
class Mechanism(WithFields, PicklesFields):
    """Small rigid motions of the blocks that the contact laws admit; the largest displacement is 1 [length].

    Slip opens a contact with friction by at least μ times the slip (associated law). Admissible tractions do the work
    `resistance` against it at most. If the loads do more, no stress in equilibrium, on any mesh, obeys the laws.
    """

    blocks: IntArray
    """(cells,) int: The block of each cell of the mesh."""
    motions: tuple[RigidMotion, ...]
    """The motion of each block."""
    plates: Mapping[str, RigidMotion]
    """Motions of plates driven by force, by the names of their contacts."""
    works: Mapping[str, float]
    """Work of each load by its name [stress × length²]."""
    resistance: float
    """Largest work of cohesion and capped friction against the motion [stress × length²]."""
    contacts: Mapping[str, ContactMotion]
    """Opening and slip by contact."""
    violation: float
    """Largest speed that violates a support or contact law, by rounding [length]."""

    @property
    def work(self) -> float:
        """Work of all loads together [stress × length²]."""
        return sum(self.works.values())

    @property
    def driving(self) -> float:
        """Work of the loads whose work is positive [stress × length²]."""
        return sum(work for work in self.works.values() if work > 0.0)

    @property
    def resisting(self) -> float:
        """Work against the other loads, plus the largest resistance of the contacts [stress × length²]."""
        return self.resistance + self.driving - self.work

    @property
    def overload(self) -> float:
        """Driving work over resisting work; infinity if nothing resists.

        Above 1 the loads cannot be carried: all driving loads would have to be smaller by this factor, with the others
        unchanged. A load drives if the work under its name is positive. Parts of one load, such as the shear on two
        ends that forms a couple, should have one name: with two names the factor is nearer to 1. The factor is not the
        inverse of `limit_load_factor`, where the user chooses the loads that are multiplied.
        """
        return self.driving / self.resisting if self.resisting > _CERTAIN * self.driving else math.inf

    @property
    def reason(self) -> str:
        """A sentence, without full stop, that names the contacts that slip or open."""
        slides = [repr(name) for name, moved in self.contacts.items() if moved.slides]
        pulls = [repr(name) for name, moved in self.contacts.items() if moved.opens and not moved.slides]
        if slides:
            return f"The load exceeds what friction on {' and '.join(slides)} can carry"
        if pulls:
            return f"The load pulls or tips the body off {' and '.join(pulls)}, where tension is not carried"
        return "The load moves the body where no contact resists"


def find_mechanism(problem: ContactProblem) -> Mechanism | None:
    """The mechanism that proves that no stress carries the loads; None if there is none.

    Of all mechanisms it has the largest driving work over resisting work. None means that contact tractions exist that
    carry the loads on rigid blocks, up to 1e-8 of them. Coulomb friction may fail earlier: its slip is not associated.

    Raises
    ------
    InputError
        If a function among the data gives bad values.
    SolveError
        If the linear program is not solved, or not in time.

    """
    rigid = Rigid(problem)
    return rigid.proving(list(rigid.works))


def upper_bound(problem: ContactProblem, loads: Sequence[str]) -> tuple[float, Mechanism | None]:
    """The largest multiple of the named loads that rigid blocks carry, and the mechanism of this limit.

    No stress of the body carries more, on any mesh. The multiple is infinite, without a mechanism, if the loads can
    grow without limit. It is minus infinity if a mechanism on which the named loads do no work excludes all multiples.
    """
    rigid = Rigid(problem)
    named = [name for name in dict.fromkeys(loads) if name in rigid.works]
    others = [name for name in rigid.works if name not in named]
    if (against := rigid.proving(others, named)) is not None:
        return -math.inf, against
    mechanism = rigid.dearest(named, others)
    if mechanism is None:
        return math.inf, None
    if mechanism.violation > _CERTAIN:
        reason = f"the mechanism violates a contact law by {mechanism.violation:.1e}"
        raise SolveError(f"limit load: {reason}: leave out tiny blocks or edges")
    resisting = mechanism.resistance - sum(mechanism.works[name] for name in others)
    return resisting / sum(mechanism.works[name] for name in named), mechanism


class Rigid:
    """A problem with rigid blocks: bodies, lines, works of loads, and the linear programs over their motions."""

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self.bodies = Bodies.of(problem)
        self.lines = lines(problem, self.bodies)
        bodies, vertices = self.bodies, problem.mesh.vertices
        rows = [np.eye(3 * len(bodies))[~bodies.free.ravel()]]  # of velocities that plates, supports, lines set to zero
        for given in problem.prescribed(Displacement):
            edges, block = given.edges, bodies.of_cells[given.edges.cells[:, 0]]
            along = vectors_along(edges, given.direction, np.array([0.0, 1.0]), turns=given.turns)
            ends = (edges.first, edges.second)
            rows += [bodies.rows(block, vertices[end], along[:, k]) for k, end in enumerate(ends)]
        self.held = np.concatenate([*rows, *(line.fixed_rows(bodies) for line in self.lines)])
        shift = float(np.abs(vertices).max() / bodies.size.min())  # factor of rounding of coordinates in rows
        self.free = null_space(self.held, 64.0 * np.finfo(float).eps * (1.0 + shift) * np.sqrt(len(self.held)))

    @cached_property
    def works(self) -> dict[str, Work]:
        """The work of each load on rigid motions, by name."""
        return works(self.problem, self.bodies)

    def _size(self, names: Iterable[str]) -> float:
        """Sum of the sizes of loads, see `Work` [stress × length]."""
        return sum(self.works[name].size for name in names)

    def _row(self, names: Iterable[str], unit: float) -> FloatArray:
        """The row of the works of several loads together, over a unit of work."""
        return np.asarray(sum((self.works[name].row for name in names), np.zeros(len(self.free))) / unit)

    def proving(self, names: Sequence[str], idle: Sequence[str] = ()) -> Mechanism | None:
        """The motion with the largest ratio of driving to resisting work of the named loads, if it is a proof.

        A proof has more net work than rounding, and contact forces far above the loads on violated conditions, can
        explain. The `idle` loads, which one factor multiplies, together do no work on the motion, and are left out.
        """
        unit, together = self._size(names), self._size(idle)
        if not self.free.shape[1] or unit == 0.0:
            return None
        loads = np.array([self.works[name].row for name in names]) / unit
        idle_work = self._row(idle, together) if together else None

        def optimum(program: _Program, price: float = 0.0) -> tuple[FloatArray, float] | None:
            """Max L − R − price · slips  s.t.  Σ_j |L_j| + R ≤ 1; with a price of 0 the ratio of L and R is largest."""
            cost, works, sizes = program.cost / unit, program.on_unknowns(loads), np.ones(len(loads))
            rows: Any = [[program.rows, None], [works, -np.diag(sizes)], [-works, -np.diag(sizes)]]
            rows += [[cost[None], sizes[None]]]
            matrix = sparse.block_array(rows)
            limits = np.append(np.zeros(matrix.shape[0] - 1), 1.0)
            goal = cost + price * program.slips - works.sum(axis=0)
            return program.solved(np.append(goal, 0.0 * sizes), matrix, limits, idle_work)

        def proves(proof: Mechanism) -> bool:
            rounding = _CERTAIN * (proof.driving + proof.resisting) + _REACH * proof.violation * self._size(self.works)
            return proof.driving - proof.resisting > rounding

        motion = self._settled(optimum, names)
        if (motion is None or not proves(motion)) and not idle and any(line.capped for line in self.lines):
            # Places on lines with a cap are added around a motion. If none is found without them, this is a first one.
            motion = self.dearest(names, [])
        if motion is None or not proves(motion):
            return None
        # If nothing resists, many motions prove it: one without slip shows that friction is not the reason. A price of
        # slip may hide the small net work of a large motion. Then the first motion stays.
        with suppress(SolveError):
            other = self._settled(partial(optimum, price=_PRICE), names) if np.isinf(motion.overload) else None
            motion = other if other is not None and proves(other) and np.isinf(other.overload) else motion
        return motion

    def dearest(self, names: Sequence[str], others: Sequence[str]) -> Mechanism | None:
        """The motion of least R − L(others) for a given work of the named loads; None if they cannot do work.

        The given work is the largest that the named loads do on motions of size 1. If that is small, motions of the
        work 1 would be so large that works would drown in rounding.
        """
        unit, size = self._size(names), self._size(self.works)
        if not self.free.shape[1] or unit == 0.0:
            return None
        row, start = self._row(names, unit), _Program(self, self.lines)
        optimum = start.solved(-start.on_unknowns(row), start.rows, farthest=1.0)
        if optimum is None or -optimum[1] <= _LEAST:
            return None
        row, other = row / -optimum[1], self._row(others, size)
        return self._settled(lambda program: program.solved(
            program.cost / size - program.on_unknowns(other), program.rows, 0.0, row, 1.0
        ), [*names, *others])  # fmt: skip

    def _settled(
        self, solve: Callable[[_Program], tuple[FloatArray, float] | None], names: Iterable[str]
    ) -> Mechanism | None:
        """The mechanism of an optimum, with more and more places around the crossings of lines with a cap.

        The rounds end when the optimum has settled twice in a row, or lines have no more places.
        """
        chosen, before, settled = self.lines, np.inf, 0
        for _ in range(_ROUNDS):
            optimum = solve(_Program(self, chosen))
            if optimum is None or not any(line.capped for line in chosen):
                break
            motion, value = optimum
            settled = 0 if before - value > _SETTLED * abs(value) else settled + 1
            if settled == 2:
                break
            finer, before = tuple(line.surrounded(self.bodies, motion) for line in chosen), value
            if finer == chosen:  # no line has new places
                break
            chosen = finer
        return None if optimum is None or not optimum[0].any() else self._mechanism(optimum[0], names)

    def _mechanism(self, v: FloatArray, names: Iterable[str]) -> Mechanism:
        """The mechanism of motions v (3 k,), scaled to the largest displacement 1."""
        bodies = self.bodies
        v = v / np.abs(v).max()
        of_cells, scale = bodies.of_cells, np.insert(np.ones((len(bodies), 2)), 2, 1.0 / bodies.size, axis=1)
        x, y, turn = (v.reshape(-1, 3) * scale)[of_cells, :, None].swapaxes(0, 1)
        arm_x, arm_y = np.moveaxis(self.problem.mesh.corners - bodies.centre[of_cells, None], -1, 0)
        largest = np.hypot(x - turn * arm_y, y + turn * arm_x).max()
        v = v / (largest if largest > _STILL else 1.0)  # else only plates move
        violations = [0.0, *np.abs(self.held @ v).tolist()]
        opening, slip = ({contact.name: 0.0 for contact in self.problem.contacts} for _ in range(2))
        for line in self.lines:
            name, opens, slips = line.contact.name, line.opening(bodies) @ v, line.slip(bodies, v)
            opening[name], slip[name] = max(opening[name], float(opens.max())), max(slip[name], slips)
            if not line.fixed:
                violations += list(line.friction * (slips if line.dilates and not line.capped else 0.0) - opens)
        moved = np.column_stack([v.reshape(-1, 3) * scale, bodies.centre]).tolist()
        motions = tuple(RigidMotion(a, b, rotation, (at_x, at_y)) for a, b, rotation, at_x, at_y in moved)
        plates = dict(zip(bodies.plates, motions[bodies.blocks :], strict=True))
        by_load = {name: float(self.works[name].row @ v) for name in names}
        contacts = {name: ContactMotion(opening[name], slip[name]) for name in opening}
        return Mechanism(
            bodies.of_cells, motions[: bodies.blocks],
            Named("plates", "contacts with a plate or pin", plates),
            Named("works", "loads", by_load), sum(line.resistance(bodies, v) for line in self.lines),
            Named("contacts", "contacts", contacts), float(max(violations)),
        )  # fmt: skip


class _Program:
    """The conditions of lines as rows ≤ 0 in x = (y, slips of each line) with v = Z y, and R as costs of x."""

    def __init__(self, rigid: Rigid, chosen: Sequence[Line]) -> None:
        self._basis, self._motions = rigid.free, rigid.free.shape[1]
        costs, shared, own = [np.zeros(self._motions)], [sparse.csr_array((0, self._motions))], []
        is_slip = [np.zeros(self._motions)]  # 1 for the slip s of each line
        for line in chosen:
            if not line.held:
                on_y, on_slips, cost = self._conditions(line, rigid.bodies)
                shared.append(sparse.csr_array(on_y))
                own.append(on_slips)
                costs.append(cost)
                is_slip.append(np.eye(1, len(cost))[0])
        self.cost, self.slips = np.concatenate(costs), np.concatenate(is_slip)
        self.rows = sparse.hstack([sparse.vstack(shared), sparse.block_diag([sparse.csr_array((0, 0)), *own])])

    def _conditions(self, line: Line, bodies: Bodies) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows of a line on y, rows on its slips (s, and a at places with a cap), and the costs of these slips."""
        opening = self._on_motions(line.opening(bodies)[: 0 if line.fixed else None])
        slips = self._on_motions(line.slips(bodies))
        mu, limit = line.friction[: len(opening), None], -np.ones((2 * len(slips), 1))
        if not line.capped:
            costs = np.array([line.shear_work()])
            return np.concatenate([slips, -slips, -opening]), np.concatenate([limit, mu]), costs
        # |[v]_T| ≤ s;  μ a ≤ w;  a ≤ s
        each, zero = np.eye(len(opening)), np.zeros((len(opening), 1))
        dilatant = np.block([[limit, np.zeros((len(limit), len(each)))], [zero, mu * each], [zero - 1.0, each]])
        on_y = np.concatenate([slips, -slips, -opening, 0.0 * opening])
        return on_y, dilatant, np.append(line.shear_work(), -line.relief())

    def _on_motions(self, rows: FloatArray) -> FloatArray:
        """Rows on motions v as rows on y; only the few nonzero columns are multiplied."""
        nonzero = np.flatnonzero(rows.any(axis=0))
        return np.asarray(rows[:, nonzero] @ self._basis[nonzero])

    def on_unknowns(self, rows: FloatArray) -> FloatArray:
        """Rows (..., 3 k) on motions v as rows on x."""
        on_x = np.zeros((*rows.shape[:-1], len(self.cost)))
        on_x[..., : self._motions] = rows @ self._basis
        return on_x

    def solved(
        self,
        objective: FloatArray,
        rows: Any,
        limits: FloatArray | float = 0.0,
        equation: FloatArray | None = None,
        value: float = 0.0,
        farthest: float = _FARTHEST,
    ) -> tuple[FloatArray, float] | None:
        """The motion v of the least objective, and this least value; None if no x meets the conditions.

        Conditions: rows x ≤ limits, equation v = value if an equation is given, |y| ≤ farthest, and slips ≥ 0.
        """
        box = sparse.eye_array(self._motions, len(objective))  # as rows, so that y need not be at a bound
        limits = np.append(np.broadcast_to(limits, rows.shape[0]), np.full(2 * self._motions, farthest))
        known: Any = {}
        if equation is not None:
            A = np.zeros((1, len(objective)))
            A[0, : self._motions] = equation @ self._basis
            known = {"A_eq": sparse.csr_array(A), "b_eq": np.array([value])}
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


def null_space(rows: FloatArray, least: float) -> FloatArray:
    """Orthonormal columns (n, d) that span the null space of rows (m, n): singular values up to `least` are zero."""
    _, values, right = np.linalg.svd(np.linalg.qr(rows, mode="r"))  # QR first, as m may be much larger than n
    return np.asarray(right[int((values > least).sum()) :].T)
