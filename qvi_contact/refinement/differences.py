"""How two results of one problem on nested grids differ, cell by cell of a fine grid.

For stresses σ of a coarse and τ of a fine grid the difference of the complementary energies is made of

    D = ½ ∫ c (σ − τ) : (σ − τ) dx                                        in the cells, and
    K = ∫ |s_τ| (b(σ_N) − |σ_T|) − g_τ σ_N ds                              on the contacts,

with s_τ and g_τ slip and gap of the fine result and b the friction bound: where the fine one slips, the coarse one does
not use up its friction; where the fine one is open, the coarse one still presses.

Without friction D + K is c(σ) − c(τ), exactly, if loads are met pointwise: stresses admissible on the coarse grid then
are so on the fine one. With friction the bound moves too, which counts in either sign and is left out. Both terms are
≥ 0, but for edges where σ violates the contact law between the points that check it; those count as zero.

In `docs/theory.md`: (D12).
"""

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.discretization.contact_rows import ContactRows
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT, STRESS_DERIVATIVES, Line
from qvi_contact.element.hermite import gauss_legendre, scaled_hermite
from qvi_contact.mesh.rectilinear import HORIZONTAL, RectilinearMesh, grid_edges
from qvi_contact.refinement.grids import parents
from qvi_contact.solution.result import ContactResult


def nodal_table(result: ContactResult) -> FloatArray:
    """Nodal values with rows (node in y, kind) and columns (node in x, kind), shape (2 ny + 2, 2 nx + 2)."""
    ny, nx = result.problem.grid.shape
    return result.nodal.reshape(ny + 1, nx + 1, 2, 2).transpose(0, 2, 1, 3).reshape(2 * ny + 2, 2 * nx + 2)


def gauss_stress(result: ContactResult, fine: RectilinearMesh, table: FloatArray | None = None) -> FloatArray:
    """Stress without body potential at the Gauss points of a finer grid, shape (ny, 4, nx, 4, 3) [stress].

    `table` replaces the result's own nodal values. Each derivative of Φ is one product H_y U H_xᵀ.
    """
    mesh, grid, scales = result.problem.grid, result.discretization.grid, result.discretization.scales
    table = nodal_table(result) if table is None else table
    in_x = [_hermite_at_gauss(grid.x, mesh.x, fine.x, order) for order in (0, 1, 2)]
    in_y = [_hermite_at_gauss(grid.y, mesh.y, fine.y, order) for order in (0, 1, 2)]
    fields = [factor * ((in_y[dy] @ table) @ in_x[dx].T) for dx, dy, factor in STRESS_DERIVATIVES]
    (ny, nx), n = fine.shape, GAUSS_COUNT
    return np.asarray(scales.stress * np.stack(fields, axis=-1)).reshape(ny, n, nx, n, 3)


def cell_energy(result: ContactResult, stress: FloatArray) -> FloatArray:
    """½∫ cσ:σ of stresses (ny, 4, nx, 4, 3) at the Gauss points in each cell, shape (ny, nx) [stress × length²].

    Four points a direction are exact for bicubic Φ. Cells outside the body have 0.
    """
    problem, weights = result.problem, gauss_legendre(GAUSS_COUNT)[1]
    mesh = problem.grid
    compliance = np.zeros((*mesh.shape, 3, 3))
    compliance[mesh.active] = problem.compliances
    work = np.einsum("jbiak,jikl,jbial,a,b->ji", stress, compliance, stress, weights, weights, optimize=True)
    return np.asarray(0.5 * work * np.diff(mesh.y)[:, None] * np.diff(mesh.x))


def directional_energy(fine: ContactResult, coarse: RectilinearMesh) -> tuple[FloatArray, FloatArray]:
    """½∫ cδ:δ in the fine cells of what Φ loses if it is interpolated on the coarse lines in x only, and in y only."""
    table, grid = nodal_table(fine), fine.discretization.grid
    mesh = fine.problem.grid
    loss_x = table - table @ _interpolation(grid.x, mesh.x, coarse.x).T
    loss_y = table - _interpolation(grid.y, mesh.y, coarse.y) @ table
    in_x, in_y = (cell_energy(fine, gauss_stress(fine, mesh, loss)) for loss in (loss_x, loss_y))
    return in_x, in_y


