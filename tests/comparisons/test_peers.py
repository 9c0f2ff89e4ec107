"""The peers command: what displacement codes find, what becomes of those that fail or are missing, what is said of it.

One small run is shared by the tests of a process.
"""

import copy
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from importlib import import_module
from importlib.util import find_spec

import pytest
from click.testing import CliRunner

from comparisons.benchmark import reference
from comparisons.benchmark.ratios import median
from comparisons.cli import group
from comparisons.peers import cases, measure, models, ngsolve_nitsche, report, study, tables
from comparisons.peers.findings import findings, lasting_error
from comparisons.study.outcome import Outcome
from qvi_contact import InputError, solve, terminal
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import has_matplotlib

SETTLED = reference.SETTLED
with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
posix = pytest.mark.skipif(os.name != "posix", reason="the other Python is a shell script here")
FIRST = "--friction 0.2 --cells 8 4 --repeat 2 --json"
CHOSEN = [model for model in models.MODELS if model.name in ("equilibrium, graded", "NGSolve, p = 2, incomplete")]


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Standard output and error, and the files of a run on two meshes with one model of each kind, without GetFEM."""
    folder = tmp_path_factory.mktemp("peers")
    words = ["peers", *FIRST.split(), "--out", str(folder)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "MODELS", CHOSEN)
        patch.setattr(cases, "find_spec", lambda name: None if name == "getfem" else find_spec(name))
        done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout, done.stderr, {path.name: path for path in folder.iterdir()}


@pytest.fixture
def document(ran):
    return json.loads(ran[0])


def nitsche(friction, cells, order=2, variant="symmetric", ratio=1.0):
    return ngsolve_nitsche.build(cases.case(friction, cells, ratio), order, variant).solve()


def refused(capfd, *arguments):
    """Standard error of a command that must end with status 2, print nothing else and measure nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", "peers", *map(str, arguments)])
        patch.setattr(study, "run", lambda *_: pytest.fail("the run was started"))
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    assert (caught.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    return err


def other_python(folder, does):
    """A program that says it has any module, and then does this instead of the work."""
    path = folder / "python-with-getfem"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{does}\n', encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def ran_elsewhere(folder, does, *options):
    """Result of a run of GetFEM's models alone by such a program."""
    words = ["peers", "--friction", "0.2", "--cells", "4", *options, "--json", "--getfem", other_python(folder, does)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cases, "MODELS", [model for model in models.MODELS if model.name == "GetFEM, Q2"])
        return CliRunner().invoke(group, words, catch_exceptions=False)


def test_what_a_library_prints_is_not_the_answer():
    order = {"module": "this", "case": {}, "warm_up": {}, "options": {}, "repeat": 1}  # it prints when imported
    found = measure.run({**order, "interpreter": sys.executable})
    assert found["status"] == "error"
    assert found["message"].startswith("AttributeError")


def test_progress_has_a_step_for_each_process(monkeypatch):
    monkeypatch.setattr(cases, "MODELS", CHOSEN[:1])
    row = {"status": "solved", "error": None, "code": models.EQUILIBRIUM, "version": "1"}
    monkeypatch.setattr(study, "_row", lambda *place: {**row, "friction": place[2], "cells": place[3]})
    plan, steps = cases.Plan(friction=(0.2, 0.3), cells=(4, 8)), []
    document = study.run(plan, steps.append)
    assert len(steps) == plan.steps == len(document["rows"]) == 4
    assert steps[-1] == "equilibrium, graded, 8², μ = 0.3"


@with_ngsolve
class TestNitsche:
    """NGSolve's script."""

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23746), (16, 214.23420)])
    def test_expected_forces(self, cells, expected):
        found = nitsche(0.2, cells, variant="incomplete")
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected, abs=6e-6)
        assert found["unknowns"] == 2 * (2 * cells + 1) ** 2 - 2 * (2 * cells + 1)

    @pytest.mark.parametrize("variant", ngsolve_nitsche.VARIANTS)
    @pytest.mark.parametrize("order", [2, 3])
    def test_variants_settle_on_the_same_value(self, variant, order):
        coarse, fine = (abs(nitsche(0.2, cells, order, variant)["half_force"] - SETTLED[0.2]) for cells in (4, 8))
        assert fine < {2: 6e-3, 3: 5e-4}[order]
        assert fine < coarse / 2.0

    def test_variants_are_different_methods(self):
        forces = [nitsche(0.2, 4, variant=variant)["half_force"] for variant in ("symmetric", "incomplete", "skew")]
        assert forces[0] < forces[1] - 1e-3 < forces[2] - 2e-3

    @pytest.mark.parametrize("variant", ngsolve_nitsche.VARIANTS)
    def test_uniform_stress_without_friction(self, variant):
        assert nitsche(0.0, 3, 2, variant, ratio=0.7)["half_force"] == pytest.approx(209.0, rel=1e-10)

    def test_full_stick_on_a_graded_mesh(self):
        assert nitsche(1.0, 16, 3, ratio=0.7)["half_force"] == pytest.approx(SETTLED[1.0], abs=4e-5)

    def test_graded_meshes_need_the_line_search(self, monkeypatch):
        monkeypatch.setattr(ngsolve_nitsche, "_STEPS", 15)
        found = nitsche(0.2, 12, ratio=0.6)
        assert found["status"] == "solved"
        assert found["residual"] <= ngsolve_nitsche.ACCEPTED
        monkeypatch.setattr(ngsolve_nitsche, "_SHORTEST", 1.0)
        without = nitsche(0.2, 12, ratio=0.6)
        assert without["status"] == "not converged"
        assert without["residual"] > ngsolve_nitsche.ACCEPTED
        assert "Newton steps" in without["message"]

    def test_continuation_leads_to_the_same_solution(self, monkeypatch):
        direct = nitsche(0.2, 8, ratio=0.7)
        monkeypatch.setattr(ngsolve_nitsche, "_STEPS", 4)  # too few from zero
        continued = nitsche(0.2, 8, ratio=0.7)
        assert continued["status"] == "solved"
        assert continued["iterations"] > direct["iterations"] > 4
        assert continued["half_force"] == pytest.approx(direct["half_force"], rel=1e-9)

    def test_each_solve_starts_from_zero(self):
        plate = ngsolve_nitsche.build(cases.case(0.2, 4, 1.0))
        assert plate.solve() == plate.solve()

    def test_another_python_gives_the_same_answer(self):
        order = {
            "module": "ngsolve_nitsche", "case": cases.case(0.2, 4, 1.0), "warm_up": cases.case(0.2, 2, 1.0),
            "options": {"order": 2, "variant": "skew"}, "repeat": 1,
        }  # fmt: skip
        found = measure.run({**order, "interpreter": sys.executable})
        assert found["half_force"] == pytest.approx(nitsche(0.2, 4, variant="skew")["half_force"], rel=1e-12)
        assert 2**24 < found["before"] <= found["peak"] < 2**30
        assert [len(found["setup"]), len(found["solve"])] == [1, 1]

    @pytest.mark.parametrize("interpreter", [None, sys.executable])
    def test_exceptions_are_told(self, interpreter):
        order = {"module": "ngsolve_nitsche", "case": {}, "warm_up": {}, "options": {}, "repeat": 1}
        found = measure.run({**order, "interpreter": interpreter})
        assert (found["status"], found["message"]) == ("error", "KeyError: 'y'")
        row = study.row_of(Outcome("done", result=found), 0.2)
        assert (row["status"], row["message"], row["whole"]) == ("error", "KeyError: 'y'", None)


