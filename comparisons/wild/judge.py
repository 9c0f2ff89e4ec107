"""Test whether a stress state is a solution, from sampled stresses and the problem's data alone.

`ContactResult.stress` is sampled in the thirds into which its barycentre divides every triangle. In each third the
stress less the body potential is a polynomial of degree p − 2, which the samples determine; all tests evaluate these
polynomials. On a side that is an arc they are extrapolated.

| what               | checked                                                                                      |
|--------------------|----------------------------------------------------------------------------------------------|
| equilibrium        | div (σ − φ 1) = 0 in every third, the tractions of neighbours agree along their common sides |
| prescribed         | force of every edge with a given traction, and its moment if the traction is a number        |
| plates             | force and moment of every plate                                                              |
| law                | σ_N' ≤ 0 and |σ_T| ≤ min(c + μ|σ_N'|, t_max) at the points of the result; σ_N' is σ_N plus    |
|                    | the fluid pressure that the result used                                                      |
| fluid              | its pressure has the given force on every edge; a remark says if it differs at points        |
| reported           | the tractions reported on contacts are those of the sampled stresses                         |
| compatibility      | no stress with the same friction bounds has less complementary energy, see `compare`         |
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Final

import numpy as np
from scipy.integrate import quad_vec
from scipy.optimize import Bounds, LinearConstraint, milp

from qvi_contact import ContactProblem, ContactResult, Displacement, Traction
from qvi_contact.basics.checks import Field, FloatArray
from qvi_contact.mesh.edges import Edges, cross, frames_along, vectors_along
from qvi_contact.problem.problem import Prescribed
from solvers import FrictionQVI
from solvers.certificate.certificate import scales_at
from solvers.inequality.problem import Compliance

_DISTANCE: Final = 1e-3
"""Relative distance in the energy norm below which two states agree: errors of 1e-8 in energy allow 1e-4."""

_BROKEN: Final = 1e-3
"""Violation of the law, over the largest traction of both states, up to which the second state is compared."""

_TOLERANCE: Final = 1e-6
"""Accepted error, relative to the largest stress of the body."""

_SAID: Final = 4.0
"""Accepted error beyond this, over `ContactResult.stress_rounding`, the rounding that the result reports."""

_INTEGRATED, _INTERVALS = 1e-9, 1000  # relative accuracy of integrals along edges, and most intervals for it
_NOTHING: Final = 1e-6  # stresses below this share of the stress that the data suggest are zero
_ZERO: Final = 1e-14  # eigenvalues of the compliance below this share of the largest are zero
_REST: Final = 1e-6  # strain that gives the stress where the data suggest none; for ν → −1 far more than E times it
_INSIDE: Final = {False: 0.9, True: 0.5}  # reach of samples from the barycentre to the sides, which arcs bend inwards
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _WEIGHTS = (_NODES + 1.0) / 2.0, _WEIGHTS / 2.0


def _values(field: Field, x: FloatArray, y: FloatArray) -> FloatArray:
    return np.array(np.broadcast_to(np.asarray(field(x, y) if callable(field) else field, dtype=float), np.shape(x)))


def floor(problem: ContactProblem) -> float:
    """A stress that counts as zero: 1e-6 of the largest that loads, supports and pushed obstacles suggest."""
    mesh = problem.mesh
    # an incompressible body is not compressed by any pressure
    known = [np.linalg.eigvalsh(material.compliance) for material in problem.materials]
    stiffest = max(1.0 / float(each[each > _ZERO * each.max()].min()) for each in known)
    stresses, moves = [_REST / _NOTHING * stiffest], [0.0]
    for kind, sizes in ((Traction, stresses), (Displacement, moves)):
        for given in problem.prescribed(kind):
            sizes.append(float(np.abs(_values(given.value, *mesh.points_along(given.edges, _NODES))).max()))
    for contact in problem.contacts:
        edges = mesh.edges(contact.edges)
        points = mesh.points_along(edges, _NODES)
        gap, offset = (_values(value, *points) for value in (contact.gap, contact.offset))
        stresses.append(float(_values(contact.pore_pressure, *points).max()))
        pushed = -gap if contact.law == "unilateral" else np.abs(gap)
        moves += [float(pushed.max()), float(np.abs(offset).max())]
        if contact.plate is not None:
            length = float(edges.length.sum())
            stresses += [abs(force or 0.0) / length for force in (contact.plate.force_x, contact.plate.force_y)]
    return _NOTHING * max(*stresses, stiffest * max(moves) / mesh.length)


class Samples:
    """Stresses less the body potential, as polynomials in each third of every triangle.

    The third s lies at the side opposite to corner s, with the ends a and b of this side and the barycentre c. Its
    coordinates are r, t of x = c + r (a − c) + t (b − c). `coefficients` are (cells, 3 thirds, monomials of r and t, 3
    components) [stress].
    """

    def __init__(self, result: ContactResult, degree: int) -> None:
        self.problem, mesh, power = result.problem, result.problem.mesh, degree - 2
        self._powers = np.array([(i, total - i) for total in range(power + 1) for i in range(total, -1, -1)])
        corners = mesh.vertices[mesh.cells]
        self.centre = np.broadcast_to(corners.mean(axis=1)[:, None], corners.shape)
        sides = np.stack([np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)], axis=3)
        self.sides = sides - self.centre[..., None]  # a − c and b − c, (cells, 3, 2 components, 2)
        self.frame = np.linalg.inv(self.sides)  # rows: gradients of r and t
        places = (self._powers + 0.4) / (power + 1.2) * _INSIDE[bool(mesh.arcs)]
        x, y = np.moveaxis(self.centre[:, :, None] + np.einsum("csdk,qk->csqd", self.sides, places), -1, 0)
        stress = np.asarray(result.stress(x.ravel(), y.ravel())).reshape(*x.shape, 3) - self._potential(x, y)
        self.coefficients = np.einsum("mq,csqk->csmk", np.linalg.inv(self._monomials(places)), stress)

    def _monomials(self, places: FloatArray) -> FloatArray:
        """The monomials at points r, t (..., 2)."""
        return np.asarray(np.prod(places[..., None, :] ** self._powers, axis=-1))

    def _potential(self, x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(_values(self.problem.body_potential, x, y)[..., None] * np.array([1.0, 1.0, 0.0]))

    def inside(self, places: FloatArray, slope: int | None = None) -> FloatArray:
        """Stresses (cells, 3, q, 3) at points r, t (q, 2), or their derivatives by r (`slope` 0) or t (`slope` 1)."""
        monomials = self._monomials(places)
        if slope is not None:
            lower = np.maximum(self._powers - np.eye(2, dtype=int)[slope], 0)
            monomials = self._powers[:, slope] * np.prod(places[:, None] ** lower, axis=2)
        return np.asarray(np.einsum("qm,csmk->csqk", monomials, self.coefficients))

    @cached_property
    def largest(self) -> float:
        """The largest stress component at points of all thirds, at least `floor` [stress]."""
        found = self.inside(np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5), (1 / 3, 1 / 3)]))
        return max(float(np.abs(found).max()), floor(self.problem))

    def on(self, edges: Edges, s: FloatArray, beyond: bool = False) -> FloatArray:
        """Stresses (n, q, 3) at reference points s of edges, in their first cell, or in the second if `beyond`."""
        mesh, cells = self.problem.mesh, edges.cells[:, int(beyond)]
        corners = mesh.cells[cells]
        side = np.argmax((corners != edges.first[:, None]) & (corners != edges.second[:, None]), axis=1)
        x, y = mesh.points_along(edges, s)
        offset = np.stack([x, y], axis=-1) - self.centre[cells, side][:, None]
        monomials = self._monomials(np.einsum("nkd,nqd->nqk", self.frame[cells, side], offset))
        found = np.einsum("nqm,nmk->nqk", monomials, self.coefficients[cells, side])
        return np.asarray(found + self._potential(x, y))


def tractions(normals: FloatArray, stress: FloatArray) -> FloatArray:
    """σn (..., 2) from n and σ at points, (..., 2) and (..., 3)."""
    x, y = np.moveaxis(normals, -1, 0)
    xx, yy, xy = np.moveaxis(stress, -1, 0)
    return np.stack([xx * x + xy * y, xy * x + yy * y], axis=-1)


def wrong(result: ContactResult, degree: int = 4) -> list[str]:
    """The violated conditions of a state that is called solved, in words; `compare` tests compatibility."""
    samples = Samples(result, degree)
    if not np.isfinite(samples.coefficients).all():
        return ["stresses are not finite"]
    stresses = (_equilibrium(samples), _prescribed(samples), _plates(samples))
    contacts = (_laws(samples, result), _fluids(samples, result))
    allowed = _TOLERANCE + _SAID * _relative(result.stress_rounding, samples.largest)
    return [f"{name}: {error:.1e}" for name, error in chain(*stresses, *contacts) if not error <= allowed]


def _relative(error: FloatArray | float, size: float) -> float:
    """The largest error over `size`; 0 if the error is 0, also for size 0."""
    largest = float(np.abs(error).max(initial=0.0))
    return largest / size if largest > 0.0 else 0.0


def _missed(edges: Edges, error: FloatArray) -> FloatArray:
    """Errors of tractions (n, q, 2) at `_NODES` of straight edges, errors of the force of each arc, in one array."""
    bent = edges.bent
    return np.concatenate([error[~bent].ravel(), np.einsum("nqk,q->nk", error[bent], _WEIGHTS).ravel()])


def _equilibrium(samples: Samples) -> Iterator[tuple[str, float]]:
    """Errors of equilibrium inside thirds, and jumps of tractions across their sides, over the largest stress."""
    places = np.array([(0.1, 0.1), (0.7, 0.1), (0.1, 0.7), (0.4, 0.4), (1 / 3, 1 / 3)])
    slopes = np.stack([samples.inside(places, which) for which in (0, 1)])
    xx, yy, xy = np.moveaxis(np.einsum("csid,icsqk->csqkd", samples.frame, slopes), 3, 0)
    size = np.linalg.norm(samples.sides, axis=2).min(axis=2) / 2.0
    thin = 1.0 / np.linalg.norm(samples.frame, axis=(2, 3))  # about the height of the third: unit of derivatives
    for name, divergence in (("x", xx[..., 0] + xy[..., 1]), ("y", xy[..., 0] + yy[..., 1])):
        yield f"equilibrium along {name}", _relative(divergence * np.minimum(size, thin)[..., None], samples.largest)
    # the corner b of one third is the corner a of the next
    s = np.array([(0.1, 0.0), (0.4, 0.0), (0.8, 0.0)])
    jump = samples.inside(s[:, ::-1]) - np.roll(samples.inside(s), -1, axis=1)
    along = samples.sides[..., 1]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / np.linalg.norm(along, axis=-1, keepdims=True)
    normals = np.broadcast_to(normal[:, :, None], (*jump.shape[:3], 2))
    yield "tractions inside triangles", _relative(tractions(normals, jump), samples.largest)
    inside = samples.problem.mesh.interior
    jump = samples.on(inside, _NODES) - samples.on(inside, _NODES, beyond=True)
    yield (
        "tractions of neighbours",
        _relative(_missed(inside, tractions(frames_along(inside, _NODES)[0], jump)), samples.largest),
    )


def _integral(of: Callable[[float], FloatArray]) -> FloatArray:
    return np.asarray(quad_vec(of, 0.0, 1.0, epsrel=_INTEGRATED, limit=_INTERVALS)[0])


def _prescribed(samples: Samples) -> Iterator[tuple[str, float]]:
    """Errors of the force on every edge, and of the moment if the traction is a number, over the largest stress.

    On arcs only where both components are given: the model prescribes the force of the edge, not components at points.
    """
    mesh = samples.problem.mesh
    missed, given_there = np.zeros((len(mesh.boundary), 2)), np.zeros(len(mesh.boundary), dtype=int)
    for given in samples.problem.prescribed(Traction):
        edges, straight, index = given.edges, ~given.edges.bent, mesh.edge_set(given.condition.edges)
        direction = vectors_along(edges, given.direction, _NODES, turns=given.turns)
        normals, _ = frames_along(edges, _NODES)
        found = (tractions(normals, samples.on(edges, _NODES)) * direction).sum(axis=2)

        def along(t: float, given: Prescribed = given) -> FloatArray:
            """The prescribed component at t of every edge, times its direction, (n, 2)."""
            s = np.array([t])
            turned = vectors_along(given.edges, given.direction, s, turns=given.turns)[:, 0]
            return _values(given.value, *mesh.points_along(given.edges, s)) * turned

        # a function may jump or have kinks: adaptive quadrature
        varies = callable(given.value) or edges.curved
        wanted = _integral(along) if varies else np.asarray(given.value * given.direction)  # type: ignore[operator]
        force = np.einsum("nq,nqk,q->nk", found, direction, _WEIGHTS) - wanted
        missed[index] += force
        given_there[index] += 1
        yield f"prescribed {given.name}", _relative(np.hypot(*force[straight].T), samples.largest)
        if not callable(given.value):
            moment = (found - given.value)[straight] @ (_WEIGHTS * (_NODES - 0.5))
            yield f"moment of {given.name}", _relative(moment, samples.largest)
    yield "prescribed tractions on arcs", _relative(missed[(given_there == 2) & mesh.boundary.bent], samples.largest)


def _plates(samples: Samples) -> Iterator[tuple[str, float]]:
    """Errors of plates: forces over largest stress × contact length, moments also over the reach from the pivot."""
    mesh = samples.problem.mesh
    for contact in samples.problem.contacts:
        if contact.plate is None:
            continue
        plate, edges = contact.plate, mesh.edges(contact.edges)
        normals, _ = frames_along(edges, _NODES)
        force = tractions(normals, samples.on(edges, _NODES)) * (edges.length[:, None] * _WEIGHTS)[..., None]
        size = samples.largest * float(edges.length.sum())
        for name, found, wanted in zip("xy", force.sum(axis=(0, 1)), (plate.force_x, plate.force_y), strict=True):
            if wanted is not None:
                yield f"force_{name} of the plate", _relative(float(found) - wanted, max(size, abs(wanted)))
        if plate.moment is not None:
            arm = np.stack(mesh.points_along(edges, _NODES), axis=-1) - plate.pivot
            moment, reach = float(cross(arm, force).sum()), float(np.abs(arm).max())
            yield "moment of the plate", _relative(moment - plate.moment, max(size * reach, abs(plate.moment)))


def _laws(samples: Samples, result: ContactResult) -> Iterator[tuple[str, float]]:
    """Errors of reported tractions, tension, and excess of the friction bound, over the largest stress."""
    problem, mesh = samples.problem, samples.problem.mesh
    for contact in problem.contacts:
        line, edges = result.contacts[contact.name], mesh.edges(contact.edges)
        nodes = (np.polynomial.legendre.leggauss(line.x.size // len(edges))[0] + 1.0) / 2.0
        x, y = mesh.points_along(edges, nodes)
        whole, shear = (each.reshape(x.shape) for each in (line.normal_stress, line.tangential_stress))
        # to `_NODES`, by the polynomials of each edge, which are those of the stress less the body potential
        interpolation = (np.vander(_NODES, len(nodes)) @ np.linalg.inv(np.vander(nodes))).T
        normals, tangents = frames_along(edges, _NODES)
        pressed = (whole - _values(problem.body_potential, x, y)) @ interpolation
        pressed += _values(problem.body_potential, *mesh.points_along(edges, _NODES))
        reported = pressed[..., None] * normals + (shear @ interpolation)[..., None] * tangents
        off = tractions(normals, samples.on(edges, _NODES)) - reported
        yield f"reported tractions on {contact.name}", _relative(_missed(edges, off), samples.largest)
        normal = whole + line.pore_pressure.reshape(whole.shape)
        if contact.law == "unilateral":
            yield f"tension on {contact.name}", _relative(np.maximum(normal, 0.0), samples.largest)
        if contact.law != "tied":
            friction = _values(contact.friction, x, y)
            bound = _values(contact.cohesion, x, y) + friction * np.abs(normal)
            if contact.shear_limit is not None:
                bound = np.minimum(bound, _values(contact.shear_limit, x, y))
            excess = np.maximum(np.abs(shear) - bound, 0.0) / (1.0 + float(friction.max()))
            yield f"friction on {contact.name}", _relative(excess, samples.largest)


def _fluids(samples: Samples, result: ContactResult) -> Iterator[tuple[str, float]]:
    """Errors of the polynomial on every edge that the result used for a fluid's pressure: its force and its values."""
    mesh = samples.problem.mesh
    for contact in samples.problem.contacts:
        edges, field = mesh.edges(contact.edges), contact.pore_pressure
        taken = result.contacts[contact.name].pore_pressure.reshape(len(edges), -1)
        nodes, weights = np.polynomial.legendre.leggauss(taken.shape[1])
        missed = np.abs(taken - _values(field, *mesh.points_along(edges, (nodes + 1.0) / 2.0))).max(initial=0.0)
        said = any(repr(contact.name) in remark and "pore pressure" in remark for remark in result.remarks)
        yield f"pore pressure on {contact.name}, not said", 0.0 if said else _relative(float(missed), samples.largest)

        def along(t: float, edges: Edges = edges, field: Field = field) -> FloatArray:
            return _values(field, *mesh.points_along(edges, np.array([t])))[:, 0]

        force = _integral(along) if callable(field) else field
        yield f"pore pressure on {contact.name}", _relative(taken @ (weights / 2.0) - force, samples.largest)


