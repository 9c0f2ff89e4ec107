"""What tests of all studies share: rows made in this process, the committed ones, and the command."""

import sys
from collections import namedtuple
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name

import pytest

from comparisons.cli import group
from comparisons.lab.studies import Row, plain, read_csv
from qvi_contact.basics import run

REPORTS = Path(__file__).parents[2] / "comparisons" / "reports"
ENVIRONMENT = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}
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


def row(case, returned, status="done", reason="", seconds=0.1, load=0.5, **environment):
    """The row of a case by what its task returned; more of its environment by keyword."""
    result = dict(returned)
    certificate = result.pop("certificate", None)
    return Row(case, status, reason, result, certificate, seconds, "", load, ENVIRONMENT | environment)


def rows_of(study):
    """The rows of all cases of a study, done in this process."""
    task = resolve_name(study.task)
    return tuple(row(case, plain(task(case), "result")) for case in study.cases)


def committed(name):
    """The committed rows of a study, by the name of its file; its folder is the first word of that."""
    return read_csv(REPORTS / name.partition("-")[0] / f"{name}.csv.gz")
