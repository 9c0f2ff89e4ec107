"""Where triangles are bisected: where answers differ from a companion or a reference solution, and for limit loads.

One degree more shows little where contacts change their state, and in corners, where stresses may be singular or zones
of stick and slip smaller than a triangle. There the mesh of a reference solution is bisected.

In `docs/theory.md`: (D22) with the reasons and numbers of bisections, (D25) for limit loads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, whole_number
from qvi_contact.basics.schema import WithFields
from qvi_contact.bracket import Bounds
from qvi_contact.discretization.discretization import discretize
from qvi_contact.element.hsieh_clough_tocher import LOWEST
from qvi_contact.errors import InputError, QVIError
from qvi_contact.limit.load_factor import LimitProblem
from qvi_contact.limit.stresses import limited
from qvi_contact.mesh.cutting import angles_at
from qvi_contact.mesh.edges import frames_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.problem.problem import ContactProblem, by_cell
from qvi_contact.refinement.measure import FORCES, PLATE_FORCES, Measure
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.history import History, solve_history
from qvi_contact.solution.remarks import stopped_plates
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.settings import Settings as SolveSettings
from qvi_contact.solution.solver import solved
from qvi_contact.solution.stress import loads_followed
from qvi_contact.units import Certainty
from solvers import Status
from solvers.basics.progress import deadline
from solvers.basics.status import Ending

_BULK: Final = 0.6  # Dörfler's share of the difference whose triangles are marked
_EQUAL: Final = 1e-3  # relative difference of parts that count as equal, so that rounding does not break symmetry


class RefinementStatus(Ending):
    """How a refinement ended. The value is a word for files and tables, `advice` a sentence for the user."""

    REACHED = "reached", "Nothing to do: the error, estimated or bounded, is within the target."
    NO_GUARANTEE = "no_guarantee", "The error is within the target, but no guaranteed bound: result.bracket says why."
    UNKNOWNS = "unknowns", "The next mesh has more unknowns than allowed: raise max_unknowns, or accept the estimate."
    ROUNDS = "rounds", "The rounds are used up: raise max_rounds, or accept the estimate."
    THIN_CELLS = "thin_cells", "The cells with the largest error are too thin to be halved: accept the estimate."
    NO_LIMIT = "no_limit", "On finer meshes the quantity tends to no limit, or too slowly: change what its reason says."
    UNSOLVED = "unsolved", "A problem of the refinement was not solved. Its message says what to do."
    TIME_LIMIT = "time_limit", "The time limit was reached: raise time_limit, or accept the estimate of the last round."


@dataclass(frozen=True)
class RefinementRound(WithFields):
    """One round of a refinement."""

    cells: int
    """Number of triangles."""
    unknowns: int
    """Unknowns of the problem on them."""
    value: float
    """The quantity."""
    estimate: float
    """Its estimated relative error; infinity if there is none."""
    certainty: Certainty = Certainty.ESTIMATE
    """Whether the estimate is a bound of the error."""

    @property
    def guaranteed(self) -> bool:
        """Whether the estimate is a bound of the error without a condition."""
        return self.certainty is Certainty.GUARANTEED


@dataclass(frozen=True)
class Settings:
    """The target, the limits and the options of all solves of a refinement; see `refine`."""

    target: float
    max_unknowns: int
    max_rounds: int
    options: Mapping[str, Any]
    guaranteed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Round:
    """An answer and its error."""

    answer: Any  # a ContactResult, History or LimitProblem
    record: RefinementRound
    unit: float  # reference of the relative error
    parts: FloatArray  # (cells,): contributions of cells to the error, in any unit
    finer: Callable[[], TriangleMesh]  # makes the mesh of the next round, or stops
    reference: float = np.nan  # the quantity of the reference solution; NaN without one

    @property
    def indicator(self) -> FloatArray:
        """Contribution (cells,) of each cell to the estimate; zero where there is no estimate."""
        total, estimate = float(self.parts.sum()), self.record.estimate
        has_estimate = total > 0.0 and np.isfinite(estimate)
        return self.parts * (estimate / total) if has_estimate else np.zeros_like(self.parts)


class StopError(Exception):
    """The end of the rounds: the status, and the reason if something failed."""

    def __init__(self, status: RefinementStatus, reason: str = "") -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


def bulk(parts: FloatArray, share: float = _BULK) -> BoolArray:
    """The fewest entries that hold a share of the sum, Dörfler's by default, and others equal to the smallest one."""
    largest = np.sort(parts)[::-1]
    last = int(np.searchsorted(np.cumsum(largest), share * parts.sum() * (1.0 - 1e-12)))
    return np.asarray(parts >= (1.0 - _EQUAL) * largest[last])


