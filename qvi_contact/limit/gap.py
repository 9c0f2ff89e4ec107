"""Where both sides of a limit load are apart: parts of upper − lower, one for each triangle and contact edge.

With the stress that carries α and the flow of power 1

    upper − lower  =  Σ_T [ Σ w_i π(ε_i) − ∫_T σ·ε ]  +  Σ_E [ π_E − ∫_E (σ_N' w − σ_T [v]_T) ds ],

and no part is negative, since σ is admissible at every point and π bounds what it can dissipate.

In `docs/theory.md`: (D38).
"""

from functools import cache

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element import bernstein
from qvi_contact.element.triangle import bernstein as bernstein_values
from qvi_contact.element.triangle import quadrature
from qvi_contact.limit.flow import BodyMotion
from qvi_contact.limit.stresses import CarriedStress
from qvi_contact.limit.whole_edges import edge_coefficients
from qvi_contact.limit.yielding import part_corners


def gap_in_cells(discretization: Discretization, carried: CarriedStress, motion: BodyMotion, degree: int) -> FloatArray:
    """Parts of the triangles (cells,), with those of contact edges in equal shares for the triangles beside them."""
    assert carried.stress is not None
    assert carried.tractions is not None
    problem, mesh = discretization.problem, discretization.problem.mesh
    corners = part_corners(mesh.vertices[mesh.cells] / mesh.length)
    a, b = (corners[..., i, :] - corners[..., 0, :] for i in (1, 2))
    areas = np.abs(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]) / 2.0
    work = np.einsum("npic,ij,npjc,np->n", carried.stress, _products(degree), motion.strain, areas)
    found: FloatArray = motion.dissipation - np.where(motion.dissipation > 0.0, work, 0.0)
    m = discretization.qvi.m
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        if rows.law == "tied" or contact.name not in motion.contacts:
            continue
        moved, edges, q = motion.contacts[contact.name], rows.points.edges, rows.rule.count
        table = bernstein.product_integrals(degree, degree + 1)
        normal, shear = (
            carried.tractions[start : start + m][rows.rows].reshape(-1, q) @ edge_coefficients(rows).T
            for start in (0, m)
        )
        worked = np.einsum("ei,ij,ej->e", normal, table, moved.opening)
        worked -= np.einsum("ei,ij,ej->e", shear, table, moved.slip)
        part = moved.dissipation - worked * edges.length / mesh.length
        inside = edges.cells >= 0
        for side in (0, 1):
            chosen = inside[:, side]
            np.add.at(found, edges.cells[chosen, side], part[chosen] / inside.sum(axis=1)[chosen])
    return np.maximum(found, 0.0)


@cache
def _products(degree: int) -> FloatArray:
    """∫ B_i B_j over a triangle of area 1."""
    points, weights = quadrature(2 * degree)
    values = bernstein_values(degree, points)
    return np.asarray((values * weights[:, None]).T @ values)
