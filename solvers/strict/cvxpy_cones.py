"""Inner solver ``strict:<name>``: the cones of `cones` in cvxpy, canonicalised once.

Bound and `Centre` are parameters (DPP), the energy the square of a norm as in `inner.socp`, whose back ends these are.
"""

import time

import numpy as np

from solvers.basics.status import Status
from solvers.basics.types import Module, Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import solve_cvxpy, within_time
from solvers.inner.problem import Centre, InnerSolution, no_result
from solvers.inner.root import square_root
from solvers.inner.socp import BACKENDS, WORDS
from solvers.strict.cones import CLARABEL_SETTINGS, ConeProblem, functional


class StrictSOCPSolver:
    """One cvxpy problem for one QVI; `solve` only sets the parameters."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float) -> None:
        cp = load("cvxpy")

        backend = BACKENDS[name]
        self.packages: tuple[str, ...] = ("cvxpy", backend.module)
        self._cones = cones = ConeProblem(qvi)
        self._name, self._settings = name, backend.settings(tolerance)
        if name == "clarabel":
            self._settings.update(CLARABEL_SETTINGS)
        e = cones.count
        self._x = cp.Variable(qvi.n)
        self._f, self._ends = cp.Parameter(qvi.n), cp.Parameter(cones.N.shape[0])
        self._b = cp.Parameter(qvi.p) if qvi.p else None
        self._upper, self._lower = cp.Parameter((3, e)), cp.Parameter((3, e))  # θ − τ and θ + τ at the centre
        self._normal = [cones.N @ self._x + self._ends <= 0] if cones.N.shape[0] else []
        self._bounds = [self._cone(cp, self._upper, -1.0), self._cone(cp, self._lower, 1.0)]
        self._equality = [qvi.A @ self._x == self._b] if qvi.p else []
        energy = 0.5 * cp.sum_squares(square_root(qvi.K) @ self._x) - self._f @ self._x
        self.problem = cp.Problem(cp.Minimize(energy), [*self._normal, *self._bounds, *self._equality])
        assert self.problem.is_dpp()

    def _cone(self, cp: Module, constant: Module, sign: float) -> Module:
        """Constant + sign τ is nonnegative on every edge."""
        first, middle, last = (constant[i] + sign * (self._cones.T[i] @ self._x) for i in range(3))
        beta = cp.Variable(self._cones.count, nonneg=True)
        return cp.SOC(first + last, cp.vstack([first - last, 2.0 * (middle - beta)]), axis=0)

    def solve(
        self,
        threshold: Vector,
        centre: Centre,
        start: InnerSolution | None,  # noqa: ARG002
    ) -> InnerSolution:
        """Solve for Bernstein coefficients of the bound (3e,), edge by edge; cvxpy does not pass a start on."""
        began = time.perf_counter()
        theta, shear = threshold.reshape(-1, 3), self._cones.shear(centre)
        self._upper.value, self._lower.value = (theta - shear).T, (theta + shear).T
        self._f.value, self._ends.value = centre.f, self._cones.ends(centre)
        if self._b is not None:
            self._b.value = centre.b
        settings = within_time(self._settings, BACKENDS[self._name].limit)
        word, message = solve_cvxpy(self.problem, self._name, settings)
        return self._translate(centre, WORDS.get(word, Status.BACKEND_FAILED), message, time.perf_counter() - began)

    def _translate(self, centre: Centre, status: Status, message: str, seconds: float) -> InnerSolution:
        """Row multipliers from the duals (u, v) of the cones, which cvxpy's Lagrangian subtracts: y = (u, v)."""
        qvi, failed = self._cones.qvi, status if not status.usable else Status.BACKEND_FAILED
        duals = [part.value for bound in self._bounds for part in bound.dual_variables]
        rows = [row.dual_value for row in (*self._normal, *self._equality)]
        if not status.usable or any(part is None for part in (self._x.value, *duals, *rows)):
            return no_result(qvi, failed, message, seconds)
        upper, lower = (
            np.column_stack([np.ravel(duals[i]), np.reshape(duals[i + 1], (2, -1), order="F").T]) for i in (0, 2)
        )
        pushes = np.ravel(rows[0]) if self._normal else np.zeros(0)
        m_N, m_T = self._cones.multipliers(pushes, functional(upper) - functional(lower))
        nu = np.ravel(rows[-1]) if qvi.p else np.zeros(0)
        iterations = int(getattr(self.problem.solver_stats, "num_iters", 0) or 0)
        return InnerSolution(centre.z + np.ravel(self._x.value), m_N, m_T, nu, status, iterations, seconds, message)
