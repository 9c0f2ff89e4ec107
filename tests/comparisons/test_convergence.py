"""Convergence: rates of known sequences, the outer loop and Uzawa's iteration beside theory, orders in the mesh."""

from dataclasses import replace

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.convergence import bodies, linearised
from comparisons.convergence.bodies import body, contacts, reference
from comparisons.convergence.linearised import rate_of
from comparisons.convergence.mesh import report as mesh
from comparisons.convergence.mesh.study import CORNER, PAPER
from comparisons.convergence.outer import report as outer
from comparisons.convergence.outer import study as loops
from comparisons.convergence.uzawa import report as uzawa
from comparisons.convergence.uzawa import study as steps
from comparisons.lab.studies import Study
from comparisons.paper.reference import load
from solvers import solve_qvi
from solvers.certificate import uniqueness_bound
from tests.comparisons.parts import committed, rows_of

LOOPS = {("contacts", 0): (0.5, 2.0), ("plate", 2): (0.1,), ("plate", 3): (0.1,), ("three", 0): (2.0,)}


class TestRates:
    """Sequences whose course is known."""

    @pytest.mark.parametrize("factor", [0.05, 0.5, 0.98])
    def test_geometric(self, factor):
        rate = rate_of(factor ** np.arange(100.0))
        assert rate.course == "converges"
        assert rate.factor == pytest.approx(factor, rel=1e-9)
        assert rate.low == pytest.approx(rate.high)

    def test_noise_and_outliers_stay_in_the_interval(self):
        random = np.random.default_rng(1)
        residuals = 0.7 ** np.arange(40.0) * np.exp(random.normal(scale=0.1, size=40))
        residuals[30] *= 50.0
        rate = rate_of(residuals)
        assert rate.low < 0.7 < rate.high
        assert rate.high - rate.low < 0.05

    def test_only_the_tail_above_rounding_counts(self):
        residuals = [*0.99 ** np.arange(40.0), *0.5 * 0.6 ** np.arange(41.0)]
        assert rate_of(residuals).factor == pytest.approx(0.6, rel=0.02)
        assert rate_of([*0.1 ** np.arange(10.0), 1e-16, 4e-16, 2e-16]).factor == pytest.approx(0.1)

    @pytest.mark.parametrize("period", [[1.0], [1.0, 0.5], [1.0, 0.2, 0.7], list(range(1, 9))])
    def test_cycles(self, period):
        assert rate_of([3.0, 2.0, *(period * 20)]).course == "cycles"

    def test_growth_diverges(self):
        rate = rate_of(1e-3 * 1.2 ** np.arange(30.0))
        assert (rate.course, rate.factor) == ("diverges", pytest.approx(1.2))
        assert {rate_of([1.0, 0.5, float(end)]).course for end in ("nan", "inf")} == {"diverges"}

    def test_no_trend_wanders(self):
        assert rate_of(0.995 ** np.arange(60.0)).course == "wanders"  # less than half of it in all that is fitted
        assert rate_of(np.exp(np.random.default_rng(2).normal(size=60))).course == "wanders"

    def test_a_new_start_forgets_what_was_before(self):
        rate = rate_of([*1.5 ** np.arange(20.0), float("inf"), *0.3 ** np.arange(6.0)])
        assert (rate.course, rate.factor, rate.fitted) == ("converges", pytest.approx(0.3), 6)

    def test_few_residuals(self):
        assert rate_of([1.0, 0.1, 0.01]).course == rate_of([]).course == "short"
        found = rate_of([1.0, 1e-9], target=1e-8)
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
    return rate_of([entry.residual for entry in found.history], target)


