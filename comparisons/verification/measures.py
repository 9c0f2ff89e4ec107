"""Quantities that several chapters compare."""

from collections.abc import Callable
from typing import Final

import numpy as np

from qvi_contact import ContactLine, ContactResult, ContactState, TriangleMesh
from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.bracket.parts import CellFields
from qvi_contact.companion import CompanionContact
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.exact import ExactState
from qvi_contact.solution.stress import cell_stresses
from qvi_contact.units import Units

_ENGINEERING: Final = Units(length="mm", stress="MPa")
FORCE: Final = _ENGINEERING.engineering_force
ENERGY: Final = _ENGINEERING.engineering_energy

Stress = Callable[[FloatArray, FloatArray], FloatArray]
"""σ_xx, σ_yy, σ_xy (…, 3) at points x, y (…)."""

_POINTS = 60
_MEASURED: Final = 0.3  # part of the peak above which pressures are compared with an ellipse


def stress_error(result: ContactResult, state: ExactState) -> float:
    """Largest |σ − exact| over the components at 60 points of a rectangle, over the largest |exact|."""
    x, y = scattered(result)
    exact = np.moveaxis(state.stress(x, y), 0, -1)
    return float(np.abs(result.stress(x, y) - exact).max() / np.abs(exact).max())


def stress_deviation(result: ContactResult, exact: Stress) -> float:
    """Error of σ in the mean square over the body, relative."""
    known, mesh = result.discretization, result.problem.mesh
    space, cells = known.space, np.arange(mesh.cell_count)
    t, weights = space.cell_points, space.cell_measures(space.cell_points, space.cell_weights)
    x, y = np.moveaxis(space.points(cells, t) * known.scales.length + mesh.origin, -1, 0)
    found = space.stress(known.coefficients(result.dofs), cells, t) * known.scales.stress
    wanted, twice = exact(x, y), weights[..., None] * np.array([1.0, 1.0, 2.0])
    return float(np.sqrt((twice * (found - wanted) ** 2).sum() / (twice * wanted**2).sum()))


def energy_apart(one: ContactResult, other: ContactResult) -> float:
    """|σ − τ| in the energy norm, of stresses of any degrees on one mesh [√energy]."""
    fine, coarse = sorted((one, other), key=lambda result: -result.discretization.space.degree)
    fields = CellFields.of(fine.discretization, fine.dofs, 1)
    stress = cell_stresses(coarse.discretization, coarse.dofs, fields.t)[1] * coarse.discretization.scales.stress
    apart, c = fields.stress - stress, fine.problem.compliances
    return float(np.sqrt(np.einsum("cg,cgk,ckl,cgl->", fields.weights, apart, c, apart)))


def halved(mesh: TriangleMesh) -> TriangleMesh:
    """Every triangle cut into four."""
    for _ in range(2):
        mesh = mesh.refined(np.ones(mesh.cell_count, dtype=bool))
    return mesh


def scattered(result: ContactResult, count: int = _POINTS) -> tuple[FloatArray, FloatArray]:
    """Points of the rectangle around the body, the same in every run."""
    vertices = result.problem.mesh.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    shares = np.random.default_rng(7).uniform(0.02, 0.98, size=(2, count))
    x, y = low[:, None] + shares * (high - low)[:, None]
    return x, y


def traction_difference(ours: ContactLine, theirs: ContactLine, unit: float) -> float:
    """Largest difference of σ_N or σ_T at the points of a contact, in this unit [stress]."""
    pairs = ((ours.normal_stress, theirs.normal_stress), (ours.tangential_stress, theirs.tangential_stress))
    return max(float(np.abs(one - other).max()) for one, other in pairs) / unit


def angles(line: ContactLine | CompanionContact) -> FloatArray:
    """Directions of the points from the origin [rad]."""
    return np.asarray(np.arctan2(line.y, line.x))


def degrees(line: ContactLine | CompanionContact) -> FloatArray:
    """The same [°]."""
    return np.asarray(np.rad2deg(angles(line)))


def mean_pressure(line: ContactLine | CompanionContact) -> float:
    """Normal force over length [stress]."""
    return float(line.normal_force / line.weights.sum())


def ellipse(x: FloatArray, values: FloatArray) -> tuple[float, float]:
    """Height h and half-width a of v² = h² (1 − x²/a²), fitted where v is large."""
    large = values > _MEASURED * values.max()
    slope, square = np.polyfit(x[large] ** 2, values[large] ** 2, 1)
    return float(np.sqrt(square)), float(np.sqrt(-square / slope))


def value_at(line: ContactLine, values: FloatArray, x: float) -> float:
    """Value at x of a quantity on a horizontal contact, by the polynomial through the points of an edge.

    The edge whose middle is nearest counts; its polynomial is carried on to its ends.
    """
    count = line.points_per_edge
    middles = line.x.reshape(-1, count).mean(axis=1)
    edge = int(np.argmin(np.abs(middles - x)))
    points = slice(count * edge, count * edge + count)
    return float(np.polynomial.Polynomial.fit(line.x[points], values[points], count - 1)(x))


def runs(states: IntArray) -> str:
    """States in the order they follow each other, such as "open, slip, stick"."""
    first = np.r_[True, np.diff(states) != 0]
    return ", ".join(ContactState(state).name.lower() for state in states[first])


def point_states(line: ContactLine) -> IntArray:
    """States of the points in order along the contact, from its left end or, if it is vertical, from below."""
    return np.asarray(line.state[line.path.points(line.points_per_edge).ravel()])


def edge_states(line: ContactLine) -> IntArray:
    """State of each edge along the contact: that of most of its points, in a tie that of the first of them.

    Gap and slip are projections, so that points of the edge where a zone ends may be in either state.
    """
    points = point_states(line).reshape(-1, line.points_per_edge)
    counts = np.stack([(points == state).sum(axis=1) for state in ContactState], axis=1)
    first = points[:, 0]
    tied = counts[np.arange(len(points)), first] == counts.max(axis=1)
    return np.where(tied, first, counts.argmax(axis=1))


def zone_ends(line: ContactLine) -> FloatArray:
    """Lengths along the contact at which edges of different states meet [length]."""
    return np.asarray(line.path.starts[1 + np.flatnonzero(np.diff(edge_states(line)))])


def between_points(values: FloatArray, points: int, count: int = 1000) -> FloatArray:
    """Values at places on every edge, ends included, of a polynomial given at its Gauss points, (edges, count).

    `values` has the shape (points edges,); the polynomial goes through those of an edge.
    """
    gauss = gauss_legendre(points)[0]
    t = np.linspace(0.0, 1.0, count)
    coefficients = np.polynomial.polynomial.polyfit(gauss, values.reshape(-1, points).T, points - 1)
    return np.asarray(np.polynomial.polynomial.polyval(t, coefficients))
