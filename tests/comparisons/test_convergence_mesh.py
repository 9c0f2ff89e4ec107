"""Convergence in the mesh: orders, tractions, ends of zones on made-up data; a tiny real study; the command."""

import json
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pandas import DataFrame, concat

from comparisons.cli import group
from comparisons.convergence import command
from comparisons.convergence.mesh import figures, study
from comparisons.convergence.mesh.corner import exponent
from comparisons.convergence.mesh.errors import Overview, meshes_of
from comparisons.convergence.mesh.measures import spacing, values_of
from comparisons.convergence.mesh.orders import advantage, cost, fitted_order, orders_of, successive_orders
from comparisons.convergence.mesh.problems import FORCE, PROBLEMS, TRACTIONS, Expected, towards
from comparisons.convergence.mesh.report import failures, report, tables_of
from comparisons.convergence.mesh.tractions import Tractions, difference, size
from comparisons.convergence.mesh.zones import LINE, POINT, ROOT, zone_ends
from comparisons.lab.report import findings_of, write_report
from comparisons.lab.study import Study, run_study
from qvi_contact import refine, solve
from qvi_contact.basics import terminal
from qvi_contact.plots.style import has_matplotlib
from qvi_contact.refinement import lines as line_refinement
from tests.comparisons.convergence_parts import committed_text, made_again, rows_of

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
        assert successive_orders(h, e) == pytest.approx([NAN, 1.7, 1.7, 1.7], nan_ok=True)
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
        assert successive_orders(h, [1.0, NAN, 0.1, 0.05]) == pytest.approx([NAN, NAN, NAN, 1.0], nan_ok=True)
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
        assert difference(found, again) == 0.0

    def test_edges_in_another_order_are_the_same(self):
        s = points_of([0.0, 0.3, 1.0, 2.0])
        mixed = s.reshape(-1, 4)[[2, 0, 1]].ravel()
        one, other = (Tractions.at_gauss_points(each, np.abs(each - 0.3), each**2) for each in (s, mixed))
        assert other.lines == pytest.approx([0.0, 0.3, 1.0, 2.0], abs=1e-14)
        assert difference(one, other) == pytest.approx(0.0, abs=1e-14)

    def test_difference_of_two_meshes_is_the_integral(self):
        one, other = points_of([0.0, 0.4, 2.0]), points_of([0.0, 1.0, 1.5, 2.0])
        first = Tractions.at_gauss_points(one, 0.0 * one, one**2)
        second = Tractions.at_gauss_points(other, 0.0 * other + 3.0, 0.0 * other)
        assert difference(first, second) == pytest.approx(np.sqrt(9.0 * 2.0 + 2.0**5 / 5.0))
        assert size(second, second.lines) == pytest.approx(np.sqrt(18.0))

    def test_jumps_inside_an_edge_count_where_they_are(self):
        s = points_of([0.0, 2.0])
        flat = Tractions.at_gauss_points(s, 0.0 * s, 0.0 * s)
        found = difference(flat, lambda x: (np.where(x > 0.7, 1.0, 0.0), 0.0 * x), np.array([0.0, 0.7, 2.0]))
        assert found == pytest.approx(np.sqrt(1.3))


