"""Convergence in the mesh: orders and costs of made-up errors, exponents of corners; a tiny real study."""

from dataclasses import replace

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.convergence import mesh
from comparisons.convergence.mesh import PAPER, fitted_order
from comparisons.lab.study import Study
from tests.comparisons.convergence_parts import committed_rows, report_of, rows_of

NAN = float("nan")


class TestOrders:
    """Slopes of made-up errors."""

    def test_a_power_law_has_its_power(self):
        h = [1.0, 0.5, 0.25, 0.1]
        assert fitted_order(h, [3.0 * size**1.7 for size in h]) == pytest.approx(1.7)

    def test_equal_errors_have_order_zero(self):
        assert fitted_order([1.0, 0.5, 0.25], [0.1, 0.1, 0.1]) == pytest.approx(0.0, abs=1e-12)

    def test_the_last_three_decide(self):
        h = [1.0, 0.5, 0.25, 0.125]
        line = np.polyfit(np.log(h[1:]), np.log([0.3, 0.04, 0.015]), 1)
        assert fitted_order(h, [7.0, 0.3, 0.04, 0.015]) == pytest.approx(line[0])

    def test_errors_that_mean_nothing_are_left_out(self):
        h = [1.0, 0.5, 0.25, 0.125]
        assert np.isnan(fitted_order(h, [1.0, NAN, 0.1, NAN]))
        assert fitted_order(h, [1.0, 0.5, 0.25, NAN]) == pytest.approx(1.0)


class TestCorner:
    """Exponents of Williams' expansion."""

    @pytest.mark.parametrize(("poisson", "plane"), [(0.3, "stress"), (0.3, "strain"), (0.0, "stress")])
    def test_a_held_wedge_obeys_the_classical_equation(self, poisson, plane):
        kappa = (3.0 - poisson) / (1.0 + poisson) if plane == "stress" else 3.0 - 4.0 * poisson
        power = mesh.exponent(poisson, None, plane)
        expected = (kappa + 1.0) ** 2 / (4.0 * kappa) - power**2 / kappa
        assert np.sin(power * np.pi / 2.0) ** 2 == pytest.approx(expected, rel=1e-10)

    def test_the_plate_at_full_stick(self):
        assert 2.0 * mesh.exponent(0.3) == pytest.approx(1.517, abs=5e-4)

    def test_friction_makes_it_weaker_without_a_jump(self):
        powers = [mesh.exponent(0.3, friction) for friction in (0.0, 1e-4, 0.05, 0.1, 0.2)]
        assert powers[0] == 1.0
        assert powers[1] == pytest.approx(1.0, abs=2e-4)
        assert powers == sorted(powers, reverse=True)


def test_costs_are_those_of_lasting_errors():
    def cost(errors, target):
        points = DataFrame({"unknowns": 64.0 * 4.0 ** np.arange(len(errors)), "error": np.array(errors, dtype=float)})
        return mesh.cost(points, target)

    found = [1e-2, 1e-5, 1e-3, 1e-4]
    assert (cost(found, 1e-3), cost(found, 1e-4)) == (256, 4096)
    assert cost([1e-3, 1e-6, 1e-4, 1e-5], 2e-5) == 4096  # what is small by chance does not count
    assert cost(found, 1e-5) == np.inf
    assert np.isnan(cost([], 1.0))


CHOSEN = [
    *[("plate 1", "equal", 4, size) for size in (1, 2, 4)], *[("plate 1", PAPER, 3, size) for size in (2, 4, 8)],
    ("plate 0.2", "graded", 5, 4), ("plate 0.2", "adaptive", 5, 100), ("block", "equal", 4, 2),
]  # fmt: skip


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a small part of the study, through the runner."""
    cases = [dict(zip(("problem", "sequence", "degree", "size"), case, strict=True)) for case in CHOSEN]
    return rows_of(Study.of("small", 1, mesh.run, cases), tmp_path_factory.mktemp("mesh") / "mesh.sqlite")


class TestRun:
    """A small study, and its report."""

    def test_all_are_certified(self, rows):
        assert [row.reason for row in rows if row.status != "done"] == []
        meshes = mesh.meshes_of(rows)
        assert meshes.solved.all()
        values = mesh.values_of(meshes)
        assert values["certified"] == values["solves"] == len(meshes)

    def test_forces_converge_with_the_order_of_the_corner(self, rows):
        meshes = mesh.meshes_of(rows)
        for sequence in ("equal", PAPER):
            found = meshes[(meshes.problem == "plate 1") & (meshes.sequence == sequence)]
            assert fitted_order(found.h, found.error) == pytest.approx(1.517, abs=0.12)

    def test_degree_and_grading_pay(self, rows):
        meshes = mesh.meshes_of(rows)
        (graded,) = meshes.error[meshes.sequence == "graded"]
        (block,) = meshes.error[meshes.problem == "block"]
        assert graded < 1e-6
        assert block < 1e-5
        assert meshes.error[meshes.sequence == "adaptive"].iloc[-1] < 1e-4

    def test_bounds_enclose_the_settled_force(self, rows):
        found = [row.result["meshes"][0]["force_bounds"] for row in rows if row.case["sequence"] == "equal"][:3]
        assert all(low <= 214.367658387 <= high for low, high in found)

    def test_a_failed_row_is_shown_and_not_replaced(self, rows):
        failed = replace(rows[2], status="timeout", reason="more than 1 s", result={}, certificate=None)
        meshes = mesh.meshes_of([*rows[:2], failed, *rows[3:]])
        assert meshes[~meshes.solved][["problem", "size", "status", "message"]].to_numpy().tolist() == [
            ["plate 1", 4, "timeout", "more than 1 s"]
        ]
        assert mesh.values_of(meshes)["certified"] == len(meshes) - 1


@pytest.mark.usefixtures("outlined")
def test_findings_of_the_committed_rows():
    """What a user would act on."""
    rows = committed_rows("mesh")
    values = mesh.values_of(mesh.meshes_of(rows))
    assert values["paper_missed"] == 3
    assert values["graded_missed"] == 0
    assert values["adaptive_missed"] == 0
    assert values["inside"] == values["bounded"] > 40
    assert values["reached"]["degree 3"] < values["reached"]["degree 4"] < values["reached"]["degree 6"]
    assert "graded triangles" in report_of("convergence.mesh", rows).text.lower()
