"""The iteration of Uzawa: limits of its steps beside theory, the paper's run, study and report."""

from dataclasses import replace

import numpy as np
import pytest

from comparisons.convergence.bodies import SLIDING_LIMIT, reference
from comparisons.convergence.uzawa import figures, task
from comparisons.convergence.uzawa.entries import Entries
from comparisons.convergence.uzawa.findings import condition_growth, findings
from comparisons.convergence.uzawa.report import report
from comparisons.convergence.uzawa.study import Extent, study, study_of
from comparisons.convergence.uzawa.tables import error_after
from comparisons.lab.report.old import write_report
from comparisons.lab.study import DONE, read_study, run_study
from comparisons.paper.reference import load
from qvi_contact.plots import has_matplotlib
from solvers import solve_qvi

TINY = Extent(
    friction=(0.1,), map_cells=(2,), limit_cells=(), mesh_cells=(), steps=(0.5, 2.0), normal_steps=(0.5,),
    paper=(0.0, 0.1), accuracy=(("plate", 2, 0.1),), targets=(1e-2,),
)  # fmt: skip


def case(run, place, tangential=None, normal=None, target=None):
    return {"run": run, "place": place, "tangential": tangential, "normal": normal, "target": target}


@pytest.fixture
def _short(monkeypatch):
    """Runs of fewer iterations."""
    monkeypatch.setattr(task, "ITERATIONS", 500)


class TestLimits:
    """The observed limits of the steps are those of theory where theory is exact."""

    @pytest.mark.usefixtures("_short")
    def test_sliding_contacts_have_the_limit_known_by_hand(self):
        found = task.run(case("tangential limit", ("sliding", 0, 0.0), normal=0.5))
        assert found["limit_T"] == pytest.approx(SLIDING_LIMIT, rel=1e-10)
        assert found["slipping_T"] == pytest.approx(SLIDING_LIMIT, rel=1e-10)
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
        tangential = root[:, None] * C[qvi.m :, qvi.m :] * root
        assert local.tangential_limit(everywhere=True) == pytest.approx(
            2.0 / np.linalg.eigvalsh(tangential)[-1], rel=1e-8
        )
        normal = np.linalg.eigvalsh(C[: qvi.m, : qvi.m])[-1]
        assert local.normal_limit(everywhere=True) == pytest.approx(2.0 / normal, rel=1e-8)
        assert local.normal_limit() is None
        assert local.tangential_limit() > local.tangential_limit(everywhere=True)

    @pytest.mark.parametrize("steps", [(0.35, 0.5), (0.6, 0.25), (0.2, 1.0)])
    def test_linearised_contraction_of_both_steps(self, steps):
        """Open and slipping points: λ shrinks as the linearised iteration says."""
        known = reference("half open", 0, 0.3)
        local = known.linearised
        limits = local.tangential_limit(everywhere=True), local.normal_limit(everywhere=True)
        omega_T, omega_N = steps[0] * limits[0], steps[1] * limits[1]
        found = solve_qvi(
            known.body.qvi, method="uzawa", tolerance=1e-8, omega_T=omega_T, omega_N=omega_N, iterations=100
        )
        errors = np.array([entry.residual for entry in found.history])[40:80]
        observed = np.exp(np.polyfit(np.arange(len(errors)), np.log(errors), 1)[0])
        assert observed == pytest.approx(local.uzawa_contraction(omega_T, omega_N), abs=0.02)

    @pytest.mark.usefixtures("_short")
    def test_without_open_points_the_normal_step_has_no_limit(self):
        found = task.run(case("normal limit", ("plate", 2, 0.1), tangential=0.5))
        assert found["open"] == 0
        assert (found["largest"], found["smallest"], found["foreseen"]) == (task.SEARCHED[1], None, None)

    @pytest.mark.usefixtures("_short")
    def test_a_step_beyond_all_limits_never_settles(self):
        found = task.run(case("map", ("plate", 2, 0.1), tangential=1.5, normal=0.5))
        assert not found["settles"]
        assert found["last_error"] < task.NEAR  # the force alone would not show it
        assert found["last_change"] > 10.0 * task.STILL
        assert found["linearised"] > 1.0
        assert not found["certificate"]["passed"]

    def test_a_tiny_step_is_still_and_not_there(self):
        found = task.run(case("map", ("plate", 2, 0.1), tangential=0.01, normal=0.5))
        assert not found["settles"]
        assert found["last_error"] > task.NEAR
        assert found["last_change"] < task.STILL

    def test_without_friction_there_is_no_limit_to_be_a_share_of(self):
        with pytest.raises(ArithmeticError, match="no limit"):
            task.run(case("map", ("plate", 2, 0.0), tangential=0.5, normal=0.5))
        assert reference("plate", 2, 0.0).linearised.uzawa_contraction(1e-3, 1e-3) == np.inf


