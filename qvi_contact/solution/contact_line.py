"""What happens on a contact: tractions, gap and slip, and which points are open, stick or slip.

Displacements come from the multipliers. The rows of (D2) at the four Gauss points of an edge depend linearly on each
other, so single multipliers mean nothing; what the stresses feel, and what is unique, is their effect on the traces:
linear along each edge for σ_N, continuous and quadratic along each for σ_T. Gap and slip are therefore the weighted
L² projections of the pointwise multipliers on these spaces.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import physical
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.solution.between_points import between_points

STATE_TOLERANCE: Final = 1e-6


class ContactState(IntEnum):
    """State of a contact point."""

    OPEN = 0
    STICK = 1
    SLIP = 2


@dataclass(frozen=True, eq=False)
class ContactLine:
    """One contact in the solution; arrays over its m Gauss points, four an edge, edges in the mesh's order.

    Attributes
    ----------
    name : str
        Name of the contact.
    x, y : (m,) arrays
        Coordinates [length].
    weights : (m,) array
        Quadrature weights along the contact [length].
    friction : (m,) array
        Coefficient μ.
    friction_bound : (m,) array
        Bound min(c + μ|σ_N|, t_max) of |σ_T| [stress]; infinity if tied.
    normal_stress : (m,) array
        σ_N [stress], ≤ 0 under pressure; of either sign if bilateral or tied.
    tangential_stress : (m,) array
        σ_T [stress], component of the traction on the body along +x (horizontal contact) or +y (vertical).
    gap : (m,) array
        g − u_N [length], ≥ 0 and zero in contact up to the mesh: the multipliers obey the contact law exactly, the
        gap is their projection on linear functions of each edge, and may dip below zero beside the end of a contact
        zone.
    slip : (m,) array
        u_T − w [length] along the same tangent, opposite in sign to σ_T and zero at sticking points up to the mesh: a
        projection as well, on continuous quadratic functions.
    state : (m,) int array
        `ContactState`: 0 open, 1 stick, 2 slip; see `contact_states` for the rule and its tolerance.
    excess_between_points : float
        Largest (|σ_T| − bound)⁺ anywhere on the contact [stress], with the bound of the pressure there: 0 at the points
        up to the certificate's tolerance, and between them only where the inner solver is a "strict" one.
    pull_between_points : float
        Largest (σ_N)⁺ anywhere on a unilateral contact [stress]. Both are exact, see `between_points`.

    Notes
    -----
    On a joint u is the displacement of the lower or left block less that of the other one: the gap is how far the joint
    stands open, the slip how far that block has moved beyond the other along the tangent; tractions and forces are
    those on the lower or left block.

    """

    name: str
    x: FloatArray
    y: FloatArray
    weights: FloatArray
    friction: FloatArray
    friction_bound: FloatArray
    normal_stress: FloatArray
    tangential_stress: FloatArray
    gap: FloatArray
    slip: FloatArray
    state: IntArray
    excess_between_points: float = 0.0
    pull_between_points: float = 0.0

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral, force a unit of thickness [stress × length]."""
        return -float(self.weights @ self.normal_stress)

    @property
    def tangential_force(self) -> float:
        """∫ σ_T ds, force on the body along the tangent a unit of thickness [stress × length]."""
        return float(self.weights @ self.tangential_stress)


def contact_states(
    normal_stress: FloatArray,
    tangential_stress: FloatArray,
    bound: FloatArray,
    gap: FloatArray,
    slip: FloatArray,
    stress_unit: float,
    displacement_unit: float,
    tolerance: float = STATE_TOLERANCE,
    *,
    may_open: bool = True,
) -> IntArray:
    """State of each point from tractions and displacements, never from raw multipliers.

    With p = −σ_N/S, t = |σ_T|/S, b = bound/S and d = gap/D, v = |slip|/D in the units S, D given, the point is

    * open if it may and p ≤ d + tolerance: the gap outweighs the pressure, or nothing presses it;
    * else slip if b − t < v + tolerance and the point moves or is loaded (v or t above the tolerance): the slip
      outweighs what is left of the bound;
    * else stick.

    The tolerance, 1e-6 of the units, sits above what a solution certified at 1e-8 can blur; exactly on the edge
    between two states either answer is right.

    Returns
    -------
    (m,) int array of `ContactState`

    """
    pressure, opening = -normal_stress / stress_unit, gap / displacement_unit
    left = bound / stress_unit - np.abs(tangential_stress) / stress_unit
    sliding = np.abs(slip) / displacement_unit
    moves = sliding > tolerance
    loaded = np.abs(tangential_stress) > tolerance * stress_unit
    slips = (left < sliding + tolerance) & (moves | loaded)
    state = np.where(slips, int(ContactState.SLIP), int(ContactState.STICK))
    opens = (pressure <= opening + tolerance) & may_open
    return np.where(opens, int(ContactState.OPEN), state)


