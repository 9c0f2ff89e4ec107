"""Rows as samples of polynomials: exact both ways, and the functionals that row multipliers are."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qvi_contact.element.hermite import gauss_legendre
from solvers import EdgeRows, InputError
from solvers.inequality.edges import affine_basis, quadratic_basis

NUMBERS = st.floats(-10, 10, allow_subnormal=False)
EDGES = EdgeRows(gauss_legendre(4)[0])


@settings(deadline=None, max_examples=60, derandomize=True)
@given(arrays(float, (3, 3), elements=NUMBERS))
def test_bernstein_round_trip(b):
    assert EDGES.bernstein(EDGES.at_points(b)) == pytest.approx(b, abs=1e-12)


@settings(deadline=None, max_examples=60, derandomize=True)
@given(arrays(float, (3, 2), elements=NUMBERS))
def test_ends_round_trip_and_are_bernstein_coefficients(v):
    values = EDGES.at_points(v)
    assert EDGES.ends(values) == pytest.approx(v, abs=1e-12)
    raised = np.column_stack([v[:, 0], v.mean(axis=1), v[:, 1]])
    assert EDGES.bernstein(values) == pytest.approx(raised, abs=1e-12)


@settings(deadline=None, max_examples=60, derandomize=True)
@given(arrays(float, 8, elements=NUMBERS), arrays(float, (2, 3), elements=NUMBERS))
def test_functionals_are_what_multipliers_do(m, b):
    """Σ m p = ℓ·b, and any row multipliers with the same functional do the same."""
    work = float(m @ EDGES.at_points(b))
    functional = EDGES.on_bernstein(m)
    assert float((functional * b).sum()) == pytest.approx(work, abs=1e-9)
    assert float(EDGES.rows(functional) @ EDGES.at_points(b)) == pytest.approx(work, abs=1e-9)
    ends = b[:, :2]
    assert float((EDGES.on_ends(m) * ends).sum()) == pytest.approx(float(m @ EDGES.at_points(ends)), abs=1e-9)
    assert EDGES.on_ends(EDGES.rows(EDGES.on_ends(m))) == pytest.approx(EDGES.on_ends(m), abs=1e-9)


def test_bases_are_the_polynomials():
    t = np.linspace(0.0, 1.0, 7)
    assert affine_basis(t) @ [2.0, 5.0] == pytest.approx(2.0 + 3.0 * t)
    assert quadratic_basis(t) @ [1.0, -2.0, 4.0] == pytest.approx((1 - t) ** 2 - 4 * t * (1 - t) + 4 * t**2)


def test_block_matrix_is_the_map_of_each_edge():
    values = np.random.default_rng(0).normal(size=12)
    matrix = EDGES.matrix(EDGES.to_bernstein, 3)
    assert matrix @ values == pytest.approx(EDGES.bernstein(values).ravel())


@pytest.mark.parametrize(
    "points", [[0.1, 0.5], [0.1, 0.1, 0.5, 0.9], [0.1, 0.5, 1.2], [[0.1, 0.2, 0.3]], [0.1, np.nan, 0.4], "no points"]
)
def test_bad_points(points):
    with pytest.raises(InputError, match=r"edges\.points"):
        EdgeRows(points)


def test_bad_shapes():
    with pytest.raises(InputError, match="4 values an edge"):
        EDGES.ends(np.ones(6))
    with pytest.raises(InputError, match="3 coefficients"):
        EDGES.at_points(np.ones((2, 4)))
