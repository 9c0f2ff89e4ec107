"""The elastic body by itself: shape functions, stiffness, numbering; the same answer in other units and places."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import factorial

from qvi_contact import Contact, ContactProblem, InputError, Material, Region, Symmetry, Traction, TriangleMesh
from qvi_contact.companion import DisplacementSpace, Elasticity, Triangle, moduli, reference_matrices, solve_companion
from qvi_contact.discretization import Scales
from solvers import Status
from tests.qvi_contact.builders import bernstein

CELLS = [Triangle(degree) for degree in (1, 2, 3, 4, 5)]
L_SHAPE = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0]], dtype=bool)


def notched():
    """An L of two materials, cut by a joint."""
    mesh = TriangleMesh.grid([0.0, 0.5, 1.1, 2.0], [0.0, 0.4, 0.7, 1.0], L_SHAPE).with_joint(
        "cut", lambda _, y: np.isclose(y, 0.4)
    )
    conditions = [Symmetry("bottom"), Symmetry("left"), Traction("right", 1.0, 0.0), Traction("top", 0.0, -1.0)]
    regions = [Region(Material(50.0, 0.45), x=(0.5, 1.1))]
    return ContactProblem(mesh, Material(100.0, 0.2), [*conditions, Contact("cut", 0.3)], regions=regions)


def body_of(problem, degree):
    scales = Scales.of(problem)
    space = DisplacementSpace.of(problem, Triangle(degree), scales.length)
    return Elasticity(space, moduli(problem, scales))


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: str(cell.degree))
class TestCells:
    """Shape functions of the reference cells."""

    T = np.random.default_rng(0).uniform(0.05, 0.45, size=(7, 2))

    def test_functions_are_positive_and_sum_to_one(self, cell):
        values = cell.values(self.T)
        assert values.min() >= 0.0
        assert values.sum(axis=1) == pytest.approx(1.0, abs=1e-14)

    def test_derivatives(self, cell):
        c, step = np.random.default_rng(1).normal(size=len(cell.places)), 1e-6
        for axis in (0, 1):
            shift = step * np.eye(2)[axis]
            slope = (cell.values(self.T + shift) - cell.values(self.T - shift)) @ c / (2 * step)
            found = cell.derivative_values(self.T) @ (cell.differences[axis] @ c)
            assert found == pytest.approx(slope, abs=1e-7)

    def test_quadrature_is_exact_to_its_degree(self, cell):
        t, weights = cell.quadrature(cell.degree)
        for i, j in zip(*np.triu_indices(cell.degree + 1), strict=True):
            exact = factorial(i) * factorial(j - i) / factorial(j + 2)
            assert weights @ (t[:, 0] ** i * t[:, 1] ** (j - i)) == pytest.approx(exact, rel=1e-13)

    def test_sides_carry_the_trace(self, cell):
        """Along a side the function is the polynomial of the side's coefficients, in its direction."""
        c, t = np.random.default_rng(2).normal(size=len(cell.places)), np.linspace(0.0, 1.0, 5)
        corners = cell.places[cell.corners]
        pairs = np.argwhere(cell.sides[:, :, 0] >= 0)
        assert len(pairs) == 2 * len(corners)
        for first, last in pairs:
            line = corners[first] + t[:, None] * (corners[last] - corners[first])
            along = bernstein(cell.degree, t) @ c[cell.sides[first, last]]
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


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: str(cell.degree))
class TestStiffness:
    """K of a body with joint, notch and two materials."""

    def body(self, cell):
        return body_of(notched(), cell.degree)

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


def test_places_of_the_joint_are_doubled():
    problem = notched()
    space = DisplacementSpace.of(problem, Triangle(3), 1.0)
    edges = problem.mesh.edges("cut")
    below, above = space.along(edges), space.along(edges, other=True)
    assert not np.intersect1d(below, above).size
    assert space.places[below] == pytest.approx(space.places[above])
    assert (space.owner[below] != space.owner[above]).all()


@pytest.fixture(scope="module")
def cut():
    return solve_companion(notched(), degree=3)


