"""Second-order cone programs by Clarabel, and answers made to hold: what is proved comes from x, not from the solver.

min q·x   s.t.   E x = e,   L x ≤ h,   |u_i(x)| ≤ t_i(x)  with  (t, u)_i = g_i − G_i x
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

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
_REGULAR: Final = 1e-12  # added to its matrices: by default 1e-8, in which fans of thin triangles are lost
_REFINED: Final = 30  # steps of its iterative refinement, at most
_DAMPED: Final = 1e-14  # added to the normal equations of E, whose rows may depend on each other
_SWEEPS: Final = 4  # of the projection on E x = e
HELD: Final = 1e-7  # violation, relative to what stands in the rows, that counts as rounding
ROUNDING: Final = 1e-11  # of sizes: violation that is not worth a second program
_ROOM: Final = 1e-9  # of sizes: rows that no point is farther inside leave no room
_NEAR: Final = 1e-3  # room that is enough in each row: more of it in some rows may leave none in others
_TIGHTER: Final = 4.0  # times what an answer misses, which is asked for in a second program
_NEVER: Final = 1e-300  # what "unbounded" must reach once it was found to be rounding
_LEAST_TIME: Final = 1.0  # seconds for one program, at least

INFEASIBLE: Final = "infeasible"
UNBOUNDED: Final = "unbounded"


@dataclass(frozen=True, eq=False)
class Cones:
    """Blocks (t, u)_i = g_i − G_i x of one size, |u_i| ≤ t_i."""

    G: sparse.csr_array  # (b d, n) the rows, block by block
    g: FloatArray  # (b, d) the constants

    @classmethod
    def of(cls, parts: Sequence[tuple[Any, FloatArray]]) -> Cones:
        """Blocks of t and of the components of u, each a matrix (b, n) and constants (b,) of t or u = c − A x."""
        b = len(parts[0][1])
        order = np.arange(len(parts) * b).reshape(len(parts), b).T.ravel()
        G = sparse.csr_array(sparse.csr_array(sparse.vstack([matrix for matrix, _ in parts]))[order])
        return cls(G, np.column_stack([constant for _, constant in parts]))

    def blocks(self, x: FloatArray) -> FloatArray:
        """(t, u) of all blocks (b, d)."""
        return np.asarray(self.g - (self.G @ x).reshape(self.g.shape))

    def margins(self, x: FloatArray) -> FloatArray:
        """T − |u| of all blocks (b,): negative where x is outside."""
        blocks = self.blocks(x)
        return np.asarray(blocks[:, 0] - np.linalg.norm(blocks[:, 1:], axis=1))


@dataclass(frozen=True, eq=False)
class ConicProgram:
    """The program above.

    Rows of E that may depend on each other (`dependent`) need the solver's own regularisation, in which what is badly
    scaled is lost.
    """

    q: FloatArray
    E: sparse.csr_array
    e: FloatArray
    L: sparse.csr_array
    h: FloatArray
    cones: Cones
    dependent: bool = False

    def solve(self) -> FloatArray | str:
        """The solver's x, unchecked; or "infeasible", or "unbounded" where it has a certificate.

        Raises
        ------
        SolveError
            If there is no x, or not in time.

        """
        found = self.answered()
        return found if isinstance(found, str) else found[0]

    def rows(self) -> tuple[sparse.csc_array, FloatArray]:
        """All rows (A, b), A x ≤ b or = b: those of E, of L, and of the cones."""
        parts = [(self.E, self.e), (self.L, self.h), (self.cones.G, self.cones.g.ravel())]
        A = sparse.csc_array(sparse.vstack([matrix for matrix, _ in parts]))
        return A, np.concatenate([vector for _, vector in parts])

    def answered(self) -> tuple[FloatArray, FloatArray] | str:
        """What `solve` gives, with the multipliers of all `rows`: q + Aᵀ multipliers = 0."""
        clarabel = load("clarabel")
        A, b = self.rows()
        kinds = [clarabel.ZeroConeT(len(self.e))] if len(self.e) else []
        kinds += [clarabel.NonnegativeConeT(len(self.h))] if len(self.h) else []
        kinds += [clarabel.SecondOrderConeT(self.cones.g.shape[1])] * len(self.cones.g)
        scale = np.sqrt(np.asarray(A.multiply(A).sum(axis=0))).ravel()
        scale[scale == 0.0] = 1.0
        A = sparse.csc_array(A @ sparse.diags_array(1.0 / scale))
        q, unit = self.q / scale, float(np.abs(b).max(initial=0.0)) or 1.0  # its tolerances are for numbers of size 1
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.max_threads = False, 1
        gap = _COARSER if len(self.cones.g) > _LARGE else _TOLERANCE
        settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = gap, gap, _TOLERANCE
        if not self.dependent:
            settings.static_regularization_constant, settings.static_regularization_proportional = _REGULAR, 0.0
        settings.iterative_refinement_max_iter = _REFINED
        settings.time_limit = max(deadline.left, _LEAST_TIME)
        n = len(self.q)
        data = sparse.csc_matrix((n, n)), q / size, sparse.csc_matrix(A), b / unit, kinds
        answer = clarabel.DefaultSolver(*data, settings).solve()
        if str(answer.status).endswith("DualInfeasible"):
            if self._falls():
                return UNBOUNDED
            settings.tol_infeas_abs = settings.tol_infeas_rel = _NEVER
            answer = clarabel.DefaultSolver(*data, settings).solve()
        word, x = str(answer.status), unit * np.array(answer.x) / scale
        if word.endswith("PrimalInfeasible"):
            return INFEASIBLE
        if word == "MaxTime":
            raise SolveError("limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells")
        if not np.isfinite(x).all():
            raise SolveError(
                f"limit load: the cone program was not solved ({word}): take other units, or a coarser mesh"
            )
        return np.asarray(x), size * np.array(answer.z)

    def _falls(self) -> bool:
        """Whether there is a direction in which q·x falls for ever, and not by rounding only."""
        cones = Cones(self.cones.G, np.zeros_like(self.cones.g))
        L = sparse.csr_array(sparse.vstack([self.L, sparse.csr_array(-self.q[None])]))
        program = replace(self, e=np.zeros_like(self.e), L=L, h=np.append(np.zeros_like(self.h), 1.0), cones=cones)
        found = program.solve()
        if isinstance(found, str):
            return False
        x, violation = program.repaired(found)
        gained = -float(self.q @ x)  # 1, which the last row of L allows, if there is such a direction
        return gained > max(0.5, HELD * float(np.abs(self.q) @ np.abs(x))) and violation * program.size(x) <= HELD

    def projected(self, x: FloatArray) -> FloatArray:
        """The nearest point with E x = e, rows of which may depend on each other."""
        found = np.array(x)
        for _ in range(_SWEEPS if len(self.e) else 0):
            found += self.E.T @ self._normal.solve(self.e - self.E @ found)
        return np.asarray(found)

    @cached_property
    def _normal(self) -> Any:
        """The factorised E Eᵀ."""
        square = sparse.csc_array(self.E @ self.E.T)
        largest = float(np.abs(square.diagonal()).max())
        return linalg.splu(sparse.csc_array(square + _DAMPED * largest * sparse.eye_array(square.shape[0])))

    def size(self, x: FloatArray) -> float:
        """The largest number that stands in inequalities and cones."""
        return float(max(1e-300, np.abs(self.h).max(initial=0.0), np.abs(self.cones.blocks(x)).max(initial=0.0)))

    def margins(self, x: FloatArray) -> FloatArray:
        """How far inside all inequalities and cones x is, relative to what stands in them."""
        found = np.concatenate([self.h - self.L @ x, self.cones.margins(x)])
        return np.asarray(found / self.size(x))

    def repaired(self, x: FloatArray, least: float = 0.0) -> tuple[FloatArray, float]:
        """A point near x that holds everything, and what it still violates, relative: rows that leave no room.

        It is the convex combination with a point inside that is nearest to x, with the share `least` of that at least;
        E x = e but for rounding.
        """
        x = self.projected(x)
        margins = self.margins(x)
        if margins.min(initial=0.0) < -ROUNDING:  # once more, from rows that are tighter by what is missed
            found = self.tightened(room=_TIGHTER * float(-margins.min()) * self.size(x)).solve()
            nearby = x if isinstance(found, str) else self.projected(found)
            if self.margins(nearby).min(initial=0.0) > margins.min():
                x, margins = nearby, self.margins(nearby)
        if least or margins.min(initial=0.0) < -ROUNDING:
            inside = self._inside()
            if inside is not None:
                room = self.margins(inside)
                outside = (margins < 0.0) & (room > _ROOM)
                share = float((-margins[outside] / (room[outside] - margins[outside])).max(initial=0.0))
                x = x + min(1.0, share * (1.0 + 1e-9) + least) * (inside - x)
                margins = self.margins(x)
        missed = np.abs(self.E @ x - self.e) / (1.0 + abs(self.E) @ np.abs(x))
        return x, float(max(-margins.min(initial=0.0), missed.max(initial=0.0), 0.0))

    def room(self) -> tuple[FloatArray, float]:
        """The point that is farthest inside all inequalities and cones, and how far: negative if it is outside."""
        found = self._roomy(each=False).solve()
        return (self.projected(found[:-1]), float(found[-1])) if not isinstance(found, str) else (np.zeros(0), -np.inf)

    def _inside(self) -> FloatArray | None:
        """A point as far inside as can be, as far as rows leave room."""
        x, room = self.room()
        if room > 0.0 and self.margins(x).min(initial=0.0) > ROUNDING:
            return x
        found = self._roomy(each=True).solve()
        return None if isinstance(found, str) else self.projected(found[: len(self.q)])

    def _roomy(self, *, each: bool) -> ConicProgram:
        """Max m ≤ 1, with m taken off all rows; or Σ m_i with one for each row, 0 ≤ m_i ≤ 1e-3."""
        (blocks, d), (rows, n) = self.cones.g.shape, self.L.shape
        count = rows + blocks if each else 1

        def more(size: int, start: int, places: IntArray) -> sparse.csr_array:
            columns = start + np.arange(len(places)) if each else np.zeros(len(places), dtype=np.int64)
            return sparse.csr_array((np.ones(len(places)), (places, columns)), shape=(size, count))

        G = sparse.csr_array(sparse.hstack([self.cones.G, more(blocks * d, rows, d * np.arange(blocks))]))
        own = sparse.hstack([sparse.csr_array((count, n)), sparse.eye_array(count)])
        bounds = [sparse.hstack([self.L, more(rows, 0, np.arange(rows))]), own, *([-own] if each else [])]
        h = np.concatenate([self.h, np.full(count, _NEAR if each else 1.0), np.zeros(count if each else 0)])
        q = np.concatenate([np.zeros(n), -np.ones(count) / count])
        E = sparse.csr_array(sparse.hstack([self.E, sparse.csr_array((len(self.e), count))]))
        L = sparse.csr_array(sparse.vstack(bounds))
        return ConicProgram(q, E, self.e, L, h, Cones(G, self.cones.g), self.dependent)

    def tightened(self, share: float = 0.0, room: float = 0.0) -> ConicProgram:
        """The program with constants of inequalities and cones less by a share of them, if positive, and by a room."""

        def less(constants: FloatArray) -> FloatArray:
            return np.asarray(constants - share * np.maximum(constants, 0.0) - room)

        g = np.column_stack([less(self.cones.g[:, 0]), self.cones.g[:, 1:]])
        return replace(self, h=less(self.h), cones=Cones(self.cones.G, g))
