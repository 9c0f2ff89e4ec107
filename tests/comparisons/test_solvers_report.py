"""The command `solvers`: a small study through the runner in this process, its report, bad stores and folders."""

import json
import os
import sqlite3
import sys

import pytest

from comparisons.lab.report import drawing, findings_of, write_report
from comparisons.lab.study import StoredStudy, pool, read_csv, read_study
from comparisons.solvers import command, study
from comparisons.solvers.figures import figures
from comparisons.solvers.measures import runs_of, values_of
from comparisons.solvers.report import report_of
from qvi_contact.basics import terminal
from qvi_contact.plots import has_matplotlib
from tests.comparisons.study_here import Here

CHOSEN = ("qp:piqp", "qp:quadprog", "direct:osqp", "condensed")
PROBLEMS = ("plate_4", "pulled_block")
PICTURES = {"accuracies", "profiles-inner", "profiles-outer", "profiles-sequence", "truth-shares", "warmth"}


def run(*words):
    """Run the command as from the shell; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *map(str, words)])
        patch.setattr(study, "QUICK", PROBLEMS)
        patch.setattr(study, "LEVELS", {"mid": 1e-6})
        patch.setattr(pool, "Crew", Here)
        with pytest.raises(SystemExit) as caught:
            terminal.run(command.solvers, "comparisons")
    return caught.value.code


def refused(capfd, *words):
    """Standard error of a command that must end with status 2 and print nothing else."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command.RunOptions, "run", _no_run(command.RunOptions.run))
        code = run("--quick", *words)
    out, err = capfd.readouterr()
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    return err


def _no_run(original):
    """The runner's check of the store, with a task that cannot be started."""

    def checked(options, declared):
        object.__setattr__(declared, "task", "nowhere:nothing")
        return original(options, declared)

    return checked


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """The folder of a small quick study with its store and report, and the document it printed."""
    folder = tmp_path_factory.mktemp("solvers")
    words = ("--quick", "--only", *CHOSEN, "--store", folder / "rows.sqlite", "--out", folder / "report")
    assert run(*words) == 0
    return folder


@pytest.fixture(scope="module")
def stored(ran):
    return read_study(ran / "rows.sqlite")


@pytest.fixture
def files(ran):
    return {path.name: path.read_bytes() for path in (ran / "report").iterdir()}


def test_every_case_has_its_row_and_every_row_its_result(stored):
    assert len(stored.rows) == stored.declaration["cases"]
    assert {row.status for row in stored.rows} == {"done"}
    assert {row.case["solver"] for row in stored.rows} == set(CHOSEN)
    assert {row.case["task"] for row in stored.rows} == {"inner", "cold", "warm", "outer"}
    assert all(row.environment["versions"]["quadprog"] for row in stored.rows)
    assert all(row.certificate["passed"] for row in stored.rows if row.case["problem"] == "plate_4")


def test_the_report_has_its_files(files):
    assert {"solvers-quick.html", "solvers-quick.md"} <= set(files)
    if has_matplotlib():
        assert {f"solvers-quick-{name}.svg" for name in PICTURES} <= set(files)
    text = files["solvers-quick.md"].decode()
    assert "`python -m comparisons solvers --quick`" in text
    assert "eps_abs=1e-08" in text


def test_numbers_are_those_of_the_rows(ran, stored):
    runs = runs_of(stored.rows)
    found = values_of(stored.declaration, runs)
    assert (found["backends"], found["runs"], found["untrue"], found["lost"]) == (3, len(stored.rows), 0, 0)
    assert found["certified"] == int((runs.feasible & runs.certified).sum())
    assert [(method["name"], method["solved"], method["given"]) for method in found["methods"]] == [("condensed", 1, 1)]
    assert read_csv(ran / "report" / "solvers-quick.csv.gz") == stored.rows


@pytest.mark.usefixtures("outlined")
def test_the_same_rows_make_the_same_report(stored, files):
    made = report_of(stored)
    assert made.text.encode() == files["solvers-quick.md"]
    assert made.pictures == {f"solvers-quick-{name}.svg": text for name, text in figures(runs_of(stored.rows)).items()}


