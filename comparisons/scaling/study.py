"""The study as a declaration: numbers of processes, each several times."""

from collections.abc import Sequence
from typing import Final

from comparisons.lab.study import Study

VERSION: Final = 1
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.scaling.task:run"
PROCESSES: Final = (1, 2)
REPEATS: Final = 2


def declared(processes: Sequence[int], quick: bool) -> Study:
    """The study of these numbers of processes, or a quick one of a coarse mesh and few values under another name."""
    factors = {"processes": tuple(dict.fromkeys(processes or PROCESSES)), "quick": (quick,)}
    return Study("scaling-quick" if quick else "scaling", VERSION, TASK, factors, repeats=1 if quick else REPEATS)
