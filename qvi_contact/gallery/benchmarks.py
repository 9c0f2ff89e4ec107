"""Published contact problems: rings, a press fit, pins in holes, cylinders, the corner of a block, plates.

Circles are true arcs. `sectors` is the number of edges of each circle in a quarter, `friction` the coefficient μ.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import Field, FloatArray, IntArray, finite_number, positive_number, whole_number
from qvi_contact.mesh.triangles import Place, TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, RigidPlate, Symmetry, Traction
from qvi_contact.problem.material import Material, Plane, Region
from qvi_contact.problem.problem import ContactProblem

__all__ = [
    "CORNER_EXPONENTS", "SSNV128_DISPLACEMENTS", "arc", "block_corner", "compressed_plate", "cylinder_in_bore",
    "cylinder_on_block", "fan", "half_discs", "loaded_pin", "persson_pressure", "press_fit", "press_fit_torque",
    "rings", "ssnv128",
]  # fmt: skip

_MAX_COUNT: Final = 1000  # of sectors, and of cells along a length
_QUARTER: Final = (Symmetry("start"), Symmetry("end"))


def rings(sectors: int = 8, swing: float = 0.0, *, whole: bool = False) -> ContactProblem:
    """Two rings, one in the other, under outer pressure, without friction: Code_Aster's test SSNP167.

    Radii 0.2, 0.6 and 1 m, plane strain, E = 1e9 Pa, ν = 0.2. The pressure 1e7 + `swing` cos 2θ acts on the outside.
    The contact pressure is 9.2592593e6 + 1.3571791 `swing` cos 2θ (Lamé; Michell for the second harmonic). The contact
    is "joint". It is a closed line on `whole` rings; otherwise a quarter between lines of symmetry is computed.
    """
    mesh = _nested((0.2, 0.6, 1.0), sectors, 4 if whole else 1, "joint", ("inner", "joint", "outer"))

    def pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(-1e7 - swing * (x**2 - y**2) / (x**2 + y**2))

    outside = Traction("outer", normal=pressure if swing else -1e7, tangential=0.0)
    conditions: list[Condition] = [Contact.frictionless("joint"), outside, Traction("inner", 0.0, 0.0)]
    return ContactProblem(mesh, Material(1e9, 0.2, "strain"), [*conditions, *([] if whole else _QUARTER)])


def press_fit(sectors: int = 8, friction: float = 0.0, *, whole: bool = False) -> ContactProblem:
    """A shaft in a hub with an interference: the pressure is p = E δ (b² − a²)/(2 a b²) = 61.8 MPa (Lamé).

    Radii a = 25 and b = 50 mm, δ = 0.02 mm, E = 206 000 MPa, ν = 0.3, plane stress; `whole` as in `rings`.
    """
    mesh = _nested((5.0, 25.0, 50.0), sectors, 4 if whole else 1, "shaft", ("shaft", "outer"), centre=(0.0, 0.0))
    contact = Contact("shaft", friction=friction, gap=-0.02)
    outside = Traction("outer", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(206e3, 0.3), [contact, outside, *([] if whole else _QUARTER)])


def press_fit_torque(
    friction: float, torque: float = 0.0, *, turn: float | None = None, sectors: int = 4
) -> ContactProblem:
    """A hollow shaft in a hub with an interference, twisted: it slips at the torque 2π μ p R².

    As `press_fit`, with a bore of radius 5 mm in the shaft: p = 59.927 MPa (Lamé). The torque [N mm/mm],
    counterclockwise, acts as shear in the bore; with `turn` [mm] this is a prescribed tangential displacement of the
    bore instead. The outside of the hub cannot rotate.
    """
    mesh = _nested((5.0, 25.0, 50.0), sectors, 4, "shaft", ("shaft", "outer", "inner"))
    shear = torque / (2.0 * np.pi * 5.0**3)
    bore: list[Condition] = [Traction("inner", x=lambda _, y: -shear * y, y=lambda x, _: shear * x)]
    if turn is not None:  # its sign: tangents of edges point to the right
        bore = [Traction("inner", normal=0.0), Displacement("inner", tangential=lambda _, y: -turn * np.sign(y))]
    outside: list[Condition] = [Displacement("outer", tangential=0.0), Traction("outer", normal=0.0)]
    return ContactProblem(mesh, Material(206e3, 0.3), [Contact("shaft", friction=friction, gap=-0.02), *outside, *bore])


def cylinder_in_bore(
    sectors: int = 16, friction: float = 0.0, *, extent: float = 100.0, share: float = 1.0
) -> ContactProblem:
    """A cylinder in the bore of a very large plate, pressed to one side by its axis: Persson's problem.

    Radii 60 and 59.99 mm, both E = 210 000 MPa, ν = 0.3, plane stress, 1875 N/mm along x. Without friction the contact
    is |θ| < 59.298° with the pressure of `persson_pressure`; Code_Aster's test SSNV127 has μ = 0.4. The upper half is
    computed, with symmetry on y = 0. The closed form has the load on the axis of the cylinder. Here the load is spread
    over |x| < 1.2, which changes the pressure by 4e-5 of itself; this error grows with the square of that length. The
    plate is fixed at `extent` times the radius of the bore; `share` is the fraction of the load.
    """
    radii = 1.2, 60.0, 60.0 * positive_number("extent", extent)
    mesh = _with_load(_nested(radii, sectors, 2, "bore", ("bore", "outer"), centre=(0.0, 0.0)), 1.2)
    contact = Contact("bore", friction=friction, gap=0.01)
    outside = Displacement("outer", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(210e3, 0.3), [contact, outside, *_load_conditions(share * 1875.0 / 2.0, 1.2)])


def persson_pressure(angle: ArrayLike) -> FloatArray:
    """Pressure [MPa] in `cylinder_in_bore` without friction at an angle θ from the direction of the load [rad].

    With b = tan(α/2), α = 59.298°, y = tan(θ/2), s = √(b² − y²), r = √(1 + b²), and the force Q on the radius R,

        p R/Q = 2 s/(π r (1 + y²)) + ln((r + s)/(r − s))/(2π b² r²);

    zero for |θ| > α. A. Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers, 1964.
    """
    b, y = np.tan(np.deg2rad(59.298) / 2.0), np.tan(np.asarray(angle, dtype=float) / 2.0)
    s, r = np.sqrt(np.maximum(b**2 - y**2, 0.0)), np.sqrt(1.0 + b**2)
    first_term = 2.0 * s / (np.pi * r * (1.0 + y**2))
    return np.asarray(1875.0 / 60.0 * (first_term + np.log((r + s) / (r - s)) / (2.0 * np.pi * b**2 * r**2)))


def loaded_pin(sectors: int = 16, friction: float = 0.1) -> ContactProblem:
    """An elastic pin in the eye of a sheet, pulled away from its clamped end: NAFEMS R0094-4, Code_Aster's SSNP156.

    Hole and pin of radius 50 mm without clearance, eye of radius 100, sheet 200 high and clamped 200 from the centre.
    Plane strain, sheet E = 70 000 MPa, pin 210 000, ν = 0.3, μ = 0.1, 20 000 N/mm along x at the pin's centre. The
    upper half is computed. The load is spread over a fifth of the diameter, as a point load would do infinite work.

    At (50, 0), where the axis meets the hole, the sheet slips along the pin to both sides and the shear traction
    changes its sign. So the stresses at this point depend on the mesh: σ_xx is −155 MPa with equal edges and −148 MPa
    with edges graded to the point. The displacement does not depend on it, u_x = 0.7387 mm.
    """
    corner = np.arctan2(1.0, -2.0)
    count = whole_number("sectors", sectors, _MAX_COUNT)
    steep = max(1, round(count * (np.pi - corner) / (0.5 * np.pi)))
    ranges = [(0.0, 0.5 * np.pi, count), (0.5 * np.pi, corner, max(1, count - steep)), (corner, np.pi, steep)]
    angles = np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in ranges] + [[np.pi]])
    with np.errstate(divide="ignore"):
        sheet_edge = np.minimum(100.0 / np.abs(np.sin(angles)), 200.0 / np.abs(np.cos(angles)))
    distance = np.where(angles <= 0.5 * np.pi, 100.0, sheet_edge)
    pin_radii = radii_between(10.0, 50.0, sectors)
    steps = max(2, steps_between(50.0, 100.0, count))
    shares = np.linspace(0.0, 1.0, steps + 1)[1:, None]
    lines = [arc(radius, angles) for radius in pin_radii]
    unit = arc(1.0, angles)
    lines += [unit * (50.0 ** (1.0 - share) * distance**share)[:, None] for share in shares]
    mesh = fan(lines, closed=False, centre=(0.0, 0.0), joints={"pin": len(pin_radii) - 1}, arcs=("pin",))
    mesh = _with_load(mesh, 10.0)
    mesh = mesh.with_edges("wall", lambda x, _: x < -199.999)
    mesh = mesh.with_edges("free", lambda x, y: (y > 0.0) & (x > -199.999) & (x < 0.0))
    mesh = mesh.with_edges("eye", lambda x, y: (y > 0.0) & (x > 0.0)).with_arc("eye", (0.0, 0.0), 100.0)
    sheet, pin = Material(7e4, 0.3, "strain"), Material(21e4, 0.3, "strain")
    conditions: list[Condition] = [
        Contact("pin", friction=friction),
        Displacement("wall", 0.0, 0.0),
        *(Traction(name, normal=0.0, tangential=0.0) for name in ("eye", "free")),
        *_load_conditions(1e4, 10.0),
    ]
    return ContactProblem(mesh, sheet, conditions, regions=[Region(pin, name="pin")])


def _with_load(mesh: TriangleMesh, half: float) -> TriangleMesh:
    """The mesh with the part |x| < half of the line y = 0 called "load", and the rest of it "axis"."""
    mesh = mesh.with_edges("load", lambda x, y: (y == 0.0) & (np.abs(x) < half))
    return mesh.with_edges("axis", lambda x, y: (y == 0.0) & (np.abs(x) > half))


def _load_conditions(force: float, half: float) -> list[Condition]:
    """Symmetry about y = 0, and the force along x on the upper half, spread over |x| < half."""
    return [Symmetry("axis"), Displacement("load", y=0.0), Traction("load", x=force / (2.0 * half))]


def block_corner(friction: float | None, cells: int = 4, depth: int = 0) -> ContactProblem:
    """A square block on a large block of the same material: stresses σ ~ r^(λ−1) in the corners of the contact.

    The small block is [−1, 1] × [0, 2], the large one [−4, 4] × [−4, 0], with `cells` along a length of 1 and the
    triangles at (1, 0) halved in size `depth` times. The top is pressed down by 1e-3; λ is `CORNER_EXPONENTS`[μ]. With
    friction the top also moves to the right by 1e-2, so that the whole base slips, and λ belongs to the leading corner
    at x = 1. Without friction, and with `friction` None for one bonded body, top and bottom may move along x, so that
    no other point is singular. Plane strain, E = 1, ν = 0.3.
    """
    count = whole_number("cells", cells, _MAX_COUNT)
    x, y = np.linspace(-4.0, 4.0, 8 * count + 1), np.linspace(-4.0, 2.0, 6 * count + 1)
    middle_x, middle_y = (x[1:] + x[:-1]) / 2.0, (y[1:] + y[:-1]) / 2.0
    is_body = (middle_y < 0.0)[:, None] | (np.abs(middle_x) < 1.0)[None]
    edges: dict[str, Place] = {"roof": ((-1.0, 2.0), (1.0, 2.0)), "ground": lambda x, y: (y == 0.0) & (np.abs(x) > 1.0)}
    mesh = TriangleMesh.grid(x, y, is_body, edges=edges, joints={"base": ((-1.0, 0.0), (1.0, 0.0))})
    mesh = mesh.graded([(1.0, 0.0)], depth)
    contact = Contact.tied("base") if friction is None else Contact("base", friction=friction)
    free = [Traction(name, 0.0, 0.0) for name in ("left", "right", "ground")]
    supports: list[Condition] = [Displacement("roof", y=-1e-3), Traction("roof", x=0.0), Symmetry("bottom")]
    if friction:
        supports = [Displacement("roof", x=1e-2, y=-1e-3), Displacement("bottom", 0.0, 0.0)]
    conditions: list[Condition] = [contact, *supports, *free]
    return ContactProblem(mesh, Material(1.0, 0.3, "strain"), conditions)


CORNER_EXPONENTS: Final = {None: 0.544484, 0.0: 0.7740, 0.1: 0.7249, 0.3: 0.6380, 0.5: 0.5604}
"""λ of `block_corner` by friction; None for bonded bodies."""


def _nested(
    radii: tuple[float, float, float],
    sectors: int,
    quarters: int,
    joint: str,
    arcs: Sequence[str],
    centre: tuple[float, float] | None = None,
) -> TriangleMesh:
    """A ring, or a disc if a centre is given, and the ring around it, on a number of quarters; see `fan`."""
    count, (inner, interface, outer) = quarters * whole_number("sectors", sectors, _MAX_COUNT), radii
    angles = np.linspace(0.0, quarters * 0.5 * np.pi, count + 1)
    angles = angles[:-1] if quarters == 4 else angles  # the end of a whole circle is its start
    inner_radii, outer_radii = radii_between(inner, interface, sectors), radii_between(interface, outer, sectors)
    lines = [arc(radius, angles) for radius in (*inner_radii, *outer_radii[1:])]
    return fan(lines, closed=quarters == 4, centre=centre, joints={joint: len(inner_radii) - 1}, arcs=arcs)


_JOINT_WIDTH: Final = 1.5  # half-width of the joint, relative to that of the contact
_ROUND_LINES: Final = 0.4  # radius of the last round line around the contact, relative to that of the body


def cylinder_on_block(share: float = 0.01, sectors: int = 6, depth: int = 4) -> ContactProblem:
    """A steel cylinder on an aluminium block, without friction: NAFEMS R0094-1, Code_Aster's SSNP154.

    Radius R = 50 mm and E = 210 000 MPa, on a block of 200 × 200 with E = 70 000, ν = 0.3, plane strain. The load is
    the fraction `share` of 35 000 N/mm, as the whole load would cause finite strain. Hertz gives the half-width
    a = 6.2146 √share mm and the peak pressure p₀ = 3585.36 √share MPa for two half planes, with errors of order (a/R)².

    The right half of a half cylinder is computed, with the load spread over its flat side. The contact is "contact".
    `sectors` triangles surround it in a quarter; the triangles at its end are halved in size `depth` times.
    """
    half_width = 6.2146 * float(np.sqrt(positive_number("share", share)))
    mesh = _joined_bodies(_half_disc(50.0, half_width, sectors, 1), _block(100.0, 200.0, half_width, sectors))
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

    Radius R = 8 mm, E = 200 MPa, ν = 0.3, plane strain, μ = 0.2, under the fraction `share` of P = 10 and Q = 0.93616
    N/mm. For half planes the half-width is a = 0.680778 √share mm, the peak pressure p₀ = 9.351351 √share MPa, and
    |x| < c = a √(1 − Q/(μP)) = 0.496511 √share mm sticks, with the shear stress
    μ (p₀ √(1 − x²/a²) − p₀ (c/a) √(1 − x²/c²)).

    A rigid plate, which does not rotate, holds the flat side of the upper disc; the other flat side is fixed. The
    contact is "contact"; `share`, `sectors` and `depth` are as in `cylinder_on_block`.
    """
    root = float(np.sqrt(positive_number("share", share)))
    half_width, stick = 0.680778 * root, 0.496511 * root
    mesh = _joined_bodies(_half_disc(8.0, half_width, sectors, 2), None)
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
    """Distance of a circle from its tangent at x from the point of tangency [length], without cancellation."""
    return np.asarray(x**2 / (radius + np.sqrt(radius**2 - x**2)))


