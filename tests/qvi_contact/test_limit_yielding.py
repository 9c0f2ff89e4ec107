"""Limit loads of bodies that yield, with their contacts, against closed forms and each other."""

import json
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy import sparse

from qvi_contact import LimitLoad, RigidPlate, Symmetry, Traction, Tresca, TriangleMesh, limit_load_factor, solve
from qvi_contact.files import load_problem, problem_from_toml, problem_to_toml, save_problem
from qvi_contact.limit import FlowProgram, LimitProblem, StressProgram, check, limit_proof, strength_reduction_factor
from qvi_contact.limit.conic import ConicProgram
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, Mises, MohrCoulomb, NoTension, Region
from solvers import InputError, SolveError
from solvers.basics import deadline
from tests.cases import refused_at, thinned
from tests.qvi_contact.test_limit_answers import ground


def stretched(strength, plane="strain", mesh=None, top=1.0, right=0.0):
    """A block pulled along y, and along x or not, beside two lines of symmetry."""
    mesh, material = mesh or TriangleMesh.rectangle((2, 2)), Material(10.0, 0.3, plane, strength)
    sides = Traction("top", x=0, y=top), Traction("right", x=right, y=0), Symmetry("left"), Symmetry("bottom")
    return ContactProblem(mesh, material, sides)


def in_tension(c, phi):
    return 2 * c * np.cos(phi) / (1 + np.sin(phi))


@pytest.mark.parametrize(
    ("strength", "plane", "exact"),
    [(Mises(1.0), "stress", 1.0), (Mises(1.0), "strain", 2 / np.sqrt(3)), (Tresca(0.7), "stress", 1.4),
     (Tresca(0.7), "strain", 1.4), (MohrCoulomb(0.5, 0.3), "strain", in_tension(0.5, 0.3)),
     (MohrCoulomb(0.5, 0.3), "stress", in_tension(0.5, 0.3)), (MohrCoulomb(0.5, 0.3, 0.2), "strain", 0.2)],
)  # fmt: skip
def test_uniform_tension(strength, plane, exact):
    limit = limit_load_factor(stretched(strength, plane), ["top"], degree=5 if isinstance(strength, Mises) else 3)
    assert limit.lower == pytest.approx(exact, rel=1e-6)
    assert limit.lower <= limit.upper == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("x", [0.0, 1e200])
def test_a_solver_that_breaks_down_is_asked_again(x, monkeypatch):
    """Clarabel may break down in its first step, with x = 0, for one size of its regularisation; or run away."""
    clarabel = pytest.importorskip("clarabel")
    real = clarabel.DefaultSolver

    def fragile(P, q, A, b, cones, settings):
        if x or settings.static_regularization_constant < 1e-11:
            failed = SimpleNamespace(status="NumericalError", x=np.full(len(q), x), z=np.zeros(len(b)), r_prim=1.0)
            return SimpleNamespace(solve=lambda: failed)
        return real(P, q, A, b, cones, settings)

    monkeypatch.setattr(clarabel, "DefaultSolver", fragile)
    limit = limit_load_factor(stretched(Tresca(0.7)), ["top"])
    assert limit.lower == pytest.approx(0.0 if x else 1.4, rel=1e-6)  # 0 is carried
    assert (limit.in_time, "break their conditions" in limit.missing) == (True, x > 0.0)


@pytest.mark.parametrize("unit", [1e6, 1e-10])
def test_units_do_not_matter(unit):
    """Neither to the limit, nor to what is guaranteed: not where stresses cannot follow a weight."""
    problem = stretched(Tresca(0.7 * unit), mesh=TriangleMesh.rectangle((2, 2), 1e3, 1e3))
    assert limit_load_factor(problem, ["top"]).lower == pytest.approx(1.4 * unit, rel=1e-6, abs=0.0)
    heavy = replace(problem, body_potential=lambda x, _: 0.1 * unit * np.sin(3e-3 * x))
    assert not limit_load_factor(heavy, ["top"]).guaranteed
    assert [strength_reduction_factor(each, accuracy=0.5).guaranteed for each in (problem, heavy)] == [True, False]
    cornered = [Contact("bottom", 0.0), Contact("right", 0.0), Traction("left", x=1, y=0), Traction("top", x=0, y=-1)]
    pressed = replace(stretched(MohrCoulomb(1e7, 0.5)), conditions=cornered)  # loads are next to nothing
    assert limit_load_factor(pressed, ["left", "top"], degree=3).upper == np.inf
    weak = Region(Material(1.0, 0.3, "strain", Tresca(unit)), name="weak")  # beside a part that has no tension
    dry = stretched(NoTension(9.0 * unit), mesh=problem.mesh.with_region("weak", lambda _, y: y > 500.0))
    dry = replace(dry, conditions=[Traction("top", x=0.0, y=-1.0), *dry.conditions[1:]], regions=[weak])
    assert limit_load_factor(dry, ["top"], degree=3).lower == pytest.approx(2.0 * unit, rel=1e-6, abs=0.0)


@pytest.mark.parametrize(("crushing", "weight", "exact"), [(3.0, 0.5, 2.019091), (3.0, 0.0, 2.4), (None, 0.5, np.inf)])
def test_a_column_without_tension_under_a_plate(crushing, weight, exact):
    """Pressed by P at 0.1 from its axis; its foot crushes at P + W = f (1 − 0.2 P/(P + W)), and nothing if f is none.

    Stresses are vertical everywhere, at the tips of their cones. A constant in the potential means nothing.
    """
    plate = RigidPlate(force_x=0.0, force_y=-1.0, moment=0.0, pivot=(0.6, 1.0))
    sides = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]
    conditions = [Contact.tied("bottom"), Contact("top", 1.0, plate=plate), *sides]
    mesh, material = TriangleMesh.rectangle((6, 6)), Material(1e4, 0.2, strength=NoTension(crushing))
    column = ContactProblem(mesh, material, conditions, lambda _, y: weight * (y + 9.0))
    limit = limit_load_factor(column, ["top"], degree=3)
    pushed = [Contact.tied("bottom"), Contact("top", 0.0, plate=replace(plate, force_x=0.1)), *sides]  # by no friction
    assert limit_load_factor(ContactProblem(mesh, material, pushed), ["top"], degree=3).lower == pytest.approx(0.0)
    assert exact * 0.986 <= limit.lower <= exact * (1.0 + 1e-6) <= limit.upper * (1.0 + 2e-6) <= exact * 1.014


