"""(D2) on the unknowns that contact rows touch, in trace coordinates y, and Newton's matrices there: dense, or sparse.

Eliminating the interior about a point z leaves (D4), with c for γ_y. The gradient γ there is computed without the
rounding inside K where the problem has an `EnergyRoot`, so that moving z repairs what S lacks.

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
    """s λ of friction bounds and caps over s λ of normal bounds on a central path, and where it begins."""

    early: float  # until slacks fit their tractions
    late: float  # from there on
    start: float = 0.1  # the least multiplier at the start, of the scale of displacement


FRICTION_SHARES = (PathWeights(30.0, 1000.0), PathWeights(100.0, 100.0), PathWeights(1e4, 1e4), PathWeights(10.0, 10.0))
"""Tried one after the other if need be: with 1 to the end the path often turns back where contact opens and friction is
large, and with 1000 from the start where rows are dense."""

FITTING_SHARES = PathWeights(1.0, 30.0)
"""Tried next where slacks do not fit their tractions: close to a sliding limit those of walls fit with these alone."""

MANY_POINTS_SHARES = (FITTING_SHARES, PathWeights(30.0, 1000.0), PathWeights(1e4, 1e4), PathWeights(10.0, 10.0))
"""The same where points are thousands: pressures are rounded off as much as friction at first, and beds open and slip
without a step that is short."""

NEAR_BONDED_SHARES = FITTING_SHARES._replace(start=0.002)
"""A start nearer to the bonded solution. From larger multipliers the pressure of large walls gathers at first in the
last cells of the lowest bed, where steps become short; small problems take more iterations from here."""

MANY_POINTS_PATIENCE = 15  # close to the limit the gap hovers for a while and goes on
MANY_POINTS_STRAGGLERS = 0.02

SLOTS: Final = (1.0, -1.0, 1.0, -1.0)
"""Sign of each bound of a traction: friction above and below, or pressure; cap above and below."""

Solve: TypeAlias = Callable[[Vector], Vector]
"""From a force (k,) to coordinates (k,)."""


@dataclass(eq=False)
class Expansion:
    """A point about which a problem is posed."""

    z: Vector  # (n,)
    c: Vector  # (k,) gradient in coordinates
    equality: Vector  # (p,) b − A z
    tractions: Vector  # (2m,) σ_N and σ_T at z
    reduced: Vector  # the gradient by the unknowns that are kept, Γ or all
    strain_energy: float  # at z
    energy: float  # that of (D2) at y = 0, z with its interior in equilibrium
    state: State  # of the elimination, what `Factorisation.expand` takes; of sparse ones multipliers of equations


class DenseCoordinates:
    """The maps between z and trace coordinates y (k,), in which a problem is posed about a base, and S_y.

    Attributes
    ----------
    shares : of friction, see `FRICTION_SHARES`
    stiffness : S_y (k, k), the energy is ½ yᵀ stiffness y + cᵀy + const
    E : (2m, k), tractions by coordinates
    A : A_y (p, k) equations, and frictionless : points with σ_T = 0, that are solved for some of the coordinates

    """

    name = "condensed"  # form of the result

    def __init__(self, qvi: FrictionQVI) -> None:
        interface = qvi.condensed_contact
        self._qvi, self._system = qvi, interface.system
        self._coordinates, self._scale, self.stiffness, self.E, self.A = interface.reduced
        self.frictionless = np.flatnonzero(qvi.frictionless)
        self._many = not qvi.stiffness.condensing_pays(qvi.contact)
        self.shares = MANY_POINTS_SHARES if self._many else FRICTION_SHARES

    @property
    def size(self) -> int:
        """Number of trace coordinates k."""
        return len(self._scale)

    def forces(self, rows: Rows) -> Rows:
        """Rowsᵀ (k, q), which turns multipliers of rows (q, k) into forces."""
        return transposed(rows)

    def system(self, S: Matrix | SparseRows) -> DenseSystem:
        """Newton's matrices for S (u, u), that of the coordinates that equations leave free."""
        return DenseSystem(np.asarray(S), many=self._many)

    def multipliers(self, base: Expansion, y: Vector) -> tuple[Vector, Vector] | None:  # noqa: ARG002
        """(ν (p,), m_T (m,) of points without friction) at y; None where equations are solved, not coordinates."""
        return None

    def length(self, y: Vector) -> float:
        """Energy norm of a step."""
        return float(np.sqrt(abs(y @ (self.stiffness @ y))))

    def base(self, z: Vector) -> Expansion:
        """The reduced problem about z: one gradient and one forward elimination, at z = 0 those of a problem before."""
        qvi = self._qvi
        strain, gradient = qvi.state(z)
        if z.any():
            reduced, state = self._system.factor.reduce(-gradient)
            energy = qvi.energy(z)  # the interior is in equilibrium there
        else:
            reduced, state, energy = qvi.bonded_state.at_rest  # friction, cohesion and caps change nothing of it
        c = -self._scale * self._coordinates.from_unknowns(reduced)
        return Expansion(z, c, qvi.b - qvi.contact.A @ z, qvi.tractions(z), -reduced, strain, energy, state)

    def moved(self, base: Expansion, y: Vector) -> Expansion:
        """The problem about the point with trace coordinates y."""
        return self.base(self.move(base, y))

    def move(self, base: Expansion, y: Vector) -> Vector:
        """The point z + dz whose trace coordinates are y, its interior in equilibrium."""
        values = self._coordinates.to_unknowns(self._scale * y)
        return np.asarray(base.z + self._system.factor.expand(base.state, values))

    def bonded(self, base: Expansion) -> Vector:
        """Trace coordinates (k,) of the bonded solution, on which no contact law acts."""
        values, _ = self._system.solve_interface(-base.reduced, base.equality)
        return self._coordinates.from_values(values) / self._scale

    def coordinates(self, z: Vector) -> Vector:
        """Trace coordinates (k,) of a point z (n,), counted from z = 0."""
        return np.asarray(self._coordinates.from_values(z[self._system.interface]) / self._scale)

    def defect(self, before: Expansion, y: Vector, after: Expansion) -> float:
        """Energy norm of what the reduced problem missed on the way from one base to the next, y its step."""
        predicted = before.reduced + self._system.schur @ self._coordinates.to_unknowns(self._scale * y)
        missed = after.reduced - predicted
        return float(np.sqrt(abs(missed @ self._system.solve_interface(missed)[0])))


