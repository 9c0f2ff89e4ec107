"""Proved norms of the friction operator: on rectangles, Rv = θ v_a e_b, and on star-shaped bodies, Rv = η v_t n.

In `docs/theory.md`: (D29), (D32).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.share import Share, all_alike, bodies_of, held_directions, shares_on, spans
from qvi_contact.companion.data import PARALLEL
from qvi_contact.companion.space import DisplacementSpace, triangle
from qvi_contact.errors import InputError
from qvi_contact.problem.conditions import Displacement, bears_shear, has_coulomb
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
            own = shares_on(body, problem, shares)
            found = (
                ()
                if body.problem.mesh.sides.any()
                else ((norm(body.problem, own), kind) for kind, norm in ways.items())
            )
            known.append(
                min(((value, kind) for value, kind in found if value is not None), default=(np.inf, "this body"))
            )
    largest, kind = max(known)
    return largest, kind if len(known) < 3 else "each of the bodies"


def rectangle_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float | None:
    """The norm of Rv = θ v_a e_b on a rectangle with its contacts across the axis b; None for problems of another kind.

    The body is a rectangle of one material, its contacts with Coulomb friction lie on one side or on two opposite ones,
    and along one whole side at right angles to these v_a = 0. θ is ±μ s on the contacts, and linear along b, see (D29).
    """
    sides, ratio = _sides(problem, shares), one_ratio(problem)
    if sides is None or ratio is None:
        return None
    across = {side // 2 for side in sides if any(edge.share is not None for edge in sides[side])}
    if len(across) != 1:
        return None
    b = across.pop()
    a = 1 - b
    beside = [sides[2 * a + end] for end in (0, 1)]
    mirrors = [[all(edge.held[axis] for edge in sides[2 * axis + end]) for end in (0, 1)] for axis in (0, 1)]
    allowed = all(edge.held[a] or not (edge.held[b] or edge.rough) for edges in beside for edge in edges)
    if not any(mirrors[a]) or not allowed:
        return None
    extent = np.ptp(problem.mesh.vertices, axis=0)
    profiles = [_Profile.of(sides[2 * b + end], a) for end in (0, 1)]
    demanded = [profile for profile in profiles if profile is not None]
    low, high = (demanded * 2)[:2]
    steep = 0.0 if len(demanded) == 1 else (low.largest + high.largest) / extent[b]
    half = extent[b] if any(mirrors[b]) else extent[b] / 2.0
    inf_sup = np.sin(0.5 * np.arctan2(*np.sort([extent[a], half])))
    ends = problem.mesh.vertices[:, a].min(), problem.mesh.vertices[:, a].max()
    turned = min(
        max(profile.turned(end) for profile in (low, high))
        for end, mirror in zip(ends, mirrors[a], strict=True)
        if mirror
    )
    largest = max(low.largest, high.largest)
    found = rectangle_constant(ratio, float(inf_sup), largest, steep * 2.0 * extent[a] / np.pi, turned)
    return found if np.isfinite(found) else None


@dataclass(frozen=True, eq=False)
class _Profile:
    """What θ is along one side, in parts: continuous, linear where nothing is demanded."""

    largest: float  # max |θ|
    # start, stop, steepest, (k,) each: of each part the ends along the side, and no less than |dθ/da| on it
    start: FloatArray
    stop: FloatArray
    steepest: FloatArray

    @classmethod
    def of(cls, edges: list[_Edge], a: int) -> _Profile | None:
        """From what the edges of the side demand; None if that is nothing."""
        ordered = sorted(edges, key=lambda edge: edge.place)
        known = [edge.profile(a) for edge in ordered]
        if all(each is None for each in known):
            return None
        largest, parts, last = 0.0, list[tuple[float, float, float]](), None
        for edge, each in zip(ordered, known, strict=True):
            if each is None:
                continue
            first, second, most, slopes = each
            if last is not None and edge.place[0] > last[0]:  # nothing is demanded since the last edge
                gap = edge.place[0] - last[0]
                parts.append((last[0], edge.place[0], abs(first - last[1]) / gap))
            ends = np.linspace(*edge.place, len(slopes) + 1)
            parts += zip(ends[:-1].tolist(), ends[1:].tolist(), slopes.tolist(), strict=True)
            largest, last = max(largest, most), (edge.place[1], second)
        return cls(largest, *np.array(parts).T)

    def turned(self, end: float) -> float:
        """H with ‖θ′ v‖ ≤ H ‖v′‖ for all v of the side with v = 0 at the end: v² ≤ |a − end| ‖v′‖²."""
        away = np.abs((self.start + self.stop) / 2.0 - end) * (self.stop - self.start)
        return float(np.sqrt((self.steepest**2 * away).sum()))


def rectangle_constant(ratio: float, inf_sup: float, largest: float, steepest: float, turned: float = 0.0) -> float:
    """The norm of v ↦ θ v_a e_b in the energy norm: a number it does not exceed.

    Parameters
    ----------
    ratio : float
        Poisson's ratio of the plane state, −c12/c11: ν in plane stress, ν/(1 − ν) in plane strain.
    inf_sup : float
        β of the rectangle mirrored at the sides where displacements are odd.
    largest : float
        max |θ|.
    steepest : float
        max |∂_b θ| times the constant of Poincaré's inequality ‖v_a‖ ≤ k ‖∂_a v_a‖.
    turned : float
        H with ‖∂_a θ v_a‖ ≤ H ‖∂_a v_a‖.

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


