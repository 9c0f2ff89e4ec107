"""Joints between blocks of the body: closed they are not there, and what they do when they open or slip."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    Symmetry,
    Traction,
)
from tests.qvi_contact.states import solved

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # grids mirrored and turned have the same cells, unlike triangles; those: test_triangle_joints

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)
X, Y = [0.0, 0.3, 0.8, 1.5, 2.0], [0.0, 0.4, 0.7, 1.0]


@pytest.mark.parametrize("direction", ["horizontal", "vertical"])
class TestOneDimension:
    """Two blocks in a row: everything known in closed form, along y and along x."""

    E1, E2, NU1, NU2, SPLIT, LENGTH = 1000.0, 400.0, 0.3, 0.4, 0.4, 1.0

    def blocks(self, direction, contact, end, side=None):
        """Lower (or left) block of material 1; sides free, symmetric about the other axis; `end` rules the far end."""
        first, second = Material(self.E1, self.NU1), Material(self.E2, self.NU2)
        along, across = [0.0, 0.2, 0.4, 0.7, 1.0], [0.0, 0.5, 1.0, 1.5]
        names = ("bottom", "top", "left", "right") if direction == "horizontal" else ("left", "right", "bottom", "top")
        mesh = RectilinearMesh(*((across, along) if direction == "horizontal" else (along, across)))
        mesh = mesh.with_joint("joint", direction, self.SPLIT)
        near, far, middle, free = names
        bounds = {"y" if direction == "horizontal" else "x": (self.SPLIT, self.LENGTH)}
        normal, shear = ("y", "x") if direction == "horizontal" else ("x", "y")
        conditions = [
            Symmetry(near),
            Symmetry(middle),
            Traction(free, 0.0, 0.0) if side is None else side(free, shear),
            end(far, normal, shear),
            replace(contact, edges="joint", name="joint"),
        ]
        return ContactProblem(mesh, first, conditions, regions=[Region(second, **bounds)])

    @staticmethod
    def pressed(pressure):
        return lambda far, normal, shear: Traction(far, **{normal: -pressure, shear: 0.0})

    @staticmethod
    def moved(by):
        """Frictionless stamp pulled or pushed by a displacement."""
        if by is None:
            return None

        def end(far, *_):
            return Contact(far, 0.0, gap=by, law="bilateral", name="stamp")

        return end

    def test_slip_between_two_materials(self, direction):
        """Uniform pressure, frictionless: the slip is (ν1/E1 − ν2/E2) p s, s from the symmetry line."""
        p = 50.0
        result = solved(self.blocks(direction, Contact("joint", 0.0), self.pressed(p)))
        line = result.contacts["joint"]
        s = line.x if direction == "horizontal" else line.y
        assert line.normal_stress == pytest.approx(-p, rel=1e-9)
        assert line.slip == pytest.approx((self.NU1 / self.E1 - self.NU2 / self.E2) * p * s, rel=1e-7, abs=1e-12)
        assert line.gap == pytest.approx(0.0, abs=1e-10)
        expected = [-p, 0.0, 0.0] if direction == "vertical" else [0.0, -p, 0.0]
        assert result.gauss_stress()[2].reshape(-1, 3) == pytest.approx(np.tile(expected, (12 * 16, 1)), abs=1e-8)


class TestTransformed:
    """A sheared wall of two materials with dry joints: mirrored and turned it does the same."""

    REGION = ((0.8, 2.0), (0.4, 1.0))

    @pytest.fixture(scope="class")
    @staticmethod
    def wall():
        result = solved(TestTransformed.problem(), tolerance=1e-8)
        assert {1, 2} <= set(np.concatenate([line.state for line in result.contacts.values()]).tolist())
        return result

    @staticmethod
    def problem(kind="as it is"):
        """Pressed by the roof, which also moves by 2e-3 along x."""
        x, y, shift = np.array(X), np.array(Y), 2e-3
        bounds_x, bounds_y = TestTransformed.REGION
        sides, vertical = ("bottom", "top", "left", "right"), (0.8, 0.4, 1.0)
        if kind == "mirrored":
            x, shift, bounds_x, vertical = -x[::-1], -shift, (-2.0, -0.8), (-0.8, 0.4, 1.0)
            sides = ("bottom", "top", "right", "left")
        if kind == "upside down":
            y, bounds_y, vertical, sides = -y[::-1], (-1.0, -0.4), (0.8, -1.0, -0.4), ("top", "bottom", "left", "right")
        if kind == "turned":  # (x, y) → (−y, x)
            x, y, bounds_x, bounds_y = -y[::-1], x, (-1.0, -0.4), (0.8, 2.0)
            sides, vertical = ("right", "left", "bottom", "top"), (0.8, -1.0, -0.4)
        base, roof, left, right = sides
        flat, upright = ("horizontal", "vertical") if kind != "turned" else ("vertical", "horizontal")
        at = -0.4 if kind in ("upside down", "turned") else 0.4
        mesh = RectilinearMesh(x, y).with_joint("bed", flat, at).with_joint("head", upright, *vertical)
        # gap of the roof is along its normal, offset along +x or +y
        conditions = [
            Contact.tied(base, name="base"),
            Contact.tied(roof, -4e-3, shift, name="roof"),
            Traction(left, 0.0, 0.0),
            Traction(right, 0.0, 0.0),
            Contact("bed", 0.15, name="bed"),
            Contact("head", 0.3, name="head"),
        ]
        regions = [Region(Material(300.0, 0.1), bounds_x, bounds_y)]
        return ContactProblem(mesh, STEEL, conditions, regions=regions)

    @pytest.mark.parametrize(
        ("kind", "place", "turn"),
        [
            ("mirrored", lambda x, y: (-x, y), lambda s: s * [1, 1, -1]),
            ("upside down", lambda x, y: (x, -y), lambda s: s * [1, 1, -1]),
            ("turned", lambda x, y: (-y, x), lambda s: s[..., [1, 0, 2]] * [1, 1, -1]),
        ],
    )
    def test_same_state(self, wall, kind, place, turn):
        other = solved(self.problem(kind), tolerance=1e-8)
        x, y = np.random.default_rng(1).uniform(0.01, 0.99, (2, 60)) * [[2.0], [1.0]]
        scale = np.abs(wall.stress(x, y)).max()
        assert turn(other.stress(*place(x, y))) == pytest.approx(wall.stress(x, y), abs=1e-5 * scale)
        for name in ("bed", "head"):
            ours, theirs = wall.contacts[name], other.contacts[name]
            assert theirs.normal_force == pytest.approx(ours.normal_force, abs=1e-6 * scale)
            assert abs(theirs.tangential_force) == pytest.approx(abs(ours.tangential_force), abs=1e-6 * scale)
            assert np.sort(np.abs(theirs.slip)) == pytest.approx(np.sort(np.abs(ours.slip)), abs=1e-7)
            assert np.sort(theirs.gap) == pytest.approx(np.sort(ours.gap), abs=1e-7)


def test_block_on_block_is_block_on_ground():
    """A soft block on a nearly rigid one slips over the joint as over rigid ground."""
    mesh = RectilinearMesh(X, [-1.0, -0.5, 0.0, 0.4, 1.0])

    def conditions(base):
        roof = Displacement("top", x=1e-3, y=-2e-3)
        return [*base, Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), roof]

    upper = RectilinearMesh(X, [0.0, 0.4, 1.0])
    ground = solved(ContactProblem(upper, STEEL, conditions([Contact("bottom", 0.2, name="c")]))).contacts["c"]
    rock = Region(Material(1e9, 0.3), y=(-1.0, 0.0))
    base = [Displacement("bottom", 0.0, 0.0), Contact("c", 0.2)]
    problem = ContactProblem(mesh.with_joint("c", "horizontal", 0.0), STEEL, conditions(base), regions=[rock])
    joint = solved(problem, tolerance=1e-8).contacts["c"]
    assert joint.normal_stress == pytest.approx(ground.normal_stress, abs=1e-4)
    assert joint.tangential_stress == pytest.approx(-ground.tangential_stress, abs=1e-4)
    assert joint.slip == pytest.approx(-ground.slip, abs=1e-7)  # the lower block stands still


def test_joint_that_ends_at_contacts():
    """Between two rough plates, symmetric about the joint: no shear on it, and the half body's solution."""
    half = RectilinearMesh([0.0, 0.3, 0.7, 1.0], [0.0, 0.5, 1.0])

    def plates(bottom="bottom", top="top"):
        return [Contact(bottom, 0.2, name="floor"), Contact(top, 0.2, gap=-2e-3, name="roof")]

    free = Traction("right", 0.0, 0.0)
    expected = solved(ContactProblem(half, STEEL, [Symmetry("left"), free, *plates()]), tolerance=1e-8)
    lines = np.array([-1.0, -0.7, -0.3, 0.0, 0.3, 0.7, 1.0])
    whole = RectilinearMesh(lines, half.y).with_joint("joint", "vertical", 0.0)
    conditions = [Traction("left", 0.0, 0.0), free, *plates(), Contact("joint", 0.4, law="bilateral")]
    result = solved(ContactProblem(whole, STEEL, conditions), tolerance=1e-8)
    x, y = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    assert result.stress(x, y) == pytest.approx(expected.stress(x, y), abs=1e-5)
    assert result.stress(-x, y) * [1, 1, -1] == pytest.approx(expected.stress(x, y), abs=1e-5)
    assert result.contacts["joint"].tangential_stress == pytest.approx(0.0, abs=1e-6)
