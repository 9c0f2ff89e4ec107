"""SSNV128 with large friction on triangles: few iterations, and the state that displacements confirm."""

import pytest

from qvi_contact import solve, solve_companion
from qvi_contact.gallery import ssnv128
from solvers import Status


@pytest.mark.parametrize("friction", [3.0, 5.0])
def test_triangles_find_the_state_of_the_displacement_model(friction):
    """Rectangles take up to 37 iterations on this mesh, and their shear force is 1.9 % smaller."""
    problem = ssnv128((16, 16), friction)
    result = solve(problem, element="hct")
    companion = solve_companion(result.problem)
    assert result.status is Status.SOLVED
    assert result.iterations <= 20
    force = next(iter(result.contacts.values())).tangential_force
    assert force == pytest.approx(next(iter(companion.contacts.values())).tangential_force, rel=2e-3)
