"""Problems of meshes as files of other programs: the same solutions come back, and their own commands run them."""

import sys

import numpy as np
import pytest

from comparisons.cli import group
from comparisons.exchange import local_problem, read_fclib, siconos_error, solve_local, state_of, write_fclib
from qvi_contact import discretize
from qvi_contact.basics import terminal
from qvi_contact.gallery import compressed_plate, ssnv128
from solvers import solve_qvi

pytestmark = pytest.mark.usefixtures("bogner_fox_schmit")  # four points of an edge are bound by equations

pytest.importorskip("h5py", reason="FCLIB files need the extra 'exchange'")


def plate(cells: int = 8, friction: float = 0.2, grading: float = 1.0):
    return compressed_plate(friction, cells=(cells, cells), grading=grading)


def run(capfd, *arguments):
    """Exit status, standard output and standard error of a command."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["comparisons", *map(str, arguments)])
        with pytest.raises(SystemExit) as caught:
            terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    return caught.value.code, out, err


@pytest.mark.parametrize(
    "problem",
    [plate(4), plate(16), plate(16, friction=1.0), plate(8, grading=0.6), ssnv128((16, 16))],
    ids=["4", "16", "mu 1", "graded", "ssnv128"],
)
def test_fclib_files_give_the_same_solution(tmp_path, problem):
    """Tractions, forces and energy to 1e-9 from a file that knows nothing of the mesh."""
    qvi = discretize(problem).fitted().qvi
    solution = solve_qvi(qvi)
    local = local_problem(qvi)
    known = state_of(local, solution)
    write_fclib(tmp_path / "a.hdf5", local, known)
    held = read_fclib(tmp_path / "a.hdf5")
    state, found = solve_local(held.problem)
    assert solution.solved
    assert found.solved
    assert found.problem is not qvi
    normal, tangential = held.problem.tractions(state.r)
    size = np.abs(qvi.normal(solution.z)).max()
    assert np.abs(normal - qvi.normal(solution.z)).max() < 1e-9 * size
    assert np.abs(tangential - qvi.tangential(solution.z)).max() < 1e-9 * size
    for forces, rows in ((-state.r[0::2], qvi.normal(solution.z)), (state.r[1::2], qvi.tangential(solution.z))):
        assert forces.sum() == pytest.approx(qvi.W @ rows, rel=1e-9)
    assert held.problem.energy(state.r) == pytest.approx(local.energy(known.r), rel=1e-9)
    for each in (held.solution, state):
        assert siconos_error(held.problem, each.r, each.lam) < 1e-8
        assert held.problem.certify(each).passed
    assert len(held.problem.s) >= qvi.m  # rows are dependent: without the equations it is another problem


def test_without_the_equations_it_is_another_problem():
    """What a program that passes over V, R and s would solve; penalised it comes close."""
    local = local_problem(discretize(plate(4)).fitted().qvi)
    exact, _ = solve_local(local)
    truncated = type(local)(local.W, local.q, local.mu, weights=local.weights)
    other, _ = solve_local(truncated)
    near, solution = solve_local(local.penalised(1e6))
    assert solution.solved
    size = np.abs(exact.r).max()
    assert np.abs(other.r - exact.r).max() > 1e-2 * size
    assert np.abs(near.r - exact.r).max() < 1e-4 * size
