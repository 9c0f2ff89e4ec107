"""Meshes of triangles with named parts of the boundary, joints and regions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import BoolArray, FloatArray, IntArray, instance_of, mapping, positive_number, real_array
from qvi_contact.basics.schema import WithFields
from qvi_contact.errors import InputError
from qvi_contact.mesh import cutting
from qvi_contact.mesh.curves import Curve, CurveFunction, MeshParts, circle, fitted, refuse_bad_arcs
from qvi_contact.mesh.edges import Edges, beyond_chords, chains, cross, edges_of, led_around, points_along, reference_of
from qvi_contact.mesh.files import read_mesh
from qvi_contact.mesh.grid import grid_parts, rectangle_lines
from qvi_contact.mesh.outline import Line, Point, meshed, polygons
from qvi_contact.mesh.selection import (
    Range,
    Where,
    between,
    checked_region,
    checked_set,
    edges_on_segment,
    new_name,
    selected,
    triangles_in_box,
)
from solvers.basics.types import Kept, PicklesFields, load, read_only
from solvers.errors import counted, known_name

Place: TypeAlias = tuple[Point, Point] | Callable[[FloatArray, FloatArray], ArrayLike]
"""A segment between two points ((x, y), (x, y)), or a function of the coordinates (x, y) of midpoints of edges."""

_EDGE_SETS_FORMAT: Final = "names to edges by their vertices, arrays (k, 2)"  # in messages
_NAMES_IN_REPR: Final = 8  # of one kind
_MAX_DEPTH: Final = 100  # steps of `graded`
_VERTEX_TOLERANCE: Final = 1e-9  # distance from a vertex, relative to the body's larger extent, that counts as rounding
_BORDER_TOLERANCE: Final = 1e-9  # a point with barycentric coordinates of at least −1e-9 is in the triangle
_COORDINATE_ROUNDING: Final = 4.0 * float(np.finfo(np.float64).eps)  # of a point and a vertex, relative
_POINTS_AT_A_TIME: Final = 512  # points located together, neighbours along x


@dataclass(frozen=True, eq=False, repr=False)
class TriangleMesh(WithFields, MeshParts, PicklesFields):
    """A body divided into triangles.

    `InputError` if vertices and cells are not a mesh of one piece: triangles without area, vertices inside edges, edges
    with more than two triangles, triangles that overlap, sides that cross, several pieces, pieces that meet in a vertex
    only, vertices without a triangle or in the same place. Also if a name is empty or used twice, or a set does not fit
    the mesh.
    """

    def __post_init__(self) -> None:
        vertices, cells = cutting.checked_triangles(self.vertices, self.cells)
        vars(self).update(vertices=vertices, cells=cells)
        if not isinstance(self.arcs, Sequence) or not all(isinstance(arc, Curve) for arc in self.arcs):
            raise InputError("TriangleMesh.arcs", self.arcs, "give a list of Curves")
        arcs = tuple(a.checked(f"TriangleMesh.arcs[{k}]", self.topology) for k, a in enumerate(self.arcs))
        vars(self).update(arcs=arcs)
        cutting.refuse_flaws(self)
        edge_sets = mapping("TriangleMesh.edge_sets", self.edge_sets, _EDGE_SETS_FORMAT)
        numbers = {name: checked_set(name, given, self.topology, self.vertices) for name, given in edge_sets.items()}
        pairs = {name: self.topology.ends[number] for name, number in numbers.items()}
        read_only(*pairs.values())
        named = mapping("TriangleMesh.regions", self.regions, "names to numbers of triangles")
        regions = {name: checked_region(name, given, len(self.cells)) for name, given in named.items()}
        vars(self).update(edge_sets=MappingProxyType(pairs), _numbers=numbers, regions=MappingProxyType(regions))
        if arcs:
            refuse_bad_arcs(self)
        cutting.refuse_overlap(self)

    def __repr__(self) -> str:
        width, height = np.ptp(self.vertices, axis=0).tolist()
        parts = ""
        for kind, names in (("edges", self.edge_names), ("joints", self.joint_names), ("regions", self.region_names)):
            if names:
                more = f" and {len(names) - _NAMES_IN_REPR} more" if len(names) > _NAMES_IN_REPR else ""
                parts += f"; {kind} {', '.join(names[:_NAMES_IN_REPR])}{more}"
        cells = f"{counted(len(self.cells), 'triangle')} with {len(self.vertices)} vertices"
        return f"<{type(self).__name__}: {cells}, body of {width:.6g} × {height:.6g}{parts}>"

    def _repr_png_(self) -> bytes | None:
        """A picture of the mesh for notebooks; None without matplotlib."""
        picture: bytes | None = load("qvi_contact.plots.figures").notebook_png(self)
        return picture

    @classmethod
    def rectangle(
        cls,
        cells: tuple[int, int],
        width: float = 1.0,
        height: float = 1.0,
        *,
        origin: tuple[float, float] = (0.0, 0.0),
        grading: float | tuple[float, float] = 1.0,
    ) -> TriangleMesh:
        """A rectangle of cells[0] × cells[1] rectangular cells, each cut into two triangles, see `grid`.

        The sides are called "bottom", "right", "top" and "left"; the origin is the lower left corner [length]. The
        grading is the ratio of each cell's size to that of the cell before it (see `graded_lines`), one number for both
        directions or a pair. With a ratio below 1 cells shrink towards the right and top sides.
        """
        return cls.grid(*rectangle_lines(cells, width, height, origin, grading))

    @classmethod
    def grid(
        cls,
        x: ArrayLike,
        y: ArrayLike,
        active: ArrayLike | None = None,
        *,
        edges: Mapping[str, Place] | None = None,
        joints: Mapping[str, Place] | None = None,
        regions: Mapping[str, tuple[Range, Range]] | None = None,
    ) -> TriangleMesh:
        """Rectangular cells between lines, each cut into two triangles.

        The grid lines x (nx + 1,) and y (ny + 1,) [length] increase strictly, with any spacing; see `graded_lines`. The
        body consists of the cells where ``active[row, column]``, (ny, nx), is true, by default of all cells. All
        boundary edges that face down, right, up and left are called "bottom", "right", "top" and "left".

        `edges` names parts of the boundary, `joints` lines inside the body along which a `Contact` may hold. Each is a
        pair of grid nodes ((x, y), (x, y)) between which the edges lie, or a function of (x, y) for midpoints of edges,
        as in `with_edges`. A region is the cells between two lines (x₁, x₂) and two lines (y₁, y₂); None is all.

        Diagonals run away from the middle of the grid: from lower left to upper right in the lower left and upper right
        quarters, from upper left to lower right in the others. So the triangles of a symmetric body are symmetric if
        the number of cells across is even, and a grid with twice the cells has triangles inside these. A middle row
        counts as upper, a middle column as right, which keeps the symmetry about the other axis. In a corner of the
        body the diagonal always runs into the corner. The triangles 2k and 2k + 1 lie in the cell k of the body,
        counted row by row. Cells more than 500 times as long as wide are first cut along their length, by lines through
        the grid.
        """
        mesh = cls(*grid_parts(x, y, active).given)
        wanted = "names to segments, or to functions of (x, y)"
        for kind, places, is_joint in (("edges", edges, False), ("joints", joints, True)):
            for name, place in mapping(kind, places, wanted, optional=True).items():
                chosen: Where = place
                if not callable(place):
                    remedy = "give a pair of points ((x, y), (x, y)), or a function of (x, y)"
                    ends = real_array(name, place, remedy)
                    if ends.shape != (2, 2) or not np.isfinite(ends).all():
                        raise InputError(name, place, remedy)
                    chosen = edges_on_segment(mesh.vertices, mesh.topology, *ends.tolist(), inside=is_joint)
                mesh = mesh._with_set(name, chosen, is_joint)
        for name, ranges in mapping("regions", regions, "names to pairs of ranges", optional=True).items():
            if not isinstance(ranges, (tuple, list)) or len(ranges) != 2:
                raise InputError(f"regions[{name!r}]", ranges, "give a pair of ranges ((x, x), (y, y)), None for all")
            mesh = mesh.with_region(name, triangles_in_box(mesh.vertices, mesh.cells, ranges[0], ranges[1]))
        return mesh

    @classmethod
    def joined(cls, name: str, meshes: Sequence[TriangleMesh]) -> TriangleMesh:
        """Bodies that touch along straight lines or arcs as one mesh, with a joint called `name` between them.

        Arcs must be declared in both bodies, see `with_arc`; otherwise their sides are chords and the bodies overlap.
        The vertices of the two sides need not match: those of each side are put into the other, and triangles are cut.
        Sets with the same name are united. A named part of the boundary loses its edges in the joint, unless all are.
        """
        if not (isinstance(meshes, Sequence) and meshes and all(isinstance(mesh, TriangleMesh) for mesh in meshes)):
            raise InputError("meshes", meshes, "give a list of TriangleMesh")
        return cls(*cutting.joined(cutting.stacked(meshes), name).given)

    @classmethod
    def load(cls, path: str | Path, join: str | None = None) -> TriangleMesh:
        """Read a mesh file: Gmsh (.msh, format 4.1 or 2.2), Abaqus or CalculiX (.inp), and by meshio MED (.med), VTK.

        Names of curves (physical names, groups; ELSET, SURFACE, NSET) become edge sets, or joints where the curves lie
        inside the body; names of surfaces become regions. Quadrilaterals are cut in two. See `mesh.files`. With `join`,
        bodies in the file that touch along straight lines get a joint of this name; for arcs see `joined`.
        """
        parts = read_mesh(path)
        return cls(*(parts if join is None else cutting.joined(parts, join)).given)

    @classmethod
    def outline(
        cls,
        corners: Line,
        size: float,
        *,
        holes: Sequence[Line] = (),
        joints: Mapping[str, Line | Sequence[Line]] | None = None,
        regions: Mapping[str, Line | Sequence[Line]] | None = None,
        sizes: Mapping[Point, float] | None = None,
    ) -> TriangleMesh:
        """A body given by its outline, divided into triangles by gmsh (extra ``mesh``).

        The corners, `Corner` or (x, y), go around the body in either sense; the last one is joined to the first. A
        `Corner` can name the line that begins there, and make it an arc; triangles there have sides on the arc, as with
        `with_arc`. `size` is the side length of triangles [length]; `sizes` has others at points (x, y) of the body,
        and a `Corner` can have its own.

        Each hole has its corners; `Corner.circle` makes a round one. `joints` are lines inside the body by name, along
        which a `Contact` may hold. A line ends at its last corner. It is closed if its last corner repeats the first,
        or if an arc begins at the last corner, as in `Corner.circle`. `regions` are triangles inside closed lines. A
        joint or region may be a list of lines.
        """
        parts = meshed(polygons(corners, size, holes, joints, regions, sizes))
        try:
            mesh = cls(*cutting.divided_at_arcs(parts).given)
        except InputError as error:
            if not parts.arcs:
                raise
            remedy = "an arc crosses a line, or is too close to it for this size: give the corners there a smaller one"
            raise InputError("size", size, remedy) from error
        for name in joints or ():
            if name not in mesh.joint_names:
                raise InputError(f"joints.{name}", name, "lies on the boundary: name the corner where that line begins")
        return mesh

    @cached_property
    def kept(self) -> Kept:
        """Cache of objects that depend on the mesh only and serve all problems on it; they refer to `bare`."""
        return Kept()

    @property
    def bare(self) -> TriangleMesh:
        """The same mesh with all its cached values except `kept`."""
        _ = self.topology, self.boundary, self.sides, self.curved
        mesh = object.__new__(TriangleMesh)
        vars(mesh).update({name: value for name, value in vars(self).items() if name != "kept"})
        return mesh

    @cached_property
    def sides(self) -> FloatArray:
        """Bends of the sides of all triangles, see `mesh.edges`; side s is opposite to corner s, shape (m, 3, k)."""
        return np.asarray(self.bends[self.topology.of_cells])

    @cached_property
    def curved(self) -> BoolArray:
        """Which triangles have a side that is an arc, shape (m,)."""
        return np.asarray(self.sides.any(axis=(1, 2)))

    @cached_property
    def origin(self) -> FloatArray:
        """The lower left corner of the bounding box, shape (2,) [length]."""
        return np.asarray(self.vertices.min(axis=0))

    @property
    def cell_range(self) -> tuple[float, float]:
        """Lengths of the shortest and of the longest edge [length]."""
        return float(self.finest.min()), float(self.chords.max())

    @property
    def cell_count(self) -> int:
        """Number of triangles."""
        return len(self.cells)

    @cached_property
    def corners(self) -> FloatArray:
        """Coordinates of the corners of all triangles, shape (m, 3, 2) [length]."""
        return np.asarray(self.vertices[self.cells])

    @cached_property
    def midpoints(self) -> FloatArray:
        """Midpoints of all edges, shape (e, 2) [length]."""
        return np.asarray(self.vertices[self.topology.ends].mean(axis=1))

    @cached_property
    def boundary(self) -> Edges:
        """All edges of the boundary, in the order of `topology`."""
        return edges_of(self.vertices, self.cells, self.topology, self.bends, self.topology.outer)

    @cached_property
    def interior(self) -> Edges:
        """All edges between two triangles, in the order of `topology`; the first triangle is the lower or left one."""
        return edges_of(self.vertices, self.cells, self.topology, self.bends, self.topology.inner)

    @cached_property
    def hole_edges(self) -> BoolArray:
        """Which edges of `boundary` bound a hole, shape (edges,): all but those of the line with the largest area."""
        is_hole = np.ones(len(self.boundary), dtype=bool)
        on_lines = [np.searchsorted(self.topology.outer, numbers) for numbers in self.outlines]
        midpoints = points_along(self.vertices, self.boundary, np.array([0.5]))[:, 0] - self.origin
        areas = (midpoints * self.boundary.normal).sum(axis=1) * self.boundary.length  # their sum: 2 × enclosed area
        is_hole[max(on_lines, key=lambda line: abs(areas[line].sum()))] = False
        return is_hole

    @cached_property
    def edge_names(self) -> tuple[str, ...]:
        """Names of parts of the boundary."""
        return tuple(name for name, edges in self._numbers.items() if self.topology.boundary[edges[0]])

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of joints."""
        return tuple(name for name, edges in self._numbers.items() if not self.topology.boundary[edges[0]])

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names of regions."""
        return tuple(self.regions)

    @cached_property
    def _numbers(self) -> Mapping[str, IntArray]:
        """Numbers in `topology` of the edges of every set."""
        return {name: self.topology.number(pairs) for name, pairs in self.edge_sets.items()}

    def edge_set(self, name: str) -> IntArray:
        """Indices into `boundary` of the edges called `name`; `InputError` lists the known names."""
        known = known_name("edges", name, {"edge sets": self.edge_names}, "add it by with_edges() or [[edges]]")
        return self.topology.outer.searchsorted(self.edges(known).number)

    def joint_set(self, name: str) -> IntArray:
        """Indices into `interior` of the edges of the joint `name`; `InputError` lists the known names."""
        known = known_name("joint", name, {"joints": self.joint_names}, "add it by with_joint() or [[joints]]")
        return self.topology.inner.searchsorted(self.edges(known).number)

    def edges(self, name: str) -> Edges:
        """The edges called `name`, on the boundary or in a joint; read only, as all callers share them."""
        if not isinstance(name, str) or name not in self._taken:
            known = {"edge sets": self.edge_names, "joints": self.joint_names}
            remedy = "add it by with_edges() or with_joint(), [[edges]] or [[joints]]"
            numbers = self._numbers[known_name("edges", name, known, remedy)]
            outer = name in self.edge_names
            all_edges, order = (self.boundary, self.topology.outer) if outer else (self.interior, self.topology.inner)
            edges = all_edges.take(order.searchsorted(numbers))
            edges = edges if outer else led_around(edges)
            read_only(*vars(edges).values())
            self._taken.setdefault(name, edges)
        return self._taken[name]

    @cached_property
    def _taken(self) -> dict[str, Edges]:
        """Cache of `edges`: a problem asks for the same edges tens of times."""
        return {}

    def region(self, name: str) -> IntArray:
        """Numbers of the triangles of a region, in ascending order."""
        known = {"regions": self.regions}
        return self.regions[known_name("region", name, known, "add it by with_region() or [[regions]]")]

    def points_along(self, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates x, y [length] at reference points t, 0 to 1, (q,) or (n, q), of n edges; shape (n, q) each."""
        points = points_along(self.vertices, edges, t)
        return points[..., 0], points[..., 1]

    def numbers(self, name: str) -> IntArray:
        """Numbers in `topology` of the edges called `name`, in ascending order."""
        return self._numbers[known_name("name", name, {"edge sets and joints": self.edge_sets})]

    def with_edges(self, name: str, where: Where) -> TriangleMesh:
        """The same mesh with one more named part of the boundary.

        `where` is a function of (x, y) that is true at midpoints of its edges, or an array (k, 2) of their vertices.
        """
        return self._with_set(name, where, inside=False)

    def with_joint(self, name: str, where: Where) -> TriangleMesh:
        """The same mesh with a joint: edges inside the body along which a `Contact` may hold; see `with_edges`."""
        return self._with_set(name, where, inside=True)

    def _with_set(self, name: str, where: Where, inside: bool) -> TriangleMesh:
        new_name(name, self.edge_sets)
        ends, allowed = self.topology.ends, self.topology.boundary != inside
        if callable(where):
            candidates = np.flatnonzero(allowed)
            chosen = candidates[selected(name, where, self.midpoints[candidates])]
        else:
            chosen = checked_set(name, where, self.topology, self.vertices)
        if not len(chosen) or not allowed[chosen].all():
            raise InputError(name, where, f"no {'interior' if inside else 'boundary'} edge lies there: check the set")
        return self._renamed(edge_sets={**self.edge_sets, name: ends[chosen]})

    def _renamed(self, **names: dict[str, IntArray]) -> TriangleMesh:
        """The same mesh with other `edge_sets` or `regions`, which are checked; it shares what depends on no name."""
        mesh, of_names = object.__new__(TriangleMesh), ("edge_names", "joint_names", "kept", "_numbers", "_taken")
        vars(mesh).update({name: value for name, value in vars(self).items() if name not in of_names})
        for kind, sets in names.items():
            read_only(*sets.values())
            vars(mesh)[kind] = MappingProxyType(sets)
        return mesh

    def with_arc(self, name: str, centre: tuple[float, float], radius: float) -> TriangleMesh:
        """The same mesh with the edges called `name` as arcs of a circle [length], on which their vertices lie.

        The arcs then bound the body, or the two sides of a joint, without loss of order: conditions, normals and
        tractions hold on the arcs, and finer meshes get vertices on the circle. `InputError` if a vertex is off the
        circle, or an edge turns by more than 90° or bends too far for its triangle.
        """
        return replace(self, arcs=(*self.arcs, circle(centre, radius, self.pairs(name), self.vertices)))

    def with_curve(self, name: str, curve: CurveFunction, start: float = 0.0, stop: float = 1.0) -> TriangleMesh:
        """The same mesh with the edges called `name` on a smooth curve, on which their vertices lie; see `with_arc`.

        The function gives points (n, 2) [length] of the curve at parameters (n,) from start to stop; the curve is
        closed if both have the same point. On each edge it is replaced by a polynomial to machine precision; finer
        meshes, archives and problem files keep the polynomials and do not call the function again. The curve may have
        corners in vertices, not between them.
        """
        return replace(self, arcs=(*self.arcs, fitted("curve", curve, start, stop, self.pairs(name), self.vertices)))

    def with_region(self, name: str, where: Where) -> TriangleMesh:
        """The same mesh with one more region, given by a function of (x, y) at centres of triangles, or by numbers."""
        new_name(name, self.regions, "region")
        chosen = selected(name, where, self.corners.mean(axis=1)) if callable(where) else where
        return self._renamed(regions={**self.regions, name: checked_region(name, chosen, len(self.cells))})

    def part(self, cells: IntArray, edge_sets: Mapping[str, IntArray] | None = None) -> TriangleMesh:
        """The chosen triangles as a mesh; it keeps names and arcs that have edges or triangles in it.

        A joint becomes a part of the boundary where only the triangles on one side of it are chosen. `edge_sets`, by
        vertices of this mesh, replace its own. `InputError` if the triangles are not a body of one piece.
        """
        chosen = checked_region("cells", cells, len(self.cells))
        kept_sets = self.edge_sets if edge_sets is None else mapping("edge_sets", edge_sets, _EDGE_SETS_FORMAT)
        for name, pairs in kept_sets.items():
            if np.ndim(pairs) != 2 or np.shape(pairs)[1] != 2:
                raise InputError(f"edge_sets[{name!r}]", pairs, f"give a mapping of {_EDGE_SETS_FORMAT}")
        parts = MeshParts(self.vertices, self.cells, kept_sets, self.regions, self.arcs)
        vars(parts).update(topology=self.topology, bends=self.bends)  # known already
        return TriangleMesh(*cutting.part(parts, chosen).given)

    @cached_property
    def outlines(self) -> tuple[IntArray, ...]:
        """The closed lines of the boundary as numbers of edges in `topology`, one array each."""
        outer = self.topology.outer
        return tuple(outer[line] for line in chains(self.topology.ends[outer]))

    @cached_property
    def _boxes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Opposite corners (m, 2) of boxes around triangles with arcs [length]; rounding of `reference` (m,)."""
        # arcs turn by at most 90°, so each of their points is at most √2/2 of the chord away from one of the ends
        arc_chords = np.where(self.bends.any(axis=1), self.chords, 0.0)
        margin = 0.75 * arc_chords[self.topology.of_cells].max(axis=1, keepdims=True)
        a, b, c = self.corners.swapaxes(0, 1)
        least_heights = np.abs(cross(b - a, c - a)) / self.chords[self.topology.of_cells].max(axis=1)
        rounding = _COORDINATE_ROUNDING * np.abs(self.vertices).max() / least_heights
        return self.corners.min(axis=1) - margin, self.corners.max(axis=1) + margin, rounding

    def locate(self, points: ArrayLike) -> IntArray:
        """The triangle that contains each of the points (k, 2) [length], on edges the lowest number; −1 outside."""
        argument, points = points, real_array("points", points)
        if points.size and points.shape[-1:] != (2,):
            raise InputError("points", argument, "give an array (k, 2) of coordinates")
        point, cell = self.around(points.reshape(-1, 2))
        triangle = np.full(points.size // 2, -1)
        triangle[point[::-1]] = cell[::-1]
        return triangle

    def around(self, points: FloatArray, beyond: float = _BORDER_TOLERANCE) -> tuple[IntArray, IntArray]:
        """All pairs (point (l,), triangle (l,)), by number and sorted, of points (k, 2) [length] and their triangles.

        A point on an edge or in a vertex has a pair with every triangle there. A triangle also has pairs with points
        outside it whose `reference` coordinates are at least −`beyond`, or 0 but for the rounding of coordinates.
        """
        low, high, rounding = self._boxes
        limit = np.maximum(beyond, rounding)
        margin = 2.0 * limit[:, None] * (high - low)  # points with coordinates of at least −`limit` are within it
        (left, below), (right, above) = (low - margin).T, (high + margin).T
        finite = np.flatnonzero(np.isfinite(points).all(axis=1))
        order = finite[points[finite, 0].argsort()]
        pairs = [np.empty((2, 0), dtype=np.int64)]
        for group in (order[start : start + _POINTS_AT_A_TIME] for start in range(0, len(order), _POINTS_AT_A_TIME)):
            x, y = points[group := group[points[group, 1].argsort()]].T
            candidates = np.flatnonzero((left <= x.max()) & (right >= x.min()))
            box, position = between(y.searchsorted(below[candidates]), y.searchsorted(above[candidates], "right"))
            in_box = (left[candidates[box]] <= x[position]) & (right[candidates[box]] >= x[position])
            cell, point = candidates[box[in_box]], group[position[in_box]]
            is_held = self.reference(cell, points[point]).min(axis=1) >= -limit[cell]
            pairs.append(np.stack([point[is_held], cell[is_held]]))
        point, cell = np.concatenate(pairs, axis=1)
        order = np.lexsort((cell, point))
        return point[order], cell[order]

    def reference(self, cells: IntArray, points: FloatArray) -> FloatArray:
        """Barycentric coordinates of points (l, …, 2) [length] in the triangles (l,), shape (l, …, 3).

        In triangles with arcs they are the reference coordinates of `mesh.edges`.
        """
        if points.ndim > 2:
            flat = self.reference(np.repeat(cells, points.shape[1]), points.reshape(-1, 2))
            return flat.reshape(*points.shape[:-1], 3)
        a, b, c = self.corners[cells].swapaxes(0, 1)
        u, v, w = b - a, c - a, points - a
        lambda_1, lambda_2 = cross(w, v) / cross(u, v), cross(u, w) / cross(u, v)
        bary = np.column_stack([1.0 - lambda_1 - lambda_2, lambda_1, lambda_2])
        bent = self.curved[cells]
        if bent.any():
            bary[bent] = reference_of(self.corners[cells[bent]], self.sides[cells[bent]], bary[bent])
        return bary

    def placed(self, cells: IntArray, t: FloatArray) -> FloatArray:
        """Barycentric coordinates of reference points t, (q, 3) or (k, q, 3), in the triangles (k,), see `mesh.edges`.

        The result is t itself if no triangle has arcs, otherwise an array (k, q, 3).
        """
        bent = np.flatnonzero(self.curved[cells])
        if not len(bent):
            return t
        bary = np.array(np.broadcast_to(t, (len(cells), *np.shape(t)[-2:])))
        bary[bent] = beyond_chords(self.corners[cells[bent]], self.sides[cells[bent]], bary[bent])[0]
        return bary

    def same_as(self, other: TriangleMesh) -> bool:
        """Whether the other mesh has the same vertices, triangles and arcs; names do not matter."""
        pairs = ((self.vertices, other.vertices), (self.cells, other.cells), (self.bends, other.bends))
        return all(one is two or np.array_equal(one, two) for one, two in pairs)

    def parents(self, coarse: TriangleMesh) -> IntArray:
        """The triangle of a coarser mesh of the same body in which each triangle lies, shape (m,)."""
        instance_of(TriangleMesh, "coarse", coarse)
        return coarse.locate(self.corners.mean(axis=1))

    def refined(self, marked: ArrayLike | None = None) -> TriangleMesh:
        """The same body with marked triangles, numbers (k,) or a mask (m,), halved in size, and neighbours as needed.

        All are marked by default. A marked triangle is cut in four, further if too flat for its arc. Names are kept.
        """
        return TriangleMesh(*cutting.bisected(self, marked).given)

    def fanned(self, vertices: IntArray, angle: float) -> TriangleMesh:
        """The mesh with fans of thin triangles around vertices (k,), for stresses that turn quickly around a point.

        No edge joins two of the vertices; all keep their numbers. Triangles at the vertices get angles of at most
        `angle` [rad]. In each step their length is halved, then each angle that is too large; there is at least one.
        """
        return TriangleMesh(*cutting.fanned(self, vertices, angle).given)

    def graded(self, points: ArrayLike, depth: int | Sequence[int], *, ratio: float | None = None) -> TriangleMesh:
        """The same body with smaller triangles at points (k, 2), in `depth` steps, a number or one for each point.

        It is meant for points where stresses are singular or jump: corners, ends of contacts, of loads, of stick zones.
        A step halves the size of the triangles at a point, and of neighbours as needed. With a ratio below 1 the points
        must be vertices, and a step cuts only the triangles at each point, across, at this fraction of their edges from
        the point. Such layers reach a great depth with few triangles. With a high degree and a ratio of 0.15 to 0.25
        the error falls fastest with the number of unknowns. Names are kept.

        `InputError` if a point is outside the body, or with a ratio no vertex or the end of an arc, or if triangles
        would become too small to tell their vertices apart.
        """
        places = real_array("points", points, "give an array (k, 2) of coordinates")
        if places.ndim != 2 or places.shape[1] != 2 or not np.isfinite(places).all():
            raise InputError("points", points, "give an array (k, 2) of coordinates")
        remedy = f"give a whole number from 0 to {_MAX_DEPTH}, or one for each of the {len(places)} points"
        depths = real_array("depth", depth, remedy)
        valid = np.asarray(depth).dtype.kind in "iu" and bool(((depths >= 0) & (depths <= _MAX_DEPTH)).all())
        if not valid or depths.shape not in ((), (len(places),)):
            raise InputError("depth", depth, remedy)
        steps = np.broadcast_to(depths.astype(np.int64), len(places))
        is_outside = self.locate(places) < 0
        if is_outside.any():
            x, y = places[np.argmax(is_outside)].tolist()
            raise InputError("points", (x, y), "give points of the body")
        mesh, vertices = self, np.empty(0, dtype=np.int64)
        if ratio is not None:
            if positive_number("ratio", ratio) >= 1.0:
                raise InputError("ratio", ratio, "give a number below 1")
            distance = np.hypot(*(places[:, None] - self.vertices).T)  # (n, k)
            vertices = np.asarray(np.argmin(distance, axis=0), dtype=np.int64)
            on_arc = np.isin(vertices, self.topology.ends[self.bends.any(axis=1)])
            is_wrong = on_arc | (distance.min(axis=0) > _VERTEX_TOLERANCE * np.ptp(self.vertices, axis=0).max())
            if is_wrong.any():
                x, y = places[np.argmax(is_wrong)].tolist()
                raise InputError("points", (x, y), "give vertices of the mesh where no arc ends, or leave out `ratio`")
        for level in range(int(steps.max(initial=0))):
            try:
                if ratio is None:
                    mesh = mesh.refined(np.unique(mesh.around(places[steps > level])[1]))
                else:
                    mesh = TriangleMesh(*cutting.layered(mesh, np.unique(vertices[steps > level]), ratio).given)
            except InputError as error:
                remedy = f"give at most {level}: triangles would become too small to tell their vertices apart"
                raise InputError("depth", depth, remedy) from error
        return mesh
