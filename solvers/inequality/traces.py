"""Coordinates in which the contact rows [N; T] are sparse, well scaled and independent: the tractions themselves.

In `docs/theory.md`: (D4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csc_array, csr_array, eye_array, hstack, vstack
from scipy.sparse.linalg import splu

from solvers.basics.types import IntVector, Matrix, PicklesFields, Vector
from solvers.errors import InputError
from solvers.inequality.rows import (
    Columns,
    Rows,
    basis,
    by_columns,
    checked_matrix,
    dense,
    generic_vector,
    stored,
)

_NOISE = 1e-14  # terms of a combination of rows below this share of its largest term are rounding
_MISMATCH = 1e-8  # accepted |[N; T] v − E Y v| relative to |E||Y||v|


@dataclass(frozen=True, eq=False)
class TractionFactor(PicklesFields):
    """[N; T] = E Y: the tractions at the contact points are combinations of a few trace parameters y = Y z.

    In mechanics y are tractions σ_N and σ_T at a few points of every edge. A row of Y is zero where the traction is
    prescribed. Rows may be linearly dependent by the equilibrium of the whole body.
    """

    rows: Columns
    """Y (r, n), dense if it is small."""
    interpolation: Columns
    """E (2m, r), dense if it is small."""

    def __post_init__(self) -> None:
        for name in ("rows", "interpolation"):
            object.__setattr__(self, name, checked_matrix(f"traces.{name}", getattr(self, name)))

    def check(self, contact_rows: Columns) -> None:
        """`InputError` unless E Y is [N; T] (2m, n), checked by the product with one vector."""
        expected = (contact_rows.shape[0], self.rows.shape[0])
        if self.interpolation.shape != expected or self.rows.shape[1] != contact_rows.shape[1]:
            found = f"shapes {self.interpolation.shape} and {self.rows.shape}"
            raise InputError("traces", found, "give E (2m, r) and Y (r, n)")
        v = generic_vector(contact_rows.shape[1])
        Y, E = self.rows, self.interpolation
        size: Vector = abs(E) @ (abs(Y) @ np.abs(v))
        error = np.abs(contact_rows @ v - E @ (Y @ v))
        if (error > _MISMATCH * size.max(initial=0.0)).any():
            raise InputError("traces", f"error {error.max():.1e}", "give E and Y with E Y = [N; T]")


@dataclass(frozen=True, eq=False)
class TraceCoordinates:
    """Coordinates y = P x of the interface unknowns x = z_Γ, with [N; T] z = E y.

    The first coordinates are linearly independent traces, the others unknowns that complete them to a basis.
    """

    interpolation: Rows
    """E (2m, k)."""
    _matrix: Rows
    _factor: Any  # of P; None without unknowns

    def from_unknowns(self, matrix: Matrix | Vector) -> Matrix | Vector:
        """P⁻ᵀ times a vector (k,) or matrix (k, j): from gradients by x to gradients by y."""
        return np.asarray(self._factor.solve(matrix, "T")) if matrix.size else matrix

    def to_unknowns(self, y: Vector) -> Vector:
        """Unknowns x = P⁻¹ y (k,)."""
        return np.asarray(self._factor.solve(y)) if y.size else y

    def from_values(self, x: Vector) -> Vector:
        """Y = P x (k,)."""
        return np.asarray(self._matrix @ x)

    def quadratic(self, S: Matrix) -> Matrix:
        """P⁻ᵀ S P⁻¹ (k, k), symmetric."""
        half = self.from_unknowns(S)
        full = np.asarray(self.from_unknowns(np.asfortranarray(half.T)))
        return np.asarray((full + full.T) / 2.0)


def trace_coordinates(traces: TractionFactor, interface: IntVector) -> TraceCoordinates:
    """Trace coordinates of the contact rows E Y (2m, n) on the unknowns `interface` (k,)."""
    Y, E, k = csr_array(traces.rows[:, interface]), by_columns(traces.interpolation), len(interface)
    rows, free = basis(Y)
    # P: independent rows of Y, completed by unit vectors.
    P = csr_array(vstack([Y[rows], eye_array(k, format="csr")[free]]))
    factor: Any = splu(csc_array(P)) if k else None
    interpolation = csc_array(hstack([E[:, rows], csc_array((E.shape[0], len(free)))]))
    # The other rows of Y as combinations of the coordinates.
    dependent = np.setdiff1d(np.arange(Y.shape[0]), rows)
    if len(dependent) and k:
        combination = factor.solve(dense(Y[dependent]).T, "T").T
        # Coefficients that are rounding become zero: the solve leaves some at every coordinate, which would fill the
        # rows of bodies with many joints.
        terms = np.abs(combination) * abs(P).sum(axis=1)
        combination[terms <= _NOISE * terms.max(axis=1, initial=0.0)[:, None]] = 0.0
        interpolation = interpolation + E[:, dependent] @ csc_array(combination)
    return TraceCoordinates(stored(interpolation), stored(P), factor)
