"""The law of contacts on whole edges, and linear programs of what they carry where no body yields.

Tractions of one edge are polynomials of degree p. With their Bernstein coefficients N_k and T_k, affine functions
nowhere above c, t_max and μ in place of these, and E the elevation to degree p + 1,

    N_k ≤ 0,    ±T_k ≤ t_k,    ±(E T)_k + (μN)_k ≤ c_k,    (μN)_k = [(p + 1 − k) μ₀ N_k + k μ₁ N_{k−1}]/(p + 1)

are sufficient for σ_N ≤ 0 and |σ_T| ≤ min(c + μ|σ_N|, t_max) at every point. Bilateral contacts with friction have a
bound that grows with |σ_N|: on each edge one sign of σ_N is chosen, or none, and then friction does not count.

In `docs/theory.md`: (D24).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, joined
from qvi_contact.element import bernstein
from qvi_contact.errors import SolveError
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem
from solvers.inner.linear_program import INFEASIBLE, TIME_LIMIT, UNBOUNDED, Answer, solved

PRESSURE, TENSION, EITHER = -1, 1, 0
"""Signs of σ_N on an edge of a bilateral contact."""

ALONG: Final = np.linspace(0.0, 1.0, 33)
"""Places of an edge where fields of contacts are looked at."""

CERTIFIED: Final = 1e-7
"""Violation of the rows, and gap of the bounds relative to 1 + factor, that is accepted."""

_AT_LIMIT: Final = (
    "limit load: the loads that are not multiplied are themselves at the limit of what this mesh carries, to within "
    "rounding: whether they are carried cannot be told. Change these loads, or the friction, by a millionth"
)


@dataclass(frozen=True, eq=False)
class Carried:
    """What a mesh carries, dimensionless."""

    factor: float  # α; infinity if there is no limit, minus infinity if no multiple is carried
    violation: float = 0.0  # the most by which a row is missed, over what stands in them
    tractions: FloatArray | None = None  # (2 m,) rows [σ_N; σ_T] of the contacts; None if α is not finite
    bound: float = np.inf  # where no body yields: the dual bound of α
    # (2 m,) then, too: multipliers of tractions, moments of the opening w and of the slip −[v]_T in the motion with
    # which the mesh gives way, on which the loads do the work 1
    motion: FloatArray | None = None
    unknowns: FloatArray | None = None  # (n,) where bodies yield: (z, y, α)
    stress: FloatArray | None = None  # (cells, 3, count, 3) then, too: coefficients of (σ_xx, σ_yy, σ_xy), φ included


def limited(discretization: Discretization) -> list[tuple[ContactRows, Contact]]:
    """The contacts that limit tractions."""
    pairs = zip(discretization.contacts, discretization.problem.contacts, strict=True)
    return [(rows, contact) for rows, contact in pairs if rows.law != "tied"]


def whole_edge_rows(discretization: Discretization, signs: IntArray) -> tuple[sparse.csr_array, FloatArray]:
    """Rows H [σ_N; σ_T] ≤ limit for the rows of N and T of (D2), dimensionless.

    The `signs` (e,) are those of σ_N on all edges, and count where `both_signs`.
    """
    problem, stress, m = discretization.problem, discretization.scales.stress, discretization.qvi.m
    found, limits, first = [sparse.csr_array((0, 2 * m))], [np.zeros(0)], 0
    for rows, contact in limited(discretization):
        edges, q = rows.points.edges, rows.rule.count
        friction, cohesion = (
            _below(problem, edges, f"Contact.{name}", getattr(contact, name)) for name in ("friction", "cohesion")
        )
        sign = np.full(len(edges), PRESSURE)
        if rows.law == "bilateral":
            sign = np.where((friction > 0.0).any(axis=1), signs[first : first + len(edges)], EITHER)
        first += len(edges)
        plain = np.broadcast_to(edge_coefficients(rows), (len(edges), q, q))
        pressed, elevated = -sign[:, None, None] * plain, _times(np.ones((len(edges), 2)), plain)
        one_sided, every = sign != EITHER, np.ones(len(edges), dtype=bool)
        groups = [(one_sided, pressed[one_sided], 0.0 * plain[one_sided], np.zeros(one_sided.sum() * q))]
        groups += [(every, _times(friction, pressed), one * elevated, _affine(cohesion, q) / stress)
                   for one in (1.0, -1.0)]  # fmt: skip
        if contact.shear_limit is not None:
            cap = _affine(_below(problem, edges, "Contact.shear_limit", contact.shear_limit), q - 1) / stress
            groups += [(every, 0.0 * plain, one * plain, cap) for one in (1.0, -1.0)]
        for chosen, normal, shear, limit in groups:
            numbers = rows.rows.start + q * np.flatnonzero(chosen)[:, None, None] + np.arange(q)
            at = np.arange(len(limit)).reshape(*normal.shape[:2], 1)
            values, columns = np.concatenate([normal, shear], axis=2), np.concatenate([numbers, m + numbers], axis=2)
            at, columns = np.broadcast_arrays(at, columns)
            part = sparse.csr_array((values.ravel(), (at.ravel(), columns.ravel())), shape=(len(limit), 2 * m))
            part.eliminate_zeros()
            found.append(part)
            limits.append(limit)
    return sparse.csr_array(sparse.vstack(found)), joined(limits)


def both_signs(discretization: Discretization) -> BoolArray:
    """Contact edges (e,) where σ_N may have either sign and friction depends on it."""
    found = [np.zeros(0, dtype=bool)]
    for rows, contact in limited(discretization):
        friction = _below(discretization.problem, rows.points.edges, "Contact.friction", contact.friction)
        found.append(np.asarray((friction > 0.0).any(axis=1) & (rows.law == "bilateral")))
    return np.concatenate(found)


def with_signs(discretization: Discretization, solve: Callable[[IntArray], Carried]) -> Carried:
    """The largest factor, with signs of bilateral pressure that a first program without friction there suggests."""
    undecided = both_signs(discretization)
    found = [solve(np.full(len(undecided), EITHER))]
    if undecided.any():
        trials = [np.full(len(undecided), PRESSURE)]
        if found[0].tractions is not None:
            rule = discretization.rule
            normal = rule.at_points(found[0].tractions[: discretization.qvi.m]).reshape(-1, rule.count)
            trials.append(np.where(normal @ rule.weights > 0.0, TENSION, PRESSURE))
        found += [solve(trial) for trial in trials]
    return max(found, key=lambda each: each.factor)


def edge_coefficients(rows: ContactRows) -> FloatArray:
    """Matrix (q, q) from the rows of an edge to Bernstein coefficients."""
    rule = rows.rule
    if rule.law_on == "edges":
        return np.eye(rule.count)
    return np.asarray(np.linalg.inv(bernstein.basis(rule.count - 1, rule.points)))


def _times(ends: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Coefficients (e, q + 1, r) of affine functions of end values (e, 2) times coefficients (e, q, r)."""
    q = coefficients.shape[1]
    k, none = np.arange(q + 1)[:, None], np.zeros_like(coefficients[:, :1])
    own, before = np.concatenate([coefficients, none], axis=1), np.concatenate([none, coefficients], axis=1)
    return np.asarray(((q - k) * ends[:, :1, None] * own + k * ends[:, 1:, None] * before) / q)