class TestProblems:
    """What is said of the problems without a mesh is so."""

    @pytest.mark.parametrize("half_open", [False, True])
    def test_the_state_the_loads_were_made_for_is_found(self, half_open):
        solution = solve_qvi(contacts(0.7, half_open, cohesion=0.3), method="condensed")
        closed = (np.arange(bodies.POINTS) % 2 == 0) | (not half_open)
        pressure = np.where(closed, 1.0 + 0.3 * np.cos(np.arange(bodies.POINTS)), 0.0)
        assert solution.solved
        assert solution.z == pytest.approx(np.concatenate([pressure, 0.3 + 0.7 * pressure]), abs=1e-8)
        local = reference("half open" if half_open else "contacts", 0, 0.7).linearised
        assert local.slipping.all() or half_open
        assert (local.open == ~closed).all()

    @pytest.mark.parametrize("loop", ["plain", "damped 0.5", "damped 0.25"])
    @pytest.mark.parametrize("friction", [0.5, 1.1])
    def test_observed_contraction_is_the_exact_one(self, loop, friction):
        found = solve_qvi(contacts(friction), **loops.LOOPS[loop].options())
        exact = bodies.exact_contraction(friction, loops.LOOPS[loop].damping)
        assert found.solved
        # the other modes have not died out where they are almost as slow, and then make the loop look faster
        rate = observed(found, 1e-8).factor
        assert rate == pytest.approx(exact, rel=2e-3 if loop == "plain" else 0.12)
        assert rate <= exact * (1.0 + 1e-3)

    @pytest.mark.parametrize("damping", [1.0, 0.5])
    def test_linearised_contraction_is_the_exact_one(self, damping):
        local = reference("contacts", 0, 1.5).linearised
        assert local.outer_contraction(damping) == pytest.approx(bodies.exact_contraction(1.5, damping), rel=1e-8)

    def test_linearised_contraction_on_a_mesh(self):
        qvi, local = body("ssnv128", 4, 1.0).qvi, reference("ssnv128", 4, 1.0).linearised
        assert observed(plain(qvi)).factor == pytest.approx(local.outer_contraction(), rel=0.05)

    def test_plain_fails_just_beyond_its_limit(self):
        assert bodies.exact_contraction(1.25) == pytest.approx(1.0)
        below, above = (plain(contacts(mu)) for mu in (1.1, 1.5))
        assert below.solved
        assert (above.status, observed(above).course) == ("cycling", "cycles")

    def test_the_bound_is_one(self):
        for friction in (0.3, 1.0):
            assert bodies.COUPLINGS.max() * friction <= friction / uniqueness_bound(contacts(friction)).sharper

    def test_dragged_block_carries_what_is_claimed(self):
        assert solve_qvi(body("block", 2, 0.15).qvi).solved
        assert solve_qvi(body("block", 2, 0.09).qvi).status == "infeasible"
        assert bodies.dragged_block(0.3, (4, 2)).mesh.length == pytest.approx(2.0)


@pytest.fixture(scope="module")
def rows():
    """Rows of a tiny study of the outer loop."""
    cases = [*loops.cases(LOOPS, ("plain", "Anderson", "condensed"))]
    return rows_of(Study("tiny", 1, "comparisons.convergence.outer.study:run", cases))


def changed(row, **result):
    """The row with other results."""
    return replace(row, result={**row.result, **result})


def of(rows, problem, loop=None):
    return [row for row in rows if row.case["problem"] == problem and loop in (None, row.case["loop"])]


def told(rows):
    """The numbers of the findings."""
    return outer.values_of(outer.runs_of(rows))


