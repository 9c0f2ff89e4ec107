"""What the discretisation asks of a space of Airy functions: a mesh and an element, and nothing else where both meet.

A `Basis` has N degrees of freedom u of the dimensionless Φ. Coordinates are shifted to the mesh's origin and divided by
its length L, stresses by S, displacements by C S L (`Scales`), so that no unit enters here. Three families of linear
functionals make up (D2):

    σ_N = Φ_tt + φ and σ_T = −Φ_nt on edges                      `normal_rows`, `shear_rows`
    prescribed tractions d·σn = T on edges  →  u = B z + u₀      `eliminate`
    ½ ∫ cσ:σ with σ = (Φ_yy + φ, Φ_xx + φ, −Φ_xy)                 `energy`

with n and t of `Edges`, d a unit direction for each edge. What is written "without φ" leaves the potential of the body
force to the caller, who adds it to σ_N, or to σ_xx and σ_yy.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
from scipy import sparse

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.discretization.elimination import Elimination
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.element.quadrature import EdgeQuadrature, adapted, constant
from qvi_contact.mesh.edges import Edges, points_along, rounding_along, vectors_along
from qvi_contact.mesh.mesh import Mesh
from solvers import EnergyRoot

if TYPE_CHECKING:
    from qvi_contact.discretization.contact_rows import ContactRows

RowKind: TypeAlias = Literal["gauss", "bernstein"]
"""What the rows N and T of (D2) are: tractions at Gauss points of edges, or Bernstein coefficients on edges."""

_NO_VERTICES = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class ContactRule:
    """Where on an edge the contact law is asked for, and where contacts are reported.

    The rows of (D2) on an edge are q numbers ρ. From them follow the tractions at q Gauss points, V ρ, where results
    are given and works integrated.

    Attributes
    ----------
    kind : "gauss" or "bernstein"
        What the rows are.
    points, weights : (q,) arrays
        Gauss points on [0, 1], and weights of sum 1.
    places, shares : (q,) arrays
        Where friction, cohesion and cap are evaluated for the rows, and the weights W of the rows over the edge's
        length, of sum 1. The same as points and weights for Gauss rows; i/(q − 1) and 1/q for Bernstein coefficients.
    to_points : (q, q) array or None
        V: tractions at the Gauss points from rows; None where rows are those tractions.

    """

    kind: RowKind
    points: FloatArray
    weights: FloatArray
    places: FloatArray
    shares: FloatArray
    to_points: FloatArray | None = None

    @classmethod
    def gauss(cls, count: int) -> "ContactRule":
        """Tractions at so many Gauss points an edge."""
        points, weights = gauss_legendre(count)
        return cls("gauss", points, weights, points, weights)

    @property
    def count(self) -> int:
        """Rows an edge, and Gauss points an edge: q."""
        return len(self.points)

    def at_points(self, rows: FloatArray) -> FloatArray:
        """Tractions at the Gauss points (m,) from rows (m,): V ρ, edge by edge."""
        return rows if self.to_points is None else np.asarray(self._grouped(rows) @ self.to_points.T).ravel()

    def at_rows(self, values: FloatArray) -> FloatArray:
        """Rows (m,) from tractions at the Gauss points (m,): V⁻¹ σ, edge by edge."""
        if self.to_points is None:
            return values
        return np.asarray(np.linalg.solve(self.to_points, self._grouped(values).T).T).ravel()

    def multipliers_at_points(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of tractions at the Gauss points (m,) from those of rows (m,): V⁻ᵀ m, of the same work."""
        if self.to_points is None:
            return multipliers
        return np.asarray(np.linalg.solve(self.to_points.T, self._grouped(multipliers).T).T).ravel()

    def multipliers_of_rows(self, multipliers: FloatArray) -> FloatArray:
        """Multipliers of rows (m,) from those of tractions at the Gauss points (m,): Vᵀ m."""
        return (
            multipliers if self.to_points is None else np.asarray(self._grouped(multipliers) @ self.to_points).ravel()
        )

    def _grouped(self, values: FloatArray) -> FloatArray:
        return np.asarray(values).reshape(-1, self.count)


