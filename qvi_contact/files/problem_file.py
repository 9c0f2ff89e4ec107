"""Problem files: contact problems as TOML, which people can write and programs can keep.

A file can never run code: functions are numbers, polynomials or expressions of `qvi_contact.problem.fields`. Paths in
errors count from 0: ``contacts[1].friction`` belongs to the second ``[[contacts]]``.
"""

import os
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np

from qvi_contact.basics import schema
from qvi_contact.basics.checks import Field, evaluate, mapping
from qvi_contact.basics.schema import WithFields
from qvi_contact.basics.writing import given_path
from qvi_contact.discretization.loads import LOAD_POINTS
from qvi_contact.element.edge import SAMPLES, gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.files.mesh_tables import ArcTable, EdgesTable, JointTable, Lines, MeshTable
from qvi_contact.mesh import cutting
from qvi_contact.mesh.files import read_mesh
from qvi_contact.mesh.selection import new_name
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, RigidPlate, Symmetry, Traction
from qvi_contact.problem.fields import BodyForces, Expression, PointData, Polynomial
from qvi_contact.problem.material import Material, Region
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.solution.settings import PARAMETERS, RefineOptions, SolveOptions
from qvi_contact.units import Units
from solvers.errors import known_name

VERSION: Final = 1

ELEMENT_OPTIONS: Final = ("degree", "law_on")
"""Arguments of `solve` that choose the element rather than the method."""

TABLES: Final[dict[str, type[Condition]]] = {
    "symmetry": Symmetry,
    "displacements": Displacement,
    "tractions": Traction,
    "contacts": Contact,
}
"""Name of a table → class of its conditions, in the order in which a problem gets them."""

_LONGEST: Final = 20_000_000  # bytes of a file, characters of its text
_TOO_LONG: Final = (
    f"has more than {_LONGEST} bytes, the limit of a problem file: give grid lines as {{ start = …, stop = …, "
    "cells = … }, triangles in a mesh file, and functions as expressions"
)
_MOST_STEPS: Final = 10_000
_READ_AGAIN: Final = ("version", "free", "body_potential", "body_forces", "temperature", "material", "regions", *TABLES)
"""Keys whose values may be expressions in t, or which every document needs; they are read for each load step."""
_RENAMED: Final = {
    "ContactProblem.body_potential": "body_potential",
    "ContactProblem.temperature": "temperature",
    "ContactProblem.mesh": "mesh",
    "ContactProblem.conditions": "boundary conditions",
}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TimeRange:
    """Times, or values of a sweep, from `start` to `stop`, both included, in equal steps."""

    start: float = 0.0
    """First value: `start = 0.0`."""
    stop: float
    """Last value: `stop = 6.3`."""
    steps: Annotated[int, schema.Whole(1, _MOST_STEPS)]
    """Number of equal steps between them: `steps = 20`."""


def evenly(start: float, stop: float, count: int) -> tuple[float, ...]:
    """Numbers from start to stop, both included, at equal distances; 15 digits, so that 0.15 has no rounding error."""
    return tuple(float(f"{value:.15g}") for value in np.linspace(start, stop, count))


class Values(schema.Kind):
    """Numbers, at least one, as a list or a range."""

    values = "list of numbers, or range"
    of = TimeRange

    def read(self, value: Any, reader: schema.Reader) -> tuple[float, ...]:
        """All numbers of the list or range."""
        if isinstance(value, dict):
            time_range = schema.read_table(TimeRange, value, reader)
            return evenly(time_range.start, time_range.stop, time_range.steps + 1)
        if not isinstance(value, list):
            raise InputError("", value, "give a list of numbers, or { start = 0.0, stop = 1.0, steps = 10 }")
        return schema.Listed(schema.FINITE, 1, _MOST_STEPS).read(value, reader)


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialTable:
    """Σ_ij c_ij xⁱ yʲ, as ``{ polynomial = [[c00, c01], [c10]] }``."""

    polynomial: tuple[tuple[float, ...], ...]
    """Coefficients c_ij of Σ c_ij xⁱ yʲ, a list for each power of x: `polynomial = [[0.0, 1.0], [2.0]]`."""


