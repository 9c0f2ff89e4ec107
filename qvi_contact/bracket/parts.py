"""Tractions and friction bounds on contact edges by Bernstein coefficients, and the gap between the two energies.

Arrays over edges hold those of all contacts that have rows, one after the other; tied ones have none. Where there are
springs along contacts, v in `EdgeParts.contact` and `EdgeParts.friction` stands for v − d, d their stretch.

In `docs/theory.md`: (D20), (D40).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, evaluate
from qvi_contact.companion import CompanionResult
from qvi_contact.discretization.discretization import Discretization
from qvi_contact.discretization.loads import ContactRows, joined, scaled_stress_at_rest
from qvi_contact.discretization.space import POTENTIAL, edge_rule, split_points
from qvi_contact.element.edge import (
    SAMPLES,
    absolute_integrals,
    bernstein_basis,
    bernstein_from_values,
    gauss_legendre,
    largest_quadratic,
    lobatto_points,
    product_integrals,
)
from qvi_contact.problem.conditions import SPRINGS
from qvi_contact.problem.material import is_strained
from qvi_contact.solution.stress import cell_stresses, normal_and_shear

_OUTWARD = 2.0  # safety of the work of violations that are left
_BELOW_ZERO = 1e-10  # of a field's values: a coefficient below zero that is none

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""
EDGE_POINTS: Final = 12
"""Gauss points of an edge for integrals of springs and gaps."""


class Bounds(NamedTuple):
    """Lower and upper bound of a number."""

    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class EdgeParts:
    """Shares of the gap on the edges of one contact, (edges,) each, ≥ 0 [stress × length²]."""

    contact: FloatArray  # ∫ −τ_N (g − v_N) ds: pressure where the displacement leaves a gap
    friction: FloatArray  # ∫ s |v_T − w| + τ_T (v_T − w) ds: slip where the stress is not at the bound, or against it
    springs: FloatArray  # ½ ∫ (τ + k d)²/k ds: what springs bear and what they stretch by, 0 without springs

    @property
    def total(self) -> FloatArray:
        """Their sum (edges,)."""
        return self.contact + self.friction + self.springs


@dataclass(frozen=True, eq=False)
class EdgeTractions:
    """Tractions on the edges of all contacts that have rows, and the bound the law makes of them; dimensionless."""

    # (e, q): Bernstein coefficients of σ_N, as the law takes it, the pressure of fluids added, and of σ_T
    normal: FloatArray
    shear: FloatArray
    # (e, q): coefficients of a bound s ≥ 0 of |σ_T| for the pressure of σ_N, each of them min(c + μ|σ_N|, t_max) of the
    # coefficients: no more than the law's where t_max comes into play inside an edge. A bound below which no polynomial
    # has coefficients ≥ 0 is replaced by its least value
    bound: FloatArray
    exact: BoolArray  # (e,): where it is the law's own
    bilateral: BoolArray  # (e,): where contacts keep their distance, so that σ_N may have any sign
    size: float  # the largest traction at the contact points

    @classmethod
    def of(cls, discretization: Discretization, u: FloatArray) -> "EdgeTractions":
        """From degrees of freedom u of Φ."""
        qvi, rule = discretization.qvi, discretization.rule
        if not qvi.m:
            none = np.zeros((0, rule.count))
            return cls(none, none, none, np.ones(0, dtype=bool), np.ones(0, dtype=bool), 0.0)
        limited = [rows for rows in discretization.contacts if rows.law != "tied"]
        pairs = [tractions_on(discretization, u, rows) for rows in limited]
        normal, shear = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        (cohesion, exact), (cap, cap_exact) = (
            _polynomials(discretization, joined([getattr(rows.limits, name) for rows in limited]))
            for name in ("cohesion", "cap")
        )
        pressure = qvi.law.pressed(normal.ravel())
        law = cohesion + (qvi.mu * pressure).reshape(cohesion.shape)

        def below(first: FloatArray, second: FloatArray) -> BoolArray:
            """On which edges the first bound is the smaller one in all coefficients, rounding set aside."""
            return np.asarray((first <= second * (1.0 + _BELOW_ZERO)).all(axis=1))

        size = float(max(np.abs(rule.at_points(part.ravel())).max() for part in (normal, shear)))
        exact = np.where(below(law, cap), exact, cap_exact & below(cap, law))
        bilateral = np.asarray(qvi.bilateral.reshape(len(law), -1).any(axis=1))
        return cls(normal, shear, np.minimum(law, cap), exact, bilateral, size)

    def violations(self, bound: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Largest (|σ_T| − s)⁺ and (σ_N)⁺ on each edge (e,) for a bound s (e, q): exact to degree 2, else no less."""

        def largest(part: FloatArray) -> FloatArray:
            found = largest_quadratic(part) if part.shape[1] == 3 else part.max(axis=1)
            return np.maximum(found, 0.0)

        excess = np.maximum(largest(self.shear - bound), largest(-self.shear - bound))
        return excess, np.where(self.bilateral, 0.0, largest(self.normal))


