"""How a solve ended: one vocabulary for every method and back end."""

from enum import StrEnum


class Status(StrEnum):
    """How a solve ended. The value is a word for files and tables, `advice` a sentence for the user."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    INNER_INFEASIBLE = "inner_infeasible"
    ILL_CONDITIONED = "ill_conditioned"
    UNBOUNDED = "unbounded"
    MAX_ITERATIONS = "max_iterations"
    STALLED = "stalled"
    CYCLING = "cycling"
    DIVERGED = "diverged"
    BACKEND_FAILED = "backend_failed"

    @property
    def advice(self) -> str:
        """What to do about it, in one sentence."""
        return _ADVICE[self]

    @property
    def usable(self) -> bool:
        """Whether an inner problem that ended so gives an iterate worth continuing from."""
        return self in (Status.SOLVED, Status.INACCURATE, Status.MAX_ITERATIONS, Status.STALLED)


_ADVICE = {
    Status.SOLVED: "Nothing to do: the certificate passed on the original data.",
    Status.INACCURATE: "The certificate passes only at a looser tolerance: accept its accuracy, or take "
    "another inner solver such as 'direct:clarabel'.",
    Status.INFEASIBLE: "No admissible traction carries the load: reduce the tension or the sliding force, or "
    "add supports or friction.",
    Status.INNER_INFEASIBLE: "The iteration met friction bounds under which no traction carries the load, and found no "
    "way around them; there may be no solution: give another initial pressure, more damping or less load.",
    Status.ILL_CONDITIONED: "The linear system is beyond double precision: use less grading, or cells less thin.",
    Status.UNBOUNDED: "The energy has no minimum: check that K is positive definite, that is, that no free "
    "mode is left.",
    Status.MAX_ITERATIONS: "The iteration limit came first: raise max_iterations, or loosen the tolerance.",
    Status.STALLED: "The iteration stopped making progress: take variant='anderson', another start, or a "
    "more accurate inner solver.",
    Status.CYCLING: "The iteration repeats itself: take variant='anderson' or 'damped' with a smaller "
    "damping (fixed point), or step_decay (Uzawa).",
    Status.DIVERGED: "The iteration runs away: reduce the step (omega_T, omega_N) or the damping, or take "
    "method='fixed-point'.",
    Status.BACKEND_FAILED: "The back end failed, see the message: take another inner solver, listed by "
    "solvers.available().",
}
