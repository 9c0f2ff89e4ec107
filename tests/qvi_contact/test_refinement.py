"""Adaptive refinement: estimates against settled values, what reference solutions see, honest ends."""

from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.optimize import brentq

from qvi_contact import InputError, Polynomial, RefinementStatus, RigidPlate, TriangleMesh, refine, solve
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, Symmetry, Traction
from qvi_contact.refinement import Measure, bounded, bulk, energies_between, places, reference_problem
from solvers import Status
from tests.cases import refused_at
from tests.qvi_contact.builders import quarter
from tests.qvi_contact.test_triangles import oblique

FORCE = "plate.normal_force"
FREE = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
# Of the L below: bicubic stress functions on grids of 120 000 unknowns end at -0.04937023. Good to 5e-6.
L_ENERGY = -0.0493704
# Force of the paper's plate by friction coefficient, settled by codes of other elements and by degrees up to 9.
FORCES = {0.05: 210.606417984, 0.2: 214.23323205, 1.0: 214.367658387}


def plate(friction=0.2, cells=(2, 2)):
    return compressed_plate(friction, cells)


def l_shape(ground):
    """An L of side 3 with a re-entrant corner at (1, 1), its top displaced."""
    lines = np.arange(4.0)
    mesh = TriangleMesh.grid(lines, lines, np.array([[1, 1, 1], [1, 0, 0], [1, 0, 0]], dtype=bool))
    mesh = mesh.with_edges("roof", lambda _, y: np.isclose(y, 3.0)).with_edges("step", lambda _, y: np.isclose(y, 1.0))
    free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right", "step")]
    conditions = [ground, *free, Displacement("roof", x=1e-3, y=-1e-3)]
    return ContactProblem(mesh, Material(2.1e5, 0.3, "strain"), conditions)


@pytest.mark.parametrize(("friction", "target", "most"), [(0.05, 7e-7, 600), (1.0, 1e-6, 1000)])
def test_estimates_of_settled_forces_are_one_to_three_times_the_error_and_few_unknowns_do(friction, target, most):
    """The plate with a little stick, and with full stick, from eight triangles: `most` for an error of 1e-6."""
    outcome = refine(plate(friction), None, target, FORCE)
    errors = np.array([abs(each.value / FORCES[friction] - 1.0) for each in outcome.rounds])
    ratios = np.array([each.estimate for each in outcome.rounds]) / errors
    assert len(ratios) >= 2
    assert ((ratios >= 1.0) & (ratios < 3.0)).all(), ratios
    unknowns = np.array([each.unknowns for each in outcome.rounds])
    assert unknowns[errors <= 1e-6][0] <= most
    assert outcome.status is RefinementStatus.REACHED
    assert abs(outcome.value / FORCES[friction] - 1.0) <= target
    if friction > 0.1:  # above 4 for degree 5, as if stresses were smooth: over all rounds of a singular corner
        order = np.log(errors[-3] / errors[-1]) / np.log(unknowns[-1] / unknowns[-3])
        assert order > 3.0 + friction


