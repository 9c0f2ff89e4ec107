"""Results on a contact: tractions, gap and slip, the state of each point, and the law's excess between points.

Gap and slip are the multipliers divided by the weights. Between the Gauss points the discrete problem does not impose
the law. There tractions and data of the law are interpolated, and checked at the ends and `SAMPLES` of every edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.discretization.loads import physical
from qvi_contact.element.edge import SAMPLES, gauss_legendre, legendre_basis, legendre_from_values
from qvi_contact.mesh.edges import Edges, chains, cross, points_back
from qvi_contact.problem.conditions import bears_shear
from qvi_contact.solution.stress import normal_and_shear
from qvi_contact.units import Rounding, Units
from solvers.basics.types import frame, load, pandas

if TYPE_CHECKING:
    from pandas import DataFrame

    from qvi_contact.solution.result import ContactResult

_COLUMNS: Final = {
    "x": "length", "y": "length", "weight": "length", "friction": "", "friction_bound": "stress",
    "normal_stress": "stress", "pore_pressure": "stress", "tangential_stress": "stress", "gap": "displacement",
    "slip": "displacement",
}  # fmt: skip
"""Columns of `ContactLine.to_frame` and their `Units`; but for "weight" they are attributes."""

SUMMARY: Final = {
    "normal_force": "force", "tangential_force": "force", "largest_pressure": "stress",
    "largest_shear": "stress", "largest_gap": "displacement", "largest_slip": "displacement",
}  # fmt: skip
"""Numbers of `ContactLine.summary` and their `Units`; shares have none."""

STATE_TOLERANCE: Final = 1e-6
"""Tolerance of `contact_states`, relative to the units of stress and displacement."""

_STRETCHED: Final = 0.68  # chord over length of a line, above which its direction is that from end to end
_NO_TURN: Final = 1e-6  # (twice the area that a line sweeps around its middle) / length², up to which it is rounding


class ContactState(IntEnum):
    """State of a contact point; without friction it is open or closed."""

    OPEN = 0
    STICK = 1
    SLIP = 2
    CLOSED = 3


@dataclass(frozen=True, eq=False, repr=False)
class ContactLine(WithFields):
    """One contact in the solution; arrays over its m Gauss points, edges in the mesh's order.

    An edge has p − 1 points, with p the degree of the Airy function. On arcs normals and tangents turn with the arc.

    On a joint u is the displacement of the lower or left block less that of the other one. The gap is the opening of
    the joint, the slip the motion of the lower or left block along the tangent relative to the other. Tractions and
    forces act on the lower or left block. On a closed joint the sides change where the tangent turns back: shear and
    slip are those of the block inside, positive clockwise, and `ContactResult.resultant` has the whole force on it.
    """

    name: str
    x: FloatArray
    y: FloatArray
    """Coordinates (m,) [length]."""
    weights: FloatArray
    """Quadrature weights along the contact (m,) [length]."""
    friction: FloatArray
    """Coefficient μ (m,)."""
    friction_bound: FloatArray
    """Bound min(c + μ|σ_N'|, t_max) of |σ_T| (m,) [stress]; infinity if tied."""
    normal_stress: FloatArray
    """σ_N (m,) [stress], ≤ 0 under pressure; of either sign if bilateral or tied. It includes a fluid's pressure."""
    tangential_stress: FloatArray
    """σ_T (m,) [stress], component of the traction on the body along the tangent: +x (horizontal contact) or +y
    (vertical), t_x > 0 on slanted edges; on closed joints −y (vertical)."""
    gap: FloatArray
    """g − u_N (m,) [length], ≥ 0, and zero in contact, up to the error of the mesh. The multipliers of rows obey the
    contact law exactly; the gap at points is that of a polynomial along each edge, and may be slightly negative beside
    the end of a contact zone."""
    slip: FloatArray
    """u_T − w (m,) [length] along the same tangent, opposite in sign to σ_T, and zero at sticking points, up to the
    error of the mesh. In a history the slip of the step; `History.slip` adds up the steps."""
    state: IntArray
    """`ContactState` (m,): 0 open, 1 stick, 2 slip, without friction 3 closed; see `contact_states` for the rule."""
    ends: FloatArray
    """The two ends x, y of each edge (edges, 2, 2), in the direction of the tangent [length]."""
    pore_pressure: FloatArray
    """Pressure p_w of a fluid in the contact (m,) [stress]; zeros where there is none."""
    senses: FloatArray
    """Signs ±1 (edges,) of σ_T in the tangential force, see `turning_senses`."""
    excess_between_points: float = 0.0
    """Largest (|σ_T| − bound)⁺ at 101 points of each edge [stress], with the bound from the pressure there. At Gauss
    points it is 0 up to the certificate's tolerance. With `law_on` "edges" it is 0 between them too, except on
    bilateral contacts with friction and where friction varies along an edge."""
    pull_between_points: float = 0.0
    """Largest tension (σ_N')⁺ on a unilateral contact [stress], at the same points."""
    rounding: Rounding = field(default_factory=Rounding)
    """Sizes up to which numbers of the contact are rounding, and shown as 0."""
    frictionless: bool = False
    """Whether the contact has no friction: then its points are open or closed, and do not stick or slip."""

    @property
    def effective_normal_stress(self) -> FloatArray:
        """σ_N' = σ_N + p_w (m,) [stress], the traction between the two sides without the fluid's pressure."""
        return self.normal_stress + self.pore_pressure

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral, force per unit of thickness [stress × length]."""
        return -float(self.weights @ self.normal_stress)

    @property
    def effective_normal_force(self) -> float:
        """−∫ σ_N' ds, the normal force less that of the fluid [stress × length]."""
        return -float(self.weights @ self.effective_normal_stress)

    @property
    def has_fluid(self) -> bool:
        """Whether the contact has a fluid with nonzero pressure."""
        return bool(self.pore_pressure.any())

    @property
    def tangential_force(self) -> float:
        """∫ ± σ_T ds, force on the body along the contact per unit of thickness [stress × length].

        If all tangents point the same way along the contact, as on a straight one, the sign is +: the force is along
        the tangent. If they turn back, as in a round bore, the sign is that of the counterclockwise sense around the
        middle of the contact: on a full circle of the radius r the shear has the moment r T about its centre. On a line
        that leads from end to end all the same, as a base with a step, it is the sense from end to end. On a closed
        joint it is the force on the block inside, clockwise.
        """
        return float(self.weights @ self.counted_shear)

    @property
    def counted_shear(self) -> FloatArray:
        """± σ_T (m,) [stress], with the sign that it has in the tangential force."""
        return np.repeat(self.senses, self.points_per_edge) * self.tangential_stress

    @property
    def forces(self) -> tuple[float, float]:
        """Normal and tangential force [stress × length]; 0 where they are too small to be shown."""
        normal, tangential = self.rounding.cleaned((self.normal_force, self.tangential_force), ("force", "force"))
        return normal, tangential

    @property
    def points_per_edge(self) -> int:
        """Number of Gauss points on each edge."""
        return len(self.x) // len(self.ends)

    @cached_property
    def path(self) -> ContactPath:
        """The edges of the contact, in order along it."""
        return ContactPath.of(self.ends, self.weights.reshape(len(self.ends), -1).sum(axis=1))

    @property
    def lengths(self) -> Mapping[str, float]:
        """Length of the contact in each state: "open", "stick", "slip"; without friction "open", "closed" [length]."""
        states = [ContactState.OPEN, ContactState.STICK, ContactState.SLIP]
        if self.frictionless:
            states = [ContactState.OPEN, ContactState.CLOSED]
        return {state.name.lower(): float(self.weights[self.state == state].sum()) for state in states}

    @property
    def shares(self) -> Mapping[str, float]:
        """`lengths` as shares of the contact's length, of sum 1."""
        return {name: length / float(self.weights.sum()) for name, length in self.lengths.items()}

    def to_frame(self, units: Units | None = None) -> DataFrame:
        """All points in order along the contact; `InputError` if pandas, the extra ``frame``, is missing.

        One row per point with the columns "s" (length along the contact, line by line), "x", "y", "weight", "friction",
        "friction_bound", "normal_stress", "pore_pressure", "tangential_stress", "gap", "slip" as described above, and
        "state", a categorical of "open", "stick", "slip", "closed". With units column names end in them: "slip [mm]".
        """
        names, path = [state.name.lower() for state in ContactState], self.path
        order = path.points(self.points_per_edge).ravel()
        attributes = {**vars(self), "weight": self.weights}
        columns = {"s": path.places(gauss_legendre(self.points_per_edge)[0]).ravel()}
        columns |= {name: attributes[name][order] for name in _COLUMNS}
        columns["state"] = pandas().Categorical.from_codes(self.state[order], names)
        return frame(columns, Units.labels(units, {"s": "length"} | _COLUMNS))

    def summary(self) -> dict[str, float]:
        """Resultant forces, shares of the length in each state, and extremes; `SUMMARY` has their units."""
        return {
            "normal_force": self.normal_force,
            "tangential_force": self.tangential_force,
            **{f"share_{state}": self.shares.get(state, 0.0) for state in ("open", "stick", "slip")},
            "largest_pressure": float((-self.normal_stress).max()),
            "largest_shear": float(np.abs(self.tangential_stress).max()),
            "largest_gap": float(self.gap.max()),
            "largest_slip": float(np.abs(self.slip).max()),
        }

    def __repr__(self) -> str:
        shares = ", ".join(f"{100.0 * share:.0f} % {state}" for state, share in self.shares.items() if share)
        normal, tangential = self.forces
        return f"<ContactLine {self.name}: N = {normal:.6g}, T = {tangential:.6g}, {shares}>"

    def _repr_html_(self) -> str:
        """Forces, extremes and states as a table, for notebooks."""
        return str(load("qvi_contact.command.page").contact_html(self))


def contact_states(
    effective: FloatArray, tangential_stress: FloatArray, bound: FloatArray, gap: FloatArray, slip: FloatArray,
    unit: float, *, may_open: bool = True, frictionless: bool = False,
) -> IntArray:  # fmt: skip
    """`ContactState` of each point (m,) from dimensionless tractions, gap and slip.

    With p = −σ_N'/S, t = |σ_T|/S, b = bound/S, d = gap/S and v = |slip|/S, where S is `unit`, a point is

    * open if it may open and p ≤ d + tolerance: the gap outweighs the pressure, or the pressure is zero;
    * else closed if the contact has no friction;
    * else slip if b − t < v + tolerance, and v or t is above the tolerance: the slip outweighs the slack of the bound;
    * else stick.

    The tolerance, 1e-6, is above the error of a solution certified at 1e-8. Exactly between two states both are right.

    With the law at points, at most one of p and d, and one of b − t and v, is not zero, and the rule says which. With
    Bernstein coefficients the law holds for each coefficient. At the points of an edge in which a zone ends, both may
    then be positive. The place where one outweighs the other is a better estimate of the zone's end than the tractions
    alone, which are below the bound on the whole edge.
    """
    pressure, opening, tolerance = -effective / unit, gap / unit, STATE_TOLERANCE
    slack = bound / unit - np.abs(tangential_stress) / unit
    sliding = np.abs(slip) / unit
    is_loaded = np.abs(tangential_stress) > tolerance * unit
    slips = (slack < sliding + tolerance) & ((sliding > tolerance) | is_loaded)
    state = np.where(frictionless, ContactState.CLOSED, np.where(slips, ContactState.SLIP, ContactState.STICK))
    return np.where((pressure <= opening + tolerance) & may_open, ContactState.OPEN, state)


def contact_line(result: ContactResult, number: int) -> ContactLine:
    """Results on the contact `number`.

    The multipliers λ = m/W give u_N − g = −λ_N and u_T − w = −λ_T. Their g is within reach, see `Scales`; the distance
    beyond is added to the gap.
    """
    dofs = result.dofs  # raises InputError if there is no state
    problem, discretization, solution = result.problem, result.discretization, result.solution
    rows, scales = discretization.contacts[number], discretization.scales
    mesh, points, edges, rule = problem.mesh, rows.points, rows.points.edges, rows.rule
    x, y = physical(problem, scales, points.coordinates)
    m_N = m_T = np.zeros(len(x))  # letters of (D2)
    if rows.law == "tied":
        effective, tangential = normal_and_shear(discretization, dofs, points)
    else:
        qvi, z, chosen = solution.problem, solution.z, rows.rows
        effective, tangential = rule.at_points(qvi.normal(z)[chosen]), rule.at_points(qvi.tangential(z)[chosen])
        m_N = rule.multipliers_at_points(solution.normal_multiplier[chosen])
        m_T = rule.multipliers_at_points(solution.tangential_multiplier[chosen])
    gap = (m_N + points.weights * rows.beyond) / points.weights
    slip = -(m_T / points.weights)
    bound = rows.bound(effective)
    frictionless = rows.law != "tied" and not bears_shear(problem.contacts[number])
    may_open, unit = rows.law == "unilateral", result.certificate.scales.get("stress", 1.0)
    excess = pull = 0.0  # largest (|σ_T| − bound)⁺ and (σ_N')⁺ along the contact, dimensionless
    if rows.law != "tied":
        count, capped = points.count, bool(np.isfinite(rows.limits.cap).all())
        t = np.concatenate([[0.0], SAMPLES, [1.0]])
        to_samples = (legendre_basis(count - 1, t) @ legendre_from_values(count - 1, count)).T
        fields = effective, tangential, *rows.limits[: 2 + capped]
        tension, shear, friction, cohesion, *caps = (part.reshape(-1, count) @ to_samples for part in fields)
        bound_there = cohesion + friction * (np.maximum(-tension, 0.0) if may_open else np.abs(tension))
        bound_there = np.minimum(bound_there, caps[0]) if capped else bound_there
        # interpolated limits may be negative, a bound is not
        excess = float((np.abs(shear) - np.maximum(bound_there, 0.0)).max(initial=0.0))
        pull = float(tension.max(initial=0.0)) if may_open else 0.0
    return ContactLine(
        name=rows.name,
        x=x,
        y=y,
        weights=points.weights * scales.length,
        friction=rows.limits.friction,
        friction_bound=bound * scales.stress,
        normal_stress=(effective - rows.pore_pressure) * scales.stress,
        tangential_stress=tangential * scales.stress,
        gap=gap * scales.displacement,
        slip=slip * scales.displacement,
        state=contact_states(
            effective, tangential, bound, gap, slip, unit, may_open=may_open, frictionless=frictionless
        ),
        ends=np.stack([mesh.vertices[edges.first], mesh.vertices[edges.second]], axis=1),
        pore_pressure=rows.pore_pressure * scales.stress,
        excess_between_points=excess * scales.stress,
        pull_between_points=pull * scales.stress,
        rounding=result.rounding,
        frictionless=frictionless,
        senses=turning_senses(mesh.vertices, edges),
    )


# The order of a contact's edges and points along the lines that they form, and lengths along these lines.
#
# Edges are numbered in the mesh's order, and each tangent has t_x > 0. So neither gives the order along a curved
# contact. A path does: each line begins at its end of smallest x (and y), a closed line at its point of smallest x.


@dataclass(frozen=True, eq=False)
class ContactPath:
    """Edges in order along their lines; a line ends where no other edge, or more than one, continues it."""

    edges: IntArray
    """Numbers of the edges in order, shape (n,)."""
    forward: BoolArray
    """Whether the edge's tangent points along the path, (n,)."""
    lines: tuple[IntArray, ...]
    """Indices (k,) of each line's edges in this order."""
    lengths: FloatArray
    """Lengths of the edges in this order [length], (n,)."""

    @classmethod
    def of(cls, ends: FloatArray, lengths: FloatArray) -> ContactPath:
        """The path through edges in any order, from their two ends (n, 2, 2) [length] and lengths (n,)."""
        vertices = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 2)
        chosen = chains(vertices)
        order, forward = np.concatenate([np.empty(0, dtype=np.int64), *chosen]), [np.empty(0, dtype=bool)]
        for pairs in (vertices[line] for line in chosen):  # whether the second end of each edge is on the next edge
            last = (pairs[-1, :1] == pairs[-2]).any() if len(pairs) > 1 else pairs[0, 0] < pairs[0, 1]
            forward.append(np.append((pairs[:-1, 1:] == pairs[1:]).any(axis=1), last))
        lines = np.split(np.arange(len(order)), np.cumsum([len(line) for line in chosen])[:-1]) if chosen else []
        return cls(order, np.concatenate(forward), tuple(lines), lengths[order])

    @cached_property
    def starts(self) -> FloatArray:
        """Length along the path, one line after the other, where each edge begins, shape (n,) [length]."""
        return np.asarray(np.cumsum(self.lengths) - self.lengths)

    def points(self, count: int) -> IntArray:
        """Numbers of the points (n, count) in order, for `count` points per edge, numbered along its tangent."""
        along = np.arange(count)
        return np.asarray(count * self.edges[:, None] + np.where(self.forward[:, None], along, along[::-1]))

    def places(self, t: FloatArray) -> FloatArray:
        """Length along the path (n, q) of the points at t (q,) of each edge, 0 to 1 along the path [length]."""
        return np.asarray(self.starts[:, None] + self.lengths[:, None] * t)


