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

from qvi_contact.basics.checks import Field, FloatArray, IntArray, evaluate
from qvi_contact.companion.space import DisplacementSpace, spread
from qvi_contact.discretization.scaling import Scales
from qvi_contact.element import bernstein
from qvi_contact.element.quadrature import EdgeQuadrature
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


def moments(given: EdgeQuadrature, degree: int) -> FloatArray:
    """∫₀¹ f B_i dt (e, degree + 1) of a function on e edges."""
    return given.integrals(bernstein.basis(degree, given.t.ravel()).reshape(*given.t.shape, -1))


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


def supports(problem: ContactProblem, space: DisplacementSpace, scales: Scales) -> Supports:
    """Prescribed displacements; where two disagree in a corner their mean."""
    p, unit, reasons = space.degree, scales.displacement, list[str]()
    on_arcs, fixed = list[tuple[Edges, IntArray]](), list[tuple[IntArray, FloatArray]]()
    conditions = [(np.empty(0, dtype=np.int64), np.empty((0, 2)), np.empty(0))]  # d·v = value at coefficients
    for given in problem.prescribed(Displacement):
        edges, numbers = given.edges, space.along(given.edges)
        data, misfit = edge_data(problem, edges, given.name, given.value, p, unit)
        if misfit > MISFIT * max(1.0, float(np.abs(data).max(initial=0.0))):
            reasons.append(
                f"{given.name} is not a polynomial of degree {p} on each edge. It is interpolated, with an "
                f"error of up to {misfit * unit:.2g} [length]."
            )
        turning = edges.bent & given.turns
        if turning.any():  # inside arcs n·v or t·v
            reasons.append(f"{given.name} holds on arcs as closely as polynomials of degree {p} follow its directions.")
            arcs, inside = edges.take(turning), numbers[turning, 1:-1]
            alike = np.rint([(part * given.direction[turning]).sum(axis=1) for part in (arcs.normal, arcs.tangent)])
            on_arcs.append((arcs, numbers[turning]))
            dofs, values = 2 * inside + np.argmax(np.abs(alike), axis=0)[:, None], alike.sum(axis=0)[:, None]
            fixed.append((dofs.ravel(), (data[turning, 1:-1] * values).ravel()))
        places = np.linspace(0.0, 1.0, p + 1)
        here = ~turning[:, None] | (places == 0.0) | (places == 1.0)
        conditions.append(
            (numbers[here], vectors_along(edges, given.direction, places, turns=given.turns)[here], data[here])
        )

    coefficient, direction, value = (np.concatenate(part) for part in zip(*conditions, strict=True))
    known, group, count = np.unique(coefficient, return_inverse=True, return_counts=True)
    order = np.argsort(group, kind="stable")
    place = group[order], np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    D, wanted = (
        np.zeros((len(known), max(2, *count.tolist(), 0), 2)),
        np.zeros((len(known), max(2, *count.tolist(), 0))),
    )
    D[place], wanted[place] = direction[order], value[order]  # those of one coefficient in a row, zeros after them
    U, size, V = np.linalg.svd(D, full_matrices=False)
    both, first = size[:, 1] > PARALLEL, D[:, 0]
    solved = np.einsum("kmi,km,ki,kij->kj", U, wanted, 1.0 / np.where(both[:, None], size, 1.0), V)
    mean = (np.sign(np.einsum("kmi,ki->km", D, first)) * wanted).sum(axis=1) / count
    found = np.where(both[:, None], solved, mean[:, None] * first)
    wrong = np.abs(np.einsum("kmi,ki->km", D, found) - wanted).max(axis=1) > MISFIT * max(
        1.0, np.abs(value).max(initial=0.0)
    )
    if wrong.any():
        x, y = problem.mesh.origin + scales.length * space.places[known[wrong].min()]
        reasons.append(f"Prescribed displacements disagree at ({x:.6g}, {y:.6g}). Their mean is used.")
    along, slanted = np.argmax(np.abs(first), axis=1), ~both & (np.abs(first).max(axis=1) < 1.0)
    one = np.where(slanted, mean, np.take_along_axis(found, along[:, None], axis=1)[:, 0])
    fixed.append(((2 * known + np.where(slanted, 0, along))[~both], one[~both]))
    fixed.append(((2 * known[both, None] + np.arange(2)).ravel(), solved[both].ravel()))

    frames = np.tile(np.eye(2), (space.size // 2, 1, 1))
    frames[known[slanted]] = np.stack([first, np.stack([-first[:, 1], first[:, 0]], axis=1)], axis=2)[slanted]
    dofs = np.arange(space.size).reshape(-1, 2)
    Q = spread(dofs, dofs, frames, space.size)
    Q.eliminate_zeros()
    index, values = (np.concatenate(part) for part in zip(*fixed, strict=True))
    order = np.argsort(index)
    axes, inverse = _along_arcs(Q, on_arcs, p) if on_arcs else (Q, sparse.csr_array(Q.T))
    return Supports(index[order], values[order], axes, inverse, bool(slanted.any() or on_arcs), tuple(reasons))


def _along_arcs(
    Q: sparse.csr_array, on_arcs: list[tuple[Edges, IntArray]], degree: int
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Q and Q⁻¹ with the coefficients inside arcs along their frames, from Q of all others.

    An arc with two conditions is listed twice, with the same rows. With v and w inside (i) and at both ends (e),
    w_i = A v_i + B v_e, so that v_i = A⁻¹ w_i − A⁻¹ B Q_e w.
    """
    dofs = np.concatenate([2 * numbers[:, :, None] + np.arange(2) for _, numbers in on_arcs])
    each = (np.stack([along_arcs(arcs, d, degree) for d in (arcs.normal, arcs.tangent)], axis=2) for arcs, _ in on_arcs)
    _, once = np.unique(dofs[:, 1, 0], return_index=True)
    n, dofs, rows = len(once), dofs[once], np.concatenate(list(each))[once]
    rows = rows.reshape(n, 2 * (degree - 1), degree + 1, 2)
    inside, at_ends = dofs[:, 1:-1].reshape(n, -1), dofs[:, [0, -1]].reshape(n, -1)
    A, B = rows[:, :, 1:-1].reshape(*rows.shape[:2], -1), rows[:, :, [0, -1]].reshape(*rows.shape[:2], -1)
    size, keep, inverse = Q.shape[0], np.ones(Q.shape[0]), np.asarray(np.linalg.inv(A), dtype=np.float64)
    keep[inside] = 0.0
    whole = sparse.diags_array(keep) @ Q @ sparse.diags_array(keep)
    own, beside = spread(inside, inside, inverse, size), spread(inside, at_ends, inverse @ B, size)
    rows = spread(inside, inside, A, size) + spread(inside, at_ends, B, size)
    return sparse.csr_array(whole + own - beside @ whole), sparse.csr_array(whole.T + rows)
