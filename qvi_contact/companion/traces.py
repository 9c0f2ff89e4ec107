"""Contact traces in the displacement model: Bernstein coefficients of v_N and v_T, and the laws at each of them.

On an edge the relative displacement is Σ c_i B_i. Each c is a coefficient of the body, or the difference of two on
a joint, along the edge's normal or tangent; in a corner of the line, between edges of two directions, one for each.
Tangents point to the right: where an arc goes straight up, those of its two edges lead against each other. c_T is one
number there, along one of them, and counts with the other sign on the other edge. On a joint normals and sides of the
edges change there as well, and c_T does not.
A plate driven by force adds its motion: then c is what the body moves beyond it. Forces z conjugate to c are

    z_i = ∫ σ B_i ds = W_i τ_i,   W_i = ∫ B_i ds,

mean tractions τ_i [stress] weighted by the positive B_i. The laws hold for them: c_N ≤ g, τ_N ≤ 0 and |τ_T| ≤ s_i with
s_i = ∫ s B_i ds / W_i, under Coulomb's law min(cohesion + μ_i |τ_N|, cap), μ_i at the coefficient's own point.

Springs along a contact stretch by a polynomial d = Σ d_i B_i of their own, with the energy ½ ∫ k d² ds: c is what they
leave of the displacement, that of the body less d.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.companion.body import MISFIT, PARALLEL, along_arcs, edge_data, load_points, moments
from qvi_contact.companion.space import DisplacementSpace
from qvi_contact.discretization.plates import COMPONENTS, centre_of
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mesh.edges import Edges, frames_along
from qvi_contact.problem.conditions import DRIVES, Contact, Law, RigidPlate
from qvi_contact.problem.fields import along_edges
from qvi_contact.problem.problem import ContactProblem

_OnEdges: TypeAlias = tuple[FloatArray, FloatArray]
"""Normal and tangential coefficients on edges."""


@dataclass(frozen=True, eq=False)
class DisplacementContact:
    """One contact; dimensionless, arrays over its n coefficients unless said otherwise."""

    name: str  # name, law: of the contact
    law: Law
    edges: Edges  # in the mesh's order
    columns: IntArray  # (e, p + 1): coefficients on each edge, numbers below n
    turned: FloatArray  # (e, p + 1): −1 where c_T of a coefficient counts against the edge's tangent, else 1
    places: FloatArray  # (n, 2): where the coefficients sit
    weights: FloatArray  # (n,): W = ∫ B_i ds
    normal: sparse.csr_array  # normal, tangential, (n, size) each: c_N and c_T from the degrees of freedom of the body
    tangential: sparse.csr_array
    # (n,): μ_i, c_i and the cap; cohesion is the whole bound, and μ zero, where the bound is given
    friction: FloatArray
    cohesion: FloatArray
    shear_limit: FloatArray
    gap: FloatArray  # gap, offset, (n,) each: coefficients of g and w
    offset: FloatArray
    # (n,): ∫ p_w B_i ds of the pressure of a fluid in the contact; tractions and laws are effective ones, σ_N + p_w
    fluid: FloatArray
    bound: FloatArray | None  # (e, q): Bernstein coefficients of the given bound s on each edge
    # for each force or moment on a plate what c of the plate itself is when it moves by 1, and the force or moment
    motions: tuple[tuple[str, FloatArray, FloatArray, float], ...]
    moved: FloatArray  # (2, n): what c of the plate itself is under its given motion
    lengths: FloatArray  # (e,): of the edges
    # (n,): ±1 where displacements may slip in one sense only, slipping (c_T − w) ≥ 0; 0 where c_T = w; NaN where they
    # are free
    slipping: FloatArray
    # two (e, p + 1, p + 1): ∫ k_N B_i B_j ds and ∫ k_T B_i B_j ds on each edge, of springs; the latter for c_T as
    # `turned`
    stiffness: tuple[FloatArray | None, FloatArray | None]
    start: int  # its first coefficient among those of all contacts

    @property
    def here(self) -> slice:
        """Its coefficients among those of all contacts."""
        return slice(self.start, self.start + self.count)

    @property
    def count(self) -> int:
        """Number of coefficients n."""
        return len(self.weights)

    def by_coefficient(self, values: FloatArray) -> FloatArray:
        """Values (e,) of edges at the coefficients (n,): of the edge whose tangent a coefficient has."""
        found = np.empty(self.count)
        found[self.columns] = values[:, None]
        return found

    def on_edges(self, normal: FloatArray, tangential: FloatArray) -> _OnEdges:
        """Coefficients (…, n) as those of each edge, (…, e, p + 1), tangential ones along the edge's own tangent."""
        return normal[..., self.columns], self.turned * tangential[..., self.columns]

    @property
    def tied(self) -> BoolArray:
        """Whether the contact is tied, at each coefficient."""
        return np.full(self.count, self.law == "tied")

    def slipping_on(self, edges: FloatArray) -> FloatArray:
        """`slipping` (n,) from what each edge says (e,), along its own tangent; 0 where edges do not agree."""
        here = self.turned * edges[:, None]
        least, most = np.full(self.count, np.inf), np.full(self.count, -np.inf)
        np.minimum.at(least, self.columns, here)
        np.maximum.at(most, self.columns, here)
        return np.where(least == most, least, 0.0)

    @property
    def bilateral(self) -> BoolArray:
        """Whether it keeps its distance, at each coefficient."""
        return np.full(self.count, self.law != "unilateral")


