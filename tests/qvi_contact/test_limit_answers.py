"""Limit loads that are known, reached from both sides by refinement of coarse meshes.

The suite refines a little; with ``QVI_CONTACT_EFFORT=10`` as far as the accuracy that the comments name.
"""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import InputError, LimitFactor, RefinementStatus, Symmetry, Traction, Tresca, TriangleMesh, refine
from qvi_contact.files import save_problem
from qvi_contact.limit import limit_load_factor
from qvi_contact.mechanism import find_mechanism
from qvi_contact.problem import BodyForces, Contact, ContactProblem, Displacement, Expression, Material, MohrCoulomb
from solvers import SolveError
from tests.cases import EFFORT
from tests.qvi_contact.builders import quarter
from tests.qvi_contact.test_mechanism import wall

FULL = EFFORT >= 10.0
NEAR = 1e-9
GRAVITY = Expression("y")
SOFT = Material(10.0, 0.3, "strain", Tresca(1.0))


def ground(strength, lines=(0, 0.5, 1, 2, 3, 4), levels=(-2, -1, 0)):
    """Half of a strip of pressure 1 wide on a layer 2 deep, and as long as the last of the vertical lines says.

    What gives way under friction ends 2 r cos(45° + φ/2) beyond the strip, with r = e^(π/2 tan φ)/(2 cos(45° + φ/2)):
    2.5 at 20°, 4.3 at 30°.
    """
    mesh = replace(TriangleMesh.grid(lines, levels), edge_sets={})
    mesh = mesh.with_edges("foot", lambda x, y: (y > -NEAR) & (x < 1)).with_edges("left", lambda x, _: x < NEAR)
    mesh = mesh.with_edges("free", lambda x, y: (y > -NEAR) & (x > 1))
    mesh = mesh.with_edges("far", lambda x, y: (x > lines[-1] - NEAR) | (y < -2 + NEAR))
    sides = [Symmetry("left"), Displacement("far", x=0, y=0), Traction("foot", x=0, y=-1.0), Traction("free", x=0, y=0)]
    return ContactProblem(mesh, Material(10.0, 0.3, "strain", strength), sides)


def notched():
    """A quarter of a block with cuts from both sides to half of its width, pulled."""
    mesh = replace(TriangleMesh.rectangle((4, 4)), edge_sets={})
    sides = {
        "top": lambda _, y: y > 1 - NEAR, "right": lambda x, _: x > 1 - NEAR, "left": lambda x, _: x < NEAR,
        "cut": lambda x, y: (y < NEAR) & (x > 0.5), "ligament": lambda x, y: (y < NEAR) & (x < 0.5),
    }  # fmt: skip
    for name, where in sides.items():
        mesh = mesh.with_edges(name, where)
    free = [Traction(name, x=0, y=0) for name in ("right", "cut")]
    return ContactProblem(mesh, SOFT, [Traction("top", x=0, y=1.0), *free, Symmetry("left"), Symmetry("ligament")])


def cut():
    """A vertical cut 1 high under its own weight."""
    x, y = np.linspace(-2, 1, 7), np.linspace(-1, 1, 5)
    mesh = replace(TriangleMesh.grid(x, y, (y[:-1, None] < -NEAR) | (x[:-1] < -NEAR)), edge_sets={})
    mesh = mesh.with_edges("far", lambda x, y: (x < -2 + NEAR) | (x > 1 - NEAR) | (y < -1 + NEAR))
    mesh = mesh.with_edges("free", lambda x, y: (y > 1 - NEAR) | ((y > -NEAR) & (x > -NEAR) & (x < 1 - NEAR)))
    return ContactProblem(mesh, SOFT, [Traction("free", x=0, y=0), Displacement("far", x=0, y=0)], GRAVITY)


CASES = {
    # problem, load, exact value from … to, accuracy of both sides in the suite and in full, rounds, degree
    "Prandtl": (ground(Tresca(1.0)), "foot", 2 + np.pi, 2 + np.pi, 0.06, 0.005, 3, 6),
    "notched block": (notched(), "top", 1.1315, 1.1316, 0.03, 0.003, 3, 9),
    "vertical cut": (cut(), "body", 3.7752, 3.7776, 0.09, 0.007, 3, 9),
    "Nc": (ground(MohrCoulomb(1.0, np.pi / 6), (0, 0.5, 1, 2, 3, 4.5, 6)), "foot", 30.13963, 30.13963, 0.2, 0.03, 3, 7),
}


