"""The reports on the plate, on sequences and on walls: numbers, tables and the picture, from the stored rows alone."""

import math
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pandas import DataFrame

from comparisons.benchmark.study import (
    CHAINS,
    EVERY,
    FRICTION,
    PARTS,
    TOLERANCE,
    WALL,
    WAYS,
    WHOLE,
)
from comparisons.lab.report import Document, drawn, environment_grids, render
from comparisons.lab.report.drawing import LOOKS, grid
from comparisons.lab.report.numbers import (
    NOTHING,
    fixed,
    listing,
    memory,
    percent,
    scientific,
    seconds,
    significant,
    span,
)
from comparisons.lab.study import DONE, Row, StoredStudy
from comparisons.lab.tables import Form
from comparisons.settled import LIMITS
from qvi_contact.plots.style import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ACCURACY_TARGETS: Final = ((1e-5, 0.1), (1e-6, 0.25), (1e-7, 0.6))
"""Relative error of P/2 and the time [s] in which it should be reached, with one thread."""

MEANINGLESS: Final = 1e-9
"""Relative errors below this say nothing: so uncertain are the values of `LIMITS`."""

LARGEST_RATIO: Final = {0.02: 20.0, 0.3: 45.0}
"""Load of a wall → what a whole solve should take at most, in factorisations of K."""

LARGEST_EXPONENT: Final = 1.3
"""Of the solve of a wall, with its number of blocks."""

_ANSWER: Final = ("status", "message", "unknowns", "iterations", "corrections", "half_force", "accuracy", "library")
_POWERS: Final = ("solve", "whole", "own_factorisation", "fastest_factorisation")
_WALL: Final = ("status", "message", "unknowns", "contact_points", "form", "iterations", "accuracy", "assembly",
                "factorisation", "solve", "peak")  # fmt: skip


def growth(sizes: tuple[float, float], values: Any) -> float | None:
    """The exponent p of value ~ sizeᵖ between two sizes; None where a value is missing or not positive.

    p = log(v₂/v₁) / log(n₂/n₁).
    """
    first, second = (math.nan if value is None else value for value in values)
    if not (first > 0.0 and second > 0.0) or sizes[0] == sizes[1]:
        return None
    return math.log(second / first) / math.log(sizes[1] / sizes[0])


def growth_of(found: DataFrame, by: Sequence[str], size: str, over: str, values: Sequence[str]) -> DataFrame:
    """Exponents p of value ~ overᵖ between neighbouring sizes, and from the first to the last."""
    lines = []
    for key, group in found.groupby([*by], sort=False):
        sized = group.drop_duplicates(size).set_index(size).sort_index()
        sizes = [*sized.index]
        for ends in dict.fromkeys([*pairwise(sizes), *([(sizes[0], sizes[-1])] if len(sizes) > 1 else [])]):
            numbers = sized.loc[[*ends]].where(sized.status == "solved")
            powers = {name: growth(tuple(numbers[over]), numbers[name]) for name in values}
            lines.append({**dict(zip(by, key, strict=True)), "from": ends[0], "to": ends[1], **powers})
    return _frame(lines, (*by, "from", "to", *values), ("from", "to", *values))


plate_growth: Final = partial(growth_of, by=("friction",), size="cells", over="unknowns", values=_POWERS)
"""Of the times of `solves_of`, with the unknowns."""

wall_growth: Final = partial(growth_of, by=("load",), size="blocks", over="size", values=("solve",))
"""Of the solve of walls, with the number of their blocks."""


def _frame(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], numbers: Iterable[str]) -> DataFrame:
    """These columns of the rows; what is no number is NaN where there should be one."""
    return DataFrame(rows, columns=[*columns]).astype(dict.fromkeys(numbers, float))


def _median(values: Sequence[float] | None) -> float | None:
    return statistics.median(values) if values else None


def _answer(row: Row) -> dict[str, Any]:
    """The result; of a case that was not finished, why."""
    return dict(row.result) if row.status == DONE else {"status": row.status, "message": row.reason}


