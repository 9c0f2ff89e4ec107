"""Options that commands share."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import click

from qvi_contact.basics.terminal import Command


class ListCommand(Command):
    """A command whose repeatable options take lists: ``--cells 4 8`` means ``--cells 4 --cells 8``.

    For commands without arguments, where nothing else can follow a value.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the options' names, then parse as always."""
        names = {
            name
            for parameter in self.params
            if isinstance(parameter, click.Option) and parameter.multiple
            for name in parameter.opts
        }
        return super().parse_args(ctx, list(_spread(args, names)))


def _spread(words: Sequence[str], names: set[str]) -> Iterator[str]:
    """The words, with the name of a repeatable option before each of its values."""
    current, values = "", 0
    for word in words:
        if word[:1] == "-" and not word[1:2].isdigit():  # an option, not a negative number
            current, values = (word if word in names else ""), 0
        elif current:
            values += 1
            if values > 1:
                yield current
        yield word


class FiniteRange(click.FloatRange):
    """Type of options that take finite numbers of a range; click's own lets nan and inf pass."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number."""
        number = float(super().convert(value, param, ctx))
        return number if math.isfinite(number) else self.fail(f"{value} is not finite.", param, ctx)


COUNT: Final = click.IntRange(1, 10_000)
"""Type of options that count: cells along a side, processes, repetitions."""

json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON document instead of the tables.")
"""Decorator of a command that prints its report."""


def out_option(folder: str) -> Callable[[Any], Any]:
    """Decorator of a command that writes its report to this folder, or to another one."""
    return click.option("--out", metavar="FOLDER", default=folder, show_default=True, callback=folder_option,
                        help="Folder for the report.")  # fmt: skip


def folder_option(context: click.Context, parameter: click.Parameter, value: str | None) -> Path | None:  # noqa: ARG001
    """Callback: a folder's name; an empty one, as from an unset shell variable, is not the current folder."""
    if value == "":
        raise click.BadParameter("give the name of a folder")
    return None if value is None else Path(value)
