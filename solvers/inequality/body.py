"""The body of (D2): K with its factorisation, loads, energy, and the state in which no contact law acts.

`Stiffness` is the one owner of its factorisation, which all problems that hold this object share.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from solvers.basics.types import IntVector, Matrix, PicklesFields, Sparse, Vector
from solvers.errors import InputError
from solvers.factorisation.base import Factorisation, State, limited_blas
from solvers.factorisation.choice import Refactorisation, Request, condensing_pays, factorise, refactorisation
from solvers.inequality.contact import CondensedContact, ContactMatrices
from solvers.inequality.rows import (
    Columns,
    by_columns,
    checked_matrix,
    checked_vector,
    generic_vector,
)

_ASYMMETRY = 1e-10  # accepted |vᵀKw − wᵀKv| relative to |v|ᵀ|K||w|


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

    def rounding(self, z: Vector) -> float:
        """Error of R z that the rounding of z itself may cause, a norm like |r|."""
        ...


@dataclass(eq=False)
class _Made:
    """What changes: the request for a factorisation under way, what was made, and the contact condensed by it."""

    request: Request | None = None
    factor: Factorisation | None = None
    condensed: CondensedContact | None = None


@dataclass(frozen=True, eq=False)
class Stiffness(PicklesFields):
    """K, factorised when that is first needed, and the last contact condensed with it.

    Raises `InputError` for a K that is not symmetric, or has a negative diagonal.
    """

    K: Columns
    """(n, n) symmetric, positive definite on the null space of A; dense where it is small."""
    places: Matrix | None = None
    """(n, 2): Where the unknowns are, in any unit: without MKL unknowns are eliminated by nested dissection of these
    places."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "K", checked_matrix("K", self.K))
        n = self.K.shape[0]
        if self.K.shape != (n, n):
            raise InputError("K", f"shape {self.K.shape}", "give a square matrix")
        if self.places is not None:
            object.__setattr__(self, "places", checked_vector("places", self.places))
            if self.places.shape != (n, 2):
                raise InputError("places", f"shape {self.places.shape}", f"give shape ({n}, 2), as K says")
        self.check_diagonal(least=0.0)
        v = generic_vector(n)
        w = v[::-1]
        scale = float(np.abs(v) @ (abs(self.K) @ np.abs(w)))
        asymmetry = abs(float(v @ (self.K @ w) - w @ (self.K @ v))) / scale if scale > 0 else 0.0
        if asymmetry > _ASYMMETRY:
            raise InputError("K", f"asymmetry {asymmetry:.1e}", "give a symmetric K, such as (K + Kᵀ)/2")

    def check_diagonal(self, least: float) -> None:
        """`InputError` for an entry below the least; without equations they must be above 0."""
        found = float(self.diagonal.min(initial=np.inf))
        if found < least:
            raise InputError("K", found, "give a positive definite K; its diagonal is > 0")

    @cached_property
    def diagonal(self) -> Vector:
        """That of K (n,)."""
        return np.asarray(self.K.diagonal())

    @cached_property
    def by_columns(self) -> Sparse:
        """K as a sparse matrix."""
        return by_columns(self.K)

    @cached_property
    def _made(self) -> _Made:
        return _Made()

    @property
    def factor(self) -> Factorisation | None:
        """The factorisation, if one was needed so far."""
        return self._made.factor

    def condensed(self, contact: ContactMatrices, *, wide: bool = False) -> CondensedContact:
        """A contact by the factorisation of K; kept until another contact or factorisation is asked for.

        Its Schur complement holds the unknowns of the contact where that costs less than to eliminate them too (see
        `factorisation.choice`), or is asked for (`wide`).
        """
        found = self._made.condensed
        if found is None or found.contact is not contact or (wide and not found.is_condensed):
            found = self._made.condensed = CondensedContact(contact, self._factor_for(contact, wide))
        return found

    def condensing_pays(self, contact: ContactMatrices) -> bool:
        """Whether dense matrices on what the contact touches cost less than sparse ones in all unknowns."""
        return condensing_pays(self.K, len(contact.touched))

    @contextmanager
    def using(self, name: str, threads: int | None) -> Iterator[None]:
        """Take this factorisation, and so many threads, within the context; one made earlier goes unless it fits.

        Raises
        ------
        SolverUnavailableError, InputError
            As `Request.checked`.

        """
        made, request = self._made, Request.checked(name, threads)
        if request == made.request:
            yield
            return
        before, made.request = made.request, request
        try:
            if made.factor is not None and not request.fits(made.factor):
                made.factor = made.condensed = None
            with limited_blas(request.threads or 1):  # on busy machines more are slower by far
                yield
        finally:
            made.request = before

    def refactorisation(self, starts: IntVector, columns: IntVector) -> Refactorisation:
        """For unsymmetric matrices of a symmetric pattern, by the library and on the threads that are asked for."""
        return refactorisation(starts, columns, *(self._made.request or Request()), self.places)

    def _factor_for(self, contact: ContactMatrices, wide: bool) -> Factorisation:
        """The one at hand if its interface holds the unknowns that it must, or a new one."""
        made, factor = self._made, self._made.factor  # which another thread may exchange meanwhile
        if factor is None or not factor.keeps(contact.touched if wide else contact.equated):
            interface = contact.touched if wide or self.condensing_pays(contact) else contact.equated
            factor = made.factor = factorise(self.K, interface, *(made.request or Request()), self.places)
        return factor