def contact_line(
    discretization: Discretization,
    rows: ContactRows,
    normal: FloatArray,
    tangential: FloatArray,
    normal_multiplier: FloatArray,
    tangential_multiplier: FloatArray,
    unit: float = 1.0,
) -> ContactLine:
    """Results on one contact from its dimensionless tractions and row multipliers, (m,) each.

    The stress `unit` decides what counts as loaded; C L turns it into a displacement (see `Scales`).

    λ = m/W gives u_N − g = −λ_N and u_T − w = −λ_T, projected on the trace spaces.
    """
    scales, points = discretization.scales, rows.points
    x, y = physical(discretization.problem, scales, points.coordinates)
    gap = _project_normal(points.count, normal_multiplier / points.weights)
    slip = -_project_tangential(rows, tangential_multiplier, _blind_nodes(discretization))
    bound = rows.bound(normal)
    may_open = rows.law == "unilateral"
    violations = between_points(rows, normal, tangential)
    return ContactLine(
        name=rows.name,
        x=x,
        y=y,
        weights=points.weights * scales.length,
        friction=rows.friction,
        friction_bound=bound * scales.stress,
        normal_stress=normal * scales.stress,
        tangential_stress=tangential * scales.stress,
        gap=gap * scales.displacement,
        slip=slip * scales.displacement,
        state=contact_states(normal, tangential, bound, gap, slip, unit, unit, may_open=may_open),
        excess_between_points=float(violations.excess.max(initial=0.0)) * scales.stress,
        pull_between_points=float(violations.pull.max(initial=0.0)) * scales.stress,
    )


def _blind_nodes(discretization: Discretization) -> IntArray:
    """Nodes where the trace σ_T does not see the tangential displacement of one contact line alone.

    That is where Φ_xy is prescribed, and in corners between contact lines, which share one Φ_xy.
    """
    prescribed = np.flatnonzero(~discretization.elimination.kept[3::4])
    lines = []
    for rows in discretization.contacts:
        edges = rows.points.edges
        for axis in np.unique(edges.axis):
            chosen = edges.axis == axis
            lines.append(np.unique(np.concatenate([edges.first[chosen], edges.second[chosen]])))
    nodes, times = np.unique(np.concatenate([prescribed[:0], *lines]), return_counts=True)
    return np.union1d(prescribed, nodes[times > 1])


def _project_normal(count: int, values: FloatArray) -> FloatArray:
    """L² projection on linear functions, edge by edge, of values at Gauss points."""
    t, weights = gauss_legendre(count)
    linear = np.column_stack([np.ones(count), np.sqrt(12.0) * (t - 0.5)])  # orthonormal on [0, 1]
    return np.asarray(values.reshape(-1, count) @ (weights[:, None] * linear) @ linear.T).ravel()


def _project_tangential(rows: ContactRows, functional: FloatArray, fixed: IntArray) -> FloatArray:
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
    ends = 2 * np.concatenate([edges.first, edges.second]) + np.tile(edges.axis, 2)
    nodes, local = np.unique(ends, return_inverse=True)
    n, e = len(nodes), len(edges)
    shape = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
    columns = np.column_stack([local[:e], local[e:], n + np.arange(e)])
    at_point = np.repeat(columns, points.count, axis=0)
    index = (np.repeat(np.arange(e * points.count), 3), at_point.ravel())
    quadratic = sparse.csr_array((np.tile(shape, (e, 1)).ravel(), index), shape=(e * points.count, n + e))

    blind = np.flatnonzero(np.isin(nodes // 2, fixed))
    seen = np.setdiff1d(np.arange(n + e), blind)
    tested = sparse.csr_array((np.ones(len(seen)), (np.arange(len(seen)), seen)), shape=(len(seen), n + e))
    trial = _linear_at_ends(columns, n + e, blind)
    mass = quadratic.T @ (sparse.diags_array(points.weights) @ quadratic)
    if len(seen) == trial.shape[1]:
        solution = trial @ linalg.spsolve(sparse.csc_array(tested @ mass @ trial), tested @ (quadratic.T @ functional))
    else:  # one edge with both ends prescribed: only the mean against the bubble is known
        system = (tested @ mass @ trial).toarray()
        right = np.asarray(quadratic.T @ functional)[seen]
        solution = trial @ np.linalg.lstsq(system, right, rcond=None)[0]
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