def _half_disc(radius: float, half_width: float, sectors: int, quarters: int) -> list[FloatArray]:
    """Lines around (0, 0) in a half disc above it, or in the right quarter disc, up to the flat side on top.

    The round side is flattened along the joint; beyond the joint it is a circle.
    """
    flat_half = _JOINT_WIDTH * half_width
    height = np.sqrt(radius**2 - flat_half**2)
    shares = np.linspace(0.0, 1.0, quarters * whole_number("sectors", sectors, _MAX_COUNT) + 1)

    def line(distance: float) -> FloatArray:
        start = np.arcsin(max(distance**2 - flat_half**2, 0.0) / (2.0 * height * distance))
        end = 0.5 * np.pi if quarters == 1 else np.pi - start
        return arc(distance, start + shares * (end - start))

    last_round, corner = _ROUND_LINES * radius, float(np.hypot(radius, height))
    lines = [line(distance) for distance in _radii(half_width, last_round, sectors)]
    steps = max(2, steps_between(last_round, corner, sectors))
    round_line = lines[-1]
    flat = np.column_stack([radius * (1.0 - quarters * shares), np.full(len(shares), height)])
    for step, distance in enumerate(np.geomspace(last_round, corner, steps + 1)[1:-1], start=1):
        blend = round_line + step / steps * (flat - round_line)
        correction = line(float(distance)) - blend
        start, end = (np.maximum(weight, 0.0)[:, None] for weight in (1.0 - quarters * shares, quarters * shares - 1.0))
        lines.append(blend + start * correction[0] + end * correction[-1])
    return [*lines, flat]


