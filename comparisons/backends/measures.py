"""What is computed from the rows: runs, performance profiles, shifted geometric means, ratios. Pure functions.

A time counts only if the certificate passed; a failure has no time and is never given one.
"""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from comparisons.backends.outcomes import FALSE_ALARM, NO_ANSWER, RIGHT, UNTRUE
from comparisons.backends.problems import PROBLEMS
from comparisons.backends.tasks import COLD, OUTER, WARM
from comparisons.study import DONE, Row

SHIFT: Final = 1e-3
"""Shift of geometric means [s]: differences far below a millisecond do not count."""

_FACTORS: Final = ("solver", "task", "problem", "form", "level")
_ERRORS: Final = ("accuracy", "primal", "dual", "complementarity")

_Key = TypeVar("_Key", bound=Hashable)

Times = Mapping[Hashable, Mapping[str, float | None]]
"""Instance → solver → seconds, None for a failure."""


@dataclass(frozen=True)
class Run:
    """A row of the study, read.

    Attributes
    ----------
    solver, task, problem, form, level : the case
    seconds : median wall time [s], None if there is no answer
    spread : largest less smallest time over the median, None of fewer than two
    certified : whether the certificate passed at the level's tolerance; where there is no solution, whether that was
        said
    status, reason : what was said last, or the row's status and reason if there is no answer
    outcomes : outcome → number of problems
    iterations : of all its problems; 0 if the solver does not tell
    accuracy, primal, dual, complementarity : of the certificate, None if there is none

    """

    solver: str
    task: str
    problem: str
    form: str
    level: str
    seconds: float | None
    spread: float | None
    certified: bool
    status: str
    reason: str
    outcomes: Mapping[str, int]
    iterations: int = 0
    accuracy: float | None = None
    primal: float | None = None
    dual: float | None = None
    complementarity: float | None = None

    @property
    def feasible(self) -> bool:
        """Whether the problem has a solution."""
        return PROBLEMS[self.problem].feasible

    @property
    def instance(self) -> tuple[str, ...]:
        """What all solvers are compared on."""
        return (self.task, self.level, self.problem, self.form)

    @property
    def time(self) -> float | None:
        """The time of a success [s]; None of a failure."""
        return self.seconds if self.certified else None


def runs_of(rows: Iterable[Row]) -> list[Run]:
    """All rows, those without a result too."""
    return [_run(row) for row in rows]


def _run(row: Row) -> Run:
    solver, task, problem, form, level = (str(row.case[name]) for name in _FACTORS)
    if row.status != DONE:
        lost = {NO_ANSWER: 1}
        return Run(solver, task, problem, form, level, None, None, False, row.status, row.reason, lost)
    result, certificate = row.result, row.certificate
    outcomes: Mapping[str, int] = result["outcomes"]
    certified = bool(certificate["passed"]) if certificate else set(outcomes) == {RIGHT}
    seconds: Sequence[float] = result["seconds"]
    return Run(
        solver, task, problem, form, level, statistics.median(seconds), spread(seconds), certified, result["status"],
        result["message"], outcomes, result["iterations"], *(result.get(name) for name in _ERRORS),
    )  # fmt: skip


def spread(values: Sequence[float]) -> float | None:
    """Largest less smallest over the median; None of fewer than two values."""
    return (max(values) - min(values)) / statistics.median(values) if len(values) > 1 else None


def grouped(runs: Iterable[Run], key: Callable[[Run], _Key]) -> dict[_Key, list[Run]]:
    """Key → runs, in the order they are met."""
    found: dict[_Key, list[Run]] = {}
    for run in runs:
        found.setdefault(key(run), []).append(run)
    return found


def as_used(runs: Sequence[Run]) -> list[Run]:
    """Sequences as one would solve them: warm by the solvers that can, cold by the others."""
    warm = {(run.solver, run.level, run.problem, run.form) for run in runs if run.task == WARM}
    return [
        run
        for run in runs
        if run.task == WARM or (run.task == COLD and (run.solver, run.level, run.problem, run.form) not in warm)
    ]


def times_of(runs: Iterable[Run]) -> dict[Hashable, dict[str, float | None]]:
    """Times of problems that have a solution; cold and warm sequences are the same instance."""
    found: dict[Hashable, dict[str, float | None]] = {}
    for run in runs:
        if run.feasible:
            found.setdefault((run.level, run.problem, run.form), {})[run.solver] = run.time
    return found


def performance_ratios(times: Times) -> dict[str, list[float]]:
    """Solver → its time over the best time, for each instance it was tried on; infinite where it failed.

    An instance that nobody solves is infinite for everybody: no profile reaches 1 then.
    Source: E. D. Dolan, J. J. Moré, Math. Program. 91 (2002).
    """
    ratios: dict[str, list[float]] = {}
    for row in times.values():
        best = min((time for time in row.values() if time is not None), default=math.inf)
        for solver, time in row.items():
            ratios.setdefault(solver, []).append(math.inf if time is None else _ratio(time, best))
    return ratios


def _ratio(time: float, best: float) -> float:
    return time / best if best > 0.0 else (1.0 if time == best else math.inf)