class TestBounds:
    """When they are taken instead of a reference solution."""

    def test_the_energy_of_a_tied_body(self):
        outcome = refine(l_shape(Contact.tied("bottom")), None, 1e-2, degree=4)
        assert outcome.guaranteed
        assert outcome.status is RefinementStatus.REACHED
        error = abs(outcome.value - L_ENERGY) / outcome.unit
        assert error < outcome.estimate < 4.0 * error

    def test_a_triangle_in_a_corner_does_not_hold_most_of_the_bound(self):
        """Such a corner is bisected several times a round; with one bisection a round 953 unknowns are needed."""
        mesh = TriangleMesh.load(Path(__file__).parents[2] / "examples" / "meshes" / "trapezoid.msh")
        held = [Displacement("top", 0.0, 0.0), Contact.frictionless("base", gap=-1e-3), *FREE]
        outcome = refine(ContactProblem(mesh, Material(1e4, 0.2, "strain"), held), None, 3e-4, degree=3)
        assert outcome.rounds[-1].unknowns < 700

    def test_not_where_only_the_reference_slips(self):
        """On eight triangles of degree 3 the plate sticks; one degree more and smaller triangles show its slip."""
        outcome = refine(plate(0.2), None, 1e-2, FORCE, degree=3)
        assert (outcome.result.contacts["plate"].state == 1).all()
        assert outcome.status is RefinementStatus.REACHED
        assert not outcome.guaranteed

    def test_bounds_that_are_asked_for_are_tried_on_every_mesh(self, monkeypatch):
        none = iter([None])
        monkeypatch.setattr("qvi_contact.refinement.bisection.bounded", lambda *given: next(none, bounded(*given)))
        outcome = refine(plate(0.2), None, 1e-6, FORCE, guaranteed=True, degree=4, max_rounds=2)
        assert [each.guaranteed for each in outcome.rounds] == [False, True]

    def test_a_bracket_that_does_not_hold(self):
        """Data that the elements cannot follow: no bound."""
        wave = Displacement("roof", x=0.0, y=lambda x, y: 1e-3 * np.cos(3.0 * x) + 0 * y)
        problem = replace(whole := l_shape(Contact.tied("bottom")), conditions=[*whole.conditions[:-1], wave])
        outcome = refine(problem, None, 1e-9, degree=3, max_rounds=2)
        assert not any(each.guaranteed for each in outcome.rounds)
        assert np.isfinite([each.estimate for each in outcome.rounds]).all()

    def test_a_motion_has_none(self):
        """Not even that of a plate with the name of a support, whose force is called like the motion."""
        plate = replace(Contact.tied("top", name="bottom"), plate=RigidPlate(force_y=0.0, x=0.0, rotation=0.0))
        bed = replace(Contact.tied("right"), normal_stiffness=1e3, tangential_stiffness=1e3)
        conditions = [Displacement("bottom", 0.0, 1e-3), plate, bed, FREE[0]]
        problem = ContactProblem(TriangleMesh.rectangle((1, 1)), Material(1e3, 0.3), conditions)
        outcome = refine(problem, None, 1e-2, "bottom.y", max_rounds=1)
        assert "bottom.y" in outcome.result.bracket.forces
        assert (outcome.status, outcome.guaranteed) == (RefinementStatus.REACHED, False)
        assert outcome.value == pytest.approx(7.235e-4, rel=1e-2)


