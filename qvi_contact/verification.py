"""Is a result what it says? Everything it claims, checked against its own problem, unknowns and multipliers.

The problem is discretised and the certificate computed anew; tractions, gaps, slips, states, forces, energies and the
motion of plates are evaluated anew and compared; the status has to follow from the certificate. Nothing that the result
says of itself counts, and nothing that a back end said.

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
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, fraction, instance_of
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.discretization.loads import traction_data
from qvi_contact.errors import InputError
from qvi_contact.export import field_arrays
from qvi_contact.files.archive import OWN, STORE, Archive, answer_arrays, json_ready, result_from_archive
from qvi_contact.problem.conditions import Traction, is_frictionless
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from solvers import Certificate, FrictionQVI, Status, certify
from solvers.certificate.certificate import EXPONENTS
from solvers.certificate.feasibility import is_farkas
from solvers.factorisation.base import FactorisationError
from solvers.solution import LOOSEST

AGREEMENT: Final = 1e-8
"""What a number may differ from the one computed anew: of its own size and 1e-4 of the largest of its kind."""

_FLOOR: Final = 1e-4
_ULPS: Final = 4.0 * float(np.finfo(np.float64).eps)  # rounding of a coordinate, as a share of it
_LARGEST_ROUNDING: Final = 1e-6  # what a certificate may explain by rounding; whether it does may hang on rounding
_ROUNDING: Final = 1e-14  # share of the terms of a traction that is rounding
_DATA: Final = ("K", "N", "T", "A", "f", "n0", "t0", "mu", "W", "b", "cohesion", "cap", "bilateral")


def recomputed(result: ContactResult, known: Discretization, given: float | None) -> ContactResult:
    """The result made again from its unknowns and multipliers alone, certified anew; to its tolerance if none given."""
    tolerance = result.certificate.tolerance if given is None else fraction("tolerance", given)
    solution, qvi = result.solution, known.qvi
    multipliers = solution.normal_multiplier, solution.tangential_multiplier, solution.equality_multiplier
    try:
        certificate = certify(qvi, solution.z, *multipliers, tolerance=tolerance)
    except InputError:
        raise
    except (FactorisationError, ValueError):  # dense algebra refuses what has overflowed by ValueError: nothing passes
        certificate = Certificate(dict.fromkeys(EXPONENTS, np.inf), tolerance)
    return ContactResult(known, replace(solution, problem=qvi, certificate=certificate))


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
    """Largest difference of the data of two algebraic problems, relative to the largest finite entry of each."""
    found: list[float | FloatArray] = []
    for name in _DATA:
        a, b = (getattr(qvi, name) for qvi in (claimed, computed))
        if a.shape != b.shape:
            return np.inf
        if b.ndim > 1:  # a sparse matrix
            apart, known = (sparse.coo_array(part).data for part in (a - b, b))
        else:  # what is infinite in both is equal
            apart = np.subtract(a, b, out=np.zeros(b.shape), where=a != b, dtype=np.float64)
            known = b[np.isfinite(b)]
        found.append(np.abs(apart) / (float(np.abs(known).max(initial=0.0)) or 1.0))
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


def scales_difference(claimed: Certificate, computed: Certificate) -> float:
    """Largest relative difference of the scales, over what is allowed; "rounding" may be there or not, but is small."""
    now, then = dict(computed.scales), dict(claimed.scales)
    if "rounding" not in now or "rounding" not in then:
        given = then.pop("rounding", now.pop("rounding", 0.0))
        if not 0.0 <= given <= _LARGEST_ROUNDING:
            return np.inf
    if now.keys() != then.keys():
        return np.inf
    apart = {name: difference(float(then[name]), float(value)) for name, value in now.items()}
    if then.get("displacement") == then.get("stress"):  # earlier versions found no stiffness where rounding left none
        apart.pop("displacement", None)
    return _largest(value / (_SOFT if name in ("displacement", "energy") else _SCALES) for name, value in apart.items())


def _largest(values: Iterable[float | FloatArray]) -> float:
    """Largest of all entries, 0 of none; infinity if one is NaN, which Python's max would pass over."""
    largest = [float(np.max(value, initial=0.0)) for value in values]  # NumPy's passes NaN on
    return np.inf if np.isnan(largest).any() else max(largest, default=0.0)


def missed_tractions(result: ContactResult) -> float:
    """Σ |∫ (σn − T) ds| over edges and prescribed components, moments too, over stress × length of the shortest line.

    Resultants of prescribed tractions are met whatever the mesh; their distribution is what `traction_misfit` compares.
    """
    known, parts = result.discretization, result.problem.prescribed(Traction)
    if not parts:
        return 0.0
    given = [traction_data(result.problem, known.scales, part, known.supports.points) for part in parts]
    size = max([result.certificate.scales.get("stress", 1.0), *(float(np.abs(each.values).max()) for each in given)])
    length = min(float(part.edges.length.sum()) for part in parts) / known.scales.length
    return known.supports.missed(result.dofs, given) / (size * length)


