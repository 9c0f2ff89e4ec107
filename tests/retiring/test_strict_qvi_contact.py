"""Friction bound and unilateral contact on whole edges: admissible everywhere, and close to the law at Gauss points."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from qvi_contact import (
    Contact,
    ContactProblem,
    Displacement,
    InputError,
    Material,
    RectilinearMesh,
    RigidPlate,
    Symmetry,
    Traction,
    discretize,
    solve,
    solve_history,
)
from qvi_contact.gallery import compressed_plate, sliding_block, ssnv128, stick_slip_block
from qvi_contact.solution import between_points
from solvers import Status, certify, solve_qvi
from solvers.fixed_point.forms import make_form
from solvers.inequality.edges import affine_basis, quadratic_basis
from solvers.inner.registry import make_inner
from solvers.strict.threshold import strict_pressure, strict_threshold
from tests.effort import thinned
from tests.qvi_contact.states import solved

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # cones on rectangles

DIRECT, CVXPY = "strict-direct:clarabel", "strict:clarabel"
MEAN = 209.0
T = np.linspace(0.0, 1.0, 1000)
GAUSS = (np.polynomial.legendre.leggauss(4)[0] + 1.0) / 2.0


def along(values, degree):
    """Values (1000, edges) along each edge of the polynomials through values at the Gauss points."""
    groups = values.reshape(-1, 4)
    fit = [np.polynomial.Polynomial.fit(GAUSS, row, degree, domain=[0.0, 1.0])(T) for row in groups]
    return np.array(fit).T


def brute_force(line, law="unilateral"):
    """Largest excess over the bound and largest pull at 1000 points of each edge; μ cubic, c and t_max constant."""
    normal, shear = along(line.normal_stress, 1), along(line.tangential_stress, 2)
    pressure = np.maximum(-normal, 0.0) if law == "unilateral" else np.abs(normal)
    bound = along(line.friction, 3) * pressure
    return max(float((np.abs(shear) - bound).max()), 0.0), max(float(normal.max()), 0.0) * (law == "unilateral")


def shear_excess(qvi, z):
    """Largest |σ_T| − μ|σ_N| at 1000 points of each edge, over the mean pressure; μ constant."""
    normal = affine_basis(T) @ qvi.edges.ends(qvi.normal(z)).T
    shear = quadratic_basis(T) @ qvi.edges.bernstein(qvi.tangential(z)).T
    return float((np.abs(shear) + qvi.mu[::4] * normal).max()) * qvi.W.sum() / -qvi.resultant(z)


def with_given_bound(problem):
    """The strict problem with the bound of the bonded body's pressure, and its Bernstein coefficients (3e,)."""
    qvi = discretize(problem).qvi.strictly()
    theta = strict_threshold(qvi, strict_pressure(qvi, qvi.normal(qvi.bonded))).coefficients
    return qvi.changed(mu=0 * qvi.mu, cohesion=qvi.edges.at_points(theta)), theta.ravel()


def force(result):
    assert result.status is Status.SOLVED, result.message
    return result.contacts["plate"].normal_force


