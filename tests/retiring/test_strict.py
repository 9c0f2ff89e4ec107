"""Bounds on whole edges as algebra: thresholds, back ends, certificate."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from qvi_contact.element.hermite import gauss_legendre
from solvers import EdgeRows, FrictionQVI, InputError, SolverUnavailableError, Status, available, certify, solve_qvi
from solvers.fixed_point.forms import make_form
from solvers.inequality.edges import affine_basis, quadratic_basis
from solvers.inner.problem import Centre
from solvers.inner.registry import make_inner
from solvers.strict.cones import strict_contradiction
from solvers.strict.cvxpy_cones import StrictSOCPSolver
from solvers.strict.direct_clarabel import _Program
from solvers.strict.faces import closed_coefficients
from solvers.strict.newton import Newton
from solvers.strict.quadratics import is_nonnegative, largest
from solvers.strict.threshold import (
    affine_pressure,
    end_pressure,
    frictionless_edges,
    strict_bound,
    strict_pressure,
    strict_threshold,
)
from tests.solvers.conftest import random_problem

EDGES = EdgeRows(gauss_legendre(4)[0])
WEIGHTS = gauss_legendre(4)[1]
T = np.linspace(0.0, 1.0, 1000)


def edge_problem(seed=0, friction=0.3, edges=3, equalities=0, **changes):
    """Dense random data with polynomial tractions, pressed at z = 0; the shear is continuous nowhere."""
    random = np.random.default_rng(seed)
    n = 7 * edges
    root = random.normal(size=(n, n))
    ends, shear = random.normal(size=(edges, 2, n)), random.normal(size=(edges, 3, n))
    A = random.normal(size=(equalities, n)) if equalities else None
    data = {
        "K": root @ root.T + np.eye(n),
        "f": 3.0 * random.normal(size=n),
        "N": np.vstack([EDGES.affine @ part for part in ends]),
        "n0": np.full(4 * edges, -0.5),
        "T": np.vstack([EDGES.quadratic @ part for part in shear]),
        "t0": EDGES.at_points(0.1 * random.normal(size=(edges, 3))),
        "mu": np.full(4 * edges, friction),
        "W": np.tile(WEIGHTS, edges) * np.repeat(random.uniform(0.5, 2.0, edges), 4),
        "A": A,
        "b": 0.01 * np.ones(equalities) if equalities else None,
        "edges": EDGES,
        **changes,
    }
    return FrictionQVI(**data)


def excess(qvi, z):
    """Largest |σ_T| − (cohesion + mu s) at 1000 points of each edge, constant fields."""
    tau = quadratic_basis(T) @ qvi.edges.bernstein(qvi.tangential(z)).T
    normal = affine_basis(T) @ qvi.edges.ends(qvi.normal(z)).T
    pressure = np.where(qvi.bilateral[::4], np.abs(normal), np.maximum(-normal, 0.0))
    return float((np.abs(tau) - np.minimum(qvi.cohesion[::4] + qvi.mu[::4] * pressure, qvi.cap[::4])).max())


class TestProblem:
    """The fields `edges` and `strict`."""

    def test_strictly(self):
        qvi = edge_problem()
        strict = qvi.strictly()
        assert strict.strict
        assert not qvi.strict
        assert strict.strictly() is strict
        assert strict.changed(mu=0 * qvi.mu).strict

    def test_needs_edges(self):
        with pytest.raises(InputError, match="EdgeRows"):
            random_problem(0).strictly()
        with pytest.raises(InputError, match="5 values an edge"):
            edge_problem(edges=2).changed(edges=EdgeRows([0.1, 0.2, 0.5, 0.6, 0.9]))

    @pytest.mark.parametrize(("name", "power"), [("n0", 2), ("t0", 3)])
    def test_tractions_have_to_be_polynomials(self, name, power):
        qvi = edge_problem()
        bent = getattr(qvi, name) + 1e-3 * np.tile(EDGES.points**power, 3)
        bent_problem = qvi.changed(**{name: bent})  # fine as long as the law holds at points only
        with pytest.raises(InputError, match="affine"):
            bent_problem.strictly()

    def test_only_the_fixed_point(self):
        with pytest.raises(InputError, match="fixed-point"):
            solve_qvi(edge_problem(), method="condensed", inner="strict-direct:clarabel")
        with pytest.raises(InputError, match="strict"):
            solve_qvi(edge_problem().strictly(), inner="qp:clarabel")
        with pytest.raises(SolverUnavailableError, match="strict-direct:clarabel"):
            solve_qvi(edge_problem(), inner="strict:unheard-of")

    def test_names(self):
        assert available("strict-direct") == ("strict-direct:clarabel",)
        assert [name.split(":")[1] for name in available("strict")] == [
            name.split(":")[1] for name in available("socp")
        ]
        assert not any(name.startswith("strict") for name in available())  # another problem than the others solve


class TestThreshold:
    """The bound used on an edge: exact where it is a quadratic, else below the law."""

    PRESSURE = np.array([[0.2, 1.0], [0.5, 0.5], [0.0, 2.0]])

    @staticmethod
    def law(fields):
        """The law at 1000 points of each edge for fields of t."""
        mu, cohesion, cap = (field(T)[:, None] + 0 * T[:, None] for field in fields)
        return np.minimum(cohesion + mu * (affine_basis(T) @ TestThreshold.PRESSURE.T), cap)

    @staticmethod
    def found(fields):
        t = np.tile(EDGES.points, 3)
        mu, cohesion, cap = (field(t) + 0 * t for field in fields)
        qvi = edge_problem(mu=mu, cohesion=cohesion, cap=cap).strictly()
        return strict_threshold(qvi, EDGES.at_points(TestThreshold.PRESSURE))

    @pytest.mark.parametrize(
        "fields",
        [
            (lambda t: 0.3 + 0 * t, lambda t: 0 * t, lambda t: np.inf + 0 * t),
            (lambda t: 0.3 - 0.2 * t, lambda t: 0.1 + t**2, lambda t: np.inf + 0 * t),
            (lambda t: t, lambda t: 0.1 + 0 * t, lambda t: 5.0 + t),
            (lambda t: 0.3 + 0 * t, lambda t: 2.0 + t, lambda t: 0.5 + t**2),
            (lambda t: 0 * t, lambda t: 0.7 + 0 * t, lambda t: np.inf + 0 * t),
        ],
        ids=["coulomb", "affine mu, quadratic cohesion", "cap not reached", "cap reached", "tresca"],
    )
    def test_exact(self, fields):
        threshold = self.found(fields)
        assert threshold.exact.all()
        assert quadratic_basis(T) @ threshold.coefficients.T == pytest.approx(self.law(fields), abs=1e-9)

    @pytest.mark.parametrize(
        "fields",
        [
            (lambda t: 0.3 * np.exp(-0.5 * t), lambda t: 0 * t, lambda t: np.inf + 0 * t),
            (lambda t: 0.3 + 0.05 * np.sin(3 * t), lambda t: 0 * t, lambda t: np.inf + 0 * t),
            (lambda t: 0.3 + 0 * t, lambda t: 0.05 + 0 * t, lambda t: 0.2 + 0 * t),
            (lambda t: 0.4 - 0.2 * t, lambda t: 0.05 + 0 * t, lambda t: 0.2 + 0.1 * t),
            (lambda t: 0.3 + 0 * t, lambda t: 0.3 + t**3, lambda t: np.inf + 0 * t),
        ],
        ids=["exp", "sine", "cap in between", "affine mu and cap", "cubic cohesion"],
    )
    def test_safe(self, fields):
        threshold = self.found(fields)
        law, used = self.law(fields), quadratic_basis(T) @ threshold.coefficients.T
        assert not threshold.exact.all()
        assert (used <= law + 1e-4).all()  # an analytic field may dip a little below the cubic through the points
        assert (used[[69, 330, 670, 930]] <= law[[69, 330, 670, 930]] + 1e-9).all()  # at the points
        assert is_nonnegative(threshold.coefficients).all()
        assert used.mean() > 0.6 * law.mean()
        assert used[:, threshold.exact] == pytest.approx(law[:, threshold.exact], abs=1e-9)

    def test_a_jump_counts_as_its_lower_side(self):
        mu = np.tile([0.3, 0.3, 0.0, 0.0], 3)
        threshold = strict_threshold(edge_problem(mu=mu).strictly(), np.ones(12))
        assert threshold.coefficients == pytest.approx(np.zeros((3, 3)), abs=1e-15)
        assert not threshold.exact.any()
        assert frictionless_edges(edge_problem(mu=mu).strictly()).all()

    def test_pressure_of_a_bilateral_edge(self):
        """|σ_N| where it has one sign, 0 where not, continuous in between; the larger end counts up to 4 times."""
        qvi = edge_problem(edges=4, bilateral=np.ones(16, bool)).strictly()
        ends = np.array([[-1.0, -2.0], [1.0, 9.0], [-1.0, 1e-3], [1e-9, 5.0]])
        normal = EDGES.at_points(ends)
        assert end_pressure(qvi, normal) == pytest.approx(
            np.array([[1.0, 2.0], [1.0, 4.0], [0.0, 0.0], [0.0, 0.0]]), abs=1e-8
        )
        assert strict_bound(qvi, normal).exact.tolist() == [True, False, False, False]
        assert strict_pressure(qvi, normal)[:4] == pytest.approx(np.abs(normal[:4]))

    def test_pressure_of_a_unilateral_edge(self):
        qvi = edge_problem(edges=2).strictly()
        assert end_pressure(qvi, EDGES.at_points(np.array([[-1.0, 0.5], [-3.0, -2.0]]))) == pytest.approx(
            np.array([[1.0, 0.0], [3.0, 2.0]])
        )
        assert EDGES.ends(affine_pressure(qvi, EDGES.at_points(np.array([[-1.0, 2.0], [1.0, 1.0]])))) == pytest.approx(
            np.array([[0.0, 2.0], [1.0, 1.0]])
        )


NAMES = [*available("strict"), *available("strict-direct")]


class TestInner:
    """The problem for a given bound."""

    @pytest.mark.parametrize("form", ["full", "condensed"])
    @pytest.mark.parametrize("name", NAMES)
    def test_back_ends_agree(self, name, form):
        qvi = edge_problem(3, equalities=2).strictly()
        threshold = strict_threshold(qvi, np.full(qvi.m, 0.4)).coefficients
        results = []
        for inner in ("strict-direct:clarabel", name):
            shape = make_form(qvi, form)
            solver = make_inner(inner, shape.problem, 1e-12)
            result = solver.solve(shape.threshold(threshold.ravel()), shape.centre(None, None), None)
            assert result.status.usable, result.message
            results.append(shape.expand(result))
        reference, found = results
        limit = 1e-4 if name == "strict:cvxopt" else 1e-6 if name in ("strict:ecos", "strict:scs") else 1e-7
        assert found.z == pytest.approx(reference.z, abs=limit)
        residual = qvi.gradient(found.z) + qvi.N.T @ found.m_N + qvi.T.T @ found.m_T + qvi.A.T @ found.nu
        assert np.abs(residual).max() < 100 * limit
        assert qvi.edges.on_ends(found.m_N).min() > -limit
        shear = qvi.edges.bernstein(qvi.tangential(found.z))
        assert max(largest(shear - threshold).max(), largest(-shear - threshold).max()) < limit

    def test_it_is_the_minimum(self):
        """No worse than any admissible point, better than without the bounds between points is impossible."""
        qvi = edge_problem(2).changed(mu=np.zeros(12), cohesion=np.full(12, 0.4)).strictly()
        strict = solve_qvi(qvi)
        loose = solve_qvi(qvi.changed(strict=False), inner="direct:clarabel")
        assert strict.status is loose.status is Status.SOLVED
        assert excess(qvi, loose.z) > 1e-3
        assert excess(qvi, strict.z) < 1e-8
        assert qvi.energy(strict.z) > qvi.energy(loose.z) + 1e-6
        random = np.random.default_rng(0)
        for _ in range(200):
            other = strict.z + 10.0 ** random.uniform(-4, 0) * random.normal(size=qvi.n)
            ends = qvi.edges.ends(qvi.normal(other))
            if ends.max() <= 0.0 and excess(qvi, other) <= 0.0:
                assert qvi.energy(other) >= qvi.energy(strict.z)

    def test_cvxpy_is_canonicalised_once(self):
        qvi = edge_problem(6).strictly()
        solver = StrictSOCPSolver(qvi, "clarabel", 1e-10)
        form = make_form(qvi, "full")
        assert solver.problem.is_dpp()
        first = solver.solve(np.full(9, 0.1), form.centre(None, None), None)
        cache = solver.problem._cache.param_prog
        second = solver.solve(np.full(9, 0.2), form.centre(None, None), None)
        assert cache is not None
        assert solver.problem._cache.param_prog is cache
        assert np.abs(first.z - second.z).max() > 1e-4

    def test_direct_solver_forgets_the_last_bound(self):
        qvi = edge_problem(5).strictly()
        form = make_form(qvi, "full")
        kept = make_inner("strict-direct:clarabel", qvi, 1e-12)
        kept.solve(np.full(9, 0.05), form.centre(None, None), None)
        again = kept.solve(np.full(9, 0.3), form.centre(None, None), None)
        fresh = make_inner("strict-direct:clarabel", qvi, 1e-12).solve(np.full(9, 0.3), form.centre(None, None), None)
        assert again.z == pytest.approx(fresh.z, abs=1e-9)

    def test_exceptions_become_a_status(self, monkeypatch):
        def broken(*_: object, **__: object) -> None:
            raise ValueError("matrix of straw")

        monkeypatch.setattr("cvxpy.Problem.solve", broken)
        solution = solve_qvi(edge_problem(), inner="strict:clarabel")
        assert solution.status is Status.BACKEND_FAILED
        assert "matrix of straw" in solution.message

    def test_a_bound_that_no_shear_keeps_is_infeasible(self):
        """Everything is prescribed; the shear exceeds the bound in the middle of the edge and nowhere at its points."""
        shear = np.array([[0.0, 1.0, 0.0]])
        qvi = FrictionQVI(
            K=np.eye(1), f=np.zeros(1), N=np.zeros((4, 1)), n0=-np.ones(4), T=np.zeros((4, 1)),
            t0=EDGES.at_points(shear), mu=np.full(4, 0.49), W=WEIGHTS, edges=EDGES,
        )  # fmt: skip
        assert solve_qvi(qvi, inner="direct:clarabel").status is Status.SOLVED
        assert solve_qvi(qvi, inner="strict-direct:clarabel").status is Status.INNER_INFEASIBLE
        strict = qvi.strictly()  # what back ends sometimes misread is seen before they are asked
        threshold = strict_threshold(strict, np.ones(4)).coefficients.ravel()
        assert strict_contradiction(strict, threshold, Centre(strict, np.zeros(1))) is not None
        assert strict_contradiction(strict, 2.0 * threshold, Centre(strict, np.zeros(1))) is None
        carried = qvi.changed(mu=np.full(4, 0.5))
        assert solve_qvi(carried, inner="strict-direct:clarabel").status is Status.SOLVED


LAWS = {
    "coulomb": {},
    "cohesion": {"cohesion": np.full(12, 0.2)},
    "cap": {"cohesion": np.full(12, 0.1), "cap": np.full(12, 0.3)},
    "bilateral": {"bilateral": np.repeat([True, False, True], 4)},
    "partly frictionless": {"mu": np.repeat([0.0, 0.3, 0.5], 4)},
    "frictionless": {"mu": np.zeros(12)},
    "tresca": {"mu": np.zeros(12), "cohesion": np.full(12, 0.3)},
}


@pytest.mark.parametrize("form", ["full", "condensed"])
@pytest.mark.parametrize("law", LAWS)
def test_laws(law, form):
    qvi = edge_problem(4, friction=0.2, equalities=1, **LAWS[law])
    solution = solve_qvi(qvi, inner="strict-direct:clarabel", form=form, tolerance=1e-9)
    assert solution.status is Status.SOLVED, solution.message
    assert solution.problem.strict
    assert excess(qvi, solution.z) < 1e-9
    assert solution.form == form
    ends = qvi.edges.ends(qvi.normal(solution.z))
    assert ends[~qvi.bilateral[::4]].max() < 1e-9


@pytest.mark.parametrize("form", ["full", "condensed"])
def test_an_edge_on_which_friction_ends_carries_none(form):
    """The bound at two of its points is zero, so the safe one is: an equation for the edge, not for two points."""
    qvi = edge_problem(4, mu=np.array([0.3, 0.3, 0.0, 0.0, *[0.3] * 8]))
    solution = solve_qvi(qvi, inner="strict-direct:clarabel", form=form)
    assert solution.status is Status.SOLVED
    shear = qvi.edges.bernstein(qvi.tangential(solution.z))
    assert np.abs(shear[0]).max() < 1e-9
    assert np.abs(shear[1:]).max() > 1e-2


def opening(shear=0.1):
    """Six edges that share σ_T at nodes; the bound falls to zero at the end of the third, and stays there."""
    random = np.random.default_rng(5)
    nodes, middles = random.normal(size=(7, 42)), random.normal(size=(6, 42))
    at_nodes, in_middles = shear * random.normal(size=7), shear * random.normal(size=6)
    ends = np.maximum(0.3 - 0.1 * np.arange(7), 0.0)
    return edge_problem(
        5,
        edges=6,
        T=np.vstack([EDGES.quadratic @ np.stack([nodes[i], middles[i], nodes[i + 1]]) for i in range(6)]),
        t0=EDGES.at_points(np.column_stack([at_nodes[:-1], in_middles, at_nodes[1:]])),
        mu=np.zeros(24),
        cohesion=EDGES.at_points(np.column_stack([ends[:-1], ends[1:]])),
    )


class TestBoundsThatAreZeroAtAnEnd:
    """Where friction ends, or contact opens."""

    def test_a_quadratic_that_is_zero_at_an_end_is_nonnegative_if_its_coefficients_are(self):
        b = np.random.default_rng(1).normal(size=(1000, 3))
        b[:500, 0] = b[500:, 2] = 0.0
        found = (b >= 0.0).all(axis=1)
        assert 200 < found.sum() < 300
        assert (is_nonnegative(b) == found).all()

    def test_which_coefficients_are_held(self):
        theta = np.array([[2.0, 1.0, 0.0], [1e-15, 1.0, 1.0], [0.0, 0.5, 0.0], [1e-15, 0.0, 1e-18], [1.0, 0.0, 1.0]])
        held = np.array([[0, 0, 1], [1, 0, 0], [1, 0, 1], [1, 1, 1], [0, 0, 0]], dtype=bool)
        assert (closed_coefficients(theta, 1.0) == held).all()
        assert (closed_coefficients(1e-12 * theta, 1e-12) == held).all()
        assert (closed_coefficients(np.vstack([theta, np.full(3, 1e15)]), 1.0)[:5] == held).all()  # as good as stick
        touching = np.array([[1.0, -1e-6, 1e-12], [1.0, 1.0, 1.0]])  # almost (1 − t)²: below zero with the end at zero
        assert not closed_coefficients(touching, 1.0).any()
        assert not closed_coefficients(theta[:0], 1.0).size

    @pytest.mark.parametrize("form", ["full", "condensed"])
    def test_it_is_the_limit_of_small_bounds(self, form):
        """Which are cones on every edge. With b₂ the middle coefficient gains √(b₀b₂), so the root of it counts."""
        found = solve_qvi(opening(), inner="strict-direct:clarabel", form=form)
        assert found.status is Status.SOLVED
        shear = EDGES.bernstein(found.problem.tangential(found.z))
        assert np.abs(shear[3:]).max() < 1e-12
        assert np.abs(shear[:3, 0]).max() > 1e-2
        away = []
        for bound in (1e-4, 1e-5):
            qvi = opening()
            larger = solve_qvi(qvi.changed(cohesion=qvi.cohesion + bound), inner="strict-direct:clarabel")
            assert larger.status is Status.SOLVED
            away.append(np.abs(larger.z - found.z).max())
        assert away[0] < 1e-2 * np.abs(found.z).max()
        assert away[0] == pytest.approx(np.sqrt(10.0) * away[1], rel=0.1)

    def test_rounding_in_place_of_zero_changes_nothing(self):
        qvi = opening()
        first = solve_qvi(qvi, inner="strict-direct:clarabel")
        second = solve_qvi(qvi.changed(cohesion=qvi.cohesion + 1e-17), inner="strict-direct:clarabel")
        size = np.abs(first.z).max()
        assert second.z == pytest.approx(first.z, abs=1e-10 * size)
        forces = [qvi.T.T @ solution.tangential_multiplier for solution in (first, second)]
        assert forces[0] == pytest.approx(forces[1], abs=1e-8 * np.abs(forces[0]).max())

    def test_multipliers_of_equations_that_are_said_twice_stay_small(self, monkeypatch):
        """Only the sum of the two at a node counts: an interior point method drives them apart without end."""
        monkeypatch.setattr(Newton, "affordable", False)
        found = solve_qvi(opening(), inner="strict-direct:clarabel")
        assert found.certificate.accuracy < 1e-9
        working = np.abs(found.tangential_multiplier[:12]).max()
        assert np.abs(found.tangential_multiplier).max() < 30.0 * working

    @pytest.mark.parametrize("constant", [0.0, 0.2])
    def test_a_shear_that_nothing_changes(self, constant):
        """At the end of the contact the free side prescribes it: the law holds only if it is zero too."""
        qvi = opening()
        gone = qvi.T.toarray().reshape(6, 4, -1)
        gone[5] -= EDGES.quadratic[:, 2:] * (EDGES.to_bernstein @ gone[5])[2]
        t0 = EDGES.bernstein(qvi.t0)
        t0[5, 2] = constant
        fixed = qvi.changed(T=gone.reshape(24, -1), t0=EDGES.at_points(t0))
        found = solve_qvi(fixed, inner="strict-direct:clarabel")
        assert found.solved == (constant == 0.0)
        assert constant == 0.0 or found.status in (Status.INFEASIBLE, Status.INNER_INFEASIBLE)


def test_where_clarabel_breaks_down_it_tries_again_with_steadier_systems(monkeypatch):
    """With the settings that give the last digits it does so on meshes of 128 × 8 cells."""
    expected, solve, seen = solve_qvi(opening(), inner="strict-direct:clarabel"), _Program.solve, []

    def breaks(self, theta, centre):
        seen.append(self._solver.get_settings().static_regularization_constant)
        answer = solve(self, theta, centre)
        if seen[-1] >= 1e-11:
            return answer
        nothing = {"x": np.full(len(answer.x), np.nan), "z": np.full(len(answer.z), np.nan)}
        return SimpleNamespace(status="NumericalError", iterations=6, **nothing)

    monkeypatch.setattr(_Program, "solve", breaks)
    found = solve_qvi(opening(), inner="strict-direct:clarabel")
    assert found.status is Status.SOLVED
    assert found.z == pytest.approx(expected.z, abs=1e-8 * np.abs(expected.z).max())
    assert seen[0] < 1e-11  # once, and then no more
    assert min(seen[1:]) >= 1e-11


class TestCertificate:
    """What passes, and what does not."""

    @pytest.fixture(scope="class")
    @staticmethod
    def solution():
        return solve_qvi(edge_problem(2), inner="strict-direct:clarabel")

    @staticmethod
    def failed(solution, **changes):
        """Names of the measures that fail for an altered solution."""
        parts = {
            "z": solution.z,
            "m_N": solution.normal_multiplier,
            "m_T": solution.tangential_multiplier,
            **changes,
        }
        certificate = certify(solution.problem, parts["z"], parts["m_N"], parts["m_T"], np.zeros(0))
        return {name for name, limit in certificate.limits.items() if certificate.measures[name] > limit}

    def test_it_passes_with_room(self, solution):
        assert solution.status is Status.SOLVED
        assert solution.certificate.accuracy < 1e-9
        assert np.abs(solution.tangential_multiplier).max() > 1e-3
        assert not self.failed(solution)

    def test_other_multipliers_of_the_same_functional_pass(self, solution):
        """Rows of an edge depend on each other: what they do to quadratics is all that counts."""
        null = np.linalg.svd(EDGES.quadratic.T)[2][-1]
        other = solution.tangential_multiplier + np.tile(null, 3)
        assert not self.failed(solution, m_T=other)

    def test_wrong_signs(self, solution):
        assert {"sign", "stationarity"} <= self.failed(solution, m_T=-solution.tangential_multiplier)

    def test_a_push_on_an_open_end(self, solution):
        ends = np.zeros((3, 2))
        ends[int(np.argmin(EDGES.ends(solution.problem.normal(solution.z)).min(axis=1)))] = 1e-3
        pushed = solution.normal_multiplier + EDGES.rows(ends)
        assert {"complementarity_normal", "stationarity", "natural_map"} <= self.failed(solution, m_N=pushed)
        assert "sign" in self.failed(solution, m_N=solution.normal_multiplier - EDGES.rows(ends))

    def test_a_slip_below_the_bound(self, solution):
        """A functional that works, but less than friction could, is no slip."""
        qvi = solution.problem
        theta = strict_bound(qvi, qvi.normal(solution.z)).coefficients
        room = quadratic_basis(T) @ theta.T - np.abs(quadratic_basis(T) @ EDGES.bernstein(qvi.tangential(solution.z)).T)
        place, edge = np.unravel_index(np.argmax(room), room.shape)
        functional = np.zeros((3, 3))
        functional[edge] = 0.01 * quadratic_basis(T[place])
        found = self.failed(solution, m_T=solution.tangential_multiplier + EDGES.rows(functional))
        assert {"complementarity_tangential", "bipotential"} <= found

    def test_the_collocated_solution_fails_on_friction(self, solution):
        loose = solve_qvi(edge_problem(2), inner="direct:clarabel")
        assert loose.status is Status.SOLVED
        assert "friction" in self.failed(dataclasses.replace(loose, problem=solution.problem))

    def test_scaled_problems_have_the_same_measures(self, solution):
        """Other units of stress and length, and other unknowns: every measure of a wrong state is the same."""
        qvi = solution.problem
        worse, z = 1.01 * solution.tangential_multiplier, 1.01 * solution.z
        first = certify(qvi, z, solution.normal_multiplier, worse)
        a, d, c = 7.0, 0.03, 11.0  # stresses times a, displacements times d, unknowns over c
        scaled = qvi.changed(N=a * c * qvi.N, n0=a * qvi.n0, T=a * c * qvi.T, t0=a * qvi.t0, f=a * d * c * qvi.f)
        scaled = dataclasses.replace(scaled, K=a * d * c**2 * qvi.K)
        second = certify(scaled, z / c, d * solution.normal_multiplier, d * worse)
        for name, value in first.measures.items():
            assert second.measures[name] == pytest.approx(value, rel=1e-6, abs=1e-12), name


def test_newton_ends_in_the_solution():
    """From a state that is off by a percent; no better than its start where that is far away and nothing fits."""
    solution = solve_qvi(edge_problem(2), inner="strict-direct:clarabel")
    qvi, newton = solution.problem, Newton(solution.problem)
    m_N, m_T = 1.01 * solution.normal_multiplier, 0.99 * solution.tangential_multiplier
    z, _ = newton.compliance.unknowns(np.concatenate([m_N, m_T]))
    assert not certify(qvi, z, m_N, m_T).passed
    refined = newton.refine(z, m_N, m_T, qvi.contact_stiffness)
    assert refined is not None
    assert refined.steps < 10
    z, _ = newton.compliance.unknowns(np.concatenate([refined.m_N, refined.m_T]))
    assert z == pytest.approx(solution.z, abs=1e-10)


def test_without_newton_it_is_the_same(monkeypatch):
    qvi = edge_problem(6)  # with other data rounding decides from which iteration on Newton's method leads anywhere
    refined = solve_qvi(qvi, inner="strict-direct:clarabel")
    monkeypatch.setattr(Newton, "affordable", False)
    plain = solve_qvi(qvi, inner="strict-direct:clarabel")
    assert plain.status is refined.status is Status.SOLVED
    assert plain.iterations > refined.iterations
    assert plain.z == pytest.approx(refined.z, abs=1e-7)
