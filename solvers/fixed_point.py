"""Fixed point on the friction bound: s ← |N z(s) + n0|, where z(s) solves the inner problem with bound mu s.

| stops when                                                         | status before the certificate |
|--------------------------------------------------------------------|-------------------------------|
| residual ≤ tolerance and the certificate passes                    | solved                        |
| best residual not reduced by a tenth in `patience` iterations      | stalled                       |
| likewise, with residual ≤ tolerance: inner solver too inaccurate   | stalled, with other advice    |
| s returns to an earlier value (2 to 8 iterations ago)              | cycling; stalled if residual ≤ 1e-4 |
| `max_iterations` done                                              | max_iterations                |
| the time is over, see `deadline`                                   | time_limit                    |
| the inner problem fails, or stays infeasible after restarts        | that of the inner problem     |

residual = |g − s| / max(|g|, S) in the norm weighted by W, g = |N z(s) + n0| and S the certificate's scale of stress.
For the bound mu s the inner problem meets all conditions of (D2), to the inner accuracy, so the residual is the error.
"""

import time
from collections import deque
from dataclasses import dataclass, replace
from typing import ClassVar, TypeAlias

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, vstack
from scipy.sparse.linalg import norm

from solvers.basics.checks import real_array
from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import BoolVector, IntVector, Vector
from solvers.certificate.certificate import certify, scales_at
from solvers.certificate.feasibility import PROOF_SECONDS, Feasibility, check_feasibility, refuted
from solvers.errors import InputError
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import basis, largest, most
from solvers.inner.linear_program import BackendFailure, attempt
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, no_result
from solvers.inner.registry import make_inner, versions
from solvers.settings import FixedPointOptions
from solvers.solution import Iteration, Outcome, Start

# The unknowns of the inner problems.
#
# "full"       the unknowns z: large and sparse, and as badly conditioned as K
# "condensed"  coordinates w of the tractions. With a factor V Vᵀ of the compliance B K⁻¹ Bᵀ, B = [N; T], the tractions
#              are σ_bonded + V w and the energy is ½|w|²: small, dense, perfectly conditioned; z follows from the
#              multipliers by one linear solve with the factor of K
#
# Both have the same tractions and multipliers at the minimum. The condensed form is faster for few contact points.
#
# In both forms points without friction have equations T z + t0 = 0. As inequalities |T z + t0| ≤ 0 they would have no
# interior, and linearly dependent ones would contradict each other by rounding. At bilateral points the rows of N are
# no constraints; they become 0 ≤ 1 in the unit of the inner problem.

CONDENSED_LIMIT = 2000
"""Rows of B, 2m, up to which "auto" condenses."""

_LEAST_SHARE = 1e-14
"""Eigenvalues of the compliance, for rows of length one, below this share of its largest one are rounding: of dependent
rows, or of rows that equations fix."""


@dataclass(frozen=True, eq=False)
class FullForm:
    """(D2) with independent equations for points without friction, and empty rows of N at bilateral points."""

    problem: FrictionQVI  # of the inner solver: A has the equations, their rows of T are empty
    rows: BoolVector  # (m,), points without friction
    equations: IntVector  # (k,) points whose rows of T, linearly independent, are the last k rows of A
    sizes: Vector  # (k,) lengths of these rows of T, which are scaled to length one in A
    name: ClassVar[str] = "full"

    @classmethod
    def of(cls, qvi: FrictionQVI) -> "FullForm":
        """The full form of a problem, which is the problem itself if it has no such points."""
        if qvi.bilateral.any():
            N = csc_array(diags_array(np.where(qvi.bilateral, 0.0, 1.0)) @ qvi.N)
            N.eliminate_zeros()
            qvi = qvi.with_contact(N=N, traces=None).with_loads(n0=np.where(qvi.bilateral, -1.0, qvi.n0))
        rows = qvi.frictionless
        if not rows.any():
            return cls(qvi, rows, np.zeros(0, dtype=np.int64), np.zeros(0))
        equations = rows.nonzero()[0]
        equations = equations[basis(qvi.T[equations]).rows]
        chosen, has_friction = qvi.T[equations], np.where(rows, 0.0, 1.0)
        sizes = np.asarray(norm(chosen, axis=1), dtype=np.float64)
        A = csc_array(vstack([qvi.A, diags_array(1.0 / sizes) @ chosen]))
        contact = replace(qvi.contact, T=csc_array(diags_array(has_friction) @ qvi.T), A=A, traces=None)
        b = np.concatenate([qvi.b, -qvi.t0[equations] / sizes])
        problem = replace(qvi, contact=contact, loads=replace(qvi.loads, t0=has_friction * qvi.t0, b=b))
        return cls(problem, rows, equations, sizes)

    def threshold(self, threshold: Vector) -> Vector:
        """The friction bound (m,) of the inner problem: 1, which is never reached, at points with an empty row."""
        return np.where(self.rows, 1.0, threshold)

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:  # noqa: ARG002
        """The point about which the next inner problem is expanded: the last result, or the bonded solution."""
        return Centre(self.problem, self.problem.bonded if result is None else result.z)

    def expand(self, result: InnerSolution) -> InnerSolution:
        """The result in the original rows: m_T = ν of the equations, 0 in the rows that depend on them."""
        m_N = np.where(self.problem.bilateral, 0.0, result.m_N)
        p, m_T = len(result.nu) - len(self.equations), np.where(self.rows, 0.0, result.m_T)
        m_T[self.equations] = result.nu[p:] / self.sizes
        return replace(result, m_N=m_N, m_T=m_T, nu=result.nu[:p])


