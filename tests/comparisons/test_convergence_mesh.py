"""Convergence in the mesh: orders, tractions, ends of zones on made-up data; a tiny real study."""

import json
from dataclasses import replace

import numpy as np
import pytest
from pandas import DataFrame

from comparisons.convergence import mesh
from comparisons.convergence.mesh import FORCE, PROBLEMS, TRACTIONS, Overview, Tractions, fitted_order, orders_of
from comparisons.lab.study import Study
from qvi_contact import solve
from tests.comparisons.convergence_parts import rows_of

FAILED = ["problem", "meshes", "cells", "model", "status", "message"]

NAN = float("nan")
GAUSS = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0


def points_of(lines):
    """The four Gauss points of each edge, one after the other."""
    lines = np.asarray(lines, dtype=float)
    return (lines[:-1, None] + np.diff(lines)[:, None] * GAUSS).ravel()


class TestOrders:
    """Slopes of made-up errors."""

    def test_a_power_law_has_its_power(self):
        h = [1.0, 0.5, 0.25, 0.1]
        e = [3.0 * size**1.7 for size in h]
        assert mesh.successive_orders(h, e) == pytest.approx([NAN, 1.7, 1.7, 1.7], nan_ok=True)
        assert fitted_order(h, e) == pytest.approx(1.7)

    def test_equal_errors_have_order_zero(self):
        assert fitted_order([1.0, 0.5, 0.25], [0.1, 0.1, 0.1]) == pytest.approx(0.0, abs=1e-12)

    def test_the_last_three_decide(self):
        h = [1.0, 0.5, 0.25, 0.125]
        assert fitted_order(h, [50.0, 0.25, 0.0625, 0.015625]) == pytest.approx(2.0)
        line = np.polyfit(np.log(h[1:]), np.log([0.3, 0.04, 0.015]), 1)
        assert fitted_order(h, [7.0, 0.3, 0.04, 0.015]) == pytest.approx(line[0])

    def test_errors_that_mean_nothing_are_left_out(self):
        h = [1.0, 0.5, 0.25, 0.125]
        assert mesh.successive_orders(h, [1.0, NAN, 0.1, 0.05]) == pytest.approx([NAN, NAN, NAN, 1.0], nan_ok=True)
        assert np.isnan(fitted_order(h, [1.0, NAN, 0.1, NAN]))
        assert fitted_order(h, [1.0, 0.5, 0.25, NAN]) == pytest.approx(1.0)


class TestTractions:
    """Piecewise polynomials on different meshes."""

    def test_polynomials_come_back(self):
        lines = np.array([0.0, 0.3, 1.0, 2.0])
        s = points_of(lines)
        found = Tractions.at_gauss_points(s, 3.0 * s - 1.0, s**2 - s)
        assert found.lines == pytest.approx(lines, abs=1e-14)
        for x in (0.0, 0.1, 0.7, 1.99):
            normal, tangential = found(np.array([x]))
            assert (normal[0], tangential[0]) == pytest.approx((3.0 * x - 1.0, x**2 - x))
        again = Tractions.of_record(json.loads(json.dumps(found.as_record())))
        assert mesh.difference(found, again) == 0.0

    def test_edges_in_another_order_are_the_same(self):
        s = points_of([0.0, 0.3, 1.0, 2.0])
        mixed = s.reshape(-1, 4)[[2, 0, 1]].ravel()
        one, other = (Tractions.at_gauss_points(each, np.abs(each - 0.3), each**2) for each in (s, mixed))
        assert other.lines == pytest.approx([0.0, 0.3, 1.0, 2.0], abs=1e-14)
        assert mesh.difference(one, other) == pytest.approx(0.0, abs=1e-14)

    def test_difference_of_two_meshes_is_the_integral(self):
        one, other = points_of([0.0, 0.4, 2.0]), points_of([0.0, 1.0, 1.5, 2.0])
        first = Tractions.at_gauss_points(one, 0.0 * one, one**2)
        second = Tractions.at_gauss_points(other, 0.0 * other + 3.0, 0.0 * other)
        assert mesh.difference(first, second) == pytest.approx(np.sqrt(9.0 * 2.0 + 2.0**5 / 5.0))
        assert mesh.size(second, second.lines) == pytest.approx(np.sqrt(18.0))

    def test_jumps_inside_an_edge_count_where_they_are(self):
        s = points_of([0.0, 2.0])
        flat = Tractions.at_gauss_points(s, 0.0 * s, 0.0 * s)
        found = mesh.difference(flat, lambda x: (np.where(x > 0.7, 1.0, 0.0), 0.0 * x), np.array([0.0, 0.7, 2.0]))
        assert found == pytest.approx(np.sqrt(1.3))


