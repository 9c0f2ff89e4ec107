"""The elastic body by itself: shape functions, stiffness, numbering; the same answer in other units and places."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh
from qvi_contact.companion import Elasticity, solve_companion
from qvi_contact.discretization import DisplacementSpace, Scales, Triangle, discretize
from qvi_contact.gallery import exact
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Region, Symmetry, Traction
from tests.cases import every_pair
from tests.qvi_contact.builders import INNER, NU, OUTER, bernstein, companion_of, quarter
from tests.qvi_contact.test_triangles import FOAM, SIDES, STATES, STEEL, inside, moved, squeezed, tilted

CELLS = [Triangle(degree) for degree in (1, 2, 3, 4, 5)]
L_SHAPE = np.array([[1, 1, 1], [1, 1, 0], [1, 1, 0]], dtype=bool)


def notched():
    """An L of two materials, cut by a joint."""
    mesh = TriangleMesh.grid([0.0, 0.5, 1.1, 2.0], [0.0, 0.4, 0.7, 1.0], L_SHAPE)
    mesh = mesh.with_joint("cut", lambda _, y: np.isclose(y, 0.4))
    conditions = [Symmetry("bottom"), Symmetry("left"), Traction("right", 1.0, 0.0), Traction("top", 0.0, -1.0)]
    regions = [Region(Material(50.0, 0.45), x=(0.5, 1.1))]
    return ContactProblem(mesh, Material(100.0, 0.2), [*conditions, Contact("cut", 0.3)], regions=regions)


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: str(cell.degree))
def test_shape_functions_are_positive_sum_to_one_and_have_the_trace_of_their_sides(cell):
    """Along a side the function is the polynomial of the side's coefficients, in its direction."""
    values = cell.values(np.random.default_rng(0).uniform(0.05, 0.45, size=(7, 2)))
    assert values.min() >= 0.0
    assert values.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    c, t = np.random.default_rng(2).normal(size=len(cell.places)), np.linspace(0.0, 1.0, 5)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    pairs = np.argwhere(cell.sides[:, :, 0] >= 0)
    assert len(pairs) == 2 * len(corners)
    for first, last in pairs:
        line = corners[first] + t[:, None] * (corners[last] - corners[first])
        along = bernstein(cell.degree, t) @ c[cell.sides[first, last]]
        assert cell.values(line) @ c == pytest.approx(along, abs=1e-13)


@pytest.mark.parametrize("cell", CELLS, ids=lambda cell: str(cell.degree))
def test_the_stiffness_is_the_energy_and_lets_each_block_move_freely(cell):
    """Three rigid motions each, no more: the joint separates the blocks, and nothing else does."""
    problem = notched()
    scales = Scales.of(problem)
    moduli = np.linalg.inv(problem.compliances / scales.compliance)
    body = Elasticity(DisplacementSpace.of(problem, cell), moduli)
    v, K = np.random.default_rng(1).normal(size=body.space.size), body.stiffness()
    assert body.force(v) == pytest.approx(K @ v, abs=1e-10)
    assert body.energy(v) == pytest.approx(0.5 * v @ (K @ v), rel=1e-12)
    motions, values = body.space.rigid(), np.linalg.eigvalsh(K.toarray())
    assert motions.shape[1] == 6
    assert np.abs(K @ motions).max() < 1e-12
    assert values[5] < 1e-12 < 1e-5 < values[6]


@pytest.fixture(scope="module")
def cut():
    return solve_companion(notched(), degree=3)


class TestFields:
    """Values at points, in cells and at corners are of one field."""

    def test_strain_and_stress_of_cells(self, cut):
        tx, ty = np.array([0.1, 0.2]), np.array([0.3, 0.7])
        corners = cut.problem.mesh.corners
        places = np.column_stack([1.0 - tx - ty, tx, ty]) @ corners
        stress = cut.stress(places[..., 0], places[..., 1])
        strain = np.einsum("ckl,cql->cqk", cut.problem.compliances, stress)
        assert strain == pytest.approx(cut.cell_strain(np.column_stack([tx, ty])), abs=1e-13)
        assert cut.displacement(places[..., 0], places[..., 1]) == pytest.approx(
            cut.displacement_in(slice(None), np.column_stack([tx, ty])), abs=1e-13
        )

    def test_on_the_joint_the_mean_of_both_sides(self, cut):
        near = 1e-9
        mean = (cut.displacement(0.2, 0.4 - near) + cut.displacement(0.2, 0.4 + near)) / 2
        assert cut.displacement(0.2, 0.4) == pytest.approx(mean, abs=1e-9)

    @pytest.mark.parametrize("place", [(1.5, 0.8), (-0.1, 0.2), (2.0 + 1e-6, 0.1)])
    def test_outside(self, cut, place):
        with pytest.raises(InputError, match="points inside the body"):
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
    return companion_of(replace(problem, mesh=mesh, conditions=conditions), bounds, degree=3)


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
    assert other.parts["friction"] / (stress * length**2) == pytest.approx(original.parts["friction"], rel=1e-7)
    ours, theirs = original.contacts["top"], other.contacts["top"]
    assert theirs.slip / length == pytest.approx(ours.slip, abs=1e-8 * 1e-3)
    assert theirs.normal_stress / stress == pytest.approx(ours.normal_stress, abs=1e-6 * 209)
    assert other.cell_strain([[0.3, 0.6]]) == pytest.approx(original.cell_strain([[0.3, 0.6]]), abs=1e-9)


