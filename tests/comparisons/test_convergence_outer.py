"""Convergence of the outer loop: rates of known sequences, problems with a known contraction, study and report."""

from dataclasses import replace

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from comparisons.convergence.bodies import (
    COUPLINGS,
    PLACE,
    POINTS,
    body,
    contacts,
    dragged_block,
    exact_contraction,
    reference,
)  # fmt: skip
from comparisons.convergence.linearised import linearised
from comparisons.convergence.outer import figures
from comparisons.convergence.outer.measures import on_meshes, runs_of, solution_found, tables_of, values_of
from comparisons.convergence.outer.report import report
from comparisons.convergence.outer.study import LOOPS, run, study, study_of
from comparisons.convergence.rates import first_lasting, growth_order, rate_of
from comparisons.lab.report import write_report
from comparisons.lab.study import DONE
from qvi_contact.plots import has_matplotlib
from solvers import solve_qvi
from solvers.uniqueness import uniqueness_bound
from tests.comparisons.convergence_parts import committed_text, made_again, rows_of

TINY = {("contacts", 0): (0.5, 2.0), ("plate", 2): (0.1,), ("plate", 3): (0.1,), ("three", 0): (2.0,)}


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

    def test_only_the_tail_counts(self):
        residuals = [*0.99 ** np.arange(40.0), *0.5 * 0.6 ** np.arange(41.0)]
        assert rate_of(residuals).factor == pytest.approx(0.6, rel=0.02)

    def test_rounding_does_not_count(self):
        assert rate_of([*0.1 ** np.arange(10.0), 1e-16, 4e-16, 2e-16]).factor == pytest.approx(0.1)

    @pytest.mark.parametrize("period", [[1.0], [1.0, 0.5], [1.0, 0.2, 0.7], list(range(1, 9))])
    def test_cycles(self, period):
        assert rate_of([3.0, 2.0, *(period * 20)]).course == "cycles"

    def test_growth_diverges(self):
        rate = rate_of(1e-3 * 1.2 ** np.arange(30.0))
        assert rate.course == "diverges"
        assert rate.factor == pytest.approx(1.2)
        assert rate_of([1.0, 0.5, float("nan")]).course == "diverges"
        assert rate_of([1.0, 0.5, float("inf")]).course == "diverges"

    def test_no_trend_wanders(self):
        assert rate_of(0.995 ** np.arange(60.0)).course == "wanders"  # less than half of it in all that is fitted
        assert rate_of(np.exp(np.random.default_rng(2).normal(size=60))).course == "wanders"

    def test_a_new_start_forgets_what_was_before(self):
        rate = rate_of([*1.5 ** np.arange(20.0), float("inf"), *0.3 ** np.arange(6.0)])
        assert (rate.course, rate.factor, rate.fitted) == ("converges", pytest.approx(0.3), 6)

    def test_few_residuals(self):
        assert rate_of([1.0, 0.1, 0.01]).course == "short"
        assert rate_of([1.0, 1e-9], target=1e-8).course == "converges"
        assert rate_of([1.0, 1e-9], target=1e-8).factor is None
        assert rate_of([]).course == "short"

    def test_first_lasting(self):
        numbers = range(1, 11)
        assert first_lasting([1, 1e-3, 1, 1e-3, *[1e-4] * 6], numbers, 1e-3) == 4
        assert first_lasting([0.0] * 10, numbers, 1e-3) == 1
        assert first_lasting([*[1.0] * 8, 0.0, 0.0], numbers, 1e-3) is None
        assert first_lasting([*[0.0] * 9, float("nan")], numbers, 1e-3) is None
        assert first_lasting([1.0, 1.0, 0.0, 0.0], [1, 2, 100, 1000], 0.5) == 100

    def test_growth_order(self):
        sizes = [2.0, 4.0, 8.0, 16.0]
        assert growth_order(sizes, [3.0 * size**1.5 for size in sizes]) == pytest.approx(1.5)
        assert growth_order(sizes[:2], sizes[:2]) is None