class DenseSystem:
    """The matrices of Newton's method for S (k, k) dense; `many`: whether contact points are many.

    Attributes
    ----------
    patience : iterations without progress after which the central path is followed
    stragglers : share of slacks and multipliers that may not hold up all the others
    longest : step that is taken at most, of the way to the nearest bound
    small : share of a contact that belongs to one bound, below which the gap has to be smaller
    last_digits : whether forces have digits left where the gap is at its floor: iterations go on for them, and `Saddle`
        can take its place
    orientation : sign of the determinant of the matrix factorised last; 0 where it is not known

    """

    longest = 0.99  # beyond, forces lose digits on graded meshes
    small = 2e-3
    last_digits = True

    def __init__(self, S: Matrix, *, many: bool = False) -> None:
        self._S = S
        self.patience, self.stragglers = (MANY_POINTS_PATIENCE, MANY_POINTS_STRAGGLERS) if many else (6, 0.0)
        self.orientation = 1

    def norm(self, force: Vector) -> float:
        """√(fᵀ S⁻¹ f) of a force (k,): how far it moves the body; 0 where S is no longer definite to rounding."""
        if self._cholesky is None or not len(force):
            return 0.0
        return float(np.sqrt(abs(force @ dpotrs(self._cholesky, force, lower=1)[0])))

    def factorised(self, problem: Complementarity, ratio: Vector, slope: Vector) -> Solve:
        """The inverse of S + BᵀW diag(ratio) C, see `Complementarity.blocks`; `LinAlgError` if it is singular.

        Scaled to a diagonal of 1.
        """
        if not len(self._S):
            return lambda force: force
        H = self._S + problem.stiffness(*problem.blocks(ratio, slope))
        scale = 1.0 / np.sqrt(np.maximum(H.diagonal(), 1.0))
        H *= scale
        factor, pivots, info = dgetrf(np.multiply(H, scale[:, None], order="F"), overwrite_a=1)
        if info > 0 or not np.isfinite(factor).all():
            raise LinAlgError("it is singular")
        swaps, negative = pivots != np.arange(len(pivots)), factor.diagonal() < 0.0
        self.orientation = -1 if (np.count_nonzero(swaps) + np.count_nonzero(negative)) % 2 else 1
        return lambda force: np.asarray(scale * dgetrs(factor, pivots, scale * force)[0])

    @cached_property
    def _cholesky(self) -> Matrix | None:
        factor, info = dpotrf(self._S, lower=1, clean=0) if len(self._S) else (None, 1)
        return None if info else factor


