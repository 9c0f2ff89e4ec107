"""The comparison of solvers: settings, problems, what answers are worth, and what is said of runs made up for it."""

import itertools
import math
from collections import Counter
from contextlib import contextmanager

import numpy as np
import pytest
from pandas import DataFrame, Series

from comparisons.solvers import accuracies, problems, study
from comparisons.solvers import report as room
from comparisons.solvers.report import performance_ratios, runs_of, tables_of, values_of
from comparisons.solvers.study import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE
from qvi_contact import InputError
from solvers import Status, available, solve_qvi
from solvers.inner import BackendFailure, attempt, make_inner
from tests.comparisons.parts import committed, row

INNER_SOLVERS = [name for name in accuracies.installed() if name not in accuracies.METHODS]
CASE = {
    "task": "inner", "problem": "plate_4", "form": "condensed", "level": "mid", "solver": "qp:quadprog", "runs": 1,
}  # fmt: skip


@contextmanager
def quadprog_says(answer):
    """The back end quadprog returns `answer(its own answer, number of the call)` instead of its own answer."""
    from qpsolvers.solvers import quadprog_

    honest, calls = quadprog_.solve_qp, []

    def solve(*problem, **more):
        calls.append(problem)
        return answer(honest(*problem, **more), len(calls))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quadprog_, "solve_qp", solve)
        yield calls


def doubled(found, _=0):
    """Twice its multipliers."""
    return (*found[:4], 2.0 * found[4], *found[5:])


def contradiction(*_):
    raise ValueError("constraints are inconsistent, no solution")


def said(answer, **more):
    """The row of a case that quadprog answers so; it has loaded all it needs before."""
    case = {**CASE, **more}
    study.solve_case(case)
    with quadprog_says(answer):
        return row(case, study.solve_case(case))


def asked_of(solver, tolerance, given, problem="plate_4"):
    """The answer of an inner solver with these options."""
    posed = problems.instance(problem)
    form = posed.form("condensed")
    inner = make_inner(solver, form.problem, tolerance, given)
    return inner.solve(form.threshold(posed.bound), form.centre(None, None), None)


class TestAccuracies:
    """What solvers are asked for."""

    def test_the_table_has_every_installed_back_end_and_says_what_each_is(self):
        assert set(available()) <= set(accuracies.TABLE)
        assert all(set(each.levels) == set(accuracies.LEVELS) for each in accuracies.TABLE.values())

    @pytest.mark.parametrize("solver", accuracies.TABLE)
    def test_tolerances_are_a_hundredth_of_the_level_unless_the_solver_takes_none_so_small(self, solver):
        types = []
        for level, tolerance in accuracies.LEVELS.items():
            given = accuracies.options(solver, level)
            types.append({name: type(value) for name, value in given.items()})
            values = {
                value for name, value in given.items()
                if name != "omega_T" and isinstance(value, float) and 0.0 < value < 0.1 and "regular" not in name
            }  # fmt: skip
            least = 1e-10 if solver == "qp:highs" else 0.0
            expected = {max(1e-2 * tolerance, least)} if solver not in ("qp:quadprog", "uzawa") else set()
            assert {float(f"{value:.6e}") for value in values} == {float(f"{value:.6e}") for value in expected}
        assert all(each == types[0] for each in types)  # every level sets the same options

    @pytest.mark.parametrize("solver", INNER_SOLVERS)
    def test_solvers_take_their_options(self, solver):
        found = asked_of(solver, 0.5, accuracies.options(solver, "low"))
        assert found.status is Status.SOLVED, found.message

    @pytest.mark.parametrize(
        ("solver", "name"), [(solver, name) for solver in INNER_SOLVERS for name in accuracies.options(solver, "mid")]
    )
    def test_every_option_is_one_that_the_solver_reads(self, solver, name):
        """A value that nobody can use must do harm; unknown names are ignored in silence by some."""
        if solver == "qp:highs":
            import highspy

            assert hasattr(highspy.HighsOptions(), name)
            return
        given = {**accuracies.options(solver, "mid"), name: object()}
        found = attempt(solver, lambda: asked_of(solver, 1e-6, given))  # some complain when built, some when asked
        assert isinstance(found, BackendFailure) or found.status is not Status.SOLVED

    def test_options_replace_what_the_tolerance_stands_for(self):
        given = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 1, "polishing": False}
        found = asked_of("qp:osqp", 1e-3, given)
        assert (found.status, found.iterations) == (Status.MAX_ITERATIONS, 1)
        qvi = problems.instance("plate_4").qvi
        whole = solve_qvi(qvi, method="fixed-point", inner="qp:osqp", inner_options=given, max_iterations=2)
        assert {entry.inner_iterations for entry in whole.history} == {1}

    def test_a_solver_that_is_not_in_the_table_is_refused(self):
        with pytest.raises(InputError, match="qp:clarabel"):
            accuracies.options("qp:nobody", "mid")


