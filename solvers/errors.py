"""The exceptions of the project, all derived from `QVIError`, and suggestions for mistyped names."""

import pickle
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, TypeVar

_Value = TypeVar("_Value")


class QVIError(Exception):
    """Base class of all exceptions that the project raises on purpose."""


class InputError(QVIError, ValueError):
    """An argument, or an entry of a file, is wrong.

    The message is one line: the field, its value, and what to do about it.

    Attributes
    ----------
    field : str
        Name of the argument or entry, e.g. ``"Contact.friction"``.
    value : object
        Its value.
    remedy : str
        A sentence that says what to give instead.

    """

    def __init__(self, field: str, value: object, remedy: str) -> None:
        self.field = field
        self.value = value
        self.remedy = remedy
        super().__init__(f"{field}: {_shorten(value)}: {remedy}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickles, by which worker processes send errors; a value that cannot be pickled becomes its text."""
        value = self.value
        try:
            pickle.dumps(value)
        except Exception:  # the value's own code may raise anything
            value = _shorten(value)
        return type(self), (self.field, value, self.remedy), {"args": self.args}


class UnknownNameError(InputError, KeyError):
    """An unknown name; the message lists all known names, and the one that was probably meant."""

    __str__ = Exception.__str__  # KeyError.__str__ is the repr of the message


class SolverUnavailableError(InputError):
    """A solver, method or factorisation is unknown or not installed; the message lists the available ones."""


class SolveError(QVIError):
    """Raised on request (``throw=True``) when a solve ends without the status "solved"."""


def plain(value: object) -> str:
    """`repr` with plain numbers: 0.2, not np.float64(0.2), also inside lists, tuples and objects."""
    import numpy as np  # imported here, as most programs that import errors do not need it

    if np.lib.NumpyVersion(np.__version__) < "2.0.0":
        return repr(value)
    with np.printoptions(legacy="1.25"):
        return repr(value)


def one_line(text: str, most: int = 500) -> str:
    """The text without line breaks, cut to at most `most` characters."""
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"


def counted(number: int, noun: str) -> str:
    """A number with its noun, in the plural but for 1."""
    return f"{number} {noun}{'s' if number != 1 else ''}"


def _shorten(value: object) -> str:
    """`plain` on one line, cut in the middle to at most 120 characters: the end of a path tells more."""
    text = " ".join(plain(value).split())
    return text if len(text) <= 120 else f"{text[:59]}…{text[-59:]}"


def closest(word: object, words: Iterable[str]) -> str | None:
    """The one of `words` that is most similar to a mistyped word, regardless of case; None if no word is similar."""
    if not isinstance(word, str):
        return None
    import difflib  # slow to import, and only mistakes need it

    lowered = {known.lower(): known for known in words}
    matches = difflib.get_close_matches(word.lower(), lowered, n=1)
    return lowered[matches[0]] if matches else None


def nearest_first(name: object, known: Iterable[str], remedy: str) -> str:
    """The remedy for an unknown name, after a question with the most similar known name, if there is one."""
    suggestion = closest(name, known)
    return remedy if suggestion is None else f"did you mean {suggestion!r}? Otherwise: {remedy}"


def known_name(field: str, name: object, known: Mapping[str, Collection[str]], otherwise: str = "") -> str:
    """The name if it is known; else `UnknownNameError`, which lists the known names and suggests the most similar.

    `known` has the names by their kind, in the plural: ``{"edge sets": ("top", "left")}``. `otherwise` is another
    remedy, such as "add it by with_edges()".
    """
    for names in known.values():
        if isinstance(name, str) and name in names:
            return name
    all_names = [each for names in known.values() for each in names]
    listed = " or of the ".join(f"{kind} ({', '.join(names) or 'there are none'})" for kind, names in known.items())
    remedy = f"name one of the {listed}" + (f", or {otherwise}" if otherwise else "")
    raise UnknownNameError(field, name, nearest_first(name, all_names, remedy))


class Named(Mapping[str, _Value]):
    """A read-only mapping whose errors list its keys; `field` is its name, `kind` says in the plural what these name.

    ``mapping[name]`` raises `UnknownNameError`, which is a `KeyError` too, for an unknown name.
    """

    def __init__(self, field: str, kind: str, values: Mapping[str, _Value]) -> None:
        self._field, self._kind, self._values = field, kind, dict(values)

    def __getitem__(self, name: str) -> _Value:
        return self._values[known_name(self._field, name, {self._kind: self._values})]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return repr(self._values)
