"""What loads a body: the data f, n0, t0, b of (D2), its energy, and the state in which no contact law acts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solvers.basics.types import PicklesFields, Vector
from solvers.errors import InputError
from solvers.factorisation.base import State
from solvers.inequality.contact import CondensedContact
from solvers.inequality.rows import Columns, checked_vector
from solvers.inequality.stiffness import EnergyRoot, Stiffness

SLOW_CONTRACTION = 1e-3
"""Contraction of defect corrections above which K has lost too much to rounding, and R is factorised instead."""

_ROUNDING = 1e-24  # an energy this small beside that of z = 0 is rounding: the loads cancel
_CORRECTIONS = 6  # defect corrections of the bonded solution at most


@dataclass(frozen=True, eq=False)
class Loads(PicklesFields):
    """Loads, tractions at z = 0, and right-hand sides of equations.

    Attributes
    ----------
    f : (n,)
    n0, t0 : (m,), tractions at z = 0
    b : (p,), optional; p = 0 when not given
    root, load : an `EnergyRoot` with the r₀ of these loads and (n,), optional, both or none, with f = load − Rᵀr₀. They
        give the gradient of the energy more accurately than K and f, whose entries may be large and cancel

    """

    f: Vector
    n0: Vector
    t0: Vector
    b: Vector = None  # type: ignore[assignment]  # None is replaced on construction
    root: EnergyRoot | None = None
    load: Vector | None = None

    def __post_init__(self) -> None:
        if (self.root is None) != (self.load is None):
            missing = "root" if self.root is None else "load"
            raise InputError(missing, None, "give root and load together, or neither")
        object.__setattr__(self, "b", np.zeros(0) if self.b is None else self.b)
        for name in ("f", "n0", "t0", "b", *(() if self.load is None else ("load",))):
            object.__setattr__(self, name, checked_vector(name, getattr(self, name)))

    def energy(self, stiffness: Stiffness) -> Energy:
        """That of a body under these loads, kept."""
        found: Energy | None = self.__dict__.get("_energy")
        if found is None or found.K is not stiffness.K:
            found = self.__dict__["_energy"] = Energy(stiffness.K, self.f, self.root, self.load)
        return found

    def bonded(self, condensed: CondensedContact, energy: Energy) -> BondedState:
        """The state without contact law, kept until the factorisation is another one."""
        found: BondedState | None = self.__dict__.get("_bonded")
        if found is None or found.condensed is not condensed:
            found = self.__dict__["_bonded"] = BondedState(condensed, energy, self.b)
        return found


@dataclass(frozen=True, eq=False)
class Energy:
    """½ zᵀKz − fᵀz, K (n, n), dense or sparse, and f (n,); through root and load (n,) where they are given."""

    K: Columns
    f: Vector
    root: EnergyRoot | None = None
    load: Vector | None = None

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
        if not z.any():
            return self.at_zero
        if self.root is None or self.load is None:
            return self.strain(z), self.gradient(z)
        r = self.root.apply(z)
        return 0.5 * float(r @ r), np.asarray(self.root.adjoint(r) - self.load)

    @cached_property
    def at_zero(self) -> tuple[float, Vector]:
        """Both at z = 0, where every solve begins, more than once."""
        z = np.zeros(self.K.shape[0])
        strain, gradient = self.strain(z), self.gradient(z)
        gradient.setflags(write=False)
        return strain, gradient


class BondedState:
    """Minimiser of an energy under A z = b alone: contact that neither opens nor slips."""

    def __init__(self, condensed: CondensedContact, energy: Energy, b: Vector) -> None:
        self.condensed, self.energy, self._b = condensed, energy, b

    @property
    def z(self) -> Vector:
        """The state (n,), by defect corrections."""
        return self._corrected[0]

    @cached_property
    def is_slow(self) -> bool:
        """Whether defect corrections shrink so slowly that K must have lost what its root still holds."""
        second = np.sqrt(self.condensed.system.square(*self._missed(self._first)))
        return bool(second > SLOW_CONTRACTION * self._size(self._first))

    @cached_property
    def strain_energy(self) -> float:
        """That of z; 0 if it is rounding, since all loads cancel."""
        return self._not_rounding(self.energy.strain(self.z))

    @cached_property
    def error(self) -> float:
        """How far the last defect correction still moved z, in the energy norm, relative; 0 without a root."""
        if self.energy.root is None or self.strain_energy == 0.0:
            return 0.0
        return self._corrected[1][-1] / float(np.sqrt(2.0 * self.strain_energy))

    @cached_property
    def rough_stress(self) -> float:
        """√(2 × strain energy) by one linear solve, not corrected: its size, not its digits."""
        return float(np.sqrt(2.0 * self._not_rounding(self.energy.strain(self._first))))

    @cached_property
    def at_rest(self) -> tuple[Vector, State, float]:
        """The interior eliminated at z = 0, see `Factorisation.reduce`, and the energy with Γ at rest."""
        reduced, state = self._eliminated
        return reduced, state, -0.5 * self.condensed.system.factor.square(-self.energy.at_zero[1], state)

    @cached_property
    def _eliminated(self) -> tuple[Vector, State]:
        return self.condensed.system.factor.reduce(-self.energy.at_zero[1])

    def _not_rounding(self, energy: float) -> float:
        """A strain energy; 0 if it is rounding."""
        return energy if energy > _ROUNDING * self.energy.at_zero[0] else 0.0

    @cached_property
    def _first(self) -> Vector:
        """The bonded solution by one linear solve: the step from z = 0."""
        (reduced, state), system = self._eliminated, self.condensed.system
        return np.asarray(system.factor.expand(state, system.solve_interface(reduced, self._b)[0]))

    def _missed(self, z: Vector) -> tuple[Vector, Vector]:
        """Forces and right-hand sides of equations that z leaves."""
        return -self.energy.gradient(z), self._b - self.condensed.contact.A @ z

    def _size(self, step: Vector) -> float:
        """In the energy norm."""
        return float(np.sqrt(abs(step @ (self.energy.K @ step))))

    @cached_property
    def _corrected(self) -> tuple[Vector, list[float]]:
        """The bonded solution, and the energy norms of the steps towards it, the last one not taken."""
        system, z = self.condensed.system, self._first
        sizes = [self._size(z)]
        for _ in range(_CORRECTIONS):
            step = system.solve(*self._missed(z))[0]
            sizes.append(self._size(step))
            if not sizes[-1] < 0.5 * sizes[-2]:
                break
            z = z + step
        return z, sizes
