"""Sweeps: one problem for several values of friction, load, gap or offset; what all have in common is made once.

Results are kept, or rows of numbers in a file, from which the same sweep goes on.
"""

from __future__ import annotations

import hashlib
import math
import pickle
import sqlite3
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, overload

import numpy as np

from qvi_contact import __version__
from qvi_contact.basics.checks import function_or_none, instance_of, names_among, one_of, real_array, true_or_false
from qvi_contact.basics.schema import LARGEST
from qvi_contact.basics.writing import given_path
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import laws_vary
from qvi_contact.errors import InputError, SolveError
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.fields import plus
from qvi_contact.problem.problem import ContactProblem, run_digest, with_contacts
from qvi_contact.runs.database import Database
from qvi_contact.runs.processes import Limits, NotLoadedError, Workers
from qvi_contact.solution.result import PLATE_COLUMNS, ContactResult, contact_numbers, forces_units, overall_status
from qvi_contact.solution.settings import PARAMETERS, Parameter, Settings
from qvi_contact.solution.solver import discretized, fitted, solved
from qvi_contact.units import Units
from solvers import Status
from solvers.basics.progress import Log, deadline
from solvers.basics.types import frame, load, pandas

if TYPE_CHECKING:
    from pandas import DataFrame

_COLUMNS: Final = {"step": ">5", "value": ">12g", "status": "<20", "iterations": ">10", "accuracy": ">9.1e"}
_LARGEST: Final = 50  # values of a slice: rows come slice by slice
_SLICES: Final = 4  # for each worker at least, so that all end at about the same time
_LEAST: Final = 1e-3  # seconds that a slice has which comes too late
_GRACE: Final = 30.0  # seconds beyond the time limit after which a worker process is ended


@dataclass(frozen=True)
class SweepRow:
    """One value of a sweep."""

    number: int
    """Its place among all values, from 1."""
    value: float
    status: Status
    """What became of it."""
    message: str
    """One sentence about that."""
    iterations: int
    """Of the method."""
    accuracy: float
    """What the certificate confirms, dimensionless."""
    seconds: float
    """How long it took."""
    contacts: Mapping[str, Mapping[str, float]]
    """`ContactLine.summary` by the name of the contact, with motion, force and moment where it has a plate or pin.

    Empty without a state.
    """

    @classmethod
    def of(cls, number: int, value: float, result: ContactResult, seconds: float = 0.0) -> SweepRow:
        """The row of a result."""
        contacts = contact_numbers(result) if result.has_state else {}
        accuracy = result.certificate.accuracy
        return cls(number, value, result.status, result.message, result.iterations, accuracy, seconds, contacts)


class SweepRows(ABC):
    """What sweeps tell of their values, whether results are kept or rows."""

    parameter: Parameter
    values: tuple[float, ...]
    _unfinished: ClassVar[str] = f"time limit after {{}} of {{}} values. {Status.TIME_LIMIT.advice}"

    @abstractmethod
    def rows(self) -> Iterator[SweepRow]:
        """What is done, in the order of the values."""

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each value done, in the order of the values."""
        return tuple(row.status for row in self.rows())

    @property
    def status(self) -> Status:
        """Solved if all values were; else the status of the first that was not, "time_limit" if some are missing."""
        return overall_status(self.statuses, len(self.values))

    @property
    def message(self) -> str:
        """One sentence about the outcome."""
        statuses, planned = self.statuses, len(self.values)
        failed = sum(status is not Status.SOLVED for status in statuses)
        if failed:
            first = next(row for row in self.rows() if row.status is not Status.SOLVED)
            others = f" ({failed - 1} more not solved)" if failed > 1 else ""
            return f"{self.parameter} = {first.value:g}: {first.message}{others}"
        if len(statuses) < planned:
            return self._unfinished.format(len(statuses), planned)
        return f"all {planned} values solved" if planned > 1 else "the value is solved"

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """One row for each value and contact as a pandas table, with units and errors as `ContactResult.to_frame`.

        Columns are the parameter, "status", "iterations", "contact", and those of `ContactResult.forces_frame`. Values
        without a state have no rows.
        """
        name = self.parameter
        lines: list[dict[str, Any]] = [
            {name: row.value, "status": str(row.status), "iterations": row.iterations, "contact": contact, **summary}
            for row in self.rows()
            for contact, summary in row.contacts.items()
        ]
        length = Units.labels(units, {name: "displacement"} if name in ("gap", "offset") else {})
        return frame(pandas().DataFrame(lines), {**forces_units(units), **length})


@dataclass(frozen=True, eq=False)
class Sweep(SweepRows):
    """Results of a sweep, one for each value that was done."""

    parameter: Parameter
    """What was changed."""
    values: tuple[float, ...]
    """All values asked for."""
    steps: tuple[ContactResult, ...]
    """The results of the first of them, all unless the time ran out."""

    def rows(self) -> Iterator[SweepRow]:
        """What is done, in the order of the values; their seconds are 0."""
        for number, (value, step) in enumerate(zip(self.values, self.steps, strict=False), 1):
            yield SweepRow.of(number, value, step)

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each value done, in the order of the values."""
        return tuple(step.status for step in self.steps)