def _block(width: float, height: float, half_width: float, sectors: int) -> list[FloatArray]:
    """Lines around (0, 0) in a rectangle to the right and below, up to the sides of the rectangle."""
    corner, count = np.arctan2(height, width), whole_number("sectors", sectors, _MAX_COUNT)
    n_side = max(1, round(count * corner / (0.5 * np.pi)))
    parts = np.linspace(0.0, corner, n_side + 1), np.linspace(corner, 0.5 * np.pi, max(1, count - n_side) + 1)[1:]
    angles = -np.concatenate(parts)[::-1]
    last_round = _ROUND_LINES * width
    lines = [arc(float(distance), angles) for distance in _radii(half_width, last_round, sectors)]
    edge = np.column_stack([np.tan(angles + 0.5 * np.pi) * height, np.full(len(angles), -height)])
    side = np.column_stack([np.full(len(angles), width), np.tan(angles) * width])
    outer = np.where((angles > -corner)[:, None], side, edge)
    outer[len(angles) - n_side - 1] = width, -height
    outer[0, 0] = outer[-1, 1] = 0.0
    steps = max(2, steps_between(last_round, height, sectors))
    round_line = lines[-1]
    return [*lines, *(round_line + share * (outer - round_line) for share in np.linspace(0.0, 1.0, steps + 1)[1:])]


