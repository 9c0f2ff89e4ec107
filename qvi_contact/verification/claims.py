"""What a result says, beside what its problem, unknowns and multipliers give when all is computed anew."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.element import legendre
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.files.export import field_arrays
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Traction
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import prescribed_and_computed
from solvers import Certificate, FrictionQVI, certify
from solvers.certificate.certificate import EXPONENTS
from solvers.factorisation import FactorisationError
from solvers.factorisation.augmented import ORTHOGONAL

AGREEMENT: Final = 1e-8
"""What a number may differ from the one computed anew: of its own size and 1e-4 of the largest of its kind."""

_FLOOR: Final = 1e-4
_ULPS: Final = 4.0 * float(np.finfo(np.float64).eps)  # rounding of a coordinate, as a share of it
_LARGEST_ROUNDING: Final = 1e-6  # what a certificate may explain by rounding; whether it does may hang on rounding
_AXES: Final = {"gauss_x": 0, "x": 0, "gauss_y": 1, "y": 1}
_ROUNDING: Final = 1e-14  # share of the terms of a traction that is rounding
_MATRICES: Final = ("K", "N", "T", "A")
_VECTORS: Final = ("f", "n0", "t0", "mu", "W", "b", "cohesion", "cap", "bilateral")


@dataclass(frozen=True, eq=False)
class Recomputed:
    """A result made again from its problem, unknowns and multipliers, with the certificate computed anew.

    Units of what is compared [stress], [length], [stress × length²]; `rounding` is what the rounding of the unknowns
    may change in a traction [stress].
    """

    result: ContactResult
    stress: float
    displacement: float
    energy: float
    rounding: float

    @cached_property
    def fields(self) -> dict[str, Any]:
        """What `qvi_contact.export.field_arrays` lists; nothing without a stress state."""
        return field_arrays(self.result) if self.result.has_state else {}


def rediscretized(result: ContactResult) -> Discretization:
    """The problem of a result discretised anew, in its units and after the slip before it."""
    known = result.discretization
    fresh = discretize(
        known.problem,
        degree=known.space.degree,
        law_on=known.rule.law_on,
        scales=known.scales,
    )
    slip = [rows.slip for rows in known.contacts]
    return fresh.slipped(slip) if any(part.any() for part in slip) else fresh


def recompute(result: ContactResult, fresh: Discretization, tolerance: float) -> Recomputed:
    """Evaluate and certify again; nothing but unknowns and multipliers of the result is taken over."""
    solution, scales, qvi = result.solution, fresh.scales, fresh.qvi
    if solution.factorisation.startswith(ORTHOGONAL):  # as another problem with this K had needed it
        qvi.stiffness.use_root()
    multipliers = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    try:
        certificate = certify(qvi, solution.z, *multipliers, tolerance=tolerance)
    except InputError:
        raise
    except (FactorisationError, ValueError):  # dense algebra refuses what has overflowed by ValueError: nothing passes
        certificate = Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)
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


def difference(claimed: ArrayLike, computed: ArrayLike, unit: float = 0.0, rounding: float = 0.0) -> float:
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
    return _largest([apart / np.where(scale > 0.0, scale, 1.0)])


def problem_difference(claimed: FrictionQVI, computed: FrictionQVI) -> float:
    """Largest difference of the data of two algebraic problems, relative to the largest entry of each."""
    found: list[float | FloatArray] = []
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
        found.append(np.abs(a[finite] - b[finite]) / (float(np.abs(b[finite]).max(initial=0.0)) or 1.0))
    return _largest(found)


def worse_than_claimed(claimed: Certificate, computed: Certificate) -> float:
    """Largest excess of a measure computed anew over the one claimed, in units of its limit.

    Measures with a sign count by their difference. Infinity for what is NaN, or is claimed under an unknown name.
    """
    limits = computed.limits
    if claimed.signed.keys() != computed.signed.keys() or not claimed.measures.keys() <= limits.keys():
        return np.inf
    excess = []
    for name, limit in limits.items():
        now, then = computed.measures[name], claimed.measures.get(name, 0.0)
        excess.append(0.0 if np.isinf(then) else max((now - then) / limit, 0.0) if then == then else np.inf)
    signed = [abs(now - claimed.signed[name]) / limits[name] for name, now in computed.signed.items()]
    return _largest(excess + signed)


def sound(claimed: Certificate) -> Certificate:
    """The certificate with infinity for measures that are missing, negative or NaN, so that these do not pass."""
    measures = dict.fromkeys(EXPONENTS, np.inf)
    return replace(claimed, measures=measures | {name: v for name, v in claimed.measures.items() if v >= 0.0})


def scales_difference(claimed: Certificate, computed: Certificate) -> float:
    """Largest relative difference of the scales; "rounding" may be there or not, but is small."""
    now, then = dict(computed.scales), dict(claimed.scales)
    if "rounding" not in now or "rounding" not in then:
        given = then.pop("rounding", now.pop("rounding", 0.0))
        if not 0.0 <= given <= _LARGEST_ROUNDING:
            return np.inf
    if now.keys() != then.keys():
        return np.inf
    return _largest([difference(float(then[name]), float(value)) for name, value in now.items()])


def bound_difference(result: ContactResult, found: Recomputed) -> float:
    """Largest difference of the bound of |σ_T| kept with the unknowns from that of the pressure there.

    Relative to the largest traction.
    """
    claimed, solution = np.asarray(result.solution.threshold, dtype=np.float64), found.result.solution
    computed = solution.problem.threshold(solution.problem.pressure(solution.z))
    if claimed.shape != computed.shape:
        return np.inf
    unit = found.result.certificate.scales.get("stress", 1.0)
    return _largest([np.abs(claimed - computed) / unit])


def unexpected(claims: Mapping[str, Any], found: Recomputed) -> list[str]:
    """Names of fields that should not be there, or are missing."""
    return sorted(claims.keys() ^ found.fields.keys())


def compared(claims: Mapping[str, Any], found: Recomputed) -> Iterator[tuple[str, float]]:
    """`difference` of each field that is both claimed and computed, by name; `unexpected` has the others."""
    for name in [name for name in found.fields if name in claims]:
        claimed, wanted = np.asarray(claims[name]), np.asarray(found.fields[name])
        unit, rounding = _unit_of(name, found)
        field = name.rpartition(".")[2]
        if claimed.shape == wanted.shape and claimed.dtype.kind == "f" and field in _AXES:
            along = found.result.problem.mesh.vertices[:, _AXES[field]]  # from the corner, wherever the body stands
            corner, rounding = along.min(), _ULPS * float(np.abs(along).max())
            claimed, wanted = claimed - corner, wanted - corner
        yield name, difference(claimed, wanted, unit, rounding)


def _largest(values: Iterable[float | FloatArray]) -> float:
    """Largest of all entries, 0 of none; infinity if one is NaN, which Python's max would pass over."""
    largest = [float(np.max(value, initial=0.0)) for value in values]  # NumPy's passes NaN on
    return np.inf if np.isnan(largest).any() else max(largest, default=0.0)


