"""Tables of text: on a narrow terminal and in Markdown, how cells are sorted, numbers read, and settings are told."""

import math
from io import StringIO

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pandas import DataFrame
from rich.console import Console

from comparisons import lab
from comparisons.lab import Grid, number_in, position
from comparisons.lab import report as room
from comparisons.lab.study import Row

MACHINE = {
    "processor": "P1", "cores": 4, "memory_bytes": 2**34, "system": "Linux, x86_64", "python": "CPython 3.12.1",
}  # fmt: skip

NAMES = ("direct:sparse-cholesky", "direct:sparse-lu", "qp:clarabel")


def printed(grid, width=120):
    screen = StringIO()
    lab.print_table(Console(file=screen, width=width, highlight=False, markup=False, color_system=None), grid)
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
    assert lab.markdown_table(grid) == "No rows.\n"


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
    assert lab.markdown_table(grid).splitlines()[1] == f"| --- | {'---:' if numeric else '---'} |"
    assert [column.justify for column in lab.rich_table(grid).columns] == ["left", "right" if numeric else "left"]


def test_bars_in_headings_and_cells_are_escaped_once():
    lines = lab.markdown_table(Grid("", ("|σ|", "b"), [("|x|", "1")])).splitlines()
    assert (lines[0], lines[2]) == (r"| \|σ\| | b |", r"| \|x\| | 1 |")


def test_a_table_is_declared_by_its_columns():
    frame = DataFrame({"time": [0.5, None], "name": ["a", None], "other": [1, 2]})
    grid = lab.grid_of(frame, {"name": "solver", "time": "time [s]"}, {"time": room.fixed(".2f")})
    assert grid == Grid("", ("solver", "time [s]"), [("a", "0.50"), ("none", "none")])
    assert lab.grid_of(frame, ("time",), {"time": room.fixed(".1f")}).rows == [("0.5",), ("none",)]


def test_groups_are_crossed_and_empty_ones_say_so():
    frame = DataFrame({"solver": list("bbaa"), "level": ["low", "high", "low", "low"], "time": [1, 2, 3, 4]})
    grid = lab.crossed(frame, "solver", "level", lambda found: str(found.time.sum()))
    assert grid == Grid("", ("solver", "low", "high"), [("b", "1", "2"), ("a", "7", "none")])
    ordered = lab.crossed(frame, "solver", "level", lambda found: str(len(found)), ("high", "mid"))
    assert ordered.rows == [("b", "1", "none"), ("a", "none", "none")]


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
        for form in (room.seconds, room.scientific, room.significant, room.memory):
            assert number_in(form(small)) <= number_in(form(large)) * (1.0 + 1e-12)

    @given(st.text("0123456789.,eE+-−<>≤~ %µsminhKMGTiB∞²½٣f/:_abé\ud800", max_size=12))
    def test_a_key_is_read_like_its_cell(self, cell):
        key = lab.sort_key(cell)
        assert (key is None) == (position(cell)[0] == 1)
        if key:
            assert lab.sort_key(key) == key

    @given(st.lists(st.sampled_from(["1", "-", "2 s", "n/a"]), min_size=1))
    def test_columns_of_numbers(self, cells):
        assert lab.is_numeric(cells) == any(cell[0].isdigit() for cell in cells)
        assert not lab.is_numeric([*cells, "word"])
        assert not lab.is_numeric([*cells, "3 of them failed for a reason that is long"])


class TestNumbers:
    """Formats of room."""

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            (room.scientific(1.234e-5), "1.2e-5"), (room.scientific(9.99e9, 1), "1e10"),
            (room.scientific(-2e-12, 3), "-2.00e-12"), (room.scientific(0.0), "0"),
            (room.significant(0.0012345), "0.00123"), (room.significant(1234567.0), "1230000"),
            (room.significant(-0.0), "0"), (room.significant(2.0), "2"),
            (room.seconds(3.4e-4), "340 µs"), (room.seconds(0.99999), "1 s"),
            (room.seconds(0.0123), "12.3 ms"),
            (room.seconds(119.0), "119 s"), (room.seconds(150.0), "2.5 min"), (room.seconds(9000.0), "2.5 h"),
            (room.seconds(0.0), "0 s"), (room.memory(2**34), "16 GiB"), (room.memory(12), "12 bytes"),
            (room.percent(0.123), "12 %"), (room.percent(0.0), "0 %"), (room.percent(1.0), "100 %"),
            (room.percent(0.0001), "< 1 %"), (room.percent(0.005), "< 1 %"), (room.percent(0.9999), "> 99 %"),
            (room.percent(0.99961, 1), "> 99.9 %"),
            (room.percent(1.5), "150 %"), (room.percent(-0.1), "-10 %"),
            (room.listing([]), "none"), (room.listing(["a"]), "a"), (room.listing(["a", "b"]), "a and b"),
            (room.listing(["a", "b", "c"], "or"), "a, b or c"),
        ],
    )  # fmt: skip
    def test_texts(self, text, expected):
        assert text == expected

    @pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf])
    def test_what_is_no_number_is_none(self, value):
        forms = (room.scientific, room.significant, room.seconds, room.memory, room.percent)
        assert {form(value) for form in forms} == {"none"}

    @settings(max_examples=50)
    @given(st.floats(0.0, 1.0), st.integers(0, 4))
    def test_only_all_is_all_and_only_nothing_is_nothing(self, share, digits):
        text = room.percent(share, digits)
        assert (number_in(text) == 1.0) == (share == 1.0)
        assert (number_in(text) == 0.0) == (share == 0.0)


def row(position=0, status="done", load=0.5, seed=7, **environment):
    """A stored row; more of its environment by keyword."""
    known = {"machine": MACHINE, "versions": {"numpy": "2.0.0"}, "threads": 1, "timeout_seconds": 60.0}
    case = {"repeat": 0, "seed": seed}
    environment = known | {"memory_mib": None} | environment
    return Row(position, "0", case, status, "", {}, None, 0.1, "2026-01-01", load, environment)


class TestEnvironment:
    """Tables of what rows were computed with."""

    def test_several_machines_and_versions_are_said(self):
        other = row(2, machine=MACHINE | {"processor": "P2"}, versions={"numpy": "2.1.0", "osqp": None}, memory_mib=512)
        rows = [row(0), row(1), other, row(3, "crashed", machine=None, versions={})]
        runs, machines, versions = room.environment_grids(rows)
        assert machines.title == "Machines"
        assert "2 kinds of machine" in machines.note
        assert [(cells[0], cells[-1]) for cells in machines.rows] == [("P1", "2"), ("P2", "1"), ("unknown", "1")]
        assert versions.rows[:3] == [("numpy", "2.0.0", "2"), ("numpy", "2.1.0", "1"), ("numpy", "unknown", "1")]
        assert ("osqp", "not installed", "1") in versions.rows
        assert versions.note == "The rows were computed with different versions of numpy."
        assert dict(runs.rows)["memory limit of a run"] == "512 MiB (1), none (3)"
        assert room.environment_grids(rows[::-1]) == [runs, machines, versions]

    def test_rows_that_say_nothing(self):
        runs, machine, versions = room.environment_grids([row(load=None, machine=None, versions={})])
        assert machine.rows == [("unknown",) * 5 + ("1",)]
        assert versions.rows == []
        assert dict(runs.rows)["load average before a run"] == "unknown"
        assert dict(room.environment_grids([])[0].rows)["status"] == "none"