@overload
def solve_sweep(
    problem: ContactProblem,
    parameter: Parameter,
    values: Sequence[float],
    of: Sequence[str] | None = None,
    callback: Callable[[int, ContactResult], object] | None = None,
    settings: Settings | None = None,
    *,
    store: None = None,
    **changes: Any,
) -> Sweep: ...


@overload
def solve_sweep(
    problem: ContactProblem,
    parameter: Parameter,
    values: Sequence[float],
    of: Sequence[str] | None = None,
    callback: Callable[[int, SweepRow], object] | None = None,
    settings: Settings | None = None,
    *,
    store: str | Path,
    **changes: Any,
) -> StoredSweep: ...


def solve_sweep(
    problem: ContactProblem,
    parameter: Parameter,
    values: Sequence[float],
    of: Sequence[str] | None = None,
    callback: Callable[[int, Any], object] | None = None,
    settings: Settings | None = None,
    *,
    store: str | Path | None = None,
    workers: int = 1,
    dask: str | None = None,
    warm_start: bool = True,
    **changes: Any,
) -> Sweep | StoredSweep:
    """Solve a problem for several values of one of its data.

    Each value is a problem of its own: nothing is remembered but what saves time. Where the law of friction leaves
    several solutions, the one found may depend on the value before; sort the values as the body would be loaded.

    With a `store` no result is kept, but a row of numbers for each value and contact, on the disk as soon as its value
    is done: memory does not grow with the number of values. The same call again goes on where the last one stopped,
    whatever stopped it. A value without an answer has its row too, and is not tried again; one that the time limit cut
    short has none.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    parameter : "friction", "load", "gap" or "offset"
        "friction": the coefficient μ of contacts, in place of theirs; "load": a factor of loads; "gap", "offset": what
        is added to these data of contacts [length].
    values : sequence of float
        Its values, in the order in which they are solved.
    of : sequence of str, optional
        Names of the contacts that are changed, all but tied ones by default, which have no friction; for "load" names
        of the loads, as for `limit_load_factor`, all by default.
    callback : callable, optional
        Called with the number of each value, from 1, and its result; with a store its `SweepRow`, if it was not in the
        file before.
    settings : Settings, optional
        How to discretise and solve all of them.
    store : str or Path, optional
        An SQLite file, made if it is missing.
    workers : int
        Processes of this machine that share the values of a sweep with a store. Each does slices of neighbouring
        values, on one thread, and keeps its factorisation from one slice to the next; the rows of a slice are written
        when it is done. The values of a process that dies are done again one by one. The value with which a process
        dies twice gets the status "backend_failed" or "out_of_memory", and the others go on.
    dask : str, optional
        Address of the scheduler of a Dask cluster that does so instead, as tcp://host:8786.
    warm_start : bool
        Whether methods that take a start begin at the state of the value before.
    **changes
        Fields of `Settings`, and options of the method.

    Returns
    -------
    Sweep or StoredSweep
        The latter with a store. A value that is not solved does not end it.

    Raises
    ------
    InputError
        If a value or a name is wrong, the store cannot be written or holds another sweep, the cluster cannot be
        reached, or the problem cannot be sent to other processes.

    """
    function_or_none("callback", callback)
    shared = Workers(workers, dask)
    if store is None and shared != Workers():
        name, given = ("workers", workers) if dask is None else ("dask", dask)
        raise InputError(name, given, "several processes share the values of a sweep with a store: give store=")
    title = f"qvi_contact {__version__}: solve_sweep"
    settings = Settings.of(settings, changes)
    with deadline(settings.time_limit), Log(title, settings.verbose, _COLUMNS, iterations=False) as log:
        task = SweepTask.of(problem, parameter, of, settings, warm=warm_start)
        remedy = f"give a list of at least one finite number, of at most {LARGEST:g} in size"
        asked = real_array("values", values, remedy)
        if asked.ndim != 1 or not len(asked) or not (np.abs(asked) <= LARGEST).all():
            raise InputError("values", values, remedy)
        if parameter == "friction" and asked.min() < 0.0:
            raise InputError("values", float(asked.min()), "give coefficients of friction ≥ 0")
        numbers = tuple(asked.tolist())
        log.begin({"values": len(numbers), "parameter": parameter, "cells": task.problem.mesh.cell_count})

        def told(number: int, found: ContactResult | SweepRow, accuracy: float) -> None:
            log.line(number, numbers[number - 1], str(found.status), found.iterations, accuracy)
            if callback is not None:
                callback(number, found)

        sweep: Sweep | StoredSweep
        if store is None:
            steps = list[ContactResult]()
            for number, _, result, _ in task.results(enumerate(numbers, 1), at_least=1):
                steps.append(result)
                told(number, result, result.certificate.accuracy)
            sweep = Sweep(parameter, numbers, tuple(steps))
        else:
            data = {"parameter": task.parameter, "of": task.names, "values": numbers, "warm_start": task.warm}
            fingerprint = run_digest([task.problem], {**settings.stated, **data})
            with (
                _writing(store, fingerprint, parameter, numbers) as (pending, append),
                closing(_rows(task, pending, shared)) as found,
            ):
                for rows in found:
                    append(rows)
                    for row in rows:
                        told(row.number, row, row.accuracy)
            sweep = read_sweep(store)
        log.end(str(sweep.status), sweep.message, {}, sweep.status is Status.SOLVED)
        return sweep


