"""Problem files: contact problems as TOML, which people can write and programs can keep.

A file can never run code: functions are numbers, polynomials or expressions of `qvi_contact.problem.fields`. Paths in
errors count from 0: ``contacts[1].friction`` belongs to the second ``[[contacts]]``.
"""

import os
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal

import numpy as np

from qvi_contact.basics import schema
from qvi_contact.basics.checks import Field, evaluate, mapping
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
"""Which table states which condition, in the order in which a problem gets them."""

_LONGEST: Final = 20_000_000  # bytes of a file, characters of its text
_TOO_LONG: Final = (
    f"has more than {_LONGEST} bytes, the limit of a problem file: give grid lines as {{ start = …, stop = …, "
    "cells = … }, triangles in a mesh file, and functions as expressions"
)
_MOST_STEPS: Final = 10_000
_IN_TIME: Final = ("version", "body_potential", "body_forces", "temperature", "material", "regions", *TABLES)
"""Tables that expressions in t may stand in."""
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
    """The first: `start = 0.0`."""
    stop: float
    """The last: `stop = 6.3`."""
    steps: Annotated[int, schema.Whole(1, _MOST_STEPS)]
    """Number of steps: `steps = 20`."""


class Values(schema.Kind):
    """Numbers, at least one, as a list or a range."""

    of = TimeRange

    def read(self, value: Any, reader: schema.Reader) -> tuple[float, ...]:
        """All of them."""
        if isinstance(value, dict):
            given = schema.read_table(TimeRange, value, reader)
            return tuple(np.linspace(given.start, given.stop, given.steps + 1).tolist())
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
    """File with triangles and point data, as .vtu or .msh, beside the problem file: `file = "temperature.vtu"`."""
    data: str
    """Name of the point data in it, one number a point: `data = "T"`."""


@dataclass(frozen=True, eq=False, repr=False)
class HistoryTable:
    """Load steps: the values that t takes."""

    times: Annotated[tuple[float, ...], Values()]
    """Values that t takes, a list or a range; friction remembers from step to step: `times = [0.0, 0.5, 1.0]`."""


