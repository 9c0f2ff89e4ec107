"""The peers command: what displacement codes find, what becomes of those that fail or are missing, what is said of it.

One small run is shared by the tests of a process.
"""

import json
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from comparisons.cli import group
from comparisons.lab.report import drawing
from comparisons.lab.report.numbers import NOTHING
from comparisons.lab.study import read_csv, read_study
from comparisons.lab.study.rows import Row, finite_json
from comparisons.lab.tables import grid_of
from comparisons.peers import LEVELS, command, figures, meshes, models, study
from comparisons.peers.codes import companion, equilibrium, ngsolve_nitsche, process
from comparisons.peers.figures import COSTS
from comparisons.peers.measures import (
    RESOLUTION,
    TARGETS,
    beside_of,
    compared_of,
    contradictory,
    costs_of,
    intervals_of,
    known_of,
    reference,
    runs_of,
    values_of,
)
from comparisons.peers.report import FORMS, SCHEMA, document_of, report, tables_of
from comparisons.settled import LIMITS, SETTLED, UNCERTAINTY
from qvi_contact import InputError, solve
from qvi_contact.basics import terminal
from qvi_contact.bracket import BracketKind, bracket
from qvi_contact.gallery import compressed_plate
from qvi_contact.plots import has_matplotlib
from tests.comparisons.conftest import outline

with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
posix = pytest.mark.skipif(os.name != "posix", reason="the other Python is a shell script here")
LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
FLOOR = LIMITS[0.2][1] / LIMIT[0.2]
CHOSEN = ("triangles, p = 3, bisected", "NGSolve, p = 2, symmetric, uniform", "bracket, p = 3, graded")
COMMITTED = Path(__file__).parents[2] / "comparisons" / "reports" / "peers" / "peers"
EMPTY = {"case": {}, "warm_up": {}, "options": {}, "repetitions": 1}


def chosen(patch, *names):
    """Let the study have these models only."""
    patch.setattr(study, "MODELS", [model for model in models.MODELS if model.name in names])


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Standard output and error, the files and the rows of a run on one mesh, models of three kinds, without GetFEM."""
    folder = tmp_path_factory.mktemp("peers")
    words = ["peers", "--friction", "1.0", "--cells", "8", "--levels", "1", "--repeat", "2", "--json"]
    words += ["--store", str(folder / "a.sqlite"), "--out", str(folder / "out")]
    with pytest.MonkeyPatch.context() as patch:
        chosen(patch, *CHOSEN)
        patch.delenv(study.GETFEM, raising=False)
        patch.setattr(study, "find_spec", lambda name: None if name == "getfem" else find_spec(name))
        patch.setattr(drawing, "svg_text", outline)
        done = CliRunner().invoke(group, words, catch_exceptions=False)
    assert done.exit_code == 0
    files = {path.name: path.read_text(encoding="utf-8") for path in (folder / "out").iterdir() if path.suffix != ".gz"}
    assert read_csv(folder / "out" / "peers.csv.gz") == read_study(folder / "a.sqlite").rows
    return done.stdout, done.stderr, files, read_study(folder / "a.sqlite").rows


@pytest.fixture
def document(ran):
    return json.loads(ran[0])


@pytest.fixture
def by_code(document):
    """Code → its row."""
    return {row["code"]: row for row in document["rows"]}


def nitsche(friction, number, order=2, variant="symmetric", mesh="uniform"):
    return ngsolve_nitsche.build(study.plate(friction, mesh, number), order, variant)()


def refused(capfd, *arguments):
    """Standard error of a command that must end with status 2, print nothing else and measure nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", "peers", *map(str, arguments)])
        patch.setattr(command.RunOptions, "run", lambda *_: pytest.fail("the run was started"))
        patch.setenv(study.GETFEM, "")
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    assert (caught.value.code, out) == (2, "")
    assert len(err.splitlines()) == 1
    return err


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
        assert nitsche(0.0, 3, 2, variant, "graded")["half_force"] == pytest.approx(209.0, rel=1e-10)

    def test_full_stick_on_a_graded_mesh(self):
        assert nitsche(1.0, 12, 3, mesh="graded")["half_force"] == pytest.approx(SETTLED[1.0], abs=1e-4)

    def test_graded_meshes_need_the_line_search(self, monkeypatch):
        monkeypatch.setattr(ngsolve_nitsche, "_STEPS", 15)
        found = nitsche(0.2, 12, mesh="graded")
        assert found["status"] == "solved"
        assert found["residual"] <= ngsolve_nitsche.ACCEPTED
        monkeypatch.setattr(ngsolve_nitsche, "_SHORTEST", 1.0)
        without = nitsche(0.2, 12, mesh="graded")
        assert without["status"] == "not converged"
        assert without["residual"] > ngsolve_nitsche.ACCEPTED
        assert "Newton steps" in without["message"]

    def test_continuation_leads_to_the_same_solution(self, monkeypatch):
        direct = nitsche(0.2, 8, mesh="graded")
        monkeypatch.setattr(ngsolve_nitsche, "_STEPS", 4)  # too few from zero
        continued = nitsche(0.2, 8, mesh="graded")
        assert continued["status"] == "solved"
        assert continued["iterations"] > direct["iterations"] > 4
        assert continued["half_force"] == pytest.approx(direct["half_force"], rel=1e-9)

    def test_each_solve_starts_from_zero(self):
        plate = ngsolve_nitsche.build(study.plate(0.2, "uniform", 4))
        assert plate() == plate()


