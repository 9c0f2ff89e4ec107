"""The space of Airy functions on triangles: tractions, conditions, energy and its root, orders."""

import numpy as np
import pytest
import sympy
from scipy import sparse
from scipy.sparse.linalg import spsolve

from qvi_contact import Material
from qvi_contact.discretization.basis import PrescribedTraction, SharedCorners
from qvi_contact.discretization.elimination import UnbalancedLoadError
from qvi_contact.discretization.hsieh_clough_tocher.basis import TriangleBasis
from qvi_contact.discretization.hsieh_clough_tocher.condensed import potential_points
from qvi_contact.element import legendre
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.triangles import TriangleMesh

X, Y = sympy.symbols("x y")
COMPLIANCE = np.array([[1.0, -0.3, 0.1], [-0.3, 1.2, -0.2], [0.1, -0.2, 2.6]])  # every coupling present
ISOTROPIC = Material(1.0, 0.3).compliance
T = np.linspace(0.0, 1.0, 5)


def unstructured(cells=3, seed=0):
    """The unit square with inner vertices out of place and vertices numbered at random."""
    rng = np.random.default_rng(seed)
    mesh = TriangleMesh.rectangle((cells, cells))
    vertices = mesh.vertices.copy()
    inner = (vertices.min(axis=1) > 0.0) & (vertices.max(axis=1) < 1.0)
    vertices[inner] += rng.uniform(-0.25, 0.25, (inner.sum(), 2)) / cells
    order = rng.permutation(len(vertices))
    placed = np.empty_like(vertices)
    placed[order] = vertices
    return TriangleMesh(placed, order[mesh.cells], {name: order[pairs] for name, pairs in mesh.edge_sets.items()})


def derivatives(phi):
    """Functions (Φ, Φ_x, Φ_y, Φ_xx, Φ_yy, Φ_xy) of arrays x, y."""
    parts = [phi, *(sympy.diff(phi, *v) for v in ((X,), (Y,), (X, X), (Y, Y), (X, Y)))]
    found = [sympy.lambdify((X, Y), part, "numpy") for part in parts]
    return [lambda x, y, f=f: np.broadcast_to(f(x, y), np.shape(x)).astype(float) for f in found]


def dofs_of(basis, phi):
    """Degrees of freedom of Φ, a SymPy expression in dimensionless coordinates."""
    space = basis.space
    value, dx, dy, xx, yy, xy = derivatives(phi)
    x, y = space.vertices.T
    ends = space.vertices[space.mesh.topology.ends]
    along = ends[:, 1] - ends[:, 0]
    tx, ty = (along / np.hypot(*along.T)[:, None]).T[:, :, None]
    t, _ = gauss_legendre(basis.degree + 6)
    points = ends[:, :1] + along[:, None] * t[:, None]
    hessian = [f(points[..., 0], points[..., 1]) for f in (xx, yy, xy)]
    normal = tx * tx * hessian[0] + ty * ty * hessian[1] + 2.0 * tx * ty * hessian[2]
    twist = tx * ty * (hessian[1] - hessian[0]) + (tx * tx - ty * ty) * hessian[2]
    project = legendre.from_values(basis.degree - 2, len(t)).T
    on_edges = np.hstack([(normal @ project)[:, 2:], (twist @ project)[:, 1:]])
    values = np.concatenate([np.column_stack([value(x, y), dx(x, y), dy(x, y)]).ravel(), on_edges.ravel()])
    return values / space.units


def polynomial(degree, seed=0):
    a, b, c = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, degree + 1)).tolist()
    return sum((a[i] * X + b[i] * Y + c[i]) ** degree for i in range(degree + 1))


def biharmonic(degree):
    """Re z^p + x Im z^(p−1): strains of an isotropic body are compatible, so that interiors of least energy know it."""
    terms = [sympy.Poly((X + sympy.I * Y) ** k, X, Y).terms() for k in (degree, degree - 1)]
    real, imaginary = (
        sum(part(c) * X**i * Y**j for (i, j), c in found)
        for part, found in zip((sympy.re, sympy.im), terms, strict=True)
    )
    return real + X * imaginary


def energy(basis, potential=None, compliance=COMPLIANCE):
    materials = np.zeros(basis.mesh.cell_count, dtype=int)
    return basis.energy(materials, compliance[None], potential)


