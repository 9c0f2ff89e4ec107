"""How often the error that `refine` estimates is the error of its answer: the study, its numbers and its report.

Each problem of `practical` is refined to its target, and the answer stands beside a much finer one. The reference is
solved on the mesh of the answer, bisected twice over as the closer looks of `refine` are, with three degrees more.
Between the two steps the degree is one lower: what the second step changes is the doubt of the reference.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, Study, frame_of
from comparisons.wild.practical import stated
from qvi_contact import QVIError, Refinement, SolveError, refine, solve
from qvi_contact.basics.shown import Certainty
from qvi_contact.refinement import RefinementStatus, places, reference_problem
from qvi_contact.refinement.measure import Measure
from solvers import Status

MOST_UNKNOWNS: Final = 1500
"""Of an answer; the reference has about ten times as many."""


def declared(count: int) -> Study:
    """The study of the first problems of the generator."""
    return Study("estimates", 1, "comparisons.wild.estimates:solve_case", [{"number": n} for n in range(count)])


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
        problem = reference_problem(problem, problem.mesh, places(problem, problem.mesh, result))
        result = solve(problem, degree=degree + more)
        if result.status not in (Status.SOLVED, Status.INACCURATE):  # the latter has digits enough
            raise SolveError(result.message)
        values.append(measure.value(result))
    return values[0], values[1]


DOUBTFUL: Final = 0.2
"""Doubt of a reference, over the larger of estimate and error, from which it is in doubt."""

ROUNDING: Final = 1e-9
"""Relative error that is none: solves are as accurate as this."""

SAFETY: Final = 1.5
"""What `refine` multiplies the difference from a closer look by."""

_NUMBERS: Final = ("target", "error", "off", "doubt", "unknowns", "rounds")


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run: the numbers of `study.solve_case`, and what follows.

    "judged", whether it reached its target and there is a reference; "held", whether |value − reference| is within the
    error that was told; "ratio", that error over it; "estimated", whether it was an estimate, no bound; "doubtful",
    whether the reference itself is in doubt. Such runs are judged all the same: to leave them out would hide misses.
    """
    runs = frame_of(rows, _NUMBERS, ("status", "certainty", "quantity", "message"))
    off = runs.off.abs()
    judged = (runs.status == "reached") & runs.off.notna()
    doubtful = judged & (runs.doubt > DOUBTFUL * np.maximum(off, runs.error)) & (runs.doubt > ROUNDING)
    held = judged & ((off <= runs.error) | (off <= ROUNDING))
    ratio = (runs.error / off.where(off > ROUNDING)).where(judged)
    estimated = runs.certainty == str(Certainty.ESTIMATE)
    return runs.assign(judged=judged, doubtful=doubtful, held=held, ratio=ratio, estimated=estimated)


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers in sentences."""
    estimates, bounds = (runs[runs.judged & (runs.estimated == which)] for which in (True, False))
    ratios = estimates.ratio.dropna()
    quantiles = {f"q{level:02d}": float(ratios.quantile(level / 100.0)) for level in (5, 50, 95)}
    return {
        "runs": len(runs), "reached": int((runs.status == "reached").sum()), "doubtful": int(runs.doubtful.sum()),
        "least": int((estimates.held & ~estimates.doubtful).sum()),
        "estimates": len(estimates), "held": int(estimates.held.sum()),
        "share": float(estimates.held.mean()) if len(estimates) else None,
        "bounds": len(bounds), "bounds_held": int(bounds.held.sum()),
        "worst": float(ratios.min()), "plain": float((ratios >= SAFETY).mean()),
        "rounds": float(estimates.rounds.mean()) if len(estimates) else None, **quantiles,
    }  # fmt: skip


def report(rows: Sequence[Row]) -> Report:
    """The report; the same rows give the same one."""
    runs = runs_of(rows)
    judged = runs[runs.judged].assign(kind=runs.quantity.str.rpartition(".")[2].str.replace("_", " "))
    groups = judged.groupby(["kind", "certainty"])
    quantiles = {f"q{level:02d}": groups.ratio.quantile(level / 100.0) for level in (5, 50, 95)}
    kinds = groups.agg(judged=("held", "size"), held=("held", "sum")).assign(**quantiles).reset_index()
    tables = {"kinds": kinds, "missed": judged[~judged.held], "others": runs[~runs.judged]}
    forms = dict.fromkeys(("target", "error", "off", "doubt"), "{:.1e}".format) | dict.fromkeys(
        ("ratio", *quantiles), "{:.2f}".format
    )
    return render("comparisons.wild", "estimates", values_of(runs), tables, {}, rows, forms=forms,
                  template="estimates.md")  # fmt: skip
