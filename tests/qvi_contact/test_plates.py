"""Rigid plates driven by force and moment: the same states as with the displacements that cause them."""

from dataclasses import replace

import numpy as np
import pytest

from qvi_contact import InputError, TriangleMesh, solve
from qvi_contact.command import result_lines
from qvi_contact.discretization import discretize
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from qvi_contact.units import Units
from solvers import Status, certify
from tests.cases import every_pair, refused_at, thinned
from tests.qvi_contact.builders import difference, solved

STEEL = Material(1000.0, 0.3)
X, Y = np.array([0.0, 0.3, 0.8, 1.5, 2.0]), np.array([0.0, 0.4, 0.7, 1.0])
MESH = TriangleMesh.grid(X, Y)
FREE = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
HELD = [Displacement("bottom", x=0.0, y=0.0), *FREE]


def moved(contact, x=0.0, y=0.0, rotation=0.0, pivot=(0.0, 0.0), sign=1.0, normal="y"):
    """The contact whose obstacle has made a rigid motion, for a side with outward normal ± e_x or e_y."""

    def along_x(px, py):
        return x - rotation * (py - pivot[1]) + 0 * px

    def along_y(px, py):
        return y + rotation * (px - pivot[0]) + 0 * py

    across, along = (along_y, along_x) if normal == "y" else (along_x, along_y)
    gap, offset = ((value if callable(value) else lambda *_, v=value: v) for value in (contact.gap, contact.offset))
    return replace(
        contact,
        plate=None,
        gap=lambda px, py: gap(px, py) + sign * across(px, py),
        offset=lambda px, py: offset(px, py) + along(px, py),
    )


SIDES = {
    "top": ("bottom", "left", "right", 1.0, "y"), "bottom": ("top", "left", "right", -1.0, "y"),
    "right": ("left", "bottom", "top", 1.0, "x"), "left": ("right", "bottom", "top", -1.0, "x"),
}  # fmt: skip

DRIVEN = {
    "normal": ("normal",), "both forces": ("force_x", "force_y"), "force and moment": ("normal", "moment"),
    "all": ("force_x", "force_y", "moment"),
}  # fmt: skip

CONTACTS = {
    "rough": {"friction": 0.4}, "curved": {"friction": 0.4, "gap": lambda x, y: 2e-4 * ((x - 1.0) ** 2 + y)},
    "cohesive and capped": {"friction": 0.3, "cohesion": 0.5, "shear_limit": 4.0},
    "tied": {"friction": 0.0, "law": "tied"}, "bilateral": {"friction": 0.2, "law": "bilateral"},
    "offset": {"friction": 0.4, "offset": lambda x, y: 1e-4 * (x - y), "gap": 2e-3},
}  # fmt: skip


def pushed(side, contact):
    """A body glued to the ground on the far side, a plate on this one."""
    far, first, second, *_ = SIDES[side]
    conditions = [Contact.tied(far, name="ground"), Traction(first, 0.0, 0.0), Traction(second, 0.0, 0.0), contact]
    return ContactProblem(MESH, STEEL, conditions)


@pytest.mark.parametrize(("law", "side", "driven"), thinned(every_pair(list(CONTACTS), list(SIDES), list(DRIVEN)), 4))
def test_force_and_displacement_give_one_state(law, side, driven):
    """Displacement → forces → plate with those forces → the same motion and the same stresses."""
    law, driven = CONTACTS[law], DRIVEN[driven]
    *_, sign, normal = SIDES[side]
    tangential, pivot = "x" if normal == "y" else "y", (0.7, -0.3)
    components = [f"force_{normal}" if name == "normal" else name for name in driven]
    motion = {"force_x": ("x", 0.0), "force_y": ("y", 0.0), "moment": ("rotation", 4e-4)}
    wanted = {f"force_{normal}": -8e-3 * sign, f"force_{tangential}": 5e-3, "moment": 4e-4}
    imposed = {motion[name][0]: wanted[name] for name in components}
    base = Contact(side, name="plate", **law)
    expected = solved(pushed(side, moved(base, **imposed, pivot=pivot, sign=sign, normal=normal)))
    force = expected.resultant("plate")
    about_pivot = force.moment - (pivot[0] * force.y - pivot[1] * force.x)
    given = {"force_x": force.x, "force_y": force.y, "moment": about_pivot}
    plate = RigidPlate(**{name: given[name] for name in components}, pivot=pivot)
    result = solved(pushed(side, replace(base, plate=plate)))
    assert difference(expected, result) < 1e-6
    found, names = result.plates["plate"], ("x", "y", "rotation")
    wanted = [imposed.get(name, 0.0) for name in names]
    assert [getattr(found, name) for name in names] == pytest.approx(wanted, rel=1e-5, abs=1e-8)
    assert sum("t (0.7, -0.3)" in line for line in result_lines(result, Units())) == 2  # motion at, moment about it
    ours, theirs = expected.contacts["plate"], result.contacts["plate"]
    if law.get("law") != "tied":  # gap and slip are relative to the plate as it is
        assert theirs.gap == pytest.approx(ours.gap, abs=1e-6)
        assert theirs.slip == pytest.approx(ours.slip, abs=1e-6)


