"""Triangles of an outline, made by gmsh.

gmsh keeps one state for the whole process. It is started for one mesh and ended behind it, under a lock, without
configuration files, signal handlers, threads of its own, or output; a session of the caller's is left as it was.

Its start puts eleven signals back to what they do in a new program. Python ignores SIGPIPE, so that a pipe or socket
whose reader has gone is an exception; the process would end there without a word. Handlers of SIGTERM and of crashes
would be lost. They are kept.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.basics.signals import handlers_kept
from qvi_contact.errors import InputError
from qvi_contact.mesh.curves import Arc, MeshParts
from qvi_contact.mesh.outline import Polygon, Polygons
from qvi_contact.mesh.topology import Topology
from solvers.basics.foreign import foreign_code
from solvers.basics.types import load

_LOCK: Final = Lock()
_SHARPEST: Final = 0.2  # sine of the angle below which no triangle is made
_ON_CIRCLE: Final = 1e-5  # difference of radii, relative, that the ends of one arc may have
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

    Raises
    ------
    InputError
        If gmsh or a system library it needs is missing, gmsh cannot divide the body, or an inner line leaves it.

    """
    gmsh = _gmsh()
    unit = 2.0 ** -round(np.log2(shape.length))  # gmsh has absolute tolerances; a power of two changes no digit
    with _LOCK, foreign_code(), _session(gmsh):
        try:
            made = _mesh(gmsh, shape.scaled(unit))
            arcs = [arc.scaled(1.0 / unit) for arc in made.arcs]
            return made._replace(vertices=made.vertices / unit, arcs=arcs)
        except Exception as error:
            if type(error) is not Exception:  # gmsh raises bare ones with a text
                raise
            told = " ".join(str(error).split()) or "no reason given"
            raise InputError("outline", told, "gmsh cannot divide this body: look for lines that cross") from error


def _gmsh() -> Any:
    """The library, or how to get it."""
    try:
        return load("gmsh")
    except ImportError as error:
        remedy = "outlines are divided by gmsh: python -m pip install gmsh"
        raise InputError("outline", "gmsh", remedy) from error
    except OSError as error:  # a library of the system is missing
        told = " ".join(str(error).split())
        remedy = f"gmsh needs libraries of the system ({told}): on Debian and Ubuntu {_LIBRARIES}"
        raise InputError("outline", "gmsh", remedy) from error


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


def _mesh(gmsh: Any, shape: Polygons) -> MeshParts:
    occ = gmsh.model.occ
    drawn = [_drawn(occ, polygon) for polygon in (shape.outer, *shape.holes)]
    body = (2, occ.addPlaneSurface([occ.addCurveLoop(lines) for lines in drawn]))
    inner = [
        (1, line) for polygon in (*shape.joints.values(), *shape.regions.values()) for line in _drawn(occ, polygon)
    ]
    points = [(0, occ.addPoint(*place, 0.0)) for place in shape.points.tolist()]
    surfaces = [body[1]]
    if inner or points:  # the surface is cut along lines
        surfaces = [tag for dimension, tag in occ.fragment([body], [*inner, *points])[1][0] if dimension == 2]
    occ.synchronize()
    _set_sizes(gmsh, shape)
    gmsh.model.mesh.generate(2)
    return _parts(gmsh, shape, surfaces)


def _drawn(occ: Any, polygon: Polygon) -> list[int]:
    """The polygon's pieces as lines and arcs of gmsh."""
    tags = [occ.addPoint(x, y, 0.0) for x, y in polygon.points.tolist()]
    ends, drawn, middles = zip(tags, [*tags[1:], tags[0]], strict=True), [], []
    for (first, second), (x, y) in zip(ends, polygon.centres.tolist(), strict=False):
        if np.isnan(x):
            drawn.append(occ.addLine(first, second))
        else:
            middles.append(occ.addPoint(x, y, 0.0))
            drawn.append(occ.addCircleArc(first, middles[-1], second))
    occ.remove([(0, tag) for tag in middles])
    return drawn


def _set_sizes(gmsh: Any, shape: Polygons) -> None:
    """Sizes at all points, the smallest where several are given at one place."""
    places = np.concatenate([*(polygon.points for polygon in shape.every), shape.points])
    sizes = np.concatenate([*(polygon.sizes for polygon in shape.every), shape.sizes])
    gmsh.option.setNumber("Mesh.MeshSizeMax", float(sizes.max()))
    for entity in gmsh.model.getEntities(0):
        at = np.array(gmsh.model.getValue(*entity, [])[:2])
        here = np.hypot(*(places - at).T) <= shape.rounding
        gmsh.model.mesh.setSize([entity], float(sizes[here].min()) if here.any() else shape.largest)


