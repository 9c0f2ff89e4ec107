"""Proved norms of the friction operator: on rectangles, Rv = θ v_a e_b, and on star-shaped bodies, Rv = η v_t n.

In `docs/theory.md`: (D29), (D32).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.share import Share, bodies_of, held_directions, shares_on, spans
from qvi_contact.companion.body import Elasticity
from qvi_contact.companion.data import PARALLEL
from qvi_contact.companion.space import DisplacementSpace, reference_matrices, triangle
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem

ANGLES: Final = np.linspace(0.0, np.pi / 2.0, 4097)
"""Angles at which a smooth function is compared for its maximum."""
ROUNDED: Final = 1.0 + 1e-6
"""Factor from the maximum at these angles to what is no less than that of all."""
_ALIKE: Final = 1e-9  # of the body's size: a place on a side
_FIELD_DEGREE: Final = 2  # of the field that shows how supports hold the mean rotation


def one_ratio(problem: ContactProblem) -> float | None:
    """Poisson's ratio of the plane state, −c12/c11, of a body of one material; None where there are several."""
    if len(np.unique(problem.compliances.reshape(-1, 9), axis=0)) > 1:
        return None
    return -float(problem.compliances[0][0, 1] / problem.compliances[0][0, 0])


def proved_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> tuple[float, str]:
    """The least proved norm, infinity where there is none, and the bodies that it is proved for.

    Nothing is proved of bodies with arcs, of cracks, of plates that forces drive, of bodies on beds of springs, and of
    springs along a contact with friction. Other springs only make the norm less: displacements without stretch are
    images, and |v| is larger than without springs.
    """
    yields = (
        each.tangential_stiffness is not None if has_coulomb(each) else each.law == "tied" and each.has_springs
        for each in problem.contacts
    )
    if any(yields):
        return np.inf, "bodies on springs"
    if any(has_coulomb(each) and each.plate is not None and each.plate.driven for each in problem.contacts):
        return np.inf, "plates that forces drive"
    try:
        bodies = bodies_of(problem)
    except InputError:
        return np.inf, "cracks"
    known, ways = [(0.0, "this body")], {"this rectangle": rectangle_norm, "this star-shaped body": star_norm}
    for body in bodies:
        if any(map(has_coulomb, body.problem.contacts)):
            own, straight = shares_on(body, problem, shares), not body.problem.mesh.sides.any()
            found = ((norm(body.problem, own), kind) for kind, norm in ways.items() if straight)
            known.append(min(((norm, kind) for norm, kind in found if norm is not None), default=(np.inf, "this body")))
    largest, kind = max(known)
    return largest, kind if len(known) < 3 else "each of the bodies"


