"""The comparison of solvers: its table of settings, what answers are worth, and what is said of them."""

import math
import re
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
from pandas import DataFrame, Series

from comparisons.lab.study import Row
from comparisons.solvers import accuracies, figures, measures, tasks
from comparisons.solvers import report as tables
from comparisons.solvers.measures import numbers_of
from comparisons.solvers.outcomes import FALSE_ALARM, GAVE_UP, MODEST, NO_ANSWER, RIGHT, UNTRUE, outcome
from comparisons.solvers.problems import PROBLEMS, Described, Instance, instance
from comparisons.solvers.study import QUICK, declared, keep
from qvi_contact import InputError
from solvers import Status, available, solve_qvi
from solvers.inner.guard import BackendFailure, attempt
from solvers.inner.problem import InnerSolution
from solvers.inner.registry import make_inner

INNER_SOLVERS = [name for name in accuracies.installed() if name not in accuracies.METHODS]
CASE = {
    "task": "inner", "problem": "plate_4", "form": "condensed", "level": "mid", "solver": "qp:quadprog", "runs": 1,
    "repeat": 0, "seed": 0,
}  # fmt: skip
ENVIRONMENT = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}


def row(case, returned, status="done", reason=""):
    """A stored row of what the task returned."""
    result = dict(returned)
    certificate = result.pop("certificate", None)
    return Row(0, "", case, status, reason, result, certificate, 0.1, "", 0.0, ENVIRONMENT)


def run(outcomes=None, **changes):
    """The entries of a run, as `frame_of` takes them."""
    return {
        "solver": "a", "task": "inner", "problem": "plate_8", "form": "full", "level": "mid", "seconds": 1.0,
        "certified": True, "status": "solved", "reason": "", **(outcomes or {RIGHT: 1}), **changes,
    }  # fmt: skip


class Fake:
    """An inner solver that always says the same, of the bonded state without multipliers."""

    packages = ()

    def __init__(self, status, *given):
        self.status, self.qvi = status, given[1]

    def solve(self, *_):
        nothing = np.zeros(self.qvi.m)
        z, nu = np.zeros(self.qvi.n), np.zeros(self.qvi.p)
        return InnerSolution(z, nothing, nothing, nu, self.status, 3, 0.0, f"fake: {self.status}")


def said_by_fake(monkeypatch, status, **case):
    monkeypatch.setattr(tasks, "make_inner", partial(Fake, status))
    tasks._first_use.cache_clear()
    return tasks.solve_case({**CASE, **case})


