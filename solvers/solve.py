"""One entry for every method."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeVar

import numpy as np

from solvers.basics.checks import function_or_none, true_or_false
from solvers.basics.names import closest
from solvers.basics.progress import Log, Progress, deadline, report
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.condensed.method import CondensedOptions, solve_condensed
from solvers.errors import InputError, SolveError, SolverUnavailableError
from solvers.factorisation import FactorisationError
from solvers.factorisation.choice import Request
from solvers.fixed_point.forms import CONDENSED_LIMIT
from solvers.fixed_point.method import FixedPointOptions, initial_pressure, solve_fixed_point
from solvers.inequality.problem import FrictionQVI
from solvers.inner.registry import check_name, versions
from solvers.pivoting import PivotingOptions, affordable, another_solution, solve_pivoting
from solvers.solution import Attempt, Outcome, QVISolution, Start, finish, no_outcome, out_of_time
from solvers.uzawa import UzawaOptions, solve_uzawa

Method = Literal["condensed", "fixed-point", "pivoting", "uzawa"]
METHODS: tuple[str, ...] = ("condensed", "fixed-point", "pivoting", "uzawa")

_TOLERANCE = 1e-8
_STARTED = ("condensed", "fixed-point")  # methods that take a start
_START = "initial"
"""Option that chooses no method: a state is for the condensed method and the fixed point, a pressure for the latter."""

_OF_ALL_METHODS = ("method", "inner", "tolerance", "throw", "factorisation", "threads", "time_limit", "verbose")

DEFAULT_INNER = "qp:clarabel"

LEAST_SECONDS = 15.0
"""A fall-back may take as long again as the method before it, and at least so many seconds."""

_HOPELESS = 1e-4
"""Relative error of the solution without inequalities, in the energy norm, above which nothing is attempted."""

_FAILURES = {
    "singular": Status.ILL_CONDITIONED,
    "memory": Status.OUT_OF_MEMORY,
    "time": Status.TIME_LIMIT,
    "backend": Status.BACKEND_FAILED,
}

_REFUSED = "Nothing was begun, as the limit could not be met."

_OPTIONS = {
    "condensed": CondensedOptions, "fixed-point": FixedPointOptions, "uzawa": UzawaOptions, "pivoting": PivotingOptions,
}  # fmt: skip

_Options = TypeVar("_Options", CondensedOptions, FixedPointOptions, UzawaOptions, PivotingOptions)


class _FallBack(NamedTuple):
    """A method that is tried after the condensed one: its name as the subject of a sentence, and for which problems."""

    method: str
    subject: str
    serves: Callable[[FrictionQVI], bool]


FALL_BACKS: Final = (
    _FallBack("pivoting", "Pivoting", affordable),
    _FallBack("fixed-point", "The fixed point", lambda qvi: 2 * qvi.m <= CONDENSED_LIMIT),
)
"""Tried in this order, where no method is asked for, until a certificate passes. Before them the condensed method has
tried its own starts: the usual one, R in place of K, other shares of friction (`condensed.method`)."""

_WORTH_A_FALL_BACK = (
    Status.INACCURATE, Status.ILL_CONDITIONED, Status.STALLED,
    Status.MAX_ITERATIONS, Status.INNER_INFEASIBLE, Status.DIVERGED,
)  # fmt: skip


@dataclass(frozen=True)
class Settings:
    """How a problem is solved, checked: keyword arguments of `solve_qvi`, but for time and printing.

    Attributes
    ----------
    method : the one that is taken, or begins
    by_default : whether that is because none was asked for, so that `FALL_BACKS` may follow
    inner : inner solver of the fixed point
    tolerance, throw, factorisation, threads : as `solve_qvi` has them
    options : those of the method

    """

    method: str
    by_default: bool
    inner: str
    tolerance: float
    throw: bool
    factorisation: str
    threads: int | None
    options: Mapping[str, Any]

    @classmethod
    def of(
        cls,
        method: str | None = None,
        inner: str | None = None,
        tolerance: float = _TOLERANCE,
        throw: bool = False,
        factorisation: str = "auto",
        threads: int | None = None,
        time_limit: object = None,  # noqa: ARG003  # checked where the clock is set
        verbose: object = False,  # noqa: ARG003
        **options: Any,
    ) -> Settings:
        """Raise what `solve_qvi` raises of these keyword arguments for any problem, before anything is computed."""
        if not (isinstance(tolerance, int | float) and 0 < tolerance < 1):
            raise InputError("tolerance", tolerance, "give a number between 0 and 1")
        check_choice(method, inner)
        function_or_none("callback", options.get("callback"))
        throw = true_or_false("throw", throw)
        _ = Request.checked(factorisation, threads)
        chosen = method or _method_with(inner, set(options).difference((_START,)))
        left_out = (_START,) if chosen in _STARTED else ()  # a start is checked with the problem
        _ = _options(_OPTIONS[chosen], chosen, {name: each for name, each in options.items() if name not in left_out})
        by_default, inner = method is None and chosen == "condensed", DEFAULT_INNER if inner is None else inner
        return cls(chosen, by_default, inner, tolerance, throw, factorisation, threads, MappingProxyType(options))

    @property
    def takes_state(self) -> bool:
        """Whether a state may be added as `initial`; it changes no method."""
        return self.method in _STARTED

    def starting(self, initial: object) -> Settings:
        """The same from another start."""
        return dataclasses.replace(self, options=MappingProxyType({**self.options, _START: initial}))


def _method_with(inner: str | None, given: set[str]) -> str:
    """The method that an inner solver asks for, or the first of those that have most of the options given."""
    if inner is not None:
        return "fixed-point"
    has = {method: len(given & {field.name for field in dataclasses.fields(kind)}) for method, kind in _OPTIONS.items()}
    return max(has, key=has.__getitem__)


def solve_qvi(
    qvi: FrictionQVI,
    method: str | None = None,
    inner: str | None = None,
    tolerance: float = _TOLERANCE,
    throw: bool = False,
    factorisation: str = "auto",
    threads: int | None = None,
    time_limit: float | None = None,
    verbose: bool = False,
    **options: Any,
) -> QVISolution:
    """Solve the quasi-variational inequality (D2).

    Parameters
    ----------
    qvi : FrictionQVI
        The problem, dimensionless.
    method : str, optional
        "condensed", "fixed-point", "pivoting" or "uzawa". By default "condensed"; where that fails "pivoting" if the
        contact is small, and "fixed-point" if it is not large, for as long again as the first took at most, or 15
        seconds if that is more; another method if an inner solver or options are given that only that one takes.
        `initial` is no such option.
    inner : str, optional
        Inner solver of the fixed point, one of `available()`, by default "qp:clarabel"; not used by other methods.
    tolerance : float
        Of the certificate, relative (see `certificate`).
    throw : bool
        Raise `SolveError` instead of returning a result whose status is not "solved".
    factorisation : str
        "pardiso", "superlu" or "dense"; "auto" takes "dense" for up to 500 unknowns, else the first of the others that
        is installed.
    threads : int, optional
        For factorisation and dense linear algebra; by default one for small problems, else all cores.
    time_limit : float, optional
        Seconds for everything together. The best state so far is returned when they are over, with the status
        "time_limit" unless its certificate passes. Looked at in every iteration, and handed on to inner solvers that
        take a limit; a factorisation, and an inner solve by another one, is not interrupted.
    verbose : bool
        Print a header, a line an iteration, and a footer with status and times.
    **options : object
        Fields of `CondensedOptions`, `FixedPointOptions`, `PivotingOptions` or `UzawaOptions`. By default
        `max_iterations` counts the iterations of the condensed method and the fixed point, and `callback` hears of all.
        `initial` is the `QVISolution` of a problem with the same unknowns and rows, from which the condensed method and
        the fixed point begin, or a pressure (m,), from which the fixed point does. Two iterations of the condensed
        method tell whether such a state is near; if it is not, the usual start is taken.

    Returns
    -------
    A `QVISolution` in every case, status and advice included; solved only if its certificate passed. `attempts` has
    what was tried, and why. There may be other solutions: the solution of (D2) is not unique for large friction. By
    default, and where the contact is small, another way is tried to find one; its `remarks` say what was seen.

    Raises
    ------
    InputError, SolverUnavailableError, and with `throw` SolveError.

    """
    if not isinstance(qvi, FrictionQVI):
        raise InputError("qvi", type(qvi).__name__, "give a FrictionQVI")
    settings = Settings.of(method, inner, tolerance, throw, factorisation, threads, **options)
    with deadline(time_limit), Log("solve_qvi", verbose) as log:
        log.begin(facts_of(qvi, settings))
        solution = solved(qvi, settings)
        log.end(str(solution.status), solution.message, solution.timings, solution.solved)
    if settings.throw and not solution.solved:
        raise SolveError(solution.message)
    return solution


def solved(qvi: FrictionQVI, settings: Settings) -> QVISolution:
    """Solve with checked settings: by a method, where it was not asked for by `FALL_BACKS` too, until one passes."""
    first, later = _with_start(qvi, settings)
    with qvi.stiffness.using(settings.factorisation, settings.threads):
        began = time.perf_counter()
        solution = _attempt(qvi, settings.method, settings.inner, settings.tolerance, first)
        if not settings.by_default:
            return solution
        spent = solution.iterations >= settings.options.get("max_iterations", np.inf)
        if not spent and solution.status in _WORTH_A_FALL_BACK and FALL_BACKS[-1].serves(qvi):
            seconds = max(LEAST_SECONDS, time.perf_counter() - began)
            over = deadline.over
            solution = out_of_time(solution) if over else _fallen_back(qvi, solution, settings, later, seconds)
        if solution.solved and not deadline.over:
            doubted = solution.method != settings.method or bool(solution.remarks)
            remark = another_solution(qvi, solution, settings.tolerance, doubted=doubted)
            solution = dataclasses.replace(solution, remarks=(remark,)) if remark else solution
        return solution


def _with_start(qvi: FrictionQVI, settings: Settings) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of the method and of fall-backs with `initial` as each takes it; checked even if not used."""
    options = dict(settings.options)
    given = options.get(_START)
    if given is None or not settings.takes_state:
        return options, options
    start = Start.of(given) if isinstance(given, QVISolution) else given
    pressure = initial_pressure(qvi, start.pressure if isinstance(start, Start) else start)
    later = {**options, _START: pressure}
    if settings.method == "fixed-point":
        return later, later
    if settings.by_default and not isinstance(start, Start):
        del options[_START]
        return options, later
    return {**options, _START: start}, later


