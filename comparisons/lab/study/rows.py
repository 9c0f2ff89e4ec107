"""Rows of a study as they are read back: objects, a frame, CSV."""

import csv
import gzip
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.worker.outcome import DONE
from qvi_contact.basics.writing import replacing

if TYPE_CHECKING:
    from pandas import DataFrame, Series

ENVIRONMENT: Final = ("threads", "timeout_seconds", "memory_mib", "machine", "versions")
"""Entries of a row's environment, in the order of their columns."""

_OWN: Final = frozenset({
    "position", "key", "status", "reason", "seconds", "finished", "load_average", "certificate",
})  # fmt: skip


@dataclass(frozen=True)
class Row:
    """What became of one case, as it is stored.

    Position, key and case are those of `declaration.Case`; what is not listed is of `outcome.Outcome`.

    Attributes
    ----------
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
    return tuple(_row({name: value(cell) for name, cell in line.items() if cell}) for line in lines)


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


def finite_json(value: Any, null: bool = False) -> Any:
    """The value for JSON, in mappings and sequences too: numbers JSON has not are "nan", "inf" and "-inf", or None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None if null else str(value)
    if isinstance(value, Mapping):
        return {name: finite_json(item, null) for name, item in value.items()}
    return [finite_json(item, null) for item in value] if isinstance(value, list | tuple) else value
