"""The schema of problem files, version 1: which tables and keys there are, before any of them means mechanics.

Paths in errors count from 0: ``contacts[1].friction`` belongs to the second ``[[contacts]]``.
"""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Final, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    model_validator,
)

from qvi_contact.errors import InputError
from qvi_contact.files.problem_size import check_size
from solvers.basics.names import closest


class Missing:
    """The value of a key that is needed and not there, for messages: TOML knows no None."""

    def __repr__(self) -> str:
        return "missing"


VERSION: Final = 1

_LARGEST: Final = 1e60  # numbers beyond it overflow when they are squared and multiplied
_WHOLE: Final = 2**63  # TOML's whole numbers have 64 bits
_LONGEST_NAME: Final = 100
_MOST_CELLS: Final = 10_000  # in a row
_MOST_STEPS: Final = 10_000
_MOST_NAMES: Final = 2000
_MESH_KINDS: Final = (("x", "y"), ("file",), ("outline",), ("vertices", "triangles"))
_MESH_EXTRAS: Final = {"x": ("remove", "refine"), "vertices": ("edges", "regions")}  # what else a kind of mesh has


def _one_line(text: str) -> str:
    if not text.strip() or not text.isprintable() or len(text) > _LONGEST_NAME:
        raise InputError("", text, f"give a text of one line and at most {_LONGEST_NAME} characters")
    return text


def _not_tiny(value: float) -> float:
    if 0.0 < value < 1.0 / _LARGEST:
        raise InputError("", value, f"give at least {1.0 / _LARGEST:g}: take other units if you need less")
    return value


def _no_truth(value: object) -> object:
    """For Python `true` is the number 1."""
    if isinstance(value, bool):
        raise InputError("", value, "give 1")
    return value


def _kind_of_axis(value: Any) -> str | None:
    if isinstance(value, dict | Segment):
        return "<segment>"
    if not isinstance(value, list):
        return None
    return "<segments>" if value and isinstance(value[0], dict | Segment) else "<lines>"


def _kind_of_field(value: Any) -> str | None:
    if isinstance(value, bool):
        return None
    kinds: dict[type, str] = {int: "<number>", float: "<number>", str: "<text>", dict: "<table>"}
    return kinds.get(type(value), "<table>" if isinstance(value, PolynomialTable) else None)