class TestReferenceSolution:
    """Where it is, and what it measures."""

    @pytest.mark.parametrize("angle", [0.0, 0.5])
    def test_without_contact_law_the_differences_make_up_the_energy(self, angle):
        """One degree more on the same triangles: spaces are nested, so energies are apart by the energy between."""
        problem = l_shape(Contact.tied("bottom"))
        problem = replace(problem, mesh=oblique(problem.mesh, np.degrees(angle)))
        coarse, fine = solve(problem, degree=4), solve(problem, degree=5)
        found = energies_between(coarse, fine)
        assert (found >= 0.0).all()
        gained = coarse.energies.complementary - fine.energies.complementary
        assert found.sum() == pytest.approx(gained, rel=1e-6, abs=0.0)

    def test_a_strain_energy_on_a_finer_mesh(self):
        """Against a result of which all stresses are zero, the difference is the strain energy of the other."""
        problem = l_shape(Contact.tied("bottom"))
        fine = replace(problem, mesh=problem.mesh.refined([0, 3]))
        at_rest = replace(problem, conditions=[*problem.conditions[:-1], Displacement("roof", x=0.0, y=0.0)])
        found = energies_between(solve(at_rest, degree=4), look := solve(fine, degree=4))
        assert found.sum() == pytest.approx(look.energies.strain, rel=1e-9, abs=0.0)

    def test_corners(self):
        """Where conditions change, where the boundary turns inwards, and where joints end."""
        problem = l_shape(Contact("bottom", 0.3))
        result = solve(problem, degree=3)
        corners = problem.mesh.vertices[places(result).corners]
        expected = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
        assert sorted(map(tuple, corners.tolist())) == sorted(expected)
        mesh = TriangleMesh.rectangle((2, 2), 2.0, 2.0).with_joint("joint", lambda x, y: (y == 1.0) & (x < 1.0))
        conditions = [Contact.tied("bottom"), Contact("joint", 0.4), *FREE, Displacement("top", x=0.0, y=-1e-3)]
        problem = ContactProblem(mesh, Material(1e4, 0.2), conditions)
        found = mesh.vertices[places(solve(problem, degree=3)).corners]
        assert {(1.0, 1.0), (0.0, 1.0)} <= set(map(tuple, found.tolist()))

    def test_changes_of_state(self):
        """The plate sticks up to 0.749: on eight edges the sixth holds the change, on four two edges meet in it."""
        for cells, expected in ((8, [0.625]), (4, [0.5, 0.75])):
            problem = plate(0.2, (cells, cells))
            result = solve(problem, degree=5)
            chosen = places(result).cells
            edges = problem.mesh.edges("top")
            starts = problem.mesh.vertices[edges.first][np.isin(edges.cells[:, 0], chosen), 0]
            assert set(expected) <= set(starts.tolist())
            assert np.abs(starts - 0.749).max() <= 2.0 / cells

    def test_slip_either_way_is_a_change(self):
        """A block pressed on smooth ground spreads to both sides; its mirrored triangles are bisected together."""
        mesh = TriangleMesh.rectangle((4, 1), 4.0, 1.0, origin=(-2.0, 0.0))
        load = Traction("top", x=0.0, y=-10.0)
        problem = ContactProblem(mesh, Material(1e3, 0.3), [Contact("bottom", friction=1e-4), *FREE, load])
        result = solve(problem, degree=4)
        assert (result.contacts["bottom"].state == 2).mean() > 0.9
        middle = problem.mesh.corners[places(result).cells].mean(axis=1)
        assert 0.0 < np.abs(middle[:, 0]).max() < 1.0
        assert bulk(np.array([2.0, 1.0, 3.0, 1.0 - 1e-9, 0.1]), 0.8).tolist() == [True, True, True, True, False]

    @pytest.mark.parametrize(("state", "friction", "along"), [(1, 2.0, -4e-4), (2, 0.2, 1e-3)])
    def test_pressure_that_turns_to_tension_is_a_change(self, state, friction, along):
        """A body that is turned slides or sticks on what keeps its distance: μ|σ_N| has a kink in the middle."""
        turned = Displacement("top", x=along, y=Polynomial([[-5e-4], [1e-3]]))
        conditions = [Contact("bottom", friction, law="bilateral"), turned, *FREE]
        result = solve(ContactProblem(TriangleMesh.rectangle((4, 2)), Material(1e4, 0.2), conditions), degree=3)
        assert (result.contacts["bottom"].state == state).all()
        middle = result.problem.mesh.corners[places(result).cells].mean(axis=1)
        assert 0.0 < np.abs(middle[:, 0] - 0.5).max() < 0.3

    def test_zones_that_it_alone_shows_are_bisected_in_it(self, monkeypatch):
        """Tension below x = 0.012, of which the answer shows nothing; the force is settled by degree 8."""
        turned = Displacement("top", x=3.2e-4, y=Polynomial([[-6.8e-4], [9.2e-4]]))
        conditions = [Contact("bottom", 0.5, law="bilateral"), turned, *FREE]
        problem = ContactProblem(TriangleMesh.rectangle((3, 2)), Material(1e4, 0.2), conditions)
        outcome = refine(problem, None, 1e-4, "bottom.normal_force", max_rounds=1)
        assert 1.0 <= outcome.error / abs(outcome.value - 2.18935) < 3.0
        first = reference_problem(problem, places(solve(problem, degree=5)))  # serves if the second fails
        both = Mock(side_effect=[first, InputError("mesh", "finer", "is too fine")])
        monkeypatch.setattr("qvi_contact.refinement.bisection.reference_problem", both)
        outcome = refine(problem, None, 1e-4, "bottom.normal_force", max_rounds=1)
        assert outcome.error < 0.5 * abs(outcome.value - 2.18935)