class TestAccuracies:
    """What solvers are asked for."""

    def test_the_table_has_every_installed_back_end_and_says_what_each_is(self):
        assert not accuracies.without_row()
        assert set(available()) <= set(accuracies.TABLE)
        assert all(set(each.levels) == set(accuracies.LEVELS) for each in accuracies.TABLE.values())

    def test_what_is_not_compared_names_the_extra_that_brings_it(self):
        ways = dict(tables.left_out(measures.frame_of([])).rows)
        assert set(ways) == set(accuracies.TABLE)
        named = {name: re.findall(r"qvi-contact\[(\w+)\]", way) for name, way in ways.items()}
        assert {name for name in named if name.endswith(":cvxopt")} == {
            name for name, extras in named.items() if extras == ["cvxopt"]
        }
        assert [name for name, extras in named.items() if not extras] == list(accuracies.METHODS)

    def test_at_least_twelve_back_ends_are_compared_in_the_quick_study(self):
        solvers = {case.values["solver"] for case in declared(accuracies.installed(), quick=True).cases}
        assert len(solvers - set(accuracies.METHODS)) >= 12
        assert set(accuracies.METHODS) <= solvers

    @pytest.mark.parametrize("solver", accuracies.TABLE)
    def test_tolerances_are_a_hundredth_of_the_level_unless_the_solver_takes_none_so_small(self, solver):
        for level, tolerance in accuracies.LEVELS.items():
            asked = {
                value for name, value in accuracies.options(solver, level).items()
                if name != "omega_T" and isinstance(value, float) and 0.0 < value < 0.1 and "regular" not in name
            }  # fmt: skip
            least = 1e-10 if solver == "qp:highs" else 0.0
            expected = {max(1e-2 * tolerance, least)} if solver not in ("qp:quadprog", "uzawa") else set()
            assert {float(f"{value:.6e}") for value in asked} == {float(f"{value:.6e}") for value in expected}

    @pytest.mark.parametrize("solver", accuracies.TABLE)
    def test_every_level_sets_the_same_options(self, solver):
        first, *others = [
            {name: type(value) for name, value in accuracies.options(solver, level).items()}
            for level in accuracies.LEVELS
        ]
        assert all(other == first for other in others)

    @pytest.mark.parametrize("solver", INNER_SOLVERS)
    def test_solvers_take_their_options(self, solver):
        problem = instance("plate_4")
        form = problem.form("condensed")
        inner = make_inner(solver, form.problem, 0.5, accuracies.options(solver, "low"))
        found = inner.solve(form.threshold(problem.bound), form.centre(None, None), None)
        assert found.status is Status.SOLVED, found.message

    @pytest.mark.parametrize(
        ("solver", "name"),
        [(solver, name) for solver in INNER_SOLVERS for name in accuracies.options(solver, "mid")],
    )
    def test_every_option_is_one_that_the_solver_reads(self, solver, name):
        """A value that nobody can use must do harm; unknown names are ignored in silence by some."""
        if solver == "qp:highs":
            import highspy

            assert hasattr(highspy.HighsOptions(), name)
            return
        problem = instance("plate_4")
        form = problem.form("condensed")
        options = {**accuracies.options(solver, "mid"), name: object()}

        def answer():  # some complain when built, some when asked
            inner = make_inner(solver, form.problem, 1e-6, options)
            return inner.solve(form.threshold(problem.bound), form.centre(None, None), None)

        found = attempt(solver, answer)
        assert isinstance(found, BackendFailure) or found.status is not Status.SOLVED

    def test_options_replace_what_the_tolerance_stands_for(self):
        problem = instance("plate_4")
        form = problem.form("condensed")
        options = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 1, "polishing": False}
        inner = make_inner("qp:osqp", form.problem, 1e-3, options)
        found = inner.solve(form.threshold(problem.bound), form.centre(None, None), None)
        assert (found.status, found.iterations) == (Status.MAX_ITERATIONS, 1)
        whole = solve_qvi(problem.qvi, method="fixed-point", inner="qp:osqp", inner_options=options, max_iterations=2)
        assert {entry.inner_iterations for entry in whole.history} == {1}

    def test_strict_solvers_take_no_options(self):
        with pytest.raises(InputError, match="tolerance alone"):
            make_inner("strict-direct:clarabel", instance("plate_4").qvi, 1e-6, {"tol_feas": 1e-6})

    def test_a_solver_that_is_not_in_the_table_is_refused(self):
        with pytest.raises(InputError, match="qp:clarabel"):
            accuracies.options("qp:nobody", "mid")