@dataclass(frozen=True)
class SweepPlan:
    """Arguments for `qvi_contact.solve_sweep`: parameter, values, and names of what is changed, by default all."""

    parameter: Annotated[Any, schema.Choice(PARAMETERS)]  # checked by solve_sweep too
    """friction: μ of contacts; load: a factor of loads; gap, offset: what is added to these of contacts [length]:
    `parameter = "friction"`."""
    values: Annotated[tuple[float, ...], Values()]
    """Its values, a list or a range: `values = { start = 0.1, stop = 0.5, steps = 4 }`."""
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
    """Anything else worth keeping: `description = "Water at 40 m"`."""
    body_potential: Field = 0.0
    """Field φ with the body force −∇φ; ρ g y under gravity: `body_potential = "0.024 * y"`."""
    body_forces: dict[str, Field] | None = None
    """Several by name instead, which `limit` and sweeps can multiply: `body_forces = { weight = "24.0 * y" }`."""
    temperature: Field = 0.0
    """Rise of temperature since the body was free of stress, see `expansion` in materials: `temperature = 40.0`."""
    units: Units = field(default_factory=Units)
    """Labels of units, see `[units]`: `units = { length = "mm", stress = "MPa" }`."""
    constants: dict[str, float] | None = None
    """Numbers that expressions may name: `constants = { mu = 0.3, p = 10.0 }`."""
    mesh: MeshTable | None = field(default=None, metadata=schema.key(needed=True))
    """The body, see `[mesh]`: `mesh = { x = [0.0, 1.0], y = [0.0, 1.0] }`."""
    edges: tuple[EdgesTable, ...] = ()
    """Named parts of the boundary, see `[[edges]]`: `edges = [{ name = "base", side = "bottom", stop = 0.5 }]`."""
    joints: tuple[JointTable, ...] = ()
    """Lines inside, see `[[joints]]`; each needs a contact: `joints = [{ name = "a", segment = [[0, 1], [2, 1]] }]`."""
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
    solve: Annotated[Mapping[str, Any], schema.Options(SolveOptions)] = field(default_factory=dict)
    """How to solve it, see `[solve]`: `solve = { degree = 5 }`."""
    refine: Annotated[Mapping[str, Any], schema.Options(RefineOptions)] = field(default_factory=dict)
    """How to refine it, see `[refine]`: `refine = { target = 1e-4 }`."""
    history: HistoryTable | None = None
    """Load steps, see `[history]`: `history = { times = [0.0, 1.0, 2.0] }`."""
    sweep: SweepPlan | None = None
    """Values of a parameter, see `[sweep]`: `sweep = { parameter = "friction", values = [0.1, 0.2] }`."""

    def __post_init__(self) -> None:
        if self.body_forces and self.body_potential != 0.0:
            raise InputError("body_potential", self.body_potential, "body_forces are given: leave one of them out")
        if self.sweep is not None and self.history is not None:
            raise InputError("sweep", self.sweep.parameter, "a file with a [history] cannot be swept: leave one out")

    def built_mesh(self, folder: Path | None) -> TriangleMesh:
        """The mesh with its named edges, joints, regions and arcs; a mesh file is looked for in the folder."""
        table, lines = self.mesh, None
        assert table is not None  # it is needed
        arcs = {f"mesh.arcs[{index}]": arc for index, arc in enumerate(table.arcs)}
        with schema.located("mesh"):
            if table.file is not None:
                try:
                    parts = read_mesh(_beside(folder, table.file))
                    if table.join is not None:
                        before = {path: arc for path, arc in arcs.items() if arc.name in parts.edge_sets}
                        arcs = {path: arc for path, arc in arcs.items() if path not in before}
                        curves = [arc.curve(parts.edge_sets[arc.name or ""], parts.vertices) for arc in before.values()]
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
            return mesh
        with schema.located("mesh.refine"):
            lines = table.refine.lines(mesh, table.body(lines), lines)
            mesh = table.grid(lines)
        return self._named(mesh, lines, arcs)

    def _named(self, mesh: TriangleMesh, lines: Lines | None, arcs: Mapping[str, ArcTable]) -> TriangleMesh:
        """The mesh with named parts, and edges on arcs; the lines are those of a grid."""
        sets = dict(mesh.edge_sets)
        parts = {f"{kind}[{k}]": part for kind in ("edges", "joints") for k, part in enumerate(getattr(self, kind))}
        for path, part in parts.items():
            with schema.located(path, ("name", "start", "stop", "at", "segment", "box")):
                sets[new_name(part.name, sets)] = part.pairs(mesh, lines)
        mesh = replace(mesh, edge_sets=sets)
        for path, arc in arcs.items():
            with schema.located(path, schema.keys_of(ArcTable)):
                mesh = replace(mesh, arcs=(*mesh.arcs, arc.on(mesh)))
        return mesh

    def problem(self, mesh: TriangleMesh, given: Mapping[str, Any]) -> ContactProblem:
        """The problem on that mesh, its fields checked where they count; `given` are the tables as they were read."""
        forces: Field = self.body_potential
        if self.body_forces:
            with schema.located("body_forces", ()):
                forces = BodyForces(self.body_forces)
        regions = list[Region]()
        for index, table in enumerate(self.regions):
            with schema.located(f"regions[{index}]", schema.keys_of(Region)):
                if table.name is None and table.x is None and table.y is None and "x" not in given["mesh"]:
                    remedy = "say which triangles are meant: name a region of the mesh, or give x and y"
                    raise InputError("name", None, remedy)
                _ = table.cells(mesh, regions)
                regions.append(replace(table, material=replace(table.material, plane=self.material.plane)))
        placed = [(f"{kind}[{i}]", each) for kind in TABLES for i, each in enumerate(getattr(self, kind))]
        try:
            problem = ContactProblem(
                mesh, self.material, [each for _, each in placed], forces, regions, self.temperature
            )
        except InputError as error:
            name, found = error.field.split(".")[-1], _RENAMED.get(error.field, error.field)
            for path, each in placed:  # the last table that the error can mean, by the edges or name that it names
                if error.value in (each.edges, getattr(each, "name", None)):
                    found = f"{path}.{name}" if name in schema.keys_of(type(each)) else path
            with schema.located(found, ()):
                raise
        used = {contact.edges for contact in self.contacts}
        for index, joint in enumerate(given.get("joints", ())):
            if joint["name"] not in used:
                remedy = 'no contact uses this joint: add [[contacts]] with these edges, law = "tied" if it is to hold'
                raise InputError(f"joints[{index}]", joint["name"], remedy)
        _check_values(placed, mesh)
        return problem


def _beside(folder: Path | None, file: str) -> Path:
    """A file that is named in a problem file."""
    if folder is None:
        raise InputError("file", file, "its place is not known for a text: read the problem file by load_problem")
    return folder / file


