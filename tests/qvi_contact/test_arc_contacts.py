"""Contacts on arcs: a rigid shaft in a ring, Hertz on a quarter of a disc, both models, bores in which pins turn."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import TriangleMesh, solve
from qvi_contact.companion import solve_companion
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.refinement import places
from qvi_contact.solution import turning_senses
from tests.qvi_contact.builders import INNER, NU, OUTER, WIDENED, A, polygon, quarter


def ring(contact, other, **settings):
    conditions = [contact, Traction(other, normal=0.0, tangential=0.0), Symmetry("bottom"), Symmetry("left")]
    return solve(ContactProblem(quarter(2, 4), Material(1.0, NU), conditions), **settings)


def test_rigid_shaft():
    result = ring(Contact("inner", 0.0, gap=-WIDENED), "outer", degree=6, law_on="points")
    line = result.contacts["inner"]
    assert result.status.value == "solved"
    assert line.normal_force == pytest.approx(np.pi / 2.0 * INNER, rel=1e-5)
    np.testing.assert_allclose(line.normal_stress, -1.0, atol=2e-3)
    np.testing.assert_allclose(line.tangential_stress, 0.0, atol=1e-9)
    assert result.resultant("inner").x == pytest.approx(1.0, rel=2e-5)
    assert line.path.lengths.sum() == pytest.approx(np.pi / 2.0 * INNER, rel=1e-14)
    assert result.remarks == ()


def test_plate_on_an_arc():
    """A rigid half ring pressed on the outer circle has its force, and in both models the same motion."""
    result = ring(Contact("outer", friction=0.2, plate=RigidPlate(force_y=-0.1)), "inner", degree=4)
    assert result.status.value == "solved"
    assert result.resultant("outer").y == pytest.approx(-0.1, rel=1e-12)
    assert result.bracket.companion.plates["outer"].y == pytest.approx(result.plates["outer"].y, rel=2e-3)


def disc():
    """A quarter of a disc of radius 1 whose lowest point is the origin."""
    angle = np.linspace(0.0, np.pi / 2.0, 4)
    rim, half = (r * np.column_stack([np.sin(angle), -np.cos(angle)]) for r in (1.0, 0.5))
    rim[0, 0], rim[-1, 1], half[-1, 1] = 0.0, 0.0, 0.0
    vertices = np.concatenate([np.zeros((1, 2)), rim, half]) + np.array([0.0, 1.0])
    cells = [three for k in (1, 2, 3) for three in ((k, k + 1, k + 4), (k + 1, k + 5, k + 4), (k + 4, k + 5, 0))]
    sets = {"rim": [(1, 2), (2, 3), (3, 4)], "left": [(1, 5), (5, 0)], "top": [(0, 8), (8, 4)]}
    return TriangleMesh(vertices, cells, sets).with_arc("rim", (0.0, 1.0), 1.0)


def hertz(width, edge, **settings):
    """The quarter on a rigid plane, pressed so that contact is so wide; edges so long where it is."""
    mesh = disc()
    while True:
        edges = mesh.edges("rim")
        nearest = np.minimum(mesh.vertices[edges.first, 0], mesh.vertices[edges.second, 0])
        large = edges.length > np.maximum(edge, 0.6 * (nearest - 1.2 * width))
        if not large.any():
            break
        mesh = mesh.refined(edges.cells[large, 0])
    pairs = mesh.edge_sets["rim"]
    low = mesh.vertices[pairs, 1].mean(axis=1) < 0.3
    mesh = mesh.with_edges("low", pairs[low]).with_edges("free", pairs[~low])
    force = np.pi / 4.0 * width**2 / (1.0 - NU**2)
    conditions = [
        Contact("low", 0.0, gap=lambda _, y: y / (1.0 - y)),  # along the normal of the circle
        Traction("free", normal=0.0, tangential=0.0),
        Traction("top", x=0.0, y=-force / 2.0),
        Symmetry("left"),
    ]
    problem = ContactProblem(mesh, Material(1.0, NU, plane="strain"), conditions)
    return solve(problem, **settings), 2.0 * force / (np.pi * width)


def test_hertz():
    result, largest = hertz(5e-4, 2e-4, degree=5)
    assert result.status.value == "solved"
    assert -result.stress(0.0, 0.0)[1] == pytest.approx(largest, rel=1e-4)
    assert result.remarks == ()


def test_arcs_too_coarse_for_their_contact():
    result, _ = hertz(0.02, 0.05, degree=4)
    assert result.status.value == "solved"
    (remark,) = result.remarks
    assert "(2)" in remark
    assert "graded" in remark


def test_bracket_on_arcs():
    """Both models end at the arcs: their energies enclose the exact one and close in at twice the order."""
    conditions = Contact("inner", 0.3, gap=-WIDENED), Traction("outer", normal=0.0, tangential=0.0)
    gaps, exact = [], np.pi / 4.0 * INNER * WIDENED
    for k in (1, 2):
        given = [*conditions, Symmetry("bottom"), Symmetry("left")]
        result = solve(ContactProblem(quarter(k, 2 * k), Material(1.0, NU), given), degree=4)
        bracket = result.bracket
        assert bracket.lower < exact < bracket.upper
        assert not bracket.guaranteed
        assert any("On arcs" in reason for reason in bracket.reasons)
        gaps.append(bracket.gap / abs(exact))
    assert gaps[1] < 2e-4
    assert np.log2(gaps[0] / gaps[1]) > 5.0
    x, y = np.array([1.0, INNER + 1e-9, 0.7]), np.array([0.0, 0.0, 1.2])
    radius = np.hypot(x, y)
    radial = A * ((1.0 - NU) * radius + (1.0 + NU) * OUTER**2 / radius)
    moved = result.displacement(x, y)
    np.testing.assert_allclose(np.hypot(*moved.T), radial, rtol=1e-3)


@pytest.mark.parametrize(
    ("components", "degree"), [({"normal": -WIDENED}, 3), ({"normal": -WIDENED, "tangential": 0.0}, 2)]
)
def test_displacements_along_normals_of_arcs(components, degree):
    """A ring that is widened along its normals: the energy of displacements of degree p has the order 2p."""
    free = [Traction("inner", tangential=0.0)] if len(components) == 1 else []
    free += [Traction("outer", normal=0.0, tangential=0.0), Symmetry("bottom"), Symmetry("left")]
    exact, errors = np.pi / 4.0 * INNER * WIDENED, []
    for k in (1, 2):
        widened = ContactProblem(quarter(k, 2 * k), Material(1.0, NU), [Displacement("inner", **components), *free])
        errors.append(abs(solve_companion(widened, degree=degree).energy - exact))
    assert errors[1] < 3e-3 * exact
    assert np.log2(errors[0] / errors[1]) > 2.0 * degree - 0.9


def test_smooth_arcs_have_no_corners():
    """A closer look refines where the boundary turns inwards, which an arc of long edges does nowhere inside."""
    mesh = quarter(1, 2)
    conditions = [Traction(name, normal=0.0, tangential=0.0) for name in ("inner", "outer")]
    problem = ContactProblem(mesh, Material(1.0, NU), [*conditions, Symmetry("bottom"), Symmetry("left")])
    assert len(places(problem, mesh, solve(problem, degree=3)).corners) == 4


def test_high_degrees_where_much_is_open():
    """Multipliers on both sides of an open point's shear are large, and must not cost the digits of the tractions."""
    mesh = quarter(1, 4)
    plug = Contact("inner", 0.2, gap=lambda _, y: 0.3 * y**2 - 0.1)
    free = [Traction("outer", normal=0.0, tangential=0.0), Symmetry("bottom"), Symmetry("left")]
    result = solve(ContactProblem(mesh, Material(1.0, NU), [plug, *free]), degree=10, method="condensed")
    assert result.status.value == "solved"
    assert 0.1 < result.contacts["inner"].shares["open"] < 0.9


