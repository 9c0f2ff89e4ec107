"""Problems of meshes as files of other programs: the same solutions come back, and their own commands run them."""

import re
from pathlib import Path

import numpy as np
import pytest
import qpsolvers

from comparisons.exchange import load_qvi, local_problem, programs_of, read_fclib, write_fclib
from qvi_contact import discretize, load_problem, solve
from qvi_contact.gallery import compressed_plate
from tests.comparisons.parts import command, refused

pytest.importorskip("h5py", reason="FCLIB files need the extra 'exchange'")

EXAMPLES = Path(__file__).parents[2] / "examples"

TINY = """
version = 1
title = "Tiny plate"
description = "Two by two cells, squeezed."

[mesh]
x = { start = 0.0, stop = 2.0, cells = 2 }
y = { start = 0.0, stop = 1.0, cells = 2 }

[material]
young = 1000.0
poisson = 0.3

[[tractions]]
edges = "right"
x = 0.0
y = 0.0

[[symmetry]]
edges = "left"

[[symmetry]]
edges = "bottom"

[[contacts]]
name = "plate"
edges = "top"
friction = 0.2
gap = -0.001
"""


def plate(cells: int = 8, friction: float = 0.2, grading: float = 1.0):
    return compressed_plate(friction, cells=(cells, cells), grading=grading)


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", ["full", "condensed"])
def test_a_converged_quadratic_program_has_the_solution_of_the_contact_problem(form):
    """The minimiser for the friction bound of the solution is the solution; for the cold bound it is not."""
    result = solve(plate(8, friction=0.1))
    qvi, z = result.solution.problem, result.solution.z
    found = {p.name: p for p in programs_of("p", qvi, qvi.pressure(z))}
    assert set(found) == {f"p_{f}_{b}" for f in ("full", "condensed") for b in ("converged", "cold")}
    errors = []
    for bound in ("converged", "cold"):
        qp = found[f"p_{form}_{bound}"]
        problem = qpsolvers.Problem(qp.P, qp.q, qp.G, qp.h)
        x = qpsolvers.solve_problem(problem, solver="clarabel", tol_feas=1e-12, tol_gap_abs=1e-13, tol_gap_rel=1e-13).x
        rows = qp.G[: 2 * qvi.m] @ x  # −n0 and thr − t0 above the bound: tractions are rows + (n0, t0)
        n0 = -qp.h[: qvi.m]
        t0 = (qp.h[2 * qvi.m :] - qp.h[qvi.m : 2 * qvi.m]) / 2.0
        wanted = np.concatenate([qvi.normal(z), qvi.tangential(z)])
        errors.append(float(np.abs(rows + np.concatenate([n0, t0]) - wanted).max() / np.abs(wanted).max()))
    assert errors[0] < 1e-5
    assert errors[1] > 1e-3


def test_export_and_import_commands(tmp_path, tiny):
    """A problem file becomes .hdf5 and .npz, and both are solved and judged from the command line."""
    for kind, file in (("fclib", tmp_path / "a.hdf5"), ("npz", tmp_path / "a.npz")):
        status, out, err = command("export", kind, tiny, file)
        assert (status, err) == (0, "")
        assert "solved" in out
        status, out, err = command("import", file)
        assert (status, err) == (0, "")
        assert out.count("certificate passed") == 3  # of the file's solution, of that found, in the status
        assert re.findall(r"^  (\w[^:]*):", out, flags=re.MULTILINE) == ["solution", "solved here"]
        errors = re.findall(r"Siconos error (\S+), (\S+) with", out)
        assert len(errors) == 2
        assert max(float(error) for pair in errors for error in pair) < 1e-8
        assert command("import", file, "--tolerance", "1e-7").status == 0
    held = read_fclib(tmp_path / "a.hdf5")
    assert held.title == "Tiny plate"
    assert "squeezed. Dimensionless. Units" in held.description
    force = float(held.description.split("thickness ")[1].split(",")[0])
    expected = solve(load_problem(tiny).problem).contacts["plate"].normal_force
    qvi, solution = load_qvi(tmp_path / "a.npz")
    assert held.solution.r[0::2].sum() == pytest.approx(-qvi.resultant(solution.z), rel=1e-12)
    assert force * held.solution.r[0::2].sum() == pytest.approx(expected, rel=1e-9)


def test_a_penalised_export_has_no_equations_and_no_solution(tmp_path, tiny):
    assert command("export", "fclib", tiny, tmp_path / "a.hdf5", "--penalty", "1e6")[0] == 0
    held = read_fclib(tmp_path / "a.hdf5")
    assert (len(held.problem.s), held.solution) == (0, None)
    assert command("import", tmp_path / "a.hdf5")[0] == 0


def test_what_cannot_be_carried_is_written_and_found_infeasible(tmp_path):
    source = EXAMPLES / "dragged_block_slides.toml"
    status, out, _ = command("export", "fclib", source, tmp_path / "a.hdf5")
    assert status == 1
    assert "infeasible" in out
    assert command("export", "npz", source, tmp_path / "a.npz")[0] == 1
    for name in ("a.hdf5", "a.npz"):
        status, out, err = command("import", tmp_path / name)
        assert (status, err, "status: infeasible" in out) == (1, "", True)


def test_laws_without_a_place_in_fclib(tmp_path, tiny):
    """Cohesion: no FCLIB file, an archive yes, and the report says why there is no Siconos error."""
    tiny.write_text(TINY + "cohesion = 0.1\n", encoding="utf-8")
    assert "cohesion" in refused("export", "fclib", tiny, tmp_path / "a.hdf5")
    assert not (tmp_path / "a.hdf5").exists()
    assert command("export", "npz", tiny, tmp_path / "a.npz")[0] == 0
    status, out, _ = command("import", tmp_path / "a.npz")
    assert status == 0
    assert "no Siconos error: cohesion" in out


def test_wrong_files_and_places_are_one_line(tmp_path, tiny):
    broken = tmp_path / "broken.hdf5"
    broken.write_bytes(b"\x89HDF\r\n\x1a\n" + b"0" * 100)
    assert "FCLIB" in refused("import", broken)
    (tmp_path / "broken.npz").write_bytes(b"PK")
    assert "save_qvi" in refused("import", tmp_path / "broken.npz")
    assert "No such file" in refused("import", tmp_path / "missing.hdf5")
    assert ".hdf5" in refused("export", "fclib", tiny, tmp_path / "a.txt")
    assert ".npz" in refused("export", "npz", tiny, tmp_path / "a.hdf5")
    assert "No such file" in refused("export", "npz", tmp_path / "missing.toml", tmp_path / "a.npz")
    assert "--penalty" in refused("export", "fclib", tiny, tmp_path / "a.hdf5", "--penalty", "-1")
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    for kind, name in (("npz", "a.npz"), ("fclib", "a.hdf5")):
        assert "is a file, not a folder" in refused("export", kind, tiny, tmp_path / "file" / name)
    assert "is a file, not a folder" in refused("export", "qpbenchmark", tmp_path / "file", tiny)
    assert "FOLDER" in refused("export", "qpbenchmark", "", tiny)
    assert "different names" in refused("export", "qpbenchmark", tmp_path / "set", tiny, tiny)
    assert (tmp_path / "file").read_text(encoding="utf-8") == "kept"
    good = tmp_path / "good.hdf5"
    write_fclib(good, local_problem(discretize(plate(4)).qvi))
    assert "method" in refused("import", good, "--method", "guess")
    assert "tolerance" in refused("import", good, "--tolerance", "2")
