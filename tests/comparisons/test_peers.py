"""Displacement codes beside this package: what they find, on which meshes, and what becomes of those that fail."""

import json
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from comparisons import LIMITS, SETTLED, UNCERTAINTY
from comparisons import peers as room
from comparisons.lab.studies import Study, run_study
from comparisons.peers import pin_report, plate
from qvi_contact import InputError, TriangleMesh, graded_lines, solve
from qvi_contact.bracket import BracketKind
from qvi_contact.gallery import compressed_plate
from tests.comparisons.conftest import texts_of
from tests.comparisons.parts import committed, row

CODES_FOLDER = Path(import_module("comparisons.peers.codes").__file__).parent
LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
CHOSEN = ("triangles, p = 3, bisected", "NGSolve, p = 2, symmetric, uniform")
FLOOR = LIMITS[0.2][1] / LIMIT[0.2]
MOVED = {0.0: 0.758518, 0.1: 0.738677}
"""u_x [mm] of the sheet on the axis, by NGSolve with degree 4 on twice as many edges."""

with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
posix = pytest.mark.skipif(os.name != "posix", reason="the other Python is a shell script here")


def solved(code, case, **options):
    """What a code, a key of `CODES`, answers in this process."""
    return import_module(f"comparisons.peers.codes.{room.CODES[code].module}").plate(case, **options)()


def nitsche(friction, number, order=2, variant="symmetric", mesh="uniform"):
    return solved("ngsolve", plate(friction, mesh, number), order=order, variant=variant)


@with_ngsolve
class TestNitsche:
    """NGSolve's script."""

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23746), (16, 214.23420)])
    def test_expected_forces(self, cells, expected):
        found = nitsche(0.2, cells, variant="incomplete")
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected, abs=6e-6)
        assert found["unknowns"] == 2 * (2 * cells + 1) ** 2 - 2 * (2 * cells + 1)

    @pytest.mark.parametrize("variant", ["symmetric", "incomplete", "skew"])
    @pytest.mark.parametrize("order", [2, 3])
    def test_variants_settle_on_the_same_value(self, variant, order):
        coarse, fine = (nitsche(0.2, cells, order, variant)["half_force"] - SETTLED[0.2] for cells in (4, 8))
        assert abs(fine) < min({2: 6e-3, 3: 5e-4}[order], abs(coarse) / 2.0)
        assert nitsche(0.0, 3, order, variant, "graded")["half_force"] == pytest.approx(209.0, rel=1e-10)

    def test_graded_meshes(self):
        """Full stick; and slip, in so few steps of Newton's method as only its line search lets it take."""
        assert nitsche(1.0, 12, 3, mesh="graded")["half_force"] == pytest.approx(SETTLED[1.0], abs=1e-4)
        found = nitsche(0.2, 12, mesh="graded")
        assert (found["status"], found["residual"] <= 1e-8, found["iterations"] <= 15) == ("solved", True, True)

    def test_each_solve_starts_from_zero(self):
        solve = import_module("comparisons.peers.codes.with_ngsolve").plate(plate(0.2, "uniform", 4))
        assert solve() == solve()


@cache
def python_with_getfem():
    """A Python that finds GetFEM: this one, that of the environment variable, or the system's; None if none does."""
    for name in filter(None, (os.environ.get(room.GETFEM), sys.executable, shutil.which("python3", path="/usr/bin"))):
        with pytest.MonkeyPatch.context() as patch, suppress(InputError):
            patch.setenv(room.GETFEM, name)
            room.missing_codes()
            return name
    return None


