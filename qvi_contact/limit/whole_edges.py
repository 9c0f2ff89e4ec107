"""The contact law on whole edges as linear rows: what keeps them is admissible everywhere, not only at points.

Tractions of one edge are polynomials of degree p. With their Bernstein coefficients N_k and T_k, affine functions
nowhere above c, t_max and μ in place of these, and E the elevation to degree p + 1,

    N_k ≤ 0,    ±T_k ≤ t_k,    ±(E T)_k + (μN)_k ≤ c_k,    (μN)_k = [(p + 1 − k) μ₀ N_k + k μ₁ N_{k−1}]/(p + 1)

are sufficient for σ_N ≤ 0 and |σ_T| ≤ min(c + μ|σ_N|, t_max). Bilateral contacts with friction have a bound that grows
with |σ_N|: on each edge one sign of σ_N is chosen, or none, and then friction does not count.

In `docs/theory.md`: (D24).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, IntArray, evaluate
from qvi_contact.discretization.contact_rows import ContactRows, joined
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.element import bernstein
from qvi_contact.mesh.edges import Edges
from qvi_contact.problem.conditions import Contact
from qvi_contact.problem.problem import ContactProblem

PRESSURE, TENSION, EITHER = -1, 1, 0
"""Signs of σ_N on an edge of a bilateral contact."""

_SAMPLES = np.linspace(0.0, 1.0, 33)  # places of an edge where fields are looked at


@dataclass(frozen=True, eq=False)
class WholeEdgeRows:
    """Rows H [σ_N; σ_T] ≤ limit for the rows of N and T of (D2), dimensionless.

    Attributes
    ----------
    H : (rows, 2 m) sparse array
        The rows.
    limit : (rows,) array
        Their limits.

    """

    H: sparse.csr_array
    limit: FloatArray

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
    if rule.kind == "bernstein":
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
    values = evaluate(name, field, *problem.mesh.points_along(edges, _SAMPLES), minimum=0.0)
    ends = values[:, [0, -1]]
    chord = ends[:, :1] + np.diff(ends, axis=1) * _SAMPLES
    lowered = ends - np.maximum(chord - values, 0.0).max(axis=1)[:, None]
    usable = (lowered >= 0.0).all(axis=1)[:, None]
    return np.asarray(np.where(usable, lowered, values.min(axis=1)[:, None]))
