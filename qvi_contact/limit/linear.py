"""What contacts carry where no body yields: their law on whole edges, equilibrium of bodies, a linear program.

Tractions of one edge are polynomials of degree p. With their Bernstein coefficients N_k and T_k, affine functions
nowhere above c, t_max and μ in place of these, and E the elevation to degree p + 1,

    N_k ≤ 0,    ±T_k ≤ t_k,    ±(E T)_k + (μN)_k ≤ c_k,    (μN)_k = [(p + 1 − k) μ₀ N_k + k μ₁ N_{k−1}]/(p + 1)

are sufficient for σ_N ≤ 0 and |σ_T| ≤ min(c + μ|σ_N|, t_max) at every point. Bilateral contacts with friction have a
bound that grows with |σ_N|: on each edge one sign of σ_N is chosen, or none, and then friction does not count.

The rows [N; T; A] z of tractions, and of resultants on plates, depend on each other. Those of one body do in its own
equilibrium, those of an edge where it has more rows than its tractions have parameters, and those beside a corner where
stress is continuous. Every other relation follows from these: Airy functions of single bodies whose tractions agree
differ by an affine function along each joint. Around the end of a joint these differences add up to nothing, in value
and in gradient, and so around every block. The functions then join to one after an affine function is added to each.
Relations of single bodies are short; of a wall expressed by rows that span all of it, each would follow a chain of
blocks to the next one that is free.

In `docs/theory.md`: (D24).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, joined
from qvi_contact.element import bernstein
from qvi_contact.errors import SolveError
from qvi_contact.mechanism.bodies import Bodies
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from solvers.inequality.rows import spanning_rows
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, UNBOUNDED, Answer, solved

PRESSURE, TENSION, EITHER = -1, 1, 0
"""Signs of σ_N on an edge of a bilateral contact."""

_ALONG = np.linspace(0.0, 1.0, 33)  # places of an edge where fields are looked at

_ROUNDING = 1e-13  # of the rows, scaled to forces

CERTIFIED: Final = 1e-7
"""Violation of the rows, and gap of the bounds relative to 1 + factor, that is accepted."""

_AT_LIMIT: Final = (
    "limit load: the loads that are not multiplied are themselves at the limit of what this mesh carries, to within "
    "rounding: whether they are carried cannot be told. Change these loads, or the friction, by a millionth"
)


@dataclass(frozen=True, eq=False)
class WholeEdgeRows:
    """Rows H [σ_N; σ_T] ≤ limit for the rows of N and T of (D2), dimensionless."""

    H: sparse.csr_array  # (rows, 2 m) the rows
    limit: FloatArray  # (rows,) their limits

    @classmethod
    def of(cls, discretization: Discretization, signs: IntArray) -> "WholeEdgeRows":
        """The rows of a discretisation; `signs` (e,) are those of σ_N on all edges, and count where `both_signs`."""
        none = sparse.csr_array((0, 2 * discretization.qvi.m)), np.empty(0)
        parts, start = [none], 0
        for rows, contact in _limited(discretization):
            count = len(rows.points.edges)
            parts += list(_of_contact(discretization, rows, contact, signs[start : start + count]))
            start += count
        H = sparse.csr_array(sparse.vstack([matrix for matrix, _ in parts]))
        return cls(H, joined([limit for _, limit in parts]))

    def of_forces(self, shares: FloatArray) -> tuple[sparse.csr_array, FloatArray]:
        """The rows, and their limits, for forces: tractions times what each has of its edge's length (2 m,).

        The largest entry of every row is 1.
        """
        H = sparse.csr_array(self.H @ sparse.diags_array(1.0 / shares))
        largest = abs(H).max(axis=1).toarray().ravel()
        return sparse.csr_array(sparse.diags_array(1.0 / largest) @ H), self.limit / largest


def both_signs(discretization: Discretization) -> BoolArray:
    """Contact edges (e,) where σ_N may have either sign and friction depends on it."""
    found = [np.zeros(0, dtype=bool)]
    for rows, contact in _limited(discretization):
        friction = _below(discretization.problem, rows.points.edges, "Contact.friction", contact.friction)
        found.append(np.asarray((friction > 0.0).any(axis=1) & (rows.law == "bilateral")))
    return np.concatenate(found)


def mean_normal(discretization: Discretization, tractions: FloatArray) -> FloatArray:
    """Mean of σ_N on each contact edge (e,) from the rows [σ_N; σ_T] (2 m,)."""
    rule = discretization.rule
    return np.asarray(rule.at_points(tractions[: discretization.qvi.m]).reshape(-1, rule.count) @ rule.weights)


def _limited(discretization: Discretization) -> Iterator[tuple[ContactRows, Contact]]:
    """The contacts that limit tractions."""
    for rows, contact in zip(discretization.contacts, discretization.problem.contacts, strict=True):
        if rows.law != "tied":
            yield rows, contact


def _of_contact(
    discretization: Discretization, rows: ContactRows, contact: Contact, signs: IntArray
) -> Iterator[tuple[sparse.csr_array, FloatArray]]:
    """Rows of one contact in groups, with their limits."""
    problem, stress, edges = discretization.problem, discretization.scales.stress, rows.points.edges
    degree, m = rows.rule.count - 1, discretization.qvi.m
    coefficients = edge_coefficients(rows)
    friction = _below(problem, edges, "Contact.friction", contact.friction)
    rough = (friction > 0.0).any(axis=1)
    sign = np.full(len(edges), PRESSURE) if rows.law == "unilateral" else np.where(rough, signs, EITHER)
    pressed = -sign[:, None, None] * coefficients
    cohesion = _below(problem, edges, "Contact.cohesion", contact.cohesion) / stress
    elevated = _times(np.ones((len(edges), 2)), coefficients)
    frictional = _times(friction, pressed)
    every, one_sided = np.ones(len(edges), dtype=bool), sign != EITHER
    yield _placed(pressed[one_sided], None, rows, one_sided, m), np.zeros(one_sided.sum() * (degree + 1))
    for one in (1.0, -1.0):
        yield _placed(frictional, one * elevated, rows, every, m), _affine(cohesion, degree + 1)
    if contact.shear_limit is not None:
        cap = _below(problem, edges, "Contact.shear_limit", contact.shear_limit) / stress
        for one in (1.0, -1.0):
            plain = one * np.broadcast_to(coefficients, pressed.shape)
            yield _placed(None, plain, rows, every, m), _affine(cap, degree)


def edge_coefficients(rows: ContactRows) -> FloatArray:
    """Matrix (q, q) from the rows of an edge to Bernstein coefficients."""
    rule = rows.rule
    if rule.law_on == "edges":
        return np.eye(rule.count)
    return np.asarray(np.linalg.inv(bernstein.basis(rule.count - 1, rule.points)))


def _times(ends: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Coefficients (e, q + 1, r) of affine functions of end values (e, 2) times coefficients (e or none, q, r)."""
    q = coefficients.shape[-2]
    k = np.arange(q + 1)[:, None]
    padded = np.broadcast_to(coefficients, (len(ends), *coefficients.shape[-2:]))
    none = np.zeros((len(ends), 1, coefficients.shape[-1]))
    own, before = np.concatenate([padded, none], axis=1), np.concatenate([none, padded], axis=1)
    return np.asarray(((q - k) * ends[:, :1, None] * own + k * ends[:, 1:, None] * before) / q)


