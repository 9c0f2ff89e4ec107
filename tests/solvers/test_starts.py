"""Other ways to an answer: from that of a problem before, and by pivoting; what is said of several solutions."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, Symmetry, Traction, TriangleMesh
from qvi_contact.discretization import discretize
from qvi_contact.gallery import compressed_plate
from solvers import InputError, Status, solve_qvi
from solvers.condensed import GAP, Complementarity, InteriorPoint, Reduction, start_near
from solvers.pivoting import LARGEST, affordable, solve_lcp, solve_pivoting
from solvers.solution import Start
from tests.effort import examples
from tests.solvers.conftest import one_contact, random_problem


def slipping(offset, law="unilateral", cap=None):
    """A block pressed by a rough plate that moves sideways: parts slip, parts stick."""
    mesh = TriangleMesh.rectangle((8, 4), 2.0, 1.0)
    free = [Traction("left", x=0.0, y=0.0), Traction("right", x=0.0, y=0.0)]
    plate = Contact("top", 0.3, -0.01, offset, "plate", law=law, shear_limit=cap)
    return ContactProblem(mesh, Material(1e3, 0.3), [plate, Displacement("bottom", x=0.0, y=0.0), *free])


def opening(indentation):
    """A round punch pressed in: the contact grows with the load."""
    shape = slipping(0.0)
    punch = Contact("top", 0.3, lambda x, y: 0.02 * (x - 1.0) ** 2 - indentation + 0.0 * y, name="plate")
    return ContactProblem(shape.mesh, shape.material, [punch, *shape.conditions[1:]])


SEQUENCES = {
    "slip grows": [slipping(w) for w in (0.004, 0.0044)],
    "slip turns back": [slipping(w) for w in (0.009, 0.0085)],
    "bilateral": [slipping(w, "bilateral") for w in (0.004, 0.0044)],
    "capped": [slipping(w, cap=2.0) for w in (0.004, 0.0044)],
    "friction": [compressed_plate(mu, (8, 8)) for mu in (0.2, 0.22)],
}


@pytest.mark.parametrize("problems", SEQUENCES.values(), ids=SEQUENCES)
def test_a_neighbour_saves_iterations_and_changes_no_answer(problems):
    before, now = (discretize(problem) for problem in problems)
    cold = solve_qvi(now.qvi)
    warm = solve_qvi(now.qvi, initial=solve_qvi(before.qvi))
    assert warm.status is cold.status is Status.SOLVED
    assert warm.iterations <= 0.8 * cold.iterations
    assert warm.problem.resultant(warm.z) == pytest.approx(cold.problem.resultant(cold.z), rel=1e-9)
    size = np.abs(cold.problem.normal(cold.z)).max()
    assert warm.problem.normal(warm.z) == pytest.approx(cold.problem.normal(cold.z), abs=1e-5 * size)


def test_a_contact_that_grows_costs_two_iterations_more_at_most():
    results = [solve_qvi(discretize(opening(depth)).qvi) for depth in (0.002, 0.012)]
    warm = solve_qvi(results[1].problem, initial=results[0])
    assert warm.status is Status.SOLVED
    assert warm.iterations <= results[1].iterations + 2


def test_the_point_has_the_products_of_the_path_and_the_differences_of_the_state():
    qvi = discretize(slipping(0.004)).qvi
    solution = solve_qvi(qvi)
    reduction = Reduction(qvi)
    problem = Complementarity(qvi, reduction, reduction.base(np.zeros(qvi.n)), 1.0)
    interior = InteriorPoint(problem, 1.0)
    y = problem.restricted(reduction.coordinates(solution.z))
    start_near(interior, y, Start.of(solution))
    point, kappa = interior.point, problem.sizes**2
    assert problem.tractions(y)[0] == pytest.approx(qvi.normal(solution.z), abs=1e-9)
    assert point.products / interior.parameter() == pytest.approx(interior.shares)
    share = float(problem.weights @ (point.s * point.lam)) / problem.weights.sum()
    assert share == pytest.approx(GAP)
    slack = problem.slack(y, np.zeros(0))
    lam = problem.bound_multipliers(solution.normal_multiplier, solution.tangential_multiplier, slack)
    assert point.s - kappa * point.lam == pytest.approx(slack - kappa * lam, abs=1e-12)
    assert problem.multipliers(y, lam)[1] == pytest.approx(solution.tangential_multiplier, abs=1e-12)


def test_a_misleading_state_is_left():
    """Random states: the answer is that of the usual start."""
    qvi = random_problem(4)
    plain = solve_qvi(qvi)
    rng = np.random.default_rng(0)
    for size in (1.0, 1e6):
        state = Start(np.zeros(qvi.m), *(size * rng.normal(size=k) for k in (qvi.n, qvi.m, qvi.m)))
        found = solve_qvi(qvi, initial=state)
        assert found.solved
        assert found.z == pytest.approx(plain.z, abs=1e-6)
        assert found.iterations <= plain.iterations + 2


def test_states_of_other_problems_give_the_pressure_at_most():
    qvi = random_problem(4)
    other = Start(np.ones(qvi.m), np.zeros(qvi.n + 1), np.zeros(qvi.m), np.zeros(qvi.m))
    assert solve_qvi(qvi, initial=other).iterations == solve_qvi(qvi).iterations
    with pytest.raises(InputError) as caught:
        solve_qvi(qvi, method="condensed", initial=np.ones(qvi.m))
    assert caught.value.field == "initial"


class TestComplementarity:
    """The problem alone."""

    @pytest.mark.parametrize("seed", range(examples(20)))
    def test_of_a_positive_semidefinite_matrix_of_low_rank_is_solved(self, seed):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 30))
        root = rng.normal(size=(n, max(1, n // 2)))
        M = root @ root.T
        x0, w0 = rng.random(n) * (rng.random(n) < 0.5), rng.random(n)
        q = w0 * (x0 == 0.0) - M @ x0  # so that there is a solution
        found = solve_lcp(M, q, np.ones(n))
        w = q + M @ found.x
        assert min(found.x.min(), w.min()) > -1e-9
        assert abs(found.x @ w) < 1e-9

    def test_without_a_solution_ends_in_a_ray(self):
        M = np.array([[0.0, 1.0], [-1.0, 0.0]])
        assert solve_lcp(M, np.array([-1.0, -1.0]), np.ones(2)) is None


class TestContact:
    """Whole inequalities."""

    @pytest.mark.parametrize("friction", [0.0, 0.1, 0.3, 1.0, 3.0])
    def test_plate_as_by_the_condensed_method(self, friction):
        qvi = discretize(compressed_plate(friction, (4, 4))).qvi
        found, other = solve_pivoting(qvi, 1e-8), solve_qvi(qvi, method="condensed")
        assert found.status is other.status is Status.SOLVED
        assert found.certificate.accuracy < 1e-11
        assert found.z == pytest.approx(other.z, abs=1e-6 * np.abs(other.z).max())

    def test_bilateral_points_that_pull_and_slip(self):
        mesh = TriangleMesh.grid(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
        bend = Traction("top", 0.3, lambda x, _: 1.0 - x)
        conditions = [Contact("bottom", 0.05, law="bilateral", cohesion=0.02), bend, Traction("left", 0.0, 0.0)]
        qvi = discretize(ContactProblem(mesh, Material(1e3, 0.3), [*conditions, Symmetry("right")])).qvi
        found = solve_pivoting(qvi, 1e-8)
        normal, shear = qvi.normal(found.z), np.abs(qvi.tangential(found.z))
        assert found.solved
        assert normal.min() < -0.1
        assert normal.max() > 0.1
        assert (np.abs(shear - qvi.threshold(np.abs(normal))) < 1e-9).any()

    def test_cap(self):
        mesh = TriangleMesh.grid(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
        conditions = [
            Contact("bottom", 0.5, cohesion=0.02, shear_limit=0.1), Displacement("top", 1e-3, -1e-3),
            Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0),
        ]  # fmt: skip
        qvi = discretize(ContactProblem(mesh, Material(1e3, 0.3), conditions)).qvi
        found, other = solve_pivoting(qvi, 1e-8), solve_qvi(qvi, method="condensed")
        assert found.solved
        assert other.solved
        assert np.abs(qvi.tangential(found.z)).max() == pytest.approx(qvi.cap[0], rel=1e-9)
        assert found.z == pytest.approx(other.z, abs=1e-6 * np.abs(other.z).max())

    def test_large_contacts_are_left_to_others(self):
        for points in (LARGEST, LARGEST + 1):
            assert affordable(random_problem(0, m=points)) is (points == LARGEST)


class TestSecondOpinion:
    """Several solutions are said where they were seen, and nowhere else."""

    def test_with_three_solutions_a_remark_says_there_are_others(self):
        solution = solve_qvi(one_contact(2, (1.0, 2.1)))
        assert solution.solved
        assert len(solution.remarks) == 1
        assert "several solutions" in solution.remarks[0]

    @pytest.mark.parametrize("friction", [0.02, 0.1, 0.3, 1.0, 3.0])
    def test_plain_plates_have_no_remark(self, friction):
        assert solve_qvi(discretize(compressed_plate(friction, (6, 6))).qvi).remarks == ()
