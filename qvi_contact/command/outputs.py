"""What commands write: files, checked before the work begins, and the displacement model that several of them show."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qvi_contact import files
from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import check_suffix, check_writable, identity, write_text
from qvi_contact.command.cli import TARGETS
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import ProblemFile
from qvi_contact.solution.result import ContactResult
from solvers.errors import known_name

if TYPE_CHECKING:
    from qvi_contact.bracket import Bracket


def checked_targets(source: str, given: Mapping[str, str]) -> dict[str, str]:
    """The files asked for, by option.

    `InputError` if one cannot be written, is the problem file or another option's, or needs a package that is missing.
    """
    taken = {identity(source): "the problem file"}
    for option, path in given.items():
        name = option_name(option)
        if not path or os.path.isdir(path):  # Path's raises for names that no file can have
            raise InputError(name, path, "give the name of a file")
        check_writable(path, name)
        place = identity(path)
        if place in taken:
            raise InputError(name, path, f"is {taken[place]}: give a file of its own")
        taken[place] = f"the file of {name} too"
        target = TARGETS[option]
        if target.library and find_spec(target.library) is None:
            raise InputError(name, path, f"needs {target.library}: python -m pip install {target.library}")
        if target.suffix:
            check_suffix(name, path, target.suffix)
        if target.library == "matplotlib":
            from qvi_contact.plots.style import picture_suffix, require_matplotlib

            require_matplotlib()
            if option == "plot":
                picture_suffix(path)
    return dict(given)


class SecondModel:
    """The bracket of a result, computed when first asked for, in at most so many seconds; `missing` says why not."""

    def __init__(self, result: ContactResult, time_limit: float | None = None, known: "Bracket | None" = None) -> None:
        self.result, self.missing, self._time_limit = result, "", time_limit
        if known is not None:
            self.bracket = known

    @cached_property
    def bracket(self) -> "Bracket | None":
        """The bracket; None without a stress state, for incompressible materials, and after earlier slip along arcs."""
        from qvi_contact.bracket import bracket

        try:
            if self.result.has_state:
                return bracket(self.result, time_limit=self._time_limit)
            self.missing = "there is no stress state"
        except InputError as error:
            self.missing = error.remedy
        return None

    @property
    def displaced(self) -> "Bracket | None":
        """The bracket, if the displacement model in it has an answer."""
        return self.bracket if self.bracket is not None and self.bracket.companion.has_state else None

    def write(self, path: str, units: Units) -> None:
        """Write the fields of the body, with the displacement if there is one, and those of contacts beside them."""
        files.write_vtu(path, self.result, units, bracket=self.displaced)
        if self.result.contacts:
            whole = Path(path)
            files.write_contacts_vtu(whole.with_name(f"{whole.stem}_contacts{whole.suffix}"), self.result, units)


def asked_panels(file: ProblemFile, panels: str | None) -> list[str] | None:
    """The contacts that --panels names, none for "none"; None for those that pictures choose."""
    names = [contact.name for contact in file.problem.contacts]
    if panels is None or panels in names:
        return None if panels is None else [panels]
    found = [] if panels == "none" else [part.strip() for part in panels.split(",")]
    return [known_name("--panels", name, {"contacts": names}) for name in found]


def write_all(
    source: str,
    targets: Mapping[str, str],
    file: ProblemFile,
    second: SecondModel,
    document: dict[str, Any],
    panels: Sequence[str] | None = None,
    **more: Any,
) -> bool:
    """Write the files asked for, as many as can be; whether all could be, and a line for each that could not.

    The displacement model has the result. The picture is that of the result, or of a history. Other arguments are those
    of `result_page`.
    """
    result, units = second.result, file.units
    series: Any = more.get("series")

    def plot(path: str) -> None:
        from qvi_contact import plots

        if file.times and series.results.steps[0].has_state and result.problem.contacts:
            plots.save_figure(path, plots.history_figure(series.results, units, file.times, file.title))
        else:
            plots.save_figure(path, plots.result_figure(result, units, file.title, panels))

    def page(path: str) -> None:
        from qvi_contact.command.page import result_page

        write_text(path, result_page(source, file, second, panels=panels, **more))

    writers: dict[str, Callable[[str], None]] = {
        "save_json": lambda path: write_text(path, json_text(document) + "\n"),
        "plot": plot,
        "npz": lambda path: files.write_npz(path, result, units, file.title),
        "report": page,
        "vtk": lambda path: second.write(path, units),
    }
    stateless = {} if result.has_state else dict.fromkeys(("vtk", "npz"), "there is no stress state to write to")
    return written(targets, writers, stateless)


def written(
    targets: Mapping[str, str], writers: Mapping[str, Callable[[str], None]], missing: Mapping[str, str]
) -> bool:
    """Write files by option, as many as can be, with a line for each that is not; whether none failed.

    Words for what there is nothing to write to stand in `missing`.
    """
    complete = True
    for option, path in targets.items():
        try:
            if option in missing:
                click.echo(f"qvi-contact: {missing[option]} {path}", err=True)
            else:
                writers[option](path)
        except InputError as error:
            name = option_name(option) if error.field == "output" else error.field
            failure = InputError(name, error.value, error.remedy)
            click.echo(f"qvi-contact: {' '.join(str(failure).split())}", err=True)
            complete = False
    return complete


def option_name(name: str) -> str:
    """How an option is typed."""
    return f"--{name.replace('_', '-')}"


def json_text(document: object) -> str:
    """A document as JSON; numbers that are not finite are null."""
    return json.dumps(files.json_ready(document), indent=2, allow_nan=False)
