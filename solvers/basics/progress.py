"""Time limit, progress reports and log of a solve.

    with deadline(60.0), listening(print):
        …                                         # retries, fall-backs, inner problems, feasibility: one clock for all

Methods check `deadline.over` in every iteration, and back ends get the seconds `deadline.left` as their limit. Other
work, such as a factorisation, is not interrupted. Of nested deadlines the earliest end counts; nested listeners all
receive all reports.
"""

import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from string import ascii_letters
from textwrap import wrap
from time import perf_counter
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self, TypeAlias

from solvers.basics.checks import positive_number, true_or_false

if TYPE_CHECKING:
    from solvers.solution import Iteration


_LEAST_SECONDS: Final = 1e-3  # some back ends take 0 for no limit


class Progress(NamedTuple):
    """A report: a method begins, has done an iteration, or starts other long work."""

    method: str
    """The method, or the back end that does the other work."""
    iteration: "Iteration | None" = None
    """The iteration; None when the method begins."""
    remark: str = ""
    """Why the method begins, if another one has failed before."""
    stage: str = ""
    """Other long work, such as a large factorisation, in words."""


Listener: TypeAlias = Callable[[Progress], object]

_end: ContextVar[float] = ContextVar("end", default=math.inf)  # a time of `time.monotonic`
_listeners: ContextVar[tuple[Listener, ...]] = ContextVar("listeners", default=())


class Deadline:
    """The time limit of the current context: ``with deadline(seconds):`` sets it, `left` and `over` read it."""

    @contextmanager
    def __call__(self, seconds: float | None = None) -> Iterator[None]:
        """Set the time limit of the code inside, which ends if it can be interrupted; None sets no limit.

        `InputError`, for the field "time_limit", unless `seconds` is a finite number above 0.
        """
        outer = _end.get()
        token = _end.set(min(outer, time.monotonic() + checked_limit(seconds)))
        try:
            yield
        finally:
            _end.reset(token)

    @property
    def left(self) -> float:
        """Seconds left, infinity without a limit; at least 0.001, as some back ends take 0 for no limit."""
        end = _end.get()
        return max(end - time.monotonic(), _LEAST_SECONDS) if end < math.inf else math.inf

    @property
    def over(self) -> bool:
        """Whether the time limit is reached."""
        end = _end.get()
        return end < math.inf and time.monotonic() >= end


