"""What tests of all studies share: rows made in this process or taken from the committed ones, reports, the command."""

import sys
from collections import namedtuple
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name

import pytest

from comparisons.cli import group
from comparisons.lab import versions
from comparisons.lab.study import Outcome, plain_result, read_csv, read_study, writing
from qvi_contact.basics.terminal import run

REPORTS = Path(__file__).parents[2] / "comparisons" / "reports"
Ended = namedtuple("Ended", ("status", "out", "err"))


def command(*words):
    """Status, standard output and standard error of ``python -m comparisons …`` in this process."""
    out, err = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(out), redirect_stderr(err):
        patch.setattr(sys, "argv", ["comparisons", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            run(group, "comparisons")
    return Ended(caught.value.code, out.getvalue(), err.getvalue())


def refused(*words):
    """Standard error of a command that must end with status 2, one line and nothing on standard output."""
    ended = command(*words)
    assert (ended.status, ended.out, len(ended.err.splitlines())) == (2, "", 1), ended
    assert ended.err.startswith("comparisons: ")
    return ended.err


def rows_of(study, path):
    """The rows of all cases of a study, done in this process and kept in a store at this path."""
    told = {"machine": None, "versions": versions(study.packages), "threads": 1, "timeout_seconds": None}
    task = resolve_name(study.task_name)
    with writing(path, study) as store:
        for case in study.cases:
            store.append(case, Outcome("done", plain_result(task(case.values))), {**told, "memory_mib": None})
    return read_study(path).rows


def stored(study, path, known):
    """A store at this path with a row for each case of the study: the known one of the same values, or a failure."""
    found = {_values(row.case): row for row in known}
    environment = known[0].environment
    with writing(path, study) as store:
        for case in study.cases:
            row = found.get(_values(case.values))
            if row is None:
                store.append(case, Outcome("timeout", None, "more than 1 s"), environment)
                continue
            value = dict(row.result) | ({} if row.certificate is None else {"certificate": row.certificate})
            outcome = Outcome(row.status, value, row.reason, row.seconds, row.load_average)
            store.append(case, outcome, row.environment)
    return read_study(path).rows


def _values(case):
    """What a case computes, whatever library does it and however often."""
    return str(sorted((name, value) for name, value in case.items() if name not in ("runs", "sparse")))


def report_of(room, *rows, **options):
    """The report of a room's rows, by the function that each room has for its command."""
    return import_module(f"comparisons.{room}.report").report(*rows, **options)


def study_of(name, quick=False):
    """A study of convergence, in full or quick."""
    return import_module(f"comparisons.convergence.{name}.study").study(quick)


def committed_rows(name, folder="convergence"):
    """The rows of the committed report of a study."""
    return read_csv(REPORTS / folder / f"{folder}-{name}.csv.gz")


def committed_text(name, folder="convergence"):
    """The committed report of a study."""
    return (REPORTS / folder / f"{folder}-{name}.md").read_text(encoding="utf-8")