class TestOuterLoops:
    """A tiny study, and what its numbers say."""

    def test_the_task_tells_theory_and_time(self):
        found = loops.run({"problem": "contacts", "cells": 0, "friction": 1.0, "loop": "plain", "start": None})
        assert [found["exact"], found["linearised"], found["sharper"]] == pytest.approx([0.8, 0.8, 0.6])
        assert found["factor"] == pytest.approx(0.8, rel=1e-3)
        assert len(found["residuals"]) == found["iterations"]
        assert all(second > 0 for second in found["seconds"])

    def test_all_rows_are_done_and_certified_or_not(self, rows):
        assert {row.status for row in rows} == {"done"}
        for row in rows:
            assert row.certificate["passed"] == (row.result["status"] == "solved")
            assert (row.certificate["accuracy"] <= 1e-8) == row.certificate["passed"]

    def test_numbers_are_those_of_the_rows(self, rows):
        values = told(rows)
        assert values["counts"] == {"plain": (3, 4), "Anderson": (4, 4), "condensed": (4, 4)}
        assert (values["exact_runs"], values["missing"], values["limit"]) == (1, 0, None)
        assert values["exact"] < 0.01
        limits = outer.tables_of(outer.runs_of(rows))["limits"].to_numpy().tolist()
        assert ["8 contacts", "1 of 2", "0.5", "2 (cycling)", "none"] in limits
        spread = outer.tables_of(outer.runs_of(rows))["spread"]
        assert spread[["name", "friction", "share"]].to_numpy().tolist() == [["plate", 0.1, "2 of 2"]]
        assert 1.0 <= spread.spread[0] < 3.0

    @pytest.mark.usefixtures("outlined")
    def test_a_case_that_died_is_a_failure(self, rows):
        (victim, *_) = of(rows, "plate", "condensed")
        dead = replace(victim, status="timeout", result={}, certificate=None, reason="too long")
        made = [dead if row is victim else row for row in rows]
        assert (told(made)["counts"]["condensed"], told(made)["missing"]) == ((3, 4), 1)
        assert "1 runs ended without a result" in outer.report(of(made, "plate")).text

    def test_starts_decide_only_where_they_do(self, rows):
        runs = outer.runs_of(of(rows, "three"))
        ends = {(run.loop, run.start): outer.solution_found(run) for run in runs.itertuples()}
        assert (ends["plain", 0.0], ends["plain", 10.0]) == ("open", "stick")
        assert set(ends.values()) <= {"open", "slip", "stick"}
        several = of(rows, "three")
        values, same = told(several), told([changed(row, normal=0.0) for row in several])
        assert (values["different"], values["started"]) == (2, 2)
        assert (same["different"], same["started"]) == (0, 2)
        assert same["starts"] == {"open": len(several), "slip": 0, "stick": 0}

    def test_a_loop_that_was_stopped_has_not_failed_to_converge(self, rows):
        (victim, *_) = of(rows, "contacts", "plain")
        late = {"course": "converges", "factor": 0.96, "linearised": 0.96, "iterations": 200}
        ends = [{**late, "status": "max_iterations"}, {**late, "status": "cycling", "course": "cycles"}]
        stopped, cycling = ([changed(row, **end) if row is victim else row for row in rows] for end in ends)
        values = told(stopped)
        assert (values["limit"], values["stuck"], values["still"]) == (200, 0, 1)
        assert "0.5 (0.96)" in outer.tables_of(outer.runs_of(stopped))["limits"].falling[0]
        values = told(cycling)
        assert (values["limit"], values["stuck"], values["still"]) == (None, 1, 0)
        assert values["stuck_at"] == "8 contacts at μ = 0.5"


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
        known = reference("plate", 4, 0.1)
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
        known = reference("half open", 0, 0.3)
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
        local = reference("ssnv128", 4, 1.0).linearised
        assert local.open.any()
        assert not local.threshold[local.open].any()
        assert local.tangential_limit(everywhere=True) > 1e-3

    def test_without_friction_there_is_no_limit_to_be_a_share_of(self):
        with pytest.raises(ArithmeticError):
            steps.run(case("map", ("plate", 2, 0.0), tangential=0.5, normal=0.5))
        assert reference("plate", 2, 0.0).linearised.uzawa_contraction(1e-3, 1e-3) == np.inf


@pytest.fixture(scope="module")
def runs():
    """Rows of a tiny study of Uzawa's iteration."""
    quick = steps.study(True)
    wanted = {("paper", 0.0), ("paper", 0.1), ("map", 0.5), ("map", 2.0)}
    chosen = [
        case for case in quick.cases
        if case["target"] == 1e-2 or (case["run"], case["place"][2]) in wanted
        or ((case["run"], case["tangential"]) in wanted and case["normal"] == 0.5)
    ]  # fmt: skip
    return rows_of(replace(quick, cases=chosen))


@pytest.fixture
def row(runs):
    return next(row for row in runs if row.case["run"] == "paper" and row.case["place"][2] > 0)


def made(row, run, place, **result):
    """A row of another run, by hand."""
    other = {**row.case, "run": run, "place": place, "tangential": None, "normal": 0.5, "target": None}
    return replace(row, case=other, result={**row.result, **result})


