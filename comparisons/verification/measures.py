"""Quantities that several chapters compare, and rows that compare the stress and the displacement model."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from comparisons.verification.rows import Check, Kind, Row, both, certified, certified_companion
from qvi_contact import Contact, ContactLine, ContactProblem, ContactResult, ContactState
from qvi_contact.basics.checks import FloatArray, IntArray, evaluate
from qvi_contact.companion import solve_companion
from qvi_contact.discretization.loads import EdgePoints
from qvi_contact.gallery import ExactState, compressed_plate
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import cross
from qvi_contact.solution.stress import traction
from qvi_contact.units import Units

MM: Final = Units(length="mm", stress="MPa")
FORCE, ENERGY = MM.force, MM.energy

Stress = Callable[[FloatArray, FloatArray], FloatArray]
"""σ_xx, σ_yy, σ_xy (…, 3) at points x, y (…)."""

_MEASURED: Final = 0.3  # an ellipse is fitted to pressures above this share of the peak
_POINTS: Final = 12  # Gauss points per edge, exact for tractions of triangles


def plate_under(contact: Contact, cells: int, grading: float = 1.0) -> ContactProblem:
    """The compressed plate with this contact on its top."""
    plate = compressed_plate(1.0, (cells, cells), grading=grading)
    rest = [condition for condition in plate.conditions if not isinstance(condition, Contact)]
    return replace(plate, conditions=[*rest, contact])


def scattered(result: ContactResult) -> tuple[FloatArray, FloatArray]:
    """60 points in the rectangle around the body, the same in every run."""
    vertices = result.problem.mesh.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    shares = np.random.default_rng(7).uniform(0.02, 0.98, size=(2, 60))
    x, y = low[:, None] + shares * (high - low)[:, None]
    return x, y


def stress_error(result: ContactResult, state: ExactState) -> float:
    """Largest |σ − exact| over the components at 60 points of a rectangle, over the largest |exact|."""
    x, y = scattered(result)
    exact = np.moveaxis(state.stress(x, y), 0, -1)
    return float(np.abs(result.stress(x, y) - exact).max() / np.abs(exact).max())


def stress_deviation(result: ContactResult, exact: Stress) -> float:
    """Relative error of σ in the mean square over the body."""
    known, mesh = result.discretization, result.problem.mesh
    space, cells = known.space, np.arange(mesh.cell_count)
    t, weights = space.cell_quadrature[0], space.cell_measures(*space.cell_quadrature)
    x, y = np.moveaxis(space.points(cells, t) * known.scales.length + mesh.origin, -1, 0)
    found = space.stress(known.coefficients(result.dofs), cells, t) * known.scales.stress
    wanted, twice = exact(x, y), weights[..., None] * np.array([1.0, 1.0, 2.0])
    return float(np.sqrt((twice * (found - wanted) ** 2).sum() / (twice * wanted**2).sum()))


def ellipse(x: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Height h and half-width a of v² = h² (1 − x²/a²), fitted where v is large."""
    large = values > _MEASURED * values.max()
    slope, square = np.polyfit(x[large] ** 2, values[large] ** 2, 1)
    return float(np.sqrt(square)), float(np.sqrt(-square / slope))


def value_at(line: ContactLine, values: FloatArray, x: float) -> float:
    """Value at x of a quantity on a horizontal contact, by the polynomial through the points of the nearest edge.

    The polynomial is extrapolated to the ends of the edge.
    """
    count = line.points_per_edge
    edge = int(np.argmin(np.abs(line.x.reshape(-1, count).mean(axis=1) - x)))
    points = slice(count * edge, count * edge + count)
    return float(np.polynomial.Polynomial.fit(line.x[points], values[points], count - 1)(x))


def runs(states: IntArray) -> str:
    """The states along a contact without repetitions, such as "open, slip, stick"."""
    first = np.r_[True, np.diff(states) != 0]
    return ", ".join(ContactState(state).name.lower() for state in states[first])


def point_states(line: ContactLine) -> IntArray:
    """States of the points in order along the contact, from its left end or, if it is vertical, from below."""
    return np.asarray(line.state[line.path.points(line.points_per_edge).ravel()])


def edge_states(line: ContactLine) -> IntArray:
    """State of each edge along the contact: that of most of its points; the first point's state if it is among these.

    Gap and slip are projections, so that points of an edge where a zone ends may be in either state.
    """
    points = point_states(line).reshape(-1, line.points_per_edge)
    counts = np.stack([(points == state).sum(axis=1) for state in ContactState], axis=1)
    first = points[:, 0]
    tied = counts[np.arange(len(points)), first] == counts.max(axis=1)
    return np.where(tied, first, counts.argmax(axis=1))


def zone_ends(line: ContactLine) -> FloatArray:
    """Arc lengths along the contact at which edges of different states meet [length]."""
    return np.asarray(line.path.starts[1 + np.flatnonzero(np.diff(edge_states(line)))])


def two_models(quick: bool, result: ContactResult, contact: str, tolerance: float, apart: float) -> Iterator[Row]:
    """The mean pressure against displacements on the same mesh, and energies from both sides; nothing in quick runs."""
    if quick:
        return
    companion, found = solve_companion(result.problem), result.bracket
    rows = Check(both(certified(result), certified_companion(companion)), kind=Kind.METHODS)
    ours, theirs = (
        float(line.normal_force / line.weights.sum())
        for line in (result.contacts[contact], companion.contacts[contact])
    )
    source = "displacement model on the same mesh"
    yield rows.relative("mean pressure, both models", ours, theirs, source, tolerance=tolerance)
    width, source = (found.upper - found.lower) / found.strain, f"bracket for {found.kind.value}"
    yield rows.at_most("gap of the energies over the strain energy", width, apart, source)
    if not found.reasons:
        name = "the same, upper not below lower"
        yield rows.at_least(name, width, 0.0, source, tolerance=1e-9, kind=Kind.ANALYTIC)


def left_by_stresses(result: ContactResult) -> float:
    """The largest unbalanced force or moment of a body, over the sum of the forces on its edges.

    Sums the tractions around each body and its weight: a body force −∇φ has the resultant −∮ φ n ds, and the moment
    of these forces.
    """
    discretization, problem, mesh = result.discretization, result.problem, result.problem.mesh
    bodies = Bodies.of(problem)
    first, second = bodies.of_cells[mesh.interior.cells].T
    between = mesh.interior.take(first != second)  # normals point out of the body on the first side
    total, size = np.zeros((bodies.blocks, 3)), np.zeros(bodies.blocks)
    for edges, side in ((mesh.boundary, 0), (between, 0), (between, 1)):
        if len(edges):
            owner, points = bodies.of_cells[edges.cells[:, side]], EdgePoints(discretization.space, edges, _POINTS)
            place = np.stack(mesh.points_along(edges, points.reference), axis=-1)
            weights = (-1.0 if side else 1.0) * discretization.scales.length * points.weights[:, None]
            force, normal = ((weights * each).reshape(place.shape)
                             for each in (traction(discretization, result.dofs, points).T, points.normals))  # fmt: skip
            potential = evaluate("body_potential", problem.body_potential, *np.moveaxis(place, -1, 0))
            arm = (place - bodies.centre[owner][:, None]) / bodies.size[owner][:, None, None]
            carried = force - potential[..., None] * normal
            np.add.at(total, owner, np.column_stack([carried.sum(axis=1), cross(arm, carried).sum(axis=1)]))
            np.add.at(size, owner, np.hypot(*force.sum(axis=1).T))
    loaded = size > 0.0
    return float((np.abs(total).max(axis=1)[loaded] / size[loaded]).max(initial=0.0))
