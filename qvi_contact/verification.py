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
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, finite_number
from qvi_contact.discretization.discretization import Discretization, discretize
from qvi_contact.element import legendre
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.files.archive import OWN, STORE, Archive, result_from_archive, solution_names
from qvi_contact.files.export import field_arrays
from qvi_contact.mesh.edges import vectors_along
from qvi_contact.problem.conditions import Traction, is_frictionless
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.history import History
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.stress import prescribed_and_computed
from solvers import Certificate, FrictionQVI, Status, certify
from solvers.basics.records import dataclass
from solvers.certificate.certificate import EXPONENTS
from solvers.certificate.feasibility import is_farkas
from solvers.factorisation import FactorisationError
from solvers.factorisation.augmented import ORTHOGONAL
from solvers.solution import LOOSEST

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
    fresh = discretize(known.problem, degree=known.space.degree, law_on=known.rule.law_on, scales=known.scales)
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


def compared(claims: Mapping[str, Any], found: Recomputed) -> Iterator[tuple[str, float]]:
    """`difference` of each field that is both claimed and computed, by name."""
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


DOCUMENT_VERSION: Final = 1
"""Grows when an entry of `Verification.document` changes its meaning or goes away."""

_CLAIMED: Final = 0.1  # of its limit, by which a measure may be larger than it was said to be: rounding
_SCALES: Final = 1e-6  # the stiffness of the contact that is in them is as accurate as its factorisation
_BOUND: Final = 10.0  # of the tolerance: results of the fixed point may hold that of its last iteration
_SHOWN: Final = 5  # names in a sentence

_GROUPS: Final = {
    "material": "mesh", "vertices": "mesh", "cells": "mesh",
    "gauss_x": "stresses", "gauss_y": "stresses", "gauss_stress": "stresses",
    "x": "points", "y": "points", "weights": "points", "friction": "points",
    "gap": "gap and slip", "slip": "gap and slip", "state": "states", "motion": "motion",
    "normal_force": "forces", "tangential_force": "forces",
}  # fmt: skip

_MEANINGS: Final = {
    "mesh": "Vertices, cells and materials of the problem.",
    "stresses": "Stress at the Gauss points of all cells, from the stress function.",
    "energies": "Strain energy, work of prescribed displacements, dissipation.",
    "traction_misfit": "Pointwise difference of prescribed and computed tractions.",
    "points": "Coordinates, weights and friction coefficients of the contact points.",
    "tractions": "σ_N, σ_T and the bound of friction, from the unknowns.",
    "gap and slip": "Displacements relative to the obstacle, from the multipliers.",
    "states": "Number of points whose state (open, stick, slip) is another one.",
    "motion": "Motion of the plate driven by force, from the multipliers of its balance.",
    "forces": "Resultants of the tractions of the contact.",
}


@dataclass(frozen=True)
class Check:
    """One row of a verification."""

    name: str
    """What was checked."""
    value: float | str | None
    """What was found, relative; a word for the status; None if there is nothing to tell."""
    limit: float | None
    """Largest absolute value that passes."""
    passed: bool | None
    """None for a fact that cannot fail."""
    meaning: str
    """What the value means."""
    worry: str = ""
    """When to worry, and what to do then."""

    def line(self, width: int) -> str:
        """The row as text, the name filled up to `width`."""
        value = f"{self.value:.1e}" if isinstance(self.value, float) else str(self.value or "")
        limit = "" if self.limit is None else f"{self.limit:.1e}"
        verdict = "" if self.passed is None else "passed" if self.passed else "FAILED"
        return f"{self.name:<{width}}  {value:>8}  {limit:>8}  {verdict}".rstrip()


