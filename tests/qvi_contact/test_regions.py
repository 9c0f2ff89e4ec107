"""Bodies of several materials against closed forms."""

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
    Symmetry,
    Traction,
    exact,
    solve,
)
from solvers import Status

SOFT, STIFF = Material(100.0, 0.0), Material(400.0, 0.0)


def test_layers_in_series_and_side_by_side():
    """Without lateral strain, springs: in series the compliances add, side by side the stiffnesses."""
    mesh = RectilinearMesh([0.0, 0.5, 1.0], [0.0, 0.25, 1.0])
    squeezed = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", x=0, y=0), Contact("top", friction=0.3, gap=-0.1),
    ]  # fmt: skip
    series = solve(ContactProblem(mesh, SOFT, squeezed, regions=[Region(STIFF, y=(0.25, 1.0))]))
    assert series.status is Status.SOLVED
    pressure = 0.1 / (0.25 / 100 + 0.75 / 400)
    assert series.contacts["top"].normal_stress == pytest.approx(-pressure, rel=1e-10)
    assert series.stress(0.3, 0.6) == pytest.approx([0, -pressure, 0], abs=1e-8)
    beside = solve(ContactProblem(mesh, SOFT, squeezed, regions=[Region(STIFF, x=(0.5, 1.0))]))
    assert beside.status is Status.SOLVED
    assert beside.stress([0.2, 0.8], 0.5)[:, 1] == pytest.approx([-10.0, -40.0], rel=1e-10)


def test_bending_of_a_sandwich_follows_the_stiffness():
    """σ_xx = E(y) κ y under a prescribed curvature without lateral strain."""
    mesh = RectilinearMesh([0.0, 1.0, 2.0], [-0.5, -0.3, 0.0, 0.3, 0.5])
    faces = [Region(STIFF, y=(-0.5, -0.3)), Region(STIFF, y=(0.3, 0.5))]
    curvature = 1e-2

    def u_x(x, y):
        return curvature * x * y

    def u_y(x, y):
        return -curvature * x**2 / 2 + 0 * y

    ends = [Displacement(side, x=u_x, y=u_y) for side in ("left", "right")]
    free = [Traction(side, x=0.0, y=0.0) for side in ("bottom", "top")]
    result = solve(ContactProblem(mesh, SOFT, [*ends, *free], regions=faces))
    y = np.array([-0.45, -0.2, 0.1, 0.4])
    assert result.status is Status.SOLVED
    assert result.stress(1.3, y)[:, 0] == pytest.approx(curvature * y * np.array([400, 100, 100, 400]), rel=1e-9)


def test_one_material_in_pieces_is_one_material():
    material = Material(1000.0, 0.3)
    mesh = RectilinearMesh.rectangle((4, 3), 2.0, 1.0, origin=(0.0, -0.5), grading=0.8)
    state = exact.gravity_column(material, 5.0, 0.5)
    problem = exact.problem_from_state(state, mesh, material, dict.fromkeys(("bottom", "right", "top", "left"), "uu"))
    pieces = ContactProblem(
        mesh, Material(1.0, 0.0), problem.conditions, problem.body_potential,
        [Region(SOFT), Region(material, x=(0.0, mesh.x[2])), Region(material, x=(mesh.x[2], 2.0))],
    )  # fmt: skip
    x, y, stress = solve(pieces).gauss_stress()
    assert stress == pytest.approx(np.moveaxis(state.stress(x, y), 0, -1), abs=1e-10)


@pytest.mark.parametrize(
    ("regions", "field"),
    [
        ([Region(SOFT, x=(0.0, 0.3))], "Region.x"),
        ([Region(SOFT, y=(1.0, 0.0))], "Region.y"),
        ([Region(Material(1.0, 0.0, "strain"))], "Region.material"),
        ("soft", "ContactProblem.regions"),
    ],
)
def test_bad_regions_are_refused(regions, field):
    mesh = RectilinearMesh.rectangle((2, 2))
    conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0, y=0), Traction("top", x=0, y=0)]
    with pytest.raises(InputError) as caught:
        ContactProblem(mesh, SOFT, conditions, regions=regions)
    assert caught.value.field == field
