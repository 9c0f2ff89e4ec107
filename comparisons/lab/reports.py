"""Reports: templates written by a person and filled in, as Markdown with pictures beside it, and as one HTML page.

The template of an experiment is `report.md` in its folder, Markdown with places for numbers, tables and pictures:

    1. The condensed method takes {{ fastest | seconds }} ([table](#times)).

    {{ figure("errors", "Error against time") }}

    {{ table("times", {"solver": "solver", "time": "median time"}) }}

    {{ settings }}

The same rows give the same bytes.
"""

import html
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, StrictUndefined
from markdown_it import MarkdownIt
from pandas import DataFrame
from rich.console import Console
from rich.markdown import Markdown

from comparisons.lab import numbers
from comparisons.lab.numbers import NOTHING, memory, seconds, span
from comparisons.lab.studies import Row
from qvi_contact.basics.writing import page_template, writable_folder, write_text
from qvi_contact.errors import InputError
from qvi_contact.plots.style import inline_image

Form = Callable[[Any], str]

NO_ROWS: Final = "No rows."

_FILTERS: Final = ("listing", "memory", "percent", "scientific", "seconds", "significant")
_NAME: Final = re.compile(r"[a-z0-9]+(?:[-_][a-z0-9]+)*")
_LINK: Final = re.compile(r"\]\(#([^)]*)\)")
_PICTURE: Final = re.compile(r"!\[[^\]]*\]\(([^)]*)\)")
_FINDINGS: Final = re.compile(r"^## Findings\n(.*?)(?=^#|\Z)", re.M | re.S)
_WIDTH: Final = 120
_MACHINE: Final = {
    "processor": "processor", "cores": "cores", "memory_bytes": "memory", "system": "system", "python": "Python",
    "rows": "rows",
}  # fmt: skip


@dataclass(frozen=True)
class Report:
    """A filled-in report: the stem of its files, Markdown, pictures by file name; `failed` sets the exit status 1."""

    name: str
    text: str
    pictures: Mapping[str, str]
    failed: bool = False

    @classmethod
    def read(cls, path: str | Path) -> "Report":
        """Read a Markdown report and the pictures beside it; `InputError` if a file cannot be read."""
        file = Path(path)
        try:
            text = file.read_text(encoding="utf-8")
            pictures = {name: (file.parent / name).read_text(encoding="utf-8") for name in _PICTURE.findall(text)}
        except (OSError, UnicodeDecodeError) as error:
            raise InputError("report", str(path), f"cannot be read: {error}") from error
        return cls(file.stem, text, pictures)

    @property
    def title(self) -> str:
        """The first heading."""
        return self.text.partition("\n")[0].lstrip("# ")

    def html(self) -> str:
        """The report as one HTML page without external files: tables that scroll and can be sorted, pictures inside."""
        body = MarkdownIt("commonmark").enable("table").render(self.text)
        box = '<div class="box{}" role="region" tabindex="0" aria-label="{}">\n'
        body = body.replace("<table>", f'{box.format("", "table")}<table class="sortable">')
        body = body.replace("</table>", "</table>\n</div>")

        def picture(match: re.Match[str]) -> str:
            image = inline_image(self.pictures[match[1]], html.unescape(match[2]))
            return f"<figure>\n{box.format(' picture', match[2])}{image}</div>\n</figure>\n"

        body = re.sub(r'<p><img src="([^"]*)" alt="([^"]*)" /></p>\n', picture, body)
        return page_template("comparisons.lab").render(title=self.title, body=body)

    def write(self, folder: str | Path) -> list[Path]:
        """Write ``<name>.html``, ``<name>.md`` and ``<name>-<figure>.svg``, each whole or not at all; return the paths.

        Pictures of an earlier report are not deleted. `InputError` if the folder or a file cannot be written.
        """
        texts = {f"{self.name}.html": self.html(), f"{self.name}.md": self.text, **self.pictures}
        place = writable_folder(folder)
        for name, text in reversed(texts.items()):  # pictures first, so that no text shows a missing picture
            write_text(place / name, text)
        return [place / name for name in texts]

    def show(self, written: Sequence[Path] = (), *, tables: bool = True) -> None:
        """Print the parts of the text that are not folded, or the findings only, and then the names of the files."""
        text = re.sub(r"<details>.*?</details>|^<a id=[^\n]*$|^!\[[^\n]*$", "", self.text, flags=re.M | re.S)
        text = re.sub(r"^(#+) [^\n]*\s+(?=(?!\1#)#|\Z)", "", text, flags=re.M)  # headings of empty sections
        if not tables:
            text = "".join([f"# {self.title}\n", *(match[0] for match in _FINDINGS.finditer(text))])
        console = Console(highlight=False, emoji=False)
        console = console if console.is_terminal else Console(highlight=False, emoji=False, width=_WIDTH)
        console.print(Markdown(re.sub(r"\s*\(\[[^\]]*\]\(#[^)]*\)\)", "", text), hyperlinks=False))
        if written:
            names = ", ".join(path.name for path in written)
            console.print(f"Written to {written[0].parent}: {names}", soft_wrap=True, markup=False)


