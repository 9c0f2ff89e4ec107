"""How many generated cases a test tries.

The suite tries few of each kind, the same ones every time. ``QVI_CONTACT_EFFORT=10 python -m pytest FILE`` tries ten
times as many: a search for rare faults after a change to what the file tests.
"""

import os

EFFORT = float(os.environ.get("QVI_CONTACT_EFFORT", "1"))


def examples(count: int) -> int:
    """The number of cases to try where the suite tries `count`."""
    return max(round(EFFORT * count), 1)
