"""One entry for every method: settings, the ways to solve that are tried in order, and other solutions."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import nullcontext
from itertools import chain
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from solvers.basics.progress import Log, Progress, deadline, listening, report
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import Certificate
from solvers.certificate.feasibility import refuted
from solvers.condensed.method import EXACT, LAST, CondensedRun
from solvers.condensed.systems import FITTING_SHARES, NEAR_BONDED_SHARES
from solvers.errors import InputError, SolveError
from solvers.factorisation.base import FactorisationError
from solvers.fixed_point import initial_pressure, solve_fixed_point
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import largest
from solvers.inner.registry import check_name, versions
from solvers.pivoting import DIRECTIONS, LARGEST_LATE, affordable, solve_pivoting
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
from solvers.solution import Attempt, Outcome, QVISolution, Start, finish, judged, out_of_time
from solvers.uzawa import solve_uzawa


def solve_qvi(qvi: FrictionQVI, method: str | None = None, **settings: Any) -> QVISolution:
    """Solve the quasi-variational inequality (D2).

    Parameters
    ----------
    qvi : FrictionQVI
        The problem, dimensionless.
    method, **settings
        See `solvers.settings.Settings`, its `options` by their names.

    Returns
    -------
    A `QVISolution` in every case, status and advice included; solved only if its certificate passed. `attempts` has
    what was tried, and why. For large friction there may be other solutions: `followed_solutions` looks for them.

    Raises
    ------
    InputError, SolverUnavailableError, and with `throw` SolveError.

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
    """What the header of a narration says of a problem and of how it is solved."""
    equations = {"equations": qvi.p} if qvi.p else {}
    how = {"method": settings.chosen, "tolerance": f"{settings.tolerance:g}"}
    return {"unknowns": qvi.n, "contact rows": qvi.m, **equations, **how}


# The ways to solve, in the order in which they are tried until a certificate passes.


LEAST_SECONDS = 15.0
"""A fall-back may take as long again as the method before it, and at least so many seconds."""

_HOPELESS = 1e-4
"""Relative error of the solution without inequalities, in the energy norm, above which nothing is attempted."""

_OF_ALL: Final = {"max_iterations"}  # the options that choose no method

_ASKED, _AT_LEAST = 0.2, 0.5  # of the time so far, and seconds, for a proof that the load cannot be carried

_FAILURES = {
    "singular": Status.ILL_CONDITIONED,
    "memory": Status.OUT_OF_MEMORY,
    "time": Status.TIME_LIMIT,
    "backend": Status.BACKEND_FAILED,
}

_ITERABLE = 250
"""Contact points up to which an iteration of the fixed point takes at most a tenth of `LEAST_SECONDS`, and not 20 s."""

_WORTH_A_FALL_BACK = (
    Status.INACCURATE, Status.ILL_CONDITIONED, Status.STALLED,
    Status.MAX_ITERATIONS, Status.INNER_INFEASIBLE, Status.DIVERGED,
)  # fmt: skip


Tries: TypeAlias = Iterator[tuple[Attempt, Outcome]]


def usual_start(search: Search) -> Tries:
    """The condensed method from where the contact would be bonded, or near a state that is given."""
    run = search.run = CondensedRun.of(search.qvi, search.options(CondensedOptions))
    run.begin_near()
    run.iterate()
    yield run.attempt("condensed", ""), run.outcome()


def other_shares(search: Search) -> Tries:
    """Other central paths: the usual start where an earlier answer led nowhere, then other shares of friction in s λ.

    Those with which slacks fit most easily come first where slacks did not, and those near the bonded solution where a
    start stalled: on strongly graded meshes multipliers that are large at first bend the path. Smaller shares follow a
    point that is solved but for its forces: the two multipliers of shear at an open point are proportional to that
    share, and lose as many digits in their difference. None follows where it is soon proved that the load cannot be
    carried.
    """
    first, best = search.run, search.best
    if first is None or best is None or first.reason in LAST:
        return
    inexact = first.reason is Status.SOLVED and first.residual() > EXACT
    if first.reason is Status.SOLVED and not inexact:
        return
    best.feasibility = refuted(search.qvi, max(_ASKED * search.seconds, _AT_LEAST))
    if best.feasibility is not None:
        return
    shares = first.space.shares
    others = [share for share in shares[1:] if share.late < shares[0].late or not inexact]
    for reason, share in ((Status.INNER_INFEASIBLE, FITTING_SHARES), (Status.STALLED, NEAR_BONDED_SHARES)):
        if first.reason is reason and share not in shares:
            others.insert(0, share)
    if search.qvi.frictionless.all():  # no bound depends on shares of friction
        others = [share for share in others if share.start != shares[0].start]
    for share in [shares[0], *others] if first.warm else others:
        before = search.run or first
        run = search.run = before.again(share, turned=share != shares[0] and not inexact)
        run.iterate()
        near = ", near the bonded state" if share.start < shares[0].start else ""
        name = f"condensed, friction's share {share.early:g}, then {share.late:g}{near}"
        yield run.attempt(name, f"the start before ended {before.reason.words}"), run.outcome()
        if run.reason in LAST or (run.reason is Status.SOLVED and not inexact):
            return