def rectangle_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float | None:
    """The norm of Rv = θ v_a e_b on a rectangle with its contacts across the axis b; None for problems of another kind.

    The body is a rectangle of one material, its contacts with Coulomb friction lie on one side or on two opposite ones,
    and along one whole side at right angles to these v_a = 0. θ is ±μ s on the contacts, and linear along b, see (D29).
    """
    mesh, boundary, ratio = problem.mesh, problem.mesh.boundary, one_ratio(problem)
    corners, directions = mesh.vertices[np.unique(mesh.cells)], held_directions(problem)
    low, high, axis = corners.min(axis=0), corners.max(axis=0), np.argmax(np.abs(boundary.normal), axis=1)
    every = np.arange(len(axis))
    end, ends = boundary.normal[every, axis] > 0.0, mesh.vertices[np.stack([boundary.first, boundary.second], axis=1)]
    away = np.abs(ends.mean(axis=1) - np.where(end[:, None], high, low))[every, axis]
    vectors = np.concatenate([boundary.normal, *directions])
    slanted = not np.allclose(np.abs(vectors).max(axis=1), 1.0, rtol=0.0, atol=_ALIKE)
    if ratio is None or slanted or away.max() > _ALIKE * (high - low).max():
        return None
    held = np.array([[spans(each, unit) for unit in np.eye(2)] for each in directions])
    pressed, rough, rubs = np.zeros((3, len(boundary)), dtype=bool)  # where (Rv)_N = 0, (Rv)_T = 0, and with friction
    known: dict[int, tuple[FloatArray, FloatArray]] = {}  # θ at coefficients, and no less than its steps on equal parts
    for contact in problem.contacts:
        index = mesh.edge_set(contact.edges)
        if has_coulomb(contact):
            share = shares[contact.name]
            factors = np.where(end[index], share.friction, -share.friction)[:, None]
            pairs = zip(factors * share.values, share.friction * share.steepest(), strict=True)
            known |= zip(index.tolist(), pairs, strict=True)
            rubs[index] = True
        elif contact.law != "tied":
            pressed[index], rough[index] = True, bears_shear(contact)
    if len(set(axis[rubs])) != 1:
        return None
    b = int(axis[rubs][0])
    a, extent = 1 - b, high - low
    mirrors = [[held[(axis == k) & (end == side), k].all() for side in (False, True)] for k in (0, 1)]
    beside = axis == a
    if not any(mirrors[a]) or not (held[:, a] | ~(held[:, b] | rough))[beside].all():
        return None
    demanded, profiles = (axis == b) & (rubs | ((held[:, b] | pressed) & ~held[:, a])), []
    for side in (False, True):
        chosen = np.flatnonzero(demanded & (end == side))
        places = np.sort(ends[chosen, :, a], axis=1)
        order = np.argsort(places[:, 0])
        if len(order):
            nothing = np.zeros(1), np.zeros(1)
            profiles.append(_profile(places[order], [known.get(edge, nothing) for edge in chosen[order].tolist()]))
    largest, parts = zip(*profiles, strict=True)
    steep = 0.0 if len(profiles) == 1 else sum(largest) / extent[b]
    half = extent[b] if any(mirrors[b]) else extent[b] / 2.0
    inf_sup = float(np.sin(0.5 * np.arctan2(*np.sort([extent[a], half]))))

    # H with ‖θ′ v‖ ≤ H ‖v′‖ for all v of a side with v = 0 at a place: v² ≤ |a − place| ‖v′‖²
    H = min(
        max(
            float(np.sqrt((d**2 * np.abs((start + stop) / 2.0 - place) * (stop - start)).sum()))
            for start, stop, d in parts
        )
        for place, mirror in zip((low[a], high[a]), mirrors[a], strict=True)
        if mirror
    )
    found = rectangle_constant(ratio, inf_sup, max(largest), steep * 2.0 * extent[a] / np.pi, H)
    return found if np.isfinite(found) else None


def _profile(places: FloatArray, known: list[tuple[FloatArray, FloatArray]]) -> tuple[float, FloatArray]:
    """θ along one side, continuous, linear where nothing is demanded: max |θ|, and parts: (start, stop, steepest).

    Places (e, 2) are those of edges, in order; known are coefficients of θ, and no less than its steps on equal parts.
    """
    parts, largest, last = list[FloatArray](), 0.0, (np.inf, 0.0)
    for (start, stop), (values, steps) in zip(places, known, strict=True):
        if start > last[0]:
            parts.append(np.array([[last[0]], [start], [abs(values[0] - last[1]) / (start - last[0])]]))
        ends = np.linspace(start, stop, len(steps) + 1)
        parts.append(np.stack([ends[:-1], ends[1:], steps * len(steps) / (stop - start)]))
        largest, last = max(largest, float(np.abs(values).max())), (stop, values[-1])
    return largest, np.concatenate(parts, axis=1)


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


