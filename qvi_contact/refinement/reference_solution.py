"""How far off an answer is, by what it is compared with: bounds where the laws allow them, else a reference solution.

The reference is one degree more, on a mesh bisected where one degree more says little. The difference of the two is
what an answer of degree p is off by, as far as the reference is better by a factor. For smooth stresses a degree is
enough. It is not

* where a contact changes its state inside an edge. The law binds tractions between stick and slip only as far as
  polynomials on one edge can follow both, with any degree: edges that hold a change, and the two that meet in one, are
  bisected twice, which takes a factor of about 16 off this part of a force;
* in corners, where stresses may behave like r^(λ−1): triangles at vertices where the conditions on the boundary change,
  at re-entrant corners and at the ends of joints are bisected twice, which takes 4^(2λ) off. A zone of stick or slip
  that is too small for the mesh hides there too.

In `docs/theory.md`: (D22).
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate
from qvi_contact.basics.units import Certainty
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.mesh.edges import frames_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import SPRINGS
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.measure import Measure
from qvi_contact.solution.contact_line import ContactState
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
    reference : float
        The quantity of a reference solution; NaN where there was none.

    """

    error: float
    certainty: Certainty
    parts: FloatArray
    reference: float = np.nan


def bounded(measure: Measure, value: float, result: ContactResult) -> Comparison | None:
    """The value of an answer beside bounds of it: guaranteed ones, under Coulomb friction also estimated ones."""
    bracket = result.bracket
    coulomb, certainty, parts = bracket.coulomb, bracket.certainty, bracket.cell_gaps
    if coulomb is not None and measure.name in coulomb.forces:
        (lower, upper), parts = coulomb.forces[measure.name], coulomb.cells
    elif bracket.reasons or not np.isfinite(bracket.gap) or bracket.gap < -_CROSSED * bracket.strain:
        return None
    elif measure.name == "energy":
        lower, upper = -bracket.upper, -bracket.lower
    elif measure.name in bracket.forces:
        lower, upper = bracket.forces[measure.name]
    else:
        return None
    return Comparison(max(upper - value, value - lower, 0.0), certainty, parts)


@dataclass(frozen=True, eq=False)
class Places:
    """Where a mesh is bisected for a reference solution.

    Attributes
    ----------
    cells : (k,) int array
        Triangles at contact edges that hold, or meet in, a change of state.
    corners : (c,) int array
        Vertices where stresses may be singular.

    """

    cells: IntArray
    corners: IntArray


def places(result: ContactResult) -> Places:
    """Where a reference solution for an answer is refined.

    Slip to either side is a state of its own. Corners are vertices where conditions change or the boundary turns
    inwards, and where joints end or meet.
    """
    problem, mesh, unit = result.problem, result.problem.mesh, result.discretization.scales.stress
    cells = [np.empty(0, dtype=np.int64)]
    for contact in problem.contacts:
        edges, line = mesh.edges(contact.edges), result.contacts[contact.name]
        leftward = (line.state == ContactState.SLIP) & (line.counted_shear < -_NOISE * unit)
        state = np.where(leftward, _LEFTWARD, line.state).reshape(len(edges), -1)
        at_ends = np.concatenate([state[:, 0], state[:, -1]])
        vertex, inverse = np.unique(np.concatenate([edges.first, edges.second]), return_inverse=True)
        lowest, highest = np.full(len(vertex), _LEFTWARD), np.zeros(len(vertex), dtype=np.int64)
        np.minimum.at(lowest, inverse, at_ends)
        np.maximum.at(highest, inverse, at_ends)
        meets = (lowest != highest)[inverse].reshape(2, -1).any(axis=0)
        chosen = edges.cells[(state != state[:, :1]).any(axis=1) | meets]
        cells.append(chosen[chosen >= 0])
    boundary, owners = mesh.boundary, problem.owners
    vertex = np.concatenate([boundary.first, boundary.second])
    order = np.argsort(vertex, kind="stable")
    here = vertex[order][::2]
    one, other = np.tile(np.arange(len(boundary)), 2)[order].reshape(-1, 2).T  # a body of one piece: two edges a vertex
    middles = np.stack(mesh.points_along(boundary, np.array([0.5])), axis=-1)[:, 0]
    differ = (owners[:, one] != owners[:, other]).any(axis=0)
    inwards = ((middles[other] - middles[one]) * boundary.normal[one]).sum(axis=1) > 0.0
    normals = frames_along(boundary, np.array([0.0, 1.0]))[0]
    first, second = (normals[each, np.where(boundary.first[each] == here, 0, 1)] for each in (one, other))
    turn = np.arccos(np.clip((first * second).sum(axis=1), -1.0, 1.0))
    corners = [here[differ | (inwards & (turn > _TURN))]]
    if problem.joints:
        lines = [mesh.edges(contact.edges) for contact in problem.joints]
        ends = np.concatenate([np.concatenate([each.first, each.second]) for each in lines])
        vertex, times = np.unique(ends, return_counts=True)
        corners.append(vertex[times != 2])
    return Places(np.unique(np.concatenate(cells)), np.unique(np.concatenate(corners)))