def turning_senses(vertices: FloatArray, edges: Edges) -> FloatArray:
    """Signs ±1 (n,) of the shear on each edge in the tangential force of a contact.

    All signs are +1 on a line whose tangents point the same way along it. Tangents point to the right (t_x > 0). So on
    a line that turns back, such as a round bore, some point along it and others against it. There the sign is +1 for
    tangents that lead counterclockwise around the middle of the line. But if its ends are nearly as far apart as it is
    long, as on a base with a step, or if it sweeps no area, the sign is +1 for tangents that lead the way of a tangent
    from end to end. On joints the signs are +1, as the sides change where the tangent turns back. Only upright edges in
    a line with others may have −1: their sides are left and right, not below and above.
    """
    signs = np.ones(len(edges))
    if (edges.cells[:, 1] >= 0).any():
        handed = np.sign(cross(edges.tangent, edges.normal))
        for chosen in chains(np.column_stack([edges.first, edges.second])):
            signs[chosen] = handed[chosen] * handed[chosen].max()
        return signs
    for chosen, walk, chord, turning in _turning_lines(vertices, edges, signs):
        straight = np.hypot(*chord) > _STRETCHED or abs(turning) <= _NO_TURN
        signs[chosen] = -walk if (points_back(chord[None])[0] if straight else turning < 0.0) else walk
    return signs


