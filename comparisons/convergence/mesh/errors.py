"""What the meshes are compared with, how large their errors are, and which of them mean something."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from comparisons.convergence.mesh.data import Data, Mesh
from comparisons.convergence.mesh.problems import Expected, Problem
from comparisons.convergence.mesh.study import BRACKET, COMPANION, REFERENCE, SEQUENCES, UNIFORM
from comparisons.convergence.mesh.tractions import Field, Tractions, difference, size
from comparisons.convergence.orders import fitted_order, successive_orders

FLOOR: Final = 1e-8
"""Relative errors that the accuracy asked of the solves leaves."""

FORCE, ENERGY, TRACTIONS = "force", "energy", "tractions"
SAME: Final = 0.1
"""How far, relatively, a fitted order may be from the expected one to count as the same."""

STEADY: Final = 0.05
"""How far, relatively, the last three orders may be from each other to count as settled."""

FLAT: Final = 0.1
"""An order of this size or below is none: the error does not fall."""


@dataclass(frozen=True)
class Reference:
    """A value to compare with, its uncertainty, what errors are divided by, and where it comes from.

    `sequence` is the one of this study's meshes that it was taken from; empty if it is known from elsewhere.
    """

    value: float
    uncertainty: float
    unit: float
    source: str
    sequence: str = ""

    @property
    def least(self) -> float:
        """Relative errors from here down mean nothing."""
        return max(self.uncertainty / self.unit, FLOOR)


@dataclass(frozen=True, eq=False)
class References:
    """All references of a problem: values by measure, and the tractions with what they are uncertain by."""

    values: Mapping[str, Reference]
    tractions: Field | None
    traction_scale: float
    traction_uncertainty: float
    traction_source: str

    def least(self, measure: str) -> float:
        """Relative errors of this measure from here down mean nothing."""
        if measure == TRACTIONS:
            return max(self.traction_uncertainty, FLOOR)
        return self.values[measure].least

    @property
    def measures(self) -> list[str]:
        """What has a reference: force, energy, tractions, ends of zones."""
        numbers = [name for name in (FORCE, ENERGY) if name in self.values]
        ends = [name for name in self.values if name not in (FORCE, ENERGY)]
        return [*numbers, *([TRACTIONS] if self.tractions is not None else []), *ends]


@dataclass(frozen=True, eq=False)
class Curve:
    """Errors of one measure on one sequence of meshes.

    Attributes
    ----------
    errors : tuple of float
        Relative errors, one for each mesh.
    meant : tuple of bool
        Which of them are above the reference's uncertainty.
    orders : tuple of float or None
        Between successive meshes, in h = (number of cells)^−½.
    fitted : float, optional
        By least squares over the last three that mean something.
    expected : Expected, optional
        What theory says, on equal cells.

    """

    problem: Problem
    sequence: str
    measure: str
    meshes: tuple[Mesh, ...]
    errors: tuple[float, ...]
    meant: tuple[bool, ...]
    orders: tuple[float | None, ...]
    fitted: float | None
    expected: Expected | None

    @property
    def last_order(self) -> float | None:
        """Between the last two meshes whose errors mean something."""
        return next((order for order in reversed(self.orders) if order is not None), None)

    @property
    def settled(self) -> bool:
        """Whether the error falls and the last three orders agree, so that the asymptotic range may be reached."""
        known = [order for order in self.orders if order is not None][-3:]
        return self.falls and len(known) == 3 and max(known) - min(known) <= STEADY * abs(known[-1])

    @property
    def falls(self) -> bool:
        """Whether the error fell on the last two meshes where it means something."""
        return self.last_order is not None and self.last_order > FLAT

    @property
    def flat(self) -> bool:
        """Whether it fell neither there nor, by the fitted order, on the last three."""
        return self.fitted is not None and self.fitted <= FLAT and not self.falls

    @property
    def as_expected(self) -> bool:
        """Whether the error falls, and the fitted order is the expected one."""
        if self.fitted is None or self.expected is None or not self.falls:
            return False
        return abs(self.fitted - self.expected.order) <= SAME * self.expected.order


def references(data: Data, problem: Problem) -> References:
    """Exact and external values where there are any, else the bounds or the two models, whichever is more certain."""
    finest = data.of(problem, REFERENCE)
    values = dict(_numbers(data, problem, finest))
    values |= _ends(data, problem)
    if problem.tractions is not None:
        lines = Tractions.of_record(data.of(problem, UNIFORM)[-1].record).lines
        return References(values, problem.tractions, size(problem.tractions, lines), 0.0, "closed form")
    found = [pair for sequence in (REFERENCE, UNIFORM) if (pair := _last_two(data.of(problem, sequence))) is not None]
    if not found:
        return References(values, None, 1.0, 0.0, "")
    apart, scale, last, mesh = min(found, key=lambda each: each[0])
    source = f"{mesh.cells} cells ({mesh.sequence}); ± the distance to the mesh before"
    return References(values, last, scale, apart, source)


def _last_two(meshes: list[Mesh]) -> tuple[float, float, Tractions, Mesh] | None:
    """Relative distance of the tractions on the last two meshes, the norm of the last, these, and their mesh."""
    if len(meshes) < 2:
        return None
    before, last = (Tractions.of_record(mesh.record) for mesh in meshes[-2:])
    scale = size(last, last.lines)
    return difference(last, before) / scale, scale, last, meshes[-1]


def _numbers(data: Data, problem: Problem, finest: list[Mesh]) -> Iterator[tuple[str, Reference]]:
    """Force and energy."""
    for measure in (FORCE, ENERGY):
        if measure in problem.known:
            known = problem.known[measure]
            yield measure, Reference(known.value, known.uncertainty, abs(known.value), known.source)
            continue
        found = [
            *_two_models(data, problem, finest, measure),
            *(_bracketed(data, problem) if measure == ENERGY else ()),
        ]
        if found:
            yield measure, min(found, key=lambda reference: reference.uncertainty)


def value_of(mesh: Mesh, measure: str) -> float:
    """Force or energy of a mesh."""
    return mesh.force if measure == FORCE else float(mesh.record["energy"])


def _two_models(data: Data, problem: Problem, finest: list[Mesh], measure: str) -> Iterator[Reference]:
    """Stresses and displacements on the finest adaptive mesh: their mean, uncertain by their difference."""
    others = data.of(problem, REFERENCE, COMPANION)
    if finest and others:
        one, other = value_of(finest[-1], measure), value_of(others[-1], measure)
        value = (one + other) / 2.0
        source = f"stresses and displacements on {finest[-1].cells} adaptive cells; ± their difference"
        yield Reference(value, abs(one - other), abs(value), source, REFERENCE)


def _bracketed(data: Data, problem: Problem) -> Iterator[Reference]:
    """The middle of the closest guaranteed bounds of all meshes."""
    known = [mesh for mesh in data.meshes if mesh.problem is problem and mesh.model == BRACKET and mesh.solved]
    closed = [mesh for mesh in known if mesh.record["guaranteed"] and mesh.record["gap"] is not None]
    if closed:
        best = min(closed, key=lambda mesh: float(mesh.record["gap"]))
        value = (best.record["lower"] + best.record["upper"]) / 2.0
        source = f"guaranteed bounds on {best.cells} cells"
        yield Reference(value, abs(best.record["gap"]) / 2.0, abs(value), source, best.sequence)


def _ends(data: Data, problem: Problem) -> dict[str, Reference]:
    """Ends of zones: known, or from the mesh that knows them best."""
    meshes = [mesh for mesh in data.meshes if mesh.problem is problem and mesh.solved and "ends" in mesh.record]
    length = max((mesh.record["lines"][-1] - mesh.record["lines"][0] for mesh in meshes), default=1.0)
    found = {
        name: Reference(known.value, known.uncertainty, length, known.source)
        for name, known in problem.known.items()
        if name not in (FORCE, ENERGY)
    }
    for kind in _kinds(data, problem):
        candidates = list(_candidates(data, problem, kind, length))
        if kind not in found and candidates:
            found[kind] = min(candidates, key=lambda each: each.uncertainty)
    return found


def _candidates(data: Data, problem: Problem, kind: str, length: float) -> Iterator[Reference]:
    """What each mesh that has a coarser one before it says of an end, and how uncertain that is.

    The middle of the root and the extrapolated end, uncertain by what is not known on the mesh and by twice the
    distance to the mesh before: ends converge slowly, with an order of about ½ to 1.
    """
    for sequence in SEQUENCES:
        seen = [(mesh, end) for mesh in data.of(problem, sequence) if (end := end_of(mesh, kind)) is not None]
        for (_, before), (mesh, end) in pairwise(seen):
            middle = _middle(end)
            least = uncertainty(end) + 2.0 * abs(middle - _middle(before))
            source = f"{mesh.cells} cells ({sequence}); ± its own two values and twice the distance to the mesh before"
            yield Reference(middle, least, length, source, sequence)


def _middle(end: Mapping[str, Any]) -> float:
    """Between the root and the extrapolated end."""
    other = end["position"] if end["extrapolated"] is None else end["extrapolated"]
    return float(end["position"] + other) / 2.0


def _kinds(data: Data, problem: Problem) -> list[str]:
    """The ends that the finest mesh of equal cells shows: on coarse ones single edges may seem to be zones."""
    equal = data.of(problem, UNIFORM)
    ends = equal[-1].record["ends"] if equal else []
    return [kind for kind in dict.fromkeys(end["kind"] for end in ends) if end_of(equal[-1], kind) is not None]


def uncertainty(end: Mapping[str, Any]) -> float:
    """What is not known about an end: its distance to the extrapolated one, and between the points around it."""
    apart = 0.0 if end["extrapolated"] is None else abs(end["position"] - end["extrapolated"])
    return float(max(apart, end["high"] - end["low"]))


def end_of(mesh: Mesh, kind: str) -> Mapping[str, Any] | None:
    """The end of this kind, if the mesh has just one: with several it does not show the zones there are."""
    found: list[Mapping[str, Any]] = [end for end in mesh.record.get("ends", ()) if end["kind"] == kind]
    return found[0] if len(found) == 1 else None


def error_of(mesh: Mesh, measure: str, known: References) -> float | None:
    """Relative error, None where the mesh has no such value."""
    if measure == TRACTIONS:
        return _traction_error(mesh, known)
    reference = known.values[measure]
    if measure in (FORCE, ENERGY):
        return abs(value_of(mesh, measure) - reference.value) / reference.unit
    end = end_of(mesh, measure)
    return None if end is None else abs(end["position"] - reference.value) / reference.unit


def _traction_error(mesh: Mesh, known: References) -> float | None:
    if known.tractions is None or "lines" not in mesh.record:
        return None
    return difference(Tractions.of_record(mesh.record), known.tractions) / known.traction_scale


def curve(data: Data, problem: Problem, known: References, sequence: str, measure: str) -> Curve | None:
    """Errors along a sequence; None without any."""
    pairs = [(mesh, error_of(mesh, measure, known)) for mesh in data.of(problem, sequence)]
    found = [(mesh, error) for mesh, error in pairs if error is not None]
    if not found:
        return None
    meshes, errors = zip(*found, strict=True)
    meant = tuple(error > known.least(measure) for error in errors)
    usable = [error if means else None for error, means in zip(errors, meant, strict=True)]
    sizes = [mesh.h for mesh in meshes]
    expected = problem.expected.get(measure) if sequence == UNIFORM else None
    orders = tuple(_orders(sizes, usable))
    return Curve(problem, sequence, measure, meshes, errors, meant, orders, fitted_order(sizes, usable), expected)


def _orders(sizes: list[float], errors: list[float | None]) -> list[float | None]:
    """Successive orders; none between two meshes with the same number of cells."""
    distinct = [index for index, size in enumerate(sizes) if not index or size != sizes[index - 1]]
    found = dict(
        zip(distinct, successive_orders([sizes[i] for i in distinct], [errors[i] for i in distinct]), strict=True)
    )
    return [found.get(index) for index in range(len(sizes))]
