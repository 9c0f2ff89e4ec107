"""The task of one case of the study: a solver, a task, a problem, a form, a level of accuracy.

| task  | what is timed                                                                                       |
|-------|-----------------------------------------------------------------------------------------------------|
| inner | construction and solve of the inner problem with the friction bound of the solution                 |
| cold  | the inner problems of an outer loop one after the other, each with a new object and a cold start    |
| outer | the whole inequality: the fixed point on σ_N with this inner solver, or a method of the package     |

Before times are taken the solver runs the task once on the smallest problem, so that imports do not count. Problem and
form exist before: the factorisation of K and the condensation of an inner problem are not timed. Inner problems are
posed about `Instance.centre`, the same for all solvers. Every run of an outer loop in condensed form condenses anew;
the package's own methods compute what they need from the factors.

The algebraic problems are built once in each process:

| name            | problem                                                                                         |
|-----------------|-------------------------------------------------------------------------------------------------|
| plate_n         | the paper's plate, μ = 0.2, n × n of its elements: well conditioned, slip and stick             |
| graded_n        | the same, each cell 0.6 times the one before it: badly conditioned                              |
| stick_n         | the same on equal cells, μ = 2: no point slips                                                  |
| ssnv128_n       | Code_Aster's SSNV128 on n × n cells cut into triangles: a part opens, slips, sticks             |
| doubled_rows    | plate_8 with every contact point twice, at half the weight: rows that depend on each other      |
| pulled_block    | a block pulled off its ground: no solution                                                      |

Bodies other than the plate are on triangles of degree 4, with the law at Gauss points. On the plate the rows of N and T
are dependent also without doubling: an edge has four points and two or three parameters.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.sparse import csc_array, vstack

from comparisons.convergence.bodies import dragged_block
from comparisons.lab.studies import PACKAGES, Study
from comparisons.solvers import accuracies
from comparisons.solvers.accuracies import LEVELS, METHODS
from qvi_contact import ContactProblem, discretize, paper
from qvi_contact.gallery import ssnv128
from solvers import Certificate, FrictionQVI, Law, QVISolution, certify, solve_qvi
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.fixed_point import ProblemForm, make_form
from solvers.inner.problem import Centre, InnerSolution
from solvers.inner.registry import make_inner

GRADING: Final = 0.6
STEPS: Final = 6
"""Largest number of friction bounds in a sequence."""

_REFERENCE: Final = 1e-10  # tolerance of the solutions that bounds are taken from
_RECORDED: Final = "direct:clarabel"  # inner solver of the outer loop whose bounds are recorded
_ROUNDS: Final = 2  # solves of the first step, the second at the first one's answer


@dataclass(frozen=True)
class ProblemSpec:
    """A problem before it is built: kind, whether it has a solution, and whether all tasks run in all unknowns."""

    build: Callable[[], FrictionQVI]
    kind: str
    feasible: bool = True
    small: bool = True


class Instance:
    """A problem, and the reference solution, friction bounds and forms that its runs share."""

    def __init__(self, spec: ProblemSpec) -> None:
        self.spec = spec
        self.qvi = spec.build()

    @cached_property
    def reference(self) -> QVISolution:
        """The solution by the condensed method. It gives friction bounds only; results are judged by certificates."""
        return solve_qvi(self.qvi, tolerance=_REFERENCE)

    @cache  # noqa: B019  # an instance is kept for the process
    def form(self, name: str) -> ProblemForm:
        """The problem in this form; its making is not part of any time."""
        return make_form(self.qvi, name)

    @cached_property
    def bound(self) -> Vector:
        """The friction bound (m,) of the inner problem: that of the solution, or of the bonded state without one."""
        if not self.spec.feasible:
            return self._first_bound
        return self.qvi.threshold(self.qvi.pressure(self.reference.z))

    @cached_property
    def bounds(self) -> tuple[Vector, ...]:
        """The friction bounds of the plain outer loop after its first step, up to the first that it cannot solve."""
        form = self.form("condensed")
        solver = make_inner(_RECORDED, form.problem, _REFERENCE)
        met: list[Vector] = []
        bound, centre = self._first_bound, self.centre("condensed")
        while len(met) <= STEPS:
            found = form.expand(solver.solve(form.threshold(bound), centre, None))
            if not certify(self.qvi.with_bound(bound), found.z, found.m_N, found.m_T, found.nu, 1e-6).passed:
                break
            met.append(bound)
            bound = self.qvi.threshold(self.qvi.pressure(found.z))
        return tuple(met[1:])

    @cache  # noqa: B019
    def centre(self, name: str) -> Centre:
        """The state z about which all inner problems are posed: the answer of the outer loop's first step.

        The outer loop poses each problem about its last answer, too, so that rounding in the data decays. For problems
        without a solution the centre is the bonded state.
        """
        form = self.form(name)
        centre = form.centre(None, None)
        for _ in range(_ROUNDS if self.spec.feasible else 0):
            solver = make_inner(_RECORDED, form.problem, _REFERENCE)
            found = solver.solve(form.threshold(self._first_bound), centre, None)
            if not found.finite:
                break
            centre = form.centre(found, form.expand(found))
        return centre

    @property
    def _first_bound(self) -> Vector:
        """The bound (m,) of the outer loop's first step, that of the bonded state."""
        return self.qvi.threshold(self.qvi.pressure(self.qvi.bonded))


