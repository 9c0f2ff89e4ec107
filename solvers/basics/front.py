"""The front of a room: its names are imported from the room itself, and their modules are loaded on first use."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def front(room: str, homes: Mapping[str, tuple[str, ...]]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: `homes` says which of its modules has which names."""
    modules = {name: module for module, names in homes.items() for name in names}

    def loaded(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        return getattr(import_module(f"{room}.{modules[name]}"), name)

    return loaded