@dataclass(frozen=True)
class Comparison:
    """A state σ compared with the state τ of another method, for the same friction bounds.

    For fixed bounds one state has the least complementary energy J, so both agree or one is wrong. In units of the
    larger strain energy, distance² = ½ ∫ c(σ − τ) : (σ − τ) dx and gain = J(σ) − J(τ). The gain is positive if σ is not
    the minimiser, and −∞ if τ violates the law by more than `_BROKEN` of the largest traction.
    """

    distance: float
    gain: float

    @property
    def differs(self) -> bool:
        """Whether the first state is not the one of least energy."""
        return self.distance > _DISTANCE and self.gain > 0.5 * _DISTANCE**2


def compare(result: ContactResult, other: ContactResult) -> Comparison:
    """Compare a state with that of another method on the same discretisation, by the discrete energy J of both."""
    problem, qvi = result.problem, other.solution.problem
    one, two, unit = result.solution.z, other.solution.z, other.discretization.scales.energy
    change, (across, up) = two - one, np.moveaxis(np.diff(problem.mesh.corners, axis=1), 1, 0)
    area = float(np.abs(cross(across, up)).sum()) / 2.0
    nothing = floor(problem) ** 2 * area / max(each.young for each in problem.materials)
    size = max(result.energies.strain, other.energies.strain, nothing) / unit
    distance, gain = 0.5 * float(change @ (qvi.K @ change)), -float(qvi.gradient((one + two) / 2.0) @ change)
    bound, normal, shear = qvi.threshold(qvi.pressure(one)), qvi.normal(two), qvi.tangential(two)
    excess = np.maximum(np.where(qvi.bilateral, 0.0, normal), np.abs(shear) - bound)
    largest = max(scales_at(qvi, one)["stress"], np.abs(normal).max(initial=0.0), np.abs(shear).max(initial=0.0))
    if excess.max(initial=0.0) > _BROKEN * largest:
        gain = -np.inf
    return Comparison(float(np.sqrt(max(distance, 0.0) / size)), gain / size)


