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

from comparisons import LIMITS, SETTLED
from comparisons import peers as room
from comparisons.lab.study import Study, read_csv, read_study, run_study
from comparisons.peers import pin as pins
from comparisons.peers import plate
from qvi_contact import InputError, TriangleMesh, solve
from qvi_contact.bracket import BracketKind
from qvi_contact.gallery import compressed_plate
from tests.comparisons.convergence_parts import REPORTS, report_of, rows_of
from tests.test_examples import script

CODES_FOLDER = Path(import_module("comparisons.peers.codes").__file__).parent
LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
CHOSEN = ("triangles, p = 3, bisected", "NGSolve, p = 2, symmetric, uniform", "bracket, p = 3, graded")
MOVED = {0.0: 0.758518, 0.1: 0.738677}
"""u_x [mm] of the sheet on the axis, by NGSolve with degree 4 on twice as many edges."""

with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
posix = pytest.mark.skipif(os.name != "posix", reason="the other Python is a shell script here")


def solved(code, case, **options):
    """What a code, a key of `CODES`, answers in this process."""
    return import_module(f"comparisons.peers.codes.{room.CODES[code].module}").build(case, **options)()


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
        coarse, fine = (abs(nitsche(0.2, cells, order, variant)["half_force"] - SETTLED[0.2]) for cells in (4, 8))
        assert fine < min({2: 6e-3, 3: 5e-4}[order], coarse / 2.0)
        assert nitsche(0.0, 3, order, variant, "graded")["half_force"] == pytest.approx(209.0, rel=1e-10)

    def test_variants_are_different_methods(self):
        forces = [nitsche(0.2, 4, variant=variant)["half_force"] for variant in ("symmetric", "incomplete", "skew")]
        assert forces[0] < forces[1] - 1e-3 < forces[2] - 2e-3

    def test_graded_meshes(self):
        """Full stick; and slip, in so few steps of Newton's method as only its line search lets it take."""
        assert nitsche(1.0, 12, 3, mesh="graded")["half_force"] == pytest.approx(SETTLED[1.0], abs=1e-4)
        found = nitsche(0.2, 12, mesh="graded")
        assert (found["status"], found["residual"] <= 1e-8, found["iterations"] <= 15) == ("solved", True, True)

    def test_each_solve_starts_from_zero(self):
        solve = import_module("comparisons.peers.codes.ngsolve_nitsche").build(plate(0.2, "uniform", 4))
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

    @pytest.mark.parametrize("degree", [2, 3])
    def test_the_companion_is_above_and_its_unknowns_are_those_of_the_same_elements(self, degree):
        found = solved(room.COMPANION, plate(1.0, "graded", 4), degree=degree)
        assert found["status"] == "solved"
        assert SETTLED[1.0] < found["half_force"] < {2: 214.41, 3: 214.38}[degree]
        assert found["unknowns"] == 2 * (4 * degree + 1) ** 2 - 2 * (4 * degree + 1)

    def test_the_bracket_of_a_plate_that_slips_is_an_indicator(self):
        found = solved(room.BRACKET, plate(0.2, "graded", 4), bracket=2)
        assert (found["status"], found["guaranteed"]) == ("solved", False)
        assert (found["lower"], found["upper"], found["kind"]) == (None, None, BracketKind.GIVEN_BOUND.name)
        assert 0.0 < found["width"] < 1e-3 < found["strain_error"]

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


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a run on one mesh, models of three kinds, each in a process of its own."""
    missing = room.missing_codes()
    number = {True: 8, False: 0}
    cases = [
        {"friction": 1.0, "model": name, "number": number[room.NAMED[name].family.counted], "repetitions": 2}
        for name in CHOSEN if room.NAMED[name].code not in missing
    ]  # fmt: skip
    return rows_of(Study.of("peers", 2, room.run, cases), tmp_path_factory.mktemp("peers") / "a.sqlite")


@pytest.fixture(scope="module")
def by_code(rows):
    """Code → its entry of the document for JSON."""
    document = room.document_of(rows, report_of("peers", rows))
    assert document["schema"] == room.SCHEMA
    (known,) = document["references"]
    assert known["value"] == LIMIT[1.0]
    return {row["code"]: row for row in document["rows"]}


class TestRun:
    """One real run."""

    def test_own_rows_are_certified_solves(self, by_code):
        expected, row = solve(on_the_mesh(plate(1.0, "bisected", 0)), degree=3), by_code[room.TRIANGLES]
        assert row["half_force"] == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
        assert (row["unknowns"], row["bounds"]) == (expected.solution.problem.n, None)
        assert row["residual"] < 1e-8

    def test_each_case_has_times_a_memory_and_an_error_of_its_own(self, by_code):
        for row in by_code.values():
            whole = [sum(pair) for pair in zip(row["setup"], row["solve"], strict=True)]
            assert (len(whole), row["seconds"]) == (2, min(whole))
            assert min(row["setup"] + row["solve"]) > 0.0
            assert 2**24 < row["before"] <= row["peak"] < 2**30
            if row["half_force"]:
                assert row["error"] == pytest.approx(abs(row["half_force"] / LIMIT[1.0] - 1.0))
                assert row["error"] > 1e-6
        assert len({row["before"] for row in by_code.values()}) == len(by_code)


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
        run_study(Study.of("peers", 2, room.run, [self.CASE]), tmp_path / "a.sqlite", timeout=0.5)
        rows = read_study(tmp_path / "a.sqlite").rows
        (found,) = room.runs_of(rows).itertuples()
        assert (found.status, found.message, np.isnan(found.half_force)) == ("timeout", "more than 0.5 s", True)
        made = report_of("peers", rows)
        assert ("timeout" in made.text, str(tmp_path) in made.text, made.pictures) == (True, False, {})
        assert not commands_with(tmp_path)

    @pytest.mark.parametrize("code", ["ngsolve", room.TRIANGLES])
    def test_exceptions_are_told(self, code):
        process = import_module("comparisons.peers.codes.process")
        found = process.repeated(import_module(f"comparisons.peers.codes.{room.CODES[code].module}"), **self.EMPTY)
        assert found["status"] == "error"
        assert found["message"].startswith("KeyError: ") or find_spec("ngsolve") is None

    def test_what_a_library_prints_is_not_the_answer(self):
        found = room.answer_of({"module": "this", **self.EMPTY}, "equilibrium")  # it prints when imported
        assert (found["status"], found["message"].split(":")[0]) == ("error", "AttributeError")

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
        mesh, case = compressed_plate(0.2, cells=(6, 6), grading=room.ratio(6)).mesh, plate(0.2, "graded", 6)
        assert case["lines"] == [mesh.x.tolist(), mesh.y.tolist()]
        assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)
        json.dumps(case, allow_nan=False)


class TestStudy:
    """Models, codes and cases."""

    def test_models_can_be_told_apart_and_their_codes_exist(self):
        assert len(room.NAMED) == len(room.MODELS)
        for graded in (False, True):
            here = [model for model in room.MODELS if model.family.to_transition == graded]
            assert len({(model.colour, model.marker) for model in here}) == len(here)
        for code in room.CODES.values():
            assert callable(import_module(f"comparisons.peers.codes.{code.module}").build)

    def test_the_scripts_load_no_peer_and_nothing_of_the_project(self):
        names = ("getfem", "ngsolve", "qvi_contact", "comparisons")
        look = (
            "import sys; sys.path.insert(0, sys.argv[1]); import getfem_bricks, process, ngsolve_nitsche; "
            f"print([name for name in sys.modules if name.split('.')[0] in {names}])"
        )
        words = [sys.executable, "-I", "-c", look, str(CODES_FOLDER)]
        assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == "[]"

    def test_it_has_all_models_whose_code_is_installed(self, monkeypatch, without):
        monkeypatch.delenv(room.GETFEM, raising=False)
        without("ngsolve")
        without("getfem")
        assert room.missing_codes() == ("ngsolve", "getfem")
        declared = room.peers_study((1.0, 0.2, 1.0), (16, 8), 3, levels=2)
        assert declared.factors["friction"] == (1.0, 0.2)
        assert declared.factors["number"] == (0, 1, 8, 16)
        models = declared.factors["model"]
        assert {room.NAMED[name].code for name in models} == {
            room.TRIANGLES,
            room.EQUILIBRIUM,
            room.COMPANION,
            room.BRACKET,
        }
        for model in models:
            numbers = {case.values["number"] for case in declared.cases if case.values["model"] == model}
            assert numbers == ({8, 16} if room.NAMED[model].family.counted else {0, 1})
        assert len(declared.cases) == 2 * 2 * len(models)


class TestPin:
    """The loaded pin: the same data for every code, and the same displacement."""

    def test_plain_data_are_the_gallerys_pin(self):
        """Areas and sides of half an eye with its pin; the load's traction times its length is the force."""
        plain = pins.plain_pin(0.1, 4)
        places = {name: np.array(plain["vertices"])[pairs] for name, pairs in plain["sides"].items()}
        assert np.hypot(*places["hole"].T) == pytest.approx(50.0)
        assert np.hypot(*places["eye"].T) == pytest.approx(100.0)
        assert np.abs(places["axis"][..., 1]).max() < 1e-12
        load = np.linalg.norm(np.diff(places["load"], axis=1), axis=-1).sum()
        assert plain["traction"] * load == pytest.approx(plain["force"])
        a, b, c = np.array(plain["vertices"])[np.array(plain["cells"]).T]
        assert np.all(np.linalg.det(np.stack([b - a, c - a], axis=-1)) > 0.0)

    @pytest.mark.parametrize("friction", [0.0, 0.1])
    def test_triangles_move_as_far_as_on_finer_meshes(self, friction):
        """Half a thousandth on four edges in a quarter; the force is carried to rounding."""
        own = import_module("comparisons.peers.codes.own_pin")
        found = own.build(pins.plain_pin(friction, 4), degree=4)()
        assert found["moved"] == pytest.approx(MOVED[friction], rel=5e-4)
        assert found["carried"] == pytest.approx(1e4, rel=1e-9)

    @with_ngsolve
    def test_ngsolve_moves_as_far_on_the_same_triangles(self):
        """In a process of its own, as the study runs it."""
        found = pins.run({"friction": 0.1, "sectors": 4, "model": "NGSolve, p = 3"})
        assert found["moved"] == pytest.approx(MOVED[0.1], rel=2e-3)
        assert found["carried"] == pytest.approx(1e4, rel=1e-6)

    def test_committed_codes_agree(self):
        """On twelve edges in a quarter this package and NGSolve of degree 4 differ by a hundred-thousandth."""
        rows = [row for row in read_csv(REPORTS / "peers" / "peers-pin.csv.gz") if row.case["sectors"] == 12]
        found = {(row.case["model"], row.case["friction"]): row.result["moved"] for row in rows}
        for friction, moved in MOVED.items():
            assert found["NGSolve, p = 4", friction] == pytest.approx(moved, rel=3e-6)
            assert found[pins.OWN, friction] == pytest.approx(found["NGSolve, p = 4", friction], rel=1.1e-5)

    def test_a_run_that_ends_without_numbers_is_shown_and_not_compared(self):
        """The one of this package: without it there is nothing to compare with."""
        late = {"status": "timeout", "reason": "more than 1 s", "result": {}}
        rows = [
            replace(row, **late) if row.case["model"] == pins.OWN and row.case["friction"] == 0.1 else row
            for row in read_csv(REPORTS / "peers" / "peers-pin.csv.gz")
        ]
        made = report_of("peers.pin", rows)
        assert made.text.count("more than 1 s") == 2
        assert ("At μ = 0 the sheet" in made.text, "At μ = 0.1 the sheet" in made.text) == (True, False)
        (first, _) = [row for row in pins.document_of(rows, made)["rows"] if row["status"] == "timeout"]
        assert (first["moved"], first["unknowns"], first["message"]) == (None, None, "more than 1 s")


