"""In which unknowns the inner problems are posed.

"full"       the unknowns z themselves: large and sparse, and as badly conditioned as K
"condensed"  only what the contact points feel. The rows B = [N; T] = E Y span r ≤ 2m directions Y; with a
             factor F Fᵀ = Y K⁻¹ Yᵀ and V = E F the tractions are σ_bonded + V w and the energy is ½|w|². Small, dense,
             perfectly conditioned; z follows from the multipliers by one linear solve with the factor of K

Both are minimised by the same tractions and multipliers. The condensed form pays while contact points are few beside
the unknowns; "auto" takes it up to `CONDENSED_LIMIT` rows.

In either form rows without friction, whose bound is always 0, are equations T z + t0 = 0. As inequalities
|T z + t0| ≤ 0 they would have no interior, and several of them that depend on each other contradict one another in
rounding. Rows of N that are bilateral are no inequalities at all; they become 0 ≤ 1.
"""

from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, vstack

from solvers.basics.types import Matrix, Sparse, Vector
from solvers.inequality.problem import Compliance, FrictionQVI
from solvers.inequality.rows import independent_rows
from solvers.inner.problem import Centre, InnerSolution

Form = Literal["auto", "full", "condensed"]

CONDENSED_LIMIT = 2000
"""Rows of B, 2m, up to which "auto" condenses."""

_COMPLIANT, _HELD = 1e-14, 1e-12
"""Eigenvalues of Y K⁻¹ Yᵀ below these shares of its largest, and of 1/|K|, are rounding."""


class ProblemForm(Protocol):
    """The problem an inner solver sees, and the way back."""

    name: str
    problem: FrictionQVI

    def threshold(self, threshold: Vector) -> Vector:
        """The friction bound as the inner problem takes it (m,)."""
        ...

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """Where to pose the next inner problem: at the last result, in its own and in the original unknowns."""
        ...

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """The result in the original unknowns and rows."""
        ...


@dataclass(frozen=True, eq=False)
class Simplified:
    """Rows without friction turned into independent equality rows, bilateral ones made void.

    Attributes
    ----------
    problem : the QVI with those equations in A, their rows of T empty, bilateral rows of N empty
    rows : (m,) bool
    E : (rows, k), T_rows = E Y with Y the k equality rows appended to A

    """

    problem: FrictionQVI
    rows: np.ndarray
    E: Matrix

    @classmethod
    def of(cls, qvi: FrictionQVI) -> "Simplified":
        """Find the rows; a problem that has none is kept as it is."""
        if qvi.bilateral.any():
            held = qvi.bilateral
            N = csc_array(diags_array(np.where(held, 0.0, 1.0)) @ qvi.N)
            N.eliminate_zeros()
            qvi = qvi.with_contact(N=N, traces=None).with_loads(n0=np.where(held, -1.0, qvi.n0))
        rows = qvi.frictionless
        if not rows.any():
            return cls(qvi, rows, np.zeros((0, 0)))
        E, Y = independent_rows(csc_array(qvi.T[rows]))
        kept = np.where(rows, 0.0, 1.0)
        b = np.concatenate([qvi.b, -np.linalg.lstsq(E, qvi.t0[rows], rcond=None)[0]])
        empty, equations = csc_array(diags_array(kept) @ qvi.T), csc_array(vstack([qvi.A, Y]))
        contact = replace(qvi.contact, T=empty, A=equations, traces=None)
        problem = replace(qvi, contact=contact, loads=replace(qvi.loads, t0=kept * qvi.t0, b=b))
        return cls(problem, rows, E)

    def threshold(self, threshold: Vector) -> Vector:
        """1 where the row is empty: a bound that is never reached."""
        return np.where(self.rows, 1.0, threshold)

    def restore(self, result: InnerSolution) -> InnerSolution:
        """Row multipliers of the original T from those of the equations: Eᵀ m_T = ν, of least norm."""
        if self.problem.bilateral.any():
            result = replace(result, m_N=np.where(self.problem.bilateral, 0.0, result.m_N))
        if not self.rows.any():
            return result
        p = len(result.nu) - self.E.shape[1]
        m_T = np.array(result.m_T)
        m_T[self.rows] = np.linalg.lstsq(self.E.T, result.nu[p:], rcond=None)[0]
        return replace(result, m_T=m_T, nu=result.nu[:p])


