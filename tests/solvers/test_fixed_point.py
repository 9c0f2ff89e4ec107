"""The outer iteration: states, variants, starts, infeasibility, and what it says if it fails."""

from dataclasses import replace

import numpy as np
import pytest

from solvers import (
    FrictionQVI,
    InputError,
    SolveError,
    SolverUnavailableError,
    Status,
    check_feasibility,
    solve_qvi,
)
from solvers.certificate.feasibility import is_farkas
from solvers.inner.direct_clarabel import DirectClarabel
from solvers.solution.finish import Outcome, finish
from tests.solvers.conftest import dragged_block, one_contact, random_problem, two_contacts

INNER = "direct:clarabel"


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        ((1.0, -0.5), (0.0, 0.0)),  # gap opens
        ((-1.0, 0.1), (3.0, -2.5)),  # sticks: −K⁻¹q
        ((-1.0, 3.0), (1 / (1 - 0.8), -1 / (1 - 0.8))),  # slips, σ_T = −p
        ((-1.0, -3.0), (1 / 1.8, 1 / 1.8)),  # slips, σ_T = +p
    ],
    ids=["open", "stick", "slip -", "slip +"],
)
def test_every_state_of_one_contact(load, expected):
    solution = solve_qvi(one_contact(1.0, load), inner=INNER)
    assert solution.solved, solution.message
    assert solution.z == pytest.approx(expected, abs=1e-8)


def test_two_contacts_with_different_weights():
    solution = solve_qvi(two_contacts(), inner=INNER)
    assert solution.solved
    assert solution.z == pytest.approx([2.0, 0.4, 1.0, -0.3], abs=1e-9)
    assert solution.tangential_displacement == pytest.approx([0.0, 0.85], abs=1e-8)


@pytest.mark.parametrize("start", [None, 0.0, 0.5, 1.6, 1.7, 5.0])
def test_one_of_three_solutions(nonunique, start):
    initial = None if start is None else np.array([start])
    solution = solve_qvi(nonunique, inner=INNER, initial=initial)
    known = [(0.0, 0.0), (17 / 9, -32.5 / 9), (5 / 3, -10 / 3)]
    assert solution.solved
    assert min(np.abs(solution.z - z).max() for z in known) < 1e-7


@pytest.mark.parametrize("friction", [2.0, 3.0, 4.0, 5.0])
def test_anderson_where_plain_cycles(friction):
    qvi = one_contact(friction, (-1.0, -3.0))
    plain = solve_qvi(qvi, inner=INNER, variant="plain", initial=[1.0])
    assert plain.status is Status.CYCLING
    assert "anderson" in plain.message
    accelerated = solve_qvi(qvi, inner=INNER, variant="anderson", initial=[1.0])
    assert accelerated.solved
    slip = 1 / (1 + 0.8 * friction)
    assert accelerated.z == pytest.approx([slip, friction * slip], rel=1e-7)


@pytest.mark.parametrize("variant", ["plain", "damped", "anderson"])
@pytest.mark.parametrize("seed", range(1, 5))
def test_variants_agree(variant, seed):
    qvi = random_problem(seed)
    reference = solve_qvi(qvi, inner=INNER, tolerance=1e-10)
    solution = solve_qvi(qvi, inner=INNER, variant=variant)
    assert solution.solved
    assert solution.z == pytest.approx(reference.z, abs=1e-7)


def test_history_and_record():
    seen = []
    solution = solve_qvi(random_problem(0), inner="qp:clarabel", callback=seen.append)
    assert solution.history == tuple(seen)
    assert [entry.number for entry in seen] == list(range(1, solution.iterations + 1))
    assert seen[-1].residual <= 1e-8
    assert seen[-1].normal_resultant == pytest.approx(solution.problem.resultant(solution.z))
    assert set(solution.timings) == {"setup", "solve", "certificate"}
    assert set(solution.versions) == {"qpsolvers", "clarabel"}
    assert (solution.method, solution.inner) == ("fixed-point", "qp:clarabel")


@pytest.mark.parametrize("inner", ["direct:clarabel", "qp:quadprog", "qp:cvxopt", "direct:osqp"])
@pytest.mark.parametrize("shear", [0.3001, 0.5, -0.4])
def test_infeasible_with_proof(inner, shear):
    qvi = dragged_block(shear)
    solution = solve_qvi(qvi, inner=inner)
    assert solution.status is Status.INFEASIBLE
    assert solution.farkas is not None
    assert is_farkas(qvi, *solution.farkas)
    assert not is_farkas(dragged_block(0.29), *solution.farkas)
    assert "reduce" in solution.message


def test_feasible_up_to_the_limit():
    assert solve_qvi(dragged_block(0.3), inner=INNER).solved
    assert check_feasibility(dragged_block(0.3)).feasible
    assert check_feasibility(dragged_block(0.30001)).feasible is False


def test_a_false_proof_is_refused():
    qvi = dragged_block(0.5)
    proof = check_feasibility(qvi).farkas
    assert proof is not None
    y, nu = proof
    assert not is_farkas(qvi, -y, nu)
    assert not is_farkas(qvi, y, 1.001 * nu)
    assert not is_farkas(qvi, np.full_like(y, np.nan), nu)


