"""States that bicubic Airy functions contain are found to round-off, whatever is prescribed and wherever."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Symmetry, Traction, exact, solve
from qvi_contact.gallery import compressed_plate, sliding_block
from solvers import Status
from tests.covering import every_pair
from tests.effort import thinned

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # bicubic states; triangles: test_triangles

MESHES = {
    "one cell": RectilinearMesh.rectangle((1, 1), 2.0, 1.0, origin=(0.0, -0.5)),
    "3x2 uniform": RectilinearMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5)),
    "graded": RectilinearMesh.rectangle((6, 5), 2.0, 1.0, origin=(0.0, -0.5), grading=(0.4, 2.0)),
    "strongly graded": RectilinearMesh([0, 0.01, 0.02, 0.5, 1.99, 2], [-0.5, -0.1, -0.09, 0.5]),
}
STATES = {
    "compression": lambda material: exact.uniform(material, yy=-10.0),
    "simple shear": lambda material: exact.uniform(material, xy=5.0),
    "bending": lambda material: exact.pure_bending(material, 7.0),
    "cantilever": lambda material: exact.cantilever(material, 3.0, -3.0 / 8),
    "column": lambda material: exact.gravity_column(material, 4.0, 0.5),
}
SIDES = {  # components x, y of bottom, right, top, left: t traction, u displacement
    "held below": ("uu", "tt", "tt", "tt"),
    "displacements": ("uu", "uu", "uu", "uu"),
    "tractions": ("tt", "tt", "tt", "tt"),
    "mixed": ("tu", "ut", "tu", "ut"),
    "mixed the other way": ("ut", "tu", "tt", "tu"),
}


def relative_error(result, state, count=60):
    """Largest error of the stress at random points over the largest stress."""
    mesh = result.problem.mesh
    points = np.random.default_rng(7).uniform(size=(2, count))
    x = mesh.x[0] + points[0] * (mesh.x[-1] - mesh.x[0])
    y = mesh.y[0] + points[1] * (mesh.y[-1] - mesh.y[0])
    expected = np.moveaxis(state.stress(x, y), 0, -1)
    return np.abs(result.stress(x, y) - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize(
    ("state", "mesh", "plane"), thinned(every_pair(list(STATES), list(MESHES), ["stress", "strain"]), 10)
)
def test_elastic_states(state, mesh, plane):
    material, state, mesh = Material(1000.0, 0.3, plane), STATES[state], MESHES[mesh]
    for kinds in SIDES.values():
        sides = dict(zip(("bottom", "right", "top", "left"), kinds, strict=True))
        result = solve(exact.problem_from_state(state(material), mesh, material, sides))
        assert result.status is Status.SOLVED
        assert relative_error(result, state(material)) < 1e-9


@pytest.mark.parametrize("plane", ["stress", "strain"])
@pytest.mark.parametrize(("cells", "grading"), [((1, 1), 1.0), ((3, 2), 1.0), ((5, 5), 0.3)])
class TestPlate:
    """The paper's plate where its answer is known."""

    def test_without_friction(self, cells, grading, plane):
        result = solve(compressed_plate(0.0, cells, plane=plane, grading=grading, width=2.0))
        modulus = 2.09e5 if plane == "stress" else 2.09e5 / (1 - 0.3**2)
        assert result.status is Status.SOLVED
        assert result.contacts["plate"].normal_force == pytest.approx(2.0 * modulus * 1e-3, rel=1e-9)
        expected = exact.uniform(result.problem.material, yy=-modulus * 1e-3)
        assert relative_error(result, expected) < 1e-9

    @pytest.mark.parametrize("friction", [0.05, 0.5])
    def test_without_lateral_strain(self, cells, grading, plane, friction):
        result = solve(compressed_plate(friction, cells, poisson=0.0, plane=plane, grading=grading))
        assert result.status is Status.SOLVED
        assert relative_error(result, exact.uniform(result.problem.material, yy=-209.0)) < 1e-9

    @pytest.mark.parametrize("friction", [0.0, 0.2])
    def test_side_pressure_that_stops_the_slip(self, cells, grading, plane, friction):
        material = Material(2.09e5, 0.3, plane)
        c = material.compliance
        side = -c[0, 1] / c[0, 0] * -200.0  # σ_xx with ε_xx = 0: ν σ_yy in plane stress
        state = exact.uniform(material, xx=side, yy=-200.0)
        gap = float(state.displacement(np.array(0.0), np.array(1.0))[1])
        mesh = RectilinearMesh.rectangle(cells, grading=grading)
        conditions = [
            Symmetry("left"),
            Symmetry("bottom"),
            Traction("right", x=side, y=0.0),
            Contact("top", friction=friction, gap=gap),
        ]
        result = solve(ContactProblem(mesh, material, conditions))
        assert result.status is Status.SOLVED
        assert relative_error(result, state) < 1e-9
        assert np.abs(result.contacts["top"].slip).max() < 1e-9 * abs(gap)


@pytest.mark.parametrize(
    ("inner", "mesh", "plane"),
    every_pair(
        ["qp:clarabel", "direct:clarabel", "socp:clarabel"],
        [((1, 1), 1.0), ((3, 2), 1.0), ((5, 4), 0.5)],
        ["stress", "strain"],
    ),
)
def test_full_slip(inner, mesh, plane):
    """The outer iteration contracts by about a half here, so its residual is asked to be well below the error."""
    problem, state = sliding_block(mesh[0], plane=plane, grading=mesh[1])
    result = solve(problem, inner=inner, tolerance=1e-9)
    base = result.contacts["base"]
    assert result.status is Status.SOLVED
    assert relative_error(result, state) < 1e-8
    assert base.slip == pytest.approx(state.displacement(base.x, base.y)[0], rel=1e-8)
    assert base.gap == pytest.approx(0.0, abs=1e-8)
    assert (base.state == 2).all()
    assert base.normal_force == pytest.approx(200.0, rel=1e-8)
    assert base.tangential_force == pytest.approx(-60.0, rel=1e-8)  # friction pulls back what slips along +x
