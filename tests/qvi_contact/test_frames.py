"""Results elsewhere: as pandas tables, beside claims that are compared with them, and in archives that are verified."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    InputError,
    LimitFactor,
    limit_load_factor,
    load_problem,
    load_result,
    refine,
    solve,
    solve_history,
)
from qvi_contact.basics import Units
from qvi_contact.export import field_arrays, write_npz
from qvi_contact.files import Archive, digest
from qvi_contact.gallery import compressed_plate
from qvi_contact.mesh import TriangleMesh
from qvi_contact.problem import Contact, ContactProblem, Expression, Material, Region, RigidPlate, Traction
from qvi_contact.solution import ContactResult
from qvi_contact.verification import (
    difference,
    missed_tractions,
    problem_difference,
    scales_difference,
    verify_file,
    worse_than_claimed,
)
from solvers import Certificate
from solvers.certificate import EXPONENTS

PLATE = compressed_plate(0.3, (2, 2))
UNITS = Units("mm", "MPa")


@pytest.fixture(scope="module")
def plate_result():
    return solve(PLATE)


@pytest.fixture(scope="module")
def dragged(pytestconfig):
    return load_problem(pytestconfig.rootpath / "examples" / "dragged_block_holds.toml").problem


def test_a_result_has_the_points_of_its_contacts_and_a_row_for_each(plate_result):
    points, forces = plate_result.to_frame(), plate_result.forces_frame()
    line = plate_result.contacts["plate"]
    assert list(points["contact"].unique()) == list(forces["contact"]) == ["plate"]
    assert len(points) == len(line.x)
    assert points["weight"] @ points["normal_stress"] == pytest.approx(-forces["normal_force"][0])
    assert forces["largest_pressure"][0] == -points["normal_stress"].min()
    assert forces[["share_open", "share_stick", "share_slip"]].sum(axis=1)[0] == pytest.approx(1.0)
    assert {"normal_force [N/mm]", "largest_slip [mm]", "share_slip"} <= set(plate_result.forces_frame(UNITS).columns)
    assert "slip [mm]" in plate_result.to_frame(UNITS).columns
    iterations = plate_result.solution.to_frame()
    assert list(iterations["number"]) == list(range(1, plate_result.solution.iterations + 1))
    assert list(iterations["residual"]) == [entry.residual for entry in plate_result.solution.history]


def test_a_history_has_a_row_for_each_step_and_contact():
    history = solve_history([compressed_plate(0.3, (2, 2), displacement=u) for u in (1e-3, 2e-3, 1.5e-3)])
    table = history.to_frame()
    assert list(table["step"]) == [1, 2, 3]
    assert set(table["status"]) == {"solved"}
    assert np.array_equal(table["dissipated"], history.dissipated)
    assert list(table["normal_force"]) == [step.contacts["plate"].normal_force for step in history.steps]
    assert "dissipated [MPa mm²]" in history.to_frame(UNITS).columns


def test_a_refinement_has_a_row_a_round():
    found = refine(PLATE, target=3e-4)
    table = found.to_frame()
    assert list(table["unknowns"]) == [each.unknowns for each in found.rounds]
    assert list(table["cells"]) == [each.cells for each in found.rounds]
    assert table["estimate"].iloc[-1] == found.estimate


def test_a_limit_load_is_a_row(dragged):
    loads = ["drag"]
    limit = limit_load_factor(dragged, loads)
    row = limit.to_frame().loc[0]
    assert (row["lower"], row["upper"], row["slides"]) == (limit.lower, limit.upper, "base")
    rounds = refine(dragged, quantity=LimitFactor(loads)).to_frame()
    assert rounds["value"].iloc[-1] == pytest.approx(limit.lower)


def test_without_pandas_each_names_the_extra(plate_result, without):
    without("pandas")
    for table in (plate_result.to_frame, plate_result.forces_frame, plate_result.solution.to_frame):
        with pytest.raises(InputError, match="pip install"):
            table()


def test_each_entry_by_its_own_size():
    values = np.array([1.0, 1e-3, 1e-8])
    assert difference(values, values) == 0.0
    assert difference(values * [1.0, 1.0 + 1e-6, 1.0], values) == pytest.approx(1e-9 / 1.1e-3)
    assert difference(values + np.array([0.0, 0.0, 1e-9]), values) == pytest.approx(1e-5, rel=1e-3)
    assert difference([1e-12], [0.0], unit=1.0) == pytest.approx(1e-8)
    assert difference([1.0 + 1e-12], [1.0], rounding=1e-11) == 0.0
    assert difference([np.nan, np.inf, 1.0], [np.nan, np.inf, 1.0]) == 0.0
    for wrong in ([1.0, np.inf, 1.0], [np.nan, 1.0, 1.0], [np.nan, -np.inf, 1.0], [np.nan, np.inf, np.nan]):
        assert difference(wrong, [np.nan, np.inf, 1.0]) == np.inf
    assert difference([True, False], [True, True]) == 1.0
    assert difference(np.array("a"), np.array("b")) == 1.0
    assert difference([1.0, 2.0], [1.0]) == difference([1], [1.0]) == np.inf


def test_what_is_not_a_number_is_the_largest_of_all():
    """Python's max would pass over it."""
    measures = dict.fromkeys(EXPONENTS, 1e-12)
    computed = Certificate(measures, 1e-8, {"stress": 1.0}, {"bipotential": 1e-12})
    for wrong in (
        replace(computed, measures=measures | {"friction": np.nan}),
        replace(computed, signed={"bipotential": np.nan}),
        replace(computed, signed={}),
    ):
        assert worse_than_claimed(wrong, computed) == np.inf
    assert worse_than_claimed(computed, computed) == 0.0
    other = replace(computed, signed={"bipotential": -1e-8})
    assert worse_than_claimed(other, computed) == pytest.approx(0.5, rel=1e-3)  # of 2 tolerance
    for scales in ({"stress": np.nan}, {}, {"stress": 1.0, "rounding": np.nan}, {"stress": 1.0, "rounding": 1e-3}):
        assert scales_difference(replace(computed, scales=scales), computed) == np.inf
    assert scales_difference(replace(computed, scales={"stress": 1.0, "rounding": 1e-8}), computed) == 0.0
    qvi = solve(compressed_plate(0.2, (2, 2))).solution.problem
    assert problem_difference(qvi, qvi) == 0.0
    broken = qvi.with_loads()
    object.__setattr__(broken.loads, "f", np.full(qvi.n, np.nan))  # the constructor refuses it
    assert problem_difference(broken, qvi) == np.inf


