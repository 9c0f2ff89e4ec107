"""The study as a declaration, in full and quick.

The product of tasks, problems, forms, levels and solvers is thinned out where a combination means nothing or costs too
much; `keep` says where.
"""

from collections.abc import Sequence
from typing import Any, Final

from comparisons.lab.machine import PACKAGES
from comparisons.lab.study import Study
from comparisons.lab.study.declaration import Values
from comparisons.solvers.accuracies import LEVELS, METHODS, TABLE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.tasks import COLD, INNER, OUTER, TASKS, WARM, solve_case

FORMS: Final = ("full", "condensed")
FULL_NAME, QUICK_NAME = "solvers", "solvers-quick"
RUNS: Final = {FULL_NAME: 3, QUICK_NAME: 2}
"""Study → runs of each case, as long as they are quick."""

QUICK: Final = ("plate_8", "graded_8", "ssnv128_4", "dragged_block")
"""Problems of the quick study."""

LIBRARIES: Final = ("daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog", "scs")
"""Distributions of solvers beside those of `comparisons.lab.machine`."""


def declared(solvers: Sequence[str], quick: bool = False) -> Study:
    """The study of these solvers.

    Another choice of solvers is another study, with a store of its own.
    """
    name = QUICK_NAME if quick else FULL_NAME
    problems = QUICK if quick else tuple(PROBLEMS)
    factors: dict[str, tuple[Any, ...]] = {
        "task": TASKS, "problem": problems, "form": FORMS, "level": tuple(LEVELS), "solver": tuple(solvers),
        "runs": (RUNS[name],),
    }  # fmt: skip
    return Study(name, 2, solve_case, factors, keep=_quick if quick else keep, packages=(*PACKAGES, *LIBRARIES))


def keep(values: Values) -> bool:
    """Whether a case is part of the full study.

    * Methods of the package solve whole inequalities, condensed; the rest of the table does everything.
    * Warm sequences only for solvers that can keep something.
    * Sequences only where there is a solution, and where the bounds change: not where everything sticks.
    * On fine meshes in all unknowns only single inner problems.
    """
    task, form, solver = values["task"], values["form"], values["solver"]
    described = PROBLEMS[values["problem"]]
    if solver in METHODS and (task, form) != (OUTER, "condensed"):
        return False
    if task == WARM and not TABLE[solver].keeps:
        return False
    if task in (COLD, WARM) and (not described.feasible or described.kind == "sticking"):
        return False
    return task == INNER or form == "condensed" or described.small


def _quick(values: Values) -> bool:
    """Sequences and outer loops only condensed, at one level, and where there is a solution."""
    single = values["task"] == INNER
    feasible = PROBLEMS[values["problem"]].feasible
    return keep(values) and (single or (values["form"] == "condensed" and values["level"] == "mid" and feasible))