@dataclass(frozen=True, eq=False)
class PrescribedTraction:
    """One component of the traction, prescribed on edges: d·σn = value.

    Attributes
    ----------
    name : str
        What messages call it, such as "Traction.x".
    edges : Edges
        n edges of the boundary.
    direction : (n, 2) array
        Unit vector d on each edge: a Cartesian one, or ± the edge's normal or tangent.
    turns : bool
        Whether d turns along arcs, as normals and tangents do.
    value : function of (x, y)
        The component [dimensionless] at points x, y [length], arrays of one shape; φ is part of it. Where d·n ≠ 0 the
        part of it that Φ makes up is value − φ d·n.
    potential : function of (x, y), or None
        φ [dimensionless] at points [length]; None where there is none.
    constant : float or None
        What Φ makes up of it, if that is known to be one number [dimensionless]; then `value` is that number.

    """

    name: str
    edges: Edges
    direction: FloatArray
    value: Callable[[FloatArray, FloatArray], FloatArray]
    potential: Callable[[FloatArray, FloatArray], FloatArray] | None = None
    turns: bool = False
    constant: float | None = None

    def take(self, index: IntArray | BoolArray) -> "PrescribedTraction":
        """The same on some of the edges."""
        return replace(self, edges=self.edges.take(index), direction=self.direction[index])

    def quadrature(self, vertices: FloatArray, points: int) -> EdgeQuadrature:
        """The part that Φ makes up, at Gauss points of parts of the edges; vertices (v, 2) [length]."""
        if self.constant is not None:
            return constant(self.constant, len(self.edges), points)

        def own(edge: IntArray, t: FloatArray) -> FloatArray:
            x, y = np.moveaxis(points_along(vertices, self.edges.take(edge), t), -1, 0)
            values = np.asarray(self.value(x, y))
            if self.potential is None:
                return values
            return np.asarray(values - self.potential(x, y) * self._outward(edge, t))

        return adapted(own, len(self.edges), points, rounding_along(vertices, self.edges))

    def _outward(self, edge: IntArray, t: FloatArray) -> FloatArray:
        """d·n (k, q) at reference points t (k, q) of edges (k,)."""
        if self.turns or not self.edges.curved:
            return np.asarray((self.direction * self.edges.normal).sum(axis=1)[edge, None])
        chosen = self.edges.take(edge)
        return np.asarray((self.direction[edge, None] * vectors_along(chosen, chosen.normal, t)).sum(axis=2))


@dataclass(frozen=True, eq=False)
class SharedCorners:
    """Vertices where a prescribed shear meets a contact; they matter where shears are degrees of freedom of vertices.

    Attributes
    ----------
    frictionless : int array
        The contact carries no shear there: zero is prescribed too.
    freed : int array
        The shear prescribed there is given up; edges keep their resultants.

    """

    frictionless: IntArray = field(default_factory=lambda: _NO_VERTICES)
    freed: IntArray = field(default_factory=lambda: _NO_VERTICES)


class Energy(Protocol):
    """The complementary energy ½ ∫ cσ:σ of a basis filled with material and body force.

    Unknowns inside cells are condensed cell by cell, and known again by `coefficients`.
    """

    @property
    def load(self) -> FloatArray:
        """−∫ c φI : τ dx as a vector over all degrees of freedom (N,), condensed; zeros without body force."""
        ...

    def reduced(self, elimination: Elimination) -> tuple[sparse.csr_array, FloatArray]:
        """K = Bᵀ 𝒦 B (n, n), exactly symmetric up to rounding, and 𝒦 u₀ (N,), with 𝒦 the matrix of ∫ cσ:τ over u."""
        ...

    def root(self, elimination: Elimination) -> EnergyRoot:
        """r(z) with ½|r|² = ½ ∫ cσ:σ at u = B z + u₀, φ included, evaluated without the cancellation inside K."""
        ...

    def places(self, elimination: Elimination) -> FloatArray | None:
        """Where the unknowns are (n, 2); None where libraries find orders of elimination that are as good without."""
        ...

    def coefficients(self, u: FloatArray) -> FloatArray:
        """All coefficients of Φ from the degrees of freedom u (N,), those inside cells too: what `stress` takes."""
        ...


