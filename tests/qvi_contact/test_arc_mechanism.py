"""What rigid bodies carry on arcs: conditions hold along the arc, and not for its chord."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, Traction, solve
from qvi_contact.gallery.meshes import arc, fan
from qvi_contact.mechanism import find_mechanism
from qvi_contact.mechanism.program import Rigid
from qvi_contact.solution.limit import limit_load

HALF = np.pi / 3.0  # of the cradle's angle
STEEL = Material(1000.0, 0.3)


def cradle(contact, push=1.0, edges=4):
    """A piece of a ring in a cradle of 120°, pressed by a force 1 downwards and `push` to the right, at its centre."""
    angles = np.linspace(-HALF, HALF, edges + 1) - np.pi / 2.0
    mesh = fan([arc(0.5, angles), arc(1.0, angles)], closed=False, arcs=("inner", "outer"))

    def down(x, y):
        return 2.0 * y / np.hypot(x, y) / (HALF + np.sin(2.0 * HALF) / 2.0)

    def right(x, y):
        return -2.0 * push * x / np.hypot(x, y) / (HALF - np.sin(2.0 * HALF) / 2.0)

    radial = [Traction("inner", normal=lambda x, y: down(x, y) + right(x, y), tangential=0.0, name="push")]
    return ContactProblem(
        mesh, STEEL, [contact, *radial, *(Traction(end, normal=0.0, tangential=0.0) for end in ("start", "end"))]
    )


def holds(contact, push, edges):
    return find_mechanism(cradle(contact, push, edges)) is None


@pytest.mark.parametrize("edges", [3, 4])
def test_what_a_cradle_holds(edges):
    """A force through the centre leaves within the angle of the cradle, however many arcs that is divided into."""
    contact = Contact("outer", 0.0)
    assert holds(contact, 0.999999 * np.tan(HALF), edges)
    assert not holds(contact, 1.000001 * np.tan(HALF), edges)


def test_what_friction_holds():
    """Not less than without; not as much more as at a point, since friction at the rim alone would turn the ring."""
    contact = Contact("outer", 0.2)
    assert holds(contact, 0.999999 * np.tan(HALF), 3)
    assert not holds(contact, 0.99 * np.tan(HALF + np.arctan(0.2)), 3)


def test_limit_loads_lie_below_mechanisms():
    contact = Contact("outer", 0.2, cohesion=0.1)
    found = limit_load(cradle(contact), ["push"])
    assert found.lower <= found.upper * (1.0 + 1e-9)


def test_the_work_of_pressure_on_arcs():
    """Of a uniform pressure all around nothing is left, and on the lower half of a ring what is above it."""
    angles = np.linspace(0.0, np.pi, 5)
    mesh = fan([arc(0.5, angles), arc(1.0, angles)], closed=False, arcs=("inner", "outer"))
    ends = [Traction(end, normal=-3.0, tangential=0.0) for end in ("start", "end")]
    pressed = ContactProblem(
        mesh, STEEL, [*(Traction(e, normal=-3.0, tangential=0.0) for e in ("inner", "outer")), *ends]
    )
    works = Rigid(pressed).works
    assert sum(work.row for work in works.values()) == pytest.approx(0.0, abs=1e-13)
    assert works["outer"].row[:2] == pytest.approx([0.0, -6.0], abs=1e-13)
    along = ContactProblem(mesh, STEEL, [Traction(e, x=0.0, y=-1.0) for e in ("inner", "outer", "start", "end")])
    assert Rigid(along).works["outer"].row[:2] == pytest.approx([0.0, -np.pi], abs=1e-13)


def test_supports_on_arcs_let_a_disc_turn():
    """Held normally all around it can turn about its centre, and nothing else."""
    mesh = fan([arc(1.0, np.linspace(0.0, 2.0 * np.pi, 13)[:-1])], closed=True, centre=(0.0, 0.0), arcs=("outer",))
    turning = Rigid(
        ContactProblem(mesh, STEEL, [Displacement("outer", normal=0.0), Traction("outer", tangential=0.0)])
    ).free
    assert turning.shape == (3, 1)
    assert np.abs(turning[:, 0]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_a_push_beyond_the_cradle_is_infeasible():
    result = solve(cradle(Contact("outer", 0.0), 1.8))
    assert result.status.value == "infeasible"
    assert result.mechanism.overload > 1.0