def reference_problem(problem: ContactProblem, at: Places) -> ContactProblem:
    """The problem on its mesh bisected for a reference solution."""
    fine = mesh = problem.mesh
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


def energies_between(answer: ContactResult, reference: ContactResult) -> FloatArray:
    """½ ∫ c(σ − τ):(σ − τ) over each triangle of the answer's mesh, τ of the reference solution [stress × length²].

    Those at contacts with springs have ½ ∫ (σ_N − τ_N)²/k_N + (σ_T − τ_T)²/k_T ds, too.
    """
    space, problem, mesh = reference.discretization.space, reference.problem, answer.problem.mesh
    fine = problem.mesh
    parents = fine.parents(mesh)

    def located(within: TriangleMesh, numbers: IntArray, points: FloatArray) -> FloatArray:
        flat = within.reference(np.repeat(numbers, points.shape[1]), points.reshape(-1, 2))
        return flat.reshape(*points.shape[:2], 3)

    def missed(cells: IntArray, at: FloatArray, points: FloatArray) -> FloatArray:
        """The difference of the stresses at points (n, g, 2), reference points `at` of triangles of the finer mesh."""
        own, other = (
            each.discretization.scales.stress
            * each.discretization.space.stress(each.discretization.coefficients(each.dofs), within, t)
            for each, within, t in (
                (reference, cells, at), (answer, parents[cells], located(mesh, parents[cells], points)),
            )
        )  # fmt: skip
        return np.asarray(own - other)  # without body potential

    cells, t = np.arange(fine.cell_count), space.cell_points
    inside = missed(cells, t, (fine.corners.swapaxes(1, 2)[:, None] @ fine.placed(cells, t)[..., None])[..., 0])
    measures = reference.discretization.scales.length**2 * space.cell_measures(t, space.cell_weights)
    work = (((inside @ problem.compliances) * inside).sum(axis=2) * measures).sum(axis=1)
    t, weights = gauss_legendre(space.degree)
    for contact in filter(lambda each: each.has_springs, problem.contacts):
        edges = fine.edges(contact.edges)
        x, y = fine.points_along(edges, t)
        own, points = edges.cells[:, 0], np.stack([x, y], axis=-1)
        xx, yy, xy = np.moveaxis(missed(own, located(fine, own, points), points), -1, 0)
        normals, tangents = frames_along(edges, t)
        force = np.stack([xx * normals[..., 0] + xy * normals[..., 1], xy * normals[..., 0] + yy * normals[..., 1]], -1)
        for name, along in zip(SPRINGS, (normals, tangents), strict=True):
            field = getattr(contact, name)
            if field is not None:
                stiffness = evaluate(f"Contact.{name}", field, x, y)
                parts = edges.length[:, None] * weights * (force * along).sum(axis=-1) ** 2 / stiffness
                np.add.at(work, own, parts.sum(axis=1))
    return np.asarray(np.bincount(parents, 0.5 * work, mesh.cell_count), float)
