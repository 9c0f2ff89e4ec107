"""Outer iterations, the fixed point and Uzawa's: states, variants, starts, contraction, infeasibility, failures."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from solvers import Iteration, SolveError, Status, check_feasibility, solve_qvi
from solvers.certificate import is_farkas
from solvers.fixed_point import CondensedForm, FullForm
from solvers.inequality import Compliance
from tests.solvers.conftest import dragged_block, mixed_problem, one_contact, prescribed_shear, random_problem

INNER = "direct:clarabel"
STATES = {
    "open": ((1.0, -0.5), (0.0, 0.0)),
    "stick": ((-1.0, 0.1), (3.0, -2.5)),  # −K⁻¹q
    "slip -": ((-1.0, 3.0), (1 / (1 - 0.8), -1 / (1 - 0.8))),  # σ_T = −p
    "slip +": ((-1.0, -3.0), (1 / 1.8, 1 / 1.8)),  # σ_T = +p
}


@pytest.mark.parametrize(("load", "expected"), STATES.values(), ids=STATES)
def test_every_state_of_one_contact(load, expected):
    solution = solve_qvi(one_contact(1.0, load), inner=INNER)
    assert solution.solved, solution.message
    assert solution.z == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("start", [None, 0.0, 0.5, 1.6, 1.7, 5.0])
def test_one_of_three_solutions(start):
    """Of the problem of the design note 5.6."""
    initial = None if start is None else np.array([start])
    solution = solve_qvi(one_contact(), inner=INNER, initial=initial)
    known = [(0.0, 0.0), (17 / 9, -32.5 / 9), (5 / 3, -10 / 3)]
    assert solution.solved
    assert min(np.abs(solution.z - z).max() for z in known) < 1e-7


@pytest.mark.parametrize(("friction", "halved"), [(2.0, 0), (4.0, 1), (50.0, 5), (120.0, 6), (200.0, None)])
def test_anderson_where_plain_cycles(friction, halved):
    """Each cycle halves the mixing β = 1/2, up to six times; from s = 0, where g = 1, a memory of one leads to β."""
    qvi = one_contact(friction, (-1.0, -3.0))
    plain = solve_qvi(qvi, inner=INNER, variant="plain", initial=[1.0])
    assert plain.status is Status.CYCLING
    assert "anderson" in plain.message
    accelerated = solve_qvi(qvi, inner=INNER, variant="anderson", memory=1, initial=[1.0])
    assert accelerated.status is (Status.CYCLING if halved is None else Status.SOLVED)
    if halved is not None:
        slip = 1 / (1 + 0.8 * friction)
        assert accelerated.z == pytest.approx([slip, friction * slip], rel=1e-7)
        first = next(entry for entry in accelerated.history if -1 < round(entry.normal_resultant, 6) < 0)
        assert first.normal_resultant == pytest.approx(0.8 * friction / 2.0 ** (halved + 1) - 1.0, abs=1e-6)


def test_history_and_record():
    seen = []
    solution = solve_qvi(random_problem(0), inner="qp:clarabel", callback=seen.append)
    assert solution.history == tuple(seen)
    assert [entry.number for entry in seen] == list(range(1, solution.iterations + 1))
    assert seen[-1].residual <= 1e-8
    assert seen[-1].normal_resultant == pytest.approx(solution.problem.resultant(solution.z))
    for found in (solution, solve_qvi(solution.problem, method="uzawa", max_iterations=3)):
        assert min(found.timings[part] for part in ("setup", "solve", "certificate")) >= 0.0
    assert set(solution.versions) == {"qpsolvers", "clarabel"}


@pytest.mark.parametrize("inner", ["direct:clarabel", "qp:quadprog", "qp:cvxopt"])
@pytest.mark.parametrize("shear", [0.3001, -0.4])
def test_infeasible_with_proof(inner, shear):
    qvi = dragged_block(shear)
    solution = solve_qvi(qvi, inner=inner)
    assert solution.status is Status.INFEASIBLE
    assert solution.farkas is not None
    assert is_farkas(qvi, *solution.farkas)
    assert not is_farkas(dragged_block(0.29), *solution.farkas)
    assert "reduce" in solution.message


def test_a_false_proof_is_refused():
    qvi = dragged_block(0.5)
    y, nu = check_feasibility(qvi).farkas
    assert not is_farkas(qvi, -y, nu)
    assert not is_farkas(qvi, y, 1.001 * nu)
    assert not is_farkas(qvi, np.full_like(y, np.nan), nu)
    assert check_feasibility(dragged_block(0.3)).feasible
    assert check_feasibility(dragged_block(0.30001)).feasible is False
    assert solve_qvi(qvi, method="uzawa", max_iterations=500).status is Status.INFEASIBLE


def test_restart_when_the_first_bound_is_too_small():
    solution = solve_qvi(prescribed_shear(), inner=INNER, initial=[0.0])
    assert solution.history[0].inner_status is Status.INFEASIBLE
    assert solution.solved, solution.message
    assert solution.z == pytest.approx([3.8, -1.0], abs=1e-7)


def test_no_solution_though_the_admissible_set_is_not_empty():
    """Shear 1 prescribed, nothing presses: p = 0 carries no shear, p > 0 leaves the gap open."""
    qvi = prescribed_shear().with_loads(f=np.zeros(2), b=[1.0])
    solution = solve_qvi(qvi, inner=INNER)
    assert (solution.status, solution.farkas) == (Status.INNER_INFEASIBLE, None)
    assert len(solution.history) <= 7  # no pressure on a sixteenth of the way will do: no hope for others


def test_a_solution_that_is_not_certified_is_raised_on_request():
    with pytest.raises(SolveError, match="max_iterations"):
        solve_qvi(random_problem(0), inner=INNER, max_iterations=1, throw=True)


@pytest.mark.parametrize("load", [2.1, 1.0, 3.0])
def test_anderson_leaves_a_repelling_fixed_point(load):
    """While it slips the map is s → 1 + 1.6 s: the secant points backwards, the solution sticks."""
    solution = solve_qvi(one_contact(2.0, (-1.0, load)), inner=INNER, initial=[1.0])
    assert solution.solved, solution.message
    stick = np.linalg.solve(np.array([[1.0, 0.8], [0.8, 1.0]]), [1.0, -load])
    assert solution.z == pytest.approx(stick, rel=1e-7)


@pytest.mark.parametrize(("off", "status"), [(1e-2, Status.STALLED), (1e-6, Status.INACCURATE)])
def test_a_converged_fixed_point_with_wrong_multipliers_is_the_fault_of_the_inner_solver(back_end, off, status):
    """No smaller load and no damping would help."""

    def wrong(answer):
        found = answer()
        found.z = (1.0 + off) * found.z
        return found

    back_end("qp:clarabel", wrong)
    solution = solve_qvi(one_contact(0.1), inner="qp:clarabel", form="full", patience=3)
    assert solution.status is status
    assert min(entry.residual for entry in solution.history) < 1e-8
    assert solution.iterations < 15  # it is softened neither
    for words in ("has converged", "clarabel: Solved", "inner solver"):
        assert words in solution.message
    assert "sliding limit" not in solution.message


def history(residuals):
    return [Iteration(number, residual, 0.0, 0.0, Status.SOLVED) for number, residual in enumerate(residuals, 1)]


@pytest.mark.parametrize(
    ("friction", "options", "factor"),
    [(0.1, {"variant": "plain"}, 0.08), (0.55, {"variant": "plain"}, 0.44), (0.5, {"variant": "damped"}, 0.3)],
)
def test_contraction_on_one_sliding_contact(friction, options, factor):
    """σ_T = μ s moves σ_N by the coupling: the factor is 0.8 μ, exactly; (1 − 0.8 μ) / 2 with a damping of a half."""
    solution = solve_qvi(one_contact(friction, (-1.0, -3.0)), inner=INNER, **options)
    assert solution.solved
    assert solution.contraction == pytest.approx(factor, rel=1e-3)
    assert solve_qvi(one_contact(friction, (-1.0, -3.0)), method="condensed").contraction is None


@pytest.fixture(scope="module")
def contraction():
    """That of a fixed point with a given history."""
    solution = solve_qvi(one_contact(0.1, (-1.0, -3.0)), inner=INNER)
    return lambda entries: replace(solution, history=tuple(entries)).contraction


@pytest.mark.parametrize("factor", [0.3, 1.5])
def test_outliers_do_not_count_nor_rounding(factor, contraction):
    residuals = factor ** np.arange(12.0)
    assert contraction(history(residuals)) == pytest.approx(factor)
    residuals[7] *= 1e3
    assert contraction(history(residuals)) == pytest.approx(factor, rel=0.05)
    late = [*[1.0] * 20, *(0.1 ** np.arange(1.0, 11.0)), *[1e-16, 3e-15, 2e-16] * 4]
    assert contraction(history(late)) == pytest.approx(0.1)


def test_few_residuals_gaps_and_what_has_no_inner_problem_do_not_count(contraction):
    assert contraction(history([1.0, 0.1, 0.01])) is None
    assert contraction(history([np.inf, 1.0, 0.1, 0.01])) is None
    kept = [entry for entry in history(0.5 ** np.arange(14.0)) if entry.number % 3]
    assert contraction([*kept, Iteration(15, 1e-12, 0.0, 0.0, None, 5)]) == pytest.approx(0.5)


def partly_frictionless(seed, equalities=0):
    """Every other row without friction; one of them fixes two others, and one row is zero."""
    qvi = random_problem(seed, equalities=equalities)
    T, t0, mu = qvi.T.toarray(), np.array(qvi.t0), np.array(qvi.mu)
    mu[::2] = 0.0
    T[1], T[2], T[3], t0[1], t0[2] = T[0], 2.0 * T[0], 0.0, t0[0], 2.0 * t0[0]
    return qvi.with_contact(T=T).with_loads(t0=t0).with_law(mu=mu)


def in_other_units(seed, equalities=0):
    """The tractions of each point in another unit."""
    qvi = random_problem(seed, equalities=equalities)
    unit = np.where(np.arange(qvi.m) % 2, 1e-4, 1e4)
    N, T = (unit[:, None] * rows.toarray() for rows in (qvi.N, qvi.T))
    return qvi.with_contact(N=N, T=T).with_loads(n0=unit * qvi.n0, t0=unit * qvi.t0)


@pytest.mark.parametrize("equalities", [0, 2])
@pytest.mark.parametrize("make", [random_problem, partly_frictionless, in_other_units])
def test_forms_agree(make, equalities):
    qvi = make(5, equalities=equalities)
    full, condensed = (solve_qvi(qvi, inner="direct:clarabel", form=form) for form in ("full", "condensed"))
    near = 1e-4 if make is in_other_units else 1e-7  # rows whose units are 1e8 apart cost the inner solver digits
    assert max(each.certificate.accuracy for each in (full, condensed)) < 0.1 * near
    assert (full.form, condensed.form) == ("full", "condensed")
    assert condensed.z == pytest.approx(full.z, abs=near)
    assert condensed.equality_multiplier == pytest.approx(full.equality_multiplier, abs=10.0 * near)


@pytest.mark.parametrize("form", ["full", "condensed"])
@pytest.mark.parametrize("seed", [0, 1])
def test_inner_problems_have_the_unit_of_the_state_and_not_that_of_the_bonded_one(seed, form):
    """Loads of rounding beside tractions, and loads that only gaps take: the bonded state has nothing or far more."""
    qvi = random_problem(seed, n=20)
    least = qvi.with_loads(f=1e-13 * qvi.f, n0=np.linspace(-1.0, 1.0, qvi.m))
    free = qvi.with_loads(f=1e5 * qvi.N.T @ np.linspace(1.0, 2.0, qvi.m), n0=np.zeros(qvi.m), t0=np.zeros(qvi.m))
    for problem in (least, free):
        assert solve_qvi(problem, "fixed-point", form=form).solved


def test_condensed_tractions_and_energy_are_those_of_the_unknowns():
    """σ = σ_bonded + V w and the energy grows by ½|w|², for w = −Vᵀ m and z minimising under the multipliers m."""
    qvi = random_problem(5, equalities=1)
    form = CondensedForm(FullForm.of(qvi))
    m = np.random.default_rng(0).normal(size=2 * qvi.m)
    compliance = Compliance(qvi)
    z = compliance.state(m)[0]
    V = np.vstack([form.problem.N.toarray(), form.problem.T.toarray()])
    w = -V.T @ m
    assert qvi.tractions(z) == pytest.approx(compliance.bonded + V @ w, abs=1e-10)
    assert qvi.energy(z) - qvi.energy(qvi.bonded) == pytest.approx(0.5 * w @ w, rel=1e-9)
    assert compliance.dense @ m == pytest.approx(compliance.bonded - qvi.tractions(z), abs=1e-10)


@pytest.mark.parametrize(
    ("rule", "state"), [*product(["accumulating"], STATES), ("printed", "stick"), ("printed", "slip -")]
)
def test_uzawa_finds_every_state(rule, state):
    """But open ones by the printed rule."""
    qvi = one_contact(0.5, STATES[state][0])
    solution = solve_qvi(qvi, method="uzawa", rule=rule, omega_T=0.1, step_decay=300.0)
    assert solution.solved, solution.message
    assert solution.z == pytest.approx(solve_qvi(qvi, inner="direct:clarabel").z, abs=1e-7)


def test_printed_rule_never_opens_a_gap():
    solution = solve_qvi(one_contact(0.5, (1.0, -0.5)), method="uzawa", rule="printed", omega_T=0.1)
    assert solution.status is Status.STALLED
    assert solution.certificate.worst == "friction"


@pytest.mark.parametrize("rule", ["printed", "accumulating"])
def test_first_iterations_by_hand(rule):
    """(4.1)-(4.4) with rows of every kind, on one of which nothing shears."""
    qvi = mixed_problem(0, equalities=0)
    T, t0 = (np.where(np.arange(10) == 4, 0.0, array.T).T for array in (qvi.T.toarray(), qvi.t0))
    qvi = qvi.with_contact(T=T).with_loads(t0=t0)
    B, lam = np.vstack([qvi.N.toarray(), T]), np.zeros((2, 10))
    for k in range(1, 9):
        solution = solve_qvi(qvi, method="uzawa", rule=rule, iterations=k, omega_T=0.5, omega_N=0.1)
        found = -solution.normal_displacement, -solution.tangential_displacement
        assert np.array(found) == pytest.approx(lam, abs=1e-10)
        z = np.linalg.solve(qvi.K.toarray(), qvi.f - B.T @ (qvi.W * lam).ravel())
        bound = qvi.threshold(qvi.pressure(z))
        for i, (n, t) in enumerate(zip(qvi.normal(z), qvi.tangential(z), strict=True)):
            lam[0, i] = 0.0 if qvi.bilateral[i] else max(lam[0, i] + 0.1 * n, 0.0)
            old, step = np.sign(t) * lam[1, i], 0.5 * (1.0 - bound[i] / abs(t)) if t else 0.0
            if t == 0.0 or (rule == "printed" and n >= 0.0 and not qvi.bilateral[i]):
                new = 0.0
            elif rule == "printed":
                new = max(max(old, 0.0) + step, 0.0)
            else:
                new = old + step if step >= 0.0 else np.copysign(max(abs(old) + step, 0.0), old)
            lam[1, i] = np.sign(t) * new


def test_frictionless_cycles_unless_the_step_shrinks_and_a_long_history_is_thinned_out():
    qvi = one_contact(0.0, (-1.0, -3.0))
    cycling = solve_qvi(qvi, method="uzawa", omega_T=0.07)
    assert cycling.status is Status.CYCLING
    assert "step_decay" in cycling.message
    solution = solve_qvi(qvi, method="uzawa", omega_T=0.07, step_decay=50.0)
    assert solution.solved
    assert solution.z == pytest.approx([1.0, 0.0], abs=1e-7)
    solution = solve_qvi(qvi, method="uzawa", omega_T=0.07, iterations=4_005)
    numbers = [entry.number for entry in solution.history]
    assert numbers[:1000] == list(range(1, 1001))
    assert numbers[-1] == 4_005
    assert len(numbers) < 2100
    assert solution.history[-1].energy == pytest.approx(qvi.energy(solution.z))
