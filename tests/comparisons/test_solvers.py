"""The comparison of solvers: its table of settings, its problems, and what answers are worth."""

import re
from contextlib import contextmanager

import numpy as np
import pytest

from comparisons import solvers as room
from comparisons.lab.study import Row
from qvi_contact import InputError
from solvers import Status, available, solve_qvi
from solvers.inner import BackendFailure, attempt, make_inner

INNER_SOLVERS = [name for name in room.installed() if name not in room.METHODS]
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
    room.solve_case(case)
    with quadprog_says(answer):
        return row(case, room.solve_case(case))


def asked_of(solver, tolerance, given, problem="plate_4"):
    """The answer of an inner solver with these options."""
    posed = room.instance(problem)
    form = posed.form("condensed")
    inner = make_inner(solver, form.problem, tolerance, given)
    return inner.solve(form.threshold(posed.bound), form.centre(None, None), None)


class TestAccuracies:
    """What solvers are asked for."""

    def test_the_table_has_every_installed_back_end_and_says_what_each_is(self):
        assert not room.without_row()
        assert set(available()) <= set(room.TABLE)
        assert all(set(each.levels) == set(room.LEVELS) for each in room.TABLE.values())

    def test_what_is_not_compared_names_the_library_that_it_needs(self):
        ways = dict(room.left_out(room.frame_of([])).rows)
        assert set(ways) == set(room.TABLE)
        named = {name: re.findall(r"pip install (\w+)", way) for name, way in ways.items()}
        assert {name for name in named if name.endswith(":cvxopt")} == {
            name for name, libraries in named.items() if libraries == ["cvxopt"]
        }
        assert [name for name, libraries in named.items() if not libraries] == list(room.METHODS)

    @pytest.mark.parametrize("solver", room.TABLE)
    def test_tolerances_are_a_hundredth_of_the_level_unless_the_solver_takes_none_so_small(self, solver):
        types = []
        for level, tolerance in room.LEVELS.items():
            given = room.options(solver, level)
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
        found = asked_of(solver, 0.5, room.options(solver, "low"))
        assert found.status is Status.SOLVED, found.message

    @pytest.mark.parametrize(
        ("solver", "name"), [(solver, name) for solver in INNER_SOLVERS for name in room.options(solver, "mid")]
    )
    def test_every_option_is_one_that_the_solver_reads(self, solver, name):
        """A value that nobody can use must do harm; unknown names are ignored in silence by some."""
        if solver == "qp:highs":
            import highspy

            assert hasattr(highspy.HighsOptions(), name)
            return
        given = {**room.options(solver, "mid"), name: object()}
        found = attempt(solver, lambda: asked_of(solver, 1e-6, given))  # some complain when built, some when asked
        assert isinstance(found, BackendFailure) or found.status is not Status.SOLVED

    def test_options_replace_what_the_tolerance_stands_for(self):
        given = {"eps_abs": 1e-9, "eps_rel": 1e-9, "max_iter": 1, "polishing": False}
        found = asked_of("qp:osqp", 1e-3, given)
        assert (found.status, found.iterations) == (Status.MAX_ITERATIONS, 1)
        qvi = room.instance("plate_4").qvi
        whole = solve_qvi(qvi, method="fixed-point", inner="qp:osqp", inner_options=given, max_iterations=2)
        assert {entry.inner_iterations for entry in whole.history} == {1}

    def test_a_solver_that_is_not_in_the_table_is_refused(self):
        with pytest.raises(InputError, match="qp:clarabel"):
            room.options("qp:nobody", "mid")


