"""How the project's command lines behave: one-line errors, a console on standard error."""

import atexit
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import TYPE_CHECKING, Any, Final, NoReturn, Protocol, TextIO, cast

import click

from qvi_contact.errors import RETIRED, InputError, QVIError
from solvers.basics.foreign import lead_nowhere

if TYPE_CHECKING:
    from rich.console import Console


_TERMINATED: Final = 143
"""Exit status after SIGTERM, as shells tell it: 128 and the number of the signal."""

_OFTEN_ENOUGH: Final = 100_000
"""New objects between two collections of garbage."""


class Advance(Protocol):
    """Reports that one more step is done, and what comes next."""

    def __call__(self, description: str = "") -> None: ...  # noqa: D102


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
    status 2. A reader that has gone away, as in ``… | head -1``, is no fault: the command ends in silence. What
    libraries print when the process ends does not reach standard output. At SIGTERM a command leaves as at an interrupt
    from the keyboard: its temporary files and worker processes go, and the exit status is 143.
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
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
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