def _radii(half_width: float, last: float, sectors: int) -> FloatArray:
    """Radii of lines around the contact: in equal steps within the joint, then in geometric progression."""
    flat_half = _JOINT_WIDTH * half_width
    even = np.linspace(0.0, flat_half, max(4, sectors) + 1)[1:]
    return np.concatenate([even, radii_between(flat_half, last, sectors)[1:]])


def _joined_bodies(above: list[FloatArray], below: list[FloatArray] | None) -> TriangleMesh:
    """One mesh of two bodies with the joint "contact"; the upper body is the region "above", its round side "cylinder".

    Without lines for it, the lower body is the upper one rotated by 180°, with the round side "below".
    """
    bodies = list[TriangleMesh]()
    for name, lines in (("cylinder", above), ("below", below or [-line for line in above])):
        body = fan(lines, closed=False, centre=(0.0, 0.0))
        sides = [body.edge_sets[side] for side in (("start",) if below else ("start", "end"))]
        region = {"above": np.arange(len(body.cells))} if name == "cylinder" else {}
        edge_sets = {name: np.concatenate(sides)} if below is None or region else {}
        bodies.append(TriangleMesh(body.vertices, body.cells, edge_sets, region))
    return TriangleMesh.joined("contact", bodies)


# plates on rigid planes


