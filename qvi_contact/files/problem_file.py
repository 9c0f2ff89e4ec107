"""Problem files: contact problems as TOML, which people can write and programs can keep.

A file can never run code: functions are numbers, polynomials or expressions of `qvi_contact.problem.fields`.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np

from qvi_contact.basics.units import Units
from qvi_contact.basics.writing import given_path
from qvi_contact.errors import InputError
from qvi_contact.files.located import in_toml
from qvi_contact.files.problem_builder import Reader, file_path
from qvi_contact.files.problem_document import Document, TimeRange, parse
from qvi_contact.files.problem_size import LARGEST, check_length
from qvi_contact.problem.problem import ContactProblem

ELEMENT_OPTIONS: Final = ("degree", "contact_rows")
"""Arguments of `solve` that choose the element rather than the method."""


@dataclass(frozen=True)
class SweepPlan:
    """Arguments for `qvi_contact.solve_sweep`: parameter, values, and names of what is changed, by default all."""

    parameter: Any  # checked by solve_sweep
    values: tuple[float, ...]
    of: tuple[str, ...] | None = None


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """What a problem file says.

    Attributes
    ----------
    problem : ContactProblem
        The problem, at the first time if there is a history.
    title, description : str
        What the author calls it.
    units : Units
        Labels of the numbers' units.
    solve_options : mapping
        Arguments for `qvi_contact.solve`.
    refine_options : mapping
        Arguments for `qvi_contact.refine` beside those.
    times : tuple of float
        Times of the load steps; empty without a history.
    sweep : SweepPlan or None
        Values for which the problem is to be solved, if there is a sweep.

    """

    problem: ContactProblem
    title: str
    description: str
    units: Units
    solve_options: Mapping[str, Any]
    refine_options: Mapping[str, Any]
    times: tuple[float, ...]
    sweep: SweepPlan | None
    _document: Document = field(repr=False)

    @property
    def element(self) -> dict[str, Any]:
        """What the file says of the element: arguments for `qvi_contact.discretize`."""
        return {name: value for name, value in self.solve_options.items() if name in ELEMENT_OPTIONS}

    @property
    def is_grid(self) -> bool:
        """Whether the file gives its mesh by grid lines."""
        return self._document.mesh.is_grid

    def problem_at(self, t: float) -> ContactProblem:
        """The problem with another value of t in its expressions, on the same mesh.

        Raises
        ------
        InputError
            If an expression has a bad value at that time.

        """
        try:
            return Reader(self._document, t).problem(self.problem.mesh)
        except InputError as error:
            raise type(error)(error.field, error.value, f"at t = {t:g}: {error.remedy}") from error

    @cached_property
    def problems(self) -> tuple[ContactProblem, ...]:
        """The problems of all load steps; without a history the one there is."""
        return tuple(self.problem_at(t) for t in self.times) or (self.problem,)

    @contextmanager
    def named_errors(self) -> Iterator[None]:
        """Input errors raised in the block, such as loads out of balance, get their path in the file."""
        try:
            yield
        except InputError as error:
            path, remedy = file_path(self._document, error), in_toml(error.remedy)
            if (path, remedy) == (error.field, error.remedy):
                raise
            raise type(error)(path, error.value, remedy) from error


def load_problem(path: str | Path) -> ProblemFile:
    """Read a problem file.

    Parameters
    ----------
    path : str or Path
        A TOML file; the folder ``examples`` shows how to write them.

    Raises
    ------
    InputError
        If the file cannot be read, or anything in it is wrong; the field is the path inside the file, such as
        ``contacts[1].friction``, counted from 0.

    """
    path = given_path("file", path)
    try:
        with path.open("rb") as stream:
            content = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a name no file can have
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError("file", str(path), f"cannot be read ({reason}): give the name of a problem file") from error
    check_length("file", str(path), len(content))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        remedy = f"is not text in UTF-8 (byte {error.start}): give a problem file (TOML), saved in that encoding"
        raise InputError("file", str(path), remedy) from error
    return problem_from_toml(text, path.parent)


def problem_from_toml(text: str, folder: str | Path | None = None) -> ProblemFile:
    """Read a problem from TOML text; see `load_problem`.

    A mesh file is looked for in `folder`; without one a text that names a mesh file is refused.
    """
    document = parse(text.replace("\r\n", "\n"))
    times = _times(document)
    reader = Reader(document, times[0] if times else None, None if folder is None else Path(folder))
    found = ProblemFile(
        problem=reader.problem(reader.mesh()),
        title=document.title,
        description=document.description,
        units=Units(document.units.length, document.units.stress),
        solve_options=document.solve.model_dump(exclude_none=True),
        refine_options=document.refine.model_dump(exclude_none=True),
        times=times,
        sweep=_sweep(document),
        _document=document,
    )
    _ = found.problems  # checks the other times
    return found


def _sweep(document: Document) -> SweepPlan | None:
    if document.sweep is None:
        return None
    if document.history is not None:
        raise InputError("sweep", document.sweep.parameter, "a file with a [history] cannot be swept: leave one out")
    values, of = _listed("sweep.values", document.sweep.values, "value"), document.sweep.of
    return SweepPlan(document.sweep.parameter, values, None if of is None else tuple(of))


def _times(document: Document) -> tuple[float, ...]:
    return () if document.history is None else _listed("history.times", document.history.times, "time")


def _listed(path: str, given: list[float] | TimeRange, what: str) -> tuple[float, ...]:
    """The numbers of a list or range, at least one."""
    if isinstance(given, TimeRange):
        return tuple(np.linspace(given.start, given.stop, given.steps + 1).tolist())
    if not given:
        raise InputError(path, given, f"give at least one {what}")
    return tuple(given)
