"""Where triangles are bisected: where answers differ from a companion or a reference solution, and for limit loads.

A reference solution has a mesh that is bisected where one degree more says little: where contacts change their state,
and in corners, where stresses may be singular, or zones of stick or slip too small for the mesh.

In `docs/theory.md`: (D22) with why and how often, for limit loads (D25).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Final, NamedTuple

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, evaluate, whole_number
from qvi_contact.bracket import Bounds
from qvi_contact.element.edge import gauss_legendre
from qvi_contact.errors import InputError, QVIError
from qvi_contact.limit.load_factor import LimitProblem
from qvi_contact.limit.stresses import limited
from qvi_contact.mesh.cutting import angles_at
from qvi_contact.mesh.edges import frames_along
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import SPRINGS, has_coulomb
from qvi_contact.problem.problem import ContactProblem, by_cell
from qvi_contact.refinement.measure import FORCES, Measure
from qvi_contact.solution.contact_line import ContactState
from qvi_contact.solution.history import History, solve_history
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import discretized, solve
from qvi_contact.solution.stress import loads_followed
from qvi_contact.units import Certainty
from solvers import Status
from solvers.basics.progress import deadline
from solvers.basics.status import Ending

_BULK: Final = 0.6  # Dörfler's share of the difference that is marked
_EQUAL: Final = 1e-3  # of a share: what mirrored triangles differ by, so that neither numbers nor rounding choose one


class RefinementStatus(Ending):
    """How a refinement ended. The value is a word for files and tables, `advice` a sentence for the user."""

    REACHED = "reached", "Nothing to do: the error, estimated or bounded, is within the target."
    NO_GUARANTEE = (
        "no_guarantee",
        "The error is within the target, but no guaranteed bound, as was asked for: accept it as it is, or read why in "
        "result.bracket (reasons, coulomb, coulomb_reason).",
    )
    UNKNOWNS = (
        "unknowns",
        "The next mesh would have more unknowns than allowed: raise max_unknowns, or accept the estimate.",
    )
    ROUNDS = "rounds", "The rounds are used up: raise max_rounds, or accept the estimate."
    THIN_CELLS = (
        "thin_cells",
        "The cells with the largest error are as thin as double precision allows: accept the estimate.",
    )
    UNSOLVED = "unsolved", "A problem of the refinement was not solved. Its message says what to do."
    TIME_LIMIT = (
        "time_limit",
        "The time limit was reached: allow more time (time_limit), or accept the estimate of the last round.",
    )


@dataclass(frozen=True)
class RefinementRound:
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
    """What is asked for: the target, what must not be exceeded, options of all solves; see `refine`."""

    target: float
    max_unknowns: int
    max_rounds: int
    options: Mapping[str, Any]
    guaranteed: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Round:
    """An answer and how far it is off."""

    answer: Any  # a ContactResult, History or LimitProblem
    record: RefinementRound  # what is kept of the round
    unit: float  # what the error of the quantity is relative to
    parts: FloatArray  # (cells,): in which proportion cells have a share in it
    finer: Callable[[], TriangleMesh]  # makes the mesh of the next round, or stops
    reference: float = np.nan  # the quantity of the reference solution; NaN where there was none
    hopeless: bool = False  # whether bounds need not be tried again

    @property
    def indicator(self) -> FloatArray:
        """Contribution (cells,) of each cell to the estimate; zero where there is none."""
        total, estimate = float(self.parts.sum()), self.record.estimate
        known = total > 0.0 and np.isfinite(estimate)
        return self.parts * (estimate / total) if known else np.zeros_like(self.parts)


class StopError(Exception):
    """The end of the rounds: how, and why if something failed."""

    def __init__(self, status: RefinementStatus, reason: str = "") -> None:
        super().__init__(reason)
        self.status, self.reason = status, reason


def bulk(parts: FloatArray, share: float = _BULK) -> BoolArray:
    """The fewest entries that hold a share of the sum, Dörfler's by default, and those that equal the least one."""
    largest = np.sort(parts)[::-1]
    enough = int(np.searchsorted(np.cumsum(largest), share * parts.sum() * (1.0 - 1e-12)))
    return np.asarray(parts >= (1.0 - _EQUAL) * largest[enough])


