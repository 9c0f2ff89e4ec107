"""The rows of each study as one frame, and the numbers of the sentences."""

import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise, product
from typing import Any, Final

from pandas import DataFrame

from comparisons.benchmark import reference
from comparisons.benchmark.reference import ACCURACY_TARGETS, GROWTH_SPAN, GROWTH_TARGET
from comparisons.benchmark.study import GENERAL
from comparisons.benchmark.task import TOLERANCE
from comparisons.lab.ratios import growth, spread
from comparisons.lab.report.numbers import fixed, scientific, seconds, span
from comparisons.lab.study import DONE, Row

PARTS: Final = ("whole", "assembly", "solve", "factorisation", "interior_point", "certificate", "rest")
"""Times of a solve, medians [s]: whole = assembly + solve; the other four are parts of solve."""

ANSWER: Final = ("status", "message", "unknowns", "iterations", "corrections", "half_force", "accuracy", "library")
POWERS: Final = ("solve", "whole", "own_factorisation", "fastest_factorisation")
LARGEST_RATIO: Final = {0.02: 20.0, 0.3: 45.0}
"""Load of a wall → what a whole solve should take at most, in factorisations of K."""

LARGEST_EXPONENT: Final = 1.3
"""Of the solve of a wall, with its number of blocks."""

WALL_CASE: Final = ("element", "blocks", "load")
"""What makes a wall."""

_WALL: Final = ("status", "message", "unknowns", "contact_points", "form", "iterations", "accuracy", "assembly",
                "factorisation", "solve", "peak")  # fmt: skip


def _frame(rows: Iterable[Mapping[str, Any]], columns: Sequence[str], numbers: Sequence[str]) -> DataFrame:
    """These columns of the rows; what is no number is NaN where there should be one."""
    frame = DataFrame(rows, columns=[*columns])
    return frame.astype(dict.fromkeys(numbers, float))


def _median(values: Sequence[float] | None) -> float | None:
    return statistics.median(values) if values else None


def _answer(row: Row) -> dict[str, Any]:
    """The result; of a case that was not finished, why."""
    return dict(row.result) if row.status == DONE else {"status": row.status, "message": row.reason}


def solves_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each number of cells, path and μ: the answer, medians of times, and ratios of these.

    Own is one factorisation of K by the same library, fastest the fastest one
    measured beside the solve.
    """
    names = ("cells", "path", "friction", *ANSWER, *PARTS, "spread", "runs", "own_factorisation", "fastest",
             "fastest_factorisation")  # fmt: skip
    numbers = {*names} - {"path", "status", "message", "library", "fastest"}
    solves = _frame([line for row in rows for line in _solves(row)], names, [*numbers])
    time = solves.solve.where(solves.status == "solved")
    errors = map(reference.relative_error, solves.half_force, solves.cells, solves.friction)
    return solves.assign(
        ratio_own=time / solves.own_factorisation, ratio_fastest=time / solves.fastest_factorisation,
        half_force_error=[*errors],
    )  # fmt: skip


def _solves(row: Row) -> Iterator[dict[str, Any]]:
    case = {name: row.case[name] for name in ("cells", "path")}
    lost = [{"friction": mu, **_answer(row)} for mu in row.case["friction"]]
    plain = {each["backend"]: _median(each["seconds"].get("plain")) for each in row.result.get("plain", ())}
    known = {backend: time for backend, time in plain.items() if time is not None}
    fastest = min(known, key=lambda backend: known[backend], default=None)
    for found in row.result.get("solves", lost):
        times = found.get("seconds", {})
        parts = {part: _median(times.get(part)) for part in PARTS}
        own = known.get(row.case["sparse"])
        yield {
            **case, **found, **parts, "spread": spread(times.get("solve", ())), "runs": len(times.get("solve", ())),
            "own_factorisation": own, "fastest": fastest, "fastest_factorisation": known.get(fastest or ""),
        }  # fmt: skip


def plain_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each back end beside each number of cells and path: medians [s]."""
    times = ("analysis", "numeric", "plain")
    lines = [
        {**row.case, **found, **{part: _median(found["seconds"].get(part)) for part in times},
         "runs": len(found["seconds"].get("plain", ()))}
        for row in rows for found in row.result.get("plain", ())
    ]  # fmt: skip
    return _frame(lines, ("cells", "path", "backend", "version", *times, "runs", "message"), times)


