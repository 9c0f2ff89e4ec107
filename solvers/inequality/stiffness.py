"""K of (D2) with its root: the one owner of its factorisation, which all problems that hold this object share."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from solvers.basics.types import IntVector, Matrix, PicklesFields, Sparse, SparseRows, Vector
from solvers.errors import InputError
from solvers.factorisation import Factorisation, FactorisationError
from solvers.factorisation.augmented import factorise_root
from solvers.factorisation.choice import Request, condensing_pays, factorise, refactorisation
from solvers.factorisation.mkl import limited_blas
from solvers.factorisation.superlu import Refactorisation
from solvers.inequality.contact import CondensedContact, ContactMatrices
from solvers.inequality.rows import (
    Columns,
    absolute_product,
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

    def matrix(self) -> tuple[SparseRows, Matrix]:
        """(R as sparse rows, a place (2,) for each row), for factorising R where K has lost too much to rounding."""
        ...

    def rounding(self, z: Vector) -> float:
        """Error of R z that the rounding of z itself may cause, a norm like |r|."""
        ...


@dataclass(eq=False)
class _Made:
    """What changes: the request for a factorisation (asked: now), what was made, and the contact condensed by it."""

    request: Request
    asked: bool = False
    rooted: bool = False
    factor: Factorisation | None = None
    condensed: CondensedContact | None = None


@dataclass(frozen=True, eq=False)
class Stiffness(PicklesFields):
    """K, factorised when that is first needed, and the last contact condensed with it.

    Attributes
    ----------
    K : (n, n) symmetric, positive definite on the null space of A; dense where it is small
    root : `EnergyRoot`, optional
        Its R is factorised where K is not positive definite to working precision, or when `use_root` says so.
    places : (n, 2), optional
        Where the unknowns are, in any unit: SuperLU then eliminates by nested dissection of these places instead of in
        an order that it finds.

    Raises `InputError` for a K that is not symmetric, or has a negative diagonal.

    """

    K: Columns
    root: EnergyRoot | None = None
    places: Matrix | None = None

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
        scale = float(np.abs(v) @ absolute_product(self.K, w))
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
        return _Made(Request())

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

    def use_root(self) -> bool:
        """Factorise R instead of K from now on; False if there is no root, or it was done before."""
        if self.root is None or self._made.rooted:
            return False
        self._made.rooted = True
        self._forget()
        return True

    @contextmanager
    def using(self, name: str, threads: int | None) -> Iterator[None]:
        """Take this factorisation, and so many threads, within the context; one made earlier goes unless it fits.

        Raises
        ------
        SolverUnavailableError, InputError
            As `Request.checked`.

        """
        made, request = self._made, Request.checked(name, threads)
        if made.asked and request == made.request:
            yield
            return
        before, made.request, made.asked = (made.request, made.asked), request, True
        try:
            if made.factor is not None and not made.request.fits(made.factor):
                self._forget()
            with limited_blas(request.threads or 1):  # on busy machines more are slower by far
                yield
        finally:
            made.request, made.asked = before

    def refactorisation(self, starts: IntVector, columns: IntVector) -> Refactorisation:
        """For unsymmetric matrices of a symmetric pattern, by the library and on the threads that are asked for."""
        return refactorisation(starts, columns, *self._made.request, self.places)

    def _forget(self) -> None:
        self._made.factor = self._made.condensed = None

    def _factor_for(self, contact: ContactMatrices, wide: bool) -> Factorisation:
        """The one at hand if its interface holds the unknowns that it must, or a new one."""
        made, factor = self._made, self._made.factor  # which another thread may exchange meanwhile
        if factor is None or not factor.keeps(contact.touched if wide else contact.equated):
            interface = contact.touched if wide or self.condensing_pays(contact) else contact.equated
            factor = made.factor = self._factorised(interface)
        return factor

    def _factorised(self, interface: IntVector) -> Factorisation:
        made = self._made
        if not made.rooted:
            try:
                return factorise(self.K, interface, *made.request, self.places)
            except FactorisationError as error:
                if error.reason != "singular" or self.root is None:
                    raise
                made.rooted = True
        assert self.root is not None
        R, places = self.root.matrix()
        return factorise_root(R, interface, places)