_DEGREE: Final = 5  # where none is given

_HIGHEST: Final = 11  # degree that leaves one more for the reference solution
_FACTOR: Final = 0.4  # by which a bisection reduces what a corner holds, 2^(−2λ): λ is 0.66 or less where it matters
_MARGIN: Final = 0.9  # share of the target below which a corner need not be bisected again
_ABOVE: Final = 4.0  # what a triangle in a corner may hold, over the least that is bisected elsewhere
_DEEPEST: Final = 3  # bisections in a corner in one round
_THINNEST: Final = 1e-9  # smallest edge that is made, over the body's length
_SAFETY: Final = 1.5  # by which an estimate is more than a difference: the reference may be off by a third as much
_NEAR: Final = 0.1  # accuracy of a reference solution over the error that is told from it
_QUICK: Final = MappingProxyType({"method": "condensed"})  # no other methods: it is no answer
_STOPS: Final = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # what a status on the way means for the refinement
_POSING: Final = ("degree", "law_on")  # options of the discretisation, not of its solve

_IN_CORNERS: Final = 3  # how often triangles are bisected there
_AT_CHANGES: Final = 2
_MOST: Final = 3.0  # cells of the closer mesh over those of the answer, above which corners are left as they are,
_FREE: Final = 100  # and as many more
_TURN: Final = np.deg2rad(10.0)  # by which the boundary turns inwards where it has a corner
_NOISE: Final = 1e-6  # of the unit: tractions below have no direction
_LEFTWARD: Final = 1 + max(ContactState)  # slip the other way