@dataclass(eq=False)
class SweepTask:
    """What is to be done for each value, and where it is done: one value after the other, on one factorisation.

    A value starts from the state of the one before. To find that a state is not near costs an iteration or two. After
    that a value starts as usual, after the next time two, then four, and so on: where the contact grows with each
    value, states are seldom near.
    """

    problem: ContactProblem
    parameter: Parameter  # what changes
    names: tuple[str, ...]  # the contacts or loads that are changed
    settings: Settings = field(default_factory=Settings)  # how to solve it
    warm: bool = False  # whether to start from the value before
    end: float = math.inf  # by `time.time`, which clocks of a cluster share
    _before: Discretization | None = field(default=None, init=False)
    _state: ContactResult | None = field(default=None, init=False)
    _pause: int = field(default=0, init=False)
    _left: int = field(default=0, init=False)

    @classmethod
    def of(
        cls,
        problem: ContactProblem,
        parameter: Parameter,
        names: Sequence[str] | None,
        settings: Settings,
        *,
        warm: bool,
    ) -> SweepTask:
        """The task of checked arguments of `solve_sweep`."""
        instance_of(ContactProblem, "problem", problem)
        one_of("parameter", parameter, PARAMETERS)
        every = parameter in ("gap", "offset") and names is not None
        known = [contact.name for contact in problem.contacts if every or contact.law != "tied"]
        what = "contacts" if every else "contacts that could open or slip"
        if parameter == "load":
            limit = load("qvi_contact.limit.load_factor")  # which commands that solve once need not load
            chosen = limit.checked_loads(problem, limit.loads_of(problem) if names is None else names, "of")
        elif not known:
            raise InputError("parameter", parameter, "the problem has no contact that could open or slip")
        elif names is None:
            chosen = tuple(known)
        else:
            chosen = names_among("of", names, what, known)
        return cls(problem, parameter, chosen, settings, true_or_false("warm_start", warm) and settings.takes_state)

    def changed(self, value: float) -> ContactProblem:
        """The problem with this value."""
        if self.parameter == "load":
            posed: ContactProblem = load("qvi_contact.limit.load_factor").multiplied(self.problem, self.names, value)
            return posed

        def changed(contact: Contact) -> Contact:
            given = 0.0 if self.parameter == "friction" else getattr(contact, self.parameter)
            new: Any = {self.parameter: plus(given, value)}
            return replace(contact, **new) if contact.name in self.names else contact

        return with_contacts(self.problem, changed)

    def results(
        self, planned: Iterable[tuple[int, float]], at_least: int = 0
    ) -> Iterator[tuple[int, float, ContactResult, float]]:
        """Number, value, result and seconds of these numbers and values, until the time is over."""
        for count, (number, value) in enumerate(planned):
            if count >= at_least and deadline.over:
                return
            began, posed = time.perf_counter(), self.changed(value)
            if self._before is None or laws_vary(posed) != laws_vary(self._before.problem):  # what bounds tractions
                self._before = discretized(posed, self.settings)
            elif self.parameter == "friction":
                self._before = self._before.with_law(posed)
            else:
                self._before = fitted(self._before.with_data(posed), self.settings)
            found = solved(self._before, self.settings, self._state if self.warm and not self._left else None)
            near = found.solution.near
            if near is None:
                self._left = max(self._left - 1, 0)
            else:
                self._pause = 0 if near else max(2 * self._pause, 1)
                self._left = self._pause
            if found.status is Status.SOLVED:
                self._state = found
            yield number, value, found, time.perf_counter() - began

    def rows(self, planned: Sequence[tuple[int, float]]) -> list[SweepRow]:
        """The rows of a slice of numbers and neighbouring values; a value that the time has cut short has none."""
        rows, seconds = list[SweepRow](), max(self.end - time.time(), _LEAST)
        with deadline(seconds if seconds < math.inf else None):
            for number, value, found, taken in self.results(planned):
                if found.status is Status.TIME_LIMIT:
                    break
                rows.append(SweepRow.of(number, value, found, taken))
        return rows


