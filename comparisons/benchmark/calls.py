"""Count the function calls of one small solve by cProfile, built-in functions included.

    python -m comparisons.benchmark.calls

The problem is the paper's plate on 4 × 4 cells cut into triangles of degree 4: 192 unknowns, 12 contact points. An
earlier solve has imported all modules, on another mesh or on the same mesh, which keeps the matrices that depend on it
alone.
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
    """Counts of one solve."""

    calls: int  # of all functions, in libraries too
    files: int  # of the packages `qvi_contact` and `solvers` in which functions were called
    functions: int  # of these packages


def counted(friction: float = 0.2, *, same_mesh: bool = False) -> Calls:
    """Count the calls of a solve, on a new mesh or on one that was solved on before."""
    problems = [compressed_plate(friction, (4, 4)) for _ in range(2)]
    for problem in problems:
        qvi_contact.solve(problem)
    problem = problems[-1] if same_mesh else compressed_plate(friction, (4, 4))
    profile = Profile()
    profile.runcall(qvi_contact.solve, problem)
    found: Any = Stats(profile)  # its attributes are not typed
    own = [place for place in found.stats if place[0].startswith(_FOLDERS)]
    return Calls(found.total_calls, len({file for file, *_ in own}), len(own))


if __name__ == "__main__":
    for again in (False, True):
        calls, files, functions = counted(same_mesh=again)
        mesh = "a mesh solved on before" if again else "a new mesh"
        print(f"on {mesh}: {calls} calls through {functions} functions in {files} files")
