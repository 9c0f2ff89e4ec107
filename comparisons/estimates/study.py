"""The study: each problem refined to its target, and the answer beside a much finer one.

The reference is solved on the mesh of the answer, bisected twice over as the closer looks of `refine` are, with three
degrees more. Between the two steps the degree is one lower: what the second step changes is the doubt of the reference.
"""

from collections.abc import Mapping
from typing import Any, Final

from comparisons.estimates.problems import stated
from comparisons.lab.study import Study
from qvi_contact import QVIError, Refinement, SolveError, refine, solve
from qvi_contact.refinement import RefinementStatus, closer_problem, places
from qvi_contact.refinement.quantity import Measure
from solvers import Status

NAME: Final = "estimates"
EACH: Final = 200
QUICK: Final = 6
MOST_UNKNOWNS: Final = 1500
"""Of an answer; the reference has about ten times as many."""


def declared(count: int) -> Study:
    """The study of the first problems of the generator."""
    return Study(NAME, 1, solve_case, {"number": tuple(range(count))})


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the study: what was asked, and "status", "certainty" and "message" of the refinement.

    Where it reached its target also "unknowns" and "rounds", and, relative, the "error" that is told, "off" (value −
    reference) and "doubt" (of the reference).
    """
    given = stated(case["number"])
    asked = {"quantity": given.quantity, "target": given.target, "degree": given.degree}
    try:
        found = refine(
            given.problem, None, given.target, given.quantity, degree=given.degree, max_unknowns=MOST_UNKNOWNS
        )
    except QVIError as error:
        return {**asked, "status": type(error).__name__, "certainty": "", "message": str(error)}
    said = {**asked, "status": found.status.value, "certainty": str(found.certainty), "message": found.message}
    if found.status is not RefinementStatus.REACHED:
        return said
    try:
        coarse, fine = _references(found, given.degree)
    except QVIError as error:
        return {**said, "message": f"no reference: {error}"}
    return {
        **said, "unknowns": found.rounds[-1].unknowns, "rounds": len(found.rounds),
        "error": found.estimate, "off": (found.value - fine) / found.unit, "doubt": abs(fine - coarse) / found.unit,
    }  # fmt: skip


def _references(found: Refinement, degree: int) -> tuple[float, float]:
    """The quantity after either step."""
    problem, result, values = found.problem, found.result, []
    measure = Measure.of(problem, found.quantity)
    for more in (2, 3):
        problem = closer_problem(problem, problem.mesh, places(problem, problem.mesh, result))
        result = solve(problem, degree=degree + more)
        if result.status not in (Status.SOLVED, Status.INACCURATE):  # the latter has digits enough
            raise SolveError(result.message)
        values.append(measure.value(result))
    return values[0], values[1]
