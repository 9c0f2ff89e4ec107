"""Rows of a study: in the file that keeps them, as objects, as a frame, as CSV.

The store is an SQLite file, one transaction for each row, see `runs.database`.
"""

import csv
import gzip
import io
import json
import math
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.study.declaration import Case, Study, canonical, differences, same_study
from qvi_contact.basics.writing import replacing
from qvi_contact.errors import InputError
from qvi_contact.runs.database import Database
from qvi_contact.runs.processes import Outcome

if TYPE_CHECKING:
    from pandas import DataFrame, Series

DONE: Final = "done"
"""Status of a row with a result; all others are in `qvi_contact.runs.FAILURES`."""

ENVIRONMENT: Final = ("threads", "timeout_seconds", "memory_mib", "machine", "versions")
"""Entries of a row's environment, in the order of their columns."""

_OWN: Final = frozenset({
    "position", "key", "status", "reason", "seconds", "finished", "load_average", "certificate",
})  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What became of one case, as it is stored.

    Position, key and case are those of `declaration.Case`, status, reason, seconds and load_average those of
    `qvi_contact.runs.Outcome`.

    Attributes
    ----------
    result : Mapping
        What the task returned, without its entry "certificate"; empty if it failed.
    certificate : object
        That entry, None if there was none.
    finished : str
        Date and time, UTC.
    environment : Mapping
        See `ENVIRONMENT`.

    """

    position: int
    key: str
    case: Mapping[str, Any]
    status: str
    reason: str
    result: Mapping[str, Any]
    certificate: Any
    seconds: float
    finished: str
    load_average: float | None
    environment: Mapping[str, Any]

    def flat(self) -> dict[str, Any]:
        """Column → value; entries of result and certificate are "result.…" and "certificate.…"."""
        return {
            "position": self.position, "key": self.key, **self.case, "status": self.status, "reason": self.reason,
            **{f"result.{name}": value for name, value in self.result.items()}, **self._certificate(),
            "seconds": self.seconds, "finished": self.finished, "load_average": self.load_average,
            **{name: self.environment[name] for name in ENVIRONMENT},
        }  # fmt: skip

    def _certificate(self) -> dict[str, Any]:
        if isinstance(self.certificate, Mapping):
            return {f"certificate.{name}": value for name, value in self.certificate.items()}
        return {} if self.certificate is None else {"certificate": self.certificate}


@dataclass(frozen=True)
class StoredStudy:
    """A study's declaration (see `Study.declaration`) and the rows there are, in the order of the study."""

    declaration: Mapping[str, Any]
    rows: tuple[Row, ...]


def frame_of(rows: Sequence[Row], numbers: Sequence[str] = (), others: Sequence[str] = ()) -> "DataFrame":
    """One line a row, in the order of the study: the factors of the case, and the entries of the result.

    Besides "status", that which the task tells or else the row's, "reason", "spent", its seconds, "has", whether there
    is a result, and "accuracy", which the certificate confirms. The columns `numbers` and `others` are there in any
    case, those as numbers, NaN where a row has none.
    """
    from pandas import DataFrame, to_numeric

    found = DataFrame([_line(row) for row in sorted(rows, key=lambda row: row.position)])
    missing = [name for name in ("accuracy", *numbers, *others) if name not in found]
    found[missing] = DataFrame(float("nan"), found.index, missing, dtype=object)
    for name in ("accuracy", *numbers):
        found[name] = to_numeric(found[name])
    return found


def _line(row: Row) -> dict[str, Any]:
    known = {"reason": row.reason, "spent": row.seconds, "has": bool(row.result)}
    known["status"] = row.result.get("status", DONE) if row.status == DONE else row.status
    accuracy = row.certificate.get("accuracy") if isinstance(row.certificate, Mapping) else None
    return {**row.case, **row.result, **known, "accuracy": accuracy}


def largest_of(values: "Series", frame: "DataFrame") -> dict[Any, Any]:
    """The line of the frame with the largest of these values, by columns; without any, one that has nothing."""
    return dict.fromkeys(frame) if values.dropna().empty else frame.loc[values.idxmax()].to_dict()


def write_csv(path: str | Path, rows: Sequence[Row]) -> None:
    """One line for each row, compressed if the name ends in ".gz"; the same bytes for the same rows.

    All but texts is JSON, and so are texts that could be taken for it; a row that has no such entry has nothing there.
    """
    flat = [row.flat() for row in rows]
    names = list(dict.fromkeys(name for each in flat for name in each))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(each[name]) if name in each else "" for name in names] for each in flat)
    content = text.getvalue().encode()
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(gzip.compress(content, mtime=0) if Path(path).suffix == ".gz" else content)


