"""What the comparison of solvers says, on runs made up for it: nothing solved, everything solved, ties, few runs."""

import itertools
import math
from collections import Counter
from pathlib import Path

import pytest
from pandas import DataFrame

from comparisons.lab.report import findings_of
from comparisons.lab.study import Row, StoredStudy, read_csv
from comparisons.lab.tables import grid_of
from comparisons.solvers import figures, measures
from comparisons.solvers import report as tables
from comparisons.solvers.accuracies import LEVELS, TABLE, asked
from comparisons.solvers.measures import frame_of, numbers_of, ranking
from comparisons.solvers.outcomes import GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.problems import PROBLEMS
from comparisons.solvers.report import report_of
from comparisons.solvers.study import declared

COMMITTED = Path(__file__).parents[2] / "comparisons" / "reports" / "solvers"
FAILED = {"certified": False, "outcomes": {UNTRUE: 1}}
LOST = {"certified": False, "seconds": None, "status": "timeout", "outcomes": {NO_ANSWER: 1}}


def run(solver="a", outcomes=None, **changes):
    """The entries of a run, as `frame_of` takes them."""
    return {
        "solver": solver, "task": "inner", "problem": "plate_8", "form": "full", "level": "mid", "seconds": 1.0,
        "certified": True, "status": "solved", "reason": "", **(outcomes or {RIGHT: 1}), **changes,
    }  # fmt: skip


def numbers(runs):
    return numbers_of(frame_of(runs))


def ranked(runs):
    return ranking(frame_of(runs), "inner")


def lines(table, runs, *columns):
    """The rows of a table as texts, of a frame those of some columns."""
    found = table(frame_of(runs))
    return grid_of(found, columns or [*found], tables.FORMS).rows if isinstance(found, DataFrame) else found.rows


class TestTruth:
    """How true "solved" is."""

    def test_untrue_answers_count_also_where_nobody_is_certified(self):
        hard = [run(solver, problem="graded_16", **FAILED) for solver in "abc"]
        runs = [run("a"), run("b"), run("c", **FAILED), *hard, run("d"), run("d", problem="graded_16", **LOST)]
        assert measures.told_by(frame_of(runs)).loc["a", [RIGHT, UNTRUE, "nobody", "said"]].tolist() == [1, 1, 1, 2]
        found = numbers(runs)
        assert found["often"][0] == "c (100 % of 2)"
        assert (found["seldom"], found["untrue"]) == (1, 4)  # d alone
        assert (found["nobody"], found["nobody_untrue"]) == (1, 3)
        assert found["nobody_at"] == ["graded_16 (single, full, mid)"]
        assert lines(tables.truth, runs, RIGHT, UNTRUE, "nobody")[:3] == [("1", "1", "1")] * 2 + [("0", "2", "1")]
        assert lines(tables.overview, runs, "share") == [("50 %",), ("50 %",), ("100 %",), ("0 %",)]

    def test_a_sequence_with_a_step_that_is_right_is_not_one_that_nobody_solves(self):
        steps = {"certified": False, "outcomes": {UNTRUE: 2, RIGHT: 1}}
        runs = [run(task="cold", **steps), run("b", task="cold", outcomes={GAVE_UP: 2, MODEST: 1}, certified=False)]
        assert numbers(runs)["nobody_at"] == []
        assert numbers([run(**FAILED), *runs])["nobody_at"] == ["plate_8 (single, full, mid)"]

    def test_whole_inequalities_and_problems_without_a_solution_are_counted_elsewhere(self):
        runs = [run(task="outer", **FAILED), run(problem="pulled_block", **FAILED)]
        assert measures.told_by(frame_of(runs)).empty
        found = numbers(runs)
        assert (found["untrue"], found["often"]) == (0, [])