# Loads, energy and the bonded state.


_ROUNDING = 1e-24  # an energy this small beside that of z = 0 is rounding: the loads cancel
_CORRECTIONS = 30  # defect corrections of the bonded solution at most
_FORESEEN = 1e-16  # of the solution, in the energy norm: size of a correction that is not computed


@dataclass(frozen=True, eq=False)
class Loads(PicklesFields):
    """Loads, tractions at z = 0, and right-hand sides of equations."""

    f: Vector
    """(n,)."""
    n0: Vector
    t0: Vector
    """(m,), tractions at z = 0."""
    b: Vector = None  # type: ignore[assignment]  # None is replaced on construction
    """(p,), optional; p = 0 when not given."""
    root: EnergyRoot | None = None
    load: Vector | None = None
    """An `EnergyRoot` with the r₀ of these loads and (n,), optional, both or none, with f = load − Rᵀr₀. They give the
    gradient of the energy more accurately than K and f, whose entries may be large and cancel."""

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

    def state(self, z: Vector) -> tuple[float, Vector]:
        """The size of the energy, ½|r(z)|² ≥ 0, and its gradient Rᵀr(z) − load; without a root ½ zᵀKz and K z − f."""
        if not z.any():
            return self.at_zero
        if self.root is None or self.load is None:
            force = self.K @ z
            return 0.5 * float(z @ force), np.asarray(force - self.f)
        r = self.root.apply(z)
        return 0.5 * float(r @ r), np.asarray(self.root.adjoint(r) - self.load)

    @cached_property
    def at_zero(self) -> tuple[float, Vector]:
        """Both at z = 0, where every solve begins, more than once: ½|r₀|² and −f."""
        gradient = 0.0 - self.f  # without negative zeros
        gradient.setflags(write=False)
        r = np.zeros(1) if self.root is None else self.root.apply(np.zeros(len(self.f)))
        return 0.5 * float(r @ r), gradient


class BondedState:
    """Minimiser of an energy under A z = b alone: contact that neither opens nor slips."""

    def __init__(self, condensed: CondensedContact, energy: Energy, b: Vector) -> None:
        self.condensed, self.energy, self._b = condensed, energy, b

    @property
    def z(self) -> Vector:
        """The state (n,), by defect corrections."""
        return self._corrected[0]

    @cached_property
    def strain_energy(self) -> float:
        """That of z; 0 if it is rounding, since all loads cancel."""
        return self._not_rounding(self.energy.state(self.z)[0])

    @cached_property
    def error(self) -> float:
        """How far the last defect correction still moved z, in the energy norm, relative; 0 without a root."""
        if self.energy.root is None or self.strain_energy == 0.0:
            return 0.0
        return self._corrected[1][-1] / float(np.sqrt(2.0 * self.strain_energy))

    @cached_property
    def rough_stress(self) -> float:
        """√(2 × strain energy) by one linear solve, not corrected: its size, not its digits."""
        return float(np.sqrt(2.0 * self._not_rounding(self._at_first[0])))

    @cached_property
    def at_rest(self) -> tuple[Vector, State, float]:
        """The interior eliminated at z = 0, see `Factorisation.reduce`, and the energy with Γ at rest."""
        reduced, state = self._eliminated
        return reduced, state, -0.5 * self.condensed.system.factor.square(state)

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

    @cached_property
    def _at_first(self) -> tuple[float, Vector]:
        """`Energy.state` there."""
        return self.energy.state(self._first)

    def _size(self, step: Vector) -> float:
        """In the energy norm."""
        return float(np.sqrt(abs(step @ (self.energy.K @ step))))

    @cached_property
    def _corrected(self) -> tuple[Vector, list[float]]:
        """The bonded solution, and the energy norms of the steps towards it, the last one not taken unless tiny."""
        system, z, gradient = self.condensed.system, self._first, self._at_first[1]
        sizes = [self._size(z)]
        for _ in range(_CORRECTIONS):
            step = system.solve(-gradient, self._b - self.condensed.contact.A @ z)[0]
            sizes.append(self._size(step))
            if not sizes[-1] < 0.5 * sizes[-2]:
                break
            z = z + step
            if sizes[-1] ** 2 <= _FORESEEN * sizes[0] * sizes[-2]:  # the next one is smaller than that
                break
            gradient = self.energy.state(z)[1]
        return z, sizes