def _affine(ends: FloatArray, degree: int) -> FloatArray:
    """Coefficients of affine functions of end values (e, 2), edge by edge."""
    return np.asarray(ends[:, :1] + np.diff(ends, axis=1) * np.linspace(0.0, 1.0, degree + 1)).ravel()


def _below(problem: ContactProblem, edges: Edges, name: str, field: Field) -> FloatArray:
    """End values (e, 2) ≥ 0 of affine functions not above a field: its chord, lowered, or its least value."""
    values = evaluate(name, field, *problem.mesh.points_along(edges, ALONG), minimum=0.0)
    ends = values[:, [0, -1]]
    chord = ends[:, :1] + np.diff(ends, axis=1) * ALONG
    lowered = ends - np.maximum(chord - values, 0.0).max(axis=1)[:, None]
    usable = (lowered >= 0.0).all(axis=1)[:, None]
    return np.asarray(np.where(usable, lowered, values.min(axis=1)[:, None]))


def carried_by_contacts(low: Discretization, high: Discretization, signs: IntArray) -> Carried:
    """Max α  s.t.  G z ≤ h + α h',  A z = b + α b',  for a problem discretised at the load factors 1 and 2.

    By the simplex method, with a bound from its multipliers: from Σ d (h + α h' − G z) ≥ 0 with Gᵀd + Aᵀν = 0 follows
    α ≤ (h·d + b·ν) / −(h'·d + b'·ν), rounding added.

    Raises
    ------
    SolveError
        If the linear program is not solved, or not in time.

    """
    H, limit = whole_edge_rows(low, signs)
    if not len(limit):
        return Carried(np.inf)
    weights = joined([rows.row_weights for rows, _ in limited(low)])
    forces = np.tile(weights.max() / weights, 2)  # they do not grow where edges are short, as tractions do
    largest = abs(H @ sparse.diags_array(forces)).max(axis=1).toarray().ravel()
    H, limit = sparse.csr_array(sparse.diags_array(1.0 / largest) @ H), limit / largest
    qvi, (first, second) = low.qvi, (np.concatenate([part.qvi.n0, part.qvi.t0]) for part in (low, high))
    slope, b_slope = second - first, high.qvi.b - low.qvi.b
    G, A = sparse.csr_array(H @ qvi.contact_rows), sparse.csr_array(qvi.A)
    h, h_slope, b = limit - H @ (first - slope), -(H @ slope), qvi.b - b_slope

    def program(cost: FloatArray, relaxed: bool = False) -> Answer:
        """Minimise over (z, α), or over (z, α, t ≥ 0) with G z ≤ h + α h' + t."""
        more = [(G, np.column_stack([-h_slope, *(-np.ones(len(h)) for _ in range(relaxed))]))]
        more += [(A, np.column_stack([-b_slope, *(np.zeros(len(b)) for _ in range(relaxed))]))]
        wide = [sparse.csc_array(sparse.hstack([rows, sparse.csc_array(columns)])) for rows, columns in more]
        equations: dict[str, Any] = {"A_eq": wide[1], "b_eq": b} if len(b) else {}
        bounds = [(None, None)] * (G.shape[1] + 1) + [(0.0, None)] * relaxed
        return solved(cost, A_ub=wide[0], b_ub=h, bounds=bounds, **equations)

    answer = program(np.append(np.zeros(G.shape[1]), -1.0))
    if answer.status == UNBOUNDED:
        return Carried(np.inf)
    if answer.status == INFEASIBLE:
        nearest = program(np.append(np.zeros(G.shape[1] + 1), 1.0), relaxed=True)
        if nearest.solved and nearest.x[-1] > CERTIFIED * max(1.0, float(np.abs(h).max())):
            return Carried(-np.inf, bound=-np.inf)
        raise SolveError(_AT_LIMIT)
    if answer.status == TIME_LIMIT:
        raise SolveError("limit load: the time limit was reached: allow more (time_limit=…), or take fewer cells")
    if not answer.solved:
        raise SolveError(f"limit load: the linear program was not solved, use less grading ({answer.message})")
    z, factor = answer.x[:-1], float(answer.x[-1])
    size = max(float(np.abs(h).max()), abs(factor) * float(np.abs(h_slope).max()), 1e-300)
    missed = np.abs(A @ z - b - factor * b_slope).max(initial=0.0)
    violation = max(float(np.maximum(G @ z - h - factor * h_slope, 0.0).max()), float(missed)) / size
    d, nu = np.maximum(-answer.inequalities, 0.0), -answer.equations
    rate = -float(h_slope @ d + b_slope @ nu)
    rounding = float(np.abs(G.T @ d + A.T @ nu) @ np.abs(z))
    bound = (float(h @ d + b @ nu) + rounding) / rate if rate > 0.0 else np.inf
    tractions = qvi.contact_rows @ z + first - slope + factor * slope
    return Carried(factor, violation, np.asarray(tractions), bound, np.asarray(H.T @ d))
