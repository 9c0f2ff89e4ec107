"""The front of a package: its modules are loaded when one of their names is first imported from the package."""

import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pkgutil import iter_modules
from types import FunctionType, ModuleType
from typing import Any


def front(room: str, homes: Mapping[str, tuple[str, ...]] | None = None) -> Callable[[str], Any]:
    """The ``__getattr__`` of the package `room`; `homes` maps its modules to their public names.

    Without `homes` all its modules are searched. Names that a module has imported do not count, and a name that two
    modules define is an AttributeError.
    """

    def loaded(name: str) -> Any:
        modules = [home for home, names in (homes or {}).items() if name in names]
        if homes is None and not name.startswith("_"):
            modules = [module.name for module in iter_modules(sys.modules[room].__path__)]
        values = {}
        for home in modules if name not in modules else ():
            value = getattr(import_module(f"{room}.{home}"), name, sys)
            imported = isinstance(value, type | FunctionType) and value.__module__ != f"{room}.{home}"
            if not (imported or isinstance(value, ModuleType)):
                values[id(value)] = value
        if len(values) != 1:
            raise AttributeError(f"module {room!r} has {'no' if not values else 'more than one'} attribute {name!r}")
        return next(iter(values.values()))

    return loaded
