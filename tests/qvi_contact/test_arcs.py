"""Edges that are arcs of circles: geometry, orders on Lamé's ring, resultants."""

import re

import numpy as np
import pytest
from scipy import integrate

from comparisons.verification.chapters.curves import lame, lame_energy
from comparisons.verification.measures import stress_deviation
from qvi_contact import (
    Contact,
    ContactProblem,
    Corner,
    Displacement,
    Expression,
    InputError,
    Material,
    Symmetry,
    Traction,
    TriangleMesh,
    load_result,
    solve,
    verify_result,
)
from qvi_contact.export import write_npz
from qvi_contact.files.problem_file import problem_from_toml
from qvi_contact.files.problem_writer import problem_to_toml
from qvi_contact.solution.stress import cell_weights
from tests.qvi_contact.rings import INNER, NU, OUTER, WIDENED, quarter


def under_pressure(mesh, **inner):
    return ContactProblem(
        mesh,
        Material(1.0, NU),
        [
            Traction("inner", **(inner or {"normal": -1.0, "tangential": 0.0})),
            Traction("outer", normal=0.0, tangential=0.0),
            Symmetry("bottom"),
            Symmetry("left"),
        ],
    )


def errors(result):
    """Relative errors of the stress in the mean square, and of the energy."""
    return stress_deviation(result, lame), result.energies.strain / lame_energy() - 1.0


@pytest.mark.parametrize("degree", [3, 5])
def test_orders_on_arcs_are_those_of_straight_bodies(degree):
    (coarse, less), (fine, least) = (errors(solve(under_pressure(quarter(k, 2 * k)), degree=degree)) for k in (2, 4))
    assert np.log2(coarse / fine) > degree - 1.3
    assert np.log2(less / least) > 2.0 * (degree - 1.3)


def test_energy_of_a_ring_to_twelve_digits():
    result = solve(under_pressure(quarter(3, 5)), degree=8)
    assert result.status.value == "solved"
    assert len(result.solution.z) < 600
    assert abs(errors(result)[1]) < 1e-12


def test_chords_leave_the_sagitta():
    assert abs(errors(solve(under_pressure(quarter(3, 5, arcs=False)), degree=8))[1]) > 1e-3


def test_areas_follow_arcs():
    known = solve(under_pressure(quarter(1, 2)), degree=4).discretization
    assert cell_weights(known).sum() * known.scales.length**2 == pytest.approx(
        np.pi / 4.0 * (OUTER**2 - INNER**2), rel=1e-13
    )


def test_resultants_of_arcs_are_exact():
    """Pressure on a quarter of a circle has the force of its projections, and no moment about the centre."""
    pressure = solve(under_pressure(quarter(1, 2)), degree=3).resultant("inner")
    assert [pressure.x, pressure.y, pressure.moment] == pytest.approx([1.0, 1.0, 0.0], abs=1e-13)


def test_frames_of_data_are_alike():
    """A pressure given by Cartesian components, which turn along the arc, is the one along the normal."""
    cartesian = under_pressure(quarter(2, 3), x=lambda x, y: x / np.hypot(x, y), y=lambda x, y: y / np.hypot(x, y))
    one, other = (solve(problem, degree=5) for problem in (cartesian, under_pressure(quarter(2, 3))))
    np.testing.assert_allclose(one.dofs, other.dofs, atol=1e-11)


def test_one_component_on_an_arc():
    """Zero shear alone, the normal displacement given: the ring is as under pressure."""
    mesh = quarter(2, 4)
    given = [Traction("inner", tangential=0.0), Displacement("inner", normal=-WIDENED)]
    problem = ContactProblem(mesh, Material(1.0, NU), [*given, *under_pressure(mesh).conditions[1:]])
    assert errors(solve(problem, degree=8))[0] < 1e-5


def test_a_body_that_only_tractions_hold():
    """Tractions of a cubic Φ all around, by x and y: they balance, and the stress is that of Φ."""

    def stress(x, y):
        return 6.0 * y + 2.0 * x, 6.0 * x - 4.0 * y, -2.0 * y + 4.0 * x - 1.0

    def traction(normal, row):
        def value(x, y):
            n, (xx, yy, xy) = normal(x, y), stress(x, y)
            return (xx, xy)[row] * n[0] + (xy, yy)[row] * n[1]

        return value

    normals = {
        "inner": lambda x, y: (-x / np.hypot(x, y), -y / np.hypot(x, y)),
        "outer": lambda x, y: (x / np.hypot(x, y), y / np.hypot(x, y)),
        "bottom": lambda x, y: (0.0 * x, 0.0 * y - 1.0),
        "left": lambda x, y: (0.0 * x - 1.0, 0.0 * y),
    }
    given = [Traction(name, x=traction(normal, 0), y=traction(normal, 1)) for name, normal in normals.items()]
    result = solve(ContactProblem(quarter(2, 4), Material(1.0, NU), given), degree=8)
    x, y = np.array([0.8, 1.2, 1.95]), np.array([0.7, 1.3, 0.1])
    np.testing.assert_allclose(result.stress(x, y), np.stack(stress(x, y), axis=-1), atol=1e-6)


