"""Supports of a body: prescribed tractions as conditions on Φ, eliminated in an order that keeps the solution sparse.

An edge of length h runs from a to b, with tangent t and m = (−t_y, t_x). The Legendre coefficients N_k of Φ_tt and Q_k
of Φ_tm obey

    ∇Φ_b − ∇Φ_a = h (N₀ t + Q₀ m),   Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2 = −h² N₁/6

These are the edge's resultant force and moment. A prescribed traction vector fixes both, and N_2 …, Q_1 … directly.
If only one component d·σn is given, its coefficients combine those of σ_N = Φ_tt and σ_T = −(n·m) Φ_tm. Since σ_T may
jump at vertices, corners where two edges meet need no special treatment.

Together the conditions are rows C u = d. C, and the basis B of the solutions u = B z + u₀(d), depend on the edges and
directions of the prescribed components. Their values enter d only.

The rows are solved one after the other. A row is first written in the degrees of freedom that are still free, and then
solved for one of them, its pivot. The order of the rows decides how many other degrees of freedom a pivot depends on.
The rows follow the boundary edge by edge: then every row has new degrees of freedom, and is solved for one of these.
A row that becomes zero follows from the others, and shows whether d is consistent.

In `docs/theory.md`: (D2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.curved import resultant_shapes
from qvi_contact.discretization.space import Functionals, StressSpace, frame
from qvi_contact.element.edge import EdgeQuadrature, gauss_legendre, legendre_basis, legendre_from_values
from qvi_contact.mesh.edges import Edges, frames_along, vectors_along
from qvi_contact.problem.problem import Prescribed
from solvers.basics.types import Kept, PicklesFields, read_only
from solvers.inequality.rows import are_few

_POINTS: Final = 6  # Gauss points for data given as functions, less p: of edges, or parts of edges
_PARALLEL: Final = 1e-12  # component of a unit vector that counts as zero
_ALIKE: Final = 1.5  # ratio up to which cells at vertices count as equally small when the gauge is placed
_BALANCED: Final = 1e-9  # imbalance of a closed part of the boundary, relative to the loads, that passes as round-off
_DEPENDENT: Final = 1e-9  # largest entry of a reduced row over that of the row, up to which it follows from the others
_WORTHY: Final = 1e-2  # least entry of a pivot, relative to the largest entry of the reduced row


class _Conditions(NamedTuple):
    """Rows C u = d; each entry of d is a force, a moment or a degree of freedom, dimensionless."""

    C: Functionals
    number: IntArray  # (r,): the edge of each row
    # d (r,) of the prescribed components, see `loads.traction_data`; and whether an entry is a force or a moment
    data: Callable[[Sequence[EdgeQuadrature]], tuple[FloatArray, BoolArray]]


@dataclass(frozen=True, eq=False)
class Supports(PicklesFields):
    """All degrees of freedom u = B z + u₀ that meet the prescribed tractions; the gauge fixes the affine part of Φ.

    Data that are polynomials of the degree of tractions are met exactly. Of other data each edge keeps the resultant
    force and moment. The gauge sets Φ and ∇Φ to zero at the first centre of `Frames`. The elimination begins there, or
    where cells are small, so that degrees of freedom of small cells do not follow from large numbers far away. Last
    come the edges between the vertices of two centres, which tie their affine functions to each other, and the edges
    across the cut of a hole, which alone determine the jump of Φ there.
    """

    space: StressSpace
    number: IntArray  # (k,): the edge of each prescribed component; twice for two components
    direction: FloatArray  # (k, 2): its direction
    turns: BoolArray  # (k,): whether the direction turns along arcs, see `Prescribed`

    @classmethod
    def on(cls, space: StressSpace, given: Sequence[Prescribed], kept: Kept) -> Supports:
        """The supports of a space for these components, made once and kept."""
        parts: list[Any] = [(np.empty(0, np.int64), np.empty((0, 2)), np.empty(0, bool))]
        parts += [
            (part.edges.number, part.direction, [part.turns and part.edges.curved] * len(part.direction))
            for part in given
        ]
        number, direction, turns = map(np.concatenate, zip(*parts, strict=True))
        key = space, number.tobytes(), direction.tobytes(), turns.tobytes()
        return kept(cls, key, lambda: cls(space, number, direction, turns))

    @property
    def basis(self) -> Basis:
        """B."""
        return self.elimination.basis

    @property
    def points(self) -> int:
        """Number of Gauss points on edges, or parts of edges, for the data of `particular`."""
        return self.space.degree + _POINTS

    def particular(self, given: Sequence[EdgeQuadrature]) -> tuple[FloatArray, float]:
        """u₀ (N,), zero at the unknowns, for the data, and the force (or moment over the length) out of balance.

        `given` is that of `loads.traction_data`, or empty for zero tractions. An imbalance within rounding counts as 0.
        """
        if not any(part.values.any() for part in given):
            return np.zeros(self.space.size), 0.0
        d, is_load = self._conditions.data(given)
        largest = float(np.abs(d[is_load]).max(initial=0.0))
        u, residual = self.elimination.particular(np.concatenate([np.zeros(3), d[self._walk[0]]]))
        imbalance = float(np.abs(residual).max(initial=0.0))
        return u, imbalance if imbalance > _BALANCED * largest else 0.0

    def missed(self, u: FloatArray, given: Sequence[EdgeQuadrature]) -> float:
        """Sum over edges of the forces, and moments over the length, by which u (N,) misses the data."""
        d, is_load = self._conditions.data(given)
        return float(np.abs(self._conditions.C.apply(u)[:, 0] - d)[is_load].sum())

    @cached_property
    def _conditions(self) -> _Conditions:
        """The conditions: traction vectors on edges where two components are given, else one component.

        A vector is 2p − 2 rows: its force and moment, and the other Legendre coefficients. A component
        d·σn = (d·n) σ_N + (d·t) σ_T is p − 1 rows: its Legendre coefficients.
        """
        space, degree = self.space, self.space.degree - 2
        number, direction, turns = self.number, self.direction, self.turns
        # pairs (one, other) of components on one edge, and single components
        order = np.argsort(number, kind="stable")
        pairs = (number[order][1:] == number[order][:-1]).nonzero()[0]
        one, other = order[pairs], order[pairs + 1]
        is_single = np.ones(len(order), dtype=bool)
        is_single[pairs] = is_single[pairs + 1] = False
        single = order[is_single]
        both, alone = _edges_of(space, number[one]), _edges_of(space, number[single])
        # rows of single components: the shares d·n and d·t of the coefficients of σ_N and σ_T
        scale = np.ones((len(single), degree + 1))
        scale[:, 0] = h = space.lengths(alone)
        scale[:, 1] = h**2 / 6.0
        traces = space.traces(alone)
        combined: FloatArray = np.zeros((len(single), degree + 1, traces.columns.shape[1]))
        for axis, half in ((alone.normal, slice(degree + 1)), (alone.tangent, slice(degree + 1, None))):
            share = (direction[single] * axis).sum(axis=1)
            share[np.abs(share) <= _PARALLEL] = 0.0
            part = (share[:, None] * scale)[:, :, None] * traces.values[:, half]
            if alone.curved:
                # along an arc the share varies: multiply at points, then project on Legendre polynomials
                arcs, bent, t = alone.take(alone.bent), single[alone.bent], gauss_legendre(self.points)[0]
                d = vectors_along(arcs, direction[bent], t, turns=turns[bent])
                along = (d * vectors_along(arcs, axis[alone.bent], t)).sum(axis=2)
                along[np.abs(along) <= _PARALLEL] = 0.0
                matrices = legendre_from_values(degree, len(t)) @ (along[:, :, None] * legendre_basis(degree, t))
                part[alone.bent] = (matrices * scale[alone.bent, :, None]) @ traces.values[alone.bent, half]
            combined += part

        def data(given: Sequence[EdgeQuadrature]) -> tuple[FloatArray, BoolArray]:
            values, norms = EdgeQuadrature.joined(given), 2.0 * np.arange(degree + 1) + 1.0
            edges = _edges_of(space, number)  # twice where two components are given
            edge, t, parts, factor = values.edge, values.t, edges.take(values.edge), frame(edges)[1][:, None, None]
            # dual basis of the directions d, d' of an edge: dual·d = 1, dual·d' = 0, so that σn = Σ value dual. For a
            # single component d' is at right angles to d, and the dual is d.
            partner, partner_turns = np.column_stack([direction[:, 1], -direction[:, 0]]), turns.copy()
            partner[one], partner[other] = direction[other], direction[one]
            partner_turns[one], partner_turns[other] = turns[other], turns[one]
            own = vectors_along(parts, direction[edge], t, turns=turns[edge])
            dual = vectors_along(parts, partner[edge], t, turns=partner_turns[edge])
            dual = np.stack([-dual[..., 1], dual[..., 0]], axis=-1)
            dual /= (dual * own).sum(axis=-1, keepdims=True)
            # shares of Φ_tt and Φ_tm in each value; integrals: force along and across the chord, moment, N_2 …, Q_1 …
            normal, tangent = frames_along(parts, t)
            N, Q = (dual * normal).sum(axis=-1)[..., None], factor[edge] * (dual * tangent).sum(axis=-1)[..., None]
            shapes, scaled = resultant_shapes(parts.bend, t), legendre_basis(degree, t) * norms
            resultants = N * shapes[..., 0] + Q * shapes[..., 1]
            sums = values.integrals(np.concatenate([resultants, N * scaled[..., 2:], Q * scaled[..., 1:]], axis=-1))
            # both components together, on chords of length h: force in x and y, moment, coefficients
            vectors, lengths = sums[one] + sums[other], space.lengths(both)[:, None]
            vectors[:, :2] = lengths * (vectors[:, :1] * both.tangent + vectors[:, 1:2] * frame(both)[0])
            vectors[:, 2:3] *= lengths**2
            d = np.concatenate([vectors.ravel(), (values.coefficients(degree)[single] * scale).ravel()])
            is_load = np.tile(of_both < 3, len(one)), np.tile(of_alone < 2, len(single))
            return d, np.concatenate(is_load)

        # one group for each row
        groups = space.resultants(both), traces._replace(values=combined)
        columns = np.concatenate([each.columns.repeat(each.values.shape[1], axis=0) for each in groups])
        entries = np.concatenate([each.values.reshape(-1, 1, each.values.shape[2]) for each in groups])
        of_both, of_alone = np.arange(2 * degree + 2), np.arange(degree + 1)
        numbers = np.concatenate([np.repeat(number[one], len(of_both)), np.repeat(number[single], len(of_alone))])
        return _Conditions(Functionals(columns, entries, space.size), numbers, data)

    @cached_property
    def _walk(self) -> tuple[IntArray, IntArray, int]:
        """The order of the rows, the age of each vertex in it (see `walk`), and the vertex of the gauge."""
        space, number = self.space, self._conditions.number
        numbers = np.bincount(number).nonzero()[0]
        frames, lines = space.frames, space.mesh.topology.ends[numbers]
        small = space.sizes <= _ALIKE * space.sizes.min()  # with a single centre the gauge is at the smallest cells
        on_lines = np.zeros_like(small)
        on_lines[lines] = True
        best = small & on_lines
        gauge = int((best if best.any() else small).argmax())
        seeds = [gauge]
        if len(frames.centres):
            gauge, order = int(frames.centres[0]), np.argsort(np.round(np.log2(space.sizes)), kind="stable")
            seeds = [*frames.centres.tolist(), *order[on_lines[order]].tolist()]
        place, last = np.full(len(lines), len(lines)), np.zeros(len(lines), dtype=bool)
        if len(frames.origins):
            last = frames.across(_edges_of(space, numbers))
        place[~last], age = walk(lines[~last], seeds, len(space.vertices))
        age[frames.centres] = 0  # the last choice among pivots
        return place[numbers.searchsorted(number)].argsort(kind="stable"), age, gauge

    @cached_property
    def elimination(self) -> Elimination:
        """The rows C u = d, solved; before them come three rows that fix the gauge."""
        space, (order, age, gauge) = self.space, self._walk
        C, width = self._conditions.C.take(order), self._conditions.C.columns.shape[1]
        at_gauge = np.array([3 * gauge + np.arange(width)] * 3)
        values = np.concatenate([np.eye(3, width)[:, None], C.values])
        C = Functionals(np.concatenate([at_gauge, C.columns]), values, space.size)
        on_edges = np.repeat(age[space.mesh.topology.ends].max(axis=1), space.element.on_edge)
        of_holes = np.zeros(3 * len(space.frames.cuts), dtype=np.int64)
        return Elimination.of(C, np.concatenate([np.repeat(age, 3), on_edges, of_holes]))


def _edges_of(space: StressSpace, numbers: IntArray) -> Edges:
    """Edges of the boundary by their numbers in `mesh.topology`."""
    return space.mesh.boundary.take(space.mesh.topology.outer.searchsorted(numbers))


@dataclass(frozen=True, eq=False)
class Basis:
    """B of u = B z: a degree of freedom is an unknown, depends on unknowns, or is zero."""

    size: int  # number N of degrees of freedom
    kept: IntArray  # (n,): degrees of freedom that are unknowns; z are their values
    following: IntArray  # (f,): degrees of freedom that depend on unknowns
    factors: Any  # F (f, n): u[following] = F z; dense if small, else sparse

    @classmethod
    def of(cls, solved: dict[int, dict[int, float]], size: int) -> Basis:
        """The basis from pivots with their terms {kept degree of freedom: factor}; no terms means zero."""
        is_kept = np.ones(size, dtype=bool)
        is_kept[list(solved)] = False
        kept, parts = is_kept.nonzero()[0], {pivot: terms for pivot, terms in solved.items() if terms}
        entries = [(row, *term) for row, terms in enumerate(parts.values()) for term in terms.items()]
        rows, columns, factors = np.array(entries).reshape(-1, 3).T
        at = rows.astype(np.int64), np.searchsorted(kept, columns)
        shape = len(parts), len(kept)
        if are_few(*shape):
            matrix: Any = np.zeros(shape)
            matrix[at] = factors
        else:
            matrix = sparse.csr_array((factors, at), shape)
        read_only(matrix)
        return cls(size, kept, np.array(list(parts), dtype=np.int64), matrix)

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """B (N, n)."""
        factors, n = sparse.coo_array(self.factors), len(self.kept)
        at = np.append(self.kept, self.following[factors.row]), np.append(np.arange(n), factors.col)
        matrix = sparse.csr_array((np.append(np.ones(n), factors.data), at), shape=(self.size, n))
        read_only(matrix)
        return matrix

    def expanded(self, z: FloatArray) -> FloatArray:
        """B z (N,)."""
        u = np.zeros(self.size)
        u[self.kept], u[self.following] = z, self.factors @ z
        return u

    def magnitudes(self, z: FloatArray) -> FloatArray:
        """|B| |z| (N,)."""
        return replace(self, factors=abs(self.factors)).expanded(np.abs(z))

    def reduced(self, functional: FloatArray) -> FloatArray:
        """The functional of z (n,) that equals a linear functional (N,) of u: Bᵀ times it."""
        return np.asarray(functional[self.kept] + self.factors.T @ functional[self.following])

    def rows(self, given: Functionals) -> Any:
        """Functionals of u as rows on z (m, n), dense if small, else sparse."""
        n, r = given.values.shape[:2]
        if not are_few(n * r, len(self.kept)):
            return given.matrix() @ self.matrix
        places = self.size * np.arange(n * r).reshape(n, r, 1) + given.columns[:, None]
        on_u = np.bincount(places.ravel(), given.values.ravel(), n * r * self.size).astype(np.float64, copy=False)
        on_u = on_u.reshape(n * r, self.size)
        return on_u[:, self.kept] + on_u[:, self.following] @ self.factors

    def quadratic(self, blocks: FloatArray, dofs: IntArray) -> Any:
        """Σ Bᵀ K B (n, n) of element matrices K (t, k, k) on degrees of freedom (t, k); dense if small, else sparse.

        With n for unknowns and f for the degrees of freedom u_f = F z it is K_nn + H + Hᵀ, H = Fᵀ (K_fn + K_ff F/2).
        """
        F: Any = self.factors
        f, n = F.shape
        # numbers of the degrees of freedom: first the unknowns, then u_f, then one number for all that are zero
        number, size = np.full(self.size, n + f), n + f + 1
        number[self.kept], number[self.following] = np.arange(n), np.arange(n, n + f)
        at = number[dofs]
        if not are_few(n, n):
            at = at.astype(np.int32 if size < np.iinfo(np.int32).max else np.int64)  # that SciPy does not copy
            pairs = np.repeat(at, at.shape[1], axis=1).ravel(), np.tile(at, at.shape[1]).ravel()
            full: Any = sparse.coo_array((blocks.ravel(), pairs), shape=(size, size)).tocsr()
            rows, F = full[n:-1], sparse.csr_array(F)
            H = F.T @ (rows[:, :n] + rows[:, n:-1] @ F / 2.0)
            return (full[:n, :n] + (H + H.T)).T  # by columns, as K is symmetric
        places = (size * at[:, :, None] + at[:, None]).ravel()
        full = np.bincount(places, blocks.ravel(), size**2).astype(np.float64, copy=False)
        full = full.reshape(size, size)  # cast above, as bincount of no entries is of integers
        F, rows = F if isinstance(F, np.ndarray) else F.toarray(), full[n:-1]
        K, in_use = full[:n, :n].copy(), F.any(axis=0).nonzero()[0]  # the other rows of H are zero
        H = F[:, in_use].T @ (rows[:, :n] + rows[:, n:-1] @ F / 2.0)
        H[:, in_use] = (H[:, in_use] + H[:, in_use].T) / 2.0  # so that K is symmetric to the last bit
        K[in_use] += H
        K[:, in_use] += H.T
        return K


@dataclass(frozen=True, eq=False)
class Elimination:
    """The solutions u = B z + u₀ of C u = d: each independent row is solved for one degree of freedom, its pivot."""

    C: Functionals  # m groups of one row
    rows: IntArray  # (r,): the independent rows in the order of elimination
    pivots: IntArray  # (r,): the pivot of each
    basis: Basis

    @classmethod
    def of(cls, C: Functionals, age: IntArray, least: float = _DEPENDENT) -> Elimination:
        """Solve the rows of C one after the other. Degrees of freedom are in units that make entries comparable.

        The pivot of a row is the degree of freedom of the largest `age` (N,) among large entries; at equal age, of the
        largest entry. A row depends on earlier rows if the reduction leaves no entry above `least` times its largest.
        """
        all_values, ages = C.values[:, 0], age.tolist()
        # rows with one entry set a degree of freedom to a given value: they come first, the first row of each
        single = ((all_values != 0.0).sum(axis=1) == 1).nonzero()[0]
        given = C.columns[single, np.abs(all_values[single]).argmax(axis=1)]
        row_of = dict(zip(reversed(given.tolist()), reversed(single.tolist()), strict=True))
        rows, solved = list(row_of.values()), {pivot: dict[int, float]() for pivot in row_of}
        # each other row: replace all pivots so far, then solve it for a pivot, u_pivot = Σ factor u
        is_other = np.ones(len(all_values), dtype=bool)
        is_other[rows] = False
        others = is_other.nonzero()[0]
        largest = np.abs(all_values[others]).max(axis=1, initial=0.0).tolist()
        parts = (part.tolist() for part in (others, C.columns[others], all_values[others]))
        for before, row, columns, values in zip(largest, *parts, strict=True):
            terms = _reduced([pair for pair in zip(columns, values, strict=True) if pair[1] != 0.0], solved)
            sizes = list(map(abs, terms.values()))
            after = max(sizes, default=0.0)
            if after <= least * before:
                continue
            sized = zip(terms, sizes, strict=True)
            pivot = -max([(ages[column], size, -column) for column, size in sized if size >= _WORTHY * after])[2]
            factor = -1.0 / terms.pop(pivot)
            solved[pivot] = {column: factor * value for column, value in terms.items()}
            rows.append(row)
        # terms may contain later pivots: replace these, the last pivot first, until only unknowns remain
        for pivot in reversed(solved):
            if not solved.keys().isdisjoint(solved[pivot]):
                solved[pivot] = _reduced(solved[pivot].items(), solved)
        pivots = np.array(list(solved), dtype=np.int64)
        return cls(C, np.array(rows, dtype=np.int64), pivots, Basis.of(solved, len(age)))

    def particular(self, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """u₀ (N,), zero at the unknowns, and the residuals d − C u₀ of the dependent rows, in ascending order."""
        u = np.zeros(self.C.size)
        if d.any():
            u[self.pivots] = self._factor.solve(d[self.rows])
        dependent = np.setdiff1d(np.arange(len(d)), self.rows)
        return u, d[dependent] - self.C.take(dependent).apply(u)[:, 0]

    @cached_property
    def _factor(self) -> Any:
        """LU of the independent rows, columns of their pivots, in the order of elimination."""
        matrix = self.C.take(self.rows).matrix()[:, self.pivots]
        return splu(matrix.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)


def _reduced(terms: Iterable[tuple[int, float]], solved: dict[int, dict[int, float]]) -> dict[int, float]:
    """The sum Σ factor u, with each solved degree of freedom replaced by its own sum, until all are free."""
    result, pending = dict[int, float](), list(terms)
    for column, factor in pending:  # the list grows in the loop
        if column in solved:
            pending += [(other, factor * value) for other, value in solved[column].items()]
        elif column in result:
            result[column] += factor
        else:
            result[column] = factor
    return result if all(result.values()) else {column: factor for column, factor in result.items() if factor != 0.0}


def walk(ends: IntArray, start: Sequence[int], vertices: int) -> tuple[IntArray, IntArray]:
    """An order of edges (n, 2), in which each edge shares, where possible, just one vertex with the edges before it.

    The walk begins at the vertices `start`. Lines without such a vertex begin at their end of lowest number, closed
    lines at their vertex of lowest number. Returned are the place (n,) of each edge in the order, from 0, and the age
    of each vertex, from 1 for the first that is met, increasing; 0 for vertices that no edge has.
    """
    at: dict[int, list[int]] = {}
    pairs = ends.tolist()
    for edge, pair in enumerate(pairs):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    place, age, step, met = [-1] * len(ends), [0] * vertices, 0, 0  # lists are faster than arrays here
    line_ends = sorted(vertex for vertex, edges in at.items() if len(edges) == 1)
    for seed in (*start, *line_ends, *sorted(at)):
        pending = [seed] if seed in at and not age[seed] else []
        while pending:
            vertex = pending.pop()
            if not age[vertex]:
                met += 1
                age[vertex] = met
            ahead = next((edge for edge in at[vertex] if place[edge] < 0), None)
            if ahead is not None:
                place[ahead] = step
                step += 1
                pending += [vertex, sum(pairs[ahead]) - vertex]  # depth first: the other end of the edge comes next
    return np.array(place, dtype=np.int64), np.array(age, dtype=np.int64)
