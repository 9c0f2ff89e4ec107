"""Verification: everything a result claims, checked against its own problem, unknowns and multipliers.

The problem is discretised again and the certificate is computed again. Tractions, gaps, slips, states, forces, energies
and the motions of plates are evaluated again and compared with the claimed values. The status has to follow from the
new certificate. Statements of the result itself, or of a back end, do not count.

    from qvi_contact.verification import verify_file, verify_result
    print(verify_result(solve(problem)).table())
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, fraction, instance_of
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import traction_data
from qvi_contact.export import field_arrays
from qvi_contact.files.archive import OWN, STORE, Archive, answer_arrays, json_ready, result_from_archive
from qvi_contact.problem.conditions import Traction
from qvi_contact.solution.result import ContactResult
from solvers import Certificate, Status, certify
from solvers.certificate.certificate import EXPONENTS
from solvers.certificate.feasibility import is_farkas
from solvers.solution import LOOSEST

AGREEMENT: Final = 1e-8
"""Largest difference of claimed from recomputed numbers b, relative to |b| + 1e-4 max|b|, see `difference`."""

_FLOOR: Final = 1e-4
_COORDINATE_ROUNDING: Final = 4.0 * float(np.finfo(np.float64).eps)  # relative to the coordinate
_MAX_ROUNDING: Final = 1e-6  # largest scale "rounding" of a certificate
_TRACTION_ROUNDING: Final = 1e-14  # relative to the terms whose sum a traction is
_DATA: Final = ("mu", "cohesion", "cap", "bilateral", "W", "f", "n0", "t0", "b")  # vectors of a `FrictionQVI`


def recomputed(result: ContactResult, discretization: Discretization, given_tolerance: float | None) -> ContactResult:
    """The result made again from its unknowns and multipliers, with a new certificate, by default to its tolerance."""
    tolerance = result.certificate.tolerance if given_tolerance is None else fraction("tolerance", given_tolerance)
    solution, qvi = result.solution, discretization.qvi
    multipliers = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    certificate = certify(qvi, solution.z, *multipliers, tolerance=tolerance)
    return ContactResult(discretization, replace(solution, problem=qvi, certificate=certificate))


def difference(claimed: ArrayLike, computed: ArrayLike, unit: float = 0.0, rounding: float = 0.0) -> float:
    """Largest difference of two arrays of floats a and b, max |a − b| / (|b| + 1e-4 max(max|b|, unit)).

    `rounding` is subtracted from |a − b| first. Infinity if shapes or kinds differ, or if one array has an infinity or
    NaN where the other has not. For integers, flags and texts the number of entries that differ.
    """
    a, b = np.asarray(claimed), np.asarray(computed)
    if a.shape != b.shape or (a.dtype.kind == "f") != (b.dtype.kind == "f"):
        return np.inf
    if b.dtype.kind != "f":
        return float(np.count_nonzero(a != b))
    finite = np.isfinite(b)
    equal = np.where(np.isnan(b), np.isnan(a), a == b)
    if not (equal | finite).all() or not np.isfinite(a[finite]).all():
        return np.inf
    a, b = a[finite], b[finite]
    scale = np.abs(b) + _FLOOR * max(float(np.abs(b).max(initial=0.0)), unit)
    excess = np.maximum(np.abs(a - b) - rounding, 0.0)
    return _largest([excess / np.where(scale > 0.0, scale, 1.0)])


def worse_than_claimed(claimed: Certificate, computed: Certificate) -> float:
    """Largest excess of a recomputed measure over the claimed one, in units of its limit.

    For measures with a sign the absolute difference counts. Infinity for NaN, and for a claim with an unknown name.
    Archives of earlier versions have two measures that others bound: they claim nothing more.
    """
    limits, former = computed.limits, {"alart_curnier", "bipotential"}
    unknown = claimed.measures.keys() - limits.keys() - former
    if unknown or claimed.signed.keys() - former != computed.signed.keys():
        return np.inf
    excess = []
    for name, limit in limits.items():
        now, claim = computed.measures[name], claimed.measures.get(name, 0.0)
        excess.append(0.0 if np.isinf(claim) else max((now - claim) / limit, 0.0) if claim == claim else np.inf)
    signed = [abs(now - claimed.signed[name]) / limits[name] for name, now in computed.signed.items()]
    return _largest(excess + signed)


def scales_difference(claimed: Certificate, computed: Certificate) -> float:
    """Largest relative difference of two certificates' scales over its tolerance; one may lack a small "rounding"."""
    new, old = dict(computed.scales), dict(claimed.scales)
    if "rounding" not in new or "rounding" not in old:
        rounding = old.pop("rounding", new.pop("rounding", 0.0))
        if not 0.0 <= rounding <= _MAX_ROUNDING:
            return np.inf
    if new.keys() != old.keys():
        return np.inf
    limits = {"displacement": _SOFT_SCALES, "energy": _SOFT_SCALES}
    differences = {name: difference(float(old[name]), float(value)) for name, value in new.items()}
    return _largest(value / limits.get(name, _SCALE_TOLERANCE) for name, value in differences.items())


