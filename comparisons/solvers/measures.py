"""What is computed from the rows: runs, performance profiles, shifted geometric means, ratios. Pure functions.

A time counts only if the certificate passed; a failure has no time and is never given one.
"""

import math
import statistics
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Final, TypeVar

from comparisons.lab.study import DONE, Row
from comparisons.solvers.accuracies import LEVELS, asked
from comparisons.solvers.outcomes import MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.tasks import COLD, INNER, OUTER, WARM

SHIFT: Final = 1e-3
"""Shift of geometric means [s]: differences far below a millisecond do not count."""

NEGLIGIBLE: Final = 1.2
"""Ratio of times below which, and above whose inverse, times count as equal."""

CONE_ENERGY: Final = ("qp:ecos", "socp:cvxopt", "socp:ecos")
"""Solvers that take linear objectives only: `qpsolvers` and `cvxpy` give them the energy as one more cone."""

UNDOUBLED: Final[Mapping[str, str]] = MappingProxyType({"doubled_rows": "plate_8", "doubled_equation": "punch_coarse"})
"""Problem with rows given twice → the same problem with each given once."""

EQUAL_CELLS: Final[Mapping[str, str]] = MappingProxyType({"graded_8": "plate_8", "graded_16": "plate_16"})
"""Problem on graded cells → the same on equal ones."""

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
    limit : wall time after which the case was ended [s], None without a limit
    options : the solver's own, as it was given them

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
    limit: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

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

    @property
    def lost(self) -> bool:
        """Whether there is no answer: the run was ended, or the solver failed."""
        return self.seconds is None or self.status == "backend_failed"


def runs_of(rows: Iterable[Row]) -> list[Run]:
    """All rows, those without a result too."""
    return [_run(row) for row in rows]


def _run(row: Row) -> Run:
    solver, task, problem, form, level = (str(row.case[name]) for name in _FACTORS)
    limit = row.environment.get("timeout_seconds")
    if row.status != DONE:
        lost = {NO_ANSWER: 1}
        return Run(solver, task, problem, form, level, None, None, False, row.status, row.reason, lost, limit=limit)
    result, certificate = row.result, row.certificate
    outcomes: Mapping[str, int] = result["outcomes"]
    certified = bool(certificate["passed"]) if certificate else set(outcomes) == {RIGHT}
    seconds: Sequence[float] = result["seconds"]
    return Run(
        solver, task, problem, form, level, statistics.median(seconds), spread(seconds), certified, result["status"],
        result["message"], outcomes, result["iterations"], limit=limit, options=result.get("options", {}),
        **{name: result.get(name) for name in _ERRORS},
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


def of_kind(runs: Sequence[Run], kind: str) -> list[Run]:
    """The runs of a kind of task on problems that have a solution.

    Outer loops are those in condensed form, which is what the package's own methods are compared with.
    """
    chosen = as_used(runs) if kind == "sequence" else [run for run in runs if run.task == kind]
    return [run for run in chosen if run.feasible and (kind != OUTER or run.form == "condensed")]


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


def mean_with_failures(runs: Sequence[Run]) -> float | None:
    """Shifted geometric mean [s] with every failure counted as if it had taken the whole limit.

    None of no runs, and if a failure had no limit.
    """
    times = [run.limit if run.time is None else run.time for run in runs]
    return None if None in times else shifted_mean(finite(times))


def median(values: Sequence[float]) -> float | None:
    """The median, half way between the middle two of an even number; None of no values."""
    return statistics.median(values) if values else None


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


def judged(runs: Iterable[Run]) -> list[Run]:
    """Runs of inner problems that have a solution, single ones and sequences: what was said of them can be true."""
    return [run for run in runs if run.feasible and run.task != OUTER]


def unattained(runs: Sequence[Run]) -> list[tuple[str, str, str, str]]:
    """(level, problem, form, "single" or "sequence") of which no answer of any solver was certified.

    Only inner problems that have a solution. Of a sequence no step was certified.
    """
    groups = grouped(judged(runs), _inner_problem)
    return [key for key, group in groups.items() if not any(_certified_answers(run) for run in group)]


def _inner_problem(run: Run) -> tuple[str, str, str, str]:
    return run.level, run.problem, run.form, "single" if run.task == INNER else "sequence"


def _certified_answers(run: Run) -> int:
    return run.outcomes.get(RIGHT, 0) + run.outcomes.get(MODEST, 0)


def outcome_counts(runs: Iterable[Run]) -> dict[str, Counter[str]]:
    """Solver → outcome → number of inner problems that have a solution, those of sequences counted one by one."""
    found: dict[str, Counter[str]] = {}
    for run in judged(runs):
        found.setdefault(run.solver, Counter()).update(run.outcomes)
    return found


def untrue_on_unattained(runs: Sequence[Run]) -> Counter[str]:
    """Solver → how often "solved" was untrue where nobody was certified."""
    nobody = set(unattained(runs))
    found = Counter[str]()
    for run in judged(runs):
        if _inner_problem(run) in nobody:
            found[run.solver] += run.outcomes.get(UNTRUE, 0)
    return found


def paired(runs: Iterable[Run], twins: Mapping[str, str]) -> list[tuple[Run, Run]]:
    """(run, run on the twin) of single inner problems, same solver, form and level; only where both were run."""
    single = [run for run in runs if run.task == INNER]
    found = {(run.problem, run.solver, run.form, run.level): run for run in single}
    keys = ((run, (twins.get(run.problem, ""), run.solver, run.form, run.level)) for run in single)
    return [(run, found[key]) for run, key in keys if key in found]


def error_powers(runs: Iterable[Run]) -> dict[str, float]:
    """Solver → p, where the median error of single inner problems falls like ε**p with the tolerance ε asked for.

    Between the lowest and the highest level, over the problems that have an answer at both. Solvers without
    such problems, or whose median error is 0, are left out.
    """
    low, *_, high = LEVELS
    single = [run for run in judged(runs) if run.task == INNER and finite([run.accuracy])]
    found = {}
    for solver, group in grouped(single, lambda run: run.solver).items():
        rough, fine = ({(run.problem, run.form): run.accuracy or 0.0 for run in group if run.level == level}
                       for level in (low, high))  # fmt: skip
        both = rough.keys() & fine.keys()
        above, below = median([rough[each] for each in both]), median([fine[each] for each in both])
        if above and below:
            found[solver] = math.log(above / below) / math.log(asked(low) / asked(high))
    return found


def said_solved(counts: Mapping[str, int]) -> int:
    """How often "solved" was said."""
    return counts.get(RIGHT, 0) + counts.get(UNTRUE, 0)


def untrue_share(counts: Mapping[str, int]) -> float | None:
    """How often "solved" was untrue; None if it was never said."""
    said = said_solved(counts)
    return counts.get(UNTRUE, 0) / said if said else None


def finite(values: Iterable[Any]) -> list[float]:
    """The finite numbers among the values."""
    return [float(value) for value in values if value is not None and math.isfinite(value)]
