"""The problems of the comparison, as algebra; built once in each process and kept.

| name            | what it is                                                                                      |
|-----------------|-------------------------------------------------------------------------------------------------|
| plate_n         | the paper's plate, μ = 0.2, n × n of its elements: well conditioned, slip and stick             |
| graded_n        | the same, each cell 0.6 times the one before it: badly conditioned                              |
| stick_n         | the same on equal cells, μ = 2: no point slips                                                  |
| ssnv128_n       | Code_Aster's SSNV128 on n × n cells cut into triangles: a part opens, slips, sticks             |
| doubled_rows    | plate_8 with every contact point twice, at half the weight: rows that depend on each other      |
| pulled_block    | a block pulled off its ground: no solution                                                      |

Bodies other than the plate are on triangles of degree 4, with the law at Gauss points. On the plate the rows of N and T
are dependent also without doubling: an edge has four points and two or three parameters.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.sparse import csc_array, vstack

from comparisons.convergence.bodies import dragged_block
from qvi_contact import ContactProblem, discretize, paper
from qvi_contact.gallery import ssnv128
from solvers import FrictionQVI, Law, QVISolution, certify, solve_qvi
from solvers.basics.types import Vector
from solvers.fixed_point import ProblemForm, make_form
from solvers.inner.problem import Centre
from solvers.inner.registry import make_inner

GRADING: Final = 0.6
STEPS: Final = 6
"""Most bounds of a sequence."""

_REFERENCE: Final = 1e-10  # tolerance of the solutions that bounds are taken from
_RECORDED: Final = "direct:clarabel"  # inner solver of the outer loop whose bounds are recorded
_ROUNDS: Final = 2  # solves of the first step, the second at the first one's answer


@dataclass(frozen=True)
class Described:
    """A problem before it is built: its kind, whether it has a solution, whether all is affordable in all unknowns."""

    build: Callable[[], FrictionQVI]
    kind: str
    feasible: bool = True
    small: bool = True


class Instance:
    """A problem with what its runs share: reference solution, bounds, forms."""

    def __init__(self, described: Described) -> None:
        self.described = described
        self.qvi = described.build()
        self._forms: dict[str, ProblemForm] = {}
        self._centres: dict[str, Centre] = {}

    @cached_property
    def reference(self) -> QVISolution:
        """By the condensed method; for bounds and facts only, never for judging a result."""
        return solve_qvi(self.qvi, tolerance=_REFERENCE)

    def form(self, name: str) -> ProblemForm:
        """The problem in these unknowns; what that costs is not part of any time."""
        if name not in self._forms:
            self._forms[name] = make_form(self.qvi, name)
        return self._forms[name]

    @cached_property
    def bound(self) -> Vector:
        """The bound (m,) of the inner problem: that of the solution, without one that of the bonded state."""
        if not self.described.feasible:
            return self._first_bound
        return self.qvi.threshold(self.qvi.pressure(self.reference.z))

    @cached_property
    def bounds(self) -> tuple[Vector, ...]:
        """The bounds that the plain outer loop meets after its first step, up to the first it cannot solve."""
        form = self.form("condensed")
        solver = make_inner(_RECORDED, form.problem, _REFERENCE)
        met: list[Vector] = []
        bound, centre = self._first_bound, self.centre("condensed")
        while len(met) <= STEPS:
            found = form.expand(solver.solve(form.threshold(bound), centre, None))
            if not certify(self.given(bound), found.z, found.m_N, found.m_T, found.nu, 1e-6).passed:
                break
            met.append(bound)
            bound = self.qvi.threshold(self.qvi.pressure(found.z))
        return tuple(met[1:])

    def centre(self, name: str) -> Centre:
        """Where all inner problems are posed: at the answer of the loop's first step, which is not one of them.

        As in the outer loop itself, whose problems are posed at its last answer: rounding in what they are made of then
        decays. Without a solution it is the bonded state.
        """
        if name not in self._centres:
            form = self.form(name)
            self._centres[name] = form.centre(None, None)
            for _ in range(_ROUNDS if self.described.feasible else 0):
                solver = make_inner(_RECORDED, form.problem, _REFERENCE)
                found = solver.solve(form.threshold(self._first_bound), self._centres[name], None)
                if not found.finite:
                    break
                self._centres[name] = form.centre(found, form.expand(found))
        return self._centres[name]

    @property
    def _first_bound(self) -> Vector:
        """The bound (m,) of the outer loop's first step, that of the bonded state."""
        return self.qvi.threshold(self.qvi.pressure(self.qvi.bonded))

    def given(self, bound: Vector) -> FrictionQVI:
        """The inner problem as an inequality of its own: friction with this bound, whatever the pressure."""
        return self.qvi.with_bound(bound)


@cache
def instance(name: str) -> Instance:
    """The problem of this name, kept for the process."""
    return Instance(PROBLEMS[name])


def _algebra(problem: ContactProblem) -> FrictionQVI:
    return discretize(problem, law_on="points").rescaled().qvi


def _plate(cells: int, friction: float = 0.2, grading: float = 1.0) -> Callable[[], FrictionQVI]:
    return lambda: paper.plate(friction, (cells, cells), grading=grading).qvi


def _block(drag: float, push: float) -> Callable[[], FrictionQVI]:
    """A block on ground with μ = 0.5 under a uniform stress: σ_yy = −push, σ_xy = drag [MPa]."""
    return lambda: _algebra(dragged_block(0.5, (4, 2), drag, push, 1e4))


def doubled_rows(qvi: FrictionQVI) -> FrictionQVI:
    """The same problem with every contact point twice, each at half the weight: row multipliers are shared out."""
    N, T = (csc_array(vstack([rows, rows])) for rows in (qvi.N, qvi.T))
    contact = replace(qvi.contact, N=N, T=T, W=np.tile(qvi.W, 2) / 2.0, traces=None)
    loads = replace(qvi.loads, n0=np.tile(qvi.n0, 2), t0=np.tile(qvi.t0, 2))
    law = Law(np.tile(qvi.mu, 2), np.tile(qvi.cohesion, 2), np.tile(qvi.cap, 2), np.tile(qvi.bilateral, 2))
    return FrictionQVI(qvi.stiffness, contact, loads, law)


PROBLEMS: Final[Mapping[str, Described]] = MappingProxyType({
    "plate_4": Described(_plate(4), "well conditioned"),
    "plate_8": Described(_plate(8), "well conditioned"),
    "plate_16": Described(_plate(16), "well conditioned", small=False),
    "graded_8": Described(_plate(8, grading=GRADING), "ill conditioned"),
    "graded_16": Described(_plate(16, grading=GRADING), "ill conditioned", small=False),
    "ssnv128_4": Described(lambda: _algebra(ssnv128((4, 4))), "open contact"),
    "stick_8": Described(_plate(8, friction=2.0), "sticking"),
    "stick_16": Described(_plate(16, friction=2.0), "sticking", small=False),
    "doubled_rows": Described(lambda: doubled_rows(_plate(8)()), "redundant rows"),
    "dragged_block": Described(_block(5.05, 10.0), "no solution", feasible=False),
    "pulled_block": Described(_block(0.0, -1.0), "no solution", feasible=False),
})  # fmt: skip
"""Name → problem, in the order of the tables."""
