"""What is done for one case of the study: a solver, a task, a problem, a form, a level of accuracy.

| task  | what is timed                                                                                       |
|-------|-----------------------------------------------------------------------------------------------------|
| inner | the inner problem with the bound of the solution: the solver's object made, and solved              |
| cold  | the bounds that an outer loop meets, one after the other, each with a new object and no start       |
| outer | the whole inequality: the fixed point on σ_N with this inner solver, or a method of the package     |

Before anything is timed the solver does the task once on the smallest problem, so that imports and first uses do not
count. Problem and form are there already: the factorisation of K and the condensation of an inner problem belong to no
solver. Inner problems are posed at `Instance.centre`, the same for all solvers. Every run of an outer loop with
condensed inner problems condenses anew; the package's own methods find what they need in the factors.
"""

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any, Final, NamedTuple

from comparisons.lab.studies import PACKAGES, Study
from comparisons.solvers import accuracies
from comparisons.solvers.accuracies import LEVELS, METHODS
from comparisons.solvers.problems import PROBLEMS, Instance, instance
from solvers import Certificate, certify, solve_qvi
from solvers.basics.status import Status
from solvers.inner.problem import InnerSolution
from solvers.inner.registry import make_inner

INNER, COLD, OUTER = "inner", "cold", "outer"
TASKS: Final = (INNER, COLD, OUTER)

BUDGET: Final = 1.0
"""Seconds after which a run is not repeated any more."""

_FIRST: Final = "plate_4"