def test_a_bound_that_varies_follows_the_edges():
    """Bernstein coefficients run along +x on each edge: mirrored, they come in the opposite order."""
    s = np.random.default_rng(5).uniform(5.0, 30.0, size=(5, 3))

    def mirrored(points):
        return points * [-1.0, 1.0]

    one, other = plate(bounds={"top": s}), plate(mirrored, bounds={"top": s[:, ::-1]})
    assert other.energy == pytest.approx(one.energy, rel=1e-10)
    assert plate(mirrored, bounds={"top": s}).energy != pytest.approx(one.energy, rel=1e-6)


LEAST = {"compression": 1, "shear": 1, "bending": 2, "cantilever": 3, "column": 2}  # degrees that hold the states


@pytest.mark.parametrize(("state", "sides", "more"), every_pair(list(STATES), ["held below", "mixed"], [0, 2]))
def test_states_the_elements_contain(state, sides, more):
    mesh = moved(TriangleMesh.rectangle((3, 2), 2.0, 1.0, origin=(0.0, -0.5)))
    names = dict(zip(("bottom", "right", "top", "left"), SIDES[sides], strict=True))
    exactly, (x, y) = STATES[state][1](STEEL), inside(mesh)
    companion = companion_of(exact.problem_from_state(exactly, mesh, STEEL, names), degree=LEAST[state] + more)
    assert companion.reasons == ()
    stress, displacement = (np.moveaxis(part(x, y), 0, -1) for part in (exactly.stress, exactly.displacement))
    assert np.abs(companion.stress(x, y) - stress).max() < 1e-10 * np.abs(stress).max()
    assert np.abs(companion.displacement(x, y) - displacement).max() < 1e-10 * np.abs(displacement).max()


