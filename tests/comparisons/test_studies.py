"""All studies alike: the committed report is that of the committed rows, and the command makes one of a store."""

import html
import itertools
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.benchmark import report as room
from comparisons.benchmark import study
from comparisons.cli import group
from comparisons.lab.commands import Experiment
from comparisons.lab.reports import Report
from comparisons.lab.studies import write_rows, writing, written_rows
from comparisons.solvers import accuracies
from comparisons.solvers import study as solvers
from comparisons.wild import study as wild
from qvi_contact import solve
from qvi_contact.runs import Outcome
from solvers.factorisation import available_backends
from tests.comparisons.conftest import REPORTS, command, committed, refused_command, rows_of

EXPERIMENTS = {name: each for name, each in group.commands.items() if isinstance(each, Experiment)}


def folder_of(name):
    """The folder of a committed report."""
    return REPORTS / name.partition("-")[0]


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_the_committed_report_is_that_of_the_committed_rows(name, tmp_path):
    """All numbers of its sentences too; and each picture has the titles, labels and legends of the committed one."""
    folder = folder_of(name)
    for path in folder.glob(f"{name}*.jsonl.gz"):
        shutil.copy(path, tmp_path)
    ended = command(name, "--again", "--out", tmp_path)
    made, kept = Report.read(tmp_path / f"{name}.md"), Report.read(folder / f"{name}.md")
    assert (ended.err, made.text, ended.status) == ("", kept.text, 0)
    assert re.search(r"^## Findings\n+1\. ", made.text, re.M)
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
    study, store, out = wild.declared(("thin", "idle"), 2, 1), tmp_path / "store", tmp_path / "out"
    known = {tuple(row.case.items()): row for row in committed("wild")}
    with writing(store, study) as append:
        for case in study.cases:
            row = known[tuple(case.items())]
            append(case, Outcome(row.status, dict(row.result), row.reason, row.seconds), row.environment)
    before = store.read_bytes()
    words = ("wild", "--each", "2", "--seed", "1", "--only", "thin", "idle", "--store", store, "--out", out)
    ended = command(*words)
    assert (ended.status, ended.err, store.read_bytes()) == (0, "", before)
    assert [row.case for row in written_rows(out / "wild.jsonl.gz")] == [*study.cases]
    assert "0 are wrong" in ended.out
    assert all(path.name in ended.out for path in out.iterdir())


def test_the_committed_rows_are_those_of_the_study_as_it_is_declared():
    assert [row.case for row in committed("solvers")] == [*solvers.declared(tuple(accuracies.TABLE)).cases]
    numbers = [row.case for row in committed("wild")]
    assert numbers == [*wild.declared((), 1 + max(case["number"] for case in numbers)).cases]


