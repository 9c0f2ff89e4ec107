"""Everything that is computed about the paper's plate."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from comparisons.paper.reference import Reference, load
from qvi_contact.basics.terminal import Advance
from qvi_contact.paper import QuarterPlate
from solvers import QVISolution, available, solve_qvi

SHRINKING = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

REFERENCE_INNER = "direct:clarabel"
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
    plate : the paper's system
    uzawa, uzawa_printed_rule : the paper's number of iterations, with the accumulating rule and with that as printed
    uzawa_converged : accumulating rule to the tolerance; at μ = 0 with a shrinking step
    reference : fixed point, what all others are compared with
    back_ends : inner solver → its fixed point
    plain : fixed point without acceleration, for the convergence picture
    condensed : the inequality solved directly

    """

    friction: float
    printed: float
    plate: QuarterPlate
    uzawa: QVISolution
    uzawa_printed_rule: QVISolution
    uzawa_converged: QVISolution
    reference: QVISolution
    back_ends: dict[str, QVISolution]
    plain: QVISolution
    condensed: QVISolution

    @property
    def best_qp(self) -> QVISolution:
        """The fixed point by a quadratic program (Clarabel through qpsolvers)."""
        return self.back_ends["qp:clarabel"]

    @property
    def best_socp(self) -> QVISolution:
        """The fixed point by second-order cones (Clarabel)."""
        return self.back_ends["socp:clarabel"]

    def half_force(self, solution: QVISolution) -> float:
        """P/2: the quarter's contact force [N/mm], NaN without a stress state."""
        return self.plate.force(solution.z)

    def largest_principal_stress(self, solution: QVISolution) -> float:
        """Largest |principal stress| [MPa] over the 4×4 Gauss points of each element, NaN without a stress state."""
        return float(np.abs(self.plate.principal_stress(solution.z)[:2]).max())

    def traction_difference(self, solution: QVISolution) -> float:
        """Largest difference of tractions from the reference's over its mean pressure, NaN without a stress state."""
        ours, theirs = (np.stack(self.plate.tractions(each.z)[1:]) for each in (solution, self.reference))
        mean_pressure = self.half_force(self.reference) / float(self.plate.x[-1])
        return float(np.abs(ours - theirs).max()) / mean_pressure


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


def step_count() -> int:
    """Progress steps of `run`."""
    return len(load().table) * (1 + len(available()))


def run(advance: Advance) -> PaperStudy:
    """Compute everything; `advance` is called after each step."""
    reference = load()
    rows = tuple(_row(reference, friction, printed, advance) for friction, printed in reference.table.items())
    return PaperStudy(reference, rows, _cycle(reference))


def _row(reference: Reference, friction: float, printed: float, advance: Advance) -> Row:
    plate = reference.plate(friction)
    accumulating, as_printed = (
        reference.uzawa(plate.qvi, rule=rule, iterations=reference.iterations) for rule in ("accumulating", "printed")
    )
    decay = SHRINKING if friction == 0.0 else None
    converged = reference.uzawa(plate.qvi, tolerance=TOLERANCE, step_decay=decay)
    plain = solve_qvi(plate.qvi, inner=REFERENCE_INNER, tolerance=TOLERANCE, variant="plain")
    condensed = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
    advance(f"μ = {friction:.2f}")
    back_ends = dict(_back_ends(plate, advance))
    reference_run = back_ends[REFERENCE_INNER]
    return Row(
        friction, printed, plate, accumulating, as_printed, converged, reference_run, back_ends, plain, condensed
    )  # fmt: skip


def _back_ends(plate: QuarterPlate, advance: Advance) -> Iterator[tuple[str, QVISolution]]:
    for inner in available():
        yield inner, solve_qvi(plate.qvi, inner=inner, tolerance=TOLERANCE, patience=PATIENCE)
        advance(f"μ = {plate.friction:.2f}, {inner}")


def _cycle(reference: Reference) -> tuple[float, ...]:
    """Values of P/2 in the last iterations of the frictionless run with a constant step, each once."""
    plate = reference.plate(0.0)
    result = reference.uzawa(plate.qvi)
    unit = plate.stress_unit * plate.length_unit
    forces = [-unit * record.normal_resultant for record in result.history[-8:]]
    distinct = [b for a, b in pairwise(sorted(forces)) if b - a > 1e-6 * abs(b)]
    return (min(forces), *distinct)
