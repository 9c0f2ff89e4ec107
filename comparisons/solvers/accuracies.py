"""Options of every solver at each level of accuracy: all runs take their settings from this table.

Solvers measure errors in different norms. So all are asked for a hundredth of the level's tolerance, and judged by the
package's certificate at the tolerance itself. Iteration limits decide when a solver that does not converge gives up.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from solvers import available

LEVELS: Final[Mapping[str, float]] = {"low": 1e-3, "mid": 1e-6, "high": 1e-9}
"""Level → tolerance of the certificate."""

MARGIN: Final = 1e-2
"""Tolerance that a solver is asked for, over that of the certificate."""

METHODS: Final = ("condensed", "uzawa")
"""Solvers of the comparison that are whole methods of this package, not inner solvers."""

Options = Mapping[str, Any]


def _levels(names: Iterable[str], least: float = 0.0, **fixed: Any) -> dict[str, dict[str, Any]]:
    """Options by level: the tolerance, at least `least`, under each of these names, and the fixed options."""
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


class Backend(NamedTuple):
    """A solver: a remark on its method, and its options at each level."""

    remark: str
    levels: Mapping[str, Options]


_CONE: Final = "through `cvxpy`, one cone for each contact point"
_CONES: Final = "through `cvxpy`, one cone for each contact point and one for the energy"

TABLE: Final[Mapping[str, Backend]] = {
    "qp:clarabel": Backend("interior point", _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS)),
    "qp:cvxopt": Backend("interior point", _levels(_EMBEDDED, maxiters=_INTERIOR_ITERATIONS, refinement=2)),
    "qp:daqp": Backend("dual active set; dense", _levels(("primal_tol", "dual_tol"), iter_limit=_ADMM_ITERATIONS)),
    "qp:ecos": Backend(
        "interior point on a second-order cone program that `qpsolvers` makes of it, energy included; dense",
        _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS),
    ),
    "qp:highs": Backend("primal active set; takes no tolerance below 1e-10", _levels(
        ("primal_feasibility_tolerance", "dual_feasibility_tolerance"), 1e-10, qp_regularization_value=1e-11,
        qp_iteration_limit=_ADMM_ITERATIONS,
    )),
    "qp:osqp": Backend(
        "operator splitting, not polished",
        _levels((*_BOTH, *_INFEASIBLE), max_iter=_ADMM_ITERATIONS, polishing=False),
    ),
    "qp:piqp": Backend("proximal interior point", _levels(
        (*_BOTH, "eps_duality_gap_abs", "eps_duality_gap_rel"), max_iter=_INTERIOR_ITERATIONS
    )),
    "qp:proxqp": Backend(
        "augmented Lagrangian, absolute tolerances; those of infeasibility stay at 1e-4: `qpsolvers` does not hand "
        "them on",
        _levels(("eps_abs", "eps_duality_gap_abs", "eps_duality_gap_rel"), eps_rel=0.0, check_duality_gap=True,
                max_iter=1000),
    ),
    "qp:qpalm": Backend("augmented Lagrangian", _levels((*_BOTH, *_INFEASIBLE), max_iter=_ADMM_ITERATIONS)),
    "qp:quadprog": Backend(
        "dual active set, exact up to rounding: has no tolerance and no limit; dense", {level: {} for level in LEVELS}
    ),
    "qp:scs": Backend("operator splitting on cones", _levels((*_BOTH, "eps_infeas"), max_iters=_ADMM_ITERATIONS)),
    "direct:clarabel": Backend(
        "Clarabel without `qpsolvers`: one solver, its vectors updated",
        _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS),
    ),
    "socp:clarabel": Backend(_CONE, _levels(_CLARABEL, max_iter=_INTERIOR_ITERATIONS)),
    "socp:cvxopt": Backend(_CONES, _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS, kktsolver="robust")),
    "socp:ecos": Backend(_CONES, _levels(_EMBEDDED, max_iters=_INTERIOR_ITERATIONS)),
    "socp:scs": Backend(_CONE, _levels((*_BOTH, "eps_infeas"), max_iters=_ADMM_ITERATIONS)),
    "condensed": Backend(
        "the package's interior point method on the whole inequality, without inner problems", _levels(("gap",))
    ),
    "uzawa": Backend(
        "the paper's iteration, rule \"accumulating\"; has no tolerance but that of the certificate",
        {level: {"omega_T": 0.01, "max_iterations": _ADMM_ITERATIONS} for level in LEVELS},
    ),
}  # fmt: skip
"""All solvers, in the order of the tables."""


def options(solver: str, level: str) -> Options:
    """Options of a solver of the table at a level, by its own names."""
    return TABLE[solver].levels[level]


def installed() -> tuple[str, ...]:
    """Solvers of the table that can be used here, in its order."""
    present = set(available())
    return tuple(name for name in TABLE if name in present or name in METHODS)
