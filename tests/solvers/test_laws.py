"""Cohesion, caps, bilateral rows and equations together: what a solution is, and that every method finds it."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from solvers import FrictionQVI, Status, available, certify, solve_qvi
from solvers.certificate import AdmissibleRows, check_feasibility, is_farkas
from solvers.derivative import change
from tests.cases import every_pair, thinned
from tests.solvers.conftest import changed, dragged_block, mixed_problem, random_problem

PULLED_SEED = 4  # of a problem with tension on bilateral rows
LOOSE = {"qp:ecos": 1e-4, "socp:ecos": 1e-4, "socp:cvxopt": 1e-4, "socp:scs": 1e-5, "qp:highs": 1e-6}


def violations(qvi, solution):
    """Every line of the law, written out once more without scales; zero at a solution."""
    z, m_N, m_T = solution.z, solution.normal_multiplier, solution.tangential_multiplier
    normal, shear = qvi.N @ z + qvi.n0, qvi.T @ z + qvi.t0
    bound, free = np.minimum(qvi.cohesion + qvi.mu * np.abs(normal), qvi.cap), ~qvi.bilateral
    residual = qvi.K @ z - qvi.f + qvi.N.T @ m_N + qvi.T.T @ m_T + qvi.A.T @ solution.equality_multiplier
    return {
        "equations": np.abs(qvi.A @ z - qvi.b),
        "stationarity": np.abs(residual),
        "tension": np.maximum(normal[free], 0.0),
        "pulling": np.maximum(-m_N[free], 0.0),
        "open or closed": np.abs(m_N * normal)[free],
        "bilateral": np.abs(m_N[~free]),
        "bound": np.maximum(np.abs(shear) - bound, 0.0),
        "slip against shear": np.maximum(-m_T * shear, 0.0),
        "slip at the bound": np.abs(m_T) * np.maximum(bound - np.abs(shear), 0.0),
    }  # fmt: skip


# Of 2000, eight that jammed while |σ_N| was smoothed by a length that fell by itself, on one processor or another.
@pytest.mark.parametrize("seed", [122, 790, 1110, 1251, 1254, 1597, 1703, 1870])
def test_bilateral_points_with_friction_do_not_jam(seed):
    solution = solve_qvi(mixed_problem(seed, seed % 4), method="condensed")
    assert solution.status is Status.SOLVED, solution.message


@cache
def accurately(seed, equalities):
    """Solution of a mixed problem."""
    return solve_qvi(mixed_problem(seed, equalities), inner="direct:clarabel", tolerance=1e-9)


@pytest.mark.parametrize(
    ("inner", "form", "problem"), thinned(every_pair(available(), ["full", "condensed"], [(0, 2), (3, 0)]), 16)
)
def test_every_inner_solver_agrees(inner, form, problem):
    """A problem by its seed and number of equalities."""
    qvi, reference = mixed_problem(*problem), accurately(*problem)
    solution = solve_qvi(qvi, inner=inner, form=form, tolerance=1e-6)
    statuses = (Status.SOLVED, Status.INACCURATE) if inner in LOOSE else (Status.SOLVED,)
    assert reference.status is Status.SOLVED
    assert solution.status in statuses, solution.message
    assert solution.z == pytest.approx(reference.z, abs=LOOSE.get(inner, 1e-6))


def said_otherwise(m):
    """Pairs of laws that say the same: no friction in three ways, no cap, Tresca's law by Coulomb's, no limits."""
    zeros, ones = np.zeros(m), np.ones(m)
    yield {}, {"mu": ones, "cohesion": ones, "cap": zeros}
    yield {}, {"cohesion": zeros, "cap": 5.0 * ones}
    yield {"mu": 0.2 * ones}, {"mu": 0.2 * ones, "cap": 1e6 * ones}
    yield {"cohesion": 0.3 * ones}, {"mu": ones, "cohesion": 0.3 * ones, "cap": 0.3 * ones}


@pytest.mark.parametrize("seed", range(2))
def test_a_law_that_says_the_same_in_other_words_has_the_same_solution(seed):
    qvi = random_problem(seed, 0.0, 1)
    for laws in said_otherwise(qvi.m):
        one, other = (solve_qvi(qvi.with_law(**law), tolerance=1e-9) for law in laws)
        assert one.status is other.status is Status.SOLVED
        assert one.z == pytest.approx(other.z, abs=1e-7)
    void = solve_qvi(qvi.with_law(cohesion=np.full(qvi.m, 1e6), bilateral=np.ones(qvi.m, dtype=bool)))
    assert void.z == pytest.approx(qvi.bonded, abs=1e-8)
    assert np.abs(void.normal_multiplier).max() == 0.0


@pytest.mark.parametrize("seed", range(2))
def test_equations_are_substitutions(seed):
    """A z = b eliminated by hand: the problem in the null space, with the same tractions."""
    qvi = mixed_problem(seed, 2)
    A = qvi.A.toarray()
    particular = np.linalg.lstsq(A, qvi.b, rcond=None)[0]
    Z = np.linalg.svd(A)[2][2:].T
    smaller = FrictionQVI.from_arrays(
        K=Z.T @ qvi.K @ Z, f=Z.T @ (qvi.f - qvi.K @ particular), N=qvi.N @ Z, n0=qvi.normal(particular),
        T=qvi.T @ Z, t0=qvi.tangential(particular), mu=qvi.mu, W=qvi.W, cohesion=qvi.cohesion, cap=qvi.cap,
        bilateral=qvi.bilateral,
    )  # fmt: skip
    one, other = solve_qvi(qvi, tolerance=1e-9), solve_qvi(smaller, tolerance=1e-9)
    assert one.status is other.status is Status.SOLVED
    assert one.z == pytest.approx(particular + Z @ other.z, abs=1e-7)
    assert qvi.A @ solve_qvi(qvi, method="uzawa", iterations=10).z == pytest.approx(qvi.b, abs=1e-10)


def used(qvi, solution):
    """Points that slip by friction and cohesion together, below their caps."""
    bound = qvi.cohesion + qvi.mu * np.abs(qvi.normal(solution.z))
    return (np.abs(solution.tangential_multiplier) > 1e-4) & (qvi.cohesion > 0.0) & (qvi.cap > bound)


BROKEN = {  # changes of the data of a solved problem, and measures that fail
    "nothing": (lambda _qvi, _: {}, set()),
    "shear above the cap": (
        lambda qvi, it: {"cap": np.where(np.arange(10) == 9, 0.9 * np.abs(qvi.tangential(it.z)), qvi.cap)}, {"friction"}
    ),
    "less cohesion than is used": (
        lambda qvi, it: {"cohesion": np.where(used(qvi, it), 0.9, 1.0) * qvi.cohesion}, {"friction"}
    ),
    "slip inside the bound": (
        lambda qvi, _: {"cohesion": qvi.cohesion + 0.1}, {"complementarity_tangential", "natural_map", "energy_gap"}
    ),
    "an equation missed": (lambda qvi, _: {"b": qvi.b + 1e-4}, {"equality"}),
    "tension where the row is no longer bilateral": (lambda qvi, _: {"bilateral": ~np.ones(qvi.m, bool)}, {"normal"}),
}  # fmt: skip


@pytest.mark.parametrize("what", BROKEN)
def test_a_state_that_breaks_one_line_of_the_law_does_not_pass_and_the_measure_says_which(what):
    qvi, (changes, expected) = mixed_problem(PULLED_SEED if "tension" in what else 0), BROKEN[what]
    solution = solve_qvi(qvi, tolerance=1e-9)
    rows = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    certificate = certify(changed(qvi, **changes(qvi, solution)), solution.z, *rows)
    failed = {row.measure.name for row in certificate.rows() if not row.passed}
    assert failed >= expected
    assert bool(failed) == bool(expected)


class TestFeasibility:
    """The convex set that every solution lies in, with its proofs of emptiness."""

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize(
        ("laws", "normal", "most"),
        [({}, 1.0, 0.3), ({"cohesion": [0.2]}, 1.0, 0.5), ({"cap": [0.1]}, 1.0, 0.1),
         ({"cohesion": [0.2], "cap": [0.4]}, 1.0, 0.4),
         ({"cohesion": [0.2], "cap": [0.4], "bilateral": [True]}, -1.0, 0.4), ({"cohesion": [0.2]}, 0.0, 0.2)],
    )  # fmt: skip
    def test_what_one_point_carries(self, laws, normal, most, sign):
        below, above = (dragged_block(sign * factor * most, normal=normal, **laws) for factor in (0.999, 1.001))
        assert check_feasibility(below).feasible is True
        found = check_feasibility(above)
        assert found.feasible is False
        assert is_farkas(above, *found.farkas)
        assert solve_qvi(below).status is Status.SOLVED
        assert solve_qvi(above).status is Status.INFEASIBLE

    def test_bilateral_friction_is_bounded_by_no_convex_row(self):
        """Beyond μ|σ_N| there is no solution; no proof exists, so it is never called proved."""
        above = dragged_block(0.31, bilateral=[True])
        assert check_feasibility(above).feasible is True
        assert solve_qvi(dragged_block(0.29, bilateral=[True])).status is Status.SOLVED
        assert solve_qvi(dragged_block(0.29, normal=-1.0, bilateral=[True])).status is Status.SOLVED
        assert solve_qvi(above).status in (Status.INNER_INFEASIBLE, Status.STALLED, Status.CYCLING)

    @pytest.mark.parametrize(
        ("n0", "t0"), [((-1.0, -1.0), (0.3, -0.3)), ((-1.0, 0.1), (0.0, 0.0)), ((-1.0, -1.0), (0.0, -0.4))]
    )
    def test_tractions_that_equilibrium_alone_determines(self, n0, t0):
        """There are no unknowns: all is said by pull and slip at the points, with μ = 0.3."""
        none = np.zeros((2, 0))
        data = {"N": none, "T": none, "n0": np.array(n0), "t0": np.array(t0), "mu": np.full(2, 0.3), "W": np.ones(2)}
        qvi = FrictionQVI.from_arrays(K=np.zeros((0, 0)), f=np.zeros(0), **data)
        found, carried = check_feasibility(qvi), t0[0] == 0.3
        assert found.feasible is carried
        assert carried or is_farkas(qvi, *found.farkas)
        assert solve_qvi(qvi).status is (Status.SOLVED if carried else Status.INFEASIBLE)

    @pytest.mark.parametrize("n", [0, 4])
    def test_an_equation_without_unknowns(self, n):
        """It proves that there is no solution, whatever other equations say."""
        A, free = np.outer([0.0, 1.0, 0.7], np.sin(np.arange(n) + 1.0)), random_problem(0, n=n, m=1)
        for right in (-2.0, 0.0, 1e-12):
            qvi = changed(free, A=A, b=np.array([right, 0.1 * bool(n), 0.07 * bool(n)]))
            found = check_feasibility(qvi)
            assert found.feasible is (right == 0.0)
            assert found.feasible or is_farkas(qvi, *found.farkas)
            assert solve_qvi(qvi).status is (Status.INFEASIBLE if right else Status.SOLVED)

    @pytest.mark.parametrize("size", [1e-10, 1.0, 1e10])
    def test_a_contact_that_a_large_unknown_relieves(self, size):
        """Where the bonded state is zero, it says nothing about sizes: z = −1/size carries the pull of 1."""
        N, none = np.array([[size]]), np.zeros((1, 1))
        qvi = FrictionQVI.from_arrays(K=np.eye(1), f=np.zeros(1), N=N, T=none, n0=[1.0], t0=[0.0], mu=[0.0], W=[1.0])
        assert not is_farkas(qvi, np.array([1.0, 0.0, 0.0]), np.zeros(0))
        assert check_feasibility(qvi).feasible is True

    @pytest.mark.parametrize("seed", range(6))
    def test_solutions_lie_in_the_set(self, seed):
        qvi = mixed_problem(seed)
        rows = AdmissibleRows.of(qvi)
        z = solve_qvi(qvi, tolerance=1e-9).z
        assert (rows.G @ z - rows.h).max() < 1e-7


def points(pull, shear, W=(1.0,), mu=0.3, **laws):
    """Points whose tractions are the unknowns, pulled and sheared by given stresses."""
    m, identity = len(W), np.eye(2 * len(W))
    data = {"f": np.zeros(2 * m), "n0": np.full(m, pull), "t0": np.array(shear), "mu": np.full(m, mu)}
    return FrictionQVI.from_arrays(K=identity, N=identity[:m], T=identity[m:], W=np.array(W), **data, **laws)


@pytest.mark.parametrize("W", [(1.0, 1.0), (1.0, 1e-7), (1e7, 1.0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_points_of_any_weight_slip(W, sign):
    """Their shears grow like the friction, although slips m/W differ by orders."""
    base, moved = (points(-1.0, [0.5, 0.4], W, mu) for mu in (0.3, 0.301))
    assert change(solve_qvi(base), base, moved, sign).z == pytest.approx([0.0, 0.0, sign * 1e-3, sign * 1e-3])


def test_a_cap_of_zero_stays_zero_under_pressure():
    base, moved = (points(pull, [0.2], cap=np.zeros(1)) for pull in (0.0, -0.01))
    assert change(solve_qvi(base), base, moved, 1.0).z == pytest.approx([0.0, 0.0])


def test_equations_may_fix_what_has_no_stiffness():
    rows = {"N": np.ones((1, 2)), "T": np.array([[1.0, -1.0]]), "A": np.array([[0.0, 1.0]]), "b": np.array([0.1])}
    data = {"f": np.array([0.2, 0.0]), "n0": [-1.0], "t0": [0.1], "mu": [0.3], "W": [1.0]}
    assert solve_qvi(FrictionQVI.from_arrays(K=np.diag([1.0, 0.0]), **rows, **data)).z == pytest.approx([0.2, 0.1])
    assert solve_qvi(changed(dragged_block(0.2), K=np.zeros((2, 2)))).z == pytest.approx([1.0, 0.2])


@pytest.mark.parametrize("method", [None, "condensed", "fixed-point"])
@pytest.mark.parametrize("stress", [0.0, 1.0])
def test_equations_may_fix_all_tractions(method, stress):
    """The contact has no stiffness then; it is pressed by `stress`, and slips nowhere, or is touched up to rounding."""
    for seed in range(8):
        qvi, random = random_problem(seed, n=6, m=2), np.random.default_rng(100 + seed)
        rows, z = qvi.contact.rows, random.normal(size=6)
        A, shift = random.normal(size=(4, 4)) @ rows, stress * np.array([-1.0, -2.0, 0.3, -0.6]) - rows @ z
        fixed = changed(qvi, A=A, b=A @ z, n0=shift[:2], t0=shift[2:])
        solution = solve_qvi(fixed, method)
        assert solution.status is Status.SOLVED, solution.message
        assert "infeasible" not in {each.status for each in solve_qvi(fixed, method, tolerance=1e-30).attempts}


@pytest.mark.parametrize("unit", [1e-14, 1e14])
def test_whether_equations_fix_tractions_does_not_depend_on_units(unit):
    """The traction 2 z₁ is free if z₁ = unit z₂."""
    rows = np.array([[-1.0, -unit], [0.5, 1.5 * unit], [1.0, -unit]])
    data = {"K": np.diag([1.0, unit**2]), "N": rows[:1], "T": rows[1:2], "A": rows[2:], "b": np.zeros(1)}
    assert changed(dragged_block(0.2), **data).contact_stiffness == pytest.approx(4.0)


# That a load cannot be carried is proved by one linear program, before other starts and without Clarabel.


def overloaded(seed: int, friction: float = 0.3) -> FrictionQVI:
    """Dense random data: a combination 1ᵀN z = 0 of normal stresses vanishes, and their constants add up to tension."""
    qvi = random_problem(seed, friction, n=6)
    N = qvi.N.toarray()
    N[-1] = -N[:-1].sum(axis=0)
    n0 = np.full(qvi.m, -0.5)
    n0[-1] = 0.5 * (qvi.m - 1) + 0.1
    return qvi.with_contact(N=N).with_loads(n0=n0)


@pytest.fixture
def silent_clarabel(back_end):
    """Clarabel, which decides nothing."""

    def answer(true):
        found = true()
        return SimpleNamespace(status="NumericalError", x=found.x, z=found.z)

    back_end("direct:clarabel", answer)


@pytest.mark.usefixtures("silent_clarabel")
@pytest.mark.parametrize("shear", [0.0, 0.3, 0.30001, -0.4])
def test_a_linear_program_proves_it_of_loads_that_are_not_carried_alone(shear):
    qvi = dragged_block(shear)
    found = check_feasibility(qvi)
    assert found.feasible is (None if 0.0 <= shear <= 0.3 else False)
    assert found.feasible is None or is_farkas(qvi, *found.farkas)


@pytest.mark.usefixtures("silent_clarabel")
@pytest.mark.parametrize("seed", range(4))
def test_where_tension_alone_is_too_much_friction_has_no_part_in_the_proof(seed):
    qvi = overloaded(seed)
    found = check_feasibility(qvi)
    assert found.feasible is False
    assert is_farkas(qvi, *found.farkas)
    assert not found.farkas[0][AdmissibleRows.of(qvi).tangential].any()


@pytest.mark.parametrize("seed", range(4))
def test_no_other_start_follows_a_proof(seed):
    """One start ends within 15 iterations; all of them together take 30."""
    solution = solve_qvi(overloaded(seed))
    assert solution.status is Status.INFEASIBLE
    assert is_farkas(solution.problem, *solution.farkas)
    assert solution.iterations <= 15
