"""How the project's command lines behave: one-line errors, and on standard error how far a solve under way is."""

import atexit
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from time import monotonic
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, NoReturn, TextIO, TypeAlias, cast

import click

from qvi_contact.errors import RETIRED, InputError, QVIError
from solvers.basics.foreign import lead_nowhere

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bar

    from solvers.basics.progress import Progress

_TERMINATED: Final = 143  # exit status after SIGTERM, as shells tell it: 128 and the number of the signal
_OFTEN_ENOUGH: Final = 100_000  # new objects between two collections of garbage
_PATIENCE = 2.0  # seconds of silence
_OFF_TERMINALS = 30.0  # where there is no terminal; then twice as many, and so on
_REDRAWN = 0.1  # seconds


Advance: TypeAlias = Callable[..., None]
"""Reports that one more step is done, or so many in all, and says in words, if there are any, how far all is."""


class TerminatedError(SystemExit):
    """The process was told to end, by SIGTERM; like any exit nobody takes it for a failure of what was done."""


class Command(click.Command):
    """A command whose input errors name the option that was typed, such as --time-limit, not the Python argument."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run it."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            typed = ctx.get_parameter_source(error.field) is click.core.ParameterSource.COMMANDLINE
            options = [
                each.opts[-1] for each in self.params if each.name == error.field and isinstance(each, click.Option)
            ]
            if not (typed and options):
                raise
            raise type(error)(options[0], error.value, error.remedy) from error


class Group(click.Group):
    """Commands of this kind."""

    command_class = Command


def run(command: click.Command, name: str) -> None:
    """Run a command and exit.

    Anything wrong with the input, and a standard output that cannot be written, is one line on standard error and exit
    status 2; too little memory is one line and status 1. A reader that has gone away, as in ``… | head -1``, is no
    fault: the command ends in silence. What libraries print when the process ends does not reach standard output. At
    SIGTERM a command leaves as at an interrupt from the keyboard: its temporary files and worker processes go, and the
    exit status is 143.
    """
    gc.set_threshold(_OFTEN_ENOUGH)  # loading libraries makes many objects, but no garbage
    atexit.register(gc.freeze)  # nor is there any to be collected when the process ends: both take a quarter of a solve
    for each in (sys.stdout, sys.stderr):
        if isinstance(each, io.TextIOWrapper):  # terminals that cannot show a letter show a question mark
            each.reconfigure(errors="replace")
    stream, errors = sys.stdout, sys.stderr
    output = _Output(stream)
    if stream is not None:  # None where the shell has closed it
        sys.stdout = cast("TextIO", output)
    if errors is not None:
        sys.stderr = cast("TextIO", _Errors(errors))
    try:
        with _leaving_at_sigterm():
            status = _status(command, name)
            if stream is not None:
                output.flush()
    except OSError as error:
        if error is not output.error:
            raise
        status = 1  # as click has it if nobody reads it
        if not isinstance(error, BrokenPipeError):
            status = _complain(name, f"standard output: cannot be written ({error.strerror or error})")
    finally:
        sys.stdout, sys.stderr = stream, errors
        if output.error is not None:
            output.give_up()
    atexit.register(lead_nowhere)
    sys.exit(status)


def _status(command: click.Command, name: str) -> int:
    """Run a command; its exit status."""
    try:
        return int(command.main(prog_name=name, standalone_mode=False) or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        _say(error.format_message())
        return 2
    except click.NoSuchOption as error:
        remedy = RETIRED.get(error.option_name.lstrip("-").replace("-", "_"))
        return _complain(name, f"{error.option_name} {remedy}" if remedy else error.format_message())
    except click.ClickException as error:
        return _complain(name, error.format_message())
    except QVIError as error:
        return _complain(name, str(error))
    except MemoryError as error:
        _complain(name, f"out of memory ({str(error) or 'no details'}): take a coarser mesh or a lower degree")
        return 1
    except (click.Abort, KeyboardInterrupt):
        _say(f"{name}: interrupted")
        return 130
    except TerminatedError:
        _say(f"{name}: terminated")
        return _TERMINATED


@contextmanager
def _leaving_at_sigterm() -> Iterator[None]:
    """Leave every block in order at the first SIGTERM, and at once at the second.

    A handler that is there already stays, as does that of a process whose commands run in other threads.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return

    def leave(_number: int, _frame: FrameType | None) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        raise TerminatedError(_TERMINATED)

    signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