def meshes(row, counts, conditions):
    """Runs at half the limits on 2², 4², … cells."""
    return [
        made(row, "mesh", ["plate", 2 ** (k + 1), 0.1], condition=condition, needed={"1e-04": count, "1e-06": None})
        for k, (count, condition) in enumerate(zip(counts, conditions, strict=True))
    ]


def searched(row, *shares, **more):
    return [
        made(row, "tangential limit", ["plate", 2 ** (k + 1), 0.1], **{
            "largest": share, "smallest": share and 1.1 * share, "foreseen": 1.5, "omega_T": (3 - k) * 5e-6,
            "limit_T": 1e-5, "slipping_T": 1e-5, **more})
        for k, share in enumerate(shares)
    ]  # fmt: skip


def found(rows):
    """The numbers of the findings."""
    return uzawa.values_of(uzawa.runs_of(rows))


class TestUzawa:
    """A tiny study, and what is computed of rows made by hand."""

    def test_the_papers_run(self, runs):
        frame = uzawa.paper_runs(uzawa.runs_of(runs)).set_index("friction")
        for friction, after in frame.after.items():
            assert after == pytest.approx(load().table[friction], abs=0.00501)
        assert frame.error[0.1] == pytest.approx(0.0033, abs=1e-4)
        assert frame["to 1e-04"][0.1] > 5 * load().iterations
        assert np.isnan(frame["to 1e-04"][0.0])

    def test_growth_with_the_mesh(self, row):
        rows = meshes(row, [10, 20, 40, 30, None], [1.0, 4.0, 16.0, 64.0, 256.0])
        (line,) = uzawa.growth(uzawa.runs_of(rows)).itertuples()
        assert (line.growth, line.most) == (pytest.approx(2.0), 40)
        assert (found(rows)["slow"], found(rows)["meshes"]) == (5, 5)
        assert uzawa.growth(uzawa.runs_of(rows[:3])).order[0] == pytest.approx(1.0)
        assert uzawa.growth(uzawa.runs_of(rows[:2])).order[0] is None
        assert np.isnan(uzawa.growth(uzawa.runs_of(meshes(row, [None], [1.0]))).most[0])
        rows = [*searched(row, 1.3, 1.2, 1.1), *meshes(row, [1, 2, 4], [1.0, 1.0, 1.0])]
        assert uzawa.growth(uzawa.runs_of(rows)).beyond[0] == "8²"

    def test_limits_beside_both_of_theory(self, row):
        values = found(searched(row, 1.3, 1.2, 0.8))
        assert (values["safe"], values["searches"], values["early"], values["foreseen"]) == (2, 3, 3, 3)
        assert (values["largest"], values["local"], values["beyond"]) == ("0.8 to 1.3", "0.533 to 0.867", 0)
        assert found(searched(row, 1.8))["beyond"] == 1
        none, every = searched(row, None, smallest=0.25), searched(row, 16.0, smallest=None)
        assert [found(none)["safe"], found(every)["safe"], found([*none, *every])["largest"]] == [0, 1, "none"]
        assert uzawa.tables_of(uzawa.runs_of(every))["limit-table"].settles.tolist()[0] == "> 16"

    @pytest.mark.usefixtures("outlined")
    def test_a_case_that_died_is_left_out_and_counted(self, runs):
        late = {"status": "timeout", "result": {}, "certificate": None}
        dead = [replace(row, **late) if row.case["target"] else row for row in runs]
        values = found(dead)
        assert (values["failed"], values["targets"]["condensed"]) == (5, (0, 0))
        assert "5 runs ended without a result" in uzawa.report(dead).text


NAN = float("nan")