SSNV128_DISPLACEMENTS: Final = (
    ("A", 0.0, 2.86e-5),
    ("B", 1.25e-3, 2.72e-5),
    ("C", 5.0e-3, 2.28e-5),
    ("D", 7.5e-3, 1.98e-5),
    ("E", 11.25e-3, 1.5e-5),
)
"""Published results of `ssnv128`: point, x [m], u_x(x, 0) [m], means over several codes with a tolerance of 5 %.

The manual gives two digits at point E. Refined meshes of this package and of biquadratic displacement elements converge
to 2.860, 2.723, 2.287, 1.981 and 1.541e-5 m: the published value is 2.7 % low at E and within 0.3 % elsewhere.
"""


def compressed_plate(
    friction: Field,
    cells: tuple[int, int] = (2, 2),
    width: float = 1.0,
    height: float = 1.0,
    young: float = 2.09e5,
    poisson: float = 0.3,
    plane: Plane = "stress",
    displacement: float = 1e-3,
    grading: float = 1.0,
) -> ContactProblem:
    """Quarter of a plate compressed between two rough rigid plates: Więckowski (1992), section 5.

    The body is [0, width] × [0, height] with symmetry on x = 0 and y = 0, the side x = width free, and the contact
    "plate" on y = height, pushed down by U = `displacement`. Without friction the solution is the uniform stress
    σ_yy = −E U/height in plane stress. The default units are MPa and a length of 1.

    The cells are those of `TriangleMesh.rectangle`; the paper has (2, 2) rectangles. With a `grading` below 1 they
    shrink towards the free corner. U is the displacement of the quarter's top; the paper calls it the relative one.
    """
    mesh = TriangleMesh.rectangle(cells, width, height, grading=grading)
    conditions: list[Condition] = [
        Symmetry("left"),
        Symmetry("bottom"),
        Traction("right", x=0.0, y=0.0),
        Contact("top", friction=friction, gap=-finite_number("displacement", displacement), name="plate"),
    ]
    return ContactProblem(mesh, Material(young, poisson, plane), conditions)