@cache
def python_with_getfem():
    """A Python that finds GetFEM: this one, that of an environment variable, or the system's; None if none does."""
    candidates = (sys.executable, os.environ.get("PYTHON_WITH_GETFEM"), shutil.which("python3", path="/usr/bin"))
    for name in filter(None, candidates):
        try:
            cases.Plan(getfem=name)
        except InputError:
            continue
        return name
    return None


@pytest.mark.skipif(python_with_getfem() is None, reason="GetFEM is not installed")
class TestGetFEM:
    """GetFEM's script, in this Python or the system's."""

    def found(self, cells, mesh):
        (model,) = (model for model in models.MODELS if (model.code, model.mesh) == ("getfem", mesh))
        plan = cases.Plan(friction=(0.2,), cells=(cells,), repeat=1, getfem=python_with_getfem())
        return measure.run(plan.order(model, 0.2, cells))

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23508), (16, 214.23389)])
    def test_expected_forces(self, cells, expected):
        found = self.found(cells, "uniform")
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected, abs=6e-6)

    def test_a_mesh_whose_nodes_it_merges_is_not_solved(self):
        found = self.found(24, "graded")
        assert found["status"] == "error"
        assert "4732 of 4802" in found["message"]


class TestRun:
    """One real run."""

    def test_nothing_but_json_on_standard_output(self, ran, document):
        assert ran[1] == ""
        assert document["schema"] == "qvi-contact/peers/1"
        assert document["threads"] == 1
        assert document["command"] == "python -m comparisons peers --friction 0.2 --cells 4 8 --repeat 2 --limit 300"

    def test_no_names_of_machines_or_folders(self, ran):
        texts = [ran[0], ran[2]["peers.md"].read_text(encoding="utf-8")]
        assert not [text for text in texts if os.uname().nodename in text or os.getcwd() in text or "/home/" in text]

    def test_equilibrium_rows_are_certified_solves(self, document):
        rows = [row for row in document["rows"] if row["code"] == models.EQUILIBRIUM]
        assert [(row["cells"], row["grading"], row["status"]) for row in rows] == [
            (4, 0.6, "solved"), (8, 0.6, "solved")
        ]  # fmt: skip
        expected = solve(compressed_plate(0.2, cells=(8, 8), grading=0.6)).contacts["plate"].normal_force
        assert rows[-1]["half_force"] == pytest.approx(expected, rel=1e-10)
        assert rows[-1]["unknowns"] == 256
        assert rows[-1]["residual"] < 1e-8

    @with_ngsolve
    def test_ngsolve_row(self, document):
        row = document["rows"][-1]
        assert (row["model"], row["cells"], row["status"]) == ("NGSolve, p = 2, incomplete", 8, "solved")
        assert row["half_force"] == pytest.approx(214.23746, abs=6e-6)
        assert document["versions"]["NGSolve"] == row["version"]

    def test_errors_and_times_are_those_of_the_values_listed(self, document):
        for row in document["rows"]:
            assert row["error"] == pytest.approx(abs(row["half_force"] / SETTLED[0.2] - 1.0))
            whole = [sum(pair) for pair in zip(row["seconds"]["setup"], row["seconds"]["solve"], strict=True)]
            assert row["repetitions"] == len(whole) == 2
            assert row["whole"] == pytest.approx(median(whole))
            assert min(row["seconds"]["setup"] + row["seconds"]["solve"]) > 0.0
            assert 2**24 < row["before"] <= row["peak"] < 2**30

    def test_a_missing_code_says_how_to_get_it(self, ran, document):
        (missing,) = (code for code in document["missing"] if code["code"] == "GetFEM")
        assert "python3-getfem" in missing["remedy"]
        assert any(missing["remedy"] in sentence for sentence in document["findings"])
        assert missing["remedy"] in ran[2]["peers.md"].read_text(encoding="utf-8")
        assert not [row for row in document["rows"] if row["code"] == "getfem"]

    def test_files(self, ran, document):
        pictures = report.PICTURES if has_matplotlib() else ()
        assert sorted(ran[2]) == sorted([*report.TEXTS, *pictures])
        assert json.loads(ran[2]["peers.json"].read_text(encoding="utf-8")) == document
        text = ran[2]["peers.md"].read_text(encoding="utf-8")
        assert all(sentence in text for sentence in document["findings"])
        assert all(f"{row['half_force']:.5f}" in text for row in document["rows"])

    def test_terminal(self, document, capsys):
        report.show(document, [])
        shown = capsys.readouterr().out
        assert "The plate at μ = 0.2" in shown
        assert f"{document['rows'][0]['half_force']:.5f}" in shown

    def test_what_others_reported_is_not_mixed_with_the_run(self, document):
        reported = {row["code"].split(",")[0] for row in document["reported"]}
        assert reported == {"CalculiX", *(code["code"] for code in document["missing"])}
        assert not [row for row in document["rows"] if row["model"].split(",")[0] in reported]
        assert not [sentence for sentence in document["findings"] if "CalculiX" in sentence]


