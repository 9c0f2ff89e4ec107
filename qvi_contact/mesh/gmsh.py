"""Triangles of an outline, made by gmsh.

gmsh keeps one state for the whole process. It is started for one mesh and ended behind it, under a lock, without
configuration files, signal handlers, threads of its own, or output; a session of the caller's is left as it was.

Its start puts eleven signals back to what they do in a new program. Python ignores SIGPIPE, so that a pipe or socket
whose reader has gone is an exception; the process would end there without a word. Handlers of SIGTERM and of crashes
would be lost. They are kept.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from threading import Lock
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import Curve, MeshParts, circle
from qvi_contact.mesh.edges import Topology, cross
from qvi_contact.mesh.outline import Polygon, Polygons
from solvers.basics.foreign import foreign_code, handlers_kept
from solvers.basics.types import load

_LOCK: Final = Lock()
_SHARPEST: Final = 0.2  # sine of the angle below which no triangle is made
_OPTIONS: Final = {
    "General.Terminal": 0,
    "General.Verbosity": 0,
    "General.AbortOnError": 2,
    "General.NumThreads": 1,
    "Geometry.Tolerance": 1e-10,
    "Mesh.Algorithm": 6,  # frontal Delaunay
    "Mesh.ElementOrder": 1,
    "Mesh.MeshSizeFromPoints": 1,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 1,
    "Mesh.MeshSizeMin": 0.0,
    "Mesh.MeshSizeFactor": 1.0,
    "Mesh.RandomSeed": 1,
}
_LIBRARIES: Final = "apt-get install libgl1 libglu1-mesa libxcursor1 libxfixes3 libxft2 libxinerama1 libxrender1"


def meshed(shape: Polygons) -> MeshParts:
    """The body as triangles, with edge sets by the names of its lines and regions.

    `InputError` if gmsh or a system library it needs is missing, gmsh cannot divide the body, or an inner line leaves
    it.
    """
    try:
        gmsh = load("gmsh")
    except ImportError as error:
        remedy = "outlines are divided by gmsh: python -m pip install gmsh"
        raise InputError("outline", "gmsh", remedy) from error
    except OSError as error:  # a library of the system is missing
        told = " ".join(str(error).split())
        remedy = f"gmsh needs libraries of the system ({told}): on Debian and Ubuntu {_LIBRARIES}"
        raise InputError("outline", "gmsh", remedy) from error
    with _LOCK, foreign_code(), _session(gmsh):
        try:
            return _Drawing(gmsh, shape).meshed()
        except Exception as error:
            if type(error) is not Exception:  # gmsh raises bare ones with a text
                raise
            told = " ".join(str(error).split()) or "no reason given"
            raise InputError("outline", told, "gmsh cannot divide this body: look for lines that cross") from error


@contextmanager
def _session(gmsh: Any) -> Iterator[None]:
    """A model of its own, in a session of its own if there is none."""
    fresh = not gmsh.isInitialized()
    if fresh:
        with handlers_kept():
            gmsh.initialize(["gmsh", "-v", "0"], readConfigFiles=False, interruptible=False)
    before = None if fresh else gmsh.model.getCurrent()
    kept = {name: gmsh.option.getNumber(name) for name in _OPTIONS}
    try:
        for name, value in _OPTIONS.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("qvi_contact outline")
        yield
    finally:
        gmsh.model.remove()
        for name, value in kept.items():
            gmsh.option.setNumber(name, value)
        if before is not None:
            gmsh.model.setCurrent(before)
        if fresh:
            gmsh.finalize()


class _Drawing:
    """An outline in gmsh.

    gmsh has absolute tolerances, so the body is about one unit long there: a power of two changes no digit.
    """

    def __init__(self, gmsh: Any, shape: Polygons) -> None:
        self._gmsh, self._shape, self._unit = gmsh, shape, 2.0 ** -round(np.log2(shape.length))

    def meshed(self) -> MeshParts:
        """Vertices, triangles, edges by name, triangles by region."""
        gmsh, shape, occ = self._gmsh, self._shape, self._gmsh.model.occ
        drawn = [self._drawn(polygon) for polygon in (shape.outer, *shape.holes)]
        body = (2, occ.addPlaneSurface([occ.addCurveLoop(lines) for lines in drawn]))
        lines = [self._drawn(polygon) for polygon in (*shape.joints.values(), *shape.regions.values())]
        inner = [(1, line) for each in lines for line in each]
        inner += [(0, occ.addPoint(*place, 0.0)) for place in (self._unit * shape.points).tolist()]
        surfaces = [body[1]]
        if inner:  # the surface is cut along lines
            surfaces = [tag for dimension, tag in occ.fragment([body], inner)[1][0] if dimension == 2]
        occ.synchronize()
        self._set_sizes()
        gmsh.model.mesh.generate(2)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
        points = np.asarray(coordinates, dtype=float).reshape(-1, 3)[:, :2] / self._unit
        cells = np.concatenate([self._elements(2, tag) for tag in sorted(surfaces)])
        used = np.flatnonzero(np.isin(tags, cells))
        vertex = np.full(int(tags.max()) + 1, -1)
        vertex[tags[used].astype(np.int64)] = np.arange(len(used))
        vertices, cells = points[used], vertex[cells]
        ends, pairs = dict[int, FloatArray](), dict[int, IntArray]()  # of each curve of gmsh
        for _, tag in gmsh.model.getEntities(1):
            both = [abs(point) for _, point in gmsh.model.getBoundary([(1, tag)])]
            ends[tag] = np.array([gmsh.model.getValue(0, point, [])[:2] for point in both]) / self._unit
            pairs[tag] = vertex[self._elements(1, tag)]
        edge_sets, arcs = self._known(ends, pairs, vertices)
        for name, found in edge_sets.items():
            if (found < 0).any():
                remedy = "this inner line leaves the body: end it on the boundary or inside"
                raise InputError(f"joints.{name}", name, remedy)
        cells = divided_corners(vertices, cells, np.concatenate(list(pairs.values())))
        centres = vertices[cells].mean(axis=1)
        regions = {name: np.flatnonzero(polygon.holds(centres)) for name, polygon in shape.regions.items()}
        for name, chosen in regions.items():
            if not len(chosen):
                raise InputError(f"regions.{name}", name, "no part of the body lies in this region: move it")
        return MeshParts(vertices, cells, edge_sets, regions, arcs)

    def _drawn(self, polygon: Polygon) -> list[int]:
        """The polygon's pieces as lines and arcs."""
        occ = self._gmsh.model.occ
        tags = [occ.addPoint(x, y, 0.0) for x, y in (self._unit * polygon.points).tolist()]
        ends, drawn, middles = zip(tags, [*tags[1:], tags[0]], strict=True), [], []
        for (first, second), (x, y) in zip(ends, (self._unit * polygon.centres).tolist(), strict=False):
            if np.isnan(x):
                drawn.append(occ.addLine(first, second))
            else:
                middles.append(occ.addPoint(x, y, 0.0))
                drawn.append(occ.addCircleArc(first, middles[-1], second))
        occ.remove([(0, tag) for tag in middles])
        return drawn

    def _set_sizes(self) -> None:
        """Sizes at all points, the smallest where several are given at one place."""
        gmsh, shape, unit = self._gmsh, self._shape, self._unit
        places = np.concatenate([*(polygon.points for polygon in shape.every), shape.points])
        sizes = np.concatenate([*(polygon.sizes for polygon in shape.every), shape.sizes])
        gmsh.option.setNumber("Mesh.MeshSizeMax", unit * float(sizes.max()))
        for entity in gmsh.model.getEntities(0):
            at = np.array(gmsh.model.getValue(*entity, [])[:2]) / unit
            here = np.hypot(*(places - at).T) <= shape.rounding
            gmsh.model.mesh.setSize([entity], unit * float(sizes[here].min() if here.any() else shape.largest))

    def _elements(self, dimension: int, tag: int) -> IntArray:
        """Tags of nodes (k, 2) or (k, 3) of the lines or triangles of a curve or surface, kinds 1 and 2 of gmsh."""
        nodes = self._gmsh.model.mesh.getElementsByType(dimension, tag)[1]
        return np.asarray(nodes, dtype=np.int64).reshape(-1, dimension + 1)

    def _known(
        self, ends: Mapping[int, FloatArray], pairs: Mapping[int, IntArray], vertices: FloatArray
    ) -> tuple[dict[str, IntArray], list[Curve]]:
        """Edges by name, and edges on circles: of curves that have both ends on one piece of a line of the outline."""
        shape = self._shape
        named, circles = dict[str, list[IntArray]](), dict[tuple[float, float, float], list[IntArray]]()
        for tag, both in ends.items():
            names, around = set[str](), None
            for polygon in shape.every:
                for k in np.flatnonzero((polygon.distances(both) <= shape.rounding).all(axis=0)).tolist():
                    names.add(polygon.names[k])
                    if around is None and np.isfinite(polygon.centres[k]).all():
                        x, y = polygon.centres[k].tolist()
                        radius = float(np.hypot(*(polygon.pieces[k, 0] - polygon.centres[k])))
                        around = x, y, float(np.round(self._unit * radius, 12)) / self._unit
            for name in names - {""}:
                named.setdefault(name, []).append(pairs[tag])
            if around is not None and (pairs[tag] >= 0).all():
                circles.setdefault(around, []).append(pairs[tag])
        arcs = [
            circle((x, y), radius, np.concatenate(found), vertices, "TriangleMesh.arcs.")
            for (x, y, radius), found in circles.items()
        ]
        order = dict.fromkeys(name for polygon in shape.every for name in polygon.names)
        return {name: np.concatenate(named[name]) for name in order if name in named}, arcs


