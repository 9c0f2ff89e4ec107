"""The comparison of solvers: settings, problems, what answers are worth, and what is said of runs made up for it."""

from contextlib import contextmanager

import numpy as np
import pytest

from comparisons.solvers import accuracies, study
from comparisons.solvers import report as room
from solvers import Status, available, solve_qvi
from solvers.inner import BackendFailure, attempt, make_inner
from tests.comparisons.conftest import row

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
    posed = study.instance(problem)
    form = posed.form("condensed")
    inner = make_inner(solver, form.problem, tolerance, given)
    return inner.solve(form.threshold(posed.bound), form.centre(None, None), None)


class TestAccuracies:
    """What solvers are asked for."""

    def test_the_table_has_every_installed_back_end_and_says_what_each_is(self):
        assert set(available()) <= set(accuracies.TABLE)
        assert all(set(each.levels) == set(accuracies.LEVELS) for each in accuracies.TABLE.values())

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
        qvi = study.instance("plate_4").qvi
        whole = solve_qvi(qvi, method="fixed-point", inner="qp:osqp", inner_options=given, max_iterations=2)
        assert {entry.inner_iterations for entry in whole.history} == {1}


class TestProblems:
    """What they are given."""

    def test_doubled_points_leave_the_solution_as_it_was(self):
        one, two = study.instance("plate_8"), study.instance("doubled_rows")
        assert two.reference.solved
        assert np.allclose(one.reference.z, two.reference.z, atol=1e-8 * np.abs(one.reference.z).max())
        assert two.qvi.W.sum() == pytest.approx(one.qvi.W.sum())
        assert two.qvi.m == 2 * one.qvi.m

    def test_problems_without_a_solution_are_proved_to_have_none(self):
        for name in (name for name, each in study.PROBLEMS.items() if not each.feasible):
            assert study.instance(name).reference.status is Status.INFEASIBLE

    def test_bounds_of_a_sequence_approach_that_of_the_solution(self):
        problem = study.instance("plate_8")
        distances = [np.abs(bound - problem.bound).max() for bound in problem.bounds]
        assert len(distances) >= 5
        assert distances[-1] < 1e-2 * distances[0]

    def test_a_sequence_begins_after_the_step_that_it_is_posed_at(self):
        problem = study.instance("graded_8")
        centre, full = problem.centre("condensed"), problem.centre("full")
        after = problem.qvi.threshold(np.maximum(-centre.n0, 0.0))
        assert problem.bounds[0] == pytest.approx(after, rel=1e-6, abs=1e-6 * after.max())
        assert full.n0 == pytest.approx(centre.n0, abs=1e-6 * np.abs(centre.n0).max())


