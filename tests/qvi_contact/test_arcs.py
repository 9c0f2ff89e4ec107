"""Edges that are arcs of circles: geometry, loads, bounds and plates on them, what rigid bodies carry on them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate

from comparisons.verification.chapters.curves import lame
from qvi_contact import Corner, Expression, InputError, TriangleMesh, solve, verify_result
from qvi_contact.bracket import bracket
from qvi_contact.companion import solve_companion, solve_companions
from qvi_contact.gallery import arc, fan
from qvi_contact.mechanism import Rigid
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.refinement import energies_between, places
from qvi_contact.solution import rest_on_arcs, turning_senses
from tests.qvi_contact.builders import INNER, NU, OUTER, WIDENED, A, polygon, quarter

FREE = [Traction("outer", normal=0.0, tangential=0.0), Symmetry("bottom"), Symmetry("left")]


def under_pressure(mesh, **inner):
    pressure = Traction("inner", **(inner or {"normal": -1.0, "tangential": 0.0}))
    return ContactProblem(mesh, Material(1.0, NU), [pressure, *FREE])


def test_resultants_of_arcs_are_exact_and_smooth_arcs_have_no_corners():
    """Pressure on a quarter of a circle has the force of its projections, and no moment about the centre.

    A closer look refines where the boundary turns inwards, which an arc of long edges does nowhere inside.
    """
    result = solve(under_pressure(quarter(1, 2)), degree=3)
    pressure = result.resultant("inner")
    assert [pressure.x, pressure.y, pressure.moment] == pytest.approx([1.0, 1.0, 0.0], abs=1e-13)
    assert len(places(result).corners) == 4
    # what stresses miss of tractions on arcs vanishes by the order
    coarse, fine = (solve(under_pressure(quarter(n, 2 * n)), degree=4) for n in (1, 2))
    rest, coarse_rest = (rest_on_arcs(each.discretization, each.dofs).max() for each in (fine, coarse))
    assert 0.0 < rest < coarse_rest / 7.0


def test_frames_of_data_are_alike():
    """A pressure given by Cartesian components, which turn along the arc, is the one along the normal."""
    cartesian = under_pressure(quarter(2, 3), x=lambda x, y: x / np.hypot(x, y), y=lambda x, y: y / np.hypot(x, y))
    one, other = (solve(problem, degree=5) for problem in (cartesian, under_pressure(quarter(2, 3))))
    np.testing.assert_allclose(one.dofs, other.dofs, atol=1e-11)


def test_directions_that_turn_and_those_that_do_not_share_nothing():
    """A pressure along y and one along the normal, on an arc whose chord lies along x, in turns on one mesh."""
    corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [0.0, 0.0]]
    names = dict(zip(("bottom", "right", "top", "left"), [[[k, (k + 1) % 4]] for k in range(4)], strict=True))
    free = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]

    def force(mesh, *loads):
        problem = ContactProblem(mesh, Material(1.0, NU), [Contact("bottom", 0.3), *free, *loads])
        return solve(problem).contacts["bottom"].normal_force

    def arched():
        cells = [[k, (k + 1) % 4, 4] for k in range(4)]
        return TriangleMesh(corners, cells, names).with_arc("top", (0.0, 0.0), 2.0**0.5)

    cases = [
        (Traction("top", normal=-1.0), Displacement("top", tangential=0.0)),
        (Traction("top", y=-1.0), Displacement("top", x=0.0)),
    ]
    mesh = arched()
    shared, alone = [force(mesh, *loads) for loads in cases], [force(arched(), *loads) for loads in cases]
    assert shared == pytest.approx(alone, rel=1e-10)
    assert shared[0] < 0.9 * shared[1]


def test_points_between_chord_and_arc_are_found():
    """Beyond the chord of the outer circle lies the body, beyond that of the inner one does not."""
    mesh = quarter(1, 2)
    angle = np.array([0.1, 0.7, 1.5])
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    for radius, beyond in ((INNER, 1.0), (OUTER, -1.0)):
        assert (mesh.locate((radius + 1e-6 * beyond) * way) >= 0).all()
        assert (mesh.locate((radius - 1e-6 * beyond) * way) == -1).all()
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
        points = curved.points_along(curved.edges("rim"), np.linspace(0.0, 1.0, 101))
        x, y = points - curved.corners.mean(axis=1).T[:, None]
        along = np.diff(np.unwrap(np.arctan2(y, x)))
        assert np.abs(np.sign(along).sum()) == 100.0
    else:
        with pytest.raises(InputError, match="bends too far"):
            triangle.with_arc("rim", (0.0, 0.0), 1.0)


def test_finer_meshes_see_their_arcs():
    """A triangle halved beside its arc is too flat for it, and divided until the arc is short enough."""
    mesh = quarter(1, 2)
    for cell in range(mesh.cell_count):
        finer = mesh.refined([cell]).refined([cell])
        radii = np.hypot(*finer.vertices[finer.edge_sets["inner"]].reshape(-1, 2).T)
        np.testing.assert_allclose(radii, INNER, rtol=1e-14)
        assert finer.edges("outer").length.sum() == pytest.approx(np.pi / 2.0 * OUTER, rel=1e-14)


@pytest.mark.parametrize(
    ("load", "degree"),
    [({"normal": "-1 - sin(3*x)", "tangential": "0.2*exp(x)"}, 3), ({"x": "cos(4*x)", "y": "-exp(x)"}, 6)],
)
def test_loads_that_are_no_polynomials_keep_their_force_on_arcs(load, degree):
    """The force is that of the data, by quadrature over the angle; normal and tangential components are no forces."""
    corners = [Corner((0, 0), "b"), Corner((2, 0), "r"), Corner((2, 1), "t", (1, 0.2)), Corner((0, 1), "l")]
    fields = {name: Expression(text) for name, text in load.items()}
    held = [Displacement("r", x=0.0, y=0.0), Traction("l", x=0.0, y=0.0)]
    given = [Contact("b", 0.3), *held, Traction("t", **fields)]
    problem = ContactProblem(TriangleMesh.outline(corners, 0.6), Material(1e4, 0.3), given)
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


STEEL = Material(1000.0, 0.3)


def test_the_work_of_pressure_on_arcs():
    """Of a uniform pressure all around nothing is left, and on the lower half of a ring what is above it."""
    angles = np.linspace(0.0, np.pi, 5)
    mesh = fan([arc(0.5, angles), arc(1.0, angles)], closed=False, arcs=("inner", "outer"))
    loads = [Traction(e, normal=-3.0, tangential=0.0) for e in ("inner", "outer", "start", "end")]
    pressed = ContactProblem(mesh, STEEL, loads)
    works = Rigid(pressed).works
    assert sum(work.row for work in works.values()) == pytest.approx(0.0, abs=1e-13)
    assert works["outer"].row[:2] == pytest.approx([0.0, -6.0], abs=1e-13)
    along = ContactProblem(mesh, STEEL, [Traction(e, x=0.0, y=-1.0) for e in ("inner", "outer", "start", "end")])
    assert Rigid(along).works["outer"].row[:2] == pytest.approx([0.0, -np.pi], abs=1e-13)


def test_supports_on_arcs_let_a_disc_turn():
    """Held normally all around it can turn about its centre, and nothing else."""
    mesh = fan([arc(1.0, np.linspace(0.0, 2.0 * np.pi, 13)[:-1])], closed=True, centre=(0.0, 0.0), arcs=("outer",))
    held = [Displacement("outer", normal=0.0), Traction("outer", tangential=0.0)]
    turning = Rigid(ContactProblem(mesh, STEEL, held)).free
    assert turning.shape == (3, 1)
    assert np.abs(turning[:, 0]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_arcs_too_coarse_for_their_contact():
    """A plane touches the ring on one edge, and on the mirror image of that."""
    free = [Traction("inner", normal=0.0, tangential=0.0), Symmetry("bottom"), Symmetry("left")]
    plane = Contact("outer", 0.0, gap=lambda x, _: 1.9 - x)
    result = solve(ContactProblem(quarter(2, 4), Material(1.0, NU), [plane, *free]), degree=4)
    assert result.status.value == "solved"
    (remark,) = result.remarks
    assert "(2)" in remark
    assert "graded" in remark


@pytest.mark.parametrize(
    ("gap", "lift", "few"),
    [("(x - 1)**2 - 0.1", "0", True), ("1e-4 * (x - 1)", "0", False), ("0.3", "0.3 + 0.1 * (x - 1)", False)],
)
def test_a_mesh_too_coarse_for_a_round_pad(gap, lift, few):
    """A pad on two edges out of four has no pressure worth reading; a plate is no pad, nor is its rounding."""
    sides = [Displacement("bottom", 0.0, Expression(lift)), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    pad, mesh = Contact("top", 0.1, gap=Expression(gap)), TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    remarks = solve(ContactProblem(mesh, Material(1.0, NU), [pad, *sides])).remarks
    assert any("fewer than 4 edges (2)" in remark for remark in remarks) == few


def test_bracket_on_arcs():
    """Both models end at the arcs: their energies enclose the exact one and close in at twice the order."""
    gaps, exact = [], np.pi / 4.0 * INNER * WIDENED
    for k in (1, 2):
        given = [Contact("inner", 0.3, gap=-WIDENED), *FREE]
        result = solve(ContactProblem(quarter(k, 2 * k), Material(1.0, NU), given), degree=4)
        bounds = result.bracket
        assert bounds.lower < exact < bounds.upper
        assert any("On arcs" in reason for reason in bounds.reasons)
        lower, upper = bounds.coulomb.forces["inner.normal_force"]
        assert lower < np.pi / 2.0 * INNER < upper
        gaps.append(bounds.gap / abs(exact))
    assert gaps[1] < 2e-4
    assert np.log2(gaps[0] / gaps[1]) > 5.0
    x, y = np.array([1.0, INNER + 1e-9, 0.7]), np.array([0.0, 0.0, 1.2])
    radial = A * ((1.0 - NU) * np.hypot(x, y) + (1.0 + NU) * OUTER**2 / np.hypot(x, y))
    np.testing.assert_allclose(np.hypot(*result.displacement(x, y).T), radial, rtol=1e-3)


def test_errors_on_arcs_without_friction():
    """Energies alone would say less than the true error. What displacements that slip miss between nodes costs none."""
    problem = ContactProblem(quarter(2, 4), Material(1.0, NU), [Contact("inner", 0.0, gap=-WIDENED), *FREE])
    fine, found = solve(replace(problem, mesh=problem.mesh.refined()), degree=7), bracket(solve(problem, degree=4), 5)
    true = np.sqrt(energies_between(found.result, fine).sum() / found.strain)
    assert np.sqrt(found.gap / found.strain) < true < found.relative_error < 1.2 * true
    assert 0.0 < found.upper / (np.pi / 4.0 * INNER * WIDENED) - 1.0 < 1e-7


def test_high_degrees_where_much_is_open():
    """Multipliers on both sides of an open point's shear are large, and must not cost the digits of the tractions."""
    mesh = quarter(1, 4)
    plug = Contact("inner", 0.2, gap=lambda _, y: 0.3 * y**2 - 0.1)
    result = solve(ContactProblem(mesh, Material(1.0, NU), [plug, *FREE]), degree=10, method="condensed")
    assert result.status.value == "solved"
    assert 0.1 < result.contacts["inner"].shares["open"] < 0.9