def _check_values(placed: Iterable[tuple[str, Condition]], mesh: TriangleMesh) -> None:
    """Evaluate functions where the discretisation will, so that errors name the place in the file."""
    for path, condition in placed:
        samples = SAMPLES if isinstance(condition, Traction) else np.zeros(0)
        t = np.concatenate([[0.0, 1.0], gauss_legendre(LOAD_POINTS)[0], samples])
        x, y = (points.ravel() for points in mesh.points_along(mesh.edges(condition.edges), t))
        for name, own in schema.keys_of(type(condition)).items():
            value = getattr(condition, name)
            if isinstance(own.kind, schema.Varying) and callable(value):
                with np.errstate(all="ignore"):
                    evaluate(f"{path}.{name}", value, x, y, minimum=own.kind.least)


@dataclass(frozen=True)
class FileReader:
    """Makes objects out of the tables of a file."""

    data: Mapping[str, Any]
    """The tables, as TOML has them."""
    constants: Mapping[str, float]
    """Numbers that expressions may name."""
    t: float | None = None
    """Value of t in expressions; None where there is no history, and t means nothing."""
    folder: Path | None = None
    """Where files with point data are looked for."""
    whole = Document

    def field(self, value: Any) -> Field:
        """A number, also as an expression of constants and t; a function, as an expression or a polynomial."""
        if isinstance(value, dict) and "file" in value:
            data = schema.read_table(PointDataTable, value, self)
            with schema.located("", schema.keys_of(PointDataTable)):
                return PointData.load(_beside(self.folder, data.file), data.data)
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
                named = {name: number for name, number in self.constants.items() if name in names}
                found = Expression(value, named, self.t if self.t is not None and "t" in names else 0.0)
                return found if names & {"x", "y"} else float(evaluate("", found, np.zeros(1), np.zeros(1))[0])
        if isinstance(value, bool) or not isinstance(value, int | float):
            remedy = "give a number, an expression in quotes, or { polynomial = [[c00, c01], [c10]] }"
            raise InputError("", value, remedy)
        return float(value)


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """What a problem file says."""

    problem: ContactProblem
    """The problem, at the first time if there is a history."""
    title: str
    description: str
    """What the author calls it."""
    units: Units
    """Labels of the numbers' units."""
    solve_options: Mapping[str, Any]
    """Arguments for `qvi_contact.solve`."""
    refine_options: Mapping[str, Any]
    """Arguments for `qvi_contact.refine` beside those."""
    times: tuple[float, ...]
    """Times of the load steps; empty without a history."""
    sweep: SweepPlan | None
    """Values for which the problem is to be solved, if there is a sweep."""
    is_grid: bool
    """Whether the file gives its mesh by grid lines."""
    _reader: FileReader = field(repr=False)
    text: str = field(default="", repr=False)
    """The file itself."""

    @property
    def element(self) -> dict[str, Any]:
        """What the file says of the element: arguments for `qvi_contact.discretize`."""
        return {name: value for name, value in self.solve_options.items() if name in ELEMENT_OPTIONS}

    @property
    def constants(self) -> Mapping[str, float]:
        """Numbers that expressions may name."""
        return self._reader.constants

    @property
    def files(self) -> dict[str, Path]:
        """The files that it reads, with a mesh or values at points, by the names that it has for them."""

        def named(value: Any) -> Iterator[str]:
            if isinstance(value, dict) and isinstance(value.get("file"), str):
                yield value["file"]
            for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
                yield from named(part)

        places = {name: (self._reader.folder or Path()) / name for name in named(self._reader.data)}
        return {name: place for name, place in places.items() if os.path.isfile(place)}  # not a formula

    def with_constants(self, changed: Mapping[str, float]) -> "ProblemFile":
        """The same file with other values of some of its constants, on the same mesh; `InputError` for other names."""
        for name in mapping("constants", changed, "values by name"):
            known_name("constants", name, {"constants": self.constants})
        found = _from_tables(self._reader.data, self._reader.folder, self.problem.mesh, {**self.constants, **changed})
        return replace(found, text=self.text)

    @cached_property
    def problems(self) -> tuple[ContactProblem, ...]:
        """The problems of all load steps, on one mesh; without a history the one there is."""
        found, data = [self.problem], self._reader.data
        known = {name: data[name] for name in _IN_TIME if name in data}
        for t in self.times[1:]:
            try:
                document: Document = schema.read_table(Document, known, replace(self._reader, t=t), partly=True)
                found.append(document.problem(self.problem.mesh, data))
            except InputError as error:
                raise type(error)(error.field, error.value, f"at t = {t:g}: {error.remedy}") from error
        return tuple(found)

    @contextmanager
    def named_errors(self) -> Iterator[None]:
        """Input errors raised in the block, such as loads out of balance, get their path in the file."""
        try:
            yield
        except InputError as error:
            path, remedy = _RENAMED.get(error.field, error.field), schema.in_toml(error.remedy)
            for kind, options in (("refine", self.refine_options), ("solve", self.solve_options)):
                if error.value is not None and options.get(error.field) == error.value:
                    path = f"{kind}.{error.field}"
            first, _, name = error.field.partition(".")
            if first == RigidPlate.__name__:
                contacts = enumerate(self._reader.data["contacts"])
                places = [
                    f"[{i}].{kind}" for i, table in contacts for kind in ("plate", "pin") if name in table.get(kind, ())
                ]
                path = f"contacts{places[0]}.{name}" if len(places) == 1 else f"contacts.plate.{name}"
            if (path, remedy) == (error.field, error.remedy):
                raise
            raise type(error)(path, error.value, remedy) from error