def vertex(search: Search) -> Tries:
    """From vertex to vertex, for small contacts; from a state that is given, if it fits."""
    start = search.start if search.start is not None and search.start.fits(search.qvi) else None
    found = solve_pivoting(search.qvi, search.settings.tolerance, search.options(PivotingOptions), start=start)
    yield Attempt("pivoting", "", found.reason, found.iterations), found


def other_vertices(search: Search) -> Tries:
    """The same along each direction that was not tried."""
    tried, tolerance = any(attempt.name == "pivoting" for attempt in search.attempts), search.settings.tolerance
    for direction in range(1 if tried else 0, DIRECTIONS):
        found = solve_pivoting(search.qvi, tolerance, search.options(PivotingOptions), direction)
        name = f"pivoting, direction {direction + 1}" if direction else "pivoting"
        yield Attempt(name, "", found.reason, found.iterations), found


def fixed_point(search: Search) -> Tries:
    """Outer iteration on the friction bound, for contacts that are not large."""
    options, name = search.options(FixedPointOptions), check_name(search.inner)
    found = _hopeless(search.qvi) or solve_fixed_point(search.qvi, name, search.settings.tolerance, options)
    yield Attempt("fixed-point", "", found.reason, found.iterations), found


def uzawa(search: Search) -> Tries:
    """The iteration of Więckowski 1992, where it is asked for."""
    options = search.options(UzawaOptions)
    found = _hopeless(search.qvi) or solve_uzawa(search.qvi, search.settings.tolerance, options)
    yield Attempt("uzawa", "", found.reason, found.iterations), found


def _hopeless(qvi: FrictionQVI) -> Outcome | None:
    """What is left of a problem whose plain linear system cannot be solved; None of others."""
    error = qvi.bonded_state.error
    if error <= _HOPELESS:
        return None
    message = f"the linear system is solved to {error:.0e} only, in the energy norm"
    return dataclasses.replace(Outcome.nothing(qvi, Status.ILL_CONDITIONED, message), hopeless=True)


def _linear(qvi: FrictionQVI, method: str) -> Tries:
    """The answer of a linear system, where there is no contact, or nothing is unknown."""
    z, zero = qvi.bonded, np.zeros(qvi.m)
    _, nu = qvi.linear_system.solve(-qvi.gradient(z))
    reason = Status.SOLVED if qvi.m == 0 else Status.INFEASIBLE  # unless the certificate passes
    yield Attempt(method, "", reason, 0), Outcome(reason, z, zero, zero, nu, versions=versions(("scipy",)))


class Way(NamedTuple):
    """One entry of `ATTEMPTS`."""

    method: str  # to which it belongs; one that is asked for has its own entries alone
    # what it tries, one by one as they are asked for; nothing where those before leave nothing to do
    tries: tuple[Callable[[Search], Tries], ...]
    subject: str = ""  # of a sentence that says what the method found
    # for which problems it is tried where no method is asked for
    serves: Callable[[FrictionQVI], bool] = lambda _: True


ATTEMPTS: Final = (
    Way("pivoting", (vertex,), serves=affordable),
    Way("condensed", (usual_start, other_shares)),
    Way("pivoting", (other_vertices,), "Pivoting", lambda qvi: affordable(qvi, LARGEST_LATE)),
    Way("fixed-point", (fixed_point,), "The fixed point", lambda qvi: qvi.m <= _ITERABLE),
    Way("uzawa", (uzawa,), serves=lambda _: False),
)
"""Tried in this order until a certificate passes; the first leaves nothing behind where it fails."""


