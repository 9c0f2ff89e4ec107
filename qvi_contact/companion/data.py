"""Loads, prescribed displacements and functions on edges, as the displacement model takes them; dimensionless."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.companion.elasticity import Elasticity
from qvi_contact.companion.space import Space
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.mesh.rectilinear import HORIZONTAL, GridEdges
from qvi_contact.problem.conditions import Displacement, Traction
from qvi_contact.problem.problem import ContactProblem

LOAD_POINTS = 10
"""Gauss points an edge and direction for data given as functions, at least; see `load_points`."""

MISFIT = 1e-10
"""Difference between data and their polynomial on an edge, relative to the data's unit, that counts as rounding."""

_QUADRATURE = 1e-11  # relative difference of two quadratures that counts as rounding


def load_points(degree: int) -> int:
    """Gauss points for work done by data: exact for data up to degree 19 − p."""
    return max(LOAD_POINTS, degree + 6)


@dataclass(frozen=True, eq=False)
class EdgeData:
    """A function on edges as polynomials of degree p.

    Attributes
    ----------
    coefficients : (e, p + 1) array
        Bernstein coefficients along +x or +y; the polynomial meets the function at both ends of each edge.
    misfit : float
        Largest difference found between the two, at `bernstein.SAMPLES`.

    """

    coefficients: FloatArray
    misfit: float


