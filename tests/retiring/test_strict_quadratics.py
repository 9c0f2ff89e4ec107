"""Nonnegative quadratics, their dual cone, support functions and bounds of the natural map: properties by sampling."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from solvers.inequality.edges import affine_basis, quadratic_basis
from solvers.strict.natural import natural_bound, project, slip_size
from solvers.strict.quadratics import affine_below, in_dual, is_nonnegative, largest, product, raised, smallest
from solvers.strict.support import distance_to_dual, support
from tests.effort import examples

T = np.linspace(0.0, 1.0, 4001)
AT = quadratic_basis(T)
NUMBERS = st.floats(-10, 10, allow_subnormal=False)
ROW = arrays(float, (1, 3), elements=NUMBERS)
MASS = np.array([[6.0, 3.0, 1.0], [3.0, 4.0, 3.0], [1.0, 3.0, 6.0]])[None] / 30.0


def nonnegative(root, extra):
    """(a(1 − t) + c t)² + 2 e t(1 − t): every element of C has this form."""
    return np.column_stack([root[:, 0] ** 2, root[:, 0] * root[:, 1] + extra, root[:, 1] ** 2])


ROOTS = arrays(float, (1, 2), elements=NUMBERS)
EXTRA = st.floats(0, 10, allow_subnormal=False)


@settings(deadline=None, max_examples=examples(30))
@given(ROW)
def test_largest_and_smallest_against_sampling(b):
    values = (AT @ b.T)[:, 0]
    curvature = 2.0 * np.abs(b[0, 0] - 2.0 * b[0, 1] + b[0, 2])
    assert largest(b)[0] == pytest.approx(values.max(), abs=1e-12 + curvature * 1e-7)
    assert smallest(b)[0] == pytest.approx(values.min(), abs=1e-12 + curvature * 1e-7)
    assert largest(b)[0] >= values.max() - 1e-12


@settings(deadline=None, max_examples=examples(30))
@given(ROW)
@example(np.array([[1.0, -(2.0**-14), 0.0]]))  # negative near one end only, between two samples
def test_cone_is_where_the_quadratic_is_nonnegative(b):
    sides = np.sqrt(np.maximum(b[0, 0], 0.0) * np.maximum(b[0, 2], 0.0))
    cone = b[0, 0] >= 0.0 and b[0, 2] >= 0.0 and b[0, 1] >= -sides
    curvature = 2.0 * np.abs(b[0, 0] - 2.0 * b[0, 1] + b[0, 2])
    if abs(smallest(b)[0]) > 1e-9 + curvature * 1e-7:  # samples miss a minimum between them by that much
        assert is_nonnegative(b)[0] == cone == bool((AT @ b.T).min() >= 0.0)


@settings(deadline=None, max_examples=examples(30))
@given(ROOTS, EXTRA, st.floats(0, 1), st.floats(0, 1))
def test_dual_pairing(root, extra, first, second):
    """Sums of point evaluations, and only such, are ≥ 0 on the cone."""
    b = nonnegative(root, extra)
    q = quadratic_basis(np.array([first, second])).sum(axis=0)[None]
    assert in_dual(q, 1e-12)[0]
    assert float((q * b).sum()) >= -1e-9
    assert distance_to_dual(q)[0] <= 1e-12


@settings(deadline=None, max_examples=examples(30))
@given(ROW)
def test_distance_to_the_dual_cone(q):
    delta = distance_to_dual(q)
    assert in_dual(q + delta[:, None], 1e-6)[0]
    if delta[0] > 1e-5:
        inside = q + 0.99 * delta[:, None]
        squares = 4.0 * inside[0, 0] * inside[0, 2] - inside[0, 1] ** 2
        assert inside.min() < 0.0 or squares < 0.0


@settings(deadline=None, max_examples=examples(30))
@given(ROW)
def test_outside_the_dual_cone_something_is_negative(q):
    if distance_to_dual(q)[0] > 1e-3:
        t = np.linspace(0.0, 1.0, 401)
        squares = np.column_stack([t**2, -t * (1.0 - t), (1.0 - t) ** 2])  # zero at t
        assert min(float((squares @ q[0]).min()), q[0, 1]) < 0.0


@settings(deadline=None, max_examples=examples(30))
@given(ROW, ROOTS, EXTRA)
def test_support_function_bounds_all_admissible_shears(ell, root, extra):
    """It is ≥ ℓ·τ for sampled |τ| ≤ θ, and at least the work of θ itself."""
    theta = nonnegative(root, extra) + 0.1
    h = float(support(ell, theta)[0])
    assert h >= abs(float((ell * theta).sum())) - 1e-9 * (1.0 + h)
    random = np.random.default_rng(0).normal(size=(400, 3)) * theta.max()
    ratio = np.abs(random @ AT[::20].T) / (AT[::20] @ theta[0])
    admissible = random / ratio.max(axis=1)[:, None] / 1.001
    assert h >= float((admissible @ ell[0]).max()) - 1e-9 * (1.0 + h)


def test_support_function_is_the_least_upper_bound():
    """Against linear programming over τ with the bound at 801 points, slip in both directions on one edge."""
    from scipy.optimize import linprog

    random = np.random.default_rng(1)
    points = quadratic_basis(np.linspace(0.0, 1.0, 801))
    for _ in range(6):
        ell = random.normal(size=3)
        theta = nonnegative(random.normal(size=(1, 2)), random.uniform()) + 0.2
        limits = np.tile(points @ theta[0], 2)
        best = linprog(-ell, np.vstack([points, -points]), limits, bounds=[(None, None)] * 3)
        assert float(support(ell[None], theta)[0]) == pytest.approx(-best.fun, rel=1e-5)


def test_support_of_a_closed_edge_is_nothing():
    assert support(np.array([[1.0, -2.0, 0.5]]), np.zeros((1, 3)))[0] == 0.0


@settings(deadline=None, max_examples=examples(30))
@given(arrays(float, (1, 2), elements=NUMBERS), arrays(float, (1, 2), elements=NUMBERS))
def test_products_and_raised_degree(u, v):
    expected = (affine_basis(T) @ u[0]) * (affine_basis(T) @ v[0])
    assert np.abs(AT @ product(u, v)[0] - expected).max() <= 1e-9
    assert np.abs(AT @ raised(u)[0] - affine_basis(T) @ u[0]).max() <= 1e-12


@settings(deadline=None, max_examples=examples(30))
@given(ROOTS, EXTRA)
def test_affine_functions_below(root, extra):
    b = nonnegative(root, extra)
    below = affine_below(b)
    assert (below >= 0.0).all()
    assert (affine_basis(T) @ below[0] <= AT @ b[0] + 1e-9).all()


def test_an_affine_function_is_its_own_lower_bound():
    assert affine_below(raised(np.array([[0.3, 2.0]])))[0] == pytest.approx([0.3, 2.0])


@settings(deadline=None, max_examples=examples(30))
@given(arrays(float, (1, 3), elements=NUMBERS))
def test_projection_is_moreaus(v):
    """V = P_C(v) − y with y in the dual cone and orthogonal."""
    nearest = project(v)
    y = nearest - v
    b = 0.5 * np.column_stack([nearest[:, 0] + nearest[:, 1], nearest[:, 2], nearest[:, 0] - nearest[:, 1]])
    q = np.column_stack([y[:, 0] + y[:, 1], 2.0 * y[:, 2], y[:, 0] - y[:, 1]])
    assert is_nonnegative(b, 1e-9)[0]
    assert distance_to_dual(q)[0] <= 1e-7
    assert float((nearest * y).sum()) == pytest.approx(0.0, abs=1e-9)


def test_natural_bound_is_above_the_natural_map():
    """Against the projection on { |τ| ≤ θ } computed by a conic solver."""
    import cvxpy as cp

    random, k = np.random.default_rng(2), 3.0
    points, root = quadratic_basis(np.linspace(0.0, 1.0, 201)), np.linalg.cholesky(MASS[0]).T
    for _ in range(5):
        theta = nonnegative(random.normal(size=(1, 2)), random.uniform()) + 0.2
        tau = 0.9 * theta * random.uniform(-1.0, 1.0)
        ell = 0.3 * random.normal(size=(1, 3))
        slip = np.linalg.solve(MASS[0], ell[0])
        x = cp.Variable(3)
        bound = points @ theta[0]
        cp.Problem(cp.Minimize(cp.sum_squares(root @ (x - tau[0] - k * slip))), [cp.abs(points @ x) <= bound]).solve(
            solver="CLARABEL"
        )
        exact = float(np.linalg.norm(root @ (tau[0] - x.value)))
        slack = support(ell, theta) - (ell * tau).sum(axis=1)
        found = natural_bound(tau, ell, theta, slack, MASS, np.ones(1), k)[0]
        assert found >= exact * (1.0 - 1e-3)
    assert slip_size(np.array([[1.0, 1.0, 1.0]]) / 3.0, MASS, np.ones(1))[0] == pytest.approx(1.0)


def test_natural_bound_of_a_lawful_edge_is_nothing():
    """Slip at the bound, and a touching point: ℓ is the evaluation there."""
    theta = np.array([[1.0, 1.5, 2.0]])
    touching = quadratic_basis(np.array([0.3]))
    dip = np.array([[0.3**2, -0.3 * 0.7, 0.7**2]])
    for tau, ell in ((theta, np.array([[0.2, 0.3, 0.2]])), (theta - dip, touching), (-theta + dip, -touching)):
        slack = support(ell, theta) - (ell * tau).sum(axis=1)
        assert slack[0] == pytest.approx(0.0, abs=1e-14)
        assert natural_bound(tau, ell, theta, slack, MASS, np.ones(1), 1.0)[0] <= 1e-7
