"""Stresses sampled cell by cell, each from its own element, and the scalar measures made of them.

Fields may jump between cells, so a sample on a cell's border belongs to that cell alone.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray, one_of, real_array
from qvi_contact.discretization.loads import physical
from qvi_contact.problem.material import is_strained, stress_along_z
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import principal_stresses, stress_in_cells

COMPONENTS: Final = ("xx", "yy", "xy", "von_mises", "first", "second")
"""Scalar stresses: Cartesian components, von Mises, in-plane principal stresses σ₁ ≥ σ₂."""


_CHUNK: Final = 4096  # cells at a time: their tables stay small
_MOST_DIVISIONS: Final = 128  # along the sides of a cell


@dataclass(frozen=True, eq=False)
class BodySamples:
    """Stresses at points of all cells, and the small triangles that join the points of each cell.

    Attributes
    ----------
    points : (n, 2) array
        Coordinates [length]; where cells meet each has points of its own.
    cells : (n,) int array
        The cell of each point.
    reference : (n, d) array
        Its reference coordinates there, see `TriangleMesh.reference`.
    stress : (n, 3) array
        σ_xx, σ_yy, σ_xy in that cell [stress], tension positive.
    triangles : (t, 3) int array
        Three points each; together they fill the body.

    """

    points: FloatArray
    cells: IntArray
    reference: FloatArray
    stress: FloatArray
    triangles: IntArray


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
