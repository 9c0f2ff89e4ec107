"""Fixed point on the friction bound: s ← |N z(s) + n0|, where z(s) solves the inner problem with bound mu s.

| stops when                                                         | status before the certificate |
|--------------------------------------------------------------------|-------------------------------|
| residual ≤ tolerance and the certificate passes                    | solved                        |
| best residual not reduced by a tenth in `patience` iterations      | stalled                       |
| the same, residual ≤ tolerance: inner solver not accurate enough   | stalled, with other advice    |
| s returns to an earlier value (2 to 8 iterations ago)              | cycling; stalled if residual ≤ 1e-4 |
| `max_iterations` done                                              | max_iterations                |
| the time is over, see `deadline`                                     | time_limit                    |
| the inner problem fails, or stays infeasible after restarts        | that of the inner problem     |

residual = |g − s| / max(|g|, S) in the norm weighted by W, g = |N z(s) + n0| and S the certificate's scale of stress.
The last two rows of (D2) hold at z for the bound mu s to the inner accuracy; so the residual is the error.
"""

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, vstack

from solvers.basics.checks import real_array
from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import Matrix, Vector
from solvers.certificate.certificate import certify, scales_at
from solvers.certificate.feasibility import Feasibility, check_feasibility, refuted
from solvers.errors import InputError
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import independent_rows, largest
from solvers.inner.linear_program import BackendFailure, attempt
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result
from solvers.inner.registry import make_inner, versions
from solvers.settings import FixedPointOptions
from solvers.solution import Iteration, Outcome

# In which unknowns the inner problems are posed.
#
# "full"       the unknowns z themselves: large and sparse, and as badly conditioned as K
# "condensed"  only what the contact points feel. The rows B = [N; T] = E Y span r ≤ 2m directions Y; with a
#              factor F Fᵀ = Y K⁻¹ Yᵀ and V = E F the tractions are σ_bonded + V w and the energy is ½|w|². Small,
#              dense, perfectly conditioned; z follows from the multipliers by one linear solve with the factor of K
#
# Both are minimised by the same tractions and multipliers. The condensed form pays while contact points are few.
#
# In either form rows without friction, whose bound is always 0, are equations T z + t0 = 0. As inequalities
# |T z + t0| ≤ 0 they would have no interior, and several of them that depend on each other contradict one another in
# rounding. Rows of N that are bilateral are no inequalities at all; they become 0 ≤ 1.


CONDENSED_LIMIT = 2000
"""Rows of B, 2m, up to which "auto" condenses."""

_COMPLIANT, _HELD = 1e-14, 1e-12
"""Eigenvalues of Y K⁻¹ Yᵀ below these shares of its largest, and of 1/|K|, are rounding."""


@dataclass(frozen=True, eq=False)
class FullForm:
    """(D2) as it is, but for rows without friction, turned into independent equality rows, and bilateral ones, void."""

    problem: FrictionQVI  # for an inner solver: those equations in A, their rows of T empty, bilateral rows of N empty
    rows: np.ndarray  # (m,) bool
    E: Matrix  # (rows, k), T_rows = E Y with Y the k equality rows appended to A
    name: ClassVar[str] = "full"

    @classmethod
    def of(cls, qvi: FrictionQVI) -> "FullForm":
        """Find the rows; a problem that has none is kept as it is."""
        if qvi.bilateral.any():
            held = qvi.bilateral
            N = csc_array(diags_array(np.where(held, 0.0, 1.0)) @ qvi.N)
            N.eliminate_zeros()
            qvi = qvi.with_contact(N=N, traces=None).with_loads(n0=np.where(held, -1.0, qvi.n0))
        rows = qvi.frictionless
        if not rows.any():
            return cls(qvi, rows, np.zeros((0, 0)))
        E, Y = independent_rows(csc_array(qvi.T[rows]))
        kept = np.where(rows, 0.0, 1.0)
        b = np.concatenate([qvi.b, -np.linalg.lstsq(E, qvi.t0[rows], rcond=None)[0]])
        empty, equations = csc_array(diags_array(kept) @ qvi.T), csc_array(vstack([qvi.A, Y]))
        contact = replace(qvi.contact, T=empty, A=equations, traces=None)
        problem = replace(qvi, contact=contact, loads=replace(qvi.loads, t0=kept * qvi.t0, b=b))
        return cls(problem, rows, E)

    def threshold(self, threshold: Vector) -> Vector:
        """The friction bound as the inner problem takes it (m,): 1, which is never reached, where the row is empty."""
        return np.where(self.rows, 1.0, threshold)

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:  # noqa: ARG002
        """Where to pose the next inner problem: at the last result in the original unknowns, or the bonded one."""
        return Centre(self.problem, self.problem.bonded if result is None else result.z)

    def expand(self, result: InnerSolution) -> InnerSolution:
        """In the original rows: multipliers of T from those of the equations, Eᵀ m_T = ν, of least norm."""
        if self.problem.bilateral.any():
            result = replace(result, m_N=np.where(self.problem.bilateral, 0.0, result.m_N))
        if not self.rows.any():
            return result
        p = len(result.nu) - self.E.shape[1]
        m_T = np.array(result.m_T)
        m_T[self.rows] = np.linalg.lstsq(self.E.T, result.nu[p:], rcond=None)[0]
        return replace(result, m_T=m_T, nu=result.nu[:p])


