"""Rates of convergence, and values that independent codes settle on."""

import pytest
from scipy.sparse.linalg import spsolve

from qvi_contact import discretize
from qvi_contact.gallery import compressed_plate

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # settled values of that element's meshes

SETTLED_STICK = 214.36766
"""P/2 at full stick, ± 3e-5: GetFEM 5.4.2 and NGSolve 6.2 on refined meshes, agreeing."""


def bonded_half_force(cells, grading=1.0):
    """P/2 if the plate sticks everywhere: one linear solve."""
    discretization = discretize(compressed_plate(1.0, (cells, cells), grading=grading))
    qvi = discretization.qvi
    return -209.0 * (qvi.W @ (qvi.N @ spsolve(qvi.K, qvi.f) + qvi.n0))


def test_grading_towards_the_corner_beats_uniform_meshes():
    assert bonded_half_force(16, grading=0.7) == pytest.approx(SETTLED_STICK, rel=5e-6)
    assert abs(bonded_half_force(16) / SETTLED_STICK - 1) > 5e-5
