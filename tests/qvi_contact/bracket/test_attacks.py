"""Attempts to refute the bounds: other meshes, wrong stresses, odd data, every side, units, and places."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    QVIError,
    RectilinearMesh,
    Region,
    RigidPlate,
    Symmetry,
    Traction,
    solve,
)
from qvi_contact.bracket import Bracket, BracketKind, bracket
from qvi_contact.companion import solve_companion
from qvi_contact.gallery import compressed_plate
from qvi_contact.result import ContactResult
from tests.effort import examples, thinned

pytestmark = pytest.mark.usefixtures(
    "bogner_fox_schmit"
)  # grids turned and mirrored have the same cells, unlike triangles

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
    return ContactProblem(RectilinearMesh.rectangle(cells), material, [*conditions, *free(*rest)], potential)


def pressed(bound, cells=(4, 4)):
    """The quarter plate of the gallery under a plate with a given friction bound."""
    plate = compressed_plate(0.0, cells)
    return replace(plate, conditions=[*plate.conditions[:3], Contact.tresca("top", bound, gap=-U, name="plate")])


def halved(problem):
    """Every cell cut in four."""
    mesh = problem.mesh
    return problem.on_lines(*(np.sort(np.append(lines, (lines[1:] + lines[:-1]) / 2.0)) for lines in (mesh.x, mesh.y)))


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
        finer = solve(problem.on_lines(self.LINES, self.LINES)).bracket
        assert finer.guaranteed
        assert_consistent(solve(problem).bracket, finer)

    def test_bound_that_vanishes_in_the_middle_of_an_edge(self):
        problem = pressed(lambda x, _: np.where(np.abs(x - 0.5) < 0.15, 0.0, 30.0), (1, 1))
        assert not solve(problem).bracket.guaranteed

    def test_support_with_a_bump(self):
        """A narrow bump: 6 % of the edge, missed by all points on it; grid lines at its corners resolve it."""

        def bump(x, y):
            return -U - 2.0 * U * np.maximum(1.0 - np.abs(x - 0.06) / 0.03, 0.0) + 0.0 * y

        problem = square(Displacement("bottom", 0.0, 0.0), Displacement("top", 0.0, bump), cells=(1, 1))
        fine = problem.on_lines([0.0, 0.015, 0.03, 0.045, 0.06, 0.075, 0.09, 0.15, 0.3, 0.6, 1.0], self.LINES)
        finer = solve(fine).bracket
        assert_consistent(solve(problem).bracket, finer)

    def test_traction_on_a_strip_at_the_end_of_an_edge(self):
        load = Traction("top", 0.0, lambda x, _: np.where(x > 0.99, -100.0, -1.0))
        problem = square(Displacement("bottom", 0.0, 0.0), load, cells=(1, 2))
        companion = solve_companion(problem.on_lines([0.0, 0.5, 0.9, 0.96, 0.98, 0.99, 1.0], self.LINES))
        assert not companion.reasons
        found = solve(problem).bracket
        assert found.lower > companion.energy  # what may not be claimed to be a bound
        assert not found.guaranteed


def legendre(x, y):
    """The polynomial of degree 4 that is zero at four Gauss points of [0, 1]."""
    t = 2.0 * x - 1.0
    return (35.0 * t**4 - 30.0 * t**2 + 3.0) / 8.0 + 0.0 * y


class TestPotentials:
    """Potentials that are not affine along a contact: τ_N is not, either."""

    def boxed(self, cells, contact, potential, push=0.0):
        walls = Symmetry("left"), Symmetry("right"), Displacement("top", 0.0, -push)
        return square(contact, *walls, cells=cells, material=Material(1e3, 0.4999, "strain"), potential=potential)

    def test_tension_between_gauss_points(self):
        """The potential pulls at both ends of the edge and is nothing at its Gauss points."""
        contact = Contact.frictionless("bottom")
        found = solve(self.boxed((1, 1), contact, legendre)).bracket
        companion = solve_companion(self.boxed((6, 6), contact, legendre))
        assert not companion.reasons
        assert found.lower > companion.energy  # what may not be claimed to be a bound
        assert not found.guaranteed

    @pytest.mark.parametrize(
        "contact", [Contact.tresca("bottom", 0.1), Contact("bottom", 0.1)], ids=["tresca", "coulomb"]
    )
    def test_is_no_error(self, contact):
        """No bound from below is claimed, and no exception speaks of an algorithm's inside."""
        sides = Symmetry("left"), Displacement("top", 0.0, -U)
        found = bracket(solve(square(contact, *sides, cells=(3, 3), potential=lambda x, y: x**2 + 0.0 * y)))
        assert not found.guaranteed
        assert found.lower == -np.inf
        assert np.isfinite(found.upper)

    @pytest.mark.parametrize(
        "potential", [5.0, lambda x, y: 3.0 * y - x, lambda x, y: x * y], ids=["c", "affine", "xy"]
    )
    def test_affine_along_the_contact(self, potential):
        problem = self.boxed((2, 2), Contact.tresca("bottom", 0.1), potential, push=U)
        coarse, fine = solve(problem).bracket, solve(halved(problem)).bracket
        assert coarse.guaranteed
        assert fine.guaranteed
        assert_consistent(coarse, fine)
        assert fine.gap <= coarse.gap + 1e-12 * coarse.strain


