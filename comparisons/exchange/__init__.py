"""Problems in formats of other programs (`qpbenchmark`, FCLIB, NumPy archives), and their files solved here.

    archive        .npz of any `FrictionQVI` and its solution
    local          the condensed problem (W, q, μ) of contact codes, from a `FrictionQVI` and back; Siconos' error of it
    fclib          that problem in the HDF5 layout of FCLIB, the Frictional Contact Library

Algebra only: no mesh is needed. One contact, u = W r + q with r = (r_N, r_T), which has three solutions:

    >>> from comparisons.exchange import LocalProblem, read_fclib, siconos_error, solve_local, write_fclib
    >>> problem = LocalProblem(W=[[1.0, 0.8], [0.8, 1.0]], q=[1.0, 2.1], mu=[2.0])
    >>> state, solution = solve_local(problem)
    >>> solution.status
    <Status.SOLVED: 'solved'>
    >>> siconos_error(problem, state.r) < 1e-12
    True
    >>> write_fclib("one_contact.hdf5", problem, state, title="One contact, three solutions")
    >>> bool(abs(read_fclib("one_contact.hdf5").solution.r - state.r).max() == 0.0)
    True

The same as (D2): unknowns z = r, energy ½ zᵀWz + qᵀz, tractions σ_N = −r_N and σ_T = r_T:

    >>> from solvers import FrictionQVI, solve_qvi
    >>> from comparisons.exchange import load_qvi, save_qvi
    >>> qvi = FrictionQVI.from_arrays(
    ...     K=[[1.0, 0.8], [0.8, 1.0]], f=[-1.0, -2.1], N=[[-1.0, 0.0]], n0=[0.0], T=[[0.0, 1.0]], t0=[0.0], mu=[2.0],
    ...     W=[1.0],
    ... )
    >>> save_qvi("one_contact.npz", qvi, solve_qvi(qvi))
    >>> again, solution = load_qvi("one_contact.npz")
    >>> solution.status
    <Status.SOLVED: 'solved'>
"""

from typing import TYPE_CHECKING

from solvers.basics.front import front

if TYPE_CHECKING:
    from comparisons.exchange.archive import load_qvi, save_qvi
    from comparisons.exchange.fclib import FCLIBFile, read_fclib, write_fclib
    from comparisons.exchange.local import (
        ContactState,
        LocalProblem,
        local_problem,
        siconos_error,
        solve_local,
        state_of,
    )

__all__ = [
    "ContactState",
    "FCLIBFile",
    "LocalProblem",
    "load_qvi",
    "local_problem",
    "read_fclib",
    "save_qvi",
    "siconos_error",
    "solve_local",
    "state_of",
    "write_fclib",
]

__getattr__ = front(
    __name__,
    {
        "archive": ("load_qvi", "save_qvi"),
        "fclib": ("FCLIBFile", "read_fclib", "write_fclib"),
        "local": (
            "ContactState", "LocalProblem", "local_problem", "project", "siconos_error", "solve_local", "state_of",
        ),
        "quadratic_programs": ("programs_of",),
    },
)  # fmt: skip
