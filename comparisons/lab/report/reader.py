"""The Markdown of a report as its readers take it: tokens of markdown-it, and the plain words in them."""

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise, takewhile
from typing import TYPE_CHECKING, Final

from comparisons.lab.tables import Grid

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

FINDINGS: Final = "Findings"
"""Heading of the numbered sentences."""

_SEE: Final = re.compile(r"\s*\(\[[^\]]*\]\(#[^)]*\)\)")


def reader() -> "MarkdownIt":
    """CommonMark and tables."""
    from markdown_it import MarkdownIt

    return MarkdownIt("commonmark").enable("table")


def words(token: "Token") -> str:
    """The text of an inline token without marks."""
    return "".join(
        " " if child.type in ("softbreak", "hardbreak") else child.content
        for child in token.children or ()
        if child.type in ("text", "code_inline", "softbreak", "hardbreak")
    )


def title_of(text: str) -> str:
    """The first heading."""
    return next((heading for _, heading in headings(reader().parse(text))), "")


def findings_of(text: str) -> list[str]:
    """The numbered sentences below the heading `FINDINGS`, without marks and links within the report."""
    return [sentence for part in parts_of(text) if isinstance(part, list) for sentence in part]


def parts_of(text: str) -> Iterator[list[str] | Grid]:
    """What a terminal shows: the findings, and the tables that are not folded, named by the heading above them."""
    tokens = reader().parse(_SEE.sub("", text))
    heading, folded = "", 0
    for place, token in enumerate(tokens):
        if token.type == "heading_open":
            heading = words(tokens[place + 1])
        elif token.type == "html_block":
            folded += token.content.count("<details") - token.content.count("</details")
        elif token.type == "ordered_list_open" and heading == FINDINGS:
            yield _items(tokens[place:])
        elif token.type == "table_open" and not folded:
            yield _grid(heading, tokens[place:])


def headings(tokens: Sequence["Token"]) -> Iterator[tuple[int, str]]:
    """Level and text."""
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            yield int(opening.tag[1:]), words(inline)


def _items(tokens: Sequence["Token"]) -> list[str]:
    """Texts of the list that begins here."""
    inside = takewhile(lambda token: token.type != "ordered_list_close", tokens)
    return [words(token) for token in inside if token.type == "inline"]


def _grid(title: str, tokens: Sequence["Token"]) -> Grid:
    """The table that begins here."""
    rows: list[list[str]] = []
    for token in takewhile(lambda token: token.type != "table_close", tokens):
        if token.type == "tr_open":
            rows.append([])
        elif token.type == "inline":
            rows[-1].append(words(token))
    return Grid(title, tuple(rows[0]), [tuple(row) for row in rows[1:]])