def solves_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each number of cells and μ: the answer, medians of times, and ratios of these.

    Own is one factorisation of K by the same library, fastest the fastest one measured beside the solve.
    """
    names = ("cells", "friction", *_ANSWER, *PARTS, "spread", "runs", "own_factorisation", "fastest",
             "fastest_factorisation")  # fmt: skip
    numbers = {*names} - {"status", "message", "library", "fastest"}
    solves = _frame([line for row in rows for line in _solves(row)], names, numbers)
    time = solves.solve.where(solves.status == "solved")
    return solves.assign(
        ratio_own=time / solves.own_factorisation, ratio_fastest=time / solves.fastest_factorisation,
        half_force_error=[_error(force, mu) for force, mu in zip(solves.half_force, solves.friction, strict=True)],
    )  # fmt: skip


def _error(half_force: float | None, friction: float) -> float:
    """|P/2| error relative to `LIMITS`; NaN where that has no value."""
    known = LIMITS.get(friction)
    return math.nan if known is None or half_force is None else abs(half_force / known[0] - 1.0)


def _solves(row: Row) -> Iterator[dict[str, Any]]:
    lost = [{"friction": mu, **_answer(row)} for mu in row.case["friction"]]
    plain = {each["backend"]: _median(each["seconds"].get("plain")) for each in row.result.get("plain", ())}
    known = {backend: time for backend, time in plain.items() if time is not None}
    fastest = min(known, key=lambda backend: known[backend], default=None)
    for found in row.result.get("solves", lost):
        times = found.get("seconds", {})
        several = times.get("solve", ())
        middle = statistics.median(several) if len(several) > 1 else 0.0
        yield {
            "cells": row.case["cells"], **found, **{part: _median(times.get(part)) for part in PARTS},
            "spread": (max(several) - min(several)) / middle if middle > 0.0 else None, "runs": len(several),
            "own_factorisation": known.get(row.case["sparse"]), "fastest": fastest,
            "fastest_factorisation": known.get(fastest or ""),
        }  # fmt: skip


def plain_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each back end and number of cells: medians [s]."""
    times = ("analysis", "numeric", "plain")
    lines = [
        {**row.case, **found, **{part: _median(found["seconds"].get(part)) for part in times},
         "runs": len(found["seconds"].get("plain", ()))}
        for row in rows for found in row.result.get("plain", ())
    ]  # fmt: skip
    return _frame(lines, ("cells", "backend", "version", *times, "runs", "message"), times)


def memory_of(rows: Iterable[Row]) -> DataFrame:
    """Peak memory after the first whole solve of each case, before it, and the difference by unknown [bytes]."""
    done = [row for row in rows if row.result]
    lines = [{**row.case, **row.result, "unknowns": row.result["solves"][0].get("unknowns")} for row in done]
    found = _frame(lines, ("cells", "unknowns", "peak", "imports"), ("cells", "unknowns", "peak", "imports"))
    return found.assign(more=(found.peak - found.imports) / found.unknowns)


