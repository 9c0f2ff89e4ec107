"""Joints, opening and load cycles on triangles: what is known of them on rectangles holds there too."""

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    Material,
    RectilinearMesh,
    Region,
    Symmetry,
    Traction,
    TriangleMesh,
    discretize,
    solve_history,
)
from qvi_contact.gallery import ssnv128, stick_slip_block
from qvi_contact.solution.history import loop_area
from tests.qvi_contact.states import solved
from tests.qvi_contact.test_history import pressed_block, ramp

STEEL = Material(1000.0, 0.3)
X, Y = [0.0, 0.3, 0.8, 1.5, 2.0], [0.0, 0.4, 0.7, 1.0]
ROWS = pytest.mark.parametrize("rows", ["bernstein", "gauss"])
DEGREE = 4
ANGLE = np.deg2rad(30.0)
MAPS = {
    "mirrored": ([[-1.0, 0.0], [0.0, 1.0]], -1.0),
    "upside down": ([[1.0, 0.0], [0.0, -1.0]], 1.0),
    "turned": ([[np.cos(ANGLE), -np.sin(ANGLE)], [np.sin(ANGLE), np.cos(ANGLE)]], 1.0),
}
"""Linear maps of the plane, and the sign that +x gets along the tangent of what was the roof."""


def moved(mesh, linear):
    """The mesh under a linear map of the plane (2, 2), names and all."""
    cells = mesh.cells if np.linalg.det(linear) > 0.0 else mesh.cells[:, ::-1]
    names = (*mesh.edge_names, *mesh.joint_names)
    edges = {name: np.column_stack([mesh.edges(name).first, mesh.edges(name).second]) for name in names}
    return TriangleMesh(mesh.vertices @ np.transpose(linear), cells, edges, mesh.regions)


def sub_mesh(mesh, chosen):
    """The body of some cells, with the edges of all that bound them."""
    used, cells = np.unique(mesh.cells[chosen], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], cells.reshape(-1, 3)), used


class TestTransformed:
    """A sheared wall of two materials with dry joints: mirrored and turned with its triangles it does the same."""

    @staticmethod
    def wall(linear, along, rows):
        """Pressed by the roof, which also moves by 2e-3 along what was x; `along` is its sign on the tangent."""
        grid = RectilinearMesh(X, Y).with_joint("bed", "horizontal", 0.4).with_joint("head", "vertical", 0.8, 0.4, 1.0)
        mesh = TriangleMesh.of_rectangles(grid)
        middle = mesh.vertices[mesh.cells].mean(axis=1)
        mesh = mesh.with_region("soft", np.flatnonzero((middle[:, 0] > 0.8) & (middle[:, 1] > 0.4)))
        conditions = [
            Contact.tied("bottom", name="base"),
            Contact.tied("top", -4e-3, along * 2e-3, name="roof"),
            Traction("left", 0.0, 0.0),
            Traction("right", 0.0, 0.0),
            Contact("bed", 0.15, name="bed"),
            Contact("head", 0.3, name="head"),
        ]
        regions = [Region(Material(300.0, 0.1), name="soft")]
        problem = ContactProblem(moved(mesh, np.array(linear)), STEEL, conditions, regions=regions)
        return solved(problem, tolerance=1e-8, degree=DEGREE, contact_rows=rows)

    @ROWS
    def test_same_state(self, rows):
        first = self.wall(np.eye(2), 1.0, rows)
        assert {1, 2} <= {*first.contacts["bed"].state.tolist(), *first.contacts["head"].state.tolist()}
        for linear, along in MAPS.values():
            self.compare(first, self.wall(linear, along, rows), np.array(linear))

    @staticmethod
    def compare(first, other, Q):
        points = np.random.default_rng(1).uniform(0.01, 0.99, (60, 2)) * [2.0, 1.0]
        xx, yy, xy = first.stress(*points.T).T
        tensors = Q @ np.array([[xx, xy], [xy, yy]]).transpose(2, 0, 1) @ Q.T
        expected = np.column_stack([tensors[:, 0, 0], tensors[:, 1, 1], tensors[:, 0, 1]])
        scale = np.abs(expected).max()
        assert other.stress(*(points @ Q.T).T) == pytest.approx(expected, abs=1e-6 * scale)
        for name in ("bed", "head"):
            ours, theirs = first.contacts[name], other.contacts[name]
            assert theirs.normal_force == pytest.approx(ours.normal_force, abs=1e-6 * scale)
            assert abs(theirs.tangential_force) == pytest.approx(abs(ours.tangential_force), abs=1e-6 * scale)
            assert np.sort(np.abs(theirs.slip)) == pytest.approx(np.sort(np.abs(ours.slip)), abs=1e-8)
            assert np.sort(theirs.gap) == pytest.approx(np.sort(ours.gap), abs=1e-8)
            assert np.sort(theirs.state).tolist() == np.sort(ours.state).tolist()


