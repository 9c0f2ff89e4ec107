"""The inner problem: (D2) with a given friction bound; its vectors about a centre, its solution, and its back ends."""

from copy import copy
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.sparse import csc_array, vstack

from solvers.basics.status import Status
from solvers.basics.types import Sparse, Vector
from solvers.inequality.problem import FrictionQVI


class Centre:
    """The vectors of (D2) for the increment x = z − z₀ about a point z₀.

        f = −gradient(z₀),   n0 = N z₀ + n0,   t0 = T z₀ + t0,   b = b − A z₀

    The matrices do not change. With increments about the last iterate every outer iteration is a defect correction: the
    error by rounding inside K is proportional to the increment, which tends to zero.
    """

    def __init__(self, qvi: FrictionQVI, z: Vector) -> None:
        self.z = z
        self.f = -qvi.gradient(z)
        self.n0, self.t0 = qvi.normal(z), qvi.tangential(z)
        self.b = np.asarray(qvi.b - qvi.A @ z)

    def times(self, factor: float) -> "Centre":
        """The vectors in another unit: all are linear in the data."""
        other = copy(self)
        vars(other).update({name: factor * vector for name, vector in vars(self).items()})
        return other

    def h(self, threshold: Vector) -> Vector:
        """Right-hand side [−n0; thr − t0; thr + t0] (3m,) of G x ≤ h."""
        return np.concatenate([-self.n0, threshold - self.t0, threshold + self.t0])


# The strictly convex quadratic program that (D2) becomes for a given bound thr = mu s, for the increment x about a
# `Centre`:
#
#     min ½ xᵀPx + qᵀx   s.t.  G x ≤ h(thr),  A x = b,      P = K,  G = [N; T; −T],  q = −f


def limited_rows(qvi: FrictionQVI) -> Sparse:
    """G = [N; T; −T] (3m, n)."""
    return csc_array(vstack([qvi.N, qvi.T, -qvi.T]))


def row_multipliers(y: Vector) -> tuple[Vector, Vector]:
    """(m_N, m_T) of the multipliers y = (y_N, y_+, y_−) ≥ 0 (3m,) of G x ≤ h: y_N, and y_+ − y_−."""
    y_N, y_plus, y_minus = np.split(y, 3)
    return y_N, y_plus - y_minus


@dataclass(frozen=True, eq=False)
class InnerSolution:
    """Result of an inner problem; multipliers with the signs of `FrictionQVI`."""

    z: Vector
    m_N: Vector  # noqa: N815  # letters of (D2)
    m_T: Vector  # noqa: N815
    nu: Vector
    """(n,), (m,), (m,), (p,); NaN if the back end gave nothing."""
    status: Status
    """How the back end ended."""
    iterations: int = 0
    """Number of iterations of the back end, 0 if unknown."""
    message: str = ""
    """The back end's own status and warnings."""

    def times(self, factor: float) -> "InnerSolution":
        """The solution in another unit, in which z and all multipliers are multiplied by a factor."""
        return replace(self, z=factor * self.z, m_N=factor * self.m_N, m_T=factor * self.m_T, nu=factor * self.nu)

    @property
    def finite(self) -> bool:
        """Whether z and all multipliers are finite."""
        return all(bool(np.isfinite(v).all()) for v in (self.z, self.m_N, self.m_T, self.nu))


class InnerSolver(Protocol):
    """A back end for the inner problems of one QVI, which differ in friction bound and centre."""

    packages: tuple[str, ...]
    """Distributions used, whose versions are recorded."""

    def solve(self, threshold: Vector, centre: Centre, start: InnerSolution | None) -> InnerSolution:
        """Solve for the friction bound `threshold` (m,) about a centre; `start` is the previous result, if any."""
        ...


def no_result(qvi: FrictionQVI, status: Status, message: str) -> InnerSolution:
    """An `InnerSolution` without a result, all arrays NaN."""
    nan = np.full(max(qvi.n, qvi.m, qvi.p), np.nan)
    return InnerSolution(nan[: qvi.n], nan[: qvi.m], nan[: qvi.m], nan[: qvi.p], status, 0, message)
