"""The space of Airy functions on triangles: tractions, energy and its root, stresses at points, where Φ counts from."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.polynomial import polyder, polyval2d
from scipy.special import comb

from qvi_contact import Material, TriangleMesh, solve
from qvi_contact.discretization import BodyStiffness, Root, StressSpace, Supports, edge_rule
from qvi_contact.element import gauss_legendre, legendre_from_values
from qvi_contact.gallery import compressed_plate, exact
from solvers import Status
from solvers.basics import Kept
from tests.qvi_contact.test_triangles import moved

COMPLIANCE = np.array([[1.0, -0.3, 0.1], [-0.3, 1.2, -0.2], [0.1, -0.2, 2.6]])  # every coupling present
ISOTROPIC = Material(1.0, 0.3).compliance
T = np.linspace(0.0, 1.0, 5)


def unstructured(cells=3):
    """The unit square with inner vertices out of place and vertices numbered at random."""
    return moved(TriangleMesh.rectangle((cells, cells)), amount=0.25)


def derivatives(phi):
    """Functions (Φ, Φ_x, Φ_y, Φ_xx, Φ_yy, Φ_xy) of arrays x, y."""
    parts = [polyder(polyder(phi, i), j, axis=1) for i, j in ((0, 0), (1, 0), (0, 1), (2, 0), (0, 2), (1, 1))]
    return [lambda x, y, part=part: polyval2d(x, y, part) for part in parts]


def dofs_of(basis, phi):
    """Degrees of freedom of Φ, given by coefficients of x^i y^j in dimensionless coordinates."""
    value, dx, dy, xx, yy, xy = derivatives(phi)
    x, y = basis.vertices.T
    ends = basis.vertices[basis.mesh.topology.ends]
    along = ends[:, 1] - ends[:, 0]
    tx, ty = (along / np.hypot(*along.T)[:, None]).T[:, :, None]
    t, _ = gauss_legendre(basis.degree + 6)
    points = ends[:, :1] + along[:, None] * t[:, None]
    hessian = [f(points[..., 0], points[..., 1]) for f in (xx, yy, xy)]
    normal = tx * tx * hessian[0] + ty * ty * hessian[1] + 2.0 * tx * ty * hessian[2]
    twist = tx * ty * (hessian[1] - hessian[0]) + (tx * tx - ty * ty) * hessian[2]
    project = legendre_from_values(basis.degree - 2, len(t)).T
    on_edges = np.hstack([(normal @ project)[:, 2:], (twist @ project)[:, 1:]])
    values = np.concatenate([np.column_stack([value(x, y), dx(x, y), dy(x, y)]).ravel(), on_edges.ravel()])
    return values / basis.units


def polynomial(degree, seed=0):
    """A sum of powers of linear functions."""
    i, j = np.indices((degree + 1, degree + 1))
    ways, rest = comb(degree, i) * comb(degree - i, j), np.maximum(degree - i - j, 0)
    factors = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, degree + 1)).T
    return sum(ways * a**i * b**j * c**rest for a, b, c in factors)


def biharmonic(degree):
    """Re z^p + x Im z^(p−1): strains of an isotropic body are compatible, so that interiors of least energy know it."""
    phi = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        phi[degree - j, j] = comb(degree, j) * (1j**j).real + comb(degree - 1, j) * (1j**j).imag
    return phi


def stiffness(space, compliance):
    """A body of one material, of which nothing is prescribed."""
    materials = np.zeros(space.mesh.cell_count, dtype=int)
    return BodyStiffness.on(Supports.on(space, (), Kept()), materials, compliance[None], None, Kept())


@pytest.mark.parametrize("degree", [3, 6])
def test_tractions_on_edges_of_every_slope(degree):
    basis, phi = StressSpace(unstructured(), degree), polynomial(degree)
    u, (_, _, _, xx, yy, xy) = dofs_of(basis, phi), derivatives(phi)
    for edges in (basis.mesh.boundary, basis.mesh.interior):
        x, y = basis.mesh.points_along(edges, T)
        stress = np.array([[yy(x, y), -xy(x, y)], [-xy(x, y), xx(x, y)]])
        traction = np.einsum("ijeq,ej->eqi", stress, edges.normal)
        normal, shear = (np.einsum("eqi,ei->eq", traction, axis).ravel() for axis in (edges.normal, edges.tangent))
        size = np.abs(stress).max()
        assert basis.tractions(u, edges, T) == pytest.approx(np.stack([normal, shear]), abs=1e-11 * size)
        weights = np.random.default_rng(0).normal(size=(2, len(normal)))
        work = weights[0] @ normal + weights[1] @ shear
        assert basis.traction_load(*weights, edges, T) @ u == pytest.approx(work, abs=1e-11 * size * len(normal))


@pytest.mark.parametrize(("degree", "kind"), [(3, "edges"), (4, "points"), (7, "edges"), (7, "points")])
def test_rows_of_contacts_give_the_tractions_at_their_points(degree, kind):
    basis = StressSpace(unstructured(), degree)
    rule, edges = edge_rule(kind, degree), basis.mesh.edges("top")
    traces = basis.trace_rows([edges, basis.mesh.edges("left")], rule.points).matrix()
    u = np.random.default_rng(0).normal(size=basis.size)
    rows = (traces @ u).reshape(2, -1, degree - 1)[:, : len(edges)] @ rule.from_points.T
    for found, expected in zip(rows @ rule.to_points.T, basis.tractions(u, edges, rule.points), strict=True):
        assert found.ravel() == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())
    assert rule.shares.sum() == pytest.approx(1.0)
    if kind == "edges":  # the ends of an edge are coefficients
        ends = basis.tractions(u, edges, np.array([0.0, 1.0]))[0].reshape(-1, 2)
        assert rows[0][:, [0, -1]] == pytest.approx(ends, abs=1e-10 * np.abs(ends).max())


@pytest.mark.parametrize("degree", [3, 6])
def test_energy_of_a_polynomial_and_of_its_root(degree):
    basis, phi = StressSpace(unstructured(), degree), biharmonic(degree)
    u, body = dofs_of(basis, phi), stiffness(basis, ISOTROPIC)
    (t, w), (_, _, _, xx, yy, xy) = gauss_legendre(degree), derivatives(phi)
    x, y = np.meshgrid(t, t)
    stress = np.stack([yy(x, y), xx(x, y), -xy(x, y)])
    exact = 0.5 * np.einsum("iab,ij,jab,a,b->", stress, ISOTROPIC, stress, w, w)
    root, kept = Root(body, np.zeros(basis.size), None), body.supports.basis.kept
    z = (u - affine_at_gauge(basis, phi, kept))[kept]
    r = root.apply(z)
    assert 0.5 * r @ r == pytest.approx(exact, rel=1e-10)
    assert root.adjoint(r) == pytest.approx(body.matrix(Kept()).K @ z, abs=1e-9 * np.abs(r).max())
    assert 0.0 < root.rounding(z) < 1e-12 * np.linalg.norm(r)


def affine_at_gauge(basis, phi, kept):
    """Degrees of freedom of the affine function that Φ is at the gauge."""
    gauge = int(np.setdiff1d(np.arange(basis.size), kept)[0]) // 3
    x, y = basis.vertices[gauge]
    value, dx, dy = (part(x, y) for part in derivatives(phi)[:3])
    return dofs_of(basis, np.array([[value - dx * x - dy * y, dy], [dx, 0.0]]))


@pytest.mark.parametrize("degree", [3, 5])
def test_stresses_and_airy_function_at_points(degree):
    basis, phi = StressSpace(unstructured(), degree), biharmonic(degree)
    u, (value, _, _, xx, yy, xy) = dofs_of(basis, phi), derivatives(phi)
    coefficients = stiffness(basis, ISOTROPIC).coefficients(u, None)
    local = np.random.default_rng(1).dirichlet(np.ones(3), 6)
    cells = np.arange(basis.mesh.cell_count)
    for t in (local, np.broadcast_to(local, (len(cells), *local.shape))):
        x, y = np.moveaxis(basis.points(cells, t), -1, 0)
        exact = np.stack([yy(x, y), xx(x, y), -xy(x, y)], axis=-1)
        assert basis.stress(coefficients, cells, t) == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
        assert basis.airy(coefficients, cells, t) == pytest.approx(value(x, y), abs=1e-11 * np.abs(value(x, y)).max())


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_body_force_enters_load_and_root(degree):
    basis = StressSpace(unstructured(2), degree)
    cells = np.arange(basis.mesh.cell_count)
    points = basis.points(cells, basis.cell_quadrature[0])
    potential = 1.0 + points[..., 0] - 2.0 * points[..., 1]
    body = stiffness(basis, COMPLIANCE)
    root = Root(body, np.zeros(basis.size), body.loaded(potential[..., None] * np.array([1.0, 1.0, 0.0])))
    z = np.random.default_rng(0).normal(size=len(body.supports.basis.kept))
    coefficients = body.coefficients(body.supports.basis.expanded(z), root.body)
    stress = basis.stress(coefficients, cells, basis.cell_quadrature[0]) + potential[..., None] * np.array([1, 1, 0])
    weights = np.multiply.outer(basis.triangles.areas, basis.cell_quadrature[1])
    by_points = 0.5 * np.einsum("cg,cgi,ij,cgj->", weights, stress, COMPLIANCE, stress)
    r = root.apply(z)
    assert 0.5 * r @ r == pytest.approx(by_points, rel=1e-10)
    gradient = body.matrix(Kept()).K @ z + root.adjoint(root.apply(np.zeros(len(z))))
    assert root.adjoint(r) == pytest.approx(gradient, abs=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("divisions", [1, 2, 4])
def test_the_lattice_covers_a_triangle(divisions):
    points, parts = StressSpace(TriangleMesh.rectangle((1, 1)), 3).lattice(divisions)
    assert len(points) == 3 * (divisions + 1) * (divisions + 2) // 2
    edges = points[parts][:, 1:] - points[parts][:, :1]
    areas = np.abs(np.linalg.det(edges[:, :, 1:]))
    assert areas == pytest.approx(np.full(3 * divisions**2, 1.0 / (3.0 * divisions**2)))
    assert points.sum(axis=1) == pytest.approx(1.0)
    lowest = points.argmin(axis=1)[parts]  # in which part of the triangle: between them stresses may jump
    assert (lowest == lowest[:, :1]).all()
    assert np.bincount(lowest[:, 0]).tolist() == [divisions**2] * 3


CORNERS = [(0.0, 0.0), (1.0, 1.0)]


def graded(points, depth, cells=(2, 2)):
    return TriangleMesh.rectangle(cells).graded(points, depth)


class TestCentres:
    """Where Φ counts from."""

    @pytest.mark.parametrize("mesh", [graded(CORNERS, 0, (8, 8)), graded([(1.0, 1.0)], 30), graded(CORNERS, 6)])
    def test_one_is_enough(self, mesh):
        found = StressSpace(mesh, 3).frames
        assert len(found.centres) == len(found.cells_across) == 0

    def test_small_cells_have_one_near(self):
        space = StressSpace(graded([*CORNERS, (0.5, 0.5)], 20), 3)
        found = space.frames
        away = np.hypot(*(space.vertices - space.vertices[found.owner]).T)
        assert len(found.centres) == 3
        assert (away <= 501.0 * space.sizes).all()
        assert np.array_equal(found.owner[found.centres], found.centres)
        assert 0 < len(found.cells_across) < 0.2 * len(space.mesh.cells)


def quadratic(x, y):
    """Φ and its slopes."""
    return 3 * x**2 - 4 * x * y + y**2 + 5 + 7 * x - 9 * y, 6 * x - 4 * y + 7, 2 * y - 4 * x - 9


def of_a_quadratic(mesh):
    """A basis, its energy with c = 1, and the quadratic, of which Legendre coefficients above the lowest are zero."""
    basis = StressSpace(mesh, 4)
    counting, vertices = basis.frames, basis.vertices
    absolute = np.column_stack(quadratic(*vertices.T))
    moved = absolute[counting.owner]
    moved[:, 0] += ((vertices - vertices[counting.owner]) * moved[:, 1:]).sum(axis=1)
    counted = absolute - moved * (~counting.is_centre * len(counting.centres) > 0)[:, None]
    u = np.zeros(basis.size)
    u[: counted.size] = counted.ravel()
    return basis, stiffness(basis, np.eye(3)), u / basis.units


def test_a_quadratic_has_its_stress_and_its_energy():
    """σ_xx = 2, σ_yy = 6, σ_xy = 4 with two centres, in small cells of both."""
    mesh = graded(CORNERS, 14)
    basis, body, u = of_a_quadratic(mesh)
    normal, shear = basis.tractions(u, mesh.edges("left"), np.array([0.2, 0.7]))
    assert len(basis.frames.centres) == 2
    every, middle = np.arange(len(mesh.cells)), np.full((1, 3), 1.0 / 3.0)
    stress = basis.stress(body.coefficients(u, None), every, middle)[:, 0]
    assert stress == pytest.approx(np.tile([2.0, 6.0, 4.0], (len(mesh.cells), 1)), abs=1e-9)
    assert normal == pytest.approx(2.0, abs=1e-9)
    assert np.abs(shear) == pytest.approx(4.0, abs=1e-9)
    w = (body.roots @ basis.differences.apply(u)[:, :, None]).ravel()
    assert w @ w == pytest.approx(4.0 + 36.0 + 16.0, rel=1e-9)
    corner = np.eye(3)[1:2]
    airy, *_ = quadratic(*mesh.corners[:, 1].T)
    assert basis.airy(body.coefficients(u, None), every, corner)[:, 0] == pytest.approx(airy, abs=1e-12)


def test_the_root_of_the_energy_is_one():
    """R, Rᵀ and K as they are applied, also on triangles across parts."""
    basis, body, _ = of_a_quadratic(graded(CORNERS, 12))
    root = Root(body, np.zeros(basis.size), None)
    z = np.sin(np.arange(len(body.supports.basis.kept)))
    Rz = root.apply(z)
    r = np.cos(np.arange(len(Rz)))
    assert z @ root.adjoint(r) == pytest.approx(r @ Rz, rel=1e-9)
    assert z @ (body.matrix(Kept()).K @ z) == pytest.approx(Rz @ Rz, rel=1e-9)
    assert root.rounding(z) <= 1e-12 * np.linalg.norm(Rz)


@pytest.mark.parametrize("degree", [3, 5])
def test_loads_between_two_small_corners_are_met(degree):
    """Uniform stress, prescribed on all sides but one, in cells of 2^-24."""
    steel = Material(1000.0, 0.3)
    sides = ("bottom", "right", "top", "left")
    state, names = exact.uniform(steel, 3.0, -7.0, 2.0), dict(zip(sides, ("uu", "tt", "tt", "tt"), strict=True))
    result = solve(exact.problem_from_state(state, graded([(0.0, 1.0), (1.0, 1.0)], 24), steel, names), degree=degree)
    assert result.status is Status.SOLVED
    assert result.traction_misfit <= 1e-8
    assert result.stress_rounding <= 1e-8
    middles = result.problem.mesh.corners.mean(axis=1)
    assert result.stress(*middles.T) == pytest.approx(np.tile([3.0, -7.0, 2.0], (len(middles), 1)), abs=1e-6)


def test_a_slip_zone_ends_in_an_edge_of_a_millionth():
    """The transition of the plate, in edges of 2^-17 and of 2^-21: the force does not depend on how small they are."""
    problem = compressed_plate(0.2, (2, 2))
    meshes = [problem.mesh.graded([(1.0, 1.0), (0.749, 1.0)], depth) for depth in (16, 20)]
    results = [solve(replace(problem, mesh=mesh), degree=3, method="condensed") for mesh in meshes]
    assert [result.status for result in results] == [Status.SOLVED] * 2
    forces = [result.contacts["plate"].normal_force for result in results]
    assert forces[0] == pytest.approx(forces[1], rel=2e-11)
