"""Proof files: what they prove is checked in exact arithmetic, and a changed number breaks them."""

import copy
import json
import os
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from operator import getitem
from pathlib import Path

import numpy as np
import pytest

import qvi_contact.limit
from qvi_contact import NoTension, SolveError, Tresca, TriangleMesh, limit_load_factor, load_problem, save_problem
from qvi_contact.element import exponents
from qvi_contact.limit import check, check_proof, limit_proof, sentences
from qvi_contact.problem import Contact, ContactProblem, Material, Mises, MohrCoulomb, Region, RigidPlate, Traction
from tests.cases import refused_at
from tests.qvi_contact.test_limit_yielding import random_body, stretched

EXAMPLES = Path(__file__).parents[2] / "examples"


def heavy_wall(strength=None, low=0.0):
    """Two blocks with a joint under their weight, pushed from the left."""
    mesh = TriangleMesh.rectangle((2, 4), 1.0, 2.0, origin=(0.0, low))
    mesh = mesh.with_joint("joint", lambda _, y: np.abs(y - low - 1.0) < 1e-9)
    contacts = [Contact("bottom", 0.5), Contact("joint", 0.4, cohesion=0.05)]
    loads = [Traction("top", x=0, y=-1.0), Traction("left", x=1.0, y=0, name="push")]
    loads.append(Traction("right", normal=0, tangential=0))
    return ContactProblem(mesh, Material(10.0, 0.2, "strain", strength), [*contacts, *loads], lambda _, y: 0.8 * y)


def on(contact, strength=None):
    """The wall with another contact."""
    wall = heavy_wall(strength)
    return replace(wall, conditions=[contact, *(each for each in wall.conditions if each.edges != contact.edges)])


def under(law, strength=None, **forces):
    """The wall under a plate that forces drive."""
    wall, options = heavy_wall(strength), {"friction": 0.0 if law == "tied" else 0.3}
    cap = Contact("top", law=law, plate=RigidPlate(force_y=-1.0, **forces), name="cap", **options)
    return replace(wall, conditions=[cap if each.edges == "top" else each for each in wall.conditions])


def punched(strength, friction=0.0):
    """A block on the ground, half of its top pressed by a plate that does not turn."""
    block = stretched(strength)
    mesh = block.mesh.with_edges("foot", lambda x, y: (y > 1 - 1e-9) & (x < 0.5))
    mesh = mesh.with_edges("free", lambda x, y: (y > 1 - 1e-9) & (x > 0.5))
    foot = Contact("foot", friction, plate=RigidPlate(force_y=-1.0, x=0.0, rotation=0.0), name="punch")
    return ContactProblem(mesh, block.material, [foot, Traction("free", x=0, y=0), *block.conditions[1:]])


def on_rock(strength):
    """A stretched block of which one half is rigid."""
    mesh = TriangleMesh.rectangle((2, 4)).with_region("rock", lambda _, y: y < 0.5)
    return replace(stretched(strength, mesh=mesh), regions=[Region(Material(10.0, 0.3, "strain"), name="rock")])


