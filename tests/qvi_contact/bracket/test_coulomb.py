"""Bounds under Coulomb friction: constants, shares, true errors below them, forces."""

from dataclasses import replace
from functools import cache
from itertools import product
from math import comb
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import eigh

from qvi_contact import Contact, ContactProblem, Displacement, Material, Polynomial, Region, RigidPlate, Traction, solve
from qvi_contact.bracket import (
    Share,
    amplification,
    coercivity,
    computed_norm,
    defect_bound,
    error_bound,
    friction_norm,
    lines,
    rectangle_constant,
    rectangle_norm,
    slip_work,
    star_norm,
)
from qvi_contact.companion import BodyAtRest
from qvi_contact.element import gauss_legendre
from qvi_contact.files import load_problem
from qvi_contact.gallery import compressed_plate, sliding_block, ssnv128
from qvi_contact.mesh import TriangleMesh
from qvi_contact.refinement import bulk
from qvi_contact.solution import ContactResult
from tests.cases import examples
from tests.qvi_contact.builders import bernstein, energy_apart, half_disc, half_discs, holed, sheared_layer
from tests.qvi_contact.test_triangles import oblique

EXAMPLES = Path(__file__).parents[3] / "examples"
FREE = [Traction(side, x=0.0, y=0.0) for side in ("left", "right")]


def bounds_met(result, fine, most, *forces):
    """Those of a result: they are up to `most` times as large as its errors, and hold forces of a finer one."""
    found = result.bracket.coulomb
    assert 1.0 <= found.error / energy_apart(result, fine) < most
    for contact, kind in (name.split(".") for name in forces):
        lower, upper = found.forces[f"{contact}.{kind}"]
        assert lower < getattr(fine.contacts[contact], kind) < upper
    return found


def shared(problem, s):
    """The share s(t) on all edges of the contacts, or the same number everywhere."""
    found = {}
    for contact in problem.contacts:
        count = len(problem.mesh.edges(contact.edges))
        values = np.full((count, 3), float(s))
        found[contact.name] = Share(contact, values, np.ones_like(values), np.full(count, float(s)), 1.0 - abs(values))
    return found


