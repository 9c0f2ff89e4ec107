"""The watch over a solve: how long it may take, and who is told how far it is.

    with watched(time_limit=60.0, report=print):
        …                                         # retries, fall-backs, inner problems, feasibility: one clock for all

Methods ask `expired` once an iteration and back ends get the seconds `left`. What is not an iteration, such as a
factorisation, is not interrupted. Inside another watch the earlier end counts, and both are told.
"""

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from numbers import Real
from string import ascii_letters
from textwrap import wrap
from time import perf_counter
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

from solvers.basics.checks import true_or_false
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
    end = min(outer.end, time.monotonic() + checked_limit(time_limit))
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


def checked_limit(value: object) -> float:
    """Seconds of a time limit, infinity where there is none; `InputError` unless it is a finite number above 0."""
    seconds = math.nan
    if value is None:
        return math.inf
    if not isinstance(value, bool) and isinstance(value, Real):
        with suppress(OverflowError):
            seconds = float(value)
    if not 0.0 < seconds < math.inf:
        raise InputError("time_limit", value, "give a number of seconds above 0")
    return seconds


# What a solve says while it runs: printed with ``verbose=True``, and logged under the name "qvi_contact".
#
#     with narrated("solve", verbose) as story:
#         story.begin({"unknowns": 768, "method": "condensed"})
#         …                                          # a line for each iteration that methods `tell` of
#         story.end(status, message, {"solve": 0.1})
#
# A header, a line an iteration, a footer with status and times: this module is the only one that prints them. Inside
# another narration nothing is printed, since the outer one speaks for all.
#
# Levels of the log: INFO how the outermost call begins and ends, WARNING where it ends without a solution, DEBUG its
# iterations and the calls inside it.


LOGGER: Final = logging.getLogger("qvi_contact")
"""The logger of all packages of the project; silent unless the program that uses them gives it a handler."""
LOGGER.addHandler(logging.NullHandler())

ITERATIONS: Final = {
    "method": "<12", "iteration": ">9", "residual": ">10.2e", "energy": ">15.7e", "normal force": ">14.6e",
    "seconds": ">9.2f",
}  # fmt: skip
"""Columns of the lines that methods tell of, with their formats; dimensionless, as in `Iteration`."""

_WIDTH: Final = 79
_LABEL: Final = 16
_ALL: Final = 20  # first iterations that are printed; later ones where two digits change

_depth: ContextVar[int] = ContextVar("depth", default=0)


class Narration:
    """One story: its header, its lines, its footer.

    Parameters
    ----------
    title : str
        Who speaks.
    shown : bool
        Whether it is printed.
    columns : mapping
        Heading of each column → format of its numbers.
    outermost : bool
        Whether the log has beginning and end at INFO.

    """

    def __init__(self, title: str, shown: bool, columns: Mapping[str, str], outermost: bool) -> None:
        self._title, self._shown, self._columns = title, shown, columns
        self._outermost, self._level = outermost, logging.INFO if outermost else logging.DEBUG
        self._began = perf_counter()

    @property
    def seconds(self) -> float:
        """Seconds since it began."""
        return perf_counter() - self._began

    def begin(self, facts: Mapping[str, object]) -> None:
        """What is solved, and how."""
        LOGGER.log(self._level, "%s: %s", self._title, ", ".join(f"{name} {value}" for name, value in facts.items()))
        if self._shown:
            headings = (f"{name:{_aligned(form)}}" for name, form in self._columns.items())
            table = ("-" * _WIDTH, " ".join(headings).rstrip()) if self._columns else ()
            lines = [f"{name:<{_LABEL}}{value}" for name, value in facts.items()]
            _print("=" * _WIDTH, self._title.center(_WIDTH).rstrip(), "=" * _WIDTH, *lines, *table)

    def line(self, *values: object) -> None:
        """One more line of the table, a value for each column; None leaves it empty."""
        cells = [
            " " * int(_aligned(form)[1:]) if value is None else f"{value:{form}}"
            for value, form in zip(values, self._columns.values(), strict=True)
        ]
        LOGGER.debug("%s: %s", self._title, " ".join(" ".join(cells).split()))
        if self._shown:
            _print(" ".join(cells).rstrip())

    def report(self, progress: Progress) -> None:
        """A line for an iteration, for what takes long, or for the method that begins."""
        entry = progress.iteration
        if progress.stage:
            if self._shown:
                _print(f"{progress.method}: {progress.stage}")
        elif entry is None:
            words = f"{progress.method} begins" + (f": {progress.remark}" if progress.remark else "")
            LOGGER.debug("%s: %s", self._title, words)
            if self._shown and progress.remark:
                _print(words)
        elif _worth_a_line(entry.number):
            numbers = (entry.number, entry.residual, entry.energy, entry.normal_resultant)
            self.line(progress.method, *numbers, self.seconds)

    def end(self, status: str, message: str, seconds: Mapping[str, float], solved: bool) -> None:
        """How it ended, after how many seconds for what, and for everything."""
        level = logging.WARNING if self._outermost and not solved else self._level
        times = {**seconds, "total": self.seconds}
        words = ", ".join(f"{name} {value:.3f} s" for name, value in times.items())
        LOGGER.log(level, "%s: %s (%s)", self._title, message, words)
        if self._shown:
            sentence = wrap(message, _WIDTH)
            _print("-" * _WIDTH, f"{'status':<{_LABEL}}{status}", *sentence, f"{'time':<{_LABEL}}{words}", "=" * _WIDTH)


@contextmanager
def narrated(
    title: str, verbose: bool, columns: Mapping[str, str] = ITERATIONS, *, iterations: bool = True
) -> Iterator[Narration]:
    """A narration of what is inside; with `iterations`, of the iterations that methods tell of."""
    verbose = true_or_false("verbose", verbose)
    depth = _depth.get()
    story = Narration(title, verbose and depth == 0, columns, depth == 0)
    heard = iterations and depth == 0 and (verbose or LOGGER.isEnabledFor(logging.DEBUG))
    token = _depth.set(depth + 1)
    try:
        with watched(report=story.report if heard else None):
            yield story
    finally:
        _depth.reset(token)


def _worth_a_line(number: int) -> bool:
    """The first twenty, then those with two digits: 100, 110, …, 1000, 1100."""
    return number <= _ALL or number % 10 ** max(0, len(str(number)) - 2) == 0


def _aligned(form: str) -> str:
    """Alignment and width of a format."""
    return form.partition(".")[0].rstrip(ascii_letters)


def _print(*lines: str) -> None:
    for line in lines:
        print(line, flush=True)
