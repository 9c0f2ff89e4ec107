"""How many cases a test tries, of generated ones and of combinations; and that an input is refused.

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
    """`count` of the cases, the same ones every time; all of them where the effort pays for as many.

    Cases that are tuples show each value at each place before any is shown for the sake of its combination alone.
    """
    cases, needed, others, seen = list(cases), [], [], set()
    for index in random.Random(0).sample(range(len(cases)), len(cases)):
        case = cases[index]
        values = set(enumerate(map(repr, case if isinstance(case, tuple) else (case,))))
        (others if values <= seen else needed).append(index)
        seen |= values
    return [cases[index] for index in sorted((needed + others)[: examples(count)])]


def every_pair(first: Sequence[Any], second: Sequence[Any], third: Sequence[Any]) -> list[tuple[Any, Any, Any]]:
    """All pairs of the first two with one value of the third each, which runs through its values along both.

    So each value of the third meets each of the first and each of the second, the third being the shortest.
    """
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
    """That what is done inside is refused by one line that names field and value, and has these words (a pattern)."""
    with pytest.raises(InputError, match=words) as caught:
        yield
    assert (field, value, 1) == (caught.value.field, caught.value.value, len(str(caught.value).splitlines()))