def _largest(values: Iterable[float | FloatArray]) -> float:
    """Largest of all entries, 0 without entries; infinity if an entry is NaN, which Python's max may ignore."""
    largest = [float(np.max(value, initial=0.0)) for value in values]
    return np.inf if np.isnan(largest).any() else max(largest, default=0.0)


def missed_tractions(result: ContactResult) -> float:
    """Error of the prescribed resultants: Σ |∫ (σn − T) ds| over edges and prescribed components, and of moments.

    It is relative to stress × length of the shortest line with a prescribed traction. Resultants are exact on every
    mesh; the distribution along an edge is compared by `traction_misfit`.
    """
    discretization, prescribed = result.discretization, result.problem.prescribed(Traction)
    if not prescribed:
        return 0.0
    scales, points = discretization.scales, discretization.supports.points
    data = [traction_data(result.problem, scales, part, points) for part in prescribed]
    size = max([result.certificate.scales.get("stress", 1.0), *(float(np.abs(each.values).max()) for each in data)])
    length = min(float(part.edges.length.sum()) for part in prescribed) / discretization.scales.length
    return discretization.supports.missed(result.dofs, data) / (size * length)


DOCUMENT_VERSION: Final = 1
"""Version of `Verification.document`; it grows when an entry changes its meaning or is removed."""

_CLAIM_TOLERANCE: Final = 0.1  # excess of a measure over its claimed value, in units of its limit: rounding
_SCALE_TOLERANCE: Final = 1e-6  # relative difference of scales
_SOFT_SCALES: Final = 0.3  # of scales with the contact's stiffness, which other kernels change, of half discs by 2e-6
_BOUND_FACTOR: Final = 10.0  # × tolerance: the fixed point may store the friction bound of its last iteration
_NAMES_SHOWN: Final = 5  # in a sentence

_GROUPS: Final = {
    "material": ("mesh", ""), "vertices": ("mesh", ""), "cells": ("mesh", ""),
    "gauss_x": ("stresses", "length"), "gauss_y": ("stresses", "length"), "gauss_stress": ("stresses", "stress"),
    "x": ("points", "length"), "y": ("points", "length"), "weights": ("points", ""), "friction": ("points", ""),
    "gap": ("gap and slip", "displacement"), "slip": ("gap and slip", "displacement"), "state": ("states", ""),
    "motion": ("motion", "displacement"), "energies": ("energies", "energy"),
    "traction_misfit": ("traction_misfit", "stress"), "effective_normal_force": ("tractions", "force"),
    "normal_force": ("forces", "force"), "tangential_force": ("forces", "force"),
}  # fmt: skip
"""Last part of a field's name: the row of the table, and the quantity of its unit; all other fields are tractions."""


@dataclass(frozen=True)
class Check:
    """One row of a verification."""

    name: str
    """Name of the check."""
    value: float | str
    """The value, a relative number; a word for the status."""
    limit: float | None
    """Largest absolute value that passes."""
    passed: bool
    meaning: str
    """Meaning of the value."""
    worry: str = ""
    """Consequence of a failure, and the remedy."""


