"""The iteration of Uzawa: limits of its steps beside theory, the paper's run, study and report."""

from dataclasses import replace

import numpy as np
import pytest
from pandas.testing import assert_frame_equal

from comparisons.convergence.bodies import SLIDING_LIMIT, reference
from comparisons.convergence.uzawa import figures
from comparisons.convergence.uzawa import study as task
from comparisons.convergence.uzawa.measures import growth, paper_runs, runs_of, tables_of, values_of
from comparisons.convergence.uzawa.report import report
from comparisons.convergence.uzawa.study import Extent, study, study_of
from comparisons.lab.report import write_report
from comparisons.lab.study import DONE
from comparisons.paper.reference import load
from qvi_contact.plots import has_matplotlib
from solvers import solve_qvi
from tests.comparisons.convergence_parts import committed_text, made_again, rows_of

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

    def test_what_rounding_leaves_of_a_pressure_is_no_bound(self):
        """Of an open point the limit would be that of a bound of 1e-16: no step at all."""
        local = reference("ssnv128", 4, 1.0).linearised
        assert local.open.any()
        assert not local.threshold[local.open].any()
        assert local.tangential_limit(everywhere=True) > 1e-3

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
    """Rows of a tiny study, of fewer iterations."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(task, "ITERATIONS", 500)
        return rows_of(study_of("tiny", TINY), tmp_path_factory.mktemp("uzawa") / "tiny.sqlite")


def made(row, run, place, **result):
    """A row of another run, by hand."""
    case = {**row.case, "run": run, "place": place, "tangential": None, "normal": 0.5, "target": None}
    return replace(row, case=case, result={**row.result, **result})


def found(rows):
    """The numbers of the findings."""
    return values_of(runs_of(rows))


class TestNumbers:
    """What is computed of rows made by hand."""

    @pytest.fixture
    def row(self, rows):
        return next(row for row in rows if row.case["run"] == "paper" and row.case["place"][2] > 0)

    def mapped(self, row, friction, needed, step=1.0, normal=0.5):
        other = made(row, "map", ["plate", 2, friction], settles=needed is not None, needed={"1e-04": needed})
        return replace(other, case={**other.case, "tangential": step, "normal": normal})

    def test_what_the_step_costs_and_what_is_left(self, row):
        values = {"linearised": 0.95, "omega_T": 1e-5, "limit_T": 4e-5, "condition": 13.0}
        runs = [made(row, "paper", ["plate", 2, mu], needed={"1e-04": 100}, **values) for mu in (0.1, 0.2)]
        runs += [made(row, "paper", ["plate", 2, 0.3], needed={"1e-04": 1}, **(values | {"linearised": 0.0}))]
        runs += [self.mapped(row, 0.1, 50), self.mapped(row, 0.1, 80, 0.5), self.mapped(row, 0.2, 4)]
        told = found(runs)
        assert told["quickest"] == "4 to 50"
        assert (told["factors"], told["shares"], told["powers"]) == ("2 to 25", "25 %", "0.21")
        assert (told["sliding"], told["frictions"], told["needed"]) == (2, 3, "100")
        assert found(runs[:3])["quickest"] == "none"

    def meshes(self, row, counts, conditions):
        """Runs at half the limits on 2², 4², … cells."""
        return [
            made(row, "mesh", ["plate", 2 ** (k + 1), 0.1], condition=condition,
                 needed={"1e-04": count, "1e-06": None})
            for k, (count, condition) in enumerate(zip(counts, conditions, strict=True))
        ]  # fmt: skip

    def test_growth_with_the_mesh(self, row):
        rows = self.meshes(row, [10, 20, 40, 30, None], [1.0, 4.0, 16.0, 64.0, 256.0])
        (line,) = growth(runs_of(rows)).itertuples()
        assert line.growth == pytest.approx(2.0)
        assert line.most == 40
        told = found(rows)
        assert (told["slow"], told["meshes"]) == (5, 5)
        assert growth(runs_of(rows[:3])).order[0] == pytest.approx(1.0)
        assert growth(runs_of(rows[:2])).order[0] is None
        assert np.isnan(growth(runs_of(self.meshes(row, [None], [1.0]))).most[0])

    def searched(self, row, *shares, **changes):
        return [
            made(row, "tangential limit", ["plate", 2 ** (k + 1), 0.1], **({
                "largest": share, "smallest": share and 1.1 * share, "foreseen": 1.5, "omega_T": (3 - k) * 5e-6,
                "limit_T": 1e-5, "slipping_T": 1e-5, **changes}))
            for k, share in enumerate(shares)
        ]  # fmt: skip

    def test_limits_beside_both_of_theory(self, row):
        rows = self.searched(row, 1.3, 1.2, 0.8)
        values = found(rows)
        assert (values["safe"], values["searches"], values["early"], values["foreseen"]) == (2, 3, 3, 3)
        assert (values["largest"], values["local"], values["beyond"]) == ("0.8 to 1.3", "0.533 to 0.867", 0)
        assert found(self.searched(row, 1.8))["beyond"] == 1

    def test_a_search_in_which_every_step_fails_is_not_safe(self, row):
        none = self.searched(row, None, smallest=0.25)
        every = self.searched(row, 16.0, smallest=None)
        assert found(none)["safe"] == 0
        assert found(every)["safe"] == 1
        assert found([*none, *every])["largest"] == "none"
        assert tables_of(runs_of(every))["limit-table"].settles.tolist()[0] == "> 16"

    def test_a_printed_step_that_is_too_long_on_some_meshes(self, row):
        rows = [*self.searched(row, 1.3, 1.2, 1.1), *self.meshes(row, [1, 2, 4], [1.0, 1.0, 1.0])]
        assert growth(runs_of(rows)).beyond[0] == "8²"

    def test_half_the_limits_beside_the_best_of_the_map(self, row):
        equal = made(row, "Uzawa", ["plate", 2, 0.1], status="solved", seconds=[1.0, 3.0, 2.0])
        equal = replace(equal, case={**equal.case, "target": 1e-2})
        early = self.mapped(row, 0.1, 5, 2.0)
        restless = replace(early, result={**early.result, "settles": False})
        values = found([equal, self.mapped(row, 0.1, 90, 0.5), self.mapped(row, 0.1, 30), restless])
        assert values["saved"] == "3"
        assert values["targets"]["Uzawa"] == (1, 1)
        assert runs_of([equal]).seconds[0] == 2.0
        assert found([equal, self.mapped(row, 0.2, 90, 0.5), self.mapped(row, 0.2, 30)])["saved"] == "none"

    def test_whether_the_normal_step_matters(self, row):
        same = [self.mapped(row, 0.1, 30, normal=normal) for normal in (0.5, 1.0)]
        other = [self.mapped(row, 0.1, count, normal=normal) for count, normal in ((30, 0.5), (None, 1.0))]
        assert [tables_of(runs_of(each))["maps"].matters[0] for each in (same, other)] == ["no", "yes"]

    @pytest.mark.usefixtures("outlined")
    def test_a_case_that_died_is_left_out_and_counted(self, rows):
        dead = [
            replace(row, status="timeout", result={}, certificate=None) if row.case["target"] else row for row in rows
        ]
        told = found(dead)
        assert (told["failed"], told["targets"]["condensed"]) == (5, (0, 0))
        assert "5 runs ended without a result" in report(dead).text


@pytest.fixture(scope="module")
def committed():
    """The report of the committed rows and its numbers."""
    return made_again("uzawa")


class TestReport:
    """The report of a tiny study, and of the committed rows."""

    def test_every_row_is_done_and_has_a_certificate(self, rows):
        assert {row.status for row in rows} == {DONE}
        assert all(row.certificate["accuracy"] >= 0 for row in rows)

    def test_the_papers_run(self, rows):
        runs = paper_runs(runs_of(rows)).set_index("friction")
        for friction, after in runs.after.items():
            assert after == pytest.approx(load().table[friction], abs=0.00501)
        assert runs.error[0.1] == pytest.approx(0.0033, abs=1e-4)
        assert runs["to 1e-04"][0.1] > 5 * load().iterations
        assert np.isnan(runs["to 1e-04"][0.0])

    def test_its_files(self, rows, tmp_path):
        written = write_report(report(rows, quick=True), tmp_path)
        assert len(written) == (8 if has_matplotlib() else 2)
        assert all("convergence-uzawa-quick" in path.name for path in written)

    def test_it_is_the_same_whatever_the_order_of_rows(self, rows, monkeypatch):
        assert_frame_equal(runs_of(rows), runs_of(rows[::-1]))  # of which pictures are made
        monkeypatch.setattr(figures, "drawn", lambda *_: "drawn")
        assert report(rows, quick=True) == report(rows[::-1], quick=True)

    def test_numbers_of_the_findings(self, committed):
        _, values = committed
        assert values["worst"]["error"] == pytest.approx(0.0033, abs=5e-5)
        assert values["tractions"] == pytest.approx(0.057, abs=5e-4)
        expected = {
            "needed": "82 to 194", "shares": "8 % to 39 %", "quickest": "5 to 76", "safe": 15,
            "searches": 15, "early": 13, "foreseen": 15, "orders": "−0.63 to −0.99", "slow": 4, "meshes": 15,
            "accumulating": 7, "printed": 7, "as_printed": 6, "failed": 0,
        }  # fmt: skip
        assert {name: values[name] for name in expected} == expected
        assert values["targets"] == {
            "Uzawa": (11, 20), "Uzawa, shrinking step": (7, 20), "fixed point, QP": (20, 20),
            "fixed point, SOCP": (20, 20), "condensed": (20, 20),
        }  # fmt: skip

    def test_the_committed_report_is_that_of_the_committed_rows(self, committed):
        text, _ = committed
        assert text == committed_text("uzawa")