@pytest.mark.skipif(python_with_getfem() is None, reason="GetFEM is not installed")
@pytest.mark.parametrize(
    ("family", "cells", "expected"), [("uniform", 8, 214.23508), ("uniform", 16, 214.23389), ("graded", 24, None)]
)
def test_getfem(family, cells, expected, monkeypatch):
    """A mesh whose nodes it merges is not solved."""
    monkeypatch.setenv(room.GETFEM, python_with_getfem())
    answer = room.run({"friction": 0.2, "repetitions": 1, "model": f"GetFEM, Q2, {family}", "number": cells})
    if expected is None:
        assert (answer["status"], "4732 of 4802" in answer["message"]) == ("error", True)
        return
    assert (answer["status"], answer["before"] <= answer["peak"]) == ("solved", True)
    assert answer["half_force"] == pytest.approx(expected, abs=6e-6)


class TestOwnModels:
    """What this package's own codes answer."""

    def test_the_bracket_on_triangles_bounds_the_force_under_friction(self):
        case = plate(0.1, "bisected", 0)
        found = solved(room.BRACKET, case, degree=4, bracket=4)
        assert (found["status"], found["guaranteed"], found["kind"]) == ("solved", True, "COULOMB")
        assert found["lower"] < LIMIT[0.1] < found["upper"]
        assert found["width"] == pytest.approx((found["upper"] - found["lower"]) / (found["upper"] + found["lower"]))
        stress = solve(on_the_mesh(case), degree=4, tolerance=1e-8)
        assert found["strain_error"] == pytest.approx(stress.bracket.relative_error, rel=1e-6)
        assert found["unknowns"] == stress.solution.problem.n + stress.bracket.companion.space.size

    @pytest.mark.parametrize(("number", "width"), [(0, 10.0**-2.5), (1, 1e-3)])
    def test_adaptive_meshes_give_bounds_as_close_as_their_number_asks_for(self, number, width):
        found = solved(room.BRACKET, plate(0.05, "adaptive", number), degree=5, adaptive=True)
        assert (found["status"], found["guaranteed"]) == ("solved", True)
        assert found["lower"] < LIMIT[0.05] < found["upper"]
        assert 0.0 < found["width"] <= width
        assert len(plate(0.05, "adaptive", number)["cells"]) == 2


def on_the_mesh(case):
    """The gallery's plate on the triangles of a case."""
    return replace(
        compressed_plate(case["friction"]), mesh=TriangleMesh(case["vertices"], case["cells"], case["sides"])
    )


def test_rows_are_certified_solves_with_times_a_memory_and_an_error_of_their_own():
    """One real run, two models on one mesh, each in a process of its own."""
    missing, number = room.missing_codes(), {True: 8, False: 0}
    chosen = {name: room.MODELS[name] for name in CHOSEN if room.MODELS[name].code not in missing}
    cases = [
        {"friction": 1.0, "model": name, "number": number[model.family.counted], "repetitions": 2}
        for name, model in chosen.items()
    ]
    runs = room.runs_of([row(case, room.run(case)) for case in cases])
    own = runs[runs.code == room.TRIANGLES].iloc[0]
    expected = solve(on_the_mesh(plate(1.0, "bisected", 0)), degree=3)
    assert own.half_force == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
    assert own.unknowns == expected.solution.problem.n
    assert own.residual < 1e-8
    for run in runs.itertuples():
        whole = [sum(pair) for pair in zip(run.setup, run.solve, strict=True)]
        assert (len(whole), run.seconds) == (2, min(whole))
        assert min(run.setup + run.solve) > 0.0
        assert 2**24 < run.before <= run.peak < 2**30
        assert run.error == pytest.approx(abs(run.half_force / LIMIT[1.0] - 1.0))
        assert run.error > 1e-6
    assert runs.before.nunique() == len(runs)


def other_python(folder, does):
    """A program that says it has any module, and then does this instead of the work."""
    path = folder / "python-with-getfem"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{does}\n', encoding="utf-8")
    path.chmod(0o755)
    return str(path)