def _unit_of(name: str, found: Recomputed) -> tuple[float, float]:
    """Unit and rounding of a field; 0 where its own entries are the unit."""
    field, length = name.rpartition(".")[2], found.result.discretization.scales.length
    if field in ("gap", "slip", "motion"):
        return found.displacement, 0.0
    if field == "energies":
        return found.energy, 0.0
    if field in _AXES:
        return found.result.problem.mesh.length, 0.0  # longer side of the body's box
    if field.endswith("_force"):
        return found.stress * length, found.rounding * length
    if any(part in field for part in ("stress", "pressure", "bound", "between", "misfit")):
        return found.stress, found.rounding
    return 0.0, 0.0


def missed_tractions(result: ContactResult) -> float:
    """Largest |∫ (σn − T) ds| over a prescribed component of the traction, relative to stress × length of its edges.

    Where normal and tangential component are prescribed on the same arcs, they are the components of the force: what
    turns along an arc is no force by itself. Resultants of prescribed tractions are met whatever the mesh; their
    distribution is what `traction_misfit` compares.
    """
    known = result.discretization
    unit = result.certificate.scales.get("stress", 1.0)
    given = result.problem.prescribed(Traction)
    parts = list(zip(given, prescribed_and_computed(known, result.dofs), strict=True))
    ends = [(part.turns and part.edges.curved, tuple(part.edges.first)) for part, _ in parts]
    missed, forces, sizes = list[float](), dict[tuple[int, ...], FloatArray](), dict[tuple[int, ...], float]()
    for (part, (wanted, computed)), (turns, edges) in zip(parts, ends, strict=True):
        length = part.edges.length
        size = max(unit, float(np.abs(wanted.values).max())) * float(length.sum())
        if not (turns and ends.count((turns, edges)) > 1):
            missed.append(abs(float(length @ (computed[:, 0] - wanted.coefficients(0)[:, 0]))) / size)
            continue
        t, weights = gauss_legendre(computed.shape[1])
        values = weights * (computed @ legendre.basis(computed.shape[1] - 1, t).T)
        along = np.einsum("kq,kqd->kd", values, vectors_along(part.edges, part.direction, t))
        due = wanted.integrals(vectors_along(part.edges.take(wanted.edge), part.direction[wanted.edge], wanted.t))
        forces[edges] = forces.get(edges, np.zeros(2)) + length @ (along - due)
        sizes[edges] = max(size, sizes.get(edges, 0.0))
    return _largest([*missed, *(np.abs(force) / sizes[edges] for edges, force in forces.items())])