def test_study_has_all_parts():
    quick, full = study(quick=True), study(quick=False)
    assert quick.name != full.name
    assert {each.values["run"] for each in quick.cases} == {each.values["run"] for each in full.cases}
    assert len(quick.cases) < 100 < len(full.cases)


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a tiny study."""
    path = tmp_path_factory.mktemp("uzawa") / "tiny.sqlite"
    assert run_study(study_of("tiny", TINY), path, progress=False).complete
    return read_study(path).rows


@pytest.fixture
def limit_rows(rows):
    """Rows of searches for ω_T on two meshes, made from one row by hand."""
    one = next(row for row in rows if row.case["run"] == "map")

    def made(cells, largest, omega_T):
        values = {"largest": largest, "smallest": 1.1 * largest, "foreseen": 1.5, "omega_T": omega_T}
        place = {"run": "tangential limit", "place": ["plate", cells, 0.1]}
        return replace(one, case={**one.case, **place}, result={**one.result, **values})

    return [made(2, 1.3, 3e-5), made(4, 1.2, 2e-5), made(8, 1.1, 0.9e-5)]


def said(rows):
    """All findings in one text."""
    return " ".join(finding.text for finding in findings(Entries.of(rows)))


def paper_row(row, friction, **result):
    """The paper's run at a friction, made by hand."""
    values = {"linearised": 0.95, "omega_T": 1e-5, "limit_T": 4e-5, "condition": 13.0, "iterations": 2000, **result}
    return replace(row, case={**row.case, "run": "paper", "place": ["plate", 2, friction]},
                   result={**row.result, **values})  # fmt: skip


def map_row(row, friction, needed, step=1.0, cells=2):
    """A run of the map, made by hand."""
    place = {"run": "map", "place": ["plate", cells, friction], "tangential": step, "normal": 0.5}
    result = {**row.result, "settles": needed is not None, "needed": {"1e-04": needed}}
    return replace(row, case={**row.case, **place}, result=result)


