"""Bounds of the errors of stress and displacement under Coulomb's law, whatever sticks, slips or opens.

In `docs/theory.md`: (D26), (D27), (D28).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.coulomb_forces import coulomb_force_bounds
from qvi_contact.bracket.friction_norm import (
    LARGEST,
    FrictionNorm,
    amplification,
    coercivity,
    defect_bound,
    error_bound,
    friction_norm,
)
from qvi_contact.bracket.parts import (
    Bounds,
    CellFields,
    EdgeParts,
    bulk,
    by_cell,
    contact_tractions,
    edge_parts,
    law_bound,
    strain_energy,
    traction_coefficients,
)
from qvi_contact.bracket.share import Share, SharedStress
from qvi_contact.companion import CompanionResult
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.work import rest_on_arcs

ADMISSIBLE = 1e-6
"""Largest violation of the contact law by a stress, relative to the largest contact traction."""

_BACKWARDS = 1e-12  # of the displacements: what is no slip against the share
_OUTWARD = 2.0  # safety of the work of violations that are left: v stands for u

_Laws: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Coefficients (e, q) of τ_N, τ_T and the bound that τ_N itself gives."""


@dataclass(frozen=True, eq=False, repr=False)
class CoulombBounds:
    """Bounds of the errors under Coulomb's law.

    For every solution u, σ of the problem stated, with the stress τ of the result and the displacement v of a bracket,
    in energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F + |η|,    |u − v| ≤ F.

    Attributes
    ----------
    shares : mapping
        s = −τ_T/(c + μ|τ_N|) by contact with Coulomb friction, continuous along it.
    norm : FrictionNorm
        The norm of R for s and μ, and whether it is proved.
    residual : float
        ρ = |τ + η − Cε(v)| [√energy].
    defect : float
        δ = ∫ |τ_N| (g − v_N) ds, what the solver left of violations included [stress × length²].
    within : float
        F [√energy]; infinite where the norm is not below 2.
    moved : float
        |η| of the change of the stress that makes s continuous [√energy].
    size : float
        |τ + η| [√energy].
    cells : (cells,) array
        f²ρ² + δ/α by cell [stress × length²], what to refine by.
    reasons : tuple of str
        Why the bounds are not guaranteed; empty if they are.
    places : tuple of str
        Where no R exists but for s = 0, although the contact slips there; a sentence for each.
    stress, displacement : ContactResult, CompanionResult
        τ + η and v.

    """

    shares: Mapping[str, Share]
    norm: FrictionNorm
    residual: float
    defect: float
    within: float
    moved: float
    size: float
    cells: FloatArray
    reasons: tuple[str, ...]
    places: tuple[str, ...]
    stress: ContactResult
    displacement: CompanionResult

    def __repr__(self) -> str:
        return f"<CoulombBounds {self.message}>"

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """The bounds of "NAME.normal_force" and "NAME.tangential_force" of contacts between bounds [stress × length].

        A dual problem is solved on first use. A force is left out where that gives none, see (D31).
        """
        missed = defect_bound(self.residual, self.defect, self.norm.value)
        return coulomb_force_bounds(self.stress, self.displacement, self.shares, self.within, missed, self.norm.proved)

    @property
    def error(self) -> float:
        """F + |η| [√energy], which bounds the errors of the result's stress and of the displacement."""
        return self.within + self.moved

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
        """(F + |η|)/|τ + η|."""
        return self._relative(self.error)

    @property
    def apart(self) -> float:
        """2F/|τ + η|: any two solutions are at most that far from each other, in the energy norm of stresses."""
        return self._relative(2.0 * self.within)

    def _relative(self, error: float) -> float:
        return error / self.size if self.size > 0.0 else float("inf") if error > 0.0 else 0.0

    @property
    def message(self) -> str:
        """What is bounded, how well, and why it is not guaranteed, if it is not."""
        known = "Guaranteed" if self.guaranteed else "Estimated"
        bound = (
            f"{known} bound under friction: stresses within {100.0 * self.relative_error:.2g} % of their energy norm."
        )
        if not np.isfinite(self.within):
            return f"No bound under friction. {self.norm.reason}"
        return " ".join([bound, *self.reasons, *self.places[:1]])


