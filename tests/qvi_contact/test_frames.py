"""Results as pandas tables: each row is what the result says in another way."""

import sys

import numpy as np
import pytest

from qvi_contact import InputError, LimitFactor, limit_load_factor, load_problem, refine, solve, solve_history
from qvi_contact.basics.units import Units
from qvi_contact.gallery import compressed_plate

PLATE = compressed_plate(0.3, (2, 2))
UNITS = Units("mm", "MPa")


@pytest.fixture(scope="module")
def result():
    return solve(PLATE)


@pytest.fixture(scope="module")
def dragged(pytestconfig):
    return load_problem(pytestconfig.rootpath / "examples" / "dragged_block_holds.toml").problem


def test_a_result_has_the_points_of_its_contacts_and_a_row_for_each(result):
    points, forces = result.to_frame(), result.forces_frame()
    line = result.contacts["plate"]
    assert list(points["contact"].unique()) == list(forces["contact"]) == ["plate"]
    assert len(points) == len(line.x)
    assert points["weight"] @ points["normal_stress"] == pytest.approx(-forces["normal_force"][0])
    assert forces["largest_pressure"][0] == -points["normal_stress"].min()
    assert forces[["share_open", "share_stick", "share_slip"]].sum(axis=1)[0] == pytest.approx(1.0)
    assert {"normal_force [N/mm]", "largest_slip [mm]", "share_slip"} <= set(result.forces_frame(UNITS).columns)
    assert "slip [mm]" in result.to_frame(UNITS).columns


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
    assert list(table["cells"]) == [each.cells[0] for each in found.rounds]
    assert table["estimate"].iloc[-1] == found.estimate


def test_a_limit_load_is_a_row(dragged):
    loads = ["drag"]
    limit = limit_load_factor(dragged, loads)
    row = limit.to_frame().loc[0]
    assert (row["lower"], row["upper"], row["slides"]) == (limit.lower, limit.upper, "base")
    rounds = refine(dragged, quantity=LimitFactor(loads)).to_frame()
    assert rounds["value"].iloc[-1] == pytest.approx(limit.lower)


def test_a_solution_has_a_row_an_iteration(result):
    table = result.solution.to_frame()
    assert list(table["number"]) == list(range(1, result.solution.iterations + 1))
    assert list(table["residual"]) == [entry.residual for entry in result.solution.history]


def test_without_pandas_each_names_the_extra(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    for table in (result.to_frame, result.forces_frame, result.solution.to_frame):
        with pytest.raises(InputError, match=r"pip install 'qvi-contact\[frame\]'"):
            table()
