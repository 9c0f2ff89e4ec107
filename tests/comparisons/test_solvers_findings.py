"""What the comparison of solvers says, on runs made up for it: nothing solved, everything solved, ties, few runs."""

import itertools
import math
from collections import Counter

import pytest
from pandas import DataFrame, Series

from comparisons import solvers as room
from comparisons.lab import grid_of, spread
from comparisons.lab.study import Row, read_csv
from comparisons.solvers import GAVE_UP, NO_ANSWER, RIGHT, UNTRUE, frame_of
from tests.comparisons.convergence_parts import REPORTS

FAILED = {"certified": False, "outcomes": {UNTRUE: 1}}
LOST = {"certified": False, "seconds": None, "status": "timeout", "outcomes": {NO_ANSWER: 1}}


def run(solver="a", outcomes=None, **changes):
    """The entries of a run, as `frame_of` takes them."""
    return {
        "solver": solver, "task": "inner", "problem": "plate_8", "form": "full", "level": "mid", "seconds": 1.0,
        "certified": True, "status": "solved", "reason": "", **(outcomes or {RIGHT: 1}), **changes,
    }  # fmt: skip


def numbers(runs):
    return room.numbers_of(frame_of(runs))


def ranked(runs):
    return room.ranking(frame_of(runs), "inner")


def lines(table, runs, *columns):
    """The rows of a table as texts, of a frame those of some columns."""
    found = room.tables_of(frame_of(runs))[table]
    return grid_of(found, columns or [*found], room.FORMS).rows if isinstance(found, DataFrame) else found.rows


class TestTruth:
    """How true "solved" is."""

    def test_untrue_answers_count_also_where_nobody_is_certified(self):
        hard = [run(solver, problem="graded_16", **FAILED) for solver in "abc"]
        runs = [run("a"), run("b"), run("c", **FAILED), *hard, run("d"), run("d", problem="graded_16", **LOST)]
        assert room.told_by(frame_of(runs)).loc["a", [RIGHT, UNTRUE, "nobody", "said"]].tolist() == [1, 1, 1, 2]
        found = numbers(runs)
        assert found["often"][0] == "c (100 % of 2)"
        assert (found["seldom"], found["untrue"]) == (1, 4)  # d alone
        assert (found["nobody"], found["nobody_untrue"]) == (1, 3)
        assert found["nobody_at"] == ["graded_16 (single, full, mid)"]
        assert lines("truth", runs, RIGHT, UNTRUE, "nobody")[:3] == [("1", "1", "1")] * 2 + [("0", "2", "1")]
        assert lines("overview", runs, "share") == [("50 %",), ("50 %",), ("100 %",), ("0 %",)]

    def test_a_sequence_with_a_step_that_is_right_is_not_one_that_nobody_solves(self):
        steps = {"certified": False, "outcomes": {UNTRUE: 2, RIGHT: 1}}
        runs = [
            run(task="cold", **steps),
            run("b", task="cold", outcomes={GAVE_UP: 2, room.MODEST: 1}, certified=False),
        ]
        assert numbers(runs)["nobody_at"] == []
        assert numbers([run(**FAILED), *runs])["nobody_at"] == ["plate_8 (single, full, mid)"]


class TestErrors:
    """How errors fall with what is asked."""

    @staticmethod
    def falling(solver, power, **changes):
        return [run(solver, level=level, accuracy=3.0 * room.asked(level) ** power, **changes) for level in room.LEVELS]

    def test_powers_are_those_of_the_data(self):
        runs = [*self.falling("a", 0.5), *self.falling("b", 1.0), run("c", level="low", accuracy=1e-3)]
        assert room.error_powers(frame_of(runs)) == {"a": pytest.approx(0.5), "b": pytest.approx(1.0)}

    def test_only_problems_with_an_answer_at_both_ends_count(self):
        runs = [*self.falling("a", 0.5), run("a", problem="plate_16", level="low", accuracy=1e3)]
        runs += [run("a", problem="plate_4", level=level, accuracy=None) for level in room.LEVELS]
        assert room.error_powers(frame_of(runs)) == {"a": pytest.approx(0.5)}


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
        (axes,) = room.profiles(frame_of([run("a"), run("b", **FAILED)])).axes
        assert len(axes.lines) == 2
        assert [text.get_text() for text in axes.get_legend().get_texts()] == ["a (1 of 1)"]


class TestComparisons:
    """One thing against another."""

    def test_doubled_rows_are_compared_with_the_same_rows_given_once(self):
        runs = [run(solver, problem=name) for solver in "ab" for name in ("plate_8", "graded_8")]
        runs += [run("a", problem="doubled_rows", **LOST), run("b", problem="doubled_rows")]
        assert [line[-4:] for line in lines("twins", runs)] == [
            ("0 % of 1", "1", "100 % of 1", "0"), ("100 % of 1", "0", "100 % of 1", "0"),
        ]  # fmt: skip

    @pytest.mark.parametrize(
        ("ratio", "told"),
        [(0.8, ("a", "none")), (0.85, ("none", "none")), (1.15, ("none", "none")), (1.3, ("none", "a"))],
    )
    def test_a_warm_start_gains_only_beyond_what_means_nothing(self, ratio, told):
        found = numbers([run(task="cold"), run(task="warm", seconds=ratio)])
        assert (found["gaining"], found["losing"]) == told


