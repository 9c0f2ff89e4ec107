"""Problem files as text: a `ContactProblem` written as TOML, and the list of all keys.

The keys are the fields of the classes that declare the tables. The docstring of a field has the meaning of the key and
an example. `qvi-contact keys` and the page "All keys" show them.
"""

import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from qvi_contact.basics import schema
from qvi_contact.basics.checks import instance_of
from qvi_contact.basics.schema import file_keys, write_table
from qvi_contact.basics.writing import write_text
from qvi_contact.errors import InputError
from qvi_contact.files.problem_file import TABLES, VERSION, Document, PointDataTable, PolynomialTable, problem_from_toml
from qvi_contact.problem.fields import BodyForces, Expression, Polynomial
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.units import Units
from solvers.basics.types import load
from solvers.errors import UnknownNameError, closest, plain

_WIDTH: Final = 110  # largest length of a line of numbers [characters]
_ARRAY: Final = re.compile(r"^(.+) = \[\n((?: .*\n)+)\]$", re.MULTILINE)


def save_problem(path: str | Path, problem: ContactProblem, **details: Any) -> None:
    """Write a problem file, whole or not at all; `details` are the options of `problem_to_toml`."""
    write_text(path, problem_to_toml(problem, **details))


def problem_to_toml(
    problem: ContactProblem, *, title: str = "", description: str = "", units: Units | None = None
) -> str:
    """A problem as the text of a problem file, from which `problem_from_toml` makes the same problem.

    Numbers are kept to the last digit, the mesh as a list of triangles. Conditions are sorted by kind; their order has
    no meaning. Units are labels, nothing is converted. `InputError` if a function is a Python function, which a file
    cannot hold, or if expressions disagree about constants or time.

    Of a problem that was read from a file, only the state at the first time is written. Copy `[solve]`, `[refine]`,
    `[sweep]` and the times of `[history]` from that file.
    """
    remedy = "give a ContactProblem, such as the problem of a file that was read"
    instance_of(ContactProblem, "problem", problem, remedy)
    for name, value in (("title", title), ("description", description)):
        instance_of(str, name, value, "give a text")
    Units.labels(units, {})  # raises if these are no units
    text = unchecked_toml(problem, title, description, units)
    problem_from_toml(text)  # raises for values that only Python allows, such as names of several lines
    return text


def unchecked_toml(problem: ContactProblem, title: str = "", description: str = "", units: Units | None = None) -> str:
    """As `problem_to_toml`, without reading the text back as a check, which takes most of the time."""
    writer, mesh = _Writer(), problem.mesh
    document: dict[str, Any] = {"version": VERSION, "title": title, "description": description}
    if isinstance(problem.body_potential, BodyForces):
        loads = problem.body_potential.parts.items()
        document["body_forces"] = {name: writer.field(f"body_forces.{name}", part) for name, part in loads}
    elif problem.body_potential != 0.0:
        document["body_potential"] = writer.field("body_potential", problem.body_potential)
    if problem.temperature != 0.0:
        document["temperature"] = writer.field("temperature", problem.temperature)
    document["units"] = {} if units is None else {"length": units.length, "stress": units.stress}
    document["constants"] = writer.constants  # the writer fills it below
    table: dict[str, Any] = {"vertices": mesh.vertices.tolist(), "triangles": mesh.cells.tolist()}
    table["edges"] = {name: pairs.tolist() for name, pairs in mesh.edge_sets.items()}
    table["regions"] = {name: cells.tolist() for name, cells in mesh.regions.items()}
    table["arcs"] = [{"bends": arc.coefficients.tolist(), "edges": arc.edges.tolist()} for arc in mesh.arcs]
    document["mesh"] = {name: value for name, value in table.items() if value}
    document["material"] = write_table("material", problem.material, writer.field)
    tables: dict[str, Sequence[object]] = {"regions": problem.regions}
    tables |= {name: [each for each in problem.conditions if isinstance(each, kind)] for name, kind in TABLES.items()}
    for name, parts in tables.items():
        document[name] = [write_table(f"{name}[{i}]", part, writer.field) for i, part in enumerate(parts)]
    if writer.time is not None:
        document["history"] = {"times": [writer.time]}
    document = {name: value for name, value in document.items() if value not in ({}, [], "")}
    text = load("tomli_w").dumps(document, indent=_WIDTH)  # so wide that tomli_w writes each table as [[table]]
    return _ARRAY.sub(_filled, text)


