"""What one factorisation says of a problem (D2): the state without contact law."""

from functools import cached_property

import numpy as np

from solvers.basics.types import Vector
from solvers.inequality.energy import Energy
from solvers.inequality.interface import Interface

SLOW_CONTRACTION = 1e-3
"""Contraction of defect corrections above which K has lost too much to rounding, and R is factorised instead."""

_ROUNDING = 1e-24  # an energy this small beside that of z = 0 is rounding: the loads cancel
_CORRECTIONS = 7  # defect corrections of the bonded solution at most


class Equilibrium:
    """Linear algebra of one problem with one factorisation, each part computed when it is first asked for.

    Attributes
    ----------
    interface : Interface
        What problems with the same rows share.
    system : EqualitySystem
        That of K and A.

    """

    def __init__(self, interface: Interface, energy: Energy, b: Vector) -> None:
        self.interface, self.system = interface, interface.system
        self._energy, self._b = energy, b

    @property
    def bonded(self) -> Vector:
        """Minimiser of the energy under A z = b alone (n,), by defect corrections."""
        return self._corrected[0]

    @property
    def is_slow(self) -> bool:
        """Whether defect corrections shrink so slowly that K must have lost what its root still holds."""
        sizes = self._corrected[1]
        return len(sizes) > 1 and sizes[1] > SLOW_CONTRACTION * sizes[0]

    @cached_property
    def bonded_energy(self) -> float:
        """Strain energy of `bonded`; 0 if it is rounding, since all loads cancel."""
        return self._not_rounding(self.bonded)

    @cached_property
    def bonded_error(self) -> float:
        """How far the last defect correction still moved `bonded`, in the energy norm, relative; 0 without a root."""
        if self._energy.root is None or self.bonded_energy == 0.0:
            return 0.0
        return self._corrected[1][-1] / float(np.sqrt(2.0 * self.bonded_energy))

    def rough_stress(self) -> float:
        """√(2 × strain energy) of the bonded solution by one linear solve, not corrected: its size, not its digits."""
        nothing, gradient = self._energy.state(np.zeros(self._size))
        data = (np.array([nothing]), gradient, self._energy.f, self._b)  # all that it depends on
        known = self.interface.rough_stress
        if known is not None and all(map(np.array_equal, data, known[0])):
            return known[1]
        z, _ = self.system.solve(-gradient, self._b)
        energy = self._energy.strain(z)
        size = float(np.sqrt(2.0 * energy)) if energy > _ROUNDING * nothing else 0.0
        self.interface.rough_stress = (data, size)
        return size

    @property
    def _size(self) -> int:
        return int(self._energy.K.shape[0])

    def _not_rounding(self, z: Vector) -> float:
        """Strain energy at z; 0 if it is rounding."""
        energy, nothing = self._energy.strain(z), _ROUNDING * self._energy.strain(np.zeros(self._size))
        return energy if energy > nothing else 0.0

    @cached_property
    def _corrected(self) -> tuple[Vector, list[float]]:
        """The bonded solution, and the energy norms of the steps towards it, the last one not taken."""
        z, sizes = np.zeros(self._size), list[float]()
        for _ in range(_CORRECTIONS):
            correction, _ = self.system.solve(-self._energy.gradient(z), self._b - self.interface.frame.arrays[2] @ z)
            sizes.append(float(np.sqrt(abs(correction @ (self._energy.K @ correction)))))
            if len(sizes) > 1 and not sizes[-1] < 0.5 * sizes[-2]:
                break
            z = z + correction
        return z, sizes
