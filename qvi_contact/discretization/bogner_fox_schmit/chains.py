"""Exact elimination of the traction conditions and of the affine gauge, along chains of nodes.

With s the arc length counterclockwise around the body, the traction is t_x = d(Φ_y)/ds, t_y = −d(Φ_x)/ds (body forces
aside). A prescribed Cartesian component of the traction on an edge therefore

* links the values of one slope (Φ_y for t_x, Φ_x for t_y) at its two nodes by the edge's resultant force,
* if it is the normal component, also links the two values of Φ by the edge's moment,
* if it is the shear component, prescribes Φ_xy at both nodes.

Linked values form chains. Each chain has one free value, its root; what is left are a few equations between roots:
closed loops of Γ_σ, which state the balance of loads, and the gauge Φ = Φ_x = Φ_y = 0 at one node.

In `docs/theory.md`: (D2).
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.elimination import Elimination, UnbalancedLoadError

_VALUE, _SLOPE_X, _SLOPE_Y, _TWIST = range(4)


@dataclass(frozen=True)
class Links:
    """Equations that prescribed tractions impose on the nodal values of Φ, dimensionless and unscaled.

    Attributes
    ----------
    slope_first, slope_second : (m,) int arrays
        Degrees of freedom (global number, see `Grid.cell_dofs`) with u[second] − u[first] = slope_jump.
    slope_jump : (m,) array
        The jumps: resultant forces.
    value_first, value_second : (k,) int arrays
        Nodes with Φ[second] − Φ[first] − length · slope[first] = value_jump, slope taken along the edge.
    value_slope : (k,) int array
        The degree of freedom that is the slope at the first node.
    value_length, value_jump : (k,) arrays
        Edge lengths and jumps: moments.
    twist_node, twist : (t,) arrays
        Nodes with prescribed Φ_xy, and the values; a node may occur several times.

    """

    slope_first: IntArray
    slope_second: IntArray
    slope_jump: FloatArray
    value_first: IntArray
    value_second: IntArray
    value_slope: IntArray
    value_length: FloatArray
    value_jump: FloatArray
    twist_node: IntArray
    twist: FloatArray


@dataclass(frozen=True)
class _Chains:
    """u = offset + coefficients @ roots for all linked degrees of freedom."""

    dofs: IntArray
    offset: FloatArray
    coefficients: FloatArray  # (dofs, roots)
    roots: IntArray  # global numbers
    equations: FloatArray  # (e, roots): what closed loops demand of the roots
    right: FloatArray  # (e,)

    def sizes(self) -> IntArray:
        """How many degrees of freedom depend on each root."""
        return np.asarray(np.count_nonzero(self.coefficients, axis=0))


def eliminate(
    links: Links, scales: FloatArray, body: BoolArray, freed: IntArray | None = None, tolerance: float = 1e-9
) -> Elimination:
    """Turn the traction conditions and the gauge into a basis.

    Parameters
    ----------
    links : Links
        The traction conditions.
    scales : (N,) array
        Stored value of a degree of freedom over its unscaled one.
    body : (nodes,) bool array
        Nodes that belong to the body.
    freed : int array, optional
        Nodes whose Φ_xy stays free although it is prescribed, like that of corners where edges disagree.
    tolerance : float
        Imbalance of a closed part of Γ_σ, and shear conflict in a corner, that pass as round-off; relative to the
        largest of the prescribed values.

    Raises
    ------
    UnbalancedLoadError
        If resultant force or moment of a closed traction boundary do not vanish.

    """
    loads = (links.slope_jump, links.value_jump, links.twist)
    tolerance *= max(float(np.abs(load).max(initial=0.0)) for load in loads)
    chains = _chains(links)
    freed = np.empty(0, dtype=np.int64) if freed is None else freed
    twist_dofs, twist, conflicts = _twists(links, freed, tolerance)
    gauge = _gauge_dofs(chains, body)
    chained = np.isin(chains.dofs, gauge)
    equations = np.vstack([chains.equations, chains.coefficients[chained]])
    right = np.concatenate([chains.right, -chains.offset[chained]])
    expand, shift, free = _solve_roots(equations, right, chains.sizes(), tolerance)

    unchained_gauge = np.setdiff1d(gauge, chains.dofs)
    kept = np.repeat(body, 4)
    kept[np.concatenate([unchained_gauge, twist_dofs, chains.dofs])] = False
    root_dofs = chains.roots[free]
    kept[root_dofs] = True

    dependent = ~kept[chains.dofs]
    slaves = np.concatenate([chains.dofs[dependent], twist_dofs, unchained_gauge])
    particular = np.zeros(len(kept))
    particular[chains.dofs] = chains.offset + chains.coefficients @ shift
    particular[kept] = 0.0
    particular[twist_dofs] = twist
    coefficients = chains.coefficients[dependent] @ expand
    rows, columns = np.nonzero(coefficients)
    data = coefficients[rows, columns] * scales[slaves[rows]] / scales[root_dofs[columns]]
    number = np.cumsum(kept) - 1
    basis = sparse.csr_array((data, (rows, number[root_dofs[columns]])), shape=(len(slaves), int(kept.sum())))
    return Elimination(kept, slaves, basis, particular * scales, conflicts)


def _chains(links: Links) -> _Chains:
    """Follow the slope links, then the value links, whose jumps contain the slopes' roots."""
    slopes = np.unique(np.concatenate([links.slope_first, links.slope_second, links.value_slope]))
    ends = np.searchsorted(slopes, links.slope_first), np.searchsorted(slopes, links.slope_second)
    slope_offset, root, force_loops = _potentials(len(slopes), *ends, links.slope_jump[:, None])
    slope_roots, slope_class = np.unique(root, return_inverse=True)

    # Φ[second] − Φ[first] = jump + length (offset + root of the slope): columns (constant, slope roots).
    at = np.searchsorted(slopes, links.value_slope)
    jumps = np.zeros((len(at), 1 + len(slope_roots)))
    jumps[:, 0] = links.value_jump + links.value_length * slope_offset[at, 0]
    jumps[np.arange(len(at)), 1 + slope_class[at]] = links.value_length
    nodes = np.unique(np.concatenate([links.value_first, links.value_second]))
    ends = np.searchsorted(nodes, links.value_first), np.searchsorted(nodes, links.value_second)
    values, root, value_loops = _potentials(len(nodes), *ends, jumps)
    value_roots, value_class = np.unique(root, return_inverse=True)

    split, count = len(slopes), len(slope_roots)
    coefficients = np.zeros((split + len(nodes), count + len(value_roots)))
    coefficients[np.arange(split), slope_class] = 1.0
    coefficients[split:, :count] = values[:, 1:]
    coefficients[split + np.arange(len(nodes)), count + value_class] = 1.0
    equations = np.zeros((len(force_loops) + len(value_loops), count + len(value_roots)))
    equations[len(force_loops) :, :count] = value_loops[:, 1:]
    return _Chains(
        dofs=np.concatenate([slopes, 4 * nodes]),
        offset=np.concatenate([slope_offset[:, 0], values[:, 0]]),
        coefficients=coefficients,
        roots=np.concatenate([slopes[slope_roots], 4 * nodes[value_roots]]),
        equations=equations,
        right=-np.concatenate([force_loops[:, 0], value_loops[:, 0]]),
    )