@ROWS
def test_block_on_block_is_block_on_ground(rows):
    """A soft block on a nearly rigid one slips over the joint as over rigid ground, cut into the same triangles."""
    grid = RectilinearMesh(X, [-1.0, -0.5, 0.0, 0.4, 1.0]).with_joint("c", "horizontal", 0.0)
    whole = TriangleMesh.of_rectangles(grid)
    above = whole.vertices[whole.cells].mean(axis=1)[:, 1] > 0.0
    upper, used = sub_mesh(whole, above)
    x, y = upper.vertices.T
    sides = {"bottom": y == 0.0, "top": y == 1.0, "left": x == 0.0, "right": x == 2.0}
    boundary = np.column_stack([upper.boundary.first, upper.boundary.second])
    named = {name: boundary[on[boundary].all(axis=1)] for name, on in sides.items()}
    upper = TriangleMesh(upper.vertices, upper.cells, named)
    assert np.array_equal(upper.vertices, whole.vertices[used])

    def problem(mesh, *base, **more):
        roof = Displacement("top", x=1e-3, y=-2e-3)
        return ContactProblem(
            mesh, STEEL, [*base, Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0), roof], **more
        )

    options = {"degree": DEGREE, "contact_rows": rows, "tolerance": 1e-8}
    ground = solved(problem(upper, Contact("bottom", 0.2, name="c")), **options).contacts["c"]
    whole = whole.with_region("rock", np.flatnonzero(~above))
    rock = [Region(Material(1e9, 0.3), name="rock")]
    blocks = problem(whole, Displacement("bottom", 0.0, 0.0), Contact("c", 0.2), regions=rock)
    joint = solved(blocks, **options).contacts["c"]
    ours, theirs = np.argsort(joint.x), np.argsort(ground.x)
    assert joint.normal_stress[ours] == pytest.approx(ground.normal_stress[theirs], abs=1e-4)
    assert joint.tangential_stress[ours] == pytest.approx(-ground.tangential_stress[theirs], abs=1e-4)
    assert joint.slip[ours] == pytest.approx(-ground.slip[theirs], abs=1e-7)  # the lower block stands still
    assert joint.state[ours].tolist() == ground.state[theirs].tolist()


@ROWS
def test_joint_that_ends_at_contacts(rows):
    """Between two rough plates, symmetric about the joint: no shear on it, and the half body's solution."""
    half = TriangleMesh.of_rectangles(RectilinearMesh([0.0, 0.3, 0.7, 1.0], [0.0, 0.5, 1.0]))
    count = len(half.vertices)
    axis = half.vertices[:, 0] == 0.0
    twin = np.where(axis, np.arange(count), count + np.cumsum(~axis) - 1)
    vertices = np.vstack([half.vertices, half.vertices[~axis] * [-1.0, 1.0]])
    cells = np.vstack([half.cells, twin[half.cells][:, ::-1]])
    pairs = {name: np.column_stack([half.edges(name).first, half.edges(name).second]) for name in half.edge_names}
    edges = {name: np.vstack([pairs[name], twin[pairs[name]]]) for name in ("bottom", "top")}
    edges |= {"right": pairs["right"], "left": twin[pairs["right"]], "joint": pairs["left"]}
    whole = TriangleMesh(vertices, cells, edges)
    plates = [Contact("bottom", 0.2, name="floor"), Contact("top", 0.2, gap=-2e-3, name="roof")]
    free, options = Traction("right", 0.0, 0.0), {"degree": DEGREE, "contact_rows": rows, "tolerance": 1e-8}
    expected = solved(ContactProblem(half, STEEL, [Symmetry("left"), free, *plates]), **options)
    conditions = [Traction("left", 0.0, 0.0), free, *plates, Contact("joint", 0.4, law="bilateral")]
    result = solved(ContactProblem(whole, STEEL, conditions), **options)
    x, y = np.random.default_rng(2).uniform(0.01, 0.99, (2, 40))
    assert result.stress(x, y) == pytest.approx(expected.stress(x, y), abs=1e-6)
    assert result.stress(-x, y) * [1, 1, -1] == pytest.approx(expected.stress(x, y), abs=1e-6)
    assert result.contacts["joint"].tangential_stress == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize(("degree", "within"), [(4, 4e-4), (5, 1.6e-4)])
