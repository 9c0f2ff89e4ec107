"""Problems of every family, built, solved and judged; where there is no answer, whether there is one; and the report.

What outcomes mean is said in `report.md`. An open problem counts as solvable where another method has a certified
answer, or `judge.enumerated` finds that there is a solution. Whether any traction is admissible is asked as well:
without one there is no solution, with one there need not be any, as friction takes the pressure that the body has and
not the one it would need.
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
INFEASIBLE, OPEN, FOREIGN = "infeasible", "open", "foreign"

OTHERS: Final = ("qp:daqp", "qp:quadprog")
"""Inner solvers of fixed points that are tried where the default finds no answer. The default itself has tried the
condensed method and, where the contact is small, pivoting."""

SECONDS: Final = 5.0
"""Time for each of these, and for the enumeration of one problem."""

SECOND: Final = "qp:daqp"
"""Inner solver that judges compatibility: an active-set method, of another kind than the default."""


def declared(families: Sequence[str], each: int, first: int = 0) -> Study:
    """Problems `first`, `first` + 1, … of these families, or of all; a run that is stopped has as many of each."""
    for name in families:
        known_name("only", name, {"families": FAMILIES})
    chosen = [name for name in FAMILIES if not families or name in families]
    cases = [{"number": number, "family": name} for number in range(first, first + each) for name in chosen]
    return Study("wild", 4, "comparisons.wild.study:solve_case", cases, (*PACKAGES, "daqp"))


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the study: "outcome", "status", "message", "seconds" of the default, "warnings", and what follows."""
    began = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            wild = wild_problem(case["family"], case["number"])
            result = solve(wild.problem, **wild.settings)
            spent = time.perf_counter() - began
            found = {"seconds": spent, **_judged(result, wild.settings["degree"])}
        except Exception as error:  # whatever it is, but the package's own, it ought not to reach the user
            outcome = REFUSED if isinstance(error, InputError) else OPEN if isinstance(error, QVIError) else FOREIGN
            status = "" if outcome == REFUSED else type(error).__name__
            spent = time.perf_counter() - began
            found = {"seconds": spent, "outcome": outcome, "status": status, "message": str(error)}
    return {**found, "warnings": sorted({f"{each.category.__name__}: {each.message}" for each in caught})}


def _judged(result: ContactResult, degree: int) -> dict[str, Any]:
    """What a solve has found, beside a second method on the answer's own friction bounds."""
    said: dict[str, Any] = {"status": result.status.value, "message": result.message, "remarks": list(result.remarks)}
    if result.status.impossible:
        return {"outcome": INFEASIBLE, **said}
    if result.status is not Status.SOLVED:
        return {"outcome": OPEN, **said, **_solvable(result)}
    errors, distance, ended = wrong(result, degree), None, "no contact"
    if result.solution.problem.m:
        once: dict[str, Any] = {"method": "fixed-point", "inner": SECOND, "max_iterations": 1, "variant": "plain"}
        other = solve(result.discretization, initial=result, **once)
        ended = other.status.value
        if other.has_state and other.history and other.history[0].inner_status is Status.SOLVED:
            beside, ended = compare(result, other), "compared"
            distance = beside.distance
            if beside.differs:
                errors.append(f"{SECOND} is {distance:.1e} away, with {beside.gain:.1e} less energy")
    return {"outcome": WRONG if errors else SOLVED, **said, "errors": errors, "second": ended, "distance": distance}


def _solvable(result: ContactResult) -> dict[str, Any]:
    """Which other method has an answer; else whether one exists, and whether any traction is admissible."""
    for name in OTHERS:
        other = solve(result.discretization, time_limit=SECONDS, method="fixed-point", inner=name)
        if other.status is Status.SOLVED:
            return {"answer": name, "exists": EXISTS, "admissible": True}
    qvi = result.solution.problem
    far = np.isinf(result.discretization.scales.reach)  # it moves to an obstacle that is out of bounds
    try:
        exists = UNDECIDED if far else enumerated(qvi, SECONDS)
        return {"answer": "", "exists": exists, "admissible": check_feasibility(qvi).feasible, "far": bool(far)}
    except FactorisationError:
        return {"answer": "", "exists": UNDECIDED, "admissible": None}


BROKEN: Final = "broken"
"""Outcome of a case that ended without a result: out of time or memory, or its process died."""

ORDER: Final = (SOLVED, INFEASIBLE, OPEN, REFUSED, WRONG, FOREIGN, BROKEN)
LONGEST: Final = 30.0
"""Seconds that no problem should take."""

_NEVER: Final = (WRONG, FOREIGN, BROKEN)


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
    order = problems.family.map(FAMILIES.index)
    return problems.assign(order=order).sort_values("order", kind="stable", ignore_index=True)


def values_of(problems: DataFrame) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    unanswered = problems[problems.outcome == OPEN]
    solvable, admissible = problems[problems.solvable], problems[problems.admissible]
    return {
        **{name: int((problems.outcome == name).sum()) for name in ORDER},
        "problems": len(problems), "longest": LONGEST,
        "slow": int(problems.slow.sum()), "solvable": len(solvable), "admissible": len(admissible),
        "missed": int(unanswered.solvable.sum()), "stuck": int(unanswered.admissible.sum()),
        "hopeless": int((unanswered.admissible & (unanswered.exists == NONE)).sum()),
    }  # fmt: skip


def _reason(found: Any) -> str:
    """Why a problem has no answer, as far as is known; what is wrong with one; what an exception says."""
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
