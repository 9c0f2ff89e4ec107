"""The watch over a solve: how long it may take, and who is told how far it is.

    with watched(time_limit=60.0, report=print):
        …                                         # retries, fall-backs, inner problems, feasibility: one clock for all

Methods ask `expired` once an iteration and back ends get the seconds `left`. What is not an iteration, such as a
factorisation, is not interrupted. Inside another watch the earlier end counts, and both are told.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from numbers import Real
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from solvers.errors import InputError

if TYPE_CHECKING:
    from solvers.solution import Iteration

_LEAST: Final = 1e-3  # seconds: some back ends take 0 for no limit


class Progress(NamedTuple):
    """Where a solve is.

    Attributes
    ----------
    method : which method it is that begins or iterates
    iteration : what it has done; None where it begins
    remark : why it begins, where another one has failed before
    stage : what is done that takes long and is no iteration, such as a large factorisation; `method` is what does it

    """

    method: str
    iteration: "Iteration | None" = None
    remark: str = ""
    stage: str = ""


Report: TypeAlias = Callable[[Progress], object]


class _Watch(NamedTuple):
    """The end, of `time.monotonic`, and everyone to tell."""

    end: float = math.inf
    reports: tuple[Report, ...] = ()


_NOBODY: Final = _Watch()
_watch: ContextVar[_Watch] = ContextVar("watch", default=_NOBODY)


@contextmanager
def watched(time_limit: float | None = None, report: Report | None = None) -> Iterator[None]:
    """Everything inside ends within so many seconds, as far as it can be interrupted, and tells `report` how far it is.

    Raises
    ------
    InputError
        If `time_limit` is not a finite number above 0.

    """
    outer = _watch.get()
    end = outer.end if time_limit is None else min(outer.end, time.monotonic() + _seconds(time_limit))
    token = _watch.set(_Watch(end, outer.reports if report is None else (*outer.reports, report)))
    try:
        yield
    finally:
        _watch.reset(token)


def left() -> float:
    """Seconds left, infinity without a limit; never 0, which some back ends take for no limit."""
    end = _watch.get().end
    return max(end - time.monotonic(), _LEAST) if end < math.inf else math.inf


def expired() -> bool:
    """Whether the time is over."""
    end = _watch.get().end
    return end < math.inf and time.monotonic() >= end


def tell(progress: Progress) -> None:
    """Tell everyone who watches."""
    for report in _watch.get().reports:
        report(progress)


def _seconds(value: object) -> float:
    seconds = math.nan
    if not isinstance(value, bool) and isinstance(value, Real):
        with suppress(OverflowError):
            seconds = float(value)
    if not 0.0 < seconds < math.inf:
        raise InputError("time_limit", value, "give a number of seconds above 0")
    return seconds
