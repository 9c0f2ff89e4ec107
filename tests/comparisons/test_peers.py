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

from comparisons.peers import meshes, report
from comparisons.peers import study as room
from comparisons.settled import LIMITS, SETTLED, TRANSITIONS
from qvi_contact import InputError, TriangleMesh, graded_lines, solve
from qvi_contact.gallery import compressed_plate
from tests.comparisons.conftest import row

CODES_FOLDER = Path(import_module("comparisons.peers.codes").__file__).parent
LIMIT = {friction: value for friction, (value, _) in LIMITS.items()}
CHOSEN = ("triangles, p = 3, bisected", "NGSolve, p = 2, symmetric, uniform")
with_ngsolve = pytest.mark.skipif(find_spec("ngsolve") is None, reason="NGSolve is not installed")
posix = pytest.mark.skipif(os.name != "posix", reason="the other Python is a shell script here")


def solved(code, case, **options):
    """What a code, a key of `CODES`, answers in this process."""
    return import_module(f"comparisons.peers.codes.{room.CODES[code].module}").plate(case, **options)()


def nitsche(friction, number, order=2, variant="symmetric", mesh="uniform"):
    return solved("ngsolve", room.plate(friction, mesh, number), order=order, variant=variant)


@with_ngsolve
class TestNitsche:
    """NGSolve's script."""

    @pytest.mark.parametrize(("cells", "expected"), [(8, 214.23746), (16, 214.23420)])
    def test_expected_forces(self, cells, expected):
        found = nitsche(0.2, cells, variant="incomplete")
        assert found["status"] == "solved"
        assert found["half_force"] == pytest.approx(expected, abs=6e-6)
        assert found["unknowns"] == 2 * (2 * cells + 1) ** 2 - 2 * (2 * cells + 1)

    def test_graded_meshes(self):
        """Full stick; and slip, in so few steps of Newton's method as only its line search lets it take."""
        assert nitsche(1.0, 12, 3, mesh="graded")["half_force"] == pytest.approx(SETTLED[1.0], abs=1e-4)
        found = nitsche(0.2, 12, mesh="graded")
        assert (found["status"], found["residual"] <= 1e-8, found["iterations"] <= 15) == ("solved", True, True)


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
def test_getfem(family, cells, expected, environ):
    """A mesh whose nodes it merges is not solved."""
    environ(**{room.GETFEM: python_with_getfem()})
    answer = room.run({"friction": 0.2, "repetitions": 1, "model": f"GetFEM, Q2, {family}", "number": cells})
    if expected is None:
        assert (answer["status"], "4732 of 4802" in answer["message"]) == ("error", True)
        return
    assert (answer["status"], answer["before"] <= answer["peak"]) == ("solved", True)
    assert answer["half_force"] == pytest.approx(expected, abs=6e-6)


class TestOwnModels:
    """What this package's own codes answer."""

    def test_the_bracket_on_triangles_bounds_the_force_under_friction(self):
        case = room.plate(0.1, "bisected", 0)
        found = solved(room.BRACKET, case, degree=4, bracket=4)
        assert (found["status"], found["guaranteed"], found["kind"]) == ("solved", True, "COULOMB")
        assert found["lower"] < LIMIT[0.1] < found["upper"]
        assert found["width"] == pytest.approx((found["upper"] - found["lower"]) / (found["upper"] + found["lower"]))
        stress = solve(on_the_mesh(case), degree=4, tolerance=1e-8)
        assert found["strain_error"] == pytest.approx(stress.bracket.relative_error, rel=1e-6)
        assert found["unknowns"] == stress.solution.problem.n + stress.bracket.companion.space.size

    @pytest.mark.parametrize(("number", "width"), [(0, 10.0**-2.5), (1, 1e-3)])
    def test_adaptive_meshes_give_bounds_as_close_as_their_number_asks_for(self, number, width):
        found = solved(room.BRACKET, room.plate(0.05, "adaptive", number), degree=5, adaptive=True)
        assert (found["status"], found["guaranteed"]) == ("solved", True)
        assert found["lower"] < LIMIT[0.05] < found["upper"]
        assert 0.0 < found["width"] <= width
        assert len(room.plate(0.05, "adaptive", number)["cells"]) == 2


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
    runs = report.runs_of([row(case, room.run(case)) for case in cases])
    own = runs[runs.code == room.TRIANGLES].iloc[0]
    expected = solve(on_the_mesh(room.plate(1.0, "bisected", 0)), degree=3)
    assert own.half_force == pytest.approx(expected.contacts["plate"].normal_force, rel=1e-10)
    assert own.unknowns == expected.solution.problem.n
    assert own.residual < 1e-8
    for run in runs.itertuples():
        assert len(run.solve) == 2
        assert run.setup > 0.0
        assert run.seconds > min(run.solve) > 0.0
        assert 2**24 < run.before <= run.peak < 2**30
        assert run.error == pytest.approx(abs(run.half_force / LIMIT[1.0] - 1.0))
        assert run.error > 1e-6
    assert runs.before.nunique() == len(runs)


