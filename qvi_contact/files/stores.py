"""Stores of what is done, from which the same command goes on: steps of a history, and rows of a sweep.

Steps are archives in a folder, one for each step that is done, written whole or not at all. `store.json` tells which
history it is: a digest of all its problems and options. Beside it stands `step-000001.npz` for the first step, and so
on. After an interruption the steps up to the first that is missing or damaged are kept.

Rows of a sweep are in an SQLite file, each on disk when its value is done. `planned` has all values, `results` and
`contacts` what is done, and the view `rows` joins them: one row for each value and contact, with the columns of
`ContactResult.forces_frame`. The fingerprint in `sweep` is that of problem and options, and behind a colon a digest of
parameter and values, which tells a file that was changed.
"""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from qvi_contact.basics.writing import given_path, writable_folder, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.files.archive import STORE, Archive, answer_from_archive, solution_arrays, write_archive
from qvi_contact.runs.database import Database
from qvi_contact.solution.history import CONTINUES
from qvi_contact.solution.result import PLATE_COLUMNS, ContactResult
from qvi_contact.solution.sweep import Parameter, SweepRow, SweepRows
from solvers import Status

# steps of a history

Restore = Callable[[int, Scales], Discretization]
"""The problem of a step, from 1, in these units, without earlier slip."""


class StepStore(Sequence[ContactResult]):
    """Results of so many planned steps, read when they are asked for; the last one read or added is at hand.

    The folder is made if it is missing, the fingerprint is a digest of problems and options, `restore` makes the
    problem of a step again, and `statuses` are those of each step there is. `InputError` if the folder cannot be
    written, or holds other files or another history; where a step is read, if its file is damaged or was changed.
    """

    def __init__(self, folder: str | Path, fingerprint: str, planned: int, restore: Restore) -> None:
        self._folder, self._fingerprint = writable_folder(folder, "store").absolute(), fingerprint
        self._restore = restore
        self._end: ContactResult | None = None  # a step that is not done, and in no file
        self._near: tuple[int, ContactResult] | None = None
        self._part: range | None = None  # numbers of steps, where only some are meant
        header = self._folder / "store.json"
        told = {"format": "qvi_contact steps", "version": 1, "fingerprint": fingerprint, "planned": planned}
        if header.exists():
            try:
                found: Any = json.loads(header.read_text(encoding="utf-8"))
            except (OSError, ValueError, RecursionError):
                found = None
            if not isinstance(found, dict) or not told.items() <= found.items():  # older ones say more
                remedy = "tells of no steps, or of another history, with other problems or options: give a new folder"
                raise InputError("store", str(header), remedy)
        elif any(not path.name.startswith(".writing-") for path in self._folder.iterdir()):  # a write cut short
            raise InputError("store", str(folder), "holds other files: give an empty folder, or a new name")
        else:
            write_text(header, json.dumps(told, indent=2) + "\n", "store")
        self.statuses: list[Status] = []
        while len(self.statuses) < planned:
            try:
                self.statuses.append(Status(self._archive(len(self.statuses) + 1).text("status")))
            except (InputError, ValueError):
                break

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            some = copy(self)
            some._part = self._numbers[index]
            return some
        number = self._numbers[index]
        if number == len(self.statuses) and self._end is not None:
            return self._end
        if self._near is None or self._near[0] != number:
            archive = self._archive(number)
            self._near = number, answer_from_archive(archive, lambda scales: self._restore(number, scales))
        return self._near[1]

    def append(self, result: ContactResult) -> None:
        """One more step: written if another may follow, else at hand only, as the end."""
        number = len(self.statuses) + 1
        if result.status in CONTINUES:
            entries = solution_arrays(result, tried=False) | {STORE: self._fingerprint}
            write_archive(self._path(number), entries, "store")
            self._near = number, result
        else:
            self._end = result
        self.statuses.append(result.status)

    @property
    def _numbers(self) -> range:
        return range(1, len(self.statuses) + 1) if self._part is None else self._part

    def _path(self, number: int) -> Path:
        return self._folder / f"step-{number:06}.npz"

    def _archive(self, number: int) -> Archive:
        """A step, as it was read."""
        archive = Archive(self._path(number))
        if not archive.intact or archive.text(STORE) != self._fingerprint:
            remedy = "was changed, or belongs to another history: delete the file, and run the history again"
            raise InputError("store", archive.path, remedy)
        return archive


# rows of a sweep

SUMMARY_COLUMNS: Final = (
    "normal_force", "tangential_force", "share_open", "share_stick", "share_slip",
    "largest_pressure", "largest_shear", "largest_gap", "largest_slip", *PLATE_COLUMNS,
)  # fmt: skip
"""Keys of `ContactLine.summary`, and those of plates and pins, which contacts without have no values for."""

_COLUMNS: Final = ", ".join(SUMMARY_COLUMNS)


def _of(kind: str, *names: str) -> str:
    """Columns of one kind; SQLite would keep anything in any column."""
    return ", ".join(f"{name} {kind} NOT NULL CHECK (typeof({name}) = '{kind.lower()}')" for name in names)


def _numbers(*names: str) -> str:
    """Columns of numbers that may be missing, as NaN is."""
    return ", ".join(f"{name} REAL CHECK (typeof({name}) IN ('real', 'null'))" for name in names)


_TABLES: Final = (
    f"""CREATE TABLE sweep (
        {_of("TEXT", "parameter", "fingerprint", "began")}, CHECK (parameter IN {get_args(Parameter)})
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
        SELECT number, value, status, iterations, accuracy, seconds, contact, {_COLUMNS}, message
        FROM planned JOIN results USING (number) LEFT JOIN contacts USING (number) ORDER BY number
    """,
)
_DATABASE: Final = Database("the store of a sweep", 0x51564957, 2, _TABLES, "results")  # "QVIW"

_CONTACT: Final = f"INSERT INTO contacts VALUES (?, ?, {', '.join('?' * len(SUMMARY_COLUMNS))})"
_DONE: Final = f"""
    SELECT number, value, status, message, iterations, accuracy, seconds, contact, {_COLUMNS}
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
def writing(
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