def _affine(ends: FloatArray, degree: int) -> FloatArray:
    """Coefficients of affine functions of end values (e, 2), edge by edge."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, degree + 1)).ravel()


def _placed(
    normal: FloatArray | None, shear: FloatArray | None, rows: ContactRows, chosen: BoolArray, m: int
) -> sparse.csr_array:
    """Rows (e, k, q) on σ_N and σ_T of the chosen edges of a contact, as rows on [σ_N; σ_T] of all contacts."""
    q, found = rows.rule.count, []
    numbers = rows.rows.start + q * np.flatnonzero(chosen)[:, None, None] + np.arange(q)
    for shift, part in ((0, normal), (m, shear)):
        if part is not None:
            at = np.arange(part.shape[0] * part.shape[1]).reshape(*part.shape[:2], 1)
            at, columns = np.broadcast_arrays(at, numbers + shift)
            shape = (part.shape[0] * part.shape[1], 2 * m)
            found.append(sparse.csr_array((part.ravel(), (at.ravel(), columns.ravel())), shape=shape))
    return sparse.csr_array(sum(found[1:], found[0]))


def _below(problem: ContactProblem, edges: Edges, name: str, field: Field) -> FloatArray:
    """End values (e, 2) ≥ 0 of affine functions not above a field: its chord, lowered, or its least value."""
    values = evaluate(name, field, *problem.mesh.points_along(edges, _ALONG), minimum=0.0)
    ends = values[:, [0, -1]]
    chord = ends[:, :1] + np.diff(ends, axis=1) * _ALONG
    lowered = ends - np.maximum(chord - values, 0.0).max(axis=1)[:, None]
    usable = (lowered >= 0.0).all(axis=1)[:, None]
    return np.asarray(np.where(usable, lowered, values.min(axis=1)[:, None]))


@dataclass(frozen=True, eq=False)
class Relations:
    """C f + D (A z) = 0 for all z, with the forces f = diag(shares) [N; T] z on contacts."""

    forces: sparse.csr_array  # (r, 2 m) C
    resultants: sparse.csr_array  # (r, p) D

    @classmethod
    def of(cls, discretization: Discretization, shares: FloatArray) -> "Relations":
        """Those of a discretisation; shares (2 m,) turn tractions into forces."""
        qvi = discretization.qvi
        parts = [sparse.diags_array(shares) @ qvi.contact_rows, qvi.A]
        rows = sparse.csr_array(sparse.vstack(parts))
        found = [sparse.csr_array((0, rows.shape[0]))]
        found += [_among(rows, group) for group in _groups(discretization)]
        relations = sparse.csc_array(sparse.vstack(found))
        return cls(sparse.csr_array(relations[:, : 2 * qvi.m]), sparse.csr_array(relations[:, 2 * qvi.m :]))


def _among(rows: sparse.csr_array, group: IntArray) -> sparse.csr_array:
    """The relations among some of the rows, each giving one of them by others that are independent."""
    E, chosen = spanning_rows(sparse.csc_array(rows[group]))
    dependent = np.setdiff1d(np.arange(len(group)), chosen)
    given = np.where(np.abs(E[dependent]) > _ROUNDING, E[dependent], 0.0)
    relations = np.zeros((len(dependent), len(group)))
    relations[:, chosen] = given
    relations[np.arange(len(dependent)), dependent] = -1.0
    local = sparse.coo_array(relations)
    return sparse.csr_array((local.data, (local.row, group[local.col])), shape=(len(dependent), rows.shape[0]))


def _groups(discretization: Discretization) -> Iterator[IntArray]:
    """The rows around each body: tractions on it, and resultants on a plate that is one."""
    problem, m = discretization.problem, discretization.qvi.m
    bodies = Bodies.of(problem)
    first, second, glued = [], [], list[tuple[int, int]]()
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        edges = rows.points.edges
        own = bodies.of_cells[edges.cells[:, 0]]
        other = bodies.of_cells[edges.cells[:, 1]] if rows.joint else np.full(len(own), bodies.number(contact))
        if contact.law == "tied":  # without rows of its own, and parting nothing
            glued += [(int(a), int(b)) for a, b in zip(own, other, strict=True) if b >= 0]
        else:
            first.append(np.repeat(own, rows.rule.count))
            second.append(np.repeat(other, rows.rule.count))
    a, b = np.array(glued, dtype=np.int64).reshape(-1, 2).T
    graph = sparse.csr_array((np.ones(len(a)), (a, b)), shape=(len(bodies), len(bodies)))
    label = np.asarray(sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)  # what each is in
    plates = np.array([bodies.blocks + bodies.plates.index(row.contact) for row in discretization.plates.rows], int)
    around = [joined(part).astype(np.int64) for part in (first, second)]
    ends = [np.where(part >= 0, label[part], -1) for part in around]
    for body in np.unique(label):
        points = np.flatnonzero((ends[0] == body) | (ends[1] == body))
        resultants = np.flatnonzero(label[plates] == body)
        yield np.concatenate([points, m + points, 2 * m + resultants])


@dataclass(frozen=True, eq=False)
class CarriedForces:
    """What the contacts of a mesh carry, dimensionless."""

    factor: float  # the load factor, and its dual bound
    bound: float
    violation: float = 0.0  # the most by which a row is missed, over the largest limit
    tractions: FloatArray | None = None  # (2 m,) rows [σ_N; σ_T] at the factor; None if that is not finite
    # (2 m,) multipliers of these rows: moments of the opening w and of the slip −[v]_T in the motion with which
    # the mesh gives way, on which the loads do the work 1
    motion: FloatArray | None = None


def carried_forces(low: Discretization, high: Discretization) -> CarriedForces:
    """The largest factor that a problem discretised at the load factors 1 and 2 carries.

    Signs of bilateral pressure are those that a first program without friction there suggests.

    Raises
    ------
    SolveError
        If the linear program is not solved, or not in time.

    """
    undecided = both_signs(low)
    found = [_largest(low, high, np.full(len(undecided), EITHER))]
    if undecided.any():
        trials = [np.where(undecided, PRESSURE, EITHER)]
        if found[0].tractions is not None:
            trials.append(np.where(mean_normal(low, found[0].tractions) > 0.0, TENSION, PRESSURE))
        found += [_largest(low, high, trial) for trial in trials]
    return max(found, key=lambda each: each.factor)


def _largest(low: Discretization, high: Discretization, signs: IntArray) -> CarriedForces:
    """Max α  s.t.  G y ≤ h + α h',  A y = b + α b'  in the forces y, by simplex, with a bound from its multipliers.

    From Σ d (h + α h' − G y) ≥ 0 with Gᵀd + Aᵀν = 0:  α ≤ (h·d + b·ν) / −(h'·d + b'·ν), rounding added.
    """
    rows = WholeEdgeRows.of(low, signs)
    if not len(rows.limit):
        return CarriedForces(np.inf, np.inf)
    weights = joined([contact.row_weights for contact in low.contacts if contact.law != "tied"])
    shares = np.tile(weights / weights.max(), 2)  # forces do not grow where edges are short, tractions do
    relations = Relations.of(low, shares)
    first, second = (shares * np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (low, high))
    G, limit = rows.of_forces(shares)
    slope = second - first
    h, h_slope = limit - G @ (first - slope), -(G @ slope)
    b_slope = high.qvi.b - low.qvi.b
    A, b, b_slope = relations.forces, -(relations.resultants @ (low.qvi.b - b_slope)), -(relations.resultants @ b_slope)

    def program(cost: FloatArray, relaxed: bool = False) -> Answer:
        """Minimise over (y, α), or over (y, α, t ≥ 0) with G y ≤ h + α h' + t."""
        columns = np.column_stack([-h_slope, *(-np.ones(len(h)) for _ in range(relaxed))])
        equations: dict[str, Any] = {}
        if len(b):
            more = np.column_stack([-b_slope, *(np.zeros(len(b)) for _ in range(relaxed))])
            equations = {"A_eq": sparse.csc_array(sparse.hstack([A, sparse.csc_array(more)])), "b_eq": b}
        bounds = [(None, None)] * (G.shape[1] + 1) + [(0.0, None)] * relaxed
        return solved(
            cost,
            A_ub=sparse.csc_array(sparse.hstack([G, sparse.csc_array(columns)])),
            b_ub=h,
            bounds=bounds,
            **equations,
        )

    answer = program(np.append(np.zeros(G.shape[1]), -1.0))
    if answer.status == UNBOUNDED:
        return CarriedForces(np.inf, np.inf)
    if answer.status == INFEASIBLE:
        nearest = program(np.append(np.zeros(G.shape[1] + 1), 1.0), relaxed=True)
        if nearest.solved and nearest.x[-1] > CERTIFIED * max(1.0, float(np.abs(h).max())):
            return CarriedForces(-np.inf, -np.inf)
        raise SolveError(_AT_LIMIT)
    if answer.status == TIME_LIMIT:
        raise SolveError("limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells")
    if not answer.solved:
        raise SolveError(f"limit load: the linear program was not solved, use less grading ({answer.message})")
    y, factor = answer.x[:-1], float(answer.x[-1])
    size = max(float(np.abs(h).max()), abs(factor) * float(np.abs(h_slope).max()), 1e-300)
    missed = np.abs(A @ y - b - factor * b_slope).max(initial=0.0)
    violation = max(float(np.maximum(G @ y - h - factor * h_slope, 0.0).max()), float(missed)) / size
    d, nu = np.maximum(-answer.inequalities, 0.0), -answer.equations
    rate = -float(h_slope @ d + b_slope @ nu)
    rounding = float(np.abs(G.T @ d + A.T @ nu) @ np.abs(y))
    bound = (float(h @ d + b @ nu) + rounding) / rate if rate > 0.0 else np.inf
    tractions = (y + first - slope + factor * slope) / shares
    return CarriedForces(factor, bound, violation, tractions, shares * (G.T @ d))
