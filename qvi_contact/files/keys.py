"""All keys of problem files, from the classes that declare them: for the page "All keys" and for `qvi-contact keys`.

What a key means, and an example of it, say the docstring of its class or the text below the field.
"""

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from textwrap import dedent
from typing import Any, Final, NamedTuple

from qvi_contact.basics.schema import (
    Choice,
    Kind,
    Listed,
    Named,
    Number,
    Scalar,
    Table,
    Tables,
    Tagged,
    Text,
    Truth,
    Varying,
    Whole,
    defaults_of,
    described,
    file_keys,
    inlined,
    is_needed,
)
from qvi_contact.basics.units import Units
from qvi_contact.files import mesh_tables, options, problem_file
from qvi_contact.mesh.outline import Corner
from qvi_contact.problem import conditions, material
from solvers.basics.names import closest
from solvers.errors import UnknownNameError

TABLES: Final[dict[str, type]] = {
    "top of the file": problem_file.Document,
    "[units]": Units,
    "[mesh]": mesh_tables.MeshTable,
    "x, y of [mesh], as a piece or a list of pieces": mesh_tables.Segment,
    "remove of [mesh], box of [[edges]]": mesh_tables.Rectangle,
    "[mesh.refine]": mesh_tables.RefineTable,
    "[[mesh.arcs]]": mesh_tables.ArcTable,
    "[mesh.outline]": mesh_tables.OutlineTable,
    "[[mesh.outline.corners]], and corners of holes, joints and regions": Corner,
    "[[mesh.outline.holes]], [[mesh.outline.joints]], [[mesh.outline.regions]]": mesh_tables.LineTable,
    "[[mesh.outline.sizes]]": mesh_tables.SizeTable,
    "[[edges]]": mesh_tables.EdgesTable,
    "[[joints]]": mesh_tables.JointTable,
    "[material]": material.Material,
    "[[regions]]": mesh_tables.RegionTable,
    **{
        f'strength of [material] and [[regions]], law = "{getattr(each, "kind", "")}"': each
        for each in material.STRENGTHS
    },
    "[[symmetry]]": conditions.Symmetry,
    "[[displacements]]": conditions.Displacement,
    "[[tractions]]": conditions.Traction,
    "[[contacts]]": conditions.Contact,
    "plate of [[contacts]]": conditions.RigidPlate,
    "pin of [[contacts]]": conditions.Pin,
    "[solve]": options.SolveOptions,
    "[refine]": options.RefineOptions,
    "[history]": problem_file.HistoryTable,
    "[sweep]": problem_file.SweepPlan,
    "times of [history], values of [sweep], as a range": problem_file.TimeRange,
    "a field, as a polynomial": problem_file.PolynomialTable,
    "a field, by values at points": problem_file.PointDataTable,
}
"""Heading → class that states the table."""

_WORDS: Final[tuple[tuple[type[Kind], str], ...]] = (
    (Varying, "number, expression or polynomial"),
    (Scalar, "number or expression"),
    (Number, "number"),
    (Whole, "whole number"),
    (Truth, "true or false"),
    (Text, "text"),
    (Tables, "tables"),
    (Tagged, "table with a law"),
    (Table, "table"),
    (mesh_tables.Axis, "list of numbers, piece or list of pieces"),
    (problem_file.Values, "list of numbers, or range"),
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
    for kind in (*inlined(table), table):
        defaults |= defaults_of(kind)
        texts |= described(kind)
        for each in reversed(kind.__mro__[:-1]):
            texts |= _below(each)
    for name, own in file_keys(table).items():
        found = re.fullmatch(r"(.+): `\w+ = ([^`]+)`\.", texts.get(name, ""))  # without docstrings there is nothing
        meaning, example = (found[1], f"{name} = {found[2]}") if found is not None else ("", "")
        default = "needed" if is_needed(table, name) else _default(defaults.get(name))
        yield Key(name, _values(own.kind), default, meaning, example)


def listed(name: str = "") -> Iterator[str]:
    """Lines for a terminal: the keys of the tables, or of keys of that name, with all there is to say.

    A name is that of a table, as contacts or mesh.outline, of a key, or of both, as contacts.friction.

    Raises
    ------
    UnknownNameError
        If there is no such table or key.

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


def _values(kind: Kind) -> str:
    """The values of a kind in words."""
    if isinstance(kind, Choice):
        return "one of " + ", ".join(map(str, kind.words)) if len(kind.words) > 1 else str(kind.words[0])
    if isinstance(kind, Listed):
        return (
            f"list of {kind.most} × {_values(kind.kind)}"
            if kind.most == kind.least
            else f"list of {_values(kind.kind)}"
        )
    if isinstance(kind, Named):
        return f"table by names, each {_values(kind.kind)}"
    return next(word for of, word in _WORDS if isinstance(kind, of))


@cache
def _below(kind: type) -> dict[str, str]:
    """The texts below the fields of a class, and below `in_files` that of the key it names."""
    (found,) = ast.parse(dedent(inspect.getsource(kind))).body
    assert isinstance(found, ast.ClassDef)
    texts = {}
    for line, below in pairwise(found.body):
        if isinstance(line, ast.AnnAssign) and isinstance(below, ast.Expr):
            text = " ".join(ast.literal_eval(below.value).split())
            name = ast.unparse(line.target)
            texts[text.rpartition(": `")[2].partition(" ")[0] if name == "in_files" else name] = text
    return texts


def _default(value: Any) -> str:
    if value in (None, "", (), {}, Units()):
        return ""
    return str(value).lower() if isinstance(value, bool) else str(list(value) if isinstance(value, tuple) else value)
