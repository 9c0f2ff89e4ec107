"""The paper's own system: its element, its plate; its numbers by all methods: `tests/comparisons/test_paper.py`."""

import numpy as np
import pytest

from qvi_contact.paper import plate
from solvers import solve_qvi
from tests.cases import refused_at

ENDS = np.array([0.0, 1.0])


def answer(qvi):
    solution = solve_qvi(qvi, "condensed")
    assert solution.solved, solution.message
    return solution.z


@pytest.mark.parametrize("cells", [(1, 1), (2, 2), (5, 3)])
@pytest.mark.parametrize(("plane", "stiffness"), [("stress", 1.0), ("strain", 1.0 / (1.0 - 0.3**2))])
def test_without_friction_the_stress_is_uniform(cells, plane, stiffness):
    ours = plate(0.0, cells, width=0.7, height=2.0, grading=0.8, plane=plane)
    pressure = stiffness * 2.09e5 * 1e-3 / 2.0
    z = answer(ours.qvi)
    assert ours.force(z) == pytest.approx(0.7 * pressure, rel=1e-11)
    assert ours.stress(z)[2] == pytest.approx(np.tile([0.0, -pressure, 0.0], (16 * cells[0] * cells[1], 1)), abs=1e-6)


def test_forces_do_not_depend_on_units():
    ours, metres = plate(0.2, (64, 4), grading=0.98), plate(0.2, (64, 4), 1e-3, 1e-3, 0.98, 2.09e11, displacement=1e-6)
    force = ours.force(answer(ours.qvi))
    assert metres.force(answer(metres.qvi)) == pytest.approx(force * 1e3, rel=1e-9)


def test_stresses_obey_equilibrium_and_the_conditions_of_the_sides():
    """Every horizontal line carries the force; no shear on the sides; the law at four points, not between."""
    ours = plate(0.1, (4, 4), grading=0.8)
    z = answer(ours.qvi)
    x, y, stress = ours.stress(z)
    weights = np.outer(np.diff(ours.x), np.polynomial.legendre.leggauss(4)[1] / 2.0)
    lines = -(stress[:, 1].reshape(16, 16) @ weights.ravel())
    assert lines == pytest.approx(np.full(16, ours.force(z)), rel=1e-10)
    assert (np.diff(x.reshape(16, 16)[0]) > 0.0).all()
    assert (np.diff(y.reshape(16, 16)[:, 0]) > 0.0).all()
    at, normal, shear = ours.tractions(z)
    assert at[-1, -1] < 1.0
    assert (np.abs(shear) <= -0.1 * normal * (1 + 1e-7)).all()
    assert ours.tractions(z, ENDS)[2][[0, -1], [0, -1]] == pytest.approx(0.0, abs=1e-9)  # symmetry, and the free corner
    _, normal, shear = ours.tractions(z, np.linspace(0.0, 1.0, 2001))
    assert ours.excess_between_points(z) == pytest.approx((np.abs(shear) + 0.1 * normal).max(), rel=1e-5)


def test_principal_stresses_turn_back():
    ours = plate(0.2, (3, 2))
    z = answer(ours.qvi)
    first, second, angle = ours.principal_stress(z)
    c, s = np.cos(angle), np.sin(angle)
    back = np.stack([first * c**2 + second * s**2, first * s**2 + second * c**2, (first - second) * c * s], axis=1)
    assert back == pytest.approx(ours.stress(z)[2], abs=1e-9 * 209.0)
    assert (first >= second).all()


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"friction": -0.1}, "friction"), ({"friction": float("nan")}, "friction"), ({"cells": 2}, "cells"),
        ({"cells": (0, 2)}, "cells"), ({"width": 0.0}, "width"), ({"displacement": 0.0}, "displacement"),
        ({"young": -1.0}, "Material.young"), ({"poisson": 0.5, "plane": "strain"}, "poisson"),
    ],
)  # fmt: skip
def test_what_is_out_of_range(changes, field):
    with refused_at(field):
        plate(**{"friction": 0.2, **changes})