class TestZones:
    """Roots of made-up pressures and frictions."""

    s = points_of(np.linspace(0.0, 4.0, 5))

    def ends(self, pressure, unused):
        """Ends for a pressure and friction not used up; μ = 1."""
        pressure, unused = (np.maximum(f(self.s), 0.0) for f in (pressure, unused))
        return zone_ends(self.s, -pressure, pressure - unused, pressure)

    def test_a_straight_line_ends_at_its_root(self):
        edge = self.s.reshape(-1, 4)
        pressure = np.where(edge < 3.0, 3.3 - edge, 0.0)
        pressure[3] = 3.3 - edge[3]  # below zero beyond the root
        found = zone_ends(self.s, -pressure.ravel(), 0.0 * self.s, 0.0 * self.s)
        (end,) = [each for each in found if each.kind == "contact ends"]
        assert (end.position, end.how) == (pytest.approx(3.3), ROOT)
        assert end.low < 3.3 < end.high
        assert end.low == pytest.approx(edge[3][0])

    def test_the_left_end_is_the_mirror_image(self):
        unused = 0.2 * (self.s - 0.4)  # below zero on the first edge, left of the root
        (end,) = zone_ends(self.s, -1.0 + 0.0 * self.s, 1.0 - unused, 1.0 + 0.0 * self.s)
        assert (end.kind, end.position, end.how) == ("stick begins", pytest.approx(0.4), ROOT)
        assert (end.low, end.high) == pytest.approx((self.s[1], self.s[2]))

    def test_a_jump_ends_at_the_grid_line(self):
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, lambda x: np.where(x < 2.0, 0.5, 0.0))
        assert (end.kind, end.position, end.how) == ("stick ends", pytest.approx(2.0), LINE)
        assert end.extrapolated is None

    def test_a_touched_zero_is_the_gauss_point(self):
        place = self.s[9]
        unused = lambda x: np.where(x < 3.0, 0.1 * (x - place) ** 2 + 5e-7, 0.0)  # noqa: E731
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, unused)
        assert (end.kind, end.how) == ("stick ends", POINT)
        assert end.position == pytest.approx(place)

    def test_square_roots_are_extrapolated_exactly(self):
        (end,) = self.ends(lambda x: 1.0 + 0.0 * x, lambda x: 0.1 * np.sqrt(np.maximum(2.6 - x, 0.0)))
        assert end.extrapolated == pytest.approx(2.6)
        assert abs(end.position - 2.6) < 0.5

    def test_nothing_pressed_has_no_zones(self):
        assert zone_ends(self.s, 0.0 * self.s, 0.0 * self.s, 0.0 * self.s) == []
        assert self.ends(lambda x: 1.0 + x, lambda x: 0.5 + 0.0 * x) == []


class TestCorner:
    """Exponents of Williams' expansion."""

    @pytest.mark.parametrize(("poisson", "plane"), [(0.3, "stress"), (0.3, "strain"), (0.0, "stress")])
    def test_a_held_wedge_obeys_the_classical_equation(self, poisson, plane):
        kappa = (3.0 - poisson) / (1.0 + poisson) if plane == "stress" else 3.0 - 4.0 * poisson
        power = exponent(poisson, None, plane)
        expected = (kappa + 1.0) ** 2 / (4.0 * kappa) - power**2 / kappa
        assert np.sin(power * np.pi / 2.0) ** 2 == pytest.approx(expected, rel=1e-10)

    def test_the_plate_at_full_stick(self):
        assert 2.0 * exponent(0.3) == pytest.approx(1.517, abs=5e-4)

    def test_friction_makes_it_weaker_without_a_jump(self):
        powers = [exponent(0.3, friction) for friction in (0.0, 1e-4, 0.05, 0.1, 0.2)]
        assert powers[0] == 1.0
        assert powers[1] == pytest.approx(1.0, abs=2e-4)
        assert powers == sorted(powers, reverse=True)

    def test_observed_on_the_plate(self):
        """P/2 on 64², 128² and 256² equal cells at μ = 0.2, from `comparisons.benchmark.reference`."""
        errors = [214.23323 - force for force in (214.15964926, 214.19115763, 214.20909600)]
        assert fitted_order([1 / 64, 1 / 128, 1 / 256], errors) == pytest.approx(exponent(0.3, 0.2), abs=0.02)


def test_graded_lines():
    lines = towards(0.0, 2.0, 4, 2.0)
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
    expected = None if order is None else Expected(order, "made up")
    assert orders_of(made_up(errors, least=1e-8), expected)["verdict"] == said


def test_two_meshes_of_the_same_size_have_no_order():
    points = made_up([1.0, 0.5, 0.25])
    again = concat([points, points.tail(1).assign(error=0.2)])
    assert orders_of(again)["last"] == pytest.approx(1.0)


def test_costs_are_those_of_lasting_errors():
    found = made_up([1e-2, 1e-5, 1e-3, 1e-4])
    assert (cost(found, 1e-3), cost(found, 1e-4)) == (256, 4096)
    assert cost(made_up([1e-3, 1e-6, 1e-4, 1e-5]), 2e-5) == 4096  # what is small by chance does not count
    assert cost(found, 1e-5) == cost(found[::-1], 1e-5) == np.inf
    assert np.isnan(cost(made_up([]), 1.0))


class TestAdvantage:
    """How many times more unknowns equal cells take is known as well as meshes lie close."""

    @staticmethod
    def said(uniform, other):
        return pytest.approx(advantage({"uniform": made_up(uniform), "graded": made_up(other)}, 1e-4), nan_ok=True)

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
    small = Study.of("small", 1, study.run, cases)
    return rows_of(small, tmp_path_factory.mktemp("mesh") / "mesh.sqlite")


