"""SQLite files of rows: every row is on disk before the next one is computed, and only one run writes at a time.

SQLite uses its rollback journal here. A write-ahead log would need memory shared by all readers and writers, which
network folders do not offer, would keep the last rows in a second file, and would forbid reading in a read-only folder.
When a transaction ends, its rows and the file's entry in the folder are on disk (synchronous = EXTRA).

A run that writes holds a lock on an empty database beside its file, named .lock. The lock ends with the process,
however the process ends. Other processes can read meanwhile. The .lock file stays after the run: if a run removed it,
another run might just have opened it, and then two runs could write. It may be deleted when no run is at work.
"""

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from qvi_contact.basics.writing import replacing, writable_folder
from qvi_contact.errors import InputError

SETTINGS: Final = ("trusted_schema = OFF", "journal_mode = DELETE", "synchronous = EXTRA", "foreign_keys = ON")
_PATIENCE: Final = 30.0  # seconds that a writer waits for a reader

_OPEN: Final = "cannot be opened or written: give another place, or the right to write there"
_BUSY: Final = "another run is at work on it: wait until it has ended, or give another store"
_REMEDIES: Final = {
    sqlite3.SQLITE_FULL: "there is no room left: make room and give the same command again; finished rows are kept",
    sqlite3.SQLITE_READONLY: _OPEN,
    sqlite3.SQLITE_CANTOPEN: _OPEN,
    sqlite3.SQLITE_PERM: _OPEN,
    sqlite3.SQLITE_BUSY: _BUSY,
    sqlite3.SQLITE_LOCKED: _BUSY,
    sqlite3.SQLITE_CORRUPT: "is damaged: give another file, and save what the sqlite3 shell's .recover finds in it",
    sqlite3.SQLITE_CONSTRAINT: "has been written to by another process: end it, and give the same command again",
    sqlite3.SQLITE_IOERR: "the disk or network does not answer as it should: give the same command again later",
}


@dataclass(frozen=True)
class Database:
    """A kind of SQLite files. Its methods turn errors of SQLite into an `InputError` of "store", in one line."""

    what: str
    """What a file of this kind is called in messages, as "the store of a study"."""
    application: int
    """The files' application_id, which distinguishes them from other SQLite files."""
    schema: int
    """Version of the tables: the files' user_version."""
    tables: Sequence[str]
    """The SQL statements that create the tables."""
    rows: str
    """Name of the table of results. A file without results is replaced, as of a run that failed at once."""

    @contextmanager
    def writing(self, path: Path, fill: Callable[[sqlite3.Connection], object]) -> Iterator[sqlite3.Connection]:
        """A connection to a file, locked for other runs; the file is made if it is missing or has no rows.

        A new file gets its name only when it has its tables, and the rows that `fill` writes into them.
        """
        writable_folder(path.parent, "store")
        with locked(path), explained(path, self.what):
            rows = None
            if path.exists():
                with self.opened(path) as connection:
                    rows = connection.execute(f"SELECT * FROM {self.rows} LIMIT 1").fetchone()
            if rows is None:
                with replacing(path, "store") as temporary, self._connected(temporary) as connection:
                    connection.execute("BEGIN IMMEDIATE")
                    with connection:  # all or nothing
                        connection.execute(f"PRAGMA application_id = {self.application}")
                        connection.execute(f"PRAGMA user_version = {self.schema}")
                        for statement in self.tables:
                            connection.execute(statement)
                        fill(connection)
            with self.opened(path) as connection:
                # a test write, as a transaction can begin in a read-only file too
                connection.execute("BEGIN IMMEDIATE")
                connection.execute(f"PRAGMA user_version = {self.schema}")
                connection.rollback()
                yield connection

    @contextmanager
    def opened(self, path: Path) -> Iterator[sqlite3.Connection]:
        """A connection to an existing file, after checks that it is undamaged, and of this kind and version."""
        if not path.exists():
            raise InputError("store", str(path), f"there is no such file: give {self.what}")
        with explained(path, self.what), self._connected(path) as connection:
            pages, application, schema = (
                connection.execute(f"PRAGMA {name}").fetchone()[0]
                for name in ("page_count", "application_id", "user_version")
            )
            if pages == 0:
                raise InputError("store", str(path), f"is an empty file, not {self.what}: delete it, or give another")
            if application != self.application:
                raise InputError("store", str(path), f"is not {self.what}: give another file")
            if schema != self.schema:
                remedy = f"has tables of version {schema}, not {self.schema}: give another file, or use the release "
                raise InputError("store", str(path), f"{remedy}that wrote it")
            with closing(sqlite3.connect(":memory:")) as known:
                for statement in self.tables:
                    known.execute(statement)
                if _statements(connection) != _statements(known):  # a view in place of a table could run for ever
                    raise InputError("store", str(path), "its tables were changed after it was made: give another file")
            if connection.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
                raise damaged(path)
            yield connection

    @contextmanager
    def _connected(self, path: Path) -> Iterator[sqlite3.Connection]:
        address = f"{path.resolve().as_uri()}?mode=rw"
        with closing(sqlite3.connect(address, uri=True, timeout=_PATIENCE, isolation_level="IMMEDIATE")) as connection:
            try:
                for setting in SETTINGS:
                    connection.execute(f"PRAGMA {setting}")
            except UnicodeDecodeError as error:  # the file has bytes that are no text as a statement
                raise damaged(path) from error
            yield connection


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Lock a file for other runs in the block; `InputError` of "store" if another run holds the lock."""
    target = path.resolve()
    lock = target.with_name(f"{target.name}.lock")  # the file itself need not exist yet
    with ExitStack() as stack:
        with explained(path):
            connection = stack.enter_context(closing(sqlite3.connect(lock, timeout=0.0, isolation_level=None)))
            connection.execute("PRAGMA journal_mode = MEMORY")  # SIGKILL would leave a journal file behind
            connection.execute("BEGIN EXCLUSIVE")
        yield


@contextmanager
def explained(path: Path, what: str = "the lock of a store") -> Iterator[None]:
    """Turn errors of SQLite in the block into an `InputError` with a remedy, in one line."""
    try:
        yield
    except sqlite3.Error as error:
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF  # the primary code
        remedies = _REMEDIES | {sqlite3.SQLITE_NOTADB: f"is not {what}: give another file"}
        raise InputError("store", str(path), remedies.get(code, f"SQLite says: {error}")) from error


def damaged(path: Path) -> InputError:
    """The error about a damaged file."""
    return InputError("store", str(path), _REMEDIES[sqlite3.SQLITE_CORRUPT])


def _statements(connection: sqlite3.Connection) -> list[tuple[str, str, list[str]]]:
    """Kind, name and SQL words of each table, view, index and trigger."""
    objects = connection.execute("SELECT type, name, coalesce(sql, '') FROM sqlite_master ORDER BY type, name")
    return [(kind, name, statement.split()) for kind, name, statement in objects]
