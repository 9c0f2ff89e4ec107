"""Results as NumPy archives, and load steps as folders of archives.

An archive has named entries without pickles: the problem, and all that a result claims, to be checked from the file.

The entry "digest" is SHA-256 over names, types, shapes and bytes of all other entries, in the order of their names. It
shows whether a file was changed after it was written. Who changes the digest too still has to pass the certificate.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from copy import copy
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import open_regular, read_arrays, replacing, writable_folder, write_text
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.files.problem_text import problem_to_toml, unchecked_toml
from qvi_contact.mesh.edges import points_back
from qvi_contact.runs.database import locked
from qvi_contact.solution.history import CONTINUES
from qvi_contact.solution.result import ContactResult
from qvi_contact.units import Units
from solvers import Certificate, Iteration, QVISolution, Status
from solvers.certificate.certificate import EXPONENTS

FORMAT: Final = "qvi_contact result"
FORMAT_VERSION: Final = 2
"""Grows when an entry is added, removed, or changes its meaning."""

OWN: Final = frozenset({"format", "format_version", "digest"})  # entries that `write_archive` adds
STORE: Final = "store"  # entry with the digest of the history, in archives of load steps, which hold no fields

_VECTORS: Final = ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold")
_TEXTS: Final = ("method", "inner", "form", "factorisation")
_CERTIFICATE_GROUPS: Final = ("measures", "scales", "signed")  # fields of `Certificate` that are stored

Arrays = dict[str, NDArray[Any]]

_REMEDY = "give a file written by write_npz, or by qvi-contact solve --npz"


def digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    """SHA-256 of all entries except "digest", as hexadecimal text."""
    sha = hashlib.sha256()
    for name in sorted(set(arrays) - {"digest"}):
        array = np.ascontiguousarray(arrays[name])
        sha.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        sha.update(array.reshape(-1).view(np.uint8).data)  # the bytes themselves, not a copy
    return sha.hexdigest()


def write_archive(path: str | Path, arrays: Mapping[str, Any], field: str = "output") -> None:
    """Write the entries, and format, version and digest, whole or not at all; errors call the path `field`."""
    entries = {name: np.asarray(value) for name, value in arrays.items()}
    entries |= {"format": np.array(FORMAT), "format_version": np.array(FORMAT_VERSION)}
    entries["digest"] = np.array(digest(entries))
    with replacing(path, field) as temporary:
        np.savez_compressed(temporary, **entries)  # type: ignore[arg-type]  # names are entries, not options


def json_ready(value: Any) -> Any:
    """The value for JSON, through mappings and lists: NumPy numbers become Python's, numbers not finite become None."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(entry) for entry in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not np.isfinite(value) else value


