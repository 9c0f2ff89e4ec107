"""Bodies with holes and joints, problems that differ in friction alone, solved states and how far they differ."""

from dataclasses import replace

import numpy as np
from scipy.special import comb

from qvi_contact import Contact, TriangleMesh, solve
from qvi_contact.discretization import Discretization
from qvi_contact.solution import discretized
from solvers import Status

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


def with_line(mesh, name, direction, at, start=-np.inf, stop=np.inf):
    """The mesh with a joint along y = at ("horizontal") or x = at ("vertical"), between two places on it."""
    if direction == "horizontal":
        return mesh.with_joint(name, lambda x, y: np.isclose(y, at) & (x > start) & (x < stop))
    return mesh.with_joint(name, lambda x, y: np.isclose(x, at) & (y > start) & (y < stop))


def with_friction(known: Discretization, friction: float) -> Discretization:
    """The problem of a discretisation with another friction: it shares matrices and factorisation, which take time."""
    conditions = [
        replace(each, friction=friction) if isinstance(each, Contact) else each for each in known.problem.conditions
    ]
    return discretized(replace(known.problem, conditions=conditions), before=known)


def bernstein(degree, t):
    """Values (n, degree + 1) of the Bernstein polynomials at t (n,)."""
    i, t = np.arange(degree + 1), np.asarray(t)[:, None]
    return comb(degree, i) * t**i * (1.0 - t) ** (degree - i)


def solved(problem, tolerance=1e-9, **options):
    """The result of a problem that must be solved."""
    result = solve(problem, tolerance=tolerance, **options)
    assert result.status is Status.SOLVED, result.message
    return result


def difference(one, other):
    """Largest difference of the stresses at the Gauss points of all cells, relative."""
    first, second = one.gauss_stress()[2], other.gauss_stress()[2]
    return np.abs(first - second).max() / np.abs(first).max()