class TestAgreementByChance:
    """An answer that equals its reference in one number, which both miss."""

    def test_of_a_stress(self):
        """Where the difference of σyy changes its sign; degree 8 on a finer mesh has digits to spare."""
        answer = solve(problem := plate(0.2), degree=5)
        reference = solve(reference_problem(problem, places(answer)), degree=6)
        exact = solve(replace(problem, mesh=problem.mesh.refined().refined()), degree=8)
        y = brentq(lambda y: (answer.stress(0.7, y) - reference.stress(0.7, y))[1], 0.6193, 0.6303, xtol=1e-5)
        outcome = refine(problem, None, 1e-2, f"yy(0.7, {y!r})", max_rounds=1)
        error = abs(outcome.value - exact.stress(0.7, y)[1])
        assert outcome.error > error > 10.0 * abs(outcome.value - reference.stress(0.7, y)[1])

    def test_of_any_number_in_one_round(self):
        """The energy of the difference falls by a factor that is known, the estimate by at most twice that."""
        values, (gap, next_gap) = iter([1.0, 1.2, 1.2, 1.2]), refine(plate(), None, 1e-9, max_rounds=2).rounds
        outcome = refine(plate(), None, 1e-9, lambda _: next(values), max_rounds=2)
        first, second = (each.estimate * abs(each.value) for each in outcome.rounds)
        assert second / first == pytest.approx(0.5 * next_gap.estimate / gap.estimate, rel=0.2)


@pytest.mark.parametrize(
    ("upright", "quantity", "grows"),
    [*((False, quantity, True) for quantity in ("base.normal_force", "energy")),
     *((False, quantity, False) for quantity in ("base.tangential_force", "base.moment", "yy(1.7, 0.9)")),
     *((True, quantity, True) for quantity in ("base.tangential_force", "dissipation"))],
)  # fmt: skip
def test_what_grows_between_a_support_and_an_obstacle_that_disagree_is_never_reached(upright, quantity, grows):
    """Tractions of a half-plane whose side jumps are normal, as −1/r, where it sticks; in a right angle both grow."""
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0).with_edges("held", lambda x, y: (x < 1.0) & (y < 1e-6))
    mesh = mesh.with_edges("base", lambda x, y: (x > 1.0) & (y < 1e-6))
    plate, held = RigidPlate(x=0.0, y=5e-5, rotation=0.0, pivot=(1.0, 0.0)), Displacement("held", 0.0, 0.0)
    conditions = [Contact("base", 0.3, plate=plate), held, FREE[0]]
    if upright:
        conditions = [Contact("bottom", 0.1, name="base"), Displacement("left", 0.0, -1e-4)]
    conditions += [Displacement("top", 0.0, -1e-3), FREE[1]]
    problem, corner = ContactProblem(mesh, Material(2.1e5, 0.3), conditions), (0.0 if upright else 1.0, 0.0)
    value, meshes = Measure.of(problem, quantity).value, [mesh.graded([corner], depth) for depth in (7, 11, 15)]
    values = np.array([value(solve(replace(problem, mesh=each))) for each in meshes])
    before, change = np.abs(np.diff(values) / values[-1])
    assert change == pytest.approx(before, rel=0.1) if grows else change < max(0.2 * before, 1e-5)
    for target in (max(5.0 * change, 1e-3), min(max(40.0 * change, 1e-3), 1.0)):  # nothing shows what is far below it
        outcome = refine(problem, None, target, quantity, max_rounds=1)
        assert (outcome.status is RefinementStatus.NO_LIMIT) == (grows and target < 15.0 * change)


def test_a_plate_that_a_support_stops_never_comes_to_rest():
    """Exactly it does not move; a computed motion falls by a sixth a round, less than the difference of a reference."""
    sides = [Displacement(side, x=0.0, y=0.0) for side in ("left", "right", "bottom")]
    top = replace(Contact.tied("top"), plate=RigidPlate(force_y=-5.0))
    problem = ContactProblem(TriangleMesh.rectangle((4, 2), 2.0, 1.0), Material(2.1e5, 0.3, "strain"), [top, *sides])
    outcome = refine(problem, None, 0.9, "top.y")
    assert (outcome.status, outcome.estimate) == (RefinementStatus.NO_LIMIT, np.inf)
    below = Traction("bottom", x=0.0, y=5.0)  # the plate's share of stresses far away is small
    far = refine(replace(problem, conditions=[top, *sides[:2], below]), None, 1e-2, "xx(1, 0.3)")
    at_rest = replace(top, plate=RigidPlate(x=0.0, y=0.0, rotation=0.0))
    mesh = problem.mesh.graded([(0.0, 1.0), (2.0, 1.0)], 10)
    exact = solve(replace(problem, mesh=mesh, conditions=[at_rest, *sides[:2], below])).stress(1.0, 0.3)[0]
    assert far.status is RefinementStatus.REACHED
    assert abs(far.value - exact) < far.error


