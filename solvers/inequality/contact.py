"""N, T, A and W of (D2), and their condensed form: the compliance and stiffness of the body at the contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs
from scipy.sparse import csc_array, eye_array, vstack

from solvers.basics.linked import lowest_linked
from solvers.basics.types import IntVector, Matrix, PicklesFields, Sparse, Vector
from solvers.errors import InputError
from solvers.factorisation.base import Factorisation, FactorisationError
from solvers.inequality.rows import (
    LEAST_PIVOT,
    Columns,
    Rows,
    by_columns,
    checked_matrix,
    checked_vector,
    columns_of,
    dense,
    generic_vector,
    scaled,
    stored,
    transposed,
)
from solvers.inequality.traces import TraceCoordinates, TractionFactor, trace_coordinates

_POWER_STEPS = 10
# Share of other waves in the first vector of the power iteration, which is uniform: if equilibrium fixes the uniform
# traction, its relief is rounding alone.
_WAVE_SHARE = 1e-8
_MOST_CORRECTIONS = 30
_LEAST_CORRECTION = 1e-12  # size of a correction, over that of the first step, not worth computing


@dataclass(frozen=True, eq=False)
class ContactMatrices(PicklesFields):
    """Rows of tractions and equations, and weights of the contact points; small matrices are dense."""

    N: Columns
    T: Columns
    """(m, n), rows of the normal and tangential traction at the contact points."""
    W: Vector
    """(m,), quadrature weights, > 0."""
    A: Columns = None  # type: ignore[assignment]  # None is replaced on construction
    """(p, n) equations, optional; p = 0 rows when not given."""
    traces: TractionFactor | None = None
    """`TractionFactor` with E Y = [N; T], optional; Y = [N; T] when not given."""

    def __post_init__(self) -> None:
        for name in ("N", "T"):
            object.__setattr__(self, name, checked_matrix(name, getattr(self, name)))
        object.__setattr__(self, "A", checked_matrix("A", self.A, empty=self.N.shape[1]))
        object.__setattr__(self, "W", checked_vector("W", self.W))
        if self.W.min(initial=1.0) <= 0:
            raise InputError("W", float(self.W.min()), "give quadrature weights > 0")
        if not isinstance(self.traces, TractionFactor | None):
            raise InputError("traces", type(self.traces).__name__, "give TractionFactor, or nothing")

    @cached_property
    def rows(self) -> Columns:
        """[N; T] (2m, n); `InputError` unless E Y of the traces is equal to it."""
        parts: Any = [self.N, self.T]  # both dense or both sparse, as their shapes are equal
        rows = np.concatenate(parts) if isinstance(self.N, np.ndarray) else csc_array(vstack(parts, format="csc"))
        if self.traces is not None:
            self.traces.check(rows)
        return rows

    @cached_property
    def length(self) -> float:
        """Σ W, the length of the contacts; 1 without a contact."""
        return float(self.W.sum()) or 1.0

    @cached_property
    def by_columns(self) -> dict[str, Sparse]:
        """N, T, A and rows as sparse matrices, by their names."""
        return {name: by_columns(getattr(self, name)) for name in ("N", "T", "A", "rows")}

    @cached_property
    def touched(self) -> IntVector:
        """Γ: the columns in which rows of contact or equations have an entry, sorted."""
        rows = columns_of(self.rows)
        return np.union1d(rows, self.equated) if self.A.shape[0] else rows

    @cached_property
    def equated(self) -> IntVector:
        """The columns in which rows of equations have an entry, sorted."""
        return columns_of(self.A)

    @cached_property
    def contacts(self) -> IntVector:
        """(m,) the first point of the contact of each point; points whose rows share unknowns are of one contact."""
        (row, unknown), (m, n) = self.rows.nonzero(), self.N.shape
        return lowest_linked(row % m, m + unknown, m + n)[:m]

    @cached_property
    def factor(self) -> TractionFactor:
        """The traces, by default Y = [N; T] with E = 1."""
        return self.traces or TractionFactor(self.rows, csc_array(eye_array(self.rows.shape[0])))

    @cached_property
    def tractions(self) -> tuple[Any, Vector]:
        """Rows (r, n) whose tractions are pointwise values, and their weights (r,).

        The trace parameters Y if there are 2m of them, with weights EᵀW > 0: the rows [N; T] may then be coefficients
        of the tractions. Else [N; T] and W.
        """
        weights = np.concatenate([self.W, self.W])
        if self.factor.rows.shape[0] == len(weights):
            trace_weights = np.asarray(self.factor.interpolation.T @ weights)
            if (trace_weights > 0.0).all():
                return self.factor.rows, trace_weights
        return self.rows, weights


class CondensedContact:
    """A contact with a factorisation of K; each quantity is computed on first use.

    `system` is the linear system of K and A. `compliance`, `interface_rows` and `reduced` need `is_condensed`.
    """

    def __init__(self, contact: ContactMatrices, factor: Factorisation) -> None:
        self.contact = contact
        self.system = EqualitySystem(contact.A, factor)

    def minimiser(self, f: Vector, b: Vector, gradient: Callable[[Vector], Vector]) -> tuple[Vector, Vector]:
        """The z (n,) and ν (p,) with gradient(z) + Aᵀν = 0 and A z = b, where gradient(z) is K z − f up to rounding.

        Defect corrections by the accurate gradient remove the rounding error of K. The first is always computed, as its
        size depends on the load. They end when the next one, predicted by linear convergence, is below
        `_LEAST_CORRECTION`, or when one is not below half the one before, which is not added. Sizes are energy norms
        √(dzᵀK dz).
        """
        A, (z, nu) = self.contact.A, self.system.solve(f, b)
        size = before = sqrt(abs(z @ f - b @ nu))
        for _ in range(_MOST_CORRECTIONS):
            residual, violation = gradient(z) + A.T @ nu, b - A @ z
            dz, dnu = self.system.solve(-residual, violation)
            last = sqrt(abs(dz @ residual + violation @ dnu))
            if not last < 0.5 * before:
                break
            z, nu = z + dz, nu + dnu
            if last * last <= _LEAST_CORRECTION * size * before:
                break
            before = last
        return z, nu

    @cached_property
    def is_condensed(self) -> bool:
        """Whether all unknowns that the contact touches are on the interface Γ."""
        return self.system.factor.keeps(self.contact.touched)

    @cached_property
    def contact_stiffness(self) -> float:
        """See `FrictionQVI.contact_stiffness`."""
        tractions, weights = self.contact.tractions
        # Y K⁻¹ Yᵀ W has the eigenvalues of √W Y K⁻¹ Yᵀ √W, and v √W in place of v.
        total, roots = float(weights.sum()), np.sqrt(weights)
        weighted: Any = scaled(roots, tractions)
        relief = self.system.relief(weighted)
        v = roots + _WAVE_SHARE * roots * generic_vector(len(weights))
        radius = 0.0
        for _ in range(_POWER_STEPS):
            v = relief(v)
            radius = sqrt(v @ v / total)
            if radius == 0.0:
                return 0.0
            v /= radius
        return radius * 2.0 * float(weights.min()) / total

    @cached_property
    def compliance(self) -> Matrix:
        """C = B K⁻¹ Bᵀ (2m, 2m), B = [N; T], K⁻¹ on the null space of A: multipliers m relieve tractions by C m."""
        C = self.interface_rows @ self.system.solve_interface(dense(transposed(self.interface_rows)))[0]
        return np.asarray((C + C.T) / 2.0)

    @cached_property
    def interface_rows(self) -> Rows:
        """[N; T] (2m, k) in the unknowns Γ."""
        return self.system.on_interface(self.contact.rows)

    @cached_property
    def reduced(self) -> tuple[TraceCoordinates, Vector, Matrix, Rows, Matrix]:
        """(D4) in trace coordinates y: coordinates of Γ, their scale (k,), S_y (k, k), E (2m, k) and A_y (p, k).

        With the scale the diagonal of S_y is 1. E gives the tractions, A_y the equations.
        """
        coordinates = trace_coordinates(self.contact.factor, self.system.interface)
        stiffness = coordinates.quadratic(self.system.schur)
        diagonal = stiffness.diagonal()
        scale: Vector = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        A = np.asarray(coordinates.from_unknowns(self.system.A.T)).T.reshape(len(self.system.A), len(scale)) * scale
        rows = transposed(scaled(scale, transposed(coordinates.interpolation)))
        return coordinates, scale, stiffness * scale * scale[:, None], rows, A


# The equality-constrained linear system of (D2), its interior eliminated once by a sparse factorisation.

_REFINEMENTS = 2  # steps of iterative refinement of the dense system with equations


class EqualitySystem:
    """Solves  [K Aᵀ; A 0] (x, ν) = (r, c).

    The interface Γ holds the unknowns that rows of A touch, and mostly those of the contact rows B too. The other
    unknowns, I, are eliminated by the factorisation, which leaves a dense system:

        [S A_Γᵀ; A_Γ 0] (x_Γ, ν) = (r_Γ − K_ΓI K_II⁻¹ r_I, c),    S = K_ΓΓ − K_ΓI K_II⁻¹ K_IΓ.

    K is (n, n), positive definite on the null space of A; A is (p, n), p = 0 allowed. Rows of A may have any units, and
    be linearly dependent if they are consistent; ν then has the least norm for rows of length one. Γ, the interface of
    the given factorisation of K, must hold all unknowns that rows of A touch.
    """

    def __init__(self, A: Columns, factor: Factorisation) -> None:
        self.factor, self.interface, self.schur = factor, factor.interface, factor.schur  # schur: S (k, k)
        self.A: Matrix = dense(self.on_interface(A))  # A_Γ

    def on_interface(self, rows: Columns) -> Rows:
        """The columns Γ (j, k) of rows (j, n)."""
        return stored(rows[:, self.interface])

    def solve(self, r: Vector | Matrix, c: Vector | Matrix | None = None) -> tuple[Vector, Vector]:
        """(x, ν) for right-hand sides r (n,) or (n, j) and c (p,) or (p, j), zero if not given."""
        reduced, state = self.factor.reduce(r)
        values, nu = self.solve_interface(reduced, c)
        return self.factor.expand(state, values), nu

    def solve_interface(self, g: Vector | Matrix, c: Vector | Matrix | None = None) -> tuple[Vector, Vector]:
        """(x_Γ, ν) of the dense system for g (k,) or (k, j), the right-hand side on Γ after the elimination of I."""
        g, A = np.asarray(g), self.A
        c = np.zeros((len(A), *g.shape[1:])) if c is None else np.asarray(c)
        x, nu = self._solved(g, c)
        for _ in range(_REFINEMENTS if len(A) else 0):
            dx, dnu = self._solved(g - self.schur @ x - A.T @ nu, c - A @ x)
            x, nu = x + dx, nu + dnu
        return x, nu

    def relief(self, rows: Columns) -> Callable[[Vector], Vector]:
        """The map m → R K⁻¹ Rᵀ m for rows R (j, n), K⁻¹ on the null space of A: how much multipliers m relieve R x.

        If Γ holds all unknowns of the rows, the dense system is enough; for a few rows the map is a matrix.
        """
        if not self.factor.keeps(columns_of(rows)):
            return lambda m: np.asarray(rows @ self.solve(rows.T @ m)[0])
        interface_rows = self.on_interface(rows)
        if isinstance(interface_rows, np.ndarray):
            matrix = np.asarray(interface_rows @ self.solve_interface(interface_rows.T)[0])
            return lambda m: np.asarray(matrix @ m)
        columns = transposed(interface_rows)
        return lambda m: np.asarray(interface_rows @ self.solve_interface(columns @ m)[0])

    @cached_property
    def _factors(self) -> tuple[Matrix, Matrix, float, Matrix, Matrix, Matrix]:
        """[S Qᵀ; Q 0] by Cholesky of S + ρ QᵀQ, which changes neither x nor ν if ρ Qᵀc is added to the right-hand side.

        The equations Q x = U c are those of A with orthonormal rows, by the singular values of rows of length one in
        the unknowns x_i √S_ii, which have one unit: nearly dependent rows then cost no digits. Q, U, ρ, the Cholesky
        factor, relief = (S + ρ QᵀQ)⁻¹ Qᵀ, Q relief.
        """
        S, rho = self.schur, 0.0
        diagonal = S.diagonal()
        roots = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        rows = self.A / roots
        lengths = np.linalg.norm(rows, axis=1)[:, None]
        lengths[lengths == 0.0] = 1.0
        left, values, Q = np.linalg.svd(rows / lengths, full_matrices=False)
        rank = int((values > LEAST_PIVOT * values.max(initial=0.0)).sum())
        Q, U = Q[:rank] * roots, (left[:, :rank] / lengths / values[:rank]).T
        if rank:
            rho = float(len(S)) / rank  # the trace of S in these unknowns, over the rank
            S = S + rho * (Q.T @ Q)
        cholesky, info = dpotrf(S, lower=1, clean=0) if len(S) else (S, 0)
        if info:
            raise FactorisationError("singular", "lapack", "the Schur complement is not positive definite")
        relief = dpotrs(cholesky, Q.T, lower=1)[0] if rank else Q.T
        return Q, U, rho, cholesky, relief, Q @ relief

    def _solved(self, g: Vector | Matrix, c: Vector | Matrix) -> tuple[Vector, Vector]:
        """(x_Γ, ν), without iterative refinement."""
        Q, U, rho, cholesky, relief, capacitance = self._factors
        if not len(self.A):  # LAPACK directly: the checks of SciPy's `cho_solve` take longer than a small solve
            return (np.asarray(dpotrs(cholesky, g, lower=1)[0]) if g.size else g), c
        c = U @ c
        x = g + rho * Q.T @ c
        x = np.asarray(dpotrs(cholesky, x, lower=1)[0]) if g.size else x
        nu = np.linalg.solve(capacitance, Q @ x - c)
        return x - relief @ nu, U.T @ nu