def commands_with(folder):
    """Commands of the running processes that name a folder, as far as /proc tells."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            found.append(path.read_bytes())
    return [command for command in found if bytes(folder) in command]


class TestFailures:
    """Codes that crash, hang, or talk nonsense are rows with the reason."""

    CASE = {"model": "GetFEM, Q2, uniform", "friction": 0.2, "number": 4, "repetitions": 1}  # noqa: RUF012
    EMPTY = {"case": {}, "warm_up": {}, "options": {}, "repetitions": 1}  # noqa: RUF012

    @posix
    @pytest.mark.parametrize(
        ("does", "reason"),
        [
            ("echo no libgetfem.so.5 >&2; exit 3", "status 3: no libgetfem.so.5"),
            ("kill -SEGV $$", "status -11: no message"),
            ("cat >/dev/null; echo hello", "Expecting value"),
            ('[ -n "$PYTHONPATH" ] && echo "finds this project" >&2; exit 1', "status 1: no message"),
        ],
    )
    def test_the_reason_is_told(self, tmp_path, monkeypatch, does, reason):
        monkeypatch.setenv(room.GETFEM, other_python(tmp_path, does))
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        with pytest.raises((room.ProcessError, ValueError), match=reason) as caught:
            room.run(self.CASE)
        assert str(tmp_path) not in str(caught.value)

    @posix
    def test_a_code_that_hangs_is_a_row_and_ended(self, tmp_path, monkeypatch):
        monkeypatch.setenv(room.GETFEM, other_python(tmp_path, "sleep 60"))
        study = Study("peers", 2, "comparisons.peers.study:run", [self.CASE])
        rows = run_study(study, tmp_path / "a.sqlite", timeout=0.5)
        (found,) = room.runs_of(rows).itertuples()
        assert (found.status, found.message, np.isnan(found.half_force)) == ("timeout", "more than 0.5 s", True)
        made = room.report.report(rows)
        assert ("timeout" in made.text, str(tmp_path) in made.text, made.pictures) == (True, False, {})
        assert not commands_with(tmp_path)

    @pytest.mark.parametrize("code", ["ngsolve", room.TRIANGLES])
    def test_exceptions_are_told(self, code):
        process = import_module("comparisons.peers.codes.process")
        module = import_module(f"comparisons.peers.codes.{room.CODES[code].module}")
        found = process.repeated(module.plate, **self.EMPTY)
        assert found["status"] == "error"
        assert found["message"].startswith("KeyError: ") or find_spec("ngsolve") is None

    def test_what_a_library_prints_is_not_the_answer(self):
        found = room.answer_of({"module": "this", "problem": "__doc__", **self.EMPTY}, "own")  # it prints when imported
        assert (found["status"], found["message"].split(":")[0]) == ("error", "TypeError")

    @posix
    def test_another_python_without_the_library_is_refused(self, tmp_path, monkeypatch):
        path = tmp_path / "python"
        path.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
        path.chmod(0o755)
        monkeypatch.setenv(room.GETFEM, str(path))
        with pytest.raises(InputError) as caught:
            room.missing_codes()
        assert caught.value.field == "getfem"


class TestMeshes:
    """Families of meshes."""

    @pytest.mark.parametrize("friction", [*room.TRANSITIONS, 1.0])
    @pytest.mark.parametrize("name", [name for name, family in room.FAMILIES.items() if not family.own])
    def test_members_fill_the_plate_and_get_finer(self, name, friction):
        counts = []
        for number in (2, 3) if room.FAMILIES[name].counted else (0, room.LEVELS - 1):
            mesh = room.plain_mesh(name, friction, number)
            corners = np.array(mesh["vertices"])[np.array(mesh["cells"])]
            x, y = np.moveaxis(corners, 2, 0)
            area = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
            assert area.min() > 0.0
            assert area.sum() == pytest.approx(1.0)
            edges = [np.array(mesh["vertices"])[np.array(mesh["sides"][side])] for side in ("left", "top")]
            assert [np.abs(np.diff(ends, axis=1)).sum() for ends in edges] == pytest.approx([1.0, 1.0])
            assert (mesh["lines"] is None) == room.FAMILIES[name].triangles
            counts.append(len(corners))
        assert counts[0] < counts[1]

    @pytest.mark.parametrize(("friction", "transition"), room.TRANSITIONS.items())
    @pytest.mark.parametrize("name", ["strips", "narrow strips", "bisected"])
    def test_the_smallest_cells_are_at_corner_and_transition(self, name, friction, transition):
        vertices = np.array(room.plain_mesh(name, friction, room.LEVELS - 1)["vertices"])
        tops = np.sort(vertices[vertices[:, 1] == 1.0, 0])
        lengths = np.diff(tops)
        near = lengths[(tops[:-1] <= transition + 1e-12) & (tops[1:] >= transition - 1e-12)]
        assert near.max() < 0.06
        assert max(near.max(), lengths[-1]) < lengths.max() / 4.0

    def test_all_codes_get_the_plate_of_the_gallery(self):
        lines, case = graded_lines(0.0, 1.0, 6, room.ratio(6)).tolist(), plate(0.2, "graded", 6)
        assert case["lines"] == [lines, lines]
        assert len(case["vertices"]) == 49
        assert len(case["cells"]) == 36
        assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)
        json.dumps(case, allow_nan=False)


class TestStudy:
    """Models, codes and cases."""

    def test_the_scripts_load_no_peer_and_nothing_of_the_project(self):
        names = ("getfem", "ngsolve", "qvi_contact", "comparisons")
        look = (
            "import sys; sys.path.insert(0, sys.argv[1]); import process, with_getfem, with_ngsolve; "
            f"print([name for name in sys.modules if name.split('.')[0] in {names}])"
        )
        words = [sys.executable, "-I", "-c", look, str(CODES_FOLDER)]
        assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == "[]"

    def test_it_has_all_models_whose_code_is_installed(self, monkeypatch, without):
        monkeypatch.delenv(room.GETFEM, raising=False)
        without("ngsolve")
        without("getfem")
        assert room.missing_codes() == ("ngsolve", "getfem")
        cases = room.peers_study((1.0, 0.2, 1.0), (16, 8), 3, levels=2).cases
        assert {room.MODELS[case["model"]].code for case in cases} == {room.TRIANGLES, room.BRACKET}
        models = dict.fromkeys(case["model"] for case in cases)
        for model in models:
            numbers = {case["number"] for case in cases if case["model"] == model}
            assert numbers == ({8, 16} if room.MODELS[model].family.counted else {0, 1})
        assert len(cases) == 2 * 2 * len(models)
        assert [case["friction"] for case in cases[:: len(cases) - 1]] == [1.0, 0.2]

    def test_the_committed_rows_of_the_pin_are_those_of_the_study(self):
        study = room.pin_study((0.0, 0.1), (6, 12), ())
        assert [dict(row.case) for row in committed("peers-pin")] == [dict(case) for case in study.cases]


class TestPin:
    """The loaded pin: the same data for every code, and the same displacement."""

    def test_plain_data_are_the_gallerys_pin(self):
        """Areas and sides of half an eye with its pin; the load's traction times its length is the force."""
        plain = room.plain_pin(0.1, 4)
        places = {name: np.array(plain["vertices"])[pairs] for name, pairs in plain["sides"].items()}
        assert np.hypot(*places["hole"].T) == pytest.approx(50.0)
        assert np.hypot(*places["eye"].T) == pytest.approx(100.0)
        assert np.abs(places["axis"][..., 1]).max() < 1e-12
        load = np.linalg.norm(np.diff(places["load"], axis=1), axis=-1).sum()
        assert plain["traction"] * load == pytest.approx(plain["force"])
        a, b, c = np.array(plain["vertices"])[np.array(plain["cells"]).T]
        assert np.all(np.linalg.det(np.stack([b - a, c - a], axis=-1)) > 0.0)

    def test_triangles_move_as_far_as_on_finer_meshes(self):
        """Half a thousandth on four edges in a quarter; the force is carried to rounding."""
        own = import_module("comparisons.peers.codes.own")
        found = own.pin(room.plain_pin(0.1, 4), degree=4)()
        assert found["moved"] == pytest.approx(MOVED[0.1], rel=5e-4)
        assert found["carried"] == pytest.approx(1e4, rel=1e-9)

    @with_ngsolve
    def test_ngsolve_moves_as_far_on_the_same_triangles(self):
        """In a process of its own, as the study runs it."""
        found = room.run_pin({"friction": 0.1, "sectors": 4, "model": "NGSolve, p = 3"})
        assert found["moved"] == pytest.approx(MOVED[0.1], rel=2e-3)
        assert found["carried"] == pytest.approx(1e4, rel=1e-6)

    def test_committed_codes_agree(self):
        """On twelve edges in a quarter this package and NGSolve of degree 4 differ by a hundred-thousandth."""
        rows = [row for row in committed("peers-pin") if row.case["sectors"] == 12]
        found = {(row.case["model"], row.case["friction"]): row.result["moved"] for row in rows}
        for friction, moved in MOVED.items():
            assert found["NGSolve, p = 4", friction] == pytest.approx(moved, rel=3e-6)
            assert found[room.OWN, friction] == pytest.approx(found["NGSolve, p = 4", friction], rel=1.1e-5)

    def test_a_run_that_ends_without_numbers_is_shown_and_not_compared(self):
        """The one of this package: without it there is nothing to compare with."""
        late = {"status": "timeout", "reason": "more than 1 s", "result": {}}
        rows = [
            replace(row, **late) if row.case["model"] == room.OWN and row.case["friction"] == 0.1 else row
            for row in committed("peers-pin")
        ]
        made = pin_report(rows)
        assert made.text.count("more than 1 s") == 2
        assert ("At μ = 0 the sheet" in made.text, "At μ = 0.1 the sheet" in made.text) == (True, False)