def graded_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each graded mesh and μ: the answer, median time and error, and which targets it meets."""
    lines = [
        {"depth": row.case["mesh"][0], "degree": row.case["mesh"][1], "friction": row.case["friction"],
         **(answer := _answer(row)), "whole": _median(answer.get("seconds")), "runs": len(answer.get("seconds", ()))}
        for row in rows
    ]  # fmt: skip
    numbers = ("depth", "degree", "friction", "unknowns", "half_force", "whole")
    found = _frame(lines, (*numbers, "runs", "status", "message"), numbers)
    errors = [_error(force, mu) for force, mu in zip(found.half_force, found.friction, strict=True)]
    met = [
        [target(each) for each in ACCURACY_TARGETS if error <= each[0] and whole <= each[1]]
        for error, whole in zip(errors, found.whole, strict=True)
    ]
    return found.assign(error=errors, met=met)


def target(found: tuple[float, float]) -> str:
    """A target of accuracy in words."""
    return f"{scientific(found[0], 1)} in {seconds(found[1])}"


def loops_of(rows: Iterable[Row], solves: DataFrame) -> DataFrame:
    """One line for each loop and number of cells, beside the condensed method."""
    lines = [{**row.case, **(answer := _answer(row)), "solve": _median(answer.get("seconds"))} for row in rows]
    numbers = ("cells", "friction", "iterations", "solve", "half_force", "unknowns")
    loops = _frame(lines, ("loop", "status", "message", *numbers), numbers)
    condensed = solves[solves.status == "solved"][["cells", "friction", "solve", "half_force"]]
    both = loops.merge(condensed, "left", ["cells", "friction"], suffixes=("", "_beside"))
    answered = both.status.isin(["solved", "inaccurate"])
    return both.assign(
        ratio=(both.solve / both.solve_beside).where(answered),
        half_force_difference=(both.half_force / both.half_force_beside - 1.0).abs().where(answered),
    )


def runs_of(rows: Sequence[Row]) -> DataFrame:
    """One line a sequence and way.

    The columns are sequence, way, solved and planned (numbers of problems), iterations (of all but the first), later
    (mean processor time of a problem after the first) and together (time of all), both over the median of single
    solves, force (largest difference of a force from that of single solves, of histories from cold starts, over the largest
    normal force), and accuracy (the worst that a certificate confirms).
    """
    done = sorted((row for row in rows if row.status == DONE), key=lambda row: row.position)
    columns = ("sequence", "way", "solved", "planned", "iterations", "later", "together", "force", "accuracy")
    return DataFrame([_run(row, way) for row in done for way in WAYS], columns=columns)


def _run(row: Row, way: str) -> dict[str, Any]:
    found, name = row.result[way], row.case["sequence"]
    one = float(np.median(row.result["single"]["seconds"]))
    beside, every = (row.result["cold"], 1) if CHAINS[name].history else (row.result["single"], EVERY)
    expected = np.array([beside["normal"], beside["tangential"]])
    forces = np.array([found["normal"], found["tangential"]])[:, :: 1 if way == "single" else every]
    compared = way != "single" and forces.shape == expected.shape
    return {
        "sequence": name, "way": way, "solved": found["status"].count("solved"), "planned": len(found["status"]),
        "iterations": int(sum(found["iterations"][1:])),
        "later": statistics.fmean(found["seconds"][1:] or [math.nan]) / one,
        "together": sum(found["seconds"]) / one, "accuracy": max(found["accuracy"]),
        "force": float(np.abs(forces - expected).max() / np.abs(expected[0]).max()) if compared else np.nan,
    }  # fmt: skip


def walls_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each wall: CPU seconds, and the solve over one factorisation of K."""
    lines = [{"blocks": row.case["blocks"], "load": row.case["load"], **_answer(row)} for row in rows]
    numbers = ["load", *({*_WALL} - {"status", "message", "form"})]
    walls = _frame(lines, ("blocks", "load", *_WALL), numbers).sort_values(["blocks", "load"])
    ratio = (walls.solve / walls.factorisation).where(walls.status == "solved")
    return walls.assign(ratio=ratio, size=walls.blocks**2)


_HUNDREDTHS: Final = fixed(".2f")


def values_of(frames: Mapping[str, DataFrame]) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    solves, graded, sequences = frames["solves"], frames["graded"], frames["sequences"]
    status = [*solves.status, *graded.status]
    shown = solves[(solves.cells == solves.cells.max()) & solves.ratio_fastest.notna()]
    loops = []
    for name, found in frames["loops"].groupby("loop", sort=False):  # of each the largest mesh that it finishes
        timed = found[found.ratio.notna()]
        row = found.iloc[0] if timed.empty else timed.iloc[-1]
        loops.append({"name": name, "cells": int(row.cells), "ratio": row.ratio, "status": row.status})
    whole = frames["growth"][frames["growth"]["to"] == frames["growth"]["to"].max()]
    whole = whole[whole["from"] == whole["from"].min()]
    targets = [
        {"friction": mu, "met": sum(any(name in met for met in found.met) for name in map(target, ACCURACY_TARGETS))}
        for mu, found in graded.groupby("friction", sort=False)
    ]
    return {
        "tolerance": TOLERANCE, "problems": len(status), "solved": status.count("solved"), "loops": loops,
        "largest": None if shown.empty else int(shown.cells.iloc[0]), "unknowns": shown.unknowns.max(),
        "ratios": span(shown.ratio_fastest, _HUNDREDTHS), "seconds": span(shown.whole, seconds),
        "library": next(iter(shown.library), None), "fastest": next(iter(shown.fastest), None),
        "growth": span(whole.solve, _HUNDREDTHS),
        "span": None if whole.empty else (int(whole["from"].min()), int(whole["to"].max())),
        "targets": targets, "all_targets": [*map(target, ACCURACY_TARGETS)], "meaningless": MEANINGLESS,
        **_of_sequences(sequences),
    }  # fmt: skip


