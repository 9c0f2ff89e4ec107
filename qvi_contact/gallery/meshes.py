"""Triangle meshes of discs, rings and plates with a round part in them, made line by line without a mesh generator."""

from collections.abc import Mapping, Sequence

import numpy as np

from qvi_contact.basics.checks import FloatArray, IntArray
from qvi_contact.mesh.triangles import TriangleMesh


def fan(
    lines: Sequence[FloatArray],
    *,
    closed: bool,
    centre: tuple[float, float] | None = None,
    joints: Mapping[str, int] | None = None,
    arcs: Sequence[str] = (),
) -> TriangleMesh:
    """Triangles between lines (n, 2) around a point [length], counterclockwise, from the innermost to the outermost.

    Closed lines lead back to their first vertex. The centre is a vertex inside the first line, joined to it by
    triangles; by default there is a hole. Joints are numbers of lines by name, arcs the names of lines that are arcs of
    circles around the origin. The outermost line is called "outer", that around the hole "inner"; the two ends of open
    lines are "start" and "end". What lies inside a joint is the region of its name, as far as the joint before it.
    """
    count, steps = len(lines[0]), len(lines[0]) if closed else len(lines[0]) - 1
    first = np.arange(steps)
    following = (first + 1) % count
    vertices, cells, regions = np.concatenate(lines), list[IntArray](), list[IntArray]()
    for k in range(len(lines) - 1):
        a, b, c, d = (
            line * count + place for line, place in ((k, first), (k, following), (k + 1, following), (k + 1, first))
        )
        even = (first % 2 == 0)[:, None]
        cells.append(np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d])))
        cells.append(np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d])))
        regions += [np.full(2 * steps, k + 1)]
    if centre is not None:
        cells.append(np.column_stack([np.full(steps, len(vertices)), first, following]))
        regions.append(np.zeros(steps, dtype=np.int64))
        vertices = np.vstack([vertices, centre])
    edges = {name: _along(line, first, following, count) for name, line in (joints or {}).items()}
    edges["outer"] = _along(len(lines) - 1, first, following, count)
    if centre is None:
        edges["inner"] = _along(0, first, following, count)
    if not closed:
        for name, place in (("start", 0), ("end", count - 1)):
            radial = np.arange(len(lines)) * count + place
            radial = radial if centre is None else np.concatenate([[len(vertices) - 1], radial])
            edges[name] = np.column_stack([radial[:-1], radial[1:]])
    layer, inside, named = np.concatenate(regions), 0, dict[str, IntArray]()
    for name, line in sorted((joints or {}).items(), key=lambda item: item[1]):
        named[name] = np.flatnonzero((layer >= inside) & (layer <= line))
        inside = line + 1
    mesh = TriangleMesh(vertices, np.concatenate(cells), edges, named)
    for name in arcs:
        mesh = mesh.with_arc(name, (0.0, 0.0), float(np.hypot(*vertices[edges[name][0, 0]])))
    return mesh


def arc(radius: float, angles: FloatArray) -> FloatArray:
    """Points (n, 2) on a circle around the origin; those on an axis lie on it to the last digit."""
    points = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.asarray(np.where(np.abs(points) > 1e-15 * radius, points, 0.0))


def radii_between(first: float, last: float, sectors: int) -> FloatArray:
    """Radii in geometric progression, so that triangles are about as long as wide with so many sectors in a quarter."""
    return np.geomspace(first, last, max(1, steps_between(first, last, sectors)) + 1)


def steps_between(first: float, last: float, sectors: int) -> int:
    """How many steps from one radius to another make triangles about as long as wide."""
    return round(float(np.log(last / first)) * sectors / (0.5 * np.pi))


def _along(line: int, first: IntArray, following: IntArray, count: int) -> IntArray:
    return np.column_stack([line * count + first, line * count + following])
