"""Limits of time, and who hears how far it is; the fall-back of the condensed method; who takes a start.

Time passes when a test lets it.
"""

import math
from contextlib import nullcontext

import numpy as np
import pytest

from solvers import InputError, Status, available, certify, solve_qvi
from solvers.basics import Progress, expired, left, tell, watched
from solvers.inner import Centre, make_inner, within_time
from solvers.solve import Settings
from tests.solvers.conftest import prescribed_shear, random_problem, two_contacts, with_constant_tractions

INNER = "qp:clarabel"
LIMITED = ("qp:clarabel", "qp:osqp", "qp:qpalm", "direct:clarabel")  # these say so, too
COARSE = 0.5  # a gap that ends the condensed method after few iterations, far from the solution


@pytest.fixture
def calls(back_end, clock):
    """When the fixed point's inner solver is called, which takes ten seconds each."""
    when = []

    def slow(answer):
        when.append(clock.now)
        clock.passes(10.0)
        return answer()

    back_end(INNER, slow)
    return when


@pytest.fixture(scope="module")
def large():
    return with_constant_tractions(random_problem(1))


def test_everyone_is_told():
    outer, inner = [], []
    with watched(report=outer.append):
        with watched(1.0, inner.append):
            tell(Progress("uzawa"))
        tell(Progress("condensed"))
    tell(Progress("fixed-point"))
    assert ([said.method for said in outer], [said.method for said in inner]) == (["uzawa", "condensed"], ["uzawa"])


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


def test_a_slow_inner_solver(clock, calls):
    solution = solve_qvi(random_problem(4), inner=INNER, time_limit=25.0)
    assert solution.status is Status.TIME_LIMIT
    assert calls == [0.0, 10.0, 20.0]
    assert np.isfinite(solution.z).all()
    assert clock.now == 30.0


def test_nothing_is_asked_again_when_the_time_is_over(calls, back_end, clock):
    """Neither another back end about a claim, nor the back end that failed, nor whether the load can be carried."""
    solution = solve_qvi(prescribed_shear(), inner=INNER, initial=[0.0], time_limit=5.0)
    assert (solution.status, calls) == (Status.TIME_LIMIT, [0.0])

    def fails(_):
        calls.append(clock.now)
        clock.passes(10.0)
        raise ValueError

    back_end(INNER, fails)
    solution = solve_qvi(random_problem(4), inner=INNER, time_limit=5.0)
    assert (solution.status, calls) == (Status.TIME_LIMIT, [0.0, 10.0])


@pytest.mark.parametrize("name", [name for name in LIMITED if name in available()])
@pytest.mark.parametrize(("seconds", "status"), [(1e-9, Status.TIME_LIMIT), (60.0, Status.SOLVED)])
@pytest.mark.usefixtures("clock")
def test_back_ends_get_what_is_left(name, seconds, status):
    qvi = random_problem(1, n=200, m=80)
    solver = make_inner(name, qvi, 1e-8)
    with watched(seconds):
        found = solver.solve(qvi.threshold(np.full(qvi.m, 0.4)), Centre(qvi, np.zeros(qvi.n)), None)
    assert found.status is status


def test_a_limit_of_ones_own_stays():
    settings = {"time_limit": 2.0, "verbose": False}
    assert within_time(settings, "time_limit") == settings
    with watched(100.0):
        assert within_time(settings, "time_limit") == within_time(settings, "") == settings
    with watched(1e-9):
        assert within_time(settings, "time_limit")["time_limit"] < 0.01


def test_the_fall_back_is_announced_and_its_answer_explained(large):
    heard, seen = [], []
    with watched(report=heard.append):
        solution = solve_qvi(large, gap=COARSE, callback=seen.append)
    assert solution.solved
    assert solution.method == "fixed-point"
    first = len(seen) - len(solution.history)
    assert f"after {first} iterations" in solution.message
    begins = [said for said in heard if said.iteration is None]
    assert [said.method for said in begins if not said.remark] == ["condensed", "fixed-point"]
    assert len([said for said in begins if said.remark]) == 1
    assert [said.iteration for said in heard if said.iteration is not None] == seen
    assert tuple(seen[first:]) == solution.history


def test_small_contacts_are_pivoted_first():
    solution = solve_qvi(random_problem(1), gap=COARSE)
    assert (solution.status, solution.method) == (Status.SOLVED, "pivoting")
    names, reasons = zip(*((each.name, each.reason) for each in solution.attempts), strict=True)
    assert (names[0], names[-1]) == ("condensed", "pivoting")
    assert not reasons[0]
    assert all(reasons[1:])


def test_the_fall_back_takes_no_longer_than_its_share(large, clock, calls):
    """Fifteen seconds where the first method took none: two inner problems of ten seconds are begun."""
    solution = solve_qvi(large, gap=COARSE)
    assert calls == [0.0, 10.0]
    assert (solution.status, solution.method) == (Status.STALLED, "condensed")
    assert "15 seconds" in solution.message
    assert clock.now < 30.0


def test_the_fall_back_is_on_the_same_clock(large, calls):
    solution = solve_qvi(large, gap=COARSE, time_limit=8.0)
    assert calls == [0.0]
    assert solution.status is Status.TIME_LIMIT


def test_iterations_are_counted_over_both_methods(large):
    first = solve_qvi(large, method="condensed", gap=COARSE).iterations
    assert solve_qvi(large, gap=COARSE, max_iterations=first).method == "condensed"
    seen = []
    solution = solve_qvi(large, gap=COARSE, max_iterations=first + 2, callback=seen.append)
    assert len(seen) == first + 2
    assert "max iterations" in solution.message


def test_a_fall_back_that_fails_leaves_the_first_state(large, back_end):
    def fails(_):
        raise MemoryError

    back_end(INNER, fails)
    solution = solve_qvi(large, gap=COARSE)
    assert (solution.status, solution.method) == (Status.STALLED, "condensed")
    assert np.isfinite(solution.z).all()
    assert "fixed point, tried next" in solution.message


def test_the_fall_back_begins_at_the_start(large):
    exact = solve_qvi(large, inner=INNER, tolerance=1e-10)
    solution = solve_qvi(large, gap=COARSE, initial=large.pressure(exact.z))
    assert solution.method == "fixed-point"
    assert solution.history[0].residual < 1e-7
    assert solve_qvi(large, gap=COARSE).history[0].residual > 1e-3


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
    assert Settings.of(**settings).takes_initial is takes
    given = {**settings, "initial": [1.0, 1.0], "max_iterations": 1}
    with nullcontext() if takes else pytest.raises(InputError) as caught:
        solve_qvi(two_contacts(), **given)
    assert takes or caught.value.field == "initial"
