"""Contact in the displacement model: admissible on whole edges, energies from above, values of other codes."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, solve
from qvi_contact.companion import DualProblem, solve_companion
from qvi_contact.gallery import compressed_plate, exact
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from solvers import Status
from tests.cases import every_pair, refused_at
from tests.qvi_contact.builders import bernstein, companion_of
from tests.qvi_contact.test_plates import moved

STEEL = Material(1000.0, 0.3)
MESH = TriangleMesh.grid([0.0, 0.3, 0.8, 1.5, 2.0], [0.0, 0.4, 0.7, 1.0])
INSIDE = np.linspace(0.0, 1.0, 101)
FREE = [Traction(side, 0.0, 0.0) for side in ("left", "right")]


def plate(contact, cells=(4, 4), **options):
    """The compressed plate with another contact on its top."""
    problem = compressed_plate(0.0, cells, **options)
    return replace(problem, conditions=[*problem.conditions[:3], contact])


@pytest.mark.parametrize("law", ["unilateral", "bilateral", "tied"])
def test_a_rough_solution_becomes_admissible(law, monkeypatch):
    """Contact displacements 1e-9 off are moved back to the obstacle before the energy is computed."""
    exact_values, noise = DualProblem.displacements, np.random.default_rng(0)

    def rough(self, solution):
        values = exact_values(self, solution)
        return values + 1e-9 * noise.normal(size=len(values))

    problem = plate(Contact("top", 0.0 if law == "tied" else 1.0, -1e-3, law=law, name="plate"))
    best = companion_of(problem)
    monkeypatch.setattr(DualProblem, "displacements", rough)
    found = companion_of(problem)
    normal, tangential = found.trace("plate", INSIDE)
    line = best.contacts["plate"]
    assert (np.abs(line.tangential_stress) < line.friction_bound).all()  # all sticks, so that each has its place
    assert normal == pytest.approx(-1e-3, abs=1e-17)
    assert tangential == pytest.approx(0.0, abs=1e-17)
    assert found.reasons == best.reasons
    assert found.energy == pytest.approx(best.energy, rel=1e-8)


@pytest.mark.parametrize("force", [1.0, -1.0])
def test_a_force_on_a_plate_that_nothing_carries(force):
    pulled = [Contact("top", 0.0, law="tied", plate=RigidPlate(force_x=force)), Traction("bottom", 0.0, 0.0), *FREE]
    with pytest.raises(InputError, match="contradicts the other loads") as caught:
        solve_companion(ContactProblem(MESH, STEEL, pulled))
    assert caught.value.value * force > 0.0


def test_what_contradicts_the_obstacle_moves_nothing_far():
    """A support that is tilted by 1e-5 and moved, beside a tied side that does not move."""
    mesh = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
    mesh = replace(mesh, vertices=mesh.vertices + 1e-5 * mesh.vertices[:, ::-1])
    held = [Displacement("left", normal=-1e-3), Traction("left", tangential=0.0), Contact.tied("top")]
    companion = companion_of(ContactProblem(mesh, STEEL, [*held, FREE[1], Traction("bottom", 0.0, 0.0)]))
    assert "contradict" in companion.reasons[-1]
    assert abs(companion.energy) < 0.01


@pytest.mark.parametrize("degree", [2, 3])
def test_no_penetration_between_nodes(degree):
    """A curved obstacle, touched in its middle only: v_N ≤ g at 101 points of every edge, to rounding."""

    def gap(x, _):
        return -2e-3 + 6e-3 * (x - 0.9) ** 2

    problem = ContactProblem(MESH, STEEL, [Contact("top", 0.3, gap), Displacement("bottom", 0.0, 0.0), *FREE])
    companion = companion_of(problem, degree=degree)
    normal, _ = companion.trace("top", INSIDE)
    opening = gap(*problem.mesh.points_along(problem.mesh.edges("top"), INSIDE)) - normal
    assert opening.min() > -1e-15
    assert opening.max() > 1e-4
    line = companion.contacts["top"]
    pressed = line.normal_stress < 1e-6 * line.normal_stress.min()
    assert line.gap[pressed] == pytest.approx(0.0, abs=1e-15)
    assert line.gap[~pressed].max() > 1e-4


@pytest.mark.parametrize("bond", [2.0, 5.0])
def test_a_bond_slips_at_the_smaller_of_its_bounds(bond):
    """A layer of height 1 sheared by w slips by w − t/G, with t = min(c, 3) on its base."""
    sides = [kind for name in ("left", "right") for kind in (Displacement(name, y=0.0), Traction(name, x=0.0))]
    base = Contact("bottom", 0.0, cohesion=bond, shear_limit=3.0, law="bilateral", name="base")
    line = companion_of(ContactProblem(MESH, STEEL, [base, Displacement("top", 0.02, 0.0), *sides])).contacts["base"]
    assert line.tangential_stress == pytest.approx(-min(bond, 3.0), rel=1e-8)
    assert line.slip == pytest.approx(0.02 - min(bond, 3.0) * 2.6 / 1000.0, rel=1e-8)


def test_friction_where_slip_changes_sign():
    """The integral itself is in the energy, not the sum over coefficients that bounds it from above."""
    mesh = TriangleMesh.rectangle((3, 2), 2.0, 1.0)
    ground = Contact.tresca("bottom", 0.1, offset=lambda x, _: 1e-2 * (x - 0.9), name="ground")
    conditions = [ground, Displacement("top", 0.0, -1e-3), *FREE]
    s = np.tile([0.05, 0.1, 0.2], (3, 1))
    companion = companion_of(ContactProblem(mesh, STEEL, conditions), bounds={"ground": s})
    t = (np.arange(20000) + 0.5) / 20000
    x, _ = mesh.points_along(mesh.edges("bottom"), t)
    slip = np.abs(companion.trace("ground", t)[1] - 1e-2 * (x - 0.9))
    expected = float((slip * (s @ bernstein(2, t).T)).mean(axis=1).sum() * 2.0 / 3.0)
    line = companion.contacts["ground"]
    above = float(line.weights @ (line.friction_bound * np.abs(line.slip)))
    assert companion.parts["friction"] == pytest.approx(expected, rel=1e-7)
    assert above > 1.01 * expected


@pytest.mark.parametrize(("degree", "side"), [(2, "top"), (3, "right"), (4, "upright")])
def test_contacts_are_in_order_along_the_line(side, degree):
    """Arrays belong together: sums over them are forces; the obstacle's gap at the places is that of the array."""
    across, up = np.array([0.1, 0.4, 0.9, 1.2]), np.array([-0.3, 0.1, 0.2, 0.7])
    mesh = TriangleMesh.grid(across, up)
    mesh = mesh.with_joint("upright", lambda x, _: np.isclose(x, 0.4))
    horizontal = side == "top"
    conditions = [Displacement("bottom", 0.0, 0.0), Traction("left", 0.0, 0.0)]
    conditions += [Traction(other, 0.0, 0.0) for other in ("right", "top") if other != side]
    conditions += [Contact(side, 0.0, gap=lambda x, y: 1.0 + x + 2.0 * y, cohesion=1.0, name="line")]
    conditions += [Contact.tied("upright")] if side != "upright" else []
    line = companion_of(ContactProblem(mesh, STEEL, conditions), degree=degree).contacts["line"]
    along, lines = (line.x, across) if horizontal else (line.y, up)
    steps = (lines[:-1, None] + np.diff(lines)[:, None] * np.arange(degree + 1) / degree).ravel()
    assert (np.diff(along) >= -1e-12).all()
    assert np.unique(np.round(along, 9)) == pytest.approx(np.unique(np.round(steps, 9)))
    assert line.gap == pytest.approx(1.0 + line.x + 2.0 * line.y, rel=1e-9)


