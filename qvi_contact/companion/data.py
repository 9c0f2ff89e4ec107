"""Functions on edges as polynomials, and prescribed displacements as values of degrees of freedom; dimensionless.

Component d·v of a coefficient is one degree of freedom if d is an axis. Where a support prescribes one component along
another direction the two degrees of freedom of the coefficient are d·v and d⊥·v instead, with d⊥ = (−d_y, d_x):

    v = Q w,   Q orthogonal and the identity elsewhere.

Two directions at a coefficient prescribe both components. Along arcs, whose directions turn, coefficients inside are
those of the polynomials n·v and t·v instead (see `along_arcs`): w = R v for all of them, and Q = R⁻¹ edge by edge.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.companion.space import DisplacementSpace
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mesh.edges import Edges, vectors_along
from qvi_contact.problem.conditions import Displacement
from qvi_contact.problem.problem import ContactProblem

LOAD_POINTS = 10
"""Gauss points an edge and direction for data given as functions, at least; see `load_points`."""

MISFIT = 1e-10
"""Difference between data and their polynomial on an edge, relative to the data's unit, that counts as rounding."""


PARALLEL = 1e-8
"""Sine of the angle between two directions that is the rounding of coordinates."""


def load_points(degree: int) -> int:
    """Gauss points for work done by data: exact for data up to degree 19 − p."""
    return max(LOAD_POINTS, degree + 6)


def edge_data(
    problem: ContactProblem, edges: Edges, name: str, field: Field, degree: int, unit: float
) -> tuple[FloatArray, float]:
    """A field on edges over its unit as polynomials: Bernstein coefficients (e, degree + 1), and the most they miss.

    The polynomial meets the function at both ends of each edge; what it misses is seen at `bernstein.SAMPLES`.
    """
    t = bernstein.nodes(degree)
    values = evaluate(name, field, *problem.mesh.points_along(edges, t)) / unit
    coefficients = values @ bernstein.from_values(degree).T
    coefficients[:, [0, -1]] = values[:, [0, -1]]
    if not callable(field):
        return np.broadcast_to(values[:, :1], coefficients.shape).copy(), 0.0
    t = bernstein.SAMPLES
    wanted = evaluate(name, field, *problem.mesh.points_along(edges, t)) / unit
    misfit = np.abs(coefficients @ bernstein.basis(degree, t).T - wanted)
    return coefficients, float(misfit.max(initial=0.0))


def along_arcs(arcs: Edges, vectors: FloatArray, degree: int) -> FloatArray:
    """Inner coefficients of d·v along arcs from all coefficients of v, (n, p − 1, p + 1, 2), for d (n, 2) that turns.

    They are those of the polynomial that is d(t)·v(t) at p + 1 nodes, both ends among them.
    """
    nodes = bernstein.nodes(degree)
    project, values = bernstein.from_values(degree)[1:-1], bernstein.basis(degree, nodes)
    return np.asarray(np.einsum("ki,eia,ij->ekja", project, vectors_along(arcs, vectors, nodes), values))


def edge_moments(
    problem: ContactProblem, edges: Edges, name: str, field: Field, degree: int, unit: float
) -> tuple[FloatArray, float]:
    """∫₀¹ f B_i dt (e, degree + 1) of a field f ≥ 0 over its unit, by the finer of two Gauss rules, and its misfit.

    That is the largest difference found at `bernstein.SAMPLES` between f and the polynomial that the finer rule
    integrates, or between both rules. Polynomials are exact up to degree 2 `load_points`; between these points nothing
    is known of f.
    """

    def at(t: FloatArray) -> FloatArray:
        return evaluate(name, field, *problem.mesh.points_along(edges, t), minimum=0.0) / unit

    first, second = load_points(degree), 2 * load_points(degree) + 1
    (t, w), (fine_t, fine_w) = gauss_legendre(first), gauss_legendre(second)
    fine = at(fine_t)
    values = fine @ (bernstein.basis(degree, fine_t) * fine_w[:, None])
    if not callable(field):
        return values, 0.0
    coarse = at(t) @ (bernstein.basis(degree, t) * w[:, None])
    unseen = at(bernstein.SAMPLES) - fine @ bernstein.to_samples(second)
    return values, max(float(np.abs(part).max(initial=0.0)) for part in (coarse - values, unseen))


@dataclass(frozen=True, eq=False)
class Supports:
    """Prescribed displacements."""

    index: IntArray  # index, values, (f,) each: degrees of freedom w that are prescribed, ascending, and their values
    values: FloatArray
    axes: sparse.csr_array  # axes, inverse, (size, size) each: Q and R = Q⁻¹
    inverse: sparse.csr_array
    slanted: bool  # whether Q is not the identity
    reasons: tuple[str, ...]  # why they do not meet the data exactly; nothing if they do

    def with_springs(self, count: int) -> "Supports":
        """The same, with as many degrees of freedom more that nothing prescribes."""
        axes, inverse = (sparse.block_diag([Q, sparse.eye_array(count)], "csr") for Q in (self.axes, self.inverse))
        return replace(self, axes=sparse.csr_array(axes), inverse=sparse.csr_array(inverse))


@dataclass(frozen=True, eq=False)
class _Given:
    """Conditions d·v = value at coefficients, one entry each: coefficient, d (m, 2) and value (m,)."""

    coefficient: IntArray
    direction: FloatArray
    value: FloatArray

    def take(self, chosen: BoolArray | IntArray) -> "_Given":
        return _Given(self.coefficient[chosen], self.direction[chosen], self.value[chosen])


