"""The same body in other units, mirrored, turned or moved: the same answer."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction
from qvi_contact.companion import solve_companion
from solvers import Status

WIDTH, HEIGHT = 1.5, 1.0
LINES = np.array([0.0, 0.5, 0.9, 1.2, 1.4, 1.5]), np.array([0.0, 0.4, 0.8, 1.0])


def plate(lines, sides, *, length=1.0, stress=1.0, degree=3, bounds=None):
    """The compressed plate; sides name (symmetry, symmetry, free, contact)."""
    first, second, free, contact = sides
    conditions = [
        Contact(contact, 0.12, gap=-1e-3 * length, name="plate"),
        Traction(free, 0.0, 0.0),
        Symmetry(second),
        Symmetry(first),
    ]
    mesh = RectilinearMesh(*(length * part for part in lines))
    problem = ContactProblem(mesh, Material(2.09e5 * stress, 0.3), conditions)
    companion = solve_companion(problem, degree=degree, bounds=bounds)
    assert companion.status is Status.SOLVED
    return companion


@pytest.fixture(scope="module")
def original():
    return plate(LINES, ("left", "bottom", "right", "top"))


def points():
    t = np.random.default_rng(3).uniform(0.02, 0.98, size=(2, 40))
    return t[0] * WIDTH, t[1] * HEIGHT


def assert_same(original, other, place, turn, *, order=slice(None), tangent=1.0):
    """Displacements at mapped points, and everything on the contact."""
    x, y = points()
    assert turn(other.displacement(*place(x, y))) == pytest.approx(original.displacement(x, y), abs=1e-7 * 1e-3)
    ours, theirs = original.contacts["plate"], other.contacts["plate"]
    assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-9)
    assert tangent * theirs.tangential_force == pytest.approx(ours.tangential_force, rel=1e-7)
    assert other.energy == pytest.approx(original.energy, rel=1e-9)
    arranged = np.argsort(theirs.x + theirs.y)[order]
    assert (theirs.state[arranged] == ours.state[np.argsort(ours.x + ours.y)]).all()


def test_mirror_image(original):
    other = plate((-LINES[0][::-1], LINES[1]), ("right", "bottom", "left", "top"))
    backwards = slice(None, None, -1)
    assert_same(original, other, lambda x, y: (-x, y), lambda u: u * [-1, 1], order=backwards, tangent=-1.0)


def test_upside_down(original):
    other = plate((LINES[0], -LINES[1][::-1]), ("left", "top", "right", "bottom"))
    assert_same(original, other, lambda x, y: (x, -y), lambda u: u * [1, -1])


def test_quarter_turn(original):
    """(x, y) → (−y, x)."""
    other = plate((-LINES[1][::-1], LINES[0]), ("bottom", "right", "top", "left"))
    assert_same(original, other, lambda x, y: (-y, x), lambda u: u[..., ::-1] * [1, -1])


def test_far_from_the_origin(original):
    other = plate((LINES[0] + 1e3, LINES[1] - 1e3), ("left", "bottom", "right", "top"))
    assert_same(original, other, lambda x, y: (x + 1e3, y - 1e3), lambda u: u)


@pytest.mark.parametrize(("length", "stress"), [(1e3, 1.0), (1.0, 1e6), (1e-6, 1e-3)])
def test_units(original, length, stress):
    other = plate(LINES, ("left", "bottom", "right", "top"), length=length, stress=stress)
    x, y = points()
    found = other.displacement(length * x, length * y) / length
    assert found == pytest.approx(original.displacement(x, y), abs=1e-8 * 1e-3)
    assert other.stress(length * x, length * y) / stress == pytest.approx(original.stress(x, y), abs=1e-6 * 209)
    assert other.energy / (stress * length**2) == pytest.approx(original.energy, rel=1e-9)
    assert other.parts.friction / (stress * length**2) == pytest.approx(original.parts.friction, rel=1e-7)
    ours, theirs = original.contacts["plate"], other.contacts["plate"]
    assert theirs.slip / length == pytest.approx(ours.slip, abs=1e-8 * 1e-3)
    assert theirs.normal_stress / stress == pytest.approx(ours.normal_stress, abs=1e-6 * 209)
    assert other.cell_strain([0.3], [0.6]) == pytest.approx(original.cell_strain([0.3], [0.6]), abs=1e-9)


def test_a_bound_that_varies_follows_the_edges():
    """Bernstein coefficients run along +x: mirrored, they come in the opposite order."""
    s = np.random.default_rng(5).uniform(5.0, 30.0, size=(5, 3))
    one = plate(LINES, ("left", "bottom", "right", "top"), bounds={"plate": s})
    mirrored = -LINES[0][::-1], LINES[1]
    other = plate(mirrored, ("right", "bottom", "left", "top"), bounds={"plate": s[::-1, ::-1]})
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    wrong = plate(mirrored, ("right", "bottom", "left", "top"), bounds={"plate": s})
    assert wrong.energy != pytest.approx(one.energy, rel=1e-6)
