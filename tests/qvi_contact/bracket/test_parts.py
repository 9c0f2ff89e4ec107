"""Integrals of the friction work."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from qvi_contact.bracket.parts import slip_work
from qvi_contact.element import bernstein

NUMBERS = st.floats(-10.0, 10.0, allow_subnormal=False)
T = np.linspace(0.0, 1.0, 4001)
SIMPSON = np.append(np.tile([2.0, 4.0], 2000), 1.0) / 12000.0
SIMPSON[0] = 1.0 / 12000.0


def quadratic(b):
    return b[0] * (1 - T) ** 2 + 2 * b[1] * T * (1 - T) + b[2] * T**2


@given(
    arrays(float, 4, elements=NUMBERS),
    arrays(float, 3, elements=NUMBERS),
    arrays(float, 3, elements=st.floats(0.0, 10.0, allow_subnormal=False)),
)
def test_slip_work(slip, shear, bound):
    j = np.polynomial.polynomial.polyval(bernstein.nodes(3), slip)[None] @ bernstein.from_values(3).T
    fine = np.polynomial.polynomial.polyval(T, slip)
    wanted = SIMPSON @ (np.abs(fine) * quadratic(bound) + fine * quadratic(shear))
    size = 1e-12 + np.abs(fine).max() * (np.abs(bound).max() + np.abs(shear).max())
    assert abs(slip_work(j, shear[None], bound[None])[0] - wanted) <= 1e-5 * size