def block(shear, friction=0.3):
    """A block under pressure 5, dragged along by a uniform shear on its top, by a plate of no mass."""
    mesh = TriangleMesh.rectangle((6, 3), 2.0, 1.0)
    sides = [Traction(side, 0.0, lambda x, _, y=y: y + 0 * x) for side, y in (("left", -shear), ("right", shear))]
    sides += [Contact("bottom", friction, name="ground"), Traction("top", shear, -5.0)]
    return ContactProblem(mesh, STEEL, sides)


def test_friction_carries_a_dragged_block_exactly_up_to_its_bound():
    ground = companion_of(block(1.499)).contacts["ground"]
    assert ground.normal_force == pytest.approx(10.0, rel=1e-9)
    assert ground.tangential_force == pytest.approx(-2.998, rel=1e-9)
    companion = solve_companion(block(1.501))
    assert companion.status is Status.INFEASIBLE
    assert not companion.has_state
    assert "reduce" in companion.status.advice
    for use in (lambda: companion.energy, lambda: companion.contacts, lambda: companion.stress(0.5, 0.5)):
        with pytest.raises(InputError, match="infeasible"):
            use()


DRIVEN = RigidPlate(force_x=0.5, force_y=-8.0, moment=-5.0, pivot=(0.7, -0.3))
GUIDED = RigidPlate(force_y=-8.0, moment=-5.0, pivot=(0.7, -0.3))  # turns about its pivot, far below the contact


