"""The norm of the friction operator R, proved or by finite elements, and how an error grows with it.

R takes displacements v of W, which vanish where displacements are prescribed, to W. On contacts with Coulomb friction
(Rv)_N = μ s v_T, s the share, and (Rv)_T = 0. On the others it has no normal part, and no tangential part where they
bear shear. Any such R with RR = 0 serves: on rectangles Rv = θ v_a e_b, on star-shaped bodies Rv = η v_t n, whose norms
are proved; elsewhere that of finite elements with the least energy, without the motions that contacts alone stop.

In `docs/theory.md`: (D26), (D28), (D29), (D30), (D32), (D39).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse
from scipy.linalg import eigh, orth, qr
from scipy.sparse.linalg import spsolve

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.share import Share, bodies_of, held_directions, shares_on, spans
from qvi_contact.companion.body import Elasticity
from qvi_contact.companion.contact import DisplacementContact
from qvi_contact.companion.model import MOST, SINGULAR, BodyAtRest, least_energy, solutions
from qvi_contact.discretization.displacements import PARALLEL, DisplacementSpace, reference_matrices, triangle
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import bernstein_basis, bernstein_from_values, lobatto_points, product_integrals
from qvi_contact.errors import InputError
from qvi_contact.mechanism.mechanism import null_space
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem

ANGLES: Final = np.linspace(0.0, np.pi / 2.0, 4097)
"""Angles at which a smooth function is compared for its maximum."""
ROUNDED: Final = 1.0 + 1e-6
"""Factor from the maximum at these angles to what is no less than that of all."""
_PLACE: Final = 1e-9  # of the body's size: a place on a side
_FIELD_DEGREE: Final = 2  # of the field that shows how supports hold the mean rotation


def one_ratio(problem: ContactProblem) -> float | None:
    """Poisson's ratio of the plane state, −c12/c11, of a body of one material; None where there are several."""
    if len(np.unique(problem.compliances.reshape(-1, 9), axis=0)) > 1:
        return None
    return -float(problem.compliances[0][0, 1] / problem.compliances[0][0, 0])


def proved_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """The least proved norm, of several bodies the largest of theirs; infinity where there is none.

    Nothing is proved of bodies with arcs, of cracks, of plates that forces drive, under friction or tied to a body, of
    bodies on beds of springs, and of springs along a contact with friction. Other springs only make the norm less:
    displacements without stretch are images, and |v| is larger than without springs.
    """
    for each in problem.contacts:
        yields = each.tangential_stiffness is not None if has_coulomb(each) else each.law == "tied" and each.has_springs
        driven = each.plate is not None and each.plate.driven  # what is tied to it is not held
        if yields or (driven and (has_coulomb(each) or each.law == "tied")):
            return np.inf
    try:
        bodies = bodies_of(problem)
    except InputError:
        return np.inf
    largest = 0.0
    for body in bodies:
        if any(map(has_coulomb, body.problem.contacts)):
            own, straight = shares_on(body, problem, shares), not body.problem.mesh.sides.any()
            found = min(rectangle_norm(body.problem, own), star_norm(body.problem, own)) if straight else np.inf
            if not found < np.inf:  # NaN proves nothing either
                return np.inf
            largest = max(largest, found)
    return largest


