"""Reports as files and in a browser: the same bytes for the same data, nothing loaded, nothing lost, no harm."""

import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from pandas import DataFrame

from comparisons.lab import Grid
from comparisons.lab import report as room
from comparisons.lab.report import Document, drawn, fill, findings_of, parts_of, show, write_report
from qvi_contact import InputError
from qvi_contact.plots import new_figure

SETTINGS = Grid("Versions", ("package", "version", "rows"), [("numpy", "2.0.0", "2")])

TIMES = Grid(
    "Times",
    ("back end", "median\ntime", "stationarity [-]", "certi-\nfied", "status", "reason"),
    [
        ("qp:clarabel", "12.3 ms", "1.2e-05", "12 %", "done", "-"),
        ("qp:osqp", "1.2 s", "< 1e-9", "> 99 %", "done", "-"),
        ("qp:scs", "340 µs", "3.0e-02", "5 %", "timeout", f"ended after 60 s | with `ValueError`{9 * ', a sentence'}"),
        ("qp:daqp", "none", "n/a", "100 %", "done", "-"),
        ("qp:piqp", "2 min", "−1.0e-3", "0 %", "error", "-"),
    ],
)  # fmt: skip


def picture(name):
    """A picture with clip paths, markers and mathematical text."""

    def draw():
        figure = new_figure(6.0, 3.0)
        axes = figure.subplots()
        axes.semilogy([0.0, 1.0, 2.0], [1e-3, 1e-2, 1e-1], marker="o", label=name)
        axes.set_xlabel("time [s]")
        axes.legend()
        return figure

    return drawn(name, draw)


TEMPLATE = """
# Solvers compared

By `python -m comparisons solvers`.

## Findings

1. *Clarabel* takes {{ fastest | seconds }} ([table](#times)).
2. Nobody lies ([table](#lies)).

## Times

{{ figure("a", "Figure of a") }}

{{ table("times") }}

Rows whose status is not `done` failed.

## Lies

{{ table("lies") }}

{{ figure("b", "Figure of b") }}

<details>
<summary>All of them</summary>

{{ table("many") }}

</details>

## Settings

{{ settings }}

## Limits

{% for limit in limits %}
- {{ limit }}
{% endfor %}
"""


def sample(svg=picture, template=TEMPLATE, times=TIMES, **values):
    """The report; values are replaced by name."""
    many = Grid("", ("case", "μ"), [(f"plate-{i}", f"{i / 10:g}") for i in range(40)])
    tables = {"times": times, "many": many, "lies": Grid("", ("back end", "times"), [])}
    known = {"fastest": 0.0123, "limits": ["One thread."]} | values
    figures = {name: svg(name) for name in "ab"}
    return fill(template, "sample", known, tables, figures, [SETTINGS])


HOSTILE = [
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a|b", "{{ 7 * 7 }} {% raw %}",
    "x\n# heading\n- item", "]]>-->", "</td></table></body>", "[link](javascript:alert(1))", "&lt;b&gt; &amp;",
    "\\| \\", "`|`", "__init__ *args", "nul \x00, half a pair \ud800", "http://example.org/x.js", "<!--",
    "- dash", "1. one", "[link](x.html)", "[a]: b", "*a* `b` **c**",
]  # fmt: skip


