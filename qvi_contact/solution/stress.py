"""Stresses from the Airy function anywhere in the body, samples of them cell by cell, and scalars made of them.

Fields may jump between cells, so a sample on a cell's border belongs to that cell alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, evaluate, one_of, real_array
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import physical, potential_at
from qvi_contact.errors import InputError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.material import is_strained, stress_along_z
from qvi_contact.problem.problem import ContactProblem

if TYPE_CHECKING:
    from qvi_contact.solution.result import ContactResult

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
    problem, space, coefficients = discretization.problem, discretization.space, discretization.coefficients(u.ravel())
    stress = mean_at(problem.mesh, x, y, lambda cell, t: space.stress(coefficients, cell, t)[:, 0], "stress(x, y)")
    stress *= discretization.scales.stress
    stress[..., :2] += evaluate("ContactProblem.body_potential", problem.body_potential, x, y)[..., None]
    return stress


def mean_at(
    mesh: TriangleMesh, x: FloatArray, y: FloatArray, values: Callable[[IntArray, FloatArray], FloatArray], name: str
) -> FloatArray:
    """The mean (..., k) of what cells say at points (...) that they hold: values of cells (n,) at t (n, 1, 3), (n, k).

    A point outside is an `InputError` of the field `name`.
    """
    places = np.column_stack([x.ravel(), y.ravel()])
    point, cell = mesh.around(places)
    count = np.bincount(point, minlength=len(places))
    if (count == 0).any():
        raise InputError(name, tuple(places[np.argmin(count)].tolist()), "give points inside the body")
    found = values(cell, mesh.reference(cell, places[point])[:, None])
    total = np.column_stack([np.bincount(point, part, len(places)) for part in found.T])
    return np.asarray(total / count[:, None]).reshape(*x.shape, found.shape[1])


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


COMPONENTS: Final = ("xx", "yy", "xy", "von_mises", "first", "second")
"""Scalar stresses: Cartesian components, von Mises, in-plane principal stresses σ₁ ≥ σ₂."""


_CHUNK: Final = 4096  # cells at a time: their tables stay small
_MOST_DIVISIONS: Final = 128  # along the sides of a cell


@dataclass(frozen=True, eq=False)
class BodySamples:
    """Stresses at points of all cells, and the small triangles that join the points of each cell."""

    points: FloatArray  # (n, 2): coordinates [length]; where cells meet each has points of its own
    cells: IntArray  # (n,): the cell of each point
    reference: FloatArray  # (n, d): its reference coordinates there, see `TriangleMesh.reference`
    stress: FloatArray  # (n, 3): σ_xx, σ_yy, σ_xy in that cell [stress], tension positive
    triangles: IntArray  # (t, 3): three points each; together they fill the body


def sample_body(result: ContactResult, parts: int) -> BodySamples:
    """Samples of the stress all over a body.

    Parameters
    ----------
    result : ContactResult
        The state.
    parts : int
        Cells are divided so that about so many parts lie along the body's length; small cells are not divided.

    """
    mesh, discretization = result.problem.mesh, result.discretization
    sizes = np.ptp(mesh.vertices[mesh.cells], axis=1).max(axis=1)
    wanted = np.clip(parts * sizes / mesh.length, 1.0, _MOST_DIVISIONS)
    divisions = (2.0 ** np.round(np.log2(wanted))).astype(np.int64)  # few numbers of divisions: few groups of cells
    coefficients = discretization.coefficients(result.dofs)
    found: list[tuple[FloatArray, IntArray, FloatArray, FloatArray]] = []
    triangles, count = [np.empty((0, 3), dtype=np.int64)], 0
    for division in np.unique(divisions).tolist():
        t, split = discretization.space.lattice(division)
        chosen = np.flatnonzero(divisions == division)
        for cells in (chosen[start : start + _CHUNK] for start in range(0, len(chosen), _CHUNK)):
            points, stress = stress_in_cells(discretization, coefficients, cells, t)
            reference = np.tile(t, (len(cells), 1))
            found.append((points.reshape(-1, 2), np.repeat(cells, len(t)), reference, stress.reshape(-1, 3)))
            triangles.append((count + len(t) * np.arange(len(cells))[:, None, None] + split).reshape(-1, 3))
            count += len(cells) * len(t)
    points, numbers, references, stresses = (np.concatenate(chunks) for chunks in zip(*found, strict=True))
    place = np.column_stack(physical(result.problem, discretization.scales, points))
    stresses *= discretization.scales.stress
    return BodySamples(place, numbers, references, stresses, np.concatenate(triangles))


def cell_factors(problem: ContactProblem) -> FloatArray:
    """The factor f of σ_zz = f (σ_xx + σ_yy) in each cell, shape (cells,): ν in plane strain, 0 in plane stress."""
    return np.asarray(np.array(out_of_plane_factors(problem))[problem.cell_materials])


def out_of_plane_factors(problem: ContactProblem) -> list[float]:
    """The same for each of the problem's materials."""
    return [material.poisson if material.plane == "strain" else 0.0 for material in problem.materials]


def held_along_z(problem: ContactProblem, cells: IntArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """What an initial strain adds to σ_zz at points of cells (k,), from coordinates (k, …) [length]; 0 without one."""
    if not is_strained(problem):
        return np.zeros(np.shape(x))
    return stress_along_z(problem, cells, x, y, np.zeros((*np.shape(x), 3)))


def von_mises(stress: FloatArray, factor: FloatArray | float = 0.0, held: FloatArray | float = 0.0) -> FloatArray:
    """Von Mises stress √(½[(σ_xx−σ_yy)² + (σ_yy−σ_zz)² + (σ_zz−σ_xx)²] + 3σ_xy²).

    Parameters
    ----------
    stress : (..., 3) array
        σ_xx, σ_yy, σ_xy.
    factor : (...) array
        f of σ_zz = f (σ_xx + σ_yy) + `held`, see `cell_factors`; 0, plane stress, by default.
    held : (...) array
        What initial strains add to σ_zz, see `held_along_z`.

    Returns
    -------
    (...) array
        In the unit of `stress`.

    """
    xx, yy, xy = np.moveaxis(real_array("stress", stress), -1, 0)
    zz = factor * (xx + yy) + held
    return np.asarray(np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2.0 + 3.0 * xy**2))


def stress_component(
    stress: FloatArray, component: str, factor: FloatArray | float = 0.0, held: FloatArray | float = 0.0
) -> FloatArray:
    """One of the `COMPONENTS` of stresses (..., 3); `factor` and `held` as in `von_mises`.

    Raises
    ------
    InputError
        If there is no such component.

    """
    one_of("component", component, COMPONENTS)
    if component == "von_mises":
        return von_mises(stress, factor, held)
    if component in ("first", "second"):
        return principal_stresses(stress)[("first", "second").index(component)]
    return np.asarray(stress[..., ("xx", "yy", "xy").index(component)])