@cache
def python_with_getfem():
    """A Python that finds GetFEM: this one, that of the environment variable, or the system's; None if none does."""
    for name in filter(None, (os.environ.get(study.GETFEM), sys.executable, shutil.which("python3", path="/usr/bin"))):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(study.GETFEM, name)
            try:
                study.missing_codes()
            except InputError:
                continue
            return name
    return None


@pytest.mark.skipif(python_with_getfem() is None, reason="GetFEM is not installed")
class TestGetFEM:
    """GetFEM's script, in this Python or another one."""

    @pytest.fixture
    def found(self, monkeypatch):
        monkeypatch.setenv(study.GETFEM, python_with_getfem())
        return lambda **case: study.run({"friction": 0.2, "repetitions": 1, **case})

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23508), (16, 214.23389)])
    def test_expected_forces(self, found, cells, expected):
        answer = found(model="GetFEM, Q2, uniform", number=cells)
        assert answer["status"] == "solved"
        assert answer["half_force"] == pytest.approx(expected, abs=6e-6)
        assert answer["before"] <= answer["peak"]

    def test_a_mesh_whose_nodes_it_merges_is_not_solved(self, found):
        answer = found(model="GetFEM, Q2, graded", number=24)
        assert answer["status"] == "error"
        assert "4732 of 4802" in answer["message"]


class TestOwnModels:
    """What this package's own codes answer."""

    @pytest.mark.parametrize("degree", [2, 3])
    def test_the_companion_is_above_and_its_unknowns_are_those_of_the_same_elements(self, degree):
        found = companion.build(study.plate(1.0, "graded", 4), degree)()
        assert found["status"] == "solved"
        assert SETTLED[1.0] < found["half_force"] < {2: 214.41, 3: 214.38}[degree]
        assert found["unknowns"] == 2 * (4 * degree + 1) ** 2 - 2 * (4 * degree + 1)

    def test_the_bracket_of_a_plate_that_sticks_bounds_the_force(self):
        found = equilibrium.build(study.plate(1.0, "graded", 4), bracket=2)()
        assert (found["status"], found["half_force"], found["guaranteed"]) == ("solved", None, True)
        assert (found["kind"], found["unknowns"]) == (BracketKind.STICKING.name, 64 + 2 * 9**2)
        assert found["lower"] < SETTLED[1.0] < found["upper"]
        half_width = (found["upper"] - found["lower"]) / (found["upper"] + found["lower"])
        assert found["width"] == pytest.approx(half_width, rel=1e-9)

    def test_the_bracket_of_a_plate_that_slips_is_an_indicator(self):
        found = equilibrium.build(study.plate(0.2, "graded", 4), bracket=2)()
        assert (found["status"], found["guaranteed"]) == ("solved", False)
        assert (found["lower"], found["upper"], found["kind"]) == (None, None, BracketKind.GIVEN_BOUND.name)
        expected = bracket(solve(compressed_plate(0.2, (4, 4), grading=0.6), element="bfs"))
        assert found["strain_error"] == pytest.approx(expected.relative_error, rel=1e-3)
        assert 0.0 < found["width"] < 1e-3

    def test_the_bracket_on_triangles_bounds_the_force_under_slip(self):
        found = equilibrium.build(study.plate(0.1, "bisected", 0), degree=4, bracket=4)()
        assert (found["status"], found["guaranteed"], found["kind"]) == ("solved", True, equilibrium.ONE_SENSE)
        assert found["lower"] < LIMIT[0.1] < found["upper"]
        assert found["width"] == pytest.approx((found["upper"] - found["lower"]) / (found["upper"] + found["lower"]))
        stress = solve(equilibrium.problem(study.plate(0.1, "bisected", 0)), degree=4, tolerance=1e-8)
        assert found["strain_error"] == pytest.approx(stress.bracket.slip.relative_error, rel=1e-6)
        assert found["unknowns"] == stress.solution.problem.n + stress.bracket.companion.space.size

    @pytest.mark.parametrize(("number", "width"), [(0, 10.0**-2.5), (1, 1e-3)])
    def test_adaptive_meshes_give_bounds_as_close_as_their_number_asks_for(self, number, width):
        found = equilibrium.build(study.plate(0.05, "adaptive", number), degree=5, adaptive=True)()
        assert (found["status"], found["guaranteed"]) == ("solved", True)
        assert found["lower"] < LIMIT[0.05] < found["upper"]
        assert 0.0 < found["width"] <= width
        assert len(study.plate(0.05, "adaptive", number)["cells"]) == 2

    def test_friction_that_is_too_large_has_no_bounds_under_slip(self):
        class Slip:
            forces, message, guaranteed, relative_error = {}, "No pair.", True, 0.1

        assert equilibrium._by_slip(Slip)["status"] == "no bounds"

    def test_a_bracket_without_bounds_is_no_solution(self, monkeypatch):
        import qvi_contact.bracket

        class Found:
            forces, companion, slip, kind, guaranteed = {}, None, None, BracketKind.PROBLEM, False
            lower, upper, gap, relative_error, reasons = -float("inf"), 1.0, float("inf"), float("inf"), ("No stress.",)

        monkeypatch.setattr(qvi_contact.bracket, "bracket", lambda *_, **__: Found)
        found = equilibrium.build(study.plate(1.0, "uniform", 2), bracket=2)()
        assert (found["status"], found["message"]) == ("no bounds", "No stress.")