class CondensedForm:
    """min ½|w|²  s.t.  σ_bonded,N + V_N w ≤ 0,  |σ_bonded,T + V_T w| ≤ thr; at the minimum w = −Vᵀ m."""

    name = "condensed"

    def __init__(self, full: FullForm) -> None:
        qvi = full.problem
        self._full, self._compliance = full, Compliance(qvi)
        lengths = np.asarray(norm(qvi.contact_rows, axis=1))
        lengths[lengths == 0.0] = 1.0
        C = self._compliance.dense / np.outer(lengths, lengths)
        values, vectors = np.linalg.eigh(C)
        least = _LEAST_SHARE * most(values)
        self._V = lengths[:, None] * vectors[:, values > least] * np.sqrt(values[values > least])
        self._V[C.diagonal() <= least] = 0.0  # equations fix these tractions; inner solvers may scale up what is left
        m, r, bonded = qvi.m, self._V.shape[1], self._compliance.bonded
        self.problem = FrictionQVI.from_arrays(
            K=csc_array(eye_array(r)), f=np.zeros(r), N=csc_array(self._V[:m]), n0=bonded[:m],
            T=csc_array(self._V[m:]), t0=bonded[m:], mu=qvi.mu, W=qvi.W, bilateral=qvi.bilateral,
        )  # fmt: skip
        self.threshold = full.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """The w of the last multipliers, with the tractions of the accurate z, so that errors of V decay."""
        if inner is None or result is None:
            return Centre(self.problem, np.zeros(self.problem.n))
        qvi = self._full.problem
        centre = Centre(self.problem, -self._V.T @ np.concatenate([inner.m_N, inner.m_T]))
        centre.n0, centre.t0 = qvi.normal(result.z), qvi.tangential(result.z)
        return centre

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """The result in the original unknowns: z and ν from the multipliers."""
        z, _, _, nu = self._compliance.state(np.concatenate([inner.m_N, inner.m_T]))
        return self._full.expand(replace(inner, z=z, nu=nu))


ProblemForm: TypeAlias = FullForm | CondensedForm


def make_form(qvi: FrictionQVI, form: str) -> ProblemForm:
    """The form of a problem, "full", "condensed" or "auto"; full if the contact tractions do not depend on z."""
    full = FullForm.of(qvi)
    if form == "full" or (form == "auto" and 2 * qvi.m > CONDENSED_LIMIT):
        return full
    condensed = CondensedForm(full)
    return condensed if condensed.problem.n > 0 else full


# Anderson acceleration of a fixed-point map, with safeguards; without memory it is the damped map.

_GROWTH = 2.0  # growth of the residual at which the memory is dropped
_CONDITION = 1e-10  # singular values of the least-squares problem, over the largest, that are dropped


class Anderson:
    """Next argument of s ← g(s) from the last arguments and values (type II).

    With residuals r_i = g_i − s_i and α minimising |Σ α_i r_i| in the norm weighted by W, Σ α_i = 1, the next
    argument is Σ α_i (s_i + β r_i), limited to ≥ 0. Safeguards: if the residual has grown by more than a factor of 2
    since the last step, or if the new step points against the residual (as towards a repelling fixed point), the memory
    is dropped and one damped step s + β r is taken.

    Cite: H. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 2011.
    """

    def __init__(self, weights: Vector, memory: int, mixing: float) -> None:
        self._root = np.sqrt(weights)
        self.mixing = mixing
        self._arguments: deque[Vector] = deque(maxlen=memory + 1)
        self._residuals: deque[Vector] = deque(maxlen=memory + 1)
        self._last = np.inf

    def next(self, s: Vector, g: Vector) -> Vector:
        """The next argument (m,), given g = g(s)."""
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
        """Drop the memory."""
        self._arguments.clear()
        self._residuals.clear()
        self._last = np.inf


