"""Everything that is computed about the paper's plate."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from comparisons.paper.reference import Reference, load
from qvi_contact import ContactResult, Discretization, discretize, principal_stresses, solve
from qvi_contact.basics.terminal import Advance
from solvers import available

SHRINKING = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

REFERENCE_INNER = "direct:clarabel"
STRICT_INNER = "strict-direct:clarabel"
TOLERANCE = 1e-8
PATIENCE = 3
"""Outer iterations without progress after which a back end is taken at its word that it can do no better."""


@dataclass(frozen=True, eq=False)
class Row:
    """All runs for one friction coefficient.

    Attributes
    ----------
    friction : μ
    printed : P/2 of Table 1
    uzawa, uzawa_printed_rule : the paper's number of iterations, with the accumulating rule and with that as printed
    uzawa_converged : accumulating rule to the tolerance; at μ = 0 with a shrinking step
    reference : fixed point, what all others are compared with
    back_ends : inner solver → its fixed point
    plain : fixed point without acceleration, for the convergence picture
    condensed : the inequality solved directly
    strict : friction bound and unilateral contact on whole edges, by second-order cones (Clarabel)

    """

    friction: float
    printed: float
    uzawa: ContactResult
    uzawa_printed_rule: ContactResult
    uzawa_converged: ContactResult
    reference: ContactResult
    back_ends: dict[str, ContactResult]
    plain: ContactResult
    condensed: ContactResult
    strict: ContactResult

    @property
    def best_qp(self) -> ContactResult:
        """The fixed point by a quadratic program (Clarabel through qpsolvers)."""
        return self.back_ends["qp:clarabel"]

    @property
    def best_socp(self) -> ContactResult:
        """The fixed point by second-order cones (Clarabel)."""
        return self.back_ends["socp:clarabel"]


@dataclass(frozen=True, eq=False)
class PaperStudy:
    """The study's results.

    Attributes
    ----------
    reference : the printed numbers
    rows : one for each friction coefficient of Table 1
    cycle : the two values of P/2 between which the accumulating rule alternates without friction

    """

    reference: Reference
    rows: tuple[Row, ...]
    cycle: tuple[float, ...]

    def row(self, friction: float) -> Row:
        """The row of one friction coefficient."""
        return next(row for row in self.rows if row.friction == friction)


def half_force(result: ContactResult) -> float:
    """P/2: the quarter's contact force [N/mm], NaN without a stress state."""
    if not result.has_state:
        return float("nan")
    return result.contacts["plate"].normal_force


def largest_principal_stress(result: ContactResult) -> float:
    """Largest |principal stress| [MPa] over the 4×4 Gauss points of each element, NaN without a stress state."""
    if not result.has_state:
        return float("nan")
    _, _, stress = result.gauss_stress()
    first, second, _ = principal_stresses(stress)
    return float(max(np.abs(first).max(), np.abs(second).max()))


def traction_difference(result: ContactResult, reference: ContactResult) -> float:
    """Largest difference of the contact tractions over the reference's mean pressure, NaN without a stress state."""
    if not result.has_state or not reference.has_state:
        return float("nan")
    ours, theirs = result.contacts["plate"], reference.contacts["plate"]
    apart = [ours.normal_stress - theirs.normal_stress, ours.tangential_stress - theirs.tangential_stress]
    return float(np.abs(apart).max() * theirs.weights.sum() / theirs.normal_force)


def step_count() -> int:
    """Progress steps of `run`."""
    return len(load().table) * (1 + len(available()))


def run(advance: Advance) -> PaperStudy:
    """Compute everything; `advance` is called after each step."""
    reference = load()
    rows = tuple(_row(reference, friction, printed, advance) for friction, printed in reference.table.items())
    return PaperStudy(reference, rows, _cycle(reference))


def _row(reference: Reference, friction: float, printed: float, advance: Advance) -> Row:
    problem = discretize(reference.plate(friction), element="bfs")
    accumulating, as_printed = (
        reference.uzawa(problem, rule=rule, iterations=reference.iterations) for rule in ("accumulating", "printed")
    )
    decay = SHRINKING if friction == 0.0 else None
    converged = reference.uzawa(problem, tolerance=TOLERANCE, step_decay=decay)
    plain = solve(problem, inner=REFERENCE_INNER, tolerance=TOLERANCE, variant="plain")
    condensed = solve(problem, method="condensed", tolerance=TOLERANCE)
    strict = solve(problem, inner=STRICT_INNER, tolerance=TOLERANCE)
    advance(f"μ = {friction:.2f}")
    back_ends = dict(_back_ends(problem, friction, advance))
    reference_run = back_ends[REFERENCE_INNER]
    return Row(
        friction, printed, accumulating, as_printed, converged, reference_run, back_ends, plain, condensed, strict
    )  # fmt: skip


def _back_ends(problem: Discretization, friction: float, advance: Advance) -> Iterator[tuple[str, ContactResult]]:
    for inner in available():
        yield inner, solve(problem, inner=inner, tolerance=TOLERANCE, patience=PATIENCE)
        advance(f"μ = {friction:.2f}, {inner}")


def _cycle(reference: Reference) -> tuple[float, ...]:
    """Values of P/2 in the last iterations of the frictionless run with a constant step, each once."""
    problem = discretize(reference.plate(0.0), element="bfs")
    result = reference.uzawa(problem)
    unit = problem.scales.stress * problem.scales.length
    forces = [-unit * record.normal_resultant for record in result.history[-8:]]
    distinct = [b for a, b in pairwise(sorted(forces)) if b - a > 1e-6 * abs(b)]
    return (min(forces), *distinct)
