"""How a solve ended: one vocabulary for every method and back end."""

from enum import StrEnum


class Status(StrEnum):
    """How a solve ended. The value is a word for files and tables, `advice` a sentence for the user."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    INFEASIBLE_ON_MESH = "infeasible_on_mesh"
    INNER_INFEASIBLE = "inner_infeasible"
    ILL_CONDITIONED = "ill_conditioned"
    UNBOUNDED = "unbounded"
    MAX_ITERATIONS = "max_iterations"
    TIME_LIMIT = "time_limit"
    STALLED = "stalled"
    CYCLING = "cycling"
    DIVERGED = "diverged"
    BACKEND_FAILED = "backend_failed"
    OUT_OF_MEMORY = "out_of_memory"

    @property
    def advice(self) -> str:
        """What it means and what to do about it."""
        return _ADVICE[self]

    @property
    def words(self) -> str:
        """The value as it stands in a sentence."""
        return self.value.replace("_", " ")

    @property
    def impossible(self) -> bool:
        """Whether it is proved that there is no solution, at all or on this mesh."""
        return self in (Status.INFEASIBLE, Status.INFEASIBLE_ON_MESH)

    @property
    def usable(self) -> bool:
        """Whether an inner problem that ended so gives an iterate worth continuing from."""
        return self in (
            Status.SOLVED, Status.INACCURATE, Status.MAX_ITERATIONS, Status.TIME_LIMIT, Status.STALLED,
        )  # fmt: skip


_ADVICE = {
    Status.SOLVED: "Nothing to do: the certificate passed on the original data.",
    Status.INACCURATE: "The certificate passes at a looser tolerance only. Accept that accuracy, or take "
    "another inner solver such as 'direct:clarabel'.",
    Status.INFEASIBLE: "The load cannot be carried: reduce the tension or the sliding force, or add supports (or "
    "friction, if the body slides).",
    Status.INFEASIBLE_ON_MESH: "Stresses of this mesh cannot carry the load, but those of the body may: use smaller "
    "cells at the ends of the contacts, or triangles of a higher degree (such as degree 5). A limit analysis "
    "(limit_load_factor, or qvi-contact limit) tells how much the mesh and the body carry.",
    Status.INNER_INFEASIBLE: "No equilibrium within Coulomb's bounds was found. This is no proof that there is none, "
    "but the load may be beyond what friction can carry. A limit analysis (limit_load_factor, or qvi-contact limit) "
    "gives that limit from both sides. Below the limit, start from the result of a smaller load (initial=…).",
    Status.ILL_CONDITIONED: "The linear system is too ill-conditioned for double precision: use less grading, or "
    "cells less thin.",
    Status.UNBOUNDED: "The energy has no minimum: check that K is positive definite, with no free mode left.",
    Status.MAX_ITERATIONS: "The iteration limit was reached: raise max_iterations if the residuals were falling, else "
    "take method='fixed-point' or another inner solver. A load beyond what friction can carry may end so too: a limit "
    "analysis (limit_load_factor, or qvi-contact limit) gives that limit from both sides.",
    Status.TIME_LIMIT: "The time limit was reached. The state, if there is one, is the best found until then: allow "
    "more time (time_limit), or take fewer cells.",
    Status.STALLED: "The iteration stopped making progress (close to a sliding limit there may be no solution): start "
    "from the result of a smaller load (initial=…), try memory=10 or damping=0.2, or a more accurate inner solver.",
    Status.CYCLING: "The iteration repeats itself (close to a sliding limit there may be no solution): in the fixed "
    "point take variant='anderson' with damping=0.2 or memory=10, or start from the result of a smaller load "
    "(initial=…); in Uzawa let the step shrink (step_decay=200).",
    Status.DIVERGED: "The iteration diverges: reduce the step (omega_T, omega_N) or the damping, or take "
    "method='fixed-point'.",
    Status.OUT_OF_MEMORY: "The factorisation does not fit into memory: take fewer cells (graded towards the ends of "
    "the contact they are as accurate), or a machine with more memory.",
    Status.BACKEND_FAILED: "The back end failed, see the message: take another inner solver, listed by "
    "solvers.available().",
}