class TestOpenContact:
    """Contacts that carry nothing."""

    def test_beam_bends_away_from_the_obstacle(self):
        """Its bounds are those of the beam without the obstacle."""
        mesh = RectilinearMesh.rectangle((6, 2), 1.0, 0.1)
        beam = Displacement("left", 0.0, 0.0), *free("bottom"), Traction("top", 0.0, -1.0)
        obstacle = Contact.frictionless("right", gap=1.0)
        found = solve(ContactProblem(mesh, Material(1e5, 0.3), [*beam, obstacle])).bracket
        alone = solve(ContactProblem(mesh, Material(1e5, 0.3), [*beam, *free("right")])).bracket
        assert found.lower == pytest.approx(alone.lower, rel=1e-6)
        assert found.upper == pytest.approx(alone.upper, rel=1e-6)
        assert found.guaranteed

    @pytest.mark.parametrize("side", SIDES)
    def test_body_at_rest(self, side):
        found = solve(square(Displacement(SIDES[side], 0.0, 0.0), Contact.frictionless(side, gap=U))).bracket
        assert abs(found.lower) <= 1e-12
        assert abs(found.upper) <= 1e-12


@pytest.mark.parametrize("bound", [0.0, 0.1])
def test_guide_that_pushes_and_pulls(bound):
    """A bound that is data does not depend on the sign of σ_N, here both on one edge."""
    guide = Contact("bottom", 0.0, cohesion=bound, law="bilateral")
    found = solve(square(guide, Displacement("top", 0.0, lambda x, y: U * (x - 0.4) + 0.0 * y), cells=(3, 3))).bracket
    assert found.guaranteed, found.reasons


class TestForces:
    """Bounds of forces: sign, component and place."""

    @staticmethod
    def own(result, key):
        name, kind = key.rsplit(".", 1)
        return getattr(result.contacts[name] if name in result.contacts else result.resultant(name), kind)

    def check(self, problem, key):
        """The force of a finer mesh lies between the bounds, and those of the own mesh are one of them."""
        result = solve(problem)
        found = result.bracket
        assert set(found.forces) == {key}
        low, high = found.forces[key]
        size = max(abs(low), abs(high))
        assert size > 0.0
        assert low - ROUNDING * size <= self.own(solve(halved(problem)), key) <= high + ROUNDING * size
        assert min(abs(self.own(result, key) - end) for end in (low, high)) <= 1e-6 * size

    @pytest.mark.parametrize(
        ("side", "sign"),
        thinned([*((side, -1.0) for side in SIDES), ("bottom", 1.0), ("right", 1.0)], 5),
    )
    def test_each_side(self, side, sign):
        held = Displacement(SIDES[side], 0.0, 0.0)
        normal = "x" if side in ("left", "right") else "y"
        across = "y" if normal == "x" else "x"
        cells = (2, 2)
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
        mesh = RectilinearMesh.rectangle((2, 2)).with_joint("joint", axis, 0.5)
        outer = [Displacement(end, 0.0, 0.0) for end in ends]
        outer += free(*(side for side in SIDES if side not in ends))
        for joint, kind in (
            (Contact.frictionless("joint", gap=-U), "normal_force"),
            (Contact.tied("joint", gap=U), "normal_force"),
            (Contact.tied("joint", offset=U), "tangential_force"),
        ):
            self.check(ContactProblem(mesh, SOFT, [*outer, joint]), f"joint.{kind}")

    def test_part_of_a_side_and_other_contacts(self):
        mesh = (
            RectilinearMesh.rectangle((4, 3)).with_edges("part", "top", stop=0.5).with_edges("rest", "top", start=0.5)
        )
        conditions = [
            Contact.frictionless("bottom"),
            Symmetry("left"),
            *free("right", "rest"),
            Displacement("part", 0.0, -U),
        ]
        self.check(ContactProblem(mesh, SOFT, conditions), "part.y")

    def test_two_surfaces_of_one_side(self):
        """The "top" of an L consists of two segments at different heights."""
        active = np.array([[1, 1, 1], [1, 1, 1], [1, 0, 0]], dtype=bool)
        mesh = RectilinearMesh(np.arange(4.0), np.arange(4.0), active)
        conditions = [Displacement("bottom", 0.0, 0.0), *free("left", "right"), Contact.tied("top", gap=-U)]
        self.check(ContactProblem(mesh, SOFT, conditions), "top.normal_force")

    @pytest.mark.parametrize(
        "other",
        [
            {"offset": 1e-4, "friction": 5.0},
            {"plate": RigidPlate(moment=1e-2, pivot=(0.5, 1.0))},
            {"gap": lambda x, _: -U + 0.0 * x},
            {"cohesion": 0.2},
        ],
        ids=["offset", "moment", "function", "cohesion"],
    )
    def test_none_beside_other_data(self, other):
        contact = Contact("top", **{"friction": 0.0, "gap": -U, **other})
        assert solve(square(Displacement("bottom", 0.0, 0.0), contact)).bracket.forces == {}