class CondensedForm:
    """min ½|w|²  s.t.  σ_bonded,N + V_N w ≤ 0,  |σ_bonded,T + V_T w| ≤ thr; at the minimum w = −Vᵀ m."""

    name = "condensed"

    def __init__(self, full: FullForm) -> None:
        qvi = full.problem
        self._full, self._compliance = full, Compliance(qvi)
        E, Y = independent_rows(qvi.contact_rows)
        Y_interface = Y[:, qvi.condensed_contact.system.interface]
        C = Y_interface @ qvi.condensed_contact.system.solve_interface(Y_interface.T.toarray())[0]
        # F Fᵀ = C = Y K⁻¹ Yᵀ from its eigenvalues; directions without compliance are left out. As rows of Y are
        # orthonormal, C is at least 1/|K| where no equation A z = b holds the direction.
        values, vectors = np.linalg.eigh((C + C.T) / 2.0)
        least = max(_COMPLIANT * values.max(initial=0.0), _HELD / float(qvi.K.diagonal().max(initial=1.0)))
        kept = values > least
        self._V = np.asarray(E @ (vectors[:, kept] * np.sqrt(values[kept])))
        m, r, bonded = qvi.m, self._V.shape[1], self._compliance.bonded
        self.problem = FrictionQVI.from_arrays(
            K=csc_array(eye_array(r)), f=np.zeros(r), N=csc_array(self._V[:m]), n0=bonded[:m],
            T=csc_array(self._V[m:]), t0=bonded[m:], mu=qvi.mu, W=qvi.W, bilateral=qvi.bilateral,
        )  # fmt: skip
        self.threshold = full.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """At the w of the last multipliers, with the tractions of the accurate z: rounding in V then decays."""
        if inner is None or result is None:
            return Centre(self.problem, np.zeros(self.problem.n))
        qvi = self._full.problem
        centre = Centre(self.problem, -self._V.T @ np.concatenate([inner.m_N, inner.m_T]))
        centre.n0, centre.t0 = qvi.normal(result.z), qvi.tangential(result.z)
        return centre

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """Z and ν from the multipliers."""
        z, nu = self._compliance.unknowns(np.concatenate([inner.m_N, inner.m_T]))
        return self._full.expand(replace(inner, z=z, nu=nu))


ProblemForm: TypeAlias = FullForm | CondensedForm


def make_form(qvi: FrictionQVI, form: str) -> ProblemForm:
    """Choose and build; a problem whose contact tractions do not depend on z stays in full form."""
    full = FullForm.of(qvi)
    if form == "full" or (form == "auto" and 2 * qvi.m > CONDENSED_LIMIT):
        return full
    condensed = CondensedForm(full)
    return condensed if condensed.problem.n > 0 else full


# Anderson acceleration of a fixed-point map, with safeguard; without a memory it is the damped map.


