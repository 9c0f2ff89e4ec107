"""The files of a report, and its HTML page, which loads nothing: made from its Markdown, all else inside."""

import html
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from comparisons.lab.cells import sort_key
from comparisons.lab.report.document import Document
from comparisons.lab.report.reader import headings, reader, title_of, words
from comparisons.lab.study import FAILURES
from qvi_contact.basics.writing import page_template
from qvi_contact.basics.writing import writable_folder, write_text
from qvi_contact.plots.inline import inline_svg

if TYPE_CHECKING:
    from markdown_it.token import Token

_FAILED: Final = frozenset({"failed", "fails", "lies", *FAILURES})
"""Cells that say so in words are also drawn so."""

_WORDS: Final = 40  # letters of a cell that is a sentence
_CONTENTS: Final = 3  # headings from which on a page has contents


def as_page(document: Document) -> str:
    """The report as HTML."""
    markdown = reader()
    tokens = list(_adapted(markdown.parse(document.text), document))
    body = markdown.renderer.render(tokens, markdown.options, {})
    return page_template("comparisons.lab.report").render(title=title_of(document.text), body=body)


def _adapted(tokens: Sequence["Token"], document: Document) -> Iterator["Token"]:
    """The tokens with ids for headings, boxes around tables, pictures inside, and contents behind the first section."""
    ids, sections, heading = Counter[str](), 0, ""
    for place, token in enumerate(tokens):
        if token.type == "heading_open":
            heading = words(tokens[place + 1])
            token.attrSet("id", _identifier(heading, ids))
            sections += token.tag == "h2"
            if (token.tag, sections) == ("h2", 2):
                yield _raw(_contents(tokens))
        elif token.type == "table_open":
            token.attrSet("class", "sortable")
            yield _raw(f'<div class="box" role="region" tabindex="0" aria-label="{html.escape(heading)}">\n')
        elif token.type in ("th_open", "td_open"):
            _dress(token, words(tokens[place + 1]))
        if _is_picture(token):
            yield _raw(_picture(token, document))
        elif not any(_is_picture(other) for other in tokens[max(0, place - 1) : place + 2]):
            yield token  # and not the paragraph around a picture
        if token.type == "table_close":
            yield _raw("</div>\n")


def _raw(text: str) -> "Token":
    from markdown_it.token import Token

    return Token("html_block", "", 0, content=text)


def _identifier(heading: str, ids: Counter[str]) -> str:
    """An id of this heading that no other has; of capital letters, as names of tables and figures have none."""
    name = re.sub(r"\W+", "-", heading).strip("-").capitalize() or "Section"
    ids[name] += 1
    return name if ids[name] == 1 else f"{name}-{ids[name]}"


def _contents(tokens: Sequence["Token"]) -> str:
    """Links to the sections behind the first."""
    ids = Counter[str]()
    links = [(level, _identifier(heading, ids), heading) for level, heading in headings(tokens)]
    items = [f'<li><a href="#{name}">{html.escape(text)}</a></li>' for level, name, text in links if level == 2][1:]
    if len(items) < _CONTENTS:
        return ""
    return "\n".join(['<nav aria-label="Contents">', "<ul>", *items, "</ul>", "</nav>\n"])


def _dress(token: "Token", text: str) -> None:
    """Class and key of a cell: numbers stand on the right, sentences get room, failures are drawn as such."""
    look = ["number"] if "right" in str(token.attrs.pop("style", "")) else []
    if token.type == "td_open":
        look += ["words"] if not look and len(text) > _WORDS else []
        look += ["failed"] if text.lower() in _FAILED else []
        key = sort_key(text)
        if key is not None:
            token.attrSet("data-key", key)
    if look:
        token.attrSet("class", " ".join(look))


def _is_picture(token: "Token") -> bool:
    """Whether this is the inside of a paragraph that is one picture and nothing else."""
    return token.type == "inline" and [child.type for child in token.children or ()] == ["image"]


def _picture(token: "Token", document: Document) -> str:
    """The figure in the place of its file's name."""
    image = (token.children or [])[0]
    file, label = str(image.attrs["src"]), image.content
    name = file.removeprefix(f"{document.name}-").removesuffix(".svg")
    box = f'<div class="box picture" role="region" tabindex="0" aria-label="{html.escape(label)}">'
    svg = inline_svg(document.pictures[file], name, label)
    return f'<figure aria-label="{html.escape(name)}">\n{box}\n{svg}</div>\n</figure>\n'


def write_report(report: Document, folder: str | Path) -> list[Path]:
    """Write a report's Markdown, its pictures, and the page made of both; each whole or not at all.

    The same report gives the same bytes. A picture of an earlier report that this one has not is left where it is.

    Parameters
    ----------
    report : Document
        What to write.
    folder : str or Path
        Where to; made if it is missing.

    Returns
    -------
    list of Path
        ``<name>.html``, ``<name>.md``, then ``<name>-<figure>.svg`` for each figure that could be drawn.

    Raises
    ------
    InputError
        If the folder or a file cannot be written.

    """
    texts = {f"{report.name}.html": as_page(report), f"{report.name}.md": report.text, **report.pictures}
    place = writable_folder(folder)
    for name, text in reversed(texts.items()):  # pictures first: no text shows one that is not there
        write_text(place / name, text)
    return [place / name for name in texts]