class TestProblems:
    """What they are given."""

    def test_doubled_points_leave_the_solution_as_it_was(self):
        one, two = problems.instance("plate_8"), problems.instance("doubled_rows")
        assert two.reference.solved
        assert np.allclose(one.reference.z, two.reference.z, atol=1e-8 * np.abs(one.reference.z).max())
        assert two.qvi.W.sum() == pytest.approx(one.qvi.W.sum())
        assert two.qvi.m == 2 * one.qvi.m

    def test_problems_without_a_solution_are_proved_to_have_none(self):
        for name in (name for name, each in problems.PROBLEMS.items() if not each.feasible):
            assert problems.instance(name).reference.status is Status.INFEASIBLE

    def test_bounds_of_a_sequence_approach_that_of_the_solution(self):
        problem = problems.instance("plate_8")
        distances = [np.abs(bound - problem.bound).max() for bound in problem.bounds]
        assert len(distances) >= 5
        assert distances[-1] < 1e-2 * distances[0]

    def test_a_sequence_begins_after_the_step_that_it_is_posed_at(self):
        problem = problems.instance("graded_8")
        centre, full = problem.centre("condensed"), problem.centre("full")
        after = problem.qvi.threshold(np.maximum(-centre.n0, 0.0))
        assert problem.bounds[0] == pytest.approx(after, rel=1e-6, abs=1e-6 * after.max())
        assert full.n0 == pytest.approx(centre.n0, abs=1e-6 * np.abs(centre.n0).max())

    def test_what_is_open_sticks_and_slips_is_the_whole_contact(self):
        facts = problems.instance("ssnv128_4").facts
        assert facts["open"] + facts["stick"] + facts["slip"] == pytest.approx(1.0)
        assert min(facts["open"], facts["stick"], facts["slip"]) > 0.0
        assert problems.instance("stick_8").facts["slip"] == 0.0
        assert (
            problems.instance("graded_8").facts["condition"] > 100.0 * problems.instance("plate_8").facts["condition"]
        )

    def test_the_certificate_is_that_of_the_friction_bound_given(self):
        problem = problems.Instance(problems.Described(problems.PROBLEMS["plate_4"].build, "well conditioned"))
        given = problem.given(problem.bounds[0])
        assert np.array_equal(given.threshold(np.ones(given.m)), problem.bounds[0])


