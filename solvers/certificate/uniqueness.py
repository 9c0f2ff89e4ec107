r"""A bound of the friction coefficient below which the solution is unique.

Let Σ be the set of traces (σ_N, σ_T) that the body can have, with the scalar product (σ, τ) = Σ_i W_i (σ_N τ_N + σ_T
τ_T)_i of L² on the contact. Let 𝒲 be the operator for which ½ (𝒲σ, σ) + (c, σ) + const is the least energy of a state
with the traces σ. In the coordinates x = √W σ, with B = [N; T] and K⁻¹ on the null space of A,

    Ĉ = √W B K⁻¹ Bᵀ √W,    𝒲 = Ĉ⁺ on Σ.

**Lemma.** If the rows of B are independent, the tractions σ¹, σ² for the bounds thr(s¹), thr(s²) obey

    ‖σ_N¹ − σ_N²‖ ≤ mu γ ‖s¹ − s²‖,    γ² = λ_max(Ĉ_NN) λ_max(𝒲_TT),    mu the largest one.

With d = σ¹ − σ² and e = λ¹ − λ² this follows from 𝒲d = −e; the proof is among the derivations in `docs/theory.md`.

**Consequence.** For mu < 1/γ the map s → |σ_N(s)| is a contraction: there is at most one solution. If there is an
admissible traction for every bound s ≥ 0, there is exactly one solution, and the plain fixed point converges to it at
least at the rate mu γ.

The condition is sufficient, not necessary: for larger mu there may be one solution, several, or none. γ² grows like
1/h, as tractions at the scale of an element hardly deform the body, so the bound is smaller on finer meshes.

**Dependent rows.** Four points on an edge carry two parameters of σ_N and three of σ_T. Then only 𝒲d = −P e holds, with
the projection P on Σ: the multipliers of single points are not unique, and the step from e_T to (𝒲d)_T fails. The bound
then holds for a law that is tested on the traces (multipliers in Σ). For the law at points it is an indicator, not a
proof, see `UniquenessBound.proves`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh, eigvalsh, qr

from solvers.basics.types import Matrix
from solvers.inequality.problem import FrictionQVI
from solvers.inequality.rows import dense

LARGEST = 1200
"""Contact rows 2m up to which the bound is computed, in about a second."""

_RANK = 1e-10  # pivots of QR of the scaled rows below this are zero
_LOST = 1e-13  # eigenvalues below this share of the largest are rounding


@dataclass(frozen=True)
class UniquenessBound:
    """The sufficient condition of this module for one problem."""

    friction: float
    """The largest mu of the points whose friction bound depends on the pressure."""
    bound: float | None = None
    """1/γ. Infinite if no friction bound depends on the pressure, or if no normal or no tangential traction of the
    contact can change; None if not computed."""
    independent: bool = True
    """Whether contact rows are linearly independent, so that the condition is a proof for the law at points."""
    reason: str = ""
    """Why the bound was not computed; empty if it was."""

    @property
    def satisfied(self) -> bool:
        """Whether mu is below the bound."""
        return self.bound is not None and self.friction < self.bound

    @property
    def proves(self) -> bool:
        """Whether it is proved that the solution is unique."""
        return self.satisfied and self.independent

    def sentence(self) -> str:
        """The bound and its consequence, in words."""
        if self.bound is None:
            return f"Sufficient bound of friction for uniqueness: not computed, {self.reason}."
        if self.friction == 0.0:
            return "No friction bound depends on the pressure: the stress is unique."
        if self.bound == np.inf:
            return "Equilibrium alone determines all normal or tangential tractions of contacts: the stress is unique."
        text = (
            f"The solution is unique where friction is below 1/γ = {self.bound:.2g}, which may be much too strict. "
            f"Friction is {self.friction:.3g} here"
        )
        if not self.satisfied:
            return f"{text}: there may be one solution or several."
        if self.proves:
            return f"{text}: there is no other solution."
        return f"{text}: the only solution if the law holds on whole edges. It holds at points only: an estimate."


def uniqueness_bound(qvi: FrictionQVI) -> UniquenessBound:
    """The bound 1/γ of a problem; dense algebra, for contacts of up to `LARGEST` rows 2m."""
    friction = float(qvi.mu[qvi.law.moving].max(initial=0.0))
    if friction == 0.0 or not qvi.n:
        return UniquenessBound(friction, np.inf)
    if 2 * qvi.m > LARGEST:
        return UniquenessBound(friction, reason=f"as {2 * qvi.m} contact rows are more than {LARGEST}")
    # Ĉ (2m, 2m), and an orthonormal basis (2m, r) of all √W [N; T] z with A z = 0.
    contact, weights = qvi.condensed_contact, np.sqrt(np.concatenate([qvi.W, qvi.W]))
    rows, C = weights[:, None] * dense(contact.interface_rows), weights[:, None] * contact.compliance * weights
    lengths = np.linalg.norm(rows, axis=0)
    units = np.where(lengths > 0.0, lengths, 1.0)  # scales the columns to length one; zero columns stay
    A = contact.system.A / units
    lengths = np.linalg.norm(A, axis=1)
    fixed = _spanned((A[lengths > 0.0] / lengths[lengths > 0.0, None]).T)
    basis = _spanned(rows / units - rows / units @ fixed @ fixed.T)
    if not basis.shape[1]:
        return UniquenessBound(friction, np.inf)
    # Eigenvalues of Ĉ on Σ, and its modes; equations fix up to p of them.
    values, vectors = eigh(basis.T @ C @ basis)
    is_positive = values > _LOST * values[-1]
    if (~is_positive).sum() > qvi.p or not is_positive.any():
        return UniquenessBound(friction, reason="as the compliance of the contact is beyond double precision")
    values, modes = values[is_positive], basis @ vectors[:, is_positive]
    C_NN = (modes[: qvi.m] * values) @ modes[: qvi.m].T
    W_TT = (modes[qvi.m :] / values) @ modes[qvi.m :].T
    square = float(eigvalsh(C_NN)[-1] * eigvalsh(W_TT)[-1])
    bound = float(1.0 / np.sqrt(square)) if square > 0.0 else np.inf
    return UniquenessBound(friction, bound, modes.shape[1] == 2 * qvi.m)


def _spanned(columns: Matrix) -> Matrix:
    """Orthonormal columns that span the given ones, which have at most length one."""
    Q, R, _ = qr(columns, mode="economic", pivoting=True)
    return np.asarray(Q[:, np.abs(np.diag(R)) > _RANK])
