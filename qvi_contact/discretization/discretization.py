"""From the contact problem to the algebraic quasi-variational inequality (D2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.assembly import energy_matrix
from qvi_contact.discretization.contact_rows import ContactRows, contact_rows, joined, stacked, trace_rows
from qvi_contact.discretization.elimination import Elimination, UnbalancedLoadError, eliminate
from qvi_contact.discretization.energy_root import StressRoot
from qvi_contact.discretization.loads import (
    body_load,
    cell_points,
    displacement_load,
    potential_at,
    shear_beside_contacts,
    traction_links,
)
from qvi_contact.discretization.plates import PlateRows, plate_rows
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.substructures import substructures
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.problem.problem import ContactProblem
from solvers import EdgeRows, FrictionQVI, Traces
from solvers.inequality.operator import Operator

_TOO_SMALL = 1e-2  # mean stress in units of the problem below which the units are changed
_NOISE = 1e-12  # mean stress in units of the problem below which there is none
_UNRELIABLE = 1e-4  # relative error of the linear solve above which they are left


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
    plates : PlateRows
        Equality rows of plates driven by force.
    qvi : FrictionQVI
        The algebraic problem, dimensionless.
    freed : int array
        Nodes beside contacts whose prescribed shear is given up, see `discretize`.

    """

    problem: ContactProblem
    grid: Grid
    scales: Scales
    elimination: Elimination
    contacts: tuple[ContactRows, ...]
    plates: PlateRows
    qvi: FrictionQVI
    freed: IntArray

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
            given_up = (
                "is met in the resultants of the edges only, as no certified state was found in which friction carries "
                "it: let it fall to zero towards that corner"
            )
            taken = given_up if node in self.freed else "holds for the contact too"
            found.append(f"The shear prescribed beside {contact!r} in the corner ({x:.6g}, {y:.6g}) {taken}.")
        found += [
            f"Equilibrium with the other loads gives {row.component} of the plate at {row.contact!r} anyway; its "
            "motion in that component is not determined and taken as zero."
            for row in self.plates.determined
        ]
        return tuple(found)

    def slipped(self, slip: Sequence[FloatArray], operator: Operator | None = None) -> "Discretization":
        """The same problem after earlier slip: the tangential offset w of each contact grows by `slip`, dimensionless.

        Parameters
        ----------
        slip : sequence of (m,) arrays
            One array for each of `contacts`, at its points.
        operator : Operator, optional
            That of an earlier step, whose factorisation serves this one too if K is the same.

        """
        contacts = tuple(rows.with_offset(rows.offset + more) for rows, more in zip(self.contacts, slip, strict=True))
        change = [rows.points.weights * more for rows, more in zip(contacts, slip, strict=True) if rows.law != "tied"]
        load = self.qvi.T.T @ joined(change)
        assert self.qvi.load is not None
        changes: dict[str, Any] = {"f": self.qvi.f + load, "load": self.qvi.load + load}
        if operator is not None and operator.serves(self.qvi.K):
            changes["shared"] = operator
        return replace(self, contacts=contacts, qvi=self.qvi.changed(**changes))

    def freeing(self, nodes: IntArray) -> "Discretization":
        """The same problem, in the same units and after the same slip, with the shear at the nodes given up."""
        fresh = discretize(self.problem, scales=self.scales, freed=nodes)
        return fresh.slipped([old.offset - new.offset for old, new in zip(self.contacts, fresh.contacts, strict=True)])

    def fitted(self) -> "Discretization":
        """The same problem in units of the stress it would have without contact laws, if its own are far too large.

        `Scales` cannot foresee every load, such as an obstacle that drags the body along by friction. Stresses far
        below the unit would be lost in the tolerances of solvers and certificate.
        """
        if not 0.0 < self.qvi.rough_stress() < _TOO_SMALL or self.qvi.bonded_error > _UNRELIABLE:
            return self
        size = float(np.sqrt(2.0 * self.qvi.bonded_energy))
        if not _NOISE < size < _TOO_SMALL:
            return self
        scales = replace(self.scales, stress=self.scales.stress * size)
        return discretize(self.problem, scales=scales, freed=self.freed)

    def offsets(self) -> list[FloatArray]:
        """The tangential offset w that the problem prescribes at the points of each contact, without earlier slip."""
        return [rows.offset for rows in contact_rows(self.problem, self.grid, self.scales)]

    def nodal_values(self, z: FloatArray) -> FloatArray:
        """Scaled dimensionless degrees of freedom u of the Airy function at the nodes, shape (ny + 1, nx + 1, 4)."""
        ny, nx = self.problem.mesh.shape
        return (self.basis @ z + self.elimination.particular).reshape(ny + 1, nx + 1, 4)


