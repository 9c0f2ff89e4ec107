"""The front of a room: its names are imported from the room itself, and their modules are loaded on first use.

    with deferred(__name__) as homes:
        from solvers.solve import solve_qvi
    __getattr__ = front(__name__, homes)

Type checkers, and whatever else reads imports, see those in the block as they are.
"""

import builtins
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pkgutil import iter_modules
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any


@contextmanager
def deferred(package: str) -> Iterator[dict[str, str]]:
    """Imports of the package in the block load nothing, and bind no name: they give names with their modules."""
    homes, own, load = dict[str, str](), vars(sys.modules[package]), builtins.__import__

    def noted(module: str, *given: Any, **named: Any) -> Any:
        if not given or given[0] is not own:  # another package's, in another thread
            return load(module, *given, **named)
        homes.update(dict.fromkeys(given[2], module))
        return SimpleNamespace(**dict.fromkeys(given[2]))

    builtins.__import__ = noted  # type: ignore[assignment]  # which import statements call
    try:
        yield homes
    finally:
        builtins.__import__ = load
        for name in homes:
            own.pop(name, None)


def front(room: str, homes: Mapping[str, str] | None = None) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package: `homes` says which module has a name, see `deferred`.

    Without them all its modules are asked; what a module imports is not its own, and a name of two has no answer.
    """

    def loaded(name: str) -> Any:
        if homes is not None and name in homes:
            return getattr(import_module(homes[name]), name)
        modules = []
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