class TestRun:
    """One real run."""

    def test_nothing_but_json_on_standard_output(self, ran, document):
        assert ran[1] == ""
        assert document["schema"] == SCHEMA
        assert [row["model"] for row in document["rows"]] == [
            n for n in CHOSEN if find_spec("ngsolve") or "NG" not in n
        ]

    def test_no_names_of_machines_or_folders(self, ran):
        texts = [ran[0], *ran[2].values()]
        assert not [text for text in texts if os.uname().nodename in text or os.getcwd() in text or "/home/" in text]

    def test_own_rows_are_certified_solves(self, by_code):
        expected = solve(equilibrium.problem(study.plate(1.0, "bisected", 0)), degree=3)
        row = by_code[models.TRIANGLES]
        assert row["half_force"] == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
        assert (row["unknowns"], row["bounds"]) == (expected.solution.problem.n, None)
        assert row["residual"] < 1e-8

    def test_the_bracket_is_between_rectangles_and_the_companion(self, by_code):
        bounds = by_code[models.BRACKET]["bounds"]
        lower = equilibrium.build(study.plate(1.0, "graded", 8))()
        assert (lower["status"], lower["unknowns"]) == ("solved", 256)
        assert bounds["lower"] == pytest.approx(lower["half_force"], rel=1e-10)
        expected = solve(compressed_plate(1.0, cells=(8, 8), grading=0.6), element="bfs").contacts["plate"].normal_force
        assert lower["half_force"] == pytest.approx(expected, rel=1e-10)
        upper = companion.build(study.plate(1.0, "graded", 8), 3)()["half_force"]
        assert bounds["upper"] == pytest.approx(upper, rel=1e-8)
        assert bounds["guaranteed"]

    @with_ngsolve
    def test_ngsolve_row(self, ran, by_code):
        row = by_code["ngsolve"]
        assert (row["number"], row["status"]) == (8, "solved")
        assert row["half_force"] == pytest.approx(nitsche(1.0, 8)["half_force"], rel=1e-12)
        assert row["version"] == ran[3][0].environment["versions"]["ngsolve"]

    def test_each_case_has_times_and_a_memory_of_its_own(self, document):
        for row in document["rows"]:
            whole = [sum(pair) for pair in zip(row["setup"], row["solve"], strict=True)]
            assert len(whole) == 2
            assert row["seconds"] == min(whole)
            assert min(row["setup"] + row["solve"]) > 0.0
            assert 2**24 < row["before"] <= row["peak"] < 2**30
        assert len({row["before"] for row in document["rows"]}) == len(document["rows"])

    def test_errors_are_relative_to_the_value_named(self, document):
        (known,) = document["references"]
        assert known["value"] == LIMIT[1.0]
        errors = [row["error"] for row in document["rows"] if row["half_force"]]
        forces = [row["half_force"] for row in document["rows"] if row["half_force"]]
        assert errors == pytest.approx([abs(force / LIMIT[1.0] - 1.0) for force in forces])
        assert min(errors) > 1e-6

    def test_a_missing_code_says_how_to_get_it(self, ran, document):
        remedy = models.CODES["getfem"].remedy
        assert "getfem" in document["missing"]
        assert remedy in ran[2]["peers.md"]
        assert remedy in ran[2]["peers.html"]

    def test_files(self, ran, document):
        names = [f"{kind}-{cost.name}-mu-1" for cost in COSTS for kind in ("best", "error")]
        names += ["bounds-mu-1", "intervals-mu-1"]
        pictures = [f"peers-{name}.svg" for name in names] if has_matplotlib() else []
        assert sorted(ran[2]) == sorted(["peers.html", "peers.md", *pictures])
        text = ran[2]["peers.md"]
        assert all(f"{row['half_force']:.7f}" in text for row in document["rows"] if row["half_force"])
        assert "python -m comparisons peers --friction 1 --cells 8 --levels 1 --repeat 2" in text

    @pytest.mark.usefixtures("outlined")
    def test_the_report_is_made_of_the_rows_alone(self, ran):
        made = report(ran[3][::-1])
        assert made.text == ran[2]["peers.md"]
        assert made.pictures == {name: text for name, text in ran[2].items() if "svg" in name}


@pytest.fixture(scope="module")
def committed():
    """The rows in `comparisons/reports`."""
    return read_csv(COMMITTED.with_suffix(".csv.gz"))


class TestCommitted:
    """The run in `comparisons/reports`."""

    def test_the_committed_report_is_that_of_the_committed_rows(self, committed, monkeypatch):
        monkeypatch.setattr(figures, "drawn", lambda *_: "drawn")
        assert report(committed).text == COMMITTED.with_suffix(".md").read_text(encoding="utf-8")

    def test_numbers_of_the_findings(self, committed):
        """From the rows, without the frame."""
        runs = runs_of(committed)
        solved = [row for row in committed if row.result.get("status") == "solved"]
        assert (len(runs), runs.solved.sum()) == (len(committed), len(solved))
        lines = compared_of(costs_of(runs)).query("target == 1e-8").set_index("friction")
        for friction, (value, uncertainty) in LIMITS.items():
            by_code = {code: self.least(solved, friction, value, uncertainty, code) for code in models.CODES}
            ours, theirs = by_code[models.TRIANGLES], min(by_code["ngsolve"], by_code["getfem"])
            assert lines.loc[friction, ["seconds_own", "seconds"]].tolist() == pytest.approx([ours, theirs])

    def least(self, rows, friction, value, uncertainty, code):
        """Time of a code to an error of 1e-8 that no finer mesh contradicts; of those that one confirms, if any."""
        found = [(True, float("inf"))]
        for name in (name for name, model in models.NAMED.items() if model.code == code):
            curve = [row for row in rows if (row.case["model"], row.case["friction"]) == (name, friction)]
            errors = {row.case["number"]: abs((row.result["half_force"] or 0.0) / value - 1.0) for row in curve}
            for row in curve:
                worst = max(error for number, error in errors.items() if number >= row.case["number"])
                if worst + uncertainty / value <= 1e-8:
                    sums = map(sum, zip(row.result["setup"], row.result["solve"], strict=True))
                    found.append((row.case["number"] == max(errors), min(sums)))
        return min(found)[1]