def perturbed(result, size, seed=0):
    """The result with noise in all its unknowns: equilibrium is kept, everything else may be broken."""
    z = result.solution.z
    noise = np.random.default_rng(seed).standard_normal(len(z))
    return ContactResult(result.discretization, replace(result.solution, z=z + size * np.abs(z).max() * noise))


@cache
def solved_block(kind):
    """A block under a plate that is driven by forces, or between two that it is tied to."""
    if kind == "tied":
        return solve(square(Contact.tied("bottom"), Contact.tied("top", gap=U), Contact.tresca("left", 0.1)))
    plate = pressed(20.0)
    contact = Contact.tresca("top", 20.0, name="plate")
    contact = replace(contact, plate=RigidPlate(force_y=-200.0, moment=-30.0))
    return solve(replace(plate, conditions=[*plate.conditions[:3], contact]))


class TestWrongStresses:
    """Bounds of stresses that solve nothing hold as well, or are not called guaranteed."""

    @pytest.mark.parametrize("kind", ["driven", "tied"])
    @pytest.mark.parametrize("size", [1e-3, 1.0])
    def test_noise(self, kind, size):
        result = solved_block(kind)
        right = result.bracket
        assert right.guaranteed
        assert_consistent(bracket(perturbed(result, size)), right)

    def test_noise_where_tractions_are_given(self):
        """Noise in contact tractions of a driven plate breaks its balance: never a lower bound that is too high."""
        result = solved_block("driven")
        right = result.bracket
        for seed in range(2):
            assert bracket(perturbed(result, 1e-2, seed)).lower <= right.upper

    def test_unconverged(self):
        problem = pressed(10.0, (3, 3))
        assert_consistent(solve(problem, method="uzawa", max_iterations=2).bracket, solve(problem).bracket)

    def test_stress_beyond_its_bound(self):
        """A stress beyond its bound by a third is not taken as it is; one beyond it by little costs slack."""
        problem = pressed(10.0, (4, 4))
        found, fine = solve(problem), solve(halved(halved(problem))).bracket
        for bound in (13.0, 10.0 + 1e-5):
            result = solve(pressed(bound, (4, 4)), inner="strict-direct:clarabel")
            more = ContactResult(found.discretization, replace(found.solution, z=result.solution.z))
            wrong = bracket(more, tolerance=1e-6)
            assert_consistent(wrong, fine)
            assert (wrong.result is more) == (bound < 11.0)
            assert (wrong.slack > 1e-12 * wrong.strain) == (bound < 11.0)