_DEGREE: Final = 5  # default degree
_HIGHEST: Final = 11  # largest degree: the reference solution needs one more
_FACTOR: Final = 0.4  # ratio of a corner's part after and before a bisection, 2^(−2λ): λ ≤ 0.66 in serious corners
_MARGIN: Final = 0.9  # of the target: a corner with a smaller part is not bisected again
_ABOVE: Final = 4.0  # largest part of a triangle in a corner, over the smallest part that is bisected elsewhere
_DEEPEST: Final = 3  # largest number of bisections in a corner in one round
_THINNEST: Final = 1e-9  # smallest edge, over the body's length
_SAFETY: Final = 1.5  # estimate over difference: the error of the reference may be a third of the answer's
_FASTER: Final = 0.5  # share of its size that an estimate may lose in a round in which the energy stays
_USEFUL: Final = 1.6  # largest computed norm by which bounds are near errors: the factor f in (D28) is 4.6
_DEPTHS: Final = (6, 12, 18)  # bisections of all corners, after which a quantity shows whether it tends to a limit
_UNSEEN: Final = 0.1  # of the target: largest change from the second depth to the third that no mesh brings to it
_SLOW: Final = 1.0 / 3.0  # of the change before: a larger one may be part of ln h or 1/ln h; powers of h fall faster
_EXACT: Final = 1e-6  # of the numbers beside it: a smaller difference of a quantity is rounding
_NEAR: Final = 0.1  # largest accuracy of an inaccurate reference solution, over the difference from it
_STOPS: Final = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # statuses of a solve that end the refinement with a status of its own

_IN_CORNERS: Final = 3  # bisections in corners for a reference solution
_AT_CHANGES: Final = 2  # bisections where contacts change their state
_MOST: Final = 3.0  # corners are bisected while the reference mesh has at most so many times the cells of the answer,
_FREE: Final = 100  # and so many more
_TURN: Final = np.deg2rad(10.0)  # least angle by which the boundary turns inwards in a corner
_NOISE: Final = 1e-6  # of the unit of stress: smaller shear has no direction
_LEFTWARD: Final = 1 + max(ContactState)  # the state of slip in the other direction


