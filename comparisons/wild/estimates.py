"""How often the error that `refine` estimates is the error of its answer: the study, its numbers and its report.

A number makes a problem, a quantity and a target, always the same. Bodies, laws and loads are those of practice, not
the extremes of `wild`: there answers are wanted, here their accuracy. Each problem is refined to its target, and the
answer stands beside a much finer one. The reference is solved on the mesh of the answer, bisected twice over as the
closer looks of `refine` are, with three degrees more. Between the two steps the degree is one lower: what the second
step changes is the doubt of the reference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

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
    Refinement,
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

_BASE: Final = "base"
_PLATE: Final = "plate"
_FRICTION: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
_FORCES: Final = ("normal_force", "tangential_force")


@dataclass(frozen=True)
class Stated:
    """What a number makes.

    Attributes
    ----------
    problem : the problem
    quantity : name of the quantity, as `refine` takes it
    target : relative error asked for
    degree : of the element

    """

    problem: ContactProblem
    quantity: str
    target: float
    degree: int


def stated(number: int) -> Stated:
    """Problem `number`."""
    dice = Dice("estimates", number)
    width, height = dice.magnitude(-0.2, 0.5), 1.0
    mesh = quadrilateral(dice, width, height)
    strain = dice.magnitude(-4.0, -2.0)
    young, poisson = dice.pick((1.0, 2.1e5)), dice.pick((0.0, 0.2, 0.3, 0.45))
    contacts = [_base(dice, strain * height, width)]
    sides = [_side(dice, side, strain * young) for side in ("left", "right")]
    guided = isinstance(sides[0], Symmetry)
    above = _top(dice, strain, young, width, height, guided)
    conditions: list[Condition] = [*contacts, *above, *sides]
    contacts += [each for each in above if isinstance(each, Contact)]
    conditions += [Traction("step", 0.0, 0.0)] if "step" in mesh.edge_names else []
    problem = ContactProblem(mesh, Material(young, poisson, dice.pick(("stress", "strain"))), conditions)
    quantity = dice.pick(("energy", *_forces(contacts, above, guided)))
    return Stated(problem, quantity, dice.magnitude(-4.5, -2.0), dice.pick((3, 4, 5, 5)))


def _forces(contacts: list[Contact], above: list[Condition], guided: bool) -> list[str]:
    """The forces that equilibrium alone does not give, each twice."""
    pushed = any(isinstance(each, Traction) for each in above)
    driven = any(each.plate is not None for each in contacts)
    kinds = [*([] if pushed or driven else ["normal_force"]), *([] if pushed and not guided else ["tangential_force"])]
    return 2 * [f"{each.name}.{kind}" for each in contacts for kind in kinds]


def _base(dice: Dice, move: float, width: float) -> Contact:
    """A rough obstacle below: flat, inclined, or bent away from the body."""
    shape: Field = 0.0
    kind = dice.pick(("flat", "flat", "inclined", "bent"))
    if kind == "inclined":
        slope = dice.between(-0.5, 0.5) * move / width
        shape = Polynomial([[0.0], [slope]])
    elif kind == "bent":
        shape = Polynomial([[move / 4], [-move / width], [move / width**2]])  # move (x/width − ½)²
    coefficient = dice.pick(_FRICTION)
    rising = Polynomial([[0.5 * coefficient], [0.5 * coefficient / width]])
    friction: Field = rising if dice.chance(0.15) else coefficient
    law: Law = "bilateral" if dice.chance(1.0 / 6.0) else "unilateral"
    return Contact("bottom", friction, shape, name=_BASE, law=law)


def _top(dice: Dice, strain: float, young: float, width: float, height: float, guided: bool) -> list[Condition]:
    """What presses from above, most often with some shear."""
    push, stress = strain * height, strain * young
    kind = dice.pick(("held", "held", "pressed", "plate", "driven"))
    if kind == "held":
        return [Displacement("top", x=0.0 if guided else push * dice.pick((0.0, 0.1, 0.3, -0.2)), y=-push)]
    if kind == "pressed":
        rise = dice.pick((0.0, 0.5, -0.5)) * stress / width
        return [Traction("top", x=stress * dice.pick((0.0, 0.05, -0.1)), y=Polynomial([[-stress], [rise]]))]
    friction = dice.pick(_FRICTION)
    if kind == "plate":
        offset = push * dice.pick((0.0, 0.1, -0.1))
        return [Contact("top", friction, -push, offset, name=_PLATE)]
    plate = RigidPlate(force_y=-stress * width, pivot=(width / 2, height))
    return [Contact("top", friction, name=_PLATE, plate=plate)]


def _side(dice: Dice, side: str, stress: float) -> Condition | Symmetry:
    """Free, held normally, or loaded."""
    kind = (
        dice.pick(("free", "free", "free", "symmetry", "loaded")) if side == "left" else dice.pick(("free", "loaded"))
    )
    if kind == "symmetry":
        return Symmetry(side)
    return Traction(side, x=stress * dice.pick((0.05, -0.1)) if kind == "loaded" else 0.0, y=0.0)


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
