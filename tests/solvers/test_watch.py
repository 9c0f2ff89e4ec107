"""One clock for all that a solve does, and who hears how far it is; time passes when a test lets it."""

import math
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

import solvers.inner.direct_osqp
import solvers.solve
from solvers import InputError, Status, available, certify, solve_qvi
from solvers.basics.watch import Progress, expired, left, tell, watched
from solvers.inner import guard
from solvers.inner.problem import Centre, no_result
from solvers.inner.registry import make_inner
from solvers.solve import takes_initial
from tests.solvers.conftest import one_contact, random_problem, two_contacts

INNER = "direct:clarabel"
LIMITED = ("qp:clarabel", "qp:osqp", "qp:qpalm", "direct:clarabel", "direct:osqp")  # these say so, too


@pytest.fixture
def slow_inner(monkeypatch, clock):
    """Inner solvers of the fixed point that take ten seconds each; the list of their calls."""
    calls = []

    class Slow:
        packages = ("clarabel",)

        def __init__(self, *arguments):
            self._solver = make_inner(INNER, *arguments[1:])

        def solve(self, *arguments):
            calls.append(clock.now)
            clock.passes(10.0)
            return self._solver.solve(*arguments)

    monkeypatch.setattr(solvers.fixed_point.method, "make_inner", Slow)
    return calls


@pytest.fixture
def failing_condensed(monkeypatch):
    """The condensed method stops as one that makes no progress, after three iterations and far from the solution."""

    def fails(qvi, tolerance, options):
        found = solve_condensed(qvi, tolerance, replace(options, max_iterations=3))
        return replace(found, status=Status.STALLED)

    solve_condensed = solvers.solve.solve_condensed
    monkeypatch.setattr(solvers.solve, "solve_condensed", fails)
    monkeypatch.setattr(solvers.solve, "affordable", lambda _: False)  # as where the contact is too large to pivot


def test_the_earlier_end_counts(clock):
    assert (left(), expired()) == (math.inf, False)
    with watched(5.0):
        with watched(8.0):
            assert left() == 5.0
        with watched(2.0):
            assert left() == 2.0
            clock.passes(2.0)
            assert expired()
            assert 0.0 < left() < 0.01  # some back ends take 0 for no limit
        assert (left(), expired()) == (3.0, False)
        with watched():
            assert left() == 3.0
    assert not expired()


def test_everyone_is_told():
    outer, inner = [], []
    with watched(report=outer.append):
        with watched(1.0, inner.append):
            tell(Progress("uzawa"))
        tell(Progress("condensed"))
    tell(Progress("fixed-point"))
    assert [said.method for said in outer] == ["uzawa", "condensed"]
    assert [said.method for said in inner] == ["uzawa"]


@pytest.mark.parametrize("limit", [0, -1.0, math.nan, math.inf, "60", True, 1j, 10**400, [1.0]])
def test_bad_limits_are_refused(limit):
    with pytest.raises(InputError) as caught:
        solve_qvi(one_contact(0.5), time_limit=limit)
    assert caught.value.field == "time_limit"


@pytest.mark.parametrize("limit", [1, 1.5, np.float64(30.0), np.int64(30)])
def test_numbers_of_seconds(limit):
    assert solve_qvi(one_contact(0.5), time_limit=limit).solved


@pytest.mark.parametrize(
    "options",
    [{"method": "condensed"}, {"method": "uzawa"}, {"inner": INNER, "variant": "plain"}, {}],
    ids=["condensed", "uzawa", "fixed-point", "default"],
)
def test_every_method_keeps_to_it(clock, options):
    """A second an iteration: four are begun in three and a half; the state is certified as it is, and finite."""
    qvi = random_problem(4)
    seen = []

    def callback(entry):
        seen.append(entry)
        clock.passes(1.0)

    solution = solve_qvi(qvi, time_limit=3.5, callback=callback, **options)
    assert solution.status is Status.TIME_LIMIT
    assert solution.iterations == len(seen) == 4
    assert np.isfinite(solution.z).all()
    rows = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    certificate = certify(qvi, solution.z, *rows)
    assert solution.certificate.accuracy == pytest.approx(certificate.accuracy)
    assert 1e-8 < certificate.accuracy < math.inf
    longer = solve_qvi(qvi, time_limit=300.0, callback=callback, max_iterations=10, **options)
    assert longer.status is not Status.TIME_LIMIT
    assert longer.iterations > 4


def test_a_slow_inner_solver(clock, slow_inner):
    solution = solve_qvi(random_problem(4), inner=INNER, time_limit=25.0)
    assert solution.status is Status.TIME_LIMIT
    assert slow_inner == [0.0, 10.0, 20.0]
    assert np.isfinite(solution.z).all()
    assert clock.now == 30.0


@pytest.mark.parametrize("status", [Status.BACKEND_FAILED, Status.INFEASIBLE])
def test_nothing_is_asked_again_when_the_time_is_over(monkeypatch, clock, status):
    """Neither the back end that failed, nor another one about its claim, nor whether the load can be carried."""
    made, calls = [], []

    class Fails:
        packages = ("clarabel",)

        def __init__(self, *arguments):
            made.append(arguments[0])
            self._qvi = arguments[1]

        def solve(self, *_):
            calls.append(clock.now)
            clock.passes(10.0)
            return no_result(self._qvi, status, "no answer in time")

    monkeypatch.setattr(solvers.fixed_point.method, "make_inner", Fails)
    monkeypatch.setattr(solvers.solution.finish, "check_feasibility", None)
    solution = solve_qvi(random_problem(4), inner=INNER, time_limit=5.0)
    assert solution.status is Status.TIME_LIMIT
    assert (len(made), calls) == (1, [0.0])


