"""Round bodies that touch in a short part of their surfaces: Hertz, Cattaneo and Mindlin. Circles are true arcs."""

from typing import Final

import numpy as np

from qvi_contact.basics.checks import FloatArray, positive_number, whole_number
from qvi_contact.gallery.meshes import arc, fan, radii_between, steps_between
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, RigidPlate, Symmetry, Traction
from qvi_contact.problem.material import Material, Region
from qvi_contact.problem.problem import ContactProblem

_MOST: Final = 1000  # sectors
_JOINED: Final = 1.5  # half-width of the joint over that of the contact
_NEAR: Final = 0.4  # radius of the last round line about the contact over that of the body


def cylinder_on_block(share: float = 0.01, sectors: int = 6, depth: int = 4) -> ContactProblem:
    """A steel cylinder on an aluminium block, without friction: NAFEMS R0094-1, Code_Aster's SSNP154.

    Radius R = 50 mm and E = 210 000 MPa, on a block of 200 × 200 with E = 70 000, ν = 0.3, plane strain, under a part
    of 35 000 N/mm: all of it would be finite strain. Hertz has the half-width a = 6.2146 √share mm and the peak
    pressure p₀ = 3585.36 √share MPa; he takes both bodies for half planes, which neglects terms of the order (a/R)².

    The right half of a half cylinder is taken, with the load spread over its flat side. The contact is "contact".

    Parameters
    ----------
    share : float
        Part of the load.
    sectors : int
        Triangles around the contact in a quarter.
    depth : int
        How often the triangles at the end of the contact are halved in size.

    """
    half_width = 6.2146 * float(np.sqrt(positive_number("share", share)))
    mesh = _welded(_half_disc(50.0, half_width, sectors, 1), _block(100.0, 200.0, half_width, sectors), half_width)
    height = float(mesh.vertices[:, 1].max())
    mesh = mesh.with_edges("load", lambda _, y: y >= height)
    mesh = mesh.with_edges("axis", lambda x, _: x == 0.0).with_edges("bottom", lambda _, y: y == -200.0)
    mesh = mesh.with_edges("side", lambda x, y: (x == 100.0) & (y < 0.0)).with_edges("top", lambda _, y: y == 0.0)
    mesh = mesh.with_arc("cylinder", (0.0, height), 50.0).graded([(half_width, 0.0)], depth)
    steel, aluminium = Material(21e4, 0.3, "strain"), Material(7e4, 0.3, "strain")
    conditions: list[Condition] = [
        Contact("contact", friction=0.0, gap=lambda x, _: _rise(x, 50.0)),
        Traction("load", x=0.0, y=-350.0 * share),
        Traction("cylinder", normal=0.0, tangential=0.0),
        *(Traction(free, x=0.0, y=0.0) for free in ("top", "side")),
        *(Symmetry(side) for side in ("axis", "bottom")),
    ]
    return ContactProblem(mesh, aluminium, conditions, regions=[Region(steel, name="above")])


def half_discs(share: float = 1e-4, sectors: int = 6, depth: int = 4) -> ContactProblem:
    """Two half discs of one material, pressed together and sheared: the middle sticks (Cattaneo, Mindlin).

    Radius R = 8 mm, E = 200 MPa, ν = 0.3, plane strain, μ = 0.2, under a part of P = 10 and Q = 0.93616 N/mm. On half
    planes the half-width is a = 0.680778 √share mm, the peak pressure p₀ = 9.351351 √share MPa, and |x| < c sticks,
    c = a √(1 − Q/(μP)) = 0.496511 √share mm, with the shear stress μ (p₀ √(1 − x²/a²) − p₀ (c/a) √(1 − x²/c²)) there.

    A rigid plate holds the flat side of the disc above and does not turn; the other flat side is held. The contact is
    "contact". Parameters are those of `cylinder_on_block`.
    """
    root = float(np.sqrt(positive_number("share", share)))
    half_width, stick = 0.680778 * root, 0.496511 * root
    mesh = _welded(_half_disc(8.0, half_width, sectors, 2), None, half_width)
    height = float(mesh.vertices[:, 1].max())
    mesh = mesh.with_edges("load", lambda _, y: y >= height).with_edges("bottom", lambda _, y: y <= -height)
    mesh = mesh.with_arc("cylinder", (0.0, height), 8.0).with_arc("below", (0.0, -height), 8.0)
    mesh = mesh.graded([(x, 0.0) for x in (-half_width, -stick, stick, half_width)], depth)
    plate = RigidPlate(force_x=0.93616 * share, force_y=-10.0 * share)
    conditions: list[Condition] = [
        Contact("contact", friction=0.2, gap=lambda x, _: 2.0 * _rise(x, 8.0)),
        Contact("load", friction=0.0, law="tied", plate=plate),
        Displacement("bottom", x=0.0, y=0.0),
        *(Traction(free, normal=0.0, tangential=0.0) for free in ("cylinder", "below")),
    ]
    return ContactProblem(mesh, Material(200.0, 0.3, "strain"), conditions)


