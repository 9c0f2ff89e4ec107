"""Pivoting: the linear complementarity problem alone, and contact that interior point methods find no way into."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Displacement, Material, RectilinearMesh, Symmetry, Traction
from qvi_contact.discretization.discretization import discretize
from qvi_contact.gallery import compressed_plate
from solvers import FrictionQVI, Status, solve_qvi
from solvers.pivoting.lemke import solve_lcp
from solvers.pivoting.method import LARGEST, affordable, solve_pivoting
from tests.effort import examples
from tests.solvers.conftest import one_contact


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

    def test_nothing_to_do(self):
        found = solve_lcp(np.eye(2), np.array([0.0, 1.0]), np.ones(2))
        assert (found.pivots, found.x.tolist(), found.basic.any()) == (0, [0.0, 0.0], False)


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
        mesh = RectilinearMesh(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
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
        mesh = RectilinearMesh(np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 3))
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

    def test_with_three_solutions_one_is_found(self):
        K = np.linalg.inv([[1.0, 0.8], [0.8, 1.0]])
        f = -np.array([1.0, 2.1])
        qvi = FrictionQVI(
            K=np.linalg.inv(K), f=f, N=[[1.0, 0.0]], n0=[0.0], T=[[0.0, 1.0]], t0=[0.0], mu=[2.0], W=[1.0]
        )
        assert solve_pivoting(qvi, 1e-8).solved

    def test_large_contacts_are_left_to_others(self):
        assert affordable(discretize(compressed_plate(0.2, (LARGEST // 4, 2)), element="bfs").qvi)
        assert not affordable(discretize(compressed_plate(0.2, (LARGEST // 4 + 1, 2)), element="bfs").qvi)


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
