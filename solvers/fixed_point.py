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
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, vstack

from solvers.basics.checks import real_array
from solvers.basics.progress import Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import Matrix, Sparse, Vector
from solvers.certificate.certificate import certify, scales_at
from solvers.certificate.feasibility import Feasibility, check_feasibility
from solvers.errors import InputError
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import independent_rows
from solvers.inner.linear_program import is_failure, one_line
from solvers.inner.problem import Centre, InnerSolution, InnerSolver, contradiction, no_result
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
# Both are minimised by the same tractions and multipliers. The condensed form pays while contact points are few beside
# the unknowns; "auto" takes it up to `CONDENSED_LIMIT` rows.
#
# In either form rows without friction, whose bound is always 0, are equations T z + t0 = 0. As inequalities
# |T z + t0| ≤ 0 they would have no interior, and several of them that depend on each other contradict one another in
# rounding. Rows of N that are bilateral are no inequalities at all; they become 0 ≤ 1.


CONDENSED_LIMIT = 2000
"""Rows of B, 2m, up to which "auto" condenses."""

_COMPLIANT, _HELD = 1e-14, 1e-12
"""Eigenvalues of Y K⁻¹ Yᵀ below these shares of its largest, and of 1/|K|, are rounding."""


class ProblemForm(Protocol):
    """The problem an inner solver sees, and the way back."""

    name: str
    problem: FrictionQVI

    def threshold(self, threshold: Vector) -> Vector:
        """The friction bound as the inner problem takes it (m,)."""
        ...

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """Where to pose the next inner problem: at the last result, in its own and in the original unknowns."""
        ...

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """The result in the original unknowns and rows."""
        ...


@dataclass(frozen=True, eq=False)
class Simplified:
    """Rows without friction turned into independent equality rows, bilateral ones made void.

    Attributes
    ----------
    problem : the QVI with those equations in A, their rows of T empty, bilateral rows of N empty
    rows : (m,) bool
    E : (rows, k), T_rows = E Y with Y the k equality rows appended to A

    """

    problem: FrictionQVI
    rows: np.ndarray
    E: Matrix

    @classmethod
    def of(cls, qvi: FrictionQVI) -> "Simplified":
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
        """1 where the row is empty: a bound that is never reached."""
        return np.where(self.rows, 1.0, threshold)

    def restore(self, result: InnerSolution) -> InnerSolution:
        """Row multipliers of the original T from those of the equations: Eᵀ m_T = ν, of least norm."""
        if self.problem.bilateral.any():
            result = replace(result, m_N=np.where(self.problem.bilateral, 0.0, result.m_N))
        if not self.rows.any():
            return result
        p = len(result.nu) - self.E.shape[1]
        m_T = np.array(result.m_T)
        m_T[self.rows] = np.linalg.lstsq(self.E.T, result.nu[p:], rcond=None)[0]
        return replace(result, m_T=m_T, nu=result.nu[:p])


class FullForm:
    """(D2) as it is."""

    name = "full"

    def __init__(self, simplified: Simplified) -> None:
        self._simplified = simplified
        self.problem = simplified.problem
        self.threshold = simplified.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:  # noqa: ARG002
        """At the last result, or the bonded one."""
        return Centre(self.problem, self.problem.bonded if result is None else result.z)

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """The result itself."""
        return self._simplified.restore(inner)


class CondensedForm:
    """min ½|w|²  s.t.  σ_bonded,N + V_N w ≤ 0,  |σ_bonded,T + V_T w| ≤ thr; at the minimum w = −Vᵀ m."""

    name = "condensed"

    def __init__(self, simplified: Simplified) -> None:
        qvi = simplified.problem
        self._simplified, self._compliance = simplified, Compliance(qvi)
        E, Y = independent_rows(qvi.contact_rows)
        Y_interface = Y[:, qvi.condensed_contact.system.interface]
        C = Y_interface @ qvi.condensed_contact.system.solve_interface(Y_interface.T.toarray())[0]
        self._V = E @ _factor(C, qvi.K)
        m, r, bonded = qvi.m, self._V.shape[1], self._compliance.bonded
        self.problem = FrictionQVI.from_arrays(
            K=csc_array(eye_array(r)), f=np.zeros(r), N=csc_array(self._V[:m]), n0=bonded[:m],
            T=csc_array(self._V[m:]), t0=bonded[m:], mu=qvi.mu, W=qvi.W, bilateral=qvi.bilateral,
        )  # fmt: skip
        self.threshold = simplified.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """At the w of the last multipliers, with the tractions of the accurate z: rounding in V then decays."""
        if inner is None or result is None:
            return Centre(self.problem, np.zeros(self.problem.n))
        qvi = self._simplified.problem
        centre = Centre(self.problem, -self._V.T @ np.concatenate([inner.m_N, inner.m_T]))
        centre.n0, centre.t0 = qvi.normal(result.z), qvi.tangential(result.z)
        return centre

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """Z and ν from the multipliers."""
        z, nu = self._compliance.unknowns(np.concatenate([inner.m_N, inner.m_T]))
        return self._simplified.restore(replace(inner, z=z, nu=nu))