class Table(BaseModel):
    """A table that refuses keys it does not know, and types that are merely similar."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:
        for key in data if isinstance(data, dict) else ():
            if key not in cls.model_fields:
                raise InputError(quoted(key), data[key], _instead(key, cls.model_fields))
        return data


class PolynomialTable(Table):
    """Σ_ij c_ij xⁱ yʲ, as ``{ polynomial = [[c00, c01], [c10]] }``."""

    polynomial: list[list[float]]
    """Coefficients c_ij of Σ c_ij xⁱ yʲ, a list for each power of x: `polynomial = [[0.0, 1.0], [2.0]]`."""


Name = Annotated[str, AfterValidator(_one_line)]
Modulus = Annotated[float, AfterValidator(_not_tiny)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
TwoPoints = Annotated[list[Pair], Field(min_length=2, max_length=2)]
Edge = Annotated[list[int], Field(min_length=2, max_length=2)]
Triple = Annotated[list[int], Field(min_length=3, max_length=3)]
Scalar = Annotated[
    Annotated[float, Tag("<number>")] | Annotated[str, Tag("<text>")],
    Discriminator(
        _kind_of_field,
        custom_error_type="scalar",
        custom_error_message="give a number, or an expression of constants and t in quotes",
    ),
]
FieldValue = Annotated[
    Annotated[float, Tag("<number>")] | Annotated[str, Tag("<text>")] | Annotated[PolynomialTable, Tag("<table>")],
    Discriminator(
        _kind_of_field,
        custom_error_type="field",
        custom_error_message="give a number, an expression in quotes, or { polynomial = [[c00, c01], [c10]] }",
    ),
]


class UnitsTable(Table):
    """Labels; nothing is converted."""

    length: Name = "length"
    """Unit of coordinates, a label only: `length = "mm"`."""
    stress: Name = "stress"
    """Unit of stresses, a label only: `stress = "MPa"`."""


class Segment(Table):
    """Grid lines from `start` to `stop`, see `qvi_contact.graded_lines`; `start` may be left out after another one."""

    start: float | None = None
    """First grid line; left out after another piece: `start = 0.0`."""
    stop: float
    """Last grid line: `stop = 2.0`."""
    cells: Annotated[int, Field(ge=1, le=_MOST_CELLS)]
    """Number of cells: `cells = 8`."""
    grading: float = 1.0
    """Size of each cell over that of the one before it: `grading = 0.9`."""
    both_ends: bool = False
    """Whether cells shrink towards both ends: `both_ends = true`."""


Axis = Annotated[
    Annotated[list[float], Tag("<lines>")]
    | Annotated[Segment, Tag("<segment>")]
    | Annotated[list[Segment], Tag("<segments>")],
    Discriminator(
        _kind_of_axis,
        custom_error_type="axis",
        custom_error_message="give a list of grid lines, or { start = 0.0, stop = 1.0, cells = 8 }, or a list of such",
    ),
]


class Rectangle(Table):
    """Cells between grid lines; a range left out reaches across the whole mesh."""

    x: Pair | None = None
    """Range along x: `x = [0.0, 1.0]`."""
    y: Pair | None = None
    """Range along y: `y = [0.5, 2.0]`."""


class RefineTable(Table):
    """Grid lines added so that cells shrink geometrically towards re-entrant corners and ends, in x and in y."""

    largest: float
    """Largest cell: `largest = 0.25`."""
    smallest: float | None = None
    """Smallest cell, at re-entrant corners and the ends named: `smallest = 0.01`."""
    ratio: Annotated[float, Field(ge=0.01, le=0.99)] = 0.5
    """Size of a cell over that of its larger neighbour: `ratio = 0.7`."""
    towards: list[str] = []
    """Edge sets at whose ends cells are small too: `towards = ["base"]`."""


class CornerTable(Table):
    """See `qvi_contact.Corner`."""

    at: Pair
    """The point: `at = [2.0, 0.0]`."""
    name: Name | None = None
    """Name of the line from here to the next corner: `name = "base"`."""
    centre: Pair | None = None
    """Centre of the arc to the next corner; a straight line without it: `centre = [1.0, 1.0]`."""
    clockwise: bool = False
    """Which way the arc goes: `clockwise = true`."""
    size: float | None = None
    """Size of the triangles here: `size = 0.02`."""


class RingTable(Table):
    """A closed line: corners, or a circle."""

    name: Name | None = None
    """Name of the line, of a circle or a region: `name = "bore"`."""
    corners: list[CornerTable] | None = None
    """Corners in order: `corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [0.0, 1.0] }]`."""
    centre: Pair | None = None
    """Centre of a circle: `centre = [1.0, 1.0]`."""
    radius: float | None = None
    """Radius of a circle: `radius = 0.4`."""
    size: float | None = None
    """Size of the triangles along a circle: `size = 0.1`."""

    @model_validator(mode="after")
    def _is_one_line(self) -> "RingTable":
        circle = {"centre": self.centre, "radius": self.radius}
        if (self.corners is None) == all(value is None for value in circle.values()):
            raise InputError("corners", None, "give corners, or centre and radius of a circle")
        for key, value in (circle | {"size": self.size}).items():
            if self.corners is not None and value is not None:
                raise InputError(key, value, "this belongs to a circle, which has no corners: leave it out")
        for key, value in circle.items():
            if self.corners is None and value is None:
                raise InputError(key, None, "add this key, it is needed")
        return self


class HoleTable(RingTable):
    """A hole; a name is that of its edges, where it is a circle."""

    @model_validator(mode="after")
    def _corners_have_names(self) -> "HoleTable":
        if self.corners is not None and self.name is not None:
            raise InputError("name", self.name, "give the names to the corners where the lines begin")
        return self


class InnerRegionTable(RingTable):
    """A region of an outline."""

    name: Name
    """Name of the region: `name = "inclusion"`."""


class InnerLineTable(Table):
    """A joint of an outline."""

    name: Name
    """Name of the joint: `name = "joint"`."""
    corners: list[CornerTable]
    """Corners of the line, which is closed if the first one is repeated at its end, or an arc begins at the last one:
    `corners = [{ at = [0.0, 0.5] }, { at = [1.0, 0.5] }]`.
    """


class SizeTable(Table):
    """Size of the triangles at a point."""

    at: Pair
    """The point: `at = [1.0, 0.5]`."""
    size: float
    """Size of the triangles there: `size = 0.05`."""


class OutlineTable(Table):
    """See `qvi_contact.TriangleMesh.outline`."""

    size: float
    """Size of the triangles where nothing else is said: `size = 0.2`."""
    corners: list[CornerTable]
    """Corners of the body, see `[[mesh.outline.corners]]`:
    `corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [0.0, 1.0] }]`.
    """
    holes: Annotated[list[HoleTable], Field(max_length=_MOST_NAMES)] = []
    """Holes, by corners or as circles: `holes = [{ centre = [1.0, 1.0], radius = 0.4 }]`."""
    joints: Annotated[list[InnerLineTable], Field(max_length=_MOST_NAMES)] = []
    """Lines inside the body, open or closed:
    `joints = [{ name = "joint", corners = [{ at = [0.0, 0.5] }, { at = [1.0, 0.5] }] }]`.
    """
    regions: Annotated[list[InnerRegionTable], Field(max_length=_MOST_NAMES)] = []
    """Regions of another material: `regions = [{ name = "inclusion", centre = [1.0, 1.0], radius = 0.2 }]`."""
    sizes: Annotated[list[SizeTable], Field(max_length=_MOST_NAMES)] = []
    """Places where triangles have another size: `sizes = [{ at = [1.0, 0.5], size = 0.05 }]`."""


class ArcTable(Table):
    """Edges of triangles that follow a circle or an ellipse, see `qvi_contact.TriangleMesh.with_arc`; or any curve."""

    centre: Pair | None = None
    """Centre of the circle or the ellipse: `centre = [0.0, 0.0]`."""
    radius: float | None = None
    """Radius of the circle, on which the vertices lie: `radius = 1.0`."""
    axes: Pair | None = None
    """Half axes of the ellipse, on which the vertices lie: `axes = [2.0, 1.0]`."""
    angle: float | None = None
    """Angle [rad] from the x-axis to the first axis of the ellipse, counterclockwise: `angle = 0.5`."""
    bends: list[list[float]] | None = None
    """Other curves as the program writes them, one row for each of the edges: coefficients of Legendre, along the edge,
    of the angle [rad] from its chord to its tangent, counterclockwise: `bends = [[0.0, 0.25], [0.0, 0.25]]`.
    """
    name: Name | None = None
    """Which edges, by the name they have in the mesh, in `[[edges]]` or in `[[joints]]`: `name = "bore"`."""
    edges: list[Edge] | None = None
    """The edges themselves instead, two vertices each: `edges = [[0, 1], [1, 2]]`."""

    @model_validator(mode="after")
    def _is_one_set(self) -> "ArcTable":
        if (self.name is None) == (self.edges is None):
            raise InputError("name", self.name, "give a name of edges, or edges by their vertices: one of both")
        if self.bends is not None and self.edges is None:
            raise InputError("edges", None, "bends belong to edges by their vertices: give these")
        return self

    @model_validator(mode="after")
    def _is_one_curve(self) -> "ArcTable":
        curves = {key: getattr(self, key) for key in ("radius", "axes", "bends")}
        given = [key for key, value in curves.items() if value is not None]
        if len(given) != 1:
            remedy = "give a radius (of a circle), axes (of an ellipse), or bends (of the edges): one of these"
            raise InputError("radius", given or None, remedy)
        if (self.centre is None) != (self.bends is not None):
            remedy = "add this key, it is needed" if self.centre is None else "bends need no centre: leave it out"
            raise InputError("centre", self.centre, remedy)
        if self.angle is not None and self.axes is None:
            raise InputError("angle", self.angle, "this belongs to an ellipse: give axes, or leave it out")
        return self


class MeshTable(Table):
    """A grid whose cells are cut into triangles; or triangles: in this file, in a mesh file, or of an outline."""

    x: Axis | None = None
    """Grid lines across x: all of them, a piece, or a list of pieces: `x = { start = 0.0, stop = 2.0, cells = 8 }`."""
    y: Axis | None = None
    """Grid lines across y: `y = [0.0, 0.5, 1.0]`."""
    remove: list[Rectangle] = []
    """Rectangles of the grid that are no part of the body: `remove = [{ x = [1.0, 2.0], y = [1.0, 2.0] }]`."""
    refine: RefineTable | None = None
    """Finer towards re-entrant corners, see `[mesh.refine]`: `refine = { largest = 0.25, smallest = 0.01 }`."""
    file: Name | None = None
    """Mesh file, .msh, .inp or .med, by its place beside the problem file: `file = "meshes/dam.msh"`."""
    outline: OutlineTable | None = None
    """Outline that gmsh divides into triangles, see `[mesh.outline]`:
    `outline = { size = 0.2, corners = [{ at = [0.0, 0.0] }, { at = [1.0, 0.0] }, { at = [0.0, 1.0] }] }`.
    """
    vertices: list[Pair] | None = None
    """Vertices of triangles: `vertices = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]`."""
    triangles: list[Triple] | None = None
    """Three vertices for each triangle, counted from 0: `triangles = [[0, 1, 2]]`."""
    edges: Annotated[dict[Name, list[Edge]], Field(max_length=_MOST_NAMES)] = {}
    """Named edges of triangles, two vertices each: `edges = { base = [[0, 1]] }`."""
    regions: Annotated[dict[Name, list[int]], Field(max_length=_MOST_NAMES)] = {}
    """Named triangles: `regions = { core = [0] }`."""
    arcs: Annotated[list[ArcTable], Field(max_length=_MOST_NAMES)] = []
    """Edges of triangles that are arcs, not chords: `arcs = [{ name = "bore", centre = [0.0, 0.0], radius = 0.5 }]`."""

    @property
    def is_grid(self) -> bool:
        """Whether these are grid lines."""
        return self.x is not None

    @model_validator(mode="after")
    def _is_one_mesh(self) -> "MeshTable":
        kinds = [kind for kind in _MESH_KINDS if any(getattr(self, key) is not None for key in kind)]
        if len(kinds) != 1:
            remedy = "give x and y (grid lines), or file (of a mesh), or vertices and triangles, or an outline"
            raise InputError("", [key for kind in kinds for key in kind] or None, f"{remedy}: one of these")
        for key in kinds[0]:
            if getattr(self, key) is None:
                raise InputError(key, None, "add this key, it is needed")
        for needed, keys in _MESH_EXTRAS.items():
            for key in keys:
                if getattr(self, key) and needed not in kinds[0]:
                    raise InputError(key, getattr(self, key), f"this belongs to a mesh given by {needed}: leave it out")
        return self


class EdgesTable(Table):
    """A named part of the boundary: by side and range on a grid, by segment or box on any mesh."""

    name: Name
    """What conditions call this part of the boundary: `name = "base"`."""
    side: Literal["bottom", "right", "top", "left"] | None = None
    """Side of a grid: bottom, right, top or left: `side = "bottom"`."""
    start: float | None = None
    """Where the part of the side begins: `start = 0.5`."""
    stop: float | None = None
    """Where it ends: `stop = 1.5`."""
    at: float | None = None
    """Which of several lines of the side, by the coordinate across it: `at = 0.0`."""
    segment: TwoPoints | None = None
    """What lies between two points: `segment = [[0.0, 0.0], [2.0, 0.0]]`."""
    box: Rectangle | None = None
    """What lies inside a box: `box = { y = [0.9, 1.1] }`."""

    @model_validator(mode="after")
    def _is_one_place(self) -> "EdgesTable":
        _check_one_place(self, "side", ("side", "segment", "box"))
        return self


class JointTable(Table):
    """A named line inside the body: by direction and range on a grid, by segment on any mesh."""

    name: Name
    """What the contact calls this line: `name = "joint"`."""
    direction: Literal["horizontal", "vertical"] | None = None
    """Direction on a grid: horizontal or vertical: `direction = "horizontal"`."""
    at: float | None = None
    """Coordinate across the line: `at = 1.0`."""
    start: float | None = None
    """Where the line begins: `start = 0.0`."""
    stop: float | None = None
    """Where the line ends: `stop = 2.0`."""
    segment: TwoPoints | None = None
    """The line between two points: `segment = [[0.0, 1.0], [2.0, 1.0]]`."""

    @model_validator(mode="after")
    def _is_one_place(self) -> "JointTable":
        _check_one_place(self, "direction", ("direction", "segment"))
        if self.direction is not None and self.at is None:
            raise InputError("at", None, "add this key, it is needed")
        return self


def _check_one_place(table: Table, on_grid: str, keys: Sequence[str]) -> None:
    """Edges are given in one way, and ranges belong to a grid."""
    given = [key for key in keys if getattr(table, key) is not None]
    if len(given) != 1:
        raise InputError(given[-1] if given else keys[0], None, f"give one of {', '.join(keys)}")
    for key in ("start", "stop", "at"):
        if getattr(table, key) is not None and given != [on_grid]:
            raise InputError(key, getattr(table, key), f"this belongs to {on_grid}, on a grid: leave it out")


class StrengthTable(Table):
    """What a material can carry in a limit analysis."""

    law: Literal["tresca", "mises", "mohr-coulomb", "no-tension"]
    """tresca, mises, mohr-coulomb or no-tension: `law = "mohr-coulomb"`."""
    c: FieldValue | None = None
    """tresca: strength in shear; mohr-coulomb: cohesion; a field [stress]: `c = 20.0`."""
    yield_stress: FieldValue | None = None
    """mises: yield stress in tension, a field [stress]: `yield_stress = 235.0`."""
    phi: Scalar | None = None
    """mohr-coulomb: angle of friction [rad]: `phi = "30 * pi / 180"`."""
    tension: FieldValue | None = None
    """mohr-coulomb: largest tensile stress, a field [stress]; that of c and phi by default: `tension = 0.0`."""
    crushing: FieldValue | None = None
    """no-tension: strength in compression, a field [stress]; without limit by default: `crushing = 4.0`."""

    @model_validator(mode="after")
    def _keys_are_those_of_the_law(self) -> "StrengthTable":
        needed, more = STRENGTH_KEYS[self.law]
        for key in ("c", "yield_stress", "phi", "tension", "crushing"):
            given = getattr(self, key)
            if key in needed and given is None:
                raise InputError(key, None, f"add this key, it is needed for {self.law}")
            if key not in (*needed, *more) and given is not None:
                raise InputError(key, given, f"this does not belong to {self.law}: leave it out")
        return self


STRENGTH_KEYS: Final[dict[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "tresca": (("c",), ()),
    "mises": (("yield_stress",), ()),
    "mohr-coulomb": (("c", "phi"), ("tension",)),
    "no-tension": ((), ("crushing",)),
}
"""Keys that each law needs, and those that it may have besides."""


class MaterialTable(Table):
    """The body's material."""

    young: Modulus
    """Young's modulus [stress]: `young = 2.1e5`."""
    poisson: float
    """Poisson's ratio: `poisson = 0.3`."""
    plane: Literal["stress", "strain"] = "stress"
    """Plane stress or plane strain: `plane = "strain"`."""
    strength: StrengthTable | None = None
    """What it can carry in a limit analysis, see `strength`: `strength = { law = "tresca", c = 1.0 }`."""