def profile(ratios: Sequence[float], at: float) -> float:
    """Share of instances whose ratio is at most `at`."""
    return sum(ratio <= at for ratio in ratios) / len(ratios) if ratios else 0.0


def steps(ratios: Sequence[float], until: float) -> tuple[list[float], list[float]]:
    """The profile as a step function: where it rises, from 1 to `until`, and its value from there on."""
    x = sorted({1.0, until, *(ratio for ratio in ratios if 1.0 < ratio < until)})
    return x, [profile(ratios, value) for value in x]


def area(ratios: Sequence[float], until: float) -> float:
    """Mean height of the profile between 1 and `until` on a logarithmic axis: 1 for always the fastest, 0 for never."""
    if not ratios:
        return 0.0
    heights = [1.0 - math.log(max(ratio, 1.0)) / math.log(until) for ratio in ratios]
    return sum(max(height, 0.0) for height in heights) / len(ratios)


def shifted_mean(times: Sequence[float], shift: float = SHIFT) -> float | None:
    """exp(mean log(t + shift)) − shift [s]; None of no times."""
    if not times:
        return None
    return math.exp(statistics.fmean(math.log(time + shift) for time in times)) - shift


def geometric_mean(values: Sequence[float]) -> float | None:
    """exp(mean log v); None of no values."""
    return math.exp(statistics.fmean(map(math.log, values))) if values else None


def ratios_between(runs: Iterable[Run], numerator: Callable[[Run], bool], denominator: Callable[[Run], bool],
                   key: Callable[[Run], Hashable]) -> list[float]:  # fmt: skip
    """Quotients of the times of runs that agree in `key`, where both succeeded."""
    above, below = dict[Hashable, float](), dict[Hashable, float]()
    for run in runs:
        for chosen, found in ((numerator, above), (denominator, below)):
            if chosen(run) and run.time is not None:
                found[key(run)] = run.time
    return [above[each] / below[each] for each in above if below.get(each)]


def warm_ratios(runs: Iterable[Run]) -> dict[str, list[float]]:
    """Solver → time of warm over that of cold sequences, where both were certified."""
    return _ratios(runs, lambda run: run.task == WARM, lambda run: run.task == COLD,
                   lambda run: (run.level, run.problem, run.form))  # fmt: skip


def condensed_ratios(runs: Iterable[Run], task: str) -> dict[str, list[float]]:
    """Solver → time in all unknowns over that of the condensed form, where both were certified."""
    chosen = [run for run in runs if run.task == task]
    return _ratios(chosen, lambda run: run.form == "full", lambda run: run.form == "condensed",
                   lambda run: (run.level, run.problem))  # fmt: skip


def _ratios(runs: Iterable[Run], numerator: Callable[[Run], bool], denominator: Callable[[Run], bool],
            key: Callable[[Run], Hashable]) -> dict[str, list[float]]:  # fmt: skip
    found = {
        solver: ratios_between(group, numerator, denominator, key)
        for solver, group in grouped(runs, lambda run: run.solver).items()
    }
    return {solver: ratios for solver, ratios in found.items() if ratios}


def attainable(runs: Sequence[Run]) -> list[Run]:
    """Runs of inner problems that at least one solver was certified on, at the same level and in the same form.

    Where nobody is, the rounding of the data may be larger than the tolerance, and no solver can know.
    """
    solved = {_inner_problem(run) for run in runs if run.task != OUTER and run.certified}
    return [run for run in runs if run.feasible and run.task != OUTER and _inner_problem(run) in solved]


def unattained(runs: Sequence[Run]) -> list[tuple[str, str, str]]:
    """(level, problem, form) of inner problems with a solution that no solver was certified on."""
    tried = dict.fromkeys(_inner_problem(run) for run in runs if run.feasible and run.task != OUTER)
    solved = {_inner_problem(run) for run in attainable(runs)}
    return [each for each in tried if each not in solved]


def _inner_problem(run: Run) -> tuple[str, str, str]:
    return run.level, run.problem, run.form


def outcome_counts(runs: Iterable[Run]) -> dict[str, Counter[str]]:
    """Solver → outcome → number of attainable inner problems, those of sequences counted one by one."""
    found: dict[str, Counter[str]] = {}
    for run in attainable(list(runs)):
        found.setdefault(run.solver, Counter()).update(run.outcomes)
    return found


def said_solved(counts: Mapping[str, int]) -> int:
    """How often "solved" was said."""
    return counts.get(RIGHT, 0) + counts.get(UNTRUE, 0)


def untrue_share(counts: Mapping[str, int]) -> float | None:
    """How often "solved" was untrue; None if it was never said."""
    said = said_solved(counts)
    return counts.get(UNTRUE, 0) / said if said else None


def wrong(counts: Mapping[str, int]) -> int:
    """Answers that are wrong: "solved" that is not, "infeasible" that is not."""
    return counts.get(UNTRUE, 0) + counts.get(FALSE_ALARM, 0)


def finite(values: Iterable[Any]) -> list[float]:
    """The finite numbers among the values."""
    return [float(value) for value in values if value is not None and math.isfinite(value)]
