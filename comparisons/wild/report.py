"""The report of the wild problems, and what became of them, from the stored rows alone."""

from collections.abc import Sequence
from typing import Any, Final

from pandas import DataFrame, crosstab

from comparisons.lab.numbers import seconds
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, frame_of
from comparisons.wild.generator import FAMILIES
from comparisons.wild.judge import EXISTS, NONE, UNDECIDED
from comparisons.wild.study import ACCEPTED, FOREIGN, INFEASIBLE, OPEN, REFUSED, SOLVED, WRONG

BROKEN: Final = "broken"
"""Outcome of a case that ended without a result: out of time or memory, or its process died."""

ORDER: Final = (SOLVED, INFEASIBLE, OPEN, REFUSED, ACCEPTED, WRONG, FOREIGN, BROKEN)
LONGEST: Final = 30.0
"""Seconds that no problem should take."""

_NEVER: Final = (WRONG, FOREIGN, ACCEPTED, BROKEN)


def problems_of(rows: Sequence[Row]) -> DataFrame:
    """One line a problem, family by family.

    The columns are those of `frame_of`, with outcome one of `ORDER`, seconds of building and solving, reason, why there
    is no answer or what is wrong, answer, the method that has one where the default has none, exists, what enumeration
    says of an open problem, solvable, whether it is known to have a solution, admissible, whether a traction obeys the
    law and balances the load, and trouble and slow, what must not happen.
    """
    problems = frame_of(rows, ("seconds",), ("outcome", "message", "errors", "answer", "exists", "admissible", "far"))
    problems["outcome"] = problems.outcome.where(problems.has, BROKEN)
    problems["seconds"] = problems.seconds.fillna(problems.spent)
    problems["reason"] = [_reason(each) for each in problems.itertuples()]
    problems["admissible"] = (problems.outcome == SOLVED) | (problems.admissible == True)  # noqa: E712 - or unknown
    exists = (problems.outcome == OPEN) & (problems.exists == EXISTS)
    problems["solvable"] = problems.outcome.isin([SOLVED, WRONG]) | exists
    problems["trouble"] = problems.outcome.isin(_NEVER)
    problems["slow"] = problems.seconds > LONGEST
    order = problems.family.map(list(FAMILIES).index)
    return problems.assign(order=order).sort_values("order", kind="stable", ignore_index=True)


def values_of(problems: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    unanswered = problems[problems.outcome == OPEN]
    solvable, admissible = problems[problems.solvable], problems[problems.admissible]
    present = {name: text for name, text in FAMILIES.items() if name in set(problems.family)}
    return {
        **{name: int((problems.outcome == name).sum()) for name in ORDER},
        "problems": len(problems), "families": present, "longest": LONGEST,
        "slow": int(problems.slow.sum()), "solvable": len(solvable), "admissible": len(admissible),
        "missed": int(unanswered.solvable.sum()), "stuck": int(unanswered.admissible.sum()),
        "hopeless": int((unanswered.exists == NONE).sum()), "unknown": int((unanswered.exists == UNDECIDED).sum()),
    }  # fmt: skip


def _reason(found: Any) -> str:
    """Why a problem has no answer, as far as is known; what is wrong with one; what an exception says."""
    if found.outcome == BROKEN:
        return str(found.reason)
    if found.outcome == OPEN:
        return _open_reason(found)
    if found.outcome == WRONG:
        return "; ".join(found.errors)
    return str(found.message) if found.outcome in (FOREIGN, ACCEPTED) else ""


def _open_reason(found: Any) -> str:
    rounding = found.status in ("ill_conditioned", "inaccurate")
    if found.answer and found.answer == found.answer:
        return f"{found.answer} finds an answer"
    if found.exists == EXISTS and rounding:
        return "there is a solution, and the answer found is short of the tolerance: rounding"
    if found.exists == EXISTS:
        return "there is a solution, and no method finds it"
    if found.exists == NONE:
        return "no state of contact solves it: admissible tractions need more pressure than the body has there"
    if found.far is True:
        return "the body moves to an obstacle hundreds of times farther away than it deforms: rounding"
    if rounding:
        return "an answer short of the tolerance: rounding"
    if found.admissible is False:
        return "no admissible traction"
    return "too large to enumerate, or out of time: the load may be beyond a sliding limit"


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same one. It has failed if there is trouble."""
    problems = problems_of(rows)
    named = problems.assign(problem=problems.family + " " + problems.number.astype(str))
    counts = crosstab(problems.family, problems.outcome).reindex(problems.family.unique(), columns=ORDER, fill_value=0)
    families = problems.groupby("family")
    tables = {
        "outcomes": counts.assign(problems=families.size(), seconds=families.seconds.max()).reset_index(),
        "troubles": named[named.trouble | named.slow], "open": named[named.outcome == OPEN],
    }  # fmt: skip
    forms = {"seconds": lambda value: seconds(value, 2)}
    return render("comparisons.wild", "wild", values_of(problems), tables, {}, rows, forms=forms,
                  failed=bool(problems.trouble.any()))  # fmt: skip