class RegionTable(Rectangle):
    """Triangles of another material: ranges of x and y, or a region of the mesh by its name."""

    name: Name | None = None
    """Region of the mesh; with ranges, what to call it: `name = "inclusion"`."""
    young: Modulus
    """Young's modulus [stress]: `young = 7e4`."""
    poisson: float
    """Poisson's ratio: `poisson = 0.3`."""
    strength: StrengthTable | None = None
    """What it can carry in a limit analysis; any stress without it:
    `strength = { law = "mises", yield_stress = 235.0 }`.
    """


class SymmetryTable(Table):
    """A line of symmetry."""

    edges: str
    """Edge set that lies on a line of symmetry: `edges = "left"`."""


class DisplacementTable(Table):
    """Prescribed displacements, by Cartesian components or by normal and tangential ones."""

    edges: str
    """Edge set that the condition belongs to: `edges = "top"`."""
    x: FieldValue | None = None
    """Component along x, a field: displacement [length], or traction on the body [stress]: `x = 0.0`."""
    y: FieldValue | None = None
    """Component along y, a field: `y = "-1e-3 * t"`."""
    normal: FieldValue | None = None
    """Outward component, a field; instead of x and y: `normal = -10.0`."""
    tangential: FieldValue | None = None
    """Component along the tangent, a field: `tangential = 0.0`."""


