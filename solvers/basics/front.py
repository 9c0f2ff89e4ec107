"""The front of a room: its names are imported from the room itself, and their modules are loaded on first use."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import FunctionType, ModuleType
from typing import Any


def front(room: str, homes: Mapping[str, tuple[str, ...]] | None = None) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: `homes` says which of its modules has which names.

    Without them a name is looked for in one module of the room after the other; what a module imports is not its own.
    """

    def loaded(name: str) -> Any:
        modules = [home for home, names in (homes or {}).items() if name in names]
        if homes is None and not name.startswith("_"):
            modules = [module.name for module in iter_modules(sys.modules[room].__path__)]
        for home in modules if name not in modules else ():
            found = getattr(import_module(f"{room}.{home}"), name, sys)
            imported = isinstance(found, type | FunctionType) and found.__module__ != f"{room}.{home}"
            if not (imported or isinstance(found, ModuleType)):
                return found
        raise AttributeError(f"module {room!r} has no attribute {name!r}")

    return loaded
