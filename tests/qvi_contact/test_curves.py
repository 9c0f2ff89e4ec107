"""Edges on smooth curves: geometry, orders on a plate with an elliptic hole, archives, refinement, bad curves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.legendre import poly2leg

from comparisons.verification.chapters.curves import NU, OUTER, M, ellipse, sheet, stretched, zeta_of
from qvi_contact import InputError, TriangleMesh, discretize, load_result, solve
from qvi_contact.bracket import bracket
from qvi_contact.discretization import shortest_cuts
from qvi_contact.export import write_npz, write_vtu
from qvi_contact.files import problem_from_toml, problem_to_toml
from qvi_contact.gallery import exact, fan
from qvi_contact.mechanism import Rigid
from qvi_contact.mesh import Curve, arc_offsets, curves, frames_along
from qvi_contact.plots import cell_outlines, edge_lines, runs
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.verification import verify_file
from tests.qvi_contact.builders import INNER, difference, holed, quarter, solved


def test_a_curve_that_leaves_the_circle_through_the_corners():
    """Its top is farther from the centre of the triangle than any corner, and still a point of it."""
    turn = 0.99 * np.pi / 4.0 * poly2leg([0.0, 2.1875, 0.0, -2.1875, 0.0, 1.3125, 0.0, -0.3125])[None]

    def bow(t):
        return (0.5, 0.0) + arc_offsets(np.array([[-1.0, 0.0]]), turn, t)[0]

    mesh = TriangleMesh([(0.5, 0.0), (-0.5, 0.0), (0.0, -0.86)], [(0, 1, 2)], {"top": np.array([[0, 1]])})
    mesh = mesh.with_curve("top", bow)
    top = bow(np.array([0.5]))
    assert np.hypot(*(top[0] - mesh.corners[0].mean(axis=0))) > 1.04 * np.hypot(0.5, 0.86 / 3.0)
    assert mesh.locate(top).tolist() == [0]
    assert mesh.graded(top, 1).cell_count > 1


def test_a_circle_is_the_same_as_a_curve():
    """Bends of a circle from its points are those from centre and radius, whatever the parameter."""
    arcs, bare = quarter(1, 3), quarter(1, 3, arcs=False)
    for name, radius in (("inner", INNER), ("outer", OUTER)):

        def circle(t, radius=radius):
            return radius * np.column_stack([np.cos(t + t**2), np.sin(t + t**2)])

        bare = bare.with_curve(name, circle, 1.0, -0.3)
    np.testing.assert_allclose(bare.bends[:, :2], arcs.bends, atol=1e-12)
    np.testing.assert_allclose(bare.bends[:, 2:], 0.0, atol=1e-12)


def round_(t):
    return np.column_stack([np.cos(t), np.sin(t)])


def oval(t):
    return np.column_stack([2.0 * np.cos(t), np.sin(t)])


def disc():
    """An ellipse of twelve edges."""
    return fan([oval(np.linspace(0.0, 2.0 * np.pi, 13)[:-1])], closed=True, centre=(0.0, 0.0))


@pytest.mark.parametrize("start", [0.0, 1.0, -0.7, 1e-3, -1e-3])
def test_closed_curves_may_begin_anywhere(start):
    """Twelve edges all around an ellipse, whose parameter passes its ends inside an edge, in a vertex or near one."""
    mesh = disc().with_curve("outer", oval, start, start + 2.0 * np.pi)
    edges = mesh.edges("outer")
    assert edges.length.sum() == pytest.approx(9.688448220547675, rel=1e-13)  # 8 E(3/4)
    x, y = mesh.points_along(edges, np.linspace(0.0, 1.0, 7))
    np.testing.assert_allclose((x / 2.0) ** 2 + y**2, 1.0, atol=1e-12)


def test_finer_meshes_stay_on_the_curve():
    mesh = sheet(1, 4).refined().graded([(1.25, 0.0)], 6)
    for name, radius in (("inner", 1.0), ("outer", OUTER)):
        edges = mesh.edges(name)
        points = mesh.points_along(edges, np.array([0.0, 0.3, 0.5, 0.9, 1.0]))
        np.testing.assert_allclose(np.abs(zeta_of(*points)), radius, atol=2e-12)
    assert mesh.edges("inner").length.min() < 5e-3
    angles = np.linspace(0.0, np.pi / 2.0, 5)
    mesh = fan([oval(angles), 3.0 * round_(angles)], closed=False, arcs=("outer",)).with_curve("inner", oval, 0.0, 2.0)
    fine = mesh.refined().refined()
    assert fine.bends.shape[1] > 2
    assert not fine.bends[fine.numbers("outer"), 2:].any()  # circles stay circles beside other curves


def test_frames_are_those_of_the_curve():
    """Normals of a confocal ellipse point along ζ dz/dζ, on both sides of edges taken either way."""
    mesh = sheet(1, 4)
    for name, sign in (("inner", -1.0), ("outer", 1.0)):
        edges, t = mesh.edges(name), np.linspace(0.0, 1.0, 5)
        zeta = zeta_of(*mesh.points_along(edges, t))
        normal = sign * zeta * (1.0 - M / zeta**2)
        normal /= np.abs(normal)
        found, tangent = frames_along(edges, t)
        np.testing.assert_allclose(found, np.stack([normal.real, normal.imag], axis=-1), atol=1e-11)
        np.testing.assert_allclose((found * tangent).sum(axis=-1), 0.0, atol=1e-15)


@pytest.mark.parametrize(("mesh", "ends"), [(quarter(1, 4), ("bottom", "left")), (sheet(1, 4), ("start", "end"))])
def test_problem_files_and_archives_keep_the_shape(mesh, ends, tmp_path):
    given = [Traction("inner", normal=-1.0, tangential=0.0), Displacement("outer", x=0.0, y=0.0)]
    problem = ContactProblem(mesh, Material(1.0, NU), [*given, *(Symmetry(end) for end in ends)])
    assert problem_from_toml(problem_to_toml(problem)).problem.mesh.same_as(problem.mesh)
    result = solve(problem, degree=4)
    write_npz(tmp_path / "plate.npz", result)
    stored = load_result(tmp_path / "plate.npz")
    np.testing.assert_array_equal(stored.dofs, result.dofs)
    assert stored.problem.mesh.same_as(problem.mesh)


def test_ellipses_of_a_problem_file():
    mesh = sheet(1, 4, curved=False)
    given = [Traction("inner", normal=-1.0, tangential=0.0), Displacement("outer", x=0.0, y=0.0)]
    problem = ContactProblem(mesh, Material(1.0, NU), [*given, *stretched(mesh).conditions[2:]])
    text = problem_to_toml(problem)

    def with_arc(entry):
        return problem_from_toml(text.replace("[mesh]\n", f"[mesh]\narcs = [{entry}]\n")).problem.mesh

    kept = mesh.with_curve("inner", ellipse(1.0), 0.0, np.pi / 2.0).bends
    for axes in ("[0.75, 1.25], angle = 1.5707963267948966", "[1.25, 0.75]"):
        found = with_arc(f'{{ name = "inner", centre = [0.0, 0.0], axes = {axes} }}')
        np.testing.assert_allclose(found.bends[:, : kept.shape[1]], kept[:, : found.bends.shape[1]], atol=1e-11)
    np.testing.assert_allclose(curves.ellipse((0.0, 0.0), (1.25, 0.75))(np.arange(6.0)), ellipse(1.0)(np.arange(6.0)))
    pairs = mesh.edge_sets["inner"].tolist()
    for entry, field in (
        ('{ name = "inner", centre = [0.0, 0.0], axes = [0.75, 1.2], angle = 1.5707963267948966 }', "axes"),
        ('{ name = "inner", centre = [0.0, 0.0], axes = [0.75, -1.25] }', "axes"),
        ('{ name = "inner", axes = [0.75, 1.25] }', "centre"),
        ('{ name = "inner", centre = [0.0, 0.0] }', "radius"),
        ('{ name = "inner", centre = [0.0, 0.0], radius = 1.0, angle = 0.2 }', "angle"),
        ('{ name = "inner", centre = [0.0, 0.0], radius = 1.1 }', "radius"),
        ('{ name = "inner", centre = [0.0, 0.0], radius = -1.0 }', "radius"),
        (f"{{ edges = {pairs}, bends = [[0.0, 0.1]] }}", "bends"),
        (f"{{ edges = {pairs}, bends = {[[0.0, 0.1, 0.2]] * 4} }}", "bends"),
        (f"{{ edges = {pairs}, bends = {[[0.0, 0.1], [0.1], [0.1], [0.1]]} }}", "bends"),
    ):
        with pytest.raises(InputError) as caught:
            with_arc(entry)
        assert caught.value.field == f"mesh.arcs[0].{field}"


@pytest.mark.parametrize(
    ("curve", "ends"),
    [(lambda t: np.column_stack([t, t, t]), (0.0, 1.0)),
     (lambda t: np.column_stack([np.sqrt(t), t])[:5], (0.0, 1.0)),
     (lambda t: np.column_stack([np.log(t - 0.5), t]) if t.min() > 0.5 else np.full((len(t), 2), np.nan), (0.0, 1.0)),
     (lambda t: np.column_stack([np.cos(t), np.sin(t)]), (0.0, np.pi / 2.0)),
     (lambda t: np.ones((len(t), 2)), (0.0, 1.0)), (lambda t: t.missing, (0.0, 1.0)), (None, (0.0, 1.0)),
     (ellipse(1.0), (0.0, 1.0)), (ellipse(1.0), (0.0, np.nan)), (ellipse(1.0), (1.0, 1.0))],
)  # fmt: skip
def test_curves_that_cannot_be(curve, ends):
    with pytest.raises(InputError):
        sheet(1, 4, curved=False).with_curve("inner", curve, *ends)


def test_curves_that_turn_too_far_or_fold():
    mesh = sheet(1, 4, curved=False)

    def folded(t):
        """Forth, back and forth again between vertices."""
        return ellipse(1.0)(t + 0.6 * np.sin(8.0 * t))

    with pytest.raises(InputError, match="not smooth there, turns back"):
        mesh.with_curve("inner", folded, 0.0, np.pi / 2.0)

    triangle = TriangleMesh([(-0.6, -0.8), (0.6, -0.8), (0.0, 1.0)], [(0, 1, 2)], {"rim": [(0, 1)]})
    assert triangle.with_curve("rim", round_, 0.0, 2.0 * np.pi).curved.all()
    wide = TriangleMesh([(-0.8, -0.6), (0.8, -0.6), (0.0, 1.0)], [(0, 1, 2)], {"rim": [(0, 1)]})
    with pytest.raises(InputError, match="90°"):
        wide.with_curve("rim", round_, 0.0, 2.0 * np.pi)


def test_edges_by_bends():
    """Rows may come in any order and direction; a row too many or an edge given twice is refused."""
    mesh = sheet(1, 4)
    known = mesh.arcs[0]
    order = [2, 0, 3, 1]
    flipped = Curve(
        known.edges[order][:, ::-1], known.coefficients[order] * (-1.0) ** np.arange(known.coefficients.shape[1])
    )
    again = flipped.checked("", mesh.topology)
    np.testing.assert_array_equal(again.edges, known.edges)
    np.testing.assert_array_equal(again.coefficients, known.coefficients)
    few = (known.edges, known.coefficients[1:]), (known.edges[[0, 0]], known.coefficients[:2])
    for edges, coefficients in (*few, *((known.edges, known.coefficients + change) for change in (0.1, np.nan))):
        wrong = Curve(edges, coefficients)
        with pytest.raises(InputError):
            wrong.checked("", mesh.topology)


def test_pictures_follow_curves():
    pytest.importorskip("matplotlib")
    radii = np.abs(zeta_of(*np.moveaxis(cell_outlines(sheet(1, 4)), -1, 0)))
    assert radii.min() == pytest.approx(1.0, rel=1e-11)
    assert (np.abs(radii - OUTER) < 1e-11).sum() >= 4 * 8
    mesh = quarter(1, 2)
    (run,) = runs(mesh, mesh.edges("outer"))
    assert run.length == pytest.approx(np.pi, rel=1e-2)
    np.testing.assert_allclose(np.hypot(*run.line.T), 2.0, rtol=1e-14)
    np.testing.assert_allclose(np.hypot(*edge_lines(mesh, mesh.edges("inner")).reshape(-1, 2).T), 1.0, rtol=1e-14)


def test_what_an_elliptic_bed_holds():
    """A disc in a bed of its own shape, which it may slip along but not leave, cannot turn unless it is round."""
    mesh = disc().with_curve("outer", oval, 0.0, 2.0 * np.pi)
    held = ContactProblem(mesh, Material(1.0, NU), [Contact("outer", 0.0, law="bilateral")])
    assert Rigid(held).free.shape == (3, 0)


STEEL = Material(1000.0, 0.3)
SIDES = ("bottom", "right", "top", "left")
PLACES = ((0.0, 0.0), (2.0, 0.0), (1.0, 2.0))
EYE, THREE = (PLACES[:1], (-1.5, -1.5), (1.5, 1.5)), (PLACES, (-1.5, -1.5), (3.5, 3.5))
"""Where unit holes are, and the corners of the rectangles around them."""
SOURCES = {(0.0, 0.0): (1.0, -0.7, 0.4), (2.0, 0.1): (-0.4, 0.9, 0.0), (1.0, 2.0): (0.5, 0.2, -0.6)}
"""Forces and moments (X, Y, M) at points inside them."""


def point_forces(sources):
    """Forces and moments in an infinite plane by Kolosov's functions; displacements are single-valued."""
    kappa, shear = (3.0 - STEEL.poisson) / (1.0 + STEEL.poisson), STEEL.young / 2.0 / (1.0 + STEEL.poisson)
    factor = 1.0 / (2.0 * np.pi * (1.0 + kappa))

    def stress(x, y):
        found = np.zeros((3, *np.shape(x)))
        for (a, b), (X, Y, turn) in sources.items():
            z, force = x - a + 1j * (y - b), (X + 1j * Y) * factor
            mean = -4.0 * (force / z).real
            rest = 2.0 * (z.conj() * force / z**2 + kappa * force.conjugate() / z - 1j * turn / (2.0 * np.pi * z**2))
            found += [(mean - rest.real) / 2.0, (mean + rest.real) / 2.0, rest.imag / 2.0]
        return found

    def displacement(x, y):
        total = np.zeros(np.shape(x), dtype=complex)
        for (a, b), (X, Y, turn) in sources.items():
            z, force = x - a + 1j * (y - b), (X + 1j * Y) * factor
            total += -2.0 * kappa * force * np.log(np.abs(z)) + z * force.conjugate() / z.conj()
            total += 1j * turn / (2.0 * np.pi * z.conj())
        return np.stack([total.real, total.imag]) / (2.0 * shear)

    return exact.ExactState(stress, displacement)


