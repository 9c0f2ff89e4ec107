"""Every file in the folder examples says what to expect, and keeps what it promises.

The chapter of examples of the verification manual solves and certifies every file as it stands, see its quick run in
`tests/comparisons/test_verification.py`, and measures forces that are known by hand. Here is what that leaves out.
"""

import runpy
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from qvi_contact import load_problem, solve
from qvi_contact.gallery import compressed_plate, jointed_slope, masonry_wall, ssnv128
from qvi_contact.solution.history import solve_history
from solvers import Status

FOLDER = Path(__file__).parent.parent / "examples"
FILES = sorted(path.stem for path in FOLDER.glob("*.toml"))
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "known")

pytestmark = pytest.mark.filterwarnings("error")


@cache
def example(name):
    return load_problem(FOLDER / f"{name}.toml")


@cache
def answer(name):
    return solve(example(name).problem, **example(name).solve_options)


def forces(name, contact):
    line = answer(name).contacts[contact]
    return line.normal_force, line.tangential_force


def test_the_folder_has_what_the_tests_expect():
    assert len(FILES) >= 9
    assert {"compressed_plate", "ssnv128", "punch", "bracket", "block_with_hole", "gravity_column"} < set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_the_comments_say_what_to_expect(name):
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert f"examples/{name}.toml" in text
    assert any("xpect" in line for line in comments)
    assert max(map(len, text.splitlines())) <= 120
    assert example(name).title


def test_compressed_plate_is_that_of_the_gallery():
    same = solve(compressed_plate(0.2, cells=(16, 16), grading=0.9)).contacts["plate"]
    normal, tangential = forces("compressed_plate", "plate")
    assert normal == pytest.approx(same.normal_force, rel=1e-7)
    assert tangential == pytest.approx(same.tangential_force, rel=1e-6)
    assert 209.0 < normal < 214.5


def test_ssnv128_is_that_of_the_gallery():
    problem, same = example("ssnv128").problem, ssnv128()
    assert problem.conditions == tuple(sorted(same.conditions, key=lambda c: "STC".index(type(c).__name__[0])))


def test_punch_carries_its_force_and_peaks_at_its_edges():
    line = answer("punch").contacts["punch"]
    assert line.normal_force == pytest.approx(100.0, rel=1e-9)
    assert line.tangential_force == pytest.approx(0.0, abs=1e-4)  # 2e-3 if triangles were not symmetric
    middle = -np.interp(0.0, line.x, line.normal_stress)
    assert middle == pytest.approx(100.0 / np.pi, rel=0.06)
    assert -line.normal_stress[[0, -1]].max() > 3.0 * middle
    assert line.shares["stick"] == pytest.approx(0.775, abs=0.03)
    assert np.abs(line.x[line.state == 2]).min() > 0.74


def test_hole_is_free_and_makes_the_block_softer():
    result = answer("block_with_hole")
    for edges in ("hole floor", "hole roof"):
        assert result.resultant(edges).y == pytest.approx(0.0, abs=1e-9)
    assert result.contacts["plate"].normal_force == pytest.approx(22.02, rel=1e-3)


def test_a_dragged_block_slides_with_a_mechanism():
    slides = answer("dragged_block_slides")
    assert "friction on 'base'" in slides.message
    assert slides.mechanism.overload == pytest.approx(1.01, rel=1e-9)


def test_cyclic_shear_repeats_itself_and_costs_energy():
    history = solve_history(example("cyclic_shear").problems)
    assert history.status is Status.SOLVED
    times, (_, force) = np.array(example("cyclic_shear").times), history.loop("ground")
    normal = np.array([step.contacts["ground"].normal_force for step in history.steps])
    assert (np.abs(force) <= 0.3 * normal * (1 + 1e-6)).all()
    second = times > 1.0
    np.testing.assert_allclose(force[second], force[(times > 0.0) & ~second], rtol=1e-5, atol=1e-5)
    assert force[times == 1.0] > 100.0  # the ground is back in its place, the force is not
    assert history.dissipated.sum() == pytest.approx(0.9, rel=0.05)


