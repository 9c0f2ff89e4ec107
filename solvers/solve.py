"""`solve_qvi`, the entry to all methods: the methods that are tried in order, and the search for other solutions."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from itertools import chain
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from solvers.basics.progress import Log, Progress, deadline, listening, report
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import Certificate
from solvers.certificate.feasibility import PROOF_SECONDS, check_feasibility, refuted
from solvers.condensed.method import EXACT, LAST, CondensedRun
from solvers.errors import InputError, SolveError
from solvers.factorisation.base import FactorisationError
from solvers.fixed_point import initial_pressure, solve_fixed_point
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import generic_vector, largest
from solvers.inner.registry import check_name, versions
from solvers.pivoting import LARGEST, LARGEST_LATE, ContactBounds, solve_lcp, solve_pivoting
from solvers.settings import (
    DEFAULT_INNER,
    STARTED,
    CondensedOptions,
    FixedPointOptions,
    Options,
    PivotingOptions,
    Settings,
    UzawaOptions,
)
from solvers.solution import Attempt, Outcome, QVISolution, Start, certified_status, finish, out_of_time
from solvers.uzawa import solve_uzawa


def solve_qvi(qvi: FrictionQVI, method: str | None = None, **settings: Any) -> QVISolution:
    """Solve the quasi-variational inequality (D2).

    Parameters
    ----------
    qvi : FrictionQVI
        The problem, dimensionless.
    method, **settings
        Fields of `solvers.settings.Settings`, and options of the method by their names.

    Returns
    -------
    A `QVISolution` in every case, with status and advice. The status is "solved" only if the certificate passed.
    `attempts` lists the methods and starts that were tried, and why. For large friction there may be other solutions:
    `followed_solutions` looks for them.

    Raises
    ------
    InputError, SolverUnavailableError; SolveError if `throw` is set and the status is not "solved".

    """
    if not isinstance(qvi, FrictionQVI):
        raise InputError("qvi", type(qvi).__name__, "give a FrictionQVI")
    checked = Settings.of(None, {"method": method, **settings})
    with deadline(checked.time_limit), Log("solve_qvi", checked.verbose) as log:
        log.begin(facts_of(qvi, checked))
        solution = solved(qvi, checked, checked.initial)
        log.end(str(solution.status), solution.message, solution.timings, solution.solved)
    if checked.throw and not solution.solved:
        raise SolveError(solution.message)
    return solution


def facts_of(qvi: FrictionQVI, settings: Settings) -> dict[str, object]:
    """The header of the log: size of the problem, method and tolerance."""
    equations = {"equations": qvi.p} if qvi.p else {}
    method = {"method": settings.chosen, "tolerance": f"{settings.tolerance:g}"}
    return {"unknowns": qvi.n, "contact rows": qvi.m, **equations, **method}


# The attempts to solve a problem, in the order in which they are made until a certificate passes.

LEAST_SECONDS = 15.0
"""A fall-back method may take as long as the first method took, or this many seconds if that is more."""

_FAILURES = {
    "singular": Status.ILL_CONDITIONED, "memory": Status.OUT_OF_MEMORY, "time": Status.TIME_LIMIT,
    "backend": Status.BACKEND_FAILED,
}  # fmt: skip

_LARGEST_FIXED_POINT = 250
"""Contact points up to which the fixed point is a fall-back: an iteration then takes at most a tenth of
`LEAST_SECONDS`. With more points an iteration may take 20 s."""

_WORTH_A_FALL_BACK = (
    Status.INACCURATE, Status.ILL_CONDITIONED, Status.STALLED,
    Status.MAX_ITERATIONS, Status.INNER_INFEASIBLE, Status.DIVERGED,
)  # fmt: skip

Tries: TypeAlias = Iterator[tuple[Attempt, Outcome]]


def usual_start(search: Search) -> Tries:
    """The condensed method, started from the bonded solution, or near the state `initial` if that is given."""
    run = search.run = CondensedRun.of(search.qvi, search.options(CondensedOptions))
    run.begin_near()
    run.iterate()
    yield run.attempt("condensed", ""), run.outcome()


def other_paths(search: Search) -> Tries:
    """The condensed method along other central paths, that is, with other path weights of the friction bounds.

    If the run began near a given state, the first path is the usual one. No other path is tried if a quick proof finds
    that the load cannot be carried.
    """
    first, best = search.run, search.best
    if first is None or best is None or first.reason in LAST:
        return
    if first.reason is Status.SOLVED and first.residual() <= EXACT:
        return
    best.feasibility = refuted(search.qvi, PROOF_SECONDS)
    if best.feasibility is not None:
        return
    for path in first.space.paths[0 if first.is_warm else 1 :]:
        before = search.run or first
        run = search.run = before.again(path)
        run.iterate()
        name = f"condensed, path weights {path.early:g}, then {path.late:g}, start {path.start:g}"
        yield run.attempt(name, f"the start before ended {before.reason.words}"), run.outcome()
        if run.reason in LAST:
            return


def vertex(search: Search) -> Tries:
    """Pivoting, from the state `initial` if it is given."""
    start = search.start if isinstance(search.start, Start) else None
    outcome = solve_pivoting(search.qvi, search.settings.tolerance, search.options(PivotingOptions), start)
    yield Attempt("pivoting", "", outcome.reason, outcome.iterations), outcome


def fixed_point(search: Search) -> Tries:
    """The fixed point, an outer iteration on the friction bound."""
    options, name = search.options(FixedPointOptions), check_name(search.inner)
    outcome = solve_fixed_point(search.qvi, name, search.settings.tolerance, options)
    yield Attempt("fixed-point", "", outcome.reason, outcome.iterations), outcome


def uzawa(search: Search) -> Tries:
    """The iteration of Więckowski 1992."""
    options = search.options(UzawaOptions)
    outcome = solve_uzawa(search.qvi, search.settings.tolerance, options)
    yield Attempt("uzawa", "", outcome.reason, outcome.iterations), outcome


def _linear(qvi: FrictionQVI, method: str) -> Tries:
    """The bonded solution, for a problem whose tractions do not vary, as without contact points or unknowns."""
    (z, nu), zero = qvi.bonded_state.corrected, np.zeros(qvi.m)
    proof = check_feasibility(qvi) if qvi.m else None  # the reason counts only if the certificate does not pass
    reason = Status.INFEASIBLE if proof is not None and proof.feasible is False else Status.STALLED
    outcome = Outcome(reason, z, zero, zero, nu, versions=versions(("scipy",)), feasibility=proof)
    yield Attempt(method, "", reason, 0), outcome


class Way(NamedTuple):
    """A method: generators of attempts, which yield them one by one until one is certified."""

    method: str
    tries: tuple[Callable[[Search], Tries], ...]
    most: float = 0  # contact points up to which it is tried if the user chose no method
    subject: str = ""  # the method as the subject of a sentence in the message


ATTEMPTS: Final = (
    Way("condensed", (usual_start, other_paths), np.inf),
    Way("pivoting", (vertex,), LARGEST_LATE, "Pivoting"),
    Way("fixed-point", (fixed_point,), _LARGEST_FIXED_POINT, "The fixed point"),
    Way("uzawa", (uzawa,)),
)
"""Methods in the order in which they are tried until a certificate passes. On up to `LARGEST` contact points pivoting
is the first. If it fails there, only `attempts` shows it: messages do not mention it."""


class Search:
    """The attempts to solve one problem, and the best outcome so far."""

    def __init__(self, qvi: FrictionQVI, settings: Settings, initial: object) -> None:
        self.qvi, self.settings = qvi, settings
        self.inner = settings.inner or DEFAULT_INNER  # inner solver of the fixed point
        self.attempts: tuple[Attempt, ...] = ()
        self.best: Outcome | None = None  # the outcome of the current method with the best certificate
        self.method, self.certificate, self.timings = "", Certificate({}, 1.0), dict[str, float]()  # of the last method
        self.run: CondensedRun | None = None  # the latest run of the condensed method
        self._began = time.perf_counter()
        given = settings.options.items()
        self._given: dict[str, Any] = {name: int(own) if isinstance(own, np.integer) else own for name, own in given}
        self.start: Start | Vector | None = None  # the pressure or the state `initial`
        if initial is not None and settings.takes_state:
            state = Start.of(initial) if isinstance(initial, QVISolution) else initial
            pressure = initial_pressure(qvi, state)  # checked, as pivoting may be followed by the fixed point
            self.start = state if isinstance(state, Start) else pressure
            if isinstance(state, Start) or not settings.by_default:  # a pressure is kept for a later fixed point
                self._given["initial"] = self.start

    def options(self, kind: type[Options]) -> Options:
        """Options of the current method, made of the given ones that it has; no integers of NumPy: these overflow."""
        return kind(**{name: value for name, value in self._given.items() if name in kind.__dataclass_fields__})

    def try_way(self, way: Way, why: str = "") -> bool:
        """Run attempts of a method until an outcome passes; whether one did. A failed factorisation is an outcome."""
        qvi, tolerance, method = self.qvi, self.settings.tolerance, way.method
        report(Progress(method))
        began, certifying = time.perf_counter(), 0.0
        best, certificate = None, None
        tries: Tries = _linear(qvi, method) if qvi.is_fixed else iter(())
        if qvi.m and qvi.n:
            tries = chain(tries, chain.from_iterable(tried(self) for tried in way.tries))
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # divergence becomes a status
                for attempt, outcome in tries:
                    before, new = time.perf_counter(), None
                    if best is not None or outcome.reason is not Status.ILL_CONDITIONED:
                        new = outcome.certified(qvi, tolerance)
                        attempt = attempt._replace(status=certified_status(attempt.status, new))
                    certifying += time.perf_counter() - before
                    self.attempts += (attempt._replace(reason=attempt.reason or why),)
                    if best is None or certificate is None or new is None or new.accuracy < certificate.accuracy:
                        self.best = best = outcome
                        certificate = new
                    else:
                        best.history, best.iterations = outcome.history, outcome.iterations  # of all, whichever is best
                        if outcome.reason is Status.TIME_LIMIT and best.reason is not Status.SOLVED:
                            best.reason, best.message = outcome.reason, ""
                    if certificate is not None and certificate.passed:
                        break
        except (FactorisationError, MemoryError) as error:
            reason = error.reason if isinstance(error, FactorisationError) else "memory"
            message, certificate = str(error) or "out of memory", None
            best = Outcome.nothing(qvi, _FAILURES[reason], message, hopeless=True)
            self.attempts += (Attempt(method, why, best.reason, 0),)
        assert best is not None
        before = time.perf_counter()
        self.method, self.best, self.certificate = method, best, certificate or best.certified(qvi, tolerance)
        certifying += time.perf_counter() - before
        seconds = time.perf_counter() - began - best.setup - certifying
        self.timings = {"setup": best.setup, "solve": seconds, "certificate": certifying}
        return self.certificate.passed

    def solution(self) -> QVISolution:
        """The solution of the last method that ran, from its best outcome."""
        assert self.best is not None
        inner = self.inner if self.method == "fixed-point" else ""
        return finish(self.qvi, self.best, self.certificate, self.method, inner, self.attempts, self.timings)

    def fallen_back(self, first: QVISolution) -> QVISolution:
        """The solution of the first other method that passes, or else the better solution, with a remark.

        Each method may take as long as the first one took, see `LEAST_SECONDS`.
        """
        done = {each.name for each in self.attempts}
        later = [way for way in ATTEMPTS if way.method not in done and self.qvi.m <= way.most]
        limit = self._given.get("max_iterations")
        is_spent = limit is not None and first.iterations >= limit
        if is_spent or first.status not in _WORTH_A_FALL_BACK or not later:
            return first
        is_late = deadline.over  # by a name, as type checkers take a property for constant, also below
        if is_late:
            return out_of_time(first)
        seconds = max(LEAST_SECONDS, time.perf_counter() - self._began)
        tried = f"the condensed method ended {first.status.words} after {first.iterations} iterations"
        self.inner, last, subject = DEFAULT_INNER, first, ""
        for way in later:
            self._given = {"initial": self.start} if way.method in STARTED else {}
            if limit is not None and way.method in STARTED:
                self._given["max_iterations"] = limit - first.iterations
            report(Progress(way.method, remark=tried))
            with deadline(seconds):
                self.try_way(way, why=tried)
                last, subject = self.solution(), way.subject
            if last.solved or deadline.over:
                break
        better = last.certificate.accuracy < first.certificate.accuracy
        if last.solved or (last.status is Status.INACCURATE and better):
            solution, remark = last, f"{subject} found this solution after {tried}."
        elif deadline.over:
            solution = out_of_time(last if better else first)
            remark = f"The time limit ended {subject.lower()}, which was tried because {tried}."
        elif last.status is Status.TIME_LIMIT:
            stopped = f"{subject}, tried next, was stopped after {seconds:.0f} seconds"
            solution, remark = first, f"{stopped}: method={way.method!r} gives it more time."
        else:
            solution, remark = first, f"{subject}, tried next, ended {last.status.words}."
        return dataclasses.replace(solution, message=f"{solution.message} {remark}", attempts=self.attempts)


def solved(qvi: FrictionQVI, settings: Settings, initial: object = None) -> QVISolution:
    """Solve by the method of the settings; if the user chose none, by the other `ATTEMPTS` too."""
    callback = settings.callback

    def hear(progress: Progress) -> None:
        if callback is not None and progress.iteration is not None:
            callback(progress.iteration)

    with qvi.stiffness.using(settings.factorisation, settings.threads), listening(hear) if callback else nullcontext():
        search, ways = Search(qvi, settings, initial), {way.method: way for way in ATTEMPTS}
        is_free = settings.by_default and not settings.options.keys() - {"max_iterations"}
        if is_free and qvi.n and 0 < qvi.m <= LARGEST and search.try_way(ways["pivoting"]):
            return search.solution()
        search.try_way(ways[settings.chosen])
        return search.fallen_back(search.solution()) if settings.by_default else search.solution()


# Other solutions of a problem. With friction the solution of (D2) need not be unique, and a method always finds the
# same one. On up to `LARGEST` contact points pivots follow each solution while tractions change, until they are back.
# A path on which the friction coefficient rises from a fraction of its value, or falls from a multiple, in small steps,
# may end at another solution, too, as each step starts from the state before: at one without stress, for example. That
# no other solution is found proves nothing; `uniqueness` has a bound that does.

WAYS: Final = ((0.02, 3), (0.4, 5), (0.4, 20), (0.6, 20), (0.85, 3), (1.3, 10))
"""Paths of the friction: its first value over that of the problem, once so small that nothing jams, and steps to 1."""

MOST: Final = 20
"""Number of solutions that are enough: no other paths are begun."""

_DIRECTIONS = 8  # of paths that leave a solution, each in both senses
_MOST_ITERATIONS = 6  # for the certified solution at the end of a path: guesses of signs, the rest is there

OTHER: Final = 1e-4
"""Difference of tractions, over the largest traction, above which two solutions count as different."""


def followed_solutions(solution: QVISolution, *, time_limit: float | None = None) -> tuple[QVISolution, ...]:
    """The solution and others of the same problem, at the ends of paths, the last of which are those of `WAYS`.

    Each solution is certified on the data of the problem, to the tolerance of the given one. Two solutions are
    different if their tractions differ at any point by more than `OTHER` times the largest traction.

    Parameters
    ----------
    solution : QVISolution
        A solution with the status "solved".
    time_limit : float, optional
        Seconds for all paths together. The solutions found until then are returned.

    Raises
    ------
    InputError
        If the solution is not solved, or the time limit is wrong.

    """
    if not solution.solved:
        raise InputError("solution", str(solution.status), "give one that is solved")
    solutions, qvi = [solution], solution.problem
    if not (qvi.mu > 0.0).any():
        return (solution,)
    with deadline(time_limit):
        for end in chain(_neighbours(solutions), _ends(solution)):
            if end.solved and all(traction_difference(end, other) > OTHER for other in solutions):
                solutions.append(end)
    return tuple(solutions)


def traction_difference(one: QVISolution, other: QVISolution) -> float:
    """The largest difference of tractions at a contact point, over the largest traction of the first."""
    first, second = (solution.problem.tractions(solution.z) for solution in (one, other))
    return largest(first - second) / one.certificate.scales["stress"]


def _neighbours(solutions: list[QVISolution]) -> Iterator[QVISolution]:
    """Solutions at the ends of paths from the given ones, to which the caller adds new ones while it asks for more.

    On a path the bonded tractions change by θ C m. The solution follows, pivot by pivot, and turns back where it has
    to. Where θ returns to 0 the path is at a solution of the problem again, often another one.
    """
    qvi, tolerance = solutions[0].problem, solutions[0].certificate.tolerance
    settings = Settings.of(None, {"tolerance": tolerance, "max_iterations": _MOST_ITERATIONS})
    if qvi.m > LARGEST or qvi.is_fixed:
        return
    compliance = Compliance(qvi)
    directions = np.tile(qvi.W, 2) * generic_vector(_DIRECTIONS * 2 * qvi.m).reshape(_DIRECTIONS, -1)
    ways = [compliance.bonded + compliance.dense @ m for m in directions]  # tractions at θ = 1
    for state in map(Start.of, solutions):
        tractions = qvi.tractions(state.z)
        bounds = ContactBounds(qvi, compliance, np.where(qvi.bilateral & (tractions[: qvi.m] > 0.0), 1.0, -1.0))
        active = bounds.active(tractions, state.multipliers)
        for bonded in ways:
            change = bounds.slack(bonded) - bounds.q
            for d in (change, -change):
                if deadline.over or len(solutions) >= MOST:
                    return
                vertex = solve_lcp(bounds.M, bounds.q, d / (largest(d) or 1.0), active, away=True)
                if vertex.reason is Status.SOLVED:
                    multipliers = bounds.multipliers(vertex.x)
                    yield solved(qvi, settings, Start(compliance.state(multipliers)[0], multipliers))


def _ends(solution: QVISolution) -> Iterator[QVISolution]:
    """The last state of each path, until the time is over."""
    qvi, tolerance = solution.problem, solution.certificate.tolerance
    for first, count in WAYS:
        state = None
        for factor in np.linspace(first, 1.0, count + 1):
            if deadline.over:
                return
            scaled_qvi = qvi if factor == 1.0 else qvi.with_law(mu=factor * qvi.mu)
            step = solve_qvi(scaled_qvi, "condensed", tolerance=tolerance, initial=state)
            state = step if step.solved else state
        yield step
