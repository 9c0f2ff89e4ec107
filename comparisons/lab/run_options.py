"""The options of every command that runs a study, and how such a command ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from click.core import ParameterSource

from comparisons.lab.options import COUNT, FiniteRange
from qvi_contact.basics.writing import writable_folder
from qvi_contact.errors import InputError

if TYPE_CHECKING:  # help comes at once: what runs studies is loaded by those who do
    from comparisons.lab.study import Study, StudyRun

_MOST_MEMORY: Final = 2**40  # MiB, whose bytes the system can still count


@dataclass(frozen=True)
class RunOptions:
    """What `study_options` hands to its command; the attributes are the parameters of `run_study`."""

    store: Path
    workers: int
    dask: str | None
    timeout: float | None
    memory: int | None
    threads: int

    def inside(self, name: str) -> RunOptions:
        """The same with the file of this name in the store's folder."""
        return replace(self, store=self.store / name)

    def apart(self, quick_store: str | None, remedy: str) -> RunOptions:
        """The same with the store of a quick study, if this is one, unless the user has named a store.

        A part of a study needs a store that the user names: give the `remedy` that says so, else an empty one.
        """
        if click.get_current_context().get_parameter_source("store") is not ParameterSource.DEFAULT:
            return self
        if remedy:
            raise InputError("store", str(self.store), remedy)
        return self if quick_store is None else replace(self, store=Path(quick_store))

    def check(self, study: Study) -> None:
        """Find a store of another study, a damaged one, or one that cannot be written, before anything is run."""
        from comparisons.lab.study.rows import finished_keys

        if len(finished_keys(self.store, study)) < len(study.cases):
            writable_folder(self.store.parent, "store")

    def run(self, study: Study) -> StudyRun:
        """Run the study; after an interrupt the command ends with status 130 and a line that tells how to go on."""
        from comparisons.lab.study import run_study

        run = run_study(study, self.store, self.workers, self.dask, self.timeout, self.memory, threads=self.threads)
        if run.interrupted:
            rows = f"{run.finished} of {len(study.cases)} rows are in {run.store}"
            click.echo(f"interrupted: {rows}; the same command goes on from there", err=True)
            click.get_current_context().exit(130)
        return run


def study_options(
    store: str, timeout: float | None = None, memory: int | None = None, *, folder: bool = False
) -> Callable[..., Any]:
    """Decorator of a command that runs a study: adds the options, with these defaults, and gives it `RunOptions`.

    The command's first argument is that object; its own options follow as always. With `folder` the store is a folder,
    for a command that runs several studies and gives each a file in it, see `RunOptions.inside`.
    """
    metavar, kept = "FILE", "File that keeps the rows."
    if folder:
        metavar, kept = "FOLDER", "Folder that keeps the rows, in a file for each study."
    memory_help = "Memory in MiB that a case may take." + ("  [default: no limit]" if memory is None else "")
    options = (
        click.option("--store", default=store, metavar=metavar, show_default=True, help=kept),
        click.option("--workers", type=COUNT, default=1, show_default=True,
                     help="Processes on this machine."),
        click.option("--dask", metavar="ADDRESS", help="Run on a Dask cluster instead: address of its scheduler."),
        click.option("--timeout", type=FiniteRange(0.0, min_open=True), default=timeout, show_default=True,
                     help="Seconds a case may take."),
        click.option("--memory", type=click.IntRange(1, _MOST_MEMORY), default=memory, show_default=True,
                     help=memory_help),
        click.option("--threads", type=COUNT, default=1, show_default=True, help="Threads of each worker."),
    )  # fmt: skip

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(command)
        def with_run_options(
            store: str, workers: int, dask: str | None, timeout: float | None, memory: int | None, threads: int,
            **more: Any,
        ) -> Any:  # fmt: skip
            return command(RunOptions(Path(store), workers, dask, timeout, memory, threads), **more)

        decorated: Callable[..., Any] = with_run_options
        for option in reversed(options):
            decorated = option(decorated)
        return decorated

    return decorate
