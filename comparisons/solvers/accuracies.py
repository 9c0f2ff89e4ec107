"""What every solver is asked for at each level of accuracy: the one table that all runs take their settings from.

Each solver measures its errors in norms of its own. So all are asked for a hundredth of the level's target, and judged
by the package's certificate at the target itself. Iteration limits are part of the table too: they decide when a
solver that does not converge gives up.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, Final

from qvi_contact.errors import InputError
from solvers import available

LEVELS: Final[Mapping[str, float]] = MappingProxyType({"low": 1e-3, "mid": 1e-6, "high": 1e-9})
"""Level → tolerance of the certificate."""

MARGIN: Final = 1e-2
"""What a solver is asked for, over the tolerance of the certificate."""

METHODS: Final = ("condensed", "uzawa")
"""Lines of the comparison that are whole methods of this package, not inner solvers."""

Options = Mapping[str, Any]


def _levels(names: Iterable[str], least: float = 0.0, **fixed: Any) -> dict[str, dict[str, Any]]:
    """The tolerance of each level, but not below `least`, under these names, beside options that no level changes."""
    names = tuple(names)
    return {level: {**dict.fromkeys(names, max(asked(level), least)), **fixed} for level in LEVELS}


def asked(level: str) -> float:
    """The tolerance that solvers are asked for at a level."""
    return float(f"{MARGIN * LEVELS[level]:.0e}")


_CLARABEL: Final = ("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_infeas_abs", "tol_infeas_rel")
_EMBEDDED: Final = ("abstol", "reltol", "feastol")
_BOTH: Final = ("eps_abs", "eps_rel")
_INFEASIBLE: Final = ("eps_prim_inf", "eps_dual_inf")
_ADMM_ITERATIONS: Final = 20_000
_INTERIOR_ITERATIONS: Final = 100

TABLE: Final[Mapping[str, Mapping[str, Options]]] = MappingProxyType({
    "qp:clarabel": _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS),
    "qp:cvxopt": _levels(_EMBEDDED, maxiters=_INTERIOR_ITERATIONS, refinement=2),
    "qp:daqp": _levels(("primal_tol", "dual_tol"), iter_limit=_ADMM_ITERATIONS),
    "qp:ecos": _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS),
    "qp:highs": _levels(
        ("primal_feasibility_tolerance", "dual_feasibility_tolerance"), 1e-10, qp_regularization_value=1e-11,
        qp_iteration_limit=_ADMM_ITERATIONS,
    ),
    "qp:osqp": _levels((*_BOTH, *_INFEASIBLE), max_iter=_ADMM_ITERATIONS, polishing=False),
    "qp:piqp": _levels((*_BOTH, "eps_duality_gap_abs", "eps_duality_gap_rel"), max_iter=_INTERIOR_ITERATIONS),
    "qp:proxqp": _levels(
        ("eps_abs", "eps_duality_gap_abs", "eps_duality_gap_rel"), eps_rel=0.0, check_duality_gap=True, max_iter=1000
    ),
    "qp:qpalm": _levels((*_BOTH, *_INFEASIBLE), max_iter=_ADMM_ITERATIONS),
    "qp:quadprog": {level: {} for level in LEVELS},
    "qp:scs": _levels((*_BOTH, "eps_infeas"), max_iters=_ADMM_ITERATIONS),
    "direct:clarabel": _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS),
    "direct:osqp": _levels((*_BOTH, *_INFEASIBLE), max_iter=_ADMM_ITERATIONS),
    "socp:clarabel": _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS),
    "socp:cvxopt": _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS, kktsolver="robust"),
    "socp:ecos": _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS),
    "socp:scs": _levels((*_BOTH, "eps_infeas"), max_iters=_ADMM_ITERATIONS),
    "condensed": _levels(("gap",)),
    "uzawa": {level: {"omega_T": 0.01, "max_iterations": _ADMM_ITERATIONS} for level in LEVELS},
})  # fmt: skip
"""Solver → level → its own options and their values."""

REMARKS: Final[Mapping[str, str]] = MappingProxyType({
    "qp:clarabel": "interior point",
    "qp:cvxopt": "interior point",
    "qp:daqp": "dual active set; dense",
    "qp:ecos": "interior point on a second-order cone program that `qpsolvers` makes of it, energy included; dense",
    "qp:highs": "primal active set; takes no tolerance below 1e-10",
    "qp:osqp": "operator splitting, not polished",
    "qp:piqp": "proximal interior point",
    "qp:proxqp": "augmented Lagrangian, absolute tolerances; those of infeasibility stay at 1e-4: `qpsolvers` does "
    "not hand them on",
    "qp:qpalm": "augmented Lagrangian",
    "qp:quadprog": "dual active set, exact up to rounding: has no tolerance and no limit; dense",
    "qp:scs": "operator splitting on cones",
    "direct:clarabel": "Clarabel without `qpsolvers`: one solver, its vectors updated",
    "direct:osqp": "OSQP without `qpsolvers`: one solver, its bounds updated, solved plain and polished",
    "socp:clarabel": "through `cvxpy`, one cone for each contact point",
    "socp:cvxopt": "through `cvxpy`, one cone for each contact point and one for the energy",
    "socp:ecos": "through `cvxpy`, one cone for each contact point and one for the energy",
    "socp:scs": "through `cvxpy`, one cone for each contact point",
    "condensed": "the package's interior point method on the whole inequality, without inner problems",
    "uzawa": "the paper's iteration, rule \"accumulating\"; has no tolerance but that of the certificate",
})  # fmt: skip
"""Solver → what it is, and what is special about its settings."""

KEPT: Final[Mapping[str, str]] = MappingProxyType({
    "qp:osqp": "starts at the last answer",
    "qp:proxqp": "starts at the last answer",
    "direct:clarabel": "solver kept, vectors updated",
    "direct:osqp": "solver kept, bounds updated, starts at the last answer",
    "socp:clarabel": "program kept, parameters updated",
    "socp:cvxopt": "program kept, parameters updated",
    "socp:ecos": "program kept, parameters updated",
    "socp:scs": "program kept, parameters updated",
})  # fmt: skip
"""Solver → what it keeps from one problem of a sequence to the next; all others begin anew each time."""


def options(solver: str, level: str) -> Options:
    """Options of a solver at a level, by its own names.

    Raises
    ------
    InputError
        If the table does not have it.

    """
    try:
        return TABLE[solver][level]
    except KeyError:
        raise InputError("solver", f"{solver}, {level}", f"choose one of {', '.join(TABLE)}") from None


def installed() -> tuple[str, ...]:
    """Solvers of the table that can be used here, in its order."""
    present = set(available())
    return tuple(name for name in TABLE if name in present or name in METHODS)


def missing() -> tuple[str, ...]:
    """Solvers of the table that are not installed."""
    present = installed()
    return tuple(name for name in TABLE if name not in present)


def without_row() -> tuple[str, ...]:
    """Inner solvers that are installed and not in the table: nobody has said yet what to ask them for."""
    return tuple(name for name in available() if name not in TABLE)
