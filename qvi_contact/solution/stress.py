"""Stresses from the Airy function anywhere in the body, scalars made of them, and tractions on edges.

Stresses may jump between cells, so each cell has its own samples on its border.

On an arc tractions are the polynomials whose coefficients are degrees of freedom. They have the resultant of the stress
there, and its moments up to their degree. Their difference from σn is of the order of the element; equilibrium holds up
to the work of this difference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, IntArray, one_of, real_array
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import (
    LOAD_POINTS,
    EdgePoints,
    is_polynomial,
    physical,
    potential_at,
    traction_data,
)
from qvi_contact.element.edge import legendre_from_values
from qvi_contact.errors import InputError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.material import stress_along_z

if TYPE_CHECKING:
    from qvi_contact.solution.result import ContactResult

_MOST_CELLS: Final = 1024  # number of cells in which the rounding of stresses is sampled
_COMPONENTS: Final = 3  # σ_xx, σ_yy, σ_xy
_MISFIT: Final = 1e-9  # misfit of prescribed tractions over the unit of stress, always allowed
_ROUNDED: Final = 1e-6  # the same, at most allowed for rounding in the smallest cells
_ULPS: Final = 8.0  # roundings of a degree of freedom in the elimination along the boundary
_POINTS = 12  # points on an arc where tractions are compared with σn


def stress_at(discretization: Discretization, u: FloatArray, x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Stress (σ_xx, σ_yy, σ_xy, σ_zz) (..., 4) [stress] at points x, y [length], of degrees of freedom u (N,) of Φ.

    Equation (3.1) with σ_xy = −Φ_xy. On an edge inside the body, where the stress along it jumps, and in a vertex it is
    the mean of the adjacent cells. `InputError` if a point is outside the body.
    """
    problem, scales = discretization.problem, discretization.scales

    def values(cells: IntArray, t: FloatArray) -> FloatArray:
        points, stress = (part[:, 0] for part in stress_in_cells(discretization, u, cells, t))
        stress = scales.stress * stress
        return np.column_stack([stress, stress_along_z(problem, cells, *physical(problem, scales, points), stress)])

    return mean_at(problem.mesh, x, y, values, "stress(x, y)")


def mean_at(
    mesh: TriangleMesh, x: ArrayLike, y: ArrayLike, values: Callable[[IntArray, FloatArray], FloatArray], name: str
) -> FloatArray:
    """The mean (..., k) over all cells that contain each point x, y of values (n, k) of cells (n,) at t (n, 1, 3).

    `InputError` of the field `name` if the shapes of x and y do not go together, or a point is outside the body.
    """
    remedy = "give real numbers, or arrays of them whose shapes go together"
    try:
        x, y = np.broadcast_arrays(*(real_array(name, value, remedy) for value in (x, y)))
    except ValueError as error:
        raise InputError(name, (x, y), remedy) from error
    places = np.column_stack([x.ravel(), y.ravel()])
    point, cell = mesh.around(places)
    count = np.bincount(point, minlength=len(places))
    if (count == 0).any():
        raise InputError(name, tuple(places[np.argmin(count)].tolist()), "give points inside the body")
    in_cells = values(cell, mesh.reference(cell, places[point])[:, None])
    total = np.column_stack([np.bincount(point, part, len(places)) for part in in_cells.T])
    return np.asarray(total / count[:, None]).reshape(*x.shape, in_cells.shape[1])


