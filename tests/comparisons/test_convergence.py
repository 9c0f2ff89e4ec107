"""Convergence: rates of known sequences, the outer loop and Uzawa's iteration beside theory, orders in the mesh."""

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.convergence import bodies, linearised, mesh
from comparisons.convergence import outer as loops
from comparisons.convergence import uzawa as steps
from solvers import solve_qvi
from solvers.certificate import uniqueness_bound
from tests.comparisons.conftest import committed


class TestRates:
    """Sequences whose course is known."""

    @pytest.mark.parametrize("factor", [0.05, 0.5, 0.98])
    def test_geometric(self, factor):
        rate = linearised.rate_of(factor ** np.arange(100.0))
        assert rate.course == "converges"
        assert rate.factor == pytest.approx(factor, rel=1e-9)
        assert rate.low == pytest.approx(rate.high)

    def test_noise_and_outliers_stay_in_the_interval(self):
        random = np.random.default_rng(1)
        residuals = 0.7 ** np.arange(40.0) * np.exp(random.normal(scale=0.1, size=40))
        residuals[30] *= 50.0
        rate = linearised.rate_of(residuals)
        assert rate.low < 0.7 < rate.high
        assert rate.high - rate.low < 0.05

    def test_only_the_tail_above_rounding_counts(self):
        residuals = [*0.99 ** np.arange(40.0), *0.5 * 0.6 ** np.arange(41.0)]
        assert linearised.rate_of(residuals).factor == pytest.approx(0.6, rel=0.02)
        assert linearised.rate_of([*0.1 ** np.arange(10.0), 1e-16, 4e-16, 2e-16]).factor == pytest.approx(0.1)

    @pytest.mark.parametrize("period", [[1.0], [1.0, 0.5], [1.0, 0.2, 0.7], list(range(1, 9))])
    def test_cycles(self, period):
        assert linearised.rate_of([3.0, 2.0, *(period * 20)]).course == "cycles"

    def test_growth_diverges(self):
        rate = linearised.rate_of(1e-3 * 1.2 ** np.arange(30.0))
        assert (rate.course, rate.factor) == ("diverges", pytest.approx(1.2))
        assert {linearised.rate_of([1.0, 0.5, float(end)]).course for end in ("nan", "inf")} == {"diverges"}

    def test_no_trend_wanders(self):
        assert (
            linearised.rate_of(0.995 ** np.arange(60.0)).course == "wanders"
        )  # less than half of it in all that is fitted
        assert linearised.rate_of(np.exp(np.random.default_rng(2).normal(size=60))).course == "wanders"

    def test_a_new_start_forgets_what_was_before(self):
        rate = linearised.rate_of([*1.5 ** np.arange(20.0), float("inf"), *0.3 ** np.arange(6.0)])
        assert (rate.course, rate.factor, rate.fitted) == ("converges", pytest.approx(0.3), 6)

    def test_few_residuals(self):
        assert linearised.rate_of([1.0, 0.1, 0.01]).course == linearised.rate_of([]).course == "short"
        found = linearised.rate_of([1.0, 1e-9], target=1e-8)
        assert (found.course, found.factor) == ("converges", None)

    def test_first_lasting(self):
        numbers = range(1, 11)
        assert linearised.first_lasting([1, 1e-3, 1, 1e-3, *[1e-4] * 6], numbers, 1e-3) == 4
        assert linearised.first_lasting([0.0] * 10, numbers, 1e-3) == 1
        assert linearised.first_lasting([*[1.0] * 8, 0.0, 0.0], numbers, 1e-3) is None
        assert linearised.first_lasting([*[0.0] * 9, float("nan")], numbers, 1e-3) is None
        assert linearised.first_lasting([1.0, 1.0, 0.0, 0.0], [1, 2, 100, 1000], 0.5) == 100

    def test_growth_order(self):
        sizes = [2.0, 4.0, 8.0, 16.0]
        assert linearised.growth_order(sizes, [3.0 * size**1.5 for size in sizes]) == pytest.approx(1.5)
        assert linearised.growth_order(sizes[:2], sizes[:2]) is None


def plain(qvi):
    return solve_qvi(qvi, **loops.LOOPS["plain"].options())


def observed(found, target=0.0):
    """The rate of a solve's residuals."""
    return linearised.rate_of([entry.residual for entry in found.history], target)