class TestOutcomes:
    """What their answers are worth."""

    @pytest.mark.parametrize(
        ("said", "passed", "feasible", "expected"),
        [
            (Status.SOLVED, True, True, RIGHT),
            (Status.SOLVED, False, True, UNTRUE),
            (Status.SOLVED, False, False, UNTRUE),
            (Status.SOLVED, True, False, UNTRUE),
            (Status.INFEASIBLE, False, False, RIGHT),
            (Status.INFEASIBLE, False, True, FALSE_ALARM),
            (Status.UNBOUNDED, False, True, FALSE_ALARM),
            (Status.UNBOUNDED, False, False, GAVE_UP),
            (Status.INACCURATE, True, True, MODEST),
            (Status.MAX_ITERATIONS, False, True, GAVE_UP),
            (Status.BACKEND_FAILED, False, False, GAVE_UP),
        ],
    )
    def test_what_an_answer_is_worth(self, said, passed, feasible, expected):
        assert study.outcome(said, passed, feasible) == expected

    def test_a_solver_that_lies_is_shown_as_such(self):
        honest = {**CASE, "solver": "qp:daqp"}
        runs = runs_of([row(honest, study.solve_case(honest)), said(doubled)])
        assert runs.certified.tolist() == [True, False]
        assert runs.time.isna().tolist() == [False, True]
        assert (values_of(runs)["often"], values_of(runs)["seldom"]) == (["qp:quadprog (100 % of 1)"], 1)
        told = tables_of(runs)["truth"][["solver", RIGHT, UNTRUE]].to_numpy().tolist()
        assert sorted(told) == [["qp:daqp", 1, 0], ["qp:quadprog", 0, 1]]
        assert sorted(tables_of(runs)["overview"].share) == [0.0, 1.0]

    def test_a_false_alarm_is_shown_as_such(self):
        runs = runs_of([said(contradiction)])
        assert values_of(runs)["alarms"] == 1
        assert tables_of(runs)["overview"][FALSE_ALARM].tolist() == [1]

    @pytest.mark.parametrize("problem", ["pulled_block", "dragged_block"])
    def test_who_says_infeasible_of_what_has_no_solution_is_right(self, problem):
        case = {**CASE, "problem": problem}
        found = study.solve_case(case)
        runs = runs_of([row(case, found)])
        assert (found["status"], found["outcomes"], runs.certified.tolist()) == ("infeasible", {RIGHT: 1}, [True])
        assert values_of(runs)["right"] == ["qp:quadprog"]

    def test_the_lie_that_a_problem_without_solution_is_solved(self):
        found = {"outcomes": {UNTRUE: 1}, "status": "solved", "seconds": [1.0], "options": {}, "message": ""}
        runs = runs_of([row({**CASE, "problem": "pulled_block"}, found)])
        assert (runs.certified.tolist(), values_of(runs)["lied"]) == ([False], 1)
        assert tables_of(runs)["infeasible"].to_numpy().tolist() == [["qp:quadprog", "solved (1)"]]

    def test_a_run_without_an_answer_is_counted_and_has_no_time(self):
        runs = runs_of([row(CASE, study.solve_case(CASE)), row({**CASE, "solver": "qp:scs"}, {}, "timeout", "late")])
        assert runs.loc[1, [*room.OUTCOMES]].to_dict() == {**dict.fromkeys(room.OUTCOMES, 0), NO_ANSWER: 1}
        assert performance_ratios(runs)["qp:scs"].tolist() == [np.inf]
        assert tables_of(runs)["truth"][NO_ANSWER].tolist() == [0, 1]


class TestTasks:
    """What is done in a case."""

    def test_sequences_are_judged_step_by_step(self):
        """One wrong step fails a sequence."""
        lie = said(lambda found, call: doubled(found) if call == 4 else found, task="cold")
        assert lie.result["steps"] == len(problems.instance("plate_4").bounds)
        assert lie.result["outcomes"] == {RIGHT: lie.result["steps"] - 1, UNTRUE: 1}
        assert not lie.certificate["passed"]
        assert said(doubled, task="cold").result["outcomes"] == {UNTRUE: lie.result["steps"]}

    @pytest.mark.parametrize("solver", ["qp:proxqp", "socp:scs"])
    def test_warm_hands_on_the_last_answer_and_cold_does_not(self, solver):
        cold, warm = (study.solve_case({**CASE, "solver": solver, "task": task}) for task in ("cold", "warm"))
        assert cold["outcomes"] == warm["outcomes"] == {RIGHT: cold["steps"]}
        assert warm["iterations"] < 0.9 * cold["iterations"]

    def test_errors_and_options_are_told(self):
        found = study.solve_case({**CASE, "solver": "direct:clarabel", "level": "low", "runs": 2})
        assert len(found["seconds"]) == 2
        assert found["options"] == accuracies.options("direct:clarabel", "low")
        assert found["accuracy"] == found["certificate"]["accuracy"] <= found["certificate"]["tolerance"] == 1e-3
        largest = max(found["certificate"]["measures"][name] for name in ("equality", "normal", "friction"))
        assert found["primal"] == largest

    @pytest.mark.parametrize("solver", ["condensed", "uzawa", "qp:quadprog"])
    def test_whole_inequalities_are_solved(self, solver):
        found = study.solve_case({**CASE, "task": "outer", "solver": solver})
        assert (found["status"], found["certificate"]["passed"]) == ("solved", True)
        assert found["certificate"]["tolerance"] == 1e-6


class TestStudy:
    """Which cases there are."""

    def test_the_quick_study_has_all_tasks_and_a_dozen_solvers(self):
        quick = study.declared(accuracies.installed(), quick=True).cases
        assert len(quick) < len(study.declared(accuracies.installed()).cases) / 2
        assert {case["problem"] for case in quick} == set(study.QUICK)
        assert {case["task"] for case in quick} == {"inner", "cold", "warm", "outer"}
        solvers = {case["solver"] for case in quick}
        assert len(solvers - set(accuracies.METHODS)) >= 12
        assert set(accuracies.METHODS) <= solvers


