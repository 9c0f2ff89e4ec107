"""Bounds of the energy: they hold and close, exact states, settled forces, gaps of cells, turned bodies, units."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from qvi_contact import Polynomial, TriangleMesh, load_result, refine, solve, solve_history
from qvi_contact.bracket import BracketKind, EdgeTractions, bracket, computed_norm
from qvi_contact.companion import solve_companion
from qvi_contact.export import write_npz
from qvi_contact.gallery import compressed_plate
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from tests.cases import refused_at, thinned
from tests.qvi_contact.test_triangles import STEEL, moved, oblique

U, ROUNDING = 1e-3, 1e-9


def with_contact(contact, mesh=None):
    """The compressed plate with another contact on its top."""
    problem = compressed_plate(0.0, (2, 2))
    conditions = [contact if isinstance(condition, Contact) else condition for condition in problem.conditions]
    return replace(problem, conditions=conditions, mesh=mesh or problem.mesh)


CONVEX = {
    "tied": Contact.tied("top", gap=-U),
    "tresca": Contact.tresca("top", 20.0, gap=-U),
    "frictionless, curved": Contact.frictionless("top", gap=lambda x, _: -U * (1.0 - 1.4 * x**2)),
    "cohesion that falls": Contact("top", 0.0, gap=-U, cohesion=lambda x, _: 40.0 - 20.0 * x, law="bilateral"),
    "capped": Contact("top", 0.0, gap=-U, cohesion=lambda x, _: 40.0 * x, shear_limit=35.0),  # from x = 7/8 on
}


@cache
def bracket_of(name, depth, degree, rows="edges"):
    mesh = TriangleMesh.rectangle((2, 2)).graded([(1.0, 1.0)], depth)
    return bracket(solve(with_contact(CONVEX[name], mesh), degree=degree, law_on=rows, tolerance=1e-9))


@pytest.mark.parametrize(("name", "degree"), thinned(product(CONVEX, (3, 5)), 3))
def test_bounds_enclose_and_close(name, degree):
    """Guaranteed bounds of all meshes and degrees enclose one energy, and cells add up to the gap."""
    coarse, fine = (bracket_of(name, depth, degree) for depth in (0, 4))
    finest = bracket_of(name, 4, 5)
    for found in (coarse, fine):
        assert found.kind is BracketKind.PROBLEM
        assert found.guaranteed is (name != "capped" or found is fine), found.reasons
        assert found.lower <= found.upper
        assert found.cell_gaps.shape == (found.problem.mesh.cell_count,)
        assert found.cell_gaps.min() >= 0.0
        for parts in (found.cell_gaps, list(found.parts.values())):
            assert np.sum(parts) == pytest.approx(found.gap, rel=1e-5, abs=1e-9 * found.strain)
        assert found.uniqueness.apart == 0.0
        assert found.lower <= finest.upper
        assert found.upper >= finest.lower or not found.guaranteed
    assert fine.gap < 0.6 * coarse.gap
    if name in ("tresca", "frictionless, curved"):  # stresses of Gauss rows are made admissible
        gauss = bracket_of(name, 0, degree, "points")
        assert (gauss.guaranteed, gauss.result.discretization.rule.law_on) == (True, "edges")
        assert gauss.lower == pytest.approx(coarse.lower, rel=1e-7)


def test_a_bound_between_two_laws_is_lowered():
    """Cohesion 40 x and limit 35: on the edge that holds x = 7/8 the smaller coefficient counts."""
    problem = with_contact(CONVEX["capped"], TriangleMesh.rectangle((2, 2)))
    result = solve(problem, degree=4)
    own = EdgeTractions.of(result.discretization, result.dofs)
    starts = problem.mesh.vertices[problem.mesh.edges("top").first, 0]
    expected = np.minimum(40.0 * (starts[:, None] + [0.0, 0.25, 0.5]), 35.0)
    assert own.bound * result.discretization.scales.stress == pytest.approx(expected, rel=1e-12)
    assert not own.exact.all()


def test_turned_as_a_whole():
    """Its base is clamped, and its weight counts from the top, where the potential of what is slanted is rounding."""
    plate, c, s = compressed_plate(0.2, (3, 3)), 0.1 * np.cos(np.radians(30.0)), 0.1 * np.sin(np.radians(30.0))
    clamped = [Displacement("bottom", 0.0, 0.0) if each.edges == "bottom" else each for each in plate.conditions]
    problem = replace(plate, conditions=clamped, body_potential=Polynomial([[0.1, -0.1]]))
    slanted = replace(problem, mesh=oblique(problem.mesh, 30.0), body_potential=Polynomial([[0.1, -c], [s]]))
    straight, found = (bracket(solve(each, degree=4, tolerance=1e-10)) for each in (problem, slanted))
    assert (found.kind, found.reasons) == (straight.kind, straight.reasons)
    assert (found.lower, found.upper) == pytest.approx((straight.lower, straight.upper), rel=1e-10)
    assert found.cell_gaps == pytest.approx(straight.cell_gaps, abs=1e-9 * straight.strain)
    errors = found.coulomb, straight.coulomb
    assert (errors[0].kind, errors[0].error) == ("guaranteed", pytest.approx(errors[1].error, rel=1e-8))
    assert computed_norm(slanted, errors[0].shares) == pytest.approx(computed_norm(problem, errors[1].shares), rel=1e-8)


def test_weight():
    """A potential of degree 2 on cells: its work is integrated exactly, along contacts it needs σ_N of that degree."""
    conditions = [Contact.frictionless("bottom"), Symmetry("left"), Symmetry("right"), Traction("top", 0.0, -1.0)]
    mesh = moved(TriangleMesh.rectangle((2, 2)))
    for degree, potential, guaranteed in (
        (3, lambda x, y: 5.0 * y + 0.0 * x, True),
        (4, lambda x, y: 5.0 * y + x * y, True),
        (3, lambda x, _: 1e-28 * np.sin(9.0 * x), True),  # beside a load of 1
        (3, lambda x, y: 5.0 * y + x**2, False),
        (5, lambda x, y: 5.0 * y + x**3 * y**3, False),
    ):
        found = bracket(solve(ContactProblem(mesh, STEEL, conditions, potential), degree=degree), 4)
        assert found.guaranteed is guaranteed, found.reasons
        assert found.lower <= found.upper + 1e-12 * found.strain
        assert found.strain == pytest.approx(found.result.energies.strain, rel=1e-12)


@pytest.mark.parametrize("law", [{"friction": 0.3}, {"friction": 0.0, "cohesion": 1.0}])
def test_steps_of_a_history_are_bracketed_each_for_itself(law):
    """The last step on a finer mesh, with the same slip before it, lies between the bounds; it is the smaller one."""
    mesh = TriangleMesh.grid([0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 0.5, 1.0])
    free = [Contact("bottom", **law), Traction("left", 0.0, 0.0)]
    steps = [
        ContactProblem(mesh, STEEL, [*free, Traction("right", -4e4 * x, 0.0), Displacement("top", x, -2.0 * x)])
        for x in (0.004, 0.001)
    ]
    history = solve_history(steps)
    first, last = (step.bracket for step in history.steps)
    assert history.steps[1].energies.complementary == pytest.approx(-last.lower, rel=2e-3)
    assert not any("steps before" in reason for reason in first.reasons)
    assert any("steps before" in reason for reason in last.reasons)
    assert not last.guaranteed
    at = np.array([0.5, 1.0, 1.5])
    slips = [last.problem.contacts[0].offset(at + side, 0.0 * at) for side in (-1e-9, 1e-9)]
    assert slips[0] == pytest.approx(slips[1], rel=1e-6, abs=1e-10)  # the slip before, continuous
    assert np.abs(slips[0]).max() > 1e-5
    same = replace(last.problem, mesh=mesh.refined(np.ones(len(mesh.cells), dtype=bool)))
    fine = solve(same, degree=5)
    assert last.lower <= fine.bracket.lower < fine.bracket.upper <= last.upper
    assert fine.bracket.gap < 0.3 * last.gap
    for name, (lower, upper) in last.forces.items():
        force = getattr(fine.contacts["bottom"], name.removeprefix("bottom."))
        assert lower - ROUNDING < force < upper + ROUNDING  # all slips: friction is its bound
    assert len(last.forces) == 2


@pytest.mark.parametrize(("bound", "force", "near"), [(0.0, 209.0, 0.03), (5.0, 209.75, 0.03), (1e2, 214.3597782, 0.2)])
def test_forces_under_tresca_law_of_the_plate(bound, force, near):
    """209 + ν c/2 by reciprocity while all slips; with stick that of 16² cells. Slip of one sense narrows bounds."""
    plate = compressed_plate(0.0, (4, 4))
    contact = Contact.tresca("top", bound, gap=-U, name="plate")
    found = solve(replace(plate, conditions=[*plate.conditions[:3], contact])).bracket
    lower, upper = found.forces["plate.normal_force"]
    assert found.guaranteed
    assert force - near < lower < force < upper + ROUNDING < force + near
    refined = refine(found.problem, target=4e-4, quantity="plate.normal_force", guaranteed=True)
    assert refined.guaranteed
    assert abs(refined.value - force) <= refined.error + ROUNDING <= 4e-4 * force + ROUNDING


def test_forces_are_as_narrow_in_every_frame():
    """A block slips to both sides of its middle, where rounding alone gives the slip a sense."""
    sides = [Contact.tresca("bottom", 0.3), Displacement("top", normal=-0.03, tangential=0.0), *FREE]
    for angle in (0.0, 57.0, 80.0, 115.0, 140.0, 200.0, 300.0):
        mesh = oblique(TriangleMesh.rectangle((4, 2), 2.0, 1.0), angle)
        forces = solve(ContactProblem(mesh, Material(100.0, 0.3, "strain"), sides)).bracket.forces
        assert forces["bottom.normal_force"] == pytest.approx((7.004395753, 7.112703481), rel=1e-7)


@pytest.mark.parametrize("law", [{"friction": 0.5}, {"friction": 0.0, "cohesion": 1e4}])
def test_a_later_step_has_no_guarantee_even_if_nothing_was_seen_to_slip(law, tmp_path):
    steps = [with_contact(Contact("top", gap=-load, **law)) for load in (U, 2.0 * U)]
    first, last = solve_history(steps, method="pivoting").steps
    write_npz(tmp_path / "last.npz", last)
    for later in (last, load_result(tmp_path / "last.npz")):
        assert (first.bracket.guaranteed, later.bracket.guaranteed) == (True, False)


def test_what_has_no_bracket_is_refused():
    nothing = ContactProblem(BLOCK, STEEL, [Contact("bottom", 0.1), Traction("top", 1.0, -1.0), *FREE])
    for refused in (compressed_plate(0.2), solve(nothing)):
        with refused_at("result"):
            bracket(refused)


SOAKED, HELD = Material(1000.0, 0.3), Displacement("top", 0.0, 0.0)
BLOCK = TriangleMesh.rectangle((3, 3), 2.0, 1.0)
FREE = Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)


def falling(x, y):
    return 3.0 - x + 0.0 * y


def block(contact, *top):
    return ContactProblem(BLOCK, SOAKED, [contact, *top, *FREE])


CASES = {
    "pressed": (Contact("bottom", 0.0, pore_pressure=falling, gap=1e-3), [Traction("top", 0.0, -8.0)]),
    "-6e-17": (Contact("bottom", 0.0, pore_pressure=lambda x, _: 0.3 - 0.1 * (x + 1.0)), [Traction("top", 0.0, -8.0)]),
    "Tresca": (Contact("bottom", 0.0, cohesion=1.0, pore_pressure=2.0), [Displacement("top", 2e-3, -1e-2)]),
    "x⁴": (Contact("bottom", 0.0, pore_pressure=lambda x, _: 1.0 + x**4 / 8.0), [Traction("top", 0.0, -8.0)]),
    "open": (Contact("bottom", 0.0, pore_pressure=falling, gap=1.0), [HELD]),
    "plate": (Contact("bottom", 0.0, pore_pressure=falling, plate=RigidPlate(force_y=16.0)), [HELD]),
}


@pytest.mark.parametrize("case", CASES)
def test_bounds(case):
    """Guaranteed, their parts add up, and both models transmit the whole traction."""
    contact, top = CASES[case]
    result = solve(block(contact, *top), tolerance=1e-10)
    found = result.bracket
    assert found.kind is BracketKind.PROBLEM
    assert found.guaranteed is (case != "x⁴"), found.reasons
    assert -1e-12 * found.strain <= found.gap < 0.02 * found.strain
    within = 1e-10 * 3.0 * 2.0  # what a pressure within the tolerance of the solve does along a gap of 1
    assert found.cell_gaps.sum() == pytest.approx(found.gap, rel=1e-6, abs=within)
    ours, theirs = result.contacts["bottom"], found.companion.contacts["bottom"]
    assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-2)
    if case != "Tresca":
        assert ours.normal_force == pytest.approx(4.0 if case == "open" else 16.0, rel=1e-9)
        assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-9)


def test_an_open_contact_full_of_fluid_is_a_load():
    """The same displacements as under a traction in its place."""
    contact, (top,) = CASES["open"]
    wet, loaded = (solve_companion(block(each, top)) for each in (contact, Traction("bottom", 0.0, falling)))
    x, y = np.random.default_rng(0).uniform(size=(2, 20)) * [[2.0], [1.0]]
    assert wet.displacement(x, y) == pytest.approx(loaded.displacement(x, y), abs=1e-12)
    assert wet.contacts["bottom"].normal_stress.max() < -0.9


def test_both_faces_of_a_joint_feel_it():
    mesh = TriangleMesh.rectangle((3, 4), 2.0, 1.0).with_joint("seam", lambda _, y: np.isclose(y, 0.5))
    joint = Contact("seam", 0.0, pore_pressure=falling, gap=1.0)
    held = [HELD, replace(HELD, edges="bottom")]
    found = solve(ContactProblem(mesh, SOAKED, [joint, *held, *FREE]), tolerance=1e-10).bracket
    assert found.guaranteed
    assert found.cell_gaps.sum() == pytest.approx(found.gap, rel=1e-6)
    assert found.companion.contacts["seam"].normal_force == pytest.approx(4.0, rel=1e-10)


@pytest.mark.parametrize(("side", "beside", "force"), [("bottom", "left", -2.0), ("right", "top", -0.5)])
def test_forces_of_a_support_that_is_moved_along_its_normal(side, beside, force):
    """A block 2 × 1 of E = 1000 pressed between its support and a line of symmetry; its name is that of the motion."""
    ends = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}
    moved_in = [Displacement(side, normal=-1e-3), Traction(side, tangential=0.0)]
    free = Traction(ends[beside], normal=0.0, tangential=0.0)
    sides = [*moved_in, Symmetry(ends[side]), Symmetry(beside), free]
    bounds = solve(ContactProblem(TriangleMesh.rectangle((2, 2), 2.0, 1.0), STEEL, sides)).bracket
    assert bounds.guaranteed
    ((name, found),) = bounds.forces.items()
    assert name == f"{side}.normal"
    assert found == pytest.approx((force, force), rel=1e-9)


@pytest.mark.parametrize(("digits", "apart"), [(12, 0.0), (7, 0.0), (6, 0.0), (12, 1e-3), (7, 1e-3), (6, 1e-3)])
def test_sides_are_straight_but_for_rounded_coordinates(digits, apart):
    """An oblique block moves along its support, touches a wall, and moves nowhere far where supports disagree."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 1.0).with_edges("held", lambda x, y: (y == 0.0) & (x < 1.0))
    mesh = oblique(mesh.with_edges("moved", lambda x, y: (y == 0.0) & (x > 1.0)), 20.0)
    sides = [Symmetry("held"), Displacement("moved", normal=apart), Traction("moved", tangential=0.0)]
    sides += [Contact("left", 0.3), Displacement("right", normal=-0.1, tangential=0.0), Traction("top", 0.0, 0.0)]
    ways = (mesh, sides), (replace(mesh, vertices=mesh.vertices.round(digits)), sides[::-1])
    exact, rounded = (bracket(solve(ContactProblem(each, Material(1.0, 0.3), stated))) for each, stated in ways)
    assert rounded.companion.energy == pytest.approx(exact.companion.energy, rel=10.0 ** (2 - digits))
    assert any("count as parallel" in reason for reason in rounded.reasons) is (digits < 10)