def test_what_does_not_carry_its_weight_carries_no_multiple_of_an_even_pressure():
    """However much of it a metal carries by itself."""
    even = [Traction("left", x=1.0, y=0.0), Traction("right", x=-1.0, y=0.0), Traction("top", x=0.0, y=-1.0)]
    metal = Material(1.0, 0.2, plane="strain", strength=Mises(0.09))
    mesh, loads = TriangleMesh.rectangle((3, 6), 1.0, 2.0), ["left", "right", "top"]
    heavy = ContactProblem(mesh, metal, [Contact("bottom", 0.0), *even], lambda _, y: y)
    assert limit_load_factor(heavy, ["body"], degree=3).upper < 0.1
    assert limit_load_factor(heavy, loads, degree=3).lower == -np.inf
    with deadline(1e-9), pytest.raises(SolveError, match="time limit"):  # it does not mean that nothing is carried
        LimitProblem.of(heavy, tuple(loads), 3).stresses.carried()
    assert limit_load_factor(replace(heavy, body_potential=0.0), loads, degree=3).lower == np.inf
    lifted = replace(stretched(NoTension(), top=-1.0), body_potential=lambda _, y: -4.0 * y)
    assert limit_load_factor(lifted, ["top"], degree=3).lower == np.inf  # from 4 on


def test_friction_that_varies():
    """Pressed along y in proportion to 2c tan(45° + φ/2) = 2 (3 + x), every column yields at once."""
    gaps = []
    for cells in (2, 4):
        strength = MohrCoulomb(1.0, lambda x, _: 2.0 * np.arctan(3.0 + x) - np.pi / 2.0)
        columns = stretched(strength, mesh=TriangleMesh.rectangle((cells, 1)), top=lambda x, _: -3.0 - x)
        limit = limit_load_factor(columns, ["top"])
        assert limit.lower <= 2.0 <= limit.upper
        gaps.append(limit.upper - limit.lower)
    assert gaps[1] < 0.6 * gaps[0] < 0.4
    for growth in (0.0, 0.3):  # pulled all around in plane stress it tears where the angle is largest
        wide = stretched(MohrCoulomb(0.5, lambda x, _, growth=growth: 0.3 + growth * x), "stress", right=1.0)
        limit, exact = limit_load_factor(wide, ["top", "right"]), in_tension(0.5, 0.3 + growth)
        assert limit.lower == pytest.approx(exact, rel=1e-5)
        assert exact * (1.0 - 1e-6) <= limit.upper < exact * (1.0 + 1e-5 + growth)


def test_friction_that_begins_at_zero_has_a_bound_with_a_cut_off_only_and_none_where_it_falls_to_zero():
    """Between a part with friction and one without there is no bound of what flow dissipates."""
    growing, falling = (lambda x, _: 0.3 * x), MohrCoulomb(1.0, lambda x, _: np.maximum(x - 0.5, 0.0))
    with refused_at("MohrCoulomb.phi", value=0.0):
        limit_load_factor(stretched(falling), ["top"], degree=3)
    with pytest.raises(InputError, match="cut-off"):
        limit_load_factor(stretched(MohrCoulomb(0.5, growing)), ["top"])
    limit = limit_load_factor(stretched(MohrCoulomb(0.5, growing, 0.2)), ["top"])
    assert (limit.lower, 0.2 <= limit.upper < 0.25) == (pytest.approx(0.2, rel=1e-5), True)


def block(strength, mu, pressure, cells=(4, 2), shear=1.0, **base):
    """A block under the same pressure all around and in pure shear, on a rough base with further data."""
    weights = ("top", {"y": -pressure}), ("left", {"x": pressure}), ("right", {"x": -pressure})
    shears = ("top", {"x": shear}), ("left", {"y": -shear}), ("right", {"y": shear})
    loads = [Traction(side, name="weight", **along) for side, along in weights]
    loads += [Traction(side, name="shear", **along) for side, along in shears]
    mesh, material = TriangleMesh.rectangle(cells, 2.0, 1.0), Material(10.0, 0.3, "strain", strength)
    return ContactProblem(mesh, material, [Contact("bottom", mu, **base), *loads])


@pytest.mark.parametrize(("mu", "c"), [(0.1, 10.0), (0.3, 1.2), (0.6, 1.0), (2.0, 0.5)])
def test_a_rough_base_or_the_block_gives_way(mu, c):
    """Pressure 2 and shear τ: slip at τ = 2μ, yield at τ = c."""
    limit = limit_load_factor(block(Tresca(c), mu, 2.0), ["shear"])
    exact = min(2.0 * mu, c)
    assert limit.lower == pytest.approx(exact, rel=1e-5)
    assert limit.lower <= limit.upper == pytest.approx(exact, rel=1e-4)


def test_a_bilateral_base_has_friction_under_tension_too():
    for cells, factor in (((1, 1), 0.6), ((3, 1), np.inf)):  # pressure beside tension has friction without end
        pulled = block(None, 0.3, -2.0, cells, law="bilateral")
        assert limit_load_factor(pulled, ["shear"]).lower == pytest.approx(factor, rel=1e-6)


@pytest.mark.parametrize("small", [1e-10, 1e9])
def test_neither_side_minds_how_large_a_load_is_beside_the_others(small):
    """The same block with the shear stated in another size, which is then multiplied by as much more."""
    limit = limit_load_factor(block(Tresca(1.2), 2.0, 2.0, shear=small), ["shear"])
    assert [small * limit.lower, small * limit.upper] == pytest.approx([1.2, 1.2], rel=1e-5)


def test_what_has_no_tension_has_no_scale():
    """Pressed f times as much a wall carries f times the push: its free side is uniaxial, and leaves no room.

    Rounding decided between 0.099 and 0.148 while cones without room were told by the room that a solver finds.
    """
    free, found, sizes = Traction("right", x=0.0, y=0.0), [], np.array([1.0, 2.5, 3.1, 3.3, 3.7])
    for f in sizes:
        cap = Contact("top", 0.0, law="tied", plate=RigidPlate(force_y=-f, moment=0.05 * f, pivot=(0.75, 2.0)))
        conditions = [Displacement("bottom", x=0.0, y=0.0), cap, Traction("left", x=1.0, y=0.0, name="push"), free]
        mesh, material = TriangleMesh.rectangle((2, 3), 1.0, 2.0), Material(1.0, 0.2, strength=NoTension())
        found.append(limit_load_factor(ContactProblem(mesh, material, conditions), ["push"], degree=3))
    assert [each.lower for each in found] / sizes == pytest.approx(0.1455918, rel=1e-5)
    assert [each.upper for each in found] / sizes == pytest.approx(2.116995, rel=1e-5)


def test_faces_of_small_and_large_triangles_keep_what_cones_keep(monkeypatch):
    """Numbers of 1e-9 beside 1: t ≥ |(x, y)| and t ≤ x leave y = 0. An answer is not lost where no faces are found."""
    t, x, y = (sparse.csr_array(np.diag([1.0] * 3 + [1e-9] * 3)[first::3]) for first in range(3))
    limits, none = (sparse.vstack([t - x, t]), np.repeat([0.0, 1.0], 2)), (sparse.csr_array((0, 6)), np.zeros(0))
    full = ConicProgram.of(-y.sum(axis=0), none, limits, [(-rows, np.zeros(2)) for rows in (t, x, y)])
    faces = full.on_faces(np.full((2, 1, 2), [1.0, 0.0]))
    assert full.margins(faces.solve().x).min() > -1e-9
    assert np.linalg.matrix_rank(faces.A[: faces.equal].toarray()) == faces.equal == 4
    for wrong in (Mock(side_effect=SolveError("not solved")), lambda full, _: replace(full, b=2.0 * full.b)):
        monkeypatch.setattr(ConicProgram, "on_faces", wrong)  # none, or those of a body that is twice as strong
        assert limit_load_factor(stretched(NoTension(1.0), top=-1.0), ["top"], degree=3).lower == pytest.approx(1.0)