@dataclass(frozen=True, eq=False)
class _OnArcs:
    """Conditions on arcs along normals or tangents (n, 2): coefficients of the body and of the data, (n, p + 1)."""

    edges: Edges
    numbers: IntArray
    direction: FloatArray
    data: FloatArray

    @property
    def _alike(self) -> FloatArray:
        """By which factor the direction is the normal, and the tangent: ±1 and 0, shape (n, 2)."""
        axes = np.stack([self.edges.normal, self.edges.tangent], axis=1)
        return np.rint((axes @ self.direction[:, :, None])[:, :, 0])

    @property
    def index(self) -> IntArray:
        """Degrees of freedom w: n·v of a coefficient, then t·v; shape (n (p − 1),)."""
        return np.ravel(2 * self.numbers[:, 1:-1] + np.argmax(np.abs(self._alike), axis=1)[:, None])

    @property
    def values(self) -> FloatArray:
        """Their values."""
        return np.ravel(self.data[:, 1:-1] * self._alike.sum(axis=1)[:, None])


def supports(problem: ContactProblem, space: DisplacementSpace, scales: Scales) -> Supports:
    """Prescribed displacements; where two disagree in a corner their mean."""
    given, arcs, reasons = _given(problem, space, scales)
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
    found += [(arc.index, arc.values) for arc in arcs]
    index, values = (np.concatenate(part) for part in zip(*found, strict=True))
    order = np.argsort(index)
    Q = _turned(space.size, axes)
    Q, R = _along_arcs(Q, arcs, space.degree)
    return Supports(index[order], values[order], Q, R, bool(axes or arcs), tuple(reasons))


def _given(
    problem: ContactProblem, space: DisplacementSpace, scales: Scales
) -> tuple[_Given, list[_OnArcs], list[str]]:
    """All conditions, in the order of the problem: those at coefficients, and those inside arcs along their frames."""
    arcs: list[_OnArcs] = []
    coefficients: list[IntArray] = [np.empty(0, dtype=np.int64)]
    directions, values, reasons = [np.empty((0, 2))], [np.empty(0)], list[str]()
    for given in problem.prescribed(Displacement):
        edges = given.edges
        data, misfit = edge_data(problem, edges, given.name, given.value, space.degree, scales.displacement)
        if misfit > MISFIT * max(1.0, float(np.abs(data).max(initial=0.0))):
            reasons.append(
                f"{given.name} is not a polynomial of degree {space.degree} on each edge. It is interpolated, with an "
                f"error of up to {misfit * scales.displacement:.2g} [length]."
            )
        numbers = space.along(edges)
        turning = edges.bent & given.turns
        if turning.any():
            reasons.append(
                f"{given.name} holds on arcs as closely as polynomials of degree {space.degree} follow its directions."
            )
            arcs.append(_OnArcs(edges.take(turning), numbers[turning], given.direction[turning], data[turning]))
        places = np.linspace(0.0, 1.0, numbers.shape[1])
        here = ~turning[:, None] | (places == 0.0) | (places == 1.0)
        coefficients.append(numbers[here])
        directions.append(vectors_along(edges, given.direction, places, turns=given.turns)[here])
        values.append(data[here])
    return _Given(np.concatenate(coefficients), np.concatenate(directions), np.concatenate(values)), arcs, reasons


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


def _along_arcs(Q: sparse.csr_array, arcs: list[_OnArcs], degree: int) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Q and Q⁻¹ with the coefficients inside arcs along their frames, from Q of all others.

    An arc with two conditions is listed twice, with the same rows. With v and w inside (i) and at both ends (e),
    w_i = A v_i + B v_e, so that v_i = A⁻¹ w_i − A⁻¹ B Q_e w.
    """
    if not arcs:
        return Q, sparse.csr_array(Q.T)
    inside, at_ends, A, B = _blocks(arcs, degree)
    size = Q.shape[0]
    keep = np.ones(size)
    keep[inside] = 0.0
    others = sparse.diags_array(keep)
    inverse = np.asarray(np.linalg.inv(A), dtype=np.float64)
    own, beside = spread(inside, inside, inverse, size), spread(inside, at_ends, inverse @ B, size)
    rows = spread(inside, inside, A, size) + spread(inside, at_ends, B, size)
    whole = others @ Q @ others
    return sparse.csr_array(whole + own - beside @ whole), sparse.csr_array(whole.T + rows)


def _blocks(arcs: list[_OnArcs], degree: int) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Degrees of freedom inside arcs (n, 2p − 2) and at their ends (n, 4), A and B; each arc once."""
    inner = 2 * (degree - 1)
    dofs = np.concatenate([2 * arc.numbers[:, :, None] + np.arange(2) for arc in arcs])
    rows = np.concatenate(
        [
            np.stack([along_arcs(arc.edges, d, degree) for d in (arc.edges.normal, arc.edges.tangent)], axis=2)
            for arc in arcs
        ]
    )
    once = np.unique(dofs[:, 1, 0], return_index=True)[1]
    dofs, rows = dofs[once], rows[once].reshape(len(once), inner, degree + 1, 2)
    inside, at_ends = dofs[:, 1:-1].reshape(len(once), -1), dofs[:, [0, -1]].reshape(len(once), -1)
    A, B = rows[:, :, 1:-1].reshape(len(once), inner, -1), rows[:, :, [0, -1]].reshape(len(once), inner, -1)
    return inside, at_ends, A, B


def spread(rows: IntArray, columns: IntArray, blocks: FloatArray, size: int) -> sparse.csr_array:
    """Blocks (n, r, c) at these rows (n, r) and columns (n, c), shape (size, size)."""
    at = np.broadcast_arrays(rows[:, :, None], columns[:, None, :])
    return sparse.csr_array((blocks.ravel(), (at[0].ravel(), at[1].ravel())), shape=(size, size))
