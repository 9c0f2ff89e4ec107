"""The results of a solve: `QVISolution`, its iterations and attempts, a `Start` from an earlier one, and its status."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from solvers.basics.progress import deadline
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import Certificate, certify
from solvers.certificate.feasibility import Feasibility, check_feasibility
from solvers.certificate.uniqueness import UniquenessBound, uniqueness_bound
from solvers.inequality.problem import FrictionQVI

_CONTRACTION_MOST, _CONTRACTION_LEAST = 10, 4  # number of residuals from which a contraction is computed
_ROUNDING = 1e-13  # relative residuals below this are rounding


class Iteration(NamedTuple):
    """An outer iteration, or an iteration of the interior point method; dimensionless."""

    number: int
    """From 1."""
    residual: float
    """Fixed point: |s_new − s| / |s_new|, norm weighted by W; Uzawa: relative change of λ; condensed: the largest of
    gap and residuals, see `condensed.interior_point.Measures`."""
    energy: float
    """½ zᵀKz − fᵀz."""
    normal_resultant: float
    """Σ W (N z + n0), negative in compression."""
    inner_status: Status | None = None
    """How the inner problem ended; ``None`` for methods without inner problems."""
    inner_iterations: int = 0
    """Iterations of the inner solver, 0 if unknown."""
    seconds: float = 0.0
    """Wall time of the iteration."""


class Attempt(NamedTuple):
    """One attempt to solve a problem."""

    name: str
    """A method, a start of the condensed method, or a change of the problem."""
    reason: str
    """Why it was made; empty for the first."""
    status: Status
    """How it ended."""
    iterations: int
    """Its number of iterations."""


@dataclass(frozen=True, eq=False)
class QVISolution:
    """The unknowns z and multipliers of a solve, their certificate, and how they were found."""

    problem: FrictionQVI
    """The original data."""
    status: Status
    """`Status`; "solved" only if `certificate` passed."""
    z: Vector
    """(n,) unknowns; NaN if there is no result."""
    normal_multiplier: Vector
    tangential_multiplier: Vector
    """(m,) row multipliers m = W λ, signs as in `FrictionQVI`."""
    equality_multiplier: Vector
    """(p,)."""
    threshold: Vector
    """(m,) bound of |σ_T| at z, NaN without a z."""
    certificate: Certificate
    """Computed on `problem`."""
    history: tuple[Iteration, ...] = ()
    """One `Iteration` each (thinned out for long Uzawa runs: the first thousand, then every tenth, hundredth, … and the
    last)."""
    iterations: int = 0
    """Number of outer iterations done."""
    timings: Mapping[str, float] = field(default_factory=dict)
    """Seconds by name: "setup", "solve", "certificate"."""
    method: str = ""
    inner: str = ""
    """The method, and the inner solver of the fixed point, empty for other methods."""
    message: str = ""
    """One readable sentence."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Package → its version, for the packages that were used."""
    farkas: tuple[Vector, Vector] | None = None
    """Multipliers (of rows of G, of rows of A) that prove infeasibility, else None; see `feasibility`."""
    form: str = "full"
    """Unknowns of the inner problems, or of Newton's matrices in the condensed method: "full" or "condensed"."""
    factorisation: str = ""
    """Back end and version of the factorisation of K; empty if none was made."""
    corrections: tuple[float, ...] = ()
    """Sizes of the defect corrections of the condensed method, in the energy norm, relative to its first step. They
    repair errors from rounding inside K, and end when the next one would be rounding."""
    remarks: tuple[str, ...] = ()
    """Sentences about the solution, such as that there may be several."""
    near: bool | None = None
    """Whether the state `initial` was near enough to start from; None if no state was given."""
    attempts: tuple[Attempt, ...] = ()
    """All attempts, in their order."""

    @property
    def solved(self) -> bool:
        """Whether `status` is solved, that is, whether the certificate passed."""
        return self.status is Status.SOLVED

    @property
    def normal_displacement(self) -> Vector:
        """u_N − g = −λ_N at the contact points (m,), ≤ 0; one of many if rows of N are dependent."""
        return np.asarray(-self.normal_multiplier / self.problem.W)

    @property
    def tangential_displacement(self) -> Vector:
        """u_T − w = −λ_T at the contact points (m,); one of many if rows of T are dependent."""
        return np.asarray(-self.tangential_multiplier / self.problem.W)

    @property
    def contraction(self) -> float | None:
        """Factor by which the fixed point's residual shrinks in an iteration; above 1 the iteration diverges.

        The median over the last ten residuals above rounding, so that outliers do not count. None for other methods,
        and with fewer than four residuals. With Anderson's acceleration the factor is usually smaller than that of the
        plain map, which `uniqueness` bounds.
        """
        usable = [entry for entry in self.history if entry.inner_status is not None and np.isfinite(entry.residual)]
        logs = [(entry.number, np.log(entry.residual)) for entry in usable if entry.residual > _ROUNDING]
        last = logs[-_CONTRACTION_MOST:]
        if self.method != "fixed-point" or len(last) < _CONTRACTION_LEAST:
            return None
        iterations, change = np.diff(last, axis=0).T
        return float(np.exp(np.median(change / iterations)))

    @cached_property
    def uniqueness(self) -> UniquenessBound:
        """The bound of the friction below which the solution is unique, see `uniqueness`."""
        return uniqueness_bound(self.problem)