class TractionTable(DisplacementTable):
    """Prescribed tractions, by components as displacements."""

    name: Name | None = None
    """What `limit` calls the load; loads of one name are scaled together: `name = "thrust"`."""


class DriveTable(Table):
    """What moves a rigid obstacle in each component: a force or a motion; with neither it stands still."""

    force_x: Scalar | None = None
    """Force on the body along x [stress × length]; the displacement along x follows: `force_x = 1.0`."""
    force_y: Scalar | None = None
    """Force on the body along y [stress × length]: `force_y = -10.0`."""
    moment: Scalar | None = None
    """Moment on the body about pivot or centre [stress × length²]: `moment = 0.0`."""
    x: Scalar | None = None
    """Displacement of pivot or centre along x [length], instead of the force: `x = 1e-3`."""
    y: Scalar | None = None
    """Displacement along y [length]: `y = "-1e-3 * t"`."""
    rotation: Scalar | None = None
    """Rotation about pivot or centre [rad], instead of the moment: `rotation = 0.0`."""


class PlateTable(DriveTable):
    """A rigid plate driven by force and moment, or by a motion."""

    pivot: Pair = [0.0, 0.0]
    """Point that moment and rotation refer to: `pivot = [0.5, 2.0]`."""


class PinTable(DriveTable):
    """A rigid round pin or disc; its distance from the body is the gap."""

    centre: Pair
    """Centre, before it moves: `centre = [0.0, 0.0]`."""
    radius: float
    """Radius [length]: `radius = 9.95`."""


