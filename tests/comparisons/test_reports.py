"""Reports as files, in a browser and on a terminal: the same bytes for the same data, nothing loaded, no harm."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pandas import DataFrame

from comparisons.lab import numbers
from comparisons.lab.drawing import drawn
from comparisons.lab.reports import Report, markdown_table, render
from qvi_contact import InputError
from qvi_contact.plots import new_figure
from tests.comparisons.conftest import row

MACHINE = {
    "processor": "P1", "cores": 4, "memory_bytes": 2**34, "system": "Linux, x86_64", "python": "CPython 3.12.1",
}  # fmt: skip
TIMES = DataFrame(
    [
        ("qp:clarabel", "12.3 ms", "1.2e-05", "12 %", "done", "-"),
        ("qp:osqp", "1.2 s", "< 1e-9", "> 99 %", "done", "-"),
        ("qp:scs", "340 µs", "3.0e-02", "5 %", "timeout", f"ended after 60 s | with `ValueError`{9 * ', a sentence'}"),
        ("qp:daqp", None, "n/a", "100 %", "done", "-"),
        ("qp:piqp", "2 min", "−1.0e-3", "0 %", "error", "-"),
    ],
    columns=["solver", "time", "stationarity", "certified", "status", "reason"],
)
TEMPLATE = """
# Solvers compared

By `python -m comparisons solvers`.

## Findings

