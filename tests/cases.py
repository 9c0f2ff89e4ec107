"""The number of generated cases and of combinations in a test; assertions that an input is refused.

The suite tries few of each kind, the same ones every time. ``QVI_CONTACT_EFFORT=10 python -m pytest FILE`` tries ten
times as many: a search for rare faults after a change to what the file tests.
"""

import os
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from unittest.mock import ANY

import pytest

from solvers import InputError

EFFORT = float(os.environ.get("QVI_CONTACT_EFFORT", "1"))


def examples(count: int) -> int:
    """The number of cases to try where the suite tries `count`."""
    return max(round(EFFORT * count), 1)


def thinned(cases, count):
    """`count` of the cases, times the effort, the same ones in every run.

    Of cases that are tuples, those with a new value at some place are taken first, then other combinations.
    """
    cases, needed, others, seen = list(cases), [], [], set()
    for index in random.Random(0).sample(range(len(cases)), len(cases)):
        case = cases[index]
        values = set(enumerate(map(repr, case if isinstance(case, tuple) else (case,))))
        (others if values <= seen else needed).append(index)
        seen |= values
    return [cases[index] for index in sorted((needed + others)[: examples(count)])]


def every_pair(first: Sequence[Any], second: Sequence[Any], third: Sequence[Any]) -> list[tuple[Any, Any, Any]]:
    """All pairs of the first two, each with one value of the third, the shortest, which meets all values of both."""
    assert len(third) <= min(len(first), len(second))
    return [(a, b, third[(i + j) % len(third)]) for i, a in enumerate(first) for j, b in enumerate(second)]


def refusal(call: Callable[..., object], *given: Any) -> InputError:
    """The error of a call, which is one line."""
    with pytest.raises(InputError) as caught:
        call(*given)
    assert len(str(caught.value).splitlines()) == 1
    return caught.value


@contextmanager
def refused_at(field: str, words: str | None = None, value: object = ANY) -> Iterator[None]:
    """Assert that the block raises an `InputError` of one line with this field, value, and words (a pattern)."""
    with pytest.raises(InputError, match=words) as caught:
        yield
    assert (field, value, 1) == (caught.value.field, caught.value.value, len(str(caught.value).splitlines()))
