"""The norm of the friction operator R, proved or by finite elements, and the bounds of errors that follow from it.

R maps W, the displacements that vanish where displacements are prescribed, to W. On contacts with Coulomb friction
(Rv)_N = μ s v_T, with the share s, and (Rv)_T = 0. On the other contacts (Rv)_N = 0, and (Rv)_T = 0 where they bear
shear. Any R of this kind with RR = 0 will do. On rectangles Rv = θ v_a e_b and on star-shaped bodies Rv = η v_t n have
proved norms. On other bodies finite elements give the R of least energy, and its norm is computed, not proved. Rigid
motions that contacts alone stop are then left out of W.

In `docs/theory.md`: (D26), (D28), (D29), (D30), (D32), (D39).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from math import comb
from types import MappingProxyType
from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy import sparse
from scipy.linalg import eigh, orth, qr
from scipy.sparse.linalg import spsolve

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.share import Share, bodies_of, held_subspaces, shares_on
from qvi_contact.companion.body import Elasticity
from qvi_contact.companion.contact import DisplacementContact
from qvi_contact.companion.model import MOST, SINGULAR, BodyAtRest, least_energy, solutions
from qvi_contact.discretization.displacements import PARALLEL, DisplacementSpace, triangle
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element.edge import bernstein_basis, bernstein_from_values, lobatto_points, product_integrals
from qvi_contact.mechanism.mechanism import null_space
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem

ANGLES: Final = np.linspace(0.0, np.pi / 2.0, 4097)
"""Angles χ at which the function whose maximum is the square of a norm is evaluated."""
ROUNDED: Final = 1.0 + 1e-6
"""A factor of safety: times the largest value at `ANGLES` it is above the maximum over all angles."""
_PLACE: Final = 1e-9  # of the body's size: points within this distance of a line lie on it
_FIELD_DEGREE: Final = 2  # degree of the elements for the field ψ_h in (D32)


def one_ratio(problem: ContactProblem) -> float | None:
    """Poisson's ratio ν′ = −c12/c11 of the plane state of a body of one material; None if it has several materials."""
    if len(np.unique(problem.compliances.reshape(-1, 9), axis=0)) > 1:
        return None
    return -float(problem.compliances[0][0, 1] / problem.compliances[0][0, 0])


def proved_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """The smaller of the two proved norms, the largest over all bodies; infinity where no norm is proved.

    No norm is proved for bodies with arcs or cracks, for plates that forces drive if they have friction or are tied to
    the body, for bodies on tied beds of springs, and for springs along a contact with friction. Other springs only
    lower the norm: (Rv, 0) is an image without stretch of springs, and |(v, d)| ≥ |v|.
    """
    for contact in problem.contacts:
        is_rough, is_tied = has_coulomb(contact), contact.law == "tied"
        has_bed = contact.tangential_stiffness is not None if is_rough else is_tied and contact.has_springs
        is_driven = contact.plate is not None and contact.plate.driven
        if has_bed or (is_driven and (is_rough or is_tied)):
            return np.inf
    bodies, largest_norm = bodies_of(problem), 0.0
    for body in bodies:
        if any(map(has_coulomb, body.problem.contacts)):
            own, has_arcs = shares_on(body, problem, shares), body.problem.mesh.sides.any()
            norm = np.inf if has_arcs else min(rectangle_norm(body.problem, own), star_norm(body.problem, own))
            if not norm < np.inf:  # NaN proves nothing either
                return np.inf
            largest_norm = max(largest_norm, norm)
    return largest_norm if bodies else np.inf


