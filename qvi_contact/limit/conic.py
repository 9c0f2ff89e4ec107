"""Second-order cone programs by Clarabel, and answers corrected to be feasible: proofs use x, not the solver's word.

min q·x   s.t.   s = b − A x:   s = 0 in the first rows,   s ≥ 0 in those after them,   |u_i| ≤ t_i in blocks (t, u)_i

The *size* of a point x is the largest number in the inequalities and cones. The *margin* of a row says how far x is
inside it, over the size; *room* is the largest margin that a point can have.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse import linalg

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.errors import SolveError
from solvers.basics.progress import deadline
from solvers.basics.types import load
from solvers.inner.linear_program import solved

_TOLERANCE: Final = 1e-9  # of the solver, for feasibility and duality gap
_COARSER: Final = 1e-7  # duality gap of the solver in large programs; bounds are computed from x in any case
_LARGE: Final = 4000  # blocks of a large program
_REGULAR: Final = (1e-12, 1e-11, 1e-10)  # regularisations of the solver, tried in turn: larger ones lose thin triangles
_USUAL: Final = 1e-8  # the last regularisation: others lose dependent equations and undetermined stresses
_REFINED: Final = 30  # largest number of the solver's steps of iterative refinement
_ROUNDED: Final = 1e-14  # of the norm of the largest column: columns below are rounding
_DAMPED: Final = 1e-14  # relative damping of normal equations whose rows may be dependent
_SWEEPS: Final = 4  # steps of the projection on the equations
HELD: Final = 1e-7  # largest violation, relative to the size, that counts as rounding
ROUNDING: Final = 1e-11  # violation, relative to the size, that is not worth a correction
_ROOM: Final = 1e-9  # margin of the inner point up to which a row has no room
_ROOMY: Final = 1e-3  # margin of the inner point above which all rows have room; below −1e-3 no point keeps them
_SLACK: Final = 1e-4  # of the size: a plane with a larger s at a point that breaks rows by 1e-8 at most is no equation
_DEPENDENT: Final = 1e-11  # part of an equation that others lack, relative: they differ by 1e-4 or more, or by rounding
_MOST_PLANES: Final = 6000  # planes and inequalities up to which faces are sought: programs of more take minutes
_SMALL: Final = 1e-5  # price of t relative to room: without it, inner flows dissipate more for no more room
_NEAR: Final = 1e-3  # largest margin of the inner point of flows
APART: Final = 1e2  # ratio to the least strength up to which strengths are weighted alike
_GAIN: Final = 1e-9  # of the sum of |q_i x_i|, and of the fall 1 that is asked for: a smaller fall of q·x is rounding
_MISSED: Final = 0.1  # of the fall of q·x: largest share that may come from violated rows
_DEARER: Final = 1e3  # ratio of what a violation counts to what it costs by multipliers
_ENDLESS: Final = 1e50  # largest point: a larger one is a direction, and its square might overflow
_LEAST_TIME: Final = 1.0  # least time limit of one program, in seconds

INFEASIBLE: Final = "infeasible"
UNBOUNDED: Final = "unbounded"
LATE: Final = "limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells"

Rows: TypeAlias = tuple[Any, FloatArray]
"""Sparse rows A and constants b of s = b − A x."""


def beside(strengths: FloatArray, least: float, share: float = 1.0) -> FloatArray:
    """`share` times strength over the least strength of a body where that ratio exceeds 1e2; else 1."""
    ratio = strengths / least
    return np.where(ratio > APART, share * ratio, 1.0)


class Answer(NamedTuple):
    """The solver's answer, unchecked."""

    x: FloatArray
    multipliers: FloatArray  # of all rows: q + Aᵀ multipliers = 0
    least: float  # lower bound of q·x by the multipliers, among points no larger than x, or than limits


