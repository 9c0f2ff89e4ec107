"""The statuses with which a solve ends, the same for every method and back end."""

from enum import StrEnum
from typing import Self


class Ending(StrEnum):
    """A status, such as that of a solve; its value is the word in files and tables."""

    advice: str
    """A sentence for the user: the meaning of the status, and what to do."""
    words: str
    """The value as words of a sentence."""

    def __new__(cls, value: str, advice: str = "") -> Self:
        """The member with this value."""
        member = str.__new__(cls, value)
        member._value_, member.advice, member.words = value, advice, value.replace("_", " ")
        return member


class Status(Ending):
    """The status of a solve; its value is the word in files and tables."""

    SOLVED = "solved", "Nothing to do: the certificate passed on the original data."
    INACCURATE = (
        "inaccurate",
        "The certificate passes at a looser tolerance only. Accept that accuracy, or take another inner solver "
        "such as 'direct:clarabel'.",
    )
    INFEASIBLE = (
        "infeasible",
        "The load cannot be carried: reduce the tension or the sliding force, or add supports (or friction, if the "
        "body slides).",
    )
    INFEASIBLE_ON_MESH = (
        "infeasible_on_mesh",
        "Stresses of this mesh cannot carry the load, but those of the body may: use smaller cells at the ends of "
        "the contacts, or triangles of a higher degree (such as degree 5). A limit analysis (limit_load_factor, or "
        "qvi-contact limit) tells how much the mesh and the body carry.",
    )
    INNER_INFEASIBLE = (
        "inner_infeasible",
        "No equilibrium within Coulomb's bounds was found. This is no proof that there is none, but the load may "
        "be beyond what friction can carry: a limit analysis (limit_load_factor, or qvi-contact limit) bounds it, and "
        "a displacement in place of the load finds it, as its force grows until the body slides. Below the limit take "
        "a higher degree or a finer mesh, or start from the result of a smaller load (initial=…).",
    )
    ILL_CONDITIONED = (
        "ill_conditioned",
        "The linear system is too ill-conditioned for double precision: use less grading, or cells less thin.",
    )
    UNBOUNDED = "unbounded", "The energy has no minimum: check that K is positive definite, with no free mode left."
    MAX_ITERATIONS = (
        "max_iterations",
        "The iteration limit was reached: raise max_iterations if the residuals were falling, else take "
        "method='fixed-point', another inner solver, or a finer mesh. A load beyond what friction can carry may end so "
        "too: a limit analysis (limit_load_factor, or qvi-contact limit) gives that limit from both sides.",
    )
    TIME_LIMIT = (
        "time_limit",
        "The time limit was reached. The state, if there is one, is the best found until then: allow more time "
        "(time_limit), or take fewer cells.",
    )
    STALLED = (
        "stalled",
        "The iteration stopped making progress (close to a sliding limit a coarse mesh may have no solution): take a "
        "higher degree or a finer mesh, start from the result of a smaller load (initial=…), try memory=10 or "
        "damping=0.2, or a more accurate inner solver.",
    )
    CYCLING = (
        "cycling",
        "The iteration repeats itself (close to a sliding limit there may be no solution): in the fixed point take "
        "variant='anderson' with damping=0.2 or memory=10, or start from the result of a smaller load "
        "(initial=…); in Uzawa let the step shrink (step_decay=200).",
    )
    DIVERGED = (
        "diverged",
        "The iteration diverges: reduce the step (omega_T, omega_N) or the damping, or take method='fixed-point'.",
    )
    BACKEND_FAILED = (
        "backend_failed",
        "The back end failed, see the message: take another inner solver, listed by solvers.available().",
    )
    OUT_OF_MEMORY = (
        "out_of_memory",
        "The factorisation does not fit into memory: take fewer cells (graded towards the ends of the contact they "
        "are as accurate), or a machine with more memory.",
    )

    @property
    def impossible(self) -> bool:
        """Whether a proof excludes a solution, of the body or on this mesh."""
        return self in (Status.INFEASIBLE, Status.INFEASIBLE_ON_MESH)

    @property
    def usable(self) -> bool:
        """Whether the iterate of an inner problem with this status can be used."""
        return self in (
            Status.SOLVED, Status.INACCURATE, Status.MAX_ITERATIONS, Status.TIME_LIMIT, Status.STALLED,
        )  # fmt: skip