@dataclass(frozen=True)
class TriangleRefinement:
    """Triangles bisected where the answer is inaccurate; see `adaptive.refine`.

    Several load steps are all solved anew on one mesh, which is bisected by the sum of their differences.
    """

    settings: Settings
    measure: Measure
    steps: tuple[ContactProblem, ...]
    solves: SolveSettings  # those of all solves

    @property
    def degree(self) -> int:
        """Degree of the answers."""
        degree = self.solves.degree
        return _DEGREE if degree is None else whole_number("degree", degree, _HIGHEST, LOWEST)

    def answer(self, mesh: TriangleMesh) -> ContactResult | History:
        """The result on the mesh, or the history of all load steps."""
        return self._solved(mesh, self.degree, self.settings.max_unknowns)

    def assessed(self, mesh: TriangleMesh, answer: ContactResult | History, earlier: Sequence[Round]) -> Round:
        """The error of an answer by bounds, if there are any, else by a reference solution."""
        measure, last = self.measure, steps_of(answer)[-1]
        unknowns = last.discretization.qvi.n
        if answer.status is not Status.SOLVED:
            status = _STOPS.get(answer.status, RefinementStatus.UNSOLVED)
            if answer.status is Status.INACCURATE and last.has_state:
                unit = last.certificate.scales.get("stress", 1.0) * last.discretization.scales.stress
                if last.stress_rounding > last.certificate.tolerance * unit:  # rounding alone exceeds the tolerance
                    status = RefinementStatus.THIN_CELLS
            raise StopError(status, f"the mesh with {unknowns} unknowns: {answer.message}")
        value = self._value(answer)
        unit, where = measure.unit(last, value), places(answer)
        bounds = comparison = self._bounds(answer, value, earlier)
        if comparison is None:
            self._stop_without_limit(last, unit, mesh.vertices[where.corners], earlier)
            comparison = self._compared(answer, value, unit, where)
            if comparison is None and any(np.isfinite(each.record.estimate) for each in earlier):
                status = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.UNSOLVED
                raise StopError(status, f"the accuracy of the answer with {unknowns} unknowns could not be determined")
        if comparison is None:
            comparison = Comparison(np.inf, Certainty.ESTIMATE, np.ones(mesh.cell_count))
        if earlier and comparison.certainty is Certainty.ESTIMATE:
            least = _least_error(earlier[-1], comparison, measure.alone)
            comparison = comparison._replace(error=float(np.fmax(comparison.error, least)))
        unit = unit or float(np.nan_to_num(abs(comparison.reference)))  # the value may be zero on this mesh alone
        estimate, parts = comparison.error / unit if unit != 0.0 else 0.0, comparison.parts
        marked, deeper = np.ones(mesh.cell_count, dtype=bool), tuple[IntArray, ...]()
        if np.isfinite(estimate):
            marked = bulk(parts)
            if bounds is None and len(where.cells):
                marked[where.cells] = True  # changes of state matter more for a force than for the energy
            else:
                deeper = _deeper(mesh, where.corners, parts, self.settings.target / (estimate or 1.0))
        record = RefinementRound(mesh.cell_count, unknowns, value, estimate, comparison.certainty)
        finer, reference = partial(_finer, mesh, marked, deeper), comparison.reference
        return Round(answer=answer, record=record, unit=unit, parts=parts, finer=finer, reference=reference)

    def _bounds(self, answer: ContactResult | History, value: float, earlier: Sequence[Round]) -> Comparison | None:
        """The error by bounds; None if there are none, after they failed, or, if asked for, were useless twice."""
        if isinstance(answer, History):
            return None
        is_rough, is_asked = any(map(has_coulomb, answer.problem.contacts)), self.settings.guaranteed
        kinds = (FORCES if is_asked else ()) if is_rough else ("energy", *FORCES, *PLATE_FORCES)
        if self.measure.kind not in kinds:
            return None
        if is_asked:  # states may change after the first time
            have_failed = any(is_useless(one.answer) and is_useless(next_.answer) for one, next_ in pairwise(earlier))
        else:
            have_failed = any(np.isfinite(each.reference) for each in earlier)
        return None if have_failed else bounded(self.measure, value, answer, is_asked)

    def _compared(self, answer: ContactResult | History, value: float, unit: float, at: Places) -> Comparison | None:
        """The answer compared with a reference solution; if that fails, with one degree more on the same mesh."""
        results = steps_of(answer)
        problem = results[-1].problem
        for mesh in (reference_problem(problem, at).mesh, problem.mesh):
            try:
                found = self._solved(mesh, self.degree + 1, np.inf)
                references = steps_of(found)
                if len(references) < len(results) or not references[-1].has_state:
                    continue
                # where the reference alone shows a change of state, its zones may be too small for the reference, too
                cells = places(found).cells
                unseen = cells[~np.isin(problem.mesh.locate(mesh.corners[cells].mean(axis=1)), at.cells)]
                if len(unseen) and mesh is not problem.mesh:
                    with suppress(QVIError):  # then the first reference serves
                        finer = reference_problem(replace(problem, mesh=mesh), Places(unseen, at.corners[:0])).mesh
                        again = self._solved(finer, self.degree + 1, np.inf)
                        found = again if again.status is Status.SOLVED else found
                    references = steps_of(found)
                reference = self._value(found)
            except QVIError:
                continue
            difference, accuracy = abs(reference - value), max(each.certificate.accuracy for each in references)
            if not self.measure.alone:  # a far smaller difference is chance, unless it is rounding, as by symmetry
                around = self.measure.beside(references[-1]) - self.measure.beside(results[-1])
                least = float(np.linalg.norm(around))
                difference = max(difference, least) if difference > _EXACT * least else difference
            is_near = found.status is Status.INACCURATE and accuracy * unit <= _NEAR * difference
            if np.isfinite(difference) and (found.status is Status.SOLVED or is_near):
                accuracy_of_answer = max(each.certificate.accuracy for each in results) * unit
                parts = np.sum([energies_between(*pair) for pair in zip(results, references, strict=True)], axis=0)
                return Comparison(max(_SAFETY * difference, accuracy_of_answer), Certainty.ESTIMATE, parts, reference)
        return None

    def _stop_without_limit(
        self, result: ContactResult, unit: float, corners: FloatArray, earlier: Sequence[Round]
    ) -> None:
        """`StopError` if the quantity tends to no limit, or too slowly, as data contradict each other in a corner.

        There displacements are homogeneous of degree 0 in the distance, and stresses of degree −1. What depends on all
        of them, as a force or an energy, grows by the same amount in each bisection. Other numbers settle: moments
        about the corner, forces in directions without such tractions, stresses far away. The motion of a plate that a
        support stops, with all that it loads, falls as 1/ln h. So the first mesh is solved with its corners (k, 2)
        bisected, once. If that fails, the quantity counts as one without a limit.
        """
        reasons = (*result.discretization.contradictions, *stopped_plates(result))
        if not reasons or any(np.isfinite(each.reference) for each in earlier):
            return
        values = np.full(len(_DEPTHS), np.nan)
        with suppress(QVIError):
            for number, depth in enumerate(_DEPTHS):
                answer = self._solved(self.steps[0].mesh.graded(corners, depth), self.degree, np.inf)
                values[number] = self._value(answer) if answer.status is Status.SOLVED else np.nan
        before, change = np.abs(np.diff(values))
        settles = change <= _UNSEEN * self.settings.target * unit or change <= _SLOW * before
        if not settles:
            raise StopError(RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.NO_LIMIT, reasons[0])

    def _solved(self, mesh: TriangleMesh, degree: int, most: float) -> ContactResult | History:
        """The result with a degree; `StopError` if it needs more unknowns than `most`."""
        settings = replace(self.solves, degree=degree)
        steps = [each if each.mesh is mesh else replace(each, mesh=mesh) for each in self.steps]
        discretization = discretize(steps[0], degree=degree, law_on=settings.law)
        if discretization.qvi.n > most:
            raise StopError(RefinementStatus.UNKNOWNS, f"a mesh of {discretization.qvi.n} unknowns is needed")
        return solve_history(steps, settings=settings) if len(steps) > 1 else solved(discretization, settings)

    def _value(self, answer: ContactResult | History) -> float:
        """The quantity; of a history in its last step, but the friction work of all steps."""
        if isinstance(answer, History) and self.measure.kind == "dissipation":
            return float(answer.dissipated.sum())
        return self.measure.value(steps_of(answer)[-1])