def test_points_outside_move_no_farther_inside_than_to_the_rows_and_pay_for_what_they_break():
    """|y| ≤ t, and then max y with t ≤ 1: a small point beside a large one inside, and the true optimum."""
    t, y, none = *map(sparse.csr_array, np.eye(2)[:, None]), (sparse.csr_array((0, 2)), np.zeros(0))
    free, capped = (ConicProgram.of(np.array([0.0, -1.0]), none, limits, [(-rows, np.zeros(1)) for rows in (t, y)])
                    for limits in (none, (t, np.ones(1))))  # fmt: skip
    near, violation = free.repaired(np.array([1e-3, 1.001e-3]))
    assert (near[0] - abs(near[1]), violation) == pytest.approx((0.0, 0.0), abs=1e-9)
    for x in np.random.default_rng(1).normal(1.0, 1e-6, size=(20, 2)):
        assert capped.q @ x + capped.price(x, capped.solve().multipliers) >= -1.0 - 1e-9


def test_an_upper_side_that_no_flow_gives_is_missing_not_infinite():
    """A smooth wall pushes soil on a held base: passive pressure K_p γ h²/2 + 2 c √K_p h, K_p = 3, is a limit."""
    held = [Displacement("bottom", x=0.0, y=0.0), Symmetry("right"), Traction("top", x=0.0, y=0.0)]
    wall = Contact("left", 0.0, name="wall", plate=RigidPlate(force_x=1.0, y=0.0, rotation=0.0))
    soil = Material(1.0, 0.3, "strain", MohrCoulomb(0.2, np.pi / 6))
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0)
    slips, exact = Contact("bottom", np.tan(np.pi / 6), cohesion=0.2), 1.5 + 0.4 * np.sqrt(3.0)
    for base in (held[0], slips):  # with a base on which it slips there is an upper side
        limit = limit_load_factor(ContactProblem(mesh, soil, [base, *held[1:], wall], lambda _, y: y), ["wall"])
        assert limit == pytest.approx(exact, rel=1e-4)  # how near hangs on the kernel of BLAS
        assert (limit.upper == np.inf) == bool(limit.missing)
    assert exact <= limit.upper < 1.15 * exact


def test_what_leaves_no_room_is_near_its_limit_from_both_sides():
    """The solver calls 5e-8 the most that one carries, and flows of a huge size, which rounding breaks, passed."""
    grid = TriangleMesh.rectangle((1, 2), 1.2, 1.0).with_region("part", lambda _, y: y < 0.5)
    sets = {"held": [(0, 2)], "free": [(2, 4)], "top": [(4, 5)], "push": [(0, 1), (1, 3), (3, 5)]}
    mesh, push = replace(grid, edge_sets=sets), Traction("push", normal=-1.0, tangential=0.3)
    held = [Displacement("held", x=0.0, y=0.0), Symmetry("top"), Traction("free", x=0.0, y=0.0)]
    own, other = (Material(1.0, 0.2, "strain", law) for law in (MohrCoulomb(0.9, 0.6, 0.0), MohrCoulomb(2.5, 0.75)))
    block = ContactProblem(mesh, own, [*held, push], regions=[Region(other, name="part")])
    least, more = (limit_load_factor(block, ["push"], degree=degree).lower for degree in (3, 4))
    assert (least, more) == (pytest.approx(0.894467, rel=1e-4), pytest.approx(4.23707, rel=1e-5))
    sets = {"held": [(3, 4)], "cap": [(4, 5)], "load": [(1, 2)], "rest": [(0, 1), (0, 3)], "right": [(2, 5)]}
    grid = TriangleMesh.rectangle((2, 1), 0.92, 0.62).with_region("part", lambda x, _: x > 0.46)
    contacts = [Contact("rest", 1.0, cohesion=0.1, shear_limit=1.0), Contact("cap", 0.0, cohesion=0.3, law="bilateral")]
    loads = [Traction("load", x=0.1, y=-0.22), Traction("right", normal=-0.16, tangential=0.0), held[0]]
    own, other = (Material(1.0, 0.2, "strain", NoTension(crushing)) for crushing in (5.4, None))
    block = replace(block, mesh=replace(grid, edge_sets=sets), material=own, conditions=[*contacts, *loads])
    block = replace(block, regions=[Region(other, name="part")])
    assert limit_load_factor(block, ["load"], degree=3).upper == pytest.approx(0.2149, rel=1e-3)


def test_cones_without_room_are_along_rays_of_an_answer():
    """Those of the point with most room are at their tips: a push of −5.6 times was the most, where 23.9 are held."""
    grid, points = TriangleMesh.rectangle((2, 2)), [(0.0, 0.0), (-0.92, 0.0), (-1.84, 0.0), (-0.06, 0.42)]
    points += [(-0.93, 0.46), (-2.01, 0.42), (-0.12, 0.84), (-1.16, 0.84), (-2.18, 0.84)]
    mesh, given = TriangleMesh(points, grid.cells, grid.edge_sets, {"part": [3, 6]}), {"top": (0.04, -0.1)}
    loads = [Traction(side, *xy) for side, xy in (given | {"right": (0.0, 0.0), "left": (-0.11, 0.0)}).items()]
    own, other = (Material(1.0, 0.2, "strain", law) for law in (Tresca(2.3), MohrCoulomb(0.5, 0.4, 0.0)))
    held, part = Displacement("bottom", x=0.0, y=0.0), Region(other, name="part")
    limit = limit_load_factor(ContactProblem(mesh, own, [held, *loads], regions=[part]), ["left"], degree=3)
    assert (limit.lower, limit.violation < 1e-12) == (pytest.approx(23.9464, rel=1e-4), True)