_GROWTH = 2.0  # residual growth at which the memory is dropped
_CONDITION = 1e-10  # relative singular values dropped in the least-squares problem


class Anderson:
    """Next argument of s ← g(s) from the last arguments and values (type II).

    With residuals r_i = g_i − s_i and α minimising |Σ α_i r_i| in the norm weighted by W, Σ α_i = 1, the next
    argument is Σ α_i (s_i + β r_i), kept ≥ 0. Safeguards: when the residual has grown by more than a factor
    of 2 since the last step, or the new step points against the residual (as it does towards a fixed point
    that repels), the memory is dropped and one damped step s + β r taken.

    Cite: H. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 2011.
    """

    def __init__(self, weights: Vector, memory: int, mixing: float) -> None:
        self._root = np.sqrt(weights)
        self.mixing = mixing
        self._arguments: deque[Vector] = deque(maxlen=memory + 1)
        self._residuals: deque[Vector] = deque(maxlen=memory + 1)
        self._last = np.inf

    def next(self, s: Vector, g: Vector) -> Vector:
        """Return the next argument, given g = g(s)."""
        residual = g - s
        size = float(np.linalg.norm(self._root * residual))
        if size > _GROWTH * self._last:
            self.reset()
        self._last = size
        self._arguments.append(s)
        self._residuals.append(residual)
        damped: Vector = np.maximum(s + self.mixing * residual, 0.0)
        residuals = np.array(self._residuals)
        differences = self._root * (residuals[:-1] - residual)
        alpha = np.linalg.lstsq(differences.T, -self._root * residual, rcond=_CONDITION)[0]
        mixed = np.array(self._arguments) + self.mixing * residuals
        combined: Vector = mixed[-1] + alpha @ (mixed[:-1] - mixed[-1])
        if float(self._root**2 @ ((combined - s) * residual)) <= 0:  # towards a repelling fixed point
            self.reset()
            return damped
        return np.maximum(combined, 0.0)

    def reset(self) -> None:
        """Forget everything."""
        self._arguments.clear()
        self._residuals.clear()
        self._last = np.inf


_INNER_FACTOR = 1e-4  # inner tolerance = this × outer, within the two limits below: the error of z(s) goes with
_INNER_LIMITS = (1e-12, 1e-6)  # √tolerance where a point touches without load
_RECOVERIES = 12
_NEARER = 4  # of them one after the other, by which s has come to 1/16 of its distance
_ASKED = 2.0  # seconds for a proof that a bound is too small, which the largest programs need
_CYCLE_LENGTHS = range(2, 9)
_CYCLE_MATCH = 1e-4  # of the residual
_PROGRESS = 0.9
_ROUND_OFF = 1e-13  # of the bonded pressure
_BREAKS = 6
_NOISE = 1e-4  # a cycle smaller than this is the inner solver's noise, not the map's
_OTHER_INNER = "Take another inner solver, listed by solvers.available(), or cells that are less thin."