@pytest.mark.parametrize(
    ("problem", "load"),
    [
        (on(Contact("bottom", 0.5, pore_pressure=lambda x, _: 0.2 + 0.1 * x)), "push"),
        (on(Contact("bottom", 0.5, pore_pressure=0.2), MohrCoulomb(2.0, 0.6)), "push"),
        (on(Contact("bottom", 0.3, law="bilateral")), "push"),
        (on(Contact("bottom", 0.3, law="bilateral", shear_limit=0.3), MohrCoulomb(1.0, 0.3)), "push"),
        (on(Contact("bottom", 0.0, cohesion=0.4, law="bilateral"), MohrCoulomb(2.0, 0.6)), "push"),
        (on(Contact("bottom", 0.5, plate=RigidPlate(x=0.1)), MohrCoulomb(2.0, 0.6)), "push"),
        (on(Contact("joint", 0.4, law="bilateral"), Tresca(2.0)), "push"),
        (punched(Tresca(0.7)), "punch"),
        (punched(MohrCoulomb(1.0, 0.4), 0.2), "punch"),
        (under("tied", force_x=0.0, moment=0.5, pivot=(0.5, 2.0)), "push"),
        (under("unilateral", MohrCoulomb(2.0, 0.6), moment=-0.5), "push"),
        (under("bilateral", MohrCoulomb(1.5, 0.3), force_x=0.1, moment=-0.5), "push"),
        (stretched(Tresca(0.7)), "top"),
        (stretched(Mises(1.0), "stress"), "top"),
        (heavy_wall(MohrCoulomb(2.0, 0.6), low=0.75), "push"),
        (on_rock(Tresca(0.7)), "top"),
        (on(Contact("joint", 0.1)), "push"),  # a block slides on one at rest
        (load_problem(EXAMPLES / "dragged_block_holds.toml").problem, "drag"),  # by the simplex method
        (random_body(14), "push"),  # shear beyond its bound in one ordinate, but nowhere
    ],
)
def test_proofs_hold_and_lose_next_to_nothing(problem, load):
    limit, proof = limit_load_factor(problem, [load], degree=3), limit_proof(problem, [load], degree=3)
    assert float(Fraction(proof["stress"]["factor"])) == pytest.approx(limit.lower, rel=1e-4)
    lower, upper, counted = check(json.loads(json.dumps(proof)))
    assert lower == Fraction(proof["stress"]["factor"])
    assert counted["edges with tractions"] >= 4.5 * problem.mesh.cell_count
    assert (counted["stresses in cones"] > 0) == problem.yields
    assert counted["resultants of plates"] == sum(each is not None for c in proof["contacts"] for each in c["forces"])
    assert (upper is None) == ("upper" in proof["missing"]) == np.isinf(limit.upper)
    if upper is not None:
        assert float(upper) == pytest.approx(limit.upper, rel=1e-3)


def changed(proof, place, more="1/1000000000000000000000"):
    """The proof with one number changed by next to nothing."""
    broken, (*path, last) = copy.deepcopy(proof), place
    part = reduce(getitem, path, broken)
    part[last] = str(Fraction(part[last]) + Fraction(more))
    return broken


def test_every_number_counts():
    proof = limit_proof(heavy_wall(MohrCoulomb(2.0, 0.6)), ["push"], degree=3)
    given = ("loads", 0, "along", 0, 1, 0, 1)
    places = [("stress", "ordinates", 10, 2, 1), ("body_force", 0, 1), given, ("stress", "factor"), ("vertices", 5, 0)]
    for place in places:
        with pytest.raises(ValueError, match=r"differ|is not|beyond"):
            check(changed(proof, place))
    for place in [("strengths", 0, 0, 0), ("contacts", 0, "friction")]:
        with pytest.raises(ValueError, match="beyond"):
            check(changed(proof, place, "-1/2" if place[0] == "contacts" else "-19/10"))


def test_every_velocity_counts():
    """Flows of a body that keeps its volume, of one that dilates, and of rigid blocks."""
    walls = heavy_wall(MohrCoulomb(2.0, 0.6)), on(Contact("bottom", 0.1))
    for problem, load in ((stretched(Tresca(0.7)), "top"), *((wall, "push") for wall in walls)):
        proof = limit_proof(problem, [load], degree=3)
        del proof["stress"]
        for part in (9, 11):
            with pytest.raises(ValueError, match=r"cannot flow|differ|moves where"):
                check(changed(proof, ("flow", "ordinates", part, 1, 0)))
    with pytest.raises(ValueError, match="cannot move"):  # blocks slide, and would have to rise by more
        check(changed(proof, ("contacts", 0, "friction"), "1"))


@pytest.mark.parametrize("strength", [MohrCoulomb(1.5, 0.3), Tresca(2.0), None])
def test_every_number_of_a_plate_counts(strength):
    proof = limit_proof(under("bilateral", strength, moment=-0.5), ["push"], degree=3)
    plate, moved = ("contacts", 2), ("flow", "plates", "cap")
    if "stress" in proof:
        stress = ("stress", "ordinates", 47, 0, 0)
        for place in [(*plate, "forces", 1, 0, 0), (*plate, "forces", 2, 1, 0), (*plate, "pivot", 0), stress]:
            with pytest.raises(ValueError, match=r"are not its forces|differ|not in equilibrium"):
                check(changed(proof, place))
        del proof["stress"]
    for place, told in [((*moved, 0), "no force is given"), ((*moved, 1), "cannot move"), ((*moved, 2), "cannot move")]:
        with pytest.raises(ValueError, match=told):
            check(changed(proof, place))
    assert check(changed(proof, (*plate, "forces", 1, 0, 0)))[1] != check(proof)[1]


