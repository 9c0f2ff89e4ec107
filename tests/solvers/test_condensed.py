"""The condensed method on algebraic problems: what it solves, how accurately, and the equations inside it."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.linalg import LinAlgError
from scipy.sparse import csc_array, eye_array, random_array

from solvers import FrictionQVI, Status, solve_qvi
from solvers.condensed.complementarity import Complementarity
from solvers.condensed.interior_point import InteriorPoint, Newton
from solvers.condensed.reduction import Reduction
from solvers.condensed.systems import FRICTION_SHARES, DenseSystem
from solvers.inequality.traces import Traces
from tests.covering import every_pair
from tests.effort import thinned
from tests.solvers.conftest import dragged_block, one_contact, random_problem, two_contacts
from tests.solvers.test_laws import mixed_problem, violations

EDGES = 5
GAUSS = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0
LAWS = {
    "coulomb": {"mu": 0.3},
    "opening": {"mu": 0.4, "pull": 1.5},
    "frictionless": {"mu": 0.0, "pull": 0.5},
    "tresca": {"mu": 0.0, "cohesion": 0.2},
    "cohesion": {"mu": 0.2, "cohesion": 0.15, "pull": 0.8},
    "cap": {"mu": 0.5, "cohesion": 0.02, "cap": 0.25},
    "bilateral": {"mu": 0.25, "bilateral": True, "pull": 1.0},
    "equations": {"mu": 0.3, "equalities": 3},
}


def chain(seed, mu=0.3, cohesion=0.0, cap=np.inf, bilateral=False, pull=0.0, equalities=0):
    """A contact line: σ_N linear on each edge, σ_T continuous and quadratic, four points an edge, dependent rows.

    `pull` lowers the pressure towards one end, where it becomes tension if nothing opens.
    """
    random = np.random.default_rng(seed)
    t, points = GAUSS, 4 * EDGES
    E = np.zeros((2 * points, 4 * EDGES + 1))
    for e in range(EDGES):
        rows = slice(4 * e, 4 * e + 4)
        E[rows, [2 * e, 2 * e + 1]] = np.column_stack([1 - t, t])
        quadratic = np.column_stack([(1 - t) * (1 - 2 * t), 4 * t * (1 - t), t * (2 * t - 1)])
        E[points + 4 * e : points + 4 * e + 4, 2 * EDGES + 2 * e : 2 * EDGES + 2 * e + 3] = quadratic
    r = E.shape[1]
    n = 3 * r
    Y = (random_array((r, n), density=0.05, rng=random) + eye_array(n).tocsr()[:r]).toarray()
    root = random_array((n, n), density=0.1, rng=random).toarray() + 2.0 * np.eye(n)
    start = np.concatenate([np.linspace(-1.0, pull - 1.0, 2 * EDGES), 0.1 * random.normal(size=2 * EDGES + 1)])
    rows, shift = E @ Y, E @ start
    A = random.normal(size=(equalities, n)) if equalities else None
    return FrictionQVI(
        K=root.T @ root, f=0.6 * random.normal(size=n), N=rows[:points], n0=shift[:points], T=rows[points:],
        t0=shift[points:], mu=np.full(points, mu), W=np.full(points, 1.0 / points), A=A,
        b=0.1 * random.normal(size=equalities) if equalities else None, cohesion=np.full(points, cohesion),
        cap=np.full(points, cap), bilateral=np.full(points, bilateral),
    )  # fmt: skip


def difference(qvi, one, other):
    """Largest difference of tractions, relative to the largest traction."""
    first, second = (np.concatenate([qvi.normal(s.z), qvi.tangential(s.z)]) for s in (one, other))
    return np.abs(first - second).max() / np.abs(second).max()


def condensed(qvi, **options):
    solution = solve_qvi(qvi, method="condensed", **options)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.method == solution.form == "condensed"
    return solution


@pytest.mark.parametrize(
    ("law", "seed", "inner"), thinned(every_pair(list(LAWS), range(4), ["direct:clarabel", "qp:daqp"]), 16)
)
def test_lines_of_contact_agree_with_the_fixed_point(law, seed, inner):
    qvi = chain(seed, **LAWS[law])
    found = condensed(qvi)
    reference = solve_qvi(qvi, inner=inner, tolerance=1e-9)
    assert reference.solved
    assert found.iterations <= (50 if law != "bilateral" else 100)  # one of them turns on its path
    assert difference(qvi, found, reference) < 1e-7
    for name, values in violations(qvi, found).items():
        assert values.max(initial=0.0) < 1e-8, name


def test_the_lines_show_every_state():
    seen = set()
    for law, data in LAWS.items():
        for seed in range(4):
            qvi = chain(seed, **data)
            found = condensed(qvi)
            slips = np.abs(found.tangential_multiplier) > 1e-6
            states = {
                "open": found.normal_multiplier > 1e-6,
                "slip": slips & (qvi.mu > 0.0),
                "stick": ~slips & (qvi.pressure(found.z) > 1e-3) & (qvi.mu > 0.0),
                "pulled": qvi.bilateral & (qvi.normal(found.z) > 1e-3),
                "capped": slips & (qvi.cap < qvi.cohesion + qvi.mu * qvi.pressure(found.z)),
            }
            seen |= {name for name, where in states.items() if where.any()}
            assert law != "opening" or "open" in seen
    assert seen == {"open", "slip", "stick", "pulled", "capped"}


@pytest.mark.parametrize(
    ("seed", "friction", "equalities"), thinned(product((0, 1, 7, 11, 20), (0.0, 0.05, 0.2), (0, 2)), 12)
)
def test_dense_rows_that_cancel(seed, friction, equalities):
    """More rows than unknowns, all of them dense: nearly every unknown is held by active bounds."""
    qvi = random_problem(seed, friction, equalities)
    reference = solve_qvi(qvi, inner="direct:clarabel", tolerance=1e-9)
    assert reference.solved
    assert difference(qvi, condensed(qvi), reference) < 1e-7


@pytest.mark.parametrize(("seed", "equalities"), [(0, 0), (0, 1), (2, 2), (7, 0), (11, 3), (22, 1), (33, 0)])
def test_dense_rows_with_every_law(seed, equalities):
    qvi = mixed_problem(seed, equalities)
    reference = solve_qvi(qvi, inner="direct:clarabel", tolerance=1e-9)
    assert reference.solved
    assert difference(qvi, condensed(qvi), reference) < 1e-7


@pytest.mark.parametrize("seed", range(3))
def test_the_default_solves_them_by_whatever_it_takes(seed):
    for qvi in (random_problem(seed, 0.05), random_problem(seed, 0.3, 2), mixed_problem(seed)):
        solution = solve_qvi(qvi)
        assert solution.status is Status.SOLVED, solution.message


def test_two_contacts_by_hand():
    solution = condensed(two_contacts())
    assert solution.z == pytest.approx([2.0, 0.4, 1.0, -0.3], abs=1e-9)
    assert solution.tangential_multiplier == pytest.approx([0.0, -1.7], abs=1e-9)


def test_not_unique_returns_one_of_the_three(nonunique):
    solution = condensed(nonunique)
    known = [(0.0, 0.0), (1.8888888888888889, -3.6111111111111111), (5.0 / 3.0, -10.0 / 3.0)]
    assert min(np.abs(solution.z - point).max() for point in known) < 1e-8
    assert "unique" not in solution.message


@pytest.mark.parametrize("load", [(1.0, 2.1), (1.0, 3.0), (0.5, -2.0), (-1.0, -2.0), (-1.0, 0.3)])
@pytest.mark.parametrize("friction", [0.0, 0.5, 1.0, 2.0, 5.0])
def test_one_contact_always_has_a_certified_answer(friction, load):
    """|coupling| < 1 and mu of any size: a solution exists, since a stuck, slipping or open one always does."""
    condensed(one_contact(friction, load))


@pytest.mark.parametrize("method", [None, "condensed"])
@pytest.mark.parametrize("factor", [1.0001, 1.01, 3.0])
def test_dragged_beyond_friction_is_infeasible(method, factor):
    solution = solve_qvi(dragged_block(0.3 * factor), method=method)
    assert solution.status is Status.INFEASIBLE, solution.message
    assert "cannot be carried" in solution.message
    assert solution.farkas is not None
    assert np.isnan(solution.z).all()


@pytest.mark.parametrize("factor", [1.0 + 1e-5, 1.0 + 1e-7])
def test_slightly_beyond_the_limit_is_not_solved(factor):
    assert not solve_qvi(dragged_block(0.3 * factor), tolerance=1e-10).solved


@pytest.mark.parametrize("factor", [1.0 - 1e-6, 0.99, -0.99, 0.0])
def test_dragged_within_friction_is_carried(factor):
    assert condensed(dragged_block(0.3 * factor)).z == pytest.approx([1.0, 0.3 * factor], abs=1e-9)


def test_bounds_of_zero_that_contradict_the_equations():
    """No friction, but an equation that wants shear."""
    solution = solve_qvi(dragged_block(0.1, friction=0.0), method="condensed")
    assert solution.status is Status.INFEASIBLE, solution.message


class Root:
    """R z + r₀ with dense R, as an `EnergyRoot`."""

    def __init__(self, R, r0):
        self.R, self.r0 = R, r0

    def apply(self, z):
        return self.R @ z + self.r0

    def adjoint(self, r):
        return self.R.T @ r

    def matrix(self):
        return csc_array(self.R), np.zeros((len(self.R), 1))

    def rounding(self, z):
        return float(np.finfo(float).eps * (np.abs(self.R) @ np.abs(z)).max())


def rooted(seed, spoilt, **law):
    """A line of contact with a root; K and f wrong by the relative size `spoilt`, root and load exact."""
    qvi = chain(seed, **law)
    random = np.random.default_rng(1000 + seed)
    R = np.linalg.cholesky(qvi.K.toarray()).T
    r0 = 0.1 * random.normal(size=len(R))
    error = np.triu(random.uniform(-spoilt, spoilt, R.shape))
    wrong = qvi.K.toarray() * (1.0 + error + np.triu(error, 1).T)
    f = qvi.f * (1.0 + random.uniform(-spoilt, spoilt, len(qvi.f)))
    return replace(qvi, K=csc_array(wrong), f=f, root=Root(R, r0), load=qvi.f + R.T @ r0)


@pytest.mark.parametrize("law", ["coulomb", "opening", "cap", "bilateral", "equations"])
@pytest.mark.parametrize("spoilt", [1e-6, 1e-4])
def test_defect_corrections_remove_errors_of_the_matrix(law, spoilt):
    exact = condensed(chain(3, **LAWS[law]), gap=1e-15)
    found = condensed(rooted(3, spoilt, **LAWS[law]), gap=1e-15)
    assert np.linalg.norm(found.z - exact.z) < 1e-10 * np.linalg.norm(exact.z)
    assert 1e-3 * spoilt < found.corrections[0] < 100.0 * spoilt
    assert all(later < 0.1 * former for former, later in zip(found.corrections, found.corrections[1:], strict=False))
    assert len(found.corrections) >= 2
    assert condensed(rooted(3, 0.0, **LAWS[law])).corrections[0] < 1e-12


def test_without_a_root_nothing_is_gained():
    """The same wrong matrix, and no root that knows better: the answer is wrong by as much."""
    exact = condensed(chain(3))
    wrong = condensed(replace(rooted(3, 1e-6), root=None, load=None))
    assert np.linalg.norm(wrong.z - exact.z) > 1e-9 * np.linalg.norm(exact.z)


@pytest.mark.parametrize("method", ["condensed", "fixed-point", None])
def test_a_matrix_too_wrong_is_no_answer(method):
    """Errors of a third in K: solved with the root's own factors, or a status; never wrong."""
    exact = condensed(chain(3))
    solution = solve_qvi(rooted(3, 0.3), method=method)
    if solution.status is Status.SOLVED:
        assert np.linalg.norm(solution.z - exact.z) < 1e-6 * np.linalg.norm(exact.z)
    else:
        assert solution.status in (Status.ILL_CONDITIONED, Status.STALLED, Status.INACCURATE)


