"""Stresses from the Airy function anywhere in the body, and principal stresses."""

from __future__ import annotations

from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate, real_array
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import potential_at
from qvi_contact.errors import InputError

_MOST_CELLS: Final = 1024
_COMPONENTS: Final = 3  # of a stress


def stress_at(discretization: Discretization, u: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Stress (σ_xx, σ_yy, σ_xy) at points of the body.

    Equation (3.1) with σ_xy = −Φ_xy. On an edge inside the body, where the normal stress along it jumps, and in
    vertices the mean of the adjacent cells is returned.

    Parameters
    ----------
    discretization : Discretization
        Where the points are looked up.
    u : (N,) array
        Degrees of freedom of Φ, see `Discretization.values`.
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
    mesh, space = discretization.problem.mesh, discretization.space
    places = np.column_stack([x.ravel(), y.ravel()])
    point, cell = mesh.around(places)
    count = np.bincount(point, minlength=len(places))
    if (count == 0).any():
        first = int(np.argmax(count == 0))
        raise InputError("stress(x, y)", tuple(places[first].tolist()), "give points inside the body")
    t = mesh.reference(cell, places[point])[:, None]
    stress = space.stress(discretization.coefficients(u.ravel()), cell, t)[:, 0]
    total = np.column_stack([np.bincount(point, part, len(places)) for part in stress.T])
    potential = evaluate("ContactProblem.body_potential", discretization.problem.body_potential, x, y)
    result = (discretization.scales.stress * total / count[:, None]).reshape(*x.shape, 3)
    result[..., :2] += potential[..., None]
    return result


def cell_stresses(
    discretization: Discretization, u: FloatArray, t: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Dimensionless coordinates (cells, g, 2) and whole stress (cells, g, 3), φ included, at points of all cells.

    The points t (g, d) are given on the reference cell; by default those of the quadrature, `StressSpace.cell_points`.
    """
    t = discretization.space.cell_points if t is None else t
    cells = np.arange(discretization.problem.mesh.cell_count)
    return stress_in_cells(discretization, discretization.coefficients(u.ravel()), cells, t)


def stress_in_cells(
    discretization: Discretization, coefficients: FloatArray, cells: IntArray, t: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The same in some cells (k,), from all coefficients of Φ (see `TriangleEnergy.coefficients`)."""
    problem, space = discretization.problem, discretization.space
    points = space.points(cells, t)
    stress = space.stress(coefficients, cells, t)
    stress[..., :2] += potential_at(problem, discretization.scales, points)[..., None]
    return points, stress


def stress_rounding(discretization: Discretization, u: FloatArray) -> float:
    """What the rounding of the degrees of freedom u (N,) does to stresses, dimensionless: the largest change found.

    Stresses are second differences of u, so rounding them takes ε (L/h)² of the stresses in a cell of size h. Every
    entry is moved up or down by half a unit in its last place, at random, and the stresses are looked at in the cells
    of least area, `_MOST_CELLS` of them.
    """
    space = discretization.space
    cells = np.argsort(space.cell_sizes, kind="stable")[:_MOST_CELLS]
    signs = np.random.default_rng(0).integers(2, size=u.size) * 2.0 - 1.0
    moved = u.ravel() * (1.0 + signs * np.finfo(np.float64).eps)
    stresses = (
        space.stress(discretization.coefficients(values), cells, space.cell_points) for values in (u.ravel(), moved)
    )
    first, second = stresses
    return float(np.abs(second - first).max(initial=0.0))


def cell_weights(discretization: Discretization) -> FloatArray:
    """Dimensionless weights (cells, g) of the quadrature points."""
    space = discretization.space
    return space.cell_measures(space.cell_points, space.cell_weights)


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

    Raises
    ------
    InputError
        If the last axis does not have three numbers.

    """
    given, stress = stress, real_array("stress", stress)
    if stress.ndim < 1 or stress.shape[-1] != _COMPONENTS:
        raise InputError("stress", given, "give σ_xx, σ_yy, σ_xy along the last axis: an array of shape (..., 3)")
    mean = (stress[..., 0] + stress[..., 1]) / 2.0
    half = (stress[..., 0] - stress[..., 1]) / 2.0
    radius = np.hypot(half, stress[..., 2])
    return mean + radius, mean - radius, np.arctan2(stress[..., 2], half) / 2.0
