"""Results as pandas tables, which need the extra ``frame``."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from solvers.basics.types import Module, load
from solvers.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame


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
