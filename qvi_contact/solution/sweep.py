"""Sweeps: one problem for several values of friction, load, gap or offset, with one factorisation for all.

Results are kept in memory, or rows of numbers in a file, from which an interrupted sweep continues.
"""

from __future__ import annotations

import hashlib
import math
import pickle
import sqlite3
import time
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
from qvi_contact.basics.schema import LARGEST, WithFields
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
from qvi_contact.solution.solver import solved
from qvi_contact.units import Units
from solvers import Status
from solvers.basics.progress import Log, deadline
from solvers.basics.types import frame, load, pandas

if TYPE_CHECKING:
    from pandas import DataFrame

_COLUMNS: Final = {"step": ">5", "value": ">12g", "status": "<20", "iterations": ">10", "accuracy": ">9.1e"}
_LARGEST: Final = 50  # most values in a slice: rows are stored slice by slice
_SLICES: Final = 4  # least number of slices for each worker, so that all end at about the same time
_LEAST: Final = 1e-3  # seconds for a slice that begins after the time limit
_GRACE: Final = 30.0  # seconds after the time limit at which a worker process is ended


@dataclass(frozen=True)
class SweepRow(WithFields):
    """One value of a sweep."""

    number: int
    """Position of the value in the sweep, from 1."""
    value: float
    status: Status
    """Status of its result."""
    message: str
    """One sentence about the outcome."""
    iterations: int
    """Iterations of the method."""
    accuracy: float
    """Accuracy by the certificate, dimensionless."""
    seconds: float
    """Wall time of the solve [s]."""
    contacts: Mapping[str, Mapping[str, float]]
    """`ContactLine.summary` by contact, with motion, force and moment of a plate or pin; empty without a state."""

    @classmethod
    def of(cls, number: int, value: float, result: ContactResult, seconds: float = 0.0) -> SweepRow:
        """The row of a result."""
        contacts = contact_numbers(result) if result.has_state else {}
        accuracy = result.certificate.accuracy
        return cls(number, value, result.status, result.message, result.iterations, accuracy, seconds, contacts)


@dataclass(frozen=True, eq=False)
class SweepRows(WithFields):
    """Statuses and tables of a sweep, whether its results are in memory or its rows in a file."""

    parameter: Parameter
    """The name of the datum that is changed."""
    values: tuple[float, ...]
    """All values asked for, done or not."""
    _unfinished: ClassVar[str] = f"time limit after {{}} of {{}} values. {Status.TIME_LIMIT.advice}"

    def rows(self) -> Iterator[SweepRow]:
        """The rows of all values that are done, in the order of the values."""
        raise NotImplementedError

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
        length = Units.labels(units, {name: "displacement" if name in ("gap", "offset") else ""})
        return frame(pandas().DataFrame(lines), {**forces_units(units), **length})


