"""The study: sequences × elements, each solved in three ways."""

from typing import Final

from comparisons.convergence.sequences.problems import CHAINS
from comparisons.lab.study import Study

VERSION: Final = 1
"""To be raised when the task computes something else."""

TASK: Final = "comparisons.convergence.sequences.task:run"


def study(quick: bool) -> Study:
    """The study, or a quick one of coarse meshes and few steps under another name."""
    name = "convergence-sequences-quick" if quick else "convergence-sequences"
    factors = {"sequence": tuple(CHAINS), "element": ("hct", "bfs"), "quick": (quick,)}
    return Study(name, VERSION, TASK, factors)
