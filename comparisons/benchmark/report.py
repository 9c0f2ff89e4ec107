"""The reports on the plate and sequences, and on walls: numbers and tables from the stored rows."""

import math
import statistics
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.benchmark.study import CHAINS, EVERY, PARTS, TOLERANCE, WAYS
from comparisons.lab.numbers import NOTHING, fixed, memory, percent, scientific, seconds, significant, span
from comparisons.lab.numbers import spread as spread_of
from comparisons.lab.reports import Form, Report, render
from comparisons.lab.studies import DONE, Row, frame_of
from comparisons.settled import LIMITS

MEANINGLESS: Final = 1e-9
"""Relative errors of P/2 below this are within the uncertainty of `LIMITS`."""

Rows = Sequence[Row]


def _median(values: Sequence[float] | None) -> float | None:
    return statistics.median(values) if values else None


def solves_of(rows: Rows) -> DataFrame:
    """One line for each number of cells and μ: the answer, medians of times, the ratio of solve to factorisation of K.

    The factorisation is the fastest one in the same process. Memory is the peak after the first solve.
    """
    lines = []
    for row in rows:
        plain = {each["backend"]: _median(each["seconds"]["plain"]) for each in row.result.get("plain", ())}
        fastest = min(plain, key=lambda backend: plain[backend] or math.inf, default="")
        lost = [{"friction": mu, "status": row.status, "message": row.reason} for mu in row.case["friction"]]
        for found in row.result.get("solves", lost):
            times = found.get("seconds", {})
            lines.append({
                **found, **{part: _median(times.get(part)) for part in PARTS}, "cells": row.case["cells"],
                "spread": spread_of(times.get("solve", ())), "peak": row.result.get("peak"), "fastest": fastest,
                "factorised": plain.get(fastest),
            })  # fmt: skip
    numbers = ("cells", "friction", "unknowns", "iterations", "accuracy", "half_force", *PARTS, "spread", "factorised",
               "peak")  # fmt: skip
    columns = (*numbers, "status", "message", "library", "fastest")
    solves = DataFrame(lines, columns=columns).astype(dict.fromkeys(numbers, float))
    known = solves.friction.map({friction: value for friction, (value, _) in LIMITS.items()})
    ratio = (solves.solve / solves.factorised).where(solves.status == "solved")
    return solves.assign(ratio=ratio, half_force_error=(solves.half_force / known - 1.0).abs())


def growth_of(found: DataFrame, by: str, over: str) -> dict[Any, float]:
    """Exponents p of solve ~ overᵖ between the two largest of each group, where both are solved."""
    powers = {}
    for key, group in found.groupby(by):
        last = group.sort_values(over).tail(2)
        if len(last) == 2 and (last.status == "solved").all():
            size, time = np.log(last[[over, "solve"]]).diff().iloc[-1]
            powers[key] = float(time / size)
    return powers


def runs_of(rows: Rows) -> DataFrame:
    """One line for each sequence and way of `WAYS`.

    The columns are sequence, way, solved and planned (numbers of problems), later (mean processor time of a problem
    after the first) and together (time of all), both over the median of single solves, force (largest difference of a
    force to single solves, in histories to cold starts, over the largest normal force), and accuracy (the worst of the
    certificates).
    """
    lines = []
    for row, way in ((row, way) for row in rows if row.status == DONE for way in WAYS):
        found, name, one = row.result[way], row.case["sequence"], float(np.median(row.result["single"]["seconds"]))
        beside, every = (row.result["cold"], 1) if CHAINS[name].history else (row.result["single"], EVERY)
        expected = np.array([beside["normal"], beside["tangential"]])
        forces = np.array([found["normal"], found["tangential"]])[:, :: 1 if way == "single" else every]
        compared = way != "single" and forces.shape == expected.shape
        lines.append({
            "sequence": name, "way": way, "solved": found["status"].count("solved"), "planned": len(found["status"]),
            "later": statistics.fmean(found["seconds"][1:] or [math.nan]) / one,
            "together": sum(found["seconds"]) / one, "accuracy": max(found["accuracy"]),
            "force": float(np.abs(forces - expected).max() / np.abs(expected[0]).max()) if compared else np.nan,
        })  # fmt: skip
    columns = ("sequence", "way", "solved", "planned", "later", "together", "force", "accuracy")
    return DataFrame(lines, columns=columns)


_PLAIN: Final = ("cells", "backend", "version", "numeric", "plain", "message")
_HUNDREDTHS: Final = fixed(".2f")


