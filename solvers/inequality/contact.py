"""N, T, A and W of (D2), and what a factorisation of K condenses them to: all that the contact feels of the body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from solvers.basics.types import IntVector, Matrix, Sparse, Stated, Vector
from solvers.errors import InputError
from solvers.factorisation import Factorisation
from solvers.inequality.linear import EqualitySystem, columns_of, interface_of
from solvers.inequality.rows import (
    Rows,
    checked_matrix,
    checked_vector,
    dense,
    for_products,
    scaled_columns,
    stacked_columns,
    transposed,
)
from solvers.inequality.traces import TraceCoordinates, Traces, trace_coordinates

_POWER_STEPS = 10


@dataclass(frozen=True, eq=False)
class ContactMatrices(Stated):
    """Rows of tractions and equations, and the weights of the contact points.

    Attributes
    ----------
    N, T : (m, n) sparse, normal and tangential traction at the contact points
    W : (m,), quadrature weights, > 0
    A : (p, n) sparse equations, optional; stored as p = 0 rows when not given
    traces : `Traces`, optional; coordinates for [N; T], found by dense algebra when not given

    """

    N: Sparse
    T: Sparse
    W: Vector
    A: Sparse = None  # type: ignore[assignment]  # None is replaced on construction
    traces: Traces | None = None

    def __post_init__(self) -> None:
        for name in ("N", "T"):
            object.__setattr__(self, name, checked_matrix(name, getattr(self, name)))
        object.__setattr__(self, "A", checked_matrix("A", self.A, empty=self.N.shape[1]))
        object.__setattr__(self, "W", checked_vector("W", self.W))
        if self.W.min(initial=1.0) <= 0:
            raise InputError("W", float(self.W.min()), "give quadrature weights > 0")
        if not isinstance(self.traces, Traces | None):
            raise InputError("traces", type(self.traces).__name__, "give Traces, or nothing")

    @cached_property
    def contact_rows(self) -> Sparse:
        """[N; T] (2m, n); `InputError` if the traces do not fit them."""
        rows = stacked_columns(self.N, self.T)
        if self.traces is not None:
            self.traces.check(rows)
        return rows

    @cached_property
    def stacked(self) -> Any:
        """[N; T] for products."""
        return for_products(self.contact_rows)

    @cached_property
    def arrays(self) -> tuple[Any, Any, Any]:
        """N, T and A as products with vectors are taken with them: dense where they are small."""
        rows, A = self.stacked, for_products(self.A)
        if isinstance(rows, np.ndarray):
            return rows[: len(self.W)], rows[len(self.W) :], A
        return self.N, self.T, A

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
        """(m,) a number for each contact: points hang together through the unknowns that their tractions feel."""
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

        rows, (m, n) = self.contact_rows, self.N.shape
        if not rows.data.all():
            rows = rows.copy()
            rows.eliminate_zeros()
        starts = np.concatenate([np.zeros(m, dtype=rows.indptr.dtype), rows.indptr])
        graph = csr_array((np.ones(rows.nnz), rows.indices % m, starts), shape=(m + n, m + n))  # points, unknowns
        return np.asarray(connected_components(graph, directed=False)[1][:m], dtype=np.int64)

    @cached_property
    def tractions(self) -> tuple[Any, Vector]:
        """Rows (r, n) of tractions that do not depend on what N and T make of them, and their weights (r,).

        Trace parameters where there are as many as rows, as where rows are coefficients of the tractions at points;
        else the rows themselves.
        """
        weights = np.concatenate([self.W, self.W])
        if self.traces is not None and self.traces.rows.shape[0] == len(weights):
            rows, interpolation = self.traces.arrays
            own = np.asarray(interpolation.T @ weights)
            if (own > 0.0).all():
                return rows, own
        return self.stacked, weights


class CondensedContact:
    """A contact with a factorisation of K; each part is computed when it is first asked for.

    In trace coordinates y, with D such that the diagonal of S_y is 1 (see `solvers.condensed.coordinates`):

    Attributes
    ----------
    contact : ContactMatrices
    system : EqualitySystem
        That of K and A. What follows in trace coordinates needs all unknowns that the contact touches on its Γ.

    """

    def __init__(self, contact: ContactMatrices, factor: Factorisation) -> None:
        self.contact = contact
        self.system = EqualitySystem(contact.A, factor)

    @cached_property
    def is_condensed(self) -> bool:
        """Whether all unknowns that the contact touches are on Γ."""
        return self.system.factor.keeps(self.contact.touched)

    @cached_property
    def contact_stiffness(self) -> float:
        """See `FrictionQVI.contact_stiffness`."""
        tractions, weights = self.contact.tractions
        if not tractions.shape[0] or not tractions.shape[1]:
            return 0.0
        relief = self.system.relief(tractions, often=True)
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
    def compliance(self) -> Matrix:
        """C = B K⁻¹ Bᵀ (2m, 2m) for the rows B = [N; T], K⁻¹ on the null space of A: relief of tractions by m."""
        C = self.rows_near @ self.system.solve_interface(dense(transposed(self.rows_near)))[0]
        return np.asarray((C + C.T) / 2.0)

    @cached_property
    def rows_near(self) -> Rows:
        """[N; T] (2m, k) in the unknowns Γ."""
        return self.system.near(self.contact.stacked)

    @cached_property
    def coordinates(self) -> TraceCoordinates:
        """Trace coordinates of the unknowns Γ."""
        return trace_coordinates(self.contact.contact_rows, self.contact.traces, self.system.interface)

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
        vars(self).pop("_unscaled", None)  # another thread may have been first
        return stiffness

    @cached_property
    def rows(self) -> Rows:
        """E (2m, k): tractions by trace coordinates."""
        return scaled_columns(self.coordinates.interpolation, self.scale)

    @cached_property
    def A(self) -> Matrix:  # noqa: N802  # letter of (D2)
        """A_y (p, k): equations by trace coordinates."""
        A = np.asarray(self.coordinates.from_unknowns(self.system.A_interface.T))
        return A.T.reshape(self.contact.A.shape[0], len(self.scale)) * self.scale
