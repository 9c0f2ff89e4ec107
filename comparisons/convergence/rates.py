"""How fast a sequence of residuals falls, and what it does where it does not fall.

The last residuals above a floor, r_k, are fitted by log r_k = a + b k, b the slope of Theil and Sen (the median over
all pairs, so that single lucky or spoilt iterations do not count) with its confidence interval. Then, n the length of
the fitted piece in iterations and b₋ ≤ b ≤ b₊ the interval,

    converges    the last residual is at the target, or exp(b₊ n) < 1/2: certainly falling by more than half
    cycles       r_k = r_{k−p} to a thousandth all along, for a period p ≤ 8, p = 1 included
    diverges     exp(b₋ n) > 2, or the last residual is no number
    wanders      none of these
    short        fewer than four residuals

The interval is nominal: it is that of independent residuals, which those of an iteration are not.

Where an iteration has no residual (its inner problem failed, say) the loop began anew, and only what follows counts.

Source: P. K. Sen, Estimates of the regression coefficient based on Kendall's tau, J. Amer. Statist. Assoc. 63 (1968).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray

Course = Literal["converges", "cycles", "diverges", "wanders", "short"]

LEAST: Final = 4
"""Residuals without which there is no rate."""

LONGEST: Final = 40
"""Residuals that are fitted at most, from the end."""

FLOOR: Final = 1e-12
"""Residuals below this are rounding."""

_CONFIDENCE: Final = 0.95
_HALF: Final = float(np.log(2.0))
_PERIODS: Final = range(1, 9)
_SAME: Final = 1e-3


@dataclass(frozen=True)
class Rate:
    """What a sequence of residuals does.

    Attributes
    ----------
    course : see the module
    factor : exp(b), by which each iteration multiplies the residual; None if there are too few
    low, high : the confidence interval of `factor`, 95 %
    fitted : number of residuals fitted

    """

    course: Course
    factor: float | None = None
    low: float | None = None
    high: float | None = None
    fitted: int = 0


def rate_of(residuals: Sequence[float], target: float = 0.0) -> Rate:
    """Rate and course of the residuals (k,) ≥ 0 of the iterations of a loop.

    A last residual of the target's size or below has converged whatever came before.
    """
    values = np.asarray(residuals, dtype=float)
    missing = np.flatnonzero(~np.isfinite(values))
    if len(missing) and missing[-1] == len(values) - 1:
        return Rate("diverges")
    values = values[missing[-1] + 1 :] if len(missing) else values
    above = np.flatnonzero(values > FLOOR)
    number = above[-_fitted(len(above)) :]
    arrived = len(values) > 0 and values[-1] <= max(target, FLOOR)
    if len(number) < LEAST:
        return Rate("converges" if arrived else "short", fitted=len(number))
    logs = np.log(values[number])
    slope, low, high = _slope(logs, number)
    length = float(number[-1] - number[0])
    course = "converges" if arrived else _course(logs, low * length, high * length)
    return Rate(course, float(np.exp(slope)), float(np.exp(low)), float(np.exp(high)), len(number))


def _slope(y: FloatArray, x: FloatArray | IntArray) -> tuple[float, float, float]:
    """Slope of Theil and Sen, and the ends of its confidence interval."""
    from scipy.stats import theilslopes  # as long to load as all else of a worker

    slope, _, low, high = theilslopes(y, x, _CONFIDENCE)
    return float(slope), float(low), float(high)


def _fitted(available: int) -> int:
    """How many of the last residuals are fitted: half of them, but all of a few and no more than `LONGEST`."""
    return min(max((available + 1) // 2, min(available, 2 * LEAST)), LONGEST)


def _course(logs: FloatArray, least: float, most: float) -> Course:
    """By the change of log r over the piece, between `least` and `most`."""
    if any(_repeats(logs, period) for period in _PERIODS):
        return "cycles"
    if most < -_HALF:
        return "converges"
    return "diverges" if least > _HALF else "wanders"


def _repeats(logs: FloatArray, period: int) -> bool:
    """Whether each value is that of a period ago; two whole periods are needed to see it."""
    return len(logs) >= 2 * period and bool(np.abs(logs[period:] - logs[:-period]).max() <= _SAME)


def first_lasting(errors: Sequence[float], numbers: Sequence[int], target: float) -> int | None:
    """The first iteration from which all errors on record are at the target or below.

    None if there is none, or less than a fifth of all iterations are left after it: what comes that late may be a phase
    of a cycle.

    Parameters
    ----------
    errors, numbers : sequences of the same length
        Errors and the numbers of their iterations, in order; gaps between numbers are allowed.
    target : float
        Largest error allowed.

    """
    within = np.asarray(errors) <= target  # nan is not
    outside = np.flatnonzero(~within)
    first = int(outside[-1]) + 1 if len(outside) else 0
    if first >= len(within) or numbers[first] > 0.8 * numbers[-1]:
        return None
    return int(numbers[first])


def growth_order(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """The p of values ∝ sizes^p by the slope of Theil and Sen in logarithms; None with fewer than three pairs.

    Pairs with what is no number, or not positive, are left out.
    """
    pairs = [(size, value) for size, value in zip(sizes, values, strict=True) if size > 0 and value > 0]
    if len(pairs) < 3:
        return None
    x, y = np.log(np.array(pairs)).T
    return _slope(y, x)[0]
