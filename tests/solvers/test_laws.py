"""Cohesion, caps, bilateral rows and equations together: what a solution is, and that every method finds it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from solvers import FrictionQVI, InputError, Status, available, certify, solve_qvi
from solvers.certificate.feasibility import AdmissibleRows, check_feasibility, is_farkas
from tests.covering import every_pair
from tests.effort import thinned
from tests.solvers.conftest import random_problem

PULLED_SEED = 4  # of a problem with tension on bilateral rows
LOOSE = {"qp:ecos": 1e-4, "socp:ecos": 1e-4, "socp:cvxopt": 1e-4, "socp:scs": 1e-5, "qp:highs": 1e-6}


def mixed_problem(seed, equalities=2, friction=0.2):
    """Every kind of row at once: cohesive, capped, without friction, bilateral; pressed, pulled, open."""
    qvi = random_problem(seed, friction, equalities, n=14, m=10)
    random = np.random.default_rng(100 + seed)
    mu = qvi.mu.copy()
    mu[[0, 5]] = 0.0
    cap = np.full(10, np.inf)
    cap[[1, 6, 7]] = 0.3, 0.2, 0.0
    return replace(
        qvi,
        mu=mu,
        cohesion=np.where(np.arange(10) % 3 == 0, 0.0, random.uniform(0.0, 0.5, 10)),
        cap=cap,
        bilateral=np.arange(10) >= 6,
    )


def bound_of(qvi, normal):
    return np.minimum(qvi.cohesion + qvi.mu * np.abs(normal), qvi.cap)


def violations(qvi, solution):
    """Every line of the law, written out once more without scales; zero at a solution."""
    z, m_N, m_T = solution.z, solution.normal_multiplier, solution.tangential_multiplier
    normal, shear = qvi.N @ z + qvi.n0, qvi.T @ z + qvi.t0
    bound, free = bound_of(qvi, normal), ~qvi.bilateral
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


@pytest.mark.parametrize("equalities", [0, 2])
@pytest.mark.parametrize("seed", range(6))
def test_the_laws_hold_line_by_line(seed, equalities):
    qvi = mixed_problem(seed, equalities)
    solution = solve_qvi(qvi, tolerance=1e-9)
    assert solution.status is Status.SOLVED, solution.message
    for name, values in violations(qvi, solution).items():
        assert values.max(initial=0.0) < 1e-6, name


# Of 2000, those that jammed while |σ_N| was smoothed by a length that fell by itself, on one processor or another.
JAMMED = (
    109, 122, 131, 136, 164, 210, 478, 532, 790, 934, 984, 988, 1049, 1110, 1241, 1251, 1254, 1347, 1420, 1474, 1483,
    1494, 1553, 1585, 1597, 1599, 1676, 1702, 1703, 1731, 1824, 1870,
)  # fmt: skip


@pytest.mark.parametrize("seed", thinned(JAMMED, 16))
def test_bilateral_points_with_friction_do_not_jam(seed):
    solution = solve_qvi(mixed_problem(seed, seed % 4), method="condensed")
    assert solution.status is Status.SOLVED, solution.message


def test_the_problems_show_every_state():
    """Among the seeds: slip at a cap, slip under cohesion, bilateral rows pulled and pressed, open and stuck points."""
    seen = set()
    for seed in range(6):
        qvi = mixed_problem(seed)
        solution = solve_qvi(qvi)
        normal, slips = qvi.normal(solution.z), np.abs(solution.tangential_multiplier) > 1e-4
        capped = qvi.cap < qvi.cohesion + qvi.mu * np.abs(normal)
        found = {
            "slip at a cap": slips & capped & (qvi.cap > 0.0),
            "slip with cohesion": slips & ~capped & (qvi.cohesion > 0.0) & (qvi.mu > 0.0),
            "pulled": qvi.bilateral & (normal > 1e-4),
            "pressed": qvi.bilateral & (normal < -1e-4),
            "open": solution.normal_multiplier > 1e-4,
            "stuck": ~slips & (bound_of(qvi, normal) > 1e-3),
        }
        seen |= {name for name, where in found.items() if where.any()}
    assert seen == {"slip at a cap", "slip with cohesion", "pulled", "pressed", "open", "stuck"}


@cache
def accurately(seed, equalities):
    """Solution of a mixed problem."""
    return solve_qvi(mixed_problem(seed, equalities), inner="direct:clarabel", tolerance=1e-9)


@pytest.mark.parametrize(("inner", "form", "problem"), every_pair(available(), ["full", "condensed"], [(0, 2), (3, 0)]))
def test_every_inner_solver_agrees(inner, form, problem):
    """A problem by its seed and number of equalities."""
    qvi, reference = mixed_problem(*problem), accurately(*problem)
    solution = solve_qvi(qvi, inner=inner, form=form, tolerance=1e-6)
    statuses = (Status.SOLVED, Status.INACCURATE) if inner in LOOSE else (Status.SOLVED,)
    assert reference.status is Status.SOLVED
    assert solution.status in statuses, solution.message
    assert solution.z == pytest.approx(reference.z, abs=LOOSE.get(inner, 1e-6))


@pytest.mark.parametrize(("seed", "equalities"), [(0, 2), (1, 0), (3, 1)])
def test_uzawa_agrees(seed, equalities):
    """Without rows whose bound is zero: there Uzawa's step never shrinks."""
    qvi = mixed_problem(seed, equalities)
    qvi = replace(qvi, mu=np.full(10, 0.2), cohesion=qvi.cohesion + 0.1, cap=np.maximum(qvi.cap, 0.2))
    reference = solve_qvi(qvi, inner="direct:clarabel", tolerance=1e-9)
    solution = solve_qvi(qvi, method="uzawa", tolerance=1e-6, omega_T=0.01)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.z == pytest.approx(reference.z, abs=1e-5)


