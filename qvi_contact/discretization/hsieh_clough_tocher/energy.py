"""The complementary energy on a mesh of triangles."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.discretization.hsieh_clough_tocher.condensed import CondensedTriangles, TriangleRoot, energy_matrix
from qvi_contact.discretization.hsieh_clough_tocher.space import TriangleSpace


@dataclass(frozen=True, eq=False)
class TriangleEnergy:
    """The energy of a `TriangleSpace` filled with material and body force, interiors condensed; see `Energy`."""

    space: TriangleSpace
    condensed: CondensedTriangles

    @cached_property
    def load(self) -> FloatArray:
        """−∫ c φI : τ dx as a vector over all degrees of freedom (N,), condensed."""
        constants = self.condensed.constants
        if not constants.any():
            return np.zeros(self.space.size)
        w = (constants[:, None] @ self.condensed.roots)[:, 0]
        return -self.space.differences.adjoint(w)

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """𝒦, shape (N, N)."""
        return energy_matrix(self.condensed, self.space.differences)

    def reduced(self, elimination: Elimination) -> tuple[sparse.csr_array, FloatArray]:
        """K = Bᵀ 𝒦 B (n, n) and 𝒦 u₀ (N,)."""
        B = elimination.basis
        return sparse.csr_array(B.T @ (self.matrix @ B)), self.matrix @ elimination.particular

    def root(self, elimination: Elimination) -> TriangleRoot:
        """The stresses from differences."""
        centres = self.space.triangles.corners.mean(axis=1)
        basis, particular = elimination.basis, elimination.particular
        return TriangleRoot(self.condensed, self.space.differences, centres, basis, particular)

    def places(self, elimination: Elimination) -> None:
        """None: lines across triangles cut more unknowns than what METIS finds."""

    def coefficients(self, u: FloatArray) -> FloatArray:
        """Φ of each triangle, shape (cells, dimension).

        First (Φ, Φ_x, Φ_y) in its first corner, which make an affine function, then factors of the functions 3, 4, … of
        the reference triangle, which make the rest.
        """
        affine, w = self.space.differences.apply(u)
        frames, first = self.space.frames, self.space.mesh.cells[:, 0]
        if frames.several:
            affine += (frames.affine(first) @ u[frames.columns(first)][:, :, None])[:, :, 0]
        B = self.space.element.transformations(self.space.triangles)[:, 3:, 3:]
        shared = (B @ w[:, :, None])[:, :, 0]
        found = np.hstack([affine, shared, self.condensed.interior(shared)])
        curved = self.space.curved
        if len(curved):
            own = w[curved.numbers]
            inner = self.condensed.interior(own, curved.numbers)
            factors = np.hstack([own, inner])[:, :, None]
            found[curved.numbers, 3:] = (curved.functions[:, 3:, 3:] @ factors)[:, :, 0]
        return found