def edge_data(problem: ContactProblem, edges: GridEdges, name: str, field: Field, degree: int, unit: float) -> EdgeData:
    """A field on edges, divided by its unit."""
    t = bernstein.nodes(degree)
    values = evaluate(name, field, *problem.grid.points_along(edges, t)) / unit
    coefficients = values @ bernstein.from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    if not callable(field):
        return EdgeData(np.broadcast_to(values[:, :1], coefficients.shape).copy(), 0.0)
    t = bernstein.SAMPLES
    wanted = evaluate(name, field, *problem.grid.points_along(edges, t)) / unit
    misfit = np.abs(coefficients @ bernstein.basis(degree, t).T - wanted)
    return EdgeData(coefficients, float(misfit.max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class EdgeMoments:
    """A function on edges as its work against B_i.

    Attributes
    ----------
    values : (e, p + 1) array
        ∫₀¹ f B_i dt, by the finer of two Gauss rules.
    misfit : float
        Largest difference found between f and the polynomial that the finer rule integrates, at `bernstein.SAMPLES`,
        or between the integrals of the two rules. Nothing is known of f between all these points.

    """

    values: FloatArray
    misfit: float

    def reason(self, what: str, scales: Scales) -> tuple[str, ...]:
        """Why the integrals of a stress are not exact, as far as can be seen; nothing if they are."""
        if self.misfit <= MISFIT * max(1.0, float(np.abs(self.values).max(initial=0.0))):
            return ()
        size = self.misfit * scales.stress
        return (f"{what} is no polynomial on each edge: what is integrated differs by up to {size:.2g} [stress].",)


def edge_moments(
    problem: ContactProblem,
    edges: GridEdges,
    name: str,
    field: Field,
    degree: int,
    unit: float,
    *,
    minimum: float | None = None,
) -> EdgeMoments:
    """∫ f B_i dt of a field on edges, divided by its unit; exact for polynomials up to degree 2 `load_points`."""

    def at(t: FloatArray) -> FloatArray:
        return evaluate(name, field, *problem.grid.points_along(edges, t), minimum=minimum) / unit

    first, second = load_points(degree), 2 * load_points(degree) + 1
    (t, w), (fine_t, fine_w) = gauss_legendre(first), gauss_legendre(second)
    fine = at(fine_t)
    values = fine @ (bernstein.basis(degree, fine_t) * fine_w[:, None])
    if not callable(field):
        return EdgeMoments(values, 0.0)
    coarse = at(t) @ (bernstein.basis(degree, t) * w[:, None])
    unseen = at(bernstein.SAMPLES) - fine @ bernstein.gauss_interpolation(second, bernstein.SAMPLES)
    return EdgeMoments(values, max(float(np.abs(part).max(initial=0.0)) for part in (coarse - values, unseen)))


def load_vector(problem: ContactProblem, body: Elasticity, scales: Scales) -> tuple[FloatArray, tuple[str, ...]]:
    """∫ b·v + ∫_{Γσ} T·v as a vector (size,), and what is wrong with it.

    That is a difference from a finer quadrature, or one between tractions and what it integrates, at
    `bernstein.SAMPLES` of every edge. Of a body potential only the points of the two quadratures are seen, 541 or more
    a cell.
    """
    remarks = _traction_reasons(problem, body.space.degree, scales)
    first, second = (
        _traction_load(problem, body.space, scales, count) + _body_load(problem, body, scales, count)
        for count in (load_points(body.space.degree), 2 * load_points(body.space.degree) + 1)
    )
    error = float(np.abs(first - second).max(initial=0.0))
    if error <= _QUADRATURE * max(float(np.abs(second).max(initial=0.0)), _QUADRATURE):
        return first, remarks
    force = error * scales.stress * scales.length
    changed = f"Loads are no polynomials on each edge or cell: quadrature changes them by {force:.1e} [force]."
    return second, (changed, *remarks)


def _traction_reasons(problem: ContactProblem, degree: int, scales: Scales) -> tuple[str, ...]:
    """Which tractions are no polynomials that quadrature integrates exactly."""
    found: list[str] = []
    for component, index, field in problem.by_component(Traction):
        if callable(field):
            name = f"Traction.{'xy'[component]}"
            moments = edge_moments(problem, problem.grid.boundary.take(index), name, field, degree, scales.stress)
            found += moments.reason(name, scales)
    return tuple(dict.fromkeys(found))


def _traction_load(problem: ContactProblem, space: Space, scales: Scales, count: int) -> FloatArray:
    """∫_{Γσ} T·v ds as a vector (size,)."""
    load = np.zeros(space.size)
    t, w = gauss_legendre(count)
    shape = bernstein.basis(space.degree, t) * w[:, None]
    for component, index, field in problem.by_component(Traction):
        edges = problem.grid.boundary.take(index)
        name = f"Traction.{'xy'[component]}"
        values = evaluate(name, field, *problem.grid.points_along(edges, t)) / scales.stress
        lengths = edges.length / scales.length
        np.add.at(load, 2 * space.along(edges) + component, lengths[:, None] * (values @ shape))
    return load


def _body_load(problem: ContactProblem, body: Elasticity, scales: Scales, count: int) -> FloatArray:
    """∫ b·v dx with b = −∇φ, as ∫ φ div v dx − ∮ φ v·n ds over every block: no derivative of φ is needed.

    φ counts from its value at one point: a constant does no work.
    """
    space, mesh, field = body.space, problem.grid, problem.body_potential
    if not callable(field):
        return np.zeros(space.size)
    name = "ContactProblem.body_potential"
    t, w = gauss_legendre(count)
    tx, ty = np.tile(t, count), np.repeat(t, count)
    origin = np.array([mesh.x[0], mesh.y[0]])
    low, size = origin + scales.length * space.corners, scales.length * space.sizes
    base = float(evaluate(name, field, low[:1, 0], low[:1, 1])[0])
    x, y = low[:, :1] + size[:, :1] * tx, low[:, 1:] + size[:, 1:] * ty
    potential = (evaluate(name, field, x, y) - base) / scales.stress
    weighted = potential * space.sizes.prod(axis=1)[:, None] * np.outer(w, w).ravel()
    load = body.virtual_work(np.stack([weighted, weighted, 0.0 * weighted], axis=-1), tx, ty)
    shape = bernstein.basis(space.degree, t) * w[:, None]
    for edges, numbers, sign in _outlines(problem, space):
        values = (evaluate(name, field, *mesh.points_along(edges, t)) - base) / scales.stress
        lengths = edges.length / scales.length
        component = np.where(edges.axis == HORIZONTAL, 1, 0)
        work = (sign * lengths)[:, None] * (values @ shape)
        np.add.at(load, 2 * numbers + component[:, None], -work)
    return load


def _outlines(problem: ContactProblem, space: Space) -> list[tuple[GridEdges, IntArray, FloatArray]]:
    """The blocks' outlines: (edges, their coefficients, sign of the outward normal)."""
    mesh = problem.grid
    found = [(mesh.boundary, space.along(mesh.boundary), mesh.boundary.sign)]
    for joint in problem.joints:
        edges = mesh.edges(joint.edges)
        found.append((edges, space.along(edges), edges.sign))
        found.append((edges, space.along(edges, other=True), -edges.sign))
    return found


@dataclass(frozen=True, eq=False)
class Supports:
    """Prescribed displacements.

    Attributes
    ----------
    index, values : (f,) arrays
        Degrees of freedom that are prescribed, ascending, and their values.
    reasons : tuple of str
        Why they do not meet the data exactly; nothing if they do.

    """

    index: IntArray
    values: FloatArray
    reasons: tuple[str, ...]


def supports(problem: ContactProblem, space: Space, scales: Scales) -> Supports:
    """Prescribed displacements as values of degrees of freedom; where two disagree in a corner their mean."""
    index: list[IntArray] = [np.empty(0, dtype=np.int64)]
    values: list[FloatArray] = [np.empty(0)]
    reasons: list[str] = []
    for component, chosen, field in problem.by_component(Displacement):
        edges = problem.grid.boundary.take(chosen)
        name = f"Displacement.{'xy'[component]}"
        data = edge_data(problem, edges, name, field, space.degree, scales.displacement)
        size = max(1.0, float(np.abs(data.coefficients).max(initial=0.0)))
        if data.misfit > MISFIT * size:
            reasons.append(_interpolated(name, data.misfit * scales.displacement, space.degree))
        index.append((2 * space.along(edges) + component).ravel())
        values.append(data.coefficients.ravel())
    return _merged(np.concatenate(index), np.concatenate(values), reasons, space, problem, scales)


def _interpolated(name: str, misfit: float, degree: int) -> str:
    return (
        f"{name} is no polynomial of degree {degree} on each edge: it is interpolated, and differs by up to "
        f"{misfit:.2g} [length]."
    )


def _merged(
    index: IntArray, values: FloatArray, reasons: Sequence[str], space: Space, problem: ContactProblem, scales: Scales
) -> Supports:
    unique, inverse, count = np.unique(index, return_inverse=True, return_counts=True)
    mean = np.bincount(inverse, values, minlength=len(unique)) / count
    first = np.zeros(len(unique))
    first[inverse[::-1]] = values[::-1]
    spread = np.zeros(len(unique))
    np.maximum.at(spread, inverse, np.abs(values - first[inverse]))
    wrong = spread > MISFIT * max(1.0, float(np.abs(values).max(initial=0.0)))
    found = list(reasons)
    if wrong.any():
        x, y = np.array([problem.grid.x[0], problem.grid.y[0]]) + scales.length * space.places[unique[wrong][0] // 2]
        found.append(f"Prescribed displacements disagree at ({x:.6g}, {y:.6g}): their mean is taken.")
    return Supports(unique, np.where(wrong, mean, first), tuple(found))