def read_csv(path: str | Path) -> tuple[Row, ...]:
    """The rows that `write_csv` wrote; what stands in several of them, as their machine, is one object."""
    content = Path(path).read_bytes()
    text = (gzip.decompress(content) if Path(path).suffix == ".gz" else content).decode()
    lines, value = csv.DictReader(io.StringIO(text, newline="")), cache(_value)
    return tuple(_unflat({name: value(cell) for name, cell in line.items() if cell}) for line in lines)


def _cell(value: Any) -> str:
    if not isinstance(value, str) or not value or "\r" in value:  # a bare "\r" would end the line
        return json.dumps(value, sort_keys=True)
    return value if _value(value) is value else json.dumps(value)


def _value(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _unflat(flat: Mapping[str, Any]) -> Row:
    """The row of which this is the `flat`."""
    parts: dict[str, Any] = {"result": {}, "certificate": {}, "environment": {}, "case": {}}
    for name, value in flat.items():
        part, dot, entry = name.partition(".")
        if dot:
            parts[part][entry] = value
        elif name in ENVIRONMENT:
            parts["environment"][name] = value
        elif name in _OWN:
            parts[name] = value
        else:
            parts["case"][name] = value
    return Row(**(parts | {"certificate": parts["certificate"] or None}))


def finite_json(value: Any, null: bool = False) -> Any:
    """The value for JSON, in mappings and sequences too: numbers JSON has not are "nan", "inf" and "-inf", or None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None if null else str(value)
    if isinstance(value, Mapping):
        return {name: finite_json(item, null) for name, item in value.items()}
    return [finite_json(item, null) for item in value] if isinstance(value, list | tuple) else value


_TABLES: Final = (
    "CREATE TABLE study (declaration TEXT NOT NULL, began TEXT NOT NULL)",
    "CREATE TABLE environments (number INTEGER PRIMARY KEY, content TEXT NOT NULL UNIQUE)",
    """CREATE TABLE "rows" (
        position INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, "case" TEXT NOT NULL, status TEXT NOT NULL,
        reason TEXT NOT NULL, result TEXT NOT NULL, certificate TEXT NOT NULL, seconds REAL NOT NULL,
        finished TEXT NOT NULL, load_average REAL, environment INTEGER NOT NULL REFERENCES environments
    )""",
)
_DATABASE: Final = Database("the store of a study", 0x51564953, 1, _TABLES, '"rows"')  # "QVIS"

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
        keys = _keys(connection)
        if keys:  # without rows it is nobody's
            _refuse_other(connection, path, study)
        return keys


class Store:
    """A store that rows are appended to, see `writing`."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self.path = path
        self._connection = connection

    def keys(self) -> set[str]:
        """Keys of the rows that are there."""
        with _DATABASE.explained(self.path):
            return _keys(self._connection)

    def append(self, case: Case, outcome: Outcome, environment: Mapping[str, Any]) -> None:
        """Write a row; when this returns, it is on disk.

        The value of an outcome is the result, a mapping, in which the entry "certificate" is kept apart.

        Raises
        ------
        InputError
            If that fails, or the row was there; the store is as it was.

        """
        surroundings, result = canonical(environment), dict(outcome.value or {})
        certificate = result.pop("certificate", None)
        now = datetime.now(UTC).isoformat(timespec="seconds")
        values = (
            case.position, case.key, json.dumps(case.values), outcome.status, outcome.reason,
            json.dumps(result), json.dumps(certificate), outcome.seconds, now, outcome.load_average, surroundings,
        )  # fmt: skip
        with _DATABASE.explained(self.path), self._connection:
            self._connection.execute("INSERT OR IGNORE INTO environments (content) VALUES (?)", (surroundings,))
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
        _refuse_other(connection, path, study)
        yield Store(path, connection)


def _refuse_other(connection: sqlite3.Connection, path: Path, study: Study) -> None:
    """Refuse the store of another study."""
    found = _declaration(connection, path)
    wanted = study.declaration()
    if same_study(found, wanted):
        return
    names = [f"{each['name']} (version {each['version']})" for each in (found, wanted)]
    same = names[0] == names[1]
    other = f"{names[0]} with other settings ({differences(found, wanted)})" if same else names[0]
    raise InputError("store", str(path), f"belongs to the study {other}: give another file")


def _declaration(connection: sqlite3.Connection, path: Path) -> dict[str, Any]:
    """What the store says of its study."""
    try:
        ((text,),) = connection.execute("SELECT declaration FROM study")
        declaration: dict[str, Any] = json.loads(text)
    except ValueError as error:
        raise _DATABASE.damaged(path) from error
    return declaration


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