@dataclass(frozen=True)
class Verification:
    """The outcome of a verification."""

    rows: tuple[Check, ...]
    """All checks."""
    status: Status
    """The status that the result claims."""
    tolerance: float
    """Tolerance of the certificate."""

    @property
    def passed(self) -> bool:
        """Whether every check passed: all claims are right, and the certificate passes at the tolerance."""
        return not self.failures

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(row for row in self.rows if not row.passed)

    def summary(self) -> str:
        """One line: verified, or the names of the checks that failed."""
        if self.passed:
            return f"verified: {len(self.rows)} checks passed at {self.tolerance:.0e}"
        return f"not verified: {', '.join(row.name for row in self.failures)}"

    def table(self, failures_only: bool = False) -> str:
        """All checks as text, or only the failures, with their meaning, and the summary as the last line."""
        rows = self.failures if failures_only else self.rows
        width = max((len(row.name) for row in rows), default=0)
        lines = [f"{'check':<{width}}  {'value':>8}  {'limit':>8}"] if rows else []
        for row in rows:
            value = row.value if isinstance(row.value, str) else f"{row.value:.1e}"
            limit = "" if row.limit is None else f"{row.limit:.1e}"
            lines.append(f"{row.name:<{width}}  {value:>8}  {limit:>8}  {'passed' if row.passed else 'FAILED'}")
            lines += [f"    {text}" for text in (row.meaning, "" if row.passed else row.worry) if text]
        return "\n".join([*lines, self.summary()])

    def document(self) -> dict[str, Any]:
        """The verification as a document for JSON; numbers that are not finite become None."""
        return {
            "format": "qvi_contact verification",
            "version": DOCUMENT_VERSION,
            "passed": self.passed,
            "status": str(self.status),
            "tolerance": self.tolerance,
            "failures": [row.name for row in self.failures],
            "checks": [json_ready(asdict(row)) for row in self.rows],
        }


def verify_result(result: ContactResult, tolerance: float | None = None) -> Verification:
    """Check everything that a result claims, at the cost of one factorisation.

    A proof that the load cannot be carried is checked too; any other result without stresses fails. The tolerance of
    the certificate, in (0, 1), is by default that of the solve, which must not be looser than
    `solvers.solution.LOOSEST`. Numbers must agree with recomputed ones to `AGREEMENT` and rounding of the unknowns.

    `InputError` if the argument is not a result, the tolerance is out of range, or the shape of the multipliers does
    not fit the problem. The steps of a `History` are verified one by one.
    """
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns; of a History its steps")
    known = result.discretization
    with np.errstate(all="ignore"):  # infinities and NaN fail the checks
        fresh = discretize(known.problem, degree=known.space.degree, law_on=known.rule.law_on, scales=known.scales)
        slip = [rows.slip for rows in known.contacts]
        if any(part.any() for part in slip):
            fresh = fresh.with_data(known.problem, known.scales, slip)
        remade = recomputed(result, fresh, tolerance)
        claims: dict[str, Any] = {}  # stays empty if a contact that the energies need is missing
        if result.has_state:
            with suppress(KeyError):
                names = {f"{name}.name": line.name for name, line in result.contacts.items() if line.name != name}
                claims = {**field_arrays(result), **names}
        data = [(getattr(result.solution.problem, name), getattr(fresh.qvi, name)) for name in _DATA]
        same = _limit_check(
            "problem", _largest(difference(*pair, 1.0) for pair in data), AGREEMENT,  # shears may be mere rounding
            "Largest relative difference of the stored laws, loads and weights from those of the problem.",
        )  # fmt: skip
        rows = (same, *_rows(result, remade, claims, tolerance))
        return Verification(rows, result.status, remade.certificate.tolerance)