class ContactTable(Table):
    """Contact with friction; `friction` may be left out of tied contacts only."""

    edges: str
    """Edge set of the boundary, or joint: `edges = "bottom"`."""
    friction: FieldValue | None = None
    """Coefficient of friction, a field; needed unless tied: `friction = 0.3`."""
    gap: FieldValue = 0.0
    """Distance of the obstacle, a field [length]; negative: pressed in: `gap = -1e-3`."""
    offset: FieldValue = 0.0
    """Displacement of the obstacle along the tangent, a field [length]: `offset = "1e-3 * sin(t)"`."""
    name: Name | None = None
    """What results call the contact; that of the edges by default: `name = "base"`."""
    cohesion: FieldValue = 0.0
    """Friction without pressure, a field [stress]: `cohesion = 0.1`."""
    shear_limit: FieldValue | None = None
    """Largest friction, a field [stress]: `shear_limit = 5.0`."""
    law: Literal["unilateral", "bilateral", "tied"] = "unilateral"
    """unilateral: may open; bilateral: keeps its distance; tied: does not move: `law = "bilateral"`."""
    plate: PlateTable | None = None
    """Rigid plate driven by force or moved, see `plate`: `plate = { force_y = -10.0 }`."""
    pin: PinTable | None = None
    """Rigid pin, see `pin`, instead of gap and plate: `pin = { centre = [0, 0], radius = 9.95, force_x = 10.0 }`."""
    pore_pressure: FieldValue = 0.0
    """Pressure of a fluid in the contact, a field [stress]: `pore_pressure = "0.01 * (40 - y)"`."""

    @model_validator(mode="after")
    def _friction_is_given(self) -> "ContactTable":
        if self.friction is None and self.law != "tied":
            raise InputError("friction", None, "give the coefficient of friction, 0.0 if there is none")
        return self

    @model_validator(mode="after")
    def _pin_is_alone(self) -> "ContactTable":
        if self.pin is not None and (self.plate is not None or self.gap != 0.0):
            raise InputError("pin", None, "a pin gives the gap and what moves it: leave out gap and plate, or the pin")
        return self