@cache
def instance(name: str) -> Instance:
    """The problem of this name, kept for the process."""
    return Instance(PROBLEMS[name])


def _algebra(problem: ContactProblem) -> FrictionQVI:
    return discretize(problem, law_on="points").qvi


def _plate(cells: int, friction: float = 0.2, grading: float = 1.0) -> Callable[[], FrictionQVI]:
    return lambda: paper.plate(friction, (cells, cells), grading=grading).qvi


def _block(drag: float, push: float) -> Callable[[], FrictionQVI]:
    """A block on ground with μ = 0.5 under a uniform stress: σ_yy = −push, σ_xy = drag [MPa]."""
    return lambda: _algebra(dragged_block(0.5, (4, 2), drag, push, 1e4))


def doubled_rows(qvi: FrictionQVI) -> FrictionQVI:
    """The problem with every contact point twice, each at half the weight, so that row multipliers are not unique."""
    N, T = (csc_array(vstack([rows, rows])) for rows in (qvi.N, qvi.T))
    contact = replace(qvi.contact, N=N, T=T, W=np.tile(qvi.W, 2) / 2.0, traces=None)
    loads = replace(qvi.loads, n0=np.tile(qvi.n0, 2), t0=np.tile(qvi.t0, 2))
    law = Law(np.tile(qvi.mu, 2), np.tile(qvi.cohesion, 2), np.tile(qvi.cap, 2), np.tile(qvi.bilateral, 2))
    return FrictionQVI(qvi.stiffness, contact, loads, law)


PROBLEMS: Final[Mapping[str, ProblemSpec]] = {
    "plate_4": ProblemSpec(_plate(4), "well conditioned"),
    "plate_8": ProblemSpec(_plate(8), "well conditioned"),
    "plate_16": ProblemSpec(_plate(16), "well conditioned", small=False),
    "graded_8": ProblemSpec(_plate(8, grading=GRADING), "ill conditioned"),
    "graded_16": ProblemSpec(_plate(16, grading=GRADING), "ill conditioned", small=False),
    "ssnv128_4": ProblemSpec(lambda: _algebra(ssnv128((4, 4))), "open contact"),
    "stick_8": ProblemSpec(_plate(8, friction=2.0), "sticking"),
    "stick_16": ProblemSpec(_plate(16, friction=2.0), "sticking", small=False),
    "doubled_rows": ProblemSpec(lambda: doubled_rows(_plate(8)()), "redundant rows"),
    "dragged_block": ProblemSpec(_block(5.05, 10.0), "no solution", feasible=False),
    "pulled_block": ProblemSpec(_block(0.0, -1.0), "no solution", feasible=False),
}  # fmt: skip
"""Name → problem, in the order of the tables."""


INNER, COLD, OUTER = "inner", "cold", "outer"
TASKS: Final = (INNER, COLD, OUTER)

BUDGET: Final = 1.0
"""Seconds after which a run is not repeated any more."""

_FIRST: Final = "plate_4"


