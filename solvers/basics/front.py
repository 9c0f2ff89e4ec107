"""The front of a room: its names are imported from the room itself, and their modules are loaded on first use."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import Any


def front(room: str, homes: Mapping[str, tuple[str, ...]] | None = None) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: `homes` says which of its modules has which names.

    Without them a name is looked for in one module of the room after the other.
    """
    modules = {name: module for module, names in (homes or {}).items() for name in names}

    def loaded(name: str) -> Any:
        if homes is None and not name.startswith("_"):
            known = [module.name for module in iter_modules(sys.modules[room].__path__)]
            for home in known if name not in known else ():
                if hasattr(found := import_module(f"{room}.{home}"), name):
                    return getattr(found, name)
        if name not in modules:
            raise AttributeError(f"module {room!r} has no attribute {name!r}")
        return getattr(import_module(f"{room}.{modules[name]}"), name)

    return loaded