class Page(HTMLParser):
    """Ids, references, cells and texts of a page, what it loads, and whether elements are closed in order."""

    VOID = ("meta", "link", "img", "br", "hr", "input")

    def __init__(self, text):
        super().__init__()
        self.open, self.balanced, self.ids, self.loads, self.rows = [], True, [], [], []
        self.scripts, self.classes, self.references, self.texts, self.policy = 0, [], [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        names = dict(attributes)
        self.handle_startendtag(tag, attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
            self.classes.append((names.get("class", ""), names.get("data-key")))
        self.scripts += tag == "script"

    def handle_startendtag(self, tag, attributes):
        for name, value in attributes:
            self._attribute(tag, name, value or "")

    def _attribute(self, tag, name, value):
        if name == "id":
            self.ids.append(value)
        if name in ("href", "xlink:href") and value.startswith("#"):
            self.references.append(value[1:])
        elif name in ("src", "href", "xlink:href", "data", "action", "srcset"):
            self.loads.append(value)
        self.references += re.findall(r"url\(#([^)]*)\)", value)
        self.loads += re.findall(r"url\((?!#)[^)]*\)|@import[^;]*", value)
        if (tag, name) == ("meta", "content") and "default-src" in value:
            self.policy = value

    def handle_endtag(self, tag):
        self.balanced = self.balanced and bool(self.open) and self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("style", "script"):
            self.loads += re.findall(r"url\([^)]*\)|@import[^;]*", data)
            return
        self.texts.append(data)
        if self.rows and {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data

    @property
    def text(self):
        return "".join(self.texts)


@pytest.fixture(scope="module")
def report():
    return sample()


@pytest.fixture(scope="module")
def folder(report, tmp_path_factory):
    place = tmp_path_factory.mktemp("report")
    write_report(report, place)
    return place


@pytest.fixture(scope="module")
def page(folder):
    return Page((folder / "sample.html").read_text(encoding="utf-8"))


def undrawn(_):
    return ""


def grids(text):
    return [part for part in parts_of(text) if isinstance(part, Grid)]


def test_the_same_data_gives_the_same_bytes(folder, tmp_path):
    written = write_report(sample(), tmp_path)  # pictures are drawn again
    assert [path.name for path in written] == ["sample.html", "sample.md", "sample-a.svg", "sample-b.svg"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in written)
    for path in written:
        assert path.read_bytes() == (folder / path.name).read_bytes()


def test_the_page_can_be_made_of_the_files_alone(folder, tmp_path):
    """So that only Markdown and pictures need to be kept."""
    made = room.as_page(Document.read(folder / "sample.md"))
    assert made == (folder / "sample.html").read_text(encoding="utf-8")
    (tmp_path / "a.md").write_text("![b](missing.svg)", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        Document.read(tmp_path / "a.md")


def test_the_page_is_sound_and_loads_nothing(page):
    assert page.balanced
    assert not page.open
    assert set(page.loads) == {"data:,"}  # the icon, which browsers would ask for otherwise
    assert page.policy.startswith("default-src 'none'")
    assert page.scripts == 1


def test_ids_are_unique_and_references_lead_somewhere(page):
    assert len(set(page.ids)) == len(page.ids)
    assert set(page.references) <= set(page.ids)
    assert {"times", "lies", "Times", "Lies"} <= set(page.ids)
    pictures = {name.split("--")[0] for name in page.ids if "--" in name}
    assert pictures == {"a", "b"}
    assert sum(name.startswith("a--") for name in page.references) > 5  # clip paths and markers


def test_rows_are_lines_of_the_text_and_of_the_page(report, page):
    rows = [cells for cells in page.rows if cells]
    assert rows[0] == ["back end", "median time", "stationarity [-]", "certified", "status", "reason"]
    assert rows[1:6] == [list(cells) for cells in TIMES.rows]
    assert ["plate-39", "3.9"] in rows  # folded
    assert ["numpy", "2.0.0", "2"] in rows
    for cells in TIMES.rows:
        assert sum(line.startswith(f"| {cells[0]}") for line in report.text.splitlines()) == 1


def test_numbers_stand_on_the_right_have_keys_and_failures_are_drawn(page):
    found = dict(zip((cell for cells in page.rows for cell in cells), page.classes, strict=True))
    assert found["12.3 ms"] == ("number", "0.0123")
    assert found["1.2e-05"] == ("number", "1.2e-05")
    assert found["n/a"] == ("number", "")
    assert found["qp:osqp"] == ("", None)
    assert found["timeout"] == ("failed", None)
    assert [look for look, _ in page.classes].count("failed") == 2  # timeout, error


def test_contents_lead_to_the_sections_behind_the_findings(page):
    assert page.references[:2] == ["times", "lies"]
    assert page.references[2:6] == ["Times", "Lies", "Settings", "Limits"]


def test_findings_are_those_of_the_template_with_numbers(report):
    assert findings_of(report.text) == ["Clarabel takes 12.3 ms.", "Nobody lies."]
    assert findings_of(sample(undrawn, fastest=None).text)[0] == "Clarabel takes none."
    assert findings_of("# Nothing\n\n1. Not a finding.\n") == []


@pytest.mark.parametrize("text", HOSTILE)
def test_cells_mean_nothing(text, tmp_path):
    table = Grid("", (text, "n"), [(text, "1")])
    made = fill("# T\n\n{{ table('t') }}\n\n{{ settings }}", "t", {}, {"t": table}, {}, [Grid("S", ("a",), [(text,)])])
    page = Page(write_report(made, tmp_path)[0].read_text(encoding="utf-8"))
    clean = page.rows[1][0]
    assert page.balanced
    assert page.scripts == 1
    assert set(page.loads) == {"data:,"}
    assert page.rows == [[clean, "n"], [clean, "1"], ["a"], [clean]]
    assert [grid.rows for grid in grids(made.text)] == [[(clean, "1")], [(clean,)]]
    assert clean == re.sub(r"[\x00\ud800]", "\ufffd", " ".join(text.split()))


@pytest.mark.parametrize("installed", [True, False])
def test_where_no_picture_can_be_drawn_it_says_how_to_get_them(tmp_path, installed, report):
    written = write_report(report if installed else sample(undrawn), tmp_path)
    assert [path.suffix for path in written[:2]] == [".html", ".md"]
    assert len(written) == (4 if installed else 2)
    for path in written[:2]:
        assert path.read_text(encoding="utf-8").count("need matplotlib") == (0 if installed else 2)


def test_files_are_replaced_whole_or_not_at_all(report, folder, tmp_path, monkeypatch):
    write_report(replace(report, text="Earlier."), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    monkeypatch.setattr("pathlib.Path.replace", _full)
    with pytest.raises(InputError, match="No space left"):
        write_report(report, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    monkeypatch.undo()
    write_report(report, tmp_path)
    assert (tmp_path / "sample.html").read_bytes() == (folder / "sample.html").read_bytes()


def _full(*_):
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "Sample report"}, "'Sample report' is no name"),
        ({"name": "../up"}, "is no name"),
        ({"template": "{{ table('t') }}{{ table('t') }}"}, "'t' is shown 2 times"),
        ({"template": "no table"}, "'t' is shown 0 times"),
        ({"template": "{{ table('t') }} ([table](#u))"}, "no table or figure is named 'u'"),
    ],
)
def test_a_template_that_forgets_or_repeats_is_refused(changes, message):
    parts = {"template": "{{ table('t') }} ([table](#t))", "name": "sample"}
    known = {"values": {}, "tables": {"t": TIMES}, "figures": {}}
    assert fill(**parts, **known).name == "sample"
    with pytest.raises(ValueError, match=re.escape(message)):
        fill(**(parts | changes), **known)


def test_a_number_that_is_missing_is_an_error():
    with pytest.raises(Exception, match="'fastest' is undefined"):
        fill("{{ fastest }}", "sample", {}, {}, {})


def test_a_template_names_the_columns_of_a_frame():
    frame = DataFrame({"time": [0.5, math.nan], "left out": [1, 2], "solver": ["a", "b"]})
    template = '{{ table("times", {"solver": "solver", "time": "median time"}) }}'
    text = fill(template, "sample", {}, {"times": frame}, {}, forms={"time": room.seconds}).text
    (grid,) = parts_of(text)
    assert (grid.headings, grid.rows) == (("solver", "median time"), [("a", "500 ms"), ("b", "none")])


def test_the_terminal_has_findings_tables_and_files(report, folder, capsys):
    show(report, [folder / "sample.html", folder / "sample.md"])
    out = capsys.readouterr().out
    assert "\x1b" not in out
    places = [out.index(text) for text in ("1. Clarabel takes 12.3 ms.", "qp:daqp", "Written")]
    assert places == sorted(places)
    assert "plate-39" not in out  # folded
    assert f"Written to {folder}: sample.html, sample.md" in out
    table = out[out.index("qp:clarabel") : out.index("Written")].splitlines()
    assert 100 < max(map(len, table)) <= 120


def test_a_page_opens_in_a_browser_without_an_error_and_its_tables_sort(browser, folder):
    """At the width of a phone too."""
    said = []
    with browser.new_page(offline=True) as page:
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.set_viewport_size({"width": 390, "height": 900})
        page.goto((folder / "sample.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        heading = page.locator("table.sortable").first.locator("thead th").first
        heading.locator("button").click()
        assert heading.get_attribute("aria-sort") == "ascending"
    assert said == []