SQUARES = "triangles, p = 4, cut squares"


def row_made(model, number, friction=0.2, status="done", reason="", result=None):
    """A row of the study, made up."""
    case = {"friction": friction, "model": model, "number": number, "repetitions": 1}
    return row(case, result or {}, status, reason)


def solution(model, number, half_force, seconds, friction=0.2, **more):
    """A row with a solution, made up; unknowns are the square of the mesh's number."""
    costs = {"unknowns": number**2, "setup": [0.0], "solve": [seconds], "before": 2**26, "peak": 2**27}
    answer = {"status": "solved", "message": "", "half_force": half_force, "residual": 1e-9, "iterations": 1}
    return row_made(model, number, friction, result={**answer, **costs, **more})


def bracketed(lower, upper, friction=1.0, guaranteed=True, cells=8):
    """A row with a bracket, made up."""
    kind = BracketKind.PROBLEM if guaranteed else BracketKind.GIVEN_BOUND
    bounds = {"lower": lower, "upper": upper}  # numbers that are no bounds must not be taken for such
    more = {"width": (upper - lower) / (upper + lower), "strain_error": 0.01, "guaranteed": guaranteed}
    return solution("bracket, p = 5, bisected", cells, None, 0.1, friction, kind=kind.name, **bounds, **more)


