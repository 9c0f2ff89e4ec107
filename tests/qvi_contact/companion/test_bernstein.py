"""Bernstein coefficients against values at points and numerical integrals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from qvi_contact.element import bernstein

DEGREES = (2, 3, 4)
coefficient = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))


@pytest.mark.parametrize("degree", DEGREES)
def test_functions_are_positive_and_sum_to_one(degree):
    values = bernstein.basis(degree, np.linspace(0.0, 1.0, 21))
    assert values.min() >= 0.0
    assert values.sum(axis=1) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("degree", DEGREES)
def test_coefficients_of_a_polynomial(degree):
    """t^k has the coefficients C(i, k)/C(p, k); those of t are the points i/p."""
    t = bernstein.nodes(degree)
    for power in range(degree + 1):
        found = bernstein.from_values(degree) @ t**power
        falling = [np.prod([(i - j) / (degree - j) for j in range(power)]) for i in range(degree + 1)]
        assert found == pytest.approx(falling, abs=1e-13)


@pytest.mark.parametrize(
    "matrix", [bernstein.from_values(3), bernstein.product_integrals(2, 3), bernstein.to_samples(4)]
)
def test_matrices_that_all_share_cannot_be_changed(matrix):
    with pytest.raises(ValueError, match="read-only"):
        matrix[0, 0] = 1.0


@pytest.mark.parametrize("count", [3, 21])
def test_interpolation_from_gauss_points(count):
    """Polynomials of degree count − 1 are met, the next Legendre polynomial is taken for zero."""
    t = np.linspace(0.0, 1.0, 31)
    points = (1 + np.polynomial.legendre.leggauss(count)[0]) / 2
    matrix = bernstein.gauss_interpolation(count, t)
    assert points ** (count - 1) @ matrix == pytest.approx(t ** (count - 1), abs=1e-13)
    assert np.polynomial.Legendre.basis(count, [0, 1])(points) @ matrix == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("first", [2, 3])
@pytest.mark.parametrize("second", DEGREES)
def test_products(first, second):
    t, w = np.polynomial.legendre.leggauss(8)
    t, w = (1 + t) / 2, w / 2
    expected = np.einsum("g,gi,gj->ij", w, bernstein.basis(first, t), bernstein.basis(second, t))
    assert bernstein.product_integrals(first, second) == pytest.approx(expected, abs=1e-14)


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(0.0, 2.0), min_size=3, max_size=3),
    st.lists(coefficient, min_size=3, max_size=5),
)
def test_integral_of_the_absolute_value(weight, coefficients):
    """Against a rule of 20000 midpoints; never above Σ |c_i| ∫ s B_i, never below |∫ s v|."""
    s, c = np.array([weight]), np.array([coefficients])
    t = (np.arange(20000) + 0.5) / 20000
    degree = len(coefficients) - 1
    values = (bernstein.basis(2, t) @ s[0]) * np.abs(bernstein.basis(degree, t) @ c[0])
    found = float(bernstein.absolute_integrals(s, c)[0])
    assert found == pytest.approx(values.mean(), abs=1e-6)
    moments = s @ bernstein.product_integrals(2, degree)
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
    found = bernstein.absolute_integrals(np.ones((1, 3)), np.array([coefficients]))
    assert found == pytest.approx(expected, abs=1e-14)
