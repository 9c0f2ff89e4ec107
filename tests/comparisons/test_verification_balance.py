"""Balance of bodies in the manual: tractions around them and their weight, of stresses and of displacements."""

from dataclasses import replace

import pytest

from comparisons.verification import balance
from qvi_contact import Contact, ContactProblem, Displacement, Expression, Material, Symmetry, Traction, TriangleMesh
from qvi_contact.companion import solve_companion
from tests.qvi_contact.states import solved

STEEL = Material(1000.0, 0.3)


def column():
    """A heavy column between lines of symmetry: displacements are quadratic in y, all models have them exactly."""
    mesh = TriangleMesh.rectangle((1, 2), 1.0, 2.0)
    supports = [Symmetry(side) for side in ("bottom", "left", "right")]
    weight = Expression("3.0 * y")
    return ContactProblem(mesh, STEEL, [*supports, Traction("top", 0.0, -1.0)], body_potential=weight)


def leaning():
    """Two heavy blocks in the shape of a dam, which lean on each other: no symmetry, so that moments count."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 2.0)
    vertices = mesh.vertices.copy()
    vertices[:, 0] -= 0.4 * vertices[:, 0] * vertices[:, 1] / 2.0
    mesh = TriangleMesh(vertices, mesh.cells, mesh.edge_sets).with_joint("joint", lambda _, y: y == 1.0)
    free = [Traction(side, 0.0, 0.0) for side in ("top", "left", "right")]
    conditions = [Contact("joint", 0.6), Displacement("bottom", x=0.0, y=0.0), *free]
    return ContactProblem(mesh, STEEL, conditions, body_potential=Expression("3.0 * y + 0.2 * x"))


@pytest.mark.parametrize("problem", [column, leaning])
def test_stresses_leave_nothing_of_heavy_bodies(problem):
    assert balance.of_stresses(solved(problem(), degree=4)) < 1e-13


def test_displacements_leave_nothing_where_they_are_exact():
    assert balance.of_displacements(solve_companion(column(), degree=2)) < 1e-12


def test_displacements_leave_what_their_stresses_lack():
    """Less with each degree, in the corners slowly."""
    left = [balance.of_displacements(solve_companion(leaning(), degree=degree)) for degree in (1, 3)]
    assert 1e-3 < left[1] < 0.03 * left[0]


def test_a_weight_that_no_traction_carries_is_seen():
    """What carries the load 1 on a light column leaves all of the weight 6: above and below 1, at the sides 0.6."""
    light = solve_companion(replace(column(), body_potential=0.0), degree=2)
    heavy = replace(light, problem=column())
    assert balance.of_displacements(heavy) == pytest.approx(6.0 / (2.0 * 1.0 + 2.0 * 0.6), rel=1e-12)


def test_each_body_is_looked_at_by_itself():
    """The same column cut at three quarters: the part below is left with the weight 4.5, its sides have 0.45."""
    mesh = TriangleMesh.rectangle((1, 4), 1.0, 2.0).with_joint("joint", lambda _, y: y == 1.5)
    whole = replace(column(), mesh=mesh, conditions=[*column().conditions, Contact("joint", 0.0)])
    light = solve_companion(replace(whole, body_potential=0.0), degree=2)
    heavy = replace(light, problem=whole)
    assert balance.of_displacements(heavy) == pytest.approx(4.5 / (2.0 * 1.0 + 2.0 * 0.45), rel=1e-9)
