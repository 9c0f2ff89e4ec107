"""Stresses as a square root of the energy: against exact arithmetic, against K, and as a matrix."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, Region, Symmetry, Traction, discretize
from qvi_contact.gallery import compressed_plate

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # that element's root; triangles: test_triangle_basis

L_SHAPE = np.array([[1, 1, 1, 1], [1, 1, 0, 0], [1, 1, 0, 0]], dtype=bool)


def problems():
    plate = compressed_plate(0.2, (4, 3))
    mesh = RectilinearMesh(np.array([0, 0.2, 0.5, 0.7, 1.0]), np.array([0, 0.3, 0.6, 1.0]), L_SHAPE)
    sides = [Symmetry("left"), Traction("right", x=0.0, y=0.0), Traction("top", x=0.0, y=-1.0)]
    soft = Region(Material(1e4, 0.1), x=(0.0, 0.5), y=(1 / 3, 1.0))
    return {
        "uniform": plate,
        "graded": compressed_plate(0.2, (5, 6), grading=0.5),
        "L": ContactProblem(mesh, plate.material, [*sides, Contact("bottom", friction=0.3)]),
        "two materials": ContactProblem(plate.mesh, plate.material, plate.conditions, regions=[soft]),
    }


@pytest.mark.parametrize("name", ["uniform", "graded", "L", "two materials"])
def test_matrix_is_a_root_of_k(name):
    problem = problems()[name]
    qvi = discretize(problem).qvi
    R, places = qvi.root.matrix()
    K = qvi.K.toarray()
    assert R.shape == (13 * problem.mesh.active.sum(), qvi.n)
    scale = np.sqrt(np.outer(K.diagonal(), K.diagonal()))
    assert np.abs((R.T @ R).toarray() - K).max() < 1e-12 * np.abs(K).max()
    assert (np.abs((R.T @ R).toarray() - K) / scale).max() < 1e-11
    row, column = np.nonzero(problem.mesh.active)
    assert np.array_equal(places[::13], np.column_stack([column, row]))
    z = np.random.default_rng(1).normal(size=qvi.n)
    linear = qvi.root.apply(z) - qvi.root.apply(np.zeros(qvi.n))
    assert np.linalg.norm(R @ z) == pytest.approx(np.linalg.norm(linear), rel=1e-12)
    assert R.T @ (R @ z) == pytest.approx(qvi.root.adjoint(linear), abs=1e-12 * np.abs(K).max() * np.abs(z).max())