class TestErrors:
    """How errors fall with what is asked."""

    @staticmethod
    def falling(solver, power, **changes):
        return [run(solver, level=level, accuracy=3.0 * asked(level) ** power, **changes) for level in LEVELS]

    def test_powers_are_those_of_the_data(self):
        runs = [*self.falling("a", 0.5), *self.falling("b", 1.0), run("c", level="low", accuracy=1e-3)]
        assert measures.error_powers(frame_of(runs)) == {"a": pytest.approx(0.5), "b": pytest.approx(1.0)}

    def test_only_problems_with_an_answer_at_both_ends_count(self):
        runs = [*self.falling("a", 0.5), run("a", problem="plate_16", level="low", accuracy=1e3)]
        runs += [run("a", problem="plate_4", level=level, accuracy=None) for level in LEVELS]
        assert measures.error_powers(frame_of(runs)) == {"a": pytest.approx(0.5)}

    def test_the_table_says_who_gets_the_energy_as_a_cone(self):
        runs = [*self.falling("qp:ecos", 0.5), *self.falling("qp:osqp", 1.0)]
        assert lines(tables.powers, runs) == [("qp:ecos", "0.5", "one more cone"), ("qp:osqp", "1", "as it is")]
        assert lines(tables.powers, runs[:2]) == []


class TestRanking:
    """Who comes first."""

    def test_most_solved_then_most_within_twice_the_fastest_time(self):
        quick = {"a": (1.0, None), "b": (1.5, 3.0), "c": (1.1, 9.0), "d": (3.0, 1.0)}
        runs = [
            run(solver, problem=name, **({"seconds": time} if time else LOST))
            for solver, times in quick.items()
            for name, time in zip(("plate_4", "plate_8"), times, strict=True)
        ]
        found = ranked(runs)
        assert [each[0] for each in found] == ["b", "c", "d"]
        assert {each[1:] for each in found} == {(2, 2, 0.5)}

    def test_who_shares_the_last_place_is_named_too(self):
        assert [each[0] for each in ranked([run(solver) for solver in "abcde"])] == list("abcde")
        assert ranked([run(), run("b", **FAILED)]) == [("a", 1, 1, 1.0)]
        assert ranked([run()]) == []

    def test_nobody_comes_first_where_nobody_solves_anything(self):
        assert ranked([run(solver, **FAILED) for solver in "abc"]) == []

    def test_nobody_is_ranked_unless_all_were_given_every_problem(self):
        runs = [run("a"), run("b"), run("b", problem="plate_16", **FAILED)]
        assert ranked(runs) == []
        assert ranked([*runs, run("a", problem="plate_16")])[0] == ("a", 2, 2, 1.0)
        assert ranked([run("a"), run("b", problem="plate_16")]) == []

    def test_no_curve_is_coloured_that_never_rises(self):
        pytest.importorskip("matplotlib")
        (axes,) = figures.profiles(frame_of([run("a"), run("b", **FAILED)])).axes
        assert len(axes.lines) == 2
        assert [text.get_text() for text in axes.get_legend().get_texts()] == ["a (1 of 1)"]

    def test_the_one_step_of_uzawa_is_told(self):
        outer = {"task": "outer", "form": "condensed"}
        runs = [run("uzawa", options={"omega_T": 0.01}, seconds=2.0, **outer), run("b", **outer)]
        (method,) = numbers(runs)["methods"]
        assert (method["step"], method["solved"], method["given"]) == (0.01, 1, 1)
        assert (method["ratio"], method["both"]) == (pytest.approx(0.5), 1)
        (other,) = numbers([runs[0] | {"solver": "condensed", "options": {}}])["methods"]
        assert (other["name"], other["step"], other["both"]) == ("condensed", None, 0)
        assert math.isnan(other["ratio"])


