"""Files in the folder examples keep what they promise.

What is known of them is one table, `comparisons/verification/known.py`, which the chapter of examples of the manual
compares; a quick run of it is in `tests/comparisons/test_verification.py`. Here is what that leaves out.
"""

import re
import runpy
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from qvi_contact import TriangleMesh, load_problem, solve
from qvi_contact.gallery import jointed_slope, masonry_wall

FOLDER = Path(__file__).parent.parent / "examples"
MESHES = sorted(path.stem for path in (FOLDER / "meshes").glob("*.msh") if path.stem != "lug")

pytestmark = pytest.mark.filterwarnings("error")


@cache
def example(name):
    return load_problem(FOLDER / f"{name}.toml")


def test_the_script_states_the_problem_of_its_file(capsys):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["gravity_dam.py"])
        found = runpy.run_path(str(FOLDER / "gravity_dam.py"))
    file = example("gravity_dam")
    line, same = solve(file.problem, **file.solve_options).contacts["base"], found["result"].contacts["base"]
    size = np.abs(line.normal_stress).max()
    assert line.normal_stress == pytest.approx(same.normal_stress, abs=1e-6 * size)
    assert line.tangential_stress == pytest.approx(same.tangential_stress, abs=1e-6 * size)
    for printed in capsys.readouterr().out.splitlines()[1:]:  # a computed number, or two, and that by hand
        *computed, by_hand = map(float, re.findall(r"\d\.\d{6}", printed))
        assert computed == pytest.approx([by_hand] * len(computed), rel=2e-6)


@pytest.mark.parametrize(("name", "made"), [("masonry_wall", masonry_wall), ("jointed_slope", jointed_slope)])
def test_blocks_are_those_of_the_gallery(name, made):
    file, same = example(name).problem, made()
    same_edges = {edges: pairs.tolist() for edges, pairs in same.mesh.edge_sets.items()}
    assert {edges: pairs.tolist() for edges, pairs in file.mesh.edge_sets.items()} == same_edges
    assert {contact.name for contact in file.contacts} == {contact.name for contact in same.contacts}


@pytest.mark.parametrize("name", MESHES)
def test_committed_meshes_are_those_of_their_outlines(name):
    pytest.importorskip("gmsh", exc_type=ImportError)
    made = runpy.run_path(str(FOLDER / "meshes" / "make.py"))["BODIES"][name]()
    made = TriangleMesh.joined("seam", made) if isinstance(made, list) else made
    mesh = example(name).problem.mesh
    assert max(path.stat().st_size for path in (FOLDER / "meshes").glob("*.msh")) <= 100_000
    assert made.edge_sets.keys() == mesh.edge_sets.keys()
    for edges in mesh.edge_names:
        # mesh files know no circles: they have chords where outlines have arcs, unless a problem names these
        chords = made.edges(edges).curved and not mesh.edges(edges).curved
        rel = 2e-3 if chords else 1e-6
        assert made.edges(edges).length.sum() == pytest.approx(mesh.edges(edges).length.sum(), rel=rel)
    assert set(made.region_names) <= set(mesh.region_names)
