"""The complementary energy ½ ∫ cσ:σ of a body filled with material and body force."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.condensed import CondensedTriangles, TriangleRoot, energy_matrix
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.discretization.space import StressSpace
from qvi_contact.errors import InputError

_LONGEST: Final = 1e3  # longest side over height of a triangle: beyond, too many digits are lost

_ORDERED = 2000  # unknowns from which on their order of elimination counts


@dataclass(frozen=True, eq=False)
class TriangleEnergy:
    """The energy of a `StressSpace`, interiors of triangles condensed and known again by `coefficients`."""

    space: StressSpace
    condensed: CondensedTriangles

    @classmethod
    def of(
        cls, space: StressSpace, materials: IntArray, compliances: FloatArray, potential: FloatArray | None
    ) -> "TriangleEnergy":
        """The energy of the body.

        Parameters
        ----------
        space : StressSpace
            Mesh and element.
        materials : (cells,) int array
            Which of the compliances each cell has.
        compliances : (k, 3, 3) array
            Dimensionless compliances c of (xx, yy, xy).
        potential : (cells, g) array or None
            φ at the points of `StressSpace.cell_quadrature`, dimensionless; None without body force.

        Raises
        ------
        InputError
            If a triangle is so long and thin that its energy is lost in rounding.

        """
        triangles = space.triangles
        thinnest = int(np.argmax(triangles.elongations))
        if triangles.elongations[thinnest] > _LONGEST:
            x, y = space.mesh.corners[thinnest].mean(axis=0)
            remedy = (
                f"the triangle around ({x:.6g}, {y:.6g}) is this many times as long as high: give at most {_LONGEST:g}"
            )
            raise InputError("ContactProblem.mesh", float(triangles.elongations[thinnest]), remedy)
        own, rule = compliances[materials], space.cell_quadrature
        condensed = CondensedTriangles.of(space.element, triangles, own, potential, rule)
        if len(space.curved):
            condensed = condensed.with_arcs(space.curved, own, potential, rule)
        return cls(space, condensed)

    @cached_property
    def load(self) -> FloatArray:
        """−∫ c φI : τ dx as a vector over all degrees of freedom (N,), condensed; zeros without body force."""
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
        """K = Bᵀ 𝒦 B (n, n), exactly symmetric up to rounding, and 𝒦 u₀ (N,), with 𝒦 the matrix of ∫ cσ:τ over u."""
        B = elimination.basis
        return sparse.csr_array(B.T @ (self.matrix @ B)), self.matrix @ elimination.particular

    def root(self, elimination: Elimination) -> TriangleRoot:
        """r(z) with ½|r|² = ½ ∫ cσ:σ at u = B z + u₀, φ included, evaluated without the cancellation inside K."""
        centres = self.space.triangles.corners.mean(axis=1)
        basis, particular = elimination.basis, elimination.particular
        return TriangleRoot(self.condensed, self.space.differences, centres, basis, particular)

    def places(self, elimination: Elimination) -> FloatArray | None:
        """Centres (n, 2) of the vertices and edges whose degrees of freedom belong to each unknown; None for few."""
        basis, vertices = elimination.basis, self.space.vertices
        if basis.shape[1] < _ORDERED:
            return None
        middles = vertices[self.space.mesh.topology.ends].mean(axis=1)
        own = np.vstack([np.repeat(vertices, 3, axis=0), np.repeat(middles, self.space.element.on_edge, axis=0)])
        weights = abs(basis[: len(own)])  # behind them come jumps across cuts, which have no place
        total = np.asarray(weights.sum(axis=0)).ravel()
        centre = vertices.mean(axis=0)
        mean = (weights.T @ (own - centre)) / np.where(total > 0.0, total, 1.0)[:, None]
        return np.asarray(centre + mean)

    def coefficients(self, u: FloatArray) -> FloatArray:
        """Φ of each triangle from the degrees of freedom u (N,), shape (cells, dimension): what `stress` takes.

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
