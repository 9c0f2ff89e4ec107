"""The unknowns that contact feels, and what no data of contact or loads changes there."""

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from solvers.basics.types import IntVector, Matrix, Sparse, Vector
from solvers.factorisation import Factorisation
from solvers.factorisation.base import State
from solvers.inequality.blocks import Rows, for_products, scaled_columns, stacked_columns
from solvers.inequality.energy import Energy
from solvers.inequality.linear import EqualitySystem, columns_of, interface_of
from solvers.inequality.traces import TraceCoordinates, trace_coordinates

if TYPE_CHECKING:
    from solvers.inequality.problem import FrictionQVI

_POWER_STEPS = 10


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

    In trace coordinates y, with D such that the diagonal of S_y is 1 (see `solvers.condensed.reduction`):

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
