"""Results as NumPy archives: flat names, arrays and texts, no pickles, and a digest of them all; folders of load steps.

They hold everything a result claims, and the problem, so that it can be checked from the file alone.

The digest is SHA-256 over names, types, shapes and bytes of all other entries in the order of their names. It tells
a file that was changed after it was written; whoever changes the digest too still has to fool the certificate.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
from numpy.lib.format import MAGIC_PREFIX
from numpy.typing import NDArray

from qvi_contact import __version__
from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.writing import open_regular, read_arrays, replacing, writable_folder, write_text
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.files.problem_text import problem_to_toml, unread_toml
from qvi_contact.mesh.edges import points_back
from qvi_contact.solution.history import CONTINUES
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import law_of_rows
from qvi_contact.units import Units
from solvers import Certificate, Iteration, QVISolution, Status
from solvers.certificate.certificate import EXPONENTS

FORMAT: Final = "qvi_contact result"
FORMAT_VERSION: Final = 1
"""Grows when an entry changes its meaning or goes away; one that comes says what files without it mean."""

OWN: Final = frozenset({"format", "format_version", "digest"})
"""Names of the entries that `write_archive` adds."""

STORE: Final = "store"
"""Entry of steps of a history, which hold a problem and its answer, and no fields: the digest of that history."""

_VECTORS: Final = ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold")
_TEXTS: Final = ("method", "inner", "form", "factorisation")
_GROUPS: Final = ("measures", "scales", "signed")  # of numbers in a certificate

Arrays = dict[str, NDArray[Any]]

_REMEDY = "give a file written by write_npz, or by qvi-contact solve --npz"


def digest(arrays: Mapping[str, NDArray[Any]]) -> str:
    """The digest of all entries but the digest itself, as hexadecimal text."""
    found = hashlib.sha256()
    for name in sorted(set(arrays) - {"digest"}):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name}\0{array.dtype.str}\0{array.shape}\0".encode())
        found.update(array.reshape(-1).view(np.uint8).data)  # not a copy of them
    return found.hexdigest()


def write_archive(path: str | Path, arrays: Mapping[str, Any], field: str = "output") -> None:
    """Write entries, format, version and digest, whole or not at all; `field` names the path in errors."""
    entries = {name: np.asarray(value) for name, value in arrays.items()}
    entries |= {"format": np.array(FORMAT), "format_version": np.array(FORMAT_VERSION)}
    entries["digest"] = np.array(digest(entries))
    with replacing(path, field) as temporary:
        np.savez_compressed(temporary, **entries)  # type: ignore[arg-type]  # names are entries, not options


def json_ready(value: Any) -> Any:
    """The same for JSON, in mappings and lists too: Python's own numbers, and None for those that JSON has not."""
    if isinstance(value, Mapping):
        return {str(key): json_ready(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    return int(value) if isinstance(value, np.integer) else value


class Archive:
    """The entries of a file in `arrays` by name, read and checked one by one.

    `InputError` if the file is no archive, truncated, holds pickles, or is of another format or version; and by the
    methods if an entry is missing or of another kind.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = str(path)
        self.arrays: Arrays
        try:
            with open_regular(path) as stream:
                if stream.read(len(MAGIC_PREFIX)) == MAGIC_PREFIX:
                    raise InputError("result", self.path, f"is a single array: {_REMEDY}")
                stream.seek(0)
                self.arrays = read_arrays("result", self.path, stream)
        except InputError:
            raise
        except Exception as error:  # zip, zlib, numpy, tokenize: what broken bytes raise there is not documented
            text = getattr(error, "strerror", None) or (str(error).splitlines() or [type(error).__name__])[0]
            if "pickle" in text or isinstance(error, BadZipFile):
                text = "it is not an archive, or holds pickled objects"
            raise InputError("result", self.path, f"cannot be read ({text}): {_REMEDY}") from error
        if "format" not in self.arrays or self.text("format") != FORMAT:
            raise InputError("result", self.path, f"is not a result that can be checked: {_REMEDY}")
        version = self.number("format_version")
        if version != FORMAT_VERSION:
            remedy = f"only version {FORMAT_VERSION} is known here: take the version of qvi-contact that wrote the file"
            raise InputError("result", f"{self.path}, version {version:g}", remedy)

    @property
    def intact(self) -> bool:
        """Whether the digest fits."""
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
        """An array of float64; a vector of that size."""
        found: FloatArray = self._entry(name, "f", dimensions, f"{dimensions}-dimensional, of float64")
        if size is not None and len(found) != size:
            raise self.refused(name, f"has {len(found)} values instead of {size}")
        return found

    def integers(self, name: str) -> IntArray:
        """A vector of int64."""
        return self._entry(name, "i", 1, "a vector of int64")

    def mapping(self, name: str) -> dict[str, Any]:
        """A text that is a JSON object."""
        try:
            found = json.loads(self.text(name))
        except (ValueError, RecursionError) as error:
            raise self.refused(name, "is not a JSON document") from error
        if not isinstance(found, dict):
            raise self.refused(name, "is not a JSON object")
        return found

    def status(self, word: str) -> Status:
        """The status of that name."""
        try:
            return Status(word)
        except ValueError as error:
            raise InputError("result", self.path, f"names a status {word!r} that does not exist") from error

    def refused(self, name: str, told: str) -> InputError:
        """The error about an entry."""
        return InputError("result", self.path, f"entry {name!r} {told}")

    def _entry(self, name: str, kinds: str, dimensions: int, wanted: str) -> NDArray[Any]:
        """An entry of a kind; arrays of numbers have 64 bits."""
        if name not in self.arrays:
            raise InputError("result", self.path, f"has no entry {name!r}: {_REMEDY}")
        found = self.arrays[name]
        short = dimensions > 0 and kinds in "fi" and found.dtype.itemsize != 8
        if found.dtype.kind not in kinds or found.ndim != dimensions or short or not found.dtype.isnative:
            raise self.refused(name, f"is {found.dtype}{list(found.shape)}, not {wanted}")
        return found


def solution_arrays(
    result: ContactResult, units: Units | None = None, title: str = "", *, tried: bool = True
) -> dict[str, Any]:
    """The problem and the algebraic solution, from which `load_result` makes the result again.

    Problems of steps of a history are alike, and not each is `tried`.
    """
    try:
        known = result.problem
        problem, missing = problem_to_toml(known, units=units, title=title) if tried else unread_toml(known), ""
    except InputError as error:
        problem, missing = "", str(error)
    return {"problem": problem, "problem_missing": missing, **answer_arrays(result)}


def answer_arrays(result: ContactResult) -> dict[str, Any]:
    """The algebraic solution alone, from which `answer_from_archive` makes the result again beside the problem."""
    solution, known, certificate = result.solution, result.discretization, result.solution.certificate
    history = [
        [e.number, e.residual, e.energy, e.normal_resultant, e.inner_iterations, e.seconds] for e in solution.history
    ]
    words = [str(entry.inner_status or "") for entry in solution.history]
    return {
        "degree": known.space.degree,
        "law_on": known.rule.law_on,
        **_counted(known),
        "scales": np.array([known.scales.length, known.scales.stress, known.scales.compliance]),
        "loaded": known.scales.loaded,
        "reach": known.scales.reach,
        "later": known.later,
        "earlier_slip": np.concatenate([np.empty(0), *(rows.slip for rows in known.contacts)]),
        "status": str(result.status),
        "message": result.message,
        **{name: np.asarray(getattr(solution, name), dtype=np.float64) for name in _VECTORS},
        **{name: getattr(solution, name) for name in _TEXTS},
        "tolerance": certificate.tolerance,
        "certificate": json.dumps(json_ready({group: getattr(certificate, group) for group in _GROUPS})),
        "iterations": solution.iterations,
        "corrections": np.array(solution.corrections, dtype=np.float64),
        "remarks": np.array(solution.remarks, dtype=np.str_),
        "timings": json.dumps(dict(solution.timings)),
        "versions": json.dumps({"qvi-contact": __version__, **solution.versions}),
        "history": np.array(history, dtype=np.float64).reshape(len(history), 6),
        "history_status": np.array(words, dtype="U").reshape(len(words)),
    }


def load_result(path: str | Path) -> ContactResult:
    """Read a result that `qvi_contact.export.write_npz` has written.

    The problem is discretised afresh; unknowns and multipliers are those of the file to the last bit. Status and
    certificate are what the file claims: `qvi_contact.verification.verify_file` tells whether they are true.
    `InputError` if the file cannot be read or is not such an archive, entries are missing or of the wrong size, or it
    holds no problem since that has Python functions.
    """
    return result_from_archive(Archive(path))


def result_from_archive(archive: Archive) -> ContactResult:
    """The result of an archive that was read; see `load_result`."""
    text, missing = archive.text("problem"), archive.text("problem_missing")
    if not text:
        remedy = (
            f"holds no problem to check against ({missing}). Check the result in Python with "
            "verify_result, or write it anew with expressions or polynomials for functions"
        )
        raise InputError("result", archive.path, remedy)

    def discretized(scales: Scales) -> Discretization:
        try:
            file = problem_from_toml(text)
            if file.is_grid:  # results on triangles are stored with these
                remedy = "was computed on rectangles, retired in version 0.2: solve its problem again"
                raise InputError("result", archive.path, remedy)
            old = "contact_rows" in archive.arrays  # version 0.1
            law_on = law_of_rows(archive.text("contact_rows" if old else "law_on"))
            return discretize(file.problem, scales=scales, degree=archive.count("degree"), law_on=law_on)
        except InputError as error:
            if error.field == "result":  # names the file already
                raise
            raise archive.refused("problem", f"holds a problem that cannot be solved ({error})") from error

    return answer_from_archive(archive, discretized)


def answer_from_archive(archive: Archive, discretized: Callable[[Scales], Discretization]) -> ContactResult:
    """The result of an archive that was read, of a problem discretised in given units, without earlier slip."""
    known = _discretization(archive, discretized)
    if "strict" in archive.arrays and archive.number("strict") != 0.0:
        remedy = "was computed by an inner solver 'strict:…', retired in version 0.2: solve its problem again"
        raise InputError("result", archive.path, remedy)
    qvi, (table, words) = known.qvi, (archive.floats("history", 2), archive.texts("history_status"))
    if table.shape != (len(words), 6) or not np.isfinite(table[:, [0, 4]]).all():
        raise InputError("result", archive.path, "entries 'history' and 'history_status' do not fit together")
    history = tuple(
        Iteration(int(number), residual, energy, force, archive.status(word) if word else None, int(inner), seconds)
        for (number, residual, energy, force, inner, seconds), word in zip(table.tolist(), words, strict=True)
    )
    sizes = dict(zip(_VECTORS, (qvi.n, qvi.m, qvi.m, qvi.p, qvi.m), strict=True))
    given: dict[str, Any] = {
        **{name: archive.floats(name, size=size) for name, size in sizes.items()},
        "certificate": _certificate(archive),
        "history": history,
        "iterations": archive.count("iterations"),
        "message": archive.text("message"),
        "corrections": tuple(archive.floats("corrections").tolist()),
        "remarks": tuple(archive.texts("remarks")) if "remarks" in archive.arrays else (),  # none in version 0.1
        **{name: archive.mapping(name) for name in ("timings", "versions")},
        **{name: archive.text(name) for name in _TEXTS},
    }
    return ContactResult(known, QVISolution(qvi, archive.status(archive.text("status")), **given))


def _discretization(archive: Archive, discretized: Callable[[Scales], Discretization]) -> Discretization:
    """The problem of an archive, in its units and after the slip before it."""
    length, stress, compliance = archive.floats("scales", size=3)
    if not min(length, stress, compliance) > 0.0 or not np.isfinite([length, stress, compliance]).all():
        raise archive.refused("scales", "holds units that are not positive numbers")
    reach = archive.number("reach") if "reach" in archive.arrays else np.inf  # files of version 0.1 have none
    if not reach > 0.0:
        raise archive.refused("reach", "is not a positive number")
    fresh = discretized(Scales(length, stress, compliance, archive.number("loaded") != 0.0, reach))
    for name, own in _counted(fresh).items():
        if not np.array_equal(archive.integers(name) if name in archive.arrays else np.empty(0, dtype=np.int64), own):
            remedy = (
                "counts from other vertices of this mesh than it does here: solve the problem anew, or take the "
                "version of qvi-contact that wrote the file"
            )
            raise archive.refused("tangential_multiplier" if name == "led_back" else "z", remedy)
    counts = [len(rows.gap) for rows in fresh.contacts]
    slip = archive.floats("earlier_slip", size=sum(counts))
    if not (slip.any() or ("later" in archive.arrays and archive.number("later") != 0.0)):
        return fresh
    return fresh.with_data(fresh.problem, fresh.scales, np.split(slip, np.cumsum(counts)[:-1]))


def _counted(known: Discretization) -> dict[str, IntArray]:
    """From where unknowns and multipliers count; files without an entry have unknowns of Φ itself, none led back."""
    tangents = [known.problem.mesh.edges(contact.edges).tangent for contact in known.problem.contacts]
    back = np.flatnonzero(points_back(np.concatenate([np.empty((0, 2)), *tangents])))
    return {"centres": known.space.frames.centres, "cuts": known.space.frames.on_cuts, "led_back": back}


def _certificate(archive: Archive) -> Certificate:
    tolerance, groups = archive.number("tolerance"), archive.mapping("certificate")
    if not 0.0 < tolerance < 1.0:
        raise archive.refused("tolerance", "is not between 0 and 1")
    try:
        measures, scales, signed = (
            {name: np.inf if value is None else float(value) for name, value in groups[group].items()}
            for group in _GROUPS
        )
    except (KeyError, AttributeError, TypeError, ValueError, OverflowError) as error:
        raise archive.refused("certificate", "holds entries that are no numbers, or too large for a float") from error
    if any(value < 0.0 for value in measures.values()):
        raise archive.refused("certificate", "holds measures below zero")
    return Certificate(dict.fromkeys(EXPONENTS, np.inf) | measures, tolerance, scales, signed)  # others do not pass


# Steps of a history: archives in a folder, one for each step that is done, written whole or not at all. `store.json`
# tells which history it is: a digest of all its problems and options. Beside it stands `step-000001.npz` for the first
# step, and so on. After an interruption the steps up to the first that is missing or damaged are kept.


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