def facts_of(qvi: FrictionQVI, settings: Settings) -> dict[str, object]:
    """What the header of a narration says of a problem and of how it is solved."""
    equations = {"equations": qvi.p} if qvi.p else {}
    how = {"method": settings.method, "tolerance": f"{settings.tolerance:g}"}
    return {"unknowns": qvi.n, "contact rows": qvi.m, **equations, **how}


def check_choice(method: object, inner: object) -> None:
    """Raise `SolverUnavailableError` where a method or an inner solver is given that is not the name of one."""
    if method is not None and not (isinstance(method, str) and method in METHODS):
        raise SolverUnavailableError("method", method, f"choose one of {', '.join(METHODS)}")
    if inner is not None:
        check_name(inner)


def _attempt(qvi: FrictionQVI, method: str, inner: str, tolerance: float, options: dict[str, Any]) -> QVISolution:
    """By method; a factorisation that fails ends in a status."""
    report(Progress(method))
    try:
        return _solve(qvi, method, inner, tolerance, options)
    except (FactorisationError, MemoryError) as error:
        reason = error.reason if isinstance(error, FactorisationError) else "memory"
        outcome = no_outcome(qvi, _FAILURES[reason], str(error) or "out of memory")
        outcome.check_feasible = False
        outcome.advice = _REFUSED if reason == "time" else ""
        return finish(qvi, outcome, method, inner if method == "fixed-point" else "", tolerance)