class TestComparisons:
    """One thing against another."""

    def test_doubled_rows_are_compared_with_the_same_rows_given_once(self):
        runs = [run(solver, problem=name) for solver in "ab" for name in ("plate_8", "punch_coarse", "doubled_rows")]
        runs += [run("a", problem="doubled_equation", **LOST), run("b", problem="doubled_equation")]
        assert [line[-4:] for line in lines(tables.twins, runs)] == [
            ("0 % of 1", "1", "100 % of 1", "0"), ("100 % of 1", "0", "100 % of 1", "0"),
        ]  # fmt: skip

    def test_doubled_rows_without_their_twin_are_not_compared(self):
        assert lines(tables.twins, [run(problem="doubled_rows", **LOST)]) == []

    def test_graded_cells_are_compared_with_as_many_equal_ones(self):
        runs = [run(problem="graded_8", **FAILED), run(), run(problem="plate_4", **FAILED)]
        assert numbers(runs)["graded"] == {
            "full": [0.0, 1.0], "condensed": pytest.approx([math.nan, math.nan], nan_ok=True)
        }  # fmt: skip

    @pytest.mark.parametrize(
        ("ratio", "told"),
        [(0.8, ("a", "none")), (0.85, ("none", "none")), (1.15, ("none", "none")), (1.3, ("none", "a"))],
    )
    def test_a_warm_start_gains_only_beyond_what_means_nothing(self, ratio, told):
        found = numbers([run(task="cold"), run(task="warm", seconds=ratio)])
        assert (found["gaining"], found["losing"]) == told

    def test_all_unknowns_beside_condensed(self):
        found = numbers([run(seconds=3.0), run(form="condensed")])
        assert (found["form"], found["form_span"]) == (pytest.approx(3.0), "3")


class TestInfeasible:
    """Problems without a solution."""

    def test_nobody_recognises_what_is_not_called_infeasible(self):
        found = numbers([run(problem="pulled_block", certified=False, outcomes={GAVE_UP: 1})])
        assert (found["asked"], found["right"], found["lied"]) == (1, [], 0)
        assert numbers([run(problem="pulled_block", **FAILED)])["lied"] == 1

    def test_only_who_was_given_all_of_them_recognised_every_one(self):
        runs = [run(solver, problem="pulled_block") for solver in "ab"] + [run("a", problem="dragged_block")]
        every, some = numbers(runs), numbers(runs[1:])
        assert (every["asked"], every["right"]) == (1, ["a"])
        assert (some["asked"], some["right"]) == (0, [])


class TestTimes:
    """Means of times."""

    def test_failures_count_the_limit_in_the_mean_named_so(self):
        limited = run(problem="plate_4", seconds=2.0, limit=30.0, **FAILED)
        for runs, means in (
            ([run(limit=30.0), limited], ("1 s (1)", "5.48 s")),  # (1.001 · 30.001)^½ − 0.001
            ([run()], ("1 s (1)", "1 s")),
            ([run(), limited | {"limit": None}], ("1 s (1)", "none")),
            ([limited], ("none", "30 s")),
        ):
            assert lines(tables.speeds, runs, "mid: mean time", "mid: mean, failures at the limit") == [means]
        assert tables.speeds(frame_of([])).empty

    def test_limits_and_options_are_those_of_the_rows(self):
        case = {"solver": "uzawa", "task": "outer", "problem": "plate_8", "form": "condensed", "level": "mid"}
        done = {
            "outcomes": {RIGHT: 1}, "seconds": [1.0], "status": "solved", "message": "", "iterations": 7,
            "options": {"omega_T": 0.02}, "accuracy": 1e-7,
        }  # fmt: skip
        rows = [
            Row(0, "", case, status, "", result, None, 1.0, "", 0.0, {"timeout_seconds": 30.0})
            for status, result in (("done", done), ("timeout", {}))
        ]
        runs = measures.runs_of(rows)
        finished, ended = runs.itertuples()
        assert (finished.limit, finished.options, finished.accuracy) == (30.0, {"omega_T": 0.02}, 1e-7)
        assert (ended.limit, ended.lost) == (30.0, True)
        assert math.isnan(ended.time)
        assert numbers_of(runs)["methods"][0]["step"] == 0.02

    def test_medians_of_even_numbers_lie_half_way(self):
        runs = [run(problem=name, accuracy=value) for name, value in (("plate_4", 1e-3), ("plate_8", 3e-3))]
        assert lines(tables.errors, runs, "accuracy")[0] == ("2.0e-3",)


