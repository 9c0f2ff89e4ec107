"""The displacement model on triangles: slanted edges, supports, contacts and joints, and orders of convergence."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Region, RigidPlate, Symmetry, Traction, exact
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate, sliding_block
from qvi_contact.mesh import TriangleMesh
from solvers import Status
from tests.cases import every_pair
from tests.qvi_contact.test_triangles import FOAM, SIDES, STATES, STEEL, inside, moved, squeezed, tilted, turned

LEAST = {"compression": 1, "shear": 1, "bending": 2, "cantilever": 3, "column": 2}  # degrees that hold the states
ANGLE = 30.0


def companion_of(problem, **options):
    """A companion that must be solved."""
    found = solve_companion(problem, **options)
    assert found.status is Status.SOLVED, found.message
    return found


def oblique(mesh, angle=ANGLE):
    return TriangleMesh(turned(mesh.vertices, angle), mesh.cells, mesh.edge_sets, mesh.regions)


def assert_is(companion, state):
    """Stress and displacement of the state at points of the body."""
    x, y = inside(companion.problem.mesh)
    stress, displacement = (np.moveaxis(part(x, y), 0, -1) for part in (state.stress, state.displacement))
    assert np.abs(companion.stress(x, y) - stress).max() < 1e-10 * np.abs(stress).max()
    assert np.abs(companion.displacement(x, y) - displacement).max() < 1e-10 * np.abs(displacement).max()


@pytest.mark.parametrize(("state", "sides", "more"), every_pair(list(STATES), ["held below", "mixed"], [0, 2]))
def test_states_the_elements_contain(state, sides, more):
    mesh = moved(TriangleMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5)))
    names = dict(zip(("bottom", "right", "top", "left"), SIDES[sides], strict=True))
    exactly = STATES[state][1](STEEL)
    companion = companion_of(exact.problem_from_state(exactly, mesh, STEEL, names), degree=LEAST[state] + more)
    assert companion.reasons == ()
    assert_is(companion, exactly)


def smooth(mesh):
    """A problem whose displacement (eˣ cos y, −eˣ sin y) no element holds, prescribed all around."""
    parts = {"x": lambda x, y: 1e-3 * np.exp(x) * np.cos(y), "y": lambda x, y: -1e-3 * np.exp(x) * np.sin(y)}
    return ContactProblem(mesh, STEEL, [Displacement(side, **parts) for side in mesh.edge_names])


@pytest.mark.parametrize("degree", [1, 3, 4, 5])
def test_orders(degree):
    """Stresses converge as h^p."""
    errors = []
    for cells in (2, 4):
        companion = companion_of(smooth(moved(TriangleMesh.rectangle((cells, cells)), amount=0.1)), degree=degree)
        x, y = inside(companion.problem.mesh, 300)
        along, across = 1e-3 * np.exp(x) * np.cos(y), -1e-3 * np.exp(x) * np.sin(y)
        expected = 1000.0 / 1.3 * np.stack([along, -along, across], axis=-1)
        errors.append(np.sqrt(np.square(companion.stress(x, y) - expected).mean()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(degree, abs=0.5)


def test_turned_as_a_whole():
    """Fields turn with the body, forces on the plate stay."""
    problem = compressed_plate(0.2, (3, 3))
    straight = companion_of(problem, degree=3)
    slanted = companion_of(replace(problem, mesh=oblique(problem.mesh)), degree=3)
    points = np.column_stack(inside(problem.mesh))
    found, expected = slanted.displacement(*turned(points, ANGLE).T), turned(straight.displacement(*points.T), ANGLE)
    assert found == pytest.approx(expected, abs=1e-9 * 1e-3)
    assert slanted.energy == pytest.approx(straight.energy, rel=1e-11)
    for force in ("normal_force", "tangential_force"):
        expected = getattr(straight.contacts["plate"], force)
        assert getattr(slanted.contacts["plate"], force) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("slope", [0.3, -0.4])
def test_a_closed_slanted_joint_is_not_there(slope):
    problem = squeezed(tilted(slope), 0.5)
    companion = companion_of(problem, degree=2, bounds={"joint": np.full((4, 3), 5.0)})
    x, y = inside(problem.mesh)
    assert companion.stress(x, y) == pytest.approx(np.tile([0.0, -10.0, 0.0], (len(x), 1)), abs=1e-9)
    line, share = companion.contacts["joint"], 1.0 / (1.0 + slope**2)
    assert line.normal_stress == pytest.approx(-10.0 * share, rel=1e-9)
    assert line.tangential_stress == pytest.approx(-10.0 * slope * share, rel=1e-9)
    assert line.gap == pytest.approx(0.0, abs=1e-12)
    assert companion.reasons == ()


def test_a_tied_slanted_joint_between_two_materials_is_not_there():
    problem = squeezed(tilted(0.3), None, regions=[Region(FOAM, name="lower")])
    tied = replace(problem, conditions=[*problem.conditions, Contact.tied("joint")])
    whole, cut = companion_of(problem, degree=3), companion_of(tied, degree=3)
    assert cut.unknowns > whole.unknowns
    assert cut.energy == pytest.approx(whole.energy, rel=1e-12)
    x, y = inside(problem.mesh)
    assert cut.stress(x, y) == pytest.approx(whole.stress(x, y), abs=1e-8)


def test_a_support_across_a_slanted_edge():
    """Uniform stress along the side that slides on it."""
    mesh = oblique(TriangleMesh.rectangle((2, 2)))
    conditions = [
        Symmetry("bottom"),
        Traction("top", normal=0.0, tangential=0.0),
        Traction("left", normal=3.0, tangential=0.0),
        Traction("right", normal=lambda x, _: 3.0 + 0.0 * x, tangential=0.0),
    ]
    companion = companion_of(ContactProblem(mesh, STEEL, conditions), degree=2)
    c, s = np.cos(np.radians(ANGLE)), np.sin(np.radians(ANGLE))
    x, y = inside(mesh)
    expected = np.tile(3.0 * np.array([c * c, s * s, s * c]), (len(x), 1))
    assert companion.stress(x, y) == pytest.approx(expected, abs=1e-10)
    along = turned(np.column_stack([np.linspace(0.0, 1.0, 5), np.zeros(5)]), ANGLE)
    assert companion.displacement(*along.T) @ [-s, c] == pytest.approx(0.0, abs=1e-17)


def held_in_a_corner(condition):
    """A triangle pressed into the corner between two slanted walls."""
    mesh = TriangleMesh([(0, -1), (1, 0.2), (-1.2, 0.3)], [(0, 1, 2)], {"walls": [(0, 1), (0, 2)], "top": [(1, 2)]})
    load = Traction("top", x=0.0, y=lambda _, y: -3.0 - y)
    return ContactProblem(mesh.refined().refined(), STEEL, [condition, load])


def test_a_corner_between_two_slanted_lines():
    """Walls that hold the normal component, as supports or as contacts that stay closed, are the same."""
    held = companion_of(held_in_a_corner(Symmetry("walls")), degree=4)
    pressed = companion_of(held_in_a_corner(Contact.frictionless("walls")), degree=4)
    walls = pressed.contacts["walls"]
    assert walls.gap == pytest.approx(0.0, abs=1e-15)
    assert walls.normal_stress.max() < 0.0
    assert pressed.energy == pytest.approx(held.energy, rel=1e-11)
    assert (walls.x**2 + (walls.y + 1.0) ** 2 < 1e-12).sum() == 2  # the corner counts once for each wall
    tip = companion_of(held_in_a_corner(Contact.tied("walls")), degree=4).displacement(0.0, -1.0)
    assert tip == pytest.approx(0.0, abs=1e-17)


def test_supports_in_three_directions_at_one_corner():
    """Data of one rigid motion agree; a fourth condition that does not is named."""
    mesh = TriangleMesh([(0, -1), (1, 0.2), (-1.2, 0.3)], [(0, 1, 2)], {"a": [(0, 1)], "b": [(0, 2)], "c": [(1, 2)]})
    moved_by, conditions = np.array([2e-3, -1e-3]), []
    for name in "abc":
        edges = mesh.edges(name)
        parts = [float((vectors @ moved_by)[0]) for vectors in (edges.normal, edges.tangent)]
        conditions.append(Displacement(name, normal=parts[0], tangential=parts[1]))
    problem = ContactProblem(mesh.refined(), STEEL, conditions)
    companion = companion_of(problem, degree=3)
    assert companion.reasons == ()
    assert companion.displacement(0.1, 0.0) == pytest.approx(moved_by, rel=1e-12)
    wrong = replace(problem, conditions=[*conditions[:2], replace(conditions[2], normal=5e-3)])
    (reason,) = companion_of(wrong, degree=3).reasons
    assert "disagree" in reason


def test_a_plate_driven_by_force_on_a_slanted_side():
    """It moves as far as it must be pushed for that force."""
    problem = compressed_plate(0.4, (2, 2))
    tilted_plate = replace(problem, mesh=oblique(problem.mesh))
    pushed = companion_of(tilted_plate, degree=3)
    line = pushed.contacts["plate"]
    inward = turned([[0.0, -1.0]], ANGLE)[0]
    shear = turned([[1.0, 0.0]], ANGLE)[0]
    force = line.normal_force * inward + line.tangential_force * shear
    contacts = {
        c: replace(c, gap=0.0, plate=RigidPlate(force_x=float(force[0]), force_y=float(force[1])))
        for c in tilted_plate.contacts
    }
    driven = replace(tilted_plate, conditions=[contacts.get(c, c) for c in tilted_plate.conditions])
    companion = companion_of(driven, degree=3)
    motion = companion.plates["plate"]
    assert (motion.x, motion.y) == pytest.approx(tuple(1e-3 * inward), abs=1e-9)
    assert companion.contacts["plate"].normal_force == pytest.approx(line.normal_force, rel=1e-8)


def test_full_slip_with_a_given_bound():
    problem, state = sliding_block((3, 2))
    problem = problem
    for columns in (1, 5):  # a constant, as a polynomial of any degree
        companion = companion_of(problem, bounds={"base": np.full((3, columns), 30.0)}, degree=2)
        assert companion.reasons == ()
        assert_is(companion, state)
