"""How long the way through the code is: calls of one small solve, counted by cProfile, built-in functions included.

    python -m comparisons.benchmark.calls

The problem is the paper's plate on 4 × 4 cells cut into triangles of degree 4: 192 unknowns, 12 contact points. It is
solved twice before, so that nothing is imported or made once for the process.
"""

from cProfile import Profile
from pathlib import Path
from pstats import Stats
from typing import Any, NamedTuple

import qvi_contact
import solvers
from qvi_contact.gallery import compressed_plate

_FOLDERS = tuple(str(Path(each.__file__).parent) for each in (qvi_contact, solvers) if each.__file__)


class Calls(NamedTuple):
    """Of one solve.

    Attributes
    ----------
    calls : of everything, libraries and built-in functions too
    files, functions : of the packages `qvi_contact` and `solvers`, that were passed

    """

    calls: int
    files: int
    functions: int


def counted(friction: float = 0.2) -> Calls:
    """Count the calls of a solve."""
    problem = compressed_plate(friction, (4, 4))
    for _ in range(2):
        qvi_contact.solve(problem)
    profile = Profile()
    profile.runcall(qvi_contact.solve, problem)
    found: Any = Stats(profile)  # what it has found is not part of its type
    own = [place for place in found.stats if place[0].startswith(_FOLDERS)]
    return Calls(found.total_calls, len({file for file, *_ in own}), len(own))


if __name__ == "__main__":
    print("{} calls through {} functions in {} files".format(*(counted()[i] for i in (0, 2, 1))))