def rectangle_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """The norm of Rv = θ v_a e_b on a rectangle with its contacts across the axis b; else infinity.

    The body is a rectangle of one material, its contacts with Coulomb friction lie on one side or on two opposite ones,
    and along one whole side at right angles to these v_a = 0. θ is ±μ s on the contacts, and linear along b, see (D29).
    """
    mesh, boundary, ratio = problem.mesh, problem.mesh.boundary, one_ratio(problem)
    first = mesh.edges(next(filter(has_coulomb, problem.contacts)).edges)
    turn = np.column_stack([first.tangent[0], first.normal[0]])  # to axes along a contact and across it
    normals, directions = boundary.normal @ turn, [each @ turn for each in held_directions(problem)]
    vertices, along = mesh.vertices @ turn, boundary.tangent @ turn[:, 0]
    corners, axis = vertices[np.unique(mesh.cells)], np.argmax(np.abs(normals), axis=1)
    low, high, every = corners.min(axis=0), corners.max(axis=0), np.arange(len(axis))
    end, ends = normals[every, axis] > 0.0, vertices[np.stack([boundary.first, boundary.second], axis=1)]
    away = np.abs(ends.mean(axis=1) - np.where(end[:, None], high, low))[every, axis]
    held = np.array([[spans(each, unit) for unit in np.eye(2)] for each in directions])
    vectors = np.concatenate([normals, *(directions[edge] for edge in np.flatnonzero(~held.all(axis=1)))])
    slanted = not np.allclose(np.abs(vectors).max(axis=1), 1.0, rtol=0.0, atol=_PLACE)
    if ratio is None or slanted or away.max() > _PLACE * (high - low).max():
        return np.inf
    pressed, rough, rubs = np.zeros((3, len(boundary)), dtype=bool)  # where (Rv)_N = 0, (Rv)_T = 0, and with friction
    theta, steps = np.zeros((len(axis), 3)), np.zeros((len(axis), 16))  # at both ends and at most; see `Share.steepest`
    for contact in problem.contacts:
        index = mesh.edge_set(contact.edges)
        if has_coulomb(contact):
            share = shares[contact.name]
            theta[index, :2] = np.where(end[index], share.friction, -share.friction)[:, None] * share.values[:, [0, -1]]
            theta[index, 2] = share.friction * np.abs(share.values).max(axis=1)
            rubs[index], steps[index] = True, share.friction * share.steepest()
        elif contact.law != "tied":
            pressed[index], rough[index] = True, bears_shear(contact)
    if len(set(axis[rubs])) != 1 or (along[rubs] < 0.0).any():
        return np.inf
    b = int(axis[rubs][0])
    a, extent = 1 - b, high - low
    mirrors = [[held[(axis == k) & (end == side), k].all() for side in (False, True)] for k in (0, 1)]
    beside = axis == a
    if not any(mirrors[a]) or not (held[:, a] | ~(held[:, b] | rough))[beside].all():
        return np.inf
    demanded = (axis == b) & (rubs | ((held[:, b] | pressed) & ~held[:, a]))
    rests, largest, rotations = np.array([low[a], high[a]])[mirrors[a]], list[float](), list[FloatArray]()
    for side in {*end[demanded].tolist()}:
        chosen = np.flatnonzero(demanded & (end == side))
        chosen = chosen[np.argsort(ends[chosen, :, a].min(axis=1))]
        rotations.append(_rotation(np.sort(ends[chosen, :, a], axis=1), theta[chosen], steps[chosen], rests))
        largest.append(float(theta[chosen, 2].max()))
    steep = 0.0 if len(largest) == 1 else sum(largest) / extent[b]
    shape = (extent[b] if any(mirrors[b]) else extent[b] / 2.0) / extent[a]
    shape = max(shape, 1.0 / shape) if any(mirrors[b]) else shape
    # the mirrored rectangle is cut across where the rotation is odd, so that its mean over each part is zero
    ratios = [min(shape / n, n / shape) for n in (max(int(shape), 1), int(shape) + 1)]
    inf_sup = float(np.sin(0.5 * np.arctan(max(ratios))))
    H = float(np.max(rotations, axis=0).min())
    return rectangle_constant(ratio, inf_sup, max(largest), steep * 2.0 * extent[a] / np.pi, H)


def _rotation(places: FloatArray, theta: FloatArray, steps: FloatArray, rests: FloatArray) -> FloatArray:
    """H with ‖θ′ v‖ ≤ H ‖v′‖ for all v of a side that vanish at a place of `rests`: v² ≤ |a − place| ‖v′‖².

    θ is given by the side's edges in order, and linear between them.
    """
    between = np.stack([places[:-1, 1], places[1:, 0], np.abs(theta[1:, 0] - theta[:-1, 1])])
    apart = between[1] > between[0]
    steps[1:][~apart & (between[2] > _PLACE)] = np.inf  # a jump, which springs across a contact allow
    grid = np.linspace(places[:, 0], places[:, 1], steps.shape[1] + 1)
    parts = np.stack([grid[:-1], grid[1:], steps.T / np.diff(grid, axis=0)]).reshape(3, -1)
    between = between[:, apart]
    between[2] /= between[1] - between[0]
    start, stop, d = np.concatenate([parts, between], axis=1)
    squares = d**2 * np.abs((start + stop) / 2.0 - rests[:, None]) * (stop - start)
    return np.asarray(np.sqrt(squares.sum(axis=1)))