class TestRun:
    """A small study, and its report."""

    def test_all_are_certified(self, rows):
        assert [row.reason for row in rows if row.status != "done"] == []
        assert all(row.certificate["passed"] and row.certificate["accuracy"] < study.TOLERANCE for row in rows)

    def test_energies_and_forces_are_those_of_the_plate(self, rows):
        found = Overview(meshes_of(rows))
        (plate,) = (problem for problem in found.problems if problem.name == "plate 1")
        meshes, points = found.of(plate, "uniform"), found.curve(plate, FORCE, "uniform")
        assert meshes.energy.tolist() == pytest.approx((0.5e-3 * meshes.force).tolist(), rel=1e-9)
        assert points.error.tolist() == pytest.approx((1.0 - meshes.force / 214.36766).tolist())
        assert orders_of(points)["fitted"] == pytest.approx(1.517, abs=0.1)

    def test_brackets_enclose_the_settled_energy(self, rows):
        found = Overview(meshes_of(rows))
        meshes = found.brackets(PROBLEMS["plate 1"])
        assert meshes["size"].tolist() == [4, 8, 110, 110]
        assert (meshes.lower < 0.10718383).all()
        assert (meshes.upper > 0.10718383).all()
        for record in (row.result["meshes"][0] for row in rows if row.case["model"] == "bracket"):
            assert record["force_bounds"] == pytest.approx([2e3 * record["lower"], 2e3 * record["upper"]])
        assert [values_of(found)[name] for name in ("inside", "guaranteed")] == [4, 4]

    def test_a_bracket_beside_the_reference_is_said(self, rows):
        first = next(row for row in rows if row.case["model"] == "bracket")
        record = {**first.result["meshes"][0], "upper": 0.1071}
        wrong = replace(first, result={"meshes": [record]})
        changed = [wrong if row is first else row for row in rows]
        assert [values_of(Overview(meshes_of(changed)))[name] for name in ("inside", "guaranteed")] == [3, 4]

    def test_the_block_is_exact_in_the_limit(self, rows):
        found = Overview(meshes_of(rows))
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

    def test_the_report_and_its_files(self, rows, tmp_path):
        few = [row for row in rows if row.case["problem"] == "plate 1"]
        texts = {path.name: path.read_text(encoding="utf-8") for path in write_report(report(few), tmp_path)}
        assert "convergence-mesh.html" in texts
        for name in ("gaps", "errors-plate-1", "tractions-plate-1"):
            assert (f"convergence-mesh-{name}.svg" in texts) == has_matplotlib()
        assert "214.308143" in texts["convergence-mesh.md"]
        assert "| 1.52 |" in texts["convergence-mesh.md"]

    @pytest.mark.usefixtures("outlined")
    def test_the_report_is_the_same_for_the_same_rows(self, rows):
        few = [row for row in rows if row.case["problem"] != "plate 1"]
        told = report(few)
        assert told == report(few)
        if not has_matplotlib():
            return
        for name, word in (("tractions-block", "σ_T"), ("ends-block", "stick ends")):
            picture = told.pictures[f"convergence-mesh-{name}.svg"]
            assert picture.startswith("<svg")
            assert word in picture
            assert "[length]" in picture
        assert set(told.pictures) >= {f"convergence-mesh-errors-{problem}.svg" for problem in ("plate-0_2", "block")}

    def test_a_failed_row_is_shown_and_not_replaced(self, rows):
        lost = [row for row in rows if row.case["size"] != 16]
        (gone,) = (row for row in rows if row.case["size"] == 16 and row.case["problem"] == "plate 1")
        failed = replace(gone, status="timeout", reason="more than 1 s", result={}, certificate=None)
        found = Overview(meshes_of([*lost, failed]))
        (line,) = [row for row in failures(found)[FAILED].itertuples(index=False) if row.status == "timeout"]
        assert line == ("plate 1", "uniform", "size 16", "equilibrium", "timeout", "more than 1 s")
        assert values_of(found)["certified"] == values_of(found)["solves"] - 1 == len(found.meshes) - 1
        assert len(found.curve(PROBLEMS["plate 1"], FORCE, "uniform")) == 2


