"""How large the errors of the meshes are, which of them mean something, and what their orders are worth."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from comparisons.convergence.mesh.problems import ENERGY, FORCE, PROBLEMS, TRACTIONS, Expected, Problem
from comparisons.convergence.mesh.references import Reference, error_of, references_of, solved
from comparisons.convergence.mesh.study import APART, BRACKET, GOAL, GRADED, UNIFORM
from comparisons.convergence.orders import fitted_order, reached, successive_orders

if TYPE_CHECKING:
    from pandas import DataFrame, Series

NAMES: Final = {UNIFORM: "equal cells", GRADED: "graded", GOAL: "adaptive (force)", APART: "adaptive (bounds)"}
"""Sequence with errors → what it is called in tables."""

SAME: Final = 0.1
"""How far, relatively, a fitted order may be from the expected one to count as the same."""

STEADY: Final = 0.05
"""How far, relatively, the last three orders may be from each other to count as settled."""

FLAT: Final = 0.1
"""An order of this size or below is none: the error does not fall."""

EXPECTED: Final = "as expected"

_ERRORS: Final = ("problem", "measure", "sequence", "mesh", "cells", "unknowns", "h", "size", "error", "meant")


@dataclass(frozen=True, eq=False)
class Overview:
    """A study's meshes, see `data.meshes_of`, what they are compared with, and the errors."""

    meshes: "DataFrame"

    @cached_property
    def problems(self) -> list[Problem]:
        """Those with a solved mesh of equal cells."""
        found = [PROBLEMS[name] for name in self.meshes.problem.unique()]
        return [problem for problem in found if len(self.of(problem, UNIFORM))]

    @cached_property
    def references(self) -> dict[str, dict[str, Reference]]:
        """Problem's name → measure → what it is compared with."""
        return {problem.name: references_of(self.meshes, problem) for problem in self.problems}

    @cached_property
    def errors(self) -> "DataFrame":
        """One line a mesh and measure, by problem, measure and sequence.

        The columns are these, mesh (its line in the frame of meshes), cells, unknowns, h, size, error (relative) and
        meant (whether it is above the reference's uncertainty).
        """
        from pandas import DataFrame

        return DataFrame(self._errors(), columns=list(_ERRORS)).astype({"meant": bool})

    def _errors(self) -> Iterator[tuple[Any, ...]]:
        for problem in self.problems:
            for measure, known in self.references[problem.name].items():
                for sequence in NAMES:
                    for mesh in self.of(problem, sequence).itertuples():
                        if (error := error_of(mesh, measure, known)) == error:
                            place = (mesh.Index, mesh.cells, mesh.unknowns, mesh.h, mesh.size)
                            yield problem.name, measure, sequence, *place, error, error > known.least

    def of(self, problem: Problem, sequence: str, model: str = "") -> "DataFrame":
        """The solved meshes of a sequence, see `solved`."""
        return solved(self.meshes, problem, sequence, model)

    def curve(self, problem: Problem, measure: str, sequence: str) -> "DataFrame":
        """The errors of a measure along a sequence; none is an empty frame."""
        found = self.errors
        return found[(found.problem == problem.name) & (found.measure == measure) & (found.sequence == sequence)]

    @cached_property
    def orders(self) -> "DataFrame":
        """One line a curve: problem, measure, sequence, and the entries of `orders_of`."""
        from pandas import DataFrame

        names = ["problem", "measure", "sequence"]
        lines = [
            dict(zip(names, place, strict=True)) | orders_of(points, self._expected(*place))
            for place, points in self.errors.groupby(names, sort=False)
        ]
        return DataFrame(lines, columns=[*names, *orders_of(self.errors[:0])])

    @staticmethod
    def _expected(problem: str, measure: str, sequence: str) -> Expected | None:
        return PROBLEMS[problem].expected.get(measure) if sequence == UNIFORM else None

    def is_exact(self, problem: Problem) -> bool:
        """Whether every mesh gives the force up to the accuracy of the solves."""
        forces, known = self.errors[self.errors.measure == FORCE], problem.known.get(FORCE)
        own = forces[forces.problem == problem.name]
        return known is not None and known.uncertainty == 0.0 and len(own) > 0 and not own.meant.any()

    def brackets(self, problem: Problem, sequence: str, guaranteed: bool = True) -> "DataFrame":
        """Meshes with both bounds."""
        found = self.of(problem, sequence, BRACKET)
        return found[found.gap.notna() & (found.guaranteed == guaranteed)]


