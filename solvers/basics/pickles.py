"""What is pickled of objects that remember what they have computed."""

from dataclasses import fields
from types import MappingProxyType
from typing import Any

import numpy as np


class Stated:
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
