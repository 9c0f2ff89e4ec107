"""Rigid pins and plates that are moved or driven, on edges that face any way: motion, force, moment, what is free."""

import re
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from qvi_contact import Contact, InputError, refine, solve, solve_history, solve_sweep
from qvi_contact.bracket import bracket
from qvi_contact.command import result_lines
from qvi_contact.companion import solve_companion
from qvi_contact.discretization import Scales, pins
from qvi_contact.gallery import arc, fan, press_fit_torque
from qvi_contact.mechanism import find_mechanism
from qvi_contact.mesh import TriangleMesh, cross
from qvi_contact.plots import history_figure, result_figure
from qvi_contact.problem import ContactProblem, Displacement, Material, RigidPlate, Traction, along_edges, disc_gap
from qvi_contact.refinement import unit_of
from qvi_contact.solution import turning_senses
from qvi_contact.units import Units
from solvers import Status
from tests.qvi_contact.builders import difference, holed, polygon, solved
from tests.qvi_contact.test_plates import SIDES, moved

UNIT = Material(1.0, 0.3)
SHEET, SMALL = polygon(24, 4, outer=3.0), polygon(16, 2)


def pinned(pin, outside=None, mesh=SHEET):
    """A sheet of 24 sides with a hole of radius 1, held outside."""
    outside = outside or Displacement("outside", x=0.0, y=0.0)
    return ContactProblem(mesh, UNIT, [pin, outside])


@cache
def pushed(friction=0.3):
    """A pin that is 0.01 smaller than its hole, pushed by a half of its radius, unit modulus."""
    return solved(pinned(Contact.pin("hole", friction, (0.0, 0.0), 0.99, x=0.5)))


def test_a_pin_that_is_moved_and_the_force_that_moves_it_so():
    expected = pushed()
    force = expected.plate_force("hole")
    assert force.x == pytest.approx(0.8772675720, rel=1e-8)
    assert (expected.plates["hole"].x, expected.plates["hole"].y) == (0.5, 0.0)
    pin = Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=force.x, force_y=force.y, moment=force.moment)
    result = solved(pinned(pin))
    motion = result.plates["hole"]
    assert (motion.x, motion.y, motion.rotation) == pytest.approx((0.5, 0.0, 0.0), abs=1e-7)
    assert difference(expected, result) < 1e-6
    assert result.contacts["hole"].gap == pytest.approx(expected.contacts["hole"].gap, abs=1e-6)
    assert result.remarks == ()
    # far from the origin the gap, constant along the arcs of a round hole, is not divided into 1024 parts an edge
    far = replace(ROUND, vertices=np.add(ROUND.vertices, (5e5, 5.5e6)))
    gap = along_edges(far, far.edges("hole"), "gap", disc_gap((5e5, 5.5e6), 0.99))
    assert len(gap.edge) == len(far.edges("hole"))
    assert gap.values == pytest.approx(0.01, abs=1e-7)
    square = TriangleMesh.rectangle((2, 1), origin=(5e5, 5.5e6))  # jumps along edges, of fields that jump across too
    jump = lambda x, y: np.where(x < 500000.5, y == 5.5e6, y <= 5.5e6) * ((x - 5e5) % 0.5 < 0.3)  # noqa: E731
    assert along_edges(square, square.edges("bottom"), "gap", jump).coefficients(0) == pytest.approx(0.6, abs=1e-8)
    # both models enclose the work of the pin; that of displacements knows its motion, and its forces come to the same
    found = bracket(expected)
    assert found.lower <= found.upper < 1.03 * found.lower
    assert found.companion.plates["hole"] == expected.plates["hole"]
    other = solve_companion(expected.problem, degree=4)
    assert other.contacts["hole"].normal_force == pytest.approx(expected.contacts["hole"].normal_force, rel=0.05)


