"""Random choices that are the same on every machine and under every version of the libraries."""

import random
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


class Dice:
    """Choices made by `random.Random.random` alone, whose sequence Python guarantees for a seed."""

    def __init__(self, *seed: object) -> None:
        self._random = random.Random(" ".join(map(str, seed)))  # nothing secret

    def between(self, low: float, high: float) -> float:
        """A number, all alike probable."""
        return low + (high - low) * self._random.random()

    def magnitude(self, low: float, high: float) -> float:
        """10 to the power of a number between low and high."""
        return float(10.0 ** self.between(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number from low to high, both included."""
        return low + int((high + 1 - low) * self._random.random())

    def chance(self, probability: float) -> bool:
        """Whether something of this probability happens."""
        return self._random.random() < probability

    def pick(self, values: Sequence[T]) -> T:
        """One of the values."""
        return values[self.whole(0, len(values) - 1)]

    def sign(self) -> float:
        """−1 or 1."""
        return self.pick((-1.0, 1.0))
