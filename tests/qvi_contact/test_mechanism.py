"""Mechanisms: what rigid blocks prove of loads, on any mesh, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from qvi_contact import TriangleMesh, limit_load_factor, solve
from qvi_contact.gallery import jointed_slope
from qvi_contact.limit import multiplied
from qvi_contact.mechanism import find_mechanism, upper_bound
from qvi_contact.problem import Contact, ContactProblem, Displacement, Material, RigidPlate, Symmetry, Traction
from solvers import Status
from tests.cases import examples
from tests.qvi_contact.test_triangles import oblique

STEEL = Material(1000.0, 0.3)
EXACT = 1e-9


def wall(mesh, wind=6.25):
    """A wall 1 × 4 of the weight 25, blown from the left: it tips at 6.25."""
    bottom = mesh.origin[1]
    weight = lambda _, y: 25.0 / 4.0 * (y - bottom)  # noqa: E731
    loads = [Traction("left", wind / 4.0, 0.0, name="wind"), *(Traction(s, 0.0, 0.0) for s in ("top", "right"))]
    return ContactProblem(mesh, STEEL, [Contact("bottom", 1.0, name="base"), *loads], body_potential=weight)


WALLS = {
    "one cell": TriangleMesh.rectangle((1, 1), 1.0, 4.0),
    "rectangles": TriangleMesh.rectangle((4, 8), 1.0, 4.0),
    "graded": TriangleMesh.rectangle((8, 4), 1.0, 4.0, grading=0.3),
    "far away": TriangleMesh.rectangle((4, 8), 1.0, 4.0, origin=(1e4, -1e4)),
    "bisected": TriangleMesh.rectangle((1, 2), 1.0, 4.0).graded([[1.0, 0.0]], 20),
}
LYING = TriangleMesh.rectangle((3, 2), 2.0, 1.0)


class TestTippingWall:
    """W w/2 = H h/2."""

    @pytest.mark.parametrize("mesh", WALLS)
    def test_who_is_told_what(self, mesh):
        """Nothing is claimed below the limit or on it, everything above."""
        for share in (1.0 - 1e-9, 1.0):
            assert find_mechanism(wall(WALLS[mesh], 6.25 * share)) is None
        for share, unit in ((1.0 + 1e-6, 1.0), (40.0, 1e-9)):
            found = find_mechanism(multiplied(wall(WALLS[mesh], 6.25 * share), ["wind", "body"], unit))
            assert found.overload == pytest.approx(share, rel=EXACT)
            assert abs(found.motions[0].rotation) == pytest.approx(1.0 / math.hypot(1.0, 4.0))  # the top moves by 1
            assert found.work == pytest.approx(sum(found.works.values()))
            assert found.work > found.resistance >= 0.0

    @pytest.mark.parametrize("mesh", ["one cell", "rectangles"])
    def test_solving_near_the_limit(self, mesh, monkeypatch):
        """0.9 of the load is beyond these meshes, but nobody says that it is beyond the wall."""
        asked = []
        counted = lambda each: asked.append(each) or find_mechanism(each)  # noqa: E731
        monkeypatch.setattr("qvi_contact.mechanism.find_mechanism", counted)
        below, above = (solve(wall(WALLS[mesh], 6.25 * share)) for share in (0.9, 1.1))
        assert below.status is Status.INFEASIBLE_ON_MESH
        assert (below.mechanism, below.has_state) == (None, False)
        assert above.status is Status.INFEASIBLE
        assert above.mechanism.overload == pytest.approx(1.1, rel=EXACT)
        assert above.mechanism.contacts["base"].opens
        assert asked == [below.problem, above.problem]  # once each: a second time it could miss the deadline
        plate = replace(Contact.tied("top"), plate=RigidPlate(force_x=0.0, force_y=0.0, moment=0.0))
        base, wind, top, right = below.problem.conditions
        for each in (top, plate):  # of a load that is zero: no multiple helps this mesh
            other = limit_load_factor(replace(below.problem, conditions=[base, wind, each, right]), ["right"])
            assert (other.lower, other.upper) == (-math.inf, math.inf)


def test_what_tips_whatever_the_friction_is_not_said_to_slide():
    """Nothing resists, so that motions with slip prove as much: a block that leans, a plate pushed beside a block."""
    mesh = TriangleMesh.rectangle((2, 4), 1.0, 2.0)
    sides = [Traction(side, 0.0, 0.0) for side in ("left", "right")]
    leaning = [Contact("bottom", 1.0), Traction("top", 0.0, 0.0), *sides]
    assert "tips" in find_mechanism(ContactProblem(mesh, STEEL, leaning, lambda x, y: y - 1.2 * x)).reason
    plate = RigidPlate(force_x=0.0, force_y=-10.0, moment=-5.1, pivot=(0.5, 2.0))
    pushed = [Contact("top", 0.0, plate=plate), Displacement("bottom", 0.0, 0.0), *sides]
    message = solve(ContactProblem(mesh, STEEL, pushed)).message
    assert ("tips" in message, "else takes up, however small" in message) == (True, True)


def dragged(contact, pressure=10.0, shear=1.0, mesh=LYING, material=STEEL):
    """A block under a pressure and uniform shear, with the complementary shear on its sides: σ_T = −T, σ_N = −p."""
    weight = (lambda x, _: -pressure(x)) if callable(pressure) else -pressure
    given = [Traction("top", y=weight), *(Traction(side, x=0.0) for side in ("left", "right"))]
    shears = ("top", {"x": shear}), ("right", {"y": shear}), ("left", {"y": -shear})
    given += [Traction(side, name="shear", **along) for side, along in shears]
    return ContactProblem(mesh, material, [contact, *given])


class TestLaws:
    """Bounds of the shear on the base of a block."""

    @pytest.mark.parametrize(
        ("law", "expected"),
        [
            ({"friction": 1e-4}, 1e-3),
            ({"friction": 0.0}, 0.0),
            ({"friction": 0.3, "cohesion": 1.5}, 4.5),
            ({"friction": 0.3, "cohesion": 1.5, "shear_limit": 4.0}, 4.0),
            ({"friction": 0.3, "cohesion": 1.5, "shear_limit": 1.0}, 1.0),
            ({"friction": 0.0, "cohesion": 2.0, "shear_limit": 4.0}, 2.0),
            ({"friction": 0.0, "cohesion": lambda x, _: 1.0 + x**2}, 1.0 + 4.0 / 3.0),
            ({"friction": 0.3, "law": "bilateral"}, np.inf),
            ({"friction": 0.3, "law": "bilateral", "shear_limit": 5.0}, 5.0),
            ({"friction": 0.0, "cohesion": 2.0, "law": "bilateral"}, 2.0),
            ({"friction": 0.0, "law": "tied"}, np.inf),
            ({"friction": lambda x, _: 0.2 + 0.1 * x}, 3.0),  # N and its moment are given: ∫ μp is
        ],
    )
    def test_limit(self, law, expected):
        upper, mechanism = upper_bound(dragged(Contact("bottom", **law)), ["shear"])
        assert upper == pytest.approx(expected, rel=EXACT, abs=EXACT)
        assert (mechanism is None) == np.isinf(upper)
        assert not 1e-9 < upper < 1e9 or find_mechanism(dragged(Contact("bottom", **law), shear=1.000001 * upper))

    def test_two_blocks_on_one_contact_share_its_cohesion(self):
        mesh = LYING.with_joint("seam", lambda x, _: np.isclose(x, 2.0 / 3.0))
        whole = dragged(Contact.tresca("bottom", 0.3), mesh=mesh)
        parted = replace(whole, conditions=[*whole.conditions, Contact("seam", 0.0)])
        assert upper_bound(parted, ["shear"])[0] == pytest.approx(0.3, rel=EXACT)

    def test_a_cap_under_an_eccentric_load(self):
        """N = 3 t at 2/3: p = t/μ on a length b and the rest in the corner, T = t b = √(2 N d μ t)."""
        for share in (0.9999, 1.0001, 2.0):
            t = share * math.sqrt(2.0)
            problem = dragged(Contact("bottom", 0.5, shear_limit=t), pressure=lambda x, t=t: t * (3.0 - 1.5 * x))
            assert upper_bound(problem, ["shear"])[0] == pytest.approx(share, rel=EXACT)
            assert (find_mechanism(problem) is None) == (share > 1.0)

    @pytest.mark.parametrize(
        "capped", [{}, {"shear_limit": 4.0}, {"shear_limit": lambda x, _: 5.0 - x, "cohesion": 1.0}]
    )
    @pytest.mark.parametrize("friction", [0.5, lambda x, _: 0.3 + 0.1 * x * (2.0 - x)])
    def test_an_arc_that_hardly_bends_has_the_limit_of_a_straight_line(self, friction, capped):
        """It is never below, and close to it."""
        straight, radius = dragged(Contact("bottom", friction, **capped), pressure=lambda x: 12.0 - 6.0 * x), 1e5
        x, y = straight.mesh.vertices.T
        rise = np.where(y == 0.0, np.sqrt(radius**2 - (x - 1.0) ** 2) - radius, y)
        bent = replace(straight.mesh, vertices=np.column_stack([x, rise])).with_arc("bottom", (1.0, -radius), radius)
        one, other = (upper_bound(each, ["shear"])[0] for each in (straight, replace(straight, mesh=bent)))
        assert one * (1.0 - 1e-4) <= other <= 1.03 * one

    def test_friction_that_jumps_or_bends(self):
        """Never below the limit, and close to it."""
        step = upper_bound(dragged(Contact("bottom", lambda x, _: np.where(x < 1.2, 0.1, 0.3))), ["shear"])[0]
        limit = 10.0 * (0.1 + 0.2 / 1.2)  # pressed at 0 and just beyond the step
        assert limit * (1.0 - EXACT) <= step <= 1.02 * limit
        bent = upper_bound(dragged(Contact("bottom", lambda x, _: 0.3 + 0.1 * x * (2.0 - x))), ["shear"])[0]
        assert 4.0 * (1.0 - EXACT) <= bent <= 4.01  # all pressure in the middle


class TestSupportsAndPlates:
    """What may move with the blocks, and what may not."""

    def test_symmetry_guides(self):
        """Lifted at its weight; sideways the line of symmetry holds."""
        loads = [Traction("top", x=0.0, y=1.0, name="crane"), Traction("right", -50.0, 0.0, name="side")]
        conditions = [Contact("bottom", 0.0, name="floor"), Symmetry("left"), *loads]
        problem = ContactProblem(LYING, STEEL, conditions, body_potential=lambda _, y: 7.0 * y)
        assert upper_bound(problem, ["crane"])[0] == pytest.approx(7.0, rel=EXACT)
        assert upper_bound(problem, ["side"]) == (np.inf, None)
        pulled = replace(problem, conditions=[*conditions[:-1], Traction("right", 1.0, 0.0, name="side")])
        assert upper_bound(pulled, ["side"]) == (np.inf, None)

    @pytest.mark.parametrize("degrees", [0.0, 17.0, 70.0])
    def test_rounding_of_far_coordinates_bends_no_line_of_symmetry(self, degrees):
        """A bar pulled along such a line by p w slides where the cohesion c on its other side h gives way."""
        mesh = oblique(TriangleMesh.rectangle((1, 4), 1.0, 4.0, origin=(1e5, -1e5)), degrees)
        pulled = [Traction("top", normal=1.0, tangential=0.0), Traction("bottom", normal=0.0, tangential=0.0)]
        problem = ContactProblem(mesh, STEEL, [Symmetry("left"), Contact.tresca("right", 0.5), *pulled])
        assert upper_bound(problem, ["top"])[0] == pytest.approx(0.5 * 4.0 / 1.0, rel=EXACT)

    @pytest.mark.parametrize("given", [0.5, 20.0])
    def test_a_ram_pushes(self, given):
        """μ times the pressure, whatever the mesh; the plate moves with the block."""
        ram = Contact("left", 0.0, law="bilateral", plate=RigidPlate(force_x=given), name="ram")
        loads = [Traction("top", 0.0, -10.0), Traction("right", 0.0, 0.0)]
        mesh = TriangleMesh.rectangle((2, 1), 2.0, 1.0)
        upper, mechanism = upper_bound(ContactProblem(mesh, STEEL, [Contact("bottom", 0.3), ram, *loads]), ["ram"])
        assert given * upper == pytest.approx(6.0, rel=EXACT)
        assert mechanism.plates["ram"].x == pytest.approx(mechanism.motions[0].x)


@st.composite
def stacks(draw):
    """Blocks on each other, of random widths and weights, friction, cohesion and caps, pushed and pulled anywhere."""
    count = draw(st.integers(1, 3))
    number = st.floats(0.1, 2.0)
    heights = np.concatenate([[0.0], np.cumsum([draw(number) for _ in range(count)])])
    mesh = TriangleMesh.grid(np.array([0.0, draw(number), 2.5]), heights)
    contacts = []
    for level in range(count):
        law = {"friction": draw(st.sampled_from([0.0, 0.2, 0.7, 2.0]))}
        law["cohesion"] = draw(st.sampled_from([0.0, 0.0, 1.0]))
        law["shear_limit"] = draw(st.sampled_from([None, None, 1.5]))
        if level:
            mesh = mesh.with_joint(f"joint {level}", lambda _, y, at=heights[level]: np.isclose(y, at))
        contacts.append(Contact(f"joint {level}" if level else "bottom", **law))
    push, pull, weight = (draw(st.integers(-20, 30)) / 10.0 for _ in range(3))
    loads = [Traction("left", push, 0.0, name="push"), Traction("right", 0.0, pull, name="pull")]
    top = Traction("top", 0.0, lambda x, _: -5.0 - weight * x, name="top")
    return ContactProblem(mesh, STEEL, [*contacts, *loads, top], body_potential=lambda _, y: 1.0 * y)


@settings(
    max_examples=examples(4), deadline=None, derandomize=True, phases=(Phase.generate,),
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
@given(stacks(), st.sampled_from([None, 3, 4]))
def test_no_mesh_carries_more_than_the_mechanism_allows(problem, degree):
    limit = limit_load_factor(problem, ["push", "pull"], degree=degree)
    assert limit.lower <= limit.upper
    again = upper_bound(problem, ["push", "pull"])[0]
    assert again == pytest.approx(limit.upper, rel=EXACT, abs=EXACT)
    if np.isfinite(limit.upper) and limit.upper > 1e-3:
        loads = (multiplied(problem, ["push", "pull"], share * limit.upper) for share in (0.999, 1.001))
        below, above = map(find_mechanism, loads)
        assert below is None or limit.lower == -np.inf
        assert above is not None


class TestJumpsInsideEdges:
    """Cohesion and cap that jump or bend where the mesh has no vertex: what is proved holds on meshes that have one."""

    @staticmethod
    def pushed(contact, at, push=1.0):
        """A block 1 × 1 under the pressure 1, its mesh divided at x = at, pushed from the left."""
        mesh = TriangleMesh.grid(np.array([0.0, at, 1.0]), np.array([0.0, 1.0]))
        loads = [Traction("left", push, 0.0, name="push"), Traction("right", 0.0, 0.0), Traction("top", 0.0, -1.0)]
        return ContactProblem(mesh, STEEL, [contact, *loads])

    @pytest.mark.parametrize("at", [0.3, 0.77])
    @pytest.mark.parametrize(
        ("cohesion", "carried"),
        [(lambda x, _: np.where(x < 0.37, 1.0, 0.0), 0.37), (lambda x, _: np.where(x < 0.37, 0.0, 1.0), 0.63),
         (lambda x, _: np.abs(x - 0.37), (0.37**2 + 0.63**2) / 2.0)],
    )  # fmt: skip
    def test_no_less_than_the_integral(self, cohesion, carried, at):
        upper, _ = upper_bound(self.pushed(Contact.tresca("bottom", cohesion), at), ["push"])
        assert carried * (1.0 - EXACT) <= upper <= 1.02 * carried

    def test_what_is_carried_is_not_called_impossible(self):
        contact = Contact.tresca("bottom", lambda x, _: np.where(x < 0.37, 1.0, 0.0))
        assert find_mechanism(self.pushed(contact, 0.999, 0.365)) is None
        stripes = Contact.tresca("bottom", lambda x, _: np.floor(2000.0 * x) % 2.0)  # finer than parts of an edge
        assert find_mechanism(self.pushed(stripes, 0.3, 0.4999)) is None
        assert solve(self.pushed(contact, 0.37, 0.365), degree=5).status is Status.SOLVED

    @pytest.mark.parametrize(
        ("cohesion", "cap", "most"),
        [(lambda x, _: np.where(x < 0.37, 0.0, 0.5), 0.6, 1.02), (lambda x, _: np.abs(x - 0.37), 0.9, 1.0001)],
    )
    def test_what_slip_saves_by_dilating_is_not_overrated(self, cohesion, cap, most):
        """A cap over a cohesion that jumps, or bends: a mesh with a vertex there has the sharper bound, if it jumps."""
        contact = Contact("bottom", 0.4, cohesion=cohesion, shear_limit=cap)
        sharp, _ = upper_bound(self.pushed(contact, 0.37), ["push"])
        upper, _ = upper_bound(self.pushed(contact, 0.77), ["push"])
        assert sharp * (1.0 - EXACT) <= upper <= most * sharp


def test_what_is_beyond_the_limit_is_not_solved():
    """Bernstein rows of a friction that grows along the contact carry more than it does: 0.294 is the limit."""
    for share in (0.986, 1.0 + 1e-5, 1.01, 1.05):
        loads = [Traction("left", share * 0.2941176470588236, 0.0), Traction("right", 0.0, 0.0)]
        conditions = [Contact("bottom", lambda x, _: 0.1 + 0.3 * x), *loads, Traction("top", 0.0, -1.0)]
        problem = ContactProblem(TriangleMesh.rectangle((1, 1)), STEEL, conditions)
        result = solve(problem, degree=3, law_on="edges")
        assert result.status is (Status.SOLVED if share < 1.0 else Status.INFEASIBLE)
        assert result.solution.certificate.passed
        assert share > 1.0 or result.contacts["bottom"].excess_between_points > 0.01


@pytest.mark.parametrize("beyond", [1e-2, 1e-6, 1e-8, 0.0, -1e-2])
def test_the_friction_that_locks(beyond):
    """Pushed at 45° a block of weight 1 slides where α > μ (1 + α), however close to 1 its friction is."""
    mu = 1.0 - beyond
    loads = [Traction("top", 1.0, -1.0, name="push"), Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    body = TriangleMesh.rectangle((1, 1), 2.0, 1.0)
    problem = ContactProblem(body, STEEL, [Contact("bottom", mu), *loads], body_potential=lambda _, y: y)
    factor, mechanism = upper_bound(problem, ["push"])
    if beyond < 1e-7:
        assert (factor, mechanism) == (math.inf, None)
    else:
        assert factor == pytest.approx(mu / beyond, rel=1e-9)
        assert mechanism.contacts["bottom"].slides


def test_just_too_little_friction_carries_no_multiple():
    """Blocks above slide by their weight: the mesh's program alone could not tell 1e-6 from rounding."""
    limit = limit_load_factor(jointed_slope(2, 1, friction=math.tan(math.radians(30.0)) * (1.0 - 1e-6)), ["water"])
    assert (limit.lower, limit.bound, limit.upper) == (-math.inf,) * 3
    assert limit.mechanism.work > 0.0


@pytest.mark.parametrize("angle", [0.3, 0.7, 1.234])
def test_a_plate_that_moves_alone(angle):
    """A plate glued to a body that is held slides at its cohesion; the body's motion is rounding, not 1."""
    mesh = oblique(TriangleMesh.rectangle((2, 2)), np.degrees(angle))
    plate = RigidPlate(force_x=np.cos(angle), force_y=np.sin(angle))
    conditions = [
        Contact("top", 0.0, cohesion=0.7, law="bilateral", plate=plate), Displacement("bottom", x=0.0, y=0.0),
        *(Traction(side, x=0.0, y=0.0) for side in ("left", "right")),
    ]  # fmt: skip
    found = limit_load_factor(ContactProblem(mesh, STEEL, conditions), ["top"])
    assert found.upper == pytest.approx(0.7, rel=1e-7)
