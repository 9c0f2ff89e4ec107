"""Joints between blocks of the body: closed they are not there, and what they do when they open or slip."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
)
from tests.qvi_contact.states import difference, solved

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # grids mirrored and turned have the same cells, unlike triangles; those: test_triangle_joints

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)
X, Y = [0.0, 0.3, 0.8, 1.5, 2.0], [0.0, 0.4, 0.7, 1.0]


def squeezed(mesh, joints=(), material=STEEL, regions=()):
    """Pressed from all sides by loads that shear it as well, held without hindrance."""
    conditions = [
        Symmetry("bottom"),
        Displacement("left", x=lambda _, y: 1e-3 * y),
        Traction("left", y=0.0),
        Traction("right", x=lambda _, y: -10.0 - 3.0 * y, y=lambda _, y: 4.0 * y * (1.0 - y)),
        Traction("top", x=lambda x, _: 3.0 * x * (2.0 - x), y=lambda x, _: -12.0 + x),
    ]
    return ContactProblem(mesh, material, [*conditions, *joints], regions=regions)


JOINTS = {
    "horizontal": [("a", "horizontal", 0.4)],
    "vertical": [("a", "vertical", 0.8)],
    "parallel": [("a", "horizontal", 0.4), ("b", "horizontal", 0.7)],
    "ending inside": [("a", "horizontal", 0.4, 0.3, 1.5)],
    "crossing": [("a", "horizontal", 0.4), ("b", "vertical", 0.8)],
    "meeting": [("a", "horizontal", 0.4), ("b", "vertical", 0.8, 0.4, 1.0)],
    "wall": [
        ("a", "horizontal", 0.4), ("b", "horizontal", 0.7), ("c", "vertical", 0.8, 0.0, 0.4),
        ("d", "vertical", 1.5, 0.4, 0.7), ("e", "vertical", 0.3, 0.7, 1.0),
    ],
}  # fmt: skip


def jointed(mesh, joints):
    for joint in joints:
        mesh = mesh.with_joint(*joint)
    return mesh


@pytest.mark.parametrize("joints", JOINTS.values(), ids=JOINTS)
class TestClosedJoints:
    """A joint that is pressed everywhere and does not slip is not there."""

    @pytest.mark.parametrize("law", [{"friction": 20.0}, {"friction": 0.0, "cohesion": 1e4, "law": "bilateral"}])
    def test_friction_holds_it(self, joints, law):
        mesh = RectilinearMesh(X, Y)
        body = solved(squeezed(mesh))
        stress = body.gauss_stress()[2]
        assert stress[..., :2].max() < 0.0  # pressed along every line
        contacts = [Contact(name, **law) for name, *_ in joints]
        result = solved(squeezed(jointed(mesh, joints), contacts), tolerance=1e-8)
        assert difference(body, result) < 1e-7
        for line in result.contacts.values():
            assert line.slip == pytest.approx(0.0, abs=1e-9)
            assert line.gap == pytest.approx(0.0, abs=1e-9)
            assert not (line.state == 0).any()

    def test_tied(self, joints):
        mesh = RectilinearMesh(X, Y)
        contacts = [Contact.tied(name) for name, *_ in joints]
        regions = [Region(FOAM, x=(0.3, 1.5), y=(0.4, 0.7))]
        body = solved(squeezed(mesh, regions=regions))
        assert difference(body, solved(squeezed(jointed(mesh, joints), contacts, regions=regions))) < 1e-10


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

    def test_offset_in_place_of_slip(self, direction):
        """Where the offset is as large as the slip would be there is none, and friction has nothing to do."""
        p = 50.0

        def offset(x, y):
            return (self.NU1 / self.E1 - self.NU2 / self.E2) * p * (x if direction == "horizontal" else y)

        stuck = Contact("joint", 0.5, offset=offset)
        line = solved(self.blocks(direction, stuck, self.pressed(p))).contacts["joint"]
        assert line.normal_stress == pytest.approx(-p, rel=1e-8)
        assert line.tangential_stress == pytest.approx(0.0, abs=1e-7)
        assert line.slip == pytest.approx(0.0, abs=1e-10)

    def test_friction_hinders_the_slip(self, direction):
        free = solved(self.blocks(direction, Contact("joint", 0.0), self.pressed(50.0))).contacts["joint"]
        result = solved(self.blocks(direction, Contact("joint", 0.01), self.pressed(50.0)))
        rough, multiplier = result.contacts["joint"], result.solution.tangential_displacement
        slips = np.abs(multiplier) > 1e-3 * np.abs(multiplier).max()  # the slip's projection is not pointwise
        assert slips.sum() >= 3
        assert np.abs(rough.tangential_stress[slips]) == pytest.approx(-0.01 * rough.normal_stress[slips], rel=1e-6)
        assert (np.abs(rough.slip) <= np.abs(free.slip) + 1e-9).all()
        assert (rough.tangential_stress[slips] * free.slip[slips] < 0.0).all()

    def test_opens_by_what_is_imposed(self, direction):
        result = solved(self.blocks(direction, Contact("joint", 0.3), self.moved(2e-3)))
        line = result.contacts["joint"]
        assert line.gap == pytest.approx(2e-3, rel=1e-6)
        assert (line.state == 0).all()
        assert np.abs(result.gauss_stress()[2]).max() < 1e-8

    @pytest.mark.parametrize("push", [0.5e-3, 1.5e-3, 4e-3])
    def test_stands_open_and_closes_when_pushed(self, direction, push):
        """A joint open by g: no stress before the push is g, and a spring of two blocks afterwards."""
        gap = 1e-3
        contact = Contact("joint", 0.0, gap=gap)
        line = solved(self.blocks(direction, contact, self.moved(-push))).contacts["joint"]
        softness = self.SPLIT / self.E1 + (self.LENGTH - self.SPLIT) / self.E2
        pressure = max(push - gap, 0.0) / softness
        assert line.normal_stress == pytest.approx(-pressure, rel=1e-7, abs=1e-8)
        assert line.gap == pytest.approx(max(gap - push, 0.0), rel=1e-6, abs=1e-10)

    def test_a_gap_that_varies_closes_in_part(self, direction):
        """σ_N ≤ 0, g − u_N ≥ 0 and balance; some of it stays open."""

        def gap(x, y):
            return 2e-3 * (x if direction == "horizontal" else y)

        result = solved(self.blocks(direction, Contact("joint", 0.2, gap=gap), self.moved(-1e-3)))
        line = result.contacts["joint"]
        assert {0} < set(line.state.tolist())
        assert line.normal_stress.max() < 1e-7
        assert line.normal_force == pytest.approx(result.contacts["stamp"].normal_force, rel=1e-7)

    def test_bilateral_joint_carries_tension(self, direction):
        pull = 1e-3
        contact = Contact("joint", 0.0, law="bilateral")
        line = solved(self.blocks(direction, contact, self.moved(pull))).contacts["joint"]
        softness = self.SPLIT / self.E1 + (self.LENGTH - self.SPLIT) / self.E2
        assert line.normal_stress == pytest.approx(pull / softness, rel=1e-8)


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

    def test_equilibrium_of_every_block(self, wall):
        """Forces on the block below the bed, from its joint and its base; what the bed passes on, the roof returns."""
        bed, base, roof = (wall.resultant(name) for name in ("bed", "base", "roof"))
        size = abs(roof.y)
        for component in ("x", "y", "moment"):
            assert getattr(bed, component) + getattr(base, component) == pytest.approx(0.0, abs=1e-9 * size)
            assert getattr(bed, component) == pytest.approx(getattr(roof, component), abs=1e-9 * size)
        line = wall.contacts["bed"]
        assert -line.normal_force == pytest.approx(bed.y, rel=1e-9)
        assert line.tangential_force == pytest.approx(bed.x, rel=1e-9)


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


def test_joints_in_a_body_with_a_hole():
    """From the outside to the hole on both sides of it: held by friction it is not there."""
    lines = [0.0, 0.5, 1.0, 1.5, 2.0]
    active = np.ones((4, 4), dtype=bool)
    active[1:3, 1:3] = False
    mesh = RectilinearMesh(lines, lines, active)
    outside = {"bottom": ("bottom", 0.0), "top": ("top", 2.0), "left": ("left", 0.0), "right": ("right", 2.0)}
    for name, (side, at) in outside.items():
        mesh = mesh.with_edges(f"outer {name}", side, at=at)
    for side, at in (("bottom", 1.5), ("top", 0.5), ("left", 1.5), ("right", 0.5)):
        mesh = mesh.with_edges(f"hole {side}", side, at=at)
    holes = [Traction(f"hole {side}", 0.0, 0.0) for side in outside]
    conditions = [
        Symmetry("outer bottom"),
        Symmetry("outer left"),
        Traction("outer right", -1.0, 0.0),
        Traction("outer top", 0.0, -10.0),
        *holes,
    ]
    body = solved(ContactProblem(mesh, STEEL, conditions))
    split = mesh.with_joint("joint", "horizontal", 1.0)
    assert len(split.joint_set("joint")) == 2  # none in the hole
    result = solved(ContactProblem(split, STEEL, [*conditions, Contact("joint", 50.0)]), tolerance=1e-8)
    assert body.stress([0.1, 0.4, 1.6, 1.9], 1.0)[:, 1].max() < -1.0
    assert difference(body, result) < 1e-6
    slack = solved(ContactProblem(split, STEEL, [*conditions, Contact("joint", 0.05)]), tolerance=1e-8)
    assert slack.contacts["joint"].normal_force == pytest.approx(20.0, rel=1e-8)
    assert difference(body, slack) > 1e-4


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


class TestRefused:
    """What is no joint, or no use of one."""

    MESH = RectilinearMesh(X, Y).with_joint("joint", "horizontal", 0.4)

    @pytest.mark.parametrize("other", [("horizontal", 0.4, 0.3, 0.8), ("horizontal", 0.4)])
    def test_overlapping_joints(self, other):
        mesh = self.MESH.with_joint("other", *other)
        with pytest.raises(InputError, match="shares an edge with 'joint'"):
            squeezed(mesh, [Contact("joint", 0.1), Contact("other", 0.1)])

    def test_overlapping_joints_one_of_which_is_not_used(self):
        mesh = self.MESH.with_joint("other", "horizontal", 0.4)
        assert solved(squeezed(mesh, [Contact("joint", 20.0)])).contacts.keys() == {"joint"}

    def test_the_same_joint_twice(self):
        with pytest.raises(InputError, match="shares an edge"):
            squeezed(self.MESH, [Contact("joint", 0.1), Contact("joint", 0.1, name="again")])

    def test_plate_on_a_joint(self):
        with pytest.raises(InputError, match="joint lies between two blocks"):
            squeezed(self.MESH, [Contact("joint", 0.1, plate=RigidPlate(force_y=1.0))])

    @pytest.mark.parametrize(
        "condition", [Traction("joint", 0.0, 0.0), Displacement("joint", x=0.0), Symmetry("joint")]
    )
    def test_other_conditions_on_a_joint(self, condition):
        with pytest.raises(InputError, match="joint"):
            squeezed(self.MESH, [condition])

    @pytest.mark.parametrize(
        ("arguments", "word"),
        [
            (("new", "diagonal", 0.4), "direction"),
            (("new", "horizontal", 0.41), "nearest one is at 0.4"),
            (("new", "horizontal", 0.0), "no interior edge"),
            (("new", "horizontal", 0.4, 0.5), "start"),
            (("new", "vertical", 0.8, 0.7, 0.4), "no interior edge"),
            (("joint", "vertical", 0.8), "exists already"),
            (("", "vertical", 0.8), "non-empty"),
        ],
    )
    def test_where_there_is_no_joint(self, arguments, word):
        with pytest.raises(InputError, match=word):
            self.MESH.with_joint(*arguments)