def costs(*rows):
    return room.costs_of(room.runs_of(rows))


def told(*rows):
    """The numbers of the findings."""
    runs = room.runs_of(rows)
    return room.values_of(runs, room.costs_of(runs))


def tabled(name, *rows, columns):
    """These columns of a table of the report as texts."""
    runs = room.runs_of(rows)
    found = room.tables_of(runs, room.costs_of(runs))[name]
    return [tuple(room.FORMS.get(column, str)(line[column]) for column in columns) for _, line in found.iterrows()]


OURS, THEIRS, OTHERS = "triangles, p = 4, bisected", "NGSolve, p = 3, symmetric, bisected", "GetFEM, Q2, uniform"


def near(model, number, error, seconds=0.1):
    """A run whose force has this error."""
    return solution(model, number, LIMIT[0.2] * (1.0 + error), seconds)


class TestCosts:
    """What an error costs each code; what no finer mesh confirms is chance."""

    def test_the_quickest_and_the_smallest_of_each_code(self):
        rows = [near(OURS, 3, 2e-6, 0.02), near(OURS, 4, 1e-7, 0.01), near(THEIRS, 5, 2e-6, 0.04)]
        found = costs(*rows, near(OTHERS, 4, 2e-6, 0.05))
        ours = found[found.code == room.TRIANGLES].set_index("target")
        assert ours.loc[3e-6, ["quickest", "smallest"]].tolist() == 2 * [f"{OURS}, level 3"]  # it is confirmed
        assert set(ours.index) == set(room.TARGETS[:4])
        compared = room.compared_of(found).set_index("target")
        assert compared.loc[3e-6, ["code", "smallest_code"]].tolist() == ["ngsolve", "getfem"]
        assert compared.loc[3e-6, ["time_ratio", "unknowns_ratio"]].tolist() == pytest.approx([2.0, 16 / 9])
        assert 1e-7 not in compared.index

    def test_an_error_counts_with_the_uncertainty_of_the_reference_and_as_far_as_finer_meshes_have_it(self):
        for share, there in ((0.98, True), (1.02, False)):
            assert (1e-8 in set(costs(near(OTHERS, 8, 1e-8 * share - FLOOR)).target)) == there
        rows = [near(OTHERS, 4, 1e-7), near(OTHERS, 8, 1e-5)]
        first, last = room.runs_of(rows).itertuples()
        assert first.lasting == last.error == last.lasting > first.error
        assert costs(*rows).target.tolist() == [1e-4, 2e-5]
        assert costs(rows[0], near(OTHERS, 8, 1e-3)).empty
        hidden = tabled("rows-mu-0_2", near(SQUARES, 8, 5e-10), columns=("shown",))
        assert hidden == [("≤ 1.4e-9",)]  # with the uncertainty of the value itself

    def test_what_is_confirmed_comes_first_and_a_finer_mesh_that_fails_confirms_nothing(self):
        graded = [near("GetFEM, Q2, graded", 8, 8e-8, 0.01)]
        uniform = [near(OTHERS, cells, 8e-8, 0.05) for cells in (8, 16)]
        assert set(costs(*graded, *uniform).quickest) == {f"{OTHERS}, 8² cells"}
        graded += [row_made("GetFEM, Q2, graded", 16, status="crashed", reason="signal 11")]
        assert not costs(*graded).sure.any()
        assert told(*graded)["chance"] == ["GetFEM, Q2, graded, 8² cells"]
        graded += [near("GetFEM, Q2, graded", 32, 8e-8, 5.0)]
        assert costs(*graded).sure.all()
        assert told(*graded)["chance"] == []