class Search:
    """What is tried of one problem."""

    def __init__(self, qvi: FrictionQVI, settings: Settings, initial: object) -> None:
        self.qvi, self.settings = qvi, settings
        self.inner = settings.inner or DEFAULT_INNER  # of the fixed point
        self.attempts: tuple[Attempt, ...] = ()  # so far
        self.best: Outcome | None = None  # of the method under way, by its certificate
        self.run: CondensedRun | None = None  # last start of the condensed method
        self._began = time.perf_counter()
        self._given = dict(settings.options)
        self.start: Start | None = None  # a state that is given, and its pressure
        self._pressure: Vector | None = None
        if initial is not None and settings.takes_state:
            start = Start.of(initial) if isinstance(initial, QVISolution) else initial
            self.start = start if isinstance(start, Start) else None
            self._pressure = initial_pressure(qvi, start if self.start is None else self.start.pressure)
            if settings.chosen == "fixed-point":
                self._given["initial"] = self._pressure
            elif self.start is not None or not settings.by_default:  # a pressure is for what may follow
                self._given["initial"] = start

    @property
    def seconds(self) -> float:
        """Since it began, without the factorisation."""
        return time.perf_counter() - self._began - (self.run.setup if self.run else 0.0)

    def options(self, kind: type[Options]) -> Options:
        """Those of the method under way, as far as it has them."""
        return kind(**{name: value for name, value in self._given.items() if name in kind.__dataclass_fields__})

    def first(self) -> QVISolution | None:
        """What the first of `ATTEMPTS` finds; None where it does not serve, or is not certified."""
        way = ATTEMPTS[0]
        if not way.serves(self.qvi):
            return None
        certificate, timings = self._best_of(way)
        return self._finished(way, certificate, timings) if certificate.passed else None

    def by(self, *ways: Way, why: str = "") -> QVISolution:
        """The best that ways of one method find, certified; a factorisation that fails ends in a status."""
        return self._finished(ways[0], *self._best_of(*ways, why=why))

    def _finished(self, way: Way, certificate: Certificate, timings: Mapping[str, float]) -> QVISolution:
        assert self.best is not None
        inner = self.inner if way.method == "fixed-point" else ""
        return finish(self.qvi, self.best, certificate, way.method, inner, self.attempts, timings)

    def _best_of(self, *ways: Way, why: str = "") -> tuple[Certificate, dict[str, float]]:
        """The certificate of the best outcome, which is kept, and seconds by name."""
        qvi, tolerance, method = self.qvi, self.settings.tolerance, ways[0].method
        report(Progress(method))
        began, certifying = time.perf_counter(), 0.0
        self.best, certificate = None, None
        if qvi.m and qvi.n:
            tries = chain.from_iterable(tried(self) for way in ways for tried in way.tries)
        else:
            tries = chain(_linear(qvi, method))
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what diverges is judged by its end
                for attempt, outcome in tries:
                    before, found = time.perf_counter(), None
                    if self.best is not None or outcome.reason is not Status.ILL_CONDITIONED:
                        found = outcome.certified(qvi, tolerance)
                        attempt = attempt._replace(status=judged(attempt.status, found))
                    certifying += time.perf_counter() - before
                    self.attempts += (attempt._replace(reason=attempt.reason or why),)
                    certificate = self._keep(outcome, found, certificate)
                    if certificate is not None and certificate.passed:
                        break
        except (FactorisationError, MemoryError) as error:
            reason = error.reason if isinstance(error, FactorisationError) else "memory"
            nothing = Outcome.nothing(qvi, _FAILURES[reason], str(error) or "out of memory")
            self.best, certificate = dataclasses.replace(nothing, hopeless=True), None
            self.attempts += (Attempt(method, why, nothing.reason, 0),)
        best, before = self.best, time.perf_counter()
        assert best is not None
        certificate = certificate or best.certified(qvi, tolerance)
        certifying += time.perf_counter() - before
        seconds = time.perf_counter() - began - best.setup - certifying
        return certificate, {"setup": best.setup, "solve": seconds, "certificate": certifying}

    def _keep(self, outcome: Outcome, found: Certificate | None, certificate: Certificate | None) -> Certificate | None:
        """The better of the best so far and a new outcome; its certificate. What has no certificate is replaced."""
        best = self.best
        if best is None or certificate is None or found is None or found.accuracy < certificate.accuracy:
            self.best = outcome
            return found
        best.history, best.iterations = outcome.history, outcome.iterations  # all count, whichever is best
        if outcome.reason is Status.TIME_LIMIT and best.reason is not Status.SOLVED:
            best.reason, best.message = outcome.reason, ""
        return certificate

    def fallen_back(self, first: QVISolution) -> QVISolution:
        """The first of the methods left that passes, each for as long again as the first one took; or the best."""
        later = [way for way in ATTEMPTS[1:] if way.method != first.method and way.serves(self.qvi)]
        limit = self.settings.options.get("max_iterations")
        spent, over = limit is not None and first.iterations >= limit, deadline.over
        if spent or first.status not in _WORTH_A_FALL_BACK or not later:
            return first
        if over:
            return out_of_time(first)
        seconds = max(LEAST_SECONDS, time.perf_counter() - self._began)
        tried = f"the condensed method ended {first.status.words} after {first.iterations} iterations"
        self.inner, last, subject = DEFAULT_INNER, first, ""
        for way in later:
            self._given = {"initial": self._pressure} if way.method in STARTED else {}
            if limit is not None and way.method in STARTED:
                self._given["max_iterations"] = limit - first.iterations
            report(Progress(way.method, remark=tried))
            with deadline(seconds):
                last, subject = self.by(way, why=tried), way.subject
            if last.solved:
                break
        better = last.certificate.accuracy < first.certificate.accuracy
        if last.solved or (last.status is Status.INACCURATE and better):
            found, remark = last, f"{subject} found this solution after {tried}."
        elif deadline.over:
            found = out_of_time(last if better else first)
            remark = f"The time limit ended {subject.lower()}, which was tried because {tried}."
        elif last.status is Status.TIME_LIMIT:
            stopped = f"{subject}, tried next, was stopped after {seconds:.0f} seconds"
            found, remark = first, f"{stopped}: method={way.method!r} gives it more time."
        else:
            found, remark = first, f"{subject}, tried next, ended {last.status.words}."
        return dataclasses.replace(found, message=f"{found.message} {remark}", attempts=self.attempts)


