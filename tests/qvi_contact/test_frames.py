"""Results elsewhere: as pandas tables, and beside claims that are compared with them."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, LimitFactor, limit_load_factor, load_problem, refine, solve, solve_history
from qvi_contact.basics import Units
from qvi_contact.gallery import compressed_plate
from qvi_contact.mesh import TriangleMesh
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from qvi_contact.solution import ContactResult
from qvi_contact.verification import (
    difference,
    missed_tractions,
    problem_difference,
    scales_difference,
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
