"""Reports in a real browser: a good page has no problem, and whatever is broken in one is seen."""

import re
import sys
from contextlib import nullcontext

import pytest

from comparisons.lab.report import browser as looking
from comparisons.lab.report import fill, write_report
from qvi_contact.basics import terminal
from qvi_contact.errors import InputError
from tests.comparisons.report_parts import TIMES, sample


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """Text of the sample's page."""
    return write_report(sample(), tmp_path_factory.mktemp("report"))[0].read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Text of a page with one table only."""
    report = fill("# T\n\n{{ table('times') }}\n", "sample", {}, {"times": TIMES}, {})
    return write_report(report, tmp_path_factory.mktemp("table"))[0].read_text(encoding="utf-8")


@pytest.fixture
def problems(browser, tmp_path):
    def look(text, widths=looking.WIDTHS):
        file = tmp_path / "page.html"
        file.write_text(text, encoding="utf-8")
        return looking.problems_on(browser, file, widths)

    return look


def test_a_report_is_good(problems, page):
    assert problems(page) == []


ADDED = {
    "<script>console.error('wrong')</script>": "error in the console: wrong",
    "<script>missing()</script>": "exception in a script: missing is not defined",
    '<div style="overflow: hidden"><p style="width: 1400px">wide</p></div>': "outside of the window or of its box: <p>",
    '<img src="http://192.0.2.1/x.png" alt="">': "error in the console: Loading the image",
    '<figure id="x1" style="visibility: hidden"><p>text</p></figure>': "figure x1 is not visible",
    '<figure id="x2" style="display: none"><p>text</p></figure>': "figure x2 is not visible",
    '<figure id="x3"><svg width="90" height="90"></svg></figure>': "figure x3 is empty",
    '<figure id="x4"><img src="data:," width="90" height="90" alt=""></figure>': "figure x4 is empty",
    '<p style="font-size: 6px">small</p>': 'letters too small to be read: <p> "small"',
    '<p id="a">again</p>': "ids that are there more than once: a",
    '<a href="#nowhere">there</a>': "links that lead nowhere: #nowhere",
}
"""What is put into a page, and how it is complained of."""


CHANGED = [
    ('<html lang="en">', "<html>", "the page does not say which language it is in"),
    ("<title>Solvers compared</title>", "", "the page has no title"),
    ('<div class="box"', '<div class="none"', "the page is "),
    ("min-width: 490px", "width: 300px", "letters too small to be read: <text>"),
    ('<svg id="b--svg"', '<svg id="b--svg" transform="translate(-90)"', "figure b is not inside its box"),
    (">time [s]</text>", f">{120 * 'time'}</text>", "figure a cuts off <text>"),
]
"""Text of a page, what it is replaced by, and how it is complained of."""


def test_whatever_is_wrong_is_seen(problems, page, monkeypatch):
    """All of it on one page, as each takes a while to open; so the sentences list what is alike to its end."""
    monkeypatch.setattr(looking, "_NAMED", 99)
    for right, wrong, _ in CHANGED:
        assert right in page
        page = page.replace(right, wrong, 1)
    found = problems(page.replace("</main>", "".join(ADDED) + "</main>"), (390,))
    for problem in (*ADDED.values(), *(problem for _, _, problem in CHANGED)):
        head, colon, name = problem.partition(": ")
        sentence = re.compile(f"{re.escape(head + colon)}(.*, )?{re.escape(name)}")
        assert any(map(sentence.search, found)), (problem, found)


SORTING = {
    "numbers as words": (": number ?", ": number === null ?", "column 3: the rows are not ascending"),
    "words in one direction": ("sign * compare", "(a.kind === 0 ? sign : 1) * compare", "words are not turned round"),
    "one direction only": ("sign * compare", "compare", "column 2: the rows are not descending"),
    "nothing as zero": ("kind: 2, value: 0", "kind: 0, value: 0", "column 2: the rows are not ascending"),
    "no word of it": ('heading.setAttribute("aria-sort", next)', "0", "aria-sort is None, not ascending"),
    "two columns": ('other.removeAttribute("aria-sort"))', "0)", "more than one column says that it is sorted"),
    "rows lost": (
        "body.append(...(",
        "body.replaceChildren(...(1 ? written.slice(1) : ",
        "sorting changes the rows",
    ),
    "no way back": ('next === "none" ? written : sorted', "sorted", "does not bring back the order of the rows"),
    "no buttons": ("heading.append(button)", "heading.append(...button.childNodes)", "by all its columns"),
    "no keyboard": (
        'button.type = "button"',
        "button.onkeydown = () => false",
        "by keyboard and mouse",
    ),
}


def test_wrong_sorting_is_seen(problems, table):
    """One page with a table for each fault, sorted by a script that has this fault alone."""
    before, grid, after = re.split('(<table class="sortable">.*?</table>)', table, maxsplit=1, flags=re.DOTALL)
    rest, script = after.split("<script>")
    script, end = script.split("</script>")
    tables, scripts = [grid], [f"{{{script.replace('.sortable', '.t0')}}}"]
    for number, (right, wrong, _) in enumerate(SORTING.values(), start=1):
        assert right in script
        scripts.append(f"{{{script.replace('.sortable', f'.t{number}').replace(right, wrong, 1)}}}")
        tables.append(grid)
    tables = [text.replace('"sortable"', f'"sortable t{number}"') for number, text in enumerate(tables)]
    found = problems(f"{before}{''.join(tables)}{rest}<script>{''.join(scripts)}</script>{end}", (1280,))
    assert not [text for text in found if not re.match(r"table ([2-9]|1\d)\b", text)], found
    for number, (name, (_, _, problem)) in enumerate(SORTING.items(), start=2):
        assert any(re.match(rf"table {number}\b", text) and problem in text for text in found), (name, found)


def test_a_button_that_cannot_be_reached_is_seen(problems, table, monkeypatch):
    monkeypatch.setattr(looking, "_PATIENCE", 800.0)
    found = problems(table.replace("</style>", "th button { pointer-events: none }</style>"), (1280,))
    assert found[0] == "table 1 cannot be sorted by keyboard and mouse"


def test_a_request_is_seen_where_the_page_allows_it(problems):
    image, style = '<img src="http://192.0.2.1/x.png" alt="">', "<link rel=stylesheet href=a.css>"
    found = problems(f'<html lang="en"><title>t</title><p>text{image}{style}')
    assert "the page asks for http://192.0.2.1/x.png" in found
    assert any(problem.startswith("the page asks for file:") and problem.endswith("/a.css") for problem in found)


def command(monkeypatch, capfd, *arguments):
    """Exit status, standard output and standard error of the command line."""
    monkeypatch.setattr(sys, "argv", ["browser", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        terminal.run(looking.command, "browser")
    out, err = capfd.readouterr()
    return caught.value.code, out, err


def test_the_command_has_a_line_for_each_page(tmp_path, monkeypatch, capfd):
    """And makes pages of Markdown; what is wrong with them is a word in them here."""
    monkeypatch.setattr(looking, "missing", lambda: "")
    monkeypatch.setattr(looking, "open_browser", nullcontext)
    monkeypatch.setattr(looking, "problems_on", lambda _, file: re.findall(r"wrong|href", file.read_text("utf-8")))
    good, bad, made = tmp_path / "good.html", tmp_path / "bad.html", tmp_path / "made.md"
    good.write_text("<p>well</p>", encoding="utf-8")
    assert command(monkeypatch, capfd, good) == (0, f"{good}: good\n", "")
    bad.write_text("<a href>wrong</a>", encoding="utf-8")
    made.write_text("[there](#there)", encoding="utf-8")
    lines = f"{bad}: href; wrong\n{good}: good\n{made}: href; href\n"  # of the icon and of the link
    assert command(monkeypatch, capfd, bad, good, made) == (1, lines, "")


@pytest.mark.usefixtures("browser")
def test_a_missing_page_is_bad_input(monkeypatch, capfd, tmp_path):
    code, out, err = command(monkeypatch, capfd, tmp_path / "none.html")
    assert (code, out) == (2, "")
    assert "is no file" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("what", ["playwright", "chromium"])
def test_what_is_missing_is_said(monkeypatch, capfd, tmp_path, what):
    if what == "playwright":
        monkeypatch.setattr(looking, "find_spec", lambda _: None)
    else:
        monkeypatch.setattr(looking, "find_spec", lambda _: True)
        monkeypatch.setattr(looking, "find_browser", lambda: None)
    code, out, err = command(monkeypatch, capfd, tmp_path / "page.html")
    assert (code, err) == (0, "")
    assert out.startswith("not checked: ")
    assert "install" in out
    with pytest.raises(InputError, match="install"), looking.open_browser():
        pass


def test_the_browser_is_looked_for_on_the_path(monkeypatch, tmp_path):
    monkeypatch.setattr(looking, "_PLACES", ())
    monkeypatch.setenv("PATH", str(tmp_path))
    assert looking.find_browser() is None
    program = tmp_path / "google-chrome"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert looking.find_browser() == str(program)