def limited(name, monkeypatch, seconds):
    """An inner solve with so many seconds left."""
    qvi = random_problem(1)
    for place in (guard, solvers.inner.direct_osqp):
        monkeypatch.setattr(place, "left", lambda: seconds)
    solver = make_inner(name, qvi, 1e-11)
    return solver.solve(qvi.threshold(np.full(qvi.m, 0.4)), Centre(qvi, np.zeros(qvi.n)), None)


@pytest.mark.parametrize("name", [name for name in LIMITED if name in available()])
def test_back_ends_get_what_is_left(name, monkeypatch):
    assert limited(name, monkeypatch, 1e-9).status is Status.TIME_LIMIT
    assert limited(name, monkeypatch, 60.0).status is Status.SOLVED


def test_a_limit_of_ones_own_stays():
    settings = {"time_limit": 2.0, "verbose": False}
    assert guard.within_time(settings, "time_limit") == settings
    with watched(100.0):
        assert guard.within_time(settings, "time_limit") == settings
        assert guard.within_time(settings, "") == settings
    with watched(1e-9):
        assert guard.within_time(settings, "time_limit")["time_limit"] < 0.01


@pytest.mark.usefixtures("failing_condensed")
def test_the_fall_back_is_announced_and_its_answer_explained():
    heard, seen = [], []
    with watched(report=heard.append):
        solution = solve_qvi(random_problem(4), callback=seen.append)
    assert solution.solved
    assert solution.method == "fixed-point"
    assert "condensed method ended stalled after 3 iterations" in solution.message
    begins = [said for said in heard if said.iteration is None]
    assert [said.method for said in begins if not said.remark] == ["condensed", "fixed-point"]
    assert len([said for said in begins if said.remark]) == 1
    assert [said.iteration for said in heard if said.iteration is not None] == seen
    assert tuple(seen[3:]) == solution.history


@pytest.mark.usefixtures("failing_condensed")
def test_the_fall_back_takes_no_longer_than_its_share(clock, slow_inner):
    """Fifteen seconds where the first method took none: two inner problems of ten seconds are begun."""
    solution = solve_qvi(random_problem(4))
    assert slow_inner == [0.0, 10.0]
    assert solution.status is Status.STALLED
    assert solution.method == "condensed"
    assert "stopped after 15 seconds" in solution.message
    assert clock.now < 30.0


@pytest.mark.usefixtures("failing_condensed")
def test_the_fall_back_is_on_the_same_clock(slow_inner):
    solution = solve_qvi(random_problem(4), time_limit=8.0)
    assert slow_inner == [0.0]
    assert solution.status is Status.TIME_LIMIT
    assert solution.message.startswith("time limit after")


@pytest.mark.usefixtures("failing_condensed")
def test_iterations_are_counted_over_both_methods():
    assert solve_qvi(random_problem(4), max_iterations=3).method == "condensed"
    seen = []
    solution = solve_qvi(random_problem(4), max_iterations=5, callback=seen.append)
    assert len(seen) == 5
    assert "max iterations" in solution.message


def test_a_start_does_not_change_the_method():
    qvi = random_problem(4)
    plain = solve_qvi(qvi)
    started = solve_qvi(qvi, initial=qvi.pressure(plain.z))
    assert (started.method, started.iterations) == ("condensed", plain.iterations)
    assert np.array_equal(started.z, plain.z)


@pytest.mark.parametrize(
    ("settings", "takes"),
    [({}, True), ({"method": None, "inner": None, "gap": 1e-12}, True), ({"method": "condensed"}, False),
     ({"method": "fixed-point"}, True), ({"inner": INNER}, True), ({"damping": 0.2}, True),
     ({"method": "uzawa"}, False), ({"rule": "printed"}, False)],
)  # fmt: skip
def test_who_takes_a_start(settings, takes):
    assert takes_initial(settings) is takes
    given = {**settings, "initial": [1.0, 1.0], "max_iterations": 1}
    with nullcontext() if takes else pytest.raises(InputError, match="initial"):
        solve_qvi(two_contacts(), **given)


@pytest.mark.usefixtures("failing_condensed")
def test_the_fall_back_begins_at_the_start():
    qvi = random_problem(4)
    exact = solve_qvi(qvi, inner=INNER, tolerance=1e-10)
    solution = solve_qvi(qvi, initial=qvi.pressure(exact.z))
    assert solution.method == "fixed-point"
    assert solution.history[0].residual < 1e-7
    assert solve_qvi(qvi).history[0].residual > 1e-3


@pytest.mark.parametrize("initial", ["high", [1.0], [np.nan, 1.0], [-1.0, 1.0], 1.0])
def test_a_bad_start_is_refused_even_if_it_is_not_needed(initial):
    with pytest.raises(InputError, match="initial"):
        solve_qvi(two_contacts(), initial=initial)


@pytest.mark.usefixtures("failing_condensed")
def test_a_fall_back_out_of_memory_leaves_the_first_state(monkeypatch):
    def full(*_):
        raise MemoryError

    monkeypatch.setattr(solvers.solve, "solve_fixed_point", full)
    solution = solve_qvi(random_problem(4))
    assert solution.status is Status.STALLED
    assert np.isfinite(solution.z).all()
    assert "out of memory" in solution.message
