"""Refinement of triangle meshes: bisection where the answer differs from a companion or from a closer look.

In `docs/theory.md`: (D22).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, whole_number
from qvi_contact.basics.shown import Certainty
from qvi_contact.errors import InputError, QVIError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.refinement.outcome import Measure, RefinementStatus
from qvi_contact.refinement.reference_solution import (
    Comparison,
    Places,
    bounded,
    closer_problem,
    coulomb_contacts,
    energies_between,
    places,
)
from qvi_contact.refinement.rounds import (
    Accuracy,
    ResultRound,
    Settings,
    StopError,
    TooLargeError,
    bulk,
    check_solved,
    unknowns_of,
)
from qvi_contact.solution.result import ContactResult
from qvi_contact.solution.solver import posed, solve
from solvers import Status
from solvers.basics.progress import expired

DEGREE: Final = 5
"""Degree where none is given."""

_HIGHEST: Final = 11  # degree that leaves one more for the closer look
_FACTOR: Final = 0.4  # by which a bisection reduces what a corner holds, 2^(−2λ): λ is 0.66 or less where it matters
_MARGIN: Final = 0.9  # share of the target below which a corner need not be bisected again
_ABOVE: Final = 4.0  # what a triangle in a corner may hold, over the least that is bisected elsewhere
_DEEPEST: Final = 3  # bisections in a corner in one round
_SAFETY: Final = 1.5  # by which an estimate is more than a difference: the look may be off by a third of the answer
_NEAR: Final = 0.1  # accuracy of a look over the error that is told from it
_QUICK: Final = MappingProxyType({"method": "condensed"})  # no other methods, no second opinion: it is no answer
_POSING: Final = ("degree", "contact_rows")  # options of the discretisation, not of its solve


@dataclass(frozen=True, eq=False)
class Marks:
    """What to bisect next.

    Attributes
    ----------
    cells : (m,) bool array
        Triangles.
    deeper : tuple of int arrays
        Vertices at which triangles are bisected once more, twice more and so on.

    """

    cells: BoolArray
    deeper: tuple[IntArray, ...] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class TriangleRound(ResultRound):
    """A round of a contact problem.

    Attributes
    ----------
    marks : Marks
        What to bisect next.
    tried : bool
        Whether bounds were computed.
    looked : float
        The quantity in the closer look; NaN where there was none.

    """

    marks: Marks
    tried: bool
    looked: float = np.nan


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
            return DEGREE
        if whole_number("degree", degree) > _HIGHEST:
            remedy = f"give at most {_HIGHEST}: answers are compared with those of one degree more"
            raise InputError("degree", degree, remedy)
        return int(degree)

    def start(self, problem: ContactProblem, result: ContactResult) -> ContactProblem:
        """The problem on the mesh of a result."""
        return replace(problem, mesh=result.problem.mesh)

    def answer(self, problem: ContactProblem) -> ContactResult:
        """The result on the mesh."""
        return self._solved(problem, self.degree, self.settings.max_unknowns)

    def assessed(
        self, problem: ContactProblem, result: ContactResult, earlier: Sequence[TriangleRound]
    ) -> TriangleRound:
        """What bounds say about an answer, where there are any, else a closer look."""
        check_solved(result)
        mesh, measure = problem.mesh, self.measure
        value, unit = measure.value(result), measure.unit(result)
        at = places(problem, mesh, result)
        hopeless = any(each.tried and each.accuracy.certainty is Certainty.ESTIMATE for each in earlier)
        asked = not coulomb_contacts(problem) or (self.settings.guaranteed and measure.of_a_force)
        tried = measure.bounded and not hopeless and asked
        found = bounded(measure, value, result) if tried else None
        if found is None:
            found = self._looked(problem, result, value, at)
        found = _settled(found, result, earlier)
        estimate = found.error / unit if unit > 0.0 else 0.0
        return TriangleRound(
            problem=problem,
            unknowns=unknowns_of(result),
            accuracy=Accuracy(value, unit, estimate, found.certainty),
            cells=len(mesh.cells),
            indicator=_shared(found.parts, estimate),
            result=result,
            marks=self._marks(mesh, at, found, estimate),
            tried=tried,
            looked=found.looked,
        )

    def _marks(self, mesh: TriangleMesh, at: Places, found: Comparison, estimate: float) -> Marks:
        """Triangles to bisect, and vertices where to go on."""
        if not np.isfinite(estimate):
            return Marks(np.ones(len(mesh.cells), dtype=bool))
        marked = bulk(found.parts)
        if found.certainty is not Certainty.ESTIMATE or not len(at.cells):
            return Marks(marked, _deeper(mesh, at.corners, found.parts, self.settings.target / (estimate or 1.0)))
        marked[at.cells] = True  # changes of state matter more for a force than their share says
        return Marks(marked)

    def next(self, rounds: Sequence[TriangleRound]) -> ContactProblem:
        """The problem with marked triangles bisected, but for those that are as small as allowed."""
        last = rounds[-1]
        mesh = self._bisected(last.problem.mesh, last.marks.cells)
        if mesh is None:
            raise StopError(RefinementStatus.THIN_CELLS)
        for vertices in last.marks.deeper:  # old vertices keep their numbers
            mesh = self._bisected(mesh, np.asarray(np.isin(mesh.cells, vertices).any(axis=1))) or mesh
        return replace(last.problem, mesh=mesh)

    def _bisected(self, mesh: TriangleMesh, marked: BoolArray) -> TriangleMesh | None:
        """The mesh with those marked triangles bisected that may be; None if there are none."""
        chosen = marked & (mesh.finest[mesh.cells].min(axis=1) >= 2.0 * self.settings.thinnest)
        return mesh.refined(chosen) if chosen.any() else None

    def _looked(self, problem: ContactProblem, result: ContactResult, value: float, at: Places) -> Comparison | None:
        """The answer beside a closer look; where that fails, beside one degree more on the same mesh."""
        mesh, measure, options = problem.mesh, self.measure, self.settings.options
        by_default = options.get("method") is None and options.get("inner") is None
        for closer, more in ((closer_problem(problem, mesh, at), _QUICK if by_default else {}), (problem, {})):
            try:
                look = self._solved(closer, self.degree + 1, np.inf, more)
            except QVIError:
                continue
            looked = measure.value(look) if look.has_state else np.nan
            apart, unit = abs(looked - value), measure.unit(result)
            if _usable(look, apart, unit):
                error = max(_SAFETY * apart, result.certificate.accuracy * unit)  # no less than solves are accurate
                parts = energies_between(result, look, mesh, closer.mesh)
                return Comparison(error, Certainty.ESTIMATE, parts, looked)
        return None

    def _solved(
        self, problem: ContactProblem, degree: int, most: float, more: Mapping[str, Any] = MappingProxyType({})
    ) -> ContactResult:
        """The result with a degree and more options; `TooLargeError` if it would have more unknowns than that."""
        options: dict[str, Any] = {**self.settings.options, **more, "degree": degree}
        discretization = posed(problem, **options)
        if discretization.qvi.n > most:
            raise TooLargeError(discretization.qvi.n)
        return solve(discretization, **{name: value for name, value in options.items() if name not in _POSING})


def _settled(found: Comparison | None, result: ContactResult, earlier: Sequence[TriangleRound]) -> Comparison:
    """What is known of the error of an answer, once the rounds before are looked at; `StopError` if that is over."""
    if found is None and any(np.isfinite(each.estimate) for each in earlier):  # nobody could tell its accuracy
        late = RefinementStatus.TIME_LIMIT if expired() else RefinementStatus.UNSOLVED
        raise StopError(late, f"the accuracy of the answer with {unknowns_of(result)} unknowns could not be determined")
    if found is None:
        found = Comparison(np.inf, Certainty.ESTIMATE, np.ones(len(result.problem.mesh.cells)))
    if earlier and found.certainty is Certainty.ESTIMATE:
        step = abs(found.looked - earlier[-1].looked)  # looks that still move are no measure of an error below that
        found = replace(found, error=float(np.fmax(found.error, _SAFETY * step)))
    return found


def _usable(look: ContactResult, error: float, unit: float) -> bool:
    """Whether an error may be told from a look: solved, or nearer to that than the error is large."""
    near = look.status is Status.INACCURATE and look.certificate.accuracy * unit <= _NEAR * error
    return bool(np.isfinite(error)) and (look.status is Status.SOLVED or near)


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


def _shared(parts: FloatArray, estimate: float) -> FloatArray:
    """The estimate by cell, in the shares of the parts."""
    total = float(parts.sum())
    return parts * (estimate / total) if total > 0.0 and np.isfinite(estimate) else np.zeros_like(parts)
