"""Inner solver ``strict-direct:clarabel``: one Clarabel solver for the cones of `cones`, only the vectors updated.

Another one is made when the bound becomes zero elsewhere, see `faces`. Unknowns (x, β₊, β₋). Settings and citation as
in `inner.direct_clarabel`.
"""

import time

import numpy as np
from scipy.sparse import block_diag, csc_array, eye_array, hstack, triu, vstack

from solvers.basics.status import Status
from solvers.basics.types import BoolVector, Matrix, Module, Sparse, Vector, load
from solvers.basics.watch import expired
from solvers.inequality.problem import FrictionQVI
from solvers.inner.direct_clarabel import DirectClarabel
from solvers.inner.guard import updated_solve
from solvers.inner.problem import Centre, InnerSolution, no_result
from solvers.inner.qp_backends import CLARABEL_WORDS
from solvers.strict.cones import CLARABEL_SETTINGS, ConeProblem, cone_coordinates, functional
from solvers.strict.faces import Faces, closed_coefficients

_BROKEN = "NumericalError"
_STEADIER = 1e-10
"""Regularisation of linear systems where Clarabel breaks down with the small one of `cones`, as on 128 × 8 cells."""


class DirectStrictClarabel:
    """Solves with a `_Program` for the coefficients that the bound holds at zero, kept while these are the same."""

    packages: tuple[str, ...] = ("clarabel",)

    def __init__(self, qvi: FrictionQVI, tolerance: float) -> None:
        clarabel = load("clarabel")

        self._cones = ConeProblem(qvi)
        self._clarabel, self._tolerance = clarabel, tolerance
        self._program: _Program | None = None

    def _made(self, closed: BoolVector, **settings: float) -> "_Program":
        """A program with other settings than those of `cones` where some are given."""
        all_settings = DirectClarabel._settings(self._clarabel, self._tolerance)
        for name, value in {**CLARABEL_SETTINGS, **settings}.items():
            setattr(all_settings, name, value)
        return _Program(self._cones, closed, self._clarabel, all_settings)

    def solve(
        self,
        threshold: Vector,
        centre: Centre,
        start: InnerSolution | None,  # noqa: ARG002
    ) -> InnerSolution:
        """Solve for Bernstein coefficients of the bound (3e,), edge by edge; `start` is not used."""
        began = time.perf_counter()
        theta, shear = threshold.reshape(-1, 3), self._cones.shear(centre)
        size = max(np.abs(shear).max(initial=0.0), np.abs(self._cones.ends(centre)).max(initial=0.0))
        closed = closed_coefficients(theta, float(size))
        if self._program is None or not np.array_equal(self._program.faces.closed, closed):
            self._program = self._made(closed)
        if self._program.faces.contradicted(theta, shear):
            said = "a shear that no unknown can change is not zero where its bound is"
            return no_result(self._cones.qvi, Status.INFEASIBLE, said, time.perf_counter() - began)
        answer = self._program.solve(theta, centre)
        if str(answer.status) == _BROKEN and not expired():
            self._program = self._made(closed, static_regularization_constant=_STEADIER)
            answer = self._program.solve(theta, centre)
        word = str(answer.status)
        m_N, m_T, nu = self._program.multipliers(np.array(answer.z))
        return InnerSolution(
            centre.z + np.array(answer.x)[: self._cones.qvi.n], m_N, m_T, nu,
            CLARABEL_WORDS.get(word, Status.BACKEND_FAILED), int(answer.iterations),
            time.perf_counter() - began, f"clarabel: {word}",
        )  # fmt: skip


class _Program:
    """Clarabel on  A x + w = b and Y x + w = y (w = 0),  rows, ends and −β + w = h (w ≥ 0),  cones + w = h.

    The cones are two on each of the c curved edges of `faces`.
    """

    def __init__(self, cones: ConeProblem, closed: BoolVector, clarabel: Module, settings: Module) -> None:
        self._cones, self.faces = cones, Faces(cones, closed)
        qvi, c = cones.qvi, len(self.faces.curved)
        rows, sizes = self._rows()
        equations, inequalities = sum(sizes[:2]), sum(sizes[2:5])
        zeros = [clarabel.ZeroConeT(equations)] if equations else []
        kinds = [*zeros, clarabel.NonnegativeConeT(inequalities), *([clarabel.SecondOrderConeT(3)] * (2 * c))]
        self._ends = np.cumsum(sizes)[:-1]
        upper = csc_array(block_diag([triu(qvi.K), csc_array((2 * c, 2 * c))], format="csc"))
        right = np.ones(rows.shape[0])  # of no meaning: every solve sets its own
        self._solver = clarabel.DefaultSolver(upper, np.zeros(qvi.n + 2 * c), rows, right, kinds, settings)

    def _rows(self) -> tuple[Sparse, list[int]]:
        """A, Y, ends, bounded coefficients, −β, the cones' rows ±(τ) + (0, 0, 2β), three together; how many of each."""
        cones, faces, c, n = self._cones, self.faces, len(self.faces.curved), self._cones.qvi.n
        slack = csc_array((np.full(c, 2.0), (np.arange(2 * c, 3 * c), np.arange(c))), (3 * c, c))
        nothing = csc_array((3 * c, c))
        interleaved = np.arange(3 * c).reshape(3, c).T.ravel()
        chosen = (cones.count * np.arange(3)[:, None] + faces.curved).ravel()
        curved = cones.cone_rows.tocsr()[chosen]
        linear = [cones.qvi.A, faces.equations, cones.N, vstack([faces.bounded, -faces.bounded])]
        blocks = [
            *(hstack([block, csc_array((block.shape[0], 2 * c))]) for block in linear),
            hstack([csc_array((2 * c, n)), -eye_array(2 * c)]),
            hstack([curved, slack, nothing], "csr")[interleaved],
            hstack([-curved, nothing, slack], "csr")[interleaved],
        ]
        return csc_array(vstack(blocks)), [block.shape[0] for block in blocks]

    def solve(self, theta: Matrix, centre: Centre) -> Module:
        """Clarabel's answer for the bound (e, 3)."""
        shear, curved = self._cones.shear(centre), self.faces.curved
        slacks = np.zeros(2 * len(curved))
        right = [
            centre.b, self.faces.values(shear), -self._cones.ends(centre), self.faces.limits(theta, shear), slacks,
            cone_coordinates((theta - shear)[curved]).ravel(), cone_coordinates((theta + shear)[curved]).ravel(),
        ]  # fmt: skip
        return updated_solve(self._solver, np.concatenate([-centre.f, slacks]), np.concatenate(right))

    def multipliers(self, z: Vector) -> tuple[Vector, Vector, Vector]:
        """(m_N, m_T, ν) from those of all rows."""
        nu, equations, pushes, limits, _, upper, lower = np.split(z, self._ends)
        cones = functional(upper.reshape(-1, 3)) - functional(lower.reshape(-1, 3))
        return *self._cones.multipliers(pushes, self.faces.functionals(equations, limits, cones)), nu