def _rows(task: SweepTask, planned: Sequence[tuple[int, float]], workers: Workers) -> Generator[Sequence[SweepRow]]:
    """Rows of these numbers and values as they come, a few at a time, until the time is over.

    The values of a slice whose process was lost are done again one by one, so that the one that was to blame is found.
    """
    if workers == Workers() or not planned:
        yield from filter(None, (task.rows([each]) for each in planned))
        return
    seconds = deadline.left
    limits = Limits(seconds + _GRACE if seconds < math.inf else None)
    remedy = "cannot be sent to other processes: give Expression or Polynomial for its functions, or those of modules"
    try:
        settings = replace(task.settings, threads=task.settings.threads or 1)
        shared = replace(task, settings=settings, end=time.time() + seconds)  # all slices of a process on one factor
        job = pickle.dumps(partial(tuple, (None, shared.rows)))
    except Exception as error:  # PicklingError, AttributeError or TypeError, by what it is
        raise InputError("problem", task.problem, f"{remedy} ({error})") from error
    try:
        with workers.ready(job, limits) as (size, outcomes):
            length = min(_LARGEST, max(1, math.ceil(len(planned) / (_SLICES * size))))
            slices = deque(planned[i : i + length] for i in range(0, len(planned), length))
            with closing(outcomes(slices)) as found:
                for part, outcome in found:
                    if outcome.status == "done":
                        yield outcome.value
                    elif outcome.status == "error":
                        raise outcome.error or SolveError(outcome.reason)
                    elif outcome.status != "timeout" and len(part) > 1:
                        slices.extendleft([each] for each in reversed(part))
                    elif outcome.status != "timeout":
                        ((number, value),) = part
                        status = Status.OUT_OF_MEMORY if outcome.status == "memory" else Status.BACKEND_FAILED
                        message = f"the process that solved it died twice ({outcome.reason})"
                        yield [SweepRow(number, value, status, message, 0, math.nan, outcome.seconds, {})]
    except NotLoadedError as error:
        raise InputError("problem", task.problem, f"{remedy} ({error.reason})") from error


