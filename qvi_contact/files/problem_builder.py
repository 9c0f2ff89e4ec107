"""From the document of a problem file to a `ContactProblem`; errors name the place in the file."""

import unicodedata
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.discretization.loads import LOAD_POINTS
from qvi_contact.element.bogner_fox_schmit import GAUSS_COUNT
from qvi_contact.element.hermite import gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.files.problem_document import (
    ContactTable,
    Document,
    PlateTable,
    PolynomialTable,
    Rectangle,
    RefineTable,
    Segment,
    Table,
    quoted,
)
from qvi_contact.mesh.lines import graded_lines, on_line
from qvi_contact.mesh.mesh import Mesh
from qvi_contact.mesh.rectilinear import RectilinearMesh
from qvi_contact.problem.conditions import Condition, Contact, Displacement, RigidPlate, Symmetry, Traction
from qvi_contact.problem.fields import Expression, Polynomial
from qvi_contact.problem.material import Material, Region, cell_materials
from qvi_contact.problem.problem import ContactProblem

TABLES: Final[dict[type, str]] = {
    Symmetry: "symmetry",
    Displacement: "displacements",
    Traction: "tractions",
    Contact: "contacts",
}
"""Which table states which condition, in the order in which a problem gets them."""

FIELDS: Final[dict[str, tuple[str, ...]]] = {
    "symmetry": (),
    "displacements": ("x", "y", "normal", "tangential"),
    "tractions": ("x", "y", "normal", "tangential"),
    "contacts": ("friction", "gap", "offset", "cohesion", "shear_limit"),
}
"""Keys whose values are functions of x and y."""

_NOT_NEGATIVE: Final = ("friction", "cohesion", "shear_limit")
_MOST_CELLS: Final = 1_000_000
_RENAMED: Final = {
    "ContactProblem.body_potential": "body_potential",
    "ContactProblem.mesh": "mesh",
    "ContactProblem.conditions": "boundary conditions",
}
_IN_TOML: Final = (("with_edges()", "[[edges]]"), ("with_joint()", "[[joints]]"))  # remedies written for Python


@contextmanager
def located(path: str, table: Table | None = None) -> Iterator[None]:
    """Errors raised in the block get their path in the file: that of the table, and the key if it is one of its own."""
    try:
        yield
    except InputError as error:
        key = error.field.split(".")[-1]
        known = table is not None and key in type(table).model_fields
        remedy = error.remedy
        for python, toml in _IN_TOML:
            remedy = remedy.replace(python, toml)
        raise InputError(f"{path}.{key}" if known else path, error.value, remedy) from error


