"""What a command says of a solve under way: one line on standard error with method, iteration, residual and time."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING

from qvi_contact.basics import terminal
from qvi_contact.basics.terminal import Advance
from solvers.basics.progress import Progress, listening

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_PATIENCE = 2.0  # seconds of silence
_OFF_TERMINALS = 30.0  # where there is no terminal; then twice as many, and so on
_REDRAWN = 0.1  # seconds


@contextmanager
def solving(title: str, steps: int = 1, *, verbose: bool = False, silence: float = _OFF_TERMINALS) -> Iterator[Advance]:
    """Show on standard error how far the solves inside are, once they take two seconds; of several steps with a bar.

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
        thread.join(_PATIENCE)  # nobody may read standard error


class _Line:
    """The line, which a thread of its own shows until all has ended."""

    def __init__(self, title: str, steps: int) -> None:
        self._title, self._steps, self._done = title, steps, 0
        self._so_far = self._state = ""
        self._bar: Bar | None = None
        self._began = monotonic()
        self.ended = Event()

    def report(self, progress: Progress) -> None:
        """What a solve says: method, iteration, residual."""
        entry = progress.iteration
        what = progress.stage or "setting up"
        if entry is not None and not progress.stage:
            what = f"iteration {entry.number}, residual {entry.residual:.1e}"
        self._state = f"{progress.method}: {what}"
        if progress.stage:
            self._say(self._state, on_terminals=False)
        if progress.remark:
            self._say(f"{progress.remark}; next method: {progress.method}", on_terminals=True)

    def advance(self, description: str = "") -> None:
        """One more step is done."""
        self._done, self._so_far, self._state = self._done + 1, description, ""

    def show(self, silence: float) -> None:
        """Draw the line on a terminal, and elsewhere say now and then how far all is."""
        patience = min(_PATIENCE, silence)
        if self.ended.wait(patience):
            return
        if terminal.error_console().is_terminal:
            self._draw()
        wait = silence - patience
        while not self.ended.wait(wait):
            self._say(self._text, on_terminals=False)
            silence = wait = 2.0 * silence

    def _draw(self) -> None:
        """Rich's own line, with a bar where there are several steps."""
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
        from rich.progress import Progress as Bar

        title, state = (TextColumn(f"{{task.{name}}}", markup=False) for name in ("description", "fields[state]"))
        columns = (title, *((BarColumn(), MofNCompleteColumn()) if self._steps > 1 else ()), state)
        with Bar(*columns, console=terminal.error_console(), transient=True) as self._bar:
            task = self._bar.add_task(self._title, total=self._steps, state=self._text)
            over = False
            while not over:
                over = self.ended.wait(_REDRAWN)
                self._bar.update(task, completed=self._done, state=self._text)

    def _say(self, words: str, *, on_terminals: bool) -> None:
        """A line that stays, if standard error is a terminal or is none."""
        console = terminal.error_console() if self._bar is None else self._bar.console
        if console.is_terminal is on_terminals:
            console.print(f"{self._title}: {words}", markup=False, highlight=False, soft_wrap=True)

    @property
    def _text(self) -> str:
        state = "; ".join(filter(None, [self._so_far, self._state])) or "setting up"
        return f"{state}; {monotonic() - self._began:.0f} s"
