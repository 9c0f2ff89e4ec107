"""Rectilinear grids of rectangular cells, their nodes, and their named boundary edges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    finite_number,
    one_of,
    positive_number,
    whole_number,
)
from qvi_contact.errors import InputError
from qvi_contact.mesh.edges import Edges, points_along
from qvi_contact.mesh.grid import checked_lines, graded_lines, on_line
from qvi_contact.mesh.lines import subdivided
from qvi_contact.mesh.mesh import Mesh
from qvi_contact.mesh.named import NamedEdges
from qvi_contact.mesh.words import mesh_line
from solvers.basics.pickles import Stated
from solvers.basics.types import load

SIDES: Final = ("bottom", "right", "top", "left")
"""The four directions a boundary edge can face, counterclockwise from −y."""

HORIZONTAL: Final = 0
VERTICAL: Final = 1
DIRECTIONS: Final = ("horizontal", "vertical")
"""Directions of joints, by axis."""


_FINEST: Final = 1e-9  # smallest cell size, relative to the body, that `refined` makes
_MOST_LINES: Final = 100_000
_MOST_CELLS: Final = 10_000_000
_ROUNDING: Final = 64.0 * float(np.finfo(np.float64).eps)  # of a coordinate that was computed, relative to the largest


@dataclass(frozen=True, eq=False)
class GridEdges(Edges):
    """Edges of a rectilinear mesh, which know where they lie in the grid.

    An edge inside the body is described from the cell below it or to its left.

    Attributes
    ----------
    axis : (n,) int array
        0 for a horizontal edge (along x), 1 for a vertical one (along y).
    sign : (n,) float array
        Outward normal is ``sign`` times e_y (horizontal) or e_x (vertical); +1 inside the body.
    column, row : (n,) int arrays
        The first cell of the edge.

    """

    axis: IntArray
    sign: FloatArray
    column: IntArray
    row: IntArray


def grid_edges(edges: Edges) -> GridEdges:
    """Edges of a rectilinear mesh, as what they are."""
    assert isinstance(edges, GridEdges)
    return edges


@dataclass(frozen=True)
class EdgeRange:
    """What a named edge set consists of.

    Attributes
    ----------
    side : str
        The way its edges face, one of `SIDES`; for a joint "horizontal" or "vertical".
    start, stop : float or None
        Range along the edges [length]; None for the whole length.
    at : float or None
        The line (y of horizontal, x of vertical edges) they lie on; None for all lines.

    """

    side: str
    start: float | None = None
    stop: float | None = None
    at: float | None = None

    @property
    def is_joint(self) -> bool:
        """Whether these are edges inside the body."""
        return self.side in DIRECTIONS


@dataclass(frozen=True, eq=False, repr=False)
class RectilinearMesh(Stated, NamedEdges[GridEdges]):
    """A rectilinear grid, possibly with cells left out.

    Nodes are numbered along x first: node (i, j) at (x[i], y[j]) has number i + j (nx + 1).

    Parameters
    ----------
    x, y : (nx + 1,), (ny + 1,) arrays
        Grid lines [length], strictly increasing, with any spacing.
    active : (ny, nx) bool array, optional
        Cells that belong to the body, ``active[row, column]``; all of them by default.

    Raises
    ------
    InputError
        If lines do not increase, the mask has another shape or is empty, or the body is not one piece whose cells
        hang together by whole edges.

    Notes
    -----
    Edge sets have names. "bottom", "right", "top" and "left" are all boundary edges facing that way; `with_edges`
    names parts of them, `with_joint` names edges inside the body.

    """

    x: FloatArray
    y: FloatArray
    active: BoolArray = None  # type: ignore[assignment]  # becomes a full mask
    _named: Mapping[str, EdgeRange] = field(default_factory=lambda: MappingProxyType({}), repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "x", checked_lines("RectilinearMesh.x", self.x))
        object.__setattr__(self, "y", checked_lines("RectilinearMesh.y", self.y))
        object.__setattr__(self, "active", _checked_mask(self.active, self.shape))

    def __repr__(self) -> str:
        left_out = self.active.size - self.cell_count
        cells = f"{self.shape[1]} × {self.shape[0]} cells" + (f" less {left_out}" if left_out else "")
        return mesh_line(self, cells)

    def _repr_html_(self) -> str:
        """The mesh drawn, for notebooks."""
        return str(load("qvi_contact.files.notebook").mesh_html(self))

    @classmethod
    def rectangle(
        cls,
        cells: tuple[int, int],
        width: float = 1.0,
        height: float = 1.0,
        *,
        origin: tuple[float, float] = (0.0, 0.0),
        grading: float | tuple[float, float] = 1.0,
    ) -> RectilinearMesh:
        """A rectangle of cells[0] × cells[1] cells, graded towards its right and top sides.

        `grading` is the ratio of each cell to the one before it (see `graded_lines`), one number for both directions
        or a pair (x, y).
        """
        width, height = positive_number("width", width), positive_number("height", height)
        pair = grading if isinstance(grading, (tuple, list)) else (grading, grading)
        for name, value in (("cells", cells), ("origin", origin), ("grading", pair)):
            if not isinstance(value, (tuple, list)) or len(value) != 2:
                raise InputError(name, value, "give a pair, for x and y")
        across, up = (whole_number("cells", number) for number in cells)
        if across * up > _MOST_CELLS:
            raise InputError("cells", tuple(cells), f"give at most {_MOST_CELLS:,} cells in all")
        grading_x, grading_y = pair
        origin = finite_number("origin", origin[0]), finite_number("origin", origin[1])
        return cls(
            graded_lines(origin[0], origin[0] + width, cells[0], grading_x),
            graded_lines(origin[1], origin[1] + height, cells[1], grading_y),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Cells per column and per row: (ny, nx)."""
        return len(self.y) - 1, len(self.x) - 1

    @property
    def node_count(self) -> int:
        """Number of grid nodes, those of left-out cells included."""
        return len(self.x) * len(self.y)

    @property
    def length(self) -> float:
        """Characteristic length: the longer side of the bounding box [length]."""
        return float(max(self.x[-1] - self.x[0], self.y[-1] - self.y[0]))

    @property
    def origin(self) -> FloatArray:
        """The lower left corner of the bounding box, shape (2,) [length]."""
        return np.array([self.x[0], self.y[0]])

    @cached_property
    def boundary(self) -> GridEdges:
        """All boundary edges: side by side in the order of `SIDES`, along growing x or y within a line."""
        return _joined([_edges_facing(self, side) for side in SIDES])

    @cached_property
    def boundary_midpoints(self) -> FloatArray:
        """Midpoints of the boundary edges, shape (number of edges, 2) [length]."""
        ends = self.coordinates
        return (ends[self.boundary.first] + ends[self.boundary.second]) / 2.0

    @cached_property
    def coordinates(self) -> FloatArray:
        """Coordinates of all nodes, shape (node_count, 2) [length]."""
        grid_x, grid_y = np.meshgrid(self.x, self.y)
        return np.column_stack([grid_x.ravel(), grid_y.ravel()])

    @property
    def vertices(self) -> FloatArray:
        """The same as `coordinates`."""
        return self.coordinates

    @cached_property
    def body_vertices(self) -> IntArray:
        """Numbers of the nodes of active cells, in ascending order."""
        return np.flatnonzero(self.active_nodes)

    @cached_property
    def cells(self) -> IntArray:
        """Nodes of each active cell, counterclockwise from the lower left one, shape (cells, 4)."""
        column, row = self.cell_places
        stride = len(self.x)
        return np.asarray((column + row * stride)[:, None] + np.array([0, 1, stride + 1, stride]))

    @property
    def cell_range(self) -> tuple[float, float]:
        """The least and the largest distance of grid lines [length]."""
        steps = np.diff(self.x), np.diff(self.y)
        return float(min(part.min() for part in steps)), float(max(part.max() for part in steps))

    @cached_property
    def elongation(self) -> float:
        """The largest ratio of the sides of an active cell, at least 1."""
        width, height = np.diff(self.x), np.diff(self.y)[:, None]
        return float(np.maximum(width / height, height / width)[self.active].max())

    @cached_property
    def cell_count(self) -> int:
        """Number of active cells."""
        return int(self.active.sum())

    @cached_property
    def cell_places(self) -> tuple[IntArray, IntArray]:
        """Column and row of each active cell; cells are counted row by row from the bottom left."""
        row, column = np.nonzero(self.active)
        return column, row

    @cached_property
    def cell_numbers(self) -> IntArray:
        """Number of each cell, shape (ny, nx); −1 where it is left out."""
        number = np.full(self.shape, -1)
        number[self.active] = np.arange(self.cell_count)
        return number

    @cached_property
    def active_nodes(self) -> BoolArray:
        """Nodes that belong to at least one cell of the body, shape (ny + 1, nx + 1)."""
        padded = np.pad(self.active, 1)
        return padded[1:, 1:] | padded[1:, :-1] | padded[:-1, 1:] | padded[:-1, :-1]

    @cached_property
    def hole_edges(self) -> BoolArray:
        """Which boundary edges bound a hole rather than the outside, shape (edges,)."""
        boundary = self.boundary
        if self.active.all():
            return np.zeros(len(boundary), dtype=bool)
        label, _ = _pieces(np.pad(~self.active, 1, constant_values=True))
        step = boundary.sign.astype(np.int64)
        row = boundary.row + 1 + np.where(boundary.axis == HORIZONTAL, step, 0)
        column = boundary.column + 1 + np.where(boundary.axis == VERTICAL, step, 0)
        return np.asarray(label[row, column] != label[0, 0])

    @cached_property
    def interior(self) -> GridEdges:
        """All edges between two cells of the body: horizontal ones row by row, then vertical ones column by column."""
        row, column = np.nonzero(self.active[:-1] & self.active[1:])
        horizontal = _grid_edges(self, HORIZONTAL, 1.0, column, row)
        column, row = np.nonzero((self.active[:, :-1] & self.active[:, 1:]).T)
        return _joined([horizontal, _grid_edges(self, VERTICAL, 1.0, column, row)])

    @property
    def edge_names(self) -> tuple[str, ...]:
        """Names of boundary edge sets, those that `edge_set` knows."""
        return (*SIDES, *(name for name, chosen in self._named.items() if not chosen.is_joint))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of joints."""
        return tuple(name for name, chosen in self._named.items() if chosen.is_joint)

    @property
    def named(self) -> Mapping[str, EdgeRange]:
        """Edge sets and joints made by `with_edges` and `with_joint`, by name."""
        return self._named

    @cached_property
    def _sets(self) -> Mapping[str, IntArray]:
        """Indices of every named edge set."""
        sides = {side: EdgeRange(side) for side in SIDES}
        return {name: self._edges_in(chosen) for name, chosen in {**sides, **self._named}.items()}

    def _edges_in(self, chosen: EdgeRange) -> IntArray:
        """Indices into `boundary`, for a joint into `interior`, of the edges in the range."""
        if chosen.is_joint:
            edges, facing = self.interior, self.interior.axis == DIRECTIONS.index(chosen.side)
            axis = DIRECTIONS.index(chosen.side)
        else:
            axis, sign = _facing(chosen.side)
            edges = self.boundary
            facing = (edges.axis == axis) & (edges.sign == sign)
        found = np.flatnonzero(facing)
        lines, across = (self.x, self.y) if axis == HORIZONTAL else (self.y, self.x)
        middle = (self.coordinates[edges.first[found]] + self.coordinates[edges.second[found]]) / 2.0
        keep = np.ones(len(found), dtype=bool)
        if chosen.start is not None:
            keep &= middle[:, axis] > on_line("start", chosen.start, lines)
        if chosen.stop is not None:
            keep &= middle[:, axis] < on_line("stop", chosen.stop, lines)
        if chosen.at is not None:
            keep &= middle[:, 1 - axis] == on_line("at", chosen.at, across)
        return found[keep]

    @property
    def region_names(self) -> tuple[str, ...]:
        """None: regions of a grid are given by coordinates."""
        return ()

    def region(self, name: str) -> IntArray:
        """Regions of a rectilinear mesh have no names: `InputError` says to give ranges."""
        raise InputError("Region.name", name, "regions of a rectilinear mesh have no names: give ranges x and y")

    def points_along(self, edges: Edges, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Coordinates x, y [length] at reference points t, 0 to 1, (q,) or (n, q), of n edges; shape (n, q) each."""
        points = points_along(self.coordinates, edges, t)
        return points[..., 0], points[..., 1]

    def arranged(self, values: FloatArray) -> FloatArray:
        """Values of the active cells (cells,) in the grid (ny, nx), 0 elsewhere."""
        found = np.zeros(self.shape)
        found[self.active] = values
        return found

    def edge_lengths(self, edges: Edges) -> FloatArray:
        """Lengths of edges [length], shape (edges,)."""
        return edges.length

    def same_as(self, other: Mesh) -> bool:
        """Whether the other mesh has the same grid lines and cells, whatever its edge sets are called."""
        if not isinstance(other, RectilinearMesh):
            return False
        pairs = ((self.x, other.x), (self.y, other.y), (self.active, other.active))
        return all(a is b or np.array_equal(a, b) for a, b in pairs)

    def around(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Points (k, 2) and the cells that hold them, as pairs; see `Mesh.around`."""
        x, y = points.T
        columns, rows = _adjacent(self.x, x), _adjacent(self.y, y)
        cells = np.concatenate([self.cell_numbers[row, column] for column in columns for row in rows])
        inside = np.tile(_within(self.x, x) & _within(self.y, y), 4) & (cells >= 0)
        return np.tile(np.arange(len(points)), 4)[inside], cells[inside]

    @property
    def sides(self) -> FloatArray:
        """Zeros (cells, 4, 1): all sides are straight."""
        return np.zeros((*self.cells.shape, 1))

    def placed(self, cells: IntArray, t: FloatArray) -> FloatArray:  # noqa: ARG002  # all sides are straight
        """The reference coordinates as they are."""
        return t

    def reference(self, cells: IntArray, points: FloatArray) -> FloatArray:
        """Reference coordinates (t_x, t_y), 0 to 1, of points (l, 2) [length] in cells (l,), shape (l, 2)."""
        column, row = (place[cells] for place in self.cell_places)
        in_x = (points[:, 0] - self.x[column]) / (self.x[column + 1] - self.x[column])
        in_y = (points[:, 1] - self.y[row]) / (self.y[row + 1] - self.y[row])
        return np.column_stack([in_x, in_y])

    def with_edges(
        self, name: str, side: str, start: float | None = None, stop: float | None = None, at: float | None = None
    ) -> RectilinearMesh:
        """The same mesh with one more named edge set.

        Parameters
        ----------
        name : str
            The new name.
        side : str
            The way the edges face: "bottom", "right", "top" or "left".
        start, stop : float, optional
            Range along the side [length]; both must lie on grid lines. The whole side by default.
        at : float, optional
            Only edges on this line (y of a horizontal, x of a vertical edge), for bodies with several sides that face
            the same way.

        """
        return self._with(name, EdgeRange(one_of("side", side, SIDES), start, stop, at))

    def with_joint(
        self, name: str, direction: str, at: float, start: float | None = None, stop: float | None = None
    ) -> RectilinearMesh:
        """The same mesh with a joint: edges inside the body along which a `Contact` may hold.

        Parameters
        ----------
        name : str
            The new name.
        direction : str
            "horizontal" or "vertical".
        at : float
            The grid line: y of a horizontal, x of a vertical joint [length].
        start, stop : float, optional
            Range along the line [length]; both must lie on grid lines. Across the whole body by default.

        """
        return self._with(name, EdgeRange(one_of("direction", direction, DIRECTIONS), start, stop, at))

    def _with(self, name: str, chosen: EdgeRange) -> RectilinearMesh:
        if not isinstance(name, str) or not name:
            raise InputError("name", name, "give a non-empty string")
        if name in (*self.edge_names, *self.joint_names):
            raise InputError("name", name, "this edge set exists already: choose another name")
        if not len(self._edges_in(chosen)):
            where = "interior" if chosen.is_joint else "boundary"
            given = (chosen.side, chosen.start, chosen.stop, chosen.at)
            raise InputError(name, given, f"no {where} edge lies there: check side and range")
        return replace(self, _named=MappingProxyType({**self._named, name: chosen}))

    def refined(
        self, largest: float, towards: Sequence[str] = (), smallest: float | None = None, ratio: float = 0.5
    ) -> RectilinearMesh:
        """The same body and edge sets on a finer grid that keeps all lines, graded towards where stresses are large.

        Cells are about `largest` wide, and shrink geometrically to `smallest` towards every re-entrant corner of the
        body and both ends of every edge set or joint in `towards`: at a distance d from the nearest such coordinate
        the size is min(largest, smallest + ln(1/ratio) d), in x and in y separately.

        Parameters
        ----------
        largest : float
            Cell size far from corners and ends [length].
        towards : sequence of str
            Edge sets and joints whose ends matter, such as contacts.
        smallest : float, optional
            Cell size at corners and ends [length]; `largest`, which is a uniform grid, by default.
        ratio : float
            Size of a cell to that of its larger neighbour, 0.01 to 0.99.

        """
        largest = positive_number("largest", largest)
        smallest = largest if smallest is None else positive_number("smallest", smallest)
        if smallest > largest:
            raise InputError("smallest", smallest, f"give at most largest = {largest:g}")
        if smallest < _FINEST * self.length:
            raise InputError("smallest", smallest, f"give at least {_FINEST:g} of the body, {_FINEST * self.length:g}")
        if not 0.01 <= positive_number("ratio", ratio) <= 0.99:
            raise InputError("ratio", ratio, "give a number between 0.01 and 0.99")
        if self.length / largest > _MOST_LINES:
            raise InputError("largest", largest, f"asks for more than {_MOST_LINES} lines: give a larger size")
        if isinstance(towards, str) or not isinstance(towards, Sequence):
            raise InputError("towards", towards, "give a list of names of edge sets or joints")
        critical = self._critical_nodes(towards)
        x, y = (
            subdivided(lines, np.unique(self.coordinates[critical, axis]), largest, smallest, -float(np.log(ratio)))
            for axis, lines in ((0, self.x), (1, self.y))
        )
        return self.on_lines(x, y)

    def on_lines(self, x: ArrayLike, y: ArrayLike) -> RectilinearMesh:
        """The same body and edge sets on other grid lines.

        Parameters
        ----------
        x, y : array_like
            Grid lines [length], finer or coarser than the present ones. They must hold every line on which the outline
            of the body or the end of an edge set lies.

        Raises
        ------
        InputError
            If they do not.

        """
        found = []
        for name, old, given in (("x", self.x, x), ("y", self.y, y)):
            new = checked_lines(f"on_lines: {name}", given)
            if new[0] != old[0] or new[-1] != old[-1]:
                raise InputError(f"on_lines: {name}", (new[0], new[-1]), f"must reach from {old[0]:g} to {old[-1]:g}")
            found.append(new)
        columns, rows = _holding(self.x, found[0]), _holding(self.y, found[1])
        moved = replace(self, x=found[0], y=found[1], active=self.active[np.ix_(rows, columns)])
        back = np.ix_(_holding(moved.y, self.y), _holding(moved.x, self.x))
        if not np.array_equal(moved.active[back], self.active):
            raise InputError("on_lines", moved.shape, "the outline of the body must lie on grid lines")
        _ = moved._sets  # refuses edge sets that end off the lines
        return moved

    def _critical_nodes(self, towards: Sequence[str]) -> IntArray:
        """Nodes in re-entrant corners, and at the ends of the named edge sets (nodes of one of their edges only)."""
        padded = np.pad(self.active, 1).astype(np.int64)
        around = padded[1:, 1:] + padded[1:, :-1] + padded[:-1, 1:] + padded[:-1, :-1]
        nodes = [np.flatnonzero(around.ravel() == 3)]
        for name in towards:
            edges = self.edges(name)
            node, count = np.unique(np.concatenate([edges.first, edges.second]), return_counts=True)
            nodes.append(node[count == 1])
        return np.unique(np.concatenate(nodes))


def _joined(parts: Sequence[GridEdges]) -> GridEdges:
    return GridEdges(*(np.concatenate([getattr(part, each.name) for part in parts]) for each in fields(GridEdges)))


def _grid_edges(mesh: RectilinearMesh, axis: int, sign: float, column: IntArray, row: IntArray) -> GridEdges:
    """The upper (right) edges of cells, sign +1, or the lower (left) ones, −1."""
    count, step = len(column), int(sign)
    far_x, far_y = (0, 1) if axis == HORIZONTAL else (1, 0)
    stride = len(mesh.x)
    first = column + row * stride + (far_x + far_y * stride if sign > 0 else 0)
    second = first + (1 if axis == HORIZONTAL else stride)
    numbers = np.pad(mesh.cell_numbers, 1, constant_values=-1)
    beyond = numbers[row + 1 + step * far_y, column + 1 + step * far_x]
    cells = np.column_stack([mesh.cell_numbers[row, column], beyond])
    normal, tangent = np.zeros((count, 2)), np.zeros((count, 2))
    normal[:, 1 - axis], tangent[:, axis] = sign, 1.0
    length = (mesh.coordinates[second] - mesh.coordinates[first])[:, axis]
    place = np.full(count, axis), np.full(count, sign), column, row
    return GridEdges(first, second, cells, normal, tangent, length, np.zeros((count, 1)), *place)


def _slack(lines: FloatArray) -> float:
    """What the rounding of coordinates makes; cells are much longer than that, see `checked_lines`."""
    return _ROUNDING * float(np.abs(lines).max())


def _within(lines: FloatArray, values: FloatArray) -> BoolArray:
    """Which values lie between the first and the last line: those of contacts are computed, and may miss by an ulp."""
    slack = _slack(lines)
    return np.asarray((values >= lines[0] - slack) & (values <= lines[-1] + slack))


def _adjacent(lines: FloatArray, values: FloatArray) -> tuple[IntArray, IntArray]:
    """Intervals on either side of each value: the same one twice unless it lies on an interior line.

    A value lies on a line if it does up to the rounding of coordinates, wherever the body stands.
    """
    slack, last = _slack(lines), len(lines) - 2
    before = np.clip(np.searchsorted(lines, values - slack, side="left") - 1, 0, last)
    after = np.clip(np.searchsorted(lines, values + slack, side="right") - 1, 0, last)
    return before, after


def _holding(lines: FloatArray, others: FloatArray) -> IntArray:
    """The interval of `lines` that holds the middle of each interval of `others`."""
    return np.searchsorted(lines, (others[1:] + others[:-1]) / 2.0) - 1


def _pieces(cells: BoolArray) -> tuple[IntArray, int]:
    """The number of the piece that each of these cells belongs to, 0 of the others, and how many pieces there are."""
    from scipy import ndimage  # most meshes are whole rectangles, and do without it

    number, count = ndimage.label(cells)
    return np.asarray(number, dtype=np.int64), count


def _checked_mask(mask: ArrayLike | None, shape: tuple[int, int]) -> BoolArray:
    remedy = f"give a boolean array of shape (ny, nx) = {shape}"
    try:
        active = np.ones(shape, dtype=bool) if mask is None else np.array(mask)
    except ValueError as error:  # rows of different lengths
        raise InputError("RectilinearMesh.active", mask, remedy) from error
    if active.dtype != bool or active.shape != shape:
        raise InputError("RectilinearMesh.active", mask, remedy)
    if not active.any():
        raise InputError("RectilinearMesh.active", mask, "at least one cell must belong to the body")
    if not active.all() and _pieces(active)[1] != 1:
        raise InputError("RectilinearMesh.active", mask, "the body must be one piece joined by whole edges")
    corners = active[1:, 1:] & active[:-1, :-1] & ~active[1:, :-1] & ~active[:-1, 1:]
    corners |= ~active[1:, 1:] & ~active[:-1, :-1] & active[1:, :-1] & active[:-1, 1:]
    if corners.any():
        row, column = np.argwhere(corners)[0]
        remedy = f"two cells meet only in the corner at grid lines x[{column + 1}], y[{row + 1}]: fill or cut there"
        raise InputError("RectilinearMesh.active", mask, remedy)
    active.flags.writeable = False
    return active


def _facing(side: str) -> tuple[int, float]:
    """Axis of the edges that face `side`, and the sign of their outward normal."""
    return {
        "bottom": (HORIZONTAL, -1.0),
        "right": (VERTICAL, 1.0),
        "top": (HORIZONTAL, 1.0),
        "left": (VERTICAL, -1.0),
    }[side]


def _edges_facing(mesh: RectilinearMesh, side: str) -> GridEdges:
    axis, sign = _facing(side)
    padded = np.pad(mesh.active, 1)
    neighbour = {
        "bottom": padded[:-2, 1:-1],
        "top": padded[2:, 1:-1],
        "left": padded[1:-1, :-2],
        "right": padded[1:-1, 2:],
    }[side]
    exposed = mesh.active & ~neighbour
    if axis == HORIZONTAL:
        row, column = np.nonzero(exposed)
    else:
        column, row = np.nonzero(exposed.T)
    return _grid_edges(mesh, axis, sign, column, row)