def eye(divisions):
    """A square of 3 with a unit hole in the middle; its rim is "rim"."""
    mesh = holed(divisions, *EYE)
    return mesh.with_edges("rim", lambda x, y: np.maximum(np.abs(x), np.abs(y)) < 0.6).with_edges(
        "outside", lambda x, y: np.maximum(np.abs(x), np.abs(y)) > 1.4
    )


def misses(state, mesh, kinds, degree):
    """Mean error of the stress where every side, those of holes too, has the data of the state."""
    problem = exact.problem_from_state(state, mesh, STEEL, dict(zip(SIDES, kinds, strict=True)))
    x, y, stress = solved(problem, degree=degree).gauss_stress()
    return np.sqrt(np.square(stress - np.moveaxis(state.stress(x, y), 0, -1)).mean())


@pytest.mark.parametrize(("degree", "kinds"), [(3, ("uu", "tt", "tt", "tt")), (5, ("uu",) * 4)])
def test_a_force_and_a_moment_in_a_hole(degree, kinds):
    """Order p − 1: that displacements are single-valued (Michell) follows from stationarity."""
    state = point_forces({PLACES[0]: SOURCES[PLACES[0]]})
    coarse, fine = (misses(state, holed(d, *EYE), kinds, degree) for d in (4, 8))
    assert np.log2(coarse / fine) > degree - 1.45
    assert fine < 2e-3 * 15.0 ** (3 - degree)