def test_a_complete_store_is_not_run_again_and_all_that_is_printed_is_json(ran, capfd, monkeypatch, tmp_path):
    monkeypatch.setattr(drawing, "has_matplotlib", lambda: False)
    before = (ran / "rows.sqlite").read_bytes()
    assert run("--quick", "--only", *CHOSEN, "--store", ran / "rows.sqlite", "--out", tmp_path, "--json") == 0
    document = json.loads(capfd.readouterr().out)
    assert document["schema"] == "qvi-contact/solvers/1"
    assert document["findings"]
    assert [line["solver"] for line in document["tables"]["overview"]] == list(CHOSEN)
    assert document["outcomes"]["qp:quadprog"]["right"] > 0
    assert (ran / "rows.sqlite").read_bytes() == before


def test_a_part_of_the_rows_is_said_to_be_one(stored, monkeypatch):
    monkeypatch.setattr(drawing, "has_matplotlib", lambda: False)
    part = StoredStudy(stored.declaration, stored.rows[:7])
    report = report_of(part)
    assert f"7 runs, so far, of {len(stored.rows)}" in report.text


def test_no_rows_make_a_report_too(stored, tmp_path):
    empty = report_of(StoredStudy(stored.declaration, ()))
    assert len(findings_of(empty.text)) == 4
    assert write_report(empty, tmp_path)


def test_unknown_solvers_are_refused(capfd, tmp_path):
    err = refused(capfd, "--only", "qp:nobody", "--out", tmp_path, "--store", tmp_path / "rows.sqlite")
    assert "qp:nobody" in err
    assert "qp:quadprog" in err
    assert not (tmp_path / "rows.sqlite").exists()


def test_some_solvers_alone_need_a_store_of_their_own(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "--store" in refused(capfd, "--quick", "--only", "qp:quadprog", "--out", tmp_path / "report")
    assert list(tmp_path.iterdir()) == []


def test_another_choice_of_solvers_does_not_touch_the_store(ran, capfd):
    before = (ran / "rows.sqlite").read_bytes()
    err = refused(capfd, "--only", "qp:quadprog", "--store", ran / "rows.sqlite", "--out", ran / "report")
    assert "another file" in err
    assert (ran / "rows.sqlite").read_bytes() == before


@pytest.mark.parametrize("damage", ["corrupt", "other schema", "no store"])
def test_a_store_that_cannot_be_used_is_one_line_and_stays_as_it_is(ran, capfd, tmp_path, damage):
    path = tmp_path / "rows.sqlite"
    content = (ran / "rows.sqlite").read_bytes()
    path.write_bytes(b"text" * 2000 if damage == "no store" else content)
    if damage == "other schema":
        with sqlite3.connect(path) as connection:
            connection.execute("PRAGMA user_version = 99")
        connection.close()
    elif damage == "corrupt":
        path.write_bytes(content[:4096] + b"\0" * 8192 + content[12288:])
    before = path.read_bytes()
    err = refused(capfd, "--only", *CHOSEN, "--store", path, "--out", tmp_path / "report")
    assert {"corrupt": "is damaged", "other schema": "version 99", "no store": "is not the store"}[damage] in err
    assert path.read_bytes() == before


@pytest.mark.skipif(os.name != "posix", reason="a path that is no folder anywhere")
def test_a_folder_that_cannot_be_written_is_found_out_before_anything_is_run(capfd, tmp_path):
    file = tmp_path / "file"
    file.write_text("", encoding="utf-8")
    err = refused(capfd, "--out", file / "report", "--store", tmp_path / "rows.sqlite")
    assert "cannot be written" in err
    assert not (tmp_path / "rows.sqlite").exists()


def test_the_quick_study_has_a_store_of_its_own(monkeypatch, tmp_path):
    stores = []

    def stop(options, declared):
        stores.append((options.store.name, declared.name))
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(command.RunOptions, "run", stop)
    for words in ((), ("--quick",), ("--quick", "--store", "mine.sqlite")):
        monkeypatch.setattr(sys, "argv", ["comparisons", *words])
        with pytest.raises(SystemExit) as caught:
            terminal.run(command.solvers, "comparisons")
        assert caught.value.code == 130
    assert stores == [
        ("solvers.sqlite", "solvers"),
        ("solvers-quick.sqlite", "solvers-quick"),
        ("mine.sqlite", "solvers-quick"),
    ]
