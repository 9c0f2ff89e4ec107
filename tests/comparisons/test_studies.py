"""All studies alike: the committed report is that of the committed rows, and the command makes one of a store."""

import html
import json
import os
import re
import sqlite3
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from click.testing import CliRunner

from comparisons import benchmark, estimates, peers, wild
from comparisons import solvers as comparison
from comparisons.lab.report import command as look_at
from comparisons.lab.report import findings_of, missing
from comparisons.lab.study import StoredStudy, Study, read_csv, read_study
from comparisons.peers.pin import pin_study
from tests.comparisons.conftest import outlines
from tests.comparisons.convergence_parts import REPORTS, command, refused, report_of, rows_of, stored, study_of

SOLVERS = ("qp:osqp", "qp:quadprog", "condensed")
MISSING = ("ngsolve", "getfem")
BENCHMARK = ("benchmark", "benchmark-graded", "benchmark-loops")


def rows_in(path):
    """The committed rows of a report."""
    return read_csv(REPORTS / f"{path}.csv.gz")


def of_rows(room, path, turned=True):
    return report_of(room, rows_in(path)[:: -1 if turned else 1])


def of_solvers():
    rows = rows_in("solvers/solvers")
    return comparison.report_of(StoredStudy({"name": "solvers", "cases": len(rows)}, rows))


def of_benchmark():
    return report_of("benchmark", *(StoredStudy({}, rows_in(f"benchmark/{name}")) for name in BENCHMARK))


COMMITTED = {
    "convergence/convergence-mesh": partial(of_rows, "convergence.mesh", "convergence/convergence-mesh", turned=False),
    "convergence/convergence-outer": partial(of_rows, "convergence.outer", "convergence/convergence-outer"),
    "convergence/convergence-uzawa": partial(of_rows, "convergence.uzawa", "convergence/convergence-uzawa"),
    "peers/peers": partial(of_rows, "peers", "peers/peers"),
    "peers/peers-pin": partial(of_rows, "peers.pin", "peers/peers-pin"),
    "wild/wild": partial(of_rows, "wild", "wild/wild"),
    "estimates/estimates": partial(of_rows, "estimates", "estimates/estimates"),
    "solvers/solvers": of_solvers,
    "benchmark/benchmark": of_benchmark,
    "benchmark/benchmark-wall": lambda: benchmark.wall_report(StoredStudy({}, rows_in("benchmark/benchmark-wall"))),
}
"""Committed report → what makes it again, of most studies from the rows in any order."""


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize("path", COMMITTED)
def test_the_committed_report_is_that_of_the_committed_rows(path):
    """All numbers of its sentences too; and each picture has the titles, labels and legends of the committed one."""
    made, folder = COMMITTED[path](), (REPORTS / path).parent
    assert made.text == (REPORTS / f"{path}.md").read_text(encoding="utf-8")
    assert len(findings_of(made.text)) >= 1
    for name, picture in made.pictures.items():
        drawn = (folder / name).read_text(encoding="utf-8")
        drawn = set(re.findall(r"<text[^>]*>([^<]*)</text>", drawn)) | set(re.findall(r"<!-- (.*?) -->", drawn))
        texts = {line for text in re.findall("<text>([^<]*)</text>", picture) for line in text.split("\n")}
        plain = {html.unescape(text) for text in texts if "$" not in text}
        assert plain <= {html.unescape(text) for text in drawn}, (name, plain - drawn)


DECLARED = {
    **{f"convergence/convergence-{name}": partial(study_of, name) for name in ("mesh", "outer", "uzawa")},
    "solvers/solvers": lambda: comparison.declared(tuple(comparison.TABLE)),
    "wild/wild": lambda: wild.declared((), 250),
    "estimates/estimates": lambda: estimates.declared(estimates.EACH),
    "peers/peers-pin": lambda: pin_study((0.0, 0.1), (6, 12), ()),
}


@pytest.mark.parametrize("path", DECLARED)
def test_the_committed_rows_are_those_of_the_study_as_it_is_declared(path):
    study = DECLARED[path]()
    assert [row.key for row in rows_in(path)] == [case.key for case in study.cases]


QUICK = {
    "solvers": partial(comparison.declared, SOLVERS, quick=True),
    **{name: partial(study_of, name, quick=True) for name in ("mesh", "outer", "uzawa")},
}


@pytest.mark.parametrize("name", QUICK)
def test_quick_studies_are_others_and_smaller(name):
    full = DECLARED[next(path for path in DECLARED if path.endswith(name))]()
    assert QUICK[name]().name != full.name
    assert len(QUICK[name]().cases) < len(full.cases) / 2


def plate():
    return [
        benchmark.whole((64,), (0.1, 0.2, 0.5), None, "auto"), benchmark.graded(None, "auto"),
        benchmark.loops((64,), (0.1, 0.2, 0.5)),
    ]  # fmt: skip