class TestProblems:
    """What is said of the problems without a mesh is so."""

    @pytest.mark.parametrize("half_open", [False, True])
    def test_the_state_the_loads_were_made_for_is_found(self, half_open):
        qvi = contacts(0.7, half_open, cohesion=0.3)
        solution = solve_qvi(qvi, method="condensed")
        closed = (np.arange(POINTS) % 2 == 0) | (not half_open)
        pressure = np.where(closed, 1.0 + 0.3 * np.cos(np.arange(POINTS)), 0.0)
        assert solution.solved
        assert solution.z == pytest.approx(np.concatenate([pressure, 0.3 + 0.7 * pressure]), abs=1e-8)
        local = linearised(solution)
        assert local.slipping.all()
        assert (local.open == ~closed).all()

    @pytest.mark.parametrize("loop", ["plain", "damped 0.5", "damped 0.25"])
    @pytest.mark.parametrize("friction", [0.5, 1.1])
    def test_observed_contraction_is_the_exact_one(self, loop, friction):
        found = solve_qvi(contacts(friction), **LOOPS[loop].options())
        exact = exact_contraction(friction, LOOPS[loop].damping)
        assert found.solved
        # the other modes have not died out where they are almost as slow, and then make the loop look faster
        rate = rate_of([entry.residual for entry in found.history], 1e-8).factor
        assert rate == pytest.approx(exact, rel=2e-3 if loop == "plain" else 0.12)
        assert rate <= exact * (1.0 + 1e-3)

    @pytest.mark.parametrize("damping", [1.0, 0.5])
    def test_linearised_contraction_is_the_exact_one(self, damping):
        local = reference("contacts", 0, 1.5).linearised
        assert local.outer_contraction(damping) == pytest.approx(exact_contraction(1.5, damping), rel=1e-8)

    def test_plain_fails_just_beyond_its_limit(self):
        assert exact_contraction(1.25) == pytest.approx(1.0)
        below, above = (solve_qvi(contacts(mu), **LOOPS["plain"].options()) for mu in (1.1, 1.5))
        assert below.solved
        assert above.status == "cycling"
        assert rate_of([entry.residual for entry in above.history]).course == "cycles"

    def test_the_bound_is_one(self):
        for friction in (0.3, 1.0):
            assert COUPLINGS.max() * friction <= friction / uniqueness_bound(contacts(friction)).sharper

    def test_linearised_contraction_on_a_mesh(self):
        qvi, local = body("ssnv128", 4, 1.0).qvi, reference("ssnv128", 4, 1.0).linearised
        found = solve_qvi(qvi, **LOOPS["plain"].options())
        assert rate_of([entry.residual for entry in found.history]).factor == pytest.approx(
            local.outer_contraction(), rel=0.05
        )

    def test_dragged_block_carries_what_is_claimed(self):
        assert solve_qvi(body("block", 2, 0.15).qvi).solved
        assert solve_qvi(body("block", 2, 0.09).qvi).status == "infeasible"
        assert dragged_block(0.3, (4, 2)).mesh.length == pytest.approx(2.0)