class TestBrokenChains:
    """Chains of adaptive meshes that end before their limit."""

    @pytest.fixture
    def impatient(self, monkeypatch):
        """Solves on more than 200 cells fail."""

        def fails(problem, **options):
            few = {"method": "condensed", "max_iterations": 1} if problem.mesh.active.sum() > 200 else {}
            return solve(problem, **options, **few)

        monkeypatch.setattr(line_refinement, "solve", fails)

    @staticmethod
    def result(sequence, model="equilibrium", size=2000):
        return study.run({"problem": "plate 0.2", "sequence": sequence, "size": size, "model": model})

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
        seen = Overview(meshes_of([*(row for row in rows if row is not chain), replace(chain, result=found)]))
        (line,) = [row for row in failures(seen)[FAILED].itertuples(index=False) if row.status == "unsolved"]
        assert line == ("plate 0.2", "goal", "size 300", "equilibrium", "unsolved", last["message"])
        assert values_of(seen)["certified"] == values_of(seen)["solves"] - 1

    def test_a_mesh_that_cannot_be_made_has_one_too(self, monkeypatch):
        monkeypatch.setattr(study, "refine", partial(refine, thinnest=0.1))
        found = self.result("goal")
        assert found["meshes"][-1]["status"] == "thin_cells"
        assert "thin" in found["meshes"][-1]["message"]
        assert not found["certificate"]["passed"]

    @pytest.mark.usefixtures("impatient")
    def test_a_chain_that_ends_at_its_limit_has_none(self):
        found = self.result("goal", size=256)
        assert [mesh["status"] for mesh in found["meshes"]] == ["solved"]
        assert found["certificate"]["passed"]


@pytest.fixture(scope="module")
def committed():
    """The report of the committed rows and its numbers."""
    return made_again("mesh")


class TestCommitted:
    """The committed rows, and what the report says of them."""

    def test_numbers_of_the_findings(self, committed):
        _, values = committed
        expected = {
            "slipping": "0.804 to 0.937", "slipping_expected": "0.793 to 0.94", "sticking": "1.51",
            "sticking_expected": "1.52", "best": "64 to 4030", "saved": "2.54 to 4100", "missed": 2, "judged": 9,
            "inside": 32, "guaranteed": 32, "change_at": "block", "certified": 503, "solves": 503, "open": 0,
            "brackets": 188,
        }  # fmt: skip
        assert {name: values[name] for name in expected} == expected
        assert values["closest"] == pytest.approx(3.8e-9, rel=0.02)
        assert values["change"] == pytest.approx(3.7e-4, rel=0.02)

    def test_the_committed_report_is_that_of_the_committed_rows(self, committed):
        text, _ = committed
        assert text == committed_text("mesh")


def test_a_reference_of_the_same_models_proves_nothing(rows):
    found = Overview(meshes_of(rows))
    known = found.references["plate 1"]
    found.references["plate 1"] = {**known, "energy": replace(known["energy"], sequence="reference")}
    assert values_of(found)["guaranteed"] == 0
    (line,) = tables_of(found)["brackets"][["problem", "number", "inside", "own"]].to_numpy().tolist()
    assert line == ["plate 1", 4, 4, True]


def test_an_end_is_not_judged_by_itself(rows):
    found = Overview(meshes_of([row for row in rows if row.case["problem"] == "block"]))
    known = found.references["block"]
    assert tuple(tables_of(found)["zones"].iloc[0, 5:7]) == ("17 × 8", "2.0e-2")
    own = replace(known["stick ends"], sequence="uniform", uncertainty=0.1)
    found.references["block"] = {**known, "stick ends": own}
    assert tuple(tables_of(found)["zones"].iloc[0, 5:7]) == ("17 × 8", "gave the value")


def test_costs_are_known_to_the_spacing_of_meshes(rows):
    assert spacing(Overview(meshes_of(rows))) == pytest.approx(4.0)
    assert tables_of(Overview(meshes_of([])))["costs"].empty


def test_a_force_without_a_reference_has_no_costs(rows):
    """As where a time limit ended the solves that it would come from."""
    found = Overview(meshes_of([row for row in rows if row.case["problem"] == "plate 1"]))
    del found.references["plate 1"][FORCE]
    assert (values_of(found)["judged"], values_of(found)["spacing"]) == (0, None)
    costs = tables_of(found)["costs"]
    assert costs[["low", "high", "uniform", "graded"]].isna().all(axis=None)
    assert set(costs.times) == {""}


