"""The body condensed on its contact coefficients: what they do under forces, and how the body may float.

In the axes of the supports, v = Q w, with the prescribed degrees of freedom taken out and the interior I eliminated,
K v = f + Bᵀ z leaves on Γ, what contact rows touch,

    S w_Γ = r + B_Γᵀ z,      solvable if  Rᵀ(r + B_Γᵀ z) = 0,      w_Γ = G (r + B_Γᵀ z) + R a

with R an orthonormal basis of the rigid motions that the supports leave free, G = (S + ρ R Rᵀ)⁻¹, and a their size.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.companion.elasticity import Elasticity
from qvi_contact.companion.supports import Supports
from solvers.factorisation import Factorisation, FactorisationError
from solvers.factorisation.choice import Request, make

_FREE = 1e-11  # singular value of rigid motions at supports, relative, that counts as zero
_CORRECTIONS = 3


@dataclass(eq=False)
class CondensedBody:
    """See the module; w (size,) counts all degrees of freedom in the axes of the supports, w_Γ those of `interface`.

    Attributes
    ----------
    body : Elasticity
        The body.
    load : (size,) array
        f.
    supports : Supports
        Prescribed degrees of freedom.
    free : int array
        The others, ascending.
    interface : int array
        Γ, numbers among all degrees of freedom, ascending.
    S : (k, k) array
        The condensed stiffness.
    r : (k,) array
        Right-hand side on Γ.
    R : (k, j) array
        Rigid motions.

    """

    body: Elasticity
    load: FloatArray
    supports: Supports
    free: IntArray
    interface: IntArray
    factor: Factorisation
    S: FloatArray
    r: FloatArray
    R: FloatArray
    _cholesky: tuple[FloatArray, bool]

    @classmethod
    def of(cls, body: Elasticity, load: FloatArray, supports: Supports, rows: sparse.csr_array) -> "CondensedBody":
        """Condense on the degrees of freedom that rows (n, size) of v touch, prescribed ones among them left out.

        Raises
        ------
        FactorisationError
            If the stiffness matrix cannot be factorised.

        """
        size, Q = body.space.size, supports.axes
        free = np.setdiff1d(np.arange(size), supports.index)
        rigid = supports.inverse @ body.space.rigid()
        interface = np.setdiff1d((rows @ Q).indices, supports.index)
        interface = np.union1d(interface, _pins(body, rigid, supports.index, interface)).astype(np.int64)
        K = body.stiffness()
        K = (sparse.csr_array(Q.T @ K @ Q) if supports.slanted else K)[free][:, free]
        place = np.searchsorted(free, interface)
        shift = float(K.diagonal().mean()) if len(free) else 0.0
        held = np.zeros(len(free))
        held[place] = shift  # back ends want a positive definite matrix; S has it on its diagonal and is freed of it
        factor = make(sparse.csc_array(K + sparse.diags_array(held)), place, Request())
        S = factor.schur - shift * np.eye(len(place))
        fixed = np.zeros(size)
        fixed[supports.index] = supports.values
        r, _ = factor.reduce((Q.T @ (load - body.force(Q @ fixed)))[free])
        R = _orthonormal((rigid @ _null_space(rigid[supports.index]))[interface])
        return cls(body, load, supports, free, interface, factor, S, np.asarray(r), R, _stiffened(S, R))

    def relieve(self, forces: FloatArray) -> FloatArray:
        """G times forces on Γ, (k,) or (k, j)."""
        return np.asarray(cho_solve(self._cholesky, forces)) if forces.size else forces

    def expand(self, values: FloatArray) -> FloatArray:
        """V (size,) from w_Γ, the rest in equilibrium: defect corrections remove rounding."""
        w, Q = self.fixed, self.supports.axes
        w[self.interface] = values
        for _ in range(_CORRECTIONS):
            _, state = self.factor.reduce((Q.T @ (self.load - self.body.force(Q @ w)))[self.free])
            w[self.free] += self.factor.expand(state, np.zeros(len(self.interface)))
        return np.asarray(Q @ w)

    @property
    def fixed(self) -> FloatArray:
        """W (size,) with the prescribed values, zero elsewhere."""
        w = np.zeros(self.body.space.size)
        w[self.supports.index] = self.supports.values
        return w


def _stiffened(S: FloatArray, R: FloatArray) -> tuple[FloatArray, bool]:
    if not len(S):
        return S, True
    rho = float(np.trace(S)) / len(S)
    try:
        factor, lower = cho_factor(S + rho * R @ R.T, lower=True)
    except np.linalg.LinAlgError as error:
        raise FactorisationError("singular", "lapack", "the condensed stiffness is not positive definite") from error
    return factor, bool(lower)


def _pins(body: Elasticity, rigid: FloatArray, fixed: IntArray, interface: IntArray) -> IntArray:
    """Two vertices of every block that neither supports nor contacts would hold: Γ must hold all motions."""
    held = np.concatenate([fixed, interface])
    blocks = int(body.space.block.max()) + 1
    found: list[IntArray] = [np.empty(0, dtype=np.int64)]
    for block in range(blocks):
        motions = rigid[:, 3 * block : 3 * block + 3]
        if _null_space(motions[held]).shape[1]:
            mine = np.flatnonzero(body.space.owner == block)
            place = body.space.places[mine].sum(axis=1)
            pair = mine[[int(np.argmin(place)), int(np.argmax(place))]]
            found.append((2 * pair[:, None] + np.arange(2)).ravel())
    return np.setdiff1d(np.concatenate(found), fixed)


def _null_space(matrix: FloatArray) -> FloatArray:
    """Orthonormal basis (n, j) of the null space of (m, n), whose entries are motions of a body of length one."""
    if not len(matrix):
        return np.eye(matrix.shape[1])
    triangle = np.linalg.qr(np.vstack([matrix, np.zeros_like(matrix, shape=(matrix.shape[1],) * 2)]), mode="r")
    _, values, vectors = np.linalg.svd(triangle)
    return np.asarray(vectors[values <= _FREE * max(1.0, float(values[0]))].T)


def _orthonormal(columns: FloatArray) -> FloatArray:
    if not columns.size:
        return np.zeros((len(columns), 0))
    return np.asarray(np.linalg.qr(columns)[0])