@dataclass(frozen=True, eq=False, repr=False)
class PointDataTable:
    """Values at the points of a mesh, linear in between, as ``{ file = "…", data = "T" }``."""

    file: str
    """File (.vtu or .msh) with triangles and point data, relative to the problem file: `file = "temperature.vtu"`."""
    data: str
    """Name of the point data in the file, one number for each point: `data = "T"`."""


@dataclass(frozen=True, eq=False, repr=False)
class HistoryTable:
    """Load steps: the values that t takes."""

    times: Annotated[tuple[float, ...], Values()]
    """Values of t, a list or a range; each step begins with the slip of the step before: `times = [0.0, 0.5, 1.0]`."""


@dataclass(frozen=True)
class SweepPlan:
    """Arguments for `qvi_contact.solve_sweep`."""

    parameter: Annotated[Any, schema.Choice(PARAMETERS)]  # checked by solve_sweep too
    """friction (μ of contacts), load (a factor of loads), gap or offset (a length added to that of contacts):
    `parameter = "friction"`."""
    values: Annotated[tuple[float, ...], Values()]
    """Values of the parameter, a list or a range: `values = { start = 0.1, stop = 0.5, steps = 4 }`."""
    of: Annotated[tuple[str, ...], schema.Listed(schema.TEXT, 0, schema.MOST)] | None = None
    """Names of the contacts, or of the loads, that are changed; all by default: `of = ["base"]`."""


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Document:
    """A whole problem file."""

    version: Literal[1]
    """Version of this format: `version = 1`."""
    title: str = ""
    """Heading of pictures and reports: `title = "Dam on rock"`."""
    description: str = ""
    """Text that commands and reports print below the title: `description = "Water at 40 m"`."""
    body_potential: Field = 0.0
    """Field φ with the body force −∇φ; ρ g y under gravity: `body_potential = "0.024 * y"`."""
    body_forces: dict[str, Field] | None = None
    """Or several potentials by name, which `limit` and sweeps can multiply: `body_forces = { weight = "24.0 * y" }`."""
    temperature: Field = 0.0
    """Rise of temperature since the body was free of stress, see `expansion` of materials: `temperature = 40.0`."""
    units: Units = field(default_factory=Units)
    """Labels of units, see `[units]`: `units = { length = "mm", stress = "MPa" }`."""
    constants: dict[str, float] | None = None
    """Numbers that expressions may use by name: `constants = { mu = 0.3, p = 10.0 }`."""
    mesh: MeshTable | None = field(default=None, metadata=schema.key(needed=True))
    """The body, see `[mesh]`: `mesh = { x = [0.0, 1.0], y = [0.0, 1.0] }`."""
    edges: tuple[EdgesTable, ...] = ()
    """Named parts of the boundary, see `[[edges]]`: `edges = [{ name = "base", side = "bottom", stop = 0.5 }]`."""
    joints: tuple[JointTable, ...] = ()
    """Lines inside, each with a contact, see `[[joints]]`: `joints = [{ name = "a", segment = [[0, 1], [2, 1]] }]`."""
    material: Material
    """The body's material, see `[material]`: `material = { young = 2.1e5, poisson = 0.3 }`."""
    regions: Annotated[tuple[Region, ...], schema.Tables(Region, None)] = ()
    """Parts of another material, see `[[regions]]`: `regions = [{ y = [0.0, 0.5], young = 7e4, poisson = 0.3 }]`."""
    symmetry: Annotated[tuple[Symmetry, ...], schema.Tables(Symmetry, None)] = ()
    """Lines of symmetry, see `[[symmetry]]`: `symmetry = [{ edges = "left" }]`."""
    displacements: Annotated[tuple[Displacement, ...], schema.Tables(Displacement, None)] = ()
    """Prescribed displacements, see `[[displacements]]`: `displacements = [{ edges = "top", x = 0.0, y = -1e-3 }]`."""
    tractions: Annotated[tuple[Traction, ...], schema.Tables(Traction, None)] = ()
    """Prescribed tractions, see `[[tractions]]`: `tractions = [{ edges = "right", x = 0.0, y = 0.0 }]`."""
    contacts: Annotated[tuple[Contact, ...], schema.Tables(Contact, None)] = ()
    """Contacts, see `[[contacts]]`: `contacts = [{ edges = "bottom", friction = 0.3 }]`."""
    free: schema.Name | None = None
    """A new name for all edges of the boundary that no condition names, which are then free of stress; without it such
    edges are an error: `free = "rest"`."""
    solve: Annotated[Mapping[str, Any], schema.Options(SolveOptions)] = field(default_factory=dict)
    """Options of `solve`, see `[solve]`: `solve = { degree = 5 }`."""
    refine: Annotated[Mapping[str, Any], schema.Options(RefineOptions)] = field(default_factory=dict)
    """Options of `refine`, see `[refine]`: `refine = { target = 1e-4 }`."""
    history: HistoryTable | None = None
    """Load steps, see `[history]`: `history = { times = [0.0, 1.0, 2.0] }`."""
    sweep: SweepPlan | None = None
    """Values of a parameter, see `[sweep]`: `sweep = { parameter = "friction", values = [0.1, 0.2] }`."""

    def __post_init__(self) -> None:
        if self.body_forces and self.body_potential != 0.0:
            raise InputError("body_potential", self.body_potential, "body_forces are given: leave one of them out")
        if self.sweep is not None and self.history is not None:
            raise InputError("sweep", self.sweep.parameter, "a file with a [history] cannot be swept: leave one out")

    def built_mesh(self, reader: "FileReader") -> TriangleMesh:
        """The mesh with its named edges, joints, regions and arcs."""
        table, lines = self.mesh, None
        assert table is not None  # it is needed
        arcs = {f"mesh.arcs[{index}]": arc for index, arc in enumerate(table.arcs)}
        with schema.located("mesh"):
            if table.file is not None:
                try:
                    parts = read_mesh(reader.path_of(table.file))
                    if table.join is not None:  # arcs on both bodies have to be known before these are joined
                        on_parts = {path: arc for path, arc in arcs.items() if arc.name in parts.edge_sets}
                        arcs = {path: arc for path, arc in arcs.items() if path not in on_parts}
                        curves = [arc.on(parts) for arc in on_parts.values()]
                        parts = cutting.joined(replace(parts, arcs=curves), table.join)
                    mesh = TriangleMesh(*parts.given)
                except InputError as error:
                    with schema.located("" if error.field == "join" else "file", ("join",)):
                        raise
            elif table.outline is not None:
                with schema.located("outline"):
                    mesh = table.outline.mesh()
            elif table.x is None or table.y is None:
                mesh = table.inline()
            else:
                lines = table.x, table.y
                mesh = table.grid(lines)
        mesh = self._named(mesh, lines, arcs)
        if table.refine is None or lines is None:
            return mesh  # else grid lines are added, and edges are named again on the finer grid
        with schema.located("mesh.refine"):
            lines = table.refine.lines(mesh, table.body(lines), lines)
            mesh = table.grid(lines)
        return self._named(mesh, lines, arcs)

    def _named(self, mesh: TriangleMesh, lines: Lines | None, arcs: Mapping[str, ArcTable]) -> TriangleMesh:
        """Add the tables [[edges]], [[joints]] and [[mesh.arcs]] to a mesh; `lines` are the lines of a grid."""
        edge_sets = dict(mesh.edge_sets)
        for kind in ("edges", "joints"):
            taken = dict(edge_sets)
            for index, part in enumerate(getattr(self, kind)):
                with schema.located(f"{kind}[{index}]"):
                    pairs = part.pairs(mesh, lines)
                    earlier = edge_sets.get(new_name(part.name, taken), pairs[:0])  # of tables with the same name
                    edge_sets[part.name] = np.concatenate([earlier, pairs])
        if self.free is not None:
            conditions = [each for kind in TABLES for each in getattr(self, kind)]
            named = [mesh.topology.number(edge_sets[each.edges]) for each in conditions if each.edges in edge_sets]
            others = np.setdiff1d(mesh.topology.outer, np.concatenate([*named, mesh.topology.outer[:0]]))
            if len(others):
                with schema.located("free", ()):
                    edge_sets[new_name(self.free, edge_sets)] = mesh.topology.ends[others]
        mesh = replace(mesh, edge_sets=edge_sets)
        for path, arc in arcs.items():
            with schema.located(path, schema.keys_of(ArcTable)):
                mesh = replace(mesh, arcs=(*mesh.arcs, arc.on(mesh)))
        return mesh

    def problem(self, mesh: TriangleMesh) -> ContactProblem:
        """The problem on the mesh, with all functions checked."""
        forces: Field = self.body_potential
        if self.body_forces:
            with schema.located("body_forces", ()):
                forces = BodyForces(self.body_forces)
        regions = list[Region]()
        for index, table in enumerate(self.regions):
            with schema.located(f"regions[{index}]", schema.keys_of(Region)):
                if table.name is None and table.x is None and table.y is None:
                    remedy = "say which part is meant: name a region of the mesh, or give ranges x or y"
                    raise InputError("name", None, remedy)
                _ = table.cells(mesh, regions)  # raises if its range cuts triangles, or its name is taken
                regions.append(replace(table, material=replace(table.material, plane=self.material.plane)))
        condition_tables = [(f"{kind}[{i}]", each) for kind in TABLES for i, each in enumerate(getattr(self, kind))]
        if self.free is not None and self.free in mesh.edge_sets:
            condition_tables.append(("free", Traction(self.free, normal=0.0, tangential=0.0)))
        try:
            problem = ContactProblem(
                mesh, self.material, [each for _, each in condition_tables], forces, regions, self.temperature
            )
        except InputError as error:
            name, field_path = error.field.split(".")[-1], _RENAMED.get(error.field, error.field)
            for path, each in condition_tables:  # the last table whose edges or name the error quotes
                if error.value in (each.edges, getattr(each, "name", None)):
                    field_path = f"{path}.{name}" if name in schema.keys_of(type(each)) else path
            with schema.located(field_path, ()):
                raise
        edges_of_contacts = {contact.edges for contact in self.contacts}
        for index, joint in enumerate(self.joints):
            if joint.name not in edges_of_contacts:
                remedy = 'no contact uses this joint: add [[contacts]] with these edges, law = "tied" if it is to hold'
                raise InputError(f"joints[{index}]", joint.name, remedy)
        _check_values(condition_tables, mesh)
        return problem