@posix
class TestFailures:
    """Codes that crash, hang, or talk nonsense are rows with the reason."""

    @pytest.mark.parametrize(
        ("does", "options", "status", "reason"),
        [
            ("echo no libgetfem.so.5 >&2; exit 3", (), "error", "no libgetfem.so.5"),
            ("kill -SEGV $$", (), "error", "-11"),
            ("sleep 60", ("--limit", "1"), "timeout", "more than 1 s"),
            ("cat >/dev/null; echo hello", (), "error", "JSON"),
        ],
    )
    def test_row_with_the_reason(self, tmp_path, does, options, status, reason):
        done = ran_elsewhere(tmp_path, does, *options)
        assert done.exit_code == 0
        document = json.loads(done.stdout)
        (row,) = document["rows"]
        assert (row["status"], row["error"], row["half_force"]) == (status, None, None)
        assert reason in row["message"]
        assert str(tmp_path) not in done.stdout
        assert document["findings"][0] == "0 of 1 runs end with a solution."
        assert f"GetFEM, Q2 fails on 4² at μ = 0.2 ({status}: {row['message']})." in document["findings"]

    def test_a_failed_row_is_shown_and_not_drawn(self, tmp_path):
        document = json.loads(ran_elsewhere(tmp_path, "echo broken >&2; exit 1").stdout)
        written = report.write(document, tmp_path)
        assert "broken" in (tmp_path / "peers.md").read_text(encoding="utf-8")
        assert len(written) == (4 if has_matplotlib() else 2)


