"""Bounds of the errors of stress and displacement under Coulomb's law, where every contact slips in one sense.

In `docs/theory.md`: (D26), (D27).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket import slip_constants
from qvi_contact.bracket.friction_norm import FrictionNorm, friction_norm
from qvi_contact.bracket.law import contact_tractions, law_bound, traction_coefficients
from qvi_contact.bracket.outcome import Bounds, EdgeParts
from qvi_contact.bracket.parts import CellFields, bulk, by_cell, edge_parts, strain_energy
from qvi_contact.bracket.senses import LEAST_MARGIN, margin_of
from qvi_contact.bracket.slip_forces import force_bounds_under_slip
from qvi_contact.companion import CompanionResult
from qvi_contact.solution.result import ContactResult

ADMISSIBLE = 1e-6
"""Largest violation of the contact law by a stress, relative to the largest contact traction."""

_BACKWARDS = 1e-12  # of the displacements: what is no slip against the sense
_OUTWARD = 2.0  # safety of the work of violations that are left: v stands for u

_Laws: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Coefficients (e, q) of τ_N, τ_T and the bound that τ_N itself gives."""


@dataclass(frozen=True, eq=False, repr=False)
class SlipBounds:
    """Bounds of the errors under Coulomb's law with one sense of slip on each contact.

    For the solution u, σ of the problem in which contacts can slip in that sense only, with the stress τ and the
    displacement v of a bracket, in energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F,    |u − v| ≤ F.

    It solves the problem stated if its friction is within the bound in the other sense too. `margin` says by how much
    the computed stress is.

    Attributes
    ----------
    senses : mapping
        By contact with Coulomb friction 1 where the body slips along the tangent, −1 where against it.
    margin : float
        1 − max sense τ_T/(c + μ|τ_N|) ≥ 0, by Bernstein coefficients.
    norm : FrictionNorm
        The number s, and whether it is proved.
    residual : float
        ρ = |τ − Cε(v)| [√energy].
    defect : float
        δ = ∫ κ(τ) |v_T − w| + |τ_N| (g − v_N) ds, what the solver left of violations included [stress × length²].
    error : float
        F [√energy]; infinite for s ≥ 2.
    size : float
        |τ| [√energy].
    cells : (cells,) array
        f²ρ² + δ/α by cell [stress × length²], what to refine by.
    reasons : tuple of str
        Why the bounds are not guaranteed; empty if they are.
    stress, displacement : ContactResult, CompanionResult
        τ and v.

    """

    senses: Mapping[str, int]
    margin: float
    norm: FrictionNorm
    residual: float
    defect: float
    error: float
    size: float
    cells: FloatArray
    reasons: tuple[str, ...]
    stress: ContactResult
    displacement: CompanionResult

    def __repr__(self) -> str:
        return f"<SlipBounds {self.message}>"

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """The bounds of "NAME.normal_force" and "NAME.tangential_force" of contacts between bounds [stress × length].

        A dual problem is solved on first use. A force is left out where that gives none, see (D31).
        """
        missed = slip_constants.defect_bound(self.residual, self.defect, self.norm.value)
        return force_bounds_under_slip(self.stress, self.displacement, self.senses, self.error, missed)

    @property
    def guaranteed(self) -> bool:
        """Whether the bounds are proved, up to rounding and the tolerance; "estimated" otherwise."""
        return not self.reasons

    @property
    def kind(self) -> str:
        """The word "guaranteed" or "estimated"."""
        return "guaranteed" if self.guaranteed else "estimated"

    @property
    def relative_error(self) -> float:
        """F/|τ|."""
        return self.error / self.size if self.size > 0.0 else float("inf") if self.error > 0.0 else 0.0

    @property
    def assumption(self) -> str:
        """What the bounds take for granted, in words."""
        return (
            "They assume that each contact slips in one sense only. The computed stress stays below the friction bound "
            f"of the other sense by {100.0 * self.margin:.3g} % of it or more."
        )

    @property
    def message(self) -> str:
        """What is bounded, how well, and why it is not guaranteed, if it is not."""
        known = "Guaranteed" if self.guaranteed else "Estimated"
        bound = f"{known} bound under slip: stresses within {100.0 * self.relative_error:.2g} % of their energy norm."
        if not np.isfinite(self.error):
            return f"No bound under slip. {self.norm.reason}"
        return " ".join([bound, self.assumption, *self.reasons])