class SolveTable(Table):
    """Defaults for `qvi_contact.solve`; all but the first eight are options of a method."""

    degree: int | None = None
    """Degree of the element, 3 to 12; 4 by default: `degree = 5`."""
    contact_rows: Literal["bernstein", "gauss"] | None = None
    """bernstein: the contact law on whole edges; gauss: at points. By default the first, the second
    where friction varies along an edge, and on bilateral contacts with friction:
    `contact_rows = "gauss"`.
    """
    method: str | None = None
    """condensed (by default), fixed-point, pivoting or uzawa: `method = "fixed-point"`."""
    inner: str | None = None
    """Inner solver of the fixed point, see `qvi-contact methods`; qp:clarabel by default:
    `inner = "direct:clarabel"`.
    """
    tolerance: float | None = None
    """Accuracy that the certificate must confirm; 1e-8 by default: `tolerance = 1e-9`."""
    factorisation: str | None = None
    """Sparse factorisation, see `qvi-contact methods`; auto by default: `factorisation = "superlu"`."""
    threads: int | None = None
    """Threads of the linear algebra; one for small problems by default, else all cores: `threads = 2`."""
    time_limit: float | None = None
    """Seconds for everything; no limit by default: `time_limit = 60.0`."""
    gap: float | None = None
    """Condensed: complementarity at the end, relative; 1e-14 by default: `gap = 1e-12`."""
    system: str | None = None
    """Condensed: Newton's matrices, auto (by default), dense or sparse: `system = "sparse"`."""
    variant: str | None = None
    """Fixed point: anderson (by default), damped or plain: `variant = "damped"`."""
    damping: float | None = None
    """Fixed point: damping or mixing, above 0, at most 1; 0.5 by default: `damping = 0.2`."""
    memory: int | None = None
    """Fixed point: earlier iterations that anderson uses; 5 by default: `memory = 10`."""
    max_iterations: int | None = None
    """Iterations at most; each method has its own default: `max_iterations = 200`."""
    inner_tolerance: float | None = None
    """Fixed point: tolerance of the inner solver: `inner_tolerance = 1e-12`."""
    patience: int | None = None
    """Fixed point: iterations without progress before it counts as stalled; 15 by default: `patience = 30`."""
    form: str | None = None
    """Fixed point: unknowns of the inner problems, auto (by default), full or condensed: `form = "full"`."""
    rule: str | None = None
    """Uzawa: accumulating (by default) or printed, as in the paper: `rule = "printed"`."""
    omega_T: float | None = None  # noqa: N815  # the name of the option
    """Uzawa: step of the tangential multiplier; 0.01 by default: `omega_T = 0.001`."""
    omega_N: float | None = None  # noqa: N815
    """Uzawa: step of the normal multiplier; from the matrix by default: `omega_N = 0.5`."""
    step_decay: float | None = None
    """Uzawa: iterations in which the step halves; it does not shrink by default: `step_decay = 200.0`."""
    decay: str | None = None
    """Uzawa: geometric (by default) or harmonic: `decay = "harmonic"`."""
    iterations: int | None = None
    """Uzawa: do exactly so many, without any test: `iterations = 30`."""

    @model_validator(mode="before")
    @classmethod
    def _without_element(cls, data: Any) -> Any:
        """Files of version 0.1 could name the element: that of triangles is the only one."""
        if not isinstance(data, dict) or "element" not in data:
            return data
        if data["element"] != "hct":
            remedy = "rectangles (bfs) are gone: leave this key out, then grids are cut into triangles"
            raise InputError("element", data["element"], remedy)
        return {key: value for key, value in data.items() if key != "element"}


class RefinementTable(Table):
    """Defaults for `qvi_contact.refine`, beside those for `qvi_contact.solve`."""

    target: float | None = None
    """Relative error asked for; 1e-3 by default: `target = 1e-4`."""
    quantity: str | None = None
    """energy (by default), the force of a contact, NAME.normal_force or NAME.tangential_force, or of a plate or pin its
    force or motion, NAME.force_x, force_y, moment, x, y or rotation: `quantity = "base.normal_force"`.
    """
    max_unknowns: int | None = None
    """Largest number of unknowns; 20000 by default: `max_unknowns = 50_000`."""
    max_rounds: int | None = None
    """Largest number of rounds; 60 by default: `max_rounds = 10`."""
    guaranteed: bool | None = None
    """For the force of a contact with Coulomb friction: refine until its guaranteed bounds are within the target. By
    default an estimate is enough: `guaranteed = true`.
    """