def _check_values(condition_tables: Iterable[tuple[str, Condition]], mesh: TriangleMesh) -> None:
    """Evaluate functions at the points that the discretisation uses, so that an error names the key in the file."""
    for path, condition in condition_tables:
        samples = SAMPLES if isinstance(condition, Traction) else np.zeros(0)
        t = np.concatenate([[0.0, 1.0], gauss_legendre(LOAD_POINTS)[0], samples])
        x, y = (points.ravel() for points in mesh.points_along(mesh.edges(condition.edges), t))
        for name, schema_key in schema.keys_of(type(condition)).items():
            value = getattr(condition, name)
            if isinstance(schema_key.kind, schema.Varying) and callable(value):
                with np.errstate(all="ignore"):
                    evaluate(f"{path}.{name}", value, x, y, minimum=schema_key.kind.least)


@dataclass(frozen=True)
class FileReader:
    """Reads fields of a problem file: numbers, expressions, polynomials, and data at points."""

    data: Mapping[str, Any]
    """The document as TOML gives it."""
    constants: Mapping[str, float]
    """Numbers that expressions may use by name."""
    t: float | None = None
    """Value of t in expressions; None without a history, where t is not defined."""
    folders: tuple[Path, ...] = ()
    """Folder of the problem file, to which paths of other files are relative, and that to which a link to it leads."""
    whole = Document

    def path_of(self, file: str) -> Path:
        """The path of a file that the problem file names: beside it, or where a link to the problem file leads."""
        if not self.folders:
            raise InputError("file", file, "a text has no folder to find it in: read the problem file by load_problem")
        paths = [folder / file for folder in self.folders]
        return next(filter(os.path.exists, paths), paths[0])

    def field(self, value: Any) -> Field:
        """A number, also from an expression without x and y; or a function: expression, polynomial, data at points."""
        if isinstance(value, dict) and "file" in value:
            data = schema.read_table(PointDataTable, value, self)
            with schema.located("", schema.keys_of(PointDataTable)):
                return PointData.load(self.path_of(data.file), data.data)
        if isinstance(value, dict):
            table = schema.read_table(PolynomialTable, value, self)
            with schema.located("", ()):
                return Polynomial(table.polynomial)
        if isinstance(value, str):
            with schema.located("", ()):
                names = Expression(value, self.constants).names  # an error names all constants
                if self.t is None and "t" in names:
                    remedy = "t changes in a history only: add [history] with times, or do without t"
                    raise InputError("", value, remedy)
                constants = {name: number for name, number in self.constants.items() if name in names}
                formula = Expression(value, constants, self.t if self.t is not None and "t" in names else 0.0)
                return formula if names & {"x", "y"} else float(evaluate("", formula, np.zeros(1), np.zeros(1))[0])
        if isinstance(value, bool) or not isinstance(value, int | float):
            remedy = "give a number, an expression in quotes, or { polynomial = [[c00, c01], [c10]] }"
            raise InputError("", value, remedy)
        return schema.FINITE.check("", value)


