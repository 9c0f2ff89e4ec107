"""How long and how deep a problem file may be, found out before it is parsed.

Parsing takes memory for every entry, and for dotted keys and long numbers more than that; a short text can so ask for
gigabytes.
"""

import re
from typing import Final

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
    bare = _TEXT_OR_COMMENT.sub(_placeholder, text)
    if sum(bare.count(separator) for separator in _SEPARATORS) > _MOST_SEPARATORS:
        remedy = f"holds more than about {_MOST_SEPARATORS // 2} numbers, the limit of a problem file: {_SHORTER}"
        raise InputError("TOML", text[:_SHOWN], remedy)
    deep, long = _DEEP_KEY.search(bare), _LONG_WORD.search(bare)
    if deep is not None:
        raise InputError("TOML", deep[0], "this key has too many parts: write it as in the examples")
    if long is not None:
        raise InputError("TOML", long[0], "this number or key is too long: shorten it")


def _placeholder(found: re.Match[str]) -> str:
    """What stands for a text, which may be a part of a key, or a comment."""
    return "" if found[0].startswith("#") else "_"
