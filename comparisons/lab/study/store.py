"""The file that keeps a study's rows: an SQLite database, one transaction for each row, see `basics.database`.

A store without rows is nobody's: the next study takes it, so that a run which came to nothing stands in no one's way.
A new store gets its name when its tables are there; an empty file is somebody else's.
"""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from comparisons.lab.study.declaration import Case, Study, same_study
from comparisons.lab.study.differences import differences
from comparisons.lab.study.rows import Row, StoredStudy
from comparisons.lab.worker.outcome import Outcome
from comparisons.lab.worker.plain import canonical
from qvi_contact.basics.database import Database
from qvi_contact.errors import InputError

SCHEMA: Final = 1
"""Version of the tables, in the file's user_version."""

_TABLES: Final = (
    "CREATE TABLE study (declaration TEXT NOT NULL, began TEXT NOT NULL)",
    "CREATE TABLE environments (number INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE)",
    """CREATE TABLE "rows" (
        position INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, "case" TEXT NOT NULL, status TEXT NOT NULL,
        reason TEXT NOT NULL, result TEXT NOT NULL, certificate TEXT NOT NULL, seconds REAL NOT NULL,
        finished TEXT NOT NULL, load_average REAL, environment INTEGER NOT NULL REFERENCES environments
    )""",
)
_DATABASE: Final = Database("the store of a study", 0x51564953, SCHEMA, _TABLES)  # "QVIS"

_READ: Final = """
    SELECT position, key, "case", status, reason, result, certificate, seconds, finished, load_average, content
    FROM "rows" JOIN environments ON environment = number ORDER BY position
"""
_WRITE: Final = """
    INSERT INTO "rows" SELECT ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, number FROM environments WHERE content = ?
"""


def read_study(path: str | Path) -> StoredStudy:
    """Declaration and rows of a store, which may belong to a run that goes on.

    Raises
    ------
    InputError
        If there is no such store, or it is damaged or of another version.

    """
    with _DATABASE.opened(Path(path)) as connection:
        declaration = _declaration(connection, Path(path))
        try:
            rows = tuple(_row(values) for values in connection.execute(_READ))
        except ValueError as error:
            raise _DATABASE.damaged(Path(path)) from error
        return StoredStudy(declaration, rows)


def finished_keys(path: Path, study: Study) -> set[str]:
    """Keys of the rows that a store has of this study; none if there is no store.

    Raises
    ------
    InputError
        If the file cannot be read, or is not a store of this study.

    """
    if not path.exists():
        return set()
    with _DATABASE.opened(path) as connection:
        return _keys(connection) if _is_of(connection, path, study) else set()


class Store:
    """A store that rows are appended to, see `writing`."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    def keys(self) -> set[str]:
        """Keys of the rows that are there."""
        with _DATABASE.explained(self.path):
            return _keys(self._connection)

    def append(self, case: Case, outcome: Outcome) -> None:
        """Write a row; when this returns, it is on disk.

        Raises
        ------
        InputError
            If that fails, or the row was there; the store is as it was.

        """
        environment = canonical(outcome.environment)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        values = (
            case.position, case.key, json.dumps(case.values), outcome.status, outcome.reason,
            json.dumps(outcome.result), json.dumps(outcome.certificate), outcome.seconds, now, outcome.load_average,
            environment,
        )  # fmt: skip
        with _DATABASE.explained(self.path), self._connection:
            self._connection.execute("INSERT OR IGNORE INTO environments (content) VALUES (?)", (environment,))
            self._connection.execute(_WRITE, values)


@contextmanager
def writing(path: Path, study: Study) -> Iterator[Store]:
    """Open a store for appending, made if it is missing, and keep all other runs away from it.

    Raises
    ------
    InputError
        If it cannot be written, is in use, damaged, or not a store of this study.

    """
    with _DATABASE.writing(path, lambda empty: _declare(empty, study)) as connection:
        if not _is_of(connection, path, study):
            _take(connection, study)
        _DATABASE.try_to_write(connection)
        yield Store(path, connection)


def _is_of(connection: sqlite3.Connection, path: Path, study: Study) -> bool:
    """Whether the store is this study's; False if it is still nobody's, having no rows."""
    found = _declaration(connection, path)
    wanted = study.declaration()
    if same_study(found, wanted):
        return True
    if connection.execute('SELECT EXISTS (SELECT * FROM "rows")').fetchone() == (0,):
        return False
    names = [f"{each['name']} (version {each['version']})" for each in (found, wanted)]
    same = names[0] == names[1]
    other = f"{names[0]} with other settings ({differences(found, wanted)})" if same else names[0]
    raise InputError("store", str(path), f"belongs to the study {other}: give another file")


def _declaration(connection: sqlite3.Connection, path: Path) -> dict[str, Any]:
    """What the store says of its study."""
    _DATABASE.check(connection, path)
    try:
        ((text,),) = connection.execute("SELECT declaration FROM study")
        declaration: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise _DATABASE.damaged(path) from error
    return declaration


def _take(connection: sqlite3.Connection, study: Study) -> None:
    """Make a store without rows this study's: all or nothing."""
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        connection.execute("DELETE FROM study")
        _declare(connection, study)


def _declare(connection: sqlite3.Connection, study: Study) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    connection.execute("INSERT INTO study VALUES (?, ?)", (canonical(study.declaration()), now))


def _keys(connection: sqlite3.Connection) -> set[str]:
    return {key for (key,) in connection.execute('SELECT key FROM "rows"')}


def _row(values: tuple[Any, ...]) -> Row:
    position, key, case, status, reason, result, certificate, seconds, finished, load, environment = values
    return Row(
        position, key, json.loads(case), status, reason, json.loads(result), json.loads(certificate), seconds,
        finished, load, json.loads(environment),
    )  # fmt: skip
