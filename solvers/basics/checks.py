"""Checks of arguments: numbers, arrays of real numbers, words, mappings, functions. All raise `InputError`."""

from collections.abc import Mapping, Sequence
from math import inf, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.errors import InputError


def finite_number(field: str, value: object) -> float:
    """`value` as a float; `InputError` unless it is one finite real number."""
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(field, value, "give one real number")
    try:
        number = float(value)
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise InputError(field, value, "give a finite number")
    return number


def positive_number(field: str, value: object) -> float:
    """`value` as a float; `InputError` unless it is one finite number above zero."""
    number = finite_number(field, value)
    if number <= 0:
        raise InputError(field, value, "give a number greater than 0")
    return number


def fraction(field: str, value: object) -> float:
    """`value` as a float; `InputError` unless it is one number with 0 < value < 1."""
    if isinstance(value, bool) or not (isinstance(value, int | float | np.integer | np.floating) and 0 < value < 1):
        raise InputError(field, value, "give a number between 0 and 1")
    return float(value)


def whole_number(field: str, value: object, largest: int = 2**31 - 1, least: int = 1) -> int:
    """`value` as an int; `InputError` unless it is a whole number from `least` to `largest`."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)
    if not is_whole or not least <= value <= largest:  # type: ignore[operator]  # a number by now
        raise InputError(field, value, f"give a whole number from {least} to {largest}")
    return int(value)  # type: ignore[call-overload,no-any-return]


def one_of(field: str, value: object, choices: Sequence[str]) -> None:
    """`InputError`, which lists the choices, unless the value is one of them."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(field, value, f"give one of {', '.join(choices)}")


def mapping(field: str, value: object, what: str, *, optional: bool = False) -> Mapping[Any, Any]:
    """The value if it is a mapping, {} for None if `optional`; else `InputError`, which asks for one of `what`."""
    value = {} if value is None and optional else value
    if not isinstance(value, Mapping):
        raise InputError(field, value, f"give a mapping of {what}")
    return value


def true_or_false(field: str, value: object) -> bool:
    """`value` as a bool; `InputError` unless it is True, False, 1 or 0."""
    if not isinstance(value, bool | np.bool_ | int | np.integer) or value not in (0, 1):
        raise InputError(field, value, "give True or False")
    return bool(value)


def function_or_none(field: str, value: object) -> None:
    """`InputError` unless the value is callable or None."""
    if value is not None and not callable(value):
        raise InputError(field, value, "give a function, or leave it out")


def real_array(field: str, value: object, remedy: str = "give real numbers") -> NDArray[np.float64]:
    """A copy as an array of float64; `InputError` unless all entries are real numbers."""
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value.copy()
    try:
        array = np.asanyarray(value)
        entries = array.flat if array.dtype.kind == "O" else ()
        # NumPy would convert these to numbers: None to NaN, texts to their value, complex numbers to the real part
        is_other = (each is None or isinstance(each, complex | np.complexfloating | str | bytes) for each in entries)
        has_mask = type(array) is not np.ndarray and isinstance(array, np.ma.MaskedArray) and bool(array.mask.any())
        if array.dtype.kind in "biufO" and not has_mask and not any(is_other):  # NumPy would drop the mask
            with np.errstate(over="ignore"):  # callers refuse infinity if they must
                return np.array(array, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(field, value, remedy) from error
    raise InputError(field, value, remedy)