class TestBounds:
    """Intervals, what errors are relative to, and failures."""

    NONE = room.runs_of([solution("GetFEM, Q2, uniform", 8, 214.4, 0.1)])

    def test_the_narrowest_interval_and_what_is_outside(self):
        rows = [bracketed(214.3676, 214.3677), bracketed(214.36, 214.38)]
        rows += [solution("GetFEM, Q2, uniform", n, force, 0.1, 1.0) for n, force in ((8, 214.36765), (16, 214.3679))]
        rows += [row_made("GetFEM, Q2, uniform", 32, 1.0, status="crashed", reason="signal 11")]
        (found,) = room.intervals_of(room.runs_of(rows)).itertuples()
        assert (found.low, found.high) == pytest.approx((214.3676, 214.3677), abs=5e-6)
        assert (found.getfem, found.ngsolve) == ("1 of 2", "0 of 0")
        assert room.intervals_of(room.runs_of(rows[2:])).empty
        indicator = bracketed(214.1, 214.3, 0.2, guaranteed=False)
        assert told(indicator, solution(SQUARES, 8, 214.2, 0.1))["bounds"] == []
        (wide,) = told(bracketed(214.3677, 214.3678), bracketed(214.2, 214.4))["bounds"]
        assert (wide["low"], wide["high"]) == pytest.approx((214.3676979, 214.3678021), abs=5e-8)  # what solves hold to

    def test_bounds_that_contradict_each_other_are_not_used(self):
        runs = room.runs_of([bracketed(214.367650, 214.367655), bracketed(214.367670, 214.367675)])
        assert room.contradictory(runs)
        assert room.reference(runs, 1.0).value == LIMIT[1.0]
        values = room.values_of(runs, room.costs_of(runs))
        assert (values["bounds"], values["doubtful"]) == ([], [{"friction": 1.0, "count": 2}])

    def test_failures_are_counted_and_told(self, without):
        without("matplotlib")
        result = {"status": "not converged", "message": "residual 1e-3", "half_force": 214.2, "residual": float("inf")}
        rows = [row_made("GetFEM, Q2, strips", n, result=result) for n in (1, 2)]
        rows += [row_made("GetFEM, Q2, strips", 3, status="crashed", reason="signal 11")]
        rows += [solution(SQUARES, 8, 214.2, 0.1)]
        runs, values, lines = room.runs_of(rows), told(*rows), tabled("failures", *rows, columns=("status", "message"))
        assert (values["runs"], values["solved"], values["failing"]) == (4, 1, "3 of GetFEM")
        assert lines[1:] == [("not converged", "residual 1e-3"), ("crashed", "signal 11")]
        assert runs.error[~runs.solved].isna().all()
        assert set(room.report.report(rows).pictures) == set()

    def test_references(self):
        assert all(abs(value - SETTLED[friction]) < UNCERTAINTY for friction, value in LIMIT.items())
        assert room.reference(self.NONE, 0.2)[:2] == LIMITS[0.2]
        assert room.reference(self.NONE, 0.4).value == LIMIT[1.0]
        assert room.reference(self.NONE, 0.15)[:2] == (SETTLED[0.15], UNCERTAINTY)
        assert room.reference(self.NONE, 0.12) is None
        assert "No value of P/2 is known" in room.report.report([solution(OTHERS, 8, 214.4, 0.1, 0.12)]).text
        wide, narrow = bracketed(214.3, 214.4, 0.12), bracketed(214.36765, 214.36766, 0.12)
        known = room.reference(room.runs_of([wide, narrow]), 0.12)
        assert known.value == pytest.approx(214.367655, abs=1e-9)
        assert known.uncertainty == pytest.approx(5e-6 + room.RESOLUTION * known.value)
        assert "guaranteed bounds of bracket, p = 5, bisected, level 8" in known.source
        assert room.reference(room.runs_of([bracketed(214.2, 214.21, 0.12, False)]), 0.12) is None
        assert room.reference(room.runs_of([bracketed(214.36765, 214.36766)]), 1.0).value == LIMIT[1.0]

    @pytest.mark.parametrize("guaranteed", [True, False])
    def test_inverted_bounds_are_a_failure_unless_it_is_rounding(self, guaranteed):
        rows = [bracketed(214.3678, 214.3677, 1.0, guaranteed), bracketed(214.3, 214.4, 1.0, guaranteed)]
        runs = room.runs_of(rows)
        inverted, right = runs.itertuples()
        assert (inverted.status, inverted.solved, right.solved) == ("inverted", False, True)
        assert "half width -2.3e-7" in inverted.message
        assert room.reference(runs, 1.0).value == LIMIT[1.0]
        assert told(*rows)["failing"] == "1 of the bracket"
        assert tabled("brackets-mu-1", *rows, columns=("status",))[0] == ("inverted",)
        assert room.runs_of([bracketed(209.0 + 1e-6, 209.0, 0.0, guaranteed)]).solved.all()