@pytest.mark.parametrize("plate", [DRIVEN, GUIDED], ids=["free", "guided"])
@pytest.mark.parametrize("law", [{"friction": 0.4}, {"friction": 0.0, "law": "tied"}])
def test_a_plate_that_forces_drive_is_the_motion_imposed_instead(law, plate):
    ground, contact = [Contact.tied("bottom", name="ground"), *FREE], Contact("top", name="plate", **law)
    driven = companion_of(ContactProblem(MESH, STEEL, [*ground, replace(contact, plate=plate)]))
    line, motion = driven.contacts["plate"], driven.plates["plate"]
    force_x, force_y = line.weights * line.tangential_stress, line.weights * line.normal_stress
    assert plate.force_x is None or force_x.sum() == pytest.approx(0.5, rel=1e-9)
    assert plate.force_x is not None or motion.x == 0.0
    assert force_y.sum() == pytest.approx(-8.0, rel=1e-9)
    moment = (line.x - 0.7) @ force_y - (line.y + 0.3) @ force_x
    assert moment == pytest.approx(-5.0, rel=1e-9)
    imposed = moved(contact, motion.x, motion.y, motion.rotation, (0.7, -0.3))
    held = companion_of(ContactProblem(MESH, STEEL, [*ground, imposed]))
    x, y = np.random.default_rng(3).uniform(size=(2, 50)) * [[2.0], [1.0]]
    assert held.stress(x, y) == pytest.approx(driven.stress(x, y), abs=1e-7 * 8)
    work = (plate.force_x or 0.0) * motion.x - 8.0 * motion.y - 5.0 * motion.rotation
    assert driven.energy == pytest.approx(held.energy - work, rel=1e-8)
    assert driven.parts["load"] == pytest.approx(work, rel=1e-12)


def test_contradictions_are_named():
    """The right side keeps a distance that the ground below it does not let it have."""
    for gap, told in ((1e-4, True), (0.0, False)):
        beside = Contact("top", 0.3, gap=-1e-3), Symmetry("left"), Contact.tied("bottom")
        problem = ContactProblem(MESH, STEEL, [Contact("right", 0.2, gap=gap, law="bilateral"), *beside])
        assert any("contradict the obstacle" in reason for reason in companion_of(problem).reasons) is told


def test_weight_on_both_sides_of_a_joint():
    """A column under its own weight, cut and tied again: the exact state, whose potential acts on both faces."""
    state = exact.gravity_column(STEEL, 4.0, 0.5)
    uncut = TriangleMesh.grid([0.0, 0.5, 2.0], [-0.5, -0.1, 0.5])
    mesh = uncut.with_joint("cut", lambda _, y: np.isclose(y, -0.1))
    sides = {"bottom": "uu", "right": "tt", "top": "tt", "left": "tt"}
    whole = exact.problem_from_state(state, uncut, STEEL, sides)
    problem = replace(whole, mesh=mesh, conditions=[*whole.conditions, Contact.tied("cut")])
    companion = companion_of(problem)
    assert companion.displacement(0.7, 0.3) == pytest.approx(state.displacement(0.7, 0.3), abs=1e-14)
    assert companion.contacts["cut"].normal_force == pytest.approx(4.0 * 0.6 * 2.0, rel=1e-10)


PLATE = compressed_plate(0.1, (3, 2))


