"""Tractions and friction bounds on contact edges by Bernstein coefficients, and the parts of the duality gap.

Arrays over edges hold the edges of all contacts that are not tied, one contact after the other. Where a contact has
springs of stretch d, v in `EdgeParts.contact` and `EdgeParts.friction` stands for v − d.

In `docs/theory.md`: (D20), (D40).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, evaluate
from qvi_contact.basics.schema import WithFields
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
from qvi_contact.solution.stress import normal_and_shear, stress_in_cells

_OUTWARD = 2.0  # factor of safety on the work of violations
_BELOW_ZERO = 1e-10  # of a field's largest value: negative coefficients up to this size are rounding of zero

LOOSEST: Final = 1e-6
"""Largest violation of the contact law, relative to the largest stress, that counts as admissible."""
EDGE_POINTS: Final = 12
"""Gauss points of an edge for integrals of springs and gaps."""


class Bounds(NamedTuple):
    """Lower and upper bound of a number."""

    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class EdgeParts(WithFields):
    """Parts of the duality gap on the edges of one contact, (edges,) each, ≥ 0 [stress × length²]."""

    contact: FloatArray  #: ∫ −τ_N (g − v_N) ds: pressure where the displacement leaves a gap
    friction: FloatArray  #: ∫ s |v_T − w| + τ_T (v_T − w) ds: slip below the friction bound, or along the friction
    springs: FloatArray  #: ½ ∫ (τ + k d)²/k ds: traction and stretch of springs that do not fit; 0 without springs

    @property
    def total(self) -> FloatArray:
        """The sum of the three parts (edges,)."""
        return self.contact + self.friction + self.springs


@dataclass(frozen=True, eq=False)
class EdgeTractions:
    """Tractions on the edges of all contacts that are not tied, and their friction bound by the law; dimensionless."""

    normal: FloatArray  # (e, q): Bernstein coefficients of the effective σ_N, with the pressure of fluids added
    shear: FloatArray  # (e, q): Bernstein coefficients of σ_T
    # (e, q): coefficients of a bound s ≥ 0 of |σ_T|: min(c + μ|σ_N|, t_max), coefficient by coefficient. This is below
    # the law's bound where t_max begins to act inside an edge, and where c or t_max would have negative coefficients
    bound: FloatArray
    exact: BoolArray  # (e,): where s is exactly the law's bound
    bilateral: BoolArray  # (e,): where contacts keep their distance, so that σ_N may have any sign
    size: float  # the largest traction at the contact points

    @classmethod
    def of(cls, discretization: Discretization, u: FloatArray) -> "EdgeTractions":
        """Tractions of the degrees of freedom u of Φ."""
        qvi, rule, empty = discretization.qvi, discretization.rule, np.zeros((0, discretization.rule.count))
        with_rows = [rows for rows in discretization.contacts if rows.law != "tied"]
        pairs = [(empty, empty), *(tractions_on(discretization, u, rows) for rows in with_rows)]
        normal, shear = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
        (cohesion, exact), (cap, cap_exact) = (
            _polynomials(discretization, joined([getattr(rows.limits, name) for rows in with_rows]))
            for name in ("cohesion", "cap")
        )
        pressure = qvi.law.pressed(normal.ravel())
        coulomb = cohesion + (qvi.mu * pressure).reshape(cohesion.shape)

        def below(first: FloatArray, second: FloatArray) -> BoolArray:
            """On which edges all coefficients of the first bound are at most those of the second, up to rounding."""
            return np.asarray((first <= second * (1.0 + _BELOW_ZERO)).all(axis=1))

        size = float(max(np.abs(rule.at_points(part.ravel())).max(initial=0.0) for part in (normal, shear)))
        exact = np.where(below(coulomb, cap), exact, cap_exact & below(cap, coulomb))
        bilateral = np.asarray(qvi.bilateral.reshape(-1, rule.count).any(axis=1))
        return cls(normal, shear, np.minimum(coulomb, cap), exact, bilateral, size)

    def violations(self, bound: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The largest (|σ_T| − s)⁺ and (σ_N)⁺ by edge (e,) for a bound s (e, q): exact to degree 2, else from above."""

        def largest(part: FloatArray) -> FloatArray:
            values = largest_quadratic(part) if part.shape[1] == 3 else part.max(axis=1)
            return np.maximum(values, 0.0)

        excess = np.maximum(largest(self.shear - bound), largest(-self.shear - bound))
        return excess, np.where(self.bilateral, 0.0, largest(self.normal))


