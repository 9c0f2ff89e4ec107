"""K of (D2) as an operator: the one owner of its factorisation, shared by all problems that have this K."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from solvers.basics.types import IntVector, Matrix, Sparse
from solvers.factorisation import Factorisation, FactorisationError
from solvers.factorisation.augmented import factorise_root
from solvers.factorisation.choice import Request, condensing_pays, make, make_unsymmetric
from solvers.factorisation.unsymmetric import Refactorisation
from solvers.inequality.blocks import for_products
from solvers.inequality.energy import Energy, EnergyRoot
from solvers.inequality.equilibrium import Equilibrium
from solvers.inequality.interface import ContactFrame, Interface

if TYPE_CHECKING:
    from solvers.inequality.problem import FrictionQVI


class Operator:
    """K, factorised when that is first needed, and what the factorisation says of each problem.

    Problems of a sequence that differ in loads, gaps or friction share one operator: its factorisation, and where their
    rows are the same objects, trace coordinates and the Schur complement in them.

    Parameters
    ----------
    K : (n, n) sparse
    root : `EnergyRoot`, optional
        Its R is factorised where K is not positive definite to working precision, or when `use_root` says so.
    places : (n, 2), optional
        Where the unknowns are, see `FrictionQVI`.

    """

    def __init__(
        self,
        K: Sparse,
        root: EnergyRoot | None = None,
        places: Matrix | None = None,
    ) -> None:
        self._K, self._root, self._places = K, root, places
        self._request = Request()
        self._rooted = False
        self._factor: Factorisation | None = None
        self._frame: ContactFrame | None = None
        self._energy: Energy | None = None
        self._interface: Interface | None = None
        self._equilibria: WeakKeyDictionary[FrictionQVI, Equilibrium] = WeakKeyDictionary()

    def __reduce__(self) -> tuple[type["Operator"], tuple[object, ...]]:
        """Copies and pickles of a problem factorise anew: factors live in the memory of a library."""
        return Operator, (self._K, self._root, self._places)

    @cached_property
    def array(self) -> Any:
        """K as products with vectors are taken with it."""
        return for_products(self._K)

    @property
    def factor(self) -> Factorisation | None:
        """The factorisation, if one was needed so far."""
        return self._factor

    def serves(self, K: Sparse) -> bool:
        """Whether this is the operator of that matrix, entry by entry."""
        L = self._K
        if K is L:
            return True
        return K.shape == L.shape and np.array_equal(K.indices, L.indices) and np.array_equal(K.data, L.data)

    def equilibrium(self, problem: "FrictionQVI", *, condensed: bool = False) -> Equilibrium:
        """Linear algebra of a problem with this K; kept until the problem or the factorisation is gone.

        Its Schur complement holds the unknowns of the contact where that costs less than to eliminate them too (see
        `factorisation.choice`), or is asked for (`condensed`).
        """
        found = self._equilibria.get(problem)
        if found is None or (condensed and not found.interface.is_condensed):
            found = Equilibrium(self._shared_interface(problem, condensed), problem.potential, problem.b)
            self._equilibria[problem] = found
        return found

    def frame(self, problem: "FrictionQVI") -> ContactFrame:
        """Rows of a problem, the same object for the next one if it has these rows too."""
        if self._frame is None or not self._frame.serves(problem):
            self._frame = ContactFrame(problem)
        return self._frame

    def energy(self, problem: "FrictionQVI") -> Energy:
        """The energy of a problem, the same object for the next one if it has this energy too."""
        data = (self.array, problem.f, problem.root, problem.load)
        if self._energy is None or not self._energy.serves(*data):
            self._energy = Energy(*data)
        return self._energy

    def use_root(self) -> bool:
        """Factorise R instead of K from now on; False if there is no root, or it was done before."""
        if self._root is None or self._rooted:
            return False
        self._rooted = True
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
        before, self._request = self._request, Request.checked(name, threads)
        try:
            if self._factor is not None and not self._request.fits(self._factor):
                self._forget()
            with self._request.limited_blas():
                yield
        finally:
            self._request = before

    def _forget(self) -> None:
        self._factor = self._interface = None
        self._equilibria.clear()

    def refactorisation(self, starts: IntVector, columns: IntVector) -> Refactorisation:
        """For unsymmetric matrices of a symmetric pattern, by the library and on the threads that are asked for."""
        return make_unsymmetric(starts, columns, self._places, self._request)

    def condensing_pays(self, problem: "FrictionQVI") -> bool:
        """Whether dense matrices on what the contact touches cost less than sparse ones in all unknowns."""
        return condensing_pays(self._K, len(self.frame(problem).touched))

    def _shared_interface(self, problem: "FrictionQVI", condensed: bool) -> Interface:
        """The one of the problem before, if that has the same rows, and those of the contact where they count."""
        found, frame = self._interface, self.frame(problem)
        if found is None or not found.frame.serves(problem) or (condensed and not found.is_condensed):
            found = self._interface = Interface(frame, self._factor_for(problem, frame, condensed))
        return found

    def _factor_for(self, problem: "FrictionQVI", frame: ContactFrame, condensed: bool) -> Factorisation:
        """The one at hand if its interface holds the unknowns that it must, or a new one."""
        factor = self._factor
        if factor is None or not factor.keeps(frame.touched if condensed else frame.equated):
            wide = condensed or self.condensing_pays(problem)
            factor = self._factor = self._made(frame.touched if wide else frame.equated)
        return factor

    def _made(self, interface: IntVector) -> Factorisation:
        if not self._rooted:
            try:
                return make(self._K, interface, self._request, self._places)
            except FactorisationError as error:
                if error.reason != "singular" or self._root is None:
                    raise
                self._rooted = True
        assert self._root is not None
        R, places = self._root.matrix()
        return factorise_root(R, interface, places)