def joined(contact, top=None):
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0], [0.0, 0.4, 1.0])
    return ContactProblem(mesh, STEEL, [contact, top or Traction("top", 0.0, -1.0), *FREE])


def test_bad_input_is_refused():
    """Options, problems and names, and loads out of balance."""
    wrong = {"degree": [0, 6, 2.5, "2", True, np.array([2, 3])], "tolerance": [0.0, 1.0, -1e-8, "small", None, True]}
    for name, values in wrong.items():
        for value in values:
            with refused_at(name):
                solve_companion(PLATE, **{name: value})
    with refused_at("problem"):
        solve_companion("plate")
    with pytest.raises(InputError, match="plate"):
        solve_companion(PLATE).trace("roof", [0.5])
    conditions = [Traction("top", 0.0, -1.0), Traction("bottom", 0.0, 0.9), *FREE]
    with pytest.raises(InputError, match="balance"):
        solve_companion(ContactProblem(TriangleMesh.rectangle((2, 2)), STEEL, conditions))


def bonded(kind, field):
    """A field that is the gap or the offset of a bond, or the support of its top."""
    if kind == "support":
        return joined(Contact("bottom", 0.0, cohesion=0.1), Displacement("top", 0.0, field))
    return joined(Contact("bottom", 0.0, cohesion=0.1, **{kind: field}))


PEAK = 0.2548  # on an edge from 0 to 0.5: away from all points of quadrature, 4e-4 from a sample


def peak(x, middle, width):
    return np.exp(-(((x - middle) / width) ** 2))


class TestReasons:
    """Data that polynomials do not meet are named; what they meet is not."""

    def test_coulomb_has_a_moving_bound(self):
        companion = solve_companion(PLATE)
        assert (len(companion.reasons), companion.degree) == (1, 3)
        assert companion_of(PLATE, {"plate": np.ones((3, 3))}).reasons == ()

    @pytest.mark.parametrize(("kind", "power", "degree"), every_pair(["gap", "offset", "support"], [2, 3, 5], [2, 3]))
    def test_degree_of_the_data(self, kind, degree, power):
        def field(x, y):
            return -0.1 + 1e-3 * (x**power + 0 * y)

        reasons = solve_companion(bonded(kind, field), degree=degree).reasons
        assert bool(reasons) == (power > degree)
        assert all("interpolated" in reason for reason in reasons)

    @pytest.mark.parametrize(
        ("load", "force"),
        [(lambda x: 1.0 + x**19, 1.05), (np.sqrt, 2.0 / 3.0), (lambda x: np.where(x < 0.123, 2.0, 0.0), 0.246),
         (lambda x: peak(x, PEAK, 5e-4), 5e-4 * np.sqrt(np.pi))], ids=["polynomial", "root", "step", "peak"],
    )  # fmt: skip
    def test_loads_are_integrated(self, load, force):
        problem = joined(Contact.frictionless("bottom"), Traction("top", 0.0, lambda x, y: -load(x) + 0 * y))
        companion = solve_companion(problem)
        assert companion.reasons == ()
        assert companion.contacts["bottom"].normal_force == pytest.approx(force, rel=1e-9)

    def test_friction_bounds_are_integrated(self):
        """∫ c ds of a cohesion that jumps inside an edge."""
        cohesive = Contact("bottom", 0.0, cohesion=lambda x, _: np.where(x < 0.123, 2.0, 0.5))
        companion = solve_companion(joined(cohesive))
        assert companion.reasons == ()
        line = companion.contacts["bottom"]
        assert line.weights @ line.friction_bound == pytest.approx(0.246 + 0.4385, rel=1e-12)

    def test_loads_that_no_quadrature_integrates(self):
        def wave(x, y):
            return 2.0 + np.sin(1e6 * x) + 0 * y

        smooth, rough = Contact.frictionless("bottom"), Contact("bottom", 0.0, cohesion=wave)
        for problem, told in (
            (joined(smooth, Traction("top", 0.0, lambda x, y: -wave(x, y))), "Traction.y"),
            (joined(rough), "The cohesion of 'bottom'"),
            (replace(joined(smooth), body_potential=lambda x, _: 0.1 * np.sin(29.0 * x)), "Loads are not polynomials"),
        ):
            (reason,) = solve_companion(problem).reasons
            assert reason.startswith(told)

    @pytest.mark.parametrize("kind", ["gap", "offset", "support"])
    def test_peaks_between_nodes_and_quadrature(self, kind):
        """Half a percent of an edge wide, away from all points of the rules; none on the edge beside it."""

        def field(x, y):
            return -0.1 - 1e-3 * peak(x, PEAK, 5e-4) + 0 * y

        what = "Displacement.y" if kind == "support" else f"The {kind} of 'bottom'"
        (reason,) = solve_companion(bonded(kind, field)).reasons
        assert reason.startswith(what)

    def test_friction_between_coefficients(self):
        """μ > 0 somewhere is Coulomb's law, even where no coefficient has it."""
        problem = joined(Contact("bottom", lambda x, y: 0.3 * ((x > 0.3) & (x < 0.45)) + 0 * y, cohesion=0.1))
        assert any("own contact forces" in reason for reason in solve_companion(problem).reasons)
        problem = joined(Contact("bottom", lambda x, y: 0 * x * y, cohesion=0.1))
        assert solve_companion(problem).reasons == ()