class TestZones:
    """Roots of made-up pressures and frictions."""

    s = points_of(np.linspace(0.0, 4.0, 5))

    def ends(self, pressure, unused):
        """Ends for a pressure and friction not used up; μ = 1."""
        pressure, unused = (np.maximum(f(self.s), 0.0) for f in (pressure, unused))
        return mesh.zone_ends(self.s, -pressure, pressure - unused, pressure)

    def test_a_straight_line_ends_at_its_root(self):
        edge = self.s.reshape(-1, 4)
        pressure = np.where(edge < 3.0, 3.3 - edge, 0.0)
        pressure[3] = 3.3 - edge[3]  # below zero beyond the root
        found = mesh.zone_ends(self.s, -pressure.ravel(), 0.0 * self.s, 0.0 * self.s)
        (end,) = [each for each in found if each.kind == "contact ends"]
        assert (end.position, end.how) == (pytest.approx(3.3), mesh.ROOT)
        assert end.low < 3.3 < end.high
        assert end.low == pytest.approx(edge[3][0])

    def test_the_left_end_is_the_mirror_image(self):
        unused = 0.2 * (self.s - 0.4)  # below zero on the first edge, left of the root
        (end,) = mesh.zone_ends(self.s, -1.0 + 0.0 * self.s, 1.0 - unused, 1.0 + 0.0 * self.s)
        assert (end.kind, end.position, end.how) == ("stick begins", pytest.approx(0.4), mesh.ROOT)
        assert (end.low, end.high) == pytest.approx((self.s[1], self.s[2]))

    def test_a_jump_ends_at_the_grid_line(self):
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, lambda x: np.where(x < 2.0, 0.5, 0.0))
        assert (end.kind, end.position, end.how) == ("stick ends", pytest.approx(2.0), mesh.LINE)
        assert end.extrapolated is None

    def test_a_touched_zero_is_the_gauss_point(self):
        place = self.s[9]
        unused = lambda x: np.where(x < 3.0, 0.1 * (x - place) ** 2 + 5e-7, 0.0)  # noqa: E731
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, unused)
        assert (end.kind, end.how) == ("stick ends", mesh.POINT)
        assert end.position == pytest.approx(place)

    def test_square_roots_are_extrapolated_exactly(self):
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, lambda x: 0.1 * np.sqrt(np.maximum(2.6 - x, 0.0)))
        assert end.extrapolated == pytest.approx(2.6)
        assert abs(end.position - 2.6) < 0.5

    def test_nothing_pressed_has_no_zones(self):
        assert mesh.zone_ends(self.s, 0.0 * self.s, 0.0 * self.s, 0.0 * self.s) == []
        assert self.ends(lambda x: 1.0 + x, lambda x: 0.5 + 0.0 * x) == []


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

    def test_observed_on_the_plate(self):
        """P/2 on 64², 128² and 256² equal cells at μ = 0.2, from `comparisons.benchmark.reference`."""
        errors = [214.23323 - force for force in (214.15964926, 214.19115763, 214.20909600)]
        assert fitted_order([1 / 64, 1 / 128, 1 / 256], errors) == pytest.approx(mesh.exponent(0.3, 0.2), abs=0.02)


def test_graded_lines():
    lines = mesh.towards(0.0, 2.0, 4, 2.0)
    assert lines == pytest.approx(2.0 - 2.0 * (1.0 - np.arange(5) / 4) ** 2)


