"""Stresses from the Airy function anywhere in the body, and principal stresses."""

from itertools import product

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import cell_points, potential_at
from qvi_contact.errors import InputError


def stress_at(discretization: Discretization, nodal: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Stress (σ_xx, σ_yy, σ_xy) at points of the body.

    Equation (3.1) with σ_xy = −Φ_xy. On an interior grid line, where one normal component jumps, the mean of the
    adjacent cells is returned.

    Parameters
    ----------
    discretization : Discretization
        Where the points are looked up.
    nodal : (ny + 1, nx + 1, 4) array
        Nodal values, see `Discretization.nodal_values`.
    x, y : (...) arrays
        Coordinates [length], of one shape.

    Returns
    -------
    (..., 3) array
        Stresses [stress], tension positive.

    Raises
    ------
    InputError
        If a point lies outside the body.

    """
    mesh = discretization.problem.mesh
    columns, rows = _adjacent(mesh.x, x, "x"), _adjacent(mesh.y, y, "y")
    total, count = np.zeros((*x.shape, 3)), np.zeros(x.shape)
    for column, row in product(columns, rows):
        inside = mesh.active[row, column]
        tx = (x - mesh.x[column]) / (mesh.x[column + 1] - mesh.x[column])
        ty = (y - mesh.y[row]) / (mesh.y[row + 1] - mesh.y[row])
        total += np.where(inside[..., None], cell_stress(discretization, nodal, column, row, tx, ty), 0.0)
        count += inside
    if (count == 0).any():
        first = np.unravel_index(np.argmax(count == 0), count.shape)
        raise InputError("stress(x, y)", (float(x[first]), float(y[first])), "give points inside the body")
    potential = evaluate("ContactProblem.body_potential", discretization.problem.body_potential, x, y)
    result = discretization.scales.stress * total / count[..., None]
    result[..., :2] += potential[..., None]
    return result


def cell_stress(
    discretization: Discretization, nodal: FloatArray, column: IntArray, row: IntArray, tx: FloatArray, ty: FloatArray
) -> FloatArray:
    """Dimensionless stress without φ at reference points of given cells, shape (..., 3)."""
    grid = discretization.grid
    values = nodal.reshape(-1)[grid.cell_dofs(column, row)]
    return np.asarray(np.einsum("...kd,...d->...k", grid.stress_rows(column, row, tx, ty), values))


def gauss_stresses(
    discretization: Discretization, nodal: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, tuple[FloatArray, FloatArray], FloatArray]:
    """Gauss points of all cells, `count` along each side, and the whole stress there, φ included; dimensionless.

    Returns coordinates (cells, g, 2), weights (cells, g), reference coordinates, each (cells, g), and stress
    (cells, g, 3).
    """
    problem = discretization.problem
    row, column = np.nonzero(problem.mesh.active)
    points, weights, (tx, ty) = cell_points(discretization.grid, column, row, count)
    stress = cell_stress(discretization, nodal, column[:, None], row[:, None], tx, ty)
    stress[..., :2] += potential_at(problem, discretization.scales, points)[..., None]
    return points, weights, (tx, ty), stress


def principal_stresses(stress: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Principal stresses and their direction.

    Parameters
    ----------
    stress : (..., 3) array
        σ_xx, σ_yy, σ_xy.

    Returns
    -------
    first, second : (...) arrays
        σ₁ ≥ σ₂, in the unit of `stress`.
    angle : (...) array
        Angle from the x-axis to the direction of σ₁, counterclockwise [rad], in (−π/2, π/2].

    """
    stress = np.asarray(stress, dtype=float)
    mean = (stress[..., 0] + stress[..., 1]) / 2.0
    half = (stress[..., 0] - stress[..., 1]) / 2.0
    radius = np.hypot(half, stress[..., 2])
    return mean + radius, mean - radius, np.arctan2(stress[..., 2], half) / 2.0


def _adjacent(lines: FloatArray, values: FloatArray, name: str) -> tuple[IntArray, IntArray]:
    """Intervals on either side of each value: the same one twice unless it lies on an interior line."""
    slack = 1e-12 * (lines[-1] - lines[0])
    outside = ~((values >= lines[0] - slack) & (values <= lines[-1] + slack))
    if outside.any():
        found = float(values[np.unravel_index(np.argmax(outside), values.shape)])
        raise InputError(f"stress: {name}", found, f"give points between {lines[0]:g} and {lines[-1]:g}")
    last = len(lines) - 2
    before = np.clip(np.searchsorted(lines, values, side="left") - 1, 0, last)
    after = np.clip(np.searchsorted(lines, values, side="right") - 1, 0, last)
    return before, after