class TestProblems:
    """What they are given."""

    def test_doubled_points_and_equations_leave_the_solution_as_it_was(self):
        for doubled, single in (("doubled_rows", "plate_8"), ("doubled_equation", "punch_coarse")):
            one, two = instance(single), instance(doubled)
            assert two.reference.solved
            assert np.allclose(one.reference.z, two.reference.z, atol=1e-8 * np.abs(one.reference.z).max())
        assert instance("doubled_rows").qvi.W.sum() == pytest.approx(instance("plate_8").qvi.W.sum())
        assert instance("doubled_rows").qvi.m == 2 * instance("plate_8").qvi.m
        assert instance("doubled_equation").qvi.p == 2 * instance("punch_coarse").qvi.p > 0

    @pytest.mark.parametrize("name", [name for name, each in PROBLEMS.items() if not each.feasible])
    def test_problems_without_a_solution_are_proved_to_have_none(self, name):
        assert instance(name).reference.status is Status.INFEASIBLE

    def test_the_dragged_block_is_the_example(self, pytestconfig):
        from qvi_contact import discretize, load_problem

        path = pytestconfig.rootpath / "examples" / "dragged_block_slides.toml"
        example = discretize(load_problem(path).problem, element="bfs").fitted().qvi
        ours = instance("dragged_block").qvi
        assert np.allclose(abs(example.K - ours.K).max(), 0.0)
        assert np.allclose(example.t0, ours.t0)
        assert np.allclose(example.mu, ours.mu)

    def test_bounds_of_a_sequence_approach_that_of_the_solution(self):
        problem = instance("plate_8")
        distances = [np.abs(bound - problem.bound).max() for bound in problem.bounds]
        assert len(distances) >= 5
        assert distances[-1] < 1e-2 * distances[0]

    def test_a_sequence_begins_after_the_step_that_it_is_posed_at(self):
        problem = instance("graded_8")
        centre = problem.centre("condensed")
        after = problem.qvi.threshold(np.maximum(-centre.n0, 0.0))
        assert problem.bounds[0] == pytest.approx(after, rel=1e-6, abs=1e-6 * after.max())
        full = problem.centre("full")
        assert full.n0 == pytest.approx(centre.n0, abs=1e-6 * np.abs(centre.n0).max())

    def test_what_is_open_sticks_and_slips_is_the_whole_contact(self):
        facts = instance("ssnv128_8").facts
        assert facts["open"] + facts["stick"] + facts["slip"] == pytest.approx(1.0)
        assert min(facts["open"], facts["stick"], facts["slip"]) > 0.0
        assert instance("stick_8").facts["slip"] == 0.0
        assert instance("graded_8").facts["condition"] > 100.0 * instance("plate_8").facts["condition"]


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
        assert outcome(said, passed, feasible) == expected

    def test_a_solver_that_lies_is_shown_as_such(self, monkeypatch):
        honest = {**CASE, "solver": "qp:quadprog"}
        rows = [row(honest, tasks.solve_case(honest))]
        liar = {**CASE, "solver": "qp:osqp"}
        rows.append(row(liar, said_by_fake(monkeypatch, Status.SOLVED, solver="qp:osqp")))
        runs = measures.runs_of(rows)
        assert runs.certified.tolist() == [True, False]
        assert runs.time.isna().tolist() == [False, True]
        assert (numbers_of(runs)["often"], numbers_of(runs)["seldom"]) == (["qp:osqp (100 % of 1)"], 1)
        told = tables.truth(runs)[["solver", RIGHT, UNTRUE]].to_numpy().tolist()
        assert told == [["qp:quadprog", 1, 0], ["qp:osqp", 0, 1]]
        assert tables.overview(runs).share.tolist() == [0.0, 1.0]

    def test_shares_are_of_what_was_called_solved(self):
        runs = [run(problem=name) for name in ("plate_4", "plate_8", "plate_16")]
        runs += [run(solver="b", outcomes={UNTRUE: 1, RIGHT: 2, GAVE_UP: 5}, certified=False)]
        runs = measures.frame_of(runs)
        assert numbers_of(runs)["often"] == ["b (33 % of 3)"]
        assert tables.truth(runs).true.tolist() == [1.0, pytest.approx(2.0 / 3.0)]

    def test_a_false_alarm_is_shown_as_such(self, monkeypatch):
        honest = {**CASE, "solver": "qp:quadprog"}
        rows = [row(honest, tasks.solve_case(honest))]
        rows.append(row({**CASE, "solver": "qp:osqp"}, said_by_fake(monkeypatch, Status.INFEASIBLE, solver="qp:osqp")))
        runs = measures.runs_of(rows)
        assert numbers_of(runs)["alarms"] == 1
        assert tables.overview(runs)[FALSE_ALARM].tolist() == [0, 1]

    def test_the_lie_that_a_problem_without_solution_is_solved(self, monkeypatch):
        found = said_by_fake(monkeypatch, Status.SOLVED, solver="qp:osqp", problem="pulled_block")
        runs = measures.runs_of([row({**CASE, "solver": "qp:osqp", "problem": "pulled_block"}, found)])
        assert (found["outcomes"], runs.certified.tolist()) == ({UNTRUE: 1}, [False])
        assert numbers_of(runs)["lied"] == 1
        assert tables.infeasible(runs).rows == [("qp:osqp", "solved (1)")]

    @pytest.mark.parametrize("problem", ["pulled_block", "dragged_block"])
    def test_who_says_infeasible_of_what_has_no_solution_is_right(self, problem):
        case = {**CASE, "solver": "qp:quadprog", "problem": problem}
        found = tasks.solve_case(case)
        runs = measures.runs_of([row(case, found)])
        assert (found["status"], found["outcomes"], runs.certified.tolist()) == ("infeasible", {RIGHT: 1}, [True])
        assert numbers_of(runs)["right"] == ["qp:quadprog"]