class TestPlate:
    """The paper's plate."""

    @pytest.mark.parametrize(
        ("friction", "grading"), thinned(product((0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 1.0), (1.0, 0.8)), 8)
    )
    def test_admissible_everywhere(self, friction, grading):
        for cells in (2, 4, 8) if grading == 1.0 else (6,):
            result = solved(compressed_plate(friction, (cells, cells), grading=grading), inner=DIRECT)
            qvi, z = result.solution.problem, result.solution.z
            assert shear_excess(qvi, z) <= 1e-8
            assert qvi.edges.ends(qvi.normal(z)).max() <= 1e-8
            assert result.certificate.accuracy <= 1e-10
            assert result.contacts["plate"].excess_between_points <= 1e-8 * MEAN

    def test_fine_mesh(self):
        result = solved(compressed_plate(0.2, (32, 32)), inner=DIRECT)
        assert shear_excess(result.solution.problem, result.solution.z) <= 1e-8

    @pytest.mark.parametrize("friction", [0.1, 0.25])
    def test_cvxpy_and_the_direct_path_agree(self, friction):
        problem = discretize(compressed_plate(friction, (8, 8), grading=0.8))
        direct, through = (solved(problem, inner=inner) for inner in (DIRECT, CVXPY))
        assert force(through) == pytest.approx(force(direct), rel=1e-9)
        ours, theirs = direct.contacts["plate"], through.contacts["plate"]
        assert theirs.tangential_stress == pytest.approx(ours.tangential_stress, abs=1e-7 * MEAN)
        assert (theirs.state == ours.state).all()

    @pytest.mark.parametrize("inner", [DIRECT, CVXPY])
    @pytest.mark.parametrize(("cells", "grading"), [((4, 4), 1.0), ((6, 6), 0.8)])
    def test_inner_results_agree_and_pass_the_certificate(self, inner, cells, grading):
        """For a given bound, before any Newton step, and that bound with other rounding: tractions and certificate.

        A gap of 1e-15 leaves errors of 1e-7 in tractions and 1e-10 in forces; ten times as much is allowed.
        """
        given, theta = with_given_bound(compressed_plate(0.2, cells, grading=grading))
        form, rng = make_form(given, "condensed"), np.random.default_rng(0)
        rounded = theta * (1.0 + 1e-13 * rng.standard_normal((10, theta.size)))
        reference = make_inner(DIRECT, form.problem, 1e-12).solve(theta, form.centre(None, None), None)
        expected, solver = form.expand(reference), make_inner(inner, form.problem, 1e-12)
        tangential = given.tangential(expected.z)
        for bound in rounded:
            result = solver.solve(bound, form.centre(None, None), None)
            assert result.status is Status.SOLVED, result.message
            found = form.expand(result)
            certificate = certify(given, found.z, found.m_N, found.m_T, found.nu, 1e-8)
            assert certificate.passed, certificate.explain()
            assert certificate.measures["natural_map"] <= 1e-7
            assert given.resultant(found.z) == pytest.approx(given.resultant(expected.z), rel=1e-9)
            assert given.tangential(found.z) == pytest.approx(tangential, abs=1e-6 * np.abs(tangential).max())

    @pytest.mark.parametrize("cells", [2, 4, 8, 16])
    def test_energy_is_never_below_that_with_the_bound_at_points(self, cells):
        """For one given bound the strict stresses are a subset."""
        qvi = discretize(compressed_plate(0.1, (cells, cells))).qvi
        given = qvi.changed(mu=0 * qvi.mu, cohesion=0.1 * qvi.pressure(qvi.bonded))
        loose, strict = solve_qvi(given), solve_qvi(given, inner=DIRECT)
        assert loose.solved
        assert strict.solved
        assert given.energy(strict.z) > given.energy(loose.z) * (1.0 + 1e-12 * np.sign(given.energy(loose.z)))
        assert given.energy(strict.z) == pytest.approx(given.energy(loose.z), rel=1e-3)

    def test_equal_at_full_stick(self):
        problem = discretize(compressed_plate(1.0, (8, 8)))
        assert force(solve(problem, inner=DIRECT)) == pytest.approx(force(solve(problem)), rel=1e-10)
        assert solve(problem).contacts["plate"].excess_between_points == 0.0

    @pytest.mark.parametrize("friction", thinned([0.05, 0.1, 0.2], 1))
    def test_both_forces_converge_to_each_other(self, friction):
        """At about first order, in the end: what the corner's singularity allows on uniform meshes."""
        differences = []
        for count in (8, 16, 32):
            problem = discretize(compressed_plate(friction, (count, count)))
            differences.append(abs(force(solve(problem, inner=DIRECT)) - force(solve(problem))) / MEAN)
        orders = np.log2(np.array(differences[:-1]) / differences[1:])
        print(f"mu = {friction}: differences {differences}, orders {orders}")
        assert differences[-1] < 1e-4
        assert orders.min() > 0.6
        assert orders[-1] > 0.85

    def test_units_and_images(self):
        """Mirrored, turned and in other units: the same state."""
        original = solved(compressed_plate(0.12, (5, 4), 1.5, 1.0, grading=0.8), inner=DIRECT)
        x, y, material = original.problem.mesh.x, original.problem.mesh.y, Material(2.09e5, 0.3)
        plate = original.contacts["plate"]

        def turned(lines, sides, unit=1.0):
            first, second, free, contact = sides
            body = Material(unit * material.young, material.poisson)
            conditions = [Symmetry(first), Symmetry(second), Traction(free, x=0.0, y=0.0)]
            conditions.append(Contact(contact, friction=0.12, gap=-1e-3, name="plate"))
            mesh = RectilinearMesh(*lines)
            return solved(ContactProblem(mesh, body, conditions), inner=DIRECT).contacts["plate"]

        mirrored = turned((-x[::-1], y), ("right", "bottom", "left", "top"))
        assert mirrored.tangential_stress[::-1] == pytest.approx(-plate.tangential_stress, abs=1e-8 * MEAN)
        quarter = turned((-y[::-1], x), ("bottom", "right", "top", "left"))
        assert quarter.normal_stress == pytest.approx(plate.normal_stress, abs=1e-8 * MEAN)
        assert np.abs(quarter.tangential_stress) == pytest.approx(np.abs(plate.tangential_stress), abs=1e-8 * MEAN)
        assert quarter.slip == pytest.approx(plate.slip * np.sign(quarter.slip @ plate.slip), abs=1e-11)
        softer = turned((x, y), ("left", "bottom", "right", "top"), unit=1e-3)
        assert 1e3 * softer.tangential_stress == pytest.approx(plate.tangential_stress, abs=1e-8 * MEAN)