def render(
    package: str,
    name: str,
    values: Mapping[str, Any],
    tables: Mapping[str, DataFrame],
    figures: Mapping[str, str],
    rows: Sequence[Row] = (),
    *,
    forms: Mapping[str, Form] | None = None,
    template: str = "report.md",
    failed: bool = False,
) -> Report:
    """Fill in the template of an experiment, a file in the folder of its package, or a text of several lines.

    The Jinja template uses `values` by their names; ``table(name, columns)``, with the columns of a frame and their
    headings, all columns by default; ``figure(name, title)`` of `figures`, see `drawing.drawn`; and ``settings``, the
    environment of the rows. None is printed as "none", numbers by the filters of `numbers`, columns of frames by
    `forms`. `name` is the stem of the report's files. `ValueError`, a mistake of the program and not of its user, if a
    table or figure is shown twice or not at all, a link within the report leads nowhere, or a name is not allowed.
    """
    shown: Counter[str] = Counter()
    pictures = {f"{name}-{each}.svg": svg for each, svg in figures.items() if svg}

    def table(which: str, columns: Mapping[str, str] | None = None) -> str:
        shown[which] += 1
        return f'<a id="{which}"></a>\n\n{markdown_table(tables[which], columns, forms)}'

    def figure(which: str, title: str) -> str:
        shown[which] += 1
        picture = f"![{title}]({name}-{which}.svg)" if figures[which] else f"{title}. {NO_ROWS}"
        return f'<a id="{which}"></a>\n\n{picture}\n'

    environment = Environment(
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
        finalize=lambda value: NOTHING if value is None else value, autoescape=False,
    )  # fmt: skip
    environment.filters |= {each: getattr(numbers, each) for each in _FILTERS}
    source = template if "\n" in template else files(package).joinpath(template).read_text(encoding="utf-8")
    frame = files(__package__).joinpath("settings.md").read_text(encoding="utf-8")
    settings = environment.from_string(frame).render(_environment(rows)) if rows else ""
    text = environment.from_string(source).render(**values, table=table, figure=figure, settings=settings)
    problems = [f"{each!r} is shown {shown[each]} times" for each in (*tables, *figures) if shown[each] != 1]
    problems += [f"no table or figure is named {each!r}" for each in _LINK.findall(text) if not shown[each]]
    problems += [f"{each!r} is no name of lower-case letters, digits, hyphens and underscores"
                 for each in (name, *shown) if not _NAME.fullmatch(each)]  # fmt: skip
    if problems:
        raise ValueError(f"report {name!r}: {'; '.join(problems)}")
    return Report(name, re.sub(r"\n{3,}", "\n\n", text).strip() + "\n", pictures, failed)


# tables

_SPACES: Final = re.compile("[ \t-\r\x1c-\x1f\x85\u2028\u2029]+")  # without spaces that bind a unit to its number
_UNPRINTABLE: Final = re.compile("[\x00-\x08\x0e-\x1f\x7f-\x9f\ufffe\uffff]")
_ACTIVE: Final = re.compile(
    r"[\\`*~|]"  # escapes, code, emphasis, strike-through, cells
    r"|(?<![^\W_])_|_(?![^\W_])"  # emphasis; not within words
    r"|<(?=[A-Za-z/!?])"  # tags
    r"|&(?=#?\w+;)"  # entities
    r"|\](?=[(\[:])"  # links
)
_MISSING: Final = frozenset({"", "-", "−", "–", "—", "n/a", "nan", NOTHING})
_LONGEST: Final = 24  # letters: a longer cell counts as a sentence, not as a number
_NUMBER: Final = re.compile(
    r"[<>≤≥~≈±=]?\s*[-−+]?(?:\d[\d,]*\.?\d*(?:[eE][-−+]?\d+)?|\.\d+|inf(?![A-Za-z])|∞)[²³]?\s*(?:%|[µμA-Za-z]+)?"
    r"(?![\w.:-]*\w)"  # a version, a date, a time of day, a word that begins with digits
)


