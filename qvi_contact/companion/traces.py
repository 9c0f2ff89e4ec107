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
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate, real_array
from qvi_contact.companion.data import MISFIT, PARALLEL, along_arcs, edge_data, edge_moments
from qvi_contact.companion.space import Space
from qvi_contact.discretization.plates import COMPONENTS
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges, frames_along
from qvi_contact.problem.conditions import DRIVES, Contact, Law, RigidPlate
from qvi_contact.problem.problem import ContactProblem
from solvers.basics.names import known_name

_PLACES: FloatArray = np.concatenate([[0.0], bernstein.SAMPLES, [1.0]])


_Frames: TypeAlias = tuple[FloatArray, FloatArray]
"""Normals and tangents at coefficients, (n, 2) each."""

_OnEdges: TypeAlias = tuple[FloatArray, FloatArray]
"""Normal and tangential coefficients on edges."""


@dataclass(frozen=True, eq=False)
class Trace:
    """One contact; dimensionless, arrays over its n coefficients unless said otherwise.

    Attributes
    ----------
    name, law
        Of the contact.
    edges : Edges
        In the mesh's order.
    columns : (e, p + 1) int array
        Coefficients on each edge, numbers below n.
    turned : (e, p + 1) array
        −1 where c_T of a coefficient counts against the edge's tangent, else 1.
    places : (n, 2) array
        Where the coefficients sit.
    weights : (n,) array
        W = ∫ B_i ds.
    normal, tangential : (n, size) sparse arrays
        c_N and c_T from the degrees of freedom of the body.
    friction, cohesion, shear_limit : (n,) arrays
        μ_i, c_i and the cap; cohesion is the whole bound, and μ zero, where the bound is given.
    gap, offset : (n,) arrays
        Coefficients of g and w.
    fluid : (n,) array
        ∫ p_w B_i ds of the pressure of a fluid in the contact; tractions and laws are effective ones, σ_N + p_w.
    bound : (e, q) array or None
        Bernstein coefficients of the given bound s on each edge.
    motions : tuple of (component, normal (n,), tangential (n,), resultant)
        For each force or moment on a plate what c of the plate itself is when it moves by 1, and the force or moment.
    moved : (2, n) array
        What c of the plate itself is under its given motion.
    lengths : (e,) array
        Of the edges.
    slipping : (n,) array
        ±1 where displacements may slip in one sense only, slipping (c_T − w) ≥ 0; 0 where c_T = w; NaN where they are
        free.

    """

    name: str
    law: Law
    edges: Edges
    columns: IntArray
    turned: FloatArray
    places: FloatArray
    weights: FloatArray
    normal: sparse.csr_array
    tangential: sparse.csr_array
    friction: FloatArray
    cohesion: FloatArray
    shear_limit: FloatArray
    gap: FloatArray
    offset: FloatArray
    fluid: FloatArray
    bound: FloatArray | None
    motions: tuple[tuple[str, FloatArray, FloatArray, float], ...]
    moved: FloatArray
    lengths: FloatArray
    slipping: FloatArray

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
    problem: ContactProblem, space: Space, scales: Scales, bounds: Mapping[str, ArrayLike] | None
) -> tuple[tuple[Trace, ...], tuple[str, ...]]:
    """The traces of all contacts in the order of the problem, and why their laws are not met exactly."""
    given = checked_bounds(problem, bounds)
    found, reasons = [], list[str]()
    for contact in problem.contacts:
        bound = given.get(contact.name)
        trace, remarks = _trace(problem, space, scales, contact, None if bound is None else bound / scales.stress)
        found.append(trace)
        reasons += remarks
    return tuple(found), tuple(reasons)


def checked_bounds(problem: ContactProblem, bounds: Mapping[str, ArrayLike] | None) -> dict[str, FloatArray]:
    """Given friction bounds (edges, q) by contact [stress]; those of tied contacts are left out.

    Raises
    ------
    InputError
        If a name is unknown or missing, a shape is another one, or a bound is not a number or negative somewhere.

    """
    if bounds is None:
        return {}
    if not isinstance(bounds, Mapping):
        raise InputError(
            "bounds", bounds, "give a mapping from names of contacts to arrays (edges, coefficients), or nothing"
        )
    known = [contact.name for contact in problem.contacts]
    for name in bounds:
        known_name("bounds", name, {"contacts": known})
    found = {}
    for contact in problem.contacts:
        if contact.law == "tied":
            continue
        if contact.name not in bounds:
            raise InputError("bounds", contact.name, "give a bound for every contact that is not tied")
        found[contact.name] = _checked_bound(problem, contact, bounds[contact.name])
    return found


