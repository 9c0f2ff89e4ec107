"""Everything that is computed about the paper's plate."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from comparisons.paper.reference import Reference, load
from qvi_contact.basics.terminal import Advance
from qvi_contact.paper import QuarterPlate
from solvers import QVISolution, available, solve_qvi

SHRINKING: Final = 100.0
"""Iterations after which the shrinking step of the frictionless Uzawa run has halved."""

TOLERANCE: Final = 1e-8
PATIENCE: Final = 3
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
    back_ends: dict[str, QVISolution]
    plain: QVISolution
    condensed: QVISolution

    @property
    def reference(self) -> QVISolution:
        """The fixed point that all others are compared with."""
        return self.back_ends["direct:clarabel"]

    def half_force(self, solution: QVISolution) -> float:
        """P/2: the quarter's contact force [N/mm], NaN without a stress state."""
        return self.plate.force(solution.z)

    def largest_principal_stress(self, solution: QVISolution) -> float:
        """Largest |principal stress| [MPa] over the 4×4 Gauss points of each element, NaN without a stress state."""
        return float(np.abs(self.plate.principal_stress(solution.z)[:2]).max())

    def traction_difference(self, solution: QVISolution) -> float:
        """Largest difference of tractions from the reference's over its mean pressure, NaN without a stress state."""
        qvi, states = self.plate.qvi, (solution.z, self.reference.z)
        ours, theirs = (np.stack([qvi.normal(z), qvi.tangential(z)]) for z in states)
        mean_pressure = self.half_force(self.reference) / float(self.plate.x[-1])
        return self.plate.stress_unit * float(np.abs(ours - theirs).max()) / mean_pressure


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
    reference, rows = load(), []
    for friction, printed in reference.table.items():
        plate = reference.plate(friction)
        accumulating, as_printed = (
            reference.uzawa(plate.qvi, rule=rule, iterations=reference.iterations)
            for rule in ("accumulating", "printed")
        )
        decay = SHRINKING if friction == 0.0 else None
        converged = reference.uzawa(plate.qvi, tolerance=TOLERANCE, step_decay=decay)
        plain = solve_qvi(plate.qvi, inner="direct:clarabel", tolerance=TOLERANCE, variant="plain")
        condensed = solve_qvi(plate.qvi, method="condensed", tolerance=TOLERANCE)
        advance(f"μ = {friction:.2f}")
        back_ends = {}
        for inner in available():
            back_ends[inner] = solve_qvi(plate.qvi, inner=inner, tolerance=TOLERANCE, patience=PATIENCE)
            advance(f"μ = {friction:.2f}, {inner}")
        rows.append(
            Row(friction, printed, plate, accumulating, as_printed, converged, back_ends, plain, condensed)
        )  # fmt: skip
    # values of P/2 in the last iterations of the frictionless run with a constant step, each once
    smooth = rows[0].plate
    history = reference.uzawa(smooth.qvi).history[-8:]
    forces = [-smooth.stress_unit * smooth.length_unit * record.normal_resultant for record in history]
    distinct = [b for a, b in pairwise(sorted(forces)) if b - a > 1e-6 * abs(b)]
    return PaperStudy(reference, tuple(rows), (min(forces), *distinct))