# Inner tolerance over the outer one, and its limits: at a point that touches without pressure the error of z(s) is
# √(inner tolerance).
_INNER_FACTOR, _INNER_LIMITS = 1e-4, (1e-12, 1e-6)
_MOST_RECOVERIES = 12  # from failed inner problems, in all
_MOST_HALVINGS = 4  # of the distance from s to the last feasible one, in succession
_CYCLE_LENGTHS = range(2, 9)
_CYCLE_MATCH = 1e-4  # distance from an earlier s, over the residual, that counts as a return
_PROGRESS = 0.9
_LEAST_PRESSURE = 1e-13  # over the bonded pressure; a smaller one is rounding
_MOST_SOFTENINGS = 6
_NOISE = 1e-4  # residual below which a cycle is caused by inaccurate inner solutions
_OTHER_INNER = "Take another inner solver, listed by solvers.available(), or cells that are less thin."


def _power_of_two(energy: float) -> float:
    """√energy up to a factor of √2: exact as a factor."""
    return float(2.0 ** np.round(np.log2(energy) / 2.0))


class _Loop:
    """The state of the outer iteration."""

    def __init__(
        self, qvi: FrictionQVI, form: ProblemForm, solver: InnerSolver, tolerance: float, options: FixedPointOptions
    ) -> None:
        self.qvi, self.form, self.solver, self.tolerance, self.options = qvi, form, solver, tolerance, options
        self.s = qvi.pressure(qvi.bonded) if options.initial is None else initial_pressure(qvi, options.initial)
        self.accelerated = options.variant == "anderson"
        mixing = 1.0 if options.variant == "plain" else options.damping
        scales = scales_at(qvi, qvi.bonded)  # tractions have energy even if the loads have none
        at_one_point = scales["stress"] * scales["displacement"] * float(qvi.W.min())
        self.unit = _power_of_two(max(qvi.bonded_state.strain_energy, at_one_point))
        self.map = Anderson(qvi.W, options.memory if self.accelerated else 0, mixing)
        self.feasible: Vector | None = None  # the last s whose inner problem had a solution
        self.previous: InnerSolution | None = None  # the last result, in the original unknowns
        self.inner: InnerSolution | None = None  # the last result, in the unknowns of the form
        self.best: InnerSolution | None = None
        self.best_residual = np.inf
        self.progress = (np.inf, 0)  # residual and number of the iteration with the last substantial progress
        self.past: deque[Vector] = deque(maxlen=_CYCLE_LENGTHS.stop)
        self.history: list[Iteration] = []
        self.recoveries = self.softenings = 0
        self.halvings = 0  # successive halvings of the distance from s to the last feasible one
        self.refuted: InnerSolution | None = None  # the last result of an inner problem that was proved infeasible
        self.feasibility: Feasibility | None = None
        self.reason: Status | None = None
        self.message = self.advice = ""  # see `Outcome`

    def step(self) -> None:
        """One outer iteration: inner problem, residual, record, next s."""
        qvi, began, number = self.qvi, time.perf_counter(), len(self.history) + 1
        inner = self._solve_inner(qvi.threshold(self.s))
        if not inner.status.usable:
            result = no_result(qvi, inner.status, inner.message)
            self._record(result, np.inf, began)
            if not deadline.over:
                self._recover(result)
        else:
            result = self.form.expand(inner)
            g = np.abs(qvi.normal(result.z))
            scales = scales_at(qvi, result.z)
            self.unit, stress = _power_of_two(scales["body_energy"]), scales["stress"]
            residual = self._norm(g - self.s) / max(self._norm(g), stress * float(np.sqrt(qvi.W.sum())))
            self._record(result, residual, began)
            if residual < self.best_residual:
                self.best, self.best_residual = result, residual
            self.inner, self.previous, self.feasible, self.halvings, self.refuted = inner, result, self.s, 0, None
            proof = (qvi, result.z, result.m_N, result.m_T, result.nu, self.tolerance)
            if residual <= self.tolerance and certify(*proof).passed:
                self.best, self.reason = result, Status.SOLVED
                return
            self._check_progress(residual, number)
            self.past.append(self.s)
            s = self.map.next(self.s, g)
            # Pressures that are rounding become 0, as interior point methods fail with bounds of 1e-30.
            self.s = np.where(s > _LEAST_PRESSURE * largest(qvi.normal(qvi.bonded)), s, 0.0)
        if self.reason is None and number >= self.options.max_iterations:
            self.reason = Status.MAX_ITERATIONS

    def _solve_inner(self, bound: Vector) -> InnerSolution:
        """The result of the inner problem, expanded about the last result, or, if that fails, about the first centre.

        Tolerances of back ends are absolute: they have the problem in the unit √energy of the last result. The status
        is "infeasible" only if that is proved. After a failed inner problem the proof, a linear program, is
        tried first: it takes a hundredth of the time.
        """
        form, bound = self.form, np.minimum(bound, np.finfo(np.float64).max)
        centre, factor = form.centre(self.inner, self.previous), 1.0 / self.unit

        def solved(centre: Centre, start: InnerSolution | None) -> InnerSolution:
            start, centre = None if start is None else start.times(factor), centre.times(factor)
            centre.n0[form.problem.bilateral] = -1.0
            return self.solver.solve(form.threshold(factor * bound), centre, start).times(self.unit)

        last_failed = bool(self.history) and self.history[-1].residual == np.inf
        inner = None if last_failed else solved(centre, self.inner)
        if inner is not None and (inner.status.usable or deadline.over):
            return inner
        qvi = self.qvi.with_bound(bound)
        if (proof := refuted(qvi, PROOF_SECONDS)) is not None:
            return no_result(form.problem, Status.INFEASIBLE, proof.message)
        inner = inner or solved(centre, self.inner)
        if not inner.status.usable and self.inner is not None and not deadline.over:
            inner = solved(form.centre(None, None), None)
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
        """End or soften an iteration that cycles or stalls, see the table of this module."""
        if residual < _PROGRESS * self.progress[0]:
            self.progress = (residual, number)
        match = _CYCLE_MATCH * residual * self._norm(self.s)
        for length in _CYCLE_LENGTHS:
            is_candidate = residual > self.tolerance and length <= len(self.past) and number > 2 * length
            if is_candidate and self._norm(self.s - self.past[-length]) <= match:
                if not self._soften(residual):
                    self.reason = Status.CYCLING if residual > _NOISE else Status.STALLED
                    self.message = f"the pressure repeats itself every {length} iterations"
                return
        if number - self.progress[1] < self.options.patience:
            return
        self.reason = Status.STALLED
        self.message = f"residual {self.best_residual:.1e} was not reduced in {self.options.patience} iterations"
        if self.best is not None and self.best_residual <= self.tolerance:  # smaller loads or steps would not help
            converged = f"the fixed point has converged (residual {self.best_residual:.1e})"
            self.message = f"{converged}, but the inner solver's answers are not accurate enough ({self.best.message})"
            self.advice = _OTHER_INNER

    def _soften(self, residual: float) -> bool:
        """Halve Anderson's mixing β and drop the memory; False for other variants, for noise, or if done too often."""
        self.softenings += 1
        if not self.accelerated or self.softenings > _MOST_SOFTENINGS or residual <= _NOISE:
            return False
        self.map.reset()
        self.map.mixing *= 0.5
        self.past.clear()
        return True

    def _recover(self, result: InnerSolution) -> None:
        """The s after a failed inner problem: first of an admissible traction, then halfway to the last feasible one.

        Ends the iteration if the load cannot be carried, the failure cannot be cured, or s has come close enough.
        """
        self.recoveries += 1
        if self.feasibility is None:
            self.feasibility = check_feasibility(self.qvi)
        z = self.feasibility.z  # None unless the load can be carried
        self.refuted = result if result.status is Status.INFEASIBLE else self.refuted
        is_curable = result.status in (Status.INFEASIBLE, Status.BACKEND_FAILED) and self.recoveries <= _MOST_RECOVERIES
        is_at_feasible = self.feasible is not None and np.array_equal(self.s, self.feasible)
        if z is None or not is_curable or self.halvings >= _MOST_HALVINGS or is_at_feasible:
            failure = self.refuted or result
            self.reason, self.message = failure.status, f"inner problem: {failure.message}"
        elif self.feasible is None:
            self.s = self.feasible = np.abs(self.qvi.normal(z))
        else:
            self.s = 0.5 * (self.s + self.feasible)
            self.halvings += 1
        self.map.reset()
        if not self.accelerated:
            self.map.mixing = min(self.map.mixing, 0.5)


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
    turned = "The fixed point cycled before it was damped" if loop.softenings else ""
    return Outcome(
        loop.reason, result.z, result.m_N, result.m_T, result.nu, loop.history, len(loop.history), loop.message,
        loop.advice, set_up - began, versions(solver.packages), loop.feasibility, form.name, turned=turned,
    )  # fmt: skip


def initial_pressure(qvi: FrictionQVI, initial: object) -> Vector:
    """The option `initial`, a state of the problem or a pressure, as a pressure s (m,), checked."""
    remedy = f"give a finite pressure ≥ 0 of shape ({qvi.m},)"
    if isinstance(initial, Start):
        sizes = len(initial.z), len(initial.multipliers) // 2
        if sizes != (qvi.n, qvi.m):
            remedy = f"give the solution of a problem with {qvi.n} unknowns and {qvi.m} contact rows, as this one"
            raise InputError("initial", "{} unknowns and {} contact rows".format(*sizes), remedy)
        initial = qvi.pressure(initial.z)
    s = real_array("initial", initial, remedy)
    if s.shape != (qvi.m,) or not np.isfinite(s).all() or s.min(initial=0.0) < 0:
        raise InputError("initial", initial, remedy)
    return s