def contact_defect(fine: ContactResult, coarse: ContactResult) -> FloatArray:
    """K of each fine cell with a contact edge, for the coarse result's tractions; shape (ny, nx) [stress × length²]."""
    found = np.zeros(fine.problem.grid.shape)
    for rows in fine.discretization.contacts:
        if rows.law == "tied":
            continue
        line, edges = fine.contacts[rows.name], grid_edges(rows.points.edges)
        normal, tangential = _tractions(coarse, fine.problem.grid, rows, line.x, line.y)
        unit = fine.discretization.scales.stress
        effective = normal + line.pore_pressure
        unused = unit * rows.bound(effective / unit) - np.abs(tangential)
        density = np.abs(line.slip) * unused
        if rows.law == "unilateral":
            density = density - line.gap * effective
        edge = (line.weights * density).reshape(len(edges), -1).sum(axis=1)
        edge = np.maximum(edge, 0.0) * (0.5 if rows.joint else 1.0)
        np.add.at(found, (edges.row, edges.column), edge)
        if rows.joint:  # the other half belongs to the block on the other side
            across = edges.axis == HORIZONTAL
            np.add.at(found, (edges.row + across, edges.column + ~across), edge)
    return found


def _tractions(
    result: ContactResult, fine: RectilinearMesh, rows: ContactRows, x: FloatArray, y: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """σ_N and σ_T [stress] of a result on a coarser grid at the points x, y of a fine grid's contact."""
    mesh, edges, n = result.problem.grid, grid_edges(rows.points.edges), rows.points.count
    column = np.repeat(parents(mesh.x, fine.x)[edges.column], n)
    row = np.repeat(parents(mesh.y, fine.y)[edges.row], n)
    tx = (x - mesh.x[column]) / np.diff(mesh.x)[column]
    ty = (y - mesh.y[row]) / np.diff(mesh.y)[row]
    scales = result.discretization.scales
    cells, t = mesh.cell_numbers[row, column], np.column_stack([tx, ty])[:, None]
    stress = scales.stress * result.discretization.space.stress(result.dofs, cells, t)[:, 0]
    potential = evaluate("ContactProblem.body_potential", result.problem.body_potential, x, y)
    normal = np.where(np.repeat(edges.axis, n) == HORIZONTAL, stress[:, 1], stress[:, 0]) + potential
    return normal, np.repeat(edges.sign, n) * stress[:, 2]


def _hermite_at_gauss(line: Line, lines: FloatArray, fine: FloatArray, order: int) -> sparse.csr_array:
    """Hermite functions of a grid at the Gauss points of finer intervals; rows points, columns (node, kind)."""
    points = gauss_legendre(GAUSS_COUNT)[0]
    interval = np.repeat(parents(lines, fine), GAUSS_COUNT)
    places = (fine[:-1, None] + np.diff(fine)[:, None] * points).ravel()
    return _hermite(line, interval, (places - lines[interval]) / np.diff(lines)[interval], order)


def _hermite(line: Line, interval: IntArray, t: FloatArray, order: int) -> sparse.csr_array:
    values = line.basis(interval, t, order).reshape(len(t), 4)
    columns = 2 * interval[:, None] + np.arange(4)
    index = (np.repeat(np.arange(len(t)), 4), columns.ravel())
    return sparse.csr_array((values.ravel(), index), shape=(len(t), 2 * len(line.lines)))


def _interpolation(line: Line, fine: FloatArray, coarse: FloatArray) -> sparse.csr_array:
    """Nodal values on fine lines of the Hermite interpolant on the coarse ones, in the fine line's scales."""
    n, kept = len(fine), np.searchsorted(fine, coarse)
    interval = np.clip(np.searchsorted(coarse, fine, side="right") - 1, 0, len(coarse) - 2)
    t = (fine - coarse[interval]) / np.diff(coarse)[interval]
    lengths = (line.lines[kept[1:]] - line.lines[kept[:-1]])[interval]
    ends = np.column_stack([line.scales[kept[interval]], line.scales[kept[interval + 1]]])
    nodes = np.column_stack([kept[interval], kept[interval + 1]])
    blocks = []
    for kind, scale in enumerate((np.ones(n), line.scales)):
        values = scaled_hermite(t, lengths, ends, kind).reshape(n, 4) * scale[:, None]
        columns = (2 * nodes[:, :, None] + np.arange(2)).reshape(n, 4)
        index = (np.repeat(2 * np.arange(n) + kind, 4), columns.ravel())
        blocks.append(sparse.csr_array((values.ravel(), index), shape=(2 * n, 2 * n)))
    return sparse.csr_array(blocks[0] + blocks[1])
