"""From the text of a problem file to its tables; how long and how deep it may be is found out before it is parsed.

Parsing takes memory for every entry, and for dotted keys and long numbers more than that; a short text can so ask for
gigabytes.
"""

import re
import tomllib
from typing import Any, Final

from qvi_contact.basics.schema import LARGEST, joined, quoted
from qvi_contact.errors import InputError

LONGEST: Final = 20_000_000
"""Bytes of a problem file, characters of its text."""

_MOST_SEPARATORS: Final = 400_000  # a number in a list has two: a comma and a point
_TEXT_OR_COMMENT: Final = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*+(?:"""|\Z)'  # what is not closed reaches to the end
    r"|'''(?:[^']|'(?!''))*+(?:'''|\Z)"
    r'|"(?:[^"\\\n]|\\[^\n])*+"?'
    r"|'[^'\n]*+'?"
    r"|\#[^\n]*+",
    re.DOTALL,
)
_SEPARATORS: Final = ",=.["
_DEEP_KEY: Final = re.compile(r"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){20}")  # those of the schema have three parts
_LONG_WORD: Final = re.compile(r"[\w+-]{10000}")
_SHOWN: Final = 200
_SHORTER: Final = (
    "give grid lines as { start = …, stop = …, cells = … }, triangles in a mesh file, and functions as expressions"
)


def check_length(field: str, value: str, length: int) -> None:
    """`InputError` about a file or text that is too long."""
    if length > LONGEST:
        remedy = f"has more than {LONGEST} bytes, the limit of a problem file: {_SHORTER}"
        raise InputError(field, value, remedy)


def check_size(text: str) -> None:
    """`InputError` if a text is longer, or its keys are deeper, than any problem needs."""
    check_length("TOML", text[:_SHOWN], len(text))
    bare = _TEXT_OR_COMMENT.sub(lambda found: "" if found[0].startswith("#") else "_", text)  # texts may be in keys
    if sum(bare.count(separator) for separator in _SEPARATORS) > _MOST_SEPARATORS:
        remedy = f"holds more than about {_MOST_SEPARATORS // 2} numbers, the limit of a problem file: {_SHORTER}"
        raise InputError("TOML", text[:_SHOWN], remedy)
    deep, long = _DEEP_KEY.search(bare), _LONG_WORD.search(bare)
    if deep is not None:
        raise InputError("TOML", deep[0], "this key has too many parts: write it as in the examples")
    if long is not None:
        raise InputError("TOML", long[0], "this number or key is too long: shorten it")


def tables_of(text: str) -> dict[str, Any]:
    """The tables in a TOML text.

    Raises
    ------
    InputError
        If the text is no TOML, or has values that no table wants; it is named by its path.

    """
    check_size(text)
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
    return data


def _check_scalars(value: object, path: str) -> None:
    """Refuse values that TOML knows and no table wants."""
    if isinstance(value, dict):
        for name, item in value.items():
            _check_scalars(item, joined(path, quoted(name)))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            _check_scalars(item, f"{path}[{index}]")
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:  # TOML's whole numbers have 64 bits
        raise InputError(path, f"a number of {value.bit_length()} bits", "give a whole number of at most 64 bits")
    elif isinstance(value, float) and not abs(value) <= LARGEST:
        remedy = f"give a finite number, of at most {LARGEST:g}: take other units if you need more"
        raise InputError(path, value, remedy)
    elif not isinstance(value, int | float | str):
        remedy = "give a number, a text in quotes, a list or a table; dates are not used here"
        raise InputError(path, str(value), remedy)