def ssnv128(cells: tuple[int, int] = (32, 32), friction: Field = 1.0) -> ContactProblem:
    """A square plate pressed against a rigid plane; the contact opens, slips and sticks: Code_Aster's test SSNV128.

    The body is [0, 0.04 m]² in plane strain with E = 1.3e11 Pa, ν = 0.2. A pressure of 5e7 Pa acts on the top and one
    of 15e7 Pa on x = 0; the side x = 0.04 m is a line of symmetry. The base y = 0 is the contact "base" with μ = 1.
    The pressures push the body to the right, friction pulls it back: σ_T < 0, and u_T > 0 where it slips.

    From the left, the base is open for x < 3.28 mm, slips up to 29.84 mm and sticks beyond. Balance gives the normal
    force 2.0e6 N/m; biquadratic displacement elements converge to these zones, a tangential force of −1.40535e6 N/m
    and a pressure of 8.388e7 Pa at x = 0.04 m. The published displacements are in `SSNV128_DISPLACEMENTS`. Without
    friction the stress is uniform and u_x(0) = 4.061538e-5 m.

    Source: Code_Aster, Manuel de validation V6.04.128, "SSNV128 - Plaque avec contact et frottement sur un plan
    rigide"; proposed by GRECO. Small displacements are assumed here. Units: Pa, m.
    """
    mesh = TriangleMesh.rectangle(cells, 0.04, 0.04)
    conditions: list[Condition] = [
        Contact("bottom", friction=friction, name="base"),
        Symmetry("right"),
        Traction("top", x=0.0, y=-5e7),
        Traction("left", x=15e7, y=0.0),
    ]
    return ContactProblem(mesh, Material(1.3e11, 0.2, "strain"), conditions)


