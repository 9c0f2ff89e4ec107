"""The inner problem with strict bounds: a quadratic program over linear rows and second-order cones.

    min ½ xᵀKx − fᵀx   s.t.  A x = b,   ends(N x + n0) ≤ 0,   θ ∓ τ ∈ C on every edge,   τ = bernstein(T x + t0)

for the increment x about a `Centre`, θ given. c = θ ∓ τ is in C (`quadratics`) if and only if there is β ≥ 0 with

    (c₀ + c₂,  c₀ − c₂,  2(c₁ − β))  in the second-order cone  y₀ ≥ |(y₁, y₂)|.

A multiplier (y₀, y₁, y₂) of that cone, with 2y₂ ≥ 0 from β, is the functional q = (y₀ + y₁, 2y₂, y₀ − y₁) in the dual
cone D, and m_T = rows(q₊ − q₋) as row multipliers, q₊ of the upper bound; those of σ_N at ends, π ≥ 0, give
m_N = rows(π).

In `docs/theory.md`: (D16).
"""

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType

import numpy as np
from scipy.sparse import csc_array, vstack

from solvers.basics.status import Status
from solvers.basics.types import BoolVector, Matrix, Sparse, Vector
from solvers.inequality.problem import FrictionQVI
from solvers.inner.problem import Centre, InnerSolution, no_result
from solvers.strict.quadratics import largest
from solvers.strict.threshold import bilateral_edges, edge_rows

CLARABEL_SETTINGS: Mapping[str, float] = MappingProxyType(
    {
        **dict.fromkeys(("tol_gap_abs", "tol_gap_rel"), 1e-15),
        **dict.fromkeys(("tol_feas", "reduced_tol_gap_abs", "reduced_tol_gap_rel", "reduced_tol_feas"), 1e-8),
        **dict.fromkeys(("iterative_refinement_abstol", "iterative_refinement_reltol"), 1e-15),
        "iterative_refinement_stop_ratio": 1.5,
        "iterative_refinement_max_iter": 50,
        "static_regularization_constant": 1e-12,
    }
)
"""Clarabel goes on until the gap is little more than rounding.

The error of σ_T is the root of the gap where a cone is touched along a line, so a gap of 1e-12 is no reason to stop;
with the usual regularisation of its linear systems (1e-8) the last digits do not come. Rounding leaves gaps of 1e-17 to
1e-16: steps that are to reach these spoil the rows, until a system cannot be solved and nothing is returned.

The gap alone says when to stop. Residuals of the rows are rounding after ten steps, 1e-14 to 1e-9, and Clarabel gives
up where one is a hundred times the one before it and `tol_feas`. With a tolerance within that rounding it ends at any
gap, on one processor and not on another. Steps reduce residuals whatever the tolerance: results are no less feasible.
"""

_EMPTY_ROW = 1e-9  # of the largest traction: violation on an edge without unknowns that counts


class ConeProblem:
    """Matrices and vectors of this module's problem.

    Attributes
    ----------
    qvi : FrictionQVI
        The problem, with `EdgeRows`.

    """

    def __init__(self, qvi: FrictionQVI) -> None:
        self.qvi = qvi
        self._edges = edge_rows(qvi)
        self.count = qvi.m // self._edges.count
        self._unilateral = np.flatnonzero(~bilateral_edges(qvi))

    @cached_property
    def N(self) -> Sparse:  # noqa: N802
        """End values of σ_N on the k unilateral edges, rows (2k, n)."""
        rows = (2 * self._unilateral[:, None] + np.arange(2)).ravel()
        return csc_array((self._edges.matrix(self._edges.to_ends, self.count) @ self.qvi.N)[rows])

    @cached_property
    def T(self) -> tuple[Sparse, Sparse, Sparse]:  # noqa: N802
        """Bernstein coefficients of σ_T, number 0, 1 and 2 of each edge, three times rows (e, n)."""
        T = self.bernstein_rows.tocsr()
        return csc_array(T[0::3]), csc_array(T[1::3]), csc_array(T[2::3])

    @cached_property
    def bernstein_rows(self) -> Sparse:
        """The same edge by edge, rows (3e, n)."""
        return csc_array(self._edges.matrix(self._edges.to_bernstein, self.count) @ self.qvi.T)

    @cached_property
    def cone_rows(self) -> Sparse:
        """Rows (3e, n) of (τ₀ + τ₂, τ₀ − τ₂, 2τ₁), all first entries, then all second, then all third."""
        first, middle, last = self.T
        return csc_array(vstack([first + last, first - last, 2.0 * middle]))

    @property
    def without_shear(self) -> BoolVector:
        """Edges whose σ_T no unknown changes (e,)."""
        first, middle, last = self.T
        return _is_empty(abs(first) + abs(middle) + abs(last))

    def ends(self, centre: Centre) -> Vector:
        """End values of σ_N at the centre (2k,)."""
        return self._edges.ends(centre.n0)[self._unilateral].ravel()

    def shear(self, centre: Centre) -> Matrix:
        """Bernstein coefficients of σ_T at the centre (e, 3)."""
        return self._edges.bernstein(centre.t0)

    def multipliers(self, pushes: Vector, functionals: Matrix) -> tuple[Vector, Vector]:
        """(m_N, m_T) from the multipliers of the ends (2k,) and the functionals q₊ − q₋ (e, 3)."""
        ends = np.zeros((self.count, 2))
        ends[self._unilateral] = pushes.reshape(-1, 2)
        return self._edges.rows(ends), self._edges.rows(functionals)


def cone_coordinates(b: Matrix) -> Matrix:
    """(b₀ + b₂, b₀ − b₂, 2b₁) of Bernstein coefficients (e, 3)."""
    return np.column_stack([b[:, 0] + b[:, 2], b[:, 0] - b[:, 2], 2.0 * b[:, 1]])


def functional(y: Matrix) -> Matrix:
    """Q = (y₀ + y₁, 2y₂, y₀ − y₁) (e, 3) of multipliers of cones."""
    return np.column_stack([y[:, 0] + y[:, 1], 2.0 * y[:, 2], y[:, 0] - y[:, 1]])


def strict_contradiction(problem: FrictionQVI, threshold: Vector, centre: Centre) -> InnerSolution | None:
    """An infeasible result if a traction that no unknown changes violates its bound on an edge."""
    cones = ConeProblem(problem)
    theta, shear, ends = threshold.reshape(-1, 3), cones.shear(centre), cones.ends(centre)
    scale = float(max(np.abs(part).max(initial=0.0) for part in (theta, shear, ends)))
    pulled = ends > _EMPTY_ROW * scale
    beyond = np.maximum(largest(shear - theta), largest(-shear - theta)) > _EMPTY_ROW * scale
    pulled_for_good = pulled.any() and (pulled & _is_empty(cones.N)).any()
    if not pulled_for_good and not (beyond.any() and (beyond & cones.without_shear).any()):
        return None
    return no_result(problem, Status.INFEASIBLE, "a traction that no unknown can change violates its bound")


def _is_empty(rows: Sparse) -> BoolVector:
    return np.asarray(np.asarray(abs(rows).sum(axis=1)).ravel() == 0.0, dtype=np.bool_)
