"""The project's exception tree, and names that a user gives: which there are, and which one was meant.

`QVIError` is the root of everything the project raises on purpose; the mechanics package adds no second root.
"""

import pickle
from collections.abc import Collection, Iterable, Mapping
from typing import Any, TypeVar

_Value = TypeVar("_Value")


class QVIError(Exception):
    """Root of the project's exceptions: catch this one to catch them all."""


class InputError(QVIError, ValueError):
    """Something the caller gave is wrong.

    The message is one line: the field, the value found there, and what to do about it.

    Attributes
    ----------
    field : str
        Name of the offending argument or file entry, e.g. ``"Contact.friction"``.
    value : object
        The value found.
    remedy : str
        A sentence telling what to give instead.

    """

    def __init__(self, field: str, value: object, remedy: str) -> None:
        self.field = field
        self.value = value
        self.remedy = remedy
        super().__init__(f"{field}: {_shorten(value)}: {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, as worker processes send it; a value that cannot be pickled goes along as text."""
        value = self.value
        try:
            pickle.dumps(value)
        except Exception:  # whatever the value's own code raises
            value = _shorten(value)
        return type(self), (self.field, value, self.remedy), {"args": self.args}


class UnknownNameError(InputError, KeyError):
    """A name that nothing has: the message lists the names there are, and the one that was probably meant."""

    __str__ = Exception.__str__  # KeyError's is the repr


class SolverUnavailableError(InputError):
    """A solver was asked for that is unknown or not installed; the message lists what is."""


class SolveError(QVIError):
    """Raised on request (``throw=True``) when a solve ends without a certified answer."""


def plain(value: object) -> str:
    """`repr` with plain numbers: 0.2, not np.float64(0.2), also inside lists, tuples and objects."""
    import numpy as np  # errors are raised before it is needed

    if np.lib.NumpyVersion(np.__version__) < "2.0.0":
        return repr(value)
    with np.printoptions(legacy="1.25"):
        return repr(value)


def one_line(text: str, most: int = 500) -> str:
    """The text without line breaks, cut where it has more characters."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def _shorten(value: object) -> str:
    """`plain` on one line, in at most 120 characters: of a path its end says more than its middle."""
    text = " ".join(plain(value).split())
    return text if len(text) <= 120 else f"{text[:59]}…{text[-59:]}"


def closest(word: object, words: Iterable[str]) -> str | None:
    """The one of `words` that is most like a mistyped word, capitals aside; None if none is."""
    if not isinstance(word, str):
        return None
    import difflib  # slow to import, and only mistakes need it

    lowered = {known.lower(): known for known in words}
    found = difflib.get_close_matches(word.lower(), lowered, n=1)
    return lowered[found[0]] if found else None


def nearest_first(name: object, known: Iterable[str], remedy: str) -> str:
    """A remedy for an unknown name, behind the one of those known that is most like it."""
    near = closest(name, known)
    return remedy if near is None else f"did you mean {near!r}? Otherwise: {remedy}"


def known_name(field: str, name: object, known: Mapping[str, Collection[str]], otherwise: str = "") -> str:
    """The name if it is one of those known; else `UnknownNameError`, which lists all of them, the closest one first.

    They are known by what they are names of, in the plural: ``{"edge sets": ("top", "left")}``; `otherwise` is what
    else could be done, such as "add it by with_edges()".
    """
    for each in known.values():
        if isinstance(name, str) and name in each:
            return name
    every = [one for each in known.values() for one in each]
    listed = " or of the ".join(f"{kind} ({', '.join(each) or 'there are none'})" for kind, each in known.items())
    remedy = f"name one of the {listed}" + (f", or {otherwise}" if otherwise else "")
    raise UnknownNameError(field, name, nearest_first(name, every, remedy))


class Named(dict[str, _Value]):
    """A mapping that errors call `field`; its keys are names of a `kind`, in the plural.

    ``mapping[name]`` answers an unknown name with those there are, by `UnknownNameError`, a `KeyError` too; ``name in
    mapping`` and ``mapping.get(name)`` are as usual.
    """

    def __init__(self, field: str, kind: str, values: Mapping[str, _Value]) -> None:
        super().__init__(values)
        self._field, self._kind = field, kind

    def __missing__(self, name: object) -> _Value:
        return self[known_name(self._field, name, {self._kind: self})]  # which raises
