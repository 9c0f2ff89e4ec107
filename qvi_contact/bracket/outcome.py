"""The result of a bracket, also as a document of plain values and as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np

from qvi_contact.basics.checks import FloatArray
from qvi_contact.basics.schema import WithFields
from qvi_contact.bracket.coulomb import CoulombBounds, coulomb_bounds, reference_energy
from qvi_contact.bracket.parts import Bounds, EdgeParts
from qvi_contact.bracket.share import SharedStress, with_bernstein_rows
from qvi_contact.companion import CompanionResult
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.result import ContactResult
from qvi_contact.units import Certainty, Units, shown

_ROUNDING = 1e-9  # of the strain energy: lower − upper up to this size is rounding
_NOTHING = 1e-14  # of the strain energy: parts of the gap up to this size are rounding


class BracketKind(Enum):
    """The convex problem that the two energies bracket; the value is its name in messages."""

    PROBLEM = "the problem itself"
    GIVEN_BOUND = "the problem with the friction bound s = μ|σ_N| fixed at the computed pressure"


@dataclass(frozen=True)
class Uniqueness(WithFields):
    """How far another solution of the exact problem can be."""

    apart: float
    """Largest distance of two solutions in the energy norm of stresses, over that of the computed one: 0 where there is
    only one solution, infinite where nothing is known."""
    certainty: Certainty
    """Whether that is proved."""
    message: str
    """In words; where contacts alone hold a body, how near to the computed solution the others must be."""


@dataclass(frozen=True, eq=False, repr=False)
class Bracket(WithFields):
    """Bounds of the energy of a contact problem, and where in the mesh they differ; see `bracket` for the formulas."""

    kind: BracketKind
    """The problem that is bracketed, with the solution u, σ."""
    reasons: tuple[str, ...]
    """Why the bounds of the energy are not guaranteed; empty if they are."""
    lower: float
    upper: float
    """−J*(τ) and J(v) [stress × length²]; −∞ or ∞ where no admissible stress or displacement was found."""
    strain: float
    """½ ∫ τ : c : τ with the energy of springs, the reference for the gap [stress × length²]."""
    bulk: FloatArray
    """(cells,): ½ ∫ (τ − Cε(v)) : c : (τ − Cε(v)) on each cell, the constitutive-relation error, ≥ 0."""
    contacts: Mapping[str, EdgeParts]
    """The parts on the edges of each contact that is not tied, or has springs."""
    cell_gaps: FloatArray
    """(cells,): all parts by cell, ≥ 0, with the parts of its edges, of a joint half; 0 without a displacement."""
    slack: float
    """What violations that the solver left take off the lower bound: an estimate, twice their work with v for u."""
    driven: Mapping[str, Bounds]
    """If a single prescribed displacement drives the problem: bounds of the force there, from the energies."""
    result: ContactResult
    companion: CompanionResult
    """The stress τ and the displacement v."""
    coulomb: CoulombBounds | None = None
    """With Coulomb friction: bounds of errors of stresses, displacements and forces under Coulomb's law itself."""
    coulomb_reason: str = ""
    """With Coulomb friction, why there are no such bounds; else empty."""

    def __repr__(self) -> str:
        return f"<Bracket {self.message}>"

    @property
    def problem(self) -> ContactProblem:
        """The problem that is bracketed."""
        return self.result.problem

    @property
    def uniqueness(self) -> Uniqueness:
        """How far another solution of the problem can be: all are within the same bound of the computed stress."""
        coulomb = self._under_friction
        if self.kind is BracketKind.PROBLEM:
            message = "No contact has Coulomb friction: there is one stress only."
            return Uniqueness(0.0, Certainty.GUARANTEED, message)
        if coulomb is None:
            why = self.coulomb_reason if self.coulomb is None else self.coulomb.message
            return Uniqueness(float("inf"), Certainty.ESTIMATE, f"How far another solution can be is not known. {why}")
        share = 100.0 * coulomb.apart
        differ = f"differ by at most {share:.2g} % of" if share <= 100.0 else "may differ by more than"
        message = f"Any two solutions{coulomb.scope} {differ} the energy norm of the stresses ({coulomb.kind})."
        return Uniqueness(coulomb.apart, self.certainty, message)

    @property
    def certainty(self) -> Certainty:
        """Whether the bounds hold for the problem stated, up to rounding and the tolerance: "guaranteed" or "estimate".

        With Coulomb friction these are the bounds of `coulomb`, else those of the energies. Both have `reasons`.
        """
        coulomb = self._under_friction
        is_guaranteed = not self.reasons if coulomb is None else coulomb.guaranteed
        return Certainty.GUARANTEED if is_guaranteed else Certainty.ESTIMATE

    @property
    def guaranteed(self) -> bool:
        """Whether the bounds hold for the problem as it was stated."""
        return self.certainty is Certainty.GUARANTEED

    @property
    def _under_friction(self) -> CoulombBounds | None:
        return self.coulomb if self.coulomb is not None and np.isfinite(self.coulomb.within) else None

    @cached_property
    def forces(self) -> Mapping[str, Bounds]:
        """Bounds of forces [stress × length]: with Coulomb friction of `coulomb`, else also `driven`."""
        if self._under_friction is not None:
            return self._under_friction.forces
        if self.kind is not BracketKind.PROBLEM or not np.isfinite(self.lower):
            return self.driven
        stress = ContactResult(with_bernstein_rows(self.result.discretization), self.result.solution)
        errors = coulomb_bounds(SharedStress(stress, {}, (), stress), self.companion, self.reasons)
        return self.driven if isinstance(errors, str) else {**errors.forces, **self.driven}

    @property
    def gap(self) -> float:
        """Upper − lower ≥ 0 [stress × length²]."""
        return self.upper - self.lower

    @property
    def relative_error(self) -> float:
        """Bound of the error of τ in the energy norm, over the norm of τ: √(2 gap / ∫ τ:c:τ), or that of `coulomb`.

        If the body has no stress but rounding, the error is relative to the stress that its data suggest, `Scales`.
        Infinite without both energies, or if they contradict each other by more than rounding. On arcs, and where data
        contradict each other, the energies lack some work that the parts of the gap contain: the larger gap is taken.
        """
        if self._under_friction is not None:
            return self._under_friction.relative_error
        if not np.isfinite(self.gap) or self.gap < -_ROUNDING * self._reference:
            return float("inf")
        return float(np.sqrt(max(self.gap, float(self.cell_gaps.sum())) / self._reference))

    @property
    def _reference(self) -> float:
        """The reference of the gap [stress × length²]: the strain energy, or the unit's if the body has no stress."""
        return reference_energy(self.result, self.strain)

    @property
    def parts(self) -> dict[str, float]:
        """The gap by origin: "bulk", "contact", "friction", and "springs" if there are any [stress × length²].

        Parts of the size of rounding are 0. The mapping is empty where there is no gap.
        """
        if not np.isfinite(self.gap):
            return {}
        names = ["contact", "friction"] + ["springs"] * any(each.has_springs for each in self.problem.contacts)
        on_edges = {name: sum(getattr(part, name).sum() for part in self.contacts.values()) for name in names}
        parts = {"bulk": self.bulk.sum(), **on_edges}
        return {name: float(value) if value > _NOTHING * self.strain else 0.0 for name, value in parts.items()}

    @property
    def message(self) -> str:
        """The bounds in words, and the reasons why they are not guaranteed."""
        return self.sentence()

    def sentence(self, units: Units | None = None) -> str:
        """`message` with units."""
        units = units or Units()
        if self._under_friction is not None:
            return units.filled(self._under_friction.message)
        subject = "Bounds, guaranteed, for" if self.guaranteed else "Estimate, not a bound, for"
        bounds = f"energy between {self.lower:.9g} and {self.upper:.9g} {units.energy}"
        if not np.isfinite(self.lower):
            bounds = f"energy below {self.upper:.9g} {units.energy}, no lower bound"
        if not np.isfinite(self.upper):
            bounds = f"energy above {self.lower:.9g} {units.energy}, no upper bound"
        if not np.isfinite([self.lower, self.upper]).any():
            bounds = "no bound of the energy"
        error = ", a duality gap larger than the strain energy" if self._reference < self.gap < np.inf else ""
        if self._reference != self.strain:
            error = ", the stresses are rounding"
        elif self.relative_error <= 1.0:
            error = f", stresses within {100 * self.relative_error:.2g} % of their energy norm"
        text = f"{subject} {self.kind.value}: {bounds}{error}."
        under_friction = "" if self.coulomb is None else self.coulomb.message
        some = self.kind is not BracketKind.PROBLEM and np.isfinite([self.lower, self.upper]).any()
        last = "`refine` estimates errors all the same." if some else ""
        sentences = dict.fromkeys(
            (text, *map(units.filled, (*self.reasons, self.coulomb_reason, under_friction)), last)
        )
        return " ".join(filter(None, sentences))