def made_up(errors, least=0.0):
    """Errors on equal cells, h halved each time."""
    number = np.arange(len(errors))
    errors = np.array(errors, dtype=float)
    return DataFrame(
        {"h": 0.25 * 0.5**number, "unknowns": 64.0 * 4.0**number, "error": errors, "meant": errors > least}
    )


@pytest.mark.parametrize(
    ("errors", "order", "said"),
    [
        ([1.0, 0.5, 0.25, 0.125], 1.0, "as expected"),
        ([1.0, 0.5, 0.25, 0.125], 1.5, "settled on another order"),
        ([1.0, 0.9, 0.5, 0.1], 3.0, "orders still change"),
        ([1.0, 0.5, 0.25, 0.125], None, "settled"),
        ([1.0, 1.0, 1.0, 1.0], None, "does not fall"),
        ([1.0, 1.0, 1.0, 1.0], 1.0, "does not fall"),
        ([1.0, 0.5, 0.125, 0.1249], 1.0, "orders still change"),
        ([1.0, 0.5, 1e-9, 1e-9], 1.0, "too few points for an order"),
    ],
)
def test_verdicts(errors, order, said):
    expected = None if order is None else mesh.Expected(order, "made up")
    assert orders_of(made_up(errors, least=1e-8), expected)["verdict"] == said


def test_costs_are_those_of_lasting_errors():
    found = made_up([1e-2, 1e-5, 1e-3, 1e-4])
    assert (mesh.cost(found, 1e-3), mesh.cost(found, 1e-4)) == (256, 4096)
    assert mesh.cost(made_up([1e-3, 1e-6, 1e-4, 1e-5]), 2e-5) == 4096  # what is small by chance does not count
    assert mesh.cost(found, 1e-5) == mesh.cost(found[::-1], 1e-5) == np.inf
    assert np.isnan(mesh.cost(made_up([]), 1.0))


class TestAdvantage:
    """How many times more unknowns equal cells take is known as well as meshes lie close."""

    @staticmethod
    def said(uniform, other):
        return pytest.approx(mesh.advantage({"uniform": made_up(uniform), "graded": made_up(other)}, 1e-4), nan_ok=True)

    def test_between_two_numbers(self):
        assert self.said([1, 1, 1, 1e-5], [1, 1e-5]) == (4.0, 64.0)
        assert self.said([1, 1, 1e-5], [1, 1e-5]) == (NAN, NAN)  # the mesh before equal cells' may be as good

    def test_at_least_where_the_first_mesh_is_enough(self):
        assert self.said([1, 1, 1e-5], [1e-5]) == (4.0, NAN)
        assert self.said([1e-5], [1e-5]) == (NAN, NAN)

    def test_not_at_all(self):
        assert self.said([1, 1], [1, 1e-5]) == (1.0, NAN)
        assert self.said([1, 1e-5], [1, 1]) == (NAN, NAN)