def test_a_rigid_part_beside_a_bilateral_plate_with_friction():
    """Stresses that no row sees end in no breakdown; signs of pressure are the best, as own programs of all say."""
    points = [(-0.02, 0.06), (0.71, 0.11), (1.33, 0.39), (-0.08, 1.62), (0.7, 1.78), (1.3, 1.94)]
    sets = {"base": [(1, 2)], "top": [(4, 5)], "held": [(0, 1), (0, 3), (3, 4)], "plate": [(2, 5)]}
    mesh = TriangleMesh(points, [(0, 1, 3), (1, 3, 4), (1, 2, 5), (1, 4, 5)], sets, {"rock": [0, 1]})
    plate = RigidPlate(force_y=0.8, moment=-0.2, pivot=(1.3, 1.2))
    contacts = [Contact("base", 0.5, shear_limit=1.0), Contact("plate", 1.0, law="bilateral", plate=plate)]
    pushed = [Traction("top", normal=-0.16, tangential=0.0, name="push"), Traction("held", y=-0.2, name="push")]
    (metal, rock), held = (Material(1.0, 0.2, strength=law) for law in (Mises(6.9), None)), Displacement("held", x=0.0)
    conditions, rocks = [*contacts, *pushed, held], [Region(rock, name="rock")]
    problem = ContactProblem(mesh, metal, conditions, lambda _, y: y, rocks)
    found = [limit_load_factor(problem, loads, degree=3).lower for loads in (["push", "plate", "body"], ["push"])]
    assert found == pytest.approx([2.07508, 4.23392], rel=1e-4)
    torn = Contact("top", 0.4, law="bilateral", plate=RigidPlate(force_x=-0.2, force_y=0.14))  # but in one edge only
    conditions = [Contact.tied("bottom"), torn, Traction("left", 1.0, 0.0, name="push"), Traction("right", 0.0, 0.0)]
    mesh = TriangleMesh.rectangle((2, 2)).with_region("rock", lambda _, y: y > 0.5)
    problem = replace(stretched(Tresca(3.0), "stress", mesh), conditions=conditions, regions=rocks)
    assert limit_load_factor(problem, ["push"], degree=3).lower == pytest.approx(2.72, rel=1e-4)  # 0 is no tension
    grid, held = TriangleMesh.rectangle((3, 2), 1.0, 0.85), Contact("bottom", 1.0, cohesion=0.2, law="bilateral")
    moved = grid.vertices + 1e-12 * np.random.default_rng(2).normal(size=grid.vertices.shape)  # 2.11 or 0.49 before
    mesh = replace(grid, vertices=moved).with_region("rock", lambda x, _: x > 0.5)
    loads = Traction("top", 0.08, -0.33), Traction("right", 0.0, 0.0), Traction("left", 0.34, 0.0, name="push")
    problem = ContactProblem(mesh, replace(metal, strength=Mises(1.34)), [held, *loads], regions=rocks)
    assert limit_load_factor(problem, ["push"], degree=3).lower == pytest.approx(2.62565, rel=1e-5)


def test_huge_tractions_and_flows_hide_nothing_that_is_missed():
    """Tractions of 1e9 in a wedge without friction; a point inside 1e6 times as large as what it is to mend."""
    grid, own = TriangleMesh.rectangle((3, 1)), Material(1.0, 0.2, strength=Mises(4.0))
    points = [(0.0, 0.0), (0.46, -0.05), (0.92, -0.1), (1.38, -0.14), (-0.06, 0.96), (0.4, 0.91), (0.86, 0.86)]
    sets = {"wet": [(0, 4)], "top": [(4, 5), (5, 6)], "end": [(3, 7), (6, 7)], "cap": [(2, 3)], "toe": [(0, 1), (1, 2)]}
    mesh = TriangleMesh([*points, (1.32, 0.82)], grid.cells, sets, {"rock": [0, 1, 3]})
    contacts = [Contact("cap", 0.0, plate=RigidPlate(force_y=0.175)), Contact("toe", 0.0), Symmetry("top")]
    loads = [Traction("wet", normal=-0.39, tangential=0.0), Traction("end", x=0.0, y=0.0)]
    body = ContactProblem(mesh, own, [*contacts, *loads], lambda _, y: y, [Region(Material(1.0, 0.2), name="rock")])
    assert limit_load_factor(body, ["body"], degree=4).lower == -np.inf
    points = [(1.4, 0.3), (0.4, 0.6), (0.5, 0.6), (0.3, 0.1), (0.4, 0.5), (0.2, 0.4)]
    sets = {"load": [(0, 3)], "side": [(3, 5)], "rest": [(0, 2), (1, 2), (1, 5)]}
    mesh = TriangleMesh(points, [(0, 3, 4), (0, 2, 4), (3, 4, 5), (1, 4, 5), (1, 2, 4)], sets, {"part": [2, 3]})
    own, other = (Material(1.0, 0.2, "strain", law) for law in (NoTension(), MohrCoulomb(0.486, 0.547, 0.0729)))
    loads = [Traction("load", x=-0.1, y=-0.9), Traction("side", normal=-0.38, tangential=0.0)]
    held = Contact("rest", 0.2, cohesion=0.5, law="bilateral", pore_pressure=0.1)
    piece = ContactProblem(mesh, own, [held, *loads], regions=[Region(other, name="part")])
    assert limit_load_factor(piece, ["load"], degree=3).upper < 0.03
    sides = Contact("bottom", 10.0, cohesion=0.5), Traction("right", x=0, y=0), Traction("top", x=-0.3, y=-0.5)
    corner = stretched(Tresca(1.0), mesh=TriangleMesh.rectangle((1, 1)))
    corner = replace(corner, conditions=[Displacement("left", x=0, y=0), *sides])
    assert limit_load_factor(corner, ["top"], degree=3).upper == pytest.approx(6.788041, rel=1e-5)  # another code's


def test_upper_sides_near_zero_and_of_loads_that_all_but_cancel_each_other():
    """They pull back what others do too much, by a small work; zero is carried where all loads are multiplied."""
    held, top = Contact("bottom", 0.0, cohesion=1.0, law="bilateral"), Traction("top", x=1.0 + 1e-5, y=0.0)
    push = [Traction(side, x=x, y=0.0, name="push") for side, x in (("left", 1.0), ("right", 1e-7 - 1.0))]
    block = replace(stretched(Tresca(100.0)), conditions=[held, top, *push])
    assert limit_load_factor(block, ["push"], degree=3).upper == pytest.approx(-100.0, rel=1e-3)
    torn = Traction("top", x=0.3, y=0.5), Traction("left", x=0.2, y=0.3), Traction("right", x=0.0, y=0.0)
    block = replace(stretched(NoTension(3.0)), conditions=[held, *torn])
    limit = limit_load_factor(block, ["top", "left"], degree=3)
    assert limit.upper >= 0.0 == pytest.approx(limit.upper, abs=1e-5)


