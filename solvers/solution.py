"""What a solve returns."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from solvers.basics.progress import deadline
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import Certificate, certify
from solvers.certificate.feasibility import Feasibility, check_feasibility
from solvers.certificate.uniqueness import UniquenessBound, uniqueness_bound
from solvers.inequality.problem import FrictionQVI

_LAST, _LEAST = 10, 4  # residuals that tell a contraction, at most and at least
_ROUNDING = 1e-13  # residuals below this do not


class Iteration(NamedTuple):
    """One outer iteration, or one of the interior point method, dimensionless."""

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
    """How the inner problem ended; ``None`` where there is none."""
    inner_iterations: int = 0
    """Iterations of the inner solver, 0 if unknown."""
    seconds: float = 0.0
    """Wall time of the iteration."""


class Attempt(NamedTuple):
    """One of the ways that were tried, in their order."""

    name: str
    """A method, a start of one, or a change of the problem."""
    reason: str
    """Why it was tried; empty of the first."""
    status: Status
    """How it ended."""
    iterations: int
    """How many it took."""


@dataclass(frozen=True, eq=False)
class QVISolution:
    """A point z with its multipliers, how it was found, and the proof of what it is worth."""

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
    """What was used; `inner` is the fixed point's, else empty."""
    message: str = ""
    """One readable sentence."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Package → version of what was used."""
    farkas: tuple[Vector, Vector] | None = None
    """(rows of G, of A) multipliers proving infeasibility, else None; see `feasibility`."""
    form: str = "full"
    """Unknowns of the inner problems, and of the condensed method's Newton matrices: "full" or "condensed"."""
    factorisation: str = ""
    """Back end and version of the factorisation of K; empty if none was made."""
    corrections: tuple[float, ...] = ()
    """Of the condensed method, sizes of the defect corrections in the energy norm, relative: what the rounding inside K
    had spoilt; they end where the next one would be rounding."""
    remarks: tuple[str, ...] = ()
    """What to know about a solution, such as that there are several; one sentence each."""
    near: bool | None = None
    """Of the condensed method, whether the state it was to begin from was near enough; None if there was none."""
    attempts: tuple[Attempt, ...] = ()
    """What was tried, one `Attempt` each, in their order."""

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
        """Factor by which the fixed point's residual shrank in an iteration; None for others, or with fewer than four.

        The median of the last ten above rounding: single lucky or spoilt ones do not count. Above 1 the loop diverges.
        That of Anderson's loop is usually smaller than that of the map that `uniqueness` bounds.
        """
        found = [entry for entry in self.history if entry.inner_status is not None and np.isfinite(entry.residual)]
        last = [(entry.number, np.log(entry.residual)) for entry in found if entry.residual > _ROUNDING][-_LAST:]
        if self.method != "fixed-point" or len(last) < _LEAST:
            return None
        number, size = np.diff(last, axis=0).T
        return float(np.exp(np.median(size / number)))

    @cached_property
    def uniqueness(self) -> UniquenessBound:
        """The sufficient bound of friction for uniqueness, computed when it is asked for; see `uniqueness`."""
        return uniqueness_bound(self.problem)


# Where an iteration starts: the answer to a problem before.


@dataclass(frozen=True, eq=False)
class Start:
    """A state of a problem with the same rows, in the units of the one to be solved."""

    pressure: Vector  # s (m,) ≥ 0
    z: Vector  # (n,)
    multipliers: Vector  # (2m,) of rows, first normal ones; signs as in `FrictionQVI`

    @classmethod
    def of(cls, solution: QVISolution, stress: float = 1.0, displacement: float = 1.0) -> Start:
        """The answer to a problem before, its units given in those of the problem to be solved."""
        return cls(
            stress * solution.problem.pressure(solution.z),
            stress * solution.z,
            displacement * np.concatenate([solution.normal_multiplier, solution.tangential_multiplier]),
        )

    def fits(self, qvi: FrictionQVI) -> bool:
        """Whether it may be a state of that problem."""
        return self.z.shape == (qvi.n,) and self.multipliers.shape == (2 * qvi.m,)


# The last step of every method: certificate, status, one readable sentence.


WHAT_TO_DO = (
    "Which one a body takes depends on how it was loaded: follow the load in steps (solve_history, or initial=… from "
    "the result of a smaller load)."
)
"""What a user can do where there are several solutions."""

LOOSEST = 1e-4
"""A result whose accuracy is worse is not called inaccurate but by the reason why the iteration ended."""


