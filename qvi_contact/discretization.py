"""From the contact problem to the algebraic quasi-variational inequality (D2)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.assembly import energy_matrix
from qvi_contact.checks import FloatArray, evaluate
from qvi_contact.element import GAUSS_COUNT, Grid
from qvi_contact.elimination import Elimination, UnbalancedLoadError, eliminate
from qvi_contact.energy_root import StressRoot
from qvi_contact.errors import InputError
from qvi_contact.loads import (
    body_load,
    cell_points,
    displacement_load,
    physical,
    potential_at,
    shear_beside_contacts,
    traction_links,
)
from qvi_contact.problem import ContactProblem
from qvi_contact.scaling import Scales
from qvi_contact.traces import EdgePoints
from solvers import FrictionQVI


@dataclass(frozen=True, eq=False)
class ContactRows:
    """The rows of (D2) that belong to one contact.

    Attributes
    ----------
    name : str
        Name of the contact.
    rows : slice
        Its rows in `FrictionQVI.N` and `FrictionQVI.T`, four Gauss points an edge.
    points : EdgePoints
        The points in dimensionless coordinates.
    friction : (m,) array
        μ at the points.
    gap, offset : (m,) arrays
        Obstacle position g and tangential offset w at the points, dimensionless.

    """

    name: str
    rows: slice
    points: EdgePoints
    friction: FloatArray
    gap: FloatArray
    offset: FloatArray


@dataclass(frozen=True, eq=False)
class Discretization:
    """A contact problem on Bogner-Fox-Schmit elements, traction conditions and gauge eliminated.

    Attributes
    ----------
    problem : ContactProblem
        The problem.
    grid : Grid
        Dimensionless grid lines.
    scales : Scales
        The units.
    elimination : Elimination
        All degrees of freedom as an affine function of the unknowns z.
    contacts : tuple of ContactRows
        Which rows of the algebraic problem belong to which contact.
    qvi : FrictionQVI
        The algebraic problem, dimensionless.

    """

    problem: ContactProblem
    grid: Grid
    scales: Scales
    elimination: Elimination
    contacts: tuple[ContactRows, ...]
    qvi: FrictionQVI

    @cached_property
    def basis(self) -> sparse.csr_array:
        """U = basis z + particular, shape (N, n)."""
        return self.elimination.basis()

    @cached_property
    def remarks(self) -> tuple[str, ...]:
        """What a user should know about how the data were taken, one sentence each."""
        mesh = self.problem.mesh
        found = []
        for node in self.elimination.conflicts:
            x, y = mesh.coordinates[node]
            found.append(
                f"Shear prescribed on the two sides of the corner ({x:.6g}, {y:.6g}) disagrees: the resultants of the "
                "edges there are kept, not the values in the corner."
            )
        for node, contact in shear_beside_contacts(self.problem):
            x, y = mesh.coordinates[node]
            found.append(
                f"The shear prescribed beside the contact {contact!r} holds in the corner ({x:.6g}, {y:.6g}) for the "
                "contact too: if friction cannot carry it there, the problem is infeasible on every mesh; let the "
                "prescribed shear fall to zero towards that corner."
            )
        return tuple(found)

    def nodal_values(self, z: FloatArray) -> FloatArray:
        """Scaled dimensionless degrees of freedom u of the Airy function at the nodes, shape (ny + 1, nx + 1, 4)."""
        ny, nx = self.problem.mesh.shape
        return (self.basis @ z + self.elimination.particular).reshape(ny + 1, nx + 1, 4)


def discretize(problem: ContactProblem) -> Discretization:
    """Discretise a contact problem.

    Lengths are divided by L, stresses by S, displacements by C S L (see `Scales`). The unknowns z are those scaled
    nodal values of Φ that traction conditions and gauge leave free. In (D2) then

        K = Bᵀ [∫ cσ:τ] B,    f = Bᵀ (loads − [∫ cσ:τ] u₀),    u = B z + u₀,

    rows of N and T are σ_N and σ_T at four Gauss points an edge, W the quadrature weights, and the obstacle enters
    the loads by ∫ g τ_N + w τ_T.

    Raises
    ------
    InputError
        If a field of the problem gives bad values, or the tractions on a closed part of the boundary are out of
        balance.

    """
    mesh = problem.mesh
    scales = Scales.of(problem)
    grid = Grid.of(mesh)
    try:
        elimination = eliminate(
            traction_links(problem, grid, scales), grid.dof_scales.ravel(), mesh.active_nodes.ravel()
        )
    except UnbalancedLoadError as error:
        imbalance = error.imbalance * scales.stress * scales.length
        remedy = (
            "tractions and body forces on a closed part of the boundary are out of balance by this force "
            "(or moment over the body's length): correct the loads, or support the body by a Displacement or Contact"
        )
        if mesh.hole_edges.any():
            remedy += "; the loads on a hole, with the weight of what would fill it, must balance by themselves"
        raise InputError("ContactProblem.conditions", imbalance, remedy) from error
    contacts = _contact_rows(problem, grid, scales)
    return Discretization(
        problem, grid, scales, elimination, contacts, _reduce(problem, grid, scales, elimination, contacts)
    )


def _contact_rows(problem: ContactProblem, grid: Grid, scales: Scales) -> tuple[ContactRows, ...]:
    found, start = [], 0
    for contact in problem.contacts:
        edges = problem.mesh.boundary.take(problem.mesh.edge_set(contact.edges))
        points = EdgePoints(grid, edges, GAUSS_COUNT)
        x, y = physical(problem, scales, points.coordinates)
        rows = slice(start, start + len(x))
        start = rows.stop
        friction = evaluate("Contact.friction", contact.friction, x, y, minimum=0.0)
        gap = evaluate("Contact.gap", contact.gap, x, y) / scales.displacement
        offset = evaluate("Contact.offset", contact.offset, x, y) / scales.displacement
        found.append(ContactRows(contact.name, rows, points, friction, gap, offset))
    return tuple(found)


def _reduce(
    problem: ContactProblem,
    grid: Grid,
    scales: Scales,
    elimination: Elimination,
    contacts: tuple[ContactRows, ...],
) -> FrictionQVI:
    """Assemble, and substitute u = B z + u₀ with B the identity on kept degrees of freedom."""
    mesh = problem.mesh
    total = 4 * mesh.node_count
    normal = [rows.points.normal() for rows in contacts]
    shear = [rows.points.shear() for rows in contacts]
    load = displacement_load(problem, grid, scales)
    for rows, n, t in zip(contacts, normal, shear, strict=True):
        weights = rows.points.weights
        load = load + n.T @ (weights * rows.gap) + t.T @ (weights * rows.offset)
    N, T = _stacked(normal, total), _stacked(shear, total)
    potential = [potential_at(problem, scales, rows.points.coordinates) for rows in contacts]
    basis = elimination.basis()
    particular = elimination.particular

    parts = [
        (mesh.active & (problem.material_numbers == number), material.compliance / scales.compliance)
        for number, material in enumerate(problem.materials)
    ]
    stencil = energy_matrix(grid, parts)
    kept = elimination.kept
    K = stencil.submatrix(kept.reshape(*mesh.active_nodes.shape, 4))
    slave_rows = stencil.rows(elimination.slaves)
    Q = elimination.slave_basis
    coupling = slave_rows[:, kept]
    inner = slave_rows[:, elimination.slaves]
    mixed = Q.T @ coupling
    K = K + (mixed + mixed.T + Q.T @ (inner @ Q))
    particular_load = slave_rows.T @ particular[elimination.slaves] - body_load(problem, grid, scales)
    least = float(K.diagonal().min(initial=np.inf))
    if least <= 0.0:
        smallest = float(min(grid.x.sizes.min(), grid.y.sizes.min()))
        remedy = "cells this thin, as a share of the body's length, are beyond double precision: use less grading"
        raise InputError("ContactProblem.mesh", smallest, remedy)
    return FrictionQVI(
        K=K.T,  # the same matrix, compressed by columns
        f=basis.T @ (load - particular_load),
        N=N @ basis,
        n0=N @ particular + np.concatenate([np.empty(0), *potential]),
        T=T @ basis,
        t0=T @ particular,
        mu=np.concatenate([np.empty(0), *(rows.friction for rows in contacts)]),
        W=np.concatenate([np.empty(0), *(rows.points.weights for rows in contacts)]),
        root=StressRoot(
            grid,
            mesh.active,
            problem.compliances / scales.compliance,
            basis,
            particular,
            _potential_in_cells(problem, grid, scales),
        ),
        load=basis.T @ load,
    )


def _potential_in_cells(problem: ContactProblem, grid: Grid, scales: Scales) -> FloatArray:
    """φ at the Gauss points of the active cells, dimensionless."""
    row, column = np.nonzero(problem.mesh.active)
    return potential_at(problem, scales, cell_points(grid, column, row)[0])


def _stacked(rows: list[sparse.csr_array], total: int) -> sparse.csr_array:
    return sparse.csr_array(sparse.vstack(rows)) if rows else sparse.csr_array((0, total))
