"""What the comparison of solvers says, on runs made up for it: nothing solved, everything solved, ties, few runs."""

import itertools
from dataclasses import replace

import pytest

from comparisons.lab.report.old import exhibits
from comparisons.lab.study import Row, StoredStudy
from comparisons.solvers import figures, measures, tables
from comparisons.solvers.accuracies import LEVELS, asked
from comparisons.solvers.findings import findings
from comparisons.solvers.outcomes import GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from comparisons.solvers.report import report_of

FAILED = {"certified": False, "outcomes": {UNTRUE: 1}}
LOST = {"certified": False, "seconds": None, "status": "timeout", "outcomes": {NO_ANSWER: 1}}


def run(solver="a", **changes):
    given = {
        "solver": solver, "task": "inner", "problem": "plate_8", "form": "full", "level": "mid", "seconds": 1.0,
        "spread": None, "certified": True, "status": "solved", "reason": "", "outcomes": {RIGHT: 1}, **changes,
    }  # fmt: skip
    return measures.Run(**given)


def said(runs, *words):
    """The only sentence that has all of these words; "" if there is none."""
    found = [finding.text for finding in findings(runs) if all(word in finding.text for word in words)]
    assert len(found) <= 1
    return "".join(found)


class TestTruth:
    """How true "solved" is."""

    def test_untrue_answers_count_also_where_nobody_is_certified(self):
        hard = [run(solver, problem="graded_16", **FAILED) for solver in "abc"]
        runs = [run("a"), run("b"), run("c", **FAILED), *hard, run("d"), run("d", problem="graded_16", **LOST)]
        assert measures.outcome_counts(runs)["a"] == {RIGHT: 1, UNTRUE: 1}
        assert said(runs, "was untrue").endswith("in the answers of c 100 % (2 of 2).")
        assert said(runs, "no solver was certified") == (
            'a (1 of 2) and b (1 of 2) said an untrue "solved" only of inner problems on which no solver was certified.'
        )
        assert said(runs, "Whenever").startswith('Whenever d (1 time) said "solved" of an inner problem that has')
        assert said(runs, "No answer of any") == (
            "No answer of any solver is certified on the 1 inner problem or sequence graded_16 (single, full, mid); "
            "3 of the 4 untrue answers of all solvers are about it."
        )
        assert [line[1:4] for line in tables.truth(runs).grid.rows[:3]] == [("1", "1", "1")] * 2 + [("0", "2", "1")]
        assert [line[-2] for line in tables.overview(runs).grid.rows] == ["50 %", "50 %", "100 %", "0 %"]

    def test_a_sequence_with_a_step_that_is_right_is_not_one_that_nobody_solves(self):
        steps = {"certified": False, "outcomes": {UNTRUE: 2, RIGHT: 1}}
        runs = [run(task="cold", **steps), run("b", task="cold", outcomes={GAVE_UP: 2, MODEST: 1}, certified=False)]
        assert measures.unattained(runs) == []
        assert measures.unattained([run(**FAILED), *runs]) == [("mid", "plate_8", "full", "single")]
        assert not said(runs, "only of inner problems")

    def test_whole_inequalities_and_problems_without_a_solution_are_counted_elsewhere(self):
        runs = [run(task="outer", **FAILED), run(problem="pulled_block", **FAILED)]
        assert measures.outcome_counts(runs) == {}
        assert not said(runs, "Whenever")
        assert not said(runs, "was untrue")

    def test_a_long_list_is_cut_and_its_rest_is_counted(self):
        names = ("plate_4", "plate_8", "plate_16", "graded_8")
        runs = [run(problem=name, level=level, **FAILED) for name in names for level in ("low", "mid")]
        assert "and 2 more" in said(runs, "No answer of any")


class TestErrors:
    """How errors fall with what is asked."""

    @staticmethod
    def falling(solver, power, **changes):
        return [run(solver, level=level, accuracy=3.0 * asked(level) ** power, **changes) for level in LEVELS]

    def test_powers_are_those_of_the_data(self):
        runs = [*self.falling("a", 0.5), *self.falling("b", 1.0), run("c", level="low", accuracy=1e-3)]
        assert measures.error_powers(runs) == {"a": pytest.approx(0.5), "b": pytest.approx(1.0)}

    def test_only_problems_with_an_answer_at_both_ends_count(self):
        runs = [*self.falling("a", 0.5), run("a", problem="plate_16", level="low", accuracy=1e3)]
        runs += [run("a", problem="plate_4", level=level, accuracy=None) for level in LEVELS]
        assert measures.error_powers(runs) == {"a": pytest.approx(0.5)}

    def test_square_roots_are_told_only_where_the_data_show_them(self):
        runs = [*self.falling("qp:ecos", 0.5), *self.falling("qp:osqp", 1.0), *self.falling("qp:daqp", 0.0)]
        told = said(runs, "square root")
        assert told.startswith("The median errors of qp:ecos (0.5) fall more like the square root")
        assert told.endswith("the tolerance at all, 1.")
        assert "it gets the energy" in told
        assert not said(self.falling("qp:ecos", 1.0), "square root")
        assert not said(self.falling("qp:ecos", 0.0), "square root")
        assert not said(self.falling("qp:osqp", 0.5), "square root")
        assert not said(self.falling("qp:ecos", 0.5)[:2], "square root")