class Answer(NamedTuple):
    """The status of one problem according to its solver, and the certificate."""

    status: Status
    message: str
    iterations: int
    certificate: Certificate


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the study; the module describes cases.

    "steps" is the number of answers, "outcomes" the number of each outcome, "iterations" the sum over all answers,
    "seconds" are wall times of the runs. "status" and "message" belong to the first answer that was not solved, or else
    to the last. If there is a solution, "accuracy" and "certificate" are those of the worst step.
    """
    task, form, solver, level = (case[name] for name in ("task", "form", "solver", "level"))
    feasible = PROBLEMS[case["problem"]].feasible
    _first_use(task, form, solver, level)
    run = partial(_outer if task == OUTER else _inner, instance(case["problem"]), task, form, solver, level)
    first, answers = run()
    seconds = [first]
    while len(seconds) < case["runs"] and sum(seconds) < BUDGET:
        seconds.append(run()[0])
    shown = next((each for each in answers if each.status is not Status.SOLVED), answers[-1])
    counts = Counter(outcome(each.status, each.certificate.passed, feasible) for each in answers)
    found: dict[str, Any] = {
        "steps": len(answers), "outcomes": dict(sorted(counts.items())), "status": shown.status.value,
        "message": " ".join(shown.message.split()), "iterations": sum(each.iterations for each in answers),
        "seconds": seconds, "options": accuracies.options(solver, level),
    }  # fmt: skip
    if not feasible:
        return found
    worst = max((each.certificate for each in answers), key=lambda certificate: certificate.accuracy)
    certificate = {name: getattr(worst, name) for name in ("passed", "tolerance", "accuracy", "worst")}
    return {**found, "accuracy": worst.accuracy, "certificate": certificate}


@cache
def _first_use(task: str, form: str, solver: str, level: str) -> None:
    """Run once in a process, on the smallest problem, so that libraries are loaded before times are taken."""
    (_outer if task == OUTER else _inner)(instance(_FIRST), task, form, solver, level)


def _inner(problem: Instance, task: str, name: str, solver: str, level: str) -> tuple[float, list[Answer]]:
    """Solve inner problems, all posed about one centre.

    The certificate of the inner problem judges them on the original data, in all unknowns, for either form.
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
        result = form.expand(inner) if inner.finite else None
        z, m_N, m_T, nu = (getattr(result, name, None) for name in ("z", "m_N", "m_T", "nu"))
        certificate = certify(problem.qvi.with_bound(bound), z, m_N, m_T, nu, tolerance)
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
"""Packages of solvers whose versions are stored, too."""


def declared(solvers: Sequence[str], quick: bool = False) -> Study:
    """The study of these solvers."""
    names, runs = (QUICK, 2) if quick else (tuple(PROBLEMS), 3)
    cases = [
        {"task": task, "problem": problem, "form": form, "level": level, "solver": solver, "runs": runs}
        for task, problem, form, level, solver in product(TASKS, names, FORMS, LEVELS, solvers)
    ]
    chosen = [case for case in cases if keep(case, quick)]
    return Study("solvers", 3, "comparisons.solvers.study:solve_case", chosen, (*PACKAGES, *LIBRARIES))


def keep(case: Mapping[str, Any], quick: bool = False) -> bool:
    """Whether a case is part of the study.

    * Methods of the package solve whole inequalities in condensed form only; all other solvers have all tasks.
    * Sequences need a solution, and bounds that change: they are left out where everything sticks.
    * On fine meshes only single inner problems are solved in all unknowns.
    * Quick runs have sequences and outer loops in condensed form only, at one level, for problems with a solution.
    """
    task, spec = case["task"], PROBLEMS[case["problem"]]
    if case["solver"] in METHODS and (task, case["form"]) != (OUTER, "condensed"):
        return False
    if task == COLD and (not spec.feasible or spec.kind == "sticking"):
        return False
    if quick and task != INNER:
        return case["form"] == "condensed" and case["level"] == "mid" and spec.feasible
    return task == INNER or case["form"] == "condensed" or spec.small


RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP = "right", "untrue", "false alarm", "modest", "gave up"

NO_ANSWER: Final = "no answer"
"""Outcome of a run without a result: out of time or memory, or the process died."""

OUTCOMES: Final = (RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP, NO_ANSWER)


def outcome(said: Status, passed: bool, feasible: bool) -> str:
    """The outcome of an answer, from the solver's status and the certificate.

    Unbounded counts as infeasible if there is a solution, and as giving up if there is none.
    """
    if said is Status.SOLVED:
        return RIGHT if passed and feasible else UNTRUE
    if said is Status.INFEASIBLE and not feasible:
        return RIGHT
    if said in (Status.INFEASIBLE, Status.UNBOUNDED) and feasible:
        return FALSE_ALARM
    return MODEST if passed and feasible else GAVE_UP
