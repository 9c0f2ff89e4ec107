"""Types of the arrays of (D2), all float64; `PicklesFields` for pickles, `Kept` for shared objects, pandas tables."""

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
"""Two-dimensional float64 array in compressed columns, the form that every back end reads.

Not csc_array[np.float64]: scipy-stubs does not know that such an array times a vector is a vector.
"""

SparseRows: TypeAlias = csr_array
"""Two-dimensional float64 array in compressed rows."""

Module: TypeAlias = Any
"""An optional library without type information, imported where it is used."""


def load(name: str) -> Module:
    """The library of this name, imported now."""
    return import_module(name)


# Pickles of objects that keep computed quantities.


class PicklesFields:
    """A dataclass whose pickles and copies have its fields only; read-only arrays and mappings stay read-only.

    Quantities that were computed from the fields, such as a factorisation, are computed again when they are needed.
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


# Objects that are made once and shared.

_Made = TypeVar("_Made")

_MOST_KEPT: Final = 4  # objects of one kind


def read_only(*matrices: Any) -> None:
    """Make arrays and sparse matrices that several problems share read-only."""
    for matrix in matrices:
        if isinstance(matrix, np.ndarray):
            matrix.flags.writeable = False
        else:
            matrix.sum_duplicates()  # sorts the entries too, which SciPy would else do later, in place
            read_only(matrix.data, matrix.indices, matrix.indptr)


class Kept:
    """A cache of the latest few objects of each kind.

    The objects must not refer to the owner of the cache. Then their memory, such as that of a large factorisation, is
    freed at once with the owner, and not by the next garbage collection.
    """

    def __init__(self) -> None:
        self._objects: dict[type, dict[Hashable, Any]] = {}
        self._lock = Lock()

    def __call__(self, kind: type[_Made], key: Hashable, make: Callable[[], _Made]) -> _Made:
        """The object of a kind for a key, made if there is none; the same for all threads."""
        with self._lock:
            known = self._objects.setdefault(kind, {})
            if key in known:
                known[key] = known.pop(key)  # the latest comes last
                return known[key]  # type: ignore[no-any-return]  # of its kind
        made = make()
        with self._lock:
            made = known.setdefault(key, made)
            if len(known) > _MOST_KEPT:
                del known[next(iter(known))]
        return made


# Results as pandas tables, which need the extra ``frame``.


def pandas() -> Module:
    """The package pandas; `InputError` with the command that installs it if it is missing."""
    if find_spec("pandas") is None:
        remedy = "tables of results need pandas: python -m pip install pandas"
        raise InputError("to_frame", "pandas", remedy)
    return load("pandas")


def frame(columns: Mapping[str, Any], units: Mapping[str, str] | None = None) -> "DataFrame":
    """A table of these columns; a column in `units` gets its unit in the heading, as in "slip [mm]"."""
    units = units or {}
    titled = {f"{name} [{units[name]}]" if name in units else name: values for name, values in columns.items()}
    table: DataFrame = pandas().DataFrame(titled)
    return table


def columns_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """Rows, all with the same keys, as columns; {} without rows."""
    return {name: [row[name] for row in rows] for name in (rows[0] if rows else ())}