def divided_corners(vertices: FloatArray, cells: IntArray, fixed: IntArray) -> IntArray:
    """The triangles (m, 3), corners of the body no longer filled by a single one where that can be helped.

    A triangle with two edges on the boundary could follow the tractions on neither of them. The edge opposite the
    corner is turned, unless it is one of the `fixed` ones (k, 2) or that would make a needle.
    """
    cells = np.sort(cells, axis=1)
    topology = Topology.of(cells, len(vertices))
    kept = np.zeros(len(topology.ends), dtype=bool)
    known = topology.number(fixed[(fixed >= 0).all(axis=1)])
    kept[known[known >= 0]] = True
    changed, touched = cells.copy(), np.zeros(len(cells), dtype=bool)
    in_corners = np.flatnonzero(topology.boundary[topology.of_cells].sum(axis=1) == 2)
    for cell in in_corners.tolist():
        edges = topology.of_cells[cell]
        opposite = int(edges[~topology.boundary[edges]][0])
        pair = topology.cells[opposite]
        if kept[opposite] or touched[pair].any():
            continue
        b, c = topology.ends[opposite].tolist()
        other = int(pair[pair != cell][0])
        a, d = (int(np.setdiff1d(cells[each], (b, c))[0]) for each in (cell, other))
        turned = np.array([[a, b, d], [a, d, c]])
        sides = np.roll(vertices[turned], -1, axis=1) - vertices[turned]
        before = -np.roll(sides, 1, axis=1)
        lengths = np.hypot(*np.moveaxis(sides, 2, 0)) * np.hypot(*np.moveaxis(before, 2, 0))
        sines = cross(sides, before) / lengths  # of another sign in a triangle that is turned over
        if (sines * np.sign(sines[0, 0])).min() > _SHARPEST:
            changed[[cell, other]] = turned
            touched[pair] = True
    return changed