@dataclass(frozen=True, eq=False)
class ProblemFile(WithFields):
    """A problem file that was read: the problem, and how to solve it."""

    problem: ContactProblem
    """The problem; with a history the problem at its first time."""
    title: str
    description: str
    """Title and description that the author gave."""
    units: Units
    """Labels of the numbers' units."""
    solve_options: Mapping[str, Any]
    """Arguments for `qvi_contact.solve`."""
    refine_options: Mapping[str, Any]
    """Further arguments for `qvi_contact.refine`."""
    times: tuple[float, ...]
    """Times of the load steps; empty without a history."""
    sweep: SweepPlan | None
    """The sweep that the file asks for, if any."""
    _reader: FileReader = field(repr=False)
    text: str = field(default="", repr=False)
    """The text of the file."""

    @property
    def element(self) -> dict[str, Any]:
        """Arguments for `qvi_contact.discretize` in the file: degree and law_on."""
        return {name: value for name, value in self.solve_options.items() if name in ELEMENT_OPTIONS}

    @property
    def constants(self) -> Mapping[str, float]:
        """Numbers that expressions may use by name."""
        return self._reader.constants

    @property
    def files(self) -> dict[str, Path]:
        """Other files that the problem file reads, with a mesh or values at points: name in the file → path."""

        def file_names(value: Any) -> Iterator[str]:
            if isinstance(value, dict) and isinstance(value.get("file"), str):
                yield value["file"]
            for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
                yield from file_names(part)

        names = file_names(self._reader.data) if self._reader.folders else ()
        paths = {name: self._reader.path_of(name) for name in names}
        return {name: path for name, path in paths.items() if os.path.isfile(path)}  # not a load named "file"

    def with_constants(self, changed: Mapping[str, float]) -> "ProblemFile":
        """The same file with other values of some of its constants, on the same mesh; `InputError` for other names."""
        for name in mapping("constants", changed, "values by name"):
            known_name("constants", name, {"constants": self.constants})
        file = _from_tables(self._reader.data, self._reader.folders, self.problem.mesh, {**self.constants, **changed})
        return replace(file, text=self.text)

    @cached_property
    def problems(self) -> tuple[ContactProblem, ...]:
        """The problems of all load steps, on one mesh; without a history the single problem."""
        problems = [self.problem]
        time_tables = {name: value for name, value in self._reader.data.items() if name in _READ_AGAIN}
        for t in self.times[1:]:
            try:
                document: Document = schema.read_table(Document, time_tables, replace(self._reader, t=t), partly=True)
                problems.append(document.problem(self.problem.mesh))
            except InputError as error:
                raise type(error)(error.field, error.value, f"at t = {t:g}: {error.remedy}") from error
        return tuple(problems)

    @contextmanager
    def named_errors(self) -> Iterator[None]:
        """Give input errors raised in the block, such as loads out of balance, their path in the file."""
        try:
            yield
        except InputError as error:
            # the text of an error about a plate or pin names its contact
            path = _RENAMED.get(error.field, error.field.replace(f"{RigidPlate.__name__}.", "contacts.plate."))
            for kind, options in (("refine", self.refine_options), ("solve", self.solve_options)):
                if error.value is not None and options.get(error.field) == error.value:  # the file has that value
                    path = f"{kind}.{error.field}"
            if path == error.field:
                raise
            raise type(error)(path, error.value, error.remedy) from error


