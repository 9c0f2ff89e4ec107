"""The study: bounds of the package beside displacements of another code, one row a problem."""

from collections.abc import Mapping
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.bounds.problems import FAMILIES, stated
from comparisons.lab.studies import PACKAGES, Study
from qvi_contact import QVIError, refine, solve
from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket import Bracket, BracketKind

if TYPE_CHECKING:
    from comparisons.bounds.reference import Reference


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
    reach = np.inf if energy or known is None else known.reach
    return {
        **asked, "status": "bounded", "message": "", "law": "energy" if energy else "coulomb",
        "guaranteed": found.guaranteed, "reach": float(reach) if np.isfinite(reach) else None, "states": true.states,
        "size": size, **{name: value / size for name, value in numbers.items()}, "forces": _forces(found, true),
        "reference_unknowns": true.unknowns,
    }  # fmt: skip


def _forces(found: Bracket, true: "Reference") -> list[list[Any]]:
    rows = []
    for name, bounds in found.forces.items():
        contact, _, kind = name.rpartition(".")
        if contact in true.forces and kind in ("normal_force", "tangential_force"):
            which = 0 if kind == "normal_force" else 1
            value = true.forces[contact][which]
            rows.append([name, bounds.lower, bounds.upper, value, abs(value - true.forces_before[contact][which])])
    return rows
