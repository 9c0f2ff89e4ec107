"""What all command lines share: errors in one line, and the progress of a solve on standard error."""

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

from qvi_contact.errors import InputError, QVIError
from solvers.basics.foreign import lead_nowhere

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress as Bar

    from solvers.basics.progress import Progress

_TERMINATED: Final = 143  # exit status after SIGTERM, as in shells: 128 + the number of the signal
_COLLECTION_THRESHOLD: Final = 100_000  # new objects between two collections of garbage
_PATIENCE = 2.0  # seconds before the first output
_FIRST_AFTER = 30.0  # seconds, if standard error is no terminal; the interval doubles with each line
_REDRAW_INTERVAL = 0.1  # seconds


Advance: TypeAlias = Callable[..., None]
"""Function (description, done) that reports one more step, or the number `done` of all steps that are finished."""


class TerminatedError(SystemExit):
    """The process received SIGTERM; as a `SystemExit` it is not caught as a failure of the work."""


class Command(click.Command):
    """A command whose input errors name the option of the command line, such as --time-limit, not the argument."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except InputError as error:
            is_typed = ctx.get_parameter_source(error.field) is click.core.ParameterSource.COMMANDLINE
            options = [
                each.opts[-1] for each in self.params if each.name == error.field and isinstance(each, click.Option)
            ]
            if not (is_typed and options):
                raise
            raise type(error)(options[0], error.value, error.remedy) from error


class Group(click.Group):
    """A group of `Command`s."""

    command_class = Command


def run(command: click.Command, name: str) -> None:
    """Run a command and exit.

    A wrong input, or a standard output that cannot be written, gives one line on standard error and exit status 2; too
    little memory, or another error of the project, gives one line and status 1. A closed pipe, as in ``… | head -1``,
    is no error: the command ends silently. Output of libraries at the end of the process does not reach standard
    output. SIGTERM acts as an interrupt from the keyboard: temporary files and worker processes are removed, and the
    exit status is 143.
    """
    gc.set_threshold(_COLLECTION_THRESHOLD)  # new objects between two collections: loading libraries makes no garbage
    atexit.register(gc.freeze)  # no collection at the end either: together they took a quarter of a solve's time
    for each in (sys.stdout, sys.stderr):
        if isinstance(each, io.TextIOWrapper):  # unknown letters become question marks
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
        status = 1  # click's status for a closed pipe
        if not isinstance(error, BrokenPipeError):
            status = _complain(name, f"standard output: cannot be written ({error.strerror or error})")
    finally:
        sys.stdout, sys.stderr = stream, errors
        if output.error is not None:
            output.give_up()
    atexit.register(lead_nowhere)
    sys.exit(status)


def _status(command: click.Command, name: str) -> int:
    """Run a command and return its exit status."""
    try:
        return int(command.main(prog_name=name, standalone_mode=False) or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        _say(error.format_message())
        return 2
    except click.ClickException as error:
        return _complain(name, error.format_message())
    except QVIError as error:
        return _complain(name, str(error), 2 if isinstance(error, InputError) else 1)  # 1: no answer was found
    except MemoryError as error:
        reason = str(error) or "no details"
        return _complain(name, f"out of memory ({reason}): take a coarser mesh or a lower degree", 1)
    except (click.Abort, KeyboardInterrupt):
        return _complain(name, "interrupted", 130)
    except TerminatedError:
        return _complain(name, "terminated", _TERMINATED)


@contextmanager
def _leaving_at_sigterm() -> Iterator[None]:
    """The first SIGTERM raises `TerminatedError`, so that every block is left in order; the second ends the process."""

    def leave(_number: int, _frame: FrameType | None) -> NoReturn:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        raise TerminatedError(_TERMINATED)

    signal.signal(signal.SIGTERM, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


class _Output:
    """Standard output that keeps the error of a failed write, which tells it from other errors."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> Any:
        return self._tried(self._stream.write, text)

    def flush(self) -> None:
        self._tried(self._stream.flush)

    def _tried(self, method: Callable[..., Any], *arguments: str) -> Any:
        try:
            return method(*arguments)
        except OSError as error:
            self.error = error
            raise

    def give_up(self) -> None:
        """Send the rest of the buffer to the null device, as writing it at exit would fail with a message."""
        with suppress(OSError, ValueError):  # a stream without a file
            number, nowhere = self._stream.fileno(), os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, number)
            os.close(nowhere)