class Basis(Protocol):
    """A mesh and an element, dimensionless.

    Attributes
    ----------
    mesh : Mesh
        The mesh.
    family : str
        Name of the element, for people: "Bogner-Fox-Schmit", "Hsieh-Clough-Tocher".
    degree : int
        Degree of Φ.
    size : int
        Number of degrees of freedom N.
    vertices : (v, 2) array
        Coordinates of the mesh's vertices, dimensionless.
    smallest : float
        Size of the smallest cell, dimensionless.
    centres : (c,) int array
        Vertices with affine functions from which degrees of freedom count; none where these are those of Φ.
    cuts : (c,) int array
        Vertices along the lines across which Φ may jump, around holes, line by line; none where it cannot.
    normal_degree, shear_degree : int
        Degrees of σ_N and σ_T on an edge (without φ).
    shear_at_vertices : bool
        Whether σ_T is a degree of freedom of vertices and so continuous along a line and shared in corners.
    contact_rule : ContactRule
        The rows of contacts.
    strict_rows : "gauss" or "bernstein"
        The rows with which the contact law can be held on whole edges: Bernstein coefficients, where σ_N and σ_T have
        one degree.
    cell_points, cell_weights : (g, d) and (g,) arrays
        Quadrature on the reference cell, exact for the energy; weights of sum 1, times `cell_sizes`.
    cell_sizes : (cells,) array
        Areas of the cells, dimensionless; without what arcs add to them, see `cell_measures`.

    """

    @property
    def mesh(self) -> Mesh: ...  # noqa: D102  # described above
    @property
    def family(self) -> str: ...  # noqa: D102
    @property
    def degree(self) -> int: ...  # noqa: D102
    @property
    def size(self) -> int: ...  # noqa: D102
    @property
    def vertices(self) -> FloatArray: ...  # noqa: D102
    @property
    def smallest(self) -> float: ...  # noqa: D102
    @property
    def centres(self) -> IntArray: ...  # noqa: D102
    @property
    def cuts(self) -> IntArray: ...  # noqa: D102
    @property
    def normal_degree(self) -> int: ...  # noqa: D102
    @property
    def shear_degree(self) -> int: ...  # noqa: D102
    @property
    def shear_at_vertices(self) -> bool: ...  # noqa: D102
    @property
    def contact_rule(self) -> ContactRule: ...  # noqa: D102
    @property
    def strict_rows(self) -> RowKind: ...  # noqa: D102
    @property
    def cell_points(self) -> FloatArray: ...  # noqa: D102
    @property
    def cell_weights(self) -> FloatArray: ...  # noqa: D102
    @property
    def cell_sizes(self) -> FloatArray: ...  # noqa: D102

    def normal_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_N without φ at the points t (q,) along each of n edges, edge by edge, shape (n q, N)."""
        ...

    def shear_rows(self, edges: Edges, t: FloatArray) -> sparse.csr_array:
        """Rows of σ_T, along the tangent of each edge, at the same points, shape (n q, N)."""
        ...

    def tractions(self, u: FloatArray, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """σ_N without φ and σ_T of u (N,) at the same points, (n q,) each: `normal_rows` @ u, `shear_rows` @ u."""
        ...

    def traction_load(self, normal: FloatArray, shear: FloatArray, edges: Edges, t: FloatArray) -> FloatArray:
        """Σ normal σ_N + shear σ_T over the same points, a vector over all u (N,): `tractions` transposed."""
        ...

    def trace_parameters(self, edges: Sequence[Edges]) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows of contacts from independent parameters of their traces, see `solvers.Traces`: Y (r, N) and E (2m, r).

        Contacts come one after the other, m rows of N in all, then as many of T: [N; T] = E Y with the rows of
        `contact_rule`. E is the identity where the rows are independent of each other.
        """
        ...

    def eliminate(self, tractions: Sequence[PrescribedTraction], corners: SharedCorners) -> Elimination:
        """All degrees of freedom that meet the prescribed tractions, u = B z + u₀, with one affine function fixed.

        Data in the trace space are met exactly; of others each edge keeps the resultant force and moment. Stresses do
        not feel an affine function (the gauge): three unknowns are zero. Closed parts of the boundary whose tractions
        are out of balance raise `UnbalancedLoadError`.
        """
        ...

    def contact_displacements(
        self,
        contacts: Sequence["ContactRows"],
        number: int,
        normal: FloatArray,
        tangential: FloatArray,
        elimination: Elimination,
    ) -> tuple[FloatArray, FloatArray]:
        """λ_N and λ_T (m,) at the Gauss points of one contact, of multipliers m_N, m_T (m,) of tractions there.

        Where rows are independent they are the multipliers over the weights; else what the traces feel of them.
        """
        ...

    def energy(self, materials: IntArray, compliances: FloatArray, potential: FloatArray | None) -> Energy:
        """The energy of the body.

        Parameters
        ----------
        materials : (cells,) int array
            Which of the compliances each cell has.
        compliances : (k, 3, 3) array
            Dimensionless compliances c of (xx, yy, xy).
        potential : (cells, g) array or None
            φ at `cell_points`, dimensionless; None without body force.

        """
        ...

    def points(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Dimensionless coordinates (k, q, 2) of reference points in the cells (k,): t (q, d), or (k, q, d) in each."""
        ...

    def stress(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """(σ_xx, σ_yy, σ_xy) without φ at such points, shape (k, q, 3); `coefficients` are those of `Energy`."""
        ...

    def cell_rule(self, degree: int) -> tuple[FloatArray, FloatArray]:
        """Reference points (g, d) and weights (g,) of sum 1, exact up to a degree on every part where Φ is smooth."""
        ...

    def cell_measures(self, t: FloatArray, weights: FloatArray) -> FloatArray:
        """Weights (cells, q), dimensionless areas, at reference points t (q, d) with weights (q,) of sum 1."""
        ...

    def airy(self, coefficients: FloatArray, cells: IntArray, t: FloatArray) -> FloatArray:
        """Φ at such points, shape (k, q); where it jumps, one of its values."""
        ...

    def jumps(self, u: FloatArray) -> FloatArray:
        """By how much Φ of u (N,) and its slopes jump across each of the lines `cuts`, where it begins, shape (k, 3).

        The jumps of the slopes are the resultant force on the hole, turned.
        """
        ...

    def lattice(self, divisions: int) -> tuple[FloatArray, IntArray]:
        """Points (k, d) that divide the reference cell, `divisions` along each side, and the parts' corners (c, s).

        s is 4 for rectangles, counterclockwise, 3 for triangles. Where stresses may jump inside a cell, the parts on
        both sides have points of their own.
        """
        ...