def traces(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, bounds: Mapping[str, FloatArray] | None
) -> tuple[tuple[DisplacementContact, ...], tuple[str, ...]]:
    """The traces of all contacts in the order of the problem, and why their laws are not met exactly."""
    found, reasons, start = [], list[str](), 0
    for contact in problem.contacts:
        bound = None if bounds is None or contact.law == "tied" else bounds[contact.name] / scales.stress
        trace, remarks = _trace(problem, space, scales, contact, bound, start)
        start += trace.count
        found.append(trace)
        reasons += remarks
    return tuple(found), tuple(reasons)


def _trace(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales, contact: Contact, bound: FloatArray | None,
    start: int,
) -> tuple[DisplacementContact, list[str]]:  # fmt: skip
    """The trace of one contact, and why its law is not met exactly."""
    mesh, p, reasons = problem.mesh, space.degree, list[str]()
    edges, joint = mesh.edges(contact.edges), contact in problem.joints
    near = space.along(edges)
    far = space.along(edges, other=True) if joint else near
    sides = np.where(near > far, -1.0, 1.0)
    frames = [sides[..., None] * vectors for vectors in frames_along(edges, np.linspace(0.0, 1.0, p + 1))]
    # pairs (n, 3) of coefficients of the body, the smaller number first, with the number of a direction last: where the
    # normals of a joint turn back the sides of its edges change, normals that lead from the first of a pair do not
    facing = _directions(frames[0].reshape(-1, 2))
    pairs = np.stack([np.minimum(near, far).ravel(), np.maximum(near, far).ravel(), facing], axis=1)
    pairs, columns = np.unique(pairs, axis=0, return_inverse=True)
    columns, n, lengths = columns.reshape(near.shape), len(pairs), edges.length / scales.length
    normals, tangents = np.zeros((2, n, 2))
    normals[columns], tangents[columns] = frames
    turned = np.where((frames[1] * tangents[columns]).sum(axis=2) < 0.0, -1.0, 1.0)
    normal, tangential = (_rows(pairs, vectors, space.size, joint) for vectors in (normals, tangents))
    if edges.curved:
        normal, tangential = (
            _bent_rows(edges, columns, sides, pairs, straight, chords, joint)
            for straight, chords in ((normal, edges.normal), (tangential, edges.tangent))
        )

    places = space.places[pairs[:, 0]]
    line = _OnLine(problem, scales, contact, edges, columns, (normals, tangents), places, reasons)
    weights = line.summed(np.repeat(lengths[:, None] / (p + 1), p + 1, axis=1))
    gap, offset = line.obstacle("gap", np.ones_like(turned)), line.obstacle("offset", turned)
    # The minimum of the means of c and t_max is no less than the mean of their minimum: the energy is an upper bound if
    # the means are exact. A given bound takes the place of both, and of friction.
    friction, limit = np.zeros(n), np.full(n, np.inf)
    if bound is not None:
        mean = bound @ bernstein.product_integrals(bound.shape[1] - 1, p) * lengths[:, None]
        cohesion = np.maximum(line.summed(mean) / weights, 0.0)
    else:
        x, y = (mesh.origin + scales.length * places).T
        friction = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0)
        cohesion = line.moments("cohesion") / weights
        if contact.shear_limit is not None:
            limit = line.moments("shear_limit") / weights
    fluid, motions = line.moments("pore_pressure"), line.motions()
    moved = np.zeros((2, n)) if contact.plate is None else line.moved(contact.plate) / scales.displacement
    trace = DisplacementContact(
        contact.name, contact.law, edges, columns, turned, places, weights, normal, tangential, friction, cohesion,
        limit, gap, offset, fluid, bound, motions, moved, lengths, np.full(n, np.nan),
        (line.stiffness("normal_stiffness", np.ones_like(turned)), line.stiffness("tangential_stiffness", turned)),
        start,
    )  # fmt: skip
    return trace, reasons