def discretize(
    problem: ContactProblem, *, scales: Scales | None = None, freed: IntArray | None = None
) -> Discretization:
    """Discretise a contact problem.

    Parameters
    ----------
    problem : ContactProblem
        The problem.
    scales : Scales, optional
        Units of the dimensionless problem; those of the problem by default.
    freed : int array, optional
        Nodes where a shear prescribed beside a contact is given up in favour of the edges' resultants.

    Notes
    -----
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
    scales = scales or Scales.of(problem)
    freed = np.empty(0, dtype=np.int64) if freed is None else freed
    grid = Grid.of(mesh)
    try:
        elimination = eliminate(
            traction_links(problem, grid, scales), grid.dof_scales.ravel(), mesh.active_nodes.ravel(), freed
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
    contacts = contact_rows(problem, grid, scales)
    basis = elimination.basis()
    plates = plate_rows(problem, scales, contacts, basis, elimination.particular)
    qvi = _reduce(problem, grid, scales, elimination, contacts, basis, plates)
    return Discretization(problem, grid, scales, elimination, contacts, plates, qvi, freed)


def _reduce(
    problem: ContactProblem,
    grid: Grid,
    scales: Scales,
    elimination: Elimination,
    contacts: tuple[ContactRows, ...],
    basis: sparse.csr_array,
    plates: PlateRows,
) -> FrictionQVI:
    """Assemble, and substitute u = B z + u₀ with B the identity on kept degrees of freedom."""
    mesh = problem.mesh
    total = 4 * mesh.node_count
    load = displacement_load(problem, grid, scales)
    for rows in contacts:
        load = load + rows.work()
    limited = [rows for rows in contacts if rows.law != "tied"]
    N = stacked([rows.points.normal() for rows in limited], total)
    T = stacked([rows.points.shear() for rows in limited], total)
    Y, interpolation = trace_rows(limited, grid)
    potential = [potential_at(problem, scales, rows.points.coordinates) for rows in limited]
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
    K = _narrow(K + (mixed + mixed.T + Q.T @ (inner @ Q)))
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
        n0=N @ particular + joined(potential),
        T=T @ basis,
        t0=T @ particular,
        mu=joined([rows.friction for rows in limited]),
        W=joined([rows.points.weights for rows in limited]),
        cohesion=joined([rows.cohesion for rows in limited]),
        cap=joined([rows.shear_limit for rows in limited]),
        bilateral=joined([rows.bilateral for rows in limited]).astype(bool),
        root=StressRoot(
            grid,
            mesh.active,
            problem.compliances / scales.compliance,
            basis,
            particular,
            _potential_in_cells(problem, grid, scales),
        ),
        load=basis.T @ load,
        A=plates.A,
        b=plates.b,
        traces=Traces(Y @ basis, interpolation),
        edges=EdgeRows(gauss_legendre(GAUSS_COUNT)[0]),
        structure=partial(substructures, problem, grid, scales, elimination),
    )


def _narrow(K: sparse.csr_array) -> sparse.csr_array:
    """K with 32-bit indices, where they suffice: a third less memory."""
    if K.nnz > np.iinfo(np.int32).max:
        return K
    return sparse.csr_array((K.data, K.indices.astype(np.int32), K.indptr.astype(np.int32)), shape=K.shape)


def _potential_in_cells(problem: ContactProblem, grid: Grid, scales: Scales) -> FloatArray:
    """φ at the Gauss points of the active cells, dimensionless."""
    row, column = np.nonzero(problem.mesh.active)
    return potential_at(problem, scales, cell_points(grid, column, row)[0])