class TestProblems:
    """What is said of the problems without a mesh is so."""

    @pytest.mark.parametrize("half_open", [False, True])
    def test_the_state_the_loads_were_made_for_is_found(self, half_open):
        solution = solve_qvi(bodies.contacts(0.7, half_open, cohesion=0.3), method="condensed")
        closed = (np.arange(bodies.POINTS) % 2 == 0) | (not half_open)
        pressure = np.where(closed, 1.0 + 0.3 * np.cos(np.arange(bodies.POINTS)), 0.0)
        assert solution.solved
        assert solution.z == pytest.approx(np.concatenate([pressure, 0.3 + 0.7 * pressure]), abs=1e-8)
        local = bodies.reference("half open" if half_open else "contacts", 0, 0.7).linearised
        assert local.slipping.all() or half_open
        assert (local.open == ~closed).all()

    @pytest.mark.parametrize("loop", ["plain", "damped 0.5", "damped 0.25"])
    @pytest.mark.parametrize("friction", [0.5, 1.1])
    def test_observed_contraction_is_the_exact_one(self, loop, friction):
        found = solve_qvi(bodies.contacts(friction), **loops.LOOPS[loop].options())
        exact = bodies.exact_contraction(friction, loops.LOOPS[loop].damping)
        assert found.solved
        # the other modes have not died out where they are almost as slow, and then make the loop look faster
        rate = observed(found, 1e-8).factor
        assert rate == pytest.approx(exact, rel=2e-3 if loop == "plain" else 0.12)
        assert rate <= exact * (1.0 + 1e-3)

    @pytest.mark.parametrize("damping", [1.0, 0.5])
    def test_linearised_contraction_is_the_exact_one(self, damping):
        local = bodies.reference("contacts", 0, 1.5).linearised
        assert local.outer_contraction(damping) == pytest.approx(bodies.exact_contraction(1.5, damping), rel=1e-8)

    def test_linearised_contraction_on_a_mesh(self):
        qvi, local = bodies.body("ssnv128", 4, 1.0).qvi, bodies.reference("ssnv128", 4, 1.0).linearised
        assert observed(plain(qvi)).factor == pytest.approx(local.outer_contraction(), rel=0.05)

    def test_plain_fails_just_beyond_its_limit(self):
        assert bodies.exact_contraction(1.25) == pytest.approx(1.0)
        below, above = (plain(bodies.contacts(mu)) for mu in (1.1, 1.5))
        assert below.solved
        assert (above.status, observed(above).course) == ("cycling", "cycles")

    def test_the_bound_is_one(self):
        for friction in (0.3, 1.0):
            assert bodies.COUPLINGS.max() * friction <= friction / uniqueness_bound(bodies.contacts(friction)).sharper

    def test_dragged_block_carries_what_is_claimed(self):
        assert solve_qvi(bodies.body("block", 2, 0.15).qvi).solved
        assert solve_qvi(bodies.body("block", 2, 0.09).qvi).status == "infeasible"
        assert bodies.dragged_block(0.3, (4, 2)).mesh.length == pytest.approx(2.0)


def case(run, place, tangential=None, normal=None, target=None):
    return {"run": run, "place": place, "tangential": tangential, "normal": normal, "target": target}


class TestSteps:
    """The observed limits of the steps of Uzawa's iteration are those of theory where theory is exact."""

    def test_sliding_contacts_have_the_limit_known_by_hand(self):
        found = steps.run(case("tangential limit", ("sliding", 0, 0.0), normal=0.5))
        assert found["limit_T"] == pytest.approx(bodies.SLIDING_LIMIT, rel=1e-10)
        assert found["slipping_T"] == pytest.approx(bodies.SLIDING_LIMIT, rel=1e-10)
        assert found["foreseen"] == pytest.approx(1.0, abs=1e-3)
        assert 0.95 < found["largest"] < 1.0 < found["smallest"] < 1.04
        assert found["settles"]

    def test_the_limit_is_two_over_the_largest_eigenvalue(self):
        """By the matrix of the dual operator, taken from the definition."""
        known = bodies.reference("plate", 4, 0.1)
        qvi, local = known.body.qvi, known.linearised
        B = qvi.contact_rows.toarray()
        weights = np.sqrt(np.concatenate([qvi.W, qvi.W]))
        C = weights[:, None] * (B @ np.linalg.solve(qvi.K.toarray(), B.T)) * weights
        root = 1.0 / np.sqrt(qvi.threshold(qvi.pressure(known.solution.z)))
        tangential = np.linalg.eigvalsh(root[:, None] * C[qvi.m :, qvi.m :] * root)[-1]
        assert local.tangential_limit(everywhere=True) == pytest.approx(2.0 / tangential, rel=1e-8)
        normal = np.linalg.eigvalsh(C[: qvi.m, : qvi.m])[-1]
        assert local.normal_limit(everywhere=True) == pytest.approx(2.0 / normal, rel=1e-8)
        assert local.normal_limit() is None
        assert local.tangential_limit() > local.tangential_limit(everywhere=True)

    @pytest.mark.parametrize("steps", [(0.35, 0.5), (0.6, 0.25), (0.2, 1.0)])
    def test_linearised_contraction_of_both_steps(self, steps):
        """Open and slipping points: λ shrinks as the linearised iteration says."""
        known = bodies.reference("half open", 0, 0.3)
        local = known.linearised
        omega_T = steps[0] * local.tangential_limit(everywhere=True)
        omega_N = steps[1] * local.normal_limit(everywhere=True)
        found = solve_qvi(
            known.body.qvi, method="uzawa", tolerance=1e-8, omega_T=omega_T, omega_N=omega_N, iterations=100
        )
        errors = np.array([entry.residual for entry in found.history])[40:80]
        rate = np.exp(np.polyfit(np.arange(len(errors)), np.log(errors), 1)[0])
        assert rate == pytest.approx(local.uzawa_contraction(omega_T, omega_N), abs=0.02)

    def test_without_open_points_the_normal_step_has_no_limit(self):
        found = steps.run(case("normal limit", ("plate", 2, 0.1), tangential=0.5))
        assert found["open"] == 0
        assert (found["largest"], found["smallest"], found["foreseen"]) == (steps.SEARCHED[1], None, None)

    def test_steps_too_long_never_settle_and_too_short_ones_are_still_and_not_there(self):
        long, short = (steps.run(case("map", ("plate", 2, 0.1), step, 0.5)) for step in (1.5, 0.01))
        assert not long["settles"]
        assert not short["settles"]
        assert long["last_error"] < steps.NEAR < short["last_error"]  # the force alone would not show it
        assert long["last_change"] > 10.0 * steps.STILL > steps.STILL > short["last_change"]
        assert long["linearised"] > 1.0
        assert not long["certificate"]["passed"]

    def test_what_rounding_leaves_of_a_pressure_is_no_bound(self):
        """Of an open point the limit would be that of a bound of 1e-16: no step at all."""
        local = bodies.reference("ssnv128", 4, 1.0).linearised
        assert local.open.any()
        assert not local.threshold[local.open].any()
        assert local.tangential_limit(everywhere=True) > 1e-3

    def test_without_friction_there_is_no_limit_to_be_a_share_of(self):
        with pytest.raises(ArithmeticError):
            steps.run(case("map", ("plate", 2, 0.0), tangential=0.5, normal=0.5))
        assert bodies.reference("plate", 2, 0.0).linearised.uzawa_contraction(1e-3, 1e-3) == np.inf