def column(plate, friction=0.0, material=STEEL, scale=1.0):
    """A plate on a column that stands on a smooth ground; closed form: p = F/w, motion = F h/(E w)."""
    mesh = TriangleMesh.grid(scale * X, scale * Y)
    conditions = [
        Symmetry("left"), Symmetry("bottom"), Traction("right", 0.0, 0.0),
        Contact("top", friction, plate=plate, name="plate"),
    ]  # fmt: skip
    return ContactProblem(mesh, material, conditions)


class TestColumn:
    """A column under a plate, known in closed form."""

    @pytest.mark.parametrize("moment", [3.0, -60.0])
    def test_rotation_under_an_eccentric_force(self, moment):
        """On a bilateral plate: bending by M about the middle, slope 12 M h/(E w³) of the straight column."""
        mesh = TriangleMesh.grid(X - 1.0, Y)
        plate = Contact("top", 0.0, law="bilateral", plate=RigidPlate(force_y=-30.0, moment=moment), name="plate")
        result = solved(ContactProblem(mesh, STEEL, [Symmetry("bottom"), *FREE, plate]))
        motion = result.plates["plate"]
        assert motion.y == pytest.approx(-0.015, rel=1e-8)
        assert motion.rotation == pytest.approx(12.0 * moment / (1000.0 * 2.0**3), rel=1e-8)
        turned = replace(plate, plate=RigidPlate(y=motion.y, rotation=motion.rotation))
        turned = solved(replace(result.problem, conditions=[Symmetry("bottom"), *FREE, turned]))
        remarks = [" ".join(each.remarks) for each in (result, turned)]
        assert ["turns by 0.09 rad" in each for each in remarks] == 2 * [moment < 0.0]
        assert ["may tip over" in each for each in remarks] == [moment < 0.0, False]  # a given rotation is none
        line = result.contacts["plate"]
        assert line.normal_stress == pytest.approx(-15.0 + 12.0 * moment / 8.0 * line.x, rel=1e-7)

    @pytest.mark.parametrize(("scale", "stress"), [(1e-3, 1e9), (1e4, 1e-5)])
    def test_other_units(self, scale, stress):
        """A point between stick and slip has the traction only to what the gap leaves, so it is asked to be small."""
        force = RigidPlate(force_y=-30.0, moment=-29.0, pivot=(0.1, 0.2))
        expected = solved(column(force, 0.2), gap=1e-18)
        other = RigidPlate(
            force_y=-30.0 * scale * stress, moment=-29.0 * scale**2 * stress, pivot=(0.1 * scale, 0.2 * scale)
        )
        result = solved(column(other, 0.2, Material(1000.0 * stress, 0.3), scale), gap=1e-18)
        ours, theirs = expected.plates["plate"], result.plates["plate"]
        assert theirs.y / scale == pytest.approx(ours.y, rel=1e-6)
        assert theirs.rotation == pytest.approx(ours.rotation, rel=1e-6)
        line = result.contacts["plate"].tangential_stress / stress
        assert line == pytest.approx(expected.contacts["plate"].tangential_stress, abs=1e-9)


class TestRedundantResultants:
    """Between two plates, or a plate and loads, equilibrium gives some resultants anyway."""

    @staticmethod
    def between(plate, load=-5.0):
        base = Contact("bottom", 0.3, plate=plate, name="plate")
        return ContactProblem(MESH, STEEL, [base, Traction("top", 0.0, load), *FREE])

    def test_they_are_dropped_with_a_remark(self):
        free = solved(self.between(None))
        result = solved(self.between(RigidPlate(force_x=0.0, force_y=10.0, moment=10.0)))
        assert difference(free, result) < 1e-8
        for component, remark in zip(("force_x", "force_y", "moment"), result.remarks, strict=True):
            assert component in remark
            assert "'plate'" in remark
        assert (result.plates["plate"].x, result.plates["plate"].y, result.plates["plate"].rotation) == (0.0, 0.0, 0.0)

    @pytest.mark.parametrize(
        ("given", "field", "needed"),
        [({"force_y": 9.0}, "force_y", "10"), ({"force_x": 0.5}, "force_x", "-?[0-9.e-]+"),
         ({"force_y": 10.0, "moment": 11.0}, "moment", "10"),
         ({"moment": 0.0, "pivot": (1.0, 0.0)}, None, None),
         ({"moment": 1.0, "pivot": (1.0, 0.0)}, "moment", "-?[0-9.e-]+")],
    )  # fmt: skip
    def test_contradictions_name_what_is_needed(self, given, field, needed):
        problem = self.between(RigidPlate(**given))
        if field is None:
            solved(problem)
            return
        with pytest.raises(InputError, match=f"RigidPlate.{field}.*'plate'.*demands {needed}:"):
            solve(problem)

    def test_of_two_plates_one_gives_the_force_of_the_other(self):
        base, _, *free = self.between(RigidPlate(force_y=10.0)).conditions
        presses = [Contact("top", 0.3, plate=RigidPlate(force_y=force), name="press") for force in (-10.0, -9.0)]
        right, wrong = (ContactProblem(MESH, STEEL, [base, press, *free]) for press in presses)
        found = solved(right).bracket
        assert found.lower == pytest.approx(found.upper, rel=2e-3)
        with pytest.raises(InputError, match=r"RigidPlate.force_y.*'press'.*demands -10:"):
            solve(wrong)