@dataclass(frozen=True, eq=False)
class ConicProgram:
    """The cone program in the form of the module's docstring.

    If equations may depend on each other (`dependent`), the solver's own regularisation is needed, with which badly
    scaled numbers are lost. The programs of flows are of this kind.
    """

    q: FloatArray
    A: sparse.csr_array
    b: FloatArray
    equal: int  # equations
    linear: int  # inequalities
    width: int  # rows of a block
    dependent: bool = False

    @classmethod
    def of(
        cls, q: FloatArray, equations: Rows, inequalities: Rows, cones: Sequence[Rows], *, dependent: bool = False
    ) -> ConicProgram:
        """The program of its rows. `cones` has one set of rows for t, and one for each component of u."""
        d, blocks = len(cones), len(cones[0][1])
        order = np.arange(d * blocks).reshape(d, blocks).T.ravel()
        G = sparse.csr_array(sparse.vstack([matrix for matrix, _ in cones]))[order]
        g = np.column_stack([constant for _, constant in cones]).ravel()
        A = sparse.csr_array(sparse.vstack([equations[0], inequalities[0], G]))
        b = np.concatenate([equations[1], inequalities[1], g])
        return cls(q, A, b, len(equations[1]), len(inequalities[1]), d, dependent)

    def solve(self, regular: Sequence[float] = _REGULAR, *, share: float = 0.0, room: float = 0.0) -> Answer | str:
        """The solver's answer; or "infeasible", or "unbounded", if the solver has a certificate of that.

        The answer keeps positive limits reduced by a share, and all limits reduced by a room. `SolveError` if there is
        none, or not in time.
        """
        clarabel = load("clarabel")
        blocks = len(self._heads) - self.linear
        cones = [clarabel.ZeroConeT(self.equal)] if self.equal else []
        cones += [clarabel.NonnegativeConeT(self.linear)] if self.linear else []
        cones += [clarabel.SecondOrderConeT(self.width)] * blocks
        scale, b = self._scale, self.b.copy()
        b[self._heads] -= share * np.maximum(b[self._heads], 0.0) + room
        A = sparse.csc_array(sparse.csc_array(self.A) @ sparse.diags_array(1.0 / scale))
        q, unit = self.q / scale, float(np.abs(b).max(initial=0.0)) or 1.0
        size = float(np.abs(q).max(initial=0.0)) or 1.0  # the solver's tolerances are for numbers near 1
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        gap = _COARSER if blocks > _LARGE else _TOLERANCE
        settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = gap, gap, _TOLERANCE
        settings.iterative_refinement_max_iter, settings.static_regularization_proportional = _REFINED, 0.0
        data = sparse.csc_matrix((len(q), len(q))), q / size, sparse.csc_matrix(A), b / unit, cones
        failed: list[Any] = []
        for regularisation in (_USUAL,) if self.dependent else (*regular, _USUAL):  # one may fail
            settings.static_regularization_constant = regularisation
            settings.time_limit = max(deadline.left, _LEAST_TIME)
            answer = clarabel.DefaultSolver(*data, settings).solve()
            if str(answer.status).endswith("DualInfeasible"):
                if self.falls:
                    return UNBOUNDED
                settings.tol_infeas_rel = settings.reduced_tol_infeas_rel = 1e-300  # never: it would stop too early
                answer = clarabel.DefaultSolver(*data, settings).solve()
            if not str(answer.status).endswith(("NumericalError", "InsufficientProgress")):
                break
            failed.append(answer)
        else:
            answer = min(failed, key=lambda each: np.nan_to_num(each.r_prim, nan=np.inf))
        status, scaled_x = str(answer.status), np.array(answer.x)
        scaled_x *= min(1.0, _ENDLESS / float(np.abs(scaled_x).max(initial=1.0)))
        x = unit * scaled_x / scale
        if status.endswith("PrimalInfeasible"):
            return INFEASIBLE
        if status == "MaxTime":
            raise SolveError(LATE)
        if not np.isfinite(x).all():
            raise SolveError(
                f"limit load: the cone program was not solved ({status}): take other units, or a coarser mesh"
            )
        z = np.array(answer.z)  # may be as large as 1e15; the misfit of the dual equations is small relative to it
        misfit = float(np.linalg.norm(data[1] + A.T @ z)) * max(1.0, float(np.linalg.norm(scaled_x)))
        return Answer(x, size * z, -size * unit * (float(data[3] @ z) + misfit))

    def at_vertex(self) -> Answer | None:
        """The answer of a linear program by the simplex method, None if there is none or no program without cones.

        Its multipliers are exact, also where no point is inside all inequalities.
        """
        A, (first, n) = sparse.csc_array(self.A @ sparse.diags_array(1.0 / self._scale)), (self.equal, len(self.q))
        if len(self.b) > first + self.linear:
            return None
        rows = {"A_ub": A[first:], "b_ub": self.b[first:], "A_eq": A[:first], "b_eq": self.b[:first]}
        found = solved(self.q / self._scale, bounds=[(None, None)] * n, **rows)
        multipliers = -np.append(found.equations, found.inequalities)
        return Answer(found.x / self._scale, multipliers, -float(self.b @ multipliers)) if found.solved else None

    def price(self, x: FloatArray, multipliers: FloatArray) -> float:
        """By how much q·x may be too small as x violates rows: what multipliers say, and more as they are rough."""
        lacking, misfit = np.maximum(-self.margins(x), 0.0) * self.size(x), np.abs((self.b - self.A @ x)[: self.equal])
        prices = np.abs(multipliers)
        return _DEARER * float(lacking @ prices[self._heads] + misfit @ prices[: self.equal])

    def up_to(self, most: float) -> ConicProgram:
        """The program with −q·x ≤ `most` added."""
        return self._extended(self.q, -self.q[None], np.array([most]))

    @cached_property
    def falls(self) -> bool:
        """Whether q·x falls without end along some direction, by more than rounding; False if no direction is found.

        A direction has b = 0 and q·x ≥ −1. Directions of any size are tried first. Rounding may spoil large ones; then
        heads of cones and slacks of inequalities have a sum of at most 1.
        """
        any_size = replace(self, b=np.zeros_like(self.b)).up_to(1.0)
        if any_size._answer_falls():
            return True
        return any_size._extended(self.q, -self.A[self._heads].sum(axis=0)[None], np.ones(1))._answer_falls()

    def _answer_falls(self) -> bool:
        """Whether the program has an answer with q·x < 0, by more than rounding."""
        answer: Answer | str = INFEASIBLE
        with suppress(SolveError):
            answer = self.solve()
        if isinstance(answer, str):
            return False
        x = self.projected(answer.x)  # nearer to inner points it may fall no more
        fall, magnitude = -float(self.q @ x), float(np.abs(self.q) @ np.abs(x))
        # effect of the violation on q·x, by the multipliers; q stands in where limits of the fall hide a multiplier
        prices = np.append(self.q, answer.multipliers[self._heads])
        effect = -float(self.margins(x).min(initial=0.0)) * self.size(x) * float(np.abs(prices).sum())
        return fall > _GAIN * max(1.0, magnitude) and effect <= _MISSED * fall

    def on_faces(self, directions: FloatArray) -> ConicProgram | None:
        """The program on faces of its cones that hold all its points, by the planes tried; None if no row is equal.

        A plane t ≥ û·u that holds with equality at all points leaves the ray u = t û of its cone, and two such planes
        leave the tip t = u = 0. New equations state that, and may make further planes equal. The û are `directions`
        (blocks, k, width − 1) and the axes. Up to rounding, every point of the new program is one of the old. Of more
        than `_MOST_PLANES` planes none is tried.
        """
        axes = np.concatenate([np.eye(self.width - 1), -np.eye(self.width - 1)])
        planes = np.concatenate([directions, np.broadcast_to(axes, (len(directions), *axes.shape))], axis=1)
        program = self
        while abs(program.room[1]) <= _ROOMY and not deadline.over:  # else all rows have room, or no point keeps them
            equal_rows, equal_planes = program._made_equal(planes)
            if not (equal_rows.any() or equal_planes.any()):
                break
            program = program._on(equal_rows, equal_planes, planes)
        return None if program is self else program

    def _made_equal(self, planes: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Which inequalities (linear,), and planes t ≥ û·u (blocks, k), are equations at all points.

        The points times all τ ≥ 1 are those of s = b τ − A x. So the linear program max Σ m, 0 ≤ m ≤ 1, s ≥ m of all
        inequalities and planes has an answer whose m are 0 or 1. A tolerance decides only which rows are zero.
        Equations have λ > 0 with Σ λ s = 0 at all points. So a plane far from 0 at the point farthest inside all cones
        is none of them. Of the others, the nearest is tried, or all where t is small.
        """
        first, x = self.equal + self.linear, self.room[0]
        rows, of_rows, of_cones = self._homogeneous
        t, u = np.split(self.blocks(x), [1], axis=1)
        slack, small = t - np.einsum("bc,bkc->bk", u, planes), _SLACK * self.size(x)
        is_tried = (slack <= small) & ((t <= small) | (np.arange(planes.shape[1]) == slack.argmin(axis=1)[:, None]))
        block, plane = np.nonzero(is_tried & (of_cones > _ROUNDED * of_rows.max(initial=0.0))[:, None])
        if self.linear + len(block) > _MOST_PLANES:
            return np.zeros(self.linear, dtype=bool), np.zeros(planes.shape[:2], dtype=bool)
        heads = first + self.width * block
        units = enumerate(planes[block, plane].T, 1)
        tangents: list[Any] = [sparse.diags_array(unit) @ rows[heads + c] for c, unit in units]
        G = sparse.csr_array(sparse.vstack([rows[self.equal : first], rows[heads] - sum(tangents)]))
        # planes that are zero, relative to their cones, are equal; rows that are zero already are not replaced
        norms = linalg.norm(G, axis=1)
        used = norms > HELD * np.append(of_rows[self.equal : first], of_cones[block])
        is_equal = np.append(np.zeros(self.linear, dtype=bool), np.ones(len(block), dtype=bool))
        n, count = G.shape[1], int(np.count_nonzero(used))
        G = sparse.csr_array(sparse.diags_array(1.0 / norms[used]) @ G[used])
        E = sparse.diags_array(1.0 / np.where(of_rows > 0.0, of_rows, 1.0)[: self.equal]) @ rows[: self.equal]
        above = sparse.csc_array(sparse.hstack([-G, sparse.eye_array(count)]))
        equations = sparse.csc_array(sparse.hstack([E, sparse.csc_array((self.equal, count))]))
        bounds = [*[(None, None)] * (n - 1), (1.0, None), *[(0.0, 1.0)] * count]
        cost, zeros = np.repeat([0.0, -1.0], [n, count]), np.zeros(self.equal)
        answer = solved(cost, bounds=bounds, A_ub=above, b_ub=np.zeros(count), A_eq=equations, b_eq=zeros)
        is_equal[used] = answer.x[n:] < 0.5 if answer.solved else False
        equal_planes = np.zeros(planes.shape[:2], dtype=bool)
        equal_planes[block, plane] = is_equal[self.linear :]
        return is_equal[: self.linear], equal_planes

    def _on(self, equal_rows: BoolArray, equal_planes: BoolArray, planes: FloatArray) -> ConicProgram:
        """The program with inequalities and planes made equations; rows of the cones that these replace become zero."""
        first, blocks = self.equal + self.linear, len(planes)
        unit = planes[np.arange(blocks), equal_planes.argmax(axis=1)]
        is_tip = (equal_planes & (np.linalg.norm(planes - unit[:, None], axis=2) > HELD)).any(axis=1)
        ray, heads = equal_planes.any(axis=1) & ~is_tip, first + self.width * np.arange(blocks)[:, None]
        # new equations u − t û = 0, t = u = 0, and equal inequalities, scaled; the rows they replace become zero
        u_rows, tips = heads + np.arange(1, self.width), (heads + np.arange(self.width))[is_tip]
        made_equal = self.equal + np.flatnonzero(equal_rows)
        rows = sparse.csr_array(sparse.hstack([self.A, sparse.csr_array(self.b[:, None])]))
        along = sparse.diags_array(unit[ray].ravel()) @ rows[np.repeat(heads[ray, 0], self.width - 1)]
        new = sparse.csr_array(sparse.vstack([rows[u_rows[ray].ravel()] - along, rows[tips.ravel()], rows[made_equal]]))
        # rows that are zero, relative to their cones, are no equations; triangles of a graded mesh differ much in size
        _, _, of_cones = self._homogeneous
        own = [of_cones[ray].repeat(self.width - 1), of_cones[is_tip].repeat(self.width), np.zeros(len(made_equal))]
        used = linalg.norm(new @ self._units, axis=1) > HELD * np.concatenate(own)
        scaled = sparse.diags_array(1.0 / linalg.norm(new[used], axis=1)) @ new[used]
        equations = sparse.csr_array(sparse.vstack([rows[: self.equal], scaled]))
        if not self.dependent:  # solvers lose programs whose equations contradict each other by rounding
            columns = (equations @ self._units).toarray().T
            R, order = qr(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), mode="r", pivoting=True)
            equations = equations[order[: np.count_nonzero(np.abs(R.diagonal()) > _DEPENDENT)]]
        kept = np.ones(len(self.b))
        kept[np.concatenate([u_rows[ray].ravel(), tips.ravel(), made_equal])] = 0.0
        others = sparse.csr_array(sparse.diags_array(kept) @ rows)[self.equal :]
        rows = sparse.csr_array(sparse.vstack([equations, others]))
        return replace(self, A=rows[:, :-1], b=rows[:, [-1]].toarray().ravel(), equal=equations.shape[0])

    def _extended(self, q: FloatArray, rows: Any, limits: FloatArray, *columns: sparse.csr_array) -> ConicProgram:
        """The program with more columns, then with more inequalities."""
        k, A = self.equal + self.linear, sparse.csr_array(sparse.hstack([self.A, *columns]))
        A = sparse.csr_array(sparse.vstack([A[:k], sparse.csr_array(rows), A[k:]]))
        return replace(self, q=q, A=A, b=np.insert(self.b, k, limits), linear=self.linear + len(limits))

    @cached_property
    def _heads(self) -> IntArray:
        """The rows of inequalities and of t: a larger value there means more room."""
        first = self.equal + self.linear
        return np.concatenate([np.arange(self.equal, first), np.arange(first, len(self.b), self.width)])

    @cached_property
    def _has_rows(self) -> BoolArray:
        """Whether inequalities and cones have not been replaced by equations, which leave rows of zeros."""
        return np.asarray((abs(self.A[self._heads]).sum(axis=1) + np.abs(self.b[self._heads])) > 0.0)

    def projected(self, x: FloatArray) -> FloatArray:
        """The nearest point to x that keeps the equations."""
        point, E, e = np.array(x), self.A[: self.equal], self.b[: self.equal]
        for _ in range(_SWEEPS if self.equal else 0):
            point += E.T @ self._nearest.solve(e - E @ point)
        return np.asarray(point)

    @cached_property
    def _scale(self) -> FloatArray:
        """The norm of each column; 1 for columns that are rounding."""
        scale = np.asarray(linalg.norm(self.A, axis=0))
        return np.where(scale <= _ROUNDED * scale.max(initial=0.0), 1.0, scale)

    @property
    def _units(self) -> Any:
        """The units of x and τ in s = b τ − A x, as a diagonal matrix."""
        return sparse.diags_array(1.0 / np.append(self._scale, np.abs(self.b).max(initial=0.0) or 1.0))

    @cached_property
    def _homogeneous(self) -> tuple[sparse.csr_array, FloatArray, FloatArray]:
        """Rows of s = b τ − A x in `_units`, their norms, and the largest norm of each cone."""
        rows = sparse.csr_array(sparse.hstack([-self.A, sparse.csr_array(self.b[:, None])]) @ self._units)
        norms: FloatArray = np.asarray(linalg.norm(rows, axis=1), dtype=np.float64)
        return rows, norms, np.asarray(norms[self.equal + self.linear :].reshape(-1, self.width).max(axis=1))

    @cached_property
    def _nearest(self) -> Any:
        """E Eᵀ for the equations E, factorised."""
        E = self.A[: self.equal]
        square = sparse.csc_array(E @ E.T)
        largest = float(np.abs(square.diagonal()).max()) or 1.0  # loads of zero have the equation 0 = 0
        return linalg.splu(sparse.csc_array(square + _DAMPED * largest * sparse.eye_array(self.equal)))

    def blocks(self, x: FloatArray) -> FloatArray:
        """(t, u) of all blocks (blocks, width)."""
        first = self.equal + self.linear
        return np.asarray(self.b[first:] - self.A[first:] @ x).reshape(-1, self.width)

    def size(self, x: FloatArray) -> float:
        """The largest number in inequalities and cones."""
        limits = self.b[self.equal : self.equal + self.linear]
        return float(max(1e-300, np.abs(limits).max(initial=0.0), np.abs(self.blocks(x)).max(initial=0.0)))

    def margins(self, x: FloatArray) -> FloatArray:
        """How far x is inside all inequalities and cones, relative to its size; negative outside."""
        margins = self.b[self._heads] - self.A[self._heads] @ x
        margins[self.linear :] -= np.linalg.norm(self.blocks(x)[:, 1:], axis=1)
        margins[~self._has_rows] = self.size(x)
        return np.asarray(margins / self.size(x))

    def repaired(self, x: FloatArray, least: float = 0.0) -> tuple[FloatArray, float]:
        """A point near x that keeps all rows, and its largest violation, relative, which rows without room cause.

        The point is the convex combination with an inner point that is nearest to x, with at least the share `least`
        of it. Equations hold up to rounding. A violation is relative to the size of the point, or of x if smaller.
        """
        x, E, e = self.projected(x), self.A[: self.equal], self.b[: self.equal]
        size = self.size(x)
        if least or self.margins(x).min(initial=0.0) < -ROUNDING:
            inside = self.projected(np.zeros_like(x))
            point, room = (inside, 1.0) if self.margins(inside).min(initial=1.0) > _ROOMY else self.room
            if room > 0.0:
                margins, rooms = self.margins(x), self.margins(point)
                is_outside = (margins < 0.0) & (rooms > _ROOM)  # rows that have room
                lacking, spare = -margins[is_outside] * size, rooms[is_outside] * self.size(point)
                share = float((lacking / (spare + lacking)).max(initial=0.0))
                x = x + min(1.0, share * (1.0 + 1e-9) + least) * (point - x)
        violation = -float(self.margins(x).min(initial=0.0)) * max(1.0, self.size(x) / size)
        equation_misfit = np.abs(E @ x - e) / (1.0 + abs(E) @ np.abs(x))
        return x, float(max(violation, equation_misfit.max(initial=0.0)))

    @cached_property
    def room(self) -> tuple[FloatArray, float]:
        """The point farthest inside all inequalities and cones, and its distance; negative if it is outside.

        The distance is at most 1, relative to the limits. Flows far inside dissipate too much: theirs is at most 1e-3,
        less a little of the mean of all t.
        """
        unit = self.size(0.0 * self.q) if np.any(self.b[self._heads]) else 1.0
        heads = self._heads[self._has_rows]
        column = sparse.csr_array((np.full(len(heads), unit), (heads, 0 * heads)), shape=(len(self.b), 1))
        row, most = np.append(0.0 * self.q, 1.0), _NEAR if self.dependent else 1.0
        price, of_cones = 0.0 * row, self._heads[self.linear :]
        if self.dependent and len(of_cones):
            price[:-1] = _SMALL * np.asarray(self.A[of_cones].mean(axis=0)).ravel()
        program = self._extended(-row - price, row[None], np.array([most]), column)
        found = program.solve((_USUAL,))  # without an interior others find it only up to 1e-4
        return (np.zeros(0), -np.inf) if isinstance(found, str) else (self.projected(found.x[:-1]), float(found.x[-1]))