class _Loop:
    """The iteration: what it works with, and everything that changes from one outer iteration to the next."""

    def __init__(
        self, qvi: FrictionQVI, form: ProblemForm, solver: InnerSolver, tolerance: float, options: FixedPointOptions
    ) -> None:
        self.qvi, self.form, self.solver, self.tolerance, self.options = qvi, form, solver, tolerance, options
        self.s = qvi.pressure(qvi.bonded) if options.initial is None else initial_pressure(qvi, options.initial)
        self.accelerated = options.variant == "anderson"
        mixing = 1.0 if options.variant == "plain" else options.damping
        self.map = Anderson(qvi.W, options.memory if self.accelerated else 0, mixing)
        self.feasible: Vector | None = None  # last s whose inner problem had a solution
        self.previous: InnerSolution | None = None  # last result, original unknowns
        self.inner: InnerSolution | None = None  # the same in those of the form
        self.best: InnerSolution | None = None
        self.best_residual = np.inf
        self.progress = (np.inf, 0)  # residual and number at the last substantial progress
        self.past: deque[Vector] = deque(maxlen=_CYCLE_LENGTHS.stop)
        self.history: list[Iteration] = []
        self.recoveries = self.breaks = 0
        self.nearer = 0  # how often s was halved towards the last feasible one
        self.refuted: InnerSolution | None = None  # the last inner problem that was proved infeasible
        self.feasibility: Feasibility | None = None
        self.reason: Status | None = None
        self.message = self.advice = ""  # the latter instead of that of the reason

    def step(self) -> None:
        """One outer iteration: inner problem, residual, record, next s."""
        qvi, began, number = self.qvi, time.perf_counter(), len(self.history) + 1
        inner = self._solve_inner(qvi.threshold(self.s))
        if not _is_usable(inner):
            result = no_result(qvi, inner.status, inner.message)
            self._record(result, np.inf, began)
            if not deadline.over:
                self._recover(result)
        else:
            result = self.form.expand(inner)
            g = np.abs(qvi.normal(result.z))
            stress = scales_at(qvi, result.z)["stress"]
            residual = self._norm(g - self.s) / max(self._norm(g), stress * float(np.sqrt(qvi.W.sum())))
            self._record(result, residual, began)
            if residual < self.best_residual:
                self.best, self.best_residual = result, residual
            self.inner, self.previous, self.feasible, self.nearer, self.refuted = inner, result, self.s, 0, None
            proof = (qvi, result.z, result.m_N, result.m_T, result.nu, self.tolerance)
            if residual <= self.tolerance and certify(*proof).passed:
                self.best, self.reason = result, Status.SOLVED
                return
            self._check_progress(residual, number)
            self.past.append(self.s)
            s = self.map.next(self.s, g)  # round-off becomes zero, which interior points take better than 1e-30
            self.s = np.where(s > _ROUND_OFF * largest(qvi.normal(qvi.bonded)), s, 0.0)
        if self.reason is None and number >= self.options.max_iterations:
            self.reason = Status.MAX_ITERATIONS

    def _solve_inner(self, bound: Vector) -> InnerSolution:
        """The inner problem about the last result, or the start if that fails.

        "infeasible" counts only where it is proved. After an inner problem that failed a linear program is asked first,
        which takes a hundredth of the time.
        """
        form, solver, bound = self.form, self.solver, np.minimum(bound, np.finfo(np.float64).max)
        threshold, near = form.threshold(bound), form.centre(self.inner, self.previous)
        failed = bool(self.history) and self.history[-1].residual == np.inf
        inner = None if failed else solver.solve(threshold, near, self.inner)
        if inner is not None and (_is_usable(inner) or deadline.over):
            return inner
        qvi = self.qvi.with_bound(bound)
        if (proof := refuted(qvi, _ASKED)) is not None:
            return no_result(form.problem, Status.INFEASIBLE, proof.message)
        inner = inner or solver.solve(threshold, near, self.inner)
        if not _is_usable(inner) and self.inner is not None and not deadline.over:
            inner = solver.solve(threshold, form.centre(None, None), None)
        if inner.status is not Status.INFEASIBLE or deadline.over or check_feasibility(qvi).feasible is False:
            return inner
        return no_result(form.problem, Status.BACKEND_FAILED, f"{inner.message}; but nothing proves it")

    def _norm(self, v: Vector) -> float:
        return float(np.sqrt(self.qvi.W @ v**2))

    def _record(self, result: InnerSolution, residual: float, began: float) -> None:
        entry = Iteration(
            len(self.history) + 1, residual, self.qvi.energy(result.z), self.qvi.resultant(result.z), result.status,
            result.iterations, time.perf_counter() - began,
        )  # fmt: skip
        self.history.append(entry)
        report(Progress("fixed-point", entry))

    def _check_progress(self, residual: float, number: int) -> None:
        """Cycle or stagnation, see the table of this module."""
        if residual < _PROGRESS * self.progress[0]:
            self.progress = (residual, number)
        match = _CYCLE_MATCH * residual * self._norm(self.s)
        for length in _CYCLE_LENGTHS:
            seen = residual > self.tolerance and length <= len(self.past) and number > 2 * length
            if seen and self._norm(self.s - self.past[-length]) <= match:
                if not self._soften(residual):
                    self.reason = Status.CYCLING if residual > _NOISE else Status.STALLED
                    self.message = f"the pressure repeats itself every {length} iterations"
                return
        if number - self.progress[1] < self.options.patience:
            return
        if self._soften(residual):
            self.progress = (residual, number)
            return
        self.reason = Status.STALLED
        self.message = f"residual {self.best_residual:.1e} was not reduced in {self.options.patience} iterations"
        if self.best is not None and self.best_residual <= self.tolerance:  # smaller loads or other steps are of no use
            where = f"the fixed point has converged (residual {self.best_residual:.1e})"
            self.message = f"{where}, but the inner solver's answers are not accurate enough ({self.best.message})"
            self.advice = _OTHER_INNER

    def _soften(self, residual: float) -> bool:
        """Halve the mixing of Anderson's steps and forget their memory; not for other variants, noise, or too often."""
        self.breaks += 1
        if not self.accelerated or self.breaks > _BREAKS or residual <= _NOISE:
            return False
        self.map.reset()
        self.map.mixing *= 0.5
        self.past.clear()
        return True

    def _recover(self, result: InnerSolution) -> None:
        """Start from an admissible traction, if there is one, then return towards the last feasible s."""
        self.recoveries += 1
        if self.feasibility is None:
            self.feasibility = check_feasibility(self.qvi)
        start = self.feasibility.z  # None unless the load can be carried
        self.refuted = result if result.status is Status.INFEASIBLE else self.refuted
        curable = result.status in (Status.INFEASIBLE, Status.BACKEND_FAILED) and self.recoveries <= _RECOVERIES
        arrived = self.nearer >= _NEARER or (self.feasible is not None and np.array_equal(self.s, self.feasible))
        if start is None or not curable or arrived:
            told = self.refuted or result
            self.reason, self.message = told.status, f"inner problem: {told.message}"
        elif self.feasible is None:
            self.s = self.feasible = np.abs(self.qvi.normal(start))
        else:
            self.s = 0.5 * (self.s + self.feasible)
            self.nearer += 1
        self.map.reset()
        if not self.accelerated:
            self.map.mixing = min(self.map.mixing, 0.5)


