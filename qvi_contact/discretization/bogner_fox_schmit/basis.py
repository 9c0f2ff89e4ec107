"""The Bogner-Fox-Schmit element on a rectilinear mesh, as the discretisation asks for it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.basis import ContactRule, PrescribedTraction, RowKind, SharedCorners
from qvi_contact.discretization.bogner_fox_schmit.chains import eliminate
from qvi_contact.discretization.bogner_fox_schmit.displacements import (
    blind_nodes,
    project_normal,
    project_tangential,
)
from qvi_contact.discretization.bogner_fox_schmit.energy import GridEnergy
from qvi_contact.discretization.bogner_fox_schmit.links import traction_links
from qvi_contact.discretization.bogner_fox_schmit.traces import GridTraces, trace_parameters
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, Grid
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.element.lattices import square_lattice
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.rectilinear import RectilinearMesh


@dataclass(frozen=True, eq=False)
class BognerFoxSchmit:
    """Bicubic Airy functions, C1 across cells, with Φ, Φ_x, Φ_y, Φ_xy at the nodes; a `Basis`.

    Parameters
    ----------
    mesh : RectilinearMesh
        The mesh. Its active cells have numbers row by row from the bottom left, its nodes along x first. Degree of
        freedom d of node k has number 4 k + d, those outside the body included.

    """

    mesh: RectilinearMesh

    family = "Bogner-Fox-Schmit"
    degree = 3
    normal_degree = 1
    shear_degree = 2
    shear_at_vertices = True
    strict_rows: RowKind = "gauss"

    @cached_property
    def grid(self) -> Grid:
        """Dimensionless grid lines."""
        return Grid.of(self.mesh)

    @property
    def size(self) -> int:
        """Number of degrees of freedom, those of nodes outside the body included."""
        return self.grid.size

    @cached_property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates of all nodes, shape (nodes, 2)."""
        x, y = np.meshgrid(self.grid.x.lines, self.grid.y.lines)
        return np.column_stack([x.ravel(), y.ravel()])

    @property
    def smallest(self) -> float:
        """The least distance of grid lines, dimensionless."""
        return float(min(self.grid.x.sizes.min(), self.grid.y.sizes.min()))

    @property
    def centres(self) -> IntArray:
        """None: degrees of freedom are those of Φ."""
        return np.empty(0, dtype=np.int64)

    @property
    def cuts(self) -> IntArray:
        """None: Φ has one value everywhere."""
        return np.empty(0, dtype=np.int64)

    @property
    def contact_rule(self) -> ContactRule:
        """Tractions at four Gauss points an edge, as the paper's."""
        return ContactRule.gauss(GAUSS_COUNT)

    @property
    def cell_points(self) -> FloatArray:
        """4×4 Gauss points, shape (16, 2)."""
        return self.cell_rule(2 * GAUSS_COUNT - 1)[0]

    @property
    def cell_weights(self) -> FloatArray:
        """Their weights, shape (16,)."""
        return self.cell_rule(2 * GAUSS_COUNT - 1)[1]

    @property
    def cell_sizes(self) -> FloatArray:
        """Areas of the active cells, shape (cells,)."""
        column, row = self.mesh.cell_places
        return np.asarray(self.grid.x.sizes[column] * self.grid.y.sizes[row])

    def normal_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_N without φ, see `Basis`."""
        return self._traces(edges, t).normal()

    def shear_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_T, see `Basis`."""
        return self._traces(edges, t).shear()

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u, see `Basis`."""
        return self._traces(edges, t).tractions(u)

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T, see `Basis`."""
        return self._traces(edges, t).load(normal, shear)

    def _traces(self, edges: Edges, t: FloatArray) -> GridTraces:
        column, row = (place[edges.cells[:, 0]] for place in self.mesh.cell_places)
        return GridTraces(self.grid, edges, column, row, np.asarray(t, dtype=float))

    def trace_parameters(self, edges: Sequence[Edges]) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Tractions at the contact points from the parameters of their traces, see `traces.trace_parameters`."""
        if not edges:
            return sparse.csr_array((0, self.size)), sparse.csr_array((0, 0))
        t = gauss_legendre(GAUSS_COUNT)[0]
        normal = sparse.csr_array(sparse.vstack([self.normal_rows(part, t) for part in edges]))
        middle = sparse.csr_array(sparse.vstack([self.shear_rows(part, np.array([0.5])) for part in edges]))
        return trace_parameters(edges, normal, middle, self.grid)

    def eliminate(self, tractions: Sequence[PrescribedTraction], corners: SharedCorners) -> Elimination:
        """Traction conditions followed along chains of nodes, see `chains`."""
        links = traction_links(self, tractions, corners.frictionless)
        return eliminate(links, self.grid.dof_scales.ravel(), self.mesh.active_nodes.ravel(), corners.freed)

    def contact_displacements(
        self,
        contacts: Sequence[ContactRows],
        number: int,
        normal: FloatArray,
        tangential: FloatArray,
        elimination: Elimination,
    ) -> tuple[FloatArray, FloatArray]:
        """λ_N and λ_T as far as the traces feel them, see `displacements`."""
        rows = contacts[number]
        gap = project_normal(rows.points.count, normal / rows.points.weights)
        return gap, project_tangential(rows, tangential, blind_nodes(contacts, elimination))

    def energy(self, materials: IntArray, compliances: FloatArray, potential: FloatArray | None) -> GridEnergy:
        """The energy of the body, see `Basis`."""
        return GridEnergy(self.mesh, self.grid, materials, compliances, potential)

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates of reference points in cells, see `Basis`."""
        column, row = (place[cells][:, None] for place in self.mesh.cell_places)
        x = self.grid.x.lines[column] + self.grid.x.sizes[column] * t[..., 0]
        y = self.grid.y.lines[row] + self.grid.y.sizes[row] * t[..., 1]
        return np.stack([x, y], axis=-1)

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Stress without φ at reference points of cells, see `Basis`."""
        column, row = (place[cells][:, None] for place in self.mesh.cell_places)
        tx, ty = (
            np.broadcast_to(part, np.broadcast_shapes(column.shape, part.shape)) for part in np.moveaxis(t, -1, 0)
        )
        rows = self.grid.stress_rows(column, row, tx, ty)
        return np.asarray(np.einsum("...kd,...d->...k", rows, coefficients[self.grid.cell_dofs(column, row)]))

    def cell_rule(self, degree: int) -> tuple[FloatArray, FloatArray]:
        """Gauss points in both directions, along x first, see `Basis`."""
        t, w = gauss_legendre(degree // 2 + 1)
        points = np.column_stack([np.tile(t, len(t)), np.repeat(t, len(t))])
        return points, np.asarray(np.tile(w, len(w)) * np.repeat(w, len(w)))

    def jumps(self, u: FloatArray) -> FloatArray:  # noqa: ARG002  # see `Basis`
        """None: Φ has one value everywhere."""
        return np.empty((0, 3))

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:  # noqa: ARG002  # alike everywhere
        """Weights (cells, q), dimensionless areas, of weights (q,) on the reference cell."""
        return np.asarray(self.cell_sizes[:, None] * weights)

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at reference points of cells, see `Basis`."""
        column, row = (place[cells][:, None] for place in self.mesh.cell_places)
        rows = self.grid.derivative_rows(column, row, t[..., 0], t[..., 1], (0, 0))
        return np.asarray(np.einsum("...d,...d->...", rows, coefficients[self.grid.cell_dofs(column, row)]))

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points that divide a cell, row by row, and the corners of its parts, counterclockwise."""
        return square_lattice(divisions)
