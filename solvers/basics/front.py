"""The front of a room: its names are imported from the room itself, and their modules are loaded on first use."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import FunctionType, ModuleType
from typing import Any


def front(room: str, homes: Mapping[str, tuple[str, ...]] | None = None) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: `homes` says which of its modules has which names.

    Without them all its modules are asked; what a module imports is not its own, and a name of two has no answer.
    """

    def loaded(name: str) -> Any:
        modules = [home for home, names in (homes or {}).items() if name in names]
        if homes is None and not name.startswith("_"):
            modules = [module.name for module in iter_modules(sys.modules[room].__path__)]
        found = {}
        for home in modules if name not in modules else ():
            value = getattr(import_module(f"{room}.{home}"), name, sys)
            imported = isinstance(value, type | FunctionType) and value.__module__ != f"{room}.{home}"
            if not (imported or isinstance(value, ModuleType)):
                found[id(value)] = value
        if len(found) != 1:
            raise AttributeError(f"module {room!r} has {'no' if not found else 'more than one'} attribute {name!r}")
        return next(iter(found.values()))

    return loaded
