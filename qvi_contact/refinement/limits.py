"""Refinement for limit loads: bisected is where the mesh gives way in another manner than the body would.

At the limit a mesh gives way by a motion with the opening w and the slip s against the shear: the multipliers of its
rows. It obeys the law in the sense of the rows. At points the body may enter the obstacle, or slip without the opening
that friction asks for. The part of an edge is the work that the law gives the motion, made admissible at points, less
that of the tractions:

    w' = max(w, μ|s|)   (w' = max(w, 0) under a cap),     ∫ (π(w', s) − |σ_N| w' − σ_T s) ds ≥ 0,

for unilateral contacts, with π of (D23). It is zero on all edges if the mesh gives way as the body would, and of the
size of pressure times motion on the edge in which the body turns, or where slip ends. The mechanism of the body alone
does not say where to refine: where another one is near its limit too, the mesh may lack stresses for both.

In `docs/theory.md`: (D25).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.units import Certainty
from qvi_contact.discretization.loads import ContactRows
from qvi_contact.errors import InputError
from qvi_contact.limit.load_factor import LimitAnalysis, LimitProblem
from qvi_contact.mesh.edges import Edges, cross
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import RefinementStatus, Round, Settings, StopError, TooLargeError, bulk
from qvi_contact.refinement.triangles import at_contacts, outline_vertices
from qvi_contact.solution.stress import loads_followed

_SPACE: Final = ("degree", "law_on")  # options of a limit load
_SMALL: Final = 1e-6  # factors below count as this for relative errors
_TWICE: Final = 2  # bisections of a triangle that halve all its edges
_SHARE: Final = 0.6  # of the gap that is divided where bodies yield, at most
_LEAST_SHARE: Final = 0.15
_REMOVED: Final = 0.9  # of what is divided vanishes, about: fans become finer as a whole
_INSIDE: Final = 0.95  # of the target is aimed at
_SECTOR: Final = np.pi / 48.0  # smallest angle of fans [rad]
_BLUNT: Final = 0.8 * np.pi  # angle of a corner from which on a change of conditions needs a fan [rad]
_FLAT: Final = 1e-6  # of a straight angle that is rounding
_VIOLATED: Final = 1e-7  # of the largest limit of tractions: violation that counts as rounding


def law_gap(
    rows: ContactRows, normal: FloatArray, shear: FloatArray, opening: FloatArray, slip: FloatArray
) -> FloatArray:
    """The parts (m,) of the points of a contact, by σ_N and σ_T there, and by w and s times the weights of the points.

    All of them have the shape (m,), and are dimensionless.
    """
    size, friction, unilateral = np.abs(slip), rows.limits.friction, ~rows.bilateral
    capped, rough = np.isfinite(rows.limits.cap), friction > 0.0
    admitted = np.maximum(opening, np.where(capped, 0.0, friction * size))
    opening = np.where(unilateral, admitted, opening)
    room = np.divide(np.maximum(opening, 0.0), friction, out=size.copy(), where=rough)
    dilatant = np.where(unilateral, np.minimum(size, room), np.where(rough, 0.0, size))
    work = np.minimum(rows.limits.cohesion, rows.limits.cap) * dilatant
    work += np.where(capped, rows.limits.cap, 0.0) * (size - dilatant)
    return np.asarray(np.maximum(work - normal * opening - shear * slip, 0.0))


@dataclass(frozen=True)
class LimitStrategy:
    """Both sides of a limit load, see `outcome.Strategy`."""

    problem: ContactProblem
    settings: Settings
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name, value in self.settings.options.items():
            if name not in _SPACE:
                raise InputError(name, value, "is not for limit loads: give degree or law_on")

    def answer(self, mesh: TriangleMesh) -> LimitAnalysis:
        """Both sides on the mesh."""
        problem = self.problem if self.problem.mesh is mesh else replace(self.problem, mesh=mesh)
        posed = LimitProblem.of(problem, self.names, **self.settings.options)
        if posed.unknowns > self.settings.max_unknowns:
            raise TooLargeError(posed.unknowns)
        return posed.solved()

    def assessed(self, mesh: TriangleMesh, answer: LimitAnalysis, _earlier: Sequence[Round], /) -> Round:
        """How far apart both sides are; and on which edges, or of a body that yields in which triangles."""
        limit = answer.limit
        if limit.violation > _VIOLATED:
            text = f"the stresses of the mesh violate the contact laws by {limit.violation:.1e}"
            raise StopError(RefinementStatus.THIN_CELLS, text)
        same = limit.lower == limit.upper  # both may be infinite
        unit = max(abs(limit.upper), _SMALL) if np.isfinite(limit.upper) else 1.0
        estimate = 0.0 if same else max(limit.upper - limit.lower, 0.0) / unit
        exact = np.isfinite(estimate) and loads_followed(answer.posed.low) and loads_followed(answer.posed.high)
        if self.problem.yields:
            parts = np.ones(mesh.cell_count) if limit.collapse is None else limit.collapse.gap
            needed = (1.0 - _INSIDE * self.settings.target / max(estimate, self.settings.target)) / _REMOVED
            finer = partial(self._finer_where_it_yields, mesh, parts, min(max(needed, _LEAST_SHARE), _SHARE))
            exact &= not mesh.curved.any()  # strengths hold on the straight triangles
        else:
            on_edges, parts = list(_edge_gaps(answer)), np.zeros(mesh.cell_count)
            for edges, part in zip(_limited_edges(answer.posed.problem), on_edges, strict=True):
                inside = edges.cells >= 0
                for side in (0, 1):  # in equal shares for the cells beside an edge
                    np.add.at(parts, edges.cells[inside[:, side], side], (part / inside.sum(axis=1))[inside[:, side]])
            finer = partial(self._finer_at_contacts, mesh, on_edges)
        return Round(
            answer=answer, unknowns=answer.posed.unknowns, value=limit.lower, unit=unit, estimate=estimate,
            certainty=Certainty.GUARANTEED if exact else Certainty.ESTIMATE, parts=parts, finer=finer,
        )  # fmt: skip

    def _finer_at_contacts(self, mesh: TriangleMesh, parts: Sequence[FloatArray]) -> TriangleMesh | None:
        """Triangles beside the edges that have most of the distance bisected twice."""
        joined = np.concatenate([np.empty(0), *parts])
        if not joined.size:
            raise StopError(RefinementStatus.UNSOLVED, "there is no contact that limits tractions")
        problem = replace(self.problem, mesh=mesh)
        long = np.concatenate([edges.length for edges in _limited_edges(problem)]) >= 2.0 * self.settings.thinnest
        beside = np.concatenate([edges.cells for edges in _limited_edges(problem)])
        cells = np.unique(beside[bulk(joined) & long])
        cells = cells[cells >= 0]
        if not len(cells):
            return None
        fine = mesh
        for _ in range(_TWICE):
            fine = fine.refined(at_contacts(problem, mesh, fine, cells))
        return fine

    def _finer_where_it_yields(self, mesh: TriangleMesh, parts: FloatArray, share: float) -> TriangleMesh | None:
        """Triangles with a share of the gap divided; where they meet a singular vertex its fan becomes finer."""
        marked = bulk(parts, share)
        singular = singular_vertices(replace(self.problem, mesh=mesh))
        at = singular[[bool((marked & (mesh.cells == vertex).any(axis=1)).any()) for vertex in singular]]
        around = np.isin(mesh.cells, at).any(axis=1)
        one, other = (mesh.corners[:, corner] - mesh.corners[:, 0] for corner in (1, 2))
        areas = np.abs(cross(one, other)) / 2.0
        chosen = np.flatnonzero(marked & ~around & (np.sqrt(areas) >= 2.0 * self.settings.thinnest))
        if not len(chosen) and not len(at):
            return None
        fine = mesh.refined(chosen) if len(chosen) else mesh
        for vertex in at.tolist():
            widest = float(_angles(fine)[fine.cells == vertex].max())
            fine = fine.fanned(np.array([vertex]), max(widest / 2.0, _SECTOR))
        return fine


def singular_vertices(problem: ContactProblem) -> IntArray:
    """Vertices of the boundary where stresses turn quickly around a point.

    The outline turns inwards there, or conditions change where it does not turn outwards by much; straight sides only.
    """
    vertices, angle, changes, bent = outline_vertices(problem)
    inwards = angle > np.pi * (1.0 + _FLAT)
    return vertices[~bent & (inwards | (changes & (angle > _BLUNT)))]


def _angles(mesh: TriangleMesh) -> FloatArray:
    """Angles of all triangles (m, 3) [rad]."""
    one, other = (np.roll(mesh.corners, -shift, axis=1) - mesh.corners for shift in (1, 2))
    return np.asarray(np.abs(np.arctan2(cross(one, other), (one * other).sum(axis=-1))))


def _limited_edges(problem: ContactProblem) -> Iterator[Edges]:
    """Edges of each contact that limits tractions, in the order of the problem."""
    for contact in problem.contacts:
        if contact.law != "tied":
            yield problem.mesh.edges(contact.edges)


def _edge_gaps(answer: LimitAnalysis) -> Iterator[FloatArray]:
    """Part (n,) of the edges of each contact in what the mesh falls short of; 1 for all where there is no state."""
    posed, carried = answer.posed, answer.carried
    if carried is None or carried.tractions is None or carried.motion is None:
        yield from (np.ones(len(edges)) for edges in _limited_edges(posed.problem))
        return
    rule = posed.low.rule
    normal, shear = (rule.at_points(half) for half in np.split(carried.tractions, 2))
    opening, slip = (rule.multipliers_at_points(half) for half in np.split(carried.motion, 2))
    for rows in posed.low.contacts:
        if rows.law != "tied":
            held = rows.rows
            parts = law_gap(rows, normal[held], shear[held], opening[held], slip[held])
            yield parts.reshape(-1, rule.count).sum(axis=1)