def orders_of(points: "DataFrame", expected: Expected | None = None) -> dict[str, Any]:
    """What the orders of the errors along a sequence are worth.

    Returns
    -------
    dict
        last, fitted : orders in h of the last two meshes whose errors mean something, and by least squares of the last
        three; NaN without them
        expected, reason : what theory says, on equal cells; NaN and empty where it says nothing
        verdict : whether the orders have settled, and on the expected one

    """
    from pandas import Series

    usable = points.error.where(points.meant)
    kept = points.h != points.h.shift()  # there is no order between two meshes with the same number of cells
    orders = Series(successive_orders(points.h[kept], usable[kept])).dropna()
    last = float(orders.iloc[-1]) if len(orders) else float("nan")
    fitted, wanted = fitted_order(points.h, usable), float("nan") if expected is None else expected.order
    return {
        "last": last, "fitted": fitted, "expected": wanted, "reason": "" if expected is None else expected.reason,
        "verdict": _verdict(orders.tail(3), fitted, wanted),
    }  # fmt: skip


def _verdict(orders: "Series", fitted: float, expected: float) -> str:
    """By the last three orders."""
    falls = len(orders) > 0 and orders.iloc[-1] > FLAT
    if fitted != fitted:
        return "too few points for an order"
    if fitted <= FLAT and not falls:
        return "does not fall"
    if falls and abs(fitted - expected) <= SAME * expected:
        return EXPECTED
    steady = len(orders) == 3 and orders.max() - orders.min() <= STEADY * abs(orders.iloc[-1])
    if not (falls and steady):
        return "orders still change"
    return "settled" if expected != expected else "settled on another order"


def cost(points: "DataFrame", target: float) -> float:
    """Unknowns from which on the error stays within the target; NaN without errors, or if it is not reached.

    An error that means nothing counts as the reference's uncertainty.
    """
    return reached(points.unknowns.tolist(), points.error.tolist(), target)


def advantage(curves: Mapping[str, "DataFrame"], target: float) -> tuple[float, float]:
    """How many times more unknowns equal cells take than the best of the others, as far as meshes of these sizes tell.

    At least and at most; the second is NaN where that is not known, both where nothing can be said.
    """
    nothing = float("nan")
    costs = {sequence: cost(points, target) for sequence, points in curves.items()}
    others = {sequence: value for sequence, value in costs.items() if sequence != UNIFORM and value == value}
    uniform = curves[UNIFORM]
    if uniform.empty or not others:
        return nothing, nothing
    best, needed = min(others.values()), costs[UNIFORM]
    if needed != needed:
        return float(uniform.unknowns.max()) / best, nothing
    before = _before(uniform, needed)
    if not before > best:
        return nothing, nothing
    least = [_before(curves[sequence], value) for sequence, value in others.items()]
    return before / best, nothing if any(value != value for value in least) else needed / min(least)


def _before(points: "DataFrame", unknowns: float) -> float:
    """The largest number of unknowns of the curve below this one, NaN without one."""
    return float(points.unknowns[points.unknowns < unknowns].max())


def slug(problem: Problem) -> str:
    """The problem's name as a word for links."""
    return problem.name.replace(" ", "-").replace(".", "_")


def ends_among(measures: Mapping[str, Reference]) -> list[str]:
    """The kinds of ends of zones among the measures of a problem."""
    return [measure for measure in measures if measure not in (FORCE, ENERGY, TRACTIONS)]
