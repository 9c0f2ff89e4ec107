"""Results on triangles in files: read back they are the same, and whatever was changed in them does not verify."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from qvi_contact import load_result, solve, solve_history
from qvi_contact.cli import group
from qvi_contact.export import field_arrays, write_npz
from qvi_contact.files.archive import Archive
from qvi_contact.gallery import compressed_plate
from tests.qvi_contact.test_stored import edited, fails, stack, stored

VECTORS = ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold")


@pytest.fixture(scope="module")
def result():
    """The second step of a history on triangles, with slip before it, a plate driven by force, a joint, a region."""
    steps = [stack(2.0), stack(2.2)]
    history = solve_history(steps, element="hct", degree=3)
    assert history.status == "solved"
    assert np.abs(history.steps[0].contacts["plate"].slip).max() > 1e-5
    return history.steps[-1]


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "result.npz"
    write_npz(path, result)
    return path


@pytest.fixture(scope="module")
def entries(path):
    return Archive(path).arrays


def test_what_is_read_is_what_was_written(result, path):
    again = load_result(path)
    for name in VECTORS:
        assert np.array_equal(getattr(again.solution, name), getattr(result.solution, name)), name
    assert again.problem.mesh.same_as(result.problem.mesh)
    assert again.discretization.space.degree == 3
    assert again.discretization.space.contact_rule.kind == result.discretization.space.contact_rule.kind
    found = field_arrays(again)
    for name, values in field_arrays(result).items():
        assert np.asarray(found[name]) == pytest.approx(np.asarray(values), rel=1e-10, abs=1e-12), name
    assert fails(path) == set()


def test_gauss_rows_are_kept(tmp_path):
    write_npz(tmp_path / "a.npz", solve(compressed_plate(0.2, (2, 2)), element="hct", degree=5, contact_rows="gauss"))
    assert load_result(tmp_path / "a.npz").discretization.space.contact_rule.kind == "gauss"
    assert fails(tmp_path / "a.npz") == set()


def test_unknowns_are_read_from_where_they_count(tmp_path):
    """Small cells in two places: read from elsewhere, unknowns load as solved, with other stresses."""
    plate = compressed_plate(0.2, (2, 2)).triangulated()
    problem = replace(plate, mesh=plate.mesh.graded([(1.0, 1.0), (0.5, 1.0)], 11))
    write_npz(tmp_path / "a.npz", solve(problem, degree=3, method="condensed"))
    entries = dict(Archive(tmp_path / "a.npz").arrays)
    assert len(entries["centres"]) == 2
    assert fails(tmp_path / "a.npz") == set()
    assert "counts from other vertices" in fails(
        stored(tmp_path / "b.npz", entries | {"centres": entries["centres"][:1]})
    )
    del entries["centres"]
    assert "counts from other vertices" in fails(stored(tmp_path / "c.npz", entries))


def test_whatever_is_changed_is_seen(entries, tmp_path):
    """Also where the digest was forged: the numbers disagree, or the file is refused."""
    for name in ("vertices", "cells", "degree", "z", "energies", "joint.slip", "earlier_slip"):
        found = fails(stored(tmp_path / "a.npz", entries | {name: edited(name, entries[name])}))
        assert found, name
        assert isinstance(found, str) or "digest" not in found


def test_the_triangles_of_the_problem_count(entries, tmp_path):
    text = str(entries["problem"])
    for old, new in (("[0.0, 0.5]", "[0.0, 0.50001]"), ("young = 20000.0", "young = 20000.1")):
        assert old in text
        assert fails(stored(tmp_path / "a.npz", entries | {"problem": np.array(text.replace(old, new))}))


def test_other_rows_are_other_unknowns(entries, tmp_path):
    other = {"gauss": "bernstein", "bernstein": "gauss"}[str(entries["contact_rows"])]
    assert fails(stored(tmp_path / "a.npz", entries | {"contact_rows": np.array(other)}))
    for wrong in (np.array(99), np.array(3.5), np.array("three")):
        assert isinstance(fails(stored(tmp_path / "a.npz", entries | {"degree": wrong})), str)


def test_results_without_these_entries_are_those_of_rectangles(tmp_path):
    """As version 0.1 wrote them."""
    write_npz(tmp_path / "a.npz", solve(compressed_plate(0.2, (2, 2))))
    old = {k: v for k, v in Archive(tmp_path / "a.npz").arrays.items() if k not in ("degree", "contact_rows")}
    assert fails(stored(tmp_path / "b.npz", old)) == set()


def test_a_mesh_file_is_never_asked_for_by_a_result(entries, tmp_path):
    """A result is checked from itself alone, whatever it names."""
    lines = str(entries["problem"]).splitlines()
    start, stop = lines.index("[mesh]") + 1, lines.index("[mesh.edges]")
    text = "\n".join([*lines[:start], 'file = "/etc/passwd.msh"', *lines[stop:]]).replace("[mesh.edges]", "")
    assert "mesh" in fails(stored(tmp_path / "a.npz", entries | {"problem": np.array(text)}))


def test_the_command(path):
    done = CliRunner().invoke(group, ["verify", str(path), "--json"], standalone_mode=False, catch_exceptions=False)
    assert json.loads(done.stdout)["passed"] is True