class TestBetweenPoints:
    """What a result says about the places between Gauss points."""

    @pytest.mark.parametrize(
        ("problem", "law"),
        [
            (compressed_plate(0.1, (4, 4)), "unilateral"),
            (compressed_plate(lambda x, y: 0.05 + 0.2 * x + 0 * y, (4, 4)), "unilateral"),
            (compressed_plate(lambda x, y: 0.1 + 0.1 * np.sin(4 * x) + 0 * y, (4, 4)), "unilateral"),
            (ssnv128((8, 8)), "unilateral"),
            (ssnv128((8, 8), friction=lambda x, _: 1.0 + 20.0 * x**3), "unilateral"),
        ],
        ids=["constant", "affine", "sine", "opening", "opening, cubic"],
    )
    def test_against_brute_force(self, problem, law):
        result = solved(problem)
        (line,) = result.contacts.values()
        excess, pull = brute_force(line, law)
        scale = np.abs(line.tangential_stress).max()
        assert line.excess_between_points == pytest.approx(excess, abs=1e-5 * scale)
        assert line.excess_between_points >= excess - 1e-12 * scale
        assert line.pull_between_points == pytest.approx(pull, abs=1e-9 * scale)
        assert line.excess_between_points > 1e-4 * scale  # these have some
        (strict,) = solved(problem, inner=DIRECT).contacts.values()
        assert strict.excess_between_points <= 1e-9 * scale
        assert strict.pull_between_points <= 1e-9 * scale

    def test_a_pull(self):
        (line,) = solved(ssnv128((8, 8))).contacts.values()
        assert line.pull_between_points == pytest.approx(brute_force(line)[1], rel=1e-9)
        assert line.pull_between_points > 1e4

    @pytest.mark.parametrize(("pressed", "dragged"), [(1.0, 1.0), (1.0, 1.2), (-1.0, 1.0)], ids=["", "excess", "pull"])
    def test_bernstein_coefficients_say_the_same_as_roots(self, monkeypatch, pressed, dragged):
        """Where they obey the law nothing is looked for; where they do not, on edges of a state made wrong, it is."""
        result = solve(compressed_plate(0.1, (4, 4)).triangulated(), degree=5)
        (rows,), line = result.discretization.contacts, result.contacts["plate"]
        state = rows, pressed * line.normal_stress, dragged * line.tangential_stress
        known = between_points.between_points(*state)
        none = np.zeros(len(rows.points.edges), dtype=bool)
        monkeypatch.setattr(between_points, "_by_coefficients", lambda *_: (none, np.zeros((4, 2))))
        looked_for = between_points.between_points(*state)
        for one, other in zip(known, looked_for, strict=True):
            assert one == pytest.approx(other, abs=1e-12 * MEAN)
        assert (known.excess.max() > 1.0) == (dragged > 1.0 or pressed < 0.0)
        assert (known.pull.max() > 1.0) == (pressed < 0.0)

    def test_bilateral_capped_and_tied(self):
        result = solved(many_laws())
        for name, law in (("ground", "unilateral"), ("rail", "bilateral")):
            line = result.contacts[name]
            normal, shear = along(line.normal_stress, 1), along(line.tangential_stress, 2)
            pressure = np.abs(normal) if law == "bilateral" else np.maximum(-normal, 0.0)
            bound = 0.5 + 0.2 * pressure if name == "ground" else 0.2 + 0.1 * pressure
            bound = np.minimum(bound, 8.0 if name == "ground" else np.inf)
            excess = max(float((np.abs(shear) - bound).max()), 0.0)
            assert line.excess_between_points == pytest.approx(excess, abs=1e-3)  # a kink between two of the places
            assert line.excess_between_points >= excess - 1e-12
            assert line.excess_between_points > 0.1
        assert result.contacts["rail"].pull_between_points == 0.0
        tied = solved(
            ContactProblem(
                RectilinearMesh.rectangle((2, 2)),
                Material(1000.0, 0.3),
                [
                    Contact("bottom", 0.0, law="tied", name="glue"),
                    Traction("left", 0.0, 0.0),
                    Traction("right", 0.0, 0.0),
                    Traction("top", x=1.0, y=2.0),
                ],
            )
        ).contacts["glue"]
        assert (tied.excess_between_points, tied.pull_between_points) == (0.0, 0.0)