class TestRanking:
    """Who comes first."""

    def test_most_solved_then_most_within_twice_the_fastest_time(self):
        quick = {"a": (1.0, None), "b": (1.5, 3.0), "c": (1.1, 9.0), "d": (3.0, 1.0)}
        runs = [
            run(solver, problem=name, **({"seconds": time} if time else LOST))
            for solver, times in quick.items()
            for name, time in zip(("plate_4", "plate_8"), times, strict=True)
        ]
        told = said(runs, "ranked by")
        assert told.startswith("On single inner problems at accuracy mid, ranked by how many are solved and then")
        assert "time, b (2 of 2 solved, 50 % within twice), c (2 of 2 solved, 50 % within twice) and d (2 of 2" in told
        assert "a (1 of 2" not in told

    def test_who_shares_the_last_place_is_named_too(self):
        told = said([run(solver) for solver in "abcde"], "ranked by")
        assert "d (1 of 1 solved, 100 % within twice) and e (1 of 1 solved, 100 % within twice) come first." in told
        assert "and 2 more come first" in said([run(solver) for solver in "abcdefgh"], "ranked by")
        assert said([run(), run("b", **FAILED)], "ranked by").endswith(
            "a (1 of 1 solved, 100 % within twice) comes first."
        )
        assert not said([run()], "ranked by")

    def test_nobody_comes_first_where_nobody_solves_anything(self):
        assert not said([run(solver, **FAILED) for solver in "abc"], "ranked by")

    def test_nobody_is_ranked_unless_all_were_given_every_problem(self):
        runs = [run("a"), run("b"), run("b", problem="plate_16", **FAILED)]
        assert not said(runs, "ranked by")
        assert said([*runs, run("a", problem="plate_16")], "ranked by").endswith("50 % within twice) come first.")
        assert not said([run("a"), run("b", problem="plate_16")], "ranked by")

    def test_no_curve_is_coloured_that_never_rises(self):
        pytest.importorskip("matplotlib")
        picture = figures.profiles([run("a"), run("b", **FAILED)], "name")
        assert "a (1 of 1)" in picture
        assert "b (0 of 1)" not in picture

    def test_the_one_step_of_uzawa_is_told(self):
        outer = {"task": "outer", "form": "condensed"}
        runs = [run("uzawa", options={"omega_T": 0.01}, seconds=2.0, **outer), run("b", **outer)]
        told = said(runs, "The method uzawa")
        assert "with the one step ω_T = 0.01 for all problems, solved 1 of 1 whole inequality;" in told
        assert "took 0.5 times as long. A step tuned to each problem was not tried" in told
        assert "step" not in said([replace(runs[0], solver="condensed", options={})], "The method condensed")


class TestComparisons:
    """One thing against another."""

    def test_doubled_rows_are_compared_with_the_same_rows_given_once(self):
        runs = [run(solver, problem=name) for solver in "ab" for name in ("plate_8", "punch_coarse", "doubled_rows")]
        runs += [run("a", problem="doubled_equation", **LOST), run("b", problem="doubled_equation")]
        assert said(runs, "(doubled_rows)") == (
            "With every contact point given twice (doubled_rows) the certificate confirms 2 of 2 runs on a single "
            "inner problem, with each given once (plate_8) 2 of the same, no solver differs."
        )
        assert said(runs, "(doubled_equation)").endswith(
            "(punch_coarse) 2 of the same: fewer are certified with a (1); more have no answer with a (1)."
        )
        assert [line[-4:] for line in tables.twins(runs).grid.rows] == [
            ("0 % of 1", "1", "100 % of 1", "0"), ("100 % of 1", "0", "100 % of 1", "0"),
        ]  # fmt: skip

    def test_what_fails_without_doubling_too_is_not_blamed_on_it(self):
        runs = [run(problem=name, **LOST) for name in ("plate_8", "doubled_rows")]
        assert said(runs, "(doubled_rows)").endswith("0 of the same, no solver differs.")
        assert not said([run(problem="doubled_rows", **LOST)], "(doubled_rows)")

    def test_graded_cells_are_compared_with_as_many_equal_ones(self):
        runs = [run(problem="graded_8", **FAILED), run(), run(problem="plate_4", **FAILED)]
        assert "in all unknowns 100 % on equal cells and 0 % on graded ones (of 1 each)." in said(runs, "graded cells")

    @pytest.mark.parametrize(
        ("ratio", "told"),
        [(0.8, "less with a (0.8)"), (0.85, "the same within a factor of 1.2 with a"),
         (1.15, "the same within a factor of 1.2 with a"), (1.3, "more with a (1.3)")],
    )  # fmt: skip
    def test_a_warm_start_gains_only_beyond_what_means_nothing(self, ratio, told):
        runs = [run(task="cold"), run(task="warm", seconds=ratio)]
        assert said(runs, "warm sequence").endswith(f"geometric mean of 1 sequence, {told}.")

    def test_the_limits_of_what_means_anything_are_those_of_the_findings(self):
        limitations = " ".join(report_of(StoredStudy({"name": "solvers", "cases": 0}, ())).limitations)
        assert f"between 0.83 and {measures.NEGLIGIBLE:g} mean nothing" in limitations
        assert "about √ε only" in limitations

    @pytest.mark.parametrize(
        ("seconds", "told"), [(1.1, "takes about as long as condensed"), (3.0, "takes 3 times as")]
    )
    def test_forms_that_take_as_long_are_told_so(self, seconds, told):
        assert told in said([run(seconds=seconds), run(form="condensed")], "in all unknowns takes")