FAILED = {"certified": False, "outcomes": {UNTRUE: 1}}
LOST = {"certified": False, "seconds": None, "status": "timeout", "outcomes": {NO_ANSWER: 1}}


def run(solver="a", outcomes=None, **changes):
    """A row of a run: how it ended, its outcomes, its time; certified if nothing else is said."""
    known = {"task": "inner", "problem": "plate_8", "form": "full", "level": "mid", "seconds": 1.0, "certified": True,
             "status": "solved", "limit": None, "options": None} | changes  # fmt: skip
    case = {name: known.pop(name) for name in ("task", "problem", "form", "level")} | {"solver": solver}
    if known["seconds"] is None:
        return row(case, {}, known["status"], timeout_seconds=known["limit"])
    result = {
        "status": known["status"], "seconds": [known["seconds"]], "options": known["options"],
        "outcomes": outcomes or {RIGHT: 1}, "certificate": {"passed": known["certified"]},
    }  # fmt: skip
    return row(case, result, timeout_seconds=known["limit"])


def numbers(runs):
    return values_of(runs_of(runs))


def ranked(runs):
    return room.ranking(runs_of(runs), "inner")


def values(table, runs, *columns):
    """Columns of a table."""
    return tables_of(runs_of(runs))[table][[*columns]].to_numpy().tolist()


class TestTruth:
    """How true "solved" is."""

    def test_untrue_answers_count_also_where_nobody_is_certified(self):
        hard = [run(solver, problem="graded_16", **FAILED) for solver in "abc"]
        runs = [run("a"), run("b"), run("c", **FAILED), *hard, run("d"), run("d", problem="graded_16", **LOST)]
        assert room.told_by(runs_of(runs)).loc["a", [RIGHT, UNTRUE, "nobody", "said"]].tolist() == [1, 1, 1, 2]
        found = numbers(runs)
        assert found["often"][0] == "c (100 % of 2)"
        assert (found["seldom"], found["untrue"]) == (1, 4)  # d alone
        assert (found["nobody"], found["nobody_untrue"]) == (1, 3)
        assert found["nobody_at"] == ["graded_16 (single, full, mid)"]
        assert values("truth", runs, RIGHT, UNTRUE, "nobody")[:3] == [[1, 1, 1], [1, 1, 1], [0, 2, 1]]
        assert values("overview", runs, "share") == [[0.5], [0.5], [1.0], [0.0]]

    def test_a_sequence_with_a_step_that_is_right_is_not_one_that_nobody_solves(self):
        steps = {"certified": False, "outcomes": {UNTRUE: 2, RIGHT: 1}}
        runs = [
            run(task="cold", **steps),
            run("b", task="cold", outcomes={GAVE_UP: 2, MODEST: 1}, certified=False),
        ]
        assert numbers(runs)["nobody_at"] == []
        assert numbers([run(**FAILED), *runs])["nobody_at"] == ["plate_8 (single, full, mid)"]


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
        (axes,) = room.profiles(runs_of([run("a"), run("b", **FAILED)])).axes
        assert len(axes.lines) == 2
        assert [text.get_text() for text in axes.get_legend().get_texts()] == ["a (1 of 1)"]


class TestComparisons:
    """One thing against another."""

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
            ([run(), run(problem="plate_4", seconds=2.0, **FAILED)], ("1 s (1)", "none")),
            ([limited], ("none", "30 s")),
        ):
            found = tables_of(runs_of(runs))["times-inner"].astype(object).fillna("none")
            assert found[["mid: mean time", "mid: mean, failures at the limit"]].to_numpy().tolist() == [[*means]]


