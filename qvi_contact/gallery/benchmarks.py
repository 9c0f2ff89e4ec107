"""Published contact problems of several bodies: rings, a press fit, pins in holes, the corner of a block.

Circles are true arcs.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from qvi_contact.basics.checks import FloatArray, positive_number, whole_number
from qvi_contact.gallery.meshes import arc, fan, radii_between, steps_between
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Symmetry, Traction
from qvi_contact.problem.material import Material, Region
from qvi_contact.problem.problem import ContactProblem

_MOST: Final = 1000  # sectors


def rings(sectors: int = 8, swing: float = 0.0, *, whole: bool = False) -> ContactProblem:
    """Two rings, one in the other, under outer pressure, without friction: Code_Aster's test SSNP167.

    Radii 0.2, 0.6 and 1 m, plane strain, E = 1e9 Pa, ν = 0.2; the pressure p = 1e7 + `swing` cos 2θ acts outside. They
    press on each other by 9.2592593e6 + 1.3571791 `swing` cos 2θ (Lamé; Michell for the second harmonic).

    Parameters
    ----------
    sectors : int
        Edges of each circle in a quarter.
    swing : float
        Amplitude of the second harmonic of the pressure [Pa].
    whole : bool
        All of the rings, the contact "joint" being a closed line, rather than a quarter between lines of symmetry.

    """
    mesh = _nested((0.2, 0.6, 1.0), sectors, 4 if whole else 1, "joint", ("inner", "joint", "outer"))

    def pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        return np.asarray(-1e7 - swing * (x**2 - y**2) / (x**2 + y**2))

    outside = Traction("outer", normal=pressure if swing else -1e7, tangential=0.0)
    conditions: list[Condition] = [Contact.frictionless("joint"), outside, Traction("inner", 0.0, 0.0)]
    return ContactProblem(mesh, Material(1e9, 0.2, "strain"), [*conditions, *_halves(whole)])


def press_fit(sectors: int = 8, friction: float = 0.0, *, whole: bool = False) -> ContactProblem:
    """A shaft in a hub with an interference: the pressure is p = E δ (b² − a²)/(2 a b²) = 61.8 MPa (Lamé).

    Radii a = 25 and b = 50 mm, δ = 0.02 mm, E = 206 000 MPa, ν = 0.3, plane stress. Parameters are those of `rings`,
    and friction.
    """
    mesh = _nested((5.0, 25.0, 50.0), sectors, 4 if whole else 1, "shaft", ("shaft", "outer"), centre=(0.0, 0.0))
    contact = Contact("shaft", friction=friction, gap=-0.02)
    outside = Traction("outer", normal=0.0, tangential=0.0)
    return ContactProblem(mesh, Material(206e3, 0.3), [contact, outside, *_halves(whole)])


def press_fit_torque(
    friction: float, torque: float = 0.0, *, turn: float | None = None, sectors: int = 4
) -> ContactProblem:
    """A hollow shaft in a hub with an interference, twisted: it slips at the torque 2π μ p R².

    As `press_fit`, with a bore of radius 5 mm in the shaft: p = 59.927 MPa (Lamé). The torque acts as shear in that
    bore, and the outside of the hub is kept from turning.

    Parameters
    ----------
    friction : float
        Coefficient of friction μ.
    torque : float
        Counterclockwise, for a unit of thickness [N mm/mm].
    turn : float, optional
        Displacement along the bore instead of a torque [mm].
    sectors : int
        Edges of each circle in a quarter.

    """
    mesh = _nested((5.0, 25.0, 50.0), sectors, 4, "shaft", ("shaft", "outer", "inner"))
    shear = torque / (2.0 * np.pi * 5.0**3)
    bore: list[Condition] = [Traction("inner", x=lambda _, y: -shear * y, y=lambda x, _: shear * x)]
    if turn is not None:  # tangents of edges point to the right
        bore = [Traction("inner", normal=0.0), Displacement("inner", tangential=lambda _, y: -turn * np.sign(y))]
    held: list[Condition] = [Displacement("outer", tangential=0.0), Traction("outer", normal=0.0)]
    return ContactProblem(mesh, Material(206e3, 0.3), [Contact("shaft", friction=friction, gap=-0.02), *held, *bore])


def _halves(whole: bool) -> list[Condition]:
    return [] if whole else [Symmetry("start"), Symmetry("end")]


def cylinder_in_bore(
    sectors: int = 16, friction: float = 0.0, *, extent: float = 100.0, share: float = 1.0
) -> ContactProblem:
    """A cylinder in the bore of a very large plate, pressed to one side by its axis: Persson's problem.

    Radii 60 and 59.99 mm, both E = 210 000 MPa, ν = 0.3, plane stress, 1875 N/mm along x. Without friction the contact
    is |θ| < 59.298° under the pressure of `persson_pressure`; Code_Aster's test SSNV127 has μ = 0.4. The upper half is
    taken, y = 0 being a line of symmetry. The load, which the closed form has on the axis of the cylinder, is spread
    over |x| < 1.2: the difference is 4e-5 of the pressure, and grows with the square of that length.

    Parameters
    ----------
    sectors : int
        Edges of the circle in a quarter.
    friction : float
        Coefficient of friction μ.
    extent : float
        Radius at which the plate is held, over that of the bore.
    share : float
        Part of the load.

    """
    radii = 1.2, 60.0, 60.0 * positive_number("extent", extent)
    mesh = _loaded(_nested(radii, sectors, 2, "bore", ("bore", "outer"), centre=(0.0, 0.0)), 1.2)
    contact = Contact("bore", friction=friction, gap=0.01)
    held = Displacement("outer", x=0.0, y=0.0)
    return ContactProblem(mesh, Material(210e3, 0.3), [contact, held, *_pulled(share * 1875.0 / 2.0, 1.2)])


def persson_pressure(angle: ArrayLike) -> FloatArray:
    """Pressure [MPa] in `cylinder_in_bore` without friction at an angle θ from the direction of the load [rad].

    With b = tan(α/2), α = 59.298°, y = tan(θ/2), s = √(b² − y²), r = √(1 + b²), and the force Q on the radius R,

        p R/Q = 2 s/(π r (1 + y²)) + ln((r + s)/(r − s))/(2π b² r²);

    zero for |θ| > α. A. Persson, On the stress distribution of cylindrical elastic bodies in contact, Chalmers, 1964.
    """
    b, y = np.tan(np.deg2rad(59.298) / 2.0), np.tan(np.asarray(angle, dtype=float) / 2.0)
    s, r = np.sqrt(np.maximum(b**2 - y**2, 0.0)), np.sqrt(1.0 + b**2)
    near = 2.0 * s / (np.pi * r * (1.0 + y**2))
    return np.asarray(1875.0 / 60.0 * (near + np.log((r + s) / (r - s)) / (2.0 * np.pi * b**2 * r**2)))


def loaded_pin(sectors: int = 16, friction: float = 0.1) -> ContactProblem:
    """An elastic pin in the eye of a sheet, pulled away from its clamped end: NAFEMS R0094-4, Code_Aster's SSNP156.

    Hole and pin of radius 50 mm without clearance, eye of radius 100, sheet 200 high and clamped 200 from the centre.
    Plane strain, sheet E = 70 000 MPa, pin 210 000, ν = 0.3, μ = 0.1, 20 000 N/mm along x at the pin's centre. The
    upper half is taken. The load is spread over a fifth of the diameter: one at a point would do infinite work.

    Where the axis meets the hole, at (50, 0), the sheet slips along the pin to both sides. The shear traction changes
    its sign there, so that the stresses at this very point depend on the mesh: σ_xx is −155 MPa on equal edges and
    −148 where they are graded to it. Displacements do not, u_x = 0.7387 mm.

    Parameters
    ----------
    sectors : int
        Edges of the hole in a quarter.
    friction : float
        Coefficient of friction μ.

    """
    corner = np.arctan2(1.0, -2.0)
    count = whole_number("sectors", sectors, _MOST)
    steep = max(1, round(count * (np.pi - corner) / (0.5 * np.pi)))
    parts = [(0.0, 0.5 * np.pi, count), (0.5 * np.pi, corner, max(1, count - steep)), (corner, np.pi, steep)]
    angles = np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in parts] + [[np.pi]])
    with np.errstate(divide="ignore"):
        sheet_edge = np.minimum(100.0 / np.abs(np.sin(angles)), 200.0 / np.abs(np.cos(angles)))
    edge = np.where(angles <= 0.5 * np.pi, 100.0, sheet_edge)
    first = radii_between(10.0, 50.0, sectors)
    steps = max(2, steps_between(50.0, 100.0, count))
    shares = np.linspace(0.0, 1.0, steps + 1)[1:, None]
    lines = [arc(radius, angles) for radius in first]
    unit = arc(1.0, angles)
    lines += [unit * (50.0 ** (1.0 - share) * edge**share)[:, None] for share in shares]
    mesh = fan(lines, closed=False, centre=(0.0, 0.0), joints={"pin": len(first) - 1}, arcs=("pin",))
    mesh = _loaded(mesh, 10.0)
    mesh = mesh.with_edges("wall", lambda x, _: x < -199.999)
    mesh = mesh.with_edges("free", lambda x, y: (y > 0.0) & (x > -199.999) & (x < 0.0))
    mesh = mesh.with_edges("eye", lambda x, y: (y > 0.0) & (x > 0.0)).with_arc("eye", (0.0, 0.0), 100.0)
    sheet, pin = Material(7e4, 0.3, "strain"), Material(21e4, 0.3, "strain")
    conditions: list[Condition] = [
        Contact("pin", friction=friction),
        Displacement("wall", 0.0, 0.0),
        *(Traction(name, normal=0.0, tangential=0.0) for name in ("eye", "free")),
        *_pulled(1e4, 10.0),
    ]
    return ContactProblem(mesh, sheet, conditions, regions=[Region(pin, name="pin")])


def _loaded(mesh: TriangleMesh, half: float) -> TriangleMesh:
    """The mesh with the part |x| < half of the line y = 0 called "load", and the rest of it "axis"."""
    return mesh.with_edges("load", lambda x, y: (y == 0.0) & (np.abs(x) < half)).with_edges(
        "axis", lambda x, y: (y == 0.0) & (np.abs(x) > half)
    )


def _pulled(force: float, half: float) -> list[Condition]:
    """Symmetry about y = 0, and a force on the upper half along x, spread over |x| < half."""
    return [Symmetry("axis"), Displacement("load", y=0.0), Traction("load", x=force / (2.0 * half))]


def block_corner(friction: float | None, cells: int = 4, depth: int = 0) -> ContactProblem:
    """A square block on a large block of the same material: stresses σ ~ r^(λ−1) in the corners of the contact.

    The block is [−1, 1] × [0, 2], the other [−4, 4] × [−4, 0]. Its top is pressed down by 1e-3; λ is
    `CORNER_EXPONENTS`[μ]. With friction the top is moved to the right by 1e-2 as well, so that all of the base slips:
    this is λ of the leading corner at x = 1. Without friction, and for `friction` None, which makes both bodies one,
    nothing else is singular: top and bottom are free to move along. Plane strain, E = 1, ν = 0.3.

    Parameters
    ----------
    friction : float or None
        Coefficient of friction μ; None for bodies that stick.
    cells : int
        Cells along a length of 1.
    depth : int
        How often the triangles at x = 1 are halved in size.

    """
    count = whole_number("cells", cells, _MOST)
    x, y = np.linspace(-4.0, 4.0, 8 * count + 1), np.linspace(-4.0, 2.0, 6 * count + 1)
    middle_x, middle_y = (x[1:] + x[:-1]) / 2.0, (y[1:] + y[:-1]) / 2.0
    body = (middle_y < 0.0)[:, None] | (np.abs(middle_x) < 1.0)[None]
    mesh = TriangleMesh.grid(
        x,
        y,
        body,
        edges={"roof": ((-1.0, 2.0), (1.0, 2.0)), "ground": lambda x, y: (y == 0.0) & (np.abs(x) > 1.0)},
        joints={"base": ((-1.0, 0.0), (1.0, 0.0))},
    )
    mesh = mesh.graded([(1.0, 0.0)], depth)
    contact = Contact.tied("base") if friction is None else Contact("base", friction=friction)
    free = [Traction(name, 0.0, 0.0) for name in ("left", "right", "ground")]
    held: list[Condition] = [Displacement("roof", y=-1e-3), Traction("roof", x=0.0), Symmetry("bottom")]
    if friction:
        held = [Displacement("roof", x=1e-2, y=-1e-3), Displacement("bottom", 0.0, 0.0)]
    conditions: list[Condition] = [contact, *held, *free]
    return ContactProblem(mesh, Material(1.0, 0.3, "strain"), conditions)


CORNER_EXPONENTS: Final = {None: 0.544484, 0.0: 0.7740, 0.1: 0.7249, 0.3: 0.6380, 0.5: 0.5604}
"""λ of `block_corner` by friction; None for bodies that stick."""


def _nested(
    radii: tuple[float, float, float],
    sectors: int,
    quarters: int,
    joint: str,
    arcs: Sequence[str],
    centre: tuple[float, float] | None = None,
) -> TriangleMesh:
    """A ring, or a disc if it has a centre, and the ring around it, on so many quarters; see `fan`."""
    count, (inner, between, outer) = quarters * whole_number("sectors", sectors, _MOST), radii
    angles = np.linspace(0.0, quarters * 0.5 * np.pi, count + 1)
    angles = angles[:-1] if quarters == 4 else angles  # of a whole circle without its end
    first, second = radii_between(inner, between, sectors), radii_between(between, outer, sectors)
    lines = [arc(radius, angles) for radius in (*first, *second[1:])]
    return fan(lines, closed=quarters == 4, centre=centre, joints={joint: len(first) - 1}, arcs=arcs)
