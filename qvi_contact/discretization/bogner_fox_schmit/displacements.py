"""Gap and slip of a contact from its row multipliers, as far as the traces feel them.

The rows of (D2) at the four Gauss points of an edge depend linearly on each other, so single multipliers mean nothing;
what the stresses feel, and what is unique, is their effect on the traces: linear along each edge for σ_N, continuous
and quadratic along each for σ_T. Gap and slip are therefore the weighted L² projections of the pointwise multipliers on
these spaces.
"""

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.bogner_fox_schmit.traces import horizontal
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.element.hermite import gauss_legendre, nodal_quadratics
from qvi_contact.mesh.edges import edge_ends


def blind_nodes(contacts: Sequence[ContactRows], elimination: Elimination) -> IntArray:
    """Nodes where the trace σ_T does not see the tangential displacement of one contact line alone.

    That is where Φ_xy is prescribed, and in corners between contact lines, which share one Φ_xy.
    """
    prescribed = np.flatnonzero(~elimination.kept[3::4])
    lines = []
    for rows in contacts:
        edges = rows.points.edges
        flat = horizontal(edges)
        lines += [edge_ends(edges.take(chosen)) for chosen in (flat, ~flat) if chosen.any()]
    nodes, times = np.unique(np.concatenate([prescribed[:0], *lines]), return_counts=True)
    return np.union1d(prescribed, nodes[times > 1])


def project_normal(count: int, values: FloatArray) -> FloatArray:
    """L² projection on linear functions, edge by edge, of values at Gauss points."""
    t, weights = gauss_legendre(count)
    linear = np.column_stack([np.ones(count), np.sqrt(12.0) * (t - 0.5)])  # orthonormal on [0, 1]
    return np.asarray(values.reshape(-1, count) @ (weights[:, None] * linear) @ linear.T).ravel()


def project_tangential(rows: ContactRows, functional: FloatArray, fixed: IntArray) -> FloatArray:
    """λ_T of the trial space below whose action on the traces σ_T is that of the row multipliers `functional`.

    Traces and trial functions are continuous and quadratic on each edge (nodes and midpoints). Where σ_T is prescribed
    at an end node of the contact (Φ_xy fixed by the neighbouring traction), or another contact line ends in the same
    corner (and shares Φ_xy), no trace sees the displacement there; as in mortar methods the trial functions are then
    linear on that end edge, which keeps trial and test space of one size and extends the displacement to the end
    without a kink.
    """
    points = rows.points
    edges, t = points.edges, gauss_legendre(points.count)[0]
    # Lines that turn a corner within one contact are separate: the tangent changes there.
    ends = 2 * np.concatenate([edges.first, edges.second]) + np.tile(~horizontal(edges), 2)
    nodes, local = np.unique(ends, return_inverse=True)
    n, e = len(nodes), len(edges)
    columns = np.column_stack([local[:e], local[e:], n + np.arange(e)])
    at_points = np.tile(nodal_quadratics(t), (e, 1))
    place = np.repeat(columns, points.count, axis=0).ravel(), 3 * np.arange(e * points.count + 1)
    quadratic = sparse.csr_array((at_points.ravel(), *place), shape=(e * points.count, n + e))
    weighted = sparse.csr_array(((points.weights[:, None] * at_points).ravel(), *place), shape=quadratic.shape)

    blind = np.flatnonzero(np.isin(nodes // 2, fixed))
    transposed = quadratic.T.tocsr()
    system, right = transposed @ weighted, transposed @ functional
    if not len(blind):
        return np.asarray(quadratic @ linalg.spsolve(system.tocsc(), right))
    seen, trial = np.setdiff1d(np.arange(n + e), blind), _linear_at_ends(columns, n + e, blind)
    system, right = (system @ trial)[seen], right[seen]
    if len(seen) == trial.shape[1]:
        solution = trial @ linalg.spsolve(system.tocsc(), right)
    else:  # one edge with both ends prescribed: only the mean against the bubble is known
        solution = trial @ np.linalg.lstsq(system.toarray(), right, rcond=None)[0]
    return np.asarray(quadratic @ solution)


def _linear_at_ends(columns: IntArray, size: int, blind: IntArray) -> sparse.csr_array:
    """Basis of the quadratics that are linear on every edge with a blind node: midpoint value = mean of the ends."""
    linear = np.isin(columns[:, :2], blind).any(axis=1)
    free = np.setdiff1d(np.arange(size), columns[linear, 2])
    number = np.full(size, -1)
    number[free] = np.arange(len(free))
    rows = np.concatenate([free, np.repeat(columns[linear, 2], 2)])
    targets = np.concatenate([number[free], number[columns[linear, :2]].ravel()])
    data = np.concatenate([np.ones(len(free)), np.full(2 * int(linear.sum()), 0.5)])
    return sparse.csr_array((data, (rows, targets)), shape=(size, len(free)))
