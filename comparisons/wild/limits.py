"""Both sides of limit loads on generated bodies, and their proofs: the study, its numbers and its report.

A number determines a body of one or two parts, each rigid or with a yield criterion, with a contact below, with or
without a joint, weight and tractions. `lower` must not exceed `upper`. Proof files of both sides are checked in exact
arithmetic: the proved lower number must not exceed `lower`, the proved upper number not be below it.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, Study, frame_of
from comparisons.wild.generator import Dice, quadrilateral
from qvi_contact import QVIError, limit_load_factor, limit_proof
from qvi_contact.limit import check
from qvi_contact.limit.load_factor import LimitProblem
from qvi_contact.problem import Contact, ContactProblem, Material, Polynomial, Region, Traction
from qvi_contact.problem.material import Mises, MohrCoulomb, NoTension, Strength, Tresca
from qvi_contact.types import Condition, Law, Plane

ROUNDING: Final = 1e-7
"""Relative difference by which `lower` may exceed `upper`."""

NEAR: Final = 1e-3
"""Relative difference of a proved and a computed number that counts as small."""

LASTING: Final = 0.5
"""Strength that a bisected mesh lacks, over that of the mesh itself, above which the mesh is not the reason."""

_NUMBERS: Final = ("degree", "lower", "upper", "proved_lower", "proved_upper", "cells")


def declared(count: int) -> Study:
    """The study of the first problems of the generator."""
    return Study("limits", 1, "comparisons.wild.limits:solve_case", [{"number": n} for n in range(count)])


def stated(number: int) -> tuple[ContactProblem, str, int]:
    """Problem `number`, the load to multiply, and the degree."""
    dice = Dice("limits", number)
    width, height = dice.between(0.5, 2.0), dice.between(0.5, 2.0)
    mesh = quadrilateral(dice, width, height)
    levels = sorted({float(y) for y in mesh.vertices[:, 1] if 0.0 < y < height})
    joint = dice.pick(levels)
    straight = np.isclose(mesh.vertices[:, 1], joint).sum() > 2
    if straight and dice.chance(0.6):
        mesh = mesh.with_joint("joint", lambda _, y: np.isclose(y, joint))
    middle = float(np.median(mesh.vertices[:, 0]))
    mesh = mesh.with_region("part", lambda x, _: x > middle)
    plane: Plane = dice.pick(("strain", "stress"))
    own, other = _strength(dice), _strength(dice)
    contacts = list[Condition]()
    for edges in ("bottom", *mesh.joint_names):
        law: Law = dice.pick(("unilateral", "unilateral", "unilateral", "bilateral"))
        friction = dice.pick((0.0, 0.3, 0.5, 0.7)) if law == "unilateral" else 0.0
        cap = dice.between(0.2, 1.0) if dice.chance(0.3) else None
        contacts.append(Contact(edges, friction, cohesion=dice.pick((0.0, 0.2)), shear_limit=cap, law=law))
    loads: list[Condition] = [
        Traction("top", x=dice.between(-0.05, 0.05), y=-dice.between(0.3, 1.0)),
        Traction("left", x=dice.between(0.02, 0.2), y=0.0, name="push"),
        *(Traction(side, x=0.0, y=0.0) for side in ("right", "step") if side in mesh.edge_names),
    ]
    weight = Polynomial([[0.0, dice.between(0.2, 1.0)]]) if dice.chance(0.5) else 0.0
    region = Region(Material(2.0, 0.3, plane, other), name="part")
    problem = ContactProblem(mesh, Material(1.0, 0.2, plane, own), [*contacts, *loads], weight, [region])
    return problem, dice.pick(("push", "top")), dice.pick((3, 4, 4, 5))


def _strength(dice: Dice) -> Strength | None:
    c = dice.between(0.5, 3.0)
    return dice.pick((Tresca(c), Tresca(c), Mises(2.0 * c), MohrCoulomb(c, 0.5), MohrCoulomb(c, 0.2, 0.3 * c),
                      NoTension(4.0 * c), NoTension(), None))  # fmt: skip


def solve_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task: "strengths", "lower" and "upper", the proved numbers, and the reason of a missing proof."""
    problem, load, degree = stated(case["number"])
    strengths = " and ".join(dict.fromkeys("rigid" if each.strength is None else each.strength.kind
                                           for each in problem.materials))  # fmt: skip
    asked = {"load": load, "degree": degree, "cells": problem.mesh.cell_count, "strengths": strengths,
             "plane": problem.material.plane}  # fmt: skip
    try:
        limit = limit_load_factor(problem, [load], degree=degree)
    except QVIError as error:
        return {**asked, "status": type(error).__name__, "message": str(error)}
    found = {**asked, "status": "solved", "lower": limit.lower, "upper": limit.upper}
    if limit.lower == -np.inf:
        found["nothing"] = _why_nothing(problem, load, degree, limit.upper)
    try:
        proof = limit_proof(problem, [load], degree=degree)
        *proved, _ = check(json.loads(json.dumps(proof)))
    except QVIError as error:
        return {**found, "missing_lower": str(error), "missing_upper": str(error)}
    sides = {f"proved_{side}": None if value is None else float(value)
             for side, value in zip(("lower", "upper"), proved, strict=True)}  # fmt: skip
    return {**found, **sides, **{f"missing_{side}": reason for side, reason in proof["missing"].items()}}


