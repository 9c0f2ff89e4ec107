"""What a command says of a solve under way: one line on standard error with method, iteration, residual and time."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from threading import Event, Lock, Thread, Timer
from time import monotonic
from typing import TYPE_CHECKING

from qvi_contact.basics import terminal
from qvi_contact.basics.terminal import Advance
from solvers.basics.progress import Progress, listening

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_PATIENCE = 2.0  # seconds of silence
_OFF_TERMINALS = 30.0  # where there is no terminal; then twice as many, and so on


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
    timer = Timer(_PATIENCE, line.show)
    timer.daemon = True
    timer.start()
    Thread(target=line.speak, args=(silence,), daemon=True).start()
    try:
        with listening(line.report):
            yield line.advance
    finally:
        timer.cancel()
        line.close()


class _Line:
    """The line, shown by the thread of the timer."""

    def __init__(self, title: str, steps: int) -> None:
        self._title, self._steps, self._done, self._state = title, steps, 0, ""
        self._so_far = ""
        self._lock = Lock()
        self._bar: Bar | None = None
        self._ended = Event()
        self._began = monotonic()

    def report(self, progress: Progress) -> None:
        """What a solve says: method, iteration, residual."""
        entry = progress.iteration
        what = progress.stage or "setting up"
        if entry is not None and not progress.stage:
            what = f"iteration {entry.number}, residual {entry.residual:.1e}"
        self._state = f"{progress.method}: {what}"
        self._update()
        if progress.stage:
            self._say(self._state)
        if progress.remark:
            console = terminal.error_console() if self._bar is None else self._bar.console
            said = f"{self._title}: {progress.remark}; next method: {progress.method}"
            if console.is_terminal:
                console.print(said, markup=False, highlight=False)

    def advance(self, description: str = "") -> None:
        """One more step is done."""
        self._done, self._so_far, self._state = self._done + 1, description, ""
        self._update()

    def show(self) -> None:
        """Begin: Rich's own line, with a bar where there are several steps."""
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        console = terminal.error_console()
        if not console.is_terminal:
            return
        title, state = (TextColumn(f"{{task.{name}}}", markup=False) for name in ("description", "fields[state]"))
        columns = (title, *((BarColumn(), MofNCompleteColumn()) if self._steps > 1 else ()), state, TimeElapsedColumn())
        with self._lock:
            if not self._ended.is_set():
                self._bar = Bar(*columns, console=console, transient=True)
                task = self._bar.add_task(self._title, total=self._steps, completed=self._done, state=self._text)
                self._bar.tasks[task].start_time = self._bar.get_time() - _PATIENCE
                self._bar.start()

    def speak(self, pause: float) -> None:
        """Say how far all is where there is no terminal, until the end."""
        while not self._ended.wait(pause):
            self._say(f"{self._text or 'setting up'}; {monotonic() - self._began:.0f} s")
            pause *= 2.0

    def _say(self, words: str) -> None:
        """A plain line, unless a terminal shows the same."""
        console = terminal.error_console()
        if not console.is_terminal:
            console.print(f"{self._title}: {words}", markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """End."""
        with self._lock:
            self._ended.set()
            if self._bar is not None:
                self._bar.stop()

    def _update(self) -> None:
        with self._lock:
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], completed=self._done, state=self._text)

    @property
    def _text(self) -> str:
        return "; ".join(filter(None, [self._so_far, self._state]))
