"""The same body in other units, mirrored, turned, moved, or described in another order: the same answer."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, solve
from qvi_contact.gallery import compressed_plate
from solvers import Status

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # grids mirrored and turned have the same cells, unlike triangles

WIDTH, HEIGHT, CELLS, GRADING, FRICTION = 1.5, 1.0, (4, 3), 0.8, 0.12


def plate(material, lines, sides, displacement=1e-3):
    """The compressed plate on other grid lines; sides name (symmetry, symmetry, free, contact)."""
    first, second, free, contact = sides
    conditions = [
        Contact(contact, friction=FRICTION, gap=-displacement, name="plate"),
        Traction(free, x=0.0, y=0.0),
        Symmetry(second),
        Symmetry(first),
    ]
    return ContactProblem(RectilinearMesh(*lines), material, conditions)


@pytest.fixture(scope="module")
def original():
    result = solve(compressed_plate(FRICTION, CELLS, WIDTH, HEIGHT, grading=GRADING))
    assert result.status is Status.SOLVED
    return result


@pytest.fixture(scope="module")
def lines(original):
    return original.problem.mesh.x, original.problem.mesh.y


def samples(lines):
    points = np.random.default_rng(3).uniform(0.02, 0.98, size=(2, 40))
    return points[0] * lines[0][-1], points[1] * lines[1][-1]


def assert_same(original, other, place, turn, order=slice(None), tangent=1.0):
    """Compare stresses at mapped points and everything on the contact."""
    x, y = samples((original.problem.mesh.x, original.problem.mesh.y))
    expected = original.stress(x, y)
    assert other.status is Status.SOLVED
    assert turn(other.stress(*place(x, y))) == pytest.approx(expected, abs=1e-7 * 209)
    ours, theirs = original.contacts["plate"], other.contacts["plate"]
    assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-9)
    assert theirs.normal_stress[order] == pytest.approx(ours.normal_stress, abs=1e-7 * 209)
    assert tangent * theirs.tangential_stress[order] == pytest.approx(ours.tangential_stress, abs=1e-7 * 209)
    assert tangent * theirs.slip[order] == pytest.approx(ours.slip, abs=1e-7 * 1e-3)
    assert (theirs.state[order] == ours.state).all()


def test_mirror_image(original, lines):
    mirrored = plate(Material(2.09e5, 0.3), (-lines[0][::-1], lines[1]), ("right", "bottom", "left", "top"))

    def turn(stress):
        return stress * [1, 1, -1]

    assert_same(original, solve(mirrored), lambda x, y: (-x, y), turn, order=slice(None, None, -1), tangent=-1.0)


def test_upside_down(original, lines):
    turned = plate(Material(2.09e5, 0.3), (lines[0], -lines[1][::-1]), ("left", "top", "right", "bottom"))
    assert_same(original, solve(turned), lambda x, y: (x, -y), lambda stress: stress * [1, 1, -1])


def test_quarter_turn(original, lines):
    """(x, y) → (−y, x): the plate then touches the side x = −height, its tangent +x turned to +y."""
    turned = plate(Material(2.09e5, 0.3), (-lines[1][::-1], lines[0]), ("bottom", "right", "top", "left"))
    assert_same(original, solve(turned), lambda x, y: (-y, x), lambda stress: stress[..., [1, 0, 2]] * [1, 1, -1])


def test_far_from_the_origin(original, lines):
    moved = plate(Material(2.09e5, 0.3), (lines[0] + 1e3, lines[1] - 1e3), ("left", "bottom", "right", "top"))
    assert_same(original, solve(moved), lambda x, y: (x + 1e3, y - 1e3), lambda stress: stress)


def test_other_units(original, lines):
    """Metres to millimetres and MPa to Pa."""
    other = plate(
        Material(2.09e11, 0.3),
        (1e3 * lines[0], 1e3 * lines[1]),
        ("left", "bottom", "right", "top"),
        displacement=1.0,
    )
    result = solve(other)
    x, y = samples(lines)
    assert result.status is Status.SOLVED
    assert result.stress(1e3 * x, 1e3 * y) / 1e6 == pytest.approx(original.stress(x, y), abs=1e-7 * 209)
    ours, theirs = original.contacts["plate"], result.contacts["plate"]
    assert theirs.normal_force / 1e9 == pytest.approx(ours.normal_force, rel=1e-9)
    assert theirs.slip / 1e3 == pytest.approx(ours.slip, abs=1e-10)
    assert (theirs.state == ours.state).all()


@pytest.mark.parametrize("size", [1e-6, 1e6])
def test_proportional_load_keeps_the_pattern(original, size):
    """Static Coulomb friction is positively homogeneous: twice the load, twice the answer."""
    result = solve(compressed_plate(FRICTION, CELLS, WIDTH, HEIGHT, grading=GRADING, displacement=size * 1e-3))
    ours, theirs = original.contacts["plate"], result.contacts["plate"]
    assert result.status is Status.SOLVED
    assert theirs.normal_stress / size == pytest.approx(ours.normal_stress, abs=1e-7 * 209)
    assert (theirs.state == ours.state).all()


def test_rigid_translation_of_body_and_obstacles():
    """Supports and obstacle moved together by much more than the deformation."""
    from qvi_contact import Displacement

    def problem(shift):
        conditions = [
            Displacement("left", x=shift),
            Traction("left", y=0.0),
            Displacement("bottom", y=shift),
            Traction("bottom", x=0.0),
            Traction("right", x=0.0, y=0.0),
            Contact("top", friction=0.2, gap=shift - 1e-3, offset=shift),
        ]
        return ContactProblem(RectilinearMesh.rectangle((3, 3)), Material(2.09e5, 0.3), conditions)

    still, moved = solve(problem(0.0)), solve(problem(0.5))
    assert moved.status is Status.SOLVED
    assert moved.contacts["top"].normal_stress == pytest.approx(still.contacts["top"].normal_stress, abs=1e-5)
    assert moved.contacts["top"].slip == pytest.approx(still.contacts["top"].slip, abs=1e-9)