class TestOrders:
    """Slopes of made-up errors."""

    def test_a_power_law_has_its_power(self):
        h = [1.0, 0.5, 0.25, 0.1]
        assert mesh.fitted_order(h, [3.0 * size**1.7 for size in h]) == pytest.approx(1.7)

    def test_equal_errors_have_order_zero(self):
        assert mesh.fitted_order([1.0, 0.5, 0.25], [0.1, 0.1, 0.1]) == pytest.approx(0.0, abs=1e-12)

    def test_the_last_three_decide(self):
        h = [1.0, 0.5, 0.25, 0.125]
        line = np.polyfit(np.log(h[1:]), np.log([0.3, 0.04, 0.015]), 1)
        assert mesh.fitted_order(h, [7.0, 0.3, 0.04, 0.015]) == pytest.approx(line[0])

    def test_errors_that_mean_nothing_are_left_out(self):
        h = [1.0, 0.5, 0.25, 0.125]
        assert np.isnan(mesh.fitted_order(h, [1.0, NAN, 0.1, NAN]))
        assert mesh.fitted_order(h, [1.0, 0.5, 0.25, NAN]) == pytest.approx(1.0)


class TestCorner:
    """Exponents of Williams' expansion."""

    @pytest.mark.parametrize("friction", CORNER)
    def test_the_conditions_on_both_faces_are_dependent(self, friction):
        """Rows: u_θ and u_r or σ_rθ − μ σ_θθ on the face of the contact, σ_θθ and σ_rθ on the free one."""
        power, kappa = CORNER[friction], (3.0 - 0.3) / (1.0 + 0.3)

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


CHOSEN = [
    *[("plate 1", "equal", 4, size) for size in (1, 2, 4)], *[("plate 1", PAPER, 3, size) for size in (2, 4, 8)],
    ("plate 0.2", "graded", 5, 4), ("plate 0.2", "adaptive", 5, 100), ("block", "equal", 4, 2),
]  # fmt: skip


@pytest.fixture(scope="module")
def small():
    """Rows of a small part of the study, through the runner."""
    cases = [dict(zip(("problem", "sequence", "degree", "size"), case, strict=True)) for case in CHOSEN]
    return rows_of(Study("small", 1, "comparisons.convergence.mesh.study:run", cases))


class TestMeshes:
    """A small study, and its report."""

    def test_all_are_certified(self, small):
        assert [row.reason for row in small if row.status != "done"] == []
        meshes = mesh.meshes_of(small)
        assert meshes.solved.all()
        values = mesh.values_of(meshes)
        assert values["certified"] == values["solves"] == len(meshes)

    def test_forces_converge_with_the_order_of_the_corner(self, small):
        meshes = mesh.meshes_of(small)
        for sequence in ("equal", PAPER):
            found = meshes[(meshes.problem == "plate 1") & (meshes.sequence == sequence)]
            assert mesh.fitted_order(found.h, found.error) == pytest.approx(1.517, abs=0.12)

    def test_degree_and_grading_pay(self, small):
        meshes = mesh.meshes_of(small)
        (graded,) = meshes.error[meshes.sequence == "graded"]
        (block,) = meshes.error[meshes.problem == "block"]
        assert graded < 1e-6
        assert block < 1e-5
        assert meshes.error[meshes.sequence == "adaptive"].iloc[-1] < 1e-4

    def test_bounds_enclose_the_settled_force(self, small):
        found = [row.result["meshes"][0]["force_bounds"] for row in small if row.case["sequence"] == "equal"][:3]
        assert all(low <= 214.367658387 <= high for low, high in found)

    def test_a_failed_row_is_shown_and_not_replaced(self, small):
        failed = replace(small[2], status="timeout", reason="more than 1 s", result={}, certificate=None)
        meshes = mesh.meshes_of([*small[:2], failed, *small[3:]])
        assert meshes[~meshes.solved][["problem", "size", "status", "message"]].to_numpy().tolist() == [
            ["plate 1", 4, "timeout", "more than 1 s"]
        ]
        assert mesh.values_of(meshes)["certified"] == len(meshes) - 1


def test_findings_of_the_committed_rows():
    """What a user would act on."""
    rows = committed("convergence-mesh")
    values = mesh.values_of(mesh.meshes_of(rows))
    assert values["paper_missed"] == 3
    assert values["graded_missed"] == 0
    assert values["adaptive_missed"] == 0
    assert values["inside"] == values["bounded"] > 40
    assert values["reached"]["degree 3"] < values["reached"]["degree 4"] < values["reached"]["degree 6"]
