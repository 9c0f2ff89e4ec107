"""What a report consists of, before it is HTML or Markdown.

Texts are plain, with two marks of Markdown: `code` and *emphasis*. Numbers are text already: whoever makes a table
decides how many digits are worth printing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from comparisons.lab.tables import Grid

NO_FAILURE: Final = "nothing here can fail"


@dataclass(frozen=True)
class Table:
    """A table that can be sorted by its columns.

    Attributes
    ----------
    name : str
        Lower-case word for links, different from all others of the report.
    grid : Grid
        Title, headings with units, rows; its note is not used.
    reading : str
        How to read it.
    failure : str
        What counts as failure in it.

    """

    name: str
    grid: Grid
    reading: str
    failure: str = NO_FAILURE


@dataclass(frozen=True)
class Figure:
    """A picture.

    Attributes
    ----------
    name : str
        Lower-case word for links and files, different from all others of the report.
    title : str
        Title.
    svg : str
        The picture, see `qvi_contact.plots.inline.svg_text`; empty where matplotlib is not installed.
    reading : str
        How to read it: what the axes, curves and marks are.
    failure : str
        What counts as failure in it, and how it is drawn.

    """

    name: str
    title: str
    svg: str
    reading: str
    failure: str = NO_FAILURE


Exhibit = Table | Figure


@dataclass(frozen=True)
class Finding:
    """A sentence computed from the data, and the name of the table or figure it can be seen in."""

    text: str
    see: str = ""


@dataclass(frozen=True)
class Section:
    """Part of a report: title, paragraphs, tables and figures."""

    title: str
    paragraphs: Sequence[str]
    exhibits: Sequence[Exhibit] = ()


@dataclass(frozen=True)
class Report:
    """A report in the order in which it is read.

    Attributes
    ----------
    name : str
        Stem of its files.
    title : str
        Title.
    introduction : str
        What was compared, on what, by which command: a paragraph.
    findings : sequence of Finding
        What was found, the most important first.
    sections : sequence of Section
        What the findings rest on.
    settings : sequence of Grid
        All settings, versions, machine, threads, seeds: whatever is needed to do it again.
    limitations : sequence of str
        What the numbers do not say.

    """

    name: str
    title: str
    introduction: str
    findings: Sequence[Finding]
    sections: Sequence[Section]
    settings: Sequence[Grid]
    limitations: Sequence[str]