class TestSentences:
    """What is said of rows made by hand."""

    @pytest.fixture
    def row(self, rows):
        return next(row for row in rows if row.case["run"] == "paper" and row.case["place"][2] > 0)

    def test_what_the_step_costs_and_what_is_left(self, row):
        runs = [paper_row(row, mu, needed={"1e-04": 100}) for mu in (0.1, 0.2)]
        runs += [paper_row(row, 0.3, linearised=0.0, limit_T=1e-4, needed={"1e-04": 1})]
        text = said([*runs, map_row(row, 0.1, 50), map_row(row, 0.1, 80, 0.5), map_row(row, 0.2, 4)])
        assert "Where points slip (2 of 3 μ), ω_T = 1e-05 is 25 % of the limit" in text
        assert "multiplies errors by 0.95 in each step, by 0.21 in 30" in text
        assert "50 instead of 100 at μ = 0.1 (the step costs a factor of 2; condition 13)" in text
        assert "4 instead of 100 at μ = 0.2 (the step costs a factor of 25; condition 13)" in text
        assert "more than 30 are left at μ = 0.1, which" in text
        assert "no more than 30 are left. The cond" in said([runs[1], map_row(row, 0.2, 4)])
        assert "quickest step of the map" not in said(runs)

    def test_what_is_not_reached_is_not_reached_in_so_many_iterations(self, row):
        text = said([paper_row(row, 0.1, needed={"1e-04": None}), paper_row(row, 0.0, settles=False, limit_T=None)])
        assert "it is not reached for good in 2000 iterations for 1 of 1" in text
        assert "does not settle in 2000 iterations" in text
        assert "ever" not in text.replace("several", "")

    def mesh_rows(self, row, counts, conditions):
        """Runs at half the limits on 2², 4², … cells."""
        return [
            replace(row, case={**row.case, "run": "mesh", "place": ["plate", 2 ** (k + 1), 0.1]},
                    result={**row.result, "iterations": 20_000, "condition": condition,
                            "needed": {"1e-04": count, "1e-06": None}})
            for k, (count, condition) in enumerate(zip(counts, conditions, strict=True))
        ]  # fmt: skip

    def test_growth_says_what_is_not_monotone_and_what_is_missing(self, row):
        found = self.mesh_rows(row, [10, 20, 40, 30, None], [1.0, 4.0, 16.0, 64.0, 256.0])
        text = said(found)
        assert "(10 on 2² cells, 30 on 16²; not monotone, the largest is 40 on 8²" in text
        assert "not reached for good in 20000 on 32² cells)" in text
        assert "1e-6 is not reached for good in 20000 iterations on 5 of 5 pairs" in text
        condition = condition_growth(Entries.of(found))
        assert "slipping points goes like h^−2.00 at μ = 0.1 (1 on 2² cells, 256 on 32²)." in condition
        assert condition_growth(Entries.of(found[:2])) == ""
        assert "go like h^−1.00 at μ = 0.1 (10 on 2² cells, 40 on 8²)" in said(found[:3])
        none = self.mesh_rows(row, [None], [1.0])
        assert "an unknown power of h at μ = 0.1 (not reached for good in 20000 on 2² cells)" in said(none)

    def test_the_condition_in_the_report_is_that_of_the_rows(self, row, monkeypatch):
        monkeypatch.setattr(figures, "has_matplotlib", lambda: False)
        sections = {section.title: section for section in report(self.mesh_rows(row, [1, 2, 3], [1, 8, 64])).sections}
        assert "h^−3.00" in sections["Finer meshes"].paragraphs[0]
        few = {section.title: section for section in report([row]).sections}
        assert few["Finer meshes"].paragraphs == ()

    def test_half_the_limits_beside_the_best_of_the_map(self, row):
        equal = replace(row, case={**row.case, "run": "Uzawa", "target": 1e-2, "place": ["plate", 2, 0.1]},
                        result={**row.result, "status": "solved", "seconds": [1.0]})  # fmt: skip
        text = said([equal, map_row(row, 0.1, 90, 0.5), map_row(row, 0.1, 30)])
        assert "steps of 0.5 of their limits; in the maps of the same problems the quickest step takes 3 times" in text
        assert "quickest step takes" not in said([equal, map_row(row, 0.2, 90, 0.5), map_row(row, 0.2, 30)])

    def test_the_tightest_target_that_uzawa_meets(self, row):
        def met(target, status):
            return replace(row, case={**row.case, "run": "Uzawa", "target": target, "place": ["plate", 2, 0.1]},
                           result={**row.result, "status": status, "seconds": [1.0]})  # fmt: skip

        assert "Uzawa meets 1e-2, the tightest target: " in said([met(1e-2, "solved")])
        tighter = [met(1e-2, "solved"), met(1e-4, "max_iterations"), met(1e-6, "max_iterations")]
        assert "Uzawa meets 1e-2, not 1e-4: " in said(tighter)

    def test_a_printed_step_that_is_too_large_on_some_meshes(self, limit_rows):
        steps = (0.5e-5, 2e-5, 0.5e-5)
        found = [replace(r, result={**r.result, "omega_T": w}) for r, w in zip(limit_rows, steps, strict=True)]
        assert "beyond the limit on 2² and 8² cells at μ = 0.1" in said(found)


