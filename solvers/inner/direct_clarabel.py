"""Inner solver ``direct:clarabel``: one Clarabel solver kept alive, only the vectors updated.

Interior point with a homogeneous embedding; does not warm-start, but keeps the symbolic factorisation and
the equilibration. Presolve, chordal decomposition and the dropping of zeros are off: they forbid updates.
Cite: P. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic objectives.
"""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csc_array, triu, vstack

from solvers.basics.status import Status
from solvers.basics.types import Module, Vector, load
from solvers.inequality.problem import FrictionQVI
from solvers.inner.guard import updated_solve
from solvers.inner.problem import Centre, InnerProblem, InnerSolution
from solvers.inner.qp import CLARABEL_WORDS

_FLOOR = 1e-12


class DirectClarabel:
    """Clarabel on  A x + w = b (w = 0),  G x + w = h (w ≥ 0)."""

    packages: tuple[str, ...] = ("clarabel",)

    def __init__(self, qvi: FrictionQVI, tolerance: float, options: Mapping[str, Any] | None = None) -> None:
        clarabel = load("clarabel")

        self._inner = InnerProblem(qvi)
        cones = [clarabel.ZeroConeT(qvi.p)] if qvi.p else []
        cones.append(clarabel.NonnegativeConeT(3 * qvi.m))
        rows = csc_array(vstack([qvi.A, self._inner.G])) if qvi.p else self._inner.G
        right = np.ones(qvi.p + 3 * qvi.m)  # of no meaning: every solve sets its own
        upper = csc_array(triu(qvi.K))
        settings = self._settings(clarabel, tolerance, options)
        self._solver = clarabel.DefaultSolver(upper, np.zeros(qvi.n), rows, right, cones, settings)

    @staticmethod
    def _settings(clarabel: Module, tolerance: float, options: Mapping[str, Any] | None = None) -> Module:
        settings = clarabel.DefaultSettings()
        if options is None:
            options = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), max(tolerance, _FLOOR))
        for name, value in options.items():
            setattr(settings, name, value)
        settings.verbose = False
        settings.presolve_enable = False
        settings.chordal_decomposition_enable = False
        settings.input_sparse_dropzeros = False
        return settings

    def solve(
        self,
        threshold: Vector,
        centre: Centre,
        start: InnerSolution | None,  # noqa: ARG002
    ) -> InnerSolution:
        """Solve for the bound threshold (m,); `start` is not used."""
        began = time.perf_counter()
        qvi = self._inner.qvi
        b = np.concatenate([centre.b, centre.h(threshold)])
        answer = updated_solve(self._solver, -centre.f, b)
        word = str(answer.status)
        multipliers = np.array(answer.z)
        m_N, m_T = self._inner.multipliers(multipliers[qvi.p :])
        return InnerSolution(
            centre.z + np.array(answer.x), m_N, m_T, multipliers[: qvi.p],
            CLARABEL_WORDS.get(word, Status.BACKEND_FAILED), int(answer.iterations),
            time.perf_counter() - began, f"clarabel: {word}",
        )  # fmt: skip
