"""A bracket as a document of plain values, and as text."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from qvi_contact.basics.shown import shown
from qvi_contact.basics.units import Units
from qvi_contact.bracket.outcome import Bracket, BracketKind
from qvi_contact.companion import CompanionResult


def document(bracket: Bracket, units: Units | None = None) -> dict[str, Any]:
    """What JSON can hold of a bracket; a bound that is missing is None.

    Energies and their parts are ``{"value": …, "unit": …}``, forces ``{"lower": …, "upper": …, "unit": …}``.
    """
    units = units or Units()
    energy = {"lower": bracket.lower, "upper": bracket.upper, "strain": bracket.strain, "outer": bracket.outer}
    companion = bracket.companion
    return {
        "problem": bracket.kind.name.lower().replace("_", " "),
        "guaranteed": bracket.guaranteed,
        "certainty": str(bracket.certainty),
        "reasons": [units.filled(reason) for reason in bracket.reasons],
        "message": bracket.sentence(units),
        "energies": {name: _quantity(value, units.energy) for name, value in energy.items()},
        "gap": {name: _quantity(value, units.energy) for name, value in bracket.shown_parts.items()},
        "relative_error": _finite(bracket.relative_error),
        "forces": {
            name: {"lower": bounds.lower, "upper": bounds.upper, "unit": units.force}
            for name, bounds in bracket.forces.items()
        },
        "force_differences": {
            name: {"normal": found.normal, "tangential": found.tangential, "unit": units.force}
            for name, found in bracket.force_differences.items()
        },
        "slip": _slip(bracket, units),
        "companion": None
        if companion is None
        else {"status": str(companion.status), "degree": companion.degree, "unknowns": companion.unknowns},
    }


def lines(bracket: Bracket, units: Units | None = None) -> Iterator[str]:
    """Bounds, their parts, forces, and the same forces by displacements, for a terminal."""
    units = units or Units()
    yield bracket.sentence(units)
    parts = ", ".join(f"{name} {value:.3g}" for name, value in bracket.shown_parts.items())
    if parts:
        yield f"duality gap [{units.engineering_energy}]: {parts}"
    if parts and bracket.outer > 0.0:
        yield f"error from fixing the friction bound: up to {bracket.outer:.3g} {units.engineering_energy}"
    for name, bounds in bracket.forces.items():
        yield f"{name} between {bounds.lower:.9g} and {bounds.upper:.9g} {units.engineering_force}"
    for name, found in bracket.force_differences.items():
        normal, tangential = (shown(force, _least(bracket.own), 3) for force in (found.normal, found.tangential))
        forces = f"normal {normal}, tangential {tangential} {units.engineering_force}"
        yield f"displacement model with its own friction bound: forces of {name} differ by {forces}"
    yield from _slip_lines(bracket, units)
    companion = bracket.companion
    if companion is not None and companion.has_state:
        yield f"displacement model, degree {companion.degree}, {companion.unknowns} unknowns, same friction bound:"
        for name, contact in companion.contacts.items():
            both = (contact.normal_force, contact.tangential_force)
            normal, tangential = (shown(force, _least(companion)) for force in both)
            yield f"  contact {name}: normal {normal}, tangential {tangential} {units.engineering_force}"


def _slip(bracket: Bracket, units: Units) -> dict[str, Any] | None:
    """The bounds under slip, or why there are none; None where nothing has Coulomb friction, or nothing slips."""
    slip = bracket.slip
    if _needs_no_slip(bracket):
        return None
    if slip is None:
        return {"reason": units.filled(bracket.slip_reason)} if bracket.slip_reason else None
    return {
        "kind": slip.kind,
        "reasons": [units.filled(reason) for reason in slip.reasons],
        "assumption": slip.assumption,
        "senses": dict(slip.senses),
        "margin": slip.margin,
        "friction_norm": _finite(slip.norm.value),
        "relative_error": _finite(slip.relative_error),
        "forces": {
            name: {"lower": bounds.lower, "upper": bounds.upper, "unit": units.force}
            for name, bounds in slip.forces.items()
        },
    }


def _needs_no_slip(bracket: Bracket) -> bool:
    """Whether nothing slips, so that the bounds of tied contacts are all there is to say."""
    missing = bracket.slip is None or not np.isfinite(bracket.slip.error)
    return bracket.kind is BracketKind.STICKING and missing


def _slip_lines(bracket: Bracket, units: Units) -> Iterator[str]:
    """The bounds under slip, or why there are none."""
    if _needs_no_slip(bracket):
        return
    if bracket.slip_reason:
        yield f"no bounds under Coulomb slip: {units.filled(bracket.slip_reason)}"
    if bracket.slip is not None:
        yield units.filled(bracket.slip.message)
        for name, bounds in bracket.slip.forces.items():
            force = f"{bounds.lower:.9g} and {bounds.upper:.9g} {units.engineering_force}"
            yield f"{name} between {force}, {bracket.slip.kind}"


def _least(companion: CompanionResult | None) -> float:
    """Forces up to this are rounding."""
    return 0.0 if companion is None else companion.scales.rounding.force


def _quantity(value: float, unit: str) -> dict[str, Any]:
    return {"value": _finite(value), "unit": unit}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