def document(bracket: Bracket, units: Units | None = None) -> dict[str, Any]:
    """A bracket as values that JSON can hold; a missing bound is None.

    Energies and their parts are ``{"value": …, "unit": …}``, forces ``{"lower": …, "upper": …, "unit": …}``.
    """
    units = units or Units()
    energy = {"lower": bracket.lower, "upper": bracket.upper, "strain": bracket.strain}
    bounds, companion, coulomb = bracket.coulomb, bracket.companion, None

    def finite(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    if bounds is not None:
        coulomb = {
            "kind": bounds.kind,
            "reasons": [units.filled(reason) for reason in bounds.reasons],
            "places": [units.filled(place) for place in bounds.places],
            "friction_norm": finite(bounds.norm.value),
            "relative_error": finite(bounds.relative_error),
            "likely_error": None if bounds.likely is None else finite(bounds.likely.relative_error),
            "solutions_apart": finite(bounds.apart),
            "reach": finite(bounds.reach),
        }
    elif bracket.coulomb_reason:
        coulomb = {"reason": units.filled(bracket.coulomb_reason)}
    return {
        "problem": bracket.kind.name.lower().replace("_", " "),
        "guaranteed": bracket.guaranteed,
        "certainty": str(bracket.certainty),
        "reasons": [units.filled(reason) for reason in bracket.reasons],
        "message": bracket.sentence(units),
        "energies": {name: {"value": finite(value), "unit": units.energy} for name, value in energy.items()},
        "gap": {name: {"value": value, "unit": units.energy} for name, value in bracket.parts.items()},
        "relative_error": finite(bracket.relative_error),
        "forces": {name: {**each._asdict(), "unit": units.force} for name, each in bracket.forces.items()},
        "coulomb": coulomb,
        "companion": {"status": str(companion.status), "degree": companion.degree, "unknowns": companion.unknowns},
    }


def lines(bracket: Bracket, units: Units | None = None) -> Iterator[str]:
    """Bounds, their parts, and forces, also of the displacement model, as lines for a terminal."""
    units = units or Units()
    yield bracket.sentence(units)
    parts = ", ".join(f"{name} {value:.3g}" for name, value in bracket.parts.items())
    if parts:
        yield f"duality gap [{units.energy}]: {parts}"
    estimated = None if bracket.coulomb is None else bracket.coulomb.likely
    likely = {} if estimated is None else estimated.forces
    for name, bounds in bracket.forces.items():
        kind = "" if bracket.coulomb is None else f", {bracket.coulomb.kind}"
        if name in likely:
            kind += f"; estimate: {likely[name].lower:.9g} to {likely[name].upper:.9g}"
        yield f"{name} between {bounds.lower:.9g} and {bounds.upper:.9g} {units.force}{kind}"
    companion = bracket.companion
    if companion.has_state:
        yield f"displacement model, degree {companion.degree}, {companion.unknowns} unknowns, same friction bound:"
        for name, contact in companion.contacts.items():
            both = (contact.normal_force, contact.tangential_force)
            normal, tangential = (shown(force, companion.scales.rounding.force) for force in both)
            yield f"  contact {name}: normal {normal}, tangential {tangential} {units.force}"
