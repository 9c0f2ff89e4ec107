"""What happens on a contact: tractions, gap and slip, and which points are open, stick or slip.

Displacements come from the multipliers: divided by the weights where the rows of (D2) are independent, else as far as
the traces feel them, see `Basis.contact_displacements`.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import physical
from qvi_contact.solution.between_points import between_points

STATE_TOLERANCE: Final = 1e-6


class ContactState(IntEnum):
    """State of a contact point."""

    OPEN = 0
    STICK = 1
    SLIP = 2


@dataclass(frozen=True, eq=False)
class ContactLine:
    """One contact in the solution; arrays over its m Gauss points, edges in the mesh's order.

    An edge has four points on rectangles, p − 1 on triangles of degree p.

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
        σ_T [stress], component of the traction on the body along the tangent: +x (horizontal contact) or +y (vertical),
        t_x > 0 on slanted edges.
    gap : (m,) array
        g − u_N [length], ≥ 0 and zero in contact up to the mesh: the multipliers obey the contact law exactly, the
        gap is their projection on polynomials along each edge, linear ones on rectangles, and may dip below zero beside
        the end of a contact zone.
    slip : (m,) array
        u_T − w [length] along the same tangent, opposite in sign to σ_T and zero at sticking points up to the mesh: a
        projection as well, on rectangles on continuous quadratic functions.
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
    number: int,
    normal: FloatArray,
    tangential: FloatArray,
    normal_multiplier: FloatArray,
    tangential_multiplier: FloatArray,
    unit: float = 1.0,
) -> ContactLine:
    """Results on the contact of a number from its dimensionless tractions and their multipliers, (m,) each.

    The stress `unit` decides what counts as loaded; C L turns it into a displacement (see `Scales`).

    λ = m/W gives u_N − g = −λ_N and u_T − w = −λ_T, projected on the trace spaces; g as far as it is within reach, the
    rest is added.
    """
    contacts = discretization.contacts
    rows = contacts[number]
    scales, points = discretization.scales, rows.points
    x, y = physical(discretization.problem, scales, points.coordinates)
    far = normal_multiplier + points.weights * rows.beyond
    gap, against = discretization.space.contact_displacements(
        contacts, number, far, tangential_multiplier, discretization.elimination
    )
    slip = -against
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
