"""The file that keeps a study's rows: an SQLite database, one transaction for each row.

The journal is SQLite's rollback journal, not its write-ahead log. Both survive SIGKILL and power failure, but the log
needs memory shared by all that read or write, which network folders do not offer, keeps the last rows in a second file
that is left behind when somebody copies the first, and cannot be read in a folder that is read-only. Its advantage,
readers that do not wait for the writer, is worth nothing at a few rows a second. A row is on disk, and its
place in the folder too (synchronous = EXTRA), before the next case is counted as begun.

One run at a time may write: it holds a lock on an empty database beside the store, through the locks of SQLite that
every system has and that go with the process, however it dies. Reading is possible meanwhile. That database, the file
.lock, stays: a run that removed it could take it from under another one that has just opened it, and a third would then
make a new one, so that two of them would write. It may be deleted when no run is at work.

A store without rows is nobody's: the next study takes it, so that a run which came to nothing stands in no one's way.
A new store gets its name when its tables are there; an empty file is somebody else's.
"""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from comparisons.lab.study.declaration import Case, Study, same_study
from comparisons.lab.study.differences import differences
from comparisons.lab.study.outcome import Outcome
from comparisons.lab.study.plain import canonical
from comparisons.lab.study.rows import Row, StoredStudy
from qvi_contact.basics.writing import replacing, writable_folder
from qvi_contact.errors import InputError

SCHEMA: Final = 1
"""Version of the tables, in the file's user_version."""

_APPLICATION: Final = 0x51564953  # "QVIS", in the file's application_id
_SETTINGS: tuple[str, ...] = ("journal_mode = DELETE", "synchronous = EXTRA", "foreign_keys = ON")
_PATIENCE: Final = 30.0  # seconds that a reader is waited for

_TABLES: Final = (
    "CREATE TABLE study (declaration TEXT NOT NULL, began TEXT NOT NULL)",
    "CREATE TABLE environments (number INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE)",
    """CREATE TABLE "rows" (
        position INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, "case" TEXT NOT NULL, status TEXT NOT NULL,
        reason TEXT NOT NULL, result TEXT NOT NULL, certificate TEXT NOT NULL, seconds REAL NOT NULL,
        finished TEXT NOT NULL, load_average REAL, environment INTEGER NOT NULL REFERENCES environments
    )""",
)
_READ: Final = """
    SELECT position, key, "case", status, reason, result, certificate, seconds, finished, load_average, content
    FROM "rows" JOIN environments ON environment = number ORDER BY position
"""
_WRITE: Final = """
    INSERT INTO "rows" SELECT ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, number FROM environments WHERE content = ?
"""

_REMEDIES: Final = {
    sqlite3.SQLITE_FULL: "there is no room left: make room and give the same command again; finished rows are kept",
    sqlite3.SQLITE_READONLY: "cannot be written: give another place, or the right to write there",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: give another place, or the right to write there",
    sqlite3.SQLITE_PERM: "cannot be opened: give another place, or the right to write there",
    sqlite3.SQLITE_BUSY: "in use by another process: wait until it has ended, or give another file",
    sqlite3.SQLITE_LOCKED: "in use by another process: wait until it has ended, or give another file",
    sqlite3.SQLITE_NOTADB: "is not the store of a study: give another file",
    sqlite3.SQLITE_CORRUPT: "is damaged: give another file, and save what the sqlite3 shell's .recover finds in it",
    sqlite3.SQLITE_CONSTRAINT: "has been written to by another process: end it, and give the same command again",
    sqlite3.SQLITE_IOERR: "the disk or network does not answer as it should: give the same command again later",
}


def read_study(path: str | Path) -> StoredStudy:
    """Declaration and rows of a store, which may belong to a run that goes on.

    Raises
    ------
    InputError
        If there is no such store, or it is damaged or of another version.

    """
    with _opened(Path(path)) as connection:
        declaration = _declaration(connection, Path(path))
        try:
            rows = tuple(_row(values) for values in connection.execute(_READ))
        except ValueError as error:
            raise _damaged(Path(path)) from error
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
    with _opened(path) as connection:
        return _keys(connection) if _is_of(connection, path, study) else set()


