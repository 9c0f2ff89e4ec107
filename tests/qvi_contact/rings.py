"""Bodies with holes: a quarter of a ring, whose sides are arcs, rings of polygons, rectangles with holes."""

import numpy as np

from qvi_contact import TriangleMesh

INNER, OUTER, NU = 1.0, 2.0, 0.3
A = INNER**2 / (OUTER**2 - INNER**2)
WIDENED = A * INNER * ((1.0 - NU) + (1.0 + NU) * OUTER**2 / INNER**2)  # by unit pressure inside, of unit modulus


def quarter(radial, around, *, arcs=True):
    """A quarter of a ring, cut into triangles."""
    r, angle = np.meshgrid(np.linspace(INNER, OUTER, radial + 1), np.linspace(0.0, np.pi / 2.0, around + 1))
    vertices = np.column_stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()])
    vertices[np.abs(vertices) < 1e-14] = 0.0
    number = np.arange(len(vertices)).reshape(r.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    cells = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    lines = {"inner": number[:, 0], "outer": number[:, -1], "bottom": number[0], "left": number[-1]}
    mesh = TriangleMesh(vertices, cells, {name: np.column_stack([line[:-1], line[1:]]) for name, line in lines.items()})
    return mesh.with_arc("inner", (0.0, 0.0), INNER).with_arc("outer", (0.0, 0.0), OUTER) if arcs else mesh


def polygon(count, layers, inner=1.0, outer=2.0):
    """A ring between two regular polygons; its lines are "hole" and "outside"."""
    angle, radius = 2.0 * np.pi * np.arange(count) / count, np.geomspace(inner, outer, layers + 1)
    vertices = (radius[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])).reshape(-1, 2)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(layers), np.arange(count), indexing="ij"))
    a, b = i * count + j, i * count + (j + 1) % count
    cells = np.concatenate([np.column_stack([a, b, b + count]), np.column_stack([a, a + count, b + count])])
    middle = (inner + outer) / 2.0
    mesh = TriangleMesh(vertices, cells).with_edges("hole", lambda x, y: np.hypot(x, y) < middle)
    return mesh.with_edges("outside", lambda x, y: np.hypot(x, y) > middle)


def holed(divisions, places, low, high):
    """A rectangle with unit holes at these places, on cells of 1/divisions."""
    lines = [np.linspace(a, b, round((b - a) * divisions) + 1) for a, b in zip(low, high, strict=True)]
    x, y = np.meshgrid(*[(line[1:] + line[:-1]) / 2.0 for line in lines])
    body = np.ones(x.shape, dtype=bool)
    for a, b in places:
        body &= np.maximum(np.abs(x - a), np.abs(y - b)) > 0.5
    return TriangleMesh.grid(*lines, body)
