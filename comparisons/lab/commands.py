"""Commands of experiments: options that they share, and what becomes of the rows.

    @experiment(timeout=120.0, short_help="Generated problems: what becomes of each.")
    @click.option("--each", type=COUNT, default=50)
    def wild(each: int) -> Plan:
        \"\"\"Solve generated problems.\"\"\"
        from comparisons.wild import study

        return Plan([study.declared(each)], study.report)

The name of the function is that of the command and of its report; of two words, the first is the folder of both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from qvi_contact.basics.terminal import Command
from qvi_contact.errors import InputError

if TYPE_CHECKING:  # help comes at once: what runs studies is loaded by those who do
    from comparisons.lab.reports import Report
    from comparisons.lab.studies import Study

COUNT: Final = click.IntRange(1, 10_000)
"""Type of options that count: cells along a side, processes, repetitions."""

_MOST_MEMORY: Final = 2**40  # MiB, whose bytes the system can still count


class FiniteRange(click.FloatRange):
    """Type of options that take finite numbers of a range; click's own lets nan and inf pass."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        number = float(super().convert(value, param, ctx))
        return number if math.isfinite(number) else self.fail(f"{value} is not finite.", param, ctx)


class ListCommand(Command):
    """A command whose repeatable options take lists: ``--cells 4 8`` means ``--cells 4 --cells 8``.

    For commands without arguments, where nothing else can follow a value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the options' names before each of their values, then parse as always."""
        options = [each for each in self.params if isinstance(each, click.Option) and each.multiple]
        names = {name for option in options for name in option.opts}

        def spread() -> Iterator[str]:
            current, values = "", 0
            for word in args:
                if word[:1] == "-" and not word[1:2].isdigit():  # an option, not a negative number
                    current, values = (word if word in names else ""), 0
                elif current:
                    values += 1
                    if values > 1:
                        yield current
                yield word

        return super().parse_args(ctx, list(spread()))


def folder_option(context: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:  # noqa: ARG001
    """Callback: a folder's name; an empty one, as from an unset shell variable, is not the current folder."""
    if value == "":
        raise click.BadParameter("give the name of a folder")
    return None if value is None else Path(value)


class Plan(NamedTuple):
    """What a command is to do: run these studies, and make a report of the rows of each, one argument a study."""

    studies: Sequence[Study]
    report: Callable[..., Report]


class Experiment(ListCommand):
    """The command of an experiment, see `experiment`."""


def experiment(
    *, timeout: float | None = None, memory: int | None = None, needs: Sequence[str] = (), short_help: str
) -> Callable[[Callable[..., Plan]], Experiment]:
    """Decorator of a function that makes a `Plan` of a command's own options: the command, with those that all have.

    `timeout` [s] and `memory` [MiB] are defaults of what a case may take. Without the packages `needs` nothing is run.
    """

    def made(plan: Callable[..., Plan]) -> Experiment:
        name = plan.__name__.replace("_", "-")
        folder = f"results/{name.partition('-')[0]}"

        def run(out: Path, again: bool, store: Path, **given: Any) -> int:
            """Run what is missing, write and show the report; exit status 1 if the report says that something failed.

            A folder that cannot be written, and a store that cannot be used, are found before anything is run.
            """
            from comparisons.lab.studies import read_rows, run_study, write_rows, written_rows
            from qvi_contact.basics.writing import writable_folder

            limits = {each: given.pop(each) for each in ("workers", "dask", "timeout", "memory", "threads")}
            studies, report_of = plan(**given)
            place = writable_folder(out, "--out")
            tables = [place / f"{study.name}.jsonl.gz" for study in studies]
            if not again:
                writable_folder(store.parent, "--store")
                pending = sum(len(study.cases) - len(read_rows(study, store)) for study in studies)
                lacking = [name for name in needs if find_spec(name) is None]
                if pending and lacking and limits["dask"] is None:  # workers of a cluster have their own
                    remedy = f"is missing: python -m pip install {' '.join(lacking)}"
                    raise InputError("installation", ", ".join(lacking), remedy)
                try:
                    done = [run_study(study, store, **limits) for study in studies]
                except KeyboardInterrupt:
                    finished = sum(len(read_rows(study, store)) for study in studies)
                    told = f"{finished} of {sum(len(study.cases) for study in studies)} rows are in {store}"
                    click.echo(f"interrupted: {told}; the same command goes on from there", err=True)
                    click.get_current_context().exit(130)
                for table, rows in zip(tables, done, strict=True):
                    write_rows(table, rows)
            report = report_of(*map(written_rows, tables))
            report.show([*report.write(place), *tables])
            return int(report.failed)

        shown, finite = {"show_default": True}, FiniteRange(0.0, min_open=True)
        options = [
            click.Option(["--store"], default=f"{folder}/{name}.sqlite", metavar="FILE", callback=folder_option,
                         help="File that keeps the rows.", **shown),
            click.Option(["--workers"], type=COUNT, default=1, help="Processes on this machine.", **shown),
            click.Option(["--dask"], metavar="ADDRESS", help="Run on a Dask cluster instead, with this scheduler."),
            click.Option(["--timeout"], type=finite, default=timeout, help="Seconds a case may take.", **shown),
            click.Option(["--memory"], type=click.IntRange(1, _MOST_MEMORY), default=memory,
                         help="Memory in MiB that a case may take.", **shown),
            click.Option(["--threads"], type=COUNT, default=1, help="Threads of each worker.", **shown),
            click.Option(["--out"], metavar="FOLDER", default=folder, callback=folder_option,
                         help="Folder for the report and its rows.", **shown),
            click.Option(["--again"], is_flag=True, help="Run nothing: write the report of the rows in that folder."),
        ]  # fmt: skip
        own = list(reversed(getattr(plan, "__click_params__", [])))
        return Experiment(name, callback=run, params=[*own, *options], help=plan.__doc__, short_help=short_help)

    return made