class TestReductions:
    """A law that says the same in other words has the same solution."""

    @staticmethod
    def same(first, second):
        one, other = (solve_qvi(qvi, tolerance=1e-9) for qvi in (first, second))
        assert one.status is other.status is Status.SOLVED
        return one.z == pytest.approx(other.z, abs=1e-7)

    @pytest.mark.parametrize("seed", range(3))
    def test_no_friction_in_three_ways(self, seed):
        qvi = random_problem(seed, 0.0, 1)
        assert self.same(qvi, replace(qvi, mu=np.ones(qvi.m), cohesion=np.ones(qvi.m), cap=np.zeros(qvi.m)))
        assert self.same(qvi, replace(qvi, cohesion=np.zeros(qvi.m), cap=np.full(qvi.m, 5.0)))

    @pytest.mark.parametrize("seed", range(3))
    def test_a_large_cap_is_none(self, seed):
        qvi = random_problem(seed, 0.2, 1)
        assert self.same(qvi, replace(qvi, cap=np.full(qvi.m, 1e6)))

    @pytest.mark.parametrize("seed", range(3))
    def test_coulomb_under_a_cap_with_much_cohesion_is_tresca(self, seed):
        qvi = random_problem(seed, 0.0, 1)
        tresca = replace(qvi, cohesion=np.full(qvi.m, 0.3))
        assert self.same(tresca, replace(qvi, mu=np.ones(qvi.m), cohesion=np.full(qvi.m, 0.3), cap=np.full(qvi.m, 0.3)))

    @pytest.mark.parametrize("seed", range(3))
    def test_rows_without_limits_are_no_rows(self, seed):
        qvi = random_problem(seed, 0.0, 1)
        void = replace(qvi, cohesion=np.full(qvi.m, 1e6), bilateral=np.ones(qvi.m, dtype=bool))
        solution = solve_qvi(void)
        assert solution.status is Status.SOLVED
        assert solution.z == pytest.approx(qvi.bonded, abs=1e-8)
        assert np.abs(solution.normal_multiplier).max() == 0.0

    @pytest.mark.parametrize("seed", range(3))
    def test_equations_are_substitutions(self, seed):
        """A z = b eliminated by hand: the problem in the null space, with the same tractions."""
        qvi = mixed_problem(seed, 2)
        A = qvi.A.toarray()
        particular = np.linalg.lstsq(A, qvi.b, rcond=None)[0]
        Z = np.linalg.svd(A)[2][2:].T
        smaller = FrictionQVI(
            K=Z.T @ qvi.K @ Z, f=Z.T @ (qvi.f - qvi.K @ particular), N=qvi.N @ Z, n0=qvi.normal(particular),
            T=qvi.T @ Z, t0=qvi.tangential(particular), mu=qvi.mu, W=qvi.W, cohesion=qvi.cohesion, cap=qvi.cap,
            bilateral=qvi.bilateral,
        )  # fmt: skip
        one, other = solve_qvi(qvi, tolerance=1e-9), solve_qvi(smaller, tolerance=1e-9)
        assert one.status is other.status is Status.SOLVED
        assert one.z == pytest.approx(particular + Z @ other.z, abs=1e-7)


@pytest.fixture(scope="module")
def solved():
    qvi = mixed_problem(0)
    solution = solve_qvi(qvi, tolerance=1e-9)
    assert solution.solved
    return qvi, solution