def verify_file(path: str | Path, tolerance: float | None = None) -> Verification:
    """Check everything that a file of `qvi_contact.export.write_npz` claims, from the file only.

    A step in the store of `solve_history` is checked too; it claims no fields, only an answer and its certificate. The
    tolerance is that of `verify_result`, so the file does not choose it. `InputError` if the file is not such an
    archive, or has no problem, see `qvi_contact.files.archive.load_result`.
    """
    archive = Archive(path)
    with np.errstate(all="ignore"):  # infinities and NaN fail the checks
        result = result_from_archive(archive)
        intact = Check(
            "digest", "fits" if archive.intact else "does not", None, archive.intact,
            "SHA-256 of all entries: unchanged since the file was written.",
            "The file was changed after it was written. The other checks show whether the result still holds.",
        )  # fmt: skip
        remade = recomputed(result, result.discretization, tolerance)  # discretised from the file just now
        claims = None  # a stored step claims no fields
        if STORE not in archive.arrays:
            other_entries = OWN | {"problem", "problem_missing", *answer_arrays(result)}
            claims = {name: array for name, array in archive.arrays.items() if name not in other_entries}
        rows = (intact, *_rows(result, remade, claims, tolerance))
        return Verification(rows, result.status, remade.certificate.tolerance)


def _rows(
    result: ContactResult, remade: ContactResult, claims: Mapping[str, Any] | None, given_tolerance: float | None
) -> Iterator[Check]:
    """The checks of a result, and of the fields it claims, against the recomputed result."""
    yield _status(result, remade)
    certificate, tolerance, solution = remade.certificate, remade.certificate.tolerance, remade.solution
    if given_tolerance is None:
        yield _limit_check(
            "tolerance", tolerance, LOOSEST, "Tolerance of the certificate: the one of the solve.",
            "This tolerance is too loose. To accept it, give it by --tolerance, or by the argument tolerance.",
        )  # fmt: skip
    if result.status.impossible:
        farkas = solution.farkas
        is_proved = _evidence(remade) is not None and (farkas is None or is_farkas(solution.problem, *farkas))
        yield Check(
            "proof", "holds" if is_proved else "does not", None, is_proved,
            "A mechanism, computed again: rigid motions of the blocks on which the loads do more work than contacts "
            "can take up. Farkas' multipliers, where the file has them: no traction of this mesh carries the load.",
            "There is no proof that the load cannot be carried.",
        )  # fmt: skip
        return
    for row in certificate.rows():
        yield Check(row.measure.name, row.value, row.limit, row.passed, row.measure.meaning, row.measure.worry)
    yield _limit_check(
        "claimed measures", worse_than_claimed(result.certificate, certificate), _CLAIM_TOLERANCE,
        "Largest excess of a measure above the stored one, in units of its limit.",
    )  # fmt: skip
    yield _limit_check(
        "claimed scales", scales_difference(result.certificate, certificate), 1.0,
        "Units of stress, displacement and energy that divide the measures: largest difference over its tolerance.",
    )  # fmt: skip
    if not result.has_state:
        return
    if claims is not None:
        yield from _agreements(claims, remade)
    stress = certificate.scales.get("stress", 1.0)
    stored, bound = result.solution.threshold, solution.problem.threshold(solution.problem.pressure(solution.z))
    change = np.abs(stored - bound) if np.shape(stored) == bound.shape else np.inf
    yield _limit_check(
        "friction bound", _largest([change / stress]), _BOUND_FACTOR * result.certificate.tolerance,
        "Difference of the stored friction bound from that of the computed pressure, over the largest traction.",
    )  # fmt: skip
    yield _limit_check(
        "prescribed resultants", missed_tractions(remade), AGREEMENT,
        "Forces of the prescribed tractions on their edges: equilibrium with the loads.",
    )  # fmt: skip

    if remade.discretization.rule.law_on == "edges":  # the law must hold along whole edges
        lines, unit = remade.contacts.values(), stress * remade.discretization.scales.stress
        excess = max((max(line.excess_between_points, line.pull_between_points) for line in lines), default=0.0)
        yield _limit_check(
            "between points", excess / unit if excess else 0.0, _BOUND_FACTOR * tolerance,
            "Largest |σ_T| beyond the bound, or pull, seen along the contacts, over the largest traction.",
            "The law on edges does not hold between the points here: leave law_on out.",
        )  # fmt: skip


def _limit_check(name: str, value: float, limit: float, meaning: str, worry: str = "") -> Check:
    return Check(name, float(value), limit, bool(value <= limit), meaning, worry)


