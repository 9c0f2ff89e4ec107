"""Numbers as the texts that reports print, in sentences and in tables.

A missing number (None), nan and infinity are printed as `NOTHING`.
"""

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import numpy as np

NOTHING: Final = "none"
"""Text of a missing number."""

_UNITS_OF_TIME: Final = ((7200.0, "h", 3600.0), (120.0, "min", 60.0), (1.0, "s", 1.0), (1e-3, "ms", 1e-3),
                         (0.0, "µs", 1e-6))  # fmt: skip
_UNITS_OF_MEMORY: Final = ((2.0**30, "GiB"), (2.0**20, "MiB"), (2.0**10, "KiB"))


def fixed(form: str) -> Callable[[float | None], str]:
    """A function that formats a number by this format specification, such as ".2f"."""
    return lambda value: NOTHING if value is None or not math.isfinite(value) else format(value, form)


count: Final = fixed(".0f")
"""The text of a whole number, of iterations or points, also if a frame stores it as a float."""


def scientific(value: float | None, digits: int = 2) -> str:
    """A number with an exponent, to this many significant digits: 1.2e-5; zero is "0"."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def significant(value: float | None, digits: int = 3) -> str:
    """A number without exponent, rounded to this many significant digits, no trailing zeros: 0.00123, 1230."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return np.format_float_positional(value + 0.0, precision=digits, unique=False, fractional=False, trim="-")


def seconds(value: float | None, digits: int = 3) -> str:
    """A time [s] in the unit that reads best: 340 µs, 12.3 ms, 1.5 s, 2.5 min, 3 h."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0 s"
    rounded = float(f"{value:.{digits - 1}e}")  # first, or 999.9 ms would not be 1 s
    unit, factor = next((unit, factor) for least, unit, factor in _UNITS_OF_TIME if abs(rounded) >= least)
    return f"{significant(rounded / factor, digits)} {unit}"


def memory(size: float | None) -> str:
    """A number of bytes in the unit that reads best: 15.6 GiB."""
    if size is None or not math.isfinite(size):
        return NOTHING
    found = ((unit, factor) for factor, unit in _UNITS_OF_MEMORY if size >= factor)
    unit, factor = next(found, ("bytes", 1.0))
    return f"{significant(size / factor)} {unit}"


def percent(share: float | None, digits: int = 0) -> str:
    """A share of 1 in percent; "0 %" and "100 %" are exact: numbers that round to them become "< 1 %" and "> 99 %"."""
    if share is None or not math.isfinite(share):
        return NOTHING
    value, step = 100.0 * share, 10.0**-digits
    if 0.0 < value <= step / 2.0:  # at the half, rounding to even gives zero
        return f"< {step:.{digits}f} %"
    if 100.0 - step / 2.0 <= value < 100.0:
        return f"> {100.0 - step:.{digits}f} %"
    return f"{value:.{digits}f} %"


def span(values: Iterable[float | None], text: Callable[[Any], str] = significant) -> str:
    """Smallest and largest number, "0.5 to 2", once if they read the same; `NOTHING` without any."""
    known = [value for value in values if value is not None and math.isfinite(value)]
    return " to ".join(dict.fromkeys(text(end) for end in (min(known), max(known)))) if known else NOTHING


def listing(words: Sequence[str]) -> str:
    """The words in a row: "a", "a and b", "a, b and c"; `NOTHING` if there are none."""
    *before, last = words or (NOTHING,)
    return f"{', '.join(before)} and {last}" if before else last


def spread(values: Sequence[float]) -> float | None:
    """Largest less smallest over the median; None of fewer than two values, or of a median that is not positive."""
    middle = statistics.median(values) if len(values) > 1 else 0.0
    return (max(values) - min(values)) / middle if middle > 0.0 else None
