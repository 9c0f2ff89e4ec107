"""Problems with solutions in closed form: elastic states of one block, and limit loads of many blocks with dry joints.

Airy functions of degree 4 reproduce the elastic states exactly. These states verify every part of the discretisation at
once: with any conditions on the sides the computed stress must be the exact one up to rounding.
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
    """σ_xx, σ_yy, σ_xy (3, *s) [stress] as a function of arrays (x, y) of shape s."""
    displacement: Callable[[FloatArray, FloatArray], FloatArray]
    """u_x, u_y (2, *s) [length] as a function of arrays (x, y) of shape s."""
    potential: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: np.zeros(np.broadcast(x, y).shape)
    """φ(x, y) [stress]."""

    def traction(self, side: str, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component 0 (x) or 1 (y) of σn on a side of a rectangle, as a function of (x, y)."""
        axis, sign = {"bottom": (1, -1.0), "right": (0, 1.0), "top": (1, 1.0), "left": (0, -1.0)}[side]
        entry = axis if axis == component else 2
        return lambda x, y: sign * self.stress(x, y)[entry]

    def displaced(self, component: int) -> Callable[[FloatArray, FloatArray], FloatArray]:
        """Component 0 (x) or 1 (y) of the displacement as a function of (x, y)."""
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

    The sides y = ±√(−2τ/k) are free. With k = `gradient`, τ = `shear`, c11 = a, c12 = b, c33 = s,
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
    """Column under its own weight with a free top at y = height: φ = γ y, σ_yy = γ (y − height), γ = `weight` = ρ g."""
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
    """A problem with the state as its solution, on a rectangle with the names of sides of `TriangleMesh.grid`.

    The material is that of the state. `sides` has two letters for each side, for the components x and y: "t" prescribes
    the traction of the state, "u" its displacement; "cc" leaves the side to the conditions in `contacts`.
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
    """A block that slips on its whole base in a uniform stress state, with the exact solution.

    On [0, 2] × [0, 1] the stress is σ_xx = −20, σ_yy = −p = −100, σ_xy = μp, with μ = 0.3, E = 1000, ν = 0.3. The base
    y = 0 is the contact "base" with g = w = 0. The top and the left side carry the tractions of the state. The right
    side has the displacement u_x = γ y + U₀ + ε_xx (x − 2), u_y = ε_yy y of the state, with γ = c33 μp and U₀ = 0.5.
    The base slips by U₀ + ε_xx (x − 2).
    """
    width, friction, pressure, side_stress, translation = 2.0, 0.3, 100.0, -20.0, 0.5
    material = Material(1000.0, 0.3, plane)
    uniform_state = uniform(material, side_stress, -pressure, friction * pressure)

    def displacement(x: FloatArray, y: FloatArray) -> FloatArray:
        u_x, u_y = uniform_state.displacement(x - width, y)
        return np.stack([u_x + translation, u_y])

    state = ExactState(uniform_state.stress, displacement)
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
    """A block whose base sticks for x < x_t and slips beyond, with the exact solution.

    On [0, 2] × [0, 1], with E = 1000, ν = 0.3 and p = 100, the stress function is Φ = −p x²/2 + a x³ y +
    k (x⁴ − 3x²y²)/12. At x = 2 σ_T is `shear` and the pressure is smaller than p by `pressure_drop`, so a = `shear`/12,
    k = `pressure_drop`/4 and

        σ_xx = −k x²/2,    σ_yy = −p + 6a x y + k (x² − y²/2),    σ_xy = −3a x² + k x y.

    With the compliance c (see `Material`; c33 = 2 (c11 − c12)), and with `rotation` c₀ and `lift` d, which move the
    body and the obstacle together, the displacement is

        u_x = c12 (3a x² y − p x) − c11 a y³ + k ((2 c12 − c11) x³ − 3 c12 x y²)/6 + c₀ y
        u_y = c11 (3a x y² − p y) − (c33 + c12) a x³ + k ((2 c11 − c12) x² y/2 − c11 y³/6) − c₀ x + d.

    The base y = 0 with outward normal −y is the contact "base". There σ_N = −p + k x², σ_T = −σ_xy = 3a x² ≥ 0, and in
    plane stress with k = 0 u_T = ν p x/E, u_y = −(2+ν) a x³/E − c₀ x + d. The obstacle touches everywhere, g = u_N =
    −u_y, and friction and offset are

        μ = 3a max(x, x_t)²/(p − k x²),    w = u_T + A max(x − x_t, 0)²,

    Left of the `transition` x_t the bound 3a x_t² exceeds σ_T, and the base sticks. Right of it σ_T is at the bound and
    u_T − w = −A (x − x_t)², with the sign opposite to σ_T and −`slip` at x = 2. Bound and slip are continuous at x_t,
    but grow with different powers from there, so that every other point is clearly in one state. The side x = 0 is
    free, the top has the tractions of the state, the right side its displacement.

    Elements of degree 4 contain Φ. As the friction varies, the law holds at Gauss points, which also integrate the
    data. So the discrete solution is the exact stress on every mesh, even if x_t is inside an edge. Only the slip,
    which is projected on polynomials, depends on the mesh.
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
        u_x = c12 * (3 * a * x**2 * y - p * x) - c11 * a * y**3 + rotation * y
        u_y = c11 * (3 * a * x * y**2 - p * y) - (c33 + c12) * a * x**3 - rotation * x + lift
        u_x = u_x + k * ((2 * c12 - c11) * x**3 - 3 * c12 * x * y**2) / 6
        return np.stack([u_x, u_y + k * ((2 * c11 - c12) * x**2 * y / 2 - c11 * y**3 / 6)])

    def bound_over_pressure(x: FloatArray, y: FloatArray) -> FloatArray:
        bound = shear * (np.maximum(x, transition) / width) ** 2
        return np.asarray(bound / (pressure - pressure_drop * (x / width) ** 2) + 0 * y)

    def offset(x: FloatArray, y: FloatArray) -> FloatArray:
        slip_zone = np.maximum(x - transition, 0.0) / (width - transition)
        return np.asarray(displacement(x, y)[0] + slip * slip_zone**2)

    state, mesh = ExactState(stress, displacement), TriangleMesh.rectangle(cells, width, 1.0, grading=grading)
    base = Contact("bottom", bound_over_pressure, lambda x, y: -displacement(x, y)[1], offset, "base")
    return problem_from_state(state, mesh, material, _BLOCK_SIDES, (base,)), state