COMMANDS = {
    "outer": (["convergence", "outer", "--quick"], lambda: [QUICK["outer"]()], ("outer_quick",)),
    "uzawa": (["convergence", "uzawa", "--quick"], lambda: [QUICK["uzawa"]()], ("uzawa_quick",)),
    "mesh": (["convergence", "mesh", "--quick"], lambda: [QUICK["mesh"]()], ("mesh_quick",)),
    "solvers": (["solvers", "--quick", "--only", *SOLVERS], lambda: [QUICK["solvers"]()], ()),
    "wild": (["wild", "--each", "1", "--only", "thin", "nonsense"],
             lambda: [wild.declared(("thin", "nonsense"), 1)], ()),
    "estimates": (["estimates", "--count", "3"], lambda: [estimates.declared(3)], ()),
    "peers": (["peers", "--friction", "1", "--cells", "8", "--levels", "1"],
              lambda: [peers.peers_study((1.0,), (8,), 5, 1)], ()),
    "pin": (["peers", "--problem", "pin", "--cells", "6"],
            lambda: [pin_study((0.0, 0.1), (6,), peers.missing_codes())], ()),
    "benchmark": (["benchmark", "--cells", "64", "--factorisation", "auto"], plate, ("whole", "graded", "loops")),
    "wall": (["benchmark", "--problem", "wall", "--blocks", "8", "--load", "0.02", "--element", "hct"],
             lambda: [benchmark.walls((8,), (0.02,), ("hct",))], ("wall",)),
}  # fmt: skip
"""Words, the studies that they mean, and the names of their stores in a folder, if it is one."""

KNOWN = {
    **{name: (f"convergence/convergence-{name}",) for name in ("outer", "uzawa", "mesh")},
    "solvers": ("solvers/solvers",), "wild": ("wild/wild",), "peers": ("peers/peers",),
    "estimates": ("estimates/estimates",), "pin": ("peers/peers-pin",),
    "benchmark": tuple(f"benchmark/{name}" for name in BENCHMARK), "wall": ("benchmark/benchmark-wall",),
}  # fmt: skip


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize("name", COMMANDS)
def test_a_complete_store_is_not_run_again_and_its_report_is_written(name, tmp_path, monkeypatch):
    """Rows are taken from the committed ones, of the same study or a larger one; where there is none, a case failed."""
    monkeypatch.delenv(peers.GETFEM, raising=False)
    words, studies, stores = COMMANDS[name]
    store, out = tmp_path / "store", tmp_path / "out"
    paths = [store / f"{each}.sqlite" for each in stores] or [store]
    rows = [
        stored(study, path, rows_in(known))
        for study, path, known in zip(studies(), paths, KNOWN[name], strict=True)
    ]  # fmt: skip
    before = [path.read_bytes() for path in paths]
    ended = command(*words, "--store", store, "--out", out, "--json")
    assert (ended.status, ended.err) == (0, "")
    assert [path.read_bytes() for path in paths] == before
    document = json.loads(ended.out)
    (part,) = document.get("studies", [document])
    files = sorted(map(str, out.iterdir()))
    assert sorted(part.get("files", files)) == files
    (text,) = (path.read_text(encoding="utf-8") for path in out.glob("*.md"))
    assert part["findings"] == findings_of(text)
    assert document["schema"].startswith("qvi-contact/")
    kept = sorted(out.glob("*.csv.gz"), key=lambda path: len(read_csv(path)))
    assert [read_csv(path) for path in kept] == sorted(rows, key=len)
    assert os.uname().nodename not in text + ended.out
    assert "--quick" not in words or "--quick" in text


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize("name", ["uzawa", "wild"])
def test_without_json_the_terminal_has_findings_and_the_names_of_the_files(name, tmp_path):
    words, studies, stores = COMMANDS[name]
    path = tmp_path / "store" / f"{stores[0]}.sqlite" if stores else tmp_path / "store"
    stored(*studies(), path, rows_in(*KNOWN[name]))
    ended = command(*words, "--store", tmp_path / "store", "--out", tmp_path / "out")
    told = " ".join(ended.out.split())
    assert (ended.status, ended.err) == (0, "")
    assert told.index("1. ") < told.index("Written to")
    assert all(file.name in told for file in (tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    "words", [("papr",), ("paper", "--jsn"), ("paper", "extra"), ("paper", "--out"), ("convergence", "nothing")]
)
def test_what_is_unknown_is_one_line(words):
    assert words[-1] in refused(*words)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        *((("benchmark", *each), each[0].lstrip("-")) for each in (
            ("--cells", "0"), ("--cells", "9" * 23), ("--blocks", "9" * 23), ("--repeat", "9" * 23), ("--cells",),
            ("--friction", "0.2", "-0.1"), ("--friction", "nan"), ("--threads", "0"), ("--repeat", "0"),
            ("--factorisation", "mumps"), ("--limit", "0"), ("--limit", "nan"), ("--limit", "inf"),
            ("--element", "q2", "--problem", "wall"), ("--load", "-0.1"),
        )),
        *((("peers", *each), each[0].lstrip("-")) for each in (
            ("--friction", "inf"), ("--cells", "four"), ("--repeat", "0"), ("--levels", "0"),
            ("--levels", str(peers.LEVELS + 1)), ("--getfem", "/nowhere/python3"), ("--threads", "2"),
        )),
        (("convergence", "--workers", "0"), "--workers"), (("convergence", "--cells", "4"), "--cells"),
        (("convergence", "--store", ""), "--store"), (("convergence", "--store", "/proc/below"), "/proc/below"),
        (("wild", "--each", "9" * 26), "--each"), (("scaling", "--processes", "9" * 26), "--processes"),
        (("systems", "--repeat", "9" * 26), "--repeat"), (("wild", "--only", "thick"), "thin"),
        (("solvers", "--only", "qp:nobody", "--store", "a"), "qp:quadprog"),
        (("solvers", "--only", "qp:quadprog"), "--store"), (("wild", "--each", "3"), "--store"),
        (("verify", "--only", "units", "ssnv129"), "ssnv128"), (("verify", "--only", ""), "examples/punch"),
    ],
)  # fmt: skip
def test_bad_options_are_one_line_and_start_nothing(words, named, tmp_path, monkeypatch):
    monkeypatch.setenv(peers.GETFEM, "")
    monkeypatch.chdir(tmp_path)
    assert named in refused(*words)
    assert not list(tmp_path.rglob("*.sqlite"))