def load_problem(path: str | Path) -> ProblemFile:
    """Read a problem file (TOML); the folder ``examples`` shows how to write them.

    `InputError` if the file cannot be read, or anything in it is wrong; the field is the path inside the file, such as
    ``contacts[1].friction``, counted from 0.
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
    return problem_from_toml(text, path.parent)


def problem_from_toml(text: str, folder: str | Path | None = None) -> ProblemFile:
    """Read a problem from TOML text; see `load_problem`.

    A mesh file is looked for in `folder`; without one a text that names a mesh file is refused.
    """
    if not isinstance(text, str):
        raise InputError("TOML", text, "give the text of a problem file, or its name to load_problem")
    folder = None if folder is None else given_path("folder", folder)
    text = text.replace("\r\n", "\n")
    if len(text) > _LONGEST:
        raise InputError("TOML", text[:200], _TOO_LONG)
    try:
        data = tomllib.loads(text)
        _check_scalars(data, "")
    except InputError:
        raise
    except ValueError as error:  # also whole numbers of too many digits
        _, found, rest = str(error).partition("at line ")  # the line that the parser complains about, if it says which
        number, lines = rest.split(",")[0], text.splitlines()
        line = lines[int(number) - 1] if found and number.isdigit() and 0 < int(number) <= len(lines) else ""
        raise InputError("TOML", line, f"correct the syntax: {error}") from error
    except RecursionError as error:
        raise InputError("TOML", text[:100], "lists and tables are nested too deeply: remove brackets") from error
    return replace(_from_tables(data, folder), text=text)


def _check_scalars(value: object, path: str) -> None:
    """Refuse values that TOML knows and no table wants."""
    if isinstance(value, dict):
        for name, item in value.items():
            _check_scalars(item, schema.joined(path, schema.quoted(name)))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _check_scalars(item, f"{path}[{index}]")
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:  # TOML's whole numbers have 64 bits
        raise InputError(path, f"a number of {value.bit_length()} bits", "give a whole number of at most 64 bits")
    elif isinstance(value, float) and not abs(value) <= schema.LARGEST:
        remedy = f"give a finite number, of at most {schema.LARGEST:g}: take other units if you need more"
        raise InputError(path, value, remedy)
    elif not isinstance(value, int | float | str):
        remedy = "give a number, a text in quotes, a list or a table; dates are not used here"
        raise InputError(path, str(value), remedy)


def _from_tables(
    data: Mapping[str, Any],
    folder: str | Path | None,
    mesh: TriangleMesh | None = None,
    changed: Mapping[str, float] = MappingProxyType({}),
) -> ProblemFile:
    """What the tables of a file say, on a mesh that was made already, or with other values of some constants."""
    given = {name: data[name] for name in ("constants", "history") if name in data}  # what expressions mean
    first = schema.read_values(Document, given, FileReader(data, {}), partly=True)
    constants = {**first.get("constants", {}), **changed}
    times = first["history"].times if "history" in first else ()
    for name, value in constants.items():
        with schema.located(f"constants.{schema.quoted(name)}", ()):
            if not name.isidentifier() or not unicodedata.is_normalized("NFKC", name):
                raise InputError("", name, "give a name of letters, digits and _ that does not begin with a digit")
            Expression(name, {name: value})
            _check_scalars(float(value), "")  # those that were changed too
    reader = FileReader(data, constants, times[0] if times else None, None if folder is None else Path(folder))
    document: Document = schema.read_table(Document, data, reader)
    found = ProblemFile(
        problem=document.problem(document.built_mesh(reader.folder) if mesh is None else mesh, data),
        title=document.title,
        description=document.description,
        units=document.units,
        solve_options=document.solve,
        refine_options=document.refine,
        times=times,
        sweep=document.sweep,
        is_grid="x" in data["mesh"],
        _reader=reader,
    )
    _ = found.problems  # checks the other times
    return found