class TestSticking:
    """Contacts that all stick count as tied, and only then."""

    def test_is_not_claimed_where_one_contact_slips_or_opens(self):
        held = Contact("bottom", 50.0)
        stuck = solve(square(held, Contact("top", 50.0, gap=-U))).bracket
        assert stuck.kind is BracketKind.STICKING
        for other in (Contact("top", 0.01, gap=-U), Contact("top", 50.0, gap=lambda x, y: -U + 3.0 * U * x + 0.0 * y)):
            found = solve(square(held, other)).bracket
            assert found.kind is BracketKind.GIVEN_BOUND
            assert not found.guaranteed

    def test_is_the_tied_problem_beside_other_laws(self):
        """One contact sticks by Coulomb's law, the other keeps the law of Tresca."""
        stuck, slips = Contact("bottom", 50.0), Contact.tresca("top", 0.02, gap=-U)
        found = solve(square(stuck, slips)).bracket
        tied = solve(square(Contact.tied("bottom"), slips)).bracket
        assert found.kind is BracketKind.STICKING
        assert found.lower == pytest.approx(tied.lower, rel=1e-6)
        assert found.upper == pytest.approx(tied.upper, rel=1e-9)


def walled_block(lines=(0.0, 0.1, 0.4, 1.0), unit=1.0, stress=1.0, start=0.0, mirrored=False):
    """A block on a frictionless ground, a wall with a bound at its left (or right) side."""
    x = 1.0 - np.asarray(lines)[::-1] if mirrored else np.asarray(lines)
    wall, other = ("right", "left") if mirrored else ("left", "right")
    mesh = RectilinearMesh(start + unit * x, start + unit * np.array([0.0, 0.4, 1.0]))
    conditions = [
        Contact.frictionless("bottom"),
        Contact.tresca(wall, 5.0 * stress, gap=-1e-4 * unit, offset=2e-4 * unit),
        *free(other),
        Displacement("top", y=-U * unit),
        Traction("top", x=0.0),
    ]
    return ContactProblem(mesh, Material(1e5 * stress, 0.3), conditions)


@cache
def walled_bracket():
    return solve(walled_block()).bracket


class TestInvariance:
    """The same problem said in another way."""

    @pytest.mark.parametrize(("unit", "stress", "start"), [(1e-9, 1e12, 0.0), (1e9, 1e-9, 0.0), (1.0, 1.0, 1e6)])
    def test_units_and_place(self, unit, stress, start):
        first = walled_bracket()
        other = solve(walled_block(unit=unit, stress=stress, start=start)).bracket
        energy = unit**2 * stress
        assert other.guaranteed
        assert other.lower / energy == pytest.approx(first.lower, rel=1e-7)
        assert other.upper / energy == pytest.approx(first.upper, rel=1e-7)

    def test_mirrored(self):
        first, other = walled_bracket(), solve(walled_block(mirrored=True)).bracket
        assert other.lower == pytest.approx(first.lower, rel=1e-9)
        assert other.upper == pytest.approx(first.upper, rel=1e-9)
        np.testing.assert_allclose(other.cells[:, ::-1], first.cells, rtol=1e-4, atol=1e-6 * first.gap)

    def test_transposed(self):
        """The axes change places: a force on the right instead of the top."""
        gap, bound = -U, 0.1
        upright = square(Displacement("bottom", 0.0, 0.0), Contact.tresca("top", bound, gap=gap), cells=(3, 2))
        lying = square(Displacement("left", 0.0, 0.0), Contact.tresca("right", bound, gap=gap), cells=(2, 3))
        first, other = solve(upright).bracket, solve(lying).bracket
        assert other.lower == pytest.approx(first.lower, rel=1e-9)
        assert other.upper == pytest.approx(first.upper, rel=1e-9)
        np.testing.assert_allclose(other.cells.T, first.cells, rtol=1e-4, atol=1e-6 * first.gap)

    def test_rigid_motion_of_supports(self):
        """A lift that is a million times the deformation moves both bounds by the load's work."""
        energies = []
        for lift in (0.0, 1e3):
            load = Traction("top", 0.0, -1.0)
            found = solve(square(Displacement("bottom", 0.0, lift), load, cells=(2, 2))).bracket
            energies.append((found.lower - lift, found.upper - lift))
        np.testing.assert_allclose(energies[1], energies[0], rtol=1e-6)