class TestInfeasible:
    """Problems without a solution."""

    def test_nobody_recognises_what_is_not_called_infeasible(self):
        found = numbers([run(problem="pulled_block", certified=False, outcomes={GAVE_UP: 1})])
        assert (found["asked"], found["right"], found["lied"]) == (1, [], 0)
        assert numbers([run(problem="pulled_block", **FAILED)])["lied"] == 1


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
            assert lines("times-inner", runs, "mid: mean time", "mid: mean, failures at the limit") == [means]
        assert room.tables_of(frame_of([]))["times-inner"].empty

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
        runs = room.runs_of(rows)
        finished, ended = runs.itertuples()
        assert (finished.limit, finished.options, finished.accuracy) == (30.0, {"omega_T": 0.02}, 1e-7)
        assert (ended.limit, ended.lost) == (30.0, True)
        assert math.isnan(ended.time)
        assert room.numbers_of(runs)["methods"][0]["step"] == 0.02


class TestMeasures:
    """Performance profiles and means, against data made by hand."""

    def test_profiles_with_ties_failures_and_a_problem_that_nobody_solves(self):
        times = {"a": (1.0, 3.0, None, None), "b": (2.0, 3.0, None, 8.0), "c": (None, 6.0, None, 2.0)}
        problems = ("plate_4", "plate_8", "graded_8", "stick_8")
        ratios = room.performance_ratios(frame_of([
            run(solver, problem=problem, seconds=seconds, certified=seconds is not None)
            for solver, each in times.items() for problem, seconds in zip(problems, each, strict=True)
        ])).loc[[("mid", problem, "full") for problem in problems]]  # fmt: skip
        inf = math.inf
        assert ratios.to_dict("list") == {"a": [1, 1, inf, inf], "b": [2, 1, inf, 4], "c": [inf, 2, inf, 1]}
        assert [room.profile(ratios["b"], at) for at in (1.0, 2.0, 3.9, 4.0, 1e9)] == [0.25, 0.5, 0.5, 0.75, 0.75]
        assert room.profile(ratios, 2.0).tolist() == [0.5, 0.5, 0.5]
        assert room.steps(ratios["b"], 10.0) == ([1.0, 2.0, 4.0, 10.0], [0.25, 0.5, 0.75, 0.75])
        assert room.steps(Series([inf, 20.0]), 10.0) == ([1.0, 10.0], [0.0, 0.0])
        assert room.performance_ratios(frame_of([run(problem="pulled_block")])).empty

    def test_area_is_one_for_the_fastest_and_zero_for_failures(self):
        ratios = DataFrame({"a": [1.0, 1.0, math.nan], "b": [math.inf, 100.0, 1000.0], "c": [10.0, 10.0, 10.0]})
        assert room.area(ratios, 100.0).tolist() == pytest.approx([1.0, 0.0, 0.5])

    def test_means(self):
        assert room.shifted_mean(Series([1.0, 4.0]), 0.0) == pytest.approx(2.0)
        assert room.shifted_mean(Series([0.0, 3.0]), 1.0) == pytest.approx(1.0)
        assert math.isnan(room.shifted_mean(Series([1.0, math.nan])))
        assert room.geometric_mean(Series([2.0, 8.0])) == pytest.approx(4.0)
        assert math.isnan(room.geometric_mean(Series([], dtype=float)))
        assert spread([1.0, 2.0, 4.0]) == 1.5
        assert spread([1.0]) is spread([0.0, 0.0]) is None

    def test_a_failure_has_no_time_in_ratios(self):
        runs = frame_of([
            run(task="cold", seconds=2.0), run(task="warm", seconds=1.0), run(task="warm", seconds=9.0, level="low"),
            run(task="cold", seconds=3.0, level="high"), run(task="warm", seconds=1.0, level="high", certified=False),
        ])  # fmt: skip
        assert room.warm_ratios(runs).ratio.dropna().tolist() == [0.5]
        assert room.numbers_of(runs)["gaining"] == "a"
        runs = [run(seconds=6.0), run(form="condensed", seconds=2.0), run(problem="plate_16", seconds=5.0)]
        assert room.condensed_ratios(frame_of(runs), "inner").ratio.tolist() == [3.0]

    def test_no_two_solvers_look_alike(self):
        pytest.importorskip("matplotlib")
        quick = [run(solver, seconds=1.0 + number) for number, solver in enumerate(room.TABLE)]
        (axes,) = room.profiles(frame_of(quick)).axes
        looks = [(line.get_color(), line.get_linestyle()) for line in axes.lines if line.get_label()[0] != "_"]
        assert len(set(looks)) == len(looks) >= 5

    def test_shares_are_of_what_was_called_solved(self):
        runs = [run(problem=name) for name in ("plate_4", "plate_8", "plate_16")]
        runs += [run(solver="b", outcomes={UNTRUE: 1, RIGHT: 2, GAVE_UP: 5}, certified=False)]
        assert numbers(runs)["often"] == ["b (33 % of 3)"]
        assert lines("truth", runs, "true") == [("100 %",), ("67 %",)]


def test_counts_of_the_committed_run_are_those_of_its_rows():
    rows = read_csv(REPORTS / "solvers" / "solvers.csv.gz")
    found, told = room.numbers_of(room.runs_of(rows)), Counter[str]()
    feasible = [row for row in rows if room.PROBLEMS[row.case["problem"]].feasible]
    certified = [row for row in feasible if row.certificate and row.certificate["passed"]]
    assert (found["feasible"], found["certified"]) == (len(feasible), len(certified))
    for row in feasible:
        if row.case["task"] != "outer" and row.status == "done":
            told[row.case["solver"]] += row.result["outcomes"].get(UNTRUE, 0)
    assert room.told_by(room.runs_of(rows))[UNTRUE].to_dict() == dict(told)


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