@pytest.mark.parametrize(
    "name", ["paper", "benchmark", "solvers", "convergence", "peers", "wild", "estimates", "verify"]
)
@pytest.mark.parametrize("place", ["", "file", "file/below", "/proc/below"])
def test_a_folder_that_cannot_be_written_is_refused_before_any_work(name, place, tmp_path, monkeypatch):
    monkeypatch.setenv(peers.GETFEM, "")
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("kept", encoding="utf-8")
    assert (place or "folder").strip("/").split("/")[0] in refused(name, "--out", place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert Path("file").read_text(encoding="utf-8") == "kept"


def test_a_file_in_the_place_of_a_folder_of_stores(tmp_path):
    (tmp_path / "file").touch()
    for name in ("convergence", "benchmark"):
        assert "file" in refused(name, "--out", tmp_path, "--store", tmp_path / "file")


@pytest.mark.parametrize(
    ("damage", "word"),
    [("other study", "other (version 1)"), ("corrupt", "damaged"), ("schema", "99"), ("text", "not the store")],
)
def test_a_store_that_cannot_be_used_is_one_line_and_stays_as_it_is(damage, word, tmp_path):
    path, study = tmp_path / "rows.sqlite", wild.declared(("idle",), 1)
    if damage == "other study":
        rows_of(Study("other", 1, "builtins:dict", {"x": (1,)}, packages=()), path)
    elif damage == "text":
        path.write_bytes(b"text" * 2000)
    else:
        stored(study, path, rows_in("wild/wild"))
    if damage == "corrupt":
        content = path.read_bytes()
        path.write_bytes(content[:4096] + b"\0" * 8192 + content[12288:])
    elif damage == "schema":
        connection = sqlite3.connect(path)
        connection.execute("PRAGMA user_version = 99")
        connection.close()
    before = path.read_bytes()
    assert word in refused("wild", "--only", "idle", "--each", "1", "--store", path, "--out", tmp_path / "out")
    assert path.read_bytes() == before


def test_a_part_of_the_rows_makes_a_report_too(tmp_path):
    """Of seven rows, and of none."""
    study = comparison.declared(SOLVERS, quick=True)
    rows = stored(study, tmp_path / "rows.sqlite", rows_in("solvers/solvers"))
    declaration = read_study(tmp_path / "rows.sqlite").declaration
    with outlines():
        made = comparison.report_of(StoredStudy(declaration, rows[:7]))
        nothing = comparison.report_of(StoredStudy(declaration, ()))
    assert f"7 runs, so far, of {len(rows)}" in made.text
    assert len(findings_of(nothing.text)) == 4


@pytest.mark.parametrize(("words", "status"), [(("--help",), 0), (("benchmark", "--help"), 0), (("nothing",), 2)])
def test_module_runs(words, status):
    done = subprocess.run(
        [sys.executable, "-m", "comparisons", *words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == status
    assert bool(done.stdout) == (not done.stderr) == (status == 0)
    assert status == 0 or len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(bool(missing()), reason="no browser can be opened")
def test_the_command_of_the_browser_has_a_line_for_each_page_and_makes_pages_of_markdown(tmp_path):
    """Here, where no other browser is open."""

    def looked(*pages):
        return CliRunner().invoke(look_at, list(map(str, pages)), standalone_mode=False)

    good, bad = tmp_path / "good.md", tmp_path / "bad.html"
    good.write_text("# Title\n\nText.\n", encoding="utf-8")
    bad.write_text("<title>bad</title><p>text", encoding="utf-8")
    done = looked(good, bad)
    first, second = done.output.splitlines()
    assert (done.return_value, first) == (1, f"{good}: good")
    assert second.startswith(f"{bad}: ")
    assert "language" in second
    assert looked(tmp_path / "none.html").exception.field == "page"