@dataclass(frozen=True)
class TriangleRefinement:
    """Triangles bisected where the answer is off; see `adaptive.refine`.

    Of several load steps all are solved anew on one mesh, which is bisected by the sum of what they are off.
    """

    settings: Settings
    measure: Measure
    steps: tuple[ContactProblem, ...]

    @property
    def degree(self) -> int:
        """Degree of the answers."""
        degree = self.settings.options.get("degree")
        return _DEGREE if degree is None else whole_number("degree", degree, _HIGHEST)

    def answer(self, mesh: TriangleMesh) -> ContactResult | History:
        """The result on the mesh."""
        return self._solved(mesh, self.degree, self.settings.max_unknowns)

    def assessed(self, mesh: TriangleMesh, answer: ContactResult | History, earlier: Sequence[Round]) -> Round:
        """What bounds say about an answer, where there are any, else a reference solution."""
        results, measure = steps_of(answer), self.measure
        last = results[-1]
        unknowns = last.discretization.qvi.n
        if answer.status is not Status.SOLVED:
            status = _STOPS.get(answer.status, RefinementStatus.UNSOLVED)
            if answer.status is Status.INACCURATE and last.has_state:
                unit = last.certificate.scales.get("stress", 1.0) * last.discretization.scales.stress
                if last.stress_rounding > last.certificate.tolerance * unit:  # rounding alone is more than allowed
                    status = RefinementStatus.THIN_CELLS
            raise StopError(status, f"the mesh with {unknowns} unknowns: {answer.message}")
        value = self._value(answer, late=bool(earlier))
        unit, there = measure.unit(last, value), [places(each) for each in results]
        at = Places(*(np.unique(np.concatenate(parts)) for parts in zip(*there, strict=True)))
        hopeless = len(results) > 1 or any(each.hopeless for each in earlier)
        rough = any(map(has_coulomb, last.problem.contacts))
        tried = (
            measure.bounded and not hopeless and (not rough or (self.settings.guaranteed and measure.kind in FORCES))
        )
        bounds = found = bounded(measure, value, last) if tried else None
        if found is None:
            found = self._compared(answer, value, unit, at)
        if found is None and any(np.isfinite(each.record.estimate) for each in earlier):  # nobody could tell how far
            late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.UNSOLVED
            raise StopError(late, f"the accuracy of the answer with {unknowns} unknowns could not be determined")
        if found is None:
            found = Comparison(np.inf, Certainty.ESTIMATE, np.ones(mesh.cell_count))
        if earlier and found.certainty is Certainty.ESTIMATE:
            step = abs(found.reference - earlier[-1].reference)  # while that moves the error is no less
            found = found._replace(error=float(np.fmax(found.error, _SAFETY * step)))
        unit = unit or float(np.nan_to_num(abs(found.reference)))  # what is zero on this mesh need not be on others
        estimate, parts = found.error / unit if unit != 0.0 else 0.0, found.parts
        marked, deeper = np.ones(mesh.cell_count, dtype=bool), tuple[IntArray, ...]()
        if np.isfinite(estimate):
            marked = bulk(parts)
            if bounds is None and len(at.cells):
                marked[at.cells] = True  # changes of state matter more for a force than their share says
            else:
                deeper = _deeper(mesh, at.corners, parts, self.settings.target / (estimate or 1.0))
        record = RefinementRound(mesh.cell_count, unknowns, value, estimate, found.certainty)
        return Round(
            answer=answer, record=record, unit=unit, parts=parts,
            finer=partial(_finer, mesh, marked, deeper), reference=found.reference,
            hopeless=hopeless or (tried and bounds is None),
        )  # fmt: skip

    def _compared(self, answer: ContactResult | History, value: float, unit: float, at: Places) -> Comparison | None:
        """The answer beside a reference solution; where that fails, beside one degree more on the same mesh."""
        results, options = steps_of(answer), self.settings.options
        posed = results[-1].problem
        quick = len(results) == 1 and options.get("method") is None and options.get("inner") is None
        for finer, more in ((reference_problem(posed, at).mesh, _QUICK if quick else {}), (posed.mesh, {})):
            try:
                found = self._solved(finer, self.degree + 1, np.inf, more)
                better = steps_of(found)
                if len(better) < len(results) or not better[-1].has_state:
                    continue
                reference = self._value(found)
            except QVIError:
                continue
            apart, accuracy = abs(reference - value), max(each.certificate.accuracy for each in better)
            near = found.status is Status.INACCURATE and accuracy * unit <= _NEAR * apart
            if np.isfinite(apart) and (found.status is Status.SOLVED or near):
                least = max(each.certificate.accuracy for each in results) * unit  # solves are no more accurate
                parts = np.sum([energies_between(*pair) for pair in zip(results, better, strict=True)], axis=0)
                return Comparison(max(_SAFETY * apart, least), Certainty.ESTIMATE, parts, reference)
        return None

    def _solved(
        self, mesh: TriangleMesh, degree: int, most: float, more: Mapping[str, Any] = MappingProxyType({})
    ) -> ContactResult | History:
        """The result with a degree and more options; `StopError` if it would have more unknowns than that."""
        options: dict[str, Any] = {**self.settings.options, **more, "degree": degree}
        steps = [each if each.mesh is mesh else replace(each, mesh=mesh) for each in self.steps]
        discretization = discretized(steps[0], **options)
        if discretization.qvi.n > most:
            raise StopError(RefinementStatus.UNKNOWNS, f"a mesh of {discretization.qvi.n} unknowns is needed")
        if len(steps) > 1:
            return solve_history(steps, **options)
        return solve(discretization, **{name: value for name, value in options.items() if name not in _POSING})

    def _value(self, answer: ContactResult | History, *, late: bool = False) -> float:
        """The quantity, of a history in its last step; what friction loses is that of all steps.

        A function that gives no number is an `InputError`; `late`, where rounds are done, a `StopError` keeps these.
        """
        if isinstance(answer, History) and self.measure.kind == "dissipation":
            return float(answer.dissipated.sum())
        try:
            return self.measure.value(steps_of(answer)[-1])
        except InputError as error:
            if not late:
                raise
            raise StopError(RefinementStatus.UNSOLVED, str(error)) from error


