"""The elastic body by itself: shape functions, stiffness, numbering, and states the elements contain."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    InputError,
    Material,
    RectilinearMesh,
    Region,
    Symmetry,
    Traction,
    exact,
)
from qvi_contact.companion import solve_companion
from qvi_contact.companion.cell import reference_matrices
from qvi_contact.companion.cells import cell_for
from qvi_contact.companion.elasticity import Elasticity
from qvi_contact.companion.rectangle import Rectangle
from qvi_contact.companion.solver import moduli
from qvi_contact.companion.space import Space
from qvi_contact.companion.triangle import Triangle
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from solvers import Status
from tests.covering import every_pair
from tests.effort import thinned

CELLS = [Rectangle(2), Rectangle(3), Rectangle(4), *(Triangle(degree) for degree in (1, 2, 3, 4, 5))]
MESHES = {
    "one cell": RectilinearMesh.rectangle((1, 1), 2.0, 1.0, origin=(0.0, -0.5)),
    "graded": RectilinearMesh.rectangle((6, 5), 2.0, 1.0, origin=(0.0, -0.5), grading=(0.4, 2.0)),
    "far away": RectilinearMesh([1e3, 1e3 + 0.02, 1e3 + 2.0], [-0.5, -0.1, 0.5]),
}
STATES = {
    "compression": (2, lambda material: exact.uniform(material, yy=-10.0)),
    "simple shear": (2, lambda material: exact.uniform(material, xy=5.0)),
    "bending": (2, lambda material: exact.pure_bending(material, 7.0)),
    "cantilever": (3, lambda material: exact.cantilever(material, 3.0, -3.0 / 8)),
    "column": (2, lambda material: exact.gravity_column(material, 4.0, 0.5)),
}
SIDES = {
    "held below": ("uu", "tt", "tt", "tt"),
    "tractions": ("tt", "tt", "tt", "tt"),
    "mixed": ("tu", "ut", "tu", "ut"),
}
L_SHAPE = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0]], dtype=bool)


def notched():
    """An L of two materials, cut by a joint."""
    mesh = RectilinearMesh([0.0, 0.5, 1.1, 2.0], [0.0, 0.4, 0.7, 1.0], L_SHAPE).with_joint("cut", "horizontal", 0.4)
    conditions = [Symmetry("bottom"), Symmetry("left"), Traction("right", 1.0, 0.0), Traction("top", 0.0, -1.0)]
    regions = [Region(Material(50.0, 0.45), x=(0.5, 1.1))]
    return ContactProblem(mesh, Material(100.0, 0.2), [*conditions, Contact("cut", 0.3)], regions=regions)


def body_of(problem, degree):
    scales = Scales.of(problem)
    space = Space.of(problem, cell_for(problem.mesh, degree), scales.length)
    return Elasticity(space, moduli(problem, scales))


def name_of(cell):
    return f"{type(cell).__name__} {cell.degree}"


@pytest.mark.parametrize("cell", CELLS, ids=name_of)
class TestCells:
    """Shape functions of the reference cells."""

    T = np.random.default_rng(0).uniform(0.05, 0.45, size=(7, 2))

    def test_functions_are_positive_and_sum_to_one(self, cell):
        values = cell.values(self.T)
        assert values.min() >= 0.0
        assert values.sum(axis=1) == pytest.approx(1.0, abs=1e-14)

    def test_places_are_the_values_of_linear_functions(self, cell):
        assert cell.values(self.T) @ cell.places == pytest.approx(self.T, abs=1e-14)

    def test_derivatives(self, cell):
        c, step = np.random.default_rng(1).normal(size=len(cell.places)), 1e-6
        for axis in (0, 1):
            shift = step * np.eye(2)[axis]
            slope = (cell.values(self.T + shift) - cell.values(self.T - shift)) @ c / (2 * step)
            found = cell.derivative_values(axis, self.T) @ (cell.differences[axis] @ c)
            assert found == pytest.approx(slope, abs=1e-7)

    def test_sides_carry_the_trace(self, cell):
        """Along a side the function is the polynomial of the side's coefficients, in its direction."""
        c, t = np.random.default_rng(2).normal(size=len(cell.places)), np.linspace(0.0, 1.0, 5)
        corners = cell.places[cell.corners]
        pairs = np.argwhere(cell.sides[:, :, 0] >= 0)
        assert len(pairs) == 2 * len(corners)
        for first, last in pairs:
            line = corners[first] + t[:, None] * (corners[last] - corners[first])
            along = bernstein.basis(cell.degree, t) @ c[cell.sides[first, last]]
            assert cell.values(line) @ c == pytest.approx(along, abs=1e-13)

    def test_reference_matrices(self, cell):
        """∫ ∂_x u ∂_y v of u = x² and v = x y is ∫ 2x²; of degree 1 u = x, v = y: the area."""
        x, y = cell.places.T
        t, weights = cell.quadrature(4)
        if cell.degree == 1:
            u, v, expected = x, y, cell.area
        else:
            exact_at = cell.quadrature(cell.degree + 2)[0]
            to = np.linalg.pinv(cell.values(exact_at))
            u, v = to @ exact_at[:, 0] ** 2, to @ exact_at.prod(axis=1)
            expected = float(weights @ (2.0 * t[:, 0] ** 2))
        assert u @ reference_matrices(cell)[0, 1] @ v == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("cell", CELLS, ids=name_of)
