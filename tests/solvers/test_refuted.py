"""That a load cannot be carried is proved by one linear program, before other starts and without Clarabel."""

from types import SimpleNamespace

import numpy as np
import pytest

from solvers import FrictionQVI, Status, check_feasibility, solve_qvi
from solvers.certificate import AdmissibleRows, is_farkas
from tests.solvers.conftest import dragged_block, random_problem

clarabel = pytest.importorskip("clarabel")


def overloaded(seed: int, friction: float = 0.3) -> FrictionQVI:
    """Dense random data: a combination 1ᵀN z = 0 of normal stresses vanishes, and their constants add up to tension."""
    qvi = random_problem(seed, friction, n=6)
    N = qvi.N.toarray()
    N[-1] = -N[:-1].sum(axis=0)
    n0 = np.full(qvi.m, -0.5)
    n0[-1] = 0.5 * (qvi.m - 1) + 0.1
    return qvi.with_contact(N=N).with_loads(n0=n0)


@pytest.fixture
def silent_clarabel(monkeypatch):
    """Clarabel, which decides nothing."""

    class Solver:
        def __init__(self, _P, q, _A, b, *_):
            self._sizes = len(q), len(b)

        def solve(self):
            n, rows = self._sizes
            return SimpleNamespace(status="NumericalError", x=np.zeros(n), z=np.zeros(rows), iterations=0)

    monkeypatch.setattr(clarabel, "DefaultSolver", Solver)


@pytest.mark.usefixtures("silent_clarabel")
@pytest.mark.parametrize("shear", [0.30001, 0.5, -0.4])
def test_a_linear_program_proves_it(shear):
    qvi = dragged_block(shear)
    found = check_feasibility(qvi)
    assert found.feasible is False
    assert is_farkas(qvi, *found.farkas)


@pytest.mark.usefixtures("silent_clarabel")
@pytest.mark.parametrize("shear", [0.0, 0.29, 0.3])
def test_it_proves_nothing_of_a_load_that_is_carried(shear):
    assert check_feasibility(dragged_block(shear)).feasible is None


@pytest.mark.usefixtures("silent_clarabel")
@pytest.mark.parametrize("seed", range(4))
def test_where_tension_alone_is_too_much_friction_has_no_part_in_the_proof(seed):
    qvi = overloaded(seed)
    found = check_feasibility(qvi)
    assert found.feasible is False
    assert is_farkas(qvi, *found.farkas)
    assert not found.farkas[0][AdmissibleRows.of(qvi).tangential].any()


@pytest.mark.parametrize("seed", range(4))
def test_no_other_start_follows_a_proof(seed):
    """One start ends within 15 iterations; all of them together take 30."""
    solution = solve_qvi(overloaded(seed))
    assert solution.status is Status.INFEASIBLE
    assert is_farkas(solution.problem, *solution.farkas)
    assert solution.iterations <= 15