def close_rows(seed, close, groups=4):
    """Three normal tractions each that depend on each other: the third is the difference of two nearly equal ones.

    Coordinates are the first two. In them the third has terms of 1/close that cancel, and a rounding of that size.
    """
    random = np.random.default_rng(seed)
    m, n = 3 * groups, 5 * groups
    N, T = np.zeros((m, n)), np.zeros((m, n))
    for g in range(groups):
        N[3 * g, 5 * g] = N[3 * g + 1, 5 * g] = N[3 * g + 2, 5 * g + 1] = 1.0
        N[3 * g + 1, 5 * g + 1] = close
        T[3 * g + np.arange(3), 5 * g + 2 + np.arange(3)] = 1.0
    root = np.eye(n) + 0.15 * random.normal(size=(n, n))
    f = 2.0 * random.normal(size=n)
    f[0::5] -= 3.0
    f[1::5] = random.choice([-2.0, 2.0], groups)
    return FrictionQVI(
        K=root.T @ root, f=f, N=N, n0=np.zeros(m), T=T, t0=np.zeros(m), mu=np.full(m, 0.3), W=np.full(m, 1.0 / m),
        traces=Traces(csc_array(np.vstack([N, T])), csc_array(np.eye(2 * m))),
    )  # fmt: skip


@pytest.mark.parametrize("seed", [2, 5, 6, 12, 13, 23])
@pytest.mark.parametrize("close", [1e-3, 1e-4])
def test_rounding_of_the_slacks_is_no_residual(close, seed):
    """Up to 1e-11 of the tractions: an error that no iteration can remove, nor has to."""
    assert condensed(close_rows(seed, close)).iterations < 60


