"""Rows of a study as they are read back: objects, columns, CSV, JSON."""

import csv
import gzip
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from qvi_contact.basics.writing import replacing, write_text

FORMAT: Final = "qvi-contact/study/1"
"""Schema of the exported JSON."""

ENVIRONMENT: Final = ("threads", "timeout_seconds", "memory_mib", "machine", "versions")
"""Entries of a row's environment, in the order of their columns."""

_OWN: Final = frozenset({
    "position", "key", "status", "reason", "seconds", "finished", "load_average", "certificate",
})  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What became of one case.

    Attributes
    ----------
    position : int
        Place of the case in the study.
    key : str
        Its key, see `declaration.case_key`.
    case : Mapping
        Factor → value, and "repeat" and "seed".
    status : str
        "done", or one of `outcome.FAILURES`.
    reason : str
        Why there is no result; empty if there is one.
    result : Mapping
        What the task returned.
    certificate : object
        What it said of the certificate, None if nothing.
    seconds : float
        Wall time of the task alone, or until it was ended.
    finished : str
        Date and time, UTC.
    load_average : float, optional
        Processes that wanted to run on the machine in the minute before.
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


def columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """Column → its values, None where a row has none; the columns in the order they are met, see `Row.flat`."""
    flat = [row.flat() for row in rows]
    names = dict.fromkeys(name for each in flat for name in each)
    return {name: [each.get(name) for each in flat] for name in names}


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
    """The rows that `write_csv` wrote."""
    content = Path(path).read_bytes()
    text = (gzip.decompress(content) if Path(path).suffix == ".gz" else content).decode()
    lines = csv.DictReader(io.StringIO(text, newline=""))
    return tuple(_row({name: _value(cell) for name, cell in line.items() if cell}) for line in lines)


def _cell(value: Any) -> str:
    if not isinstance(value, str) or not value or "\r" in value:  # a bare "\r" would end the line
        return json.dumps(value, sort_keys=True)
    return value if _value(value) is value else json.dumps(value)


def _value(cell: str) -> Any:
    try:
        return json.loads(cell)
    except ValueError:
        return cell


def _row(flat: Mapping[str, Any]) -> Row:
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


def write_json(path: str | Path, study: StoredStudy) -> None:
    """The declaration, the environments and the rows, which name theirs by its place in that list.

    Numbers that JSON has not are the texts "nan", "inf" and "-inf".
    """
    environments: list[Any] = []
    rows = []
    for row in study.rows:
        if row.environment not in environments:
            environments.append(row.environment)
        rows.append({**vars(row), "environment": environments.index(row.environment)})
    document = {"schema": FORMAT, "study": study.declaration, "environments": environments, "rows": rows}
    write_text(path, json.dumps(finite_json(document), indent=1, allow_nan=False) + "\n")


def finite_json(value: Any) -> Any:
    """The value for JSON, in mappings and sequences too: numbers JSON has not are "nan", "inf" and "-inf"."""
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, Mapping):
        return {name: finite_json(item) for name, item in value.items()}
    return [finite_json(item) for item in value] if isinstance(value, list | tuple) else value
