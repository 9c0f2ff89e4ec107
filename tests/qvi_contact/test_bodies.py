"""Several bodies in one mesh of triangles: closed joints, gaps, bodies that contacts alone hold."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import TriangleMesh
from qvi_contact.gallery import arc, fan, press_fit, rings
from qvi_contact.mechanism import Bodies
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Polynomial, Traction
from qvi_contact.solution import motions_in_words
from tests.qvi_contact.builders import solved
from tests.qvi_contact.test_triangles import oblique

STEEL = Material(1000.0, 0.3)
CIRCLE = np.linspace(0.0, 2.0 * np.pi, 17)[:-1]


def nested(*contacts, potential=0.0, **held):
    """A pin in a bush in a plate, discs of radius 1, 2 and 4 with the joints "pin" and "bush"."""
    mesh = fan([arc(r, CIRCLE) for r in (1.0, 2.0, 4.0)], closed=True, centre=(0, 0), joints={"pin": 0, "bush": 1})
    outside = Displacement("outer", **held) if held else Traction("outer", normal=-1.0, tangential=0.0)
    return ContactProblem(mesh, STEEL, [*contacts, outside], body_potential=potential)


@pytest.mark.parametrize(("core", "opened"), [(Contact("pin", 0.2, gap=1e-4), 0.6), (Contact.tied("pin"), 0.0)])
def test_weight_of_a_core(core, opened):
    """A heavy disc lies in the bore of a plate, or is tied to it: the joint carries its weight, open or not above."""
    result = solved(nested(core, Contact.tied("bush"), potential=Polynomial([[0, 3.0]]), x=0, y=0))
    for joint, radius in (("pin", 1.0), ("bush", 2.0)):
        force, area = result.resultant(joint), 8.0 * np.sin(np.pi / 8.0) * radius**2
        assert (force.x, force.y, force.moment) == pytest.approx((0.0, 3.0 * area, 0.0), abs=1e-8)
    assert result.contacts["pin"].shares["open"] == pytest.approx(opened, abs=0.5 * opened)
    assert result.undetermined_motions == ()


class TestLoose:
    """What nothing determines is found and said: the bodies by name, and how they move."""

    @pytest.mark.parametrize(("spare", "law"), [(1.0, "unilateral"), (1.001, "unilateral"), (1.0, "bilateral")])
    def test_block_that_friction_just_holds(self, spare, law):
        """A little friction to spare holds a leaning block, on a mesh too coarse to show where it sticks."""
        mesh = TriangleMesh.rectangle((8, 4), 2.0, 1.0)
        free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right", "top")]
        leaning = Polynomial([[0.0, 1.0], [-0.3]])
        block = ContactProblem(mesh, Material(1e4, 0.2), [Contact("bottom", 0.3 * spare, law=law), *free], leaning)
        result = solved(block)
        assert len(result.undetermined_motions) == (spare == 1.0)
        assert result.contacts["bottom"].shares["stick"] == 0.0

    @pytest.mark.parametrize(("gap", "outside"), [(0.5, -1.0), (0.0, 1.0)])
    def test_ring_that_nothing_touches(self, gap, outside):
        """A gap wider than the pressure closes, or tension outside: no load reaches the inner ring."""
        conditions = [
            Contact.frictionless("joint", gap=gap),
            Traction("outer", normal=outside * 1e6, tangential=0.0),
            Traction("inner", normal=0.0, tangential=0.0),
        ]
        result = solved(replace(rings(4, whole=True), conditions=conditions))
        assert result.contacts["joint"].normal_stress == pytest.approx(0.0, abs=1e-2)
        (loose,) = result.undetermined_motions
        assert (loose.names, loose.motions) == (("the body 'joint'",), 3)
        assert [each for each in result.remarks if "later steps of a history may" in each] == [loose.remark]

    @pytest.mark.parametrize("friction", [0.0, 0.2])
    def test_what_is_pressed_can_turn_without_friction(self, friction):
        found = solved(press_fit(4, friction, whole=True)).undetermined_motions
        assert [(loose.names, loose.motions, loose.way) for loose in found] == (
            [] if friction else [(("the body 'shaft'",), 1, "turn about (0, 0)")]
        )

    def test_bodies_that_move_together(self):
        """A pin pressed into its bush, which lies free in a plate."""
        (loose,) = solved(nested(Contact("pin", 0.3, gap=-1e-3), Contact("bush", 0.3, gap=0.5))).undetermined_motions
        assert sorted(loose.names) == ["the body 'bush'", "the body 'pin'"]
        assert loose.way == "turn and move"
        assert "which together" in loose.remark
        # both free: the plate, which is larger, is what they are free beside
        found = solved(nested(Contact("pin", 0.0, gap=0.5), Contact("bush", 0.0, gap=0.5))).undetermined_motions
        assert sorted(loose.names for loose in found) == [("the body 'bush'",), ("the body 'pin'",)]

    @pytest.mark.parametrize("angle", [0.0, 30.0, 90.0])
    @pytest.mark.parametrize("friction", [0.0, 0.3])
    def test_block_on_a_plane(self, angle, friction):
        """Without friction it slides along the plane; what sticks, does not."""
        sides = [Traction(side, normal=0.0, tangential=0.0) for side in ("left", "right")]
        conditions = [Contact("bottom", friction), Traction("top", normal=-1.0, tangential=0.0), *sides]
        turned = oblique(TriangleMesh.rectangle((2, 1), 2.0, 1.0), angle)
        found = solved(ContactProblem(turned, STEEL, conditions)).undetermined_motions
        if friction:
            assert found == ()
        else:
            (loose,) = found
            along = [float(part) for part in loose.way.removeprefix("move along ").strip("()").split(",")]
            assert along == pytest.approx([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))], abs=1e-4)
            assert loose.names == ("the body",)

    @pytest.mark.parametrize("spare", [0.0, 0.1])
    def test_block_between_walls(self, spare):
        """Walls that touch it from both sides hold it, although they do not press."""
        walls = [Contact("left", 0.0), Contact("right", 0.0, gap=spare), Traction("top", 0.0, -1.0)]
        mesh = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
        block = ContactProblem(mesh, Material(1000.0, 0.0), [Contact("bottom", 0.0), *walls])
        assert [loose.way for loose in solved(block).undetermined_motions] == ["move along (1, 0)"] * (spare > 0.0)

    def test_two_blocks_slide_each_for_itself(self):
        grid = TriangleMesh.grid([0.0, 1.0, 2.0], [0.0, 1.0, 2.0]).with_joint("bed", lambda _, y: np.isclose(y, 1.0))
        sides = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), Traction("top", 0.0, -1.0)]
        for floor, bed, count in ((0.0, 0.0, 2), (0.3, 0.0, 1), (0.0, 0.3, 1), (0.3, 0.3, 0)):
            problem = ContactProblem(grid, STEEL, [Contact("bottom", floor), Contact("bed", bed), *sides])
            found = solved(problem).undetermined_motions
            assert len(found) == count
            assert all(loose.way == "move along (1, 0)" for loose in found)

    @pytest.mark.parametrize(
        ("motions", "words"),
        [([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "turn and move"), ([[1, 0, 0], [0, 1, 0]], "move"),
         ([[0, -1, 0]], "move along (0, 1)"),
         ([[0, 0, 1], [1, 0, 0]], "turn and move along (1, 0)"), ([[3, -1, 1]], "turn about (1, 3)")],
    )  # fmt: skip
    def test_words(self, motions, words):
        """Motions of a square of size r = √2 around the origin: (a − θ y/r, b + θ x/r)."""
        mesh = TriangleMesh.rectangle((1, 1), 2.0, 2.0, origin=(-1.0, -1.0))
        sides = [Traction(side, 0.0, 0.0) for side in ("left", "right", "top", "bottom")]
        bodies = Bodies.of(ContactProblem(mesh, STEEL, sides))
        scaled = np.array(motions, dtype=float).T * [[1.0], [1.0], [bodies.size[0]]]
        assert motions_in_words(np.linalg.qr(scaled)[0], bodies, 0) == words