class Archive:
    """An archive file that was read: `arrays` has all entries by name, each method checks one and returns it.

    `InputError` if the file is no archive, is truncated, holds pickles, or has another format or version. The methods
    raise it if the entry is missing or has another type, number of dimensions or size.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        self.arrays: Arrays
        try:
            with open_regular(path) as stream:
                self.arrays = read_arrays("result", self.path, stream)
        except InputError:
            raise
        except Exception as error:  # zipfile, zlib, numpy, tokenize: their errors for broken files are not documented
            text = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
            if "pickle" in text or isinstance(error, BadZipFile):
                text = "it is not an archive, or holds pickled objects"
            raise InputError("result", self.path, f"cannot be read ({text}): {_REMEDY}") from error
        if "format" not in self.arrays or self.text("format") != FORMAT:
            raise InputError("result", self.path, f"is not a result that can be checked: {_REMEDY}")
        version = self.count("format_version")
        if version != FORMAT_VERSION:
            remedy = f"only version {FORMAT_VERSION} is known here: take the version of qvi-contact that wrote this"
            raise InputError("result", f"{self.path}, version {version}", remedy)

    @property
    def intact(self) -> bool:
        """Whether the stored digest is that of the entries."""
        return self.text("digest") == digest(self.arrays)

    def text(self, name: str) -> str:
        """A text."""
        return str(self._entry(name, "U", 0, "a text"))

    def texts(self, name: str) -> list[str]:
        """A list of texts."""
        return [str(text) for text in self._entry(name, "U", 1, "a list of texts")]

    def number(self, name: str) -> float:
        """A number, or a truth value as 0 or 1."""
        return float(self._entry(name, "biuf", 0, "a number"))

    def count(self, name: str) -> int:
        """A whole number, at least 0."""
        value = self.number(name)
        if not np.isfinite(value) or value < 0.0 or value != int(value):
            raise self.refused(name, f"is {value:g}, which is not a number of {name}")
        return int(value)

    def floats(self, name: str, dimensions: int = 1, size: int | None = None) -> FloatArray:
        """An array of float64 with so many dimensions, and of this length if `size` is given."""
        values: FloatArray = self._entry(name, "f", dimensions, f"{dimensions}-dimensional, of float64")
        if size is not None and len(values) != size:
            raise self.refused(name, f"has {len(values)} values instead of {size}")
        return values

    def integers(self, name: str) -> IntArray:
        """A vector of int64."""
        return self._entry(name, "i", 1, "a vector of int64")

    def mapping(self, name: str) -> dict[str, Any]:
        """A text that is a JSON object."""
        text, document = self.text(name), None
        with suppress(ValueError, RecursionError):
            document = json.loads(text)
        if not isinstance(document, dict):
            raise self.refused(name, "is not a JSON object")
        return document

    def status(self, word: str) -> Status:
        """The status of that name."""
        try:
            return Status(word)
        except ValueError as error:
            raise InputError("result", self.path, f"names a status {word!r} that does not exist") from error

    def refused(self, name: str, reason: str) -> InputError:
        """The error to raise about an entry."""
        return InputError("result", self.path, f"entry {name!r} {reason}")

    def _entry(self, name: str, kinds: str, dimensions: int, expected: str) -> NDArray[Any]:
        """An entry whose dtype has one of the `kinds` (letters of NumPy); arrays of numbers must have 64 bits."""
        if name not in self.arrays:
            raise InputError("result", self.path, f"has no entry {name!r}: {_REMEDY}")
        array = self.arrays[name]
        is_not_64_bit = dimensions > 0 and kinds in "fi" and array.dtype.itemsize != 8
        if array.dtype.kind not in kinds or array.ndim != dimensions or is_not_64_bit or not array.dtype.isnative:
            raise self.refused(name, f"is {array.dtype}{list(array.shape)}, not {expected}")
        return array


def solution_arrays(
    result: ContactResult, units: Units | None = None, title: str = "", *, checked: bool = True
) -> dict[str, Any]:
    """Entries for the problem and the algebraic solution, from which `load_result` makes the result again.

    With `checked` the text of the problem is read back once. Steps of a history differ little, and do without.
    """
    try:
        problem = result.problem
        text, missing = problem_to_toml(problem, units=units, title=title) if checked else unchecked_toml(problem), ""
    except InputError as error:
        text, missing = "", str(error)
    return {"problem": text, "problem_missing": missing, **answer_arrays(result)}


def answer_arrays(result: ContactResult) -> dict[str, Any]:
    """Entries for the algebraic solution, from which `answer_from_archive` makes the result if the problem is known."""
    solution, discretization, certificate = result.solution, result.discretization, result.solution.certificate
    scales = discretization.scales
    history = [
        [e.number, e.residual, e.energy, e.normal_resultant, e.inner_iterations, e.seconds] for e in solution.history
    ]
    inner_statuses = [str(entry.inner_status or "") for entry in solution.history]
    return {
        "degree": discretization.space.degree,
        "law_on": discretization.rule.law_on,
        **_counted(discretization),
        "scales": np.array([scales.length, scales.stress, scales.compliance]),
        "loaded": scales.loaded,
        "reach": scales.reach,
        "later": discretization.later,
        "earlier_slip": np.concatenate([np.empty(0), *(rows.slip for rows in discretization.contacts)]),
        "status": str(result.status),
        "message": result.message,
        **{name: np.asarray(getattr(solution, name), dtype=np.float64) for name in _VECTORS},
        **{name: getattr(solution, name) for name in _TEXTS},
        "tolerance": certificate.tolerance,
        "certificate": json.dumps(json_ready({group: getattr(certificate, group) for group in _CERTIFICATE_GROUPS})),
        "iterations": solution.iterations,
        "corrections": np.array(solution.corrections, dtype=np.float64),
        "remarks": np.array(solution.remarks, dtype=np.str_),
        "timings": json.dumps(dict(solution.timings)),
        "versions": json.dumps({"qvi-contact": __version__, **solution.versions}),
        "history": np.array(history, dtype=np.float64).reshape(len(history), 6),
        "history_status": np.array(inner_statuses, dtype="U").reshape(len(inner_statuses)),
    }


def load_result(path: str | Path) -> ContactResult:
    """Read a result that `qvi_contact.export.write_npz` has written.

    The problem is discretised again; unknowns and multipliers are those of the file to the last bit. Status and
    certificate are what the file claims: `qvi_contact.verification.verify_file` tells whether they are true.
    `InputError` if the file cannot be read or is no archive of a result, if entries are missing or of the wrong size,
    or if the file holds no problem because the problem has Python functions.
    """
    return result_from_archive(Archive(path))


def result_from_archive(archive: Archive) -> ContactResult:
    """Make the result of an archive; see `load_result`."""
    text, missing = archive.text("problem"), archive.text("problem_missing")
    if not text:
        remedy = (
            f"holds no problem to check against ({missing}). Check the result in Python with "
            "verify_result, or write it anew with expressions or polynomials for functions"
        )
        raise InputError("result", archive.path, remedy)

    law_on: Any = archive.text("law_on")
    degree = archive.count("degree")

    def discretized(scales: Scales) -> Discretization:
        try:
            return discretize(problem_from_toml(text).problem, scales=scales, degree=degree, law_on=law_on)
        except InputError as error:
            raise archive.refused("problem", f"holds a problem that cannot be solved ({error})") from error

    return answer_from_archive(archive, discretized)


def answer_from_archive(archive: Archive, discretize_in: Callable[[Scales], Discretization]) -> ContactResult:
    """Make the result of an archive; `discretize_in` discretises its problem in given scales, without earlier slip."""
    discretization = _discretization(archive, discretize_in)
    qvi, (table, statuses) = discretization.qvi, (archive.floats("history", 2), archive.texts("history_status"))
    if table.shape != (len(statuses), 6) or not np.isfinite(table[:, [0, 4]]).all():
        raise InputError("result", archive.path, "entries 'history' and 'history_status' do not fit together")
    history = tuple(
        Iteration(int(number), residual, energy, force, archive.status(word) if word else None, int(inner), seconds)
        for (number, residual, energy, force, inner, seconds), word in zip(table.tolist(), statuses, strict=True)
    )
    sizes = dict(zip(_VECTORS, (qvi.n, qvi.m, qvi.m, qvi.p, qvi.m), strict=True))
    fields: dict[str, Any] = {
        **{name: archive.floats(name, size=size) for name, size in sizes.items()},
        "certificate": _certificate(archive),
        "history": history,
        "iterations": archive.count("iterations"),
        "message": archive.text("message"),
        "corrections": tuple(archive.floats("corrections").tolist()),
        "remarks": tuple(archive.texts("remarks")),
        **{name: archive.mapping(name) for name in ("timings", "versions")},
        **{name: archive.text(name) for name in _TEXTS},
    }
    return ContactResult(discretization, QVISolution(qvi, archive.status(archive.text("status")), **fields))


def _discretization(archive: Archive, discretize_in: Callable[[Scales], Discretization]) -> Discretization:
    """The discretised problem of an archive, in its scales, and after the slip of earlier load steps."""
    length, stress, compliance = archive.floats("scales", size=3)
    if not min(length, stress, compliance) > 0.0 or not np.isfinite([length, stress, compliance]).all():
        raise archive.refused("scales", "holds units that are not positive numbers")
    reach = archive.number("reach")
    if not reach > 0.0:
        raise archive.refused("reach", "is not a positive number")
    known = discretize_in(Scales(length, stress, compliance, archive.number("loaded") != 0.0, reach))
    for name, own in _counted(known).items():
        if not np.array_equal(archive.integers(name), own):
            remedy = (
                "refers to another basis or orientation than this version has on the mesh: solve the problem again, or "
                "take the version of qvi-contact that wrote the file"
            )
            raise archive.refused("tangential_multiplier" if name == "led_back" else "z", remedy)
    counts = [len(rows.gap) for rows in known.contacts]
    slip = archive.floats("earlier_slip", size=sum(counts))
    if not np.isfinite(slip).all():
        raise archive.refused("earlier_slip", "holds numbers that are not finite")
    if not (slip.any() or archive.number("later") != 0.0):
        return known
    return known.with_data(known.problem, known.scales, np.split(slip, np.cumsum(counts)[:-1]))


def _counted(known: Discretization) -> dict[str, IntArray]:
    """Choices on which stored unknowns depend: centres and cuts of Φ, contact edges whose tangent points back."""
    tangents = [known.problem.mesh.edges(contact.edges).tangent for contact in known.problem.contacts]
    led_back = np.flatnonzero(points_back(np.concatenate([np.empty((0, 2)), *tangents])))
    return {"centres": known.space.frames.centres, "cuts": known.space.frames.on_cuts, "led_back": led_back}


def _certificate(archive: Archive) -> Certificate:
    tolerance, groups = archive.number("tolerance"), archive.mapping("certificate")
    if not 0.0 < tolerance < 1.0:
        raise archive.refused("tolerance", "is not between 0 and 1")
    try:
        measures, scales, signed = (
            {name: np.inf if value is None else float(value) for name, value in groups[group].items()}
            for group in _CERTIFICATE_GROUPS
        )
    except (KeyError, AttributeError, TypeError, ValueError, OverflowError) as error:
        raise archive.refused("certificate", "holds entries that are no numbers, or too large for a float") from error
    if any(value < 0.0 for value in measures.values()):
        raise archive.refused("certificate", "holds measures below zero")
    return Certificate(dict.fromkeys(EXPONENTS, np.inf) | measures, tolerance, scales, signed)  # missing ones fail


# Steps of a history are archives in a folder, `step-000001.npz` and so on, each written whole or not at all. Beside
# them `store.json` identifies the history by a digest of its problems and options. After an interruption the steps
# before the first missing or damaged one are kept.


Restore = Callable[[int, Scales], Discretization]
"""Discretise the problem of a step, counted from 1, in given scales, without earlier slip."""


class StepStore(Sequence[ContactResult]):
    """Results of a history of `planned` steps, each read from its file when it is asked for.

    The last result read or added stays in memory. `fingerprint` is a digest of problems and options, `restore`
    discretises the problem of a step; until `held` is closed the folder is locked for other runs. `InputError` if the
    folder cannot be written, another run is at work on it, or it holds other files or another history; when a step is
    read, if its file is damaged or was changed.
    """

    def __init__(self, folder: str | Path, fingerprint: str, planned: int, restore: Restore, held: ExitStack) -> None:
        self._folder, self._fingerprint = writable_folder(folder, "store").absolute(), fingerprint
        self._restore = restore
        self._unfinished: ContactResult | None = None  # a last step that failed: it has no file
        self._last_read: tuple[int, ContactResult] | None = None
        self._slice: range | None = None  # numbers of the steps in a slice of the sequence
        header, lock = self._folder / "store.json", "store.json.lock"
        expected = {"format": "qvi_contact steps", "version": FORMAT_VERSION}  # that of the archives of its steps
        expected |= {"fingerprint": fingerprint, "planned": planned}
        others = (path.name for path in self._folder.iterdir() if path.name != lock)
        if not header.exists() and any(not name.startswith(".writing-") for name in others):  # a write that was killed
            raise InputError("store", str(folder), "holds other files: give an empty folder, or a new name")
        held.enter_context(locked(header))
        if header.exists():
            existing: Any = None
            with suppress(OSError, ValueError, RecursionError):
                existing = json.loads(header.read_text(encoding="utf-8"))
            if existing != expected:
                remedy = "belongs to another history, with other problems, options or version: give a new folder"
                raise InputError("store", str(header), remedy)
        else:
            write_text(header, json.dumps(expected, indent=2) + "\n", "store")
        self._all_statuses: list[Status] = []
        with suppress(InputError, ValueError):  # of the first step that is missing or damaged
            for number in range(1, planned + 1):
                self._all_statuses.append(Status(self._archive(number).text("status")))

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            part = copy(self)
            part._slice = self._numbers[index]
            return part
        number = self._numbers[index]
        if number == len(self._all_statuses) and self._unfinished is not None:
            return self._unfinished
        if self._last_read is None or self._last_read[0] != number:
            archive = self._archive(number)
            self._last_read = number, answer_from_archive(archive, lambda scales: self._restore(number, scales))
        return self._last_read[1]

    def append(self, result: ContactResult) -> None:
        """Add a step. It is written if another may follow; a failed step, the last one, stays in memory only."""
        number = len(self._all_statuses) + 1
        if result.status in CONTINUES:
            entries = solution_arrays(result, checked=False) | {STORE: self._fingerprint}
            write_archive(self._path(number), entries, "store")
            self._last_read = number, result
        else:
            self._unfinished = result
        self._all_statuses.append(result.status)

    @property
    def statuses(self) -> tuple[Status, ...]:
        """The status of each step so far."""
        return tuple(self._all_statuses[number - 1] for number in self._numbers)

    @property
    def _numbers(self) -> range:
        return range(1, len(self._all_statuses) + 1) if self._slice is None else self._slice

    def _path(self, number: int) -> Path:
        return self._folder / f"step-{number:06}.npz"

    def _archive(self, number: int) -> Archive:
        """The archive of a step, checked to be intact and of this history."""
        archive = Archive(self._path(number))
        if not archive.intact or archive.text(STORE) != self._fingerprint:
            remedy = "was changed, or belongs to another history: delete the file, and run the history again"
            raise InputError("store", archive.path, remedy)
        return archive
