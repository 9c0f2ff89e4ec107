"""Linear conditions solved row by row."""

import numpy as np
import pytest

from qvi_contact.discretization.constraints import Rows, solve_conditions
from qvi_contact.discretization.hsieh_clough_tocher.tractions import walk


def solved(C, d, age=None):
    C = np.asarray(C, dtype=float)
    rows = Rows(np.tile(np.arange(C.shape[1]), (len(C), 1)), C)
    return solve_conditions(rows, np.asarray(d, dtype=float), np.zeros(C.shape[1], dtype=int) if age is None else age)


@pytest.mark.parametrize("seed", range(8))
def test_all_solutions_and_nothing_else(seed):
    rng = np.random.default_rng(seed)
    C = rng.normal(size=(7, 12)) * (rng.random((7, 12)) < 0.4)
    C[5] = C[1] - 2.0 * C[3]  # follows from others
    exact = rng.normal(size=12)
    found, misfit = solved(C, C @ exact, rng.integers(0, 5, 12))
    rank = np.linalg.matrix_rank(C)
    assert found.basis.shape == (12, 12 - rank)
    assert np.linalg.matrix_rank(found.basis.toarray()) == 12 - rank
    assert np.abs(C @ found.basis.toarray()).max() < 1e-11
    assert C @ found.particular == pytest.approx(C @ exact, abs=1e-11)
    assert found.basis.toarray()[found.kept] == pytest.approx(np.eye(12 - rank))
    assert not found.particular[found.kept].any()
    assert np.abs(misfit).max() < 1e-11
    assert len(misfit) == 7 - rank


def test_the_misfit_of_rows_that_contradict_each_other():
    _, misfit = solved([[1, -1, 0], [0, 1, -1], [1, 0, -1]], [1.0, 2.0, 3.5])
    assert misfit == pytest.approx([0.5])


def test_pivots_are_the_latest_unless_their_entry_is_tiny():
    assert solved([[5.0, 1.0]], [1.0], np.array([0, 1]))[0].kept.tolist() == [True, False]
    assert solved([[5.0, 1e-9]], [1.0], np.array([0, 1]))[0].kept.tolist() == [False, True]


def test_a_chain_of_differences_depends_on_its_end_only():
    n = 200
    found, _ = solved(np.eye(n, n + 1, 1) - np.eye(n, n + 1), np.ones(n), np.arange(n + 1))
    assert np.flatnonzero(found.kept).tolist() == [0]
    assert (found.basis.toarray() == 1.0).all()
    assert found.particular.tolist() == list(range(n + 1))


def test_lines_are_walked_from_the_start_outward_and_then_from_their_ends():
    ends = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [7, 9], [8, 9]])
    place, age = walk(ends, 2, 10)
    assert place.tolist() == [1, 0, 2, 3, 4, 5]
    assert age.tolist() == [3, 2, 1, 4, 5, 0, 0, 6, 8, 7]


def test_closed_lines_are_walked_around():
    ends = np.array([[0, 1], [1, 2], [2, 3], [0, 3]])
    place, age = walk(ends, 7, 8)
    assert sorted(place.tolist()) == [0, 1, 2, 3]
    assert place[3] == 3
    assert age.tolist() == [1, 2, 3, 4, 0, 0, 0, 0]
