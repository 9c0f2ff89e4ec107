"""How fast an outer loop was seen to converge."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from solvers.solution.solution import Iteration

_LAST: Final = 10  # residuals that count, from the end
_LEAST: Final = 4  # of them, or there is no estimate
_FLOOR: Final = 1e-13  # residuals below this are rounding


def observed_contraction(history: "Sequence[Iteration]") -> float | None:
    """Factor by which the residual shrank in each of the last iterations.

    Of the last ten residuals r_k above 1e-13 the median of log(r_j / r_i) / (j − i) over all pairs i < j (the slope of
    Theil and Sen), as a factor: a single lucky or spoilt iteration does not count. Above 1 the loop diverges. With
    Anderson's acceleration it is the factor of the accelerated loop, usually smaller than the Lipschitz constant of the
    map that `uniqueness` bounds. Where inner problems were solved, entries without one, such as Newton's method after
    the loop, are no steps of it and do not count.

    Returns
    -------
    float, or None if there are fewer than four such residuals.

    """
    nested = any(entry.inner_status is not None for entry in history)
    steps = [entry for entry in history if entry.inner_status is not None or not nested]
    found = [(entry.number, entry.residual) for entry in steps if np.isfinite(entry.residual)]
    chosen = [(number, residual) for number, residual in found if residual > _FLOOR][-_LAST:]
    if len(chosen) < _LEAST:
        return None
    number, residual = np.array(chosen).T
    first, second = np.triu_indices(len(number), 1)
    slopes = np.log(residual[second] / residual[first]) / (number[second] - number[first])
    return float(np.exp(np.median(slopes)))