class TestImpossible:
    """Forces that no contact carries end in a status with a reason."""

    def test_more_than_friction_carries_and_a_plate_that_pulls(self):
        assert solve(column(RigidPlate(force_x=1.0, force_y=-30.0))).status is Status.INFEASIBLE  # without friction
        assert solved(column(RigidPlate(force_x=8.0, force_y=-30.0), 0.3), tolerance=1e-8).plates["plate"].x > 0.0
        result = solve(column(RigidPlate(force_x=9.1, force_y=-30.0), 0.3))
        assert result.status is Status.INFEASIBLE
        assert result.mechanism.contacts["plate"].slides
        result = solve(column(RigidPlate(force_y=1.0), 0.3))
        assert result.status is Status.INFEASIBLE
        assert result.mechanism.contacts["plate"].opens

    @pytest.mark.parametrize("eccentricity", [-0.001, 2.001])
    def test_a_force_beside_the_body(self, eccentricity):
        result = solve(column(RigidPlate(force_y=-30.0, moment=-30.0 * eccentricity, pivot=(0.0, 1.0)), 0.3))
        assert result.status is Status.INFEASIBLE
        assert "off 'plate'" in result.message

    @pytest.mark.parametrize(
        ("given", "field"),
        [({}, "RigidPlate"), ({"force_x": float("nan")}, "RigidPlate.force_x"),
         ({"force_y": "10"}, "RigidPlate.force_y"), ({"moment": float("inf")}, "RigidPlate.moment"),
         *(({"x": 0.0, "pivot": pivot}, "RigidPlate.pivot") for pivot in ((1.0,), (1.0, np.nan), np.array(1.0), b"ab")),
         ({"force_x": 1.0, "x": 0.0}, "RigidPlate.force_x"),
         ({"moment": 1.0, "rotation": 1.0}, "RigidPlate.moment"), ({"y": float("nan")}, "RigidPlate.y")],
    )  # fmt: skip
    def test_bad_data(self, given, field):
        with refused_at(field):
            RigidPlate(**given)


@pytest.mark.parametrize("plate", [RigidPlate(force_x=0.0), RigidPlate(moment=0.0, pivot=(0.5, 1.0))])
def test_small_displacements_under_a_driven_plate_are_as_exact_as_large_ones(plate):
    """The law is positively homogeneous: forces over U, whatever the unit of stress."""

    def force(displacement):
        mesh = TriangleMesh.rectangle((3, 3))
        sides = [Symmetry("left"), Symmetry("bottom"), Traction("right", x=0.0, y=0.0)]
        top = Contact("top", 0.3, gap=-displacement, name="plate", plate=plate)
        return solved(ContactProblem(mesh, STEEL, [*sides, top])).contacts["plate"].normal_force / displacement

    expected = force(1e-3)
    for displacement in (1e-5, 1e-7, 1e-9):
        assert force(displacement) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("pivot", "shift", "tolerance"), [((0, 0), 1e3, 1e-7), ((1e5, 1e5), 0.0, 1e-7), ((1e7, 0), 0.0, 1e-6)]
)
def test_a_far_pivot_is_as_good_as_a_near_one(pivot, shift, tolerance):
    mesh = TriangleMesh.rectangle((4, 4), origin=(shift, shift))
    tilted = Contact("top", 0.3, gap=lambda x, y: -1e-3 - 2e-4 * (x - shift - 0.5) + 0 * y, offset=3e-4, name="plate")
    line = solved(ContactProblem(mesh, STEEL, [*HELD, tilted])).contacts["plate"]
    moments = (line.x - pivot[0]) * line.normal_stress - (line.y - pivot[1]) * line.tangential_stress
    driven = RigidPlate(line.tangential_force, -line.normal_force, float(line.weights @ moments), pivot)
    result = solved(ContactProblem(mesh, STEEL, [*HELD, Contact("top", 0.3, name="plate", plate=driven)]))
    size = np.abs(line.normal_stress).max()
    assert np.abs(result.contacts["plate"].normal_stress - line.normal_stress).max() < tolerance * size
    motion = result.plates["plate"]
    arm_x, arm_y = shift + 0.5 - pivot[0], shift + 1.0 - pivot[1]
    assert motion.rotation == pytest.approx(-2e-4, rel=1e-5)
    assert motion.x - motion.rotation * arm_y == pytest.approx(3e-4, abs=2e-7 + 1e-15 * abs(arm_y))
    assert motion.y + motion.rotation * arm_x == pytest.approx(-1e-3, abs=2e-7 + 1e-15 * abs(arm_x))