def test_thrust_crosses_masonry_beside_a_free_side():
    """A square under p = 1, pushed by q, turns over its toe at q = 1. Cones at coefficients of σ there left q = 0.5."""
    sides = [Contact.tied("bottom"), Traction("top", 0.0, -1.0), Traction("right", 0.0, 0.0), Traction("left", 1, 0)]
    for cells in (2, 4):
        block = replace(stretched(NoTension(), mesh=TriangleMesh.rectangle((cells, cells))), conditions=sides)
        limit = limit_load_factor(block, ["left"], degree=4)
        assert 1.0 - 0.9 / cells < limit.lower < 1.0 < limit.upper < 1.0 + 0.4 / cells
    points = np.random.default_rng(1).dirichlet([1.0] * 3, 99)[:, None] ** exponents(2)
    xx, yy, xy = np.moveaxis((points.prod(axis=2) * [1, 2, 2, 1, 2, 1]) @ limit.collapse.stress, -1, 0)
    assert (xx + yy + np.hypot(xx - yy, 2.0 * xy)).max() < 1e-9
    assert float(check(limit_proof(block, ["left"], degree=4))[0]) == pytest.approx(limit.lower, rel=1e-6)
    sides[2:] = Traction("right", 0.0, -1e-12, name="weak"), Traction("left", 0.0, 0.0)
    assert abs(limit_load_factor(replace(block, conditions=sides), ["weak"], degree=4).lower) < 1.0  # nothing shears it
    # σ_yy = −3 λ², σ_xy = λ (1, 2, 4) and σ_xx = −1 … −6 in coefficients, λ = 0 along y = 0
    stress = zip(range(6), (0, 0, 0, 0, 0, -3), map(Fraction, ("0", "0", "1/2", "0", "1", "4")), strict=True)
    stress = dict(zip(check_proof.exponents(2), ((-1 - n, yy, xy) for n, yy, xy in stress), strict=True))
    (found,) = check_proof.divided(stress, [(-1, -1), (1, 0), (0, 1)])
    assert [*zip(*found.values(), strict=True)] == [(-3,) * 6, (-1, -2, -3, -4, -5, -6), (-1, -1.5, -2.5, -2, -3, -4)]


def test_what_is_tied_slips_at_no_price():
    proof = limit_proof(under("tied", force_x=0.0, moment=0.5, pivot=(0.5, 2.0)), ["push"], degree=3)
    proof.pop("stress", None)
    proof["contacts"][2]["shear_limit"] = "1"
    with pytest.raises(ValueError, match="cannot move like this"):
        check(changed(proof, ("flow", "plates", "cap", 0), "1"))


def test_loads_that_cannot_be_carried():
    """A mechanism of rigid blocks proves it; loads that are carried have none."""
    proof = limit_proof(on(Traction("left", x=5.0, y=0.0)), [])
    assert check(json.loads(json.dumps(proof)))[:2] == (None, -np.inf)
    with pytest.raises(SolveError, match=r"no motion of rigid blocks .* name one or more to multiply"):
        limit_proof(on(Traction("left", x=0, y=0)), [])
    with pytest.raises(SolveError, match="nothing to prove"):  # nor has a body without any limit
        limit_proof(stretched(None), ["top"])


def test_the_checker_runs_without_this_package(tmp_path):
    path = tmp_path / "limit.json"
    path.write_text(json.dumps(limit_proof(stretched(Tresca(0.7)), ["top"])))
    script = Path(qvi_contact.limit.__file__).with_name("check_proof.py")
    told = subprocess.run([sys.executable, "-I", str(script), str(path)], capture_output=True, text=True, check=True)
    assert told.stdout.startswith("proved: the loads times")


@pytest.mark.parametrize(
    ("contact", "field"),
    [(Contact("bottom", lambda x, _: 0.2 + x * (0.5 - x) ** 2 * (1.0 - x)), "Contact.friction"),  # alike at vertices
     (Contact("bottom", 0.2, cohesion=lambda x, _: x), "Contact.cohesion")],
)  # fmt: skip
def test_what_files_do_not_hold_is_refused(contact, field):
    with refused_at(field):
        limit_proof(on(contact), ["push"])