def test_studies_have_names_of_their_own():
    quick, full = study(quick=True), study(quick=False)
    assert quick.name != full.name
    assert len(quick.cases) < len(full.cases)


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a tiny study."""
    small = study_of("tiny", TINY, ("plain", "Anderson", "condensed"))
    return rows_of(small, tmp_path_factory.mktemp("outer") / "tiny.sqlite")


def found(rows):
    """The numbers of the findings."""
    return values_of(runs_of(rows))


def changed(row, **result):
    """The row with other results."""
    return replace(row, result={**row.result, **result})


@pytest.fixture(scope="module")
def committed():
    """The report of the committed rows and its numbers."""
    return made_again("outer")


class TestReport:
    """The report of a tiny study, and of the committed rows."""

    def test_all_rows_are_done_and_certified_or_not(self, rows):
        assert {row.status for row in rows} == {DONE}
        for row in rows:
            assert row.certificate["passed"] == (row.result["status"] == "solved")
            assert (row.certificate["accuracy"] <= 1e-8) == row.certificate["passed"]

    def test_its_files(self, rows, tmp_path):
        """Pictures of one problem on two meshes; on one of them a loop fails."""
        plates = [row for row in rows if row.case["problem"] == "plate"]
        plates[0] = changed(plates[0], status="cycling", course="cycles")
        assert len(write_report(report(plates, quick=True), tmp_path)) == (7 if has_matplotlib() else 2)

    def test_it_is_the_same_whatever_the_order_of_rows(self, rows, monkeypatch):
        assert_frame_equal(runs_of(rows), runs_of(rows[::-1]))  # of which pictures are made
        monkeypatch.setattr(figures, "drawn", lambda *_: "drawn")
        assert report(rows, quick=True) == report(rows[::-1], quick=True)

    def test_numbers_are_those_of_the_rows(self, rows):
        values = found(rows)
        assert values["counts"] == {"plain": (3, 4), "Anderson": (4, 4), "condensed": (4, 4)}
        assert (values["exact_runs"], values["missing"], values["limit"]) == (1, 0, None)
        assert values["exact"] < 0.01
        limits = tables_of(runs_of(rows))["limits"].to_numpy().tolist()
        assert ["8 contacts", "1 of 2", "0.5", "2 (cycling)", "none"] in limits

    @pytest.mark.usefixtures("outlined")
    def test_a_case_that_died_is_a_failure(self, rows):
        victim = next(row for row in rows if row.case["loop"] == "condensed" and row.case["problem"] == "plate")
        dead = replace(victim, status="timeout", result={}, certificate=None, reason="too long")
        made = [dead if row is victim else row for row in rows]
        values = found(made)
        assert (values["counts"]["condensed"], values["missing"]) == ((3, 4), 1)
        plates = [row for row in made if row.case["problem"] == "plate"]
        assert "1 runs ended without a result" in report(plates).text

    def test_which_solution(self, rows):
        runs = runs_of(rows)
        several = runs[runs.problem == "three"]
        ends = {(run.loop, run.start): solution_found(run) for run in several.itertuples()}
        assert ends["plain", 0.0] == "open"
        assert ends["plain", 10.0] == "stick"
        assert set(ends.values()) <= {"open", "slip", "stick"}

    def test_starts_decide_only_where_they_do(self, rows):
        several = [row for row in rows if row.case["problem"] == "three"]
        values, same = found(several), found([changed(row, normal=0.0) for row in several])
        assert (values["different"], values["started"]) == (2, 2)
        assert (same["different"], same["started"]) == (0, 2)
        assert same["starts"] == {"open": len(several), "slip": 0, "stick": 0}

    def test_meshes_of_the_same_friction_are_compared(self, rows):
        meshes = on_meshes(runs_of(rows))
        assert meshes[PLACE].to_numpy().tolist() == [["plate", 2, 0.1], ["plate", 3, 0.1]]

    def test_the_spread_from_mesh_to_mesh(self, rows):
        plates = [row for row in rows if row.case["problem"] == "plate" and row.case["loop"] == "plain"]
        far = [changed(row, factor=rate) for row, rate in zip(plates, (0.1, 0.4), strict=True)]
        spread = tables_of(runs_of(far))["spread"].to_numpy().tolist()
        assert spread == [["plate", 0.1, "2 of 2", 0.1, 0.4, pytest.approx(4.0)]]
        lost = changed(far[1], status="cycling", course="cycles")
        assert tables_of(runs_of([far[0], lost]))["spread"].share.tolist() == ["1 of 2"]

    def test_a_loop_that_was_stopped_has_not_failed_to_converge(self, rows):
        victim = next(row for row in rows if row.case["loop"] == "plain" and row.case["problem"] == "contacts")
        late = {
            "status": "max_iterations",
            "course": "converges",
            "factor": 0.96,
            "linearised": 0.96,
            "iterations": 200,
        }
        ends = [late, {**late, "status": "cycling", "course": "cycles"}]
        stopped, cycling = (runs_of([changed(row, **end) if row is victim else row for row in rows]) for end in ends)
        values = values_of(stopped)
        assert (values["limit"], values["stuck"], values["still"]) == (200, 0, 1)
        assert "0.5 (0.96)" in tables_of(stopped)["limits"].falling[0]
        values = values_of(cycling)
        assert (values["limit"], values["stuck"], values["still"]) == (None, 1, 0)
        assert values["stuck_at"] == "8 contacts at μ = 0.5"

    def test_runs_below_and_beyond_the_bound_are_counted(self, rows):
        plain = [row for row in rows if row.case["loop"] == "plain" and row.case["problem"] == "contacts"]
        values = [{"sharper": bound, "status": status} for bound, status in ((1.0, "cycling"), (0.5, "solved"))]
        made = found([changed(row, **value) for row, value in zip(plain, values, strict=True)])
        assert (made["sure"], made["sure_solved"], made["beyond"], made["beyond_solved"]) == (1, 0, 1, 1)
        assert made["farthest"] == pytest.approx(4.0)

    def test_numbers_of_the_findings(self, committed):
        _, values = committed
        expected = {
            "limit": 200, "least": 8, "most": 39, "low": 0.05, "high": 4.0, "sure": 14, "sure_solved": 14,
            "beyond": 43, "beyond_solved": 32, "mesh_runs": 42, "above": 19, "lucky": 0, "below": 209, "stuck": 3,
            "different": 5, "started": 5, "missing": 0,
        }  # fmt: skip
        assert {name: values[name] for name in expected} == expected
        assert values["counts"] == {
            "plain": (46, 57), "damped 0.75": (51, 57), "damped 0.5": (53, 57), "damped 0.25": (53, 57),
            "Anderson": (56, 57), "condensed": (57, 57),
        }  # fmt: skip
        assert values["typical"] == pytest.approx(0.05, abs=0.005)
        assert values["farthest"] == pytest.approx(15.0, abs=0.5)

    def test_the_committed_report_is_that_of_the_committed_rows(self, committed):
        text, _ = committed
        assert text == committed_text("outer")

    def test_the_task_tells_theory_and_time(self):
        case = {"problem": "contacts", "cells": 0, "friction": 1.0, "loop": "plain", "start": None}
        found = run(case)
        assert found["exact"] == pytest.approx(0.8)
        assert found["linearised"] == pytest.approx(0.8)
        assert found["factor"] == pytest.approx(0.8, rel=1e-3)
        assert found["sharper"] == pytest.approx(0.6)
        assert len(found["residuals"]) == found["iterations"]
        assert all(second > 0 for second in found["seconds"])