@dataclass(frozen=True)
class Reader:
    """Makes objects out of tables.

    Attributes
    ----------
    document : Document
        The tables.
    t : float or None
        Value of t in expressions; None where there is no history, and t means nothing.

    """

    document: Document
    t: float | None = None

    def field(self, path: str, value: float | str | PolynomialTable) -> Field:
        """A number, expression or polynomial; one without its table is the place to look for errors."""
        with located(path):
            if isinstance(value, PolynomialTable):
                return Polynomial(value.polynomial)
            return self._expression(value) if isinstance(value, str) else float(value)

    def optional(self, path: str, value: float | str | PolynomialTable | None) -> Field | None:
        """The same, or nothing."""
        return None if value is None else self.field(path, value)

    def _expression(self, text: str) -> Expression:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of Python's parser, about texts that are refused anyway
            words = set("".join(c if c.isalnum() or c == "_" else " " for c in text).split())
            constants = {name: value for name, value in self.document.constants.items() if name in words}
            expression = Expression(text, constants)
            if not expression.uses_time:
                return expression
            if self.t is None:
                raise InputError("", text, "t changes in a history only: add [history] with times, or do without t")
            return expression.at_time(self.t)

    def scalar(self, path: str, value: float | str | None) -> float | None:
        """A number, which may be written as an expression of constants and t."""
        if value is None or not isinstance(value, str):
            return value
        expression = self.field(path, value)
        assert isinstance(expression, Expression)
        here, there = (evaluate(path, expression, np.array([x]), np.array([y])) for x, y in ((0.0, 0.0), (0.7, 0.3)))
        if here != there:
            raise InputError(path, value, "this is one number: x and y mean nothing here")
        return float(here[0])

    def mesh(self) -> RectilinearMesh:
        """The grid with cells left out, its named edges and joints, refined."""
        table = self.document.mesh
        x, y = (_lines(f"mesh.{axis}", getattr(table, axis)) for axis in "xy")
        if (len(x) - 1) * (len(y) - 1) > _MOST_CELLS:
            raise InputError("mesh", (len(x) - 1, len(y) - 1), f"give at most {_MOST_CELLS} cells in all")
        with located("mesh", table):
            mesh = RectilinearMesh(x, y)
        removed = np.zeros(mesh.shape, dtype=bool)
        for index, rectangle in enumerate(table.remove):
            removed[_cells(f"mesh.remove[{index}]", mesh, rectangle)] = True
        with located("mesh.remove"):
            mesh = RectilinearMesh(x, y, ~removed)
        for kind, add in (("edges", RectilinearMesh.with_edges), ("joints", RectilinearMesh.with_joint)):
            for index, entry in enumerate(getattr(self.document, kind)):
                with located(f"{kind}[{index}]", entry):
                    mesh = add(mesh, **entry.model_dump())
        return mesh if table.refine is None else _refined(mesh, table.refine)

    def problem(self, mesh: Mesh) -> ContactProblem:
        """The problem on that mesh, its fields checked where they count."""
        document = self.document
        _check_constants(document.constants)
        conditions = list(self._conditions(mesh))
        potential = self.field("body_potential", document.body_potential)
        plane = document.material.plane
        with located("material", document.material):
            material = Material(document.material.young, document.material.poisson, plane)
        regions = []
        for index, table in enumerate(document.regions):
            with located(f"regions[{index}]", table):
                x, y = (None if pair is None else (pair[0], pair[1]) for pair in (table.x, table.y))
                regions.append(Region(Material(table.young, table.poisson, plane), x, y))
                cell_materials(mesh, regions[-1:])
        try:
            problem = ContactProblem(mesh, material, conditions, potential, regions)
        except InputError as error:
            with located(self._culprit(error)):
                raise
        self._check_values(problem)
        return problem

    def _conditions(self, mesh: Mesh) -> Iterator[Condition]:
        for kind in TABLES.values():
            for index, table in enumerate(getattr(self.document, kind)):
                path = f"{kind}[{index}]"
                with located(path, table):
                    if kind != "contacts" or table.edges not in mesh.joint_names:
                        mesh.edge_set(table.edges)
                fields = {key: self.optional(f"{path}.{key}", getattr(table, key)) for key in FIELDS[kind]}
                plate = self._plate(f"{path}.plate", table.plate) if kind == "contacts" else None
                with located(path, table):
                    yield _condition(table, kind, fields, plate)
        used = {contact.edges for contact in self.document.contacts}
        for index, joint in enumerate(self.document.joints):
            if joint.name not in used:
                remedy = 'no contact uses this joint: add [[contacts]] with these edges, law = "tied" if it is to hold'
                raise InputError(f"joints[{index}]", joint.name, remedy)

    def _plate(self, path: str, table: PlateTable | None) -> RigidPlate | None:
        if table is None:
            return None
        forces = {name: getattr(table, name) for name in ("force_x", "force_y", "moment")}
        given = {name: self.scalar(f"{path}.{name}", value) for name, value in forces.items()}
        with located(path, table):
            return RigidPlate(**given, pivot=(table.pivot[0], table.pivot[1]))

    def _culprit(self, error: InputError) -> str:
        """The last table that an error about conditions can mean, by the edges or the name it complains about."""
        key = error.field.split(".")[-1]
        found = ""
        for kind in TABLES.values():
            for index, table in enumerate(getattr(self.document, kind)):
                if error.value in (table.edges, getattr(table, "name", None)):
                    found = f"{kind}[{index}]" + (f".{key}" if key in type(table).model_fields else "")
        return found or _RENAMED.get(error.field, error.field)

    def _check_values(self, problem: ContactProblem) -> None:
        """Evaluate every function where the discretisation will, so that errors name the place in the file."""
        index = dict.fromkeys(TABLES.values(), -1)
        for condition in problem.conditions:
            kind = TABLES[type(condition)]
            index[kind] += 1
            x, y = _points(problem.mesh, condition.edges)
            for key in FIELDS[kind]:
                field = getattr(condition, key)
                if callable(field):
                    least = 0.0 if key in _NOT_NEGATIVE else None
                    with np.errstate(all="ignore"):
                        evaluate(f"{kind}[{index[kind]}].{key}", field, x, y, minimum=least)


