"""Checks of what callers hand in: numbers, arrays of real numbers, one of some words."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.errors import InputError


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


def fraction(field: str, value: object) -> float:
    """Return `value` as a float, or say that `field` must be one number between 0 and 1, and neither of them."""
    if isinstance(value, bool) or not (isinstance(value, int | float | np.integer | np.floating) and 0 < value < 1):
        raise InputError(field, value, "give a number between 0 and 1")
    return float(value)


def whole_number(field: str, value: object, largest: int = 2**31 - 1) -> int:
    """Return `value` as an int, or say that `field` must be a whole number from 1 to `largest`."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not 1 <= value <= largest:  # type: ignore[operator]  # a number by now
        raise InputError(field, value, f"give a whole number from 1 to {largest}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def one_of(field: str, value: object, choices: Sequence[str]) -> None:
    """Say that `field` must be one of the choices, and which there are."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(field, value, f"give one of {', '.join(choices)}")


def mapping(field: str, value: object, what: str, *, optional: bool = False) -> Mapping[Any, Any]:
    """The value if it is a mapping, an empty one for None if that is allowed; else `InputError` that says what of."""
    if value is None and optional:
        return {}
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
        # of these Python would make a number that is not the one given
        no_numbers = (each is None or isinstance(each, complex | np.complexfloating | str | bytes) for each in entries)
        if array.dtype.kind in "biufO" and not any(no_numbers):
            with np.errstate(over="ignore"):  # infinity is refused where it must be
                return np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(field, value, remedy) from error
    raise InputError(field, value, remedy)