def _of_sequences(runs: DataFrame) -> dict[str, Any]:
    if runs.empty:
        return {"sequences": 0}
    warm, cold = (runs[runs.way == way].set_index("sequence") for way in ("warm", "cold"))
    saved = 1.0 - warm.iterations / cold.iterations
    usual = saved.drop("depth", errors="ignore")
    return {
        "sequences": len(warm), "steps": int(runs.planned.sum()), "steps_solved": int(runs.solved.sum()),
        "cycle": warm.later.get("cycle"), "cycle_cold": cold.later.get("cycle"),
        "friction_whole": warm.together.get("friction"), "friction_cold": cold.together.get("friction"),
        "friction_planned": warm.planned.get("friction"), "least": usual.min(), "most": usual.max(),
        "depth": -saved.get("depth", math.nan), "force": runs.force.max(),
    }  # fmt: skip


def wall_values(walls: DataFrame) -> dict[str, Any]:
    """What is solved, and for each load with a target ratio and exponents beside what they should be.

    The exponent is that from the smallest to the largest wall, the steepest that of neighbouring sizes.
    """
    powers, targets = wall_growth(walls), []
    for load, most in LARGEST_RATIO.items():
        pushed, ratio = powers[powers.load == load].solve, walls[walls.load == load].ratio.max()
        if ratio == ratio:
            exponents = {"exponent": pushed.iloc[-1], "steepest": pushed.max()} if len(pushed) else {}
            targets.append({"load": load, "ratio": ratio, "most": most, **exponents})
    return {"targets": targets, "most": LARGEST_EXPONENT, "walls": len(walls),
            "solved": int((walls.status == "solved").sum())}  # fmt: skip


def _cells(value: float) -> str:
    return NOTHING if value != value else f"{value:.0f}²"


def _shown_error(value: float | None) -> str:
    """An error of P/2; one below what the limits are known to means nothing."""
    return f"< {scientific(MEANINGLESS, 1)}" if value is not None and value < MEANINGLESS else scientific(value)


_COMMON: Final[dict[str, Form]] = {
    **dict.fromkeys(("assembly", "solve", "factorisation", "interior_point", "certificate", "rest", "analysis",
                     "numeric", "plain", "whole", "seconds"), seconds),
    **dict.fromkeys(("friction", "load"), fixed("g")), "peak": memory, "accuracy": scientific,
    **dict.fromkeys(("unknowns", "iterations", "corrections", "runs", "contact_points", "blocks", "depth", "degree"),
                    fixed(".0f")),
    **dict.fromkeys(("power", "power_with_assembly", "own_factorisation", "fastest_factorisation"), _HUNDREDTHS),
}  # fmt: skip
FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("cells", "from", "to"), _cells), "spread": percent, "imports": memory,
    **dict.fromkeys(("ratio_own", "ratio_fastest"), _HUNDREDTHS), "more": fixed(".0f"), "met": listing,
    "half_force": fixed(".8f"), "ratio": lambda value: significant(value, 4), **dict.fromkeys(("later", "together"), partial(significant, digits=2)),
    **dict.fromkeys(("half_force_error", "error"), _shown_error), "half_force_difference": scientific,
    "force": lambda value: "–" if value != value else scientific(value),
}  # fmt: skip
"""Column of the tables on the plate → how its values read."""

WALL_FORMS: Final[dict[str, Form]] = {
    **_COMMON, **dict.fromkeys(("from", "to"), fixed(".0f")), "ratio": fixed(".1f"),
    "message": lambda text: text or NOTHING,
}  # fmt: skip
"""The same of the tables on walls."""


def frames_of(
    whole: StoredStudy, graded: StoredStudy, sequences: StoredStudy, loops: StoredStudy | None = None
) -> dict[str, Any]:
    """What was measured, as frames by name."""
    solves = solves_of(whole.rows)
    return {
        "solves": solves, "plain": plain_of(whole.rows), "memory": memory_of(whole.rows),
        "growth": plate_growth(solves), "loops": loops_of(loops.rows if loops else (), solves),
        "graded": graded_of(graded.rows), "sequences": runs_of(sequences.rows),
    }  # fmt: skip


