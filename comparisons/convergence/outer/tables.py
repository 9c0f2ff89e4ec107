"""The tables of the report."""

from comparisons.convergence.outer.entries import NAMES, Entries, Entry, body_name
from comparisons.convergence.outer.loops import PLAIN
from comparisons.lab.report.numbers import NOTHING, scientific, seconds, significant
from comparisons.lab.report.old import Table
from comparisons.lab.tables import Grid

SOLUTIONS = (("open", 0.0), ("slip", 5.0 / 3.0), ("stick", 17.0 / 9.0))
"""The three solutions of the problem that has them: state and pressure r_N; by hand, see `bodies`."""

NOMINAL = (
    "Its 95 % interval is nominal: it would hold for independent residuals, but those of an iteration depend on each "
    "other."
)
"""What the intervals are worth."""

_FAILS = "A status other than solved: the certificate did not pass, and no number of iterations is given."


def contraction_table(entries: Entries) -> Table:
    """Observed contraction of the plain loop beside theory."""
    rows = [_contraction_row(entry) for place in entries.places if (entry := entries.get(place, PLAIN)) is not None]
    headings = (
        "problem", "μ", "status", "observed contraction", "95 % interval", "linearised at the solution", "exact",
        "bound μγ", "bound μ√κ", "slipping / open / all points",
    )  # fmt: skip
    return Table(
        "contraction",
        Grid("Contraction of the plain loop", headings, rows),
        "The observed contraction is the factor by which the residual shrinks per iteration, by the slope of Theil and "
        f"Sen over its tail. {NOMINAL} `Linearised` is the spectral radius of the map s → |σ_N(s)| at the solution if "
        "points keep their states, `exact` the value by hand, and μγ ≤ μ√κ bound the contraction from above wherever "
        "the law at points equals that on traces; below 1 they prove that the solution is unique.",
        "Where the loop does not converge there is no contraction; the status says how it ended.",
    )


def _contraction_row(entry: Entry) -> tuple[str, ...]:
    low, high = entry.number("low"), entry.number("high")
    known = entry.rate is not None
    interval = f"{significant(low)} to {significant(high)}" if known else NOTHING
    bounds = [entry.number(name) for name in ("sharper", "kappa")]
    counts = [entry.result.get(name) for name in ("slipping", "open", "points")]
    return (
        body_name(entry.body), f"{entry.friction:g}", entry.status, significant(entry.rate), interval,
        significant(entry.number("linearised")), significant(entry.number("exact")),
        *(significant(entry.friction / bound if bound else None) for bound in bounds),
        " / ".join(NOTHING if count is None else str(count) for count in counts),
    )  # fmt: skip


def runs_table(entries: Entries) -> Table:
    """All runs."""
    rows = [
        _run_row(entries, entry)
        for place in entries.places
        for loop in entries.loops
        if (entry := entries.get(place, loop)) is not None
    ]
    headings = (
        "problem", "μ", "loop", "status", "iterations", "contraction", "time", "over condensed", "certified accuracy",
    )  # fmt: skip
    return Table(
        "runs",
        Grid("All runs", headings, rows),
        "One line for each run to a residual and certificate of 1e-8. Times are medians of repeated solves, the "
        "factorisation of K included; `over condensed` is their ratio to the direct method on the same problem. The "
        "certified accuracy is the smallest tolerance at which the certificate would pass.",
        _FAILS,
    )


def _run_row(entries: Entries, entry: Entry) -> tuple[str, ...]:
    certificate = entry.certificate or {}
    ratio = entries.ratio(entry)
    return (
        body_name(entry.body), f"{entry.friction:g}", entry.loop, entry.status,
        NOTHING if entry.iterations is None else str(entry.iterations), significant(entry.rate), seconds(entry.seconds),
        significant(ratio, 2), scientific(certificate.get("accuracy")),
    )  # fmt: skip


def mesh_table(entries: Entries) -> Table:
    """Contraction of the plain loop on all meshes with the same friction."""
    groups = mesh_groups(entries)
    rows = [
        (NAMES.get(problem, problem), f"{friction:g}", str(entry.cells), entry.status, significant(entry.rate),
         significant(entry.number("linearised")), significant(friction / bound if bound else None))
        for (problem, friction), found in groups.items()
        for entry in found
        for bound in (entry.number("sharper"),)
    ]  # fmt: skip
    headings = ("problem", "μ", "cells", "status", "contraction", "linearised", "bound μγ")
    return Table(
        "meshes",
        Grid("The plain loop on several meshes", headings, rows),
        "Cells are those of a side, of the height for the block. A contraction that depends on the mesh changes "
        "within a group of the same problem and μ; the bound grows like the root of the number of cells whatever the "
        "loop does.",
        "A status other than solved, or no contraction.",
    )


def mesh_groups(entries: Entries) -> dict[tuple[str, float], list[Entry]]:
    """(Problem, μ) → runs of the plain loop on at least two meshes, by mesh."""
    found: dict[tuple[str, float], list[Entry]] = {}
    for problem, cells, friction in sorted(entries.places, key=lambda place: (place[0], place[2], place[1])):
        entry = entries.get((problem, cells, friction), PLAIN)
        if entry is not None:
            found.setdefault((problem, friction), []).append(entry)
    return {group: several for group, several in found.items() if len(several) > 1}


def solution_found(entry: Entry) -> str:
    """Which of the three solutions a run ended in; the status if in none."""
    normal = entry.number("normal")
    if not entry.solved or normal is None:
        return entry.status
    name, pressure = min(SOLUTIONS, key=lambda solution: abs(solution[1] + normal))
    return name if abs(pressure + normal) < 1e-6 else "none of the three"


def solutions_table(entries: Entries) -> Table:
    """Which of three solutions each loop finds."""
    starts = list(dict.fromkeys(entry.start for entry in entries.several if entry.start is not None))
    rows = []
    for loop in entries.loops:
        found = {entry.start: solution_found(entry) for entry in entries.several if entry.loop == loop}
        rows.append((loop, *(found.get(start, found.get(None, NOTHING)) for start in starts)))
    return Table(
        "solutions",
        Grid("Which of three solutions is found", ("loop", *(f"start s = {start:g}" for start in starts)), rows),
        "One contact with u = W r + q, W = [[1, 0.8], [0.8, 1]], q = (1, 2.1), μ = 2: open (r_N = 0), slip (5/3) and "
        "stick (17/9) all solve it. The condensed method takes no start, its answer is the same in all columns.",
        "A word other than these three.",
    )