class TestCertificate:
    """A state that breaks one line of the law does not pass, and the measure says which."""

    @staticmethod
    def failed(qvi, solution, **changes):
        """Names of the measures that fail after changes of the data and multipliers."""
        given = [
            changes.pop(name, getattr(solution, name))
            for name in ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier")
        ]
        certificate = certify(replace(qvi, **changes), *given, tolerance=1e-8)
        return {name for name, limit in certificate.limits.items() if certificate.measures[name] > limit}

    def test_the_solution_passes(self, solved):
        assert self.failed(*solved) == set()

    def test_a_multiplier_on_a_bilateral_row(self, solved):
        qvi, solution = solved
        normal = solution.normal_multiplier.copy()
        normal[8] = 1e-3
        # equilibrated by the load, so that only the law is broken
        changes = {"normal_multiplier": normal, "f": qvi.f + qvi.N.T @ (normal - solution.normal_multiplier)}
        assert {"sign", "natural_map"} <= self.failed(qvi, solution, **changes)
        assert "stationarity" not in self.failed(qvi, solution, **changes)

    def test_shear_above_the_cap(self, solved):
        qvi, solution = solved
        shear = np.abs(qvi.tangential(solution.z))
        cap = qvi.cap.copy()
        cap[9] = 0.9 * shear[9]
        assert shear[9] > 1e-3
        assert "friction" in self.failed(qvi, solution, cap=cap)

    def test_less_cohesion_than_is_used(self, solved):
        qvi, solution = solved
        slips = np.abs(solution.tangential_multiplier) > 1e-4
        used = slips & (qvi.cohesion > 0.0) & (qvi.cap > qvi.cohesion + qvi.mu * np.abs(qvi.normal(solution.z)))
        assert used.any()
        assert "friction" in self.failed(qvi, solution, cohesion=np.where(used, 0.9 * qvi.cohesion, qvi.cohesion))

    def test_more_cohesion_than_is_used(self, solved):
        """Slip inside the bound."""
        qvi, solution = solved
        failed = self.failed(qvi, solution, cohesion=qvi.cohesion + 0.1)
        assert {"complementarity_tangential", "natural_map", "energy_gap"} <= failed

    def test_tension_where_the_row_is_no_longer_bilateral(self):
        qvi = mixed_problem(PULLED_SEED)
        solution = solve_qvi(qvi, tolerance=1e-9)
        assert qvi.normal(solution.z)[qvi.bilateral].max() > 1e-3
        assert "normal" in self.failed(qvi, solution, bilateral=np.zeros(qvi.m, dtype=bool))

    def test_an_equation_missed(self, solved):
        qvi, solution = solved
        assert "equality" in self.failed(qvi, solution, b=qvi.b + 1e-4)


class TestFeasibility:
    """The convex set that every solution lies in, with its proofs of emptiness."""

    @staticmethod
    def dragged(shear, normal=1.0, **laws):
        """One point with σ_N = −normal and σ_T = shear given by equations."""
        return FrictionQVI(
            K=np.eye(2), f=np.zeros(2), N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0],
            mu=[0.3], W=[1.0], A=np.eye(2), b=np.array([normal, shear]), **laws,
        )  # fmt: skip

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize(
        ("laws", "normal", "most"),
        [
            ({}, 1.0, 0.3),
            ({"cohesion": [0.2]}, 1.0, 0.5),
            ({"cap": [0.1]}, 1.0, 0.1),
            ({"cohesion": [0.2], "cap": [0.4]}, 1.0, 0.4),
            ({"cohesion": [0.2], "cap": [0.4], "bilateral": [True]}, -1.0, 0.4),
            ({"cohesion": [0.2]}, 0.0, 0.2),
        ],
    )
    def test_what_one_point_carries(self, laws, normal, most, sign):
        below, above = (self.dragged(sign * factor * most, normal, **laws) for factor in (0.999, 1.001))
        assert check_feasibility(below).feasible is True
        found = check_feasibility(above)
        assert found.feasible is False
        assert is_farkas(above, *found.farkas)
        assert solve_qvi(below).status is Status.SOLVED
        assert solve_qvi(above).status is Status.INFEASIBLE

    def test_bilateral_friction_is_bounded_by_no_convex_row(self):
        """Beyond μ|σ_N| there is no solution; no proof exists, so it is never called proved."""
        above = self.dragged(0.31, bilateral=[True])
        assert check_feasibility(above).feasible is True
        assert solve_qvi(self.dragged(0.29, bilateral=[True])).status is Status.SOLVED
        assert solve_qvi(self.dragged(0.29, -1.0, bilateral=[True])).status is Status.SOLVED
        assert solve_qvi(above).status in (Status.INNER_INFEASIBLE, Status.STALLED, Status.CYCLING)

    @pytest.mark.parametrize("seed", range(6))
    def test_solutions_lie_in_the_set(self, seed):
        qvi = mixed_problem(seed)
        rows = AdmissibleRows.of(qvi)
        z = solve_qvi(qvi, tolerance=1e-9).z
        assert (rows.G @ z - rows.h).max() < 1e-7
        assert np.allclose((rows.H @ qvi.contact_rows).toarray(), rows.G.toarray())

    def test_shares_belong_to_their_points(self):
        qvi = self.dragged(0.5)
        normal, tangential = AdmissibleRows.of(qvi).shares(check_feasibility(qvi).farkas[0], 1)
        assert tangential[0] > 0.0
        assert normal[0] < tangential[0]


@pytest.mark.parametrize(
    ("laws", "word"),
    [
        ({"cohesion": [-1.0]}, "cohesion"),
        ({"cohesion": [np.inf]}, "cohesion"),
        ({"cap": [-1.0]}, "cap"),
        ({"cap": [np.nan]}, "cap"),
        ({"cap": [1.0, 1.0]}, "cap"),
        ({"bilateral": [1]}, "bilateral"),
        ({"bilateral": [True, False]}, "bilateral"),
    ],
)
def test_bad_laws_are_refused(laws, word):
    with pytest.raises(InputError, match=word):
        TestFeasibility.dragged(0.1, **laws)
