"""What commands write: files, checked before the work begins, and the displacement model that some of them show."""

import json
import os
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qvi_contact import files
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
    result: ContactResult,
    document: dict[str, Any],
    *,
    known: "Bracket | None" = None,
    time_limit: float | None = None,
    **more: Any,
) -> bool:
    """Write the files asked for, as many as can be; whether all could be, and a line for each that could not.

    The picture is that of the result, or of a history. Pages and fields have the bracket, which takes at most
    `time_limit` seconds if it is not known. Other arguments are those of `result_page`.
    """
    series: Any = more.get("series")
    units = file.units

    @cache
    def bracketed() -> tuple["Bracket | None", str]:
        """The bracket, or why there is none: for incompressible materials, and after earlier slip on arcs."""
        from qvi_contact.bracket import bracket

        if known is not None or not result.has_state:
            return known, "there is no stress state"
        try:
            return bracket(result, time_limit=time_limit), ""
        except InputError as error:
            return None, error.remedy

    def plot(path: str) -> None:
        from qvi_contact import plots

        if file.times and series.results.steps[0].has_state and result.problem.contacts:
            plots.save_figure(path, plots.history_figure(series.results, units, file.times, file.title))
        else:
            plots.save_figure(path, plots.result_figure(result, units, file.title, more.get("panels")))

    def page(path: str) -> None:
        from qvi_contact.command.page import result_page

        write_text(path, result_page(source, file, result, bracketed, **more))

    def fields(path: str) -> None:
        bracket, _ = bracketed()
        moved = bracket if bracket is not None and bracket.companion.has_state else None
        files.write_vtu(path, result, units, bracket=moved)
        if result.contacts:
            whole = Path(path)
            files.write_contacts_vtu(whole.with_name(f"{whole.stem}_contacts{whole.suffix}"), result, units)

    writers: dict[str, Callable[[str], None]] = {
        "save_json": lambda path: write_text(path, json_text(document) + "\n"),
        "plot": plot,
        "npz": lambda path: files.write_npz(path, result, units, file.title),
        "report": page,
        "vtk": fields,
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