def test_three_holes():
    kinds, state = ("ut", "tu", "tt", "uu"), point_forces(SOURCES)
    coarse, fine = (misses(state, holed(d, *THREE), kinds, 5) for d in (2, 4))
    assert fine < 1e-4
    assert coarse / fine > 8.0


def lug(*rim, mesh=None, **options):
    """The eye held on its left side, with these conditions on the rim."""
    mesh = mesh or eye(2)
    mesh = mesh.with_edges("held", lambda x, _: x == -1.5)
    mesh = mesh.with_edges("free", lambda x, y: np.maximum(x, np.abs(y)) == 1.5)
    conditions = [*rim, Displacement("held", x=0.0, y=0.0), Traction("free", x=0.0, y=0.0)]
    return ContactProblem(mesh, STEEL, conditions, **options)


PUSHED = Contact("rim", 0.3, gap=1e-3, plate=RigidPlate(force_x=1.0, force_y=0.4, moment=0.1))
RIMS = {"loaded": [Traction("rim", x=0.5, y=-0.2)], "held": [Displacement("rim", x=1e-3, y=lambda x, _: 1e-3 * x)],
        "pushed": [PUSHED], "tied": [replace(PUSHED, friction=0.0, gap=0.0, law="tied")]}  # fmt: skip


@pytest.fixture(scope="module", params=RIMS)
def rim(request):
    """Conditions on the rim, and the result."""
    return request.param, solved(lug(*RIMS[request.param]), degree=4)