@pytest.mark.parametrize("name", CASES if FULL else ["vertical cut"])
def test_known_limit_loads(name):
    """Fans at corners close in on them."""
    problem, load, low, high, rough, fine, few, many = CASES[name]
    finer = refine(problem, target=fine, quantity=LimitFactor([load]), max_rounds=many if FULL else few, degree=4)
    found, accuracy = finer.limit, fine if FULL else rough
    assert finer.guaranteed
    assert finer.rounds[-1].estimate < 0.55 * finer.rounds[0].estimate
    assert finer.indicator.sum() == pytest.approx(finer.estimate, rel=1e-6)
    assert low * (1 - accuracy) <= found.lower <= high
    assert low <= found.upper <= high * (1 + accuracy)


def test_fans_at_the_tip_of_a_cut_become_half_as_wide():
    """In one round, where that has most of the gap: from two right angles to at most 45°, and to no less than half."""
    mesh, tip = refine(notched(), quantity=LimitFactor(["top"]), max_rounds=2, degree=3).problem.mesh, (0.5, 0.0)
    own = mesh.corners[((mesh.corners == tip).all(axis=2)).any(axis=1)]
    arms = own[(own != tip).any(axis=2)].reshape(-1, 2, 2) - tip
    one, other = (arms[:, k, 0] + 1j * arms[:, k, 1] for k in (0, 1))
    assert math.pi / 8.0 < np.abs(np.angle(other / one)).max() <= math.pi / 4.0 * (1.0 + 1e-9)


def test_the_last_mesh_is_no_finer_than_the_target_needs():
    load = LimitFactor(["top"])
    near, far = (refine(notched(), target=t, quantity=load, max_rounds=2, degree=4) for t in (0.11, 0.001))
    assert near.status is RefinementStatus.REACHED
    assert near.rounds[1].cells < far.rounds[1].cells
    assert far.rounds[1].estimate <= near.rounds[1].estimate <= 0.11 < near.rounds[0].estimate


def test_thick_cylinder(monkeypatch, clock, shell, tmp_path):
    """Pressure 2c ln(b/a) inside a quarter ring with true arcs: estimates within 0.2 %, also one that stands alone."""
    loads = [Traction("inner", normal=-1.0, tangential=0.0, name="pressure"), Traction("outer", normal=0, tangential=0)]
    problem = ContactProblem(quarter(3, 12), SOFT, [*loads, Symmetry("left"), Symmetry("bottom")])
    limit = limit_load_factor(problem, ["pressure"], degree=5)
    assert not limit.guaranteed
    assert [limit.lower, limit.upper] == pytest.approx([2 * np.log(2)] * 2, rel=2e-3)
    save_problem(ring := tmp_path / "ring.toml", problem)
    sides = re.findall(r"about (\S+) times", shell("limit", ring, "--load=pressure", "--degree=5")[1])
    assert float(sides[0]) <= limit.lower <= limit.upper <= float(sides[1])  # rounded outwards

    def late(*_, **__):
        clock.passes(10.0)
        raise SolveError("late")

    monkeypatch.setattr("qvi_contact.limit.flow.FlowProgram.solved", late)
    words = "--load=pressure", "--time-limit=5", "--proof", tmp_path / "proof.json"
    status, out, err = shell("limit", ring, *words)
    assert ("at least about 1.38" in out, "straight triangles" in err, status) == (True, True, 2)


@pytest.mark.parametrize(("mu", "eta", "joints"), [(0.5, 0.107426, [54.4963]), (0.31, 0.1976, [28.6362, 60.5134])])
def test_semicircular_arch_of_voussoirs(mu, eta, joints):
    """Under its own weight it stands if it is as thick as η = t/R, and falls if thinner.

    Cocchetti and Rizzi (2020) give 0.107426 above μ = 0.395832, and 0.200637 at μ = 0.309215, below which none stands.
    """
    for share in (1.01, 0.99):
        problem = arch(mu, share * eta, [0.0, *joints, *(-angle for angle in joints)])
        assert (find_mechanism(problem) is None) == (share > 1)


@pytest.mark.parametrize(("mu", "factor"), [(0.4, 0.26376), (0.7, 0.37001)][: 2 if FULL else 1])
def test_arch_under_horizontal_gravity(mu, factor):
    """Seven voussoirs under their weight, and a multiple of it to the side: blocks from above, stresses within 3 %."""
    forces = BodyForces({"weight": Expression("y"), "earthquake": Expression("x")})
    problem = arch(mu, 0.15, np.arange(-56.25, 57.0, 22.5), 78.75, 14, forces)
    found = refine(problem, target=0.03, quantity=LimitFactor(["earthquake"]), max_rounds=6).limit
    assert found.upper == pytest.approx(factor, rel=2e-5)
    assert found.upper * 0.97 <= found.lower <= found.upper