class TestPictures:
    """The best of each code, and intervals where there are any."""

    DRAWN = (
        solution(SQUARES, 8, 214.365, 0.1, 1.0),
        solution("GetFEM, Q2, strips", 3, 214.347, 0.1, 1.0),
        row_made("GetFEM, Q2, graded", 8, 1.0, status="crashed", reason="signal 11"),
        bracketed(214.365, 214.368),
        bracketed(214.1, 214.3, 0.2, guaranteed=False),
        solution(SQUARES, 8, 214.2, 0.1),
    )

    def test_codes_are_curves_and_an_indicator_is_no_interval(self):
        pytest.importorskip("matplotlib")
        runs = room.runs_of(self.DRAWN)
        texts = {name: texts_of(draw()) for name, draw in room.figures_of(runs, room.known_of(runs)).items()}
        best = {f"best-{cost}-mu-{mu}" for cost in ("unknowns", "time") for mu in ("1", "0_2")}
        assert set(texts) == {"intervals-mu-1"} | best
        names = [code.name for code in room.CODES.values()]
        assert [name for name in names if name in texts["best-unknowns-mu-1"]] == ["this package", "GetFEM"]
        assert "guaranteed interval" in texts["intervals-mu-1"]

    @pytest.mark.parametrize("last", [(213.9, 214.5), (214.36, 214.37)])
    def test_all_bars_and_marks_are_inside_the_picture(self, last):
        pytest.importorskip("matplotlib")
        runs = room.runs_of([bracketed(*last), *self.DRAWN[:4]])
        known = room.reference(runs, 1.0)
        (axes,) = room.figures_of(runs, {1.0: known})["intervals-mu-1"]().axes
        bottom, top = axes.get_ylim()
        ends = [end / known.value - 1.0 for end in (*last, 214.365, 214.368)]
        assert bottom < min(ends) < max(ends) < top
        assert bottom <= min(axes.get_yticks()) < 0.0 < max(axes.get_yticks()) <= top


