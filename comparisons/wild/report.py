"""The report of the wild problems, from the stored rows alone."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from comparisons.lab.report import Finding, Report, Section, Table, environment_grids, write_report
from comparisons.lab.report.numbers import count_of, percent, seconds
from comparisons.lab.study import StoredStudy
from comparisons.lab.tables import Grid
from comparisons.wild.enumeration import NONE, UNDECIDED
from comparisons.wild.generator import FAMILIES
from comparisons.wild.measures import LONGEST, ORDER, Entry, counts_of, entries_of, failed, slow
from comparisons.wild.study import NAME
from comparisons.wild.task import OPEN
from qvi_contact.basics.writing import write_text


def write(report: Report, entries: Sequence[Entry], folder: Path) -> list[Path]:
    """Write the report, and `wild.csv` with one line for each problem."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("family", "number", "outcome", "status", "seconds", "answer", "exists"))
    writer.writerows(
        (entry.family, entry.number, entry.outcome, entry.status, f"{entry.seconds:.2f}", entry.answer, entry.exists)
        for entry in entries
    )
    write_text(folder / f"{NAME}.csv", text.getvalue())
    return [*write_report(report, folder), folder / f"{NAME}.csv"]


def report_of(study: StoredStudy) -> Report:
    """The report; the same rows give the same one."""
    entries = entries_of(study)
    introduction = (
        f"{count_of(len(entries), 'problem')} made by the generator `comparisons/wild`, of "
        f"{count_of(len({entry.family for entry in entries}), 'family', 'families')}, by `python -m comparisons wild`, "
        "each solved by default. What is certified is judged once more, from the stresses that the result gives at "
        "points and from the problem's data alone, and beside a second method."
    )
    return Report(
        NAME, "Wild problems", introduction, _findings(entries),
        [_outcomes(entries), _without(entries)], environment_grids(study.rows), _LIMITATIONS,
    )  # fmt: skip


def _findings(entries: Sequence[Entry]) -> list[Finding]:
    counts = counts_of(entries)
    solvable = [entry for entry in entries if entry.solvable]
    missed = [entry for entry in solvable if entry.outcome == OPEN]
    unknown = [entry for entry in entries if entry.outcome == OPEN and entry.exists == UNDECIDED]
    hopeless = [entry for entry in entries if entry.outcome == OPEN and entry.exists == NONE]
    admissible = [entry for entry in entries if entry.admissible]
    stuck = [entry for entry in admissible if entry.outcome == OPEN]
    bad, late = failed(entries), slow(entries)
    return [
        Finding(
            f"{count_of(counts['wrong'], 'answer')} called solved {'is' if counts['wrong'] == 1 else 'are'} wrong, "
            f"{count_of(counts['foreign'], 'exception')} not the package's own, nonsense accepted "
            f"{count_of(counts['accepted'], 'time')}, {count_of(counts['broken'], 'case')} ended without a result.",
            "troubles" if bad or late else "outcomes",
        ),
        Finding(
            f"Of {count_of(len(solvable), 'problem')} known to have a solution {len(missed)} "
            f"({percent(len(missed) / len(solvable) if solvable else 0.0, 1)}) end without an answer.",
            "open",
        ),
        Finding(
            f"Of {count_of(len(admissible), 'problem')} with a solution or at least an admissible traction "
            f"{len(stuck)} ({percent(len(stuck) / len(admissible) if admissible else 0.0, 1)}) end without an answer.",
            "open",
        ),
        Finding(
            f"{count_of(len(hopeless), 'other')} without an answer have none, as all their states of contact were gone "
            f"through; of {len(unknown)} it is not known.",
            "open",
        ),
        Finding(
            f"{count_of(len(late), 'problem')} took longer than {LONGEST:g} s.", "troubles" if late else "outcomes"
        ),
    ]


def _outcomes(entries: Sequence[Entry]) -> Section:
    rows = []
    for family in FAMILIES:
        chosen = [entry for entry in entries if entry.family == family]
        if chosen:
            counts = counts_of(chosen)
            slowest = seconds(max(entry.seconds for entry in chosen), 2)
            rows.append((family, str(len(chosen)), *(str(counts[name]) for name in ORDER), slowest))
    headings = ("family", "problems", *ORDER, "slowest")
    about = "; ".join(f"*{name}*: {text}" for name, text in FAMILIES.items())
    reading = (
        "*solved*: certified, and found right; *infeasible*: proved to have no solution, on any mesh or on this one; "
        "*open*: another status; *refused*: an InputError that names the argument; *accepted*: nonsense taken for an "
        "argument."
    )
    table = Table("outcomes", Grid("What became of the problems", headings, rows), reading,
                  "*accepted*, *wrong*, *foreign* (an exception not the package's own) and *broken*.")  # fmt: skip
    return Section("Outcomes", [f"The families, and what is wild about each: {about}."], [table])


def _without(entries: Sequence[Entry]) -> Section:
    headings = ("problem", "status", "time", "known of it")
    rows = [_line(entry) for entry in entries if entry.outcome == OPEN]
    late = [entry for entry in slow(entries) if entry not in failed(entries)]
    bad = [(*_line(entry)[:2], entry.outcome, *_line(entry)[2:]) for entry in (*failed(entries), *late)]
    return Section(
        "Without an answer, and what must not happen",
        ["A problem is made again by `comparisons.wild.generator.wild_problem(family, number)`."],
        [
            Table("open", Grid("Problems without an answer", headings, rows), "Each with the reason as far as known.",
                  "An answer that another method finds, or a solution that no method finds."),
            Table("troubles", Grid("What must not happen", ("problem", "status", "outcome", "time", "why"), bad),
                  f"Wrong answers, foreign exceptions, nonsense accepted, broken cases, and more than {LONGEST:g} s.",
                  "Every line."),
        ],
    )  # fmt: skip


def _line(entry: Entry) -> tuple[str, ...]:
    return f"{entry.family} {entry.number}", entry.status, seconds(entry.seconds, 2), entry.reason


_LIMITATIONS = [
    "Times are wall times of building and solving, on whatever else the machine had to do.",
    "A solution that exists is known from another method's certificate or from an enumeration within bounds and "
    "tolerances of a mixed-integer solver, for contacts of up to 40 points; that none is found there is no proof.",
    "The second method shares the discretisation, though not the iteration.",
]
