"""Helpers of the tests of all studies: pictures as outlines, made and committed rows, the command."""

import html
import io
import sys
from collections import namedtuple
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest

from comparisons.cli import group
from comparisons.lab.studies import Row, plain, written_rows
from qvi_contact.basics import run

_DECIMALS = 9  # of data in outlines, which rounding changes from call to call


def texts_of(figure):
    """Titles, labels, notes and legends of a figure."""
    texts = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        texts += [axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), *(text.get_text() for text in axes.texts)]
    legends = [*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))]
    return [text for text in [*texts, *(text.get_text() for each in legends for text in each.get_texts())] if text]


def outline(figure, file, **_):
    """Replace `savefig`: write the texts of a figure and the data of its lines and marks, not the picture."""
    data = []
    for axes in figure.axes:
        data += [line.get_xydata() for line in axes.lines] + [each.get_offsets() for each in axes.collections]
    elements = "".join(f"<text>{html.escape(text)}</text>" for text in texts_of(figure))
    numbers = [np.round(points, _DECIMALS).tolist() for points in data]
    picture = f"<svg>{elements}<desc>{numbers}</desc></svg>\n"
    if hasattr(file, "write"):
        file.write(picture if isinstance(file, io.TextIOBase) else picture.encode())
    else:
        Path(file).write_text(picture, encoding="utf-8")


@contextmanager
def outlines():
    """Write pictures as outlines; people judge the drawn pictures in the reports."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", outline)
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)
        yield


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


def refused_command(*words):
    """Standard error, one line, of a command that must end with status 2 and without standard output."""
    ended = command(*words)
    assert (ended.status, ended.out, len(ended.err.splitlines())) == (2, "", 1), ended
    assert ended.err.startswith("comparisons: ")
    return ended.err


def row(case, returned, status="done", reason="", seconds=0.1, load=0.5, **environment):
    """The row of a case, from the mapping that its task returned; keywords are entries of the environment."""
    result = dict(returned)
    certificate = result.pop("certificate", None)
    return Row(case, status, reason, result, certificate, seconds, "", load, ENVIRONMENT | environment)


def rows_of(study):
    """The rows of all cases of a study, run in this process."""
    task = resolve_name(study.task)
    return tuple(row(case, plain(task(case), "result")) for case in study.cases)


def committed(name):
    """The committed rows of a study, by the name of their file, whose first word is the folder."""
    return written_rows(REPORTS / name.partition("-")[0] / f"{name}.jsonl.gz")