def tractions_on(discretization: Discretization, u: FloatArray, rows: ContactRows) -> tuple[FloatArray, FloatArray]:
    """The same coefficients of σ_N and σ_T on one contact, dimensionless."""
    normal, shear = normal_and_shear(discretization, u, rows.points)
    return coefficients(discretization, normal + rows.pore_pressure), coefficients(discretization, shear)


def coefficients(discretization: Discretization, values: FloatArray) -> FloatArray:
    """Bernstein coefficients (e, q) of the polynomials through values (m,) at the q contact points of each edge."""
    rule = edge_rule("edges", discretization.space.degree)
    return rule.at_rows(values).reshape(-1, rule.count)


def _polynomials(discretization: Discretization, values: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Coefficients (e, q) ≥ 0 of a field of the law from its values (m,), and where they are those of the field."""
    q = discretization.rule.count
    values = values.reshape(-1, q)
    given: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    found = coefficients(discretization, np.where(given[:, None], values, 0.0))
    size = np.where(given, np.abs(values).max(axis=1), 0.0)
    usable: BoolArray = np.asarray((found >= -_BELOW_ZERO * size[:, None]).all(axis=1))
    inside = found @ bernstein_basis(q - 1, SAMPLES).T
    least = np.maximum(np.minimum(inside.min(axis=1), values.min(axis=1)), 0.0)
    found = np.where(usable[:, None], np.maximum(found, 0.0), least[:, None])
    return np.where(given[:, None], found, np.inf), usable


@dataclass(frozen=True, eq=False)
class SpringField:
    """Springs of one contact, across it (half 0) or along it (1), arrays (edges, g) over `EDGE_POINTS` of its edges.

    Their stiffness k [stress/length], weights w/k that make ∫ τ²/k ds of τ² [length²/stress], and τ [stress].
    """

    name: str
    half: int
    stiffness: FloatArray
    weights: FloatArray
    traction: FloatArray

    def missed(self, stretches: tuple[FloatArray, FloatArray]) -> FloatArray:
        """τ + k d for the stretches d across and along it [length]."""
        return np.asarray(self.traction + self.stiffness * stretches[self.half])


def _springs(discretization: Discretization, u: FloatArray) -> Iterator[SpringField]:
    """All springs, under the tractions of degrees of freedom u of Φ."""
    problem, (t, w) = discretization.problem, gauss_legendre(EDGE_POINTS)
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        edges = problem.mesh.edges(contact.edges)
        for half, name in enumerate(SPRINGS):
            field = getattr(contact, name)
            if field is not None:
                part = tractions_on(discretization, u, rows)[half] * discretization.scales.stress
                stiffness = evaluate(f"Contact.{name}", field, *problem.mesh.points_along(edges, t), minimum=0.0)
                traction = part @ bernstein_basis(part.shape[1] - 1, t).T
                yield SpringField(contact.name, half, stiffness, edges.length[:, None] * w / stiffness, traction)


@dataclass(frozen=True, eq=False)
class CellFields:
    """A stress τ and σ⁰ = −C ε⁰ (cells, g, 3) at points t (g, 2) of the reference cell, and springs that bear it."""

    compliances: FloatArray  # (cells, 3, 3): c
    weights: FloatArray  # (cells, g)
    stress: FloatArray
    t: FloatArray
    at_rest: FloatArray
    springs: tuple[SpringField, ...]

    @classmethod
    def of(cls, discretization: Discretization, u: FloatArray, degree: int) -> "CellFields":
        """From degrees of freedom u of Φ, for integrals exact beside displacements of a degree and body potentials."""
        problem, scales, space = discretization.problem, discretization.scales, discretization.space
        t, w = split_points(2 * max(space.degree - 2, degree - 1, POTENTIAL) + 1)
        weights = space.cell_measures(t, w) * scales.length**2
        points, stress = cell_stresses(discretization, u, t)
        at_rest, cells = np.zeros_like(stress), np.arange(len(stress))
        if is_strained(problem):
            at_rest = scaled_stress_at_rest(problem, scales, cells, points)
        springs = tuple(_springs(discretization, u))
        unit = scales.stress
        return cls(problem.compliances, weights, stress * unit, t[:, -2:], at_rest * unit, springs)

    def less(self, other: "CellFields") -> "CellFields":
        """The difference of the stresses, which no initial strain is part of."""
        pairs = zip(self.springs, other.springs, strict=True)
        springs = tuple(replace(one, traction=one.traction - two.traction) for one, two in pairs)
        return replace(self, stress=self.stress - other.stress, at_rest=0.0 * self.at_rest, springs=springs)

    def work(self, stress: FloatArray, other: FloatArray) -> float:
        """∫ τ : c : τ' dx of two stresses at the points [stress × length²]."""
        return float(np.einsum("cg,cgk,ckl,cgl->", self.weights, stress, self.compliances, other))

    @property
    def energy(self) -> float:
        """½ ∫ τ : c : τ dx and ½ ∫ τ²/k ds of springs [stress × length²]."""
        springs = sum(float((each.weights * each.traction**2).sum()) for each in self.springs)
        return 0.5 * (self.work(self.stress, self.stress) + springs)

    def apart(self, strain: FloatArray) -> FloatArray:
        """∫ (cτ + ε⁰ − ε) : C : (cτ + ε⁰ − ε) dx of each cell (cells,), from ε at the points (cells, g, 3)."""
        missed = np.einsum("ckl,cgl->cgk", self.compliances, self.stress - self.at_rest) - strain
        stiffness = np.linalg.inv(self.compliances)
        return np.asarray(np.einsum("cg,cgk,ckl,cgl->c", self.weights, missed, stiffness, missed))

    def bulk(self, companion: CompanionResult) -> FloatArray:
        """Half of that for the strains of a displacement model."""
        return 0.5 * self.apart(companion.cell_strain(self.t))


def edge_parts(
    fields: CellFields,
    discretization: Discretization,
    own: EdgeTractions,
    bound: FloatArray,
    companion: CompanionResult,
) -> tuple[dict[str, EdgeParts], float]:
    """Parts of the gap by contact that is not tied or has springs, for a friction bound s (e, q); and a slack.

    That is what violations cost that a solver left, see `EdgeTractions.violations`: an estimate by twice their work
    with v in the place of u.
    """
    problem, unit, (t, weights) = discretization.problem, discretization.scales.stress, gauss_legendre(EDGE_POINTS)
    nodes, back = lobatto_points(companion.degree), bernstein_from_values(companion.degree)
    found, slack, (excess, tension) = dict[str, EdgeParts](), 0.0, own.violations(bound)
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        e, edges = rows.edges, problem.mesh.edges(contact.edges)
        sprung = np.zeros(len(edges))
        for each in fields.springs:
            if each.name == rows.name:
                sprung += 0.5 * (each.weights * each.missed(companion.stretch(each.name, t)) ** 2).sum(axis=1)
        if contact.law == "tied":
            if contact.has_springs:
                found[rows.name] = EdgeParts(0.0 * sprung, 0.0 * sprung, sprung)
            continue
        lengths, normal, shear = edges.length, unit * own.normal[e], unit * own.shear[e]
        gap = evaluate("Contact.gap", contact.gap, *problem.mesh.points_along(edges, t))
        if contact.law == "unilateral":  # as in the stress's energy
            gap = np.minimum(gap, discretization.scales.reach * discretization.scales.displacement)
        opening = gap - companion.trace(rows.name, t)[0]
        pressure = -normal @ bernstein_basis(normal.shape[1] - 1, t).T
        offset = evaluate("Contact.offset", contact.offset, *problem.mesh.points_along(edges, nodes))
        slip = (companion.trace(rows.name, nodes)[1] - offset) @ back.T
        nothing, friction = np.zeros_like(shear), lengths * slip_work(slip, shear, unit * bound[e])
        found[rows.name] = EdgeParts(lengths * ((pressure * opening) @ weights), friction, sprung)
        moved = lengths * slip_work(slip, nothing, nothing + 1.0)
        slack += _OUTWARD * unit * float(tension[e] @ (lengths * (np.abs(opening) @ weights)) + excess[e] @ moved)
    return found, slack


def slip_work(slip: FloatArray, shear: FloatArray, bound: FloatArray) -> FloatArray:
    """∫₀¹ s|j| + τ j dt (edges,) by Bernstein coefficients: slips j (edges, p + 1), τ and s (edges, q)."""
    products = product_integrals(slip.shape[1] - 1, shear.shape[1] - 1)
    signed = np.einsum("ei,ij,ej->e", slip, products, shear)
    return np.asarray(absolute_integrals(bound, slip) + signed)
