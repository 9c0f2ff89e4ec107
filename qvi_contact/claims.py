"""What a result says, beside what its problem, unknowns and multipliers give when all is computed anew."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from qvi_contact.checks import evaluate
from qvi_contact.conditions import Traction
from qvi_contact.discretization import Discretization, discretize
from qvi_contact.export import airy_units, field_arrays
from qvi_contact.loads import LOAD_POINTS, physical
from qvi_contact.result import ContactResult
from qvi_contact.traces import EdgePoints
from solvers import Certificate, FrictionQVI, certify
from solvers.certificate import EXPONENTS
from solvers.factorisation import FactorisationError

AGREEMENT: Final = 1e-8
"""What a number may differ from the one computed anew: of its own size and 1e-4 of the largest of its kind."""

_FLOOR: Final = 1e-4
_ROUNDING: Final = 1e-14  # share of the terms of a traction that is rounding
_MATRICES: Final = ("K", "N", "T", "A")
_VECTORS: Final = ("f", "n0", "t0", "mu", "W", "b", "cohesion", "cap", "bilateral")


@dataclass(frozen=True, eq=False)
class Recomputed:
    """A result made again from its problem, unknowns and multipliers.

    Attributes
    ----------
    result : with the certificate computed anew, on the problem discretised anew
    stress, displacement, energy : units of what is compared [stress], [length], [stress × length²]
    rounding : what the rounding of the unknowns may change in a traction [stress]

    """

    result: ContactResult
    stress: float
    displacement: float
    energy: float
    rounding: float


def rediscretized(result: ContactResult) -> Discretization:
    """The problem of a result discretised anew, in its units, with its nodes given up and the slip before it."""
    known = result.discretization
    fresh = discretize(known.problem, scales=known.scales, freed=known.freed)
    slip = [rows.offset - new.offset for rows, new in zip(known.contacts, fresh.contacts, strict=True)]
    return fresh.slipped(slip) if any(part.any() for part in slip) else fresh


def recompute(result: ContactResult, fresh: Discretization, tolerance: float) -> Recomputed:
    """Evaluate and certify again; nothing but unknowns and multipliers of the result is taken over."""
    solution, scales = result.solution, fresh.scales
    qvi = fresh.qvi.strictly() if solution.problem.strict else fresh.qvi
    certificate = _certified(qvi, result, tolerance)
    again = ContactResult(fresh, replace(solution, problem=qvi, certificate=certificate))
    units = certificate.scales
    z = np.abs(solution.z) if result.has_state else np.zeros(qvi.n)
    rounding = max(float((abs(rows) @ z).max(initial=0.0)) for rows in (qvi.N, qvi.T))
    return Recomputed(
        again,
        units.get("stress", 1.0) * scales.stress,
        units.get("displacement", 1.0) * scales.displacement,
        units.get("body_energy", 1.0) * scales.energy,
        _ROUNDING * rounding * scales.stress,
    )


def _certified(qvi: FrictionQVI, result: ContactResult, tolerance: float) -> Certificate:
    """The certificate; nothing passes where the linear system cannot be solved."""
    solution = result.solution
    parts = (
        solution.z,
        solution.normal_multiplier,
        solution.tangential_multiplier,
        solution.equality_multiplier,
    )
    try:
        _ = qvi.bonded_error  # chooses the factorisation that the problem needs
        return certify(qvi, *parts, tolerance=tolerance)
    except FactorisationError:
        return Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)


def difference(claimed: Any, computed: Any, unit: float = 0.0, rounding: float = 0.0) -> float:
    """Largest difference of two arrays, each relative to its own entry and 1e-4 of the largest, or of the `unit`.

    Differences below `rounding` are none. What is infinite or NaN has to be so in both. Of integers, flags and texts
    the number of entries that differ; infinity for arrays of different shape or kind.
    """
    a, b = np.asarray(claimed), np.asarray(computed)
    if a.shape != b.shape or (a.dtype.kind == "f") != (b.dtype.kind == "f"):
        return np.inf
    if b.dtype.kind != "f":
        return float(np.count_nonzero(a != b))
    finite = np.isfinite(b)
    same = np.where(np.isnan(b), np.isnan(a), a == b)
    if not (same | finite).all() or not np.isfinite(a[finite]).all():
        return np.inf
    a, b = a[finite], b[finite]
    scale = np.abs(b) + _FLOOR * max(float(np.abs(b).max(initial=0.0)), unit)
    apart = np.maximum(np.abs(a - b) - rounding, 0.0)
    return float((apart / np.where(scale > 0.0, scale, 1.0)).max(initial=0.0))


def problem_difference(claimed: FrictionQVI, computed: FrictionQVI) -> float:
    """Largest difference of the data of two algebraic problems, relative to the largest entry of each."""
    if claimed.strict != computed.strict:
        return np.inf
    found = [0.0]
    for name in _MATRICES:
        a, b = getattr(claimed, name), getattr(computed, name)
        if a.shape != b.shape:
            return np.inf
        found.append(float(abs(a - b).max() / (abs(b).max() or 1.0)) if b.shape[0] * b.shape[1] else 0.0)
    for name in _VECTORS:
        a, b = (np.asarray(getattr(qvi, name), dtype=np.float64) for qvi in (claimed, computed))
        finite = np.isfinite(b)
        if not np.array_equal(a[~finite], b[~finite]):
            return np.inf
        apart = float(np.abs(a[finite] - b[finite]).max(initial=0.0))
        found.append(apart / (float(np.abs(b[finite]).max(initial=0.0)) or 1.0))
    return max(found)


def worse_than_claimed(claimed: Certificate, computed: Certificate) -> float:
    """Largest excess of a measure computed anew over the one claimed, in units of its limit."""
    excess = [0.0]
    for name, limit in computed.limits.items():
        now, then = computed.measures[name], claimed.measures.get(name, 0.0)
        excess.append(np.inf if np.isinf(now) and not np.isinf(then) else (now - then) / limit if now > then else 0.0)
    return max(excess)


def compared(claims: Mapping[str, Any], found: Recomputed) -> Iterator[tuple[str, float]]:
    """`difference` of each of the fields that `qvi_contact.export.field_arrays` lists, by name."""
    for name, computed in field_arrays(found.result).items():
        claimed, wanted = np.asarray(claims[name]), np.asarray(computed)
        unit, rounding = _unit_of(name, found)
        if name == "airy" and claimed.shape == wanted.shape:
            units = airy_units(found.result)
            claimed, wanted, unit = claimed / units, wanted / units, 1.0
        yield name, difference(claimed, wanted, unit, rounding)


def _unit_of(name: str, found: Recomputed) -> tuple[float, float]:
    """Unit and rounding of a field; 0 where its own entries are the unit."""
    field, length = name.rpartition(".")[2], found.result.discretization.scales.length
    if field in ("gap", "slip", "motion"):
        return found.displacement, 0.0
    if field == "energies":
        return found.energy, 0.0
    if field.endswith("_force"):
        return found.stress * length, found.rounding * length
    if any(part in field for part in ("stress", "bound", "between", "misfit")):
        return found.stress, found.rounding
    return 0.0, 0.0


def missed_tractions(result: ContactResult) -> float:
    """Largest |∫ (σn − T) ds| over a prescribed component of the traction, relative to stress × length of its edges.

    Resultants of prescribed tractions are met whatever the mesh; their distribution is what `traction_misfit` compares.
    """
    known, missed = result.discretization, [0.0]
    unit = result.certificate.scales.get("stress", 1.0) * known.scales.stress
    for condition in result.problem.conditions:
        if not isinstance(condition, Traction):
            continue
        points = EdgePoints(known.grid, result.problem.mesh.edges(condition.edges), LOAD_POINTS)
        x, y = physical(result.problem, known.scales, points.coordinates)
        weights, found = points.weights * known.scales.length, result.resultant(condition.edges)
        for field, computed in ((condition.x, found.x), (condition.y, found.y)):
            if field is not None:
                values = evaluate("Traction", field, x, y)
                size = max(unit, float(np.abs(values).max())) * float(weights.sum())
                missed.append(abs(computed - float(weights @ values)) / size)
    return max(missed)
