"""Problems in formats of other programs: `qpbenchmark`, FCLIB, NumPy archives.

    archive        .npz of any `FrictionQVI` and its solution
    local          the condensed problem (W, q, μ) of contact codes, from a `FrictionQVI`; Siconos' error of a solution
    fclib          that problem in the HDF5 layout of FCLIB, the Frictional Contact Library

Algebra only: no mesh is needed. One contact, which has three solutions:

    >>> from solvers import FrictionQVI, solve_qvi
    >>> from comparisons.exchange import load_qvi, local_problem, save_qvi, siconos_error, state_of, write_fclib
    >>> qvi = FrictionQVI.from_arrays(
    ...     K=[[1.0, 0.8], [0.8, 1.0]], f=[-1.0, -2.1], N=[[-1.0, 0.0]], n0=[0.0], T=[[0.0, 1.0]], t0=[0.0], mu=[2.0],
    ...     W=[1.0],
    ... )
    >>> save_qvi("one_contact.npz", qvi, solve_qvi(qvi))
    >>> again, solution = load_qvi("one_contact.npz")
    >>> solution.status
    <Status.SOLVED: 'solved'>

As contact codes pose it, with forces r = (r_N, r_T) and displacements u = W r + q:

    >>> problem = local_problem(qvi)
    >>> state = state_of(problem, solution)
    >>> siconos_error(problem, state.r) < 1e-8
    True
    >>> write_fclib("one_contact.hdf5", problem, state, title="One contact, three solutions")
"""

from comparisons.exchange.archive import load_qvi, save_qvi
from comparisons.exchange.fclib import write_fclib
from comparisons.exchange.local import ContactState, LocalProblem, local_problem, siconos_error, state_of

__all__ = [
    "ContactState", "LocalProblem", "load_qvi", "local_problem", "save_qvi", "siconos_error", "state_of", "write_fclib",
]  # fmt: skip