def stress_in_cells(
    discretization: Discretization, u: FloatArray, cells: IntArray | None = None, t: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Dimensionless coordinates (k, g, 2) and stress (k, g, 3), φ included, at reference points t of cells (k,).

    By default of all cells, at the points t (g, 3) of `StressSpace.cell_quadrature`; t may be (k, g, 3).
    """
    problem, space = discretization.problem, discretization.space
    t = space.cell_quadrature[0] if t is None else t
    cells = np.arange(problem.mesh.cell_count) if cells is None else cells
    points = space.points(cells, t)
    stress = space.stress(discretization.coefficients(u.ravel()), cells, t)
    stress[..., :2] += potential_at(problem, discretization.scales, points)[..., None]
    return points, stress


def stress_rounding(discretization: Discretization, u: FloatArray) -> float:
    """Largest change of stresses by rounding the degrees of freedom u (N,), dimensionless, from a sample.

    Stresses are second differences of u. So rounding of u changes stresses in a cell of size h by a share ε (L/h)².
    Every entry is changed by ±ε of its size, at random, and stresses are compared in the `_MOST_CELLS` smallest cells.
    """
    space = discretization.space
    cells = np.argsort(space.triangles.areas, kind="stable")[:_MOST_CELLS]
    signs = np.random.default_rng(0).integers(2, size=u.size) * 2.0 - 1.0
    moved = u.ravel() * (1.0 + signs * np.finfo(np.float64).eps)
    coefficients, t = map(discretization.coefficients, (u.ravel(), moved)), space.cell_quadrature[0]
    first, second = (space.stress(each, cells, t) for each in coefficients)
    return float(np.abs(second - first).max(initial=0.0))


def principal_stresses(stress: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Principal stresses σ₁ ≥ σ₂ (...) of σ_xx, σ_yy, σ_xy (..., 3), in the same unit, and the angle of σ₁ (...).

    The angle is from the x-axis, counterclockwise [rad], in (−π/2, π/2]. `InputError` for arrays of other shapes.
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

_MOST_DIVISIONS: Final = 128  # largest number of divisions of a cell's sides


@dataclass(frozen=True, eq=False)
class BodySamples:
    """Stresses at points of all cells, and the small triangles that join the points of each cell."""

    points: FloatArray  # (n, 2): coordinates [length]; each cell has its own points on its border
    cells: IntArray  # (n,): the cell of each point
    reference: FloatArray  # (n, 3): reference coordinates in that cell, see `TriangleMesh.reference`
    stress: FloatArray  # (n, 3): σ_xx, σ_yy, σ_xy in that cell [stress], tension positive
    along_z: FloatArray  # (n,): σ_zz [stress]
    triangles: IntArray  # (t, 3): the points of small triangles that fill the body


def sample_body(result: ContactResult, parts: int = 0, divisions: int | None = None) -> BodySamples:
    """Samples of the stress in all cells, with about `parts` samples along the body's length.

    Small cells are not divided. With `divisions` each cell has that many along the sides of its three parts, and cells
    come in the order of the mesh.
    """
    mesh, discretization = result.problem.mesh, result.discretization
    sizes = np.ptp(mesh.vertices[mesh.cells], axis=1).max(axis=1)
    wanted = np.clip(parts * sizes / mesh.length, 1.0, _MOST_DIVISIONS)
    division_of = (2.0 ** np.round(np.log2(wanted))).astype(np.int64)  # powers of two make few groups of cells
    division_of = division_of if divisions is None else np.full(len(sizes), divisions)
    samples: list[tuple[FloatArray, IntArray, FloatArray, FloatArray]] = []
    triangles, count = [np.empty((0, 3), dtype=np.int64)], 0
    for division in np.unique(division_of).tolist():
        t, split = discretization.space.lattice(division)
        cells = np.flatnonzero(division_of == division)
        points, stress = stress_in_cells(discretization, result.dofs, cells, t)
        reference = np.tile(t, (len(cells), 1))
        samples.append((points.reshape(-1, 2), np.repeat(cells, len(t)), reference, stress.reshape(-1, 3)))
        triangles.append((count + len(t) * np.arange(len(cells))[:, None, None] + split).reshape(-1, 3))
        count += len(cells) * len(t)
    points, numbers, references, stresses = (np.concatenate(chunks) for chunks in zip(*samples, strict=True))
    x, y = physical(result.problem, discretization.scales, points)
    stresses *= discretization.scales.stress
    along_z = stress_along_z(result.problem, numbers, x, y, stresses)
    return BodySamples(np.column_stack([x, y]), numbers, references, stresses, along_z, np.concatenate(triangles))


def von_mises(stress: FloatArray, zz: FloatArray | float = 0.0) -> FloatArray:
    """Von Mises stress √(½[(σ_xx−σ_yy)² + (σ_yy−σ_zz)² + (σ_zz−σ_xx)²] + 3σ_xy²) (...) of stresses (..., 3).

    σ_zz (...) is that of `stress_along_z`; by default 0, for plane stress.
    """
    xx, yy, xy = np.moveaxis(real_array("stress", stress), -1, 0)
    return np.asarray(np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2.0 + 3.0 * xy**2))


def stress_component(stress: FloatArray, component: str, zz: FloatArray | float = 0.0) -> FloatArray:
    """One of the `COMPONENTS` of stresses (..., 3), else `InputError`; σ_zz as in `von_mises`."""
    one_of("component", component, COMPONENTS)
    if component == "von_mises":
        return von_mises(stress, zz)
    if component in ("first", "second"):
        return principal_stresses(stress)[("first", "second").index(component)]
    return np.asarray(stress[..., ("xx", "yy", "xy").index(component)])


# Tractions on edges, and their difference from the data.


def normal_and_shear(
    discretization: Discretization, u: FloatArray, points: EdgePoints
) -> tuple[FloatArray, FloatArray]:
    """σ_N, φ included, and σ_T at points of edges, dimensionless, from degrees of freedom u of Φ."""
    normal, shear = points.tractions(u.ravel())
    return normal + potential_at(discretization.problem, discretization.scales, points.coordinates), shear


def traction(discretization: Discretization, u: FloatArray, points: EdgePoints) -> FloatArray:
    """Traction σn at points of edges, shape (2, points) [stress]."""
    normal, shear = normal_and_shear(discretization, u, points)
    return np.asarray(discretization.scales.stress * (normal * points.normals.T + shear * points.tangents.T))


def misfit_of_tractions(discretization: Discretization, u: FloatArray) -> float:
    """Largest difference between prescribed tractions and those of degrees of freedom u of Φ [stress].

    It is taken at the Gauss points that integrate the data, without the tiny parts of edges beside a jump.
    """
    problem, space, scales = discretization.problem, discretization.space, discretization.scales
    degree, largest = space.element.traction_degree, 0.0
    count = max(LOAD_POINTS, degree + 1)
    for given in problem.prescribed(Traction):
        most = count - 1 if given.edges.curved else degree  # a component of the traction is no polynomial on arcs
        points = EdgePoints(space, given.edges, count)
        normal, shear = points.tractions(u.ravel())
        directions = points.vectors(given.direction, given.turns)
        along = ((normal * points.normals.T + shear * points.tangents.T) * directions.T).sum(axis=0)
        prescribed = traction_data(problem, scales, given, LOAD_POINTS)
        computed = along.reshape(-1, count) @ legendre_from_values(most, count).T
        largest = max(largest, prescribed.misfit(computed))
    return scales.stress * largest


def allowed_misfit(unit: float, rounding: float) -> float:
    """Misfit of tractions that counts as rounding, from the unit of stress and the rounding of stresses [stress]."""
    return _MISFIT * unit + min(_ULPS * rounding, _ROUNDED * unit)


def loads_followed(discretization: Discretization) -> bool:
    """Whether stresses of the mesh can meet the loads at every point, not only in resultants.

    They can if prescribed tractions are polynomials of the degree of the mesh's tractions on every edge, and if body
    potential and pore pressure are so on every edge of the contacts.
    """
    u, unit = discretization.values(np.zeros(discretization.qvi.n)), discretization.scales.stress
    rounding = unit * stress_rounding(discretization, u)
    if misfit_of_tractions(discretization, u) > allowed_misfit(unit, rounding):
        return False
    problem, most = discretization.problem, discretization.space.element.traction_degree
    return all(
        is_polynomial(problem, problem.mesh.edges(contact.edges), name, field, most)
        for contact in problem.contacts if contact.law != "tied"
        for name, field in (
            ("Contact.pore_pressure", contact.pore_pressure), ("ContactProblem.body_potential", problem.body_potential),
        )
        if callable(field)
    )  # fmt: skip


def rest_on_arcs(discretization: Discretization, u: FloatArray) -> FloatArray:
    """Differences between σn and the traction polynomials of u (N,) at Gauss points of arcs (arcs, 12) [stress].

    Arcs of the boundary come first, then those inside the body, where the larger difference of both sides counts.
    """
    mesh, space, found = discretization.problem.mesh, discretization.space, [np.zeros((0, _POINTS))]
    coefficients = discretization.coefficients(u)
    for arcs in (edges.take(edges.bent) for edges in (mesh.boundary, mesh.interior) if edges.curved):
        points = EdgePoints(space, arcs, _POINTS)
        places = np.stack(mesh.points_along(arcs, points.reference), axis=-1)
        (nx, ny), (tx, ty) = points.normals.T, points.tangents.T
        (normal, shear), largest = points.tractions(u), np.zeros(len(arcs) * _POINTS)
        for cells in arcs.cells.T:
            if (cells >= 0).all():  # the cells on one side of the arcs
                xx, yy, xy = space.stress(coefficients, cells, mesh.reference(cells, places)).reshape(-1, 3).T
                x, y = xx * nx + xy * ny, xy * nx + yy * ny
                largest = np.maximum(largest, np.hypot(x * nx + y * ny - normal, x * tx + y * ty - shear))
        found.append(largest.reshape(-1, _POINTS))
    return discretization.scales.stress * np.concatenate(found)
