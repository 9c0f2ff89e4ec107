"""A report: Markdown with pictures beside it, from a template that a person writes.

The template of an experiment is `report.md` in its folder, Markdown with numbers, tables and pictures to be filled in:

    1. The condensed method takes {{ fastest | seconds }} ([table](#times)).

    {{ figure("errors", "Error against time") }}

    {{ table("times", {"solver": "solver", "time": "median time"}) }}

A table is made by the program, or it is a frame, of which the template names the columns and their headings.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from comparisons.lab.report import numbers
from comparisons.lab.tables import Form, Grid, grid_of, markdown_table
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from pandas import DataFrame

NO_PICTURES: Final = "Not drawn: pictures need matplotlib, `python -m pip install matplotlib`."

_FILTERS: Final = ("listing", "memory", "percent", "scientific", "seconds", "significant")
_NAME: Final = re.compile(r"[a-z0-9]+(?:[-_][a-z0-9]+)*")
_LINK: Final = re.compile(r"\]\(#([^)]*)\)")
_PICTURE: Final = re.compile(r"!\[[^\]]*\]\(([^)]*)\)")


@dataclass(frozen=True)
class Document:
    """A report as it is written.

    Attributes
    ----------
    name : str
        Stem of its files.
    text : str
        Markdown.
    pictures : Mapping
        Name of a file → the picture in it, SVG.
    tables : Mapping
        Name → table, in the order in which they are shown; none of a report that was read.

    """

    name: str
    text: str
    pictures: Mapping[str, str]
    tables: Mapping[str, Grid] = field(default_factory=dict)

    @classmethod
    def read(cls, path: str | Path) -> "Document":
        """The report in a file of Markdown, with the pictures beside it; `InputError` if one cannot be read."""
        file = Path(path)
        try:
            text = file.read_text(encoding="utf-8")
            pictures = {name: (file.parent / name).read_text(encoding="utf-8") for name in _PICTURE.findall(text)}
        except (OSError, UnicodeDecodeError) as error:
            raise InputError("report", str(path), f"cannot be read: {error}") from error
        return cls(file.stem, text, pictures)


def render(
    package: str,
    name: str,
    values: Mapping[str, Any],
    tables: "Mapping[str, Grid | DataFrame]",
    figures: Mapping[str, str],
    settings: Sequence[Grid] = (),
    *,
    forms: Mapping[str, Form] | None = None,
    template: str = "report.md",
) -> Document:
    """The report of an experiment, by a template in its folder; see `fill`."""
    text = files(package).joinpath(template).read_text(encoding="utf-8")
    return fill(text, name, values, tables, figures, settings, forms)


def fill(
    template: str,
    name: str,
    values: Mapping[str, Any],
    tables: "Mapping[str, Grid | DataFrame]",
    figures: Mapping[str, str],
    settings: Sequence[Grid] = (),
    forms: Mapping[str, Form] | None = None,
) -> Document:
    """The report by this template.

    Parameters
    ----------
    template : str
        Markdown in which Jinja finds `values` by their names, ``table(name)``, of a frame ``table(name, columns)``
        with its columns and their headings, ``figure(name, title)`` and ``settings``. None is printed as "none";
        numbers are printed by the filters of `numbers`.
    name : str
        Stem of the report's files.
    values : Mapping
        Name → number or text.
    tables : Mapping
        Name → frame, or table; its title and note are not used, as the template says them better.
    figures : Mapping
        Name → picture, see `qvi_contact.plots.inline.svg_text`; empty where it could not be drawn.
    settings : sequence of Grid
        What it takes to do it again, see `environment_grids`.
    forms : Mapping, optional
        Column of a frame → what makes a text of its values.

    Raises
    ------
    ValueError
        If a table or figure is shown twice or not at all, a link within the report leads nowhere, or a name is none: a
        mistake of the program, not of its user.

    """
    from jinja2 import Environment, StrictUndefined

    shown = _Exhibits(name, tables, figures, forms)
    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
        finalize=lambda value: numbers.NOTHING if value is None else value, autoescape=False,
    )  # fmt: skip
    environment.filters |= {each: getattr(numbers, each) for each in _FILTERS}
    text = environment.from_string(template).render(
        **values, table=shown.table, figure=shown.figure, settings="\n".join(map(_setting, settings))
    )
    shown.check(text)
    pictures = {picture_file(name, each): svg for each, svg in figures.items() if svg}
    return Document(name, re.sub(r"\n{3,}", "\n\n", text).strip() + "\n", pictures, shown.grids)


def picture_file(report: str, figure: str) -> str:
    """Name of the file of a figure."""
    return f"{report}-{figure}.svg"


class _Exhibits:
    """Tables and figures as the template asks for them."""

    def __init__(
        self,
        report: str,
        tables: "Mapping[str, Grid | DataFrame]",
        figures: Mapping[str, str],
        forms: Mapping[str, Form] | None,
    ) -> None:
        self._report, self._tables, self._figures, self._forms = report, tables, figures, forms
        self._shown: Counter[str] = Counter()
        self.grids: dict[str, Grid] = {}

    def table(self, name: str, columns: Mapping[str, str] | None = None) -> str:
        """The table with an anchor; of a frame these columns, by the headings that they get."""
        self._shown[name] += 1
        found = self._tables[name]
        self.grids[name] = found if isinstance(found, Grid) else grid_of(found, columns or [*found], self._forms)
        return f"{_anchor(name)}{markdown_table(self.grids[name])}"

    def figure(self, name: str, title: str) -> str:
        """The picture with an anchor."""
        self._shown[name] += 1
        if not self._figures[name]:
            return f"{_anchor(name)}{title}. {NO_PICTURES}\n"
        return f"{_anchor(name)}![{title}]({picture_file(self._report, name)})\n"

    def check(self, text: str) -> None:
        """Raise ValueError if something is missing, or is there twice."""
        problems = [f"{name!r} is shown {self._shown[name]} times" for name in (*self._tables, *self._figures)
                    if self._shown[name] != 1]  # fmt: skip
        problems += [f"no table or figure is named {name!r}" for name in _LINK.findall(text) if not self._shown[name]]
        problems += [f"{name!r} is no name of lower-case letters, digits, hyphens and underscores"
                     for name in (self._report, *self._shown) if not _NAME.fullmatch(name)]  # fmt: skip
        if problems:
            raise ValueError(f"report {self._report!r}: {'; '.join(problems)}")


def _anchor(name: str) -> str:
    return f'<a id="{name}"></a>\n\n'


def _setting(grid: Grid) -> str:
    return f"**{grid.title}**\n\n{markdown_table(grid)}\n{grid.note}\n"