@dataclass(frozen=True, eq=False)
class _Edge:
    """What one edge of the boundary demands of v and of Rv."""

    held: tuple[bool, bool]  # whether v has no part along x, along y
    place: tuple[float, float]  # where it begins and ends along its side
    # (Share, number of the edge, ±μ): with Coulomb friction: the part of Rv across the edge is ±μ s times v along it
    share: tuple[Share, int, float] | None
    pressed: bool  # pressed, rough: whether (Rv)_N, (Rv)_T must vanish because of a contact without Coulomb friction
    rough: bool

    def profile(self, a: int) -> tuple[float, float, float, FloatArray] | None:
        """θ at both ends, max |θ| and |dθ/da| on equal parts; None where nothing is demanded."""
        if self.share is not None:
            share, number, factor = self.share
            values, length = factor * share.values[number], self.place[1] - self.place[0]
            slopes = abs(factor) * share.steepest()[number]
            slopes = slopes * len(slopes) / length
            return float(values[0]), float(values[-1]), float(np.abs(values).max()), slopes
        if not self.held[a] and (self.held[1 - a] or self.pressed):
            return 0.0, 0.0, 0.0, np.zeros(1)
        return None


def _sides(problem: ContactProblem, shares: Mapping[str, Share]) -> dict[int, list[_Edge]] | None:
    """Edges by side, 2 axis + end with the end 1 towards +axis; None unless the body is a rectangle along the axes."""
    mesh, boundary = problem.mesh, problem.mesh.boundary
    corners = mesh.vertices[np.unique(mesh.cells)]
    places = (mesh.vertices[boundary.first] + mesh.vertices[boundary.second]) / 2.0
    low, high = corners.min(axis=0), corners.max(axis=0)
    near = np.abs(np.stack([places - low, places - high], axis=-1)) <= _ALIKE * (high - low).max()
    if not np.allclose(np.abs(boundary.normal).max(axis=1), 1.0, rtol=0.0, atol=_ALIKE):
        return None
    axis = np.argmax(np.abs(boundary.normal), axis=1)
    end = (boundary.normal[np.arange(len(axis)), axis] > 0.0).astype(int)
    if not near[np.arange(len(axis)), axis, end].all():
        return None
    held = np.zeros((len(axis), 2), dtype=bool)
    for given in problem.prescribed(Displacement):
        if not np.allclose(np.abs(given.direction).max(axis=1), 1.0, rtol=0.0, atol=_ALIKE):
            return None
        held[given.index, np.argmax(np.abs(given.direction), axis=1)] = True
    pressed, rough = np.zeros(len(axis), dtype=bool), np.zeros(len(axis), dtype=bool)
    known: dict[int, tuple[Share, int, float]] = {}
    for contact in problem.contacts:
        index = mesh.edge_set(contact.edges)
        if contact.law == "tied":
            held[index] = True
        elif has_coulomb(contact):
            share = shares[contact.name]
            for edge, number in enumerate(index.tolist()):
                known[number] = share, edge, share.friction * (1.0 if end[number] == 1 else -1.0)
        else:
            pressed[index], rough[index] = True, bears_shear(contact)
    found: dict[int, list[_Edge]] = {side: [] for side in range(4)}
    for number, side in enumerate((2 * axis + end).tolist()):
        parts = bool(held[number, 0]), bool(held[number, 1])
        ends = mesh.vertices[[boundary.first[number], boundary.second[number]], 1 - side // 2]
        place = float(ends.min()), float(ends.max())
        found[side].append(_Edge(parts, place, known.get(number), bool(pressed[number]), bool(rough[number])))
    return found


def star_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float | None:
    """A number that |R| does not exceed, or None where the body or its contacts are of another kind.

    The body has one material, no holes, and is star-shaped with respect to a disc. All contacts with Coulomb friction
    are parallel and slip one way, with the same η = ±μ across. Elsewhere nothing is demanded of displacements along n
    where v_t ≠ 0.
    """
    senses = all_alike(shares)
    if senses is None:
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

    Parameters
    ----------
    ratio : float
        Poisson's ratio of the plane state, −c12/c11.
    gain : float
        G with ‖∇ψ‖² ≤ G ‖ω‖² for a field ψ of divergence ω, zero where displacements are free, for the rotation ω of
        every displacement.

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
    cell, numbers = space.cell, space.along(problem.mesh.boundary)
    unknown = np.ones((space.size // 2, 2), dtype=bool)  # components that vanish on edges that leave them free
    for edge, held in enumerate(sides):
        unknown[numbers[edge]] &= [spans(held, unit) for unit in np.eye(2)]
    free = unknown.ravel()
    t, weights = cell.quadrature(space.degree + 1)
    slopes = np.einsum("cab,aqn->cqnb", space.slopes, cell.derivative_values(t) @ np.stack(cell.differences))
    w = space.areas[:, None] * weights
    divergence = slopes.reshape(*slopes.shape[:2], -1)
    local = np.einsum("cq,cqnb,cqmb->cnm", w, slopes, slopes)
    blocks = np.einsum("cq,cqi,cqj->cij", w, divergence, divergence)
    squared = space.assembled(blocks)  # ‖div ψ‖²
    laplace = space.assembled(np.einsum("cnm,xy->cnxmy", local, np.eye(2)).reshape(blocks.shape))  # ‖∇ψ‖²
    works, area = np.einsum("cq,cqi->ci", w, divergence).ravel(), float(w.sum())
    mean = np.bincount(space.dofs.ravel(), works, minlength=space.size)  # ∫ div ψ
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
