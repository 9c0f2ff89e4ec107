"""How the project's command lines behave: one-line errors, progress on standard error."""

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import click

from qvi_contact.errors import QVIError

if TYPE_CHECKING:
    from rich.console import Console


class Advance(Protocol):
    """Reports that one more step is done, and what comes next."""

    def __call__(self, description: str = "") -> None: ...  # noqa: D102


def run(command: click.Command, name: str) -> None:
    """Run a command; anything wrong with the input is one line on standard error and exit status 2."""
    _accept_any_character()
    try:
        sys.exit(command.main(prog_name=name, standalone_mode=False) or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        sys.exit(2)
    except click.ClickException as error:
        _complain(name, error.format_message())
    except QVIError as error:
        _complain(name, str(error))
    except (click.Abort, KeyboardInterrupt):
        click.echo(f"{name}: interrupted", err=True)
        sys.exit(130)


def _accept_any_character() -> None:
    """Let terminals that cannot show a letter show a question mark."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def _complain(name: str, message: str) -> None:
    click.echo(f"{name}: {' '.join(message.split())}", err=True)
    sys.exit(2)


@contextmanager
def progress(title: str, steps: int) -> Iterator[Advance]:
    """A progress bar on standard error, silent when that is not a terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = error_console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=steps)

        def advance(description: str = "") -> None:
            bar.update(task, advance=1, description=f"{title}: {description}" if description else title)

        yield advance


def error_console() -> "Console":
    """A console on standard error."""
    from rich.console import Console

    return Console(stderr=True)
