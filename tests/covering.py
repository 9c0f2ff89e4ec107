"""Fewer combinations of three factors, with every pair of values still together."""

from collections.abc import Sequence
from typing import Any


def every_pair(first: Sequence[Any], second: Sequence[Any], third: Sequence[Any]) -> list[tuple[Any, Any, Any]]:
    """All pairs of the first two with one value of the third each, which runs through its values along both.

    So each value of the third meets each of the first and each of the second, the third being the shortest.
    """
    assert len(third) <= min(len(first), len(second))
    return [(a, b, third[(i + j) % len(third)]) for i, a in enumerate(first) for j, b in enumerate(second)]
