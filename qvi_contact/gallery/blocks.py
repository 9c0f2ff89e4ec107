"""Bodies of many blocks with dry joints between them: a masonry wall with openings, and a jointed rock slope."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from qvi_contact.basics.checks import BoolArray, finite_number, whole_number
from qvi_contact.errors import InputError
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, Symmetry, Traction
from qvi_contact.problem.fields import Polynomial
from qvi_contact.problem.material import Material
from qvi_contact.problem.problem import ContactProblem

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