# (D2) in all unknowns, for contacts that are a large share of a body: nothing is eliminated, all stays sparse.
#
# Coordinates are y = (x, t, h): unknowns x = D^½ z with which the diagonal of K is 1, the traces t = Y z of [N; T] = E
# Y, all of them, whether they depend on each other or not, and multipliers h of equations C x = d, rows of length one:
# σ_T = 0 at points without friction, and A z = b. Traces grow with every step by what the step says, so that t = Y z
# but for rounding, and slacks that are taken from E t fit each other exactly. Forces of bounds act on x alone:
#
#     S = [D^-½ K D^-½  0  Cᵀ],      E_y = [0  E  0],      Eᵀ m stands for D^-½ Yᵀ Eᵀ m on x, and 0 on t and h.
#         [0            0  0 ]
#         [C            0  0 ]
#
# Newton's matrix H of (D33), whose blocks have −mu p' in the place of mu at bilateral points, p' = dp/dσ_N, has K's
# pattern: it is analysed once, and filled by one sparse matrix G, which adds G (M_NN, M_TN, M_TT) to those of K's
# entries that contact points touch. Equations are springs beside it, of a stiffness ω so large that C x − h/ω = d says
# the same but for a rounding that refinement takes away: (H + CᵀωC) x = f + Cᵀω d, h = ω (C x − d). At points without
# friction they are blocks M_TT; the few rows of A, long as they may be, are a matrix of low rank.


_NEAR_FROM = 12_000  # contact points, above which a start near the bonded solution is the first, else the last
_ROUNDING = 1e-14  # rows of equations shorter than this beside the longest are rounding
_SPRING = 1e6  # least ω: refinement gains as many digits each time, and dependent rows make noise of ω roundings in h