@posix
@pytest.mark.usefixtures("outlined")
class TestFailures:
    """Codes that crash, hang, or talk nonsense are rows with the reason."""

    @pytest.mark.parametrize(
        ("does", "reason"),
        [
            ("echo no libgetfem.so.5 >&2; exit 3", "ended with status 3: no libgetfem.so.5"),
            ("kill -SEGV $$", "ended with status -11: no message"),
            ("cat >/dev/null; echo hello", "Expecting value"),
            ('[ -n "$PYTHONPATH" ] && echo "finds this project" >&2; exit 1', "status 1: no message"),
        ],
    )
    def test_the_reason_is_told(self, tmp_path, monkeypatch, does, reason):
        monkeypatch.setenv(study.GETFEM, other_python(tmp_path, does))
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        with pytest.raises((study.ProcessError, ValueError), match=reason) as caught:
            study.run({"model": "GetFEM, Q2, uniform", "friction": 0.2, "number": 4, "repetitions": 1})
        assert str(tmp_path) not in str(caught.value)

    def test_a_code_that_hangs_is_a_row_that_is_shown_and_not_drawn(self, tmp_path):
        words = ["peers", "--friction", "0.2", "--cells", "4", "--timeout", "0.5", "--out", str(tmp_path / "out")]
        words += ["--getfem", other_python(tmp_path, "sleep 60"), "--store", str(tmp_path / "a.sqlite")]
        with pytest.MonkeyPatch.context() as patch:
            chosen(patch, "GetFEM, Q2, uniform")
            patch.setenv(study.GETFEM, "")
            done = CliRunner().invoke(group, words, catch_exceptions=False)
        assert done.exit_code == 0
        (found,) = runs_of(read_study(tmp_path / "a.sqlite").rows).itertuples()
        assert (found.status, found.message, np.isnan(found.half_force)) == ("timeout", "more than 0.5 s", True)
        page = (tmp_path / "out" / "peers.html").read_text(encoding="utf-8")
        assert "timeout" in page
        assert str(tmp_path) not in page
        assert not list((tmp_path / "out").glob("*.svg"))
        assert not commands_with(tmp_path)

    @pytest.mark.parametrize("module", ["ngsolve_nitsche", "equilibrium"])
    def test_exceptions_are_told(self, module):
        found = process.repeated(import_module(f"comparisons.peers.codes.{module}"), **EMPTY)
        assert found["status"] == "error"
        assert found["message"].startswith("KeyError: ") or find_spec("ngsolve") is None

    def test_what_a_library_prints_is_not_the_answer(self):
        found = study.answer_of({"module": "this", **EMPTY}, "equilibrium")  # it prints when imported
        assert found["status"] == "error"
        assert found["message"].startswith("AttributeError")


def commands_with(folder):
    """Commands of the running processes that name a folder, as far as /proc tells."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            found.append(path.read_bytes())
    return [command for command in found if bytes(folder) in command]


def other_python(folder, does):
    """A program that says it has any module, and then does this instead of the work."""
    path = folder / "python-with-getfem"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{does}\n', encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def row(model, number, friction=0.2, status="done", reason="", result=None):
    """A row of the study, made up."""
    case = {"friction": friction, "model": model, "number": number, "repetitions": 1, "repeat": 0, "seed": 0}
    environment = {"machine": None, "versions": {}, "threads": 1, "timeout_seconds": None, "memory_mib": None}
    return Row(0, "", case, status, reason, result or {}, None, 1.0, "", None, environment)


def solution(model, number, half_force, seconds, friction=0.2, **more):
    """A row with a solution, made up; unknowns are the square of the mesh's number."""
    costs = {"unknowns": number**2, "setup": [0.0], "solve": [seconds], "before": 2**26, "peak": 2**27}
    answer = {"status": "solved", "message": "", "half_force": half_force, "residual": 1e-9, "iterations": 1}
    return row(model, number, friction, result={**answer, **costs, **more})


def bracketed(lower, upper, friction=1.0, guaranteed=True, cells=8):
    """A row with a bracket, made up."""
    kind = BracketKind.STICKING if guaranteed else BracketKind.GIVEN_BOUND
    bounds = {"lower": lower, "upper": upper}  # numbers that are no bounds must not be taken for such
    more = {"width": (upper - lower) / (upper + lower), "strain_error": 0.01, "guaranteed": guaranteed}
    return solution("bracket, p = 3, graded", cells, None, 0.1, friction, kind=kind.name, **bounds, **more)


def costs(*rows):
    return costs_of(runs_of(rows))


def told(*rows):
    """The numbers of the findings."""
    runs = runs_of(rows)
    return values_of(runs, costs_of(runs))


def tabled(name, *rows, columns):
    """These columns of a table of the report as texts."""
    runs = runs_of(rows)
    return grid_of(tables_of(runs, costs_of(runs), known_of(runs))[name], columns, FORMS).rows