class TestMeasures:
    """Performance profiles and means, against data made by hand."""

    def test_profiles_with_ties_failures_and_a_problem_that_nobody_solves(self):
        times = {"a": (1.0, 3.0, None, None), "b": (2.0, 3.0, None, 8.0), "c": (None, 6.0, None, 2.0)}
        problems = ("plate_4", "plate_8", "graded_8", "stick_8")
        ratios = performance_ratios(runs_of([
            run(solver, problem=problem, seconds=seconds, certified=seconds is not None)
            for solver, each in times.items() for problem, seconds in zip(problems, each, strict=True)
        ])).loc[[("mid", problem, "full") for problem in problems]]  # fmt: skip
        inf = math.inf
        assert ratios.to_dict("list") == {"a": [1, 1, inf, inf], "b": [2, 1, inf, 4], "c": [inf, 2, inf, 1]}
        assert [room.profile(ratios["b"], at) for at in (1.0, 2.0, 3.9, 4.0, 1e9)] == [0.25, 0.5, 0.5, 0.75, 0.75]
        assert room.profile(ratios, 2.0).tolist() == [0.5, 0.5, 0.5]
        assert room.steps(ratios["b"], 10.0) == ([1.0, 2.0, 4.0, 10.0], [0.25, 0.5, 0.75, 0.75])
        assert room.steps(Series([inf, 20.0]), 10.0) == ([1.0, 10.0], [0.0, 0.0])
        assert performance_ratios(runs_of([run(problem="pulled_block")])).empty

    def test_area_is_one_for_the_fastest_and_zero_for_failures(self):
        ratios = DataFrame({"a": [1.0, 1.0, math.nan], "b": [math.inf, 100.0, 1000.0], "c": [10.0, 10.0, 10.0]})
        assert room.area(ratios, 100.0).tolist() == pytest.approx([1.0, 0.0, 0.5])

    def test_means(self):
        shifted = Series([1.0, 4.0]) - room.SHIFT
        assert room.shifted_mean(shifted) == pytest.approx(2.0 - room.SHIFT)
        assert math.isnan(room.shifted_mean(Series([1.0, math.nan])))
        assert room.geometric_mean(Series([2.0, 8.0])) == pytest.approx(4.0)
        assert math.isnan(room.geometric_mean(Series([], dtype=float)))

    def test_a_failure_has_no_time_in_ratios(self):
        runs = runs_of([
            run(task="cold", seconds=2.0), run(task="warm", seconds=1.0), run(task="warm", seconds=9.0, level="low"),
            run(task="cold", seconds=3.0, level="high"), run(task="warm", seconds=1.0, level="high", certified=False),
        ])  # fmt: skip
        assert room.warm_ratios(runs).ratio.dropna().tolist() == [0.5]
        assert values_of(runs)["gaining"] == "a"
        runs = [run(seconds=6.0), run(form="condensed", seconds=2.0), run(problem="plate_16", seconds=5.0)]
        assert room.condensed_ratios(runs_of(runs), "inner").ratio.tolist() == [3.0]

    def test_no_two_solvers_look_alike(self):
        pytest.importorskip("matplotlib")
        quick = [run(solver, seconds=1.0 + number) for number, solver in enumerate(accuracies.TABLE)]
        (axes,) = room.profiles(runs_of(quick)).axes
        looks = [(line.get_color(), line.get_linestyle()) for line in axes.lines if line.get_label()[0] != "_"]
        assert len(set(looks)) == len(looks) >= 5

    def test_shares_are_of_what_was_called_solved(self):
        runs = [run(problem=name) for name in ("plate_4", "plate_8", "plate_16")]
        runs += [run(solver="b", outcomes={UNTRUE: 1, RIGHT: 2, GAVE_UP: 5}, certified=False)]
        assert numbers(runs)["often"] == ["b (33 % of 3)"]
        assert values("truth", runs, "true") == [[1.0], [pytest.approx(2.0 / 3.0)]]


def test_counts_of_the_committed_run_are_those_of_its_rows():
    rows = committed("solvers")
    found, told = values_of(runs_of(rows)), Counter[str]()
    feasible = [row for row in rows if problems.PROBLEMS[row.case["problem"]].feasible]
    certified = [row for row in feasible if row.certificate and row.certificate["passed"]]
    assert (found["feasible"], found["certified"]) == (len(feasible), len(certified))
    for each in feasible:
        if each.case["task"] != "outer" and each.status == "done":
            told[each.case["solver"]] += each.result["outcomes"].get(UNTRUE, 0)
    assert room.told_by(runs_of(rows))[UNTRUE].to_dict() == dict(told)


def test_whatever_came_out_there_are_numbers():
    """Also of rows that all failed."""
    results = ({}, FAILED, LOST, {"certified": False, "outcomes": {GAVE_UP: 1}})
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