class TestOutcomes:
    """What their answers are worth."""

    @pytest.mark.parametrize(
        ("said", "passed", "feasible", "expected"),
        [(Status.SOLVED, True, True, study.RIGHT), (Status.SOLVED, False, True, study.UNTRUE),
         (Status.SOLVED, False, False, study.UNTRUE), (Status.SOLVED, True, False, study.UNTRUE),
         (Status.INFEASIBLE, False, False, study.RIGHT),
         (Status.INFEASIBLE, False, True, study.FALSE_ALARM),
         (Status.UNBOUNDED, False, True, study.FALSE_ALARM), (Status.UNBOUNDED, False, False, study.GAVE_UP),
         (Status.INACCURATE, True, True, study.MODEST),
         (Status.MAX_ITERATIONS, False, True, study.GAVE_UP),
         (Status.BACKEND_FAILED, False, False, study.GAVE_UP)],
    )  # fmt: skip
    def test_what_an_answer_is_worth(self, said, passed, feasible, expected):
        assert study.outcome(said, passed, feasible) == expected

    def test_a_solver_that_lies_is_shown_as_such(self):
        honest = {**CASE, "solver": "qp:daqp"}
        runs = room.runs_of([row(honest, study.solve_case(honest)), said(doubled)])
        assert runs.certified.tolist() == [True, False]
        assert runs.time.isna().tolist() == [False, True]
        assert (room.values_of(runs)["often"], room.values_of(runs)["seldom"]) == (["qp:quadprog (100 % of 1)"], 1)
        told = room.tables_of(runs)["truth"][["solver", study.RIGHT, study.UNTRUE]].to_numpy().tolist()
        assert sorted(told) == [["qp:daqp", 1, 0], ["qp:quadprog", 0, 1]]
        assert sorted(room.tables_of(runs)["overview"].share) == [0.0, 1.0]

    def test_a_false_alarm_is_shown_as_such(self):
        runs = room.runs_of([said(contradiction)])
        assert room.values_of(runs)["alarms"] == 1
        assert room.tables_of(runs)["overview"][study.FALSE_ALARM].tolist() == [1]

    @pytest.mark.parametrize("problem", ["pulled_block", "dragged_block"])
    def test_who_says_infeasible_of_what_has_no_solution_is_right(self, problem):
        case = {**CASE, "problem": problem}
        found = study.solve_case(case)
        runs = room.runs_of([row(case, found)])
        assert (found["status"], found["outcomes"], runs.certified.tolist()) == ("infeasible", {study.RIGHT: 1}, [True])
        assert room.values_of(runs)["right"] == ["qp:quadprog"]


class TestTasks:
    """What is done in a case."""

    def test_sequences_are_judged_step_by_step(self):
        """One wrong step fails a sequence."""
        lie = said(lambda found, call: doubled(found) if call == 4 else found, task="cold")
        assert lie.result["steps"] == len(study.instance("plate_4").bounds)
        assert lie.result["outcomes"] == {study.RIGHT: lie.result["steps"] - 1, study.UNTRUE: 1}
        assert not lie.certificate["passed"]
        assert said(doubled, task="cold").result["outcomes"] == {study.UNTRUE: lie.result["steps"]}

    @pytest.mark.parametrize("solver", ["qp:proxqp", "socp:scs"])
    def test_a_start_saves_iterations(self, solver):
        problem = study.instance("plate_4")
        form, centre, options = (
            problem.form("condensed"),
            problem.centre("condensed"),
            accuracies.options(solver, "mid"),
        )
        cold, warm, last = 0, 0, None
        kept = make_inner(solver, form.problem, accuracies.asked("mid"), options)
        for bound in problem.bounds:
            threshold = form.threshold(bound)
            alone = make_inner(solver, form.problem, accuracies.asked("mid"), options).solve(threshold, centre, None)
            last = kept.solve(threshold, centre, last)
            cold, warm = cold + alone.iterations, warm + last.iterations
        assert warm < 0.9 * cold

    def test_errors_and_options_are_told(self):
        found = study.solve_case({**CASE, "solver": "direct:clarabel", "level": "low", "runs": 2})
        assert len(found["seconds"]) == 2
        assert found["options"] == accuracies.options("direct:clarabel", "low")
        assert found["accuracy"] == found["certificate"]["accuracy"] <= found["certificate"]["tolerance"] == 1e-3

    @pytest.mark.parametrize("solver", ["condensed", "uzawa", "qp:quadprog"])
    def test_whole_inequalities_are_solved(self, solver):
        found = study.solve_case({**CASE, "task": "outer", "solver": solver})
        assert (found["status"], found["certificate"]["passed"]) == ("solved", True)
        assert found["certificate"]["tolerance"] == 1e-6


def test_the_quick_study_has_all_tasks_and_a_dozen_solvers():
    quick = study.declared(accuracies.installed(), quick=True).cases
    assert len(quick) < len(study.declared(accuracies.installed()).cases) / 2
    assert {case["problem"] for case in quick} == set(study.QUICK)
    assert {case["task"] for case in quick} == {"inner", "cold", "outer"}
    solvers = {case["solver"] for case in quick}
    assert len(solvers - set(accuracies.METHODS)) >= 12
    assert set(accuracies.METHODS) <= solvers
