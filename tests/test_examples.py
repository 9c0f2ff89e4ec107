"""Every file in the folder examples says what to expect, and keeps what it promises.

The chapter of examples of the verification manual solves and certifies every file as it stands, see its quick run in
`tests/comparisons/test_verification.py`, and measures forces that are known by hand. Here is what that leaves out.
"""

import runpy
import sys
from contextlib import nullcontext
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from qvi_contact import load_problem, solve
from qvi_contact.gallery import jointed_slope, masonry_wall
from qvi_contact.solution import solve_history
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


@pytest.mark.parametrize("name", FILES)
def test_the_comments_say_what_to_expect(name):
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    comments = [line for line in text.splitlines() if line.startswith("#")]
    assert f"examples/{name}.toml" in text
    assert any("xpect" in line for line in comments)
    assert max(map(len, text.splitlines())) <= 120
    assert example(name).title


def test_punch_carries_its_force_and_peaks_at_its_edges():
    line = answer("punch").contacts["punch"]
    assert line.normal_force == pytest.approx(100.0, rel=1e-9)
    assert line.tangential_force == pytest.approx(0.0, abs=1e-4)  # 2e-3 if triangles were not symmetric
    middle = -np.interp(0.0, line.x, line.normal_stress)
    assert middle == pytest.approx(100.0 / np.pi, rel=0.06)
    assert -line.normal_stress[[0, -1]].max() > 3.0 * middle
    assert line.shares["stick"] == pytest.approx(0.775, abs=0.03)
    assert np.abs(line.x[line.state == 2]).min() > 0.74


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


def test_a_script_that_is_off_ends_with_an_error(capsys):
    known = script("known")
    for off in (0.0, 2e-3):
        rows = [known["Known"]("force", 10.0, 10.0 * (1.0 + off), 1e-3, "balance")]
        with pytest.raises(SystemExit) if off else nullcontext() as ended:
            known["compare"](rows, answer("punch"), None)
        assert ("OFF" in capsys.readouterr().out) == bool(off)
    assert ended.value.code == 1


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


@pytest.mark.parametrize("name", SCRIPTS)
def test_committed_meshes_are_those_of_their_outlines(name):
    pytest.importorskip("gmsh", exc_type=ImportError)
    made = runpy.run_path(str(FOLDER / "meshes" / "make.py"))["BODIES"][name]()
    mesh = example(name).problem.mesh
    assert max(path.stat().st_size for path in (FOLDER / "meshes").glob("*.msh")) <= 100_000
    assert made.edge_sets.keys() == mesh.edge_sets.keys()
    for edges in mesh.edge_names:
        # mesh files know no circles: they have chords where outlines have arcs, unless a problem names these
        chords = made.edges(edges).curved and not mesh.edges(edges).curved
        rel = 2e-3 if chords else 1e-6
        assert made.edges(edges).length.sum() == pytest.approx(mesh.edges(edges).length.sum(), rel=rel)
    assert set(made.region_names) <= set(mesh.region_names)
