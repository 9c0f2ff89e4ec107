"""Rows that depend linearly on each other: a few that span them, by QR with pivoting of the rows scaled to one."""

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import csc_matrix

from solvers.types import IntVector, Matrix, Sparse, Vector

_RANK = 1e-10
"""Rows, scaled to length one, that are shorter than this beside the others depend on them."""


def independent_rows(B: Sparse) -> tuple[Matrix, Sparse]:
    """B = E Y with E (rows, r) and orthonormal rows Y (r, n) sparse."""
    Q, R, order, lengths, touched = _pivoted(B)
    E = np.empty((B.shape[0], len(R)))
    E[order] = R.T
    selection = csc_matrix((np.ones(len(touched)), (np.arange(len(touched)), touched)), (len(touched), B.shape[1]))
    return E * lengths[:, None], csc_matrix(csc_matrix(Q.T) @ selection)


def spanning_rows(B: Sparse) -> tuple[Matrix, IntVector]:
    """B = E B[chosen] with E (rows, r) of moderate entries, those of the r chosen rows a unit matrix."""
    _, R, order, lengths, _ = _pivoted(B)
    r = len(R)
    E = np.empty((B.shape[0], r))
    E[order[:r]] = np.eye(r)
    E[order[r:]] = solve_triangular(R[:, :r], R[:, r:]).T
    return E * (lengths[:, None] / lengths[order[:r]]), order[:r]


def _pivoted(B: Sparse) -> tuple[Matrix, Matrix, IntVector, Vector, IntVector]:
    """Q (touched columns, r), R (r, rows) and the pivot order of the scaled rows, their lengths, touched columns."""
    touched = np.flatnonzero(np.diff(B.indptr))
    rows = B[:, touched].toarray()
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0.0] = 1.0
    Q, R, order = qr((rows / lengths[:, None]).T, mode="economic", pivoting=True)
    diagonal = np.abs(np.diag(R))
    r = int((diagonal > _RANK * diagonal.max(initial=0.0)).sum())
    return Q[:, :r], R[:r], order, lengths, touched
