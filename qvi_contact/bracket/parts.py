"""The gap between the two energies, part by part, and the complementary energy, all in physical units.

For an admissible stress τ and an admissible displacement v, by the principle of virtual work,

    J(v) + J*(τ) = ½ ∫ (cτ − ε(v)) : C : (cτ − ε(v)) dx                              bulk
                 + ∫ −τ_N (g − v_N) ds + ∫ s |v_T − w| + τ_T (v_T − w) ds             contact, friction

and every integrand is ≥ 0 (Prager-Synge; constitutive-relation error).

In `docs/theory.md`: (D20).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import FloatArray, evaluate
from qvi_contact.bracket.outcome import EdgeParts
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import contact_named
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.solution.stress import cell_stresses

_EDGE_POINTS = 12
_POTENTIAL = 5  # degree of a body potential whose energy is integrated exactly


@dataclass(frozen=True, eq=False)
class CellFields:
    """Weights (cells, g) and stress τ (cells, g, 3) at points t (g, d) of the reference cell."""

    weights: FloatArray
    stress: FloatArray
    t: FloatArray

    @classmethod
    def of(cls, discretization: Discretization, u: FloatArray, degree: int) -> "CellFields":
        """From degrees of freedom u of Φ, for integrals exact beside displacements of a degree and body potentials."""
        largest = max(discretization.space.degree - 2, degree - 1, _POTENTIAL)
        scales, (t, w) = discretization.scales, discretization.space.cell_rule(2 * largest + 1)
        weights = discretization.space.cell_measures(t, w)
        _, stress = cell_stresses(discretization, u, t)
        return cls(weights * scales.length**2, stress * scales.stress, t)


def strain_energy(fields: CellFields, compliances: FloatArray) -> float:
    """½ ∫ τ : c : τ dx [stress × length²]."""
    return 0.5 * float(np.einsum("cg,cgk,ckl,cgl->", fields.weights, fields.stress, compliances, fields.stress))


def bulk(fields: CellFields, compliances: FloatArray, strain: FloatArray) -> FloatArray:
    """½ ∫ (cτ − ε) : C : (cτ − ε) dx on each cell (cells,), from ε(v) at the same points (cells, g, 3)."""
    difference = np.einsum("ckl,cgl->cgk", compliances, fields.stress) - strain
    stiffness = np.linalg.inv(compliances)
    return np.asarray(0.5 * np.einsum("cg,cgk,ckl,cgl->c", fields.weights, difference, stiffness, difference))


def edge_parts(
    discretization: Discretization,
    rows: ContactRows,
    normal: FloatArray,
    shear: FloatArray,
    bound: FloatArray,
    companion: CompanionResult,
) -> tuple[EdgeParts, FloatArray, FloatArray]:
    """Parts of the gap on the edges of one contact.

    Parameters
    ----------
    discretization, rows
        Where.
    normal, shear, bound : (edges, q) arrays
        Bernstein coefficients of τ_N, τ_T and s [stress].
    companion : CompanionResult
        v.

    Returns
    -------
    EdgeParts, ∫ (g − v_N) ds and ∫ |v_T − w| ds on each edge (edges,) [length²].

    """
    problem = discretization.problem
    contact = contact_named(problem, rows.name)
    edges = problem.mesh.edges(contact.edges)
    lengths = edges.length
    t, weights = gauss_legendre(_EDGE_POINTS)
    gap = evaluate("Contact.gap", contact.gap, *problem.mesh.points_along(edges, t))
    opening = gap - companion.trace(rows.name, t)[0]
    pressure = -normal @ bernstein.basis(normal.shape[1] - 1, t).T
    nodes = bernstein.nodes(companion.degree)
    offset = evaluate("Contact.offset", contact.offset, *problem.mesh.points_along(edges, nodes))
    slip = (companion.trace(rows.name, nodes)[1] - offset) @ bernstein.from_values(companion.degree).T
    nothing = np.zeros_like(shear)
    return (
        EdgeParts(lengths * ((pressure * opening) @ weights), lengths * slip_work(slip, shear, bound)),
        lengths * (np.abs(opening) @ weights),
        lengths * slip_work(slip, nothing, nothing + 1.0),
    )


def slip_work(slip: FloatArray, shear: FloatArray, bound: FloatArray) -> FloatArray:
    """∫₀¹ s|j| + τ j dt (edges,) by Bernstein coefficients: slips j (edges, p + 1), τ and s (edges, q)."""
    products = bernstein.product_integrals(slip.shape[1] - 1, shear.shape[1] - 1)
    signed = np.einsum("ei,ij,ej->e", slip, products, shear)
    return np.asarray(bernstein.absolute_integrals(bound, slip) + signed)


def by_cell(discretization: Discretization, inside: FloatArray, on_edges: Mapping[str, EdgeParts]) -> FloatArray:
    """All parts (cells,): those of the cells (cells,), and of the edges to their cell, on joints to both halves."""
    problem = discretization.problem
    cells = inside.copy()
    for contact in problem.contacts:
        if contact.name in on_edges:
            near, far = problem.mesh.edges(contact.edges).cells.T
            parts = on_edges[contact.name].contact + on_edges[contact.name].friction
            joint = contact in problem.joints
            np.add.at(cells, near, 0.5 * parts if joint else parts)
            if joint:
                np.add.at(cells, far, 0.5 * parts)
    return cells
