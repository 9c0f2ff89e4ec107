"""Checks of numbers that users choose for a study; what is wrong is an `InputError` with the option's name."""

import math
from collections.abc import Sequence

from qvi_contact.errors import InputError


def check_some(name: str, values: Sequence[float]) -> None:
    """There is at least one value."""
    if not values:
        raise InputError(name, values, "give at least one")


def check_at_least_one(name: str, value: int) -> None:
    """A whole number is positive."""
    if value < 1:
        raise InputError(name, value, "give a whole number ≥ 1")


def check_not_negative(name: str, value: float) -> None:
    """A number is finite and not negative."""
    if not (math.isfinite(value) and value >= 0.0):
        raise InputError(name, value, "give a number ≥ 0")