# The state from which a method starts: the solution of an earlier problem.


@dataclass(frozen=True, eq=False)
class Start:
    """A state of an earlier problem with the same rows, in the units of the problem to be solved."""

    z: Vector  # (n,)
    multipliers: Vector  # (2m,) row multipliers m_N, m_T, with the signs of `FrictionQVI`

    @classmethod
    def of(cls, solution: QVISolution, stress: float = 1.0, displacement: float = 1.0) -> Start:
        """The state of a solution; `stress`, `displacement`: the units of its problem over those of the new one."""
        multipliers = np.concatenate([solution.normal_multiplier, solution.tangential_multiplier])
        return cls(stress * solution.z, displacement * multipliers)


# The last step of every method: the status by the certificate, and the message.

WHAT_TO_DO = (
    "Which one a body takes depends on how it was loaded: follow the load in steps (solve_history, or initial=… from "
    "the result of a smaller load)."
)
"""Advice to the user if there may be several solutions."""

LOOSEST = 1e-4
"""Accuracy up to which a result gets the status "inaccurate"; else the status says why the iteration ended."""


@dataclass(eq=False)
class Outcome:
    """The end of an iteration, before the certificate; fields without a comment are as in `QVISolution`."""

    reason: Status  # why the iteration ended, by its own tests
    z: Vector
    m_N: Vector  # noqa: N815  # letters of (D2); NaN if there is no result, like z and ν
    m_T: Vector  # noqa: N815
    nu: Vector
    history: list[Iteration] = field(default_factory=list)
    iterations: int = 0
    message: str = ""  # shown if the problem is not solved
    advice: str = ""  # shown then in place of the advice of `reason`
    setup: float = 0.0  # seconds before the first iteration
    versions: Mapping[str, str] = field(default_factory=dict)
    feasibility: Feasibility | None = None  # of the problem, if it was checked
    form: str = "full"
    hopeless: bool = False  # the linear algebra failed: whether there is a solution is not asked
    corrections: tuple[float, ...] = ()
    turned: str = ""  # a sentence if the path to the solution turned: a sign of several solutions
    near: bool | None = None

    @classmethod
    def nothing(cls, qvi: FrictionQVI, reason: Status, message: str, **others: Any) -> Outcome:
        """An outcome without a result, all arrays NaN, with `others` of its fields."""
        z, rows, nu = (np.full(size, np.nan) for size in (qvi.n, qvi.m, qvi.p))
        return cls(reason, z, rows, rows, nu, message=message, **others)

    def certified(self, qvi: FrictionQVI, tolerance: float) -> Certificate:
        """The certificate of its state."""
        return certify(qvi, self.z, self.m_N, self.m_T, self.nu, tolerance)


