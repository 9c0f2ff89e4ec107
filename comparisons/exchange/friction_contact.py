"""Quadratic programs inside frictional contact problems: a test set for `qpbenchmark`.

    qpbenchmark friction_contact.py --results-path results.csv run
    qpbenchmark friction_contact_sparse.py --results-path results_sparse.csv run

The problems are the files beside this one, problems/*.npz, written by ``python -m comparisons export qpbenchmark``.
Each is a frictional contact problem with a given friction bound thr, in stresses z (equilibrium elements):

    min ½ zᵀPz + qᵀz   s.t.   G z ≤ h,  A z = b,      G = [N; T; −T],  h = [−n0; thr − t0; thr + t0]

N z + n0 ≤ 0 are normal, |T z + t0| ≤ thr tangential tractions at three points on each edge. There are as many rows of N
and T as parameters of the tractions, which may depend on each other by equilibrium, as in ssnv128. Names say

    full, condensed      z are all unknowns (sparse, P as badly conditioned as fine meshes make it), or few that only
                         describe the contact (dense, P = 1)
    converged, cold      thr = μ s with the pressure s of the solution, or of a body that neither slips nor opens

All have a unique minimiser.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import qpbenchmark
from scipy.sparse import csc_matrix

FOLDER = Path(__file__).parent / "problems"


class FrictionContact(qpbenchmark.TestSet):
    """All problems, with dense matrices, so that every solver can take part."""

    title = "Frictional contact test set"
    description = "Quadratic programs inside frictional contact problems, condensed and full, dense matrices."
    sparse_only = False

    def __iter__(self) -> Iterator[qpbenchmark.Problem]:
        """Yield the problems in the order of their names; if `sparse_only`, those in all unknowns."""
        for file in sorted(FOLDER.glob("*_full_*.npz" if self.sparse_only else "*.npz")):
            problem: Any = load_problem(file)
            yield problem if self.sparse_only else problem.to_dense()


class FrictionContactSparse(FrictionContact):
    """The problems in all unknowns, with sparse matrices, for solvers that take those."""

    title = "Frictional contact test set, sparse"
    description = "Quadratic programs inside frictional contact problems, in all unknowns, sparse matrices."
    sparse_only = True


def load_problem(file: Path) -> qpbenchmark.Problem:
    """Read a problem, named as the file, with matrices in compressed columns."""
    with np.load(file, allow_pickle=False) as arrays:
        G, A = _matrix(arrays, "G"), _matrix(arrays, "A")
        h, b = (arrays["h"] if G is not None else None), (arrays["b"] if A is not None else None)
        return qpbenchmark.Problem(_matrix(arrays, "P"), arrays["q"], G, h, A, b, None, None, name=file.stem)


def _matrix(arrays: Any, name: str) -> Any:
    """A matrix, or None if it has no rows."""
    m, n = (int(size) for size in arrays[f"{name}_shape"])
    parts = (arrays[f"{name}_data"], arrays[f"{name}_indices"], arrays[f"{name}_indptr"])
    return csc_matrix(parts, (m, n)) if m else None