class SparseCoordinates:
    """The maps between z and the coordinates y = (x, t, h), with the methods of `DenseCoordinates`."""

    name = "full"

    def __init__(self, qvi: FrictionQVI) -> None:
        self._qvi, self._linear = qvi, qvi.linear_system
        near = (NEAR_BONDED_SHARES,)
        self.shares = near + MANY_POINTS_SHARES if qvi.m > _NEAR_FROM else MANY_POINTS_SHARES + near
        diagonal = qvi.K.diagonal()
        self._scale: Vector = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        rows, E = qvi.contact.factor.rows, csr_array(qvi.contact.factor.interpolation)
        self._Y = csr_array(rows @ diags_array(self._scale))
        self._points: IntVector = np.flatnonzero(qvi.frictionless)  # without friction
        equations = csr_array(vstack([csr_array(qvi.T)[self._points], qvi.A]) @ diags_array(self._scale))
        lengths = np.sqrt(np.asarray(equations.multiply(equations).sum(axis=1)).ravel())
        self._free = lengths > _ROUNDING * lengths.max(initial=0.0)  # what is prescribed cannot be changed
        self._lengths: Vector = np.where(self._free, lengths, 1.0)
        self.equations = csr_array(diags_array(1.0 / self._lengths) @ equations)
        count = len(lengths)
        self.E: Rows = csr_array(hstack([csr_array((2 * qvi.m, qvi.n)), E, csr_array((2 * qvi.m, count))]))
        self.A, self.frictionless = np.zeros((0, self.size)), np.zeros(0, dtype=np.int64)  # none is solved for any
        K = _scaled(qvi.K, self._scale, rows.shape[0])
        coupling = csr_array((self.equations.data, self.equations.indices, self.equations.indptr), (count, K.shape[0]))
        self._K = K
        beside = csr_array(hstack([coupling, csr_array((count, count))]))
        self.stiffness = csr_array(vstack([hstack([K, coupling.T]), beside])) if count else K

    @property
    def size(self) -> int:
        """Number of coordinates k = n + r + equations."""
        return int(sum(self._Y.shape)) + len(self._lengths)

    @property
    def springs(self) -> tuple[Vector, Vector]:
        """ω of the equations, at points without friction proportional to their weights; as entries of M_TT (m,)."""
        points, blocks = self._points, np.zeros(self._qvi.m)
        weights, squares = self._qvi.W[points], self._lengths[: len(points)] ** 2
        blocks[points] = weights * (_SPRING / float((weights * squares).min(initial=np.inf)))
        return np.append(blocks[points] * squares, np.full(self._qvi.p, _SPRING)), blocks

    def base(self, z: Vector, held: Vector | None = None) -> Expansion:
        """The problem about z, with these multipliers of equations, 0 by default: one gradient."""
        qvi, count = self._qvi, len(self._lengths)
        energy, gradient = qvi.state(z)
        tractions, missed = qvi.tractions(z), qvi.b - qvi.contact.A @ z
        held = np.zeros(count) if held is None else held
        c = np.zeros(self.size)
        c[: qvi.n] = self._scale * gradient + self.equations.T @ held
        c[self.size - count :] = self._free * np.concatenate([tractions[qvi.m + self._points], -missed]) / self._lengths
        return Expansion(z, c, missed, tractions, gradient, energy, qvi.energy(z), held)

    def move(self, base: Expansion, y: Vector) -> Vector:
        """The point z + dz whose coordinates are y."""
        return np.asarray(base.z + self._scale * y[: self._qvi.n])

    def moved(self, base: Expansion, y: Vector) -> Expansion:
        """See `DenseCoordinates`."""
        return self.base(self.move(base, y), base.state + y[self.size - len(self._lengths) :])

    def multipliers(self, base: Expansion, y: Vector) -> tuple[Vector, Vector]:
        """(ν (p,), m_T (m,) of points without friction) for the multipliers h of equations at y."""
        held, m_T = base.state + y[self.size - len(self._lengths) :], np.zeros(self._qvi.m)
        forces = held / self._lengths
        m_T[self._points] = forces[: len(self._points)]
        return forces[len(self._points) :], m_T

    def bonded(self, base: Expansion) -> Vector:
        """Coordinates (k,) of the bonded solution, on which no contact law acts."""
        return self.coordinates(self._linear.solve(-base.reduced, base.equality)[0])

    def length(self, y: Vector) -> float:
        """Energy norm of a step."""
        x = y[: self._K.shape[0]]
        return float(np.sqrt(abs(x @ (self._K @ x))))

    def defect(self, before: Expansion, y: Vector, after: Expansion) -> float:
        """Energy norm of what K as it is assembled missed on the way from one base to the next, y its step."""
        return self.norm(after.c - before.c - self.stiffness @ y)

    def norm(self, force: Vector) -> float:
        """√(fᵀ S⁻¹ f) of a force (k,)."""
        f = force[: self._qvi.n] / self._scale
        return float(np.sqrt(abs(f @ self._linear.solve(f)[0])))

    def coordinates(self, z: Vector) -> Vector:
        """Coordinates (k,) of a point z (n,), counted from z = 0."""
        return self.whole(z / self._scale, np.zeros(len(self._lengths)))

    def whole(self, x: Vector, held: Vector) -> Vector:
        """(x, t, h) (k,)."""
        return np.concatenate([x, self._Y @ x, held])

    def forces(self, rows: Rows) -> Rows:
        """Rowsᵀ (k, q), which turns multipliers of rows (q, k) into forces: those on t are brought to x."""
        n, r = self._qvi.n, self._Y.shape[0]
        on_traces = csr_array(rows)[:, n : n + r]
        return csr_array(vstack([self._Y.T @ on_traces.T, csr_array((self.size - n, rows.shape[0]))]))

    def system(self, S: Matrix | SparseRows) -> SparseSystem:  # noqa: ARG002  # it is this one's own
        """Newton's matrices, analysed once."""
        return SparseSystem(self, *self._analysed)

    @cached_property
    def _analysed(self) -> tuple[Filling, Refactorisation]:
        """The pattern of Newton's matrices, and what factorises them; every start takes these."""
        rows, m = csr_array(self._qvi.contact_rows @ diags_array(self._scale)), self._qvi.m
        filling = _filling(self._K, rows[:m], rows[m:])
        return filling, self._qvi.stiffness.refactorisation(filling.starts, filling.columns)


class Filling(NamedTuple):
    """A pattern in compressed rows, K's entries in it, and what blocks change."""

    starts: IntVector  # the pattern of H (n, n)
    columns: IntVector
    rows: IntVector
    diagonal: IntVector  # (n,) places in it
    entries: Vector  # those of K, its diagonal 1
    changed: IntVector  # places at which blocks add; `G` (changed, 3m) by what
    G: Sparse


