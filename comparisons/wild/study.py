"""Problems of every family are built, solved and judged; for open problems a solution is searched; and the report.

`report.md` defines the outcomes. An open problem counts as solvable if another method has a certified answer, or if
`judge.enumerated` finds a solution. `check_feasibility` tests whether admissible tractions exist. Without them there is
no solution. With them there may be none, since friction depends on the pressure that the body has.
"""

import time
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pandas import DataFrame, crosstab

from comparisons.lab.numbers import seconds
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import PACKAGES, Row, Study, frame_of
from comparisons.wild.generator import FAMILIES, wild_problem
from comparisons.wild.judge import EXISTS, NONE, UNDECIDED, compare, enumerated, wrong
from qvi_contact import ContactResult, InputError, QVIError, solve
from solvers import Status
from solvers.certificate.feasibility import check_feasibility
from solvers.errors import known_name
from solvers.factorisation.base import FactorisationError

REFUSED, SOLVED, WRONG = "refused", "solved", "wrong"
INFEASIBLE, OPEN, FOREIGN, COMPARED = "infeasible", "open", "foreign", "compared"

OTHERS: Final = ("qp:daqp", "qp:quadprog")
"""Inner solvers of the fixed points that are tried where the default, the condensed method and, for small contacts,
pivoting, finds no answer."""

SECONDS: Final = 5.0
"""Time limit of each of these, and of the enumeration of one problem [s]."""

SECOND: Final = "qp:daqp"
"""Inner solver of the second state in `judge.compare`: an active-set method, of another kind than the default."""