def _fallen_back(
    qvi: FrictionQVI, first: QVISolution, settings: Settings, options: dict[str, Any], seconds: float
) -> QVISolution:
    """`FALL_BACKS` after a first method, for so many seconds each at most: the first that passes, or the best."""
    kept = {name: value for name, value in options.items() if name in (_START, "callback")}
    if "max_iterations" in options:
        kept["max_iterations"] = options["max_iterations"] - first.iterations
    given = {"pivoting": {"callback": options.get("callback")}, "fixed-point": kept}
    tried = f"the condensed method ended {first.status.words} after {first.iterations} iterations"
    attempts, last = first.attempts, first
    for way in FALL_BACKS:
        if way.serves(qvi):
            if way is FALL_BACKS[-1]:
                report(Progress(way.method, remark=tried))
            with deadline(seconds):
                last = _attempt(qvi, way.method, DEFAULT_INNER, settings.tolerance, given[way.method])
            attempts += (Attempt(way.method, tried, last.status, last.iterations),)
            if last.solved:
                break
    better, subject = last.certificate.accuracy < first.certificate.accuracy, way.subject
    if last.solved or (last.status is Status.INACCURATE and better):
        found, remark = last, f"{subject} found this solution after {tried}."
    elif deadline.over:
        found = out_of_time(last if better else first)
        remark = f"The time limit ended the fixed point, which was tried because {tried}."
    elif last.status is Status.TIME_LIMIT:
        stopped = f"{subject}, tried next, was stopped after {seconds:.0f} seconds"
        found, remark = first, f"{stopped}: method='fixed-point' gives it more time."
    else:
        found, remark = first, f"{subject}, tried next, ended {last.status.words}."
    return dataclasses.replace(found, message=f"{found.message} {remark}", attempts=attempts)


def _solve(qvi: FrictionQVI, method: str, inner: str, tolerance: float, options: dict[str, Any]) -> QVISolution:
    """By method."""
    if method == "condensed":
        condensed = _options(CondensedOptions, method, options)
        return _linear(qvi, method, "", tolerance) or solve_condensed(qvi, tolerance, condensed)
    if method == "pivoting":
        pivoting = _options(PivotingOptions, method, options)
        return _linear(qvi, method, "", tolerance) or solve_pivoting(qvi, tolerance, pivoting)
    if not qvi.bonded_error <= _HOPELESS:
        return _give_up(qvi, method, inner, tolerance)
    if method == "fixed-point":
        name = check_name(inner)
        fixed_point = _options(FixedPointOptions, method, options)
        return _linear(qvi, method, name, tolerance) or solve_fixed_point(qvi, name, tolerance, fixed_point)
    uzawa = _options(UzawaOptions, method, options)
    return _linear(qvi, method, "", tolerance) or solve_uzawa(qvi, tolerance, uzawa)


