"""The energy ½ zᵀKz − fᵀz of (D2), evaluated through its root where there is one."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from solvers.basics.types import Matrix, SparseRows, Vector


class EnergyRoot(Protocol):
    """An affine map r(z) = R z + r₀ with RᵀR = K, evaluated without the cancellation inside an assembled K.

    In mechanics r are the stresses at quadrature points, weighted so that ½|r|² is the strain energy.
    """

    def apply(self, z: Vector) -> Vector:
        """r(z), for z (n,)."""
        ...

    def adjoint(self, r: Vector) -> Vector:
        """Rᵀr (n,)."""
        ...

    def matrix(self) -> tuple[SparseRows, Matrix]:
        """(R as sparse rows, a place (2,) for each row), for factorising R where K has lost too much to rounding."""
        ...

    def rounding(self, z: Vector) -> float:
        """Error of R z that the rounding of z itself may cause, a norm like |r|."""
        ...


@dataclass(frozen=True, eq=False)
class Energy:
    """K (n, n), dense or sparse, and f (n,), with root and load (n,) or without, see `FrictionQVI`."""

    K: Any
    f: Vector
    root: EnergyRoot | None = None
    load: Vector | None = None

    def serves(self, K: Any, f: Vector, root: EnergyRoot | None, load: Vector | None) -> bool:
        """Whether this is the energy of such data: the very same matrices, and equal loads."""
        if K is not self.K or root is not self.root or not np.array_equal(f, self.f):
            return False
        return load is self.load or (load is not None and self.load is not None and np.array_equal(load, self.load))

    def value(self, z: Vector) -> float:
        """½ zᵀKz − fᵀz."""
        return float(0.5 * z @ (self.K @ z) - self.f @ z)

    def strain(self, z: Vector) -> float:
        """½|r(z)|² ≥ 0 where there is a root, else ½ zᵀKz: the size of the energy."""
        if self.root is not None:
            r = self.root.apply(z)
            return 0.5 * float(r @ r)
        return 0.5 * float(z @ (self.K @ z))

    def gradient(self, z: Vector) -> Vector:
        """Rᵀr(z) − load where there is a root, else K z − f (n,)."""
        if self.root is not None and self.load is not None:
            return np.asarray(self.root.adjoint(self.root.apply(z)) - self.load)
        return np.asarray(self.K @ z - self.f)

    def state(self, z: Vector) -> tuple[float, Vector]:
        """`strain` and `gradient` at once."""
        return self._state(z) if z.any() else self._at_zero

    @cached_property
    def _at_zero(self) -> tuple[float, Vector]:
        """Where every solve begins, more than once."""
        strain, gradient = self._state(np.zeros(self.K.shape[0]))
        gradient.setflags(write=False)
        return strain, gradient

    def _state(self, z: Vector) -> tuple[float, Vector]:
        if self.root is None or self.load is None:
            return self.strain(z), self.gradient(z)
        r = self.root.apply(z)
        return 0.5 * float(r @ r), np.asarray(self.root.adjoint(r) - self.load)
