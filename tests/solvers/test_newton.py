"""The equations inside the condensed method: slacks, Newton matrices and steps, on the contact and in all unknowns."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, eye_array

from solvers import FrictionQVI
from solvers.condensed import (
    Complementarity,
    DenseCoordinates,
    DenseSystem,
    InteriorPoint,
    Newton,
    PathWeights,
    Point,
    SparseCoordinates,
)
from tests.solvers.conftest import LAWS, chain, mixed_problem, random_problem, two_contacts


@pytest.mark.parametrize("seed", range(6))
def test_dense_systems_know_the_sign_of_the_determinant(seed):
    matrix = np.random.default_rng(seed).normal(size=(7, 7))
    system = DenseSystem(matrix)
    without_bounds = SimpleNamespace(stiffness=lambda D, e: 0.0 * D @ e)
    solution = system.factorised(without_bounds, np.ones(0), np.ones(0))(matrix[:, 0])
    assert solution == pytest.approx(np.eye(7)[0], abs=1e-9)
    assert system.orientation == np.linalg.slogdet(matrix)[0]


def posed(qvi):
    """The complementarity problem about z = 0, with an interior point in general position."""
    reduction = DenseCoordinates(qvi)
    problem = Complementarity(qvi, reduction, reduction.base(np.zeros(qvi.n)), 1.0)
    method = InteriorPoint(problem, 0.7)
    random = np.random.default_rng(3)
    y = 0.5 * random.normal(size=len(method.point.y))
    s, lam = (random.uniform(0.1, 2.0, len(method.point.s)) for _ in range(2))
    method.point = Point.of(y, s, lam, *random.uniform(0.1, 2.0, (2, len(problem.split))))
    return problem, method


PROBLEMS = {
    "dense": lambda: random_problem(3, 0.4),
    "laws": lambda: mixed_problem(1, 2),
    "line": lambda: chain(1, **LAWS["cap"]),
    "bilateral": lambda: chain(1, **LAWS["bilateral"]),
    "equations": lambda: chain(1, **LAWS["equations"]),
    "frictionless": lambda: chain(1, mu=0.0),
}
POSED = pytest.mark.parametrize("name", PROBLEMS)


@POSED
def test_the_change_of_slacks_is_minus_their_derivative(name):
    """Along √(σ_N² + δ²), on which pull push = δ²/4 stays as it is."""
    problem, method = posed(PROBLEMS[name]())
    y, smooth = method.point.y, 0.3

    def slack(u):
        return problem.slack(u, np.hypot(problem.split_normal(u), smooth))

    normal = problem.split_normal(y)
    slope = normal / np.hypot(normal, smooth)
    for direction in np.random.default_rng(4).normal(size=(3, len(y))):
        h = 1e-6
        change = (slack(y + h * direction) - slack(y - h * direction)) / (2 * h)
        assert problem.change(direction, slope) == pytest.approx(-change, abs=1e-8 * np.abs(change).max())


@POSED
def test_newton_directions_satisfy_the_linearised_equations(name):
    problem, method = posed(PROBLEMS[name]())
    point, residuals = method.point, method.residuals()
    comp = np.random.default_rng(5).normal(size=len(point.products))
    newton = Newton(problem, point, residuals)
    for only in (False, True):
        step = newton.step(comp, only=only)
        force, slack, split, _ = (0.0 * r for r in residuals) if only else residuals
        size = np.abs(problem.force(np.abs(step.lam))).max(initial=1.0)
        assert problem.S @ step.y + problem.force(step.lam) == pytest.approx(-force, abs=1e-10 * size)
        change = problem.change(step.y, np.zeros(len(problem.split)))
        pressed = problem.friction_of(step.tension + step.pressure)
        assert step.s + change - pressed == pytest.approx(-slack, abs=1e-10)
        assert problem.split_rows @ step.y - step.tension + step.pressure == pytest.approx(-split, abs=1e-10)
        first = (point.s * step.lam + point.lam * step.s, point.tension * step.pressure + point.pressure * step.tension)
        assert np.concatenate(first) == pytest.approx(comp, abs=1e-10)


@pytest.mark.parametrize("name", ["dense", "line", "equations", "frictionless"])
def test_stiff_bounds_have_the_step_that_was_chosen(name):
    """Rows that depend on each other, forces that are small differences of large multipliers, soft bounds beside."""
    problem, method = posed(PROBLEMS[name]())
    point, random, residuals = method.point, np.random.default_rng(6), method.residuals()
    y, dlam, slacks = random.normal(size=len(point.y)), random.normal(size=len(point.s)), point.s.copy()
    for s, lam, every, limit in ((1e-9, 1.0, 1, 1e-8), (1e-10, 1e6, 1, 1e-13), (1e-11, 1.0, 3, 1e-13)):
        point.s[:], point.lam[:] = slacks, lam
        point.s[::every] *= s
        ds = 0.5 * point.s * dlam
        force, slack = -problem.S @ y - problem.force(dlam), -ds - problem.change(y, residuals.split)
        newton = Newton(problem, point, residuals._replace(force=force, slack=slack))
        step = newton.step(point.s * dlam + point.lam * ds)
        left = np.abs(problem.S @ step.y + problem.force(step.lam) + force)
        assert left.max() <= limit * np.abs(force).max()
        assert np.abs(step.s + problem.change(step.y, residuals.split) + slack).max() <= max(1e-5 * s, 1e-14)


def test_rounding_of_the_work_does_not_overflow_as_its_cube(monkeypatch):
    _, method = posed(PROBLEMS["dense"]())
    monkeypatch.setattr(method, "_work", lambda point, now=method.point: 1e-150 if point is now else 1.0)
    assert 0.0 < method.iterate(method.residuals()) <= 1.0


@pytest.mark.parametrize(("error", "solves"), [(0.0, 1), (1e-5, 3)])
def test_newton_steps_are_refined_where_their_solution_is_inaccurate(error, solves):
    problem, method = posed(PROBLEMS["line"]())
    residuals = method.residuals()
    newton, made = Newton(problem, method.point, residuals), []
    solve = newton.solve

    def inaccurate(force):
        made.append(force)
        return (1.0 + error) * solve(force)

    newton.solve = inaccurate
    step = newton.step(-method.point.products)
    left = problem.S @ step.y + problem.force(step.lam) + residuals.force
    assert len(made) == solves
    assert np.abs(left).max() < 1e-8 * np.abs(problem.force(step.lam)).max()


def posed_whole(qvi, *path):
    whole = SparseCoordinates(qvi)
    return whole, Complementarity(qvi, whole, whole.base(np.zeros(qvi.n)), 1.0, *path)


@pytest.mark.parametrize(("share", "length", "kept"), [(0.05, 0.99, 0.3), (0.0, 0.0495, 1.0 - 20.0 * 0.0495)])
def test_few_bounds_do_not_hold_up_the_others(share, length, kept):
    """Every bound falls by its size in a step of one; one of them by twenty times that."""
    _, problem = posed_whole(chain(1))
    interior = InteriorPoint(problem, 1.0)
    problem.system.stragglers = share
    interior.settle()
    before = interior.point
    fall = before.s.copy()
    fall[0] *= 20.0
    step = Point.of(np.ones_like(before.y), -fall, 0.0 * before.lam, 0.0 * before.tension, 0.0 * before.pressure)
    found = interior.past_few(step, 0.0495)
    assert found == pytest.approx(length)
    assert interior.point.s[0] == pytest.approx(kept * before.s[0])
    assert interior.point.y == pytest.approx(before.y + length)


@pytest.mark.parametrize(("growth", "expected"), [(1.0, 0.99), (1e4, 0.99 / 16.0)])
def test_passing_few_bounds_does_not_open_the_gap(growth, expected):
    """One slack falls below zero, and its multiplier grows; the step is halved until τ has not doubled."""
    _, problem = posed_whole(chain(1))
    interior = InteriorPoint(problem, 1.0)
    interior.settle()
    problem.system.stragglers = 0.05
    point, before = interior.point, interior.parameter()
    s, lam = -point.s, 0.0 * point.lam
    s[0] *= 200.0
    lam[0] = growth * point.lam[0]
    found = interior.past_few(Point.of(0.0 * point.y, s, lam, 0.0 * point.tension, 0.0 * point.pressure), 0.00495)
    assert found == pytest.approx(expected)
    assert interior.parameter() <= 2.0 * before


@pytest.mark.parametrize(("share", "misfit", "expected"), [(0.05, 1e-6, 30.0), (0.05, 1e-12, 1.0), (0.0, 1e-6, 1.0)])
def test_the_parameter_waits_for_bounds_that_were_passed(share, misfit, expected):
    """Nothing is passed any more where it is least; times that value, or what it is if that is less."""
    _, problem = posed_whole(chain(1))
    interior = InteriorPoint(problem, 1.0)
    problem.system.stragglers = share
    interior.settle()
    residuals = interior.residuals()
    slack = 0.0 * residuals.slack + misfit * problem.stress_at(interior.point.y)
    residuals = residuals._replace(slack=slack)
    interior.measures(residuals)
    for tau, lowest in ((1e3, expected), (1.0, 1.0)):
        assert interior.lowest(residuals, tau * interior.least) / interior.least == pytest.approx(lowest)


@pytest.mark.parametrize("law", ["coulomb", "cap", "bilateral"])
def test_friction_has_another_share_once_slacks_fit(law):
    """Products start on the path of the early one; what kinks aim at stays."""
    _, problem = posed_whole(chain(1, **LAWS[law]), PathWeights(2.0, 50.0))
    interior = InteriorPoint(problem, 1.0)
    count, early, before = len(problem.omega), interior.omega.copy(), interior.parameter()
    assert set(early[:count]) == ({1.0, 2.0} if law != "bilateral" else {2.0})
    assert problem.weights @ (interior.point.s * interior.point.lam - before * early[:count]) == pytest.approx(0.0)
    for _ in range(2):
        interior.settle()
        after = interior.parameter()
        assert interior.omega[:count] == pytest.approx(np.where(early[:count] == 2.0, 50.0, 1.0))
        assert after * interior.omega[count:] == pytest.approx(before * early[count:])


def row_of_points(m):
    """Points that feel their neighbours alone: the contact is all there is."""
    K = diags_array([np.full(2 * m - 1, 0.3), np.ones(2 * m), np.full(2 * m - 1, 0.3)], offsets=[-1, 0, 1])
    rows, zeros = eye_array(2 * m).tocsr(), np.zeros(m)
    f = np.random.default_rng(0).normal(size=2 * m)
    return FrictionQVI.from_arrays(
        K=csc_array(K), f=f, N=-rows[::2], n0=zeros, T=rows[1::2], t0=zeros, mu=zeros + 0.3, W=zeros + 1.0 / m
    )


def test_each_contact_is_a_whole_of_its_own():
    """One point each of two bodies, with three bounds; a chain of equal points."""
    line = chain(1)
    for qvi, share in ((two_contacts(), 1.0 / 3.0), (line, 1.0 / (3.0 * line.m))):
        assert posed_whole(qvi)[1].least_share == pytest.approx(share)


def test_large_problems_start_near_the_bonded_solution():
    """Multipliers are a fiftieth; the other start comes next."""
    many = row_of_points(12_001)
    with many.stiffness.using("multifrontal", 1):
        large, small = SparseCoordinates(many).paths, SparseCoordinates(chain(0)).paths
    assert (large[0], large[1:]) == (small[-1], small[:-1])
    near, usual = (InteriorPoint(posed_whole(chain(0), path)[1], 1.0).point.lam for path in large[:2])
    assert near == pytest.approx(0.02 * usual)


@pytest.mark.parametrize("qvi", [chain(2), row_of_points(300)], ids=["body", "contact"])
def test_norms_and_stiffness_are_those_of_dense_algebra(qvi):
    """Also where the contact is so large a share of a body that its unknowns are eliminated like all others."""
    with qvi.stiffness.using("multifrontal", 1):
        whole, problem = posed_whole(qvi)
    random = np.random.default_rng(0)
    force = problem.force(random.normal(size=len(problem.weights)))
    K, rows = qvi.K.toarray(), qvi.contact_rows.toarray()
    f = force[: qvi.n] * np.sqrt(qvi.K.diagonal())
    assert whole.norm(force) == pytest.approx(np.sqrt(f @ np.linalg.solve(K, f)), rel=1e-10)
    m = random.normal(size=2 * qvi.m)
    assert qvi.linear_system.interface.size == (0 if qvi.m == 300 else qvi.condensed_contact.system.interface.size)
    relief = qvi.linear_system.relief(qvi.contact_rows)(m)
    compliance = rows @ np.linalg.solve(K, rows.T)
    assert relief == pytest.approx(compliance @ m, rel=1e-9)
    assert qvi.condensed_contact.system.interface.size > 0  # made anew where what the contact feels is asked for