class TestReport:
    """The report of a tiny study."""

    def test_every_row_is_done_and_has_a_certificate(self, rows):
        assert {row.status for row in rows} == {DONE}
        assert all(row.certificate["accuracy"] >= 0 for row in rows)

    def test_the_papers_run(self, rows):
        runs = {entry.friction: entry for entry in Entries.of(rows).runs("paper")}
        for friction, entry in runs.items():
            assert entry.number("after") == pytest.approx(load().table[friction], abs=0.00501)
        assert error_after(runs[0.1]) == pytest.approx(0.0033, abs=1e-4)
        assert runs[0.1].needed("1e-04") > 5 * load().iterations
        assert runs[0.0].needed("1e-04") is None

    def test_findings_are_those_of_the_rows(self, rows, limit_rows):
        texts = " ".join(finding.text for finding in findings(Entries.of([*rows, *limit_rows])))
        assert "After the paper's 30 iterations P/2 is still wrong by up to 0.33 % (μ = 0.1)" in texts
        assert "the accumulating rule gives 2 of 2 printed values to the last digit, the rule as printed 1" in texts
        assert "was safe in 3 of 3 searches on the plate; the largest that settles is 1.1 to 1.3 times" in texts
        assert (
            "fail in 3 of 3: the largest that settles is 0.733 to 0.867 times that limit, and beyond it in 0" in texts
        )
        assert "beyond the limit from 8² cells on at μ = 0.1" in texts
        assert "On the plate, 1 of 2 pairs of steps do not settle" in texts
        assert "ω_N makes no difference" in texts

    def test_runs_come_in_the_order_of_their_meshes(self, limit_rows):
        runs = Entries.of(limit_rows[::-1]).runs("tangential limit")
        assert [entry.cells for entry in runs] == [2, 4, 8]

    def test_an_observed_limit_below_theory_is_told(self, rows, limit_rows):
        low = replace(limit_rows[0], result={**limit_rows[0].result, "largest": 0.8, "smallest": 0.9})
        high = replace(limit_rows[1], result={**limit_rows[1].result, "largest": 1.8, "smallest": 1.9})
        texts = " ".join(finding.text for finding in findings(Entries.of([*rows, low, high])))
        assert "was safe in 1 of 2 searches" in texts
        assert "fail in 1 of 2: the largest that settles is 0.533 to 1.2 times that limit, and beyond it in 1" in texts

    def test_a_search_in_which_every_step_fails_is_not_safe(self, limit_rows):
        none = replace(limit_rows[0], result={**limit_rows[0].result, "largest": None, "smallest": 0.25})
        every = replace(limit_rows[1], result={**limit_rows[1].result, "largest": 16.0, "smallest": None})
        assert "was safe in 2 of 3 searches on the plate; the largest" in said([none, every, limit_rows[2]])
        assert "was safe in 0 of 1 search on the plate." in said([none])

    def test_files_and_pictures(self, rows, limit_rows, tmp_path):
        made = report([*rows, *limit_rows])
        assert len(write_report(made, tmp_path)) == (8 if has_matplotlib() else 2)
        shown = next(exhibit for section in made.sections for exhibit in section.exhibits if exhibit.name == "limits")
        assert figures.limits(Entries.of([*limit_rows[::-1], *rows])).svg == shown.svg

    def test_it_is_the_same_whatever_the_order_of_rows(self, rows, tmp_path, monkeypatch):
        monkeypatch.setattr(figures, "has_matplotlib", lambda: False)
        first, second = (write_report(report(each), tmp_path / name) for name, each in
                         (("a", rows), ("b", rows[::-1])))  # fmt: skip
        assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]

    def test_a_case_that_died_is_a_failure(self, rows):
        dead = [
            replace(row, status="timeout", result={}, certificate=None) if row.case["target"] else row for row in rows
        ]
        texts = " ".join(finding.text for finding in findings(Entries.of(dead)))
        assert "5 runs ended without a result (timeout: 5)" in texts
        assert "Targets confirmed" not in texts