def tractions_on(discretization: Discretization, u: FloatArray, rows: ContactRows) -> tuple[FloatArray, FloatArray]:
    """Bernstein coefficients (e, q) of σ_N, with the pressure of fluids, and of σ_T on one contact, dimensionless."""
    normal, shear = normal_and_shear(discretization, u, rows.points)
    return coefficients(discretization, normal + rows.pore_pressure), coefficients(discretization, shear)


def coefficients(discretization: Discretization, values: FloatArray) -> FloatArray:
    """Bernstein coefficients (e, q) of the polynomials through values (m,) at the q contact points of each edge."""
    rule = edge_rule("edges", discretization.space.degree)
    return rule.at_rows(values).reshape(-1, rule.count)


def _polynomials(discretization: Discretization, values: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Coefficients (e, q) of a datum with values (m,), its least value if one were negative; where they are exact."""
    q = discretization.rule.count
    values = values.reshape(-1, q)
    is_finite: BoolArray = np.asarray(np.isfinite(values).all(axis=1))
    bernstein = coefficients(discretization, np.where(is_finite[:, None], values, 0.0))
    largest = np.where(is_finite, np.abs(values).max(axis=1), 0.0)
    is_nonnegative: BoolArray = np.asarray((bernstein >= -_BELOW_ZERO * largest[:, None]).all(axis=1))
    samples = bernstein @ bernstein_basis(q - 1, SAMPLES).T
    least = np.maximum(np.minimum(samples.min(axis=1), values.min(axis=1)), 0.0)
    bernstein = np.where(is_nonnegative[:, None], np.maximum(bernstein, 0.0), least[:, None])
    return np.where(is_finite[:, None], bernstein, np.inf), is_nonnegative


@dataclass(frozen=True, eq=False)
class SpringField:
    """Springs of one contact, across it (half 0) or along it (1); arrays (edges, g) over `EDGE_POINTS` of its edges.

    k is their stiffness [stress/length], w/k the weights of ∫ τ²/k ds [length²/stress], and τ their traction [stress].
    """

    name: str
    half: int
    stiffness: FloatArray
    weights: FloatArray
    traction: FloatArray

    def missed(self, stretches: tuple[FloatArray, FloatArray]) -> FloatArray:
        """τ + k d for the stretches d across and along the contact [length]."""
        return np.asarray(self.traction + self.stiffness * stretches[self.half])


def _springs(discretization: Discretization, u: FloatArray) -> Iterator[SpringField]:
    """The springs of all contacts under the tractions of degrees of freedom u of Φ."""
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
    """A stress τ and σ⁰ = −C ε⁰ (cells, g, 3) at points t (g, 2) of the reference cell, and the springs it loads."""

    compliances: FloatArray  # (cells, 3, 3): c
    weights: FloatArray  # (cells, g)
    stress: FloatArray
    t: FloatArray
    at_rest: FloatArray
    springs: tuple[SpringField, ...]

    @classmethod
    def of(cls, discretization: Discretization, u: FloatArray, degree: int) -> "CellFields":
        """The stress of degrees of freedom u of Φ, at points that integrate its work on displacements of a degree."""
        problem, scales, space = discretization.problem, discretization.scales, discretization.space
        t, w = split_points(2 * max(space.degree - 2, degree - 1, POTENTIAL) + 1)
        weights = space.cell_measures(t, w) * scales.length**2
        points, stress = stress_in_cells(discretization, u, t=t)
        at_rest, cells = np.zeros_like(stress), np.arange(len(stress))
        if is_strained(problem):
            at_rest = scaled_stress_at_rest(problem, scales, cells, points)
        springs = tuple(_springs(discretization, u))
        unit = scales.stress
        return cls(problem.compliances, weights, stress * unit, t[:, -2:], at_rest * unit, springs)

    def less(self, other: "CellFields") -> "CellFields":
        """The difference of two stresses, which has no initial strain."""
        pairs = zip(self.springs, other.springs, strict=True)
        springs = tuple(replace(one, traction=one.traction - two.traction) for one, two in pairs)
        return replace(self, stress=self.stress - other.stress, at_rest=0.0 * self.at_rest, springs=springs)

    def work(self, stress: FloatArray, other: FloatArray) -> float:
        """∫ τ : c : τ′ dx of two stresses at the points [stress × length²]."""
        return float(np.einsum("cg,cgk,ckl,cgl->", self.weights, stress, self.compliances, other))

    @property
    def energy(self) -> float:
        """½ ∫ τ : c : τ dx + ½ ∫ τ²/k ds, the second of springs [stress × length²]."""
        springs = sum(float((each.weights * each.traction**2).sum()) for each in self.springs)
        return 0.5 * (self.work(self.stress, self.stress) + springs)

    def apart(self, strain: FloatArray) -> FloatArray:
        """∫ (cτ + ε⁰ − ε) : C : (cτ + ε⁰ − ε) dx by cell (cells,), for strains ε at the points (cells, g, 3)."""
        misfit = np.einsum("ckl,cgl->cgk", self.compliances, self.stress - self.at_rest) - strain
        stiffness = np.linalg.inv(self.compliances)
        return np.asarray(np.einsum("cg,cgk,ckl,cgl->c", self.weights, misfit, stiffness, misfit))

    def bulk(self, companion: CompanionResult) -> FloatArray:
        """½ ∫ (cτ + ε⁰ − ε) : C : (cτ + ε⁰ − ε) dx by cell (cells,), for the strains of a displacement model."""
        return 0.5 * self.apart(companion.cell_strain(self.t))


def edge_parts(
    fields: CellFields, discretization: Discretization, tractions: EdgeTractions, bound: FloatArray,
    companion: CompanionResult,
) -> tuple[dict[str, EdgeParts], float]:  # fmt: skip
    """Parts of the gap by contact that is not tied or has springs, for a friction bound s (e, q); and the slack.

    The slack estimates the cost of violations that a solver left: twice their work, with v in the place of u.
    """
    problem, unit, (t, weights) = discretization.problem, discretization.scales.stress, gauss_legendre(EDGE_POINTS)
    nodes, to_bernstein = lobatto_points(companion.degree), bernstein_from_values(companion.degree)
    parts, slack, (excess, tension) = dict[str, EdgeParts](), 0.0, tractions.violations(bound)
    for rows, contact in zip(discretization.contacts, problem.contacts, strict=True):
        e, edges = rows.edges, problem.mesh.edges(contact.edges)
        spring_part = np.zeros(len(edges))
        for each in fields.springs:
            if each.name == rows.name:
                spring_part += 0.5 * (each.weights * each.missed(companion.stretch(each.name, t)) ** 2).sum(axis=1)
        if contact.law == "tied":
            if contact.has_springs:
                parts[rows.name] = EdgeParts(0.0 * spring_part, 0.0 * spring_part, spring_part)
            continue
        lengths, normal, shear = edges.length, unit * tractions.normal[e], unit * tractions.shear[e]
        gap = evaluate("Contact.gap", contact.gap, *problem.mesh.points_along(edges, t))
        if contact.law == "unilateral":  # far obstacles are cut as in the energy of the stress
            gap = np.minimum(gap, discretization.scales.reach * discretization.scales.displacement)
        opening = gap - companion.trace(rows.name, t)[0]
        pressure = -normal @ bernstein_basis(normal.shape[1] - 1, t).T
        offset = evaluate("Contact.offset", contact.offset, *problem.mesh.points_along(edges, nodes))
        slip = (companion.trace(rows.name, nodes)[1] - offset) @ to_bernstein.T
        zero, friction = np.zeros_like(shear), lengths * slip_work(slip, shear, unit * bound[e])
        parts[rows.name] = EdgeParts(lengths * ((pressure * opening) @ weights), friction, spring_part)
        slip_size = lengths * slip_work(slip, zero, zero + 1.0)
        slack += _OUTWARD * unit * float(tension[e] @ (lengths * (np.abs(opening) @ weights)) + excess[e] @ slip_size)
    return parts, slack


def slip_work(slip: FloatArray, shear: FloatArray, bound: FloatArray) -> FloatArray:
    """∫₀¹ s|j| + τ j dt (edges,) from Bernstein coefficients of slips j (edges, p + 1), and of τ and s (edges, q)."""
    products = product_integrals(slip.shape[1] - 1, shear.shape[1] - 1)
    signed = np.einsum("ei,ij,ej->e", slip, products, shear)
    return np.asarray(absolute_integrals(bound, slip) + signed)
