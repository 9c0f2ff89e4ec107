"""Rigid plates driven by force and moment: equality rows, whose multipliers are the plates' motions.

With t the traction on the body, φ included, a plate with prescribed resultants adds the rows A u = b of

    ∫ t_x ds = F_x,   ∫ t_y ds = F_y,   ∫ [(x − x₀) t_y − (y − y₀) t_x] ds = M

divided by ℓ S, moments by ℓ r S, with ℓ the contact's length. A motion a of the plate would enter the load vector as
Aᵀ(ℓ a), and stationarity K z − f + … + Aᵀν = 0 has the multiplier in its place: ℓ a = −ν.

Wherever a force is given, its moment is taken off the third row and arms count from the contact's centre instead of the
pivot, however far away that is; r is ℓ, or the arm that is left if a force is not given and the pivot is farther away.
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

_DEPENDENT = 1e-9  # a row that is shorter than this, less its part along the others, follows from equilibrium
_BALANCED = 1e-9  # imbalance, relative to the loads, that passes as round-off
_STEPS = 8  # of an edge, at whose ends distances are taken
_SAME = 1e-9  # share of a distance up to which two are one


class PlateRow(NamedTuple):
    """One equality row: a component of the resultant about a reference point [length], over a divisor."""

    contact: str
    component: str  # "force_x", "force_y" or "moment"
    given: float  # the prescribed resultant [stress × length], moments about the pivot [stress × length²]
    size: float  # the resultant that 1 on the row's right-hand side stands for
    # minus this times the row's multiplier is the plate's motion [length], for a moment the rotation [rad]
    motion: float
    points: EdgePoints  # of the contact, enough for resultants
    reference: tuple[float, float]
    divisor: float

    def factors(self, problem: ContactProblem, scales: Scales) -> FloatArray:
        """By what t_x and t_y count, shape (m, 2), weights left out."""
        if self.component != "moment":
            found = np.tile(np.eye(2)[COMPONENTS.index(self.component)], (len(self.points.weights), 1))
        else:
            x, y = physical(problem, scales, self.points.coordinates)
            found = np.column_stack([self.reference[1] - y, x - self.reference[0]]) / scales.length
        return found / self.divisor


@dataclass(frozen=True, eq=False)
class Resultants:
    """Resultants of driven plates as rows, the same whatever they are."""

    full: FloatArray  # (r, N): from all degrees of freedom
    kept: list[int]  # rows that those before them do not determine
    combinations: dict[int, FloatArray]  # the others as combinations of the kept ones before them
    A: FloatArray  # (p, n): the kept rows on the unknowns

    @classmethod
    def on(cls, supports: Supports, problem: ContactProblem, scales: Scales, rows: Sequence[PlateRow]) -> Resultants:
        """Those of supports, made once."""

        def made() -> Resultants:
            full: FloatArray = np.zeros((len(rows), supports.space.size))
            for found, row in zip(full, rows, strict=True):
                found += row.points.traction_load(row.factors(problem, scales), row.points.weights)
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
    # resultants left out because equilibrium with the other loads gives them anyway; motions in these components are
    # not determined, and taken as zero
    determined: tuple[PlateRow, ...]


def plate_rows(
    problem: ContactProblem,
    scales: Scales,
    contacts: tuple[ContactRows, ...],
    supports: Supports,
    particular: FloatArray,
) -> PlateRows:
    """Rows of all plates, but those that follow from the rest of the problem; `InputError` if they contradict it."""
    rows, values = list[PlateRow](), list[float]()
    for contact, condition in zip(contacts, problem.contacts, strict=True):
        plate = condition.plate
        driven = {name: float(value) for name in COMPONENTS if (value := getattr(plate, name, None)) is not None}
        if plate is None or not driven:
            continue
        centre, length = centre_of(problem.mesh.vertices, contact.points.edges), float(contact.points.weights.sum())
        reference, points = plate.reference(*centre), contact.points.for_resultants()
        arm = max(abs(at - place) for at, place in zip(centre, reference, strict=True)) / scales.length
        for name, given in driven.items():
            arms = int(name == "moment")  # how many lengths the component has beside that of a force
            divisor = length * max(length, arm) ** arms
            size = scales.stress * divisor * scales.length ** (1 + arms)
            motion = scales.displacement / divisor / scales.length**arms
            rows.append(PlateRow(contact.name, name, given, size, motion, points, reference, divisor))
            values.append((plate.moment_about(*centre) if arms else given) / size)
    resultants = Resultants.on(supports, problem, scales, rows)
    b = np.array(values)
    if particular.any():
        b = b - resultants.full @ particular
    if rows and acts(problem.body_potential):
        for index, row in enumerate(rows):  # what φ contributes
            along = (row.points.normals * row.factors(problem, scales)).sum(axis=1)
            b[index] -= (row.points.weights * along) @ potential_at(problem, scales, row.points.coordinates)
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
    """Rows (r, n) of which those before leave more than a length `least` (r,), and the others as their combinations."""
    kept, combinations, basis = list[int](), dict[int, FloatArray](), np.zeros_like(A)
    for index, row in enumerate(A):
        before, rest = basis[: len(kept)], row
        for _ in range(2):  # once more for rounding
            rest = rest - (before @ rest) @ before
        size = np.linalg.norm(rest)
        if size > least[index]:
            basis[len(kept)] = rest / size
            kept.append(index)
        else:
            combinations[index] = np.linalg.lstsq(A[kept].T, row, rcond=None)[0] if kept else np.zeros(0)
    return kept, combinations


class Pin(NamedTuple):
    """A plate whose gap is the distance from a disc around its pivot."""

    name: str
    centre: tuple[float, float]
    misplaced: bool  # whether the edge nearest to the centre faces away from it
    interference: float  # the radius less that of the bore in a press fit [length], else 0


def pins(problem: ContactProblem) -> Iterator[Pin]:
    """All pins of a problem.

    At a corner that is nearest the normals of both its edges count together, which is right whichever way it turns. In
    a press fit the bore goes around more than half of the pin, and overlaps with it everywhere before anything is
    loaded. Its radius is the mean distance of its vertices from the pin's centre, which is right for chords of a circle
    too.
    """
    t = np.linspace(0.0, 1.0, _STEPS + 1)
    for contact in problem.contacts:
        if contact.plate is not None:
            edges, centre = problem.mesh.edges(contact.edges), contact.plate.pivot
            x, y = problem.mesh.points_along(edges, t)
            arms = np.stack([centre[0] - x, centre[1] - y], axis=-1)
            away = np.hypot(arms[..., 0], arms[..., 1])
            radii = away - evaluate("Contact.gap", contact.gap, x, y)
            if np.ptp(radii) <= _SAME * away.max() and radii.min() > 0.0:
                nearest, radius = away <= away.min() * (1.0 + _SAME), float(radii.mean())
                normals = vectors_along(edges, edges.normal, t, turns=True)
                misplaced = bool((normals[nearest] * arms[nearest]).sum() < 0.0)
                first, second = arms[:, :-1], arms[:, 1:]
                turns = np.abs(np.arctan2(cross(first, second), (first * second).sum(axis=-1)))  # of edges either way
                enclosed = turns.sum() > np.pi * (1.0 + _SAME) and (radius - away).min() > _SAME * radius
                interference = radius - float(away[:, [0, -1]].mean()) if enclosed and not misplaced else 0.0
                yield Pin(contact.name, centre, misplaced, interference)