def test_any_cut_gives_the_same(rim):
    """Stresses, tractions, motions and energies; a joint that nothing uses turns the cut away."""
    _, first = rim
    cut = first.discretization.space.frames.on_cuts
    mesh = first.problem.mesh.with_joint("none", np.column_stack([cut[:-1], cut[1:]]))
    second = solved(replace(first.problem, mesh=mesh), degree=4)
    assert not np.isin(second.discretization.space.frames.on_cuts, cut).any()
    assert difference(first, second) < 1e-9
    for contact, line in first.contacts.items():
        assert second.contacts[contact].slip == pytest.approx(line.slip, abs=1e-10)
        assert second.plates[contact].rotation == pytest.approx(first.plates[contact].rotation, rel=1e-9)
    assert second.energies.strain == pytest.approx(first.energies.strain, rel=1e-11)


def test_resultants_balance_to_rounding(rim):
    name, result = rim
    forces = [result.resultant(edges) for edges in ("rim", "held", "free")]
    sums = np.array([[force.x, force.y, force.moment] for force in forces])
    assert np.abs(sums.sum(axis=0)).max() < 1e-12 * np.abs(sums).max()
    force, jump = forces[0], result.discretization.space.jumps(result.dofs)[0]
    unit = result.discretization.scales.stress * result.discretization.scales.length
    assert np.abs(jump[1:] * unit) == pytest.approx(np.abs([force.y, force.x]), rel=1e-9, abs=1e-12)
    if name in ("pushed", "tied"):
        assert (force.x, force.y) == pytest.approx((1.0, 0.4), rel=1e-9)
        assert force.moment == pytest.approx(0.1, rel=1e-8)


