"""The tables of keys of a problem file, made from the schema: ``python docs/_ext/problem_keys.py`` writes the page.

What a key means, and an example of it, say the docstring of its class or the text below the field.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from itertools import pairwise
from textwrap import dedent
from typing import Any, NamedTuple

from made import DOCS, make

from qvi_contact.basics.schema import defaults_of, described, file_keys, is_needed
from qvi_contact.basics.units import Units
from qvi_contact.files import mesh_tables, options, problem_file
from qvi_contact.mesh.outline import Corner
from qvi_contact.problem import conditions, material

PAGE = DOCS / "problem_files.md"

TABLES: dict[str, type] = {
    "top of the file": problem_file.Document,
    "[units]": Units,
    "[mesh]": mesh_tables.MeshTable,
    "x, y of [mesh], as a piece or a list of pieces": mesh_tables.Segment,
    "remove of [mesh], box of [[edges]]": mesh_tables.Rectangle,
    "[mesh.refine]": mesh_tables.RefineTable,
    "[[mesh.arcs]]": mesh_tables.ArcTable,
    "[mesh.outline]": mesh_tables.OutlineTable,
    "[[mesh.outline.corners]], and corners of holes, joints and regions": Corner,
    "[[mesh.outline.holes]]": mesh_tables.HoleTable,
    "[[mesh.outline.joints]]": mesh_tables.InnerLineTable,
    "[[mesh.outline.regions]]": mesh_tables.InnerRegionTable,
    "[[mesh.outline.sizes]]": mesh_tables.SizeTable,
    "[[edges]]": mesh_tables.EdgesTable,
    "[[joints]]": mesh_tables.JointTable,
    "[material]": material.Material,
    "[[regions]]": mesh_tables.RegionTable,
    **{f'strength of [material] and [[regions]], law = "{each.kind}"': each for each in material.STRENGTHS},
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
}
"""Heading → class that states the table."""


class Key(NamedTuple):
    """A key: whether it is needed, or what it is by default, what it means, and an example of it in TOML."""

    name: str
    default: str
    meaning: str
    example: str


def keys(table: type) -> Iterator[Key]:
    """The keys of a table, in the order of its class."""
    texts: dict[str, str] = {}
    for kind in (*reversed(table.__mro__[:-1]), material.Material):
        texts = {**texts, **described(kind), **_below(kind)} if kind in table.__mro__ else described(kind) | texts
    for name in file_keys(table):
        found = re.fullmatch(r"(.+): `\w+ = ([^`]+)`\.", texts[name])
        if found is None:
            raise ValueError(f"no example of {name}: {texts[name]}")
        default = "needed" if is_needed(table, name) else _default(defaults_of(table).get(name))
        yield Key(name, default, found[1], f"{name} = {found[2]}")


def section(heading: str, table: type) -> str:
    """The Markdown of one table."""
    rows = [f"| `{key.name}` | {key.default} | {key.meaning} | `{key.example}` |" for key in keys(table)]
    return "\n".join([f"### {heading}", "", "| key | default | meaning | example |", "|---|---|---|---|", *rows])


def _below(kind: type) -> dict[str, str]:
    """The texts below the fields of a class, and below `in_files` that of the key it names."""
    (found,) = ast.parse(dedent(inspect.getsource(kind))).body
    texts = {}
    for line, below in pairwise(found.body):
        if isinstance(line, ast.AnnAssign) and isinstance(below, ast.Expr):
            text = " ".join(ast.literal_eval(below.value).split())
            name = line.target.id
            texts[text.rpartition(": `")[2].partition(" ")[0] if name == "in_files" else name] = text
    return texts


def _default(value: Any) -> str:
    if value in (None, "", (), {}, Units()):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else list(value) if isinstance(value, tuple) else value}`"


def tables() -> str:
    """The Markdown of all tables."""
    return "\n\n".join(section(heading, table) for heading, table in TABLES.items())


if __name__ == "__main__":
    make(PAGE, "problem_keys", tables())
