"""A square root of a sparse positive definite matrix: RᵀR = K."""

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from solvers.basics.types import Sparse
from solvers.errors import InputError


def square_root(K: Sparse) -> Sparse:
    """R (n, n) sparse with RᵀR = K, from P K Pᵀ = L D Lᵀ (SuperLU in symmetric mode): R = D^½ Lᵀ P.

    K has to be positive definite itself, not only on a subspace; otherwise `InputError`.
    """
    try:
        factor = splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise InputError("K", "singular", "give a positive definite K, or a 'qp:' inner solver") from error
    pivots = factor.U.diagonal()
    if not np.array_equal(factor.perm_r, factor.perm_c) or pivots.min() <= 0:
        raise InputError("K", "not positive definite", "give a positive definite K, or a 'qp:' inner solver")
    n = K.shape[0]
    order = np.argsort(factor.perm_c)  # row i of P K Pᵀ is row order[i] of K
    P = csc_array((np.ones(n), (np.arange(n), order)), shape=(n, n))
    return csc_array(diags_array(np.sqrt(pivots)) @ factor.L.T @ P)
