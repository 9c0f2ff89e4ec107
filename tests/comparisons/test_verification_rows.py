"""Parts of the manual: rows, proofs, texts, and the quantities it measures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons import verification as room
from comparisons.verification import absolute
from comparisons.verification.chapters import STATES, law_violation
from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Expression,
    LimitLoad,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
    solve,
)
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
from solvers import Status

PROOF = room.Proof(passed=True, text="by hand")
REST = ("source", PROOF)
finite = st.floats(-1e6, 1e6, allow_subnormal=False)


class TestRows:
    """Errors as their definitions say; a NaN never passes."""

    @given(finite.filter(lambda x: abs(x) > 1e-6), st.floats(-0.1, 0.1), st.floats(1e-9, 1e-1))
    def test_relative(self, reference, error, tolerance):
        row = room.relative("q", reference * (1.0 + error), reference, tolerance, *REST)
        assert row.error == pytest.approx(abs(error), abs=1e-12)
        assert row.passed == (row.ratio <= 1.0)

    @given(finite, finite, st.floats(1e-9, 1e3))
    def test_absolute_and_inequality(self, ours, reference, tolerance):
        equal, below, above = (
            make("q", ours, reference, tolerance, *REST) for make in (absolute, room.at_most, room.at_least)
        )
        assert equal.passed == (abs(ours - reference) <= tolerance)
        assert below.passed == (ours - reference <= tolerance)
        assert above.passed == (reference - ours <= tolerance)
        assert max(below.error, above.error) == equal.error
        assert below.error == (0.0 if ours <= reference else equal.error)

    @given(finite, finite, finite, st.floats(1e-9, 1e3))
    def test_bounds_around_what_is_known(self, lower, upper, known, tolerance):
        rows = list(room.enclosed("{} of P", (lower, upper), known, tolerance, *REST))
        assert [row.quantity for row in rows] == ["lower bound of P", "upper bound of P"]
        assert [row.passed for row in rows] == [lower - known <= tolerance, known - upper <= tolerance]

    @pytest.mark.parametrize("make", [room.relative, absolute, room.at_most])
    @pytest.mark.parametrize("ours", [math.nan, math.inf])
    def test_what_is_not_a_number_fails(self, make, ours):
        row = make("q", ours, 1.0, 1e9, *REST)
        assert not row.passed
        assert row.ratio == math.inf
        assert room.as_record(row)["ratio"] is None
        assert room.as_record(row)["ours"] is None

    def test_zero_tolerance(self):
        assert room.at_most("q", 1.0, 1.0, 0.0, *REST).ratio == 0.0
        assert room.at_most("q", 1.0 + 1e-9, 1.0, 0.0, *REST).ratio == math.inf
        assert not room.at_most("q", 1.0 + 1e-9, 1.0, 0.0, *REST).passed

    def test_words(self):
        assert room.word("q", "slip", "slip", *REST).passed
        assert not room.word("q", "slip", "stick", *REST).passed

    def test_without_proof_the_best_number_fails(self):
        assert not replace(absolute("q", 1.0, 1.0, 1.0, *REST), proof=room.Proof(passed=False, text="none")).passed


class TestProofs:
    """What certifies a result is looked at, not its numbers."""

    def test_of_results(self):
        good = solve(compressed_plate(0.1))
        early = solve(compressed_plate(0.1), method="uzawa", iterations=30)
        assert room.certified(good).passed
        assert not room.certified(early).passed
        assert not room.certified(good, early).passed
        assert "failed" in room.certified(good, early).text
        assert not room.certified().passed

    def test_a_claimed_status_is_not_enough(self):
        early = solve(compressed_plate(0.1), method="uzawa", iterations=30)
        lying = replace(early, solution=replace(early.solution, status=Status.SOLVED))
        assert not room.certified(lying).passed

    def test_of_infeasibility(self):
        """Tension on a block: its multipliers prove it, their negatives do not, nor does the status alone."""
        contact, sides = Contact("bottom", 0.0), [Symmetry("left"), Traction("right", 0.0, 0.0)]
        mesh = TriangleMesh.rectangle((2, 2), 1.0, 1.0)
        result = solve(ContactProblem(mesh, Material(1e3, 0.3), [contact, *sides, Traction("top", 0.0, 1.0)]))
        assert room.infeasible(result).passed
        y, nu = result.solution.farkas
        for farkas in ((-y, nu), (0.0 * y, nu), None):
            assert not room.infeasible(replace(result, solution=replace(result.solution, farkas=farkas))).passed
        assert not room.infeasible(solve(compressed_plate(0.1))).passed

    @pytest.mark.parametrize(
        ("limit", "passed"),
        [
            (LimitLoad(1.5, 1.6, None, 1.5 + 1e-9, 1e-10), True),
            (LimitLoad(1.5, 1.4, None, 1.5, 0.0), False),
            (LimitLoad(1.5, 1.6, None, 1.5001, 1e-10), False),
            (LimitLoad(1.5, 1.6, None, 1.5, 1e-5), False),
            (LimitLoad(np.inf, np.inf, None, np.inf, 0.0), False),
        ],
    )
    def test_of_limit_loads(self, limit, passed):
        assert room.bounded(limit).passed == passed

    def test_of_the_displacement_model(self):
        companion = solve_companion(compressed_plate(0.1))
        assert room.certified_companion(companion).passed
        assert not room.certified_companion(companion, guaranteed=True).passed  # the bound moves with the pressure
        assert not room.certified_companion(replace(companion, status=Status.STALLED)).passed

    def test_together(self):
        assert room.both(PROOF, PROOF) == PROOF
        assert not room.both(PROOF, room.by_hand(passed=False, text="no")).passed
        assert not room.both().passed


class TestTexts:
    """Digits below the tolerance are not shown; what is shown is right to a hundredth of it."""

    @given(finite.filter(lambda x: abs(x) > 1e-9), st.floats(1e-9, 1e-1))
    def test_digits(self, value, tolerance):
        resolution = tolerance * abs(value) / 100.0
        assert float(room.number(value, resolution)) == pytest.approx(value, abs=resolution, rel=1e-9)

    def test_noise_is_not_shown(self):
        one, other = (absolute("q", ours, 0.0, 1e-9, *REST) for ours in (3.1e-15, -2.2e-14))
        assert room.cells(room.as_record(one)) == room.cells(room.as_record(other))
        assert room.cells(room.as_record(one))[5:7] == ("0", "< 1e-10 (absolute)")

    def test_errors_say_how_they_are_measured(self):
        row = room.relative("q", 1.01, 1.0, 1e-3, *REST)
        assert room.cells(room.as_record(row))[6:10] == ("1.0e-02 (relative)", "1e-03", "by hand", "FAILED")
        exact = room.cells(room.as_record(absolute("q", 1.0, 1.0, 1e-3, *REST)))
        assert exact[6] == "0 (absolute)"
        assert room.cells(room.as_record(room.at_most("q", 1.0, 2.0, 1e-3, *REST)))[2] == "≤ 2"
        assert room.cells(room.as_record(room.at_least("q", 1.0, 2.0, 1e-3, *REST)))[2] == "≥ 2"
        assert room.cells(room.as_record(room.word("q", "a", "b", *REST)))[6:8] == ("not equal", "-")


def backwards(problem):
    """On triangles whose vertices, and so whose edges, are numbered from the right."""
    mesh = problem.mesh
    last = len(mesh.vertices) - 1
    sets = {name: last - pairs for name, pairs in mesh.edge_sets.items()}
    return replace(problem, mesh=TriangleMesh(mesh.vertices[::-1], last - mesh.cells, sets))


class TestMeasures:
    """Polynomials on edges are evaluated exactly; zones follow the edges."""

    TURNED = solve(backwards(compressed_plate(0.1, (4, 2))), degree=4).contacts["plate"]

    def test_between_points(self):
        gauss = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0
        t = np.linspace(0.0, 1.0, 11)
        found = room.between_points(np.concatenate([3 * gauss - gauss**2, 1 - gauss]), 4, 11)
        np.testing.assert_allclose(found, [3 * t - t**2, 1 - t], atol=1e-13)

    def test_zones(self):
        points = np.array([0, 2, 2, 2, 2, 2, 1, 1, 2, 1, 1, 1])
        line = replace(solve(compressed_plate(0.1, (3, 1), grading=0.5)).contacts["plate"], state=points)
        assert room.edge_states(line).tolist() == [2, 2, 1]
        assert room.runs(room.edge_states(line)) == "slip, stick"
        assert room.runs(points) == "open, slip, stick, slip, stick"
        assert room.zone_ends(line).tolist() == pytest.approx([6.0 / 7.0])

    @given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 1))
    def test_edges_of_triangles_may_have_any_order(self, coefficients, x):
        line = self.TURNED
        polynomial = np.polynomial.Polynomial(coefficients)
        assert room.value_at(line, polynomial(line.x), x) == pytest.approx(polynomial(x), abs=1e-11)
        where = np.linspace(*line.ends[:, :, 0].T, 11).T
        np.testing.assert_allclose(room.between_points(polynomial(line.x), 3, 11), polynomial(where), atol=1e-11)

    def test_zones_follow_the_contact(self):
        line = replace(self.TURNED, state=np.where(self.TURNED.x < 0.5, 0, 1))
        assert room.runs(room.edge_states(line)) == room.runs(room.point_states(line)) == "open, stick"
        assert room.zone_ends(line).tolist() == pytest.approx([0.5])


class TestElements:
    """A problem runs on each of its elements, and its rows say so."""

    def test_rows_name_them(self):
        chapter = room.Chapter()

        @chapter.on("degree", room.TRIANGLES, room.QUINTIC, room.Element("triangles of degree 6", 6))
        def problem(element, _):
            yield absolute("degree", element.degree, 5.0, 1.0, *REST)

        assert chapter == {"degree": problem}
        found = [[room.as_record(row)["element"] for row in problem(quick)] for quick in (False, True)]
        assert found == [[f"triangles of degree {p}" for p in (4, 5, 6)], ["triangles of degree 5"]]


def test_the_contact_law_by_hand_knows_the_three_states():
    assert all(law_violation(np.array(r)) < 1e-12 for r in STATES.values())


@pytest.mark.parametrize(
    ("r", "violation"),
    [
        ((1.8, -3.5), 0.04),  # slips by 0.04 below its bound
        ((1.0, -3.0), 1.0),  # beyond the bound
        ((1.0, 2.0), 9.8),  # slips by 4.9 with the traction
        ((-1.0, 0.0), 2.0),  # pulls, which leaves friction less than nothing
        ((1.0, -1.0), 1.2),  # presses at a gap of 1.2
    ],
)
def test_the_contact_law_by_hand_sees_what_breaks_it(r, violation):
    assert law_violation(np.array(r)) == pytest.approx(violation, rel=1e-12)


STEEL = Material(1000.0, 0.3)


def column():
    """A heavy column between lines of symmetry: displacements are quadratic in y, all models have them exactly."""
    mesh = TriangleMesh.rectangle((1, 2), 1.0, 2.0)
    supports = [Symmetry(side) for side in ("bottom", "left", "right")]
    weight = Expression("3.0 * y")
    return ContactProblem(mesh, STEEL, [*supports, Traction("top", 0.0, -1.0)], body_potential=weight)


def leaning():
    """Two heavy blocks in the shape of a dam, which lean on each other: no symmetry, so that moments count."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 2.0)
    vertices = mesh.vertices.copy()
    vertices[:, 0] -= 0.4 * vertices[:, 0] * vertices[:, 1] / 2.0
    mesh = TriangleMesh(vertices, mesh.cells, mesh.edge_sets).with_joint("joint", lambda _, y: y == 1.0)
    free = [Traction(side, 0.0, 0.0) for side in ("top", "left", "right")]
    conditions = [Contact("joint", 0.6), Displacement("bottom", x=0.0, y=0.0), *free]
    return ContactProblem(mesh, STEEL, conditions, body_potential=Expression("3.0 * y + 0.2 * x"))