def report(
    whole: StoredStudy, graded: StoredStudy, sequences: StoredStudy, loops: StoredStudy | None = None
) -> Document:
    """The report on the plate and on sequences; the same rows give the same one."""
    frames = frames_of(whole, graded, sequences, loops)
    solves, rows = frames["solves"], [*whole.rows, *graded.rows, *sequences.rows, *(loops.rows if loops else ())]
    measured = solves.friction.unique()
    friction = FRICTION if FRICTION in measured else min(measured, default=None)
    values = {
        **values_of(frames), "friction": friction, "frictions": measured, "cells": solves.cells.unique(),
        "threads": _environment(whole, "threads"), "limit": loops and _environment(loops, "timeout_seconds"),
    }  # fmt: skip
    titles = frames["sequences"].sequence.map(lambda name: CHAINS[name].title)
    shares = frames["sequences"][["solved", "planned"]].astype(str).agg(" of ".join, axis=1) if len(titles) else titles
    tables = {
        "times-table": solves, "answers": solves,
        **{name: frames[name] for name in ("plain", "memory", "loops", "graded")},
        "growth": frames["growth"].rename(columns={"solve": "power", "whole": "power_with_assembly"}),
        "sequences": frames["sequences"].assign(title=titles, share=shares),
    }  # fmt: skip
    figures = {"times": drawn("benchmark", partial(_picture, frames, friction))}
    return render("comparisons.benchmark", WHOLE, values, tables, figures, environment_grids(rows), forms=FORMS)


def document_of(
    whole: StoredStudy, graded: StoredStudy, sequences: StoredStudy, loops: StoredStudy | None = None
) -> dict[str, Any]:
    """What was measured on the plate and on sequences, for JSON."""
    frames = frames_of(whole, graded, sequences, loops)
    return {"schema": "qvi-contact/benchmark/3", **{name: frame.to_dict("records") for name, frame in frames.items()}}


def _environment(study: StoredStudy, name: str) -> Any:
    """What the first row says of its environment."""
    return next((row.environment[name] for row in study.rows), None)


def wall_report(study: StoredStudy) -> Document:
    """The report on walls."""
    walls = walls_of(study.rows)
    values = {
        **wall_values(walls), "blocks": sorted(walls.blocks.unique()), "loads": sorted(walls.load.unique()),
        "threads": _environment(study, "threads"), "limit": _environment(study, "timeout_seconds"),
    }  # fmt: skip
    tables = {"walls": walls, "growth": wall_growth(walls).rename(columns={"solve": "power"})}
    return render("comparisons.benchmark", WALL, values, tables, {}, environment_grids(study.rows), forms=WALL_FORMS,
                  template="wall.md")  # fmt: skip


def wall_document(study: StoredStudy) -> dict[str, Any]:
    """What was measured on walls, for JSON."""
    walls = walls_of(study.rows)
    records = {"walls": walls.to_dict("records"), "growth": wall_growth(walls).to_dict("records")}
    return {"schema": "qvi-contact/benchmark-wall/3", **records}


def _picture(frames: Mapping[str, DataFrame], friction: float | None) -> "Figure | None":
    """Left: seconds against unknowns at one friction; right: error of P/2 against seconds on graded meshes."""
    from matplotlib.ticker import NullFormatter

    if friction is None:
        return None
    solves, loops = frames["solves"], frames["loops"]
    solved = solves[(solves.friction == friction) & (solves.status == "solved")]
    lines = [
        ("whole solve", solved.unknowns, solved.solve),
        ("one plain factorisation, fastest", solved.unknowns, solved.fastest_factorisation),
    ]
    for name, found in loops[loops.status == "solved"].groupby("loop", sort=False):
        lines.append((str(name), found.unknowns, found.solve))  # fmt: skip
    graded = frames["graded"]
    beside = [(f"graded meshes, μ = {mu:g}", found.whole, found.error) for mu, found in graded.groupby("friction")]
    figure = new_figure(11.0, 4.8)
    for axes, curves, x, y in (
        (figure.add_subplot(1, 2, 1), lines, "unknowns [-]", "wall time [s]"),
        (figure.add_subplot(1, 2, 2), beside, "wall time [s]", "relative error of P/2 [-]"),
    ):
        for (colour, marker, style), (label, across, up) in zip(LOOKS, curves, strict=False):
            if (up > 0.0).any():
                axes.plot(across, up, color=colour, marker=marker, linestyle=style, label=label, markersize=5)
        axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y)
        axes.xaxis.set_minor_formatter(NullFormatter())
        grid(axes)
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=7)
    return figure