class TestOrders:
    """Slopes of made-up errors."""

    def test_a_power_law_has_its_power(self):
        h = [1.0, 0.5, 0.25, 0.1]
        assert mesh.fitted_order(h, [3.0 * size**1.7 for size in h]) == pytest.approx(1.7)

    def test_the_last_three_decide(self):
        h = [1.0, 0.5, 0.25, 0.125]
        line = np.polyfit(np.log(h[1:]), np.log([0.3, 0.04, 0.015]), 1)
        assert mesh.fitted_order(h, [7.0, 0.3, 0.04, 0.015]) == pytest.approx(line[0])


class TestCorner:
    """Exponents of Williams' expansion."""

    @pytest.mark.parametrize("friction", mesh.CORNER)
    def test_the_conditions_on_both_faces_are_dependent(self, friction):
        """Rows: u_θ and u_r or σ_rθ − μ σ_θθ on the face of the contact, σ_θθ and σ_rθ on the free one."""
        power, kappa = mesh.CORNER[friction], (3.0 - 0.3) / (1.0 + 0.3)

        def shape(angle):  # F and F′ by a, b, c, d
            outer, inner = (power + 1.0) * angle, (power - 1.0) * angle
            value = np.array([np.cos(outer), np.sin(outer), np.cos(inner), np.sin(inner)])
            slope = [-value[1] * (power + 1), value[0] * (power + 1), -value[3] * (power - 1), value[2] * (power - 1)]
            return value, np.array(slope)

        (value, slope), free = shape(0.0), shape(np.pi / 2.0)
        across = -slope - (kappa + 1.0) * np.array([0.0, 0.0, 0.0, 1.0])
        held = -(power + 1.0) * value + (kappa + 1.0) * np.array([0.0, 0.0, 1.0, 0.0])
        along = held if friction is None else -slope - friction * (power + 1.0) * value
        assert np.linalg.det(np.stack([across, along, *free])) == pytest.approx(0.0, abs=1e-12)
        if friction is None:  # the classical equation
            expected = (kappa + 1.0) ** 2 / (4.0 * kappa) - power**2 / kappa
            assert np.sin(power * np.pi / 2.0) ** 2 == pytest.approx(expected, rel=1e-10)


def test_costs_are_those_of_lasting_errors():
    def cost(errors, target):
        points = DataFrame({"unknowns": 64.0 * 4.0 ** np.arange(len(errors)), "error": np.array(errors, dtype=float)})
        return mesh.cost(points, target)

    found = [1e-2, 1e-5, 1e-3, 1e-4]
    assert (cost(found, 1e-3), cost(found, 1e-4)) == (256, 4096)
    assert cost([1e-3, 1e-6, 1e-4, 1e-5], 2e-5) == 4096  # what is small by chance does not count
    assert cost(found, 1e-5) == np.inf
    assert np.isnan(cost([], 1.0))


def test_findings_of_the_committed_rows():
    """What a user would act on."""
    rows = committed("convergence-mesh")
    values = mesh.values_of(mesh.meshes_of(rows))
    assert values["paper_missed"] == 3
    assert values["graded_missed"] == 0
    assert values["adaptive_missed"] == 0
    assert values["inside"] == values["bounded"] > 40
    assert values["reached"]["degree 3"] < values["reached"]["degree 4"] < values["reached"]["degree 6"]