def test_what_the_other_loads_break_carries_no_multiple():
    problem = block(Tresca(0.9), 0.3, 2.0)
    pressed = [each for each in problem.conditions if each.name != "weight"]
    pressed += [Traction("top", y=-2.0), Traction("left", x=0.0), Traction("right", x=0.0)]
    assert limit_load_factor(replace(problem, conditions=pressed), ["shear"]).upper == -np.inf
    crushed = stretched(Tresca(1.0))  # by a millionth more than it carries
    loads = [Traction("top", x=0.0, y=-2.0 - 2e-6), Traction("right", x=0.0, y=0.1), *crushed.conditions[2:]]
    assert limit_load_factor(replace(crushed, conditions=loads), ["right"], degree=3).upper == -np.inf
    grid = TriangleMesh.rectangle((1, 4), 1.0, 2.0)  # or a block on another one that alone is pushed
    sets = {**grid.edge_sets, "push": grid.edge_sets["left"][:2], "left": grid.edge_sets["left"][2:]}
    mesh = replace(grid, edge_sets=sets).with_joint("joint", lambda _, y: np.isclose(y, 1.0))
    own, other = (Material(1.0, 0.3, "strain", law) for law in (MohrCoulomb(300.0, 0.3), Tresca(1.0)))
    held = [Contact("bottom", 0.0, cohesion=100.0, law="bilateral"), Contact("joint", 0.0)]
    mesh, part = mesh.with_region("part", lambda _, y: y > 1.0), [Region(other, name="part")]
    for over in (2e-6, 3e-5, 6e-5):  # at 3e-5 the first bound from above, 100, is doubted
        given = ("push", 1.0, 0.0), ("left", 0.0, 0.0), ("right", 0.0, 0.0), ("top", 0.0, -2.0 - over)
        pile = ContactProblem(mesh, own, [*held, *(Traction(*each) for each in given)], regions=part)
        limit = limit_load_factor(pile, ["push"], degree=3)
        assert (limit.lower, limit.upper) == (-np.inf, -np.inf)
    grid = TriangleMesh.rectangle((1, 2))
    r, a = (grid.vertices * [1.4, 1.8] + [0.9, 0.0]).T
    sets = {**grid.edge_sets, "roll": grid.edge_sets["left"][:1], "wall": grid.edge_sets["left"][1:]}
    mesh = TriangleMesh(np.column_stack([r * np.cos(a), r * np.sin(a)]), grid.cells, sets)
    held = Contact("wall", 10.0, pore_pressure=0.1), Displacement("roll", x=0.0), Traction("roll", y=-0.1)
    given = ("right", -0.2, 0), ("top", 0.9, 0.3), ("bottom", 0, 0)
    torn = [Traction(side, normal=n, tangential=t) for side, n, t in given]
    ring = ContactProblem(mesh, Material(1.0, 0.3, "strain", Mises(1.3)), [*held, *torn], lambda _, y: y)
    assert limit_load_factor(ring, ["roll"], degree=4).upper == -np.inf


def test_a_rigid_punch_by_force_is_two_plus_pi_at_most():
    """Prandtl's punch, half of it; friction under it does not matter, and bounds hold 2 + π."""
    pressed = ground(Tresca(1.0), (0, 0.5, 0.75, 1, 1.25, 1.5, 2, 3, 4), (-2, -1, -0.5, -0.25, 0))
    others = [each for each in pressed.conditions if each.edges != "foot"]
    for mu in (0.0, 0.3):
        punch = Contact("foot", mu, name="punch", plate=RigidPlate(force_y=-1.0, x=0.0, rotation=0.0))
        limit = limit_load_factor(replace(pressed, conditions=[punch, *others]), ["punch"])
        assert limit.lower < 2 + np.pi < limit.upper
        moved = limit.collapse.motion.plates["punch"]
        assert moved.y < moved.x == moved.rotation == 0.0
        assert mu or 4.3 < limit.lower < limit.upper < 5.6


@pytest.mark.parametrize(("law", "beside"), [("unilateral", "rest"), ("bilateral", "left")])
def test_a_plate_moves_beside_a_held_edge(law, beside):
    """There the body slips along what holds it: before, nothing moved, and no upper bound was found, or an error."""
    mesh = TriangleMesh.rectangle((4, 4)).with_edges("foot", lambda x, y: (y > 1 - 1e-9) & (x < 0.5))
    mesh = mesh.with_edges("rest", lambda x, y: (y > 1 - 1e-9) & (x > 0.5))
    punch = Contact("foot", 0.5, law=law, plate=RigidPlate(force_y=-1.0, force_x=0.3, rotation=0.0), name="punch")
    held = [Displacement(side, x=0.0, y=0.0) for side in ("bottom", beside)]
    free = [Traction(side, 0.0, 0.0) for side in ("left", "right", "rest") if side != beside]
    limit = limit_load_factor(replace(stretched(Tresca(1.0), mesh=mesh), conditions=[punch, *held, *free]), ["punch"])
    assert 0.5 < limit.lower < limit.upper < 4.0
    assert limit.collapse.gap.sum() == pytest.approx(limit.upper - limit.lower, rel=1e-5)


@pytest.mark.parametrize("apart", [1e8, 1e12])
def test_strengths_far_apart_count_each_beside_its_own(apart):
    """What the stronger one misses by rounding was more than the other one has: both sides were 0, or 6.2, or wrong."""
    mesh = TriangleMesh.rectangle((2, 2)).with_region("part", lambda _, y: y > 0.5)
    strong = Region(Material(10.0, 0.3, "strain", MohrCoulomb(apart, 0.4)), name="part")
    limit = limit_load_factor(replace(stretched(Tresca(1.0), mesh=mesh), regions=[strong]), ["top"], degree=3)
    assert (limit.lower, limit.upper) == (pytest.approx(2.184675, rel=1e-6), pytest.approx(3.0461482, rel=1e-7))
    loads = [Traction("top", x=0.0, y=-0.4), Traction("left", x=0.08, y=0.0), Traction("right", x=0.0, y=0.0)]
    pressed, weak = [Displacement("bottom", x=0.0, y=0.0), *loads], replace(strong.material, strength=Tresca(1.4))
    dry = replace(stretched(NoTension(1e8), mesh=mesh), conditions=pressed, regions=[replace(strong, material=weak)])
    assert limit_load_factor(dry, ["top"], degree=3).upper == pytest.approx(7.617, rel=1e-3)
    assert check(limit_proof(dry, ["top"], degree=3))[1] < 7.7
    bare = replace(dry, material=replace(dry.material, strength=NoTension()), regions=[strong])  # beside the loads
    limit = limit_load_factor(bare, ["left"], degree=3)
    assert [limit.lower, limit.upper] == pytest.approx([2.7925, 8.5714], rel=1e-3)  # 2.96 and 42.6, 13.8 and 20882
    limit = limit_load_factor(block(MohrCoulomb(500.0, 0.3), 0.0, 1.0, cohesion=1e3 * apart), ["shear"], degree=3)
    assert (limit.lower, limit.upper) == (pytest.approx(477.96376, rel=1e-6), pytest.approx(478.0560285, rel=1e-8))
    fading = replace(stretched(Tresca(lambda _, y: 1.0 - y + 1.0 / apart), top=0.0), body_potential=lambda _, y: -y)
    assert limit_load_factor(fading, ["body"], degree=3).lower == pytest.approx(2.0, rel=1e-6)
    grid, dry = TriangleMesh.rectangle((3, 1)), Material(10.0, 0.3, strength=NoTension(1e8))
    at = [(0, 0), (0.29, -0.02), (0.58, -0.04), (0.86, -0.06), (-0.08, 1.58), (0.24, 1.55), (0.56, 1.53), (0.89, 1.5)]
    mesh = TriangleMesh(at, grid.cells, grid.edge_sets, {"part": [2, 4, 5]})
    leaning = replace(stretched(Tresca(1.4), "stress", mesh), conditions=pressed, regions=[Region(dry, name="part")])
    assert limit_load_factor(leaning, ["top"], degree=3).lower < 1e-6  # edges leave no room


