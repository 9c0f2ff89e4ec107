"""The problem with three solutions: the certificate passes for each of them, and for nothing else.

One contact, u = W r + q with W = [[1, 4/5], [4/5, 1]], q = (1, 21/10), μ = 2; z = r = (p, t).
"""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solvers import certify
from tests.effort import examples
from tests.solvers.conftest import one_contact

W = ((Fraction(1), Fraction(4, 5)), (Fraction(4, 5), Fraction(1)))
Q = (Fraction(1), Fraction(21, 10))
FRICTION = 2
REACTIONS = {
    "open": (Fraction(0), Fraction(0)),
    "stick": (Fraction(17, 9), Fraction(-65, 18)),
    "slip": (Fraction(5, 3), Fraction(-10, 3)),
}
QVI = one_contact(FRICTION, (float(Q[0]), float(Q[1])))


def displacement(r):
    """U = W r + q."""
    return tuple(sum(w * part for w, part in zip(row, r, strict=True)) + q for row, q in zip(W, Q, strict=True))


def state(name):
    """(p, t, m_N, m_T): the multipliers are m_N = u_N, as N = [−1, 0], and m_T = −u_T."""
    r = REACTIONS[name]
    u = displacement(r)
    return np.array([float(value) for value in (*r, u[0], -u[1])])


STATES = {name: state(name) for name in REACTIONS}


def passes(values, tolerance=1e-8):
    return certify(QVI, values[:2], values[2:3], values[3:], tolerance=tolerance).passed


def distance(values):
    """To the nearest of the three, largest of the four differences."""
    return min(np.abs(values - known).max() for known in STATES.values())


@pytest.mark.parametrize("name", REACTIONS)
def test_each_obeys_the_law_in_fractions(name):
    (p, t), (u_N, u_T) = REACTIONS[name], displacement(REACTIONS[name])
    assert p >= 0
    assert u_N >= 0
    assert p * u_N == 0
    assert abs(t) <= FRICTION * p
    assert t * u_T + FRICTION * p * abs(u_T) == 0


@pytest.mark.parametrize("name", REACTIONS)
def test_the_certificate_passes_for_each(name):
    assert passes(STATES[name], 1e-12)


def test_it_passes_at_no_other_reaction_with_its_own_multipliers():
    """The displacements that belong to a reaction satisfy all equations; only the law can fail."""
    found = 0
    for p, t in product([*np.linspace(-1.0, 4.0, 21), 17 / 9, 5 / 3], [*np.linspace(-6.0, 3.0, 19), -65 / 18, -10 / 3]):
        u = QVI.K @ np.array([p, t]) - QVI.f
        values = np.array([p, t, u[0], -u[1]])
        assert passes(values) == (distance(values) < 1e-12)
        found += distance(values) < 1e-12
    assert found == 3


def test_it_passes_nowhere_on_a_grid_of_reactions_and_multipliers():
    grid = product(
        np.linspace(-1.0, 3.0, 6), np.linspace(-5.0, 1.0, 6), np.linspace(-1.0, 2.0, 5), [-2.1, -0.1, 0.0, 1.0]
    )
    assert not any(passes(np.array(values)) for values in grid if distance(np.array(values)) > 1e-6)


@pytest.mark.parametrize("size", [1e-6, 1e-4, 1e-2, 1.0])
@pytest.mark.parametrize("name", REACTIONS)
def test_it_fails_all_around_each(name, size):
    for direction in product((-1.0, 0.0, 1.0), repeat=4):
        values = STATES[name] + size * np.array(direction)
        assert passes(values) == (not any(direction))


@pytest.mark.parametrize("name", REACTIONS)
@settings(max_examples=examples(60), deadline=None)
@given(direction=st.tuples(*[st.floats(-1.0, 1.0)] * 4), exponent=st.floats(-6.0, 1.0), consistent=st.booleans())
def test_it_fails_at_random_distances(name, direction, exponent, consistent):
    values = STATES[name] + 10.0**exponent * np.array(direction)
    if consistent:
        u = QVI.K @ values[:2] - QVI.f
        values[2:] = u[0], -u[1]
    if distance(values) > 1e-6:
        assert not passes(values)