@cache
def script(name):
    """The names of a script that has run, and found its known numbers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [f"{name}.py"])
        patch.syspath_prepend(FOLDER)
        return runpy.run_path(str(FOLDER / f"{name}.py"))


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_find_what_is_known_for_the_body_of_their_file(name):
    """A script ends with an error if a number is off. Its mesh is that of the problem file of its name."""
    mesh, same = example(name).problem.mesh, script(name)["mesh"]
    assert mesh.vertices == pytest.approx(same.vertices, rel=1e-14, abs=1e-14 * mesh.length)
    assert mesh.edge_sets.keys() == same.edge_sets.keys()
    assert len((FOLDER / f"{name}.py").read_text(encoding="utf-8").splitlines()) <= 75


@pytest.mark.parametrize("name", [name for name in SCRIPTS if name != "trapezoid"])  # whose script refines
def test_a_file_is_the_problem_of_its_script(name):
    result = script(name).get("result") or solve(script(name)["pushed"](0.3, 0.99 * script(name)["exact"]))
    for contact, line in answer(name).contacts.items():
        same = result.contacts[contact]
        size = np.abs(same.normal_stress).max()
        assert line.normal_stress == pytest.approx(same.normal_stress, abs=1e-6 * size)
        assert line.tangential_stress == pytest.approx(same.tangential_stress, abs=1e-6 * size)


def test_trapezoid_has_the_bounds_of_its_comments():
    bounds = answer("trapezoid").bracket.forces["base.normal_force"]
    assert bounds.lower == pytest.approx(14.02, rel=1e-3)
    assert bounds.lower < 14.0483793 < bounds.upper


def test_the_lug_hangs_on_its_pin():
    result = answer("lug")
    held, pin = result.resultant("held"), result.plate_force("bore")
    assert (held.x, pin.x) == pytest.approx((-4000.0, 4000.0), rel=1e-12)
    assert held.y == pytest.approx(0.0, abs=1e-9)
    assert result.plates["bore"].x == pytest.approx(0.2573, rel=1e-3)
    shares = result.contacts["bore"].shares
    assert shares["stick"] == 0.0
    assert 0.4 < shares["slip"] < 0.5
    assert len(result.problem.mesh.arcs) == 2


@pytest.mark.parametrize(("name", "made"), [("masonry_wall", masonry_wall), ("jointed_slope", jointed_slope)])
def test_blocks_are_those_of_the_gallery(name, made):
    file, same = example(name).problem, made()
    same_edges = {edges: pairs.tolist() for edges, pairs in same.mesh.edge_sets.items()}
    assert {edges: pairs.tolist() for edges, pairs in file.mesh.edge_sets.items()} == same_edges
    assert {contact.name for contact in file.contacts} == {contact.name for contact in same.contacts}
    load = {"masonry_wall": "wind", "jointed_slope": "water"}[name]
    limit = script(name)["limit"]
    assert limit.upper == pytest.approx({"wind": 10.27026, "water": 1.323803}[load], rel=1e-6)


@pytest.mark.parametrize("off", [0.0, 2e-3])
def test_a_script_that_is_off_ends_with_an_error(off, monkeypatch, capsys):
    monkeypatch.syspath_prepend(FOLDER)
    monkeypatch.setattr(sys, "argv", ["script.py"])
    known = runpy.run_path(str(FOLDER / "known.py"))
    rows = [known["Known"]("force", 10.0, 10.0 * (1.0 + off), 1e-3, "balance")]
    if off:
        with pytest.raises(SystemExit) as ended:
            known["compare"](rows, answer("punch"), None)
        assert ended.value.code == 1
    else:
        known["compare"](rows, answer("punch"), None)
    assert ("OFF" in capsys.readouterr().out) == bool(off)


@pytest.mark.parametrize("name", SCRIPTS)
def test_committed_meshes_are_those_of_their_outlines(name):
    pytest.importorskip("gmsh", exc_type=ImportError)
    made = runpy.run_path(str(FOLDER / "meshes" / "make.py"))["BODIES"][name]()
    mesh = example(name).problem.mesh
    assert made.edge_sets.keys() == mesh.edge_sets.keys()
    for edges in mesh.edge_names:
        # mesh files know no circles: they have chords where outlines have arcs, unless a problem names these
        chords = made.edges(edges).curved and not mesh.edges(edges).curved
        rel = 2e-3 if chords else 1e-6
        assert made.edges(edges).length.sum() == pytest.approx(mesh.edges(edges).length.sum(), rel=rel)
    assert set(made.region_names) <= set(mesh.region_names)


def test_meshes_stay_small():
    assert max(path.stat().st_size for path in (FOLDER / "meshes").glob("*.msh")) <= 100_000


def test_the_known_force_of_the_trapezoid_is_that_of_displacements_of_high_degree():
    """NGSolve on triangles graded to the corners by 0.2; the energy of displacements bounds the force from above."""
    pytest.importorskip("ngsolve")
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
