"""Results and files of them: right ones pass their verification, and whatever was changed in one is found and named."""

import json
import os
import zipfile
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact import InputError, TriangleMesh, solve, solve_history, verify_result
from qvi_contact.export import field_arrays, write_npz
from qvi_contact.files import FORMAT_VERSION, Archive, digest, load_result
from qvi_contact.gallery import compressed_plate
from qvi_contact.mechanism import RigidMotion
from qvi_contact.problem import Contact, ContactProblem, Expression, Material, Region, RigidPlate, Symmetry, Traction
from qvi_contact.solution import ContactResult, Energies
from qvi_contact.units import Units
from qvi_contact.verification import verify_file
from solvers import Certificate, Status, certify
from solvers.certificate import EXPONENTS
from tests.qvi_contact.test_triangles import oblique

PERFECT = Certificate(dict.fromkeys(EXPONENTS, 0.0), 1e-8, {"stress": 1.0, "displacement": 1.0, "energy": 1.0})


def stack(push):
    """Two blocks, a joint, a plate driven by force; a body force, functions of x, and shear beside a contact."""
    plate = RigidPlate(force_x=push, force_y=-10.0)
    mesh = TriangleMesh.rectangle((3, 4), width=1.0, height=2.0).with_joint("joint", lambda _, y: y == 1.0)
    conditions = [
        Contact("bottom", friction=Expression("0.2 + 0.1 * x"), cohesion=0.01, name="ground"),
        Contact("joint", friction=0.3, law="bilateral"),
        Contact("top", friction=0.8, plate=plate, name="plate"),
        *(Traction(side, x=0.0, y=0.0) for side in ("left", "right")),
    ]
    regions = [Region(Material(2e4, 0.3, "strain"), y=(1.0, 2.0))]
    return ContactProblem(mesh, Material(1e4, 0.2, "strain"), conditions, regions=regions)


@pytest.fixture(scope="module")
def history():
    return solve_history([stack(1.4), stack(1.5)], inner="direct:clarabel")


@pytest.fixture(scope="module")
def result(history):
    """The second step of a history, with slip before it."""
    step = history.steps[-1]
    assert step.status is Status.SOLVED, step.message
    assert np.abs(step.contacts["ground"].slip).max() > 0.0
    return step


@pytest.fixture(scope="module")
def plate():
    """Stick and slip."""
    return solve(compressed_plate(0.2, (4, 3), width=1.5, grading=0.8))


@pytest.fixture(scope="module")
def unfinished():
    return solve(compressed_plate(0.2, (4, 4)), method="fixed-point", max_iterations=1)


@pytest.fixture(scope="module")
def path(result, tmp_path_factory):
    path = tmp_path_factory.mktemp("stored") / "result.npz"
    write_npz(path, result, Units("m", "kPa"), "The stack")
    return path


@pytest.fixture(scope="module")
def entries(path):
    return Archive(path).arrays


def stored(path, arrays, *, forged=True):
    """Write entries, with the digest they had or, forged, with their own."""
    entries = dict(arrays)
    if forged:
        entries["digest"] = np.array(digest(entries))
    np.savez(path, **entries)
    return path


def fails(path):
    """Names of the checks that fail, or the message with which the file is refused."""
    try:
        return {row.name for row in verify_file(path).failures}
    except InputError as error:
        return str(error)


def failed(result, tolerance=None):
    """Names of the checks that fail."""
    return {row.name for row in verify_result(result, tolerance).failures}


def changed(result, **changes):
    """The same result with another solution."""
    return ContactResult(result.discretization, replace(result.solution, **changes))


def claiming(result, **claims):
    """The same result with other things to say of itself."""
    other = changed(result)
    other.__dict__.update(claims)
    return other


