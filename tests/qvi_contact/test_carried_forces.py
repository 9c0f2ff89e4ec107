"""Relations of forces on contacts: complete, on all kinds of bodies, and short where there are many."""

import numpy as np
import pytest

from qvi_contact import Contact, ContactProblem, Material, RectilinearMesh, RigidPlate, Symmetry, Traction
from qvi_contact.discretization.discretization import discretize
from qvi_contact.gallery import jointed_slope, masonry_wall, press_fit, rings
from qvi_contact.solution.carried_forces import Relations


def crossing(law="unilateral"):
    """Four blocks whose joints cross at a point, on rectangles; a plate driven by force above."""
    mesh = RectilinearMesh.rectangle((4, 4), 2.0, 2.0)
    mesh = mesh.with_joint("upright", "vertical", 1.0).with_joint("level", "horizontal", 1.0)
    press = RigidPlate(force_y=-1.0, moment=0.1)
    loads = [Traction("left", 0.0, 0.0), Traction("right", 0.0, 0.0)]
    joints = [Contact(name, 0.5) for name in ("upright", "level", "bottom")]
    plate = Contact("top", 0.0 if law == "tied" else 0.5, law=law, plate=press)
    return ContactProblem(mesh, Material(1.0, 0.3), [*joints, plate, *loads])


def rank(matrix):
    return int(np.linalg.matrix_rank(matrix, tol=1e-9 * np.linalg.norm(matrix, 2))) if matrix.size else 0


PROBLEMS = {
    "wall": masonry_wall(5, 4, [(3, 0, 2, 2)]),
    "slope": jointed_slope(3, 1),
    "rings": rings(6),
    "press fit": press_fit(6, 0.2, whole=True),
    "crossing joints": crossing(),
    "one plate tied to two blocks": crossing("tied"),
    "symmetry": ContactProblem(
        RectilinearMesh.rectangle((3, 3)),
        Material(1.0, 0.3),
        [Contact("bottom", 0.3), Symmetry("left"), Traction("right", 0.0, 0.0), Traction("top", 0.0, -1.0)],
    ),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_all_relations_are_found(name):
    """They hold for every stress, and their rank with that of the rows makes up the number of rows."""
    problem = PROBLEMS[name]
    elements = ("bfs", "hct") if isinstance(problem.mesh, RectilinearMesh) else ("hct",)
    for element in elements:
        discretization = discretize(problem, element=element)
        qvi = discretization.qvi
        shares = np.tile(np.linspace(0.5, 1.0, qvi.m), 2)
        found = Relations.of(discretization, shares)
        relations = np.hstack([found.forces.toarray(), found.resultants.toarray()])
        rows = np.vstack([shares[:, None] * qvi.contact_rows.toarray(), qvi.A.toarray()])
        sizes = np.linalg.norm(rows, axis=1)
        rows, relations = rows / sizes[:, None], relations * sizes
        assert np.abs(relations @ rows).max(initial=0.0) <= 1e-10 * np.abs(relations).max(initial=0.0)
        assert rank(relations) + rank(rows) == len(rows)


def test_relations_of_many_blocks_are_short():
    """Three for each block, with the rows around that block alone: 4 courses of 6 blocks and 4 half ones."""
    discretization = discretize(masonry_wall(4, 6, ()))
    found = Relations.of(discretization, np.ones(2 * discretization.qvi.m))
    assert found.forces.shape[0] == 3 * (2 * 6 + 2 * 7)
    rows_around_a_block = 2 * 3 * 6  # σ_N and σ_T with three coefficients each on six edges
    assert np.diff(found.forces.indptr).max() <= rows_around_a_block