def test_the_command_writes_and_checks_them(tmp_path, shell):
    file, proof = tmp_path / "block.toml", tmp_path / "limit.json"
    save_problem(file, stretched(Tresca(0.7)))
    status, out, _ = shell("limit", file, "--load", "top", "--proof", proof)
    assert (status, out.count("proved:")) == (0, 2)
    assert "--load" in shell("limit", file, "--proof", proof, "--plot", tmp_path / "a.png")[2]
    save_problem(file, replace(stretched(Tresca(0.7)), body_potential=qvi_contact.Polynomial([[0.0, 0.0, 0.1]])))
    status, out, err = shell("limit", file, "--load", "top", "--proof", tmp_path / "none.json")
    assert (status, "no stress of the body carries more" in out, " body_potential: " in err) == (2, True, True)
    status, out, _ = shell("check-proof", proof)
    assert (status, "\nproved: no stress carries the loads times more than 1.4" in out) == (0, True)
    proof.write_text(json.dumps(changed(json.loads(proof.read_text()), ("stress", "ordinates", 0, 0, 0), "1/7")))
    status, out, _ = shell("check-proof", proof)
    assert (status, out[:10]) == (1, "not proved")
    assert "not a regular file" in shell("check-proof", os.devnull)[2]
    twice = '{"format": 2, "flow": 1, "flow": 2}', "an entry twice"
    for other, said in [twice, ('{"format": 2}', "neither stresses nor velocities")]:
        proof.write_text(other)
        assert said in shell("check-proof", proof)[1]
    for other, said in [('{"degree": 4}', "KeyError 'format'"), ("[" * 100_000, "recursion"), ("", "Expecting value")]:
        proof.write_text(other)
        status, out, err = shell("check-proof", proof)
        assert (status, out, err.count("\n"), said in err) == (2, "", 1, True)


def block_on_the_ground(live, velocity, cohesion="1"):
    """Two triangles on a smooth ground, under a dead and a live vertical load, that move, and without any stress."""
    none, load = [[0, 0], [0, 0]], [[-live, -live], [live, live]]
    ground = {"name": "ground", "edges": [[0, 1]], "law": "unilateral", "friction": 0, "cohesion": 0}
    plate = {"shear_limit": None, "pressures": [[0, 0]], "forces": [None] * 3, "pivot": [0, 0]}
    return {
        "format": 2, "vertices": [[0, 0], [1, 0], [1, 1], [0, 1]], "triangles": [[0, 1, 2], [0, 2, 3]],
        "body_force": [[0, 0], [0, 0]], "contacts": [ground | plate],
        "strengths": [[[cohesion, 0, 0]]], "strength_of": [0, 0],
        "loads": [{"edge": edge, "along": [[[1, 0], none], [[0, 1], load if edge == [3, 2] else none]]}
                  for edge in ([3, 2], [0, 3], [1, 2])],
        "flow": {"degree": 1, "ordinates": [[velocity] * 3] * 2, "rates": [[[[0, 0, 0, 0]]]] * 2,
                 "plates": {"ground": [0, 0, 0]}},
        "stress": {"factor": 1, "degree": 1, "ordinates": [[[0, 0, 0]] * 3] * 2},
    }  # fmt: skip


