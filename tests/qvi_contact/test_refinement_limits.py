"""Limit loads refined until both sides agree: closed forms, where meshes are refined, honest ends."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import InputError, LimitFactor, RefinementStatus, TriangleMesh, refine
from qvi_contact.problem import Contact, ContactProblem, Material, Traction
from tests.test_examples import example

STEEL = Material(1000.0, 0.3)
TARGET = 1e-4


def refined(problem, *loads, target=TARGET, **options):
    return refine(problem, target=target, quantity=LimitFactor(loads), **options)


def wall(mesh, friction=1.0, wind=0.25):
    """A wall 1 × 4 of the weight 25 under a wind of 1: it tips at 6.25 and slides at 25 μ."""
    loads = [Traction("left", wind, 0.0, name="wind"), *(Traction(side, 0.0, 0.0) for side in ("top", "right"))]
    base = Contact("bottom", friction, name="base")
    return ContactProblem(mesh, STEEL, [base, *loads], body_potential=lambda _, y: 6.25 * y)


def triangles():
    return wall(TriangleMesh.rectangle((2, 4), 1.0, 4.0))


def grid():
    return wall(TriangleMesh.rectangle((2, 4), 1.0, 4.0))


def wedge(friction=0.3):
    """A block on a plane that rises by 0.1, the weight 1 down and F sideways."""
    mesh = TriangleMesh.rectangle((1, 1), 6.0, 1.0)
    x, y = mesh.vertices.T
    mesh = TriangleMesh(np.column_stack([x, y + 0.1 * x]), mesh.cells, mesh.edge_sets)
    loads = [Traction("top", 0.0, -1.0 / math.hypot(6.0, 0.6)), Traction("left", 1.0, 0.0, name="F")]
    return ContactProblem(mesh, STEEL, [Contact("bottom", friction), *loads, Traction("right", 0.0, 0.0)])


def dry_stone_wall(friction):
    """Three courses of two blocks, 30 on the top, weight 24, the top course pushed from the left."""
    problem = example("dry_stone_wall").problem
    joints = {
        "lower bed": ((0.0, 1.0), (3.0, 1.0)), "upper bed": ((0.0, 2.0), (3.0, 2.0)),
        "head 1": ((1.5, 0.0), (1.5, 1.0)), "head 2": ((1.0, 1.0), (1.0, 2.0)), "head 3": ((1.5, 2.0), (1.5, 3.0)),
    }  # fmt: skip
    mesh = TriangleMesh.grid([0.0, 1.0, 1.5, 3.0], [0.0, 1.0, 2.0, 3.0], joints=joints)
    mesh = mesh.with_edges("pushed", lambda x, y: (x == 0.0) & (y > 2.0))
    mesh = mesh.with_edges("below", lambda x, y: (x == 0.0) & (y < 2.0))
    others = [replace(each, friction=friction) if isinstance(each, Contact) else each for each in problem.conditions]
    loads = [Traction("pushed", 1.0, 0.0, name="push"), Traction("below", 0.0, 0.0)]
    return replace(problem, mesh=mesh, conditions=[*loads, *(each for each in others if each.edges != "left")])


CASES = {
    "wall tips": (triangles, ["wind"], {}, 6.25),
    "wedge": (wedge, ["F"], {}, 0.4 / 0.97),
    "dragged block": (lambda: example("dragged_block_slides").problem, ["drag"], {}, 1.0 / 1.01),
    "stones slide": (lambda: dry_stone_wall(0.6), ["push"], {}, 0.6 * 162.0),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_both_sides_agree(case):
    made, loads, options, exact = CASES[case]
    problem = made()
    found = refined(problem, *loads, **options)
    assert found.status is RefinementStatus.REACHED, found.message
    assert found.limit.upper == pytest.approx(exact, rel=1e-9)
    assert (1.0 - TARGET) * exact <= found.limit.lower <= exact * (1.0 + 1e-9)
    assert (found.value, found.unit) == (found.limit.lower, found.limit.upper)
    assert found.estimate == pytest.approx(max(1.0 - found.limit.lower / found.limit.upper, 0.0), abs=1e-12)
    assert found.indicator.sum() == pytest.approx(found.estimate)
    assert found.rounds[-1].unknowns <= 1500
    assert found.guaranteed


def test_only_at_the_toe():
    """Every round quarters the distance, with cells beside the toe only."""
    found = refined(triangles(), "wind", target=1e-4)
    assert found.status is RefinementStatus.REACHED
    assert found.guaranteed
    estimates = [each.estimate for each in found.rounds]
    assert all(second < 0.3 * first for first, second in pairwise(estimates))
    corners = found.problem.mesh.vertices[found.problem.mesh.cells]
    far = np.hypot(*np.moveaxis(corners - [1.0, 0.0], -1, 0)).min(axis=1) > 1.5
    assert far.sum() <= 32
    assert found.indicator[far].sum() <= 1e-3 * found.estimate


def test_loads_that_the_mesh_cannot_follow_give_an_estimate():
    problem = wall(TriangleMesh.rectangle((2, 4), 1.0, 4.0), wind=lambda _, y: np.sin(math.pi * y / 4.0))
    found = refined(problem, "wind", target=1e-2, degree=3)
    assert found.status is RefinementStatus.REACHED
    assert not found.guaranteed
    assert "estimated" in found.message


def test_any_multiple_and_none():
    problem = triangles()
    found = refined(problem, "body")
    assert (found.status, found.value, found.estimate) == (RefinementStatus.REACHED, math.inf, 0.0)
    ice = replace(problem, conditions=[Contact("bottom", 0.0, name="base"), *problem.conditions[1:]])
    assert refined(ice, "top").value == -math.inf


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ({"max_rounds": 2}, RefinementStatus.ROUNDS),
        ({"max_unknowns": 300}, RefinementStatus.UNKNOWNS),
        ({"thinnest": 0.05}, RefinementStatus.THIN_CELLS),
    ],
)
def test_ends(options, status):
    found = refined(triangles(), "wind", **options)
    assert found.status is status
    assert found.guaranteed
    assert TARGET < found.estimate < 0.3
    assert found.limit.lower < found.limit.upper == pytest.approx(6.25)


@pytest.mark.parametrize("options", [{"method": "uzawa"}, {"degree": 2}, {"max_unknowns": 10}, {"element": "bfs"}])
def test_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        refined(triangles(), "wind", **options)
