"""What a command says of a solve under way: one line on standard error with method, iteration, residual and time."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from shutil import get_terminal_size
from threading import Event, Thread
from time import monotonic

from qvi_contact.basics.terminal import Advance
from solvers.basics.progress import Progress, listening

_PATIENCE = 2.0  # seconds of silence on a terminal
_AGAIN = 0.2  # seconds until the line there is written anew
_OFF_TERMINALS = 30.0  # where there is no terminal; then twice as many, and so on


@contextmanager
def solving(title: str, steps: int = 1, *, verbose: bool = False, silence: float = _OFF_TERMINALS) -> Iterator[Advance]:
    """Show on standard error how far the solves inside are, once they take two seconds; of several steps how many.

    With `verbose` no line is shown, and what the solves inside print goes there too: standard output is for answers.

    A line that stays says when one method takes the place of another one. Where that is not a terminal there are plain
    lines: one before each large factorisation, and how far all is after so many seconds of `silence`, and then after
    twice as many, and so on.
    The function yielded reports that a step is done, and may say how far all is: that is shown before the rest.
    """
    if verbose:
        with redirect_stdout(sys.stderr):
            yield lambda _="": None
        return
    line = _Line(title, steps)
    thread = Thread(target=line.show, args=(silence,), daemon=True)
    thread.start()
    try:
        with listening(line.report):
            yield line.advance
    finally:
        line.ended.set()
        thread.join()


class _Line:
    """The line: solves say what they do, a thread of its own shows it."""

    def __init__(self, title: str, steps: int) -> None:
        self._title, self._steps, self._done, self._so_far, self._state = title, steps, 0, "", ""
        self._stream, self._began, self.ended = sys.stderr, monotonic(), Event()
        self._terminal = self._stream is not None and self._stream.isatty()

    def report(self, progress: Progress) -> None:
        """What a solve says: method, iteration, residual."""
        entry = progress.iteration
        what = progress.stage or "setting up"
        if entry is not None and not progress.stage:
            what = f"iteration {entry.number}, residual {entry.residual:.1e}"
        self._state = f"{progress.method}: {what}"
        if progress.stage and not self._terminal:
            self._write(f"{self._title}: {self._state}", "\n")
        if progress.remark and self._terminal:
            self._write(f"{self._title}: {progress.remark}; next method: {progress.method}", "\n")

    def advance(self, description: str = "") -> None:
        """One more step is done."""
        self._done, self._so_far, self._state = self._done + 1, description, ""

    def show(self, silence: float) -> None:
        """Say how far all is, until the end: over and over in one line of a terminal, else now and then."""
        pause = min(silence, _PATIENCE) if self._terminal else silence
        shown = False
        while not self.ended.wait(pause):
            text = "; ".join(filter(None, [self._so_far, self._state])) or "setting up"
            text = f"{text}; {monotonic() - self._began:.0f} s"
            count = f"{self._done}/{self._steps}: " if self._terminal and self._steps > 1 else ""
            self._write(f"{self._title}: {count}{text}", "" if self._terminal else "\n")
            shown, pause = True, _AGAIN if self._terminal else 2.0 * pause
        if shown and self._terminal:
            self._write("", "\r")

    def _write(self, words: str, end: str) -> None:
        """In one go; on a terminal over the line that is there, and without an end in no more than one line."""
        if self._terminal:
            width = get_terminal_size().columns - 1
            words = "\r" + (words if end == "\n" else words[:width]).ljust(width)
        with suppress(OSError, ValueError):  # nobody listens any more
            self._stream.write(words + end)
            self._stream.flush()