def random_body(seed):
    """Blocks with random strengths, contacts, weight and thrust."""
    generator = np.random.default_rng(seed)
    mesh = TriangleMesh.rectangle((3, 4), 1.0, 2.0)
    if generator.random() < 0.6:
        mesh = mesh.with_joint("joint", lambda _, y: np.isclose(y, 1.0))
    mesh = mesh.with_region("part", lambda x, _: x > 0.4)
    c = float(generator.uniform(0.5, 3.0))
    laws = [Tresca(c), Mises(2 * c), MohrCoulomb(c, 0.4), MohrCoulomb(c, 0.2, 0.3 * c), NoTension(4 * c), None]
    plane = str(generator.choice(["strain", "stress"]))
    own, other = (laws[i] for i in generator.choice(6, 2))
    own = own or (None if other else Tresca(c))
    law = {"friction": float(generator.choice([0.0, 0.4])), "cohesion": float(generator.choice([0.0, 0.3]))}
    if generator.random() < 0.4:
        law["shear_limit"] = float(generator.uniform(0.2, 1.0))
    contacts = [Contact("bottom", **law)]
    if mesh.joint_names:
        kind = str(generator.choice(["unilateral", "bilateral", "tied"]))
        contacts.append(Contact("joint", 0.0 if kind == "tied" else 0.5, law=kind))
    x, y, push = (float(generator.uniform(*ends)) for ends in ((-0.3, 0.3), (0.1, 1.0), (0.1, 1.0)))
    loads = [Traction("top", x, -y), Traction("left", push, 0.0, name="push"), Traction("right", 0.0, 0.0)]
    weight = float(generator.choice([0.0, 0.5]))
    part, force = Region(Material(2.0, 0.3, plane, other), name="part"), (lambda _, y: weight * y) if weight else 0.0
    return ContactProblem(mesh, Material(1.0, 0.2, plane, own), [*contacts, *loads], force, [part])


@pytest.mark.parametrize("seed", thinned(list(range(200)), 2))
def test_no_lower_bound_exceeds_an_upper_one(seed):
    for load in ("push", "top"):
        limit = limit_load_factor(random_body(seed), [load], degree=4)
        assert limit.lower <= limit.upper
        if limit.collapse is not None and limit.mechanism is None:
            assert limit.collapse.gap.sum() == pytest.approx(limit.upper - limit.lower, abs=1e-5 * (1 + limit.upper))


@pytest.mark.parametrize(("law", "least", "excess"), [(Tresca, 0.5, "0.1 [stress]"), (Mises, 1.0, "0.2 [stress]")])
def test_solve_says_where_the_elastic_stress_exceeds_the_strength(law, least, excess):
    """Uniform tension of 1 in plane stress, which c = 0.5 or a yield stress of 1 just carry."""
    weak, strong = (solve(stretched(law(factor * least), "stress")) for factor in (0.8, 1.2))
    assert weak.status == "solved"
    (found,) = (remark for remark in weak.remarks if "strength" in remark)
    assert all(told in found for told in (excess, "100 %"))
    assert not any("strength" in remark for remark in strong.remarks)


@pytest.mark.parametrize(
    ("c", "of", "fluid", "exact"), [(1.5, None, 0.0, 1.5), (1.5, ["bottom"], 0.0, 1.8), (None, None, 0.5, 1.35)]
)
def test_strength_may_be_divided_by_what_the_shear_leaves(c, of, fluid, exact):
    """Pressure 2 and shear 1: the base has μ times what the fluid leaves of the pressure, the block c."""
    wet = block(c and Tresca(c), 0.9, 2.0, (2, 1), pore_pressure=fluid)
    found = strength_reduction_factor(wet, of=of, accuracy=1e-2)
    assert found.lower <= exact * (1.0 + 1e-6) <= found.upper * (1.0 + 2e-6) < found.lower + 2e-2 * exact


def test_what_has_no_cohesion_carries_any_multiple_or_none():
    """σ₁/σ₂ = 2.2 = (1 + sin φ')/(1 − sin φ') at tan φ' = tan φ/1.6912315; 0.1 % beyond, any multiple was carried."""
    found = strength_reduction_factor(stretched(MohrCoulomb(0.0, 0.6), top=-1.1, right=-0.5), degree=3)
    assert found.lower <= 1.691232 <= found.upper < 1.002 * found.lower


@pytest.mark.parametrize("phi", [0.5, lambda x, _: 0.5 + 0.0 * x])
def test_cohesion_and_the_tangent_of_the_angle_of_friction_are_divided_alike(phi):
    """A block that 2c cos φ/(1 + sin φ) tears, with c and tan φ over 1.5, is pulled with so much."""
    pulled = stretched(MohrCoulomb(1.2, phi), top=in_tension(1.2 / 1.5, np.arctan(np.tan(0.5) / 1.5)))
    found = strength_reduction_factor(pulled, accuracy=1e-2, degree=3)
    assert found.lower <= 1.5 * (1.0 + 1e-6) <= found.upper * (1.0 + 2e-6) < 1.53


def test_what_is_tied_is_held():
    """A block torn off an obstacle, and off what holds it: nothing else may give way than the block."""
    free = [Traction("top", x=0.5, y=1.0), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    bases = Displacement("bottom", x=0.0, y=0.0), Contact.tied("bottom")
    blocks = (replace(stretched(Tresca(0.7)), conditions=[base, *free]) for base in bases)
    held, tied = (limit_load_factor(each, ["top"], degree=3) for each in blocks)
    assert 0.5 < tied.lower <= tied.upper < 1.5
    assert (tied.lower, tied.upper) == pytest.approx((held.lower, held.upper), rel=1e-6)


def test_rigid_parts_that_share_a_vertex_turn_about_it():
    """Quarters of a block between two that yield: as if they were 10 000 times as strong as these."""
    mesh = TriangleMesh.rectangle((1, 1)).with_region("rock", lambda x, y: np.abs(x - 0.5) > np.abs(y - 0.5))
    free = [Traction(side, 0.0, 0.0) for side in ("top", "bottom")]
    held = [Displacement("left", x=0.0, y=0.0), Traction("right", x=0.0, y=1.0, name="shear"), *free]
    rocks = (Region(Material(10.0, 0.3, "strain", law), name="rock") for law in (None, Tresca(1e4)))
    material = Material(10.0, 0.3, "strain", Tresca(1.0))
    problems = [ContactProblem(mesh, material, held, regions=[rock]) for rock in rocks]
    rigid, strong = (limit_load_factor(problem, ["shear"], degree=3) for problem in problems)
    assert rigid.upper == pytest.approx(strong.upper, rel=1e-5)
    assert float(check(limit_proof(problems[0], ["shear"], degree=3))[1]) == pytest.approx(rigid.upper, rel=1e-5)


def test_what_rigid_parts_hold_has_no_limit():
    """Three hinges in a triangle: equations say that it does not move, and that it has power."""
    mesh = TriangleMesh.rectangle((3, 1))
    mesh = TriangleMesh(mesh.vertices @ [[1.0, 0.0], [0.2, 1.0]], mesh.cells, mesh.edge_sets)
    mesh = mesh.with_region("rock", lambda x, y: np.hypot(x - 0.578, y - 0.667) > 0.1)
    loads = [Traction("left", x=1.0, y=0.1), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=-0.5)]
    material, rock = Material(1.0, 0.3, "strain", Tresca(1.0)), Region(Material(1.0, 0.3, "strain"), name="rock")
    problem = ContactProblem(mesh, material, [Displacement("bottom", x=0.0, y=0.0), *loads], regions=[rock])
    weak = block(Tresca(1.0), 0.3, 0.5, shear=0.0, cohesion=1e-3)  # all rigid beside its base, and a load of zero
    for each, name in ((problem, "left"), (weak, "shear")):
        limit = limit_load_factor(each, [name], degree=3)
        assert (limit.lower, limit.upper) == (np.inf, np.inf)


