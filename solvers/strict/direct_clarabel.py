"""Inner solver ``strict-direct:clarabel``: one Clarabel solver for the cones of `cones`, only the vectors updated.

Unknowns (x, β₊, β₋). Settings and citation as in `inner.direct_clarabel`.
"""

import time

import numpy as np
from scipy.sparse import block_diag, csc_array, eye_array, hstack, triu, vstack

from solvers.basics.status import Status
from solvers.basics.types import Sparse, Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.direct_clarabel import DirectClarabel
from solvers.inner.guard import updated_solve
from solvers.inner.problem import Centre, InnerSolution
from solvers.inner.qp_backends import CLARABEL_WORDS
from solvers.strict.cones import CLARABEL_SETTINGS, ConeProblem, cone_coordinates


class DirectStrictClarabel:
    """Clarabel on  A x + w = b (w = 0),  ends and −β + w = h (w ≥ 0),  cones + w = h (w in 2e cones)."""

    packages: tuple[str, ...] = ("clarabel",)

    def __init__(self, qvi: FrictionQVI, tolerance: float) -> None:
        clarabel = load("clarabel")

        self._cones = cones = ConeProblem(qvi)
        e, self._linear = cones.count, cones.N.shape[0]
        zeros = [clarabel.ZeroConeT(qvi.p)] if qvi.p else []
        kinds = [*zeros, clarabel.NonnegativeConeT(self._linear + 2 * e), *([clarabel.SecondOrderConeT(3)] * (2 * e))]
        rows = self._rows(qvi, cones)
        upper = csc_array(block_diag([triu(qvi.K), csc_array((2 * e, 2 * e))], format="csc"))
        settings = DirectClarabel._settings(clarabel, tolerance)
        for name, value in CLARABEL_SETTINGS.items():
            setattr(settings, name, value)
        right = np.ones(rows.shape[0])  # of no meaning: every solve sets its own
        self._solver = clarabel.DefaultSolver(upper, np.zeros(qvi.n + 2 * e), rows, right, kinds, settings)

    @staticmethod
    def _rows(qvi: FrictionQVI, cones: ConeProblem) -> Sparse:
        """Equations, ends, −β, and the cones' rows ±(τ) + (0, 0, 2β), three together."""
        e, n = cones.count, qvi.n
        slack = csc_array((np.full(e, 2.0), (np.arange(2 * e, 3 * e), np.arange(e))), (3 * e, e))
        nothing = csc_array((3 * e, e))
        interleaved = np.arange(3 * e).reshape(3, e).T.ravel()
        bounds = [
            hstack([cones.cone_rows, slack, nothing], "csr")[interleaved],
            hstack([-cones.cone_rows, nothing, slack], "csr")[interleaved],
        ]
        blocks = [
            hstack([qvi.A, csc_array((qvi.p, 2 * e))]),
            hstack([cones.N, csc_array((cones.N.shape[0], 2 * e))]),
            hstack([csc_array((2 * e, n)), -eye_array(2 * e)]),
            *bounds,
        ]
        return csc_array(vstack(blocks))

    def _right(self, threshold: Vector, centre: Centre) -> Vector:
        theta, shear = threshold.reshape(-1, 3), self._cones.shear(centre)
        cones = [cone_coordinates(theta - shear).ravel(), cone_coordinates(theta + shear).ravel()]
        return np.concatenate([centre.b, -self._cones.ends(centre), np.zeros(2 * len(theta)), *cones])

    def solve(
        self,
        threshold: Vector,
        centre: Centre,
        start: InnerSolution | None,  # noqa: ARG002
    ) -> InnerSolution:
        """Solve for Bernstein coefficients of the bound (3e,), edge by edge; `start` is not used."""
        began = time.perf_counter()
        qvi, e = self._cones.qvi, self._cones.count
        q = np.concatenate([-centre.f, np.zeros(2 * e)])
        right = self._right(threshold, centre)
        answer = updated_solve(self._solver, q, right)
        word = str(answer.status)
        multipliers = np.array(answer.z)
        upper, lower = multipliers[qvi.p + self._linear + 2 * e :].reshape(2, e, 3)
        m_N, m_T = self._cones.multipliers(multipliers[qvi.p : qvi.p + self._linear], upper, lower)
        return InnerSolution(
            centre.z + np.array(answer.x)[: qvi.n], m_N, m_T, multipliers[: qvi.p],
            CLARABEL_WORDS.get(word, Status.BACKEND_FAILED), int(answer.iterations),
            time.perf_counter() - began, f"clarabel: {word}",
        )  # fmt: skip