def _least_error(before: Round, found: Comparison, alone: bool) -> float:
    """The least error of a quantity that the round before makes likely, about the change of its reference.

    The estimate of one without numbers beside it falls to no less than half the share to which the energy of the
    difference falls: what falls faster may agree by chance.
    """
    least = _SAFETY * abs(found.reference - before.reference)  # NaN without one of the references
    if alone and np.isfinite(before.reference) and before.parts.any():
        fall = min(float(found.parts.sum() / before.parts.sum()), 1.0)
        least = float(np.fmax(least, _FASTER * fall * before.record.estimate * before.unit))
    return least


def steps_of(answer: ContactResult | History) -> Sequence[ContactResult]:
    """The results of all load steps."""
    return answer.steps if isinstance(answer, History) else (answer,)


def _finer(mesh: TriangleMesh, marked: BoolArray, deeper: tuple[IntArray, ...]) -> TriangleMesh:
    """The mesh with marked triangles bisected, then those at the vertices `deeper` again; too small ones stay."""
    fine = mesh
    for vertices in (None, *deeper):  # old vertices keep their numbers
        is_chosen = marked if vertices is None else np.isin(fine.cells, vertices).any(axis=1)
        is_chosen = is_chosen & _large(fine)
        if is_chosen.any():
            fine = fine.refined(is_chosen)
        elif vertices is None:
            raise StopError(RefinementStatus.THIN_CELLS)
    return fine