DOCUMENT_VERSION: Final = 1
"""Grows when an entry of `Verification.document` changes its meaning or goes away."""

_CLAIMED: Final = 0.1  # of its limit, by which a measure may be larger than it was said to be: rounding
_SCALES: Final = 1e-6  # relative difference of scales
_SOFT: Final = 0.3  # the same of those with the contact's stiffness, in which rounding showed in earlier files
_BOUND: Final = 10.0  # of the tolerance: results of the fixed point may hold that of its last iteration
_BETWEEN: Final = 1e-3  # of the largest traction, that the samples between points may miss
_SHOWN: Final = 5  # names in a sentence

_GROUPS: Final = {
    "material": ("mesh", ""), "vertices": ("mesh", ""), "cells": ("mesh", ""),
    "gauss_x": ("stresses", "length"), "gauss_y": ("stresses", "length"), "gauss_stress": ("stresses", "stress"),
    "x": ("points", "length"), "y": ("points", "length"), "weights": ("points", ""), "friction": ("points", ""),
    "gap": ("gap and slip", "displacement"), "slip": ("gap and slip", "displacement"), "state": ("states", ""),
    "motion": ("motion", "displacement"), "energies": ("energies", "energy"),
    "traction_misfit": ("traction_misfit", "stress"), "effective_normal_force": ("tractions", "force"),
    "normal_force": ("forces", "force"), "tangential_force": ("forces", "force"),
}  # fmt: skip
"""Last part of a field's name: the row it counts in, and the unit of its differences; others are tractions."""


@dataclass(frozen=True)
class Check:
    """One row of a verification."""

    name: str
    """What was checked."""
    value: float | str
    """What was found, relative; a word for the status."""
    limit: float | None
    """Largest absolute value that passes."""
    passed: bool
    meaning: str
    """What the value means."""
    worry: str = ""
    """When to worry, and what to do then."""