@pytest.mark.usefixtures("outlined")
class TestReach:
    """What an error costs each code."""

    OURS, THEIRS, OTHERS = "triangles, p = 4, bisected", "NGSolve, p = 3, symmetric, bisected", "GetFEM, Q2, uniform"

    def near(self, model, number, error, seconds):
        return solution(model, number, LIMIT[0.2] * (1.0 + error), seconds)

    def test_the_quickest_and_the_smallest_of_each_code(self):
        rows = [self.near(self.OURS, 3, 2e-6, 0.02), self.near(self.OURS, 4, 1e-7, 0.01)]
        rows += [self.near(self.THEIRS, 5, 2e-6, 0.04), self.near(self.OTHERS, 4, 2e-6, 0.05)]
        found = costs(*rows)
        ours = found[found.code == models.TRIANGLES].set_index("target")
        assert ours.loc[3e-6, ["quickest", "smallest"]].tolist() == 2 * [f"{self.OURS}, level 3"]  # it is confirmed
        assert set(ours.index) == set(TARGETS[:4])
        compared = compared_of(found).set_index("target")
        assert compared.loc[3e-6, ["code", "smallest_code"]].tolist() == ["ngsolve", "getfem"]
        assert compared.time_ratio[3e-6] == pytest.approx(2.0)
        assert compared.unknowns_ratio[3e-6] == pytest.approx(16 / 9)
        assert 1e-7 not in compared.index

    def test_an_error_is_reached_with_the_uncertainty_of_the_reference(self):
        for share, there in ((0.98, True), (1.02, False)):
            found = costs(self.near(self.OTHERS, 8, 1e-8 * share - FLOOR, 0.1))
            assert (1e-8 in set(found.target)) == there

    def test_an_error_that_a_finer_mesh_does_not_confirm_is_chance(self):
        rows = [self.near(self.OTHERS, 4, 1e-7, 0.01), self.near(self.OTHERS, 8, 1e-5, 0.02)]
        first, last = runs_of(rows).itertuples()
        assert first.lasting == last.error == last.lasting > first.error
        assert costs(*rows).target.tolist() == [1e-4, 2e-5]
        assert costs(rows[0], self.near(self.OTHERS, 8, 1e-3, 0.02)).empty

    def test_a_finer_mesh_that_fails_confirms_nothing(self):
        rows = [solution("GetFEM, Q2, graded", 8, 214.23325, 0.01)]
        rows += [row("GetFEM, Q2, graded", 16, status="crashed", reason="signal 11")]
        last = solution("GetFEM, Q2, graded", 32, 214.23325, 5.0)
        assert not costs(*rows).sure.any()
        assert told(*rows)["chance"] == ["GetFEM, Q2, graded, 8² cells"]
        assert costs(*rows, last).sure.all()
        assert told(*rows, last)["chance"] == []

    def test_what_is_confirmed_comes_first(self):
        rows = [solution("GetFEM, Q2, graded", 8, 214.23325, 0.01)]
        rows += [solution("GetFEM, Q2, uniform", cells, 214.23325, 0.05) for cells in (8, 16)]
        assert set(costs(*rows).quickest) == {"GetFEM, Q2, uniform, 8² cells"}

    def test_the_table_has_times_unknowns_and_what_they_are_over_those_of_triangles(self):
        rows = [self.near(self.OURS, n, 2e-6, 0.02) for n in (4, 5)] + [self.near(self.OTHERS, 8, 2e-6, 0.05)]
        columns = ("target", "code", "seconds", "time_ratio", "quickest", "unknowns", "unknowns_ratio", "smallest")
        lines = {line[:2]: line[2:] for line in tabled("costs-mu-0_2", *rows, columns=columns)}
        assert lines["3e-6", "this package on triangles"][:2] == ("20 ms", "1")
        named = "GetFEM, Q2, uniform, 8² cells"
        assert lines["3e-6", "GetFEM"] == ("50 ms", "2.5", named, "64", "4", named)
        assert ("1e-6", "GetFEM") not in lines