def test_stresses_of_rigid_parts_that_no_row_sees_are_none():
    """Rounding of their rows passed for strength: in one body 47.6 were said to be carried, where 45.3 move it."""
    turn = np.array([[np.cos(1.0), np.sin(1.0)], [-np.sin(1.0), np.cos(1.0)]])
    grid = TriangleMesh.rectangle((3, 3)).with_region("rock", lambda x, _: x > 0.5)
    grid = grid.with_joint("joint", lambda _, y: np.isclose(y, 1.0 / 3.0))
    contacts = [Contact("joint", 0.0, shear_limit=0.5), Contact("right", 0.2, cohesion=0.1, shear_limit=0.1)]
    tied = [Contact.tied("bottom"), replace(Contact.tied("top"), plate=RigidPlate(force_x=0.1, force_y=-0.3))]
    conditions = [*contacts, *tied, Traction("left", normal=-0.25, tangential=0.0, name="push")]
    soft, rock = (Material(1.0, 0.3, "strain", law) for law in (Tresca(2.0), None))
    mesh, rocks = replace(grid, vertices=grid.vertices @ turn), [Region(rock, name="rock")]
    limit = limit_load_factor(ContactProblem(mesh, soft, conditions, regions=rocks), ["push"], degree=4)
    assert limit.lower == pytest.approx(19.75485, rel=1e-5)


def test_a_plate_that_nothing_keeps_from_sliding_carries_nothing():
    """No strain is in that motion, but rounding: whether it breaks the conditions of strain does not count."""
    mesh = TriangleMesh.rectangle((3, 1))
    mesh = TriangleMesh(mesh.vertices @ [[1.0, 0.0], [-0.3, 1.0]], mesh.cells, mesh.edge_sets)
    plate = RigidPlate(force_x=-0.1, force_y=-0.8, moment=-0.1, pivot=(0.6, 1.0))
    cap = Contact("top", 0.0, plate=plate, name="cap")
    contacts = [Contact("bottom", 0.8), cap, Contact("right", 0.8, cohesion=0.3)]
    material = Material(1.0, 0.2, "strain", Mises(1.3))
    problem = ContactProblem(mesh, material, [*contacts, Traction("left", x=0.5, y=0.0)], lambda _, y: y)
    limit = limit_load_factor(problem, ["cap"], degree=3)
    assert (limit.lower, limit.upper) == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("room", [1e-4, 1e-5])
def test_what_other_loads_leave_of_a_strength_is_carried(room):
    """Pressed to all but its strength, a block carries as little shear as that leaves, in proportion: not none."""
    crushing = 2.0 * np.cos(0.5) / (1.0 - np.sin(0.5))
    block, top = stretched(MohrCoulomb(1.0, 0.5)), Traction("top", x=0.0, y=-crushing * (1.0 - room))
    pressed = [top, Traction("right", x=0.0, y=1.0), *block.conditions[2:]]
    limit = limit_load_factor(replace(block, conditions=pressed), ["right"], degree=3)
    assert limit.lower == pytest.approx(5.47 * room, rel=1e-2, abs=1e-6)  # what solvers leave of a strength of 1


def test_a_factor_is_found_as_closely_as_rounding_allows(pytestconfig):
    """Next to μ W/H a program may have no answer. What is known then is within a millionth, or far off."""
    sides = [Traction("left", x=0.37, y=0.0), *(Traction(side, x=0.0, y=0.0) for side in ("right", "top"))]
    conditions = [Contact("bottom", 0.5), *sides]
    pushed = ContactProblem(TriangleMesh.rectangle((8, 4), 2.0, 1.0), Material(1.0, 0.2), conditions, lambda _, y: y)
    found = strength_reduction_factor(pushed, accuracy=1e-12)
    assert [found.lower, found.upper] == pytest.approx([1.0 / 0.37] * 2, rel=2e-6)
    examples = pytestconfig.rootpath / "examples"
    names = ("gravity_dam", "dry_stone_wall", "dam_on_seam")
    dam, upright, seam = (load_problem(examples / f"{name}.toml").problem for name in names)
    found = strength_reduction_factor(dam)  # HiGHS cannot begin one of its programs at tolerances of 1e-10
    assert found.lower * (1.0 - 1e-6) <= 1.393278 <= found.upper * (1.0 + 1e-6) < 1.001 * found.lower * (1.0 + 2e-6)
    found = strength_reduction_factor(upright)
    assert (found.lower > 900.0, found.upper) == (True, np.inf)
    assert strength_reduction_factor(seam, of=["seam"], accuracy=0.5, degree=3).lower == 1.0  # 1.19, by hand


def test_at_its_time_limit_safety_has_the_bounds_that_are_known(tmp_path, shell, monkeypatch, clock):
    """Here after three limit loads, each of which takes a second."""
    monkeypatch.setattr("qvi_contact.limit.load_factor.LimitLoad", lambda *x: clock.passes(1.0) or LimitLoad(*x))
    save_problem(tmp_path / "block.toml", block(Tresca(1.5), 0.9, 2.0, (2, 1)))
    told = json.loads(shell("safety", tmp_path / "block.toml", "--time-limit=2.5", "--accuracy=1e-9", "--json")[1])
    assert 1.0 <= told["lower"] <= 1.5 * (1.0 + 1e-6) <= told["upper"] * (1.0 + 2e-6) < 2.1
    assert ("more time" in told["remarks"][0], clock.now) == (True, 3.0)