def test_an_answer_that_did_not_converge_has_no_error():
    for half_force, shown in ((float("nan"), None), (203.3, 203.3)):
        answer = {"status": "not converged", "message": "", "half_force": half_force, "residual": float("inf")}
        row = study.row_of(Outcome("done", result={**answer, "setup": [1.0], "solve": [2.0]}), 0.2)
        assert (row["status"], row["error"], row["half_force"]) == ("not converged", None, shown)
        assert (row["residual"], row["whole"]) == (None, 3.0)
        report.as_json(row)


def made_up(*rows, friction=0.2):
    """A document with rows (model, cells, P/2, seconds); unknowns are cells²."""
    value = SETTLED.get(friction)
    found = []
    for name, cells, half_force, seconds in rows:
        (model,) = (model for model in models.MODELS if model.name == name)
        found.append({
            "model": name, "code": model.code, "mesh": model.mesh, "cells": cells, "unknowns": cells**2,
            "friction": friction, "status": "solved", "half_force": half_force, "whole": seconds,
            "error": reference.settled_error(half_force, friction),
        })  # fmt: skip
    meaningless = None if value is None else 2e-5 / value
    settled = {"friction": friction, "half_force": value, "meaningless": meaningless}
    return {"rows": found, "missing": [], "settled": [settled]}


class TestFindings:
    """Sentences follow the numbers."""

    def test_the_nearest_is_that_with_the_smallest_error_in_time(self):
        ours, theirs = "equilibrium, graded", "NGSolve, p = 3, symmetric"
        for first, second in ((ours, theirs), (theirs, ours)):
            said = findings(made_up((first, 8, 214.0, 0.02), (second, 16, 214.23, 0.5)))
            (soon,) = (sentence for sentence in said if sentence.startswith("Within 0.03 s"))
            (late,) = (sentence for sentence in said if sentence.startswith("Within 1 s"))
            assert first in soon
            assert "in 20 ms with 64 unknowns" in soon
            assert second in late
            assert "1.5e-05 in 500 ms with 256 unknowns" in late

    def test_errors_within_the_uncertainty_count_alike(self):
        document = made_up(("GetFEM, Q2", 8, 214.23324, 0.02), ("NGSolve, p = 3, symmetric", 8, 214.23323, 0.025))
        (sentence,) = (sentence for sentence in findings(document) if sentence.startswith("Within"))
        assert "GetFEM" in sentence
        assert "within the uncertainty of 9e-08" in sentence

    def test_who_reaches_a_target(self):
        document = made_up(("equilibrium, graded", 8, 214.22, 0.01), ("GetFEM, Q2", 8, 214.233, 0.2))
        text = " ".join(findings(document))
        assert "error of 1e-04 at μ = 0.2 takes equilibrium, graded, 8² cells 10 ms and 64 unknowns, GetFEM" in text
        assert "1e-05 at μ = 0.2 is reached by GetFEM, Q2, 8² cells in 200 ms with 64 unknowns, and by no equi" in text
        assert "1e-06 at μ = 0.2 is reached by no model" in text

    def test_an_error_that_a_finer_mesh_does_not_confirm_is_chance(self):
        document = made_up(("GetFEM, Q2", 4, 214.2332, 0.01), ("GetFEM, Q2", 8, 214.24, 0.02))
        first, last = document["rows"]
        assert lasting_error(document["rows"], first) == last["error"] == lasting_error(document["rows"], last)
        text = " ".join(findings(document))
        assert "some errors of GetFEM, Q2 are smaller than on a finer mesh" in text
        assert f"an error of {last['error']:.1e}" in text
        assert f"an error of {first['error']:.1e}" not in text

    def test_errors_within_the_uncertainty_may_grow(self):
        document = made_up(("GetFEM, Q2", 4, 214.233231, 0.01), ("GetFEM, Q2", 8, 214.233232, 0.02))
        assert "by chance" not in " ".join(findings(document))

    def test_order_and_side(self):
        offset = 214.23323 * 1e-4
        rows = [("equilibrium, uniform", cells, 214.23323 - offset / cells, 0.1) for cells in (4, 16)]
        text = " ".join(findings(made_up(*rows)))
        assert "p = 0.50 (equilibrium, uniform)" in text
        assert "equilibrium, uniform: below the settled value on all meshes" in text
        rows[0] = ("equilibrium, uniform", 4, 214.24, 0.1)
        assert "on all meshes" not in " ".join(findings(made_up(*rows)))

    def test_without_settled_value(self, document, tmp_path):
        assert "At μ = 0.35 no settled value is known: no errors are given." in findings(made_up(friction=0.35))
        changed = copy.deepcopy(document)
        changed["settled"] = [study._settled(0.35)]
        for row in changed["rows"]:
            row |= {"friction": 0.35, "error": None}
        assert [path.name for path in report.write(changed, tmp_path)] == list(report.TEXTS)
        assert "No settled value" in (tmp_path / "peers.md").read_text(encoding="utf-8")


