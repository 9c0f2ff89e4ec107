"""Names that a user gives: which there are, which one was meant, and mappings that say so."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

from solvers.errors import UnknownNameError

_Value = TypeVar("_Value")


def closest(word: object, words: Iterable[str]) -> str | None:
    """The one of `words` that is most like a mistyped word, capitals aside; None if none is."""
    if not isinstance(word, str):
        return None
    lowered = {known.lower(): known for known in words}
    from difflib import get_close_matches  # of wrong names only

    found = get_close_matches(word.lower(), lowered, n=1)
    return lowered[found[0]] if found else None


def known_name(field: str, name: object, known: Mapping[str, Iterable[str]], otherwise: str = "") -> str:
    """The name if it is one of those known.

    Parameters
    ----------
    field : str
        The argument that holds it, for the error.
    name : object
        What was given.
    known : mapping
        The names that fit, by what they are names of, in the plural: ``{"edge sets": ("top", "left")}``.
    otherwise : str
        What else could be done, such as "add it by with_edges()".

    Raises
    ------
    UnknownNameError
        If it is none of them. The remedy lists all of them, the closest one first.

    """
    names = {kind: tuple(each) for kind, each in known.items()}
    every = [one for each in names.values() for one in each]
    if isinstance(name, str) and name in every:
        return name
    near = closest(name, every)
    listed = " or of the ".join(f"{kind} ({', '.join(each) or 'there are none'})" for kind, each in names.items())
    remedy = f"name one of the {listed}" + (f", or {otherwise}" if otherwise else "")
    raise UnknownNameError(field, name, remedy if near is None else f"did you mean {near!r}? Otherwise {remedy}")


class Named(dict[str, _Value]):
    """A mapping by name that answers an unknown one with those there are.

    Parameters
    ----------
    field : str
        What the mapping is called, for the error.
    kind : str
        What its keys are names of, in the plural.
    values : mapping
        The values by name.

    Raises
    ------
    UnknownNameError
        On ``mapping[name]``, a `KeyError` too: ``name in mapping`` and ``mapping.get(name)`` are as usual.

    """

    def __init__(self, field: str, kind: str, values: Mapping[str, _Value]) -> None:
        super().__init__(values)
        self._field, self._kind = field, kind

    def __missing__(self, name: object) -> _Value:
        return self[known_name(self._field, name, {self._kind: self})]  # which raises