def rectangle_constant(ratio: float, inf_sup: float, largest: float, steepest: float, turned: float = 0.0) -> float:
    """The norm of v ↦ θ v_a e_b in the energy norm: a number it does not exceed.

    `ratio` is Poisson's of the plane state, −c12/c11: ν in plane stress, ν/(1 − ν) in plane strain; `inf_sup` is β of
    the rectangle mirrored at the sides where displacements are odd; `largest` is max |θ|, `steepest` max |∂_b θ| times
    the constant of Poincaré's inequality ‖v_a‖ ≤ k ‖∂_a v_a‖, and `turned` is H with ‖∂_a θ v_a‖ ≤ H ‖∂_a v_a‖.
    """
    if not np.isfinite(turned):
        return float("inf")
    soft, stiff, gain = 1.0 - ratio, 1.0 + ratio, inf_sup**-2
    sheared = largest * np.cos(ANGLES)  # weight of ∂_b v_a, of its rotation and of its shear strain
    stretched = steepest * np.cos(ANGLES) + (largest + turned) * np.sqrt(soft / 2.0) * np.sin(ANGLES)
    rotation = np.array([gain / (2.0 * soft), (gain - 1.0) / (2.0 * stiff)])
    square = sheared**2 * (rotation.sum() + 0.5 / soft) + stretched**2 / (soft * stiff)
    square += 2.0 * sheared * np.sqrt(rotation[0] * (sheared**2 + stretched**2) / (2.0 * soft))
    square += 2.0 * sheared * stretched * np.sqrt(rotation[1] / (2.0 * stiff))
    return float(np.sqrt(square.max()) * ROUNDED)


def star_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """A number that |R| does not exceed, infinite where the body or its contacts are of another kind.

    The body has one material, no holes, and is star-shaped with respect to a disc. All contacts with Coulomb friction
    are parallel and slip one way, with the same η = ±μ across. Elsewhere nothing is demanded of displacements along n
    where v_t ≠ 0.
    """
    boundary, sides = problem.mesh.boundary, held_directions(problem)
    weights = np.zeros(len(boundary))  # ±μ of each edge
    for share in shares.values():
        if not share.slipping.all() or np.ptp(share.slipping) != 0.0:
            return np.inf
        weights[problem.mesh.edge_set(share.contact.edges)] = share.slipping[0] * share.friction
    chosen = np.flatnonzero(weights != 0.0)
    normal = boundary.normal[chosen[0]]
    tangent = np.array([-normal[1], normal[0]])
    slopes = weights[chosen] * (boundary.normal[chosen] @ normal)
    parallel = np.abs(boundary.normal[chosen] @ tangent).max() <= PARALLEL
    if not parallel or np.ptp(slopes) > PARALLEL * np.abs(slopes).max():
        return np.inf
    if any(not spans(held, tangent) and (np.abs(held @ normal) > PARALLEL).any() for held in sides):
        return np.inf
    for contact in problem.contacts:
        index = problem.mesh.edge_set(contact.edges)
        beside = contact.law != "tied" and not weights[index].any()
        if beside and (bears_shear(contact) or np.abs(boundary.normal[index] @ normal).max() > PARALLEL):
            return np.inf
    ratio = one_ratio(problem)
    if ratio is None:
        return np.inf
    gain, soft = _gain(problem, sides), 1.0 - ratio  # the norm of v ↦ v_t n, by the rotation and the strains of v
    across, along = np.cos(ANGLES), np.sqrt(soft / 2.0) * np.sin(ANGLES)
    rotation = np.sqrt((gain - 0.5) / min(soft, 1.0 + ratio))
    strains = np.sqrt(across**2 / (2.0 * soft) + along**2 / (1.0 - ratio**2))
    return float(np.abs(slopes).max()) * float((across * rotation + strains).max() * ROUNDED)