def rectangle_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """A bound of |R| for Rv = θ v_a e_b, see (D29); infinity if the body is no suitable rectangle.

    The body is a rectangle of one material with axes a and b. Its contacts with Coulomb friction lie on one side or on
    two opposite sides, whose normals are ±e_b. On one whole side with the normal ±e_a, v_a = 0. θ is ±μ s on the sides
    with contacts, with the sign of the normal, and linear along b.
    """
    # coordinates along the tangent (axis a) and the normal (axis b) of the first edge with friction
    mesh, boundary, ratio, a, b = problem.mesh, problem.mesh.boundary, one_ratio(problem), 0, 1
    rough_edges = mesh.edges(next(filter(has_coulomb, problem.contacts)).edges)
    rotation = np.column_stack([rough_edges.tangent[0], rough_edges.normal[0]])
    normals, held = boundary.normal @ rotation, rotation.T @ held_subspaces(problem) @ rotation
    vertices, tangents = mesh.vertices @ rotation, boundary.tangent @ rotation[:, 0]
    # every edge lies on a side of the bounding rectangle: the side with the normal ±e_axis, + where `at_high_end`
    corners, axis = vertices[np.unique(mesh.cells)], np.argmax(np.abs(normals), axis=1)
    low, high, edge_numbers = corners.min(axis=0), corners.max(axis=0), np.arange(len(axis))
    at_high_end = normals[edge_numbers, axis] > 0.0
    edge_ends = vertices[np.stack([boundary.first, boundary.second], axis=1)]
    distance = np.abs(edge_ends.mean(axis=1) - np.where(at_high_end[:, None], high, low))[edge_numbers, axis]
    is_held = np.abs(held - np.eye(2)).max(axis=1) <= PARALLEL  # (edges, 2)
    is_slanted = (np.abs(normals).max(axis=1) < 1.0 - _PLACE) | (np.abs(held[:, a, b]) > PARALLEL)
    if ratio is None or is_slanted.any() or distance.max() > _PLACE * (high - low).max():
        return np.inf
    # by edge: whether (Rv)_N = 0 and (Rv)_T = 0 are demanded, and whether friction acts; θ at both ends and the
    # largest |θ|; bounds of |dθ/dt| on 16 parts, see `Share.steepest`
    no_normal, no_tangential, has_friction = np.zeros((3, len(boundary)), dtype=bool)
    theta, theta_slopes = np.zeros((len(axis), 3)), np.zeros((len(axis), 16))
    for contact in problem.contacts:
        edges = mesh.edge_set(contact.edges)
        if has_coulomb(contact):
            share = shares[contact.name]
            signed_friction = np.where(at_high_end[edges], share.friction, -share.friction)
            theta[edges, :2] = signed_friction[:, None] * share.values[:, [0, -1]]
            theta[edges, 2] = share.friction * np.abs(share.values).max(axis=1)
            has_friction[edges], theta_slopes[edges] = True, share.friction * share.steepest()
        elif contact.law != "tied":
            no_normal[edges], no_tangential[edges] = True, bears_shear(contact)
    if (axis[has_friction] != b).any() or (tangents[has_friction] < 0.0).any():
        return np.inf
    # on the sides with the normal ±e_a: v_a = 0 on one whole side; elsewhere v_a = 0, or nothing is demanded along e_b
    extent = high - low
    is_mirror = [[is_held[(axis == k) & (at_high_end == end), k].all() for end in (False, True)] for k in (0, 1)]
    if not any(is_mirror[a]) or not (is_held[:, a] | ~(is_held[:, b] | no_tangential))[axis == a].all():
        return np.inf
    # max |θ| and H on each side with the normal ±e_b where θ is demanded: ±μ s, or 0 where (Rv)_b = 0 and v_a is free
    is_demanded = (axis == b) & (has_friction | ((is_held[:, b] | no_normal) & ~is_held[:, a]))
    zeros, largest_theta, H_of_sides = np.array([low[a], high[a]])[is_mirror[a]], list[float](), list[FloatArray]()
    for end in {*at_high_end[is_demanded].tolist()}:
        edges = np.flatnonzero(is_demanded & (at_high_end == end))
        edges = edges[np.argsort(edge_ends[edges, :, a].min(axis=1))]
        spans_of_edges = np.sort(edge_ends[edges, :, a], axis=1)
        H_of_sides.append(_slope_factor(spans_of_edges, theta[edges], theta_slopes[edges], zeros))
        largest_theta.append(float(theta[edges, 2].max()))
    theta_b = 0.0 if len(largest_theta) == 1 else sum(largest_theta) / extent[b]  # ≥ |∂_b θ|
    H = float(np.max(H_of_sides, axis=0).min())
    # β of a part of the mirrored rectangle, which is cut in n parts along an axis across which ω is odd, so that the
    # mean of ω over each part is zero: along b, and also along a if the rectangle is mirrored along b
    aspect = (extent[b] if any(is_mirror[b]) else extent[b] / 2.0) / extent[a]
    aspect = max(aspect, 1.0 / aspect) if any(is_mirror[b]) else aspect
    part_aspects = [min(aspect / n, n / aspect) for n in (max(int(aspect), 1), int(aspect) + 1)]
    inf_sup = float(np.sin(0.5 * np.arctan(max(part_aspects))))
    return rectangle_constant(ratio, inf_sup, max(largest_theta), theta_b * 2.0 * extent[a] / np.pi, H)


def _slope_factor(spans_of_edges: FloatArray, theta: FloatArray, slopes: FloatArray, zeros: FloatArray) -> FloatArray:
    """H with ‖∂_aθ v_a‖ ≤ H ‖∂_a v_a‖ on one side: H² = ∫ (∂_aθ)² |a − a₀| da, for each a₀ in `zeros`, where v_a = 0.

    Edges are in order, with θ at their ends and bounds of its slopes on equal parts; θ is linear between edges.
    """
    # gaps: start, end, change of θ. Where edges meet, a jump of θ, which springs across a contact allow, has no bound
    gaps = np.stack([spans_of_edges[:-1, 1], spans_of_edges[1:, 0], np.abs(theta[1:, 0] - theta[:-1, 1])])
    is_gap = gaps[1] > gaps[0]
    slopes[1:][~is_gap & (gaps[2] > _PLACE)] = np.inf
    grid = np.linspace(spans_of_edges[:, 0], spans_of_edges[:, 1], slopes.shape[1] + 1)
    parts = np.stack([grid[:-1], grid[1:], slopes.T / np.diff(grid, axis=0)]).reshape(3, -1)
    gaps = gaps[:, is_gap]
    gaps[2] /= gaps[1] - gaps[0]
    start, stop, slope = np.concatenate([parts, gaps], axis=1)
    squares = slope**2 * np.abs((start + stop) / 2.0 - zeros[:, None]) * (stop - start)
    return np.asarray(np.sqrt(squares.sum(axis=1)))