def held_ring(contact, angle=0.0):
    """A whole ring, turned by an angle [°], that is held outside; its bore is called "hole"."""
    mesh = polygon(8, 1)
    places = np.exp(1j * np.deg2rad(angle)) * (mesh.vertices @ [1.0, 1.0j])
    mesh = replace(mesh, vertices=np.column_stack([places.real, places.imag]))
    mesh = mesh.with_arc("hole", (0.0, 0.0), 1.0).with_arc("outside", (0.0, 0.0), 2.0)
    return ContactProblem(mesh, Material(1.0, NU), [contact, Displacement("outside", x=0.0, y=0.0)])


def test_a_ring_that_nothing_holds():
    """Elements beside arcs turn as rigid bodies up to their order: what pressure does on that is no load left over."""
    loads = [Traction("hole", normal=-1.0, tangential=0.0), Traction("outside", normal=0.0, tangential=0.0)]
    problem = replace(held_ring(Contact("hole", 0.3)), conditions=loads)
    moved = solve(problem, degree=4).displacement([1.0, -1.0], [0.0, 0.0])[:, 0]
    assert (moved[0] - moved[1]) / 2.0 == pytest.approx(WIDENED, rel=3e-3)


@pytest.mark.parametrize("angle", [10.0, 90.0])
def test_a_shaft_turns_in_a_rough_bore(angle):
    """Slip is the same all around, also where the tangents of the bore turn back: work is friction times slip."""
    bound, rotation = 0.02, 0.1
    problem = held_ring(Contact("hole", 0.3, law="bilateral", plate=RigidPlate(rotation=rotation)), angle)
    companion = solve_companions(problem, [{"hole": np.full((8, 1), bound)}], degree=4)[0]
    senses = turning_senses(problem.mesh.vertices, problem.mesh.edges("hole"))
    assert set(senses) == {-1.0, 1.0}
    slip = bound * 0.75 * (1.0 + NU) - rotation  # held outside, twisted by friction
    t = np.linspace(0.0, 1.0, 5)
    np.testing.assert_allclose(senses[:, None] * companion.trace("hole", t)[1], slip, rtol=1e-3)
    assert companion.parts["friction"] == pytest.approx(-2.0 * np.pi * bound * slip, rel=1e-4)
    assert companion.contacts["hole"].tangential_force == pytest.approx(2.0 * np.pi * bound, rel=1e-9)


