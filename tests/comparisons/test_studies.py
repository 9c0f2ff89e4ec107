"""All studies alike: the committed report is that of the committed rows, and the command makes one of a store."""

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from comparisons.cli import group
from comparisons.lab.commands import Experiment
from comparisons.lab.reports import Report
from comparisons.lab.studies import read_csv, write_csv, writing
from comparisons.solvers import accuracies
from comparisons.solvers import study as solvers
from comparisons.wild import study as wild
from qvi_contact.runs import Outcome
from tests.comparisons.parts import REPORTS, command, committed, refused

EXPERIMENTS = {name: each for name, each in group.commands.items() if isinstance(each, Experiment)}


def folder_of(name):
    """The folder of a committed report."""
    return REPORTS / name.partition("-")[0]


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_committed_report_is_that_of_the_committed_rows(name, tmp_path):
    """All numbers of its sentences too; and each picture has the titles, labels and legends of the committed one."""
    folder = folder_of(name)
    for path in folder.glob(f"{name}*.csv.gz"):
        shutil.copy(path, tmp_path)
    ended = command(name, "--again", "--out", tmp_path)
    made, kept = Report.read(tmp_path / f"{name}.md"), Report.read(folder / f"{name}.md")
    assert (ended.err, made.text) == ("", kept.text)
    assert ended.status == (1 if name == "wild" else 0)  # two problems ran out of time
    assert len(made.findings) >= 1
    assert f"python -m comparisons {name}" in made.text
    assert set(made.pictures) == set(kept.pictures)
    for each, picture in made.pictures.items():
        drawn = re.findall(r"<text[^>]*>([^<]*)</text>|<!-- (.*?) -->", kept.pictures[each])
        texts = {line for text in re.findall("<text>([^<]*)</text>", picture) for line in text.split("\n")}
        plain = {html.unescape(text) for text in texts if "$" not in text}
        assert plain <= {html.unescape(text) for pair in drawn for text in pair}, each


def test_every_picture_and_table_of_rows_belongs_to_a_report():
    names = [name for name in EXPERIMENTS if folder_of(name).exists()]
    assert len(names) == len(EXPERIMENTS)
    for folder in {folder_of(name) for name in names}:
        shown = {file for path in folder.glob("*.md") for file in Report.read(path).pictures}
        assert {path.name for path in folder.glob("*.svg")} == shown


@pytest.mark.usefixtures("outlined")
def test_a_store_is_not_run_again_its_report_is_written_and_the_terminal_has_its_findings(tmp_path):
    study, store, out = wild.declared(("thin", "nonsense"), 2, 1), tmp_path / "store", tmp_path / "out"
    known = {tuple(row.case.items()): row for row in committed("wild")}
    with writing(store, study) as opened:
        for case in study.cases:
            row = known[tuple(case.items())]
            opened.append(case, Outcome(row.status, dict(row.result), row.reason, row.seconds), row.environment)
    before = store.read_bytes()
    words = ("wild", "--each", "2", "--seed", "1", "--only", "thin", "nonsense", "--store", store, "--out", out)
    ended = command(*words)
    assert (ended.status, ended.err, store.read_bytes()) == (0, "", before)
    assert [row.case for row in read_csv(out / "wild.csv.gz")] == [*study.cases]
    assert "0 are wrong" in ended.out
    assert all(path.name in ended.out for path in out.iterdir())


def test_the_committed_rows_are_those_of_the_study_as_it_is_declared():
    assert [row.case for row in committed("solvers")] == [*solvers.declared(tuple(accuracies.TABLE)).cases]
    numbers = [row.case for row in committed("wild")]
    assert numbers == [*wild.declared((), 1 + max(case["number"] for case in numbers)).cases]


@pytest.mark.usefixtures("outlined")
def test_a_part_of_the_rows_makes_a_report_too(tmp_path):
    """Of seven rows."""
    write_csv(tmp_path / "convergence-mesh.csv.gz", committed("convergence-mesh")[:7])
    ended = command("convergence-mesh", "--again", "--out", tmp_path)
    assert (ended.status, ended.err) == (0, "")


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("papr",), "papr"), (("paper", "--jsn"), "--jsn"), (("paper", "extra"), "extra"),
        (("paper", "--out"), "--out"),
        *((("benchmark", *each), each[0]) for each in (
            ("--cells", "0"), ("--cells", "9" * 23), ("--cells",), ("--friction", "0.2", "-0.1"),
            ("--friction", "nan"), ("--threads", "0"), ("--factorisation", "mumps"), ("--timeout", "0"),
        )),
        (("benchmark-wall", "--blocks", "9" * 23), "--blocks"), (("benchmark-wall", "--load", "-0.1"), "--load"),
        (("convergence-mesh", "--workers", "0"), "--workers"), (("convergence-mesh", "--cells", "4"), "--cells"),
        (("wild", "--each", "9" * 26), "--each"), (("wild", "--only", "thick"), "thin"),
        (("solvers", "--only", "qp:nobody"), "qp:quadprog"), (("wild", "--again", "--out", "none"), "wild.csv.gz"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line_and_start_nothing(words, named, tmp_path):
    assert named in refused(*words)
    assert not list(tmp_path.rglob("*.sqlite"))


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize("place", ["", "file", "file/below", "/proc/below"])
@pytest.mark.parametrize("name", ["wild", "paper", "verify"])
def test_a_folder_that_cannot_be_written_is_refused_before_any_work(name, place, tmp_path):
    Path("file").write_text("kept", encoding="utf-8")
    assert (place or "folder").strip("/").split("/")[0] in refused(name, "--out", place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert Path("file").read_text(encoding="utf-8") == "kept"


def test_module_runs():
    words = [sys.executable, "-m", "comparisons", "nothing"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
