"""The paper's procedure (4.1)-(4.4) on problems small enough to know."""

import numpy as np
import pytest

from solvers import InputError, Status, solve_qvi
from tests.solvers.conftest import dragged_block, one_contact, random_problem, two_contacts

STATES = [(1.0, -0.5), (-1.0, 0.1), (-1.0, 3.0), (-1.0, -3.0)]


@pytest.mark.parametrize("load", STATES, ids=["open", "stick", "slip -", "slip +"])
def test_accumulating_rule_finds_every_state(load):
    qvi = one_contact(0.5, load)
    solution = solve_qvi(qvi, method="uzawa", omega_T=0.1, step_decay=300.0)
    assert solution.solved, solution.message
    assert solution.z == pytest.approx(solve_qvi(qvi, inner="direct:clarabel").z, abs=1e-7)


def test_printed_rule_never_opens_a_gap():
    solution = solve_qvi(one_contact(0.5, (1.0, -0.5)), method="uzawa", rule="printed", omega_T=0.1)
    assert solution.status is Status.STALLED
    assert solution.certificate.worst == "friction"


@pytest.mark.parametrize("rule", ["printed", "accumulating"])
@pytest.mark.parametrize("load", [(-1.0, 0.1), (-1.0, 3.0)], ids=["stick", "slip -"])
def test_both_rules_converge_under_pressure(rule, load):
    qvi = one_contact(0.5, load)
    solution = solve_qvi(qvi, method="uzawa", rule=rule, omega_T=0.1)
    assert solution.solved, solution.message
    assert solution.z == pytest.approx(solve_qvi(qvi, inner="direct:clarabel").z, abs=1e-7)


def test_weights():
    solution = solve_qvi(two_contacts(), method="uzawa", omega_T=0.02)
    assert solution.solved
    assert solution.z == pytest.approx([2.0, 0.4, 1.0, -0.3], abs=1e-7)


def test_first_iterations_by_hand():
    """(4.1)-(4.4) on the second contact of `two_contacts`: σ_T = −2 − 2 λ_T, bound 0.3."""
    expected, lam = [], 0.0
    for _ in range(4):
        sigma = -2.0 - 2.0 * lam
        expected.append(sigma)
        lam += np.sign(sigma) * 0.1 * (1 - 0.3 / abs(sigma))
    for k, sigma in enumerate(expected, start=1):
        assert solve_qvi(two_contacts(), method="uzawa", iterations=k, omega_T=0.1).z[3] == pytest.approx(sigma)


def test_exactly_as_many_iterations_as_asked_for():
    solution = solve_qvi(random_problem(0), method="uzawa", iterations=30)
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.iterations == len(solution.history) == 30
    last = solution.history[-1]
    assert last.energy == pytest.approx(solution.problem.energy(solution.z))
    assert last.normal_resultant == pytest.approx(solution.problem.resultant(solution.z))


def test_frictionless_cycles_unless_the_step_shrinks():
    qvi = one_contact(0.0, (-1.0, -3.0))
    cycling = solve_qvi(qvi, method="uzawa", omega_T=0.07)
    assert cycling.status is Status.CYCLING
    assert "step_decay" in cycling.message
    solution = solve_qvi(qvi, method="uzawa", omega_T=0.07, step_decay=50.0)
    assert solution.solved
    assert solution.z == pytest.approx([1.0, 0.0], abs=1e-7)


def test_long_history_is_thinned_out():
    qvi = one_contact(0.0, (-1.0, -3.0))
    solution = solve_qvi(qvi, method="uzawa", omega_T=0.07, iterations=20_005)
    numbers = [entry.number for entry in solution.history]
    assert numbers[:1000] == list(range(1, 1001))
    assert numbers[-1] == 20_005
    assert len(numbers) < 2100


def test_infeasible():
    solution = solve_qvi(dragged_block(0.5), method="uzawa", max_iterations=500)
    assert solution.status is Status.INFEASIBLE
    assert solution.farkas is not None


def test_with_equalities_and_without_the_dense_compliance(monkeypatch):
    qvi = random_problem(4, equalities=2)
    dense = solve_qvi(qvi, method="uzawa", iterations=50)
    monkeypatch.setattr("solvers.inequality.compliance._DENSE_LIMIT", 0)
    sparse = solve_qvi(qvi, method="uzawa", iterations=50)
    assert sparse.z == pytest.approx(dense.z, abs=1e-10)
    assert qvi.A @ dense.z == pytest.approx(qvi.b, abs=1e-10)


@pytest.mark.parametrize(
    "options", [{"rule": "guessed"}, {"omega_T": 0.0}, {"omega_N": -1.0}, {"iterations": 0}, {"memory": 3}]
)
def test_bad_options(options):
    with pytest.raises(InputError) as error:
        solve_qvi(one_contact(), method="uzawa", **options)
    assert error.value.field in options
