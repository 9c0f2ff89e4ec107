"""Joints between blocks of the body: closed they are not there, and what they do when they open or slip."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh
from qvi_contact.gallery import arc, fan
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Symmetry, Traction
from qvi_contact.solution import enclosed_beyond
from tests.qvi_contact.builders import difference, solved, with_line

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)
X, Y = [0.0, 0.3, 0.8, 1.5, 2.0], [0.0, 0.4, 0.7, 1.0]


def squeezed(mesh, joints=(), material=STEEL, regions=()):
    """Pressed from all sides by loads that shear it as well, held without hindrance."""
    conditions = [
        Symmetry("bottom"), Displacement("left", x=lambda _, y: 1e-3 * y), Traction("left", y=0.0),
        Traction("right", x=lambda _, y: -10.0 - 3.0 * y, y=lambda _, y: 4.0 * y * (1.0 - y)),
        Traction("top", x=lambda x, _: 3.0 * x * (2.0 - x), y=lambda x, _: -12.0 + x),
    ]  # fmt: skip
    return ContactProblem(mesh, material, [*conditions, *joints], regions=regions)


JOINTS = {
    "horizontal": [("a", "horizontal", 0.4)],
    "vertical": [("a", "vertical", 0.8)],
    "ending inside": [("a", "horizontal", 0.4, 0.3, 1.5)],
    "crossing": [("a", "horizontal", 0.4), ("b", "vertical", 0.8)],
    "wall": [
        ("a", "horizontal", 0.4), ("b", "horizontal", 0.7), ("c", "vertical", 0.8, 0.0, 0.4),
        ("d", "vertical", 1.5, 0.4, 0.7), ("e", "vertical", 0.3, 0.7, 1.0),
    ],
}  # fmt: skip


def jointed(mesh, joints):
    for joint in joints:
        mesh = with_line(mesh, *joint)
    return mesh


@pytest.mark.parametrize("joints", JOINTS.values(), ids=JOINTS)
class TestClosedJoints:
    """A joint that is pressed everywhere and does not slip is not there."""

    def test_friction_holds_it(self, joints):
        mesh = TriangleMesh.grid(X, Y)
        body = solved(squeezed(mesh))
        stress = body.gauss_stress()[2]
        assert stress[..., :2].max() < 0.0  # pressed along every line
        contacts = [Contact(name, 20.0) for name, *_ in joints]
        result = solved(squeezed(jointed(mesh, joints), contacts), tolerance=1e-8)
        assert difference(body, result) < 1e-7
        for line in result.contacts.values():
            assert line.slip == pytest.approx(0.0, abs=1e-9)
            assert line.gap == pytest.approx(0.0, abs=1e-9)
            assert not (line.state == 0).any()

    def test_tied(self, joints):
        mesh = TriangleMesh.grid(X, Y)
        contacts = [Contact.tied(name) for name, *_ in joints]
        regions = [Region(FOAM, x=(0.3, 1.5), y=(0.4, 0.7))]
        body = solved(squeezed(mesh, regions=regions))
        assert difference(body, solved(squeezed(jointed(mesh, joints), contacts, regions=regions))) < 1e-10


@pytest.mark.parametrize("direction", ["horizontal", "vertical"])
class TestOneDimension:
    """Two blocks in a row: everything known in closed form, along y and along x."""

    E1, E2, NU1, NU2, SPLIT, LENGTH = 1000.0, 400.0, 0.3, 0.4, 0.4, 1.0

    def blocks(self, direction, contact, end):
        """Lower (or left) block of material 1; sides free, symmetric about the other axis; `end` rules the far end."""
        first, second = Material(self.E1, self.NU1), Material(self.E2, self.NU2)
        along, across = [0.0, 0.2, 0.4, 0.7, 1.0], [0.0, 0.5, 1.0, 1.5]
        names = ("bottom", "top", "left", "right") if direction == "horizontal" else ("left", "right", "bottom", "top")
        mesh = TriangleMesh.grid(*((across, along) if direction == "horizontal" else (along, across)))
        mesh = with_line(mesh, "joint", direction, self.SPLIT)
        near, far, middle, free = names
        bounds = {"y" if direction == "horizontal" else "x": (self.SPLIT, self.LENGTH)}
        normal, shear = ("y", "x") if direction == "horizontal" else ("x", "y")
        conditions = [
            Symmetry(near), Symmetry(middle), Traction(free, 0.0, 0.0), end(far, normal, shear),
            replace(contact, edges="joint", name="joint"),
        ]  # fmt: skip
        return ContactProblem(mesh, first, conditions, regions=[Region(second, **bounds)])

    @staticmethod
    def pressed(pressure):
        return lambda far, normal, shear: Traction(far, **{normal: -pressure, shear: 0.0})

    @staticmethod
    def moved(by):
        """Frictionless stamp pulled or pushed by a displacement."""

        def end(far, *_):
            return Contact(far, 0.0, gap=by, law="bilateral", name="stamp")

        return end

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


class TestRefused:
    """What is no joint, or no use of one."""

    MESH = TriangleMesh.grid(X, Y).with_joint("joint", lambda _, y: np.isclose(y, 0.4))

    @pytest.mark.parametrize("other", [("horizontal", 0.4, 0.3, 0.8), ("horizontal", 0.4)])
    def test_overlapping_joints(self, other):
        mesh = with_line(self.MESH, "other", *other)
        with pytest.raises(InputError, match="shares an edge with 'joint'"):
            squeezed(mesh, [Contact("joint", 0.1), Contact("other", 0.1)])
        # one of them is not used
        mesh = self.MESH.with_joint("other", lambda _, y: np.isclose(y, 0.4))
        assert solved(squeezed(mesh, [Contact("joint", 20.0)])).contacts.keys() == {"joint"}

    @pytest.mark.parametrize(
        "condition",
        [*(Traction("joint", 0.0, 0.0), Displacement("joint", x=0.0), Symmetry("joint")),
         Contact("joint", 0.1, plate=RigidPlate(force_y=1.0))],
    )  # fmt: skip
    def test_other_conditions_on_a_joint(self, condition):
        with pytest.raises(InputError, match="joint"):
            squeezed(self.MESH, [condition])


@pytest.mark.parametrize("rows", ["edges", "points"])
def test_joint_that_ends_at_contacts(rows):
    """Between two rough plates, symmetric about the joint: no shear on it, and the half body's solution."""
    whole = TriangleMesh.grid(
        [-1.0, -0.7, -0.3, 0.0, 0.3, 0.7, 1.0], [0.0, 0.5, 1.0], joints={"joint": ((0.0, 0.0), (0.0, 1.0))}
    )
    half = whole.part(np.flatnonzero(whole.corners[..., 0].min(axis=1) >= 0.0))
    plates = [Contact("bottom", 0.2, name="floor"), Contact("top", 0.2, gap=-2e-3, name="roof")]
    free, options = Traction("right", 0.0, 0.0), {"degree": 4, "law_on": rows, "tolerance": 1e-8}
    expected = solved(ContactProblem(half, STEEL, [Symmetry("joint"), free, *plates]), **options)
    conditions = [Traction("left", 0.0, 0.0), free, *plates, Contact("joint", 0.4, law="bilateral")]
    result = solved(ContactProblem(whole, STEEL, conditions), **options)
    x, y = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    assert result.stress(x, y) == pytest.approx(expected.stress(x, y), abs=1e-6)
    assert result.stress(-x, y) * [1, 1, -1] == pytest.approx(expected.stress(x, y), abs=1e-6)
    assert result.contacts["joint"].tangential_stress == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("step", "right"), [(1, 0.7), (-1, 0.7), (1, 0.4)])
