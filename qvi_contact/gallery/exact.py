"""Problems whose answers are known in closed form: elastic states of one block, and limits of many with dry joints.

Airy functions of degree 4 reproduce the elastic states exactly. They verify every part of the discretisation at once:
whatever conditions are put on the sides, the computed stress must be the exact one up to round-off.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, Field, FloatArray, finite_number, positive_number, whole_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.grid import SIDES
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Symmetry, Traction
from qvi_contact.problem.fields import Polynomial
from qvi_contact.problem.material import Material, Plane
from qvi_contact.problem.problem import ContactProblem

__all__ = [
    "DOOR_AND_WINDOW", "ExactState", "cantilever", "gravity_column", "jointed_slope", "masonry_wall",
    "problem_from_state", "pure_bending", "sliding_block", "stick_slip_block", "uniform",
]  # fmt: skip


@dataclass(frozen=True)
class ExactState:
    """Stress and displacement of an elastic body in equilibrium with b = −∇φ."""

    stress: Callable[[FloatArray, FloatArray], FloatArray]
    """(x, y) arrays of shape s to σ_xx, σ_yy, σ_xy of shape (3, *s) [stress]."""
    displacement: Callable[[FloatArray, FloatArray], FloatArray]
    """(x, y) arrays to u_x, u_y of shape (2, *s) [length]."""
    potential: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: np.zeros(np.broadcast(x, y).shape)
    """φ(x, y) [stress]."""

    def traction(self, side: str, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component 0 (x) or 1 (y) of σn on a side of a rectangle, as a function of (x, y)."""
        axis, sign = {"bottom": (1, -1.0), "right": (0, 1.0), "top": (1, 1.0), "left": (0, -1.0)}[side]
        entry = axis if axis == component else 2
        return lambda x, y: sign * self.stress(x, y)[entry]

    def displaced(self, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component of the displacement as a function of (x, y)."""
        return lambda x, y: self.displacement(x, y)[component]


def uniform(material: Material, xx: float = 0.0, yy: float = 0.0, xy: float = 0.0) -> ExactState:
    """Uniform stress; Φ = σ_xx y²/2 + σ_yy x²/2 − σ_xy xy."""
    strain = material.compliance @ np.array([xx, yy, xy])
    return ExactState(
        lambda x, y: np.stack(np.broadcast_arrays(xx + 0 * x, yy + 0 * y, xy + 0 * x)),
        lambda x, y: np.stack([strain[0] * x + strain[2] * y, strain[1] * y]),
    )


def pure_bending(material: Material, curvature: float) -> ExactState:
    """σ_xx = m y with m = `curvature` [stress / length]; Φ = m y³/6."""
    a, b = material.compliance[0, :2]
    return ExactState(
        lambda x, y: np.stack([curvature * y + 0 * x, 0 * x, 0 * x]),
        lambda x, y: curvature * np.stack([a * x * y, (b * y**2 - a * x**2) / 2]),
    )


def cantilever(material: Material, gradient: float, shear: float) -> ExactState:
    """Timoshenko's end-loaded cantilever: σ_xx = k x y, σ_xy = −τ − k y²/2; Φ = τ x y + k x y³/6.

    Sides y = ±√(−2τ/k) are free. With c11 = a, c12 = b, c33 = s,
    u_x = a k x² y/2 − s τ y − (s + b) k y³/6, u_y = b k x y²/2 − a k x³/6.
    """
    a, b = material.compliance[0, :2]
    s = material.compliance[2, 2]
    k = gradient
    return ExactState(
        lambda x, y: np.stack([k * x * y, 0 * x, -shear - k * y**2 / 2 + 0 * x]),
        lambda x, y: np.stack(
            [a * k * x**2 * y / 2 - s * shear * y - (s + b) * k * y**3 / 6, b * k * x * y**2 / 2 - a * k * x**3 / 6]
        ),
    )


def gravity_column(material: Material, weight: float, height: float) -> ExactState:
    """Column under its own weight with a free top at y = height: φ = γ y, σ_yy = γ (y − height); γ = ρ g."""
    a, b = material.compliance[0, :2]
    return ExactState(
        lambda x, y: np.stack([0 * x, weight * (y - height) + 0 * x, 0 * x]),
        lambda x, y: weight * np.stack([b * x * (y - height), a * (y**2 / 2 - height * y) - b * x**2 / 2]),
        lambda x, y: weight * y + 0 * x,
    )


def problem_from_state(
    state: ExactState,
    mesh: TriangleMesh,
    material: Material,
    sides: Mapping[str, str],
    contacts: tuple[Condition, ...] = (),
) -> ContactProblem:
    """A problem whose answer is the state, on a full rectangle with the names of sides of `TriangleMesh.grid`.

    The material is that of the state. `sides` has for each side two letters, for components x and y: "t" takes the
    traction, "u" the displacement from the state; "cc" leaves the side to the conditions in `contacts`.
    """
    conditions: list[Condition] = list(contacts)
    for side in SIDES:
        kinds = sides.get(side, "")
        if len(kinds) != 2 or (set(kinds) - {"t", "u"} and kinds != "cc"):
            raise InputError(f"sides[{side!r}]", kinds, "give two letters of 't' and 'u', or 'cc'")
        for component, kind in enumerate(kinds):
            if kind == "c":
                continue
            value: Field = state.traction(side, component) if kind == "t" else state.displaced(component)
            condition = Traction if kind == "t" else Displacement
            conditions.append(condition(side, x=value) if component == 0 else condition(side, y=value))
    return ContactProblem(mesh, material, conditions, state.potential)


_BLOCK_SIDES: Final = {"bottom": "cc", "right": "uu", "top": "tt", "left": "tt"}


def sliding_block(
    cells: tuple[int, int] = (3, 2), plane: Plane = "stress", grading: float = 1.0
) -> tuple[ContactProblem, ExactState]:
    """A block that slips on its whole base in a uniform stress state, with the exact answer.

    On [0, 2] × [0, 1] the stress is σ_xx = −20, σ_yy = −p = −100, σ_xy = μp, with μ = 0.3, E = 1000, ν = 0.3. The base
    y = 0 is the contact "base" with g = w = 0; top and left side carry the tractions of the state; the right side gets
    its displacement u_x = γ y + U₀ + ε_xx (x − 2), u_y = ε_yy y, with γ = c33 μp and U₀ = 0.5. The base slips by
    U₀ + ε_xx (x − 2).
    """
    width, friction, pressure, side_stress, translation = 2.0, 0.3, 100.0, -20.0, 0.5
    material = Material(1000.0, 0.3, plane)
    held = uniform(material, side_stress, -pressure, friction * pressure)

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        along, across = held.displacement(x - width, y)
        return np.stack([along + translation, across])

    state = ExactState(held.stress, displacement)
    mesh = TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", friction=friction, name="base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state


def stick_slip_block(
    cells: tuple[int, int] = (4, 3),
    transition: float = 1.0,
    plane: Plane = "stress",
    pressure_drop: float = 0.0,
    shear: float = 30.0,
    slip: float = 0.02,
    rotation: float = 0.0,
    lift: float = 0.0,
    grading: float = 1.0,
) -> tuple[ContactProblem, ExactState]:
    """A block whose curved base sticks for x < x_t and slips beyond, with the exact answer.

    On [0, 2] × [0, 1], with E = 1000, ν = 0.3 and p = 100, the stress function is Φ = −p x²/2 + a x³ y +
    k (x⁴ − 3x²y²)/12, with a = `shear`/12 and k = `pressure_drop`/4, as σ_T is `shear` at x = 2 and the pressure loses
    `pressure_drop` up to there:

        σ_xx = −k x²/2,    σ_yy = −p + 6a x y + k (x² − y²/2),    σ_xy = −3a x² + k x y.

    With the compliance c (see `Material`; c33 = 2 (c11 − c12)), `rotation` c₀ and `lift` d, which move body and
    obstacle together, the displacement is

        u_x = c12 (3a x² y − p x) − c11 a y³ + k ((2 c12 − c11) x³ − 3 c12 x y²)/6 + c₀ y
        u_y = c11 (3a x y² − p y) − (c33 + c12) a x³ + k ((2 c11 − c12) x² y/2 − c11 y³/6) − c₀ x + d.

    The base y = 0 with outward normal −y is the contact "base". There σ_N = −p + k x², σ_T = −σ_xy = 3a x² ≥ 0, and in
    plane stress with k = 0 u_T = ν p x/E, u_y = −(2+ν) a x³/E − c₀ x + d. The obstacle touches everywhere, g = u_N =
    −u_y, and friction and offset are

        μ = 3a max(x, x_t)²/(p − k x²),    w = u_T + A max(x − x_t, 0)²,

    so that left of the `transition` x_t the bound 3a x_t² exceeds σ_T and nothing slips, and right of it σ_T is at the
    bound and u_T − w = −A (x − x_t)², opposite in sign to σ_T, and −`slip` at x = 2. Bound and slip are continuous in
    x_t and leave it with different rates, so that every other point is clearly in one state. The side x = 0 is free,
    the top carries the tractions of the state, the right side its displacement.

    Elements of degree 4 contain Φ. As friction varies, the law holds at Gauss points; they integrate the data, so that
    the discrete solution is the exact stress on every mesh, even if x_t is inside an edge. Only the slip, which is
    projected on polynomials, depends on the mesh.
    """
    width, pressure = 2.0, 100.0
    for name, value in (("shear", shear), ("slip", slip)):
        positive_number(name, value)
    if not 0.0 < finite_number("transition", transition) < width:
        raise InputError("transition", transition, f"give a number between 0 and the width {width:g}")
    if finite_number("pressure_drop", pressure_drop) >= pressure:
        raise InputError("pressure_drop", pressure_drop, f"give less than the pressure {pressure:g}")
    material, p, k, a = Material(1000.0, 0.3, plane), pressure, pressure_drop / width**2, shear / (3 * width**2)
    (c11, c12, _), c33 = material.compliance[0], material.compliance[2, 2]

    def stress(x: FloatArray, y: FloatArray) -> FloatArray:
        xx = -k * x**2 / 2 + 0 * y
        yy = -p + 6 * a * x * y + k * (x**2 - y**2 / 2)
        return np.stack([xx, yy, -3 * a * x**2 + k * x * y])

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        along = c12 * (3 * a * x**2 * y - p * x) - c11 * a * y**3 + rotation * y
        across = c11 * (3 * a * x * y**2 - p * y) - (c33 + c12) * a * x**3 - rotation * x + lift
        along = along + k * ((2 * c12 - c11) * x**3 - 3 * c12 * x * y**2) / 6
        return np.stack([along, across + k * ((2 * c11 - c12) * x**2 * y / 2 - c11 * y**3 / 6)])

    def bound_over_pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        bound = shear * (np.maximum(x, transition) / width) ** 2
        return np.asarray(bound / (pressure - pressure_drop * (x / width) ** 2) + 0 * y)

    def offset(x: FloatArray, y: FloatArray) -> FloatArray:
        beyond = np.maximum(x - transition, 0.0) / (width - transition)
        return np.asarray(displacement(x, y)[0] + slip * beyond**2)

    state, mesh = ExactState(stress, displacement), TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", bound_over_pressure, lambda x, y: -displacement(x, y)[1], offset, "base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state


# bodies of many blocks: a masonry wall with openings, and a jointed rock slope


Opening: TypeAlias = Sequence[int]
"""Half blocks left of it, courses below it, its width in half blocks, and its height in courses."""

DOOR_AND_WINDOW: Final[tuple[Opening, ...]] = ((3, 0, 2, 4), (8, 2, 3, 3))
"""The openings of `masonry_wall`."""

_MOST: Final = 200  # courses, blocks a course, or blocks along the face
_BLOCK, _COURSE = 0.5, 0.25  # length and height of a block [m]
_WATER: Final = 10.0  # weight of water [kN/m³]
_HEIGHT: Final = 12.0  # of the slope [m]


def masonry_wall(
    courses: int = 8,
    blocks: int = 6,
    openings: Sequence[Opening] = DOOR_AND_WINDOW,
    *,
    friction: float = 0.6,
    cohesion: float = 0.0,
    wind: float = 2.0,
) -> ContactProblem:
    """A wall of blocks in running bond with openings, under its weight and wind from the left, in its plane.

    Blocks are 0.5 m long and 0.25 m high, with γ = 20 kN/m³, E = 5 GPa, ν = 0.2, in plane stress. Head joints of each
    course lie over the middle of the blocks below; half blocks fill the ends. A lintel, one course high and resting on
    half a block at each side, spans each opening. All joints are unilateral contacts with the same friction and
    cohesion [kPa]: "beds", "heads", and "ground" below the wall. Loads are "body" (weight), and "wind" on the left side
    [kPa]. Openings are as `Opening` says; lintels must lie inside the wall, apart from other openings and lintels.

    Without openings and cohesion, a wall of n blocks of the length a in each course slides at the wind μ γ n a, along
    every bed alike. A stack of single blocks of the total height h tips at γ a²/h if friction holds.
    """
    active, heads = _bond(whole_number("courses", courses, _MOST), 2 * whole_number("blocks", blocks, _MOST), openings)
    mesh = _wall_mesh(active, heads)
    joints = [Contact(name, friction, cohesion=cohesion) for name in ("ground", *mesh.joint_names)]
    loads: list[Condition] = [
        Traction("windward", x=finite_number("wind", wind), y=0.0, name="wind"),
        *(Traction(name, x=0.0, y=0.0) for name in ("top", "free")),
    ]
    material, weight = Material(5e6, 0.2, "stress"), Polynomial([[0.0, 20.0]])
    return ContactProblem(mesh, material, [*joints, *loads], body_potential=weight)


def _bond(courses: int, halves: int, openings: Sequence[Opening]) -> tuple[BoolArray, BoolArray]:
    """Which half blocks there are, (courses, halves), and where head joints are, (courses, halves + 1)."""
    active, taken = np.ones((courses, halves), dtype=bool), np.zeros((courses, halves), dtype=bool)
    row, line = np.meshgrid(np.arange(courses), np.arange(halves + 1), indexing="ij")
    heads = (row + line) % 2 == 0
    for opening in openings:
        if len(opening) != 4:
            raise InputError("openings", opening, "give four numbers: half blocks left, courses below, width, height")
        bottom = opening[1] and whole_number("openings", opening[1], _MOST)
        left, across, up = (whole_number("openings", opening[k], 2 * _MOST) for k in (0, 2, 3))
        right, top = left + across, bottom + up
        if right >= halves or top >= courses:
            raise InputError("openings", opening, "leave half a block at each side and a course above for the lintel")
        space = (slice(bottom, top + 1), slice(left - 1, right + 1))
        if taken[space].any():
            raise InputError("openings", opening, "leave half a block between openings, and a course between lintels")
        taken[space] = True
        active[bottom:top, left:right] = False
        heads[top, left : right + 1] = False
        heads[top, [left - 1, right + 1]] = True
    return active, heads


def _wall_mesh(active: BoolArray, heads: BoolArray) -> TriangleMesh:
    """Half blocks as two triangles each, with joints and names."""
    rows, halves = active.shape
    cut = TriangleMesh.grid(np.arange(halves + 1) * _BLOCK / 2.0, np.arange(rows + 1) * _COURSE, active)
    mesh = TriangleMesh(cut.vertices, cut.cells)
    outside, (line, row) = mesh.topology.boundary, (mesh.midpoints / (_BLOCK / 2.0, _COURSE)).T
    place = np.minimum(row.astype(np.int64), rows - 1), line.astype(np.int64)
    named = {"beds": ~outside & (row % 1.0 == 0.0), "heads": ~outside & (line % 1.0 == 0.0) & heads[place]}
    named |= {"ground": outside & (row == 0.0), "windward": outside & (line == 0.0), "top": outside & (row == rows)}
    named["free"] = outside & ~np.any(list(named.values()), axis=0)
    return _with_names(mesh, named)


def _with_names(mesh: TriangleMesh, named: dict[str, BoolArray]) -> TriangleMesh:
    """The mesh with those joints and parts of the boundary, masks (e,) of edges, that there are."""
    return replace(mesh, edge_sets={name: mesh.topology.ends[chosen] for name, chosen in named.items() if chosen.any()})


def jointed_slope(
    rows: int = 6,
    crest: int = 2,
    *,
    dip: float = 30.0,
    friction: float = 0.7,
    cohesion: float = 0.0,
    crack_water: float = 1.0,
) -> ContactProblem:
    """A rock slope whose bedding planes dip out of its face, cut by cross joints, with water in a tension crack.

    The face rises to 12 m, twice as steeply as the bedding: tan ψ = 2 tan β. Bedding planes meet it at the toe and at
    equal distances above; vertical cross joints divide the layers into blocks, staggered from layer to layer. The crack
    is vertical, behind the crest, and as deep as the lowest bedding plane is there. The rock is in plane strain, with
    γ = 25 kN/m³, E = 10 GPa, ν = 0.25. The contacts are "bedding" and "cross joints"; loads are "body" (weight) and
    "water" in the crack.

    There are so many rows of bedding planes, and blocks along the face. The crest is so many columns long, fewer than
    `rows`, each as wide as the run of the face between two bedding planes. The angle β [°] is `dip`, from 5 to 60. The
    water weighs `crack_water` times 10 kN/m³; 0 leaves the crack dry. Friction and cohesion [kPa] are those of joints.

    With the weight W above the lowest plane, its length L, the depth z of the crack, and the thrust V = γ_w z²/2 of the
    water, everything above that plane slides at the multiple α of V where

        W sin β + α V cos β = c L + μ (W cos β − α V sin β).

    Without water and cohesion the factor of safety is tan φ/tan β, μ = tan φ: blocks of any layer slide when μ is
    divided by it. E. Hoek and J. W. Bray, Rock Slope Engineering, plane failure.
    """
    columns = whole_number("rows", rows, _MOST) + whole_number("crest", crest, _MOST)
    if crest >= rows:
        raise InputError("crest", crest, f"give less than rows = {rows}: the lowest plane must end in the crack")
    if not 5.0 <= finite_number("dip", dip) <= 60.0:
        raise InputError("dip", dip, "give an angle from 5 to 60 degrees")
    rise = _HEIGHT / (2.0 * rows)
    run = rise / float(np.tan(np.radians(dip)))
    water = _WATER * finite_number("crack_water", crack_water)
    conditions: list[Condition] = [
        *(Contact(name, friction, cohesion=cohesion) for name in ("bedding", "cross joints")),
        Traction("crack", normal=Polynomial([[-water * _HEIGHT, water]]), tangential=0.0, name="water"),
        *(Traction(side, x=0.0, y=0.0) for side in ("bench", "face", "crest")),
        *(Symmetry(side) for side in ("front", "rear")),
        Displacement("underground", x=0.0, y=0.0),
    ]
    mesh, material = _slope_mesh(rows, columns, (run, rise)), Material(1e7, 0.25, "strain")
    return ContactProblem(mesh, material, conditions, body_potential=Polynomial([[0.0, 25.0]]))


def _slope_mesh(rows: int, columns: int, size: tuple[float, float]) -> TriangleMesh:
    """Triangles on a grid (i, j) of columns and rises: bedding planes are j − i = const., the face is j = 2 i."""
    before = -max(rows // 2, 1)  # columns in front of the toe, and rises below it
    cells = list[tuple[tuple[int, int], ...]]()
    for i in range(before, columns):
        top = min(max(2 * i, 0), 2 * rows)
        for j in range(before, top):
            cells += [((i, j), (i + 1, j), (i + 1, j + 1)), ((i, j), (i + 1, j + 1), (i, j + 1))]
        if 0 <= i < rows:
            foot = (i + 1, top + 1)
            cells += [((i, top), (i + 1, top), foot), ((i, top), foot, (i + 1, top + 2))]
    places, numbers = np.unique(np.array(cells).reshape(-1, 2), axis=0, return_inverse=True)
    mesh = TriangleMesh(places * size, numbers.reshape(-1, 3))
    i, j = places[mesh.topology.ends].transpose(2, 0, 1)
    layer, outside = (j - i).min(axis=1), mesh.topology.boundary
    above = (layer >= 0) & (i >= 0).all(axis=1)
    bedding = above & (np.ptp(j - i, axis=1) == 0)
    cross = above & (np.ptp(i, axis=1) == 0) & ((i[:, 0] + layer) % 2 == 0)
    named: dict[str, BoolArray] = {"bedding": bedding & ~outside, "cross joints": cross & ~outside}
    end = (i == columns).all(axis=1)
    named["crack"] = end & (j >= columns).all(axis=1)
    named["rear"] = end & ~named["crack"]
    named["front"] = (i == before).all(axis=1)
    named["underground"] = (j == before).all(axis=1)
    named["bench"] = (j == 0).all(axis=1) & (i <= 0).all(axis=1) & outside
    named["crest"] = (j == 2 * rows).all(axis=1)
    named["face"] = (j == 2 * i).all(axis=1) & outside
    return _with_names(mesh, named)
