"""All keys of problem files, from the classes that declare them: for the page "All keys" and for `qvi-contact keys`.

What a key means, and an example of it, say the docstring of its class or the text below the field.
"""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from textwrap import dedent
from typing import Any, Final, NamedTuple

from qvi_contact.basics import schema
from qvi_contact.basics.schema import file_keys
from qvi_contact.basics.units import Units
from qvi_contact.files.mesh_tables import Axis
from qvi_contact.files.problem_file import Document, PointDataTable, PolynomialTable, Values
from solvers.errors import UnknownNameError, closest

TABLES: Final[dict[str, type]] = {
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
        for each in reversed(kind.__mro__[:-1]):
            texts |= _below(each)
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
    found = {heading: list(keys(table)) for heading, table in TABLES.items()}
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


@cache
def _below(kind: type) -> dict[str, str]:
    """The texts below fields of a class, each of those right above it; below `in_files` that of the key it names."""
    (found,) = ast.parse(dedent(inspect.getsource(kind))).body
    assert isinstance(found, ast.ClassDef)
    texts, above = dict[str, str](), list[str]()
    for line in found.body:
        if isinstance(line, ast.AnnAssign):
            above.append(ast.unparse(line.target))
        elif isinstance(line, ast.Expr) and above:
            text = " ".join(ast.literal_eval(line.value).split())
            names = [text.rpartition(": `")[2].partition(" ")[0]] if above[-1] == "in_files" else above
            texts, above = texts | dict.fromkeys(names, text), []
    return texts