def bilateral_pair(load, mu):
    """Two uncoupled bilateral points with the loads (σ_N, σ_T) each."""
    return FrictionQVI(
        K=np.eye(4), f=load, N=-np.eye(4)[[0, 2]], n0=np.zeros(2), T=np.eye(4)[[1, 3]], t0=np.zeros(2),
        mu=np.full(2, mu), W=np.array([0.5, 2.0]), bilateral=np.full(2, True),
    )  # fmt: skip


@pytest.mark.parametrize("mu", [0.3, 3.0])
@pytest.mark.parametrize("normal", [0.0, 1e-9, -1e-5])
@pytest.mark.parametrize("shear", [0.0, 1.0])
def test_bilateral_points_at_the_kink(normal, shear, mu):
    """A point without pressure has no friction, and the other one all the same."""
    found = condensed(bilateral_pair(np.array([2.0, 3.0, normal, shear]), mu))
    expected = [2.0, min(3.0, 2.0 * mu), normal, min(shear, mu * abs(normal))]
    assert found.z == pytest.approx(expected, abs=3e-9)
    assert found.iterations < 60


def refusing(monkeypatch, *limits):
    """Newton matrices that are singular below a gap: the first start's, the second's, ... ; returns the gaps met."""
    factorise, measure, met = Newton.at, InteriorPoint.measures, []

    def singular(problem, point, residuals, *, accurate=False):
        start = [shares.late for shares in FRICTION_SHARES].index(problem.shares.max())
        method = InteriorPoint(problem, problem.stress)  # of these problems the stiffness is about one
        method.point = point
        gap = measure(method, residuals).gap
        if gap < limits[start]:
            met.append((start, gap))
            raise LinAlgError("it is singular")
        return factorise(problem, point, residuals, accurate=accurate)

    monkeypatch.setattr(Newton, "at", singular)
    return met