def enclosed_beyond(vertices: FloatArray, edges: Edges) -> BoolArray:
    """Whether the block that a joint encloses is on the second side of each edge (n,), as on half of a circle.

    A joint with one block below or to the left of all its edges encloses none. A joint that sweeps no area, such as one
    with a step in its middle, counts as if it enclosed the block below or to the left of the way from end to end.
    """
    is_beyond = np.zeros(len(edges), dtype=bool)
    for chosen, leads, chord, turning in _turning_lines(vertices, edges, cross(edges.normal, edges.tangent)):
        left = turning > 0.0 if abs(turning) > _NO_TURN else points_back(chord[None] * [1.0, -1.0])[0]
        is_beyond[chosen] = (leads < 0.0) == left
    return is_beyond


def _turning_lines(
    vertices: FloatArray, edges: Edges, signs: FloatArray
) -> Iterator[tuple[IntArray, FloatArray, FloatArray, float]]:
    """Lines of edges along which tangents times signs (n,) do not all point the same way.

    For each line: its edges (k,); the directions ±1 (k,) of tangent times sign along it; its chord over its length
    (2,); twice the area that it sweeps around its middle over its length squared, positive if counterclockwise.
    """
    ends = np.stack([vertices[edges.first], vertices[edges.second]], axis=1)
    path = ContactPath.of(ends, edges.length)
    for line in path.lines:
        chosen, walk = path.edges[line], np.where(path.forward[line], 1.0, -1.0)
        leads, lengths, middles = walk * signs[chosen], path.lengths[line], ends[chosen].mean(axis=1)
        if leads.min() < 0.0 < leads.max():
            steps = walk[:, None] * (ends[chosen, 1] - ends[chosen, 0])
            turning = float(cross(middles - np.average(middles, axis=0, weights=lengths), steps).sum())
            yield chosen, leads, steps.sum(axis=0) / lengths.sum(), turning / float(lengths.sum()) ** 2
