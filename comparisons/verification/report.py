"""The verification manual: its chapters, their run, tables and pictures, and the report."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import chain
from typing import Final, NamedTuple

from pandas import DataFrame

from comparisons.lab.drawing import drawn
from comparisons.lab.numbers import NOTHING, fixed
from comparisons.lab.reports import Report, escaped, render
from comparisons.lab.studies import machine, versions
from comparisons.verification.chapters import benchmarks, curves, exact, limits, numbers, plate
from comparisons.verification.known import EXAMPLES
from comparisons.verification.measures import MM
from comparisons.verification.rows import EQUAL, EXCESS, RELATIVE, SHORTFALL, Chapters, Row, crash
from qvi_contact import ContactProblem, gallery
from qvi_contact.basics.terminal import Advance
from qvi_contact.plots import problem_figure
from qvi_contact.units import Units
from solvers.errors import known_name

CHAPTERS: Final[Chapters] = {
    "paper": plate.PAPER, "exact": exact.EXACT, "friction": exact.FRICTION, "ssnv128": benchmarks.SSNV128,
    "benchmarks": benchmarks.BENCHMARKS, "curves": curves.CURVES, "limits": limits.LIMITS,
    "invariance": exact.INVARIANCE, "plate": plate.PLATE, "energies": plate.ENERGIES, "bounds": plate.BOUNDS,
    "numbers": numbers.NUMBERS, "examples": EXAMPLES,
}  # fmt: skip
"""The chapters in the order of the manual."""

HEADINGS: Final = (
    "quantity", "element", "reference", "kind", "source", "ours", "error", "tolerance", "certificate", "result",
)  # fmt: skip
_LARGEST: Final = "largest error / tolerance"
_DIGITS: Final = 10
_SENSES: Final = {EXCESS: "≤ ", SHORTFALL: "≥ "}
_DIGITS_OF_BOUNDS: Final = 1e-7  # relative resolution of numbers in inequalities
_ROUNDING: Final = 1e-10  # smaller errors differ between machines, and are shown as "< 1e-10"


def choose(names: Sequence[str]) -> Chapters:
    """The chapters, or problems, of these names in the manual's order; all without names; `InputError` if unknown."""
    for name in names:
        known_name("--only", name, {"chapters": CHAPTERS, "problems": [*chain(*CHAPTERS.values())]})
    if not names:
        return CHAPTERS
    chosen = {
        chapter: {name: problem for name, problem in problems.items() if {chapter, name} & set(names)}
        for chapter, problems in CHAPTERS.items()
    }
    return {chapter: problems for chapter, problems in chosen.items() if problems}


class ProblemRows(NamedTuple):
    """A problem's name, the name of its table, the first paragraph of its docstring, and its rows."""

    name: str
    table: str
    about: str
    rows: Sequence[Row]


def run(chapters: Chapters, quick: bool, advance: Advance) -> dict[str, list[ProblemRows]]:
    """Compute the rows of all problems, by chapter; `advance` is called after each problem.

    A problem that raises an exception, or has no rows, gets a failed row with the reason.
    """
    done = {}
    for chapter, problems in chapters.items():
        done[chapter] = list[ProblemRows]()
        for name, problem in problems.items():
            rows: list[Row] = []
            try:
                for row in problem(quick):
                    rows.append(row)  # noqa: PERF402  # the rows before an error stay
            except Exception as error:  # any exception: the other problems are run
                rows.append(crash(f"{type(error).__name__}: {' '.join(str(error).split())}"))
            about = " ".join((problem.__doc__ or "").strip().split("\n\n")[0].split())
            done[chapter].append(ProblemRows(name, name.replace("/", "-"), about, rows or [crash("it has no rows")]))
            advance(name)
    return done


PICTURED: Final[Mapping[str, tuple[Callable[[], ContactProblem], Units | None]]] = {
    "rings": (partial(gallery.rings, 4), Units(length="m", stress="Pa")),
    "press-fit": (partial(gallery.press_fit, 2), MM),
    "cylinder-in-bore": (partial(gallery.cylinder_in_bore, 2, extent=2.0), MM),
    "loaded-pin": (partial(gallery.loaded_pin, 4), MM),
    "corner-rates": (partial(gallery.block_corner, None, 1), None),
    "sliding-corner": (partial(gallery.block_corner, 0.3, 1, 3), None),
    "cylinder-on-block": (partial(gallery.cylinder_on_block, 1.0, 2, 0), MM),
    "half-discs": (partial(gallery.half_discs, 1.0, 2, 0), MM),
    "slip-torque": (partial(gallery.press_fit_torque, 0.2, 47066.77, sectors=2), MM),
    "cylinder-in-bore-friction": (partial(gallery.cylinder_in_bore, 2, 0.4, extent=2.0), MM),
    "oblique-block": (partial(limits.oblique, 0.99), MM),
}
"""Problem of the manual → a function that makes it on few cells, and the units of its picture."""


