"""What a solve returns."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from solvers.basics.frames import columns_of, frame
from solvers.basics.status import Status
from solvers.basics.types import Vector
from solvers.certificate.certificate import Certificate
from solvers.certificate.uniqueness import UniquenessBound, uniqueness_bound
from solvers.inequality.problem import FrictionQVI
from solvers.solution.contraction import observed_contraction

if TYPE_CHECKING:
    from pandas import DataFrame


class Iteration(NamedTuple):
    """One outer iteration, or one of the interior point method, dimensionless.

    Attributes
    ----------
    number : from 1
    residual : fixed point: |s_new − s| / |s_new|, norm weighted by W; Uzawa: relative change of λ; condensed: the
        largest of gap and residuals, see `condensed.interior_point.Measures`
    energy : ½ zᵀKz − fᵀz
    normal_resultant : Σ W (N z + n0), negative in compression
    inner_status : how the inner problem ended; ``None`` where there is none
    inner_iterations : iterations of the inner solver, 0 if unknown
    seconds : wall time of the iteration

    """

    number: int
    residual: float
    energy: float
    normal_resultant: float
    inner_status: Status | None = None
    inner_iterations: int = 0
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class QVISolution:
    """A point z with its multipliers, how it was found, and the proof of what it is worth.

    Attributes
    ----------
    problem : the original data
    status : `Status`; "solved" only if `certificate` passed
    z : (n,) unknowns; NaN if there is no result
    normal_multiplier, tangential_multiplier : (m,) row multipliers m = W λ, signs as in `FrictionQVI`
    equality_multiplier : (p,)
    threshold : (m,) bound of |σ_T| at z, NaN without a z
    certificate : computed on `problem`
    history : one `Iteration` each (thinned out for long Uzawa runs: the first thousand, then every tenth,
        hundredth, … and the last)
    iterations : number of outer iterations done
    timings : seconds by name: "setup", "solve", "certificate"
    method, inner : what was used; `inner` is the fixed point's, else empty
    message : one readable sentence
    versions : package → version of what was used
    farkas : (rows of G, of A) multipliers proving infeasibility, else None; see `feasibility`
    form : unknowns of the inner problems, and of the condensed method's Newton matrices: "full" or "condensed"
    factorisation : back end and version of the factorisation of K; empty if none was made
    corrections : of the condensed method, sizes of the defect corrections in the energy norm, relative: what the
        rounding inside K had spoilt; they end where the next one would be rounding
    remarks : what to know about a solution, such as that there are several; one sentence each
    near : of the condensed method, whether the state it was to begin from was near enough; None if there was none

    """

    problem: FrictionQVI
    status: Status
    z: Vector
    normal_multiplier: Vector
    tangential_multiplier: Vector
    equality_multiplier: Vector
    threshold: Vector
    certificate: Certificate
    history: tuple[Iteration, ...] = ()
    iterations: int = 0
    timings: Mapping[str, float] = field(default_factory=dict)
    method: str = ""
    inner: str = ""
    message: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    farkas: tuple[Vector, Vector] | None = None
    form: str = "full"
    factorisation: str = ""
    corrections: tuple[float, ...] = ()
    remarks: tuple[str, ...] = ()
    near: bool | None = None

    def to_frame(self) -> "DataFrame":
        """One row for each `Iteration` as a pandas table, with its fields as columns; needs the extra ``frame``.

        Raises
        ------
        InputError
            If pandas is missing.

        """
        rows = [entry._asdict() for entry in self.history]
        return frame(columns_of(rows))

    @property
    def solved(self) -> bool:
        """Whether `status` is solved, that is, whether the certificate passed."""
        return self.status is Status.SOLVED

    @property
    def normal_displacement(self) -> Vector:
        """u_N − g = −λ_N at the contact points (m,), ≤ 0; one of many if rows of N are dependent."""
        return np.asarray(-self.normal_multiplier / self.problem.W)

    @property
    def tangential_displacement(self) -> Vector:
        """u_T − w = −λ_T at the contact points (m,); one of many if rows of T are dependent."""
        return np.asarray(-self.tangential_multiplier / self.problem.W)

    @property
    def contraction(self) -> float | None:
        """Observed contraction of the fixed point, see `contraction`; None for methods without an outer loop."""
        return observed_contraction(self.history) if self.method == "fixed-point" else None

    @cached_property
    def uniqueness(self) -> UniquenessBound:
        """The sufficient bound of friction for uniqueness, computed when it is asked for; see `uniqueness`."""
        return uniqueness_bound(self.problem)
