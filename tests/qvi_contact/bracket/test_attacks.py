"""Attempts to refute the bounds: other meshes, wrong stresses, odd data, every side, units, and places."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, RigidPlate, Traction, TriangleMesh, solve
from qvi_contact.bracket import Bracket, bracket
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
from qvi_contact.solution import ContactResult
from tests.cases import thinned
from tests.qvi_contact.builders import with_line

SIDES = {"bottom": "top", "top": "bottom", "left": "right", "right": "left"}
SOFT = Material(1e3, 0.3)
U = 1e-3
ROUNDING = 1e-9


def free(*sides):
    return [Traction(side, 0.0, 0.0) for side in sides]


def square(*conditions, cells=(4, 4), material=SOFT, potential=0.0):
    """A unit square; sides without a condition are free."""
    ruled = {condition.edges for condition in conditions}
    rest = [side for side in SIDES if side not in ruled]
    return ContactProblem(TriangleMesh.rectangle(cells), material, [*conditions, *free(*rest)], potential)


def pressed(bound, cells=(4, 4)):
    """The quarter plate of the gallery under a plate with a given friction bound."""
    plate = compressed_plate(0.0, cells)
    return replace(plate, conditions=[*plate.conditions[:3], Contact.tresca("top", bound, gap=-U, name="plate")])


def assert_consistent(first: Bracket, second: Bracket):
    """Two brackets of one energy overlap, as far as both claim to be bounds."""
    size = max(first.strain, *map(abs, (first.lower, first.upper, second.lower, second.upper)))
    for found in (first, second):
        assert found.lower <= found.upper + ROUNDING * size
    if first.guaranteed and second.guaranteed:
        assert first.lower <= second.upper + ROUNDING * size
        assert second.lower <= first.upper + ROUNDING * size


class TestDataBetweenPoints:
    """Data that do something between the points of an edge where they are looked at."""

    LINES = (0.0, 0.4, 0.7, 0.85, 0.92, 0.95, 0.97, 0.985, 1.0)

    def test_bound_that_jumps_near_the_end_of_an_edge(self):
        problem = pressed(lambda x, _: np.where(x < 0.95, 4.0, 400.0), (1, 1))
        finer = solve(replace(problem, mesh=TriangleMesh.grid(self.LINES, self.LINES))).bracket
        assert finer.guaranteed
        assert_consistent(solve(problem).bracket, finer)

    def test_traction_on_a_strip_at_the_end_of_an_edge(self):
        load = Traction("top", 0.0, lambda x, _: np.where(x > 0.99, -100.0, -1.0))
        problem = square(Displacement("bottom", 0.0, 0.0), load, cells=(1, 2))
        finer = TriangleMesh.grid([0.0, 0.5, 0.9, 0.96, 0.98, 0.99, 1.0], self.LINES)
        companion = solve_companion(replace(problem, mesh=finer))
        assert not companion.reasons
        found = solve(problem).bracket
        assert found.lower > companion.energy  # what may not be claimed to be a bound
        assert not found.guaranteed


class TestForces:
    """Bounds of forces: sign, component and place."""

    def check(self, problem, key):
        """The force of a finer mesh lies between the bounds, and those of the own mesh are one of them."""
        result, finer = solve(problem), solve(replace(problem, mesh=problem.mesh.refined().refined()))
        found = result.bracket
        assert set(found.driven) == {key}
        (low, high), (name, kind) = found.driven[key], key.rsplit(".", 1)
        at = [each.contacts[name] if name in each.contacts else each.resultant(name) for each in (result, finer)]
        own, fine = (getattr(each, kind) for each in at)
        size = max(abs(low), abs(high))
        assert size > 0.0
        assert low - ROUNDING * size <= fine <= high + ROUNDING * size
        assert min(abs(own - end) for end in (low, high)) <= 1e-6 * size

    @pytest.mark.parametrize(
        ("side", "sign"), thinned([*((side, -1.0) for side in SIDES), ("bottom", 1.0), ("right", 1.0)], 2)
    )
    def test_each_side(self, side, sign):
        held = Displacement(SIDES[side], 0.0, 0.0)
        (normal, across), cells = "xy" if side in ("left", "right") else "yx", (2, 2)
        self.check(square(held, Contact.tied(side, gap=sign * U), cells=cells), f"{side}.normal_force")
        self.check(square(held, Contact.tied(side, offset=sign * U), cells=cells), f"{side}.tangential_force")
        for moved in (normal, across):
            values = {normal: 0.0, across: 0.0, moved: sign * U}
            self.check(square(held, Displacement(side, **values), cells=cells), f"{side}.{moved}")
        if sign < 0.0:
            self.check(square(held, Contact.frictionless(side, gap=-U), cells=cells), f"{side}.normal_force")

    @pytest.mark.parametrize("axis", ["horizontal", "vertical"])
    def test_joint(self, axis):
        ends = ("bottom", "top") if axis == "horizontal" else ("left", "right")
        mesh = with_line(TriangleMesh.rectangle((2, 2)), "joint", axis, 0.5)
        outer = [Displacement(end, 0.0, 0.0) for end in ends]
        outer += free(*(side for side in SIDES if side not in ends))
        joints = [Contact.frictionless("joint", gap=-U), Contact.tied("joint", gap=U), Contact.tied("joint", offset=U)]
        for joint, kind in zip(joints, ("normal_force", "normal_force", "tangential_force"), strict=True):
            self.check(ContactProblem(mesh, SOFT, [*outer, joint]), f"joint.{kind}")

    def test_none_beside_other_data(self):
        turned, gap = {"plate": RigidPlate(moment=1e-2, pivot=(0.5, 1.0))}, {"gap": lambda x, _: -U + 0.0 * x}
        for other in ({"offset": 1e-4, "friction": 5.0}, turned, gap, {"cohesion": 0.2}):
            contact = Contact("top", **{"friction": 0.0, "gap": -U, **other})
            assert solve(square(Displacement("bottom", 0.0, 0.0), contact)).bracket.driven == {}


@pytest.mark.parametrize("kind", ["driven", "tied"])
def test_stresses_that_solve_nothing(kind):
    """Of noise in all unknowns: equilibrium is kept, and bounds hold as well, or are not called guaranteed."""
    problem = square(Contact.tied("bottom"), Contact.tied("top", gap=U), Contact.tresca("left", 0.1))
    if kind == "driven":
        plate = replace(Contact.tresca("top", 20.0, name="plate"), plate=RigidPlate(force_y=-200.0, moment=-30.0))
        problem = compressed_plate(0.0, (4, 4))
        problem = replace(problem, conditions=[*problem.conditions[:3], plate])
    result = solve(problem)
    right = result.bracket
    assert right.guaranteed
    z = result.solution.z
    noise = np.abs(z).max() * np.random.default_rng(0).standard_normal(len(z))
    wrong = ContactResult(result.discretization, replace(result.solution, z=z + noise))
    assert_consistent(bracket(wrong), right)


def test_bounds_that_contradict_each_other_bound_no_error():
    """A lower bound above the upper one, as wrong data give, does not mean that the stress is exact."""
    found = solve(pressed(10.0, (2, 2))).bracket
    assert found.relative_error > 0.0
    crossed = replace(found, lower=found.upper + found.strain)
    assert crossed.relative_error > found.relative_error
    assert "gap larger" not in crossed.message