# Existence of a solution: a mixed-integer program searches all states of a small contact.
#
# Each point is open, sticks, or slips one way or the other: these are binary unknowns, all else is linear,
#
#     σ = σ_bonded − C m,   σ_N ≤ 0 ≤ m_N,   |σ_T| ≤ cohesion + mu |σ_N|,   one of each pair zero,
#
# and HiGHS finds a state within bounds on m and σ, or proves up to its tolerances that there is none within them. The
# bounds are `_BIG` times the bonded tractions and their displacements. So an empty search suggests that there is no
# solution, but does not prove it. Contacts with caps, bilateral points with friction and large contacts are left out.


EXISTS, NONE, UNDECIDED = "a solution exists", "no solution", "undecided"
_BIG: Final = 1e3  # bound of m and of tractions, over those of the bonded state
_POINTS: Final = 40  # most contact points
_FOUND, _EMPTY = 0, 2  # status numbers of scipy.optimize.milp


def enumerated(qvi: FrictionQVI, seconds: float) -> str:
    """`EXISTS`, `NONE` or `UNDECIDED`, after a search of at most so many seconds."""
    suits = not (qvi.bilateral & (qvi.mu > 0.0)).any() and not np.isfinite(qvi.cap).any()
    if not suits or not 0 < qvi.m <= _POINTS:
        return UNDECIDED
    m, compliance = qvi.m, Compliance(qvi)
    stress = float(np.abs(compliance.bonded).max()) or 1.0
    weights = np.concatenate([qvi.W, qvi.W]) / (qvi.contact_stiffness or 1.0)
    C, bonded = compliance.dense * weights, compliance.bonded / stress
    move = np.hstack([C[:, :m], C[:, m:], -C[:, m:]])  # by gaps, forward and backward slips
    one, no, none = np.eye(m), np.zeros((m, m)), np.zeros((m, 3 * m))
    shear, far = (bonded[m:], -move[m:]), _BIG * (1.0 + float(qvi.mu.max()))
    bound = (qvi.cohesion / stress - qvi.mu * bonded[:m], qvi.mu[:, None] * move[:m])
    up, down = (tuple(b + sign * t for b, t in zip(bound, shear, strict=True)) for sign in (-1.0, 1.0))
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = [  # a (gap, slips) + b (closed, forward, backward) ≤ upper
        (-move[:m], none, -bonded[:m]),
        (move[:m], -_BIG * np.hstack([one, no, no]), bonded[:m]),
        (-up[1], none, up[0]),
        (-down[1], none, down[0]),
        (up[1], far * np.hstack([no, one, no]), far - up[0]),
        (down[1], far * np.hstack([no, no, one]), far - down[0]),
        (np.hstack([one, no, no]), _BIG * np.hstack([one, no, no]), np.full(m, _BIG)),
        (np.hstack([no, one, no]), -_BIG * np.hstack([no, one, no]), np.zeros(m)),
        (np.hstack([no, no, one]), -_BIG * np.hstack([no, no, one]), np.zeros(m)),
        (none, np.hstack([no, one, one]), np.ones(m)),
    ]
    real, binary, upper = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    answer = milp(
        np.zeros(6 * m), integrality=np.repeat([0, 1], 3 * m), bounds=Bounds(0.0, np.repeat([_BIG, 1.0], 3 * m)),
        constraints=LinearConstraint(np.hstack([real, binary]), -np.inf, upper), options={"time_limit": seconds},
    )  # fmt: skip
    return {_FOUND: EXISTS, _EMPTY: NONE}.get(answer.status, UNDECIDED)
