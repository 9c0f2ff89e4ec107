"""Problem files as text: from a `ContactProblem` to TOML, and all keys from the classes that declare them.

What a key means, and an example of it, says the text below its field; the page "All keys" and `qvi-contact keys` show
them.
"""

import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from qvi_contact.basics import schema
from qvi_contact.basics.schema import file_keys, write_table
from qvi_contact.basics.writing import write_text
from qvi_contact.errors import InputError
from qvi_contact.files.mesh_tables import Axis
from qvi_contact.files.problem_file import (
    TABLES,
    VERSION,
    Document,
    PointDataTable,
    PolynomialTable,
    Values,
    problem_from_toml,
)
from qvi_contact.problem.fields import BodyForces, Expression, Polynomial
from qvi_contact.problem.problem import ContactProblem
from qvi_contact.units import Units
from solvers.basics.types import load
from solvers.errors import UnknownNameError, closest, plain

_WIDTH: Final = 110  # characters in a line of numbers
_ARRAY: Final = re.compile(r"^(.+) = \[\n((?: .*\n)+)\]$", re.MULTILINE)


def save_problem(path: str | Path, problem: ContactProblem, **details: Any) -> None:
    """Write a problem file, whole or not at all; see `problem_to_toml`, whose details these are."""
    write_text(path, problem_to_toml(problem, **details))


def problem_to_toml(
    problem: ContactProblem, *, title: str = "", description: str = "", units: Units | None = None
) -> str:
    """A problem as the text of a problem file, from which `problem_from_toml` makes the same problem.

    Numbers are kept to the last digit, the mesh triangle by triangle. Conditions get ordered by kind, which has no
    meaning. Title and description say what to call it, units are labels of numbers. `InputError` if a function is one
    of Python, which a file cannot hold, or expressions disagree about constants or time.

    Of a file that was read this is `ProblemFile.problem`, the state at its first time. Its `[solve]`, `[refine]`,
    `[sweep]` and the times of its `[history]` are not written: copy them from there.
    """
    if not isinstance(problem, ContactProblem):
        raise InputError("problem", problem, "give a ContactProblem, such as the problem of a file that was read")
    for name, value in (("title", title), ("description", description)):
        if not isinstance(value, str):
            raise InputError(name, value, "give a text")
    if units is not None and not isinstance(units, Units):
        raise InputError("units", units, "give Units, or nothing")
    text = unread_toml(problem, title, description, units)
    problem_from_toml(text)  # refuses what Python takes and a file does not, such as names of several lines
    return text


def unread_toml(problem: ContactProblem, title: str = "", description: str = "", units: Units | None = None) -> str:
    """The same without the look whether a file may say all of it, which takes most of the time."""
    writer, mesh = _Writer(), problem.mesh
    document: dict[str, Any] = {"version": VERSION, "title": title, "description": description}
    if isinstance(problem.body_potential, BodyForces):
        named = problem.body_potential.parts.items()
        document["body_forces"] = {name: writer.field(f"body_forces.{name}", part) for name, part in named}
    elif problem.body_potential != 0.0:
        document["body_potential"] = writer.field("body_potential", problem.body_potential)
    if problem.temperature != 0.0:
        document["temperature"] = writer.field("temperature", problem.temperature)
    document["units"] = {} if units is None else {"length": units.length, "stress": units.stress}
    document["constants"] = writer.constants  # filled by what follows
    table: dict[str, Any] = {"vertices": mesh.vertices.tolist(), "triangles": mesh.cells.tolist()}
    table["edges"] = {name: pairs.tolist() for name, pairs in mesh.edge_sets.items()}
    table["regions"] = {name: chosen.tolist() for name, chosen in mesh.regions.items()}
    table["arcs"] = [{"bends": arc.coefficients.tolist(), "edges": arc.edges.tolist()} for arc in mesh.arcs]
    document["mesh"] = {name: value for name, value in table.items() if value}
    document["material"] = write_table("material", problem.material, writer.field)
    stated: dict[str, Sequence[object]] = {"regions": problem.regions}
    stated |= {name: [each for each in problem.conditions if isinstance(each, kind)] for name, kind in TABLES.items()}
    for name, parts in stated.items():
        document[name] = [write_table(f"{name}[{i}]", part, writer.field) for i, part in enumerate(parts)]
    if writer.time is not None:
        document["history"] = {"times": [writer.time]}
    document = {name: value for name, value in document.items() if value not in ({}, [], "")}
    wide = load("tomli_w").dumps(document, indent=_WIDTH)  # too wide for one line: a [[table]] for each table
    return _ARRAY.sub(_filled, wide)


