"""Tables of a run, once for the terminal and for Markdown."""

from typing import Any, Final

from comparisons.benchmark.reference import GROWTH_TARGET, MEANINGLESS, SETTLED
from comparisons.lab.tables import Grid

Document = dict[str, Any]

_NOTHING: Final = "-"
_MIB: Final = 2.0**20


def tables(document: Document) -> list[Grid]:
    """All tables, without those that have no rows."""
    made = (_times, _results, _plain, _memory, _growth, _loops, _graded, _peers)
    return [grid for grid in (make(document) for make in made) if grid.rows]


def _times(document: Document) -> Grid:
    headings = ("cells", "path", "μ", "assembly", "solve", "spread", "factor-\nisation", "interior\npoint",
                "certi-\nficate", "rest", "solve /\nown", "solve /\nfastest", "fastest", "runs")  # fmt: skip
    names = ("factorisation", "interior_point", "certificate", "rest")
    rows = [
        (
            f"{row['cells']}²", row["path"], f"{row['friction']:g}", _seconds(row["assembly"]), _seconds(row["solve"]),
            _number(row["solve_spread"], ".0%"), *(_seconds(row[name]) for name in names),
            _number(row["ratio_own"], ".2f"), _number(row["ratio_fastest"], ".2f"), row["fastest"] or _NOTHING,
            str(row["repetitions"]),
        )
        for row in document["solves"]
    ]  # fmt: skip
    note = (
        "Medians in seconds. Solve: from the problem to the certified result, less assembly (spread: largest less "
        "smallest over median); factorisation with Schur complement, interior point with defect corrections, "
        "certificate and the rest, such as the choice of units, are parts of it. Own: one plain "
        "factorisation of the same matrix by the same library (shared subdomains have none: their own elimination). "
        "Fastest: the same by the fastest library installed."
    )
    return Grid("Whole solve", headings, rows, note)


def _results(document: Document) -> Grid:
    headings = ("cells", "path", "μ", "unknowns", "status", "iter-\nations", "correc-\ntions", "P/2", "error of P/2",
                "residual")  # fmt: skip
    rows = [
        (
            f"{row['cells']}²", row["path"], f"{row['friction']:g}", _number(row["unknowns"], "d"), row["status"],
            _number(row["iterations"], "d"), _number(row["corrections"], "d"), _number(row["half_force"], ".8f"),
            _number(row["half_force_error"], ".1e"), _number(row["accuracy"], ".1e"),
        )
        for row in document["solves"]
    ]  # fmt: skip
    note = (
        f"P/2 in MPa × length; its error is relative to the converged value on the same mesh, known for μ = 0.2. The "
        f"residual is the certificate's, to be below {document['tolerance']:.0e}."
    )
    return Grid("Answers", headings, rows, note)


def _plain(document: Document) -> Grid:
    headings = ("cells", "beside", "library", "version", "analysis", "numeric", "together", "runs", "remark")
    rows = [
        (
            f"{row['cells']}²", row["path"], row["backend"], row["version"] or _NOTHING, _seconds(row["analysis"]),
            _seconds(row["numeric"]), _seconds(row["plain"]), str(row["repetitions"]), row["message"],
        )
        for row in document["plain"]
    ]  # fmt: skip
    note = "Medians in seconds of one factorisation of K without Schur complement, conversion of K included."
    return Grid("Plain factorisation", headings, rows, note)


def _memory(document: Document) -> Grid:
    rows = [
        (
            f"{row['cells']}²", row["path"], _number(_over(row["peak"], _MIB), ".0f"),
            _number(_over(row["imports"], _MIB), ".0f"), _number(_more(row), ".0f"),
        )
        for row in document["memory"]
    ]  # fmt: skip
    note = "Peak resident memory of a fresh process after one whole solve, assembly included, and before it."
    return Grid("Memory", ("cells", "path", "peak [MiB]", "before [MiB]", "more, by unknown [bytes]"), rows, note)