def star_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float | None:
    """A number that |R| does not exceed, or None where the body or its contacts are of another kind.

    The body has one material, no holes, and is star-shaped with respect to a disc. All contacts with Coulomb friction
    are parallel and slip one way, with the same η = ±μ across. Elsewhere nothing is demanded of displacements along n
    where v_t ≠ 0.
    """
    senses = {name: share.slipping[0] for name, share in shares.items()}
    if any(senses[name] == 0.0 or (share.slipping != senses[name]).any() for name, share in shares.items()):
        return None
    boundary, sides = problem.mesh.boundary, held_directions(problem)
    weights = np.zeros(len(boundary))  # ±μ of each edge
    for name, share in shares.items():
        weights[problem.mesh.edge_set(share.contact.edges)] = senses[name] * share.friction
    chosen = np.flatnonzero(weights != 0.0)
    normal = boundary.normal[chosen[0]]
    tangent = np.array([-normal[1], normal[0]])
    slopes = weights[chosen] * (boundary.normal[chosen] @ normal)
    parallel = np.abs(boundary.normal[chosen] @ tangent).max() <= PARALLEL
    if not parallel or np.ptp(slopes) > PARALLEL * np.abs(slopes).max():
        return None
    if any(not spans(held, tangent) and (np.abs(held @ normal) > PARALLEL).any() for held in sides):
        return None
    for contact in problem.contacts:
        index = problem.mesh.edge_set(contact.edges)
        beside = contact.law != "tied" and not weights[index].any()
        if beside and (bears_shear(contact) or np.abs(boundary.normal[index] @ normal).max() > PARALLEL):
            return None
    ratio = one_ratio(problem)
    if ratio is None:
        return None
    inf_sup = _inf_sup(problem)
    gain = None if inf_sup is None else _gain(problem, sides, inf_sup)
    if gain is None:
        return None
    return float(np.abs(slopes).max()) * star_constant(ratio, gain)


def star_constant(ratio: float, gain: float) -> float:
    """The norm of v ↦ v_t n in the energy norm: a number it does not exceed.

    `ratio` is Poisson's of the plane state, −c12/c11; `gain` is G with ‖∇ψ‖² ≤ G ‖ω‖² for a field ψ of divergence ω,
    zero where displacements are free, for the rotation ω of every displacement.
    """
    soft = 1.0 - ratio
    across, along = np.cos(ANGLES), np.sqrt(soft / 2.0) * np.sin(ANGLES)
    rotation = np.sqrt((gain - 0.5) / min(soft, 1.0 + ratio))
    strains = np.sqrt(across**2 / (2.0 * soft) + along**2 / (1.0 - ratio**2))
    return float((across * rotation + strains).max() * ROUNDED)


def _inf_sup(problem: ContactProblem) -> float | None:
    """sin(½ arcsin(r/R)) ≤ β: r the distance of a point from the lines of all edges, R that of the farthest vertex."""
    from scipy.optimize import minimize  # slow to import, and few bodies need it

    mesh = problem.mesh
    corners, boundary = mesh.vertices[np.unique(mesh.cells)], mesh.boundary
    if mesh.hole_edges.any():
        return None

    def negative(centre: FloatArray) -> float:
        inside = ((mesh.vertices[boundary.first] - centre) * boundary.normal).sum(axis=1).min()
        return -float(inside / np.linalg.norm(corners - centre, axis=1).max())

    found = minimize(negative, np.asarray(corners.mean(axis=0), dtype=float), method="Nelder-Mead")
    best = -negative(np.asarray(found.x))
    return float(np.sin(0.5 * np.arcsin(best))) if best > 0.0 else None


def _gain(problem: ContactProblem, sides: list[FloatArray], inf_sup: float) -> float | None:
    """G of `star_constant`: by a field ψ of mean divergence 1 where supports are, and β for what is left."""
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
    if not np.abs(right[free]).max(initial=0.0) > 0.0:
        return None
    field = np.zeros(space.size)
    field[free] = spsolve(sparse.csc_array(matrix[free][:, free]), right[free])
    flux = float(mean @ field)
    if not flux > 1e-9 * area:
        return None
    field *= area / flux
    size = np.sqrt(max(float(field @ (laplace @ field)), 0.0) / area)
    left = np.sqrt(max(float(field @ (squared @ field)) / area - 1.0, 0.0))
    return float((size + left / inf_sup) ** 2 + inf_sup**-2)