# bodies of many blocks: a masonry wall with openings, and a jointed rock slope


Opening: TypeAlias = Sequence[int]
"""Number of half blocks to its left, of courses below it, its width in half blocks, and its height in courses."""

DOOR_AND_WINDOW: Final[tuple[Opening, ...]] = ((3, 0, 2, 4), (8, 2, 3, 3))
"""The openings of `masonry_wall`."""

_MOST: Final = 200  # of courses, of blocks in a course, and of blocks along the face
_BLOCK_LENGTH, _COURSE_HEIGHT = 0.5, 0.25  # length and height of a block [m]
_WATER_WEIGHT: Final = 10.0  # weight of water [kN/m³]
_SLOPE_HEIGHT: Final = 12.0  # of the slope [m]


def masonry_wall(
    courses: int = 8,
    blocks: int = 6,
    openings: Sequence[Opening] = DOOR_AND_WINDOW,
    *,
    friction: float = 0.6,
    wind: float = 2.0,
) -> ContactProblem:
    """A wall of blocks in running bond with openings, under its weight and wind from the left, in its plane.

    Blocks are 0.5 m long and 0.25 m high, with γ = 20 kN/m³, E = 5 GPa, ν = 0.2, in plane stress. Head joints of each
    course lie over the middle of the blocks below; half blocks fill the ends. A lintel, one course high and resting on
    half a block at each side, spans each `Opening`. All joints are unilateral contacts with the same friction: "beds",
    "heads", and "ground" below the wall. The loads are "body" (weight), and "wind" on the left side [kPa]. Lintels must
    lie inside the wall and may not touch other openings and lintels.

    Without openings, a wall with n blocks of length a in each course slides at the wind μ γ n a, on every
    bed at the same load. A stack of single blocks of total height h tips at γ a²/h if it does not slide.
    """
    active, heads = _bond(whole_number("courses", courses, _MOST), 2 * whole_number("blocks", blocks, _MOST), openings)
    rows, halves = active.shape
    grid = TriangleMesh.grid(np.arange(halves + 1) * _BLOCK_LENGTH / 2.0, np.arange(rows + 1) * _COURSE_HEIGHT, active)
    mesh = TriangleMesh(grid.vertices, grid.cells)  # without the names of sides
    outside, (line, row) = mesh.topology.boundary, (mesh.midpoints / (_BLOCK_LENGTH / 2.0, _COURSE_HEIGHT)).T
    half_block = np.minimum(row.astype(np.int64), rows - 1), line.astype(np.int64)
    masks = {"beds": ~outside & (row % 1.0 == 0.0), "heads": ~outside & (line % 1.0 == 0.0) & heads[half_block]}
    masks |= {"ground": outside & (row == 0.0), "windward": outside & (line == 0.0), "top": outside & (row == rows)}
    masks["free"] = outside & ~np.any(list(masks.values()), axis=0)
    mesh = _with_names(mesh, masks)
    joints = [Contact(name, friction) for name in ("ground", *mesh.joint_names)]
    loads: list[Condition] = [
        Traction("windward", x=finite_number("wind", wind), y=0.0, name="wind"),
        *(Traction(name, x=0.0, y=0.0) for name in ("top", "free")),
    ]
    material, weight = Material(5e6, 0.2, "stress"), Polynomial([[0.0, 20.0]])
    return ContactProblem(mesh, material, [*joints, *loads], body_potential=weight)