def memory_of(rows: Iterable[Row]) -> DataFrame:
    """Peak memory after the first whole solve of each case, before it, and the difference by unknown [bytes]."""
    numbers = ("cells", "peak", "imports")
    memory = _frame([{**row.case, **row.result} for row in rows if row.result], ("path", *numbers), numbers)
    return memory.assign(more=(memory.peak - memory.imports) / (4 * memory.cells**2))


def growth_of(
    found: DataFrame,
    by: Sequence[str],
    size: str,
    over: str,
    values: Sequence[str],
    whole: tuple[int, int] | None = None,
) -> DataFrame:
    """Exponents p of value ~ overᵖ between neighbouring sizes, and over `whole`, else from the first to the last."""
    lines = []
    for key, group in found.groupby([*by], sort=False):
        sized = group.drop_duplicates(size).set_index(size).sort_index()
        for ends in _spans([*sized.index], whole):
            numbers = sized.loc[[*ends]].where(sized.status == "solved")
            powers = {name: growth(tuple(numbers[over]), numbers[name]) for name in values}
            lines.append({**dict(zip(by, key, strict=True)), "from": ends[0], "to": ends[1], **powers})
    return _frame(lines, (*by, "from", "to", *values), ("from", "to", *values))


def _spans(sizes: Sequence[int], whole: tuple[int, int] | None) -> list[tuple[int, int]]:
    pairs = list(pairwise(sizes))
    ends = whole if whole and set(whole) <= set(sizes) else (sizes[0], sizes[-1])
    return pairs if ends in pairs or ends[0] == ends[1] else [*pairs, ends]


plate_growth: Final = partial(growth_of, by=("path", "friction"), size="cells", over="unknowns", values=POWERS,
                              whole=GROWTH_SPAN)  # fmt: skip
"""Of the times of `solves_of`, with the unknowns."""


def graded_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each graded mesh and μ: the answer, median time and error, and which targets it meets."""
    lines = [
        {"cells": row.case["mesh"][0], "grading": row.case["mesh"][1], "friction": row.case["friction"],
         **(answer := _answer(row)), "whole": _median(answer.get("seconds")), "runs": len(answer.get("seconds", ()))}
        for row in rows
    ]  # fmt: skip
    numbers = ("cells", "grading", "friction", "unknowns", "half_force", "whole")
    graded = _frame(lines, (*numbers, "runs", "status", "message"), numbers)
    errors = [*map(reference.settled_error, graded.half_force, graded.friction)]
    return graded.assign(
        error=errors, met=[[*map(target, _met(*each))] for each in zip(errors, graded.whole, strict=True)]
    )


def _met(error: float | None, whole: float) -> Iterator[tuple[float, float]]:
    return (each for each in ACCURACY_TARGETS if error is not None and error <= each[0] and whole <= each[1])


def target(found: tuple[float, float]) -> str:
    """A target of accuracy in words."""
    return f"{scientific(found[0], 1)} in {seconds(found[1])}"


def loops_of(rows: Iterable[Row], solves: DataFrame) -> DataFrame:
    """One line for each loop and number of cells, beside the condensed method of the first path."""
    lines = [{**row.case, **(answer := _answer(row)), "solve": _median(answer.get("seconds"))} for row in rows]
    numbers = ("cells", "friction", "iterations", "solve", "half_force", "unknowns")
    loops = _frame(lines, ("loop", "status", "message", *numbers), numbers)
    condensed = solves[(solves.path == next(iter(solves.path), GENERAL)) & (solves.status == "solved")]
    both = loops.merge(condensed[["cells", "friction", "solve", "half_force"]], "left", ["cells", "friction"],
                       suffixes=("", "_beside"))  # fmt: skip
    answered = both.status.isin(["solved", "inaccurate"])
    return both.assign(
        ratio=(both.solve / both.solve_beside).where(answered),
        half_force_difference=(both.half_force / both.half_force_beside - 1.0).abs().where(answered),
    )


def walls_of(rows: Iterable[Row]) -> DataFrame:
    """One line for each wall: CPU seconds, and the solve over one factorisation of K."""
    numbers = {*_WALL} - {"status", "message", "form"}
    lines = [{**{name: row.case[name] for name in WALL_CASE}, **_answer(row)} for row in rows]
    walls = _frame(lines, (*WALL_CASE, *_WALL), ["load", *numbers]).sort_values([*WALL_CASE])
    ratio = (walls.solve / walls.factorisation).where(walls.status == "solved")
    return walls.assign(ratio=ratio, size=walls.blocks**2)


wall_growth: Final = partial(growth_of, by=("element", "load"), size="blocks", over="size", values=("solve",))
"""Of the solve of walls, with the number of their blocks."""


def values_of(frames: Mapping[str, "DataFrame"]) -> dict[str, Any]:
    """The numbers of the report's sentences."""
    solves, graded = frames["solves"], frames["graded"]
    status = [*solves.status, *graded.status]
    return {
        "tolerance": TOLERANCE, "growth_target": GROWTH_TARGET, "growth_span": GROWTH_SPAN, "problems": len(status),
        "solved": status.count("solved"), "largest": [*_largest(solves)], "loops": [*_loops(frames["loops"])],
        "growth": [*_growth(frames["growth"])], "targets": [*_targets(graded)],
        "graded_targets": [*map(target, ACCURACY_TARGETS)], "settled": reference.SETTLED,
        "meaningless": reference.MEANINGLESS,
    }  # fmt: skip