# Rows of a sweep are in an SQLite file, each on disk when its value is done. `planned` has all values, `results` and
# `contacts` what is done, and the view `rows` joins them: one row for each value and contact, with the columns of
# `ContactResult.forces_frame`. The fingerprint in `sweep` is that of problem and options, and behind a colon a digest
# of parameter and values, which tells a file that was changed.


SUMMARY_COLUMNS: Final = (
    "normal_force", "tangential_force", "share_open", "share_stick", "share_slip",
    "largest_pressure", "largest_shear", "largest_gap", "largest_slip", *PLATE_COLUMNS,
)  # fmt: skip
"""Keys of `ContactLine.summary`, and those of plates and pins, which contacts without have no values for."""

_STORED: Final = ", ".join(SUMMARY_COLUMNS)


def _of(kind: str, *names: str) -> str:
    """Columns of one kind; SQLite would keep anything in any column."""
    return ", ".join(f"{name} {kind} NOT NULL CHECK (typeof({name}) = '{kind.lower()}')" for name in names)


def _numbers(*names: str) -> str:
    """Columns of numbers that may be missing, as NaN is."""
    return ", ".join(f"{name} REAL CHECK (typeof({name}) IN ('real', 'null'))" for name in names)


_TABLES: Final = (
    f"""CREATE TABLE sweep (
        {_of("TEXT", "parameter", "fingerprint", "began")}, CHECK (parameter IN {PARAMETERS})
    )""",
    f"CREATE TABLE planned (number INTEGER PRIMARY KEY, {_of('REAL', 'value')})",
    f"""CREATE TABLE results (
        number INTEGER PRIMARY KEY REFERENCES planned, {_of("TEXT", "status", "message")}, {_numbers("accuracy")},
        {_of("INTEGER", "iterations")}, {_of("REAL", "seconds")}, CHECK (status IN {tuple(map(str, Status))})
    )""",
    f"""CREATE TABLE contacts (
        number INTEGER NOT NULL REFERENCES results ON DELETE CASCADE, {_of("TEXT", "contact")},
        {_numbers(*SUMMARY_COLUMNS)}, PRIMARY KEY (number, contact)
    )""",
    f"""CREATE VIEW "rows" AS
        SELECT number, value, status, iterations, accuracy, seconds, contact, {_STORED}, message
        FROM planned JOIN results USING (number) LEFT JOIN contacts USING (number) ORDER BY number
    """,
)
_DATABASE: Final = Database("the store of a sweep", 0x51564957, 2, _TABLES, "results")  # "QVIW"

_CONTACT: Final = f"INSERT INTO contacts VALUES (?, ?, {', '.join('?' * len(SUMMARY_COLUMNS))})"
_DONE: Final = f"""
    SELECT number, value, status, message, iterations, accuracy, seconds, contact, {_STORED}
    FROM planned JOIN results USING (number) LEFT JOIN contacts USING (number) ORDER BY number, contacts.rowid
"""


@dataclass(frozen=True)
class StoredSweep(SweepRows):
    """A sweep whose rows are in a file, from which everything is read when it is asked for.

    `values` of the parameter are all that were asked for, done or not. `InputError` where the file is read, if it is
    not there any more or damaged.
    """

    path: Path
    parameter: Parameter
    values: tuple[float, ...]
    _unfinished = "{} of {} values are done: a run works, was stopped, or reached its time limit. The same call goes on"

    def rows(self) -> Iterator[SweepRow]:
        """What is done, in the order of the values."""
        with _DATABASE.opened(self.path) as connection:
            for (number, value, status, message, count, accuracy, seconds), parts in groupby(
                connection.execute(_DONE), lambda row: row[:7]
            ):
                named = {part[7]: zip(SUMMARY_COLUMNS, part[8:], strict=True) for part in parts if part[7] is not None}
                contacts = {name: {key: each for key, each in own if each is not None} for name, own in named.items()}
                accuracy = math.nan if accuracy is None else accuracy
                yield SweepRow(number, value, Status(status), message, count, accuracy, seconds, contacts)


