"""The two marks of the texts of a report, `code` and *emphasis*, as HTML, Markdown and plain text.

Whatever else a text has in it means nothing and comes out as it stands.
"""

import html
import re
from collections.abc import Callable, Iterator
from enum import Enum
from typing import Final


class Mark(Enum):
    """What a piece of a text is."""

    PLAIN = "plain"
    CODE = "code"
    EMPHASIS = "em"


_MARKED: Final = re.compile(
    r"`(?P<code>[^\s`](?:[^`]*[^\s`])?)`"
    r"|(?<![\w*])\*(?P<em>[^\s*`](?:[^*`]*[^\s*`])?)\*(?![\w*])"
)
_SPACES: Final = re.compile("[ \t-\r\x1c-\x1f\x85\u2028\u2029]+")  # not those that keep a number and its unit together
_UNPRINTABLE: Final = re.compile("[\x00-\x08\x0e-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff]")
_ACTIVE: Final = re.compile(
    r"[\\`*~]"  # escapes, code, emphasis, strike-through
    r"|(?<![^\W_])_|_(?![^\W_])"  # emphasis; not within words
    r"|<(?=[A-Za-z/!?])"  # tags
    r"|&(?=#?\w+;)"  # entities
    r"|\](?=[(\[:])"  # links
)
_BEGINNING: Final = re.compile(r"^(?:>|(?:[#+=-]+|\d{1,9}[.)])(?=\s|$))")
"""What would make a heading, quotation or list of a paragraph."""


def clean(text: str) -> str:
    """The text in one line, with a replacement character for each that no file can hold or no reader can see."""
    return _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", _SPACES.sub(" ", text).strip(" "))


def escaped(text: str) -> str:
    """The text for Markdown, in which nothing means anything but what it says."""
    return _escape_markdown(clean(text))


def plain(text: str) -> str:
    """The text without its marks."""
    return "".join(words for _, words in _pieces(text))


def as_html(text: str) -> str:
    """The text for the inside of an element, not for an attribute."""
    return "".join(_HTML[mark](words) for mark, words in _pieces(text))


def as_markdown(text: str) -> str:
    """The text for the inside of a line; in a table "|" is still to be escaped."""
    return "".join(_MARKDOWN[mark](words) for mark, words in _pieces(text))


def as_paragraph(text: str) -> str:
    """The text for a paragraph of Markdown or an item of a list: its beginning means nothing either."""
    return _BEGINNING.sub(lambda match: f"{match[0][:-1]}\\{match[0][-1]}", as_markdown(text))


def _pieces(text: str) -> Iterator[tuple[Mark, str]]:
    """The text cut at its marks."""
    line, end = clean(text), 0
    for match in _MARKED.finditer(line):
        yield Mark.PLAIN, line[end : match.start()]
        yield (Mark.CODE, match["code"]) if match["code"] is not None else (Mark.EMPHASIS, match["em"])
        end = match.end()
    yield Mark.PLAIN, line[end:]


def _element(name: str) -> Callable[[str], str]:
    return lambda words: f"<{name}>{_escape_html(words)}</{name}>"


def _escape_html(words: str) -> str:
    return html.escape(words, quote=False)


def _escape_markdown(words: str) -> str:
    return _ACTIVE.sub(lambda match: f"\\{match[0]}", words)


_HTML: Final[dict[Mark, Callable[[str], str]]] = {
    Mark.PLAIN: _escape_html,
    Mark.CODE: _element("code"),
    Mark.EMPHASIS: _element("em"),
}
_MARKDOWN: Final[dict[Mark, Callable[[str], str]]] = {
    Mark.PLAIN: _escape_markdown,
    Mark.CODE: lambda words: f"`{words}`",
    Mark.EMPHASIS: lambda words: f"*{_escape_markdown(words)}*",
}