def steps_of(answer: ContactResult | History) -> Sequence[ContactResult]:
    """The results of all load steps."""
    return answer.steps if isinstance(answer, History) else (answer,)


def _finer(mesh: TriangleMesh, marked: BoolArray, deeper: tuple[IntArray, ...]) -> TriangleMesh:
    """Marked triangles bisected, then those at vertices once more; but for such as are too small."""
    fine = mesh
    for vertices in (None, *deeper):  # old vertices keep their numbers
        chosen = marked if vertices is None else np.isin(fine.cells, vertices).any(axis=1)
        chosen = chosen & _large(fine)
        if chosen.any():
            fine = fine.refined(chosen)
        elif vertices is None:
            raise StopError(RefinementStatus.THIN_CELLS)
    return fine


def _large(mesh: TriangleMesh) -> BoolArray:
    """Which triangles may be bisected."""
    return np.asarray(mesh.finest[mesh.cells].min(axis=1) >= 2.0 * _THINNEST * mesh.length)


def _deeper(mesh: TriangleMesh, corners: IntArray, parts: FloatArray, goal: float) -> tuple[IntArray, ...]:
    """Corners to bisect more than once, which costs few triangles, as long as they then still hold much.

    That is more than all the rest and than the goal, a share of the sum of the parts; or in one triangle a few times
    what is bisected elsewhere. Bisected once a round, corners fall behind: errors elsewhere shrink faster.
    """
    at = [(mesh.cells == vertex).any(axis=1) for vertex in corners]
    held = np.array([parts[cells].sum() for cells in at]) / (float(parts.sum()) or 1.0)
    left = np.maximum(1.0 - held, _MARGIN * goal)
    largest = np.array([parts[cells].max() for cells in at])
    enough = _ABOVE * parts[bulk(parts)].min()
    shares = [_FACTOR**level for level in range(1, _DEEPEST)]
    levels = [corners[(held * share > left) | (largest * share > enough)] for share in shares]
    return tuple(vertices for vertices in levels if len(vertices))


class Comparison(NamedTuple):
    """An answer beside something else."""

    error: float  # of the quantity, in its own unit
    certainty: Certainty  # whether it is a bound
    parts: FloatArray  # (cells,): what each cell has of the distance between the two [stress × length²], ≥ 0
    reference: float = np.nan  # the quantity of a reference solution; NaN where there was none


def bounded(measure: Measure, value: float, result: ContactResult) -> Comparison | None:
    """The value of an answer beside bounds of it: guaranteed ones, under Coulomb friction also estimated ones."""
    bracket, known, parts = result.bracket, dict[str, Bounds](), result.bracket.cell_gaps
    coulomb = bracket.coulomb
    if coulomb is not None and measure.name in coulomb.forces:
        known, parts = dict(coulomb.forces), coulomb.cells
    elif not bracket.reasons:
        known = {"energy": Bounds(-bracket.upper, -bracket.lower), **bracket.forces}
    if measure.name not in known:
        return None
    lower, upper = known[measure.name]
    return Comparison(max(upper - value, value - lower, 0.0), bracket.certainty, parts)


class Places(NamedTuple):
    """Where a mesh is bisected for a reference solution."""

    cells: IntArray  # (k,): triangles at contact edges that hold, or meet in, a change of state
    corners: IntArray  # (c,): vertices where stresses may be singular


