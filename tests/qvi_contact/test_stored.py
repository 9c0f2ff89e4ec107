"""Results in files: read back they are the same, and whatever was changed in them does not verify."""

import json
import os
import tracemalloc
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

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
from qvi_contact.export import field_arrays, write_npz
from qvi_contact.files.archive import FORMAT_VERSION, Archive, digest, write_archive
from qvi_contact.files.stored import load_result
from qvi_contact.gallery import compressed_plate
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
    "scales", "status", "strict", "tangential_multiplier", "threshold", "timings", "tolerance", "traction_misfit",
    "versions", "x_lines", "y_lines", "z",
)  # fmt: skip
FIELDS = (
    "x", "y", "weights", "friction", "friction_bound", "normal_stress", "tangential_stress", "gap", "slip", "state",
    "excess_between_points", "pull_between_points", "normal_force", "tangential_force",
)  # fmt: skip
CHANGED = (
    "active", "airy", "certificate", "earlier_slip", "energies", "gauss_x", "iterations", "message", "plate.motion",
    "scales", "strict", "tolerance", "z", "ground.friction", "ground.tangential_stress", "joint.state",
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

    def test_every_bit_of_the_solution(self, result, path):
        again = load_result(path)
        for name in ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold"):
            assert np.array_equal(getattr(again.solution, name), getattr(result.solution, name)), name
        for name in ("status", "method", "inner", "form", "factorisation", "iterations", "history", "corrections"):
            assert getattr(again.solution, name) == getattr(result.solution, name), name
        assert again.message == result.message
        assert again.solution.timings == dict(result.solution.timings)
        assert again.solution.versions.items() >= result.solution.versions.items()
        assert again.certificate == replace(result.certificate, scales=dict(result.certificate.scales))
        assert again.discretization.scales == result.discretization.scales

    def test_all_fields(self, result, path):
        again = field_arrays(load_result(path))
        for name, values in field_arrays(result).items():
            assert np.asarray(again[name]) == pytest.approx(np.asarray(values), rel=1e-10, abs=1e-12, nan_ok=True), name

    def test_the_problem_with_its_units_and_title(self, path):
        text = Archive(path).text("problem")
        assert 'title = "The stack"' in text
        assert 'stress = "kPa"' in text
        assert "0.2 + 0.1 * x" in text

    def test_it_verifies(self, path):
        assert fails(path) == set()

    @pytest.mark.parametrize("inner", ["strict-direct:clarabel"])
    def test_strict_results_stay_strict(self, inner, tmp_path):
        result = solve(compressed_plate(0.2, (4, 3)), inner=inner)
        write_npz(tmp_path / "a.npz", result)
        again = load_result(tmp_path / "a.npz")
        assert again.solution.problem.strict
        assert again.solution.inner == inner
        assert fails(tmp_path / "a.npz") == set()

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

    def test_a_failed_result_is_kept_as_such(self, tmp_path):
        result = solve(compressed_plate(0.2, (4, 4)), method="fixed-point", max_iterations=1)
        write_npz(tmp_path / "a.npz", result)
        assert load_result(tmp_path / "a.npz").status is Status.MAX_ITERATIONS
        assert "friction" in fails(tmp_path / "a.npz")


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

    @pytest.mark.parametrize("name", ["certificate", "digest", "format", "z", "plate.slip"])
    def test_an_entry_missing(self, name, entries, tmp_path):
        without = {key: value for key, value in entries.items() if key != name}
        found = fails(stored(tmp_path / "a.npz", without, forged=name != "digest"))
        assert isinstance(found, str)
        assert name in found or name == "format"

    @pytest.mark.parametrize("name", ["airy", "freed", "tolerance", "plate.state"])
    def test_an_entry_of_another_kind(self, name, entries, tmp_path):
        assert fails(stored(tmp_path / "a.npz", entries | {name: np.array(3.5 + 1j)}, forged=name != "digest"))

    @pytest.mark.parametrize(
        ("old", "new"),
        [("friction = 0.3", "friction = 0.300003"), ("0.1 * x", "0.10001 * x"), ("young = 10000.0", "young = 10000.1"),
         ("force_y = -10.0", "force_y = -10.0001"), ("force_x = 1.5", "force_x = 1.50001")],
    )  # fmt: skip
    def test_another_problem(self, old, new, entries, tmp_path):
        text = str(entries["problem"])
        assert old in text
        assert fails(stored(tmp_path / "a.npz", entries | {"problem": np.array(text.replace(old, new))}))

    @pytest.mark.parametrize("word", ["inaccurate", "nonsense"])
    def test_another_status(self, word, entries, tmp_path):
        changes = {"status": np.array(word), "message": np.array(word)}
        assert fails(stored(tmp_path / "a.npz", entries | changes))

    @pytest.mark.parametrize("field", ["normal_stress", "tangential_stress"])
    def test_every_traction(self, field, entries, tmp_path):
        values = entries[f"ground.{field}"]
        for point in (0, 11):
            shifted = values.copy()
            shifted[point] *= 1.0 + 1e-5
            assert "ground: tractions" in fails(stored(tmp_path / "a.npz", entries | {f"ground.{field}": shifted}))

    @settings(max_examples=10, deadline=None, derandomize=True)
    @given(
        places=st.lists(st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=4)
    )
    def test_bytes_changed_anywhere(self, places, path, entries, tmp_path_factory):
        """Refused, or not verified, or without any consequence for what is in the file."""
        content = bytearray(path.read_bytes())
        for share, change in places:
            content[int(share * len(content))] ^= change
        broken = tmp_path_factory.mktemp("bytes") / "a.npz"
        broken.write_bytes(bytes(content))
        if fails(broken) == set():
            same = Archive(broken).arrays
            assert digest(same) == digest(entries)


class TestForged:
    """Files changed by someone who knows the format: a right digest, and claims that fit each other."""

    def forged(self, tmp_path, entries, **changes):
        new = entries | {name: np.array(value) for name, value in changes.items()}
        return stored(tmp_path / "forged.npz", new)

    @pytest.mark.parametrize("message", ["not solved", "solvedish"])
    def test_the_message_begins_with_the_status(self, message, entries, tmp_path):
        assert fails(self.forged(tmp_path, entries, message=message)) == {"status"}

    @pytest.mark.parametrize(
        ("group", "name", "value", "row"),
        [("measures", "normal", np.nan, "claimed measures"), ("measures", "nonsense", 0.0, "claimed measures"),
         ("signed", "bipotential", 0.5, "claimed measures"), ("signed", "bipotential", np.nan, "claimed measures"),
         ("signed", "nonsense", 0.0, "claimed measures"), ("scales", "stress", 2.0, "claimed scales"),
         ("scales", "energy", np.nan, "claimed scales"), ("scales", "nonsense", 1.0, "claimed scales"),
         ("scales", "rounding", 1e-3, "claimed scales")],
    )  # fmt: skip
    def test_numbers_of_the_certificate(self, group, name, value, row, entries, tmp_path):
        groups = json.loads(str(entries["certificate"]))
        groups[group][name] = value
        path = self.forged(tmp_path, entries, certificate=json.dumps(groups))
        assert row in fails(path) <= {row, "status"}

    def test_measures_below_zero_are_refused(self, entries, tmp_path):
        groups = json.loads(str(entries["certificate"]))
        groups["measures"]["normal"] = -1.0
        assert "below zero" in fails(self.forged(tmp_path, entries, certificate=json.dumps(groups)))

    @pytest.mark.parametrize("name", ["wall.normal_force", "ground.motion", "nonsense"])
    def test_fields_that_this_problem_does_not_have(self, name, entries, tmp_path):
        path = self.forged(tmp_path, entries, **{name: np.zeros(3)})
        assert fails(path) == {"entries"}
        assert f"Not as expected: {name}." in verify_file(path).table()

    @pytest.mark.parametrize("name", ["airy", "gauss_x", "ground.x"])
    def test_texts_in_the_place_of_numbers(self, name, entries, tmp_path):
        assert fails(self.forged(tmp_path, entries, **{name: entries[name].astype("U")}))

    def test_a_tolerance_so_loose_that_everything_passes(self, tmp_path):
        """The file may not choose what it is measured by; who verifies may."""
        result = solve(compressed_plate(0.2, (3, 3)), tolerance=0.99, method="fixed-point", max_iterations=1)
        assert result.status is Status.SOLVED
        write_npz(tmp_path / "a.npz", result)
        assert fails(tmp_path / "a.npz") == {"tolerance"}
        assert verify_file(tmp_path / "a.npz", 0.99).passed
        assert {row.name for row in verify_file(tmp_path / "a.npz", 1e-8).failures} >= {"natural_map"}

    @pytest.mark.parametrize(("name", "value"), [("z", 1e160), ("z", 1e308), ("scales", 1e308)])
    def test_absurd_numbers(self, name, value, entries, tmp_path):
        """Warnings are errors here."""
        assert fails(self.forged(tmp_path, entries, **{name: np.full_like(entries[name], value)}))

    @pytest.mark.parametrize("value", [-1.0, 2.5, 1e400])
    def test_numbers_of_iterations(self, value, entries, tmp_path):
        assert "number of iterations" in fails(self.forged(tmp_path, entries, iterations=value))

    @pytest.mark.parametrize(
        ("old", "new"), [("young = 10000.0", "young = -1.0"), ("[mesh]", "[mush]"), ("version", "= version")]
    )
    def test_a_broken_problem_is_said_with_the_name_of_the_file(self, old, new, entries, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)  # long names are shortened
        self.forged(tmp_path, entries, problem=str(entries["problem"]).replace(old, new))
        found = fails("forged.npz")
        assert isinstance(found, str)
        assert "forged.npz" in found
        assert "entry 'problem'" in found
        assert len(found.splitlines()) == 1


class TestRefused:
    """Files that are no results: one line with what to do."""

    @pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
    def test_truncated(self, share, path, tmp_path):
        content = path.read_bytes()
        (tmp_path / "a.npz").write_bytes(content[: int(share * len(content))])
        assert "cannot be read" in fails(tmp_path / "a.npz")

    def test_what_is_no_archive(self, tmp_path):
        (tmp_path / "a.npz").write_text("x, y\n1, 2\n")
        assert "not an archive, or holds pickled objects" in fails(tmp_path / "a.npz")
        np.save(tmp_path / "a.npy", np.ones(3))
        assert "single array" in fails(tmp_path / "a.npy")
        np.savez(tmp_path / "other.npz", x=np.ones(3))
        assert "not a result" in fails(tmp_path / "other.npz")
        assert "No such file" in fails(tmp_path / "missing.npz")
        assert "cannot be read" in fails(tmp_path)

    def test_more_bytes_than_the_limit_are_not_read(self, tmp_path, monkeypatch):
        """The sizes stand in the archive's directory; a megabyte of it can hold a gigabyte of zeros."""
        np.savez_compressed(tmp_path / "a.npz", z=np.zeros(5_000_000))
        assert (tmp_path / "a.npz").stat().st_size < 100_000
        monkeypatch.setattr("solvers.basics.archives.LARGEST", 39_000_000)
        tracemalloc.start()
        try:
            assert "40000128 bytes, more than the limit of 39000000" in fails(tmp_path / "a.npz")
            assert tracemalloc.get_traced_memory()[1] < 5_000_000
        finally:
            tracemalloc.stop()

    def test_devices_are_not_read(self):
        """The end of /dev/zero, where an archive has its directory, is nowhere."""
        assert "not a regular file" in fails(os.devnull)

    def test_a_long_problem_is_refused_before_it_is_parsed(self, entries, tmp_path):
        problem = str(entries["problem"]) + "\nzeros = [" + "0," * 1_000_000 + "]"
        assert "200000 numbers" in fails(stored(tmp_path / "a.npz", entries | {"problem": np.array(problem)}))

    def test_items_without_a_size_are_not_listed(self, entries, tmp_path):
        """A header alone can claim a thousand million empty texts."""
        np.savez(tmp_path / "a.npz", **entries)
        header = np.lib.format.magic(1, 0)
        text = b"{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000,), }"
        text += b" " * (64 - (len(header) + 3 + len(text)) % 64) + b"\n"
        with zipfile.ZipFile(tmp_path / "a.npz") as old, zipfile.ZipFile(tmp_path / "b.npz", "w") as new:
            for name in old.namelist():
                content = header + len(text).to_bytes(2, "little") + text
                new.writestr(name, content if name == "history_status.npy" else old.read(name))
        assert "more items than bytes" in fails(tmp_path / "b.npz")

    def test_pickles_are_never_loaded(self, entries, tmp_path):
        np.savez(tmp_path / "a.npz", **entries | {"z": np.array([{}], dtype=object)})
        assert "pickled objects" in fails(tmp_path / "a.npz")

    def test_another_version(self, entries, tmp_path):
        other = entries | {"format_version": np.array(FORMAT_VERSION + 1)}
        assert f"only version {FORMAT_VERSION} is known" in fails(stored(tmp_path / "a.npz", other))

    def test_functions_of_python_cannot_be_kept(self, tmp_path):
        """The fields can, and it is said what to do about it."""
        problem = compressed_plate(0.2, (2, 2))
        contact = Contact("top", friction=lambda x, y: 0.2 + 0.0 * x + 0.0 * y, gap=-1e-3, name="plate")
        conditions = [contact if isinstance(part, Contact) else part for part in problem.conditions]
        write_npz(tmp_path / "a.npz", solve(replace(problem, conditions=conditions)))
        found = fails(tmp_path / "a.npz")
        assert "contacts[0].friction" in found
        assert "Expression" in found
        assert "verify_result" in found
        assert Archive(tmp_path / "a.npz").floats("plate.normal_stress").min() < 0.0

    def test_vectors_of_another_length(self, entries, tmp_path):
        for name in ("z", "earlier_slip", "scales"):
            other = entries | {name: np.append(entries[name], 0.0)}
            assert name in fails(stored(tmp_path / "a.npz", other))

    @pytest.mark.parametrize("text", ["{}", "[]", "3", "{", '{"measures": {"normal": "small"}}', "[" * 100_000])
    def test_a_certificate_that_is_none(self, text, entries, tmp_path):
        assert "certificate" in fails(stored(tmp_path / "a.npz", entries | {"certificate": np.array(text)}))


def test_the_digest_depends_on_names_kinds_shapes_and_values():
    arrays = {"a": np.arange(4.0), "b": np.array("text")}
    same = digest({"b": np.array("text"), "a": np.arange(4.0), "digest": np.array("anything")})
    assert digest(arrays) == same
    for other in (
        {"c": np.arange(4.0), "b": np.array("text")},
        {"a": np.arange(4), "b": np.array("text")},
        {"a": np.arange(4.0).reshape(2, 2), "b": np.array("text")},
        {"a": np.arange(4.0) + 1e-16 * np.arange(4.0), "b": np.array("Text")},
    ):
        assert digest(other) != same


def test_nothing_is_left_behind_by_a_write_that_fails(tmp_path):
    target: Path = tmp_path / "missing" / "a.npz"
    with pytest.raises(InputError, match="cannot be written"):
        write_archive(target, {"a": np.ones(2)})
    assert list(tmp_path.iterdir()) == []