@dataclass(frozen=True)
class Verification:
    """What became of a verification."""

    rows: tuple[Check, ...]
    """All checks and facts."""
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
        return tuple(row for row in self.rows if row.passed is not None and not row.passed)

    def summary(self) -> str:
        """One line: passed, or what failed."""
        if self.passed:
            return f"verified: {sum(bool(row.passed) for row in self.rows)} checks passed at {self.tolerance:.0e}"
        return f"not verified: {', '.join(row.name for row in self.failures)}"

    def table(self, failures_only: bool = False) -> str:
        """All rows as text, or those that failed, with what they mean, and the summary as the last line."""
        rows = self.failures if failures_only else self.rows
        width = max((len(row.name) for row in rows), default=0)
        lines = [f"{'check':<{width}}  {'value':>8}  {'limit':>8}"] if rows else []
        for row in rows:
            lines += [row.line(width), f"    {row.meaning}"]
            if row in self.failures and row.worry:
                lines.append(f"    {row.worry}")
        return "\n".join([*lines, self.summary()])

    def document(self) -> dict[str, Any]:
        """The same as a document that JSON can hold; numbers that are not finite are None."""
        names = ("name", "value", "limit", "passed", "meaning", "worry")
        return {
            "format": "qvi_contact verification",
            "version": DOCUMENT_VERSION,
            "passed": self.passed,
            "status": str(self.status),
            "tolerance": self.tolerance,
            "failures": [row.name for row in self.failures],
            "checks": [
                {name: None if value in (np.inf, -np.inf) or value != value else value for name, value in row.items()}
                for row in ({name: getattr(each, name) for name in names} for each in self.rows)
            ],
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
    if not isinstance(result, ContactResult):
        raise InputError("result", result, "give a ContactResult, such as solve returns")
    chosen = _tolerance(result, tolerance)
    with np.errstate(all="ignore"):  # what is absurd fails by its numbers
        found = recompute(result, rediscretized(result), chosen)
        same = _limited(
            "problem", problem_difference(result.solution.problem, found.result.solution.problem), AGREEMENT,
            "The algebraic problem that was solved, beside the problem discretised anew.",
        )  # fmt: skip
        rows = (same, *_rows(result, _fields(result), found, _accepted(chosen, tolerance)))
    return Verification(rows, result.status, chosen)


def _fields(result: ContactResult) -> dict[str, Any]:
    """What a result says, names of contacts that are others among it.

    Nothing where contacts are gone that its energies need, so that all of it is missing.
    """
    if not result.has_state:
        return {}
    others = {f"{name}.name": line.name for name, line in result.contacts.items() if line.name != name}
    try:
        return {**field_arrays(result), **others}
    except KeyError:
        return {}


def verify_file(path: str | Path, tolerance: float | None = None) -> Verification:
    """Check everything that a file claims that `qvi_contact.export.write_npz` has written; from the file alone.

    So is a step that `solve_history` has kept in its store. It claims no fields, but an answer and its certificate. The
    tolerance of the certificate is by default the one the result was solved with, which must not be looser than
    `solvers.solution.LOOSEST` then: the file does not choose what it is measured by. `InputError` if the file is no
    such archive, or has no problem, as `qvi_contact.files.archive.load_result` says.
    """
    archive = Archive(path)
    with np.errstate(all="ignore"):  # what is absurd fails by its numbers
        result = result_from_archive(archive)
        chosen = _tolerance(result, tolerance)
        intact = Check(
            "digest", "fits" if archive.intact else "does not", None, archive.intact,
            "SHA-256 of all entries: unchanged since the file was written.",
            "The file was changed after it was written. The other checks show whether the result still holds.",
        )  # fmt: skip
        found = recompute(result, result.discretization, chosen)  # which was made from the file just now
        claims = None  # of stored steps
        if STORE not in archive.arrays:
            others = OWN | solution_names(result)
            claims = {name: archive.array(name) for name in (*found.fields, *archive.arrays) if name not in others}
        rows = (intact, *_rows(result, claims, found, _accepted(chosen, tolerance)))
    return Verification(rows, result.status, chosen)


def _tolerance(result: ContactResult, given: float | None) -> float:
    tolerance = result.certificate.tolerance if given is None else finite_number("tolerance", given)
    if not 0.0 < tolerance < 1.0:
        raise InputError("tolerance", tolerance, "give a number between 0 and 1")
    return tolerance


def _accepted(tolerance: float, given: float | None) -> Check:
    """Whether the tolerance is one that a result may bring along."""
    limit = LOOSEST if given is None else None
    return Check(
        "tolerance", tolerance, limit, None if limit is None else tolerance <= limit,
        "Tolerance of the certificate: the one of the solve, unless another was asked for.",
        "This tolerance is too loose. To accept it, give it by --tolerance, or by the argument tolerance.",
    )  # fmt: skip


def _rows(
    result: ContactResult, claims: Mapping[str, Any] | None, found: Recomputed, accepted: Check
) -> Iterator[Check]:
    yield _status(result, found)
    yield accepted
    if result.status.impossible:
        yield _proof(found)
        return
    for row in found.result.certificate.rows():
        yield Check(row.measure.name, row.value, row.limit, row.passed, row.measure.meaning, row.measure.worry)
    yield _limited(
        "claimed measures", worse_than_claimed(result.certificate, found.result.certificate), _CLAIMED,
        "Largest excess of a measure above the stored one, in units of its limit.",
    )  # fmt: skip
    yield _limited(
        "claimed scales", scales_difference(result.certificate, found.result.certificate), _SCALES,
        "Units of stress, displacement and energy by which the measures are divided.",
    )  # fmt: skip
    if result.has_state:
        if claims is not None:
            yield _entries(claims, found)
            yield from _agreements(claims, found)
        yield _limited(
            "friction bound", bound_difference(result, found), _BOUND * result.certificate.tolerance,
            "Difference of the stored bound of |σ_T| and that of the pressure there, over the largest traction.",
        )  # fmt: skip
        yield _limited(
            "prescribed resultants", missed_tractions(found.result), AGREEMENT,
            "Forces of the prescribed tractions on their edges: equilibrium with the loads.",
        )  # fmt: skip
    yield from _facts(found)


def _limited(name: str, value: float, limit: float, meaning: str) -> Check:
    return Check(name, float(value), limit, bool(value <= limit), meaning)


def _entries(claims: Mapping[str, Any], found: Recomputed) -> Check:
    names = sorted(claims.keys() ^ found.fields.keys())
    shown = ", ".join(names[:_SHOWN]) + (", …" if len(names) > _SHOWN else "")
    return Check(
        "entries", float(len(names)), 0.0, not names,
        "Number of fields that are missing, or that this problem does not have.",
        f"Not as expected: {shown}.",
    )  # fmt: skip


def _agreements(claims: Mapping[str, Any], found: Recomputed) -> Iterator[Check]:
    """Claimed and computed fields, the worst of each group."""
    worst: dict[str, tuple[float, float, str]] = {}
    for condition in found.result.problem.contacts:  # older files say stick and slip where there is no friction
        key = f"{condition.name}.state"
        if is_frictionless(condition) and key in claims:
            closed = np.where(np.asarray(claims[key]) > ContactState.OPEN, ContactState.CLOSED, ContactState.OPEN)
            claims = {**claims, key: closed}
    for name, value in compared(claims, found):
        contact, _, field = name.rpartition(".")
        group = _GROUPS.get(field, "tractions" if contact else field)
        label = f"{contact}: {group}" if contact else group
        limit = 0.0 if field in ("state", "active", "material") else AGREEMENT
        worst[label] = max(worst.get(label, (-1.0, 0.0, "")), (value, limit, group))
    for label, (value, limit, group) in worst.items():
        yield _limited(label, value, limit, _MEANINGS[group])


def _status(result: ContactResult, found: Recomputed) -> Check:
    """Whether the status follows from the certificate at the tolerance that the result was solved with."""
    claimed = sound(result.certificate)
    computed = replace(found.result.certificate, tolerance=claimed.tolerance)
    status, solution = result.status, result.solution
    if status is Status.INFEASIBLE:
        honest = found.result.mechanism is not None
    elif status is Status.INFEASIBLE_ON_MESH:
        honest = solution.farkas is not None
    else:
        honest = _follows(status, claimed) and _follows(status, computed)
    word = status.words
    said = re.match(rf"{word}\b", solution.message) is not None
    return Check(
        "status", word, None, honest and said,
        "Solved if and only if the certificate passes at the tolerance asked for; inaccurate up to 1e-4. The message "
        "begins with the same word.",
        "The status or the message contradicts the numbers.",
    )  # fmt: skip


def _follows(status: Status, certificate: Certificate) -> bool:
    """Whether a result with a state and this certificate has this status."""
    if status is Status.SOLVED:
        return certificate.passed
    return not certificate.passed and (status is not Status.INACCURATE or certificate.accuracy <= LOOSEST)


def _proof(found: Recomputed) -> Check:
    solution = found.result.solution
    proved = solution.farkas is not None and is_farkas(solution.problem, *solution.farkas)
    meaning = "Farkas' multipliers: no admissible traction of this mesh carries the load."
    if found.result.status is Status.INFEASIBLE:
        proved = found.result.mechanism is not None and (proved or solution.farkas is None)
        meaning = (
            "A mechanism, computed again: rigid motions of the blocks on which the loads do more work than contacts "
            "can take up. Farkas' multipliers, where the file has them: no traction of this mesh carries the load."
        )
    return Check(
        "proof", "holds" if proved else "does not", None, proved, meaning,
        "There is no proof that the load cannot be carried.",
    )  # fmt: skip


def _facts(found: Recomputed) -> Iterator[Check]:
    """The law on whole edges, which rows of coefficients promise, and what cannot fail and is worth knowing."""
    result, solution = found.result, found.result.solution
    if result.has_state:
        yield Check(
            "pointwise tractions", result.traction_misfit / found.stress, None, None,
            "Largest difference of prescribed and computed tractions at a point, over the largest on the contact. "
            "Forces and moments on every edge are right. To reduce the difference, refine there.",
        )  # fmt: skip
        lines = result.contacts.values()
        beyond = max((max(line.excess_between_points, line.pull_between_points) for line in lines), default=0.0)
        whole = result.discretization.rule.law_on == "edges"
        limit = _BOUND * result.certificate.tolerance
        yield Check(
            "between points", beyond / found.stress, limit if whole else None,
            bool(beyond <= limit * found.stress) if whole else None,
            "Largest |σ_T| beyond the bound, or pull, anywhere on the contacts, over the largest traction. "
            "Above 0 where the law holds at Gauss points only (law_on='points').",
            "Coefficients do not hold this law between the points: leave law_on out.",
        )  # fmt: skip
    if solution.contraction is not None:
        yield Check(
            "contraction", solution.contraction, None, None,
            "Factor by which the residual of the outer loop shrank in its last iterations; above 0.9 it is slow.",
        )  # fmt: skip
    if "rounding" in solution.certificate.scales:
        yield Check(
            "rounding", solution.certificate.scales["rounding"], None, None,
            "Error from rounding of the unknowns alone, in the energy norm; the energy is accurate to its square.",
        )  # fmt: skip
    with suppress(FactorisationError, ValueError):  # then the certificate has failed by the same
        bound = solution.uniqueness
        yield Check("uniqueness", bound.sharper, None, None, bound.sentence())
    yield Check(
        "not checked", None, None, None,
        "Not computed again: iterations and their history, corrections, timings, method, versions, and the message "
        "after its first words.",
    )  # fmt: skip