def _why_nothing(problem: ContactProblem, load: str, degree: int, upper: float) -> str:
    """The reason why a mesh carries no multiple of the load.

    Compares how much all limits would have to be raised on this mesh and with all triangles bisected.
    """
    if upper == -np.inf:
        return "no stress carries any, as a motion proves"
    fine = replace(problem, mesh=problem.mesh.refined(np.arange(problem.mesh.cell_count)))
    limits = (LimitProblem.of(each, (load,), degree=min(degree, 4)) for each in (problem, fine))
    lacking, lacking_on_fine = (-each.stresses.program().room[1] for each in limits)
    if lacking < ROUNDING:
        return "rounding: limits leave no room"
    if lacking_on_fine < LASTING * lacking:
        return "the mesh is too coarse"
    return "a finer mesh lacks as much strength, no motion proves it"


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a run: the entries of `solve_case`, and further columns.

    "held": whether lower ≤ upper; "proofs": whether the proved numbers are on their sides of `lower`, the largest
    multiple that the mesh carries; "finite", "bounded": whether `lower` and `upper` are finite.
    """
    runs = frame_of(rows, _NUMBERS, ("message", "strengths", "missing_lower", "missing_upper", "nothing"))
    finite, bounded = np.isfinite(runs.lower), np.isfinite(runs.upper)
    room = ROUNDING * (1.0 + runs.upper.abs().where(bounded, 0.0))
    held = (runs.status == "solved") & (runs.lower <= runs.upper + room)
    low = runs.proved_lower.isna() | (runs.proved_lower <= runs.lower + room)
    high = runs.proved_upper.isna() | (runs.proved_upper >= runs.lower - room)
    return runs.assign(held=held, proofs=low & high, finite=finite, bounded=bounded)


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers in the sentences of the report."""
    solved = runs[runs.status == "solved"]
    above = solved[solved.bounded & solved.proved_upper.notna()]
    below = solved[solved.finite & solved.proved_lower.notna()]
    near = [
        int(((first - second).abs() <= NEAR * (1e-3 + first.abs())).sum())
        for first, second in ((below.lower, below.proved_lower), (above.upper, above.proved_upper))
    ]
    nothing = solved.nothing.fillna("")
    proved, lasting = (int(nothing.str.contains(word).sum()) for word in ("as a motion proves", "a finer mesh"))
    carry_nothing = int((nothing != "").sum())
    return {
        "carry_nothing": carry_nothing, "proved_nothing": proved, "lasting": lasting,
        "coarse": carry_nothing - proved - lasting,
        "runs": len(runs), "solved": len(solved), "held": int(solved.held.sum()), "wrong": int((~solved.proofs).sum()),
        "finite": int(solved.finite.sum()), "bounded": int(solved.bounded.sum()),
        "below": len(below), "above": len(above), "near_below": near[0], "near_above": near[1],
    }  # fmt: skip


def report(rows: Sequence[Row]) -> Report:
    """The report, a function of the rows only."""
    runs = runs_of(rows)
    solved = runs[runs.status == "solved"]
    solved = solved.assign(tension=solved.strengths.str.contains("no-tension"))
    strengths = solved.groupby("strengths").agg(
        runs=("held", "size"), held=("held", "sum"), below=("proved_lower", "count"), above=("proved_upper", "count")
    ).reset_index()  # fmt: skip
    sides = solved[["held", "missing_lower", "missing_upper"]].set_axis(["held", "lower", "upper"], axis=1)
    missing = sides.melt(["held"], ["lower", "upper"], "side", "told").replace("", None)
    missing = missing.assign(told=missing.told.str.replace(r"(?<=triangle )\d+", "…", regex=True))  # one row a reason
    nothing = solved.groupby("nothing").agg(runs=("held", "size"), tension=("tension", "sum")).reset_index()
    missing = missing.groupby(["side", "told"]).size().reset_index(name="runs")
    tables = {
        "strengths": strengths, "nothing": nothing, "missing": missing,
        "others": runs[runs.status != "solved"],
    }  # fmt: skip
    return render("comparisons.wild", "limits", values_of(runs), tables, {}, rows, template="limits.md")