def test_errors_of_a_callback_are_the_callers():
    with refused_at("Contact.friction", "-1"):
        refine(plate(), None, 1e-9, callback=lambda _: Contact("top", -1.0))


def test_an_exact_solution_and_a_body_without_loads_are_known_at_once():
    """Without friction the plate is under uniform stress, and a force that vanishes counts as such.

    Errors of that force are relative to 1e-6 of the other, of which 3e-10 is the rounding of bounds. Where every
    number is zero the error, which is zero, is no share of it.
    """
    for quantity, value, target in (("energy", -2.09e5 * 1e-6 / 2, 1e-8), ("plate.tangential_force", 0.0, 1e-3)):
        outcome = refine(plate(0.0, (1, 1)), None, target, quantity)
        assert outcome.status is RefinementStatus.REACHED
        assert len(outcome.rounds) == 1
        assert outcome.value == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert outcome.unit == pytest.approx(1e-6 * 2.09e5 * 1e-3)
    outcome = refine(compressed_plate(0.2, (1, 1), displacement=0.0), None, 1e-3, degree=3)
    assert (outcome.status, len(outcome.rounds), outcome.value) == (RefinementStatus.REACHED, 1, 0.0)
    assert outcome.estimate == 0.0


def test_a_refinement_goes_on_from_an_earlier_result():
    first = refine(plate(0.2), None, 1e-3, FORCE, degree=3)
    again = refine(plate(0.2), first.result, 1e-3, FORCE, degree=3)
    assert len(again.rounds) == 1
    assert again.rounds[0].unknowns == first.rounds[-1].unknowns
    assert again.value == pytest.approx(first.value, rel=1e-9)
    with refused_at("result", "another body"):
        refine(compressed_plate(0.2, width=0.9), first.result)
    large = compressed_plate(0.2, (2, 2), width=1e3, height=1e3, young=2.09e11, displacement=1.0)  # in other units
    assert refine(large, None, 1e-3, FORCE, degree=3).value == pytest.approx(1e9 * first.value, rel=1e-7)


class TestEnds:
    """What happens where the target is out of reach."""

    def test_unknowns(self):
        outcome = refine(plate(0.2), None, 1e-9, max_unknowns=200, degree=4)
        assert outcome.status is RefinementStatus.UNKNOWNS
        assert all(each.unknowns <= 200 for each in outcome.rounds)
        assert outcome.rounds[-1].unknowns == outcome.result.discretization.qvi.n
        with refused_at("max_unknowns", "48 unknowns"):
            refine(plate(0.2), max_unknowns=47, degree=4)

    def test_cells_too_thin_for_double_precision(self):
        """Triangles a hundred times as long as high: rounding keeps their stresses from 1e-12."""
        conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0), Contact("top", 0.3, gap=-1e-3)]
        needles = ContactProblem(TriangleMesh.rectangle((4, 3), 100.0, 1.0), Material(1e3, 0.3), conditions)
        outcome = refine(needles, None, 1e-9, degree=3, method="condensed", tolerance=1e-12)
        assert outcome.result.status is Status.INACCURATE
        assert outcome.status is RefinementStatus.THIN_CELLS

    def test_a_load_that_cannot_be_carried(self):
        sides = [Traction("left", x=0.0, y=-6.0), Traction("right", x=0.0, y=6.0)]
        conditions = [Contact("bottom", friction=0.5), Traction("top", x=6.0, y=-10.0), *sides]
        block = ContactProblem(TriangleMesh.rectangle((2, 1), 2.0, 1.0), Material(1e4, 0.2), conditions)
        outcome = refine(block, None, 1e-2)
        assert outcome.status is RefinementStatus.UNSOLVED
        assert outcome.result.status is not Status.SOLVED
        assert (outcome.rounds, outcome.indicator.shape, outcome.estimate) == ((), (4,), np.inf)

    @pytest.mark.parametrize(("friction", "most", "bounded"), [(0.0, 90, True), (0.1, 220, False)])
    def test_no_time_for_a_reference_solution(self, clock, friction, most, bounded):
        """Each takes a second or two: an answer whose accuracy nobody can tell is none, or all that there is."""

        def slow(value):
            def field(x, _):
                clock.passes(float(x.size > most))  # points of edges at once: judging an answer takes more
                return value + 0.0 * x

            return field

        top, *others = sorted(plate(friction).conditions, key=lambda each: not isinstance(each, Contact))
        top = replace(top, gap=-1e-3) if bounded else replace(top, gap=slow(-1e-3))
        problem = replace(plate(friction), conditions=[replace(top, cohesion=slow(8.0)) if bounded else top, *others])
        outcome = refine(problem, None, 1e-9, degree=3, time_limit=0.5)
        assert outcome.status is RefinementStatus.TIME_LIMIT
        assert len(outcome.rounds) == 1
        assert np.isfinite(outcome.estimate) == outcome.indicator.any() == bounded