def many_laws():
    """Capped and cohesive ground, a rail that pulls and rubs, a plate driven by force, a joint."""
    mesh = RectilinearMesh([0.0, 0.3, 0.8, 1.5], [0.0, 0.3, 0.7, 1.0]).with_joint("bed", "horizontal", 0.7)
    conditions = [
        Contact("bottom", 0.2, cohesion=0.5, shear_limit=8.0, name="ground"),
        Contact("left", 0.1, law="bilateral", cohesion=0.2, name="rail"),
        Traction("right", x=lambda _, y: 16.0 * y * (1.0 - y), y=0.0),
        Contact("top", 0.3, plate=RigidPlate(force_y=-60.0, moment=-50.0), name="plate"),
        Contact("bed", 0.02, cohesion=0.3, name="bed"),
    ]
    return ContactProblem(mesh, Material(1000.0, 0.3), conditions)


class TestLaws:
    """All kinds of contact."""

    @pytest.mark.parametrize("form", ["full", "condensed"])
    def test_many_at_once(self, form):
        result = solved(many_laws(), inner=DIRECT, form=form)
        assert all(line.excess_between_points <= 1e-8 * 60.0 for line in result.contacts.values())
        assert result.contacts["plate"].normal_force == pytest.approx(60.0, rel=1e-9)
        assert any((line.state == 2).any() for line in result.contacts.values())

    def test_opening_slip_and_stick(self):
        """SSNV128: balance, and the friction force of the law at points within what the mesh resolves."""
        strict, loose = (solved(ssnv128((16, 16)), inner=inner) for inner in (DIRECT, None))
        base = strict.contacts["base"]
        assert base.normal_force == pytest.approx(2e6, rel=1e-9)
        assert base.tangential_force == pytest.approx(loose.contacts["base"].tangential_force, rel=2e-3)
        assert base.pull_between_points <= 1e-9 * 5e7
        assert set(base.state) == {0, 1, 2}

    @pytest.mark.parametrize("grading", [1.0, 0.85])
    def test_opening_on_other_meshes(self, grading):
        result = solved(ssnv128((8, 8), grading=grading), inner=CVXPY)
        assert result.contacts["base"].excess_between_points <= 1e-8 * 5e7

    def test_tresca(self):
        problem = ContactProblem(
            RectilinearMesh.rectangle((8, 8)),
            Material(2.09e5, 0.3),
            [
                Symmetry("left"),
                Symmetry("bottom"),
                Traction("right", x=0.0, y=0.0),
                Contact.tresca("top", 30.0, gap=-1e-3, name="plate"),
            ],
        )
        strict, loose = (solved(problem, inner=inner).contacts["plate"] for inner in (DIRECT, None))
        assert np.abs(along(strict.tangential_stress, 2)).max() <= 30.0 * (1.0 + 1e-12)
        assert np.abs(along(loose.tangential_stress, 2)).max() > 30.5
        assert strict.normal_force == pytest.approx(loose.normal_force, rel=1e-3)

    @pytest.mark.parametrize("cells", [(1, 1), (3, 2)])
    def test_exact_full_slip(self, cells):
        """The manufactured state is on the bound along the whole base: strict bounds do not change it."""
        built = sliding_block(cells=cells)
        result = solved(built[0] if isinstance(built, tuple) else built, inner=DIRECT)
        (line,) = result.contacts.values()
        assert line.tangential_stress == pytest.approx(0.3 * line.normal_stress, abs=1e-8 * 100)
        assert line.normal_stress == pytest.approx(np.full_like(line.x, -100.0), abs=1e-7)

    def test_manufactured_stick_and_slip_converges(self):
        """μ(x) of the exact state is no polynomial: the bound used is below it, by less on finer meshes."""
        errors = []
        for cells in ((4, 2), (8, 4), (16, 8)):
            built = stick_slip_block(cells=cells, transition=0.6)
            problem = built[0] if isinstance(built, tuple) else built
            strict, loose = (solved(problem, inner=inner) for inner in (DIRECT, None))
            (ours,), (theirs,) = strict.contacts.values(), loose.contacts.values()
            errors.append(abs(ours.tangential_force - theirs.tangential_force) / abs(theirs.tangential_force))
        assert errors[0] > errors[1] > errors[2]
        assert np.log2(errors[0] / errors[2]) / 2.0 > 1.5

    def test_remarks_say_where_the_bound_is_not_the_law(self):
        """μ that is affine is exact, one that is not is replaced by less on every edge where it rubs."""
        exact = solved(compressed_plate(lambda x, y: 0.1 + 0.1 * x + 0 * y, (3, 3)), inner=DIRECT)
        assert exact.remarks == ()
        curved = compressed_plate(lambda x, y: 0.1 + 0.1 * np.exp(-x) + 0 * y, (3, 3))
        (remark,) = solved(curved, inner=DIRECT).remarks
        assert "On 3 edges of 'plate'" in remark
        assert solved(curved).remarks == ()

    def test_earlier_results_and_load_steps(self):
        problem = discretize(compressed_plate(0.2, (4, 4)))
        first = solved(problem, inner=DIRECT)
        again = solved(problem, inner=DIRECT, initial=first)
        assert again.iterations <= first.iterations
        assert force(again) == pytest.approx(force(first), rel=1e-9)

    def test_load_steps(self):
        def sheared(offset):
            ground = Contact("bottom", friction=0.2, offset=offset, name="ground")
            sides = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
            mesh = RectilinearMesh.rectangle((4, 2), 2.0, 1.0)
            return ContactProblem(mesh, Material(1e4, 0.2), [ground, *sides, Displacement("top", x=0.0, y=-2e-3)])

        steps = [sheared(offset) for offset in (0.0, 2e-3, 0.0, -2e-3)]
        strict, loose = (solve_history(steps, inner=inner) for inner in (DIRECT, None))
        for ours, theirs in zip(strict.steps, loose.steps, strict=True):
            assert ours.status is Status.SOLVED
            assert ours.contacts["ground"].excess_between_points <= 1e-8 * 20.0
            assert ours.contacts["ground"].tangential_force == pytest.approx(
                theirs.contacts["ground"].tangential_force, abs=0.02 * 8.0
            )

    def test_a_load_that_nothing_carries(self):
        drag = [Traction("top", x=4.0, name="drag"), Traction("left", x=0.0, y=-4.0), Traction("right", x=0.0, y=4.0)]
        problem = ContactProblem(
            RectilinearMesh.rectangle((4, 2), width=2.0, height=1.0),
            Material(1e4, 0.2),
            [Contact("bottom", friction=0.3, name="base"), Traction("top", y=-10.0), *drag],
        )
        result = solve(problem, inner=DIRECT)
        assert result.status is Status.INFEASIBLE
        assert "'base'" in result.message

    def test_a_body_force_that_bends_the_pressure(self):
        problem = ContactProblem(
            RectilinearMesh.rectangle((2, 2)),
            Material(1000.0, 0.3),
            [
                Contact("bottom", 0.3),
                Displacement("top", x=0.0, y=0.0),
                Traction("left", 0.0, 0.0),
                Traction("right", 0.0, 0.0),
            ],
            body_potential=lambda x, y: 5.0 * y + x**2,
        )
        with pytest.raises(InputError, match="potential"):
            solve(problem, inner=DIRECT)


