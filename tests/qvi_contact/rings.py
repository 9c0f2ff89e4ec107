"""A quarter of a ring, whose sides are arcs."""

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
