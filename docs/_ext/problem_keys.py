"""The tables of keys of a problem file, made from the schema: ``python docs/_ext/problem_keys.py`` writes the page.

What a key means, and an example of it, stand below it in `qvi_contact.files.problem_document`; what it is by default
says the schema itself.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

from made import DOCS, make
from pydantic_core import PydanticUndefined

from qvi_contact.files import problem_document as schema

PAGE = DOCS / "problem_files.md"

TABLES: dict[str, type[schema.Table]] = {
    "top of the file": schema.Document,
    "[units]": schema.UnitsTable,
    "[mesh]": schema.MeshTable,
    "x, y of [mesh], as a piece or a list of pieces": schema.Segment,
    "remove of [mesh], box of [[edges]]": schema.Rectangle,
    "[mesh.refine]": schema.RefineTable,
    "[[mesh.arcs]]": schema.ArcTable,
    "[mesh.outline]": schema.OutlineTable,
    "[[mesh.outline.corners]], and corners of holes, joints and regions": schema.CornerTable,
    "[[mesh.outline.holes]]": schema.HoleTable,
    "[[mesh.outline.joints]]": schema.InnerLineTable,
    "[[mesh.outline.regions]]": schema.InnerRegionTable,
    "[[mesh.outline.sizes]]": schema.SizeTable,
    "[[edges]]": schema.EdgesTable,
    "[[joints]]": schema.JointTable,
    "[material]": schema.MaterialTable,
    "[[regions]]": schema.RegionTable,
    "strength of [material] and [[regions]]": schema.StrengthTable,
    "[[symmetry]]": schema.SymmetryTable,
    "[[displacements]]": schema.DisplacementTable,
    "[[tractions]]": schema.TractionTable,
    "[[contacts]]": schema.ContactTable,
    "plate of [[contacts]]": schema.PlateTable,
    "pin of [[contacts]]": schema.PinTable,
    "[solve]": schema.SolveTable,
    "[refine]": schema.RefinementTable,
    "[history]": schema.HistoryTable,
    "[sweep]": schema.SweepTable,
    "times of [history], values of [sweep], as a range": schema.TimeRange,
    "a field, as a polynomial": schema.PolynomialTable,
}
"""Heading → table of the schema."""


class Key(NamedTuple):
    """A key: whether it is needed, or what it is by default, what it means, and an example of it in TOML."""

    name: str
    default: str
    meaning: str
    example: str


def keys(table: type[schema.Table]) -> Iterator[Key]:
    """The keys of a table, in the order of the schema."""
    for name, field in table.model_fields.items():
        meaning, example = _described(next(text for text in _texts(table, name)))
        yield Key(name, _default(field.default), meaning, example)


def section(heading: str, table: type[schema.Table]) -> str:
    """The Markdown of one table."""
    rows = [f"| `{key.name}` | {key.default} | {key.meaning} | `{key.example}` |" for key in keys(table)]
    return "\n".join([f"### {heading}", "", "| key | default | meaning | example |", "|---|---|---|---|", *rows])


def _texts(table: type[schema.Table], name: str) -> Iterator[str]:
    """What stands below a key, in the table or in the one it is made from."""
    for kind in table.__mro__:
        text = _docstrings().get((kind.__name__, name))
        if text is not None:
            yield text


@cache
def _docstrings() -> dict[tuple[str, str], str]:
    """Class and key → the text below the key."""
    found = {}
    for kind in ast.parse(inspect.getsource(schema)).body:
        body = kind.body if isinstance(kind, ast.ClassDef) else []
        for line, below in pairwise(body):
            if isinstance(line, ast.AnnAssign) and isinstance(below, ast.Expr):
                found[kind.name, line.target.id] = " ".join(ast.literal_eval(below.value).split())
    return found


def _described(text: str) -> tuple[str, str]:
    """Meaning and example of a text "meaning: `key = value`."."""
    found = re.fullmatch(r"(.+): `([^`]+)`\.", text)
    if found is None:
        raise ValueError(f"no example: {text}")
    return found[1], found[2]


def _default(value: Any) -> str:
    if value is PydanticUndefined:
        return "needed"
    if value is None or isinstance(value, schema.Table) or value in ("", [], {}):
        return ""
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def tables() -> str:
    """The Markdown of all tables."""
    return "\n\n".join(section(heading, table) for heading, table in TABLES.items())


if __name__ == "__main__":
    make(PAGE, "problem_keys", tables())
