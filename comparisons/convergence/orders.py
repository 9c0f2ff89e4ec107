"""Observed orders of convergence: from successive meshes, and by least squares."""

from collections.abc import Sequence

import numpy as np


def successive_orders(sizes: Sequence[float], errors: Sequence[float | None]) -> list[float | None]:
    """Orders p = log(e_{k−1}/e_k) / log(h_{k−1}/h_k) of errors e ~ hᵖ, one for each mesh.

    Parameters
    ----------
    sizes : sequence of float
        Sizes h > 0 of the meshes, all different from their neighbours.
    errors : sequence of float or None
        Errors > 0, None where an error means nothing.

    Returns
    -------
    list of float or None
        None for the first mesh, and wherever one of the two errors is None.

    """
    found: list[float | None] = [None]
    for (h0, e0), (h1, e1) in zip(_pairs(sizes, errors)[:-1], _pairs(sizes, errors)[1:], strict=True):
        found.append(None if e0 is None or e1 is None else float(np.log(e0 / e1) / np.log(h0 / h1)))
    return found


def fitted_order(sizes: Sequence[float], errors: Sequence[float | None], last: int = 3) -> float | None:
    """Slope of log e over log h by least squares over the last meshes whose error means something.

    None with fewer than `last` of them: two meshes make a straight line of anything.
    """
    known = [(h, e) for h, e in _pairs(sizes, errors) if e is not None][-last:]
    if len(known) < last:
        return None
    h, e = np.log(np.array(known)).T
    return float(np.polynomial.polynomial.polyfit(h - h.mean(), e, 1)[1])


def reached(costs: Sequence[float], errors: Sequence[float], target: float) -> float | None:
    """The least cost from which on all errors stay within the target; None if even the last one does not.

    An error that a finer mesh does not confirm is small by chance and does not count.
    """
    found = None
    for cost, error in sorted(zip(costs, errors, strict=True), reverse=True):
        if error > target:
            break
        found = cost
    return found


def _pairs(sizes: Sequence[float], errors: Sequence[float | None]) -> list[tuple[float, float | None]]:
    return list(zip(sizes, errors, strict=True))
