"""The report of bounds beside displacements of another code, from the stored rows alone."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.lab.reports import Report, render
from comparisons.lab.studies import Row, frame_of

SHARE: Final = 0.1
"""Doubt of the reference over a bound up to which the bound is judged."""

ROUNDING: Final = 1e-9
"""Share of the largest force that is rounding."""

TARGET, QUICK = 0.01, 10.0
"""Of the polygons: the error that is asked for, over the force, and the seconds in which most should have it."""

_NUMBERS: Final = ("bound", "moved", "stress", "displacement", "doubt", "reach", "unknowns", "reference_unknowns")
_OTHERS: Final = ("message", "law", "guaranteed", "states", "forces")


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a problem: what `study.solve_case` says, and what follows.

    "judged", whether the reference is accurate enough, of solutions within the bound's reach; "inside" and "outside",
    whether stress and displacement are so beyond its doubt, with bounds of the energy also both together; "ratio" of
    the bound to the error of the stress; "together", for bounds of the energy, that to the root of the sum of both
    squares; "kind" of the bound; "state" of the contact in few words.
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
    kind, said = [f"{one}, {other}" for one, other in zip(law, sure, strict=True)], runs.states.fillna("").astype(str)
    slips = said.str.count("slips").map({0: "sticks", 1: "slips one way", 2: "slips both ways"})
    pressed = said.str.contains("presses") | (said == "opens")
    state = slips.where(~pressed, "no friction acts") + np.where(said.str.contains("opens"), ", opens", "")
    return runs.assign(
        judged=judged, inside=judged & inside, outside=judged & outside, ratio=(runs.bound / runs.stress).where(judged),
        together=(runs.bound / both).where(judged & energy), kind=kind, state=state,
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
        "runs": len(runs), "bounded": len(bounded), "judged": len(judged),
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
    tables = {"families": grouped("family"), "kinds": grouped("kind"), "states": grouped("state"), "found": found,
              "forces": missed, "others": others}  # fmt: skip
    forms = dict.fromkeys(("q05", "q50", "q95", "ratio"), "{:.2f}".format)
    forms |= dict.fromkeys(("bound", "moved", "stress", "displacement", "doubt"), "{:.2e}".format)
    values = values_of(runs, forces) | polygons_of(polygons)
    failed = values["outside"] + values["forces_outside"] > 0
    return render("comparisons.bounds", "bounds", values, tables, {}, rows, forms=forms, failed=failed)
