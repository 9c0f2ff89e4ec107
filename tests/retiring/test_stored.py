"""Results in files: read back they are the same, and whatever was changed in them does not verify."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Traction,
    solve,
    solve_history,
)
from qvi_contact.export import write_npz
from qvi_contact.files.archive import Archive, digest
from qvi_contact.files.stored import load_result
from qvi_contact.units import Units
from qvi_contact.verification import verify_file
from solvers import Status

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # entries, and what is changed in them, are those of grids; triangles: test_triangle_results

REMARKS = {
    "method", "inner", "form", "factorisation", "iterations", "corrections", "timings", "versions", "history",
    "history_status", "problem_missing", "loaded", "message", "freed",
}  # fmt: skip
"""Entries about how the result was found, the message after its first words, a node without a shear to give up.

Only the digest protects them.
"""

FLOORS = {"gap": 1e-3, "slip": 1e-3, "traction_misfit": 1.0, "normal_multiplier": 1.0}
"""Sizes of what may be zero but for rounding."""


def stack(push):
    """Two blocks, a joint, a plate driven by force; a body force, functions of x, and shear beside a contact."""
    plate = RigidPlate(force_x=push, force_y=-10.0)
    mesh = RectilinearMesh.rectangle((3, 4), width=1.0, height=2.0).with_joint("joint", "horizontal", at=1.0)
    conditions = [
        Contact("bottom", friction=Expression("0.2 + 0.1 * x"), cohesion=0.01, name="ground"),
        Contact("joint", friction=0.3, law="bilateral"),
        Contact("top", friction=0.8, plate=plate, name="plate"),
        Traction("left", x=0.0, y=0.0),
        Traction("right", x=0.0, y=0.0),
    ]
    regions = [Region(Material(2e4, 0.3, "strain"), y=(1.0, 2.0))]
    return ContactProblem(mesh, Material(1e4, 0.2, "strain"), conditions, regions=regions)


@pytest.fixture(scope="module")
def result():
    """The second step of a history, with slip before it."""
    step = solve_history([stack(1.4), stack(1.5)], inner="direct:clarabel").steps[-1]
    assert step.status is Status.SOLVED, step.message
    assert np.abs(step.contacts["ground"].slip).max() > 0.0
    return step


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "result.npz"
    write_npz(path, result, Units("m", "kPa"), "The stack")
    return path


@pytest.fixture(scope="module")
def entries(path):
    return Archive(path).arrays


NAMES = (
    "active", "airy", "centres", "certificate", "contact_rows", "corrections", "cuts", "degree", "digest",
    "earlier_slip", "energies", "equality_multiplier", "factorisation", "form", "format", "format_version", "freed",
    "gauss_stress", "gauss_x", "gauss_y", "history", "history_status", "inner", "iterations", "loaded", "material",
    "message", "method", "normal_multiplier", "plate.motion", "problem", "problem_missing", "reach", "remarks",
    "scales", "status", "tangential_multiplier", "threshold", "timings", "tolerance", "traction_misfit",
    "versions", "x_lines", "y_lines", "z",
)  # fmt: skip
FIELDS = (
    "x", "y", "weights", "friction", "friction_bound", "normal_stress", "tangential_stress", "gap", "slip", "state",
    "excess_between_points", "pull_between_points", "normal_force", "tangential_force",
)  # fmt: skip
CHANGED = (
    "active", "airy", "certificate", "earlier_slip", "energies", "gauss_x", "iterations", "message", "plate.motion",
    "scales", "tolerance", "z", "ground.friction", "ground.tangential_stress", "joint.state",
)  # fmt: skip
ALL = (*NAMES, *(f"{contact}.{field}" for contact in ("ground", "joint", "plate") for field in FIELDS))


def stored(path, arrays, *, forged=True):
    """Write entries, with the digest they had or, forged, with their own."""
    entries = dict(arrays)
    if forged:
        entries["digest"] = np.array(digest(entries))
    np.savez(path, **entries)
    return path


def edited(name, array, size=1e-5):
    """The entry with one thing changed: the largest number by a share of itself, one letter, one flag."""
    new = np.array(array)
    if new.dtype.kind == "U":
        text = str(new) if new.ndim == 0 else "".join(new)
        return np.array(text + "x") if new.ndim == 0 else np.array(["stalled", *new[1:]])
    if new.size == 0:
        return np.append(new, np.ones(1, dtype=new.dtype))
    place = np.unravel_index(np.nanargmax(np.abs(new)), new.shape)
    if new.dtype.kind == "f":
        floor = FLOORS.get(name.rpartition(".")[2], 0.0)
        new[place] += size * (max(abs(new[place]), floor) or 1.0)
    else:
        new[place] = not new[place] if new.dtype.kind == "b" else new[place] + 1
    return new


def fails(path):
    """Names of the checks that fail, or the message with which the file is refused."""
    try:
        return {row.name for row in verify_file(path).failures}
    except InputError as error:
        return str(error)


class TestRoundTrip:
    """What is read is what was written."""

    def test_a_shear_given_up_in_a_corner(self, tmp_path):
        sides = [Traction("left", x=0.0, y=4.0), Traction("right", x=0.0, y=-4.0)]
        top = [Displacement("top", y=-1e-3), Traction("top", x=0.0)]
        mesh = RectilinearMesh.rectangle((3, 3))
        result = solve(ContactProblem(mesh, Material(1e4, 0.3), [Contact("bottom", 0.2), *sides, *top]))
        if not len(result.discretization.freed):
            result = solve(result.discretization.freeing(np.array([0])))
        assert result.has_state
        write_npz(tmp_path / "a.npz", result)
        again = load_result(tmp_path / "a.npz")
        assert again.discretization.freed.tolist() == result.discretization.freed.tolist() != []
        assert fails(tmp_path / "a.npz") == set()
        entries = Archive(tmp_path / "a.npz").arrays | {"freed": np.zeros(0, dtype=np.int64)}
        assert fails(stored(tmp_path / "b.npz", entries))


class TestEdited:
    """A file changed by hand, one entry at a time."""

    def test_the_list_of_entries_is_complete(self, entries):
        assert sorted(entries) == sorted(ALL)

    @pytest.mark.parametrize("name", CHANGED)
    def test_an_entry_changed(self, name, entries, tmp_path):
        """Always seen by the digest; with a digest forged as well, by the numbers."""
        new = entries | {name: edited(name, entries[name])}
        assert digest(new) != str(entries["digest"]) or name == "digest"
        if name in REMARKS | {"digest", "tolerance"}:
            found = fails(stored(tmp_path / "a.npz", new, forged=False))
            assert isinstance(found, str) or found == {"digest"}
            return
        found = fails(stored(tmp_path / "a.npz", new))
        assert found
        assert isinstance(found, str) or "digest" not in found

    @pytest.mark.parametrize("field", ["normal_stress", "tangential_stress"])
    def test_every_traction(self, field, entries, tmp_path):
        values = entries[f"ground.{field}"]
        for point in (0, 11):
            shifted = values.copy()
            shifted[point] *= 1.0 + 1e-5
            assert "ground: tractions" in fails(stored(tmp_path / "a.npz", entries | {f"ground.{field}": shifted}))


class TestForged:
    """Files changed by someone who knows the format: a right digest, and claims that fit each other."""

    def forged(self, tmp_path, entries, **changes):
        new = entries | {name: np.array(value) for name, value in changes.items()}
        return stored(tmp_path / "forged.npz", new)

    @pytest.mark.parametrize("name", ["airy", "gauss_x", "ground.x"])
    def test_texts_in_the_place_of_numbers(self, name, entries, tmp_path):
        assert fails(self.forged(tmp_path, entries, **{name: entries[name].astype("U")}))
