"""Where an iteration starts: the answer to a problem before."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from solvers.basics.types import Vector

if TYPE_CHECKING:
    from solvers.inequality.problem import FrictionQVI
    from solvers.solution.solution import QVISolution


@dataclass(frozen=True, eq=False)
class Start:
    """A state of a problem with the same rows, in the units of the one to be solved.

    Attributes
    ----------
    pressure : s (m,) ≥ 0
    z : (n,) unknowns
    normal_multiplier, tangential_multiplier : (m,) row multipliers, signs as in `FrictionQVI`

    """

    pressure: Vector
    z: Vector
    normal_multiplier: Vector
    tangential_multiplier: Vector

    @classmethod
    def of(cls, solution: QVISolution, stress: float = 1.0, displacement: float = 1.0) -> Start:
        """The answer to a problem before, its units given in those of the problem to be solved."""
        return cls(
            stress * solution.problem.pressure(solution.z),
            stress * solution.z,
            displacement * solution.normal_multiplier,
            displacement * solution.tangential_multiplier,
        )

    def fits(self, qvi: FrictionQVI) -> bool:
        """Whether it may be a state of that problem."""
        return self.z.shape == (qvi.n,) and self.normal_multiplier.shape == (qvi.m,)
