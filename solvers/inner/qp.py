"""Inner solvers ``qp:<name>``, any back end of `qpsolvers`, and ``direct:clarabel``.

The words "found" and "is_optimal" of `qpsolvers` are not used where a back end says more: the former means different
things for different back ends, the latter accepts multipliers of the wrong sign. Cite: S. Caron et al., qpsolvers:
Quadratic Programming Solvers in Python.
"""

import re
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
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
    """One `qpsolvers` back end for one QVI, the problem rebuilt for every bound."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self._qvi, self._name, self._backend = qvi, name, BACKENDS[name]
        self.packages: tuple[str, ...] = ("qpsolvers", self._backend.module)
        self._settings = self._backend.settings(tolerance) if options is None else dict(options)
        matrices = (qvi.K, limited_rows(qvi), qvi.A)  # for qpsolvers sparse means csc_matrix, no sparse array
        self._matrices = [
            matrix.toarray() if self._backend.dense else csc_matrix(matrix, copy=True) for matrix in matrices
        ]

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the bound threshold (m,); warnings end in the message."""
        began, qvi, backend = time.perf_counter(), self._qvi, self._backend
        P, G, A = self._matrices
        equalities = (A, centre.b) if qvi.p else (None, None)
        initial = start.z - centre.z if backend.warm and start is not None and start.finite else None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            qpsolvers = load("qpsolvers")
            problem = qpsolvers.Problem(P, -centre.f, G, centre.h(threshold), *equalities)
            settings = within_time(self._settings, backend.limit)
            answer = qpsolvers.solve_problem(problem, self._name, initvals=initial, **settings)
        word, iterations = _said(answer, backend.otherwise)
        status, seconds = meaning(word), time.perf_counter() - began
        message = "; ".join([f"{self._name}: {word}", *(str(w.message) for w in caught)])
        if any(part is None or np.size(part) != size for part, size in ((answer.x, qvi.n), (answer.z, 3 * qvi.m))):
            return no_result(qvi, Status.BACKEND_FAILED if status.usable else status, message, seconds)
        m_N, m_T = row_multipliers(np.array(answer.z, dtype=np.float64))
        nu = np.array(answer.y, dtype=np.float64) if qvi.p else np.zeros(0)
        z = centre.z + np.array(answer.x, dtype=np.float64)
        return InnerSolution(z, m_N, m_T, nu, status, iterations, seconds, message)


def _said(answer: Any, otherwise: str) -> tuple[str, int]:
    """A back end's status in its own words, and its number of iterations, 0 if it does not say."""
    extras = answer.extras

    def told(name: str) -> Any:
        return extras.get(name, getattr(extras.get("info"), name, None))

    status = next((told(name) for name in ("infostring", "status") if told(name) is not None), None)
    word = str(getattr(status, "name", status))
    if status is None or isinstance(status, int):  # most numbers are not said what they mean
        word = "solved" if answer.found else otherwise
    iterations = told("iter") if told("iterations") is None else told("iterations")
    return word, 0 if iterations is None else int(np.ravel(iterations)[0])


_MEANINGS: Final = (
    ("dual infeasible|^unbounded|non convex", Status.UNBOUNDED),
    ("infeasible|closest primal feasible", Status.INFEASIBLE),
    ("inaccurate|almost|close to", Status.INACCURATE),
    (r"\bmax.* iter|user limit", Status.MAX_ITERATIONS),
    (r"\btime\b", Status.TIME_LIMIT),
    (r"\bsolved\b|\boptimal\b", Status.SOLVED),
    # of CVXOPT "unknown" is the word for "stopped early", iterate included
    ("numerics|numerical problems|insufficient progress|indeterminate|^unknown$", Status.STALLED),
)


def meaning(word: str) -> Status:
    """What a back end's status word means: the first of `_MEANINGS` that it contains; backend_failed for none."""
    plain = re.sub(r"[\W_]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", word)).lower()
    return next((status for pattern, status in _MEANINGS if re.search(pattern, plain)), Status.BACKEND_FAILED)


