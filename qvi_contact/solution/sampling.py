"""Stresses sampled cell by cell, each from its own element, and the scalar measures made of them.

Fields may jump between cells, so a sample on a cell's border belongs to that cell alone.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, evaluate, one_of, real_array
from qvi_contact.element.bogner_fox_schmit import STRESS_DERIVATIVES, Line
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import principal_stresses

COMPONENTS: Final = ("xx", "yy", "xy", "von_mises", "first", "second")
"""Scalar stresses: Cartesian components, von Mises, in-plane principal stresses σ₁ ≥ σ₂."""


@dataclass(frozen=True, eq=False)
class CellSamples:
    """Airy function and stress on an n×n sub-grid of every cell; NaN in cells outside the body.

    Attributes
    ----------
    x : (nx, n) array
        Coordinates of the samples in each column of cells [length].
    y : (ny, n) array
        Coordinates of the samples in each row of cells [length].
    airy : (ny, n, nx, n) array
        Φ [stress × length²], up to an affine function.
    stress : (ny, n, nx, n, 3) array
        σ_xx, σ_yy, σ_xy [stress], tension positive.

    """

    x: FloatArray
    y: FloatArray
    airy: FloatArray
    stress: FloatArray


def sample_cells(result: ContactResult, t: FloatArray) -> CellSamples:
    """Samples at the reference points (t_a, t_b) of every cell.

    The grid is rectilinear, so each derivative of Φ is one product H_y U H_xᵀ of the Hermite functions along the two
    directions with the table U of nodal values.

    Parameters
    ----------
    result : ContactResult
        The state.
    t : (n,) array
        Reference coordinates in each direction, 0 to 1.

    """
    discretization, mesh = result.discretization, result.problem.grid
    grid, (ny, nx), n = discretization.grid, mesh.shape, len(t)
    table = result.nodal.reshape(ny + 1, nx + 1, 2, 2).transpose(0, 2, 1, 3).reshape(2 * ny + 2, 2 * nx + 2)
    in_x, in_y = [[_hermite_table(line, t, order) for order in (0, 1, 2)] for line in (grid.x, grid.y)]

    def derivative(dx: int, dy: int) -> FloatArray:
        return np.asarray((in_y[dy] @ table) @ in_x[dx].T).reshape(ny, n, nx, n)

    scales = discretization.scales
    x, y = (lines[:-1, None] + np.diff(lines)[:, None] * t for lines in (mesh.x, mesh.y))
    stress = np.stack([scales.stress * factor * derivative(dx, dy) for dx, dy, factor in STRESS_DERIVATIVES], axis=-1)
    inside = np.broadcast_to(mesh.active[:, None, :, None], (ny, n, nx, n))
    points_x, points_y = np.broadcast_to(x, (ny, n, nx, n)), np.broadcast_to(y[:, :, None, None], (ny, n, nx, n))
    field = result.problem.body_potential
    potential = evaluate("ContactProblem.body_potential", field, points_x[inside], points_y[inside])
    stress[inside, :2] += potential[:, None]
    stress[~inside] = np.nan
    return CellSamples(x, y, np.where(inside, scales.airy * derivative(0, 0), np.nan), stress)


def out_of_plane_factor(problem: ContactProblem) -> FloatArray:
    """The factor f of σ_zz = f (σ_xx + σ_yy) in each cell, shape (ny, nx): ν in plane strain, 0 in plane stress."""
    return np.asarray(_factors(problem)[problem.material_numbers])


def cell_factors(problem: ContactProblem) -> FloatArray:
    """The same for the cells of any mesh, shape (cells,)."""
    return np.asarray(_factors(problem)[problem.cell_materials])


def _factors(problem: ContactProblem) -> FloatArray:
    return np.array([material.poisson if material.plane == "strain" else 0.0 for material in problem.materials])


def von_mises(stress: FloatArray, factor: FloatArray | float = 0.0) -> FloatArray:
    """Von Mises stress √(½[(σ_xx−σ_yy)² + (σ_yy−σ_zz)² + (σ_zz−σ_xx)²] + 3σ_xy²).

    Parameters
    ----------
    stress : (..., 3) array
        σ_xx, σ_yy, σ_xy.
    factor : (...) array
        f of σ_zz = f (σ_xx + σ_yy), see `out_of_plane_factor`; 0, plane stress, by default.

    Returns
    -------
    (...) array
        In the unit of `stress`.

    """
    xx, yy, xy = np.moveaxis(real_array("stress", stress), -1, 0)
    zz = factor * (xx + yy)
    return np.asarray(np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2.0 + 3.0 * xy**2))


def stress_component(stress: FloatArray, component: str, factor: FloatArray | float = 0.0) -> FloatArray:
    """One of the `COMPONENTS` of stresses (..., 3); `factor` as in `von_mises`.

    Raises
    ------
    InputError
        If there is no such component.

    """
    one_of("component", component, COMPONENTS)
    if component == "von_mises":
        return von_mises(stress, factor)
    if component in ("first", "second"):
        return principal_stresses(stress)[("first", "second").index(component)]
    return np.asarray(stress[..., ("xx", "yy", "xy").index(component)])


def _hermite_table(line: Line, t: FloatArray, order: int) -> sparse.csr_array:
    """Hermite functions at the points t of each of the n intervals; rows (interval, point), columns (node, kind)."""
    n = len(line.sizes)
    values = line.basis(np.arange(n)[:, None], np.asarray(t, dtype=float)[None, :], order)
    rows = np.arange(n * len(t)).reshape(n, len(t), 1, 1)
    columns = 2 * np.arange(n)[:, None, None, None] + np.arange(4).reshape(2, 2)
    index = (np.broadcast_to(rows, values.shape).ravel(), np.broadcast_to(columns, values.shape).ravel())
    return sparse.csr_array((values.ravel(), index), shape=(n * len(t), 2 * n + 2))