@pytest.mark.parametrize("degree", [3, 4, 5, 8])
def test_tractions_on_edges_of_every_slope(degree):
    basis, phi = TriangleBasis(unstructured(), degree), polynomial(degree)
    u, (_, _, _, xx, yy, xy) = dofs_of(basis, phi), derivatives(phi)
    for edges in (basis.mesh.boundary, basis.mesh.interior):
        x, y = basis.mesh.points_along(edges, T)
        stress = np.array([[yy(x, y), -xy(x, y)], [-xy(x, y), xx(x, y)]])
        traction = np.einsum("ijeq,ej->eqi", stress, edges.normal)
        normal, shear = (np.einsum("eqi,ei->eq", traction, axis).ravel() for axis in (edges.normal, edges.tangent))
        size = np.abs(stress).max()
        assert basis.normal_rows(edges, T) @ u == pytest.approx(normal, abs=1e-11 * size)
        assert basis.shear_rows(edges, T) @ u == pytest.approx(shear, abs=1e-11 * size)
        assert np.concatenate(basis.tractions(u, edges, T)) == pytest.approx(
            np.concatenate([normal, shear]), abs=1e-11 * size
        )
        weights = np.random.default_rng(0).normal(size=(2, len(normal)))
        work = weights[0] @ normal + weights[1] @ shear
        assert basis.traction_load(*weights, edges, T) @ u == pytest.approx(work, abs=1e-11 * size * len(normal))


@pytest.mark.parametrize("degree", [3, 4, 7])
@pytest.mark.parametrize("kind", ["gauss", "bernstein"])
def test_rows_of_contacts_give_the_tractions_at_their_points(degree, kind):
    basis = TriangleBasis(unstructured(), degree, kind)
    rule, edges = basis.contact_rule, basis.mesh.edges("top")
    Y_, E = basis.trace_parameters([edges, basis.mesh.edges("left")])
    u = np.random.default_rng(0).normal(size=basis.size)
    rows = (E @ (Y_ @ u)).reshape(2, -1, degree - 1)[:, : len(edges)]
    V = np.eye(degree - 1) if rule.to_points is None else rule.to_points
    for found, expected in zip(rows @ V.T, basis.tractions(u, edges, rule.points), strict=True):
        assert found.ravel() == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())
    assert rule.weights.sum() == pytest.approx(1.0)
    assert rule.shares.sum() == pytest.approx(1.0)
    if kind == "bernstein":  # the ends of an edge are coefficients
        ends = basis.tractions(u, edges, np.array([0.0, 1.0]))[0].reshape(-1, 2)
        assert rows[0][:, [0, -1]] == pytest.approx(ends, abs=1e-10 * np.abs(ends).max())


@pytest.mark.parametrize("degree", [3, 4, 6])
def test_energy_of_a_polynomial_and_of_its_root(degree):
    basis, phi = TriangleBasis(unstructured(), degree), biharmonic(degree)
    u, filled = dofs_of(basis, phi), energy(basis, compliance=ISOTROPIC)
    stress = sympy.Matrix([sympy.diff(phi, Y, Y), sympy.diff(phi, X, X), -sympy.diff(phi, X, Y)])
    density = sympy.Poly((stress.T * sympy.Matrix(ISOTROPIC) * stress)[0] / 2, X, Y)
    exact = float(sum(c / ((i + 1) * (j + 1)) for (i, j), c in density.terms()))
    assert 0.5 * u @ (filled.matrix @ u) == pytest.approx(exact, rel=1e-10)
    elimination = basis.eliminate([], SharedCorners())
    root, kept = filled.root(elimination), elimination.kept
    z = (u - affine_at_gauge(basis, phi, elimination))[kept]
    r = root.apply(z)
    assert 0.5 * r @ r == pytest.approx(exact, rel=1e-10)
    assert root.adjoint(r) == pytest.approx(filled.reduced(elimination)[0] @ z, abs=1e-9 * np.abs(r).max())
    R, places = root.matrix()
    assert R @ z == pytest.approx(r[: R.shape[0]], abs=1e-10 * np.abs(r).max())
    assert places.shape == (R.shape[0], 2)
    assert 0.0 < root.rounding(z) < 1e-12 * np.linalg.norm(r)


def affine_at_gauge(basis, phi, elimination):
    """Degrees of freedom of the affine function that Φ is at the gauge."""
    gauge = int(elimination.slaves[0]) // 3
    x, y = basis.vertices[gauge]
    at = {X: x, Y: y}
    parts = [float(part.subs(at)) for part in (phi, sympy.diff(phi, X), sympy.diff(phi, Y))]
    return dofs_of(basis, sympy.Float(parts[0]) + parts[1] * (X - x) + parts[2] * (Y - y))


