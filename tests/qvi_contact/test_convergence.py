"""Rates of convergence, and values that independent codes settle on."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from qvi_contact import discretize, solve
from qvi_contact.gallery import compressed_plate
from solvers import Status

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # settled values of that element's meshes

SETTLED_STICK = 214.36766
"""P/2 at full stick, ± 3e-5: GetFEM 5.4.2 and NGSolve 6.2 on refined meshes, agreeing."""
SETTLED = {0.05: 210.60643, 0.1: 212.24243, 0.2: 214.23323}


def bonded_half_force(cells, grading=1.0):
    """P/2 if the plate sticks everywhere: one linear solve."""
    discretization = discretize(compressed_plate(1.0, (cells, cells), grading=grading))
    qvi = discretization.qvi
    return -209.0 * (qvi.W @ (qvi.N @ spsolve(qvi.K, qvi.f) + qvi.n0))


def test_bonded_force_converges_at_the_rate_of_the_corner():
    """Between a fixed and a free side at a right angle u ~ r^λ with λ = 0.758 for ν = 0.3, so energy and P ~ h^(2λ).

    λ is the root of sin²(λπ/2) = ((κ+1)² − 4λ²)/(4κ), κ = (3−ν)/(1+ν) (Williams' equation for plane stress).
    """
    errors = np.array([SETTLED_STICK - bonded_half_force(n) for n in (4, 8, 16, 32)])
    rates = np.log2(errors[:-1] / errors[1:])
    assert (
        errors > 0
    ).all()  # equilibrium elements approach the force from one side: less stress energy is not admissible
    assert rates == pytest.approx(1.517, abs=0.1)


def test_grading_towards_the_corner_beats_uniform_meshes():
    assert bonded_half_force(16, grading=0.7) == pytest.approx(SETTLED_STICK, rel=5e-6)
    assert abs(bonded_half_force(16) / SETTLED_STICK - 1) > 5e-5


@pytest.mark.parametrize("friction", SETTLED)
def test_coulomb_forces_approach_those_of_displacement_codes(friction):
    result = solve(compressed_plate(friction, (16, 16), grading=0.75), inner="direct:clarabel")
    assert result.status is Status.SOLVED
    assert result.contacts["plate"].normal_force == pytest.approx(SETTLED[friction], rel=1.5e-4)