class TestCertificate:
    """Wrong states do not pass."""

    @pytest.fixture(scope="class")
    @staticmethod
    def pair():
        problem = discretize(compressed_plate(0.1, (4, 4)))
        return solved(problem), solved(problem, inner=DIRECT)

    def test_the_solution_at_points_fails_on_friction(self, pair):
        loose, strict = pair
        assert loose.certificate.passed
        wrong = replace(loose.solution, problem=strict.solution.problem)
        certificate = self.certified(wrong)
        assert certificate.worst == "friction"
        assert certificate.measures["friction"] > 1e-3
        assert certificate.measures["stationarity"] < 1e-10

    def test_the_strict_solution_passes_and_small_changes_do_not(self, pair):
        solution = pair[1].solution
        assert self.certified(solution).passed
        for change in (
            {"z": 1.00001 * solution.z},
            {"tangential_multiplier": 1.001 * solution.tangential_multiplier},
            {"tangential_multiplier": -solution.tangential_multiplier},
            {"normal_multiplier": solution.normal_multiplier + 1e-3 * solution.problem.W},
        ):
            assert not self.certified(replace(solution, **change)).passed

    @staticmethod
    def certified(solution):
        return certify(
            solution.problem,
            solution.z,
            solution.normal_multiplier,
            solution.tangential_multiplier,
            solution.equality_multiplier,
        )