class TestProblems:
    """What they are given."""

    def test_doubled_points_leave_the_solution_as_it_was(self):
        one, two = room.instance("plate_8"), room.instance("doubled_rows")
        assert two.reference.solved
        assert np.allclose(one.reference.z, two.reference.z, atol=1e-8 * np.abs(one.reference.z).max())
        assert two.qvi.W.sum() == pytest.approx(one.qvi.W.sum())
        assert two.qvi.m == 2 * one.qvi.m

    def test_problems_without_a_solution_are_proved_to_have_none(self):
        for name in (name for name, each in room.PROBLEMS.items() if not each.feasible):
            assert room.instance(name).reference.status is Status.INFEASIBLE

    def test_bounds_of_a_sequence_approach_that_of_the_solution(self):
        problem = room.instance("plate_8")
        distances = [np.abs(bound - problem.bound).max() for bound in problem.bounds]
        assert len(distances) >= 5
        assert distances[-1] < 1e-2 * distances[0]

    def test_a_sequence_begins_after_the_step_that_it_is_posed_at(self):
        problem = room.instance("graded_8")
        centre, full = problem.centre("condensed"), problem.centre("full")
        after = problem.qvi.threshold(np.maximum(-centre.n0, 0.0))
        assert problem.bounds[0] == pytest.approx(after, rel=1e-6, abs=1e-6 * after.max())
        assert full.n0 == pytest.approx(centre.n0, abs=1e-6 * np.abs(centre.n0).max())

    def test_what_is_open_sticks_and_slips_is_the_whole_contact(self):
        facts = room.instance("ssnv128_4").facts
        assert facts["open"] + facts["stick"] + facts["slip"] == pytest.approx(1.0)
        assert min(facts["open"], facts["stick"], facts["slip"]) > 0.0
        assert room.instance("stick_8").facts["slip"] == 0.0
        assert room.instance("graded_8").facts["condition"] > 100.0 * room.instance("plate_8").facts["condition"]

    def test_the_certificate_is_that_of_the_friction_bound_given(self):
        problem = room.Instance(room.Described(room.PROBLEMS["plate_4"].build, "well conditioned"))
        given = problem.given(problem.bounds[0])
        assert np.array_equal(given.threshold(np.ones(given.m)), problem.bounds[0])


class TestOutcomes:
    """What their answers are worth."""

    @pytest.mark.parametrize(
        ("said", "passed", "feasible", "expected"),
        [
            (Status.SOLVED, True, True, room.RIGHT),
            (Status.SOLVED, False, True, room.UNTRUE),
            (Status.SOLVED, False, False, room.UNTRUE),
            (Status.SOLVED, True, False, room.UNTRUE),
            (Status.INFEASIBLE, False, False, room.RIGHT),
            (Status.INFEASIBLE, False, True, room.FALSE_ALARM),
            (Status.UNBOUNDED, False, True, room.FALSE_ALARM),
            (Status.UNBOUNDED, False, False, room.GAVE_UP),
            (Status.INACCURATE, True, True, room.MODEST),
            (Status.MAX_ITERATIONS, False, True, room.GAVE_UP),
            (Status.BACKEND_FAILED, False, False, room.GAVE_UP),
        ],
    )
    def test_what_an_answer_is_worth(self, said, passed, feasible, expected):
        assert room.outcome(said, passed, feasible) == expected

    def test_a_solver_that_lies_is_shown_as_such(self):
        honest = {**CASE, "solver": "qp:daqp"}
        runs = room.runs_of([row(honest, room.solve_case(honest)), said(doubled)])
        assert runs.certified.tolist() == [True, False]
        assert runs.time.isna().tolist() == [False, True]
        assert (room.numbers_of(runs)["often"], room.numbers_of(runs)["seldom"]) == (["qp:quadprog (100 % of 1)"], 1)
        told = room.tables_of(runs)["truth"][["solver", room.RIGHT, room.UNTRUE]].to_numpy().tolist()
        assert sorted(told) == [["qp:daqp", 1, 0], ["qp:quadprog", 0, 1]]
        assert sorted(room.tables_of(runs)["overview"].share) == [0.0, 1.0]

    def test_a_false_alarm_is_shown_as_such(self):
        runs = room.runs_of([said(contradiction)])
        assert room.numbers_of(runs)["alarms"] == 1
        assert room.tables_of(runs)["overview"][room.FALSE_ALARM].tolist() == [1]

    @pytest.mark.parametrize("problem", ["pulled_block", "dragged_block"])
    def test_who_says_infeasible_of_what_has_no_solution_is_right(self, problem):
        case = {**CASE, "problem": problem}
        found = room.solve_case(case)
        runs = room.runs_of([row(case, found)])
        assert (found["status"], found["outcomes"], runs.certified.tolist()) == ("infeasible", {room.RIGHT: 1}, [True])
        assert room.numbers_of(runs)["right"] == ["qp:quadprog"]

    def test_the_lie_that_a_problem_without_solution_is_solved(self):
        found = {"outcomes": {room.UNTRUE: 1}, "status": "solved", "seconds": [1.0], "options": {}, "message": ""}
        runs = room.runs_of([row({**CASE, "problem": "pulled_block"}, found)])
        assert (runs.certified.tolist(), room.numbers_of(runs)["lied"]) == ([False], 1)
        assert room.tables_of(runs)["infeasible"].rows == [("qp:quadprog", "solved (1)")]

    def test_a_run_without_an_answer_is_counted_and_has_no_time(self):
        runs = room.runs_of(
            [row(CASE, room.solve_case(CASE)), row({**CASE, "solver": "qp:scs"}, {}, "timeout", "late")]
        )
        assert runs.loc[1, [*room.OUTCOMES]].to_dict() == {**dict.fromkeys(room.OUTCOMES, 0), room.NO_ANSWER: 1}
        assert room.performance_ratios(runs)["qp:scs"].tolist() == [np.inf]
        assert room.numbers_of(runs)["lost"] == 1
        failures = room.tables_of(runs)["failures"]
        assert failures.iloc[0][["solver", "status", "runs"]].tolist() == ["qp:scs", "timeout", 1]