def make_form(qvi: FrictionQVI, form: str) -> ProblemForm:
    """Choose and build; a problem whose contact tractions do not depend on z stays in full form."""
    simplified = Simplified.of(qvi)
    if form == "full" or (form == "auto" and 2 * qvi.m > CONDENSED_LIMIT):
        return FullForm(simplified)
    condensed = CondensedForm(simplified)
    return condensed if condensed.problem.n > 0 else FullForm(simplified)


def _factor(C: Matrix, K: Sparse) -> Matrix:
    """F with F Fᵀ = C for C = Y K⁻¹ Yᵀ, from its eigenvalues; directions without compliance are left out.

    As Y has orthonormal rows, C is at least 1/|K| where no equation A z = b holds the direction.
    """
    values, vectors = np.linalg.eigh((C + C.T) / 2.0)
    least = max(_COMPLIANT * values.max(initial=0.0), _HELD / float(K.diagonal().max(initial=1.0)))
    kept = values > least
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))


# Anderson acceleration of a fixed-point map, with safeguard.


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
        if len(self._residuals) == 1:
            return np.maximum(s + self.mixing * residual, 0.0)
        differences = np.array([self._root * (old - residual) for old in list(self._residuals)[:-1]]).T
        alpha = np.linalg.lstsq(differences, -self._root * residual, rcond=_CONDITION)[0]
        mixed = [a + self.mixing * r for a, r in zip(self._arguments, self._residuals, strict=True)]
        combined = mixed[-1] + sum(
            (c * (m - mixed[-1]) for c, m in zip(alpha, mixed[:-1], strict=True)), np.zeros_like(s)
        )
        if float(self._root**2 @ ((combined - s) * residual)) <= 0:  # towards a repelling fixed point
            self.reset()
            return np.maximum(s + self.mixing * residual, 0.0)
        return np.maximum(combined, 0.0)

    def reset(self) -> None:
        """Forget everything."""
        self._arguments.clear()
        self._residuals.clear()
        self._last = np.inf


_INNER_FACTOR = 1e-4  # inner tolerance = this × outer, within the two limits below: the error of z(s) goes with
_INNER_LIMITS = (1e-12, 1e-6)  # √tolerance where a point touches without load
_RECOVERIES = 12
_CLAIM_TOLERANCE = 1e-8
_CYCLE_LENGTHS = range(2, 9)
_CYCLE_MATCH = 1e-4  # of the residual
_PROGRESS = 0.9
_ROUND_OFF = 1e-13  # of the bonded pressure
_BREAKS = 6
_NOISE = 1e-4  # a cycle smaller than this is the inner solver's noise, not the map's
_OTHER_INNER = "Take another inner solver, listed by solvers.available(), or cells that are less thin."


@dataclass(eq=False)
class _State:
    """Everything that changes from one outer iteration to the next."""

    s: Vector
    accelerator: Anderson | None
    damping: float
    feasible: Vector | None = None  # last s whose inner problem had a solution
    previous: InnerSolution | None = None  # last result, original unknowns
    inner: InnerSolution | None = None  # the same in those of the form
    best: InnerSolution | None = None
    best_residual: float = np.inf
    progress: tuple[float, int] = (np.inf, 0)  # residual and number at the last substantial progress
    past: deque[Vector] = field(default_factory=lambda: deque(maxlen=_CYCLE_LENGTHS.stop))
    history: list[Iteration] = field(default_factory=list)
    recoveries: int = 0
    breaks: int = 0
    feasibility: Feasibility | None = None
    reason: Status | None = None
    message: str = ""
    advice: str = ""  # instead of that of the reason


