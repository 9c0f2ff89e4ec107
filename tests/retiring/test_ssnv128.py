"""Code_Aster's SSNV128: opening, slip and stick on one contact, against published values and another discretisation."""

from itertools import pairwise

import numpy as np
import pytest

from qvi_contact import ContactState, solve
from qvi_contact.gallery import ssnv128
from solvers import Status

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # four points of an edge, lines, displacements of that mesh

OPEN, STICK, SLIP, _CLOSED = ContactState
SIDE = 0.04
CELLS = 32
SETTLED_FORCE = 1.40535e6
SETTLED_PRESSURE = 8.3882e7


@pytest.fixture(scope="module")
def result():
    return solve(ssnv128((CELLS, CELLS)), inner="qp:daqp")


@pytest.fixture(scope="module")
def base(result):
    return result.contacts["base"]


def test_signs_and_friction_law(base):
    """σ_T has two values of its own on an edge, so two of its four points reach the bound, the others come close."""
    slips = base.state == SLIP
    assert (base.slip[slips] > 0).all()
    assert (base.tangential_stress < 1e-6 * SETTLED_PRESSURE).all()
    left = (base.friction_bound - np.abs(base.tangential_stress)) / SETTLED_PRESSURE
    assert left.min() > -1e-6
    edges = slips.reshape(-1, 4).all(axis=1)
    assert edges.sum() == 20
    assert (np.sort(left.reshape(-1, 4)[edges], axis=1)[:, 1] < 1e-6).all()
    assert left[slips].max() < 0.05
    assert base.weights[slips] @ left[slips] < 2e-3 * base.weights[slips].sum()


def test_the_solution_improves_with_the_mesh(base):
    """The force follows h^1.6: 1.8e-3 of it is missing on 16² cells, 6e-4 on 32², 2.3e-4 on 64²."""
    results = [solve(ssnv128((n, n))) for n in (4, 8, 16)]
    assert all(result.status is Status.SOLVED for result in results)
    forces = [result.contacts["base"].tangential_force for result in results]
    errors = SETTLED_FORCE + np.array([*forces, base.tangential_force])
    assert (errors > 0).all()
    assert all(fine < coarse / 2 for coarse, fine in pairwise(errors))


@pytest.mark.parametrize(("cells", "grading"), [((2, 1), 1.0), ((8, 8), 1.0), ((7, 5), 1.3)])
def test_without_friction_the_stress_is_uniform(cells, grading):
    """One cell alone knows only the mean slip: shear is prescribed at both of its ends."""
    result = solve(ssnv128(cells, friction=0.0, grading=grading))
    for lines in (result.problem.mesh.x, result.problem.mesh.y):
        sizes = np.diff(lines)
        assert sizes[1:] / sizes[:-1] == pytest.approx(grading, rel=1e-9)
    c = result.problem.material.compliance
    strain = c[0] @ [-15e7, -5e7, 0.0]
    base = result.contacts["base"]
    assert result.status is Status.SOLVED
    assert base.slip == pytest.approx(strain * (base.x - SIDE), rel=1e-9, abs=1e-9 * 4e-5)
    corner = np.polynomial.Polynomial.fit(base.x[:4], base.slip[:4], 1)(0.0)
    assert corner == pytest.approx(4.061538461538e-5, rel=1e-9)
    assert result.stress(0.01, 0.02) == pytest.approx([-15e7, -5e7, 0.0], abs=1.0)