def rectangle_constant(ratio: float, inf_sup: float, largest: float, steepest: float, H: float = 0.0) -> float:
    """A bound of the norm of v ↦ θ v_a e_b in the energy norm, r in (D29).

    `ratio` is Poisson's ratio ν′ = −c12/c11 of the plane state: ν in plane stress, ν/(1 − ν) in plane strain. `inf_sup`
    is β of the rectangle mirrored at the sides where displacements are odd. `largest` is e = max |θ|, `steepest` is d =
    max |∂_bθ| times the constant k of Poincaré's inequality ‖v_a‖ ≤ k ‖∂_a v_a‖; ‖∂_aθ v_a‖ ≤ H ‖∂_a v_a‖.
    """
    if not np.isfinite(H):
        return float("inf")
    one_minus, one_plus, G = 1.0 - ratio, 1.0 + ratio, inf_sup**-2
    e_cos = largest * np.cos(ANGLES)
    P = steepest * np.cos(ANGLES) + (largest + H) * np.sqrt(one_minus / 2.0) * np.sin(ANGLES)
    M = np.array([G / (2.0 * one_minus), (G - 1.0) / (2.0 * one_plus)])
    square = e_cos**2 * (M.sum() + 0.5 / one_minus) + P**2 / (one_minus * one_plus)
    square += 2.0 * e_cos * np.sqrt(M[0] * (e_cos**2 + P**2) / (2.0 * one_minus))
    square += 2.0 * e_cos * P * np.sqrt(M[1] / (2.0 * one_plus))
    return float(np.sqrt(square.max()) * ROUNDED)


def star_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float:
    """A bound of |R| for Rv = η v_t n, see (D32); infinity if the body or its contacts do not suit.

    The body has one material and no holes, and is star-shaped with respect to a disc. All contacts with Coulomb
    friction are parallel, with the normal n and the tangent t, and slip one way: η = ±μ is one number. Elsewhere
    nothing may be demanded of displacements along n, or v_t = 0.
    """
    boundary, held = problem.mesh.boundary, held_subspaces(problem)
    weights = np.zeros(len(boundary))  # by edge ±μ, with the sense of slip along the edge's tangent
    for share in shares.values():
        if not share.slipping.all() or np.ptp(share.slipping) != 0.0:
            return np.inf
        weights[problem.mesh.edge_set(share.contact.edges)] = share.slipping[0] * share.friction
    rough_edges = np.flatnonzero(weights != 0.0)
    normal = boundary.normal[rough_edges[0]]
    tangent = np.array([-normal[1], normal[0]])
    across = weights[rough_edges] * (boundary.normal[rough_edges] @ normal)
    is_parallel = np.abs(boundary.normal[rough_edges] @ tangent).max() <= PARALLEL
    if not is_parallel or np.ptp(across) > PARALLEL * np.abs(across).max():
        return np.inf
    ratio, missed = one_ratio(problem), np.abs(np.stack([held @ tangent - tangent, held @ normal])).max(axis=2)
    if ratio is None or (missed > PARALLEL).all(axis=0).any():
        return np.inf
    for contact in problem.contacts:
        edges = problem.mesh.edge_set(contact.edges)
        is_other = contact.law != "tied" and not weights[edges].any()
        if is_other and (bears_shear(contact) or np.abs(boundary.normal[edges] @ normal).max() > PARALLEL):
            return np.inf
    # |Rv| ≤ |η| max_χ cos χ ‖ω‖ + (the terms of the strains ε_tn and ε_tt), see (D32)
    G, one_minus = _divergence_constant(problem, held), 1.0 - ratio
    cos_angle, weighted_sin = np.cos(ANGLES), np.sqrt(one_minus / 2.0) * np.sin(ANGLES)
    rotation = np.sqrt((G - 0.5) / min(one_minus, 1.0 + ratio))
    strains = np.sqrt(cos_angle**2 / (2.0 * one_minus) + weighted_sin**2 / (1.0 - ratio**2))
    return float(np.abs(across).max()) * float((cos_angle * rotation + strains).max() * ROUNDED)