CHOSEN = [
    *[("plate 1", "uniform", size, "equilibrium") for size in (4, 8, 16)],
    ("plate 1", "uniform", 4, "bracket"), ("plate 1", "uniform", 8, "bracket"), ("plate 1", "uniform", 8, "companion"),
    ("plate 0.2", "uniform", 8, "equilibrium"), ("plate 0.2", "goal", 300, "equilibrium"),
    ("plate 1", "apart", 110, "bracket"),
    *[("block", "uniform", size, "equilibrium") for size in (4, 8, 16)],
]  # fmt: skip


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a small part of the study, through the runner."""
    cases = [dict(zip(("problem", "sequence", "size", "model"), case, strict=True)) for case in CHOSEN]
    small = Study.of("small", 1, mesh.run, cases)
    return rows_of(small, tmp_path_factory.mktemp("mesh") / "mesh.sqlite")


class TestRun:
    """A small study, and its report."""

    def test_all_are_certified(self, rows):
        assert [row.reason for row in rows if row.status != "done"] == []
        assert all(row.certificate["passed"] and row.certificate["accuracy"] < mesh.TOLERANCE for row in rows)

    def test_energies_and_forces_are_those_of_the_plate(self, rows):
        found = Overview(mesh.meshes_of(rows))
        (plate,) = (problem for problem in found.problems if problem.name == "plate 1")
        meshes, points = found.of(plate, "uniform"), found.curve(plate, FORCE, "uniform")
        assert meshes.energy.tolist() == pytest.approx((0.5e-3 * meshes.force).tolist(), rel=1e-9)
        assert points.error.tolist() == pytest.approx((1.0 - meshes.force / 214.36766).tolist())
        assert orders_of(points)["fitted"] == pytest.approx(1.517, abs=0.1)

    def test_brackets_enclose_the_settled_energy(self, rows):
        found = Overview(mesh.meshes_of(rows))
        meshes = found.brackets(PROBLEMS["plate 1"])
        assert meshes["size"].tolist() == [4, 8, 110, 110]
        assert (meshes.lower < 0.10718383).all()
        assert (meshes.upper > 0.10718383).all()
        for record in (row.result["meshes"][0] for row in rows if row.case["model"] == "bracket"):
            assert record["force_bounds"] == pytest.approx([2e3 * record["lower"], 2e3 * record["upper"]])
        assert [mesh.values_of(found)[name] for name in ("inside", "guaranteed")] == [4, 4]

    def test_the_block_is_exact_in_the_limit(self, rows):
        found = Overview(mesh.meshes_of(rows))
        block = PROBLEMS["block"]
        assert orders_of(found.curve(block, TRACTIONS, "uniform"))["fitted"] == pytest.approx(2.0, abs=0.2)
        assert found.curve(block, "energy", "uniform").error.iloc[-1] < 1e-6
        ends = found.curve(block, "stick ends", "uniform")
        assert [2.0 * error for error in ends.error] == pytest.approx([0.068, 0.0378, 0.02], abs=1e-3)

    def test_chains_have_a_mesh_for_each_step(self, rows):
        (goal,) = (row for row in rows if row.case["sequence"] == "goal")
        (apart,) = (row for row in rows if row.case["sequence"] == "apart")
        assert [mesh["unknowns"] for mesh in goal.result["meshes"]] == [256]
        assert goal.result["meshes"][0]["normal_force"] == pytest.approx(213.81671332570525, rel=1e-9)
        assert [mesh["unknowns"] for mesh in apart.result["meshes"]] == [64, 100]
        assert all(mesh["guaranteed"] for mesh in apart.result["meshes"])

    def test_a_failed_row_is_shown_and_not_replaced(self, rows):
        lost = [row for row in rows if row.case["size"] != 16]
        (gone,) = (row for row in rows if row.case["size"] == 16 and row.case["problem"] == "plate 1")
        failed = replace(gone, status="timeout", reason="more than 1 s", result={}, certificate=None)
        found = Overview(mesh.meshes_of([*lost, failed]))
        (line,) = [row for row in mesh.failures(found)[FAILED].itertuples(index=False) if row.status == "timeout"]
        assert line == ("plate 1", "uniform", "size 16", "equilibrium", "timeout", "more than 1 s")
        assert mesh.values_of(found)["certified"] == mesh.values_of(found)["solves"] - 1 == len(found.meshes) - 1
        assert len(found.curve(PROBLEMS["plate 1"], FORCE, "uniform")) == 2


class TestBrokenChains:
    """Chains of adaptive meshes that end before their limit."""

    @pytest.fixture
    def impatient(self, monkeypatch):
        """Solves on more than 200 cells fail."""

        def fails(problem, **options):
            few = {"method": "condensed", "max_iterations": 1} if problem.mesh.active.sum() > 200 else {}
            return solve(problem, **options, **few)

        monkeypatch.setattr("qvi_contact.refinement.lines.solve", fails)

    @staticmethod
    def result(sequence, model="equilibrium", size=2000):
        return mesh.run({"problem": "plate 0.2", "sequence": sequence, "size": size, "model": model})

    @pytest.mark.usefixtures("impatient")
    def test_a_later_solve_that_fails_has_a_record(self, rows):
        found = self.result("goal")
        *solved, last = found["meshes"]
        assert {mesh["status"] for mesh in solved} == {"solved"}
        assert (last["status"], last["accuracy"]) == ("unsolved", np.inf)
        assert "unknowns: max iterations" in last["message"]
        assert not found["certificate"]["passed"]
        statuses = [mesh["status"] for mesh in self.result("reference")["meshes"]]
        assert statuses == ["solved", "solved", "unsolved"]
        chain = next(row for row in rows if row.case["sequence"] == "goal")
        seen = Overview(mesh.meshes_of([*(row for row in rows if row is not chain), replace(chain, result=found)]))
        (line,) = [row for row in mesh.failures(seen)[FAILED].itertuples(index=False) if row.status == "unsolved"]
        assert line == ("plate 0.2", "goal", "size 300", "equilibrium", "unsolved", last["message"])
        assert mesh.values_of(seen)["certified"] == mesh.values_of(seen)["solves"] - 1

    @pytest.mark.usefixtures("impatient")
    def test_a_chain_that_ends_at_its_limit_has_none(self):
        found = self.result("goal", size=256)
        assert [mesh["status"] for mesh in found["meshes"]] == ["solved"]
        assert found["certificate"]["passed"]


def test_a_reference_of_the_same_models_proves_nothing(rows):
    found = Overview(mesh.meshes_of(rows))
    known = found.references["plate 1"]
    found.references["plate 1"] = {**known, "energy": replace(known["energy"], sequence="reference")}
    assert mesh.values_of(found)["guaranteed"] == 0
    (line,) = mesh.tables_of(found)["brackets"][["problem", "number", "inside", "own"]].to_numpy().tolist()
    assert line == ["plate 1", 4, 4, True]


def test_an_end_is_not_judged_by_itself(rows):
    found = Overview(mesh.meshes_of([row for row in rows if row.case["problem"] == "block"]))
    known = found.references["block"]
    assert tuple(mesh.tables_of(found)["zones"].iloc[0, 5:7]) == ("17 × 8", "2.0e-2")
    own = replace(known["stick ends"], sequence="uniform", uncertainty=0.1)
    found.references["block"] = {**known, "stick ends": own}
    assert tuple(mesh.tables_of(found)["zones"].iloc[0, 5:7]) == ("17 × 8", "gave the value")


def test_a_force_without_a_reference_has_no_costs(rows):
    """As where a time limit ended the solves that it would come from."""
    found = Overview(mesh.meshes_of([row for row in rows if row.case["problem"] == "plate 1"]))
    del found.references["plate 1"][FORCE]
    assert (mesh.values_of(found)["judged"], mesh.values_of(found)["spacing"]) == (0, None)
    costs = mesh.tables_of(found)["costs"]
    assert costs[["low", "high", "uniform", "graded"]].isna().all(axis=None)
    assert set(costs.times) == {""}


def test_a_reference_makes_errors_below_it_meaningless(rows):
    found = Overview(mesh.meshes_of(rows))
    plate = PROBLEMS["plate 1"]
    known = found.references["plate 1"]
    found.references["plate 1"] = {FORCE: replace(known[FORCE], uncertainty=0.03)}
    points = found.curve(plate, FORCE, "uniform")
    assert points.meant.tolist() == [True, True, False]
    assert np.isnan(orders_of(points)["fitted"])


def test_an_end_is_as_uncertain_as_meshes_differ(rows):
    """On coarse meshes of the plate at μ = 0.2 the reference's uncertainty covers what fine ones find, 0.738."""
    (first,) = (row for row in rows if row.case["problem"] == "plate 0.2" and row.case["sequence"] == "uniform")
    (record,) = first.result["meshes"]
    (end,) = record["ends"]
    coarse = {**record, "ends": [{**end, "position": end["position"] - 0.04, "extrapolated": None}]}
    before = replace(first, case={**first.case, "size": 4}, result={"meshes": [coarse]})
    plain = {**record, "ends": [{**end, "extrapolated": None}]}
    found = Overview(mesh.meshes_of([before, replace(first, result={"meshes": [plain]})]))
    known = found.references["plate 0.2"]["stick ends"]
    assert known.value == pytest.approx(end["position"])
    assert known.uncertainty == pytest.approx(end["high"] - end["low"] + 0.08)
    assert abs(known.value - 0.738) < known.uncertainty