@dataclass(frozen=True)
class Verification:
    """What became of a verification."""

    rows: tuple[Check, ...]
    """All checks."""
    status: Status
    """The status that the result claims."""
    tolerance: float
    """Of the certificate."""

    @property
    def passed(self) -> bool:
        """Whether every check passed: the result is what it says, and its certificate passes at the tolerance."""
        return not self.failures

    @property
    def failures(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(row for row in self.rows if not row.passed)

    def summary(self) -> str:
        """One line: passed, or what failed."""
        if self.passed:
            return f"verified: {len(self.rows)} checks passed at {self.tolerance:.0e}"
        return f"not verified: {', '.join(row.name for row in self.failures)}"

    def table(self, failures_only: bool = False) -> str:
        """All rows as text, or those that failed, with what they mean, and the summary as the last line."""
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
        """The same as a document that JSON can hold; numbers that are not finite are None."""
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
    """Check everything that a result claims.

    A proof that the load cannot be carried is checked too; any other result without stresses fails. The tolerance of
    the certificate, in (0, 1), is by default the one the result was solved with, which must not be looser than
    `solvers.solution.LOOSEST` then. Numbers have to agree with those computed anew to `AGREEMENT` of their size, or of
    1e-4 of the largest of their kind, rounding of the unknowns aside. It costs one factorisation.

    `InputError` if the argument is no result, the tolerance is out of range, or multipliers have another shape than the
    problem. The steps of a `History` are verified one by one.
    """
    if isinstance(result, History):
        raise InputError("result", "a History", "give its steps one by one: [verify_result(step) for step in ….steps]")
    instance_of(ContactResult, "result", result, "give a ContactResult, such as solve returns")
    known = result.discretization
    with np.errstate(all="ignore"):  # what is absurd fails by its numbers
        fresh = discretize(known.problem, degree=known.space.degree, law_on=known.rule.law_on, scales=known.scales)
        slip = [rows.slip for rows in known.contacts]
        if any(part.any() for part in slip):
            fresh = fresh.with_data(known.problem, known.scales, slip)
        again = recomputed(result, fresh, tolerance)
        same = _limited(
            "problem", problem_difference(result.solution.problem, again.solution.problem), AGREEMENT,
            "The algebraic problem that was solved, beside the problem discretised anew.",
        )  # fmt: skip
        claims: dict[str, Any] = {}  # all of it is missing where contacts are gone that its energies need
        if result.has_state:
            with suppress(KeyError):
                others = {f"{name}.name": line.name for name, line in result.contacts.items() if line.name != name}
                claims = {**field_arrays(result), **others}
        rows = (same, *_rows(result, again, claims, tolerance))
        return Verification(rows, result.status, again.certificate.tolerance)


def verify_file(path: str | Path, tolerance: float | None = None) -> Verification:
    """Check everything that a file claims that `qvi_contact.export.write_npz` has written; from the file alone.

    So is a step that `solve_history` has kept in its store. It claims no fields, but an answer and its certificate. The
    tolerance is that of `verify_result`: the file does not choose what it is measured by. `InputError` if the file is
    no such archive, or has no problem, as `qvi_contact.files.archive.load_result` says.
    """
    archive = Archive(path)
    with np.errstate(all="ignore"):  # what is absurd fails by its numbers
        result = result_from_archive(archive)
        intact = Check(
            "digest", "fits" if archive.intact else "does not", None, archive.intact,
            "SHA-256 of all entries: unchanged since the file was written.",
            "The file was changed after it was written. The other checks show whether the result still holds.",
        )  # fmt: skip
        again = recomputed(result, result.discretization, tolerance)  # which was made from the file just now
        claims = None  # of stored steps
        if STORE not in archive.arrays:
            others = OWN | {"problem", "problem_missing", *answer_arrays(result)}
            claims = {name: array for name, array in archive.arrays.items() if name not in others}
        rows = (intact, *_rows(result, again, claims, tolerance))
        return Verification(rows, result.status, again.certificate.tolerance)


def _rows(
    result: ContactResult, again: ContactResult, claims: Mapping[str, Any] | None, given: float | None
) -> Iterator[Check]:
    """All rows but the first about a result, made again, and the fields it claims."""
    yield _status(result, again)
    certificate, tolerance, solution = again.certificate, again.certificate.tolerance, again.solution
    if given is None:
        yield _limited(
            "tolerance", tolerance, LOOSEST, "Tolerance of the certificate: the one of the solve.",
            "This tolerance is too loose. To accept it, give it by --tolerance, or by the argument tolerance.",
        )  # fmt: skip
    if result.status.impossible:
        farkas = solution.farkas
        proved = _evidence(again) is not None and (farkas is None or is_farkas(solution.problem, *farkas))
        yield Check(
            "proof", "holds" if proved else "does not", None, proved,
            "A mechanism, computed again: rigid motions of the blocks on which the loads do more work than contacts "
            "can take up. Farkas' multipliers, where the file has them: no traction of this mesh carries the load.",
            "There is no proof that the load cannot be carried.",
        )  # fmt: skip
        return
    for row in certificate.rows():
        yield Check(row.measure.name, row.value, row.limit, row.passed, row.measure.meaning, row.measure.worry)
    yield _limited(
        "claimed measures", worse_than_claimed(result.certificate, certificate), _CLAIMED,
        "Largest excess of a measure above the stored one, in units of its limit.",
    )  # fmt: skip
    yield _limited(
        "claimed scales", scales_difference(result.certificate, certificate), 1.0,
        "Units of stress, displacement and energy by which the measures are divided: difference over what is allowed.",
    )  # fmt: skip
    if not result.has_state:
        return
    if claims is not None:
        yield from _agreements(claims, again)
    stress = certificate.scales.get("stress", 1.0)
    stored, bound = result.solution.threshold, solution.problem.threshold(solution.problem.pressure(solution.z))
    apart = np.abs(stored - bound) if np.shape(stored) == bound.shape else np.inf
    yield _limited(
        "friction bound", _largest([apart / stress]), _BOUND * result.certificate.tolerance,
        "Difference of the stored bound of |σ_T| and that of the pressure there, over the largest traction.",
    )  # fmt: skip
    yield _limited(
        "prescribed resultants", missed_tractions(again), AGREEMENT,
        "Forces of the prescribed tractions on their edges: equilibrium with the loads.",
    )  # fmt: skip

    if again.discretization.rule.law_on == "edges":  # coefficients that obey a law promise it along whole edges
        lines, unit = again.contacts.values(), stress * again.discretization.scales.stress
        beyond = max((max(line.excess_between_points, line.pull_between_points) for line in lines), default=0.0)
        yield _limited(
            "between points", beyond / unit if beyond else 0.0, _BOUND * tolerance,
            "Largest |σ_T| beyond the bound, or pull, seen along the contacts, over the largest traction.",
            "Coefficients do not hold this law between the points: leave law_on out.",
        )  # fmt: skip


def _limited(name: str, value: float, limit: float, meaning: str, worry: str = "") -> Check:
    return Check(name, float(value), limit, bool(value <= limit), meaning, worry)


def _agreements(claims: Mapping[str, Any], again: ContactResult) -> Iterator[Check]:
    """Fields that are claimed or computed alone, and how far those that are both agree: the worst of each group."""
    computed, units = field_arrays(again), _units(again)
    names = sorted(claims.keys() ^ computed.keys())
    shown = ", ".join(names[:_SHOWN]) + (", …" if len(names) > _SHOWN else "")
    yield _limited(
        "entries", len(names), 0.0, "Number of fields that are missing, or that this problem does not have.",
        f"Not as expected: {shown}.",
    )  # fmt: skip
    worst: dict[str, tuple[float, str]] = {}  # and the field that it is of
    frictionless = {f"{contact.name}.state" for contact in again.problem.contacts if is_frictionless(contact)}
    for name in (name for name in computed if name in claims):
        claimed, wanted = np.asarray(claims[name]), np.asarray(computed[name])
        contact, _, field = name.rpartition(".")
        group, quantity = _GROUPS.get(field, ("tractions", "stress"))
        unit, rounding = units[quantity]
        if name in frictionless:  # older files say stick and slip where there is no friction
            claimed = np.where(claimed > ContactState.OPEN, ContactState.CLOSED, ContactState.OPEN)
        if field.endswith("_between_points") and claimed.dtype.kind == "f":  # in older files the largest of all places
            claimed = np.where((claimed > wanted) & (claimed <= wanted + _BETWEEN * unit), wanted, claimed)
        if quantity == "length" and claimed.shape == wanted.shape and claimed.dtype.kind == "f":
            along = again.problem.mesh.vertices[:, int(field.endswith("y"))]  # from the corner, wherever the body is
            corner, rounding = along.min(), _ULPS * float(np.abs(along).max())
            claimed, wanted = claimed - corner, wanted - corner
        label = f"{contact}: {group}" if contact else group
        worst[label] = max(worst.get(label, (-1.0, "")), (difference(claimed, wanted, unit, rounding), name))
    for label, (value, name) in worst.items():
        counted = name.endswith(".state")
        meaning = "Number of points whose state (open, stick, slip) is another one."
        if not counted:
            meaning = "Stored fields of this group, beside those computed again."
            meaning += f" The worst is {name}." if value > 0.0 else ""
        yield _limited(label, value, 0.0 if counted else AGREEMENT, meaning)


def _units(again: ContactResult) -> dict[str, tuple[float, float]]:
    """Unit of each quantity, 0 where its own entries are that, and what the rounding of the unknowns may change."""
    scales, certified, qvi = again.discretization.scales, again.certificate.scales, again.solution.problem
    stress = certified.get("stress", 1.0) * scales.stress
    z = np.abs(again.solution.z)
    rounding = _ROUNDING * scales.stress * max(float((abs(rows) @ z).max(initial=0.0)) for rows in (qvi.N, qvi.T))
    return {
        "": (0.0, 0.0),
        "length": (again.problem.mesh.length, 0.0),  # longer side of the body's box
        "stress": (stress, rounding),
        "force": (stress * scales.length, rounding * scales.length),
        "displacement": (certified.get("displacement", 1.0) * scales.displacement, 0.0),
        "energy": (certified.get("body_energy", 1.0) * scales.energy, 0.0),
    }


def _status(result: ContactResult, again: ContactResult) -> Check:
    """Whether the status follows from the certificate at the tolerance that the result was solved with."""
    claimed, status, word = result.certificate, result.status, result.status.words
    sound = {name: value for name, value in claimed.measures.items() if value >= 0.0}  # not NaN
    claimed = replace(claimed, measures=dict.fromkeys(EXPONENTS, np.inf) | sound)
    both = claimed, replace(again.certificate, tolerance=claimed.tolerance)
    if status.impossible:
        honest = _evidence(again) is not None
    elif status is Status.SOLVED:
        honest = all(each.passed for each in both)
    else:
        near = status is not Status.INACCURATE or all(each.accuracy <= LOOSEST for each in both)
        honest = near and not any(each.passed for each in both)
    said = re.match(rf"{word}\b", result.solution.message) is not None
    return Check(
        "status", word, None, honest and said,
        "Solved if and only if the certificate passes at the tolerance asked for; inaccurate up to 1e-4. The message "
        "begins with the same word.",
        "The status or the message contradicts the numbers.",
    )  # fmt: skip


def _evidence(again: ContactResult) -> object:
    """What proves an impossible status: a mechanism, computed again, or of the mesh alone Farkas' multipliers."""
    return again.mechanism if again.status is Status.INFEASIBLE else again.solution.farkas