@pytest.mark.parametrize(("law", "cohesion"), [("tied", 0.0), ("bilateral", 9.0), ("unilateral", 0.0)])
def test_a_plate_that_ends_where_a_support_holds_the_corner(law, cohesion):
    """Simple shear turns a plate that sticks about the corner; without friction one stays while a body is squeezed."""
    shear, squeeze = (0.0, 2e-3) if law == "unilateral" else (3e-3, 0.0)
    material = Material(1000.0, 0.3, "strain")
    along, across, up = 1000.0 / 1.3 * np.array([0.5 * shear, -0.75 * squeeze, -1.75 * squeeze])  # σ_xy, σ_xx, σ_yy
    force = RigidPlate(force_x=across, force_y=along if shear else None, moment=0.0, pivot=(1.0, 0.5))
    conditions = [Contact("right", 0.0, law=law, plate=force, cohesion=cohesion)]
    conditions += [Displacement("bottom", 0.0, 0.0), Traction("top", x=along, y=up)]
    conditions += [Traction("left", x=-across, y=-along)]
    found = companion_of(ContactProblem(TriangleMesh.rectangle((2, 2)), material, conditions), degree=2)
    x, y = np.random.default_rng(4).uniform(size=(2, 20))
    assert found.reasons == ()
    assert found.displacement(x, y) == pytest.approx(np.column_stack([shear * y, -squeeze * y]), abs=1e-11)
    assert found.plates["right"].rotation == pytest.approx(-shear, abs=1e-11)


def test_a_wall_that_ends_at_a_tied_plate():
    """The least J(v) of these displacements is that of a quadratic program."""
    cap = Contact("top", 0.0, law="tied", plate=RigidPlate(force_x=-1.0, force_y=-1.0))
    conditions = [cap, Contact("left", 0.0), Symmetry("bottom"), Traction("right", 0.0, 0.0)]
    problem = ContactProblem(TriangleMesh.rectangle((8, 8)), Material(1000.0, 0.3, "strain"), conditions)
    assert companion_of(problem, degree=3).energy == pytest.approx(-4.325e-4, rel=1e-3)


def test_friction_where_joints_cross():
    """In a slope whose blocks slide it alone may hold some on coarse meshes; the bound is near."""
    bracket = solve(exact.jointed_slope()).bracket
    assert bracket.lower <= bracket.upper <= bracket.lower + 0.01 * bracket.strain


def test_an_obstacle_that_a_slender_body_reaches_from_far_away():
    """More than ten thousand units of displacement are in the way."""
    mesh, base = TriangleMesh.rectangle((12, 1), 20.0, 0.5), Contact("bottom", 0.0, gap=5.0)
    conditions = [Displacement("left", 0.0, 0.0), Traction("top", 0.0, -0.02), FREE[1], base]
    bracket = solve(ContactProblem(mesh, STEEL, conditions)).bracket
    assert bracket.guaranteed
    assert bracket.lower <= bracket.upper <= bracket.lower + 0.03 * bracket.strain