def test_finer_meshes_have_their_vertices_on_the_circle():
    mesh = quarter(1, 2).refined().refined([0, 5])
    for name, radius in (("inner", INNER), ("outer", OUTER)):
        edges = mesh.edges(name)
        np.testing.assert_allclose(np.hypot(*mesh.vertices[edges.first].T), radius, rtol=1e-14)
        assert edges.length.sum() == pytest.approx(np.pi / 2.0 * radius, rel=1e-14)
        np.testing.assert_allclose(np.hypot(*mesh.points_along(edges, np.array([0.3, 0.9]))), radius, rtol=1e-14)


def test_points_between_chord_and_arc_are_found():
    """Beyond the chord of the outer circle lies the body, beyond that of the inner one does not."""
    mesh = quarter(1, 2)
    angle = np.array([0.1, 0.7, 1.5])
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    assert (mesh.locate((OUTER - 1e-6) * way) >= 0).all()
    assert (mesh.locate((INNER - 1e-6) * way) == -1).all()
    assert (mesh.locate((OUTER + 1e-6) * way) == -1).all()
    assert (mesh.locate((INNER + 1e-6) * way) >= 0).all()
    result = solve(under_pressure(mesh), degree=10)
    x, y = (OUTER - 1e-6) * way.T
    np.testing.assert_allclose(result.stress(x, y), lame(x, y), atol=2e-3)
    cells = mesh.locate((OUTER - 1e-2) * way)
    t = mesh.reference(cells, (OUTER - 1e-2) * way)
    placed = np.einsum("nk,nkx->nx", mesh.placed(cells, t[:, None])[:, 0], mesh.corners[cells])
    np.testing.assert_allclose(placed, (OUTER - 1e-2) * way, rtol=1e-14)


def test_arcs_that_cannot_be():
    mesh = quarter(1, 2, arcs=False)
    for centre, radius, place in (((0.0, 0.0), 1.1, "(1, 0)"), ((0.1, 0.0), 1.0, "(")):
        with pytest.raises(InputError) as caught:
            mesh.with_arc("inner", centre, radius)
        assert place in str(caught.value)
    with pytest.raises(InputError):
        mesh.with_arc("nowhere", (0.0, 0.0), 1.0)
    with pytest.raises(InputError, match="two arcs"):
        mesh.with_arc("inner", (0.0, 0.0), 1.0).with_arc("inner", (0.0, 0.0), 1.0)
    triangle = TriangleMesh([(1.0, 0.0), (0.0, 1.0), (0.65, 0.65)], [(0, 1, 2)], {"rim": [(0, 1)]})
    with pytest.raises(InputError, match="bends too far"):
        triangle.with_arc("rim", (0.0, 0.0), 1.0)


@pytest.mark.parametrize(("height", "seen"), [(0.7, False), (0.9, True)])
def test_barycentres_see_their_arcs(height, seen):
    """An eighth of a circle under a triangle whose third corner lies above an end: tangents at the other end decide."""
    end = np.sqrt(0.5)
    vertices = [(1.0, 0.0), (end, end), (1.0 + height, 0.0)]
    triangle = TriangleMesh(vertices, [(0, 1, 2)], {"rim": [(0, 1)]})
    if seen:
        curved = triangle.with_arc("rim", (0.0, 0.0), 1.0)
        x, y = (
            curved.points_along(curved.edges("rim"), np.linspace(0.0, 1.0, 101))
            - curved.corners.mean(axis=1).T[:, None]
        )
        along = np.diff(np.unwrap(np.arctan2(y, x)))
        assert np.abs(np.sign(along).sum()) == 100.0
    else:
        with pytest.raises(InputError, match="bends too far"):
            triangle.with_arc("rim", (0.0, 0.0), 1.0)


def test_problem_files_and_archives_keep_arcs(tmp_path):
    problem = under_pressure(quarter(1, 2))
    again = problem_from_toml(problem_to_toml(problem)).problem
    assert again.mesh.same_as(problem.mesh)
    assert [arc.radius for arc in again.mesh.arcs] == [INNER, OUTER]
    result = solve(problem, degree=4)
    write_npz(tmp_path / "ring.npz", result)
    stored = load_result(tmp_path / "ring.npz")
    np.testing.assert_array_equal(stored.dofs, result.dofs)
    assert stored.problem.mesh.same_as(problem.mesh)


def test_arcs_of_a_problem_file_by_name():
    text = problem_to_toml(under_pressure(quarter(1, 2, arcs=False)))

    def given(radius):
        arc = f'{{ name = "inner", centre = [0.0, 0.0], radius = {radius} }}'
        return problem_from_toml(text.replace("[mesh]\n", f"[mesh]\narcs = [{arc}]\n")).problem

    assert given("1.0").mesh.curved.sum() == 2
    for wrong, place in (("1.1", "mesh.arcs[0].radius"), ("-1.0", "mesh.arcs[0].radius")):
        with pytest.raises(InputError) as caught:
            given(wrong)
        assert caught.value.field == place