def _checked_bound(problem: ContactProblem, contact: Contact, bound: ArrayLike) -> FloatArray:
    field = f"bounds[{contact.name!r}]"
    values = real_array(field, bound, "give an array of real numbers")
    count = len(problem.mesh.edges(contact.edges))
    if values.ndim != 2 or values.shape[0] != count or not values.shape[1]:
        remedy = f"give Bernstein coefficients, one row for each of the {count} edges"
        raise InputError(field, f"shape {values.shape}", remedy)
    if not np.isfinite(values).all():
        raise InputError(field, "NaN or infinity", "give finite numbers")
    if _least(values) < -1e-12 * np.abs(values).max(initial=0.0):
        raise InputError(field, float(values.min()), "give a bound that is ≥ 0 all along each edge")
    return values


def _least(values: FloatArray) -> float:
    """The smallest value of polynomials (edges, q): exact up to degree 2, of others at points."""
    quadratic = values.shape[1] == 3
    at_places = (
        -bernstein.largest_quadratic(-values) if quadratic else values @ bernstein.basis(values.shape[1] - 1, _PLACES).T
    )
    return float(at_places.min(initial=0.0))


def _trace(
    problem: ContactProblem, space: Space, scales: Scales, contact: Contact, bound: FloatArray | None
) -> tuple[Trace, list[str]]:
    mesh, p = problem.mesh, space.degree
    edges = mesh.edges(contact.edges)
    joint = contact in problem.joints
    near = space.along(edges)
    far = space.along(edges, other=True) if joint else near
    sides = np.where(near > far, -1.0, 1.0)
    frames = [sides[..., None] * vectors for vectors in frames_along(edges, np.linspace(0.0, 1.0, p + 1))]
    pairs, columns = _numbered(near, far, frames[0])
    n, lengths = len(pairs), edges.length / scales.length
    normals, tangents = (_by_coefficient(columns, n, vectors) for vectors in frames)
    turned = np.where((frames[1] * tangents[columns]).sum(axis=2) < 0.0, -1.0, 1.0)
    normal, tangential = (_rows(pairs, vectors, space.size, joint) for vectors in (normals, tangents))
    if edges.curved:
        bend = _Bend(edges, columns, sides, pairs, p)
        normal, tangential = bend.rows(normal, edges.normal, joint), bend.rows(tangential, edges.tangent, joint)
    weights = _sums(columns, n, np.repeat(lengths[:, None] / (p + 1), p + 1, axis=1))
    reasons: list[str] = []
    gap = _obstacle(problem, space, scales, contact, edges, columns, np.ones_like(turned), "gap", reasons)
    offset = _obstacle(problem, space, scales, contact, edges, columns, turned, "offset", reasons)
    places = space.places[pairs[:, 0]]
    law = _law(problem, scales, contact, edges, columns, places, weights, lengths, p, bound, reasons)
    friction, cohesion, limit = law
    fluid = _fluid(problem, scales, contact, edges, columns, lengths, p, reasons)
    motions = _motions(problem, scales, contact, columns, places, (normals, tangents))
    moved = _moved(problem, scales, contact, columns, places, (normals, tangents))
    trace = Trace(
        contact.name, contact.law, edges, columns, turned, places, weights, normal, tangential,
        friction, cohesion, limit, gap, offset, fluid, bound, motions, moved, lengths, np.full(n, np.nan),
    )  # fmt: skip
    return trace, reasons


def _numbered(near: IntArray, far: IntArray, normals: FloatArray) -> tuple[IntArray, IntArray]:
    """Coefficients of the body that make one of the contact, and where they are on edges: pairs (n, 3), (e, p + 1).

    A pair has the smaller number first, and the number of a direction last. Where the normals of a joint turn back the
    sides of its edges change: normals (e, p + 1, 2) that lead from the first of each pair do not.
    """
    facing = _directions(normals.reshape(-1, 2))
    pairs = np.stack([np.minimum(near, far).ravel(), np.maximum(near, far).ravel(), facing], axis=1)
    found, columns = np.unique(pairs, axis=0, return_inverse=True)
    return found, columns.reshape(near.shape)


def _directions(vectors: FloatArray) -> IntArray:
    """Numbers of the different directions of unit vectors (e, 2); those `PARALLEL` to each other have the same."""
    angle = np.arctan2(vectors[:, 1], vectors[:, 0])
    order = np.argsort(angle, kind="stable")
    steps = np.diff(angle[order], append=angle[order[:1]] + 2.0 * np.pi)
    apart = np.roll(steps > PARALLEL, 1)  # from the one before, the last one before the first
    number: IntArray = np.empty(len(angle), dtype=np.int64)
    number[order] = (np.cumsum(apart) - apart[0]) % max(int(apart.sum()), 1)
    return number