def test_what_is_not_proved_under_friction_is_estimated():
    """A block that slips outwards at both ends of its top."""
    block = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
    conditions = [Contact("top", 0.05, gap=-1e-3, name="plate"), Displacement("bottom", x=0.0, y=0.0), *FREE]
    outcome = refine(ContactProblem(block, Material(1e4, 0.2), conditions), None, 1e-2, FORCE, guaranteed=True)
    assert outcome.status is RefinementStatus.NO_GUARANTEE
    assert outcome.estimate <= 1e-2
    assert not outcome.guaranteed


def test_a_quantity_of_ones_own():
    def corner_pressure(result):
        return -float(result.stress(0.0, 1.0)[1])

    outcome = refine(compressed_plate(1.0), None, 1e-3, corner_pressure)
    assert (outcome.quantity, outcome.guaranteed) == ("corner_pressure", False)
    assert outcome.value == corner_pressure(outcome.result)
    assert outcome.status is RefinementStatus.REACHED
    outcome = refine(plate(0.2), None, 0.5, lambda result: result.contacts["plate"].lengths["slip"], degree=3)
    assert (outcome.rounds[0].value, outcome.rounds[0].estimate, outcome.value > 0.0) == (0.0, 1.5, True)


class TestStressesAndSlip:
    """What engineers look at: the largest stress along an edge, that at a point, slip, and what friction loses."""

    @pytest.mark.parametrize("quantity", ["inner.largest_first", "first(0.8, 0.6)", "outer.largest_von_mises"])
    def test_estimates_in_lames_ring(self, quantity):
        """Radii 1 and 2, unit pressure in the bore: σ_θ = 5/3 there, and 2/3 at the rim."""
        loads = [Traction("inner", normal=-1.0, tangential=0.0), Traction("outer", normal=0.0, tangential=0.0)]
        ring = ContactProblem(quarter(2, 3), Material(1.0, 0.3), [*loads, Symmetry("bottom"), Symmetry("left")])
        outcome = refine(ring, None, 1e-9, quantity, degree=4, max_rounds=1)
        exact = 2.0 / 3.0 if quantity.startswith("outer") else 5.0 / 3.0
        assert 0.3 <= outcome.error / abs(outcome.value - exact) <= 3.0

    def test_a_block_that_widens(self):
        """Pressure p on a smooth wall: the slip is ν p x/E, and σ_yy = −p."""
        sides = [Symmetry("left"), Traction("right", 0.0, 0.0), Traction("top", x=0.0, y=-3.0)]
        block = ContactProblem(TriangleMesh.rectangle((3, 1)), Material(10.0, 0.3), [*sides, Contact("bottom", 0.0)])
        quantities = ("bottom.slip(0.336, 0)", "bottom.slip(1, 0)", "bottom.largest_pressure", "von_mises(0.2, 0.6)")
        outcomes = [refine(block, None, 1e-6, quantity) for quantity in quantities]
        assert [each.value for each in outcomes] == pytest.approx([0.03024, 0.09, 3.0, 3.0])
        assert all(each.status is RefinementStatus.REACHED for each in outcomes)

    def test_a_largest_stress_between_the_places_looked_at(self):
        """σ_yy = 5 − 2 (x − a)² and σ_xx = 2 y² are in equilibrium, and compatible: 5 at a."""
        pull, side = (lambda x, _: 5.0 - 2.0 * (x - 0.4321) ** 2), (lambda _, y: 2.0 * y**2)
        loads = [Traction("top", x=0.0, y=pull), Traction("bottom", x=0.0, y=lambda x, y: -pull(x, y))]
        loads += [Traction("right", x=side, y=0.0), Traction("left", x=lambda x, y: -side(x, y), y=0.0)]
        block = ContactProblem(TriangleMesh.rectangle((1, 2)), Material(10.0, 0.3), loads)
        assert refine(block, None, 1e-6, "top.largest_yy", degree=4, max_rounds=1).value == pytest.approx(5.0, rel=1e-9)

    def test_points_on_borders(self):
        """Numbers of triangles do not matter beside another material, nor rounding on sides of smaller ones."""
        mesh = TriangleMesh.rectangle((2, 2), 2.0, 2.0)
        conditions = [Contact("bottom", 0.0), Symmetry("left"), FREE[1], Traction("top", x=0.0, y=lambda x, _: -x)]
        layers = ContactProblem(mesh, Material(1.0, 0.45, "strain"), conditions)
        layers = replace(layers, regions=[Region(Material(1.0, 0.0, "strain"), y=(1.0, 2.0))])
        last, names = len(mesh.vertices) - 1, mesh.edge_sets.items()
        back = TriangleMesh(mesh.vertices[::-1], last - mesh.cells[::-1], {name: last - pairs for name, pairs in names})
        for quantity in ("von_mises(0.7, 1)", "bottom.slip(1, 0)", "xx(0, 0)", "first(1, 1)", "right.largest_xx"):
            both = (replace(layers, mesh=each) for each in (mesh, back))
            one, other = (refine(each, None, 1.0, quantity, degree=4, max_rounds=1).value for each in both)
            assert one == pytest.approx(other, rel=1e-9, abs=1e-9)
        far, pressed = TriangleMesh.rectangle((3, 3), origin=(4.5e6, 4.5e6)), Displacement("top", x=0.1, y=-0.1)
        far = ContactProblem(far, Material(1.0, 0.3), [Contact("bottom", 0.3), *FREE, pressed])
        assert abs(refine(far, None, 1.0, "right.largest_xx", degree=4, max_rounds=1).value) < 1e-9
        assert refine(layers, None, 1e-9, "yy(2.0000000008, 0.8)", degree=4, max_rounds=4).estimate < 0.1

    def test_slip_in_a_kink_is_that_of_one_edge(self):
        """However the body is turned; on one it is the normal displacement of the other, ±0.05, whose mean is 0."""
        mesh = TriangleMesh.rectangle((2, 2)).with_edges("ell", lambda x, y: (x == 0.0) | (y == 0.0))
        loads = [Traction(edges, normal=-load, tangential=0.0) for edges, load in (("top", 1.0), ("right", 3.0))]
        found = []
        for angle in (0.0, 0.3, 1.0, 2.2, 4.0):
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            turned = replace(mesh, vertices=(mesh.vertices + 0.3) @ turn)
            x, y = np.array([0.3, 0.3]) @ turn
            problem = ContactProblem(turned, Material(10.0, 0.3), [Contact("ell", 0.0, gap=-0.05), *loads])
            quantity = f"ell.slip({float(x)!r}, {float(y)!r})"
            found.append(refine(problem, None, 1.0, quantity, degree=3, max_rounds=1).value)
        assert np.abs(found) == pytest.approx(np.full(5, 0.05), rel=1e-9)  # towards +x

    PRESSED = (*FREE, Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-6.0, x=0.0, rotation=0.0)))

    def test_what_friction_loses_in_a_cycle(self):
        """A block rubbed to and fro on the ground under 6: μ N times its way, 1.5 in all."""
        wall, ways = Contact("bottom", 0.2, name="wall"), (0.0, 0.5, 0.0, -0.5)
        mesh, stiff = TriangleMesh.rectangle((2, 1), 2.0), Material(1e4, 0.3)
        steps = [ContactProblem(mesh, stiff, [*self.PRESSED, replace(wall, offset=way)]) for way in ways]
        outcome = refine(steps, None, 1e-3, "dissipation", degree=3)
        assert outcome.status is RefinementStatus.REACHED
        assert outcome.value == pytest.approx(0.2 * 6.0 * 1.5, rel=2e-3)
        assert (len(outcome.history.steps), outcome.history.dissipated.sum()) == (4, outcome.value)
        with pytest.raises(InputError, match="load steps"):
            refine(steps, guaranteed=True)

    def test_a_singular_peak_is_not_reached(self):
        """The pressure of the plate grows towards its corner, where it sticks."""
        outcome = refine(plate(1.0), None, 1e-2, "plate.largest_pressure", max_rounds=4)
        values = [each.value for each in outcome.rounds]
        assert values == sorted(values)
        assert outcome.status is not RefinementStatus.REACHED
        assert (outcome.estimate > 0.1, "infinite" in outcome.message) == (True, True)