_hundredths: Final = fixed(".2f")


def _largest(solves: DataFrame) -> Iterator[dict[str, Any]]:
    """For each path the time of solves on the largest mesh over the fastest plain factorisation."""
    shown = solves[(solves.cells == solves.cells.max()) & solves.ratio_fastest.notna()]
    for _, found in shown.groupby("path", sort=False):
        first = found.iloc[0]
        ratios = span(found.ratio_fastest, _hundredths)
        yield {"cells": int(first.cells), "ratios": ratios, "library": first.library, "fastest": first.fastest}


def _loops(loops: DataFrame) -> Iterator[dict[str, Any]]:
    """For each loop the largest mesh that it finishes; without a ratio if there is none."""
    for name, found in loops.groupby("loop", sort=False):
        timed = found[found.ratio.notna()]
        row = found.iloc[0] if timed.empty else timed.iloc[-1]
        yield {"name": name, "cells": int(row.cells), "ratio": row.ratio, "status": row.status}


def _growth(powers: DataFrame) -> Iterator[dict[str, Any]]:
    """For each path the exponents over the target's span."""
    whole = powers[(powers["from"] == GROWTH_SPAN[0]) & (powers["to"] == GROWTH_SPAN[1]) & powers.solve.notna()]
    for path, found in whole.groupby("path", sort=False):
        yield {"path": path, "powers": span(found.solve, _hundredths), "met": found.solve.max() <= GROWTH_TARGET}


def _targets(graded: DataFrame) -> Iterator[dict[str, Any]]:
    """For each μ the accuracy targets that some graded mesh meets, and those that none does."""
    for mu, found in graded.groupby("friction", sort=False):
        sides: dict[bool, list[str]] = {True: [], False: []}
        for each in map(target, ACCURACY_TARGETS):
            sides[any(each in met for met in found.met)].append(each)
        yield {"friction": mu, "met": sides[True], "missed": sides[False]}


def wall_values(walls: DataFrame) -> dict[str, Any]:
    """For each element what is solved, and for each load with a target ratio and exponents beside what they should be.

    The exponent is that from the smallest to the largest wall, the steepest that of neighbouring sizes.
    """
    found, powers = dict(list(walls.groupby("element", sort=False))), wall_growth(walls)
    solved = [
        {"element": element, "walls": len(each), "solved": int((each.status == "solved").sum())}
        for element, each in found.items()
    ]
    targets = []
    for (element, each), (load, most) in product(found.items(), LARGEST_RATIO.items()):
        pushed = powers[(powers.element == element) & (powers.load == load)].solve
        ratio = each[each.load == load].ratio.max()
        if ratio == ratio:
            exponents = {"exponent": pushed.iloc[-1], "steepest": pushed.max()} if len(pushed) else {}
            targets.append({"element": element, "load": load, "ratio": ratio, "most": most, **exponents})
    return {"targets": targets, "most": LARGEST_EXPONENT, "solved": solved}