def _by_coefficient(columns: IntArray, n: int, vectors: FloatArray) -> FloatArray:
    """Vectors at the coefficients of edges (e, p + 1, 2) as those of the coefficients (n, 2)."""
    found = np.zeros((n, 2))
    found[columns] = vectors
    return found


@dataclass(frozen=True, eq=False)
class _Bend:
    """Components along arcs, see `along_arcs`.

    Attributes
    ----------
    edges, columns, degree
        The edges, their coefficients (e, p + 1), and p.
    sides : (e, p + 1) array
        1 where the body's side of the edge is the first of a pair, −1 where it is the second.
    pairs : (n, 3) int array
        Coefficients of the body on both sides, see `_rows`.

    """

    edges: Edges
    columns: IntArray
    sides: FloatArray
    pairs: IntArray
    degree: int

    def rows(self, straight: sparse.csr_array, vectors: FloatArray, joint: bool) -> sparse.csr_array:
        """Rows (n, size) along vectors (e, 2) of the chords, those inside arcs in the place of the given ones."""
        bent = np.flatnonzero(self.edges.bent)
        factors = self.sides[bent, None, :, None] * along_arcs(self.edges.take(bent), vectors[bent], self.degree)
        columns = self.columns[bent]
        row = np.broadcast_to(columns[:, 1:-1, None, None], factors.shape)
        whole = np.ones(straight.shape[0])
        whole[columns[:, 1:-1]] = 0.0
        found = sparse.diags_array(whole) @ straight
        for side, sign in ((0, 1.0), (1, -1.0))[: 1 + joint]:
            dofs = 2 * self.pairs[columns, side][:, None, :, None] + np.arange(2)
            at = (row.ravel(), np.broadcast_to(dofs, factors.shape).ravel())
            found = found + sign * sparse.csr_array((factors.ravel(), at), shape=straight.shape)
        return sparse.csr_array(found)


def _sums(columns: IntArray, n: int, values: FloatArray) -> FloatArray:
    return np.asarray(np.bincount(columns.ravel(), values.ravel(), minlength=n), dtype=np.float64)


def _rows(pairs: IntArray, vectors: FloatArray, size: int, joint: bool) -> sparse.csr_array:
    """(n, size): the components along vectors (n, 2) of the first of each pair, on a joint less those of the second."""
    shape, number = (len(pairs), size), np.repeat(np.arange(len(pairs)), 2)

    def part(side: int) -> sparse.csr_array:
        dofs = 2 * pairs[:, [side]] + np.arange(2)
        return sparse.csr_array((vectors.ravel(), (number, dofs.ravel())), shape=shape)

    rows = sparse.csr_array(part(0) - part(1)) if joint else part(0)
    rows.eliminate_zeros()
    return rows


def _obstacle(
    problem: ContactProblem,
    space: Space,
    scales: Scales,
    contact: Contact,
    edges: Edges,
    columns: IntArray,
    signs: FloatArray,
    kind: str,
    reasons: list[str],
) -> FloatArray:
    """Coefficients (n,) of the gap or offset, signs (e, p + 1) on edges; at a jump between edges the smaller one."""
    field: Field = getattr(contact, kind)
    data = edge_data(problem, edges, f"Contact.{kind}", field, space.degree, scales.displacement)
    coefficients = signs * data.coefficients
    least = np.full(int(columns.max()) + 1, np.inf)
    np.minimum.at(least, columns, coefficients)
    size = max(1.0, float(np.abs(least).max(initial=0.0)))
    misfit = data.misfit
    if contact.law != "unilateral" or kind == "offset":
        misfit = max(misfit, float(np.abs(least[columns] - coefficients).max(initial=0.0)))
    if misfit > MISFIT * size:
        reasons.append(
            f"The {kind} of {contact.name!r} is not a continuous polynomial of degree {space.degree} on each edge. "
            f"It is interpolated, with an error of up to {misfit * scales.displacement:.2g} [length]."
        )
    return least