class TestTasks:
    """What is done in a case."""

    def test_sequences_are_judged_step_by_step(self, monkeypatch):
        found = said_by_fake(monkeypatch, Status.SOLVED, solver="qp:osqp", task="warm")
        assert found["steps"] == len(instance("plate_4").bounds) == sum(found["outcomes"].values())
        assert not found["certificate"]["passed"]
        assert found["iterations"] == 3 * found["steps"]

    def test_warm_keeps_the_object_and_hands_on_the_last_answer_and_cold_does_not(self, monkeypatch):
        made, starts = [], []

        class Watched(Fake):
            def solve(self, *given):
                starts.append(given[2])
                return super().solve(*given)

        def make(*given):
            made.append(given[0])
            return Watched(Status.SOLVED, *given)

        monkeypatch.setattr(tasks, "make_inner", make)
        setup = tasks.Setup(instance("plate_4"), "condensed", "qp:osqp", "mid")
        thresholds = [np.ones(16)] * 3
        tasks._sequence(setup, thresholds, keep=True)
        assert (len(made), [start is None for start in starts]) == (1, [True, False, False])
        made.clear()
        starts.clear()
        tasks._sequence(setup, thresholds, keep=False)
        assert (len(made), starts) == (3, [None] * 3)

    def test_one_wrong_step_fails_a_sequence(self, monkeypatch):
        once = iter([False] * 3 + [True] + [False] * 20)

        class Slipping:
            packages = ()

            def __init__(self, *given):
                self.solver = make_inner(*given)

            def solve(self, *given):
                found = self.solver.solve(*given)
                return replace(found, m_T=found.m_T + 1.0) if next(once) else found

        tasks.solve_case({**CASE, "task": "cold"})  # first use
        monkeypatch.setattr(tasks, "make_inner", Slipping)
        found = tasks.solve_case({**CASE, "task": "cold"})
        assert found["outcomes"] == {RIGHT: found["steps"] - 1, UNTRUE: 1}
        assert not found["certificate"]["passed"]

    def test_errors_and_options_are_told(self):
        found = tasks.solve_case({**CASE, "solver": "direct:clarabel", "level": "low", "runs": 2})
        assert len(found["seconds"]) == 2
        assert found["options"] == accuracies.options("direct:clarabel", "low")
        assert found["accuracy"] == found["certificate"]["accuracy"] <= found["certificate"]["tolerance"] == 1e-3
        largest = max(found["certificate"]["measures"][name] for name in ("equality", "normal", "friction"))
        assert found["primal"] == largest

    @pytest.mark.parametrize("solver", ["condensed", "uzawa", "qp:quadprog"])
    def test_whole_inequalities_are_solved(self, solver):
        found = tasks.solve_case({**CASE, "task": "outer", "solver": solver})
        assert (found["status"], found["certificate"]["passed"]) == ("solved", True)
        assert found["certificate"]["tolerance"] == 1e-6

    def test_the_certificate_is_that_of_the_friction_bound_given(self):
        problem = Instance(Described(PROBLEMS["plate_4"].build, "well conditioned"))
        given = problem.given(problem.bounds[0])
        assert np.array_equal(given.threshold(np.ones(given.m)), problem.bounds[0])