def drawings(names: Sequence[str]) -> dict[str, str]:
    """Figure names → pictures of the bodies of these problems, as SVG."""
    chosen = {name: pictured for name, pictured in PICTURED.items() if name in names}
    return {
        f"problem-{name}": drawn(f"verification-{name}", partial(problem_figure, make(), units))
        for name, (make, units) in chosen.items()
    }


def report(
    done: Mapping[str, Sequence[ProblemRows]], figures: Mapping[str, str], quick: bool = False, only: Sequence[str] = ()
) -> Report:
    """The manual, from rows and `drawings` only; `only` are the names that were chosen."""
    every = [(chapter, each, row) for chapter, found in done.items() for each in found for row in each.rows]
    failed = [
        {**dict(zip(HEADINGS, map(escaped, cells(row)), strict=True)), "name": each.name, "table": each.table}
        for _, each, row in every if not row.passed
    ]  # fmt: skip
    lines = DataFrame(
        [(chapter, each.name, not row.passed, row.ratio) for chapter, each, row in every],
        columns=["chapter", "problems", "failed", _LARGEST],
    )
    counts = {"problems": "nunique", "rows": "size", "failed": "sum", _LARGEST: "max"}
    chapters = lines.assign(rows=1).groupby("chapter", sort=False).agg(counts).reset_index()
    tables = {each.table: DataFrame([cells(row) for row in each.rows], columns=HEADINGS)
              for each in chain(*done.values())}  # fmt: skip
    values = {
        "quick": quick, "only": only, "rows": len(every), "failed": failed, "figures": figures, "machine": machine(),
        "chapters": {chapter: [each._replace(about=escaped(each.about)) for each in found]
                     for chapter, found in done.items()},
        "versions": {name: version for name, version in versions().items() if version},
        "tolerances": {"exact": exact.TOLERANCE, "friction": exact.TOLERANCE_WITH_FRICTION, "touching": exact.TOUCHING,
                       "balance": benchmarks.BALANCE},
    }  # fmt: skip
    return render("comparisons.verification", "verification", values, {**tables, "chapters": chapters}, figures,
                  forms={_LARGEST: fixed(".2g")}, failed=bool(failed) or not every)  # fmt: skip


def cells(row: Row) -> tuple[str, ...]:
    """A row's texts, in the order of `HEADINGS`; inequalities with ≤ or ≥, small errors with <."""
    ours, tolerance, resolution = row.ours, row.tolerance, 0.0  # a hundredth of the tolerance, in the quantity's unit
    if not isinstance(ours, str) and not isinstance(row.reference, str):
        scale = abs(row.reference) if row.measure == RELATIVE else 1.0
        bound = _DIGITS_OF_BOUNDS * abs(ours) if row.measure in _SENSES else 0.0
        resolution = max(tolerance * scale / 100.0, bound)
    least = max(_ROUNDING, 1e-3 * tolerance)
    if row.measure == EQUAL:
        missed = "equal" if row.error == 0.0 else "not equal"
    elif not math.isfinite(row.error):
        missed = NOTHING
    else:
        text = "0" if row.error == 0.0 else f"< {least:.0e}" if row.error < least else f"{row.error:.1e}"
        missed = f"{text} ({row.measure})"
    return (
        row.quantity, row.element or "-", _SENSES.get(row.measure, "") + number(row.reference),
        "-" if row.kind is None else row.kind.value, row.source or "-", number(ours, resolution), missed,
        "-" if row.measure == EQUAL else f"{tolerance:.0e}", row.proof.text, "passed" if row.passed else "FAILED",
    )  # fmt: skip


def number(value: float | str, resolution: float = 0.0) -> str:
    """A number without the digits below a resolution; words as they are."""
    if isinstance(value, str):
        return value
    if not math.isfinite(value):
        return NOTHING
    if abs(value) <= resolution or value == 0.0:
        return "0"
    digits = _DIGITS
    if resolution > 0.0:
        digits = min(digits, max(2, 1 + math.floor(math.log10(abs(value))) - math.floor(math.log10(resolution))))
    return f"{value:.{digits}g}"
