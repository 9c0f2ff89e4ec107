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

The problems, as algebra, are built once in each process and kept:

| name            | what it is                                                                                      |
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
"""Most bounds of a sequence."""

_REFERENCE: Final = 1e-10  # tolerance of the solutions that bounds are taken from
_RECORDED: Final = "direct:clarabel"  # inner solver of the outer loop whose bounds are recorded
_ROUNDS: Final = 2  # solves of the first step, the second at the first one's answer


@dataclass(frozen=True)
class Described:
    """A problem before it is built: its kind, whether it has a solution, whether all is affordable in all unknowns."""

    build: Callable[[], FrictionQVI]
    kind: str
    feasible: bool = True
    small: bool = True


class Instance:
    """A problem with what its runs share: reference solution, bounds, forms."""

    def __init__(self, described: Described) -> None:
        self.described = described
        self.qvi = described.build()

    @cached_property
    def reference(self) -> QVISolution:
        """By the condensed method; for bounds and facts only, never for judging a result."""
        return solve_qvi(self.qvi, tolerance=_REFERENCE)

    @cache  # noqa: B019  # an instance is kept for the process
    def form(self, name: str) -> ProblemForm:
        """The problem in these unknowns; what that costs is not part of any time."""
        return make_form(self.qvi, name)

    @cached_property
    def bound(self) -> Vector:
        """The bound (m,) of the inner problem: that of the solution, without one that of the bonded state."""
        if not self.described.feasible:
            return self._first_bound
        return self.qvi.threshold(self.qvi.pressure(self.reference.z))

    @cached_property
    def bounds(self) -> tuple[Vector, ...]:
        """The bounds that the plain outer loop meets after its first step, up to the first it cannot solve."""
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
        """Where all inner problems are posed: at the answer of the loop's first step, which is not one of them.

        As in the outer loop itself, whose problems are posed at its last answer: rounding in what they are made of then
        decays. Without a solution it is the bonded state.
        """
        form = self.form(name)
        centre = form.centre(None, None)
        for _ in range(_ROUNDS if self.described.feasible else 0):
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
    return discretize(problem, law_on="points").rescaled().qvi


def _plate(cells: int, friction: float = 0.2, grading: float = 1.0) -> Callable[[], FrictionQVI]:
    return lambda: paper.plate(friction, (cells, cells), grading=grading).qvi


def _block(drag: float, push: float) -> Callable[[], FrictionQVI]:
    """A block on ground with μ = 0.5 under a uniform stress: σ_yy = −push, σ_xy = drag [MPa]."""
    return lambda: _algebra(dragged_block(0.5, (4, 2), drag, push, 1e4))


def doubled_rows(qvi: FrictionQVI) -> FrictionQVI:
    """The same problem with every contact point twice, each at half the weight: row multipliers are shared out."""
    N, T = (csc_array(vstack([rows, rows])) for rows in (qvi.N, qvi.T))
    contact = replace(qvi.contact, N=N, T=T, W=np.tile(qvi.W, 2) / 2.0, traces=None)
    loads = replace(qvi.loads, n0=np.tile(qvi.n0, 2), t0=np.tile(qvi.t0, 2))
    law = Law(np.tile(qvi.mu, 2), np.tile(qvi.cohesion, 2), np.tile(qvi.cap, 2), np.tile(qvi.bilateral, 2))
    return FrictionQVI(qvi.stiffness, contact, loads, law)


PROBLEMS: Final[Mapping[str, Described]] = {
    "plate_4": Described(_plate(4), "well conditioned"),
    "plate_8": Described(_plate(8), "well conditioned"),
    "plate_16": Described(_plate(16), "well conditioned", small=False),
    "graded_8": Described(_plate(8, grading=GRADING), "ill conditioned"),
    "graded_16": Described(_plate(16, grading=GRADING), "ill conditioned", small=False),
    "ssnv128_4": Described(lambda: _algebra(ssnv128((4, 4))), "open contact"),
    "stick_8": Described(_plate(8, friction=2.0), "sticking"),
    "stick_16": Described(_plate(16, friction=2.0), "sticking", small=False),
    "doubled_rows": Described(lambda: doubled_rows(_plate(8)()), "redundant rows"),
    "dragged_block": Described(_block(5.05, 10.0), "no solution", feasible=False),
    "pulled_block": Described(_block(0.0, -1.0), "no solution", feasible=False),
}  # fmt: skip
"""Name → problem, in the order of the tables."""


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
    task, form, solver, level = (case[name] for name in ("task", "form", "solver", "level"))
    feasible = PROBLEMS[case["problem"]].feasible
    _first_use(task, form, solver, level)
    run = partial(_outer if task == OUTER else _inner, instance(case["problem"]), task, form, solver, level)
    first, answers = run()
    seconds = [first]
    while len(seconds) < case["runs"] and sum(seconds) < BUDGET:
        seconds.append(run()[0])
    told = next((each for each in answers if each.status is not Status.SOLVED), answers[-1])
    counts = Counter(outcome(each.status, each.certificate.passed, feasible) for each in answers)
    found: dict[str, Any] = {
        "steps": len(answers), "outcomes": dict(sorted(counts.items())), "status": told.status.value,
        "message": " ".join(told.message.split()), "iterations": sum(each.iterations for each in answers),
        "seconds": seconds, "options": accuracies.options(solver, level),
    }  # fmt: skip
    if not feasible:
        return found
    worst = max((each.certificate for each in answers), key=lambda certificate: certificate.accuracy)
    certificate = {name: getattr(worst, name) for name in ("passed", "tolerance", "accuracy", "worst")}
    return {**found, "accuracy": worst.accuracy, "certificate": certificate}


@cache
def _first_use(task: str, form: str, solver: str, level: str) -> None:
    """Once in a process, on the smallest problem."""
    (_outer if task == OUTER else _inner)(instance(_FIRST), task, form, solver, level)


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
"""Distributions of solvers beside those of most studies."""


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

    * Methods of the package solve whole inequalities, condensed; the rest of the table does everything.
    * Sequences only where there is a solution, and where the bounds change: not where everything sticks.
    * On fine meshes in all unknowns only single inner problems.
    * In quick runs sequences and outer loops only condensed, at one level, and where there is a solution.
    """
    task, described = case["task"], PROBLEMS[case["problem"]]
    if case["solver"] in METHODS and (task, case["form"]) != (OUTER, "condensed"):
        return False
    if task == COLD and (not described.feasible or described.kind == "sticking"):
        return False
    if quick and task != INNER:
        return case["form"] == "condensed" and case["level"] == "mid" and described.feasible
    return task == INNER or case["form"] == "condensed" or described.small


RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP = "right", "untrue", "false alarm", "modest", "gave up"

NO_ANSWER: Final = "no answer"
"""Of a run that ended without a result: out of time or memory, or the process died."""

OUTCOMES: Final = (RIGHT, UNTRUE, FALSE_ALARM, MODEST, GAVE_UP, NO_ANSWER)


def outcome(said: Status, passed: bool, feasible: bool) -> str:
    """What an answer was worth: what the solver said of it, beside whether the certificate passes.

    Untrue is a lie told in good faith: the solver's own test passed. Unbounded counts as infeasible where there is a
    solution, and as giving up where there is none.
    """
    if said is Status.SOLVED:
        return RIGHT if passed and feasible else UNTRUE
    if said is Status.INFEASIBLE and not feasible:
        return RIGHT
    if said in (Status.INFEASIBLE, Status.UNBOUNDED) and feasible:
        return FALSE_ALARM
    return MODEST if passed and feasible else GAVE_UP