def _agreements(claims: Mapping[str, Any], remade: ContactResult) -> Iterator[Check]:
    """Number of fields that are only claimed or only computed, and the largest difference in each group of fields."""
    computed_fields, units = field_arrays(remade), _units(remade)
    names = sorted(claims.keys() ^ computed_fields.keys())
    listed = ", ".join(names[:_NAMES_SHOWN]) + (", …" if len(names) > _NAMES_SHOWN else "")
    yield _limit_check(
        "entries", len(names), 0.0, "Number of fields that are missing, or that this problem does not have.",
        f"Not as expected: {listed}.",
    )  # fmt: skip
    worst: dict[str, tuple[float, str]] = {}  # by group: the largest difference and its field
    for name in (name for name in computed_fields if name in claims):
        claimed, computed = np.asarray(claims[name]), np.asarray(computed_fields[name])
        contact, _, field = name.rpartition(".")
        group, quantity = _GROUPS.get(field, ("tractions", "stress"))
        unit, rounding = units[quantity]
        if quantity == "length" and claimed.shape == computed.shape and claimed.dtype.kind == "f":
            coordinates = remade.problem.mesh.vertices[:, int(field.endswith("y"))]  # taken from their minimum
            corner, rounding = coordinates.min(), _COORDINATE_ROUNDING * float(np.abs(coordinates).max())
            claimed, computed = claimed - corner, computed - corner
        label = f"{contact}: {group}" if contact else group
        worst[label] = max(worst.get(label, (-1.0, "")), (difference(claimed, computed, unit, rounding), name))
    for label, (value, name) in worst.items():
        is_count = name.endswith(".state")
        meaning = "Number of points whose state (open, stick, slip) differs."
        if not is_count:
            meaning = "Largest relative difference of the stored fields of this group from the recomputed ones."
            meaning += f" The worst is {name}." if value > 0.0 else ""
        yield _limit_check(label, value, 0.0 if is_count else AGREEMENT, meaning)


def _units(remade: ContactResult) -> dict[str, tuple[float, float]]:
    """Unit of each quantity, 0 to scale by its entries only, and the effect of the unknowns' rounding on it."""
    scales, certified, qvi = remade.discretization.scales, remade.certificate.scales, remade.solution.problem
    stress = certified.get("stress", 1.0) * scales.stress
    z = np.abs(remade.solution.z)
    largest = max(float((abs(rows) @ z).max(initial=0.0)) for rows in (qvi.N, qvi.T))
    rounding = _TRACTION_ROUNDING * scales.stress * largest
    return {
        "": (0.0, 0.0),
        "length": (remade.problem.mesh.length, 0.0),  # longer side of the body's box
        "stress": (stress, rounding),
        "force": (stress * scales.length, rounding * scales.length),
        "displacement": (certified.get("displacement", 1.0) * scales.displacement, 0.0),
        "energy": (certified.get("body_energy", 1.0) * scales.energy, 0.0),
    }


def _status(result: ContactResult, remade: ContactResult) -> Check:
    """Check that the status follows from the certificate at the tolerance of the solve."""
    claimed, status, word = result.certificate, result.status, result.status.words
    valid = {name: value for name, value in claimed.measures.items() if value >= 0.0}  # not NaN
    claimed = replace(claimed, measures=dict.fromkeys(EXPONENTS, np.inf) | valid)
    certificates = claimed, replace(remade.certificate, tolerance=claimed.tolerance)
    if status.impossible:
        is_consistent = _evidence(remade) is not None
    elif status is Status.SOLVED:
        is_consistent = all(each.passed for each in certificates)
    else:
        is_accurate = status is not Status.INACCURATE or all(each.accuracy <= LOOSEST for each in certificates)
        is_consistent = is_accurate and not any(each.passed for each in certificates)
    says_status = re.match(rf"{word}\b", result.solution.message) is not None
    return Check(
        "status", word, None, is_consistent and says_status,
        "Solved if and only if the certificate passes at the tolerance asked for; inaccurate up to 1e-4. The message "
        "begins with the same word.",
        "The status or the message contradicts the numbers.",
    )  # fmt: skip


def _evidence(remade: ContactResult) -> object:
    """The proof of an impossible status: a mechanism, computed again; for the mesh only, Farkas' multipliers."""
    return remade.mechanism if remade.status is Status.INFEASIBLE else remade.solution.farkas
