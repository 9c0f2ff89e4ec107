"""Texts of rows in the Markdown of a report, where what they have in them means nothing but what it says."""

import re
from typing import Final

_SPACES: Final = re.compile("[ \t-\r\x1c-\x1f\x85\u2028\u2029]+")  # not those that keep a number and its unit together
_UNPRINTABLE: Final = re.compile("[\x00-\x08\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
_ACTIVE: Final = re.compile(
    r"[\\`*~]"  # escapes, code, emphasis, strike-through
    r"|(?<![^\W_])_|_(?![^\W_])"  # emphasis; not within words
    r"|<(?=[A-Za-z/!?])"  # tags
    r"|&(?=#?\w+;)"  # entities
    r"|\](?=[(\[:])"  # links
)


def clean(text: str) -> str:
    """The text in one line, with a replacement character for each that no file can hold or no reader can see."""
    return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", _SPACES.sub(" ", text).strip(" "))


def escaped(text: str) -> str:
    """The text for Markdown, in which nothing means anything but what it says."""
    return _ACTIVE.sub(lambda match: f"\\{match[0]}", clean(text))