@ROWS
def test_ssnv128(degree, within, rows):
    """Opening, slip and stick at once on 8² cells; settled values and zones of displacement elements."""
    base = solved(ssnv128((8, 8)).triangulated(), degree=degree, contact_rows=rows).contacts["base"]
    assert base.normal_force == pytest.approx(2e6, rel=1e-9)
    assert base.tangential_force == pytest.approx(-1.40535e6, rel=within)
    order = np.argsort(base.x)
    x, state = base.x[order], base.state[order]
    ends = np.flatnonzero(np.diff(state))
    assert state[[0, *(ends + 1)]].tolist() == [0, 2, 1]
    assert (x[ends] + x[ends + 1]) / 2.0 == pytest.approx([3.28e-3, 29.84e-3], abs=0.04 / 16)
    assert base.tangential_stress.max() < 1.0
    if rows == "gauss":  # whose multipliers are gap and slip at the very points
        assert (base.slip[base.state == 2] > 0.0).all()
        assert base.gap.min() > -1e-15
    assert base.slip[base.state == 1] == pytest.approx(0.0, abs=1e-12)


def test_a_cycle_of_partial_slip_settles_and_loses_its_area():
    """Where corners slip freely, as on triangles, locked slip settles turn by turn; then the loop repeats."""
    path = 0.01 * ramp(0.0, *7 * (1.0, -1.0), 1.0, steps=2)
    history = solve_history([pressed_block(offset, (3, 1)).triangulated() for offset in path], degree=DEGREE)
    displacement, force = history.loop("plate")
    turns = force[-24:].reshape(6, 4)
    drift = np.abs(np.diff(turns, axis=0)).max(axis=1) / np.abs(force).max()
    assert drift[0] > 1e-3
    assert (drift[1:] < drift[:-1]).all()
    assert drift[-1] < 2e-6
    area = loop_area(displacement[-5:], force[-5:])
    assert history.friction_work[-4:].sum() == pytest.approx(area, rel=1e-4)
    assert (history.dissipated >= -1e-12 * history.dissipated.max()).all()


class TestVaryingLaws:
    """Coefficients of the traction cannot hold a law whose friction varies along an edge: Gauss points are taken."""

    @pytest.mark.parametrize("degree", [4, 5])
    def test_manufactured_stick_and_slip_is_exact(self, degree):
        """The state is a polynomial of degree 4; coefficients miss the shear force by 5e-4."""
        state = stick_slip_block()
        problem = state if isinstance(state, ContactProblem) else state[0]
        exact = solved(problem).contacts["base"].tangential_force
        result = solved(problem.triangulated(), degree=degree)
        assert result.contacts["base"].tangential_force == pytest.approx(exact, rel=1e-9)
        assert result.contacts["base"].excess_between_points < 1e-7
        other = solved(problem.triangulated(), degree=degree, contact_rows="bernstein").contacts["base"]
        assert abs(other.tangential_force / exact - 1.0) > 1e-5

    @pytest.mark.parametrize(
        ("law", "kind"),
        [
            ({"friction": 0.3}, "bernstein"),
            ({"friction": lambda x, _: 0.3 + 0.0 * x}, "bernstein"),
            ({"friction": lambda x, _: 0.3 + 0.1 * x}, "gauss"),
            ({"friction": lambda x, _: np.where(x < 1.0, 0.3, 0.2)}, "gauss"),  # at a node
            ({"friction": 0.3, "cohesion": lambda x, _: 1.0 + x}, "bernstein"),
            ({"friction": 0.3, "cohesion": lambda x, _: 1.0 + x**2}, "gauss"),
            ({"friction": 0.3, "shear_limit": lambda x, _: 1.0 + x**2}, "gauss"),
        ],
    )
    def test_which_rows_are_taken(self, law, kind):
        block = pressed_block(0.0, (2, 1))
        contact = Contact("top", **law, gap=-0.01, name="plate")
        problem = ContactProblem(block.mesh, STEEL, [contact, *block.conditions[1:]])
        assert discretize(problem.triangulated(), degree=4).space.contact_rule.kind == kind
        assert discretize(problem, element="bfs").space.contact_rule.kind == "gauss"
