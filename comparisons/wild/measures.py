"""What became of the problems, from the stored rows alone."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.study import DONE, Row
from comparisons.wild.enumeration import EXISTS, NONE, UNDECIDED
from comparisons.wild.generator import FAMILIES
from comparisons.wild.task import ACCEPTED, FOREIGN, INFEASIBLE, OPEN, REFUSED, SOLVED, WRONG

if TYPE_CHECKING:
    from pandas import DataFrame

BROKEN: Final = "broken"
"""Outcome of a case that ended without a result: out of time or memory, or its process died."""

ORDER: Final = (SOLVED, INFEASIBLE, OPEN, REFUSED, ACCEPTED, WRONG, FOREIGN, BROKEN)
LONGEST: Final = 30.0
"""Seconds that no problem should take."""

_NEVER: Final = (WRONG, FOREIGN, ACCEPTED, BROKEN)


def problems_of(rows: Sequence[Row]) -> "DataFrame":
    """One line a problem, family by family.

    The columns are family and number, which make it; outcome, one of `ORDER`; status of the default method, or the kind
    of exception; seconds of building and solving; reason, why there is no answer or what is wrong; answer, the method
    that has one where the default has none; exists, what enumeration says of an open problem; solvable, whether it is
    known to have a solution; admissible, whether a traction obeys the law and balances the load; trouble and slow, what
    must not happen.
    """
    from pandas import DataFrame

    families = list(FAMILIES)
    found = sorted(map(_problem, rows), key=lambda one: (families.index(one["family"]), one["number"]))
    problems = DataFrame(found)
    exists = (problems.outcome == OPEN) & (problems.exists == EXISTS)
    problems["solvable"] = problems.outcome.isin([SOLVED, WRONG]) | exists
    problems["trouble"] = problems.outcome.isin(_NEVER)
    problems["slow"] = problems.seconds > LONGEST
    return problems


def counts_of(problems: "DataFrame") -> dict[str, int]:
    """Outcome → how many, in the order of `ORDER`."""
    counts = problems.outcome.value_counts()
    return {name: int(counts.get(name, 0)) for name in ORDER}


def values_of(problems: "DataFrame") -> dict[str, Any]:
    """The numbers of the report's sentences."""
    unanswered = problems[problems.outcome == OPEN]
    solvable, admissible = problems[problems.solvable], problems[problems.admissible]
    present = {name: text for name, text in FAMILIES.items() if name in set(problems.family)}
    return {
        **counts_of(problems), "problems": len(problems), "families": present, "longest": LONGEST,
        "slow": int(problems.slow.sum()), "solvable": len(solvable), "admissible": len(admissible),
        "missed": int(unanswered.solvable.sum()), "stuck": int(unanswered.admissible.sum()),
        "hopeless": int((unanswered.exists == NONE).sum()), "unknown": int((unanswered.exists == UNDECIDED).sum()),
    }  # fmt: skip


def _problem(row: Row) -> dict[str, Any]:
    known = {"family": row.case["family"], "number": row.case["number"]}
    if row.status != DONE:
        return known | {
            "outcome": BROKEN, "status": row.status, "seconds": row.seconds, "reason": row.reason, "answer": "",
            "exists": "", "admissible": False,
        }  # fmt: skip
    found = row.result
    return known | {
        "outcome": found["outcome"], "status": found["status"], "seconds": found["seconds"], "reason": _reason(found),
        "answer": found.get("answer", ""), "exists": found.get("exists", ""),
        "admissible": found["outcome"] == SOLVED or found.get("admissible") is True,
    }  # fmt: skip


def _reason(found: Mapping[str, Any]) -> str:
    """Why a problem has no answer, as far as is known; what is wrong with one; what an exception says."""
    if found["outcome"] == OPEN:
        return _open_reason(found)
    if found["outcome"] == WRONG:
        return "; ".join(found["errors"])
    return str(found["message"]) if found["outcome"] in (FOREIGN, ACCEPTED) else ""


def _open_reason(found: Mapping[str, Any]) -> str:
    if found.get("answer"):
        return f"{found['answer']} finds an answer"
    if found.get("exists") == EXISTS and found["status"] in ("ill_conditioned", "inaccurate"):
        return "there is a solution, and the answer found is short of the tolerance: rounding"
    if found.get("exists") == EXISTS:
        return "there is a solution, and no method finds it"
    if found.get("exists") == NONE:
        return "no state of contact solves it: admissible tractions need more pressure than the body has there"
    if found.get("far"):
        return "the body moves to an obstacle hundreds of times farther away than it deforms: rounding"
    if found["status"] in ("ill_conditioned", "inaccurate"):
        return "an answer short of the tolerance: rounding"
    if found.get("admissible") is False:
        return "no admissible traction"
    return "too large to enumerate, or out of time: the load may be beyond a sliding limit"
