"""The last step of every method: certificate, status, one readable sentence."""

import time
from dataclasses import dataclass, field, replace

import numpy as np

from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.basics.watch import expired
from solvers.certificate.certificate import Certificate, certify
from solvers.certificate.feasibility import Feasibility, check_feasibility
from solvers.inequality.problem import FrictionQVI
from solvers.solution.solution import Iteration, QVISolution

WHAT_TO_DO = (
    "Which one a body takes depends on how it was loaded: follow the load in steps (solve_history, or initial=… from "
    "the result of a smaller load)."
)
"""What a user can do where there are several solutions."""

LOOSEST = 1e-4
"""A result whose accuracy is worse is not called inaccurate but by the reason why the iteration ended."""


@dataclass(eq=False)
class Outcome:
    """What an iteration leaves behind; `reason` is its own view, before any certificate.

    `turned` says how the way to it had to turn, which happens where there are several solutions. `near` is that of
    `QVISolution`. `advice` says what to do where that is not what the reason says.
    """

    reason: Status
    z: Vector
    m_N: Vector  # noqa: N815  # letters of (D2)
    m_T: Vector  # noqa: N815
    nu: Vector
    threshold: Vector
    history: list[Iteration]
    iterations: int
    message: str = ""
    timings: dict[str, float] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    feasibility: Feasibility | None = None
    form: str = "full"
    check_feasible: bool = True
    corrections: tuple[float, ...] = ()
    turned: str = ""
    near: bool | None = None
    advice: str = ""

    def discard(self, qvi: FrictionQVI) -> None:
        """Forget the point."""
        self.z, self.m_N, self.nu = (np.full(size, np.nan) for size in (qvi.n, qvi.m, qvi.p))
        self.m_T = self.threshold = self.m_N


def no_outcome(qvi: FrictionQVI, reason: Status, message: str) -> Outcome:
    """Nothing but the reason why there is no result."""
    z, rows, nu = (np.full(size, np.nan) for size in (qvi.n, qvi.m, qvi.p))
    return Outcome(reason, z, rows, rows, nu, rows, [], 0, message)


def finish(qvi: FrictionQVI, outcome: Outcome, method: str, inner: str, tolerance: float) -> QVISolution:
    """Certify on the original data and decide the status; without a result, ask whether there can be one."""
    began = time.perf_counter()
    certificate = certify(qvi, outcome.z, outcome.m_N, outcome.m_T, outcome.nu, tolerance)
    status = _status(outcome.reason, certificate)
    feasibility = outcome.feasibility
    undecided = status not in (Status.SOLVED, Status.INACCURATE) and outcome.check_feasible and not expired()
    if undecided and feasibility is None:
        feasibility = check_feasibility(qvi)
    if undecided and feasibility is not None and feasibility.feasible is False:
        status = Status.INFEASIBLE
    elif status is Status.INFEASIBLE:
        status = Status.INNER_INFEASIBLE
    farkas = feasibility.farkas if feasibility is not None and status is Status.INFEASIBLE else None
    if status is Status.INFEASIBLE:  # where an iteration stopped means nothing then
        outcome.discard(qvi)
        certificate = certify(qvi, outcome.z, None, None, None, tolerance)
    outcome.timings["certificate"] = time.perf_counter() - began
    advice = outcome.advice if status is outcome.reason else ""
    return QVISolution(
        qvi, status, outcome.z, outcome.m_N, outcome.m_T, outcome.nu, outcome.threshold, certificate,
        tuple(outcome.history), outcome.iterations, dict(outcome.timings), method, inner,
        _sentence(status, outcome.iterations, outcome.message, certificate, feasibility, advice),
        dict(outcome.versions), farkas, outcome.form,
        qvi.factorisation, outcome.corrections, _remarks(status, outcome.turned), outcome.near,
    )  # fmt: skip


def _status(reason: Status, certificate: Certificate) -> Status:
    """Solved only by certificate; a stop short of it is inaccurate if the result can be used."""
    if certificate.passed:
        return Status.SOLVED
    if reason in (Status.SOLVED, Status.STALLED) and certificate.accuracy <= LOOSEST:
        return Status.INACCURATE
    return Status.STALLED if reason is Status.SOLVED else reason


def _remarks(status: Status, turned: str) -> tuple[str, ...]:
    """That there may be several solutions, where the way to this one suggests it."""
    if status is not Status.SOLVED or not turned:
        return ()
    return (f"{turned}: the discrete problem may have several solutions, of which this is one. {WHAT_TO_DO}",)


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