def test_materials_and_joints_along_an_arc():
    """A closed joint between two rings of one material, along an arc: energy and pressure of one ring."""
    mesh = quarter(2, 4)
    middle = (INNER + OUTER) / 2.0

    def between(x, y):
        return np.abs(np.hypot(x, y) - middle * np.cos(np.pi / 16.0)) < 1e-6

    mesh = mesh.with_joint("between", between).with_arc("between", (0.0, 0.0), middle)
    problem = under_pressure(mesh)
    joined = ContactProblem(mesh, problem.material, [*problem.conditions, Contact("between", 0.0)])
    result = solve(joined, degree=6)
    assert abs(errors(result)[1]) < 1e-6
    pressure = -lame(middle, 0.0)[0]
    np.testing.assert_allclose(result.contacts["between"].normal_stress, -pressure, rtol=2e-3)


def test_pictures_draw_arcs():
    pytest.importorskip("matplotlib")
    from qvi_contact.plots.style import cell_outlines, edge_lines
    from qvi_contact.plots.symbols import runs

    mesh = quarter(1, 2)
    for name, radius in (("inner", INNER), ("outer", OUTER)):
        edges = mesh.edges(name)
        np.testing.assert_allclose(np.hypot(*edge_lines(mesh, edges).reshape(-1, 2).T), radius, rtol=1e-14)
        (run,) = runs(mesh, edges)
        assert run.length == pytest.approx(np.pi / 2.0 * radius, rel=1e-2)
        np.testing.assert_allclose(np.hypot(*run.line.T), radius, rtol=1e-14)
    radii = np.hypot(*np.moveaxis(cell_outlines(mesh), -1, 0))
    assert radii.min() == pytest.approx(INNER, rel=1e-14)
    assert (np.abs(radii - OUTER) < 1e-12).sum() > 12


def test_arcs_that_a_notebook_draws():
    """The picture is 280 points high and wide: places on the outer circle are so far from its centre."""
    path = re.findall(r'd="([^"]*)" stroke="#444"', quarter(1, 2)._repr_html_())[0]
    places = np.array([[float(x) for x in place.split()] for place in re.split("[ML]", path)[1:]])
    radii = np.hypot(*(places - [8.0, 288.0]).T)
    assert (np.abs(radii - 280.0) < 0.1).sum() == 2 * 9 + 2
    assert (np.abs(radii - 140.0) < 0.1).sum() == 2 * 9 + 2


def test_finer_meshes_see_their_arcs():
    """A triangle halved beside its arc is too flat for it, and divided until the arc is short enough."""
    mesh = quarter(1, 2)
    for cell in range(mesh.cell_count):
        finer = mesh.refined([cell]).refined([cell])
        radii = np.hypot(*finer.vertices[finer.edge_sets["inner"]].reshape(-1, 2).T)
        np.testing.assert_allclose(radii, INNER, rtol=1e-14)


@pytest.mark.parametrize("degree", [3, 4, 6])
@pytest.mark.parametrize(
    "load", [{"normal": "-1 - sin(3*x)", "tangential": "0.2*exp(x)"}, {"x": "cos(4*x)", "y": "-exp(x)"}]
)
def test_loads_that_are_no_polynomials_keep_their_force_on_arcs(load, degree):
    """The force is that of the data, by quadrature over the angle; normal and tangential components are no forces."""
    corners = [Corner((0, 0), "b"), Corner((2, 0), "r"), Corner((2, 1), "t", (1, 0.2)), Corner((0, 1), "l")]
    fields = {name: Expression(text) for name, text in load.items()}
    held = [Displacement("r", x=0.0, y=0.0), Traction("l", x=0.0, y=0.0)]
    material = Material(1e4, 0.3)
    problem = ContactProblem(
        TriangleMesh.outline(corners, 0.6), material, [Contact("b", 0.3), *held, Traction("t", **fields)]
    )
    result = solve(problem, degree=degree)

    def traction(angle, axis):
        x, y = 1.0 + radius * np.cos(angle), 0.2 + radius * np.sin(angle)
        normal, tangent = (np.cos(angle), np.sin(angle)), (np.sin(angle), -np.cos(angle))
        if "x" in load:
            return radius * float(fields["xy"[axis]](x, y))
        return radius * float(fields["normal"](x, y) * normal[axis] + fields["tangential"](x, y) * tangent[axis])

    radius, start = np.hypot(1.0, 0.8), np.arctan2(0.8, 1.0)
    force = [integrate.quad(traction, start, np.pi - start, (axis,), epsabs=1e-12)[0] for axis in (0, 1)]
    found = result.resultant("t")
    assert (found.x, found.y) == pytest.approx(force, abs=1e-10)
    assert verify_result(result).passed
