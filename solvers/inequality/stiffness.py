"""K of (D2) as an operator: the one owner of its factorisation, shared by all problems that have this K."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import csr_array

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation import Factorisation, FactorisationError
from solvers.factorisation.augmented import factorise_root
from solvers.factorisation.base import State
from solvers.factorisation.choice import Request, condensing_pays, make, make_unsymmetric
from solvers.factorisation.unsymmetric import Refactorisation
from solvers.inequality.energy import Energy, EnergyRoot
from solvers.inequality.linear import EqualitySystem, columns_of, interface_of
from solvers.inequality.rows import Rows, for_products, scaled_columns, stacked_columns
from solvers.inequality.traces import TraceCoordinates, trace_coordinates

if TYPE_CHECKING:
    from solvers.inequality.problem import FrictionQVI


_POWER_STEPS = 10


# The unknowns that contact feels, and what no data of contact or loads changes there.


class ContactFrame:
    """N, T, A, traces and weights of a problem (D2), which problems of a sequence have in common.

    `InputError` if the traces do not fit the rows.
    """

    def __init__(self, problem: "FrictionQVI") -> None:
        self._weights = problem.W
        self._halves = (problem.N, problem.T)
        self.A: Sparse = problem.A
        self.traces = problem.traces
        if self.traces is not None:
            self.traces.check(self.contact_rows)

    def serves(self, problem: "FrictionQVI") -> bool:
        """Whether a problem has this frame: the very same matrices, as `FrictionQVI.changed` hands them on."""
        own, others = (*self._halves, self.A, self.traces), (problem.N, problem.T, problem.A, problem.traces)
        same = all(mine is its for mine, its in zip(own, others, strict=True))
        return same and (self._weights is problem.W or np.array_equal(self._weights, problem.W))

    @cached_property
    def contact_rows(self) -> Sparse:
        """[N; T] (2m, n)."""
        return stacked_columns(*self._halves)

    @cached_property
    def arrays(self) -> tuple[Any, Any, Any]:
        """N, T and A as products with vectors are taken with them."""
        N, T = map(for_products, self._halves)
        return N, T, for_products(self.A)

    @cached_property
    def touched(self) -> IntVector:
        """Γ: the columns in which rows of contact or equations have an entry, sorted."""
        return interface_of(self.contact_rows, self.A)

    @cached_property
    def equated(self) -> IntVector:
        """The columns in which rows of equations have an entry, sorted."""
        return columns_of(self.A)

    @cached_property
    def contacts(self) -> IntVector:
        """See `FrictionQVI.contacts`."""
        N, T, _ = self.arrays
        if isinstance(N, np.ndarray):
            felt = (N != 0.0) | (T != 0.0)
            linked, number = felt @ felt.T, np.arange(len(felt))
            while True:  # every point takes the smallest number beside it, until none changes
                least = np.where(linked, number, len(felt)).min(axis=1, initial=len(felt))
                least = np.minimum(least, number)
                if (least == number).all():
                    return np.unique(number, return_inverse=True)[1].astype(np.int64)
                number = least
        from scipy.sparse.csgraph import connected_components  # what only solves need is not loaded at the start

        rows, (m, n) = self.contact_rows, self._halves[0].shape
        if not rows.data.all():
            rows = rows.copy()
            rows.eliminate_zeros()
        starts = np.concatenate([np.zeros(m, dtype=rows.indptr.dtype), rows.indptr])
        graph = csr_array((np.ones(rows.nnz), rows.indices % m, starts), shape=(m + n, m + n))  # points, unknowns
        return np.asarray(connected_components(graph, directed=False)[1][:m], dtype=np.int64)

    @cached_property
    def tractions(self) -> tuple[Sparse, Vector]:
        """See `FrictionQVI.tractions`."""
        weights = np.concatenate([self._weights, self._weights])
        if self.traces is not None and self.traces.rows.shape[0] == len(weights):
            own = np.asarray(self.traces.interpolation.T @ weights)
            if (own > 0.0).all():
                return self.traces.rows, own
        return self.contact_rows, weights


class Interface:
    """A frame with a factorisation of K; each part is computed when it is first asked for.

    In trace coordinates y, with D such that the diagonal of S_y is 1 (see `solvers.condensed.coordinates`):

    Attributes
    ----------
    frame : ContactFrame
        Rows of contact and equations.
    system : EqualitySystem
        That of K and A. What follows in trace coordinates needs all unknowns that the frame touches on its Γ.
    rough_stress : of the last problem asked for it, with the data it depends on, see `Equilibrium.rough_stress`
    at_rest : the energy of the last problem that was reduced, with forward elimination and energy at z = 0

    """

    def __init__(self, frame: ContactFrame, factor: Factorisation) -> None:
        self.frame = frame
        self.rough_stress: tuple[tuple[Vector, ...], float] | None = None
        self.at_rest: tuple[Energy, Vector, State, float] | None = None
        self.system = EqualitySystem(frame.A, factor)

    @cached_property
    def is_condensed(self) -> bool:
        """Whether all unknowns that the frame touches are on Γ."""
        return self.system.factor.keeps(self.frame.touched)

    @cached_property
    def contact_stiffness(self) -> float:
        """See `FrictionQVI.contact_stiffness`."""
        tractions, weights = self.frame.tractions
        if not tractions.shape[0] or not tractions.shape[1]:
            return 0.0
        relief = self.system.relief(tractions)
        total = float(weights.sum())
        v: Vector = np.ones(len(weights))
        radius = 0.0
        for _ in range(_POWER_STEPS):
            v = relief(weights * v)
            radius = float(np.sqrt((weights @ v**2) / total))
            if radius == 0.0:
                return 0.0
            v = v / radius
        return radius * 2.0 * float(weights.min()) / total

    @cached_property
    def coordinates(self) -> TraceCoordinates:
        """Trace coordinates of the unknowns Γ."""
        return trace_coordinates(self.frame.contact_rows, self.frame.traces, self.system.interface)

    @cached_property
    def _unscaled(self) -> Matrix:
        return self.coordinates.quadratic(self.system.factor)

    @cached_property
    def scale(self) -> Vector:
        """The diagonal of D (k,)."""
        diagonal = self._unscaled.diagonal()
        return np.asarray(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)))

    @cached_property
    def stiffness(self) -> Matrix:
        """S_y (k, k)."""
        stiffness: Matrix = self._unscaled * self.scale * self.scale[:, None]
        del self._unscaled
        return stiffness

    @cached_property
    def rows(self) -> Rows:
        """E (2m, k): tractions by trace coordinates."""
        return scaled_columns(self.coordinates.interpolation, self.scale)

    @cached_property
    def A(self) -> Matrix:  # noqa: N802  # letter of (D2)
        """A_y (p, k): equations by trace coordinates."""
        A = np.asarray(self.coordinates.from_unknowns(self.system.A_interface.T))
        return A.T.reshape(self.frame.A.shape[0], len(self.scale)) * self.scale


# What one factorisation says of a problem (D2): the state without contact law.


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