def load_problem(path: str | Path) -> ProblemFile:
    """Read a problem file (TOML); the folder ``examples`` shows how to write one.

    `InputError` if the file cannot be read, or a value in it is wrong. The error's field is then the path of the key,
    such as ``contacts[1].friction``, counted from 0. Other files are looked for beside the file, then, if it is a link,
    beside the file that it leads to.
    """
    path = given_path("file", path)
    try:
        with path.open("rb") as stream:
            content = stream.read(_LONGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a name no file can have
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError("file", str(path), f"cannot be read ({reason}): give the name of a problem file") from error
    if len(content) > _LONGEST:
        raise InputError("file", str(path), _TOO_LONG)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        remedy = f"is not text in UTF-8 (byte {error.start}): give a problem file (TOML), saved in that encoding"
        raise InputError("file", str(path), remedy) from error
    return _from_text(text, tuple(dict.fromkeys((path.parent, Path(os.path.realpath(path)).parent))))


def problem_from_toml(text: str, folder: str | Path | None = None) -> ProblemFile:
    """Read a problem from TOML text; see `load_problem`.

    Paths in the text are relative to `folder`; without a folder a text that names a file is refused.
    """
    if not isinstance(text, str):
        raise InputError("TOML", text, "give the text of a problem file, or its name to load_problem")
    return _from_text(text, () if folder is None else (given_path("folder", folder),))


def _from_text(text: str, folders: tuple[Path, ...]) -> ProblemFile:
    text = text.replace("\r\n", "\n")
    if len(text) > _LONGEST:
        raise InputError("TOML", text[:200], _TOO_LONG)
    try:
        data = tomllib.loads(text)
        _ = repr(data)  # which messages need: it fails for too many digits, and too deep tables
    except ValueError as error:
        _, separator, rest = str(error).partition("at line ")  # the parser's message may name a line
        number, lines = rest.split(",")[0], text.splitlines()
        line = lines[int(number) - 1] if separator and number.isdigit() and 0 < int(number) <= len(lines) else ""
        hint = "no comma may stand before }. The parser says: " * bool(re.search(r",\s*}", line))
        raise InputError("TOML", line, f"correct the syntax: {hint}{error}") from error
    except RecursionError as error:
        raise InputError("TOML", text[:100], "lists and tables are nested too deeply: remove brackets") from error
    return replace(_from_tables(data, folders, None, {}), text=text)


def _from_tables(
    data: Mapping[str, Any], folders: tuple[Path, ...], mesh: TriangleMesh | None, changed: Mapping[str, float]
) -> ProblemFile:
    """The problem file of a document; `mesh` replaces the mesh, `changed` the values of some constants."""
    early_tables = {name: data[name] for name in ("constants", "history") if name in data}  # needed to read expressions
    first = schema.read_values(Document, early_tables, FileReader(data, {}), partly=True)
    constants = {**first.get("constants", {}), **changed}
    times = first["history"].times if "history" in first else ()
    for name, value in constants.items():
        with schema.located(f"constants.{schema.quoted(name)}", ()):
            if not name.isidentifier() or not unicodedata.is_normalized("NFKC", name):
                raise InputError("", name, "give a name of letters, digits and _ that does not begin with a digit")
            Expression(name, {name: value})
            _ = schema.FINITE.check("", value)  # also changed constants
    reader = FileReader(data, constants, times[0] if times else None, folders)
    document: Document = schema.read_table(Document, data, reader)
    problem_file = ProblemFile(
        problem=document.problem(document.built_mesh(reader) if mesh is None else mesh),
        title=document.title,
        description=document.description,
        units=document.units,
        solve_options=document.solve,
        refine_options=document.refine,
        times=times,
        sweep=document.sweep,
        _reader=reader,
    )
    _ = problem_file.problems  # reads the other times, and so checks them
    return problem_file
