"""The verification manual: its rows pass, wrong ones fail everywhere, and its files say the same.

The quick run is made once in a process; with pytest-xdist, `--dist loadfile` keeps the tests that share it in one.
"""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from comparisons.cli import group
from comparisons.lab.report import drawing, write_report
from comparisons.lab.report.reader import parts_of
from comparisons.lab.tables import Grid
from comparisons.verification import study
from comparisons.verification.chapters import plate
from comparisons.verification.exhibits import EXHIBITS, overview, pictures, results
from comparisons.verification.report import as_json, report
from comparisons.verification.row import Kind, absolute
from comparisons.verification.tables import HEADINGS, cells
from qvi_contact.basics import terminal
from tests.comparisons.conftest import outline
from tests.comparisons.verification_parts import DOCUMENT, PASSING

SHOWN = {"rings": "[m]", "corner-rates": "[length]", "wedge": "[length]", "examples/gravity_dam": "[m]"}
"""Problems whose bodies are drawn, and the unit of their axes: two files in other units, two without."""
COMMITTED = Path(study.__file__).parents[1] / "reports" / "verification"


def quiet(_=""):
    """Progress that nobody sees."""


@pytest.fixture(scope="module")
def quick():
    return study.run(study.CHAPTERS, quick=True, advance=quiet)