def generated(seed):
    """A body with random laws, data of low degree, a joint, a region, a missing corner; None if it makes no sense."""
    rng = np.random.default_rng(seed)
    x, y = (np.append(0.0, np.cumsum(rng.uniform(0.2, 1.0, rng.integers(2, 4)))) for _ in range(2))
    active = np.ones((len(y) - 1, len(x) - 1), dtype=bool)
    active[1:, 1:] = rng.random() < 0.6
    mesh = RectilinearMesh(x, y, active)
    joints = ["joint"] if rng.random() < 0.5 else []
    if joints:
        mesh = mesh.with_joint("joint", "horizontal", y[1])

    def contact(edges):
        gap, offset = rng.choice([0.0, -1.0, 0.5], 2) * U
        tilt = rng.choice([0.0, U])
        position = (lambda x, y: gap + tilt * x * y) if tilt else float(gap)
        kind = rng.integers(4)
        if kind == 0:
            return Contact.tied(edges, position, float(offset))
        if kind == 1:
            return Contact.frictionless(edges, position)
        bound = float(rng.choice([0.05, 0.5]))
        field = bound if rng.random() < 0.5 else lambda x, y: bound * (1.0 + x * y)
        law = "bilateral" if kind == 3 and edges != "joint" else "unilateral"
        return Contact(edges, 0.0, position, float(offset), cohesion=field, law=law)

    right = Traction("right", float(rng.choice([0.0, 0.2, -0.3])), 0.0)
    left = Symmetry("left") if rng.random() < 0.3 else Traction("left", 0.0, 0.0)
    top = contact("top") if rng.random() < 0.4 else Traction("top", 0.0, -0.5)
    material = Material(1e3, float(rng.choice([0.0, 0.3, 0.49])), str(rng.choice(["stress", "strain"])))
    regions = [Region(replace(material, young=1e4), x=(0.0, x[1]))] if rng.random() < 0.4 else []
    potential = (lambda _, y: 0.3 * y) if rng.random() < 0.3 else 0.0
    conditions = [contact("bottom"), right, left, top, *map(contact, joints)]
    try:
        return ContactProblem(mesh, material, conditions, potential, regions)
    except QVIError:
        return None


class TestGenerated:
    """Random convex problems: mesh against finer mesh, degree against degree."""

    SEEDS = range(examples(5))

    def brackets(self, problem, degree):
        result = solve(problem)
        return bracket(result, degree=degree) if result.has_state else None

    def test_meshes_and_degrees_agree(self):
        compared = 0
        for seed in self.SEEDS:
            problem = generated(seed)
            coarse = None if problem is None else self.brackets(problem, 2)
            if coarse is None or not coarse.guaranteed:
                continue
            compared += 1
            assert coarse.cells.sum() == pytest.approx(coarse.gap - coarse.slack, rel=1e-5, abs=1e-9 * coarse.strain)
            assert min(coarse.parts.values()) >= -1e-8 * coarse.strain
            for other in (self.brackets(problem, 3), self.brackets(halved(problem), 2)):
                assert other is not None, seed
                assert_consistent(coarse, other)
        assert compared >= examples(2)


class TestShearThatCannotBe:
    """A contact whose shear equilibrium alone makes zero."""

    def test_upper_block_of_one_cell(self):
        """Between free sides and below a frictionless plate, σ_T on the joint is a quadratic without ends or mean."""
        mesh = RectilinearMesh([0.0, 1.0], [0.0, 1.0, 2.0]).with_joint("joint", "horizontal", 1.0)
        plate = Contact.frictionless("top", gap=lambda x, y: 4.0 * U * x - U + 0.0 * y)
        joint = Contact.tresca("joint", 0.05)
        conditions = [Displacement("bottom", 0.0, 0.0), *free("left", "right"), plate, joint]
        found = solve(ContactProblem(mesh, SOFT, conditions)).bracket
        assert found.lower <= found.upper


@cache
def solved_plate():
    return solve(pressed(10.0, (2, 2)))


def test_bounds_that_contradict_each_other_bound_no_error():
    """A lower bound above the upper one, as wrong data give, does not mean that the stress is exact."""
    found = solved_plate().bracket
    assert found.relative_error > 0.0
    assert replace(found, lower=found.upper + found.strain).relative_error > found.relative_error


class TestBadInput:
    """What is refused, in the project's own words."""

    @pytest.mark.parametrize(
        "options",
        [
            {"tolerance": "a"},
            {"tolerance": None},
            {"tolerance": 0.0},
            {"tolerance": 0.4},
            {"tolerance": np.nan},
            {"degree": 2.5},
            {"degree": 1},
        ],
        ids=str,
    )
    def test_options(self, options):
        with pytest.raises(InputError, match=next(iter(options))):
            bracket(solved_plate(), **options)

    def test_no_state(self):
        """Nothing holds the body: the load exceeds what friction carries."""
        result = solve(square(Contact("bottom", 0.1), Traction("top", 1.0, -1.0), cells=(2, 2)))
        assert not result.has_state
        with pytest.raises(InputError, match="no stress state"):
            bracket(result)
