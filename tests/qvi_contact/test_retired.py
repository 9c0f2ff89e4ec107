"""What version 0.1 had and this one has not: files, names, arguments and options end in one line that says what to do.

The files in `old` were written by version 0.1.
"""

import importlib
from pathlib import Path

import pytest

from qvi_contact import InputError, load_problem, load_result, solve
from qvi_contact.gallery import compressed_plate

OLD = Path(__file__).parent / "old"


def refusal(use):
    with pytest.raises(InputError) as caught:
        use()
    assert len(str(caught.value).splitlines()) == 1
    return caught.value


@pytest.mark.parametrize(
    ("name", "instead"), [("RectilinearMesh", "TriangleMesh.grid"), ("stream_sweep", r"solve_sweep(")]
)
def test_names_that_were_imported(name, instead):
    found = refusal(lambda: getattr(importlib.import_module("qvi_contact"), name))
    assert found.value == name
    assert instead in found.remedy


@pytest.mark.parametrize("name", ["rectangles.npz", "steps_of_rectangles/step-000001.npz"])
def test_archives_of_rectangles(name):
    found = refusal(lambda: load_result(OLD / name))
    assert "rectangles" in found.remedy
    assert "solve its problem again" in found.remedy


def test_an_archive_of_triangles_is_read_as_before():
    result = load_result(OLD / "grid_of_triangles.npz")
    assert result.status == "solved"
    assert result.contacts["bottom"].normal_force == pytest.approx(1.4408063363934915, rel=1e-9)
    again = solve(load_problem(OLD / "grid.toml").problem, law_on="edges")
    assert again.contacts["bottom"].normal_force == pytest.approx(1.4408063363934915, rel=1e-7)
    assert again.contacts["bed"].tangential_force == pytest.approx(0.08427127886032235, rel=1e-7)


def test_problem_files():
    found = refusal(lambda: load_problem(OLD / "rectangles.toml"))
    assert (found.field, "leave this key out" in found.remedy) == ("solve.element", True)
    file = load_problem(OLD / "grid.toml")
    assert dict(file.solve_options) == {"law_on": "points"}
    assert file.problem.mesh.cell_count == 10
    assert file.problem.mesh.edge_names[-2:] == ("roof", "step")
    assert file.problem.cell_materials.tolist() == [0] * 6 + [1] * 4


def test_the_law_had_another_name(shell):
    found = refusal(lambda: solve(compressed_plate(0.2), contact_rows="gauss"))
    assert (found.field, "law_on" in found.remedy) == ("contact_rows", True)
    status, _, err = shell("solve", OLD / "grid.toml", "--contact-rows", "gauss")
    assert (status, "law_on" in err) == (2, True)
