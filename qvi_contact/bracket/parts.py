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

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.bracket.outcome import EdgeParts
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import contact_named
from qvi_contact.element import bernstein
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges
from qvi_contact.solution.stress import cell_stresses

_CELL_POINTS = 6  # Gauss points along each side of a cell: exact up to degree 11
_EDGE_POINTS = 12


@dataclass(frozen=True, eq=False)
class CellFields:
    """Weights (cells, g) and stress τ (cells, g, 3) at Gauss points of the cells, and their reference coordinates."""

    weights: FloatArray
    stress: FloatArray
    tx: FloatArray
    ty: FloatArray

    @classmethod
    def of(cls, discretization: Discretization, nodal: FloatArray) -> "CellFields":
        """From nodal values of Φ."""
        scales, (t, w) = discretization.scales, gauss_legendre(_CELL_POINTS)
        tx, ty = np.tile(t, len(t)), np.repeat(t, len(t))
        weights = discretization.space.cell_sizes[:, None] * (np.tile(w, len(w)) * np.repeat(w, len(w)))
        _, stress = cell_stresses(discretization, nodal, np.column_stack([tx, ty]))
        return cls(weights * scales.length**2, stress * scales.stress, tx, ty)


def strain_energy(fields: CellFields, compliances: FloatArray) -> float:
    """½ ∫ τ : c : τ dx [stress × length²]."""
    return 0.5 * float(np.einsum("cg,cgk,ckl,cgl->", fields.weights, fields.stress, compliances, fields.stress))


def bulk(fields: CellFields, compliances: FloatArray, strain: FloatArray) -> FloatArray:
    """½ ∫ (cτ − ε) : C : (cτ − ε) dx on each active cell (cells,), from ε(v) at the same points (cells, g, 3)."""
    difference = np.einsum("ckl,cgl->cgk", compliances, fields.stress) - strain
    stiffness = np.linalg.inv(compliances)
    return np.asarray(0.5 * np.einsum("cg,cgk,ckl,cgl->c", fields.weights, difference, stiffness, difference))


def edge_parts(
    discretization: Discretization,
    rows: ContactRows,
    ends: FloatArray,
    shear: FloatArray,
    bound: FloatArray,
    companion: CompanionResult,
) -> tuple[EdgeParts, FloatArray, FloatArray]:
    """Parts of the gap on the edges of one contact.

    Parameters
    ----------
    discretization, rows
        Where.
    ends : (edges, 2) array
        τ_N at the ends [stress].
    shear, bound : (edges, 3) arrays
        Bernstein coefficients of τ_T and s [stress].
    companion : CompanionResult
        v.

    Returns
    -------
    EdgeParts, ∫ (g − v_N) ds and ∫ |v_T − w| ds on each edge (edges,) [length²].

    """
    problem = discretization.problem
    contact = contact_named(problem, rows.name)
    edges = problem.grid.edges(contact.edges)
    lengths = edges.length
    t, weights = gauss_legendre(_EDGE_POINTS)
    gap = evaluate("Contact.gap", contact.gap, *problem.grid.points_along(edges, t))
    opening = gap - companion.trace(rows.name, t)[0]
    pressure = -(ends[:, :1] * (1.0 - t) + ends[:, 1:] * t)
    nodes = bernstein.nodes(companion.degree)
    offset = evaluate("Contact.offset", contact.offset, *problem.grid.points_along(edges, nodes))
    slip = (companion.trace(rows.name, nodes)[1] - offset) @ bernstein.from_values(companion.degree).T
    nothing = np.zeros_like(shear)
    return (
        EdgeParts(lengths * ((pressure * opening) @ weights), lengths * slip_work(slip, shear, bound)),
        lengths * (np.abs(opening) @ weights),
        lengths * slip_work(slip, nothing, nothing + 1.0),
    )


def slip_work(slip: FloatArray, shear: FloatArray, bound: FloatArray) -> FloatArray:
    """∫₀¹ s|j| + τ j dt (edges,) by Bernstein coefficients: slips j (edges, p + 1), τ and s (edges, 3)."""
    signed = np.einsum("ei,ij,ej->e", slip, bernstein.product_integrals(slip.shape[1] - 1, 2), shear)
    return np.asarray(bernstein.absolute_integrals(bound, slip) + signed)


def by_cell(discretization: Discretization, inside: FloatArray, on_edges: Mapping[str, EdgeParts]) -> FloatArray:
    """All parts (ny, nx): those of the cells (ny, nx), and of the edges to their cell, on joints to both halves."""
    problem = discretization.problem
    cells = inside.copy()
    for contact in problem.contacts:
        if contact.name in on_edges:
            edges = problem.grid.edges(contact.edges)
            parts = on_edges[contact.name].contact + on_edges[contact.name].friction
            joint = contact in problem.joints
            np.add.at(cells, (edges.row, edges.column), 0.5 * parts if joint else parts)
            if joint:
                np.add.at(cells, _beyond(edges), 0.5 * parts)
    return cells


def _beyond(edges: GridEdges) -> tuple[IntArray, IntArray]:
    """Row and column of the cell above or to the right of edges inside the body."""
    flat = edges.axis == HORIZONTAL
    return edges.row + flat, edges.column + ~flat