def test_restart_when_the_first_bound_is_too_small():
    """T z = −1 is prescribed; no pressure cannot hold it, the pressure 3.8 of the solution can."""
    qvi = FrictionQVI(
        K=np.array([[1.0, 0.8], [0.8, 1.0]]), f=np.array([3.0, 0.0]), N=np.array([[-1.0, 0.0]]), n0=[0.0],
        T=np.array([[0.0, 1.0]]), t0=[0.0], mu=[0.3], W=[1.0], A=np.array([[0.0, 1.0]]), b=[-1.0],
    )  # fmt: skip
    solution = solve_qvi(qvi, inner=INNER, initial=[0.0])
    assert solution.history[0].inner_status is Status.INFEASIBLE
    assert solution.solved, solution.message
    assert solution.z == pytest.approx([3.8, -1.0], abs=1e-7)


def test_no_solution_though_the_admissible_set_is_not_empty():
    """Shear 1 prescribed, nothing presses: p = 0 carries no shear, p > 0 leaves the gap open."""
    qvi = FrictionQVI(
        K=np.eye(2), f=np.zeros(2), N=np.array([[-1.0, 0.0]]), n0=[0.0], T=np.array([[0.0, 1.0]]), t0=[0.0],
        mu=[0.3], W=[1.0], A=np.array([[0.0, 1.0]]), b=[1.0],
    )  # fmt: skip
    solution = solve_qvi(qvi, inner=INNER)
    assert solution.status is Status.INNER_INFEASIBLE
    assert solution.farkas is None


def test_iteration_limit_and_throw():
    solution = solve_qvi(random_problem(0), inner=INNER, max_iterations=1)
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.iterations == 1
    assert np.isfinite(solution.z).all()
    with pytest.raises(SolveError, match="max_iterations"):
        solve_qvi(random_problem(0), inner=INNER, max_iterations=1, throw=True)


def test_zero_data():
    assert solve_qvi(one_contact(load=(0.0, 0.0)), inner=INNER).solved


def test_frictionless():
    solution = solve_qvi(random_problem(2, friction=0.0), inner=INNER)
    assert solution.solved
    assert np.abs(solution.problem.tangential(solution.z)).max() < 1e-8


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"variant": "fancy"}, "variant"), ({"damping": 0.0}, "damping"), ({"memory": 0}, "memory"),
        ({"max_iterations": 2.5}, "max_iterations"), ({"initial": [-1.0]}, "initial"),
        ({"initial": [1.0, 2.0]}, "initial"), ({"inner_tolerance": 2.0}, "inner_tolerance"),
        ({"method": "fixed-point", "omega_T": 0.1}, "omega_T"), ({"tolerance": 0.0}, "tolerance"),
        ({"inner": "qp:abacus"}, "inner"),
        ({"inner": "strict:clarabel"}, "edges"), ({"method": "newton"}, "method"),
    ],
)  # fmt: skip
def test_bad_options(nonunique, options, field):
    with pytest.raises(InputError) as error:
        solve_qvi(nonunique, **options)
    assert error.value.field == field


def test_unknown_names_list_what_exists(nonunique):
    with pytest.raises(SolverUnavailableError, match="qp:clarabel"):
        solve_qvi(nonunique, inner="qp:abacus")
    with pytest.raises(SolverUnavailableError, match=r"qvi-contact\[solvers\]"):
        solve_qvi(nonunique, inner="qp:qpswift")
    with pytest.raises(InputError, match="max_iterations"):
        solve_qvi(nonunique, speed=3)


def test_every_status_has_advice():
    for status in Status:
        assert status.advice.endswith(".")


@pytest.mark.parametrize("load", [2.1, 1.0, 3.0])
def test_anderson_leaves_a_repelling_fixed_point(load):
    """While it slips the map is s → 1 + 1.6 s: the secant points backwards, the solution sticks."""
    solution = solve_qvi(one_contact(2.0, (-1.0, load)), inner=INNER, initial=[1.0])
    assert solution.solved, solution.message
    stick = np.linalg.solve(np.array([[1.0, 0.8], [0.8, 1.0]]), [1.0, -load])
    assert solution.z == pytest.approx(stick, rel=1e-7)


def test_solved_is_never_taken_on_trust():
    """Whatever an iteration thinks of itself, the certificate decides."""
    qvi = two_contacts()
    nothing = np.zeros(2)
    boast = Outcome(Status.SOLVED, qvi.bonded + 1e-3, nothing, nothing, np.zeros(0), nothing, [], 1)
    assert finish(qvi, boast, "fixed-point", INNER, 1e-8).status is Status.STALLED


@pytest.mark.parametrize(("off", "status"), [(1e-2, Status.STALLED), (1e-6, Status.INACCURATE)])
def test_a_converged_fixed_point_with_wrong_multipliers_is_the_fault_of_the_inner_solver(monkeypatch, off, status):
    """No smaller load and no damping would help."""
    solve = DirectClarabel.solve

    def wrong(self, threshold, centre, start):
        answer = solve(self, threshold, centre, start)
        return replace(answer, m_T=(1.0 + off) * answer.m_T, message="clarabel: AlmostSolved")

    monkeypatch.setattr(DirectClarabel, "solve", wrong)
    solution = solve_qvi(two_contacts(), inner=INNER, form="full", patience=3)
    assert solution.status is status
    assert min(entry.residual for entry in solution.history) < 1e-8
    assert "has converged" in solution.message
    assert "clarabel: AlmostSolved" in solution.message
    assert "inner solver" in solution.message.rsplit(". ", 1)[-1]
    assert "sliding limit" not in solution.message
