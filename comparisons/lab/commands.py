"""Commands of experiments: the options they share, the run of their studies, and the report of the rows.

    @experiment(timeout=120.0, short_help="Generated problems: is every answer right?")
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

if TYPE_CHECKING:  # so that --help is quick: the modules that run studies are loaded when a study runs
    from comparisons.lab.reports import Report
    from comparisons.lab.studies import Study

COUNT: Final = click.IntRange(1, 10_000)
"""Type of options that count: cells along a side, processes, repetitions."""

_MOST_MEMORY: Final = 2**40  # MiB: the largest limit whose bytes the system can count


class FiniteRange(click.FloatRange):
    """Type of options that take finite numbers in a range; click's own type accepts nan and inf."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        number = float(super().convert(value, param, ctx))
        return number if math.isfinite(number) else self.fail(f"{value} is not finite.", param, ctx)


class ListCommand(Command):
    """A command whose repeatable options take lists: ``--cells 4 8`` means ``--cells 4 --cells 8``.

    Only for commands without arguments, where a word after a value can only be a further value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option's name before each of its values, then parse as usual."""
        options = [each for each in self.params if isinstance(each, click.Option) and each.multiple]
        names = {name for option in options for name in option.opts}

        def repeated() -> Iterator[str]:
            option, n_values = "", 0
            for word in args:
                if word[:1] == "-" and not word[1:2].isdigit():  # an option, not a negative number
                    option, n_values = (word if word in names else ""), 0
                elif option:
                    n_values += 1
                    if n_values > 1:
                        yield option
                yield word

        return super().parse_args(ctx, list(repeated()))


def folder_option(context: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:  # noqa: ARG001
    """Callback: the folder as a path; an empty name, as from an unset shell variable, is refused."""
    if value == "":
        raise click.BadParameter("give the name of a folder")
    return None if value is None else Path(value)


class Plan(NamedTuple):
    """The studies that a command runs, and the function that makes its report from their rows, one argument a study."""

    studies: Sequence[Study]
    report: Callable[..., Report]


class Experiment(ListCommand):
    """The command of an experiment, see `experiment`."""


def experiment(
    *, timeout: float | None = None, memory: int | None = None, needs: Sequence[str] = (), short_help: str
) -> Callable[[Callable[..., Plan]], Experiment]:
    """Decorator that makes a command of a function from the command's own options to a `Plan`; adds the shared options.

    `timeout` [s] and `memory` [MiB] are the default limits of a case. No case is run without the packages `needs`.
    """

    def command_of(plan: Callable[..., Plan]) -> Experiment:
        name = plan.__name__.replace("_", "-")
        folder = f"results/{name.partition('-')[0]}"

        def run(out: Path, again: bool, store: Path, **given: Any) -> int:
            """Run the missing cases, write and show the report; exit status 1 if the report has failed.

            The folder and the store are tested before any case is run.
            """
            from comparisons.lab.studies import read_rows, run_study, write_rows, written_rows
            from qvi_contact.basics.writing import writable_folder

            limits = {each: given.pop(each) for each in ("workers", "dask", "timeout", "memory", "threads")}
            studies, report_of = plan(**given)
            place = writable_folder(out, "--out")
            tables = [place / f"{study.name}.jsonl.gz" for study in studies]
            if not again:
                writable_folder(store.parent, "--store")
                n_pending = sum(len(study.cases) - len(read_rows(study, store)) for study in studies)
                missing = [name for name in needs if find_spec(name) is None]
                if n_pending and missing and limits["dask"] is None:  # a cluster's workers have their own packages
                    remedy = f"is missing: python -m pip install {' '.join(missing)}"
                    raise InputError("installation", ", ".join(missing), remedy)
                try:
                    rows_by_study = [run_study(study, store, **limits) for study in studies]
                except KeyboardInterrupt:
                    n_finished = sum(len(read_rows(study, store)) for study in studies)
                    stored = f"{n_finished} of {sum(len(study.cases) for study in studies)} rows are in {store}"
                    click.echo(f"interrupted: {stored}; the same command goes on from there", err=True)
                    click.get_current_context().exit(130)
                for table, rows in zip(tables, rows_by_study, strict=True):
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

    return command_of