def solve_fixed_point(qvi: FrictionQVI, inner: str, tolerance: float, options: FixedPointOptions) -> Outcome:
    """Solve the QVI by the iteration of this module; `inner` names the inner solver."""
    began = time.perf_counter()
    inner_tolerance = options.inner_tolerance or float(np.clip(_INNER_FACTOR * tolerance, *_INNER_LIMITS))
    try:
        form = make_form(qvi, options.form)
        solver = make_inner(inner, form.problem, inner_tolerance, options.inner_options)
    except InputError:
        raise
    except BaseException as error:
        if not is_failure(error):
            raise
        return Outcome.nothing(qvi, Status.BACKEND_FAILED, one_line(f"{inner}: {type(error).__name__}: {error}"))
    state = _init(qvi, options)
    set_up = time.perf_counter()
    while state.reason is None:
        if deadline.over:
            state.reason = Status.TIME_LIMIT
        else:
            _step(qvi, form, solver, state, options, tolerance)
    result = state.best or no_result(qvi, Status.BACKEND_FAILED, "")
    turned = "The fixed point cycled before it was damped" if state.breaks else ""
    return Outcome(
        state.reason, result.z, result.m_N, result.m_T, result.nu, state.history, len(state.history), state.message,
        state.advice, set_up - began, versions(solver.packages), state.feasibility, form.name, turned=turned,
    )  # fmt: skip


def initial_pressure(qvi: FrictionQVI, initial: object) -> Vector:
    """The option `initial`, checked (m,)."""
    remedy = f"give a finite pressure ≥ 0 of shape ({qvi.m},)"
    s = real_array("initial", initial, remedy)
    if s.shape != (qvi.m,) or not np.isfinite(s).all() or s.min(initial=0.0) < 0:
        raise InputError("initial", initial, remedy)
    return s


def _init(qvi: FrictionQVI, options: FixedPointOptions) -> _State:
    """Start: the given pressure or that of the bonded solution."""
    s = qvi.pressure(qvi.bonded) if options.initial is None else initial_pressure(qvi, options.initial)
    accelerate = options.variant == "anderson"
    accelerator = Anderson(qvi.W, options.memory, options.damping) if accelerate else None
    return _State(s, accelerator, 1.0 if options.variant == "plain" else options.damping)


def _step(
    qvi: FrictionQVI,
    form: ProblemForm,
    solver: InnerSolver,
    state: _State,
    options: FixedPointOptions,
    tolerance: float,
) -> None:
    """One outer iteration: inner problem, residual, record, next s."""
    began = time.perf_counter()
    inner = _solve_inner(qvi, form, solver, state)
    usable = _is_usable(inner)
    result = form.expand(inner) if usable else no_result(qvi, inner.status, inner.message, inner.seconds)
    number = len(state.history) + 1
    if not usable:
        _record(qvi, state, result, np.inf, began, options)
        if not deadline.over:
            _recover(qvi, form, solver, state, result)
    else:
        state.inner = inner
        g = np.abs(qvi.normal(result.z))
        residual = _residual(qvi, result.z, g, state.s)
        _record(qvi, state, result, residual, began, options)
        if residual < state.best_residual:
            state.best, state.best_residual = result, residual
        state.previous, state.feasible = result, state.s
        if residual <= tolerance and certify(qvi, result.z, result.m_N, result.m_T, result.nu, tolerance).passed:
            state.best, state.reason = result, Status.SOLVED
            return
        _check_progress(qvi, state, residual, number, options, tolerance)
        state.past.append(state.s)
        state.s = _next(qvi, state, g)
    if state.reason is None and number >= options.max_iterations:
        state.reason = Status.MAX_ITERATIONS


def _solve_inner(qvi: FrictionQVI, form: ProblemForm, solver: InnerSolver, state: _State) -> InnerSolution:
    """The inner problem about the last result; a back end that fails there gets one more try about the start."""
    threshold = form.threshold(qvi.threshold(state.s))
    centre = form.centre(state.inner, state.previous)
    inner = contradiction(form.problem, threshold, centre) or solver.solve(threshold, centre, state.inner)
    if not _is_usable(inner) and state.inner is not None and not deadline.over:
        inner = solver.solve(threshold, form.centre(None, None), None)
    claimed = inner.status is Status.INFEASIBLE and not deadline.over
    return _checked_claim(inner, form, threshold) if claimed else inner


def _checked_claim(inner: InnerSolution, form: ProblemForm, threshold: Vector) -> InnerSolution:
    """A back end's "infeasible", or a failure if Clarabel finds the solution that is said not to exist."""
    witness = make_inner("direct:clarabel", form.problem, _CLAIM_TOLERANCE)
    if not _is_usable(witness.solve(threshold, form.centre(None, None), None)):
        return inner
    message = f"{inner.message}; but Clarabel solves this problem"
    return no_result(form.problem, Status.BACKEND_FAILED, message, inner.seconds)


def _is_usable(inner: InnerSolution) -> bool:
    return inner.status.usable and inner.finite


