"""Frozen dataclasses that are made in a third of the time, which is felt where a command loads a hundred of them.

The standard library compiles up to six functions for each class before Python 3.13. Here only the constructor is
compiled, and all classes share the others. For type checkers this is the standard decorator.
"""

import dataclasses
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(*, frozen=False, eq=True, repr=True, **more):  # noqa: A002 - as the standard library has it
        """`dataclasses.dataclass`; a frozen class shares all but its constructor with other ones."""

        def decorated(cls):
            if frozen:
                shared = {"__setattr__": _set, "__delattr__": _delete}
                shared |= {"__eq__": _equal, "__hash__": _hash} if eq else {}
                shared |= {"__repr__": _text} if repr else {}
                for name, function in shared.items():
                    if cls.__dict__.get(name) is None:
                        setattr(cls, name, function)
            return dataclasses.dataclass(eq=eq and not frozen, repr=repr and not frozen, **more)(cls)

        return decorated


def _set(self: Any, name: str, value: object) -> None:
    """Each field once, by the constructor."""
    if name in self.__dict__ or name not in self.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot assign to field {name!r}")
    self.__dict__[name] = value


def _delete(_self: object, name: str) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot delete field {name!r}")


def _compared(self: Any) -> tuple[Any, ...]:
    return tuple(getattr(self, each.name) for each in dataclasses.fields(self) if each.compare)


def _equal(self: Any, other: object) -> Any:
    return _compared(self) == _compared(other) if type(other) is type(self) else NotImplemented


def _hash(self: Any) -> int:
    return hash(_compared(self))


def _text(self: Any) -> str:
    shown = [f"{each.name}={getattr(self, each.name)!r}" for each in dataclasses.fields(self) if each.repr]
    return f"{type(self).__qualname__}({', '.join(shown)})"
