"""The study as a declaration: so many problems of every family."""

from collections.abc import Sequence
from typing import Final

from comparisons.lab.machine import PACKAGES
from comparisons.lab.study import Study
from comparisons.wild.generator import FAMILIES
from qvi_contact.errors import InputError

VERSION: Final = 3
TASK: Final = "comparisons.wild.task:solve_case"
NAME: Final = "wild"
EACH, QUICK = 250, 5
"""Problems of a family, in full and quick."""


def declared(families: Sequence[str], each: int) -> Study:
    """The study of these families, all of them if none is named; a run that was stopped has as many of each."""
    for name in families:
        if name not in FAMILIES:
            raise InputError("only", name, f"there is no such family: choose among {', '.join(FAMILIES)}")
    chosen = tuple(name for name in FAMILIES if not families or name in families)
    return Study(NAME, VERSION, TASK, {"number": tuple(range(each)), "family": chosen}, packages=(*PACKAGES, "daqp"))
