"""The benchmark command: what it measures, how its ratios come about, what it refuses.

One tiny run is shared by the tests of a process; everything else is computed from made-up rows.
"""

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from comparisons.benchmark import measures, reference, study, task
from comparisons.benchmark import report as report_module
from comparisons.benchmark.report import document_of, frames_of, report
from comparisons.cli import group
from comparisons.lab.machine import machine
from comparisons.lab.ratios import growth, spread
from comparisons.lab.report import write_report
from comparisons.lab.study import Outcome, Row, StoredStudy, children, options, pool, read_csv
from comparisons.lab.worker import child
from qvi_contact.basics import terminal
from qvi_contact.plots import has_matplotlib
from solvers import SolverUnavailableError

OUTCOMES = pool.outcomes
NAME = "naive loop, qpsolvers"
FIRST = "--cells 8 4 --friction 0.2 0.5 --repeat 1 --threads 1 --json"
ENVIRONMENT = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}


def mostly_here(terms, cases, workers):
    """Outcomes of the cases: the first whole solve in a process of its own, all others in this one."""
    alone = 1 if terms.task.endswith(":whole") else 0
    yield from OUTCOMES(terms, cases[:alone], workers)
    for case in cases[alone:]:
        found = child._outcome(child._loaded(terms.task), case.values)
        yield case, Outcome(**found, environment=terms.environment({"machine": machine()}))


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Standard output, standard error and the files of a run on tiny meshes, with one graded mesh and one loop."""
    folder = tmp_path_factory.mktemp("benchmark")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pool, "outcomes", mostly_here)
        for module in (child, task):
            patch.setattr(module, "gc", SimpleNamespace(collect=lambda: 0))  # it looks through all tests
        patch.setattr(study, "MESHES", ((4, 0.7),))
        patch.setattr(study, "METHODS", {NAME: study.METHODS[NAME]._replace(largest=4)})
        words = ["benchmark", *FIRST.split(), "--out", str(folder / "out"), "--store", str(folder / "store")]
        done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout, done.stderr, {path.name: path for path in (folder / "out").iterdir()}


@pytest.fixture(scope="module")
def document(ran):
    return json.loads(ran[0])


def stored(files):
    """The studies whose rows these files have."""
    return [StoredStudy({}, read_csv(file)) for file in files]


def refused(capfd, *arguments):
    """Standard error of a command that must end with status 2, print nothing else and measure nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", "benchmark", *map(str, arguments)])
        patch.setattr(options.RunOptions, "run", lambda *_: pytest.fail("the run was started"))
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    assert (caught.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    return err


def made_up(declared, power=1.2, solve=3.0, status="solved"):
    """Rows whose times are those of a power of the unknowns; plain factorisations take a third."""
    return StoredStudy({}, tuple(_row(case, power, solve, status) for case in declared.cases))


def _row(case, power, solve, status):
    unknowns = 4 * case.values["cells"] ** 2
    times = [factor * solve * unknowns**power for factor in (0.5, 1.0, 1.1)]
    known = {"status": status, "message": "", "unknowns": unknowns, "iterations": 9, "half_force": 214.0}
    solves = [
        {"friction": mu, **known, "library": "pardiso, mkl", "seconds": dict.fromkeys(measures.PARTS, times)}
        for mu in case.values["friction"]
    ]
    plain = [
        {"backend": backend, "status": "done", "message": "", "unknowns": unknowns,
         "seconds": {"plain": [factor * solve * unknowns**power / 3.0]}}
        for backend, factor in (("pardiso", 1.0), ("superlu", 4.0))
    ]  # fmt: skip
    result = {"solves": solves, "plain": plain, "peak": 2**27, "imports": 2**26}
    return Row(case.position, case.key, case.values, "done", "", result, None, 1.0, "", 0.0, ENVIRONMENT)


def whole(cells, factorisation="superlu"):
    return study.whole(cells, (0.2,), None, factorisation)


NOTHING = StoredStudy({}, ())


class TestRun:
    """One real run."""

    def test_nothing_but_json_on_standard_output(self, ran, document):
        assert ran[1] == ""
        assert document["schema"] == "qvi-contact/benchmark/2"
        assert document["study"]["cases"] == 4
        assert len(document["findings"]) >= 3

    def test_machine_has_no_names(self, ran):
        text = ran[2]["benchmark.md"].read_text(encoding="utf-8")
        assert os.uname().nodename not in text
        assert "/home/" not in text

    def test_every_solve_is_a_certified_row(self, document):
        found = [(row["cells"], row["path"], row["friction"]) for row in document["solves"]]
        assert found == [(n, path, mu) for n in (4, 8) for path in ("general", "shared") for mu in (0.2, 0.5)]
        assert {row["status"] for row in document["solves"]} == {"solved"}
        assert all(0.0 <= row["accuracy"] < 1e-8 for row in document["solves"])
        assert {row["library"].split(",")[0] for row in document["solves"] if row["path"] == "shared"} == {
            "shared-subdomains"
        }

    def test_paths_agree(self, document):
        forces = {(row["cells"], row["path"], row["friction"]): row["half_force"] for row in document["solves"]}
        for (cells, path, mu), force in forces.items():
            assert force == pytest.approx(forces[cells, "general", mu], rel=1e-9), path
        assert forces[8, "general", 0.2] == pytest.approx(213.81671332, rel=1e-9)

    def test_times_add_up(self, document):
        for row in document["solves"]:
            assert row["whole"] == pytest.approx(row["assembly"] + row["solve"])
            parts = row["factorisation"] + row["interior_point"] + row["certificate"] + row["rest"]
            assert row["solve"] == pytest.approx(parts)
            assert min(row[name] for name in ("assembly", "factorisation", "interior_point", "certificate")) > 0.0

    def test_ratios_are_those_of_the_times_listed(self, document):
        for row in document["solves"]:
            plain = {p["backend"]: p["plain"] for p in document["plain"]
                     if (p["cells"], p["path"]) == (row["cells"], row["path"])}  # fmt: skip
            assert row["fastest"] == min(plain, key=plain.get)
            assert row["ratio_fastest"] == pytest.approx(row["solve"] / min(plain.values()))
            own = row["factorisation"] if row["path"] == "shared" else plain[row["library"].split(",")[0]]
            assert row["ratio_own"] == pytest.approx(row["solve"] / own)

    def test_every_installed_library_factorises_the_same_matrix(self, document):
        beside = [row for row in document["plain"] if (row["cells"], row["path"]) == (8, "general")]
        assert [row["backend"] for row in beside] == list(task.available_backends())
        assert all(row["analysis"] + row["numeric"] <= row["plain"] for row in beside)
        (shared,) = (row for row in document["plain"] if (row["cells"], row["path"]) == (8, "shared"))
        assert shared["backend"] == study.sparse("auto")

    def test_memory_is_that_of_a_fresh_process(self, document):
        assert [(row["cells"], row["path"]) for row in document["memory"]] == [
            (n, path) for n in (4, 8) for path in ("general", "shared")
        ]
        alone = document["memory"][0]  # the others have that of the tests
        assert 2**24 < alone["imports"] <= alone["peak"] < 2**30

    def test_loops_agree_with_the_condensed_method(self, document):
        (loop,) = document["loops"]
        assert (loop["cells"], loop["status"]) == (4, "solved")
        assert loop["half_force_difference"] < 1e-7
        (condensed,) = (row for row in document["solves"]
                        if (row["cells"], row["path"], row["friction"]) == (4, "general", 0.2))  # fmt: skip
        assert loop["ratio"] == pytest.approx(loop["solve"] / condensed["solve"])

    def test_graded_meshes_say_what_they_meet(self, document):
        assert [(row["cells"], row["grading"], row["friction"]) for row in document["graded"]] == [
            (4, 0.7, 0.2), (4, 0.7, 1.0)
        ]  # fmt: skip
        for row in document["graded"]:
            assert row["error"] == pytest.approx(abs(row["half_force"] / reference.SETTLED[row["friction"]] - 1.0))
            assert (row["met"] == []) == (row["error"] > 1e-4 or row["whole"] > 0.02)

    @pytest.mark.usefixtures("outlined")
    def test_files(self, ran):
        pictures = {"benchmark-times.svg"} if has_matplotlib() else set()
        tables = {f"benchmark{name}.csv.gz" for name in ("", "-graded", "-loops")}
        assert set(ran[2]) == {"benchmark.html", "benchmark.md"} | pictures | tables
        text = ran[2]["benchmark.md"].read_text(encoding="utf-8")
        assert "`python -m comparisons benchmark --cells 4 8 --friction 0.2 0.5 --threads 1 --limit 120`" in text
        files = (ran[2][f"benchmark{name}.csv.gz"] for name in ("", "-graded", "-loops"))
        assert report(*stored(files)).text == text


class TestCommitted:
    """The run in `comparisons/reports`."""

    FOLDER = Path(__file__).parents[2] / "comparisons" / "reports" / "benchmark"

    @pytest.fixture
    def committed(self):
        return stored(self.FOLDER / f"benchmark{name}.csv.gz" for name in ("", "-graded", "-loops"))

    def test_numbers_of_the_findings(self, committed):
        frames = frames_of(*committed)
        values, solves = measures.values_of(frames), frames["solves"]
        largest = solves[solves.cells == 512]
        for told, path in zip(values["largest"], ("general", "shared"), strict=True):
            ratios = largest[largest.path == path].ratio_fastest
            assert told["ratios"] == f"{min(ratios):.2f} to {max(ratios):.2f}"
        assert [each["ratios"] for each in values["largest"]] == ["1.29 to 1.63", "0.42 to 0.67"]
        ratios = {each["name"]: each["ratio"] for each in values["loops"]}
        assert ratios == pytest.approx({
            "naive loop, qpsolvers": 156.65, "naive loop, cvxpy": 229.787, "naive loop, cvxpy, cones": math.nan,
            "loop of condensed QPs": 81.95, "Uzawa": math.nan,
        }, rel=1e-4, nan_ok=True)  # fmt: skip
        assert [(each["powers"], each["met"]) for each in values["growth"]] == [
            ("1.19 to 1.27", False), ("0.99 to 1.15", True)
        ]  # fmt: skip
        assert [(each["friction"], each["met"]) for each in values["targets"]] == [
            (0.2, ["1e-5 in 60 ms"]), (1.0, ["1e-5 in 60 ms", "3e-6 in 200 ms"])
        ]  # fmt: skip
        assert (values["solved"], values["problems"]) == (34, 34)

    def test_the_committed_report_is_that_of_the_committed_rows(self, committed, monkeypatch):
        monkeypatch.setattr(report_module, "drawn", lambda *_: "drawn")
        assert report(*committed).text == (self.FOLDER / "benchmark.md").read_text(encoding="utf-8")


class TestNumbers:
    """Medians, ratios, exponents."""

    def test_growth_is_the_exponent(self):
        assert growth((100, 1600), (3.0 * 100**1.25, 3.0 * 1600**1.25)) == pytest.approx(1.25)
        assert growth((100, 400), (None, 1.0)) is growth((100, 400), (1.0, math.nan)) is None
        assert growth((100, 100), (1.0, 2.0)) is None

    def test_prediction(self):
        assert task.predicted(2.0, 100, 400) == pytest.approx(16.0)

    def test_spread(self):
        assert spread([1.0, 2.0, 4.0]) == pytest.approx(1.5)
        assert spread([1.0]) is None
        assert spread([0.0, 0.0]) is None

    def test_rows_have_medians_and_ratios_of_medians(self):
        solves = measures.solves_of(made_up(whole((128, 256, 512))).rows)
        for row in solves.itertuples():
            assert row.solve == pytest.approx(3.0 * row.unknowns**1.2)
            assert row.spread == pytest.approx(0.6)
            assert row.ratio_own == pytest.approx(3.0 / 4.0)
            assert (row.fastest, row.ratio_fastest) == ("pardiso", pytest.approx(3.0))
            assert row.half_force_error == pytest.approx(abs(214.0 / reference.CONVERGED[row.cells] - 1.0))

    def test_growth_rows_are_neighbours_and_the_targets_span(self):
        frames = frames_of(made_up(whole((64, 128, 256, 512), "auto"), power=1.3), NOTHING)
        found = frames["growth"][frames["growth"].path == "general"]
        assert list(zip(found["from"], found["to"], strict=True)) == [(64, 128), (128, 256), (256, 512), (128, 512)]
        assert found.solve.tolist() == pytest.approx([1.3] * 4)
        told = measures.values_of(frames)["growth"]
        assert [(each["powers"], each["met"]) for each in told] == 2 * [("1.30", False)]

    def test_a_failed_solve_is_a_row_without_a_ratio(self):
        frames = frames_of(made_up(whole((8,)), status="stalled"), NOTHING)
        assert frames["solves"].status.tolist() == ["stalled"]
        assert frames["solves"][["ratio_own", "ratio_fastest"]].isna().all(axis=None)
        assert measures.values_of(frames)["solved"] == 0

    @pytest.mark.usefixtures("outlined")
    def test_a_case_that_died_is_a_row_with_the_reason(self, tmp_path):
        found = made_up(whole((8,), "auto"))
        rows = (replace(found.rows[0], status="memory", reason="out of memory", result={}), found.rows[1])
        lost = StoredStudy({}, rows)
        solves = document_of(lost, NOTHING)["solves"]
        assert [(row["status"], row["message"]) for row in solves] == [("memory", "out of memory"), ("solved", "")]
        made = report(lost, NOTHING)
        assert "out of memory" not in made.text.split("## Whole solve")[0]
        write_report(made, tmp_path)
        assert (tmp_path / "benchmark.md").exists()

    def test_large_plain_factorisations_of_other_libraries_are_left_out(self, monkeypatch):
        """From 9 s on 128² cells, 576 s are expected of each on 512²; the one that the solve takes is measured."""
        asked = []
        monkeypatch.setattr(task, "_matrix", lambda cells: asked.append(cells) or "K")
        monkeypatch.setattr(task, "_factorised", lambda *_: {"status": "done", "seconds": {"plain": 9.0}})
        told = {}
        assert task._beside("general", "superlu", 512, 3, told) == {"superlu": 3}
        assert set(told) == set(task.available_backends()) - {"superlu"}
        assert all("about 576 s" in record["message"] for (record,) in told.values())
        assert task._beside("shared", "superlu", 512, 3, told) == {"superlu": 3}
        assert task._beside("general", "superlu", 128, 3, {}) == dict.fromkeys(task.available_backends(), 3)
        assert asked == [128]


class TestStudies:
    """Settings."""

    def test_repetitions_by_size(self):
        assert [task.repetitions(cells, None) for cells in (64, 128, 256, 512, 1024)] == [5, 5, 3, 3, 2]
        assert task.repetitions(512, 7) == 7

    def test_one_factorisation_is_one_path(self):
        paths = {name: whole((4,), name).factors["path"] for name in ("auto", "superlu", "shared-subdomains")}
        assert paths == {"auto": ("general", "shared"), "superlu": ("general",), "shared-subdomains": ("shared",)}
        assert whole((4,)).factors["sparse"] == ("superlu",)

    def test_loops_are_tried_on_meshes_that_are_not_too_large_for_them(self):
        cases = {(case.values["loop"], case.values["cells"]) for case in study.loops((64, 128, 256), (0.1, 0.2)).cases}
        assert cases == {(name, n) for name, each in study.METHODS.items() for n in (64, 128) if n <= each.largest}
        assert study.loops((256,), (0.2,)) is None
        assert {case.values["friction"] for case in study.loops((4,), (0.1, 0.5)).cases} == {0.1}

    def test_every_case_has_a_process_of_its_own(self):
        studies = (whole((4,)), study.graded(1, "auto"), study.loops((4,), (0.2,)), study.walls((2,), (), ("bfs",)))
        assert all(each.fresh for each in studies)

    def test_what_is_not_installed_is_refused(self, monkeypatch):
        def missing(_):
            raise SolverUnavailableError("backend", "cholmod", "not here")

        monkeypatch.setattr(study, "resolve", missing)
        with pytest.raises(SolverUnavailableError):
            whole((8,), "cholmod")


class TestTasks:
    """What is measured in a case."""

    def test_threads_are_limited_before_anything_is_loaded(self, monkeypatch):
        monkeypatch.setenv("OMP_NUM_THREADS", "7")
        environment = children.environment(3)
        assert {environment[name] for name in children.LIMITING} == {"3"}

    def test_an_error_is_a_record(self):
        def fail():
            raise SolverUnavailableError("factorisation", "nothing", "choose another")

        record = task._attempt(fail)
        assert (record["status"], record["seconds"]) == ("error", {})
        assert "choose another" in record["message"]
        told = task._together([{"status": "solved", "seconds": {"whole": 1.0}}, record])
        assert (told["status"], told["seconds"]) == ("error", {"whole": [1.0]})

    def test_the_loop_in_cvxpy_finds_the_same(self):
        found = task.loop({"cells": 4, "friction": 0.2, "loop": "naive loop, cvxpy"})
        assert (found["status"], found["unknowns"]) == ("solved", 64)
        assert found["half_force"] == pytest.approx(213.47271271, rel=1e-8)
        assert len(found["seconds"]) == 3
        assert min(found["seconds"]) > 0.0


class TestCommandLine:
    """Bad input."""

    @pytest.mark.parametrize(
        ("arguments", "word"),
        [(("--cells", "0"), "cells"), (("--cells", "9" * 23), "cells"), (("--blocks", "9" * 23), "blocks"),
         (("--repeat", "9" * 23), "repeat"), (("--cells", "4", "x"), "x"), (("--cells",), "--cells"),
         (("--friction", "0.2", "-0.1"), "friction"), (("--friction", "nan"), "friction"),
         (("--threads", "0"), "threads"), (("--repeat", "0"), "repeat"), (("--factorisation", "mumps"), "mumps"),
         (("--jsn",), "jsn"), (("--out", ""), "folder"),
         (("--limit", "0"), "limit"), (("--limit", "nan"), "limit"), (("--limit", "inf"), "limit"),
         (("--problem", "wall", "--element", "q2"), "q2")],
    )  # fmt: skip
    def test_bad_options_are_one_line(self, capfd, tmp_path, monkeypatch, arguments, word):
        monkeypatch.chdir(tmp_path)
        assert word in refused(capfd, *arguments)

    def test_a_folder_that_cannot_be_written_is_refused_before_any_work(self, capfd, tmp_path):
        (tmp_path / "file").write_text("kept", encoding="utf-8")
        assert "file" in refused(capfd, "--out", tmp_path / "file" / "below")
        assert "file" in refused(capfd, "--out", tmp_path / "out", "--store", tmp_path / "file")

    def test_help(self):
        done = subprocess.run([sys.executable, "-m", "comparisons", "benchmark", "--help"], capture_output=True,
                              text=True, timeout=60, check=False)  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        assert "--no-naive" in done.stdout
