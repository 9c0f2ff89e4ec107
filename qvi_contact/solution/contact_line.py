"""What happens on a contact: tractions, gap and slip, which points are open, stick or slip, and what lies between them.

Displacements come from the multipliers divided by the weights.

Between the Gauss points the discrete problem does not ask for the law. Tractions and fields of the law are taken there
as the polynomials through them, and seen at the ends and `SAMPLES` of every edge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, physical
from qvi_contact.element.edge import SAMPLES, gauss_legendre, legendre_basis, legendre_from_values
from qvi_contact.mesh.edges import Edges, chains, cross, points_back
from qvi_contact.problem.conditions import is_frictionless
from qvi_contact.solution.stress import normal_and_shear
from qvi_contact.units import Rounding, Units, shown
from solvers import QVISolution
from solvers.basics.types import frame, load, pandas

if TYPE_CHECKING:
    from pandas import DataFrame

_COLUMNS: Final = {
    "x": "length", "y": "length", "weights": "length", "friction": "", "friction_bound": "stress",
    "normal_stress": "stress", "pore_pressure": "stress", "tangential_stress": "stress", "gap": "displacement",
    "slip": "displacement",
}  # fmt: skip
"""Attributes that are columns of `ContactLine.to_frame`, and which of the `Units` they are in."""

SUMMARY: Final = {
    "normal_force": "force", "tangential_force": "force", "largest_pressure": "stress",
    "largest_shear": "stress", "largest_gap": "displacement", "largest_slip": "displacement",
}  # fmt: skip
"""Which of the `Units` numbers of `ContactLine.summary` are in; shares have none."""

STATE_TOLERANCE: Final = 1e-6

_STRETCHED: Final = 0.68  # distance of the ends of a line over its length, above which it leads from one to the other
_NO_TURN: Final = 1e-6  # twice the area that a line sweeps around its middle over its length squared: rounding


class ContactState(IntEnum):
    """State of a contact point; without friction it is open or closed."""

    OPEN = 0
    STICK = 1
    SLIP = 2
    CLOSED = 3


@dataclass(frozen=True, eq=False, repr=False)
class ContactLine:
    """One contact in the solution; arrays over its m Gauss points, edges in the mesh's order.

    An edge has p − 1 points, with p the degree of the Airy function. On edges that are arcs normals and tangents are
    those of the arc at each point.

    On a joint u is the displacement of the lower or left block less that of the other one: the gap is how far the joint
    stands open, the slip how far that block has moved beyond the other along the tangent; tractions and forces are
    those on the lower or left block. Along a closed joint the blocks change places where the tangent turns back: shear
    and slip are those of the block inside, clockwise, and `ContactResult.resultant` has the whole force on it.
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
    """σ_N (m,) [stress], ≤ 0 under pressure; of either sign if bilateral or tied. The pressure of a fluid is part of
    it."""
    tangential_stress: FloatArray
    """σ_T (m,) [stress], component of the traction on the body along the tangent: +x (horizontal contact) or +y
    (vertical), t_x > 0 on slanted edges; on closed joints −y (vertical)."""
    gap: FloatArray
    """g − u_N (m,) [length], ≥ 0 and zero in contact up to the mesh: the multipliers of rows obey the contact law
    exactly, the gap at points is that of a polynomial along each edge, and may dip below zero beside the end of a
    contact zone."""
    slip: FloatArray
    """u_T − w (m,) [length] along the same tangent, opposite in sign to σ_T and zero at sticking points up to the
    mesh."""
    state: IntArray
    """`ContactState` (m,): 0 open, 1 stick, 2 slip, without friction 3 closed; see `contact_states` for the rule."""
    ends: FloatArray
    """The two ends x, y of each edge (edges, 2, 2), in the direction of the tangent [length]."""
    pore_pressure: FloatArray
    """Pressure p_w of a fluid in the contact (m,) [stress]; zeros where there is none."""
    excess_between_points: float = 0.0
    """Largest (|σ_T| − bound)⁺ seen along the contact [stress], with the bound of the pressure there: 0 at the points
    up to the certificate's tolerance. Between them too with Bernstein rows, the default where they can hold the law:
    not on bilateral contacts with friction, nor where friction varies along an edge."""
    pull_between_points: float = 0.0
    """Largest (σ_N')⁺ seen along a unilateral contact [stress]; both at 101 points of each edge."""
    rounding: Rounding = field(default_factory=Rounding)
    """Sizes up to which numbers of the contact are rounding, and shown as 0."""
    frictionless: bool = False
    """Whether the contact has no friction: then it is open or closed, and nothing sticks or slips."""
    senses: FloatArray = field(default_factory=lambda: np.ones(1))
    """±1 (edges,), in which sense σ_T of each edge counts for the tangential force, see `turning_senses`. One number
    stands for all."""

    @property
    def effective_normal_stress(self) -> FloatArray:
        """σ_N' = σ_N + p_w (m,) [stress], what the two sides press on each other; σ_N where there is no fluid."""
        return self.normal_stress + self.pore_pressure

    @property
    def normal_force(self) -> float:
        """−∫ σ_N ds, ≥ 0 if unilateral, force a unit of thickness [stress × length]."""
        return -float(self.weights @ self.normal_stress)

    @property
    def effective_normal_force(self) -> float:
        """−∫ σ_N' ds, the normal force less that of the fluid [stress × length]."""
        return -float(self.weights @ self.effective_normal_stress)

    @property
    def has_fluid(self) -> bool:
        """Whether a fluid presses anywhere in the contact."""
        return bool(self.pore_pressure.any())

    @property
    def tangential_force(self) -> float:
        """∫ ± σ_T ds, force on the body along the contact a unit of thickness [stress × length].

        The sign is + where tangents lead one way along the contact, as on a straight one: then it is the force along
        the tangent. Where they turn back, as in a round bore, it is that of the sense counterclockwise around the
        middle of the contact: on a full circle of the radius r the shear has the moment r T about its centre. On a line
        that leads on nevertheless, as a base with a step, it is that of the sense from end to end. Around a closed
        joint it is the force on what is inside, clockwise.
        """
        return float(self.weights @ self.counted_shear)

    @property
    def counted_shear(self) -> FloatArray:
        """± σ_T (m,) [stress], in the sense in which it counts for the tangential force."""
        senses = np.broadcast_to(self.senses, len(self.ends))
        return np.repeat(senses, self.points_per_edge) * self.tangential_stress

    @property
    def forces(self) -> tuple[float, float]:
        """Normal and tangential force [stress × length], rounding as 0."""
        normal, tangential = self.normal_force, self.tangential_force
        least = self.rounding.force
        return normal * (abs(normal) > least), tangential * (abs(tangential) > least)

    @property
    def shown_forces(self) -> tuple[str, str]:
        """The same as people read them."""
        normal, tangential = map(shown, self.forces)
        return normal, tangential

    @property
    def points_per_edge(self) -> int:
        """Number of Gauss points on each edge."""
        return len(self.x) // len(self.ends)

    @cached_property
    def path(self) -> ContactPath:
        """The edges in order along the contact."""
        return ContactPath.of(self.ends, self.weights.reshape(len(self.ends), -1).sum(axis=1))

    @property
    def lengths(self) -> Mapping[str, float]:
        """Lengths of the contact that are "open", "stick" and "slip", without friction "open" and "closed" [length]."""
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

        One row a point, with the columns "s" (length along the contact, line by line), "x", "y", "weight", "friction",
        "friction_bound", "normal_stress", "pore_pressure", "tangential_stress", "gap", "slip" as described above, and
        "state", a categorical of "open", "stick", "slip", "closed". With units their names end in them: "slip [mm]".
        """
        names, path = [state.name.lower() for state in ContactState], self.path
        order = path.points(self.points_per_edge).ravel()
        columns = {"s": path.places(gauss_legendre(self.points_per_edge)[0]).ravel()}
        named = {name.replace("weights", "weight"): (name, unit) for name, unit in _COLUMNS.items()}
        columns |= {column: getattr(self, name)[order] for column, (name, _) in named.items()}
        quantities = {"s": "length"} | {column: unit for column, (_, unit) in named.items() if unit}
        labels = Units.labels(units, quantities)
        states = pandas().Categorical.from_codes(self.state[order], names)
        return frame({**columns, "state": states}, labels)

    def summary(self) -> dict[str, float]:
        """Resultant forces, shares of the length that are open, stick and slip, and extremes.

        `SUMMARY` has their units. Without friction nothing sticks or slips.
        """
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
        normal, tangential = self.shown_forces
        return f"<ContactLine {self.name}: N = {normal}, T = {tangential}, {shares}>"

    def _repr_html_(self) -> str:
        """Forces, extremes and states as a table, for notebooks."""
        return str(load("qvi_contact.command.page").contact_html(self))


def contact_states(
    effective: FloatArray,
    tangential_stress: FloatArray,
    bound: FloatArray,
    gap: FloatArray,
    slip: FloatArray,
    unit: float,
    *,
    may_open: bool = True,
    frictionless: bool = False,
) -> IntArray:
    """`ContactState` of each point (m,) from dimensionless tractions and displacements, never from raw multipliers.

    With p = −σ_N'/S, t = |σ_T|/S, b = bound/S and d = gap/S, v = |slip|/S in the unit S the point is

    * open if it may and p ≤ d + tolerance: the gap outweighs the pressure, or nothing presses it;
    * else closed if the contact has no friction;
    * else slip if b − t < v + tolerance and the point moves or is loaded (v or t above the tolerance): the slip
      outweighs what is left of the bound;
    * else stick.

    The tolerance, 1e-6 of the units, sits above what a solution certified at 1e-8 can blur; exactly on the edge
    between two states either answer is right.

    Where rows are tractions at these very points, one per parameter of the trace, at most one of p and d and one of
    b − t and v is not zero, and the rule says which. Bernstein coefficients obey the law one by one; at the points of
    the edge in which a zone ends both may be positive then, and where one outweighs the other is the better guess of
    that end than the tractions alone: those of the whole edge stay below the bound.
    """
    pressure, opening, tolerance = -effective / unit, gap / unit, STATE_TOLERANCE
    left = bound / unit - np.abs(tangential_stress) / unit
    sliding = np.abs(slip) / unit
    loaded = np.abs(tangential_stress) > tolerance * unit
    slips = (left < sliding + tolerance) & ((sliding > tolerance) | loaded)
    state = np.where(slips, int(ContactState.SLIP), int(ContactState.STICK))
    if frictionless:
        state = np.full_like(state, int(ContactState.CLOSED))
    opens = (pressure <= opening + tolerance) & may_open
    return np.where(opens, int(ContactState.OPEN), state)


def contact_line(
    discretization: Discretization,
    number: int,
    solution: QVISolution,
    dofs: FloatArray,
    unit: float,
    rounding: Rounding,
) -> ContactLine:
    """Results on the contact of a number from the algebraic solution, whose degrees of freedom of Φ are these (N,).

    The stress `unit` decides what counts as loaded; C L turns it into a displacement (see `Scales`). λ = m/W gives
    u_N − g = −λ_N and u_T − w = −λ_T; g as far as it is within reach, the rest is added.
    """
    rows = discretization.contacts[number]
    scales, points = discretization.scales, rows.points
    mesh, edges, rule = discretization.problem.mesh, points.edges, rows.rule
    x, y = physical(discretization.problem, scales, points.coordinates)
    m_N = m_T = np.zeros(len(x))  # letters of (D2)
    if rows.law == "tied":
        effective, tangential = normal_and_shear(discretization, dofs, points)
    else:
        qvi, z, own = solution.problem, solution.z, rows.rows
        effective, tangential = rule.at_points(qvi.normal(z)[own]), rule.at_points(qvi.tangential(z)[own])
        m_N = rule.multipliers_at_points(solution.normal_multiplier[own])
        m_T = rule.multipliers_at_points(solution.tangential_multiplier[own])
    gap = (m_N + points.weights * rows.beyond) / points.weights
    slip = -(m_T / points.weights)
    bound = rows.bound(effective)
    frictionless = is_frictionless(discretization.problem.contacts[number])
    may_open = rows.law == "unilateral"
    excess, pull = between_points(rows, effective, tangential)
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
        rounding=rounding,
        frictionless=frictionless,
        senses=turning_senses(mesh.vertices, edges),
    )


def between_points(rows: ContactRows, normal: FloatArray, tangential: FloatArray) -> tuple[float, float]:
    """Largest (|σ_T| − bound)⁺ and (σ_N')⁺ seen on a contact from both at the Gauss points (m,), dimensionless.

    The bound is that of the pressure at each place, which where unilateral σ_N > 0 is none; tied contacts have no law.
    """
    if rows.law == "tied":
        return 0.0, 0.0
    both, count, capped = rows.law != "unilateral", rows.points.count, bool(np.isfinite(rows.limits.cap).all())
    t = np.concatenate([[0.0], SAMPLES, [1.0]])
    there = (legendre_basis(count - 1, t) @ legendre_from_values(count - 1, count)).T
    fields = normal, tangential, *rows.limits[: 2 + capped]
    pressing, shear, friction, cohesion, *caps = (part.reshape(-1, count) @ there for part in fields)
    bound = cohesion + friction * (np.abs(pressing) if both else np.maximum(-pressing, 0.0))
    bound = np.minimum(bound, caps[0]) if capped else bound
    excess = np.abs(shear) - np.maximum(bound, 0.0)  # no bound is negative, though a cubic may be
    return float(excess.max(initial=0.0)), 0.0 if both else float(pressing.max(initial=0.0))


# The order of a contact's edges and points along the lines they make up, and places on these lines.
#
# Meshes number edges as they like, and the tangent of an edge has t_x > 0, so that neither tells where a curved contact
# leads. A path does: each line begins at the end of smallest x (and y), a closed one at the point of smallest x.


@dataclass(frozen=True, eq=False)
class ContactPath:
    """Edges in order along their lines; where more than two of them meet, or none follows, a line ends."""

    edges: IntArray
    """Numbers of the edges, one behind the other, shape (n,)."""
    forward: BoolArray
    """Whether the tangent of the edge leads along the path, (n,)."""
    lines: tuple[IntArray, ...]
    """Of each line the places (k,) that its edges have in this order."""
    lengths: FloatArray
    """Their lengths [length], (n,)."""

    @classmethod
    def of(cls, ends: FloatArray, lengths: FloatArray) -> ContactPath:
        """The path through edges between two points each, (n, 2, 2) [length], of these lengths (n,), in any order."""
        vertices = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1, 2)
        found = chains(vertices)
        order, forward = np.concatenate([np.empty(0, dtype=np.int64), *found]), [np.empty(0, dtype=bool)]
        for pairs in (vertices[line] for line in found):  # whether each edge leads on to the next one
            last = (pairs[-1, :1] == pairs[-2]).any() if len(pairs) > 1 else pairs[0, 0] < pairs[0, 1]
            forward.append(np.append((pairs[:-1, 1:] == pairs[1:]).any(axis=1), last))
        lines = np.split(np.arange(len(order)), np.cumsum([len(line) for line in found])[:-1]) if found else []
        return cls(order, np.concatenate(forward), tuple(lines), lengths[order])

    @cached_property
    def starts(self) -> FloatArray:
        """Length along the path where each of its edges begins, lines behind each other, shape (n,) [length]."""
        return np.asarray(np.cumsum(self.lengths) - self.lengths)

    def points(self, count: int) -> IntArray:
        """Numbers of the points (n, count) in order, of so many points an edge, counted along its tangent."""
        along = np.arange(count)
        return np.asarray(count * self.edges[:, None] + np.where(self.forward[:, None], along, along[::-1]))

    def places(self, t: FloatArray) -> FloatArray:
        """Length along the path (n, q) of points at t (q,), 0 to 1 along the path, of its edges [length]."""
        return np.asarray(self.starts[:, None] + self.lengths[:, None] * t)


def turning_senses(vertices: FloatArray, edges: Edges) -> FloatArray:
    """In which sense the shear on each edge counts for the tangential force of a contact, ±1, (n,).

    Tangents point to the right, so that on a line which turns back, such as a round bore, they lead against each other.
    There those count that lead around the middle of the line counterclockwise, and the others against them; but if its
    ends are nearly as far apart as it is long, as on a base with a step, or it turns around nothing, those that lead as
    a tangent from end to end does. On all other lines every edge counts as its tangent leads; so it does on joints,
    whose sides change where the tangent turns back, but for upright edges in a line with others: their sides are left
    and right, not below and above.
    """
    found = np.ones(len(edges))
    if (edges.cells[:, 1] >= 0).any():
        handed = np.sign(cross(edges.tangent, edges.normal))
        for chosen in chains(np.column_stack([edges.first, edges.second])):
            found[chosen] = handed[chosen] * handed[chosen].max()
        return found
    for chosen, walk, chord, turning in _turning_lines(vertices, edges, found):
        straight = np.hypot(*chord) > _STRETCHED or abs(turning) <= _NO_TURN
        found[chosen] = -walk if (points_back(chord[None])[0] if straight else turning < 0.0) else walk
    return found


def enclosed_beyond(vertices: FloatArray, edges: Edges) -> BoolArray:
    """On which edges (n,) of a joint what it goes around is beyond, as on half of a circle.

    Joints that have one body below or to the left of them everywhere go around none. Those that turn around nothing, as
    one with a step in its middle, count as if around what is below or to the left of the way from end to end.
    """
    found = np.zeros(len(edges), dtype=bool)
    for chosen, leads, chord, turning in _turning_lines(vertices, edges, cross(edges.normal, edges.tangent)):
        left = turning > 0.0 if abs(turning) > _NO_TURN else points_back(chord[None] * [1.0, -1.0])[0]
        found[chosen] = (leads < 0.0) == left
    return found


def _turning_lines(
    vertices: FloatArray, edges: Edges, signs: FloatArray
) -> Iterator[tuple[IntArray, FloatArray, FloatArray, float]]:
    """Lines of edges of which tangents times signs (n,) lead against each other.

    Edges (k,); whether tangents times signs lead along the line, ±1 (k,); its chord over its length (2,); twice the
    area that it sweeps around its middle, over its length squared, positive if counterclockwise.
    """
    ends = np.stack([vertices[edges.first], vertices[edges.second]], axis=1)
    path = ContactPath.of(ends, edges.length)
    for own in path.lines:
        chosen, walk = path.edges[own], np.where(path.forward[own], 1.0, -1.0)
        leads, lengths, middles = walk * signs[chosen], path.lengths[own], ends[chosen].mean(axis=1)
        if leads.min() < 0.0 < leads.max():
            steps = walk[:, None] * (ends[chosen, 1] - ends[chosen, 0])
            turning = float(cross(middles - np.average(middles, axis=0, weights=lengths), steps).sum())
            yield chosen, leads, steps.sum(axis=0) / lengths.sum(), turning / float(lengths.sum()) ** 2