def _parts(gmsh: Any, shape: Polygons, surfaces: Sequence[int]) -> MeshParts:
    """Vertices, triangles, edges by name, triangles by region."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags.astype(np.int64)] = np.arange(len(tags))
    points = np.asarray(coordinates, dtype=float).reshape(-1, 3)[:, :2]
    cells = number[np.concatenate([_elements(gmsh, 2, tag) for tag in sorted(surfaces)])]
    used = np.unique(cells)
    vertex = np.full(len(points), -1)
    vertex[used] = np.arange(len(used))
    pairs = {tag: vertex[number[_elements(gmsh, 1, tag)]] for _, tag in gmsh.model.getEntities(1)}
    ends, edge_sets = _ends(gmsh), {}
    for name, curves in _curves(ends, shape).items():
        edge_sets[name] = np.concatenate([pairs[tag] for tag in curves])
        if (edge_sets[name] < 0).any():
            raise InputError(
                f"joints.{name}", name, "this inner line leaves the body: end it on the boundary or inside"
            )
    cells = divided_corners(points[used], vertex[cells], np.concatenate(list(pairs.values())))
    centres = points[used][cells].mean(axis=1)
    regions = {name: np.flatnonzero(polygon.holds(centres)) for name, polygon in shape.regions.items()}
    for name, chosen in regions.items():
        if not len(chosen):
            raise InputError(f"regions.{name}", name, "no part of the body lies in this region: move it")
    return MeshParts(points[used], cells, edge_sets, regions, _arcs(ends, shape, pairs))


def _arcs(ends: Mapping[int, FloatArray], shape: Polygons, pairs: Mapping[int, IntArray]) -> list[Arc]:
    """The edges on each circle, from those of each curve of gmsh, (k, 2) by its number, and the curve's ends."""
    found = dict[tuple[float, float, float], set[int]]()
    for polygon in shape.every:
        for centre in np.unique(polygon.centres[np.isfinite(polygon.centres[:, 0])], axis=0):
            alike = (polygon.centres == centre).all(axis=1)
            for radius in np.unique(np.hypot(*(polygon.pieces[alike, 0] - centre).T).round(12)).tolist():
                own = alike & (np.abs(np.hypot(*(polygon.pieces[:, 0] - centre).T) - radius) <= _ON_CIRCLE * radius)
                on = {tag for tag, both in ends.items() if _on_one(polygon.distances(both)[:, own], shape.rounding)}
                found.setdefault((*centre.tolist(), radius), set()).update(on)
    taken, arcs = set[int](), []
    for (x, y, radius), tags in found.items():
        new = sorted(tags - taken)  # a line that two parts of the outline share is one
        taken.update(tags)
        if new:
            arcs.append(Arc((x, y), radius, np.concatenate([pairs[tag] for tag in new])))
    return arcs


def _ends(gmsh: Any) -> dict[int, FloatArray]:
    """Both ends (2, 2) of each curve of gmsh."""
    found = {}
    for entity in gmsh.model.getEntities(1):
        tags = [abs(tag) for _, tag in gmsh.model.getBoundary([entity])]
        found[entity[1]] = np.array([gmsh.model.getValue(0, tag, [])[:2] for tag in tags])
    return found


def _curves(ends: Mapping[int, FloatArray], shape: Polygons) -> dict[str, list[int]]:
    """Curves of gmsh by the name of the piece of the outline on which both their ends lie."""
    named = [
        (name, polygon, [other == name for other in polygon.names])
        for polygon in (shape.outer, *shape.holes)
        for name in dict.fromkeys(filter(None, polygon.names))
    ]
    named += [(name, polygon, [True] * len(polygon.names)) for name, polygon in shape.joints.items()]
    found: dict[str, list[int]] = {}
    for name, polygon, pieces in named:
        on = [tag for tag, both in ends.items() if _on_one(polygon.distances(both)[:, pieces], shape.rounding)]
        found[name] = sorted({*found.get(name, []), *on})
    return found


def _on_one(distances: FloatArray, near: float) -> bool:
    """Whether all points are near to one and the same piece, from their distances (points, pieces)."""
    return bool((distances <= near).all(axis=0).any())


def _elements(gmsh: Any, dimension: int, tag: int) -> IntArray:
    """Nodes (k, 2) or (k, 3) of the lines or triangles of a curve or surface."""
    kind = {1: 1, 2: 2}[dimension]
    nodes = gmsh.model.mesh.getElementsByType(kind, tag)[1]
    return np.asarray(nodes, dtype=np.int64).reshape(-1, dimension + 1)


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
        if _sharpest(vertices[turned]) > _SHARPEST:
            changed[[cell, other]] = turned
            touched[pair] = True
    return changed


def _sharpest(corners: FloatArray) -> float:
    """The least sine of an angle of two triangles (2, 3, 2) that share an edge; negative if one is turned over."""
    sides = np.roll(corners, -1, axis=1) - corners
    before = -np.roll(sides, 1, axis=1)
    cross = sides[..., 0] * before[..., 1] - sides[..., 1] * before[..., 0]
    sines = cross / (np.hypot(*np.moveaxis(sides, 2, 0)) * np.hypot(*np.moveaxis(before, 2, 0)))
    return float((sines * np.sign(sines[0, 0])).min())
