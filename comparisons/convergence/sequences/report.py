"""The report of the study, from its rows alone: the sequences as one frame, its numbers and its table."""

from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.convergence.sequences.study import CHAINS, EVERY, WAYS
from comparisons.lab.report import Document, environment_grids, render
from comparisons.lab.report.numbers import scientific, significant
from comparisons.lab.study import DONE, Row
from comparisons.lab.tables import Form
from qvi_contact.discretization.families import CELLS


def report(rows: Sequence[Row], quick: bool = False) -> Document:
    """The report; the same rows give the same report."""
    runs = runs_of(rows)
    return render(
        "comparisons.convergence.sequences", "convergence-sequences-quick" if quick else "convergence-sequences",
        {"quick": quick, **values_of(runs)}, {"runs": _table(runs)}, {}, environment_grids(rows), forms=_FORMS,
    )  # fmt: skip


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a sequence, element and way.

    The columns are sequence, element, way, solved and planned (numbers of problems), iterations (of all but the first),
    later (mean processor time of a problem after the first) and whole (time of all), both over the median of single
    solves, force (largest difference of a force from that of single solves, of histories from cold starts, over the
    largest normal force), and accuracy (the worst that a certificate confirms).
    """
    done = sorted((row for row in rows if row.status == DONE), key=lambda row: row.position)
    return DataFrame([_run(row, way) for row in done for way in WAYS])


def _run(row: Row, way: str) -> dict[str, Any]:
    case, found = row.case, row.result[way]
    one = float(np.median(row.result["single"]["seconds"]))
    history = CHAINS[case["sequence"]].history
    beside, every = row.result["cold" if history else "single"], 1 if history else EVERY
    expected = np.array([beside["normal"], beside["tangential"]])
    forces = np.array([found["normal"], found["tangential"]])[:, :: 1 if way == "single" else every]
    compared = way != "single" and forces.shape == expected.shape
    return {
        "sequence": case["sequence"], "element": case["element"], "way": way,
        "solved": found["status"].count("solved"), "planned": len(found["status"]),
        "iterations": int(sum(found["iterations"][1:])),
        "later": float(np.mean(found["seconds"][1:])) / one, "whole": sum(found["seconds"]) / one,
        "force": float(np.abs(forces - expected).max() / np.abs(expected[0]).max()) if compared else np.nan,
        "accuracy": max(found["accuracy"]),
    }  # fmt: skip


def values_of(runs: DataFrame) -> dict[str, Any]:
    """The numbers in sentences."""
    warm, cold = (runs[runs.way == way].set_index(["sequence", "element"]) for way in ("warm", "cold"))
    saved = 1.0 - warm.iterations / cold.iterations
    usual = [name for name in saved.index if name[0] != "depth"]
    return {
        "solved": int(runs.solved.sum()), "planned": int(runs.planned.sum()),
        "cycle": float(warm.later["cycle", "hct"]), "cycle_cold": float(cold.later["cycle", "hct"]),
        "friction": float(warm.whole["friction", "hct"]), "friction_cold": float(cold.whole["friction", "hct"]),
        "least": float(saved[usual].min()), "most": float(saved[usual].max()),
        "depth": float(-saved["depth"].min()), "force": float(runs.force.max()), "accuracy": float(runs.accuracy.max()),
    }  # fmt: skip


_FORMS: Final[dict[str, Form]] = {
    "later": partial(significant, digits=2), "whole": significant, "accuracy": scientific,
    "force": lambda value: "–" if value != value else scientific(value),
}  # fmt: skip


def _table(runs: DataFrame) -> DataFrame:
    """All runs, in words."""
    titles, shares = runs.sequence.map(lambda name: CHAINS[name].title), runs[["solved", "planned"]].astype(str)
    return runs.assign(title=titles, mesh=runs.element.map(CELLS), share=shares.agg(" of ".join, axis=1))
