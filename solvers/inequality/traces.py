"""Coordinates in which the contact rows [N; T] are sparse, well scaled and independent: the tractions themselves.

In `docs/theory.md`: (D4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csc_array, csr_array, eye_array, hstack, vstack
from scipy.sparse.linalg import splu

from solvers.basics.types import IntVector, Matrix, PicklesFields, Vector
from solvers.errors import InputError
from solvers.inequality.rows import (
    Columns,
    Rows,
    are_few,
    basis_rows,
    by_columns,
    checked_matrix,
    dense,
    echelon,
    generic_vector,
    stored,
)

_NOISE = 1e-14  # share of the largest term of a combination of rows that is rounding
_MISMATCH = 1e-8  # accepted |[N; T] v − E Y v| relative to |E||Y||v|


@dataclass(frozen=True, eq=False)
class TractionFactor(PicklesFields):
    """[N; T] = E Y: tractions at the contact points from a few trace parameters y = Y z.

    In mechanics y are σ_N at two points of every edge and σ_T at nodes and midpoints. Some rows of Y may be zero (the
    trace is prescribed there) or depend on the others (equilibrium of the whole body).
    """

    rows: Columns
    """Y (r, n), dense where it is small."""
    interpolation: Columns
    """E (2m, r), dense where it is small."""

    def __post_init__(self) -> None:
        for name in ("rows", "interpolation"):
            object.__setattr__(self, name, checked_matrix(f"traces.{name}", getattr(self, name)))

    def check(self, contact_rows: Columns) -> None:
        """`InputError` unless E Y is [N; T] (2m, n), tried on one vector."""
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
    """Coordinates y = P x of the unknowns x = z_Γ that contact or equality rows touch.

    The first are independent traces, the last unknowns that complete them. Then [N; T] z = E y.
    """

    interpolation: Rows
    """E (2m, k)."""
    _matrix: Rows
    _factor: Any

    def from_unknowns(self, matrix: Matrix | Vector) -> Matrix | Vector:
        """P⁻ᵀ times a vector (k,) or matrix (k, j): gradients in x become gradients in y."""
        return np.asarray(self._factor.solve(matrix, "T"))

    def to_unknowns(self, y: Vector) -> Vector:
        """Unknowns x = P⁻¹ y (k,)."""
        return np.asarray(self._factor.solve(y))

    def from_values(self, x: Vector) -> Vector:
        """Y = P x (k,)."""
        return np.asarray(self._matrix @ x)

    def quadratic(self, S: Matrix) -> Matrix:
        """P⁻ᵀ S P⁻¹ (k, k), symmetric."""
        half = self.from_unknowns(S)
        full = np.asarray(self.from_unknowns(np.asfortranarray(half.T)))
        return np.asarray((full + full.T) / 2.0)


def trace_coordinates(traces: TractionFactor, interface: IntVector) -> TraceCoordinates:
    """Coordinates for contact rows E Y (2m, n) on the unknowns `interface` (k,): independent ones of the rows Y."""
    Y: Any = traces.rows[:, interface]
    E: Any = traces.interpolation
    k, few = len(interface), are_few(*Y.shape) and are_few(E.shape[0], len(interface))
    Y, E = (dense(Y), dense(E)) if few else (csr_array(Y), by_columns(E))
    found = basis_rows(Y) if few else echelon(Y)
    P: Any
    interpolation: Any
    if few:
        P = np.concatenate([Y[found.rows], np.eye(k)[found.free]])
        interpolation = np.pad(E[:, found.rows], ((0, 0), (0, len(found.free))))
    else:
        P = stored(vstack([Y[found.rows], eye_array(k, format="csr")[found.free]], format="csr"))
        more = csc_array((E.shape[0], len(found.free)))
        interpolation = hstack([E[:, found.rows], more], format="csc")
    factor: Any = _DenseFactor(P) if isinstance(P, np.ndarray) else splu(csc_array(P))
    dependent = np.setdiff1d(np.arange(Y.shape[0]), found.rows)
    dependent = dependent[abs(Y).sum(axis=1)[dependent] > 0.0]
    if len(dependent):
        combination = factor.solve(dense(Y[dependent]).T, "T").T
        # Zeros in place of what is rounding beside other terms: a solve leaves some everywhere, which would fill the
        # rows of bodies with many joints. Dense rows gain nothing by it, and keep their digits.
        terms = np.abs(combination) * abs(P).sum(axis=1)
        if not few:
            combination[terms <= _NOISE * terms.max(axis=1, initial=0.0)[:, None]] = 0.0
        interpolation = interpolation + E[:, dependent] @ (combination if few else csc_array(combination))
    return TraceCoordinates(interpolation if few else stored(interpolation), P, factor)


class _DenseFactor:
    """LU of a small matrix, with the `solve` of SuperLU's.

    SciPy counts the pivots up in place while LAPACK solves, without Python's lock: threads that share a factor would
    swap rows beyond the array. So each solve has pivots of its own.
    """

    def __init__(self, matrix: Matrix) -> None:
        found: Any = dgetrf(matrix) if matrix.size else (matrix, np.zeros(0, dtype=np.int32))
        self._lu, self._pivots = found[:2]

    def solve(self, right: Matrix | Vector, transposed: str = "N") -> Matrix | Vector:
        """P⁻¹ times (k,) or (k, j), for "T" P⁻ᵀ."""
        if not right.size:
            return right
        return np.asarray(dgetrs(self._lu, self._pivots.copy(), right, trans=int(transposed == "T"))[0])
