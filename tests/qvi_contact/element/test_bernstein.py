"""Integrals of polynomials by Bernstein coefficients, against rules of many points."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact.element import absolute_integrals, gauss_interpolation, product_integrals
from tests.qvi_contact.builders import bernstein

coefficient = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))


@cache
def at_midpoints(degree):
    return bernstein(degree, (np.arange(5000) + 0.5) / 5000)


@pytest.mark.parametrize("count", [3, 21])
def test_interpolation_from_gauss_points(count):
    """Polynomials of degree count − 1 are met, the next Legendre polynomial is taken for zero."""
    t = np.linspace(0.0, 1.0, 31)
    points = (1 + np.polynomial.legendre.leggauss(count)[0]) / 2
    matrix = gauss_interpolation(count, t)
    assert points ** (count - 1) @ matrix == pytest.approx(t ** (count - 1), abs=1e-13)
    assert np.polynomial.Legendre.basis(count, [0, 1])(points) @ matrix == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("first", [2, 3])
@pytest.mark.parametrize("second", [2, 3, 4])
def test_products(first, second):
    t, w = np.polynomial.legendre.leggauss(8)
    t, w = (1 + t) / 2, w / 2
    found = product_integrals(first, second)
    assert found == pytest.approx(np.einsum("g,gi,gj->ij", w, bernstein(first, t), bernstein(second, t)), abs=1e-14)
    with pytest.raises(ValueError, match="read-only"):  # all share it
        found[0, 0] = 1.0


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(0.0, 2.0), min_size=3, max_size=3), st.lists(coefficient, min_size=3, max_size=5))
def test_integral_of_the_absolute_value(weight, coefficients):
    """Never above Σ |c_i| ∫ s B_i, never below |∫ s v|."""
    s, c = np.array([weight]), np.array([coefficients])
    degree = len(coefficients) - 1
    values = (at_midpoints(2) @ s[0]) * np.abs(at_midpoints(degree) @ c[0])
    found = float(absolute_integrals(s, c)[0])
    assert found == pytest.approx(values.mean(), abs=1e-6)
    moments = s @ product_integrals(2, degree)
    assert abs(float(moments[0] @ c[0])) - 1e-13 <= found <= float(moments[0] @ np.abs(c[0])) + 1e-13


@pytest.mark.parametrize(
    ("coefficients", "expected"),
    [
        ((-1.0, 0.0, 1.0), 0.5),  # 2t − 1
        ((1.0, -1.0, 1.0), 1.0 / 3.0),  # (1 − 2t)², which touches zero
        ((0.0, 0.0, 0.0), 0.0),
        ((0.0, 0.0, 2.0), 2.0 / 3.0),  # 2t²
    ],
)
def test_known_integrals(coefficients, expected):
    assert absolute_integrals(np.ones((1, 3)), np.array([coefficients])) == pytest.approx(expected, abs=1e-14)
