"""Bounds of the errors of stress and displacement under Coulomb's law, whatever sticks, slips or opens.

In `docs/theory.md`: (D26), (D27), (D28).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.bracket.coulomb_forces import coulomb_force_bounds
from qvi_contact.bracket.friction_norm import (
    LARGEST,
    UNHELD,
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
    EdgeTractions,
    bulk,
    by_cell,
    edge_parts,
    strain_energy,
)
from qvi_contact.bracket.share import Share, SharedStress
from qvi_contact.companion import CompanionResult
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import rest_on_arcs

ADMISSIBLE = 1e-6
"""Largest violation of the contact law by a stress, relative to the largest contact traction."""

_BACKWARDS = 1e-12  # of the displacements: what is no slip against the share


@dataclass(frozen=True, eq=False, repr=False)
class CoulombBounds:
    """Bounds of the errors under Coulomb's law.

    For every solution u, σ of the problem stated, with the stress τ of the result and the displacement v of a bracket,
    in energy norms |τ|² = ∫ τ : c : τ and |v|² = ∫ ε(v) : C : ε(v),

        |σ − τ| ≤ F + |η|,    |u − v| ≤ F.

    Where friction alone holds a body along its contacts that is so for solutions with |σ − τ| ≤ `reach` |τ + η| only.

    Attributes
    ----------
    shares : mapping
        s = −τ_T/(c + μ|τ_N|) by contact with Coulomb friction, continuous along it.
    norm : FrictionNorm
        The norm of R for s and μ, and whether it is proved.
    residual : float
        ρ = |τ + η − Cε(v)| [√energy], what springs miss included.
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
        missed, stopped = defect_bound(self.residual, self.defect, self.norm.value), self.norm.stopped
        if stopped is not None and np.isfinite(self.within):
            missed += stopped.work(self.shares, self.within, missed)
        return coulomb_force_bounds(self, missed)

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

    @property
    def reach(self) -> float:
        """How far from τ solutions are of which the bounds hold, over |τ + η|; infinite where they hold for all."""
        stopped = self.norm.stopped
        return float("inf") if stopped is None else self._relative(max(stopped.reach - self.moved, 0.0))

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
        near = ""
        if np.isfinite(self.reach):
            near = f"It holds for solutions within {100.0 * self.reach:.3g} %, as friction alone holds a body."
        return " ".join(filter(None, [bound, near, *self.reasons, *self.places[:1]]))


def coulomb_bounds(
    stress: SharedStress, companion: CompanionResult, reasons: tuple[str, ...] = ()
) -> CoulombBounds | str:
    """T5 with T2: the bounds from a stress and a displacement, or why these two say nothing.

    The stress τ + η has Bernstein coefficients as rows; the displacement v is one of the same problem on the same mesh,
    and slips as the shares allow. Reasons say why neither is exactly admissible.
    """
    result, shares, known = stress.result, stress.shares, stress.result.discretization
    own, unit = EdgeTractions.of(known, result.dofs), known.scales.stress
    excess, tension = left = own.violations(own.bound, known.qvi.bilateral)
    for rows in known.contacts:
        if rows.law != "tied" and max(excess[rows.edges].max(), tension[rows.edges].max()) > ADMISSIBLE * own.size:
            return f"The stress does not obey the law of contact {rows.name!r} on whole edges."
    refusal = _displacement_refused(companion, shares)
    if refusal:
        return refusal
    problem = known.problem
    fields, before = (CellFields.of(known, each.dofs, companion.degree) for each in (result, stress.before))
    edges, slack, _ = edge_parts(fields, known, own, own.bound, left, companion)
    inside = bulk(fields, problem.compliances, companion.cell_strain(*fields.t[:, -2:].T))
    inside += by_cell(problem, {name: part.springs for name, part in edges.items()})
    missed = {name: np.maximum(part.contact, 0.0) + np.maximum(part.friction, 0.0) for name, part in edges.items()}
    norm = friction_norm(problem, shares, unit)
    residual = float(np.sqrt(2.0 * inside.sum()))
    arcs = [lines.take(lines.bent).length for lines in (problem.mesh.boundary, problem.mesh.interior) if lines.curved]
    if arcs:  # an estimate of the energy norm of what is left there: a traction k on an edge h has k h √c
        rest, soft = rest_on_arcs(known, result.dofs), float(problem.compliances[:, 0, 0].max())
        residual += rest * float(np.sqrt(soft * (np.concatenate(arcs) ** 2).sum()))
    defect = slack + float(sum(part.sum() for part in missed.values()))
    s, cells = norm.value, 0.0 * inside
    error = error_bound(residual, defect, s)
    size = float(np.sqrt(2.0 * strain_energy(fields, problem.compliances)))
    if norm.stopped is not None and error >= norm.stopped.reach:
        near, apart = (100.0 * value / size for value in (norm.stopped.reach, error))
        what = f"what sticks stops it for solutions within {near:.2g} % of this one, less than the bound {apart:.2g} %"
        norm, error = replace(norm, reason=UNHELD.format(what)), np.inf
    if s < LARGEST:
        cells = 2.0 * amplification(s) ** 2 * inside + by_cell(problem, missed) / coercivity(s)
    return CoulombBounds(
        shares,
        norm,
        residual,
        defect,
        error,
        float(np.sqrt(2.0 * strain_energy(fields.less(before), problem.compliances))),
        size,
        cells,
        (*reasons, *(() if norm.proved else (norm.reason,))),
        stress.places,
        result,
        companion,
    )


def _displacement_refused(companion: CompanionResult, shares: Mapping[str, Share]) -> str:
    """Why a displacement is none of those that (D27) is for; empty if it is."""
    assert companion.state is not None
    contacts, c = companion.state.contacts, companion.state.c
    n, size = contacts.count, max(1.0, float(np.abs(c).max(initial=0.0)))
    for trace in contacts.traces:
        over, slip = c[:n][trace.here] - trace.gap, c[n:][trace.here] - trace.offset
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
    return ""