# meshes of discs, rings and plates with a round part, made line by line without a mesh generator


def fan(
    lines: Sequence[FloatArray],
    *,
    closed: bool,
    centre: tuple[float, float] | None = None,
    joints: Mapping[str, int] | None = None,
    arcs: Sequence[str] = (),
) -> TriangleMesh:
    """Triangles between lines (n, 2) around a point [length], counterclockwise, from the innermost to the outermost.

    Closed lines lead back to their first vertex. A centre is a vertex inside the first line, connected to it by
    triangles; without it there is a hole. `joints` has numbers of lines by name, `arcs` the names of lines that are
    arcs of circles around the origin. The outermost line is called "outer", the line around the hole "inner"; the sides
    through the ends of open lines are "start" and "end". The triangles between a joint and the joint before it are a
    region with the joint's name.
    """
    vertices, numbers = np.concatenate(lines), np.arange(len(lines) * len(lines[0])).reshape(len(lines), -1)
    first, second = numbers, np.roll(numbers, -1, axis=1)
    if not closed:
        first, second = first[:, :-1], second[:, :-1]
    a, b, c, d = first[:-1], second[:-1], second[1:], first[1:]
    is_even = np.arange(first.shape[1]) % 2 == 0
    triangles = np.stack([a, b, np.where(is_even, c, d)], axis=-1), np.stack([np.where(is_even, a, b), c, d], axis=-1)
    cells, layer = np.stack(triangles, axis=1).reshape(-1, 3), np.repeat(np.arange(1, len(lines)), 2 * first.shape[1])
    named_lines = {**(joints or {}), "outer": len(lines) - 1}
    if centre is None:
        named_lines["inner"] = 0
    else:
        hub = np.full(first.shape[1], len(vertices))
        cells, layer = np.vstack([cells, np.column_stack([hub, first[0], second[0]])]), np.append(layer, 0 * hub)
        vertices = np.vstack([vertices, centre])
    edges = {name: np.column_stack([first[line], second[line]]) for name, line in named_lines.items()}
    if not closed:
        for name, radial in (("start", numbers[:, 0]), ("end", numbers[:, -1])):
            ray = radial if centre is None else np.append(len(vertices) - 1, radial)
            edges[name] = np.column_stack([ray[:-1], ray[1:]])
    first_layer, regions = 0, dict[str, IntArray]()
    for name, line in sorted((joints or {}).items(), key=lambda item: item[1]):
        regions[name] = np.flatnonzero((layer >= first_layer) & (layer <= line))
        first_layer = line + 1
    mesh = TriangleMesh(vertices, cells, edges, regions)
    for name in arcs:
        mesh = mesh.with_arc(name, (0.0, 0.0), float(np.hypot(*vertices[edges[name][0, 0]])))
    return mesh


def arc(radius: float, angles: FloatArray) -> FloatArray:
    """Points (n, 2) on a circle around the origin; points on an axis are exactly on it."""
    points = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.asarray(np.where(np.abs(points) > 1e-15 * radius, points, 0.0))


def radii_between(first: float, last: float, sectors: int) -> FloatArray:
    """Radii in geometric progression that make triangles about as long as wide, with `sectors` in a quarter."""
    return np.geomspace(first, last, max(1, steps_between(first, last, sectors)) + 1)


def steps_between(first: float, last: float, sectors: int) -> int:
    """Number of steps from one radius to another that makes triangles about as long as wide."""
    return round(float(np.log(last / first)) * sectors / (0.5 * np.pi))