def test_the_force_on_a_joint_is_what_stands_on_it_whichever_triangle_comes_first(step, right):
    """It acts on the lower block, the larger one, whose number is the second where triangles come the other way."""
    grid = TriangleMesh.grid(X, Y)
    mesh, line = TriangleMesh(grid.vertices, grid.cells[::step], grid.edge_sets), ([0.79, 0.81], [0.7, right])
    held = Displacement("bottom", x=0.0, y=0.0), Contact("joint", 0.5), Traction("top", x=0.5, y=-3.0)
    mesh = mesh.with_joint("joint", lambda x, y: abs(y - np.interp(x, *line)) < 1e-9)
    found = solved(ContactProblem(mesh, STEEL, [*held, Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]))
    assert vars(found.resultant("joint")) == pytest.approx({"x": 1.0, "y": -6.0, "moment": -7.0}, rel=1e-8)


def test_a_joint_with_a_step_in_its_middle_acts_on_what_is_below_wherever_it_lies():
    line = [0.49, 0.51], [1 / 3, 2 / 3]  # around its middle it does not turn, but for rounding
    mesh = TriangleMesh.rectangle((4, 3)).with_joint("joint", lambda x, y: abs(y - np.interp(x, *line)) < 1e-9)
    for shift in np.linspace(-3.0, 3.0, 13):
        edges = replace(mesh, vertices=(vertices := mesh.vertices + np.array([shift, 0.7 * shift]))).edges("joint")
        assert (enclosed_beyond(vertices, edges) == (abs(edges.normal[:, 0]) > 0.5)).all()


def test_shear_and_slip_on_a_closed_joint_count_one_way_around():
    """Though upright sides have other sides than lying ones: pure shear turns none, one offset strains none."""
    mesh = TriangleMesh.rectangle((4, 4)).with_joint("fit", lambda x, y: np.maximum(abs(x - 0.5), abs(y - 0.5)) == 0.25)
    sheared = [Displacement(side, x=lambda _, y: 1e-3 * y, y=0.0) for side in ("bottom", "right", "top", "left")]
    line = solved(ContactProblem(mesh, STEEL, [Contact.tied("fit"), *sheared])).contacts["fit"]
    assert line.tangential_stress * 2.6 / STEEL.young == pytest.approx(np.where(abs(line.y - 0.5) == 0.25, 1e-3, -1e-3))
    assert line.tangential_force == pytest.approx(0.0, abs=1e-9)
    rings = [arc(radius, np.pi / 8.0 * np.arange(1.0, 17.0, 2.0)) for radius in (1.0, 2.0)]  # with two upright chords
    mesh = fan(rings, closed=True, centre=(0.0, 0.0)).with_joint("fit", lambda x, y: abs(np.hypot(x, y) - 0.92) < 0.01)
    conditions = Contact.tied("fit", offset=1e-3), Displacement("outer", x=0.0, y=0.0)
    result = solved(ContactProblem(mesh.with_arc("fit", (0.0, 0.0), 1.0), STEEL, conditions))
    assert result.bracket.forces == {"fit.tangential_force": pytest.approx((0.0, 0.0), abs=1e-8)}