@pytest.fixture(scope="module")
def rows():
    """Of the committed run."""
    return read_csv(COMMITTED / "solvers.csv.gz")


@pytest.fixture(scope="module")
def committed(rows):
    """The same as a frame of runs."""
    return measures.runs_of(rows)


class TestCommitted:
    """The run in `comparisons/reports`."""

    def test_the_rows_are_those_of_the_whole_study(self, rows):
        assert [row.key for row in rows] == [case.key for case in declared(tuple(TABLE)).cases]

    def test_numbers_of_the_findings(self, rows, committed):
        done = [row for row in rows if PROBLEMS[row.case["problem"]].feasible]
        certified = [row for row in done if row.certificate and row.certificate["passed"]]
        found = numbers_of(committed)
        assert (found["feasible"], found["certified"]) == (len(done), len(certified)) == (3825, 3207)
        assert found["often"] == [
            "socp:ecos (60 % of 672)", "socp:cvxopt (56 % of 521)", "qp:ecos (55 % of 366)", "qp:highs (14 % of 293)",
        ]  # fmt: skip
        assert (found["seldom"], found["nobody"], found["alarms"]) == (13, 0, 41)
        assert [each[:3] for each in found["first"]] == [
            ("qp:quadprog", 26, 26), ("qp:daqp", 26, 26), ("qp:qpalm", 26, 26)
        ]  # fmt: skip
        assert [each[3] for each in found["first"]] == pytest.approx([19 / 26, 16 / 26, 14 / 26])
        methods = {each["name"]: (each["solved"], each["given"], each["both"]) for each in found["methods"]}
        assert methods == {"condensed": (39, 39, 39), "uzawa": (24, 39, 24)}
        assert [each["ratio"] for each in found["methods"]] == pytest.approx([1.6, 0.55], abs=0.05)
        assert (found["asked"], len(found["right"]), found["lied"]) == (17, 12, 0)

    def test_untrue_answers_are_those_of_the_rows(self, rows, committed):
        told = Counter[str]()
        for row in rows:
            if row.case["task"] != "outer" and PROBLEMS[row.case["problem"]].feasible and row.status == "done":
                told[row.case["solver"]] += row.result["outcomes"].get(UNTRUE, 0)
        counts = measures.told_by(committed)
        assert counts[UNTRUE].to_dict() == dict(told)
        assert told.total() == 968

    def test_the_committed_report_is_that_of_the_committed_rows(self, rows, monkeypatch):
        monkeypatch.setattr(figures, "drawn", lambda *_: "drawn")
        text = report_of(StoredStudy({"name": "solvers", "cases": len(rows)}, rows)).text
        assert text == (COMMITTED / "solvers.md").read_text(encoding="utf-8")
        assert len(findings_of(text)) == 5


def test_whatever_came_out_there_are_numbers():
    """Also of rows that all failed."""
    results = ({}, FAILED, LOST, {"certified": False, "outcomes": {GAVE_UP: 1}, "accuracy": 1e-4})
    problems = ("plate_8", "graded_8", "doubled_rows", "pulled_block")
    compared = itertools.cycle((("a",), ("a", "condensed"), ("uzawa",)))
    pairs = [*zip(results, results, strict=True), *itertools.pairwise((*results, results[0]))]
    for (first, second), solvers in zip(pairs, compared, strict=False):
        runs = [
            run(solver, problem=problem, task=task, form=form, **(first if form == "full" else second))
            for solver, problem, task, form in itertools.product(
                solvers, problems, ("inner", "cold", "warm", "outer"), ("full", "condensed")
            )
        ]
        found = numbers(runs)
        assert found["certified"] <= found["feasible"] <= found["runs"] == len(runs)
