"""Steps of a history in a folder: one archive for each step that is done, written whole or not at all.

`store.json` tells which history it is: a digest of all its problems and options. Beside it stands `step-000001.npz`
for the first step, and so on. After an interruption the steps up to the first that is missing or damaged are kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from copy import copy
from pathlib import Path
from typing import Any, Final, overload

from qvi_contact.basics.writing import writable_folder, write_text
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.scaling import Scales
from qvi_contact.errors import InputError
from qvi_contact.files.archive import STORE, Archive, answer_from_archive, solution_arrays, write_archive
from qvi_contact.solution.history import CONTINUES
from qvi_contact.solution.result import ContactResult
from solvers import Status

_FORMAT: Final = "qvi_contact steps"
_VERSION: Final = 1

Restore = Callable[[int, Scales], Discretization]
"""The problem of a step, from 1, in these units, without earlier slip."""


class StepStore(Sequence[ContactResult]):
    """Results of steps, read when they are asked for; the last one that was read or added is at hand.

    Parameters
    ----------
    folder : str or Path
        Made if it is missing.
    fingerprint : str
        Digest of the problems and options.
    planned : int
        Number of steps.
    restore : function
        Makes the problem of a step again.

    Attributes
    ----------
    statuses : list of Status
        Of each step there is.

    Raises
    ------
    InputError
        If the folder cannot be written, holds other files, or the steps of another history; by what reads a step, if
        its file cannot be read, was changed, or belongs to another history.

    """

    def __init__(self, folder: str | Path, fingerprint: str, planned: int, restore: Restore) -> None:
        self._folder, self._fingerprint = writable_folder(folder, "store"), fingerprint
        self._restore = restore
        self._end: ContactResult | None = None  # a step that is not done, and in no file
        self._near: tuple[int, ContactResult] | None = None
        self._part: range | None = None  # numbers of steps, where only some are meant
        header, document = self._folder / "store.json", {"format": _FORMAT, "version": _VERSION}
        if header.exists():
            remedy = "is not the description of stored steps: give an empty folder, or a new name"
            try:
                found: Any = json.loads(header.read_text(encoding="utf-8"))
                known, count, other = {n: found[n] for n in document}, found["planned"], found["fingerprint"]
            except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                raise InputError("store", str(header), remedy) from error
            if known != document:
                raise InputError("store", str(header), remedy)
            if other != fingerprint:
                remedy = f"holds another history, of {count} steps: problems or options differ. Give a new folder"
                raise InputError("store", str(self._folder), remedy)
        elif any(not path.name.startswith(".writing-") for path in self._folder.iterdir()):  # a write cut short
            raise InputError("store", str(folder), "holds other files: give an empty folder, or a new name")
        else:
            told = {**document, "fingerprint": fingerprint, "planned": planned}
            write_text(header, json.dumps(told, indent=2) + "\n")
        self.statuses: list[Status] = []
        while len(self.statuses) < planned:
            try:
                self.statuses.append(Status(self._archive(len(self.statuses) + 1).text("status")))
            except (InputError, ValueError):
                break

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, index: int) -> ContactResult: ...

    @overload
    def __getitem__(self, index: slice) -> Sequence[ContactResult]: ...

    def __getitem__(self, index: int | slice) -> ContactResult | Sequence[ContactResult]:
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
            write_archive(self._path(number), solution_arrays(result, tried=False) | {STORE: self._fingerprint})
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
