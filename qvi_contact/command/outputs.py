"""What commands write: files, checked before the work begins, and the displacement model that several of them show."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from qvi_contact.basics.writing import check_suffix, check_writable, identity, write_text
from qvi_contact.errors import InputError
from solvers.basics.names import known_name

if TYPE_CHECKING:
    from qvi_contact.basics.units import Units
    from qvi_contact.bracket import Bracket
    from qvi_contact.command.series import Series
    from qvi_contact.companion import CompanionResult
    from qvi_contact.files.problem_file import ProblemFile
    from qvi_contact.limit.load_factor import LimitLoad
    from qvi_contact.problem.problem import ContactProblem
    from qvi_contact.refinement import Refinement
    from qvi_contact.solution.history import History
    from qvi_contact.solution.result import ContactResult

_MODULES = {
    "plot": "matplotlib",
    "report": "matplotlib",
    "vtk": "meshio",
}
"""Option → the library that it needs."""

_SUFFIXES = {"vtk": ".vtu", "npz": ".npz", "report": ".html", "proof": ".json"}


def checked_targets(source: str, **targets: str | None) -> dict[str, str]:
    """The files asked for, by option.

    `InputError` if one cannot be written, is the problem file or another option's, or needs a package that is missing.
    """
    given = {option: path for option, path in targets.items() if path is not None}
    taken = {identity(source): "the problem file"}
    for option, path in given.items():
        name = f"--{option.replace('_', '-')}"
        if not path or os.path.isdir(path):  # Path's raises for names that no file can have
            raise InputError(name, path, "give the name of a file")
        check_writable(path, name)
        place = identity(path)
        if place in taken:
            raise InputError(name, path, f"is {taken[place]}: give a file of its own")
        taken[place] = f"the file of {name} too"
        if option in _MODULES and find_spec(_MODULES[option]) is None:
            raise InputError(name, path, f"needs {_MODULES[option]}: python -m pip install {_MODULES[option]}")
        if option in _SUFFIXES:
            check_suffix(name, path, _SUFFIXES[option])
        if option in ("plot", "report"):
            from qvi_contact.plots import picture_suffix, require_matplotlib

            if option != "report":
                picture_suffix(path)
            require_matplotlib()
    return given


class SecondModel:
    """The bracket of a result and its displacement, computed when first asked for, in at most so many seconds.

    `missing` says why there is no bracket, or no displacement in it, once one of them was asked for.
    """

    def __init__(self, result: ContactResult, time_limit: float | None = None, known: Bracket | None = None) -> None:
        self.result, self.missing = result, ""
        self._time_limit = time_limit
        if known is not None:
            self.bracket = known

    @cached_property
    def bracket(self) -> Bracket | None:
        """The bracket; None without a stress state, for incompressible materials, and after earlier slip along arcs."""
        from qvi_contact.bracket import bracket

        if not self.result.has_state:
            self.missing = "there is no stress state"
            return None
        try:
            return bracket(self.result, time_limit=self._time_limit)
        except InputError as error:
            self.missing = error.remedy
            return None

    @cached_property
    def companion(self) -> CompanionResult | None:
        """The result of the displacement model that has a displacement."""
        if self.bracket is None:
            return None
        found = self.bracket.companion
        if not found.has_state:
            self.missing = self.bracket.message
            return None
        return found

    def write(self, path: str, units: Units) -> None:
        """Write the fields of the body, with the displacement if there is one, and those of contacts beside them."""
        from qvi_contact.files.export import write_contacts_vtu, write_vtu

        write_vtu(path, self.result, units, bracket=None if self.companion is None else self.bracket)
        if self.result.contacts:
            whole = Path(path)
            write_contacts_vtu(whole.with_name(f"{whole.stem}_contacts{whole.suffix}"), self.result, units)


def asked_panels(file: ProblemFile, panels: str | None) -> list[str] | None:
    """The contacts that --panels names, none for "none"; None for those that pictures choose."""
    names = [contact.name for contact in file.problem.contacts]
    if panels is None or panels in names:
        return None if panels is None else [panels]
    found = [] if panels == "none" else [part.strip() for part in panels.split(",")]
    return [known_name("--panels", name, {"contacts": names}) for name in found]


def write_all(
    targets: Mapping[str, str],
    file: ProblemFile,
    second: SecondModel,
    document: dict[str, Any],
    page: Callable[[], str] = str,
    history: History | None = None,
    panels: Sequence[str] | None = None,
) -> bool:
    """Write the files asked for, as many as can be; whether all could be, and a line for each that could not.

    The displacement model has the result. The picture is that of the result or history.
    """

    def plot(path: str) -> None:
        from qvi_contact import plots

        if history is not None and history.steps[0].has_state and second.result.problem.contacts:
            plots.save_figure(path, plots.history_figure(history, file.units, file.times, file.title))
        else:
            plots.save_figure(path, plots.result_figure(second.result, file.units, file.title, panels))

    def npz(path: str) -> None:
        from qvi_contact.files.export import write_npz

        write_npz(path, second.result, file.units, file.title)

    writers: dict[str, Callable[[str], None]] = {
        "save_json": lambda path: write_text(path, json_text(document) + "\n"),
        "plot": plot,
        "npz": npz,
        "report": lambda path: write_text(path, page()),
        "vtk": lambda path: second.write(path, file.units),
    }
    of_state = () if second.result.has_state else ("vtk", "npz")
    missing = [path for option, path in targets.items() if option in of_state]
    if missing:
        click.echo(f"qvi-contact: there is no stress state to write to {', '.join(missing)}", err=True)
    complete = True
    for option, path in targets.items():
        if option in of_state:
            continue
        try:
            writers[option](path)
        except InputError as error:
            name = f"--{option.replace('_', '-')}" if error.field == "output" else error.field
            failure = InputError(name, error.value, error.remedy)
            click.echo(f"qvi-contact: {' '.join(str(failure).split())}", err=True)
            complete = False
    return complete


def page_of(
    path: str,
    file: ProblemFile,
    steps: Sequence[ContactResult],
    second: SecondModel,
    refinement: Refinement | None = None,
    series: Series | None = None,
    panels: Sequence[str] | None = None,
) -> Callable[[], str]:
    """What makes the page of --report."""

    def made() -> str:
        from qvi_contact.command.page.page import Request, result_page

        return result_page(Request.read(path, file), steps, second, refinement, series, panels)

    return made


def write_proof(path: str, problem: ContactProblem, loads: Sequence[str], degree: int | None) -> list[str]:
    """Write a proof file; what people read of it."""
    from qvi_contact.limit.check_proof import check, sentences
    from qvi_contact.limit.load_factor import limit_proof
    from qvi_contact.limit.proof import save_proof

    proof = limit_proof(problem, loads, degree=degree)
    save_proof(path, proof)
    found = sentences(*check(proof)[:2])
    return found + [f"not proved: the {side} bound ({reason})" for side, reason in proof["missing"].items()]


def write_limit(
    targets: Mapping[str, str],
    source: str,
    file: ProblemFile,
    problem: ContactProblem,
    limit: LimitLoad,
    said: Sequence[str],
) -> Iterator[str]:
    """Write picture, fields and page of a limit load, on the mesh of the analysis; a line for what there is not.

    `source` is the path of the problem file, `said` what people read of the answer.
    """
    from qvi_contact.command.page.page import Request, limit_page
    from qvi_contact.files.export import write_collapse_vtu
    from qvi_contact.plots import limit_figure, save_figure

    if "plot" in targets and limit.mechanism is None and limit.collapse is None:
        yield f"there is no mechanism to draw in {targets['plot']}"
    elif "plot" in targets:
        save_figure(targets["plot"], limit_figure(problem, limit, file.units, file.title, f"{said[0]}."))
    if "vtk" in targets and limit.collapse is None:
        yield f"there is no flow to write to {targets['vtk']}: no part of the body yields, or it has no largest load"
    elif "vtk" in targets:
        write_collapse_vtu(targets["vtk"], problem, limit, file.units)
    if "report" in targets:
        write_text(targets["report"], limit_page(Request.read(source, file), problem, limit, said))


def json_text(document: object) -> str:
    """A document as JSON; numbers that are not finite are null."""
    from qvi_contact.files.export import json_ready

    return json.dumps(json_ready(document), indent=2, allow_nan=False)
