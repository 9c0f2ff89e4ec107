"""Steps of a history in a folder: one archive for each step that is done, written whole or not at all.

`store.json` tells which history it is: a digest of all its problems and options. Beside it stands `step-000001.npz`
for the first step, and so on. After an interruption the steps up to the first that is missing or damaged are kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, overload

from qvi_contact.basics.writing import writable_folder, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.files.archive import STORE, Archive, answer_from_archive, step_arrays, write_archive
from qvi_contact.solution.history import CONTINUES
from qvi_contact.solution.result import ContactResult
from solvers import Status

_FORMAT: Final = "qvi_contact steps"
_VERSION: Final = 1
_HEADER: Final = "store.json"

Restore = Callable[[int, Scales], Discretization]
"""The problem of a step, from 1, in these units, without earlier slip."""


class StoredSteps(Sequence[ContactResult]):
    """Results of steps, read when they are asked for; the last one that was read or added is at hand.

    Attributes
    ----------
    statuses : list of Status
        Of each step.

    """

    def __init__(self, store: StepStore, restore: Restore) -> None:
        self._store, self._restore = store, restore
        self.statuses: list[Status] = store.statuses()
        self._end: ContactResult | None = None
        self._near: tuple[int, ContactResult] | None = None

    def __len__(self) -> int:
        return len(self.statuses)

    @overload
    def __getitem__(self, index: int) -> ContactResult: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[ContactResult]: ...

    def __getitem__(self, index: int | slice) -> ContactResult | Sequence[ContactResult]:
        if isinstance(index, slice):
            return _Part(self, range(len(self))[index])
        number = range(len(self))[index] + 1
        if number == len(self) and self._end is not None:
            return self._end
        if self._near is None or self._near[0] != number:
            archive = self._store.archive(number)
            self._near = number, answer_from_archive(archive, lambda scales: self._restore(number, scales))
        return self._near[1]

    def append(self, result: ContactResult) -> None:
        """One more step: written if another may follow, else at hand only, as the end."""
        number = len(self) + 1
        if result.status in CONTINUES:
            self._store.write(number, result)
            self._near = number, result
        else:
            self._end = result
        self.statuses.append(result.status)


class _Part(Sequence[ContactResult]):
    """Some of the steps, read when they are asked for."""

    def __init__(self, steps: StoredSteps, numbers: range) -> None:
        self._steps, self._numbers = steps, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, index: int) -> ContactResult: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[ContactResult]: ...

    def __getitem__(self, index: int | slice) -> ContactResult | Sequence[ContactResult]:
        if isinstance(index, slice):
            return _Part(self._steps, self._numbers[index])
        return self._steps[self._numbers[index]]


class StepStore:
    """A folder of steps.

    Parameters
    ----------
    folder : str or Path
        Made if it is missing.
    fingerprint : str
        Digest of the problems and options.
    planned : int
        Number of steps.

    Raises
    ------
    InputError
        If the folder cannot be written, holds other files, or the steps of another history.

    """

    def __init__(self, folder: str | Path, fingerprint: str, planned: int) -> None:
        self._folder, self._fingerprint, self._planned = writable_folder(folder, "store"), fingerprint, planned
        header = self._folder / _HEADER
        if header.exists():
            self._check(header)
        elif any(not path.name.startswith(".writing-") for path in self._folder.iterdir()):  # a write cut short
            raise InputError("store", str(folder), "holds other files: give an empty folder, or a new name")
        else:
            document = {"format": _FORMAT, "version": _VERSION, "fingerprint": fingerprint, "planned": planned}
            write_text(header, json.dumps(document, indent=2) + "\n")

    def begun(self, restore: Restore) -> StoredSteps:
        """The steps there are."""
        return StoredSteps(self, restore)

    def write(self, number: int, result: ContactResult) -> None:
        """Keep a step."""
        write_archive(self._path(number), step_arrays(result) | {STORE: self._fingerprint})

    def archive(self, number: int) -> Archive:
        """A step, as it was read.

        Raises
        ------
        InputError
            If it cannot be read, was changed, or belongs to another history.

        """
        archive = Archive(self._path(number))
        if not archive.intact or archive.text(STORE) != self._fingerprint:
            remedy = "was changed, or belongs to another history: delete the file, and run the history again"
            raise InputError("store", archive.path, remedy)
        return archive

    def statuses(self) -> list[Status]:
        """Statuses of the steps up to the first that is missing or damaged."""
        found: list[Status] = []
        while len(found) < self._planned:
            try:
                archive = self.archive(len(found) + 1)
                found.append(Status(archive.text("status")))
            except (InputError, ValueError):
                break
        return found

    def _path(self, number: int) -> Path:
        return self._folder / f"step-{number:06}.npz"

    def _check(self, header: Path) -> None:
        """`InputError` unless the header is that of a store of this history."""
        remedy = "is not the description of stored steps: give an empty folder, or a new name"
        try:
            document: Any = json.loads(header.read_text(encoding="utf-8"))
            known = (document["format"], document["version"])
            planned, fingerprint = document["planned"], document["fingerprint"]
        except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
            raise InputError("store", str(header), remedy) from error
        if known != (_FORMAT, _VERSION):
            raise InputError("store", str(header), remedy)
        if fingerprint != self._fingerprint:
            other = f"holds another history, of {planned} steps: problems or options differ. Give a new folder"
            raise InputError("store", str(self._folder), other)
