"""Refinement of triangle meshes: bisection where answers differ from a companion or from a reference solution.

In `docs/theory.md`: (D22).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, whole_number
from qvi_contact.basics.units import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import has_coulomb
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.measure import Measure
from qvi_contact.refinement.outcome import RefinementStatus
from qvi_contact.refinement.reference_solution import (
    Comparison,
    Places,
    bounded,
    energies_between,
    places,
    reference_problem,
)
from qvi_contact.refinement.rounds import (
    Round,
    Settings,
    StopError,
    TooLargeError,
    bulk,
)
from qvi_contact.solution.history import History, solve_history
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import discretized, solve
from solvers import Status
from solvers.basics.progress import deadline

_DEGREE: Final = 5  # where none is given

_HIGHEST: Final = 11  # degree that leaves one more for the reference solution
_FACTOR: Final = 0.4  # by which a bisection reduces what a corner holds, 2^(−2λ): λ is 0.66 or less where it matters
_MARGIN: Final = 0.9  # share of the target below which a corner need not be bisected again
_ABOVE: Final = 4.0  # what a triangle in a corner may hold, over the least that is bisected elsewhere
_DEEPEST: Final = 3  # bisections in a corner in one round
_SAFETY: Final = 1.5  # by which an estimate is more than a difference: the reference may be off by a third as much
_NEAR: Final = 0.1  # accuracy of a reference solution over the error that is told from it
_QUICK: Final = MappingProxyType({"method": "condensed"})  # no other methods, no second opinion: it is no answer
_STOPS: Final = {
    Status.ILL_CONDITIONED: RefinementStatus.THIN_CELLS,
    Status.TIME_LIMIT: RefinementStatus.TIME_LIMIT,
}  # what a status on the way means for the refinement
_POSING: Final = ("degree", "law_on")  # options of the discretisation, not of its solve


@dataclass(frozen=True, eq=False, kw_only=True)
class TriangleRound(Round[ContactResult]):
    """A round of a contact problem.

    Attributes
    ----------
    marked : (m,) bool array
        Triangles to bisect next.
    deeper : tuple of int arrays
        Vertices at which triangles are then bisected once more, twice more and so on.
    hopeless : bool
        Whether bounds were asked for in vain.
    reference : float
        The quantity of the reference solution; NaN where there was none.
    history : History or None
        All load steps, if there are several.

    """

    marked: BoolArray
    deeper: tuple[IntArray, ...]
    hopeless: bool
    reference: float
    history: History | None = None


@dataclass(frozen=True)
class TriangleRefinement:
    """Triangles bisected where the answer is off; see `rounds.Strategy`."""

    settings: Settings
    measure: Measure

    @property
    def degree(self) -> int:
        """Degree of the answers."""
        degree = self.settings.options.get("degree")
        if degree is None:
            return _DEGREE
        if whole_number("degree", degree) > _HIGHEST:
            remedy = f"give at most {_HIGHEST}: answers are compared with those of one degree more"
            raise InputError("degree", degree, remedy)
        return int(degree)

    def answer(self, problem: ContactProblem) -> ContactResult:
        """The result on the mesh."""
        return self._solved(problem, self.degree, self.settings.max_unknowns)

    def assessed(
        self, problem: ContactProblem, result: ContactResult, earlier: Sequence[TriangleRound]
    ) -> TriangleRound:
        """What bounds say about an answer, where there are any, else a reference solution."""
        unknowns = result.discretization.qvi.n
        if result.status is not Status.SOLVED:
            status = _STOPS.get(result.status, RefinementStatus.UNSOLVED)
            if result.status is Status.INACCURATE and result.has_state:
                unit = result.certificate.scales.get("stress", 1.0) * result.discretization.scales.stress
                if result.stress_rounding > result.certificate.tolerance * unit:  # rounding alone is more than allowed
                    status = RefinementStatus.THIN_CELLS
            raise StopError(status, f"the mesh with {unknowns} unknowns: {result.message}")
        mesh, measure, target = problem.mesh, self.measure, self.settings.target
        value, unit = measure.value(result), measure.unit(result)
        at = places(problem, mesh, result)
        hopeless = any(each.hopeless for each in earlier)
        rough = any(map(has_coulomb, problem.contacts))
        tried = measure.bounded and not hopeless and (not rough or (self.settings.guaranteed and measure.of_a_force))
        bounds = found = bounded(measure, value, result) if tried else None
        if found is None:
            found = self._compared(problem, result, value, at)
        if found is None and any(np.isfinite(each.estimate) for each in earlier):  # nobody could tell its accuracy
            late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.UNSOLVED
            raise StopError(late, f"the accuracy of the answer with {unknowns} unknowns could not be determined")
        if found is None:
            found = Comparison(np.inf, Certainty.ESTIMATE, np.ones(len(mesh.cells)))
        if earlier and found.certainty is Certainty.ESTIMATE:
            step = abs(found.reference - earlier[-1].reference)  # while that moves the error is no less
            found = replace(found, error=float(np.fmax(found.error, _SAFETY * step)))
        estimate = found.error / unit if unit > 0.0 else 0.0
        parts, total = found.parts, float(found.parts.sum())
        known = np.isfinite(estimate)
        marked, deeper = bulk(parts) if known else np.ones(len(mesh.cells), dtype=bool), tuple[IntArray, ...]()
        if known and bounds is None and len(at.cells):
            marked[at.cells] = True  # changes of state matter more for a force than their share says
        elif known:
            deeper = _deeper(mesh, at.corners, parts, target / (estimate or 1.0))
        return TriangleRound(
            problem=problem,
            answer=result,
            unknowns=unknowns,
            value=value,
            unit=unit,
            estimate=estimate,
            certainty=found.certainty,
            indicator=parts * (estimate / total) if total > 0.0 and known else np.zeros_like(parts),
            marked=marked,
            deeper=deeper,
            hopeless=hopeless or (tried and bounds is None),
            reference=found.reference,
        )

    def next(self, rounds: Sequence[TriangleRound]) -> ContactProblem:
        """The problem with marked triangles bisected, but for those that are as small as allowed."""
        last = rounds[-1]
        mesh = self._bisected(last.problem.mesh, last.marked)
        if mesh is None:
            raise StopError(RefinementStatus.THIN_CELLS)
        for vertices in last.deeper:  # old vertices keep their numbers
            mesh = self._bisected(mesh, np.asarray(np.isin(mesh.cells, vertices).any(axis=1))) or mesh
        return replace(last.problem, mesh=mesh)

    def _bisected(self, mesh: TriangleMesh, marked: BoolArray) -> TriangleMesh | None:
        """The mesh with those marked triangles bisected that may be; None if there are none."""
        chosen = marked & (mesh.finest[mesh.cells].min(axis=1) >= 2.0 * self.settings.thinnest)
        return mesh.refined(chosen) if chosen.any() else None

    def _compared(self, problem: ContactProblem, result: ContactResult, value: float, at: Places) -> Comparison | None:
        """The answer beside a reference solution; where that fails, beside one degree more on the same mesh."""
        measure, options, unit = self.measure, self.settings.options, self.measure.unit(result)
        by_default = options.get("method") is None and options.get("inner") is None
        for finer, more in (
            (reference_problem(problem, problem.mesh, at), _QUICK if by_default else {}),
            (problem, {}),
        ):
            try:
                found = self._solved(finer, self.degree + 1, np.inf, more)
            except QVIError:
                continue
            reference = measure.value(found) if found.has_state else np.nan
            apart = abs(reference - value)
            near = found.status is Status.INACCURATE and found.certificate.accuracy * unit <= _NEAR * apart
            if np.isfinite(apart) and (found.status is Status.SOLVED or near):
                error = max(_SAFETY * apart, result.certificate.accuracy * unit)  # no less than solves are accurate
                parts = energies_between(result, found, problem.mesh, finer.mesh)
                return Comparison(error, Certainty.ESTIMATE, parts, reference)
        return None

    def _solved(
        self, problem: ContactProblem, degree: int, most: float, more: Mapping[str, Any] = MappingProxyType({})
    ) -> ContactResult:
        """The result with a degree and more options; `TooLargeError` if it would have more unknowns than that."""
        options: dict[str, Any] = {**self.settings.options, **more, "degree": degree}
        discretization = discretized(problem, **options)
        if discretization.qvi.n > most:
            raise TooLargeError(discretization.qvi.n)
        return solve(discretization, **{name: value for name, value in options.items() if name not in _POSING})


@dataclass(frozen=True)
class HistoryRefinement(TriangleRefinement):
    """One mesh for all load steps, bisected by the sum of what they are off; each round solves all of them anew.

    Attributes
    ----------
    steps : tuple of ContactProblem
        The load steps, on any mesh.

    """

    steps: tuple[ContactProblem, ...]

    def answer(self, problem: ContactProblem) -> History:  # type: ignore[override]
        """The history on the problem's mesh."""
        return self._history(problem.mesh, self.degree, self.settings.max_unknowns)

    def assessed(  # type: ignore[override]
        self, problem: ContactProblem, history: History, earlier: Sequence[TriangleRound]
    ) -> TriangleRound:
        """The history beside one on a reference mesh, which is bisected where any step asks for it."""
        if history.status is not Status.SOLVED:
            raise StopError(_STOPS.get(history.status, RefinementStatus.UNSOLVED), history.message)
        mesh, last = problem.mesh, history.steps[-1]
        each = [places(problem, mesh, step) for step in history.steps]
        at = Places(*(np.unique(np.concatenate([getattr(one, name) for one in each])) for name in ("cells", "corners")))
        finer = reference_problem(problem, mesh, at).mesh
        reference = self._history(finer, self.degree + 1, np.inf)
        value, better = self._value(history), self._value(reference) if reference.steps[-1].has_state else np.nan
        step = abs(better - earlier[-1].reference) if earlier else 0.0
        unit = abs(value) if self.measure.kind == "dissipation" else self.measure.unit(last)
        estimate = _SAFETY * max(abs(better - value), step) / unit if unit > 0.0 else 0.0
        rounding = max(each.certificate.accuracy for each in reference.steps)
        near = reference.status is Status.INACCURATE and rounding <= _NEAR * estimate
        if not near and reference.status is not Status.SOLVED:
            late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.UNSOLVED
            raise StopError(late, f"the accuracy of the answer could not be determined: {reference.message}")
        pairs = zip(history.steps, reference.steps, strict=True)
        parts = np.sum([energies_between(coarse, fine, mesh, finer) for coarse, fine in pairs], axis=0)
        marked, total = bulk(parts), float(parts.sum())
        marked[at.cells] = True
        return TriangleRound(
            problem=problem,
            answer=last,
            unknowns=last.discretization.qvi.n,
            value=value,
            unit=unit,
            estimate=estimate,
            certainty=Certainty.ESTIMATE,
            indicator=parts * (estimate / total) if total > 0.0 else parts,
            marked=marked,
            deeper=(),
            hopeless=True,
            reference=better,
            history=history,
        )

    def _history(self, mesh: TriangleMesh, degree: int, most: float) -> History:
        steps = [replace(step, mesh=mesh) for step in self.steps]
        unknowns = discretized(steps[0], **{**self.settings.options, "degree": degree}).qvi.n
        if unknowns > most:
            raise TooLargeError(unknowns)
        return solve_history(steps, **{**self.settings.options, "degree": degree})

    def _value(self, history: History) -> float:
        """What friction loses in all steps, or the quantity in the last one."""
        if self.measure.kind == "dissipation":
            return float(history.dissipated.sum())
        return self.measure.value(history.steps[-1])


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