def turn(angle):
    """The matrix that turns vectors counterclockwise [°]."""
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    return np.array([[c, -s], [s, c]])


def held_ring(contact, angle=0.0):
    """A whole ring, turned, that is held outside; its bore is called "hole"."""
    mesh = polygon(8, 1)
    mesh = replace(mesh, vertices=mesh.vertices @ turn(angle).T)
    mesh = mesh.with_arc("hole", (0.0, 0.0), 1.0).with_arc("outside", (0.0, 0.0), 2.0)
    return ContactProblem(mesh, Material(1.0, NU), [contact, Displacement("outside", x=0.0, y=0.0)])


@pytest.mark.parametrize("angle", [10.0, 90.0])
def test_a_shaft_turns_in_a_rough_bore(angle):
    """Slip is the same all around, also where the tangents of the bore turn back: work is friction times slip."""
    bound, rotation = 0.02, 0.1
    problem = held_ring(Contact("hole", 0.3, law="bilateral", plate=RigidPlate(rotation=rotation)), angle)
    companion = solve_companion(problem, degree=4, bounds={"hole": np.full((8, 1), bound)})
    senses = turning_senses(problem.mesh.vertices, problem.mesh.edges("hole"))
    assert set(senses) == {-1.0, 1.0}
    slip = bound * 0.75 * (1.0 + NU) - rotation  # held outside, twisted by friction
    t = np.linspace(0.0, 1.0, 5)
    np.testing.assert_allclose(senses[:, None] * companion.trace("hole", t)[1], slip, rtol=1e-3)
    np.testing.assert_allclose(senses[:, None] * companion.obstacle("hole", t)[1], rotation, rtol=1e-12)
    assert companion.parts.friction == pytest.approx(-2.0 * np.pi * bound * slip, rel=1e-4)
    assert companion.contacts["hole"].tangential_force == pytest.approx(2.0 * np.pi * bound, rel=1e-9)


def test_both_energies_in_a_round_bore_turn_with_it():
    found = []
    for angle in (0.0, 10.0):
        x, y = turn(angle) @ [0.03, 0.0]
        pin = Contact("hole", 0.2, gap=-0.05, plate=RigidPlate(rotation=0.05, x=x, y=y))
        bracket = solve(held_ring(pin, angle), degree=4).bracket
        differences = bracket.force_differences["hole"]
        found.append([bracket.lower, bracket.upper, bracket.own.energy, differences.normal, differences.tangential])
    lower, upper, *_ = found[0]
    assert lower < upper < lower + 0.01 * abs(lower)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7)


def test_slip_all_around_a_bore_changes_nowhere():
    """A closer look refines where slip changes its sense, not where tangents do."""
    result = solve(held_ring(Contact("hole", 0.2, gap=-0.05, plate=RigidPlate(rotation=0.1))), degree=4)
    assert result.contacts["hole"].shares["slip"] == pytest.approx(1.0)
    assert len(places(result.problem, result.problem.mesh, result).cells) == 0


def test_an_offset_along_tangents_that_turn_back_jumps():
    """Displacements cannot follow it: the upper energy says so."""
    (reason,) = solve_companion(held_ring(Contact.tied("hole", offset=0.1))).reasons
    assert "0.2" in reason
    assert solve_companion(held_ring(Contact.tied("hole", gap=0.1))).reasons == ()