@pytest.mark.parametrize(
    ("field", "value"),
    [*(("target", value) for value in (0.0, "small", 2.0)),
     *(("quantity", value) for value in ("plate", "base.normal_force", 3, "plate.x", "left.largest_pressure")),
     *(("quantity", value) for value in ("xx(1, a)", "xx(0.5)", "xx(9, 0)", "zz(0, 0)", "plate.slip(0.5, 0.5)")),
     *(("quantity", lambda _, told=told: told) for told in (None, np.nan, np.ones(2))),
     *(("max_unknowns", value) for value in (0, 63)),
     *(("max_rounds", 0), ("throw", True), ("initial", None), ("degree", 12))],
)  # fmt: skip
def test_bad_input(field, value):
    with refused_at(field):
        refine(compressed_plate(0.2), **{field: value})
    with pytest.raises(InputError, match="ContactProblem"):
        refine(compressed_plate(0.2).mesh)


@pytest.mark.parametrize(("good", "rounds"), [(2, 1), (4, 2), (9, 3)])
def test_functions_may_give_arrays_without_dimension_and_fail_later(good, rounds):
    """Each round asks for a value of the answer and one of the reference; what was found before stays."""
    asked = iter(range(99))

    def force(result):
        return np.array(result.contacts["plate"].normal_force) if next(asked) < good else np.nan

    outcome = refine(compressed_plate(0.2, (1, 1)), None, 1e-9, force, max_rounds=3)
    assert len(outcome.rounds) == rounds
    assert outcome.status is (RefinementStatus.ROUNDS if good > 6 else RefinementStatus.UNSOLVED)