@pytest.mark.parametrize("degree", [3, 5])
def test_stresses_and_airy_function_at_points(degree):
    basis, phi = TriangleBasis(unstructured(), degree), biharmonic(degree)
    u, (value, _, _, xx, yy, xy) = dofs_of(basis, phi), derivatives(phi)
    coefficients = energy(basis, compliance=ISOTROPIC).coefficients(u)
    local = np.random.default_rng(1).dirichlet(np.ones(3), 6)
    cells = np.arange(basis.mesh.cell_count)
    for t in (local, np.broadcast_to(local, (len(cells), *local.shape))):
        x, y = np.moveaxis(basis.points(cells, t), -1, 0)
        exact = np.stack([yy(x, y), xx(x, y), -xy(x, y)], axis=-1)
        assert basis.stress(coefficients, cells, t) == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
        assert basis.airy(coefficients, cells, t) == pytest.approx(value(x, y), abs=1e-11 * np.abs(value(x, y)).max())


def prescribed(mesh, stress, names, turn=None):
    """Tractions of a stress field (xx, yy, xy)(x, y) on edge sets, Cartesian or by normal and tangent."""
    found = []
    for name in names:
        edges = mesh.edges(name)
        axes = [np.broadcast_to(axis, (len(edges), 2)) for axis in np.eye(2)]
        for direction in [edges.normal, edges.tangent] if turn else axes:

            def value(x, y, edges=edges, direction=direction):
                sx, sy, sxy = stress(x, y)
                n, d = edges.normal[:, :, None], direction[:, :, None]
                return d[:, 0] * (sx * n[:, 0] + sxy * n[:, 1]) + d[:, 1] * (sxy * n[:, 0] + sy * n[:, 1])

            found.append(PrescribedTraction("Traction", edges, np.asarray(direction, dtype=float), value))
    return found


@pytest.mark.parametrize("degree", [3, 4, 6])
@pytest.mark.parametrize("turn", [False, True])
def test_prescribed_tractions_are_met_exactly(degree, turn):
    mesh = unstructured()
    basis, phi = TriangleBasis(mesh, degree), polynomial(degree)
    _, _, _, xx, yy, xy = derivatives(phi)

    def stress(x, y):
        return yy(x, y), xx(x, y), -xy(x, y)

    given = prescribed(mesh, stress, ["right", "bottom"], turn) + prescribed(mesh, stress, ["left"], turn)[:1]
    found = basis.eliminate(given, SharedCorners())
    u = found.basis @ np.random.default_rng(0).normal(size=found.kept.sum()) + found.particular
    for part in given:
        x, y = mesh.points_along(part.edges, T)
        normal, shear = (values.reshape(-1, len(T)) for values in basis.tractions(u, part.edges, T))
        n, t = ((part.direction * axis).sum(axis=1)[:, None] for axis in (part.edges.normal, part.edges.tangent))
        assert n * normal + t * shear == pytest.approx(part.value(x, y), abs=1e-10 * np.abs(u).max())
    # what is known: both components on six edges, one on three, and the gauge
    assert len(found.slaves) == 6 * (2 * degree - 2) + 3 * (degree - 1) + 3
    assert found.slave_basis.nnz < 12 * len(found.slaves)


def test_closed_boundaries_take_balanced_tractions_only():
    mesh = unstructured()
    basis, sides = TriangleBasis(mesh, 4), ["bottom", "right", "top", "left"]
    given = prescribed(mesh, lambda x, y: (x * 0 + 1.0, 2.0 + x, y * 0 + 0.5), sides)
    found = basis.eliminate(given, SharedCorners())
    assert len(found.slaves) == 3 + 12 * 6 - 3  # as the last edge follows from the others
    given = prescribed(
        mesh, lambda x, y: (x * 0 + 1.0, 2.0 + y, y * 0 + 0.5), sides
    )  # not in equilibrium: div σ = (0, 1)
    with pytest.raises(UnbalancedLoadError) as caught:
        basis.eliminate(given, SharedCorners())
    assert caught.value.imbalance == pytest.approx(1.0, rel=0.6)