@with_ngsolve
def test_the_known_force_of_the_trapezoid_is_that_of_displacements_of_high_degree():
    """NGSolve on triangles graded to the corners by 0.2; the energy of displacements bounds the force from above."""
    from netgen.geom2d import SplineGeometry
    from ngsolve import BilinearForm, Grad, GridFunction, Id, InnerProduct, Mesh, Sym, Trace, VectorH1, dx

    geometry, pushed = SplineGeometry(), 1e-3
    corners = [geometry.AppendPoint(*at, hpref=1) for at in ((0.0, 0.0), (2.0, 0.0), (1.5, 1.0), (0.5, 1.0))]
    for k, name in enumerate(("base", "right", "top", "left")):
        geometry.Append(["line", corners[k], corners[(k + 1) % 4]], bc=name)
    mesh = Mesh(geometry.GenerateMesh(maxh=0.4))
    mesh.RefineHP(12, factor=0.2)
    space = VectorH1(mesh, order=8, dirichlet="base|top")
    u, v = space.TnT()
    shear, lame = 1e4 / 2.4, 1e4 * 0.2 / (1.2 * 0.6)
    strain = Sym(Grad(u))
    stress = 2.0 * shear * strain + lame * Trace(strain) * Id(2)
    energy = BilinearForm(InnerProduct(stress, Sym(Grad(v))) * dx).Assemble()
    moved = GridFunction(space)
    moved.Set((0.0, pushed), definedon=mesh.Boundaries("base"))
    residual = moved.vec.CreateVector()
    residual.data = energy.mat * moved.vec
    moved.vec.data -= energy.mat.Inverse(space.FreeDofs(), "sparsecholesky") * residual
    residual.data = energy.mat * moved.vec
    force = InnerProduct(residual, moved.vec) / pushed**2 * pushed
    known = script("trapezoid")["KNOWN"]
    assert force == pytest.approx(known, rel=1e-8)
    assert force >= known
