"""Rows that depend on each other: what spans them."""

import numpy as np
import pytest
from scipy.sparse import csc_array

from solvers.inequality.rows import independent_rows, spanning_rows

SHAPES = {"tall": (20, 6, 4), "wide": (5, 30, 3), "full": (4, 4, 4), "nothing": (3, 5, 0)}


def rows_of_rank(rank, count, columns, spread, seed=0):
    """Random rows of lengths between 1/spread and spread, some columns untouched."""
    random = np.random.default_rng(seed)
    B = random.normal(size=(count, rank)) @ random.normal(size=(rank, columns))
    if columns > rank + 2:
        B[:, ::9] = 0.0
    return csc_array(B * np.geomspace(1.0 / spread, spread, count)[:, None])


def row_error(B, product):
    lengths = np.linalg.norm(B.toarray(), axis=1)
    return (np.linalg.norm(B.toarray() - product, axis=1) / np.where(lengths > 0.0, lengths, 1.0)).max()


@pytest.mark.parametrize("spread", [1.0, 1e8])
@pytest.mark.parametrize(("count", "columns", "rank"), SHAPES.values(), ids=SHAPES)
class TestRank:
    """Long and short rows alike: their lengths decide nothing."""

    def test_orthonormal_rows_span_all(self, count, columns, rank, spread):
        B = rows_of_rank(rank, count, columns, spread)
        E, Y = independent_rows(B)
        assert Y.shape == (rank, columns)
        assert (Y @ Y.T).toarray() == pytest.approx(np.eye(rank), abs=1e-12)
        assert row_error(B, E @ Y) < 1e-12

    def test_chosen_rows_span_all(self, count, columns, rank, spread):
        B = rows_of_rank(rank, count, columns, spread)
        E, chosen = spanning_rows(B)
        assert len(set(chosen.tolist())) == len(chosen) == rank
        assert E[chosen] == pytest.approx(np.eye(rank), abs=0.0)
        assert row_error(B, E @ B[chosen]) < 1e-11
        lengths = np.linalg.norm(B.toarray(), axis=1)
        relative = E * lengths[chosen] / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        assert np.abs(relative).max(initial=0.0) < 2.0**rank  # rows as long as one: pivoting keeps entries moderate


@pytest.mark.parametrize("function", [independent_rows, spanning_rows])
def test_rows_that_are_zero(function):
    B = csc_array(np.array([[0.0, 0.0], [0.0, 2.0], [0.0, 0.0]]))
    E, which = function(B)
    assert E.shape == (3, 1)
    assert E @ (which if function is independent_rows else B[which]) == pytest.approx(B.toarray())


@pytest.mark.parametrize("function", [independent_rows, spanning_rows])
@pytest.mark.parametrize("shape", [(0, 3), (2, 3)])
def test_nothing_spans_nothing(function, shape):
    E, _ = function(csc_array(shape))
    assert E.shape == (shape[0], 0)
