"""Reports as files: the same bytes for the same data, nothing loaded, nothing lost on the page, no text harms."""

import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import StringIO

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pandas import DataFrame

from comparisons.lab.cells import is_numeric, number_in, position, sort_key
from comparisons.lab.report import Document, environment_grids, fill, findings_of, numbers, show, write_report
from comparisons.lab.report.document import NO_PICTURES
from comparisons.lab.report.page import as_page
from comparisons.lab.report.reader import parts_of
from comparisons.lab.tables import Grid
from qvi_contact.errors import InputError
from qvi_contact.plots.inline import inline_svg
from tests.comparisons.report_parts import MACHINE, TEMPLATE, TIMES, row, sample

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
    made = as_page(Document.read(folder / "sample.md"))
    assert made == (folder / "sample.html").read_text(encoding="utf-8")
    (tmp_path / "a.md").write_text("![b](missing.svg)", encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read"):
        Document.read(tmp_path / "a.md")


def test_the_folder_is_made_and_pictures_are_written_first(report, tmp_path, monkeypatch):
    names = []
    monkeypatch.setattr("comparisons.lab.report.page.write_text", lambda path, _: names.append(path.name))
    written = write_report(report, tmp_path / "new" / "folder")
    assert (tmp_path / "new" / "folder").is_dir()
    assert names == [path.name for path in reversed(written)]


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


def test_ids_are_prefixed_in_tags_only():
    svg = '<svg width="72pt"><g id="x" clip-path="url(#x)"><use xlink:href="#x"/><text> id="x" url(#x)</text></g></svg>'
    made = inline_svg(svg, "f", 'a "b" <c>')
    assert '<g id="f--x" clip-path="url(#f--x)"><use xlink:href="#f--x"/><text> id="x" url(#x)</text>' in made
    assert made.startswith(
        '<svg id="f--svg" role="img" aria-label="a &quot;b&quot; &lt;c&gt;" style="min-width: 82px" '
    )


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


def test_a_folder_that_cannot_be_written_is_bad_input(report, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        write_report(report, tmp_path / "file" / "folder")


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
    text = fill(template, "sample", {}, {"times": frame}, {}, forms={"time": numbers.seconds}).text
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


def test_the_terminal_says_how_to_get_pictures(tmp_path):
    from rich.console import Console

    text = StringIO()
    show(sample(undrawn), [tmp_path / "sample.html"], Console(file=text, width=120, markup=False))
    assert NO_PICTURES.replace("`", "") in text.getvalue()
    assert TEMPLATE.count("figure(") == 2


class TestOrder:
    """Sorting, by whatever a cell begins with."""

    @pytest.mark.parametrize(
        ("cell", "value"),
        [
            ("1.2e-5", 1.2e-5), ("1.2e-05", 1.2e-5), ("−3", -3.0), ("-3.5 m", -3.5), ("+.5", 0.5), ("12 %", 0.12),
            ("12 ms", 0.012), ("340 µs", 3.4e-4), ("2 min", 120.0), ("2h", 7200.0), ("2 MiB", 2.0**21), ("32²", 32.0),
            ("32 × 32", 32.0), ("1,234,567", 1234567.0), ("3 of 5", 3.0), ("1.5 ± 0.2", 1.5), ("0.5 to 1.6", 0.5),
            ("≤ 1e-8", 1e-8), ("1e−5", 1e-5), ("inf", math.inf), ("-∞", -math.inf), ("5e-3 (relative)", 5e-3),
            ("7 N/m", 7.0),
        ],
    )  # fmt: skip
    def test_the_number_of_a_cell(self, cell, value):
        assert number_in(cell) == pytest.approx(value, rel=1e-12)

    @pytest.mark.parametrize(
        "cell", ["1.2.3", "2026-01-02", "12:30", "info", "qp:osqp", "e5", "3d-model2", "", "-", "µ"]
    )
    def test_words_are_no_numbers(self, cell):
        assert number_in(cell) is None

    def test_words_stand_behind_numbers_and_nothing_behind_words(self):
        cells = ["-", "word", "2 s", "n/a", "1 ms", "inf", "none"]
        assert sorted(cells, key=position) == ["1 ms", "2 s", "inf", "word", "-", "n/a", "none"]

    def test_bounds_lie_beside_their_number(self):
        assert 0.999e-9 < number_in("< 1e-9") < 1e-9
        assert 0.99 < number_in("> 99 %") < 0.991
        assert number_in("< -2") < -2.0

    @given(st.floats(allow_nan=False), st.floats(allow_nan=False))
    @example(0.0, -0.0)
    def test_numbers_keep_their_order(self, first, second):
        small, large = sorted((first, second))
        for form in ("{:.3e}", "{:.6f} MPa", "{:g}", "< {:.1e}"):
            a, b = (position(form.format(value)) for value in (small, large))
            assert a[0] == b[0] == 0
            assert a <= b

    @given(st.floats(1e-7, 1e6), st.floats(1e-7, 1e6))
    def test_formats_keep_the_order_of_what_they_print(self, first, second):
        small, large = sorted((first, second))
        for form in (numbers.seconds, numbers.scientific, numbers.significant, numbers.memory):
            assert number_in(form(small)) <= number_in(form(large)) * (1.0 + 1e-12)

    @given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(0, 3))
    def test_percentages_keep_the_order_of_shares(self, first, second, digits):
        small, large = sorted((first, second))
        assert number_in(numbers.percent(small, digits)) <= number_in(numbers.percent(large, digits)) + 1e-12

    @given(st.text("0123456789.,eE+-−<>≤~ %µsminhKMGTiB∞²½٣f/:_abé\ud800", max_size=12))
    def test_a_key_is_read_like_its_cell(self, cell):
        key = sort_key(cell)
        assert (key is None) == (position(cell)[0] == 1)
        if key:
            assert sort_key(key) == key

    @given(st.lists(st.sampled_from(["1", "-", "2 s", "n/a"]), min_size=1))
    def test_columns_of_numbers(self, cells):
        assert is_numeric(cells) == any(cell[0].isdigit() for cell in cells)
        assert not is_numeric([*cells, "word"])
        assert not is_numeric([*cells, "3 of them failed for a reason that is long"])


class TestNumbers:
    """Formats of numbers."""

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            (numbers.scientific(1.234e-5), "1.2e-5"), (numbers.scientific(9.99e9, 1), "1e10"),
            (numbers.scientific(-2e-12, 3), "-2.00e-12"), (numbers.scientific(0.0), "0"),
            (numbers.significant(0.0012345), "0.00123"), (numbers.significant(1234567.0), "1230000"),
            (numbers.significant(-0.0), "0"), (numbers.significant(2.0), "2"),
            (numbers.seconds(3.4e-4), "340 µs"), (numbers.seconds(0.99999), "1 s"),
            (numbers.seconds(0.0123), "12.3 ms"),
            (numbers.seconds(119.0), "119 s"), (numbers.seconds(150.0), "2.5 min"), (numbers.seconds(9000.0), "2.5 h"),
            (numbers.seconds(0.0), "0 s"), (numbers.memory(2**34), "16 GiB"), (numbers.memory(12), "12 bytes"),
            (numbers.percent(0.123), "12 %"), (numbers.percent(0.0), "0 %"), (numbers.percent(1.0), "100 %"),
            (numbers.percent(0.0001), "< 1 %"), (numbers.percent(0.9999), "> 99 %"),
            (numbers.percent(0.99961, 1), "> 99.9 %"),
            (numbers.percent(1.5), "150 %"), (numbers.percent(-0.1), "-10 %"),
            (numbers.listing([]), "none"), (numbers.listing(["a"]), "a"), (numbers.listing(["a", "b"]), "a and b"),
            (numbers.listing(["a", "b", "c"], "or"), "a, b or c"),
        ],
    )  # fmt: skip
    def test_texts(self, text, expected):
        assert text == expected

    @pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf])
    def test_what_is_no_number_is_none(self, value):
        forms = (numbers.scientific, numbers.significant, numbers.seconds, numbers.memory, numbers.percent)
        assert {form(value) for form in forms} == {"none"}

    @settings(max_examples=50)
    @given(st.floats(0.0, 1.0), st.integers(0, 4))
    def test_only_all_is_all_and_only_nothing_is_nothing(self, share, digits):
        text = numbers.percent(share, digits)
        assert (number_in(text) == 1.0) == (share == 1.0)
        assert (number_in(text) == 0.0) == (share == 0.0)


