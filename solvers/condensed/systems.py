"""Coordinates y of the condensed method, and its Newton matrices: dense on the contact, or sparse in all unknowns.

Eliminating the interior about a point z leaves (D4); the code writes c for γ_y. If the problem has an `EnergyRoot`, the
gradient γ at z is free of the rounding inside K, so that a move of z corrects the rounding error of S.

In `docs/theory.md`: (D4), (D6), (D33).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs
from scipy.sparse import csc_array, csr_array, diags_array, hstack, vstack

from solvers.basics.types import IntVector, Matrix, Sparse, SparseRows, Vector
from solvers.factorisation.base import FactorisationError, State
from solvers.factorisation.choice import Refactorisation
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import Rows, transposed

if TYPE_CHECKING:
    from solvers.condensed.complementarity import Complementarity


class PathWeights(NamedTuple):
    """A central path: its weight ω of friction bounds and caps (ω = 1 for normal bounds, s λ = τω), and its start."""

    early: float  # ω until the slacks fit their tractions
    late: float  # ω from then on
    start: float = 0.1  # least multiplier λ at the start, over the scale of displacement


NEAR_BONDED_PATH = PathWeights(1.0, 30.0, start=0.002)
"""A path that starts nearer to the bonded solution, with more iterations for small problems. With larger multipliers at
the start the path bends at the corners of strongly graded meshes, and the pressure of large walls gathers in the last
cells of the lowest bed, so that steps become short."""

USUAL_PATHS = (PathWeights(30.0, 1000.0), NEAR_BONDED_PATH, PathWeights(100.0, 100.0))
"""Central paths in the order in which they are tried. With ω = 1 to the end the path often turns back if contact opens
and friction is large; with ω = 1000 from the start it does so if rows are dense."""

MANY_POINTS_PATHS = (PathWeights(1.0, 30.0), PathWeights(30.0, 1000.0))
"""Central paths for thousands of contact points. With ω = 1 at first the path smooths pressure and friction alike, and
the beds of a wall open and slip without short steps."""

MANY_POINTS_PATIENCE = 15  # iterations; close to a limit load the gap may stay for a while before it falls again
MANY_POINTS_STRAGGLERS = 0.02

SLOTS: Final = (1.0, -1.0, 1.0, -1.0)
"""The bounds of a traction and their signs: friction above (or the normal bound), friction below, cap above, below."""

Solve: TypeAlias = Callable[[Vector], Vector]
"""The map from a force (k,) to coordinates (k,)."""


@dataclass(eq=False)
class Expansion:
    """The base: a point z about which the problem is expanded in y, with y = 0 at z."""

    z: Vector  # (n,)
    c: Vector  # (k,) gradient of the energy in the coordinates
    equality: Vector  # (p,) b − A z
    tractions: Vector  # (2m,) σ_N and σ_T at z
    reduced: Vector  # gradient by the unknowns that are not eliminated: Γ, or all of them
    strain_energy: float  # at z
    energy: float  # of (D2) at y = 0, where the interior is in equilibrium
    state: State  # dense: argument of `Factorisation.expand`; sparse: multipliers h of the equations


class DenseCoordinates:
    """The maps between z and trace coordinates y (k,), with the interior eliminated.

    Attributes
    ----------
    paths : the central paths to try, see `USUAL_PATHS`
    stiffness : S_y (k, k), the energy is ½ yᵀ stiffness y + cᵀy + const
    E : (2m, k), tractions by coordinates
    A : A_y (p, k), rows of the equations
    frictionless : the points with σ_T = 0; these equations and A_y are solved for some of the coordinates

    """

    name = "condensed"  # `QVISolution.form`

    def __init__(self, qvi: FrictionQVI) -> None:
        interface = qvi.condensed_contact
        self._qvi, self._system = qvi, interface.system
        self._coordinates, self._scale, self.stiffness, self.E, self.A = interface.reduced
        self.frictionless = np.flatnonzero(qvi.frictionless)
        self._many_points = not qvi.stiffness.condensing_pays(qvi.contact)
        self.paths = MANY_POINTS_PATHS if self._many_points else USUAL_PATHS

    @property
    def size(self) -> int:
        """Number of trace coordinates k."""
        return len(self._scale)

    def forces(self, rows: Rows) -> Rows:
        """Rowsᵀ (k, q), the map from multipliers of rows (q, k) to forces on the coordinates."""
        return transposed(rows)

    def system(self, S: Matrix | SparseRows) -> DenseSystem:
        """Newton's matrices for the stiffness S (u, u) of the free coordinates, see `Equations`."""
        return DenseSystem(np.asarray(S), many_points=self._many_points)

    def multipliers(self, base: Expansion, y: Vector) -> tuple[Vector, Vector] | None:  # noqa: ARG002
        """None: `Equations` computes the multipliers of equations."""
        return None

    def length(self, y: Vector) -> float:
        """Energy norm √(yᵀ S_y y) of a step."""
        return float(np.sqrt(abs(y @ (self.stiffness @ y))))

    def base(self, z: Vector) -> Expansion:
        """The expansion about z, by one gradient and one elimination."""
        qvi, factor = self._qvi, self._system.factor
        strain, gradient = qvi.state(z)
        reduced, state = factor.reduce(-gradient)
        step = factor.expand(state, np.zeros(len(reduced)))  # of the interior to equilibrium, z_Γ fixed
        energy = qvi.energy(z) + 0.5 * float(gradient @ step)
        c = -self._scale * self._coordinates.from_unknowns(reduced)
        return Expansion(z, c, qvi.b - qvi.contact.A @ z, qvi.tractions(z), -reduced, strain, energy, state)

    def moved(self, base: Expansion, y: Vector) -> Expansion:
        """The expansion about the point with trace coordinates y."""
        return self.base(self.move(base, y))

    def move(self, base: Expansion, y: Vector) -> Vector:
        """The point z + dz (n,) whose trace coordinates are y, with the interior in equilibrium."""
        values = self._coordinates.to_unknowns(self._scale * y)
        return np.asarray(base.z + self._system.factor.expand(base.state, values))

    def bonded(self, base: Expansion) -> Vector:
        """Trace coordinates (k,) of the bonded solution."""
        values, _ = self._system.solve_interface(-base.reduced, base.equality)
        return self._coordinates.from_values(values) / self._scale

    def coordinates(self, z: Vector) -> Vector:
        """Trace coordinates (k,) of a point z (n,), counted from z = 0."""
        return np.asarray(self._coordinates.from_values(z[self._system.interface]) / self._scale)

    def defect(self, before: Expansion, y: Vector, after: Expansion) -> float:
        """Energy norm of the error of S in a step y between two bases: the new gradient less the predicted one."""
        predicted = before.reduced + self._system.schur @ self._coordinates.to_unknowns(self._scale * y)
        error = after.reduced - predicted
        return float(np.sqrt(abs(error @ self._system.solve_interface(error)[0])))


