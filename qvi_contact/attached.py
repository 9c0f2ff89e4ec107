"""Attributes of an object that rooms above its own compute."""

from importlib import import_module
from typing import Any, Final

HOMES: Final[dict[str, tuple[str, str]]] = {}
"""By attribute of `Attached` the room and its function of one object; the package root fills this in."""


class Attached:
    """An object with the attributes in `HOMES`: computed on first use, then kept."""

    def __getattr__(self, name: str) -> Any:
        if name not in HOMES:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        room, function = HOMES[name]
        found = self.__dict__[name] = getattr(import_module(room), function)(self)
        return found
