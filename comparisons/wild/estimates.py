"""How often the error that `refine` estimates is the error of its answer: the study, its numbers and its report.

A number makes a problem, a quantity and a target, always the same. Bodies, laws and loads are those of practice, not
the extremes of `wild`: there answers are wanted, here their accuracy. Each problem is refined to its target, and the
answer stands beside a much finer one. The reference is solved on the mesh of the answer, bisected twice over as the
closer looks of `refine` are, with three degrees more. Between the two steps the degree is one lower: what the second
step changes is the doubt of the reference.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from pandas import DataFrame

from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, Study, frame_of
from comparisons.wild.bodies import Dice, quadrilateral
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    Polynomial,
    QVIError,
    RigidPlate,
    SolveError,
    Symmetry,
    Traction,
    refine,
    solve,
)
from qvi_contact.basics.checks import Field
from qvi_contact.basics.units import Certainty
from qvi_contact.problem.conditions import Condition, Law
from qvi_contact.refinement import RefinementStatus, places, reference_problem
from qvi_contact.refinement.measure import Measure
from solvers import Status

_FRICTION: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8)


class Stated(NamedTuple):
    """What a number makes: a problem, a quantity as `refine` takes it, the relative error asked for, and the degree."""

    problem: ContactProblem
    quantity: str
    target: float
    degree: int


def stated(number: int) -> Stated:
    """Problem `number`: a body on a rough obstacle that is flat, inclined or bent, held or pressed from above."""
    dice = Dice("estimates", number)
    width, height = dice.magnitude(-0.2, 0.5), 1.0
    mesh = quadrilateral(dice, width, height)
    strain = dice.magnitude(-4.0, -2.0)
    young, poisson = dice.pick((1.0, 2.1e5)), dice.pick((0.0, 0.2, 0.3, 0.45))
    push, stress, shape = strain * height, strain * young, dice.pick(("flat", "flat", "inclined", "bent"))
    gap: Field = 0.0
    if shape == "inclined":
        gap = Polynomial([[0.0], [dice.between(-0.5, 0.5) * push / width]])
    elif shape == "bent":
        gap = Polynomial([[push / 4], [-push / width], [push / width**2]])  # push (x/width − ½)²
    mu = dice.pick(_FRICTION)
    friction: Field = Polynomial([[0.5 * mu], [0.5 * mu / width]]) if dice.chance(0.15) else mu
    law: Law = "bilateral" if dice.chance(1.0 / 6.0) else "unilateral"
    contacts = [Contact("bottom", friction, gap, name="base", law=law)]
    sides: list[Condition] = []
    for side, kinds in (("left", ("free", "free", "free", "symmetry", "loaded")), ("right", ("free", "loaded"))):
        kind = dice.pick(kinds)
        loaded = stress * dice.pick((0.05, -0.1)) if kind == "loaded" else 0.0
        sides.append(Symmetry(side) if kind == "symmetry" else Traction(side, x=loaded, y=0.0))
    guided, above = isinstance(sides[0], Symmetry), dice.pick(("held", "held", "pressed", "plate", "driven"))
    loads = list[Condition]()
    if above == "held":
        loads.append(Displacement("top", x=0.0 if guided else push * dice.pick((0.0, 0.1, 0.3, -0.2)), y=-push))
    elif above == "pressed":
        rise = dice.pick((0.0, 0.5, -0.5)) * stress / width
        shear = stress * dice.pick((0.0, 0.05, -0.1))
        loads.append(Traction("top", x=shear, y=Polynomial([[-stress], [rise]])))
    else:
        mu = dice.pick(_FRICTION)
        if above == "plate":
            contacts.append(Contact("top", mu, -push, push * dice.pick((0.0, 0.1, -0.1)), name="plate"))
        else:
            plate = RigidPlate(force_y=-stress * width, pivot=(width / 2, height))
            contacts.append(Contact("top", mu, name="plate", plate=plate))
    conditions = [contacts[0], *loads, *contacts[1:], *sides]
    conditions += [Traction("step", 0.0, 0.0)] if "step" in mesh.edge_names else []
    problem = ContactProblem(mesh, Material(young, poisson, dice.pick(("stress", "strain"))), conditions)
    # forces that equilibrium alone does not give, each twice
    known = {"normal_force": above in ("pressed", "driven"), "tangential_force": above == "pressed" and not guided}
    forces = [f"{each.name}.{force}" for each in contacts for force in known if not known[force]]
    quantity = dice.pick(("energy", *forces, *forces))
    return Stated(problem, quantity, dice.magnitude(-4.5, -2.0), dice.pick((3, 4, 5, 5)))


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
    measure, problem, result, values = Measure.of(found.problem, found.quantity), found.problem, found.result, []
    try:  # on meshes bisected once and twice
        for more in (2, 3):
            problem = reference_problem(problem, places(result))
            result = solve(problem, degree=given.degree + more)
            if result.status not in (Status.SOLVED, Status.INACCURATE):  # the latter has digits enough
                raise SolveError(result.message)
            values.append(measure.value(result))
    except QVIError as error:
        return {**said, "message": f"no reference: {error}"}
    coarse, fine = values
    return {
        **said, "unknowns": found.rounds[-1].unknowns, "rounds": len(found.rounds),
        "error": found.estimate, "off": (found.value - fine) / found.unit, "doubt": abs(fine - coarse) / found.unit,
    }  # fmt: skip


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