def test_slip_all_around_a_bore_changes_nowhere():
    """A closer look refines where slip changes its sense, not where tangents do; the force has bounds."""
    result = solve(held_ring(Contact("hole", 0.2, gap=-0.05, plate=RigidPlate(rotation=0.1))), degree=4)
    assert result.contacts["hole"].shares["slip"] == pytest.approx(1.0)
    assert len(places(result).cells) == 0
    lower, upper = result.bracket.forces["hole.tangential_force"]
    assert 0.09 < lower < 0.2 * result.contacts["hole"].normal_force < upper


def test_bounds_do_not_depend_on_where_tangents_turn_back():
    """A pin that is moved along x sticks there, one that is moved along y has its largest share of friction there."""
    drives = ({"x": 0.1}, 0.0), ({"y": 0.1}, 90.0)
    moved = [held_ring(Contact("hole", 0.3, gap=-0.2, plate=RigidPlate(**given)), angle) for given, angle in drives]
    along, across = (solve(problem, degree=4).bracket.coulomb.error for problem in moved)
    assert across == pytest.approx(along, rel=1e-6)


def test_an_offset_along_tangents_that_turn_back_jumps():
    """Displacements cannot follow it: the upper energy says so."""
    (reason,) = solve_companion(held_ring(Contact.tied("hole", offset=0.1))).reasons
    assert "0.2" in reason
    assert solve_companion(held_ring(Contact.tied("hole", gap=0.1))).reasons == ()
