"""The norm of the friction operator on a star-shaped body: Rv = η v_t n for straight, parallel contacts.

In `docs/theory.md`: (D32).
"""

from collections.abc import Mapping
from typing import Final

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from qvi_contact.basics.checks import BoolArray, FloatArray
from qvi_contact.bracket.friction_data import ANGLES, ROUNDED, one_ratio, weight
from qvi_contact.bracket.share import Share, all_alike, held_directions, spans
from qvi_contact.companion.space import Space
from qvi_contact.companion.supports import PARALLEL
from qvi_contact.companion.triangle import triangle
from qvi_contact.problem.conditions import bears_shear, has_coulomb
from qvi_contact.problem.problem import ContactProblem

_DEGREE: Final = 2  # of the field that shows how supports hold the mean rotation


def star_norm(problem: ContactProblem, shares: Mapping[str, Share]) -> float | None:
    """A number that |R| does not exceed, or None where the body or its contacts are of another kind.

    The body has one material, no holes, and is star-shaped with respect to a disc. All contacts with Coulomb friction
    are parallel and slip one way, with the same η = ±μ across. Elsewhere nothing is demanded of displacements along n
    where v_t ≠ 0.
    """
    senses = all_alike(shares)
    if senses is None:
        return None
    boundary = problem.mesh.boundary
    weights, sides = _weights(problem, senses), held_directions(problem)
    chosen = np.flatnonzero(weights != 0.0)
    normal = boundary.normal[chosen[0]]
    slopes = weights[chosen] * (boundary.normal[chosen] @ normal)
    parallel = np.abs(boundary.normal[chosen] @ boundary.tangent[chosen[0]]).max() <= PARALLEL
    same = np.ptp(slopes) <= PARALLEL * np.abs(slopes).max()
    if not (parallel and same and _leaves_free(problem, sides, weights, normal)):
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


def _weights(problem: ContactProblem, senses: Mapping[str, int]) -> FloatArray:
    """The number σμ of each boundary edge (e,); 0 without Coulomb friction."""
    found = np.zeros(len(problem.mesh.boundary))
    for contact in problem.contacts:
        if has_coulomb(contact):
            found[problem.mesh.edge_set(contact.edges)] = weight(contact, senses)
    return found


def _leaves_free(problem: ContactProblem, sides: list[FloatArray], weights: FloatArray, normal: FloatArray) -> bool:
    """Whether η v_t n meets what supports and other contacts demand: no part along n but where v_t = 0."""
    boundary, tangent = problem.mesh.boundary, np.array([-normal[1], normal[0]])
    for held in sides:
        if not spans(held, tangent) and (np.abs(held @ normal) > PARALLEL).any():
            return False
    for contact in problem.contacts:
        index = problem.mesh.edge_set(contact.edges)
        if contact.law == "tied" or weights[index].any():
            continue
        if bears_shear(contact) or np.abs(boundary.normal[index] @ normal).max() > PARALLEL:
            return False
    return True


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
    """G of `star_constant`: by a field of mean divergence 1 where supports are, and β for what is left."""
    space = Space.of(problem, triangle(_DEGREE), problem.mesh.length)
    free = _free(problem, sides, space)
    laplace, squared, mean, area = _forms(space)
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


def _free(problem: ContactProblem, sides: list[FloatArray], space: Space) -> BoolArray:
    """Degrees of freedom of the field: components that are not zero on edges that leave displacements free."""
    numbers = space.along(problem.mesh.boundary)
    free = np.ones((space.size // 2, 2), dtype=bool)
    for edge, held in enumerate(sides):
        for axis, unit in enumerate(np.eye(2)):
            if not spans(held, unit):
                free[numbers[edge], axis] = False
    return free.ravel()


def _forms(space: Space) -> tuple[sparse.csr_array, sparse.csr_array, FloatArray, float]:
    """Matrices of ‖∇ψ‖² and ‖div ψ‖², the vector of ∫ div ψ, and the area."""
    cell = space.cell
    t, weights = cell.quadrature(space.degree + 1)
    along = cell.derivative_values(t) @ np.stack(cell.differences)
    slopes = np.einsum("cab,aqn->cqnb", space.slopes, along)
    w = space.areas[:, None] * weights
    divergence = slopes.reshape(*slopes.shape[:2], -1)
    local = np.einsum("cq,cqnb,cqmb->cnm", w, slopes, slopes)
    square = np.einsum("cq,cqi,cqj->cij", w, divergence, divergence)
    both = np.einsum("cnm,xy->cnxmy", local, np.eye(2)).reshape(square.shape)
    works = np.einsum("cq,cqi->ci", w, divergence).ravel()
    mean = np.asarray(np.bincount(space.dofs.ravel(), works, minlength=space.size), dtype=np.float64)
    return space.assembled(both), space.assembled(square), mean, float(w.sum())
