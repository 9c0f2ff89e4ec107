"""Parts of the manual: rows, proofs, texts, and the quantities it measures."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.verification import tables
from comparisons.verification.chapters.not_unique import STATES, _violation
from comparisons.verification.elements import BOTH, EVERY, QUINTIC, RECTANGLES, TRIANGLES, Chapter
from comparisons.verification.measures import between_points, edge_states, point_states, runs, value_at, zone_ends
from comparisons.verification.proof import Proof, both, bounded, by_hand, certified, certified_companion, infeasible
from comparisons.verification.row import absolute, at_least, at_most, enclosed, relative, word
from comparisons.verification.study import as_record
from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, TriangleMesh, solve
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution.limit import LimitLoad
from solvers import Status

PROOF = Proof(passed=True, text="by hand")
REST = ("source", PROOF)
finite = st.floats(-1e6, 1e6, allow_subnormal=False)


class TestRows:
    """Errors as their definitions say; a NaN never passes."""

    @given(finite.filter(lambda x: abs(x) > 1e-6), st.floats(-0.1, 0.1), st.floats(1e-9, 1e-1))
    def test_relative(self, reference, error, tolerance):
        row = relative("q", reference * (1.0 + error), reference, tolerance, *REST)
        assert row.error == pytest.approx(abs(error), abs=1e-12)
        assert row.passed == (row.ratio <= 1.0)

    @given(finite, finite, st.floats(1e-9, 1e3))
    def test_absolute_and_inequality(self, ours, reference, tolerance):
        equal, below, above = (make("q", ours, reference, tolerance, *REST) for make in (absolute, at_most, at_least))
        assert equal.passed == (abs(ours - reference) <= tolerance)
        assert below.passed == (ours - reference <= tolerance)
        assert above.passed == (reference - ours <= tolerance)
        assert max(below.error, above.error) == equal.error
        assert below.error == (0.0 if ours <= reference else equal.error)

    @given(finite, finite, finite, st.floats(1e-9, 1e3))
    def test_bounds_around_what_is_known(self, lower, upper, known, tolerance):
        rows = list(enclosed("{} of P", (lower, upper), known, tolerance, *REST))
        assert [row.quantity for row in rows] == ["lower bound of P", "upper bound of P"]
        assert [row.passed for row in rows] == [lower - known <= tolerance, known - upper <= tolerance]

    @pytest.mark.parametrize("make", [relative, absolute, at_most])
    @pytest.mark.parametrize("ours", [math.nan, math.inf])
    def test_what_is_not_a_number_fails(self, make, ours):
        row = make("q", ours, 1.0, 1e9, *REST)
        assert not row.passed
        assert row.ratio == math.inf
        assert as_record(row)["ratio"] is None
        assert as_record(row)["ours"] is None

    def test_zero_tolerance(self):
        assert at_most("q", 1.0, 1.0, 0.0, *REST).ratio == 0.0
        assert at_most("q", 1.0 + 1e-9, 1.0, 0.0, *REST).ratio == math.inf
        assert not at_most("q", 1.0 + 1e-9, 1.0, 0.0, *REST).passed

    def test_words(self):
        assert word("q", "slip", "slip", *REST).passed
        assert not word("q", "slip", "stick", *REST).passed

    def test_without_proof_the_best_number_fails(self):
        assert not replace(absolute("q", 1.0, 1.0, 1.0, *REST), proof=Proof(passed=False, text="none")).passed


class TestProofs:
    """What certifies a result is looked at, not its numbers."""

    def test_of_results(self):
        good = solve(compressed_plate(0.1))
        early = solve(compressed_plate(0.1), method="uzawa", iterations=30)
        assert certified(good).passed
        assert not certified(early).passed
        assert not certified(good, early).passed
        assert "failed" in certified(good, early).text
        assert not certified().passed

    def test_a_claimed_status_is_not_enough(self):
        early = solve(compressed_plate(0.1), method="uzawa", iterations=30)
        lying = replace(early, solution=replace(early.solution, status=Status.SOLVED))
        assert not certified(lying).passed

    def test_of_infeasibility(self):
        """Tension on a block: its multipliers prove it, their negatives do not, nor does the status alone."""
        contact, sides = Contact("bottom", 0.0), [Symmetry("left"), Traction("right", 0.0, 0.0)]
        mesh = RectilinearMesh.rectangle((2, 2))
        result = solve(ContactProblem(mesh, Material(1e3, 0.3), [contact, *sides, Traction("top", 0.0, 1.0)]))
        assert infeasible(result).passed
        y, nu = result.solution.farkas
        for farkas in ((-y, nu), (0.0 * y, nu), None):
            assert not infeasible(replace(result, solution=replace(result.solution, farkas=farkas))).passed
        assert not infeasible(solve(compressed_plate(0.1))).passed

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
        assert bounded(limit).passed == passed

    def test_of_the_displacement_model(self):
        companion = solve_companion(compressed_plate(0.1))
        assert certified_companion(companion).passed
        assert not certified_companion(companion, guaranteed=True).passed  # the bound moves with the pressure
        assert not certified_companion(replace(companion, status=Status.STALLED)).passed

    def test_together(self):
        assert both(PROOF, PROOF) == PROOF
        assert not both(PROOF, by_hand(passed=False, text="no")).passed
        assert not both().passed


class TestTexts:
    """Digits below the tolerance are not shown; what is shown is right to a hundredth of it."""

    @given(finite.filter(lambda x: abs(x) > 1e-9), st.floats(1e-9, 1e-1))
    def test_digits(self, value, tolerance):
        resolution = tolerance * abs(value) / 100.0
        assert float(tables.number(value, resolution)) == pytest.approx(value, abs=resolution, rel=1e-9)

    def test_noise_is_not_shown(self):
        one, other = (absolute("q", ours, 0.0, 1e-9, *REST) for ours in (3.1e-15, -2.2e-14))
        assert tables.cells(as_record(one)) == tables.cells(as_record(other))
        assert tables.cells(as_record(one))[5:7] == ("0", "< 1e-10 (absolute)")

    def test_errors_say_how_they_are_measured(self):
        row = relative("q", 1.01, 1.0, 1e-3, *REST)
        assert tables.cells(as_record(row))[6:10] == ("1.0e-02 (relative)", "1e-03", "by hand", "FAILED")
        assert tables.cells(as_record(at_most("q", 1.0, 2.0, 1e-3, *REST)))[2] == "≤ 2"
        assert tables.cells(as_record(at_least("q", 1.0, 2.0, 1e-3, *REST)))[2] == "≥ 2"
        assert tables.cells(as_record(word("q", "a", "b", *REST)))[6:8] == ("not equal", "-")


def backwards(problem):
    """On triangles whose vertices, and so whose edges, are numbered from the right."""
    mesh = problem.triangulated().mesh
    last = len(mesh.vertices) - 1
    sets = {name: last - pairs for name, pairs in mesh.edge_sets.items()}
    return replace(problem, mesh=TriangleMesh(mesh.vertices[::-1], last - mesh.cells, sets))


class TestMeasures:
    """Polynomials on edges are evaluated exactly; zones follow the edges."""

    RESULT = solve(compressed_plate(0.1, (5, 3), grading=0.7))
    TURNED = solve(backwards(compressed_plate(0.1, (4, 2))), degree=4).contacts["plate"]

    @given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 1))
    def test_value_at_a_point(self, coefficients, x):
        line = self.RESULT.contacts["plate"]
        polynomial = np.polynomial.Polynomial(coefficients)
        assert value_at(line, polynomial(line.x), x) == pytest.approx(polynomial(x), abs=1e-11)

    def test_between_points(self):
        gauss = (1.0 + np.polynomial.legendre.leggauss(4)[0]) / 2.0
        t = np.linspace(0.0, 1.0, 11)
        found = between_points(np.concatenate([3 * gauss - gauss**2, 1 - gauss]), 4, 11)
        np.testing.assert_allclose(found, [3 * t - t**2, 1 - t], atol=1e-13)

    def test_zones(self):
        points = np.array([0, 2, 2, 2, 2, 2, 1, 1, 2, 1, 1, 1])
        line = replace(solve(compressed_plate(0.1, (3, 1), grading=0.5)).contacts["plate"], state=points)
        assert edge_states(line).tolist() == [2, 2, 1]
        assert runs(edge_states(line)) == "slip, stick"
        assert runs(points) == "open, slip, stick, slip, stick"
        assert zone_ends(line).tolist() == pytest.approx([6.0 / 7.0])

    @given(st.lists(st.floats(-5, 5), min_size=3, max_size=3), st.floats(0, 1))
    def test_edges_of_triangles_may_have_any_order(self, coefficients, x):
        line = self.TURNED
        polynomial = np.polynomial.Polynomial(coefficients)
        assert value_at(line, polynomial(line.x), x) == pytest.approx(polynomial(x), abs=1e-11)
        where = np.linspace(*line.ends[:, :, 0].T, 11).T
        np.testing.assert_allclose(between_points(polynomial(line.x), 3, 11), polynomial(where), atol=1e-11)

    def test_zones_follow_the_contact(self):
        line = replace(self.TURNED, state=np.where(self.TURNED.x < 0.5, 0, 1))
        assert runs(edge_states(line)) == runs(point_states(line)) == "open, stick"
        assert zone_ends(line).tolist() == pytest.approx([0.5])


class TestElements:
    """A problem runs on each of its elements, and its rows say so."""

    @staticmethod
    def names(quick, few=2):
        chapter = Chapter()

        @chapter.on("degree", RECTANGLES, TRIANGLES, QUINTIC, few=few)
        def problem(element, _):
            yield absolute("degree", element.degree, 3.0, 1.0, *REST)

        assert chapter == {"degree": problem}
        return [as_record(row)["element"] for row in problem(quick)]

    def test_rows_name_them(self):
        assert self.names(quick=False) == self.names(quick=False, few=1) == [element.name for element in EVERY]
        assert self.names(quick=True) == [element.name for element in BOTH]
        assert self.names(quick=True, few=1) == [TRIANGLES.name]

    @pytest.mark.parametrize("element", EVERY)
    def test_what_is_solved(self, element):
        space = element.solve(compressed_plate(0.1)).discretization.space
        assert space.degree == element.degree
        assert isinstance(space.mesh, TriangleMesh) == element.has_triangles


def test_the_contact_law_by_hand_knows_the_three_states():
    assert all(_violation(np.array(r)) < 1e-12 for r in STATES.values())


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
    assert _violation(np.array(r)) == pytest.approx(violation, rel=1e-12)