class TestTasks:
    """What is done in a case."""

    def test_sequences_are_judged_step_by_step(self):
        """One wrong step fails a sequence."""
        lie = said(lambda found, call: doubled(found) if call == 4 else found, task="cold")
        assert lie.result["steps"] == len(room.instance("plate_4").bounds)
        assert lie.result["outcomes"] == {room.RIGHT: lie.result["steps"] - 1, room.UNTRUE: 1}
        assert not lie.certificate["passed"]
        assert said(doubled, task="cold").result["outcomes"] == {room.UNTRUE: lie.result["steps"]}

    @pytest.mark.parametrize("solver", ["qp:proxqp", "socp:scs"])
    def test_warm_hands_on_the_last_answer_and_cold_does_not(self, solver):
        cold, warm = (room.solve_case({**CASE, "solver": solver, "task": task}) for task in ("cold", "warm"))
        assert cold["outcomes"] == warm["outcomes"] == {room.RIGHT: cold["steps"]}
        assert warm["iterations"] < 0.9 * cold["iterations"]

    def test_errors_and_options_are_told(self):
        found = room.solve_case({**CASE, "solver": "direct:clarabel", "level": "low", "runs": 2})
        assert len(found["seconds"]) == 2
        assert found["options"] == room.options("direct:clarabel", "low")
        assert found["accuracy"] == found["certificate"]["accuracy"] <= found["certificate"]["tolerance"] == 1e-3
        largest = max(found["certificate"]["measures"][name] for name in ("equality", "normal", "friction"))
        assert found["primal"] == largest

    @pytest.mark.parametrize("solver", ["condensed", "uzawa", "qp:quadprog"])
    def test_whole_inequalities_are_solved(self, solver):
        found = room.solve_case({**CASE, "task": "outer", "solver": solver})
        assert (found["status"], found["certificate"]["passed"]) == ("solved", True)
        assert found["certificate"]["tolerance"] == 1e-6


class TestStudy:
    """Which cases there are."""

    CASES = room.declared(tuple(room.TABLE)).cases

    def test_the_quick_study_has_all_tasks_and_a_dozen_solvers(self):
        quick = room.declared(room.installed(), quick=True)
        assert {case.values["problem"] for case in quick.cases} == set(room.QUICK)
        assert {case.values["task"] for case in quick.cases} == {"inner", "cold", "warm", "outer"}
        solvers = {case.values["solver"] for case in quick.cases}
        assert len(solvers - set(room.METHODS)) >= 12
        assert set(room.METHODS) <= solvers
