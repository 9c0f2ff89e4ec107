"""Inner solver ``socp:<name>``: the problem as a second-order cone program in cvxpy, canonicalised once.

Friction bound and `Centre` are parameters (DPP), |T x + t0| ≤ thr one two-dimensional cone for each contact
point, the energy the square of a norm, ½|R x|² − fᵀx with RᵀR = K. Cite: S. Diamond, S. Boyd, CVXPY, JMLR 2016.
"""

import time
import warnings
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from solvers.basics.status import Status
from solvers.basics.types import Sparse, Vector, load
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inner import qp
from solvers.inner.linear_program import within_time
from solvers.inner.problem import Centre, InnerSolution, no_result
from solvers.inner.qp import QPBackend

_AS_QP = ("clarabel", "copt", "ecos", "gurobi", "mosek", "scs")
_ROBUST = {"max_iters": 200, "kktsolver": "robust"}

BACKENDS: Mapping[str, QPBackend] = MappingProxyType(
    {name: qp.BACKENDS[name] for name in _AS_QP}
    | {"cvxopt": replace(qp.BACKENDS["cvxopt"], options=_ROBUST, floor=1e-9)}
)
"""Lower-case name in cvxpy → how it is used: settings are called as in `qpsolvers`."""


class SOCPSolver:
    """One cvxpy problem for one QVI; `solve` only sets the parameters."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        cp = load("cvxpy")

        backend = BACKENDS[name]
        self.packages: tuple[str, ...] = ("cvxpy", backend.module)
        self._qvi, self._name = qvi, name
        self._settings = backend.settings(tolerance) if options is None else dict(options)
        self._x = cp.Variable(qvi.n)
        self.threshold = cp.Parameter(qvi.m, nonneg=True)
        self._f, self._n0, self._t0 = cp.Parameter(qvi.n), cp.Parameter(qvi.m), cp.Parameter(qvi.m)
        self._b = cp.Parameter(qvi.p) if qvi.p else None
        self._normal = qvi.N @ self._x + self._n0 <= 0
        tangential = cp.reshape(qvi.T @ self._x + self._t0, (1, qvi.m), order="C")
        self._friction = cp.SOC(self.threshold, tangential, axis=0)
        self._equality = [qvi.A @ self._x == self._b] if qvi.p else []
        energy = 0.5 * cp.sum_squares(square_root(qvi.K) @ self._x) - self._f @ self._x
        self.problem = cp.Problem(cp.Minimize(energy), [self._normal, self._friction, *self._equality])
        assert self.problem.is_dpp()

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the bound threshold (m,); cvxpy does not pass a start on."""
        began = time.perf_counter()
        self.threshold.value = np.maximum(threshold, 0.0)
        self._f.value, self._n0.value, self._t0.value = centre.f, centre.n0, centre.t0
        if self._b is not None:
            self._b.value = centre.b
        settings = within_time(self._settings, BACKENDS[self._name].limit)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.problem.solve(solver=self._name.upper(), **settings)
        word, seconds = str(self.problem.status), time.perf_counter() - began
        message = "; ".join([f"{self._name}: {word}", *(str(warning.message) for warning in caught)])
        status = qp.meaning(word)
        # cvxpy's Lagrangian subtracts (u, v)·(thr, T x + t0) for the cone, hence m_T = −v.
        qvi, duals = self._qvi, self._friction.dual_variables
        parts = [self._x.value, self._normal.dual_value, duals[1].value]
        parts += [row.dual_value for row in self._equality]
        if not status.usable or any(part is None for part in parts):
            status = status if not status.usable else Status.BACKEND_FAILED
            return no_result(qvi, status, message, seconds)
        arrays = [np.array(part, dtype=np.float64).ravel() for part in parts]
        nu = arrays[3] if qvi.p else np.zeros(0)
        iterations = int(getattr(self.problem.solver_stats, "num_iters", 0) or 0)
        return InnerSolution(centre.z + arrays[0], arrays[1], -arrays[2], nu, status, iterations, seconds, message)


# A square root of a sparse positive definite matrix: RᵀR = K.


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
