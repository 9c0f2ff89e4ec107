"""Ratios of measured times: how far repetitions are apart, and how fast times grow."""

import math
import statistics
from collections.abc import Sequence
from typing import Any


def spread(values: Sequence[float]) -> float | None:
    """Largest less smallest over the median; None of fewer than two values, or of a median that is not positive."""
    middle = statistics.median(values) if len(values) > 1 else 0.0
    return (max(values) - min(values)) / middle if middle > 0.0 else None


def growth(sizes: tuple[float, float], values: Any) -> float | None:
    """The exponent p of value ~ sizeᵖ between two sizes; None where a value is missing or not positive.

    p = log(v₂/v₁) / log(n₂/n₁).
    """
    first, second = (math.nan if value is None else value for value in values)
    if not (first > 0.0 and second > 0.0) or sizes[0] == sizes[1]:
        return None
    return math.log(second / first) / math.log(sizes[1] / sizes[0])
