"""What the rest of the product asks of a mesh: `RectilinearMesh` and `TriangleMesh` have it."""

from typing import Protocol

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray
from qvi_contact.mesh.edges import Edges


class Mesh(Protocol):
    """A body divided into cells, with named edges.

    Cells have numbers from 0 to cell_count − 1, vertices those of `vertices`; some of these may belong to no cell of
    the body (`body_vertices` says which do). Lengths are those of the user [length].
    """

    @property
    def vertices(self) -> FloatArray:
        """Coordinates of all vertices, shape (v, 2) [length]."""
        ...

    @property
    def body_vertices(self) -> IntArray:
        """Numbers of the vertices of cells of the body, in ascending order."""
        ...

    @property
    def cells(self) -> IntArray:
        """Vertices of each cell of the body, shape (cells, 3) or (cells, 4)."""
        ...

    @property
    def cell_count(self) -> int:
        """Number of cells of the body."""
        ...

    @property
    def length(self) -> float:
        """Characteristic length: the longer side of the bounding box [length]."""
        ...

    @property
    def cell_range(self) -> tuple[float, float]:
        """Size of the smallest and of the largest cell: shortest and longest edge [length]."""
        ...

    @property
    def origin(self) -> FloatArray:
        """The lower left corner of the bounding box, shape (2,) [length]."""
        ...

    @property
    def boundary(self) -> Edges:
        """All edges of the boundary."""
        ...

    @property
    def interior(self) -> Edges:
        """All edges between two cells of the body."""
        ...

    @property
    def hole_edges(self) -> BoolArray:
        """Which edges of `boundary` bound a hole rather than the outside, shape (edges,)."""
        ...

    @property
    def edge_names(self) -> tuple[str, ...]:
        """Names of parts of the boundary, those that `edge_set` knows."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of joints, those that `joint_set` knows."""
        ...

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names of regions, those that `region` knows."""
        ...

    def edge_set(self, name: str) -> IntArray:
        """Indices into `boundary` of the edges called `name`; `InputError` lists the names there are."""
        ...

    def joint_set(self, name: str) -> IntArray:
        """Indices into `interior` of the joint called `name`; `InputError` lists the names there are."""
        ...

    def edges(self, name: str) -> Edges:
        """The edges called `name`, on the boundary or in a joint."""
        ...

    def region(self, name: str) -> IntArray:
        """Numbers of the cells of the region called `name`; `InputError` lists the names there are."""
        ...

    def points_along(self, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates x, y [length] at reference points t, 0 to 1, (q,) or (n, q), of n edges; shape (n, q) each."""
        ...

    def arranged(self, values: FloatArray) -> FloatArray:
        """Values of the cells (cells,) as the mesh lays them out: itself, or (ny, nx) with 0 outside the body."""
        ...

    def same_as(self, other: "Mesh") -> bool:
        """Whether the other mesh has the same vertices and cells, whatever its edge sets are called."""
        ...

    def around(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Points and the cells that hold them, as pairs of numbers (point (l,), cell (l,)).

        A point (k, 2) [length] inside a cell is in one pair, one on an edge or in a vertex in a pair with every cell
        there (or equally often in several with each), one outside the body in none.
        """
        ...

    def reference(self, cells: IntArray, points: FloatArray) -> FloatArray:
        """Reference coordinates of points (l, 2) [length] in the cells (l,), as `Basis.stress` takes them: (l, d).

        Of a rectangle (t_x, t_y) from 0 to 1, of a triangle the three barycentric coordinates.
        """
        ...

    @property
    def sides(self) -> FloatArray:
        """How the sides of the cells bend, (cells, sides, k): 0 where they are straight; see `Edges.bend`."""
        ...

    def placed(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Reference coordinates t, (q, d) or (k, q, d), in the cells (k,) as those of the cells with straight sides.

        Cells with sides that are arcs reach beyond these, or not so far; see `mesh.curved`.
        """
        ...