def coulomb_bounds(
    stress: SharedStress, companion: CompanionResult, before: ContactResult, reasons: tuple[str, ...] = ()
) -> CoulombBounds | str:
    """T5 with T2: the bounds from a stress and a displacement, or why these two say nothing.

    Parameters
    ----------
    stress : SharedStress
        τ + η, with Bernstein coefficients as rows.
    companion : CompanionResult
        v, of the same problem on the same mesh, which slips as the shares allow.
    before : ContactResult
        τ.
    reasons : tuple of str
        Why neither is exactly admissible.

    """
    result, shares = stress.result, stress.shares
    laws = _laws(result)
    refusal = _stress_refused(result, laws) or _displacement_refused(companion, shares)
    if refusal:
        return refusal
    discretization = result.discretization
    problem = discretization.problem
    fields = CellFields.of(discretization, result.dofs, companion.degree)
    own = CellFields.of(discretization, before.dofs, companion.degree)
    change = CellFields(fields.weights, fields.stress - own.stress, fields.t)
    inside = bulk(fields, problem.compliances, companion.cell_strain(*fields.t[:, -2:].T))
    edges, slack = _defects(result, laws, companion)
    norm = friction_norm(problem, shares)
    residual, defect = float(np.sqrt(2.0 * inside.sum())) + _on_arcs(result), slack
    defect += float(sum(part.contact.sum() + part.friction.sum() for part in edges.values()))
    s = norm.value
    parts = 0.0 * inside
    if s < LARGEST:
        on_edges = by_cell(discretization, 0.0 * inside, edges)
        parts = 2.0 * amplification(s) ** 2 * inside + on_edges / coercivity(s)
    return CoulombBounds(
        shares,
        norm,
        residual,
        defect,
        error_bound(residual, defect, s),
        float(np.sqrt(2.0 * strain_energy(change, problem.compliances))),
        float(np.sqrt(2.0 * strain_energy(fields, problem.compliances))),
        parts,
        (*reasons, *(() if norm.proved else (norm.reason,))),
        stress.places,
        result,
        companion,
    )


def _on_arcs(stress: ContactResult) -> float:
    """An estimate of the energy norm of what is left of tractions on arcs: a traction k on an edge h has k h √c."""
    mesh = stress.problem.mesh
    arcs = [edges.take(edges.bent).length for edges in (mesh.boundary, mesh.interior) if edges.curved]
    if not arcs:
        return 0.0
    rest, soft = rest_on_arcs(stress.discretization, stress.dofs), float(stress.problem.compliances[:, 0, 0].max())
    return rest * float(np.sqrt(soft * (np.concatenate(arcs) ** 2).sum()))


def _stress_refused(stress: ContactResult, laws: _Laws) -> str:
    """Why a stress is not admissible; empty if it is."""
    for name, (excess, pull) in _violations(stress, laws).items():
        if excess > ADMISSIBLE or pull > ADMISSIBLE:
            return f"The stress does not obey the law of contact {name!r} on whole edges."
    return ""


def _displacement_refused(companion: CompanionResult, shares: Mapping[str, Share]) -> str:
    """Why a displacement is none of those that (D27) is for; empty if it is."""
    assert companion.state is not None
    contacts, c = companion.state.contacts, companion.state.c
    n, size, start = contacts.count, max(1.0, float(np.abs(c).max(initial=0.0))), 0
    for trace in contacts.traces:
        chosen = slice(start, start + trace.count)
        over, slip = c[:n][chosen] - trace.gap, c[n:][chosen] - trace.offset
        if (trace.law == "unilateral" or trace.name in shares) and over.max() > _BACKWARDS * size:
            return f"The displacement passes the obstacle of contact {trace.name!r}."
        if trace.name in shares:
            wanted = trace.slipping_on(shares[trace.name].slipping)
            wrong = np.where(wanted == 0.0, np.abs(slip), -wanted * slip) > _BACKWARDS * size
            if wrong.any():
                x, y = trace.places[int(wrong.argmax())] * companion.scales.length + companion.problem.mesh.origin
                return (
                    f"Supports make {trace.name!r} slip at ({x:.6g}, {y:.6g}), where friction does not reach its bound."
                )
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
