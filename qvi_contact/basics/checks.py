"""Checks of numbers and functions of position from users."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from qvi_contact.errors import InputError, place_of
from solvers.basics.checks import (
    finite_number,
    fraction,
    function_or_none,
    mapping,
    one_of,
    positive_number,
    real_array,
    true_or_false,
    whole_number,
)
from solvers.errors import known_name

__all__ = [
    "BoolArray", "Field", "FloatArray", "IntArray", "acts", "check_field", "evaluate", "finite_number", "fraction",
    "function_or_none", "instance_of", "mapping", "names_among", "one_of", "positive_number", "real_array",
    "true_or_false", "whole_number",
]  # fmt: skip

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

#: A number, or a function of the coordinate arrays ``(x, y)`` that returns an array of the same shape.
Field: TypeAlias = float | Callable[[FloatArray, FloatArray], ArrayLike]


def instance_of(kind: type, name: str, value: object, remedy: str = "") -> None:
    """`InputError`, with the remedy given, unless the value is an instance of a class."""
    if not isinstance(value, kind):
        raise InputError(name, value, remedy or f"give a {kind.__name__}")


def names_among(field: str, names: object, kind: str, known: Sequence[str], least: int = 1) -> tuple[str, ...]:
    """The names in a list of at least `least`, each of them `known`; `kind` is the plural noun for them in messages."""
    if isinstance(names, str) or not isinstance(names, Sequence) or len(names) < least:
        raise InputError(field, names, f"give a list of {kind}: {', '.join(known) or 'there are none'}")
    return tuple(known_name(field, name, {kind: known}) for name in names)


def acts(field: Field) -> bool:
    """Whether a field is a function or a number other than zero."""
    return callable(field) or bool(field != 0.0)  # no bool of NumPy


def check_field(field: str, value: Any, *, minimum: float | None = None) -> Field:
    """A field, checked as far as possible before it is evaluated: a function, or a number in its range as a float."""
    if callable(value):
        function: Field = value
        return function
    if isinstance(value, str):  # as in files
        raise InputError(field, value, f"give a number, or a function of (x, y), such as Expression({value!r})")
    number = finite_number(field, value)
    if minimum is not None and number < minimum:
        raise InputError(field, value, f"give a number of at least {minimum:g}")
    return number


def evaluate(name: str, field: Field, x: FloatArray, y: FloatArray, *, minimum: float | None = None) -> FloatArray:
    """Values of a field, called `name` in messages, at points (x, y) of any shape [length].

    `InputError` if the function fails, or its values have another shape, are not finite, or are below `minimum`.
    Values below it by rounding only, as 0.3 − 0.1 · 3 for 0, become `minimum`; so do those that rounding of the points
    explains, as of y on a line where y is −1e-17.
    """
    if not callable(field):
        return np.full(np.shape(x), check_field(name, field, minimum=minimum))
    try:
        returned = real_array("value", field(x.copy(), y.copy()))
        if returned.size != 1 and returned.shape != np.shape(x):  # NumPy would broadcast a row
            raise ValueError(f"shape {returned.shape} in place of {np.shape(x)}")
        values = np.array(np.broadcast_to(returned, np.shape(x)))
    except TimeoutError:  # of the caller's time limit
        raise
    except Exception as error:
        remedy = f"the function must take two arrays (x, y) and return an array of their shape ({error})"
        raise InputError(name, field, remedy) from error
    is_bad = ~np.isfinite(values)
    if minimum is not None:
        rounding = 1e-14 * np.abs(values[~is_bad]).max(initial=0.0)
        values[(values < minimum) & (values >= minimum - rounding)] = minimum
        if (values < minimum).any():
            shift = 1e-14 * max(float(np.abs(each).max(initial=0.0)) for each in (x, y))
            with suppress(InputError):  # the field need not be defined beside the points
                moved = [evaluate(name, field, x + h, y + k) for h in (-shift, shift) for k in (-shift, shift)]
                values[(values < minimum) & (np.max(moved, axis=0) >= minimum)] = minimum
        is_bad |= values < minimum
    if is_bad.any():
        index = np.unravel_index(np.argmax(is_bad), is_bad.shape)
        limit = "" if minimum is None else f" of at least {minimum:g}"
        place = place_of((x[index], y[index]))
        raise InputError(name, float(values[index]), f"give finite values{limit}; found this one at {place}")
    return values