@pytest.mark.parametrize(("digits", "cells", "parts"), [(12, 4, 1), (7, 4, 1), (5, 8, 1), (7, 4, 2)])
def test_corners_are_square_but_for_rounded_coordinates(digits, cells, parts):
    """A support at a right angle to a contact, or to one of several, holds its slip, also of an oblique plate."""
    *others, contact = (plate := compressed_plate(0.3, (cells, cells))).conditions
    for k in range(parts):
        named = plate.mesh.with_edges(f"{k}", lambda x, y, k=k: (y > y.max() - 0.01) & (x // 0.25 % parts == k))
        plate, others = replace(plate, mesh=named), [*others, replace(contact, edges=f"{k}", name=f"{k}")]
    mesh = oblique(plate.mesh, np.degrees(0.5))
    rounded = replace(plate, mesh=replace(mesh, vertices=mesh.vertices.round(digits)), conditions=others)
    assert solve(rounded).bracket.coulomb.relative_error < 0.04


def test_sides_that_do_not_meet_keep_their_directions():
    """On polygons of a hundred sides some are parallel by chance but for 1e-5, which takes no guarantee away."""
    x, y = BLOCK.vertices.T
    tapered = replace(BLOCK, vertices=np.column_stack([x * (1.0 + 1e-5 * y), y * (1.0 + 1e-5 * x)]))
    tapered = tapered.with_edges("both", lambda x, y: (y < 1e-3) | (y > 0.999) & (x > 1e-3) & (x < 1.999))
    sides = [Symmetry("left"), Displacement("right", normal=-1e-3), Traction("right", tangential=0.0)]
    assert solve(ContactProblem(tapered, STEEL, [*sides, Contact("both", 0.0)])).bracket.guaranteed