def _bond(courses: int, halves: int, openings: Sequence[Opening]) -> tuple[BoolArray, BoolArray]:
    """Masks of the half blocks that exist, (courses, halves), and of head joints, (courses, halves + 1)."""
    is_active, is_taken = np.ones((courses, halves), dtype=bool), np.zeros((courses, halves), dtype=bool)
    row, line = np.meshgrid(np.arange(courses), np.arange(halves + 1), indexing="ij")
    is_head = (row + line) % 2 == 0
    for opening in openings:
        if len(opening) != 4:
            raise InputError("openings", opening, "give four numbers: half blocks left, courses below, width, height")
        bottom = whole_number("openings", opening[1], _MOST, least=0)
        left, width, height = (whole_number("openings", opening[k], 2 * _MOST) for k in (0, 2, 3))
        right, top = left + width, bottom + height
        if right >= halves or top >= courses:
            raise InputError("openings", opening, "leave half a block at each side and a course above for the lintel")
        space = (slice(bottom, top + 1), slice(left - 1, right + 1))
        if is_taken[space].any():
            raise InputError("openings", opening, "leave half a block between openings, and a course between lintels")
        is_taken[space] = True
        is_active[bottom:top, left:right] = False
        is_head[top, left : right + 1] = False
        is_head[top, [left - 1, right + 1]] = True
    return is_active, is_head


def _with_names(mesh: TriangleMesh, masks: dict[str, BoolArray]) -> TriangleMesh:
    """The mesh with joints and parts of the boundary by masks (e,) of edges; empty ones are left out."""
    return replace(mesh, edge_sets={name: mesh.topology.ends[mask] for name, mask in masks.items() if mask.any()})


