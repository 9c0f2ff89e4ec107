"""Second-order cone programs by Clarabel, and answers made to hold: what is proved comes from x, not from the solver.

min q·x   s.t.   s = b − A x:   s = 0 in the first rows,   s ≥ 0 in those after them,   |u_i| ≤ t_i in blocks (t, u)_i
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import SolveError
from solvers.basics.progress import deadline
from solvers.basics.types import load

_TOLERANCE: Final = 1e-9  # of the solver
_COARSER: Final = 1e-7  # gap of the solver in programs of more than so many blocks: bounds come from x in any case
_LARGE: Final = 4000
REGULAR: Final = (1e-12, 1e-11, 1e-10)  # added to its matrices: in more, thin triangles are lost
_USUAL: Final = 1e-8  # by default; where stresses of rigid parts say nothing it does not solve with less
_STRONGER: Final = 1e-6  # where equations depend on each other and it breaks down with the usual one
_REFINED: Final = 30  # steps of its iterative refinement, at most
_ROUNDED: Final = 1e-14  # of the largest column: columns that are nothing but rounding
_DAMPED: Final = 1e-14  # added to the normal equations, whose rows may depend on each other
_SWEEPS: Final = 4  # of the projection on the equations
HELD: Final = 1e-7  # violation, relative to what stands in the rows, that counts as rounding
ROUNDING: Final = 1e-11  # of sizes: violation that is not worth a second program
_ROOM: Final = 1e-9  # of sizes: rows that no point is farther inside leave no room
_ENOUGH: Final = 1e-3  # of sizes: the least solution of the equations, if it is farther inside, is a point inside
FACES: Final = ((1e-7, 1e-3), (1e-6, 1e-3), (1e-5, 1e-3), (1e-6, 1e-2), (1e-5, 1e-2))
"""Room of a cone, of sizes, below which it has none, and angle to the ray that it is taken for then; tried in turn."""
_SMALL: Final = 1e-5  # of room, what t may cost: or points inside are 1e6 times as large as others for nothing
_TIP: Final = 1e-5  # of sizes: cones that are at their tips
_LITTLE: Final = 1e-5  # share of the way to it for which no second program is solved
_NEAR: Final = 1e-3  # room that is enough in each row: more of it in some rows may leave none in others
_TIGHTER: Final = 4.0  # times what an answer misses, which is asked for in a second program
APART: Final = 1e3  # times the least strength: those up to it count as equal
_GAIN: Final = 1e-9  # of what is done for and against it: what falls by more falls for ever
_MISSED: Final = 0.1  # of a gain, what may come from rows that are missed
_ENDLESS: Final = 1e50  # points that are larger are directions, whose squares are numbers still
_NEVER: Final = 1e-300  # what "unbounded" must reach once it was found to be rounding
_LEAST_TIME: Final = 1.0  # seconds for one program, at least

INFEASIBLE: Final = "infeasible"
UNBOUNDED: Final = "unbounded"

Rows: TypeAlias = tuple[Any, FloatArray]
"""Sparse rows A and constants b of s = b − A x."""


def beside(strengths: FloatArray, least: float, share: float = 1.0) -> FloatArray:
    """A share of strengths over the least of a body, where they are more than 1e3 times that; 1 where they are not."""
    ratio = strengths / least
    return np.where(ratio > APART, share * ratio, 1.0)


class Answer(NamedTuple):
    """What the solver says, unchecked."""

    x: FloatArray
    multipliers: FloatArray  # of all rows: q + Aᵀ multipliers = 0
    least: float  # what q·x is at least by its multipliers, among points no larger than x, or than limits


@dataclass(frozen=True, eq=False)
class ConicProgram:
    """The program above.

    Equations that may depend on each other (`dependent`) need the solver's own regularisation, in which what is badly
    scaled is lost.
    """

    q: FloatArray
    A: sparse.csr_array
    b: FloatArray
    equal: int  # equations
    linear: int  # inequalities
    width: int  # rows of a block
    dependent: bool = False
    _narrower: dict[tuple[bytes, bytes], ConicProgram] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def of(
        cls, q: FloatArray, equations: Rows, inequalities: Rows, cones: Sequence[Rows], *, dependent: bool = False
    ) -> ConicProgram:
        """From its rows; those of cones are one set for t, and one for each component of u."""
        d, blocks = len(cones), len(cones[0][1])
        order = np.arange(d * blocks).reshape(d, blocks).T.ravel()
        G = sparse.csr_array(sparse.vstack([matrix for matrix, _ in cones]))[order]
        g = np.column_stack([constant for _, constant in cones]).ravel()
        A = sparse.csr_array(sparse.vstack([equations[0], inequalities[0], G]))
        b = np.concatenate([equations[1], inequalities[1], g])
        return cls(q, A, b, len(equations[1]), len(inequalities[1]), d, dependent)

    def solve(self, regular: Sequence[float] = REGULAR) -> Answer | str:
        """The solver's answer; or "infeasible", or "unbounded" where it has a certificate.

        Raises
        ------
        SolveError
            If there is none, or not in time.

        """
        clarabel = load("clarabel")
        blocks = len(self._heads) - self.linear
        kinds = [clarabel.ZeroConeT(self.equal)] if self.equal else []
        kinds += [clarabel.NonnegativeConeT(self.linear)] if self.linear else []
        kinds += [clarabel.SecondOrderConeT(self.width)] * blocks
        scale = self._scale
        A = sparse.csc_array(sparse.csc_array(self.A) @ sparse.diags_array(1.0 / scale))
        q, unit = self.q / scale, float(np.abs(self.b).max(initial=0.0)) or 1.0  # its tolerances are for numbers near 1
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        gap = _COARSER if blocks > _LARGE else _TOLERANCE
        settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = gap, gap, _TOLERANCE
        settings.iterative_refinement_max_iter = _REFINED
        data = sparse.csc_matrix((len(q), len(q))), q / size, sparse.csc_matrix(A), self.b / unit, kinds
        stuck: list[Any] = []
        usual = self.dependent and _STRONGER not in regular
        for added in (None, _STRONGER) if usual else (*regular, _USUAL):  # it may break down or get stuck with one
            if added is not None:
                settings.static_regularization_constant, settings.static_regularization_proportional = added, 0.0
            settings.time_limit = max(deadline.left, _LEAST_TIME)
            answer = clarabel.DefaultSolver(*data, settings).solve()
            if str(answer.status) not in ("NumericalError", "InsufficientProgress"):
                break
            stuck.append(answer)
        else:
            answer = min(stuck, key=lambda each: np.nan_to_num(each.r_prim, nan=np.inf))
        if str(answer.status).endswith("DualInfeasible"):
            if self.falls:
                return UNBOUNDED
            settings.tol_infeas_abs = settings.tol_infeas_rel = _NEVER
            answer = clarabel.DefaultSolver(*data, settings).solve()
        word, found = str(answer.status), np.array(answer.x)
        found *= min(1.0, _ENDLESS / float(np.abs(found).max(initial=1.0)))
        x = unit * found / scale
        if word.endswith("PrimalInfeasible"):
            return INFEASIBLE
        if word == "MaxTime":
            raise SolveError("limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells")
        if not np.isfinite(x).all():
            raise SolveError(
                f"limit load: the cone program was not solved ({word}): take other units, or a coarser mesh"
            )
        z = np.array(answer.z)  # which may be 1e15, beside which alone the rest is small
        rest = float(np.linalg.norm(data[1] + A.T @ z)) * max(1.0, float(np.linalg.norm(found)))
        return Answer(x, size * z, -size * unit * (float(data[3] @ z) + rest))

    def up_to(self, most: float) -> ConicProgram:
        """The program in which −q·x is at most so much."""
        return self._extended(self.q, sparse.csr_array((len(self.b), 0)), -self.q[None], np.array([most]))

    @cached_property
    def falls(self) -> bool:
        """Whether there is a direction in which q·x falls for ever, and not by rounding only; no if none is found.

        Inequalities and cones leave a sum of 1 at most, of which q·x may fall by a millionth.
        """
        rows, program = [-self.q, -self.A[self._heads].sum(axis=0)], replace(self, b=np.zeros_like(self.b))
        program = program._extended(self.q, sparse.csr_array((len(self.b), 0)), np.vstack(rows), np.ones(2))
        found: Answer | str = INFEASIBLE
        with suppress(SolveError):
            found = program.solve((_STRONGER,) if self.dependent else REGULAR)
        if isinstance(found, str):
            return False
        x, violation = program.repaired(found.x)
        gained, power = -float(self.q @ x), float(np.abs(self.q) @ np.abs(x))
        prices = np.append(self.q, found.multipliers[program._heads])  # of what is missed; limits of gains hide some
        missed = violation * program.size(x) * float(np.abs(prices).sum())
        return gained > _GAIN * power and missed <= _MISSED * gained

    def on_faces(
        self, units: FloatArray, narrow_below: float, aside: float, known: FloatArray | None = None
    ) -> ConicProgram | None:
        """Cones without room become rays u = t û, or t = u = 0, and inequalities of flows equations; None if none is.

        The û (blocks, k, width − 1) are those that each may be. What cannot leave the surface of a cone the solver
        finds to the root of what it is missed by only, and equations exactly. Points that keep them keep the cones.
        """
        x, room = self._rooms or (self.q, np.full(1, -np.inf))
        trusted = max(narrow_below, _NEAR / 10.0 * self.dependent)  # flows on faces are taken if they are better only
        if room.min() < -trusted:  # nothing that the solver says of room is to be believed
            return None
        narrow = np.flatnonzero(room[self.linear :] < narrow_below)
        # of flows only: tractions in wedges may be huge, and leave room for all else to be missed
        met = self.equal + np.flatnonzero(self.dependent & (room[: self.linear] < narrow_below))
        blocks, size = self.blocks(x)[narrow], self.size(x)
        if known is not None:  # what is at its tip has the direction of an answer
            blocks = np.where(blocks[:, :1] > _TIP * size, blocks, self.blocks(known)[narrow])
        t, u = np.split(blocks, [1], axis=1)
        own = units[narrow]
        unit = own[np.arange(len(narrow)), np.einsum("bku,bu->bk", own, u).argmax(axis=1)]
        at_tip = t[:, 0] <= _TIP * size
        ray = ~at_tip & (np.linalg.norm(u - t * unit, axis=1) <= aside * t[:, 0])
        heads = self.equal + self.linear + self.width * narrow[:, None]
        parts, tips = heads + np.arange(1, self.width), (heads + np.arange(self.width))[at_tip]
        rows = sparse.csr_array(sparse.hstack([self.A, sparse.csr_array(self.b[:, None])]))
        along = sparse.diags_array(unit[ray].ravel()) @ rows[np.repeat(heads[ray, 0], self.width - 1)]
        new = sparse.csr_array(sparse.vstack([rows[parts[ray].ravel()] - along, rows[tips.ravel()], rows[met]]))
        norms = np.sqrt(np.asarray(new.multiply(new).sum(axis=1))).ravel()
        said = norms > HELD * norms.max(initial=0.0)
        if not said.any():
            return None
        new = sparse.csr_array(sparse.diags_array(1.0 / norms[said]) @ new[said])
        flat = np.ones(len(self.b))
        flat[np.concatenate([parts[ray].ravel(), tips.ravel(), met])] = 0.0
        others = sparse.csr_array(sparse.diags_array(flat) @ rows)[self.equal :]
        rows = sparse.csr_array(sparse.vstack([rows[: self.equal], new, others]))
        program = replace(self, A=rows[:, :-1], b=rows[:, [-1]].toarray().ravel(), equal=self.equal + int(said.sum()))
        return self._narrower.setdefault((flat.tobytes(), unit[ray].tobytes()), program)  # equal ones are one

    def _extended(self, q: FloatArray, columns: sparse.csr_array, rows: Any, limits: FloatArray) -> ConicProgram:
        """The same with more columns, then with more inequalities."""
        k, A = self.equal + self.linear, sparse.csr_array(sparse.hstack([self.A, columns]))
        A = sparse.csr_array(sparse.vstack([A[:k], sparse.csr_array(rows), A[k:]]))
        return replace(self, q=q, A=A, b=np.insert(self.b, k, limits), linear=self.linear + len(limits))

    @cached_property
    def _heads(self) -> IntArray:
        """The rows of inequalities, and of t: what is larger there leaves more room."""
        first = self.equal + self.linear
        return np.concatenate([np.arange(self.equal, first), np.arange(first, len(self.b), self.width)])

    def projected(self, x: FloatArray) -> FloatArray:
        """The point that keeps the equations and is nearest to x, in all other rows if equations are independent."""
        found, E, e = np.array(x), self.A[: self.equal], self.b[: self.equal]
        for _ in range(_SWEEPS if self.equal else 0):
            back, normal = self._nearest
            found += back @ normal.solve(e - E @ found)
        return np.asarray(found)

    @cached_property
    def _scale(self) -> FloatArray:
        """The size of each column."""
        A = sparse.csc_array(self.A)
        scale = np.sqrt(np.asarray(A.multiply(A).sum(axis=0))).ravel()
        return np.where(scale <= _ROUNDED * scale.max(initial=0.0), 1.0, scale)

    @cached_property
    def _nearest(self) -> tuple[Any, Any]:
        """H⁻¹ Eᵀ of the equations E, and E H⁻¹ Eᵀ factorised: H is Gᵀ G of other rows and q; of dependent ones 1."""
        E = self.A[: self.equal]
        back: Any = E.T
        if not self.dependent:  # they are few
            units = sparse.diags_array(1.0 / self._scale)
            G = sparse.vstack([self.A[self.equal :], sparse.csr_array(self.q[None])]) @ units
            H = sparse.csc_array(G.T @ G + _DAMPED * sparse.eye_array(len(self.q)))
            back = units @ linalg.splu(H).solve((E @ units).T.toarray())
        square = sparse.csc_array(E @ back)
        largest = float(np.abs(square.diagonal()).max())
        return back, linalg.splu(sparse.csc_array(square + _DAMPED * largest * sparse.eye_array(self.equal)))

    def blocks(self, x: FloatArray) -> FloatArray:
        """(t, u) of all blocks (blocks, width)."""
        first = self.equal + self.linear
        return np.asarray(self.b[first:] - self.A[first:] @ x).reshape(-1, self.width)

    def size(self, x: FloatArray) -> float:
        """The largest number that stands in inequalities and cones."""
        limits = self.b[self.equal : self.equal + self.linear]
        return float(max(1e-300, np.abs(limits).max(initial=0.0), np.abs(self.blocks(x)).max(initial=0.0)))

    def margins(self, x: FloatArray) -> FloatArray:
        """How far inside all inequalities and cones x is, relative to what stands in them; negative outside."""
        found = self.b[self._heads] - self.A[self._heads] @ x
        found[self.linear :] -= np.linalg.norm(self.blocks(x)[:, 1:], axis=1)
        return np.asarray(found / self.size(x))

    def repaired(self, x: FloatArray, least: float = 0.0) -> tuple[FloatArray, float]:
        """A point near x that holds everything, and what it still violates, relative: rows that leave no room.

        It is the convex combination with a point inside that is nearest to x, with the share `least` of that at least;
        equations hold but for rounding. What it violates counts beside what stands in the rows there, or at x if less.
        """
        x, inside = self.projected(x), self.projected(np.zeros_like(x))
        known, size = self.margins(inside).min(initial=1.0) > _ENOUGH, self.size(x)
        large = float(np.abs(self.q) @ np.abs(x)) or 1.0

        def off(y: FloatArray) -> float:
            """What a point violates, in the size of x: larger ones miss no less."""
            return float(-self.margins(y).min(initial=0.0)) * self.size(y) / size

        def worse(y: FloatArray) -> tuple[bool, float]:
            """Whether that is no rounding; then that, and what flows dissipate: those inside may dissipate much."""
            violated = off(y)
            return violated > HELD, violated / HELD + float(self.q @ y) / large * self.dependent

        missed = off(x)
        if self.dependent and missed > ROUNDING and not (known and self._share(x, inside) < _LITTLE):
            # Once more, with as much room: flows inside may dissipate much more.
            found = self.tightened(room=_TIGHTER * missed * size).solve()
            x = min([x] if isinstance(found, str) else [x, self.projected(found.x)], key=worse)
            missed = off(x)
        if least or missed > ROUNDING:
            point = inside if known else self._inside()
            if point is not None:
                moved = x + min(1.0, self._share(x, point) * (1.0 + 1e-9) + least) * (point - x)
                if least or worse(moved) < worse(x):  # rows without room gain nothing by it
                    x = moved
        E, e = self.A[: self.equal], self.b[: self.equal]
        broken = np.abs(E @ x - e) / (1.0 + abs(E) @ np.abs(x))
        return x, float(max(off(x), -self.margins(x).min(initial=0.0), broken.max(initial=0.0)))

    def _share(self, x: FloatArray, inside: FloatArray) -> float:
        """How far x must go towards a point inside to keep what that keeps with room."""
        margins, room = self.margins(x), self.margins(inside)
        outside = (margins < 0.0) & (room > _ROOM)
        missed = -margins[outside] * max(1.0, self.size(x) / self.size(inside))
        return float((missed / (room[outside] + missed)).max(initial=0.0))

    def room(self) -> tuple[FloatArray, float]:
        """The point that is farthest inside all inequalities and cones, and how far: negative if it is outside."""
        found = self._roomy(each=False).solve()
        return (np.zeros(0), -np.inf) if isinstance(found, str) else (self.projected(found.x[:-1]), float(found.x[-1]))

    def _inside(self) -> FloatArray | None:
        """A point as far inside as can be, as far as rows leave room."""
        if not self.dependent:  # flows far inside dissipate much more
            x, room = self.room()
            if room > 0.0 and self.margins(x).min(initial=1.0) > ROUNDING:
                return x
        return None if self._rooms is None else self._rooms[0]

    @cached_property
    def _rooms(self) -> tuple[FloatArray, FloatArray] | None:
        """A point as far inside all rows as can be, up to 1e-3, and how far inside each of them."""
        found, n = self._roomy(each=True).solve(REGULAR[::-1]), len(self.q)  # without interior, the most is best
        return None if isinstance(found, str) else (self.projected(found.x[:n]), found.x[n:])

    def _roomy(self, *, each: bool) -> ConicProgram:
        """Max m ≤ 1, with m taken off all rows; or Σ m_i, less a little of all t, with 0 ≤ m_i ≤ 1e-3 for each row."""
        heads, n = self._heads, len(self.q)
        count = len(heads) if each else 1
        which = np.arange(count) if each else np.zeros(len(heads), dtype=np.int64)
        columns = sparse.csr_array((np.ones(len(heads)), (heads, which)), shape=(len(self.b), count))
        own = sparse.hstack([sparse.csr_array((count, n)), sparse.eye_array(count)])
        bounds = sparse.vstack([own, -own]) if each else own
        limits = np.concatenate([np.full(count, _NEAR if each else 1.0), np.zeros(count if each else 0)])
        small = (_SMALL if each else 0.0) * np.asarray(self.A[heads[self.linear :]].sum(axis=0)).ravel() / count
        return self._extended(np.concatenate([-small, -np.ones(count) / count]), columns, bounds, limits)

    def tightened(self, share: float = 0.0, room: float = 0.0) -> ConicProgram:
        """The program with limits less by a share of them, if positive, and by a room."""
        b = self.b.copy()
        b[self._heads] -= share * np.maximum(b[self._heads], 0.0) + room
        program = replace(self, b=b)
        if "falls" in vars(self):  # it does not depend on b, and takes as long as several solves
            vars(program)["falls"] = self.falls
        return program