1. *Clarabel* takes {{ fastest | seconds }}
   at most ([table](#times)).
2. Nobody lies ([table](#lies)).

## Times

{{ figure("a", "Figure of a") }}

{{ table("times", {"solver": "back end", "time": "median time", "status": "status", "reason": "reason"}) }}

{{ table("lies") }}

{{ figure("b", "Figure of b") }}

### Everything

<details>
<summary>All of them</summary>

{{ table("many") }}

</details>

## Settings

{{ settings }}
"""


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


def sample(svg=picture, **values):
    """The report; values are replaced by name."""
    many = DataFrame({"case": [f"plate-{i}" for i in range(40)], "μ": [i / 10 for i in range(40)]})
    tables = {"times": TIMES, "many": many, "lies": DataFrame(columns=["solver"])}
    figures, known = {name: svg(name) for name in "ab"}, {"fastest": 0.0123} | values
    return render("", "sample", known, tables, figures, [row({}, {}, machine=MACHINE)], template=TEMPLATE)


class Page(HTMLParser):
    """Ids, references, cells, texts and pictures of a page, what it loads, and whether elements are closed in order."""

    VOID = ("meta", "link", "img", "br", "hr", "input")

    def __init__(self, text):
        super().__init__()
        self.open, self.balanced, self.ids, self.loads, self.rows, self.pictures = [], True, [], [], [], []
        self.scripts, self.references, self.policy = 0, [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.handle_startendtag(tag, attributes)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        self.scripts += tag == "script"

    def handle_startendtag(self, tag, attributes):
        for name, found in attributes:
            value = found or ""
            if name == "src" and value.startswith("data:image/svg+xml,"):
                self.pictures.append(unquote(value.partition(",")[2]))
                continue
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
        elif self.rows and {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("report")
    sample().write(place)
    return place


@pytest.fixture(scope="module")
def page(folder):
    return Page((folder / "sample.html").read_text(encoding="utf-8"))


def test_the_same_data_gives_the_same_bytes_and_the_page_is_made_of_the_files_alone(folder, tmp_path):
    written = sample().write(tmp_path)  # pictures are drawn again
    assert [path.name for path in written] == ["sample.html", "sample.md", "sample-a.svg", "sample-b.svg"]
    for path in written:
        assert path.read_bytes() == (folder / path.name).read_bytes()
    assert Report.read(folder / "sample.md").html() == (folder / "sample.html").read_text(encoding="utf-8")
    (tmp_path / "a.md").write_text("![b](missing.svg)", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        Report.read(tmp_path / "a.md")


def test_the_page_is_sound_and_loads_nothing(page):
    assert page.balanced
    assert not page.open
    assert set(page.loads) == {"data:,"}  # the icon, which browsers would ask for otherwise
    assert page.policy.startswith("default-src 'none'")
    assert page.scripts == 1
    assert len(set(page.ids)) == len(page.ids)
    assert set(page.references) <= set(page.ids)
    assert {"times", "lies"} <= set(page.ids)
    assert [ElementTree.fromstring(picture).tag for picture in page.pictures] == 2 * ["{http://www.w3.org/2000/svg}svg"]
    rows = [cells for cells in page.rows if cells]
    assert rows[0] == ["back end", "median time", "status", "reason"]
    assert rows[4] == ["qp:daqp", "none", "done", "-"]
    assert ["plate-39", "3.9"] in rows  # folded


def test_findings_are_those_of_the_template_with_numbers():
    report = sample(lambda _: "", fastest=None)
    assert report.title == "Solvers compared"
    assert "## Findings\n\n1. *Clarabel* takes none\n   at most" in report.text


HOSTILE = [
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "a|b", "{{ 7 * 7 }} {% raw %}", "|σ|",
    "x\n# heading\n- item", "]]>-->", "</td></table></body>", "[link](javascript:alert(1))", "&lt;b&gt; &amp;",
    "\\| \\", "`|`", "__init__ *args", "nul \x00", "http://example.org/x.js", "<!--",
    "- dash", "1. one", "[link](x.html)", "[a]: b", "*a* `b` **c**",
]  # fmt: skip


def test_cells_mean_nothing_but_what_they_say():
    for text in HOSTILE:
        made = render("", "t", {}, {"t": DataFrame({text: [text]})}, {}, template="# T\n\n{{ table('t') }}")
        page, clean = Page(made.html()), re.sub(r"\x00", "\ufffd", " ".join(text.split()))
        assert (page.balanced, page.scripts, set(page.loads)) == (True, 1, {"data:,"})
        assert page.rows == [[clean], [clean]]


def test_files_are_replaced_whole_or_not_at_all(folder, tmp_path, monkeypatch):
    report = Report.read(folder / "sample.md")
    replace(report, text="Earlier.").write(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(InputError, match="No space left"):
        report.write(tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "../up"}, "is no name"),
        ({"template": "{{ table('t') }}\n{{ table('t') }}"}, "'t' is shown 2 times"),
        ({"template": "no\ntable"}, "'t' is shown 0 times"),
        ({"template": "{{ table('t') }}\n([table](#u))"}, "no table or figure is named 'u'"),
    ],
)
def test_a_template_that_forgets_or_repeats_is_refused(changes, message):
    parts = {"template": "{{ table('t') }}\n([table](#t))", "name": "sample"}
    known = {"package": "", "values": {}, "tables": {"t": TIMES}, "figures": {}}
    assert render(**parts, **known).name == "sample"
    with pytest.raises(ValueError, match=re.escape(message)):
        render(**(parts | changes), **known)
    with pytest.raises(Exception, match="'fastest' is undefined"):
        render(**known, name="sample", template="{{ fastest }}\n")


@pytest.mark.parametrize("tables", [True, False])
def test_the_terminal_has_what_is_not_folded_and_the_files(folder, capsys, tables):
    Report.read(folder / "sample.md").show([folder / "sample.html", folder / "sample.md"], tables=tables)
    out = capsys.readouterr().out
    assert "\x1b" not in out
    assert out.index("Clarabel takes 12.3 ms") < out.index("Written to")
    assert ("qp:daqp" in out) == tables
    assert "plate-39" not in out  # folded
    assert "sample.html, sample.md" in out
    assert max(map(len, out.partition("Written to")[0].splitlines())) <= 120


def test_a_page_opens_in_a_browser_without_an_error_and_its_tables_sort(browser, folder):
    """At the width of a phone too; numbers by their size and unit, then words, then nothing."""
    said = []
    with browser.new_page(offline=True) as page:
        page.on("console", lambda message: said.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: said.append(str(error)))
        page.set_viewport_size({"width": 390, "height": 900})
        page.goto((folder / "sample.html").as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        table = page.locator("table.sortable").first
        heading = table.locator("thead th").nth(1)
        heading.locator("button").click()
        assert heading.get_attribute("aria-sort") == "ascending"
        found = table.locator("tbody td:nth-child(2)").all_inner_texts()
        assert found == ["340 µs", "12.3 ms", "1.2 s", "2 min", "none"]
        assert table.locator("td.failed").all_inner_texts() == ["timeout", "error"]
    assert said == []


def test_a_table_in_markdown_is_declared_by_its_columns():
    frame = DataFrame({"time": [0.5, None], "|name|": ["a", None], "other": [1, 2]})
    text = markdown_table(frame, {"|name|": "|σ|", "time": "time [s]"}, {"time": numbers.fixed(".2f")})
    assert text.splitlines() == [r"| \|σ\| | time [s] |", "| --- | ---: |", "| a | 0.50 |", "| none | none |"]
    assert markdown_table(frame[:0]) == "No rows.\n"


@settings(max_examples=50)
@given(st.floats(0.0, 1.0), st.integers(0, 4))
def test_only_all_is_all_and_only_nothing_is_nothing(share, digits):
    text = numbers.percent(share, digits)
    assert (text in ("100 %", f"100.{digits * '0'} %")) == (share == 1.0)
    assert (text in ("0 %", f"0.{digits * '0'} %")) == (share == 0.0)