class Answer(NamedTuple):
    """What a solver said of one problem, and what the certificate says."""

    status: Status
    message: str
    iterations: int
    certificate: Certificate


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the study; see the module for what a case is.

    "steps" is the number of answers, "outcomes" that of each outcome; "status" and "message" are those of the first
    answer that was not solved, or else of the last, "iterations" those of all, "seconds" wall times of the runs,
    "accuracy" and "certificate" those of the worst step, where there is a solution.
    """
    task, problem, feasible = case["task"], instance(case["problem"]), PROBLEMS[case["problem"]].feasible
    _first_use(task, case["form"], case["solver"], case["level"])
    answers, seconds = _repeated(problem, task, case["form"], case["solver"], case["level"], case["runs"])
    told = next((each for each in answers if each.status is not Status.SOLVED), answers[-1])
    counts = Counter(outcome(each.status, each.certificate.passed, feasible) for each in answers)
    found: dict[str, Any] = {
        "steps": len(answers), "outcomes": dict(sorted(counts.items())), "status": told.status.value,
        "message": " ".join(told.message.split()), "iterations": sum(each.iterations for each in answers),
        "seconds": seconds, "options": accuracies.options(case["solver"], case["level"]),
    }  # fmt: skip
    if not feasible:
        return found
    worst = max((each.certificate for each in answers), key=lambda certificate: certificate.accuracy)
    certificate = {name: getattr(worst, name) for name in ("passed", "tolerance", "accuracy", "worst")}
    return {**found, "accuracy": worst.accuracy, "certificate": certificate}


@cache
def _first_use(task: str, form: str, solver: str, level: str) -> None:
    """Once in a process, on the smallest problem."""
    _repeated(instance(_FIRST), task, form, solver, level, runs=1)


def _repeated(
    problem: Instance, task: str, form: str, solver: str, level: str, runs: int
) -> tuple[list[Answer], list[float]]:
    """Answers of the first run, and wall times of up to `runs` runs, fewer where they take long."""
    run = _outer if task == OUTER else _inner
    found, answers = run(problem, task, form, solver, level)
    seconds = [found]
    while len(seconds) < runs and sum(seconds) < BUDGET:
        seconds.append(run(problem, task, form, solver, level)[0])
    return answers, seconds


def _inner(problem: Instance, task: str, name: str, solver: str, level: str) -> tuple[float, list[Answer]]:
    """Inner problems, all posed at one centre.

    They are judged by the certificate of the inner problem on the original data, in all unknowns whatever the form.
    """
    form, options, tolerance = problem.form(name), accuracies.options(solver, level), LEVELS[level]
    bounds, centre = (problem.bound,) if task == INNER else problem.bounds, problem.centre(name)
    thresholds, found = [form.threshold(bound) for bound in bounds], list[InnerSolution]()
    began = time.perf_counter()
    for threshold in thresholds:
        made = make_inner(solver, form.problem, accuracies.asked(level), options)
        found.append(made.solve(threshold, centre, None))
    seconds, answers = time.perf_counter() - began, []
    for bound, inner in zip(bounds, found, strict=True):
        given, result = problem.given(bound), form.expand(inner) if inner.finite else None
        if result is None:
            certificate = certify(given, None, None, None, None, tolerance)
        else:
            certificate = certify(given, result.z, result.m_N, result.m_T, result.nu, tolerance)
        answers.append(Answer(inner.status, inner.message, inner.iterations, certificate))
    return seconds, answers


def _outer(problem: Instance, task: str, form: str, solver: str, level: str) -> tuple[float, list[Answer]]:  # noqa: ARG001
    settings: dict[str, Any] = {"method": solver, **accuracies.options(solver, level)}
    if solver not in METHODS:
        settings = {
            "method": "fixed-point", "inner": solver, "form": form,
            "inner_options": accuracies.options(solver, level), "inner_tolerance": accuracies.asked(level),
        }  # fmt: skip
    _ = problem.bound  # factorises K and computes the bonded state
    began = time.perf_counter()
    found = solve_qvi(problem.qvi, tolerance=LEVELS[level], **settings)
    seconds = time.perf_counter() - began
    return seconds, [Answer(found.status, found.message, found.iterations, found.certificate)]


FORMS: Final = ("full", "condensed")
QUICK: Final = ("plate_8", "graded_8", "ssnv128_4", "dragged_block")
"""Problems of the quick study."""

LIBRARIES: Final = ("daqp", "ecos", "highspy", "osqp", "piqp", "proxsuite", "qpalm", "quadprog", "scs")
"""Distributions of solvers beside those of most studies."""


def declared(solvers: Sequence[str], quick: bool = False) -> Study:
    """The study of these solvers."""
    names, runs, kept = (QUICK, 2, _quick) if quick else (tuple(PROBLEMS), 3, keep)
    factors = {
        "task": TASKS,
        "problem": names,
        "form": FORMS,
        "level": tuple(LEVELS),
        "solver": solvers,
        "runs": (runs,),
    }
    cases = [dict(zip(factors, values, strict=True)) for values in product(*factors.values())]
    task = "comparisons.solvers.study:solve_case"
    return Study("solvers", 3, task, [case for case in cases if kept(case)], (*PACKAGES, *LIBRARIES))


def keep(values: Mapping[str, Any]) -> bool:
    """Whether a case is part of the full study.

    * Methods of the package solve whole inequalities, condensed; the rest of the table does everything.
    * Sequences only where there is a solution, and where the bounds change: not where everything sticks.
    * On fine meshes in all unknowns only single inner problems.
    """
    task, form, solver = values["task"], values["form"], values["solver"]
    described = PROBLEMS[values["problem"]]
    if solver in METHODS and (task, form) != (OUTER, "condensed"):
        return False
    if task == COLD and (not described.feasible or described.kind == "sticking"):
        return False
    return task == INNER or form == "condensed" or described.small


def _quick(values: Mapping[str, Any]) -> bool:
    """Sequences and outer loops only condensed, at one level, and where there is a solution."""
    single = values["task"] == INNER
    feasible = PROBLEMS[values["problem"]].feasible
    return keep(values) and (single or (values["form"] == "condensed" and values["level"] == "mid" and feasible))


# What an answer was worth: what the solver said of it, beside what the certificate says.
#
# | outcome       | said              | problem with a solution               | problem without          |
# |---------------|-------------------|---------------------------------------|--------------------------|
# | right         | solved            | certificate passes                    | -                        |
# | right         | infeasible        | -                                     | always                   |
# | untrue        | solved            | certificate fails                     | always                   |
# | false alarm   | infeasible        | always                                | -                        |
# | modest        | anything else     | certificate passes                    | -                        |
# | gave up       | anything else     | certificate fails                     | always                   |
#
# "Untrue" is a lie told in good faith: the solver's own test passed. Unbounded counts as infeasible where there is a
# solution, and as giving up where there is none.


RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP = "right", "untrue", "false alarm", "modest", "gave up"

NO_ANSWER: Final = "no answer"
"""Of a run that ended without a result: out of time or memory, or the process died."""


def outcome(said: Status, passed: bool, feasible: bool) -> str:
    """The outcome of an answer, see the module."""
    if said is Status.SOLVED:
        return RIGHT if passed and feasible else UNTRUE
    if said is Status.INFEASIBLE and not feasible:
        return RIGHT
    if said in (Status.INFEASIBLE, Status.UNBOUNDED) and feasible:
        return FALSE_ALARM
    return MODEST if passed and feasible else GAVE_UP
