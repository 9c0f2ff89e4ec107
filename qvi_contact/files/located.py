"""Errors that name the place in a problem file."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from qvi_contact.errors import InputError
from qvi_contact.files.problem_document import Missing, Table

_IN_TOML: Final = (
    ("with_edges() or with_joint()", "[[edges]] or [[joints]]"),
    ("with_edges()", "[[edges]]"),
    ("with_joint()", "[[joints]]"),
    ("with_region()", "[[regions]]"),
    (
        "add a Traction (0 if it is free), Displacement, Symmetry or Contact",
        "add [[tractions]] (0 if it is free), [[displacements]], [[symmetry]] or [[contacts]]",
    ),
    ("is not a Traction;", "is not one of [[tractions]];"),
    ("by a Displacement or Contact", "by [[displacements]] or [[contacts]]"),
)  # remedies written for Python


def in_toml(remedy: str) -> str:
    """The remedy in words of a problem file."""
    for python, toml in _IN_TOML:
        remedy = remedy.replace(python, toml)
    return remedy


@contextmanager
def located(path: str, table: Table | None = None) -> Iterator[None]:
    """Errors raised in the block get their path in the file: that of the table, and the key if it is one of its own."""
    try:
        yield
    except InputError as error:
        key = error.field.split(".")[-1]
        known = table is not None and key in type(table).model_fields
        value = Missing() if error.value is None else error.value
        raise type(error)(f"{path}.{key}" if known else path, value, in_toml(error.remedy)) from error