@dataclass(frozen=True, eq=False)
class _OnLine:
    """Data of a contact at its n coefficients, with normals and tangents there, and what is not exact of them."""

    problem: ContactProblem
    scales: Scales
    contact: Contact
    edges: Edges
    columns: IntArray
    frames: tuple[FloatArray, FloatArray]
    places: FloatArray
    reasons: list[str]

    @property
    def degree(self) -> int:
        return int(self.columns.shape[1]) - 1

    def summed(self, values: FloatArray) -> FloatArray:
        """Sums (n,) at coefficients of values (e, p + 1) on edges."""
        found = np.bincount(self.columns.ravel(), values.ravel(), minlength=len(self.places))
        return np.asarray(found, dtype=np.float64)

    def moments(self, kind: str) -> FloatArray:
        """∫ f B_i ds (n,) of a datum over S, dimensionless."""
        field, stress, points = getattr(self.contact, kind), self.scales.stress, load_points(self.degree)
        given = along_edges(self.problem.mesh, self.edges, f"Contact.{kind}", field, points, minimum=0.0)
        if given.error > MISFIT * max(stress, float(np.abs(given.values).max(initial=0.0))):
            self.reasons.append(
                f"The {kind.replace('_', ' ')} of {self.contact.name!r} jumps or grows steeply. Quadrature leaves an "
                f"error of {given.error:.2g} [stress] times an edge's length."
            )
        lengths = (self.edges.length / (self.scales.length * stress))[:, None]
        return self.summed(lengths * moments(given, self.degree))

    def stiffness(self, kind: str, signs: FloatArray) -> FloatArray | None:
        """∫ k B_i B_j ds (e, p + 1, p + 1) of springs, dimensionless, with the signs (e, p + 1) of the coefficients."""
        field = getattr(self.contact, kind)
        if field is None:
            return None
        t, weights = gauss_legendre(load_points(self.degree))
        k = evaluate(f"Contact.{kind}", field, *self.problem.mesh.points_along(self.edges, t), minimum=0.0)
        k = k * (self.scales.compliance * self.edges.length[:, None] * weights)
        shape = signs[:, None] * bernstein.basis(self.degree, t)
        return np.asarray((k[..., None] * shape).swapaxes(1, 2) @ shape)

    def obstacle(self, kind: str, signs: FloatArray) -> FloatArray:
        """Coefficients (n,) of the gap or offset, signs (e, p + 1) on edges; at a jump between them the smaller one."""
        p, unit, contact = self.degree, self.scales.displacement, self.contact
        data, misfit = edge_data(self.problem, self.edges, f"Contact.{kind}", getattr(contact, kind), p, unit)
        own, least = signs * data, np.full(len(self.places), np.inf)
        np.minimum.at(least, self.columns, own)
        if contact.law != "unilateral" or kind == "offset":
            misfit = max(misfit, float(np.abs(least[self.columns] - own).max(initial=0.0)))
        if misfit > MISFIT * max(1.0, float(np.abs(least).max(initial=0.0))):
            self.reasons.append(
                f"The {kind} of {contact.name!r} is not a continuous polynomial of degree {p} on each edge. "
                f"It is interpolated, with an error of up to {misfit * unit:.2g} [length]."
            )
        return least

    def moved(self, plate: RigidPlate) -> FloatArray:
        """Coefficients (2, n) of the given motion of a plate along normals and tangents [length]."""
        mesh, edges = self.problem.mesh, self.edges
        field = plate.displacement(*(mesh.origin + self.scales.length * self.places).T).T
        found = np.stack([(vectors * field).sum(axis=1) for vectors in self.frames])
        if edges.curved:
            t, back = bernstein.nodes(self.degree), bernstein.from_values(self.degree)
            on_arcs = np.moveaxis(plate.displacement(*mesh.points_along(edges, t)), 0, -1)
            for values, vectors in zip(found, frames_along(edges, t), strict=True):
                values[self.columns] = (vectors * on_arcs).sum(axis=-1) @ back.T
        return found

    def motions(self) -> tuple[tuple[str, FloatArray, FloatArray, float], ...]:
        """What each force or moment on a plate drives; moments count from `RigidPlate.reference`."""
        plate, found = self.contact.plate, []
        for component in COMPONENTS if plate is not None else ():
            if plate is not None and getattr(plate, component) is not None:
                centre, moment = centre_of(self.problem, self.edges), component == "moment"
                given = plate.moment_about(*centre) if moment else float(getattr(plate, component))
                motion = {DRIVES[component]: 1.0 / self.scales.length if moment else 1.0}
                normal, tangential = self.moved(RigidPlate(pivot=plate.reference(*centre), **motion))
                size = self.scales.stress * self.scales.length ** (2 if moment else 1)
                found.append((component, normal, tangential, given / size))
        return tuple(found)