def solved(qvi: FrictionQVI, settings: Settings, initial: object = None) -> QVISolution:
    """Solve from a start: by the method of the settings, where it was not asked for by the other `ATTEMPTS` too."""
    callback = settings.callback

    def hear(progress: Progress) -> None:
        if callback is not None and progress.iteration is not None:
            callback(progress.iteration)

    with qvi.stiffness.using(settings.factorisation, settings.threads), listening(hear) if callback else nullcontext():
        search = Search(qvi, settings, initial)
        chosen = [way for way in ATTEMPTS if way.method == settings.chosen]
        if not settings.by_default:
            return search.by(*chosen)
        solution = None if settings.options.keys() - _OF_ALL else search.first()
        return solution or search.fallen_back(search.by(*chosen))


# Other solutions of a problem: with friction that of (D2) need not be unique, and a method started anew ends at the one
# its own way leads to. Where friction rises from a share of its value, or falls from a multiple, step by step, states
# change little, and the way may end at another one. None found proves nothing; `uniqueness` has a bound for that.


WAYS: Final = ((0.4, 5), (0.4, 20), (0.6, 20), (0.85, 3), (1.3, 10))
"""First friction over that of the problem, and the steps from there."""

OTHER: Final = 1e-4
"""Difference of tractions, over the largest one, that is not the certificates' error."""


def followed_solutions(solution: QVISolution, *, time_limit: float | None = None) -> tuple[QVISolution, ...]:
    """The solution and others of the same problem, found by following the friction along each of `WAYS`.

    Each is certified to the tolerance of the first, on the data of the problem. Two of them are different if their
    tractions differ at any point by more than `OTHER` of the largest one.

    Parameters
    ----------
    solution : QVISolution
        Solved.
    time_limit : float, optional
        Seconds for all ways together. What was found until then is returned.

    Raises
    ------
    InputError
        If the solution is not solved, or the time limit is wrong.

    """
    if not solution.solved:
        raise InputError("solution", str(solution.status), "give one that is solved")
    found, qvi = [solution], solution.problem
    if not (qvi.mu > 0.0).any():
        return (solution,)
    with deadline(time_limit):
        for end in _ends(solution):
            if end.solved and all(traction_difference(end, other) > OTHER for other in found):
                found.append(end)
    return tuple(found)


def traction_difference(one: QVISolution, other: QVISolution) -> float:
    """The largest difference of tractions at a contact point, over the largest traction of the first."""
    mine, theirs = (each.problem.tractions(each.z) for each in (one, other))
    return largest(mine - theirs) / one.certificate.scales["stress"]


def _ends(solution: QVISolution) -> Iterator[QVISolution]:
    """What the ways end at, until the time is over; those that begin at the same friction begin at the same state."""
    begun: dict[float, QVISolution] = {}
    qvi, tolerance = solution.problem, solution.certificate.tolerance
    for first, count in WAYS:
        state = None
        for factor in np.linspace(first, 1.0, count + 1):
            if deadline.over:
                return
            if factor == first and first in begun:
                step = begun[first]
            else:
                posed = qvi if factor == 1.0 else qvi.with_law(mu=factor * qvi.mu)
                step = solve_qvi(posed, "condensed", tolerance=tolerance, initial=state)
                begun.setdefault(first, step)
            state = step if step.solved else state
        yield step
