"""Prescribed displacements as values of degrees of freedom, in axes of their own where supports are slanted.

Component d·v of a coefficient is one degree of freedom if d is an axis. Where a support prescribes one component along
another direction the two degrees of freedom of the coefficient are d·v and d⊥·v instead, with d⊥ = (−d_y, d_x):

    v = Q w,   Q orthogonal and the identity elsewhere.

Two directions at a coefficient prescribe both components.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.companion.data import MISFIT, edge_data
from qvi_contact.companion.space import Space
from qvi_contact.discretization.scaling import Scales
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Displacement
from qvi_contact.problem.problem import ContactProblem

PARALLEL = 1e-8
"""Sine of the angle between two directions that is the rounding of coordinates."""


@dataclass(frozen=True, eq=False)
class Supports:
    """Prescribed displacements.

    Attributes
    ----------
    index, values : (f,) arrays
        Degrees of freedom w that are prescribed, ascending, and their values.
    axes : (size, size) sparse array
        Q.
    slanted : bool
        Whether Q is not the identity.
    reasons : tuple of str
        Why they do not meet the data exactly; nothing if they do.

    """

    index: IntArray
    values: FloatArray
    axes: sparse.csr_array
    slanted: bool
    reasons: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Given:
    """Conditions d·v = value at coefficients, one entry each: coefficient, d (m, 2) and value (m,)."""

    coefficient: IntArray
    direction: FloatArray
    value: FloatArray

    def take(self, chosen: BoolArray | IntArray) -> "_Given":
        return _Given(self.coefficient[chosen], self.direction[chosen], self.value[chosen])


def supports(problem: ContactProblem, space: Space, scales: Scales) -> Supports:
    """Prescribed displacements; where two disagree in a corner their mean."""
    given, reasons = _given(problem, space, scales)
    allowed = MISFIT * max(1.0, float(np.abs(given.value).max(initial=0.0)))
    slanted = np.isin(given.coefficient, given.coefficient[np.abs(given.direction).max(axis=1) < 1.0])
    index, values, wrong = _along_axes(given.take(~slanted), allowed)
    found, axes = [(index, values)], dict[int, FloatArray]()
    for coefficient in np.unique(given.coefficient[slanted]).tolist():
        here = given.take(given.coefficient == coefficient)
        frame, fixed = _at_one(here)
        axes[coefficient] = frame
        dofs = 2 * coefficient + np.arange(len(fixed))
        found.append((dofs, fixed))
        missed = here.direction @ frame[:, : len(fixed)] @ fixed - here.value
        if np.abs(missed).max() > allowed:
            wrong.append(coefficient)
    if wrong:
        x, y = problem.mesh.origin + scales.length * space.places[min(wrong)]
        reasons.append(f"Prescribed displacements disagree at ({x:.6g}, {y:.6g}). Their mean is used.")
    index, values = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(index)
    return Supports(index[order], values[order], _turned(space.size, axes), bool(axes), tuple(reasons))


def _given(problem: ContactProblem, space: Space, scales: Scales) -> tuple[_Given, list[str]]:
    """All conditions, in the order of the problem."""
    coefficients: list[IntArray] = [np.empty(0, dtype=np.int64)]
    directions, values, reasons = [np.empty((0, 2))], [np.empty(0)], list[str]()
    for given in problem.prescribed(Displacement):
        edges = problem.mesh.boundary.take(given.index)
        data = edge_data(problem, edges, given.name, given.value, space.degree, scales.displacement)
        size = max(1.0, float(np.abs(data.coefficients).max(initial=0.0)))
        if data.misfit > MISFIT * size:
            reasons.append(_interpolated(given.name, data.misfit * scales.displacement, space.degree))
        if edges.curved and given.turns:
            reasons.append(f"{given.name} holds at the coefficients of arcs only, whose directions turn.")
        numbers = space.along(edges)
        coefficients.append(numbers.ravel())
        places = np.linspace(0.0, 1.0, numbers.shape[1])
        directions.append(vectors_along(edges, given.direction, places, turns=given.turns).reshape(-1, 2))
        values.append(data.coefficients.ravel())
    return _Given(np.concatenate(coefficients), np.concatenate(directions), np.concatenate(values)), reasons


def _interpolated(name: str, misfit: float, degree: int) -> str:
    return (
        f"{name} is not a polynomial of degree {degree} on each edge. It is interpolated, with an error of up to "
        f"{misfit:.2g} [length]."
    )


def _along_axes(given: _Given, allowed: float) -> tuple[IntArray, FloatArray, list[int]]:
    """Degrees of freedom and values of conditions along the axes, and coefficients where they disagree."""
    index = 2 * given.coefficient + np.argmax(np.abs(given.direction), axis=1)
    values = given.direction.sum(axis=1) * given.value
    unique, inverse, count = np.unique(index, return_inverse=True, return_counts=True)
    mean = np.bincount(inverse, values, minlength=len(unique)) / count
    first = np.zeros(len(unique))
    first[inverse[::-1]] = values[::-1]
    spread = np.zeros(len(unique))
    np.maximum.at(spread, inverse, np.abs(values - first[inverse]))
    wrong = spread > allowed
    return unique, np.where(wrong, mean, first), (unique[wrong] // 2).tolist()


def _at_one(given: _Given) -> tuple[FloatArray, FloatArray]:
    """Axes (2, 2), as columns, of one coefficient, and the values of the first, or of both, that are prescribed."""
    if np.linalg.svd(given.direction, compute_uv=False)[-1] > PARALLEL and len(given.value) > 1:
        return np.eye(2), np.asarray(np.linalg.lstsq(given.direction, given.value, rcond=None)[0], dtype=np.float64)
    first = given.direction[0]
    along = np.sign(given.direction @ first) * given.value
    return np.column_stack([first, [-first[1], first[0]]]), np.array([along.mean()])


def _turned(size: int, axes: dict[int, FloatArray]) -> sparse.csr_array:
    """Q (size, size) from the axes of coefficients that have their own."""
    blocks = np.tile(np.eye(2), (size // 2, 1, 1))
    for coefficient, frame in axes.items():
        blocks[coefficient] = frame
    rows = np.arange(size).reshape(-1, 2, 1)
    rows, columns = np.broadcast_arrays(rows, rows.swapaxes(1, 2))
    Q = sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
    Q.eliminate_zeros()
    return Q