@dataclass(frozen=True)
class QPBackend:
    """How to ask one back end for a tolerance and how to read its answer.

    Attributes
    ----------
    module : what to import, looked for without importing it
    tolerances : settings that take the tolerance
    options : further settings
    floor : smallest tolerance it is asked for; below it fails or does not terminate
    limit : setting that takes a limit of time in seconds, if there is one
    dense : takes dense matrices only
    warm : takes the previous z as a start and gains from it
    otherwise : what it means where it finds nothing and does not say why

    """

    module: str
    tolerances: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    floor: float = 1e-12
    limit: str = ""
    dense: bool = False
    warm: bool = False
    otherwise: str = "failed"

    def settings(self, tolerance: float) -> dict[str, Any]:
        """Keyword arguments for `qpsolvers.solve_problem` at the tolerance, not below `floor`."""
        return {**dict.fromkeys(self.tolerances, max(tolerance, self.floor)), **self.options}


_GAPS: Final = ("eps_duality_gap_abs", "eps_duality_gap_rel")
_OTHERS: Final = {
    "copt": "coptpy", "gurobi": "gurobipy", "kvxopt": "kvxopt", "mosek": "mosek", "qtqp": "qtqp",
    "sip": "sip_qp_python",
}  # fmt: skip
_DENSE_OTHERS: Final = {"hpipm": "hpipm_python", "qpax": "qpax", "qpoases": "qpoases", "qpswift": "qpSWIFT"}

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
        "piqp": QPBackend("piqp", ("eps_abs", "eps_rel", *_GAPS), {"max_iter": 500}),
        "proxqp": QPBackend(
            "proxsuite",
            ("eps_abs", *_GAPS),
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
        **{name: QPBackend(module) for name, module in _OTHERS.items()},
        **{name: QPBackend(module, dense=True) for name, module in _DENSE_OTHERS.items()},
    }
)
"""Name in `qpsolvers` → how it is used: a row is all it takes to add a back end."""


# Inner solver ``direct:clarabel``: one Clarabel solver kept alive, only the vectors updated.
#
# Interior point with a homogeneous embedding; does not warm-start, but keeps the symbolic factorisation and
# the equilibration. Presolve, chordal decomposition and the dropping of zeros are off: they forbid updates.
# Cite: P. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic objectives.


def clarabel_solver(P: Sparse, q: Vector, qvi: FrictionQVI, G: Sparse, h: Vector, options: Mapping[str, Any]) -> Any:
    """Clarabel's solver of the least ½zᵀPz + qᵀz with A z = b and G z ≤ h, silent and without presolve."""
    clarabel = load("clarabel")
    settings = clarabel.DefaultSettings()
    for name, value in {**options, "verbose": False, "presolve_enable": False}.items():
        setattr(settings, name, value)
    cones = [*([clarabel.ZeroConeT(qvi.p)] if qvi.p else []), clarabel.NonnegativeConeT(h.size)]
    rows = csc_array(vstack([qvi.A, G])) if qvi.p else G
    return clarabel.DefaultSolver(csc_array(triu(P)), q, rows, np.concatenate([qvi.b, h]), cones, settings)


class DirectClarabel:
    """Clarabel on  A x + w = b (w = 0),  G x + w = h (w ≥ 0)."""

    packages: tuple[str, ...] = ("clarabel",)

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self._qvi = qvi
        options = BACKENDS[name].settings(tolerance) if options is None else options
        options = {**options, "chordal_decomposition_enable": False, "input_sparse_dropzeros": False}
        right = np.ones(3 * qvi.m)  # of no meaning: every solve sets its own
        self._solver = clarabel_solver(qvi.K, -qvi.f, qvi, limited_rows(qvi), right, options)

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:  # noqa: ARG002
        """Solve for the bound threshold (m,); `start` is not used."""
        began = time.perf_counter()
        settings, seconds = self._solver.get_settings(), deadline.left
        if seconds < settings.time_limit:
            settings.time_limit = seconds
            self._solver.update(settings=settings)
        self._solver.update(q=-centre.f, b=np.concatenate([centre.b, centre.h(threshold)]))
        answer = self._solver.solve()
        word, z, multipliers = str(answer.status), centre.z + np.array(answer.x), np.array(answer.z)
        m_N, m_T = row_multipliers(multipliers[self._qvi.p :])
        nu, seconds = multipliers[: self._qvi.p], time.perf_counter() - began
        return InnerSolution(z, m_N, m_T, nu, meaning(word), int(answer.iterations), seconds, f"clarabel: {word}")