class _Errors(_Output):
    """Standard error that goes to the null device after a failed write; at a broken pipe Rich would end the output."""

    def _tried(self, method: Callable[..., Any], *arguments: str) -> Any:
        try:
            return method(*arguments)
        except OSError:
            self.give_up()


def _complain(name: str, message: str, status: int = 2) -> int:
    """Print an error in one line, and return the exit status."""
    _say(f"{name}: {' '.join(message.split())}")
    return status


def _say(line: str) -> None:
    with suppress(OSError):  # standard error cannot be written either
        click.echo(line, err=True)


def error_console() -> "Console":
    """A console on standard error."""
    from rich.console import Console

    return Console(stderr=True)


@contextmanager
def solving(title: str, steps: int = 1, *, verbose: bool = False, silence: float = _FIRST_AFTER) -> Iterator[Advance]:
    """Show the progress of the solves in the block on standard error after two seconds; with a bar for several steps.

    On a terminal one line is redrawn; a permanent line reports a change of the method. Otherwise there are plain lines:
    one before each large factorisation, and one after `silence` seconds, after twice as many, and so on. With `verbose`
    no progress is shown, and the output of the solves goes to standard error, as standard output is for answers. The
    function yielded reports that a step is done, or the number of all steps done, with a description.
    """
    if verbose:
        with redirect_stdout(sys.stderr):
            yield lambda *_: None
        return
    from solvers.basics.progress import listening  # loads NumPy, which --help does not need

    line = _Line(title, steps)
    thread = threading.Thread(target=line.show, args=(silence,), daemon=True)
    thread.start()
    try:
        with listening(line.report):
            yield line.advance
    finally:
        line.ended.set()
        thread.join(_PATIENCE)  # it may block if standard error is not read


class _Line:
    """The line of progress, which another thread shows until the block ends."""

    def __init__(self, title: str, steps: int) -> None:
        self._title, self._steps, self._done = title, steps, 0
        self._so_far = self._state = ""
        self._bar: Bar | None = None
        self._began = monotonic()
        self.ended = threading.Event()

    def report(self, progress: "Progress") -> None:
        """Take the progress of a solve: method, stage or iteration, residual."""
        iteration = progress.iteration
        stage = progress.stage or "setting up"
        if iteration is not None and not progress.stage:
            stage = f"iteration {iteration.number}, residual {iteration.residual:.1e}"
        self._state = f"{progress.method}: {stage}"
        if progress.stage:
            self._say(self._state, on_terminals=False)
        if progress.remark:
            self._say(f"{progress.remark}; next method: {progress.method}", on_terminals=True)

    def advance(self, description: str = "", done: int | None = None) -> None:
        """Count one more step as done, or set the number of all steps done."""
        self._done, self._so_far, self._state = self._done + 1 if done is None else done, description, ""

    def show(self, silence: float) -> None:
        """Draw the line on a terminal; otherwise print the progress at growing intervals."""
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
        """Rich's line of progress, with a bar for several steps."""
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
        from rich.progress import Progress as Bar

        title, state = (TextColumn(f"{{task.{name}}}", markup=False) for name in ("description", "fields[state]"))
        columns = (title, *((BarColumn(), MofNCompleteColumn()) if self._steps > 1 else ()), state)
        with Bar(*columns, console=error_console(), transient=True) as self._bar:
            task = self._bar.add_task(self._title, total=self._steps, state=self._text)
            is_over = False
            while not is_over:
                is_over = self.ended.wait(_REDRAW_INTERVAL)
                self._bar.update(task, completed=self._done, state=self._text)

    def _say(self, words: str, *, on_terminals: bool) -> None:
        """Print a permanent line if standard error is a terminal, or if it is none, as `on_terminals` demands."""
        console = error_console() if self._bar is None else self._bar.console
        if console.is_terminal is on_terminals:
            console.print(f"{self._title}: {words}", markup=False, highlight=False, soft_wrap=True)

    @property
    def _text(self) -> str:
        state = "; ".join(filter(None, [self._so_far, self._state])) or "setting up"
        return f"{state}; {monotonic() - self._began:.0f} s"