@pytest.mark.parametrize(("side", "law"), [("right", "unilateral"), ("top", "tied"), ("top", "wet")])
def test_motion_of_a_plate_is_a_gap_and_an_offset(side, law):
    """Prescribed motions beside the gap and offset that they are on one straight side, bounds and fluid included."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    *_, sign, normal = SIDES[side]
    given = {"friction": 0.0, "law": "tied"} if law == "tied" else {"friction": 0.3}
    base = Contact(side, **given, gap=1e-3, name="plate", pore_pressure=2.0 if law == "wet" else 0.0)
    motion = {"x": -9e-3 if normal == "x" else 1e-3, "y": -9e-3 if normal == "y" else 1e-3, "rotation": 1e-3}
    pivot, rest = (0.7, -0.3), [name for name in ("top", "right") if name != side]
    others = [Traction(rest[0], x=0.0, y=0.0), Displacement("left", x=0.0, y=0.0), Traction("bottom", x=0.0, y=0.0)]
    steel = Material(1000.0, 0.3)
    expected = solved(
        ContactProblem(mesh, steel, [moved(base, **motion, pivot=pivot, sign=sign, normal=normal), *others])
    )
    plate = replace(base, plate=RigidPlate(pivot=pivot, **motion))
    result = solved(ContactProblem(mesh, steel, [plate, *others]))
    assert difference(expected, result) < 1e-9
    assert vars(result.plates["plate"]) == {**motion, "centre": pivot}
    assert Scales.of(result.problem).displacement == pytest.approx(Scales.of(expected.problem).displacement, rel=1e-12)
    for name, value in vars(expected.energies).items():
        assert getattr(result.energies, name) == pytest.approx(value, rel=1e-8), name
    ours, theirs = bracket(expected), bracket(result)
    assert (theirs.lower, theirs.upper) == pytest.approx((ours.lower, ours.upper), rel=1e-7)
    assert -theirs.lower == pytest.approx(result.energies.complementary, rel=1e-8)
    assert theirs.guaranteed == ours.guaranteed


class TestShearAroundABore:
    """The tangential force counts counterclockwise, so that on a circle it has the moment of the pin."""

    def test_in_a_hole(self):
        pin = Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=0.1, force_y=0.0, rotation=-1.0)
        result = solved(pinned(pin, mesh=ROUND), degree=3)
        moment = result.plate_force("hole").moment
        assert result.contacts["hole"].tangential_force == pytest.approx(moment, rel=1e-9)
        assert moment < 0.0
        assert result.bracket.companion.contacts["hole"].tangential_force == pytest.approx(moment, abs=2e-3)
        assert f"moment {moment:.6g} N mm/mm about (0, 0)" in "".join(result_lines(result, Units("mm", "MPa")))

    def test_on_half_a_bore(self):
        """Its right half, where tangents turn back; in its lower half they lead around it anyway."""
        for low, high, signs in ((-90.0, 90.0, {-1.0, 1.0}), (180.0, 360.0, {1.0})):
            angles = np.deg2rad(np.linspace(low, high, 9))
            mesh = fan([arc(radius, angles) for radius in (1.0, 2.0)], closed=False, arcs=("inner",))
            edges = mesh.edges("inner")
            senses, arms = turning_senses(mesh.vertices, edges), mesh.vertices[edges.first]
            assert set(senses) == signs
            assert (senses * cross(arms, edges.tangent) > 0.0).all()

    @pytest.mark.parametrize(("depth", "at", "sense"), [(0.25, 1, 1), (0.25, 1, -1), (1, 1, 1), (0.5, 1.7, 1)])
    def test_a_base_with_a_step_counts_from_end_to_end(self, depth, at, sense):
        """Around its middle it does not turn, but for rounding, which told the sense of the force on it."""
        grid = TriangleMesh.grid([0, at, 2], [-depth, 0, 1], [[False, True], [True, True]])
        base = grid.with_edges("base", lambda x, y: (y <= 0.0) & (x < 2.0))
        for shift in np.linspace(-3.0, 3.0, 13):
            mesh = replace(base, vertices=base.vertices * [sense, 1.0] + [shift, 0.7 * shift])
            edges = mesh.edges("base")
            level = np.abs(edges.normal[:, 1]) > 0.5
            assert set(turning_senses(mesh.vertices, edges)[level]) == {1.0}
        # two lines that face each other are not one: top and bottom of a block count along x both
        mesh = TriangleMesh.rectangle((2, 2)).with_edges("both", lambda _, y: (y == 0.0) | (y == 1.0))
        assert (turning_senses(mesh.vertices, mesh.edges("both")) == 1.0).all()


class TestPinsOfASeries:
    """Tables, frames and pages of several results show how far a pin has moved, and what it does to the body."""

    @staticmethod
    def problem(friction=0.0):
        return pinned(Contact.pin("hole", friction, (0.0, 0.0), 0.99, force_x=0.1), mesh=ROUND)

    def test_frames_and_a_store(self, tmp_path):
        sweep = solve_sweep(self.problem(), "friction", [0.0, 0.3], degree=3)
        frame = sweep.to_frame(Units("mm", "MPa"))
        assert list(frame["moved_x [mm]"]) == [step.plates["hole"].x for step in sweep.steps]
        assert list(frame["moment [N mm/mm]"]) == [step.plate_force("hole").moment for step in sweep.steps]
        assert frame["force_x [N/mm]"].to_numpy() == pytest.approx(0.1)
        assert list(frame["rotation [rad]"]) == [0.0, 0.0]
        history = solve_history([self.problem()], degree=3).to_frame()
        assert history["moved_x"][0] == pytest.approx(frame["moved_x [mm]"][0], rel=1e-9)
        problem = pinned(self.problem().contacts[0], Contact("outside", 0.0, law="tied"), ROUND)
        asked = (problem, "friction", [0.0, 0.3])
        stored = solve_sweep(*asked, store=tmp_path / "a.sqlite", degree=3).to_frame()
        assert stored.equals(solve_sweep(*asked, degree=3).to_frame())
        assert stored["moment"].isna().tolist() == [False, True] * 2


class TestRefinedForAPin:
    """The force of a pin that is moved, and the motion of one that is driven, by their names."""

    def test_bounds_of_the_force(self):
        pin = replace(Contact.tied("hole", name="pin"), plate=RigidPlate(x=0.1))
        found = refine(pinned(pin, mesh=SMALL), None, 0.02, "pin.force_x", degree=5)
        settled = solved(found.problem, degree=6).plate_force("pin").x
        assert found.guaranteed
        assert abs(found.value - settled) <= found.error < 0.02 * settled
        lower, upper = found.result.bracket.forces["pin.force_x"]
        assert lower <= settled <= upper < lower + 0.03 * settled
        assert unit_of(found.quantity, Units("mm", "MPa")) == "N/mm"
        # names of what has no plate are refused
        problem = pinned(Contact("hole", 0.3, gap=-0.01), mesh=SMALL)
        with pytest.raises(InputError) as caught:
            refine(problem, None, 0.1, "hole.x")
        assert "hole.normal_force" in caught.value.remedy
        assert "hole.moment" not in caught.value.remedy


ROUND = polygon(16, 2).with_arc("hole", (0.0, 0.0), 1.0).with_arc("outside", (0.0, 0.0), 2.0)


@pytest.mark.parametrize("side", ["top", "right"])
def test_load_steps_of_a_plate_that_moves_are_those_of_its_gap_and_offset(side):
    """Forces, where the obstacle is, and what friction has cost."""
    mesh, steel, (opposite, *free, sign, normal) = TriangleMesh.rectangle((2, 2)), Material(1000.0, 0.3), SIDES[side]
    others = [*(Traction(name, 0.0, 0.0) for name in free), Displacement(opposite, x=0.0, y=0.0)]
    along, base = "x" if normal == "y" else "y", Contact(side, 0.3, name="plate")
    motions = [{along: 4e-3 * t, normal: -5e-3, "rotation": 1e-4, "pivot": (0.7, -0.3)} for t in (0.5, 1.0, -1.0)]
    plates = [replace(base, plate=RigidPlate(**motion)) for motion in motions]
    steps = plates, [moved(base, **motion, sign=sign, normal=normal) for motion in motions]
    ours, theirs = (
        solve_history([ContactProblem(mesh, steel, [contact, *others]) for contact in contacts], degree=3)
        for contacts in steps
    )
    assert ours.dissipated == pytest.approx(theirs.dissipated, rel=1e-6)
    for mine, other in zip(ours.loop("plate"), theirs.loop("plate"), strict=True):
        assert mine == pytest.approx(other, rel=1e-6)


def test_the_loop_of_a_pin_is_that_of_the_motion_that_does_the_work():
    """To and fro along x, by equal steps from where it slips: the area is what friction and springs took."""
    steps = [pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 1.02, x=0.01 * x), mesh=ROUND) for x in (0.0, 1.0, 0.0, -1.0)]
    history = solve_history(steps, degree=3)
    displacement, force = history.loop("hole")
    assert displacement == pytest.approx([0.0, 0.01, 0.0, -0.01], abs=1e-12)
    assert force == pytest.approx([step.plate_force("hole").x for step in history.steps])
    turns = [pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 1.02, rotation=0.01 * turn), mesh=ROUND) for turn in (0, 1)]
    axes = history_figure(solve_history(turns, degree=3), Units("mm", "MPa")).axes[-2]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("rotation [rad]", "moment [N mm/mm]")
    grown = [[Displacement("hole", normal=w, tangential=0.0), Displacement("outside", x=0.0, y=0.0)] for w in (1, 2)]
    history = solve_history([ContactProblem(ROUND, Material(1000.0, 0.3), sides) for sides in grown], degree=3)
    assert np.prod(history.loop("hole"), axis=0) == pytest.approx([step.energies.load for step in history.steps])
    # a component of its motion in one step, and the rest of the hole in the other, are no path
    pin = Contact.pin("hole", 0.3, (0.0, 0.0), 1.02, x=0.01)
    history = solve_history([pinned(pin, mesh=ROUND), pinned(replace(pin, plate=None), mesh=ROUND)], degree=3)
    with pytest.raises(InputError, match="some steps"):
        history.loop("hole")


def test_only_what_is_round_may_slip_round():
    """A solve that ends too early says so of a pin that a moment turns, and of a shaft, not of a straight plate."""
    pin = pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 1.02, x=0.0, y=0.0, moment=1e-3), mesh=ROUND)
    free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    plate = Contact("top", 0.3, plate=RigidPlate(force_x=0.1, force_y=-1.0, moment=0.0, pivot=(0.5, 1.0)))
    block = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1.0, 0.3), [Contact("bottom", 0.3), plate, *free])
    for problem, said in ((pin, True), (press_fit_torque(0.2, 1.0), True), (block, False)):
        result = solve(problem, method="condensed", max_iterations=1)
        assert any("slip round" in remark for remark in result.remarks) == said


class TestWhatIsNotDetermined:
    """Motions that nothing resists are named with the place and what to do; stresses are what they are."""

    def test_a_pin_without_force(self):
        result = solved(pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=0.0, force_y=0.0, moment=0.0)))
        (loose,) = result.undetermined_motions
        assert (loose.names, loose.motions, loose.plate) == (("the plate at 'hole'",), 3, True)
        assert any("the plate at 'hole'" in remark and "give the motion" in remark for remark in result.remarks)
        pin = Contact.pin("hole", 0.0, (0.0, 0.0), 0.99, force_x=0.3, force_y=0.0, moment=0.0)
        (loose,) = solved(pinned(pin, mesh=ROUND)).undetermined_motions
        assert (loose.motions, loose.way) == (1, "turn about (0, 0)")

    def test_equilibrium_that_gives_the_force(self):
        """Nothing but the pin holds the sheet: its force is that of the loads, or contradicts them."""
        pull = Traction("outside", x=lambda x, _: 0.01 + 0.0 * x, y=0.0)
        mesh_length = SHEET.boundary.length[~SHEET.hole_edges].sum()
        pin = Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=-0.01 * mesh_length, y=0.0, rotation=0.0)
        result = solved(pinned(pin, pull))
        assert any("already determines force_x" in remark for remark in result.remarks)
        with pytest.raises(InputError, match="equilibrium of 'hole'"):
            solved(pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=1.0, y=0.0, rotation=0.0), pull))


TWO_HOLES = (
    holed(2, [(0.0, 0.0), (2.0, 0.0)], (-1.5, -1.5), (3.5, 1.5))
    .with_edges("hole", lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 0.6)
    .with_edges("outside", lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 0.6)
)


class TestWhereAPinIs:
    """A centre that is not in the hole is named; one that is, or beside a body that it touches from outside, is not."""

    @staticmethod
    def misplaced(mesh, edges, contact):
        other = "outside" if edges == "hole" else "hole"
        problem = ContactProblem(mesh, UNIT, [contact, Displacement(other, x=0.0, y=0.0)])
        return [pin.name for pin in pins(problem) if pin.misplaced] == [edges]

    @pytest.mark.parametrize(
        ("mesh", "edges", "inside", "beyond"),
        [(SHEET, "hole", [(0.0, 0.0), (0.9, 0.1), (-0.3, -0.8)], [(1.01, 0.0), (2.0, 1.0), (5.0, 0.0)]),
         (ROUND, "hole", [(0.0, 0.0), (0.7, -0.7)], [(0.72, 0.72), (0.0, 1.5), (-7.0, 1.0)]),
         (ROUND, "outside", [(3.0, 0.0), (-4.0, 5.0)], [(1.9, 0.0), (0.3, 1.5)]),
         (TWO_HOLES, "hole", [(0.0, 0.0), (0.49, 0.49)], [(2.0, 0.0), (1.0, 1.0), (0.51, 0.51), (0.0, -2.0)])],
    )  # fmt: skip
    def test_centres(self, mesh, edges, inside, beyond):
        all_pins = {centre: Contact.pin(edges, 0.3, centre, 0.4, x=0.0) for centre in (*inside, *beyond)}
        assert [centre for centre, pin in all_pins.items() if self.misplaced(mesh, edges, pin)] == beyond

    def test_the_result_says_so(self):
        for at, said in ((0.0, 0), (1.9, 1)):
            result = solved(pinned(Contact.pin("hole", 0.3, (at, 0.0), 0.8, x=0.0), mesh=ROUND), degree=3)
            assert sum("not in its hole" in remark and "(1.9, 0)" in remark for remark in result.remarks) == said
        # a plate whose gap is another is no pin, wherever its pivot lies
        plate = Contact("outside", 0.3, gap=0.1, plate=RigidPlate(x=0.1, pivot=(0.0, 1.5)))
        assert not self.misplaced(SMALL, "outside", plate)
        for centre, radius in (((0.0, 0.0), 0.0), ((0.0, np.inf), 1.0), ((0.0, 0.0), -1.0)):
            with pytest.raises(InputError):
                disc_gap(centre, radius)


class TestPressFits:
    """A pin larger than its bore is said to be one, by the difference of the radii."""

    @staticmethod
    def pressed(problem):
        return {pin.name: pin.interference for pin in pins(problem) if pin.interference}

    @pytest.mark.parametrize("mesh", [SHEET, ROUND, SMALL])
    @given(excess=st.floats(-0.2, 0.2), off=st.floats(0.0, 0.9))
    def test_interference(self, mesh, excess, off):
        """Of chords and arcs, wherever the centre is off by less than the interference; sharper than rounding."""
        assume(abs(excess) > 1e-6)
        bore = np.hypot(*mesh.vertices[mesh.pairs("hole")[0, 0]])
        centre = (0.6 * off * abs(excess), -0.8 * off * abs(excess))
        found = self.pressed(pinned(Contact.pin("hole", 0.3, centre, bore + excess, x=0.0), mesh=mesh))
        expected = (
            {"hole": pytest.approx(excess, abs=1e-12 + 0.5 * np.hypot(*centre) ** 2 / bore)} if excess > 0.0 else {}
        )
        assert found == expected

    def test_what_is_no_press_fit(self):
        """A pin that fits, one that overlaps on one side only, one in a bearing, and plates with an interference."""
        assert self.pressed(pinned(Contact.pin("hole", 0.3, (0.0, 0.0), 1.0, x=0.0))) == {}
        assert self.pressed(pinned(Contact.pin("hole", 0.3, (0.3, 0.0), 0.9, x=0.0))) == {}
        lying = bearing(0.0)
        larger = Contact.pin("inner", 0.3, (0.0, 0.0), 1.01, x=0.0)
        assert self.pressed(replace(lying, conditions=[larger, *lying.conditions[1:]])) == {}
        assert self.pressed(pinned(Contact("hole", 0.3, gap=lambda x, y: -0.1 - 0.01 * x * y))) == {}


def test_a_clearance_far_larger_than_the_displacements_is_told_with_what_to_do_and_that_helps():
    """The pin is inaccurate by rounding."""
    pin = Contact.pin("hole", 0.3, (0.0, 0.0), 0.99, force_x=1e-9, y=0.0, rotation=0.0)
    result = solve(pinned(pin, mesh=ROUND), tolerance=1e-8, degree=3)
    assert result.status is Status.INACCURATE
    (told,) = (remark for remark in result.remarks if "times the displacements" in remark)
    again = solve(result.problem, tolerance=float(re.findall(r"tolerance of (1e-\d+)", told)[0]), degree=3)
    assert again.status is Status.SOLVED
    assert not any("times the displacements" in remark for remark in again.remarks)


def bearing(moment):
    """A pin on an arc of ±60°, pressed down by 0.01 and twisted by a moment in units of that."""
    angles = np.deg2rad(np.linspace(210.0, 330.0, 9))
    mesh = fan([arc(radius, angles) for radius in (1.0, 1.3, 1.7)], closed=False, arcs=("inner", "outer"))
    pin = Contact.pin("inner", 0.3, (0.0, 0.0), 1.0, force_x=0.0, force_y=-0.01, moment=0.01 * moment)
    free = [Traction(side, x=0.0, y=0.0) for side in ("start", "end")]
    return ContactProblem(mesh, UNIT, [pin, Displacement("outer", x=0.0, y=0.0), *free])


class TestMomentsThatFrictionDoesNotCarry:
    """A mechanism proves it where the pin can leave; in a closed hole there is none, and a remark says what to do."""

    def test_a_pin_that_climbs_out_of_its_bearing(self):
        """Forces at both ends of the arc, tangent to the circle r sin δ of friction: M = r F sin δ cos δ/cos β."""
        most = 0.3 / (1.0 + 0.3**2) / np.cos(np.pi / 3.0)
        assert find_mechanism(bearing(0.998 * most)) is None
        proof = find_mechanism(bearing(1.002 * most))
        assert proof.overload > 1.0
        assert proof.contacts["inner"].slides

    def test_a_pin_that_slips_round_in_its_hole(self):
        """Pressure on all sides of it holds any moment in equilibrium; its rotation shows what friction carries."""
        pin, drive = partial(Contact.pin, "hole", 0.3, (0.0, 0.0), 0.99, force_x=0.1, force_y=0.0), "its moment"
        problems = [pinned(pin(rotation=turn), mesh=ROUND) for turn in (0.1, 1.0)]
        results = [solved(problem, degree=3) for problem in problems]
        turned = [result.plate_force("hole").moment for result in results]
        assert turned[1] == pytest.approx(turned[0], rel=1e-9)
        lines = (result_figure(result).axes[0].lines for result in results)  # both pins are drawn as the same circle
        drawn = [next(line.get_xydata() for line in each if line.get_color() == "black") for each in lines]
        assert drawn[1] == pytest.approx(drawn[0], abs=1e-6)
        less, more = (pinned(pin(moment=part * turned[0]), mesh=ROUND) for part in (0.95, 1.05))
        below, above = solve(less, degree=3), solve(more, degree=3, iterations=20)
        assert below.status is Status.SOLVED
        assert not any(drive in remark for remark in below.remarks)
        assert above.status is not Status.SOLVED
        assert not above.certificate.passed
        assert find_mechanism(above.problem) is None
        assert sum(drive in remark and "rotation" in remark for remark in above.remarks) == 1