@pytest.mark.parametrize("seed", range(4))
def test_a_singular_matrix_does_not_lose_a_finished_answer(monkeypatch, seed):
    """Once the certificate passes no other start is made."""
    qvi = chain(seed, **LAWS["coulomb"])
    reference = condensed(qvi)
    met = refusing(monkeypatch, 1e-11, 1e-11, 1e-11, 1e-11)
    found = condensed(qvi)
    assert {start for start, _ in met} == {0}
    assert found.iterations <= reference.iterations
    assert difference(qvi, found, reference) < 1e-7


def test_the_best_of_several_starts_is_kept(monkeypatch):
    """None gets there; one gets nearest, whichever it is."""
    qvi = chain(0, **LAWS["coulomb"])
    for nearest in range(4):
        met = refusing(monkeypatch, *(1e-5 if start == nearest else 1e-1 for start in range(4)))
        found = solve_qvi(qvi, method="condensed")
        monkeypatch.undo()
        assert [start for start, _ in met] == [0, 1, 2, 3]
        assert not found.solved
        assert found.certificate.accuracy < 1e-4


class NoBounds:
    """A problem that adds nothing to the matrix."""

    def slack_rows(self, slope):
        return slope

    def add_stiffness(self, H, ratio, rows):
        pass


@pytest.mark.parametrize("seed", range(6))
def test_dense_systems_know_the_sign_of_the_determinant(seed):
    matrix = np.random.default_rng(seed).normal(size=(7, 7))
    system = DenseSystem(matrix)
    solution = system.factorised(NoBounds(), np.ones(0), np.ones(0))(matrix[:, 0])
    assert solution == pytest.approx(np.eye(7)[0], abs=1e-9)
    assert system.orientation == np.linalg.slogdet(matrix)[0]


