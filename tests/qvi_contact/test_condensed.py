"""The condensed method on bodies: few iterations, settled values, answers of the fixed point, folds of the path."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from qvi_contact import TriangleMesh, discretize, solve, solve_companion
from qvi_contact.gallery import compressed_plate, ssnv128
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, RigidPlate, Traction
from solvers import Status
from solvers.condensed import CentralPath, Complementarity, DenseCoordinates, InteriorPoint, PathWeights
from tests.cases import thinned
from tests.qvi_contact.builders import with_friction, with_line

FRICTIONS = (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.5, 1.0, 2.0)
FEW = 25
STEEL, SOFT = Material(1000.0, 0.3), Material(100.0, 0.4)


def in_turn(*meshes):
    """Every coefficient of friction, on one mesh after the other."""
    return [(friction, *meshes[number % len(meshes)]) for number, friction in enumerate(FRICTIONS)]


def solved_in_few(problem):
    result = solve(problem, method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert result.iterations <= FEW
    return result


@cache
def plate_on(cells, grading):
    return discretize(compressed_plate(1.0, (cells, cells), grading=grading))


@pytest.mark.parametrize(
    ("friction", "cells", "grading"),
    thinned(product(FRICTIONS, (2, 4, 8, 16), (1.0,)), 7) + thinned(in_turn((16, 0.7), (24, 0.8)), 3),
)
def test_few_iterations_on_the_plate(friction, cells, grading):
    solved_in_few(with_friction(plate_on(cells, grading), friction))


def free(*sides):
    return [Traction(side, 0.0, 0.0) for side in sides]


def on_lines(*conditions, joints=(), **options):
    mesh = TriangleMesh.grid([0.0, 0.3, 0.8, 1.5], [0.0, 0.3, 0.7, 1.0])
    for joint in joints:
        mesh = with_line(mesh, *joint)
    return ContactProblem(mesh, STEEL, [*conditions], **options)


def moved(base, x, y):
    """A body on a base of this law, moved by its top."""
    return on_lines(replace(base, name="base"), *free("left", "right"), Displacement("top", x=x, y=y))


def joint():
    joints = [("a", "horizontal", 0.3), ("b", "vertical", 0.8, 0.3, 1.0)]
    conditions = [Contact("a", 0.2), Contact("b", 0.1, gap=1e-3), Displacement("bottom", 0.0, 0.0)]
    push = Displacement("top", x=4e-3, y=lambda x, _: -4e-3 + 3e-3 * x)
    return on_lines(*conditions, push, *free("left", "right"), joints=joints, regions=[Region(SOFT, y=(0.0, 0.3))])


def driven():
    plate = Contact("top", 0.3, plate=RigidPlate(force_x=1.5, force_y=-8.0, moment=-5.0), name="plate")
    return on_lines(Contact("bottom", 0.25, name="base"), plate, *free("left", "right"))


def several():
    return on_lines(
        Contact("bottom", 0.2, cohesion=0.5, shear_limit=8.0, name="ground"),
        Contact("left", 0.1, law="bilateral", cohesion=0.2, name="rail"),
        Traction("right", x=lambda _, y: 16.0 * y * (1.0 - y), y=0.0),
        Contact("top", 0.3, plate=RigidPlate(force_y=-60.0, moment=-50.0), name="plate"),
        Contact("bed", 0.02, cohesion=0.3, name="bed"),
        joints=[("bed", "horizontal", 0.7)],
    )


BODIES = {
    "opening": ssnv128((6, 6)),
    "cohesion": moved(Contact("bottom", 0.2, cohesion=2.0), 8e-3, lambda x, _: -4e-3 + 6e-3 * x),
    "cap": moved(Contact("bottom", 0.5, shear_limit=1.5), 1e-2, -5e-3),
    "tresca": moved(Contact.tresca("bottom", 0.8), 4e-3, lambda x, _: -4e-3 + 5e-3 * x),
    "bilateral": moved(Contact("bottom", 0.3, law="bilateral"), 3e-3, lambda x, _: -4e-3 + 6e-3 * x),
    "joint": joint(),
    "driven": driven(),
    "several": several(),
}


@pytest.mark.parametrize(
    ("name", "inner"), [("several", "direct:clarabel"), *thinned(product(BODIES, ("direct:clarabel", "qp:daqp")), 5)]
)
def test_same_tractions_as_the_fixed_point(name, inner):
    problem = BODIES[name]
    result = solved_in_few(problem)
    reference = solve(problem, inner=inner, tolerance=1e-9)
    assert reference.status is Status.SOLVED
    scale = max(np.abs(line.normal_stress).max() for line in reference.contacts.values())
    for key, line in reference.contacts.items():
        found = result.contacts[key]
        assert found.normal_stress == pytest.approx(line.normal_stress, abs=1e-7 * scale)
        assert found.tangential_stress == pytest.approx(line.tangential_stress, abs=1e-7 * scale)
        slip = np.abs(line.slip).max()
        assert found.slip == pytest.approx(line.slip, abs=1e-6 * max(slip, 1e-4))


@pytest.mark.parametrize("iterations", [3, 4])
def test_the_central_path_is_followed_from_an_early_iterate_until_it_has_fallen(iterations):
    """μ = 3 on 8² cells, begun as the method begins, with a share that leads into folds.

    Once found, s λ over ω stays within a factor of two of its mean, though every step is only one Newton step.
    """
    qvi = discretize(ssnv128((8, 8), 3.0)).qvi
    space = DenseCoordinates(qvi)
    base = space.base(np.zeros(qvi.n))
    bonded = space.bonded(base)
    stress = np.abs(base.tractions + space.E @ bonded).max()
    problem = Complementarity(qvi, space, base, stress, PathWeights(1000.0, 1000.0))
    interior = InteriorPoint(problem, stress / qvi.contact_stiffness)
    interior.start_at(problem.restricted(bonded))
    for _ in range(iterations):
        interior.iterate(interior.residuals())
    path, start, near = CentralPath(interior), interior.parameter(), []
    while not (path.passed or path.lost):
        path.advance()
        products = interior.point.s * interior.point.lam / problem.omega
        assert (products > 0.0).all()
        near.append((np.abs(products / products.mean() - 1.0) < 1.0).all())
    assert path.passed
    assert not path.lost
    assert np.log(interior.parameter()) < np.log(start) - 2.0
    first = near.index(True)
    assert first < len(near) / 2
    assert np.mean(near[first:]) > 0.9


@pytest.mark.parametrize(("friction", "cells"), [(3.0, 16), (4.0, 8), (5.0, 32)])
def test_large_friction(friction, cells):
    result = solve(ssnv128((cells, cells), friction), method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert result.iterations <= 20
    base = result.contacts["base"]
    assert base.normal_force == pytest.approx(2e6, rel=1e-8)
    assert -1.7e6 < base.tangential_force < -1.6e6
    if cells == 16:
        companion = solve_companion(result.problem)
        assert base.tangential_force == pytest.approx(companion.contacts["base"].tangential_force, rel=2e-3)


def test_a_corner_bisected_twenty_times_is_solved_near_the_bonded_state():
    """Everything sticks, and the multipliers of the usual start bend the path at the corner's tiny triangles."""
    problem = compressed_plate(2.0, (2, 2))
    mesh = problem.mesh
    for _ in range(20):
        corner = np.argmin(((mesh.vertices - 1.0) ** 2).sum(axis=1))
        mesh = mesh.refined(np.flatnonzero((mesh.cells == corner).any(axis=1)))
    result = solve(replace(problem, mesh=mesh), method="condensed")
    assert result.status is Status.SOLVED, result.message
    assert len(result.solution.attempts) <= 2


def test_a_long_bar_of_few_unknowns_whose_sides_are_free():
    """So many degrees of freedom follow from others that their factors are sparse, although K is not."""
    held = [Contact("left", 0.3), Displacement("right", -1e-3, 0.0), Traction("bottom", 0, 0), Traction("top", 0, 0)]
    bar = ContactProblem(TriangleMesh.rectangle((130, 1), width=13.0), Material(1.0, 0.3), held)
    result = solve(bar, degree=3)
    assert not isinstance(result.discretization.supports.basis.factors, np.ndarray)
    assert result.contacts["left"].normal_force == pytest.approx(1e-3 / 13.0, rel=2e-4)