def least(rows, friction, value, uncertainty, code):
    """Time of a code to an error of 1e-8 that no finer mesh contradicts; of those that one confirms, if any."""
    found = [(True, float("inf"))]
    for name in (name for name, model in room.MODELS.items() if model.code == code):
        curve = [row for row in rows if (row.case["model"], row.case["friction"]) == (name, friction)]
        errors = {row.case["number"]: abs((row.result["half_force"] or 0.0) / value - 1.0) for row in curve}
        for each in curve:
            worst = max(error for number, error in errors.items() if number >= each.case["number"])
            if worst + uncertainty / value <= 1e-8:
                sums = map(sum, zip(each.result["setup"], each.result["solve"], strict=True))
                found.append((each.case["number"] == max(errors), min(sums)))
    return min(found)[1]


def test_costs_of_the_committed_run_are_those_of_its_rows():
    """From the rows, without the frame."""
    rows = committed("peers")
    runs, solved = room.runs_of(rows), [row for row in rows if row.result.get("status") == "solved"]
    assert (len(runs), runs.solved.sum()) == (len(rows), len(solved))
    lines = room.compared_of(room.costs_of(runs)).query("target == 1e-8").set_index("friction")
    for friction, (value, uncertainty) in LIMITS.items():
        by_code = {code: least(solved, friction, value, uncertainty, code) for code in room.CODES}
        ours, theirs = by_code[room.TRIANGLES], min(by_code["ngsolve"], by_code["getfem"])
        assert lines.loc[friction, ["seconds_own", "seconds"]].tolist() == pytest.approx([ours, theirs])