class _Writer:
    """Writes functions, and collects the constants and the time that they share."""

    def __init__(self) -> None:
        self.constants: dict[str, float] = {}
        self.time: float | None = None

    def field(self, path: str, value: object) -> object:
        """The number, text or table that stands for a field in TOML."""
        if isinstance(value, Polynomial):
            return {"polynomial": [list(row) for row in value.coefficients]}
        if not isinstance(value, Expression):
            if callable(value):
                remedy = "a Python function cannot be written to a file: take an Expression, a Polynomial or a number"
                raise InputError(path, value, remedy)
            return value
        for name, number in value.constants.items():
            if self.constants.setdefault(name, number) != number:
                remedy = f"the constant {name} is {self.constants[name]!r} elsewhere, and a file has one value for it"
                raise InputError(path, value.text, f"{remedy}: rename one of them")
        if "t" in value.names:
            if self.time not in (None, value.t):
                raise InputError(path, value.text, f"t is {plain(self.time)} elsewhere: give all expressions one time")
            self.time = value.t
        return value.text


def _filled(array: re.Match[str]) -> str:
    """An array on as few lines as possible. Rows of numbers are not broken; a text or table has a line of its own."""
    name, items = array[1], [line.strip() for line in array[2].splitlines()]
    if '"' in array[2] or "{" in array[2]:
        return "\n".join([f"{name} = [", *(f"    {item}" for item in items), "]"])
    numbers = " ".join(items).replace("[ ", "[").replace(", ]", "]").removesuffix(",")
    if len(name) + len(numbers) < _WIDTH:
        return f"{name} = [{numbers}]"
    row = r"(?=\[)" if numbers.startswith("[") else ""
    lines = re.sub(rf"(.{{1,{_WIDTH}}}|.+?)(?: {row}|$)", r"    \1\n", numbers)
    return f"{name} = [\n{lines}]"


HEADINGS: Final[dict[str, type]] = {
    "top of the file": Document,
    **{
        ", ".join(headings) + (f', law = "{kind}"' if (kind := getattr(table, "kind", "")) else ""): table
        for table, headings in schema.tables_of(Document).items()
    },
    "a field, as a polynomial": PolynomialTable,
    "a field, by values at points": PointDataTable,
}
"""Heading → class that declares the table."""


class Key(NamedTuple):
    """A key of a table: the values it takes, its default or "needed", its meaning, and an example in TOML."""

    name: str
    values: str
    default: str
    meaning: str
    example: str


def keys(table: type) -> Iterator[Key]:
    """The keys of a table, in the order of its class."""
    texts: dict[str, str] = {}
    defaults: dict[str, Any] = {}
    for kind in (*schema.inlined(table), table):
        defaults |= schema.defaults_of(kind)
        texts |= schema.described(kind)
    for name, field in file_keys(table).items():
        match = re.fullmatch(r"(.+): `\w+ = ([^`]+)`\.", texts.get(name, ""))  # no match without source code
        meaning, example = (match[1], f"{name} = {match[2]}") if match is not None else ("", "")
        value = defaults.get(name)
        shown = str(value).lower() if isinstance(value, bool) else list(value) if isinstance(value, tuple) else value
        default = "" if value in (None, "", (), {}, Units()) else str(shown)
        yield Key(name, _values(field.kind), "needed" if schema.is_needed(table, name) else default, meaning, example)


def listed(name: str = "") -> Iterator[str]:
    """Lines for a terminal: without a name all tables with their keys, else the full text of the keys with that name.

    The name is that of a table (contacts, mesh.outline), of a key (friction), or of both (contacts.friction).
    `UnknownNameError` if there is no such table or key.
    """
    keys_of_table = {heading: list(keys(table)) for heading, table in HEADINGS.items()}
    if not name:
        for heading, table_keys in keys_of_table.items():
            yield f"{heading}: {', '.join(key.name for key in table_keys)}"
        return
    matching, all_names = dict[str, list[Key]](), set[str]()
    for heading, table_keys in keys_of_table.items():
        tables = re.findall(r"\[+([\w.]+)\]", heading)
        for key in table_keys:
            names = {*tables, key.name, *(f"{table}.{key.name}" for table in tables)}
            all_names |= names
            if name in names:
                matching.setdefault(heading, []).append(key)
    if not matching:
        closest_name = closest(name, sorted(all_names))
        hint = "" if closest_name is None else f"did you mean {closest_name}? "
        raise UnknownNameError("NAME", name, f"{hint}qvi-contact keys lists all tables and keys")
    for heading, table_keys in matching.items():
        yield heading
        for key in table_keys:
            default = f"default {key.default}" if key.default not in ("", "needed") else key.default or "optional"
            yield f"  {key.name}: {key.values}; {default}"
            yield from textwrap.wrap(key.meaning, 100, initial_indent="      ", subsequent_indent="      ")
            yield f"      {key.example}"


def _values(kind: schema.Kind) -> str:
    """The values that a kind allows, in words."""
    if isinstance(kind, schema.Choice):
        return "one of " + ", ".join(map(str, kind.words)) if len(kind.words) > 1 else str(kind.words[0])
    if isinstance(kind, schema.Listed):
        return f"list of {f'{kind.most} × ' if kind.most == kind.least else ''}{_values(kind.kind)}"
    if isinstance(kind, schema.Named):
        return f"table by names, each {_values(kind.kind)}"
    return kind.values
