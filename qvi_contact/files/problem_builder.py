"""From the document of a problem file to a `ContactProblem`; errors name the place in the file."""

import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from qvi_contact.basics.checks import Field, FloatArray, evaluate
from qvi_contact.discretization.loads import LOAD_POINTS
from qvi_contact.element import bernstein
from qvi_contact.element.legendre import gauss_legendre
from qvi_contact.errors import InputError
from qvi_contact.files.located import located
from qvi_contact.files.mesh_builder import built_mesh
from qvi_contact.files.problem_document import (
    STRENGTH_KEYS,
    ContactTable,
    Document,
    DriveTable,
    PolynomialTable,
    StrengthTable,
    quoted,
)
from qvi_contact.mesh.triangles import TriangleMesh
from qvi_contact.problem.conditions import (
    DRIVES,
    Condition,
    Contact,
    Displacement,
    RigidPlate,
    Symmetry,
    Traction,
    disc_gap,
)
from qvi_contact.problem.fields import BodyForces, Expression, Polynomial
from qvi_contact.problem.material import Material, Region, cell_materials
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.problem.strength import STRENGTHS, Strength

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
    "contacts": ("friction", "gap", "offset", "cohesion", "shear_limit", "pore_pressure"),
}
"""Keys whose values are functions of x and y."""

_NOT_NEGATIVE: Final = ("friction", "cohesion", "shear_limit", "pore_pressure")
_RENAMED: Final = {
    "ContactProblem.body_potential": "body_potential",
    "ContactProblem.mesh": "mesh",
    "ContactProblem.conditions": "boundary conditions",
}


@dataclass(frozen=True)
class Reader:
    """Makes objects out of tables.

    Attributes
    ----------
    document : Document
        The tables.
    t : float or None
        Value of t in expressions; None where there is no history, and t means nothing.
    folder : Path or None
        Where the problem file lies, for the mesh file that it names; None where there is none.

    """

    document: Document
    t: float | None = None
    folder: Path | None = None

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
            known = self.document.constants
            used = {name: value for name, value in known.items() if name in words}
            try:
                expression = Expression(text, used)
            except InputError:
                expression = Expression(text, known)  # the same error, which names all constants
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
            raise InputError(path, value, "this is one number: it cannot depend on x and y")
        return float(here[0])

    def mesh(self) -> TriangleMesh:
        """The mesh with its named edges, joints and regions."""
        return built_mesh(self.document, self.folder)

    def problem(self, mesh: TriangleMesh) -> ContactProblem:
        """The problem on that mesh, its fields checked where they count."""
        document = self.document
        _check_constants(document.constants)
        conditions = list(self._conditions(mesh))
        potential = self._potential()
        plane = document.material.plane
        strength = self._strength("material.strength", document.material.strength)
        with located("material", document.material):
            material = Material(document.material.young, document.material.poisson, plane, strength)
        regions = []
        for index, table in enumerate(document.regions):
            strength = self._strength(f"regions[{index}].strength", table.strength)
            with located(f"regions[{index}]", table):
                own = Material(table.young, table.poisson, plane, strength)
                if table.name is None and table.x is None and table.y is None and not document.mesh.is_grid:
                    remedy = "say which triangles are meant: name a region of the mesh, or give x and y"
                    raise InputError("name", None, remedy)
                x, y = (None if pair is None or table.name else (pair[0], pair[1]) for pair in (table.x, table.y))
                regions.append(Region(own, x, y, table.name))
                cell_materials(mesh, regions[-1:])
        try:
            problem = ContactProblem(mesh, material, conditions, potential, regions)
        except InputError as error:
            with located(self._culprit(error)):
                raise
        self._check_values(problem)
        return problem

    def _potential(self) -> Field:
        """The potential of the body force, or of several."""
        document = self.document
        if not document.body_forces:
            return self.field("body_potential", document.body_potential)
        if document.body_potential != 0.0:
            raise InputError("body_potential", document.body_potential, "body_forces are given: leave one of them out")
        named = {name: self.field(f"body_forces.{quoted(name)}", value) for name, value in document.body_forces.items()}
        with located("body_forces"):
            return BodyForces(named)

    def _strength(self, path: str, table: StrengthTable | None) -> Strength | None:
        """What a material can carry."""
        if table is None:
            return None
        given: dict[str, Any] = {}
        for key in (key for keys in STRENGTH_KEYS[table.law] for key in keys):
            read = self.scalar if key == "phi" else self.optional
            given[key] = read(f"{path}.{key}", getattr(table, key))
        with located(path, table):
            return STRENGTHS[table.law](**given)

    def _conditions(self, mesh: TriangleMesh) -> Iterator[Condition]:
        for kind in TABLES.values():
            for index, table in enumerate(getattr(self.document, kind)):
                path = f"{kind}[{index}]"
                with located(path, table):
                    _ = mesh.edges(table.edges) if kind == "contacts" else mesh.edge_set(table.edges)
                fields = {key: self.optional(f"{path}.{key}", getattr(table, key)) for key in FIELDS[kind]}
                plate = self._obstacle(path, table, fields) if kind == "contacts" else None
                with located(path, table):
                    yield _condition(table, kind, fields, plate)
        used = {contact.edges for contact in self.document.contacts}
        for index, joint in enumerate(self.document.joints):
            if joint.name not in used:
                remedy = 'no contact uses this joint: add [[contacts]] with these edges, law = "tied" if it is to hold'
                raise InputError(f"joints[{index}]", joint.name, remedy)

    def _obstacle(self, path: str, table: ContactTable, fields: dict[str, Any]) -> RigidPlate | None:
        """What moves the obstacle of a contact; a pin gives the gap too."""
        if table.plate is not None:
            return self._plate(f"{path}.plate", table.plate, table.plate.pivot)
        if table.pin is None:
            return None
        with located(f"{path}.pin", table.pin):
            fields["gap"] = disc_gap((table.pin.centre[0], table.pin.centre[1]), table.pin.radius)
        return self._plate(f"{path}.pin", table.pin, table.pin.centre)

    def _plate(self, path: str, table: DriveTable, pivot: Sequence[float]) -> RigidPlate:
        drives = {name: getattr(table, name) for pair in DRIVES.items() for name in pair}
        given: dict[str, Any] = {name: self.scalar(f"{path}.{name}", value) for name, value in drives.items()}
        with located(path, table):
            return RigidPlate(**given, pivot=(pivot[0], pivot[1]))

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
            x, y = _points(problem.mesh, condition)
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
        driven = [
            f"contacts[{i}].{kind}.{key}"
            for i, table in enumerate(document.contacts)
            for kind in ("plate", "pin")
            if getattr(getattr(table, kind), key, None) is not None
        ]
        return driven[0] if len(driven) == 1 else f"contacts.plate.{key}"
    if error.value is not None and getattr(document.solve, error.field, None) == error.value:
        return f"solve.{error.field}"
    if error.value is not None and getattr(document.refine, error.field, None) == error.value:
        return f"refine.{error.field}"
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


def _points(mesh: TriangleMesh, condition: Condition) -> tuple[FloatArray, FloatArray]:
    """Ends, Gauss points and, for tractions, samples of edges: where conditions that do not jump are evaluated."""
    samples = bernstein.SAMPLES if isinstance(condition, Traction) else np.zeros(0)
    t = np.concatenate([[0.0, 1.0], gauss_legendre(LOAD_POINTS)[0], samples])
    x, y = mesh.points_along(mesh.edges(condition.edges), t)
    return x.ravel(), y.ravel()