def read_sweep(path: str | Path) -> StoredSweep:
    """The sweep of a store, which may belong to a run that goes on; `InputError` if there is none, or it is damaged."""
    place = _place(path)
    with _DATABASE.opened(place) as connection:
        parameter, _, values = _plan(connection, place)
    return StoredSweep(place, parameter, values)


def _place(path: str | Path) -> Path:
    """The file that a caller has named."""
    place = given_path("store", path)
    try:
        place = place.absolute()
        place.resolve().exists()
    except (OSError, ValueError, RuntimeError) as error:  # the latter where links lead in a circle
        raise InputError("store", str(path), f"no file can have this name ({error}): give another") from error
    return place


@contextmanager
def _writing(
    path: str | Path, fingerprint: str, parameter: Parameter, values: Sequence[float]
) -> Iterator[tuple[list[tuple[int, float]], Callable[[Sequence[SweepRow]], None]]]:
    """Open the store of a sweep, made if it is missing, and keep all other runs away from it.

    Numbers, from 1, and values that are not done; and what writes rows: all are on disk then, and none if it fails.
    `InputError` if it cannot be written, is in use, damaged, or holds another sweep.
    """
    place = _place(path)
    if place.is_dir() or not place.name:
        raise InputError("store", str(path), "is a folder: give the name of a file, such as sweep.sqlite")

    def declare(empty: sqlite3.Connection) -> None:
        marked = f"{fingerprint}:{_digest(fingerprint, parameter, values)}"
        began = datetime.now(UTC).isoformat(timespec="seconds")
        empty.execute("INSERT INTO sweep VALUES (?, ?, ?)", (parameter, marked, began))
        empty.executemany("INSERT INTO planned VALUES (?, ?)", enumerate(values, 1))

    with _DATABASE.writing(place, declare) as connection:
        stored, found, planned = _plan(connection, place)
        if (found, stored, planned) != (fingerprint, parameter, tuple(values)):
            remedy = f"holds another sweep, of {len(planned)} values, or data or options changed: give another file"
            raise InputError("store", str(path), remedy)

        def append(rows: Sequence[SweepRow]) -> None:
            with connection:
                for row in rows:
                    found = (row.number, str(row.status), row.message, row.accuracy, row.iterations, row.seconds)
                    connection.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?)", found)
                    for name, summary in row.contacts.items():
                        numbers = (summary.get(key) for key in SUMMARY_COLUMNS)
                        connection.execute(_CONTACT, (row.number, name, *numbers))

        query = "SELECT number, value FROM planned WHERE number NOT IN (SELECT number FROM results) ORDER BY number"
        yield connection.execute(query).fetchall(), append


def _plan(connection: sqlite3.Connection, path: Path) -> tuple[Parameter, str, tuple[float, ...]]:
    """Parameter, fingerprint of problem and options, and values of a store."""
    parameter: Any
    parameter, marked = connection.execute("SELECT parameter, fingerprint FROM sweep").fetchone() or ("", "")
    planned = connection.execute("SELECT number, value FROM planned ORDER BY number").fetchall()
    values, (run, _, digest) = tuple(value for _, value in planned), marked.partition(":")
    if [number for number, _ in planned] != [*range(1, len(planned) + 1)] or digest != _digest(run, parameter, values):
        remedy = "its parameter or values were changed after it was made: give another file"
        raise InputError("store", str(path), remedy)
    return parameter, run, values


def _digest(fingerprint: str, parameter: str, values: Sequence[float]) -> str:
    """SHA-256 of what a sweep was asked for, as hexadecimal text."""
    asked = (np.array(values, dtype="<f8") + 0.0).tobytes()  # SQLite keeps no −0.0
    return hashlib.sha256(f"{fingerprint}:{parameter}:".encode() + asked).hexdigest()