class SparseSystem:
    """Newton's matrices as sparse ones of K's pattern."""

    patience, stragglers = MANY_POINTS_PATIENCE, MANY_POINTS_STRAGGLERS
    longest = 0.9999  # where nothing bends the way
    small = 5e-4  # edges are many rather than of many lengths
    last_digits = False
    orientation = 0  # PARDISO does not tell

    def __init__(self, whole: SparseCoordinates, filling: Filling, factor: Refactorisation) -> None:
        self._whole, self._filling, self._factor = whole, filling, factor
        self._size = len(filling.starts) - 1
        self._values = np.empty_like(filling.entries)  # of H, whichever was filled last
        self._springs, self._blocks = whole.springs
        self.norm = whole.norm  # see `DenseSystem`
        points = int(np.count_nonzero(self._blocks))
        self._sheared, self._across = whole.equations[:points], whole.equations[points:]

    def factorised(self, problem: Complementarity, ratio: Vector, slope: Vector) -> Solve:
        """See `DenseSystem`. Only the last one can be solved with."""
        blocks = problem.spread(*problem.blocks(ratio, slope))
        if not np.isfinite(blocks).all():
            raise LinAlgError("it is not finite")
        blocks[2 * len(self._blocks) :] += self._blocks
        values, scale = self._filled(blocks)
        try:
            self._factor.factorise(values)
        except FactorisationError as error:
            if error.reason != "singular":
                raise
            raise LinAlgError("it is singular") from error

        def inverse(force: Vector) -> Vector:
            return np.asarray(scale * self._factor.solve(scale * force))

        across, points = self._across, self._sheared.shape[0]
        columns = np.array([inverse(row) for row in across.toarray()]).reshape(across.shape).T
        relief = across @ columns + np.diag(1.0 / self._springs[points:])

        def solve(force: Vector) -> Vector:
            wanted = force[len(force) - len(self._springs) :]
            x = inverse(force[: self._size] + self._sheared.T @ (self._springs * wanted)[:points])
            held = np.linalg.solve(relief, across @ x - wanted[points:])
            x = x - columns @ held
            sheared = self._springs[:points] * (self._sheared @ x - wanted[:points])
            return self._whole.whole(x, np.concatenate([sheared, held]))

        return solve

    def _filled(self, blocks: Vector) -> tuple[Vector, Vector]:
        """H's entries, rows and columns scaled to a diagonal of 1, and the scale (n,)."""
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
    """diag(scale) K diag(scale) by rows, as it is symmetric, indices sorted; so many zero rows and columns more."""
    if not K.has_sorted_indices:
        K = K.sorted_indices()
    columns = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    starts = np.append(K.indptr, np.full(more, K.indptr[-1], dtype=K.indptr.dtype))
    return csr_array((K.data * scale[K.indices] * scale[columns], K.indices, starts), (K.shape[0] + more,) * 2)


def _filling(K: SparseRows, N: SparseRows, T: SparseRows) -> Filling:
    """For H = K + Σ M_NN NᵀN + M_TN TᵀN + M_TT TᵀT over contact points; K may have zero rows behind the n of N."""
    m, n = N.shape
    products = [_products(left, right) for left, right in ((N, N), (T, N), (T, T))]
    own_starts = K.indptr[: n + 1]
    own = np.repeat(np.arange(n, dtype=np.int64), np.diff(own_starts)) * n + K.indices
    keys = np.concatenate([rows * n + columns for _, rows, columns, _ in products])
    pattern, entries = own, K.data
    missing = keys[_places(own, keys) < 0]
    if len(missing):
        pattern = np.union1d(own, np.concatenate([missing, (missing % n) * n + missing // n]))
        entries = np.zeros(len(pattern))
        entries[_places(pattern, own)] = K.data
    rows, columns = pattern // n, pattern % n
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    points = np.concatenate([number * m + point for number, (point, *_) in enumerate(products)])
    values = np.concatenate([value for *_, value in products])
    changed, places = np.unique(_places(pattern, keys), return_inverse=True)
    G = csc_array((values, (places, points)), (len(changed), 3 * m))
    diagonal = _places(pattern, np.arange(n) * (n + 1))
    return Filling(starts, columns, rows, diagonal, entries, changed, G)


def _places(pattern: IntVector, keys: IntVector) -> IntVector:
    """Where keys stand in a sorted pattern, −1 where they do not."""
    found = np.minimum(np.searchsorted(pattern, keys), len(pattern) - 1)
    return np.where(pattern[found] == keys, found, -1)


def _products(left: SparseRows, right: SparseRows) -> tuple[IntVector, IntVector, IntVector, Vector]:
    """(point, row, column, value) of all entries of leftᵢᵀ rightᵢ, for each point i."""
    counts = np.diff(right.indptr)[np.repeat(np.arange(left.shape[0]), np.diff(left.indptr))]
    first = np.repeat(np.arange(left.nnz), counts)  # entry of left
    point = np.repeat(np.arange(left.shape[0]), np.diff(left.indptr))[first]
    within = np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    second = right.indptr[point] + within
    rows, columns = (part.astype(np.int64) for part in (left.indices[first], right.indices[second]))
    return point, rows, columns, left.data[first] * right.data[second]
