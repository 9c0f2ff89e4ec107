"""Observed contraction of the outer loop."""

import numpy as np
import pytest

from solvers import Iteration, Status, solve_qvi
from solvers.solution.contraction import observed_contraction
from tests.solvers.conftest import one_contact


def history(residuals):
    return [Iteration(number, residual, 0.0, 0.0) for number, residual in enumerate(residuals, 1)]


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.55])
def test_the_plain_fixed_point_of_one_sliding_contact(friction):
    """σ_T = μ s moves σ_N by the coupling 0.8: the factor is 0.8 μ, exactly."""
    solution = solve_qvi(one_contact(friction, (-1.0, -3.0)), inner="direct:clarabel", variant="plain")
    assert solution.solved
    assert solution.contraction == pytest.approx(0.8 * friction, rel=1e-4)


def test_damping_half_way():
    """A step half way, s + (g − s) / 2, where the slope of g is −0.8 μ: the factor is (1 − 0.8 μ) / 2."""
    solution = solve_qvi(one_contact(0.5, (-1.0, -3.0)), inner="direct:clarabel", variant="damped", damping=0.5)
    assert solution.contraction == pytest.approx(0.3, rel=1e-3)


def test_other_methods_have_none():
    assert solve_qvi(one_contact(0.5, (-1.0, -3.0)), method="condensed").contraction is None


@pytest.mark.parametrize("factor", [0.3, 1.5])
def test_outliers_do_not_count(factor):
    residuals = factor ** np.arange(12.0)
    assert observed_contraction(history(residuals)) == pytest.approx(factor)
    spoilt = residuals.copy()
    spoilt[7] *= 1e3
    assert observed_contraction(history(spoilt)) == pytest.approx(factor, rel=0.05)


def test_only_the_last_ones_count_and_no_rounding():
    residuals = [*[1.0] * 20, *(0.1 ** np.arange(1.0, 11.0)), *[1e-16, 3e-15, 2e-16] * 4]
    assert observed_contraction(history(residuals)) == pytest.approx(0.1)


def test_too_few_are_none():
    assert observed_contraction(history([1.0, 0.1, 0.01])) is None
    assert observed_contraction(history([np.inf, 1.0, 0.1, 0.01])) is None
    assert observed_contraction([]) is None


def test_what_follows_the_loop_is_no_step_of_it():
    loop = [entry._replace(inner_status=Status.SOLVED) for entry in history(0.5 ** np.arange(8.0))]
    ended = [*loop, Iteration(9, 1e-12, 0.0, 0.0, None, 5)]
    assert observed_contraction(ended) == observed_contraction(loop) == pytest.approx(0.5)
    assert observed_contraction(ended[-4:]) is None


def test_numbers_may_have_gaps():
    kept = [entry for entry in history(0.5 ** np.arange(14.0)) if entry.number % 3]
    assert observed_contraction(kept) == pytest.approx(0.5)
