"""Bounds of the package beside displacements of another code, one row a problem; and the report."""

from collections.abc import Mapping, Sequence
from time import process_time
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.bounds.problems import FAMILIES, stated
from comparisons.lab.reports import Report, render
from comparisons.lab.studies import PACKAGES, Row, Study, frame_of
from qvi_contact import QVIError, refine, solve
from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket import BracketKind


def declared(count: int) -> Study:
    """The study of the first problems of each family, which take turns, and of as many more with springs."""
    cases = [{"family": family, "number": number} for number in range(count) for family in FAMILIES]
    cases += [{"family": "springs", "number": number} for number in range(count, 2 * count)]
    return Study("bounds", 1, "comparisons.bounds.study:solve_case", cases, packages=(*PACKAGES, "ngsolve"))


def refined(count: int) -> Study:
    """The study of the first polygons: which slip, of which there are bounds, and how long 1 % of the force takes."""
    return Study(
        "bounds-refined", 1, "comparisons.bounds.study:refine_case", [{"number": number} for number in range(count)]
    )


def refine_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the second study, on a polygon without NGSolve.

    "status" is "slips", "sticks", "no friction", or of `solve`. Of what slips: "bounded" and "guaranteed" on the first
    mesh; of the force of the contact what `refine` says, "refined" its status, "error" over the force, "rounds",
    "unknowns" and "processor", its seconds.
    """
    problem, degree = stated("polygons", case["number"])
    result = solve(problem, degree=degree)
    if not result.has_state:
        return {"status": result.status.value}
    if not problem.contacts[0].friction:
        return {"status": "no friction"}
    if not result.contacts["contact"].shares["slip"]:
        return {"status": "sticks"}
    found = result.bracket
    bounded = found.coulomb is not None and bool(np.isfinite(found.coulomb.error))
    began = process_time()
    outcome = refine(problem, result, 0.01, "contact.normal_force", guaranteed=True, degree=degree)
    return {
        "status": "slips", "bounded": bounded, "guaranteed": bounded and found.guaranteed,
        "message": "" if bounded else found.coulomb_reason, "refined": outcome.status.value, "error": outcome.estimate,
        "rounds": len(outcome.rounds), "unknowns": len(outcome.result.dofs), "processor": process_time() - began,
    }  # fmt: skip


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the study.

    "status" is "bounded" where there are a bound and a reference; "unbounded", "no reference" and the status of a
    solver that failed have a "message". Of bounded problems: "law" ("energy" or "coulomb"), "guaranteed", "reach" (None
    for all solutions), "states" of the contact; over the energy norm of the stress "bound" and "moved" (bounds of the
    errors of stress and displacement), "stress" and "displacement" (distances to the reference), "doubt" (what its last
    step changed); "forces" as [name, lower, upper, reference, doubt].
    """
    from comparisons.bounds.reference import NoReferenceError, reference  # NGSolve, which reports do not need

    problem, degree = stated(case["family"], case["number"])
    asked = {
        "degree": degree,
        "friction": max(each.friction for each in problem.contacts if not callable(each.friction)),
    }
    try:
        result = solve(problem, degree=degree)
        if not result.has_state:
            return {**asked, "status": result.status.value, "message": result.message}
        found = result.bracket
    except QVIError as error:
        return {**asked, "status": type(error).__name__, "message": str(error)}
    asked |= {"unknowns": len(result.dofs), "cells": problem.mesh.cell_count}
    known = found.coulomb
    energy = found.kind is BracketKind.PROBLEM
    if energy:  # √(2 gap) bounds the errors of stress and displacement, even the root of the sum of their squares
        least = float(np.sqrt(2.0 * max(found.gap, 0.0))) if np.isfinite(found.gap) else np.inf
        bounds: tuple[float, float, Any] | None = least, least, found.companion
    else:
        bounds = None if known is None else (known.error, known.within, known.displacement)
    if bounds is None or not np.isfinite(bounds[0]):
        why = found.message if known is None else known.norm.reason
        return {**asked, "status": "unbounded", "message": found.coulomb_reason or why}
    try:
        true = reference(problem)
    except NoReferenceError as error:
        return {**asked, "status": "no reference", "message": str(error)}
    compliances = problem.compliances[true.cells]

    def norm(stress: FloatArray) -> float:
        return float(np.sqrt(np.einsum("i,ij,ijk,ik->", true.weights, stress, compliances, stress)))

    bound, moved, companion = bounds
    ours = found.result.stress(true.x, true.y)
    size = norm(ours)
    numbers = {
        "bound": bound, "moved": moved, "stress": norm(ours - true.stress), "doubt": norm(true.stress - true.before),
        "displacement": norm(companion.stress(true.x, true.y) - true.stress),
    }  # fmt: skip
    forces = [[name, bounds.lower, bounds.upper, true.forces[name], abs(true.forces[name] - true.forces_before[name])]
              for name, bounds in found.forces.items() if name in true.forces]  # fmt: skip
    reach = np.inf if energy or known is None else known.reach
    return {
        **asked, "status": "bounded", "message": "", "law": "energy" if energy else "coulomb",
        "guaranteed": found.guaranteed, "reach": float(reach) if np.isfinite(reach) else None, "states": true.states,
        "size": size, **{name: value / size for name, value in numbers.items()}, "forces": forces,
        "reference_unknowns": true.unknowns,
    }  # fmt: skip


