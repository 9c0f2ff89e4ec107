"""How many generated cases a test tries.

The suite tries few of each kind, the same ones every time. ``QVI_CONTACT_EFFORT=10 python -m pytest FILE`` tries ten
times as many: a search for rare faults after a change to what the file tests.
"""

import os
import random

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