def places(result: ContactResult) -> Places:
    """Where a reference solution for an answer is refined.

    Slip to either side is a state of its own, and so are pressure and tension: where σ_N changes its sign μ|σ_N| has a
    kink, and what sticks elsewhere slips. Corners are vertices where conditions change or the boundary turns inwards,
    and where joints end or meet.
    """
    problem, mesh, unit = result.problem, result.problem.mesh, result.discretization.scales.stress
    cells = [np.empty(0, dtype=np.int64)]
    for contact in problem.contacts:
        edges, line = mesh.edges(contact.edges), result.contacts[contact.name]
        leftward = (line.state == ContactState.SLIP) & (line.counted_shear < -_NOISE * unit)
        pulled = has_coulomb(contact) & (line.effective_normal_stress > _NOISE * unit)
        state = (np.where(pulled, -1, 1) * np.where(leftward, _LEFTWARD, line.state)).reshape(len(edges), -1)
        ends = np.stack([edges.first, edges.second])
        at_ends = np.unique([ends.ravel(), np.concatenate([state[:, 0], state[:, -1]])], axis=1)
        vertex, states = np.unique(at_ends[0], return_counts=True)
        meets = np.isin(ends, vertex[states > 1]).any(axis=0)
        chosen = edges.cells[(state != state[:, :1]).any(axis=1) | meets]
        cells.append(chosen[chosen >= 0])
    vertices, angle, changes, _ = outline_vertices(problem)
    corners = [vertices[changes | (angle > np.pi + _TURN)]]
    if problem.joints:
        lines = [mesh.edges(contact.edges) for contact in problem.joints]
        ends = np.concatenate([np.concatenate([each.first, each.second]) for each in lines])
        vertex, times = np.unique(ends, return_counts=True)
        corners.append(vertex[times != 2])
    return Places(np.unique(np.concatenate(cells)), np.unique(np.concatenate(corners)))


def outline_vertices(problem: ContactProblem) -> tuple[IntArray, FloatArray, BoolArray, BoolArray]:
    """Vertices (k,) of the boundary, the body's angle at each [rad], whether conditions change or an arc ends there."""
    boundary, owners = problem.mesh.boundary, problem.owners
    vertex = np.concatenate([boundary.first, boundary.second])
    order = np.argsort(vertex, kind="stable")
    here = vertex[order][::2]
    one, other = np.tile(np.arange(len(boundary)), 2)[order].reshape(-1, 2).T  # a body of one piece: two edges a vertex
    middles = np.stack(problem.mesh.points_along(boundary, np.array([0.5])), axis=-1)[:, 0]
    inwards = ((middles[other] - middles[one]) * boundary.normal[one]).sum(axis=1) > 0.0
    normals = frames_along(boundary, np.array([0.0, 1.0]))[0]
    first, second = (normals[each, np.where(boundary.first[each] == here, 0, 1)] for each in (one, other))
    turn = np.arccos(np.clip((first * second).sum(axis=1), -1.0, 1.0))
    changes = np.asarray((owners[:, one] != owners[:, other]).any(axis=0))
    return here, np.pi + np.where(inwards, turn, -turn), changes, boundary.bent[one] | boundary.bent[other]


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
    found = np.zeros(fine.cell_count, dtype=bool)
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

    def missed(cells: IntArray, at: FloatArray, points: FloatArray) -> FloatArray:
        """The difference of the stresses, but for the body potential, at points (n, g, 2), `at` in the finer cells."""
        found, own = [], mesh.reference(parents[cells], points)
        for each, within, t in ((reference, cells, at), (answer, parents[cells], own)):
            known = each.discretization
            found.append(known.scales.stress * known.space.stress(known.coefficients(each.dofs), within, t))
        return np.asarray(found[0] - found[1])

    cells, t = np.arange(fine.cell_count), space.cell_quadrature[0]
    inside = missed(cells, t, fine.placed(cells, t) @ fine.corners)
    measures = reference.discretization.scales.length**2 * space.cell_measures(*space.cell_quadrature)
    work = (((inside @ problem.compliances) * inside).sum(axis=2) * measures).sum(axis=1)
    t, weights = gauss_legendre(space.degree)
    for contact in filter(lambda each: each.has_springs, problem.contacts):
        edges = fine.edges(contact.edges)
        x, y = fine.points_along(edges, t)
        own, points = edges.cells[:, 0], np.stack([x, y], axis=-1)
        xx, yy, xy = np.moveaxis(missed(own, fine.reference(own, points), points), -1, 0)
        normals, tangents = frames_along(edges, t)
        force = np.stack([xx * normals[..., 0] + xy * normals[..., 1], xy * normals[..., 0] + yy * normals[..., 1]], -1)
        for name, along in zip(SPRINGS, (normals, tangents), strict=True):
            field = getattr(contact, name)
            if field is not None:
                stiffness = evaluate(f"Contact.{name}", field, x, y)
                parts = edges.length[:, None] * weights * (force * along).sum(axis=-1) ** 2 / stiffness
                np.add.at(work, own, parts.sum(axis=1))
    return np.asarray(np.bincount(parents, 0.5 * work, mesh.cell_count), float)


