"""Problems in formats of other programs: `qpbenchmark`, FCLIB, NumPy archives.

    archive        .npz of any `FrictionQVI` and its solution
    local          the condensed problem (W, q, μ) of contact codes, from a `FrictionQVI`, its files in FCLIB's layout;
                   Siconos' error of a solution

Algebra only: no mesh is needed. Of any `FrictionQVI` and its solution, as contact codes pose it:

    problem = local_problem(qvi)
    state = state_of(problem, solution)
    print(siconos_error(problem, state.r))
    write_fclib("one_contact.hdf5", problem, state, title="One contact, three solutions")
"""

from comparisons.exchange.archive import load_qvi, save_qvi
from comparisons.exchange.local import ContactState, LocalProblem, local_problem, siconos_error, state_of, write_fclib

__all__ = [
    "ContactState", "LocalProblem", "load_qvi", "local_problem", "save_qvi", "siconos_error", "state_of", "write_fclib",
]  # fmt: skip