class TimeRange(Table):
    """Times, or values of a sweep, from `start` to `stop`, both included, in equal steps."""

    start: float = 0.0
    """The first: `start = 0.0`."""
    stop: float
    """The last: `stop = 6.3`."""
    steps: Annotated[int, Field(ge=1, le=_MOST_STEPS)]
    """Number of steps: `steps = 20`."""


class HistoryTable(Table):
    """Load steps: the values that t takes."""

    times: Annotated[
        Annotated[list[float], Field(max_length=_MOST_STEPS), Tag("<lines>")] | Annotated[TimeRange, Tag("<segment>")],
        Discriminator(
            _kind_of_axis,
            custom_error_type="times",
            custom_error_message="give a list of times, or { start = 0.0, stop = 1.0, steps = 10 }",
        ),
    ]
    """Values that t takes, a list or a range; friction remembers from one to the next:
    `times = { start = 0.0, stop = 6.3, steps = 20 }`.
    """


class SweepTable(Table):
    """Values of a parameter for which the problem is solved, each by itself."""

    parameter: Literal["friction", "load", "gap", "offset"]
    """friction: μ of contacts; load: a factor of loads; gap, offset: what is added to these of contacts [length]:
    `parameter = "friction"`.
    """
    values: Annotated[
        Annotated[list[float], Field(max_length=_MOST_STEPS), Tag("<lines>")] | Annotated[TimeRange, Tag("<segment>")],
        Discriminator(
            _kind_of_axis,
            custom_error_type="values",
            custom_error_message="give a list of numbers, or { start = 0.0, stop = 1.0, steps = 10 }",
        ),
    ]
    """Its values, a list or a range:
    `values = { start = 0.1, stop = 0.5, steps = 4 }`.
    """
    of: Annotated[list[str], Field(max_length=_MOST_NAMES)] | None = None
    """Names of the contacts, or of the loads, that are changed; all by default: `of = ["base"]`."""


class Document(Table):
    """A whole problem file."""

    version: Annotated[Literal[1], BeforeValidator(_no_truth)]
    """Version of this format: `version = 1`."""
    title: str = ""
    """Heading of pictures and reports: `title = "Dam on rock"`."""
    description: str = ""
    """Anything else worth keeping: `description = "Water at 40 m"`."""
    body_potential: FieldValue = 0.0
    """Field φ with the body force −∇φ; ρ g y under gravity: `body_potential = "0.024 * y"`."""
    body_forces: Annotated[dict[Name, FieldValue], Field(max_length=_MOST_NAMES)] = {}
    """Several such fields by name instead, each of which `limit` and sweeps can multiply:
    `body_forces = { weight = "24.0 * y", earthquake = "-24.0 * x" }`.
    """
    units: UnitsTable = UnitsTable()
    """Labels of units, see `[units]`: `units = { length = "mm", stress = "MPa" }`."""
    constants: dict[str, float] = {}
    """Numbers that expressions may name: `constants = { mu = 0.3, p = 10.0 }`."""
    mesh: MeshTable
    """The body, see `[mesh]`: `mesh = { x = [0.0, 1.0], y = [0.0, 1.0] }`."""
    edges: Annotated[list[EdgesTable], Field(max_length=_MOST_NAMES)] = []
    """Named parts of the boundary, see `[[edges]]`: `edges = [{ name = "base", side = "bottom", stop = 0.5 }]`."""
    joints: Annotated[list[JointTable], Field(max_length=_MOST_NAMES)] = []
    """Lines inside the body, see `[[joints]]`; each needs a contact:
    `joints = [{ name = "joint", direction = "horizontal", at = 1.0 }]`.
    """
    material: MaterialTable
    """The body's material, see `[material]`: `material = { young = 2.1e5, poisson = 0.3 }`."""
    regions: list[RegionTable] = []
    """Parts of another material, see `[[regions]]`: `regions = [{ y = [0.0, 0.5], young = 7e4, poisson = 0.3 }]`."""
    symmetry: list[SymmetryTable] = []
    """Lines of symmetry, see `[[symmetry]]`: `symmetry = [{ edges = "left" }]`."""
    displacements: list[DisplacementTable] = []
    """Prescribed displacements, see `[[displacements]]`: `displacements = [{ edges = "top", x = 0.0, y = -1e-3 }]`."""
    tractions: list[TractionTable] = []
    """Prescribed tractions, see `[[tractions]]`: `tractions = [{ edges = "right", x = 0.0, y = 0.0 }]`."""
    contacts: list[ContactTable] = []
    """Contacts, see `[[contacts]]`: `contacts = [{ edges = "bottom", friction = 0.3 }]`."""
    solve: SolveTable = SolveTable()
    """How to solve it, see `[solve]`: `solve = { degree = 5 }`."""
    refine: RefinementTable = RefinementTable()
    """How to refine it, see `[refine]`: `refine = { target = 1e-4 }`."""
    history: HistoryTable | None = None
    """Load steps, see `[history]`: `history = { times = [0.0, 1.0, 2.0] }`."""
    sweep: SweepTable | None = None
    """Values of a parameter, see `[sweep]`: `sweep = { parameter = "friction", values = [0.1, 0.2] }`."""