def _is_usable(inner: InnerSolution) -> bool:
    return inner.status.usable and inner.finite


def solve_fixed_point(qvi: FrictionQVI, inner: str, tolerance: float, options: FixedPointOptions) -> Outcome:
    """Solve the QVI by the iteration of this module; `inner` names the inner solver."""
    began = time.perf_counter()
    inner_tolerance = options.inner_tolerance or float(np.clip(_INNER_FACTOR * tolerance, *_INNER_LIMITS))
    form = make_form(qvi, options.form)
    solver = attempt(inner, lambda: make_inner(inner, form.problem, inner_tolerance, options.inner_options))
    if isinstance(solver, BackendFailure):
        return Outcome.nothing(qvi, Status.BACKEND_FAILED, str(solver))
    loop = _Loop(qvi, form, solver, tolerance, options)
    set_up = time.perf_counter()
    while loop.reason is None:
        if deadline.over:
            loop.reason = Status.TIME_LIMIT
        else:
            loop.step()
    result = loop.best or no_result(qvi, Status.BACKEND_FAILED, "")
    turned = "The fixed point cycled before it was damped" if loop.breaks else ""
    return Outcome(
        loop.reason, result.z, result.m_N, result.m_T, result.nu, loop.history, len(loop.history), loop.message,
        loop.advice, set_up - began, versions(solver.packages), loop.feasibility, form.name, turned=turned,
    )  # fmt: skip


def initial_pressure(qvi: FrictionQVI, initial: object) -> Vector:
    """The option `initial`, checked (m,)."""
    remedy = f"give a finite pressure ≥ 0 of shape ({qvi.m},)"
    s = real_array("initial", initial, remedy)
    if s.shape != (qvi.m,) or not np.isfinite(s).all() or s.min(initial=0.0) < 0:
        raise InputError("initial", initial, remedy)
    return s
