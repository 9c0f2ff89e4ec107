"""Refinement of triangle meshes: bisection where answers differ from a companion or from a reference solution.

In `docs/theory.md`: (D22).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
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


@dataclass(frozen=True)
class TriangleRefinement:
    """Triangles bisected where the answer is off; see `rounds.Strategy`.

    Of several load steps all are solved anew on one mesh, which is bisected by the sum of what they are off.
    """

    settings: Settings
    measure: Measure
    steps: tuple[ContactProblem, ...]

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
        value = self._value(answer)
        unit, there = measure.unit(last, value), [places(each) for each in results]
        at = Places(*(np.unique(np.concatenate([getattr(one, of) for one in there])) for of in ("cells", "corners")))
        hopeless = len(results) > 1 or any(each.hopeless for each in earlier)
        rough = any(map(has_coulomb, last.problem.contacts))
        tried = measure.bounded and not hopeless and (not rough or (self.settings.guaranteed and measure.of_a_force))
        bounds = found = bounded(measure, value, last) if tried else None
        if found is None:
            found = self._compared(answer, value, unit, at)
        if found is None and any(np.isfinite(each.estimate) for each in earlier):  # nobody could tell its accuracy
            late = RefinementStatus.TIME_LIMIT if deadline.over else RefinementStatus.UNSOLVED
            raise StopError(late, f"the accuracy of the answer with {unknowns} unknowns could not be determined")
        if found is None:
            found = Comparison(np.inf, Certainty.ESTIMATE, np.ones(mesh.cell_count))
        if earlier and found.certainty is Certainty.ESTIMATE:
            step = abs(found.reference - earlier[-1].reference)  # while that moves the error is no less
            found = replace(found, error=float(np.fmax(found.error, _SAFETY * step)))
        estimate, parts = found.error / unit if unit > 0.0 else 0.0, found.parts
        marked, deeper = np.ones(mesh.cell_count, dtype=bool), tuple[IntArray, ...]()
        if np.isfinite(estimate):
            marked = bulk(parts)
            if bounds is None and len(at.cells):
                marked[at.cells] = True  # changes of state matter more for a force than their share says
            else:
                deeper = _deeper(mesh, at.corners, parts, self.settings.target / (estimate or 1.0))
        return Round(
            answer=answer, unknowns=unknowns, value=value, unit=unit, estimate=estimate, certainty=found.certainty,
            parts=parts, finer=partial(self._finer, mesh, marked, deeper), reference=found.reference,
            hopeless=hopeless or (tried and bounds is None),
        )  # fmt: skip

    def _finer(self, mesh: TriangleMesh, marked: BoolArray, deeper: tuple[IntArray, ...]) -> TriangleMesh | None:
        """Marked triangles bisected, but for those that are as small as allowed, then those at vertices once more."""
        fine = self._bisected(mesh, marked)
        if fine is not None:
            for vertices in deeper:  # old vertices keep their numbers
                fine = self._bisected(fine, np.asarray(np.isin(fine.cells, vertices).any(axis=1))) or fine
        return fine

    def _bisected(self, mesh: TriangleMesh, marked: BoolArray) -> TriangleMesh | None:
        """The mesh with those marked triangles bisected that may be; None if there are none."""
        chosen = marked & (mesh.finest[mesh.cells].min(axis=1) >= 2.0 * self.settings.thinnest)
        return mesh.refined(chosen) if chosen.any() else None

    def _compared(self, answer: ContactResult | History, value: float, unit: float, at: Places) -> Comparison | None:
        """The answer beside a reference solution; where that fails, beside one degree more on the same mesh."""
        results, options = steps_of(answer), self.settings.options
        posed = results[-1].problem
        quick = len(results) == 1 and options.get("method") is None and options.get("inner") is None
        for finer, more in ((reference_problem(posed, at).mesh, _QUICK if quick else {}), (posed.mesh, {})):
            try:
                found = self._solved(finer, self.degree + 1, np.inf, more)
            except QVIError:
                continue
            better = steps_of(found)
            if len(better) < len(results) or not better[-1].has_state:
                continue
            reference = self._value(found)
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
        """The result with a degree and more options; `TooLargeError` if it would have more unknowns than that."""
        options: dict[str, Any] = {**self.settings.options, **more, "degree": degree}
        steps = [each if each.mesh is mesh else replace(each, mesh=mesh) for each in self.steps]
        discretization = discretized(steps[0], **options)
        if discretization.qvi.n > most:
            raise TooLargeError(discretization.qvi.n)
        if len(steps) > 1:
            return solve_history(steps, **options)
        return solve(discretization, **{name: value for name, value in options.items() if name not in _POSING})

    def _value(self, answer: ContactResult | History) -> float:
        """The quantity, of a history in its last step; what friction loses is that of all steps."""
        if isinstance(answer, History) and self.measure.kind == "dissipation":
            return float(answer.dissipated.sum())
        return self.measure.value(steps_of(answer)[-1])


def steps_of(answer: ContactResult | History) -> Sequence[ContactResult]:
    """The results of all load steps."""
    return answer.steps if isinstance(answer, History) else (answer,)


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
