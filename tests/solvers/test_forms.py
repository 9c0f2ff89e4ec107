"""The inner problem in the unknowns themselves and condensed to the contact: one answer."""

import dataclasses

import numpy as np
import pytest

from solvers import InputError, Status, solve_qvi
from solvers.fixed_point.forms import CondensedForm, FullForm, Simplified, make_form
from solvers.inequality.compliance import Compliance
from solvers.inner.problem import Centre
from solvers.inner.registry import make_inner
from tests.solvers.conftest import dragged_block, random_problem


def partly_frictionless(seed, equalities=0):
    """Every other row without friction, two of them equal to each other."""
    qvi = random_problem(seed, equalities=equalities)
    T, t0, mu = qvi.T.toarray(), np.array(qvi.t0), np.array(qvi.mu)
    mu[::2] = 0.0
    T[2], t0[2] = 2.0 * T[0], 2.0 * t0[0]
    return dataclasses.replace(qvi, T=T, t0=t0, mu=mu)


@pytest.mark.parametrize("equalities", [0, 2])
@pytest.mark.parametrize("make", [random_problem, partly_frictionless])
def test_forms_agree(make, equalities):
    qvi = make(3, equalities=equalities)
    full, condensed = (solve_qvi(qvi, inner="direct:clarabel", form=form) for form in ("full", "condensed"))
    assert full.status is condensed.status is Status.SOLVED
    assert (full.form, condensed.form) == ("full", "condensed")
    assert condensed.z == pytest.approx(full.z, abs=1e-7)
    assert condensed.equality_multiplier == pytest.approx(full.equality_multiplier, abs=1e-6)


def test_condensed_tractions_and_energy_are_those_of_the_unknowns():
    """σ = σ_bonded + V w and the energy grows by ½|w|², for w = −Vᵀ m and z minimising under the multipliers m."""
    qvi = random_problem(5, equalities=1)
    form = CondensedForm(Simplified.of(qvi))
    m = np.random.default_rng(0).normal(size=2 * qvi.m)
    compliance = Compliance(qvi)
    z, _ = compliance.unknowns(m)
    V = np.vstack([form.problem.N.toarray(), form.problem.T.toarray()])
    w = -V.T @ m
    assert compliance.tractions(z) == pytest.approx(compliance.bonded + V @ w, abs=1e-10)
    assert qvi.energy(z) - qvi.energy(qvi.bonded) == pytest.approx(0.5 * w @ w, rel=1e-9)
    assert compliance.relief(m) == pytest.approx(compliance.bonded - compliance.tractions(z), abs=1e-10)


def test_frictionless_rows_become_independent_equations():
    qvi = partly_frictionless(1)
    reduced = Simplified.of(qvi)
    assert reduced.problem.p == 3  # four rows, two of them dependent
    assert not reduced.problem.T[::2].toarray().any()
    threshold = qvi.threshold(np.full(qvi.m, 0.4))
    solver = make_inner("direct:clarabel", reduced.problem, 1e-12)
    start = Centre(reduced.problem, reduced.problem.bonded)
    result = reduced.restore(solver.solve(reduced.threshold(threshold), start, None))
    residual = qvi.gradient(result.z) + qvi.N.T @ result.m_N + qvi.T.T @ result.m_T
    assert np.abs(residual).max() < 1e-8  # with the multipliers of the original rows
    assert np.abs(qvi.tangential(result.z)[::2]).max() < 1e-10


def test_tractions_that_nothing_changes_stay_in_full_form():
    assert isinstance(make_form(dragged_block(0.1), "auto"), FullForm)


def test_forms_have_names():
    with pytest.raises(InputError, match="auto, full, condensed"):
        solve_qvi(random_problem(0), inner="direct:clarabel", form="dense")