def test_a_component_on_edges_of_any_direction():
    active = np.array([[0.0, 0.0], [2.0, 0.3], [1.7, 1.4], [0.2, 1.1]])
    mesh = TriangleMesh(active, [(0, 1, 2), (0, 2, 3)], {"a": [(0, 1)], "b": [(2, 3)]}).refined().refined()
    basis = TriangleBasis(mesh, 5)
    given = []
    for name in ("a", "b"):
        edges = mesh.edges(name)
        direction = np.broadcast_to([0.6, 0.8], (len(edges), 2))
        given.append(PrescribedTraction(name, edges, direction, lambda x, y: 1.0 + x - 2.0 * y + x**3))
    found = basis.eliminate(given, SharedCorners())
    u = found.basis @ np.random.default_rng(0).normal(size=found.kept.sum()) + found.particular
    for part in given:
        normal, shear = (values.reshape(-1, len(T)) for values in basis.tractions(u, part.edges, T))
        n, t = ((part.direction * axis).sum(axis=1)[:, None] for axis in (part.edges.normal, part.edges.tangent))
        assert n * normal + t * shear == pytest.approx(part.value(*mesh.points_along(part.edges, T)), abs=1e-9)


def test_data_outside_the_space_keep_force_and_moment_of_every_edge():
    mesh = TriangleMesh.rectangle((2, 2))
    basis, edges = TriangleBasis(mesh, 4), mesh.edges("top")
    direction = np.broadcast_to([0.0, 1.0], (2, 2))
    step = 0.61803
    x = np.array([0.0, 0.5, 1.0])
    t, w = gauss_legendre(8)
    for load, force, moment in (
        (np.sqrt, x**1.5 / 1.5, x**2.5 / 2.5),
        (
            lambda x: np.where(x < step, 1.0, -2.0),
            np.minimum(x, 3 * step - 2 * x),
            np.minimum(x**2, 3 * step**2 - 2 * x**2) / 2,
        ),
        (lambda x: np.where(np.abs(x - step) < 3e-3, 1.0, 0.0), [0.0, 0.0, 6e-3], [0.0, 0.0, 6e-3 * step]),
    ):
        given = [PrescribedTraction("Traction.y", edges, direction, lambda x, _, load=load: load(x))]
        found = basis.eliminate(given, SharedCorners())
        normal = basis.tractions(found.particular, edges, t)[0].reshape(2, -1)
        places = mesh.points_along(edges, t)[0]
        assert 0.5 * normal @ w == pytest.approx(np.diff(force), rel=1e-11, abs=1e-14)
        assert 0.5 * (normal * places) @ w == pytest.approx(np.diff(moment), rel=1e-11, abs=1e-14)
        assert np.abs(normal - load(places)).max() > 1e-3


@pytest.mark.parametrize("degree", [3, 4, 5])
def test_body_force_enters_load_and_root(degree):
    mesh = unstructured(2)
    basis = TriangleBasis(mesh, degree)
    cells = np.arange(mesh.cell_count)
    points = basis.points(cells, basis.cell_points)
    potential = 1.0 + points[..., 0] - 2.0 * points[..., 1]
    filled, elimination = energy(basis, potential), basis.eliminate([], SharedCorners())
    root, z = filled.root(elimination), np.random.default_rng(0).normal(size=elimination.kept.sum())
    u = elimination.basis @ z
    stress = basis.stress(filled.coefficients(u), cells, basis.cell_points) + potential[..., None] * np.array([1, 1, 0])
    weights = np.multiply.outer(basis.cell_sizes, basis.cell_weights)
    by_points = 0.5 * np.einsum("cg,cgi,ij,cgj->", weights, stress, COMPLIANCE, stress)
    r = root.apply(z)
    assert 0.5 * r @ r == pytest.approx(by_points, rel=1e-10)
    K, fixed = filled.reduced(elimination)
    gradient = K @ z + elimination.basis.T @ (fixed - filled.load)
    assert root.adjoint(r) == pytest.approx(gradient, abs=1e-9 * np.abs(gradient).max())
    assert not energy(basis).load.any()


def test_small_triangles_far_from_the_gauge_lose_nothing_in_the_root():
    mesh = TriangleMesh.rectangle((2, 2)).graded([(1.0, 1.0)], 20)
    basis = TriangleBasis(mesh, 4)
    filled, u = energy(basis), dofs_of(basis, X**2 + X * Y + Y**2)
    affine = dofs_of(basis, 3.0 + X - 2.0 * Y)
    stress = basis.stress(filled.coefficients(u + affine), np.arange(mesh.cell_count), np.full((1, 3), 1.0 / 3.0))
    # values of size 3 make stresses of triangles with sides 1e-6 uncertain by 3e-16/1e-12, differences add nothing
    assert np.abs(stress - [2.0, 2.0, -1.0]).max() < 3e-3
    stress = basis.stress(filled.coefficients(u), [mesh.locate([(0.1, 0.1)])[0]], np.full((1, 3), 1.0 / 3.0))
    assert stress[0, 0] == pytest.approx([2.0, 2.0, -1.0], abs=1e-12)