@pytest.fixture(scope="module")
def manual(quick):
    """The report of the quick run; what its pictures show is seen in outlines."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "svg_text", outline)
        return report(quick, pictures(SHOWN), results(["rings"], quick=True))


def rows(document):
    return [row for chapter in document["chapters"] for problem in chapter["problems"] for row in problem["rows"]]


def keys(data):
    """All keys of nested plain data."""
    if isinstance(data, dict):
        yield from data
    for value in data.values() if isinstance(data, dict) else data if isinstance(data, list) else ():
        yield from keys(value)


def command(monkeypatch, capfd, *arguments):
    """Exit status, standard output and standard error of the command."""
    monkeypatch.setattr(sys, "argv", ["comparisons", "verify", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        terminal.run(group, "comparisons")
    out, err = capfd.readouterr()
    return caught.value.code, out, err


def markdown_rows(text):
    """Cells of all rows of the problems, as a reader of the Markdown takes them."""
    parts = parts_of(text.replace("<details>", "").replace("</details>", ""))
    return [row for part in parts if isinstance(part, Grid) and part.headings == HEADINGS for row in part.rows]


def test_every_row_of_the_quick_run_passes(quick):
    assert [row for row in rows(quick) if not row["passed"]] == []
    assert quick["passed"]
    assert quick["counts"] == {"rows": len(rows(quick)), "passed": len(rows(quick)), "failed": 0}
    assert all(row["certified"] for row in rows(quick))


def test_every_kind_of_reference_is_there(quick):
    assert {row["kind"] for row in rows(quick)} == {kind.value for kind in Kind}


def test_every_problem_has_rows_and_says_what_it_is(quick):
    for chapter in quick["chapters"]:
        for problem in chapter["problems"]:
            assert problem["rows"]
            assert problem["about"].endswith(".")


def test_no_reference_is_without_a_source(quick):
    assert all(row["source"] for row in rows(quick))


def test_names_are_unique():
    names = [name for chapter, problems in study.CHAPTERS.items() for name in (chapter, *problems)]
    shared = {name for name in names if names.count(name) > 1}
    assert not shared


def test_plain_data_without_times(quick):
    assert json.loads(json.dumps(quick, allow_nan=False)) == quick
    assert not {"seconds", "began", "date", "timings", "load_average"} & set(keys(quick))


@pytest.mark.usefixtures("outlined")
def test_a_wrong_reference_fails_its_row_the_status_and_both_files(monkeypatch, capfd, tmp_path):
    """One force of the displacement codes moved by a thousandth, of three."""
    monkeypatch.setattr(plate, "SETTLED", {**plate.SETTLED, 0.15: plate.SETTLED[0.15] * 1.001})
    status, out, err = command(monkeypatch, capfd, "--quick", "--only", "plate-graded", "--out", tmp_path)
    assert (status, err) == (1, "")
    assert "1 of 3 rows FAILED" in out
    pages = [(tmp_path / f"verification.{form}").read_text(encoding="utf-8") for form in ("md", "html")]
    assert all("1 of 3 rows FAILED" in page for page in pages)
    assert all("python -m comparisons verify --only plate-graded --quick" in page for page in pages)
    table = markdown_rows(pages[0])
    assert [cells[-1] for cells in table] == ["passed", "FAILED", "passed"]
    assert "μ = 0.15" in table[1][0]


def breaks_off(quick):
    """A problem that ends <early>."""
    del quick
    yield PASSING
    raise ZeroDivisionError("the mesh has\n no <cells> | none")


@pytest.mark.usefixtures("outlined")
def test_a_crash_is_a_failed_row_with_the_reason(monkeypatch, capfd, tmp_path):
    def sound(quick):
        """A sound problem."""
        del quick
        yield PASSING

    def empty(quick):
        """An empty problem."""
        del quick
        yield from ()

    problems = {"first": breaks_off, "second": sound, "third": empty}
    chapters = {"paper": problems}
    document = study.run(chapters, quick=False, advance=quiet)
    assert [[row["passed"] for row in problem["rows"]] for problem in document["chapters"][0]["problems"]] == [
        [True, False],
        [True],
        [False],
    ]
    assert document["counts"] == {"rows": 4, "passed": 2, "failed": 2}
    monkeypatch.setattr(study.choose, "__defaults__", (chapters,))
    status, out, _ = command(monkeypatch, capfd, "--out", tmp_path)
    assert status == 1
    reason = "ZeroDivisionError: the mesh has no <cells> | none"
    assert reason in out
    table = markdown_rows((tmp_path / "verification.md").read_text(encoding="utf-8"))
    assert table[1][5] == reason
    assert "<cells" not in (tmp_path / "verification.html").read_text(encoding="utf-8")


def test_the_manual_holds_the_rows(quick, manual):
    assert markdown_rows(manual.text) == [cells(row) for row in rows(quick)]


@pytest.mark.usefixtures("outlined")
def test_every_chapter_says_what_it_shows(manual):
    """A chapter that the template does not know is an error, not left out."""
    assert len(re.findall(r"^- \*Shows\*: .*$", manual.text, flags=re.MULTILINE)) == len(study.CHAPTERS)
    with pytest.raises(ValueError, match="number"):
        report({**DOCUMENT, "chapters": [{**DOCUMENT["chapters"][0], "name": "new"}]}, {})


def test_pictures_are_of_all_problems_of_their_bodies_and_of_results(quick, manual):
    names = [problem["name"] for chapter in quick["chapters"] for problem in chapter["problems"]]
    assert [label.get_text() for label in overview(quick).axes[0].get_yticklabels()] == names
    every, *others = manual.pictures.values()
    assert "error / tolerance" in every
    problems, shown = others[: len(SHOWN)], others[len(SHOWN) :]
    assert all(unit in problem for unit, problem in zip(SHOWN.values(), problems, strict=True))
    assert len(shown) == 2
    assert "imbalance" in shown[0]
    assert "Lamé and Michell" in shown[1]
    assert set(EXHIBITS) <= set(names)


@pytest.mark.parametrize("name", EXHIBITS)
def test_bodies_that_are_drawn_are_problems(name):
    """Each on few cells, so that its picture stays small."""
    assert EXHIBITS[name].posed().mesh.cell_count <= 140


def test_a_picture_is_an_svg():
    (picture,) = pictures(["wedge", "units"]).values()
    assert picture.startswith("<svg")
    assert "[length]" in picture


def test_a_picture_that_fails_costs_no_rows(monkeypatch, tmp_path):
    """It is drawn before any row is computed, and not at all where no files are written."""

    def breaks_off():
        raise ZeroDivisionError

    runs = []
    monkeypatch.setitem(EXHIBITS, "rings", replace(EXHIBITS["rings"], posed=breaks_off))
    monkeypatch.setattr(study, "run", lambda *_: runs.append(1) or DOCUMENT)
    words = ["verify", "--quick", "--only", "rings"]
    with pytest.raises(ZeroDivisionError):
        CliRunner().invoke(group, [*words, "--out", str(tmp_path)], catch_exceptions=False)
    assert not runs
    CliRunner().invoke(group, words, catch_exceptions=False)
    assert runs


def test_without_matplotlib_there_is_no_picture(monkeypatch, tmp_path):
    monkeypatch.setattr(drawing, "has_matplotlib", lambda: False)
    written = write_report(report(DOCUMENT, {}), tmp_path)
    assert [path.name for path in written] == ["verification.html", "verification.md"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["verification.html", "verification.md"]
    assert "<figure" not in written[0].read_text(encoding="utf-8")
    assert ".svg" not in written[1].read_text(encoding="utf-8")


@pytest.mark.usefixtures("outlined")
def test_two_runs_make_the_same_manual():
    one, other = (report(study.run(study.choose(["units"]), quick=True, advance=quiet), {}) for _ in range(2))
    assert one == other


@pytest.mark.usefixtures("outlined")
def test_other_data_make_other_files():
    changed = json.loads(json.dumps(DOCUMENT))
    changed["chapters"][0]["problems"][0]["rows"][0]["ours"] = 1.25
    for form in (lambda document: report(document, {}), as_json):
        assert form(DOCUMENT) == form(json.loads(json.dumps(DOCUMENT)))
        assert form(DOCUMENT) != form(changed)


@pytest.fixture
def no_work(monkeypatch):
    """Fail the test if anything is computed."""
    monkeypatch.setattr(study, "run", lambda *_, **__: pytest.fail("the run was started"))


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("place", ["file", "file/below", "/proc/below"])
def test_a_folder_that_cannot_be_written_is_refused_before_any_work(monkeypatch, capfd, tmp_path, place):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    status, out, err = command(monkeypatch, capfd, "--out", tmp_path / place)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert place.split("/")[0] in err
    assert (tmp_path / "file").read_text(encoding="utf-8") == "kept"


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("name", ["ssnv129", "", "Units"])
def test_an_unknown_name_lists_what_there_is(monkeypatch, capfd, name):
    status, out, err = command(monkeypatch, capfd, "--only", "units", name)
    assert (status, out, len(err.splitlines())) == (2, "", 1)
    assert f"got {name!r}" in err or repr(name) in err
    assert "ssnv128" in err
    assert "examples/punch" in err


def test_names_choose_chapters_and_problems():
    chosen = study.choose(["ssnv128", "units"])
    assert list(chosen) == ["ssnv128", "invariance"]
    assert list(chosen["invariance"]) == ["units"]
    assert len(chosen["ssnv128"]) == 4
    assert study.choose([]) == study.CHAPTERS


@pytest.mark.usefixtures("outlined")
def test_json_is_one_document_and_nothing_else(monkeypatch, capfd):
    """Where standard error is no terminal, progress is silent."""
    status, out, err = command(monkeypatch, capfd, "--quick", "--only", "units", "--json")
    assert (status, err) == (0, "")
    document = json.loads(out)
    assert document["schema"] == "qvi-contact/verify/2"
    assert [problem["name"] for chapter in document["chapters"] for problem in chapter["problems"]] == ["units"]


def test_the_committed_manual_has_all_problems_and_passed():
    text = (COMMITTED / "verification.md").read_text(encoding="utf-8")
    names = re.findall(r"^### `(.*)`$", text, flags=re.MULTILINE)
    assert names == [name for problems in study.CHAPTERS.values() for name in problems]
    assert {cells[-1] for cells in markdown_rows(text)} == {"passed"}
    assert "--quick" not in text


@pytest.mark.usefixtures("outlined")
def test_a_row_without_certificate_fails_in_the_files():
    row = absolute("a", 1.0, 1.0, 1.0, "s", replace(PASSING.proof, passed=False))
    document = json.loads(json.dumps(DOCUMENT))
    document["chapters"][0]["problems"][0]["rows"] = [study.as_record(row)]
    assert markdown_rows(report(document, {}).text)[0][-1] == "FAILED"