def _potentials(
    count: int, first: IntArray, second: IntArray, jumps: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Sum vector-valued jumps along the trees of a graph whose edge e demands u[second] − u[first] = jumps[e].

    Returns
    -------
    values : (count, k) array
        u, zero at the root of each tree.
    root : (count,) int array
        The root of each vertex: the vertex of smallest number in its tree.
    loops : (l, k) array
        Sum of jumps around the loop that each edge outside the trees closes; zero if the jumps are consistent.

    """
    data, ends = np.ones(2 * len(first)), (np.r_[first, second], np.r_[second, first])
    graph = sparse.csr_array((data, ends), shape=(count, count))
    edge_of = {pair: e for e, pair in enumerate(zip(first.tolist(), second.tolist(), strict=True))}
    values = np.zeros((count, jumps.shape[1]))
    root = np.full(count, -1)
    in_tree = np.zeros(len(first), dtype=bool)
    for start in range(count):
        if root[start] >= 0:
            continue
        order, parent = csgraph.breadth_first_order(graph, start, directed=False)
        root[order] = start
        for vertex in order[1:].tolist():
            before = int(parent[vertex])
            forward = edge_of.get((before, vertex))
            edge = edge_of[vertex, before] if forward is None else forward
            in_tree[edge] = True
            values[vertex] = values[before] + (jumps[edge] if forward is not None else -jumps[edge])
    rest = ~in_tree
    return values, root, jumps[rest] + values[first[rest]] - values[second[rest]]


def _twists(links: Links, freed: IntArray, tolerance: float) -> tuple[IntArray, FloatArray, IntArray]:
    """Degrees of freedom Φ_xy that are prescribed, their values, and the corner nodes where edges disagree."""
    nodes, which = np.unique(links.twist_node, return_inverse=True)
    low, high = np.full(len(nodes), np.inf), np.full(len(nodes), -np.inf)
    np.minimum.at(low, which, links.twist)
    np.maximum.at(high, which, links.twist)
    agree = high - low <= tolerance
    kept = agree & ~np.isin(nodes, freed)
    return 4 * nodes[kept] + _TWIST, ((low + high) / 2.0)[kept], nodes[~agree]


def _gauge_dofs(chains: _Chains, body: BoolArray) -> IntArray:
    """Φ, Φ_x, Φ_y at the node whose chains are longest: fixing them there removes the densest columns."""
    score = np.where(body, 0, -1)
    if len(chains.dofs):
        own = np.argmax(chains.coefficients[:, ::-1] != 0.0, axis=1)  # the last root of a row is its own
        np.add.at(score, chains.dofs // 4, chains.sizes()[::-1][own])
    return 4 * int(np.argmax(score)) + np.array([_VALUE, _SLOPE_X, _SLOPE_Y])


def _solve_roots(
    equations: FloatArray, right: FloatArray, sizes: IntArray, tolerance: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Gauss-Jordan elimination of the few equations between roots, longest chains first.

    Returns
    -------
    expand : (roots, f) array, shift : (roots,) array, free : (f,) int array
        roots = expand @ roots[free] + shift.

    """
    system = np.column_stack([equations, right])
    pivots: list[int] = []
    for column in np.argsort(-sizes, kind="stable").tolist():
        done = len(pivots)
        if done == len(system):
            break
        row = done + int(np.argmax(np.abs(system[done:, column])))
        if abs(system[row, column]) <= 1e-12:
            continue
        system[[done, row]] = system[[row, done]]
        system[done] /= system[done, column]
        others = np.arange(len(system)) != done
        system[others] -= np.outer(system[others, column], system[done])
        pivots.append(column)
    imbalance = float(np.abs(system[len(pivots) :, -1]).max(initial=0.0))
    if imbalance > tolerance:
        raise UnbalancedLoadError(imbalance)
    free = np.setdiff1d(np.arange(len(sizes)), pivots)
    expand = np.zeros((len(sizes), len(free)))
    expand[free, np.arange(len(free))] = 1.0
    expand[pivots] = -system[: len(pivots)][:, free]
    shift = np.zeros(len(sizes))
    shift[pivots] = system[: len(pivots), -1]
    return expand, shift, free