def _rise(x: FloatArray, radius: float) -> FloatArray:
    """How far a circle is from its tangent [length]; no difference of large numbers."""
    return np.asarray(x**2 / (radius + np.sqrt(radius**2 - x**2)))


def _half_disc(radius: float, half_width: float, sectors: int, quarters: int) -> list[FloatArray]:
    """Lines around (0, 0) in a half disc above it, or in the right half of that, up to its flat side.

    As far as the joint reaches its round side is flat; from there it is a circle.
    """
    joined = _JOINED * half_width
    height = np.sqrt(radius**2 - joined**2)
    shares = np.linspace(0.0, 1.0, quarters * whole_number("sectors", sectors, _MOST) + 1)

    def line(distance: float) -> FloatArray:
        start = np.arcsin(max(distance**2 - joined**2, 0.0) / (2.0 * height * distance))
        end = 0.5 * np.pi if quarters == 1 else np.pi - start
        return arc(distance, start + shares * (end - start))

    near, corner = _NEAR * radius, float(np.hypot(radius, height))
    lines = [line(distance) for distance in _radii(half_width, near, sectors)]
    steps = max(2, steps_between(near, corner, sectors))
    last = lines[-1]
    flat = np.column_stack([radius * (1.0 - quarters * shares), np.full(len(shares), height)])
    for step, distance in enumerate(np.geomspace(near, corner, steps + 1)[1:-1], start=1):
        between = last + step / steps * (flat - last)
        missing = line(float(distance)) - between
        start, end = (np.maximum(weight, 0.0)[:, None] for weight in (1.0 - quarters * shares, quarters * shares - 1.0))
        lines.append(between + start * missing[0] + end * missing[-1])
    return [*lines, flat]


def _block(width: float, height: float, half_width: float, sectors: int) -> list[FloatArray]:
    """Lines around (0, 0) in a rectangle below it and to the right, up to its sides."""
    corner, count = np.arctan2(height, width), whole_number("sectors", sectors, _MOST)
    low = max(1, round(count * corner / (0.5 * np.pi)))
    parts = np.linspace(0.0, corner, low + 1), np.linspace(corner, 0.5 * np.pi, max(1, count - low) + 1)[1:]
    angles = -np.concatenate(parts)[::-1]
    near = _NEAR * width
    lines = [arc(float(distance), angles) for distance in _radii(half_width, near, sectors)]
    edge = np.column_stack([np.tan(angles + 0.5 * np.pi) * height, np.full(len(angles), -height)])
    side = np.column_stack([np.full(len(angles), width), np.tan(angles) * width])
    outer = np.where((angles > -corner)[:, None], side, edge)
    outer[len(angles) - low - 1] = width, -height
    outer[0, 0] = outer[-1, 1] = 0.0
    steps = max(2, steps_between(near, height, sectors))
    first = lines[-1]
    return [*lines, *(first + share * (outer - first) for share in np.linspace(0.0, 1.0, steps + 1)[1:])]


def _radii(half_width: float, last: float, sectors: int) -> FloatArray:
    """Radii of lines about the contact: even steps as far as the joint, and in geometric progression from there."""
    joined = _JOINED * half_width
    even = np.linspace(0.0, joined, max(4, sectors) + 1)[1:]
    return np.concatenate([even, radii_between(joined, last, sectors)[1:]])


def _welded(above: list[FloatArray], below: list[FloatArray] | None, half_width: float) -> TriangleMesh:
    """One mesh of two bodies that share the vertices of the joint "contact", the region "above" being one of them.

    The round side of it is "cylinder". The body below is the other one turned by 180° if not given, its round side
    being "below".
    """
    first = fan(above, closed=False, centre=(0.0, 0.0))
    second = fan(below or [-line for line in above], closed=False, centre=(0.0, 0.0))
    vertices, found = np.unique(np.vstack([first.vertices, second.vertices + 0.0]), axis=0, return_inverse=True)
    own, other = found[: len(first.vertices)], found[len(first.vertices) :]
    count = len(first.cells)
    mesh = TriangleMesh(vertices, np.vstack([own[first.cells], other[second.cells]]), {}, {"above": np.arange(count)})
    joined = 1.000001 * _JOINED * half_width
    mesh = mesh.with_joint("contact", lambda x, y: (y == 0.0) & (np.abs(x) < joined))
    for name, body, numbers in (("cylinder", first, own), ("below", second, other)):
        sides = ("start",) if below else ("start", "end")
        pairs = np.vstack([numbers[body.edge_sets[side]] for side in sides])
        if below is None or name == "cylinder":
            beyond = np.abs(vertices[pairs][:, :, 0]).max(axis=1) > joined
            mesh = mesh.with_edges(name, pairs[beyond])
    return mesh