def test_a_small_force_counts_beside_a_large_one_and_so_does_a_wrong_motion():
    mesh = (
        TriangleMesh.rectangle((4, 3))
        .with_edges("one", lambda x, y: (x < 0.5) & (y == 1.0))
        .with_edges("other", lambda x, y: (x > 0.5) & (y == 1.0))
    )
    forces = {"one": -100.0, "other": -1e-4}
    plates = [Contact(name, 0.3, plate=RigidPlate(force_y=force)) for name, force in forces.items()]
    result = solved(ContactProblem(mesh, STEEL, [*HELD, *plates]))
    assert result.contacts["other"].normal_force == pytest.approx(1e-4, rel=1e-4)
    qvi, solution = result.solution.problem, result.solution
    changed = qvi.with_loads(b=qvi.b * np.array([1.0, 1.01]))
    state = solution.z, solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    assert not certify(changed, *state).passed
    assert not certify(qvi, *state[:3], state[3] * (1.0 + 1e-7)).passed  # a wrong motion


@pytest.mark.parametrize(
    ("law", "options", "said"),
    [("unilateral", {"gap": -1e-3}, True), ("unilateral", {"gap": 1e-3}, False), ("bilateral", {"gap": 1e-3}, True),
     ("tied", {"gap": 1e-3}, True), ("tied", {"offset": 1e-3}, True), ("tied", {}, False),
     ("unilateral", {"plate": RigidPlate(y=1e-3)}, True), ("unilateral", {"plate": RigidPlate(y=-1e-3)}, False),
     ("unilateral", {"plate": RigidPlate(rotation=1e-3)}, True),
     ("unilateral", {"plate": RigidPlate(force_y=1.0)}, False),
     ("unilateral", {"gap": -1e-3, "normal_stiffness": 10.0}, False)],
)  # fmt: skip
@pytest.mark.parametrize("tilt", [0.0, 1e-6])
def test_corners_of_a_support_and_an_obstacle_that_disagree(law, options, said, tilt):
    """Beside a support at rest, or in one line with it but for rounded coordinates."""
    mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0).with_edges("held", lambda x, y: (x < 1.0) & (y < 1e-6))
    mesh = mesh.with_edges("base", lambda x, y: (x > 1.0) & (y < 1e-6))
    x, y = mesh.vertices.T
    mesh = replace(mesh, vertices=np.column_stack([x, y + tilt * np.maximum(x - 1.0, 0.0)]))
    along = (Displacement if law == "tied" else Traction)("held", tangential=0.0)
    others = [Displacement("held", normal=0.0), along, Traction("top", 0.0, 0.0), *FREE]
    stated = ContactProblem(mesh, STEEL, [Contact("base", 0.0, law=law, **options), *others])
    assert any("(1, 0) a support and the obstacle of 'base'" in each for each in discretize(stated).remarks) is said


def test_a_support_in_the_corner_stops_a_plate_driven_by_force():
    """Exactly the plate and the body stay at rest: J = 0. The computed motion falls with the mesh, about as 1/ln h."""
    sides = [Displacement(side, x=0.0, y=0.0) for side in ("left", "right", "bottom")]
    for law in ("unilateral", "bilateral", "tied"):
        top = Contact("top", 0.0, law=law, plate=RigidPlate(force_y=-5.0))
        meshes = [TriangleMesh.rectangle((2 * n, n), 2.0, 1.0) for n in (2, 8)]
        coarse, fine = (solve(ContactProblem(mesh, STEEL, [top, *sides])) for mesh in meshes)
        assert any("(0, 1) a support stops the plate of 'top'" in each for each in fine.remarks)
        assert fine.bracket.lower < 0.0 <= fine.bracket.upper + 1e-9 * fine.bracket.strain
        assert 0.6 < fine.plates["top"].y / coarse.plates["top"].y < 0.9
