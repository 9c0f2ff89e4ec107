"""Tables on a narrow terminal and in Markdown."""

from io import StringIO

import pytest
from pandas import DataFrame
from rich.console import Console

from comparisons.lab.report.numbers import fixed
from comparisons.lab.tables import Grid, crossed, grid_of, markdown_table, print_table, rich_table

NAMES = ("direct:sparse-cholesky", "direct:sparse-lu", "qp:clarabel")


def printed(grid, width=120):
    screen = StringIO()
    print_table(Console(file=screen, width=width, highlight=False, markup=False, color_system=None), grid)
    return screen.getvalue()


def wide(cell):
    """More columns than a terminal has room for."""
    headings = ("solver", *(f"a long heading of {number}" for number in range(12)))
    return Grid("Times", headings, [(name, *(cell,) * 12) for name in NAMES])


@pytest.mark.parametrize("width", [40, 80, 120])
def test_no_number_is_broken_where_there_is_little_room(width):
    """Then a row is a list of its cells."""
    lines = printed(wide("12.3 microseconds"), width).splitlines()
    assert sum("12.3 microseconds" in line for line in lines) == 36
    assert [line for line in lines if line.startswith("solver: ")] == [f"solver: {name}" for name in NAMES]
    assert sum("12.3 microseconds" in line for line in printed(wide("12.3 microseconds"), 300).splitlines()) == 3


@pytest.mark.parametrize("width", [110, 120])
def test_names_of_rows_are_not_cut(width):
    lines = printed(wide("twelve"), width).splitlines()
    assert [line.split()[0] for line in lines if line.strip().startswith(("direct:", "qp:"))] == list(NAMES)
    assert max(map(len, lines)) <= width


@pytest.mark.parametrize("first", ["name", "a sentence that takes more room than there is on a terminal of this width"])
def test_nothing_is_cut(first):
    text = printed(Grid("", ("about", "detail"), [(first, "x" * 90)]), 40)
    assert text.count("x") == 90
    assert set(first.split()) <= set(text.split())
    assert max(map(len, text.splitlines())) <= 40


@pytest.mark.parametrize("headings", [(), ("a",), ("a", "b|c")])
def test_no_rows(headings):
    grid = Grid("Empty", headings, [])
    assert all(heading in printed(grid) for heading in headings)
    assert markdown_table(grid) == "No rows.\n"


@pytest.mark.parametrize(
    ("cells", "numeric"),
    [
        (("12", "none", "3.5 ms"), True),
        (("−12", "> 99 %", "n/a"), True),
        (("< 1e-9", "-", ""), True),
        (("none", "n/a", ""), False),
        (("1", "stalled"), False),
        (("1.2.3", "0.9.1"), False),
    ],
)
def test_columns_of_numbers_stand_to_the_right(cells, numeric):
    grid = Grid("", ("name", "value"), [("x", cell) for cell in cells])
    assert markdown_table(grid).splitlines()[1] == f"| --- | {'---:' if numeric else '---'} |"
    assert [column.justify for column in rich_table(grid).columns] == ["left", "right" if numeric else "left"]


def test_bars_in_headings_and_cells_are_escaped_once():
    lines = markdown_table(Grid("", ("|σ|", "b"), [("|x|", "1")])).splitlines()
    assert (lines[0], lines[2]) == (r"| \|σ\| | b |", r"| \|x\| | 1 |")


def test_a_table_is_declared_by_its_columns():
    frame = DataFrame({"time": [0.5, None], "name": ["a", None], "other": [1, 2]})
    grid = grid_of(frame, {"name": "solver", "time": "time [s]"}, {"time": fixed(".2f")})
    assert grid == Grid("", ("solver", "time [s]"), [("a", "0.50"), ("none", "none")])
    assert grid_of(frame, ("time",), {"time": fixed(".1f")}).rows == [("0.5",), ("none",)]


def test_groups_are_crossed_and_empty_ones_say_so():
    frame = DataFrame({"solver": list("bbaa"), "level": ["low", "high", "low", "low"], "time": [1, 2, 3, 4]})
    grid = crossed(frame, "solver", "level", lambda found: str(found.time.sum()))
    assert grid == Grid("", ("solver", "low", "high"), [("b", "1", "2"), ("a", "7", "none")])
    ordered = crossed(frame, "solver", "level", lambda found: str(len(found)), ("high", "mid"))
    assert ordered.rows == [("b", "1", "none"), ("a", "none", "none")]