@pytest.mark.usefixtures("outlined")
class TestFindings:
    """The numbers of the sentences."""

    def test_costs(self):
        ours, theirs = "triangles, p = 4, bisected", "NGSolve, p = 3, symmetric, bisected"
        rows = [solution(ours, number, LIMIT[0.2] * (1.0 + 5e-7), 0.02) for number in (4, 5)]
        rows += [solution(theirs, number, LIMIT[0.2] * (1.0 - 5e-7), 0.05) for number in (5, 6)]
        cost = {"own": "20 ms", "ratios": "2.5", "unknowns": "1.6"}
        values = told(*rows)
        assert (values["fine"], values["coarse"]) == ({"target": 1e-6, **cost}, {"target": 3e-6, **cost})

    def test_the_narrowest_interval_and_what_is_outside(self):
        rows = [bracketed(214.3676, 214.3677), bracketed(214.36, 214.38)]
        rows += [solution("GetFEM, Q2, uniform", n, force, 0.1, 1.0) for n, force in ((8, 214.36765), (16, 214.3679))]
        rows += [row("GetFEM, Q2, uniform", 32, 1.0, status="crashed", reason="signal 11")]
        (found,) = intervals_of(runs_of(rows)).itertuples()
        assert (found.low, found.high) == pytest.approx((214.3676, 214.3677), abs=5e-6)
        assert (found.getfem, found.ngsolve) == ("1 of 2", "0 of 0")
        assert intervals_of(runs_of(rows[2:])).empty

    def test_beside_an_interval_stands_the_best_force_of_no_more_unknowns(self):
        rows = [bracketed(214.3, 214.4, cells=7), bracketed(214.367, 214.368)]  # 49 and 64 unknowns
        forces = {4: LIMIT[1.0] + 1e-3, 6: LIMIT[1.0] + 2e-3, 8: LIMIT[1.0] + 5e-4, 16: LIMIT[1.0]}
        rows += [solution("GetFEM, Q2, uniform", n, force, 0.1, 1.0) for n, force in forces.items()]
        found = beside_of(runs_of(rows))
        assert found.getfem.tolist() == pytest.approx([forces[4], forces[8]])
        assert found.ngsolve.isna().all()
        wide, narrow = tabled("beside-mu-1", *rows, columns=("ngsolve", "getfem"))
        assert wide == (NOTHING, f"{forces[4]:.7f}")
        assert narrow == (NOTHING, f"{forces[8]:.7f}, outside")

    def test_costs_of_one_code_alone_are_not_compared(self):
        values = told(*(solution("GetFEM, Q2, uniform", cells, 214.233, 0.2) for cells in (8, 16)))
        assert (values["fine"], values["coarse"], values["triangles"]) == (None, None, None)

    def test_rectangles_beside_triangles(self):
        rows = [solution("rectangles, graded", n, LIMIT[0.2] * (1.0 - 1e-4 / n), 0.1) for n in (8, 16)]
        rows += [solution("triangles, p = 4, bisected", n, LIMIT[0.2] * (1.0 - 1e-6 / n), 0.1) for n in (4, 5)]
        values = told(*rows)
        assert values["rectangles"] == "1.2e-5"
        assert values["triangles"] == pytest.approx(2.5e-7, rel=1e-3)

    def test_guaranteed_bounds_are_widened_by_what_the_solves_hold_to(self):
        (found,) = told(bracketed(214.3677, 214.3678), bracketed(214.2, 214.4))["bounds"]
        assert (found["low"], found["high"]) == pytest.approx((214.3676979, 214.3678021), abs=5e-8)

    def test_bounds_that_contradict_each_other_are_not_used(self):
        runs = runs_of([bracketed(214.367650, 214.367655), bracketed(214.367670, 214.367675)])
        assert contradictory(runs)
        assert reference(runs, 1.0).value == LIMIT[1.0]
        values = values_of(runs, costs_of(runs))
        assert (values["bounds"], values["doubtful"]) == ([], [{"friction": 1.0, "count": 2}])

    def test_an_indicator_is_no_bound(self):
        rows = [bracketed(214.1, 214.3, 0.2, guaranteed=False), solution("rectangles, graded", 8, 214.2, 0.1)]
        assert told(*rows)["bounds"] == []

    def test_failures_are_counted_and_told(self, monkeypatch):
        monkeypatch.setattr(drawing, "has_matplotlib", lambda: False)
        result = {"status": "not converged", "message": "residual 1e-3", "half_force": 214.2, "residual": float("inf")}
        rows = [row("GetFEM, Q2, strips", n, result=result) for n in (1, 2)]
        rows += [row("GetFEM, Q2, strips", 3, status="crashed", reason="signal 11")]
        rows += [solution("rectangles, graded", 8, 214.2, 0.1)]
        runs, values, lines = runs_of(rows), told(*rows), tabled("failures", *rows, columns=("status", "message"))
        assert (values["runs"], values["solved"], values["failing"]) == (4, 1, "3 of GetFEM")
        assert lines[1:] == [("not converged", "residual 1e-3"), ("crashed", "signal 11")]
        assert runs.error[~runs.solved].isna().all()
        json.dumps(finite_json(document_of(rows, report(rows))), allow_nan=False)

    def test_without_any_known_value(self):
        made = report([solution("GetFEM, Q2, uniform", 8, 214.4, 0.1, 0.12)])
        assert "No value of P/2 is known" in made.text
        assert made.pictures == {}


class TestReference:
    """What errors are relative to."""

    NONE = runs_of([solution("GetFEM, Q2, uniform", 8, 214.4, 0.1)])

    def test_limits_and_what_codes_settle_on(self):
        assert reference(self.NONE, 0.2)[:2] == LIMITS[0.2]
        assert reference(self.NONE, 0.4).value == LIMIT[1.0]
        assert reference(self.NONE, 0.15)[:2] == (SETTLED[0.15], UNCERTAINTY)
        assert reference(self.NONE, 0.12) is None

    def test_limits_are_those_that_codes_settle_on(self):
        assert all(abs(value - SETTLED[friction]) < UNCERTAINTY for friction, value in LIMIT.items())

    def test_guaranteed_bounds_if_nothing_narrower_is_known(self):
        wide, narrow = bracketed(214.3, 214.4, 0.12), bracketed(214.36765, 214.36766, 0.12)
        known = reference(runs_of([wide, narrow]), 0.12)
        assert known.value == pytest.approx(214.367655, abs=1e-9)
        assert known.uncertainty == pytest.approx(5e-6 + RESOLUTION * known.value)
        assert "guaranteed bounds of bracket, p = 3, graded, 8² cells" in known.source
        assert reference(runs_of([bracketed(214.2, 214.21, 0.12, False)]), 0.12) is None
        assert reference(runs_of([bracketed(214.36765, 214.36766)]), 1.0).value == LIMIT[1.0]

    def test_nothing_below_the_tolerance_is_resolved(self):
        assert reference(runs_of([bracketed(209.0, 209.0 + 1e-12, 0.0)]), 0.0).floor >= RESOLUTION

    @pytest.mark.parametrize("guaranteed", [True, False])
    def test_inverted_bounds_are_a_failure(self, guaranteed):
        rows = [bracketed(214.3678, 214.3677, 1.0, guaranteed), bracketed(214.3, 214.4, 1.0, guaranteed)]
        runs = runs_of(rows)
        inverted, right = runs.itertuples()
        assert (inverted.status, inverted.solved, right.solved) == ("inverted", False, True)
        assert "half width -2.3e-7" in inverted.message
        assert reference(runs, 1.0).value == LIMIT[1.0]
        assert told(*rows)["failing"] == "1 of the bracket"
        assert tabled("brackets-mu-1", *rows, columns=("status",))[0] == ("inverted",)

    def test_rounding_inverts_nothing(self):
        runs = runs_of([bracketed(209.0 + 1e-6, 209.0, 0.0)])
        assert runs.solved.all()
        assert reference(runs, 0.0).uncertainty > 0.0