class _Output:
    """Standard output that remembers why it could not be written, so that no other failure is taken for that one."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        with self._remembering():
            return self._stream.write(text)

    def flush(self) -> None:
        with self._remembering():
            self._stream.flush()

    @contextmanager
    def _remembering(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.error = error
            raise

    def give_up(self) -> None:
        """Let what is left in its buffer go nowhere when the interpreter ends, which would complain about it."""
        with suppress(OSError, ValueError):  # a stream without a file
            number, nowhere = self._stream.fileno(), os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, number)
            os.close(nowhere)


class _Errors(_Output):
    """Standard error that goes nowhere once it cannot be written. At a broken pipe Rich would end standard output."""

    @contextmanager
    def _remembering(self) -> Iterator[None]:
        try:
            yield
        except OSError:
            self.give_up()


def _complain(name: str, message: str) -> int:
    """Say in one line what is wrong; the exit status."""
    _say(f"{name}: {' '.join(message.split())}")
    return 2


def _say(line: str) -> None:
    with suppress(OSError):  # there is no place left to complain at
        click.echo(line, err=True)


def error_console() -> "Console":
    """A console on standard error."""
    from rich.console import Console

    return Console(stderr=True)


@contextmanager
def solving(title: str, steps: int = 1, *, verbose: bool = False, silence: float = _OFF_TERMINALS) -> Iterator[Advance]:
    """Show on standard error how far the solves inside are, once they take two seconds; of several steps with a bar.

    With `verbose` no line is shown, and what the solves inside print goes there too: standard output is for answers.
    A line that stays says when one method takes the place of another one. Where that is not a terminal there are plain
    lines: one before each large factorisation, and how far all is after so many seconds of `silence`, and then after
    twice as many, and so on. The function yielded says that a step is done, or how many, and may say how far all is.
    """
    if verbose:
        with redirect_stdout(sys.stderr):
            yield lambda *_: None
        return
    from solvers.basics.progress import listening  # with NumPy, which a line of help does without

    line = _Line(title, steps)
    thread = threading.Thread(target=line.show, args=(silence,), daemon=True)
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
        self.ended = threading.Event()

    def report(self, progress: "Progress") -> None:
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

    def advance(self, description: str = "", done: int | None = None) -> None:
        """One more step is done, or so many in all."""
        self._done, self._so_far, self._state = self._done + 1 if done is None else done, description, ""

    def show(self, silence: float) -> None:
        """Draw the line on a terminal, and elsewhere say now and then how far all is."""
        patience = min(_PATIENCE, silence)
        if self.ended.wait(patience):
            return
        if error_console().is_terminal:
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
        with Bar(*columns, console=error_console(), transient=True) as self._bar:
            task = self._bar.add_task(self._title, total=self._steps, state=self._text)
            over = False
            while not over:
                over = self.ended.wait(_REDRAWN)
                self._bar.update(task, completed=self._done, state=self._text)

    def _say(self, words: str, *, on_terminals: bool) -> None:
        """A line that stays, if standard error is a terminal or is none."""
        console = error_console() if self._bar is None else self._bar.console
        if console.is_terminal is on_terminals:
            console.print(f"{self._title}: {words}", markup=False, highlight=False, soft_wrap=True)

    @property
    def _text(self) -> str:
        state = "; ".join(filter(None, [self._so_far, self._state])) or "setting up"
        return f"{state}; {monotonic() - self._began:.0f} s"
