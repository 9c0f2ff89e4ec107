"""What became of the problems, from the stored rows alone."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from comparisons.lab.study import DONE, Row, StoredStudy
from comparisons.wild.enumeration import EXISTS, NONE
from comparisons.wild.generator import FAMILIES
from comparisons.wild.task import ACCEPTED, FOREIGN, INFEASIBLE, OPEN, REFUSED, SOLVED, WRONG

BROKEN: Final = "broken"
"""Outcome of a case that ended without a result: out of time or memory, or its process died."""

ORDER: Final = (SOLVED, INFEASIBLE, OPEN, REFUSED, ACCEPTED, WRONG, FOREIGN, BROKEN)
LONGEST: Final = 30.0
"""Seconds that no problem should take."""


@dataclass(frozen=True)
class Entry:
    """One problem.

    Attributes
    ----------
    family, number : what makes it
    outcome : one of `ORDER`
    status : of the default method, or the kind of exception
    seconds : of building and solving by default
    reason : why there is no answer, or what is wrong; empty otherwise
    answer : the method that has an answer where the default has none
    exists : what enumeration says of an open problem
    admissible : whether there is a traction that obeys the law and balances the load
    warnings : said meanwhile

    """

    family: str
    number: int
    outcome: str
    status: str
    seconds: float
    reason: str
    answer: str
    exists: str
    admissible: bool
    warnings: Sequence[str]

    @property
    def solvable(self) -> bool:
        """Whether it is known to have a solution."""
        return self.outcome in (SOLVED, WRONG) or (self.outcome == OPEN and self.exists == EXISTS)


def entries_of(study: StoredStudy) -> list[Entry]:
    """The entries, family by family."""
    families = list(FAMILIES)
    return sorted(map(_entry, study.rows), key=lambda entry: (families.index(entry.family), entry.number))


def _entry(row: Row) -> Entry:
    family, number = row.case["family"], row.case["number"]
    if row.status != DONE:
        return Entry(family, number, BROKEN, row.status, row.seconds, row.reason, "", "", False, ())
    found = row.result
    return Entry(
        family, number, found["outcome"], found["status"], found["seconds"], _reason(found), found.get("answer", ""),
        found.get("exists", ""), found["outcome"] == SOLVED or found.get("admissible") is True, found["warnings"],
    )  # fmt: skip


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


def counts_of(entries: Sequence[Entry]) -> dict[str, int]:
    """Outcome → how many, in the order of `ORDER`."""
    counts = Counter(entry.outcome for entry in entries)
    return {name: counts[name] for name in ORDER}


def failed(entries: Sequence[Entry]) -> list[Entry]:
    """What must not happen: wrong answers, foreign exceptions, nonsense accepted, cases that broke."""
    return [entry for entry in entries if entry.outcome in (WRONG, FOREIGN, ACCEPTED, BROKEN)]


def slow(entries: Sequence[Entry]) -> list[Entry]:
    """Problems that took longer than `LONGEST`, the slowest first."""
    return sorted((entry for entry in entries if entry.seconds > LONGEST), key=lambda entry: -entry.seconds)
