"""The verification manual: its rows pass, wrong ones fail everywhere, and its files and pictures say the same.

The quick run is made once in a process; with pytest-xdist, `--dist loadfile` keeps the tests that share it in one.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from comparisons import verification as room
from comparisons.lab import Grid
from comparisons.lab.report import parts_of, write_report
from qvi_contact import InputError
from tests.comparisons.conftest import outlines
from tests.comparisons.convergence_parts import REPORTS, command, report_of

SHOWN = {"rings": "[m]", "corner-rates": "[length]", "wedge": "[length]"}
"""Problems whose bodies are drawn, and the unit of their axes: two files in other units, two without."""
PASSING = room.absolute("a number", 1.0, 1.0, 1e-3, "by hand", room.Proof(passed=True, text="by hand"))
REASON = "ZeroDivisionError: the mesh has no <cells> | none"


def sound(quick):
    """A sound problem."""
    del quick
    yield PASSING


def breaks_off(quick):
    """A problem that ends <early>."""
    del quick
    yield PASSING
    raise ZeroDivisionError("the mesh has\n no <cells> | none")


def wrong(quick):
    """A problem whose reference is off by a thousandth, and one without a certificate."""
    del quick
    yield room.absolute("moved", 1.0, 1.001, 1e-4, "by hand", PASSING.proof)
    yield replace(PASSING, proof=room.Proof(passed=False, text="none"))


def empty(quick):
    """An empty problem."""
    del quick
    yield from ()


def ran(problems):
    """The document of a run of these problems."""
    return room.run({"paper": problems}, quick=True, advance=lambda _="": None)


DOCUMENT = ran({"number": sound})


@pytest.fixture(scope="module")
def quick():
    return room.run(room.CHAPTERS, quick=True, advance=lambda _="": None)


@pytest.fixture(scope="module")
def manual(quick):
    """The report of the quick run; what its pictures show is seen in outlines."""
    pytest.importorskip("matplotlib")
    with outlines():
        return report_of("verification", quick, room.pictures(SHOWN), room.results(["rings"], quick=True))


def rows(document):
    return [row for chapter in document["chapters"] for problem in chapter["problems"] for row in problem["rows"]]


def keys(data):
    """All keys of nested plain data."""
    if isinstance(data, dict):
        yield from data
    for value in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from keys(value)


def markdown_rows(text):
    """Cells of all rows of the problems, as a reader of the Markdown takes them."""
    parts = parts_of(text.replace("<details>", "").replace("</details>", ""))
    return [row for part in parts if isinstance(part, Grid) and part.headings == room.HEADINGS for row in part.rows]


def test_every_row_of_the_quick_run_passes(quick):
    assert [row for row in rows(quick) if not row["passed"]] == []
    assert quick["passed"]
    assert quick["counts"] == {"rows": len(rows(quick)), "passed": len(rows(quick)), "failed": 0}
    assert all(row["certified"] and row["source"] for row in rows(quick))
    assert {row["kind"] for row in rows(quick)} == {kind.value for kind in room.Kind}


def test_every_problem_has_rows_and_a_name_of_its_own_and_says_what_it_is(quick):
    for chapter in quick["chapters"]:
        for problem in chapter["problems"]:
            assert problem["rows"]
            assert problem["about"].endswith(".")
    names = [name for chapter, problems in room.CHAPTERS.items() for name in (chapter, *problems)]
    assert len(set(names)) == len(names)


def test_plain_data_without_times(quick):
    assert json.loads(json.dumps(quick, allow_nan=False)) == quick
    assert not {"seconds", "began", "date", "timings", "load_average"} & set(keys(quick))


def test_the_manual_holds_the_rows_and_what_each_chapter_shows(manual, quick):
    """A chapter that the template does not know is an error, not left out."""
    assert markdown_rows(manual.text) == [room.cells(row) for row in rows(quick)]
    assert len(re.findall(r"^- \*Shows\*: .*$", manual.text, flags=re.MULTILINE)) == len(room.CHAPTERS)
    with pytest.raises(ValueError, match="number"):
        report_of("verification", {**DOCUMENT, "chapters": [{**DOCUMENT["chapters"][0], "name": "new"}]}, {})


def test_the_committed_manual_has_all_problems_and_passed():
    text = (REPORTS / "verification" / "verification.md").read_text(encoding="utf-8")
    names = re.findall(r"^### `(.*)`$", text, flags=re.MULTILINE)
    assert names == [name for problems in room.CHAPTERS.values() for name in problems]
    assert {cells[-1] for cells in markdown_rows(text)} == {"passed"}
    assert "--quick" not in text


@pytest.mark.usefixtures("outlined")
@pytest.mark.parametrize(("problem", "failed"), [(wrong, 2), (breaks_off, 1), (empty, 1)])
def test_what_is_wrong_fails_its_row_the_status_and_both_files(problem, failed, monkeypatch, tmp_path):
    document = ran({"first": problem, "second": sound})
    count = len(rows(document))
    assert document["counts"] == {"rows": count, "passed": count - failed, "failed": failed}
    monkeypatch.setitem(room.CHAPTERS, "paper", {"first": problem, "second": sound})
    ended = command("verify", "--quick", "--only", "paper", "--out", tmp_path)
    assert (ended.status, ended.err) == (1, "")
    pages = [(tmp_path / f"verification.{form}").read_text(encoding="utf-8") for form in ("md", "html")]
    assert all(f"{failed} of {count} rows FAILED" in text for text in (ended.out, *pages))
    assert all("python -m comparisons verify --only paper --quick" in page for page in pages)
    table = markdown_rows(pages[0])
    assert [cells[-1] for cells in table] == ["passed" if row["passed"] else "FAILED" for row in rows(document)]
    if problem is breaks_off:
        assert (table[1][5], "<cells" in pages[1]) == (REASON, False)


def test_json_is_one_document_and_nothing_else():
    """Where standard error is no terminal, progress is silent."""
    ended = command("verify", "--quick", "--only", "units", "--json")
    assert (ended.status, ended.err) == (0, "")
    document = json.loads(ended.out)
    assert document["schema"] == "qvi-contact/verify/2"
    assert [problem["name"] for chapter in document["chapters"] for problem in chapter["problems"]] == ["units"]


@pytest.mark.parametrize("name", ["ssnv129", "", "Units"])
def test_an_unknown_name_lists_what_there_is(name):
    with pytest.raises(InputError, match="examples/punch") as caught:
        room.choose(["units", name])
    assert caught.value.field == "--only"


def test_names_choose_chapters_and_problems():
    chosen = room.choose(["ssnv128", "units"])
    assert list(chosen) == ["ssnv128", "invariance"]
    assert list(chosen["invariance"]) == ["units"]
    assert len(chosen["ssnv128"]) == 4
    assert room.choose([]) == room.CHAPTERS


@pytest.mark.usefixtures("outlined")
def test_equal_data_make_equal_files_and_others_make_others():
    changed, again = json.loads(json.dumps(DOCUMENT)), json.loads(json.dumps(DOCUMENT))
    changed["chapters"][0]["problems"][0]["rows"][0]["ours"] = 1.25
    for form in (lambda document: report_of("verification", document, {}), room.as_json):
        assert form(DOCUMENT) == form(again)
        assert form(DOCUMENT) != form(changed)


def test_without_matplotlib_there_is_no_picture(without, tmp_path):
    without("matplotlib")
    written = write_report(report_of("verification", DOCUMENT, {}), tmp_path)
    assert [path.name for path in written] == ["verification.html", "verification.md"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["verification.html", "verification.md"]
    assert "<figure" not in written[0].read_text(encoding="utf-8")
    assert ".svg" not in written[1].read_text(encoding="utf-8")


PAIRS = {
    "rings": ([(0, 0)], 4e-3),
    "press-fit": ([(0, 0), (1, 1)], 0.02),
    "cylinder-in-bore": ([(0, 0)], 0.03),
    "sliding-corner": ([(0, 0), (1, 1)], 0.02),
    "cylinder-on-block": ([(0, 0)], 0.06),
    "half-discs": ([(0, 0), (1, 1)], 0.09),
    "slip-torque": ([(0, 0)], 1e-4),
    "wedge": ([(0, 0), (1, 0)], 1e-5),
}
"""Which of our curves lies on which known one, and how far off it may be over the largest, on coarse meshes."""


def departure(ours, known, logarithmic):
    """Largest distance of our points from the line through known ones, over its largest value."""
    power = np.log if logarithmic else np.asarray
    inside = (ours.x >= known.x.min()) & (ours.x <= known.x.max()) & (ours.x < 0.98 * known.x.max())
    line = np.interp(power(ours.x[inside]), power(known.x), power(known.y))
    expected = np.exp(line) if logarithmic else line
    scale = expected if logarithmic else np.abs(known.y).max()
    return float(np.abs((ours.y[inside] - expected) / scale).max())


class TestPictures:
    """Bodies and results."""

    @pytest.mark.parametrize("name", PAIRS)
    def test_what_was_computed_lies_on_what_is_known(self, name):
        graph, (pairs, tolerance) = room.EXHIBITS[name].graph(True), PAIRS[name]
        for ours, known in pairs:
            assert departure(graph.ours[ours], graph.known[known], graph.logarithmic) < tolerance
        assert graph.x.endswith("]")
        assert graph.y.endswith("]")

    def test_every_benchmark_has_both_pictures(self):
        """But for the conservation of forces, which is about the others. Few cells keep a body's picture small."""
        own = {*room.CHAPTERS["benchmarks"], "wedge", "oblique-block"} - {"conservation"}
        assert own == set(room.EXHIBITS)
        assert own <= {*room.CHAPTERS["benchmarks"], *room.CHAPTERS["limits"], *room.CHAPTERS["examples"]}
        assert max(each.posed().mesh.cell_count for each in room.EXHIBITS.values()) <= 140

    def test_pictures_are_of_all_problems_of_their_bodies_and_of_results(self, quick, manual):
        names = [problem["name"] for chapter in quick["chapters"] for problem in chapter["problems"]]
        assert [label.get_text() for label in room.overview(quick).axes[0].get_yticklabels()] == names
        every, *others = manual.pictures.values()
        assert "error / tolerance" in every
        assert all(unit in problem for unit, problem in zip(SHOWN.values(), others[: len(SHOWN)], strict=True))
        balance, known = others[len(SHOWN) :]
        assert ("imbalance" in balance, "Lamé and Michell" in known) == (True, True)

    def test_a_picture_is_narrow_and_tells_curves_by_more_than_colour(self):
        drawn = room.figure(room.EXHIBITS["wedge"].graph(True))
        assert drawn.get_size_inches()[0] * 96.0 * 0.85 <= 348.0  # of 390 pixels, less margins and frame
        lines = drawn.axes[0].get_lines()
        assert len({(line.get_marker(), line.get_linestyle()) for line in lines}) == len(lines) == 3

    def test_balance_is_drawn_of_the_rows(self):
        """Rounding far to the left of errors; without rows nothing breaks."""
        made = [
            room.absolute(f"dam, {model}: the same", value, 0.0, 1.0, "equilibrium", PASSING.proof)
            for model, value in (("stresses", 1e-16), ("displacements", 1e-3))
        ]
        for chosen, places in ((made, [[1e-16], [1e-3]]), ([room.crash("conservation", "no")], [[], []])):
            problem = {"name": "conservation", "rows": [room.as_record(row) for row in chosen]}
            lines = room.conservation({"chapters": [{"problems": [problem]}]}).axes[0].get_lines()
            assert [line.get_xdata().tolist() if len(line.get_xdata()) else [] for line in lines] == places