def _gain(problem: ContactProblem, sides: list[FloatArray]) -> float:
    """G with ‖∇ψ‖² ≤ G ‖ω‖² for a ψ of divergence ω, the rotation of any displacement, zero where these are free."""
    from scipy.optimize import fmin_slsqp  # slow to import, and few bodies need it

    mesh, boundary = problem.mesh, problem.mesh.boundary
    corners = mesh.vertices[np.unique([boundary.first, boundary.second])]
    middle = corners.mean(axis=0)
    corners, starts = ((each - middle) / mesh.length for each in (corners, mesh.vertices[boundary.first]))
    # r/R at y/t, t = 1/R, is the largest ρ ≤ b t − n·y of all edges n·x = b, with |t x − y| ≤ 1 at all vertices x
    rows = np.column_stack([-boundary.normal, (starts * boundary.normal).sum(axis=1), -np.ones(len(starts))])

    def room(x: FloatArray) -> FloatArray:
        return np.concatenate([rows @ x, 1.0 - ((x[2] * corners - x[:2]) ** 2).sum(axis=1)])

    least = np.array([0.0, 0.0, 0.0, -1.0]).dot
    found = np.asarray(fmin_slsqp(least, np.array([0.0, 0.0, 1.0, -1.0]), f_ieqcons=room, iprint=0))
    centre = found[:2] / found[2]
    ratio = float((rows[:, :3] @ np.append(centre, 1.0)).min() / np.linalg.norm(corners - centre, axis=1).max())
    inf_sup = float(np.sin(0.5 * np.arcsin(max(ratio, 0.0))))  # ≤ β
    if inf_sup == 0.0 or mesh.hole_edges.any():
        return np.inf
    # by a field of mean divergence 1 where supports are, and by β for what is left
    space = DisplacementSpace.of(problem, triangle(_FIELD_DEGREE), problem.mesh.length)
    n, numbers = len(space.cell.places), space.along(problem.mesh.boundary)
    unknown = np.ones((space.size // 2, 2), dtype=bool)  # components that vanish on edges that leave them free
    for edge, held in enumerate(sides):
        unknown[numbers[edge]] &= [spans(held, unit) for unit in np.eye(2)]
    free = unknown.ravel()
    trace = np.array([1.0, 1.0, 0.0])
    body = Elasticity(space, np.tile(np.outer(trace, trace), (len(space.table), 1, 1)))
    squared, (t, weights) = body.stiffness(), body.points()  # ‖div ψ‖²
    mean, area = body.virtual_work(weights[..., None] * trace, t), float(weights.sum())  # ∫ div ψ
    matrices = space.areas, space.slopes, space.slopes, reference_matrices(space.cell), np.eye(2)
    blocks = np.einsum("c,cax,cbx,abij,kl->cikjl", *matrices, optimize=True)
    laplace = space.assembled(blocks.reshape(-1, 2 * n, 2 * n))  # ‖∇ψ‖²
    matrix, right = laplace + squared / inf_sup**2, mean / inf_sup**2
    if not right[free].any():
        return np.inf
    field = np.zeros(space.size)
    field[free] = spsolve(sparse.csc_array(matrix[free][:, free]), right[free])
    flux = float(mean @ field)
    if not flux > 1e-9 * area:
        return np.inf
    field *= area / flux
    size = np.sqrt(max(float(field @ (laplace @ field)), 0.0) / area)
    left = np.sqrt(max(float(field @ (squared @ field)) / area - 1.0, 0.0))
    return float((size + left / inf_sup) ** 2 + inf_sup**-2)


LARGEST: Final = 2.0
"""The norm s from which on nothing is bounded."""

UNHELD: Final = (
    "Contacts alone hold a body, and {}. Its errors are not bounded: refine the mesh, or hold the body along a contact "
    "if there is a support in reality."
)
_DEGREE: Final = 3  # of displacements by which a norm is computed
_USEFUL: Final = 1.6  # norm up to which proved bounds are not many times as large as errors
_MOTIONS: Final = 3  # up to which every sense of each has a norm of its own
_PARTS: Final = (1.0, 0.5, 0.25, 0.125)  # of the friction that is left which are tried: the norm grows with it,
_NEARLY: Final = 0.75  # share of the largest reach that is enough
_ALIKE: Final = 1e-6  # of a motion's largest slip: edges that it moves alike
_STOPS: Final = 1e-6  # of the largest friction times slip, or pressure times opening: what stops a motion
_RIGID: Final = 1e-10  # of the energy of its coefficients one by one: what strains a body no more does not
_PIECES: Final = (1, 2, 3)  # into which contacts that press are cut


def coercivity(s: float) -> float:
    """α = min a(e, e − Se)/|e|² = 1 − s/2, which is also min a(e, q)/|q|² for q = e − Se."""
    return 1.0 - s / 2.0


def amplification(s: float) -> float:
    """The factor f = max |e − Se| |e|/a(e, e − Se) = (4 + s²)/(4 − s²) of ρ, for 0 ≤ s < 2."""
    return (4.0 + s**2) / (4.0 - s**2)


def error_bound(residual: float, defect: float, s: float) -> float:
    """T2: F = ½ [fρ + √(f²ρ² + 4δ/α)], the larger root of x² = fρx + δ/α; infinite from s = 2 on."""
    if not s < LARGEST:
        return float("inf")
    grown = amplification(s) * residual
    return float(0.5 * (grown + np.hypot(grown, 2.0 * np.sqrt(defect / coercivity(s)))))


def defect_bound(residual: float, defect: float, s: float) -> float:
    """T2: Σ ≤ ρ²/(4α) + δ; infinite from s = 2 on."""
    return residual**2 / (4.0 * coercivity(s)) + defect if s < LARGEST else float("inf")


@dataclass(frozen=True)
class FrictionNorm:
    """A number that |R| does not exceed, infinite where there is none.

    Unless it is `proved`, finite elements found it, on one mesh; `reason` says so in words. Where contacts alone stop
    motions (`stopped`), R acts on displacements without them.
    """

    value: float
    proved: bool
    reason: str
    stopped: Stopped | None = None

    def work(self, problem: ContactProblem, shares: Mapping[str, Share], error: float, defect: float) -> float:
        """No less than ∫ (σ − τ) : ε(Re) for the R of other shares, by F and a bound of Σ; infinite without a norm.

        Where this norm is proved, that of R is, too.
        """
        if not any(share.values.any() for share in shares.values()):
            return 0.0
        if self.proved:
            return proved_norm(problem, shares) * error**2
        moved = 0.0 if self.stopped is None else self.stopped.work(shares, error, defect)
        return computed_norm(problem, shares, self.stopped) * error**2 + moved


def friction_norm(
    problem: ContactProblem,
    shares: Mapping[str, Share],
    unit: float = 1.0,
    pressures: Mapping[str, FloatArray] = MappingProxyType({}),
) -> FrictionNorm:
    """The least proved norm where there is one below 1.6, else that of finite elements; nothing is proved with arcs.

    Of several bodies it is the largest of the norms that each has alone. Weights of shares have the unit [stress], as
    have `pressures`: by contact that may open |τ_N| (edges, q) where v touches the obstacle on the whole edge, else 0.
    """
    value = proved_norm(problem, shares)
    if value < _USEFUL:
        return FrictionNorm(value, True, f"The norm of the friction operator is at most {value:.4g}.")
    value, stopped = computed_norm(problem, shares), None
    if value == np.inf:
        found = _ENERGIES[problem].stopped(shares, pressures, unit)
        if isinstance(found, str):
            return FrictionNorm(np.inf, False, UNHELD.format(found))
        value, stopped = found.norm, found
    reason = f"The norm of the friction operator, {value:.3g}, was computed by finite elements, not proved."
    if np.isnan(value):
        return FrictionNorm(np.inf, False, "There are too many contact edges to compute the norm of friction.")
    if value >= LARGEST:
        reason = f"The bounds need a norm of the friction operator below 2. Here it is {value:.3g}."
    return FrictionNorm(value, False, reason, stopped)


def computed_norm(problem: ContactProblem, shares: Mapping[str, Share], stopped: Stopped | None = None) -> float:
    """The norm of the R whose images have the least energy, max |Rv|/|v|, among finite elements on the mesh.

    The square is the largest λ of D x = λ A x, see (D30), without the motions that friction stops; infinity where
    contacts can slip without strain, NaN where there are too many coefficients.
    """
    if problem not in _ENERGIES:
        _ENERGIES[problem] = _Energies.of(problem)
    known = _ENERGIES[problem] if stopped is None else stopped.energies
    if not len(known.part):
        return np.nan if known.slips.any() else 0.0
    held = stopped is not None or np.abs(known.slips @ known.motions).max(initial=0.0) <= _ALIKE
    return known.norm(known.image(shares)) if held else np.inf


@dataclass(frozen=True, eq=False)
class Stopped:
    """Motions d_k without strain that contacts alone stop, 1 ≤ k ≤ j.

    Each moves one group of edges by 1 in the mean, the others of the j groups not at all. A group is stopped by a part
    ω of the friction that is left where contacts stick, or by the pressure ω of contacts that may open; t_k is the mean
    over it, with the weight ω, of the slip of e = u − v, or of −e_N. (D39) holds for every solution with |σ − τ| <
    `reach`, and R for s + ω/B, with the senses of the t_k, in place of s.
    """

    motions: FloatArray  # (n, j): slips d_k
    masses: FloatArray  # (j,): M_k = ∫ ω ds over the group [energy per unit of displacement]
    images: FloatArray  # (j,): the largest |R d_k| for all senses [√energy per unit of displacement]
    energies: _Energies  # of displacements with means 0
    norm: float = np.inf  # the largest norm of such R on these, for all senses

    @property
    def reach(self) -> float:
        """S* = min M_k/|R d_k| [√energy], infinite where all R d_k are rigid motions."""
        strained = self.images > 0.0
        return float((self.masses[strained] / self.images[strained]).min(initial=np.inf))

    def work(self, shares: Mapping[str, Share], error: float, defect: float) -> float:
        """No less than ∫ (σ − τ) : ε(Σ t_k R d_k) for the R of other shares, by F and δ + ρ²/(4α)."""
        sizes = self.energies.sizes(self.energies.image(shares) @ self.motions)
        return float(error * defect * (sizes / (self.masses - error * self.images)).max())


class _Group(NamedTuple):
    """A group of edges, which friction stops or pressure does."""

    row: FloatArray  # ∫ ω e_T ds, or of −e_N, of w (k,)
    mass: float  # ∫ ω ds
    left: Mapping[str, Share]  # by contact what friction has left, ± on edges that slip alike or against each other
    rough: bool = False  # pressure of a contact with friction


@dataclass(frozen=True, eq=False)
class _Energies:
    """Least energies of displacements by what they are on contacts with Coulomb friction, of all n coefficients."""

    traces: tuple[DisplacementContact, ...]
    scales: Scales
    B: FloatArray  # (2, n, k): coefficients across and along, from w_Γ
    slips: FloatArray  # (n, k): those along contacts with Coulomb friction, 0 on others
    held: FloatArray  # (h, k): rows that vanish, of what is tied or keeps its distance
    stiffness: FloatArray  # (k, k): S
    motions: FloatArray  # (k, j): w without energy, with the largest coefficient 1
    # (n, n): energies of given normal parts without tangential ones; empty where n is too large, as the others
    part: FloatArray
    attained: FloatArray  # (n, a): basis of the slips of displacements: where contacts meet they are the same, or 0
    below: FloatArray  # (a, a): energies of given slips in that basis

    @classmethod
    def of(cls, problem: ContactProblem) -> _Energies:
        """By displacements on the mesh."""
        known, none = BodyAtRest.of(problem, _DEGREE), np.zeros((0, 0))
        contacts, B = known.contacts, known.B.reshape(2, known.contacts.count, -1)
        coulomb, tied, rough = contacts.where(has_coulomb), contacts.tied, contacts.where(bears_shear)
        held = known.B[np.append(contacts.bilateral, tied)]
        motions = known.body.R / max(float(np.abs(known.B @ known.body.R).max(initial=0.0)), _ALIKE)
        motions = motions @ null_space(held @ motions, _ALIKE)
        presses, slips = coulomb[:, None] * B
        parts = contacts.traces, Scales.of(problem), B, slips, held, known.body.S, motions
        if len(known.live) > MOST:
            return cls(*parts, none, none, none)
        part = least_energy(known.body.S, presses, known.B[np.append(~coulomb, rough | tied)])
        return cls(*parts, part, none, none).without(held[:0])

    def without(self, rows: FloatArray) -> _Energies:
        """The same of displacements on which functionals (r, k) vanish, too."""
        zero = np.vstack([self.held, rows])
        attained = orth(self.slips @ solutions(zero)[1], SINGULAR)
        return replace(self, below=least_energy(self.stiffness, attained.T @ self.slips, zero), attained=attained)

    def norm(self, *images: FloatArray) -> float:
        """The norm of what turns slips into normal parts, several counted as legs of one."""
        turned = (each @ self.attained for each in images if each.any())
        work = sum((each.T @ self.part @ each for each in turned), np.zeros_like(self.below))
        return float(np.sqrt(max(float(eigh(work, self.below, eigvals_only=True)[-1]), 0.0))) if work.any() else 0.0

    def sizes(self, normal: FloatArray) -> FloatArray:
        """|v| (j,) of normal parts (n, j) [√energy per unit of displacement]; 0 of rigid motions, but for rounding."""
        squares = (normal * (self.part @ normal)).sum(axis=0)
        strained = squares > _RIGID * (np.diag(self.part) @ normal**2)
        return np.sqrt(self.scales.energy * np.where(strained, squares, 0.0))

    def image(self, shares: Mapping[str, Share]) -> FloatArray:
        """Normal parts from slips, μ s x."""
        turned = np.zeros_like(self.part)
        for trace in self.traces:
            if trace.name in shares:
                share, p = shares[trace.name], trace.columns.shape[1] - 1
                nodes, back = lobatto_points(p), bernstein_from_values(p)
                factors = share.friction * share.at(nodes)
                blocks = np.einsum("ij,ej,jk,ek->eik", back, factors, bernstein_basis(p, nodes), trace.turned)
                columns = trace.start + trace.columns
                turned[columns[:, :, None], columns[:, None, :]] = blocks
        return turned

    def stopped(self, shares: Mapping[str, Share], pressures: Mapping[str, FloatArray], unit: float) -> Stopped | str:
        """What stops the motions without strain, or why nothing does. Weights and pressures have the unit [stress].

        Friction alone, else pressure too, of contacts cut into as many pieces as make the reach large.
        """
        friction, unit = list(self._by_friction(shares)), self.scales.energy * unit / self.scales.stress
        found = self._stopped(shares, friction, unit)
        if found is None:
            cut = (self._by_pressure(pressures, pieces) for pieces in _PIECES)
            tried = [self._stopped(shares, [*friction, *each], unit) for each in cut]
            found = max(filter(None, tried), key=lambda each: each.reach, default=None)
        if found is None:
            moved = np.abs(self.slips @ self.motions).max(axis=1)
            moving = [each.name for each in self.traces if each.name in shares and moved[each.here].max() > _ALIKE]
            loose = [name for name in moving if not (shares[name].room * shares[name].weights).any()]
            names = " and ".join(map(repr, loose or moving))
            return f"no part of {names} sticks that would hold it, nor does pressure"
        return found

    def _stopped(self, shares: Mapping[str, Share], groups: Sequence[_Group], unit: float) -> Stopped | None:
        """What some of the groups stop, if they stop all; masses have the unit [energy per unit of displacement]."""
        if not groups:
            return None
        rows, slipped = np.array([each.row for each in groups]), self.slips @ self.motions
        _, size, order = qr((rows @ self.motions).T, pivoting=True)
        most = float(np.abs(size[0, 0]))
        chosen = order[: int((np.abs(np.diag(size)) > _STOPS * most).sum())]
        rows, kept = rows[chosen], [groups[k] for k in chosen]
        if np.abs(slipped @ null_space(rows @ self.motions / most, _STOPS)).max(initial=0.0) > _ALIKE:
            return None
        masses, sticks = np.array([each.mass for each in kept]), np.array([bool(each.left) for each in kept])
        d = slipped @ np.linalg.pinv(rows / masses[:, None] @ self.motions)
        image, turned = self.image(shares), [self.image(each.left) for each in kept]
        others = self.without(rows / np.abs(rows).max(axis=1, keepdims=True))
        tried = list[Stopped]()
        for part in _PARTS:  # the larger |R d_k| of both senses of d_k: the other groups it does not move
            both = [(image + sense * own) @ d[:, k] for sense in (part, -part) for k, own in enumerate(turned)]
            images = self.sizes(np.transpose(both)).reshape(2, -1).max(axis=0)
            tried.append(Stopped(d, unit * np.where(sticks, part, 1.0) * masses, images, others))
        least = _NEARLY * max(each.reach for each in tried)
        part, found = [each for each in zip(_PARTS, tried, strict=True) if each[1].reach >= least][-1]
        ways = [part * own for own, each in zip(turned, kept, strict=True) if each.left]
        if len(ways) <= _MOTIONS:
            senses = np.array(list(product((1.0, -1.0), repeat=len(ways))))
            norm = max(others.norm(image + sum(map(np.multiply, each, ways))) for each in senses)
        else:  # |Σ ± R_k v| ≤ √j (Σ |R_k v|²)^½
            norm = others.norm(image) + float(np.sqrt(len(ways))) * others.norm(*ways)
        # where RR = 0 does not hold, a(e, Re) ≤ r |e|², not half of it
        return replace(found, norm=2.0 * norm if found.images[[each.rough for each in kept]].any() else norm)

    def _works(self, trace: DisplacementContact, bound: FloatArray, along: int) -> tuple[FloatArray, FloatArray]:
        """∫ ω e_N ds of w on edges (e, k), or ∫ ω e_T ds `along` them, and ∫ ω ds (e,), by coefficients of ω (e, q)."""
        columns = trace.start + trace.columns
        weights = trace.lengths[:, None] * (bound @ product_integrals(bound.shape[1] - 1, columns.shape[1] - 1))
        own = trace.turned * weights if along else weights
        return np.einsum("ej,ejk->ek", own, self.B[along, columns]), weights.sum(axis=1)

    def _by_friction(self, shares: Mapping[str, Share]) -> Iterator[_Group]:
        """Straight edges that motions without strain move alike, or against each other, stopped where they stick."""
        own = {each.name: each for each in self.traces if each.name in shares and not each.edges.curved}
        slipped, parts = self.slips @ self.motions, list[tuple[FloatArray, ...]]()
        for name, trace in own.items():
            moved = (trace.turned[..., None] * slipped[trace.start + trace.columns]).mean(axis=1)
            parts.append((moved, *self._works(trace, shares[name].room * shares[name].weights, 1)))
        if not parts:
            return
        every, row, mass = (np.concatenate(each) for each in zip(*parts, strict=True))
        every[np.abs(every) < _ALIKE] = 0.0  # what a motion does not move is rounding
        ways = np.sign(np.take_along_axis(every, (every != 0.0).argmax(axis=1)[:, None], axis=1))  # 0 where all rests
        first = (np.abs(ways[:, None] * every[:, None] - ways * every).max(axis=2) < _ALIKE).argmax(axis=1)
        ends = np.cumsum([len(each) for each, *_ in parts])[:-1]
        for group in np.unique(first[(mass > 0.0) & ways.any(axis=1)]):
            way = np.where(first == group, ways.T, 0.0)[0]
            on = zip(own, np.split(way[:, None], ends), strict=True)
            left = {name: replace(shares[name], values=part * shares[name].room) for name, part in on}
            yield _Group(way @ row, float(np.abs(way) @ mass), left)

    def _by_pressure(self, pressures: Mapping[str, FloatArray], pieces: int) -> Iterator[_Group]:
        """What presses a body, by contact and by the body beyond it, cut along its line into pieces that bear alike."""
        for trace in (each for each in self.traces if each.name in pressures):
            row, force = self._works(trace, pressures[trace.name], 0)
            middle, body = trace.places[trace.columns].mean(axis=1), np.append(trace.space.block, -1)
            beside = np.unique(np.sort(body[trace.edges.cells], axis=1), axis=0, return_inverse=True)[1].ravel()
            for pair in np.unique(beside[force > 0.0]):
                edges = np.flatnonzero((beside == pair) & (force > 0.0))
                axes = np.linalg.svd(middle[edges] - middle[edges].mean(axis=0), full_matrices=False)[2]
                edges = edges[np.argsort(middle[edges] @ axes[0])]
                before = np.cumsum(force[edges]) - force[edges] / 2.0
                for here in (edges[pieces * before // force[edges].sum() == piece] for piece in range(pieces)):
                    if len(here):
                        yield _Group(-row[here].sum(axis=0), force[here].sum(), {}, has_coulomb(trace.contact))


_ENERGIES: WeakKeyDictionary[ContactProblem, _Energies] = WeakKeyDictionary()
"""Those of problems, as long as these are there: one bracket asks for several norms."""