def _give_up(qvi: FrictionQVI, method: str, inner: str, tolerance: float) -> QVISolution:
    """Refuse a problem whose plain linear system cannot be solved."""
    message = f"the linear system is solved to {qvi.bonded_error:.0e} only, in the energy norm"
    outcome = no_outcome(qvi, Status.ILL_CONDITIONED, message)
    outcome.check_feasible = False
    return finish(qvi, outcome, method, inner, tolerance)


def _linear(qvi: FrictionQVI, method: str, inner: str, tolerance: float) -> QVISolution | None:
    """The answer of a linear system if there is no contact, or if nothing is unknown; else nothing."""
    if qvi.m > 0 and qvi.n > 0:
        return None
    began = time.perf_counter()
    z, zero = qvi.bonded, np.zeros(qvi.m)
    _, nu = qvi.linear_system.solve(-qvi.gradient(z))
    reason = Status.SOLVED if qvi.m == 0 else Status.INFEASIBLE  # unless the certificate passes
    outcome = Outcome(reason, z, zero, zero, nu, qvi.threshold(qvi.pressure(z)), [], 0)
    outcome.timings = {"setup": 0.0, "solve": time.perf_counter() - began}
    outcome.versions = versions(("scipy",))
    return finish(qvi, outcome, method, inner, tolerance)


def _options(kind: type[_Options], method: str, given: dict[str, Any]) -> _Options:
    """Options as checked data; an unknown one lists those that exist."""
    names: list[str] = [field.name for field in dataclasses.fields(kind)]
    for name, value in given.items():
        if name not in names:
            near = closest(name, [*names, *_OF_ALL_METHODS])
            listed = f"method {method!r} has the options {', '.join(names)}"
            raise InputError(name, value, listed if near is None else f"did you mean {near!r}? Otherwise: {listed}")
    return kind(**given)


# Other solutions of a problem: friction is changed step by step, each step starting from the state of the one before.
#
# With friction the solution of (D2) need not be unique, and a method started anew ends at the one its own way leads to.
# Where the friction rises from a share of its value, or falls from a multiple, the state changes little in each step,
# and the way may end at another solution. None found proves nothing; `uniqueness` has a bound below which there is
# none.


WAYS: Final = ((0.4, 5), (0.4, 20), (0.6, 20), (0.85, 3), (1.3, 10))
"""First friction over that of the problem, and the steps from there."""

_OTHER: Final = 1e-4  # difference of tractions, over the largest one, that is not the certificates' error


def followed_solutions(solution: QVISolution, *, time_limit: float | None = None) -> tuple[QVISolution, ...]:
    """The solution and others of the same problem, found by following the friction along each of `WAYS`.

    Each is certified to the tolerance of the first, on the data of the problem. Two of them are different if their
    tractions differ at any point by more than 1e-4 of the largest one.

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
            if end.solved and all(traction_difference(end, other) > _OTHER for other in found):
                found.append(end)
    return tuple(found)


def traction_difference(one: QVISolution, other: QVISolution) -> float:
    """The largest difference of tractions at a contact point, over the largest traction of the first."""
    difference = float(np.abs(_tractions(one) - _tractions(other)).max(initial=0.0))
    return difference / one.certificate.scales["stress"]


def _tractions(solution: QVISolution) -> Vector:
    qvi = solution.problem
    return np.concatenate([qvi.normal(solution.z), qvi.tangential(solution.z)])


def _ends(solution: QVISolution) -> Iterator[QVISolution]:
    """What the ways end at, until the time is over; those that begin at the same friction begin at the same state."""
    begun: dict[float, QVISolution] = {}
    for first, count in WAYS:
        state = None
        for factor in np.linspace(first, 1.0, count + 1):
            if deadline.over:
                return
            if factor == first and first in begun:
                step = begun[first]
            else:
                step = _at_friction(factor, solution, state)
                begun.setdefault(first, step)
            state = step if step.solved else state
        yield step


def _at_friction(factor: float, solution: QVISolution, start: QVISolution | None) -> QVISolution:
    """The problem of a solution with so many times its friction, solved from a state."""
    qvi = solution.problem
    posed = qvi if factor == 1.0 else qvi.with_law(mu=factor * qvi.mu)
    return solve_qvi(posed, "condensed", tolerance=solution.certificate.tolerance, initial=start)
