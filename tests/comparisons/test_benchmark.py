"""The benchmark command: what it measures, how its ratios come about, what it refuses.

One tiny run is shared by the tests of a process; everything else is computed from made-up records.
"""

import dataclasses
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from comparisons.benchmark import measure, plan, process, ratios, reference, rows, study
from comparisons.benchmark import report as report_module
from comparisons.benchmark.measures import values_of
from comparisons.benchmark.report import report
from comparisons.cli import group
from comparisons.lab.report import write_report
from comparisons.lab.study import children
from qvi_contact import InputError
from qvi_contact.basics import terminal
from qvi_contact.plots import has_matplotlib
from solvers import SolverUnavailableError

ONE_LOOP = (plan.LOOPS[0]._replace(largest=4),)
FIRST = "--cells 8 4 --friction 0.2 0.5 --repeat 1 --threads 1 --json"


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Standard output, standard error and the files of a run on tiny meshes, with one graded mesh and one loop."""
    folder = tmp_path_factory.mktemp("benchmark")
    with pytest.MonkeyPatch.context() as patch:
        for module in (plan, study, rows):
            patch.setattr(module, "GRADED", ((4, 0.7),))
            patch.setattr(module, "LOOPS", ONE_LOOP)
        done = CliRunner().invoke(group, ["benchmark", *FIRST.split(), "--out", str(folder)], catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout, done.stderr, {path.name: path for path in folder.iterdir()}


@pytest.fixture(scope="module")
def document(ran):
    return json.loads(ran[0])


def refused(capfd, *arguments):
    """Standard error of a command that must end with status 2, print nothing else and measure nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", "benchmark", *map(str, arguments)])
        patch.setattr(study, "run", lambda *_: pytest.fail("the run was started"))
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    assert (caught.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    return err


def made_up(settings, power=1.2, solve=3.0, status="solved"):
    """A study whose times at one friction are those of a power of the unknowns; plain factorisations take a third."""
    found = study.Study(settings, {**dict.fromkeys(("processor", "system", "python"), ""), "cores": 1,
                                   "memory_bytes": None, "load_average": None}, {}, "")  # fmt: skip
    for cells in settings.cells:
        unknowns = 4 * cells**2
        for path in settings.paths:
            for mu in settings.friction:
                for factor in (0.5, 1.0, 1.1):
                    seconds = dict.fromkeys(rows.PARTS, factor * solve * unknowns**power)
                    found.solves.append({
                        "cells": cells, "path": path.name, "friction": mu, "status": status, "message": "",
                        "unknowns": unknowns, "iterations": 9, "half_force": 214.0, "seconds": seconds,
                    })  # fmt: skip
            for backend, factor in (("pardiso", 1.0), ("superlu", 4.0)):
                seconds = {"plain": factor * solve * unknowns**power / 3.0}
                found.plain.append({"cells": cells, "path": path.name, "backend": backend, "status": "done",
                                    "message": "", "unknowns": unknowns, "seconds": seconds})  # fmt: skip
    return found


class TestRun:
    """One real run."""

    def test_nothing_but_json_on_standard_output(self, ran, document):
        assert ran[1] == ""
        assert document["schema"] == "qvi-contact/benchmark/1"
        assert document["command"].startswith("python -m comparisons benchmark --cells 4 8 --friction 0.2 0.5")
        assert document["machine"]["cores"] >= 1
        assert "numpy" in document["versions"]

    def test_machine_has_no_names(self, ran, document):
        assert os.uname().nodename not in ran[0]
        assert os.getcwd() not in ran[0]
        assert str(document["machine"]).count("/home/") == 0

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
        assert [row["backend"] for row in beside] == list(study.available_backends())
        assert {row["unknowns"] for row in beside} == {256}
        (shared,) = (row for row in document["plain"] if (row["cells"], row["path"]) == (8, "shared"))
        assert shared["backend"] == min(beside, key=lambda row: row["plain"])["backend"]

    def test_memory_is_that_of_a_fresh_process(self, document):
        assert len(document["memory"]) == 4
        assert all(2**24 < row["imports"] <= row["peak"] < 2**30 for row in document["memory"])

    def test_loops_agree_with_the_condensed_method(self, document):
        small, large = document["loops"]
        assert (small["cells"], small["status"]) == (4, "solved")
        assert small["half_force_difference"] < 1e-7
        (condensed,) = (row for row in document["solves"]
                        if (row["cells"], row["path"], row["friction"]) == (4, "general", 0.2))  # fmt: skip
        assert small["ratio"] == pytest.approx(small["solve"] / condensed["solve"])
        assert (large["cells"], large["status"], large["ratio"]) == (8, "not run", None)
        assert "4² cells" in large["message"]

    def test_graded_meshes_say_what_they_meet(self, document):
        assert [(row["cells"], row["grading"], row["friction"]) for row in document["graded"]] == [
            (4, 0.7, 0.2), (4, 0.7, 1.0)
        ]  # fmt: skip
        for row in document["graded"]:
            assert row["error"] == pytest.approx(abs(row["half_force"] / reference.SETTLED[row["friction"]] - 1.0))
            assert (row["meets"] == []) == (row["error"] > 1e-4 or row["whole"] > 0.02)

    def test_files(self, ran, document):
        pictures = {"benchmark-times.svg"} if has_matplotlib() else set()
        assert set(ran[2]) == {"benchmark.html", "benchmark.json", "benchmark.md"} | pictures
        assert json.loads(ran[2]["benchmark.json"].read_text(encoding="utf-8")) == document
        text = ran[2]["benchmark.md"].read_text(encoding="utf-8")
        assert document["command"] in text
        assert report(document).text == text


class TestCommitted:
    """The run in `comparisons/reports`."""

    FOLDER = Path(__file__).parents[2] / "comparisons" / "reports" / "benchmark"

    @pytest.fixture
    def committed(self):
        return json.loads((self.FOLDER / "benchmark.json").read_text(encoding="utf-8"))

    def test_numbers_of_the_findings(self, committed):
        values = values_of(committed)
        largest = [row for row in committed["solves"] if row["cells"] == 512]
        for told, path in zip(values["largest"], ("general", "shared"), strict=True):
            ratios = [row["ratio_fastest"] for row in largest if row["path"] == path]
            assert told["ratios"] == f"{min(ratios):.2f} to {max(ratios):.2f}"
        assert [each["ratios"] for each in values["largest"]] == ["1.29 to 1.63", "0.42 to 0.67"]
        assert {each["name"]: each["ratio"] and round(each["ratio"]) for each in values["loops"]} == {
            "naive loop, qpsolvers": 157, "naive loop, cvxpy": 230, "naive loop, cvxpy, cones": None,
            "loop of condensed QPs": 82, "Uzawa": None,
        }  # fmt: skip
        assert [(each["powers"], each["met"]) for each in values["growth"]] == [
            ("1.19 to 1.27", False), ("0.99 to 1.15", True)
        ]  # fmt: skip
        assert [(each["friction"], each["met"]) for each in values["targets"]] == [
            (0.2, ["1e-5 in 60 ms"]), (1.0, ["1e-5 in 60 ms", "3e-6 in 200 ms"])
        ]  # fmt: skip
        assert (values["solved"], values["problems"]) == (34, 34)

    def test_the_committed_report_is_that_of_the_committed_document(self, committed, monkeypatch):
        monkeypatch.setattr(report_module, "drawn", lambda *_: "drawn")
        assert report(committed).text == (self.FOLDER / "benchmark.md").read_text(encoding="utf-8")


class TestNumbers:
    """Medians, ratios, exponents."""

    def test_growth_is_the_exponent(self):
        assert ratios.growth((100, 3.0 * 100**1.25), (1600, 3.0 * 1600**1.25)) == pytest.approx(1.25)
        assert ratios.growth((100, None), (400, 1.0)) is None
        assert ratios.growth((100, 1.0), (100, 2.0)) is None

    def test_prediction(self):
        assert ratios.predicted((100, 2.0), 400) == pytest.approx(16.0)

    def test_spread(self):
        assert ratios.spread([1.0, 2.0, 4.0]) == pytest.approx(1.5)
        assert ratios.spread([1.0]) is None

    def test_rows_have_medians_and_ratios_of_medians(self):
        document = rows.document(made_up(plan.Plan(cells=(128, 256, 512), friction=(0.2,), factorisation="superlu")))
        for row in document["solves"]:
            assert row["solve"] == pytest.approx(3.0 * row["unknowns"] ** 1.2)
            assert row["solve_spread"] == pytest.approx(0.6)
            assert row["ratio_own"] == pytest.approx(3.0 / 4.0)
            assert (row["fastest"], row["ratio_fastest"]) == ("pardiso", pytest.approx(3.0))
            assert row["half_force_error"] == pytest.approx(abs(214.0 / reference.CONVERGED[row["cells"]] - 1.0))

    def test_growth_rows_are_neighbours_and_the_targets_span(self):
        document = rows.document(made_up(plan.Plan(cells=(64, 128, 256, 512), friction=(0.2,)), power=1.3))
        found = [row for row in document["growth"] if row["path"] == "general"]
        assert [(row["from"], row["to"]) for row in found] == [(64, 128), (128, 256), (256, 512), (128, 512)]
        assert all(row["solve"] == pytest.approx(1.3) for row in found)
        assert [(each["powers"], each["met"]) for each in values_of(document)["growth"]] == 2 * [("1.30", False)]

    def test_a_failed_solve_is_a_row_without_a_ratio(self):
        document = rows.document(made_up(plan.Plan(cells=(8,), friction=(0.2,)), status="stalled"))
        assert {(row["status"], row["ratio_own"], row["ratio_fastest"]) for row in document["solves"]} == {
            ("stalled", None, None)
        }
        assert values_of(document)["solved"] == 0

    def test_a_process_that_died_is_a_row_with_the_reason(self, tmp_path):
        found = made_up(plan.Plan(cells=(8,), friction=(0.2,)))
        found.solves.clear()
        found.plain.clear()
        found.ends = {(8, "general"): "out of memory", (8, "shared"): ""}
        document = rows.document(found)
        assert [(row["status"], row["message"]) for row in document["solves"]] == [
            ("error", "out of memory"), ("error", "not measured")
        ]  # fmt: skip
        json.dumps(document, allow_nan=False)
        write_report(report(document), tmp_path)
        assert (tmp_path / "benchmark.md").exists()

    def test_large_plain_factorisations_of_other_libraries_are_left_out(self):
        settings = plan.Plan(cells=(256, 512), friction=(0.2,), factorisation="superlu")
        found = made_up(dataclasses.replace(settings, cells=(256,)))
        for record in found.plain:
            record["seconds"] = {"plain": 9.0}
        found.plain.append({**found.plain[0], "backend": "cholmod"})
        found.plan = settings
        assert study._plain(found, 512, settings.paths[0]) == {"superlu": 3}  # 72 s expected of each
        skipped = [record for record in found.plain if record["status"] == "skipped"]
        assert {record["backend"] for record in skipped} == set(study.available_backends()) - {"superlu"}
        assert all("about 72 s" in record["message"] for record in skipped)


class TestPlan:
    """Settings."""

    def test_repetitions_by_size(self):
        assert [plan.Plan().repetitions(cells) for cells in (64, 128, 256, 512, 1024)] == [5, 5, 3, 3, 2]
        assert plan.Plan(repeat=7).repetitions(512) == 7

    def test_one_factorisation_is_one_path(self):
        assert [path.name for path in plan.Plan().paths] == ["general", "shared"]
        assert plan.Plan(factorisation="superlu").paths == (plan.Path("general", "superlu"),)
        assert plan.Plan(factorisation="shared-subdomains").paths == (plan.Path("shared", "shared-subdomains"),)

    def test_command_gives_the_same_plan(self, monkeypatch):
        wanted = plan.Plan((8, 4), (0.5, 0.2), 2, 3, False, "superlu")
        taken = []
        monkeypatch.setattr(study, "run", lambda settings, _: taken.append(settings) or made_up(settings))
        words = wanted.command.removeprefix("python -m comparisons ").split()
        CliRunner().invoke(group, [*words, "--json"], catch_exceptions=False)
        assert taken == [wanted]

    def test_a_report_that_fails_costs_no_numbers(self, monkeypatch, tmp_path):
        def breaks_off(_):
            raise ZeroDivisionError

        monkeypatch.setattr(study, "run", lambda settings, _: made_up(settings))
        monkeypatch.setattr(report_module, "report", breaks_off)
        words = ["benchmark", "--cells", "8", "--friction", "0.2", "--no-naive", "--out", str(tmp_path)]
        with pytest.raises(ZeroDivisionError):
            CliRunner().invoke(group, words, catch_exceptions=False)
        assert len(json.loads((tmp_path / "benchmark.json").read_text(encoding="utf-8"))["solves"]) == 2

    @pytest.mark.parametrize(
        "settings",
        [{"cells": (0,)}, {"cells": ()}, {"friction": (-0.1,)}, {"friction": (math.nan,)}, {"threads": 0},
         {"repeat": 0}, {"limit": 0.0}, {"limit": math.nan}],
    )  # fmt: skip
    def test_what_makes_no_sense_is_refused(self, settings):
        with pytest.raises(InputError):
            plan.Plan(**settings)

    def test_what_is_not_installed_is_refused(self, monkeypatch):
        def missing(_):
            raise SolverUnavailableError("backend", "cholmod", "not here")

        monkeypatch.setattr(plan, "resolve", missing)
        with pytest.raises(SolverUnavailableError):
            plan.Plan(factorisation="cholmod")


class TestProcesses:
    """Measurements in processes of their own."""

    def test_a_limit_ends_the_process(self):
        task = {"task": "loop", "cells": 4, "friction": 0.2, "threads": 1, "options": plan.LOOPS[0].options}
        assert list(process.records(task, 1, limit=0.05)) == [{"kind": "end", "reason": "more than 0.05 s"}]

    def test_a_crash_is_told(self):
        (end,) = process.records({"task": "nothing"}, 1)
        assert end["kind"] == "end"
        assert "status 1" in end["reason"]
        assert "nothing" in end["reason"]

    def test_what_nobody_reads_is_ended(self):
        task = {"task": "loop", "cells": 4, "friction": 0.2, "threads": 1, "options": plan.LOOPS[0].options}
        reader = process.records(task, 1)
        assert next(reader)["status"] == "solved"
        reader.close()

    def test_threads_are_limited_before_anything_is_loaded(self, monkeypatch):
        monkeypatch.setenv("OMP_NUM_THREADS", "7")
        environment = children.environment(3)
        assert {environment[name] for name in children.LIMITING} == {"3"}

    def test_an_error_is_a_record(self):
        def fail():
            raise SolverUnavailableError("factorisation", "nothing", "choose another")

        record = measure._attempt(fail)
        assert (record["status"], record["seconds"]) == ("error", {})
        assert "choose another" in record["message"]

    def test_the_loop_in_cvxpy_finds_the_same(self):
        records = []
        measure.loop(lambda **record: records.append(record), cells=4, friction=0.2, threads=1, options={})
        (found,) = records
        assert (found["status"], found["unknowns"]) == ("solved", 64)
        assert found["half_force"] == pytest.approx(213.47271271, rel=1e-8)
        assert found["seconds"]["solve"] > 0.0

    def test_a_loop_over_the_limit_stops_larger_ones(self, monkeypatch):
        monkeypatch.setattr(study, "records", lambda *_: iter([{"kind": "end", "reason": "more than 120 s"}]))
        found = list(study._loop(plan.Plan(cells=(16, 32)), plan.LOOPS[0], lambda _: None))
        assert [row["status"] for row in found] == ["over limit", "not run"]
        assert found[1]["message"] == "not run: more than 120 s on 16² cells"


class TestCommandLine:
    """Bad input."""

    @pytest.mark.parametrize(
        ("arguments", "word"),
        [(("--cells", "0"), "cells"), (("--cells", "4", "x"), "x"), (("--cells",), "--cells"),
         (("--friction", "0.2", "-0.1"), "friction"), (("--threads", "0"), "threads"), (("--repeat", "0"), "repeat"),
         (("--factorisation", "mumps"), "mumps"), (("--jsn",), "jsn"), (("--out", ""), "folder"),
         (("--limit", "0"), "limit")],
    )  # fmt: skip
    def test_bad_options_are_one_line(self, capfd, arguments, word):
        assert word in refused(capfd, *arguments)

    def test_a_folder_that_cannot_be_written_is_refused_before_any_work(self, capfd, tmp_path):
        (tmp_path / "file").write_text("kept", encoding="utf-8")
        assert "file" in refused(capfd, "--out", tmp_path / "file" / "below")

    def test_help(self):
        done = subprocess.run([sys.executable, "-m", "comparisons", "benchmark", "--help"], capture_output=True,
                              text=True, timeout=60, check=False)  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        assert "--no-naive" in done.stdout
