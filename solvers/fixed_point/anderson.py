"""Anderson acceleration of a fixed-point map, with safeguard."""

from collections import deque

import numpy as np

from solvers.basics.types import Vector

_GROWTH = 2.0  # residual growth at which the memory is dropped
_CONDITION = 1e-10  # relative singular values dropped in the least-squares problem


class Anderson:
    """Next argument of s ← g(s) from the last arguments and values (type II).

    With residuals r_i = g_i − s_i and α minimising |Σ α_i r_i| in the norm weighted by W, Σ α_i = 1, the next
    argument is Σ α_i (s_i + β r_i), kept ≥ 0. Safeguards: when the residual has grown by more than a factor
    of 2 since the last step, or the new step points against the residual (as it does towards a fixed point
    that repels), the memory is dropped and one damped step s + β r taken.

    Cite: H. Walker, P. Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 2011.
    """

    def __init__(self, weights: Vector, memory: int, mixing: float) -> None:
        self._root = np.sqrt(weights)
        self.mixing = mixing
        self._arguments: deque[Vector] = deque(maxlen=memory + 1)
        self._residuals: deque[Vector] = deque(maxlen=memory + 1)
        self._last = np.inf

    def next(self, s: Vector, g: Vector) -> Vector:
        """Return the next argument, given g = g(s)."""
        residual = g - s
        size = float(np.linalg.norm(self._root * residual))
        if size > _GROWTH * self._last:
            self.reset()
        self._last = size
        self._arguments.append(s)
        self._residuals.append(residual)
        if len(self._residuals) == 1:
            return np.maximum(s + self.mixing * residual, 0.0)
        differences = np.array([self._root * (old - residual) for old in list(self._residuals)[:-1]]).T
        alpha = np.linalg.lstsq(differences, -self._root * residual, rcond=_CONDITION)[0]
        mixed = [a + self.mixing * r for a, r in zip(self._arguments, self._residuals, strict=True)]
        combined = mixed[-1] + sum(
            (c * (m - mixed[-1]) for c, m in zip(alpha, mixed[:-1], strict=True)), np.zeros_like(s)
        )
        if float(self._root**2 @ ((combined - s) * residual)) <= 0:  # towards a repelling fixed point
            self.reset()
            return np.maximum(s + self.mixing * residual, 0.0)
        return np.maximum(combined, 0.0)

    def reset(self) -> None:
        """Forget everything."""
        self._arguments.clear()
        self._residuals.clear()
        self._last = np.inf