class TestBalance:
    """Tractions around bodies and their weight, of stresses and of displacements."""

    @pytest.mark.parametrize("problem", [column, leaning])
    def test_stresses_leave_nothing_of_heavy_bodies(self, problem):
        assert room.of_stresses(solve(problem(), degree=4)) < 1e-13

    def test_displacements_leave_nothing_where_they_are_exact(self):
        assert room.of_displacements(solve_companion(column(), degree=2)) < 1e-12

    def test_displacements_leave_what_their_stresses_lack(self):
        """Less with each degree, in the corners slowly."""
        left = [room.of_displacements(solve_companion(leaning(), degree=degree)) for degree in (1, 3)]
        assert 1e-3 < left[1] < 0.03 * left[0]

    def test_a_weight_that_no_traction_carries_is_seen(self):
        """What carries the load 1 on a light column leaves all of the weight 6: above and below 1, at the sides 0.6."""
        light = solve_companion(replace(column(), body_potential=0.0), degree=2)
        heavy = replace(light, problem=column())
        assert room.of_displacements(heavy) == pytest.approx(6.0 / (2.0 * 1.0 + 2.0 * 0.6), rel=1e-12)

    def test_each_body_is_looked_at_by_itself(self):
        """The same column cut at three quarters: the part below is left with the weight 4.5, its sides have 0.45."""
        mesh = TriangleMesh.rectangle((1, 4), 1.0, 2.0).with_joint("joint", lambda _, y: y == 1.5)
        whole = replace(column(), mesh=mesh, conditions=[*column().conditions, Contact("joint", 0.0)])
        light = solve_companion(replace(whole, body_potential=0.0), degree=2)
        heavy = replace(light, problem=whole)
        assert room.of_displacements(heavy) == pytest.approx(4.5 / (2.0 * 1.0 + 2.0 * 0.45), rel=1e-9)