class FullForm:
    """(D2) as it is."""

    name = "full"

    def __init__(self, simplified: Simplified) -> None:
        self._simplified = simplified
        self.problem = simplified.problem
        self.threshold = simplified.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:  # noqa: ARG002
        """At the last result, or the bonded one."""
        return Centre(self.problem, self.problem.bonded if result is None else result.z)

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """The result itself."""
        return self._simplified.restore(inner)


class CondensedForm:
    """min ½|w|²  s.t.  σ_bonded,N + V_N w ≤ 0,  |σ_bonded,T + V_T w| ≤ thr; at the minimum w = −Vᵀ m."""

    name = "condensed"

    def __init__(self, simplified: Simplified) -> None:
        qvi = simplified.problem
        self._simplified, self._compliance = simplified, Compliance(qvi)
        E, Y = independent_rows(qvi.contact_rows)
        Y_interface = Y[:, qvi.condensed_contact.system.interface]
        C = Y_interface @ qvi.condensed_contact.system.solve_interface(Y_interface.T.toarray())[0]
        self._V = E @ _factor(C, qvi.K)
        m, r, bonded = qvi.m, self._V.shape[1], self._compliance.bonded
        self.problem = FrictionQVI.from_arrays(
            K=csc_array(eye_array(r)), f=np.zeros(r), N=csc_array(self._V[:m]), n0=bonded[:m],
            T=csc_array(self._V[m:]), t0=bonded[m:], mu=qvi.mu, W=qvi.W, bilateral=qvi.bilateral,
        )  # fmt: skip
        self.threshold = simplified.threshold

    def centre(self, inner: InnerSolution | None, result: InnerSolution | None) -> Centre:
        """At the w of the last multipliers, with the tractions of the accurate z: rounding in V then decays."""
        if inner is None or result is None:
            return Centre(self.problem, np.zeros(self.problem.n))
        qvi = self._simplified.problem
        centre = Centre(self.problem, -self._V.T @ np.concatenate([inner.m_N, inner.m_T]))
        centre.n0, centre.t0 = qvi.normal(result.z), qvi.tangential(result.z)
        return centre

    def expand(self, inner: InnerSolution) -> InnerSolution:
        """Z and ν from the multipliers."""
        z, nu = self._compliance.unknowns(np.concatenate([inner.m_N, inner.m_T]))
        return self._simplified.restore(replace(inner, z=z, nu=nu))


def make_form(qvi: FrictionQVI, form: Form) -> ProblemForm:
    """Choose and build; a problem whose contact tractions do not depend on z stays in full form."""
    simplified = Simplified.of(qvi)
    if form == "full" or (form == "auto" and 2 * qvi.m > CONDENSED_LIMIT):
        return FullForm(simplified)
    condensed = CondensedForm(simplified)
    return condensed if condensed.problem.n > 0 else FullForm(simplified)


def _factor(C: Matrix, K: Sparse) -> Matrix:
    """F with F Fᵀ = C for C = Y K⁻¹ Yᵀ, from its eigenvalues; directions without compliance are left out.

    As Y has orthonormal rows, C is at least 1/|K| where no equation A z = b holds the direction.
    """
    values, vectors = np.linalg.eigh((C + C.T) / 2.0)
    least = max(_COMPLIANT * values.max(initial=0.0), _HELD / float(K.diagonal().max(initial=1.0)))
    kept = values > least
    return np.asarray(vectors[:, kept] * np.sqrt(values[kept]))