def jointed_slope(
    rows: int = 6, crest: int = 2, *, dip: float = 30.0, friction: float = 0.7, crack_water: float = 1.0
) -> ContactProblem:
    """A rock slope whose bedding planes dip out of its face, cut by cross joints, with water in a tension crack.

    The face rises to 12 m, twice as steeply as the bedding: tan ψ = 2 tan β. Bedding planes meet the face at the toe
    and at equal distances above it. Vertical cross joints, staggered from layer to layer, divide the layers into
    blocks. The vertical crack behind the crest reaches down to the lowest bedding plane. The rock is in plane strain,
    with γ = 25 kN/m³, E = 10 GPa, ν = 0.25. The contacts are "bedding" and "cross joints"; the loads are "body"
    (weight) and "water" in the crack.

    `rows` is the number of bedding planes, and of blocks along the face. `crest` is the length of the crest in columns,
    below `rows`; a column is as wide as the run of the face between two bedding planes. The angle β [°] is `dip`, from
    5 to 60. The water weighs `crack_water` times 10 kN/m³. All joints have this `friction`.

    With the weight W above the lowest plane, the depth z of the crack, and the thrust V = γ_w z²/2 of the water,
    everything above that plane slides at the multiple α of V with

        W sin β + α V cos β = μ (W cos β − α V sin β).

    Without water the factor of safety is tan φ/tan β with tan φ = μ: the blocks of every layer slide when
    μ is divided by this factor. Source: E. Hoek and J. W. Bray, Rock Slope Engineering, plane failure.
    """
    rows, crest = whole_number("rows", rows, _MOST), whole_number("crest", crest, _MOST)
    if crest >= rows:
        raise InputError("crest", crest, f"give less than rows = {rows}: the lowest plane must end in the crack")
    if not 5.0 <= finite_number("dip", dip) <= 60.0:
        raise InputError("dip", dip, "give an angle from 5 to 60 degrees")
    rise = _SLOPE_HEIGHT / (2.0 * rows)
    run = rise / float(np.tan(np.radians(dip)))
    water = _WATER_WEIGHT * finite_number("crack_water", crack_water)
    conditions: list[Condition] = [
        *(Contact(name, friction) for name in ("bedding", "cross joints")),
        Traction("crack", normal=Polynomial([[-water * _SLOPE_HEIGHT, water]]), tangential=0.0, name="water"),
        *(Traction(side, x=0.0, y=0.0) for side in ("bench", "face", "crest")),
        *(Symmetry(side) for side in ("front", "rear")),
        Displacement("underground", x=0.0, y=0.0),
    ]
    mesh, material = _slope_mesh(rows, rows + crest, (run, rise)), Material(1e7, 0.25, "strain")
    return ContactProblem(mesh, material, conditions, body_potential=Polynomial([[0.0, 25.0]]))


def _slope_mesh(rows: int, columns: int, size: tuple[float, float]) -> TriangleMesh:
    """The mesh of a slope on a grid (i, j) of columns and rises; bedding planes are j − i = const., the face j = 2i."""
    first = -max(rows // 2, 1)  # columns in front of the toe, and rises below it
    cells = list[tuple[tuple[int, int], ...]]()
    for i in range(first, columns):
        top = min(max(2 * i, 0), 2 * rows)
        for j in range(first, top):
            cells += [((i, j), (i + 1, j), (i + 1, j + 1)), ((i, j), (i + 1, j + 1), (i, j + 1))]
        if 0 <= i < rows:
            upper = (i + 1, top + 1)
            cells += [((i, top), (i + 1, top), upper), ((i, top), upper, (i + 1, top + 2))]
    places, numbers = np.unique(np.array(cells).reshape(-1, 2), axis=0, return_inverse=True)
    mesh = TriangleMesh(places * size, numbers.reshape(-1, 3))
    i, j = places[mesh.topology.ends].transpose(2, 0, 1)
    layer, outside = (j - i).min(axis=1), mesh.topology.boundary
    is_above = (layer >= 0) & (i >= 0).all(axis=1)
    bedding = is_above & (np.ptp(j - i, axis=1) == 0)
    cross = is_above & (np.ptp(i, axis=1) == 0) & ((i[:, 0] + layer) % 2 == 0)
    masks: dict[str, BoolArray] = {"bedding": bedding & ~outside, "cross joints": cross & ~outside}
    at_rear = (i == columns).all(axis=1)
    masks["crack"] = at_rear & (j >= columns).all(axis=1)
    masks["rear"] = at_rear & ~masks["crack"]
    masks["front"] = (i == first).all(axis=1)
    masks["underground"] = (j == first).all(axis=1)
    masks["bench"] = (j == 0).all(axis=1) & (i <= 0).all(axis=1) & outside
    masks["crest"] = (j == 2 * rows).all(axis=1)
    masks["face"] = (j == 2 * i).all(axis=1) & outside
    return _with_names(mesh, masks)
