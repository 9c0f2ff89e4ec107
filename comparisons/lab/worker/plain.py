"""Plain values: None, booleans, integers, floats, texts, and lists and named mappings of these.

They mean the same in this process, in another one, on a cluster and in a file.
"""

import json
from collections.abc import Mapping
from typing import Any


def plain(value: Any, name: str) -> Any:
    """The same value in `dict`, `list` and Python's own scalars; `name` says where it stands.

    Sequences become lists, NumPy's scalars Python's, members of enumerations their values.

    Raises
    ------
    TypeError
        If something in it is not plain; the message says what, and where.

    """
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value, name)
    if isinstance(value, int | float):
        return int(value) if isinstance(value, int) else float(value)
    if isinstance(value, list | tuple):
        return [plain(item, f"{name}[{index}]") for index, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {_key(key, name): plain(item, f"{name}.{key}") for key, item in value.items()}
    return _scalar(value, name)


def _text(value: str, name: str) -> str:
    try:
        value.encode()
    except UnicodeEncodeError:
        raise TypeError(f"{name} is a text with half a character") from None
    return str.__str__(value)


def _key(key: Any, name: str) -> str:
    if not isinstance(key, str):
        raise TypeError(f"{name} has a key of type {type(key).__name__}, not a text")
    return _text(key, name)


def _scalar(value: Any, name: str) -> Any:
    """The value of a scalar of NumPy."""
    if getattr(value, "ndim", None) == 0 and hasattr(value, "item"):
        item = value.item()
        if type(item) is not type(value):
            return plain(item, name)
    raise TypeError(f"{name} is of type {type(value).__name__}, not a plain value")


def canonical(value: Any, finite: bool = False) -> str:
    """JSON of a plain value, the same for every order of the entries of mappings.

    Numbers keep their kind (1, 1.0 and true are three texts) and all their digits.

    Raises
    ------
    ValueError
        If `finite` and there is an infinite number or NaN in it.

    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=not finite)