def test_a_reference_makes_errors_below_it_meaningless(rows):
    found = Overview(meshes_of(rows))
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
    found = Overview(meshes_of([before, replace(first, result={"meshes": [plain]})]))
    known = found.references["plate 0.2"]["stick ends"]
    assert known.value == pytest.approx(end["position"])
    assert known.uncertainty == pytest.approx(end["high"] - end["low"] + 0.08)
    assert abs(known.value - 0.738) < known.uncertainty


@pytest.mark.parametrize("quick", [True, False])
def test_cases(quick):
    cases = study.study(quick).cases
    assert len(cases) == len({tuple(case.values.items()) for case in cases})
    chosen = {(case.values["problem"], case.values["sequence"]) for case in cases}
    assert ("plate 0.2", "reference") in chosen
    assert ("block", "graded") not in chosen
    assert {case.values["model"] for case in cases} == set(study.MODELS)
    assert max(case.values["size"] for case in cases if case.values["model"] == "strict") <= 32
    if not quick:
        assert {case.values["problem"] for case in cases} == set(PROBLEMS)


def run(capfd, *arguments):
    """Exit status, standard output and error of the command, which must start nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", "convergence", *map(str, arguments)])
        patch.setattr(command.RunOptions, "run", lambda *_: pytest.fail("the run was started"))
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    return caught.value.code, out, err


class TestCommand:
    """Options."""

    @pytest.mark.parametrize(
        ("words", "named"),
        [
            (("nothing",), "nothing"),
            (("mesh", "--out", ""), "folder"),
            (("mesh", "--out", "/proc/below"), "/proc/below"),
            (("mesh", "--store", ""), "--store"),
            (("mesh", "--store", "/proc/below"), "/proc/below"),
            (("mesh", "--workers", "0"), "--workers"),
            (("mesh", "--cells", "4"), "--cells"),
        ],
    )
    def test_wrong_options_are_one_line_and_start_nothing(self, capfd, tmp_path, monkeypatch, words, named):
        monkeypatch.chdir(tmp_path)
        status, out, err = run(capfd, *words)
        assert (status, out) == (2, "")
        assert len(err.splitlines()) == 1
        assert named in err

    def test_a_file_in_the_place_of_the_store(self, capfd, tmp_path):
        (tmp_path / "file").touch()
        status, _, err = run(capfd, "mesh", "--out", tmp_path, "--store", tmp_path / "file")
        assert (status, len(err.splitlines())) == (2, 1)

    def test_a_store_of_another_study_is_refused_before_anything(self, capfd, tmp_path):
        run_study(Study("other", 1, "time:sleep", {"x": (1,)}), tmp_path / "mesh.sqlite", progress=False)
        status, out, err = run(capfd, "mesh", "--out", tmp_path, "--store", tmp_path)
        assert (status, out) == (2, "")
        assert "belongs to the study other (version 1)" in err

    def test_help_teaches(self, capfd):
        status, out, _ = run(capfd, "--help")
        assert status == 0
        assert all(word in out for word in ("mesh", "outer", "uzawa", "--quick", "Examples", "FOLDER"))

    def test_json_and_files_of_its_own_for_quick(self, rows, capfd, tmp_path, monkeypatch):
        stores, rows = [], [row for row in rows if row.case["problem"] == "plate 1"]
        monkeypatch.setattr(figures, "drawn", lambda *_: "")
        monkeypatch.setattr(command.RunOptions, "run", lambda self, _: stores.append(self.store))
        monkeypatch.setattr(
            "comparisons.lab.reported.read_study", lambda _: type("Stored", (), {"declaration": {}, "rows": rows})
        )
        monkeypatch.setattr(sys, "argv", ["comparisons", "convergence", "mesh", "--quick", "--json", "--store",
                                          str(tmp_path / "store"), "--out", str(tmp_path / "out")])  # fmt: skip
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
        assert caught.value.code == 0
        document = json.loads(capfd.readouterr().out)
        assert stores == [tmp_path / "store" / "mesh_quick.sqlite"]
        (part,) = document["studies"]
        assert (document["schema"], document["quick"], part["name"]) == (command.SCHEMA, True, "mesh")
        assert len(part["rows"]) == len(rows)
        assert part["findings"] == findings_of(report(rows, quick=True).text)
        assert sorted(map(str, (tmp_path / "out").iterdir())) == sorted(part["files"])
        assert str(tmp_path / "out" / "convergence-mesh-quick.html") in part["files"]
        text = (tmp_path / "out" / "convergence-mesh-quick.md").read_text(encoding="utf-8")
        assert "`python -m comparisons convergence mesh --quick`" in text