def _large(mesh: TriangleMesh) -> BoolArray:
    """Which triangles are large enough to be bisected."""
    return np.asarray(mesh.finest[mesh.cells].min(axis=1) >= 2.0 * _THINNEST * mesh.length)


def _deeper(mesh: TriangleMesh, corners: IntArray, parts: FloatArray, goal: float) -> tuple[IntArray, ...]:
    """Corners to bisect more than once in a round, by level; this costs few triangles.

    A corner is bisected again if its parts would still hold more than all the rest and more than the goal, a share of
    the sum of the parts, or if one triangle would hold a few times what is bisected elsewhere. With one bisection a
    round, errors in corners would fall more slowly than elsewhere, and bounds with a lower order in the unknowns.
    """
    at_corners = [parts[(mesh.cells == vertex).any(axis=1)] for vertex in corners]
    share = np.array([own.sum() for own in at_corners]) / (float(parts.sum()) or 1.0)
    rest = np.maximum(1.0 - share, _MARGIN * goal)
    largest, most = np.array([own.max() for own in at_corners]), _ABOVE * parts[bulk(parts)].min()
    factors = (_FACTOR**level for level in range(1, _DEEPEST))
    levels = [corners[(share * factor > rest) | (largest * factor > most)] for factor in factors]
    return tuple(vertices for vertices in levels if len(vertices))


class Comparison(NamedTuple):
    """The difference of an answer from bounds or a reference solution."""

    error: float  # of the quantity, in its own unit
    certainty: Certainty  # whether it is a bound
    parts: FloatArray  # (cells,): part of each cell in the difference [stress × length²], ≥ 0
    reference: float = np.nan  # the quantity of the reference solution; NaN without one


def is_useless(result: ContactResult) -> bool:
    """Whether bounds are neither proved nor near errors. The norm is the body's: finer meshes do not help."""
    coulomb = result.bracket.coulomb
    return coulomb is not None and not coulomb.norm.proved and _USEFUL <= coulomb.norm.value < np.inf


def bounded(measure: Measure, value: float, result: ContactResult, is_asked: bool) -> Comparison | None:
    """The error of an answer by bounds, under Coulomb friction also estimated ones; None if there are none of use.

    Bounds that are not asked for are those of energies: they close as fast as the error itself.
    """
    bracket, bounds, parts = result.bracket, dict[str, Bounds](), result.bracket.cell_gaps
    if is_useless(result):
        return None
    coulomb = bracket.coulomb
    if coulomb is not None and measure.name in coulomb.forces:
        bounds, parts = dict(coulomb.forces), coulomb.cells
    elif not bracket.reasons:
        bounds = {"energy": Bounds(-bracket.upper, -bracket.lower), **(bracket.forces if is_asked else bracket.driven)}
    if measure.name not in bounds:
        return None
    lower, upper = bounds[measure.name]
    return Comparison(max(upper - value, value - lower, 0.0), bracket.certainty, parts)


class Places(NamedTuple):
    """Cells and vertices at which a mesh is bisected for a reference solution."""

    cells: IntArray  # (k,): triangles at contact edges with a change of state inside or at an end
    corners: IntArray  # (c,): vertices where stresses may be singular