def _directions(vectors: FloatArray) -> IntArray:
    """Numbers of the different directions of unit vectors (e, 2); those `PARALLEL` to each other have the same."""
    angle = np.arctan2(vectors[:, 1], vectors[:, 0])
    order = np.argsort(angle, kind="stable")
    steps = np.diff(angle[order], append=angle[order[:1]] + 2.0 * np.pi)
    apart = np.roll(steps > PARALLEL, 1)  # from the one before, the last one before the first
    number: IntArray = np.empty(len(angle), dtype=np.int64)
    number[order] = (np.cumsum(apart) - apart[0]) % max(int(apart.sum()), 1)
    return number


def _rows(pairs: IntArray, vectors: FloatArray, size: int, joint: bool) -> sparse.csr_array:
    """(n, size): the components along vectors (n, 2) of the first of each pair, on a joint less those of the second."""
    number, found = np.repeat(np.arange(len(pairs)), 2), sparse.csr_array((len(pairs), size))
    for side, sign in ((0, 1.0), (1, -1.0))[: 1 + joint]:
        dofs = 2 * pairs[:, [side]] + np.arange(2)
        found = found + sparse.csr_array((sign * vectors.ravel(), (number, dofs.ravel())), shape=found.shape)
    found.eliminate_zeros()
    return sparse.csr_array(found)


def _bent_rows(
    edges: Edges,
    columns: IntArray,
    sides: FloatArray,
    pairs: IntArray,
    straight: sparse.csr_array,
    chords: FloatArray,
    joint: bool,
) -> sparse.csr_array:
    """The rows with those inside arcs replaced by components along vectors (e, 2) of the chords, see `along_arcs`.

    Sides (e, p + 1) are 1 where the body's side of the edge is the first of a pair, −1 where it is the second.
    """
    bent = np.flatnonzero(edges.bent)
    factors = sides[bent, None, :, None] * along_arcs(edges.take(bent), chords[bent], columns.shape[1] - 1)
    chosen = columns[bent]
    row = np.broadcast_to(chosen[:, 1:-1, None, None], factors.shape)
    whole = np.ones(straight.shape[0])
    whole[chosen[:, 1:-1]] = 0.0
    found = sparse.diags_array(whole) @ straight
    for side, sign in ((0, 1.0), (1, -1.0))[: 1 + joint]:
        dofs = 2 * pairs[chosen, side][:, None, :, None] + np.arange(2)
        at = (row.ravel(), np.broadcast_to(dofs, factors.shape).ravel())
        found = found + sign * sparse.csr_array((factors.ravel(), at), shape=straight.shape)
    return sparse.csr_array(found)