# limit loads: bisected is where the mesh gives way in another manner than the body would, by (D25). The mechanism of
# the body alone does not say where: where another one is near its limit too, the mesh may lack stresses for both.

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


@dataclass(frozen=True)
class LimitStrategy:
    """Both sides of a limit load, see `adaptive.refine`."""

    problem: ContactProblem
    settings: Settings
    names: tuple[str, ...]

    def __post_init__(self) -> None:
        for name, value in self.settings.options.items():
            if name != "degree":
                raise InputError(name, value, "is not for limit loads: give degree")

    def answer(self, mesh: TriangleMesh) -> LimitProblem:
        """Both sides on the mesh."""
        problem = self.problem if self.problem.mesh is mesh else replace(self.problem, mesh=mesh)
        posed = LimitProblem.of(problem, self.names, **self.settings.options)
        if posed.low.qvi.n > self.settings.max_unknowns:
            raise StopError(RefinementStatus.UNKNOWNS, f"a mesh of {posed.low.qvi.n} unknowns is needed")
        _ = posed.limit  # errors belong to this mesh
        return posed

    def assessed(self, mesh: TriangleMesh, answer: LimitProblem, _earlier: Sequence[Round], /) -> Round:
        """How far apart both sides are; and on which edges, or of a body that yields in which triangles."""
        limit = answer.limit
        if limit.violation > _VIOLATED:
            text = f"the stresses of the mesh violate the contact laws by {limit.violation:.1e}"
            raise StopError(RefinementStatus.THIN_CELLS, text)
        same = limit.lower == limit.upper  # both may be infinite
        unit = max(abs(limit.upper), _SMALL) if np.isfinite(limit.upper) else 1.0
        estimate = 0.0 if same else max(limit.upper - limit.lower, 0.0) / unit
        exact = np.isfinite(estimate) and loads_followed(answer.low) and loads_followed(answer.high)
        if self.problem.yields:
            parts = np.ones(mesh.cell_count) if limit.collapse is None else limit.collapse.gap
            needed = (1.0 - _INSIDE * self.settings.target / max(estimate, self.settings.target)) / _REMOVED
            finer = partial(self._finer_where_it_yields, mesh, parts, min(max(needed, _LEAST_SHARE), _SHARE))
            exact &= not mesh.curved.any()  # strengths hold on the straight triangles
        else:
            gaps = _edge_gaps(answer)
            parts = by_cell(answer.problem, gaps)
            finer = partial(self._finer_at_contacts, mesh, gaps)
        certainty = Certainty.GUARANTEED if exact else Certainty.ESTIMATE
        record = RefinementRound(mesh.cell_count, answer.low.qvi.n, limit.lower, estimate, certainty)
        return Round(answer=answer, record=record, unit=unit, parts=parts, finer=finer)

    def _finer_at_contacts(self, mesh: TriangleMesh, gaps: Mapping[str, FloatArray]) -> TriangleMesh:
        """Triangles beside the edges that have most of the distance bisected twice."""
        if not gaps:
            raise StopError(RefinementStatus.UNSOLVED, "there is no contact that limits tractions")
        problem = replace(self.problem, mesh=mesh)
        edges = [mesh.edges(contact.edges) for contact in problem.contacts if contact.name in gaps]
        beside, lengths = (np.concatenate([getattr(each, name) for each in edges]) for name in ("cells", "length"))
        marked = bulk(np.concatenate(list(gaps.values())))
        cells = np.unique(beside[marked & (lengths >= 2.0 * _THINNEST * mesh.length)])
        cells = cells[cells >= 0]
        if not len(cells):
            raise StopError(RefinementStatus.THIN_CELLS)
        fine = mesh
        for _ in range(_TWICE):
            fine = fine.refined(at_contacts(problem, mesh, fine, cells))
        return fine

    def _finer_where_it_yields(self, mesh: TriangleMesh, parts: FloatArray, share: float) -> TriangleMesh:
        """Triangles with a share of the gap divided; where they meet a singular vertex its fan becomes finer."""
        marked = bulk(parts, share)
        vertices, angle, changes, bent = outline_vertices(replace(self.problem, mesh=mesh))
        inwards = angle > np.pi * (1.0 + _FLAT)  # or conditions change where the outline does not turn outwards by much
        singular = vertices[~bent & (inwards | (changes & (angle > _BLUNT)))]  # where stresses turn around a point
        at = singular[[bool((marked & (mesh.cells == vertex).any(axis=1)).any()) for vertex in singular]]
        around = np.isin(mesh.cells, at).any(axis=1)
        chosen = np.flatnonzero(marked & ~around & _large(mesh))
        if not len(chosen) and not len(at):
            raise StopError(RefinementStatus.THIN_CELLS)
        fine = mesh.refined(chosen) if len(chosen) else mesh
        for vertex in at.tolist():
            widest = float(angles_at(fine, vertex)[1].max())
            fine = fine.fanned(np.array([vertex]), max(widest / 2.0, _SECTOR))
        return fine