class _Writer:
    """Writes functions, and collects what they have in common."""

    def __init__(self) -> None:
        self.constants: dict[str, float] = {}
        self.time: float | None = None

    def field(self, path: str, value: object) -> object:
        """A number, text or table for a field."""
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
    """An array on as few lines as its numbers, or whole rows of them, fill; texts and tables have their own lines."""
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
"""Heading → class that states the table."""

_WORDS: Final[tuple[tuple[type[schema.Kind], str], ...]] = (
    (schema.Varying, "number, expression or polynomial"),
    (schema.Scalar, "number or expression"),
    (schema.Number, "number"),
    (schema.Whole, "whole number"),
    (schema.Truth, "true or false"),
    (schema.Text, "text"),
    (schema.Tables, "tables"),
    (schema.Tagged, "table with a law"),
    (schema.Table, "table"),
    (Axis, "list of numbers, piece or list of pieces"),
    (Values, "list of numbers, or range"),
)


class Key(NamedTuple):
    """A key: what values it takes, by default or "needed", what it means, and an example in TOML."""

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
    for name, own in file_keys(table).items():
        found = re.fullmatch(r"(.+): `\w+ = ([^`]+)`\.", texts.get(name, ""))  # without docstrings there is nothing
        meaning, example = (found[1], f"{name} = {found[2]}") if found is not None else ("", "")
        value = defaults.get(name)
        shown = str(value).lower() if isinstance(value, bool) else list(value) if isinstance(value, tuple) else value
        default = "" if value in (None, "", (), {}, Units()) else str(shown)
        yield Key(name, _values(own.kind), "needed" if schema.is_needed(table, name) else default, meaning, example)


def listed(name: str = "") -> Iterator[str]:
    """Lines for a terminal: the keys of the tables, or of keys of that name, with all there is to say.

    A name is that of a table, as contacts or mesh.outline, of a key, or of both, as contacts.friction.
    `UnknownNameError` if there is no such table or key.
    """
    found = {heading: list(keys(table)) for heading, table in HEADINGS.items()}
    if not name:
        for heading, own in found.items():
            yield f"{heading}: {', '.join(key.name for key in own)}"
        return
    chosen, known = dict[str, list[Key]](), set[str]()
    for heading, own in found.items():
        tables = re.findall(r"\[+([\w.]+)\]", heading)
        for key in own:
            names = {*tables, key.name, *(f"{table}.{key.name}" for table in tables)}
            known |= names
            if name in names:
                chosen.setdefault(heading, []).append(key)
    if not chosen:
        near = closest(name, sorted(known))
        meant = "" if near is None else f"did you mean {near}? "
        raise UnknownNameError("NAME", name, f"{meant}qvi-contact keys lists all tables and keys")
    for heading, own in chosen.items():
        yield heading
        for key in own:
            default = f"default {key.default}" if key.default not in ("", "needed") else key.default or "optional"
            yield f"  {key.name}: {key.values}; {default}"
            yield from textwrap.wrap(key.meaning, 100, initial_indent="      ", subsequent_indent="      ")
            yield f"      {key.example}"


def _values(kind: schema.Kind) -> str:
    """The values of a kind in words."""
    if isinstance(kind, schema.Choice):
        return "one of " + ", ".join(map(str, kind.words)) if len(kind.words) > 1 else str(kind.words[0])
    if isinstance(kind, schema.Listed):
        return f"list of {f'{kind.most} × ' if kind.most == kind.least else ''}{_values(kind.kind)}"
    if isinstance(kind, schema.Named):
        return f"table by names, each {_values(kind.kind)}"
    return next(word for of, word in _WORDS if isinstance(kind, of))
