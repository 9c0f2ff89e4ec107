"""Inner solvers ``qp:<name>``, any back end of `qpsolvers`, ``direct:clarabel``, and ``socp:<name>`` through cvxpy.

The status of a `qpsolvers` back end is read from its own words if it has any. `found` of `qpsolvers` means different
things for different back ends, and `is_optimal` accepts multipliers of the wrong sign. Cite: S. Caron et al.,
qpsolvers: Quadratic Programming Solvers in Python.
"""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from scipy.sparse import csc_array, csc_matrix, triu, vstack

from solvers.basics.progress import deadline
from solvers.basics.status import Status
from solvers.basics.types import Sparse, Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.linear_program import within_time
from solvers.inner.problem import Centre, InnerSolution, limited_rows, no_result, row_multipliers


class QPSolver:
    """A `qpsolvers` back end for one QVI; the problem is built anew for every bound."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self._qvi, self._name, self._backend = qvi, name, BACKENDS[name]
        self.packages: tuple[str, ...] = ("qpsolvers", self._backend.module)
        self._settings = self._backend.settings(tolerance) if options is None else dict(options)
        matrices = (qvi.K, limited_rows(qvi), qvi.A)  # qpsolvers takes csc_matrix, not sparse arrays
        self._matrices = [
            matrix.toarray() if self._backend.dense else csc_matrix(matrix, copy=True) for matrix in matrices
        ]

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the friction bound `threshold` (m,); warnings are added to the message."""
        qvi, backend = self._qvi, self._backend
        P, G, A = self._matrices
        equalities = (A, centre.b) if qvi.p else (None, None)
        initial = start.z - centre.z if backend.warm and start is not None and start.finite else None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            qpsolvers = load("qpsolvers")
            problem = qpsolvers.Problem(P, -centre.f, G, centre.h(threshold), *equalities)
            settings = within_time(self._settings, backend.limit)
            answer = qpsolvers.solve_problem(problem, self._name, initvals=initial, **settings)
        word, iterations = _status_word(answer, backend.otherwise)
        status = meaning(word)
        message = "; ".join([f"{self._name}: {word}", *(str(w.message) for w in caught)])
        if any(part is None or np.size(part) != size for part, size in ((answer.x, qvi.n), (answer.z, 3 * qvi.m))):
            return no_result(qvi, Status.BACKEND_FAILED if status.usable else status, message)
        m_N, m_T = row_multipliers(np.array(answer.z, dtype=np.float64))
        nu = np.array(answer.y, dtype=np.float64) if qvi.p else np.zeros(0)
        z = centre.z + np.array(answer.x, dtype=np.float64)
        return InnerSolution(z, m_N, m_T, nu, status, iterations, message)


def _status_word(answer: Any, otherwise: str) -> tuple[str, int]:
    """A back end's status in its own words, or `otherwise`, and its number of iterations, 0 if unknown."""
    extras = answer.extras

    def report_of(name: str) -> Any:
        return extras.get(name, getattr(extras.get("info"), name, None))

    status = next((report_of(name) for name in ("infostring", "status") if report_of(name) is not None), None)
    word = str(getattr(status, "name", status))
    if status is None or isinstance(status, int):  # the meaning of most numbers is not documented
        word = "solved" if answer.found else otherwise
    iterations = report_of("iter") if report_of("iterations") is None else report_of("iterations")
    return word, 0 if iterations is None else int(np.ravel(iterations)[0])


_MEANINGS: Final = (
    ("dual infeasible|^unbounded|non convex", Status.UNBOUNDED),
    ("infeasible|closest primal feasible", Status.INFEASIBLE),
    ("inaccurate|almost|close to", Status.INACCURATE),
    (r"\bmax.* iter|user limit", Status.MAX_ITERATIONS),
    (r"\btime\b", Status.TIME_LIMIT),
    (r"\bsolved\b|\boptimal\b", Status.SOLVED),
    # CVXOPT's "unknown" means that it stopped early, with an iterate
    ("numerics|numerical problems|insufficient progress|indeterminate|^unknown$", Status.STALLED),
)