def posed(qvi):
    """The complementarity problem about z = 0, with an interior point in general position."""
    reduction = Reduction(qvi)
    problem = Complementarity(qvi, reduction, reduction.base(np.zeros(qvi.n)), 1.0)
    method = InteriorPoint(problem, 0.7)
    random = np.random.default_rng(3)
    method.point.y = 0.5 * random.normal(size=len(method.point.y))
    method.point.s = random.uniform(0.1, 2.0, len(method.point.s))
    method.point.lam = random.uniform(0.1, 2.0, len(method.point.lam))
    method.point.pull, method.point.push = random.uniform(0.1, 2.0, (2, len(problem.split)))
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
def test_slack_rows_are_minus_the_derivative_of_the_slack(name):
    """Along √(σ_N² + δ²), on which pull push = δ²/4 stays as it is."""
    problem, method = posed(PROBLEMS[name]())
    y, smooth = method.point.y, 0.3

    def slack(u):
        return problem.slack(u, np.hypot(problem.split_normal(u), smooth))

    normal = problem.split_normal(y)
    rows = problem.slack_rows(normal / np.hypot(normal, smooth))
    for direction in np.random.default_rng(4).normal(size=(3, len(y))):
        h = 1e-6
        change = (slack(y + h * direction) - slack(y - h * direction)) / (2 * h)
        assert rows @ direction == pytest.approx(-change, abs=1e-8 * np.abs(change).max())


@POSED
def test_slacks_are_the_law_at_the_moved_point(name):
    """Written out again from z: pressures, bounds and caps at the points."""
    qvi = PROBLEMS[name]()
    reduction = Reduction(qvi)
    base = reduction.base(0.1 * np.random.default_rng(0).normal(size=qvi.n))
    problem = Complementarity(qvi, reduction, base, 1.0)
    u = 0.3 * np.random.default_rng(1).normal(size=problem.S.shape[0])
    z = reduction.move(base, problem.full(u))
    normal, shear = qvi.normal(z), qvi.tangential(z)
    unilateral, rubs = ~qvi.bilateral, ~qvi.frictionless
    pressure = np.where(qvi.bilateral, np.abs(normal), -normal)
    bound = np.where(qvi.mu > 0.0, qvi.cohesion + qvi.mu * pressure, np.minimum(qvi.cohesion, qvi.cap))
    capped = rubs & np.isfinite(qvi.cap) & (qvi.mu > 0.0)
    expected = [-normal[unilateral], (bound - shear)[rubs], (bound + shear)[rubs]]
    expected += [(qvi.cap - shear)[capped], (qvi.cap + shear)[capped]]
    found = problem.slack(u, np.abs(problem.split_normal(u)))
    assert found == pytest.approx(np.concatenate(expected), abs=1e-11)
    away = np.random.default_rng(2).normal(size=len(found))
    missed = problem.slack_residual(u, found + away, np.abs(problem.split_normal(u)))
    assert missed == pytest.approx(away, abs=1e-11)
    assert qvi.A @ z == pytest.approx(qvi.b, abs=1e-10)
    assert shear[qvi.frictionless] == pytest.approx(0.0, abs=1e-10)


@POSED
@pytest.mark.parametrize("accurate", [False, True])
def test_newton_directions_satisfy_the_linearised_equations(name, accurate):
    problem, method = posed(PROBLEMS[name]())
    point, residuals = method.point, method.residuals()
    comp = np.random.default_rng(5).normal(size=len(point.products))
    newton = Newton.at(problem, point, residuals, accurate=accurate)
    for only in (False, True):
        step = newton.step(comp, only=only)
        force, slack, split, _ = (0.0 * r for r in residuals) if only else residuals
        size = np.abs(problem.force(np.abs(step.lam))).max(initial=1.0)
        assert problem.S @ step.y + problem.force(step.lam) == pytest.approx(-force, abs=1e-10 * size)
        tangential = problem.slack_rows(np.zeros(len(problem.split)))
        pressed = problem.friction_of(step.pull + step.push)
        assert step.s + tangential @ step.y - pressed == pytest.approx(-slack, abs=1e-10)
        assert problem.split_change(step.y) - step.pull + step.push == pytest.approx(-split, abs=1e-10)
        first = (point.s * step.lam + point.lam * step.s, point.pull * step.push + point.push * step.pull)
        assert np.concatenate(first) == pytest.approx(comp, abs=1e-10)