def test_a_free_hole_in_a_heavy_body():
    """Its own weight alone would have a resultant on the rim: what would fill the hole."""
    heavy = lug(Traction("rim", x=0.0, y=0.0), body_potential=lambda _, y: 2.0 * y)
    result = solved(heavy, degree=4)
    held = result.resultant("held")
    assert (held.x, held.y) == pytest.approx((0.0, 2.0 * 8.0), abs=1e-11)
    assert abs(result.resultant("rim").y) < 1e-12
    found = bracket(result)
    assert found.guaranteed
    assert found.gap < 5e-2 * found.strain


def test_files(tmp_path):
    """What is stored comes back; the Airy function, which has several values, is left out of pictures' data."""
    meshio = pytest.importorskip("meshio")
    result = solved(lug(PUSHED), degree=4)
    write_npz(tmp_path / "a.npz", result)
    again = load_result(tmp_path / "a.npz")
    assert again.plates["rim"] == result.plates["rim"]
    assert difference(result, again) == 0.0
    assert verify_file(tmp_path / "a.npz").passed
    write_vtu(tmp_path / "a.vtu", result)
    assert "Airy function" not in meshio.read(tmp_path / "a.vtu").point_data


def test_cuts_go_round_joints_where_they_can():
    """A joint from the hole to the outside has no part in the cut; one around the hole is crossed."""
    mesh = eye(2)
    first = shortest_cuts(mesh)[0]
    line = mesh.with_joint("line", np.column_stack([first[:-1], first[1:]]))
    assert not np.isin(shortest_cuts(line)[0], first).any()
    closed = mesh.with_joint("closed", lambda x, y: np.abs(np.maximum(np.abs(x), np.abs(y)) - 1.0) < 1e-9)
    assert len(shortest_cuts(closed)[0]) == len(first)


def test_loads_out_of_balance_as_a_whole():
    """A hole may have a resultant; the body as a whole not, if nothing holds it."""
    mesh = eye(2)
    balanced = [Traction("rim", x=0.6, y=0.0), Traction("outside", x=-0.2, y=0.0)]
    result = solved(ContactProblem(mesh, STEEL, balanced), degree=3)
    assert result.resultant("rim").x == pytest.approx(2.4, rel=1e-12)
    with pytest.raises(InputError, match="out of balance") as caught:
        discretize(ContactProblem(mesh, STEEL, [balanced[0], Traction("outside", x=-0.3, y=0.0)]))
    assert caught.value.value == pytest.approx(1.2, rel=1e-9)
    assert "themselves" not in caught.value.remedy


def test_a_curve_is_the_same_from_edges_in_any_order_and_direction():
    """Those of a mesh file are in none."""
    points = curves.ellipse((0.0, 0.0), (2.0, 1.0))
    vertices = points(np.linspace(0.0, 2.0, 7))
    edges = np.column_stack([np.arange(6), np.arange(1, 7)])
    one, other = (curves.fitted("rim", points, 0.0, 2.0 * np.pi, each, vertices) for each in (edges, edges[::-1, ::-1]))
    assert np.array_equal(one.edges, other.edges)
    assert one.coefficients == pytest.approx(other.coefficients, abs=1e-12)