@dataclass(eq=False)
class Outcome:
    """What an iteration leaves behind, before any certificate; fields without a comment are those of `QVISolution`."""

    reason: Status  # how the iteration itself sees its end
    z: Vector
    m_N: Vector  # noqa: N815  # letters of (D2); NaN where there is no result, as z and ν
    m_T: Vector  # noqa: N815
    nu: Vector
    history: list[Iteration] = field(default_factory=list)
    iterations: int = 0
    message: str = ""  # what to say where it is not solved
    advice: str = ""  # what to do then, if that is not what the reason says
    setup: float = 0.0  # seconds before the first iteration
    versions: Mapping[str, str] = field(default_factory=dict)
    feasibility: Feasibility | None = None  # that of the problem, if it is known
    form: str = "full"
    hopeless: bool = False  # no certificate is to be hoped for, nor is it of interest whether there is a solution
    corrections: tuple[float, ...] = ()
    turned: str = ""  # how the way to it had to turn, which happens where there are several solutions
    near: bool | None = None

    @classmethod
    def nothing(cls, qvi: FrictionQVI, reason: Status, message: str) -> Outcome:
        """Nothing but the reason why there is no result."""
        z, rows, nu = (np.full(size, np.nan) for size in (qvi.n, qvi.m, qvi.p))
        return cls(reason, z, rows, rows, nu, message=message)

    def certified(self, qvi: FrictionQVI, tolerance: float) -> Certificate:
        """What it is worth."""
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
    """Decide the status by the certificate; without a result, ask whether there can be one."""
    began = time.perf_counter()
    status, feasibility = judged(outcome.reason, certificate), outcome.feasibility
    undecided = status not in (Status.SOLVED, Status.INACCURATE) and not outcome.hopeless and not deadline.over
    if undecided and feasibility is None:
        feasibility = check_feasibility(qvi)
    if undecided and feasibility is not None and feasibility.feasible is False:
        status = Status.INFEASIBLE
    elif status is Status.INFEASIBLE:
        status = Status.INNER_INFEASIBLE
    if status is not Status.INFEASIBLE:
        feasibility = None
    else:  # where an iteration stopped means nothing then
        nothing = Outcome.nothing(qvi, status, "")
        outcome = replace(outcome, z=nothing.z, m_N=nothing.m_N, m_T=nothing.m_T, nu=nothing.nu)
        certificate = outcome.certified(qvi, certificate.tolerance)
    advice = outcome.advice if status is outcome.reason else ""
    message = _sentence(status, outcome.iterations, outcome.message, certificate, feasibility, advice)
    remarks: tuple[str, ...] = ()
    if status is Status.SOLVED and outcome.turned:
        several = "the discrete problem may have several solutions, of which this is one"
        remarks = (f"{outcome.turned}: {several}. {WHAT_TO_DO}",)
    return QVISolution(
        qvi, status, outcome.z, outcome.m_N, outcome.m_T, outcome.nu, qvi.threshold(qvi.pressure(outcome.z)),
        certificate, tuple(outcome.history), outcome.iterations,
        {**timings, "certificate": timings["certificate"] + time.perf_counter() - began}, method, inner,
        message, dict(outcome.versions),
        None if feasibility is None else feasibility.farkas, outcome.form, qvi.factorisation, outcome.corrections,
        remarks, outcome.near, attempts,
    )  # fmt: skip


def judged(reason: Status, certificate: Certificate) -> Status:
    """Solved only by certificate; a stop short of it is inaccurate if the result can be used."""
    if certificate.passed:
        return Status.SOLVED
    if reason in (Status.SOLVED, Status.STALLED) and certificate.accuracy <= LOOSEST:
        return Status.INACCURATE
    return Status.STALLED if reason is Status.SOLVED else reason


def _sentence(
    status: Status,
    count: int,
    said: str,
    certificate: Certificate,
    feasibility: Feasibility | None = None,
    advice: str = "",
) -> str:
    parts = [f"{status.words} after {count} iteration{'s' if count != 1 else ''}"]
    if status is Status.INFEASIBLE and feasibility is not None:
        parts.append(feasibility.message)
    elif np.isfinite(certificate.accuracy):
        parts.append(certificate.summary())
    if said and status not in (Status.SOLVED, Status.INFEASIBLE):
        parts.append(said)
    text = "; ".join(parts) + "."
    return text if status is Status.SOLVED else f"{text} {advice or status.advice}"


def out_of_time(solution: QVISolution) -> QVISolution:
    """The same state with the status "time_limit": something was still being tried."""
    status = Status.TIME_LIMIT
    return replace(solution, status=status, message=_sentence(status, solution.iterations, "", solution.certificate))