class Store:
    """A store that rows are appended to, see `writing`."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    def keys(self) -> set[str]:
        """Keys of the rows that are there."""
        with _explained(self.path):
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
        with _explained(self.path), self._connection:
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
    writable_folder(path.parent, "store")
    with _locked(path):
        if not path.exists():
            with replacing(path) as temporary, _opened(temporary) as connection:
                _make(connection, study)
        with _opened(path) as connection:
            if not _is_of(connection, path, study):
                _take(connection, study)
            _try_to_write(connection)
            yield Store(path, connection)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    target = path.resolve()
    lock = target.with_name(f"{target.name}.lock")
    try:
        with closing(sqlite3.connect(lock, timeout=0.0, isolation_level=None)) as connection:
            connection.execute("PRAGMA journal_mode = MEMORY")  # in a file, SIGKILL would leave it behind
            connection.execute("BEGIN EXCLUSIVE")
            yield
    except sqlite3.OperationalError as error:
        if error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY:
            remedy = "another run is at work on it: wait until it has ended, or give another file"
            raise InputError("store", str(path), remedy) from error
        raise _explanation(path, error) from error


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection, after a look whether the file is sound; what SQLite says about it becomes one line."""
    address = f"{path.resolve().as_uri()}?mode=rw"
    with (
        _explained(path),
        closing(sqlite3.connect(address, uri=True, timeout=_PATIENCE, isolation_level="IMMEDIATE")) as connection,
    ):
        for setting in _SETTINGS:
            connection.execute(f"PRAGMA {setting}")
        if connection.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise _damaged(path)
        yield connection


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    try:
        yield
    except sqlite3.Error as error:
        raise _explanation(path, error) from error


def _explanation(path: Path, error: sqlite3.Error) -> InputError:
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF  # without the extension
    return InputError("store", str(path), _REMEDIES.get(code, f"SQLite says: {error}"))


def _damaged(path: Path) -> InputError:
    return InputError("store", str(path), _REMEDIES[sqlite3.SQLITE_CORRUPT])


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
    ((pages,),) = connection.execute("PRAGMA page_count")
    if pages == 0:
        raise InputError("store", str(path), "is an empty file, not the store of a study: delete it, or give another")
    ((application,),) = connection.execute("PRAGMA application_id")
    ((schema,),) = connection.execute("PRAGMA user_version")
    if application != _APPLICATION:
        raise InputError("store", str(path), _REMEDIES[sqlite3.SQLITE_NOTADB])
    if schema != SCHEMA:
        remedy = f"has tables of version {schema}, not {SCHEMA}: give another file, or use the release that wrote it"
        raise InputError("store", str(path), remedy)
    try:
        ((text,),) = connection.execute("SELECT declaration FROM study")
        declaration: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise _damaged(path) from error
    return declaration


def _take(connection: sqlite3.Connection, study: Study) -> None:
    """Make a store without rows this study's: all or nothing."""
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        connection.execute("DELETE FROM study")
        _declare(connection, study)


def _make(connection: sqlite3.Connection, study: Study) -> None:
    """Fill an empty file with the tables, and make it this study's."""
    connection.execute("BEGIN IMMEDIATE")
    with connection:
        connection.execute(f"PRAGMA application_id = {_APPLICATION}")
        connection.execute(f"PRAGMA user_version = {SCHEMA}")
        for statement in _TABLES:
            connection.execute(statement)
        _declare(connection, study)


def _declare(connection: sqlite3.Connection, study: Study) -> None:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    connection.execute("INSERT INTO study VALUES (?, ?)", (canonical(study.declaration()), now))


def _try_to_write(connection: sqlite3.Connection) -> None:
    """Find out before any work whether that is possible; beginning alone is, with files that are read-only."""
    connection.execute("BEGIN IMMEDIATE")
    connection.execute(f"PRAGMA user_version = {SCHEMA}")
    connection.rollback()


def _keys(connection: sqlite3.Connection) -> set[str]:
    return {key for (key,) in connection.execute('SELECT key FROM "rows"')}


def _row(values: tuple[Any, ...]) -> Row:
    position, key, case, status, reason, result, certificate, seconds, finished, load, environment = values
    return Row(
        position, key, json.loads(case), status, reason, json.loads(result), json.loads(certificate), seconds,
        finished, load, json.loads(environment),
    )  # fmt: skip