def escaped(text: str) -> str:
    """The text as one line of Markdown, with all characters escaped that Markdown would interpret."""
    line = _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", _SPACES.sub(" ", text).strip(" "))
    return _ACTIVE.sub(lambda match: f"\\{match[0]}", line)


def markdown_table(
    frame: DataFrame, headings: Mapping[str, str] | None = None, forms: Mapping[str, Form] | None = None
) -> str:
    """The columns of a frame in `headings`, or all, as a Markdown table; missing values are `NOTHING`.

    Columns of numbers, also with units or signs, are aligned on the right.
    """
    if not len(frame):
        return f"{NO_ROWS}\n"
    names = headings or {name: name for name in frame}

    def text_of(value: Any) -> str:
        return NOTHING if value is None or value != value else str(value)

    def numeric(cells: Sequence[str]) -> bool:
        known = [cell.strip() for cell in cells if cell.strip().lower() not in _MISSING]
        return bool(known) and all(_NUMBER.match(cell) is not None and len(cell) <= _LONGEST for cell in known)

    columns = [[(forms or {}).get(name, text_of)(value) for value in frame[name]] for name in names]
    lines = [names.values(), *zip(*columns, strict=True)]
    head, *body = [f"| {' | '.join(map(escaped, line))} |" for line in lines]
    marks = " | ".join("---:" if numeric(column) else "---" for column in columns)
    return "\n".join([head, f"| {marks} |", *body, ""])


def _environment(rows: Sequence[Row]) -> dict[str, Any]:
    """The values in `settings.md`: status and limits of the runs, their machines, and the versions of packages.

    Where rows differ, each value has the number of its rows. The order of the rows has no influence.
    """

    def counts(values: Iterable[Any]) -> list[tuple[Any, int]]:
        """Values with their numbers, in the order of their texts as JSON."""
        texts = Counter(json.dumps(value, sort_keys=True) for value in values)
        return [(json.loads(text), texts[text]) for text in sorted(texts)]

    def shares(values: Iterable[Any], form: Form = str) -> str:
        found = counts(values)
        return form(found[0][0]) if len(found) == 1 else ", ".join(f"{form(value)} ({n})" for value, n in found)

    environments = [row.environment for row in rows]
    loads = [row.load_average for row in rows if row.load_average is not None]
    kinds = counts(each.get("machine") for each in environments)
    machines = [{**(machine or {}), "rows": number} for machine, number in kinds]
    table = DataFrame(machines, columns=[*_MACHINE], dtype=object)
    table = table.where(table.notna(), "unknown")
    table["memory_bytes"] = [each if each == "unknown" else memory(each) for each in table.memory_bytes]
    used = [each.get("versions") or {} for each in environments]
    packages = sorted({name for each in used for name in each}, key=str.casefold)
    found = {name: counts(each.get(name, "unknown") for each in used) for name in packages}
    versions = [{"package": name, "version": "not installed" if version is None else version, "rows": number}
                for name, each in found.items() for version, number in each]  # fmt: skip
    return {
        "rows": len(rows), "status": shares(row.status for row in rows),
        "threads": shares(each.get("threads") for each in environments),
        "limit": shares((each.get("timeout_seconds") for each in environments), seconds),
        "most": shares((each.get("memory_mib") for each in environments),
                       lambda value: NOTHING if value is None else f"{value} MiB"),
        "loads": span(loads) if loads else "unknown", "unknown": len(rows) - len(loads),
        "machines": markdown_table(table, _MACHINE), "count": len(machines),
        "versions": markdown_table(DataFrame(versions)),
        "mixed": [name for name, each in found.items() if sum(version != "unknown" for version, _ in each) > 1],
    }  # fmt: skip
