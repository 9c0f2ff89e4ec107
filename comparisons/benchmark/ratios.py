"""Medians, ratios of them, and how fast they grow."""

import math
import statistics
from collections.abc import Sequence


def median(values: Sequence[float]) -> float | None:
    """The median; None of nothing."""
    return statistics.median(values) if values else None


def spread(values: Sequence[float]) -> float | None:
    """Largest less smallest value over the median; None of fewer than two."""
    return ratio(max(values) - min(values), median(values)) if len(values) > 1 else None


def ratio(value: float | None, reference: float | None) -> float | None:
    """Quotient of a value and its reference; None where one of them is missing or the reference is not positive."""
    if value is None or reference is None or not reference > 0.0:
        return None
    return value / reference


def growth(smaller: tuple[int, float | None], larger: tuple[int, float | None]) -> float | None:
    """The exponent p of value ~ unknownsᵖ between two pairs (unknowns, value); None where a value is missing.

    p = log(v₂/v₁) / log(n₂/n₁).
    """
    (n1, v1), (n2, v2) = smaller, larger
    if v1 is None or v2 is None or not (v1 > 0.0 and v2 > 0.0) or n1 == n2:
        return None
    return math.log(v2 / v1) / math.log(n2 / n1)


def predicted(known: tuple[int, float], unknowns: int) -> float:
    """Seconds of a sparse factorisation of a plane problem from those of another size: they grow like unknowns^1.5."""
    size, seconds = known
    return float(seconds * (unknowns / size) ** 1.5)