def arch(mu, eta, joints, half=90.0, columns=36, forces=GRAVITY):
    """Part of a ring of centreline radius 1 and thickness η with radial joints, angles from the crown in degrees."""
    marks = np.unique(np.concatenate([np.linspace(-half, half, columns + 1), joints]))
    flat = TriangleMesh.grid(marks, [0.0, 0.5, 1.0])
    angle, radius = np.radians(flat.vertices[:, 0]), 1.0 + eta * (flat.vertices[:, 1] - 0.5)
    vertices = radius[:, None] * np.column_stack([np.sin(angle), np.cos(angle)])
    mesh = TriangleMesh(vertices, flat.cells, {name: flat.edge_sets[name] for name in flat.edge_names})
    mesh = mesh.with_arc("bottom", (0.0, 0.0), 1.0 - eta / 2).with_arc("top", (0.0, 0.0), 1.0 + eta / 2)
    contacts = [Contact("left", mu), Contact("right", mu)]
    for at in joints:
        direction = np.array([np.cos(np.radians(at)), -np.sin(np.radians(at))])

        def where(x, y, direction=direction):
            return (np.abs(x * direction[0] + y * direction[1]) < NEAR) & (y > 0)

        mesh = mesh.with_joint(f"joint {at}", where)
        contacts.append(Contact(f"joint {at}", mu))
    loads = [Traction(name, normal=0, tangential=0) for name in ("bottom", "top")]
    return ContactProblem(mesh, Material(10.0, 0.2), [*contacts, *loads], forces)


TARGET = 1e-4


def refined(problem, *loads, target=TARGET, **options):
    return refine(problem, target=target, quantity=LimitFactor(loads), **options)


def triangles():
    """A wall 1 × 4 of the weight 25 under a wind of 1: it tips at 6.25."""
    return wall(TriangleMesh.rectangle((2, 4), 1.0, 4.0), 1.0)


def test_a_limit_that_only_stresses_bound():
    """What cannot part and is rough has no mechanism; on one edge pressure has one sign, and stresses have a bound."""
    held = wall(TriangleMesh.rectangle((1, 4), 1.0, 4.0), 1.0)
    base = Contact("bottom", 0.5, law="bilateral", name="base")
    found = refined(replace(held, conditions=[base, *held.conditions[1:]]), "wind", max_rounds=1)
    assert (found.status, found.rounds[0].estimate) == (RefinementStatus.ROUNDS, math.inf)
    assert 0.0 < found.limit.lower < found.limit.upper == math.inf


def test_only_at_the_toe():
    """Every round quarters the distance, with cells beside the toe only."""
    found = refined(triangles(), "wind")
    assert (found.status, found.guaranteed) == (RefinementStatus.REACHED, True)
    assert (1.0 - TARGET) * 6.25 <= found.limit.lower <= found.limit.upper == pytest.approx(6.25, rel=1e-9)
    assert (found.value, found.unit) == (found.limit.lower, found.limit.upper)
    assert found.estimate == pytest.approx(max(1.0 - found.limit.lower / found.limit.upper, 0.0), abs=1e-12)
    estimates = [each.estimate for each in found.rounds]
    assert all(second < 0.3 * first for first, second in pairwise(estimates))
    corners = found.problem.mesh.vertices[found.problem.mesh.cells]
    far = np.hypot(*np.moveaxis(corners - [1.0, 0.0], -1, 0)).min(axis=1) > 1.5
    assert far.sum() <= 32
    assert found.indicator[far].sum() <= 1e-3 * found.estimate


def test_loads_that_the_mesh_cannot_follow_give_an_estimate():
    base, wind, *free = triangles().conditions
    gusts = [base, replace(wind, x=lambda _, y: np.sin(math.pi * y / 4.0)), *free]
    found = refined(replace(triangles(), conditions=gusts), "wind", target=1e-2, degree=3)
    assert (found.status, found.guaranteed) == (RefinementStatus.REACHED, False)
    assert "estimated" in found.message


def test_any_multiple_and_none():
    problem = triangles()
    found = refined(problem, "body")
    assert (found.status, found.value, found.estimate) == (RefinementStatus.REACHED, math.inf, 0.0)
    ice = replace(problem, conditions=[Contact("bottom", 0.0, name="base"), *problem.conditions[1:]])
    assert refined(ice, "top").value == -math.inf


@pytest.mark.parametrize("options", [{"max_rounds": 2}, {"max_unknowns": 300}])
def test_ends(options):
    found = refined(triangles(), "wind", **options)
    status = RefinementStatus.ROUNDS if "max_rounds" in options else RefinementStatus.UNKNOWNS
    assert (found.status, found.guaranteed) == (status, True)
    assert TARGET < found.estimate < 0.3
    assert found.limit.lower < found.limit.upper == pytest.approx(6.25)


@pytest.mark.parametrize("options", [{"method": "uzawa"}, {"degree": 2}, {"max_unknowns": 10}, {"element": "bfs"}])
def test_refused(options):
    with pytest.raises(InputError, match=next(iter(options))):
        refined(triangles(), "wind", **options)