def declared(families: Sequence[str], each: int, first: int = 0) -> Study:
    """Problems `first`, `first` + 1, … of these families, or of all; families take turns."""
    for name in families:
        known_name("only", name, {"families": FAMILIES})
    chosen = [name for name in FAMILIES if not families or name in families]
    cases = [{"number": number, "family": name} for number in range(first, first + each) for name in chosen]
    return Study("wild", 4, "comparisons.wild.study:solve_case", cases, (*PACKAGES, "daqp"))


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task: "outcome", "status", "message", "seconds" of the default, and entries of `_judged`.

    A warning counts as an exception.
    """
    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            wild = wild_problem(case["family"], case["number"])
            result = solve(wild.problem, **wild.settings)
            spent = time.perf_counter() - began
            return {"seconds": spent, **_judged(result, wild.settings["degree"])}
        except Exception as error:  # any exception, but the package's own, is a finding
            outcome = REFUSED if isinstance(error, InputError) else OPEN if isinstance(error, QVIError) else FOREIGN
            status = "" if outcome == REFUSED else type(error).__name__
            spent = time.perf_counter() - began
            return {"seconds": spent, "outcome": outcome, "status": status, "message": str(error)}


def _judged(result: ContactResult, degree: int) -> dict[str, Any]:
    """The outcome of a solve; a solved state is compared with a second method, for its own friction bounds."""
    said: dict[str, Any] = {"status": result.status.value, "message": result.message}
    if result.status.impossible:
        return {"outcome": INFEASIBLE, **said}
    if result.status is not Status.SOLVED:
        return {"outcome": OPEN, **said, **_solvable(result)}
    errors, ended = wrong(result, degree), "no contact"
    if result.solution.problem.m:
        once: dict[str, Any] = {"method": "fixed-point", "inner": SECOND, "max_iterations": 1, "variant": "plain"}
        other = solve(result.discretization, initial=result, **once)
        ended = other.status.value
        if other.has_state and other.history and other.history[0].inner_status is Status.SOLVED:
            beside, ended = compare(result, other), COMPARED
            if beside.differs:
                errors.append(f"{SECOND} is {beside.distance:.1e} away, with {beside.gain:.1e} less energy")
    return {"outcome": WRONG if errors else SOLVED, **said, "errors": errors, "second": ended}


def _solvable(result: ContactResult) -> dict[str, Any]:
    """The other method that has an answer; otherwise whether a solution exists, and admissible tractions."""
    for name in OTHERS:
        other = solve(result.discretization, time_limit=SECONDS, method="fixed-point", inner=name)
        if other.status is Status.SOLVED:
            return {"answer": name, "exists": EXISTS, "admissible": True}
    qvi = result.solution.problem
    far = np.isinf(result.discretization.scales.reach)  # the body moves to an obstacle outside the search's bounds
    try:
        exists = UNDECIDED if far else enumerated(qvi, SECONDS)
        return {"answer": "", "exists": exists, "admissible": check_feasibility(qvi).feasible, "far": bool(far)}
    except FactorisationError:
        return {"answer": "", "exists": UNDECIDED, "admissible": None}


BROKEN: Final = "broken"
"""Outcome of a case without a result: out of time or memory, or its process died."""

ORDER: Final = (SOLVED, INFEASIBLE, OPEN, REFUSED, WRONG, FOREIGN, BROKEN)
LONGEST: Final = 30.0
"""Longest time that a problem should take [s]."""

_NEVER: Final = (WRONG, FOREIGN, BROKEN)


def problems_of(rows: Sequence[Row]) -> DataFrame:
    """One line a problem, family by family.

    The columns are those of `frame_of`, with "outcome", one of `ORDER`; "seconds" of building and solving; "reason" of
    a missing or wrong answer; "answer", the method that has one where the default has none; "exists", the result of the
    enumeration of an open problem; "solvable", whether it is known to have a solution; "admissible", whether tractions
    obey the law and balance the load; "trouble" and "slow", which must not happen.
    """
    others = ("outcome", "message", "errors", "second", "answer", "exists", "admissible", "far")
    problems = frame_of(rows, ("seconds",), others)
    problems["outcome"] = problems.outcome.where(problems.has, BROKEN)
    problems["seconds"] = problems.seconds.fillna(problems.spent)
    problems["reason"] = [_reason(each) for each in problems.itertuples()]
    problems["admissible"] = (problems.outcome == SOLVED) | (problems.admissible == True)  # noqa: E712 - or unknown
    exists = (problems.outcome == OPEN) & (problems.exists == EXISTS)
    problems["solvable"] = problems.outcome.isin([SOLVED, WRONG]) | exists
    problems["trouble"] = problems.outcome.isin(_NEVER)
    problems["slow"] = problems.seconds > LONGEST
    order = problems.family.map(FAMILIES.index)
    return problems.assign(order=order).sort_values("order", kind="stable", ignore_index=True)


def values_of(problems: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    unanswered = problems[problems.outcome == OPEN]
    solvable, admissible = problems[problems.solvable], problems[problems.admissible]
    return {
        **{name: int((problems.outcome == name).sum()) for name in ORDER},
        "problems": len(problems), "longest": LONGEST, "compared": int((problems.second == COMPARED).sum()),
        "slow": int(problems.slow.sum()), "solvable": len(solvable), "admissible": len(admissible),
        "missed": int(unanswered.solvable.sum()), "stuck": int(unanswered.admissible.sum()),
        "hopeless": int((unanswered.admissible & (unanswered.exists == NONE)).sum()),
    }  # fmt: skip


def _reason(found: Any) -> str:
    """The known reason why a problem has no answer; the errors of a wrong answer; the message of an exception."""
    rounding = found.status in ("ill_conditioned", "inaccurate")
    reasons = (
        (found.outcome == BROKEN, str(found.reason)),
        (found.outcome == WRONG, "; ".join(found.errors) if found.outcome == WRONG else ""),
        (found.outcome != OPEN, str(found.message) if found.outcome == FOREIGN else ""),
        (found.answer and found.answer == found.answer, f"{found.answer} finds an answer"),
        (found.exists == EXISTS and rounding,
         "there is a solution, and the answer found is short of the tolerance: rounding"),
        (found.exists == EXISTS, "there is a solution, and no method finds it"),
        (found.exists == NONE,
         "no state of contact solves it: admissible tractions need more pressure than the body has there"),
        (found.far is True, "the body moves to an obstacle hundreds of times farther away than it deforms: rounding"),
        (rounding, "an answer short of the tolerance: rounding"),
        (found.admissible is False, "no admissible traction"),
    )  # fmt: skip
    otherwise = "too large to enumerate, or out of time: the load may be beyond a sliding limit"
    return next((reason for holds, reason in reasons if holds), otherwise)


def report(rows: Sequence[Row]) -> Report:
    """The report, a function of the rows only. It has failed if there is trouble."""
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