def file_path(document: Document, error: InputError) -> str:
    """Path in the file of what an error met after reading is about."""
    first, _, key = error.field.partition(".")
    if first == "RigidPlate":
        driven = [i for i, table in enumerate(document.contacts) if getattr(table.plate, key, None) is not None]
        return f"contacts[{driven[0]}].plate.{key}" if len(driven) == 1 else f"contacts.plate.{key}"
    if error.value is not None and getattr(document.solve, error.field, None) == error.value:
        return f"solve.{error.field}"
    return _RENAMED.get(error.field, error.field)


def _condition(table: Any, kind: str, fields: dict[str, Any], plate: RigidPlate | None) -> Condition:
    if kind == "symmetry":
        return Symmetry(table.edges)
    if kind == "displacements":
        return Displacement(table.edges, **fields)
    if kind == "tractions":
        return Traction(table.edges, **fields, name=table.name or "")
    assert isinstance(table, ContactTable)
    if table.friction is None:
        fields["friction"] = 0.0
    return Contact(table.edges, **fields, name=table.name or "", law=table.law, plate=plate)


def _check_constants(constants: dict[str, float]) -> None:
    for name, value in constants.items():
        with located(f"constants.{quoted(name)}"):
            if not name.isidentifier() or not unicodedata.is_normalized("NFKC", name):
                raise InputError("", name, "give a name of letters, digits and _ that does not begin with a digit")
            Expression(name, {name: value})


def _lines(path: str, axis: list[float] | Segment | list[Segment]) -> FloatArray:
    """Grid lines as the file describes them."""
    segments = [axis] if isinstance(axis, Segment) else [part for part in axis if isinstance(part, Segment)]
    if not segments:
        return np.array(axis, dtype=float)
    lines: FloatArray = np.empty(0)
    for index, segment in enumerate(segments):
        place = path if isinstance(axis, Segment) else f"{path}[{index}]"
        start = segment.start
        if start is None:
            if not len(lines):
                raise InputError(f"{place}.start", None, "add this key, it is needed")
            start = float(lines[-1])
        elif len(lines) and start != lines[-1]:
            raise InputError(f"{place}.start", start, f"start where the one before stops, at {lines[-1]:g}")
        with located(place, segment), np.errstate(all="ignore"):
            more = graded_lines(start, segment.stop, segment.cells, segment.grading, segment.both_ends)
            if not np.isfinite(more).all():
                raise InputError("grading", segment.grading, "give a number nearer to 1, or fewer cells")
        lines = np.concatenate([lines[:-1], more])
    return lines


def _cells(path: str, mesh: RectilinearMesh, rectangle: Rectangle) -> tuple[slice, slice]:
    """Rows and columns of the cells of a rectangle."""
    found = []
    for key, lines in (("y", mesh.y), ("x", mesh.x)):
        bounds = getattr(rectangle, key)
        if bounds is None:
            found.append(slice(None))
            continue
        with located(f"{path}.{key}"):
            first, last = (int(np.searchsorted(lines, on_line("", bound, lines))) for bound in bounds)
        if first >= last:
            raise InputError(f"{path}.{key}", bounds, "give the smaller end first")
        found.append(slice(first, last))
    return found[0], found[1]


def _refined(mesh: RectilinearMesh, table: RefineTable) -> RectilinearMesh:
    for index, name in enumerate(table.towards):
        with located(f"mesh.refine.towards[{index}]"):
            mesh.edges(name)
    with located("mesh.refine", table):
        wanted = _refined_size(mesh.x, table) * _refined_size(mesh.y, table)
        if wanted > _MOST_CELLS:
            raise InputError("largest", table.largest, f"give more: this makes some {wanted:.0e} cells in all")
        return mesh.refined(table.largest, table.towards, table.smallest, table.ratio)


def _refined_size(lines: FloatArray, table: RefineTable) -> float:
    """About how many cells a refined row has at most: 2 log(1 + growth · largest/smallest)/growth around each line."""
    smallest = table.smallest or table.largest
    if not 0.0 < smallest <= table.largest:
        return 0.0  # refused where it is used
    extent, growth = float(lines[-1] - lines[0]), -float(np.log(table.ratio))
    uniform = len(lines) + extent / table.largest
    graded = uniform + len(lines) * 2.0 * np.log1p(growth * table.largest / smallest) / growth
    return float(min(graded, len(lines) + extent / smallest))


def _points(mesh: Mesh, edges: str) -> tuple[FloatArray, FloatArray]:
    """Ends and Gauss points of edges: all places where their conditions are evaluated."""
    t = np.concatenate([[0.0, 1.0], gauss_legendre(GAUSS_COUNT)[0], gauss_legendre(LOAD_POINTS)[0]])
    x, y = mesh.points_along(mesh.edges(edges), t)
    return x.ravel(), y.ravel()
