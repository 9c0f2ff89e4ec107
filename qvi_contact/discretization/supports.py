"""Supports of a body: prescribed tractions as conditions on Φ, eliminated in an order that keeps their solution sparse.

On an edge of length h from a to b with tangent t and m = (−t_y, t_x), coefficients of Legendre N_k of Φ_tt and Q_k of
Φ_tm mean

    ∇Φ_b − ∇Φ_a = h (N₀ t + Q₀ m),   Φ_b − Φ_a − h t·(∇Φ_a + ∇Φ_b)/2 = −h² N₁/6

for the corners, resultant force and moment of the edge, and prescribe its other coefficients themselves. Where only
one component d·σn is given, σ_N = Φ_tt and σ_T = −(n·m) Φ_tm are combined. Since σ_T may jump at vertices, corners
where two edges meet need no care.

These are rows C u = d. C and the basis B of the solutions u = B z + u₀(d) depend on where which components are given,
not on their values: loads differ in d.

Conditions are solved one row after the other. Each row is written in the degrees of freedom that are still free, one of
them, its pivot, is solved for, and so on. How many others the pivots depend on is a matter of the order of rows: along
a line of edges, each one step further, every row brings degrees of freedom of its own and is solved for one of them.
Rows that nothing is left of show whether d is consistent.

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

_POINTS: Final = 6  # Gauss points beside the degree of Φ, of edges and their parts for data given as functions
_PARALLEL: Final = 1e-12  # component of a unit vector that counts as none
_ALIKE: Final = 1.5  # ratio of cells' sizes at vertices that counts as none when the gauge is placed
_BALANCED: Final = 1e-9  # imbalance of a closed part of the boundary, relative to the loads, that passes as round-off
_DEPENDENT: Final = 1e-9  # what is left of a row, relative to its largest entry, below which it follows from the others
_WORTHY: Final = 1e-2  # an entry, relative to the largest, that makes a good pivot


class _Conditions(NamedTuple):
    """Rows C u = d, scaled so that d are forces, moments and degrees of freedom, dimensionless."""

    C: Functionals
    number: IntArray  # (r,): the edge that each belongs to
    # d (r,) of what Φ has to make up for each of the components, and which of them are forces and moments
    data: Callable[[Sequence[EdgeQuadrature]], tuple[FloatArray, BoolArray]]


@dataclass(frozen=True, eq=False)
class Supports(PicklesFields):
    """All degrees of freedom that meet prescribed tractions, u = B z + u₀, with one affine function fixed.

    Data in the trace space are met exactly; of others each edge keeps the resultant force and moment. The affine
    function (the gauge) is zero at the first centre. Lines begin there, or where cells are small, so that degrees of
    freedom there do not follow from large ones far away; edges across parts of several centres come last and tie these,
    and edges across the cut of a hole, whose jump nothing but these determines.
    """

    space: StressSpace
    # where components of tractions are prescribed, but not their values: edges by number (k,), twice where two are
    # given, along which directions (k, 2), and whether these turn along arcs (k,), see `Prescribed`
    number: IntArray
    direction: FloatArray
    turns: BoolArray

    @classmethod
    def on(cls, space: StressSpace, given: Sequence[Prescribed], kept: Kept) -> Supports:
        """Those of a space for such components, made once."""
        parts = [(part.edges.number, part.direction, part.turns and part.edges.curved) for part in given]

        def made() -> Supports:
            number = np.concatenate([np.empty(0, np.int64), *(part[0] for part in parts)])
            direction = np.concatenate([np.empty((0, 2)), *(part[1] for part in parts)])
            turns = np.concatenate([np.empty(0, bool), *(np.full(len(part[0]), part[2]) for part in parts)])
            return cls(space, number, direction, turns)

        return kept(cls, (space, *((part[0].tobytes(), part[1].tobytes(), part[2]) for part in parts)), made)

    @property
    def basis(self) -> Basis:
        """B."""
        return self.elimination.basis

    @property
    def points(self) -> int:
        """Gauss points of edges, and of their parts, at which `particular` wants values."""
        return self.space.degree + _POINTS

    def particular(self, given: Sequence[EdgeQuadrature]) -> tuple[FloatArray, float]:
        """The u₀ (N,), zero for unknowns, and the force (or moment over the length) out of balance.

        Of what Φ has to make up of each component, see `loads.traction_data`; none if that is nothing.
        """
        if not any(part.values.any() for part in given):
            return np.zeros(self.space.size), 0.0
        d, is_load = self._conditions.data(given)
        largest = float(np.abs(d[is_load]).max(initial=0.0))
        u, misfit = self.elimination.particular(np.concatenate([np.zeros(3), d[self._walk[0]]]))
        imbalance = float(np.abs(misfit).max(initial=0.0))
        return u, imbalance if imbalance > _BALANCED * largest else 0.0

    def missed(self, u: FloatArray, given: Sequence[EdgeQuadrature]) -> float:
        """Sum of the forces, and moments over the length, of such data that degrees of freedom u (N,) miss by edges."""
        d, is_load = self._conditions.data(given)
        return float(np.abs(self._conditions.C.apply(u)[:, 0] - d)[is_load].sum())

    @cached_property
    def _conditions(self) -> _Conditions:
        """Whole traction vectors on edges where two components are given, else one component.

        A vector is 2p − 2 rows: force and moment of the data, and their other coefficients of Legendre. A component
        d·σn = (d·n) σ_N + (d·t) σ_T is p − 1 rows, its coefficients in the mean square.
        """
        space, degree = self.space, self.space.degree - 2
        number, direction, turns = self.number, self.direction, self.turns
        order = np.argsort(number, kind="stable")
        twice = (number[order][1:] == number[order][:-1]).nonzero()[0]
        one, other = order[twice], order[twice + 1]
        alone_there = np.ones(len(order), dtype=bool)
        alone_there[twice] = alone_there[twice + 1] = False
        single = order[alone_there]
        both, alone = _edges_of(space, number[one]), _edges_of(space, number[single])
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
                arcs, bent, t = alone.take(alone.bent), single[alone.bent], gauss_legendre(self.points)[0]
                d = vectors_along(arcs, direction[bent], t, turns=turns[bent])
                along = (d * vectors_along(arcs, axis[alone.bent], t)).sum(axis=2)
                along[np.abs(along) <= _PARALLEL] = 0.0
                matrices = legendre_from_values(degree, len(t)) @ (along[:, :, None] * legendre_basis(degree, t))
                part[alone.bent] = (matrices * scale[alone.bent, :, None]) @ traces.values[alone.bent, half]
            combined += part

        def data(given: Sequence[EdgeQuadrature]) -> tuple[FloatArray, BoolArray]:
            found, norms = EdgeQuadrature.joined(given), 2.0 * np.arange(degree + 1) + 1.0
            edges = _edges_of(space, number)  # as often as components are given there
            edge, t, chosen, factor = found.edge, found.t, edges.take(found.edge), frame(edges)[1][:, None, None]
            # what the other component has no part in: where there is none, the direction itself
            against, against_turns = np.column_stack([direction[:, 1], -direction[:, 0]]), turns.copy()
            against[one], against[other] = direction[other], direction[one]
            against_turns[one], against_turns[other] = turns[other], turns[one]
            own = vectors_along(chosen, direction[edge], t, turns=turns[edge])
            dual = vectors_along(chosen, against[edge], t, turns=against_turns[edge])
            dual = np.stack([-dual[..., 1], dual[..., 0]], axis=-1)  # at right angles to the other component
            dual /= (dual * own).sum(axis=-1, keepdims=True)
            normal, tangent = frames_along(chosen, t)
            N, Q = (dual * normal).sum(axis=-1)[..., None], factor[edge] * (dual * tangent).sum(axis=-1)[..., None]
            shapes, scaled = resultant_shapes(chosen.bend, t), legendre_basis(degree, t) * norms
            resultants = N * shapes[..., 0] + Q * shapes[..., 1]
            of_data = found.integrals(np.concatenate([resultants, N * scaled[..., 2:], Q * scaled[..., 1:]], axis=-1))
            vectors, lengths = of_data[one] + of_data[other], space.lengths(both)[:, None]
            vectors[:, :2] = lengths * (vectors[:, :1] * both.tangent + vectors[:, 1:2] * frame(both)[0])
            vectors[:, 2:3] *= lengths**2
            d = np.concatenate([vectors.ravel(), (found.coefficients(degree)[single] * scale).ravel()])
            loads = np.tile(of_both < 3, len(one)), np.tile(of_alone < 2, len(single))
            return d, np.concatenate(loads)

        rows = [space.resultants(both).rows(), Functionals(traces.columns, combined, space.size).rows()]
        columns, entries = np.concatenate([r.columns for r in rows]), np.concatenate([r.values for r in rows])
        of_both, of_alone = np.arange(2 * degree + 2), np.arange(degree + 1)
        numbers = np.concatenate([np.repeat(number[one], len(of_both)), np.repeat(number[single], len(of_alone))])
        return _Conditions(Functionals(columns, entries, space.size), numbers, data)

    @cached_property
    def _walk(self) -> tuple[IntArray, IntArray, int]:
        """The order of the rows, when each vertex is met on the way, and the vertex of the gauge."""
        space, number = self.space, self._conditions.number
        numbers = np.bincount(number).nonzero()[0]
        frames, lines = space.frames, space.mesh.topology.ends[numbers]
        small = space.sizes <= _ALIKE * space.sizes.min()  # without several centres, where cells are smallest
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
        age[frames.centres] = 0  # which are solved for where nothing else is left
        return place[numbers.searchsorted(number)].argsort(kind="stable"), age, gauge

    @cached_property
    def elimination(self) -> Elimination:
        """The rows, solved."""
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
    """B of u = B z: degrees of freedom are unknowns, follow from these, or vanish."""

    size: int  # degrees of freedom N
    kept: IntArray  # (n,): degrees of freedom that are unknowns; z are their values
    following: IntArray  # (f,): those that follow
    factors: Any  # (f, n): by which, dense if few, else sparse

    @classmethod
    def of(cls, solved: dict[int, dict[int, float]], size: int) -> Basis:
        """With pivots solved for, as Σ factor u of kept degrees of freedom."""
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
        found = sparse.csr_array((np.append(np.ones(n), factors.data), at), shape=(self.size, n))
        read_only(found)
        return found

    def expanded(self, z: FloatArray) -> FloatArray:
        """B z (N,)."""
        found = np.zeros(self.size)
        found[self.kept], found[self.following] = z, self.factors @ z
        return found

    def magnitudes(self, z: FloatArray) -> FloatArray:
        """|B| |z| (N,)."""
        return replace(self, factors=abs(self.factors)).expanded(np.abs(z))

    def reduced(self, functional: FloatArray) -> FloatArray:
        """A functional (N,) of u as one of z, (n,)."""
        return np.asarray(functional[self.kept] + self.factors.T @ functional[self.following])

    def rows(self, given: Functionals) -> Any:
        """Functionals of u as rows on z (m, n), dense where they are few, else sparse."""
        n, r = given.values.shape[:2]
        if not are_few(n * r, len(self.kept)):
            return given.matrix() @ self.matrix
        places = self.size * np.arange(n * r).reshape(n, r, 1) + given.columns[:, None]
        whole = np.bincount(places.ravel(), given.values.ravel(), n * r * self.size).astype(np.float64, copy=False)
        whole = whole.reshape(n * r, self.size)
        return whole[:, self.kept] + whole[:, self.following] @ self.factors

    def quadratic(self, blocks: FloatArray, dofs: IntArray) -> Any:
        """Σ Bᵀ K B (n, n) of matrices K (t, k, k) of the degrees of freedom (t, k), dense if few, else sparse.

        That is K on what is kept, and H + Hᵀ with H = Fᵀ (K_fn + K_ff F/2) for the factors F of what follows.
        """
        n, f, factors = len(self.kept), len(self.following), self.factors
        number, size = np.full(self.size, n + f), n + f + 1  # of what is kept, of what follows; last what vanishes
        number[self.kept], number[self.following] = np.arange(n), np.arange(n, n + f)
        at, few = number[dofs], are_few(n, n)
        if few:
            places = (size * at[:, :, None] + at[:, None]).ravel()
            full: Any = np.bincount(places, blocks.ravel(), size**2).astype(np.float64, copy=False)
            full = full.reshape(size, size)  # NumPy counts in integers where there is nothing
            factors = factors if isinstance(factors, np.ndarray) else factors.toarray()  # many follow from few
        else:
            at = at.astype(np.int32 if size < np.iinfo(np.int32).max else np.int64)  # others SciPy copies
            pairs = np.repeat(at, at.shape[1], axis=1).ravel(), np.tile(at, at.shape[1]).ravel()
            full = sparse.coo_array((blocks.ravel(), pairs), shape=(size, size)).tocsr()
            factors = sparse.csr_array(factors)
        rows = full[n:-1]
        right = rows[:, :n] + rows[:, n:-1] @ factors / 2.0
        if few:
            K, led = full[:n, :n].copy(), factors.any(axis=0).nonzero()[0]  # what others follow from: all rows of H
            half = factors[:, led].T @ right
            half[:, led] = (half[:, led] + half[:, led].T) / 2.0  # so that K is symmetric to the last bit
            K[led] += half
            K[:, led] += half.T
            return K
        half = factors.T @ right
        own, half = (sparse.coo_array(each) for each in (full[:n, :n], half))
        pairs = np.concatenate([own.row, half.row, half.col]), np.concatenate([own.col, half.col, half.row])
        return sparse.coo_array((np.concatenate([own.data, half.data, half.data]), pairs), shape=(n, n)).tocsc()


@dataclass(frozen=True, eq=False)
class Elimination:
    """The solutions u = B z + u₀ of C u = d, by as many degrees of freedom as there are independent rows."""

    C: Functionals  # one by one, (m, 1)
    # (r,): independent rows in the order in which they were taken, and the degree of freedom that each is solved
    # for
    rows: IntArray
    pivots: IntArray
    basis: Basis

    @classmethod
    def of(cls, C: Functionals, age: IntArray, least: float = _DEPENDENT) -> Elimination:
        """Solve rows (m, N) one after the other, in units of degrees of freedom that make entries comparable.

        Of the possible pivots of a row those of the largest age (N,) are preferred, of these the largest entry. What is
        left of a row, relative to its largest entry, is nothing if it is `least`.
        """
        all_values, ages = C.values[:, 0], age.tolist()
        alone = ((all_values != 0.0).sum(axis=1) == 1).nonzero()[0]  # rows that prescribe one degree of freedom itself
        fixed = C.columns[alone, np.abs(all_values[alone]).argmax(axis=1)]
        first = dict(zip(reversed(fixed.tolist()), reversed(alone.tolist()), strict=True))  # of those of one pivot
        taken, solved = list(first.values()), {pivot: dict[int, float]() for pivot in first}
        rest = np.ones(len(all_values), dtype=bool)
        rest[taken] = False
        others = rest.nonzero()[0]
        largest = np.abs(all_values[others]).max(axis=1, initial=0.0).tolist()
        parts = (part.tolist() for part in (others, C.columns[others], all_values[others]))
        for most, row, columns, values in zip(largest, *parts, strict=True):
            terms = _reduced([pair for pair in zip(columns, values, strict=True) if pair[1] != 0.0], solved)
            sizes = list(map(abs, terms.values()))
            left = max(sizes, default=0.0)
            if left <= least * most:
                continue
            sized = zip(terms, sizes, strict=True)
            pivot = -max([(ages[column], size, -column) for column, size in sized if size >= _WORTHY * left])[2]
            factor = -1.0 / terms.pop(pivot)
            solved[pivot] = {column: factor * value for column, value in terms.items()}
            taken.append(row)
        for pivot in reversed(solved):  # the latest depend on kept ones only, earlier ones perhaps on them
            if not solved.keys().isdisjoint(solved[pivot]):
                solved[pivot] = _reduced(solved[pivot].items(), solved)
        pivots = np.array(list(solved), dtype=np.int64)
        return cls(C, np.array(taken, dtype=np.int64), pivots, Basis.of(solved, len(age)))

    def particular(self, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """u₀ (N,), zero for unknowns, and what d (m,) misses in the rows that follow from the others."""
        u = np.zeros(self.C.size)
        if d.any():
            u[self.pivots] = self._factor.solve(d[self.rows])
        rest = np.setdiff1d(np.arange(len(d)), self.rows)
        return u, d[rest] - self.C.take(rest).apply(u)[:, 0]

    @cached_property
    def _factor(self) -> Any:
        """LU of the independent rows and their pivots, in the order in which they were found."""
        matrix = self.C.take(self.rows).matrix()[:, self.pivots]
        return splu(matrix.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0)


def _reduced(terms: Iterable[tuple[int, float]], solved: dict[int, dict[int, float]]) -> dict[int, float]:
    """Σ factor u with everything replaced that is solved for, until nothing is left to replace."""
    result, pending = dict[int, float](), list(terms)
    for column, factor in pending:  # which grows meanwhile
        if column in solved:
            pending += [(other, factor * value) for other, value in solved[column].items()]
        elif column in result:
            result[column] += factor
        else:
            result[column] = factor
    return result if all(result.values()) else {column: factor for column, factor in result.items() if factor != 0.0}


def walk(ends: IntArray, start: Sequence[int], vertices: int) -> tuple[IntArray, IntArray]:
    """An order of edges (n, 2) of so many vertices in which each one, if it can, meets those before it in one vertex.

    It begins at the vertices `start`; lines that hold none of them begin at their end of lowest number, closed ones at
    their vertex of lowest number. Returned are the place (n,) of each edge in the order, from 0, and the age of each
    vertex, from 1: the later it is met the larger; 0 where it is not.
    """
    at: dict[int, list[int]] = {}
    pairs = ends.tolist()
    for edge, pair in enumerate(pairs):
        for vertex in pair:
            at.setdefault(vertex, []).append(edge)
    place, age = np.full(len(ends), -1), np.zeros(vertices, dtype=np.int64)
    step, met = 0, 0
    line_ends = sorted(vertex for vertex, edges in at.items() if len(edges) == 1)
    for seed in (*start, *line_ends, *sorted(at)):
        waiting = [seed] if seed in at and not age[seed] else []
        while waiting:
            vertex = waiting.pop()
            if not age[vertex]:
                met += 1
                age[vertex] = met
            ahead = next((edge for edge in at[vertex] if place[edge] < 0), None)
            if ahead is not None:
                place[ahead] = step
                step += 1
                waiting += [vertex, sum(pairs[ahead]) - vertex]  # to the end of the line first
    return place, age
