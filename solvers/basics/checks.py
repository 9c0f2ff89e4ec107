"""Checks of what callers hand in: numbers, arrays of real numbers, names of which it says which one was meant."""

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from solvers.errors import InputError, UnknownNameError

_Value = TypeVar("_Value")


def finite_number(field: str, value: object) -> float:
    """Return `value` as a float, or say that `field` must be one finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(field, value, "give one real number")
    try:
        number = float(value)
    except OverflowError:
        number = np.inf
    if not np.isfinite(number):
        raise InputError(field, value, "give a finite number")
    return number


def positive_number(field: str, value: object) -> float:
    """Return `value` as a float, or say that `field` must be one finite number above zero."""
    number = finite_number(field, value)
    if number <= 0:
        raise InputError(field, value, "give a number greater than 0")
    return number


def whole_number(field: str, value: object, largest: int = 2**31 - 1) -> int:
    """Return `value` as an int, or say that `field` must be a whole number from 1 to `largest`."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not 1 <= value <= largest:  # type: ignore[operator]  # a number by now
        raise InputError(field, value, f"give a whole number from 1 to {largest}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def one_of(field: str, value: object, choices: Iterable[str], remedy: str = "") -> str:
    """The value if it is one of the choices; else `InputError`, whose remedy lists them unless another is given."""
    known = tuple(choices)
    if not isinstance(value, str) or value not in known:
        raise InputError(field, value, remedy or f"give one of {', '.join(known)}")
    return value


def mapping(field: str, value: object, what: str) -> Mapping[Any, Any]:
    """The value if it is a mapping; else `InputError`, whose remedy says what of."""
    if not isinstance(value, Mapping):
        raise InputError(field, value, f"give a mapping of {what}")
    return value


def true_or_false(field: str, value: object) -> bool:
    """Return `value` as a bool, or say that `field` must be True or False; 1 and 0 count as these."""
    if not isinstance(value, bool | np.bool_ | int) or value not in (0, 1):
        raise InputError(field, value, "give True or False")
    return bool(value)


def function_or_none(field: str, value: object) -> None:
    """Say that `field` must be a function, or left out."""
    if value is not None and not callable(value):
        raise InputError(field, value, "give a function, or leave it out")


def real_array(field: str, value: object, remedy: str = "give real numbers") -> NDArray[np.float64]:
    """A copy as an array of float64; `InputError` for anything but real numbers, such as complex ones and texts."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value.copy()
    try:
        array = np.asarray(value)
        entries = array.flat if array.dtype.kind == "O" else ()
        if array.dtype.kind in "biufO" and not any(map(_is_no_number, entries)):
            with np.errstate(over="ignore"):  # infinity is refused where it must be
                return np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(field, value, remedy) from error
    raise InputError(field, value, remedy)


def _is_no_number(entry: object) -> bool:
    """Whether Python would make a number of it that is not the one given."""
    return entry is None or isinstance(entry, complex | np.complexfloating | str | bytes)


def closest(word: object, words: Iterable[str]) -> str | None:
    """The one of `words` that is most like a mistyped word, capitals aside; None if none is."""
    if not isinstance(word, str):
        return None
    import difflib  # slow to import, and only mistakes need it

    lowered = {known.lower(): known for known in words}
    found = difflib.get_close_matches(word.lower(), lowered, n=1)
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
