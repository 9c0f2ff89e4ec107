"""Inner solver ``socp:<name>``: the problem as a second-order cone program in cvxpy, canonicalised once.

Friction bound and `Centre` are parameters (DPP), |T x + t0| ≤ thr one two-dimensional cone for each contact
point, the energy the square of a norm, ½|R x|² − fᵀx with RᵀR = K. Cite: S. Diamond, S. Boyd, CVXPY, JMLR 2016.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from solvers.basics.types import Sparse, Vector, load
from solvers.errors import InputError
from solvers.inequality.problem import FrictionQVI
from solvers.inner import qp
from solvers.inner.linear_program import within_time
from solvers.inner.problem import Centre, InnerSolution, answered
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
        cp, backend = load("cvxpy"), BACKENDS[name]
        self.packages: tuple[str, ...] = ("cvxpy", backend.module)
        self._qvi, self._name = qvi, name
        self._settings = backend.settings(tolerance) if options is None else dict(options)
        x = self._x = cp.Variable(qvi.n)
        threshold, f = cp.Parameter(qvi.m, nonneg=True), cp.Parameter(qvi.n)
        n0, t0, *b = (cp.Parameter(size) for size in (qvi.m, qvi.m, qvi.p) if size)
        self._parameters = [threshold, f, n0, t0, *b]
        friction = cp.SOC(threshold, cp.reshape(qvi.T @ x + t0, (1, qvi.m), order="C"), axis=0)
        self._rows = [qvi.N @ x + n0 <= 0, friction, *(qvi.A @ x == given for given in b)]
        energy = 0.5 * cp.sum_squares(square_root(qvi.K) @ x) - f @ x
        self._problem = cp.Problem(cp.Minimize(energy), self._rows)
        assert self._problem.is_dpp()

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the bound threshold (m,); cvxpy does not pass a start on."""
        qvi, values = self._qvi, (np.maximum(threshold, 0.0), centre.f, centre.n0, centre.t0, centre.b)
        for parameter, value in zip(self._parameters, values, strict=False):  # no b without equations
            parameter.value = value
        self._problem.solve(solver=self._name.upper(), **within_time(self._settings, BACKENDS[self._name].limit))
        word, y = str(self._problem.status), None
        normal, friction, *equality = self._rows
        v = friction.dual_variables[1].value
        if v is not None and normal.dual_value is not None:
            # cvxpy's Lagrangian subtracts (u, v)·(thr, T x + t0) for the cone, hence m_T = −v.
            y = np.concatenate([normal.dual_value, -v.ravel(), np.zeros(qvi.m)])
        nu = equality[0].dual_value if qvi.p else None
        iterations = int(getattr(self._problem.solver_stats, "num_iters", 0) or 0)
        said = f"{self._name}: {word}"
        return answered(qvi, centre, qp.meaning(word), said, self._x.value, y, nu, iterations)


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
