"""Inner solver ``qp:<name>``: any back end of `qpsolvers`, the problem rebuilt for every bound.

Solves (`InnerProblem`) min ½xᵀPx + qᵀx, G x ≤ h, A x = b. The words "found" and "is_optimal" of `qpsolvers`
are not used: the former means different things for different back ends, the latter accepts multipliers of the
wrong sign. Cite: S. Caron et al., qpsolvers: Quadratic Programming Solvers in Python.
"""

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import field
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csc_matrix, triu, vstack

from solvers.basics.progress import deadline
from solvers.basics.records import dataclass
from solvers.basics.status import Status
from solvers.basics.types import Sparse, Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.linear_program import within_time
from solvers.inner.problem import Centre, InnerProblem, InnerSolution, no_result


class QPSolver:
    """One `qpsolvers` back end for one QVI."""

    def __init__(self, qvi: FrictionQVI, name: str, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self.name = name
        self.backend = BACKENDS[name]
        self.packages: tuple[str, ...] = ("qpsolvers", self.backend.package or self.backend.module)
        self._inner = InnerProblem(qvi)
        self._settings = self.backend.settings(tolerance) if options is None else dict(options)
        matrices = (qvi.K, self._inner.G, qvi.A)  # for qpsolvers sparse means csc_matrix, no sparse array
        self._matrices = [
            matrix.toarray() if self.backend.dense else csc_matrix(matrix, copy=True) for matrix in matrices
        ]

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the bound threshold (m,); warnings end in the message."""
        began = time.perf_counter()
        P, G, A = self._matrices
        qvi, equalities = self._inner.qvi, (A, centre.b) if self._inner.qvi.p else (None, None)
        initial = start.z - centre.z if self.backend.warm and start is not None and start.finite else None
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            qpsolvers = load("qpsolvers")
            problem = qpsolvers.Problem(P, -centre.f, G, centre.h(threshold), *equalities)
            settings = within_time(self._settings, self.backend.limit)
            answer = qpsolvers.solve_problem(problem, self.name, initvals=initial, **settings)
        seconds, word = time.perf_counter() - began, self.backend.word(answer)
        status = self.backend.words.get(word, Status.BACKEND_FAILED)
        message = "; ".join([f"{self.name}: {word}", *(str(w.message) for w in caught)])
        if any(part is None or np.size(part) != size for part, size in ((answer.x, qvi.n), (answer.z, 3 * qvi.m))):
            return no_result(qvi, Status.BACKEND_FAILED if status.usable else status, message, seconds)
        m_N, m_T = self._inner.multipliers(np.array(answer.z, dtype=np.float64))
        nu = np.array(answer.y, dtype=np.float64) if qvi.p else np.zeros(0)
        z = centre.z + np.array(answer.x, dtype=np.float64)
        return InnerSolution(z, m_N, m_T, nu, status, self.backend.iterations(answer), seconds, message)


# Every `qpsolvers` back end in one table: where it lives, its settings for a tolerance, its status words.
#
# A row is all it takes to add a back end.


_FOUND = MappingProxyType({"found": Status.SOLVED, "not found": Status.BACKEND_FAILED})

_EXACT = MappingProxyType({"found": Status.SOLVED, "not found": Status.INFEASIBLE})


def _found(solution: Any) -> str:
    return "found" if solution.found else "not found"


@dataclass(frozen=True)
class QPBackend:
    """How to ask one back end for a tolerance and how to read its answer.

    Attributes
    ----------
    module : what to import, looked for without importing it
    package : its distribution, for the record of versions
    tolerances : settings that take the tolerance
    options : further settings
    floor : smallest tolerance it is asked for; below it fails or does not terminate
    limit : setting that takes a limit of time in seconds, if there is one
    dense : takes dense matrices only
    warm : takes the previous z as a start and gains from it
    word : its status as a word, from `qpsolvers.Solution`
    words : that word → `Status`; an unlisted word is backend_failed
    iterations : its iteration count, from `qpsolvers.Solution`

    """

    module: str
    package: str = ""
    tolerances: tuple[str, ...] = ()
    options: Mapping[str, Any] = field(default_factory=dict)
    floor: float = 1e-12
    limit: str = ""
    dense: bool = False
    warm: bool = False
    word: Callable[[Any], str] = _found
    words: Mapping[str, Status] = field(default_factory=lambda: _FOUND)
    iterations: Callable[[Any], int] = lambda _: 0

    def settings(self, tolerance: float) -> dict[str, Any]:
        """Keyword arguments for `qpsolvers.solve_problem` at the tolerance, not below `floor`."""
        return {**dict.fromkeys(self.tolerances, max(tolerance, self.floor)), **self.options}


CLARABEL_WORDS: Mapping[str, Status] = MappingProxyType(
    {
        "Solved": Status.SOLVED,
        "AlmostSolved": Status.INACCURATE,
        "InsufficientProgress": Status.STALLED,
        "PrimalInfeasible": Status.INFEASIBLE,
        "AlmostPrimalInfeasible": Status.INFEASIBLE,
        "DualInfeasible": Status.UNBOUNDED,
        "AlmostDualInfeasible": Status.UNBOUNDED,
        "MaxIterations": Status.MAX_ITERATIONS,
        "MaxTime": Status.TIME_LIMIT,
    }
)
"""Status words of Clarabel."""

OSQP_WORDS: Mapping[str, Status] = MappingProxyType(
    {
        "solved": Status.SOLVED,
        "solved inaccurate": Status.INACCURATE,
        "primal infeasible": Status.INFEASIBLE,
        "primal infeasible inaccurate": Status.INFEASIBLE,
        "dual infeasible": Status.UNBOUNDED,
        "dual infeasible inaccurate": Status.UNBOUNDED,
        "maximum iterations reached": Status.MAX_ITERATIONS,
        "run time limit reached": Status.TIME_LIMIT,
        "problem non convex": Status.UNBOUNDED,
    }
)
"""Status words of OSQP."""

BACKENDS: Mapping[str, QPBackend] = MappingProxyType(
    {
        "clarabel": QPBackend(
            "clarabel",
            tolerances=("tol_gap_abs", "tol_gap_rel", "tol_feas"),
            limit="time_limit",
            word=lambda s: str(s.extras["status"]),
            words=CLARABEL_WORDS,
        ),
        "cvxopt": QPBackend(
            "cvxopt",
            tolerances=("abstol", "reltol", "feastol"),
            options={"maxiters": 200, "refinement": 2},
            floor=1e-11,
            word=lambda s: str(s.extras["status"]),
            # "unknown" is the word for "stopped early", iterate included
            words={"optimal": Status.SOLVED, "unknown": Status.STALLED},
            iterations=lambda s: int(s.extras["iterations"]),
        ),
        "daqp": QPBackend(
            "daqp",
            tolerances=("primal_tol", "dual_tol"),
            options={"iter_limit": 100_000},
            limit="time_limit",
            dense=True,
        ),
        "ecos": QPBackend(
            "ecos",
            tolerances=("feastol", "abstol", "reltol"),
            options={"max_iters": 200},
            floor=1e-11,
            word=lambda s: str(s.extras["exitFlag"]),
            words={
                "0": Status.SOLVED,
                "10": Status.INACCURATE,
                "1": Status.INFEASIBLE,
                "11": Status.INFEASIBLE,
                "2": Status.UNBOUNDED,
                "12": Status.UNBOUNDED,
                "-1": Status.MAX_ITERATIONS,
                "-2": Status.STALLED,
            },
            iterations=lambda s: int(s.extras["iter"]),
        ),
        "highs": QPBackend(
            "highspy",
            tolerances=("primal_feasibility_tolerance", "dual_feasibility_tolerance"),
            options={"qp_regularization_value": 1e-11},  # its default, 1e-7, is the relative error of one solve
            floor=1e-10,
            limit="time_limit",
        ),
        "osqp": QPBackend(
            "osqp",
            tolerances=("eps_abs", "eps_rel"),
            options={"max_iter": 100_000, "polishing": False},
            floor=1e-11,
            limit="time_limit",
            warm=True,
            word=lambda s: str(s.extras["info"].status),
            words=OSQP_WORDS,
            iterations=lambda s: int(s.extras["info"].iter),
        ),
        "piqp": QPBackend(
            "piqp",
            tolerances=("eps_abs", "eps_rel", "eps_duality_gap_abs", "eps_duality_gap_rel"),
            options={"max_iter": 500},
            word=lambda s: s.extras["info"].status.name,
            words={
                "PIQP_SOLVED": Status.SOLVED,
                "PIQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
                "PIQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
                "PIQP_DUAL_INFEASIBLE": Status.UNBOUNDED,
                "PIQP_NUMERICS": Status.STALLED,
            },
            iterations=lambda s: int(s.extras["info"].iter),
        ),
        "proxqp": QPBackend(
            "proxsuite",
            tolerances=("eps_abs", "eps_duality_gap_abs", "eps_duality_gap_rel"),
            options={"eps_rel": 0.0, "check_duality_gap": True, "max_iter": 10_000},
            floor=1e-11,
            warm=True,
            word=lambda s: s.extras["info"].status.name,
            words={
                "PROXQP_SOLVED": Status.SOLVED,
                "PROXQP_MAX_ITER_REACHED": Status.MAX_ITERATIONS,
                "PROXQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
                "PROXQP_DUAL_INFEASIBLE": Status.UNBOUNDED,
                "PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE": Status.INFEASIBLE,
            },
            iterations=lambda s: int(s.extras["info"].iter),
        ),
        "qpalm": QPBackend(
            "qpalm",
            tolerances=("eps_abs", "eps_rel", "eps_abs_in", "eps_rel_in"),
            options={"max_iter": 100_000},
            limit="time_limit",
            warm=True,
            word=lambda s: str(s.extras["info"].status),
            words={
                "solved": Status.SOLVED,
                "primal infeasible": Status.INFEASIBLE,
                "dual infeasible": Status.UNBOUNDED,
                "maximum iterations exceeded": Status.MAX_ITERATIONS,
                "maximum iterations reached": Status.MAX_ITERATIONS,
                "time limit exceeded": Status.TIME_LIMIT,
            },
            iterations=lambda s: int(s.extras["info"].iter),
        ),
        "quadprog": QPBackend(
            "quadprog",
            dense=True,
            words=_EXACT,
            iterations=lambda s: int(s.extras["iterations"][0]) if s.found else 0,
        ),
        "scs": QPBackend(
            "scs",
            tolerances=("eps_abs", "eps_rel"),
            options={"max_iters": 100_000},
            floor=1e-10,
            limit="time_limit_secs",
            word=lambda s: str(s.extras["status_val"]),
            words={
                "1": Status.SOLVED,
                "2": Status.INACCURATE,
                "-2": Status.INFEASIBLE,
                "-7": Status.INFEASIBLE,
                "-1": Status.UNBOUNDED,
                "-6": Status.UNBOUNDED,
                "-3": Status.STALLED,
            },
            iterations=lambda s: int(s.extras["iter"]),
        ),
        "copt": QPBackend("coptpy"),
        "gurobi": QPBackend("gurobipy"),
        "hpipm": QPBackend("hpipm_python", dense=True),
        "kvxopt": QPBackend("kvxopt"),
        "mosek": QPBackend("mosek"),
        "qpax": QPBackend("qpax", dense=True),
        "qpoases": QPBackend("qpoases", dense=True),
        "qpswift": QPBackend("qpSWIFT", dense=True),
        "qtqp": QPBackend("qtqp"),
        "sip": QPBackend("sip_qp_python"),
    }
)
"""Name in `qpsolvers` → how it is used."""


# Inner solver ``direct:clarabel``: one Clarabel solver kept alive, only the vectors updated.
#
# Interior point with a homogeneous embedding; does not warm-start, but keeps the symbolic factorisation and
# the equilibration. Presolve, chordal decomposition and the dropping of zeros are off: they forbid updates.
# Cite: P. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic objectives.


_FLOOR = 1e-12


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

    def __init__(self, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        self._inner = InnerProblem(qvi)
        if options is None:
            options = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), max(tolerance, _FLOOR))
        options = {**options, "chordal_decomposition_enable": False, "input_sparse_dropzeros": False}
        right = np.ones(3 * qvi.m)  # of no meaning: every solve sets its own
        self._solver = clarabel_solver(qvi.K, -qvi.f, qvi, self._inner.G, right, options)

    def solve(
        self,
        threshold: Vector,
        centre: Centre,
        start: InnerSolution | None,  # noqa: ARG002
    ) -> InnerSolution:
        """Solve for the bound threshold (m,); `start` is not used."""
        began = time.perf_counter()
        qvi = self._inner.qvi
        b = np.concatenate([centre.b, centre.h(threshold)])
        settings, seconds = self._solver.get_settings(), deadline.left
        if seconds < settings.time_limit:
            settings.time_limit = seconds
            self._solver.update(settings=settings)
        self._solver.update(q=-centre.f, b=b)
        answer = self._solver.solve()
        word = str(answer.status)
        multipliers = np.array(answer.z)
        m_N, m_T = self._inner.multipliers(multipliers[qvi.p :])
        return InnerSolution(
            centre.z + np.array(answer.x), m_N, m_T, multipliers[: qvi.p],
            CLARABEL_WORDS.get(word, Status.BACKEND_FAILED), int(answer.iterations),
            time.perf_counter() - began, f"clarabel: {word}",
        )  # fmt: skip