def test_errors_below_the_uncertainty_are_shown_as_such():
    here = solution("rectangles, graded", 8, LIMIT[0.2] * (1.0 + 5e-10), 0.1)
    assert tabled("rows-mu-0_2", here, columns=("shown",)) == [
        ("≤ 1.4e-9",)
    ]  # with the uncertainty of the value itself


DRAWN = (
    solution("rectangles, graded", 8, 214.365, 0.1, 1.0),
    solution("GetFEM, Q2, strips", 3, 214.347, 0.1, 1.0),
    row("GetFEM, Q2, graded", 8, 1.0, status="crashed", reason="signal 11"),
    bracketed(214.365, 214.368),
    bracketed(214.1, 214.3, 0.2, guaranteed=False),
    solution("rectangles, graded", 8, 214.2, 0.1),
)


@pytest.fixture(scope="module")
def plots():
    """Name of a picture → what draws it."""
    runs = runs_of(DRAWN)
    return figures.plots_of(runs, known_of(runs))


@pytest.fixture(scope="module")
def pictures(plots):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "svg_text", outline)
        return {name: drawing.drawn(name, draw) for name, draw in plots.items()}


@pytest.mark.skipif(not has_matplotlib(), reason="matplotlib is not installed")
class TestFigures:
    """What is drawn; a picture's texts are in it as texts."""

    BRACKET = "bracket, p = 3, graded"

    def labels(self, svg):
        names = ("rectangles, graded", "GetFEM, Q2, strips", "GetFEM, Q2, graded", f"{self.BRACKET}: guaranteed")
        return [name for name in names if f">{name}<" in svg]

    def test_errors_have_a_curve_for_each_model_that_was_solved(self, pictures):
        errors = {f"{kind}-{cost.name}-mu-{mu}" for kind in ("best", "error") for cost in COSTS for mu in ("1", "0_2")}
        assert set(pictures) == {"bounds-mu-0_2", "bounds-mu-1", "intervals-mu-1"} | errors
        svg = pictures["error-time-mu-1"]
        assert self.labels(svg) == ["rectangles, graded", "GetFEM, Q2, strips", f"{self.BRACKET}: guaranteed"]
        for text in ("equal cells, or graded to the free corner", "graded to corner and transition", COSTS[1].label):
            assert f">{text}<" in svg

    def test_an_indicator_is_no_error(self, pictures):
        assert self.labels(pictures["error-unknowns-mu-0_2"]) == ["rectangles, graded"]

    def test_the_best_of_each_code_has_its_name(self, pictures):
        svg = pictures["best-unknowns-mu-1"]
        names = [code.name for code in models.CODES.values() if f">{code.name}<" in svg]
        assert names == ["this package on rectangles", "GetFEM"]

    def test_a_run_is_drawn_at_its_cost_and_error(self):
        runs = runs_of([DRAWN[0], bracketed(214.365, 214.368)])
        assert runs.loc[0, [cost.column for cost in COSTS]].tolist() == [64, 0.1]
        expected = [abs(214.365 / LIMIT[1.0] - 1.0), 0.0015 / 214.3665]
        assert figures.heights(runs).tolist() == pytest.approx(expected)

    def test_marks_that_are_not_resolved_stand_at_one_height(self):
        rows = [solution("rectangles, graded", n, LIMIT[0.2] * (1.0 + n * 1e-11), 0.1) for n in (8, 16)]
        (height,) = set(figures.heights(runs_of(rows)))
        assert FLOOR / 10.0 < height < FLOOR

    @pytest.mark.parametrize("last", [(213.9, 214.5), (214.36, 214.37)])
    def test_all_bars_and_marks_are_inside_the_picture_of_bounds(self, last):
        runs = runs_of([bracketed(*last), *DRAWN[:3], bracketed(214.365, 214.368)])
        known = reference(runs, 1.0)
        bottom, top = figures.limits(runs[runs.mesh == "graded"], known)
        ends = [end / known.value - 1.0 for end in (*last, 214.365, 214.368)]
        assert bottom < min(ends) < max(ends) < top
        ticks = figures.ticks(bottom, top, known.floor)
        assert bottom <= min(ticks) < 0.0 < max(ticks) <= top

    @pytest.mark.parametrize("name", ["error-time-mu-1", "bounds-mu-1"])
    def test_a_picture_has_room_for_panels_and_legends(self, plots, name):
        assert drawing.drawn(name, plots[name]).count(">rectangles, graded<") == 1

    def test_bounds_are_bars_and_an_indicator_is_named_so(self, pictures, monkeypatch):
        assert self.labels(pictures["bounds-mu-1"]) == ["rectangles, graded", f"{self.BRACKET}: guaranteed"]
        assert f">{self.BRACKET}: indicator<" in pictures["bounds-mu-0_2"]
        assert "guaranteed<" not in pictures["bounds-mu-0_2"]
        monkeypatch.setattr(figures, "drawn", lambda *_: "drawn")
        text = report(DRAWN).text
        assert "![Guaranteed bounds of P/2, μ = 1]" in text
        assert "![Indicator of the bracket, μ = 0.2]" in text