class TestRight:
    """Results that pass, whatever the method and the problem."""

    @pytest.mark.parametrize("options", [{"inner": "direct:clarabel"}, {"method": "uzawa", "tolerance": 1e-4}], ids=str)
    def test_of_other_methods(self, options):
        result = solve(compressed_plate(0.2, (4, 3)), **options)
        assert (result.status, failed(result)) == (Status.SOLVED, set()), result.message

    def test_steps_of_a_history_with_the_slip_before_them(self, history):
        assert history.steps[1].discretization.contacts[0].slip.any()
        assert [failed(step) for step in history.steps] == [set(), set()]

    def test_a_proof_that_the_load_cannot_be_carried(self):
        sides = [Traction("left", x=0.0, y=-0.6), Traction("right", x=0.0, y=0.6)]
        conditions = [Contact("bottom", 0.5), Traction("top", x=0.6, y=-1.0), *sides]
        result = solve(ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1e3, 0.3), conditions))
        assert result.status is Status.INFEASIBLE
        assert failed(result) == set()
        y, nu = result.solution.farkas
        assert failed(changed(result, farkas=(np.zeros_like(y), nu))) == {"proof"}
        assert failed(changed(result, farkas=None)) == set()  # the mechanism is proof enough
        assert {row.value for row in verify_result(result).rows if row.name == "proof"} == {"holds"}
        assert failed(changed(result, status=Status.INFEASIBLE_ON_MESH, farkas=None)) == {"status", "proof"}

    def test_an_inaccurate_one_passes_at_its_accuracy_only(self, plate):
        known, z = plate.solution, plate.solution.z * (1.0 + 1e-7)
        found = certify(known.problem, z, known.normal_multiplier, known.tangential_multiplier)
        result = changed(plate, z=z, status=Status.INACCURATE, message="inaccurate", certificate=found)
        assert "stationarity" in failed(result)
        assert failed(result, 1e-5) == set()

    def test_a_tolerance_that_is_too_loose_unless_it_is_asked_for(self):
        result = solve(compressed_plate(0.2, (3, 3)), tolerance=2e-4)
        assert failed(result) == {"tolerance"}
        assert failed(result, 2e-4) == set()

    def test_contacts_that_limit_nothing_have_tractions_and_no_rows(self):
        glue = Contact("bottom", 0.0, law="tied", name="glue")
        conditions = [Symmetry("left"), glue, Traction("right", x=0.0, y=0.0), Contact("top", 0.2, gap=-1e-3)]
        result = solve(ContactProblem(TriangleMesh.rectangle((3, 3)), Material(1e3, 0.3), conditions))
        assert failed(result) == set()
        line = result.contacts["glue"]
        wrong = replace(line, normal_stress=line.normal_stress * (1.0 + 1e-5))
        assert failed(claiming(result, contacts={**result.contacts, "glue": wrong})) >= {"glue: tractions"}
        wrong = replace(line, excess_between_points=1e-2 * np.abs(line.normal_stress).max())
        assert failed(claiming(result, contacts={**result.contacts, "glue": wrong})) == {"glue: tractions"}


