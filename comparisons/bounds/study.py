"""Error bounds of the package compared with displacements of another code, one row a generated problem; the report.

A family and a number determine a problem. Contacts are straight: an obstacle below, flat, inclined or bent, or a joint
between two blocks. The opposite side of the body is held and moved, or loaded.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from time import process_time
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.reports import Report, render
from comparisons.lab.studies import PACKAGES, Row, Study, frame_of
from comparisons.wild.generator import Dice, quadrilateral
from qvi_contact import QVIError, TriangleMesh, refine, solve
from qvi_contact.bracket import BracketKind
from qvi_contact.gallery import fan
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Polynomial, Region, Symmetry, Traction
from qvi_contact.types import Condition, Field, FloatArray

FAMILIES: Final = ("grids", "polygons", "joints", "strains", "springs")
"""Families of problems, described in `report.md`. A tenth of the problems is without friction."""

_FRICTION: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
_FEW: Final = 28
"""Meshes with fewer triangles are refined once more."""


def stated(family: str, number: int) -> tuple[ContactProblem, int]:
    """Problem `number` of a family, and the degree to solve it with."""
    dice = Dice("bounds", family, number)
    warm = family in {"strains", "springs"}
    body = dice.pick(("grids", "polygons", "joints")) if warm else family
    strain, young, poisson = dice.magnitude(-4.0, -2.0), dice.pick((1.0, 2.1e5)), dice.pick((0.0, 0.2, 0.3, 0.45))
    size = strain * young
    expansion = 1.2e-5 if warm else 0.0
    material = Material(young, poisson, dice.pick(("stress", "strain")), expansion=expansion)
    mesh, conditions = (_polygon if body == "polygons" else _block)(dice, strain, size, body == "joints")
    temperature: Field = 0.0
    if warm:
        rise = strain / expansion * dice.pick((0.3, -0.3, 1.0, -1.0))
        first, up, upwards = (dice.pick(each) * rise for each in ((0.0, 1.0), (0.0, 1.0), (0.0, -0.5)))
        along, squared = (dice.pick(each) * rise for each in ((0.0, 0.5, -1.0), (0.0, 0.0, 0.7)))
        temperature = Polynomial([[first, up, upwards], [along], [squared or 1e-3 * rise]])
    weight = size * dice.pick((0.0, 0.0, 0.0, 0.2))
    potential: Field = Polynomial([[0.0, weight]]) if weight else 0.0
    stiffer = replace(material, young=young * dice.pick((0.1, 10.0)))
    regions = [Region(stiffer, name="upper")] if "upper" in mesh.region_names else []
    degree = dice.pick((3, 4, 4, 5))
    if family == "springs":
        conditions = _on_springs(dice, conditions, young)
    return ContactProblem(mesh, material, conditions, potential, regions, temperature), degree


def _on_springs(dice: Dice, conditions: list[Condition], young: float) -> list[Condition]:
    """The conditions with springs along the contact, which is tied in one of four cases; some lower blocks on a bed."""

    def on_springs(contact: Contact) -> Contact:
        """The contact with a stiffness across it, and mostly one along it, for bodies of a size of about 1."""
        across = young * dice.magnitude(-1.0, 2.0)
        along = across * dice.pick((0.1, 0.4, 1.0)) if dice.chance(0.7) else None
        return replace(contact, normal_stiffness=across, tangential_stiffness=along)

    found: list[Condition] = []
    for each in conditions:
        if isinstance(each, Contact):
            tied = Contact.tied(each.edges, each.gap, each.offset, each.name)
            found.append(on_springs(tied if dice.chance(0.25) else each))
        elif isinstance(each, Displacement) and each.edges == "bottom" and dice.chance(0.5):
            found.append(on_springs(Contact.tied("bottom", name="bed")))
        else:
            found.append(each)
    return found


def _block(dice: Dice, strain: float, size: float, joint: bool) -> tuple[TriangleMesh, list[Condition]]:
    """A block on an obstacle, or one block on another, which is held below."""
    width = dice.magnitude(-0.2, 0.5)
    if joint:
        rows = dice.whole(2, 4)
        mesh = TriangleMesh.rectangle((dice.whole(2, 5), rows), width)
        level = dice.whole(1, rows - 1) / rows
        mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - level) < 1e-9)
        mesh = mesh.with_region("upper", lambda _, y: y > level) if dice.chance(0.3) else mesh
    else:
        mesh = quadrilateral(dice, width, 1.0)
    mesh = mesh.refined() if mesh.cell_count < _FEW else mesh
    edges = "joint" if joint else "bottom"
    conditions: list[Condition] = [_contact(dice, edges, strain, size, width, np.array([1.0, 0.0]), (0.0, 0.0))]
    conditions += [Displacement("bottom", 0.0, 0.0)] if joint else []
    left = dice.pick(("free", "free", "loaded", "symmetry")) if not joint else "free"
    if abs(float(mesh.edges("left").normal[:, 0].max()) + 1.0) > 1e-9 and left == "symmetry":
        left = "free"
    if dice.pick(("held", "held", "held", "pressed")) == "pressed":
        slope = dice.pick((0.0, 0.5, -0.5)) * size / width
        shear = dice.pick((0.0, 0.05, -0.1, 0.2)) * size
        conditions += [Traction("top", x=shear, y=Polynomial([[-size], [slope]]))]
    else:
        shares = (0.3, 0.6, -0.4) if joint else (0.0, 0.0, 0.1, 0.3, -0.2)
        moved = 0.0 if left == "symmetry" else strain * dice.pick(shares)
        conditions += [Displacement("top", moved, -strain * dice.pick((1.0, 1.0, 0.3)))]
    if left == "symmetry":
        conditions += [Symmetry("left")]
    else:
        conditions += [Traction("left", size * dice.pick((0.05, -0.1)) if left == "loaded" else 0.0, 0.0)]
    conditions += [Traction("right", size * dice.pick((0.0, 0.0, 0.05, -0.1)), 0.0)]
    conditions += [Traction("step", 0.0, 0.0)] if "step" in mesh.edge_names else []
    return mesh, conditions


def _polygon(dice: Dice, strain: float, size: float, joint: bool) -> tuple[TriangleMesh, list[Condition]]:  # noqa: ARG001
    """A polygon with one side on an obstacle, held or loaded on the opposite side."""
    corners, start = dice.whole(5, 8), dice.between(0.0, 2.0 * np.pi)
    angles = start + 2.0 * np.pi * (np.arange(corners) + [dice.between(-0.3, 0.3) for _ in range(corners)]) / corners
    radii = np.array([dice.between(0.4, 0.6) for _ in range(corners)])
    outline = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    mesh = fan([0.55 * outline, outline], closed=True, centre=(0.0, 0.0))
    sides = {f"side {k}": np.array([[corners + k, corners + (k + 1) % corners]]) for k in range(corners)}
    mesh = TriangleMesh(mesh.vertices, mesh.cells, sides)
    across, base = corners // 2, mesh.edges("side 0")
    n, t, length, first = base.normal[0], base.tangent[0], float(base.length[0]), mesh.vertices[base.first[0]]
    mesh = mesh.refined()
    conditions: list[Condition] = [_contact(dice, "side 0", strain, size, length, t, tuple(first.tolist()))]
    if dice.chance(0.75):
        moved = strain * (dice.pick((1.0, 1.0, 0.4)) * n + dice.pick((0.0, 0.0, 0.2, -0.3)) * t)
        conditions += [Displacement(f"side {across}", *moved.tolist())]
    else:
        load = size * (dice.pick((0.5, 1.0)) * n + dice.pick((0.0, 0.05, -0.1)) * t)
        conditions += [Traction(f"side {across}", *load.tolist())]
    for k in range(1, corners):
        if k != across:
            load = size * (dice.pick((0.0, 0.0, 0.05)) * n + dice.pick((0.0, 0.0, 0.05, -0.05)) * t)
            conditions += [Traction(f"side {k}", *load.tolist())]
    return mesh, conditions


def _contact(
    dice: Dice, edges: str, strain: float, size: float, length: float, t: FloatArray, first: tuple[float, ...]
) -> Contact:
    """A contact on a line of this length from the point `first` in the direction t."""
    s = Polynomial([[-float(t @ np.array(first)), float(t[1])], [float(t[0])]])  # distance from `first`
    kind, gap = dice.pick(("flat", "flat", "inclined", "bent")), dice.between(-0.5, 0.5) * strain
    shape: Field = 0.0
    if kind == "inclined":
        shape = Polynomial([[gap / length * c for c in row] for row in s.coefficients])
    elif kind == "bent":  # gap = share (s − length/2)²
        (c, b), (a, *_) = s.coefficients
        c -= length / 2.0
        share = strain * dice.pick((1.0, 0.4)) / length
        shape = Polynomial([[share * c * c, 2 * share * b * c, share * b * b], [2 * share * a * c, 2 * share * a * b],
                            [share * a * a]])  # fmt: skip
    friction = 0.0 if dice.chance(0.1) else dice.pick(_FRICTION)
    cohesion = size * dice.pick((0.02, 0.1)) if dice.chance(0.1) else 0.0
    return Contact(edges, friction, shape, name="contact", cohesion=cohesion)


def declared(count: int) -> Study:
    """The study of the first `count` problems of each family, in turns, and of as many more with springs."""
    cases = [{"family": family, "number": number} for number in range(count) for family in FAMILIES]
    cases += [{"family": "springs", "number": number} for number in range(count, 2 * count)]
    return Study("bounds", 1, "comparisons.bounds.study:solve_case", cases, packages=(*PACKAGES, "ngsolve"))


def refined(count: int) -> Study:
    """The study of the first polygons: which slip, which have bounds, and the time for the force to 1 %."""
    cases = [{"number": number} for number in range(count)]
    return Study("bounds-refined", 1, "comparisons.bounds.study:refine_case", cases)


def refine_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The task of the second study: a polygon, without NGSolve.

    "status" is "slips", "sticks", "no friction", or the status of `solve`. Polygons that slip have "bounded" and
    "guaranteed", the bound on the first mesh, and the result of `refine` for the contact's normal force: "refined", its
    status, "error", relative to the force, "rounds", "unknowns" and "processor" [s].
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
    """The task of the first study: bounds of a problem, and the distance of the solution to the reference.

    "status" is "bounded" if there are a bound and a reference; otherwise "unbounded", "no reference" or the status of
    the failed solve, with a "message". Bounded problems have "law" ("energy" or "coulomb"), "guaranteed", "reach" (None
    if the bound holds for all solutions) and "states" of the contact; relative to the energy norm of the stress "bound"
    and "moved" (bounds of the errors of stress and displacement), "stress" and "displacement" (distances to the
    reference), "doubt" (change of the reference in its last step); "forces" as [name, lower, upper, reference, doubt].
    """
    from comparisons.bounds.reference import NoReferenceError, reference  # imports NGSolve, which reports do not need

    problem, degree = stated(case["family"], case["number"])
    friction = max(each.friction for each in problem.contacts if not callable(each.friction))
    asked = {"degree": degree, "friction": friction}
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
    bound, moved, companion = np.inf, np.inf, found.companion
    if energy and np.isfinite(found.gap):  # bounds also the root of the sum of the squares of both errors
        bound = moved = float(np.sqrt(2.0 * max(found.gap, 0.0)))
    elif known is not None and not energy:
        bound, moved, companion = known.error, known.within, known.displacement
    if not np.isfinite(bound):
        why = found.message if known is None else known.norm.reason
        return {**asked, "status": "unbounded", "message": found.coulomb_reason or why}
    try:
        true = reference(problem)
    except NoReferenceError as error:
        return {**asked, "status": "no reference", "message": str(error)}
    compliances = problem.compliances[true.cells]

    def norm(stress: FloatArray) -> float:
        return float(np.sqrt(np.einsum("i,ij,ijk,ik->", true.weights, stress, compliances, stress)))

    ours = found.result.stress(true.x, true.y)
    size = norm(ours)
    numbers = {
        "bound": bound, "moved": moved, "stress": norm(ours - true.stress), "doubt": norm(true.doubt),
        "displacement": norm(companion.stress(true.x, true.y) - true.stress),
    }  # fmt: skip
    forces = [[name, each.lower, each.upper, *true.forces[name]]
              for name, each in found.forces.items() if name in true.forces]  # fmt: skip
    reach = np.inf if energy or known is None else known.reach
    return {
        **asked, "status": "bounded", "message": "", "law": "energy" if energy else "coulomb",
        "guaranteed": found.guaranteed, "reach": float(reach) if np.isfinite(reach) else None, "states": true.states,
        "size": size, **{name: value / size for name, value in numbers.items()}, "forces": forces,
        "reference_unknowns": true.unknowns,
    }  # fmt: skip


SHARE: Final = 0.1
"""Largest uncertainty of the reference over a bound for which the bound is judged."""

ROUNDING: Final = 1e-9
"""Differences of forces below this share of the largest force are rounding."""

EXACT: Final = 1e-6
"""Bound over the norm of the stress below which the mesh solves the problem exactly: it is the root of rounding."""

TARGET, QUICK = 0.01, 10.0
"""Of the polygons: the error asked for, relative to the force, and the seconds in which most should reach it."""

_NUMBERS: Final = ("bound", "moved", "stress", "displacement", "doubt", "reach", "unknowns", "reference_unknowns")
_OTHERS: Final = ("message", "law", "guaranteed", "forces")


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a problem: the entries of `solve_case`, and further columns.

    "judged": whether the reference is accurate enough, and within the reach of the bound. "inside", "outside": whether
    stress and displacement are inside, or one of them outside, by more than the doubt of the reference; bounds of the
    energy are tested for both errors together, too. "ratio": the bound over the error of the stress. "together", for
    bounds of the energy: the bound over the root of the sum of the squares of both errors. "kind" of the bound.
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
        together=(runs.bound / both).where(judged & energy & (runs.bound > EXACT)), kind=kind,
    )  # fmt: skip


def forces_of(runs: DataFrame) -> DataFrame:
    """One line a bounded force of a judged problem, with "judged", "inside", "outside" as in `runs_of`."""
    columns = ("force", "lower", "upper", "reference", "doubt")
    lines = [
        {"family": run.family, "number": run.number, **dict(zip(columns, force, strict=True)),
         "largest": max(abs(number) for each in run.forces for number in each[1:4])}
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
    """The numbers in the sentences of the report."""
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
    """The numbers of the second study in the sentences of the report."""
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
    """The report of both studies, a function of their rows only."""
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