def _residual(qvi: FrictionQVI, z: Vector, g: Vector, s: Vector) -> float:
    stress = scales_at(qvi, z)["stress"]
    return _norm(qvi, g - s) / max(_norm(qvi, g), stress * float(np.sqrt(qvi.W.sum())))


def _norm(qvi: FrictionQVI, v: Vector) -> float:
    return float(np.sqrt(qvi.W @ v**2))


def _record(
    qvi: FrictionQVI,
    state: _State,
    result: InnerSolution,
    residual: float,
    began: float,
    options: FixedPointOptions,
) -> None:
    entry = Iteration(
        len(state.history) + 1, residual, qvi.energy(result.z), qvi.resultant(result.z), result.status,
        result.iterations, time.perf_counter() - began,
    )  # fmt: skip
    state.history.append(entry)
    report(Progress("fixed-point", entry), options.callback)


def _next(qvi: FrictionQVI, state: _State, g: Vector) -> Vector:
    """Accelerated, damped or plain; round-off becomes zero, which interior points take better than 1e-30."""
    if state.accelerator is not None:
        s = state.accelerator.next(state.s, g)
    else:
        s = (1.0 - state.damping) * state.s + state.damping * g
    scale = float(np.abs(qvi.normal(qvi.bonded)).max(initial=0.0))
    return np.where(s > _ROUND_OFF * scale, s, 0.0)


def _check_progress(
    qvi: FrictionQVI,
    state: _State,
    residual: float,
    number: int,
    options: FixedPointOptions,
    tolerance: float,
) -> None:
    """Cycle or stagnation, see the table of this module."""
    if residual < _PROGRESS * state.progress[0]:
        state.progress = (residual, number)
    match = _CYCLE_MATCH * residual * _norm(qvi, state.s)
    for length in _CYCLE_LENGTHS:
        seen = residual > tolerance and length <= len(state.past) and number > 2 * length
        if seen and _norm(qvi, state.s - state.past[-length]) <= match:
            _break_cycle(state, length, residual)
            return
    if number - state.progress[1] >= options.patience:
        if _soften(state, residual):
            state.progress = (residual, number)
            return
        state.reason = Status.STALLED
        state.message = f"residual {state.best_residual:.1e} was not reduced in {options.patience} iterations"
        if state.best is not None and state.best_residual <= tolerance:
            _blame_inner(state, state.best.message)


def _blame_inner(state: _State, said: str) -> None:
    """What to say where the certificate fails at a fixed point: smaller loads or other steps are of no use then."""
    where = f"the fixed point has converged (residual {state.best_residual:.1e})"
    state.message = f"{where}, but the inner solver's answers are not accurate enough ({said})"
    state.advice = _OTHER_INNER


def _break_cycle(state: _State, length: int, residual: float) -> None:
    """Halve Anderson's mixing and forget its memory; other variants, or one time too many, end here."""
    if _soften(state, residual):
        return
    state.reason = Status.CYCLING if residual > _NOISE else Status.STALLED
    state.message = f"the pressure repeats itself every {length} iterations"


def _soften(state: _State, residual: float) -> bool:
    """Halve the mixing of Anderson's steps and forget their memory; not for other variants, noise, or too often."""
    state.breaks += 1
    if state.accelerator is None or state.breaks > _BREAKS or residual <= _NOISE:
        return False
    state.accelerator.reset()
    state.accelerator.mixing *= 0.5
    state.past.clear()
    return True


def _recover(qvi: FrictionQVI, form: ProblemForm, solver: InnerSolver, state: _State, result: InnerSolution) -> None:
    """Ask whether the load can be carried at all; if so restart, then return towards the last feasible s.

    Starts are the pressure without friction, where that exists, then that of the least energy over the set of
    `feasibility`.
    """
    state.recoveries += 1
    if state.recoveries == 1 and state.feasible is None:
        smooth = solver.solve(form.threshold(np.zeros(qvi.m)), form.centre(None, None), None)
        if _is_usable(smooth):
            state.s = qvi.pressure(form.expand(smooth).z)
            return
    if state.feasibility is None:
        state.feasibility = check_feasibility(qvi)
    start = state.feasibility.z  # None unless the load can be carried
    curable = result.status in (Status.INFEASIBLE, Status.BACKEND_FAILED)
    if start is None or not curable or state.recoveries > _RECOVERIES:
        state.reason, state.message = result.status, f"inner problem: {result.message}"
    elif state.feasible is None:
        state.s = state.feasible = np.abs(qvi.normal(start))
    else:
        state.s = 0.5 * (state.s + state.feasible)
    if state.accelerator is not None:
        state.accelerator.reset()
    state.damping = min(state.damping, 0.5)
