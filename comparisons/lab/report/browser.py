"""Pages of reports looked at in a real browser without a window.

    python -m comparisons.lab.report.browser comparisons/reports/*/*.md

Needs Playwright (extra ``browser``) and a Chromium that is installed; nothing is downloaded, and no page gets to the
network.
"""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import click

from comparisons.lab.cells import position
from comparisons.lab.report.document import Document
from comparisons.lab.report.page import as_page
from qvi_contact.basics.terminal import run
from qvi_contact.errors import InputError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Error, Locator, Page, Request

Facts = dict[str, Any]

WIDTHS: Final = (390, 1280)
"""Pixels of a phone and of a desktop's window."""

_HEIGHT: Final = 900
_NAMES: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_PLACES: Final = ("/usr/bin/chromium", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome")
_WAYS: Final = ("ascending", "descending", None)  # of a column whose button is pressed again and again
_SMALLEST_DRAWN: Final = 7.0  # pixels of the letters of pictures
_SMALLEST: Final = 11.0  # pixels of all other letters
_NAMED: Final = 3  # of many alike, so many are named
_PATIENCE: Final = 30_000.0  # milliseconds


def find_browser() -> str | None:
    """Path of a Chromium that is installed; None if there is none."""
    found = (shutil.which(name) for name in _NAMES)
    places = (place for place in _PLACES if os.access(place, os.X_OK))
    return next((path for path in (*found, *places) if path), None)


def missing() -> str:
    """How to get what is needed to look at pages; empty if it is all there."""
    if find_spec("playwright") is None:
        return "playwright is not installed: python -m pip install playwright"
    if find_browser() is None:
        return "no Chromium is on the path: install your system's package chromium (Debian: apt-get install chromium)"
    return ""


@contextmanager
def open_browser() -> "Iterator[Browser]":
    """A browser for many pages, which ends with the block; `InputError` if there is none, see `missing`."""
    if remedy := missing():
        raise InputError("browser", "chromium", remedy)
    from playwright.sync_api import Error, sync_playwright

    root = hasattr(os, "geteuid") and os.geteuid() == 0
    with sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(
                executable_path=find_browser(),
                args=["--disable-gpu", "--disable-dev-shm-usage", *(["--no-sandbox"] if root else [])],
                timeout=_PATIENCE,
            )
        except Error as error:
            raise InputError("browser", str(find_browser()), f"does not start: {_first_line(error)}") from error
        with browser:
            yield browser


def _first_line(error: "Error") -> str:
    return error.message.splitlines()[0]


def _existing(path: str | Path) -> Path:
    page = Path(path).resolve()
    if not page.is_file():
        raise InputError("page", str(path), "is no file: give the HTML file or the Markdown of a report")
    return page


def problems_on(browser: "Browser", path: str | Path, widths: Sequence[int] = WIDTHS) -> list[str]:
    """What is wrong with a page, which gets a context of its own, in sentences; nothing if all is well.

    Nothing may be written to the console as an error, thrown or requested. At each width the page must not be wider
    than the window, every figure has to be there inside its box with letters that can be read. Tables can be sorted, by
    mouse and by keyboard; no id is there twice; links within the page lead somewhere. `InputError` if there is no such
    file.
    """
    file = _existing(path)
    said: list[str] = []
    with browser.new_page(offline=True) as page:
        page.set_default_timeout(_PATIENCE)
        _listen(page, file, said)
        page.goto(file.as_uri(), wait_until="load")
        page.evaluate("document.querySelectorAll('details').forEach((folded) => { folded.open = true; })")
        look = _script("facts.js")
        for width in widths:
            page.set_viewport_size({"width": width, "height": _HEIGHT})
            facts = page.evaluate(look)
            said += [f"at {width} pixels {problem}" for problem in _layout(facts)]
        said += _structure(facts)
        said += _sorting(page)
    return list(dict.fromkeys(said))


def _script(name: str) -> str:
    """A function of JavaScript."""
    return files("comparisons.lab.report").joinpath(name).read_text(encoding="utf-8")


def _listen(page: "Page", path: Path, said: list[str]) -> None:
    """Write down what the page complains of, and whatever it asks for besides itself."""
    own = path.as_uri()

    def hear(message: "ConsoleMessage") -> None:
        if message.type == "error":
            said.append(f"error in the console: {message.text}")

    def ask(request: "Request") -> None:
        if request.url.split("#")[0] != own and not request.url.startswith(("data:", "blob:")):
            said.append(f"the page asks for {request.url}")

    page.on("console", hear)
    page.on("pageerror", lambda error: said.append(f"exception in a script: {_first_line(error)}"))
    page.on("request", ask)


def _layout(facts: Facts) -> Iterator[str]:
    """What is wrong at one width."""
    if facts["scroll"] > facts["width"]:
        yield f"the page is {facts['scroll']} wide: it has to be moved sideways to be read"
    if facts["outside"]:
        yield f"outside of the window or of its box: {_some(facts['outside'])}"
    yield from _letters(facts["texts"])
    for figure in facts["figures"]:
        yield from _figure(figure)


def _letters(texts: Sequence[Facts]) -> Iterator[str]:
    """Letters that are smaller than they may be."""
    small = [
        f"{text['name']} ({text['letters']:.1f})"
        for text in texts
        if text["letters"] < (_SMALLEST_DRAWN if text["drawn"] else _SMALLEST)
    ]
    if small:
        yield f"letters too small to be read: {_some(small)}"


def _figure(figure: Facts) -> Iterator[str]:
    name = f"figure {figure['name']}"
    if not figure["visible"]:
        yield f"{name} is not visible"
    elif not figure["drawn"]:
        yield f"{name} is empty"
    if figure["outside"]:
        yield f"{name} is not inside its box"
    if figure["cut"]:
        yield f"{name} cuts off {_some(figure['cut'])}"


def _structure(facts: Facts) -> Iterator[str]:
    """What does not depend on the width."""
    if facts["repeated"]:
        yield f"ids that are there more than once: {_some(facts['repeated'])}"
    if facts["dead"]:
        yield f"links that lead nowhere: {_some(facts['dead'])}"
    if not facts["language"]:
        yield "the page does not say which language it is in"
    if not facts["title"]:
        yield "the page has no title"


def _some(names: Sequence[str]) -> str:
    """The first few, and how many more."""
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")


def _sorting(page: "Page") -> Iterator[str]:
    """What is wrong with the sorting of tables."""
    for number, table in enumerate(page.locator("table.sortable").all(), start=1):
        facts = table.evaluate(_script("presses.js"))
        if len(facts["states"]) != facts["columns"]:
            yield f"table {number} cannot be sorted by all its columns"
            continue
        for column, states in enumerate(facts["states"]):
            problems = (_sorted(column, state, facts["written"], way) for way, state in zip(_WAYS, states, strict=True))
            found = [*problems, _words_turned(*([row[column] for row in state["rows"]] for state in states[:2]))]
            yield from (f"table {number}, column {column + 1}: {problem}" for problem in found if problem)
        if not _pressed(table):
            yield f"table {number} cannot be sorted by keyboard and mouse"


def _sorted(column: int, state: Facts, written: list[list[str]], way: str | None) -> str:
    """What is wrong when a column should be sorted this way."""
    rows, found = state["rows"], state["ways"][column]
    if found != way:
        return f"aria-sort is {found}, not {way}"
    if sum(each is not None for each in state["ways"]) != (way is not None):
        return "more than one column says that it is sorted"
    if sorted(rows) != sorted(written):
        return "sorting changes the rows"
    if way is None:
        return "" if rows == written else "the third press does not bring back the order of the rows as written"
    return "" if _in_order([row[column] for row in rows], way) else f"the rows are not {way}"


def _words_turned(up: Sequence[str], down: Sequence[str]) -> str:
    """Words have no order here, but one way has to be the other turned round."""
    one, other = ([cell for cell in cells if position(cell)[0] == 1] for cells in (up, down))
    return "" if one == other[::-1] else "words are not turned round with the direction"


def _pressed(table: "Locator") -> bool:
    """Whether the first button answers a key, and then the mouse."""
    from playwright.sync_api import TimeoutError as OutOfReach

    heading, button = table.locator("thead th").first, table.locator("thead th button").first
    try:
        button.press("Enter")
        by_key = heading.get_attribute("aria-sort")
        button.click()
    except OutOfReach:
        return False
    return (by_key, heading.get_attribute("aria-sort")) == _WAYS[:2]


def _in_order(cells: Sequence[str], way: str) -> bool:
    """Whether numbers are in this order, with words and cells that say nothing behind them in either."""
    sign = 1.0 if way == "ascending" else -1.0
    places = [(kind, sign * value) for kind, value in map(position, cells)]
    return places == sorted(places)


def _made(path: Path, folder: Path) -> Path:
    """The page itself, or the one of a report's Markdown, in this folder."""
    if path.suffix != ".md":
        return path
    page = folder / path.with_suffix(".html").name
    page.write_text(as_page(Document.read(path)), encoding="utf-8")
    return page


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("pages", nargs=-1, required=True, metavar="FILE...")
def command(pages: tuple[str, ...]) -> int:
    """Look at pages in a headless Chromium, at the widths of a phone and of a desktop.

    FILE is a page, or the Markdown of a report, of which the page is made.

    One line a page. The exit status is 1 if something is wrong with one of them, 0 if not, or if nothing could be
    checked because Playwright or Chromium is missing.
    """
    if remedy := missing():
        click.echo(f"not checked: {remedy}")
        return 0
    wrong = False
    for page in pages:
        _existing(page)
    with open_browser() as browser, TemporaryDirectory() as folder:
        for page in pages:
            problems = problems_on(browser, _made(Path(page), Path(folder)))
            click.echo(f"{page}: {'; '.join(problems) or 'good'}")
            wrong |= bool(problems)
    return int(wrong)


if __name__ == "__main__":
    run(command, "python -m comparisons.lab.report.browser")