@pytest.mark.parametrize("degree", [1, 3, 4, 5])
def test_orders(degree):
    """Stresses converge as h^p to those of (eˣ cos y, −eˣ sin y), prescribed all around, which no element holds."""
    errors, u, v = [], lambda x, y: 1e-3 * np.exp(x) * np.cos(y), lambda x, y: -1e-3 * np.exp(x) * np.sin(y)
    for cells in (2, 4):
        mesh = moved(TriangleMesh.rectangle((cells, cells)), amount=0.1)
        held = [Displacement(side, u, v) for side in mesh.edge_names]
        companion, (x, y) = companion_of(ContactProblem(mesh, STEEL, held), degree=degree), inside(mesh, 300)
        along, across = 1e-3 * np.exp(x) * np.cos(y), -1e-3 * np.exp(x) * np.sin(y)
        expected = 1000.0 / 1.3 * np.stack([along, -along, across], axis=-1)
        errors.append(np.sqrt(np.square(companion.stress(x, y) - expected).mean()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(degree, abs=0.5)


@pytest.mark.parametrize("slope", [0.3, -0.4])
def test_a_closed_slanted_joint_is_not_there(slope):
    problem = squeezed(tilted(slope), 0.5)
    companion = companion_of(problem, degree=2, bounds={"joint": np.full((4, 3), 5.0)})
    x, y = inside(problem.mesh)
    assert companion.stress(x, y) == pytest.approx(np.tile([0.0, -10.0, 0.0], (len(x), 1)), abs=1e-9)
    line, share = companion.contacts["joint"], 1.0 / (1.0 + slope**2)
    assert line.normal_stress == pytest.approx(-10.0 * share, rel=1e-9)
    assert line.tangential_stress == pytest.approx(-10.0 * slope * share, rel=1e-9)
    assert line.gap == pytest.approx(0.0, abs=1e-12)
    assert companion.reasons == ()


def test_a_tied_slanted_joint_between_two_materials_is_not_there():
    problem = squeezed(tilted(0.3), None, regions=[Region(FOAM, name="lower")])
    tied = replace(problem, conditions=[*problem.conditions, Contact.tied("joint")])
    whole, cut = companion_of(problem, degree=3), companion_of(tied, degree=3)
    assert cut.unknowns > whole.unknowns
    assert cut.energy == pytest.approx(whole.energy, rel=1e-12)
    x, y = inside(problem.mesh)
    assert cut.stress(x, y) == pytest.approx(whole.stress(x, y), abs=1e-8)


def held_in_a_corner(condition):
    """A triangle pressed into the corner between two slanted walls."""
    mesh = TriangleMesh([(0, -1), (1, 0.2), (-1.2, 0.3)], [(0, 1, 2)], {"walls": [(0, 1), (0, 2)], "top": [(1, 2)]})
    load = Traction("top", x=0.0, y=lambda _, y: -3.0 - y)
    return ContactProblem(mesh.refined().refined(), STEEL, [condition, load])


def test_a_corner_between_two_slanted_lines():
    """Walls that hold the normal component, as supports or as contacts that stay closed, are the same."""
    held = companion_of(held_in_a_corner(Symmetry("walls")), degree=4)
    pressed = companion_of(held_in_a_corner(Contact.frictionless("walls")), degree=4)
    walls = pressed.contacts["walls"]
    assert walls.gap == pytest.approx(0.0, abs=1e-15)
    assert walls.normal_stress.max() < 0.0
    assert pressed.energy == pytest.approx(held.energy, rel=1e-11)
    assert (walls.x**2 + (walls.y + 1.0) ** 2 < 1e-12).sum() == 2  # the corner counts once for each wall
    tip = companion_of(held_in_a_corner(Contact.tied("walls")), degree=4).displacement(0.0, -1.0)
    assert tip == pytest.approx(0.0, abs=1e-17)


def test_supports_in_three_directions_at_one_corner():
    """Data of one rigid motion agree; a fourth condition that does not is named."""
    mesh = TriangleMesh([(0, -1), (1, 0.2), (-1.2, 0.3)], [(0, 1, 2)], {"a": [(0, 1)], "b": [(0, 2)], "c": [(1, 2)]})
    moved_by, conditions = np.array([2e-3, -1e-3]), []
    for name in "abc":
        edges = mesh.edges(name)
        parts = [float((vectors @ moved_by)[0]) for vectors in (edges.normal, edges.tangent)]
        conditions.append(Displacement(name, normal=parts[0], tangential=parts[1]))
    problem = ContactProblem(mesh.refined(), STEEL, conditions)
    companion = companion_of(problem, degree=3)
    assert companion.reasons == discretize(problem).remarks == ()
    assert companion.displacement(0.1, 0.0) == pytest.approx(moved_by, rel=1e-12)
    wrong = replace(problem, conditions=[*conditions[:2], replace(conditions[2], normal=5e-3)])
    (reason,), (remark,) = companion_of(wrong, degree=3).reasons, discretize(wrong).remarks
    assert ["disagree" in said for said in (reason, remark)] == [True, True]


@pytest.mark.parametrize("turn", [0.0, 3e-3])
def test_arcs_that_are_moved(turn):
    """A ring widened from inside and free outside, u_r = a r + b/r; and turned by both arcs as well, u_θ = turn/r."""
    widened, even = 4e-3, 4e-3 * (1.0 - NU) / (1.0 + NU) / OUTER**2

    def field(x, y):
        r2 = x**2 + y**2
        radial, around = even + widened / r2, turn / r2
        return np.stack([radial * x - around * y, radial * y + around * x])

    inner, outer = -(even + widened / INNER**2) * INNER, (even + widened / OUTER**2) * OUTER
    arcs = [Displacement("inner", normal=inner), Traction("inner", tangential=0.0)]
    ends = [Contact(end, 0.0, law="bilateral") for end in ("bottom", "left")]  # they alone keep it from turning
    arcs += [Traction("outer", normal=0.0, tangential=0.0), *ends]
    if turn:  # tangents of arcs have t_x > 0
        arcs = [Displacement("inner", normal=inner, tangential=-turn / INNER)]
        arcs += [Displacement("outer", normal=outer, tangential=-turn / OUTER)]
        parts = [lambda *at: field(*at)[0], lambda *at: field(*at)[1]]
        arcs += [Displacement("bottom", *parts), Displacement("left", *parts)]
    r, angle = np.random.default_rng(1).uniform([[1.02], [0.02]], [[1.98], [1.55]], (2, 50))
    x, y = r * np.cos(angle), r * np.sin(angle)
    for degree, most in ((1, 0.07), (4, 2e-4)):
        found = companion_of(ContactProblem(quarter(2, 4), Material(1000.0, NU), arcs), degree=degree)
        assert np.abs(found.displacement(x, y).T - field(x, y)).max() < most * np.abs(field(x, y)).max()
