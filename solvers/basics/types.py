"""Names for the arrays of (D2): dense vectors, and matrices in compressed columns or rows, all float64.

Also what all rooms do with such data: what a pickle holds of an object, and tables in pandas.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from importlib import import_module
from importlib.util import find_spec
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

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
        kept = {name for name, value in values.items() if _is_fixed(value)}
        plain = {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in values.items()}
        return {"fields": plain, "fixed": kept}

    def __setstate__(self, state: dict[str, Any]) -> None:
        values, kept = state["fields"], state["fixed"]
        self.__dict__.update({name: _fixed(value) if name in kept else value for name, value in values.items()})


def _is_fixed(value: object) -> bool:
    return isinstance(value, MappingProxyType) or (isinstance(value, np.ndarray) and not value.flags.writeable)


def _fixed(value: Any) -> Any:
    """A mapping or array that cannot be changed."""
    if isinstance(value, dict):
        return MappingProxyType(value)
    value.flags.writeable = False
    return value


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