@pytest.mark.parametrize("s", [0.0, 0.75, 1.95])
def test_constants_of_square_zero_operators(s):
    """α, f, |I + S| and the constant of Σ are never passed by operators of norm s with SS = 0, and are met by some."""
    random, n = np.random.default_rng(0), 4000

    def unit(vectors):
        return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)

    k, direction = (random.standard_normal((n, 2)) for _ in range(2))
    # e = k + m with k in the kernel and m orthogonal to it; S m is any vector of the kernel of norm ≤ s |m|
    angle = np.concatenate([random.uniform(0.0, np.pi, n // 2), np.linspace(0.0, np.pi, n // 2)])
    k = np.cos(angle)[:, None] * unit(k)
    length = s * np.abs(np.sin(angle)) * np.where(np.arange(n) % 2, 1.0, random.uniform(0.0, 1.0, n))
    image = length[:, None] * unit(direction)
    image[n // 2 :] = length[n // 2 :, None] * np.sign(np.cos(angle[n // 2 :]))[:, None] * unit(k[n // 2 :])
    cross = (k * image).sum(axis=1)
    energy = 1.0 - cross  # a(e, e − Se) of |e| = 1
    size = np.sqrt(1.0 - 2.0 * cross + length**2)  # |e − Se|
    alpha, f = coercivity(s), amplification(s)
    assert energy.min() >= alpha - 1e-12
    assert (energy / size**2).min() >= alpha - 1e-12
    assert (size / energy).max() <= f + 1e-12
    assert (energy.min(), (size / energy).max()) == pytest.approx((alpha, f), rel=1e-3)
    turned = 1.0 + s * np.sin(angle) * np.cos(angle)  # a(e, e − Se) with −S for S
    assert (turned / (2.0 * turned - 1.0 + s**2 * np.sin(angle) ** 2)).min() >= alpha - 1e-12


T = np.linspace(0.0, 1.0, 4001)
SIMPSON = np.r_[1.0, np.tile([4.0, 2.0], 1999), 4.0, 1.0] / 12000.0
NUMBERS = st.floats(-10.0, 10.0, allow_subnormal=False)
POSITIVE = st.floats(0.0, 10.0, allow_subnormal=False)


@given(arrays(float, 4, elements=NUMBERS), arrays(float, 3, elements=NUMBERS), arrays(float, 3, elements=POSITIVE))
def test_friction_work_of_a_cubic_slip(slip, shear, bound):
    """∫ bound |slip| + shear slip of Bernstein coefficients."""
    raised = np.array([[comb(i, k) / comb(3, k) for k in range(4)] for i in range(4)])  # from powers of t
    fine = np.polynomial.polynomial.polyval(T, slip)
    quadratics = bernstein(2, T)
    wanted = SIMPSON @ (np.abs(fine) * (quadratics @ bound) + fine * (quadratics @ shear))
    size = 1e-12 + np.abs(fine).max() * (np.abs(bound).max() + np.abs(shear).max())
    assert abs(slip_work((raised @ slip)[None], shear[None], bound[None])[0] - wanted) <= 1e-5 * size


def test_bounds_solve_their_quadratics():
    residual, defect, s = 0.3, 0.02, 0.6
    found = error_bound(residual, defect, s)
    alpha, f, q = coercivity(s), amplification(s), np.linspace(0.0, 1.0, 1001)
    assert found**2 == pytest.approx(f * residual * found + defect / alpha, rel=1e-13)
    largest = (residual * q - alpha * q**2).max() + defect
    assert defect_bound(residual, defect, s) == pytest.approx(largest, rel=1e-5)
    assert error_bound(residual, defect, 2.0) == defect_bound(1.0, 0.0, 2.0) == amplification(2.0) == np.inf


def clamped_plate(friction):
    """The plate with its bottom clamped and its left side free."""
    problem = compressed_plate(friction)
    return replace(problem, conditions=[FREE[0], Displacement("bottom", x=0.0, y=0.0), *problem.conditions[2:]])


def test_bodies_without_loads_and_open_contacts_cost_nothing():
    """Of a state that is zero, none is no share; what solvers leave of tractions is no friction."""
    block = TriangleMesh.rectangle((3, 2))
    for friction, gap, x in ((0.3, 1e-2, 1e-3), (0.0, 1e-2, 1e-3), (0.0, -1e-4, 0.0)):  # moved, or as the obstacle
        sides = [Contact("bottom", friction, gap), Displacement("top", x, 1e-4), *FREE]
        moved = solve(ContactProblem(block, Material(1e3, 0.3), sides)).bracket
        assert (moved.relative_error < 1e-3, "the stresses are rounding" in moved.message) == (True, True)
    found = solve(compressed_plate(0.2, (1, 1), displacement=0.0)).bracket.coulomb
    assert (found.error, found.relative_error, found.apart) == (0.0, 0.0, 0.0)
    left, bottom, _, contact = (plate := compressed_plate(0.2, (2, 2))).conditions
    pulled = replace(plate, conditions=[left, bottom, Traction("right", 5.0, 0.0), replace(contact, gap=1e-5)])
    assert solve(pulled, method="fixed-point").bracket.coulomb.relative_error < 1e-5


def test_wide_bounds_that_are_proved_come_with_an_estimate():
    """At μ = 0.5 all sticks, as at μ = 1, whose force is settled."""
    found = solve(compressed_plate(0.5, (4, 4))).bracket
    proved, likely = found.coulomb, found.coulomb.likely
    assert (proved.guaranteed, likely.guaranteed, likely.likely) == (True, False, None)
    assert likely.within < proved.within / 1.5
    (low, high), (lower, upper) = (each.forces["plate.normal_force"] for each in (proved, likely))
    assert low < lower < 214.367658387 < upper < high
    assert f"estimate: {lower:.9g} to {upper:.9g}" in " ".join(lines(found))
    assert solve(compressed_plate(0.2, (3, 3))).bracket.coulomb.likely is None


class TestNorms:
    """Proved norms of the friction operator, and those of finite elements."""

    def test_the_plate(self, monkeypatch):
        """The constant of a square under symmetry, from β ≥ sin(π/8): T1 to T3 hold for μ < 0.533."""
        assert rectangle_constant(0.3, np.sin(np.pi / 8.0), 1.0, 2.0 / np.pi) == pytest.approx(3.75079, rel=1e-5)
        found = friction_norm(problem := compressed_plate(0.2), shared(problem, 1.0))
        assert found.proved
        assert rectangle_constant(0.3, 0.4, 1.0, 0.6, np.inf) == np.inf  # a share that jumps
        for height in (2.0, 5.0):  # cut into squares
            tall, part = compressed_plate(0.2, height=height), (0.3, np.sin(np.pi / 8.0), 0.2, 0.4 / np.pi / height)
            assert rectangle_norm(tall, shared(tall, 1.0)) == pytest.approx(rectangle_constant(*part))
        assert found.value == pytest.approx(0.2 * 3.75079, rel=1e-5)
        shares = shared(problem, 2.5)  # the norm 1.88, which proves errors below 15.8 times the residual
        proved = [friction_norm(problem, shares, size=size).proved for size in (15.0, 16.0)]
        assert proved == [False, True]
        monkeypatch.setattr("qvi_contact.bracket.norms.MOST", 0)  # where no norm can be computed
        assert friction_norm(compressed_plate(0.2), shares, size=15.0).proved
        assert found.work(problem, shared(problem, 1.0), 0.0, 0.0, 0.1) == pytest.approx(0.01 * found.value)

    @pytest.mark.parametrize(
        "problem",
        [compressed_plate(0.5, (3, 3), width=2.0),
         compressed_plate(0.5, (3, 3), height=3.0, plane="strain", poisson=0.4), ssnv128((3, 3), friction=0.5),
         sliding_block((3, 2))[0]],
    )  # fmt: skip
    def test_finite_elements_stay_below(self, problem):
        for sense in (1, -1):
            proved = rectangle_norm(problem, shared(problem, sense))
            assert 0.0 < computed_norm(problem, shared(problem, sense)) < proved

    @pytest.mark.parametrize("problem", [half_disc(0.1), sheared_layer(0.1), clamped_plate(0.1)])
    def test_star_shaped_bodies(self, problem):
        """|Sv|/|v| of finite elements, for which Sv = η v_t n is one too, is less than what is proved, turned too."""
        x, y = problem.mesh.vertices.T  # leaning, as the best centre of an even body is found at once
        problem = replace(problem, mesh=replace(problem.mesh, vertices=np.column_stack([x + 0.1 * y, y])))
        shares = shared(problem, -1.0)
        least, proved = 0.1 * quotient(problem, degree=4), star_norm(problem, shares)
        assert computed_norm(problem, shares) / 1.01 <= least < proved
        turned = replace(problem, mesh=oblique(problem.mesh, 40.0))
        assert star_norm(turned, shares) == pytest.approx(proved, rel=1e-11)
        assert friction_norm(problem, shares).proved

    @pytest.mark.parametrize("seed", range(2))
    def test_of_a_share_that_varies(self, seed):
        """A quotient of polynomials: its steepness by differences, and both norms of it."""
        problem, random = compressed_plate(0.3, (3, 3)), np.random.default_rng(seed)
        (share,) = shared(problem, 0.0).values()
        ends = random.uniform(-1.0, 1.0, len(share.values) + 1)
        values = np.column_stack([ends[:-1], random.uniform(-1.0, 1.0, len(share.values)), ends[1:]])
        share = replace(share, values=values, weights=10.0 ** random.uniform(-0.5, 0.5, values.shape))
        t = np.linspace(0.0, 1.0, 16 * 64 + 1)
        slopes = np.abs(np.diff(share.at(t), axis=1)).reshape(len(values), 16, 64).max(axis=2) * 64.0
        assert (slopes <= share.steepest() * (1.0 + 1e-12)).all()
        assert (share.steepest().max(axis=1) <= 1.4 * slopes.max(axis=1)).all()
        assert 0.0 < computed_norm(problem, {"plate": share}) < rectangle_norm(problem, {"plate": share})
        linear = np.column_stack([ends[:-1], (ends[:-1] + ends[1:]) / 2.0, ends[1:]])
        on_edges = replace(share, values=linear, weights=np.ones_like(linear))
        H = 0.3 * np.sqrt((3.0 * np.diff(ends)) ** 2 @ np.array([1.0, 3.0, 5.0]) / 18.0)  # H² = ∫ θ'² x dx
        largest = 0.3 * np.abs(ends).max()
        expected = rectangle_constant(0.3, np.sin(np.pi / 8.0), largest, 2.0 / np.pi * largest, H)
        assert rectangle_norm(problem, {"plate": on_edges}) == pytest.approx(expected, rel=1e-9)
        jumping = replace(on_edges, values=linear + np.array([[0.0], [0.0], [1e-3]]))
        assert rectangle_norm(problem, {"plate": jumping}) == np.inf

    def test_where_nothing_is_proved_it_is_computed(self, monkeypatch):
        """Of bodies that no proof is for, and where a plate that a force drives, or springs, bear shear."""
        plate, load = compressed_plate(0.2), {"plate": RigidPlate(force_y=-10.0, x=0.0, rotation=0.0)}
        left, bottom, right, contact = plate.conditions
        driven, tied = (replace(each, **load) for each in (contact, Contact.tied("bottom")))
        bed, foot = replace(contact, tangential_stiffness=1e7), replace(Contact.tied("bottom"), normal_stiffness=1e7)
        pairs = (bottom, driven), (tied, contact), (bottom, bed), (foot, contact)
        posed = [replace(plate, conditions=[left, right, *two]) for two in pairs]
        for problem, most in ((half_disc(0.3), 1.0), *((each, 0.75) for each in posed)):
            found = friction_norm(problem, shared(problem, 1.0))
            assert not found.proved
            assert 0.2 < found.value < most
        monkeypatch.setattr("qvi_contact.bracket.norms.rectangle_norm", lambda *_: np.nan)  # which proves nothing
        found = friction_norm(plate, shared(plate, 1.0))
        assert (found.proved, found.value > 0.0) == (False, True)

    def test_where_no_proof_holds(self):
        """Two materials, springs, rough sides at a corner, a hole, a jump of friction at springs, uneven shares."""
        soft = Region(Material(1.0, 0.1), x=(0.0, compressed_plate(0.1).mesh.length / 2.0))
        problems = [replace(plate, regions=[soft]) for plate in (compressed_plate(0.1), clamped_plate(0.1))]
        spring = replace(Contact.tied("left"), normal_stiffness=1.0)  # in place of the symmetry
        problems += [replace(plate := compressed_plate(0.1), conditions=[spring, *plate.conditions[1:]])]
        ring, whole = holed(2, [(0.0, 0.0)], (-1.5, -1.5), (1.5, 1.5)), TriangleMesh.rectangle((2, 2), 2.0, 1.0)
        for mesh, foot in ((ring, lambda _, y: y < -1.4), (whole, lambda x, y: (y == 0.0) | (x == 0.0))):
            mesh = mesh.with_edges("foot", foot).with_edges("rest", lambda x, y, foot=foot: ~foot(x, y))
            held = Contact("foot", 0.1), Displacement("rest", 0.0, 0.0)
            problems.append(ContactProblem(mesh, Material(1.0, 0.3), held))
        mesh = whole.with_edges("foot", lambda x, y: (y == 0.0) & (x > 1.0))
        mesh = mesh.with_edges("rail", lambda x, y: (y == 0.0) & (x < 1.0))
        sides = [Displacement("left", x=0.0), Traction("left", y=0.0), FREE[1], Displacement("top", 0.0, 0.0)]
        for friction in (0.0, 0.2):
            feet = [Contact("foot", 0.1, normal_stiffness=1e6), Contact("rail", friction, normal_stiffness=1e6)]
            problems.append(ContactProblem(mesh, Material(1.0, 0.3), [*feet, *sides]))
        cases = [(problem, shared(problem, 1.0)) for problem in problems]
        (share,) = shared(half_disc(0.1), 1.0).values()
        part = np.arange(len(share.values)) == 0
        cases += [(half_disc(0.1), {"base": replace(share, slipping=np.where(part, 0.5, share.slipping))})]
        for problem, shares in cases:
            assert rectangle_norm(problem, shares) == star_norm(problem, shares) == np.inf

    @pytest.mark.parametrize("both", [(0.1, 0.1), (0.1, 0.02), (0.02, 0.1)])
    def test_of_several_bodies_it_is_the_largest(self, both):
        mesh = TriangleMesh.rectangle((4, 2), 2.0, 1.0).with_joint("seam", lambda x, _: x == 1.0)
        mesh = mesh.with_edges("one", lambda x, y: (y == 0.0) & (x < 1.0))
        mesh = mesh.with_edges("two", lambda x, y: (y == 0.0) & (x > 1.0))
        feet = [Contact(name, friction) for name, friction in zip(("one", "two"), both, strict=True)]
        sides = [Contact("seam", 0.0), Traction("top", 0.0, -1.0)]
        sides += [kind for end in ("left", "right") for kind in (Displacement(end, x=0.0), Traction(end, y=0.0))]
        problem = ContactProblem(mesh, Material(1.0, 0.3), [*feet, *sides])
        shares = {name: share for name, share in shared(problem, 1.0).items() if name != "seam"}
        alone = friction_norm(half_disc(0.1), shared(half_disc(0.1), 1.0)).value  # whatever is beyond a joint
        beside = friction_norm(discs := half_discs(0.1, below=300.0), shared(discs, 1.0))
        found = friction_norm(problem, shares)
        assert (found.proved, beside.proved) == (True, True)
        assert (found.value, beside.value) == (pytest.approx(0.52346, rel=1e-4), pytest.approx(alone, rel=1e-6))


def quotient(problem, degree):
    """The largest |v_x e_y|/|v| of displacements of a degree on the mesh."""
    body = BodyAtRest.of(problem, degree).body
    K = body.body.stiffness().toarray()
    turn = np.kron(np.eye(len(K) // 2), [[0.0, 0.0], [1.0, 0.0]])
    B = body.B.toarray()
    return float(np.sqrt(eigh(B.T @ turn.T @ K @ turn @ B, B.T @ K @ B, eigvals_only=True)[-1]))


@cache
def chain(friction, degree=4, rounds=5):
    """Results of the plate on meshes bisected where the bound says so."""
    problem, found = compressed_plate(friction, (1, 1)), []
    for _ in range(rounds):
        found.append(solve(problem, degree=degree, tolerance=1e-10))
        problem = replace(problem, mesh=problem.mesh.refined(bulk(found[-1].bracket.coulomb.cells)))
    return found


@pytest.mark.parametrize("friction", [0.1, 0.2])
def test_true_errors_of_adaptive_meshes_are_below(friction):
    results = chain(friction)
    for result in results[1:-2]:
        found = result.bracket.coulomb
        assert found.guaranteed, found.reasons
        assert 1.0 <= found.error / energy_apart(result, results[-1]) < 3.0
    assert results[-1].bracket.coulomb.relative_error < 0.5 * results[0].bracket.coulomb.relative_error


def carrying(result, z):
    """The same result with another stress."""
    return ContactResult(result.discretization, replace(result.solution, z=z))


def test_stresses_made_bad_at_random_are_never_closer_than_said():
    """Admissible stresses between that of less friction, disturbed at random, and the solution."""
    result, fine = chain(0.2)[2], chain(0.2)[-1]
    random, qvi = np.random.default_rng(1), result.discretization.qvi
    problem = result.problem
    weaker = [solve(with_law(problem, friction=mu), degree=4) for mu in (0.02, 0.1, 0.18)]
    ratios = []
    for number in range(examples(4)):
        z = weaker[number % 3].solution.z
        step = random.standard_normal(len(z)) * np.abs(z).max() * 10.0 ** random.uniform(-4.0, 0.0)
        while (
            max(np.max(s := qvi.N @ (z + step) + qvi.n0), np.max(abs(qvi.T @ (z + step) + qvi.t0) + qvi.mu * s)) > 0.0
        ):
            step *= 0.5
        share = random.uniform(0.0, 1.0) ** 3
        stress = carrying(result, result.solution.z + share * (z + step - result.solution.z))
        ratios.append(stress.bracket.coulomb.error / energy_apart(stress, fine))
    assert min(ratios) >= 1.0
    assert max(ratios) < 8.0


def test_pressures_give_way_one_after_another_until_the_share_is_continuous():
    """On this wall seven at first, then one more each time; another order of the triangles needed one time less."""
    assert solve(load_problem(EXAMPLES / "dry_stone_wall.toml").problem).bracket.coulomb_reason == ""


def test_a_pin_in_its_bore():
    """Its pressure stops it. Far from it displacements may slip either way, and s is 0: else the norm is above 2."""
    problem = load_problem(EXAMPLES / "lug.toml").problem
    result, fine = solve(problem, degree=3), solve(problem, degree=5)
    assert bounds_met(result, fine, 10.0, "bore.normal_force").forces["bore.normal_force"].lower > 0.0


@pytest.mark.parametrize("remainder", [0.0, 3e-10], ids=["open", "what solvers leave"])
def test_a_corner_far_from_an_obstacle(remainder):
    """There s vanishes, but displacements may slip; a faint pressure is none of contact."""
    plate = compressed_plate(0.2, (2, 2))
    beside = [Contact("right", 0.2, gap=2e-3) if each.edges == "right" else each for each in plate.conditions]
    found = solve(replace(plate, conditions=beside), degree=4)
    qvi, z = found.discretization.qvi, found.solution.z
    rows, pressed = np.vstack([part.toarray() for part in (qvi.N, qvi.T, qvi.A)]), found.discretization.contacts[0].rows
    pressure = np.where(np.isin(np.arange(len(rows)), np.r_[pressed]), -remainder * np.abs(qvi.N @ z).max(), 0.0)
    bounds = carrying(found, z + np.linalg.lstsq(rows, pressure, rcond=None)[0]).bracket
    assert bounds.relative_error < 0.3
    lower, upper = bounds.forces["plate.normal_force"]
    assert 200.0 < lower < 214.235 < upper < 220.0


def with_law(problem, **law):
    """The problem with other data of its contacts."""
    conditions = [replace(each, **law) if isinstance(each, Contact) else each for each in problem.conditions]
    return replace(problem, conditions=conditions)


class TestScope:
    """What has bounds under friction."""

    def test_friction_may_be_a_function_of_one_value(self):
        """As formulas of constants are in files."""
        problem = compressed_plate(0.2, (2, 2))
        found = solve(with_law(problem, friction=lambda x, _: 0.2 + 0.0 * x)).bracket.coulomb
        assert found.error == pytest.approx(solve(problem).bracket.coulomb.error, rel=1e-6)
        lifted = replace(problem, mesh=replace(problem.mesh, vertices=problem.mesh.vertices * (1.0 + 1e-15)))
        assert solve(with_law(lifted, friction=lambda _, y: 1.0 - y)).bracket.guaranteed  # 0 but for −1e-15

    def test_shares_are_continuous_where_a_contact_begins_to_open(self):
        """On the last edge that touches pressure falls to nothing: what bears nothing there must not carry a jump."""
        mesh = TriangleMesh.rectangle((12, 4), 2.0, 1.0)
        contact = Contact("bottom", 0.8, gap=Polynomial([[0.0275], [0.0185]]))
        loads = [Displacement("top", -0.0185, -0.08), *FREE]
        result = solve(ContactProblem(mesh, Material(1.0, 0.3, "stress"), [contact, *loads]), degree=6)
        values = result.bracket.coulomb.shares["bottom"].at(np.array([0.0, 1e-4, 1.0 - 1e-4, 1.0]))
        assert max(np.abs(values[:, 1] - values[:, 0]).max(), np.abs(values[:, 3] - values[:, 2]).max()) < 1e-3

    def test_what_bears_little_between_two_takes_the_mean_of_their_shares(self):
        """Neither end of an edge is preferred: mirrored bodies have mirrored shares. Pulls have none."""
        qvi = (result := solve(compressed_plate(0.3, (1, 1)), degree=4)).discretization.qvi
        rows, pressure = np.vstack([qvi.N.toarray(), qvi.T.toarray()]), np.array([1.0, 1e-3, 1.0])
        wanted = np.concatenate([-pressure - qvi.n0, -0.3 * pressure * [0.2, 0.0, 0.6] - qvi.t0])
        pressed, pulled = (sign * np.linalg.lstsq(rows, wanted, rcond=None)[0] for sign in (1.0, -1.0))
        assert carrying(result, pressed).bracket.coulomb.shares["plate"].values[0] == pytest.approx([0.2, 0.4, 0.6])
        assert "does not obey the law of contact 'plate'" in carrying(result, pulled).bracket.coulomb_reason

    def test_rounding_does_not_decide_where_a_share_may_change(self):
        """Inside of an edge that sticks a coefficient of s is 1, up to what solvers leave."""
        result, random = solve(pressed_block(0.3, (4, 4)), degree=5), np.random.default_rng(0)
        error, z = result.bracket.coulomb.error, result.solution.z
        for _ in range(3):
            disturbed = carrying(result, z + 1e-10 * np.abs(z).max() * random.standard_normal(len(z)))
            assert disturbed.bracket.coulomb.error == pytest.approx(error, rel=1e-5)

    def test_pressure_where_displacements_leave_the_obstacle_counts(self):
        """δ = ∫ |τ_N| (g − v_N) ds, on a contact that opens inside an edge."""
        mesh, gap = TriangleMesh.rectangle((4, 2), 2.0, 1.0), Polynomial([[0.0275], [0.0185]])
        loads = [Displacement("top", -0.0185, -0.045), *FREE]
        problem = ContactProblem(mesh, Material(1.0, 0.3), [Contact("bottom", 0.8, gap=gap), *loads])
        found, (t, weights) = solve(problem, degree=3, tolerance=1e-10).bracket.coulomb, gauss_legendre(6)
        x, y = mesh.points_along(edges := mesh.edges("bottom"), t)
        opening = gap(x, y) - found.displacement.trace("bottom", t)[0]
        defect = -edges.length @ (found.stress.stress(x, y)[..., 1] * opening) @ weights
        assert 0.0 < found.defect == pytest.approx(defect, rel=1e-6)

    def test_forces_beside_a_bond(self):
        """As on a mesh of 16² cells. Under a cap of friction nothing is bounded. Data may be numbers of NumPy."""
        free = compressed_plate(np.float64(0.2), (2, 2))
        assert "without a limit" in solve(with_law(free, shear_limit=50.0)).bracket.coulomb_reason
        bonded = [Contact.tresca("right", 5.0) if each.edges == "right" else each for each in free.conditions]
        found = solve(replace(free, conditions=bonded), degree=4).bracket.coulomb
        lower, upper = found.forces["plate.normal_force"]
        assert lower < 232.170329 < upper < lower + 1.0
        both = replace(free, conditions=[replace(bonded[2], shear_limit=4.0), *bonded[:2], bonded[3]])
        assert solve(both, degree=4).bracket.coulomb.forces == {}

    @pytest.mark.parametrize(("x", "y", "what"), [(1e-3, 0.0, "the slip condition"), (0.0, -1e-3, "the obstacle")])
    def test_supports_that_contradict_the_contact_are_named(self, x, y, what):
        """In the corner where the side that they hold meets the contact, or the top: no displacement is admissible."""
        held = [Displacement("left", x=x, y=y), Displacement("top", x=x, y=-0.05), Displacement("right", x=-x / 2.0)]
        held.append(Traction("right", y=0.0))
        mesh = TriangleMesh.rectangle((1, 2), 2.0, 1.0)  # with one edge, which would slip both ways
        result = solve(ContactProblem(mesh, Material(1.0, 0.3), [Contact("bottom", 0.5), *held]), degree=4)
        assert any("0) a support and the obstacle of 'bottom'" in said for said in result.remarks) is (y < 0.0)
        found = result.bracket
        assert found.coulomb is None
        for said in (f"{what} of 'bottom' at (0, 0)", "disagree at (0, 1)"):
            assert said in found.coulomb_reason
        assert found.upper == found.relative_error == np.inf

    @pytest.mark.parametrize(("friction", "across"), [(0.2, 0.0), (0.05, 1e-3)])
    def test_a_side_that_moves_along_the_contact(self, friction, across):
        """Its corner slips, whatever the stress and edges beside it say. Forces are those that the law allows."""
        contact = Contact("bottom", friction, offset=Polynomial([[0.0], [0.05]]))  # else it slips the other way
        conditions = [contact, Displacement("left", 1e-3, across), Traction("top", 0.0, -0.1), FREE[1]]
        problem = ContactProblem(TriangleMesh.rectangle((4, 2), 2.0, 1.0), Material(1.0, 0.3), conditions)
        result, finer = solve(problem, degree=4), problem.mesh.graded([(0.0, 0.0), (2.0, 0.0), (0.0, 1.0)], 5)
        found = bounds_met(result, solve(replace(problem, mesh=finer), degree=5), 5.0)
        if across:
            pressure, shear = (found.forces[f"bottom.{name}"] for name in ("normal_force", "tangential_force"))
            assert 0.0 == pressure.lower < 0.159 < pressure.upper
            assert shear == pytest.approx((-friction * pressure.upper, friction * pressure.upper), rel=1e-12)

    def test_the_stress_of_more_friction(self):
        """What is beyond the bound of friction is taken off it, and counts."""
        more, result = chain(0.2)[1], solve(with_law(chain(0.2)[1].problem, friction=0.15), degree=4)
        fine = solve(with_law(chain(0.2)[-1].problem, friction=0.15), degree=4)
        found = bounds_met(given := carrying(result, more.solution.z), fine, 10.0)
        assert found.moved > 0.1 * found.error
        assert found.moved == pytest.approx(energy_apart(given, found.stress), rel=1e-9)
        assert found.size**2 == pytest.approx(2.0 * found.stress.energies.strain, rel=1e-9)


@pytest.mark.parametrize(("friction", "limit"), [(0.1, 212.242424), (0.2, 214.23323205)])
def test_forces_of_the_plate_on_every_mesh(friction, limit):
    forces = [result.bracket.coulomb.forces["plate.normal_force"] for result in chain(friction)]
    assert all(force.lower < limit < force.upper for force in forces)
    assert np.diff(forces[-1]) < 0.25 * np.diff(forces[0])


def test_loads_that_cancel_each_other_leave_rounding():
    """A block lifted by all of its weight but 2, which its base carries."""
    sides = [Displacement("left", x=0.0), Traction("left", y=0.0), FREE[1], Traction("top", x=0.0, y=1e6 - 1.0)]
    block = TestFrictionAlone.block(0.3, 0.0)
    block = replace(block, conditions=[*block.contacts, *sides], body_potential=Polynomial([[0.0, 1e6]]))
    force = solve(block, degree=4).bracket.coulomb.forces["bottom.normal_force"]
    assert force.lower <= 2.0 <= force.upper < 2.0 + 1e-4


def test_cohesion_counts_where_it_slips():
    problem = with_law(compressed_plate(0.1, (4, 4)), cohesion=8.0)
    bounds_met(solve(problem, degree=4), solve(problem, degree=6), 4.0, "plate.normal_force")


class TestOtherBodies:
    """Bodies without a proved norm: estimated bounds, and none where there is no friction operator."""

    @pytest.mark.parametrize(("friction", "kind"), [(0.3, "guaranteed"), (1.0, "estimated")])
    def test_ssnv128(self, friction, kind):
        """Balance gives the normal force, with cohesion too; with μ = 1 the plate opens, slips and sticks."""
        problem = ssnv128((4, 4), friction=friction)
        found = solve(problem, degree=4).bracket.coulomb
        assert found.kind == kind
        assert found.relative_error < 0.08
        force = found.forces["base.normal_force"]
        assert force.lower <= 2.0e6 <= force.upper
        bound = solve(with_law(problem, cohesion=1e6), degree=4).bracket.coulomb.forces["base.normal_force"]
        assert bound == pytest.approx((2.0e6, 2.0e6), rel=1e-9)
        assert "base.tangential_force" not in found.forces  # friction of the end that symmetry holds has no bound

    def test_arcs(self):
        """Nothing is proved on a body with arcs; a contact that is one has estimated bounds."""
        chords = half_disc(0.1, (4e-3, -2e-3))
        disc = replace(chords, mesh=chords.mesh.with_arc("flank", (0.0, 0.0), 1.0).with_arc("crown", (0.0, 0.0), 1.0))
        assert friction_norm(chords, shared(chords, 1.0)).proved
        assert not friction_norm(disc, shared(disc, 1.0)).proved
        pressed = [Contact("crown", 0.1, gap=-2e-3, offset=4e-3), Displacement("base", x=0.0, y=0.0)]
        turned = replace(disc, conditions=[*pressed, Traction("flank", x=0.0, y=0.0)])
        forces = "crown.normal_force", "crown.tangential_force"
        assert bounds_met(solve(turned, degree=4), solve(turned, degree=6), 1.7, *forces).kind == "estimated"

    @pytest.mark.parametrize("change", ["kink", "held end"])
    def test_where_the_share_must_vanish(self, change):
        """At a kink, and where the normal displacement is held at an end: it costs little where the contact sticks."""
        problem = pressed_block(1.5, (4, 2) if change == "kink" else (8, 4))
        mesh, conditions, place = problem.mesh, problem.conditions, np.array([1.0, 0.0])
        if change == "kink":
            x, y = mesh.vertices.T
            place = np.array([1.0, -0.1])
            mesh = replace(mesh, vertices=np.column_stack([x, y - 0.1 * (1.0 - y) * np.minimum(x, 2.0 - x)]))
        else:
            mesh = mesh.with_edges("base", lambda x, y: (y == 0.0) & (x > 1.0))
            mesh = mesh.with_edges("rail", lambda x, y: (y == 0.0) & (x < 1.0))
            beside = [Contact("base", 1.5, name="bottom"), Displacement("rail", y=0.0), Traction("rail", x=0.0)]
            conditions = [*beside, *conditions[1:]]
        problem = ContactProblem(mesh.graded([place], 6), problem.material, conditions)
        result, edges = solve(problem, degree=4), problem.mesh.edges(problem.contacts[0].edges)
        found = bounds_met(result, solve(problem, degree=6), 10.0)
        share = found.shares["bottom"].at(np.array([0.0, 1.0]))
        for end, vertices in enumerate((edges.first, edges.second)):
            at = np.abs(problem.mesh.vertices[vertices] - place).max(axis=1) < 1e-9
            assert (share[at, end] == 0.0).all()
        assert found.relative_error < 0.15
        assert "bottom.normal_force" not in found.forces  # no z is 1 along both normals, or beside what holds it

    def test_a_kink_that_slips_is_named(self):
        layer = sheared_layer(0.3)
        x, y = layer.mesh.vertices.T
        bent = np.column_stack([x, y - 0.1 * (1.0 - y) * np.minimum(x, 4.0 - x)])
        found = solve(replace(layer, mesh=replace(layer.mesh, vertices=bent)), degree=4).bracket.coulomb
        assert "At (2, -0.2) 'base' has a kink, or meets other friction" in found.message


def pressed_block(friction, cells=(8, 4), **law):
    """A block whose top is held and pressed down: its base slips outwards at both ends, or sticks."""
    conditions = [Contact("bottom", friction, **law), Displacement("top", x=0.0, y=-0.1), *FREE]
    return ContactProblem(TriangleMesh.rectangle(cells, 2.0, 1.0), Material(1.0, 0.3), conditions)


@pytest.mark.parametrize(
    ("friction", "plate", "degree"),
    [(0.2, RigidPlate(force_y=-0.1, x=0.01, moment=0.0, pivot=(1.0, 1.0)), 5),
     (0.5, RigidPlate(force_y=-0.1, force_x=0.01), 6)],
)  # fmt: skip
def test_a_block_under_a_plate_that_forces_drive(friction, plate, degree):
    """It moves down and turns, or friction alone holds it; balance gives forces, a finer mesh errors of the stress."""
    conditions = [Contact("top", friction, name="plate", plate=plate), Displacement("bottom", x=0.0, y=0.0), *FREE]
    problem = ContactProblem(TriangleMesh.rectangle((4, 2), 2.0, 1.0), Material(1.0, 0.3), conditions)
    result = solve(problem, degree=4)
    fine = solve(replace(problem, mesh=problem.mesh.graded([(0.0, 1.0), (2.0, 1.0)], 6)), degree=degree)
    if plate.force_x is not None:
        assert bounds_met(result, fine, 3.0).reach > 1.0
        return
    found = bounds_met(result, fine, 3.0, "plate.tangential_force")
    assert found.forces["plate.normal_force"] == pytest.approx((0.1, 0.1), rel=1e-6)


class TestFrictionAlone:
    """Bodies that friction alone holds along their contacts."""

    @staticmethod
    def block(friction, push, cells=(4, 2)):
        """A block on the ground, pressed down and pushed along it."""
        loads = [Traction("top", x=push, y=-1.0), *FREE]
        mesh = TriangleMesh.rectangle(cells, 2.0, 1.0)
        return ContactProblem(mesh, Material(1.0, 0.3, "stress"), [Contact("bottom", friction), *loads])

    @staticmethod
    def column(height):
        """A slender column, whose foot slips with little strain."""
        mesh, top = TriangleMesh.rectangle((2, int(4.0 * height)), 1.0, height), 0.01 * height * np.array([0.5, -5.0])
        return ContactProblem(mesh, Material(1.0, 0.3), [Contact("bottom", 0.3), Displacement("top", *top), *FREE])

    @staticmethod
    def clamped(friction):
        """A slender column that jaws clamp at its foot, held at its top."""
        mesh = TriangleMesh.rectangle((2, 8), 1.0, 4.0).with_edges("sides", lambda x, y: (x % 1.0 == 0.0) & (y > 2.0))
        mesh = mesh.with_edges("jaw", lambda x, y: (x == 0.0) & (y < 2.0))
        mesh = mesh.with_edges("other", lambda x, y: (x == 1.0) & (y < 2.0))
        jaws = [Contact("jaw", friction), Contact("other", friction, gap=-0.05), Traction("sides", x=0.0, y=0.0)]
        held = [Displacement("top", x=0.025, y=0.02), Traction("bottom", x=0.0, y=0.0)]
        return ContactProblem(mesh, Material(1.0, 0.3), [*jaws, *held])

    @staticmethod
    def plate(friction):
        """A whole plate between two platens."""
        contacts = [Contact("bottom", friction), Contact("top", friction, gap=-0.1)]
        mesh = TriangleMesh.rectangle((4, 4), 2.0, 2.0)
        return ContactProblem(mesh, Material(1.0, 0.3, "stress"), [*contacts, *FREE])

    @pytest.mark.parametrize(
        ("problem", "reach"),
        [(block(0.5, 0.1), 0.8), (block(0.3, 0.2), 0.2), (block(2.0, 0.1), 4.0), (plate(0.4), 0.4), (column(8.0), 0.4)],
    )
    def test_errors_and_forces_of_a_higher_degree_are_within(self, problem, reach):
        result, fine = solve(problem, degree=4), solve(problem, degree=6)
        found = bounds_met(result, fine, 1.85)
        assert reach < found.reach < 4.0 * reach
        for name in ("normal_force", "tangential_force"):
            force = found.forces[f"bottom.{name}"]
            assert force.lower - 1e-9 < getattr(fine.contacts["bottom"], name) < force.upper + 1e-9
        assert "Any two solutions with" in result.uniqueness.message
        assert ("slender" in found.message) == isinstance(problem.conditions[1], Displacement)

    @pytest.mark.parametrize("problem", [block(0.3, 0.25), clamped(0.3)])
    def test_what_stops_a_motion(self, problem):
        """M of (D39) is a part of all friction that is left where contacts stick, by another quadrature."""
        found = solve(problem, degree=4).bracket.coulomb
        stopped, shares = next(each for each in found.norm.stopped if len(each.masses)), found.shares
        (t, weights), unit, masses = gauss_legendre(8), found.stress.discretization.scales, []
        for name, share in shares.items():
            np.testing.assert_array_equal(share.room, 1.0 - np.abs(share.values))
            room = (share.room * share.weights) @ bernstein(2, t).T  # m B(τ) of all edges, in the unit of the weights
            masses.append(room @ weights @ problem.mesh.edges(name).length * unit.stress * unit.displacement)
        parts = stopped.masses / masses
        assert np.isclose(parts, [[1.0], [0.5], [0.25], [0.125]], rtol=1e-9).all(axis=1).any()
        within = 0.3 * stopped.reach  # |R d| of the shares by which motions are stopped, the largest over all senses
        most = within * stopped.images / (stopped.masses - within * stopped.images)
        ways = parts[0], -parts[0]
        both = [[replace(one, values=one.values + way * one.room) for way in ways] for one in shares.values()]
        works = [stopped.work(dict(zip(shares, each, strict=True)), within, 1.0) for each in product(*both)]
        assert max(works) == pytest.approx(most.max(), rel=1e-9)

    @pytest.mark.parametrize(
        "law", [{}, {"plate": RigidPlate(moment=0.0, x=0.0, y=0.0, pivot=(2.0, 0.7))}, {"friction": 0.1}]
    )
    def test_pressure_stops_what_slips(self, law):
        """A block that the ground drags against a wall, against a plate that turns, or up along a rough wall."""
        mesh = self.block(0.3, 0.0).mesh.with_edges("wall", lambda x, y: (x == 2.0) & (y > 0.5))
        mesh = mesh.with_edges("foot", lambda x, y: (x == 2.0) & (y < 0.5))
        contacts = [Contact("bottom", 0.15, offset=9.0), Contact("wall", **{"friction": 0.0, **law})]
        loads = [FREE[0], Traction("foot", 0.0, 0.0), Traction("top", 0.1, -1.0)]
        problem = ContactProblem(mesh, Material(1.0, 0.3), [*contacts, *loads])
        result, fine = solve(problem, degree=4), solve(replace(problem, mesh=mesh.refined()), degree=6)
        assert bounds_met(result, fine, 2.5, "wall.normal_force").reach > 0.2

    def test_where_pressure_stops_a_motion_that_turns_into_a_rigid_one(self):
        """Two blocks that the ground drags against a wall: what rounding leaves of its strain doubles no norm."""
        found = []
        for unit in (1.0, 7.0):
            mesh = TriangleMesh.rectangle((4, 2), 2.0 * unit, unit).with_joint("joint", lambda x, _: x == np.median(x))
            contacts = [Contact("bottom", 0.3, offset=9.0 * unit), Contact("joint", 0.0), Contact("right", 0.0)]
            problem = ContactProblem(mesh, Material(unit, 0.3), [*contacts, FREE[0], Traction("top", 0.0, -unit)])
            found.append(solve(problem, degree=4).bracket.coulomb.norm.value)
        assert found[1] == pytest.approx(found[0], rel=1e-6)

    def test_rounding_does_not_cut_contacts_into_pieces(self):
        """Pressure that is even, on three edges of a ground and of a wall: an edge may belong to two pieces."""
        sides = [Traction("left", x=0.0, y=0.0), Traction("top", x=0.1, y=-1.0)]
        contacts, mesh = [Contact("bottom", 0.1), Contact("right", 0.1)], TriangleMesh.rectangle((3, 3), 2.0, 1.0)
        problem, random = ContactProblem(mesh, Material(1.0, 0.3), [*contacts, *sides]), np.random.default_rng(0)
        uneven = (1.0 + 1e-13 * random.standard_normal((2, 3, 1)) * np.ones((2, 3, 3)) for _ in range(6))
        norms = [friction_norm(problem, shared(problem, 1.0), 1.0, {"bottom": a, "right": b}).value for a, b in uneven]
        assert norms == pytest.approx([norms[0]] * 6, rel=1e-9)

    def test_a_weak_bound_of_all_solutions_makes_a_sharp_one(self):
        result, fine = (solve(self.column(4.0), degree=degree) for degree in (4, 6))
        assert bounds_met(result, fine, 1.85, "bottom.normal_force", "bottom.tangential_force").reach == np.inf
        clamped = solve(problem := self.clamped(0.3), degree=4).bracket.coulomb  # bounds of forces are not wider
        norm, r, errors = clamped.norm, computed_norm(problem, clamped.shares), (clamped.residual, clamped.defect)
        assert norm.value < r < 2.0
        sizes = clamped.shares, *errors, clamped.within
        assert norm.slack(*sizes) <= defect_bound(*errors, r) * (1.0 + 1e-9)
        assert norm.work(problem, *sizes) <= r * clamped.within**2 * (1.0 + 1e-9)

    def test_what_keeps_its_distance_holds_as_a_support(self):
        block, support = self.block(0.3, 0.1), [Displacement("left", x=0.0), Traction("left", y=0.0)]
        held = [Contact("left", 0.0, law="bilateral")], support
        posed = (replace(block, conditions=[*block.conditions[:2], FREE[1], *each]) for each in held)
        first, second = (computed_norm(each, shared(each, 1.0)) for each in posed)
        assert first == pytest.approx(second, rel=1e-6)

    def test_where_nothing_sticks(self):
        """A force that friction can just bear: the message says what is missing."""
        found = solve(self.block(0.2, 0.2), degree=4)
        assert "neither a sticking part of 'bottom' nor pressure stops its motion. Errors" in found.bracket.message
        assert found.uniqueness.apart == np.inf
        pulled = [Contact("bottom", 0.2), Displacement("top", y=-0.01), Traction("top", x=0.0)]
        pulled += [Traction("right", 0.004, 0.0), FREE[0]]
        pulled = ContactProblem(TriangleMesh.rectangle((2, 2)), Material(1.0, 0.3), pulled)
        words = solve(pulled, degree=3).bracket.message.partition("no bound of the energy.")
        assert words[2].endswith("The result is not solved: inner infeasible.")
        assert "Here it is 2.16." in solve(self.block(2.0, 0.5), degree=4).bracket.message
        even = replace(self.block(0.5, 0.0), material=Material(1.0, 0.0))  # what would stop it is a rigid motion
        glued = replace(even, conditions=[Contact("bottom", 0.5, cohesion=1e30), *even.conditions[1:]])
        assert [solve(each, degree=4).bracket.coulomb.reach for each in (even, glued)] == [np.inf, np.inf]


@pytest.mark.parametrize("friction", [0.1, 0.8])
def test_a_block_that_slips_outwards_at_both_ends_or_sticks(friction):
    result = solve(pressed_block(friction), degree=4)
    mesh = result.problem.mesh.graded([(0.0, 0.0), (2.0, 0.0), (0.0, 1.0), (2.0, 1.0)], 5)
    found = bounds_met(result, solve(replace(result.problem, mesh=mesh), degree=5), 1.5, "bottom.normal_force")
    assert found.norm.value < 0.41
    assert result.uniqueness.apart == found.apart < 0.07
    assert result.uniqueness.certainty == "estimate"


@pytest.mark.parametrize("problem", [pressed_block(0.2, (4, 2)), TestFrictionAlone.block(0.5, 0.1)])
def test_what_is_tied_holds_as_a_support_or_one_body_does_and_two_parts_of_a_contact_as_one(problem):
    """Displacements are the same where the parts meet."""
    base, top, *others = problem.conditions
    mesh = problem.mesh.with_edges("a", lambda x, y: (y == 0.0) & (x < 1.0))
    mesh = mesh.with_edges("b", lambda x, y: (y == 0.0) & (x > 1.0))
    parts = [replace(base, edges=name, name=name) for name in "ab"]
    tied = Contact.tied("top", gap=-0.1) if isinstance(top, Displacement) else top
    mesh, bond = mesh.with_joint("bond", lambda _, y: y == 0.5), Contact.tied("bond")
    listed = problem.conditions, [*parts, top, *others], [base, tied, *others], [*problem.conditions, bond]
    found = [solve(replace(problem, mesh=mesh, conditions=each)).bracket for each in listed]
    one, *more = ((each.coulomb.error, each.coulomb.norm.value, each.coulomb.reach) for each in found)
    assert more == [pytest.approx(one, rel=1e-4)] * 3
    assert (found[3].lower, found[3].upper) == pytest.approx((found[0].lower, found[0].upper), rel=1e-6)
    for name in ("bottom.normal_force", "bottom.tangential_force"):
        assert found[2].forces[name] == pytest.approx(found[0].forces[name], rel=1e-6, abs=1e-9)