def finish(
    qvi: FrictionQVI,
    outcome: Outcome,
    certificate: Certificate,
    method: str,
    inner: str,
    attempts: tuple[Attempt, ...],
    timings: Mapping[str, float],
) -> QVISolution:
    """The solution of an outcome, its status by the certificate; if that fails, whether the load can be carried."""
    began = time.perf_counter()
    status, feasibility = certified_status(outcome.reason, certificate), outcome.feasibility
    undecided = status not in (Status.SOLVED, Status.INACCURATE) and not outcome.hopeless and not deadline.over
    if undecided and feasibility is None:
        feasibility = check_feasibility(qvi)
    if undecided and feasibility is not None and feasibility.feasible is False:
        status = Status.INFEASIBLE
    elif status is Status.INFEASIBLE:
        status = Status.INNER_INFEASIBLE
    if status is not Status.INFEASIBLE:
        feasibility = None
    else:  # the last state of the iteration means nothing then
        nothing = Outcome.nothing(qvi, status, "")
        outcome = replace(outcome, z=nothing.z, m_N=nothing.m_N, m_T=nothing.m_T, nu=nothing.nu)
        certificate = outcome.certified(qvi, certificate.tolerance)
    advice = outcome.advice if status is outcome.reason else ""
    message = _message(status, outcome.iterations, outcome.message, certificate, feasibility, advice)
    remarks: tuple[str, ...] = ()
    if status is Status.SOLVED and outcome.turned:
        several = "the discrete problem may have several solutions, of which this is one"
        remarks = (f"{outcome.turned}: {several}. {WHAT_TO_DO}",)
    return QVISolution(
        qvi, status, outcome.z, outcome.m_N, outcome.m_T, outcome.nu, qvi.law.threshold(qvi.pressure(outcome.z)),
        certificate, tuple(outcome.history), outcome.iterations,
        {**timings, "certificate": timings["certificate"] + time.perf_counter() - began}, method, inner,
        message, dict(outcome.versions),
        None if feasibility is None else feasibility.farkas, outcome.form, qvi.factorisation, outcome.corrections,
        remarks, outcome.near, attempts,
    )  # fmt: skip


def certified_status(reason: Status, certificate: Certificate) -> Status:
    """The status: "solved" if the certificate passed, "inaccurate" if it would pass at `LOOSEST`, else the reason."""
    if certificate.passed:
        return Status.SOLVED
    if reason in (Status.SOLVED, Status.STALLED) and certificate.accuracy <= LOOSEST:
        return Status.INACCURATE
    return Status.STALLED if reason is Status.SOLVED else reason


def _message(
    status: Status,
    count: int,
    detail: str,
    certificate: Certificate,
    feasibility: Feasibility | None = None,
    advice: str = "",
) -> str:
    parts = [f"{status.words} after {count} iteration{'s' if count != 1 else ''}"]
    if status is Status.INFEASIBLE and feasibility is not None:
        parts.append(feasibility.message)
    elif np.isfinite(certificate.accuracy):
        parts.append(certificate.summary())
    if detail and status not in (Status.SOLVED, Status.INFEASIBLE):
        parts.append(detail)
    text = "; ".join(parts) + "."
    return text if status is Status.SOLVED else f"{text} {advice or status.advice}"


def out_of_time(solution: QVISolution) -> QVISolution:
    """The solution with the status "time_limit", because an attempt was still under way."""
    status = Status.TIME_LIMIT
    return replace(solution, status=status, message=_message(status, solution.iterations, "", solution.certificate))