def places(answer: ContactResult | History) -> Places:
    """The places at which the mesh of an answer is bisected for a reference solution, those of all load steps.

    Slip in each direction is a state of its own. So are pressure and tension: μ|σ_N| has a kink where σ_N changes its
    sign. Corners are vertices where conditions change or the boundary turns inwards, and where joints end or meet.
    """
    cells, corners = [np.empty(0, dtype=np.int64)], list[IntArray]()
    for result in steps_of(answer):
        problem, mesh, unit = result.problem, result.problem.mesh, result.discretization.scales.stress
        for contact in problem.contacts:
            edges, line = mesh.edges(contact.edges), result.contacts[contact.name]
            is_leftward = (line.state == ContactState.SLIP) & (line.counted_shear < -_NOISE * unit)
            is_tensile = has_coulomb(contact) & (line.effective_normal_stress > _NOISE * unit)
            state = (np.where(is_leftward, _LEFTWARD, line.state) * np.where(is_tensile, -1, 1)).reshape(len(edges), -1)
            ends = np.stack([edges.first, edges.second])
            at_ends = np.unique([ends.ravel(), np.concatenate([state[:, 0], state[:, -1]])], axis=1)
            vertex, states = np.unique(at_ends[0], return_counts=True)
            does_change = np.isin(ends, vertex[states > 1]).any(axis=0)
            changing = edges.cells[(state != state[:, :1]).any(axis=1) | does_change]
            cells.append(changing[changing >= 0])
        vertices, angle, changes, _ = outline_vertices(problem)
        corners.append(vertices[changes | (angle > np.pi + _TURN)])
        if problem.joints:
            lines = [mesh.edges(contact.edges) for contact in problem.joints]
            ends = np.concatenate([np.concatenate([each.first, each.second]) for each in lines])
            vertex, count = np.unique(ends, return_counts=True)
            corners.append(vertex[count != 2])
    return Places(np.unique(np.concatenate(cells)), np.unique(np.concatenate(corners)))


def outline_vertices(problem: ContactProblem) -> tuple[IntArray, FloatArray, BoolArray, BoolArray]:
    """Boundary vertices (k,), the body's angle at each [rad], whether conditions change, whether an arc ends there."""
    boundary, owners = problem.mesh.boundary, problem.owners
    vertex = np.concatenate([boundary.first, boundary.second])
    order = np.argsort(vertex, kind="stable")
    vertices = vertex[order][::2]
    one, other = np.tile(np.arange(len(boundary)), 2)[order].reshape(-1, 2).T  # a body of one piece: two edges a vertex
    middles = np.stack(problem.mesh.points_along(boundary, np.array([0.5])), axis=-1)[:, 0]
    inwards = ((middles[other] - middles[one]) * boundary.normal[one]).sum(axis=1) > 0.0
    normals = frames_along(boundary, np.array([0.0, 1.0]))[0]
    first, second = (normals[each, np.where(boundary.first[each] == vertices, 0, 1)] for each in (one, other))
    turn = np.arccos(np.clip((first * second).sum(axis=1), -1.0, 1.0))
    does_change = np.asarray((owners[:, one] != owners[:, other]).any(axis=0))
    return vertices, np.pi + np.where(inwards, turn, -turn), does_change, boundary.bent[one] | boundary.bent[other]


def reference_problem(problem: ContactProblem, at: Places) -> ContactProblem:
    """The problem on its mesh bisected for a reference solution."""
    fine = mesh = problem.mesh
    for level in range(_IN_CORNERS):
        is_chosen = at_contacts(problem, mesh, fine, at.cells if level < _AT_CHANGES else at.cells[:0])
        is_in_corner = np.isin(fine.cells, at.corners).any(axis=1)  # old vertices keep their numbers
        if len(fine.cells) + 2 * is_in_corner.sum() <= _MOST * len(mesh.cells) + _FREE:
            is_chosen |= is_in_corner
        if is_chosen.any():
            fine = fine.refined(is_chosen)
    return replace(problem, mesh=fine)


def at_contacts(problem: ContactProblem, mesh: TriangleMesh, fine: TriangleMesh, cells: IntArray) -> BoolArray:
    """Triangles (m,) of a finer mesh that lie at contacts and in the given cells of the mesh."""
    is_found = np.zeros(fine.cell_count, dtype=bool)
    if len(cells):
        beside = np.concatenate([fine.edges(contact.edges).cells.ravel() for contact in problem.contacts])
        beside = np.unique(beside[beside >= 0])
        is_found[beside] = np.isin(mesh.locate(fine.corners[beside].mean(axis=1)), cells)
    return is_found