def parse(text: str) -> Document:
    """The document in a TOML text.

    Raises
    ------
    InputError
        If the text is no TOML, or does not follow the schema; the first thing wrong is named by its path.

    """
    check_size(text)
    try:
        data = tomllib.loads(text)
        _check_values(data, "")
    except InputError:
        raise
    except ValueError as error:  # also whole numbers of too many digits
        raise InputError("TOML", _wrong_line(text, str(error)), f"correct the syntax: {error}") from error
    except RecursionError as error:
        remedy = "lists and tables are nested too deeply: remove brackets"
        raise InputError("TOML", text[:100], remedy) from error
    try:
        return Document.model_validate(data)
    except ValidationError as error:
        raise _first_error(error) from error


def quoted(key: object) -> str:
    """A key as TOML writes it: bare if it can be."""
    text = str(key)
    return text if text.replace("_", "").replace("-", "").isalnum() and text.isascii() else repr(text)


def joined_path(parts: Iterable[object]) -> str:
    """The path of a value: ``("contacts", 2, "friction")`` is contacts[2].friction."""
    path = ""
    for part in parts:
        path += f"[{part}]" if isinstance(part, int) else f".{part}" if path else str(part)
    return path


def _check_values(value: object, path: str) -> None:
    """Refuse values that TOML knows and no table wants."""
    if isinstance(value, dict):
        for key, item in value.items():
            _check_values(item, joined_path((path, quoted(key)) if path else (quoted(key),)))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _check_values(item, f"{path}[{index}]")
    elif isinstance(value, int) and not -_WHOLE <= value < _WHOLE:
        raise InputError(path, f"a number of {value.bit_length()} bits", "give a whole number of at most 64 bits")
    elif isinstance(value, float) and not abs(value) <= _LARGEST:
        raise InputError(
            path, value, f"give a finite number, of at most {_LARGEST:g}: take other units if you need more"
        )
    elif not isinstance(value, int | float | str):
        raise InputError(
            path, str(value), "give a number, a text in quotes, a list or a table; dates are not used here"
        )


def _wrong_line(text: str, message: str) -> str:
    """The line that the parser complains about, if it says which."""
    _, found, rest = message.partition("at line ")
    number = rest.split(",")[0]
    lines = text.splitlines()
    return lines[int(number) - 1] if found and number.isdigit() and 0 < int(number) <= len(lines) else ""


def _instead(key: str, known: Mapping[str, object]) -> str:
    """What to write in place of an unknown key."""
    listed = f"the keys here are {', '.join(known)}"
    near = closest(key, known)
    if near is not None:
        return f"there is no such key; did you mean {near}? ({listed})"
    if key in Document.model_fields:
        return f"this belongs to the top of the file, before the first [table]; {listed}"
    return f"there is no such key; {listed}"


def _first_error(error: ValidationError) -> InputError:
    """The first thing wrong as one `InputError`; pydantic lists them in the order of the schema."""
    details = error.errors(include_url=False)
    first = min(details, key=lambda one: one["type"] == "missing")  # a wrong key explains a missing one
    location = [p if isinstance(p, int) else quoted(p) for p in first["loc"] if not str(p).startswith("<")]
    value, remedy = first["input"], _remedy(first)
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, InputError):
        value, remedy = cause.value, cause.remedy
        location += [cause.field] if cause.field else []
    if first["type"] == "missing" or value is None:
        value = Missing()
    more = len(details) - 1
    return InputError(joined_path(location) or "file", value, remedy + (f" ({more} more to correct)" if more else ""))


def _remedy(error: Mapping[str, Any]) -> str:
    """What to do about an error of pydantic."""
    kind, limits = error["type"], error.get("ctx", {})
    if kind == "list_type" and isinstance(error["input"], dict) and len(error["loc"]) == 1:
        return f"write [[{error['loc'][-1]}]], in double brackets: there may be several"
    if kind == "literal_error":
        return _choices(error["input"], limits["expected"])
    fixed = {
        "missing": "add this key, it is needed",
        "list_type": "give a list, in [ ]",
        "model_type": "give a table: keys and values",
        "dict_type": "give a table: keys and values",
        "float_type": "give a number",
        "int_type": "give a whole number",
        "string_type": "give a text in quotes",
        "bool_type": "give true or false",
        "too_short": f"give a list of {limits.get('min_length')} entries",
        "too_long": f"give a list of at most {limits.get('max_length')} entries",
        "greater_than_equal": f"give at least {limits.get('ge')}",
        "less_than_equal": f"give at most {limits.get('le')}",
    }
    return fixed.get(kind, str(error["msg"]))


def _choices(value: object, expected: str) -> str:
    words: Sequence[str] = [part.strip(" '") for part in expected.replace(" or ", ",").split(",")]
    near = closest(value, words)
    return f"give {expected}" + (f"; did you mean {near!r}?" if near else "")