def _growth(document: Document) -> Grid:
    headings = (
        "path",
        "μ",
        "from",
        "to",
        "solve",
        "with\nassembly",
        "own fac-\ntorisation",
        "fastest fac-\ntorisation",
    )
    names = ("solve", "whole", "own_factorisation", "fastest_factorisation")
    rows = [
        (
            row["path"], f"{row['friction']:g}", f"{row['from']}²", f"{row['to']}²",
            *(_number(row[name], ".2f") for name in names),
        )
        for row in document["growth"]
    ]  # fmt: skip
    note = f"Exponents p of time ~ unknownsᵖ. Target for the solve from 128² to 512²: p ≤ {GROWTH_TARGET}."
    return Grid("Growth", headings, rows, note)


def _loops(document: Document) -> Grid:
    headings = ("cells", "method", "μ", "status", "iterations", "solve [s]", "/ condensed", "difference in P", "remark")
    rows = [
        (
            f"{row['cells']}²", row["name"], f"{row['friction']:g}", row["status"], _number(row["iterations"], "d"),
            _seconds(row["solve"]), _number(row["ratio"], ".1f"), _number(row["half_force_difference"], ".1e"),
            row["message"] if row["solve"] is None else "",
        )
        for row in document["loops"]
    ]  # fmt: skip
    note = (
        "The fixed point on the friction bound with a quadratic program in all unknowns each time, through qpsolvers "
        "or cvxpy, or with a program of cones; the same on the condensed operator; all by Clarabel. The paper's "
        "iteration. Assembly left out. Ratio and difference in P to the condensed method on the same mesh, where both "
        "have a result; inaccurate: the certificate failed."
    )
    return Grid("Loops", headings, rows, note)


def _graded(document: Document) -> Grid:
    headings = ("cells", "grading", "μ", "unknowns", "status", "P/2", "error", "time [ms]", "runs", "meets")
    rows = [
        (
            f"{row['cells']}²", f"{row['grading']:g}", f"{row['friction']:g}", _number(row["unknowns"], "d"),
            row["status"], _number(row["half_force"], ".5f"), _error(row["error"]), _milliseconds(row["whole"]),
            str(len(row["seconds"])), ", ".join(_target(target) for target in row["meets"]) or _NOTHING,
        )
        for row in document["graded"]
    ]  # fmt: skip
    targets = ", ".join(_target(target) for target in document["graded_targets"])
    settled = ", ".join(f"{force} at μ = {mu:g}" for mu, force in SETTLED.items())
    note = (
        f"Median time from discretize to the certified result after import, one thread. Errors are relative to what "
        f"displacement codes settle on, {settled} (±2e-5): below {MEANINGLESS:.0e} they mean nothing. At μ = 1 the "
        f"contact sticks everywhere. Targets: {targets}."
    )
    return Grid("Accuracy for its cost: graded meshes", headings, rows, note)


def _peers(document: Document) -> Grid:
    headings = ("code", "cells", "P/2", "error", "reported time [s]")
    rows = [
        (
            row["code"], f"{row['cells']}²" if row["cells"] else _NOTHING, f"{row['half_force']:.5f}",
            _error(row["error"]), f"{row['seconds']:g}",
        )
        for row in document["peers"]
    ]  # fmt: skip
    note = (
        "Displacement elements on the same plate, μ = 0.2. Reported: measured once on another day and on another "
        "machine perhaps, the solve alone; not part of this run and not to be divided by its times."
    )
    return Grid("Other codes, as reported", headings, rows, note)


def _target(target: dict[str, float]) -> str:
    return f"{target['error']:.0e} in {1e3 * target['seconds']:.0f} ms"


def _error(value: float | None) -> str:
    if value is None:
        return _NOTHING
    return f"< {MEANINGLESS:.0e}" if value < MEANINGLESS else f"{value:.1e}"


def _seconds(value: float | None) -> str:
    return _NOTHING if value is None else f"{value:.3g}" if value < 100.0 else f"{value:.0f}"


def _milliseconds(value: float | None) -> str:
    return _NOTHING if value is None else f"{1e3 * value:.1f}"


def _number(value: float | None, form: str) -> str:
    return _NOTHING if value is None else format(value, form)


def _over(value: float | None, unit: float) -> float | None:
    return None if value is None else value / unit


def _more(row: dict[str, Any]) -> float | None:
    if row["peak"] is None or row["imports"] is None:
        return None
    return float((row["peak"] - row["imports"]) / row["unknowns"])
