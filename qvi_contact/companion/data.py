"""Loads and functions on edges, as the displacement model takes them; dimensionless."""

from dataclasses import dataclass

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.companion.elasticity import Elasticity
from qvi_contact.companion.space import Space
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.problem.conditions import Traction
from qvi_contact.problem.integrals import along_edges
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
        Bernstein coefficients along the tangent; the polynomial meets the function at both ends of each edge.
    misfit : float
        Largest difference found between the two, at `bernstein.SAMPLES`.

    """

    coefficients: FloatArray
    misfit: float


def edge_data(problem: ContactProblem, edges: Edges, name: str, field: Field, degree: int, unit: float) -> EdgeData:
    """A field on edges, divided by its unit."""
    t = bernstein.nodes(degree)
    values = evaluate(name, field, *problem.mesh.points_along(edges, t)) / unit
    coefficients = values @ bernstein.from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    if not callable(field):
        return EdgeData(np.broadcast_to(values[:, :1], coefficients.shape).copy(), 0.0)
    t = bernstein.SAMPLES
    wanted = evaluate(name, field, *problem.mesh.points_along(edges, t)) / unit
    misfit = np.abs(coefficients @ bernstein.basis(degree, t).T - wanted)
    return EdgeData(coefficients, float(misfit.max(initial=0.0)))


def along_arcs(arcs: Edges, vectors: FloatArray, degree: int) -> FloatArray:
    """Inner coefficients of d·v along arcs from all coefficients of v, (n, p − 1, p + 1, 2), for d (n, 2) that turns.

    They are those of the polynomial that is d(t)·v(t) at p + 1 nodes, both ends among them.
    """
    nodes = bernstein.nodes(degree)
    project, values = bernstein.from_values(degree)[1:-1], bernstein.basis(degree, nodes)
    return np.asarray(np.einsum("ki,eia,ij->ekja", project, vectors_along(arcs, vectors, nodes), values))


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
        return (f"{what} is not a polynomial on each edge. The integrated values differ by up to {size:.2g} [stress].",)


def edge_moments(
    problem: ContactProblem,
    edges: Edges,
    name: str,
    field: Field,
    degree: int,
    unit: float,
    *,
    minimum: float | None = None,
) -> EdgeMoments:
    """∫ f B_i dt of a field on edges, divided by its unit; exact for polynomials up to degree 2 `load_points`."""

    def at(t: FloatArray) -> FloatArray:
        return evaluate(name, field, *problem.mesh.points_along(edges, t), minimum=minimum) / unit

    first, second = load_points(degree), 2 * load_points(degree) + 1
    (t, w), (fine_t, fine_w) = gauss_legendre(first), gauss_legendre(second)
    fine = at(fine_t)
    values = fine @ (bernstein.basis(degree, fine_t) * fine_w[:, None])
    if not callable(field):
        return EdgeMoments(values, 0.0)
    coarse = at(t) @ (bernstein.basis(degree, t) * w[:, None])
    unseen = at(bernstein.SAMPLES) - fine @ bernstein.to_samples(second)
    return EdgeMoments(values, max(float(np.abs(part).max(initial=0.0)) for part in (coarse - values, unseen)))


def load_vector(problem: ContactProblem, body: Elasticity, scales: Scales) -> tuple[FloatArray, tuple[str, ...]]:
    """∫ b·v + ∫_{Γσ} T·v as a vector (size,), and what is wrong with it.

    That is a difference of the body force's from a finer quadrature, or what is left of tractions that no quadrature
    can follow. Of a body potential only the points of the two quadratures are seen, 541 or more a cell.
    """
    tractions, remarks = _traction_load(problem, body.space, scales)
    first, second = (
        tractions + _body_load(problem, body, scales, count)
        for count in (load_points(body.space.degree), 2 * load_points(body.space.degree) + 1)
    )
    error = float(np.abs(first - second).max(initial=0.0))
    if error <= _QUADRATURE * max(float(np.abs(second).max(initial=0.0)), _QUADRATURE):
        return first, remarks
    force = error * scales.stress * scales.length
    changed = f"Loads are not polynomials on each edge or cell. Quadrature changes them by {force:.1e} [force]."
    return second, (changed, *remarks)


def _traction_load(problem: ContactProblem, space: Space, scales: Scales) -> tuple[FloatArray, tuple[str, ...]]:
    """∫_{Γσ} T·v ds as a vector (size,), and which tractions no quadrature follows."""
    load, remarks = np.zeros(space.size), list[str]()
    for given in problem.prescribed(Traction):
        edges = given.edges
        found = along_edges(problem.mesh, edges, given.name, given.value, load_points(space.degree))
        shapes = bernstein.basis(space.degree, found.t.ravel()).reshape(*found.t.shape, -1)
        lengths = edges.length / scales.length
        if edges.curved and given.turns:
            along = vectors_along(edges.take(found.edge), given.direction[found.edge], found.t)
            for component in (0, 1):
                work = lengths[:, None] * found.integrals(shapes * along[..., [component]]) / scales.stress
                np.add.at(load, 2 * space.along(edges) + component, work)
        else:
            _add(load, space.along(edges), lengths[:, None] * found.integrals(shapes) / scales.stress, given.direction)
        if found.error > MISFIT * float(np.abs(found.values).max(initial=0.0)):
            size = f"{found.error:.2g} [stress]"
            remarks.append(
                f"{given.name} jumps or grows steeply. Quadrature leaves an error of {size} times an edge's length."
            )
    return load, tuple(dict.fromkeys(remarks))


def _add(load: FloatArray, numbers: IntArray, work: FloatArray, direction: FloatArray) -> None:
    """Add the work (e, p + 1) against coefficients along one direction for each edge (e, 2)."""
    for component in (0, 1):
        np.add.at(load, 2 * numbers + component, direction[:, [component]] * work)


def _body_load(problem: ContactProblem, body: Elasticity, scales: Scales, count: int) -> FloatArray:
    """∫ b·v dx with b = −∇φ, as ∫ φ div v dx − ∮ φ v·n ds over every block: no derivative of φ is needed.

    φ counts from its value at one point: a constant does no work.
    """
    space, mesh, field = body.space, problem.mesh, problem.body_potential
    if not callable(field):
        return np.zeros(space.size)
    name = "ContactProblem.body_potential"
    t, w = space.cell.quadrature(count)
    places = mesh.origin + scales.length * space.points(slice(None), t)
    base = float(evaluate(name, field, *(mesh.origin + scales.length * space.origins[:1]).T)[0])
    potential = (evaluate(name, field, places[..., 0], places[..., 1]) - base) / scales.stress
    weighted = potential * space.measures(t, w)
    load = body.virtual_work(np.stack([weighted, weighted, 0.0 * weighted], axis=-1), t)
    t, w = gauss_legendre(count)
    shape = bernstein.basis(space.degree, t) * w[:, None]
    for edges, numbers, outward in _outlines(problem, space):
        values = (evaluate(name, field, *mesh.points_along(edges, t)) - base) / scales.stress
        lengths = edges.length / scales.length
        if edges.curved:
            along = vectors_along(edges, outward, t)
            for component in (0, 1):
                work = -lengths[:, None] * ((values * along[..., component]) @ shape)
                np.add.at(load, 2 * numbers + component, work)
        else:
            _add(load, numbers, -lengths[:, None] * (values @ shape), outward)
    return load


def _outlines(problem: ContactProblem, space: Space) -> list[tuple[Edges, IntArray, FloatArray]]:
    """The blocks' outlines: (edges, their coefficients, outward normals)."""
    mesh = problem.mesh
    found = [(mesh.boundary, space.along(mesh.boundary), mesh.boundary.normal)]
    for joint in problem.joints:
        edges = mesh.edges(joint.edges)
        found.append((edges, space.along(edges), edges.normal))
        found.append((edges, space.along(edges, other=True), -edges.normal))
    return found
