"""Studies: a declared product of cases, run in processes with limits, one durable row for each.

    from comparisons.lab.study import Study, read_study, run_study

    study = Study("iterations", 1, "package.module:function", {"mesh": (8, 16), "friction": (0.1, 0.5)}, repeats=3)
    run_study(study, "results/iterations.sqlite", workers=4)
    rows = read_study("results/iterations.sqlite").rows

An interrupted study goes on where it stopped. Whatever happens to a case is a row: its result, or why there is none.
"""

from comparisons.lab.study.declaration import Case, Study
from comparisons.lab.study.rows import DONE, Row, StoredStudy, frame_of, largest_of, read_csv, read_study, write_csv
from comparisons.lab.study.runner import StudyRun, run_study
from qvi_contact.runs.processes import FAILURES, Outcome
from solvers.basics.front import front

__all__ = [
    "DONE",
    "FAILURES",
    "Case",
    "Outcome",
    "Row",
    "StoredStudy",
    "Study",
    "StudyRun",
    "frame_of",
    "largest_of",
    "read_csv",
    "read_study",
    "run_study",
    "write_csv",
]

__getattr__ = front(
    __name__,
    {
        "declaration": ("case_key", "differences", "plain"),
        "rows": ("finite_json", "finished_keys", "writing"),
        "runner": ("plain_result",),
    },
)