def test_models_can_be_told_apart_and_their_codes_exist():
    assert len(models.NAMED) == len(models.MODELS)
    for graded in (False, True):
        here = [model for model in models.MODELS if model.family.to_transition == graded]
        looks = [(model.colour, model.marker) for model in here]
        assert len(set(looks)) == len(looks)
    for model in models.MODELS:
        assert callable(import_module(f"comparisons.peers.codes.{models.CODES[model.code].module}").build)


class TestMeshes:
    """Families of meshes."""

    @pytest.mark.parametrize("friction", [*meshes.TRANSITIONS, 1.0])
    @pytest.mark.parametrize("name", [name for name, family in meshes.FAMILIES.items() if not family.own])
    def test_members_fill_the_plate_and_get_finer(self, name, friction):
        counts = []
        for number in (2, 3) if meshes.FAMILIES[name].counted else (0, LEVELS - 1):
            mesh = meshes.plain_mesh(name, friction, number)
            corners = np.array(mesh["vertices"])[np.array(mesh["cells"])]
            x, y = np.moveaxis(corners, 2, 0)
            area = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
            assert area.min() > 0.0
            assert area.sum() == pytest.approx(1.0)
            edges = [np.array(mesh["vertices"])[np.array(mesh["sides"][side])] for side in ("left", "top")]
            assert [np.abs(np.diff(ends, axis=1)).sum() for ends in edges] == pytest.approx([1.0, 1.0])
            assert (mesh["lines"] is None) == meshes.FAMILIES[name].triangles
            counts.append(len(corners))
        assert counts[0] < counts[1]

    @pytest.mark.parametrize(("friction", "transition"), meshes.TRANSITIONS.items())
    @pytest.mark.parametrize("name", ["strips", "narrow strips", "bisected"])
    def test_the_smallest_cells_are_at_corner_and_transition(self, name, friction, transition):
        mesh = meshes.plain_mesh(name, friction, LEVELS - 1)
        vertices = np.array(mesh["vertices"])
        tops = np.sort(vertices[vertices[:, 1] == 1.0, 0])
        lengths = np.diff(tops)
        near = lengths[(tops[:-1] <= transition + 1e-12) & (tops[1:] >= transition - 1e-12)]
        assert near.max() < 0.06
        assert max(near.max(), lengths[-1]) < lengths.max() / 4.0

    def test_a_triangle_mesh_is_solved_as_the_package_solves_it(self):
        found = equilibrium.build(study.plate(0.2, "cut squares", 2), degree=3)()
        expected = solve(compressed_plate(0.2).triangulated(), degree=3)
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
        assert found["unknowns"] == expected.solution.problem.n


def test_all_codes_get_the_plate_of_the_gallery():
    problem = compressed_plate(0.2, cells=(6, 6), grading=meshes.ratio(6))
    case = study.plate(0.2, "graded", 6)
    assert case["lines"] == [problem.mesh.x.tolist(), problem.mesh.y.tolist()]
    assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)
    json.dumps(case, allow_nan=False)


def test_the_scripts_load_no_peer_and_nothing_of_the_project():
    names = ("getfem", "ngsolve", "qvi_contact", "comparisons")
    look = (
        "import sys; sys.path.insert(0, sys.argv[1]); import getfem_bricks, process, ngsolve_nitsche; "
        f"print([name for name in sys.modules if name.split('.')[0] in {names}])"
    )
    folder = str(Path(process.__file__).parent)
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
        (("--levels", "0"), "levels"),
        (("--levels", str(LEVELS + 1)), "levels"),
        (("--getfem", "/nowhere/python3"), "getfem"),
        (("--threads", "2"), "threads"),
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


def test_the_study_has_all_models_whose_code_is_installed(monkeypatch):
    monkeypatch.delenv(study.GETFEM, raising=False)
    monkeypatch.setattr(study, "find_spec", lambda name: None if name in ("getfem", "ngsolve") else name)
    assert study.missing_codes() == ("ngsolve", "getfem")
    declared = study.peers_study((1.0, 0.2, 1.0), (16, 8), 3, levels=2)
    assert declared.factors["friction"] == (1.0, 0.2)
    assert declared.factors["number"] == (0, 1, 8, 16)
    own = {models.TRIANGLES, models.EQUILIBRIUM, models.COMPANION, models.BRACKET}
    assert {models.NAMED[name].code for name in declared.factors["model"]} == own
    numbers = {model: {case.values["number"] for case in declared.cases if case.values["model"] == model}
               for model in declared.factors["model"]}  # fmt: skip
    assert all(found == ({8, 16} if models.NAMED[name].family.counted else {0, 1}) for name, found in numbers.items())
    assert len(declared.cases) == 2 * 2 * len(declared.factors["model"])
    assert models.CODES["ngsolve"].remedy == "python -m pip install 'qvi-contact[peers]'"
