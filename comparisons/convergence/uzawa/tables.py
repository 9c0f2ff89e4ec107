"""The tables of the report."""

from comparisons.convergence.uzawa.entries import Entries, Entry, place_name
from comparisons.convergence.uzawa.task import ITERATIONS, LONG, SEARCHED
from comparisons.lab.report.numbers import NOTHING, percent, scientific, seconds, significant
from comparisons.lab.report.old import Table
from comparisons.lab.tables import Grid

_UNIT = "ω_T in the problem's unit of length; without a mesh there is no unit."


def error_after(entry: Entry) -> float | None:
    """Relative error of P/2 after the paper's iterations."""
    after, force = entry.number("after"), entry.number("force")
    return None if after is None or not force else abs(after / force - 1.0)


def paper_table(entries: Entries) -> Table:
    """The paper's own run."""
    rows = [_paper_row(entry) for entry in entries.runs("paper")]
    headings = (
        "μ", "P/2 printed [MPa length]", "after 30, accumulating rule", "after 30, printed rule", "solution",
        "error of P/2 at the start", "after 30", "of tractions after 30", "iterations to 1e-4", "to 1e-6",
        "contraction, linearised", "ω_T over its limit",
    )  # fmt: skip
    return Table(
        "paper",
        Grid("The paper's run: 2² cells, ω_T = 1e-5", headings, rows),
        "P/2 after the paper's 30 iterations by the two readings of rule (4.3), beside what Table 1 prints and the "
        "solution. Errors of P/2 are relative to the solution, those of tractions the largest one over the mean "
        "pressure; the start is the bonded plate. Iterations are those after which P/2 stays within 1e-4 and 1e-6 for "
        "good with the same step. The contraction is that of the iteration linearised at the solution, and the limit "
        "2 / λ_max of the dual operator.",
        f"`none`: not reached for good in {ITERATIONS} iterations, or no contraction because a bound is zero.",
    )


def _paper_row(entry: Entry) -> tuple[str, ...]:
    forces = [entry.number(name) for name in ("printed", "after", "after_printed_rule", "force")]
    errors = [entry.number("before"), error_after(entry), entry.number("tractions")]
    return (
        f"{entry.friction:g}", *(NOTHING if force is None else f"{force:.2f}" for force in forces),
        *(percent(error, 2) for error in errors), _count(entry.needed("1e-04")), _count(entry.needed("1e-06")),
        significant(entry.number("linearised")), significant(entry.ratio("omega_T", "limit_T"), 2),
    )  # fmt: skip


def limits_table(entries: Entries) -> Table:
    """Observed limits of the steps beside theory."""
    rows = [_limit_row(entry) for entry in entries.runs("tangential limit", "normal limit")]
    headings = (
        "problem", "step", "limit observed (share)", "fails at (share)", "linearised (share)",
        "slipping or open (share)",
        "2 / λ_max, all points", "observed",
    )  # fmt: skip
    return Table(
        "limit-table",
        Grid("Largest steps that settle", headings, rows),
        f"Shares are of 2 / λ_max of the dual operator over all points. Found by bisection between {SEARCHED[0]:g} "
        f"and {SEARCHED[1]:g} of it, the other step at half its limit; observed is the largest share that settles, "
        "`fails at` the smallest that does not. The linearised limit is where the iteration linearised at the "
        "solution stops to contract, the next one 2 / λ_max over the points that slip (ω_T) or are open (ω_N) there. "
        f"{_UNIT}",
        "An observed share below 1 where the linearised one is 1 or more: then 2 / λ_max would not be safe. `none` "
        "where nothing fails up to the largest share tried.",
    )


def _limit_row(entry: Entry) -> tuple[str, ...]:
    kind = "T" if entry.run == "tangential limit" else "N"
    part = entry.ratio("slipping_T", "limit_T") if kind == "T" else entry.ratio("open_N", "limit_N")
    largest = entry.number("largest")
    shown = significant(largest)
    if largest is not None and entry.number("smallest") is None:
        shown = f"> {shown}"
    return (
        place_name(entry.place), f"ω_{kind}", shown, significant(entry.number("smallest")),
        significant(entry.number("foreseen")), significant(part), scientific(entry.number(f"limit_{kind}"), 3),
        scientific(entry.number(f"omega_{kind}"), 3),
    )  # fmt: skip


def mesh_table(entries: Entries) -> Table:
    """Iterations needed on finer meshes."""
    rows = [
        (f"{friction:g}", str(entry.cells), scientific(entry.number("omega_T"), 3),
         significant(entry.number("condition")), significant(entry.number("linearised"), 4),
         *(_count(entry.needed(target)) for target in ("1e-02", "1e-03", "1e-04", "1e-06")), scientific(entry.accuracy))
        for friction, found in entries.meshes.items()
        for entry in found
    ]  # fmt: skip
    headings = (
        "μ", "cells a side", "ω_T", "condition", "contraction, linearised", "iterations to 1e-2", "to 1e-3", "to 1e-4",
        "to 1e-6", "certified accuracy at the end",
    )  # fmt: skip
    return Table(
        "meshes",
        Grid("Iterations on finer meshes, both steps at half their limits", headings, rows),
        "Iterations until the normal force stays within these errors for good. The condition is λ_max / λ_min of the "
        f"dual operator on the slipping points. {_UNIT}",
        f"`none`: not reached for good in {LONG} iterations.",
    )


def accuracy_table(entries: Entries) -> Table:
    """All methods at equal accuracy."""
    rows = [
        (place_name(place), entry.run, scientific(entry.target, 1), entry.status, str(entry.result["iterations"]),
         seconds(entry.seconds), scientific(entry.accuracy))
        for place, found in entries.accuracies.items()
        for entry in found
    ]  # fmt: skip
    headings = ("problem", "method", "target", "status", "iterations", "time", "certified accuracy")
    return Table(
        "accuracy",
        Grid("All methods to the same certified accuracy", headings, rows),
        "Each method stops when the certificate confirms the target. Iterations of Uzawa cost a product with a dense "
        "matrix, those of the fixed point a convex problem each, those of the condensed method a dense factorisation. "
        "Times are medians, the factorisation of K included.",
        "A status other than solved: the certified accuracy is then what was reached.",
    )


def _count(value: int | None) -> str:
    return NOTHING if value is None else str(value)
