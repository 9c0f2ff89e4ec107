"""Names for the arrays of (D2): dense vectors, and matrices in compressed columns or rows, all float64.

Also what all rooms do with such data: what a pickle holds of an object, what is made once, and tables in pandas.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from threading import Lock
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from solvers.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

Vector: TypeAlias = NDArray[np.float64]
"""One-dimensional float64 array."""

BoolVector: TypeAlias = NDArray[np.bool_]
"""One-dimensional boolean array."""

IntVector: TypeAlias = NDArray[np.int64]
"""One-dimensional integer array."""

Matrix: TypeAlias = NDArray[np.float64]
"""Two-dimensional dense float64 array."""

Sparse: TypeAlias = csc_array
"""Two-dimensional float64 array in compressed columns, the one form every back end reads.

Not csc_array[np.float64]: SciPy 1.15 cannot be asked for that, and scipy-stubs does not know that such an array times a
vector is a vector.
"""

SparseRows: TypeAlias = csr_array
"""The same in compressed rows."""

Module: TypeAlias = Any
"""A back end without type information, imported where it is used."""


def load(name: str) -> Module:
    """Import a back end now."""
    return import_module(name)


# What is pickled of objects that remember what they have computed.


class PicklesFields:
    """A dataclass of which pickles and copies hold the fields alone; what cannot be changed cannot be in them either.

    What was computed from the fields, such as a factorisation inside a library's memory, is computed again when it is
    needed.
    """

    def __getstate__(self) -> dict[str, Any]:
        values = {field.name: getattr(self, field.name) for field in fields(self)}  # type: ignore[arg-type]  # see above
        fixed = [name for name, value in values.items() if isinstance(value, np.ndarray) and not value.flags.writeable]
        views = {name: dict(value) for name, value in values.items() if isinstance(value, MappingProxyType)}
        return {"fields": values | views, "fixed": fixed, "views": list(views)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state["fields"])
        for name in state["fixed"]:
            self.__dict__[name].flags.writeable = False
        for name in state["views"]:
            self.__dict__[name] = MappingProxyType(self.__dict__[name])


# What is made once for several uses.


_Made = TypeVar("_Made")

_MOST: Final = 4  # of one kind


def read_only(*matrices: Any) -> None:
    """Arrays and sparse matrices that several problems share cannot be written to any more."""
    for matrix in matrices:
        if isinstance(matrix, np.ndarray):
            matrix.flags.writeable = False
        else:
            matrix.sum_duplicates()  # which sorts entries too: SciPy would do so in place when it likes
            read_only(matrix.data, matrix.indices, matrix.indptr)


class Kept:
    """The latest objects that were made of something, of each kind a few.

    What is kept must not refer to its owner: memory, such as that of a large factorisation, is then freed at once with
    the owner, and not when the garbage is collected next.
    """

    def __init__(self) -> None:
        self._found: dict[type, dict[Hashable, Any]] = {}
        self._lock = Lock()

    def __call__(self, kind: type[_Made], key: Hashable, make: Callable[[], _Made]) -> _Made:
        """The object of a kind for a key, made if there is none; several threads get the same."""
        with self._lock:
            known = self._found.setdefault(kind, {})
            if key in known:
                known[key] = known.pop(key)  # the latest comes last
                return known[key]  # type: ignore[no-any-return]  # of its kind
        made = make()
        with self._lock:
            made = known.setdefault(key, made)
            if len(known) > _MOST:
                del known[next(iter(known))]
        return made


# Results as pandas tables, which need the extra ``frame``.


def pandas() -> Module:
    """The package; `InputError` with the command that installs it where it is missing."""
    if find_spec("pandas") is None:
        remedy = "tables of results need pandas: python -m pip install pandas"
        raise InputError("to_frame", "pandas", remedy)
    return load("pandas")


def frame(columns: Mapping[str, Any], units: Mapping[str, str] | None = None) -> "DataFrame":
    """A table of these columns; names of those in `units` end in their unit, as in "slip [mm]"."""
    named = units or {}
    titled = {f"{name} [{named[name]}]" if name in named else name: values for name, values in columns.items()}
    table: DataFrame = pandas().DataFrame(titled)
    return table


def columns_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows with the same keys as columns; none without rows."""
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