@pytest.mark.parametrize("cohesion", ["1", "0"])
def test_a_block_lifts_off_the_ground_but_does_not_sink_into_it(cohesion):
    """Up to an uplift of its weight it is carried, if only by stresses in the tips of their cones; down at any load."""
    lower, upper, counted = check(block_on_the_ground(1, [0, "1/1000"], cohesion))
    assert (lower, upper) == (1, 1)
    in_parts, along_edges = ("stresses in cones", "strain rates"), ("edges with tractions", "edges with velocities")
    assert [counted[each] for each in (*in_parts, *along_edges, "loads carried")] == [6, 2, 5, 5, 6]
    held = block_on_the_ground(1, [0, 0], cohesion)
    del held["flow"], held["loads"][2]  # a support that nobody names is counted
    assert check(held)[2]["held edges with tractions"] == 1 > counted["held edges with tractions"] == 0
    with pytest.raises(ValueError, match="ground"):
        check(block_on_the_ground(-1, [0, "-1/1000"], cohesion))


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [(("format",), 1, "write it once more"), (("strengths", 0, 0, 2), "-1", "negative γ²"),
     (("strengths", 0, 0, 0), float("nan"), "NaN"), (("contacts", 0, "cohesion"), "nan", "Fraction: 'nan'"),
     (("contacts", 0, "law"), "glued", "unknown law"), (("loads", 1, "along", 0, 0), [0, 0], "right angle"),
     (("loads", 1, "along", 0, 0), [0, 0, 1], "two coordinates"), (("loads", 1, "along"), [], "right angle"),
     (("strength_of",), [-1, 0], "negative number"), (("stress", "degree"), 10**30, "ordinates of its degree"),
     (("strength_of",), [0], "as triangles"), (("vertices", 0), [0, 0, 0], "two coordinates"),
     (("triangles",), [], "no triangles"), (("loads", 1, "along", 0, 1, 0), ["0"] * 3, "not as many ordinates")],
)  # fmt: skip
def test_what_is_no_statement_is_refused(place, value, told):
    proof = block_on_the_ground(1, [0, "1/1000"])
    reduce(getitem, place[:-1], proof)[place[-1]] = value
    with pytest.raises(ValueError, match=told):
        check(proof)


@pytest.mark.parametrize("moved", [(1, 0), (-1, "1e-9"), (0, 0), ("1/3", "1/5")])
def test_two_layers_are_no_plane_body(moved):
    """Of two blocks in one place each carries all of the load; side by side each has its own."""
    proof, (right, up) = block_on_the_ground(1, [0, 0]), map(Fraction, moved)
    proof["vertices"] += [[x + right, y + up] for x, y in proof["vertices"]]
    proof["triangles"] += [[n + 4 for n in names] for names in proof["triangles"]]
    proof |= {"strength_of": [0] * 4, "stress": proof["stress"] | {"ordinates": [[[0, 0, 0]] * 3] * 4}}
    del proof["flow"]
    with nullcontext() if abs(right) == 1 else pytest.raises(ValueError, match="triangles overlap"):
        check(proof)


def test_numbers_are_exact_and_factors_are_rounded_to_the_safe_side():
    """Divided as they are, 2^53 + 1 is 2^53. As a float, a load of 1e-400 that holds a lifted block down is none."""
    proof = block_on_the_ground(1, [0, 1])
    del proof["stress"]
    proof["loads"][0]["along"][1][1] = [[1, 1], ["live", "live"]]
    lifted = json.dumps(proof).replace('"live"', "-1e-400")
    assert check_proof.told(lifted.encode()) == ("not proved: the flow has no power of the loads", 1)
    proof["loads"][0]["along"][1][1] = [[-1 - 2**53] * 2, [3, 3]]
    lower, upper, _ = check(proof)
    assert (lower, upper) == (None, Fraction(1 + 2**53, 3))
    assert sentences(Fraction(2, 3), Fraction(2, 3))[0].endswith(" 0.666666666666 are carried")
    assert sentences(None, Fraction(2, 3))[0].endswith(" 0.666666666667")


def test_a_strain_rate_must_lie_in_its_cone():
    """Stretched upwards by 1/1000, a block must give way in volume, too: with γ = 1 it may, with γ = 0 it cannot."""
    proof = block_on_the_ground(1, [0, 0])
    up, held = [0, "1/1000"], [0, 0]
    proof["flow"] |= {"ordinates": [[held, held, up], [held, up, up]], "rates": [[[["1/500", 0, 0, 0]]]] * 2}
    assert check(proof | {"strengths": [[[1, 0, 1]]]})[1] == 2
    shares = [["1/500", 0, 0, 0], ["0", "1/1000", 0, 0]]  # a part that no cone has would cost nothing
    for wrong in ([[1, 0, 0]], [[1, 0, "1/4"]], [[1, 0, 1]] * 2):
        proof["flow"]["rates"] = [[shares[: len(wrong)]]] * 2
        with pytest.raises(ValueError, match="triangle 0 cannot flow"):
            check(proof | {"strengths": [wrong]})
