"""How far off an answer is, by what it is compared with: bounds where the contact laws allow them, else a closer look.

A closer look at an answer is one degree more, on a mesh bisected where one degree more says little.

The difference of the two is what an answer of degree p is off by, as far as the closer look is better by a factor. For
smooth stresses a degree is enough. It is not

* where a contact changes its state inside an edge. The law binds tractions between stick and slip only as far as
  polynomials on one edge can follow both, with any degree: edges that hold a change, and the two that meet in one, are
  bisected twice, which takes a factor of about 16 off this part of a force;
* in corners, where stresses may behave like r^(λ−1): triangles at vertices where the conditions on the boundary change,
  at re-entrant corners and at the ends of joints are bisected twice, which takes 4^(2λ) off. A zone of stick or slip
  that is too small for the mesh hides there too.

In `docs/theory.md`: (D22).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.basics.shown import Certainty
from qvi_contact.mesh.edges import Edges, frames_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Contact, has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import Measure
from qvi_contact.solution.contact_line import ContactLine, ContactState
from qvi_contact.solution.result import ContactResult

_CROSSED: Final = 1e-9  # of the strain energy: lower − upper that is more than rounding

_IN_CORNERS: Final = 3  # how often triangles are bisected there
_AT_CHANGES: Final = 2
_MOST: Final = 3.0  # cells of the closer mesh over those of the answer, above which corners are left as they are,
_FREE: Final = 100  # and as many more
_TURN: Final = np.deg2rad(10.0)  # by which the boundary turns inwards where it has a corner
_NOISE: Final = 1e-6  # of the unit: tractions below have no direction
_LEFTWARD: Final = 1 + max(ContactState)  # slip the other way


@dataclass(frozen=True, eq=False)
class Comparison:
    """An answer beside something else.

    Attributes
    ----------
    error : float
        Of the quantity, in its own unit.
    certainty : Certainty
        Whether it is a bound.
    parts : (cells,) array
        What each cell has of the distance between the two [stress × length²], ≥ 0.
    looked : float
        The quantity in a closer look; NaN where there was none.

    """

    error: float
    certainty: Certainty
    parts: FloatArray
    looked: float = np.nan


def coulomb_contacts(problem: ContactProblem) -> list[Contact]:
    """The contacts whose friction bound depends on the pressure."""
    return [contact for contact in problem.contacts if has_coulomb(contact)]


def bounded(measure: Measure, value: float, result: ContactResult) -> Comparison | None:
    """The value of an answer beside bounds of it, if they are guaranteed: under Coulomb friction those of forces."""
    bracket = result.bracket
    coulomb = bracket.coulomb
    if coulomb is not None and coulomb.guaranteed and measure.name in coulomb.forces:
        lower, upper = coulomb.forces[measure.name]
        return Comparison(max(upper - value, value - lower, 0.0), Certainty.GUARANTEED, coulomb.cells)
    if bracket.reasons or not np.isfinite(bracket.gap) or bracket.gap < -_CROSSED * bracket.strain:
        return None
    if measure.name == "energy":
        lower, upper = -bracket.upper, -bracket.lower
    elif measure.name in bracket.forces:
        lower, upper = bracket.forces[measure.name].lower, bracket.forces[measure.name].upper
    else:
        return None
    return Comparison(max(upper - value, value - lower, 0.0), bracket.certainty, bracket.cell_gaps)


@dataclass(frozen=True, eq=False)
class Places:
    """Where a mesh is bisected for a closer look.

    Attributes
    ----------
    cells : (k,) int array
        Triangles at contact edges that hold, or meet in, a change of state.
    corners : (c,) int array
        Vertices where stresses may be singular.

    """

    cells: IntArray
    corners: IntArray


def places(problem: ContactProblem, mesh: TriangleMesh, result: ContactResult) -> Places:
    """Where an answer on a mesh is looked at more closely."""
    return Places(_changing_cells(mesh, result), _corners(problem))


def closer_problem(problem: ContactProblem, mesh: TriangleMesh, at: Places) -> ContactProblem:
    """The problem on the mesh bisected for a closer look."""
    fine = mesh
    for level in range(_IN_CORNERS):
        chosen = at_contacts(problem, mesh, fine, at.cells if level < _AT_CHANGES else at.cells[:0])
        near = np.isin(fine.cells, at.corners).any(axis=1)  # old vertices keep their numbers
        if len(fine.cells) + 2 * near.sum() <= _MOST * len(mesh.cells) + _FREE:
            chosen |= near
        if chosen.any():
            fine = fine.refined(chosen)
    return replace(problem, mesh=fine)


def at_contacts(problem: ContactProblem, mesh: TriangleMesh, fine: TriangleMesh, cells: IntArray) -> BoolArray:
    """Triangles (m,) of a finer mesh at contacts that lie in those cells."""
    found = np.zeros(len(fine.cells), dtype=bool)
    if len(cells):
        beside = np.concatenate([fine.edges(contact.edges).cells.ravel() for contact in problem.contacts])
        beside = np.unique(beside[beside >= 0])
        found[beside] = np.isin(mesh.locate(fine.corners[beside].mean(axis=1)), cells)
    return found


def _changing_cells(mesh: TriangleMesh, result: ContactResult) -> IntArray:
    """Triangles at contact edges that hold, or meet in, a change of state."""
    found = [np.empty(0, dtype=np.int64)]
    unit = result.discretization.scales.stress
    for contact in result.problem.contacts:
        edges = mesh.edges(contact.edges)
        chosen = edges.cells[_changing(edges, result.contacts[contact.name], unit)]
        found.append(chosen[chosen >= 0])
    return np.unique(np.concatenate(found))


def _changing(edges: Edges, line: ContactLine, unit: float) -> BoolArray:
    """Which edges (n,) of a contact hold, or meet in, a change of state; slip to either side is a state of its own."""
    leftward = (line.state == ContactState.SLIP) & (line.counted_shear < -_NOISE * unit)
    state = np.where(leftward, _LEFTWARD, line.state).reshape(len(edges), -1)
    at_ends = np.concatenate([state[:, 0], state[:, -1]])
    vertex, inverse = np.unique(np.concatenate([edges.first, edges.second]), return_inverse=True)
    lowest, highest = np.full(len(vertex), _LEFTWARD), np.zeros(len(vertex), dtype=np.int64)
    np.minimum.at(lowest, inverse, at_ends)
    np.maximum.at(highest, inverse, at_ends)
    meets = (lowest != highest)[inverse].reshape(2, -1).any(axis=0)
    return np.asarray((state != state[:, :1]).any(axis=1) | meets)


def _corners(problem: ContactProblem) -> IntArray:
    """Vertices where conditions change or the boundary turns inwards, and where joints end or meet."""
    return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *_boundary_corners(problem), *_joint_ends(problem)]))


def _boundary_corners(problem: ContactProblem) -> Iterator[IntArray]:
    """Vertices of the boundary between two edges with different conditions, or where it turns inwards."""
    boundary, owners = problem.mesh.boundary, problem.owners
    vertex = np.concatenate([boundary.first, boundary.second])
    order = np.argsort(vertex, kind="stable")
    edge = np.tile(np.arange(len(boundary)), 2)[order].reshape(-1, 2)  # a body of one piece: two edges a vertex
    middles = np.stack(problem.mesh.points_along(boundary, np.array([0.5])), axis=-1)[:, 0]
    one, other = edge.T
    differ = (owners[:, one] != owners[:, other]).any(axis=0)
    across = middles[other] - middles[one]
    inwards = (across * boundary.normal[one]).sum(axis=1) > 0.0
    normals = frames_along(boundary, np.array([0.0, 1.0]))[0]
    here = vertex[order][::2]
    first, second = (normals[each, np.where(boundary.first[each] == here, 0, 1)] for each in (one, other))
    turn = np.arccos(np.clip((first * second).sum(axis=1), -1.0, 1.0))
    yield vertex[order][::2][differ | (inwards & (turn > _TURN))]


def _joint_ends(problem: ContactProblem) -> Iterator[IntArray]:
    """Vertices where edges of joints do not go on as one line."""
    edges = [problem.mesh.edges(contact.edges) for contact in problem.joints]
    if edges:
        ends = np.concatenate([np.concatenate([each.first, each.second]) for each in edges])
        vertex, count = np.unique(ends, return_counts=True)
        yield vertex[count != 2]


def energies_between(answer: ContactResult, look: ContactResult, mesh: TriangleMesh, fine: TriangleMesh) -> FloatArray:
    """½ ∫ c(σ − τ):(σ − τ) over each triangle of the answer's mesh, τ from the closer look [stress × length²]."""
    space, scales = look.discretization.space, look.discretization.scales
    cells, t = np.arange(len(fine.cells)), space.cell_points
    parents = fine.parents(mesh)
    points = fine.corners.swapaxes(1, 2)[:, None] @ fine.placed(cells, t)[..., None]
    flat = mesh.reference(np.repeat(parents, len(t)), points.reshape(-1, 2))
    apart = _stress(look, cells, t) - _stress(answer, parents, flat.reshape(len(cells), len(t), 3))
    work = ((apart @ look.problem.compliances) * apart).sum(axis=2) * space.cell_measures(t, space.cell_weights)
    return np.asarray(np.bincount(parents, 0.5 * scales.length**2 * work.sum(axis=1), len(mesh.cells)), float)


def _stress(result: ContactResult, cells: IntArray, t: FloatArray) -> FloatArray:
    """Stress without body potential at reference points in cells [stress]."""
    known = result.discretization
    return known.scales.stress * known.space.stress(known.coefficients(result.dofs), cells, t)
