"""The schema of problem files, version 1: which tables and keys there are, before any of them means mechanics.

Paths in errors count from 0: ``contacts[1].friction`` belongs to the second ``[[contacts]]``.
"""

import difflib
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, model_validator

from qvi_contact.errors import InputError
from qvi_contact.files.problem_size import check_size

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
    stress: Name = "stress"


class Segment(Table):
    """Grid lines from `start` to `stop`, see `qvi_contact.graded_lines`; `start` may be left out after another one."""

    start: float | None = None
    stop: float
    cells: Annotated[int, Field(ge=1, le=_MOST_CELLS)]
    grading: float = 1.0
    both_ends: bool = False


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
    y: Pair | None = None


class RefineTable(Table):
    """See `qvi_contact.RectilinearMesh.refined`."""

    largest: float
    smallest: float | None = None
    ratio: Annotated[float, Field(ge=0.01, le=0.99)] = 0.5
    towards: list[str] = []


class CornerTable(Table):
    """See `qvi_contact.Corner`."""

    at: Pair
    name: Name | None = None
    centre: Pair | None = None
    clockwise: bool = False
    size: float | None = None


class RingTable(Table):
    """A closed line: corners, or a circle."""

    name: Name | None = None
    corners: list[CornerTable] | None = None
    centre: Pair | None = None
    radius: float | None = None
    size: float | None = None

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


class InnerLineTable(Table):
    """A joint of an outline."""

    name: Name
    corners: list[CornerTable]


class SizeTable(Table):
    """Size of the triangles at a point."""

    at: Pair
    size: float


class OutlineTable(Table):
    """See `qvi_contact.TriangleMesh.outline`."""

    size: float
    corners: list[CornerTable]
    holes: Annotated[list[HoleTable], Field(max_length=_MOST_NAMES)] = []
    joints: Annotated[list[InnerLineTable], Field(max_length=_MOST_NAMES)] = []
    regions: Annotated[list[InnerRegionTable], Field(max_length=_MOST_NAMES)] = []
    sizes: Annotated[list[SizeTable], Field(max_length=_MOST_NAMES)] = []


class MeshTable(Table):
    """Grid lines, cells left out, refinement; or triangles: in this file, in a mesh file, or of an outline."""

    x: Axis | None = None
    y: Axis | None = None
    remove: list[Rectangle] = []
    refine: RefineTable | None = None
    file: Name | None = None
    outline: OutlineTable | None = None
    vertices: list[Pair] | None = None
    triangles: list[Triple] | None = None
    edges: Annotated[dict[Name, list[Edge]], Field(max_length=_MOST_NAMES)] = {}
    regions: Annotated[dict[Name, list[int]], Field(max_length=_MOST_NAMES)] = {}

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
    """A named part of the boundary: of a grid see `RectilinearMesh.with_edges`, of triangles by segment or box."""

    name: Name
    side: Literal["bottom", "right", "top", "left"] | None = None
    start: float | None = None
    stop: float | None = None
    at: float | None = None
    segment: TwoPoints | None = None
    box: Rectangle | None = None

    @model_validator(mode="after")
    def _is_one_place(self) -> "EdgesTable":
        _check_one_place(self, "side", ("side", "segment", "box"))
        return self


class JointTable(Table):
    """A named line inside the body: of a grid see `RectilinearMesh.with_joint`, of triangles by segment."""

    name: Name
    direction: Literal["horizontal", "vertical"] | None = None
    at: float | None = None
    start: float | None = None
    stop: float | None = None
    segment: TwoPoints | None = None

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


class MaterialTable(Table):
    """The body's material."""

    young: Modulus
    poisson: float
    plane: Literal["stress", "strain"] = "stress"


class RegionTable(Rectangle):
    """Cells of another material: ranges, or on triangles a region of the mesh by its name."""

    name: Name | None = None
    young: Modulus
    poisson: float


class SymmetryTable(Table):
    """A line of symmetry."""

    edges: str