def energies_between(answer: ContactResult, reference: ContactResult) -> FloatArray:
    """½ ∫ c(σ − τ):(σ − τ) over each triangle of the answer's mesh, τ of the reference solution [stress × length²].

    Springs are left out: where their tractions differ, the stresses beside them do.
    """
    space, problem, mesh = reference.discretization.space, reference.problem, answer.problem.mesh
    fine = problem.mesh
    parents, cells, at = fine.parents(mesh), np.arange(fine.cell_count), space.cell_quadrature[0]
    inner_t = mesh.reference(parents, fine.placed(cells, at) @ fine.corners)
    stresses = []  # without the body potential
    for each, in_cells, t in ((reference, cells, at), (answer, parents, inner_t)):
        known = each.discretization
        stresses.append(known.scales.stress * known.space.stress(known.coefficients(each.dofs), in_cells, t))
    stress = np.asarray(stresses[0] - stresses[1])
    measures = reference.discretization.scales.length**2 * space.cell_measures(*space.cell_quadrature)
    work = (((stress @ problem.compliances) * stress).sum(axis=2) * measures).sum(axis=1)
    return np.asarray(np.bincount(parents, 0.5 * work, mesh.cell_count), float)


# Limit loads: triangles are bisected where the collapse of the mesh is not that of the body, by (D25). The mechanism of
# the body alone does not show where: if another mechanism is near, the mesh may lack stresses for both.

_SMALL: Final = 1e-6  # least reference of relative errors of load factors
_TWICE: Final = 2  # bisections of a triangle that halve all its edges
_SHARE: Final = 0.6  # largest share of the gap whose triangles are divided, where bodies yield
_LEAST_SHARE: Final = 0.15  # smallest such share
_REMOVED: Final = 0.9  # share of the gap of divided triangles that vanishes, about: fans become finer as a whole
_INSIDE: Final = 0.95  # of the target: the error aimed at
_SECTOR: Final = np.pi / 48.0  # smallest angle of fans [rad]
_BLUNT: Final = 0.8 * np.pi  # angle of a corner from which on a change of conditions needs a fan [rad]
_FLAT: Final = 1e-6  # relative difference from a straight angle that is rounding
_VIOLATED: Final = 1e-7  # of the largest limit of tractions: a larger violation is no rounding


