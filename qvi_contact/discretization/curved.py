"""Edges that are arcs, and the triangles beside them: tractions, functions, and energies integrated up to the arcs.

On an arc from a to b, of length ℓ and with the turning tangent e, the traction follows from the change of ∇Φ,

    d∇Φ/ds = Φ_ee e + Φ_em m,   σ_N = Φ_ee,   σ_T = −(n·m) Φ_em,   m = (−e_y, e_x)

N_k, Q_k are the Legendre coefficients of Φ_ee and Φ_em over the arc's length, as on straight edges: a constant
pressure has one coefficient. N_0, Q_0, N_1 give the polynomials the resultant force and moment of Φ, ∇Φ in the corners,

    ℓ ∫ (N e + Q m) dt = ∇Φ_b − ∇Φ_a,   ℓ ∫ (N e + Q m)·(x_m − x) dt = Φ_b − Φ_a − (b − a)·(∇Φ_a + ∇Φ_b)/2

with the middle x_m of the chord. The other coefficients are those of Φ itself.

A triangle with arcs has the polynomials of the straight triangle, in physical coordinates. The degrees of freedom on a
side that is an arc are the coefficients above; on other sides they are the usual ones. So a neighbour across a straight
side sees no difference, and Φ stays C1. With c the factors of the reference functions, c_s those of corners and edges,
u the triangle's own degrees of freedom and v the interior ones,

    G c_s = H u − A_v v.

In rows of corners and straight sides, G = I, A_v = 0, and H is the transformation of the straight triangle. In rows of
arcs, G and A_v are the traction coefficients A of the reference functions, and H = I.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.element.edge import gauss_legendre, legendre_basis, legendre_from_values
from qvi_contact.element.hsieh_clough_tocher import HsiehCloughTocher, compliance_roots
from qvi_contact.element.triangle import EDGES, AffineTriangles
from qvi_contact.mesh.edges import angles, arc_offsets, beyond_chords, stretches, turned

_ALONG_ARCS: Final = 8  # Gauss points along an arc, less the degree and the number of coefficients of its bend


def resultant_shapes(bend: FloatArray, t: FloatArray) -> FloatArray:
    """Factors (n, q, 3, 2) of Φ_ee and Φ_em in the force along the chord, across it, and in the moment.

    They are integrands at shares t (n, q) of the lengths of arcs with bends (n, k), see `mesh.edges`, on unit chords.
    """
    cosine, sine = np.cos(angles(bend, t)), np.sin(angles(bend, t))
    frame = np.array([[cosine, -sine], [sine, cosine]]).transpose(2, 3, 0, 1)  # (n, q, component, e or m)
    arm = np.array([0.5, 0.0]) - arc_offsets(np.tile([1.0, 0.0], (len(bend), 1)), bend, t)
    moment = (arm[..., None] * frame).sum(axis=2, keepdims=True)
    return np.asarray(stretches(bend)[:, None, None, None] * np.concatenate([frame, moment], axis=2))


def from_corners(bend: FloatArray, degree: int) -> FloatArray:
    """Matrices (n, 2d + 2, 2d + 2) to N_0 … N_d, Q_0 … Q_d of n arcs with bends (n, k) and chords of length 1.

    They act on the force along the chord, the force across it, the moment, N_2 … N_d and Q_1 … Q_d.
    """
    t, w = gauss_legendre(degree + _ALONG_ARCS + bend.shape[1])
    values = legendre_basis(degree, t) * w[:, None]
    shapes = resultant_shapes(bend, np.tile(t, (len(bend), 1)))
    sums = np.einsum("nqrf,qk->nrfk", shapes, values).reshape(len(bend), 3, -1)
    solved = np.array([0, 1, degree + 1])  # the indices of N_0, N_1 and Q_0, and of the other coefficients
    given = np.setdiff1d(np.arange(2 * degree + 2), solved)
    matrices = np.zeros((len(bend), 2 * degree + 2, 2 * degree + 2))
    right = np.concatenate([np.tile(np.eye(3), (len(bend), 1, 1)), -sums[:, :, given]], axis=2)
    matrices[:, solved] = np.linalg.solve(sums[:, :, solved], right)
    matrices[:, given, 3 + np.arange(len(given))] = 1.0
    return matrices


@dataclass(frozen=True, eq=False)
class CurvedTriangles:
    """The triangles of a mesh that have arcs as sides."""

    element: HsiehCloughTocher
    numbers: IntArray  # (c,): numbers of these cells in the mesh
    triangles: AffineTriangles  # the straight triangles of the same corners, dimensionless
    bends: FloatArray  # (c, 3, k): bends of their sides, see `mesh.edges`

    @cached_property
    def functions(self) -> FloatArray:
        """Factors c of the reference functions, shape (c, dimension, dimension).

        Column j belongs to the function of the triangle's degree of freedom j: first u, then v.
        """
        shared, interior = self.element.shared, self.element.interior
        G = np.tile(np.eye(shared), (len(self.numbers), 1, 1))
        H = self.element.transformations(self.triangles)
        inner = np.zeros((len(self.numbers), shared, interior))
        for s in range(3):
            bent = np.flatnonzero(self.bends[:, s].any(axis=1))
            place = 9 + s * self.element.on_edge + np.arange(self.element.on_edge)
            A, squares = self._tractions(s, bent)
            G[bent[:, None], place] = A[:, :, :shared] * squares
            H[bent[:, None], place] = np.eye(shared)[place] * squares
            inner[bent[:, None], place] = A[:, :, shared:] * squares
        factors = np.zeros((len(self.numbers), self.element.dimension, self.element.dimension))
        factors[:, :shared] = np.linalg.solve(G, np.concatenate([H, -inner], axis=2))
        factors[:, np.arange(shared, factors.shape[1]), np.arange(shared, factors.shape[1])] = 1.0
        return factors

    def _tractions(self, s: int, chosen: IntArray) -> tuple[FloatArray, FloatArray]:
        """A (k, on_edge, dimension), N_2 …, Q_1 … of the reference functions on arcs at side s; and squared chords."""
        degree = self.element.traction_degree
        t, _ = gauss_legendre(degree + _ALONG_ARCS + self.bends.shape[2])
        first, second = EDGES[s]
        corners, bends = self.triangles.corners[chosen], self.bends[chosen]
        chords = corners[:, second] - corners[:, first]
        lengths = np.hypot(*chords.T)
        # tangents and normals at points of the arcs, and the points' reference coordinates
        tangent = turned((chords / lengths[:, None])[:, None], angles(bends[:, s], t))
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        along = np.zeros((len(t), 3))
        along[:, first], along[:, second] = 1.0 - t, t
        at = beyond_chords(corners, bends, along)[0]
        # Φ_ee and Φ_em there, then their Legendre coefficients
        hessians = self.triangles.hessian_maps[chosen][:, None] @ self.element.reference_functions(at, 2)
        a, b = np.moveaxis(tangent, -1, 0)  # factors of (Φ_xx, Φ_yy, Φ_xy) in derivatives along two vectors
        factors = (np.stack([a * c, b * d, a * d + b * c], axis=-1) for c, d in ((a, b), np.moveaxis(normal, -1, 0)))
        normal_part, shear_part = (np.einsum("kqc,kqcd->kqd", factor, hessians) for factor in factors)
        project = legendre_from_values(degree, len(t))
        coefficients = np.concatenate([(project @ normal_part)[:, 2:], (project @ shear_part)[:, 1:]], axis=1)
        return coefficients, np.square(lengths)[:, None, None]

    def stress_rows(self, block: slice, compliances: FloatArray, rule: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Rows S with SᵀS the energies ∫ c σ:τ of the functions up to the arcs, in k triangles, (k, 3 q, dimension)."""
        upper = compliance_roots(compliances).swapaxes(1, 2) @ self.triangles.stress_maps[block]
        roots = np.sqrt(self.areas(rule[0])[block] * rule[1])
        table = self._hessians(block, rule[0]) @ self.functions[block, None]
        rows = np.einsum("kab,kqbd->kaqd", upper, table * roots[:, :, None, None])
        return np.asarray(rows).reshape(len(rows), -1, self.element.dimension)

    def load(self, block: IntArray, strain: FloatArray, points: FloatArray) -> FloatArray:
        """Sums (k, dimension) of the functions' reference Hessians times numbers (k, q, 3) at points."""
        sums = np.einsum("kqb,kqbd->kd", strain, self._hessians(block, points))
        return np.asarray((sums[:, None] @ self.functions[block])[:, 0])

    def areas(self, points: FloatArray) -> FloatArray:
        """Dimensionless areas (c, q) that weights of sum 1 at reference points (q, 3) are multiplied by."""
        return self.triangles.areas[:, None] * beyond_chords(self.triangles.corners, self.bends, points)[1]

    def _hessians(self, block: slice | IntArray, points: FloatArray) -> FloatArray:
        """Reference Hessians (k, q, 3, dimension) of the reference functions at points (q, 3) of curved triangles."""
        at = beyond_chords(self.triangles.corners[block], self.bends[block], points)[0]
        return self.element.reference_functions(at, 2)
