"""The body of (D2): K with its factorisation, the loads, the energy, and the bonded state.

A `Stiffness` owns the factorisation of its K. All problems that hold the same `Stiffness` share it.
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
from solvers.factorisation.base import Factorisation, limited_blas
from solvers.factorisation.choice import Refactorisation, Request, condensing_pays, factorise, refactorisation
from solvers.inequality.contact import CondensedContact, ContactMatrices
from solvers.inequality.rows import Columns, by_columns, checked_matrix, checked_vector, generic_vector

_ASYMMETRY = 1e-10  # accepted |vᵀKw − wᵀKv| relative to |v|ᵀ|K||w|


class EnergyRoot(Protocol):
    """An affine map r(z) = R z + r₀ with RᵀR = K. It avoids the cancellation between entries of an assembled K.

    In mechanics r are the stresses at quadrature points, weighted so that ½|r|² is the strain energy.
    """

    def apply(self, z: Vector) -> Vector:
        """r(z), for z (n,)."""
        ...

    def adjoint(self, r: Vector) -> Vector:
        """Rᵀr (n,)."""
        ...

    def rounding(self, z: Vector) -> float:
        """Bound of the error of R z that the rounding of z causes, in the norm |r|."""
        ...


@dataclass(eq=False)
class _Results:
    """What a `Stiffness` keeps: the request of `using`, its factorisation, and the contact condensed last."""

    request: Request | None = None
    factor: Factorisation | None = None
    condensed: CondensedContact | None = None


@dataclass(frozen=True, eq=False)
class Stiffness(PicklesFields):
    """K, its factorisation, made on first use, and the contact that was condensed with it last.

    Raises `InputError` if K is not symmetric, or has a negative diagonal entry.
    """

    K: Columns
    """(n, n) symmetric, positive definite on the null space of A; dense where it is small."""
    places: Matrix | None = None
    """(n, 2): Coordinates of the unknowns, in any unit, for the nested dissection of the back end "multifrontal"."""

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
        """`InputError` if a diagonal entry is below `least`; without equations all must be above 0."""
        smallest = float(self.diagonal.min(initial=np.inf))
        if smallest < least:
            raise InputError("K", smallest, "give a positive definite K; its diagonal is > 0")

    @cached_property
    def diagonal(self) -> Vector:
        """The diagonal of K (n,)."""
        return np.asarray(self.K.diagonal())

    @cached_property
    def positive_diagonal(self) -> Vector:
        """The diagonal of K (n,), 1 where it is zero: z_i √K_ii has the unit √energy for every unknown."""
        return np.where(self.diagonal > 0.0, self.diagonal, 1.0)

    @cached_property
    def by_columns(self) -> Sparse:
        """K as a sparse matrix."""
        return by_columns(self.K)

    @cached_property
    def _results(self) -> _Results:
        return _Results()

    @property
    def factor(self) -> Factorisation | None:
        """The factorisation, if it was made already."""
        return self._results.factor

    def condensed(self, contact: ContactMatrices, *, wide: bool = False) -> CondensedContact:
        """A contact condensed by the factorisation of K, kept until another contact or factorisation takes its place.

        The Schur complement keeps the unknowns of the contact if `wide`, or if that costs less than to eliminate them
        too (see `factorisation.choice`).
        """
        results = self._results
        condensed, factor = results.condensed, results.factor  # locals, as another thread may replace the attributes
        if condensed is None or condensed.contact is not contact or (wide and not condensed.is_condensed):
            if factor is None or not factor.keeps(contact.touched if wide else contact.equated):
                interface = contact.touched if wide or self.condensing_pays(contact) else contact.equated
                factor = results.factor = factorise(self.K, interface, *(results.request or Request()), self.places)
            condensed = results.condensed = CondensedContact(contact, factor)
        return condensed

    def condensing_pays(self, contact: ContactMatrices) -> bool:
        """Whether dense matrices on the unknowns of the contact cost less than sparse ones on all unknowns."""
        return condensing_pays(self.K, len(contact.touched))

    @contextmanager
    def using(self, name: str, threads: int | None) -> Iterator[None]:
        """Within the context use this back end and number of threads; a factorisation by another one is dropped.

        Raises `SolverUnavailableError` and `InputError` as `Request.checked`.
        """
        results, request = self._results, Request.checked(name, threads)
        if request == results.request:
            yield
            return
        outer_request, results.request = results.request, request
        try:
            if results.factor is not None and request.name not in ("auto", results.factor.backend):
                results.factor = results.condensed = None
            with limited_blas(request.threads or 1):  # on busy machines more threads are slower by far
                yield
        finally:
            results.request = outer_request

    def refactorisation(self, starts: IntVector, columns: IntVector) -> Refactorisation:
        """Refactorisation of unsymmetric matrices with this symmetric pattern, by the back end of the request."""
        return refactorisation(starts, columns, *(self._results.request or Request()), self.places)


# Loads, energy and the bonded state.

_CANCELLED = 1e-24  # strain energy, over that at z = 0, below which it is rounding, as all loads cancel
_NOISE = 300.0  # error of R z over the bound of the rounding of z: solutions of linear systems have more than z


@dataclass(frozen=True, eq=False)
class Loads(PicklesFields):
    """Loads, tractions at z = 0, and right-hand sides of equations."""

    f: Vector
    """(n,) loads."""
    n0: Vector
    t0: Vector
    """(m,), tractions at z = 0."""
    b: Vector = None  # type: ignore[assignment]  # None is replaced on construction
    """(p,) right-hand sides, optional; p = 0 when not given."""
    root: EnergyRoot | None = None
    load: Vector | None = None
    """An `EnergyRoot` with the r₀ of these loads, and the vector (n,) with f = load − Rᵀr₀; optional, both or neither.
    They give the gradient of the energy more accurately than K and f, whose entries may be large and cancel."""

    def __post_init__(self) -> None:
        if (self.root is None) != (self.load is None):
            missing = "root" if self.root is None else "load"
            raise InputError(missing, None, "give root and load together, or neither")
        object.__setattr__(self, "b", np.zeros(0) if self.b is None else self.b)
        for name in ("f", "n0", "t0", "b", *(() if self.load is None else ("load",))):
            object.__setattr__(self, name, checked_vector(name, getattr(self, name)))

    @cached_property
    def tractions(self) -> Vector:
        """Tractions (n0, t0) (2m,) at z = 0."""
        return np.concatenate([self.n0, self.t0])

    @cached_property
    def at_rest(self) -> float:
        """Strain energy ½|r₀|² at z = 0."""
        r = np.zeros(1) if self.root is None else self.root.apply(np.zeros(len(self.f)))
        return 0.5 * float(r @ r)

    def state(self, K: Columns, z: Vector) -> tuple[float, Vector]:
        """Strain energy ½|r(z)|² and gradient Rᵀr(z) − load (n,); without a root ½ zᵀKz and K z − f."""
        if not z.any():
            return self.at_rest, 0.0 - self.f  # without negative zeros
        if self.root is None or self.load is None:
            force = K @ z
            return 0.5 * float(z @ force), np.asarray(force - self.f)
        r = self.root.apply(z)
        return 0.5 * float(r @ r), np.asarray(self.root.adjoint(r) - self.load)

    def bonded(self, K: Columns, condensed: CondensedContact) -> BondedState:
        """The bonded state, kept for the last condensed contact."""
        bonded: BondedState | None = self.__dict__.get("_bonded")
        if bonded is None or bonded.condensed is not condensed:
            loads = object.__new__(Loads)  # a copy, so that no circle of references keeps a factorisation
            loads.__dict__.update({name: each for name, each in self.__dict__.items() if name != "_bonded"})
            bonded = self.__dict__["_bonded"] = BondedState(K, condensed, loads)
        return bonded


@dataclass(frozen=True, eq=False)
class BondedState:
    """Minimiser of the energy under A z = b alone: the contact neither opens nor slips."""

    K: Columns
    condensed: CondensedContact
    loads: Loads

    @cached_property
    def corrected(self) -> tuple[Vector, Vector]:
        """The unknowns (n,) and ν (p,), with defect corrections."""
        loads = self.loads
        return self.condensed.minimiser(loads.f, loads.b, lambda z: loads.state(self.K, z)[1])

    @cached_property
    def strain_energy(self) -> float:
        """Strain energy of the state; 0 if it is rounding, since all loads cancel."""
        z, root = self.corrected[0], self.loads.root
        energy = self.loads.state(self.K, z)[0]
        noise = 0.0 if root is None else _NOISE * root.rounding(z)
        return energy if energy > max(_CANCELLED * self.loads.at_rest, noise**2 / 2.0) else 0.0