@pytest.mark.parametrize("name", ["dense", "equations", "frictionless"])
def test_stiff_bounds_leave_forces_in_balance(name):
    """Where λ/s is 1e11 at a third of the bounds, rounding of the other unknowns may not be multiplied by it."""
    problem, method = posed(PROBLEMS[name]())
    point = method.point
    point.s[::3] = 1e-11
    residuals = method.residuals()
    step = Newton.at(problem, point, residuals).step(-0.9 * point.products)
    size = np.abs(problem.force(np.abs(step.lam))).max() + np.abs(residuals.force).max()
    left = problem.S @ step.y + problem.force(step.lam) + residuals.force
    assert np.abs(left).max() <= 2e-14 * size


@pytest.mark.parametrize(("error", "solves"), [(0.0, 1), (1e-5, 3)])
def test_newton_steps_are_refined_where_their_solution_is_inaccurate(error, solves):
    problem, method = posed(PROBLEMS["line"]())
    residuals = method.residuals()
    newton, made = Newton.at(problem, method.point, residuals), []

    def inaccurate(force):
        made.append(force)
        return (1.0 + error) * newton.solve(force)

    step = replace(newton, solve=inaccurate).step(-method.point.products)
    left = problem.S @ step.y + problem.force(step.lam) + residuals.force
    assert len(made) == solves
    assert np.abs(left).max() < 1e-8 * np.abs(problem.force(step.lam)).max()


@POSED
def test_newton_steps_have_errors_of_second_order(name):
    """What a step of length t leaves of the equations, beyond (1 − t) of them, shrinks like t²."""
    problem, method = posed(PROBLEMS[name]())
    start = method.point
    step = Newton.at(problem, start, method.residuals()).step(-start.products)

    def equations(point):
        method.point = point
        return np.concatenate([*method.residuals()[:3], point.products])

    at_start = equations(start)
    left = [np.abs(equations(start.moved(step, t)) - (1.0 - t) * at_start).max() for t in (1e-2, 1e-3)]
    assert left[1] < 0.02 * left[0]


@POSED
def test_energy_and_multipliers_are_those_of_the_full_problem(name):
    """S y + c is the gradient of the energy, and a residual of y alone is one of the contact's unknowns alone."""
    qvi = PROBLEMS[name]()
    reduction = Reduction(qvi)
    base = reduction.base(0.1 * np.random.default_rng(0).normal(size=qvi.n))
    base = reduction.base(reduction.move(base, np.zeros(reduction.size)))
    problem = Complementarity(qvi, reduction, base, 1.0)
    random = np.random.default_rng(1)
    u, lam = random.normal(size=problem.S.shape[0]), random.uniform(size=len(problem.weights))
    z = reduction.move(base, problem.full(u))
    assert problem.energy(u) == pytest.approx(qvi.energy(z), rel=1e-10)
    m_N, m_T, nu = problem.multipliers(u, lam)
    residual = qvi.gradient(z) + qvi.N.T @ m_N + qvi.T.T @ m_T + qvi.A.T @ nu
    size = np.abs(qvi.K @ z).max()
    interior = np.setdiff1d(np.arange(qvi.n), qvi.equality_system.interface)
    assert residual[interior] == pytest.approx(0.0, abs=1e-11 * size)
    force = problem.S @ u + problem.c + problem.force(lam)
    moved = reduction.move(base, problem.full(u + 1e-3 * force)) - z  # in the directions that equations leave free
    assert moved @ residual == pytest.approx(1e-3 * force @ force, rel=1e-8)


def test_energies_of_the_history_are_those_of_the_problem():
    """From the first iteration on: S y + c = 0 has its minimum where the energy has it."""
    qvi = chain(3)
    solution = condensed(qvi)
    energies = np.array([entry.energy for entry in solution.history])
    assert energies[-1] == pytest.approx(qvi.energy(solution.z), rel=1e-8)
    near = int(np.argmax([entry.residual < 1e-4 for entry in solution.history]))
    assert near < len(energies) - 3
    assert energies[near] == pytest.approx(energies[-1], rel=1e-2)
