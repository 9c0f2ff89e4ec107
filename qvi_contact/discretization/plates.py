"""Rigid plates driven by force and moment: equality rows, whose multipliers are the plates' motions.

With t the traction on the body, φ included, a plate with prescribed resultants adds the rows A u = b of

    ∫ t_x ds = F_x,   ∫ t_y ds = F_y,   ∫ [(x − x₀) t_y − (y − y₀) t_x] ds = M

divided by ℓ S, or by ℓ r S for the moment, with the contact's length ℓ. A given motion a of the plate would add
Aᵀ(ℓ a) to the load vector. In K z − f + … + Aᵀν = 0 the multiplier takes its place: ℓ a = −ν.

The pivot may be far away. If a force is given, its moment is subtracted from the third row, and the arm at right angles
to it counts from the contact's centre instead of the pivot. r is ℓ, or the remaining arm if that is longer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from qvi_contact.basics.checks import FloatArray, acts, evaluate
from qvi_contact.discretization.loads import ContactRows, EdgePoints, physical, potential_at
from qvi_contact.discretization.scaling import Scales
from qvi_contact.discretization.supports import Supports
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import centre_of, cross, vectors_along
from qvi_contact.problem.conditions import DRIVES
from qvi_contact.problem.problem import ContactProblem

COMPONENTS = tuple(DRIVES)

_DEPENDENT = 1e-9  # rest of a row after projection on the others, over its length, up to which it depends on them
_BALANCED = 1e-9  # imbalance, relative to the loads, up to which it is rounding
_STEPS = 8  # parts of an edge, at whose ends distances from the pin are taken
_SAME = 1e-9  # relative difference up to which two distances are equal


class PlateRow(NamedTuple):
    """One equality row: a component of the resultant about `reference` [length], over a divisor."""

    contact: str
    component: str  # "force_x", "force_y" or "moment"
    given: float  # the prescribed resultant [stress × length]; a moment is about the pivot [stress × length²]
    size: float  # unit of the row's right-hand side, as a resultant
    # unit of the row's multiplier: the plate's motion [length], or rotation [rad], is minus this times the multiplier
    motion: float
    points: EdgePoints  # on the contact, by `EdgePoints.for_resultants`
    reference: tuple[float, float]
    divisor: float

    def factors(self, problem: ContactProblem, scales: Scales) -> FloatArray:
        """Factors of t_x and t_y (m, 2) in the row, without quadrature weights."""
        if self.component != "moment":
            factors = np.tile(np.eye(2)[COMPONENTS.index(self.component)], (len(self.points.weights), 1))
        else:
            x, y = physical(problem, scales, self.points.coordinates)
            factors = np.column_stack([self.reference[1] - y, x - self.reference[0]]) / scales.length
        return factors / self.divisor


@dataclass(frozen=True, eq=False)
class Resultants:
    """Rows of the resultants of driven plates, independent of the prescribed values."""

    full: FloatArray  # (r, N): on all degrees of freedom
    kept: list[int]  # rows that are independent of the rows before them
    combinations: dict[int, FloatArray]  # each other row as a combination of the kept rows before it
    A: FloatArray  # (p, n): the kept rows on the unknowns

    @classmethod
    def on(cls, supports: Supports, problem: ContactProblem, scales: Scales, rows: Sequence[PlateRow]) -> Resultants:
        """The resultants of these rows on the unknowns of the supports, made once and kept."""

        def made() -> Resultants:
            full: FloatArray = np.zeros((len(rows), supports.space.size))
            for on_dofs, row in zip(full, rows, strict=True):
                on_dofs += row.points.traction_load(row.factors(problem, scales), row.points.weights)
            A = np.array([supports.basis.reduced(row) for row in full]).reshape(len(full), len(supports.basis.kept))
            independent, combinations = independent_rows(A, _DEPENDENT * np.linalg.norm(full, axis=1))
            return cls(full, independent, combinations, A[independent])

        edges = ((row.points.edges.number.tobytes(), row.component, row.reference, row.divisor) for row in rows)
        return problem.mesh.kept(cls, (supports, *edges), made)


class PlateRows(NamedTuple):
    """Equality rows in the unknowns z."""

    resultants: Resultants
    b: FloatArray  # (p,): their right-hand sides
    rows: tuple[PlateRow, ...]
    # rows left out because equilibrium with the other loads already gives these resultants; the plates' motions in
    # these components are not determined, and given as zero
    determined: tuple[PlateRow, ...]


def plate_rows(
    problem: ContactProblem,
    scales: Scales,
    contacts: tuple[ContactRows, ...],
    supports: Supports,
    particular: FloatArray,
) -> PlateRows:
    """Rows of all plates, without those that equilibrium already implies; `InputError` if they contradict it."""
    rows, values = list[PlateRow](), list[float]()
    for contact, condition in zip(contacts, problem.contacts, strict=True):
        plate = condition.plate
        if plate is None or not plate.driven:
            continue
        centre, length = centre_of(problem.mesh.vertices, contact.points.edges), float(contact.points.weights.sum())
        reference, points = plate.reference(*centre), contact.points.for_resultants()
        arm = max(abs(at - place) for at, place in zip(centre, reference, strict=True)) / scales.length
        for name in COMPONENTS:
            if (given := getattr(plate, name)) is None:
                continue
            arms = int(name == "moment")  # the power of a length by which the component differs from a force
            divisor = length * max(length, arm) ** arms
            size = scales.stress * divisor * scales.length ** (1 + arms)
            motion = scales.displacement / divisor / scales.length**arms
            rows.append(PlateRow(contact.name, name, float(given), size, motion, points, reference, divisor))
            values.append((plate.moment_about(*centre) if arms else given) / size)
    resultants = Resultants.on(supports, problem, scales, rows)
    b = np.array(values)
    if particular.any():
        b = b - resultants.full @ particular
    if rows and acts(problem.body_potential):
        for index, row in enumerate(rows):  # the resultant of the normal traction φ
            normal_factors = (row.points.normals * row.factors(problem, scales)).sum(axis=1)
            b[index] -= (row.points.weights * normal_factors) @ potential_at(problem, scales, row.points.coordinates)
    # the right-hand side of a dependent row must be the same combination of the kept ones
    kept = resultants.kept
    for index, combination in resultants.combinations.items():
        row, contradiction = rows[index], float(b[index] - combination @ b[kept[: len(combination)]])
        if abs(contradiction) > _BALANCED * max(1.0, float(np.abs(b).max())):
            needed = row.given - contradiction * row.size
            needed = 0.0 if abs(needed) <= _BALANCED * max(abs(row.given), row.size) else needed
            remedy = (
                f"equilibrium of {row.contact!r} with the other loads demands {needed:.6g}: correct it, or leave it out"
            )
            raise InputError(f"RigidPlate.{row.component}", row.given, remedy)
    determined = tuple(row for index, row in enumerate(rows) if index not in kept)
    return PlateRows(resultants, b[kept], tuple(rows[index] for index in kept), determined)


def independent_rows(A: FloatArray, least: FloatArray) -> tuple[list[int], dict[int, FloatArray]]:
    """Rows of A (r, n) with a part orthogonal to earlier rows above `least` (r,), and the others as combinations."""
    kept, combinations, basis = list[int](), dict[int, FloatArray](), np.zeros_like(A)
    for index, row in enumerate(A):
        before, rest = basis[: len(kept)], row
        for _ in range(2):  # the second time removes the rounding of the first
            rest = rest - (before @ rest) @ before
        length = np.linalg.norm(rest)
        if length > least[index]:
            basis[len(kept)] = rest / length
            kept.append(index)
        else:
            combinations[index] = np.linalg.lstsq(A[kept].T, row, rcond=None)[0] if kept else np.zeros(0)
    return kept, combinations


class Pin(NamedTuple):
    """A plate with a disc around its pivot: the gap of its contact is the distance from the disc."""

    name: str
    centre: tuple[float, float]
    misplaced: bool  # whether the nearest edge faces away from the centre
    interference: float  # radius of the pin less radius of the bore in a press fit [length], else 0


def pins(problem: ContactProblem) -> Iterator[Pin]:
    """All pins of a problem.

    If a corner is nearest to the centre, the sum of its two normals decides whether the edge faces away, which is right
    for convex and reentrant corners. In a press fit the bore encloses more than half of the pin, and overlaps with it
    everywhere before loading. The bore's radius is the mean distance of its vertices from the pin's centre, so that a
    circle of chords has the radius of the circle.
    """
    t = np.linspace(0.0, 1.0, _STEPS + 1)
    for contact in problem.contacts:
        if contact.plate is not None:
            edges, centre = problem.mesh.edges(contact.edges), contact.plate.pivot
            x, y = problem.mesh.points_along(edges, t)
            arms = np.stack([centre[0] - x, centre[1] - y], axis=-1)
            distance = np.hypot(arms[..., 0], arms[..., 1])
            radii = distance - evaluate("Contact.gap", contact.gap, x, y)
            if np.ptp(radii) <= _SAME * distance.max() and radii.min() > 0.0:
                nearest, radius = distance <= distance.min() * (1.0 + _SAME), float(radii.mean())
                normals = vectors_along(edges, edges.normal, t, turns=True)
                misplaced = bool((normals[nearest] * arms[nearest]).sum() < 0.0)
                first, second = arms[:, :-1], arms[:, 1:]
                angles = np.abs(np.arctan2(cross(first, second), (first * second).sum(axis=-1)))  # seen from the centre
                enclosed = angles.sum() > np.pi * (1.0 + _SAME) and (radius - distance).min() > _SAME * radius
                interference = radius - float(distance[:, [0, -1]].mean()) if enclosed and not misplaced else 0.0
                yield Pin(contact.name, centre, misplaced, interference)
