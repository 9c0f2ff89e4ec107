"""Hsieh-Clough-Tocher elements on a mesh of triangles as a `Basis`."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.discretization.basis import ContactRule, PrescribedTraction, RowKind, SharedCorners
from qvi_contact.discretization.constraints import stacked
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.discretization.hsieh_clough_tocher.condensed import CondensedTriangles, potential_points, split_points
from qvi_contact.discretization.hsieh_clough_tocher.energy import TriangleEnergy
from qvi_contact.discretization.hsieh_clough_tocher.space import TriangleSpace
from qvi_contact.discretization.hsieh_clough_tocher.tractions import eliminate_tractions
from qvi_contact.element import legendre
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.element.lattices import triangle_lattice
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges
from qvi_contact.mesh.triangles import TriangleMesh

if TYPE_CHECKING:
    from qvi_contact.discretization.contact_rows import ContactRows

_INWARD = 1e-9  # how far points of a part that is drawn lie inside it, as a share of its size
_ARCS: Final = 6  # degree of quadrature beyond twice that of Φ where triangles have arcs
_LONGEST: Final = 1e3  # longest side over height of a triangle: beyond, too many digits are lost


@dataclass(frozen=True, eq=False)
class TriangleBasis:
    """A mesh of triangles and the element of one degree; see `Basis`.

    Attributes
    ----------
    mesh : TriangleMesh
        The mesh.
    degree : int
        p.
    rows : "bernstein" or "gauss"
        What the rows of contacts are.

    """

    mesh: TriangleMesh
    degree: int
    rows: RowKind = "bernstein"
    family: str = "Hsieh-Clough-Tocher"
    shear_at_vertices: bool = False
    strict_rows: RowKind = "bernstein"

    @cached_property
    def space(self) -> TriangleSpace:
        """Its degrees of freedom."""
        return TriangleSpace(self.mesh, self.degree)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.space.size

    @property
    def vertices(self) -> FloatArray:
        """Dimensionless coordinates, shape (v, 2)."""
        return self.space.vertices

    @property
    def normal_degree(self) -> int:
        """Degree of σ_N on an edge."""
        return self.degree - 2

    @property
    def shear_degree(self) -> int:
        """Degree of σ_T on an edge."""
        return self.degree - 2

    @cached_property
    def smallest(self) -> float:
        """The shortest edge, dimensionless."""
        return float(self.space.sizes.min())

    @property
    def centres(self) -> IntArray:
        """Those of `frames` if there are several."""
        found = self.space.frames
        return found.centres if found.several else found.centres[:0]

    @property
    def cuts(self) -> IntArray:
        """Vertices along the cuts."""
        return self.space.cuts.vertices

    @cached_property
    def cell_sizes(self) -> FloatArray:
        """Areas of the triangles, dimensionless."""
        return self.space.triangles.areas

    @property
    def cell_points(self) -> FloatArray:
        """Barycentric coordinates of quadrature points, shape (g, 3)."""
        return self._rule[0]

    @property
    def cell_weights(self) -> FloatArray:
        """Their weights, of sum 1."""
        return self._rule[1]

    @cached_property
    def _rule(self) -> tuple[FloatArray, FloatArray]:
        """Points and weights for energies; arcs, which are no polynomials, take more of them."""
        return split_points(2 * self.degree + _ARCS) if len(self.space.curved) else potential_points(self.degree)

    @cached_property
    def contact_rule(self) -> ContactRule:
        """As many rows as σ_N and σ_T have coefficients on an edge, so that rows are independent."""
        if self.rows == "gauss":
            return ContactRule.gauss(self.degree - 1)
        points, weights = gauss_legendre(self.degree - 1)
        count = len(points)
        values = legendre.basis(count - 1, points) @ np.linalg.inv(legendre.to_bernstein(count - 1))
        places, shares = np.linspace(0.0, 1.0, count), np.full(count, 1.0 / count)
        return ContactRule("bernstein", points, weights, places, shares, values)

    def normal_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_N without φ at the points t (q,) along each of n edges, edge by edge, shape (n q, N)."""
        return self.space.normal(edges).mapped(legendre.basis(self.normal_degree, t)).matrix()

    def shear_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_T, along the tangent of each edge, at the same points, shape (n q, N)."""
        return self.space.shear(edges).mapped(legendre.basis(self.shear_degree, t)).matrix()

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u (N,) at the same points, (n q,) each."""
        values = legendre.basis(self.normal_degree, t)
        normal, shear = (found.apply(u) @ values.T for found in (self.space.normal(edges), self.space.shear(edges)))
        return normal.ravel(), shear.ravel()

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T over the same points, a vector over all u (N,)."""
        load = np.zeros(self.size)
        for weights, functionals in ((normal, self.space.normal), (shear, self.space.shear)):
            if weights.any():
                load += functionals(edges).adjoint(weights.reshape(len(edges), -1) @ legendre.basis(self.degree - 2, t))
        return load

    def trace_parameters(self, edges: Sequence[Edges]) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Tractions at the Gauss points, and V⁻¹ on each edge."""
        rule = self.contact_rule
        values = legendre.basis(self.normal_degree, rule.points)
        parts = [kind(part).mapped(values).rows() for kind in (self.space.normal, self.space.shear) for part in edges]
        Y = stacked(parts, self.size)
        if rule.to_points is None:
            return Y, sparse.csr_array(sparse.eye_array(Y.shape[0]))
        return Y, _block_diagonal(np.asarray(np.linalg.inv(rule.to_points), dtype=np.float64), Y.shape[0] // rule.count)

    def eliminate(self, tractions: Sequence[PrescribedTraction], corners: SharedCorners) -> Elimination:  # noqa: ARG002
        """All degrees of freedom that meet the prescribed tractions, u = B z + u₀, see `Basis.eliminate`."""
        return eliminate_tractions(self.space, tractions)

    def contact_displacements(
        self,
        contacts: Sequence["ContactRows"],
        number: int,
        normal: FloatArray,
        tangential: FloatArray,
        elimination: Elimination,  # noqa: ARG002  # rows are independent: nothing is to be projected
    ) -> tuple[FloatArray, FloatArray]:
        """λ_N and λ_T (m,) at the Gauss points of one contact: multipliers over weights."""
        weights = contacts[number].points.weights
        return normal / weights, tangential / weights

    def energy(self, materials: IntArray, compliances: FloatArray, potential: FloatArray | None) -> "TriangleEnergy":
        """The energy of the body; see `Basis.energy`.

        Raises
        ------
        InputError
            If a triangle is so long and thin that its energy is lost in rounding.

        """
        triangles = self.space.triangles
        thinnest = int(np.argmax(triangles.elongations))
        if triangles.elongations[thinnest] > _LONGEST:
            x, y = self.mesh.corners[thinnest].mean(axis=0)
            remedy = (
                f"the triangle around ({x:.6g}, {y:.6g}) is this many times as long as high: give at most {_LONGEST:g}"
            )
            raise InputError("ContactProblem.mesh", float(triangles.elongations[thinnest]), remedy)
        own = compliances[materials]
        condensed = CondensedTriangles.of(self.space.element, triangles, own, potential, self._rule)
        if len(self.space.curved):
            condensed = condensed.with_arcs(self.space.curved, own, potential, self._rule)
        return TriangleEnergy(self.space, condensed)

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates (k, q, 2) of reference points t, (q, 3) or (k, q, 3), in the triangles (k,)."""
        return np.asarray(self.mesh.placed(cells, t) @ self.space.triangles.corners[cells])

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ at such points, shape (k, q, 3)."""
        hessians = self._reference_sums(2, coefficients[cells], cells, t)
        return np.asarray(hessians @ self.space.triangles.stress_maps[cells].swapaxes(1, 2))

    def cell_rule(self, degree: int) -> tuple[FloatArray, FloatArray]:
        """Points in the three parts of a triangle, see `Basis`."""
        return split_points(degree)

    def jumps(self, u: FloatArray) -> FloatArray:
        """By how much Φ and its slopes jump where each cut begins, shape (k, 3)."""
        start = self.space.cuts.start
        return np.asarray((self.space.units * u)[start:].reshape(-1, 3))

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q), dimensionless areas, at reference points t (q, 3) with weights (q,) of sum 1."""
        found = np.asarray(self.cell_sizes[:, None] * weights)
        curved = self.space.curved
        if len(curved):
            found[curved.numbers] = curved.areas(t) * weights
        return found

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at such points, shape (k, q)."""
        chosen, corners = coefficients[cells], self.space.triangles.corners[cells]
        placed = self.mesh.placed(cells, t)
        affine = chosen[:, :1] + ((placed @ corners - corners[:, :1]) @ chosen[:, 1:3, None])[:, :, 0]
        return np.asarray(affine + self._reference_sums(0, chosen, cells, t)[:, :, 0])

    def _reference_sums(self, order: int, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ but for its affine part, or its Hessian, on the reference triangle; (k, q, components).

        Points that all triangles share are the same points of all but those with arcs.
        """
        functions, mesh = self.space.element.reference_functions, self.mesh
        if t.ndim == 3:
            return _applied(functions(mesh.placed(cells, t), order)[..., 3:], coefficients[:, 3:])
        found = _applied(functions(t, order)[..., 3:], coefficients[:, 3:])
        bent = np.flatnonzero(mesh.curved[cells])
        if len(bent):
            table = functions(mesh.placed(cells[bent], t), order)[..., 3:]
            found[bent] = _applied(table, coefficients[bent, 3:])
        return found

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Barycentric points (k, 3) that divide the three parts of a triangle, and the corners (c, 3) of the pieces.

        Stresses may jump between the parts, so each has points of its own, which lie a trifle inside it.
        """
        flat, pieces = triangle_lattice(divisions)
        flat = (1.0 - _INWARD) * flat + _INWARD / 3.0
        parts = [np.array([*np.delete(np.eye(3), corner, axis=0), np.full(3, 1.0 / 3.0)]) for corner in range(3)]
        points = np.concatenate([flat @ part for part in parts])
        return points, np.concatenate([pieces + part * len(flat) for part in range(3)])


def _block_diagonal(block: FloatArray, count: int) -> sparse.csr_array:
    """The same block (q, q) so many times."""
    q = len(block)
    columns = np.repeat(np.arange(count * q).reshape(count, q), q, axis=0)
    data = np.tile(block, (count, 1)).ravel()
    return sparse.csr_array((data, columns.ravel(), q * np.arange(count * q + 1)), shape=(count * q, count * q))


def _applied(table: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Functions (q, c, m), or (k, q, c, m), times coefficients (k, m); shape (k, q, c)."""
    if table.ndim == 3:
        q, c, m = table.shape
        return np.asarray(coefficients @ table.reshape(q * c, m).T).reshape(len(coefficients), q, c)
    return np.asarray((table @ coefficients[:, None, :, None])[..., 0])
