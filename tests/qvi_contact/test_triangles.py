"""Problems solved on triangles: known states, the law on whole edges, slanted joints, what is refused."""

from itertools import product

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, limit_load_factor, solve
from qvi_contact.gallery import compressed_plate, exact
from qvi_contact.problem import Contact, ContactProblem, Material, Symmetry, Traction
from tests.cases import thinned
from tests.qvi_contact.builders import solved

STEEL, FOAM = Material(1000.0, 0.3), Material(100.0, 0.45)


def moved(mesh, seed=0, amount=0.2):
    """The mesh of a rectangle with inner vertices out of place and vertices numbered at random."""
    rng = np.random.default_rng(seed)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    inner = ((mesh.vertices > low) & (mesh.vertices < high)).all(axis=1)
    vertices = mesh.vertices + inner[:, None] * rng.uniform(-amount, amount, mesh.vertices.shape) * mesh.cell_range[0]
    order = rng.permutation(len(vertices))
    placed = np.empty_like(vertices)
    placed[order] = vertices
    return TriangleMesh(placed, order[mesh.cells], {name: order[pairs] for name, pairs in mesh.edge_sets.items()})


def turned(points, degrees):
    """Points turned about the origin."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray(points) @ np.array([[c, s], [-s, c]])


def oblique(mesh, degrees):
    """The mesh turned about the origin."""
    return TriangleMesh(turned(mesh.vertices, degrees), mesh.cells, mesh.edge_sets, mesh.regions)


def inside(mesh, count=60):
    """Points x, y of the body."""
    rng = np.random.default_rng(7)
    cells = rng.integers(0, mesh.cell_count, count)
    return (rng.dirichlet(np.ones(3), count)[:, None] @ mesh.corners[cells])[:, 0].T


def error(result, state):
    """Largest error of the stress at random points over the largest stress."""
    x, y = inside(result.problem.mesh)
    expected = np.moveaxis(state.stress(x, y), 0, -1)
    return np.abs(result.stress(x, y) - expected).max() / np.abs(expected).max()


@pytest.mark.parametrize("degree", [3, 5])
def test_the_law_holds_on_whole_edges(degree):
    result = solved(compressed_plate(0.2, cells=(8, 8)), 1e-8, degree=degree, law_on="edges")
    line = result.contacts["plate"]
    mean = line.normal_force / 1.0
    assert line.excess_between_points < 1e-12 * mean
    edges = result.problem.mesh.edges("top")
    basis, u = result.discretization.space, result.discretization.values(result.solution.z)
    normal, shear = basis.tractions(u, edges, np.linspace(0.0, 1.0, 41))
    scale = mean / result.discretization.scales.stress
    assert (np.abs(shear) + 0.2 * normal).max() < 1e-12 * scale
    assert normal.max() < 1e-12 * scale


STATES = {
    "compression": (3, lambda material: exact.uniform(material, yy=-10.0)),
    "shear": (3, lambda material: exact.uniform(material, xy=5.0)),
    "bending": (3, lambda material: exact.pure_bending(material, 7.0)),
    "cantilever": (4, lambda material: exact.cantilever(material, 3.0, -3.0 / 8)),
    "column": (3, lambda material: exact.gravity_column(material, 4.0, 0.5)),
}

SIDES = {  # components x, y of bottom, right, top, left: t traction, u displacement
    "held below": ("uu", "tt", "tt", "tt"),
    "displacements": ("uu", "uu", "uu", "uu"),
    "tractions": ("tt", "tt", "tt", "tt"),
    "mixed": ("tu", "ut", "tu", "ut"),
}


@pytest.mark.parametrize(("state", "sides"), thinned(product(STATES, SIDES), 5))
def test_states_of_the_degree_are_found_to_rounding(state, sides):
    least, made = STATES[state]
    mesh = moved(TriangleMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5)))
    names = dict(zip(("bottom", "right", "top", "left"), SIDES[sides], strict=True))
    problem = exact.problem_from_state(made(STEEL), mesh, STEEL, names)
    for degree in (least, 6):
        assert error(solved(problem, degree=degree), made(STEEL)) < 1e-10


def tilted(slope, cells=4):
    """The unit square with a joint from side to side that rises by `slope` and passes through the middle."""
    mesh = TriangleMesh.rectangle((cells, cells)).with_joint("joint", lambda _, y: np.abs(y - 0.5) < 1e-9)
    mesh = mesh.with_region("lower", lambda _, y: y < 0.5)
    x, y = mesh.vertices.T
    lifted = y + slope * (x - 0.5) * (1.0 - np.abs(2.0 * y - 1.0))
    return TriangleMesh(np.column_stack([x, lifted]), mesh.cells, mesh.edge_sets, mesh.regions)


def squeezed(mesh, friction, side=0.0, pressure=10.0, **more):
    """Pressed from above and from both sides, the joint at the given friction."""
    conditions = [Traction("left", x=side, y=0.0), Traction("right", x=-side, y=0.0)]
    conditions += [Symmetry("bottom"), Traction("top", x=0.0, y=-pressure, name="pressure")]
    if friction is not None:
        conditions.append(Contact("joint", friction))
    return ContactProblem(mesh, STEEL, conditions, **more)


class TestJoints:
    """Contact along edges inside the body, in any direction."""

    @pytest.mark.parametrize(("slope", "degree"), [(0.0, 3), (0.3, 3), (-0.4, 5)])
    def test_closed_and_rough_enough_it_is_not_there(self, slope, degree):
        result = solved(squeezed(tilted(slope), 0.5), degree=degree)
        assert error(result, exact.uniform(STEEL, yy=-10.0)) < 1e-11
        line = result.contacts["joint"]
        share = 1.0 / (1.0 + slope**2)
        assert line.normal_stress == pytest.approx(-10.0 * share, rel=1e-10)
        assert line.tangential_stress == pytest.approx(-10.0 * slope * share, abs=1e-10)
        assert line.slip == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("slope", [0.3, -0.4])
    def test_the_load_at_which_it_slides(self, slope):
        """|σ_T| = μ|σ_N| on the joint: (p − q) s c = μ (p c² + q s²) with s/c its slope and q the side pressure."""
        mu, q, tan = 0.2, 4.0, abs(slope)
        p = q * (tan + mu * tan**2) / (tan - mu)
        factor = limit_load_factor(squeezed(tilted(slope), mu, side=q, pressure=1.0), ["pressure"], degree=4)
        assert factor == pytest.approx(p, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "told"),
    [({"degree": 2}, "3 to 12"), ({"degree": 13}, "3 to 12"), ({"law_on": "bernstein"}, "edges"),
     ({"degree": 4, "law_on": "edges", "method": "uzawa"}, "points")],
)  # fmt: skip
def test_wrong_options(options, told):
    with pytest.raises(InputError, match=told):
        solve(compressed_plate(0.2, cells=(2, 2)), **options)


@pytest.mark.parametrize("length", [1e3, 1e4, 1e6])
def test_needles_cost_accuracy_and_are_refused_in_the_end(length):
    unit = TriangleMesh.rectangle((4, 3))
    mesh = TriangleMesh(unit.vertices * [length, 1.0], unit.cells, unit.edge_sets)
    conditions = [Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0), Contact("top", 0.0, gap=-1e-3)]
    problem = ContactProblem(mesh, STEEL, conditions)
    if length > 1e3:
        with pytest.raises(InputError, match="as long as high"):
            solve(problem)
        return
    for degree in (3, 7):  # energies alone would be wrong by 4e-4 at a thousand, with a certificate that passes
        result = solved(problem, 1e-8, degree=degree)
        assert result.contacts["top"].normal_force == pytest.approx(length, rel=1e-8)
