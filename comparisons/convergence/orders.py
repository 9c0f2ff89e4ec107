"""Observed orders of convergence: from successive meshes, and by least squares."""

from collections.abc import Sequence

import numpy as np

from qvi_contact.basics.checks import FloatArray


def successive_orders(sizes: Sequence[float], errors: Sequence[float]) -> FloatArray:
    """Orders p = log(e_{k−1}/e_k) / log(h_{k−1}/h_k) of errors e ~ hᵖ, one for each mesh.

    Sizes h > 0 of the meshes are all different from their neighbours, errors > 0, or NaN where one means nothing; p is
    NaN for the first mesh, and wherever one of the two errors is.
    """
    h, e = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    return np.concatenate([[np.nan] * min(len(h), 1), np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])])


def fitted_order(sizes: Sequence[float], errors: Sequence[float], last: int = 3) -> float:
    """Slope of log e over log h by least squares over the last meshes whose error is not NaN.

    NaN with fewer than `last` of them: two meshes make a straight line of anything.
    """
    pairs = np.array([sizes, errors], dtype=float)
    h, e = np.log(pairs[:, ~np.isnan(pairs[1])][:, -last:])
    return float(np.polynomial.polynomial.polyfit(h - h.mean(), e, 1)[1]) if len(h) == last else float("nan")


def reached(costs: Sequence[float], errors: Sequence[float], target: float) -> float:
    """The least cost from which on all errors stay within the target; NaN if even the last one does not.

    An error that a finer mesh does not confirm is small by chance and does not count.
    """
    found = float("nan")
    for cost, error in sorted(zip(costs, errors, strict=True), reverse=True):
        if error > target:
            break
        found = cost
    return found