def values_of(frames: Mapping[str, DataFrame]) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    solves = frames["solves"]
    shown = solves[(solves.cells == solves.cells.max()) & solves.ratio.notna()]
    powers = growth_of(solves, "friction", "unknowns")
    return {
        "tolerance": TOLERANCE, "problems": len(solves), "solved": int((solves.status == "solved").sum()),
        "largest": None if shown.empty else int(shown.cells.iloc[0]), "unknowns": shown.unknowns.max(),
        "ratios": span(shown.ratio, _HUNDREDTHS), "seconds": span(shown.whole, seconds),
        "library": next(iter(shown.library), None), "fastest": next(iter(shown.fastest), None),
        "growth": span(powers.values(), _HUNDREDTHS),
        "span": sorted(solves.cells.astype(int).unique())[-2:] if powers else None,
        **_of_sequences(frames["sequences"]),
    }  # fmt: skip


def _of_sequences(runs: DataFrame) -> dict[str, Any]:
    if runs.empty:
        return {"sequences": 0}
    warm, cold = (runs[runs.way == way].set_index("sequence") for way in ("warm", "cold"))
    sweeps = [each.later[[not CHAINS[name].history for name in each.index]] for each in (warm, cold)]
    return {
        "sequences": len(warm), "steps": int(runs.planned.sum()), "steps_solved": int(runs.solved.sum()),
        "cycle": warm.later.get("cycle"), "cycle_cold": cold.later.get("cycle"),
        "friction_whole": warm.together.get("friction"), "friction_planned": warm.planned.get("friction"),
        **dict(zip(("later", "later_cold"), (span(each, _HUNDREDTHS) for each in sweeps), strict=True)),
    }  # fmt: skip


_FORMS: Final[dict[str, Form]] = {
    **dict.fromkeys((*PARTS, "numeric", "plain", "factorised"), seconds),
    **dict.fromkeys(("friction", "load"), fixed("g")), "peak": memory, "accuracy": scientific, "spread": percent,
    **dict.fromkeys(("unknowns", "iterations", "contact_points", "blocks"), fixed(".0f")),
    "ratio": _HUNDREDTHS, "half_force": fixed(".8f"), "cells": lambda value: f"{value:.0f}²",
    **dict.fromkeys(("later", "together"), partial(significant, digits=2)),
    "half_force_error": lambda value: f"< {scientific(MEANINGLESS, 1)}" if value < MEANINGLESS else scientific(value),
    "force": lambda value: "–" if value != value else scientific(value),
    "message": lambda text: text if text and text == text else NOTHING,
}  # fmt: skip
"""Column of a table → how its values read."""


def report(whole: Rows, sequences: Rows) -> Report:
    """The report on the plate and on sequences, a function of the rows only."""
    frames = {"solves": solves_of(whole), "sequences": runs_of(sequences)}
    runs = frames["sequences"]
    plain = [{**row.case, **found, **{part: _median(found["seconds"].get(part)) for part in ("numeric", "plain")}}
             for row in whole for found in row.result.get("plain", ())]  # fmt: skip
    titles = runs.sequence.map(lambda name: CHAINS[name].title)
    shares = [f"{each.solved} of {each.planned}" for each in runs.itertuples()]
    tables = {**frames, "plain": DataFrame(plain, columns=_PLAIN), "sequences": runs.assign(title=titles, share=shares)}
    rows = [*whole, *sequences]
    return render("comparisons.benchmark", "benchmark", values_of(frames), tables, {}, rows, forms=_FORMS)


def walls_of(rows: Rows) -> DataFrame:
    """One line for each wall: CPU seconds, and the solve over one factorisation of K."""
    numbers = ("blocks", "load", "unknowns", "contact_points", "iterations", "accuracy", "assembly", "factorisation",
               "solve", "peak")  # fmt: skip
    walls = frame_of(rows, numbers, ("form",))
    ratio = (walls.solve / walls.factorisation).where(walls.status == "solved")
    return walls.assign(ratio=ratio, size=walls.blocks**2).sort_values(["blocks", "load"])


def wall_report(rows: Rows) -> Report:
    """The report on walls: for each load the largest ratio, and the exponent between the two largest walls."""
    walls = walls_of(rows)
    powers = growth_of(walls, "load", "size")
    loads = [{"load": load, "ratio": ratio, "power": powers.get(load)}
             for load, ratio in walls.groupby("load").ratio.max().items()]  # fmt: skip
    values = {"loads": loads, "walls": len(walls), "solved": int((walls.status == "solved").sum())}
    return render("comparisons.benchmark", "benchmark-wall", values, {"walls": walls}, {}, rows,
                  forms=_FORMS | {"ratio": fixed(".1f")}, template="wall.md")  # fmt: skip