class TestEnvironment:
    """Tables of what rows were computed with."""

    def test_one_machine(self):
        runs, machine, versions = environment_grids([row(0), row(1, "timeout", 1.5), row(2, "done", None, 8)])
        assert dict(runs.rows) == {
            "rows": "3", "status": "done (2), timeout (1)", "threads of a run": "1", "time limit of a run": "60 s",
            "memory limit of a run": "none", "seeds": "7 (2), 8 (1)",
            "load average before a run": "0.5 to 1.5 (unknown for 1 row)",
        }  # fmt: skip
        assert machine.rows == [("P1", "4", "16 GiB", "Linux, x86_64", "CPython 3.12.1", "3")]
        assert versions.rows == [("numpy", "2.0.0", "3")]
        assert (machine.title, machine.note, versions.note) == ("Machine", "", "")

    def test_several_machines_and_versions_are_said(self):
        other = row(2, machine=MACHINE | {"processor": "P2"}, versions={"numpy": "2.1.0", "osqp": None}, memory_mib=512)
        rows = [row(0), row(1), other, row(3, "crashed", machine=None, versions={})]
        runs, machines, versions = environment_grids(rows)
        assert machines.title == "Machines"
        assert "2 kinds of machine" in machines.note
        assert [(cells[0], cells[-1]) for cells in machines.rows] == [("P1", "2"), ("P2", "1"), ("unknown", "1")]
        assert versions.rows[:3] == [("numpy", "2.0.0", "2"), ("numpy", "2.1.0", "1"), ("numpy", "unknown", "1")]
        assert ("osqp", "not installed", "1") in versions.rows
        assert versions.note == "The rows were computed with different versions of numpy."
        assert dict(runs.rows)["memory limit of a run"] == "512 MiB (1), none (3)"
        assert environment_grids(rows[::-1]) == [runs, machines, versions]

    def test_rows_that_say_nothing(self):
        runs, machine, versions = environment_grids([row(load=None, machine=None, versions={})])
        assert machine.rows == [("unknown",) * 5 + ("1",)]
        assert versions.rows == []
        assert dict(runs.rows)["load average before a run"] == "unknown"
        assert dict(environment_grids([])[0].rows)["status"] == "none"