@pytest.mark.parametrize("seconds", [0.5, 1.5])
def test_the_answer_is_that_of_the_last_round_in_time(clock, seconds):
    """A second a round."""
    seen = []

    def callback(record):
        seen.append(record)
        clock.passes(1.0)

    outcome = refine(compressed_plate(0.2, (2, 2)), target=1e-9, time_limit=seconds, callback=callback)
    assert outcome.status is RefinementStatus.TIME_LIMIT
    assert len(outcome.rounds) == len(seen) == np.ceil(seconds)
    assert outcome.estimate == seen[-1].estimate < np.inf
    assert outcome.result.status is Status.SOLVED


def test_no_time_for_the_first_round():
    assert refine(compressed_plate(0.2, (2, 2)), time_limit=1e-9).result.status is Status.TIME_LIMIT


def test_bounds_that_time_cuts_short_are_no_round(clock):
    def gap(x, _):
        clock.passes(float(x.size > 200))  # points of edges at once: bounds of the second round take more
        return -1e-3 + 2e-3 * x

    *others, plate = (problem := compressed_plate(0.05, (1, 1))).conditions
    problem = replace(problem, conditions=[*others, replace(plate, gap=gap)])
    outcome = refine(problem, None, 1e-6, FORCE, guaranteed=True, degree=4, time_limit=0.5)
    assert (outcome.status, len(outcome.rounds)) == (RefinementStatus.TIME_LIMIT, 1)
