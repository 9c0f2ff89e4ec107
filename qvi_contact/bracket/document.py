"""A bracket as a document of plain values, and as text."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from qvi_contact.basics.shown import shown
from qvi_contact.basics.units import Units
from qvi_contact.bracket.outcome import Bracket
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
        "coulomb": _coulomb(bracket, units),
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
        kind = "" if bracket.coulomb is None else f", {bracket.coulomb.kind}"
        yield f"{name} between {bounds.lower:.9g} and {bounds.upper:.9g} {units.engineering_force}{kind}"
    for name, found in bracket.force_differences.items():
        normal, tangential = (shown(force, _least(bracket.own), 3) for force in (found.normal, found.tangential))
        forces = f"normal {normal}, tangential {tangential} {units.engineering_force}"
        yield f"displacement model with its own friction bound: forces of {name} differ by {forces}"
    companion = bracket.companion
    if companion is not None and companion.has_state:
        yield f"displacement model, degree {companion.degree}, {companion.unknowns} unknowns, same friction bound:"
        for name, contact in companion.contacts.items():
            both = (contact.normal_force, contact.tangential_force)
            normal, tangential = (shown(force, _least(companion)) for force in both)
            yield f"  contact {name}: normal {normal}, tangential {tangential} {units.engineering_force}"


def _coulomb(bracket: Bracket, units: Units) -> dict[str, Any] | None:
    """The bounds under Coulomb's law, or why there are none; None where nothing has Coulomb friction."""
    found = bracket.coulomb
    if found is None:
        return {"reason": units.filled(bracket.coulomb_reason)} if bracket.coulomb_reason else None
    return {
        "kind": found.kind,
        "reasons": [units.filled(reason) for reason in found.reasons],
        "places": [units.filled(place) for place in found.places],
        "friction_norm": _finite(found.norm.value),
        "relative_error": _finite(found.relative_error),
        "solutions_apart": _finite(found.apart),
    }


def _least(companion: CompanionResult | None) -> float:
    """Forces up to this are rounding."""
    return 0.0 if companion is None else companion.scales.rounding.force


def _quantity(value: float, unit: str) -> dict[str, Any]:
    return {"value": _finite(value), "unit": unit}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