@dataclass(frozen=True)
class LimitStrategy:
    """Refinement of a limit load until both sides are near, see `adaptive.refine`."""

    problem: ContactProblem
    settings: Settings
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name, value in self.settings.options.items():
            if name != "degree":
                raise InputError(name, value, "is not for limit loads: give degree")

    def answer(self, mesh: TriangleMesh) -> LimitProblem:
        """The limit load on the mesh, from both sides."""
        problem = self.problem if self.problem.mesh is mesh else replace(self.problem, mesh=mesh)
        analysis = LimitProblem.of(problem, self.names, **self.settings.options)
        if analysis.low.qvi.n > self.settings.max_unknowns:
            raise StopError(RefinementStatus.UNKNOWNS, f"a mesh of {analysis.low.qvi.n} unknowns is needed")
        _ = analysis.limit  # errors belong to this mesh
        return analysis

    def assessed(self, mesh: TriangleMesh, answer: LimitProblem, earlier: Sequence[Round], /) -> Round:
        """The distance of both sides, and its parts by contact edge, or by triangle where the body yields."""
        limit = answer.limit
        if earlier and limit.missing:
            raise StopError(RefinementStatus.UNSOLVED if limit.in_time else RefinementStatus.TIME_LIMIT, limit.missing)
        if limit.violation > _VIOLATED:
            text = f"the stresses of the mesh violate the contact laws by {limit.violation:.1e}"
            raise StopError(RefinementStatus.THIN_CELLS, text)
        is_same = limit.lower == limit.upper  # both may be infinite
        unit = max(abs(limit.upper), _SMALL) if np.isfinite(limit.upper) else 1.0
        estimate = 0.0 if is_same else max(limit.upper - limit.lower, 0.0) / unit
        exact = np.isfinite(estimate) and loads_followed(answer.low) and loads_followed(answer.high)
        if self.problem.yields:
            parts = np.ones(mesh.cell_count) if limit.collapse is None else limit.collapse.gap
            needed_share = (1.0 - _INSIDE * self.settings.target / max(estimate, self.settings.target)) / _REMOVED
            finer = partial(self._finer_where_it_yields, mesh, parts, min(max(needed_share, _LEAST_SHARE), _SHARE))
            exact &= limit.guaranteed
        else:
            gaps = _edge_gaps(answer)
            parts = by_cell(answer.problem, gaps)
            finer = partial(self._finer_at_contacts, mesh, gaps)
        certainty = Certainty.GUARANTEED if exact else Certainty.ESTIMATE
        record = RefinementRound(mesh.cell_count, answer.low.qvi.n, limit.lower, estimate, certainty)
        return Round(answer=answer, record=record, unit=unit, parts=parts, finer=finer)

    def _finer_at_contacts(self, mesh: TriangleMesh, gaps: Mapping[str, FloatArray]) -> TriangleMesh:
        """The mesh with the triangles bisected twice at the edges that hold most of the distance."""
        if not gaps:
            raise StopError(RefinementStatus.UNSOLVED, "there is no contact that limits tractions")
        problem = replace(self.problem, mesh=mesh)
        edges = [mesh.edges(contact.edges) for contact in problem.contacts if contact.name in gaps]
        neighbours, lengths = (np.concatenate([getattr(each, name) for each in edges]) for name in ("cells", "length"))
        is_marked = bulk(np.concatenate(list(gaps.values())))
        cells = np.unique(neighbours[is_marked & (lengths >= 2.0 * _THINNEST * mesh.length)])
        cells = cells[cells >= 0]
        if not len(cells):
            raise StopError(RefinementStatus.THIN_CELLS)
        fine = mesh
        for _ in range(_TWICE):
            fine = fine.refined(at_contacts(problem, mesh, fine, cells))
        return fine

    def _finer_where_it_yields(self, mesh: TriangleMesh, parts: FloatArray, share: float) -> TriangleMesh:
        """The mesh with triangles bisected that hold a share of the gap; fans at singular vertices become finer."""
        is_marked = bulk(parts, share)
        vertices, angle, changes, bent = outline_vertices(replace(self.problem, mesh=mesh))
        turns_inwards = angle > np.pi * (1.0 + _FLAT)
        singular = vertices[~bent & (turns_inwards | (changes & (angle > _BLUNT)))]  # stresses turn around these points
        fans = singular[[bool((is_marked & (mesh.cells == vertex).any(axis=1)).any()) for vertex in singular]]
        in_fans = np.isin(mesh.cells, fans).any(axis=1)
        divided = np.flatnonzero(is_marked & ~in_fans & _large(mesh))
        if not len(divided) and not len(fans):
            raise StopError(RefinementStatus.THIN_CELLS)
        fine = mesh.refined(divided) if len(divided) else mesh
        for vertex in fans.tolist():
            widest = float(angles_at(fine, vertex)[1].max())
            fine = fine.fanned(np.array([vertex]), max(widest / 2.0, _SECTOR))
        return fine


def _edge_gaps(answer: LimitProblem) -> dict[str, FloatArray]:
    """∫ (π(w', s) − σ_N w' − σ_T s) ds of (D25) on the edges (n,) of each contact; 1 if there is no state."""
    carried, rule, contacts = answer.carried, answer.low.rule, [rows for rows, _ in limited(answer.low)]
    if carried.tractions is None or carried.motion is None:
        return {rows.name: np.ones(len(rows.points.edges)) for rows in contacts}
    gaps = dict[str, FloatArray]()
    normal, shear = (rule.at_points(half) for half in np.split(carried.tractions, 2))
    opening, slip = (rule.multipliers_at_points(half) for half in np.split(carried.motion, 2))
    for rows in contacts:
        N, T, w, s = (part[rows.rows] for part in (normal, shear, opening, slip))
        size, friction, is_unilateral = np.abs(s), rows.limits.friction, ~rows.bilateral
        is_capped, is_rough = np.isfinite(rows.limits.cap), friction > 0.0
        w = np.where(is_unilateral, np.maximum(w, np.where(is_capped, 0.0, friction * size)), w)
        affordable = np.divide(np.maximum(w, 0.0), friction, out=size.copy(), where=is_rough)
        dilatant = np.where(is_unilateral, np.minimum(size, affordable), np.where(is_rough, 0.0, size))
        work = np.minimum(rows.limits.cohesion, rows.limits.cap) * dilatant
        work += np.where(is_capped, rows.limits.cap, 0.0) * (size - dilatant)
        gaps[rows.name] = np.maximum(work - N * w - T * s, 0.0).reshape(-1, rule.count).sum(axis=1)
    return gaps