def meaning(word: str) -> Status:
    """The status for a back end's word: that of the first pattern of `_MEANINGS` in it, else backend_failed."""
    plain = re.sub(r"[\W_]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word)).lower()
    return next((status for pattern, status in _MEANINGS if re.search(pattern, plain)), Status.BACKEND_FAILED)


@dataclass(frozen=True)
class QPBackend:
    """A back end: its module, and how its settings and its status are used."""

    module: str
    """The module, which must be installed."""
    tolerances: tuple[str, ...] = ()
    """Settings that take the tolerance."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Further settings."""
    floor: float = 1e-12
    """Smallest tolerance; with smaller ones the back end fails or does not terminate."""
    limit: str = ""
    """Setting that takes a time limit in seconds, if there is one."""
    dense: bool = False
    """Whether it takes dense matrices only."""
    warm: bool = False
    """Whether it is started from the previous z, because that saves time."""
    otherwise: str = "failed"
    """Status word if it has no result and gives no reason."""

    def settings(self, tolerance: float) -> dict[str, Any]:
        """Keyword arguments for `qpsolvers.solve_problem` at the tolerance, not below `floor`."""
        return {**dict.fromkeys(self.tolerances, max(tolerance, self.floor)), **self.options}


_GAP_TOLERANCES: Final = ("eps_duality_gap_abs", "eps_duality_gap_rel")
_WITH_DEFAULTS: Final = {
    "copt": "coptpy", "gurobi": "gurobipy", "kvxopt": "kvxopt", "mosek": "mosek", "qtqp": "qtqp",
    "sip": "sip_qp_python",
}  # fmt: skip
_DENSE_WITH_DEFAULTS: Final = {"hpipm": "hpipm_python", "qpax": "qpax", "qpoases": "qpoases", "qpswift": "qpSWIFT"}

BACKENDS: Mapping[str, QPBackend] = MappingProxyType(
    {
        "clarabel": QPBackend("clarabel", ("tol_gap_abs", "tol_gap_rel", "tol_feas"), limit="time_limit"),
        "cvxopt": QPBackend("cvxopt", ("abstol", "reltol", "feastol"), {"maxiters": 200, "refinement": 2}, floor=1e-11),
        "daqp": QPBackend("daqp", ("primal_tol", "dual_tol"), {"iter_limit": 100_000}, limit="time_limit", dense=True),
        "ecos": QPBackend("ecos", ("feastol", "abstol", "reltol"), {"max_iters": 200}, floor=1e-11),
        "highs": QPBackend(
            "highspy",
            ("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
            {"qp_regularization_value": 1e-11},  # its default, 1e-7, is the relative error of one solve
            floor=1e-10,
            limit="time_limit",
        ),
        "osqp": QPBackend(
            "osqp",
            ("eps_abs", "eps_rel"),
            {"max_iter": 100_000, "polishing": False},
            floor=1e-11,
            limit="time_limit",
            warm=True,
        ),
        "piqp": QPBackend("piqp", ("eps_abs", "eps_rel", *_GAP_TOLERANCES), {"max_iter": 500}),
        "proxqp": QPBackend(
            "proxsuite",
            ("eps_abs", *_GAP_TOLERANCES),
            {"eps_rel": 0.0, "check_duality_gap": True, "max_iter": 10_000},
            floor=1e-11,
            warm=True,
        ),
        "qpalm": QPBackend(
            "qpalm",
            ("eps_abs", "eps_rel", "eps_abs_in", "eps_rel_in"),
            {"max_iter": 100_000},
            limit="time_limit",
            warm=True,
        ),
        "quadprog": QPBackend("quadprog", dense=True, otherwise="infeasible"),
        "scs": QPBackend("scs", ("eps_abs", "eps_rel"), {"max_iters": 100_000}, floor=1e-10, limit="time_limit_secs"),
        **{name: QPBackend(module) for name, module in _WITH_DEFAULTS.items()},
        **{name: QPBackend(module, dense=True) for name, module in _DENSE_WITH_DEFAULTS.items()},
    }
)
"""Name in `qpsolvers` → back end. A row here is enough to add one."""


# Inner solver ``direct:clarabel``: one Clarabel solver for all inner problems, of which only the vectors are updated.
#
# Interior point with a homogeneous embedding; it does not warm-start, but keeps the symbolic factorisation and the
# equilibration. Presolve, chordal decomposition and the dropping of zeros are off, as they exclude updates.
# Cite: P. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic objectives.


def clarabel_solver(
    P: Sparse, q: Vector, A: Sparse, b: Vector, G: Sparse, h: Vector, options: Mapping[str, Any]
) -> Any:
    """Clarabel's solver of min ½zᵀPz + qᵀz with A z = b and G z ≤ h, silent and without presolve."""
    clarabel = load("clarabel")
    settings = clarabel.DefaultSettings()
    for name, value in {**options, "verbose": False, "presolve_enable": False}.items():
        setattr(settings, name, value)
    cones = [*([clarabel.ZeroConeT(b.size)] if b.size else []), clarabel.NonnegativeConeT(h.size)]
    rows = csc_array(vstack([A, G])) if b.size else G
    return clarabel.DefaultSolver(csc_array(triu(P)), q, rows, np.concatenate([b, h]), cones, settings)


class DirectClarabel:
    """Clarabel on  A x + w = b (w = 0),  G x + w = h (w ≥ 0)."""

    packages: tuple[str, ...] = ("clarabel",)

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self._qvi = qvi
        options = BACKENDS[name].settings(tolerance) if options is None else options
        options = {**options, "chordal_decomposition_enable": False, "input_sparse_dropzeros": False}
        right = np.ones(3 * qvi.m)  # a placeholder: `solve` sets the right-hand side
        self._solver = clarabel_solver(qvi.K, -qvi.f, qvi.A, qvi.b, limited_rows(qvi), right, options)

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the friction bound `threshold` (m,); `start` is not used."""
        settings, seconds = self._solver.get_settings(), deadline.left
        if seconds < settings.time_limit:
            settings.time_limit = seconds
            self._solver.update(settings=settings)
        self._solver.update(q=-centre.f, b=np.concatenate([centre.b, centre.h(threshold)]))
        answer = self._solver.solve()
        word, z, multipliers = str(answer.status), centre.z + np.array(answer.x), np.array(answer.z)
        m_N, m_T = row_multipliers(multipliers[self._qvi.p :])
        nu = multipliers[: self._qvi.p]
        return InnerSolution(z, m_N, m_T, nu, meaning(word), int(answer.iterations), f"clarabel: {word}")


# Inner solver ``socp:<name>``: the problem as a second-order cone program in cvxpy, canonicalised once.
#
# Friction bound and `Centre` are parameters (DPP), |T x + t0| ≤ thr one two-dimensional cone for each contact
# point. Cite: S. Diamond, S. Boyd, CVXPY, JMLR 2016.

_AS_QP = ("clarabel", "copt", "ecos", "gurobi", "mosek", "scs")
_ROBUST = {"max_iters": 200, "kktsolver": "robust"}

SOCP_BACKENDS: Mapping[str, QPBackend] = MappingProxyType(
    {name: BACKENDS[name] for name in _AS_QP} | {"cvxopt": replace(BACKENDS["cvxopt"], options=_ROBUST, floor=1e-9)}
)
"""Lower-case name in cvxpy → back end; its settings have the names that `qpsolvers` uses."""


class SOCPSolver:
    """A cvxpy problem for one QVI; `solve` only sets its parameters."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        cp = load("cvxpy")

        backend = SOCP_BACKENDS[name]
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
        energy = 0.5 * cp.quad_form(self._x, cp.psd_wrap(qvi.K)) - self._f @ self._x
        self.problem = cp.Problem(cp.Minimize(energy), [self._normal, self._friction, *self._equality])
        assert self.problem.is_dpp()

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the friction bound `threshold` (m,); `start` is not used, as cvxpy does not pass it on."""
        self.threshold.value = np.maximum(threshold, 0.0)
        self._f.value, self._n0.value, self._t0.value = centre.f, centre.n0, centre.t0
        if self._b is not None:
            self._b.value = centre.b
        settings = within_time(self._settings, SOCP_BACKENDS[self._name].limit)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.problem.solve(solver=self._name.upper(), **settings)
        word = str(self.problem.status)
        message = "; ".join([f"{self._name}: {word}", *(str(warning.message) for warning in caught)])
        status = meaning(word)
        # cvxpy's Lagrangian subtracts (u, v)·(thr, T x + t0) for the cone, hence m_T = −v.
        qvi, duals = self._qvi, self._friction.dual_variables
        parts = [self._x.value, self._normal.dual_value, duals[1].value]
        parts += [row.dual_value for row in self._equality]
        if not status.usable or any(part is None for part in parts):
            status = status if not status.usable else Status.BACKEND_FAILED
            return no_result(qvi, status, message)
        arrays = [np.array(part, dtype=np.float64).ravel() for part in parts]
        nu = arrays[3] if qvi.p else np.zeros(0)
        iterations = int(getattr(self.problem.solver_stats, "num_iters", 0) or 0)
        return InnerSolution(centre.z + arrays[0], arrays[1], -arrays[2], nu, status, iterations, message)