def test_errors_below_the_uncertainty_are_shown_as_such(document):
    document["rows"][0]["error"] = 3e-8
    (grid,) = (grid for grid in tables.tables(document) if grid.title == "The plate at μ = 0.2")
    assert "< 9e-08" in grid.rows[0]


@pytest.mark.skipif(not has_matplotlib(), reason="matplotlib is not installed")
def test_picture_has_a_curve_for_each_model_and_the_band(document):
    from comparisons.peers.figures import picture

    figure = picture(document)
    assert len(figure.axes) == 2
    shown = list(dict.fromkeys(row["model"] for row in document["rows"]))
    for axes, key in zip(figure.axes, ("unknowns", "whole"), strict=True):
        assert (axes.get_xscale(), axes.get_yscale()) == ("log", "log")
        assert [line.get_label() for line in axes.lines] == shown
        rows = [row for row in document["rows"] if row["model"] == shown[0]]
        assert axes.lines[0].get_xydata().tolist() == [[row[key], row["error"]] for row in rows]
        (band,) = axes.patches
        assert band.get_y() + band.get_height() == pytest.approx(2e-5 / SETTLED[0.2])


def test_models_can_be_told_apart_and_their_codes_exist():
    assert len({(model.colour, model.marker) for model in models.MODELS}) == len(models.MODELS)
    assert len({model.marker for model in models.MODELS}) == len(models.MODELS)
    for model in models.MODELS:
        code = models.CODES[model.code]
        module = import_module(f"comparisons.peers.{code.module}")
        assert code.library == module.MODULE
        assert callable(module.build)


def test_all_codes_get_the_plate_of_the_gallery():
    problem = compressed_plate(0.2, cells=(6, 6), grading=0.8)
    case = cases.case(0.2, 6, 0.8)
    assert (case["x"], case["y"]) == (problem.mesh.x.tolist(), problem.mesh.y.tolist())
    assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)
    json.dumps(case, allow_nan=False)


def test_the_scripts_load_no_peer_and_foreign_ones_nothing_of_the_project():
    names = ("getfem", "ngsolve", "qvi_contact", "comparisons")
    look = (
        "import sys; sys.path.insert(0, sys.argv[1]); import getfem_bricks, repeated, ngsolve_nitsche; "
        f"print([name for name in sys.modules if name.split('.')[0] in {names}])"
    )
    folder = os.path.dirname(cases.__file__)
    done = subprocess.run([sys.executable, "-I", "-c", look, folder], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--friction", "-0.1"), "friction"),
        (("--friction", "nan"), "friction"),
        (("--friction", "inf"), "friction"),
        (("--cells", "0"), "cells"),
        (("--cells", "four"), "four"),
        (("--repeat", "0"), "repeat"),
        (("--limit", "0"), "limit"),
        (("--limit", "inf"), "limit"),
        (("--getfem", "/nowhere/python3"), "getfem"),
        (("--threads", "2"), "--threads"),
        (("--out", ""), "folder"),
        (("--out", "/proc/below"), "/proc/below"),
    ],
)
def test_wrong_options_are_one_line_and_start_nothing(capfd, arguments, named):
    assert named in refused(capfd, *arguments)


@posix
def test_another_python_without_the_library_is_refused(capfd, tmp_path):
    path = tmp_path / "python"
    path.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    path.chmod(0o755)
    assert "give a Python that finds the module getfem" in refused(capfd, "--getfem", path)


def test_missing_codes_leave_the_equilibrium_model(monkeypatch):
    monkeypatch.setattr(cases, "find_spec", lambda _: None)
    plan = cases.Plan()
    assert plan.missing == ("ngsolve", "getfem")
    assert models.CODES["ngsolve"].remedy == "python -m pip install 'qvi-contact[peers]'"
    assert {model.code for model in plan.models} == {models.EQUILIBRIUM}
    assert plan.steps == 2 * 2 * 4