class TestFailures:
    """Codes that crash, hang, or talk nonsense are rows with the reason."""

    CASE = {"model": "GetFEM, Q2, uniform", "friction": 0.2, "number": 4, "repetitions": 1}  # noqa: RUF012

    @posix
    @pytest.mark.parametrize(
        ("does", "reason"),
        [("echo no libgetfem.so.5 >&2; exit 3", "status 3: no libgetfem.so.5"),
         ("kill -SEGV $$", "status -11: no message"), ("cat >/dev/null; echo hello", "Expecting value"),
         ('[ -n "$PYTHONPATH" ] && echo "finds this project" >&2; exit 1', "status 1: no message")],
    )  # fmt: skip
    def test_the_reason_is_told(self, tmp_path, environ, does, reason):
        path = tmp_path / "python-with-getfem"  # says it has any module, and then does this instead of the work
        path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{does}\n', encoding="utf-8")
        path.chmod(0o755)
        environ(**{room.GETFEM: path, "PYTHONPATH": tmp_path})
        with pytest.raises((room.ProcessError, ValueError), match=reason) as caught:
            room.run(self.CASE)
        assert str(tmp_path) not in str(caught.value)

    def test_exceptions_are_told(self):
        process = import_module("comparisons.peers.codes.process")
        found = process.repeated(lambda _: {}["no"], {}, {}, {}, 1)
        assert found == {"status": "error", "message": "KeyError: 'no'"}

    @posix
    def test_another_python_without_the_library_is_refused(self, tmp_path, environ):
        path = tmp_path / "python"
        path.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
        path.chmod(0o755)
        environ(**{room.GETFEM: path})
        with pytest.raises(InputError) as caught:
            room.missing_codes()
        assert caught.value.field == "getfem"


class TestMeshes:
    """Families of meshes."""

    @pytest.mark.parametrize("friction", [*TRANSITIONS, 1.0])
    @pytest.mark.parametrize("name", [name for name in meshes.FAMILIES if name != "adaptive"])
    def test_members_fill_the_plate_and_get_finer(self, name, friction):
        counts = []
        for number in (2, 3) if meshes.FAMILIES[name].counted else (0, room.LEVELS - 1):
            mesh = meshes.plain_mesh(name, friction, number)
            corners = np.array(mesh["vertices"])[np.array(mesh["cells"])]
            x, y = np.moveaxis(corners, 2, 0)
            area = 0.5 * (x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)
            assert area.min() > 0.0
            assert area.sum() == pytest.approx(1.0)
            edges = [np.array(mesh["vertices"])[np.array(mesh["sides"][side])] for side in ("left", "top")]
            assert [np.abs(np.diff(ends, axis=1)).sum() for ends in edges] == pytest.approx([1.0, 1.0])
            assert (mesh["lines"] is None) == (name in ("cut squares", "bisected", "layers"))
            counts.append(len(corners))
        assert counts[0] < counts[1]

    @pytest.mark.parametrize(("friction", "transition"), TRANSITIONS.items())
    @pytest.mark.parametrize("name", ["strips", "narrow strips", "bisected", "layers"])
    def test_the_smallest_cells_are_at_corner_and_transition(self, name, friction, transition):
        if name == "layers" and transition < 0.1:
            pytest.skip("no vertex is there")
        vertices = np.array(meshes.plain_mesh(name, friction, room.LEVELS - 1)["vertices"])
        tops = np.sort(vertices[vertices[:, 1] == 1.0, 0])
        lengths = np.diff(tops)
        near = lengths[(tops[:-1] <= transition + 1e-12) & (tops[1:] >= transition - 1e-12)]
        assert near.max() < 0.06
        assert max(near.max(), lengths[-1]) < lengths.max() / 4.0

    def test_all_codes_get_the_plate_of_the_gallery(self):
        lines, case = graded_lines(0.0, 1.0, 6, meshes.ratio(6)).tolist(), room.plate(0.2, "graded", 6)
        assert case["lines"] == [lines, lines]
        assert len(case["vertices"]) == 49
        assert len(case["cells"]) == 36
        assert (case["young"], case["poisson"], case["displacement"], case["friction"]) == (2.09e5, 0.3, 1e-3, 0.2)
        json.dumps(case, allow_nan=False)


def test_the_scripts_load_no_peer_and_nothing_of_the_project():
    names = ("getfem", "ngsolve", "qvi_contact", "comparisons")
    look = (
        "import sys; sys.path.insert(0, sys.argv[1]); import process, with_getfem, with_ngsolve; "
        f"print([name for name in sys.modules if name.split('.')[0] in {names}])"
    )
    words = [sys.executable, "-I", "-c", look, str(CODES_FOLDER)]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip() == "[]"