def test_resultants_of_prescribed_tractions():
    """Met though the load is no polynomial; missed by 1 % where the particular stress is 1 % too large."""
    top = Traction("top", x=lambda x, y: np.sin(3.0 * x) + 0.0 * y, y=lambda x, y: -10.0 * np.exp(x) + 0.0 * y)
    sides = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    problem = ContactProblem(TriangleMesh.rectangle((3, 2)), Material(1e3, 0.3), [Contact("bottom", 0.5), top, *sides])
    result = solve(problem)
    assert result.traction_misfit > 1e-3
    assert missed_tractions(result) < 1e-12
    known = result.discretization
    larger = replace(known.root, particular=1.01 * known.particular)
    wrong = ContactResult(replace(known, root=larger), result.solution)
    assert 1e-3 < missed_tractions(wrong) < 1e-2


def fails(path):
    """Names of the checks that fail, or the message with which the file is refused."""
    try:
        return {row.name for row in verify_file(path).failures}
    except InputError as error:
        return str(error)


def forged(path, entries):
    """An archive of entries, with their own digest."""
    np.savez(path, **entries | {"digest": np.array(digest(entries))})
    return path


def stack(push):
    """Two blocks of different materials on each other, a plate driven by force."""
    plate = RigidPlate(force_x=push, force_y=-10.0)
    mesh = TriangleMesh.rectangle((3, 4), width=1.0, height=2.0).with_joint("joint", lambda _, y: np.isclose(y, 1.0))
    contacts = [
        Contact("bottom", friction=Expression("0.2 + 0.1 * x"), cohesion=0.01, name="ground"),
        Contact("joint", friction=0.3, law="bilateral"),
        Contact("top", friction=0.8, plate=plate, name="plate"),
    ]
    regions = [Region(Material(2e4, 0.3, "strain"), y=(1.0, 2.0))]
    free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    return ContactProblem(mesh, Material(1e4, 0.2, "strain"), [*contacts, *free], regions=regions)


