"""Studies: cases, run in processes with limits, one durable row for each, in a store that several studies may share.

Cases and results are *plain*: None, booleans, integers, floats, texts, and lists and named mappings of these. They mean
the same in this process, in another process, on a cluster and in a file. The key of a row is the study's name, its
version and the case. So an interrupted study continues where it stopped, and a full study reuses the rows of a smaller
one. Every case gives a row: its result, or the reason of its failure.
"""

import gzip
import hashlib
import json
import os
import pickle
import platform
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from qvi_contact.basics.terminal import Advance, error_console
from qvi_contact.basics.writing import replacing
from qvi_contact.errors import InputError
from qvi_contact.runs.database import Database, damaged, explained
from qvi_contact.runs.processes import Limits, NotLoadedError, Outcome, Workers

if TYPE_CHECKING:
    from pandas import DataFrame, Series

Case = Mapping[str, Any]

PACKAGES: Final = (
    "qvi-contact", "numpy", "scipy", "mkl", "cvxopt", "cvxpy", "clarabel", "qpsolvers", "threadpoolctl",
)  # fmt: skip
"""Distributions whose versions are stored in rows, unless a study names others: those that influence times."""

DONE: Final = "done"
"""Status of a row with a result; all others are in `qvi_contact.runs.processes.FAILURES`."""


# what is run


@dataclass(frozen=True, eq=False)
class Study:
    """Cases, and the task that is run for each of them.

    Raise the version when the task computes something else: rows of other versions are not used. The task is the name
    "module:function" of a function that can be imported wherever the study runs; its module is imported before times
    are measured. It takes a case and returns a mapping of plain values; its entry "certificate" is stored apart. Cases
    map factors to plain values; equal cases are run once. `InputError` is raised if there are no cases. Rows store the
    versions of `packages`. With `fresh` every case has a process of its own, so that peak memory can be measured.
    `threads` fixes the number of threads, which the user chooses otherwise.
    """

    name: str
    version: int
    task: str
    cases: Sequence[Case]
    packages: tuple[str, ...] = PACKAGES
    fresh: bool = False
    threads: int | None = None
    keys: Mapping[str, Case] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        try:
            cases = [plain(dict(case), "case") for case in self.cases]
            keys = {self.key(case): case for case in cases}
            for name in {name for case in cases for name in case}:
                if not name.isidentifier() or name in ("status", "reason", "spent", "has"):
                    raise ValueError(f"{name!r} is no name of a factor")
        except (TypeError, ValueError) as error:
            raise InputError("Study.cases", self.name, f"give words, with plain and finite values ({error})") from error
        if not keys:
            raise InputError("Study.cases", self.name, "no case is left")
        object.__setattr__(self, "keys", keys)
        object.__setattr__(self, "cases", tuple(keys.values()))

    def key(self, case: Case) -> str:
        """The first 128 bits of SHA-256 of the JSON of name, version and case, whatever the order of its entries.

        1, 1.0 and True are different values.
        """
        named = {"study": self.name, "version": self.version, "case": case}
        text = json.dumps(named, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def plain(value: Any, name: str) -> Any:
    """The value as `dict`, `list` and Python's scalars, as JSON reads it back; `name` stands in error messages.

    Sequences become lists, NumPy's scalars Python's, members of enumerations of texts or numbers their values.
    `TypeError` if a part of the value is not plain.
    """

    def as_plain(item: Any) -> Any:
        found = dict(item) if isinstance(item, Mapping) else item.item() if getattr(item, "ndim", None) == 0 else item
        if type(found) is type(item):
            raise TypeError(f"{type(item).__name__} is no plain value")
        return found

    try:
        return json.loads(json.dumps(value, default=as_plain))
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name}: {error}") from error


# where it is run


def machine() -> dict[str, Any]:
    """Processor, cores this process may use, memory [bytes], system, Python; no names of hosts, users or folders."""
    processor, memory, system = platform.processor() or platform.machine(), None, platform.release()
    with suppress(OSError, StopIteration):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    with suppress(AttributeError, ValueError, OSError):
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    system = f"{platform.system()} {system}"
    with suppress(OSError):
        system = platform.freedesktop_os_release().get("PRETTY_NAME", system)
    return {
        "processor": processor,
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "memory_bytes": memory, "system": f"{system}, {platform.machine()}",
        "python": f"{platform.python_implementation()} {platform.python_version()}",
    }  # fmt: skip