deadline: Final = Deadline()
"""The only instance; its limit is a context variable."""


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Call the listener with all reports of the code inside."""
    token = _listeners.set((*_listeners.get(), listener))
    try:
        yield
    finally:
        _listeners.reset(token)


def report(progress: Progress) -> None:
    """Call all listeners."""
    for listener in _listeners.get():
        listener(progress)


def checked_limit(value: object) -> float:
    """Seconds of a time limit, infinity for None; `InputError` unless it is a finite number above 0."""
    return math.inf if value is None else positive_number("time_limit", value)


# The log of a solve: printed with ``verbose=True``, and written to the logger "qvi_contact".
#
#     with Log("solve", verbose) as log:
#         log.begin({"unknowns": 768, "method": "condensed"})
#         …                                          # a line for each iteration that methods `report`
#         log.end(status, message, {"solve": 0.1})
#
# Levels of the logger: INFO for the begin and end of the outermost call, WARNING if it ends without a solution, DEBUG
# for its iterations and the calls inside it.

LOGGER: Final = logging.getLogger("qvi_contact")
"""The logger of all packages of the project; silent unless the program adds a handler."""
LOGGER.addHandler(logging.NullHandler())

ITERATIONS: Final = {
    "method": "<12", "iteration": ">9", "residual": ">10.2e", "energy": ">15.7e", "normal force": ">14.6e",
    "seconds": ">9.2f",
}  # fmt: skip
"""Columns of the table of iterations, with their formats; dimensionless, as in `Iteration`."""

_WIDTH: Final = 79
_LABEL: Final = 16

_depth: ContextVar[int] = ContextVar("depth", default=0)


class Log:
    """A header, a table, and a footer with status and times, logged, and printed if `verbose`.

    Inside another log nothing is printed. `title` names the function, `columns` has the headings of the table with the
    formats of their numbers. With `iterations` the iterations that methods `report` become lines of the table.
    """

    def __init__(
        self, title: str, verbose: bool, columns: Mapping[str, str] = ITERATIONS, *, iterations: bool = True
    ) -> None:
        self._title, self._columns, self._iterations = title, columns, iterations
        self._shown = true_or_false("verbose", verbose)
        self._tokens: Any = ()

    def __enter__(self) -> Self:
        depth, listeners = _depth.get(), _listeners.get()
        self._outermost, self._level = depth == 0, logging.DEBUG if depth else logging.INFO
        self._shown = self._shown and self._outermost
        if self._iterations and self._outermost and (self._shown or LOGGER.isEnabledFor(logging.DEBUG)):
            listeners = (*listeners, self.report)
        self._tokens = _depth.set(depth + 1), _listeners.set(listeners)
        self._began = perf_counter()
        return self

    def __exit__(self, *_: object) -> None:
        _depth.reset(self._tokens[0])
        _listeners.reset(self._tokens[1])

    @property
    def seconds(self) -> float:
        """Seconds since the log began."""
        return perf_counter() - self._began

    def begin(self, facts: Mapping[str, object]) -> None:
        """Write the header: facts of the problem and of the method, by name."""
        if LOGGER.isEnabledFor(self._level):
            words = ", ".join(f"{name} {value}" for name, value in facts.items())
            LOGGER.log(self._level, "%s: %s", self._title, words)
        if self._shown:
            headings = (f"{name:{_aligned(form)}}" for name, form in self._columns.items())
            table = ("-" * _WIDTH, " ".join(headings).rstrip()) if self._columns else ()
            lines = [f"{name:<{_LABEL}}{value}" for name, value in facts.items()]
            _print("=" * _WIDTH, self._title.center(_WIDTH).rstrip(), "=" * _WIDTH, *lines, *table)

    def line(self, *values: object) -> None:
        """Write a line of the table, with a value for each column; None leaves a column empty."""
        if not self._shown and not LOGGER.isEnabledFor(logging.DEBUG):
            return
        cells = [
            " " * int(_aligned(form)[1:]) if value is None else f"{value:{form}}"
            for value, form in zip(values, self._columns.values(), strict=True)
        ]
        LOGGER.debug("%s: %s", self._title, " ".join(" ".join(cells).split()))
        if self._shown:
            _print(" ".join(cells).rstrip())

    def report(self, progress: Progress) -> None:
        """Write the line of a progress report."""
        entry = progress.iteration
        if progress.stage:
            if self._shown:
                _print(f"{progress.method}: {progress.stage}")
        elif entry is None:
            words = f"{progress.method} begins" + (f": {progress.remark}" if progress.remark else "")
            LOGGER.debug("%s: %s", self._title, words)
            if self._shown and progress.remark:
                _print(words)
        elif entry.number % 10 ** max(0, len(str(entry.number)) - 2) == 0:  # 1, 2, …, 99, 100, 110, …, 1000, 1100
            numbers = (entry.number, entry.residual, entry.energy, entry.normal_resultant)
            self.line(progress.method, *numbers, self.seconds)

    def end(self, status: str, message: str, seconds: Mapping[str, float], solved: bool) -> None:
        """Write the footer: status, message, and `seconds` by name, with their total."""
        level = logging.WARNING if self._outermost and not solved else self._level
        if not self._shown and not LOGGER.isEnabledFor(level):
            return
        times = {**seconds, "total": self.seconds}
        words = ", ".join(f"{name} {value:.3f} s" for name, value in times.items())
        LOGGER.log(level, "%s: %s (%s)", self._title, message, words)
        if self._shown:
            sentence = wrap(message, _WIDTH)
            _print("-" * _WIDTH, f"{'status':<{_LABEL}}{status}", *sentence, f"{'time':<{_LABEL}}{words}", "=" * _WIDTH)


def _aligned(form: str) -> str:
    """Alignment and width of a format."""
    return form.partition(".")[0].rstrip(ascii_letters)


def _print(*lines: str) -> None:
    for line in lines:
        print(line, flush=True)