class TestMeasures:
    """What is computed from the runs, against data made by hand."""

    TIMES: ClassVar = {"a": (1.0, 3.0, None, None), "b": (2.0, 3.0, None, 8.0), "c": (None, 6.0, None, 2.0)}

    @pytest.fixture
    def ratios(self):
        """Of four problems; the third nobody solves."""
        problems = ("plate_4", "plate_8", "graded_8", "stick_8")
        return measures.performance_ratios(measures.frame_of([
            run(solver=solver, problem=problem, seconds=seconds, certified=seconds is not None)
            for solver, times in self.TIMES.items() for problem, seconds in zip(problems, times, strict=True)
        ])).loc[[("mid", problem, "full") for problem in problems]]  # fmt: skip

    def test_ratios_with_ties_failures_and_a_problem_that_nobody_solves(self, ratios):
        assert ratios.to_dict("list") == {
            "a": [1, 1, math.inf, math.inf],
            "b": [2, 1, math.inf, 4],
            "c": [math.inf, 2, math.inf, 1],
        }

    def test_profiles_are_shares_of_all_problems(self, ratios):
        assert [measures.profile(ratios["b"], at) for at in (1.0, 2.0, 3.9, 4.0, 1e9)] == [0.25, 0.5, 0.5, 0.75, 0.75]
        assert measures.profile(ratios, 2.0).tolist() == [0.5, 0.5, 0.5]
        assert measures.steps(ratios["b"], 10.0) == ([1.0, 2.0, 4.0, 10.0], [0.25, 0.5, 0.75, 0.75])
        assert measures.steps(Series([math.inf, 20.0]), 10.0) == ([1.0, 10.0], [0.0, 0.0])

    def test_area_is_one_for_the_fastest_and_zero_for_failures(self):
        ratios = DataFrame({"a": [1.0, 1.0, math.nan], "b": [math.inf, 100.0, 1000.0], "c": [10.0, 10.0, 10.0]})
        assert measures.area(ratios, 100.0).tolist() == pytest.approx([1.0, 0.0, 0.5])

    def test_means(self):
        assert measures.shifted_mean(Series([1.0, 4.0]), 0.0) == pytest.approx(2.0)
        assert measures.shifted_mean(Series([0.0, 3.0]), 1.0) == pytest.approx(1.0)
        assert math.isnan(measures.shifted_mean(Series([1.0, math.nan])))
        assert measures.geometric_mean(Series([2.0, 8.0])) == pytest.approx(4.0)
        assert math.isnan(measures.geometric_mean(Series([], dtype=float)))
        assert measures.spread([1.0, 2.0, 4.0]) == 1.5
        assert measures.spread([1.0]) is None

    def test_a_failure_has_no_time_in_ratios_of_warm_and_cold(self):
        runs = [
            run(task="cold", seconds=2.0), run(task="warm", seconds=1.0), run(task="warm", seconds=9.0, level="low"),
            run(task="cold", seconds=3.0, level="high"), run(task="warm", seconds=1.0, level="high", certified=False),
        ]  # fmt: skip
        runs = measures.frame_of(runs)
        assert measures.warm_ratios(runs).ratio.dropna().tolist() == [0.5]
        assert numbers_of(runs)["gaining"] == "a"

    def test_no_two_solvers_look_alike(self):
        looks = figures._looks([["a", "b", "c", "d", "e"], ["e", "f", "a"], ["g"]])
        assert list(looks) == ["a", "b", "c", "d", "e", "f", "g"]
        assert len({colour for colour, _, _ in looks.values()}) == len(looks)
        many = figures._looks([list(accuracies.TABLE)])
        assert len({look[:2] for look in many.values()}) == len(accuracies.TABLE)

    def test_sequences_are_taken_warm_where_they_can_be(self):
        runs = [run(task="cold"), run(task="warm"), run(task="cold", solver="b"), run()]
        used = measures.of_kind(measures.frame_of(runs), "sequence")
        assert [(each.solver, each.task) for each in used.itertuples()] == [("a", "warm"), ("b", "cold")]

    def test_forms_are_compared_on_the_same_problem(self):
        runs = [run(seconds=6.0), run(form="condensed", seconds=2.0), run(problem="plate_16", seconds=5.0)]
        assert measures.condensed_ratios(measures.frame_of(runs), "inner").ratio.tolist() == [3.0]

    def test_a_run_without_an_answer_is_counted_and_has_no_time(self):
        rows = [row(CASE, tasks.solve_case(CASE)), row({**CASE, "solver": "qp:scs"}, {}, "timeout", "more than 1 s")]
        runs = measures.runs_of(rows)
        assert runs.loc[1, [*measures.OUTCOMES]].to_dict() == {**dict.fromkeys(measures.OUTCOMES, 0), NO_ANSWER: 1}
        assert measures.performance_ratios(runs)["qp:scs"].tolist() == [math.inf]
        assert numbers_of(runs)["lost"] == 1
        assert tables.failures(runs).iloc[0][["solver", "status", "runs"]].tolist() == ["qp:scs", "timeout", 1]

    def test_times_of_problems_without_a_solution_are_no_part_of_profiles(self):
        assert measures.performance_ratios(measures.frame_of([run(problem="pulled_block")])).empty


class TestStudy:
    """Which cases there are."""

    CASES = declared(tuple(accuracies.TABLE)).cases

    def test_every_solver_meets_every_kind_of_problem(self):
        kinds = {(case.values["solver"], PROBLEMS[case.values["problem"]].kind) for case in self.CASES}
        assert kinds >= {(solver, each.kind) for solver in INNER_SOLVERS for each in PROBLEMS.values()}

    def test_only_what_keeps_something_is_solved_warm(self):
        warm = {case.values["solver"] for case in self.CASES if case.values["task"] == "warm"}
        assert warm == {name for name, each in accuracies.TABLE.items() if each.keeps}

    def test_methods_of_the_package_solve_whole_inequalities(self):
        chosen = {(each.values["task"], each.values["form"]) for each in self.CASES if each.values["solver"] == "uzawa"}
        assert chosen == {("outer", "condensed")}
        assert not keep({**CASE, "solver": "condensed"})

    def test_the_quick_study_is_another_one_and_smaller(self):
        quick = declared(tuple(accuracies.TABLE), quick=True)
        assert quick.name != declared(tuple(accuracies.TABLE)).name
        assert {case.values["problem"] for case in quick.cases} == set(QUICK)
        assert len(quick.cases) < len(self.CASES) / 5
        assert {case.values["task"] for case in quick.cases} == {"inner", "cold", "warm", "outer"}