def slip_bounds(
    stress: ContactResult, companion: CompanionResult, senses: Mapping[str, int], reasons: tuple[str, ...] = ()
) -> SlipBounds | str:
    """The bounds from a stress and a displacement, or why these two say nothing.

    Parameters
    ----------
    stress : ContactResult
        τ, with Bernstein coefficients as rows.
    companion : CompanionResult
        v, of the same problem on the same mesh.
    senses : mapping
        By contact with Coulomb friction 1 or −1.
    reasons : tuple of str
        Why neither is exactly admissible.

    """
    laws, margin = _laws(stress), margin_of(stress, senses)
    refusal = _stress_refused(stress, laws, margin) or _displacement_refused(companion, senses)
    if refusal:
        return refusal
    discretization, u = stress.discretization, stress.dofs
    problem = discretization.problem
    fields = CellFields.of(discretization, u, companion.degree)
    inside = bulk(fields, problem.compliances, companion.cell_strain(*fields.t[:, -2:].T))
    edges, slack = _defects(stress, laws, companion)
    norm = friction_norm(problem, senses)
    residual, defect = float(np.sqrt(2.0 * inside.sum())), slack
    defect += float(sum(part.contact.sum() + part.friction.sum() for part in edges.values()))
    s = norm.value
    shares = 0.0 * inside
    if s < slip_constants.LARGEST:
        on_edges = by_cell(discretization, 0.0 * inside, edges)
        shares = 2.0 * slip_constants.amplification(s) ** 2 * inside + on_edges / slip_constants.coercivity(s)
    return SlipBounds(
        senses,
        margin,
        norm,
        residual,
        defect,
        slip_constants.error_bound(residual, defect, s),
        float(np.sqrt(2.0 * strain_energy(fields, problem.compliances))),
        shares,
        (*reasons, *(() if norm.proved else (norm.reason,))),
        stress,
        companion,
    )


def _stress_refused(stress: ContactResult, laws: _Laws, margin: float) -> str:
    """Why a stress is not admissible; empty if it is."""
    for name, (excess, pull) in _violations(stress, laws).items():
        if excess > ADMISSIBLE or pull > ADMISSIBLE:
            return f"The stress does not obey the law of contact {name!r} on whole edges."
    return "The stress reaches its friction bound in the other sense too." if margin < LEAST_MARGIN else ""


def _displacement_refused(companion: CompanionResult, senses: Mapping[str, int]) -> str:
    """Why a displacement is not in K; empty if it is."""
    assert companion.state is not None
    contacts, c = companion.state.contacts, companion.state.c
    n, size, start = contacts.count, max(1.0, float(np.abs(c).max(initial=0.0))), 0
    for trace in contacts.traces:
        chosen = slice(start, start + trace.count)
        over, slip = c[:n][chosen] - trace.gap, c[n:][chosen] - trace.offset
        if (trace.law == "unilateral" or trace.name in senses) and over.max() > _BACKWARDS * size:
            return f"The displacement passes the obstacle of contact {trace.name!r}."
        if trace.name in senses and (senses[trace.name] * slip).min() < -_BACKWARDS * size:
            return f"The displacement slips on contact {trace.name!r} against the sense of the others."
        start += trace.count
    return ""


def _violations(stress: ContactResult, laws: _Laws) -> dict[str, tuple[float, float]]:
    """By contact that is not tied the largest (|τ_T| − s)⁺ and τ_N⁺ of Bernstein coefficients, over all tractions."""
    known = stress.discretization
    normal, shear, bound = laws
    unit = max(float(np.abs(normal).max(initial=0.0)), float(np.abs(shear).max(initial=0.0)), 1e-300)
    found = {}
    for rows in known.contacts:
        if rows.law != "tied":
            e = rows.edges
            pull = float(normal[e].max()) if rows.law == "unilateral" else 0.0
            found[rows.name] = (float((np.abs(shear[e]) - bound[e]).max()) / unit, pull / unit)
    return found


def _laws(stress: ContactResult) -> _Laws:
    """Bernstein coefficients (e, q) of τ_N, τ_T and the bound that τ_N itself gives, on all edges with rows."""
    known = stress.discretization
    if not known.qvi.m:
        return (np.zeros((0, 1)),) * 3
    at_points = contact_tractions(known, stress.dofs)
    return *traction_coefficients(known, at_points), law_bound(known, at_points[0])[0]


def _defects(stress: ContactResult, laws: _Laws, companion: CompanionResult) -> tuple[dict[str, EdgeParts], float]:
    """The parts of δ on edges, each ≥ 0, and what violations of the law that the solver left may add."""
    known, unit = stress.discretization, stress.discretization.scales.stress
    normal, shear, bound = laws
    found, slack = {}, 0.0
    for rows in known.contacts:
        if rows.law == "tied":
            continue
        e = rows.edges
        parts, opening, slip = edge_parts(known, rows, unit * normal[e], unit * shear[e], unit * bound[e], companion)
        found[rows.name] = EdgeParts(np.maximum(parts.contact, 0.0), np.maximum(parts.friction, 0.0))
        excess = np.maximum((np.abs(shear[e]) - bound[e]).max(axis=1), 0.0)
        pull = np.maximum(normal[e].max(axis=1), 0.0) if rows.law == "unilateral" else 0.0 * excess
        slack += _OUTWARD * unit * float(pull @ opening + excess @ slip)
    return found, slack