SHARE: Final = 0.1
"""Doubt of the reference over a bound up to which the bound is judged."""

ROUNDING: Final = 1e-9
"""Share of the largest force that is rounding."""

TARGET, QUICK = 0.01, 10.0
"""Of the polygons: the error that is asked for, over the force, and the seconds in which most should have it."""

_NUMBERS: Final = ("bound", "moved", "stress", "displacement", "doubt", "reach", "unknowns", "reference_unknowns")
_OTHERS: Final = ("message", "law", "guaranteed", "forces")


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a problem: what `study.solve_case` says, and what follows.

    "judged", whether the reference is accurate enough, of solutions within the bound's reach; "inside" and "outside",
    whether stress and displacement are so beyond its doubt, with bounds of the energy also both together; "ratio" of
    the bound to the error of the stress; "together", for bounds of the energy, that to the root of the sum of both
    squares; "kind" of the bound.
    """
    runs = frame_of(rows, _NUMBERS, _OTHERS)
    energy, with_reach = runs.law == "energy", runs.reach.notna()
    judged = (runs.status == "bounded") & (runs.doubt <= SHARE * runs.bound)
    judged &= ~(with_reach & (runs.stress - runs.doubt > runs.reach))
    inside = (runs.stress + runs.doubt <= runs.bound) & (runs.displacement + runs.doubt <= runs.moved)
    outside = (runs.stress - runs.doubt > runs.bound) | (runs.displacement - runs.doubt > runs.moved)
    both = np.hypot(runs.stress, runs.displacement)
    outside |= energy & (both - runs.doubt > runs.bound)
    sure = np.where(runs.guaranteed == True, "guaranteed", "estimated")  # noqa: E712 - missing where nothing is bounded
    law = np.where(energy, "energy", np.where(with_reach, "Coulomb, for solutions near", "Coulomb"))
    kind = [f"{one}, {other}" for one, other in zip(law, sure, strict=True)]
    return runs.assign(
        judged=judged, inside=judged & inside, outside=judged & outside, ratio=(runs.bound / runs.stress).where(judged),
        together=(runs.bound / both).where(judged & energy), kind=kind,
    )  # fmt: skip


def forces_of(runs: DataFrame) -> DataFrame:
    """One line a force with bounds of a judged problem, with "judged", "inside", "outside" in the same sense."""
    columns = ("force", "lower", "upper", "reference", "doubt")
    lines = [
        {"family": run.family, "number": run.number, "largest": max(abs(each[3]) for each in run.forces),
         **dict(zip(columns, force, strict=True))}
        for run in runs[runs.judged].itertuples() for force in run.forces
    ]  # fmt: skip
    forces = DataFrame(lines, columns=["family", "number", "largest", *columns])
    rounding, half = ROUNDING * forces.largest, (forces.upper - forces.lower) / 2.0
    judged = forces.doubt <= SHARE * half
    low, high = forces.reference - forces.doubt, forces.reference + forces.doubt
    return forces.assign(
        judged=judged, inside=judged & (low >= forces.lower - rounding) & (high <= forces.upper + rounding),
        outside=judged & ((low > forces.upper + rounding) | (high < forces.lower - rounding)),
        width=half / forces.reference.abs(),
    )  # fmt: skip


def values_of(runs: DataFrame, forces: DataFrame) -> dict[str, Any]:
    """The numbers in sentences."""
    bounded, judged, measured = runs[runs.status == "bounded"], runs[runs.judged], forces[forces.judged]
    families = judged.family.value_counts()
    strained, sprung = (int(families.get(name, 0)) for name in ("strains", "springs"))
    return {
        "runs": len(runs), "judged": len(judged),
        "friction": len(judged) - strained - sprung, "strained": strained, "sprung": sprung,
        "outside": int(judged.outside.sum()), "inside": int(judged.inside.sum()),
        "undecided": int((~judged.inside & ~judged.outside).sum()), "unjudged": len(bounded) - len(judged),
        "guaranteed": int((judged.guaranteed == True).sum()),  # noqa: E712
        "forces": len(measured), "forces_outside": int(measured.outside.sum()),
        "forces_inside": int(measured.inside.sum()), "width": measured.width.median(),
        "least": judged.ratio.min(), "together": judged.together.max(),
        "energies": int(judged.together.notna().sum()), "doubt": (judged.doubt / judged.bound).median(),
        **{f"q{level:02d}": judged.ratio.quantile(level / 100.0) for level in (5, 50, 95)},
        "unknowns": judged.unknowns.median(), "fine": judged.reference_unknowns.median(),
    }  # fmt: skip


def polygons_of(rows: Sequence[Row]) -> dict[str, Any]:
    """What sentences say of the second study."""
    slipping = frame_of(rows, ("error", "rounds", "processor"), ("bounded", "guaranteed", "refined", "message"))
    slipping = slipping[slipping.status == "slips"]
    bounded = slipping[slipping.bounded == True]  # noqa: E712 - missing where nothing slips
    done = bounded[bounded.error <= TARGET]
    return {
        "slipping": len(slipping), "slipping_bounded": len(bounded),
        "slipping_guaranteed": int((bounded.guaranteed == True).sum()),  # noqa: E712
        "refined": len(done), "quick": int((done.processor <= QUICK).sum()),
        "typical": done.processor.median(),
    }  # fmt: skip


def report(rows: Sequence[Row], polygons: Sequence[Row]) -> Report:
    """The report; the same rows give the same one."""
    runs = runs_of(rows)
    forces, judged = forces_of(runs), runs[runs.judged]

    def grouped(by: str) -> DataFrame:
        groups = judged.groupby(by)
        counts = groups.agg(judged=("inside", "size"), inside=("inside", "sum"), outside=("outside", "sum"))
        return counts.assign(**{f"q{q:02d}": groups.ratio.quantile(q / 100.0) for q in (5, 50, 95)}).reset_index()

    others = runs[~runs.judged].groupby("status").agg(problems=("family", "size")).reset_index()
    found = runs[runs.outside | (runs.judged & ~runs.inside)]
    missed = forces[forces.outside | (forces.judged & ~forces.inside)]
    tables = {"families": grouped("family"), "kinds": grouped("kind"), "found": found,
              "forces": missed, "others": others}  # fmt: skip
    forms = dict.fromkeys(("q05", "q50", "q95"), "{:.2f}".format)
    forms |= dict.fromkeys(("bound", "moved", "stress", "displacement", "doubt"), "{:.2e}".format)
    values = values_of(runs, forces) | polygons_of(polygons)
    failed = values["outside"] + values["forces_outside"] > 0
    return render("comparisons.bounds", "bounds", values, tables, {}, rows, forms=forms, failed=failed)