@pytest.fixture(scope="module")
def result():
    """The second step of a history on triangles, with slip before it, a plate driven by force, a joint, a region."""
    steps = [stack(2.0), stack(2.2)]
    history = solve_history(steps, degree=3)
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
    for name in ("z", "normal_multiplier", "tangential_multiplier", "equality_multiplier", "threshold"):
        assert np.array_equal(getattr(again.solution, name), getattr(result.solution, name)), name
    assert again.problem.mesh.same_as(result.problem.mesh)
    assert again.discretization.space.degree == 3
    assert again.discretization.rule.law_on == result.discretization.rule.law_on
    found = field_arrays(again)
    for name, values in field_arrays(result).items():
        assert np.asarray(found[name]) == pytest.approx(np.asarray(values), rel=1e-10, abs=1e-12), name
    assert fails(path) == set()


def test_unknowns_are_read_from_where_they_count(tmp_path):
    """Small cells in two places: read from elsewhere, unknowns load as solved, with other stresses."""
    plate = compressed_plate(0.2, (2, 2))
    problem = replace(plate, mesh=plate.mesh.graded([(1.0, 1.0), (0.5, 1.0)], 11))
    write_npz(tmp_path / "a.npz", solve(problem, degree=3, method="condensed"))
    entries = dict(Archive(tmp_path / "a.npz").arrays)
    assert len(entries["centres"]) == 2
    assert fails(tmp_path / "a.npz") == set()
    one, none = entries | {"centres": entries["centres"][:1]}, {k: v for k, v in entries.items() if k != "centres"}
    for wrong in (one, none):
        assert "counts from other vertices" in fails(forged(tmp_path / "b.npz", wrong))


def test_whatever_is_changed_is_seen(entries, tmp_path):
    """Also where the digest was forged: the numbers disagree, or the file is refused."""
    for name in ("vertices", "cells", "degree", "z", "energies", "joint.slip", "earlier_slip"):
        changed = np.array(entries[name])
        place = np.unravel_index(np.abs(changed).argmax(), changed.shape)
        changed[place] += 1e-5 * max(abs(changed[place]), 1e-3) if changed.dtype.kind == "f" else 1
        found = fails(forged(tmp_path / "a.npz", entries | {name: changed}))
        assert found, name
        assert isinstance(found, str) or "digest" not in found
    text = str(entries["problem"])
    for old, new in (("[0.0, 0.5]", "[0.0, 0.50001]"), ("young = 20000.0", "young = 20000.1")):
        assert old in text
        assert fails(forged(tmp_path / "a.npz", entries | {"problem": np.array(text.replace(old, new))}))


def test_other_rows_are_other_unknowns(entries, tmp_path):
    other = {"points": "edges", "edges": "points"}[str(entries["law_on"])]
    assert fails(forged(tmp_path / "a.npz", entries | {"law_on": np.array(other)}))
    for wrong in (np.array(99), np.array(3.5), np.array("three")):
        assert isinstance(fails(forged(tmp_path / "a.npz", entries | {"degree": wrong})), str)


def test_a_mesh_file_is_never_asked_for_by_a_result(entries, tmp_path):
    """A result is checked from itself alone, whatever it names."""
    lines = str(entries["problem"]).splitlines()
    start, stop = lines.index("[mesh]") + 1, lines.index("[mesh.edges]")
    text = "\n".join([*lines[:start], 'file = "/etc/passwd.msh"', *lines[stop:]]).replace("[mesh.edges]", "")
    assert "mesh" in fails(forged(tmp_path / "a.npz", entries | {"problem": np.array(text)}))