def _divergence_constant(problem: ContactProblem, held: FloatArray) -> float:
    """G in (D32): every rotation ω of a displacement is div ψ with ‖∇ψ‖² ≤ G ‖ω‖².

    ψ vanishes on the boundary, component by component, but on edges where that component of displacements is held.
    """
    from scipy.optimize import fmin_slsqp  # slow to import, and few bodies need it

    mesh, boundary = problem.mesh, problem.mesh.boundary
    corners = mesh.vertices[np.unique([boundary.first, boundary.second])]
    middle = corners.mean(axis=0)
    corners, starts = ((each - middle) / mesh.length for each in (corners, mesh.vertices[boundary.first]))

    # max r/R over centres c, with r the distance of c from the lines n·x = b of all edges, R that from the farthest
    # vertex. With t = 1/R and y = t c this is convex: the largest ρ ≤ b t − n·y with |t x − y| ≤ 1 at all vertices x
    rows = np.column_stack([-boundary.normal, (starts * boundary.normal).sum(axis=1), -np.ones(len(starts))])

    def margins(point: FloatArray) -> FloatArray:
        """Margins of the inequalities at (y, t, ρ)."""
        return np.concatenate([rows @ point, 1.0 - ((point[2] * corners - point[:2]) ** 2).sum(axis=1)])

    negative_rho, start = np.array([0.0, 0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0, -1.0])
    optimum = np.asarray(fmin_slsqp(negative_rho.dot, start, f_ieqcons=margins, iprint=0, acc=1e-12))
    y, t = optimum[:2], optimum[2]  # every centre y/t gives a bound, also one that is not the best
    ratio = float((rows[:, :3] @ optimum[:3]).min() / max(np.linalg.norm(t * corners - y, axis=1).max(), 1e-300))
    inf_sup = float(np.sin(0.5 * np.arcsin(max(ratio, 0.0))))  # ≤ β
    if not inf_sup > 0.0 or mesh.hole_edges.any():
        return np.inf
    # ψ_h minimises ‖∇ψ‖² + ‖1 − div ψ‖²/β² and is then scaled to the mean divergence 1
    space = DisplacementSpace.of(problem, triangle(_FIELD_DEGREE))
    n, numbers = len(space.cell.places), space.along(problem.mesh.boundary)
    is_free = np.ones((space.size // 2, 2), dtype=bool)
    np.logical_and.at(is_free, numbers, (np.abs(held - np.eye(2)).max(axis=1) <= PARALLEL)[:, None])
    free_dofs = is_free.ravel()
    trace = np.array([1.0, 1.0, 0.0])
    body = Elasticity(space, np.tile(np.outer(trace, trace), (len(space.table), 1, 1)))
    div_squared, (t, weights) = body.stiffness(), body.points()  # ‖div ψ‖²
    div_integral, area = body.virtual_work(weights[..., None] * trace, t), float(weights.sum())  # ∫ div ψ
    gradients = body.gradients(t)
    blocks = np.einsum("cq,cqai,cqaj,kl->cikjl", weights, gradients, gradients, np.eye(2), optimize=True)
    laplace = space.assembled(blocks.reshape(-1, 2 * n, 2 * n))  # ‖∇ψ‖²
    matrix, right = laplace + div_squared / inf_sup**2, div_integral / inf_sup**2
    if not right[free_dofs].any():
        return np.inf
    field = np.zeros(space.size)
    field[free_dofs] = spsolve(sparse.csc_array(matrix[free_dofs][:, free_dofs]), right[free_dofs])
    integral = float(div_integral @ field)
    if not integral > 1e-9 * area:
        return np.inf
    field *= area / integral
    A = np.sqrt(float(field @ (laplace @ field)) / area)
    B = np.sqrt(max(float(field @ (div_squared @ field)) / area - 1.0, 0.0))
    return float((A + B / inf_sup) ** 2 + inf_sup**-2)


LARGEST: Final = 2.0
"""The norm r of R from which on no error is bounded: (D28) needs r < 2."""

TOO_LARGE: Final = "The bounds need a norm of the friction operator below 2. Here it is {:.3g}."
COMPUTED: Final = "The norm of the friction operator, {:.3g}, was computed by finite elements, not proved."
UNHELD: Final = (
    "{}, and {}. Errors are not bounded: refine the mesh, or hold the body along a contact if there is a support in "
    "reality."
)
_DEGREE: Final = 3  # of the displacements with which norms are computed
_SMALL: Final = 0.5  # norm below which F is at most 1.13 times that of the norm 0: a smaller one is not worth the time
_QUICK: Final = 400  # coefficients of slip up to which a norm below 2 is made smaller in a few seconds
_MOTIONS: Final = 3  # up to this number of motions, the norm is computed for all combinations of their senses
_PARTS: Final = (0.125, 0.25, 0.5, 1.0)  # λ in (D39), the part of the unused friction that is taken: r grows with λ
_ALIKE: Final = 1e-6  # relative to a motion's largest coefficient: slips that differ by less are equal, or zero
_STOPS: Final = 1e-6  # relative singular value of the means of motions over groups, below which a motion is not stopped
_RIGID: Final = 1e-10  # strain energy, relative to that of the single coefficients, below which a motion is rigid
_CHOICES: Final = 20  # up to this number, all choices of groups that stop the motions are tried
_PIECES: Final = (1, 2, 3)  # numbers of pieces into which a contact that presses is cut


def coercivity(r: float) -> float:
    """α = 1 − r/2 in (D28): a(e, q) ≥ α |e|² and a(e, q) ≥ α |q|² for q = e − Re, r the norm of R."""
    return 1.0 - r / 2.0


def amplification(r: float) -> float:
    """The factor f = (4 + r²)/(4 − r²) of (D28), which multiplies ρ in F: |q| |e| ≤ f a(e, q); infinite for r ≥ 2."""
    return (4.0 + r**2) / (4.0 - r**2) if r < LARGEST else float("inf")


def error_bound(residual: float, defect: float, r: float) -> float:
    """F = ½ [fρ + √(f²ρ² + 4δ/α)] ≥ |σ − τ|, |u − v|, the larger root of x² = fρx + δ/α; infinite for r ≥ 2. See T2."""
    if not r < LARGEST:
        return float("inf")
    grown = amplification(r) * residual
    return float(0.5 * (grown + np.hypot(grown, 2.0 * np.sqrt(defect / coercivity(r)))))


def defect_bound(residual: float, defect: float, r: float) -> float:
    """The bound ρ²/(4α) + δ of Σ, see T2; infinite for r ≥ 2."""
    return residual**2 / (4.0 * coercivity(r)) + defect if r < LARGEST else float("inf")


@dataclass(frozen=True)
class FrictionNorm:
    """A bound of |R|; infinite where none is known.

    It is `proved`, or was computed by finite elements, see `reason`; on displacements without motions `stopped` in one
    or several ways. Then bounds hold for solutions with |σ − τ| < `reach` [√energy], or for none if they are larger.
    """

    value: float
    proved: bool
    reason: str
    stopped: tuple[Stopped, ...] = ()
    reach: float = np.inf

    def slack(self, shares: Mapping[str, Share], residual: float, defect: float, error: float) -> float:
        """A bound of Σ in (D27) from ρ, δ and F: X = δ + ρ²/(4α), and the work that motions add."""
        sums = ((each, defect_bound(residual, defect, each.norm)) for each in self.stopped)
        found = (X + each.work(shares, error, X) for each, X in sums)
        return min(found, default=defect_bound(residual, defect, self.value))

    def work(
        self, problem: ContactProblem, shares: Mapping[str, Share], residual: float, defect: float, error: float
    ) -> float:
        """A bound of ∫ (σ − τ) : ε(Re) for the R of the given shares, from ρ, δ and F; proved if `self` is."""
        if not any(share.values.any() for share in shares.values()):
            return 0.0
        if self.proved:
            return proved_norm(problem, shares) * error**2
        norms = {each: computed_norm(problem, shares, each) for each in {way.energies for way in self.stopped}}
        sums = ((each, defect_bound(residual, defect, each.norm)) for each in self.stopped)
        return min(norms[each.energies] * error**2 + each.work(shares, error, X) for each, X in sums)


def friction_norm(
    problem: ContactProblem, shares: Mapping[str, Share], unit: float = 1.0,
    pressures: Mapping[str, FloatArray] = MappingProxyType({}), error: Callable[[float], float] = amplification,
    size: float = np.inf,
) -> FrictionNorm:  # fmt: skip
    """The least proved norm if the `error` F(r) that it proves is at most the `size` |τ|, else that by finite elements.

    It is the largest of the norms of the single bodies; nothing is proved with arcs. Weights of shares are in the unit
    [stress], as are `pressures`: by contact that may open |τ_N| (edges, q) where v touches the obstacle on the whole
    edge, 0 on other edges.
    """
    if not shares:
        return FrictionNorm(0.0, True, "")
    proved = proved_norm(problem, shares)
    by_proof = FrictionNorm(proved, True, f"The norm of the friction operator is at most {proved:.4g}.")
    if proved < LARGEST and error(proved) <= size:
        return by_proof
    likely = likely_norm(problem, shares)
    value, energies, ways = likely.value, _ENERGIES[problem], list(likely.stopped)
    if np.isnan(value):
        too_many = FrictionNorm(np.inf, False, "There are too many contact edges to compute the norm of friction.")
        return by_proof if proved < LARGEST else too_many
    if value < _SMALL or (ways and energies.slip_basis.shape[1] > _QUICK):
        return likely
    ways += energies.stopped(shares, pressures, unit)
    if not ways:
        return FrictionNorm(value, False, TOO_LARGE.format(value) if value < np.inf else energies.unheld(shares))
    valid = sorted((each for each in ways if error(each.norm) < each.reach), key=lambda each: each.reach, reverse=True)
    if not valid:
        nearly = max(ways, key=lambda each: each.reach / error(each.norm))
        of_size, bound = (100.0 * each / size for each in (nearly.reach, error(nearly.norm)))
        proviso = f"only if the error is below {of_size:.2g} %, but its bound is {bound:.2g} %"
        why = UNHELD.format(energies.cause.capitalize(), f"friction and pressure stop its motion {proviso}")
        reason = why if nearly.norm < LARGEST else TOO_LARGE.format(nearly.norm)
        return FrictionNorm(nearly.norm, False, reason, (nearly,), nearly.reach)
    # solutions within the farthest reach are bounded: those within any bound are within all ways that reach beyond it
    best = valid[0]
    for each in valid:
        best = each if each.norm < best.norm and each.reach > error(best.norm) else best
    used = (each for each in valid if each.energies in (energies, best.energies) and each.reach > error(best.norm))
    return FrictionNorm(best.norm, False, COMPUTED.format(best.norm), tuple(used), valid[0].reach)


def likely_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> FrictionNorm:
    """The norm by finite elements on all displacements; infinite or NaN as in `computed_norm`."""
    value = computed_norm(problem, shares)
    nothing = np.zeros((len(_ENERGIES[problem].slips), 0))
    ways = (Stopped(nothing, nothing[0], nothing[0], _ENERGIES[problem], value),) if value < LARGEST else ()
    return FrictionNorm(value, False, COMPUTED.format(value), ways)


def computed_norm(problem: ContactProblem, shares: Mapping[str, Share], restricted: _Energies | None = None) -> float:
    """The norm of the R of least energy, max |Rv|/|v| among finite elements on the mesh.

    Its square is the largest λ of D x = λ A x, see (D30), of all displacements, or the `restricted` ones. It
    is infinite where contacts can slip without strain, and NaN where there are too many coefficients.
    """
    if problem not in _ENERGIES:
        _ENERGIES[problem] = _Energies.of(problem)
    energies = _ENERGIES[problem] if restricted is None else restricted
    if not len(energies.normal_energy):
        return np.nan if energies.slips.any() else 0.0
    return np.inf if restricted is None and energies.has_slip else energies.norm(energies.image(shares))


@dataclass(frozen=True, eq=False)
class Stopped:
    """Motions d_k, 1 ≤ k ≤ j, that contacts stop, see (D39): rigid ones, or those of least energy of slender bodies.

    Each motion moves one group of edges by the mean 1, the other groups by the mean 0. A group is stopped either by
    friction where it sticks, with the weight ω = λ (1 − |s|) B(τ), or by the pressure of contacts that may open, with
    ω = |τ_N|. t_k is the mean over the group, with the weight ω, of e_T for friction, of −e_N for pressure, where
    e = u − v. (D39) holds for every solution with |σ − τ| < `reach`, with the share s + p, p = sign(t_k) ω/B(τ).
    Without motions (j = 0) all displacements count.
    """

    motions: FloatArray  # (n, j): slips of d_k
    masses: FloatArray  # (j,): M_k = ∫ ω ds over the group [energy per unit of displacement]
    images: FloatArray  # (j,): |R d_k|, the largest over all senses [√energy per unit of displacement]
    energies: _Energies  # of displacements whose means over the groups are 0
    norm: float  # norm of R for s + p on these displacements, the largest over all senses

    @property
    def reach(self) -> float:
        """S* = min M_k/|R d_k| [√energy], infinite where all R d_k are rigid motions."""
        is_strained = self.images > 0.0
        return float((self.masses[is_strained] / self.images[is_strained]).min(initial=np.inf))

    def work(self, shares: Mapping[str, Share], error: float, defect: float) -> float:
        """A bound of ∫ (σ − τ) : ε(Σ t_k R d_k) for the R of the given shares, from F and X = δ + ρ²/(4α)."""
        sizes = self.energies.sizes(self.energies.image(shares) @ self.motions)
        return float(error * defect * (sizes / (self.masses - error * self.images)).max(initial=0.0))


class _Group(NamedTuple):
    """A group of edges over which the mean of a motion is taken, with the weight ω of friction or of pressure."""

    row: FloatArray  # (2 n,): c ↦ ∫ ω e_T ds for friction, −∫ ω e_N ds for pressure
    mass: float  # ∫ ω ds
    unused: Mapping[str, Share]  # by contact ±(1 − |s|), with − on edges that move backwards; empty for pressure
    is_rough: bool = False  # pressure of a contact with friction


@dataclass(frozen=True, eq=False)
class _Energies:
    """Least strain energies of displacements with given slips, or normal parts, on contacts with Coulomb friction."""

    traces: tuple[DisplacementContact, ...]
    scales: Scales
    B: FloatArray  # (2, n, k): normal and tangential coefficients on all contacts, of the unknowns w (k,) there
    slips: FloatArray  # (n, k): tangential coefficients on contacts with Coulomb friction, 0 on other contacts
    held: FloatArray  # (h, k): rows that vanish, on contacts that are tied or keep their distance
    stiffness: FloatArray  # (k, k): S
    motions: FloatArray  # (k, j): rigid motions w, with the largest coefficient 1
    lines: FloatArray  # (n, m): slips of all rigid motions of bodies, as if nothing held them
    # (n, n): least energies of given normal coefficients with zero slip; empty, as the next two, where n is too large
    normal_energy: FloatArray
    slip_basis: FloatArray  # (n, a): basis of the slips that displacements can have
    slip_energy: FloatArray  # (a, a): least energies of given slips, A in (D30), in that basis

    @classmethod
    def of(cls, problem: ContactProblem) -> _Energies:
        """Energies of displacements of degree 3 on the mesh."""
        rest, empty = BodyAtRest.of(problem, _DEGREE), np.zeros((0, 0))
        contacts, B = rest.contacts, rest.B.reshape(2, rest.contacts.count, -1)
        is_coulomb, is_tied, is_sheared = contacts.where(has_coulomb), contacts.tied, contacts.where(bears_shear)
        held_rows = rest.B[np.append(contacts.bilateral, is_tied)]
        motions = rest.body.R / max(float(np.abs(rest.B @ rest.body.R).max(initial=0.0)), _ALIKE)
        motions = motions @ null_space(held_rows @ motions, _ALIKE)
        normals, slips = is_coulomb[:, None] * B
        rigid = rest.body.body.space.rigid()
        lines = is_coulomb[:, None] * (contacts.rows[contacts.count :, : len(rigid)] @ rigid)
        lines = lines / max(float(np.abs(lines).max(initial=0.0)), _ALIKE)
        parts = contacts.traces, Scales.of(problem), B, slips, held_rows, rest.body.S, motions, lines
        if len(rest.live) > MOST:
            return cls(*parts, empty, empty, empty)
        normal_energy = least_energy(rest.body.S, normals, rest.B[np.append(~is_coulomb, is_sheared | is_tied)])
        return cls(*parts, normal_energy, empty, empty).without(held_rows[:0])

    def without(self, rows: FloatArray) -> _Energies:
        """The energies of displacements on which the functionals `rows` (r, k) vanish too."""
        zero = np.vstack([self.held, rows])
        basis = orth(self.slips @ solutions(zero)[1], SINGULAR)
        return replace(self, slip_energy=least_energy(self.stiffness, basis.T @ self.slips, zero), slip_basis=basis)

    def norm(self, *images: FloatArray) -> float:
        """The largest (Σ |R_k v|²)^½/|v|, each R_k a matrix (n, n) from slips to normal coefficients."""
        in_basis = (each @ self.slip_basis for each in images if each.any())
        D = sum((each.T @ self.normal_energy @ each for each in in_basis), np.zeros_like(self.slip_energy))
        return float(np.sqrt(max(float(eigh(D, self.slip_energy, eigvals_only=True)[-1]), 0.0))) if D.any() else 0.0

    def sizes(self, normal: FloatArray) -> FloatArray:
        """|v| (j,) of given normal coefficients (n, j) [√energy per unit of displacement]; 0 for rigid motions."""
        squares = (normal * (self.normal_energy @ normal)).sum(axis=0)
        is_strained = squares > _RIGID * (np.diag(self.normal_energy) @ normal**2)
        return np.sqrt(self.scales.energy * np.where(is_strained, squares, 0.0))

    def image(self, shares: Mapping[str, Share]) -> FloatArray:
        """The matrix (n, n) from slips to the normal coefficients of μ s v_T, interpolated edge by edge."""
        matrix = np.zeros_like(self.normal_energy)
        for trace in self.traces:
            if trace.name in shares:
                share, p = shares[trace.name], trace.columns.shape[1] - 1
                nodes, to_bernstein = lobatto_points(p), bernstein_from_values(p)
                mu_s = share.friction * share.at(nodes)
                blocks = np.einsum("ij,ej,jk,ek->eik", to_bernstein, mu_s, bernstein_basis(p, nodes), trace.turned)
                columns = trace.start + trace.columns
                matrix[columns[:, :, None], columns[:, None, :]] = blocks
        return matrix

    def stopped(self, shares: Mapping[str, Share], pressures: Mapping[str, FloatArray], unit: float) -> list[Stopped]:
        """Ways in which contacts stop motions without strain, or with little; empty if they do not.

        Friction alone is tried first, then pressure too. Contacts that press are cut into 1, 2 or 3 pieces. Weights and
        pressures are in the `unit` [stress].
        """
        friction_groups, unit = list(self._friction_groups(shares)), self.scales.energy * unit / self.scales.stress
        ways = list(self._stopped(shares, friction_groups, unit))
        for pieces in () if ways or not self.has_slip else _PIECES:
            ways += self._stopped(shares, [*friction_groups, *self._pressure_groups(pressures, pieces)], unit)
        return ways

    def unheld(self, shares: Mapping[str, Share]) -> str:
        """Why motions without strain that slip are not stopped."""
        slip = np.abs(self.slips @ self.motions).max(axis=1, initial=0.0)
        slipping = [each.name for each in self.traces if each.name in shares and slip[each.here].max() > _ALIKE]
        without_stick = [name for name in slipping if not (shares[name].room * shares[name].weights).any()]
        names = " and ".join(map(repr, without_stick or slipping))
        return UNHELD.format(
            self.cause.capitalize(), f"neither a sticking part of {names} nor pressure stops its motion"
        )

    @property
    def has_slip(self) -> bool:
        """Whether a motion without strain slips."""
        return bool(np.abs(self.slips @ self.motions).max(initial=0.0) > _ALIKE)

    @property
    def cause(self) -> str:
        return "contacts alone hold a body" if self.has_slip else "slip strains a slender body little"

    def _stopped(self, shares: Mapping[str, Share], groups: Sequence[_Group], unit: float) -> Iterator[Stopped]:
        """The ways in which groups stop all motions, if they do; `unit` is that of masses over displacements."""
        if not groups:
            return
        rows = np.array([each.row for each in groups])
        rows_w, motion_slips = rows @ np.concatenate(self.B), self.slips @ self.motions
        if not self.has_slip:
            means = rows[:, len(self.slips) :] @ self.slip_basis
            d = np.linalg.solve(self.slip_energy, means.T)
            compliances = means @ d
            sizes = np.sqrt(np.maximum(np.diag(compliances), 0.0))
            is_slipping = sizes.min() > 0.0 and np.linalg.cond(compliances / np.outer(sizes, sizes)) < 1.0 / _STOPS
            if is_slipping and len(groups) <= _MOTIONS:
                d = self.slip_basis @ d @ np.linalg.inv(compliances) * [each.mass for each in groups]
                yield from self._ways(shares, groups, rows_w, np.asarray(d, dtype=np.float64), unit)
            return
        # groups with independent means of motions: all choices, or the best one where there are many
        means = rows_w @ self.motions
        _, R, order = qr(means.T, pivoting=True)
        rank, least = int((np.abs(np.diag(R)) > _STOPS * np.abs(R[0, 0])).sum()), _STOPS * np.abs(R[0, 0])
        is_many = comb(len(groups), rank) > _CHOICES
        for chosen in [order[:rank]] if is_many else map(list, combinations(range(len(groups)), rank)):
            free = null_space(means[chosen], least)
            if free.shape[1] + rank > means.shape[1] or np.abs(motion_slips @ free).max(initial=0.0) > _ALIKE:
                continue  # means that depend on each other, or a motion with slip whose means are all zero
            stopping = [groups[k] for k in chosen]
            d = motion_slips @ np.linalg.pinv(means[chosen]) * [each.mass for each in stopping]
            yield from self._ways(shares, stopping, rows_w[chosen], np.asarray(d, dtype=np.float64), unit)

    def _ways(
        self, shares: Mapping[str, Share], groups: Sequence[_Group], rows: FloatArray, d: FloatArray, unit: float
    ) -> Iterator[Stopped]:
        """The ways λ in which groups stop d_k (n, j), which moves group k by the mean 1 and the others by 0.

        `rows` (j, k) are the integrals of means; on the restricted displacements all are zero.
        """
        masses, is_friction = np.array([each.mass for each in groups]), np.array([bool(each.unused) for each in groups])
        image, p_images = self.image(shares), [self.image(each.unused) for each in groups]
        restricted = self.without(rows / np.abs(rows).max(axis=1, keepdims=True))
        is_rough = np.array([each.is_rough for each in groups])
        for part in _PARTS if is_friction.any() else (1.0,):
            # |R d_k| and the norm of R for s + p, the largest over all senses of p; of many groups d_k, which is rigid,
            # slips on group k alone, so that two senses are enough
            scaled = [part * own for own, each in zip(p_images, groups, strict=True) if each.unused]
            is_few, count = len(scaled) <= _MOTIONS, len(scaled)
            senses = product((1.0, -1.0), repeat=count) if is_few else ((1.0,) * count, (-1.0,) * count)
            operators = [image + sum(map(np.multiply, each, scaled)) for each in senses]
            images = np.max([self.sizes(each @ d) for each in operators], axis=0)
            if is_few:
                norm = max(map(restricted.norm, operators))
            else:  # |Σ ± R_k v| ≤ √j (Σ |R_k v|²)^½
                norm = restricted.norm(image) + float(np.sqrt(count)) * restricted.norm(*scaled)
            # pressure with friction: RR = 0 is lost where R d_k strains the body, so r counts twice
            norm *= 2.0 if images[is_rough].any() else 1.0
            masses_of_part = unit * np.where(is_friction, part, 1.0) * masses
            yield Stopped(d, masses_of_part, images, restricted, norm)

    def _integrals(self, trace: DisplacementContact, omega: FloatArray, along: int) -> tuple[FloatArray, FloatArray]:
        """By edge c ↦ ∫ ω e_N ds (e, 2 n), or ∫ ω e_T ds if `along` is 1, and ∫ ω ds (e,); ω: coefficients (e, q)."""
        columns, rows = trace.start + trace.columns, np.zeros((len(omega), 2, len(self.slips)))
        weights = trace.lengths[:, None] * (omega @ product_integrals(omega.shape[1] - 1, columns.shape[1] - 1))
        rows[np.arange(len(omega))[:, None], along, columns] = trace.turned * weights if along else weights
        return rows.reshape(len(omega), -1), weights.sum(axis=1)

    def _friction_groups(self, shares: Mapping[str, Share]) -> Iterator[_Group]:
        """Groups of straight edges that all motions move alike or oppositely; the weight is (1 − |s|) B(τ)."""
        straight = {each.name: each for each in self.traces if each.name in shares and not each.edges.curved}
        motion_slips = self.slips @ self.motions if self.has_slip else self.lines
        parts = list[tuple[FloatArray, ...]]()
        for name, trace in straight.items():
            slip = (trace.turned[..., None] * motion_slips[trace.start + trace.columns]).mean(axis=1)
            parts.append((slip, *self._integrals(trace, shares[name].room * shares[name].weights, 1)))
        if not parts:
            return
        # edges with the same motions up to their sign form a group, named by its first edge
        slips, row, mass = (np.concatenate(each) for each in zip(*parts, strict=True))
        slips[np.abs(slips) < _ALIKE] = 0.0
        signs = np.sign(np.take_along_axis(slips, (slips != 0.0).argmax(axis=1)[:, None], axis=1))  # 0: nothing moves
        first = (np.abs(signs[:, None] * slips[:, None] - signs * slips).max(axis=2) < _ALIKE).argmax(axis=1)
        ends = np.cumsum([len(each) for each, *_ in parts])[:-1]
        for group in np.unique(first[(mass > 0.0) & signs.any(axis=1)]):
            sign = np.where(first == group, signs.T, 0.0)[0]
            by_contact = zip(straight, np.split(sign[:, None], ends), strict=True)
            unused = {name: replace(shares[name], values=way * shares[name].room) for name, way in by_contact}
            yield _Group(sign @ row, float(np.abs(sign) @ mass), unused)

    def _pressure_groups(self, pressures: Mapping[str, FloatArray], pieces: int) -> Iterator[_Group]:
        """Groups of edges that press, by contact and pair of bodies, cut along its line into pieces of equal force.

        The part of its pressure counts with which an edge belongs to a piece.
        """
        for trace in (each for each in self.traces if each.name in pressures):
            rows, force = self._integrals(trace, pressures[trace.name], 0)
            middle, body = trace.places[trace.columns].mean(axis=1), np.append(trace.space.block, -1)
            pairs = np.unique(np.sort(body[trace.edges.cells], axis=1), axis=0, return_inverse=True)[1].ravel()
            for pair in np.unique(pairs[force > 0.0]):
                edges = np.flatnonzero((pairs == pair) & (force > 0.0))
                axes = np.linalg.svd(middle[edges] - middle[edges].mean(axis=0), full_matrices=False)[2]
                edges = edges[np.argsort(middle[edges] @ axes[0])]
                after = np.append(0.0, np.cumsum(force[edges])) / force[edges].sum()
                limits = np.clip(after[:, None], np.arange(pieces) / pieces, np.arange(1, pieces + 1) / pieces)
                for row in (np.diff(limits, axis=0) * force[edges].sum() / force[edges, None]).T @ rows[edges]:
                    yield _Group(-row, float(force[edges].sum()) / pieces, {}, has_coulomb(trace.contact))


_ENERGIES: WeakKeyDictionary[ContactProblem, _Energies] = WeakKeyDictionary()
"""The energies of each problem that is alive: one bracket asks for several norms."""