@dataclass(frozen=True, eq=False)
class Sweep(SweepRows):
    """Results of a sweep, one for each value that was done."""

    steps: tuple[ContactResult, ...]
    """The results in the order of the values; fewer than values if the time limit was reached."""

    def rows(self) -> Iterator[SweepRow]:
        """The rows of all values that are done, in the order of the values; their seconds are 0."""
        for number, (value, step) in enumerate(zip(self.values, self.steps, strict=False), 1):
            yield SweepRow.of(number, value, step)

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each value done, in the order of the values."""
        return tuple(step.status for step in self.steps)


@overload
def solve_sweep(
    problem: ContactProblem, parameter: Parameter, values: Sequence[float], of: Sequence[str] | None = None,
    callback: Callable[[int, ContactResult], object] | None = None, settings: Settings | None = None, *,
    store: None = None, **changes: Any,
) -> Sweep: ...  # fmt: skip


@overload
def solve_sweep(
    problem: ContactProblem, parameter: Parameter, values: Sequence[float], of: Sequence[str] | None = None,
    callback: Callable[[int, SweepRow], object] | None = None, settings: Settings | None = None, *,
    store: str | Path, **changes: Any,
) -> StoredSweep: ...  # fmt: skip


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

    Each value is a separate problem, without a memory of slip; matrices and starts are reused to save time. If there
    are several solutions, the one found may depend on the value before: sort the values as the body would be loaded.

    With a `store` no result is kept. A row of numbers for each value and contact is on the disk as soon as the value
    is done, so that memory does not grow with the number of values. The same call continues an interrupted sweep. A
    value that was not solved has a row too, and is not tried again; a value cut short by the time limit has no row.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    parameter : "friction", "load", "gap" or "offset"
        "friction": the coefficient μ of contacts, which replaces their own; "load": a factor of loads; "gap", "offset":
        a length that is added to these data of contacts.
    values : sequence of float
        Values of the parameter, in the order in which they are solved.
    of : sequence of str, optional
        Names of the contacts that are changed, by default all but tied ones; for "load" names of the loads, as for
        `limit_load_factor`, by default all.
    callback : callable, optional
        Called with the number of each value, from 1, and its result; with a store, its `SweepRow` instead, and not for
        values that were in the file before.
    settings : Settings, optional
        How to discretise and solve all of them.
    store : str or Path, optional
        An SQLite file, made if it is missing.
    workers : int
        Processes of this machine that share the values of a sweep with a store. Each process solves slices of
        neighbouring values on one thread, and keeps its factorisation. The rows of a slice are written when it is done.
        If a process dies, its values are solved again one by one. A value at which a process dies twice gets the status
        "backend_failed" or "out_of_memory", and the sweep continues.
    dask : str, optional
        Address of the scheduler of a Dask cluster that is used instead, as tcp://host:8786.
    warm_start : bool
        Whether methods that accept a start begin at the state of the value before.
    **changes
        Fields of `Settings`, and options of the method.

    Returns
    -------
    Sweep or StoredSweep
        A `StoredSweep` with a store. Values that are not solved do not end the sweep.

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
        truths = asked.ndim == 1 and any(isinstance(each, bool | np.bool_) for each in values)
        if asked.ndim != 1 or not len(asked) or truths or not (np.abs(asked) <= LARGEST).all():
            raise InputError("values", values, remedy)
        if parameter == "friction" and asked.min() < 0.0:
            raise InputError("values", float(asked.min()), "give coefficients of friction ≥ 0")
        numbers = tuple(asked.tolist())
        log.begin({"values": len(numbers), "parameter": parameter, "cells": task.problem.mesh.cell_count})

        def report(number: int, result: ContactResult | SweepRow, accuracy: float) -> None:
            log.line(number, numbers[number - 1], str(result.status), result.iterations, accuracy)
            if callback is not None:
                callback(number, result)

        sweep: Sweep | StoredSweep
        if store is None:
            steps = list[ContactResult]()
            for number, _, result, _ in task.results(enumerate(numbers, 1), at_least=1):
                steps.append(result)
                report(number, result, result.certificate.accuracy)
            sweep = Sweep(parameter, numbers, tuple(steps))
        else:
            data = {"parameter": task.parameter, "of": task.names, "values": numbers, "warm_start": task.warm}
            fingerprint = run_digest([task.problem], {**settings.stated, **data})
            with (
                _writing(store, fingerprint, parameter, numbers) as (pending, append),
                closing(_rows(task, pending, shared)) as slices,
            ):
                for rows in slices:
                    append(rows)
                    for row in rows:
                        report(row.number, row, row.accuracy)
            sweep = read_sweep(store)
        log.end(str(sweep.status), sweep.message, {}, sweep.status is Status.SOLVED)
        return sweep


@dataclass(eq=False)
class SweepTask:
    """Solves the values of a sweep one after the other, on one factorisation; processes each have a copy.

    A value starts from the state of the value before. If the method finds that state too far away, as often where
    contact zones grow with each value, the start has cost an iteration or two of about twelve.
    """

    problem: ContactProblem
    parameter: Parameter
    names: tuple[str, ...]  # the contacts or loads that are changed
    settings: Settings = field(default_factory=Settings)
    warm: bool = False  # whether to start from the state of the value before
    end: float = math.inf  # time limit by `time.time`, which the machines of a cluster share
    _before: Discretization | None = field(default=None, init=False)  # of the last value
    _state: ContactResult | None = field(default=None, init=False)  # of the last value that was solved

    @classmethod
    def of(
        cls, problem: ContactProblem, parameter: Parameter, names: Sequence[str] | None, settings: Settings, *,
        warm: bool,
    ) -> SweepTask:  # fmt: skip
        """The task of checked arguments of `solve_sweep`."""
        instance_of(ContactProblem, "problem", problem)
        one_of("parameter", parameter, PARAMETERS)
        tied_too = parameter in ("gap", "offset") and names is not None
        known = [contact.name for contact in problem.contacts if tied_too or contact.law != "tied"]
        what = "contacts" if tied_too else "contacts that could open or slip"
        if parameter == "load":
            limit = load("qvi_contact.limit.load_factor")  # which commands that solve once need not load
            chosen = limit.checked_loads(problem, limit.loads_of(problem) if names is None else names, "of")
        elif not known:
            raise InputError("parameter", parameter, "no contact could open or slip: sweep 'load'")
        elif names is None:
            chosen = tuple(known)
        else:
            chosen = names_among("of", names, what, known)
        return cls(problem, parameter, chosen, settings, true_or_false("warm_start", warm) and settings.takes_state)

    def changed(self, value: float) -> ContactProblem:
        """The problem with this value."""
        if self.parameter == "load":
            problem: ContactProblem = load("qvi_contact.limit.load_factor").multiplied(self.problem, self.names, value)
            return problem

        def with_value(contact: Contact) -> Contact:
            given = 0.0 if self.parameter == "friction" else getattr(contact, self.parameter)
            new: Any = {self.parameter: plus(given, value)}
            return replace(contact, **new) if contact.name in self.names else contact

        return with_contacts(self.problem, with_value)

    def results(
        self, planned: Iterable[tuple[int, float]], at_least: int = 0
    ) -> Iterator[tuple[int, float, ContactResult, float]]:
        """Number, value, result and seconds of planned numbers and values, `at_least` so many, until the deadline."""
        for count, (number, value) in enumerate(planned):
            if count >= at_least and deadline.over:
                return
            began, problem, before = time.perf_counter(), self.changed(value), self._before
            stated: ContactProblem | Discretization = problem
            if before is not None and laws_vary(problem) == laws_vary(before.problem):  # the same default rule
                stated = before.with_law(problem) if self.parameter == "friction" else before.with_data(problem)
            result = solved(stated, self.settings, self._state if self.warm else None)
            is_near = math.isfinite(result.discretization.scales.reach)  # the next body may not meet far obstacles
            self._before = result.discretization if is_near else None
            if result.status is Status.SOLVED:
                self._state = result
            yield number, value, result, time.perf_counter() - began

    def rows(self, planned: Sequence[tuple[int, float]]) -> list[SweepRow]:
        """The rows of a slice of numbers and neighbouring values; a value cut short by the time limit has no row."""
        rows, seconds = list[SweepRow](), max(self.end - time.time(), _LEAST)
        with deadline(seconds if seconds < math.inf else None):
            for number, value, result, taken in self.results(planned):
                if result.status is Status.TIME_LIMIT:
                    break
                rows.append(SweepRow.of(number, value, result, taken))
        return rows


def _rows(task: SweepTask, planned: Sequence[tuple[int, float]], workers: Workers) -> Generator[Sequence[SweepRow]]:
    """Rows of planned numbers and values, slice by slice as they are done, until the deadline.

    If a process is lost, the values of its slice are solved again one by one, to find the value that ends it.
    """
    if workers == Workers() or not planned:
        yield from filter(None, (task.rows([each]) for each in planned))
        return
    seconds = deadline.left
    limits = Limits(seconds + _GRACE if seconds < math.inf else None)
    try:
        settings = replace(task.settings, threads=task.settings.threads or 1)
        shared = replace(task, settings=settings, end=time.time() + seconds)  # a process keeps it for all its slices
        job = pickle.dumps(partial(tuple, (None, shared.rows)))
    except InputError:  # it names the function of the problem that cannot be pickled
        raise
    except Exception as error:  # pickle raises PicklingError, AttributeError or TypeError
        remedy = f"cannot be sent to other processes: give a function of a module as callback ({error})"
        raise InputError("settings", task.settings, remedy) from error
    try:
        with workers.ready(job, limits) as (size, outcomes):
            length = min(_LARGEST, max(1, math.ceil(len(planned) / (_SLICES * size))))
            slices = deque(planned[i : i + length] for i in range(0, len(planned), length))
            with closing(outcomes(slices)) as ended:
                for part, outcome in ended:
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
        remedy = "cannot be sent to other processes: give Expression or Polynomial for functions, or those of modules"
        raise InputError("problem", task.problem, f"{remedy} ({error.reason})") from error


# The SQLite file of a sweep. The table `planned` has all values, `results` and `contacts` the rows of values that are
# done, and the view `rows` joins them: one row for each value and contact, with the columns of
# `ContactResult.forces_frame`. The fingerprint in `sweep` is a digest of problem and options, a colon, and a digest of
# parameter and values, by which a file that was changed is recognised; so is a row in `results` by its own digest.

SUMMARY_COLUMNS: Final = (
    "normal_force", "tangential_force", "share_open", "share_stick", "share_slip",
    "largest_pressure", "largest_shear", "largest_gap", "largest_slip", *PLATE_COLUMNS,
)  # fmt: skip
"""Keys of `ContactLine.summary`, and columns of plates and pins, empty for other contacts."""

_STORED: Final = ", ".join(SUMMARY_COLUMNS)


def _of(kind: str, *names: str) -> str:
    """Columns of one SQL type, checked, as SQLite would store any type in any column."""
    return ", ".join(f"{name} {kind} NOT NULL CHECK (typeof({name}) = '{kind.lower()}')" for name in names)


def _numbers(*names: str) -> str:
    """Columns of numbers that may be NULL, as NaN is stored."""
    return ", ".join(f"{name} REAL CHECK (typeof({name}) IN ('real', 'null'))" for name in names)


_TABLES: Final = (
    f"""CREATE TABLE sweep (
        {_of("TEXT", "parameter", "fingerprint", "began")}, CHECK (parameter IN {PARAMETERS})
    )""",
    f"CREATE TABLE planned (number INTEGER PRIMARY KEY, {_of('REAL', 'value')})",
    f"""CREATE TABLE results (
        number INTEGER PRIMARY KEY REFERENCES planned, {_of("TEXT", "status", "message")},
        {_of("INTEGER", "iterations")}, {_numbers("accuracy")}, {_of("REAL", "seconds")}, {_of("TEXT", "digest")},
        CHECK (status IN {tuple(map(str, Status))})
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
_DATABASE: Final = Database("the store of a sweep", 0x51564957, 3, _TABLES, "results")  # "QVIW"

_CONTACT: Final = f"INSERT INTO contacts VALUES (?, ?, {', '.join('?' * len(SUMMARY_COLUMNS))})"
_DONE: Final = f"""
    SELECT number, value, status, message, iterations, accuracy, seconds, digest, contact, {_STORED}
    FROM planned JOIN results USING (number) LEFT JOIN contacts USING (number) ORDER BY number, contacts.rowid
"""


@dataclass(frozen=True)
class StoredSweep(SweepRows):
    """A sweep whose rows are in a file, which is read on each access; `InputError` if it is gone or damaged."""

    path: Path
    """The file."""
    _unfinished = "{} of {} values are done: a run works, was stopped, or reached its time limit. The same call goes on"

    def rows(self) -> Iterator[SweepRow]:
        """The rows of all values that are done, in the order of the values."""
        with _DATABASE.opened(self.path) as connection:
            for (number, value, status, message, count, accuracy, seconds), parts, is_intact in _stored(connection):
                if not is_intact:
                    remedy = f"its row {number} was changed after it was written: repeat the sweep to solve it again"
                    raise InputError("store", str(self.path), remedy)
                named = {name: zip(SUMMARY_COLUMNS, numbers, strict=True) for name, *numbers in parts}
                contacts = {name: {key: x for key, x in pairs if x is not None} for name, pairs in named.items()}
                accuracy = math.nan if accuracy is None else accuracy
                yield SweepRow(number, value, Status(status), message, count, accuracy, seconds, contacts)


def read_sweep(path: str | Path) -> StoredSweep:
    """The sweep in a store, also while a run writes it; `InputError` if the file is missing or damaged."""
    place = _place(path)
    with _DATABASE.opened(place) as connection:
        parameter, _, values = _plan(connection, place)
    return StoredSweep(parameter, values, place)


def _place(path: str | Path) -> Path:
    """The absolute path of a file that the caller named; `InputError` if no file can have this name."""
    place = given_path("store", path)
    try:
        place = place.absolute()
        place.resolve().exists()
    except (OSError, ValueError, RuntimeError) as error:  # RuntimeError for a circle of links
        raise InputError("store", str(path), f"no file can have this name ({error}): give another") from error
    return place


@contextmanager
def _writing(
    path: str | Path, fingerprint: str, parameter: Parameter, values: Sequence[float]
) -> Iterator[tuple[list[tuple[int, float]], Callable[[Sequence[SweepRow]], None]]]:
    """Open the store of a sweep, made if it is missing, and lock it for other runs.

    Yields the numbers, from 1, and values that are not done, and a function that appends rows: either all of them are
    on disk then, or none. `InputError` if the store cannot be written, is in use, damaged, or holds another sweep.
    """
    place = _place(path)
    if place.is_dir() or not place.name:
        raise InputError("store", str(path), "is a folder: give the name of a file, such as sweep.sqlite")

    marked = f"{fingerprint}:{_digest(fingerprint, parameter, values)}"

    def declare(empty: sqlite3.Connection) -> None:
        began = datetime.now(UTC).isoformat(timespec="seconds")
        empty.execute("INSERT INTO sweep VALUES (?, ?, ?)", (parameter, marked, began))
        empty.executemany("INSERT INTO planned VALUES (?, ?)", enumerate(values, 1))

    with _DATABASE.writing(place, declare) as connection:
        stored_parameter, stored_run, planned = _plan(connection, place)
        if (stored_run, stored_parameter, planned) != (fingerprint, parameter, tuple(values)):
            remedy = f"holds another sweep, of {len(planned)} values, or data or options changed: give another file"
            raise InputError("store", str(path), remedy)

        with connection:  # rows that were changed are solved again
            changed = [(row[0],) for row, _, is_intact in _stored(connection) if not is_intact]
            connection.executemany("DELETE FROM results WHERE number = ?", changed)
            connection.execute("DELETE FROM contacts WHERE number NOT IN (SELECT number FROM results)")

        def append(rows: Sequence[SweepRow]) -> None:
            with connection:
                for each in rows:
                    texts, numbers = (str(each.status), each.message), map(_as_stored, (each.accuracy, each.seconds))
                    row = each.number, _as_stored(each.value), *texts, each.iterations, *numbers
                    contacts = list[tuple[Any, ...]]()
                    for name, summary in each.contacts.items():
                        contacts.append((name, *(_as_stored(summary.get(key)) for key in SUMMARY_COLUMNS)))
                    columns = (row[0], *row[2:], _row_digest(marked, row, contacts))
                    connection.execute("INSERT INTO results VALUES (?, ?, ?, ?, ?, ?, ?)", columns)
                    connection.executemany(_CONTACT, [(each.number, *contact) for contact in contacts])

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


def _stored(connection: sqlite3.Connection) -> Iterator[tuple[list[Any], list[tuple[Any, ...]], bool]]:
    """Each row that is done, from its number to its seconds; name and numbers of its contacts; whether it is intact."""
    (marked,) = connection.execute("SELECT fingerprint FROM sweep").fetchone() or ("",)
    for (*row, digest), parts in groupby(connection.execute(_DONE), lambda line: line[:8]):
        contacts = [part[8:] for part in parts if part[8] is not None]
        yield row, contacts, digest == _row_digest(marked, row, contacts)


def _as_stored(number: float | None) -> float | None:
    """The number as SQLite returns it: NaN as None, −0.0 as 0.0."""
    return None if number is None or math.isnan(number) else float(number) + 0.0


def _row_digest(marked: str, row: Sequence[Any], contacts: Sequence[Sequence[Any]]) -> str:
    """SHA-256 of a row and its contacts in the store with this fingerprint, as hexadecimal text."""
    return hashlib.sha256(repr((marked, [*row], [[*contact] for contact in contacts])).encode()).hexdigest()


def _digest(fingerprint: str, parameter: str, values: Sequence[float]) -> str:
    """SHA-256 of fingerprint, parameter and values, as hexadecimal text."""
    stored = (np.array(values, dtype="<f8") + 0.0).tobytes()  # SQLite stores −0.0 as 0.0
    return hashlib.sha256(f"{fingerprint}:{parameter}:".encode() + stored).hexdigest()
