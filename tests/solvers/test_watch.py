"""Limits of time, and who hears how far it is; the fall-back of the condensed method; who takes a start.

Time passes when a test lets it.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array

from qvi_contact import Contact, ContactProblem, Displacement, Material, Symmetry, Traction, TriangleMesh
from qvi_contact.discretization import discretize
from qvi_contact.gallery import compressed_plate
from solvers import Status, available, certify, solve_qvi
from solvers.basics import Progress, deadline, listening, report
from solvers.factorisation import FactorisationError, factorise
from solvers.inner import Centre, make_inner, within_time
from solvers.pivoting import solve_lcp
from solvers.solution import Attempt, Outcome, Start
from solvers.solve import ATTEMPTS, Way, followed_solutions
from tests.cases import examples, refused_at
from tests.solvers.conftest import LAWS, chain, one_contact, random_problem, with_constant_tractions

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


@pytest.fixture
def large(monkeypatch):
    monkeypatch.setattr("solvers.solve.ATTEMPTS", [way for way in ATTEMPTS if way.method != "pivoting"])
    return with_constant_tractions(random_problem(1))


def test_everyone_is_told():
    outer, inner = [], []
    with listening(outer.append):
        with deadline(1.0), listening(inner.append):
            report(Progress("uzawa"))
        report(Progress("condensed"))
    report(Progress("fixed-point"))
    assert ([said.method for said in outer], [said.method for said in inner]) == (["uzawa", "condensed"], ["uzawa"])


def test_large_factorisations_are_told_and_not_begun_when_the_time_is_over(clock):
    heard, none = [], np.zeros(0, dtype=np.int64)
    K = csc_array(diags_array([-1.0, 2.1, -1.0], offsets=[-1, 0, 1], shape=(100_000, 100_000)))
    with deadline(1.0), listening(heard.append):
        factorise(K, none, "multifrontal")
        factorise(K[:1000][:, :1000], none, "multifrontal")
        clock.passes(2.0)
        factorise(K[:1000][:, :1000], none, "multifrontal")
        with pytest.raises(FactorisationError) as caught:
            factorise(K, none, "multifrontal")
    assert caught.value.reason == "time"
    assert [each.stage for each in heard] == ["factorising 100000 unknowns"]


def test_the_earlier_end_counts(clock):
    assert (deadline.left, deadline.over) == (math.inf, False)
    with deadline(5.0):
        with deadline(8.0):
            assert deadline.left == 5.0
        with deadline(2.0):
            assert deadline.left == 2.0
            clock.passes(2.0)
            assert deadline.over
            assert 0.0 < deadline.left < 0.01  # some back ends take 0 for no limit
        assert (deadline.left, deadline.over) == (3.0, False)
        with deadline():
            assert deadline.left == 3.0
    assert not deadline.over


@pytest.mark.parametrize(
    "options",
    [{"method": "condensed"}, {"method": "uzawa"}, {"inner": INNER, "variant": "plain"}],
    ids=["condensed", "uzawa", "fixed-point"],
)
def test_every_method_keeps_to_it(clock, options):
    """A second an iteration: four are begun in three and a half; the state is certified as it is, and finite."""
    qvi = random_problem(4)
    seen = []

    def callback(entry):
        seen.append(entry)
        clock.passes(1.0)

    solution = solve_qvi(qvi, time_limit=3.5, callback=callback, **options)
    assert (solution.status, solution.iterations, len(seen)) == (Status.TIME_LIMIT, 4, 4)
    assert np.isfinite(solution.z).all()
    rows = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    certificate = certify(qvi, solution.z, *rows)
    assert solution.certificate.accuracy == pytest.approx(certificate.accuracy)
    assert 1e-8 < certificate.accuracy < math.inf
    longer = solve_qvi(qvi, time_limit=300.0, callback=callback, max_iterations=10, **options)
    assert longer.status is not Status.TIME_LIMIT
    assert longer.iterations > 4


def test_nothing_is_asked_again_when_the_time_is_over(back_end, clock):
    """Neither whether a claim is true, nor the back end that failed, nor whether the load can be carried."""
    calls, claim = [], SimpleNamespace(extras={"status": "PrimalInfeasible"}, x=None, z=None)

    def answers(_):
        calls.append(clock.now)
        clock.passes(10.0)
        return claim if len(calls) == 1 else None

    back_end(INNER, answers)
    back_end("direct:clarabel", answers)
    for asked in ([0.0], [0.0, 10.0]):
        solution = solve_qvi(random_problem(4), inner=INNER, time_limit=5.0)
        assert (solution.status, calls) == (Status.TIME_LIMIT, asked)


@pytest.mark.parametrize("name", [name for name in LIMITED if name in available()])
@pytest.mark.parametrize(("seconds", "status"), [(1e-9, Status.TIME_LIMIT), (60.0, Status.SOLVED)])
@pytest.mark.usefixtures("clock")
def test_back_ends_get_what_is_left(name, seconds, status):
    qvi = random_problem(1, n=200, m=80)
    solver = make_inner(name, qvi, 1e-8)
    with deadline(seconds):
        found = solver.solve(qvi.threshold(np.full(qvi.m, 0.4)), Centre(qvi, np.zeros(qvi.n)), None)
    assert found.status is status


def test_a_limit_of_ones_own_stays():
    settings = {"time_limit": 2.0, "verbose": False}
    assert within_time(settings, "time_limit") == settings
    with deadline(100.0):
        assert within_time(settings, "time_limit") == within_time(settings, "") == settings
    with deadline(1e-9):
        assert within_time(settings, "time_limit")["time_limit"] < 0.01


def test_the_fall_back_is_announced_and_its_answer_explained(large):
    heard, seen = [], []
    with listening(heard.append):
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


@pytest.mark.parametrize("more", [0, 193])  # with these it is not the first method
def test_contacts_are_pivoted_before_the_fixed_point(more):
    solution = solve_qvi(with_constant_tractions(random_problem(1), more), gap=COARSE)
    assert (solution.status, solution.method) == (Status.SOLVED, "pivoting")
    names, reasons = zip(*((each.name, each.reason) for each in solution.attempts), strict=True)
    assert (names[0], names[-1]) == ("condensed", "pivoting")
    assert not reasons[0]
    assert all(reasons[1:])


def test_the_fall_back_takes_no_longer_than_its_share_and_is_on_the_same_clock(large, clock, calls, monkeypatch):
    """Fifteen seconds where the first method took none: two inner problems of ten seconds are begun, one in eight."""
    solution = solve_qvi(large, gap=COARSE)
    assert calls == [0.0, 10.0]
    assert (solution.status, solution.method) == (Status.STALLED, "condensed")
    assert "15 seconds: method='fixed-point' gives it more time" in solution.message
    assert clock.now < 30.0
    ways = [way._replace(most=math.inf) for way in ATTEMPTS if way.method != "pivoting"]  # Uzawa comes after them
    monkeypatch.setattr("solvers.solve.ATTEMPTS", ways)
    last = solve_qvi(large, method="condensed", gap=COARSE).iterations
    for seconds, tried in ((0.0, {"condensed", "fixed-point"}), (9.0, {"condensed"})):
        callback = lambda entry, pause=seconds: clock.passes(pause if entry.number == last else 0.0)  # noqa: E731
        found = solve_qvi(large, gap=COARSE, time_limit=8.0, callback=callback)
        assert found.status is Status.TIME_LIMIT
        assert {each.name.partition(",")[0] for each in found.attempts} == tried


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


BAD, OVER, DONE, NONE = Status.STALLED, Status.TIME_LIMIT, Status.SOLVED, Status.ILL_CONDITIONED


@pytest.mark.parametrize(
    ("ends", "best", "status"),
    [(((BAD, 1e-5), (BAD, 1e-2)), 0, Status.INACCURATE), (((BAD, 1e-2), (BAD, 1e-5)), 1, Status.INACCURATE),
     (((BAD, 1e-2), (OVER, 0.1)), 0, OVER), (((BAD, 1e-5), (OVER, 1e-2)), 0, OVER),
     (((DONE, 1e-5), (OVER, 1e-2)), 0, Status.INACCURATE), (((NONE, 1e-5), (BAD, 1e-2)), 1, BAD),
     (((BAD, 1e-5), (DONE, 0.0), (BAD, 0.0)), 1, DONE)],
)  # fmt: skip
def test_the_best_of_several_attempts_is_kept_and_all_iterations_count(monkeypatch, ends, best, status):
    """Whatever comes first; time that is over is the status, but of a way that had come to its own end."""
    qvi = random_problem(4)
    exact, done = solve_qvi(qvi), []

    def tries(_):
        for count, (reason, off) in enumerate(ends, 1):
            done.append(reason)
            multipliers = exact.normal_multiplier, exact.tangential_multiplier, exact.equality_multiplier
            yield Attempt("", "", reason, 1), Outcome(reason, (1 + off) * exact.z, *multipliers, iterations=count)

    monkeypatch.setattr("solvers.solve.ATTEMPTS", (Way("condensed", (tries,)),))
    found = solve_qvi(qvi, "condensed")
    assert found.z == pytest.approx((1.0 + ends[best][1]) * exact.z, rel=1e-9)
    assert (found.status, found.iterations, len(done)) == (status, len(ends[:2]), len(ends[:2]))


def test_a_start_does_not_change_the_method_and_states_of_other_sizes_are_refused():
    qvi = random_problem(4)
    plain, other = solve_qvi(qvi), solve_qvi(random_problem(4, n=13))
    started = solve_qvi(qvi, initial=qvi.pressure(plain.z))
    assert (started.method, started.iterations) == (plain.method, plain.iterations)
    assert np.array_equal(started.z, plain.z)
    assert solve_qvi(qvi, "fixed-point", initial=plain).iterations == 1 < solve_qvi(qvi, "fixed-point").iterations
    for settings in ({"method": "condensed"}, {"method": "uzawa"}, {"rule": "printed"}):
        for start in (np.ones(qvi.m), Start(np.full(qvi.n, np.nan), np.zeros(2 * qvi.m)), other):
            with refused_at("initial"):
                solve_qvi(qvi, **settings, initial=start)


# Other ways to an answer: from that of a problem before, and by pivoting; other solutions.


def slipping(offset, law="unilateral", cap=None):
    """A block pressed by a rough plate that moves sideways: parts slip, parts stick."""
    mesh = TriangleMesh.rectangle((8, 4), 2.0, 1.0)
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    plate = Contact("top", 0.3, -0.01, offset, "plate", law=law, shear_limit=cap)
    return ContactProblem(mesh, Material(1e3, 0.3), [plate, Displacement("bottom", x=0.0, y=0.0), *free])


SEQUENCES = {
    "slip grows": [slipping(w) for w in (0.004, 0.0044)],
    "slip turns back": [slipping(w) for w in (0.009, 0.0085)],
    "bilateral": [slipping(w, "bilateral") for w in (0.004, 0.0044)],
    "capped": [slipping(w, cap=2.0) for w in (0.004, 0.0044)],
    "friction": [compressed_plate(mu, (8, 8)) for mu in (0.2, 0.22)],
}


@pytest.mark.parametrize("method", ["condensed", None])
@pytest.mark.parametrize("problems", SEQUENCES.values(), ids=SEQUENCES)
def test_a_neighbour_saves_iterations_and_changes_no_answer(problems, method):
    before, now = (discretize(problem) for problem in problems)
    cold = solve_qvi(now.qvi, method)
    warm = solve_qvi(now.qvi, method, initial=solve_qvi(before.qvi))
    assert warm.near
    assert warm.status is cold.status is Status.SOLVED
    cost, before = (each.iterations if method else each.history[0].inner_iterations for each in (warm, cold))
    assert cost <= 0.8 * before
    assert warm.problem.resultant(warm.z) == pytest.approx(cold.problem.resultant(cold.z), rel=1e-9)
    size = np.abs(cold.problem.normal(cold.z)).max()
    assert warm.problem.normal(warm.z) == pytest.approx(cold.problem.normal(cold.z), abs=1e-5 * size)


@pytest.mark.parametrize("method", ["condensed", None])
def test_a_misleading_state_is_left(method):
    """Random states: the answer is that of the usual start."""
    qvi = random_problem(4)
    plain = solve_qvi(qvi, method)
    rng = np.random.default_rng(0)
    for size in (1.0, 1e6):
        state = Start(*(size * rng.normal(size=k) for k in (qvi.n, 2 * qvi.m)))
        found = solve_qvi(qvi, method, initial=state)
        assert (found.solved, found.method) == (True, plain.method)
        assert found.z == pytest.approx(plain.z, abs=1e-6)
        assert found.iterations <= plain.iterations + 2 or method is None


class TestComplementarity:
    """The problem alone."""

    @pytest.mark.parametrize("seed", range(examples(10)))
    def test_of_a_positive_semidefinite_matrix_of_low_rank_is_solved(self, seed):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 30))
        root = rng.normal(size=(n, max(1, n // 2)))
        M = root @ root.T
        x0, w0 = rng.random(n) * (rng.random(n) < 0.5), rng.random(n)
        q = w0 * (x0 == 0.0) - M @ x0  # so that there is a solution
        found = solve_lcp(M, q, np.ones(n))
        w = q + M @ found.x
        assert max(-found.x.min(), -w.min(), abs(found.x @ w)) < 1e-9

    def test_without_another_solution_ends_in_a_ray(self):
        assert solve_lcp(np.array([[0.0, 1.0], [-1.0, 0.0]]), -np.ones(2), np.ones(2)).reason is Status.STALLED
        away = solve_lcp(np.diag([-1.0, 0.0]), np.array([1.0, 0.0]), np.array([-1.0, -1e-17]), away=True)
        assert away.x.tolist() == [1.0, 0.0]  # the second slack is zero on the whole path, and changes by rounding

    @pytest.mark.parametrize("seed", range(examples(10)))
    def test_from_any_rows_that_miss_nothing_is_the_same(self, seed):
        """Of a positive definite matrix there is one solution."""
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 20))
        root, q = rng.normal(size=(n, n)), rng.normal(size=n)
        M = root @ root.T + np.eye(n)
        plain = solve_lcp(M, q, np.ones(n))
        for active in (rng.random(n) < 0.5, np.ones(n, dtype=bool), plain.basic):
            found = solve_lcp(M, q, np.ones(n), active)
            assert found.reason is Status.SOLVED
            assert found.x == pytest.approx(plain.x, abs=1e-9)
        assert (found.pivots, *found.basic) == (0, *plain.basic)


class TestContact:
    """Whole inequalities."""

    def test_bilateral_points_that_pull_and_slip(self):
        mesh = TriangleMesh.grid(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
        bend = Traction("top", 0.3, lambda x, _: 1.0 - x)
        conditions = [Contact("bottom", 0.05, law="bilateral", cohesion=0.02), bend, Traction("left", 0.0, 0.0)]
        qvi = discretize(ContactProblem(mesh, Material(1e3, 0.3), [*conditions, Symmetry("right")])).qvi
        found = solve_qvi(qvi, method="pivoting")
        normal, shear = qvi.normal(found.z), np.abs(qvi.tangential(found.z))
        assert found.solved
        assert normal.min() < -0.1
        assert normal.max() > 0.1
        assert (np.abs(shear - qvi.threshold(np.abs(normal))) < 1e-9).any()

    @pytest.mark.parametrize("law", sorted(LAWS.keys() - {"bilateral"}))
    def test_lines_of_contact_as_by_the_condensed_method(self, law):
        qvi = chain(0, **LAWS[law])
        found, other = solve_qvi(qvi, method="pivoting"), solve_qvi(qvi, method="condensed")
        assert found.status is other.status is Status.SOLVED
        assert found.certificate.accuracy < 1e-11
        assert found.z == pytest.approx(other.z, abs=1e-6 * np.abs(other.z).max())


def test_all_three_solutions_of_a_contact_are_found_when_asked_for():
    """By hand: stick, (p, t) = −K⁻¹(1, 2.1); slip, t = −2p; open, p = t = 0."""
    solutions = followed_solutions(solve_qvi(one_contact(2, (1.0, 2.1))))
    found = sorted(each.problem.tractions(each.z).tolist() for each in solutions)
    assert np.array(found) == pytest.approx(np.array([[-17 / 9, -65 / 18], [-5 / 3, -10 / 3], [0, 0]]), abs=1e-9)
    assert all(certify(s.problem, s.z, s.normal_multiplier, s.tangential_multiplier).passed for s in solutions)