def test_at_its_time_limit_a_limit_load_has_the_side_that_is_known(tmp_path, shell, monkeypatch, clock):
    true = pytest.importorskip("clarabel").DefaultSolver
    late = SimpleNamespace(solve=lambda: SimpleNamespace(status="MaxTime", x=np.zeros(1), z=np.zeros(1), r_prim=1.0))
    monkeypatch.setattr("clarabel.DefaultSolver", lambda *data: late if deadline.over else true(*data))
    save_problem(tmp_path / "torn.toml", stretched(Tresca(0.7)))
    held = block(Tresca(1.5), 0.9, 2.0, (2, 1))
    for owner, name, factor in ((FlowProgram, "_program", 0.6), (StressProgram, "program", -np.inf)):
        with monkeypatch.context() as patched:
            true_program = getattr(owner, name)
            patched.setattr(owner, name, lambda *x, true=true_program: clock.passes(10.0) or true(*x))
            slipping = limit_load_factor(block(Tresca(1.5), 0.3, 2.0, (2, 1)), ["shear"], time_limit=5.0)
            assert (slipping.lower, slipping.upper) == (pytest.approx(factor), pytest.approx(0.6))  # of rigid blocks
            status, out, err = shell("limit", tmp_path / "torn.toml", "--load", "top", "--time-limit=5")
            with nullcontext() if owner is FlowProgram else pytest.raises(SolveError, match="time limit"):
                assert limit_load_factor(held, ["weight"], time_limit=5.0).in_time  # there is no other side
            with nullcontext() if owner is FlowProgram else pytest.raises(SolveError, match="time limit"):
                assert strength_reduction_factor(held, time_limit=5.0).lower == 1.0
        assert ("this mesh carries 1." in out, status) == (owner is FlowProgram, 1)
        assert (slipping.in_time, "time limit" in slipping.missing, "time limit" in out + err) == (False, True, True)


def test_strength_that_is_not_enough_has_a_factor_below_one():
    found = strength_reduction_factor(block(Tresca(5.0), 0.3, 2.0, (2, 1)), accuracy=0.05)
    assert 0.57 < found.lower <= 0.6 * (1 + 1e-6) <= found.upper * (1 + 1e-6) < 0.63
    for wrong, told in (({"of": ["botom"]}, "bottom"), ({"accuracy": 2.0}, "below 1")):
        with pytest.raises(InputError, match=told):
            strength_reduction_factor(block(Tresca(5.0), 0.3, 2.0), **wrong)
    body = stretched(MohrCoulomb(1.0, 0.5), "stress", TriangleMesh.rectangle((2, 3)))
    sides = [Traction(*side) for side in (("top", 0.0, -1.0), ("left", 0.01, 0.0), ("right", 0.0, 0.0))]
    on_ice = replace(body, conditions=[Contact("bottom", 0.0), *sides])  # strength a thousand times as large is no help
    assert strength_reduction_factor(on_ice, degree=3).lower == 0.0


@pytest.mark.usefixtures("outlined")
def test_the_commands_say_both_sides_and_draw_the_flow(tmp_path, shell, monkeypatch):
    file, picture, flow = (tmp_path / name for name in ("block.toml", "flow.png", "flow.vtu"))
    save_problem(file, block(Tresca(0.5), 0.6, 2.0))
    status, out, _ = shell("limit", file, "--load", "shear", "--json", "--plot", picture, "--vtk", flow)
    found = json.loads(out)
    assert (status, found["bounds"], picture.stat().st_size > 1000) == (0, True, True)
    assert [found["factor"], found["upper"]] == pytest.approx([0.5, 0.5], rel=1e-5)
    grid = pytest.importorskip("meshio").read(flow)
    stress = next(values for name, values in grid.point_data.items() if name.startswith("stress"))
    assert stress[:, 3] == pytest.approx(0.5, rel=1e-3)  # shear at its limit
    assert np.abs(grid.point_data["velocity"]).max() == pytest.approx(1.0)
    assert [len(grid.points), sum(map(len, grid.cell_data["gap"]))] == [16 * 3 * 10, 16 * 3 * 9]
    status, out, err = shell("safety", file, "--json", "--accuracy", "0.1", "--verbose")
    assert (status, "divided by  lower limit" in err) == (1, True)  # the block carries half of the shear
    assert json.loads(out)["lower"] <= 0.5 * (1 + 1e-6) <= json.loads(out)["upper"] * (1 + 1e-6)
    status, _, err = shell("safety", file, "--of", "nothing")
    assert (status, "bottom" in err) == (2, True)
    file.write_text(f"{file.read_text(encoding='utf-8')}\n[solve]\ntime_limit = 50.0\n", encoding="utf-8")

    def told(*_, time_limit, **_more):
        raise InputError("told", time_limit, "")

    for name, *words in (("limit_load_factor", "limit", "--load", "shear"), ("strength_reduction_factor", "safety")):
        monkeypatch.setattr(f"qvi_contact.limit.load_factor.{name}", told)
        assert "told: 50.0" in shell(*words, file)[2]


STRESSES = np.random.default_rng(1).normal(size=(400, 3)) * [2.0, 2.0, 1.0]


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_cones_are_criteria_as_textbooks_write_them_in_principal_stresses(plane):
    """The one out of the plane is zero, or between the others."""
    mean, radius = STRESSES[:, :2].mean(axis=1), np.hypot((STRESSES[:, 0] - STRESSES[:, 1]) / 2, STRESSES[:, 2])
    most, least, c, phi = mean + radius, mean - radius, 0.9, 0.5
    low, middle, high = np.sort([most, least, 0.0 * mean if plane == "stress" else mean], axis=0)
    equivalent = np.sqrt(((low - middle) ** 2 + (middle - high) ** 2 + (high - low) ** 2) / 2)
    rubs = high * (1 + np.sin(phi)) - low * (1 - np.sin(phi)) <= 2 * c * np.cos(phi)
    for strength, holds in (
        (Tresca(1.3), high - low <= 2.6), (Mises(2.0), equivalent <= 2.0), (MohrCoulomb(c, phi), rubs),
        (MohrCoulomb(c, phi, 0.2), rubs & (most <= 0.2)), (NoTension(), most <= 0),
        (NoTension(3.0), (most <= 0) & (least >= -3.0)),
    ):  # fmt: skip
        within = [np.hypot(each.mean * 2 * mean, 2 * radius) <= each.factor * each.field - each.pressure * 2 * mean
                  for each in strength.cones(plane)]  # fmt: skip
        assert (np.all(within, axis=0) == holds).all()


@pytest.mark.parametrize(
    ("make", "field"),
    [(lambda: Tresca(0.0), "Tresca.c"), (lambda: Mises(float("nan")), "Mises.yield_stress"),
     (lambda: MohrCoulomb(1.0, 30.0), "MohrCoulomb.phi"), (lambda: MohrCoulomb(0.0, 0.0), "MohrCoulomb.c"),
     (lambda: MohrCoulomb(1.0, 0.5, -0.1), "MohrCoulomb.tension"), (lambda: NoTension(0.0), "NoTension.crushing"),
     (lambda: Material(1.0, 0.3, "strain", 2.0), "Material.strength")],
)  # fmt: skip
def test_bad_strengths_are_refused(make, field):
    with refused_at(field):
        make()


def test_an_angle_may_be_written_in_degrees():
    strength = '[material]\nstrength = { law = "mohr-coulomb", c = 1.0, phi = "30 * pi / 180" }\n'
    text = problem_to_toml(stretched(None)).replace("[material]\n", strength)
    assert problem_from_toml(text).problem.material.strength == MohrCoulomb(1.0, np.pi / 6)