class TestWrong:
    """Numbers and words of a result that are not its own; each fails by itself."""

    @pytest.mark.parametrize("name", ["z", "normal_multiplier", "tangential_multiplier", "equality_multiplier"])
    def test_a_solution(self, result, plate, name):
        """With a number that is another one, or none; as a back end might hand it back and call it solved."""
        result = result if name == "equality_multiplier" else plate
        values = getattr(result.solution, name).copy()
        worst, size = int(np.abs(values).argmax()), np.abs(result.solution.z).max()
        for value in (-values[worst] - size, np.nan):
            values[worst] = value
            forged = changed(result, **{name: values, "certificate": PERFECT})
            assert {"stationarity", "status", "claimed measures"} <= failed(forged)

    @pytest.mark.parametrize("name", [field.name for field in fields(Energies)])
    def test_an_energy(self, plate, name):
        value = getattr(plate.energies, name)
        assert failed(claiming(plate, energies=replace(plate.energies, **{name: value * (1.0 + 1e-6)}))) == {"energies"}

    def test_the_motion_of_a_plate_and_the_misfit_of_tractions(self, result):
        motion = result.plates["plate"]
        wrong = replace(motion, y=motion.y * (1.0 + 1e-6))
        assert failed(claiming(result, plates={"plate": wrong})) == {"plate: motion"}
        assert failed(claiming(result, traction_misfit=1.0)) == {"traction_misfit"}

    def test_the_friction_of_the_problem_that_was_solved(self, plate):
        """A solution of another problem, certificate and all."""
        other = plate.discretization.qvi.with_law(mu=1.001 * plate.discretization.qvi.mu)
        result = solve(replace(plate.discretization, qvi=other))
        assert result.certificate.passed
        assert {"problem", "friction"} <= failed(ContactResult(plate.discretization, result.solution))
        sides = (Traction(side, normal=-1.0, tangential=0.0) for side in ("top", "left", "right"))
        mesh, conditions = oblique(TriangleMesh.rectangle((4, 4), 2.0), 17.0), [Contact("bottom", 0.9), *sides]
        stuck = solve(ContactProblem(mesh, Material(1e3, 0.3), conditions), degree=3)
        qvi = stuck.solution.problem  # t0 is rounding, and another one on another processor
        assert not failed(changed(stuck, problem=qvi.with_loads(t0=qvi.t0[::-1])))
        assert failed(changed(stuck, problem=qvi.with_law(mu=1.1 * qvi.mu))) == {"problem"}  # solved by it too

    def test_contacts_and_plates_that_are_not_there(self, plate):
        line = plate.contacts["plate"]
        for contacts in ({}, {"plate": line, "wall": line}, {"plate": replace(line, name="wall")}):
            assert "entries" in failed(claiming(plate, contacts=contacts))
        assert failed(claiming(plate, plates={"wall": RigidMotion(0.0, 0.0, 0.0, (0.0, 0.0))})) == {"entries"}

    @pytest.mark.parametrize("measures", [{}, {"normal": np.nan}, {"normal": -1.0}])
    @pytest.mark.parametrize("status", [Status.SOLVED, Status.INACCURATE])
    def test_certificates_that_are_none(self, plate, status, measures):
        lie = replace(plate.certificate, measures={**plate.certificate.measures, **measures} if measures else {})
        assert "status" in failed(changed(plate, certificate=lie, status=status, message=status.value))

    def test_success_that_does_not_follow_from_the_numbers(self, plate, unfinished):
        assert not {"status", "claimed measures"} & failed(unfinished)
        assert "claimed measures" in failed(changed(unfinished, certificate=PERFECT))
        lie = changed(unfinished, status=Status.SOLVED, message="solved", certificate=PERFECT)
        assert {"status", "claimed measures", "friction"} <= failed(lie)
        for status in (Status.INACCURATE, Status.INFEASIBLE, Status.MAX_ITERATIONS):
            assert "status" in failed(changed(plate, status=status, message=status.value.replace("_", " ")))
        assert failed(changed(plate, message="infeasible")) == {"status"}


def test_infinite_values_are_none_in_the_document(plate):
    missing = changed(plate, z=np.full_like(plate.solution.z, np.nan))
    document = json.loads(json.dumps(verify_result(missing).document(), allow_nan=False))
    assert {check["value"] for check in document["checks"] if check["name"] == "stationarity"} == {None}


class TestRoundTrip:
    """What is read from a file is what was written."""

    def test_every_bit_of_the_solution(self, result, path, unfinished, tmp_path):
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
        computed = field_arrays(again)
        for name, values in field_arrays(result).items():
            known = np.asarray(computed[name])
            assert known == pytest.approx(np.asarray(values), rel=1e-10, abs=1e-12, nan_ok=True), name
        assert fails(path) == set()
        text = Archive(path).text("problem")
        assert all(words in text for words in ('title = "The stack"', 'stress = "kPa"', "0.2 + 0.1 * x"))
        write_npz(tmp_path / "a.npz", unfinished)
        assert load_result(tmp_path / "a.npz").status is Status.MAX_ITERATIONS

    def test_functions_of_python_cannot_be_kept(self, tmp_path):
        """The fields can, and it is said what to do about it."""
        write_npz(tmp_path / "a.npz", solve(compressed_plate(lambda x, y: 0.2 + 0.0 * x * y, (2, 2))))
        found = fails(tmp_path / "a.npz")
        assert all(words in found for words in ("contacts[0].friction", "Expression", "verify_result"))
        assert Archive(tmp_path / "a.npz").floats("plate.normal_stress").min() < 0.0