class DenseSystem:
    """Newton's matrices for a dense stiffness S (k, k); `many_points`: whether there are thousands of contact points.

    Attributes
    ----------
    patience : iterations without progress after which the central path is followed
    stragglers : share of the bounds that must not stop a step, see `InteriorPoint.past_few`
    longest : largest step, over the distance to the nearest bound
    small : weight of a bound, over the weight of its contact, below which the gap has to be smaller
    last_digits : whether iterations go on when the gap has reached its floor, as forces can still become more accurate
    orientation : sign of the determinant of the matrix factorised last; 0 if it is not known

    """

    longest = 0.99  # with longer steps forces lose digits on graded meshes
    small = 2e-3
    last_digits = True

    def __init__(self, S: Matrix, *, many_points: bool = False) -> None:
        self._S = S
        self.patience, self.stragglers = (MANY_POINTS_PATIENCE, MANY_POINTS_STRAGGLERS) if many_points else (6, 0.0)
        self.orientation = 1

    def norm(self, force: Vector) -> float:
        """Energy norm √(fᵀ S⁻¹ f) of a force (k,); 0 if S is not positive definite, by rounding."""
        if self._cholesky is None or not len(force):
            return 0.0
        return float(np.sqrt(abs(force @ dpotrs(self._cholesky, force, lower=1)[0])))

    def factorised(self, problem: Complementarity, D: Vector, e: Vector) -> Solve:
        """The inverse of H = S + TᵀW (D T + e N) for D, e (t,), see `Newton`; `LinAlgError` if it is singular."""
        if not len(self._S):
            return lambda force: force
        H = self._S + problem.stiffness(D, e)
        scale = 1.0 / np.sqrt(np.maximum(H.diagonal(), 1.0))  # to a diagonal of 1
        H *= scale
        factor, pivots, info = dgetrf(np.multiply(H, scale[:, None], order="F"), overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        swaps, negative = pivots != np.arange(len(pivots)), factor.diagonal() < 0.0
        self.orientation = -1 if (np.count_nonzero(swaps) + np.count_nonzero(negative)) % 2 else 1
        return lambda force: np.asarray(scale * dgetrs(factor, pivots, scale * force)[0])

    @cached_property
    def _cholesky(self) -> Matrix | None:
        factor, info = dpotrf(self._S, lower=1, clean=0)
        return None if info else factor


# (D2) in all unknowns, for contacts that are a large share of a body: nothing is eliminated, all matrices are sparse.
#
# The coordinates are y = (x, t, h): unknowns x = D^½ z, with which the diagonal of K is 1; all traces t = Y z of
# [N; T] = E Y, dependent ones too; and multipliers h of the equations C x = d, scaled to rows of length one. Equations
# are σ_T = 0 at points without friction, and A z = b. The traces are coordinates of their own, to which each step is
# added, so that t = Y z up to rounding, and all slacks, computed from E t, are consistent. Forces of bounds act on x:
#
#     S = [D^-½ K D^-½  0  Cᵀ],      E_y = [0  E  0],      Eᵀ m stands for D^-½ Yᵀ Eᵀ m on x, and 0 on t and h.
#         [0            0  0 ]
#         [C            0  0 ]
#
# Newton's matrix H of (D33) has the pattern of K; at bilateral points its blocks have −mu p' in place of mu, with
# p' = dp/dσ_N. The pattern is analysed once. One sparse matrix G gives the change of the entries: G (M_NN, M_TN, M_TT).
# Equations are penalty springs of stiffness ω: (H + CᵀωC) x = f + Cᵀω d, h = ω (C x − d), which is C x − h/ω = d. ω is
# so large that iterative refinement removes the term h/ω. At points without friction the springs are added to the
# blocks M_TT; the few rows of A, which may be long, are a matrix of low rank.

_NEAR_BONDED_FIRST = 12_000  # contact points above which `NEAR_BONDED_PATH` is the first path, else the last
_ROUNDING = 1e-14  # length of an equation's row, over the longest, below which it is rounding
# Least ω. Each refinement gains as many digits as ω has; dependent rows leave an error of ω roundings in h.
_SPRING = 1e6


class SparseCoordinates:
    """The maps between z and the coordinates y = (x, t, h), with the methods of `DenseCoordinates`."""

    name = "full"

    def __init__(self, qvi: FrictionQVI) -> None:
        self._qvi, self._linear = qvi, qvi.linear_system
        near = (NEAR_BONDED_PATH,)
        self.paths = near + MANY_POINTS_PATHS if qvi.m > _NEAR_BONDED_FIRST else MANY_POINTS_PATHS + near
        self._scale: Vector = 1.0 / np.sqrt(qvi.stiffness.positive_diagonal)
        rows, E = qvi.contact.factor.rows, csr_array(qvi.contact.factor.interpolation)
        self._Y = csr_array(rows @ diags_array(self._scale))
        self._frictionless_points: IntVector = np.flatnonzero(qvi.frictionless)
        equations = csr_array(vstack([csr_array(qvi.T)[self._frictionless_points], qvi.A]) @ diags_array(self._scale))
        lengths = np.sqrt(np.asarray(equations.multiply(equations).sum(axis=1)).ravel())
        self._is_free = lengths > _ROUNDING * lengths.max(initial=0.0)  # False: the unknowns cannot change the row
        self._lengths: Vector = np.where(self._is_free, lengths, 1.0)
        self.equations = csr_array(diags_array(1.0 / self._lengths) @ equations)
        count = len(lengths)
        self.E: Rows = csr_array(hstack([csr_array((2 * qvi.m, qvi.n)), E, csr_array((2 * qvi.m, count))]))
        self.A, self.frictionless = np.zeros((0, self.size)), np.zeros(0, dtype=np.int64)  # no `Equations`
        K = _scaled(qvi.K, self._scale, rows.shape[0])
        coupling = csr_array((self.equations.data, self.equations.indices, self.equations.indptr), (count, K.shape[0]))
        self._K = K
        lower_rows = csr_array(hstack([coupling, csr_array((count, count))]))
        self.stiffness = csr_array(vstack([hstack([K, coupling.T]), lower_rows])) if count else K

    @property
    def size(self) -> int:
        """Number of coordinates k = n + r + number of equations."""
        return int(sum(self._Y.shape)) + len(self._lengths)

    @property
    def springs(self) -> tuple[Vector, Vector]:
        """ω of each equation, and as entries of M_TT (m,); at points without friction ω is proportional to W."""
        points, blocks = self._frictionless_points, np.zeros(self._qvi.m)
        weights, squares = self._qvi.W[points], self._lengths[: len(points)] ** 2
        blocks[points] = weights * (_SPRING / float((weights * squares).min(initial=np.inf)))
        return np.append(blocks[points] * squares, np.full(self._qvi.p, _SPRING)), blocks

    def base(self, z: Vector, h: Vector | None = None) -> Expansion:
        """The expansion about z and the multipliers h of equations, 0 by default; one gradient."""
        qvi, count = self._qvi, len(self._lengths)
        energy, gradient = qvi.state(z)
        tractions, equality = qvi.tractions(z), qvi.b - qvi.contact.A @ z
        h = np.zeros(count) if h is None else h
        c = np.zeros(self.size)
        c[: qvi.n] = self._scale * gradient + self.equations.T @ h
        residuals = np.concatenate([tractions[qvi.m + self._frictionless_points], -equality])
        c[self.size - count :] = self._is_free * residuals / self._lengths
        return Expansion(z, c, equality, tractions, gradient, energy, qvi.energy(z), h)

    def move(self, base: Expansion, y: Vector) -> Vector:
        """The point z + dz (n,) whose coordinates are y."""
        return np.asarray(base.z + self._scale * y[: self._qvi.n])

    def moved(self, base: Expansion, y: Vector) -> Expansion:
        """See `DenseCoordinates`."""
        return self.base(self.move(base, y), base.state + y[self.size - len(self._lengths) :])

    def multipliers(self, base: Expansion, y: Vector) -> tuple[Vector, Vector]:
        """ν (p,), and m_T (m,) of the points without friction, from the multipliers h at y."""
        h, m_T = base.state + y[self.size - len(self._lengths) :], np.zeros(self._qvi.m)
        forces = h / self._lengths
        m_T[self._frictionless_points] = forces[: len(self._frictionless_points)]
        return forces[len(self._frictionless_points) :], m_T

    def bonded(self, base: Expansion) -> Vector:
        """Coordinates (k,) of the bonded solution."""
        return self.coordinates(self._linear.solve(-base.reduced, base.equality)[0])

    def length(self, y: Vector) -> float:
        """Energy norm √(xᵀ K x) of a step."""
        x = y[: self._K.shape[0]]
        return float(np.sqrt(abs(x @ (self._K @ x))))

    def defect(self, before: Expansion, y: Vector, after: Expansion) -> float:
        """Energy norm of the error of the assembled K in a step y between two bases."""
        return self.norm(after.c - before.c - self.stiffness @ y)

    def norm(self, force: Vector) -> float:
        """Energy norm √(fᵀ K⁻¹ f) of a force (k,) on x."""
        f = force[: self._qvi.n] / self._scale
        return float(np.sqrt(abs(f @ self._linear.solve(f)[0])))

    def coordinates(self, z: Vector) -> Vector:
        """Coordinates (k,) of a point z (n,), counted from z = 0."""
        return self.assembled(z / self._scale, np.zeros(len(self._lengths)))

    def assembled(self, x: Vector, h: Vector) -> Vector:
        """(x, t, h) (k,)."""
        return np.concatenate([x, self._Y @ x, h])

    def forces(self, rows: Rows) -> Rows:
        """The map (k, q) from multipliers of rows (q, k) to forces; forces on the traces t act on x by Yᵀ."""
        n, r = self._qvi.n, self._Y.shape[0]
        on_traces = csr_array(rows)[:, n : n + r]
        return csr_array(vstack([self._Y.T @ on_traces.T, csr_array((self.size - n, rows.shape[0]))]))

    def system(self, S: Matrix | SparseRows) -> SparseSystem:  # noqa: ARG002  # S is `stiffness`
        """Newton's matrices; their pattern is analysed once."""
        return SparseSystem(self, *self._analysed)

    @cached_property
    def _analysed(self) -> tuple[Filling, Refactorisation]:
        """The pattern of Newton's matrices and their symbolic factorisation, shared by all starts."""
        rows, m = csr_array(self._qvi.contact_rows @ diags_array(self._scale)), self._qvi.m
        filling = _filling(self._K, rows[:m], rows[m:])
        return filling, self._qvi.stiffness.refactorisation(filling.starts, filling.columns)


class Filling(NamedTuple):
    """The pattern of H (n, n) in compressed rows, the entries of K in it, and the map G from blocks to entries."""

    starts: IntVector  # index of the first entry of each row
    columns: IntVector  # column of each entry
    rows: IntVector  # row of each entry
    diagonal: IntVector  # (n,) indices of the diagonal entries
    entries: Vector  # of K, scaled to a diagonal of 1
    changed: IntVector  # indices of the entries that blocks change
    G: Sparse  # (changed, 3m), by blocks (M_NN, M_TN, M_TT)


class SparseSystem:
    """Newton's matrices as sparse matrices with the pattern of K."""

    patience, stragglers = MANY_POINTS_PATIENCE, MANY_POINTS_STRAGGLERS
    longest = 0.9999  # no limit in practice
    small = 5e-4  # here weights are small because edges are many, not because meshes are graded
    last_digits = False
    orientation = 0  # PARDISO does not give the sign of the determinant

    def __init__(self, space: SparseCoordinates, filling: Filling, factor: Refactorisation) -> None:
        self._space, self._filling, self._factor = space, filling, factor
        self._size = len(filling.starts) - 1
        self._values = np.empty_like(filling.entries)  # entries of the last H
        self._springs, self._spring_blocks = space.springs
        self.norm = space.norm  # see `DenseSystem`
        points = int(np.count_nonzero(self._spring_blocks))
        self._shear_rows, self._A_rows = space.equations[:points], space.equations[points:]

    def factorised(self, problem: Complementarity, D: Vector, e: Vector) -> Solve:
        """See `DenseSystem.factorised`. A new factorisation makes earlier inverses invalid."""
        blocks = problem.spread(D, e)
        if not np.isfinite(blocks).all():
            raise LinAlgError("it is not finite")
        blocks[2 * len(self._spring_blocks) :] += self._spring_blocks
        values, scale = self._filled(blocks)
        try:
            self._factor.factorise(values)
        except FactorisationError as error:
            if error.reason != "singular":
                raise
            raise LinAlgError("it is singular") from error

        def inverse(force: Vector) -> Vector:
            return np.asarray(scale * self._factor.solve(scale * force))

        # The rows of A, of low rank, by the Woodbury formula with the capacitance A H⁻¹Aᵀ + ω⁻¹.
        A, points = self._A_rows, self._shear_rows.shape[0]
        columns = np.array([inverse(row) for row in A.toarray()]).reshape(A.shape).T  # H⁻¹Aᵀ
        capacitance = A @ columns + np.diag(1.0 / self._springs[points:])

        def solve(force: Vector) -> Vector:
            d = force[len(force) - len(self._springs) :]
            x = inverse(force[: self._size] + self._shear_rows.T @ (self._springs * d)[:points])
            h_A = np.linalg.solve(capacitance, A @ x - d[points:])
            x = x - columns @ h_A
            h_shear = self._springs[:points] * (self._shear_rows @ x - d[:points])
            return self._space.assembled(x, np.concatenate([h_shear, h_A]))

        return solve

    def _filled(self, blocks: Vector) -> tuple[Vector, Vector]:
        """The entries of H, scaled to a diagonal of 1, and the scale (n,) of rows and columns."""
        filling, values = self._filling, self._values
        np.copyto(values, filling.entries)
        values[filling.changed] += filling.G @ blocks
        scale = 1.0 / np.sqrt(np.maximum(values[filling.diagonal], 1.0))
        values *= scale[filling.rows]
        values *= scale[filling.columns]
        return values, scale


Coordinates: TypeAlias = DenseCoordinates | SparseCoordinates
NewtonSystem: TypeAlias = DenseSystem | SparseSystem


def _scaled(K: Sparse, scale: Vector, more: int) -> SparseRows:
    """diag(scale) K diag(scale) in compressed rows, indices sorted, with `more` zero rows and columns added."""
    if not K.has_sorted_indices:
        K = K.sorted_indices()
    columns = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    starts = np.append(K.indptr, np.full(more, K.indptr[-1], dtype=K.indptr.dtype))
    return csr_array((K.data * scale[K.indices] * scale[columns], K.indices, starts), (K.shape[0] + more,) * 2)


def _filling(K: SparseRows, N: SparseRows, T: SparseRows) -> Filling:
    """The filling of H = K + Σ M_NN NᵀN + M_TN TᵀN + M_TT TᵀT over contact points.

    Only the first n rows of K are used, n the number of columns of N. An entry (row, column) has the key row · n +
    column.
    """
    m, n = N.shape
    products = [_products(left, right) for left, right in ((N, N), (T, N), (T, T))]
    K_keys = np.repeat(np.arange(n, dtype=np.int64), np.diff(K.indptr[: n + 1])) * n + K.indices
    keys = np.concatenate([rows * n + columns for _, rows, columns, _ in products])
    # The pattern of K, with the entries of the products that it lacks, and their transposes.
    pattern, entries = K_keys, K.data
    missing = keys[_places(K_keys, keys) < 0]
    if len(missing):
        pattern = np.union1d(K_keys, np.concatenate([missing, (missing % n) * n + missing // n]))
        entries = np.zeros(len(pattern))
        entries[_places(pattern, K_keys)] = K.data
    rows, columns = pattern // n, pattern % n
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    # G: the values of the products at the changed entries, a column for each block of each point.
    points = np.concatenate([number * m + point for number, (point, *_) in enumerate(products)])
    values = np.concatenate([value for *_, value in products])
    changed, places = np.unique(_places(pattern, keys), return_inverse=True)
    G = csc_array((values, (places, points)), (len(changed), 3 * m))
    diagonal = _places(pattern, np.arange(n) * (n + 1))
    return Filling(starts, columns, rows, diagonal, entries, changed, G)


def _places(pattern: IntVector, keys: IntVector) -> IntVector:
    """The indices of keys in a sorted pattern, −1 for keys that it lacks."""
    index = np.minimum(np.searchsorted(pattern, keys), len(pattern) - 1)
    return np.where(pattern[index] == keys, index, -1)


def _products(left: SparseRows, right: SparseRows) -> tuple[IntVector, IntVector, IntVector, Vector]:
    """(point, row, column, value) of all entries of the products leftᵢᵀ rightᵢ of the rows of each point i."""
    counts = np.diff(right.indptr)[np.repeat(np.arange(left.shape[0]), np.diff(left.indptr))]
    in_left = np.repeat(np.arange(left.nnz), counts)  # index of the left factor
    point = np.repeat(np.arange(left.shape[0]), np.diff(left.indptr))[in_left]
    number = np.arange(len(in_left)) - np.repeat(np.cumsum(counts) - counts, counts)  # within the row of right
    in_right = right.indptr[point] + number  # index of the right factor
    rows, columns = (part.astype(np.int64) for part in (left.indices[in_left], right.indices[in_right]))
    return point, rows, columns, left.data[in_left] * right.data[in_right]