@pytest.mark.usefixtures("outlined")
def test_a_part_of_the_rows_makes_a_report_too(tmp_path):
    write_rows(tmp_path / "convergence-mesh.jsonl.gz", committed("convergence-mesh")[:7])
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
        *((("wild", *each), each[0]) for each in (
            ("--store", "/proc/a/b"), ("--store", ""), ("--timeout", "-1"), ("--timeout", "nan"), ("--timeout", "inf"),
            ("--memory", "0"), ("--memory", "9" * 30), ("--threads", "9" * 30), ("--workers", "10001"),
            ("--dask", "nowhere"),
        )),
        (("wild", "--each", "9" * 26), "--each"), (("wild", "--only", "thick"), "thin"),
        (("solvers", "--only", "qp:nobody"), "qp:quadprog"), (("wild", "--again", "--out", "none"), "wild.jsonl.gz"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line_and_start_nothing(words, named, tmp_path):
    assert named in refused_command(*words)
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize(("name", "package"), [("wild", "daqp"), ("bounds", "ngsolve")])
def test_a_study_without_the_package_it_needs_starts_nothing(name, package, monkeypatch):
    """It would find nothing wrong in problems that are not judged."""
    monkeypatch.setattr("comparisons.lab.commands.find_spec", lambda module: None if module == package else module)
    assert f"pip install {package}" in refused_command(name)
    assert not [path for path in Path().rglob("*") if path.is_file()]


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize("place", ["", "file", "file/below", "/proc/below"])
@pytest.mark.parametrize("name", ["wild", "paper", "verify"])
def test_a_folder_that_cannot_be_written_is_refused_before_any_work(name, place, tmp_path):
    Path("file").write_text("kept", encoding="utf-8")
    assert (place or "folder").strip("/").split("/")[0] in refused_command(name, "--out", place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert Path("file").read_text(encoding="utf-8") == "kept"


def test_module_runs():
    words = [sys.executable, "-m", "comparisons", "nothing"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)


TASK = "comparisons.benchmark.study"


@pytest.fixture(scope="module")
def studies():
    """Rows of tiny meshes and of two sequences."""
    chains = [{"sequence": name, "quick": True} for name in ("friction", "cycle")]
    parts = study.whole((2, 4), (0.2, 0.5), "auto"), replace(study.sequences(True), cases=chains)
    return [rows_of(each) for each in parts]


@pytest.fixture(scope="module")
def solves(studies):
    return room.solves_of(studies[0])


class TestRun:
    """Real cases."""

    def test_every_solve_is_certified_and_times_add_up(self, studies, solves):
        assert [*zip(solves.cells, solves.friction, strict=True)] == [*itertools.product((2, 4), (0.2, 0.5))]
        assert set(solves.status) == {"solved"}
        assert 0.0 <= solves.accuracy.min() <= solves.accuracy.max() < 1e-8
        assert solves.half_force[2] == pytest.approx(214.2372413, rel=1e-8)
        for found in (found for case in studies[0] for found in case.result["solves"]):
            times = {name: np.array(several) for name, several in found["seconds"].items()}
            parts = [times[name] for name in ("factorisation", "interior_point", "certificate")]
            assert times["whole"] == pytest.approx(times["assembly"] + times["solve"])
            assert times["solve"] == pytest.approx(sum(parts) + times["rest"])
            assert np.min([times["assembly"], *parts]) > 0.0

    def test_ratios_are_those_of_the_times_listed(self, studies, solves):
        for each in solves.itertuples():
            (case,) = (found for found in studies[0] if found.case["cells"] == each.cells)
            plain = {found["backend"]: np.median(found["seconds"]["plain"]) for found in case.result["plain"]}
            assert [*plain] == list(available_backends())
            assert each.fastest == min(plain, key=plain.get)
            assert each.ratio == pytest.approx(each.solve / min(plain.values()))

    def test_sequences_are_solved_and_agree(self, studies):
        chains = room.runs_of(studies[1])
        assert (chains.solved == chains.planned).all()
        assert not (chains.force > 1e-8).any()


def test_growth_is_the_exponent():
    sizes = [(1, "stalled"), (2, "solved"), (4, "solved")]
    lines = [{"load": load, "size": 4.0**n, "solve": 3.0 * 4.0 ** (1.25 * n), "status": status}
             for load, number in ((1, 3), (2, 2)) for n, status in sizes[:number]]  # fmt: skip
    assert room.growth_of(DataFrame(lines), "load", "size") == pytest.approx({1: 1.25})


@pytest.fixture(scope="module")
def wall():
    """The row of a small wall."""
    (found,) = rows_of(study.walls((2,), (0.3,)))
    return found


class TestWalls:
    """Walls of many blocks."""

    def test_a_wall_is_a_certified_row(self, wall):
        (found,) = room.walls_of([wall]).to_dict("records")
        assert (found["status"], found["blocks"], found["load"]) == ("solved", 2, 0.3)
        assert found["ratio"] == pytest.approx(found["solve"] / found["factorisation"])
        assert found["peak"] > 2**24
        assert "Of 1 walls 1 are solved, with a certificate" in room.wall_report([wall]).text

    def test_the_wall_carries_its_weight_and_the_load(self):
        blocks, load = 3, 0.3
        weight, forms = 24.0 * blocks**2, []
        for system in ("sparse", "dense"):
            result = solve(study.wall_of(blocks, load), method="condensed", system=system)
            assert result.contacts["bottom"].normal_force == pytest.approx(weight, rel=1e-9)
            assert abs(result.contacts["bottom"].tangential_force) == pytest.approx(load * weight, rel=1e-9)
            forms.append(result.solution.form)
        assert forms == ["full", "condensed"]
