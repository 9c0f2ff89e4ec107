"""What became of a case: the words for it, and how the exceptions of a task are told in one line."""

import errno
import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from comparisons.lab.worker.plain import canonical, plain

DONE: Final = "done"
ERROR: Final = "error"
TIMEOUT: Final = "timeout"
MEMORY: Final = "memory"
CRASHED: Final = "crashed"
REFUSED: Final = "refused"
CRAMPED: Final = "cramped"

FAILURES: Final[Mapping[str, str]] = {
    ERROR: "the task raised an exception, or returned other values than numbers, texts, lists and dictionaries",
    TIMEOUT: "the case took longer than allowed and was ended",
    MEMORY: "the case needed more memory than allowed",
    CRASHED: "the process that ran the case died",
}
"""Status of a row without a result → what it means. `DONE` is the status of all others.

`REFUSED` and `CRAMPED` are never a row's: the task cannot be loaded, at all or in the memory allowed, so that the study
has to end.
"""

_SHORTAGE: Final = ("MemoryError", "bad_alloc", "Cannot allocate memory", "failed to map segment")
_LONGEST: Final = 300


@dataclass(frozen=True)
class Outcome:
    """What became of a case.

    Attributes
    ----------
    status : str
        `DONE`, one of `FAILURES`, or why there can be no row.
    reason : str
        Why there is no result, in one line; empty if there is one.
    result : Mapping
        What the task returned, without its entry "certificate".
    certificate : object
        That entry, None if there was none.
    seconds : float
        Wall time of the task alone, or until it was ended.
    load_average : float, optional
        Processes that wanted to run on the machine in the minute before.
    environment : Mapping
        Machine, versions, threads and limits.

    """

    status: str
    reason: str = ""
    result: Mapping[str, Any] = field(default_factory=dict)
    certificate: Any = None
    seconds: float = 0.0
    load_average: float | None = None
    environment: Mapping[str, Any] = field(default_factory=dict)


def of_return(returned: Any) -> dict[str, Any]:
    """Status, reason, result and certificate of what a task returned: a failure unless it is a mapping of plain values.

    Infinite numbers and NaN are plain here: a residual may well be infinite.
    """
    try:
        if not isinstance(returned, Mapping):
            raise TypeError(f"the task returned {type(returned).__name__}, not a mapping")
        result = plain(returned, "result")
        canonical(result)
    except Exception as error:  # a mapping may be anybody's
        return of_exception(error.with_traceback(None))
    certificate = result.pop("certificate", None)
    return {"status": DONE, "result": result, "certificate": certificate}


def of_exception(error: BaseException) -> dict[str, Any]:
    """Status and reason of what a task raised, with the line it came from."""
    text = ": ".join(filter(None, [type(error).__name__, str(error)]))
    short = isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM)
    status = MEMORY if short or names_shortage(text) else ERROR
    places = traceback.extract_tb(error.__traceback__)[-1:]
    where = "".join(f" ({Path(place.filename).name}, line {place.lineno})" for place in places)
    return {"status": status, "reason": one_line(text) + where}


def names_shortage(text: str) -> bool:
    """Whether these are the words of a library that got no memory."""
    return any(word in text for word in _SHORTAGE)


def one_line(text: str) -> str:
    """The text without line breaks, cut where it gets long."""
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else line[: _LONGEST - 1] + "…"