def _edge_gaps(answer: LimitProblem) -> dict[str, FloatArray]:
    """∫ (π(w', s) − |σ_N| w' − σ_T s) ds of the edges (n,) of each contact; 1 without a state, see (D25)."""
    carried, rule, contacts = answer.carried, answer.low.rule, [rows for rows, _ in limited(answer.low)]
    if carried.tractions is None or carried.motion is None:
        return {rows.name: np.ones(len(rows.points.edges)) for rows in contacts}
    found = dict[str, FloatArray]()
    normal, shear = (rule.at_points(half) for half in np.split(carried.tractions, 2))
    opening, slip = (rule.multipliers_at_points(half) for half in np.split(carried.motion, 2))
    for rows in contacts:
        N, T, w, s = (part[rows.rows] for part in (normal, shear, opening, slip))
        size, friction, unilateral = np.abs(s), rows.limits.friction, ~rows.bilateral
        capped, rough = np.isfinite(rows.limits.cap), friction > 0.0
        w = np.where(unilateral, np.maximum(w, np.where(capped, 0.0, friction * size)), w)
        room = np.divide(np.maximum(w, 0.0), friction, out=size.copy(), where=rough)
        dilatant = np.where(unilateral, np.minimum(size, room), np.where(rough, 0.0, size))
        work = np.minimum(rows.limits.cohesion, rows.limits.cap) * dilatant
        work += np.where(capped, rows.limits.cap, 0.0) * (size - dilatant)
        found[rows.name] = np.maximum(work - N * w - T * s, 0.0).reshape(-1, rule.count).sum(axis=1)
    return found