def _law(
    problem: ContactProblem,
    scales: Scales,
    contact: Contact,
    edges: Edges,
    columns: IntArray,
    places: FloatArray,
    weights: FloatArray,
    lengths: FloatArray,
    degree: int,
    bound: FloatArray | None,
    reasons: list[str],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """μ, cohesion and cap at the coefficients; a given bound takes the place of all three.

    The minimum of the means of c and t_max is no less than the mean of their minimum: the energy is an upper bound if
    the means are exact. Data of which 99 points of an edge show that they are not are named in `reasons`.
    """
    n, mesh = len(weights), problem.mesh
    none = np.full(n, np.inf)
    if bound is not None:
        mean = bound @ bernstein.product_integrals(bound.shape[1] - 1, degree) * lengths[:, None]
        return np.zeros(n), np.maximum(_sums(columns, n, mean) / weights, 0.0), none
    x, y = (mesh.origin + scales.length * places).T
    friction = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0)

    def mean_of(kind: str, field: Field) -> FloatArray:
        if not callable(field):
            return np.full(n, float(field) / scales.stress)
        moments = edge_moments(problem, edges, f"Contact.{kind}", field, degree, scales.stress, minimum=0.0)
        reasons.extend(moments.reason(f"The {kind} of {contact.name!r}", scales))
        return _sums(columns, n, lengths[:, None] * moments.values) / weights

    cohesion = mean_of("cohesion", contact.cohesion)
    limit = none if contact.shear_limit is None else mean_of("shear_limit", contact.shear_limit)
    return friction, cohesion, limit


def _fluid(
    problem: ContactProblem,
    scales: Scales,
    contact: Contact,
    edges: Edges,
    columns: IntArray,
    lengths: FloatArray,
    degree: int,
    reasons: list[str],
) -> FloatArray:
    """∫ p_w B_i ds (n,) of the pressure of a fluid."""
    field = contact.pore_pressure
    n = int(columns.max()) + 1
    if not callable(field):
        return _sums(columns, n, np.repeat(lengths[:, None], degree + 1, axis=1)) * (
            float(field) / scales.stress / (degree + 1)
        )
    moments = edge_moments(problem, edges, "Contact.pore_pressure", field, degree, scales.stress, minimum=0.0)
    reasons.extend(moments.reason(f"The pore pressure of {contact.name!r}", scales))
    return _sums(columns, n, lengths[:, None] * moments.values)


def _motions(
    problem: ContactProblem, scales: Scales, contact: Contact, columns: IntArray, places: FloatArray, frames: _Frames
) -> tuple[tuple[str, FloatArray, FloatArray, float], ...]:
    """What each force or moment on a plate drives; moments count from `RigidPlate.reference`."""
    plate = contact.plate
    if plate is None:
        return ()
    edges = problem.mesh.edges(contact.edges)
    centre = plate_centre(problem, edges)
    middle = plate.reference(*centre)
    found = []
    for component in COMPONENTS:
        if getattr(plate, component) is None:
            continue
        moment = component == "moment"
        given = plate.moment_about(*centre) if moment else float(getattr(plate, component))
        size = scales.stress * scales.length ** (2 if moment else 1)
        unit = RigidPlate(pivot=middle, **{DRIVES[component]: 1.0 / scales.length if moment else 1.0})
        normal, tangential = _along_edges(problem, scales, edges, columns, places, frames, unit)
        found.append((component, normal, tangential, given / size))
    return tuple(found)


def _moved(
    problem: ContactProblem, scales: Scales, contact: Contact, columns: IntArray, places: FloatArray, frames: _Frames
) -> FloatArray:
    """What c of a plate is under its given motion (2, n)."""
    if contact.plate is None:
        return np.zeros((2, len(places)))
    edges = problem.mesh.edges(contact.edges)
    return _along_edges(problem, scales, edges, columns, places, frames, contact.plate) / scales.displacement


def _along_edges(
    problem: ContactProblem,
    scales: Scales,
    edges: Edges,
    columns: IntArray,
    places: FloatArray,
    frames: _Frames,
    plate: RigidPlate,
) -> FloatArray:
    """Coefficients (2, n) of the given motion of a plate along normals and tangents [length]."""
    field = plate.displacement(*(problem.mesh.origin + scales.length * places).T).T
    found = np.stack([(vectors * field).sum(axis=1) for vectors in frames])
    if edges.curved:
        p = columns.shape[1] - 1
        on_arcs = np.moveaxis(plate.displacement(*problem.mesh.points_along(edges, bernstein.nodes(p))), 0, -1)
        for values, vectors in zip(found, frames_along(edges, bernstein.nodes(p)), strict=True):
            values[columns] = (vectors * on_arcs).sum(axis=-1) @ bernstein.from_values(p).T
    return found


def plate_centre(problem: ContactProblem, edges: Edges) -> tuple[float, float]:
    """Centre of a contact's line [length]."""
    lengths = edges.length
    x, y = problem.mesh.points_along(edges, np.array([0.5]))
    return float(np.average(x[:, 0], weights=lengths)), float(np.average(y[:, 0], weights=lengths))