class TestInfeasible:
    """Problems without a solution."""

    def test_nobody_is_called_nobody(self):
        runs = [run(problem="pulled_block", certified=False, outcomes={GAVE_UP: 1})]
        assert said(runs, "called every").startswith("No back end, out of 1 back end given all of them, called every")
        assert said(runs, "without a solution", "said") == (
            'No back end said "solved" of an inner problem without a solution.'
        )

    def test_only_who_was_given_all_of_them_recognised_every_one(self):
        runs = [run(solver, problem="pulled_block") for solver in "ab"] + [run("a", problem="dragged_block")]
        assert "infeasible by a, out of 1 back end given all of them" in said(runs, "Every inner problem")
        assert not said([runs[1], runs[2]], "inner problem without a solution infeasible")
        assert not said([runs[1], runs[2]], "Every inner problem")


class TestTimes:
    """Means of times."""

    def test_failures_count_the_limit_in_the_mean_named_so(self):
        runs = [run(seconds=1.0, limit=30.0), run(problem="plate_4", limit=30.0, **FAILED)]
        assert measures.mean_with_failures(runs) == pytest.approx(measures.shifted_mean([1.0, 30.0]))
        assert measures.mean_with_failures([run()]) == pytest.approx(1.0)
        assert measures.mean_with_failures([run(), run(problem="plate_4", **FAILED)]) is None
        assert measures.mean_with_failures([]) is None
        table = tables.speeds(runs, "inner", "single")
        assert "the whole time limit of a case (30 s)" in table.reading
        cells = dict(zip(table.grid.headings, table.grid.rows[0], strict=True))
        assert (cells["mid: mean time"], cells["mid: mean, failures at the limit"]) == ("1 s (1)", "5.48 s")

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
        finished, ended = measures.runs_of(rows)
        assert (finished.limit, finished.options, finished.accuracy) == (30.0, {"omega_T": 0.02}, 1e-7)
        assert (ended.limit, ended.time, ended.lost) == (30.0, None, True)
        assert "the one step ω_T = 0.02" in said([finished], "The method uzawa")

    def test_medians_of_even_numbers_lie_half_way(self):
        runs = [run(problem=name, accuracy=value) for name, value in (("plate_4", 1e-3), ("plate_8", 3e-3))]
        assert tables.errors(runs).grid.rows[0][2] == "2.0e-3"
        assert measures.median([]) is None


def test_whatever_came_out_there_is_a_sentence_for_it():
    """Every finding ends as a sentence, names no nobody, and belongs to a table or figure of the report."""
    results = ({}, FAILED, LOST, {"certified": False, "outcomes": {GAVE_UP: 1}, "accuracy": 1e-4})
    report = report_of(StoredStudy({"name": "solvers", "cases": 0}, ()))
    names = {each.name for each in exhibits(report)}
    problems = ("plate_8", "graded_8", "doubled_rows", "pulled_block")
    for first, second, solvers in itertools.product(results, results, (("a",), ("a", "condensed"), ("uzawa",))):
        runs = [
            run(solver, problem=problem, task=task, form=form, **(first if form == "full" else second))
            for solver, problem, task, form in itertools.product(
                solvers, problems, ("inner", "cold", "warm", "outer"), ("full", "condensed")
            )
        ]
        for finding in findings(runs):
            assert finding.text.endswith(".")
            assert "none" not in finding.text.split()
            assert finding.see in names
    assert findings([]) == []