def versions(packages: Sequence[str] = PACKAGES) -> dict[str, str | None]:
    """Package → version, None if it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # loading it doubles the start of a worker process

    found: dict[str, str | None] = dict.fromkeys(packages)
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


# rows


@dataclass(frozen=True)
class Row:
    """The stored outcome of one case; status, reason, seconds and load_average as in `Outcome`.

    `result` is the mapping that the task returned, empty if the task failed; `certificate` its entry of that name, or
    None. `environment` has threads, timeout_seconds, memory_mib, machine (see `machine`) and versions.
    """

    case: Case
    status: str
    reason: str
    result: Mapping[str, Any]
    certificate: Any
    seconds: float
    finished: str
    load_average: float | None
    environment: Mapping[str, Any]


def frame_of(
    rows: Sequence[Row], numbers: Sequence[str] = (), others: Sequence[str] = (), parts: str = ""
) -> "DataFrame":
    """A frame with one line for each row: the factors of the case, and the entries of the result.

    Further columns: "status" and "message", from the task or else status and reason of the row; "reason"; "spent", the
    seconds of the row; "has", whether there is a result; "accuracy", which the certificate confirms. The columns
    `numbers` (NaN where a row has no value) and `others` always exist. If `parts` names an entry that lists several
    results, there is a line for each of these results.
    """
    from pandas import DataFrame, to_numeric

    lines = DataFrame([
        {**row.case, "status": row.status, "message": row.reason, **found, "reason": row.reason, "spent": row.seconds,
         "has": row.status == DONE, "accuracy": (row.certificate or found).get("accuracy")}
        for row in rows for found in (row.result.get(parts, [{}]) if parts else [row.result])
    ])  # fmt: skip
    columns = (*lines, "status", "message", "has", "accuracy", *numbers, *others)
    found = lines.reindex(columns=[*dict.fromkeys(columns)])
    for name in ("accuracy", *numbers):
        found[name] = to_numeric(found[name])
    return found


def largest_of(values: "Series", frame: "DataFrame") -> dict[Any, Any]:
    """The line of the frame with the largest of these values, as a mapping; all None if there are no values."""
    return dict.fromkeys(frame) if values.dropna().empty else frame.loc[values.idxmax()].to_dict()


def write_rows(path: str | Path, rows: Sequence[Row]) -> None:
    """One line of JSON a row, compressed; the same bytes for the same rows."""
    content = "".join(f"{json.dumps(vars(row))}\n" for row in rows).encode()
    with replacing(Path(path)) as temporary:
        temporary.write_bytes(gzip.compress(content, mtime=0))


def written_rows(path: str | Path) -> tuple[Row, ...]:
    """Read the rows that `write_rows` wrote; `InputError` if the file cannot be read."""
    try:
        lines = gzip.decompress(Path(path).read_bytes()).decode().splitlines()
        return tuple(Row(**json.loads(line)) for line in lines)
    except (OSError, EOFError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError("rows", str(path), f"cannot be read ({reason}): give the folder of a report") from error


# the store: an SQLite file, one transaction for each row, see `runs.database`

_STORE: Final = Database(
    "the store of a study", 0x51564953, 3,  # "QVIS"
    ('CREATE TABLE "rows" (key TEXT PRIMARY KEY, study TEXT NOT NULL, "row" TEXT NOT NULL)',),
    '"rows"',
)  # fmt: skip


def read_rows(study: Study, store: str | Path) -> tuple[Row, ...]:
    """The rows of a study in a store, in the order of its cases; none without a store. `InputError` if damaged."""
    path = Path(store)
    if not path.exists():
        return ()
    with _STORE.opened(path) as connection:
        try:
            rows = connection.execute('SELECT key, "row" FROM "rows" WHERE study = ?', (study.name,))
            found = {key: Row(**json.loads(text)) for key, text in rows}
        except (ValueError, TypeError) as error:
            raise damaged(path) from error
    return tuple(found[key] for key in study.keys if key in found)


@contextmanager
def writing(path: Path, study: Study) -> Iterator[Callable[[Case, Outcome, Mapping[str, Any]], None]]:
    """Open a store for appending, made if it is missing, and lock it against other runs.

    Yields a function that writes the row of a case from its outcome and environment. When the function returns, the row
    is on disk; `InputError` if writing fails or the row exists.
    """
    with _STORE.writing(path, lambda _: None) as connection:

        def append(case: Case, outcome: Outcome, environment: Mapping[str, Any]) -> None:
            result = dict(outcome.value or {})
            certificate = result.pop("certificate", None)
            now = datetime.now(UTC).isoformat(timespec="seconds")
            row = Row(case, outcome.status, outcome.reason, result, certificate, outcome.seconds, now,
                      outcome.load_average, environment)  # fmt: skip
            with explained(path), connection:
                connection.execute(
                    'INSERT INTO "rows" VALUES (?, ?, ?)', (study.key(case), study.name, json.dumps(vars(row)))
                )

        yield append


# runs


def run_study(
    study: Study,
    store: str | Path,
    workers: int = 1,
    dask: str | None = None,
    timeout: float | None = None,
    memory: int | None = None,
    threads: int = 1,
) -> tuple[Row, ...]:
    """Run the cases without a row in the store, and return all rows in the order of the cases.

    A failed case has a row too, and is not repeated. `dask` is the address of the scheduler of a Dask cluster, which
    then runs the cases instead of worker processes on this machine. timeout [s], memory [MiB] of address space and
    threads are the limits of each case. The store is made if it is missing; a complete store may be read-only. If an
    interrupt or an `InputError` ends the run, finished rows are in the store.
    """
    threads = study.threads or threads
    for name, value in (("workers", workers), ("timeout", timeout), ("memory", memory), ("threads", threads)):
        if value is not None and not value > 0:
            raise InputError(name, value, "give a number above 0")
    path, pool = Path(store), Workers(workers, dask)
    found = read_rows(study, path)
    if len(found) == len(study.cases):
        return found
    job = pickle.dumps(partial(opened, study.task, study.packages))
    limits = Limits(timeout, memory, threads, study.fresh)
    terms = {"threads": threads, "timeout_seconds": timeout, "memory_mib": memory}
    try:
        with writing(path, study) as append:
            finished = {study.key(row.case) for row in read_rows(study, path)}
            pending = deque((key, dict(case)) for key, case in study.keys.items() if key not in finished)
            n_finished = len(study.cases) - len(pending)
            with (
                progress(study.name, len(study.cases), n_finished) as advance,
                pool.ready(job, limits) as (_, outcomes),
                closing(outcomes(pending)) as done,
            ):
                for (_, case), outcome in done:
                    about = outcome.about or {"machine": None, "versions": {}}  # a worker lost by the cluster
                    append(case, outcome, {**about, **terms})
                    advance()
    except NotLoadedError as error:
        within = "" if memory is None else f" within memory = {memory} MiB"  # libraries seldom name this reason
        raise InputError("Study.task", study.task, f"cannot be loaded{within}: {error.reason}") from error
    return read_rows(study, path)


def opened(task: str, packages: tuple[str, ...]) -> tuple[dict[str, Any], Callable[[Any], dict[str, Any]]]:
    """Run first in a worker process of a study: machine and versions, and the function that runs a case."""
    module, _, name = task.partition(":")
    function = getattr(import_module(module), name)

    def run(order: tuple[str, dict[str, Any]]) -> dict[str, Any]:
        returned = function(order[1])
        if not isinstance(returned, Mapping):
            raise TypeError(f"the task returned {type(returned).__name__}, not a mapping")
        result: dict[str, Any] = plain(returned, "result")
        return result

    return {"machine": machine(), "versions": versions(packages)}, run


@contextmanager
def progress(title: str, total: int, finished: int = 0) -> Iterator[Advance]:
    """A progress bar on standard error, silent if it is no terminal; rows of earlier runs do not count in the rate."""
    console = error_console()
    if not console.is_terminal:  # before release 14.3 of rich even a disabled bar writes an empty line
        yield lambda *_: None
        return
    from rich import progress as rich

    columns = (
        rich.TextColumn("{task.description}"), rich.BarColumn(), rich.MofNCompleteColumn(), rich.TimeElapsedColumn(),
        rich.TextColumn("left"), rich.TimeRemainingColumn(),
    )  # fmt: skip
    with rich.Progress(*columns, console=console, transient=True, speed_estimate_period=3600.0) as bar:  # long cases
        task = bar.add_task(title, total=total, completed=finished)

        def advance(description: str = "") -> None:
            bar.update(task, advance=1, description=f"{title}: {description}" if description else title)

        yield advance
