"""What the errors along a sequence of meshes are worth: observed orders, and the unknowns that an error costs."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pandas import DataFrame, Series

from comparisons.convergence.mesh.problems import Expected
from comparisons.convergence.mesh.study import UNIFORM
from qvi_contact.basics.checks import FloatArray

SAME: Final = 0.1
"""How far, relatively, a fitted order may be from the expected one to count as the same."""

STEADY: Final = 0.05
"""How far, relatively, the last three orders may be from each other to count as settled."""

FLAT: Final = 0.1
"""An order of this size or below is none: the error does not fall."""

EXPECTED: Final = "as expected"


def successive_orders(sizes: Sequence[float], errors: Sequence[float]) -> FloatArray:
    """Orders p = log(e_{k−1}/e_k) / log(h_{k−1}/h_k) of errors e ~ hᵖ, one for each mesh.

    Sizes h > 0 of the meshes are all different from their neighbours, errors > 0, or NaN where one means nothing; p is
    NaN for the first mesh, and wherever one of the two errors is.
    """
    h, e = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    return np.concatenate([[np.nan] * min(len(h), 1), np.log(e[:-1] / e[1:]) / np.log(h[:-1] / h[1:])])


def fitted_order(sizes: Sequence[float], errors: Sequence[float]) -> float:
    """Slope of log e over log h by least squares over the last three meshes whose error is not NaN.

    NaN with fewer: two meshes make a straight line of anything.
    """
    pairs = np.array([sizes, errors], dtype=float)
    h, e = np.log(pairs[:, ~np.isnan(pairs[1])][:, -3:])
    return float(np.polynomial.polynomial.polyfit(h - h.mean(), e, 1)[1]) if len(h) == 3 else float("nan")


def orders_of(points: DataFrame, expected: Expected | None = None) -> dict[str, Any]:
    """What the orders of the errors along a sequence are worth.

    Returns
    -------
    dict
        last, fitted : orders in h of the last two meshes whose errors mean something, and by least squares of the last
        three; NaN without them
        expected, reason : what theory says, on equal cells; NaN and empty where it says nothing
        verdict : whether the orders have settled, and on the expected one

    """
    usable = points.error.where(points.meant)
    kept = points.h != points.h.shift()  # there is no order between two meshes with the same number of cells
    orders = Series(successive_orders(points.h[kept], usable[kept])).dropna()
    last = float(orders.iloc[-1]) if len(orders) else float("nan")
    fitted, wanted = fitted_order(points.h, usable), float("nan") if expected is None else expected.order
    return {
        "last": last, "fitted": fitted, "expected": wanted, "reason": "" if expected is None else expected.reason,
        "verdict": _verdict(orders.tail(3), fitted, wanted),
    }  # fmt: skip


def _verdict(orders: Series, fitted: float, expected: float) -> str:
    """By the last three orders."""
    falls = len(orders) > 0 and orders.iloc[-1] > FLAT
    if fitted != fitted:
        return "too few points for an order"
    if fitted <= FLAT and not falls:
        return "does not fall"
    if falls and abs(fitted - expected) <= SAME * expected:
        return EXPECTED
    steady = len(orders) == 3 and orders.max() - orders.min() <= STEADY * abs(orders.iloc[-1])
    if not (falls and steady):
        return "orders still change"
    return "settled" if expected != expected else "settled on another order"


def cost(points: DataFrame, target: float) -> float:
    """The least number of unknowns from which on all errors stay within the target.

    NaN without errors, infinite if even the last one does not. An error that a finer mesh does not confirm is small by
    chance and does not count. One that means nothing counts as the reference's uncertainty.
    """
    found = float("inf") if len(points) else float("nan")
    for unknowns, error in sorted(zip(points.unknowns, points.error, strict=True), reverse=True):
        if error > target:
            break
        found = float(unknowns)
    return found


def advantage(curves: Mapping[str, "DataFrame"], target: float) -> tuple[float, float]:
    """How many times more unknowns equal cells take than the best of the others, as far as meshes of these sizes tell.

    At least and at most; the second is NaN where that is not known, both where nothing can be said.
    """
    nothing, uniform = float("nan"), curves[UNIFORM]
    costs = {sequence: cost(points, target) for sequence, points in curves.items()}
    others = {sequence: value for sequence, value in costs.items() if sequence != UNIFORM and value < np.inf}
    if uniform.empty or not others:
        return nothing, nothing
    best, needed = min(others.values()), costs[UNIFORM]
    if needed == np.inf:
        return float(uniform.unknowns.max()) / best, nothing
    before = _before(uniform, needed)
    if not before > best:
        return nothing, nothing
    least = [_before(curves[sequence], value) for sequence, value in others.items()]
    return before / best, nothing if np.isnan(least).any() else needed / min(least)


def _before(points: DataFrame, unknowns: float) -> float:
    """The largest number of unknowns of the curve below this one, NaN without one."""
    return float(points.unknowns[points.unknowns < unknowns].max())
