"""A fluid in a contact: displacements feel it as a load, bounds enclose, and the law is that of effective stress."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction, solve
from qvi_contact.bracket import BracketKind
from qvi_contact.companion import solve_companion
from qvi_contact.mesh import TriangleMesh

STEEL = Material(1000.0, 0.3)
MESHES = {"rectangles": TriangleMesh.rectangle((3, 3), 2.0, 1.0), "triangles": TriangleMesh.rectangle((3, 3), 2.0, 1.0)}
FREE = Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)


def falling(x, y):
    return 3.0 - x + 0.0 * y


def block(mesh, contact, *top):
    return ContactProblem(mesh, STEEL, [contact, *top, *FREE])


CASES = {
    "pressed": (Contact("bottom", 0.0, pore_pressure=falling, gap=1e-3), [Traction("top", 0.0, -8.0)]),
    "Tresca": (Contact("bottom", 0.0, cohesion=1.0, pore_pressure=2.0), [Displacement("top", 2e-3, -1e-2)]),
    "open": (Contact("bottom", 0.0, pore_pressure=falling, gap=1.0), [Displacement("top", 0.0, 0.0)]),
    "plate": (
        Contact("bottom", 0.0, pore_pressure=falling, plate=RigidPlate(force_y=16.0)),
        [Displacement("top", 0.0, 0.0)],
    ),
}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("case", CASES)
def test_bounds(case, mesh):
    """Guaranteed, their parts add up, and both models transmit the whole traction."""
    contact, top = CASES[case]
    result = solve(block(mesh, contact, *top), tolerance=1e-10)
    found = result.bracket
    assert found.kind is BracketKind.PROBLEM
    assert found.guaranteed, found.reasons
    assert -1e-12 * found.strain <= found.gap < 0.02 * found.strain
    assert found.cell_gaps.sum() == pytest.approx(found.gap, rel=1e-6, abs=1e-12)
    ours, theirs = result.contacts["bottom"], found.companion.contacts["bottom"]
    assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-2)
    if case != "Tresca":
        assert ours.normal_force == pytest.approx(4.0 if case == "open" else 16.0, rel=1e-9)
        assert theirs.normal_force == pytest.approx(ours.normal_force, rel=1e-9)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_an_open_contact_full_of_fluid_is_a_load(mesh):
    """The same displacements as under a traction in its place."""
    contact, (top,) = CASES["open"]
    wet = solve_companion(block(mesh, contact, top))
    loaded = solve_companion(block(mesh, Traction("bottom", 0.0, falling), top))
    x, y = np.random.default_rng(0).uniform(size=(2, 20)) * [[2.0], [1.0]]
    assert wet.displacement(x, y) == pytest.approx(loaded.displacement(x, y), abs=1e-12)
    assert wet.contacts["bottom"].normal_stress.max() < -0.9


def test_friction_feels_the_effective_pressure():
    """Sliding along a base under uplift: |σ_T| = μ (|σ_N| − p_w)."""
    contact = Contact("bottom", 0.3, pore_pressure=2.0)
    sides = [Traction("left", 0.0, -1.8), Traction("right", 0.0, 1.8)]
    top = Displacement("top", x=1.0), Traction("top", y=-8.0)
    problem = ContactProblem(MESHES["triangles"], STEEL, [contact, *top, *sides])
    line = solve_companion(problem, degree=2).contacts["bottom"]
    assert line.tangential_force == pytest.approx(-0.3 * (8.0 - 2.0) * 2.0, rel=1e-8)
    assert line.normal_force == pytest.approx(16.0, rel=1e-9)


def test_both_faces_of_a_joint_feel_it():
    mesh = TriangleMesh.rectangle((3, 4), 2.0, 1.0).with_joint("seam", lambda _, y: np.isclose(y, 0.5))
    joint = Contact("seam", 0.0, pore_pressure=falling, gap=1.0)
    ends = [Displacement("bottom", 0.0, 0.0), Displacement("top", 0.0, 0.0)]
    problem = ContactProblem(mesh, STEEL, [joint, *ends, *FREE])
    for each in (problem, problem):
        found = solve(each, tolerance=1e-10).bracket
        assert found.guaranteed
        assert found.cell_gaps.sum() == pytest.approx(found.gap, rel=1e-6)
        assert found.companion.contacts["seam"].normal_force == pytest.approx(4.0, rel=1e-10)


def test_a_pressure_beyond_the_traces_is_named():
    contact = Contact("bottom", 0.0, pore_pressure=lambda x, y: 1.0 + x**4 + 0.0 * y)
    walls = Symmetry("left"), Symmetry("right")
    problem = ContactProblem(MESHES["triangles"], STEEL, [contact, Traction("top", 0.0, -40.0), *walls])
    assert any("pore pressure" in reason for reason in solve(problem).bracket.reasons)