@pytest.mark.parametrize("divisions", [1, 2, 4])
def test_the_lattice_covers_a_triangle(divisions):
    points, parts = TriangleBasis(TriangleMesh.rectangle((1, 1)), 3).lattice(divisions)
    assert len(points) == 3 * (divisions + 1) * (divisions + 2) // 2
    assert len(parts) == 3 * divisions**2
    edges = points[parts][:, 1:] - points[parts][:, :1]
    areas = np.abs(np.linalg.det(edges[:, :, 1:]))
    assert areas == pytest.approx(np.full(3 * divisions**2, 1.0 / (3.0 * divisions**2)))
    assert points.sum(axis=1) == pytest.approx(1.0)


def test_points_of_the_lattice_lie_in_one_part_of_the_triangle_each():
    """Between the parts stresses may jump: corners of a piece have their least coordinate in common."""
    points, parts = TriangleBasis(TriangleMesh.rectangle((1, 1)), 3).lattice(4)
    lowest = points.argmin(axis=1)[parts]
    assert (lowest == lowest[:, :1]).all()
    assert np.bincount(lowest[:, 0]).tolist() == [16, 16, 16]


def best_error(basis, exact):
    """Relative error in the energy norm of the best approximation of stresses exact(x, y), interiors free."""
    element, triangles, dofs = basis.space.element, basis.space.triangles, basis.space.dofs
    count, shared = basis.mesh.cell_count, element.shared
    B = np.tile(np.eye(element.dimension), (count, 1, 1))
    B[:, :shared, :shared] = element.transformations(triangles) * basis.space.units[dofs][:, None]
    dofs = np.hstack([dofs, basis.size + np.arange(count * element.interior).reshape(count, -1)])
    total = basis.size + count * element.interior
    points, weights = potential_points(basis.degree + 3)
    tables = triangles.stress_maps[:, None] @ element.reference_functions(points, 2) @ B[:, None]
    wanted = exact(*np.moveaxis(triangles.points(points), -1, 0))
    weights = np.multiply.outer(basis.cell_sizes, weights)
    K = (B.swapaxes(1, 2) @ element.energies(triangles, COMPLIANCE) @ B).ravel()
    at = (np.repeat(dofs, dofs.shape[1], axis=1).ravel(), np.tile(dofs, dofs.shape[1]).ravel())
    K = sparse.coo_array((K, at), shape=(total, total)).tocsc()[3:][:, 3:]
    load = np.zeros(total)
    np.add.at(load, dofs, np.einsum("cg,cgi,ij,cgjd->cd", weights, wanted, COMPLIANCE, tables, optimize=True))
    u = np.concatenate([np.zeros(3), spsolve(K, load[3:])])
    rest = (tables @ u[dofs][:, None, :, None])[..., 0] - wanted
    return np.sqrt(np.divide(*(np.einsum("cg,cgi,ij,cgj->", weights, s, COMPLIANCE, s) for s in (rest, wanted))))


@pytest.mark.parametrize("degree", [3, 4, 5, 6, 7, 8])
def test_stresses_converge_with_order_degree_minus_one(degree):
    _, _, _, xx, yy, xy = derivatives(sympy.exp(X) * sympy.sin(2 * Y + sympy.Rational(1, 3)))
    mesh = unstructured(2)
    errors = [
        best_error(TriangleBasis(m, degree), lambda x, y: np.stack([yy(x, y), xx(x, y), -xy(x, y)], axis=-1))
        for m in (mesh, mesh.refined())
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(degree - 1, abs=0.35)


def test_material_of_the_body_is_taken_by_number():
    basis = TriangleBasis(TriangleMesh.rectangle((2, 1)), 3)
    soft, stiff = Material(1.0, 0.3).compliance, Material(10.0, 0.3).compliance
    materials = np.array([0, 0, 1, 1])
    u = dofs_of(basis, X**2 + Y**3)
    mixed = basis.energy(materials, np.stack([soft, stiff]), None).matrix
    parts = [basis.energy(0 * materials, c[None], None).condensed.roots for c in (soft, stiff)]
    w = basis.space.differences.apply(u)[1]
    expected = sum(((parts[k] @ w[:, :, None])[materials == k] ** 2).sum() for k in (0, 1))
    assert u @ (mixed @ u) == pytest.approx(expected, rel=1e-12)