class DisplacementTable(Table):
    """Prescribed displacements, by Cartesian components or by normal and tangential ones."""

    edges: str
    x: FieldValue | None = None
    y: FieldValue | None = None
    normal: FieldValue | None = None
    tangential: FieldValue | None = None


class TractionTable(DisplacementTable):
    """Prescribed tractions, by components as displacements."""

    name: Name | None = None


class PlateTable(Table):
    """A rigid plate driven by force and moment."""

    force_x: Scalar | None = None
    force_y: Scalar | None = None
    moment: Scalar | None = None
    pivot: Pair = [0.0, 0.0]


class ContactTable(Table):
    """Contact with friction; `friction` may be left out of tied contacts only."""

    edges: str
    friction: FieldValue | None = None
    gap: FieldValue = 0.0
    offset: FieldValue = 0.0
    name: Name | None = None
    cohesion: FieldValue = 0.0
    shear_limit: FieldValue | None = None
    law: Literal["unilateral", "bilateral", "tied"] = "unilateral"
    plate: PlateTable | None = None
    pore_pressure: FieldValue = 0.0

    @model_validator(mode="after")
    def _friction_is_given(self) -> "ContactTable":
        if self.friction is None and self.law != "tied":
            raise InputError("friction", None, "give the coefficient of friction, 0.0 if there is none")
        return self


class SolveTable(Table):
    """Defaults for `qvi_contact.solve`; all but the first nine are options of a method."""

    element: Literal["bfs", "hct"] | None = None
    degree: int | None = None
    contact_rows: Literal["bernstein", "gauss"] | None = None
    method: str | None = None
    inner: str | None = None
    tolerance: float | None = None
    factorisation: str | None = None
    threads: int | None = None
    time_limit: float | None = None
    gap: float | None = None
    variant: str | None = None
    damping: float | None = None
    memory: int | None = None
    max_iterations: int | None = None
    inner_tolerance: float | None = None
    patience: int | None = None
    form: str | None = None
    rule: str | None = None
    omega_T: float | None = None  # noqa: N815  # the name of the option
    omega_N: float | None = None  # noqa: N815
    step_decay: float | None = None
    decay: str | None = None
    iterations: int | None = None


class RefinementTable(Table):
    """Defaults for `qvi_contact.refine`, beside those for `qvi_contact.solve`."""

    target: float | None = None
    quantity: str | None = None
    max_unknowns: int | None = None
    max_rounds: int | None = None


class TimeRange(Table):
    """Times from `start` to `stop`, both included, in equal steps."""

    start: float = 0.0
    stop: float
    steps: Annotated[int, Field(ge=1, le=_MOST_STEPS)]


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


class Document(Table):
    """A whole problem file."""

    version: Literal[1]
    title: str = ""
    description: str = ""
    body_potential: FieldValue = 0.0
    units: UnitsTable = UnitsTable()
    constants: dict[str, float] = {}
    mesh: MeshTable
    edges: Annotated[list[EdgesTable], Field(max_length=_MOST_NAMES)] = []
    joints: Annotated[list[JointTable], Field(max_length=_MOST_NAMES)] = []
    material: MaterialTable
    regions: list[RegionTable] = []
    symmetry: list[SymmetryTable] = []
    displacements: list[DisplacementTable] = []
    tractions: list[TractionTable] = []
    contacts: list[ContactTable] = []
    solve: SolveTable = SolveTable()
    refine: RefinementTable = RefinementTable()
    history: HistoryTable | None = None


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
        remedy = "lists and tables are nested more deeply than those of any problem: take brackets away"
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
            path, str(value), "give a number, a text in quotes, a list or a table; dates mean nothing here"
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
    close = difflib.get_close_matches(key, known, n=1)
    if close:
        return f"there is no such key; did you mean {close[0]}? ({listed})"
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
    if first["type"] == "missing":
        value = None
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
    close = difflib.get_close_matches(value, words, n=1) if isinstance(value, str) else []
    return f"give {expected}" + (f"; did you mean {close[0]!r}?" if close else "")