class TestStiffness:
    """K of a body with joint, notch and two materials."""

    def body(self, cell):
        problem = notched()
        return body_of(problem.triangulated() if isinstance(cell, Triangle) else problem, cell.degree)

    def test_it_is_the_energy(self, cell):
        body = self.body(cell)
        v = np.random.default_rng(1).normal(size=body.space.size)
        K = body.stiffness()
        assert body.force(v) == pytest.approx(K @ v, abs=1e-10)
        assert body.energy(v) == pytest.approx(0.5 * v @ (K @ v), rel=1e-12)

    def test_each_block_moves_freely(self, cell):
        """Three rigid motions each, no more: the joint separates the blocks, and nothing else does."""
        body = self.body(cell)
        K = body.stiffness()
        motions = body.space.rigid()
        assert motions.shape[1] == 6
        assert np.abs(K @ motions).max() < 1e-12
        values = np.linalg.eigvalsh(K.toarray())
        assert values[5] < 1e-12 < 1e-5 < values[6]

    def test_energy_does_not_feel_a_large_motion(self, cell):
        body = self.body(cell)
        v = np.random.default_rng(2).normal(size=body.space.size)
        shifted = v + 1e6 * body.space.rigid()[:, :3].sum(axis=1)
        assert body.energy(shifted) == pytest.approx(body.energy(v), rel=1e-8)


@pytest.mark.parametrize("problem", [notched(), notched().triangulated()], ids=["rectangles", "triangles"])
def test_places_of_the_joint_are_doubled(problem):
    space = Space.of(problem, cell_for(problem.mesh, 3), 1.0)
    edges = problem.mesh.edges("cut")
    below, above = space.along(edges), space.along(edges, other=True)
    assert not np.intersect1d(below, above).size
    assert space.places[below] == pytest.approx(space.places[above])
    assert (space.owner[below] != space.owner[above]).all()


def points_of(mesh, count=40):
    t = np.random.default_rng(7).uniform(size=(2, count))
    return mesh.x[0] + t[0] * np.ptp(mesh.x), mesh.y[0] + t[1] * np.ptp(mesh.y)


@pytest.mark.parametrize(
    ("state", "mesh", "plane"), thinned(every_pair(list(STATES), list(MESHES), ["stress", "strain"]), 8)
)
def test_states_the_elements_contain(state, mesh, plane):
    material, mesh, (degree, state) = Material(1000.0, 0.3, plane), MESHES[mesh], STATES[state]
    state = state(material)
    x, y = points_of(mesh)
    stress, displacement = (np.moveaxis(part(x, y), 0, -1) for part in (state.stress, state.displacement))
    rounding = max(1.0, abs(mesh.x[0]))  # of the data, as displacements there are
    for kinds in SIDES.values():
        sides = dict(zip(("bottom", "right", "top", "left"), kinds, strict=True))
        problem = exact.problem_from_state(state, mesh, material, sides)
        companion = solve_companion(problem, degree=degree)
        assert companion.status is Status.SOLVED
        assert companion.reasons == ()
        assert np.abs(companion.stress(x, y) - stress).max() < 1e-10 * np.abs(stress).max() * rounding
        if "u" in "".join(kinds):
            assert np.abs(companion.displacement(x, y) - displacement).max() < 1e-10 * np.abs(displacement).max()


def test_cantilever_needs_its_degree():
    """Degree 2 does not contain the cubic deflection."""
    material = Material(1000.0, 0.3)
    state = exact.cantilever(material, 3.0, -3.0 / 8)
    sides = {"bottom": "tt", "right": "tt", "top": "tt", "left": "uu"}
    companion = solve_companion(exact.problem_from_state(state, MESHES["graded"], material, sides), degree=2)
    x, y = points_of(MESHES["graded"])
    assert np.abs(companion.stress(x, y) - np.moveaxis(state.stress(x, y), 0, -1)).max() > 1e-3
    assert any("interpolated" in reason for reason in companion.reasons)  # nor does it meet the support exactly


@pytest.fixture(scope="module")
def cut():
    return solve_companion(notched(), degree=3)


class TestFields:
    """Values at points, in cells and at corners are of one field."""

    def test_strain_and_stress_of_cells(self, cut):
        tx, ty = np.array([0.1, 0.9]), np.array([0.3, 0.8])
        strain, stress = cut.cell_strain(tx, ty), cut.cell_stress(tx, ty)
        assert np.einsum("ckl,cql->cqk", cut.problem.compliances, stress) == pytest.approx(strain, abs=1e-14)
        places = cut.cell_points(tx, ty)
        assert cut.stress(places[..., 0], places[..., 1]) == pytest.approx(stress, abs=1e-11)
        assert cut.displacement(places[..., 0], places[..., 1]) == pytest.approx(
            cut.cell_displacement(tx, ty), abs=1e-13
        )

    def test_corners(self, cut):
        found = cut.cell_displacement([0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0])
        assert cut.nodal_displacements == pytest.approx(found, abs=1e-13)

    def test_on_the_joint_the_mean_of_both_sides(self, cut):
        near = 1e-9
        mean = (cut.displacement(0.2, 0.4 - near) + cut.displacement(0.2, 0.4 + near)) / 2
        assert cut.displacement(0.2, 0.4) == pytest.approx(mean, abs=1e-9)

    @pytest.mark.parametrize("place", [(1.5, 0.8), (-0.1, 0.2), (2.0 + 1e-6, 0.1)])
    def test_outside(self, cut, place):
        with pytest.raises(InputError, match="points of the body"):
            cut.displacement(*place)