class TestFields:
    """Values at points, in cells and at corners are of one field."""

    def test_strain_and_stress_of_cells(self, cut):
        tx, ty = np.array([0.1, 0.2]), np.array([0.3, 0.7])
        strain, stress = cut.cell_strain(tx, ty), cut.cell_stress(tx, ty)
        assert np.einsum("ckl,cql->cqk", cut.problem.compliances, stress) == pytest.approx(strain, abs=1e-14)
        places = cut.cell_points(tx, ty)
        assert cut.stress(places[..., 0], places[..., 1]) == pytest.approx(stress, abs=1e-11)
        assert cut.displacement(places[..., 0], places[..., 1]) == pytest.approx(
            cut.cell_displacement(tx, ty), abs=1e-13
        )

    def test_corners(self, cut):
        found = cut.cell_displacement([0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
        assert cut.nodal_displacements == pytest.approx(found, abs=1e-13)

    def test_on_the_joint_the_mean_of_both_sides(self, cut):
        near = 1e-9
        mean = (cut.displacement(0.2, 0.4 - near) + cut.displacement(0.2, 0.4 + near)) / 2
        assert cut.displacement(0.2, 0.4) == pytest.approx(mean, abs=1e-9)

    @pytest.mark.parametrize("place", [(1.5, 0.8), (-0.1, 0.2), (2.0 + 1e-6, 0.1)])
    def test_outside(self, cut, place):
        with pytest.raises(InputError, match="points of the body"):
            cut.displacement(*place)


WIDTH, HEIGHT = 1.5, 1.0
LINES = [0.0, 0.5, 0.9, 1.2, 1.4, 1.5], [0.0, 0.4, 0.8, 1.0]


def plate(place=lambda points: points, length=1.0, stress=1.0, bounds=None):
    """The compressed plate on a mesh whose vertices are elsewhere."""
    conditions = [Contact("top", 0.12, gap=-1e-3 * length), Traction("right", 0.0, 0.0)]
    conditions += [Symmetry("bottom"), Symmetry("left")]
    problem = ContactProblem(TriangleMesh.grid(*LINES), Material(2.09e5 * stress, 0.3), conditions)
    mesh = TriangleMesh(length * place(problem.mesh.vertices), problem.mesh.cells, problem.mesh.edge_sets)
    normal = [Traction("right", normal=0.0, tangential=0.0)]
    conditions = [normal[0] if isinstance(each, Traction) else each for each in problem.conditions]
    companion = solve_companion(replace(problem, mesh=mesh, conditions=conditions), degree=3, bounds=bounds)
    assert companion.status is Status.SOLVED
    return companion


@pytest.fixture(scope="module")
def original():
    return plate()


def points():
    return np.random.default_rng(3).uniform(0.02, 0.98, size=(40, 2)) * [WIDTH, HEIGHT]


@pytest.mark.parametrize(("length", "stress"), [(1e3, 1.0), (1.0, 1e6), (1e-6, 1e-3)])
def test_units(original, length, stress):
    other = plate(length=length, stress=stress)
    x, y = points().T
    found = other.displacement(length * x, length * y) / length
    assert found == pytest.approx(original.displacement(x, y), abs=1e-8 * 1e-3)
    assert other.stress(length * x, length * y) / stress == pytest.approx(original.stress(x, y), abs=1e-6 * 209)
    assert other.energy / (stress * length**2) == pytest.approx(original.energy, rel=1e-9)
    assert other.parts.friction / (stress * length**2) == pytest.approx(original.parts.friction, rel=1e-7)
    ours, theirs = original.contacts["top"], other.contacts["top"]
    assert theirs.slip / length == pytest.approx(ours.slip, abs=1e-8 * 1e-3)
    assert theirs.normal_stress / stress == pytest.approx(ours.normal_stress, abs=1e-6 * 209)
    assert other.cell_strain([0.3], [0.6]) == pytest.approx(original.cell_strain([0.3], [0.6]), abs=1e-9)


def test_a_bound_that_varies_follows_the_edges():
    """Bernstein coefficients run along +x on each edge: mirrored, they come in the opposite order."""
    s = np.random.default_rng(5).uniform(5.0, 30.0, size=(5, 3))

    def mirrored(points):
        return points * [-1.0, 1.0]

    one, other = plate(bounds={"top": s}), plate(mirrored, bounds={"top": s[:, ::-1]})
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    assert plate(mirrored, bounds={"top": s}).energy != pytest.approx(one.energy, rel=1e-6)
