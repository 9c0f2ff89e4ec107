"""Bounds under Coulomb friction on joints: each body has a friction operator of its own."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, Region, Traction, solve
from qvi_contact.bracket import bodies_of
from qvi_contact.mesh import TriangleMesh
from tests.qvi_contact.bracket.test_coulomb import FREE, bounds_met
from tests.qvi_contact.builders import area, energy_apart, half_discs


@pytest.mark.parametrize("place", [{"name": "lower"}, {"y": (-1.0, 0.0)}])
def test_each_body_has_its_cells_conditions_and_material(place):
    problem = replace(half_discs(0.3), regions=[Region(Material(500.0, 0.3, "strain"), **place)])
    found = {len(body.beyond): body for body in bodies_of(problem)}
    assert sum(area(body.problem.mesh) for body in found.values()) == pytest.approx(area(problem.mesh))
    names = {key: {each.edges for each in body.problem.conditions} for key, body in found.items()}
    assert names == {0: {"seam", "foot", "flank"}, 1: {"seam, beyond", "crown", "flank"}}
    young = {key: 1.0 / np.unique(body.problem.compliances[:, 0, 0]) for key, body in found.items()}
    assert young[1] / young[0] == pytest.approx(2.0)


@pytest.mark.parametrize(("friction", "kind"), [(0.1, "guaranteed"), (0.3, "estimated")])
def test_true_errors_and_forces(friction, kind):
    """Of degree 3 beside degree 5 on the same mesh: the force of the finer one is inside its own bounds too."""
    problem = half_discs(friction, below=500.0)
    problem = replace(problem, mesh=problem.mesh.refined(np.ones(problem.mesh.cell_count, dtype=bool)))
    result, fine = (solve(problem, degree=degree) for degree in (3, 5))
    found = bounds_met(result, fine, 4.0)
    assert found.kind == kind
    assert (found.shares["seam"].slipping == -1.0).all()
    for name in ("normal_force", "tangential_force"):
        both = [each.bracket.coulomb.forces[f"seam.{name}"] for each in (result, fine)]
        assert both[0].lower < getattr(fine.contacts["seam"], name) < both[0].upper
        assert max(each.lower for each in both) < min(each.upper for each in both)
        assert np.diff(both[1]) < 0.5 * np.diff(both[0])


def test_a_crack_in_one_body():
    """Its jump vanishes at the tip: stresses are bounded, forces are not, as no z has z_N = 1 there."""
    mesh = TriangleMesh.rectangle((2, 2), 2.0, 2.0).with_joint("crack", lambda x, y: (y == 1.0) & (x < 1.0))
    ends = [Displacement("bottom", x=0.0, y=0.0), Displacement("top", x=1e-3, y=-1e-3)]
    problem = ContactProblem(mesh.graded([(1.0, 1.0)], 4), Material(1.0, 0.2), [Contact("crack", 0.5), *ends, *FREE])
    found = solve(problem, degree=4).bracket.coulomb
    assert found.kind == "estimated"
    assert found.relative_error < 0.1
    assert found.error > energy_apart(found.stress, solve(problem, degree=6))
    assert found.forces == {}


@pytest.mark.parametrize("side", ["above", "below"])
def test_where_either_body_is_held_across_the_end_the_share_vanishes(side):
    mesh = TriangleMesh.rectangle((2, 4), 2.0, 2.0).with_joint("seam", lambda _, y: y == 1.0)
    mesh = mesh.with_edges("above", lambda x, y: (x == 0.0) & (y > 1.0))
    mesh = mesh.with_edges("below", lambda x, y: (x == 0.0) & (y < 1.0))
    pressed = Displacement(side, y=lambda _, y: -0.1 * np.maximum(y - 1.0, 0.0))  # as the top is, where they meet
    held = [pressed, Traction(side, x=0.0), Displacement("bottom", x=0.0, y=0.0)]
    free = [Traction(name, x=0.0, y=0.0) for name in ("above", "below", "right") if name != side]
    held += [Contact("seam", 1.5), Displacement("top", x=0.01, y=-0.1)]
    problem = ContactProblem(mesh, Material(1.0, 0.3), [*held, *free])
    edges, share = mesh.edges("seam"), solve(problem, degree=4).bracket.coulomb.shares["seam"].at(np.array([0.0, 1.0]))
    at = mesh.vertices[np.stack([edges.first, edges.second], axis=1)][..., 0] == 0.0
    assert share[at].tolist() == [0.0]


def test_a_part_of_a_mesh_keeps_names_arcs_and_regions():
    disc = half_discs().mesh.with_arc("crown", (0.0, 0.0), 1.0).with_arc("foot", (0.0, 0.0), 1.0)
    lower = disc.part(disc.region("lower"))
    assert (set(lower.edge_names), lower.joint_names) == ({"seam", "foot", "flank"}, ())
    assert lower.region("lower").tolist() == list(range(12))
    assert len(lower.edges("flank")) == len(disc.edges("flank")) // 2
    assert lower.edges("foot").length == pytest.approx(np.pi / 12.0)
    assert lower.edges("seam").normal[:, 1] == pytest.approx(1.0)