class TestForged:
    """Files changed by someone who knows the format: a right digest, and claims that fit each other."""

    def forged(self, tmp_path, entries, **changes):
        new = entries | {name: np.array(value) for name, value in changes.items()}
        return stored(tmp_path / "forged.npz", new)

    @pytest.mark.parametrize("name", ["certificate", "digest", "z", "plate.slip"])
    def test_an_entry_missing(self, name, entries, tmp_path):
        without = {key: value for key, value in entries.items() if key != name}
        found = fails(stored(tmp_path / "a.npz", without, forged=name != "digest"))
        assert found == {"entries"} if name == "plate.slip" else name in found

    @pytest.mark.parametrize(
        ("old", "new"),
        [("0.1 * x", "0.10001 * x"), ("young = 10000.0", "young = 10000.1"), ("force_x = 1.5", "force_x = 1.50001")],
    )  # fmt: skip
    def test_another_problem(self, old, new, entries, tmp_path):
        text = str(entries["problem"])
        assert old in text
        assert fails(self.forged(tmp_path, entries, problem=text.replace(old, new)))

    def test_another_number(self, entries, tmp_path):
        """The others disagree, or the file is refused."""
        for name in ("vertices", "cells", "degree", "z", "energies", "joint.slip", "earlier_slip", "normal_multiplier"):
            changed = np.array(entries[name])
            place = np.unravel_index(np.abs(changed).argmax(), changed.shape)
            step = 1e-5 * max(abs(changed[place]), 1e-3) if changed.dtype.kind == "f" else 1
            for wrong in (changed[place] + step, *((np.nan, -1e300) if changed.dtype.kind == "f" else ())):
                changed[place] = wrong
                found = fails(self.forged(tmp_path, entries, **{name: changed}))
                assert "entry 'earlier_slip'" in found if np.isnan(wrong) and name == "earlier_slip" else found, name

    def test_other_rows_are_other_unknowns(self, entries, tmp_path):
        other = {"points": "edges", "edges": "points"}[str(entries["law_on"])]
        assert fails(self.forged(tmp_path, entries, law_on=other))
        for wrong in (99, 3.5, "three"):
            assert isinstance(fails(self.forged(tmp_path, entries, degree=wrong)), str)

    def test_a_mesh_file_is_never_asked_for(self, entries, tmp_path):
        """A result is checked from itself alone, whatever it names."""
        lines = str(entries["problem"]).splitlines()
        start, stop = lines.index("[mesh]") + 1, lines.index("[mesh.edges]")
        text = "\n".join([*lines[:start], 'file = "/etc/passwd.msh"', *lines[stop:]]).replace("[mesh.edges]", "")
        assert "mesh" in fails(self.forged(tmp_path, entries, problem=text))

    def test_unknowns_are_read_from_where_they_count(self, tmp_path):
        """Small cells in two places, and a joint whose upright edges led up before."""
        plate = compressed_plate(0.2, (4, 4))
        mesh = plate.mesh.with_joint("fit", lambda x, y: np.maximum(abs(x - 0.5), abs(y - 0.5)) == 0.25)
        mesh = mesh.graded([(1.0, 1.0), (0.5, 1.0)], 11)
        problem = replace(plate, mesh=mesh, conditions=[*plate.conditions, Contact.tied("fit")])
        write_npz(tmp_path / "a.npz", solve(problem, degree=3, method="condensed"))
        entries = dict(Archive(tmp_path / "a.npz").arrays)
        assert len(entries["centres"]) == 2
        assert fails(tmp_path / "a.npz") == set()
        for wrong in ({"centres": entries["centres"][:1]}, {"led_back": entries["led_back"][1:]}):
            assert "refers to another basis" in fails(stored(tmp_path / "b.npz", entries | wrong))

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
            assert digest(Archive(broken).arrays) == digest(entries)

    def test_statuses_and_messages(self, entries, tmp_path):
        for word in ("inaccurate", "nonsense"):
            assert fails(self.forged(tmp_path, entries, status=word, message=word))
        for message in ("not solved", "solvedish"):
            assert fails(self.forged(tmp_path, entries, message=message)) == {"status"}

    @pytest.mark.parametrize(
        ("group", "name", "value", "row"),
        [("measures", "normal", np.nan, "claimed measures"), ("measures", "nonsense", 0.0, "claimed measures"),
         ("signed", "energy_gap", 0.5, "claimed measures"), ("scales", "stress", 2.0, "claimed scales"),
         ("scales", "nonsense", 1.0, "claimed scales"), ("scales", "rounding", 1e-3, "claimed scales")],
    )  # fmt: skip
    def test_numbers_of_the_certificate(self, group, name, value, row, entries, tmp_path):
        groups = json.loads(str(entries["certificate"]))
        groups[group][name] = value
        path = self.forged(tmp_path, entries, certificate=json.dumps(groups))
        assert row in fails(path) <= {row, "status"}

    def test_what_a_certificate_measures_is_not_below_zero(self, entries, tmp_path):
        groups = json.loads(str(entries["certificate"]))
        groups["measures"]["normal"] = -0.5
        with pytest.raises(InputError):
            load_result(self.forged(tmp_path, entries, certificate=json.dumps(groups)))

    @pytest.mark.parametrize("name", ["wall.normal_force", "ground.motion", "nonsense"])
    def test_fields_that_this_problem_does_not_have(self, name, entries, tmp_path):
        found = verify_file(self.forged(tmp_path, entries, **{name: np.zeros(3)}))
        assert {row.name for row in found.failures} == {"entries"}
        assert name in found.table()

    def test_a_tolerance_so_loose_that_everything_passes(self, tmp_path):
        """The file may not choose what it is measured by; who verifies may."""
        result = solve(compressed_plate(0.2, (3, 3)), tolerance=0.99, method="fixed-point", max_iterations=1)
        assert result.status is Status.SOLVED
        write_npz(tmp_path / "a.npz", result)
        assert fails(tmp_path / "a.npz") == {"tolerance"}
        assert verify_file(tmp_path / "a.npz", 0.99).passed
        assert {row.name for row in verify_file(tmp_path / "a.npz", 1e-8).failures} >= {"natural_map"}

    @pytest.mark.usefixtures("in_tmp_path")
    @pytest.mark.parametrize(
        ("old", "new"), [("young = 10000.0", "young = -1.0"), ("[mesh]", "[mush]"), ("version", "= version")]
    )
    def test_a_broken_problem_is_said_with_the_name_of_the_file(self, old, new, entries, tmp_path):
        self.forged(tmp_path, entries, problem=str(entries["problem"]).replace(old, new))
        found = fails("forged.npz")
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

    def test_what_is_no_archive(self, entries, tmp_path):
        (tmp_path / "a.npz").write_text("x, y\n1, 2\n")
        assert "not an archive, or holds pickled objects" in fails(tmp_path / "a.npz")
        np.save(tmp_path / "a.npy", np.ones(3))
        assert "not an archive" in fails(tmp_path / "a.npy")
        np.savez(tmp_path / "other.npz", x=np.ones(3))
        assert "not a result" in fails(tmp_path / "other.npz")
        np.savez(tmp_path / "a.npz", **entries | {"z": np.array([{}], dtype=object)})
        assert "pickled objects" in fails(tmp_path / "a.npz")
        other = entries | {"format_version": np.array(9)}
        assert f"version 9': only version {FORMAT_VERSION}" in fails(stored(tmp_path / "a.npz", other))
        assert "No such file" in fails(tmp_path / "missing.npz")
        assert "cannot be read" in fails(tmp_path)
        assert "not a regular file" in fails(os.devnull)  # the end of /dev/zero is nowhere

    def test_more_bytes_than_the_limit_are_not_read(self, entries, tmp_path):
        """The sizes stand in the archive's directory; a megabyte of it can hold a gigabyte of zeros."""
        np.savez(tmp_path / "a.npz", **entries)
        with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
            archive.writestr("more.npy", b"")
            archive.filelist[-1].file_size = 2_000_000_000
        assert "the limit of 1000000000" in fails(tmp_path / "a.npz")

    @pytest.mark.skipif(os.name != "posix", reason="there are no such files")
    def test_pipes_are_not_waited_for(self, tmp_path):
        os.mkfifo(tmp_path / "a.npz")
        assert "not a regular file" in fails(tmp_path / "a.npz")


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
